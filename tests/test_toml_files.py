"""TOML as anybody may write it: a table or one sentence, in bounded time and memory."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tapelayer.errors import SetupRefused
from tapelayer.toml_files import read_toml, toml_text

TEXTS = st.text(st.characters(codec="utf-8"), max_size=20)
NUMBERS = st.booleans() | st.integers(-(2**63), 2**63 - 1) | st.floats(allow_nan=False)
VALUES = NUMBERS | TEXTS | st.lists(NUMBERS | TEXTS, max_size=4)
TABLES = st.dictionaries(TEXTS, VALUES | st.dictionaries(TEXTS, VALUES, max_size=3), max_size=4)


@given(st.dictionaries(TEXTS, TABLES, max_size=4))
def test_what_is_written_is_read_back_as_the_same(tables: dict[str, dict[str, object]]) -> None:
    again, _ = read_toml(toml_text(tables).encode(), "s", SetupRefused)
    assert repr(again) == repr(tables)


def test_what_is_written_can_be_read_by_people() -> None:
    text = toml_text({"machine": {"limits_mm": {"x": [0.0, 2500.0]}, "urdf": "a.urdf"}, "part": {"l1_mm": 1}})
    assert text == '[machine]\nlimits_mm.x = [0.0, 2500.0]\nurdf = "a.urdf"\n\n[part]\nl1_mm = 1\n'


def test_a_byte_order_mark_is_none_of_the_text() -> None:
    assert read_toml(b"\xef\xbb\xbf[part]\nl1_mm = 1\n", "s", SetupRefused) == (
        {"part": {"l1_mm": 1}},
        "[part]\nl1_mm = 1\n",
    )


@pytest.mark.parametrize("line", ["." * 900, "a.b " * 200, "1.5, " * 190, '"' + '." ".' * 150 + '"'])
def test_dots_in_a_text_are_none_of_a_name(line: str) -> None:
    text = f"texts = '{line}'\n# {line}"
    assert read_toml(text.encode(), "s", SetupRefused)[0] == {"texts": line}


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"[part\n", "s:1:6: not TOML: expected ']' at the end of a table declaration"),
        (b"# \xff", "s: byte 2 is not UTF-8; save the file as UTF-8"),
        (b"[part]\nl1_mm = " + b"[\n" * 5000, "s: tables or arrays are nested too deeply to be read"),
        # As a key of many dots: 80 GB in the standard library's parser.
        (b"\n" + b"a." * 100000 + b"b = 1", "s:2: the line has 200005 characters, expected at most 1000; break it"),
        (b"\n" + b"a . " * 17 + b"b = 1", "s:2: the line has a name with more than 16 dots; use fewer"),
        # What ends a line elsewhere ends none of TOML.
        (
            '"\u2028\\"".a.\'"\'.\t'.encode() * 6 + b"b = 1",
            "s:1: the line has a name with more than 16 dots; use fewer",
        ),
        # As a number of many digits: no error of TOML in the standard library's parser.
        (b"x = " + b"1" * 5000, "s:1: the line has 5004 characters, expected at most 1000; break it"),
        (b"#\n" * (1 << 17) + b"#", "s: has 262145 bytes, expected at most 262144; is it the right file?"),
    ],
)
def test_a_fault_is_one_sentence(data: bytes, message: str) -> None:
    with pytest.raises(SetupRefused) as refused:
        read_toml(data, "s", SetupRefused)
    assert str(refused.value) == message
