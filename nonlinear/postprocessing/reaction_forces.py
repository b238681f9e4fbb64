"""Reaction forces of a trajectory by Newton's second law, from the accelerations at its states."""

from __future__ import annotations

from typing import Any

import numpy as np

from modal.errors import ComputationError
from modal.scene.doors import require_type
from modal.types import Floats
from nonlinear.dynamics import Lanes, Reactions, vectors
from nonlinear.integration import Choice, Trajectory, equations_of
from nonlinear.integration.switches import Switched
from nonlinear.system import Layout, Motion, numbers_of


def reaction_forces_of(trajectory: Trajectory) -> Reactions:
    """The force at every pivot and that of the rail on the cart, at the sampled times.

    On a structure, where there is no one rail, `normal` is NaN. Raise ComputationError for a saved run with applied
    forces, which are not saved, and for one with sampled feedback.
    """
    require_type("trajectory", trajectory, "Trajectory")
    if trajectory.driven and trajectory.equations is None:
        raise ComputationError("the reaction forces of this run need its applied forces, which are not saved")
    system, motion = trajectory.system, trajectory.motion
    if system.is_sampled:
        raise ComputationError("reaction forces: the held inputs of sampled feedback are not stored with a run")
    support = system.support
    size, times = 3 if system.spatial else 2, trajectory.times
    support_motion = (support.accelerations(times, size), support.velocities(times, size)) if support else None
    pivots = trajectory.mechanics.pivot_forces(_accelerations(trajectory, motion), support_motion)
    tops = np.zeros(system.n_links, dtype=bool)
    tops[np.concatenate([group.index[0] for group in system.groups])] = True
    weight = system.cart.mass * system.gravity if system.cart else 0.0
    normal = weight - pivots[:, tops, -1].sum(1)
    return Reactions(np.full_like(normal, np.nan) if system.structure is not None else normal, pivots, tops)


def side_by_side(trajectory: Trajectory) -> bool:
    """Whether the accelerations at all states are computed at once: in the plane, by equations of the scene."""
    system = trajectory.system
    load = trajectory.equations.load if trajectory.equations else None
    return not (system.spatial or system.rubs or system.hoisting or load or trajectory.driven)


def states_and_slopes(trajectory: Trajectory) -> tuple[Layout, Floats, Floats]:
    """The parts of y, y and y' at all samples, (T, size) each, of a run whose accelerations are computed at once."""
    numbers = numbers_of(trajectory.scene, system=trajectory.system)
    lanes = Lanes(numbers)
    rows = lanes.layout.rows(trajectory.motion)
    slopes = np.empty_like(rows)
    rates = lanes.rates(numbers)(np.ascontiguousarray(rows.T), trajectory.times)
    for column, rate in zip(slopes.T, rates, strict=True):
        column[:] = rate
    return lanes.layout, rows, slopes


def _one_by_one(trajectory: Trajectory, motion: Motion) -> Motion:
    """The rates of all states, by the equations of a run of its own."""
    system = trajectory.system
    load = trajectory.equations.load if trajectory.equations else None
    form = "spatial" if system.spatial else "minimal"
    equations = equations_of(system, Choice(form, "", compiled=False, reason=""), load)
    rows = []
    for at, time in enumerate(trajectory.times.tolist()):
        y = equations.begin(motion[at])
        if isinstance(equations, Switched):
            equations.release(time, y)
        rows.append(equations.derivative(time, y))
    return equations.read(np.array(rows))


def _accelerations(trajectory: Trajectory, motion: Motion) -> tuple[list[Any], Floats]:
    """Those of first joints (`Mechanics.pivot_accelerations`), and unit vectors' second derivatives, (T, L, d)."""
    system = trajectory.system
    if side_by_side(trajectory):
        layout, _, slopes = states_and_slopes(trajectory)
        accelerations = layout.read(slopes)
    else:
        accelerations = _one_by_one(trajectory, motion)
    carrier_accelerations = Layout.of(system, works=False).carrier_coordinates(accelerations)[1]
    pivots = trajectory.mechanics.pivot_accelerations(carrier_accelerations)
    if system.spatial:
        return pivots, accelerations.link_rates
    u, _ = vectors(motion)
    normals = np.stack((u[..., 1], -u[..., 0]), axis=-1)
    return pivots, accelerations.link_rates[..., None] * normals - motion.link_rates[..., None] ** 2 * u
