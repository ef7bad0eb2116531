"""The text of a program without its comments, and its faults by line and column."""

from __future__ import annotations

import pytest

from post.controllers import load
from post.source import Comment, Source
from tapelayer.errors import ProgramRefused


def source(text: bytes, controller: str = "linuxcnc") -> Source:
    return Source(text, load(controller), "p.nc")


def refused(made: Source) -> list[str]:
    with pytest.raises(ProgramRefused) as caught:
        made.refuse()
    return [f"{fault.line}:{fault.column} {fault.sentence}" for fault in caught.value.faults]


def test_comments_give_way_to_blanks_and_are_kept() -> None:
    made = source(b"G0 (up) X1 ; then ( over\r\n( course 2 )\rG1 X2")
    assert bytes(made.plain) == b"G0      X1              \n            \nG1 X2\n"
    assert made.comments == [Comment(1, "up"), Comment(1, "then ( over"), Comment(2, "course 2")]
    made.refuse()


def test_only_the_controls_own_signs_begin_a_comment() -> None:
    assert source(b"X1 (a)", "sinumerik840d").comments == []
    assert source(b"X1 ;a", "sinumerik840d").comments == [Comment(1, "a")]


def test_comments_may_hold_any_letters_and_the_text_may_not() -> None:
    made = source("\ufeffX1 (Stärke µm)\n".encode())
    assert bytes(made.plain).split() == [b"X1"] and made.comments == [Comment(1, "Stärke µm")]
    assert source(b"(\xff)").comments == [Comment(1, "\N{REPLACEMENT CHARACTER}")]
    with pytest.raises(ProgramRefused, match=r"p\.nc:2:3: expected ASCII outside comments, got µ"):
        source("X1\nX2µ\n".encode())
    with pytest.raises(ProgramRefused, match="is a binary file"):
        source(b"X1\0")


def test_blocks_without_effect_are_blanked_whatever_their_case_spaces_and_number() -> None:
    made = source(b"N10 fgroup( x,y,z,a,c, u,v,q1,b1,b2)\nX1\nX2 FGROUP(X)\n", "sinumerik840d")
    assert bytes(made.plain).split() == [b"X1", b"X2", b"FGROUP(X)"]


def test_comments_that_do_not_close_are_faults() -> None:
    assert refused(source(b"X1\nX2 (a (b)\nX3 (c\n")) == [
        "2:4 a comment begins within this comment; close it before",
        "3:4 the comment is not closed; end it with )",
    ]


def test_faults_come_in_the_order_of_the_text_once_each() -> None:
    made = source(b"X1 Y2\nZ3\n")
    made.fault(1, -1, "of the line")
    made.fault(0, 1, "of the second word")
    made.fault(0, 1, "of the second word")
    assert refused(made) == ["1:4 of the second word", "2:0 of the line"]
