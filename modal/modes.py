"""The modes of a scene: the right route for what hangs there, and what a table says about each mode.

A fixed support leaves every pendulum alone.  On a cart, N equal pendula (equal links, bit for bit, wherever they
stand in the file) split exactly: one pendulum N times as heavy moves together with the cart, and N − 1 antiphase
copies of the pendulum's own modes hold it still.  In space the motion across the rail is that on a fixed support.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import groupby, pairwise, repeat

import numpy as np
from numpy.typing import NDArray

from modal.amplitude import one_percent_amplitude
from modal.crowd import Crowd
from modal.effective import CartProblem
from modal.errors import ComputationError
from modal.families import family, motion_words
from modal.rig import Floats, Ints, Rig, Units, rig_of
from modal.scene import Scene
from modal.sources import (
    MOST_LINKS_TOGETHER,
    Alone,
    Dense,
    Details,
    Rigid,
    Source,
    Together,
    bare_mobility,
)

RESONANCE = 0.02
CHUNK = 4_000_000


@dataclass(frozen=True)
class Mode:
    """One distinct natural frequency.

    `omega` (rad/s) is |λ| of the eigenvalue λ, `damping_ratio` −Re λ/|λ| (1: overdamped, below 0: unstable);
    `cart_participation` is this mode's share of the cart's response to a sudden push (they sum to 1);
    `effective_mass` (kg) that of the support's motion along the rail; `kappa` and `linear_to_1_percent_deg` are for
    the largest angle of the mode.  NaN stands where a quantity has no meaning (κ of a damped mode).
    """

    number: int
    omega: float
    damping_ratio: float
    multiplicity: int
    family: str
    cart_participation: float
    effective_mass: float
    effective_mass_share: float
    effective_mass_across: float
    kappa: float
    linear_to_1_percent_deg: float
    resonances: tuple[str, ...]
    residual: float
    relative_error_bound: float
    indistinct: bool

    @property
    def frequency(self) -> float:
        """Hz."""
        return self.omega / (2 * np.pi)

    @property
    def period(self) -> float | None:
        """Seconds; None for ω = 0 and for a mode that does not oscillate."""
        return 2 * np.pi / self.omega if self.omega > 0 and abs(self.damping_ratio) < 1 else None


@dataclass(frozen=True, eq=False)
class Shape:
    """One basis vector of a mode: the cart's displacement (m) and every link's angle (rad), copies counted out.

    Complex for damped modes.  `across` says that it moves across the rail (scenes in space).
    """

    cart: complex
    angles: NDArray[np.inexact]
    kinetic_energy_share: Floats
    across: bool


@dataclass(frozen=True)
class _Part:
    """`along` + `across` modes of equal frequency: row `row` of source `source`.

    `kind` is the (block, column) whose copies move while all else stands still; None where everything moves.
    """

    source: int
    row: int
    along: int
    across: int
    kind: tuple[int, int] | None


@dataclass(frozen=True, eq=False)
class Modes(Sequence[Mode]):
    """All modes in ascending order of natural frequency, one entry for each distinct one.

    `omega` (R,) in rad/s and `multiplicity` (R,) are at hand for all of them; an item computes its `Mode`.
    `notes` say what was left out and why.
    """

    scene: Scene
    rig: Rig
    units: Units
    sources: tuple[Source, ...]
    groups: tuple[tuple[_Part, ...], ...]
    eigenvalue: NDArray[np.complex128]
    error: Floats
    notes: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.groups)

    def __getitem__(self, index):  # type: ignore[no-untyped-def]
        chosen = range(len(self))[index]
        return list(self.rows(chosen)) if isinstance(chosen, range) else next(self.rows([chosen]))

    def __iter__(self) -> Iterator[Mode]:
        return self.rows(range(len(self)))

    @cached_property
    def omega(self) -> Floats:
        """Natural frequencies |λ| (R,) in rad/s."""
        return np.abs(self.eigenvalue)

    @cached_property
    def multiplicity(self) -> Ints:
        """How many independent modes share each frequency, (R,)."""
        return np.array([sum(part.along + part.across for part in parts) for parts in self.groups])

    @cached_property
    def route(self) -> str:
        """The routes that were taken, for people."""
        return ", ".join(dict.fromkeys(source.route for source in self.sources))

    def rows(self, numbers: Sequence[int]) -> Iterator[Mode]:
        """The modes with these indices (from 0), computed together, a bounded amount of memory at a time."""
        size = max(1, CHUNK // max(1, sum(block.mass.size for block in self.rig.blocks)))
        for start in range(0, len(numbers), size):
            chunk = numbers[start : start + size]
            found = dict(self._described(chunk))
            yield from (found[number] for number in chunk)

    def shape(self, number: int, copy: int = 0, normalise: str = "angle") -> Shape:
        """The copy-th basis vector of mode `number` (from 0), `normalise`d to "angle" (largest 1 rad) or "mass" (φᵀMφ = 1 kg).

        Equal pendula in antiphase are spanned by (1, −1, 0, …), (1, 1, −2, 0, …), … along the rail, then one
        pendulum at a time across it.  The sign makes the first of the largest angles positive.
        """
        left = copy
        for part in self.groups[number]:
            if 0 <= left < part.along + part.across:
                details = self._details(part.source, [part.row])
                shape = _together(self.rig, details) if part.kind is None else _alone(self.rig, part, left, details)
                return _normalised(shape, float(details.modal_mass[0]), self.units, normalise)
            left -= part.along + part.across
        raise IndexError(f"mode {number} has no basis vector {copy}")

    def _details(self, source: int, rows: Sequence[int]) -> Details:
        with np.errstate(all="ignore"):
            return self.sources[source].details(np.array(rows))

    def _described(self, numbers: Sequence[int]) -> Iterator[tuple[int, Mode]]:
        heads = sorted((self.groups[n][0].source, self.groups[n][0].row, n) for n in numbers)
        for source, members in groupby(heads, key=lambda head: head[0]):
            _, rows, wanted = zip(*members, strict=True)
            details = self._details(source, rows)
            for position, number in enumerate(wanted):
                yield number, self._mode(number, details, position)

    def _mode(self, number: int, details: Details, at: int) -> Mode:
        parts, value = self.groups[number], self.eigenvalue[number]
        omega, unit = float(abs(value)), self.units.mass
        still = parts[0].kind is not None
        along = sum(part.along for part in parts)
        across = sum(part.across for part in parts)
        effective = float(details.effective_mass[at]) * unit
        on_rail = 0.0 if still and self.rig.cart else effective * (along if still else 1)
        kappa = float(details.kappa[at])
        ratio = -value.real / omega if omega > 0 else 0.0
        several = (not still and any(count > 1 for _, _, count in self.rig.members)) or len(self.rig.members) > 1
        words = motion_words(details.angles, details.shares, at, several=several and not still)
        return Mode(
            number=number + 1,
            omega=omega,
            damping_ratio=float(min(1.0, max(-1.0, ratio))) + 0.0,
            multiplicity=along + across,
            family=family(
                on_cart=self.rig.cart is not None,
                still=still,
                along=along,
                across=across,
                omega=omega,
                ratio=ratio,
                motion=words,
            ),
            cart_participation=float(details.mobility[at]),
            effective_mass=on_rail,
            effective_mass_share=on_rail / self.rig.total_mass,
            effective_mass_across=effective * across if across else 0.0,
            kappa=kappa,
            linear_to_1_percent_deg=one_percent_amplitude(kappa),
            resonances=self._resonances(number) if np.isfinite(kappa) else (),
            residual=float(details.residual[at]),
            relative_error_bound=float(self.error[number]),
            indistinct=self._indistinct(number),
        )

    def _resonances(self, number: int) -> tuple[str, ...]:
        """Other modes whose frequency is within 2 % of this one's, three times it or a third of it."""
        omega, own = self.omega, self.omega[number]
        if own == 0:
            return ()
        found = []
        for name, factor in (("1:1", 1.0), ("1:3", 3.0), ("3:1", 1 / 3)):
            low, high = np.searchsorted(omega, own * factor * np.array([1 - RESONANCE, 1 + RESONANCE]))
            found += [f"{name} with mode {k + 1}" for k in range(low, min(high, low + 4)) if k != number]
        return tuple(found)

    def _indistinct(self, number: int) -> bool:
        omega, error = self.omega, self.error
        neighbours = [k for k in (number - 1, number + 1) if 0 <= k < len(omega)]
        return any(
            abs(omega[k] - omega[number]) <= error[k] * omega[k] + error[number] * omega[number] for k in neighbours
        )


def natural_modes(scene: Scene) -> Modes:
    """All modes of a scene about its hanging rest.

    Raises ComputationError where double precision or memory cannot give them.
    """
    rig = rig_of(scene)
    natural, units = rig.natural()
    with np.errstate(all="ignore"):
        families = list(_families(natural, scene.has_damping or scene.has_joint_springs))
        values = np.concatenate([family.source.eigenvalue[family.rows] for family in families])
        errors = np.concatenate([family.source.error[family.rows] for family in families])
    if not np.all(np.isfinite(values)):
        raise ComputationError("the ratios in this scene are beyond double precision")
    parts = [part for index, family in enumerate(families) for part in family.parts(index)]
    order = np.lexsort((values.real, np.abs(values)))
    cuts = [0, *(k for k in range(1, len(order)) if values[order[k]] != values[order[k - 1]]), len(order)]
    first = order[cuts[:-1]]
    return Modes(
        scene=scene,
        rig=rig,
        units=units,
        sources=tuple(family.source for family in families),
        groups=tuple(tuple(parts[k] for k in order[a:b]) for a, b in pairwise(cuts)),
        eigenvalue=values[first] * units.rate,
        error=errors[first],
        notes=_notes(natural),
    )


@dataclass(frozen=True, eq=False)
class _Family:
    """Rows of a source with their multiplicities, all (R,); `block` and `columns` where single kinds move alone."""

    source: Source
    rows: Ints
    along: Ints
    across: Ints
    block: int = -1
    columns: Ints | None = None

    def parts(self, index: int) -> Iterator[_Part]:
        kinds = repeat(None) if self.columns is None else ((self.block, column) for column in self.columns.tolist())
        numbers = zip(self.rows.tolist(), self.along.tolist(), self.across.tolist(), kinds, strict=False)
        return (_Part(index, *number) for number in numbers)


def _families(rig: Rig, is_dense: bool) -> Iterator[_Family]:
    for index, block in enumerate(rig.blocks):
        along = block.count - (1 if rig.cart else 0)
        across = block.count if rig.spatial else np.zeros_like(block.count)
        kinds = np.flatnonzero(along + across)
        for chosen in np.split(kinds, len(kinds)) if is_dense else [kinds]:
            if not chosen.size:
                continue
            alone = block.take(chosen)
            source = Dense((alone,), (alone.count,), None, 1.0) if is_dense else Alone(alone)
            rows = np.arange(len(source.eigenvalue))
            columns = chosen[rows % chosen.size]
            yield _Family(source, rows, along[columns], across[columns], index, columns)
    if rig.cart:
        yield from (_moving(source) for source in _with_cart(rig, rig.cart, is_dense))


def _with_cart(rig: Rig, cart: tuple[float, float, float], is_dense: bool) -> Iterator[Source]:
    mass, _, stiffness = cart
    heavy = tuple(block.heavier(block.count) for block in rig.blocks)
    counts = tuple(block.count for block in rig.blocks)
    mobility = bare_mobility(heavy, cart)
    if stiffness == 0:
        yield Rigid(rig.blocks, rig.total_mass, mobility)
    if is_dense:
        yield Dense(heavy, counts, cart, mobility)
    else:
        few = rig.n_kinds == 1 or sum(block.mass.size for block in heavy) <= MOST_LINKS_TOGETHER
        yield Together(heavy, counts, (CartProblem if few else Crowd)(heavy, mass, stiffness), mobility)


def _moving(source: Source) -> _Family:
    rows = np.arange(len(source.eigenvalue))
    return _Family(source, rows, np.ones_like(rows), np.zeros_like(rows))


def _notes(rig: Rig) -> tuple[str, ...]:
    if rig.cart and CartProblem(rig.blocks, rig.cart[0], rig.cart[2]).bare_mass == 0:
        return (
            "The mass matrix is singular: a massless cart over bobs has no inertia of its own, "
            "so one mode has no finite frequency and is left out.",
        )
    return ()


def _together(rig: Rig, details: Details) -> Shape:
    angles, shares = (
        np.concatenate([np.tile(values[block][:, column, 0], copies) for block, column, copies in rig.members])
        for values in (details.angles, details.shares)
    )
    return Shape(details.cart[0], angles, shares.real, across=False)


def _alone(rig: Rig, part: _Part, copy: int, details: Details) -> Shape:
    across = copy >= part.along
    copies = sum(count for block, column, count in rig.members if (block, column) == part.kind)
    weights = np.zeros(copies)
    if across or not rig.cart:
        weights[copy - part.along if across else copy] = 1.0
    else:
        weights[: copy + 1], weights[copy + 1] = 1.0, -(copy + 1.0)
        weights /= np.sqrt((copy + 1.0) * (copy + 2.0))
    one, share = details.angles[0][:, 0, 0], details.shares[0][:, 0, 0]
    angles, shares, used = [], [], 0
    for block, column, count in rig.members:
        if (block, column) == part.kind:
            own = weights[used : used + count]
            used += count
        else:
            own = np.zeros(count)
        n = rig.blocks[block].n
        angles.append(np.outer(own, one).ravel() if own.any() else np.zeros(count * n, one.dtype))
        shares.append(np.outer(own**2, share).ravel() if own.any() else np.zeros(count * n))
    return Shape(0.0, np.concatenate(angles), np.concatenate(shares), across)


def _normalised(shape: Shape, modal_mass: float, units: Units, how: str) -> Shape:
    """Cart in natural lengths and modal mass in natural units on entry; SI and the asked scale on return."""
    size = np.abs(shape.angles)
    largest = size.max()
    scale: complex = 1.0
    if largest > 0:
        leading = shape.angles[np.argmax(size >= largest * (1 - 1e-9))]
        scale = np.conj(leading) / abs(leading) / largest
    if how == "mass" or largest == 0:
        mass = modal_mass * (units.mass if how == "mass" else 1.0 / modal_mass)
        scale = (scale / abs(scale)) / (np.sqrt(mass) * units.length)
    scale = scale if np.iscomplexobj(shape.angles) else scale.real
    return Shape(shape.cart * scale * units.length, shape.angles * scale, shape.kinetic_energy_share, shape.across)
