"""The content of files that are read whole: regular files of limited size, and nothing that never ends.

A device may have no end, and a pipe may have no writer.  So a file is looked at before it is opened, is opened without
waiting, and is looked at again while it is held open; no more is read of it than the limit.
"""

from __future__ import annotations

import os
from os import PathLike
from stat import S_ISREG
from typing import IO

from modal.errors import SceneError
from modal.scene.recognition import EXPECTED, as_text, recognize

LARGEST_FILE = 256_000_000
"""Bytes of a scene, and of a file of data."""
SMALLEST_READ, LARGEST_READ = 1e-50, 1e50
"""Sizes of measured numbers whose ratios have squares in double precision."""
SIZES_READ = f"its size must be from {SMALLEST_READ:g} to {LARGEST_READ:g}, or 0"
PIECE = 1 << 20
"""Bytes that are read at once: no memory is taken for what is not there."""
NAMES = {"table": "CSV text", "report": "JSON text", "": "text"}
"""What text is called of which a file of each kind consists."""
LONGEST_HEAD = 1_000_000
"""Bytes within which a first line that is read alone must stand."""


def content_of(path: str | PathLike[str], largest: int = LARGEST_FILE) -> bytes:
    """The bytes of a regular file of at most `largest`; SceneError, without its name, for any other."""
    return _beginning(path, largest, whole=True)


def text_of(path: str | PathLike[str], expected: str = "") -> str:
    """The text of a file; SceneError as of `content_of` and `decoded`."""
    return decoded(content_of(path), expected)


def decoded(content: bytes, expected: str = "") -> str:
    """The text in bytes (`as_text`); SceneError where they are none, or a file of another kind than `expected`."""
    kind = recognize(content)
    if kind and (kind.kind not in EXPECTED[expected].kinds if expected else not kind.is_text):
        raise SceneError([kind.problem(expected)])
    try:
        return as_text(content)
    except UnicodeDecodeError as error:
        if expected == "scene":
            raise SceneError([f"byte {error.start} is not UTF-8 text: save the file as UTF-8"]) from None
        raise SceneError([f"is not a {NAMES[expected]} file: byte {error.start} is not UTF-8"]) from None


def first_line(path: str | PathLike[str]) -> str:
    """The first line of a file of data that is no comment, "" where the file cannot be read or has none so early."""
    try:
        text = as_text(_beginning(path, LONGEST_HEAD, whole=False), errors="replace")
    except SceneError:
        return ""
    return next((line for line in text.splitlines() if not line.startswith("#")), "")


def limited(stream: IO[bytes], largest: int = LARGEST_FILE) -> bytes:
    """What a stream holds; SceneError where that is more than `largest` bytes."""
    pieces, room = [], largest + 1
    while piece := stream.read(min(PIECE, room)):
        pieces.append(piece)
        room -= len(piece)
    if not room:
        raise SceneError([f"is larger than {largest} bytes"])
    return b"".join(pieces)


def _beginning(path: str | PathLike[str], largest: int, whole: bool) -> bytes:
    try:
        if not S_ISREG(os.stat(path).st_mode):
            raise SceneError(["not a file"])
        with open(path, "rb", opener=_at_once) as stream:
            status = os.fstat(stream.fileno())
            if not S_ISREG(status.st_mode):
                raise SceneError(["not a file"])
            if whole and status.st_size > largest:
                raise SceneError([f"is larger than {largest} bytes"])
            return limited(stream, largest) if whole else stream.read(largest)
    except OSError as error:
        raise SceneError([f"cannot be read: {error.strerror or error}"]) from None
    except ValueError as error:
        if isinstance(error, SceneError):
            raise
        raise SceneError([f"cannot be read: {error}"]) from None


def private(path: str, flags: int) -> int:
    """An opener of new files that their owner alone reads and writes, whatever the umask."""
    return os.open(path, flags, 0o600)


def _at_once(path: str, flags: int) -> int:
    """A descriptor, without waiting for the other end of what has become a pipe."""
    return os.open(path, flags | getattr(os, "O_NONBLOCK", 0))
