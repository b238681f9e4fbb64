"""The journal of a sweep: rows are appended as they are computed, so that an interrupted sweep can resume.

The first line identifies the sweep; every other line is one row in JSON with its own checksum.  An incomplete last
line, left by a crash, is dropped; any other damage is reported with its line number.  Only one sweep at a time can use
a journal.
"""

from __future__ import annotations

import errno
import json
import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from hashlib import sha256
from typing import IO

from modal.errors import SceneError
from modal.scene.contents import lock
from modal.scene.sealed import index
from nonlinear.sweeps.study import Row, Study

VERSION = 2
KNOWN = b'{"multipendula_journal"'
TAKEN = {errno.EAGAIN, errno.EACCES, errno.EDEADLK}
"""Errors by which a system says that another process has locked a file."""


class Checkpoint:
    """The rows already in a journal, and the file to which new ones are appended; without a file none are kept."""

    def __init__(self, stream: IO[bytes] | None = None, rows: Sequence[Row] = (), salt: str = "") -> None:
        self._stream, self.rows, self._salt = stream, tuple(rows), salt
        self.finished = False

    def add(self, rows: Sequence[Row]) -> None:
        """Append some rows, safe from a crash once this returns."""
        if self._stream is not None:
            self._stream.write(b"".join(_line(row, self._salt) for row in rows))
            self._stream.flush()
            os.fsync(self._stream.fileno())

    def finish(self) -> None:
        """The sweep has been saved: its journal is removed when it is closed."""
        self.finished = True


@contextmanager
def open_checkpoint(path: str | os.PathLike[str], study: Study, *, fresh: bool = False) -> Iterator[Checkpoint]:
    """The journal at a path, new or resumed; `fresh` restarts it, whatever sweep it belongs to.

    Rows of points that failed are dropped, so that these are tried again.  Raises SceneError where the file is not a
    journal, is damaged, belongs to another sweep or to one that is running, OSError where it cannot be written.
    """
    name, salt = os.fspath(path), study.fingerprint
    first = json.dumps({"multipendula_journal": VERSION, "sweep": salt}).encode() + b"\n"
    with _named(name), locked(name) as stream:
        content = stream.read()
        if fresh and content.startswith(KNOWN):
            content = b""
        whole = content[: content.rfind(b"\n") + 1]
        if not whole and not first.startswith(content):
            raise SceneError([f"{name}: is not the journal of a sweep"])
        rows = _rows(name, whole, first, study) if whole else {}
        stream.truncate(len(whole))
        if not whole:
            stream.write(first)
        kept = Checkpoint(stream, [row for row in rows.values() if not row.reason], salt)
        try:
            yield kept
        finally:
            if kept.finished:
                _remove(stream, name)


@contextmanager
def locked(name: str) -> Iterator[IO[bytes]]:
    """A file to read and append to, created if missing; SceneError where another process holds it.

    The system releases it however its owner ends.  On a file system without locks it is opened without one.
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


def _remove(stream: IO[bytes], name: str) -> None:
    """Remove a file while it is still locked; Windows removes none that another process has open."""
    stream.truncate(0)
    if os.name == "nt":
        stream.close()
    with suppress(FileNotFoundError, PermissionError):
        os.unlink(name)


@contextmanager
def _named(name: str) -> Iterator[None]:
    """Adds the file name to the error of a write that fails, which a full disk does not name."""
    try:
        yield
    except OSError as error:
        error.filename = error.filename or name
        raise


def _rows(name: str, content: bytes, first: bytes, study: Study) -> dict[int, Row]:
    head, *lines = content.removesuffix(b"\n").split(b"\n")
    if head + b"\n" != first:
        known = head.startswith(KNOWN)
        words = (
            "belongs to another sweep: remove it, or write to another file"
            if known
            else "is not the journal of a sweep"
        )
        raise SceneError([f"{name}: {words}"])
    rows = {}
    for number, line in enumerate(lines, 2):
        try:
            row = _row(line, study)
        except (ValueError, TypeError, AttributeError, RecursionError):
            words = "is damaged: remove it, and its point is computed again"
            raise SceneError([f"{name}: line {number} {words}"]) from None
        rows[row.index] = row
    return rows


def _line(row: Row, salt: str) -> bytes:
    """[index, numbers, reason, checksum] in JSON; the checksum covers the preceding fields and the sweep."""
    text = json.dumps([row.index, row.numbers, row.reason])[:-1]
    return f'{text}, "{_checksum(text, salt)}"]\n'.encode()


def _checksum(text: str, salt: str) -> str:
    return sha256(f"{salt}{text}".encode()).hexdigest()


def _row(line: bytes, study: Study) -> Row:
    """The row of a line made by `_line`, and of no other."""
    at, numbers, reason, _ = json.loads(line)
    row = Row(index(at, study.size), {str(name): float(number) for name, number in numbers.items()}, str(reason))
    if _line(row, study.fingerprint).rstrip() != line:
        raise ValueError
    return row
