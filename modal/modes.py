"""The modes of a scene, and what a table says about each."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import groupby, pairwise
from typing import NamedTuple, overload

import numpy as np
from numpy.typing import NDArray

from modal.amplitude import one_percent_amplitude
from modal.errors import ComputationError
from modal.families import family, motion_words
from modal.mode import UNCERTAIN, Mode
from modal.rig import Floats, Ints, Rig, Units, rig_of
from modal.routes import Part, families, notes
from modal.scene import Scene
from modal.shapes import Shape, expanded
from modal.sources import Details, Source

RESONANCE = 0.02
CHUNK = 400_000


class _Piece(NamedTuple):
    """A part of a row and its place in the details of its source."""

    part: Part
    details: Details
    at: int

    def effective_mass(self, on_cart: bool) -> float:
        """Along the rail; what swings in antiphase or across it adds nothing."""
        copies = 1 if self.part.kind is None else 0 if on_cart else self.part.along
        return float(self.details.effective_mass[self.at]) * copies if copies else 0.0

    def effective_mass_across(self) -> float:
        """Across the rail."""
        return float(self.details.effective_mass[self.at]) * self.part.across if self.part.across else 0.0


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
    groups: tuple[tuple[Part, ...], ...]
    eigenvalue: NDArray[np.complex128]
    error: Floats
    notes: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.groups)

    @overload
    def __getitem__(self, index: int) -> Mode: ...
    @overload
    def __getitem__(self, index: slice) -> list[Mode]: ...
    def __getitem__(self, index: int | slice) -> Mode | list[Mode]:
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
        """The copy-th basis vector of mode `number`, both from 0.

        `normalise` is "angle" (the largest angle is 1 rad) or "mass" (φᵀMφ = 1 in SI units).

        Equal pendula in antiphase are spanned by (1, −1, 0, …), (1, 1, −2, 0, …), … along the rail, then one
        pendulum at a time across it.  The sign makes the first of the largest angles positive.
        """
        left = copy
        for part in self.groups[number]:
            if 0 <= left < part.along + part.across:
                details = self._details(part.source, [part.row])
                return expanded(self.rig, self.units, part, left, details, normalise)
            left -= part.along + part.across
        raise IndexError(f"mode {number} has no basis vector {copy}")

    def _details(self, source: int, rows: Sequence[int]) -> Details:
        with np.errstate(all="ignore"):
            return self.sources[source].details(np.array(rows))

    def _described(self, numbers: Sequence[int]) -> Iterator[tuple[int, Mode]]:
        needed = sorted(
            ((part, n) for n in numbers for part in self.groups[n]), key=lambda entry: (entry[0].source, entry[0].row)
        )
        pieces: dict[int, list[_Piece]] = {n: [] for n in numbers}
        for source, members in groupby(needed, key=lambda entry: entry[0].source):
            found = list(members)
            details = self._details(source, [part.row for part, _ in found])
            for at, (part, n) in enumerate(found):
                pieces[n].append(_Piece(part, details, at))
        return ((n, self._mode(n, pieces[n])) for n in numbers)

    def _mode(self, number: int, pieces: list[_Piece]) -> Mode:
        """One row: sums over its pieces, and the shape of the one that moves most of the scene."""
        value, unit = self.eigenvalue[number], self.units.mass
        head = next((piece for piece in pieces if piece.part.kind is None), pieces[0])
        omega = float(abs(value))
        ratio = float(-value.real / omega) if omega > 0 else 0.0
        on_cart = self.rig.cart is not None
        effective = float(sum(piece.effective_mass(on_cart) for piece in pieces)) * unit
        kappa = float(head.details.kappa[head.at])
        return Mode(
            number=number + 1,
            omega=omega,
            damping_ratio=min(1.0, max(-1.0, ratio)) + 0.0,
            multiplicity=int(self.multiplicity[number]),
            family=self._family(number, head, omega, ratio),
            cart_participation=float(sum(p.details.mobility[p.at] for p in pieces)) if abs(ratio) < 1.0 else np.nan,
            effective_mass=effective,
            effective_mass_share=effective / self.rig.total_mass,
            effective_mass_across=float(sum(piece.effective_mass_across() for piece in pieces)) * unit,
            kappa=kappa,
            linear_to_1_percent_deg=one_percent_amplitude(kappa),
            resonances=self._resonances(number) if np.isfinite(kappa) else (),
            residual=float(max(p.details.residual[p.at] for p in pieces)),
            relative_error_bound=float(self.error[number]),
            indistinct=self._indistinct(number),
        )

    def _family(self, number: int, head: _Piece, omega: float, ratio: float) -> str:
        if self.error[number] >= UNCERTAIN:
            return "beyond double precision"
        still = head.part.kind is not None
        several = not still and sum(count for _, _, count in self.rig.members) > 1
        return family(
            on_cart=self.rig.cart is not None,
            still=still,
            along=sum(part.along for part in self.groups[number]),
            across=sum(part.across for part in self.groups[number]),
            omega=omega,
            ratio=ratio,
            motion=motion_words(head.details.angles, head.details.shares, head.at, self._names, several=several),
        )

    @cached_property
    def _names(self) -> list[str]:
        """Every kind by the first pendulum entry of the file that hangs it, block by block."""
        first: dict[tuple[int, int], int] = {}
        for entry, (block, column, _) in enumerate(self.rig.members, 1):
            first.setdefault((block, column), entry)
        return [f"pendulum {first[key]}" for key in sorted(first)]

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
    try:
        with np.errstate(all="ignore"):
            found = list(families(natural))
            values = np.concatenate([member.source.eigenvalue[member.rows] for member in found])
            errors = np.concatenate([member.source.error[member.rows] for member in found])
    except np.linalg.LinAlgError:
        raise ComputationError("the ratios in this scene are beyond double precision on its dense route") from None
    if not np.all(np.isfinite(values)):
        raise ComputationError("the ratios in this scene are beyond double precision")
    parts = [part for index, member in enumerate(found) for part in member.parts(index)]
    order = np.lexsort((values.real, np.abs(values)))
    cuts = [0, *(k for k in range(1, len(order)) if values[order[k]] != values[order[k - 1]]), len(order)]
    first = order[cuts[:-1]]
    return Modes(
        scene=scene,
        rig=rig,
        units=units,
        sources=tuple(member.source for member in found),
        groups=tuple(tuple(parts[k] for k in order[a:b]) for a, b in pairwise(cuts)),
        eigenvalue=np.asarray(values[first] * units.rate, dtype=np.complex128),
        error=errors[first],
        notes=notes(natural),
    )
