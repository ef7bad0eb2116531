"""Server: the application with the page, the API and its documentation, and the loop that serves it.

The library takes a second to import. Requests of the page's first view are answered at once; all others wait for it.
"""

from __future__ import annotations

import asyncio
import html
import logging
import os
import signal
import socket
import ssl
import sys
import threading
import webbrowser
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass
from importlib import import_module
from importlib.metadata import version
from pathlib import Path
from types import FrameType
from typing import Annotated

import uvicorn
from fastapi import APIRouter, FastAPI, Request, Response
from fastapi.exceptions import RequestValidationError
from fastapi.responses import HTMLResponse
from pydantic import BaseModel, Field
from rich.console import Console
from starlette.exceptions import HTTPException
from starlette.requests import ClientDisconnect
from starlette.staticfiles import StaticFiles
from starlette.types import ASGIApp, Receive, Scope, Send

from tapelayer.errors import ServeRefused, TapelayerError
from tapelayer.sentences import said
from tapelayer.workbench.access import (
    DOCS,
    LOOPBACK,
    PROBLEMS,
    SESSION,
    SESSION_COOKIE,
    SESSION_SECONDS,
    Access,
    Gate,
    Guard,
    client_address,
    cookie,
    problem_response,
)
from tapelayer.workbench.connections import Connection
from tapelayer.workbench.foreman import Foreman, Limits
from tapelayer.workbench.problems import CODES, EVERYWHERE, Problem, not_valid, problem_of, responses
from tapelayer.workbench.store import Store

STATIC = Path(__file__).parent / "static"
HEALTH = "/healthz"
EVERY_ADDRESS = ("0.0.0.0", "::")
# Each of these modules has a `router`; importing them imports the library.
ROOMS = ("api", "results", "catalogue", "kinematics", "moulds")
# After SIGTERM, answers under way may take GRACE_SECONDS; after END_SECONDS the process exits in any case.
GRACE_SECONDS = 2
END_SECONDS = 4.5

DOCS_PAGE = """<!doctype html>
<html lang="en">
  <head>
    <meta charset="utf-8">
    <title>tapelayer API</title>
    <link rel="icon" href="/icon.svg" type="image/svg+xml">
    <link rel="stylesheet" href="/swagger/swagger-ui.css">
    <script src="/swagger/swagger-ui-bundle.js"></script>
    <script src="/swagger/docs.js"></script>
  </head>
  <body>
    <div id="swagger-ui"></div>
  </body>
</html>
"""
PROBLEM_PAGE = """<!doctype html>
<html lang="en">
  <head><meta charset="utf-8"><title>{title}</title></head>
  <body>
    <h1>{title}</h1>
    <p>{meaning}</p>
    <p>Code <code>{code}</code>, status {status}.</p>
  </body>
</html>
"""


@dataclass(frozen=True)
class Settings:
    """Settings of the server.

    Attributes:
        work: the work directory.
        limits: on jobs.
        host: address to listen on.
        allowed_hosts: further host names of the server.
        token: secret that clients must send; None lets everybody in who can reach the server.
        max_upload_mb: largest size of a request with files.
        certificate: files of the TLS certificate and its key; None for plain HTTP.
    """

    work: Path
    limits: Limits
    host: str = "127.0.0.1"
    allowed_hosts: tuple[str, ...] = ()
    token: str | None = None
    max_upload_mb: int = 200
    certificate: tuple[Path, Path] | None = None

    def access(self) -> Access:
        """Return the rules for which requests are let in."""
        names = {self.host, *self.allowed_hosts} - set(EVERY_ADDRESS)
        files = {f"/{path.relative_to(STATIC).as_posix()}" for path in STATIC.rglob("*") if path.is_file()}
        return Access(
            hosts=LOOPBACK | {name.lower() for name in names},
            open_paths=frozenset({"/", HEALTH, SESSION} | files),
            secure=self.certificate is not None,
            max_upload=self.max_upload_mb * 10**6,
        )


class Health(BaseModel):
    """That the server answers."""

    status: str
    version: str


class Session(BaseModel):
    """Whether whoever asks may use the API."""

    token_required: bool
    signed_in: bool
    version: str


class SignIn(BaseModel):
    """A token."""

    token: Annotated[str, Field(max_length=1000)]


class Loading:
    """Middleware that delays requests until the modules that answer them are imported.

    Args:
        app: the application whose requests are delayed.
        light: paths that need no import.
    """

    def __init__(self, app: ASGIApp, light: frozenset[str]) -> None:
        self.app, self.light = app, light

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass one connection on once it can be answered."""
        path = scope.get("path", "/")
        if path not in self.light and not path.startswith(PROBLEMS):
            # A client that disconnects must not cancel the import for everybody.
            await asyncio.shield(scope["app"].state.loading)
        await self.app(scope, receive, send)


def create_app(settings: Settings) -> FastAPI:
    """Create the application, which locks the work directory until its lifespan ends.

    Raises:
        WorkDirectoryRefused: the directory cannot be used, or another server uses it.
    """
    store = Store(settings.work)
    foreman = Foreman(store, settings.limits)
    gate = Gate(settings.token)
    access = settings.access()

    @asynccontextmanager
    async def lifespan(app: FastAPI) -> AsyncIterator[None]:
        try:
            await foreman.start()
            app.state.loading = asyncio.create_task(_load(app))
            yield
            await asyncio.wait([app.state.loading])
        finally:
            await foreman.stop()
            store.close()

    app = FastAPI(
        title="tapelayer",
        version=version("tapelayer"),
        description="Courses and models in, verified NC programs out.",
        docs_url=None,
        redoc_url=None,
        redirect_slashes=False,
        lifespan=lifespan,
    )
    app.state.store, app.state.foreman, app.state.gate, app.state.secure = store, foreman, gate, access.secure
    app.add_middleware(Loading, light=access.open_paths)
    app.add_middleware(Guard, access=access, gate=gate)
    answer_problems(app)
    app.include_router(_front())
    app.add_api_route(DOCS, docs, include_in_schema=False)
    app.add_api_route(PROBLEMS + "{code}", meaning, include_in_schema=False)
    app.router.default = StaticFiles(directory=STATIC, html=True)
    return app


def _front() -> APIRouter:
    """Return the routes that do not need the library."""
    router = APIRouter(responses=responses(*EVERYWHERE))
    router.add_api_route(HEALTH, health, tags=["server"])
    router.add_api_route(SESSION, session, tags=["session"])
    unsafe = responses("foreign-origin", "upload-too-large")
    router.add_api_route(SESSION, sign_in, methods=["POST"], status_code=204, responses=unsafe, tags=["session"])
    router.add_api_route(SESSION, sign_out, methods=["DELETE"], status_code=204, responses=unsafe, tags=["session"])
    return router


def answer_problems(app: FastAPI) -> None:
    """Make an application answer refusals, its own and the framework's, as problem details."""
    app.add_exception_handler(Problem, _problem)
    app.add_exception_handler(TapelayerError, _refused)
    app.add_exception_handler(RequestValidationError, _invalid)
    app.add_exception_handler(HTTPException, _http)
    app.add_exception_handler(ClientDisconnect, _gone)


async def health() -> Health:
    """Whether the server answers."""
    return Health(status="ok", version=version("tapelayer"))


async def session(request: Request) -> Session:
    """Whether a token is required, and whether whoever asks is signed in."""
    required: bool = request.app.state.gate.closed
    return Session(token_required=required, signed_in=request.state.signed_in, version=version("tapelayer"))


async def sign_in(request: Request, body: SignIn) -> Response:
    """Make a session with the token; its cookie signs the page in for 12 hours."""
    gate: Gate = request.app.state.gate
    if not gate.closed:
        return Response(status_code=204)
    gate.check(body.token, client_address(request.scope))
    made = cookie(SESSION_COOKIE, gate.session(), SESSION_SECONDS, request.app.state.secure)
    return Response(status_code=204, headers={"Set-Cookie": made})


async def sign_out(request: Request) -> Response:
    """Take the session's cookie away."""
    gone = cookie(SESSION_COOKIE, "", 0, request.app.state.secure)
    return Response(status_code=204, headers={"Set-Cookie": gone})


async def docs() -> HTMLResponse:
    """Show the API's description as a page."""
    return HTMLResponse(DOCS_PAGE)


async def meaning(code: str) -> HTMLResponse:
    """Show the meaning of a problem's code as a page."""
    if code not in CODES:
        raise Problem("not-found", f"{code[:100]!r} is not the code of a problem")
    kind = CODES[code]
    facts = {"title": kind.title, "meaning": kind.meaning, "code": code, "status": str(kind.status)}
    return HTMLResponse(PROBLEM_PAGE.format(**{name: html.escape(text) for name, text in facts.items()}))


def serve(settings: Settings, port: int, open_page: bool) -> None:
    """Serve until a signal arrives.

    Args:
        settings: of the server.
        port: 0 for any free one.
        open_page: open the page in a browser.

    Raises:
        TapelayerError: the server cannot start with these settings.
    """
    logging.basicConfig(level=logging.WARNING, format="%(asctime)s %(levelname)s %(name)s: %(message)s")
    if settings.certificate:
        _check_certificate(*settings.certificate)
    listening = _listening(settings.host, port)
    # uvicorn re-raises the signal after its shutdown.
    signal.signal(signal.SIGTERM, lambda number, frame: sys.exit(0))
    try:
        app = create_app(settings)
        config = configuration(app, settings.certificate)
        server = _Server(config, app.state.foreman, _address(settings, listening), open_page)
        server.run([listening])
    except KeyboardInterrupt:
        sys.exit(0)
    finally:
        listening.close()


def configuration(app: FastAPI, certificate: tuple[Path, Path] | None) -> uvicorn.Config:
    """Return uvicorn's configuration to serve the application, by TLS where there is a certificate."""
    file, key = certificate or (None, None)
    return uvicorn.Config(
        app,
        http=Connection,
        ssl_certfile=file,
        ssl_keyfile=key,
        ws="none",
        log_config=None,
        access_log=False,
        server_header=False,
        proxy_headers=False,
        timeout_graceful_shutdown=GRACE_SECONDS,
    )


class _Server(uvicorn.Server):
    """uvicorn with a prompt shutdown, even while event streams are open.

    Args:
        config: of uvicorn.
        foreman: ends the streams when it stops.
        address: of the page.
        open_page: open the page in a browser.
    """

    def __init__(self, config: uvicorn.Config, foreman: Foreman, address: str, open_page: bool) -> None:
        super().__init__(config)
        self._foreman, self._address, self._open_page = foreman, address, open_page

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        """Start, and print the page's address."""
        await super().startup(sockets)
        Console().print(said(f"workbench: {self._address} (Ctrl+C ends it)"), highlight=False, soft_wrap=True)
        if self._open_page:
            threading.Thread(target=webbrowser.open, args=(self._address,), daemon=True).start()

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        """Stop the jobs, then the connections that wait for them."""
        await self._foreman.stop()
        await super().shutdown(sockets)

    def handle_exit(self, sig: int, frame: FrameType | None) -> None:
        """Shut down, and force the process to exit if that takes longer than `END_SECONDS`."""
        super().handle_exit(sig, frame)
        last = threading.Timer(END_SECONDS, os._exit, (1,))
        last.daemon = True
        last.start()


async def _load(app: FastAPI) -> None:
    """Add the routes of the modules that import the library."""
    for name in ROOMS:
        module = await asyncio.to_thread(import_module, f"tapelayer.workbench.{name}")
        app.include_router(module.router)


async def _problem(request: Request, error: Exception) -> Response:
    assert isinstance(error, Problem)
    return problem_response(error)


async def _refused(request: Request, error: Exception) -> Response:
    assert isinstance(error, TapelayerError)
    return problem_response(problem_of(error))


async def _invalid(request: Request, error: Exception) -> Response:
    assert isinstance(error, RequestValidationError)
    return problem_response(not_valid(error.errors()))


async def _http(request: Request, error: Exception) -> Response:
    """Return the framework's own errors as problems."""
    assert isinstance(error, HTTPException)
    # Our problem for a body that is too large, raised while the framework reads it.
    if isinstance(error.__cause__, Problem):
        return problem_response(error.__cause__)
    request_line = f"{request.method} {request.url.path[:200]}"
    if error.status_code in (401, 404):
        return problem_response(Problem("not-found", f"there is nothing at {request.url.path[:200]}"))
    if error.status_code == 405:
        allowed = (error.headers or {}).get("Allow", "")
        detail = f"{request_line}: this address allows {allowed}"
        return problem_response(Problem("method-not-allowed", detail, {"Allow": allowed}))
    return problem_response(Problem("invalid-request", f"{request_line}: {error.detail}"))


async def _gone(request: Request, error: Exception) -> Response:
    return problem_response(Problem("invalid-request", "the body ended before its announced end"))


def _listening(host: str, port: int) -> socket.socket:
    """Return a listening socket.

    Raises:
        ServeRefused: the address or the port is not available.
    """
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    try:
        return socket.create_server((host, port), family=family)
    except OSError as error:
        # The system's message without the address that Python appends.
        reason = str(error.strerror or error).partition(" (while")[0]
        advice = "stop what uses it, or choose another with --port; 0 takes any free one"
        raise ServeRefused(f"cannot listen on port {port} of {host}: {reason.lower()}; {advice}") from None


def _check_certificate(certificate: Path, key: Path) -> None:
    """Refuse a certificate and key that TLS cannot use.

    Raises:
        ServeRefused: they are missing, wrong, do not belong together, or need a passphrase.
    """
    try:
        ssl.create_default_context(ssl.Purpose.CLIENT_AUTH).load_cert_chain(certificate, key, lambda: "")
    except OSError as error:
        reason = (error.strerror or str(error)).lower()
        wanted = "both have to be PEM files, the key without a passphrase and the certificate's own"
        raise ServeRefused(f"TLS cannot use {certificate} with {key}: {reason}; {wanted}") from None


def _address(settings: Settings, listening: socket.socket) -> str:
    """Return the page's address for a browser on this machine."""
    host = "localhost" if settings.host in EVERY_ADDRESS else settings.host
    scheme = "https" if settings.certificate else "http"
    return f"{scheme}://{f'[{host}]' if ':' in host else host}:{listening.getsockname()[1]}/"
