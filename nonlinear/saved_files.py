"""What all files of results share: the two kinds they come in, and the header that both begin with."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable
from typing import Any

import numpy as np

from modal.report import sealed
from modal.report.escaping import csv_comment
from modal.scene.files import kind_of

KINDS = ("npz", "csv")
HEADER = "header"
COMMENT = "# {"


def checked_kind(path: str | os.PathLike[str]) -> str:
    """The ending of a file's name, npz for standard output; SceneError for any other than .npz and .csv."""
    return kind_of(path, KINDS)


def as_csv(header: dict[str, Any], lines: Iterable[str]) -> bytes:
    """The header in a comment on the first line, its checksum before everything else, and the lines below."""
    return sealed.sealed_text(COMMENT, f" {csv_comment(json.dumps(header))[1:]}\n" + "".join(lines))


def from_csv(path: str | os.PathLike[str]) -> tuple[dict[str, Any], str]:
    """The header, and what stands below it."""
    found = sealed.content(path)
    sealed.insist_sealed_text(found, COMMENT)
    first, _, rest = found.decode().partition("\n")
    header: dict[str, Any] = json.loads(first.removeprefix("# "))
    del header["sha256"]
    return header, rest


def as_npz(header: dict[str, Any], arrays: dict[str, Any]) -> bytes:
    """The header as an array of one text, beside the others."""
    return sealed.archive({HEADER: np.array(json.dumps(header))} | arrays)


def from_npz(path: str | os.PathLike[str]) -> tuple[dict[str, Any], dict[str, Any]]:
    """The header, and the arrays beside it."""
    arrays = sealed.unpacked(sealed.content(path))
    header: dict[str, Any] = json.loads(str(arrays.pop(HEADER)))
    return header, arrays
