"""Write the tables of the documents that are generated from the code: the quantities in each kind's report.

python docs/render_tables.py
"""

from __future__ import annotations

import re
from pathlib import Path

from tapelayer.jobs.kinds import KindName, kind_of
from tapelayer.reporting.quantity import quantities

HERE = Path(__file__).parent
DOCUMENTS: dict[str, KindName] = {"report.md": "lay", "spray.md": "spray", "planning.md": "plan"}
TABLE = re.compile(r"(<!-- quantities -->\n).*?(\n<!-- end -->)", re.DOTALL)


def table(name: KindName) -> str:
    """Return the table of a kind's quantities, in the order of its report."""
    rows = [f"| `{row.key}` | {row.unit} | {row.about.en} |" for row in quantities(kind_of(name).rows)]
    return "\n".join(["| key | unit | meaning |", "|---|---|---|", *rows])


def rendered(document: str) -> str:
    """Return the text of a document with its table up to date."""
    text = (HERE / document).read_text(encoding="utf-8")
    written, count = TABLE.subn(lambda match: match[1] + table(DOCUMENTS[document]) + match[2], text)
    assert count == 1, document
    return written


if __name__ == "__main__":
    for document in DOCUMENTS:
        (HERE / document).write_text(rendered(document), encoding="utf-8")
