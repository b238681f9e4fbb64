"""Unit vectors of links from angles and back: u = (sin θ cos φ, sin θ sin φ, cos θ), along the rail, across it, down.

θ is the angle from the downward vertical, φ the azimuth from the rail; the last axis of an array holds the components.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from modal.types import Floats
from nonlinear.system.state import State


def unit_vectors(angles: Any, azimuths: Any) -> Floats:
    """Unit vectors (..., 3) of θ and φ (rad)."""
    theta, phi = np.broadcast_arrays(angles, azimuths)
    return np.stack((np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)), axis=-1)


def velocities(angles: Any, azimuths: Any, rates: Any) -> Floats:
    """Time derivatives (..., 3) in 1/s of unit vectors whose θ changes at `rates` (rad/s) with φ fixed."""
    theta, phi, rate = np.broadcast_arrays(angles, azimuths, rates)
    across = np.stack((np.cos(theta) * np.cos(phi), np.cos(theta) * np.sin(phi), -np.sin(theta)), axis=-1)
    return np.asarray(rate[..., None] * across)


def of_plane(state: State) -> State:
    """A state of angles (L,) as unit vectors (L, 3) in the vertical plane of the rail."""
    u, w = unit_vectors(state.links, 0.0), velocities(state.links, 0.0, state.link_rates)
    return replace(state, links=u, link_rates=w)


def angles_of(u: Floats) -> tuple[Floats, Floats]:
    """θ in [0, π] and φ in (−π, π] (rad) of vectors (..., 3) of any length; φ is 0 on the vertical."""
    x, y, z = np.moveaxis(u, -1, 0)
    return np.arctan2(np.hypot(x, y), z), np.arctan2(y, x)
