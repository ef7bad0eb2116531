"""Stages: the successive steps of a job with their names, declared once."""

from __future__ import annotations

from dataclasses import dataclass

from tapelayer.reporting.words import Words


@dataclass(frozen=True)
class Stage:
    """A part of a job's work.

    Attributes:
        name: its name in progress reports.
        words: its name on a page.
    """

    name: str
    words: Words


READING = Stage("reading", Words("Reading", "读取"))
SLICING = Stage("slicing", Words("Slicing the model", "模型切片"))
PLANNING = Stage("planning", Words("Planning", "规划"))
VERIFYING_PLAN = Stage("verifying the plan", Words("Verifying the plan", "校验规划"))
WRITING = Stage("writing", Words("Writing the program", "写出程序"))
READING_BACK = Stage("reading back", Words("Reading the program back", "回读程序"))
VERIFYING = Stage("verifying", Words("Verifying the program", "校验程序"))
COATING = Stage("measuring the coat", Words("Measuring the coat", "计算涂层厚度"))
FITTING = Stage("fitting the mould", Words("Fitting the mould", "拟合模具"))
PLANNING_COURSES = Stage("planning courses", Words("Planning the courses", "规划道次"))
JUDGING = Stage("judging", Words("Judging the courses", "校验道次"))
SAVING = Stage("saving", Words("Saving", "保存"))

# The stages of a job in order, with their approximate shares of its time.
Weights = dict[Stage, float]
