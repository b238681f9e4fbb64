"""Storage of finished rows, so that an interrupted sweep can resume: a journal, or a folder of chunks.

To a journal rows are appended as they are computed.  The first line identifies the sweep; every other line is one row
in JSON with its own checksum.  An incomplete last line, left by a crash, is dropped; any other damage is reported with
its line number.  Only one sweep at a time can use a journal.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from hashlib import sha256
from typing import IO, Any

import numpy as np

from modal.errors import SceneError
from modal.scene.sealed import index
from nonlinear.ensembles.measures import Columns
from nonlinear.ensembles.store import ChunkFolder, locked, remove
from nonlinear.sweeps.study import Row, Study

JOURNAL_VERSION = 2
"""Format: of the first line of a journal."""
KNOWN = b'{"multipendula_journal"'


class Checkpoint:
    """The finished rows, held in memory only."""

    def __init__(self, rows: Sequence[Row] = ()) -> None:
        self.rows = tuple(rows)
        self.finished = False

    def add(self, rows: Sequence[Row]) -> None:
        """Keep some rows of one chunk, safe from a crash once this returns."""

    def finish(self) -> None:
        """The sweep has been saved: its journal is removed when it is closed."""
        self.finished = True


class Journal(Checkpoint):
    """The rows already in a journal, and the file to which new ones are appended."""

    def __init__(self, stream: IO[bytes], rows: Sequence[Row], salt: str) -> None:
        super().__init__(rows)
        self._stream, self._salt = stream, salt

    def add(self, rows: Sequence[Row]) -> None:
        """Append some rows, safe from a crash once this returns."""
        self._stream.write(b"".join(_line(row, self._salt) for row in rows))
        self._stream.flush()
        os.fsync(self._stream.fileno())


class RowFolder(Checkpoint):
    """The rows of a sweep in a folder, a file for each chunk, which any number of processes may fill together."""

    def __init__(self, folder: str | os.PathLike[str], study: Study) -> None:
        self._folder, self._study = ChunkFolder(folder, "sweep", study.fingerprint, study.header()), study
        numbers = range(-(-study.size // study.chunk))
        super().__init__([row for number in numbers for row in self._read(number) if not row.reason])

    def add(self, rows: Sequence[Row]) -> None:
        """Write the chunk with these rows next to those that it had."""
        if not rows:
            return
        number = rows[0].index // self._study.chunk
        together = {row.index: row for row in (*self._read(number), *rows)}
        every = [together[at] for at in sorted(together)]
        names = dict.fromkeys(name for row in every for name in row.numbers)
        columns = {name: np.array([row.numbers.get(name, np.nan) for row in every]) for name in names}
        header = {
            "points": [row.index for row in every],
            "reasons": [row.reason for row in every],
            "columns": [[name for name in names if name in row.numbers] for row in every],
        }
        self._folder.write(number, header, columns)

    def _read(self, number: int) -> list[Row]:
        """The rows of a chunk, none where there is no file of it."""
        if not self._folder.path(number).exists():
            return []

        def made(header: dict[str, Any], columns: Columns) -> list[Row]:
            points, reasons, names = (header[key] for key in ("points", "reasons", "columns"))
            if not set(points) <= {*self._study.points_of(number)} or any(
                values.shape != (len(points),) for values in columns.values()
            ):
                raise ValueError
            numbers = ({name: float(columns[name][k]) for name in row} for k, row in enumerate(names))
            return [Row(*row) for row in zip(points, numbers, map(str, reasons), strict=True)]

        return self._folder.content(number, made)


@contextmanager
def open_checkpoint(path: str | os.PathLike[str], study: Study, *, fresh: bool = False) -> Iterator[Checkpoint]:
    """The journal at a path, new or resumed; `fresh` restarts it, whatever sweep it belongs to.

    Rows of points that failed are dropped, so that these are tried again. Raise SceneError if the file is not a
    journal, is damaged, belongs to another sweep or to one that is running, OSError if it cannot be written.
    """
    name, salt = os.fspath(path), study.fingerprint
    first = json.dumps({"multipendula_journal": JOURNAL_VERSION, "sweep": salt}).encode() + b"\n"
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
        kept = Journal(stream, [row for row in rows.values() if not row.reason], salt)
        try:
            yield kept
        finally:
            if kept.finished:
                remove(stream, name)


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
    checksum = sha256(f"{salt}{text}".encode()).hexdigest()
    return f'{text}, "{checksum}"]\n'.encode()


def _row(line: bytes, study: Study) -> Row:
    """The row of a line made by `_line`, and of no other."""
    at, numbers, reason, _ = json.loads(line)
    row = Row(index(at, study.size), {str(name): float(number) for name, number in numbers.items()}, str(reason))
    if _line(row, study.fingerprint).rstrip() != line:
        raise ValueError
    return row
