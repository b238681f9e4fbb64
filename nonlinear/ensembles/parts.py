"""An ensemble on disk: one NPZ file a chunk, written whole or not at all, beside a header that says of what.

A chunk that is there is not computed again, so that an ensemble goes on where it was killed.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from modal.errors import SceneError
from modal.scene import whole_file
from nonlinear.ensembles.computing import Chunk
from nonlinear.ensembles.question import Question
from nonlinear.files import as_npz, from_npz

HEADER = "ensemble.json"


def engine_of_folder(folder: str | os.PathLike[str] | None) -> str:
    """The engine by which a folder was begun; "" where there is no header that says so."""
    try:
        return str(json.loads((Path(folder or "") / HEADER).read_text(encoding="utf-8"))["engine"])
    except (OSError, ValueError, KeyError, TypeError):
        return ""


class Parts:
    """The chunks of a question in a folder, which is made if it is not there.

    Raises SceneError for a folder that holds another ensemble, OSError where it cannot be written.
    """

    def __init__(self, folder: str | os.PathLike[str], question: Question) -> None:
        self.folder, self.question = Path(folder), question
        self.folder.mkdir(parents=True, exist_ok=True)
        header = json.dumps({"multipendula_ensemble": question.fingerprint, **question.header()}, indent=1) + "\n"
        path = self.folder / HEADER
        if not path.exists():
            if any(self.folder.glob("part-*.npz")):
                raise SceneError([f"{self.folder}: holds parts of another ensemble"])
            with whole_file(path) as stream:
                stream.write(header.encode())
        elif path.read_text(encoding="utf-8") != header:
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
            "differences_rad": {str(member): own.hex() for member, own in chunk.differences.items()},
        }
        with whole_file(self.path(number)) as stream:
            stream.write(as_npz(header, chunk.columns))

    def read(self, number: int) -> Chunk:
        """A chunk that is there; SceneError where the file is damaged, or a chunk of another ensemble or place."""
        try:
            header, columns = from_npz(self.path(number))
            self._refuse_other(number, header)
            reasons = {int(member): str(reason) for member, reason in header["reasons"].items()}
            differences = {int(k): float.fromhex(own) for k, own in header["differences_rad"].items()}
            return Chunk(int(header["first"]), int(header["size"]), columns, reasons, differences)
        except SceneError:
            raise
        except (ValueError, KeyError, TypeError, AttributeError, EOFError) as error:
            words = "is damaged: remove it, and it is computed again"
            raise SceneError([f"{self.path(number)}: {words} ({type(error).__name__})"]) from None

    def _refuse_other(self, number: int, header: dict[str, Any]) -> None:
        """SceneError for the header of a chunk that does not stand in this place of this ensemble."""
        part = self.question.part(number)
        why = ""
        if (found := header.get("multipendula_ensemble")) != self.question.fingerprint:
            why = "does not say of which ensemble it is" if found is None else "is a chunk of another ensemble"
        elif (header["first"], header["size"]) != (part.first, part.size):
            last = int(header["first"]) + int(header["size"]) - 1
            why = f"holds members {header['first']} to {last}, not {part.first} to {part.first + part.size - 1}"
        if why:
            raise SceneError([f"{self.path(number)}: {why}: remove it, and it is computed again"])

    def __iter__(self) -> Iterator[Chunk]:
        return (self.read(number) for number in range(self.question.chunks) if self.path(number).exists())
