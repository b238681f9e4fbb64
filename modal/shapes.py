"""One basis vector of a mode, written out over every pendulum of the scene."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from modal.errors import ComputationError
from modal.rig import Floats, Rig, Units
from modal.routes import Part
from modal.sources import Details


@dataclass(frozen=True, eq=False)
class Shape:
    """One basis vector of a mode: the cart's displacement (m) and every link's angle (rad), copies counted out.

    Complex for damped modes.  `across` says that it moves across the rail (scenes in space).
    """

    cart: complex
    angles: NDArray[np.inexact]
    kinetic_energy_share: Floats
    across: bool


def expanded(rig: Rig, units: Units, part: Part, copy: int, details: Details, normalise: str) -> Shape:
    """The copy-th vector of a part, `details` holding its one row."""
    shape = _together(rig, details) if part.kind is None else _alone(rig, part, copy, details)
    if not np.all(np.isfinite(shape.angles)):
        raise ComputationError("a mode shape of this scene is beyond double precision")
    return _normalised(shape, float(details.modal_mass[0]), units, normalise)


def _together(rig: Rig, details: Details) -> Shape:
    angles, shares = (
        np.concatenate([np.tile(values[block][:, column, 0], copies) for block, column, copies in rig.members])
        for values in (details.angles, details.shares)
    )
    return Shape(details.cart[0], angles, shares.real, across=False)


def _alone(rig: Rig, part: Part, copy: int, details: Details) -> Shape:
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
