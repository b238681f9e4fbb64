"""An ensemble on disk: one NPZ file a chunk, written whole or not at all, beside a header that says of what.

A chunk that is there is not computed again, so that an ensemble goes on where it was killed.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from modal.errors import SceneError
from modal.scene import whole_file
from modal.scene.contents import content_of, text_of
from modal.scene.sealed import UNREADABLE
from nonlinear.ensembles.computing import Chunk
from nonlinear.ensembles.measures import Columns
from nonlinear.ensembles.members import MemberPart
from nonlinear.ensembles.question import EnsembleRequest
from nonlinear.files import as_npz, from_npz

HEADER = "ensemble.json"
AGAIN = "remove it, and it is computed again"
JUDGED = "energy_drift"
"""A column that every engine gives."""
CROSSING = "crossing_"
"""What columns begin with that have a row for every crossing, not for every member."""


def engine_of_folder(folder: str | os.PathLike[str] | None) -> str:
    """The engine by which a folder was begun; "" where there is no header that says so."""
    try:
        return str(json.loads(text_of(Path(folder or "") / HEADER))["engine"])
    except (ValueError, KeyError, TypeError, RecursionError):
        return ""


def _is(path: Path, content: bytes) -> bool:
    """Whether a file holds just this."""
    try:
        return content_of(path) == content
    except SceneError as error:
        raise SceneError([f"{path}: {problem}" for problem in error.problems]) from None


def _refuse_unlike(
    columns: Columns, reasons: Mapping[int, str], differences: Mapping[int, float], part: MemberPart
) -> None:
    """ValueError for columns that are no numbers of these members, and for members that are not among them."""
    if not {*reasons, *differences} <= {*range(part.first, part.first + part.size)}:
        raise ValueError
    if JUDGED not in columns and (columns or len(reasons) < part.size):
        raise ValueError
    crossed = {len(rows) for name, rows in columns.items() if name.startswith(CROSSING)}
    whole = {len(rows) for name, rows in columns.items() if not name.startswith(CROSSING)}
    if len(crossed) > 1 or not whole <= {part.size} or any(rows.dtype.kind not in "fib" for rows in columns.values()):
        raise ValueError


class Parts:
    """The chunks of a question in a folder, which is made if it is not there.

    Raises SceneError for a folder that holds another ensemble, OSError where it cannot be written.
    """

    def __init__(self, folder: str | os.PathLike[str], question: EnsembleRequest) -> None:
        self.folder, self.question = Path(folder), question
        self.folder.mkdir(parents=True, exist_ok=True)
        header = json.dumps({"multipendula_ensemble": question.fingerprint, **question.header()}, indent=1) + "\n"
        path = self.folder / HEADER
        if not path.exists():
            if any(self.folder.glob("part-*.npz")):
                raise SceneError([f"{self.folder}: holds parts of another ensemble"])
            with whole_file(path) as stream:
                stream.write(header.encode())
        elif not _is(path, header.encode()):
            words = "holds another ensemble: remove it, or write to another folder"
            raise SceneError([f"{self.folder}: {words}"])

    def path(self, number: int) -> Path:
        """The file of a chunk."""
        return self.folder / f"part-{number:06d}.npz"

    def done(self, number: int) -> bool:
        """Whether a chunk is there; SceneError where what is there is not that chunk."""
        return self.path(number).exists() and self.read(number).size > 0

    def keep(self, number: int, chunk: Chunk) -> None:
        """Write a chunk, safe from a crash when this returns."""
        header = {
            "multipendula_ensemble": self.question.fingerprint,
            "first": chunk.first,
            "size": chunk.size,
            "reasons": {str(member): reason for member, reason in chunk.reasons.items()},
            "differences_rad": {str(member): difference.hex() for member, difference in chunk.differences.items()},
        }
        with whole_file(self.path(number)) as stream:
            stream.write(as_npz(header, chunk.columns))

    def read(self, number: int) -> Chunk:
        """A chunk that is there; SceneError where the file is damaged, or a chunk of another ensemble or place."""
        try:
            header, columns = from_npz(self.path(number))
            self._refuse_other(number, header)
            reasons = {int(member): str(reason) for member, reason in header["reasons"].items()}
            differences = {int(k): float.fromhex(difference) for k, difference in header["differences_rad"].items()}
            _refuse_unlike(columns, reasons, differences, self.question.part(number))
            return Chunk(int(header["first"]), int(header["size"]), columns, reasons, differences)
        except SceneError as error:
            raise SceneError([f"{self.path(number)}: {problem}" for problem in error.problems]) from None
        except UNREADABLE as error:
            raise SceneError([f"{self.path(number)}: is damaged ({type(error).__name__}): {AGAIN}"]) from None

    def _refuse_other(self, number: int, header: dict[str, Any]) -> None:
        """SceneError for the header of a chunk that does not stand in this place of this ensemble."""
        part = self.question.part(number)
        why = ""
        if (fingerprint := header.get("multipendula_ensemble")) != self.question.fingerprint:
            why = "does not name its ensemble" if fingerprint is None else "is a chunk of another ensemble"
        elif (header["first"], header["size"]) != (part.first, part.size):
            last = int(header["first"]) + int(header["size"]) - 1
            why = f"holds members {header['first']} to {last}, not {part.first} to {part.first + part.size - 1}"
        if why:
            raise SceneError([f"{why}: {AGAIN}"])

    def __iter__(self) -> Iterator[Chunk]:
        return (self.read(number) for number in range(self.question.chunks) if self.path(number).exists())
