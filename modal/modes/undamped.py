"""The modal effective masses of lightly damped modes: those of the same modes without dampers.

The mass (φᵀMe)²/(φᵀMφ) is that of a real shape, which a damped mode has not.  Where dampers are light they leave the
shapes as they are, and the mode of the scene without dampers stands for it.  A mode is light if its damping ratio is
below LIGHT and its shape φ is that of a mode ψ without dampers by the modal assurance criterion over the mass matrix,

    MAC = |φᴴMψ|² / ((φᴴMφ)(ψᵀMψ)) ≥ ALIKE

(Allemang, Sound and Vibration 37(8), 14 (2003); with M as weight), summed over the shapes of one frequency and divided
by their number.  As 1 − MAC is of second order in what the dampers change, the masses are right to some √(1 − ALIKE).
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from modal.errors import ComputationError
from modal.modes.fixed_base import fixed_base_masses
from modal.modes.modes import Modes, natural_modes
from modal.modes.numbering import MOST_COMPARED, likeness
from modal.types import Floats

LIGHT = 0.1
"""Damping ratio below which a mode may be light."""
ALIKE = 0.99
"""Least modal assurance of the shape of a light mode and of the same without dampers."""


class UndampedMasses(NamedTuple):
    """Effective masses (R,) in kg along the rail, across it, and of the fixed-base mode; NaN where no mode is light."""

    along: Floats
    across: Floats
    held: Floats


@lru_cache(maxsize=2)
def undamped_masses(modes: Modes) -> UndampedMasses:
    """The masses of the modes without dampers that stand for these; none for more than MOST_COMPARED links."""
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
    light &= alike[np.arange(len(modes)), counterpart] >= ALIKE * fold
    held = fixed_base_masses(without)
    for row, other in zip(np.flatnonzero(light).tolist(), counterpart[light].tolist(), strict=True):
        mode = without[other]
        masses.along[row], masses.across[row] = mode.effective_mass, mode.effective_mass_across
        masses.held[row] = held[other]
    return masses
