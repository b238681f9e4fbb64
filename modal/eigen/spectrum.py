"""All eigenvalues of a scene in ascending order, by the methods that its structure requires.

On a fixed support every pendulum is independent.  On a cart, N equal pendula (equal links, bit for bit, wherever they
are in the file) split exactly: one pendulum N times as heavy moves together with the cart, and N − 1 antiphase copies
of the pendulum's fixed-base modes leave it at rest. So do all but one of the modes of equal frequency of different
pendula. In space the motion across the rail is that on a fixed support.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise, repeat
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from modal.assembly import Rig
from modal.eigen.component_matrices import ComponentMatrices
from modal.eigen.components import PartedRig, StillGroup
from modal.eigen.coupled import CartPendula, StillModes
from modal.eigen.free_motions import FreeMotions
from modal.eigen.sources import UNCERTAIN, Alone, Details, Source, StillPendula
from modal.eigen.squares import EVERYTHING, SEEDS, Limits
from modal.errors import ComputationError
from modal.report import deferred
from modal.types import Booleans, Floats, Ints

if TYPE_CHECKING:
    from modal.assembly import RatioAt

MASSLESS = (
    "The mass matrix is singular: a massless cart over bobs has no inertia of its own, "
    "so one mode has no finite frequency and is omitted."
)
DENSE = "Eigenvalues of a dense matrix are used where they meet the requested accuracy."
MERGED = (
    "Different pendula whose own frequencies agree to 2e-15, but not to the last bit, are taken as equal: whether they "
    "split by less, and which of them then swing, is beyond double precision."
)


class SpectrumPart(NamedTuple):
    """`along_count` + `across_count` modes of equal frequency, from row `row` of source `source` on.

    `kind` is the (block, column) whose copies share that row and move while all else is at rest; None if one vector
    moves several kinds and has its own row. `is_still` says that the support does not move.
    """

    source: int
    row: int
    along_count: int
    across_count: int
    kind: tuple[int, int] | None
    is_still: bool

    @property
    def copies(self) -> int:
        """The number of independent shapes."""
        return self.along_count + self.across_count

    def row_of(self, copy: int) -> int:
        """The row of the copy-th vector."""
        return self.row if self.kind else self.row + copy


@dataclass(frozen=True, eq=False)
class Batch:
    """Rows of a source with their multiplicities, all (R,); `block` and `columns` if single kinds move alone."""

    source: Source
    rows: Ints
    along_count: Ints
    across_count: Ints
    is_still: bool = False
    block: int = -1
    columns: Ints | None = None

    def parts(self, index: int) -> Iterator[SpectrumPart]:
        """The rows one by one, for source number `index`."""
        kinds = repeat(None) if self.columns is None else ((self.block, column) for column in self.columns.tolist())
        numbers = zip(self.rows.tolist(), self.along_count.tolist(), self.across_count.tolist(), kinds, strict=False)
        return (SpectrumPart(index, *number, self.is_still) for number in numbers)


def batches(rig: Rig, limits: Limits) -> Iterator[Batch]:
    """Return all modes of a rig in natural units: chains on a support at rest, equal ones that do not move it, others.

    Equal frequencies of different pendula on a cart are recognized from all digits of their own modes.
    """
    ratio = _ratio_at(rig) if rig.damping_ratio else None
    parted_rig = PartedRig(rig)
    components, still_groups = parted_rig.partition
    plain = rig.cart is not None and not rig.cart.damping and all(block.is_plain.all() for block in rig.blocks)
    has_coupling = plain and rig.n_kinds > 1
    alike = rig.n_kinds == 1 and not rig.structure
    pendulum_limits = limits if alike else EVERYTHING if has_coupling else Limits(lowest=limits.lowest)
    pendulum_sources = [Alone(block, pendulum_limits) for block in rig.blocks]
    for index, (block, source) in enumerate(zip(rig.blocks, pendulum_sources, strict=True)):
        along_count = block.count - parted_rig.carrying[index]
        across_count = block.count if rig.spatial else np.zeros_like(along_count)
        groups = [group for group in still_groups if group.block == index]
        has_modes = (along_count + across_count > 0) | has_coupling
        has_modes[[group.columns[0] for group in groups]] = True
        for columns, column_source in _sources(source, has_modes, ratio):
            rows = np.arange(len(column_source.eigenvalue))
            column = columns[rows % columns.size]
            is_present = (along_count + across_count)[column] > 0
            kinds = column[is_present]
            yield Batch(
                column_source,
                rows[is_present],
                along_count[kinds],
                across_count[kinds],
                is_still=True,
                block=index,
                columns=kinds,
            )
            for group in (group for group in groups if group.columns[0] in columns):
                yield from _group_batches(parted_rig, group, column_source, rows[column == group.columns[0]])
    fixed_squares = tuple(source.squares for source in pendulum_sources) if has_coupling else ()
    for component in components:
        matrices = ComponentMatrices(parted_rig, component)
        moving = CartPendula(rig, fixed_squares, limits) if plain else _on_structure(matrices, ratio, limits)
        if matrices.free.size:
            yield _moving(FreeMotions(matrices, moving))
        if isinstance(moving, CartPendula) and fixed_squares and moving.clusters.shared_clusters.size:
            still = StillModes(moving)
            first = np.cumsum(still.folds) - still.folds
            yield Batch(still, first, still.folds, np.zeros_like(first), is_still=True)
        if rig.cart or matrices.size > matrices.coasting.shape[1]:
            yield _moving(moving)


_ratio_at = deferred("modal.assembly.modal_damping:ratio_at")
_on_structure = deferred("modal.eigen.structured:OnStructure")
"""Loaded with the scenes that need them: others wait for neither."""


def _group_batches(parted_rig: PartedRig, group: StillGroup, source: Source, rows: Ints) -> Iterator[Batch]:
    """The combination that pushes along the rail, and all others."""
    pendula = StillPendula(parted_rig, group, source, rows)
    first, zero = np.arange(len(rows)) * group.number, np.zeros_like(rows)
    if group.pushes:
        yield Batch(pendula, first, np.ones_like(rows), zero, is_still=True)
    if others := group.number - group.pushes:
        yield Batch(pendula, first + group.pushes, np.full_like(rows, others), zero, is_still=True)


def _sources(source: Alone, has_modes: Booleans, ratio: RatioAt | None) -> Iterator[tuple[Ints, Source]]:
    block = source.block
    plain_columns = np.flatnonzero(has_modes & block.is_plain)
    if plain_columns.size:
        yield (
            plain_columns,
            source if plain_columns.size == block.size else Alone(block.take(plain_columns), source.limits),
        )
    for column in np.flatnonzero(has_modes & ~block.is_plain):
        chain = PartedRig(Rig(1.0, (block.take(np.array([column])),), ((0, 0, 1),), None, spatial=False))
        yield np.array([column]), _on_structure(ComponentMatrices(chain, chain.all_pendula), ratio, source.limits)


def _moving(source: Source) -> Batch:
    rows = np.arange(len(source.eigenvalue))
    return Batch(source, rows, np.ones_like(rows), np.zeros_like(rows))


def notes(sources: Sequence[Source]) -> tuple[str, ...]:
    """Return the omissions and approximations of these `sources`, with reasons."""
    has_merger = any(isinstance(source, StillModes) and source.clusters.has_rounding for source in sources)
    is_dense = any(SEEDS in source.route for source in sources)
    return (MASSLESS,) * sum(source.is_singular for source in sources) + (MERGED,) * has_merger + (DENSE,) * is_dense


@dataclass(frozen=True, eq=False)
class ModalSpectrum:
    """Distinct eigenvalues (R,) by |λ|, and relative error bounds (R,), in `batches` of sources.

    Eigenvalue r is that of the rows `order[cuts[r]:cuts[r + 1]]` of all batches, one after another.
    """

    eigenvalue: NDArray[np.complex128]
    error: Floats
    batches: tuple[Batch, ...]
    order: Ints
    cuts: Ints

    @property
    def sources(self) -> tuple[Source, ...]:
        """The sources of the batches."""
        return tuple(batch.source for batch in self.batches)

    @cached_property
    def groups(self) -> tuple[tuple[SpectrumPart, ...], ...]:
        """The parts of each eigenvalue."""
        parts = [part for index, batch in enumerate(self.batches) for part in batch.parts(index)]
        order = self.order.tolist()
        return tuple(tuple(parts[k] for k in order[a:b]) for a, b in pairwise(self.cuts.tolist()))

    @cached_property
    def multiplicity(self) -> Ints:
        """The number of independent modes of each eigenvalue, (R,)."""
        return np.array([sum(part.copies for part in parts) for parts in self.groups])

    @cached_property
    def numbers_of_kind(self) -> dict[tuple[int, int] | None, list[int]]:
        """The indices of the eigenvalues of each kind of pendulum alone; None for those of several kinds."""
        numbers: dict[tuple[int, int] | None, list[int]] = {}
        for number, parts in enumerate(self.groups):
            for part in parts:
                numbers.setdefault(part.kind, []).append(number)
        return numbers

    def take(self, rows: slice) -> ModalSpectrum:
        """A slice of the eigenvalues."""
        first, last, _ = rows.indices(len(self.eigenvalue))
        cuts = self.cuts[first : max(first, last) + 1]
        return ModalSpectrum(self.eigenvalue[rows], self.error[rows], self.batches, self.order, cuts)

    def details(self, source: int, rows: Sequence[int]) -> Details:
        """Properties of rows of a source."""
        with np.errstate(all="ignore"):
            return self.sources[source].details(np.array(rows))


def find_spectrum(rig: Rig, limits: Limits = EVERYTHING) -> ModalSpectrum:
    """The spectrum of a rig in natural units, or the requested part of it.

    Raise ComputationError if double precision or memory does not suffice.
    """
    try:
        parts = list(batches(rig, limits))
        values = np.concatenate([batch.source.eigenvalue[batch.rows] for batch in parts])
        if rig.damping_ratio:
            # modes iω to which no other dampers belong have the eigenvalues −ζω + iω√(1−ζ²)
            swings = np.concatenate([_is_conservative(batch) for batch in parts]) & (values.imag > 0)
            zeta = _ratio_at(rig)(values[swings].imag)
            values[swings] *= np.sqrt((1 - zeta) * (1 + zeta)) + 1j * zeta
        errors = np.concatenate([batch.source.error[batch.rows] for batch in parts])
    except np.linalg.LinAlgError:
        raise ComputationError("the ratios in this scene are beyond double precision on its dense route") from None
    if not np.all(np.isfinite(values)):
        raise ComputationError("the ratios in this scene are beyond double precision")
    if limits.lowest is None:
        _compare_with_states(rig, parts)
    errors = np.where(errors < UNCERTAIN, errors, np.inf)
    order = np.lexsort((values.real, np.abs(values)))
    ascending = values[order]
    steps = np.flatnonzero((ascending[1:] != ascending[:-1]) | (ascending[1:] == 0)) + 1  # free motions each by itself
    cuts = np.concatenate([[0], steps, [len(order)]])
    cuts = cuts if limits.lowest is None else cuts[: limits.lowest + 1]
    first = order[cuts[:-1]]
    return ModalSpectrum(values[first], errors[first], tuple(parts), order, cuts)


def _compare_with_states(rig: Rig, parts: Sequence[Batch]) -> None:
    """Raise ComputationError if the modes are not as many as the states, of which a decay or a dragged rest has one."""
    missing = sum(batch.source.is_singular for batch in parts)
    links = sum(int(block.count.sum()) * block.n for block in rig.blocks) * (1 + rig.spatial)
    states, mode_states = 2 * (rig.leading + links - missing), 0
    for batch in parts:
        value = batch.source.eigenvalue[batch.rows]
        has_drag = batch.source.has_drag if isinstance(batch.source, FreeMotions) else ~_is_conservative(batch)
        mode_states += int(
            ((batch.along_count + batch.across_count) * np.where(has_drag & (value.imag == 0), 1, 2)).sum()
        )
    if mode_states != states:
        raise ComputationError(f"the modes found have {mode_states} of the {states} states of this scene")


def _is_conservative(batch: Batch) -> Booleans:
    """Which rows (R,) of a batch are eigenvalues without any dampers."""
    return np.full(len(batch.rows), not batch.source.is_damped)
