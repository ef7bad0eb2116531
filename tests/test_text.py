"""Text: whatever encoding, mark and line ends a file has, every reader reads the same."""

from __future__ import annotations

import codecs
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from post.controllers import load
from post.source import Source
from tapelayer.courses.course_file import parse_courses
from tapelayer.errors import InputFault, InputRefused, printable
from tapelayer.geometry.models import parse_mesh
from tapelayer.spraying.footprint import read_profile
from tapelayer.text import plain_text
from tapelayer.toml_files import read_toml
from tests.helpers.course_files import PLAIN, assert_same
from tests.helpers.stl_files import TETRAHEDRON, ascii

MARKS = {
    "utf-8": codecs.BOM_UTF8,
    "utf-16-le": codecs.BOM_UTF16_LE,
    "utf-16-be": codecs.BOM_UTF16_BE,
    "utf-32-le": codecs.BOM_UTF32_LE,
    "utf-32-be": codecs.BOM_UTF32_BE,
}
ENDS = ("\n", "\r\n", "\r")
LASTS = ("", "\x1a", "\x1a\r\n", "\x1a\x1a\x1a")
SPELLINGS = list(product(MARKS, (True, False), ENDS, LASTS))


def spelt(text: str, encoding: str, marked: bool, end: str, last: str) -> bytes:
    mark = MARKS[encoding] if marked else b""
    return mark + (text.replace("\n", end) + last).encode(encoding)


def plain(data: bytes) -> bytes:
    return plain_text(data, "f", InputRefused)


def courses(data: bytes) -> object:
    return parse_courses(data, "f")


def corners(data: bytes) -> bytes:
    mesh = parse_mesh(data, "f")
    return mesh.vertices[mesh.facets].tobytes()


def program(data: bytes) -> object:
    source = Source(data, load("linuxcnc"), "f")
    source.refuse()
    return bytes(source.plain).split(b"\n"), source.comments


@pytest.mark.parametrize(("encoding", "marked", "end", "last"), SPELLINGS)
def test_every_reader_reads_every_spelling_alike(
    encoding: str, marked: bool, end: str, last: str, tmp_path: Path
) -> None:
    def other(text: str) -> bytes:
        return spelt(text, encoding, marked, end, last)

    assert_same(courses(other(PLAIN.decode())), courses(PLAIN))  # type: ignore[arg-type]
    part = ascii(TETRAHEDRON)
    assert corners(other(part.decode())) == corners(part)
    nc = "%\n(plate, 50 µm)\nG0 X1 Y2\nG1 X3 F100 ; on\nM2\n%\n"
    assert program(other(nc)) == program(nc.encode())
    toml = '[tape]\nname = "µm"\nwidth_mm = 75.0\n'
    assert read_toml(other(toml), "f", InputRefused) == ({"tape": {"name": "µm", "width_mm": 75.0}}, toml)
    profile = tmp_path / "profile.txt"
    profile.write_bytes(other("# µm\n0 2\n10 1\n20 0\n"))
    np.testing.assert_array_equal(read_profile(profile).flux(np.array([0.0, 0.02])) > 0, [True, False])


@given(
    st.text(st.characters(exclude_characters="\r\x1a", exclude_categories=("Cs", "Cc")) | st.just("\n")),
    st.sampled_from(SPELLINGS),
)
def test_text_behind_a_mark_is_that_text(text: str, spelling: tuple[str, bool, str, str]) -> None:
    encoding, _, end, last = spelling
    assert plain(spelt(text, encoding, True, end, last)) == text.encode()


@given(st.binary().filter(lambda data: b"\0" not in data and b"\r" not in data and b"\x1a" not in data))
def test_other_bytes_are_handed_on_without_a_copy(data: bytes) -> None:
    if not data.startswith((*MARKS.values(), b"\x84\x31\x95\x33")):
        assert plain(data) is data


@given(st.binary(max_size=64), st.sampled_from([b"", *MARKS.values()]))
def test_any_bytes_are_text_or_refused(data: bytes, mark: bytes) -> None:
    try:
        assert b"\r" not in plain(mark + data)
    except InputRefused as refused:
        assert "save it as UTF-8" in str(refused)


def test_binary_bytes_are_no_text_in_wide_characters() -> None:
    rng = np.random.default_rng(0)
    for data in (bytes(100), rng.bytes(4000), np.arange(500, dtype="<u2").tobytes(), rng.normal(size=500).tobytes()):
        assert plain(data).translate(None, b"\r\n") == data.translate(None, b"\r\n")


def test_only_a_last_end_mark_is_no_text() -> None:
    assert plain(b"a\x1ab\n\x1a \n") == b"a\x1ab\n"
    assert plain(b"a\x1a" + b"\0" * 126) == b"a"
    assert plain(b"\x1a" * 3000).count(b"\x1a") < 3000


@pytest.mark.parametrize(
    ("data", "sentence"),
    [
        (
            b"\xff\xfe1\0\n",
            "f: the file is in UTF-16, but its byte 4 is not; it is damaged or cut short: save it as UTF-8",
        ),
        (b"\xfe\xff\xd8\x00\x00\x41", "f: the file is in UTF-16, but its byte 2 is not; it is damaged or cut short: "),
        (b"\0\0\xfe\xff\0\0\0", "f: the file is in UTF-32, but its byte 4 is not; it is damaged or cut short: "),
    ],
)
def test_a_mark_with_other_bytes_behind_it_is_refused(data: bytes, sentence: str) -> None:
    with pytest.raises(InputRefused) as caught:
        plain(data)
    assert str(caught.value).startswith(sentence)


@given(st.text(), st.text())
def test_a_message_holds_nothing_that_a_terminal_acts_on(name: str, sentence: str) -> None:
    text = str(InputRefused(name, [InputFault(3, sentence, 4)] * 2))
    assert all(line.isprintable() for line in text.split("\n")) and text.count("\n") == 1
    assert printable(printable(sentence)) == printable(sentence)
