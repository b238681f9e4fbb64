"""File locks of the system, which releases one however its owner ends."""

from __future__ import annotations

import os
from typing import IO

try:
    import fcntl
except ImportError:  # Windows, browsers
    fcntl = None  # type: ignore[assignment]

BEYOND = 1 << 62
"""A byte that is never read: on Windows no other process can read locked bytes."""


def lock(stream: IO[bytes]) -> None:
    """Lock an open file for this process until it is closed, as far as the system has locks; OSError where it cannot.

    >>> from tempfile import TemporaryFile
    >>> with TemporaryFile() as stream:
    ...     lock(stream)
    """
    if fcntl:
        fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
    elif os.name == "nt":
        import msvcrt

        stream.seek(BEYOND)
        msvcrt.locking(stream.fileno(), msvcrt.LK_NBLCK, 1)  # type: ignore[attr-defined]
