"""The modes of a scene, and the properties of each for a table."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from itertools import groupby
from math import isfinite
from typing import Any, NamedTuple, TypeVar, overload

import numpy as np
from numpy.typing import NDArray

from modal.assembly import Block, Matrices, Rig, Units, matrices_of, rig_of
from modal.eigen import (
    LIGHT,
    Details,
    Limits,
    Part,
    Spectrum,
    Swing,
    distortion,
    find_spectrum,
    largest_angle,
    notes,
    one_percent_amplitude,
)
from modal.modes.labels import CART_MOVES, CART_STILL, FIXED, agreement, family, motion_words
from modal.modes.mode import MOST_DISTORTED, UNCERTAIN, Mode, answering, resonances
from modal.modes.shapes import Shape, expand, validate_normalisation
from modal.scene import Scene
from modal.types import Booleans, Floats, Ints

GROWING = "Growing modes get nothing of the scene's damping_ratio, which belongs to modes that oscillate."
HOISTED = "Lengths change with the hoist: these are the modes at the lengths before it; hoist lists them along it."
SELECTED = "Only some of the modes were computed, and resonances among these alone."
AT_REST = "The support's motion is left out: the modes are those about a support at rest."
RUBBING = "Dry friction is left out: at an amplitude it acts as a damping ratio, and in the end it stops a swing."
FAST_AIR = "Quadratic drag is left out: it dies out with the square of the speed."
UNDRIVEN = "Drives are left out: they sustain small swings without changing the modes."
CHUNK = 400_000
LIGHTLY = 0.1
"""Damping ratio up to which a mode has an amplitude coefficient, as in `modal.eigen.matrix_source`."""
A = TypeVar("A", bound=NDArray[Any])


class _Piece(NamedTuple):
    """A part of a row and its place in the details of its source."""

    part: Part
    details: Details
    at: int

    def effective_mass(self, on_cart: bool) -> float:
        """Effective mass along the rail; shapes that hold a cart still or move across the rail contribute nothing."""
        balanced = self.part.still and on_cart
        return 0.0 if balanced or not self.part.along else self._effective_mass() * self.part.along

    def effective_mass_across(self) -> float:
        """Effective mass across the rail."""
        return self._effective_mass() * self.part.across if self.part.across else 0.0

    def _effective_mass(self) -> float:
        return float(self.details.effective_mass[self.at])


def _head(pieces: list[_Piece]) -> _Piece:
    """The piece that moves most of the scene."""
    return next((piece for piece in pieces if not piece.part.still), pieces[0])


@dataclass(frozen=True, eq=False)
class ModalMatrix:
    """Φ (n, C): every shape as a column with φᵀMφ = 1, the cart (if there is one) first, then all links.

    `row` and `copy` (C,), both from 0, give the position of a shape in the table, `across` (C,) whether it moves across
    the rail, where M is different.
    """

    shapes: NDArray[Any]
    row: Ints
    copy: Ints
    across: Booleans
    M: Floats

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


def omitted(scene: Scene) -> tuple[str, ...]:
    """What the linear model of a scene leaves out, a sentence each."""
    quadratic = any(link.quadratic_drag for link in scene.links())
    return (
        *[HOISTED] * scene.is_hoisted,
        *[UNDRIVEN] * scene.is_driven,
        *[AT_REST] * scene.is_moved,
        *[RUBBING] * scene.has_friction,
        *[FAST_AIR] * quadratic,
    )


@dataclass(frozen=True, eq=False)
class Modes(Sequence[Mode]):
    """All modes of a scene in ascending order of natural frequency, one entry for each distinct one.

    `eigenvalue`, `omega`, `multiplicity` and `error`, all (R,) and read-only, are available for all of them; indexing
    computes a `Mode`.  `rig` is the scene as arrays, `spectrum` the source of each mode in natural `units`;
    `first` is the index of the first of them among all modes of the scene, of which only some were `selected`.
    """

    scene: Scene
    rig: Rig
    units: Units
    spectrum: Spectrum
    first: int = 0
    selected: bool = False

    def __len__(self) -> int:
        return len(self.spectrum.eigenvalue)

    @overload
    def __getitem__(self, index: int) -> Mode: ...
    @overload
    def __getitem__(self, index: slice) -> list[Mode]: ...
    def __getitem__(self, index: int | slice) -> Mode | list[Mode]:
        try:
            chosen = range(len(self))[index]
        except IndexError:
            raise IndexError(self._no_index(index)) from None
        return list(self.rows(chosen)) if isinstance(chosen, range) else next(self.rows([chosen]))

    def _no_index(self, index: object) -> str:
        of_number = f"; mode {index} of the table is modes[{index - 1}]" if index == len(self) else ""
        return f"there is no mode of index {index}: {len(self)} modes have indices 0 to {len(self) - 1}{of_number}"

    def __iter__(self) -> Iterator[Mode]:
        return self.rows(range(len(self)))

    @cached_property
    def eigenvalue(self) -> NDArray[np.complex128]:
        """λ (R,) in rad/s: iω for undamped modes, −ζω + iω√(1−ζ²) for damped ones."""
        return _kept(self.spectrum.eigenvalue * self.units.rate)

    @cached_property
    def omega(self) -> Floats:
        """Natural frequencies |λ| (R,) in rad/s."""
        return _kept(np.abs(self.eigenvalue))

    @property
    def multiplicity(self) -> Ints:
        """The number of independent modes with each frequency, (R,)."""
        return _kept(self.spectrum.multiplicity.view())

    @property
    def error(self) -> Floats:
        """Bounds on the relative errors of `eigenvalue`, (R,)."""
        return _kept(self.spectrum.error.view())

    @cached_property
    def matrices(self) -> Matrices:
        """M, K and D of the scene along the rail; ComputationError where it is too large for dense matrices."""
        return matrices_of(self.rig)

    @cached_property
    def matrix(self) -> ModalMatrix:
        """The modal matrix Φ of all modes and copies, in the order of the table."""
        each = [(row, copy, one) for row, own in enumerate(all_shapes(self)) for copy, one in enumerate(own)]
        row, copy = (np.array([entry[part] for entry in each], dtype=np.int64) for part in (0, 1))
        across = np.array([shape.across for _, _, shape in each], dtype=bool)
        return ModalMatrix(np.array([self.column(one) for _, _, one in each]).T, row, copy, across, self.matrices.M)

    def column(self, shape: Shape) -> NDArray[Any]:
        """A shape as one vector (n,): the cart, if there is one, then every link in the order of the file."""
        return np.concatenate(([shape.cart], shape.angles)) if self.on_cart else shape.angles

    @cached_property
    def notes(self) -> tuple[str, ...]:
        """What was omitted or approximated, and why."""
        with np.errstate(all="ignore"):
            found = notes(self._natural, self.spectrum.sources)
        grows = self.scene.has_modal_damping and bool(((self.eigenvalue.real > 0) & (self.eigenvalue.imag == 0)).any())
        return *found, *[GROWING] * grows, *omitted(self.scene), *[SELECTED] * self.selected

    @cached_property
    def route(self) -> str:
        """The routes taken, in words."""
        used = {part.source for parts in self.spectrum.groups for part in parts}
        return ", ".join(dict.fromkeys(self.spectrum.sources[source].route for source in sorted(used)))

    def rows(self, numbers: Sequence[int]) -> Iterator[Mode]:
        """The modes with these indices (from 0), computed together, a bounded amount of memory at a time."""
        size = max(1, CHUNK // max(1, sum(block.mass.size for block in self.rig.blocks)))
        for start in range(0, len(numbers), size):
            chunk = numbers[start : start + size]
            with np.errstate(all="ignore"):
                found = dict(self._described(chunk))
            yield from (found[number] for number in chunk)

    def shape(self, number: int, copy: int = 0, normalise: str = "angle") -> Shape:
        """The copy-th basis vector of the mode with index `number`, both from 0 (`Mode.number` counts from 1).

        `normalise` is "angle" (the largest angle is 1 rad; where there is none, the cart moves 1 m) or "mass"
        (φᵀMφ = 1).  The vectors of one row are orthogonal in M: equal pendula in antiphase are spanned by
        (1, −1, 0, …), (1, 1, −2, 0, …), … along the rail, then one pendulum at a time across it; different pendula
        of equal frequency as in `modal.eigen.degenerate`.  The sign makes the first of the largest angles positive.
        Where no digit of the frequency is certain, `Shape.uncertain` is set. Raises IndexError for a mode or
        copy that does not exist, ValueError for another normalisation.
        """
        how, left = validate_normalisation(normalise), copy
        for part in self.spectrum.groups[number]:
            if 0 <= left < part.along + part.across:
                details = self.spectrum.details(part.source, [part.row_of(left)])
                uncertain = bool(self.error[number] >= UNCERTAIN)
                return expand(self.rig, self.units, part, left, details, how, uncertain=uncertain)
            left -= part.along + part.across
        raise IndexError(f"mode index {number} has {self.multiplicity[number]} basis vectors: there is no index {copy}")

    def _described(self, numbers: Sequence[int]) -> Iterator[tuple[int, Mode]]:
        near = {n: self._resonances(n) for n in numbers}
        asked = {n: [] if near[n] else answering(self.omega, n, self._partners(n)) for n in numbers}
        pieces = self._pieces(sorted({*numbers, *(k for found in asked.values() for _, k in found)}))
        for n in numbers:
            mode = self._mode(n, pieces[n])
            answers = [
                f"1:{harmonic} with mode {self.first + k + 1}"
                for harmonic, k in asked[n]
                if mode.kappa and self._distortion(harmonic, (n, pieces[n]), (k, pieces[k])) > MOST_DISTORTED
            ]
            yield n, replace(mode, resonances=(*near[n], *answers) if isfinite(mode.kappa) else ())

    def _pieces(self, numbers: Sequence[int]) -> dict[int, list[_Piece]]:
        needed = sorted(
            ((part, n) for n in numbers for part in self.spectrum.groups[n]),
            key=lambda entry: (entry[0].source, entry[0].row),
        )
        pieces: dict[int, list[_Piece]] = {n: [] for n in numbers}
        for source, members in groupby(needed, key=lambda entry: entry[0].source):
            found = list(members)
            details = self.spectrum.details(source, [part.row for part, _ in found])
            for at, (part, n) in enumerate(found):
                pieces[n].append(_Piece(part, details, at))
        return pieces

    def _mode(self, number: int, pieces: list[_Piece]) -> Mode:
        """One row: sums over its pieces, and the shape of the one that moves most of the scene."""
        value, unit = self.eigenvalue[number], self.units.mass
        head = _head(pieces)
        omega = float(abs(value))
        certain = 1.0 if self.error[number] < UNCERTAIN else np.nan
        ratio = certain * float(np.clip(-value.real / omega, -1.0, 1.0) + 0.0 if omega > 0 else 0.0)
        effective = certain * unit * sum(piece.effective_mass(self.on_cart) for piece in pieces)
        light = not self.is_classical or ratio < LIGHTLY
        kappa = certain * float(head.details.kappa[head.at]) if light else np.nan
        return Mode(
            number=self.first + number + 1,
            omega=omega,
            damping_ratio=ratio,
            multiplicity=int(self.multiplicity[number]),
            family=self._family(number, head, ratio),
            cart_participation=certain * float(sum(p.details.participation[p.at] for p in pieces)),
            effective_mass=effective,
            effective_mass_share=effective / self.rig.total_mass,
            effective_mass_across=certain * unit * sum(piece.effective_mass_across() for piece in pieces),
            kappa=kappa,
            linear_to_1_percent_deg=one_percent_amplitude(kappa),
            resonances=(),
            residual=float(max(p.details.residual[p.at] for p in pieces)),
            relative_error_bound=float(self.error[number]),
            indistinct=self._indistinct(number),
        )

    @property
    def is_classical(self) -> bool:
        """Whether all dampers are those of a `damping_ratio`, which leave the undamped shapes as they are."""
        return self.scene.has_modal_damping and not self.scene.has_dampers

    @property
    def on_cart(self) -> bool:
        """Whether the support is a cart."""
        return self.rig.cart is not None

    def _family(self, number: int, head: _Piece, ratio: float) -> str:
        if np.isnan(ratio):
            return "beyond double precision"
        if self.eigenvalue[number] == 0:
            return "rigid translation"
        details, at = head.details, head.at
        still = head.part.still or details.cart[at] == 0
        folds = dict.fromkeys(("", "antiphase", "across the rail"), 0)
        for part in self.spectrum.groups[number]:
            folds["antiphase" if part.still and self.on_cart else ""] += part.along
            folds["across the rail" if self.on_cart else ""] += part.across
        if head.part.still:
            words = self._whose(number, head.part)
        else:
            several = sum(count for _, _, count in self.rig.members) > 1
            names = list(self.rig.names.values())
            words = agreement(details.angles, details.shares, at, names, several=several, still=still)
        return family(
            where=FIXED if not self.on_cart else CART_STILL if still else CART_MOVES,
            folds=folds,
            motion=motion_words(details.angles, details.shares, at, words),
            ratio=ratio,
        )

    def _whose(self, number: int, part: Part) -> str:
        """The pendula that move while the others are at rest, where there are different ones."""
        kinds = {other.kind for other in self.spectrum.groups[number]}
        if self.rig.n_kinds == 1 or part.kind is None or len(kinds) > 1:
            return ""
        return self.rig.names[part.kind]

    def _resonances(self, number: int) -> tuple[str, ...]:
        """Resonances with modes that can exchange energy: on a cart all, on a fixed support the same pendulum's."""
        parts = self.spectrum.groups[number]
        fold = self.multiplicity[number] if self.on_cart else 1 + any(part.along and part.across for part in parts)
        own = (f"1:1 among its own {fold} shapes",) if fold > 1 else ()
        return own + resonances(self.omega, number, self._partners(number), self.first)

    def _partners(self, number: int) -> Ints:
        if self.on_cart:
            return np.flatnonzero(self._swings)
        kinds = {part.kind for part in self.spectrum.groups[number]}
        partners = np.array(sorted({row for kind in kinds for row in self.spectrum.numbers_of_kind[kind]}))
        return np.asarray(partners[self._swings[partners]])

    def _distortion(self, harmonic: int, own: tuple[int, list[_Piece]], other: tuple[int, list[_Piece]]) -> float:
        """The relative change of a mode's angle of 1 % by another mode's response: between shapes that move alike.

        Shapes of other symmetry are not driven: equal pendula in antiphase do not drive shapes in which they move
        alike.
        """
        (number, pieces), (partner, others) = own, other
        head = _head(pieces)
        kappa = np.array([head.details.kappa[head.at]])
        found = [
            distortion(self._blocks(head.part), self._swing(number, head), self._swing(partner, piece), harmonic, kappa)
            for piece in others
            if piece.part.kind == head.part.kind
        ]
        return float(np.abs(found).max(initial=0.0))

    def _swing(self, number: int, piece: _Piece) -> Swing:
        details, at = piece.details, [piece.at]
        angles = tuple(angle[:, :, at].real for angle in details.angles)
        largest = largest_angle(angles)
        return Swing(
            x=np.abs(self.spectrum.eigenvalue[[number]]) ** 2,
            modal_mass=details.modal_mass[at] / largest**2,
            cart=details.cart[at].real / largest,
            angles=tuple(angle / largest for angle in angles),
        )

    def _blocks(self, part: Part) -> tuple[Block, ...]:
        """What moves in the shapes of a part, in natural units: one chain, or all as heavy as their copies."""
        blocks = self._natural.blocks
        if part.kind:
            block, column = part.kind
            return (blocks[block].take(np.array([column])),)
        return tuple(block.heavier(block.count) for block in blocks)

    @cached_property
    def _natural(self) -> Rig:
        return self.rig.natural()[0]

    @cached_property
    def _swings(self) -> Booleans:
        """The modes that are at most lightly damped, ζ < 0.1."""
        return np.asarray(np.abs(self.eigenvalue.real) < LIGHT * np.abs(self.eigenvalue))

    def _indistinct(self, number: int) -> bool:
        omega, error = self.omega, self.error
        neighbours = [k for k in (number - 1, number + 1) if 0 <= k < len(omega)]
        return any(
            abs(omega[k] - omega[number]) <= error[k] * omega[k] + error[number] * omega[number] for k in neighbours
        )


def natural_modes(scene: Scene, *, accuracy: float | None = None, modes: slice | None = None) -> Modes:
    """All modes of a scene about its equilibrium: hanging, or as `equilibrium` specifies.

    With an `accuracy`, relative in ω, the eigenvalues of a dense matrix are used where they are known to be within it,
    at less cost for chains of more than ten links; without, every digit is right.  `modes` selects the modes to
    compute, counted from 0: `slice(0, 3)` of a long chain costs little.

    >>> from modal import load
    >>> [round(mode.frequency, 4) for mode in natural_modes(load("rope"), modes=slice(1, 4))]
    [1.3758, 2.1569, 2.939]

    Raises ComputationError where double precision or memory does not suffice, ValueError for an accuracy that is not
    positive or a slice with a step.  Methods and their sources are given in the modules that `modal.eigen.spectrum`
    chooses from.
    """
    limits = Limits(validate_accuracy(accuracy), _lowest(modes))
    rig = rig_of(scene)
    with np.errstate(all="ignore"):
        natural, units = rig.natural()
        found = find_spectrum(natural, limits)
    if modes is None:
        return Modes(scene, rig, units, found)
    first, last, _ = modes.indices(len(found.eigenvalue))
    return Modes(scene, rig, units, found.take(slice(first, last)), first, selected=True)


def validate_accuracy(accuracy: float | None) -> float:
    """The accuracy, 0 for every digit; ValueError for an invalid one."""
    if accuracy is not None and not 0 < accuracy < 1:
        raise ValueError(f"accuracy = {accuracy}: must be above 0 and below 1, or None for every digit")
    return accuracy or 0.0


def _lowest(modes: slice | None) -> int | None:
    """The number of lowest modes that a slice needs, None for all."""
    if modes is None:
        return None
    if modes.step not in {None, 1}:
        raise ValueError(f"modes = {modes}: a slice with a step is not supported")
    backwards = (modes.start or 0) < 0 or modes.stop is None or modes.stop < 0
    return None if backwards else int(modes.stop)


def all_shapes(modes: Modes) -> list[list[Shape]]:
    """`modes.shape(number, copy, "mass")` for every mode and copy."""
    groups, rows = modes.spectrum.groups, _rows(modes)
    details = {source: modes.spectrum.details(source, list(own)) for source, own in rows.items()}

    def shape(part: Part, copy: int, uncertain: bool) -> Shape:
        row = _row(details[part.source], rows[part.source][part.row_of(copy)])
        return expand(modes.rig, modes.units, part, copy, row, "mass", uncertain=uncertain)

    return [
        [shape(part, copy, bool(error >= UNCERTAIN)) for part in parts for copy in range(part.along + part.across)]
        for parts, error in zip(groups, modes.error, strict=True)
    ]


def _rows(modes: Modes) -> dict[int, dict[int, int]]:
    """The required rows of every source, with their positions among these."""
    found: dict[int, dict[int, int]] = {}
    for part in (part for parts in modes.spectrum.groups for part in parts):
        own = found.setdefault(part.source, {})
        for copy in range(part.along + part.across):
            own.setdefault(part.row_of(copy), len(own))
    return found


def _row(details: Details, at: int) -> Details:
    """One row of the details, the last axis of every array."""
    one: dict[str, Any] = {}
    for field in fields(details):
        value = getattr(details, field.name)
        one[field.name] = tuple(part[..., [at]] for part in value) if isinstance(value, tuple) else value[[at]]
    return Details(**one)


def _kept(values: A) -> A:
    """A read-only array."""
    values.flags.writeable = False
    return values
