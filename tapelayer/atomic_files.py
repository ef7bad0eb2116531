"""Atomic files: output that appears whole or not at all."""

from __future__ import annotations

import errno
import os
import tempfile
from collections.abc import Mapping
from contextlib import ExitStack, suppress
from pathlib import Path

from tapelayer.errors import TargetNotWritable


def write_files(contents: Mapping[Path, bytes]) -> None:
    """Write files together, each to a temporary file beside its target, and rename them all once every one is written.

    Links are followed; devices and pipes are written to directly.

    Args:
        contents: bytes by target.

    Raises:
        TargetNotWritable: a target cannot be written; all targets are left as they were.

    Examples:
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     write_files({Path(folder, "panel.nc"): b"%", Path(folder, "panel.json"): b"{}"})
        ...     sorted(path.name for path in Path(folder).iterdir())
        ['panel.json', 'panel.nc']
    """
    with ExitStack() as undo:
        written: list[tuple[Path, Path]] = []
        devices: list[tuple[Path, bytes]] = []
        for name, data in contents.items():
            try:
                target = name.resolve()
                if target.exists() and not target.is_file() and not target.is_dir():
                    devices.append((target, data))
                    continue
                _check(target)
                handle, temporary = tempfile.mkstemp(prefix=f".{target.name}.", dir=target.parent)
                undo.callback(_remove, temporary)
                with os.fdopen(handle, "wb") as file:
                    file.write(data)
                    file.flush()
                    os.fsync(file.fileno())
                os.chmod(temporary, _mode(target))
            except OSError as error:
                raise _not_writable(name, error) from None
            written.append((Path(temporary), target))
        try:
            for target, data in devices:
                target.write_bytes(data)
            for source, target in written:
                os.replace(source, target)
        except OSError as error:
            raise _not_writable(target, error) from None


def _check(target: Path) -> None:
    """Refuse a target that a rename would replace although it is not writable."""
    if target.is_dir():
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
    if target.exists() and not (os.access(target, os.W_OK) and target.stat().st_mode & 0o222):
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))


def _not_writable(target: Path, error: OSError) -> TargetNotWritable:
    reason = (error.strerror or str(error)).lower()
    return TargetNotWritable(f"{target}: cannot be written: {reason}; nothing was changed, choose another target")


def _mode(target: Path) -> int:
    """Return the permissions of the file to be replaced, or those that a new file would get."""
    with suppress(OSError):
        return target.stat().st_mode & 0o777
    mask = os.umask(0)
    os.umask(mask)
    return 0o666 & ~mask


def _remove(name: str) -> None:
    with suppress(FileNotFoundError):
        os.remove(name)
