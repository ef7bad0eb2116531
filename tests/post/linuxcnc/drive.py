#!/usr/bin/python3
"""The display of a headless LinuxCNC: runs a program and writes what the joints and outputs did; no screen needed.

The folder it works in is its own: program.ngc goes in, log.json and samples.txt come out.
"""

from __future__ import annotations

import json
import os
import subprocess
import time
from pathlib import Path
from typing import Any

import linuxcnc  # type: ignore[import-not-found]

FOLDER = Path(__file__).resolve().parent
JOINTS = 9
LONGEST_S = float(os.environ.get("LONGEST_S", "60"))


def until(found: Any, seconds: float) -> None:
    """Wait until something holds."""
    end = time.monotonic() + seconds
    while not found() and time.monotonic() < end:
        time.sleep(0.01)


def main() -> None:
    """Switch on, run the program to its end or first error, and note every change of the joints."""
    command, status, errors = linuxcnc.command(), linuxcnc.stat(), linuxcnc.error_channel()

    def polled() -> Any:
        status.poll()
        return status

    for state in (linuxcnc.STATE_ESTOP_RESET, linuxcnc.STATE_ON):
        command.state(state)
        command.wait_complete(10)
    command.mode(linuxcnc.MODE_MANUAL)
    command.wait_complete(10)
    command.home(-1)
    until(lambda: all(polled().homed[:JOINTS]), 10)
    command.mode(linuxcnc.MODE_AUTO)
    command.wait_complete(10)
    command.program_open(str(FOLDER / "program.ngc"))
    # Every servo cycle: its number, the joints, an output and the line.
    sampling = subprocess.Popen(["halsampler", "-t", str(FOLDER / "samples.txt")])
    time.sleep(0.2)
    begin = time.monotonic()
    command.auto(linuxcnc.AUTO_RUN, 0)
    samples: list[tuple[float, list[float], list[int], float]] = []
    messages: list[str] = []
    running = False
    while time.monotonic() - begin < LONGEST_S:
        now = polled()
        sample = (list(now.joint_actual_position[:JOINTS]), list(now.dout[:8]), now.aout[0])
        if not samples or list(sample) != list(samples[-1][1:]):
            samples.append((time.monotonic() - begin, *sample))
        error = errors.poll()
        if error:
            messages.append(error[1])
        running = running or now.interp_state != linuxcnc.INTERP_IDLE
        idle = now.interp_state == linuxcnc.INTERP_IDLE and now.inpos
        if (running and idle) or (messages and idle):
            break
        time.sleep(0.001)
    time.sleep(0.2)
    sampling.terminate()
    sampling.wait(10)
    log = {"samples": samples, "messages": messages, "seconds": time.monotonic() - begin}
    (FOLDER / "log.json").write_text(json.dumps(log), encoding="utf-8")


if __name__ == "__main__":
    main()
