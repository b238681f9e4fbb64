"""Continuous models sampled every T seconds.

With the input held between samples (zoh), from one exponential, exactly,

    exp([[A, B], [0, 0]] T) = [[Φ, Γ], [0, 1]],    z[k+1] = Φ z[k] + Γ u[k];

with the input linear between samples (foh), with  exp([[A, B, 0], [0, 0, 1/T], [0, 0, 0]] T) = [[Φ, Γ, Γ₁], …],

    w = z − Γ₁ u,    w[k+1] = Φ w[k] + (Γ + Φ Γ₁ − Γ₁) u[k],    y = C w + (D + C Γ₁) u;

and by the trapezoidal rule (tustin), s = (2/T) (ζ − 1)/(ζ + 1), with N = (1 − A T/2)⁻¹ and w = z − (T/2)(A z + B u),

    w[k+1] = N (1 + A T/2) w[k] + T N B u[k],    y = C N w + (D + C N B T/2) u.
"""

from __future__ import annotations

from dataclasses import replace
from math import isfinite

import numpy as np
import scipy

from modal.errors import ComputationError, SceneError
from modal.scene.doors import checked_number
from modal.statespace.model import StateSpace
from modal.types import Floats


def sample(model: StateSpace, dt: float, method: str = "zoh") -> StateSpace:
    """The discrete model of a continuous one, `dt` in seconds; names are kept.

    `method` is one of METHODS.  Under "zoh" the states are the continuous ones at the samples; under "foh" and
    "tustin" they are shifted by a multiple of the input, as in the equations above.  Raises SceneError for a time that
    is not positive, an unknown method, and a model that is already discrete; ComputationError where a fast instability
    overflows.
    """
    if model.dt:
        raise SceneError([f"step {dt} s: the model is already discrete, with a step of {model.dt} s"])
    checked_number("step", dt)
    if not (isfinite(dt) and dt > 0):
        raise SceneError([f"step {dt} s: must be a positive number of seconds"])
    if method not in METHODS:
        raise SceneError([f"method {method}: must be one of {', '.join(METHODS)}"])
    with np.errstate(over="ignore", invalid="ignore"):
        A, B, C, D = METHODS[method](model, dt)
    if not all(np.isfinite(matrix).all() for matrix in (A, B, C, D)):
        raise ComputationError(f"step {dt} s: the model overflows within a step")
    return replace(model, scene=None, A=A, B=B, C=C, D=D, dt=float(dt))


def reach(A: Floats) -> float:
    """A bound on the fastest rate of the model, 1/s: a norm of A with its states rescaled."""
    return float(np.linalg.norm(scipy.linalg.matrix_balance(A, permute=False)[0], 1)) if A.size else 0.0


def _held(model: StateSpace, dt: float) -> tuple[Floats, ...]:
    n, m = model.B.shape
    whole = np.zeros((n + m, n + m))
    whole[:n] = np.hstack([model.A, model.B]) * dt
    top = _exponential(whole)[:n]
    return top[:, :n], top[:, n:], model.C, model.D


def _linear(model: StateSpace, dt: float) -> tuple[Floats, ...]:
    n, m = model.B.shape
    whole = np.zeros((n + 2 * m, n + 2 * m))
    whole[:n, : n + m] = np.hstack([model.A, model.B]) * dt
    whole[n : n + m, n + m :] = np.eye(m)
    phi, gamma, ahead = np.split(_exponential(whole)[:n], [n, n + m], axis=1)
    return phi, gamma + phi @ ahead - ahead, model.C, model.D + model.C @ ahead


def _trapezoidal(model: StateSpace, dt: float) -> tuple[Floats, ...]:
    n = len(model.A)
    half = model.A * (dt / 2)
    solved = _solved(np.eye(n) - half, np.hstack([np.eye(n) + half, model.B * dt]))
    C = _solved((np.eye(n) - half).T, model.C.T).T
    return solved[:, :n], solved[:, n:], C, model.D + C @ model.B * (dt / 2)


def _solved(matrix: Floats, right: Floats) -> Floats:
    return np.asarray(np.linalg.solve(matrix, right), dtype=np.float64)


def _exponential(matrix: Floats) -> Floats:
    """The exponential of a matrix, with rows and columns scaled by powers of two so that units cost no digits."""
    if not matrix.size:
        return matrix
    balanced, (scale, _) = scipy.linalg.matrix_balance(matrix, permute=False, separate=True)
    return np.asarray(scale[:, None] * scipy.linalg.expm(balanced) / scale, dtype=np.float64)


METHODS = {"zoh": _held, "foh": _linear, "tustin": _trapezoidal}
