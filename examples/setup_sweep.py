"""A sweep over the setup: how long a ply takes, and how much tape it wastes, by width and laying speed.

.venv/bin/python examples/setup_sweep.py
"""

from pathlib import Path

from tapelayer import Job, Setup, TapelayerError

COURSES = Path(__file__).parent / "cylinder_panel_15.txt"


def main() -> None:
    """Make a program for each pair of values, and print a table."""
    print("width mm  speed mm/s  duration s  waste mm  waste %")
    for width in (50.0, 75.0, 150.0):
        for speed in (100.0, 250.0, 500.0):
            setup = Setup().with_values("tape", width_mm=width).with_values("process", lay_speed_mm_per_s=speed)
            try:
                result = Job.read(COURSES, setup).make("sweep.nc")
            except TapelayerError as error:
                print(f"{width:8.0f}  {speed:10.0f}  {error}")
                continue
            report = result.report()
            print(
                f"{width:8.0f}  {speed:10.0f}  {report['duration_s']:10.1f}  {report['waste_mm']:8.0f}  "
                f"{report['waste_percent']:7.2f}{'' if report['passed'] else '  failed'}"
            )


if __name__ == "__main__":
    main()
