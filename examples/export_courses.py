"""From a course file to a program, with its report as JSON and as a page.

.venv/bin/python examples/export_courses.py [FOLDER]
"""

import json
import sys
import tempfile
from pathlib import Path

from tapelayer import Job, Occasion, Setup

COURSES = Path(__file__).parent / "cylinder_panel_15.txt"


def main() -> None:
    """Plan, write, read back and judge a program, and save what came of it."""
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else tempfile.mkdtemp())
    folder.mkdir(parents=True, exist_ok=True)

    result = Job.read(COURSES, Setup()).make("panel.nc")
    if result.failure:
        raise result.failure
    report = result.report()
    (folder / "panel.nc").write_bytes(result.text)
    (folder / "panel.json").write_text(json.dumps(report, indent=2))
    (folder / "panel.html").write_text(result.page(Occasion("panel.nc")), encoding="utf-8")

    print(f"{report['courses']} courses, {report['blocks']} blocks, {report['duration_s']:.0f} s")
    print(f"position error {report['max_position_error_mm']:.4f} mm, limit 0.05 mm")
    print(f"open {folder / 'panel.html'} to look at it")


if __name__ == "__main__":
    main()
