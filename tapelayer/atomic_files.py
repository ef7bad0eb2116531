"""Atomic files: output that appears whole or not at all."""

from __future__ import annotations

import errno
import os
import tempfile
import unicodedata
from collections.abc import Mapping, Sequence
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
                target = _followed(name)
                if _is_device(target):
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


def check_names(inputs: Sequence[str], outputs: Sequence[str]) -> None:
    """Refuse outputs that would replace an input or each other, links and folded case included.

    Devices and pipes may be named more than once.

    Args:
        inputs: files that are read, as the user named them.
        outputs: files that are to be written, as the user named them.

    Raises:
        TargetNotWritable: an output is an input, or two outputs are one file.

    Examples:
        >>> check_names(["panel.txt"], ["panel.nc", "./panel.nc"])
        Traceback (most recent call last):
            ...
        tapelayer.errors.TargetNotWritable: ./panel.nc: is the same file as the output panel.nc; name another
    """
    taken = {key: (name, "input") for name in inputs if (key := _identity(Path(name)))}
    for output in outputs:
        key = _identity(Path(output))
        if key in taken:
            other, what = taken[key]
            raise TargetNotWritable(f"{output}: is the same file as the {what} {other}; name another")
        if key:
            taken[key] = (output, "output")


def _identity(name: Path) -> tuple[int, int] | str:
    """Return what names of one file share, were it written; empty for a device or a pipe."""
    if _is_device(name):
        return ""
    with suppress(OSError):
        found = os.stat(name)
        return found.st_dev, found.st_ino
    return _folded(name)


def _folded(name: Path) -> str:
    """Return an absolute name without links, as a file system that folds case and accents would compare it."""
    return unicodedata.normalize("NFC", os.path.realpath(name)).casefold()


def _is_device(name: Path) -> bool:
    return name.exists() and not name.is_file() and not name.is_dir()


def _followed(name: Path) -> Path:
    """Return a name without links.

    Raises:
        OSError: the links lead in a circle, or the file cannot be asked after.
    """
    with suppress(FileNotFoundError):
        os.stat(name)
    return Path(os.path.realpath(name))


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
