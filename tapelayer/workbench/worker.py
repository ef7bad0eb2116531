"""Worker: the process of one job, which reads one order from stdin and reports progress and outcome on stdout.

    in    {"folder": "WORK/jobs/<id>", "memory_bytes": 8589934592}
    out   {"ready": true}
          {"stage": "planning", "progress": 0.42}
          {"state": "done", "summary": {...}, "error": null}   or   {"state": "failed", "summary": ..., "error": {...}}

The library is imported before the order is read, so that a job need not wait for it. The end of stdin means that the
server has ended, and ends the worker too.
"""

from __future__ import annotations

import hashlib
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
from tapelayer.geometry.models import parse_mesh
from tapelayer.jobs.job import JobResult
from tapelayer.jobs.kind import JobKind
from tapelayer.jobs.kinds import kind_of, kinds, machine_kind_of
from tapelayer.jobs.result import Result
from tapelayer.jobs.stages import READING, SAVING, Weights
from tapelayer.language import LANGUAGES
from tapelayer.motion.trajectory import Trajectory
from tapelayer.provenance import moment
from tapelayer.reporting.subject import Occasion
from tapelayer.setups.sections import Settings, parse_setup
from tapelayer.workbench import problems, scene
from tapelayer.workbench.problems import Problem
from tapelayer.workbench.solving import Way, solve
from tapelayer.workbench.store import PAGES
from tapelayer.workbench.surveying import Survey, survey

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
    if answer := _answered(request, folder):
        (folder / "answer.json").write_bytes(answer)
        return _done(None)
    return (_judged if request["kind"] == "verify" else _made)(folder, request, say)


def _answered(request: Mapping[str, Any], folder: Path) -> bytes:
    """Return the answer to a request that makes nothing; nothing where it is for a job, or for a verdict."""
    if request["kind"] in get_args(Way):
        return solve(request["kind"], (folder / "rows.json").read_bytes())
    if request["kind"] in get_args(Survey):
        return survey(request, folder)
    return b""


def _made(folder: Path, request: Mapping[str, Any], say: Say) -> dict[str, Any]:
    """Make the product of a folder, save all that there is of it, and return the last message about it."""
    kind = kind_of(request["kind"])
    stages = Stages(say, kind.making)
    stages.begin(READING.name)
    job = kind.job(*_inputs(kind, folder, request))
    mould = folder / "mould"
    on = parse_mesh(mould.read_bytes(), "mould", request.get("mould_unit", "mm")) if mould.exists() else None
    result = job.make(request["program_name"], stages)
    stages.begin(SAVING.name)
    drawn = kind.scene(result, on)
    contents = {**_reports(result, request), **scene.files(drawn), **result.files()}
    contents["setup.toml"] = (folder / "setup.toml").read_bytes()
    if not result.failure:
        contents[kind.product.file] = result.text
    if isinstance(result, JobResult):
        contents |= _motion(result, drawn.numbers, request["program_name"])
    _save(folder / "out", contents)
    summary = _summary(kind, result)
    return _failed(problems.of_error(result.failure), summary) if result.failure else _done(summary)


def _judged(folder: Path, request: Mapping[str, Any], say: Say) -> dict[str, Any]:
    """Judge the program of a folder, save the report, and return the last message about it: any verdict is a result."""
    kind = machine_kind_of(request["of"])
    stages = Stages(say, kind.judging)
    stages.begin(READING.name)
    job = kind.job(*_inputs(kind, folder, request))
    result = job.judge((folder / "program").read_bytes(), request["program_name"], request["force"], stages)
    stages.begin(SAVING.name)
    _save(folder / "out", _reports(result, request))
    return _done(_summary(kind, result))


def _inputs(kind: JobKind, folder: Path, request: Mapping[str, Any]) -> tuple[bytes, str, Settings, str]:
    """Return what a job is made from: the source's bytes, its name, the setup, and the unit of the source's numbers."""
    # The names of files in a setup are relative to this folder.
    parts = folder / "parts"
    parts.mkdir(exist_ok=True)
    os.chdir(parts)
    setup = parse_setup((folder / "setup.toml").read_bytes(), "setup.toml", kind.setup)
    return (folder / "source").read_bytes(), request["name"], setup, request.get("unit", "mm")


def _reports(result: Result, request: Mapping[str, Any]) -> dict[str, bytes]:
    """Return the report's files by name."""
    judged_at = moment(time.time(), os.environ.get("SOURCE_DATE_EPOCH"))
    occasion = Occasion(request["program_name"], request.get("setup_name", ""), judged_at)
    pages = {PAGES[language]: result.page_file(occasion, language) for language in LANGUAGES}
    return {"report.json": result.report_file(occasion), **pages}


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


def _motion(result: JobResult[Any], numbers: list[int], name: str) -> dict[str, bytes]:
    """Return the files of a program's motion and machine, and of the lines that are withheld, by name."""
    machine = result.job.machine
    lines, trajectory = _withheld(result, name) if result.failure else ((), result.trajectory)
    contents = {"machine.urdf": machine.path.read_bytes(), **scene.motion_files(numbers, trajectory, machine)}
    if lines:
        contents[WITHHELD] = json.dumps({"withheld": WATERMARK, "lines": lines}).encode()
    return contents


def _withheld(result: JobResult[Any], name: str) -> tuple[tuple[str, ...], Trajectory]:
    """Return the lines of a program that failed, and its motion; no lines where the control has no words for it."""
    try:
        return result.job.withheld(result, name)
    except TapelayerError:
        return (), result.trajectory


def _save(folder: Path, contents: Mapping[str, bytes]) -> None:
    """Write the results together, by relative paths, so that error messages do not show the server's folders."""
    folder.mkdir(exist_ok=True)
    os.chdir(folder)
    write_files({Path(name): data for name, data in contents.items()})


def _summary(kind: JobKind, result: Result) -> dict[str, Any]:
    """Return what a list of jobs tells of a result."""
    report = result.numbers()
    return {
        **{key: report[key] for key in (*kind.summary, "passed")},
        "failures": len(report["failures"]),
        kind.product.hash_key: hashlib.sha256(result.text).hexdigest() if result.text else "",
        "bytes": len(result.text),
        "remarks": list(result.remarks),
        **result.told(),
    }


def _done(summary: Mapping[str, Any] | None) -> dict[str, Any]:
    return {"state": "done", "summary": summary, "error": None}


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
