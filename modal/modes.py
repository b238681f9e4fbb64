"""The modes of a scene, and what a table says about each."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import groupby, pairwise
from typing import overload

import numpy as np
from numpy.typing import NDArray

from modal.amplitude import one_percent_amplitude
from modal.errors import ComputationError
from modal.families import family, motion_words
from modal.rig import Floats, Ints, Rig, Units, rig_of
from modal.routes import Part, families, notes
from modal.scene import Scene
from modal.shapes import Shape, expanded
from modal.sources import Details, Source

RESONANCE = 0.02
CHUNK = 4_000_000


@dataclass(frozen=True)
class Mode:
    """One distinct natural frequency.

    `omega` (rad/s) is |λ| of the eigenvalue λ, `damping_ratio` −Re λ/|λ| (1: overdamped, below 0: unstable);
    `cart_participation` is this mode's share of the cart's response to a sudden push (undamped modes sum to 1);
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
        several = sum(count for _, _, count in self.rig.members) > 1
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
            cart_participation=float(details.mobility[at]) if abs(ratio) < 1.0 else np.nan,
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
        found = list(families(natural, scene.has_damping or scene.has_joint_springs))
        values = np.concatenate([member.source.eigenvalue[member.rows] for member in found])
        errors = np.concatenate([member.source.error[member.rows] for member in found])
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
