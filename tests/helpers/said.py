"""What the source can say to a user: every sentence in it, as a template of the catalogues."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from itertools import product
from pathlib import Path

from tests.helpers.paths import ROOT

# The reports and their drawings have their texts in all languages beside them; the header of a program is no message.
SILENT = {
    *(f"tapelayer/reporting/{name}.py" for name in ("page", "drawing", "axis_plots", "map_marks", "summary")),
    *(f"tapelayer/laying/{name}.py" for name in ("page", "plan_view", "tape_view", "error_plots")),
    *(f"tapelayer/spraying/{name}.py" for name in ("page", "plan_view", "pose_file")),
    *(f"tapelayer/plies/{name}.py" for name in ("page", "maps")),
}
# Calls whose texts are no messages: descriptions, patterns, markup, SQL, the server's log, texts in both languages.
NO_MESSAGE = re.compile(
    r"re\.\w+|Field|Words|say|Say\(\w+\)|Stage|ProblemKind|element|sealed|log\.\w+|LOG\.\w+|index\.\w+|self\._index\.\w+"
    r"|self\._select|.*\.(?:partition|removeprefix|split|join|get)|table\.add_\w+|typer\.\w+|_controller|dict\.fromkeys|PydanticCustomError|.*\.encode|hashlib\.\w+|run|steps\.begin"
)
# Functions whose texts are parts of files.
NO_MESSAGE_FUNCTIONS = {
    "post/rows.py": {"head", "course_comment"},
    "tapelayer/jobs/part_names.py": {"part_names"},
    "tapelayer/plies/job.py": {"text"},
    "tapelayer/setups/sections.py": {"whole_text"},
    "tapelayer/spraying/settings.py": {"notes"},
    "tapelayer/workbench/access.py": {"cookie"},
}
# What stands in the server's log or in the comments of a program alone.
LOGGED = {"reference {1}, {2}:", "course {1} of {2}"}
NO_MESSAGE_KEYWORDS = {"description", "help", "epilog", "pattern", "title", "label", "class_", "notes", "format"}
# Modules in which a ValueError becomes a fault of the user's file; elsewhere it is a caller's mistake.
VALIDATED = {
    "tapelayer/setups/sections.py",
    "tapelayer/spraying/settings.py",
    "tapelayer/laying/settings.py",
    "tapelayer/plies/ply.py",
    "post/controllers/table.py",
    "post/words.py",
}
CALLERS = {"ValueError", "AttributeError", "TypeError", "NotImplementedError", "AssertionError", "RuntimeError"}
# Constants that describe the interface of the server, or are policies, pages and tables of it, or stand in files.
DESCRIBING = re.compile(r"[A-Z]*_?POLICY|NOWHERE|FORM|EXAMPLES?|TABLES?|FILES|PAGE|DOCS|EPILOG|SPEEDS_ONLY|WATERMARK")
# Markup, SQL, and what the user is to type: these are the same in every language.
VERBATIM = re.compile(r"\s*<|tapelayer |ALTER TABLE |UPDATE ")
# What a text has beside its words.
NO_WORDS = re.compile(r"\{\d+\}|\b(?:mm|min)\b")
# Letters of the texts that stand in the source beside their English ones.
CHINESE = re.compile(r"[\u4e00-\u9fff]")
# Two words, or a word and a value.
SENTENCE = re.compile(r"\S .*[A-Za-z]{2,}|[A-Za-z]{2,}.* \S")


def modules() -> list[str]:
    """Return the modules, by their path from the root."""
    files = (path for package in ("tapelayer", "post") for path in (ROOT / package).rglob("*.py"))
    return sorted(path.relative_to(ROOT).as_posix() for path in files)


def sayings(module: str) -> dict[str, int]:
    """Return the templates of all sentences of a module that a user may read, with the line of each."""
    if module in SILENT:
        return {}
    found: dict[str, int] = {}
    for node in _spoken(ast.parse((ROOT / module).read_text("utf-8")), module):
        for template in templates(node):
            if template in LOGGED or VERBATIM.match(template) or CHINESE.search(template):
                continue
            if SENTENCE.search(template) and re.search(r"[A-Za-z]{2,}", NO_WORDS.sub("", template)):
                found.setdefault(template, node.lineno)
    return found


def texts(path: Path) -> set[str]:
    """Return the templates of all texts of a file, spoken or not."""
    nodes = ast.walk(ast.parse(path.read_text("utf-8")))
    kinds = (ast.Constant, ast.JoinedStr, ast.BinOp)
    return {text for node in nodes if isinstance(node, kinds) for text in templates(node)}


def templates(node: ast.expr) -> set[str]:
    """Return what a text of the source can be, line by line, with its values as places.

    Examples:
        >>> sorted(templates(ast.parse("f'{n} ' + ('parts' if n > 1 else 'part') + ' left'", mode="eval").body))
        ['{1} part left', '{1} parts left']
    """
    lines = (line for pieces in _readings(node) for line in "".join(pieces).split("\n"))
    return {_numbered(line.strip("\n")) for line in lines if line}


_HOLE = "\0"


def _numbered(text: str) -> str:
    pieces = text.split(_HOLE)
    return pieces[0] + "".join(f"{{{place}}}{piece}" for place, piece in enumerate(pieces[1:], 1))


def _readings(node: ast.expr) -> list[tuple[str, ...]]:
    """Return the pieces of text that an expression can be: both of a choice between texts, a hole for any value."""
    match node:
        case ast.Constant(value=str(text)):
            return [(text,)]
        case ast.JoinedStr(values=values):
            return [sum(parts, ()) for parts in product(*map(_readings, values))]
        case ast.BinOp(left=left, op=ast.Add(), right=right) if _is_sum(node):
            return [first + last for first, last in product(_readings(left), _readings(right))]
        case ast.FormattedValue(value=value) if _chosen(value):
            return _readings(value)
        case ast.IfExp(body=body, orelse=other) if _chosen(node):
            return [*_readings(body), *_readings(other)]
    return [(_HOLE,)]


def _chosen(node: ast.expr) -> bool:
    """Return whether an expression is a choice between two texts of the source."""
    return isinstance(node, ast.IfExp) and all(
        _is_text(branch) or _chosen(branch) for branch in (node.body, node.orelse)
    )


def _is_sum(node: ast.expr) -> bool:
    """Return whether an expression puts texts of the source together."""
    return (
        isinstance(node, ast.BinOp)
        and isinstance(node.op, ast.Add)
        and any(_is_text(side) or _is_sum(side) for side in (node.left, node.right))
    )


def _is_text(node: ast.expr) -> bool:
    return isinstance(node, ast.JoinedStr) or (isinstance(node, ast.Constant) and isinstance(node.value, str))


def _spoken(node: ast.AST, module: str) -> Iterator[ast.expr]:
    """Yield the texts below a node that may reach the user."""
    if isinstance(node, ast.expr) and (_is_text(node) or _is_sum(node)):
        yield node
        yield from _within(node, module)
        return
    if _is_silent(node, module):
        return
    for child in ast.iter_child_nodes(node):
        yield from _spoken(child, module)


def _within(node: ast.expr, module: str) -> Iterator[ast.expr]:
    """Yield the texts in the values of a text or sum of texts, but not those of a choice, which are read with it."""
    for part in ast.iter_child_nodes(node):
        value = part.value if isinstance(part, ast.FormattedValue) else part
        if isinstance(value, ast.expr) and not _is_text(value) and not _chosen(value) and not _is_sum(value):
            yield from _spoken(value, module)
        elif isinstance(value, ast.expr):
            yield from _within(value, module)


def _is_silent(node: ast.AST, module: str) -> bool:
    match node:
        case ast.Expr(value=ast.Constant()):  # a docstring
            return True
        case ast.Call(func=func):
            name = ast.unparse(func)
            return bool(NO_MESSAGE.fullmatch(name)) or (name in CALLERS and module not in VALIDATED)
        case ast.keyword(arg=name):
            return name in NO_MESSAGE_KEYWORDS
        case ast.Assign(targets=[ast.Name(id=name)]):
            return bool(DESCRIBING.fullmatch(name))
        case ast.FunctionDef(name=name):
            return name in NO_MESSAGE_FUNCTIONS.get(module, ())
    return False
