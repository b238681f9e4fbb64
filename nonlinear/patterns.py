"""How the pendula of a configuration swing to each other: amplitudes, phases, and these in words."""

from __future__ import annotations

import numpy as np

from modal.rig import Floats
from nonlinear.averaged import Complexes
from nonlinear.configurations import Configuration

NEARLY = 15.0  # deg within which phases count as equal
STILL = 0.05  # of the largest amplitude: a pendulum below it hardly swings
MOST_LISTED = 6


def swings(configuration: Configuration) -> Complexes:
    """Complex amplitude (rad) of every pendulum's widest link in the band that holds most energy, (N,)."""
    found = configuration.averaged
    energy = np.bincount(found.band, weights=found.omega**2 * np.abs(configuration.z) ** 2)
    own = np.where(found.band == energy.argmax(), configuration.z, 0.0)
    links = found.shapes[int(found.plant.cart is not None) :] @ own
    widest = np.zeros(found.plant.n_pendula, dtype=complex)
    for group in found.plant.groups:
        angles = links[group.index]
        place = np.abs(angles).sum(axis=1).argmax()
        widest[group.pendula] = angles[place]
    return widest


def phases_deg(configuration: Configuration) -> Floats:
    """Phases (deg) of the pendula beside the first that swings, from 0 to 360, (N,)."""
    swing = swings(configuration)
    first = swing[int((np.abs(swing) > STILL * np.abs(swing).max()).argmax())]
    return np.asarray(np.rad2deg(np.angle(swing / first)) % 360)


def pattern(configuration: Configuration) -> str:
    """In phase, antiphase, or the phases themselves."""
    swing, phases = np.abs(swings(configuration)), phases_deg(configuration)
    moving = swing > STILL * swing.max()
    if moving.sum() < len(swing):
        return f"{int(moving.sum())} of {len(swing)} pendula swing"
    if len(swing) == 1:
        return "alone"
    aside = np.abs((phases + 180) % 360 - 180)
    if aside.max() < NEARLY:
        return "in phase"
    if np.all(np.minimum(aside, 180 - aside) < NEARLY):
        ahead = int((aside < NEARLY).sum())
        return "antiphase" if len(swing) == 2 else f"{ahead} against {len(swing) - ahead}"
    shown = ", ".join(f"{phase:.0f}" for phase in phases[:MOST_LISTED])
    return f"phases {shown}{', …' if len(phases) > MOST_LISTED else ''} deg"
