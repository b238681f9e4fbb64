"""Conversion between a motion in space and two motions in vertical planes, exact for small angles.

With θ from equilibrium and p = θ (cos φ, sin φ) along the rail and across it, s = sin θ/θ, σ = −1 for inverted links:

    u = σ (s p, cos θ),    u' = σ (s p' + r (p·p') p, −s p·p'),    r = (θ cos θ − sin θ)/θ³

so that p is an angle in the plane relative to equilibrium; for an inverted link it has the opposite sign.
"""

from __future__ import annotations

import numpy as np

from modal.scene import Scene
from modal.types import Floats
from nonlinear.reduction.modal_coordinates import rest_angles
from nonlinear.system import Motion, State

SERIES_ANGLE = 0.02
"""Tolerance: rad, below which series replace quotients, whose digits cancel: an error of 1e-13 on either side."""


def split(scene: Scene, start: State) -> tuple[State, State]:
    """The plane states along the rail, with the cart, and across it."""
    rest = rest_angles(scene)
    u, w = (np.cos(rest)[:, None] * part for part in (start.links, start.link_rates))
    theta = np.arctan2(np.hypot(u[:, 0], u[:, 1]), u[:, 2])
    s, r = (part[:, None] for part in factors(theta))
    p = u[:, :2] / s
    rate = (w[:, :2] + r / s * w[:, 2:] * p) / s
    return (
        State(rest + p[:, 0], rate[:, 0], start.cart, start.cart_rate),
        State(rest + p[:, 1], rate[:, 1]),
    )


def join(scene: Scene, along: Motion, across: Motion) -> Motion:
    """Unit vectors (T, L, 3) and their rates."""
    rest = rest_angles(scene)
    p = np.stack((along.links - rest, across.links - rest), axis=-1)
    rate = np.stack((along.link_rates, across.link_rates), axis=-1)
    theta, sigma = np.linalg.norm(p, axis=-1), np.cos(rest)[:, None]
    s, r = factors(theta)
    inner = np.sum(p * rate, axis=-1)
    u = sigma * np.concatenate((s[..., None] * p, np.cos(theta)[..., None]), axis=-1)
    flat = s[..., None] * rate + (r * inner)[..., None] * p
    w = sigma * np.concatenate((flat, (-s * inner)[..., None]), axis=-1)
    return Motion(u, w, along.cart, along.cart_rate, along.work)


def factors(theta: Floats) -> tuple[Floats, Floats]:
    """The s and r of angles θ ≥ 0 (rad)."""
    is_small = theta < SERIES_ANGLE
    safe = np.where(is_small, 1.0, theta)
    r = (safe * np.cos(safe) - np.sin(safe)) / safe**3
    series = -1 / 3 + theta**2 / 30 - theta**4 / 840
    return np.sinc(theta / np.pi), np.where(is_small, series, r)
