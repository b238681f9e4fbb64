"""Time scales of oscillation and decay, estimated from the linear modes."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from math import ceil, pi, sqrt

import numpy as np

from modal.assembly import matrices
from modal.errors import ComputationError, SceneError
from modal.modes import natural_modes
from modal.scene import Scene
from modal.types import Complexes
from nonlinear.system import system_of

SURVEYED_LINKS_MAX = 2000
"""Cost: links of a scene up to which its modes are computed for its time scales (benchmarks/simulation.py)."""
DENSE_LINKS_MAX = 300
"""Cost: likewise on a structure and with rotors, whose matrices are dense (benchmarks/simulation.py)."""
SAMPLES_PER_PERIOD = 24
"""Cost: default samples in a period of the fastest oscillation, between which cubics are right to 1e-5 of an angle."""
SAMPLES_MIN = 1000
"""Cost: default samples of a short run, which its figures show as a curve."""
SAMPLES_MAX = 100_000
"""Cost: default samples of a long run."""


@dataclass(frozen=True)
class Timescales:
    """The fastest oscillation or growth (rad/s) and the fastest decay (1/s) about equilibrium; `modal` if from modes.

    Otherwise they are estimates, from the shortest link and from each joint's damper and inertia separately.
    """

    swing: float
    decay: float
    modal: bool


modes_of = lru_cache(maxsize=4)(natural_modes)
"""The modes of a scene, computed once for the start, the times and the coordinates of a run."""


@lru_cache(maxsize=4)
def estimate_timescales(scene: Scene) -> Timescales:
    """The time scales of a scene's modes where these are cheap, else estimates."""
    if scene.is_structured and scene.n_links <= DENSE_LINKS_MAX:
        try:
            linear = matrices(scene.linearizable.still.unforced)
            size, M = len(linear.M), linear.M
            A = np.block(
                [[np.zeros((size, size)), np.eye(size)], [-np.linalg.solve(M, linear.K), -np.linalg.solve(M, linear.D)]]
            )
            return _timescales_of(np.linalg.eigvals(A).astype(complex), scene)
        except np.linalg.LinAlgError:  # masses so far apart that rounding leaves M singular
            return _estimate(scene)
    most = DENSE_LINKS_MAX if "rotor" in scene.features else SURVEYED_LINKS_MAX
    if scene.n_links <= most and not scene.is_structured:
        try:
            try:
                eigenvalue = modes_of(scene).eigenvalue
            except SceneError:  # forces that leave no equilibrium
                eigenvalue = modes_of(scene.replace(force=())).eigenvalue
        except ComputationError:
            return _estimate(scene)
        return _timescales_of(eigenvalue, scene)
    return _estimate(scene)


def _timescales_of(eigenvalues: Complexes, scene: Scene) -> Timescales:
    """The time scales of these eigenvalues (1/s)."""
    swings = np.abs(eigenvalues[(np.abs(eigenvalues.imag) > np.abs(eigenvalues.real)) | (eigenvalues.real > 0)])
    swing = float(swings.max(initial=0.0)) or _estimate(scene).swing
    return Timescales(swing, float(np.max(-eigenvalues.real, initial=0.0)), True)


def sample_count(duration: float, swing: float) -> int:
    """The default number of samples of a motion over `duration` (s) whose fastest oscillation is `swing` (rad/s)."""
    return max(ceil(min(duration * swing / (2 * pi) * SAMPLES_PER_PERIOD, SAMPLES_MAX)), SAMPLES_MIN)


def _estimate(scene: Scene) -> Timescales:
    system = system_of(scene)
    decay = max(float(np.max(group.block.damping / (group.moment + group.block.rotor))) for group in system.groups)
    if system.cart and system.cart.mass:
        decay = max(decay, system.cart.damping / system.cart.mass)
    shortest = min(link.length for link in scene.links())
    return Timescales(sqrt(4 * scene.gravity / shortest), decay, False)
