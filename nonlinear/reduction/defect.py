"""The error of a closed-form motion, estimated without integrating the equations that it approximates.

Substituted into the full equations the motion leaves residual forces ρ(t) (`nonlinear.reduction.residual`).  To first
order its error e, the correction to be added to the motion, obeys the linear equations under them,

    M e'' + D e' + K e = −ρ(t),     e(0), e'(0) = the deviation of the motion from the start,

which are solved exactly for a ρ that is linear between samples [VanLoan1978],
all samples at once: y_k = E y_{k−1} + g_k by halving the number of samples until one is left.  A repetition for the
motion with e added gives a second term; where that is not small compared with the first, the series is not trustworthy.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil, frexp, inf, pi
from sys import float_info

import numpy as np

from modal.assembly import Matrices, matrices
from modal.eigen import is_singular
from modal.types import Floats
from nonlinear.integration.arguments import SAMPLES_MAX
from nonlinear.reduction.residual import BLOCK, SAMPLES_PER_PERIOD, residual_forces
from nonlinear.reduction.superposition import Flat, ModalSwing, Superposition
from nonlinear.system import System, system_of

LARGEST = 100
"""Cost: coordinates in one plane above which integration is cheaper (benchmarks/advice.py)."""
ACCELERATION_SHARE = 1e-3
"""Tolerance: of the largest acceleration, below which an oscillation is not sampled in each of its periods."""
DEFECT_SAFETY = 1.5
"""Tolerance: of 695 trustworthy estimates on random scenes none was below 1/1.2 of the error."""


@dataclass(frozen=True, eq=False)
class ErrorEstimate:
    """The error of a motion at `times` (T,) in s: `at` (T,) is the largest error of any link so far (rad).

    `trustworthy` says whether the second term of its series is small compared with the first; where it is not, the
    error is large.
    """

    times: Floats
    at: Floats
    trustworthy: bool

    @property
    def bounds(self) -> Floats:
        """Upper bounds of the error so far (rad), (T,): above the estimate, infinite if that is not trustworthy."""
        return np.full(len(self.at), inf) if not self.trustworthy else DEFECT_SAFETY * self.at

    @property
    def error(self) -> float:
        """The largest error of any link over the whole duration (rad)."""
        return float(self.at[-1])


def defect_error(motion: Superposition, duration: float) -> ErrorEstimate | None:
    """The error of a superposition with respect to the true motion within `duration` (s).

    None if it cannot be estimated cheaply: for many coordinates, many oscillations or a singular mass matrix.
    """
    if any(len(plane.start[0]) > LARGEST for plane in motion.planes):
        return None
    plane_matrices = [matrices(plane.scene) for plane in motion.planes]
    steps = max(BLOCK, ceil(duration * _fastest(motion.planes) / (2 * pi) * SAMPLES_PER_PERIOD))
    if steps > SAMPLES_MAX or any(is_singular(linear.M) for linear in plane_matrices):
        return None
    times = np.linspace(0.0, duration, steps + 1)
    with np.errstate(all="ignore"):
        return _estimate(motion, plane_matrices, times)


def _estimate(motion: Superposition, plane_matrices: list[Matrices], times: Floats) -> ErrorEstimate:
    system = system_of(motion.scene)
    on = system.first
    answers = [StepResponse.of(linear, times[1]) for linear in plane_matrices]
    deflections = [plane.deflections(times).transpose(0, 2, 1) for plane in motion.planes]
    gaps = [np.array(plane.start) - q[:2, :, 0] for plane, q in zip(motion.planes, deflections, strict=True)]
    rounding = _rounding(motion, answers, times, _largest(deflections, on)[-1])
    first = _correction(system, deflections, answers, gaps)
    improvements = [q + e for q, e in zip(deflections, first, strict=True)]
    second = _correction(system, improvements, answers, [0.0 * gap for gap in gaps])
    totals = [e + addition for e, addition in zip(first, second, strict=True)]
    first_angles, second_angles, at = (_largest(parts, on) for parts in (first, second, totals))
    at = np.nan_to_num(np.maximum(at, second_angles) + rounding, nan=np.inf)
    return ErrorEstimate(times, at, bool(second_angles[-1] <= first_angles[-1] / 2 + rounding[-1]))


def _correction(system: System, motions: list[Floats], answers: list[StepResponse], gaps: list[Floats]) -> list[Floats]:
    """The correction of the motion by the linear equations under −ρ: its q, q' and q'' (3, n, T) in each plane."""
    forces = residual_forces(system, motions)
    return [answer.to(-force, gap) for answer, force, gap in zip(answers, forces, gaps, strict=True)]


def _rounding(motion: Superposition, answers: list[StepResponse], times: Floats, size: float) -> Floats:
    """The effect of rounding on the largest angle of a motion of this size (rad), (T,).

    It grows with the phase; angles about an inverted equilibrium are rounded near π, an error that grows at the fastest
    rate.
    """
    radius = 1.0
    if motion.scene.stands:
        radius, size = max(1.0, *(float(np.abs(np.linalg.eigvals(answer.E)).max()) for answer in answers)), pi
    return np.asarray(
        float_info.epsilon * size * (1 + _fastest(motion.planes) * times) * radius ** np.arange(len(times))
    )


def _largest(planes: Sequence[Floats], on: int) -> Floats:
    """The largest angle (rad) of any link so far, (T,)."""
    angles = [plane[0, first:] for plane, first in zip(planes, (on, 0), strict=False)]
    return np.maximum.accumulate(np.sqrt(sum(angle**2 for angle in angles)).max(axis=0))


def _fastest(planes: Sequence[Flat]) -> float:
    """The largest |λ| (rad/s) of the significant oscillations."""
    swings = [swing for plane in planes for swing in plane.swings]
    weights = [_weight(swing) for swing in swings]
    least, pairs = ACCELERATION_SHARE * max(weights, default=0.0), zip(swings, weights, strict=True)
    return max((abs(swing.value) for swing, weight in pairs if weight >= least), default=0.0)


def _weight(swing: ModalSwing) -> float:
    """The acceleration (rad/s²) of an oscillation."""
    return abs(swing.value) * max(abs(swing.value * swing.eta), abs(swing.rate))


@dataclass(frozen=True, eq=False)
class StepResponse:
    """The step of M q'' + D q' + K q = f for (q, q'): y_k = E y_{k−1} + hold f_{k−1} + ramp (f_k − f_{k−1}).

    `law` (n, 3 n) gives q'' from q, q' and f.
    """

    E: Floats
    hold: Floats
    ramp: Floats
    law: Floats

    @staticmethod
    def of(linear: Matrices, step: float) -> StepResponse:
        """By series over a step halved until they converge quickly, which is then doubled as often."""
        n = len(linear.M)
        law = np.asarray(np.linalg.solve(linear.M, np.hstack((-linear.K, -linear.D, np.eye(n)))), dtype=np.float64)
        A = step * np.vstack((np.eye(2 * n)[n:], law[:, : 2 * n]))
        halvings = max(0, frexp(float(np.linalg.norm(A, 1)))[1] + 3)
        B = np.vstack((np.zeros((n, n)), step / 2.0**halvings * law[:, 2 * n :]))
        grown, hold_series, ramp_series = _series(A / 2.0**halvings)
        E, hold, ramp = grown, hold_series @ B, ramp_series @ B
        for _ in range(halvings):
            E, hold, ramp = E @ E, E @ hold + hold, (E @ ramp + hold + ramp) / 2
        return StepResponse(E, hold, ramp, law)

    def to(self, force: Floats, start: Floats) -> Floats:
        """The q, q' and q'' (3, n, T) under a force known at every step (n, T), from q and q' (2, n).

        The piecewise linear force is raised by a twelfth of its second difference at the samples: correct to the fourth
        order.
        """
        n, line = len(force), force.copy()
        line[:, 1:-1] -= np.diff(force, 2) / 12
        y = np.empty((force.shape[1], 2 * n))
        y[0] = start.ravel()
        y[1:] = line[:, :-1].T @ self.hold.T + np.diff(line).T @ self.ramp.T
        y = running(self.E, y).T
        return np.concatenate((y, self.law @ np.vstack((y, force)))).reshape(3, n, -1)


def running(E: Floats, g: Floats) -> Floats:
    """The y (T, m) of y_k = E y_{k−1} + g_k: every second one obeys the same with E², and gives the next one."""
    if len(g) == 1:
        return g
    y = g.copy()
    y[1::2] += y[:-1:2] @ E.T
    y[1::2] = running(E @ E, y[1::2])
    y[2::2] += y[1:-1:2] @ E.T
    return y


def _series(A: Floats) -> tuple[Floats, Floats, Floats]:
    """Σ A^k/k!, Σ A^k/(k+1)! and Σ A^k/(k+2)! of a matrix A with norm below 1/8."""
    term = np.eye(len(A))
    grown, hold, ramp = term, term, term / 2
    for k in range(1, 10):  # the tenth is below rounding
        term = term @ A / k
        grown, hold = grown + term, hold + term / (k + 1)
        ramp = ramp + term / ((k + 1) * (k + 2))
    return grown, hold, ramp
