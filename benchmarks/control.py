"""The examples on a real control: time, speed and stops as reported, and as LinuxCNC drives them.

Every program is exported for LinuxCNC, read back and judged as always; then LinuxCNC drives it headless, with nine
simulated axes that have the machine's travel, speeds and accelerations, and its joints are sampled every millisecond. A
run takes as long as the program; each has namespaces of its own. Needs the Debian package linuxcnc-uspace, and is to be
started in the repository's root: `python -m benchmarks.control`.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from tapelayer.arrays import Floats
from tapelayer.laying.job import Job
from tapelayer.laying.settings import Setup
from tapelayer.setups.sections import JobSetup, parse_setup
from tapelayer.spraying.job import SprayJob
from tapelayer.spraying.settings import SpraySetup
from tapelayer.units import MM
from tests.helpers.driven import Driven, driven
from tests.helpers.linuxcnc import CYCLE_S, has_linuxcnc

EXAMPLES = Path(__file__).parents[1] / "examples"
SETUPS = {
    "flat_panel_00.txt": "",
    "boss_panel_20.txt": "",
    "cylinder_panel_15.txt": "",
    "wing_skin_00.txt": "",
    "wing_skin_45.txt": "[machine]\nlimits_deg = {c = [-180, 180], a = [-30, 30]}\n",
    "curved_panel.stl": "",
}
# A control at less than this share of its set speed stands still; at more than the other it is at speed.
STILL, AT_SPEED = 0.01, 0.95
LONGEST_S = 1200.0


@dataclass(frozen=True)
class Row:
    """One program, as reported and on the control.

    Attributes:
        source: file that the program was made from.
        reported_s: seconds from the first feed to the end by the time law.
        real_s: the same on the control.
        reported_share: share of the laid or sprayed length at 95 % of the set speed or more, by the report.
        real_share: the same on the control.
        reported_stops: stops while the tape is laid or the arc is on, by the report.
        real_stops: the same on the control.
    """

    source: str
    reported_s: float
    real_s: float
    reported_share: float
    real_share: float
    reported_stops: int
    real_stops: int

    @property
    def off(self) -> float:
        """Share by which the real time is longer than the reported one."""
        return self.real_s / self.reported_s - 1.0


def job_of(path: Path, setup: str) -> Job | SprayJob:
    """Return the job of a course file, or of a model to spray, on LinuxCNC."""
    text = f'{setup}[output]\ncontroller = "linuxcnc"\n'.encode()
    if path.suffix == ".stl":
        return SprayJob.read(path, parse_setup(text, "setup.toml", SpraySetup))
    return Job.read(path, parse_setup(text, "setup.toml", Setup))


def accelerated(setup: JobSetup, job: Job | SprayJob, linear: float | None, rotary: float | None) -> JobSetup:
    """Return the setup with accelerations for all linear axes in mm/s2 and all rotary ones in deg/s2, where given."""
    for value, key, turns in (
        (linear, "accelerations_mm_per_s2", False),
        (rotary, "accelerations_deg_per_s2", True),
    ):
        if value is not None:
            names = [name for name in job.axes if job.machine.axis(name).revolute is turns]
            setup = setup.with_values("machine", **{key: dict.fromkeys(names, value)})
    return setup


def working_speeds(run: Driven, job: Job | SprayJob) -> Floats:
    """Return the speed (n,) in m/s at which tape is fed, or at which P goes over the part, at every sample."""
    if isinstance(job, Job):
        fed = run.joints[:, run.trajectory.column("u")]
        return np.abs(np.gradient(fed, CYCLE_S))
    # The standoff is set by hand: it is no axis of a program.
    joints = np.zeros((len(run.joints), len(job.machine.axes)))
    for column, name in enumerate(job.axes):
        joints[:, job.machine.column(name)] = run.joints[:, column]
    joints[:, job.machine.column("standoff")] = job.setup.standoff
    places = job.machine.forward(joints, "P")[:, :3, 3]
    return np.linalg.norm(np.gradient(places, CYCLE_S, axis=0), axis=1)


def measured(run: Driven, job: Job | SprayJob, set_speed: float) -> tuple[float, int]:
    """Return the share of the worked length at set speed, and the stops at work, of a run."""
    speeds = working_speeds(run, job)
    work = run.at_work()
    whole = float(np.sum(speeds[work]))
    share = float(np.sum(speeds[work & (speeds >= AT_SPEED * set_speed)])) / whole
    still = work & (speeds < STILL * set_speed)
    begins = np.flatnonzero(still & ~np.append(False, still[:-1]))
    ends = np.flatnonzero(still & ~np.append(still[1:], False)) + 1
    # Where work begins or ends the control is at rest anyway.
    inner = [work[begin - 1] and work[min(end, len(work) - 1)] for begin, end in zip(begins, ends, strict=True)]
    return share, sum(map(bool, inner))


def row_of(path: Path, setup: str, linear: float | None, rotary: float | None) -> Row:
    """Return what is reported of the program of a file, and what LinuxCNC makes of it.

    Raises:
        TapelayerError: the program cannot be made.
    """
    job = job_of(path, setup)
    values = accelerated(job.setup, job, linear, rotary)
    job = type(job).read(path, values)  # type: ignore[arg-type]
    result = job.make(path.name)
    if result.failure is not None:
        raise result.failure
    report = result.report()
    laying = isinstance(job, Job)
    speed = job.setup.process.lay_speed_mm_per_s * MM if isinstance(job, Job) else job.setup.speed
    with tempfile.TemporaryDirectory(prefix="control-") as folder:
        Path(folder).chmod(0o777)
        run = driven(Path(folder), result.text, job.machine, job.axes, LONGEST_S)
    share, stops = measured(run, job, speed)
    return Row(
        path.name,
        run.reported_s,
        run.real_s,
        float(report["speed_share"]),
        share,
        int(report["laying_stops" if laying else "spraying_stops"]),
        stops,
    )


HEADING = """| program | reported s | real s | off | at set speed, reported / real | stops, reported / real |
|---|---|---|---|---|---|"""


def line(row: Row) -> str:
    """Return a row as a line of the Markdown table."""
    return (
        f"| {row.source} | {row.reported_s:.1f} | {row.real_s:.1f} | {row.off:+.2%} "
        f"| {row.reported_share:.1%} / {row.real_share:.1%} | {row.reported_stops} / {row.real_stops} |"
    )


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table; return 1 if a real time is off by more than the limit."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("sources", nargs="*", type=Path, help="course files and models; without any the examples")
    parser.add_argument("--linear", type=float, help="acceleration of all linear axes, mm/s2; without it the URDF's")
    parser.add_argument("--rotary", type=float, help="acceleration of all rotary axes, deg/s2; without it the URDF's")
    parser.add_argument("--limit", type=float, default=0.02, help="share by which a time may be off")
    parser.add_argument("--json", action="store_true", help="print JSON in place of a table")
    options = parser.parse_args(arguments)
    if not has_linuxcnc():
        parser.error("LinuxCNC is not installed; install the Debian package linuxcnc-uspace")
    paths = options.sources or [EXAMPLES / name for name in SETUPS]
    rows = []
    for path in paths:
        rows.append(row_of(path, SETUPS.get(path.name, ""), options.linear, options.rotary))
        if not options.json:
            print(line(rows[-1]) if len(rows) > 1 else f"{HEADING}\n{line(rows[-1])}", flush=True)
    if options.json:
        print(json.dumps([asdict(row) | {"off": row.off} for row in rows], indent=2))
    return 0 if all(abs(row.off) <= options.limit for row in rows) else 1


if __name__ == "__main__":
    sys.exit(main())
