"""Parametric excitation: a support that moves up and down as a sine makes gravity vary with time.

About the equilibrium, with the support's velocity v(t) and acceleration a(t) upwards, small angles obey Hill's equation

    M θ'' + (D + D_v) θ' + (K + a(t) diag p + v(t) diag s) θ = 0,    p_i = σ_i b_i

in which the air that streams past a centre presses on it with (d + q |v|) v, drag d and quadratic drag q, as its weight
does: s are the sums p with d + q |v| in place of masses, and D_v the damping of q |v| beside that of d in D.

Solutions grow where a Floquet multiplier, an eigenvalue of the matrix that takes (θ, θ') across one period, lies
outside the unit circle.  One undamped pendulum obeys Mathieu's equation, whose unstable regions are the tongues of the
chart of Ince and Strutt (McLachlan, Theory and Application of Mathieu Functions, 1947, §4.10), and an inverted one
stands where a²Ω² exceeds about 2 g l (Kapitza, 1951; Landau & Lifshitz, Mechanics, §30).
"""

from __future__ import annotations

from dataclasses import dataclass
from math import log

import numpy as np
import scipy

from modal.assembly import matrices, quadratic_drags
from modal.errors import SceneError
from modal.report import Displayed
from modal.scene import Moved, Scene, SineMotion
from modal.statespace.signals import geometry_of
from modal.types import Complexes
from modal.vibration.prescribed import prescribed_motion

TOLERANCE = 1e-12
MOST_LINKS = 60
CERTAIN = 1e-8  # distance from 1 above which a multiplier counts as larger or smaller


@dataclass(frozen=True, eq=False, repr=False)
class ParametricStability(Displayed):
    """Floquet multipliers (2n,) of the small angles of a scene over one `period` (s) of its support, largest first."""

    multipliers: Complexes
    period: float

    @property
    def growth_rate(self) -> float:
        """The rate (1/s) at which small angles grow, negative where they decay."""
        return log(max(float(abs(self.multipliers[0])), 1e-300)) / self.period

    @property
    def grows(self) -> bool:
        """Whether small angles grow."""
        return bool(abs(self.multipliers[0]) > 1 + CERTAIN)

    @property
    def words(self) -> str:
        """One line."""
        size = abs(self.multipliers[0])
        what = "grow" if self.grows else "decay" if size < 1 - CERTAIN else "neither grow nor decay"
        return f"small angles {what}: the largest Floquet multiplier of a period is {size:.6g}"


def parametric_stability(scene: Scene) -> ParametricStability:
    """Of a scene whose support moves up and down as a sine; SceneError for any other and for over MOST_LINKS links."""
    support = scene.support
    sine = support.motion if isinstance(support, Moved) else None
    if not (isinstance(sine, SineMotion) and sine.direction == "vertical"):
        raise SceneError(["support.motion: parametric stability needs a vertical sine"])
    if scene.n_links > MOST_LINKS:
        raise SceneError(
            [f"the scene has {scene.n_links} links: Floquet multipliers are computed for at most {MOST_LINKS}"]
        )
    found, geometry, motion = matrices(scene), geometry_of(scene), prescribed_motion(sine)
    n = len(found.M)
    solved = np.linalg.solve(found.M, np.hstack([found.K, found.D, geometry.centres.T]))
    K, D, forced = np.split(solved, [n, 2 * n], axis=1)
    inverse, quadratic = np.linalg.inv(found.M), quadratic_drags(scene)

    def rate(time: float, y: np.ndarray) -> np.ndarray:
        angles, rates = y.reshape(2, n, 2 * n)
        speed = motion.velocity_at(time)
        beside = quadratic * abs(speed)
        pressed = geometry.centres.T @ (geometry.mass * motion.acceleration_at(time) + (geometry.drag + beside) * speed)
        slowed = D @ rates + (forced * beside) @ (geometry.centres @ rates)
        return np.concatenate((rates, -K @ angles - inverse * pressed @ angles - slowed)).ravel()

    scale = max(float(np.sqrt(np.abs(K).max())), 1e-300)
    size = np.diag(np.concatenate((np.ones(n), np.full(n, scale))))
    period = 1 / sine.frequency_hz
    run = scipy.integrate.solve_ivp(
        rate,
        (0.0, period),
        size.ravel(),
        "DOP853",
        t_eval=[period],
        rtol=TOLERANCE,
        atol=TOLERANCE * np.outer(np.diag(size), np.ones(2 * n)).ravel(),
    )
    across = np.linalg.solve(size, run.y[:, -1].reshape(2 * n, 2 * n))
    values = np.linalg.eigvals(across)
    return ParametricStability(values[np.argsort(-np.abs(values))].astype(np.complex128), period)
