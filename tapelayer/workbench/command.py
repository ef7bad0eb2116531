"""The command `serve`, in a module that imports neither the library nor the other commands, so that it starts fast."""

from __future__ import annotations

import ipaddress
import os
import string
import sys
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated

import typer

from tapelayer.command_help import Command
from tapelayer.dispatch import run
from tapelayer.errors import ServeRefused
from tapelayer.sentences import said

EPILOG = (
    "Example: [bold]tapelayer serve --host 0.0.0.0 --token-file token --tls-cert cell.pem --tls-key cell.key[/bold]"
)
EXTRA = ("defusedxml", "fast_simplification", "fastapi", "h11", "python_multipart", "uvicorn")
TOKEN_LENGTH = 16
TOKEN_CHARACTERS = frozenset(string.ascii_letters + string.digits + "-._~+/=")
OTHERS_MAY = 0o077


def serve(
    host: Annotated[
        str,
        typer.Option(
            "--host", metavar="ADDRESS", help="Address to listen on; other than this machine's own wants a token."
        ),
    ] = "127.0.0.1",
    port: Annotated[int, typer.Option("--port", min=0, max=65535, help="Port; 0 takes any free one.")] = 8765,
    work_dir: Annotated[
        str | None, typer.Option("--work-dir", metavar="FOLDER", help="Where jobs are kept; default in your home.")
    ] = None,
    no_open: Annotated[bool, typer.Option("--no-open", help="Open no browser.")] = False,
    token_file: Annotated[
        str | None, typer.Option("--token-file", metavar="FILE", help="File with the token that clients must know.")
    ] = None,
    workers: Annotated[
        int | None, typer.Option("--workers", min=1, help="Jobs at a time; default one less than there are cores.")
    ] = None,
    max_upload_mb: Annotated[int, typer.Option("--max-upload-mb", min=1, help="Largest upload, MB.")] = 200,
    keep_days: Annotated[int, typer.Option("--keep-days", min=1, help="Ended jobs are kept for so long.")] = 30,
    tls_cert: Annotated[
        str | None, typer.Option("--tls-cert", metavar="CERT.pem", help="Certificate, to serve by TLS.")
    ] = None,
    tls_key: Annotated[str | None, typer.Option("--tls-key", metavar="KEY.pem", help="The certificate's key.")] = None,
    allow_host: Annotated[
        list[str] | None, typer.Option("--allow-host", metavar="NAME", help="A name that the server goes by.")
    ] = None,
    insecure: Annotated[bool, typer.Option("--insecure", help="Let other machines in without a token.")] = False,
) -> None:
    """Serve the workbench: the page and the HTTP API, on this machine only unless told otherwise."""
    missing = [name for name in EXTRA if find_spec(name) is None]
    if missing:
        raise ServeRefused(f"the workbench needs {', '.join(missing)}: pip install 'tapelayer[workbench]'")
    if bool(tls_cert) != bool(tls_key):
        raise ServeRefused("--tls-cert and --tls-key belong together: give both or neither")
    token = _token(Path(token_file)) if token_file else None
    _check_reach(host, token is not None, tls_cert is not None, insecure)
    # These need the extra, and are slow to import.
    from tapelayer.workbench import server
    from tapelayer.workbench.foreman import Limits

    limits = Limits(workers=workers, keep_days=keep_days) if workers else Limits(keep_days=keep_days)
    settings = server.Settings(
        work=Path(work_dir) if work_dir else _data_folder(),
        limits=limits,
        host=host,
        allowed_hosts=tuple(allow_host or ()),
        token=token,
        max_upload_mb=max_upload_mb,
        certificate=(Path(tls_cert), Path(tls_key)) if tls_cert and tls_key else None,
    )
    server.serve(settings, port, open_page=sys.stdout.isatty() and not no_open)


def _token(file: Path) -> str:
    """Return the token in a file.

    Raises:
        ServeRefused: the file cannot be read, or is not one line of enough allowed characters.
    """
    try:
        text = file.read_text(encoding="ascii")
        mode = file.stat().st_mode
    except OSError as error:
        raise ServeRefused(f"{file}: cannot be read: {(error.strerror or str(error)).lower()}") from None
    except UnicodeDecodeError:
        text, mode = "", 0
    token = text.strip("\r\n")
    if len(token) < TOKEN_LENGTH or not TOKEN_CHARACTERS.issuperset(token):
        raise ServeRefused(
            f"{file}: a token is one line of at least {TOKEN_LENGTH} letters, digits or -._~+/=; "
            "make one with: openssl rand -hex 32"
        )
    if mode & OTHERS_MAY:
        sys.stderr.write(said(f"{file}: other users of this machine may read the token; chmod 600 it") + "\n")
    return token


def _check_reach(host: str, token: bool, tls: bool, insecure: bool) -> None:
    """Refuse to serve other machines without a token; warn on stderr of what is not safe.

    Raises:
        ServeRefused: other machines would get in without a token.
    """
    if _is_own(host):
        return
    if not token and not insecure:
        raise ServeRefused(
            f"--host {host} lets other machines in: give a --token-file, or --insecure if all of them are trusted"
        )
    if not token:
        sys.stderr.write(said(f"insecure: whoever reaches {host} may use this server") + "\n")
    if not tls:
        sys.stderr.write(said("without --tls-cert, programs and tokens can be read and changed on their way") + "\n")


def _is_own(host: str) -> bool:
    """Return whether an address can be reached from this machine only."""
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


def _data_folder() -> Path:
    """Return the folder for a user's data (XDG Base Directory Specification)."""
    home = os.environ.get("XDG_DATA_HOME") or Path.home() / ".local" / "share"
    return Path(home) / "tapelayer"


def main() -> None:
    """Run only this command."""
    app = typer.Typer(add_completion=False, pretty_exceptions_enable=False, rich_markup_mode="rich")
    app.command(epilog=EPILOG, cls=Command)(serve)
    run(app, sys.argv[2:], "tapelayer serve")
