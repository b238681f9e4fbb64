"""All eigenvalues of a rig in ascending order, and which rows of which sources stand behind each distinct one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from modal.assembly import Rig
from modal.eigen.routes import Part, batches
from modal.eigen.sources import Details, Source
from modal.errors import ComputationError
from modal.types import Floats, Ints


@dataclass(frozen=True, eq=False)
class Spectrum:
    """Distinct eigenvalues (R,) by |λ|, relative error bounds (R,), and the parts of each from `sources`."""

    eigenvalue: NDArray[np.complex128]
    error: Floats
    groups: tuple[tuple[Part, ...], ...]
    sources: tuple[Source, ...]

    @cached_property
    def multiplicity(self) -> Ints:
        """How many independent modes share each eigenvalue, (R,)."""
        return np.array([sum(part.along + part.across for part in parts) for parts in self.groups])

    @cached_property
    def numbers_of_kind(self) -> dict[tuple[int, int] | None, list[int]]:
        """The eigenvalues, by index, that each kind of pendulum has on its own; None for those of several kinds."""
        found: dict[tuple[int, int] | None, list[int]] = {}
        for number, parts in enumerate(self.groups):
            for part in parts:
                found.setdefault(part.kind, []).append(number)
        return found

    def details(self, source: int, rows: Sequence[int]) -> Details:
        """What a source says about its rows."""
        with np.errstate(all="ignore"):
            return self.sources[source].details(np.array(rows))


def find_spectrum(rig: Rig) -> Spectrum:
    """The spectrum of a rig in natural units.

    Raises ComputationError where double precision or memory cannot give it.
    """
    try:
        found = list(batches(rig))
        values = np.concatenate([batch.source.eigenvalue[batch.rows] for batch in found])
        errors = np.concatenate([batch.source.error[batch.rows] for batch in found])
    except np.linalg.LinAlgError:
        raise ComputationError("the ratios in this scene are beyond double precision on its dense route") from None
    if not np.all(np.isfinite(values)):
        raise ComputationError("the ratios in this scene are beyond double precision")
    parts = [part for index, batch in enumerate(found) for part in batch.parts(index)]
    order = np.lexsort((values.real, np.abs(values)))
    cuts = [0, *(k for k in range(1, len(order)) if values[order[k]] != values[order[k - 1]]), len(order)]
    first = order[cuts[:-1]]
    groups = tuple(tuple(parts[k] for k in order[a:b]) for a, b in pairwise(cuts))
    return Spectrum(values[first], errors[first], groups, tuple(batch.source for batch in found))
