"""Separators: files spelt as other programs spell them get one sentence, and their other faults as ever."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tapelayer.courses.separators import SPELLINGS, Separators, separators_of
from tests.helpers.course_files import GOOD, PLAIN, refusal

SIGNS = {
    "columns are separated by semicolons": (b" ", b";"),
    "columns are separated by commas": (b" ", b","),
    "numbers have decimal commas": (b".", b","),
    "columns are separated by semicolons and numbers have decimal commas": (b" .", b";,"),
}


def spelt(text: bytes, spelling: Separators) -> bytes:
    return text.translate(bytes.maketrans(*SIGNS[spelling.fault]))


@pytest.mark.parametrize("spelling", SPELLINGS, ids=lambda spelling: spelling.fault)
def test_one_cause_gets_one_sentence(spelling: Separators) -> None:
    data = spelt(PLAIN, spelling)
    changed = [row for row, (one, other) in enumerate(zip(PLAIN.split(), data.split(), strict=False)) if one != other]
    assert changed
    lines = [
        row for row, pair in enumerate(zip(PLAIN.split(b"\n"), data.split(b"\n"), strict=True), 1) if len({*pair}) > 1
    ]
    assert refusal(data) == f"f:{lines[0]}: {spelling.fault} (on {len(lines)} lines); {spelling.remedy}"


@pytest.mark.parametrize("spelling", SPELLINGS, ids=lambda spelling: spelling.fault)
def test_other_faults_are_told_as_well(spelling: Separators) -> None:
    bad = PLAIN.replace(b"60\n", b"190\n", 1)
    first, second = sorted(refusal(spelt(bad, spelling)).splitlines(), key=lambda line: "cut angle" in line)
    assert spelling.fault in first and second == refusal(bad).replace("190.0", "190")


@given(st.sampled_from(SPELLINGS), st.sampled_from(GOOD))
def test_the_spelling_is_told(spelling: Separators, path: Path) -> None:
    text = b"\n".join(line.partition(b"#")[0].strip() for line in path.read_bytes().splitlines())
    text = b"\n".join(b" ".join(line.split()) for line in text.split(b"\n"))
    found = separators_of(spelt(text, spelling))
    if b"." in text or b"." not in dict(zip(*SIGNS[spelling.fault], strict=True)):
        assert found is not None and found.respelt(spelt(text, spelling)).split() == text.split()


def test_blanks_and_trailing_separators_do_not_matter() -> None:
    rows = PLAIN.replace(b" ", b" , ").replace(b"\n", b",,,\n")
    assert refusal(rows).startswith("f:1: columns are separated by commas (on ") and "\n" not in refusal(rows)


def test_a_single_decimal_comma_is_told_by_its_line() -> None:
    one = refusal(PLAIN.replace(b"3.0000", b"3,0000", 1))
    assert one.startswith("f:5: numbers have decimal commas (on 1 line); write")
    assert "expected the cut angle" in refusal(PLAIN.replace(b"60\n", b"6,0\n", 1))
