"""A controller of one's own: a built-in table with five changes, and no code.

.venv/bin/python examples/own_controller.py [FOLDER]
"""

import sys
import tempfile
from importlib.resources import files
from pathlib import Path

from tapelayer import Job, Setup

COURSES = Path(__file__).parent / "flat_panel_00.txt"
CHANGES = {
    'comment = "("': 'comment = ";"',
    "number_step = 10": "number_step = 1",
    'mode = "per_minute"': 'mode = "inverse_time"',
    'restated = ["G90"]': 'restated = ["G90", "G93"]',  # F is one over the block's minutes from here on
    "modal = true": "modal = false",  # and says nothing of the next block
}


def main() -> None:
    """Write the table, make a program with it, and show the program's first feed motions."""
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else tempfile.mkdtemp())
    folder.mkdir(parents=True, exist_ok=True)

    table = files("post.controllers").joinpath("jb3208.toml").read_text(encoding="utf-8")
    for old, new in CHANGES.items():
        assert old in table, old
        table = table.replace(old, new)
    (folder / "mill.toml").write_text(table, encoding="utf-8")

    job = Job.read(COURSES, Setup().with_values("output", controller=str(folder / "mill.toml")))
    result = job.make("flat.nc")
    (folder / "flat.nc").write_bytes(result.text)
    lines = result.text.decode("ascii").splitlines()
    print("\n".join(line for line in lines[:60] if " G01 " in line or line.startswith(";")))
    verdict = "passed" if result.evidence.passed else f"failed: {result.failure}"
    print(f"controller {job.controller.name}: {verdict}, {result.evidence.duration:.1f} s")


if __name__ == "__main__":
    main()
