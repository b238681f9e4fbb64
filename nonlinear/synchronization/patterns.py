"""The pattern of a configuration: phases and amplitudes of the pendula in their fixed-base modes, and in words.

The motion q = Σ_r φ_r z_r of the band with most energy rotates as one, so that in its fixed-base modes
(`nonlinear.synchronization.phases`) every pendulum p has a complex amplitude η_p that is constant apart from the common
rotation.
"""

from __future__ import annotations

from math import degrees

import numpy as np

from modal.types import Complexes, Floats
from nonlinear.averaging import RelativeEquilibrium, swinging
from nonlinear.synchronization.phases import own_shapes

STILL_AMPLITUDE_RATIO = 0.1
"""Limit: of the largest amplitude, below which a pendulum does not count among those that "swing"."""
PATTERN_PHASE_MAX = np.pi / 6
"""Limit: phase (rad) up to which pendula are "in phase" or in "antiphase": damping and unequal lengths shift them."""


def own_amplitudes(state: RelativeEquilibrium) -> Complexes:
    """η (N,) in rad of every pendulum, in the strongest fixed-base mode of the strongest band."""
    amplitudes = state.averaged
    links = amplitudes.link_shapes @ np.where(amplitudes.band == state.band, state.z, 0.0)
    count = min(group.n for group in amplitudes.system.groups)
    eta = np.empty((amplitudes.system.n_pendula, count), dtype=complex)
    energy: Floats = np.zeros(count)
    for group in amplitudes.system.groups:
        modes = own_shapes(group, amplitudes.system.gravity, count)
        eta[group.pendula] = np.einsum("np,pnb->pb", links[group.index], modes.dual)
        energy += np.sum(modes.mass * modes.omega**2 * np.abs(eta[group.pendula]) ** 2, axis=0)
    return np.asarray(eta[:, int(energy.argmax())])


def relative_phases(eta: Complexes) -> Floats:
    """Phases (rad) in (−π, π] of the swinging pendula relative to the one with the largest amplitude."""
    largest = eta[np.abs(eta).argmax()]
    return np.asarray(np.angle(eta[np.abs(eta) >= STILL_AMPLITUDE_RATIO * abs(largest)] / largest))


def agreement(state: RelativeEquilibrium) -> str:
    """In phase, antiphase, the phase difference, or which pendulum swings alone; and whether several bands swing."""
    bands = len(swinging(state.averaged, state.z))
    return _phases(own_amplitudes(state), state.copies) + (f", {bands} frequencies" if bands > 1 else "")


def _phases(eta: Complexes, copies: int) -> str:
    phases = np.abs(relative_phases(eta))
    if len(phases) == 1:
        z = f"pendulum {int(np.abs(eta).argmax()) + 1}" if copies < len(eta) else "one pendulum"
        return "swings" if len(eta) == 1 else f"{z} alone"
    return _agreement(phases) + (f", {len(phases)} of {len(eta)} swing" if len(phases) < len(eta) else "")


def _agreement(phases: Floats) -> str:
    """Of two or more phases, rad from 0 to π."""
    count = int(np.count_nonzero(phases <= PATTERN_PHASE_MAX))
    if count == len(phases):
        return "in phase"
    if np.all((phases <= PATTERN_PHASE_MAX) | (phases >= np.pi - PATTERN_PHASE_MAX)):
        return "antiphase" if len(phases) == 2 else f"antiphase, {count} against {len(phases) - count}"
    return f"{degrees(phases.max()):.0f}° apart" if len(phases) == 2 else "phases spread"
