"""Access: checks on every request before a route sees it, and the security headers of every answer."""

from __future__ import annotations

import asyncio
import hashlib
import hmac
import ipaddress
import logging
import re
import secrets
import time
from collections import OrderedDict
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np
from starlette.datastructures import Headers, MutableHeaders
from starlette.requests import HTTPConnection
from starlette.responses import JSONResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send
from starlette.websockets import WebSocketClose

from tapelayer.workbench.problems import MEDIA_TYPE, Problem, internal

LOG = logging.getLogger(__name__)

API = "/api/"
SESSION = "/api/v1/session"
PROBLEMS = "/problems/"
DOCS = "/docs"
LOOPBACK = frozenset({"localhost", "127.0.0.1", "::1"})

OWNER_COOKIE = "tapelayer_owner"
OWNER_HEADER = "X-Owner-Key"
OWNER_KEY = re.compile(r"[0-9a-f]{32}")
# Browsers cap the lifetime of a cookie at 400 days.
OWNER_SECONDS = 400 * 24 * 3600
SESSION_COOKIE = "tapelayer_session"
SESSION_SECONDS = 12 * 3600

SAFE_METHODS = {"GET", "HEAD", "OPTIONS"}
# Setups and tokens are small. Only rows are larger; they are parsed off the event loop, by models of fixed depth.
ROWS = frozenset({"/api/v1/inverse", "/api/v1/forward"})
MAX_ROWS_BYTES = 32 * 2**20
MAX_BODY_BYTES = 2**18
FORM = "multipart/form-data"
MAX_JSON_DEPTH = 64
# A JSON string, terminated or not; the possessive quantifiers keep the scan linear for any input.
JSON_STRING = re.compile(rb'"[^"\\]*+(?:\\.[^"\\]*+)*+"?', re.DOTALL)
NO_BRACKETS = bytes(set(range(256)) - set(b"[]{}"))
DRAIN_SECONDS = 5.0
HOST = re.compile(r"(?:\[([0-9a-f:.]+)\]|([a-z0-9_.-]*[a-z0-9_-])\.?)(?::[0-9]*)?")

TRIES = 10
TRIES_SECONDS = 60.0
KNOWN_ADDRESSES = 10_000

COMMON = {
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
}
NOWHERE = "object-src 'none'; base-uri 'none'; form-action 'self'; frame-ancestors 'none'"
PAGE_POLICY = f"default-src 'self'; img-src 'self' data: blob:; {NOWHERE}"
# Swagger UI sets style attributes and embeds its images.
DOCS_POLICY = f"default-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' data:; {NOWHERE}"
DATA_POLICY = "default-src 'none'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
# A report contains user input: browsers may display it, but must not run anything in it.
REPORT_POLICY = f"sandbox; {DATA_POLICY}; style-src 'unsafe-inline'"


@dataclass(frozen=True)
class Access:
    """Rules for which requests are let in.

    Attributes:
        hosts: host names of the server, in lower case and without a port; its own address is always allowed.
        open_paths: paths that need no token.
        secure: whether the server is reachable by TLS only.
        max_upload: largest size of a request with files, in bytes.
    """

    hosts: frozenset[str]
    open_paths: frozenset[str]
    secure: bool
    max_upload: int


class Gate:
    """The token and the sessions made with it; the only state it keeps is the count of wrong tokens.

    Args:
        token: secret that clients must send; None lets everybody in.
    """

    def __init__(self, token: str | None) -> None:
        self._token = token
        self._key = hashlib.sha256(f"tapelayer session\0{token}".encode()).digest()
        self._wrong: OrderedDict[str, tuple[int, float]] = OrderedDict()

    @property
    def closed(self) -> bool:
        """Whether a token is required."""
        return self._token is not None

    def check(self, token: str, address: str) -> None:
        """Compare a token in constant time.

        Args:
            token: as sent.
            address: of the client.

        Raises:
            Problem: wrong-token, or too-many-attempts from this address, even if this token is right.
        """
        if self._token is None:
            return
        count, since = self._wrong.get(address, (0, 0.0))
        left = since + TRIES_SECONDS - time.monotonic()
        if left <= 0:
            count, since = 0, time.monotonic()
        if count >= TRIES:
            detail = f"{TRIES} wrong tokens came from {address}: try again in {left:.0f} s"
            raise Problem("too-many-attempts", detail, {"Retry-After": str(int(left) + 1)})
        if hmac.compare_digest(token.encode(), self._token.encode()):
            self._wrong.pop(address, None)
            return
        self._wrong[address] = (count + 1, since)
        while len(self._wrong) > KNOWN_ADDRESSES:
            self._wrong.popitem(last=False)
        raise Problem("wrong-token", "the token is not this server's", {"WWW-Authenticate": "Bearer"})

    def session(self) -> str:
        """Return a new session: nonce, expiry, and a signature of both."""
        claim = f"{secrets.token_hex(16)}.{int(time.time()) + SESSION_SECONDS}"
        return f"{claim}.{self._proof(claim)}"

    def holds(self, session: str) -> bool:
        """Return whether a session was made with the current token and has not expired."""
        claim, _, proof = session.rpartition(".")
        if not hmac.compare_digest(proof.encode(), self._proof(claim).encode()):
            return False
        return int(claim.partition(".")[2]) > time.time()

    def _proof(self, claim: str) -> str:
        return hmac.new(self._key, claim.encode(), hashlib.sha256).hexdigest()


class Guard:
    """Middleware that refuses requests that are not allowed, and adds security headers to every answer.

    It sets in the scope's state: `owner` (the hash of the owner's key), `owner_key` (only if it is new) and
    `signed_in`.

    Args:
        app: the application to guard.
        access: rules for which requests are let in.
        gate: checks tokens and sessions.
    """

    def __init__(self, app: ASGIApp, access: Access, gate: Gate) -> None:
        self.app, self.access, self.gate = app, access, gate

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass one connection on to the application, or refuse it."""
        if scope["type"] == "websocket":
            await WebSocketClose()(scope, receive, send)
            return
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        scope = {**scope, "state": {**scope.get("state", {})}}
        body = _Body(scope, receive, self.access.max_upload)
        answer = _Answer(send, _headers_of(scope["path"]), body, scope["method"] == "HEAD")
        try:
            self._let_in(scope, answer)
            # HEAD is answered as GET without the body.
            if answer.head_only:
                await self.app({**scope, "method": "GET"}, answer.receive, answer.send)
            else:
                await self.app(scope, await body.checked(), answer.send)
        except Problem as problem:
            if answer.begun.is_set():
                raise
            await problem_response(problem)(scope, receive, answer.send)
        except Exception:
            mistake = internal()
            LOG.exception("reference %s: %s %r", mistake.evidence["reference"], scope["method"], scope["path"])
            if answer.begun.is_set():
                raise
            await problem_response(mistake)(scope, receive, answer.send)

    def _let_in(self, scope: Scope, answer: _Answer) -> None:
        """Check a request's host, origin and token, and identify its owner.

        Raises:
            Problem: the request is not let in.
        """
        headers = Headers(scope=scope)
        _check_host(headers, scope, self.access.hosts)
        if scope["method"] not in SAFE_METHODS:
            _check_origin(headers)
        cookies = HTTPConnection(scope).cookies
        signed_in = self._signed_in(headers, cookies, scope)
        scope["state"]["signed_in"] = signed_in
        path = scope["path"]
        if not signed_in and path not in self.access.open_paths and not path.startswith(PROBLEMS):
            detail = "this server wants its token: send Authorization: Bearer TOKEN, or sign in on the page"
            raise Problem("token-required", detail, {"WWW-Authenticate": "Bearer"})
        key, new = _owner_key(headers, cookies)
        scope["state"]["owner"] = hashlib.sha256(key.encode()).hexdigest()
        if new:
            scope["state"]["owner_key"] = key
        # The page's first request is for its session, so the cookie is set there. It must not be set with the page
        # itself: a page opened from another site's link is requested without the strict cookies, and a new cookie
        # would then replace the old one.
        if new and path == SESSION:
            answer.cookie = cookie(OWNER_COOKIE, key, OWNER_SECONDS, self.access.secure)

    def _signed_in(self, headers: Headers, cookies: Mapping[str, str], scope: Scope) -> bool:
        if not self.gate.closed:
            return True
        scheme, _, token = headers.get("authorization", "").partition(" ")
        if scheme.lower() == "bearer":
            self.gate.check(token.strip(), client_address(scope))
            return True
        return self.gate.holds(cookies.get(SESSION_COOKIE, ""))


class _Body:
    """A request's body and the limits on it.

    Args:
        scope: of the request.
        receive: from the client.
        max_upload: largest size of a body with files, in bytes.
    """

    def __init__(self, scope: Scope, receive: Receive, max_upload: int) -> None:
        headers = Headers(scope=scope)
        media_type = headers.get("content-type", "").partition(";")[0].strip().lower()
        length = headers.get("content-length", "")
        self._receive = receive
        rows = scope["path"] in ROWS
        self._json = not rows and (media_type == "application/json" or media_type.endswith("+json"))
        self._limit = MAX_ROWS_BYTES if rows else max_upload if media_type == FORM else MAX_BODY_BYTES
        self._length = int(length) if length.isdecimal() else 0
        self._count = 0
        self._more = self._length > 0 or "transfer-encoding" in headers
        # Such a client sends nothing until the server answers 100 Continue.
        self._waits = headers.get("expect", "").lower() == "100-continue"

    async def checked(self) -> Receive:
        """Check the announced length and, for JSON, the depth; return where to receive the body from.

        Raises:
            Problem: the body is too large, or its JSON is too deep.
        """
        if self._length > self._limit:
            raise self._too_large()
        if not self._json:
            return self.receive
        chunks = []
        while self._more:
            chunks.append((await self.receive()).get("body", b""))
        body = b"".join(chunks)
        if json_depth(body) > MAX_JSON_DEPTH:
            raise Problem("invalid-request", f"the JSON is more than {MAX_JSON_DEPTH} levels deep")
        return _again(body, self._receive)

    async def receive(self) -> Message:
        """Return the next message.

        Raises:
            Problem: the body exceeds its limit.
        """
        message = await self._next()
        if self._count > self._limit:
            raise self._too_large()
        return message

    async def drain(self) -> None:
        """Read and discard the rest of the body, because a client that is cut off while sending never reads the answer.

        Stop after as many bytes as the limit allows, or after `DRAIN_SECONDS`.
        """
        most = self._count + self._limit
        with suppress(TimeoutError):
            async with asyncio.timeout(DRAIN_SECONDS):
                while self._more and self._count < most and not (self._waits and not self._count):
                    await self._next()

    async def _next(self) -> Message:
        message = await self._receive()
        self._count += len(message.get("body", b""))
        self._more = message.get("more_body", False)
        return message

    def _too_large(self) -> Problem:
        detail = f"the request has more than {self._limit / 1e6:g} MB, the limit"
        return Problem("upload-too-large", detail, limit_bytes=self._limit)


class _Answer:
    """Sender of one answer: it adds headers, and drops the body of an answer to HEAD.

    Args:
        send: to the client.
        headers: added where the answer does not set them itself.
        body: of the request.
        head_only: send no body.
    """

    def __init__(self, send: Send, headers: Mapping[str, str], body: _Body, head_only: bool) -> None:
        self._send, self._headers, self._body = send, headers, body
        self.head_only = head_only
        self.begun = asyncio.Event()
        self.cookie = ""
        self._asked = False

    async def send(self, message: Message) -> None:
        """Send a message of the answer."""
        if message["type"] == "http.response.start":
            await self._body.drain()
            headers = MutableHeaders(scope=message)
            for name, value in self._headers.items():
                headers.setdefault(name, value)
            if self.cookie:
                headers.append("Set-Cookie", self.cookie)
            await self._send(message)
            if self.head_only:
                await self._send({"type": "http.response.body", "body": b"", "more_body": False})
            self.begun.set()
        elif not self.head_only:
            await self._send(message)

    async def receive(self) -> Message:
        """Return an empty request body, then a disconnect as soon as the headers have been sent."""
        if not self._asked:
            self._asked = True
            return {"type": "http.request", "body": b"", "more_body": False}
        await self.begun.wait()
        return {"type": "http.disconnect"}


def problem_response(problem: Problem) -> Response:
    """Return a problem as a response."""
    return JSONResponse(problem.body(), problem.status, problem.headers, media_type=MEDIA_TYPE)


def cookie(name: str, value: str, seconds: int, secure: bool) -> str:
    """Return a Set-Cookie value that scripts cannot read and other sites cannot use; 0 seconds delete the cookie."""
    return f"{name}={value}; Max-Age={seconds}; Path=/; HttpOnly; SameSite=Strict" + ("; Secure" if secure else "")


def client_address(scope: Scope) -> str:
    """Return the client's address, by which wrong tokens are counted."""
    client = scope.get("client")
    return str(client[0]) if client else "a local socket"


def json_depth(body: bytes) -> int:
    """Return the nesting depth of a JSON text; for invalid JSON, at least the depth that a parser would reach."""
    brackets = np.frombuffer(JSON_STRING.sub(b"", body).translate(None, NO_BRACKETS), dtype=np.uint8)
    # Of the brackets [ ] { } only the opening ones have this bit.
    steps = (brackets & 2).astype(np.int8) - np.int8(1)
    return int(np.max(np.cumsum(steps, dtype=np.int32), initial=0))


def _headers_of(path: str) -> dict[str, str]:
    """Return the security headers for the answers of a path."""
    if path == DOCS:
        return {**COMMON, "Content-Security-Policy": DOCS_POLICY, "Cache-Control": "no-cache"}
    if not path.startswith(API):
        return {**COMMON, "Content-Security-Policy": PAGE_POLICY, "Cache-Control": "no-cache"}
    policy = REPORT_POLICY if path.endswith("/report.html") else DATA_POLICY
    return {**COMMON, "Content-Security-Policy": policy, "Cache-Control": "no-store"}


def _check_host(headers: Headers, scope: Scope, hosts: frozenset[str]) -> None:
    """Refuse an unknown host name, which an attacker may have pointed at this server (DNS rebinding)."""
    host = headers.get("host", "")
    match = HOST.fullmatch(host.lower())
    if match and (match[1] or match[2]) in {*hosts, _own_address(scope)}:
        return
    raise Problem("host-not-allowed", f"this server does not go by {host[:100]!r}; --allow-host adds a name to it")


def _own_address(scope: Scope) -> str | None:
    """Return the IP address at which the client reached the server, or None."""
    server = scope.get("server")
    try:
        return str(ipaddress.ip_address(server[0])) if server else None
    except ValueError:
        return None


def _check_origin(headers: Headers) -> None:
    """Refuse a request from another site's page; programs other than browsers send no origin."""
    site = headers.get("sec-fetch-site", "none")
    if site not in ("none", "same-origin"):
        raise Problem("foreign-origin", f"a page of another site asked for this (Sec-Fetch-Site: {site[:100]})")
    origin = headers.get("origin")
    if origin is None:
        return
    scheme, _, place = origin.partition("://")
    if scheme not in ("http", "https") or place.lower() != headers.get("host", "").lower():
        raise Problem("foreign-origin", f"a page of {origin[:100]} asked for this; only this server's own page may")


def _owner_key(headers: Headers, cookies: Mapping[str, str]) -> tuple[str, bool]:
    """Return the owner's key, and whether it is new.

    Raises:
        Problem: the header is not a key.
    """
    sent = headers.get(OWNER_HEADER)
    if sent is not None and not OWNER_KEY.fullmatch(sent):
        raise Problem("invalid-request", f"{OWNER_HEADER} has to be the owner_key of an earlier answer, 32 hex digits")
    key = sent or cookies.get(OWNER_COOKIE, "")
    return (key, False) if OWNER_KEY.fullmatch(key) else (secrets.token_hex(16), True)


def _again(body: bytes, receive: Receive) -> Receive:
    """Return a `receive` that replays a body that was already read, then continues with the original one."""
    messages: list[dict[str, Any]] = [{"type": "http.request", "body": body, "more_body": False}]

    async def again() -> Message:
        return messages.pop() if messages else await receive()

    return again
