"""The least of a sum of largest numbers, by a sequence of linear programs and Newton's method on what is active.

A step δ from z solves, within a trust region and the bounds,

    min Σ_j t_j + ρ Σ_k s_k,      a_ij + ∇a_ij·δ ≤ t_j,      c_ik + ∇c_ik·δ ≤ s_k,   s_k ≥ 0

for every piece a_ij of the costs j and c_ik of the limits k [Madsen1975], [Fletcher1987, ch. 14].  Where the
multipliers λ have settled, Newton's method solves

    Σ λ_ij ∇a_ij + Σ μ_ik ∇c_ik = 0,    a_ij = t_j,    Σ_i λ_ij = 1,    c_ik = 0

for the active pieces, such as two equal peaks; the second derivatives are differences of the exact first ones.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from modal.types import Floats

FIRST, LARGEST, COARSE, FINE = 0.15, 0.5, 2e-3, 1e-9
"""Trust region in logarithms of numbers: at first, at most, and at the end of a coarse and of a fine descent."""
NEAR, SMALL, ROUGH = 0.04, 1e-3, 1e-3
"""Trust region or gain at which Newton's method is tried, and the change at which a coarse one ends."""
POOR, HALF = 0.05, 0.6
"""Parts of the promised gain from which on a step is taken, and the trust region grows."""
PENALTY = 20.0
ROUNDS, FEWER, NEWTONS, TRIES = 120, 40, 8, 6
FALL, STEEP, HALVINGS = 1e-4, 0.9, 30
"""Parts of the slope for Wolfe's conditions, and points tried along a line."""
LEAST_GAIN = 1e-10
"""Gain of a step at which BFGS ends: the eigenvalues of modes that meet have half of all digits."""
ASIDE, RESTARTS, OPEN = 0.05, 4, 1e-5
"""How far beside its end a descent begins anew, how often at most, and the gain that is not worth another."""
BESIDE = 0.1
"""Distance from a known minimum at which a coarse descent ends in it."""
SETTLED = 1e-13
ACTIVE = 1e-7
NUDGE = 2e-5
"""Step of the differences of gradients."""
ALLOWED = 1e-9
"""By how much a limit may be exceeded, relative."""
WORSE = 1e-11
APART, HELPING = 1e4, 2e3
"""Differences of the labels of pieces of different cases, and of values beside peaks, which are bounds, from peaks."""


@dataclass(frozen=True, eq=False)
class Faces:
    """Values (P,) of the pieces of a cost or a limit with their gradients (P, n); `at` (P,) tells them apart."""

    values: Floats
    gradients: Floats
    at: Floats

    @property
    def largest(self) -> float:
        """The cost itself."""
        return float(self.values.max()) if len(self.values) else np.inf

    def pick(self, at: Floats) -> tuple[Floats, Floats]:
        """Values and gradients of the pieces nearest to these labels."""
        rows = [int(np.abs(self.at - label).argmin()) for label in at.tolist()]
        return self.values[rows], self.gradients[rows]


@dataclass(frozen=True, eq=False)
class Evaluation:
    """Costs and limits at z (n,)."""

    z: Floats
    costs: tuple[Faces, ...]
    limits: tuple[Faces, ...]

    @property
    def faces(self) -> tuple[Faces, ...]:
        """Those of all costs, then of all limits."""
        return (*self.costs, *self.limits)

    @property
    def is_finite(self) -> bool:
        """Whether every cost and limit has a value."""
        return all(len(face.values) and np.all(np.isfinite(face.values)) for face in self.faces)

    @property
    def is_smooth(self) -> bool:
        """Whether every cost has one piece, and nothing limits them."""
        return self.is_finite and not self.limits and all(len(face.values) == 1 for face in self.costs)

    @property
    def cost(self) -> float:
        """The sum of the costs."""
        return sum(face.largest for face in self.costs) if self.is_finite else np.inf

    @property
    def excess(self) -> float:
        """By how much limits are exceeded."""
        return sum(max(face.largest, 0.0) for face in self.limits) if self.is_finite else np.inf

    @property
    def merit(self) -> float:
        """The cost with a penalty for limits that are exceeded."""
        return self.cost + PENALTY * self.excess if self.is_finite else np.inf


Evaluate = Callable[[Floats, bool], Evaluation]
"""A point at z, with gradients where the second argument says so."""


@dataclass(frozen=True, eq=False)
class Minimum:
    """Where a descent ended: `certain` after Newton's method; else the last descent still gained so much `open`."""

    point: Evaluation
    certain: bool
    open: float = 0.0


@dataclass(frozen=True, eq=False)
class _Step:
    delta: Floats
    merit: float
    weights: tuple[Floats, ...]


def descend(
    evaluate: Evaluate, z: Floats, low: Floats, high: Floats, *, coarse: bool = False, minima: Sequence[Minimum] = ()
) -> Minimum:
    """The minimum reached from z within bounds; a `coarse` one ends at a small trust region, or beside a known one."""
    point = evaluate(np.clip(z, low, high), True)
    if point.is_smooth:
        point = _quasi_newton(evaluate, point, low, high)
    minimum = _descend_by_programs(evaluate, point, low, high, coarse=coarse, minima=minima)
    rng = np.random.default_rng(1)
    for _ in range(0 if coarse else RESTARTS):
        if minimum.certain or not minimum.point.is_finite:
            break
        last = minimum.point
        start = evaluate(np.clip(last.z + ASIDE * rng.uniform(-1.0, 1.0, len(z)), low, high), True)
        end = _descend_by_programs(evaluate, _quasi_newton(evaluate, start, low, high), low, high)
        minimum = end if end.point.merit <= last.merit else minimum
        gain = last.merit - minimum.point.merit
        minimum = replace(minimum, open=0.0 if minimum.certain else gain)
        if gain <= OPEN * max(1.0, abs(last.merit)):
            break
    return minimum


def _descend_by_programs(
    evaluate: Evaluate,
    point: Evaluation,
    low: Floats,
    high: Floats,
    *,
    coarse: bool = False,
    minima: Sequence[Minimum] = (),
) -> Minimum:
    """Where linear programs and Newton's method lead."""
    radius, attempts = FIRST, 0
    for _ in range(FEWER if coarse else ROUNDS):
        if not point.is_finite:
            break
        for minimum in minima:
            if minimum.certain and np.abs(minimum.point.z - point.z).max() < BESIDE:
                return minimum
        step = _linear_step(point, point.faces, low, high, radius)
        gain = point.merit - step.merit
        if attempts < (TRIES // 2 if coarse else TRIES) and (radius <= NEAR or gain <= SMALL):
            attempts += 1
            better = polish(evaluate, point, step.weights, low, high, enough=ROUGH if coarse else 0.0)
            if better is not None:
                return Minimum(better, True)
        if gain <= SETTLED * max(1.0, abs(point.merit)) or radius < (COARSE if coarse else FINE):
            break
        trial = evaluate(np.clip(point.z + step.delta, low, high), False)
        if trial.merit > point.merit - HALF * gain and trial.is_finite:
            delta = _linear_step(point, _correct_faces(point, trial), low, high, radius).delta
            corrected_trial = evaluate(np.clip(point.z + delta, low, high), False)
            trial = min((trial, corrected_trial), key=lambda minimum: minimum.merit)
        ratio = (point.merit - trial.merit) / gain
        if ratio > POOR:
            point = evaluate(trial.z, True)
            radius = min(2 * radius, LARGEST) if ratio > HALF else radius
        else:
            radius = min(radius, float(np.abs(step.delta).max())) / 3
    return Minimum(point, False)


def _quasi_newton(evaluate: Evaluate, start: Evaluation, low: Floats, high: Floats) -> Evaluation:
    """Where BFGS leads with a search for the weak conditions of Wolfe, which needs no gradient to be continuous.

    So it goes along ridges on which modes meet, where gradients grow without bound and linear programs stop
    [Lewis2013].
    """

    def merit(z: Floats) -> tuple[float, Floats, Evaluation]:
        inside = np.clip(z, low, high)
        point = evaluate(inside, True)
        if not point.is_finite:
            return np.inf, np.zeros_like(z), point
        limits = zip(point.limits, [PENALTY] * len(point.limits), strict=True)
        steep = [(face, 1.0) for face in point.costs] + [(face, weight) for face, weight in limits if face.largest > 0]
        slope = sum((weight * face.gradients[face.values.argmax()] for face, weight in steep), np.zeros_like(z))
        excess = z - inside
        return point.merit + PENALTY * np.abs(excess).sum(), np.where(excess, PENALTY * np.sign(excess), slope), point

    z, n = start.z, len(start.z)
    value, slope, best = merit(z)
    inverse = np.eye(n)
    for _ in range(ROUNDS):
        way = -inverse @ slope
        way *= min(1.0, LARGEST / np.abs(way).max(initial=1e-300))
        lower, upper, part = 0.0, np.inf, 1.0
        for _ in range(HALVINGS):
            new_value, new_slope, point = merit(z + part * way)
            if new_value > value + FALL * part * (slope @ way):
                upper = part
            elif new_slope @ way < STEEP * (slope @ way):
                lower = part
            else:
                break
            part = (lower + upper) / 2 if np.isfinite(upper) else 2 * part
        if not value - new_value > LEAST_GAIN * max(1.0, abs(value)):
            break
        step, change = part * way, new_slope - slope
        z, value, slope = z + step, new_value, new_slope
        best = min(best, point, key=lambda evaluation: evaluation.merit)
        if (curvature := step @ change) > 0:
            projection = np.eye(n) - np.outer(step, change) / curvature
            inverse = projection @ inverse @ projection.T + np.outer(step, step) / curvature
    return best


def _correct_faces(point: Evaluation, trial: Evaluation) -> tuple[Faces, ...]:
    """The pieces of a point, with their values such that those at the end of a step are right (second order)."""
    change = trial.z - point.z
    faces = []
    for face, trial_face in zip(point.faces, trial.faces, strict=True):
        values = trial_face.pick(face.at)[0] - face.gradients @ change
        faces.append(Faces(values, face.gradients, face.at))
    return tuple(faces)


def _linear_step(point: Evaluation, faces: Sequence[Faces], low: Floats, high: Floats, radius: float) -> _Step:
    """The best step of linearized pieces within a trust region about a point, and the multipliers of all pieces."""
    n, costs = len(point.z), len(point.costs)
    sizes = [len(face.values) for face in faces]
    A = np.zeros((sum(sizes), n + len(faces)))
    b = np.concatenate([-face.values for face in faces])
    row = 0
    for k, face in enumerate(faces):
        span = slice(row, row + sizes[k])
        A[span, :n], A[span, n + k] = face.gradients, -1.0
        row += sizes[k]
    c = np.concatenate((np.zeros(n), np.ones(costs), np.full(len(faces) - costs, PENALTY)))
    bounds = [
        *zip(np.maximum(-radius, low - point.z), np.minimum(radius, high - point.z), strict=True),
        *[(None, None)] * costs,
        *[(0.0, None)] * (len(faces) - costs),
    ]
    solution = scipy.optimize.linprog(c, A_ub=A, b_ub=b, bounds=bounds, method="highs")
    if solution.x is None:
        return _Step(np.zeros(n), point.merit, tuple(np.zeros(size) for size in sizes))
    weights = np.split(-np.asarray(solution.ineqlin.marginals), np.cumsum(sizes)[:-1])
    return _Step(np.asarray(solution.x[:n]), float(solution.fun), tuple(weights))


def polish(
    evaluate: Evaluate,
    start_point: Evaluation,
    weights: tuple[Floats, ...],
    low: Floats,
    high: Floats,
    enough: float = 0.0,
) -> Evaluation | None:
    """Newton's method on the active pieces from a point; None where it does not settle at a point that is no worse."""
    faces = start_point.faces
    weights = tuple(_of_peaks(face, weight) for face, weight in zip(faces, weights, strict=True))
    active = [face.at[weight > ACTIVE] for face, weight in zip(faces, weights, strict=True)]
    multipliers = np.concatenate([weight[weight > ACTIVE] for weight in weights])
    costs = len(start_point.costs)
    if any(not len(at) for at in active[:costs]):
        return None
    edge = 1e-9
    free = ~((start_point.z <= low + edge) | (start_point.z >= high - edge))
    z, n = start_point.z.copy(), int(free.sum())
    owners = np.repeat(np.arange(len(faces)), [len(at) for at in active])
    previous_change, start = np.inf, z.copy()
    for _ in range(NEWTONS):
        point = evaluate(z, True)
        if not point.is_finite:
            return None
        values, gradients = _active(point, active)
        gradients = gradients[:, free]
        levels = [values[owners == j].mean() if j < costs else 0.0 for j in range(len(faces))]
        H = np.zeros((n, n))
        for k, column in enumerate(np.flatnonzero(free).tolist()):
            pair = []
            for way in (1, -1):
                aside = z.copy()
                aside[column] += way * NUDGE
                point = evaluate(aside, True)
                if not point.is_finite:
                    return None
                pair.append(_active(point, active)[1][:, free])
            H[:, k] = multipliers @ (pair[0] - pair[1]) / (2 * NUDGE)
        H = (H + H.T) / 2
        m, size = len(values), len(values) + n + costs
        J, right = np.zeros((size, size)), np.zeros(size)
        J[:n, :n], J[:n, n : n + m] = H, gradients.T
        right[:n] = -(gradients.T @ multipliers)
        J[n : n + m, :n] = gradients
        right[n : n + m] = -(values - np.array(levels)[owners])
        for j in range(costs):
            weight = owners == j
            J[n : n + m, n + m + j][weight] = -1.0
            J[n + m + j, n : n + m] = weight
            right[n + m + j] = 1.0 - multipliers[weight].sum()
        step = np.linalg.lstsq(J, right, rcond=1e-13)[0]
        change = float(np.abs(step[:n]).max(initial=0.0))
        if not np.isfinite(change) or change > 0.5 * min(previous_change, 1.0):
            break
        z[free] += step[:n]
        multipliers = multipliers + step[n : n + m]
        if np.any(z < low - edge) or np.any(z > high + edge) or np.abs(z - start).max() > 0.5:
            return None
        previous_change = max(change, 1e-12)
        if change < max(1e-11, enough):
            break
    if previous_change > max(1e-6, enough) or np.any(multipliers < -1e-6):
        return None
    new_point = evaluate(np.clip(z, low, high), True)
    return (
        new_point
        if new_point.is_finite and new_point.merit <= start_point.merit + WORSE * max(1.0, abs(start_point.merit))
        else None
    )


def _of_peaks(face: Faces, weights: Floats) -> Floats:
    """The multipliers of values beside peaks added to those of the nearest peak."""
    is_secondary = face.at - APART * np.round(face.at / APART) > HELPING / 2
    multipliers = np.where(is_secondary, 0.0, weights)
    for k in np.flatnonzero(is_secondary & (weights > ACTIVE)).tolist():
        multipliers[int(np.where(is_secondary, np.inf, np.abs(face.at - (face.at[k] - HELPING))).argmin())] += weights[
            k
        ]
    return multipliers


def _active(point: Evaluation, active: list[Floats]) -> tuple[Floats, Floats]:
    """Values (A,) and gradients (A, n) of the pieces with these labels."""
    parts = [face.pick(at) for face, at in zip(point.faces, active, strict=True)]
    return np.concatenate([part[0] for part in parts]), np.concatenate([part[1] for part in parts])
