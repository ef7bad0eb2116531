"""A real control: LinuxCNC headless, with nine simulated axes whose joints are sampled every servo cycle."""

from __future__ import annotations

import json
import math
import os
import shutil
import signal
import subprocess
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tapelayer.arrays import Floats, Frozen, Ints
from tapelayer.machines.machine import Axis, Machine

PYTHON = "/usr/bin/python3"
DRIVER = Path(__file__).parents[1] / "post" / "linuxcnc" / "drive.py"
LETTERS = "XYZABCUVW"
ROTARY = (3, 4, 5)
# An axis without an acceleration reaches its speed within a fiftieth of a second.
BRISK = 50.0
CYCLE_S = 1e-3


@dataclass(frozen=True, eq=False)
class Run(Frozen):
    """What a control did.

    Attributes:
        times: (n,) seconds from the first sample, a servo cycle apart.
        joints: (n, 9) joints X Y Z A B C U V W, mm and degrees.
        outputs: (n,) the first analogue output.
        lines: (n,) line of the program in progress.
        messages: the control's messages to the operator.
        log: what the driver saw, at its own pace: joints, digital and analogue outputs.
    """

    times: Floats
    joints: Floats
    outputs: Floats
    lines: Ints
    messages: tuple[str, ...]
    log: dict[str, object]


def has_linuxcnc() -> bool:
    """Whether LinuxCNC is installed."""
    if not shutil.which("rs274") or not Path(PYTHON).is_file():
        return False
    return subprocess.run([PYTHON, "-c", "import gcode, linuxcnc"], capture_output=True, check=False).returncode == 0


def run(folder: Path, text: bytes, machine: Machine, joints: tuple[str, ...], longest_s: float = 60.0) -> Run:
    """Run a program from switching on to its end or first error.

    LinuxCNC runs in namespaces of its own, where the system allows it: its start script ends every other LinuxCNC on
    the computer by name.

    Args:
        folder: of its own, which any user may write to.
        text: the program.
        machine: its travel, speeds and accelerations.
        joints: the machine's joints on the nine letters; empty for a letter without one.
        longest_s: after which the run is given up.
    """
    (folder / "program.ngc").write_bytes(text)
    for name in ("parameters.var", "tools.tbl"):
        (folder / name).touch()
    shutil.copy(DRIVER, folder / "drive.py")
    (folder / "drive.py").chmod(0o755)
    (folder / "axes.hal").write_text(_hal())
    (folder / "machine.ini").write_text(_ini(folder, machine, joints))
    environment = {
        **os.environ, "HOME": str(folder), "RTAPI_FIFO_PATH": str(folder / "rtapi_fifo"), "LONGEST_S": str(longest_s),
    }  # fmt: skip
    if os.geteuid() == 0:
        environment["RTAPI_UID"] = "65534"
    for path in (folder, *folder.iterdir()):
        path.chmod(0o777)
    running = subprocess.Popen(
        [*_apart(), "linuxcnc", "-r", str(folder / "machine.ini")], env=environment, cwd=folder,
        start_new_session=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
    )  # fmt: skip
    try:
        said, _ = running.communicate(timeout=longest_s + 60.0)
    except subprocess.TimeoutExpired:
        os.killpg(running.pid, signal.SIGKILL)
        raise
    assert (folder / "log.json").is_file(), said
    log = json.loads((folder / "log.json").read_text())
    rows = np.loadtxt(folder / "samples.txt", ndmin=2)
    return Run(
        times=CYCLE_S * (rows[:, 0] - rows[0, 0]),
        joints=rows[:, 1:10],
        outputs=rows[:, 10],
        lines=rows[:, 11].astype(np.int64),
        messages=tuple(log["messages"]),
        log=log,
    )


def _apart() -> list[str]:
    """Return words before a command that run it undisturbed, as far as the system allows it.

    In namespaces of its own; and ahead of ordinary programs, since a control that waits for its turn stands still at
    every word that waits for the end of motion.
    """
    first = ["chrt", "--rr", "10"]
    apart = ["unshare", "--ipc", "--net", "--pid", "--fork", "--mount-proc", "--kill-child"]
    return [word for wrapped in (first, apart) if _works(wrapped) for word in wrapped]


def _works(wrapped: list[str]) -> bool:
    """Whether a command can run others here."""
    return bool(shutil.which(wrapped[0])) and not subprocess.run([*wrapped, "true"], capture_output=True).returncode


def _hal() -> str:
    pins = [
        f"net joint{i} joint.{i}.motor-pos-cmd => joint.{i}.motor-pos-fb sampler.0.pin.{i}\n"
        for i in range(len(LETTERS))
    ]
    return (
        "loadrt [KINS]KINEMATICS\n"
        "loadrt [EMCMOT]EMCMOT servo_period_nsec=[EMCMOT]SERVO_PERIOD num_joints=[KINS]JOINTS num_dio=8 num_aio=4\n"
        "loadrt sampler depth=16000 cfg=ffffffffffs\n"
        "addf motion-command-handler servo-thread\naddf motion-controller servo-thread\naddf sampler.0 servo-thread\n"
        "net estop iocontrol.0.user-enable-out iocontrol.0.emc-enable-in\n"
        "net output motion.analog-out-00 => sampler.0.pin.9\nnet line motion.program-line => sampler.0.pin.10\n"
        + "".join(pins)
    )


def _ini(folder: Path, machine: Machine, joints: tuple[str, ...]) -> str:
    sections: dict[str, Mapping[str, object]] = {
        "EMC": {"VERSION": 1.1, "MACHINE": "headless", "DEBUG": 0},
        "DISPLAY": {"DISPLAY": folder / "drive.py"},
        "TASK": {"TASK": "milltask", "CYCLE_TIME": CYCLE_S},
        "RS274NGC": {"PARAMETER_FILE": folder / "parameters.var"},
        "EMCMOT": {"EMCMOT": "motmod", "COMM_TIMEOUT": 4.0, "SERVO_PERIOD": 1000000},
        "EMCIO": {"EMCIO": "io", "CYCLE_TIME": 0.1, "TOOL_TABLE": folder / "tools.tbl"},
        "HAL": {"HALFILE": folder / "axes.hal"},
        "TRAJ": {
            "COORDINATES": " ".join(LETTERS), "LINEAR_UNITS": "mm", "ANGULAR_UNITS": "degree",
            "MAX_LINEAR_VELOCITY": 4000, "DEFAULT_LINEAR_VELOCITY": 1000, "MAX_LINEAR_ACCELERATION": 1e6,
            "DEFAULT_LINEAR_ACCELERATION": 1e6, "MAX_ANGULAR_VELOCITY": 4000,
        },
        "KINS": {"KINEMATICS": "trivkins coordinates=xyzabcuvw", "JOINTS": len(LETTERS)},
    }  # fmt: skip
    still = Axis("", False, -1.0, 1.0, 1.0)
    for index, joint in enumerate(joints):
        axis = machine.axis(joint) if joint else still
        scale = 180 / np.pi if index in ROTARY else 1e3
        acceleration = axis.acceleration if math.isfinite(axis.acceleration) else BRISK * axis.speed
        bounds = {
            "MIN_LIMIT": axis.lower * scale - 1e-3, "MAX_LIMIT": axis.upper * scale + 1e-3,
            "MAX_VELOCITY": axis.speed * scale, "MAX_ACCELERATION": acceleration * scale,
        }  # fmt: skip
        sections[f"AXIS_{LETTERS[index]}"] = bounds
        kind = "ANGULAR" if index in ROTARY else "LINEAR"
        homes = {"HOME_SEARCH_VEL": 0, "HOME_LATCH_VEL": 0, "HOME_SEQUENCE": 0, "HOME": 0, "HOME_OFFSET": 0}
        sections[f"JOINT_{index}"] = {"TYPE": kind, **bounds, **homes, "FERROR": 1000, "MIN_FERROR": 1000}
    return "".join(
        f"[{name}]\n" + "".join(f"{key} = {value}\n" for key, value in keys.items()) for name, keys in sections.items()
    )
