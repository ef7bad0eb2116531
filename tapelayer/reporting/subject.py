"""Subject: what a report is about: sources, setup, machine, controller table, program, version and moment."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any
from xml.etree.ElementTree import Element

from tapelayer.errors import printable
from tapelayer.provenance import NamedFile
from tapelayer.reporting.drawing import element, table
from tapelayer.reporting.words import Say, plain


@dataclass(frozen=True)
class Occasion:
    """What only the caller knows of a judgement; nothing below the callers reads a clock.

    Attributes:
        program: file name of the program; empty where it has none.
        setup: file name of the setup; empty where none was given.
        judged_at: moment of the judgement in UTC, ISO 8601; empty where it is not told.
    """

    program: str = ""
    setup: str = ""
    judged_at: str = ""


@dataclass(frozen=True)
class Subject:
    """What a report is about.

    Attributes:
        sources: files that the program was made from, the input first.
        setup: file of the setup, and the SHA-256 of its effective values.
        changed: values of the setup that differ from the defaults: section, key, value and default.
        machine: name of the machine in its URDF.
        urdf: that file.
        controller: name of the controller table, and its SHA-256.
        program: the judged program.
        version: of this package.
        judged_at: moment of the judgement in UTC, ISO 8601; empty where it is not told.
    """

    sources: Sequence[NamedFile]
    setup: NamedFile
    changed: Sequence[dict[str, Any]]
    machine: str
    urdf: NamedFile
    controller: NamedFile
    program: NamedFile
    version: str
    judged_at: str

    def values(self) -> dict[str, Any]:
        """Return the subject as plain values for JSON; None where there is no name or moment."""
        return {
            "sources": [told(source) for source in self.sources],
            "setup": {**told(self.setup), "changed": list(self.changed)},
            "machine": {"robot": self.machine, **told(self.urdf)},
            "controller": told(self.controller),
            "program": told(self.program),
            "version": self.version,
            "judged_at": self.judged_at or None,
        }


def told(file: NamedFile) -> dict[str, str | None]:
    """Return a file for JSON; None where there is no name or hash.

    Examples:
        >>> told(NamedFile("panel.txt", ""))
        {'name': 'panel.txt', 'sha256': None}
    """
    return {"name": printable(file.name) or None, "sha256": file.sha256 or None}


def product_of(subject: dict[str, Any]) -> dict[str, str | None]:
    """Return name and hash of what was judged, by a report's subject: a program, or a course file."""
    product: dict[str, str | None] = subject["program"] if "program" in subject else subject["courses"]
    return product


def subject_tables(subject: dict[str, Any], say: Say) -> list[Element]:
    """Return the tables of a report's subject, as its plain values give it."""
    setup = subject["setup"]
    rows = [(say("source", "来源文件"), source["name"], source["sha256"]) for source in subject["sources"]]
    rows.append((say("setup", "参数"), setup["name"] or say("no file", "无文件"), setup["sha256"]))
    if machine := subject.get("machine"):
        rows.append((say("machine", "机床"), f"{machine['robot']}, {machine['name']}", machine["sha256"]))
    if controller := subject.get("controller"):
        rows.append((say("controller table", "控制器表"), controller["name"], controller["sha256"]))
    product = product_of(subject)
    rows += [
        (
            say("program", "程序") if "program" in subject else say("course file", "道次文件"),
            product["name"] or say("no file", "无文件"),
            product["sha256"] or "",
        ),
        ("tapelayer", subject["version"], ""),
        (say("judged", "判定时间"), subject["judged_at"] or say("not told", "未给出"), ""),
    ]
    nodes = [
        element("h2", say("Subject", "判定对象")),
        table((say("what", "项目"), say("name", "名称"), "SHA-256"), rows, class_="subject"),
    ]
    changed = setup["changed"]
    if not changed:
        note = say("Every value of the setup is the default.", "所有参数均为默认值。")
        return [*nodes, element("p", note, class_="note")]
    cells = [
        [f"[{one['section']}] {one['key']}", _value(one["value"], say), _value(one["default"], say)] for one in changed
    ]
    headings = (say("changed in the setup", "已更改的参数"), say("value", "取值"), say("default", "默认值"))
    return [*nodes, table(headings, cells, class_="subject")]


def _value(value: Any, say: Say) -> str:
    """Return a value of a setup as it is read, a table as its keys with their values."""
    if value is None:
        return say("none", "无")
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, int | float):
        return plain(value)
    if isinstance(value, dict):
        return ", ".join(f"{key} {_value(one, say)}" for key, one in value.items()) or say("none", "无")
    if isinstance(value, list):
        return "[" + ", ".join(_value(one, say) for one in value) + "]"
    return printable(str(value))
