"""Connections end when the client neither sends nor reads, and last as long as it does."""

from __future__ import annotations

import socket
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

import httpx
import pytest
import uvicorn

from tapelayer.workbench import connections, server
from tapelayer.workbench.foreman import Limits
from tapelayer.workbench.server import Settings, configuration, create_app

SHORT = 1.0
# A pause that is well within the limit, and several of which are well beyond it.
PAUSE = 0.3
PAUSES = 8
# For the machine to be busy.
PATIENCE = 30

HEAD = b"GET /healthz HTTP/1.1\r\nHost: localhost\r\n"
POST = b"POST /api/v1/inverse HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/json\r\n"
FORM = (
    b"POST /api/v1/jobs HTTP/1.1\r\nHost: localhost\r\n"
    b"Content-Type: multipart/form-data; boundary=x\r\nContent-Length: 1000000\r\n\r\n"
    b'--x\r\nContent-Disposition: form-data; name="file"; filename="a.txt"\r\n\r\n'
)


@pytest.fixture(scope="module")
def port(tmp_path_factory: pytest.TempPathFactory) -> Iterator[int]:
    """Port of a server as `serve` configures it, with short limits and little to keep for who does not read."""
    app = create_app(Settings(tmp_path_factory.mktemp("work"), Limits(workers=1)))
    with pytest.MonkeyPatch.context() as patch, socket.create_server(("127.0.0.1", 0)) as listening:
        for limit in ("HEAD_SECONDS", "BODY_SECONDS", "READ_SECONDS"):
            patch.setattr(connections, limit, SHORT)
        patch.setattr(server, "GRACE_SECONDS", 1)
        listening.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 1 << 14)
        serving = uvicorn.Server(configuration(app, None))
        thread = threading.Thread(target=serving.run, args=([listening],))
        thread.start()
        port: int = listening.getsockname()[1]
        assert httpx.get(f"http://127.0.0.1:{port}/openapi.json", timeout=PATIENCE).status_code == 200
        yield port
        serving.should_exit = True
        thread.join()


@contextmanager
def connected(port: int) -> Iterator[socket.socket]:
    with socket.create_connection(("127.0.0.1", port), timeout=PATIENCE) as connection:
        yield connection


def rest(connection: socket.socket) -> bytes:
    """All that comes until the server ends the connection; a time out is raised."""
    told = b""
    try:
        while chunk := connection.recv(1 << 16):
            told += chunk
    except ConnectionResetError:
        pass
    return told


def trickle(connection: socket.socket, piece: bytes) -> int:
    """Send a piece again and again until the server ends the connection; how often it was sent."""
    for count in range(int(PATIENCE / PAUSE)):
        try:
            connection.sendall(piece)
            connection.settimeout(PAUSE)
            if connection.recv(1) == b"":
                return count
        except TimeoutError:
            continue
        except ConnectionError:
            return count
    raise AssertionError("the connection goes on")


def test_a_connection_that_sends_nothing_is_closed(port: int) -> None:
    with connected(port) as first, connected(port) as second:
        begun = time.monotonic()
        assert (rest(first), rest(second)) == (b"", b"")
        assert time.monotonic() - begun > SHORT / 2


def test_a_head_that_trickles_is_closed(port: int) -> None:
    with connected(port) as connection:
        connection.sendall(HEAD)
        assert trickle(connection, b"X-More: x\r\n") >= 1


def test_a_second_head_that_trickles_is_closed(port: int) -> None:
    with connected(port) as connection:
        connection.sendall(HEAD + b"\r\n")
        assert connection.recv(1 << 16).startswith(b"HTTP/1.1 200")
        connection.sendall(HEAD)
        assert trickle(connection, b"X-More: x\r\n") >= 1


@pytest.mark.parametrize("head", [POST + b"Content-Length: 1000000\r\n\r\n", FORM], ids=["rows", "form"])
def test_a_body_that_trickles_is_closed(port: int, head: bytes, caplog: pytest.LogCaptureFixture) -> None:
    with connected(port) as connection:
        connection.sendall(head)
        assert trickle(connection, b" ") >= 1
    time.sleep(PAUSE)
    assert "Traceback" not in caplog.text and "reference" not in caplog.text


def test_a_slow_body_is_waited_for(port: int) -> None:
    body = b" " * connections.BODY_BYTES
    with connected(port) as connection:
        connection.sendall(POST + f"Connection: close\r\nContent-Length: {PAUSES * len(body)}\r\n\r\n".encode())
        for _ in range(PAUSES):
            connection.sendall(body)
            time.sleep(PAUSE)
        assert rest(connection).startswith(b"HTTP/1.1 422")


def test_a_client_that_waits_for_leave_to_send_gets_it(port: int) -> None:
    with connected(port) as connection:
        connection.sendall(POST + b"Connection: close\r\nExpect: 100-continue\r\nContent-Length: 2\r\n\r\n")
        assert connection.recv(1 << 16).startswith(b"HTTP/1.1 100")
        connection.sendall(b"[]")
        assert rest(connection).startswith(b"HTTP/1.1 422")


def small(port: int) -> socket.socket:
    """A connection whose buffer holds little."""
    connection = socket.socket()
    connection.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 12)
    connection.settimeout(PATIENCE)
    connection.connect(("127.0.0.1", port))
    connection.sendall(b"GET /swagger/swagger-ui-bundle.js HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n")
    return connection


def test_an_answer_that_nobody_reads_is_given_up(port: int) -> None:
    whole = len(httpx.get(f"http://127.0.0.1:{port}/swagger/swagger-ui-bundle.js").content)
    assert whole > 1 << 20
    with small(port) as connection:
        time.sleep(3 * SHORT)
        assert len(rest(connection)) < whole


def test_an_answer_that_is_read_slowly_is_sent(port: int) -> None:
    whole = len(httpx.get(f"http://127.0.0.1:{port}/swagger/swagger-ui-bundle.js").content)
    with small(port) as connection:
        told = b""
        for _ in range(PAUSES):
            told += connection.recv(1 << 14)
            time.sleep(PAUSE)
        assert len((told + rest(connection)).partition(b"\r\n\r\n")[2]) == whole
