"""Worker: the process of one job; it reads one order from its stdin and says on its stdout how the job goes.

    in    {"folder": "WORK/jobs/<id>", "memory_bytes": 8589934592}
    out   {"ready": true}
          {"stage": "planning", "progress": 0.42}
          {"state": "done", "summary": {...}, "error": null}   or   {"state": "failed", "summary": ..., "error": {...}}

The library is imported before the order is read, so that a job need not wait for it. The end of stdin is the end of the
server, and of the worker.
"""

from __future__ import annotations

import json
import os
import resource
import sys
import threading
import time
import traceback
from collections.abc import Callable, Mapping
from itertools import accumulate
from pathlib import Path
from typing import Any

from tapelayer.atomic_files import write_files
from tapelayer.errors import TapelayerError
from tapelayer.geometry.stl import parse_mesh
from tapelayer.laying.job import Job, Made
from tapelayer.laying.settings import Setup
from tapelayer.setups.sections import parse_setup
from tapelayer.spraying.job import SprayJob, SprayMade
from tapelayer.spraying.settings import SpraySetup
from tapelayer.workbench import problems, scene
from tapelayer.workbench.problems import Problem

Say = Callable[[Mapping[str, Any]], None]

LINE_SECONDS = 0.05  # at least, between two lines about the same stage
# About the time that each stage takes of a job, by its machine and whether a given program is judged, in its order.
WEIGHTS = {
    ("lay", False): {
        "reading": 4,
        "planning": 25,
        "verifying the plan": 13,
        "writing": 2,
        "reading back": 2,
        "verifying": 12,
        "saving": 42,
    },
    ("spray", False): {
        "reading": 1,
        "slicing": 3,
        "planning": 20,
        "verifying the plan": 4,
        "writing": 1,
        "reading back": 1,
        "verifying": 4,
        "measuring the coat": 36,
        "saving": 30,
    },
    ("lay", True): {"reading": 20, "reading back": 20, "verifying": 50, "saving": 10},
    ("spray", True): {
        "reading": 2,
        "reading back": 2,
        "slicing": 3,
        "planning": 30,
        "verifying": 6,
        "measuring the coat": 50,
        "saving": 7,
    },
}


class Stages:
    """What is under way, as one progress from 0 to 1 that never goes back.

    Args:
        say: who is told.
        weights: of the stages of the job, in their order.
    """

    def __init__(self, say: Say, weights: Mapping[str, float]) -> None:
        self._say = say
        whole = sum(weights.values())
        ends = accumulate(weights.values())
        # Where each stage begins, and its share.
        self._spans = {
            stage: ((end - weight) / whole, weight / whole)
            for (stage, weight), end in zip(weights.items(), ends, strict=True)
        }
        self._stage, self._ticks, self._done, self._said_at = "", 1, 0, 0.0

    def begin(self, step: str, ticks: int | None = None) -> None:
        """Go on to a stage, of so many ticks where they are known."""
        self._stage, self._ticks, self._done = step, max(ticks or 1, 1), 0
        self._tell()

    def tick(self) -> None:
        """One more is done."""
        self._done = min(self._done + 1, self._ticks)
        if time.monotonic() - self._said_at >= LINE_SECONDS:
            self._tell()

    def _tell(self) -> None:
        begin, share = self._spans[self._stage]
        self._say({"stage": self._stage, "progress": round(begin + share * self._done / self._ticks, 4)})
        self._said_at = time.monotonic()


def carry_out(folder: Path, say: Say) -> dict[str, Any]:
    """Do the job of a folder; the last message about it.

    Raises:
        TapelayerError: the job cannot be done.
    """
    request = json.loads((folder / "request.json").read_bytes())
    verifying = request["kind"] == "verify"
    kind = request["of"] if verifying else request["kind"]
    stages = Stages(say, WEIGHTS[kind, verifying])
    # A setup names the files that came with the job as they stand there.
    parts = folder / "parts"
    parts.mkdir(exist_ok=True)
    os.chdir(parts)
    stages.begin("reading")
    job = _job(folder, kind, request)
    mould = folder / "mould"
    on = parse_mesh(mould.read_bytes(), "mould") if mould.exists() else None
    name = request["program_name"]
    if verifying:
        made = job.examine((folder / "program").read_bytes(), name, request["force"], stages)
    else:
        made = job.make(name, stages)
    stages.begin("saving")
    report = made.report()
    contents = {
        "report.json": (json.dumps(report, indent=2, allow_nan=False) + "\n").encode(),
        "report.html": made.page(name).encode(),
    }
    if not verifying:
        contents |= scene.files(made, made.job, on) | _results(folder, made)
    _save(folder / "out", contents)
    summary = _summary(made, report)
    # Who asks for a verdict gets one, good or bad; who asks for a program gets a good one or none.
    if made.failure and not verifying:
        return _failed(problems.of_error(made.failure), summary)
    return {"state": "done", "summary": summary, "error": None}


def answer(folder: Path, say: Say) -> dict[str, Any]:
    """The last message about the job of a folder, whatever becomes of it."""
    try:
        return carry_out(folder, say)
    except TapelayerError as error:
        return _failed(problems.of_error(error), None)
    except MemoryError:
        # What filled the memory is held by the frames of the error, and goes with it.
        pass
    except Exception:
        problem = problems.internal()
        sys.stderr.write(f"reference {problem.evidence['reference']}, {folder.name}:\n{traceback.format_exc()}")
        return _failed(problem.body(), None)
    _limit_memory(resource.RLIM_INFINITY)
    sentence = "the job needs more memory than the server gives to one; thin its points or triangles out, or split it"
    return _failed(Problem("out-of-memory", sentence).body(), None)


def main() -> None:
    """Read the order, do the job, say how it goes, and end."""
    say = _speaker()
    say({"ready": True})
    line = sys.stdin.buffer.readline()
    if not line:
        return
    threading.Thread(target=_end_with_the_server, daemon=True).start()
    order = json.loads(line)
    _limit_memory(order["memory_bytes"])
    say(answer(Path(order["folder"]), say))
    # The big things need not be taken apart one by one.
    os._exit(0)


def _job(folder: Path, kind: str, request: Mapping[str, Any]) -> Job | SprayJob:
    data, setup = (folder / "source").read_bytes(), (folder / "setup.toml").read_bytes()
    if kind == "lay":
        return Job.of(data, request["name"], parse_setup(setup, "setup.toml", Setup))
    return SprayJob.of(data, request["name"], parse_setup(setup, "setup.toml", SpraySetup), request["unit"])


def _results(folder: Path, made: Made | SprayMade) -> dict[str, bytes]:
    """Files by name of what was made: the program only where it may be used."""
    contents = {
        "setup.toml": (folder / "setup.toml").read_bytes(),
        "machine.urdf": made.job.machine.path.read_bytes(),
    }
    if isinstance(made, SprayMade):
        contents["trajectory.txt"] = made.poses()
    if not made.failure:
        contents["program.nc"] = made.text
    return contents


def _save(folder: Path, contents: Mapping[str, bytes]) -> None:
    """Write the results together; a message about one names it without the server's folders."""
    folder.mkdir(exist_ok=True)
    os.chdir(folder)
    write_files({Path(name): data for name, data in contents.items()})


def _summary(made: Made | SprayMade, report: Mapping[str, Any]) -> dict[str, Any]:
    counted = "passes" if isinstance(made, SprayMade) else "courses"
    kept = ("blocks", counted, "duration_s", "program_sha256", "passed", "max_position_error_mm")
    return {
        **{key: report[key] for key in kept},
        "failures": len(report["failures"]),
        "controller": made.job.setup.output.controller,
        "bytes": len(made.text),
        "remarks": list(made.remarks),
    }


def _failed(error: Mapping[str, Any], summary: Mapping[str, Any] | None) -> dict[str, Any]:
    return {"state": "failed", "summary": summary, "error": error}


def _speaker() -> Say:
    """Who writes to stdout, which from now on is nobody else's: what prints by mistake prints to stderr."""
    stream = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)

    def say(message: Mapping[str, Any]) -> None:
        stream.write(json.dumps(message, allow_nan=False).encode() + b"\n")
        stream.flush()

    return say


def _limit_memory(size: int) -> None:
    """Limit what this process may take, in bytes, within what the system gives to it."""
    most = resource.getrlimit(resource.RLIMIT_AS)[1]
    # The system's own "no limit" is -1.
    resource.setrlimit(resource.RLIMIT_AS, (min((size, most), key=lambda limit: limit % 2**64), most))


def _end_with_the_server() -> None:
    sys.stdin.buffer.read()
    os._exit(1)


if __name__ == "__main__":
    main()
