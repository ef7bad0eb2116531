"""The exact form for a round roller beside the form that the 2008 paper published, on the same courses.

.venv/bin/python examples/compare_kinematics.py
"""

from pathlib import Path

from tapelayer import Job, Setup

COURSES = Path(__file__).parent / "boss_panel_20.txt"
FIGURES = (
    "max_position_error_mm",
    "max_roller_tilt_deg",
    "max_edge_lift_mm",
    "max_heading_error_deg",
    "max_roller_offset_mm",
)


def main() -> None:
    """Make one program with each form, and print their reports side by side."""
    results = [
        Job.read(COURSES, Setup().with_values("process", kinematics=kinematics)).make(f"{kinematics}.nc")
        for kinematics in ("roller", "published")
    ]
    roller, published = (result.report() for result in results)
    print(f"{COURSES.name:24}{'roller':>12}{'published':>12}")
    for key in FIGURES:
        print(f"{key:24}{roller[key]:12.4f}{published[key]:12.4f}")
    # The published form is judged by its pose only where the setup's [verification] sets these limits itself.
    for note in results[1].notes():
        print(note)


if __name__ == "__main__":
    main()
