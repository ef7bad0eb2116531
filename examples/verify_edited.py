"""Verify a program that was edited by hand: its text is judged, whoever wrote it.

.venv/bin/python examples/verify_edited.py [FOLDER]
"""

import sys
import tempfile
from pathlib import Path

from tapelayer import Job, Setup

COURSES = Path(__file__).parent / "cylinder_panel_15.txt"


def main() -> None:
    """Move the roller half a millimetre in one block, judge the program again, and read the failures."""
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else tempfile.mkdtemp())
    folder.mkdir(parents=True, exist_ok=True)

    job = Job.read(COURSES, Setup())
    lines = job.text(job.plan()).decode("ascii").splitlines(keepends=True)
    touch = next(i for i, line in enumerate(lines) if "M20" in line)  # the shoe's, on course 1
    number = next(i for i, line in enumerate(lines) if i > touch and " Z" in line)
    z = next(word for word in lines[number].split() if word.startswith("Z"))
    lines[number] = lines[number].replace(z, f"Z{float(z[1:]) + 0.5:.3f}")
    edited = folder / "edited.nc"
    edited.write_text("".join(lines), encoding="ascii")

    result = job.judge(edited.read_bytes(), edited.name)
    print(f"line {number + 1}: {z} raised by 0.5 mm: {'passed' if result.evidence.passed else 'failed'}")
    for failure in result.evidence.failures:
        print(failure.sentence())


if __name__ == "__main__":
    main()
