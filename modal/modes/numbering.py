"""Correspondence between the modes of a scene and those without its dampers or with its cart fixed.

Each mode has one number, that in the table of the scene with dampers.  A scene without them, or with its cart fixed,
has different modes, and each of these gets the number of the most similar one.  The similarity of rows r and s, of
shapes φ and ψ, is

    w_rs = Σ |φᴴMψ|² / ((φᴴMφ)(ψᴴMψ))        over all pairs of their shapes along the rail,

the modal assurance criterion with M as weight [Allemang2003]; rows are paired one to
one, the most similar first.

A damped mode has no real shape, of which its modal effective mass (φᵀMe)²/(φᵀMφ) would be.  Where the damping ratio is
below LIGHT and w at least SHAPE_MAC_MIN for each shape, the undamped mode represents it: 1 − w is of second order in
the effect of dampers, so that the masses are right to some √(1 − SHAPE_MAC_MIN).

On a free cart the rigid translation has all of the effective mass, and every other mode none: it leaves the centre of
mass at rest. With the cart fixed, the same pendula swing in their fixed-base modes ψ, K ψ = ω² A ψ, of effective mass

    μ = (ψᵀb)²/(ψᵀAψ), Σ μ = mass of the pendula − their residual mass.

The squares of the n nonzero frequencies on the cart and those of the n fixed-base modes interlace (Cauchy; Golub &
Van Loan, Matrix Computations, theorem 8.1.7, for the constraint x = 0), and every mode goes down to the fixed-base mode
below it as the mass of the cart grows. In ascending order they therefore belong together, one to one. Of N fixed-base
modes of one frequency N − 1 keep it without pushing the cart, and the last one, which moves it, has their mass.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from modal.assembly import Rig
from modal.eigen import LIGHT, UNCERTAIN, Limits, ModalSpectrum, SpectrumPart, degenerate_modes, find_spectrum
from modal.errors import ComputationError
from modal.modes.modes import Modes, all_shapes, natural_modes
from modal.scene import Scene
from modal.scene.doors import checked
from modal.types import Complexes, Floats, Ints

DECIMALS_OF_LIKENESS = 9
"""Tolerance: decimals to which similarities are compared; the earlier of two equally similar rows is taken."""
MOST_COMPARED = 1000
"""Limit: links up to which shapes are compared where the numbers are optional; none are given beyond."""
SHAPE_MAC_MIN = 0.99
"""Tolerance: least modal assurance of the shape of a light mode and of the same without dampers."""


@lru_cache(maxsize=4)
def table_numbers(scene: Scene, undamped_modes: Modes | None = None) -> Ints:
    """The number in the table of a scene for every row (R,) of `natural_modes(scene.conservative)`, `undamped_modes`.

    >>> from modal import load
    >>> table_numbers(load("huygens")).tolist()  # the cart's creeping on its damper is mode 2 of the table
    [1, 3, 4]
    """
    undamped_modes = undamped_modes or natural_modes(scene.conservative)
    numbers = (
        1 + counterparts(undamped_modes, natural_modes(scene))
        if scene.has_damping
        else np.arange(1, len(undamped_modes) + 1)
    )
    numbers.flags.writeable = False
    return numbers


@checked
def counterparts(modes: Modes, others: Modes, among: Sequence[int] | None = None) -> Ints:
    """For every row (R,) of `modes` the index of the most similar row of `others` (one of `among`)."""
    chosen = np.arange(len(others)) if among is None else np.asarray(among, dtype=np.intp)
    alike = np.round(likeness(modes, others)[:, chosen], DECIMALS_OF_LIKENESS)
    partners = pair_rows(alike, np.ones(len(chosen), dtype=np.int64))
    return np.asarray(chosen[np.where(partners < 0, alike.argmax(axis=1), partners)])


def pair_rows(alike: Floats, room: Ints) -> Ints:
    """A column for every row, the largest entries first, each column for at most `room` rows; −1 without one.

    Rows propose to columns in the order of their entries, and a full column rejects the row with the smallest entry:
    the same pairs as by sorting all entries [Gale1962].
    """
    open_to, partners = np.nan_to_num(alike, nan=-1.0), np.full(len(alike), -1)
    rows_of: dict[int, list[int]] = {}
    asking = list(range(len(alike) if alike.size else 0))
    while asking:
        row = asking.pop()
        column = int(open_to[row].argmax())
        if open_to[row, column] == -np.inf:
            continue
        open_to[row, column], partners[row] = -np.inf, column
        rows = rows_of.setdefault(column, [])
        rows.append(row)
        if len(rows) > room[column]:
            worst = min(rows, key=lambda candidate: (alike[candidate, column], -candidate))
            rows.remove(worst)
            partners[worst] = -1
            asking.append(worst)
    return partners


def number_labels(numbers: Iterable[int]) -> tuple[str, ...]:
    """A name for each of these numbers of the table: the number, followed by b, c, … where it is repeated.

    >>> number_labels([2, 2, 3, 2])
    ('2', '2b', '3', '2c')
    """
    counts: Counter[int] = Counter()
    names = []
    for number in numbers:
        names.append(f"{number}{letters(counts[number]) if counts[number] else ''}")
        counts[number] += 1
    return tuple(names)


def letters(index: int) -> str:
    """a, b, … z, aa, ab, … of indices from 0."""
    prefix, last = divmod(index, 26)
    return (letters(prefix - 1) if prefix else "") + chr(ord("a") + last)


def likeness(modes: Modes, others: Modes) -> Floats:
    """The similarity w (R, S) of rows, over all coordinates if both have them, else over the links."""
    left_out = max(modes.rig.leading - others.rig.leading, 0)
    M = modes.matrices.M[left_out:, left_out:]
    phi, owners = _unit_shapes(modes, M)
    psi, whose = _unit_shapes(others, M)
    similarity = np.zeros((len(modes), len(others)))
    np.add.at(similarity, np.ix_(owners, whose), np.abs(phi.conj().T @ M @ psi) ** 2)
    return similarity


def _unit_shapes(modes: Modes, M: Floats) -> tuple[Complexes, Ints]:
    """All shapes along the rail (n, C), n the size of M, with φᴴMφ = 1, and the row (C,) of each."""
    pairs = [(row, shape) for row, vectors in enumerate(all_shapes(modes)) for shape in vectors if not shape.across]
    phi = np.array([modes.column(shape)[-len(M) :] for _, shape in pairs], dtype=np.complex128).T
    size = np.sqrt(np.einsum("ic,ic->c", phi.conj(), M @ phi).real)
    return phi / np.where(size > 0, size, 1.0), np.array([row for row, _ in pairs])


def on_free_cart(rig: Rig) -> bool:
    """Whether the support is a cart without a spring."""
    return rig.cart is not None and not rig.cart.stiffness


def fixed_base_masses(
    modes: Modes, numbers: Sequence[int] | None = None, effective: Sequence[float] | None = None
) -> Floats:
    """Return the modal effective mass (kg) along the rail of the fixed-base mode to which each mode belongs.

    Of the modes with these indices (from 0), by default all (R,). On a fixed support that is the mode's own; NaN if
    modes do not belong to fixed-base modes one to one: on a cart with a spring, on a structure, about an inverted
    equilibrium, and with dampers that are not light; 0 for the rigid translation. `effective` (R,) are the modes' own
    masses (kg), if known.

    >>> from modal import load, natural_modes
    >>> fixed_base_masses(natural_modes(load("paper-cart-2"))).round(6).tolist()
    [0.0, 0.0, 2.848179, 0.0, 0.580392]
    """
    rig, rows = modes.rig, np.arange(len(modes)) if numbers is None else np.asarray(numbers, dtype=np.int64)
    if rig.is_damped:
        return np.asarray(undamped_masses(modes).fixed_base[rows])
    free = on_free_cart(rig)
    if rig.structure or modes.scene.stands or rig.leans or (rig.leading and not free):
        return np.full(len(rows), np.nan)
    if effective is not None and not free:
        return np.asarray(effective, dtype=np.float64)
    spectrum = modes.spectrum
    with np.errstate(all="ignore"):
        masses = (
            _masses_on_free_cart(modes, rows)
            if free
            else _masses(spectrum, [spectrum.groups[row] for row in rows.tolist()])
        )
    return np.where(modes.error[rows] < UNCERTAIN, masses * modes.units.mass, np.nan)


def _masses_on_free_cart(modes: Modes, rows: Ints) -> Floats:
    """Masses of the fixed-base modes that belong to modes on a free cart, in natural units."""
    spectrum = modes.spectrum
    shape_counts = np.array([_count_along(parts) for parts in spectrum.groups], dtype=np.int64)
    all_parts = [part for index, batch in enumerate(spectrum.batches) for part in batch.parts(index)]
    earlier = _count_along(all_parts[k] for k in spectrum.order[: spectrum.cuts[0]].tolist())
    last_places = earlier + np.cumsum(shape_counts) - 1  # shapes up to each row, without the rigid translation
    natural, _ = replace(modes.rig, cart=None, damping_ratio=0.0, spatial=False).natural()
    lowest = int(last_places.max(initial=0)) + 1 if modes.is_partial else None
    fixed_spectrum = find_spectrum(natural, Limits(lowest=lowest))
    omega = np.abs(fixed_spectrum.eigenvalue)
    clusters = degenerate_modes((omega**2,))
    ends = np.cumsum(np.add.reduceat([_count_along(parts) for parts in fixed_spectrum.groups], clusters.first))
    owner: list[int] = []
    groups: list[tuple[SpectrumPart, ...]] = []
    for at, row in enumerate(rows.tolist()):
        bounds = [last_places[row] - shape_counts[row], last_places[row]]
        for cluster in range(*np.searchsorted(ends, bounds, side="right").tolist()):
            start, size = int(clusters.first[cluster]), int(clusters.size[cluster])
            owner += [at] * size
            groups += fixed_spectrum.groups[start : start + size]
    masses: Floats = np.zeros(len(rows))
    np.add.at(masses, owner, _masses(fixed_spectrum, groups))
    return masses


def _count_along(parts: Iterable[SpectrumPart]) -> int:
    return sum(part.along_count for part in parts)


def _masses(spectrum: ModalSpectrum, groups: Sequence[Sequence[SpectrumPart]]) -> Floats:
    """The effective mass of each group of parts along the rail."""
    pairs = [(number, part) for number, parts in enumerate(groups) for part in parts if part.along_count]
    masses = np.zeros(len(groups))
    for source in {part.source for _, part in pairs}:
        source_pairs = [(number, part) for number, part in pairs if part.source == source]
        mass = spectrum.details(source, [part.row for _, part in source_pairs]).effective_mass
        for (number, part), kg in zip(source_pairs, mass.tolist(), strict=True):
            masses[number] += kg * part.along_count
    return masses


class UndampedMasses(NamedTuple):
    """Effective masses (R,) in kg along the rail, across it, and of the fixed-base mode; NaN if no mode is light."""

    along: Floats
    across: Floats
    fixed_base: Floats


@lru_cache(maxsize=2)
def undamped_masses(modes: Modes) -> UndampedMasses:
    """Return the masses of the undamped modes that represent these; none for more than MOST_COMPARED links."""
    masses = UndampedMasses(*np.full((3, len(modes)), np.nan))
    if modes.scene.n_links > MOST_COMPARED:
        return masses
    try:
        without = natural_modes(modes.scene.conservative)
        alike = likeness(modes, without)
    except ComputationError:
        return masses
    counterpart = alike.argmax(axis=1)
    fold = modes.multiplicity
    light = (modes.damping_ratio >= 0) & (modes.damping_ratio < LIGHT) & (without.multiplicity[counterpart] == fold)
    light &= alike[np.arange(len(modes)), counterpart] >= SHAPE_MAC_MIN * fold
    fixed_base = fixed_base_masses(without)
    for row, partner in zip(np.flatnonzero(light).tolist(), counterpart[light].tolist(), strict=True):
        mode = without[partner]
        masses.along[row], masses.across[row] = mode.effective_mass, mode.effective_mass_across
        masses.fixed_base[row] = fixed_base[partner]
    return masses
