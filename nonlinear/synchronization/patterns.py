"""The pattern of a configuration: phases and amplitudes of the pendula in their fixed-base modes, and in words.

The motion q = Σ_r φ_r z_r of the band with most energy rotates as one, so that in its fixed-base modes
(`nonlinear.synchronization.phases`) every pendulum p has a complex amplitude η_p that is constant apart from the common
rotation.
"""

from __future__ import annotations

from math import degrees

import numpy as np

from modal.report import listed
from modal.types import Complexes, Floats
from nonlinear.averaging import RelativeEquilibrium, swinging
from nonlinear.synchronization.phases import own_shapes
from nonlinear.system import System

STILL_AMPLITUDE_RATIO = 0.1
"""Limit: of the largest amplitude, below which a pendulum does not count among those that "swing"."""
PATTERN_PHASE_MAX = np.pi / 6
"""Limit: phase (rad) up to which pendula are "in phase" or in "antiphase": damping and unequal lengths shift them."""


def own_amplitudes(state: RelativeEquilibrium) -> Complexes:
    """η (N,) in rad of every pendulum, in the strongest fixed-base mode of the strongest band."""
    amplitudes = state.averaged
    links = amplitudes.link_shapes @ np.where(amplitudes.band == state.band, state.z, 0j)
    return amplitudes_of(np.asarray(links, dtype=np.complex128), amplitudes.system)


def amplitudes_of(links: Complexes, system: System) -> Complexes:
    """η (N,) in rad of every pendulum from the amplitudes of all links (L,), in the mode with most energy."""
    count = min(group.n for group in system.groups)
    eta = np.empty((system.n_pendula, count), dtype=complex)
    energy: Floats = np.zeros(count)
    for group in system.groups:
        modes = own_shapes(group, system.gravity, count)
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
    phases = relative_phases(eta)
    if len(phases) == 1:
        z = f"pendulum {int(np.abs(eta).argmax()) + 1}" if copies < len(eta) else "one pendulum"
        return "swings" if len(eta) == 1 else f"{z} alone"
    return phase_pattern(phases) + (f", {len(phases)} of {len(eta)} swing" if len(phases) < len(eta) else "")


def rhythm_name(eta: Complexes, *, are_equal: bool = False) -> str:
    """The pattern of amplitudes η (N,), whichever of equal pendula they belong to, and how many of them are dead.

    Phases and amplitudes are no part of it, so that it lasts along a branch: two pendula are in phase, in antiphase or
    "out of phase"; those that `are_equal` have "unequal amplitudes" where equal ones would do for the same pattern.

    >>> rhythm_name(np.array([0.1, -0.05])), rhythm_name(np.array([0.1, -0.05]), are_equal=True)
    ('antiphase', 'unequal amplitudes')
    >>> rhythm_name(np.array([0.1, 0.1j])), rhythm_name(np.array([0.1, 0.001]))
    ('out of phase', 'one pendulum dead')
    """
    phases = relative_phases(eta)
    still = len(eta) - len(phases)
    dead = f"{'one' if still == 1 else still} pendul{'um' if still == 1 else 'a'} dead" if still else ""
    pattern = phase_pattern(phases) if len(phases) > 1 else "" if still else "swings"
    pattern = "out of phase" if pattern.endswith("° apart") else pattern
    is_even = pattern in ("in phase", "antiphase", "splay", "out of phase")
    if are_equal and is_even and not still and np.ptp(np.abs(eta)) > 0.01 * np.abs(eta).max():
        pattern = "unequal amplitudes"
    return ", ".join(filter(None, (pattern, dead)))


def phase_pattern(phases: Floats) -> str:
    """Of two or more phases (rad): clusters of those at most PATTERN_PHASE_MAX apart, and whether they are even.

    >>> phase_pattern(np.radians([0, 2, 181])), phase_pattern(np.radians([0, 122, 239]))
    ('antiphase, 2 against 1', 'splay')
    >>> phase_pattern(2 * np.pi * np.arange(15) / 15), phase_pattern(2 * np.pi * np.arange(12) / 12)
    ('splay', 'splay')
    >>> phase_pattern(np.radians([0, 3, 70])), phase_pattern(np.radians([0, 70]))
    ('clusters of 2 and 1', '70° apart')
    """
    ascending = np.sort(np.asarray(phases) % (2 * np.pi))
    gaps = np.diff(ascending, append=ascending[0] + 2 * np.pi)
    breaks = np.flatnonzero(gaps > PATTERN_PHASE_MAX * (1 + 1e-9))
    if not len(breaks):
        return "splay" if gaps.max() < 1.5 * gaps.mean() else "phases spread"
    if len(breaks) == 1:
        return "in phase" if gaps.max() >= np.pi else "phases spread"
    first = breaks[0] + 1
    unrolled = np.concatenate((ascending[first:], ascending[:first] + 2 * np.pi))
    clusters = np.split(unrolled, np.cumsum(np.diff(breaks)))
    sizes = [len(cluster) for cluster in clusters]
    means = np.array([cluster.mean() for cluster in clusters])
    distances = np.diff(means, append=means[0] + 2 * np.pi)
    if np.all(np.abs(distances - 2 * np.pi / len(sizes)) <= PATTERN_PHASE_MAX):
        if len(sizes) == 2:
            return "antiphase" if sizes == [1, 1] else f"antiphase, {max(sizes)} against {min(sizes)}"
        if len(set(sizes)) == 1:
            return "splay" if sizes[0] == 1 else f"splay of {len(sizes)} clusters"
    if len(phases) == 2:
        return f"{degrees(distances.min()):.0f}° apart"
    if max(sizes) == 1:
        return "phases spread"
    return f"clusters of {listed([str(size) for size in sorted(sizes, reverse=True)], len(sizes))}"
