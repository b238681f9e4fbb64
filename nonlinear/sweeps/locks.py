"""File locks: one process at a time, and the system releases the lock however its owner ends."""

from __future__ import annotations

import errno
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import IO

from modal.errors import SceneError

try:
    import fcntl
except ImportError:  # Windows, browsers
    fcntl = None  # type: ignore[assignment]

BEYOND = 1 << 62
"""A byte that nobody reads: Windows lets no other process read those that are locked."""
TAKEN = {errno.EAGAIN, errno.EACCES, errno.EDEADLK}


def _lock(stream: IO[bytes]) -> None:
    if fcntl:
        fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
    elif os.name == "nt":
        import msvcrt

        stream.seek(BEYOND)
        msvcrt.locking(stream.fileno(), msvcrt.LK_NBLCK, 1)  # type: ignore[attr-defined]


@contextmanager
def locked(name: str) -> Iterator[IO[bytes]]:
    """A file to read and to append to, made where there is none; SceneError where another process has it.

    On a file system that knows no locks it is had without one.
    """
    while True:
        with open(name, "ab+") as stream:
            try:
                _lock(stream)
            except OSError as error:
                if error.errno in TAKEN:
                    raise SceneError([f"{name}: another process is writing it"]) from None
            if _stands(stream, name):
                stream.seek(0)
                yield stream
                return


def _stands(stream: IO[bytes], name: str) -> bool:
    """Whether it is still the file of this name: its owner may have removed it just before the lock was free."""
    try:
        return os.path.samestat(os.fstat(stream.fileno()), os.stat(name))
    except FileNotFoundError:
        return False


def remove(stream: IO[bytes], name: str) -> None:
    """A file that `locked` gave, while nobody else can have it; Windows removes none that somebody waits for."""
    stream.truncate(0)
    if os.name == "nt":
        stream.close()
    with suppress(FileNotFoundError, PermissionError):
        os.unlink(name)
