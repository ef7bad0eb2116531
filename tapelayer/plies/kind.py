"""Kind: everything that the commands and the workbench need to know about plans of courses."""

from __future__ import annotations

from tapelayer.jobs.kind import COURSE_FILE, Form, JobKind, Option, Source
from tapelayer.jobs.stages import FITTING, JUDGING, PLANNING_COURSES, READING, SAVING
from tapelayer.plies.boundary import is_dxf, is_text_of_points
from tapelayer.plies.job import PlyJob
from tapelayer.plies.judgement import NOT_JUDGED
from tapelayer.plies.limits import limits_of
from tapelayer.plies.ply import Ply
from tapelayer.plies.quantities import ROWS
from tapelayer.plies.scene import scene

SUMMARY = (
    *("courses", "laid_length_m", "ply_area_m2", "coverage_percent"),
    *("max_gap_mm", "max_overlap_mm", "max_strain_percent"),
)

KIND = JobKind(
    name="plan",
    title="A ply: one layer on a mould",
    setup_name="a ply file",
    command="tapelayer plan {}",
    source=Source(
        name="mould",
        plural="moulds",
        form=Form.MODEL,
        media_type="model/stl",
        settings={"name": Option("mould", "file"), "unit": Option("mould", "unit")},
    ),
    product=COURSE_FILE,
    parts="courses",
    setup=Ply,
    start={"mould": {"file": "mould.stl"}, "ply": {"angle_deg": 0.0}},
    job=PlyJob.of,
    rows=ROWS,
    summary=SUMMARY,
    limits=limits_of,
    not_judged=NOT_JUDGED,
    further={Form.DXF: is_dxf, Form.BOUNDARY: is_text_of_points},
    making={READING: 5, FITTING: 10, PLANNING_COURSES: 50, JUDGING: 25, SAVING: 10},
    scene=scene,
)
