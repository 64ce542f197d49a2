"""Files and folders that are written as a whole or not at all, also where the process is killed."""

import errno
import fcntl
import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

DISK = (errno.ENOSPC, errno.EDQUOT, errno.EROFS, errno.EFBIG, errno.EIO)  # errors of a disk, not of a path


def write_at_once(target: Path, data: bytes) -> None:
    """Write a file at once: a reader sees the old one or the new one."""
    target.parent.mkdir(parents=True, exist_ok=True)
    part = target.with_name(f".{target.name}.{os.getpid()}")
    try:
        part.write_bytes(data)
        part.replace(target)
    finally:
        part.unlink(missing_ok=True)


@contextmanager
def passing_folder(place: Path, prefix: str) -> Iterator[Path]:
    """A new folder in `place` that is removed at the end, or by `remove_left` where that was not reached.

    It is locked meanwhile, for this process and those forked from it; the system lifts the lock of a process
    that is killed.
    """
    path, lock = _locked(place, prefix)
    try:
        yield path
    finally:
        shutil.rmtree(path, ignore_errors=True)
        os.close(lock)


def remove_left(place: Path, prefix: str) -> None:
    """Remove the passing folders that killed processes left."""
    for left in place.glob(f"{prefix}*"):
        with suppress(OSError):  # somebody uses it, or it is another user's
            lock = os.open(left, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
                shutil.rmtree(left, ignore_errors=True)
            finally:
                os.close(lock)


def _locked(place: Path, prefix: str) -> tuple[Path, int]:
    """A new folder and the number of its lock; another one if it was taken for a left one before that."""
    while True:
        path = Path(tempfile.mkdtemp(prefix=prefix, dir=place))
        with suppress(OSError):
            lock = os.open(path, os.O_RDONLY)
            with suppress(OSError):  # of a file system without locks: it stays where it is, as if in use
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            if path.exists():
                return path, lock
            os.close(lock)
