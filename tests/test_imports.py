"""The rooms import one way, and nothing is imported inside a function."""

from __future__ import annotations

import ast
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
FILES = sorted(path for package in ("tapelayer", "post", "urdf") for path in (ROOT / package).rglob("*.py"))
OURS = ("tapelayer", "post", "urdf")
# These, and the workbench, stand on top of both packages: no other module of `tapelayer` may know `post`.
ABOVE_POST = {"tapelayer.laying.job", "tapelayer.cli", "tapelayer.spraying.job"}
WORKBENCH = "tapelayer.workbench."
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


def test_there_is_no_cycle() -> None:
    done: set[str] = set()

    def walk(name: str, way: tuple[str, ...]) -> None:
        assert name not in way, " -> ".join([*way, name])
        if name not in done:
            for other in GRAPH[name]:
                walk(other, (*way, name))
            done.add(name)

    for name in GRAPH:
        walk(name, ())


def test_the_library_never_imports_post() -> None:
    for name, others in GRAPH.items():
        if name.startswith("tapelayer.") and name not in ABOVE_POST and not name.startswith(WORKBENCH):
            assert not [other for other in others if other.split(".")[0] == "post"], name


def test_nobody_knows_the_command_line() -> None:
    assert not [name for name, others in GRAPH.items() if "tapelayer.cli" in others]


def test_only_the_command_line_knows_the_workbench() -> None:
    rooms = {name for name, others in GRAPH.items() if any(other.startswith("tapelayer.workbench") for other in others)}
    assert {name for name in rooms if not name.startswith("tapelayer.workbench.")} == {"tapelayer.cli"}


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
