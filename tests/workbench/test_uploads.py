"""Uploads: forms as they arrive, whole, cut short, too large, and with names that are none."""

from __future__ import annotations

import asyncio
import resource
from collections.abc import Mapping, Sequence
from email.header import Header
from pathlib import Path

import pytest
from starlette.requests import Request

from tapelayer.workbench.problems import Problem
from tapelayer.workbench.uploads import LONGEST_TEXT, MOST_PARTS, Form, Sort, display_name, receive
from tests.helpers.forms import FORM, Part, body_of

FIELDS: Mapping[str, Sort] = {"file": "file", "mould": "file", "kind": "text", "setup": "text", "parts": "files"}


def received(
    folder: Path, body: bytes, media_type: str = FORM, size: int = 1 << 16, disconnected: bool = False
) -> Form:
    """Form of a body that comes in pieces of a size."""
    pieces = [body[at : at + size] for at in range(0, len(body), size)]
    messages = [{"type": "http.request", "body": piece, "more_body": True} for piece in pieces]
    messages.append({"type": "http.disconnect"} if disconnected else {"type": "http.request", "body": b""})

    async def receiver() -> dict[str, object]:
        return messages.pop(0)

    scope = {"type": "http", "method": "POST", "headers": [(b"content-type", media_type.encode())]}
    return asyncio.run(receive(Request(scope, receiver), folder, FIELDS))


def refused(folder: Path, parts: Sequence[Part]) -> Problem:
    with pytest.raises(Problem) as problem:
        received(folder, body_of(parts))
    return problem.value


@pytest.mark.parametrize("size", [1, 7, 100_000])
def test_a_form_is_what_was_sent_however_it_is_cut(tmp_path: Path, size: int) -> None:
    data = bytes(range(256)) * 3 + b"\r\n--boundar\r\n\r--"
    parts = [
        Part("kind", b"lay"),
        Part("setup", "# 铺带\n".encode(), "job.toml"),
        Part("file", data, "folder/铺层 1.txt"),
        Part("parts", b"", "a.urdf"),
        Part("parts", data[::-1], "b-1_2.stl"),
    ]
    form = received(tmp_path, body_of(parts), size=size)
    assert form.texts == {"kind": b"lay", "setup": "# 铺带\n".encode()}
    assert form.text("kind", "spray") == "lay" and form.text("mould", "none") == "none"
    assert form.names == {"setup": "job.toml", "file": "铺层 1.txt"}
    assert (tmp_path / "file").read_bytes() == data
    contents = {name: path.read_bytes() for name, path in form.files.items()}
    assert contents == {"a.urdf": b"", "b-1_2.stl": data[::-1]}
    assert {path.relative_to(tmp_path).as_posix() for path in tmp_path.rglob("*") if path.is_file()} == {
        "file",
        "parts/a.urdf",
        "parts/b-1_2.stl",
    }


def test_a_form_as_dot_net_sends_it(tmp_path: Path) -> None:
    """Names without quotation marks, a boundary with them, a file's name in two ways."""
    encoded = Header("铺层.txt", "utf-8").encode()
    body = (
        "--a-b\r\nContent-Type: text/plain; charset=utf-8\r\nContent-Disposition: form-data; name=kind\r\n\r\nlay\r\n"
        f'--a-b\r\nContent-Disposition: form-data; name=file; filename="{encoded}"; '
        "filename*=utf-8''%E9%93%BA%E5%B1%82.txt\r\n\r\nstart\r\n--a-b--\r\n"
    )
    form = received(tmp_path, body.encode(), 'multipart/form-data; boundary="a-b"')
    assert (form.texts, form.names) == ({"kind": b"lay"}, {"file": "铺层.txt"})
    assert (tmp_path / "file").read_bytes() == b"start"


@pytest.mark.parametrize(
    ("sent", "name"),
    [
        (b"panel.txt", "panel.txt"),
        ("铺层.txt".encode(), "铺层.txt"),
        (b"../../etc/passwd", "passwd"),
        (b"C:\\Users\\me\\panel.txt", "panel.txt"),
        (b" panel.txt ", "panel.txt"),
        (b"x" * 200, "x" * 200),
        (Header("铺层.txt", "utf-8").encode().encode(), "铺层.txt"),
        (b"=?panel", "=?panel"),
    ],
)
def test_a_display_name_is_the_last_part(sent: bytes, name: str) -> None:
    assert display_name(sent) == name


@pytest.mark.parametrize(
    "sent",
    [b"", b"..", b"a/", b"a/..", b"a\x00b", b"a\x1bb", b"x" * 201, b"\xff.txt", "\u202etxt.exe".encode()]
    + ["a\u2028b".encode(), b"=?utf-8?b?!?=", b"=?none?b?YWJj?="]
    + [b"=?undefined?q?a?=", "=?é?q?a?=".encode(), b"=?idna?q?xn--a=ff?=", b"=?utf-7?q?+2AA-?="],
)
def test_what_cannot_be_shown_is_no_name(sent: bytes) -> None:
    with pytest.raises(Problem) as problem:
        display_name(sent)
    assert problem.value.code == "name-not-allowed"


@pytest.mark.parametrize(
    "name", ["", ".", "..", "../x", "/etc/passwd", "a/b", "a\\b", ".hidden", "-x", "x" * 101, "a b", "铺层.urdf", "a\n"]
)
def test_a_part_needs_a_plain_name(tmp_path: Path, name: str) -> None:
    problem = refused(tmp_path, [Part("parts", b"", name)])
    assert problem.code in ("name-not-allowed", "invalid-request")
    assert [path for path in tmp_path.rglob("*") if path.is_file()] == []


@pytest.mark.parametrize(
    ("parts", "code", "sentence"),
    [
        ([Part("files", b"")], "invalid-request", "the form has no field 'files'; there are file, mould, kind, "),
        ([Part("kind", b"lay"), Part("kind", b"lay")], "invalid-request", "kind: is there twice; send it once"),
        ([Part("file", b"", "a"), Part("file", b"", "b")], "invalid-request", "file: is there twice; send it once"),
        ([Part("file", b"")], "invalid-request", "file: is no file; send it with a file name"),
        ([Part("parts", b"")], "invalid-request", "parts: is no file; send it with a file name"),
        ([Part("parts", b"", "a"), Part("parts", b"", "A")], "invalid-request", "parts: there are two files A; "),
        ([Part("setup", b"#" * (LONGEST_TEXT + 1))], "upload-too-large", "setup: has more than 1048576 bytes"),
        ([Part("kind", b"")] * (MOST_PARTS + 1), "invalid-request", "kind: is there twice"),
        (
            [Part("parts", b"", f"{number}") for number in range(MOST_PARTS + 1)],
            "invalid-request",
            "the form has more than 100 parts; send fewer",
        ),
    ],
)
def test_what_a_form_may_not_hold(tmp_path: Path, parts: list[Part], code: str, sentence: str) -> None:
    problem = refused(tmp_path, parts)
    assert (problem.code, problem.detail[: len(sentence)]) == (code, sentence)


@pytest.mark.parametrize("media_type", ["", "application/json", "multipart/form-data", "text/plain; boundary=boundary"])
def test_only_forms_are_received(tmp_path: Path, media_type: str) -> None:
    with pytest.raises(Problem) as problem:
        received(tmp_path, body_of([]), media_type)
    assert problem.value.status == 415


@pytest.mark.parametrize(("left", "disconnected"), [(0, True), (1, False), (10, False), (30, True)])
def test_a_form_cut_short_is_refused(tmp_path: Path, left: int, disconnected: bool) -> None:
    body = body_of([Part("kind", b"lay"), Part("file", b"x" * 1000, "a.txt")])
    with pytest.raises(Problem) as problem:
        received(tmp_path, body[: len(body) - 4 - left], disconnected=disconnected)
    assert problem.value.detail == "the body ended before the form did"


def test_what_is_no_form_is_refused(tmp_path: Path) -> None:
    with pytest.raises(Problem, match="^the body is no multipart form: "):
        received(tmp_path, b"kind=lay")


def test_a_disk_that_takes_no_more_is_said(tmp_path: Path) -> None:
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, hard))
    try:
        problem = refused(tmp_path, [Part("file", b"x" * 2000, "a.txt")])
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert (problem.code, problem.detail) == ("target-not-writable", "the upload cannot be stored: file too large")


def test_a_text_is_utf_8(tmp_path: Path) -> None:
    form = received(tmp_path, body_of([Part("kind", b"\xff")]))
    with pytest.raises(Problem, match="^kind: is not UTF-8"):
        form.text("kind", "lay")
