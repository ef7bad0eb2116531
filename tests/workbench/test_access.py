"""Access: hosts, origins, tokens, owners, limits and headers, without any route."""

from __future__ import annotations

import asyncio
import json
import logging
import re
from collections.abc import AsyncIterator
from typing import Any

import httpx
import pytest
from hypothesis import given
from hypothesis import strategies as st
from starlette.requests import Request
from starlette.responses import JSONResponse, StreamingResponse
from starlette.types import Message, Receive, Scope, Send

from tapelayer.workbench import access
from tapelayer.workbench.access import (
    LOOPBACK,
    MAX_BODY_BYTES,
    MAX_JSON_DEPTH,
    MAX_ROWS_BYTES,
    Access,
    Gate,
    Guard,
    json_depth,
)
from tapelayer.workbench.problems import MEDIA_TYPE, Problem

TOKEN = "0123456789abcdef-of-the-shop"
LIMIT = 1000


async def app(scope: Scope, receive: Receive, send: Send) -> None:
    """Tell what arrived."""
    request = Request(scope, receive)
    if scope["path"] == "/api/v1/breaks":
        raise RuntimeError("secret")
    if scope["path"] == "/api/v1/endless":

        async def endless() -> AsyncIterator[bytes]:
            while True:
                yield b"x"
                await asyncio.sleep(0.01)

        await StreamingResponse(endless())(scope, receive, send)
        return
    body = await request.body()
    told = {"method": scope["method"], "length": len(body), **scope["state"]}
    await JSONResponse(told)(scope, receive, send)


class Client:
    """Somebody who asks the guarded application, and keeps cookies as a browser does."""

    def __init__(self, token: str | None, secure: bool, base_url: str) -> None:
        known = Access(LOOPBACK | {"cell-4"}, frozenset({"/", "/workbench.js", "/api/v1/session"}), secure, LIMIT)
        self.guard = Guard(app, known, Gate(token))
        self.cookies = httpx.Cookies()
        self._base_url = base_url

    def request(self, method: str, path: str, **options: Any) -> httpx.Response:
        return asyncio.run(self._request(method, path, options))

    def get(self, path: str, **options: Any) -> httpx.Response:
        return self.request("GET", path, **options)

    def post(self, path: str, **options: Any) -> httpx.Response:
        return self.request("POST", path, **options)

    async def _request(self, method: str, path: str, options: dict[str, Any]) -> httpx.Response:
        transport = httpx.ASGITransport(self.guard)
        async with httpx.AsyncClient(transport=transport, base_url=self._base_url, cookies=self.cookies) as asking:
            response = await asking.request(method, path, **options)
            self.cookies.update(asking.cookies)
            return response


def client(token: str | None = None, secure: bool = False, base_url: str = "http://localhost:8765") -> Client:
    return Client(token, secure, base_url)


def assert_problem(response: httpx.Response, code: str, status: int) -> dict[str, object]:
    assert response.status_code == status, response.text
    assert response.headers["content-type"] == MEDIA_TYPE
    body = response.json()
    assert (body["code"], body["status"], body["type"]) == (code, status, f"/problems/{code}")
    assert body["detail"]
    assert response.headers["content-security-policy"]
    return dict(body)


@pytest.mark.parametrize(
    "host", ["localhost", "LOCALHOST:1", "127.0.0.1:8765", "[::1]", "[::1]:8765", "cell-4", "localhost."]
)
def test_own_names_are_let_in(host: str) -> None:
    assert client().get("/api/v1/jobs", headers={"Host": host}).status_code == 200


@pytest.mark.parametrize(
    "host",
    ["", "evil.example", "localhost.evil.example", "127.0.0.1.evil.example:8765", "[::2]", "[", "cell-5", "::1"]
    + ["localhost..", "a@localhost", "localhost#a", "localhost/a", "localhost:a", "[::1]a", "localhost,localhost"],
)
def test_other_names_are_not(host: str) -> None:
    for path in ("/", "/api/v1/jobs"):
        assert_problem(client().get(path, headers={"Host": host}), "host-not-allowed", 421)


def test_the_address_that_was_reached_is_a_name_of_the_server() -> None:
    """A server on every address of the machine is asked by one of them; a name there would be the client's word."""
    assert client(base_url="http://192.0.2.7").get("/").status_code == 200
    assert_problem(client(base_url="http://evil.example").get("/"), "host-not-allowed", 421)


@pytest.mark.parametrize("method", ["POST", "PUT", "PATCH", "DELETE"])
@pytest.mark.parametrize(
    "headers",
    [
        {"Origin": "null"},
        {"Origin": ""},
        {"Origin": "http://evil.example"},
        {"Origin": "http://localhost"},
        {"Origin": "http://localhost:8766"},
        {"Origin": "http://127.0.0.1:8765"},
        {"Origin": "ftp://localhost:8765"},
        {"Sec-Fetch-Site": "cross-site"},
        {"Sec-Fetch-Site": "same-site"},
        {"Sec-Fetch-Site": "cross-site", "Origin": "http://localhost:8765"},
    ],
)
def test_unsafe_methods_of_foreign_pages_are_refused(method: str, headers: dict[str, str]) -> None:
    assert_problem(client().request(method, "/api/v1/jobs", headers=headers), "foreign-origin", 403)
    assert client().get("/api/v1/jobs", headers=headers).status_code == 200


@pytest.mark.parametrize(
    "headers",
    [
        {},
        {"Origin": "http://localhost:8765"},
        {"Origin": "http://LOCALHOST:8765", "Sec-Fetch-Site": "same-origin"},
        {"Sec-Fetch-Site": "none"},
    ],
)
def test_the_own_page_and_programs_may(headers: dict[str, str]) -> None:
    assert client().post("/api/v1/jobs", headers=headers).json()["method"] == "POST"


def test_without_a_token_everything_is_open() -> None:
    assert client().get("/api/v1/jobs").json()["signed_in"] is True


def test_a_token_is_asked_for() -> None:
    guarded = client(TOKEN)
    for path in ("/", "/workbench.js", "/api/v1/session", "/problems/not-found"):
        assert guarded.get(path).json()["signed_in"] is False
    for path in ("/api/v1/jobs", "/docs", "/openapi.json", "/other.js", "/api/v1/session/x", "/API/v1/jobs"):
        response = guarded.get(path)
        assert_problem(response, "token-required", 401)
        assert response.headers["www-authenticate"] == "Bearer"
    for scheme in ("Bearer", "bearer"):
        assert guarded.get("/api/v1/jobs", headers={"Authorization": f"{scheme} {TOKEN}"}).json()["signed_in"] is True
    assert_problem(guarded.get("/api/v1/jobs", headers={"Authorization": "Basic x"}), "token-required", 401)


@pytest.mark.parametrize("path", ["/", "/api/v1/session", "/api/v1/jobs"])
@pytest.mark.parametrize("sent", ["", "x", TOKEN[:-1], TOKEN + "x", "\xfc\xfc"])
def test_a_wrong_token_is_told_on_every_path(path: str, sent: str) -> None:
    headers = {"Authorization": f"Bearer {sent}".encode("latin-1")}
    response = client(TOKEN).get(path, headers=headers)  # type: ignore[arg-type]
    assert_problem(response, "wrong-token", 401)
    assert response.headers["www-authenticate"] == "Bearer"


def test_wrong_tokens_are_counted_by_address(monkeypatch: pytest.MonkeyPatch) -> None:
    now = 1000.0
    monkeypatch.setattr(access.time, "monotonic", lambda: now)
    gate = Gate(TOKEN)
    for _ in range(access.TRIES):
        with pytest.raises(Problem) as wrong:
            gate.check("x", "192.0.2.1")
        assert wrong.value.code == "wrong-token"
    now += access.TRIES_SECONDS - 0.5
    for token in ("x", TOKEN):
        with pytest.raises(Problem) as blocked:
            gate.check(token, "192.0.2.1")
        assert blocked.value.code == "too-many-attempts"
        assert blocked.value.headers == {"Retry-After": "1"}
    gate.check(TOKEN, "192.0.2.2")
    now += 0.5
    gate.check(TOKEN, "192.0.2.1")


def test_a_right_token_forgives_and_addresses_are_forgotten(monkeypatch: pytest.MonkeyPatch) -> None:
    gate = Gate(TOKEN)
    for _ in range(3):
        for _ in range(access.TRIES - 1):
            with pytest.raises(Problem, match="not this server's"):
                gate.check("x", "192.0.2.1")
        gate.check(TOKEN, "192.0.2.1")
    monkeypatch.setattr(access, "KNOWN_ADDRESSES", 2)
    for address in ("a", "b", "c"):
        with pytest.raises(Problem, match="not this server's"):
            gate.check("x", address)
    assert list(gate._wrong) == ["b", "c"]


def test_bearers_are_limited_through_the_guard() -> None:
    guarded = client(TOKEN)
    wrong = {"Authorization": "Bearer nonsense"}
    for _ in range(access.TRIES):
        assert_problem(guarded.get("/", headers=wrong), "wrong-token", 401)
    response = guarded.get("/", headers=wrong)
    assert_problem(response, "too-many-attempts", 429)
    assert 1 <= int(response.headers["retry-after"]) <= access.TRIES_SECONDS + 1


def test_a_session_holds_until_it_expires_or_the_token_changes(monkeypatch: pytest.MonkeyPatch) -> None:
    gate = Gate(TOKEN)
    session = gate.session()
    assert gate.holds(session)
    assert gate.session() != session
    assert TOKEN not in session
    assert not Gate(TOKEN + "x").holds(session)
    nonce, expiry, proof = session.split(".")
    for forged in (
        "",
        ".",
        "..",
        f"{nonce}.{int(expiry) + 1}.{proof}",
        f"{nonce}.{expiry}.",
        f"{nonce}.x.{proof}",
        "ü",
    ):
        assert not gate.holds(forged)
    monkeypatch.setattr(access.time, "time", lambda: int(expiry))
    assert not gate.holds(session)


def test_a_session_cookie_signs_in() -> None:
    guarded = client(TOKEN)
    guarded.cookies.set(access.SESSION_COOKIE, Gate(TOKEN).session())
    assert guarded.get("/api/v1/jobs").json()["signed_in"] is True
    stranger = client(TOKEN)
    stranger.cookies.set(access.SESSION_COOKIE, Gate(TOKEN + "x").session())
    assert_problem(stranger.get("/api/v1/jobs"), "token-required", 401)


@pytest.mark.parametrize("secure", [False, True])
def test_the_page_gets_its_owner_with_its_session(secure: bool) -> None:
    page = client(secure=secure, base_url="https://localhost:8765")
    given_cookie = page.get("/api/v1/session").headers["set-cookie"]
    pattern = r"tapelayer_owner=[0-9a-f]{32}; Max-Age=\d+; Path=/; HttpOnly; SameSite=Strict" + "; Secure" * secure
    assert re.fullmatch(pattern, given_cookie)
    owner = page.get("/api/v1/jobs").json()
    assert "owner_key" not in owner
    again = page.get("/api/v1/session")
    assert "set-cookie" not in again.headers
    assert again.json()["owner"] == owner["owner"]
    assert client().get("/api/v1/jobs").json()["owner"] != owner["owner"]


def test_only_the_session_gives_an_owner() -> None:
    """A page opened by another site's link comes without its strict cookies, and must not lose its owner by it."""
    for path in ("/", "/api/v1/jobs"):
        assert "set-cookie" not in client().get(path).headers


def test_a_program_gets_a_key_and_sends_it() -> None:
    first = client().post("/api/v1/jobs").json()
    assert re.fullmatch("[0-9a-f]{32}", first["owner_key"])
    assert first["owner_key"] not in first["owner"]
    second = client().post("/api/v1/jobs", headers={"X-Owner-Key": first["owner_key"]}).json()
    assert second["owner"] == first["owner"]
    assert "owner_key" not in second


@pytest.mark.parametrize("key", ["", "a", "A" * 32, "0" * 31, "0" * 33, "../" * 10 + "ab"])
def test_a_key_that_is_none_is_refused(key: str) -> None:
    assert_problem(client().get("/api/v1/jobs", headers={"X-Owner-Key": key}), "invalid-request", 422)


def test_a_cookie_that_is_none_is_replaced() -> None:
    page = client()
    page.cookies.set(access.OWNER_COOKIE, "short")
    assert "set-cookie" in page.get("/api/v1/session").headers


def test_every_answer_has_its_headers() -> None:
    policies = {}
    for path in ("/", "/docs", "/api/v1/jobs", "/api/v1/jobs/0/report.html", "/api/v1/breaks"):
        headers = client().get(path).headers
        assert headers["x-content-type-options"] == "nosniff"
        assert headers["referrer-policy"] == "no-referrer"
        assert headers["cross-origin-opener-policy"] == "same-origin"
        assert headers["cross-origin-resource-policy"] == "same-origin"
        assert headers["cache-control"] == ("no-store" if path.startswith("/api/") else "no-cache")
        assert not [name for name in headers if name.startswith("access-control")]
        rules = [rule.split() for rule in headers["content-security-policy"].split(";")]
        policies[path] = {rule[0]: " ".join(rule[1:]) for rule in rules}
        assert len(policies[path]) == len(rules)
    for path, policy in policies.items():
        assert policy["frame-ancestors"] == policy["base-uri"] == "'none'"
        assert "script-src" not in policy
        assert policy["default-src"] == ("'none'" if path.startswith("/api/") else "'self'")
    assert policies["/"]["object-src"] == "'none'"
    assert "style-src" not in policies["/"]
    assert "sandbox" in policies["/api/v1/jobs/0/report.html"]


def test_an_accident_is_told_by_reference_only(caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.ERROR):
        response = client().get("/api/v1/breaks")
    body = assert_problem(response, "internal", 500)
    assert "secret" not in response.text and "Traceback" not in response.text
    assert f"reference {body['reference']}" in caplog.text
    assert "RuntimeError: secret" in caplog.text


def test_the_head_is_the_answer_without_its_body() -> None:
    got, head = client().get("/api/v1/session"), client().request("HEAD", "/api/v1/session")
    assert head.status_code == 200
    assert head.content == b""
    assert {name for name in head.headers} == {name for name in got.headers}
    assert client().request("HEAD", "/api/v1/endless").status_code == 200


def test_web_sockets_are_refused() -> None:
    sent = []

    async def receive() -> Message:
        return {"type": "websocket.connect"}

    async def send(message: Message) -> None:
        sent.append(message["type"])

    asyncio.run(client().guard({"type": "websocket", "path": "/", "headers": []}, receive, send))
    assert sent == ["websocket.close"]


async def chunks(*sizes: int) -> AsyncIterator[bytes]:
    """A body whose length nobody states."""
    for size in sizes:
        yield b"1" * size


@pytest.mark.parametrize(
    ("path", "media_type", "limit"),
    [
        ("/api/v1/jobs", "multipart/form-data; boundary=x", LIMIT),
        ("/api/v1/setup/parse", "text/plain", MAX_BODY_BYTES),
        ("/api/v1/session", "application/json", MAX_BODY_BYTES),
        ("/api/v1/inverse", "application/json", MAX_ROWS_BYTES),
        ("/api/v1/forward", "multipart/form-data; boundary=x", MAX_ROWS_BYTES),
    ],
)
def test_bodies_are_bounded(path: str, media_type: str, limit: int) -> None:
    headers = {"Content-Type": media_type}
    full = client().post(path, content=b"1" * limit, headers=headers)
    assert full.json()["length"] == limit
    for content in (b"1" * (limit + 1), chunks(limit, 1), chunks(limit + 1), chunks(limit + 1, limit, limit)):
        response = client().post(path, content=content, headers=headers)
        body = assert_problem(response, "upload-too-large", 413)
        assert body["limit_bytes"] == limit


@pytest.mark.parametrize(
    ("length", "waits", "taken"),
    [(3 * LIMIT, False, LIMIT), (LIMIT + 50, False, LIMIT), (3 * LIMIT, True, 0)],
)
def test_what_is_refused_is_still_taken_in(length: int, waits: bool, taken: int) -> None:
    """A client that sends on is heard out, within bounds; one that waits for a word is not."""
    left, statuses = length, []

    async def receive() -> Message:
        nonlocal left
        size = min(100, left)
        left -= size
        return {"type": "http.request", "body": b"x" * size, "more_body": left > 0}

    async def send(message: Message) -> None:
        statuses.append(message.get("status"))

    headers = [(b"host", b"localhost"), (b"content-type", b"multipart/form-data; boundary=x")]
    headers += [(b"content-length", str(length).encode())] + [(b"expect", b"100-continue")] * waits
    asyncio.run(client().guard({"type": "http", "method": "POST", "path": "/x", "headers": headers}, receive, send))
    assert statuses[0] == 413
    assert length - left == taken


def nested(depth: int) -> bytes:
    return b"[" * depth + b"]" * depth


@pytest.mark.parametrize("media_type", ["application/json", "application/problem+json; charset=utf-8"])
def test_deep_json_is_refused(media_type: str) -> None:
    headers = {"Content-Type": media_type}
    deepest = nested(MAX_JSON_DEPTH)
    assert client().post("/api/v1/setup/format", content=deepest, headers=headers).json()["length"] == len(deepest)
    for body in (nested(MAX_JSON_DEPTH + 1), b"[" * 10**5, b'{"a":' * 10**4, b'{"]]]]": ' * 65):
        assert_problem(client().post("/api/v1/setup/format", content=body, headers=headers), "invalid-request", 422)


JSON = st.recursive(
    st.none() | st.integers() | st.text(st.sampled_from('[]{}"\\ab')),
    lambda inner: (
        st.lists(inner, max_size=3) | st.dictionaries(st.text(st.sampled_from('[]{}"\\ab')), inner, max_size=3)
    ),
)


def depth_of(value: object) -> int:
    if isinstance(value, dict):
        value = list(value.values())
    return 1 + max((depth_of(item) for item in value), default=0) if isinstance(value, list) else 0


@given(JSON)
def test_depth_is_that_of_the_value(value: object) -> None:
    assert json_depth(json.dumps(value).encode()) == depth_of(value)
