"""The modes of every pendulum on a fixed support, and the force of each on it.

A mode φ of K φ = ω² A φ pushes the support with the momentum φᵀb; its modal effective mass

    μ_r = (φ_rᵀ b)² / (φ_rᵀ A φ_r),        Σ_r μ_r + residual mass = mass of the pendulum,

is its contribution to the mass felt at the support (Clough & Penzien, Dynamics of Structures, §26-4).  These are the
modes of the conservative scene, along the rail; to first order the dampers of its joints and the drag of its links damp
each at the rate σ = [Σ d_i (φ_i − φ_{i−1})² + Σ drag_k (h_kᵀφ)²] / 2φᵀAφ, h_kᵀφ the displacement of a link's centre.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from modal.assembly import Rig, centres
from modal.eigen import find_spectrum
from modal.report import Displayed
from modal.types import Floats, Ints


@dataclass(frozen=True, eq=False, repr=False)
class FixedBaseModes(Displayed):
    """K fixed-base modes of single pendula, ascending, one entry for all copies of a kind; all (K,).

    `omega` (rad/s), `mass` the modal effective mass of one copy (kg), `kind` the index of its kind in `Rig.names`,
    `number` its number among the modes of that pendulum, from 1, `count` the number of copies, `rate` σ (1/s).
    """

    omega: Floats
    mass: Floats
    kind: Ints
    number: Ints
    count: Ints
    rate: Floats


def without_damping(rig: Rig) -> Rig:
    """The rig without dampers, drag and damping ratios, in the plane of the rail."""
    none = [np.zeros_like(block.damping) for block in rig.blocks]
    blocks = tuple(replace(block, damping=zeros, drag=zeros) for block, zeros in zip(rig.blocks, none, strict=True))
    return replace(
        rig, blocks=blocks, cart=rig.cart and rig.cart._replace(damping=0.0), spatial=False, damping_ratio=0.0
    )


def fixed_base_modes(rig: Rig) -> FixedBaseModes:
    """The fixed-base modes of every kind of pendulum of a rig in SI units, all of them hanging."""
    natural, units = replace(without_damping(rig), cart=None).natural()
    spectrum = find_spectrum(natural)
    parts = [(number, part) for number, group in enumerate(spectrum.groups) for part in group]
    places = {kind: place for place, kind in enumerate(rig.names)}
    kind = np.array([places[part.kind] for _, part in parts if part.kind])
    source = np.array([part.source for _, part in parts])
    row = np.array([part.row for _, part in parts])
    mass, rate = np.empty((2, len(parts)))
    moment = units.mass * units.length**2
    for index in np.unique(source).tolist():
        here = source == index
        details = spectrum.details(index, row[here].tolist())
        mass[here] = details.effective_mass * units.mass
        kinds = [part.kind for _, part in parts if part.kind and part.source == index]
        damping = np.column_stack([rig.blocks[block].damping[:, column] for block, column in kinds])
        turns = np.diff(details.angles[0][:, 0].real, axis=0, prepend=0.0)
        lost = np.sum(damping * turns**2, axis=0)
        for at, (block, column) in enumerate(kinds):
            dragged = rig.blocks[block]
            if dragged.drag[:, column].any():
                lost[at] += dragged.drag[:, column] @ (centres(dragged, column) @ details.angles[0][:, 0, at].real) ** 2
        rate[here] = lost / (2 * details.modal_mass * moment)
    return FixedBaseModes(
        omega=np.abs(spectrum.eigenvalue[[number for number, _ in parts]]) * units.rate,
        mass=mass,
        kind=kind,
        number=places_within(kind),
        count=np.array([part.along for _, part in parts]),
        rate=rate,
    )


def places_within(kind: Ints) -> Ints:
    """The running number of each entry within its kind, from 1, (K,)."""
    order = np.argsort(kind, kind="stable")
    first = np.searchsorted(kind[order], kind[order])
    numbers = np.empty_like(order)
    numbers[order] = np.arange(len(kind)) - first + 1
    return numbers
