"""The modes that every pendulum has on a support that stands still, and how hard each pushes it.

A mode φ of K φ = ω² A φ pushes the support with the momentum φᵀb; its modal effective mass

    μ_r = (φ_rᵀ b)² / (φ_rᵀ A φ_r),        Σ_r μ_r + residual mass = mass of the pendulum,

is what it adds to the mass that the support feels (Clough & Penzien, Dynamics of Structures, §26-4).  Dampers play no
part: these are the modes of the conservative scene, along the rail.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from modal.rig import Floats, Ints, Rig
from modal.spectrum import spectrum


@dataclass(frozen=True, eq=False)
class OwnModes:
    """K fixed-support modes of single pendula, ascending, one entry for all copies of a kind; all (K,).

    `omega` (rad/s), `mass` the modal effective mass of one copy (kg), `kind` the place of its kind in `Rig.names`,
    `number` its place among the modes of that pendulum, from 1, `count` how many copies there are.
    """

    omega: Floats
    mass: Floats
    kind: Ints
    number: Ints
    count: Ints


def conservative(rig: Rig) -> Rig:
    """The same without dampers, in the plane of the rail."""
    blocks = tuple(replace(block, damping=np.zeros_like(block.damping)) for block in rig.blocks)
    return replace(rig, blocks=blocks, cart=rig.cart and rig.cart._replace(damping=0.0), spatial=False)


def own_modes(rig: Rig) -> OwnModes:
    """The fixed-support modes of every kind of pendulum of a rig in SI units, all of them hanging."""
    natural, units = replace(conservative(rig), cart=None).natural()
    found = spectrum(natural)
    parts = [(number, part) for number, group in enumerate(found.groups) for part in group]
    places = {kind: place for place, kind in enumerate(rig.names)}
    kind = np.array([places[part.kind] for _, part in parts if part.kind])
    source = np.array([part.source for _, part in parts])
    row = np.array([part.row for _, part in parts])
    mass = np.empty(len(parts))
    for index in np.unique(source).tolist():
        here = source == index
        mass[here] = found.details(index, row[here].tolist()).effective_mass * units.mass
    return OwnModes(
        omega=np.abs(found.eigenvalue[[number for number, _ in parts]]) * units.rate,
        mass=mass,
        kind=kind,
        number=_places_within(kind),
        count=np.array([part.along for _, part in parts]),
    )


def _places_within(kind: Ints) -> Ints:
    """How many entries of the same kind come no later, (K,)."""
    order = np.argsort(kind, kind="stable")
    first = np.searchsorted(kind[order], kind[order])
    found = np.empty_like(order)
    found[order] = np.arange(len(kind)) - first + 1
    return found
