"""The linear model along a hoist, z' = A(t) z + B(t) u, y = C z + D u, sampled in time.

States, inputs and outputs are those of `modal.statespace.model`; lengths and their rates enter A and B through
`modal.assembly.hoisting`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from modal.assembly import hoisting_of, instants, no_hoist
from modal.errors import ComputationError, SceneError
from modal.report import Displayed
from modal.scene import Scene, validate_scene
from modal.statespace.model import StateSpace, assembled
from modal.statespace.signals import Signal
from modal.types import Floats

SAMPLES = 201
MOST_NUMBERS = 50_000_000
JUMPING = {
    "cart_velocity": "cart_acceleration",
    "support_velocity": "support_acceleration",
    "support_displacement": "support_acceleration",
}
"""Inputs whose models would need the change of the mass matrix along a hoist, and what to use."""


@dataclass(frozen=True, eq=False, repr=False)
class VaryingModel(Displayed):
    """A (T, n, n) and B (T, n, m) at `times` (T,) in s; C (p, n) and D (p, m), with times in front where they vary.

    Everything else is as in `StateSpace`.
    """

    times: Floats
    A: Floats
    B: Floats
    C: Floats
    D: Floats
    states: tuple[Signal, ...]
    inputs: tuple[Signal, ...]
    outputs: tuple[Signal, ...]
    title: str
    operating_point: tuple[tuple[str, float], ...]
    scene: Scene


def hoisting_times(scene: Scene, samples: int = SAMPLES) -> Floats:
    """Evenly spaced times (samples,) in s from the begin of the first hoist to the end of the last.

    SceneError for a scene without a hoist.
    """
    hoisting = hoisting_of(validate_scene(scene))
    if hoisting is None:
        raise no_hoist(scene)
    if samples < 2:
        raise SceneError([f"samples {samples}: must be at least 2"])
    return np.linspace(hoisting.breaks[0], hoisting.breaks[-1], samples)


def varying_model(
    scene: Scene,
    times: ArrayLike | None = None,
    inputs: tuple[str, ...] = (),
    outputs: tuple[str, ...] = (),
) -> VaryingModel:
    """The model of a scene with a hoist at these times (T,) in s, by default `hoisting_times`.

    Raises SceneError for a scene without one and for a prescribed velocity of the cart or displacement
    of the support, else as `state_space`.
    """
    usual = hoisting_times(scene)
    at = usual if times is None else np.atleast_1d(np.asarray(times, dtype=np.float64))
    if at.ndim != 1 or not np.all(np.isfinite(at)) or np.any(np.diff(at) <= 0):
        raise SceneError(["times: must be ascending times in seconds"])
    problems = [
        f"input {name}: along a hoist its model would need the change of the mass matrix; use {JUMPING[name]}"
        for name in inputs
        if name in JUMPING
    ]
    if problems:
        raise SceneError(problems)
    along = instants(scene)

    def model(time: float) -> StateSpace:
        return assembled(scene.at(time), along(time), inputs, outputs)

    first = model(float(at[0]))
    if len(at) * (first.A.size + first.B.size) > MOST_NUMBERS:
        raise ComputationError(f"a model of {len(first.A)} states at {len(at)} times is too large: use fewer times")
    each = [first, *map(model, at[1:].tolist())]
    A, B, C, D = (np.array([getattr(sampled, name) for sampled in each]) for name in "ABCD")
    return VaryingModel(
        at, A, B, _constant(C), _constant(D), first.states, first.inputs, first.outputs, scene.title,
        first.operating_point, scene,
    )  # fmt: skip


def model_at(scene: Scene, time: float, inputs: tuple[str, ...] = (), outputs: tuple[str, ...] = ()) -> StateSpace:
    """The model at one time (s), in which the speeds and accelerations of the lengths are damping and stiffness."""
    return assembled(scene.at(time), instants(scene)(time), inputs, outputs)


def _constant(values: Floats) -> Floats:
    return np.asarray(values[0]) if np.array_equal(values, np.broadcast_to(values[0], values.shape)) else values
