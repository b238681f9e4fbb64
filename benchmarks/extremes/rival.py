"""A simulator without a toolkit: the dense matrix, `numpy.linalg.solve`, and `scipy.integrate.solve_ivp`."""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy.integrate import solve_ivp

from modal import pair
from modal.scene import Cart, Scene
from nonlinear.system import State

MOST = 1000  # most links for a dense matrix


class Found(NamedTuple):
    """Angles (T, L) at the end of a run, or None and the reason; seconds."""

    angles: np.ndarray | None
    words: str
    seconds: float


class _LateError(Exception):
    pass


def equations(scene: Scene) -> Callable[[float, np.ndarray], np.ndarray]:
    """(q', q'') of (q, q'), q = (x, θ) on a cart, else θ."""
    cart = scene.support if isinstance(scene.support, Cart) else None
    links = [
        row
        for pendulum in scene.pendulum
        for _ in range(pendulum.count)
        for row in pendulum.links
        for _ in range(row.count)
    ]
    top = np.array(
        [i == 0 for pendulum in scene.pendulum for _ in range(pendulum.count) for i in range(pendulum.n_links)]
    )
    first, size = int(cart is not None), len(links) + int(cart is not None)
    A, b = _blocks(scene, len(links))
    c, k = (np.array([getattr(row, name) for row in links]) for name in ("damping", "stiffness"))
    joins = np.eye(len(links)) - np.diag((~top[1:]).astype(float), -1)
    C, K, M = joins.T @ (c[:, None] * joins), joins.T @ (k[:, None] * joins), np.zeros((size, size))
    if cart:
        M[0, 0] = cart.mass + sum(row.mass for row in links)

    def derivative(_: float, y: np.ndarray) -> np.ndarray:
        q, v, f = y[first:size], y[size + first :], np.zeros(size)
        apart = q[:, None] - q
        M[first:, first:] = A * np.cos(apart)
        f[first:] = -(A * np.sin(apart)) @ v**2 - scene.gravity * b * np.sin(q) - C @ v - K @ q
        if cart:
            M[0, 1:] = M[1:, 0] = b * np.cos(q)
            f[0] = (b * np.sin(q)) @ v**2 - cart.damping * y[size] - cart.stiffness * y[0]
        return np.concatenate((y[size:], np.linalg.solve(M, f)))

    return derivative


def _blocks(scene: Scene, size: int) -> tuple[np.ndarray, np.ndarray]:
    A, b, at = np.zeros((size, size)), np.zeros(size), 0
    for pendulum in scene.pendulum:
        rows = [row for row in pendulum.links for _ in range(row.count)]
        numbers = [np.array([getattr(row, name) for row in rows]) for name in ("mass", "length", "centre", "inertia")]
        block, moments = np.array(pair.inertia_matrix(*numbers)), pair.first_moments(*numbers[:3])
        for _ in range(pendulum.count):
            place = slice(at, at + len(rows))
            A[place, place], b[place], at = block, moments, place.stop
    return A, b


def run(scene: Scene, start: State, times: np.ndarray, patience: float, **settings: float) -> Found:
    """Angles at these times (s), the last where it ends; given up after `patience` seconds."""
    if scene.n_links > MOST:
        return Found(None, f"not run: a dense matrix of {scene.n_links} rows", 0.0)
    begun = time.perf_counter()
    head, rate = ([start.cart], [start.cart_rate]) if isinstance(scene.support, Cart) else ([], [])
    textbook, y = equations(scene), np.concatenate((head, start.links, rate, start.link_rates))

    def derivative(now: float, y: np.ndarray) -> np.ndarray:
        if time.perf_counter() - begun > patience:
            raise _LateError
        return textbook(now, y)

    try:
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")
            solution = solve_ivp(derivative, (0.0, times[-1]), y, t_eval=times, **settings)
    except _LateError:
        return Found(None, f"not done in {patience:g} s", patience)
    except (np.linalg.LinAlgError, ValueError) as error:
        return Found(None, f"{type(error).__name__}: {error}", time.perf_counter() - begun)
    seconds, size = time.perf_counter() - begun, len(y) // 2
    if not solution.success:
        return Found(None, solution.message, seconds)
    return Found(solution.y[len(head) : size].T, "", seconds)
