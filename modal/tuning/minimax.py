"""Minimization of a sum of maxima by sequential linear programming and Newton's method on the active pieces.

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

VALLEY_WIDTH = 0.15
"""Cost: trust region at first, in logarithms of numbers, within which a minimum is one that is known already."""
COARSE = 1e-3
"""Cost: changes of numbers and of the cost, in logarithms, at which a coarse descent ends and Newton begins."""
EDGE = 1e-9
"""Tolerance: logarithm by which a number is off its bound, or a limit exceeded: far below what is written."""
PENALTY = 20.0
"""Tolerance: of limits, in logarithms: above their multipliers, by how much costs fall where a limit is loosened."""
ROUNDS = 120
"""Cost: rounds of any search here at most; most end by themselves."""
GAIN_MIN = 1e-10
"""Tolerance: gain of a step at which a search ends: the eigenvalues of modes that meet have half of all digits."""
LABEL_STEP = 2e3
"""Format: labels of values other than peaks, which are bounds, are larger by a step, those of other cases by four."""


@dataclass(frozen=True, eq=False)
class Faces:
    """Values (P,) of the pieces of a cost or a limit with their gradients (P, n); `at` (P,) distinguishes them."""

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
        """The amount by which limits are exceeded."""
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
    """The minimum reached from z within bounds; a `coarse` one ends at a small trust region, or next to a known one."""
    point = evaluate(np.clip(z, low, high), True)
    if point.is_smooth:
        point = (_line_search if len(z) == 1 else _quasi_newton)(evaluate, point, low, high)
    minimum = _descend_by_programs(evaluate, point, low, high, coarse=coarse, minima=minima)
    rng = np.random.default_rng(1)
    for _ in range(0 if coarse else 4):
        if minimum.certain or not minimum.point.is_finite:
            break
        last = minimum.point
        aside = VALLEY_WIDTH / 3 * rng.uniform(-1.0, 1.0, len(z))
        start = evaluate(np.clip(last.z + aside, low, high), True)
        end = _descend_by_programs(evaluate, _quasi_newton(evaluate, start, low, high), low, high)
        minimum = end if end.point.merit <= last.merit else minimum
        gain = last.merit - minimum.point.merit
        minimum = replace(minimum, open=0.0 if minimum.certain else gain)
        if gain <= COARSE**2 * max(1.0, abs(last.merit)):
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
    radius, attempts = VALLEY_WIDTH, 0
    for _ in range(ROUNDS // 3 if coarse else ROUNDS):
        if not point.is_finite:
            break
        for minimum in minima:
            if minimum.certain and np.abs(minimum.point.z - point.z).max() < VALLEY_WIDTH:
                return minimum
        step = _linear_step(point, point.faces, low, high, radius)
        gain = point.merit - step.merit
        # each attempt costs several rounds, and where modes meet all of them fail
        if attempts < (3 if coarse else 6) and (radius <= VALLEY_WIDTH / 4 or gain <= COARSE):
            attempts += 1
            better = polish(evaluate, point, step.weights, low, high, enough=COARSE if coarse else 0.0)
            if better is not None:
                return Minimum(better, True)
        if gain <= GAIN_MIN * max(1.0, abs(point.merit)) or radius < (COARSE if coarse else EDGE):
            break
        trial = evaluate(np.clip(point.z + step.delta, low, high), False)
        if trial.merit > point.merit - gain / 2 and trial.is_finite:
            # second order: the linear pieces are moved to their values at the end of the step
            change = trial.z - point.z
            corrected_faces = [
                replace(face, values=trial_face.pick(face.at)[0] - face.gradients @ change)
                for face, trial_face in zip(point.faces, trial.faces, strict=True)
            ]
            delta = _linear_step(point, corrected_faces, low, high, radius).delta
            corrected_trial = evaluate(np.clip(point.z + delta, low, high), False)
            trial = min((trial, corrected_trial), key=lambda evaluation: evaluation.merit)
        decrease = point.merit - trial.merit
        if decrease > 0:
            point = evaluate(trial.z, True)
            radius = min(2 * radius, 0.5) if decrease > gain / 2 else radius
        else:
            radius = min(radius, float(np.abs(step.delta).max())) / 3
    return Minimum(point, False)


def _line_search(evaluate: Evaluate, start: Evaluation, low: Floats, high: Floats) -> Evaluation:
    """Where a descent of one number leads, perhaps a bound: by few evaluations, as each may be a long motion."""
    points = [start]

    def merit(z: Floats) -> tuple[float, Floats]:
        points.append(evaluate(z, True))
        return points[-1].merit, sum((face.gradients[0] for face in points[-1].costs), np.zeros_like(z))

    bounds = np.column_stack((low, high))
    scipy.optimize.minimize(
        merit, start.z, jac=True, bounds=bounds, method="L-BFGS-B", options={"ftol": GAIN_MIN, "gtol": 0.0}
    )
    return min(points, key=lambda point: point.merit)


def _quasi_newton(evaluate: Evaluate, start: Evaluation, low: Floats, high: Floats) -> Evaluation:
    """Where BFGS leads with a search for the weak conditions of Wolfe, which needs no gradient to be continuous.

    So it goes along ridges on which modes meet, where gradients grow without bound and linear programs stop
    [Lewis2013]. A point along a line is taken where the cost falls by a ten-thousandth of what its slope promises, and
    the slope by a quarter: requested any fall, where the cost is flat to rounding, a search halves its steps to the
    last digit.
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
        way *= min(1.0, 0.5 / np.abs(way).max(initial=1e-300))
        lower, upper, part = 0.0, np.inf, 1.0
        while upper - lower > EDGE:
            new_value, new_slope, point = merit(z + part * way)
            if new_value > value + 1e-4 * part * (slope @ way):
                upper = part
            elif new_slope @ way < 3 * (slope @ way) / 4:
                lower = part
            else:
                break
            part = (lower + upper) / 2 if np.isfinite(upper) else 2 * part
        if not value - new_value > GAIN_MIN * max(1.0, abs(value)):
            break
        step, change = part * way, new_slope - slope
        z, value, slope = z + step, new_value, new_slope
        best = min(best, point, key=lambda evaluation: evaluation.merit)
        curvature = step @ change
        if curvature > 0:
            projection = np.eye(n) - np.outer(step, change) / curvature
            inverse = projection @ inverse @ projection.T + np.outer(step, step) / curvature
    return best


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
    """Newton's method on the active pieces from a point; None if it does not settle at a point that is no worse."""
    faces = start_point.faces
    weights = tuple(_of_peaks(face, weight) for face, weight in zip(faces, weights, strict=True))
    active = [face.at[weight > EDGE] for face, weight in zip(faces, weights, strict=True)]
    multipliers = np.concatenate([weight[weight > EDGE] for weight in weights])
    costs = len(start_point.costs)
    if any(not len(at) for at in active[:costs]):
        return None
    free = ~((start_point.z <= low + EDGE) | (start_point.z >= high - EDGE))
    nudge = np.cbrt(np.finfo(float).eps)  # truncation and rounding of central differences are alike there
    z, n = start_point.z.copy(), int(free.sum())
    owners = np.repeat(np.arange(len(faces)), [len(at) for at in active])
    previous_change, start = np.inf, z.copy()
    for _ in range(ROUNDS):
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
                aside[column] += way * nudge
                point = evaluate(aside, True)
                if not point.is_finite:
                    return None
                pair.append(_active(point, active)[1][:, free])
            H[:, k] = multipliers @ (pair[0] - pair[1]) / (2 * nudge)
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
        if np.any(z < low - EDGE) or np.any(z > high + EDGE) or np.abs(z - start).max() > 0.5:
            return None
        previous_change = max(change, 1e-12)
        if change < max(1e-11, enough):
            break
    if previous_change > max(1e-6, enough) or np.any(multipliers < -1e-6):
        return None
    new_point = evaluate(np.clip(z, low, high), True)
    largest_merit = start_point.merit + GAIN_MIN * max(1.0, abs(start_point.merit))
    return new_point if new_point.is_finite and new_point.merit <= largest_merit else None


def _of_peaks(face: Faces, weights: Floats) -> Floats:
    """The multipliers of values next to peaks added to those of the nearest peak."""
    case = np.round(face.at / (4 * LABEL_STEP))
    is_secondary = face.at - 4 * LABEL_STEP * case > LABEL_STEP / 2
    multipliers = np.where(is_secondary, 0.0, weights)
    for k in np.flatnonzero(is_secondary & (weights > EDGE)).tolist():
        distances = np.where(is_secondary, np.inf, np.abs(face.at - (face.at[k] - LABEL_STEP)))
        multipliers[int(distances.argmin())] += weights[k]
    return multipliers


def _active(point: Evaluation, active: list[Floats]) -> tuple[Floats, Floats]:
    """Values (A,) and gradients (A, n) of the pieces with these labels."""
    parts = [face.pick(at) for face, at in zip(point.faces, active, strict=True)]
    return np.concatenate([part[0] for part in parts]), np.concatenate([part[1] for part in parts])
