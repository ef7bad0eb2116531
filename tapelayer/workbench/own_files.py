"""Own files: a job's files, opened so that nothing planted in its folder leads elsewhere."""

from __future__ import annotations

import errno
import os
import stat
from io import BufferedReader
from pathlib import Path

from tapelayer.workbench.problems import Problem

# What opening a file answers where there is none, or a link, a folder or a device in its place.
NO_FILE = (errno.ENOENT, errno.ENOTDIR, errno.ELOOP, errno.ENXIO, errno.EISDIR)


def open_own(jobs: Path, job: str, *place: str) -> BufferedReader:
    """Open a file of a job for reading.

    Args:
        jobs: folder of all jobs.
        job: id of the job, which is the name of its folder.
        place: names of the folders below the job's, and of the file.

    Raises:
        Problem: there is no such file, it or a folder on the way is a link, or it has a second name.
    """
    *folders, name = (job, *place)
    absent = Problem("not-found", f"this job has no file {'/'.join(place)} of its own")
    handle = os.open(jobs, os.O_PATH | os.O_DIRECTORY)
    try:
        for folder in folders:
            above, handle = handle, os.open(folder, os.O_PATH | os.O_DIRECTORY | os.O_NOFOLLOW, dir_fd=handle)
            os.close(above)
        # A pipe would keep whoever opens it waiting.
        file = os.open(name, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK, dir_fd=handle)
    except OSError as error:
        if error.errno in NO_FILE:
            raise absent from None
        raise
    finally:
        os.close(handle)
    about = os.fstat(file)
    if stat.S_ISREG(about.st_mode) and about.st_nlink == 1:
        return os.fdopen(file, "rb")
    os.close(file)
    raise absent
