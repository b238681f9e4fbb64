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
    evaluate: Evaluate, z: Floats, low: Floats, high: Floats, *, coarse: bool = False, known: Sequence[Minimum] = ()
) -> Minimum:
    """The minimum reached from z within bounds; a `coarse` one ends at a small trust region, or beside a known one."""
    here = evaluate(np.clip(z, low, high), True)
    if here.is_smooth:
        here = _quasi_newton(evaluate, here, low, high)
    minimum = _lowered(evaluate, here, low, high, coarse=coarse, known=known)
    rng = np.random.default_rng(1)
    for _ in range(0 if coarse else RESTARTS):
        if minimum.certain or not minimum.point.is_finite:
            break
        last = minimum.point
        start = evaluate(np.clip(last.z + ASIDE * rng.uniform(-1.0, 1.0, len(z)), low, high), True)
        end = _lowered(evaluate, _quasi_newton(evaluate, start, low, high), low, high)
        minimum = end if end.point.merit <= last.merit else minimum
        gain = last.merit - minimum.point.merit
        minimum = replace(minimum, open=0.0 if minimum.certain else gain)
        if gain <= OPEN * max(1.0, abs(last.merit)):
            break
    return minimum


def _lowered(
    evaluate: Evaluate,
    here: Evaluation,
    low: Floats,
    high: Floats,
    *,
    coarse: bool = False,
    known: Sequence[Minimum] = (),
) -> Minimum:
    """Where linear programs and Newton's method lead."""
    radius, tried = FIRST, 0
    for _ in range(FEWER if coarse else ROUNDS):
        if not here.is_finite:
            break
        for minimum in known:
            if minimum.certain and np.abs(minimum.point.z - here.z).max() < BESIDE:
                return minimum
        step = _linear_step(here, here.faces, low, high, radius)
        gain = here.merit - step.merit
        if tried < (TRIES // 2 if coarse else TRIES) and (radius <= NEAR or gain <= SMALL):
            tried += 1
            better = polished(evaluate, here, step.weights, low, high, enough=ROUGH if coarse else 0.0)
            if better is not None:
                return Minimum(better, True)
        if gain <= SETTLED * max(1.0, abs(here.merit)) or radius < (COARSE if coarse else FINE):
            break
        there = evaluate(np.clip(here.z + step.delta, low, high), False)
        if there.merit > here.merit - HALF * gain and there.is_finite:
            delta = _linear_step(here, _corrected(here, there), low, high, radius).delta
            other = evaluate(np.clip(here.z + delta, low, high), False)
            there = min((there, other), key=lambda minimum: minimum.merit)
        ratio = (here.merit - there.merit) / gain
        if ratio > POOR:
            here = evaluate(there.z, True)
            radius = min(2 * radius, LARGEST) if ratio > HALF else radius
        else:
            radius = min(radius, float(np.abs(step.delta).max())) / 3
    return Minimum(here, False)


def _quasi_newton(evaluate: Evaluate, here: Evaluation, low: Floats, high: Floats) -> Evaluation:
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
        beyond = z - inside
        return point.merit + PENALTY * np.abs(beyond).sum(), np.where(beyond, PENALTY * np.sign(beyond), slope), point

    z, n = here.z, len(here.z)
    value, slope, best = merit(z)
    inverse = np.eye(n)
    for _ in range(ROUNDS):
        way = -inverse @ slope
        way *= min(1.0, LARGEST / np.abs(way).max(initial=1e-300))
        short, long, part = 0.0, np.inf, 1.0
        for _ in range(HALVINGS):
            other, turned, point = merit(z + part * way)
            if other > value + FALL * part * (slope @ way):
                long = part
            elif turned @ way < STEEP * (slope @ way):
                short = part
            else:
                break
            part = (short + long) / 2 if np.isfinite(long) else 2 * part
        if not value - other > LEAST_GAIN * max(1.0, abs(value)):
            break
        step, change = part * way, turned - slope
        z, value, slope = z + step, other, turned
        best = min(best, point, key=lambda evaluation: evaluation.merit)
        if (curved := step @ change) > 0:
            across = np.eye(n) - np.outer(step, change) / curved
            inverse = across @ inverse @ across.T + np.outer(step, step) / curved
    return best


def _corrected(here: Evaluation, there: Evaluation) -> tuple[Faces, ...]:
    """The pieces of a point, with their values such that those at the end of a step are right (second order)."""
    change = there.z - here.z
    corrected = []
    for face, other in zip(here.faces, there.faces, strict=True):
        values = other.pick(face.at)[0] - face.gradients @ change
        corrected.append(Faces(values, face.gradients, face.at))
    return tuple(corrected)


def _linear_step(here: Evaluation, faces: Sequence[Faces], low: Floats, high: Floats, radius: float) -> _Step:
    """The best step of linearized pieces within a trust region about a point, and the multipliers of all pieces."""
    n, costs = len(here.z), len(here.costs)
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
        *zip(np.maximum(-radius, low - here.z), np.minimum(radius, high - here.z), strict=True),
        *[(None, None)] * costs,
        *[(0.0, None)] * (len(faces) - costs),
    ]
    solution = scipy.optimize.linprog(c, A_ub=A, b_ub=b, bounds=bounds, method="highs")
    if solution.x is None:
        return _Step(np.zeros(n), here.merit, tuple(np.zeros(size) for size in sizes))
    weights = np.split(-np.asarray(solution.ineqlin.marginals), np.cumsum(sizes)[:-1])
    return _Step(np.asarray(solution.x[:n]), float(solution.fun), tuple(weights))


def polished(
    evaluate: Evaluate, here: Evaluation, weights: tuple[Floats, ...], low: Floats, high: Floats, enough: float = 0.0
) -> Evaluation | None:
    """Newton's method on the active pieces from a point; None where it does not settle at a point that is no worse."""
    faces = here.faces
    weights = tuple(_of_peaks(face, weight) for face, weight in zip(faces, weights, strict=True))
    active = [face.at[weight > ACTIVE] for face, weight in zip(faces, weights, strict=True)]
    multipliers = np.concatenate([weight[weight > ACTIVE] for weight in weights])
    costs = len(here.costs)
    if any(not len(at) for at in active[:costs]):
        return None
    edge = 1e-9
    free = ~((here.z <= low + edge) | (here.z >= high - edge))
    z, n = here.z.copy(), int(free.sum())
    owners = np.repeat(np.arange(len(faces)), [len(at) for at in active])
    before, start = np.inf, z.copy()
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
        if not np.isfinite(change) or change > 0.5 * min(before, 1.0):
            break
        z[free] += step[:n]
        multipliers = multipliers + step[n : n + m]
        if np.any(z < low - edge) or np.any(z > high + edge) or np.abs(z - start).max() > 0.5:
            return None
        before = max(change, 1e-12)
        if change < max(1e-11, enough):
            break
    if before > max(1e-6, enough) or np.any(multipliers < -1e-6):
        return None
    there = evaluate(np.clip(z, low, high), True)
    return there if there.is_finite and there.merit <= here.merit + WORSE * max(1.0, abs(here.merit)) else None


def _of_peaks(face: Faces, weights: Floats) -> Floats:
    """The multipliers of values beside peaks added to those of the nearest peak."""
    beside = face.at - APART * np.round(face.at / APART) > HELPING / 2
    multipliers = np.where(beside, 0.0, weights)
    for k in np.flatnonzero(beside & (weights > ACTIVE)).tolist():
        multipliers[int(np.where(beside, np.inf, np.abs(face.at - (face.at[k] - HELPING))).argmin())] += weights[k]
    return multipliers


def _active(point: Evaluation, active: list[Floats]) -> tuple[Floats, Floats]:
    """Values (A,) and gradients (A, n) of the pieces with these labels."""
    parts = [face.pick(at) for face, at in zip(point.faces, active, strict=True)]
    return np.concatenate([part[0] for part in parts]), np.concatenate([part[1] for part in parts])
