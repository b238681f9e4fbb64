"""The arrays of a modal support: what is wrong with them, and the NPZ file that they are read from."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import lru_cache
from io import BytesIO
from os import PathLike
from typing import Any
from zipfile import ZipFile

import numpy as np

from modal.errors import SceneError
from modal.scene.sealed import content, members_of, reading
from modal.types import Floats

SYMMETRIC = 1e-10
"""How far from symmetric a matrix may be, of its largest entry; and how negative an eigenvalue of one without sign."""
MOST_COORDINATES, MOST_POINTS = 500, 10_000
Rows = tuple[tuple[float, ...], ...]


@lru_cache(maxsize=16)
def matrix_problems(M: Rows, K: Rows, D: Rows | None, points: tuple[Rows, ...]) -> tuple[str, ...]:
    """What is wrong with M, K, D (d, d) and points (P, 2, d), each line beginning with its key."""
    return tuple(_matrix_problems(M, K, D, points))


def _matrix_problems(M: Rows, K: Rows, D: Rows | None, points: tuple[Rows, ...]) -> Iterator[str]:
    size = len(M)
    if not 0 < size <= MOST_COORDINATES:
        yield f".M: has {size} rows: from 1 to {MOST_COORDINATES} are possible"
        return
    square = [(name, matrix) for name, matrix in (("M", M), ("K", K), ("D", D)) if matrix is not None]
    wrong = [name for name, matrix in square if len(matrix) != size or any(len(row) != size for row in matrix)]
    yield from (f".{name}: must have {size} rows of {size} numbers, as M has rows" for name in wrong)
    if not 0 < len(points) <= MOST_POINTS:
        yield f".points: has {len(points)} points: from 1 to {MOST_POINTS} are possible"
    for k, point in enumerate(points):
        if len(point) != 2 or any(len(row) != size for row in point):
            yield f".points[{k}]: must be 2 lists of {size} numbers: displacements along and down"
            break
    if not wrong:
        yield from _sign_problems({name: np.array(matrix) for name, matrix in square})


def _sign_problems(matrices: Mapping[str, Floats]) -> Iterator[str]:
    """Matrices that are not symmetric, not positive definite, or not semidefinite."""
    skew = [
        name for name, matrix in matrices.items() if np.abs(matrix - matrix.T).max() > SYMMETRIC * np.abs(matrix).max()
    ]
    yield from (f".{name}: must be symmetric" for name in skew)
    if "M" in skew:
        return
    try:
        inverse = np.linalg.inv(np.linalg.cholesky(matrices["M"]))
    except np.linalg.LinAlgError:
        yield ".M: must be positive definite"
        return
    for name, matrix in matrices.items():
        if name != "M" and name not in skew:
            values = np.linalg.eigvalsh(inverse @ matrix @ inverse.T)
            if values[0] < -SYMMETRIC * max(values[-1], 0.0):
                yield f".{name}: must be positive semidefinite"


# ------------------------------------------------------------------------------------------------------- files

ARRAYS = ("M", "K", "D", "points")
LARGEST_FILE = 64_000_000
"""Bytes of all arrays of a file, unpacked."""
RANKS = {"M": 2, "K": 2, "D": 2, "points": 3}


def read_matrices(path: str | PathLike[str]) -> dict[str, Any]:
    """M, K, points and, where it is there, D of an NPZ file as NumPy writes it, as nested lists; others are ignored.

    Nothing is unpickled, and nothing unpacked before its size is known.  SceneError, with the file's name, for any
    other file.
    """
    with reading(path, "NPZ file of M, K and points"), ZipFile(BytesIO(content(path))) as zipped:
        arrays = members_of(zipped, ARRAYS, LARGEST_FILE)
        if missing := [name for name in ("M", "K", "points") if name not in arrays]:
            raise SceneError([f"has no array {', '.join(missing)}"])
        for name, matrix in arrays.items():
            if matrix.dtype.kind not in "fiu" or matrix.ndim != RANKS[name]:
                raise SceneError([f"{name}: must be an array of real numbers with {RANKS[name]} axes"])
        return {name: matrix.astype(float).tolist() for name, matrix in arrays.items()}
