"""Where a run begins: as the scene file says, at angles given one by one, or in the shape of a mode."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from modal.errors import SceneError
from modal.scene.model import Pendulum, Scene
from modal.types import Floats
from nonlinear.dynamics import efforts
from nonlinear.system.directions import directions, of_plane, velocities
from nonlinear.system.plant import Group, Plant
from nonlinear.system.state import Push, State

NO_START = (
    "no pendulum has a start: add `start = { angles_deg = [...] }` with one angle a link to an entry of the file, "
    "or give another start: a mode at its largest angle, or angles at rest"
)
ROUNDING = 16 * float(np.finfo(float).eps)  # of moments that are in balance, relative to their parts
TINY = float(np.finfo(float).tiny)


def start_of(scene: Scene) -> State:
    """The state in which the file releases its pendula; those without a start hang (or stand) at rest.

    Raises SceneError where no pendulum has a start.
    """
    if not any(pendulum.start for pendulum in scene.pendulum):
        raise SceneError([NO_START])
    rows = np.concatenate([np.tile(_of(pendulum), (pendulum.count, 1)) for pendulum in scene.pendulum])
    angles, rates, azimuths = np.deg2rad(rows).T
    if scene.space == "plane":
        return State(angles, rates)
    return State(directions(angles, azimuths), velocities(angles, azimuths, rates))


def _of(pendulum: Pendulum) -> Floats:
    """Angle, rate and azimuth (deg) of every link of one copy, (n, 3)."""
    start, none = pendulum.start, (0.0,) * pendulum.n_links
    if start is None:
        return np.array([(0.0 if way == "down" else 180.0, 0.0, 0.0) for way in pendulum.ways])
    return np.array([start.angles_deg, start.rates_deg or none, start.azimuths_deg or none]).T


def released(scene: Scene, angles_deg: Sequence[float]) -> State:
    """At rest with one angle (deg) for each link of the scene, or for each of one pendulum where all have as many.

    Raises SceneError for another number of angles or one that is not finite.
    """
    given, total = np.array(angles_deg, dtype=float), scene.n_links
    sizes = {pendulum.n_links for pendulum in scene.pendulum}
    accepted = sorted({total, *(sizes if len(sizes) == 1 else ())})
    if problems := [f"start: angle {float(a)!r}: must be finite" for a in given if not np.isfinite(a)]:
        raise SceneError(problems)
    if given.size not in accepted:
        raise SceneError([f"start: has {given.size} angles: this scene needs {' or '.join(map(str, accepted))}"])
    angles = np.deg2rad(np.tile(given, total // given.size))
    state = State(angles, np.zeros(total))
    return state if scene.space == "plane" else of_plane(state)


def rests_unstably(plant: Plant, start: State) -> bool:
    """Whether a start is an unstable rest to within rounding, or on a fixed support any pendulum of it.

    Nothing moves, the moments of gravity and of the springs are in balance, and V is no minimum there.
    """
    angles = np.arctan2(np.hypot(*start.links.T[:2]), start.links[:, 2]) if plant.spatial else start.links
    still = ~np.any(start.link_rates.reshape(plant.n_links, -1), axis=1)
    felt = efforts.on_links(replace(plant, spatial=False), State(angles, 0.0 * angles), Push())
    found = []
    for group in plant.groups:
        weight, bent = plant.gravity * group.block.b, angles[group.index]
        left = np.abs(felt[group.index] - weight * np.sin(bent))
        balanced = left <= ROUNDING * (weight + group.block.stiffness) * (1 + np.abs(bent))
        found.append((np.all(balanced & still[group.index], axis=0), _falls(group, weight * np.cos(bent))))
    resting, falling = (np.concatenate(part) for part in zip(*found, strict=True))
    if plant.cart is None:
        return bool(np.any(resting & falling))
    pulled = start.cart * plant.cart.stiffness or start.cart_rate * plant.cart.damping
    return bool(np.all(resting) and np.any(falling) and not pulled)


def _falls(group: Group, weight: Floats) -> Any:
    """Whether V'' of each chain, `weight` (n, P) on its diagonal and the joint springs', has a negative pivot, (P,)."""
    stiffness = group.block.stiffness
    pivot, found = np.inf * weight[0], np.zeros(weight.shape[1], dtype=bool)
    for at in range(group.n - 1, -1, -1):
        below = stiffness[at + 1] if at + 1 < group.n else 0.0 * stiffness[0]
        pivot = weight[at] + stiffness[at] + below - below**2 / pivot
        found |= pivot < 0
        pivot = np.where(pivot == 0, TINY, pivot)
    return found


def checked(state: State, plant: Plant) -> State:
    """The state itself; SceneError names every part that does not fit the scene."""
    if not isinstance(state, State):
        raise SceneError([f"start: must be a State, not {type(state).__name__}"])
    shape = (plant.n_links, 3) if plant.spatial else (plant.n_links,)
    parts = {"links": state.links, "link_rates": state.link_rates}
    problems = [
        f"start.{name}: has shape {np.shape(values)}, this scene needs {shape}"
        for name, values in parts.items()
        if np.shape(values) != shape
    ]
    parts |= {"cart": np.array(state.cart), "cart_rate": np.array(state.cart_rate)}
    problems += [f"start.{name}: must be finite" for name, values in parts.items() if not np.all(np.isfinite(values))]
    if plant.cart is None and (state.cart or state.cart_rate):
        problems.append("start.cart: the support of this scene is fixed")
    if not problems and plant.spatial and np.any(abs(np.sum(state.links**2, axis=1) - 1) > 1e-9):
        problems.append("start.links: must be unit vectors")
    if problems:
        raise SceneError(problems)
    return state
