"""File locks: one process at a time, and the system releases the lock however its owner ends."""

from __future__ import annotations

import errno
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import IO

from modal.errors import SceneError
from modal.scene.contents import lock

TAKEN = {errno.EAGAIN, errno.EACCES, errno.EDEADLK}


@contextmanager
def locked(name: str) -> Iterator[IO[bytes]]:
    """A file to read and append to, created if missing; SceneError where another process holds it.

    On a file system without locks it is opened without one.
    """
    while True:
        with open(name, "ab+") as stream:
            try:
                lock(stream)
            except OSError as error:
                if error.errno in TAKEN:
                    raise SceneError([f"{name}: another process is writing it"]) from None
            if _stands(stream, name):
                stream.seek(0)
                yield stream
                return


def _stands(stream: IO[bytes], name: str) -> bool:
    """Whether it is still the file of this name: its owner may have removed it just before releasing the lock."""
    try:
        return os.path.samestat(os.fstat(stream.fileno()), os.stat(name))
    except FileNotFoundError:
        return False


def remove(stream: IO[bytes], name: str) -> None:
    """Remove a file given by `locked`, while it is still locked; Windows removes none that another process has open."""
    stream.truncate(0)
    if os.name == "nt":
        stream.close()
    with suppress(FileNotFoundError, PermissionError):
        os.unlink(name)
