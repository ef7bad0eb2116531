"""Clearance: certified distances against closed forms, against dense sampling, and mutants that must be caught."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from itertools import product
from pathlib import Path
from tempfile import TemporaryDirectory

import coal
import numpy as np
import pinocchio
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tapelayer.arrays import Floats, Mask
from tapelayer.errors import ModelRefused
from tapelayer.geometry.mesh import Mesh
from tapelayer.geometry.nearness import triangles
from tapelayer.laying.job import Job
from tapelayer.laying.placing import courses_in_machine
from tapelayer.machines import gantry, wrist
from tapelayer.machines.body import Body
from tapelayer.motion.trajectory import Event, Kind, Trajectory
from tapelayer.units import DEG, MM
from tapelayer.verification.clearance import (
    ClearanceLimits,
    Clearances,
    Pressed,
    clearance,
    ticks,
)
from tapelayer.verification.track import BRACKET, FINEST
from tests.helpers.machines import sprayer, tape_layer
from tests.helpers.moving_balls import RADIUS as RADIUS_OF_BALL
from tests.helpers.moving_balls import ball, dipped, lowered, swung, twins
from tests.helpers.panels import mesh_of, sheet
from tests.helpers.plies import courses_of, job_of
from tests.helpers.setups import setup_of
from tests.helpers.surfaces import flat_course
from tests.helpers.trajectories import COLUMNS, straight, untimed

OWN = 2 * MM
RADIUS = 1800.0


def plane(height: float = 0.0, half: float = 5e3) -> Mesh:
    """A square of two triangles, at a height in metres."""
    ends = np.array([-half, half])
    return mesh_of(sheet(ends, ends, lambda x, y: np.full_like(x + y, height / MM)))


def cylinder(count: int = 50) -> Mesh:
    """The panel that the example's courses lie on, in the part's frame."""
    across, along = np.linspace(0.0, 1000.0, count + 1), np.linspace(-100.0, 1700.0, round(1.7 * count) + 1)
    return mesh_of(sheet(across, along, lambda x, y: 200.0 - RADIUS + np.sqrt(RADIUS**2 - (x - 500.0) ** 2) + 0.0 * y))


def about_y(angle: float) -> Floats:
    return np.array([[np.cos(angle), 0.0, np.sin(angle)], [0.0, 1.0, 0.0], [-np.sin(angle), 0.0, np.cos(angle)]])


@cache
def example(name: str = "cylinder_panel_15") -> tuple[Job, Trajectory]:
    """A job of the examples, and its program as it is read back."""
    job = job_of(courses_of(name), setup_of())
    return job, job.read_back(job.text(job.plan()), "program.nc").trajectory


@cache
def tape_body() -> Body:
    return Body.of(tape_layer(), gantry.TOUCHING)


def on_the_mould(trajectory: Trajectory) -> Mask:
    """Where the tyre is pressed on, or the auxiliary roller still is, which follows it."""
    down = np.zeros(len(trajectory), np.int64)
    for on, off in ((Event.SHOE_DOWN, Event.SHOE_UP), (Event.ROLLER_DOWN, Event.ROLLER_UP)):
        down += np.cumsum((trajectory.events == on).astype(np.int64) - (trajectory.events == off))
    pressed: Mask = down > 0
    return pressed


def placed(job: Job, mould: Mesh, up: float = 0.0, turn: float = 0.0) -> Mesh:
    """A mould where the setup puts the part, raised in metres, and turned about y through the part's middle."""
    part = job.setup.part
    origin = np.array([part.l1_mm, part.l2_mm, -part.l3_mm]) * MM + [0.0, 0.0, up]
    middle = np.array([0.5, 0.0, 0.0])
    return mould.moved(about_y(turn), middle - about_y(turn) @ middle).moved(np.eye(3), origin)


def judged(
    limit: float, mould: Mesh, trajectory: Trajectory | None = None, laid: float = 0.0, pressed: bool = True
) -> Clearances:
    """The example against a mould in `machine` axes, at a limit in metres."""
    trajectory = example()[1] if trajectory is None else trajectory
    shape = Pressed("tyre", on_the_mould(trajectory)) if pressed else None
    return clearance(tape_body(), trajectory, mould, ClearanceLimits(limit, OWN, laid), "roller", shape)


def near_mould(found: Clearances) -> set[str]:
    return {failure.pair[0] for failure in found.failures if failure.pair[1] == "mould"}


@pytest.mark.parametrize("motion", [lowered, swung])
@pytest.mark.parametrize(("limit", "kept"), [(0.198, True), (0.1995, True), (0.2002, False), (0.21, False)])
def test_a_ball_over_a_plane(tmp_path: Path, motion: type, limit: float, kept: bool) -> None:
    """True clearance 200 mm: at a corner between two blocks, and in the middle of an arc."""
    body = Body.of(ball(tmp_path))
    found = clearance(body, motion(0.3), plane(), ClearanceLimits(limit, OWN), "ball")
    assert found.judged and not found.beneath and found.passed == kept
    for failure in found.failures:
        assert failure.pair == ("ball_0", "mould") and failure.limit == limit
        assert 0.2 - 1e-5 <= failure.clearance <= limit


@pytest.mark.parametrize("height", [0.0, 0.01, 0.0437, 0.09])
@pytest.mark.parametrize("motion", [lowered, swung])
def test_the_least_clearance_of_a_ball_is_within_its_bracket(tmp_path: Path, motion: type, height: float) -> None:
    body = Body.of(ball(tmp_path))
    nearest = clearance(body, motion(0.1 + height), plane(), ClearanceLimits(0.0, OWN), "ball").mould
    assert nearest is not None and nearest.low <= height <= nearest.high + 1e-5
    assert nearest.high - nearest.low <= BRACKET + FINEST
    assert nearest.links == ("ball", "mould") and nearest.spot is not None
    assert abs(nearest.spot.block + nearest.spot.share - {"lowered": 1.0, "swung": 0.5}[motion.__name__]) < 0.1


@settings(max_examples=60)
@given(
    dips=st.lists(st.tuples(st.floats(0.03, 0.2), st.floats(0.001, 0.3)), min_size=1, max_size=6),
    deep=st.one_of(st.floats(0.05, 1.0), st.floats(1.0, 20.0)),
)
def test_no_dip_is_passed_over(dips: list[tuple[float, float]], deep: float) -> None:
    """A ball that goes straight down moves by all of its bound: what is nearest is between two middles."""
    lowest, rises = np.array(dips).T
    with TemporaryDirectory() as folder:
        body = Body.of(ball(Path(folder)))
    motion, least = dipped(RADIUS_OF_BALL + lowest, RADIUS_OF_BALL + lowest + rises), float(min(lowest))
    for limit, kept in ((least - 0.3 * MM, True), (least + deep * MM, False)):
        found = clearance(body, motion, plane(), ClearanceLimits(limit, OWN), "ball")
        assert found.passed == kept
    nearest = found.mould
    assert nearest is not None and nearest.low <= least
    assert nearest.high == np.inf or nearest.high >= least - 1e-5


@pytest.mark.parametrize(("limit", "kept"), [(0.0097, True), (0.0101, False), (0.0103, False), (0.02, False)])
def test_two_balls_that_come_together_count_the_motion_of_both(tmp_path: Path, limit: float, kept: bool) -> None:
    """True clearance 10 mm, at odd shares of the way so that no middle of an interval meets it."""
    body = Body.of(twins(tmp_path))
    apart = np.array([[-0.105, 0.105], [-0.4, 0.513], [-0.3, 0.413]])
    motion = straight(("a", "b"), apart, start=np.array([-0.737, 0.737]))
    found = clearance(body, motion, None, ClearanceLimits(0.0, limit), "ball_a")
    assert found.passed == kept and found.own is not None
    assert found.own.pair == ("ball_a_0", "ball_b_0") and found.own.low <= 0.01 <= found.own.high + 1e-5
    assert found.own.high - found.own.low <= BRACKET + FINEST


def test_a_ball_far_from_all_has_no_nearest_place(tmp_path: Path) -> None:
    found = clearance(Body.of(ball(tmp_path)), lowered(0.3), plane(), ClearanceLimits(0.05, OWN), "ball")
    assert found.passed and found.mould is not None and found.own is not None
    assert found.mould.high == np.inf and found.mould.low > 0.099 and found.mould.spot is None
    assert found.own.high == np.inf and found.own.pair == ()


def test_a_ball_that_touches_has_no_clearance(tmp_path: Path) -> None:
    found = clearance(Body.of(ball(tmp_path)), swung(0.05), plane(), ClearanceLimits(0.001, OWN), "ball")
    assert found.mould is not None and (found.mould.low, found.mould.high) == (0.0, 0.0)
    assert not found.passed and found.failures[0].clearance == 0.0


def test_the_plies_already_laid_are_taken_off(tmp_path: Path) -> None:
    """A clearance of 50 mm with 30 mm laid keeps 19.5 mm, and not 20.2 mm."""
    body = Body.of(ball(tmp_path))
    for limit, kept in ((0.0195, True), (0.0202, False)):
        found = clearance(body, lowered(0.15), plane(), ClearanceLimits(limit, OWN, laid=0.03), "ball")
        assert found.passed == kept and found.mould is not None
        assert found.mould.low <= 0.02 <= found.mould.high + 1e-5
        for failure in found.failures:
            assert failure.limit == pytest.approx(limit) and 0.0199 < failure.clearance <= limit


@pytest.mark.parametrize(
    ("limit", "near"),
    [
        (0.018, set()),
        (0.0195, {"head_10"}),
        (0.022, {"head_4", "head_10", "auxiliary_roller_0", "auxiliary_roller_2"}),
    ],
)
def test_the_example_over_its_panel(limit: float, near: set[str]) -> None:
    job, _ = example()
    found = judged(limit, placed(job, cylinder()))
    assert near_mould(found) == near and found.passed == (not near)
    assert found.mould is not None and found.mould.pair == ("head_10", "mould")
    assert 0.0184 <= found.mould.low <= found.mould.high <= 0.01941
    assert found.judged_from == 2
    for failure in found.failures:
        assert failure.limit == pytest.approx(limit) and 0.018 < failure.clearance <= limit


def test_a_raised_mould_is_refused() -> None:
    job, _ = example()
    found = judged(0.005, placed(job, cylinder(), up=0.03))
    assert not found.passed and found.mould is not None and found.mould.high == 0.0
    assert len(near_mould(found) - {"tyre"}) == 8


def split(trajectory: Trajectory, parts: int) -> Trajectory:
    """The trajectory with every block that moves cut into parts of equal length."""
    asked = untimed(trajectory)
    blocks = np.repeat(np.arange(len(asked)), parts)
    shares = np.tile((1.0 + np.arange(parts)) / parts, len(asked))
    columns = {name: getattr(asked, name)[blocks] for name in COLUMNS}
    positions = asked.within(blocks, shares)
    known = np.isfinite(asked.positions)[blocks]
    positions = np.where(known, np.where(np.isfinite(positions), positions, asked.positions[blocks]), np.nan)
    events = np.where(shares == 1.0, columns["events"], Event.NONE).astype(np.uint8)
    return replace(asked, **{**columns, "positions": positions, "events": events})


@pytest.mark.parametrize(("limit", "kept"), [(0.018, True), (0.0195, False)])
def test_splitting_blocks_changes_no_verdict(limit: float, kept: bool) -> None:
    job, trajectory = example()
    mould = placed(job, cylinder(25))
    whole, parts = (judged(limit, mould, motion) for motion in (trajectory, split(trajectory, 120)))
    assert whole.passed == parts.passed == kept
    assert near_mould(whole) == near_mould(parts)
    assert whole.mould is not None and parts.mould is not None
    assert abs(whole.mould.high - parts.mould.high) <= BRACKET
    assert parts.queries <= 1.1 * whole.queries


def test_a_head_wholly_beneath_an_open_sheet_is_refused() -> None:
    """Every shape is metres from the sheet, which has no inside."""
    job, _ = example()
    found = judged(0.005, placed(job, cylinder(), up=6.0))
    assert found.mould is not None and found.mould.high == np.inf and not found.failures
    assert found.beneath and not found.passed


def lowest_of_the_head() -> float:
    """Least height of the head's shapes, but for the tyre, over the nip where the head stands upright; metres."""
    body = tape_body()
    pose = body.machine.forward(np.zeros((1, 10)), "head")[0]
    nip = body.machine.forward(np.zeros((1, 10)), "contact")[0, 2, 3]
    heights = []
    for shape in body.shapes:
        if shape.link in ("head", "roller", "auxiliary_roller", "cutter") and shape.name != "tyre":
            turned = (pose @ shape.place)[:3]
            if isinstance(shape.solid, coal.Box):
                reach = float(np.abs(turned[2, :3]) @ shape.half)
            else:
                radius, up = shape.half[0], turned[2, 2]
                reach = float(radius * np.sqrt(max(1.0 - up**2, 0.0)) + shape.half[2] * abs(up))
            heights.append(turned[2, 3] - reach - nip)
    return float(min(heights))


def test_raising_the_mould_flips_the_verdict_where_it_must() -> None:
    """Under a level course on a plane, the head's lowest shape keeps 5 mm until the mould has come up by the rest."""
    job = job_of((flat_course(length=0.3, n=31),), setup_of())
    trajectory = job.read_back(job.text(job.plan()), "program.nc").trajectory
    level = float(courses_in_machine(job.courses, job.setup)[0].points[0, 2])
    always = Pressed("tyre", np.ones(len(trajectory), np.bool_))
    lowest, limit = lowest_of_the_head(), 5 * MM
    assert lowest == pytest.approx(0.02, abs=1e-9)
    verdicts = []
    for step in range(10, 21):
        found = clearance(
            tape_body(), trajectory, plane(level + step * MM), ClearanceLimits(limit, OWN), "roller", always
        )
        assert found.mould is not None
        assert found.mould.low <= lowest - step * MM + 1e-4 and found.mould.high >= lowest - step * MM - 1e-4
        verdicts.append(found.passed)
    flips = [step for step, (one, other) in enumerate(zip(verdicts, verdicts[1:], strict=False), 10) if one != other]
    assert verdicts[0] and not verdicts[-1] and len(flips) == 1
    assert abs(flips[0] + 0.5 - (lowest - limit) / MM) <= 1.0


def mutants() -> dict[str, tuple[Mesh, Trajectory]]:
    job, trajectory = example()
    good = placed(job, cylinder())
    asked, z = untimed(trajectory), trajectory.column("z")
    lower, links = trajectory.positions.copy(), trajectory.positions.copy()
    lower[:, z] += 5 * MM
    # Between courses the ram stays up only half as far as it has to.
    links[2:, z] = np.maximum(links[2:, z], np.nanmax(links[:, z]) - 40 * MM)
    return {
        "the head 5 mm lower": (good, replace(asked, positions=lower)),
        "the part 10 mm higher": (placed(job, cylinder(), up=10 * MM), trajectory),
        "the part turned by 2 degrees": (placed(job, cylinder(), turn=2 * DEG), trajectory),
        "the link clearance cut": (good, replace(asked, positions=links)),
    }


@pytest.mark.parametrize("name", mutants())
def test_mutants_are_caught(name: str) -> None:
    """The good program keeps 18 mm; each of these comes nearer."""
    mould, trajectory = mutants()[name]
    found = judged(0.018, mould, trajectory)
    assert not found.passed and near_mould(found), name


def test_the_tyre_is_judged_where_it_is_lifted() -> None:
    """Left out while it is pressed on, at limit 0 elsewhere, even where it goes up and down within the links."""
    job, trajectory = example()
    mould = placed(job, cylinder())
    assert "tyre" in near_mould(judged(0.005, mould, pressed=False))
    assert judged(0.005, mould).passed
    z = trajectory.column("z")
    up = np.flatnonzero((trajectory.kinds == Kind.RAPID) & ~on_the_mould(trajectory))
    row = int(up[len(up) // 2])
    positions = trajectory.positions.copy()
    positions[row, z] = np.nanmax(positions[:, z]) + 60 * MM
    found = judged(0.0, mould, replace(untimed(trajectory), positions=positions))
    failure = next(failure for failure in found.failures if failure.pair[0] == "tyre")
    assert failure.limit == 0.0 and failure.spot.block in (row, row + 1)


def test_the_pressed_shape_needs_its_name() -> None:
    _, trajectory = example()
    with pytest.raises(ModelRefused, match="no <collision> named 'shoe'; name the one that is meant"):
        pressed = Pressed("shoe", np.zeros(len(trajectory), np.bool_))
        clearance(tape_body(), trajectory, plane(-9.0), ClearanceLimits(0.0, OWN), "roller", pressed)


def held_at(**values: float) -> Trajectory:
    """A motion of one short block from the middle of the travel."""
    q = np.array([[1.25, 1.0, 0.3, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]])
    names = tape_layer().names
    for name, value in values.items():
        q[0, names.index(name)] = value
    return straight(names, q, start=q[0] + [1e-3, *[0.0] * 9])


@pytest.mark.parametrize(
    ("values", "pair"),
    [
        ({"a": 120 * DEG}, {"fork", "cutter"}),
        ({"a": 175 * DEG}, {"ram", "roller"}),
        ({"z": 0.95}, {"machine", "roller"}),
    ],
)
def test_a_machine_that_meets_itself_or_its_table_is_refused(values: dict[str, float], pair: set[str]) -> None:
    wide = tape_layer().with_limits({"z": (0.0, 2.0)}, {})
    body = Body.of(wide, gantry.TOUCHING)
    found = clearance(body, held_at(**values), None, ClearanceLimits(0.0, OWN), "roller")
    assert found.mould is None and not found.passed and found.own is not None and found.own.high == 0.0
    assert pair in [set(failure.links) for failure in found.failures]
    assert clearance(body, held_at(), None, ClearanceLimits(0.0, OWN), "roller").passed


def test_a_motion_of_unknown_poses_does_not_pass(tmp_path: Path) -> None:
    body, motion = Body.of(ball(tmp_path)), lowered(0.3)
    lost = replace(motion, positions=np.vstack([motion.positions[:1], np.full((1, 3), np.nan)]))
    found = clearance(body, lost, plane(), ClearanceLimits(0.0, 0.0), "ball")
    assert not found.judged and not found.passed and found.judged_from == 2
    later = replace(motion, start=np.full(3, np.nan))
    found = clearance(body, later, plane(), ClearanceLimits(0.0, 0.0), "ball")
    assert found.judged and found.judged_from == 1


def test_every_pair_of_moving_parts_ticks_once() -> None:
    job, trajectory = example()
    called: list[int] = []
    for mould, pressed in ((placed(job, cylinder(10)), Pressed("tyre", on_the_mould(trajectory))), (None, None)):
        called.clear()
        limits = ClearanceLimits(0.0, OWN)
        clearance(tape_body(), trajectory, mould, limits, "roller", pressed, tick=lambda: called.append(1))
        assert len(called) == ticks(tape_body(), mould, pressed) > 30


def test_the_sprayer_is_judged_with_its_standoff_held() -> None:
    """The nozzle points down at P; with the standoff it keeps that far from a plane through P."""
    body = Body.of(sprayer(), wrist.TOUCHING)
    ends = np.array([[1.0, 1.0, 0.3, 0.2, 0.0], [1.2, 1.1, 0.3, 0.4, 0.3]])
    motion = straight(("x", "y", "z", "theta", "phi"), ends, start=ends[0])
    for standoff, kept in ((0.08, True), (0.02, False)):
        found = clearance(body, motion, plane(0.3), ClearanceLimits(0.05, OWN), "gun", held={"standoff": standoff})
        assert found.passed == kept, found
        assert found.mould is not None and found.mould.links[0] == "gun" and found.mould.high <= standoff + 1e-4


def random_case(seed: int) -> tuple[Trajectory, Mesh]:
    """A short program of all axes, with arcs, over a rough sheet."""
    chance = np.random.default_rng(seed)
    machine = tape_layer()
    count = int(chance.integers(2, 5))
    middle = np.array([1.25, 1.0, 0.4, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    spans = np.array([0.03, 0.03, 0.03, 0.1, 0.15, 1.0, 0.02, 0.3, 0.02, 0.3])
    ends = middle + chance.uniform(-1.0, 1.0, (count + 1, 10)) * spans
    kinds = chance.choice([Kind.LINEAR, Kind.RAPID, Kind.CLOCKWISE, Kind.COUNTERCLOCKWISE], count)
    # Centres on the chord's bisector in x and y keep arcs small.
    between = (ends[1:, :3] + ends[:-1, :3]) / 2
    base = straight(machine.names, ends[1:], start=ends[0], kinds=kinds)
    motion = replace(base, centres=between, planes=np.zeros(count, np.uint8))
    nip = machine.forward(middle[None], "contact")[0, :3, 3] / MM
    grid = np.linspace(-400.0, 400.0, 6)
    bumps = chance.uniform(0.0, 60.0, (6, 6))
    depth = chance.uniform(60.0, 120.0)
    mould = mesh_of(sheet(nip[0] + grid, nip[1] + grid, lambda x, y: nip[2] - depth + bumps))
    return motion, mould


def densely(body: Body, motion: Trajectory, mould: Mesh, step: float = 0.1 * MM) -> float:
    """Least distance of any shape but the tyre from the mould, by coal at samples of the motion a step apart."""
    fixed, still = triangles(mould.vertices, mould.facets), coal.Transform3s()
    request, least = coal.DistanceRequest(), np.inf
    lowest = [shape for shape in body.shapes if shape.link in ("head", "roller", "auxiliary_roller", "cutter")]
    for block in range(len(motion)):
        shares = np.linspace(0.0, 1.0, 200)
        tips = body.machine.forward(motion.within(np.full(200, block), shares), "contact")[:, :3, 3]
        length = float(np.sum(np.linalg.norm(np.diff(tips, axis=0), axis=1)))
        shares = np.linspace(0.0, 1.0, 2 + int(length / step))
        q = motion.within(np.full(len(shares), block), shares)
        poses = body.machine.forward(q, "head")
        for shape in lowest:
            if shape.name == "tyre":
                continue
            # What is far at every hundredth sample is not measured between them.
            coarse = [_distance(shape.solid, pose @ shape.place, fixed, still, request) for pose in poses[::100]]
            if min(coarse) > least + 100 * 2 * step:
                continue
            least = min(least, min(_distance(shape.solid, pose @ shape.place, fixed, still, request) for pose in poses))
    return float(least)


def _distance(solid: object, pose: Floats, fixed: object, still: object, request: object) -> float:
    return float(
        coal.distance(solid, coal.Transform3s(pose[:3, :3], pose[:3, 3]), fixed, still, request, coal.DistanceResult())
    )


def sampling_never_finds_less(seed: int) -> None:
    motion, mould = random_case(seed)
    everywhere = Pressed("tyre", np.ones(len(motion), np.bool_))
    found = clearance(tape_body(), motion, mould, ClearanceLimits(0.0, OWN), "roller", everywhere).mould
    sampled = densely(tape_body(), motion, mould)
    assert found is not None
    if found.high == np.inf:
        assert sampled >= found.low
    else:
        assert sampled >= found.low - 1e-6
        assert max(sampled, 0.0) <= found.high + 0.2 * MM


def own_sampling_never_finds_less(seed: int) -> None:
    """The machine against itself, by Pinocchio's own distances, with the head rolled far over."""
    chance, machine, body = np.random.default_rng(seed), tape_layer(), tape_body()
    middle = np.array([1.25, 1.0, 0.3, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    spans = np.array([0.3, 0.3, 0.2, 0.5, chance.choice([0.9, 1.3, 2.2]), 1.0, 0.2, 1.3, 0.2, 1.3])
    ends = middle + chance.uniform(-1.0, 1.0, (3, 10)) * spans
    motion = straight(machine.names, ends[1:], start=ends[0])
    found = clearance(body, motion, None, ClearanceLimits(0.0, OWN), "roller").own
    geometry = pinocchio.buildGeomFromUrdf(machine.model, str(machine.path), pinocchio.GeometryType.COLLISION)
    links = [machine.model.frames[shape.parentFrame].name for shape in geometry.geometryObjects]
    for one, other in product(range(len(links)), repeat=2):
        apart = geometry.geometryObjects[one].parentJoint < geometry.geometryObjects[other].parentJoint
        if apart and frozenset((links[one], links[other])) not in body.neighbours:
            geometry.addCollisionPair(pinocchio.CollisionPair(one, other))
    data, beside = machine.model.createData(), pinocchio.GeometryData(geometry)
    least = np.inf
    for block in range(len(motion)):
        for q in machine.configurations(motion.within(np.full(150, block), np.linspace(0.0, 1.0, 150))):
            pinocchio.computeDistances(machine.model, data, geometry, beside, q)
            least = min(least, min(result.min_distance for result in beside.distanceResults))
    assert found is not None and max(least, 0.0) >= found.low - 1e-6
    if found.high < np.inf:
        assert found.high <= max(least, 0.0) + BRACKET + FINEST


@pytest.mark.parametrize("seed", range(3))
def test_sampling_of_the_machine_itself_never_finds_less(seed: int) -> None:
    own_sampling_never_finds_less(seed)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(100, 120))
def test_sampling_of_the_machine_itself_in_many_programs_never_finds_less(seed: int) -> None:
    own_sampling_never_finds_less(seed)


@pytest.mark.parametrize("seed", range(3))
def test_dense_sampling_never_finds_less_than_is_certified(seed: int) -> None:
    sampling_never_finds_less(seed)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(100, 120))
def test_dense_sampling_of_many_programs_never_finds_less(seed: int) -> None:
    sampling_never_finds_less(seed)
