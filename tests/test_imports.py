"""The rooms import one way, no judge knows a planner, and nothing is imported inside a function."""

from __future__ import annotations

import ast
import subprocess
import sys
from collections.abc import Iterator
from itertools import product
from pathlib import Path

import pytest

from tests.helpers.paths import ROOT

OURS = ("tapelayer", "post", "urdf")
FILES = sorted(path for package in OURS for path in (ROOT / package).rglob("*.py"))

# A room imports from those of the floors above it and from itself; rooms of one floor do not know each other.
FLOORS = (
    ("urdf",),
    ("tapelayer.errors", "tapelayer.units", "tapelayer.arrays", "tapelayer.progress", "tapelayer.language"),
    ("tapelayer.sentences",),
    (
        "tapelayer.vectors",
        "tapelayer.provenance",
        "tapelayer.text",
        "tapelayer.atomic_files",
        "tapelayer.dispatch",
        "tapelayer.command_help",
    ),
    ("tapelayer.toml_files",),
    ("tapelayer.geometry",),
    ("tapelayer.machines",),
    ("tapelayer.motion",),
    ("tapelayer.setups",),
    ("tapelayer.courses",),
    ("tapelayer.verification",),
    ("tapelayer.reporting",),
    ("post",),
    ("tapelayer.jobs",),
    ("tapelayer.laying", "tapelayer.spraying", "tapelayer.plies"),
    ("tapelayer.workbench",),
    ("tapelayer.cli",),
)
# The judges, and what plans: what was planned is judged by what it is, never by how it was made.
JUDGES = (
    "tapelayer.verification",
    "tapelayer.laying.inspection",
    "tapelayer.laying.cut_check",
    "tapelayer.laying.heat_check",
    "tapelayer.laying.link_check",
    "tapelayer.laying.course_splines",
    "tapelayer.laying.sampling",
    "tapelayer.laying.laid",
    "tapelayer.laying.evidence",
    "tapelayer.laying.limits",
    "tapelayer.plies.judge",
    "tapelayer.plies.judgement",
    "tapelayer.plies.laid_ply",
    "tapelayer.plies.course_checks",
    "tapelayer.plies.family_checks",
    "tapelayer.plies.cover_checks",
    "tapelayer.plies.course_line",
    "tapelayer.plies.facet_surface",
    "tapelayer.plies.gap_profiles",
    "tapelayer.plies.straightness",
    "tapelayer.plies.tape_cover",
    "tapelayer.spraying.inspection",
    "tapelayer.spraying.arc_runs",
    "tapelayer.spraying.evidence",
    "tapelayer.spraying.limits",
)
PLANNERS = (
    "tapelayer.laying.program",
    "tapelayer.laying.course_blocks",
    "tapelayer.laying.driven_course",
    "tapelayer.laying.linearisation",
    "tapelayer.laying.cut_assignment",
    "tapelayer.laying.tape_plan",
    "tapelayer.laying.head",
    "tapelayer.plies.plan",
    "tapelayer.plies.family",
    "tapelayer.plies.strip",
    "tapelayer.plies.pieces",
    "tapelayer.plies.cut_lines",
    "tapelayer.plies.reach",
    "tapelayer.plies.fitting",
    "tapelayer.geometry.geodesics",
    "tapelayer.geometry.smooth_surface",
    "tapelayer.spraying.program",
    "tapelayer.spraying.pass_planning",
    "tapelayer.spraying.steep_sides",
    "tapelayer.spraying.smoothing",
    "tapelayer.spraying.wrist_path",
    "tapelayer.motion.stroke",
    "tapelayer.motion.planned_blocks",
    "post",
)
# Imports the web server's packages, which come with an extra, where they are asked for.
DEFERS = ("tapelayer.workbench.command", "serve")


def name_of(path: Path) -> str:
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


MODULES = {name_of(path): path for path in FILES}


def imported(path: Path) -> Iterator[str]:
    """Our modules that a file imports."""
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            names = [f"{node.module}.{alias.name}" for alias in node.names]
        else:
            continue
        for name in names:
            while name and name not in MODULES:
                name = name.rpartition(".")[0]
            if name.split(".")[0] in OURS:
                yield name


GRAPH = {name: sorted(set(imported(path)) - {name}) for name, path in MODULES.items()}


def within(name: str, room: str) -> bool:
    return name == room or name.startswith(f"{room}.")


def floor_of(name: str) -> tuple[int, str]:
    """Number and name of the room that a module stands in."""
    found = [(i, room) for i, floor in enumerate(FLOORS) for room in floor if within(name, room)]
    assert len(found) == 1, f"{name} stands in {found}: give it one place in FLOORS"
    return found[0]


def cycles(graph: dict[str, set[str]]) -> list[str]:
    """A cycle, as a text, for every module from which one is met."""
    done: set[str] = set()
    met = []

    def walk(name: str, way: tuple[str, ...]) -> None:
        if name in way:
            met.append(" -> ".join([*way[way.index(name) :], name]))
        elif name not in done:
            for other in sorted(graph.get(name, ())):
                walk(other, (*way, name))
            done.add(name)

    for name in sorted(graph):
        walk(name, ())
    return met


def test_there_is_no_cycle_of_modules() -> None:
    assert not cycles({name: set(others) for name, others in GRAPH.items()})


def test_there_is_no_cycle_of_rooms() -> None:
    graph: dict[str, set[str]] = {}
    for name, others in GRAPH.items():
        if name != "tapelayer":
            room = floor_of(name)[1]
            theirs = {floor_of(other)[1] for other in others if other != "tapelayer"}
            graph.setdefault(room, set()).update(theirs - {room})
    assert not cycles(graph)


@pytest.mark.parametrize("name", [name for name in GRAPH if name not in ("tapelayer", "tapelayer.jobs")])
def test_rooms_import_upwards(name: str) -> None:
    floor, room = floor_of(name)
    for other in GRAPH[name]:
        above, theirs = floor_of(other)
        assert above < floor or theirs == room, f"{name} imports {other}, which stands in or below its own floor"


@pytest.mark.parametrize("name", [name for name in GRAPH if any(within(name, judge) for judge in JUDGES)])
def test_no_judge_knows_a_planner(name: str) -> None:
    """Neither at first hand nor through what it imports."""
    reached, ahead = set(), [name]
    while ahead:
        for other in set(GRAPH[ahead.pop()]) - reached:
            reached.add(other)
            ahead.append(other)
    known = [other for other, planner in product(sorted(reached), PLANNERS) if within(other, planner)]
    assert not known, f"{name} knows {', '.join(known)}"


def test_judges_and_planners_exist() -> None:
    for room in (*JUDGES, *PLANNERS):
        assert any(within(name, room) for name in MODULES), f"there is no {room}"


@pytest.mark.parametrize("name", [name for name in GRAPH if not within(name, "tapelayer.jobs.kinds")])
def test_nothing_compares_a_kind_with_a_name(name: str) -> None:
    """What differs from kind to kind stands in the kind."""
    for node in ast.walk(ast.parse(MODULES[name].read_text())):
        if isinstance(node, ast.Compare):
            constants = {leaf.value for leaf in ast.walk(node) if isinstance(leaf, ast.Constant)}
            assert not constants & {"lay", "spray", "plan"}, f"{name}:{node.lineno}"


def test_packages_are_no_deeper_than_two() -> None:
    assert not [name for name in MODULES if name.count(".") > 2]


@pytest.mark.parametrize("path", FILES, ids=name_of)
def test_imports_stand_at_the_top(path: Path) -> None:
    tree = ast.parse(path.read_text())
    for function in ast.walk(tree):
        if isinstance(function, ast.FunctionDef | ast.AsyncFunctionDef) and (name_of(path), function.name) != DEFERS:
            inner = [node for node in ast.walk(function) if isinstance(node, ast.Import | ast.ImportFrom)]
            assert not inner, f"{path.name}:{inner[0].lineno}"


def test_importing_the_package_imports_nothing_heavy() -> None:
    """Whoever wants one export, or a command that needs none, does not wait for Pinocchio and SciPy."""
    code = (
        "import sys, tapelayer, tapelayer.errors\n"
        "assert not {'numpy', 'pinocchio', 'scipy'} & set(sys.modules), sorted(sys.modules)\n"
        "assert dir(tapelayer) == tapelayer.__all__\n"
        "assert all(getattr(tapelayer, name).__name__ == name for name in tapelayer.__all__)\n"
        "assert 'pinocchio' in sys.modules\n"
        "try:\n"
        "    tapelayer.no_such_export\n"
        "except AttributeError as error:\n"
        "    sys.exit(str(error))\n"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.stderr == "module 'tapelayer' has no attribute 'no_such_export'\n"
