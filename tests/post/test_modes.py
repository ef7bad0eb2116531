from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from post.controllers import Controller, load
from post.program import write
from post.reader import read
from tapelayer.motion.time_law import Limits
from tapelayer.motion.trajectory import ON_THE_FLY, Event, Kind, Trajectory
from tapelayer.provenance import Provenance

AXES = ("x", "y")
LIMITS = Limits.speeds(np.array([0.5, 0.5]))
MADE_FROM = Provenance("a", "b", "c", "d")
CONTROLS = ("generic5", "jb3208", "linuxcnc", "linuxcnc_remap", "sinumerik840d")
# Metres: an exact stop, blending within what four decimals of a millimetre can state, and blending without a bound.
TOLERANCES = st.one_of(
    st.just(0.0),
    st.just(np.inf),
    st.sampled_from([4e-5, 1.5e-4]),
    st.integers(1, 10**6).map(lambda digits: digits * 1e-7),
)


def kept(tolerance: float, controller: Controller) -> float:
    """The tolerance that a control can be told: any with a letter for it, else its own or none."""
    if controller.time.tolerance_address:
        return tolerance
    return controller.time.tolerance if tolerance > 0 else 0.0


def text_of(trajectory: Trajectory, controller: Controller) -> bytes:
    # What verification measured does not concern the writer.
    return write(SimpleNamespace(trajectory=trajectory), controller, MADE_FROM)  # type: ignore[arg-type]


def read_back(text: bytes, controller: Controller) -> Trajectory:
    return read(text, controller, AXES, LIMITS, "p.nc").trajectory


@given(
    st.sampled_from(CONTROLS),
    st.lists(
        st.tuples(
            st.sampled_from([Kind.RAPID, Kind.LINEAR, Kind.LINEAR, Kind.DWELL, Kind.SWITCH]), TOLERANCES, st.booleans()
        ),
        max_size=25,
    ),
)
def test_mixed_tolerances_are_read_back_as_they_were_written(name: str, blocks: list[tuple[Kind, float, bool]]) -> None:
    """A course's comment restates the modes; dwells and words in between change none of them."""
    controller = load(name)
    rows: list[tuple[Kind, float, int]] = [(Kind.RAPID, 0.0, 0)]
    for kind, tolerance, begins in blocks:
        rows.append((kind, tolerance, rows[-1][2] + begins))
    kinds, tolerances, courses = (np.array(values) for values in zip(*rows, strict=True))
    moves = np.isin(kinds, (Kind.RAPID, Kind.LINEAR))
    events = [int(event) for event in controller.event_words() if event != Event.STOP]
    trajectory = Trajectory(
        axes=AXES,
        start=np.full(2, np.nan),
        positions=np.outer(np.cumsum(moves), [1e-3, -2e-3]),
        kinds=kinds.astype(np.uint8),
        durations=np.where(kinds == Kind.SWITCH, 0.0, 0.5),
        events=np.where(kinds == Kind.SWITCH, np.resize(events, len(rows)), 0).astype(np.uint8),
        courses=courses.astype(np.int32),
        stated=np.where(np.arange(len(rows)) == 0, 3, 0).astype(np.uint16),
        lines=np.zeros(len(rows), dtype=np.int32),
        tolerances=tolerances,
    )
    text = text_of(trajectory, controller)
    path = read_back(text, controller)
    assert path.kinds.tolist() == kinds.tolist()
    expected = [kept(tolerance, controller) for tolerance in tolerances[moves].tolist()]
    assert path.tolerances[moves] == pytest.approx(expected, rel=1e-12, abs=0.0)
    # A word at rest is written where no motion follows at once, whatever was planned.
    switches = np.flatnonzero(kinds == Kind.SWITCH)
    for row in switches.tolist():
        follows = next((kind for kind in kinds[row:].tolist() if kind != Kind.SWITCH), None)
        flies = tolerances[row] > 0.0 and follows in (Kind.RAPID, Kind.LINEAR)
        assert path.tolerances[row] == (ON_THE_FLY if flies or not controller.events_at_rest else 0.0)
    assert text_of(path, controller) == text


@given(
    st.sampled_from(CONTROLS),
    st.lists(st.one_of(st.none(), TOLERANCES), min_size=1, max_size=12),
    st.booleans(),
)
def test_hand_written_modes_survive_writing(name: str, modes: list[float | None], apart: bool) -> None:
    """A mode holds until the next word; before the first one it is the control's own, and a word alone has no bound."""
    controller = load(name)
    timing = controller.time
    assert timing.initial == ("blended" if name.startswith("linuxcnc") else "exact")
    lines, expected = [*controller.blocks.restated, f"{controller.codes.rapid} X0 Y0"], []
    now = kept(np.inf, controller) if timing.initial == "blended" else 0.0
    for block, mode in enumerate(modes, 1):
        words = ""
        if mode is not None:
            now = kept(mode, controller)
            words = timing.exact if mode == 0 else timing.blended
            if timing.tolerance_address and 0 < mode < np.inf:
                words += f" {timing.tolerance_address}{mode * 1e3:.4f}"
        lines.append(f"{words}{chr(10) if apart and words else ' '}{controller.codes.linear} X{block} F60")
        expected.append(now)
    first = read_back("\n".join([*lines, controller.blocks.end[0]]).encode(), controller)
    assert first.tolerances[1:] == pytest.approx(expected, rel=1e-12, abs=0.0)
    again = read_back(text_of(first, controller), controller)
    assert again.tolerances.tolist() == first.tolerances.tolist()


@pytest.mark.parametrize(
    ("tolerance", "words"),
    [
        (0.0, "G61"),
        (4e-8, "G61"),
        (6e-8, "G64 P0.0001"),
        (1e-5, "G64 P0.01"),
        (12.3456e-3, "G64 P12.3456"),
        (4000.0, "G64 P4000000"),
        (np.inf, "G64"),
    ],
)
def test_a_tolerance_is_written_in_plain_digits_above_0(tolerance: float, words: str) -> None:
    """LinuxCNC takes no exponents, and its G64 P0 is no exact stop."""
    assert load("linuxcnc").time.text(tolerance) == words
