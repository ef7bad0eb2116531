"""Worker: the process of one job, which reads one order from stdin and reports progress and outcome on stdout.

    in    {"folder": "WORK/jobs/<id>", "memory_bytes": 8589934592}
    out   {"ready": true}
          {"stage": "planning", "progress": 0.42}
          {"state": "done", "summary": {...}, "error": null}   or   {"state": "failed", "summary": ..., "error": {...}}

The library is imported before the order is read, so that a job need not wait for it. The end of stdin means that the
server has ended, and ends the worker too.
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
from typing import Any, get_args

from tapelayer.atomic_files import write_files
from tapelayer.errors import TapelayerError
from tapelayer.geometry.stl import parse_mesh
from tapelayer.jobs.job import JobResult, MachineJob
from tapelayer.jobs.kind import JobKind
from tapelayer.jobs.kinds import kind_of, kinds
from tapelayer.jobs.stages import READING, SAVING, Weights
from tapelayer.language import LANGUAGES
from tapelayer.motion.trajectory import Trajectory
from tapelayer.provenance import moment
from tapelayer.reporting.subject import Occasion
from tapelayer.setups.sections import parse_setup
from tapelayer.workbench import problems, scene
from tapelayer.workbench.problems import Problem
from tapelayer.workbench.solving import Way, solve
from tapelayer.workbench.store import PAGES

Say = Callable[[Mapping[str, Any]], None]

# What stands before the lines of a program that failed.
WATERMARK = "FAILED: withheld, not to be run"
WITHHELD = "withheld.json"
LINE_SECONDS = 0.05  # shortest time between two lines about the same stage


class Stages:
    """Progress over all stages of a job, from 0 to 1 and never decreasing.

    Args:
        say: called with each message.
        weights: of the stages of the job, in their order.
    """

    def __init__(self, say: Say, weights: Weights) -> None:
        self._say = say
        whole = sum(weights.values())
        ends = accumulate(weights.values())
        # Begin and share of each stage in the whole.
        self._spans = {
            stage.name: ((end - weight) / whole, weight / whole)
            for (stage, weight), end in zip(weights.items(), ends, strict=True)
        }
        self._stage, self._ticks, self._done, self._said_at = "", 1, 0, 0.0

    def begin(self, step: str, ticks: int | None = None) -> None:
        """Begin a stage, with its number of ticks if that is known."""
        self._stage, self._ticks, self._done = step, max(ticks or 1, 1), 0
        self._tell()

    def tick(self) -> None:
        """Count one more tick as done."""
        self._done = min(self._done + 1, self._ticks)
        if time.monotonic() - self._said_at >= LINE_SECONDS:
            self._tell()

    def _tell(self) -> None:
        begin, share = self._spans[self._stage]
        self._say({"stage": self._stage, "progress": round(begin + share * self._done / self._ticks, 4)})
        self._said_at = time.monotonic()


def carry_out(folder: Path, say: Say) -> dict[str, Any]:
    """Do the job of a folder and return the last message about it.

    Raises:
        TapelayerError: the job cannot be done.
        Problem: its rows cannot be solved.
    """
    request = json.loads((folder / "request.json").read_bytes())
    if request["kind"] in get_args(Way):
        (folder / "answer.json").write_bytes(solve(request["kind"], (folder / "rows.json").read_bytes()))
        return {"state": "done", "summary": None, "error": None}
    verifying = request["kind"] == "verify"
    kind = kind_of(request["of"] if verifying else request["kind"])
    stages = Stages(say, kind.judging if verifying else kind.making)
    # The names of files in a setup are relative to this folder.
    parts = folder / "parts"
    parts.mkdir(exist_ok=True)
    os.chdir(parts)
    stages.begin(READING.name)
    setup = parse_setup((folder / "setup.toml").read_bytes(), "setup.toml", kind.setup)
    job = kind.job((folder / "source").read_bytes(), request["name"], setup, request.get("unit", "mm"))
    mould = folder / "mould"
    on = parse_mesh(mould.read_bytes(), "mould") if mould.exists() else None
    name = request["program_name"]
    if verifying:
        result = job.judge((folder / "program").read_bytes(), name, request["force"], stages)
    else:
        result = job.make(name, stages)
    stages.begin(SAVING.name)
    report = result.numbers()
    occasion = Occasion(name, request.get("setup_name", ""), moment(time.time(), os.environ.get("SOURCE_DATE_EPOCH")))
    contents = {"report.json": result.report_file(occasion)}
    contents |= {PAGES[language]: result.page_file(occasion, language) for language in LANGUAGES}
    if not verifying:
        lines, trajectory = _withheld(job, result, name) if result.failure else ((), result.trajectory)
        if lines:
            contents[WITHHELD] = json.dumps({"withheld": WATERMARK, "lines": lines}).encode()
        drawn = scene.files(kind.scene(result, on), trajectory, job.machine)
        contents |= drawn | _results(folder, job, result)
    _save(folder / "out", contents)
    summary = _summary(kind, job, result, report)
    # A failed verdict is a valid result of judging a program, but a failure of making one.
    if result.failure and not verifying:
        return _failed(problems.of_error(result.failure), summary)
    return {"state": "done", "summary": summary, "error": None}


def answer(folder: Path, say: Say) -> dict[str, Any]:
    """Do the job of a folder and return the last message about it, even if it fails."""
    try:
        return carry_out(folder, say)
    except TapelayerError as error:
        return _failed(problems.of_error(error), None)
    except Problem as refusal:
        return _failed(refusal.body(), None)
    except MemoryError:
        # The frames of the error hold the memory; leaving this block releases it before the message is built.
        pass
    except Exception:
        problem = problems.internal()
        sys.stderr.write(f"reference {problem.evidence['reference']}, {folder.name}:\n{traceback.format_exc()}")
        return _failed(problem.body(), None)
    _limit_memory(resource.RLIM_INFINITY)
    sentence = "the job needs more memory than the server gives to one; thin its points or triangles out, or split it"
    return _failed(Problem("out-of-memory", sentence).body(), None)


def main() -> None:
    """Read the order, do the job, report on it, and exit."""
    say = _speaker()
    kinds()
    say({"ready": True})
    line = sys.stdin.buffer.readline()
    if not line:
        return
    threading.Thread(target=_end_with_the_server, daemon=True).start()
    order = json.loads(line)
    _limit_memory(order["memory_bytes"])
    say(answer(Path(order["folder"]), say))
    # Skip the slow teardown of large objects.
    os._exit(0)


def _results(folder: Path, job: MachineJob[Any, Any], result: JobResult[Any]) -> dict[str, bytes]:
    """Return the result files by name; the program only if verification passed it."""
    contents = {
        "setup.toml": (folder / "setup.toml").read_bytes(),
        "machine.urdf": job.machine.path.read_bytes(),
        **result.files(),
    }
    if not result.failure:
        contents["program.nc"] = result.text
    return contents


def _withheld(job: MachineJob[Any, Any], result: JobResult[Any], name: str) -> tuple[tuple[str, ...], Trajectory]:
    """Return the lines of a program that failed, and its motion; no lines where the control has no words for it."""
    try:
        return job.withheld(result, name)
    except TapelayerError:
        return (), result.trajectory


def _save(folder: Path, contents: Mapping[str, bytes]) -> None:
    """Write the results together, by relative paths, so that error messages do not show the server's folders."""
    folder.mkdir(exist_ok=True)
    os.chdir(folder)
    write_files({Path(name): data for name, data in contents.items()})


def _summary(
    kind: JobKind, job: MachineJob[Any, Any], result: JobResult[Any], report: Mapping[str, Any]
) -> dict[str, Any]:
    kept = ("blocks", kind.parts, "duration_s", "program_sha256", "passed", "max_position_error_mm")
    return {
        **{key: report[key] for key in kept},
        "failures": len(report["failures"]),
        "controller": job.setup.output.controller,
        "bytes": len(result.text),
        "remarks": list(result.remarks),
    }


def _failed(error: Mapping[str, Any], summary: Mapping[str, Any] | None) -> dict[str, Any]:
    return {"state": "failed", "summary": summary, "error": error}


def _speaker() -> Say:
    """Return a function that writes messages to stdout, and redirect all other output to stderr."""
    stream = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)

    def say(message: Mapping[str, Any]) -> None:
        stream.write(json.dumps(message, allow_nan=False).encode() + b"\n")
        stream.flush()

    return say


def _limit_memory(size: int) -> None:
    """Limit the address space of this process to so many bytes, or to the system's hard limit if that is lower."""
    most = resource.getrlimit(resource.RLIMIT_AS)[1]
    # RLIM_INFINITY is -1, so compare as unsigned numbers.
    resource.setrlimit(resource.RLIMIT_AS, (min((size, most), key=lambda limit: limit % 2**64), most))


def _end_with_the_server() -> None:
    sys.stdin.buffer.read()
    os._exit(1)


if __name__ == "__main__":
    main()
