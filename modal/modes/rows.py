"""The rows of the table of modes: sums over the parts of each mode, its description and its resonances."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import groupby
from math import isfinite, radians
from typing import NamedTuple

import numpy as np

from modal.assembly import Block, Rig
from modal.eigen import UNCERTAIN, Details, ModeSwing, SpectrumPart, distortion, largest_angle, one_percent_amplitude
from modal.errors import ComputationError
from modal.modes.eigenvalues import Eigenvalues
from modal.modes.labels import (
    CART_MOVES,
    CART_STILL,
    FIXED,
    FREE,
    STRUCTURE_STILL,
    agreement,
    family,
    following,
    motion_words,
    moving_words,
)
from modal.modes.mode import BESIDE, PROMISED, SURE, Mode, answering, is_guide, resonances
from modal.modes.second_order import UNKNOWN, Amplitude
from modal.modes.shapes import expand, first_of_largest, is_balanced
from modal.structure import coordinate_units
from modal.types import Floats, Ints

BEYOND_DOUBLE = "beyond double precision"
LIGHTLY = 0.1
"""Damping ratio up to which a mode has an amplitude coefficient, as in `modal.eigen.structured`."""


class _RowPart(NamedTuple):
    """A part of a row and its place in the details of its source."""

    part: SpectrumPart
    details: Details
    at: int

    def effective_mass(self, rig: Rig) -> float:
        """Effective mass along the rail; shapes that hold a cart still or move across the rail contribute nothing.

        Combinations of pendula in different places that hold a structure still may push it.
        """
        balanced = is_balanced(rig, self.part) and not (rig.structure and self.part.kind is None)
        return 0.0 if balanced or not self.part.along else self._effective_mass() * self.part.along

    def effective_mass_across(self) -> float:
        """Effective mass across the rail."""
        return self._effective_mass() * self.part.across if self.part.across else 0.0

    def _effective_mass(self) -> float:
        return float(self.details.effective_mass[self.at])


def _head(pieces: list[_RowPart]) -> _RowPart:
    """The piece that moves most of the scene."""
    return next((piece for piece in pieces if not piece.part.still), pieces[0])


def described(modes: Eigenvalues, numbers: Sequence[int]) -> Iterator[tuple[int, Mode]]:
    """The rows of the modes with these indices (from 0), each with its index, in this order."""
    structured = modes.scene.is_structured  # whose resonances are those of `_shaking`
    near = {n: () if structured else _resonances(modes, n) for n in numbers}
    asked = {n: [] if near[n] or structured else answering(modes.omega, n, _partners(modes, n)) for n in numbers}
    pieces = _pieces(modes, sorted({*numbers, *(k for pairs in asked.values() for _, k in pairs)}))
    for n in numbers:
        mode = _mode(modes, n, pieces[n])
        if structured and isfinite(mode.kappa):
            yield n, _shaking(modes, mode, _head(pieces[n]).part)
            continue
        answers = _answers(modes, n, asked[n], pieces) if isfinite(mode.kappa) and mode.kappa and not near[n] else []
        yield n, replace(mode, resonances=(*near[n], *answers) if isfinite(mode.kappa) else ())


def _shaking(modes: Eigenvalues, mode: Mode, part: SpectrumPart) -> Mode:
    """A mode that leaves its structure still to first order, with what the structure does at twice its frequency.

    Of several shapes of one frequency it is that of the first, with a star: they differ, and exchange energy.
    """
    if not modes.pivots_sink:
        return mode
    if modes.supported is None:
        return _with_amplitude(mode, UNKNOWN, ())
    details = modes.spectrum.details(part.source, [part.row])
    shape = expand(modes.rig, modes.units, part, 0, details, "angle", uncertain=mode.is_uncertain)
    if not modes.supported.pushes(shape).any():
        return mode
    amplitude = modes.supported.amplitude(shape, mode.omega, mode.kappa)
    far = abs(amplitude.one_percent_deg / one_percent_amplitude(amplitude.kappa) - 1)
    # Of the next order in a, which terms of opposite sign in κ leave large beside their sum.
    missed = 0.01 * (mode.kappa**2 + (amplitude.kappa - mode.kappa) ** 2) / amplitude.kappa**2
    near = [] if far + missed <= PROMISED else [f"1:2 with {modes.moving_near(2 * mode.omega)}"]
    several = [f"1:1 among its own {mode.multiplicity} shapes"] if mode.multiplicity > 1 else []
    return _with_amplitude(mode, amplitude, (*several, *near))


def _with_amplitude(mode: Mode, amplitude: Amplitude, resonances: tuple[str, ...]) -> Mode:
    return replace(
        mode, kappa=amplitude.kappa, linear_to_1_percent_deg=amplitude.one_percent_deg, resonances=resonances
    )


def _pieces(modes: Eigenvalues, numbers: Sequence[int]) -> dict[int, list[_RowPart]]:
    needed = sorted(
        ((part, n) for n in numbers for part in modes.spectrum.groups[n]),
        key=lambda entry: (entry[0].source, entry[0].row),
    )
    pieces: dict[int, list[_RowPart]] = {n: [] for n in numbers}
    for source, members in groupby(needed, key=lambda entry: entry[0].source):
        numbers_of = list(members)
        for (part, n), place in zip(
            numbers_of, _details(modes, source, [part.row for part, _ in numbers_of]), strict=True
        ):
            pieces[n] += [_RowPart(part, *place)] if place else []
    return pieces


def _details(modes: Eigenvalues, source: int, rows: list[int]) -> list[tuple[Details, int] | None]:
    """The details of each row of a source and its place in them; None where double precision does not suffice."""
    try:
        details = modes.spectrum.details(source, rows)
    except ComputationError:
        return [None] if len(rows) == 1 else [_details(modes, source, [row])[0] for row in rows]
    return [(details, at) for at in range(len(rows))]


def _mode(modes: Eigenvalues, number: int, pieces: list[_RowPart]) -> Mode:
    """One row: sums over its pieces, and the shape of the one that moves most of the scene."""
    ratio, unit = float(modes.damping_ratio[number]), modes.units.mass
    if not pieces:
        return _without_shape(modes, number, ratio)
    head = _head(pieces)
    certain = 1.0 if modes.error[number] < UNCERTAIN else np.nan
    effective = certain * unit * sum(piece.effective_mass(modes.rig) for piece in pieces)
    light = not modes.is_classical or ratio < LIGHTLY
    kappa = certain * float(head.details.kappa[head.at]) if light else np.nan
    return Mode(
        number=modes.first + number + 1,
        omega=float(modes.omega[number]),
        damping_ratio=ratio,
        multiplicity=int(modes.multiplicity[number]),
        family=_family(modes, number, head, ratio),
        cart_participation=certain * float(sum(p.details.participation[p.at] for p in pieces)),
        effective_mass=effective,
        effective_mass_share=effective / modes.rig.total_mass,
        effective_mass_across=certain * unit * sum(piece.effective_mass_across() for piece in pieces),
        kappa=kappa,
        linear_to_1_percent_deg=one_percent_amplitude(kappa),
        resonances=(),
        residual=float(max(p.details.residual[p.at] for p in pieces)),
        relative_error_bound=float(modes.error[number]),
        indistinct=bool(modes.indistinct[number]),
    )


def _without_shape(modes: Eigenvalues, number: int, ratio: float) -> Mode:
    """The row of a mode of which no more than the frequency is known."""
    unknown = dict.fromkeys(
        (
            *("cart_participation", "effective_mass", "effective_mass_share", "effective_mass_across"),
            *("kappa", "linear_to_1_percent_deg", "residual"),
        ),
        np.nan,
    )
    return Mode(
        number=modes.first + number + 1,
        omega=float(modes.omega[number]),
        damping_ratio=ratio,
        multiplicity=int(modes.multiplicity[number]),
        family=f"its shape is {BEYOND_DOUBLE}",
        resonances=(),
        relative_error_bound=float(modes.error[number]),
        indistinct=bool(modes.indistinct[number]),
        **unknown,
    )


def _family(modes: Eigenvalues, number: int, head: _RowPart, ratio: float) -> str:
    if np.isnan(ratio):
        return BEYOND_DOUBLE
    details, at = head.details, head.at
    if modes.rig.structure:
        return _on_structure(modes, number, head, ratio)
    if modes.eigenvalue[number] == 0:
        return "rigid translation"
    still = head.part.still or details.cart[at] == 0
    folds = dict.fromkeys(("", "antiphase", "across the rail"), 0)
    for part in modes.spectrum.groups[number]:
        folds["antiphase" if part.still and modes.on_cart else ""] += part.along
        folds["across the rail" if modes.on_cart else ""] += part.across
    if head.part.still:
        words = _whose(modes, number, head.part)
    else:
        several = sum(count for _, _, count in modes.rig.members) > 1
        names = list(modes.rig.names.values())
        words = agreement(details.angles, details.shares, at, names, several=several, still=still)
        if words in ("", "in phase") and not still and modes.rig.cart and modes.rig.cart.stiffness:
            pivots = [np.full(angles.shape[1], details.cart[at]) for angles in details.angles]
            words = following(details.angles, details.shares, pivots, at, several=several) or words
    return family(
        where=FIXED if not modes.on_cart else CART_STILL if still else CART_MOVES,
        folds=folds,
        motion=motion_words(details.angles, details.shares, at, words),
        ratio=ratio,
    )


def moved_by(modes: Eigenvalues, number: int) -> tuple[Floats, Floats]:
    """How a mode moves the coordinates (d,) of a structure where its largest angle is 1 rad, and its share of a push.

    Where no link moves the largest displacement is 1 of its unit; of equal frequencies one shape is taken that moves
    the structure.  The shares are those of the velocity of each coordinate just after a sudden push on it; they are NaN
    with dampers.
    """
    structure = modes.rig.structure
    assert structure is not None
    motion, share, taken = np.zeros(structure.size), np.zeros(structure.size), False
    for part in (part for part in modes.spectrum.groups[number] if not part.still):
        details = modes.spectrum.details(part.source, [part.row])
        eta = np.array([coordinates[0] for coordinates in details.eta])
        carried = modes.spectrum.sources[part.source].reduced.carried  # type: ignore[attr-defined]
        share = share + np.abs(eta) ** 2 / details.modal_mass[0] / carried.accelerances
        if not taken and eta.any():
            moved = eta * np.array(coordinate_units(structure, modes.units.length))
            angles = np.concatenate([details.angles[block][:, column, 0] for block, column, _ in modes.rig.members])
            leading = first_of_largest(angles) or moved[np.abs(moved).argmax()]
            motion, taken = (moved / leading).real + 0.0, True
    return motion, share if not modes.rig.is_damped else np.full(structure.size, np.nan)


def _on_structure(modes: Eigenvalues, number: int, head: _RowPart, ratio: float) -> str:
    structure, details, at = modes.rig.structure, head.details, head.at
    assert structure is not None
    eta = np.array([part[at] for part in details.eta]) if not head.part.still else np.zeros(structure.size)
    source = modes.spectrum.sources[head.part.source]
    inertia = source.reduced.carried.inertia if eta.any() else eta  # type: ignore[attr-defined]
    words = moving_words(structure, eta, inertia) if eta.any() else ""
    parts = modes.spectrum.groups[number]
    folds = {"": sum(part.along for part in parts if not is_balanced(modes.rig, part))}
    folds["antiphase"] = sum(part.along for part in parts) - folds[""]
    if modes.eigenvalue[number] == 0:
        return family(where=words, folds=folds, motion=FREE, ratio=ratio)
    motion = ""
    if head.part.still:
        motion = motion_words(details.angles, details.shares, at, _whose(modes, number, head.part))
    elif any(angle[:, :, at].any() for angle in details.angles):
        several = sum(count for _, _, count in modes.rig.members) > 1
        names = list(modes.rig.names.values())
        told = agreement(details.angles, details.shares, at, names, several=several, still=True)
        pivots = [rows @ eta for rows in source.reduced.carried.pivots] if words else []  # type: ignore[attr-defined]
        told = following(details.angles, details.shares, pivots, at, several=several) or told
        motion = motion_words(details.angles, details.shares, at, told)
    where = words or (STRUCTURE_STILL if structure.size else FIXED)
    return family(where=where, folds=folds, motion=motion, ratio=ratio)


def _whose(modes: Eigenvalues, number: int, part: SpectrumPart) -> str:
    """The pendula that move while the others are at rest, where there are different ones."""
    kinds = {other.kind for other in modes.spectrum.groups[number]}
    if modes.rig.n_kinds == 1 or part.kind is None or len(kinds) > 1:
        return ""
    return modes.rig.names[part.kind]


def _resonances(modes: Eigenvalues, number: int) -> tuple[str, ...]:
    """Resonances with modes that can exchange energy: on a cart all, on a fixed support the same pendulum's."""
    parts = modes.spectrum.groups[number]
    fold = modes.multiplicity[number] if modes.on_cart else 1 + any(part.along and part.across for part in parts)
    among = (f"1:1 among its own {fold} shapes",) if fold > 1 else ()
    return among + resonances(modes.omega, number, _partners(modes, number), modes.first)


def _partners(modes: Eigenvalues, number: int) -> Ints:
    if modes.on_cart:
        return np.flatnonzero(modes.lightly_damped)
    kinds = {part.kind for part in modes.spectrum.groups[number]}
    partners = np.array(sorted({row for kind in kinds for row in modes.spectrum.numbers_of_kind[kind]}))
    return np.asarray(partners[modes.lightly_damped[partners]])


def _answers(
    modes: Eigenvalues, number: int, asked: list[tuple[int, int]], pieces: dict[int, list[_RowPart]]
) -> list[str]:
    """The modes whose responses make a mode's angle of 1 % a guide, in words: those that change it most.

    Shapes of other symmetry are not driven: equal pendula in antiphase do not drive shapes in which they move alike.
    """
    head = _head(pieces[number])
    kappa = float(head.details.kappa[head.at])
    alike = [(k, n, piece) for k, n in asked for piece in pieces[n] if piece.part.kind == head.part.kind]
    if not alike:
        return []
    swings = [(harmonic, _swing(modes, partner, piece)) for harmonic, partner, piece in alike]
    error, *changes = distortion(_blocks(modes, head.part), _swing(modes, number, head), swings, kappa).tolist()
    ratios = (modes.omega[partner] / modes.omega[number] / harmonic for harmonic, partner, _ in alike)
    shares = [1.0 if abs(ratio - 1) < BESIDE else SURE for ratio in ratios]
    doubt = sum(share * abs(change) for share, change in zip(shares, changes, strict=True) if change)
    if not is_guide(radians(one_percent_amplitude(kappa)), error, doubt):
        return []
    most = max(map(abs, changes))
    named = [
        f"1:{harmonic} with mode {modes.first + partner + 1}"
        for (harmonic, partner, _), change in zip(alike, changes, strict=True)
        if abs(change) >= min(most, PROMISED)
    ]
    return list(dict.fromkeys(named))


def _swing(modes: Eigenvalues, number: int, piece: _RowPart) -> ModeSwing:
    details, at = piece.details, [piece.at]
    angles = tuple(angle[:, :, at].real for angle in details.angles)
    largest = largest_angle(angles)
    return ModeSwing(
        x=np.abs(modes.spectrum.eigenvalue[[number]]) ** 2,
        modal_mass=details.modal_mass[at] / largest**2,
        cart=details.cart[at].real / largest,
        angles=tuple(angle / largest for angle in angles),
    )


def _blocks(modes: Eigenvalues, part: SpectrumPart) -> tuple[Block, ...]:
    """What moves in the shapes of a part, in natural units: one chain, or all as heavy as their copies."""
    blocks = modes.natural.blocks
    if part.kind:
        block, column = part.kind
        return (blocks[block].take(np.array([column])),)
    return tuple(block.heavier(block.count) for block in blocks)
