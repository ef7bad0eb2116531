"""Server: the page, the session, the documents and the end of it all, on a real port where it matters."""

from __future__ import annotations

import asyncio
import os
import re
import shutil
import signal
import socket
import ssl
import subprocess
import sys
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager, contextmanager
from dataclasses import dataclass
from pathlib import Path

import httpx
import pytest
from fastapi import FastAPI

from tapelayer.errors import ServeRefused, TapelayerError
from tapelayer.workbench import command, server
from tapelayer.workbench.foreman import Limits
from tapelayer.workbench.problems import CODES, MEDIA_TYPE
from tapelayer.workbench.server import Settings, create_app
from tests.helpers.paths import ROOT

EXAMPLE = ROOT / "examples" / "flat_panel_00.txt"
TOKEN = "0123456789abcdef-of-the-shop"
# For the machine to be very busy, not for the server to be slow.
PATIENCE = 120


@dataclass
class Serving:
    """A server in a process of its own."""

    process: subprocess.Popen[str]
    client: httpx.Client


def spawned(*arguments: object) -> subprocess.Popen[str]:
    code = "import sys; from tapelayer.dispatch import main; sys.argv[0] = 'tapelayer'; main()"
    line = [sys.executable, "-c", code, "serve", *map(str, arguments)]
    environment = os.environ | {"PYTHONPATH": str(ROOT), "NO_COLOR": "1"}
    return subprocess.Popen(line, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment)


@contextmanager
def serving(work: Path, *arguments: object, verify: ssl.SSLContext | bool = True) -> Iterator[Serving]:
    process = spawned("--port", 0, "--work-dir", work, *arguments)
    try:
        assert process.stdout and process.stderr
        said = re.fullmatch(r"workbench: (https?://\S+) \(Ctrl\+C ends it\)\n", process.stdout.readline())
        assert said, process.stderr.read()
        with httpx.Client(base_url=said[1], verify=verify, timeout=PATIENCE) as client:
            yield Serving(process, client)
    finally:
        process.terminate()
        process.communicate(timeout=PATIENCE)


@pytest.fixture(scope="module")
def plain(tmp_path_factory: pytest.TempPathFactory) -> Iterator[httpx.Client]:
    with serving(tmp_path_factory.mktemp("work"), "--max-upload-mb", 1) as served:
        yield served.client


def assert_problem(response: httpx.Response, code: str) -> str:
    assert response.headers["content-type"] == MEDIA_TYPE, response.text
    body = response.json()
    assert (body["code"], body["status"]) == (code, response.status_code)
    assert response.status_code == CODES[code].status
    assert "Traceback" not in response.text
    return str(body["detail"])


def test_the_page_and_its_files(plain: httpx.Client) -> None:
    page = plain.get("/")
    assert page.headers["content-type"].startswith("text/html")
    assert page.headers["content-security-policy"].startswith("default-src 'self'")
    assert not re.search(r"https?:|//", page.text)
    files = re.findall(r'(?:src|href)="([^"]+)"', page.text)
    assert files
    for file in files:
        assert plain.get(file).status_code == 200
    script = plain.get("/workbench.js")
    assert script.headers["content-type"].startswith("text/javascript")
    assert script.headers["cache-control"] == "no-cache"
    again = plain.get("/workbench.js", headers={"If-None-Match": script.headers["etag"]})
    assert (again.status_code, again.content) == (304, b"")
    assert "content-security-policy" in again.headers


def test_the_head_of_everything(plain: httpx.Client) -> None:
    for path in ("/", "/workbench.js", "/healthz", "/openapi.json", "/api/v1/jobs"):
        got, head = plain.get(path), plain.head(path)
        assert (head.status_code, head.content) == (200, b"")
        assert head.headers["content-length"] == got.headers["content-length"] == str(len(got.content))


@pytest.mark.parametrize("path", ["/nothing", "/api/v1/nothing", "/..%2fserver.py", "/%00", "/x" * 3000, "/swagger"])
def test_nothing_there(plain: httpx.Client, path: str) -> None:
    assert "there is nothing at /" in assert_problem(plain.get(path), "not-found")


@pytest.mark.parametrize(("path", "allowed"), [("/", "GET, HEAD"), ("/healthz", "GET"), ("/docs", "GET")])
def test_methods_that_are_not_allowed(plain: httpx.Client, path: str, allowed: str) -> None:
    response = plain.delete(path)
    assert f"DELETE {path}: this address allows {allowed}" == assert_problem(response, "method-not-allowed")
    assert response.headers["allow"] == allowed


def test_the_server_says_that_it_is_well(plain: httpx.Client) -> None:
    health = plain.get("/healthz").json()
    assert health["status"] == "ok"
    assert plain.get("/openapi.json").json()["info"]["version"] == health["version"]


def test_every_room_is_described(plain: httpx.Client) -> None:
    """Every reference of the description leads somewhere, and the routes of every room are in it."""
    description = plain.get("/openapi.json")
    paths = description.json()["paths"]
    assert {"/healthz", "/api/v1/session", "/api/v1/jobs", "/api/v1/inverse", "/api/v1/machines"} < set(paths)
    assert all(path == "/healthz" or path.startswith("/api/v1/") for path in paths)
    schemas = description.json()["components"]["schemas"]
    references = set(re.findall(r'"\$ref":"([^"]+)"', description.text))
    assert references == {f"#/components/schemas/{name}" for name in schemas} & references


def test_the_description_is_a_page_of_local_files(plain: httpx.Client) -> None:
    page = plain.get("/docs")
    assert "style-src 'self' 'unsafe-inline'" in page.headers["content-security-policy"]
    assert not re.search(r"https?:|<script>|<style|\son\w+=", page.text)
    for file in re.findall(r'(?:src|href)="([^"]+)"', page.text):
        assert plain.get(file).status_code == 200


def test_every_code_has_a_page(plain: httpx.Client) -> None:
    for code, kind in CODES.items():
        page = plain.get(f"/problems/{code}")
        assert page.status_code == 200
        assert f"<h1>{kind.title.replace(chr(39), '&#x27;')}</h1>" in page.text
        assert f"<code>{code}</code>, status {kind.status}" in page.text
    assert_problem(plain.get("/problems/none"), "not-found")


def test_a_name_that_is_not_the_servers(plain: httpx.Client) -> None:
    assert "'evil.example'" in assert_problem(plain.get("/", headers={"Host": "evil.example"}), "host-not-allowed")


@pytest.mark.parametrize(
    ("body", "sentence"),
    [
        (b"{}", "token: Field required"),
        (b'{"token": 1}', "token: Input should be a valid string"),
        (b"[1]", "body: Input should be a valid dictionary or object to extract fields from"),
        (b'{"token"', "[8]: JSON decode error"),
        (b"[" * 100, "the JSON is more than 64 levels deep"),
        (b"", "body: Field required"),
        (b"\xff", "POST /api/v1/session: There was an error parsing the body"),
    ],
)
def test_requests_that_are_not_valid(plain: httpx.Client, body: bytes, sentence: str) -> None:
    response = plain.post("/api/v1/session", content=body, headers={"Content-Type": "application/json"})
    assert assert_problem(response, "invalid-request") == sentence


def test_a_large_upload_is_refused_and_the_client_hears_it(plain: httpx.Client) -> None:
    """With a stated length and without, far more than the sockets buffer."""

    head = b'--x\r\nContent-Disposition: form-data; name="file"; filename="a.txt"\r\n\r\n'

    def endless() -> Iterator[bytes]:
        yield head
        for _ in range(100):
            yield b"x" * 2**16

    form = {"Content-Type": "multipart/form-data; boundary=x"}
    nowhere = plain.post("/nothing", content=endless(), headers=form)
    assert_problem(nowhere, "method-not-allowed")
    for content in (head + b"x" * 6_000_000, endless()):
        assert "1 MB" in assert_problem(plain.post("/api/v1/jobs", content=content, headers=form), "upload-too-large")


def test_sessions_without_a_token(plain: httpx.Client) -> None:
    assert plain.get("/api/v1/session").json() | {"version": ""} == {
        "token_required": False,
        "signed_in": True,
        "version": "",
    }
    response = plain.post("/api/v1/session", json={"token": "x"})
    assert (response.status_code, response.content) == (204, b"")
    assert "set-cookie" not in response.headers


def certificate(folder: Path) -> tuple[Path, Path]:
    """A certificate for this machine, and its key."""
    openssl = shutil.which("openssl")
    if not openssl:
        pytest.skip("openssl is not installed")
    pem, key = folder / "cell.pem", folder / "cell.key"
    names = "subjectAltName=DNS:localhost,IP:127.0.0.1"
    line = [openssl, "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-days", "2", "-subj", "/CN=localhost"]
    line += ["-addext", names, "-keyout", str(key), "-out", str(pem)]
    subprocess.run(line, check=True, capture_output=True)
    return pem, key


def test_signing_in_by_tls(tmp_path: Path) -> None:
    pem, key = certificate(tmp_path)
    token = tmp_path / "token"
    token.write_text(TOKEN + "\n")
    token.chmod(0o600)
    options = ("--token-file", token, "--tls-cert", pem, "--tls-key", key, "--allow-host", "cell-4")
    with serving(tmp_path / "work", *options, verify=ssl.create_default_context(cafile=str(pem))) as served:
        page = served.client
        assert page.base_url.scheme == "https"
        assert page.get("/").status_code == 200
        assert page.get("/workbench.js", headers={"Host": "cell-4"}).status_code == 200
        assert page.get("/api/v1/session").json()["signed_in"] is False
        assert "Secure" in page.get("/api/v1/session", headers={"Cookie": ""}).headers["set-cookie"]
        for path in ("/openapi.json", "/docs", "/api/v1/jobs"):
            assert_problem(page.get(path), "token-required")
        assert_problem(page.post("/api/v1/session", json={"token": "x"}), "wrong-token")
        assert_problem(
            page.post("/api/v1/session", json={"token": TOKEN}, headers={"Origin": "https://evil.example"}),
            "foreign-origin",
        )
        signed = page.post("/api/v1/session", json={"token": TOKEN})
        assert signed.status_code == 204
        assert re.fullmatch(
            r"tapelayer_session=\S+; Max-Age=43200; Path=/; HttpOnly; SameSite=Strict; Secure",
            signed.headers["set-cookie"],
        )
        assert page.get("/api/v1/session").json()["signed_in"] is True
        assert page.get("/api/v1/jobs").json() == {"jobs": []}
        assert page.delete("/api/v1/session").status_code == 204
        assert_problem(page.get("/api/v1/jobs"), "token-required")
        assert page.get("/api/v1/jobs", headers={"Authorization": f"Bearer {TOKEN}"}).status_code == 200


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_signal_ends_it_with_an_event_stream_open(tmp_path: Path, number: signal.Signals) -> None:
    with serving(tmp_path, "--no-open") as served:
        files = {"file": (EXAMPLE.name, EXAMPLE.read_bytes())}
        made = served.client.post("/api/v1/jobs", files=files, data={"kind": "lay"})
        assert made.status_code == 202, made.text
        with served.client.stream("GET", made.headers["location"] + "/events") as stream:
            lines = stream.iter_lines()
            assert next(lines) == "event: state"
            served.process.send_signal(number)
            # The stream ends as streams end: a connection that breaks off would raise.
            assert list(lines)
        assert served.process.wait(PATIENCE) == 0
        assert served.process.stderr
        assert served.process.stderr.read() == ""


LIMITS = Limits()


@asynccontextmanager
async def running(work: Path, limits: Limits = LIMITS) -> AsyncIterator[httpx.AsyncClient]:
    """The application without a server."""
    app = create_app(Settings(work, limits))
    transport = httpx.ASGITransport(app)
    async with app.router.lifespan_context(app), httpx.AsyncClient(transport=transport) as client:
        client.base_url = httpx.URL("http://localhost")
        yield client


def test_the_first_view_does_not_wait_for_the_library(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[str] = []

    async def told() -> None:
        imported = asyncio.Event()

        async def load(app: FastAPI) -> None:
            await imported.wait()

        monkeypatch.setattr(server, "_load", load)
        async with running(tmp_path) as client:
            waiting = asyncio.create_task(client.get("/api/v1/jobs"))
            for path in ("/", "/workbench.js", "/healthz", "/api/v1/session", "/problems/internal"):
                assert (await client.get(path)).status_code == 200
                asked.append(path)
            assert not waiting.done()
            imported.set()
            assert (await waiting).status_code == 404

    asyncio.run(told())
    assert len(asked) == 5


def test_a_full_queue_says_when_to_come_again(tmp_path: Path) -> None:
    async def told() -> tuple[httpx.Response, ...]:
        async with running(tmp_path, Limits(workers=1, queue=1)) as client:
            form = {"data": {"kind": "lay"}, "files": {"file": ("panel.txt", EXAMPLE.read_bytes())}}
            answers = [await client.post("/api/v1/jobs", **form) for _ in range(3)]
            return *answers, await client.get("/api/v1/jobs", headers={"X-Owner-Key": answers[0].json()["owner_key"]})

    *taken, full, kept = asyncio.run(told())
    assert [answer.status_code for answer in taken] == [202, 202]
    assert (full.status_code, full.json()["code"]) == (429, "queue-full")
    assert int(full.headers["Retry-After"]) > 0
    assert len(kept.json()["jobs"]) == 1
    assert len(list((tmp_path / "jobs").iterdir())) == 2 and not list((tmp_path / "staging").iterdir())


def test_a_room_that_cannot_be_imported_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(server, "ROOMS", ("no_such_room",))

    async def told() -> None:
        async with running(tmp_path) as client:
            for _ in range(2):
                assert_problem(await client.get("/api/v1/jobs"), "internal")
            assert (await client.get("/")).status_code == 200

    asyncio.run(told())
    assert "no_such_room" in caplog.text


def test_the_port_is_taken(tmp_path: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        done = spawned("--port", port, "--work-dir", tmp_path)
        output, errors = done.communicate(timeout=PATIENCE)
    assert (done.returncode, output) == (2, "")
    assert errors == (
        f"cannot listen on port {port} of 127.0.0.1: address already in use; "
        "stop what uses it, or choose another with --port; 0 takes any free one\n"
    )


def file(folder: Path, text: str) -> str:
    path = folder / "token"
    path.write_text(text)
    path.chmod(0o600)
    return str(path)


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"tls_cert": "a.pem"}, "--tls-cert and --tls-key belong together"),
        ({"tls_key": "a.key"}, "--tls-cert and --tls-key belong together"),
        ({"tls_cert": "no.pem", "tls_key": "no.key"}, "TLS cannot use no.pem with no.key: no such file"),
        ({"token_file": "no"}, "no: cannot be read: no such file or directory"),
        ({"host": "0.0.0.0"}, "--host 0.0.0.0 lets other machines in: give a --token-file, or --insecure"),
        ({"host": "::"}, "--host :: lets other machines in"),
        ({"host": "cell-4"}, "--host cell-4 lets other machines in"),
        ({"host": "127.0.0.1.nip.invalid", "insecure": True}, "cannot listen on port 8765 of 127.0.0.1.nip.invalid"),
    ],
)
def test_what_cannot_be_served_is_told(options: dict[str, object], sentence: str) -> None:
    with pytest.raises(ServeRefused, match="^" + re.escape(sentence)):
        command.serve(**options)  # type: ignore[arg-type]


@pytest.mark.parametrize("text", ["", "\n", "x" * 15, "x" * 20 + "\n" + "y" * 20, "with spaces within it", "ü" * 20])
def test_tokens_that_are_none(tmp_path: Path, text: str) -> None:
    with pytest.raises(ServeRefused, match="a token is one line of at least 16 letters"):
        command.serve(token_file=file(tmp_path, text))


def test_a_certificate_that_is_none(tmp_path: Path) -> None:
    nonsense = file(tmp_path, "nonsense")
    with pytest.raises(ServeRefused, match=r"TLS cannot use .*token with .*token: .*; both have to be PEM files"):
        command.serve(tls_cert=nonsense, tls_key=nonsense)


def test_a_work_directory_that_cannot_be_used(tmp_path: Path) -> None:
    with pytest.raises(TapelayerError, match="token"):
        command.serve(port=0, work_dir=file(tmp_path, "a file"))


def test_the_extra_is_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(command, "EXTRA", (*command.EXTRA, "no_such_package"))
    with pytest.raises(
        ServeRefused, match=r"^the workbench needs no_such_package: pip install 'tapelayer\[workbench\]'"
    ):
        command.serve()


def test_a_browser_opens_on_a_terminal_only(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    served = []
    monkeypatch.setattr(server, "serve", lambda settings, port, open_page: served.append((settings, port, open_page)))
    for terminal in (True, False):
        monkeypatch.setattr(sys.stdout, "isatty", lambda terminal=terminal: terminal)
        for no_open in (True, False):
            command.serve(
                port=7, work_dir=str(tmp_path), no_open=no_open, workers=3, keep_days=2, allow_host=["cell-4"]
            )
    limits = Limits(workers=3, keep_days=2)
    settings = Settings(tmp_path, limits, allowed_hosts=("cell-4",))
    assert served == [(settings, 7, opened) for opened in (False, True, False, False)]


def test_what_is_not_safe_is_said(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    token = tmp_path / "token"
    token.write_text(f"{TOKEN}\r\n")
    token.chmod(0o644)
    assert command._token(token) == TOKEN
    assert capsys.readouterr().err == f"{token}: other users of this machine may read the token; chmod 600 it\n"
    token.chmod(0o600)
    assert command._token(token) == TOKEN
    for own in ("127.0.0.1", "127.0.0.2", "::1", "localhost"):
        command._check_reach(own, token=False, tls=False, insecure=False)
    command._check_reach("192.0.2.1", token=True, tls=True, insecure=False)
    assert capsys.readouterr().err == ""
    command._check_reach("192.0.2.1", token=False, tls=True, insecure=True)
    assert capsys.readouterr().err == "insecure: whoever reaches 192.0.2.1 may use this server\n"
    command._check_reach("192.0.2.1", token=True, tls=False, insecure=False)
    assert "can be read and changed on their way" in capsys.readouterr().err


def test_the_work_directory_is_where_data_belong(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))
    assert command._data_folder() == tmp_path / "tapelayer"
    monkeypatch.delenv("XDG_DATA_HOME")
    monkeypatch.setenv("HOME", "/home/cell")
    assert command._data_folder() == Path("/home/cell/.local/share/tapelayer")


def test_names_of_a_server_on_every_address() -> None:
    """The wildcard is no name."""
    settings = Settings(Path(), Limits(), host="0.0.0.0", allowed_hosts=("Cell-4",))
    assert settings.access().hosts == {"localhost", "127.0.0.1", "::1", "cell-4"}
