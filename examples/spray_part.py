"""From an STL to a spraying program, and the coat that the program leaves.

.venv/bin/python examples/spray_part.py [FOLDER]
"""

import sys
import tempfile
from pathlib import Path

from tapelayer import Occasion, SprayJob, SpraySetup

MODEL = Path(__file__).parent / "curved_panel.stl"


def main() -> None:
    """Spray a panel with two pitches, and compare how even the coat is."""
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else tempfile.mkdtemp())
    folder.mkdir(parents=True, exist_ok=True)

    for pitch in (25.0, 40.0):
        result = SprayJob.read(MODEL, SpraySetup().with_values("spray", pitch_mm=pitch)).make("panel.nc")
        if result.failure:
            raise result.failure
        report = result.report()
        (folder / f"panel_{pitch:.0f}.nc").write_bytes(result.text)
        (folder / f"panel_{pitch:.0f}.html").write_text(result.page(Occasion("panel.nc")), encoding="utf-8")
        thickness = report["thickness"]
        print(
            f"pitch {pitch:.0f} mm: {report['passes']} passes, {report['duration_s']:.1f} s, coverage "
            f"{report['coverage_percent']:.1f} %, thickness deviation {report['cv_interior_percent']:.1f} % inside, "
            f"{thickness['least_rel']:.2f} to {thickness['greatest_rel']:.2f} of the mean"
        )
    print(f"open {folder / 'panel_25.html'} to see the coat")


if __name__ == "__main__":
    main()
