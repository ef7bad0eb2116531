"""Docstrings teach: many have an example, which `--doctest-modules` runs."""

from __future__ import annotations

import ast
from collections.abc import Iterator

import pytest

from tests.helpers.paths import ROOT

LEAST_SHARE = 0.2


def public_functions(node: ast.Module | ast.ClassDef) -> Iterator[ast.FunctionDef | ast.AsyncFunctionDef]:
    """Public functions of a module, and public methods of its public classes."""
    for child in node.body:
        if isinstance(child, ast.ClassDef) and not child.name.startswith("_"):
            yield from public_functions(child)
        elif isinstance(child, ast.FunctionDef | ast.AsyncFunctionDef) and not child.name.startswith("_"):
            yield child


def test_one_public_function_in_five_has_an_example() -> None:
    paths = [path for package in ("tapelayer", "post") for path in (ROOT / package).rglob("*.py")]
    functions = [function for path in paths for function in public_functions(ast.parse(path.read_text()))]
    examples = [function for function in functions if ">>> " in (ast.get_docstring(function) or "")]
    assert len(functions) > 400
    assert len(examples) >= LEAST_SHARE * len(functions), f"{len(examples)} of {len(functions)}"


def test_pytest_runs_every_example(pytestconfig: pytest.Config) -> None:
    assert pytestconfig.getoption("doctestmodules")
    assert {"tapelayer", "post"} <= set(pytestconfig.getini("testpaths"))
