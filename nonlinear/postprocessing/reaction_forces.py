"""Reaction forces of a trajectory by Newton's second law, from the accelerations of its own states."""

from __future__ import annotations

import numpy as np

from modal.errors import ComputationError
from modal.types import Floats
from nonlinear.dynamics.forces import Reactions
from nonlinear.dynamics.mechanics import vectors
from nonlinear.integration.methods import Choice, system_of
from nonlinear.integration.trajectory import Trajectory
from nonlinear.system.state import Motion


def reactions(trajectory: Trajectory) -> Reactions:
    """The force at every pivot and the rail's on the cart, at the sampled times.

    Raises ComputationError for a saved run that something drove: applied forces are not saved.
    """
    if trajectory.driven and trajectory.system is None:
        raise ComputationError("reaction forces of this run need the applied forces, which are not saved with it")
    plant, motion = trajectory.plant, trajectory.motion
    pivots = trajectory.mechanics.pivot_forces(_accelerations(trajectory, motion))
    tops = np.zeros(plant.n_links, dtype=bool)
    tops[np.concatenate([group.index[0] for group in plant.groups])] = True
    weight = plant.cart.mass * plant.gravity if plant.cart else 0.0
    return Reactions(weight - pivots[:, tops, -1].sum(1), pivots, tops)


def _accelerations(trajectory: Trajectory, motion: Motion) -> tuple[Floats, Floats]:
    """X'' (T,) and the second derivatives of the unit vectors (T, L, d)."""
    plant = trajectory.plant
    load = trajectory.system.load if trajectory.system else None
    form = "spatial" if plant.spatial else "minimal"
    system = system_of(plant, Choice(form, "", compiled=False, reason=""), load)
    rows = [system.derivative(float(time), system.begin(motion[at])) for at, time in enumerate(trajectory.times)]
    found = system.read(np.array(rows))
    if plant.spatial:
        return found.cart_rate, found.link_rates
    u, _ = vectors(motion)
    across = np.stack((u[..., 1], -u[..., 0]), axis=-1)
    return found.cart_rate, found.link_rates[..., None] * across - motion.link_rates[..., None] ** 2 * u
