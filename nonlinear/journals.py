"""The journal of a sweep: rows are appended as they come, so that a sweep cut short goes on where it was.

The first line says which sweep it is, every other is one row in JSON.  A last line that a crash has torn is dropped.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any

from modal.errors import SceneError
from nonlinear.studies import Row, Study

VERSION = 1
KNOWN = b'{"multipendula_journal"'


class Journal:
    """The rows that a file already held, and where new ones go; without a file it forgets them."""

    def __init__(self, stream: IO[bytes] | None = None, rows: Sequence[Row] = ()) -> None:
        self._stream, self.rows = stream, tuple(rows)

    def add(self, rows: Sequence[Row]) -> None:
        """Keep some rows, safe from a crash when this returns."""
        if self._stream is not None:
            text = "".join(json.dumps([row.index, row.numbers, row.reason]) + "\n" for row in rows)
            self._stream.write(text.encode())
            self._stream.flush()
            os.fsync(self._stream.fileno())


@contextmanager
def journal(path: str | os.PathLike[str], study: Study, *, fresh: bool = False) -> Iterator[Journal]:
    """The journal at a path, begun or gone on with; `fresh` begins anew whatever sweep it is of.

    Rows of points that failed are left out, so that these are tried again.  Raises SceneError where the file is
    something else or belongs to another sweep, OSError where it cannot be written.
    """
    name = os.fspath(path)
    first = json.dumps({"multipendula_journal": VERSION, "sweep": study.fingerprint}).encode() + b"\n"
    with _named(name), open(name, "ab+") as stream:
        stream.seek(0)
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
        yield Journal(stream, [row for row in rows.values() if not row.reason])


@contextmanager
def _named(name: str) -> Iterator[None]:
    """Says which file it is that cannot be written, which a full disk does not."""
    try:
        yield
    except OSError as error:
        error.filename = error.filename or name
        raise


def _rows(name: str, content: bytes, first: bytes, study: Study) -> dict[int, Row]:
    head, *lines = content.splitlines(keepends=True)
    if head != first:
        known = head.startswith(KNOWN)
        words = "belongs to another sweep: remove it or write elsewhere" if known else "is not the journal of a sweep"
        raise SceneError([f"{name}: {words}"])
    try:
        return {row.index: row for row in (_row(json.loads(line), study) for line in lines)}
    except (ValueError, TypeError, AttributeError, RecursionError):
        raise SceneError([f"{name}: is a broken journal: remove it"]) from None


def _row(found: Any, study: Study) -> Row:
    index, numbers, reason = found
    if not isinstance(index, int) or not 0 <= index < study.size or not isinstance(reason, str):
        raise ValueError
    return Row(index, {str(name): float(number) for name, number in numbers.items()}, reason)


def remove(path: str | os.PathLike[str]) -> None:
    """Once the sweep is written whole."""
    Path(path).unlink(missing_ok=True)
