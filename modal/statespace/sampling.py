"""Models at instants: continuous ones sampled every T seconds, and the linear model along a hoist at its times.

With the input held between samples (zoh), from one exponential, exactly,

    exp([[A, B], [0, 0]] T) = [[Φ, Γ], [0, 1]],    z[k+1] = Φ z[k] + Γ u[k];

with the input linear between samples (foh), with  exp([[A, B, 0], [0, 0, 1/T], [0, 0, 0]] T) = [[Φ, Γ, Γ₁], …],

    w = z − Γ₁ u,    w[k+1] = Φ w[k] + (Γ + Φ Γ₁ − Γ₁) u[k],    y = C w + (D + C Γ₁) u;

and by the trapezoidal rule (tustin), s = (2/T) (ζ − 1)/(ζ + 1), with N = (1 − A T/2)⁻¹ and w = z − (T/2)(A z + B u),

    w[k+1] = N (1 + A T/2) w[k] + T N B u[k],    y = C N w + (D + C N B T/2) u.

Along a hoist z' = A(t) z + B(t) u, y = C z + D u: lengths and their rates enter A and B (`modal.assembly.hoisting`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import isfinite

import numpy as np
import scipy
from numpy.typing import ArrayLike

from modal.assembly import hoisting_of, instants, no_hoist
from modal.errors import ComputationError, SceneError, refuse_any
from modal.report import Displayed
from modal.scene import Scene, validate_scene
from modal.scene.doors import checked_number
from modal.statespace.model import StateSpace, assemble
from modal.statespace.signals import Signal
from modal.types import Floats

MOST_NUMBERS = 50_000_000
"""Limit: numbers of a result over all its times, refused beyond as too large: 0.4 GB."""
JUMPING = {
    "cart_velocity": "cart_acceleration",
    "support_velocity": "support_acceleration",
    "support_displacement": "support_acceleration",
}
"""Inputs whose models would need the change of the mass matrix along a hoist, and what to use."""


def sample(model: StateSpace, dt: float, method: str = "zoh") -> StateSpace:
    """The discrete model of a continuous one, `dt` in seconds; names are kept.

    `method` is one of METHODS. Under "zoh" the states are the continuous ones at the samples; under "foh" and "tustin"
    they are shifted by a multiple of the input, as in the equations above. Raise SceneError for a time that is not
    positive, an unknown method, and a model that is already discrete; raise ComputationError if a fast instability
    overflows.
    """
    if model.dt:
        raise SceneError([f"step {dt}: the model is already discrete, with a step of {model.dt} s"])
    checked_number("step", dt)
    if not (isfinite(dt) and dt > 0):
        raise SceneError([f"step {dt}: must be a positive number of seconds"])
    if method not in METHODS:
        raise SceneError([f"method {method}: must be one of {', '.join(METHODS)}"])
    with np.errstate(over="ignore", invalid="ignore"):
        A, B, C, D = METHODS[method](model, dt)
    if not all(np.isfinite(matrix).all() for matrix in (A, B, C, D)):
        raise ComputationError(f"step {dt}: the model overflows within a step")
    return replace(model, scene=None, A=A, B=B, C=C, D=D, dt=float(dt))


def reach(A: Floats) -> float:
    """A bound on the fastest rate of the model, 1/s: a norm of A with its states rescaled."""
    return float(np.linalg.norm(scipy.linalg.matrix_balance(A, permute=False)[0], 1)) if A.size else 0.0


def _zero_order_hold(model: StateSpace, dt: float) -> tuple[Floats, ...]:
    n, m = model.B.shape
    matrix = np.zeros((n + m, n + m))
    matrix[:n] = np.hstack([model.A, model.B]) * dt
    top = _exponential(matrix)[:n]
    return top[:, :n], top[:, n:], model.C, model.D


def _linear(model: StateSpace, dt: float) -> tuple[Floats, ...]:
    n, m = model.B.shape
    matrix = np.zeros((n + 2 * m, n + 2 * m))
    matrix[:n, : n + m] = np.hstack([model.A, model.B]) * dt
    matrix[n : n + m, n + m :] = np.eye(m)
    phi, gamma, next_gamma = np.split(_exponential(matrix)[:n], [n, n + m], axis=1)
    return phi, gamma + phi @ next_gamma - next_gamma, model.C, model.D + model.C @ next_gamma


def _trapezoidal(model: StateSpace, dt: float) -> tuple[Floats, ...]:
    n = len(model.A)
    half = model.A * (dt / 2)
    solution = _solve(np.eye(n) - half, np.hstack([np.eye(n) + half, model.B * dt]))
    C = _solve((np.eye(n) - half).T, model.C.T).T
    return solution[:, :n], solution[:, n:], C, model.D + C @ model.B * (dt / 2)


def _solve(matrix: Floats, right: Floats) -> Floats:
    return np.asarray(np.linalg.solve(matrix, right), dtype=np.float64)


def _exponential(matrix: Floats) -> Floats:
    """The exponential of a matrix, with rows and columns scaled by powers of two so that units cost no digits."""
    if not matrix.size:
        return matrix
    balanced_matrix, (scale, _) = scipy.linalg.matrix_balance(matrix, permute=False, separate=True)
    return np.asarray(scale[:, None] * scipy.linalg.expm(balanced_matrix) / scale, dtype=np.float64)


METHODS = {"zoh": _zero_order_hold, "foh": _linear, "tustin": _trapezoidal}


# ------------------------------------------------------------------------------------------------- along a hoist


@dataclass(frozen=True, eq=False, repr=False)
class VaryingModel(Displayed):
    """A (T, n, n) and B (T, n, m) at `times` (T,) in s; C (p, n) and D (p, m), with times in front where they vary.

    Everything else is as in `StateSpace`; along a motion the values of the operating point are arrays (T,).
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
    operating_point: tuple[tuple[str, float | Floats], ...]
    scene: Scene


def hoisting_times(scene: Scene, samples: int = 201) -> Floats:
    """Evenly spaced times (samples,) in s from the begin of the first hoist to the end of the last.

    Raise SceneError for a scene without a hoist.
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

    Raise SceneError for a scene without one and for a prescribed velocity of the cart or displacement of the support,
    else as `state_space`.
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
    refuse_any(problems)
    instant_at = instants(scene)

    def model(time: float) -> StateSpace:
        return assemble(scene.at(time), instant_at(time), inputs, outputs)

    return table_of(scene, at, model)


def table_of(scene: Scene, times: Floats, model: Callable[[float], StateSpace]) -> VaryingModel:
    """The models at these times, ascending (T,) in s; raise ComputationError if they are too many numbers."""
    first = model(float(times[0]))
    if len(times) * (first.A.size + first.B.size) > MOST_NUMBERS:
        raise ComputationError(f"a model of {len(first.A)} states at {len(times)} times is too large: use fewer times")
    models = [first, *map(model, times[1:].tolist())]
    A, B, C, D = (np.array([getattr(sample, name) for sample in models]) for name in "ABCD")
    return VaryingModel(
        times, A, B, _constant(C), _constant(D), first.states, first.inputs, first.outputs, scene.title,
        first.operating_point, scene,
    )  # fmt: skip


def _constant(values: Floats) -> Floats:
    return np.asarray(values[0]) if np.array_equal(values, np.broadcast_to(values[0], values.shape)) else values
