"""Part names: one name for a course everywhere, and comments that name a wrong one."""

from __future__ import annotations

import numpy as np
import pytest

from post import controllers, reader
from tapelayer.jobs.part_names import part_names, placed
from tapelayer.motion.time_law import Limits

STATED = "%\nG00 X0 Y0 Z0\n"


def program(*comments: str) -> reader.Program:
    """Return a program of one block before its comments and one block after each."""
    text = STATED + "".join(f"({comment})\nG00 X{place}\n" for place, comment in enumerate(comments, 1)) + "M30\n%\n"
    table = controllers.load("jb3208")
    return reader.read(text.encode(), table, ("x", "y", "z"), Limits.speeds(np.ones(3)), "p.nc")


@pytest.mark.parametrize("word", ["course", "pass"])
@pytest.mark.parametrize("numbers", [[1, 2, 3], [20, 10, 5], [2, 3, 4], [3, 2, 1], [7]])
def test_the_names_of_a_program_are_read_back(word: str, numbers: list[int]) -> None:
    found, remarks = placed(program(*part_names(word, numbers)), word, numbers)
    assert (found.courses.tolist(), remarks) == ([-1, *range(len(numbers))], ())


@pytest.mark.parametrize(
    ("comments", "courses"),
    [
        (["Course 20", "course 10"], [0, 1]),
        (["course 20", "course 20", "course 5"], [0, 0, 2]),
        (["course 10, 2 of 3"], [1]),
        (["coursework", "a course 99", "recourse 1"], [-1, -1, -1]),
    ],
)
def test_comments_that_name_parts_in_their_order_count(comments: list[str], courses: list[int]) -> None:
    found, remarks = placed(program(*comments), "course", [20, 10, 5])
    if "coursework" in comments:
        assert set(found.courses.tolist()) == {-1}
    else:
        assert found.courses.tolist() == [-1, *courses]
    assert remarks == ()


@pytest.mark.parametrize(
    ("comments", "remark"),
    [
        (["course 99", "course 10"], "p.nc:3: names course 99, but course 20 follows"),
        (
            ["course 10, 2 of 3", "course 20, 1 of 3"],
            "p.nc:3: names course 10 as number 2, but course 20 follows; 1 more",
        ),
        (["course 20, 3 of 3", "course 10, 2 of 3"], "p.nc:3: names course 20 as number 3, but course 20 follows"),
        (["course 20", "course 10", "course 5", "course 6"], "p.nc:9: names course 6, but there are only 3"),
        (["course 1 of 3", "course 2 of 3", "course 3 of 3"], "p.nc:3: names course 1, but course 20 follows; 2 more "),
    ],
)
def test_wrong_comments_are_a_remark_and_count_by_where_they_stand(comments: list[str], remark: str) -> None:
    found, (sentence,) = placed(program(*comments), "course", [20, 10, 5])
    assert found.courses.tolist() == list(range(-1, len(comments)))
    assert sentence.startswith(remark)
    assert sentence.endswith(("follows", "there are only 3", "more such comment", "more such comments"))
