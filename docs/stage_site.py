"""Stage the documentation's pages in build/docs, with its configuration beside them; `make docs` builds the site.

The documents of docs/ and of the top folder become pages, each package gets a page that lists its modules, and blocks
of LaTeX marked `math` become MathML, which browsers draw without a script.
"""

from __future__ import annotations

import ast
import re
import shutil
from collections.abc import Iterator
from pathlib import Path

import yaml
from latex2mathml.converter import convert

ROOT = Path(__file__).parent.parent
BUILD = ROOT / "build"
STAGE = BUILD / "docs"
PACKAGES = ("tapelayer", "post")
# Names that documents of the top folder have in the site.
DOCUMENTS = {
    "README.md": "index.md",
    "CONTRIBUTING.md": "contributing.md",
    "CHANGELOG.md": "changelog.md",
    "LICENSE": "LICENSE.txt",
}


def main() -> None:
    """Stage all pages from scratch."""
    shutil.rmtree(STAGE, ignore_errors=True)
    shutil.copytree(ROOT / "docs", STAGE, ignore=shutil.ignore_patterns("*.py", "__pycache__"))
    for name, page in DOCUMENTS.items():
        (STAGE / page).write_text((ROOT / name).read_text())
    for path in STAGE.glob("*.md"):
        path.write_text(with_formulas(with_links(path.read_text())))
    (STAGE / "reference").mkdir()
    for name in packages():
        (STAGE / "reference" / f"{name}.md").write_text(reference_page(name))
    (STAGE / "reference" / "index.md").write_text(reference_index())
    navigation = yaml.safe_load((ROOT / "mkdocs.yml").read_text())["nav"]
    reference = [{"Packages": "reference/index.md"}, *({name: f"reference/{name}.md"} for name in packages())]
    whole = {"INHERIT": "../mkdocs.yml", "nav": [*navigation, {"Reference": reference}]}
    (BUILD / "mkdocs.yml").write_text(yaml.safe_dump(whole, sort_keys=False))


def with_links(text: str) -> str:
    """Return a document with its links between docs/ and the top folder rewritten for the site."""
    return re.sub(r"\]\((?:docs/|\.\./)?([\w.]+)", lambda link: f"]({DOCUMENTS.get(link[1], link[1])}", text)


def with_formulas(text: str) -> str:
    """Return a document with MathML in place of its blocks of LaTeX."""
    return re.sub(r"```math\n(.*?)```", lambda block: formula(block[1]), text, flags=re.DOTALL)


def formula(latex: str) -> str:
    """Return the MathML of LaTeX, with the thin spaces that TeX sets around operators such as sin and cos."""
    thin = '<mspace width="0.17em" />'
    return re.sub(r"<mi>\w{3,}</mi>", rf"{thin}\g<0>{thin}", convert(latex, display="block"))


def packages() -> Iterator[str]:
    """Yield the dotted names of all packages, parents first."""
    for package in PACKAGES:
        for path in sorted((ROOT / package).rglob("__init__.py")):
            yield ".".join(path.parent.relative_to(ROOT).parts)


def reference_index() -> str:
    """Return the page that lists each package with the first line of its docstring."""
    rows = ["# Packages", "", "| package | holds |", "|---|---|"]
    for name in packages():
        source = (ROOT / name.replace(".", "/") / "__init__.py").read_text()
        holds = (ast.get_docstring(ast.parse(source)) or "").partition("\n")[0]
        rows.append(f"| [{name}]({name}.md) | {holds} |")
    return "\n".join(rows)


def reference_page(name: str) -> str:
    """Return the page of a package: its own definitions, then its public modules by name."""
    paths = sorted((ROOT / name.replace(".", "/")).glob("[!_]*.py"))
    modules = "\n".join(f"::: {name}.{path.stem}\n" for path in paths)
    return f"# {name}\n\n::: {name}\n    options: {{show_root_heading: false}}\n\n{modules}"


if __name__ == "__main__":
    main()
