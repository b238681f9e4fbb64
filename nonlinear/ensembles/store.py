"""Storage of chunks on disk: a folder with a file for each, or one file locked by a process.

In a folder each chunk is an NPZ file, written completely or not at all, next to a header that says of what question.
Stored chunks are not computed again, so that an ensemble or a sweep resumes where it was interrupted.
"""

from __future__ import annotations

import errno
import json
import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO, Any, TypeVar, cast

from modal.errors import SceneError, refuse_any
from modal.scene import whole_file
from modal.scene.contents import content_of, lock, text_of
from modal.scene.sealed import UNREADABLE
from nonlinear.ensembles.computing import Chunk
from nonlinear.ensembles.measures import Columns
from nonlinear.ensembles.members import MemberPart
from nonlinear.ensembles.question import EnsembleRequest
from nonlinear.files import as_npz, from_npz
from nonlinear.integration import validate_whole

T = TypeVar("T")
HEADER = "ensemble.json"
"""The record of the ensemble to which a folder belongs."""
AGAIN = "remove it, and it is computed again"
TAKEN = {errno.EAGAIN, errno.EACCES, errno.EDEADLK}
"""Errors by which a system says that another process has locked a file."""
JUDGED = "energy_drift"
"""A column that every engine gives."""
CROSSING = "crossing_"
"""The prefix of columns that have a row for every crossing, not for every member."""


def engine_of_folder(folder: str | os.PathLike[str] | None) -> str:
    """Return the engine with which a folder was begun; "" if its header does not say."""
    return str(_entry_of(Path(folder or "") / HEADER, "engine") or "")


def _entry_of(path: Path, key: str) -> object:
    """An entry of a header, None if it does not say."""
    try:
        return json.loads(text_of(path)).get(key)
    except (ValueError, AttributeError, TypeError, RecursionError):
        return None


def _is(path: Path, content: bytes) -> bool:
    """Whether a file holds just this."""
    try:
        return content_of(path) == content
    except SceneError as error:
        raise SceneError([f"{path}: {problem}" for problem in error.problems]) from None


def _refuse_unlike(
    columns: Columns, reasons: Mapping[int, str], differences: Mapping[int, float], part: MemberPart
) -> None:
    """Raise ValueError for columns that are no numbers of these members, and for members that are not among them."""
    if not {*reasons, *differences} <= {*range(part.first, part.first + part.size)}:
        raise ValueError
    if JUDGED not in columns and (columns or len(reasons) < part.size):
        raise ValueError
    crossed = {len(rows) for name, rows in columns.items() if name.startswith(CROSSING)}
    whole = {len(rows) for name, rows in columns.items() if not name.startswith(CROSSING)}
    if len(crossed) > 1 or not whole <= {part.size} or any(rows.dtype.kind not in "fib" for rows in columns.values()):
        raise ValueError


def validate_store(folder: object, share: object) -> None:
    """Raise SceneError for an invalid folder, and for an impossible share."""
    problems = []
    if folder is not None and not (isinstance(folder, str | os.PathLike) and os.fspath(folder)):
        problems.append(f"folder {folder!r}: must be the path of a folder")
    try:
        first, of = (0, 1) if share is None else cast("tuple[int, int]", share)
        validate_whole(0, k=first, n=of)
        fits = first < of
    except (TypeError, ValueError):
        fits = False
    if not fits:
        problems.append(f"share {share!r}: must be (k, n), whole numbers with 0 ≤ k < n")
    refuse_any(problems)


class ChunkFolder:
    """The chunks of a question in a folder, which is made if it is not there; `kind` is "ensemble" or "sweep".

    Raise SceneError for a folder that holds another question, OSError if it cannot be written.
    """

    def __init__(self, folder: str | os.PathLike[str], kind: str, fingerprint: str, header: Mapping[str, Any]) -> None:
        self.folder, self.kind, self.fingerprint = Path(folder), kind, fingerprint
        self.folder.mkdir(parents=True, exist_ok=True)
        content = (json.dumps({self._key: fingerprint, **header}, indent=1) + "\n").encode()
        path = self.folder / f"{kind}.json"
        if not path.exists():
            if any(self.folder.glob("part-*.npz")):
                raise SceneError([f"{self.folder}: contains parts of another {kind}"])
            with whole_file(path) as stream:
                stream.write(content)
        elif not _is(path, content):
            is_kind = _entry_of(path, self._key) is not None
            is_old = is_kind and _entry_of(path, "format") != header.get("format")
            what = f"holds a {kind} of another version" if is_old else f"holds another {kind}"
            raise SceneError([f"{self.folder}: {what}: remove it, or write to another folder"])

    @property
    def _key(self) -> str:
        return f"multipendula_{self.kind}"

    def path(self, name: int | str) -> Path:
        """The file of a chunk of a number or a name."""
        return self.folder / f"part-{name if isinstance(name, str) else f'{name:06d}'}.npz"

    def write(self, name: int | str, header: Mapping[str, Any], columns: Mapping[str, Any]) -> None:
        """Write a chunk, safe from a crash when this returns."""
        with whole_file(self.path(name)) as stream:
            stream.write(as_npz({self._key: self.fingerprint, **header}, {**columns}))

    def content(self, name: int | str, made: Callable[[dict[str, Any], Columns], T]) -> T:
        """What is `made` of a chunk that is there; SceneError where it is damaged, or a chunk of another question."""
        try:
            header, columns = from_npz(self.path(name))
            if (fingerprint := header.get(self._key)) != self.fingerprint:
                why = f"does not name its {self.kind}" if fingerprint is None else f"is a chunk of another {self.kind}"
                raise SceneError([f"{why}: {AGAIN}"])
            return made(header, columns)
        except SceneError as error:
            raise SceneError([f"{self.path(name)}: {problem}" for problem in error.problems]) from None
        except UNREADABLE as error:
            raise SceneError([f"{self.path(name)}: is damaged ({type(error).__name__}): {AGAIN}"]) from None


class Parts(ChunkFolder):
    """The chunks of an ensemble."""

    def __init__(self, folder: str | os.PathLike[str], question: EnsembleRequest) -> None:
        super().__init__(folder, "ensemble", question.fingerprint, question.header())
        self.question = question

    def done(self, number: int) -> bool:
        """Whether a chunk is there; raise SceneError if the file there is not that chunk."""
        return self.path(number).exists() and self.read(number).size > 0

    def keep(self, number: int, chunk: Chunk) -> None:
        """Write a chunk, safe from a crash when this returns."""
        header = {
            "first": chunk.first,
            "size": chunk.size,
            "reasons": {str(member): reason for member, reason in chunk.reasons.items()},
            "differences_rad": {str(member): difference.hex() for member, difference in chunk.differences.items()},
        }
        self.write(number, header, chunk.columns)

    def read(self, number: int) -> Chunk:
        """A chunk that is there; raise SceneError if it is damaged, or a chunk of another ensemble or place."""
        part = self.question.part(number)

        def made(header: dict[str, Any], columns: Columns) -> Chunk:
            first, size = int(header["first"]), int(header["size"])
            if (header["first"], header["size"]) != (part.first, part.size):
                there = f"members {first} to {first + size - 1}, not {part.first} to {part.first + part.size - 1}"
                raise SceneError([f"holds {there}: {AGAIN}"])
            reasons = {int(member): str(reason) for member, reason in header["reasons"].items()}
            differences = {int(k): float.fromhex(difference) for k, difference in header["differences_rad"].items()}
            _refuse_unlike(columns, reasons, differences, part)
            return Chunk(first, size, columns, reasons, differences)

        return self.content(number, made)

    def __iter__(self) -> Iterator[Chunk]:
        return (self.read(number) for number in range(self.question.chunks) if self.path(number).exists())


# ------------------------------------------------------------------------------------------- a file of one's own


@contextmanager
def locked(name: str) -> Iterator[IO[bytes]]:
    """A file to read and append to, created if missing; raise SceneError if another process holds it.

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


def remove(stream: IO[bytes], name: str) -> None:
    """Remove a file while it is still locked; Windows removes none that another process has open."""
    stream.truncate(0)
    if os.name == "nt":
        stream.close()
    with suppress(FileNotFoundError, PermissionError):
        os.unlink(name)
