"""The modal effective mass of each mode with the cart held: what the pendula of a free cart push it with.

About a free cart a rigid translation has all of the effective mass, and every other mode none: it leaves the centre of
mass where it is.  Held, the same pendula swing in their fixed-base modes ψ, K ψ = ω² A ψ, of effective mass

    μ = (ψᵀb)²/(ψᵀAψ),        Σ μ = mass of the pendula − what their pivots feel from inertia alone.

The squares of the n frequencies of the cart beside 0 and those of the n fixed-base modes interlace (Cauchy; Golub &
Van Loan, Matrix Computations, theorem 8.1.7, for the constraint x = 0), and every mode goes down to the fixed-base mode
below it as the mass of the cart grows.  In ascending order they therefore belong together, one to one.  Of N fixed-base
modes of one frequency N − 1 stay there without pushing the cart, and the last one, which moves it, has their mass.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from modal.assembly import Rig
from modal.eigen import UNCERTAIN, Limits, ModalSpectrum, SpectrumPart, degenerate_modes, find_spectrum
from modal.modes.modes import Modes
from modal.report import deferred
from modal.types import Floats, Ints


def on_free_cart(rig: Rig) -> bool:
    """Whether the support is a cart that no spring holds."""
    return rig.cart is not None and not rig.cart.stiffness


def fixed_base_masses(
    modes: Modes, numbers: Sequence[int] | None = None, squares: Sequence[float] | None = None
) -> Floats:
    """Modal effective mass in kg of the fixed-base mode that each mode belongs to, along the rail.

    Of the modes with these indices (from 0), by default all (R,).  On a fixed support that is the mode's own; NaN where
    modes do not belong to fixed-base modes one to one: on a cart with a spring, on a structure, about an inverted
    equilibrium, and with dampers that are not light (`modal.modes.undamped`); 0 for the rigid translation.  `own` (R,)
    are the modes' own masses (kg), if known.

    >>> from modal import load, natural_modes
    >>> fixed_base_masses(natural_modes(load("paper-cart-2"))).round(6).tolist()
    [0.0, 0.0, 2.848179, 0.0, 0.580392]
    """
    rig, rows = modes.rig, np.arange(len(modes)) if numbers is None else np.asarray(numbers, dtype=np.int64)
    if rig.is_damped:
        masses = deferred("modal.modes.undamped:undamped_masses")(modes)
        return np.asarray(masses.held[rows])
    if rig.structure or modes.scene.stands or rig.leans or (rig.cart and not on_free_cart(rig)):
        return np.full(len(rows), np.nan)
    if squares is not None and not rig.cart:
        return np.asarray(squares, dtype=np.float64)
    with np.errstate(all="ignore"):
        masses = _own(modes, rows) if not rig.cart else _held(modes, rows)
    return np.where(modes.error[rows] < UNCERTAIN, masses * modes.units.mass, np.nan)


def _own(modes: Modes, rows: Ints) -> Floats:
    """The modes' own masses, in natural units."""
    return _masses(modes.spectrum, [modes.spectrum.groups[row] for row in rows.tolist()])


def _held(modes: Modes, rows: Ints) -> Floats:
    """Masses of the fixed-base modes that belong to modes on a free cart, in natural units."""
    along = np.array([_along(parts) for parts in modes.spectrum.groups], dtype=np.int64)
    behind = _before(modes.spectrum) + np.cumsum(along) - 1  # shapes up to each row, without the rigid translation
    natural, _ = replace(modes.rig, cart=None, damping_ratio=0.0, spatial=False).natural()
    lowest = int(behind.max(initial=0)) + 1 if modes.selected else None
    held = find_spectrum(natural, Limits(lowest=lowest))
    omega = np.abs(held.eigenvalue)
    gathered = degenerate_modes((omega**2,))
    ends = np.cumsum(np.add.reduceat([_along(parts) for parts in held.groups], gathered.first))
    owner: list[int] = []
    groups: list[tuple[SpectrumPart, ...]] = []
    for at, row in enumerate(rows.tolist()):
        passed = [behind[row] - along[row], behind[row]]
        for cluster in range(*np.searchsorted(ends, passed, side="right").tolist()):
            start, size = int(gathered.first[cluster]), int(gathered.size[cluster])
            owner += [at] * size
            groups += held.groups[start : start + size]
    masses: Floats = np.zeros(len(rows))
    np.add.at(masses, owner, _masses(held, groups))
    return masses


def _before(spectrum: ModalSpectrum) -> int:
    """How many shapes along the rail have lower frequencies than those that were selected."""
    parts = [part for index, batch in enumerate(spectrum.batches) for part in batch.parts(index)]
    return _along(parts[k] for k in spectrum.order[: spectrum.cuts[0]].tolist())


def _along(parts: Iterable[SpectrumPart]) -> int:
    return sum(part.along for part in parts)


def _masses(spectrum: ModalSpectrum, groups: Sequence[Sequence[SpectrumPart]]) -> Floats:
    """The effective mass of each group of parts along the rail."""
    every = [(number, part) for number, parts in enumerate(groups) for part in parts if part.along]
    masses = np.zeros(len(groups))
    for source in {part.source for _, part in every}:
        here = [(number, part) for number, part in every if part.source == source]
        mass = spectrum.details(source, [part.row for _, part in here]).effective_mass
        for (number, part), kg in zip(here, mass.tolist(), strict=True):
            masses[number] += kg * part.along
    return masses
