"""All shapes of a scene as one matrix, or one after the other."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from modal.eigen import UNCERTAIN, Details, SpectrumPart
from modal.modes.eigenvalues import Eigenvalues
from modal.modes.shapes import Shape, expand
from modal.report import Displayed, Summary
from modal.types import Booleans, Floats, Ints


@dataclass(frozen=True, eq=False, repr=False)
class ModalMatrix(Displayed):
    """Φ (n, C): every shape as a column with φᵀMφ = 1, the cart (if there is one) first, then all links.

    `row` and `copy` (C,), both from 0, give the position of a shape in the table, `across` (C,) whether it moves across
    the rail, where M is different.
    """

    shapes: NDArray[Any]
    row: Ints
    copy: Ints
    across: Booleans
    M: Floats

    def _summary(self) -> Summary:
        size, count = self.shapes.shape
        kind = "complex" if np.iscomplexobj(self.shapes) else "real"
        return Summary(f"Modal matrix of {count} {kind} shapes over {size} coordinates, φᵀMφ = 1")

    @cached_property
    def dual(self) -> NDArray[Any]:
        """MΦ (n, C): for shapes without dampers (MΦ)ᵀq are the modal coordinates of a motion q."""
        return np.asarray(self.M @ self.shapes)

    @property
    def real(self) -> ModalMatrix:
        """The matrix of an undamped scene, whose shapes are real."""
        return replace(self, shapes=self.shapes.real)

    def take(self, columns: NDArray[Any]) -> ModalMatrix:
        """Some of the columns, by index or by a mask."""
        row, copy, across = (part[columns] for part in (self.row, self.copy, self.across))
        return ModalMatrix(self.shapes.T[columns].T, row, copy, across, self.M)


def stacked(each: list[list[NDArray[Any]]], across: Booleans, M: Floats) -> ModalMatrix:
    """The matrix of the columns of every mode, one list a mode."""
    places = [(row, copy) for row, vectors in enumerate(each) for copy in range(len(vectors))]
    row, copy = (np.array([place[part] for place in places], dtype=np.int64) for part in (0, 1))
    return ModalMatrix(np.array([column for vectors in each for column in vectors]).T, row, copy, across, M)


def all_shapes(modes: Eigenvalues) -> list[list[Shape]]:
    """`modes.shape(number, copy, "mass")` for every mode and copy."""
    groups, rows = modes.spectrum.groups, _rows(modes)
    details = {source: modes.spectrum.details(source, list(places)) for source, places in rows.items()}

    def shape(part: SpectrumPart, copy: int, uncertain: bool) -> Shape:
        row = _row(details[part.source], rows[part.source][part.row_of(copy)])
        return expand(modes.rig, modes.units, part, copy, row, "mass", uncertain=uncertain)

    return [
        [shape(part, copy, bool(error >= UNCERTAIN)) for part in parts for copy in range(part.along + part.across)]
        for parts, error in zip(groups, modes.error, strict=True)
    ]


def _rows(modes: Eigenvalues) -> dict[int, dict[int, int]]:
    """The required rows of every source, with their positions among these."""
    rows: dict[int, dict[int, int]] = {}
    for part in (part for parts in modes.spectrum.groups for part in parts):
        places = rows.setdefault(part.source, {})
        for copy in range(part.along + part.across):
            places.setdefault(part.row_of(copy), len(places))
    return rows


def _row(details: Details, at: int) -> Details:
    """One row of the details, the last axis of every array."""
    single: dict[str, Any] = {}
    for field in fields(details):
        value = getattr(details, field.name)
        single[field.name] = tuple(part[..., [at]] for part in value) if isinstance(value, tuple) else value[[at]]
    return Details(**single)
