"""Initial conditions: from the scene file, from given angles, or in the shape of a mode."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from math import pi, radians
from typing import Any

import numpy as np

from modal.errors import SceneError, refuse_any
from modal.report import counted
from modal.scene import Pendulum, Scene, doors, validate_scene
from modal.scene.supports import Combined, start_keys
from modal.structure import structure_of
from modal.types import Floats
from nonlinear.system.state import State, of_plane, unit_vectors, velocities
from nonlinear.system.system import System

NO_START = (
    "no pendulum has a start: add `start = { angles_deg = [...] }` with one angle per link to an entry of the file, "
    "or give `start=state_at_rest(scene, [10, 20, ...])`"
)


def has_start(scene: Scene) -> bool:
    """Whether a simulation knows where to begin: a pendulum or a support has a start, or something drives it from rest.

    That is a moving support, the ground's motion, or a force that changes in time.
    """
    validate_scene(scene)
    has_support_start = any(getattr(support, "start", None) for support in scene.supports)
    driven = scene.is_moved or scene.ground is not None or "force" in scene.features
    return driven or has_support_start or any(pendulum.start for pendulum in scene.pendulum)


def initial_state(scene: Scene) -> State:
    """The initial state given in the scene file.

    Parameters
    ----------
    scene
        Pendula without a start are at rest in their equilibrium position.  On a moved support the start is relative to
        it.

    Returns
    -------
    State
        Angles (rad) and rates (rad/s), in space unit vectors and their derivatives.

    Raises
    ------
    SceneError
        No pendulum and no support has a start, unless the support moves or a force acts in time.

    Examples
    --------
    >>> from modal import load
    >>> from nonlinear import initial_state
    >>> state = initial_state(load("chain-2"))
    >>> state.links.shape, state.link_rates.tolist()
    ((2,), [0.0, 0.0])
    """
    validate_scene(scene)
    if not has_start(scene):
        raise SceneError([NO_START])
    rows = np.concatenate([_of_copies(scene, pendulum) for pendulum in scene.pendulum])
    angles, rates, azimuths = np.deg2rad(rows).T
    spatial = unit_vectors(angles, azimuths), velocities(angles, azimuths, rates)
    return _on_supports(scene, State(angles, rates) if scene.space == "plane" else State(*spatial))


def _on_supports(scene: Scene, state: State) -> State:
    """The same state with the supports at their starts."""
    if not scene.is_structured:
        (start,) = (getattr(support, "start", None) for support in scene.supports)
        return state if start is None else replace(state, cart=start.displacement, cart_rate=start.rate)
    size = structure_of(scene).offsets
    places, rates = np.zeros((2, size[-1]))
    for first, last, support in zip(size, size[1:], scene.supports, strict=False):
        if (start := getattr(support, "start", None)) is not None:
            places[first:last], rates[first:last] = _carrier_start(support, start)
    return replace(state, supports=places, support_rates=rates)


def _carrier_start(support: Any, start: Any) -> tuple[Any, Any]:
    """The coordinates of a support and their rates, in m and rad."""
    if isinstance(start, Combined):
        return start.displacements, 0.0 if start.rates is None else start.rates
    keys = [start_keys(coordinate) for coordinate in support.path.coordinates]
    values = [[getattr(start, key) for key in names] for names in zip(*keys, strict=True)]
    turns = [coordinate.unit == "rad" for coordinate in support.path.coordinates]
    places, rates = (
        [radians(value) if turn else value for value, turn in zip(row, turns, strict=True)] for row in values
    )
    return places, rates


def _of_copies(scene: Scene, pendulum: Pendulum) -> Floats:
    """The same of all copies one after another, (count n, 3), spread over the phases of the first mode if asked."""
    rows = _of(pendulum)
    if pendulum.start is None or not pendulum.start.spread:
        return np.tile(rows, (pendulum.count, 1))
    rest = np.array([(0.0 if way == "down" else 180.0) for way in pendulum.ways])
    psi = 2 * pi * np.arange(pendulum.count)[:, None] / pendulum.count
    starts = np.zeros((pendulum.count, pendulum.n_links, 3))
    starts[..., 0] = rest + (rows[:, 0] - rest) * np.cos(psi)
    starts[..., 1] = -(rows[:, 0] - rest) * _first_frequency(scene.gravity, pendulum) * np.sin(psi)
    return starts.reshape(-1, 3)


@lru_cache(maxsize=64)
def _first_frequency(gravity: float, pendulum: Pendulum) -> float:
    """The lowest angular frequency (rad/s) of a pendulum on a fixed support, without losses and drives."""
    from modal.modes import natural_frequencies

    single = pendulum.replace(count=1, on=None, position=(0.0, 0.0), start=None)
    return float(natural_frequencies([Scene(gravity=gravity, pendulum=(single,)).conservative])[0].min())


def _of(pendulum: Pendulum) -> Floats:
    """Angle, rate and azimuth (deg) of every link of one copy, (n, 3)."""
    start, none = pendulum.start, (0.0,) * pendulum.n_links
    if start is None:
        return np.array([(0.0 if way == "down" else 180.0, 0.0, 0.0) for way in pendulum.ways])
    return np.array([start.angles_deg, start.rates_deg or none, start.azimuths_deg or none]).T


@doors.checked
def state_at_rest(scene: Scene, angles_deg: Sequence[float]) -> State:
    """The state at rest with given angles.

    Parameters
    ----------
    scene
        The scene whose state it is.
    angles_deg
        An angle (deg) for each link of the scene, or of one pendulum where all have equally many.

    Returns
    -------
    State
        The angles in rad, in space unit vectors in the plane of the rail, and rates of 0.

    Raises
    ------
    SceneError
        The number of angles is another one.

    Examples
    --------
    >>> from math import degrees
    >>> from modal import load
    >>> from nonlinear import state_at_rest
    >>> state = state_at_rest(load("chain-2"), [30.0, 45.0])
    >>> [round(degrees(angle), 9) for angle in state.links]
    [30.0, 45.0]
    """
    values, total = np.array(angles_deg, dtype=float), scene.n_links
    sizes = {pendulum.n_links for pendulum in scene.pendulum}
    valid_sizes = sorted({total, *(sizes if len(sizes) == 1 else ())})
    if values.size not in valid_sizes:
        size = counted(values.size, "angle", "angles")
        raise SceneError([f"start: has {size}: this scene needs {' or '.join(map(str, valid_sizes))}"])
    angles = np.deg2rad(np.tile(values, total // values.size))
    state = State(angles, np.zeros(total))
    if scene.is_structured:
        none = np.zeros(structure_of(scene).size)
        return replace(state, supports=none, support_rates=none)
    return state if scene.space == "plane" else of_plane(state)


def validate_state(state: State, system: System) -> State:
    """The state itself; SceneError lists every part that does not fit the scene."""
    if not isinstance(state, State):
        raise SceneError([f"start: must be a State, not {type(state).__name__}"])
    shape = (system.n_links, 3) if system.spatial else (system.n_links,)
    parts = {"links": state.links, "link_rates": state.link_rates}
    problems = [
        f"start.{name}: has shape {np.shape(values)}, this scene needs {shape}"
        for name, values in parts.items()
        if np.shape(values) != shape
    ]
    parts |= {"supports": state.supports, "support_rates": state.support_rates}
    size = system.first if system.structure is not None else 0
    problems += [
        f"start.{name}: has {np.size(parts[name])} values, this scene has {size} coordinates of supports"
        for name in ("supports", "support_rates")
        if np.shape(parts[name]) != (size,)
    ]
    parts |= {"cart": np.array(state.cart), "cart_rate": np.array(state.cart_rate)}
    problems += [f"start.{name}: must be finite" for name, values in parts.items() if not np.all(np.isfinite(values))]
    if system.cart is None and (state.cart or state.cart_rate):
        words = "are given by supports" if system.structure is not None else "of this scene is fixed"
        problems.append(f"start.cart: the support{'s' * (system.structure is not None)} {words}")
    if not problems and system.spatial and np.any(abs(np.sum(state.links**2, axis=1) - 1) > 1e-9):
        problems.append("start.links: must be unit vectors")
    refuse_any(problems)
    return state
