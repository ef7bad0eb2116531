"""Output: files that appear whole or not at all."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Mapping
from contextlib import ExitStack, suppress
from pathlib import Path

from tapelayer.errors import TargetNotWritable


def write_files(contents: Mapping[Path, bytes]) -> None:
    """Write files together: each to a temporary file beside its target, and all renamed once every one is written.

    Args:
        contents: bytes by target.

    Raises:
        TargetNotWritable: a target cannot be written; whatever stood at any of the targets is untouched.
    """
    with ExitStack() as undo:
        written: list[tuple[Path, Path]] = []
        for target, data in contents.items():
            try:
                if target.is_dir():
                    raise IsADirectoryError(0, "Is a directory")
                handle, name = tempfile.mkstemp(prefix=f".{target.name}.", dir=target.parent)
                undo.callback(_remove, name)
                with os.fdopen(handle, "wb") as file:
                    file.write(data)
                    file.flush()
                    os.fsync(file.fileno())
                os.chmod(name, _mode(target))
            except OSError as error:
                raise _not_writable(target, error) from None
            written.append((Path(name), target))
        for temporary, target in written:
            try:
                os.replace(temporary, target)
            except OSError as error:
                raise _not_writable(target, error) from None


def _not_writable(target: Path, error: OSError) -> TargetNotWritable:
    reason = (error.strerror or str(error)).lower()
    return TargetNotWritable(f"{target}: cannot be written: {reason}; nothing was changed, choose another target")


def _mode(target: Path) -> int:
    """Permissions of the file that is replaced, or those that a new file would get."""
    with suppress(OSError):
        return target.stat().st_mode & 0o777
    mask = os.umask(0)
    os.umask(mask)
    return 0o666 & ~mask


def _remove(name: str) -> None:
    with suppress(FileNotFoundError):
        os.remove(name)
