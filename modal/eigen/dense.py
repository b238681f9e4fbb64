"""The dense method, for small scenes without a structured one.

Undamped: the symmetric eigenvalue problem K φ = ω² M φ, also with inverted links and an indefinite K. Free motions are
eliminated first, and their momentum with them, so that they are exact.

With dampers, M q'' + D q' + K q = 0, each eigenvalue is from a problem scaled to a rate of its own magnitude.

Dampers spread the eigenvalues: a stiff one gives a fast decay d/m and a slow one k/d in addition to the oscillations
√(k/m), and one matrix is accurate only for eigenvalues near its own norm. So the quadratic problem is solved once for
every magnitude of rates that its diagonal suggests. For the rate γ, with λ = γμ and the coordinates scaled so that P =
γ²M + γD + K has a unit diagonal, Cayley's θ = (μ + 1)/(μ − 1) turns it into

    P θ² x + 2(γ²M − K) θ x + (γ²M − γD + K) x = 0,

whose matrices are all bounded: decaying modes have |θ| < 1, and a backward error δ changes μ by 2δ/|θ² − 1| of itself.
Above every growth rate P is positive definite; at one it is singular, and γ is shifted.  Solutions for neighbouring γ
are joined at a gap that both resolve, and more are computed where the bounds require it.  A joint dominated by its
damper has the difference of its angles as its coordinate, so that P keeps what D would mask.
(Scaling by such magnitudes: [Gaubert2009].)
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import reduce
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from modal.assembly.modal_damping import in_factors
from modal.eigen.amplitude import LIGHT
from modal.eigen.sources import UNCERTAIN
from modal.errors import ComputationError
from modal.types import EPS, Complexes, Floats, Ints

LARGEST_DAMPED = 500
"""Limit: coordinates with dampers, refused beyond as `refuse_beyond` says."""
LARGEST_UNDAMPED = 2000
"""Limit: coordinates without dampers, refused beyond as `refuse_beyond` says."""
SINGULAR = (
    "the mass matrix is singular to double precision (as with a massless cart over bobs): with dampers or "
    "inverted links this scene has no state-space form; give the cart or the links some inertia"
)


@dataclass(frozen=True, eq=False)
class Eigen:
    """Eigenvalues λ (R,), one of each conjugate pair, with shapes (size, R) and relative error bounds (R,).

    `order` is the order of the matrix whose eigenvalues they are, `number` how many such matrices were solved.
    """

    eigenvalue: Complexes
    shape: NDArray[np.inexact]
    error: Floats
    order: int
    number: int = 1


def undamped_modes(M: Floats, K: Floats, total_inertia: Floats, *, singular: bool) -> Eigen:
    """Modes of K φ = ω² M φ, K positive definite; M is `total_inertia` less that of omitted motions.

    If M is known to be `singular` by one dimension, the mode at infinite frequency is omitted.
    """
    scale, L, sensitivity = _scaled_factor(K)
    inverse_square, v = np.linalg.eigh(in_factors(L, M * scale * scale[:, None]))
    inverse_square, v = inverse_square[singular:], v[:, singular:]
    if inverse_square.size and inverse_square[0] <= 4 * len(M) * EPS * inverse_square[-1]:
        raise ComputationError("the frequencies spread too far for the dense route that this scene needs")
    inverse_square, v = inverse_square[::-1], v[:, ::-1]
    shape = scale[:, None] * np.linalg.solve(L.T, v)
    largest = np.trace(in_factors(L, total_inertia * scale * scale[:, None]))
    error = 2 * len(M) * EPS * (sensitivity + largest / inverse_square)
    return Eigen(1j / np.sqrt(inverse_square), shape, error, len(L))


def indefinite_modes(M: Floats, K: Floats, *, terms: Floats, loss_factor: float = 1.0) -> Eigen:
    """Modes of K φ = x M φ about an equilibrium that may be unstable: λ = i√x, and for x < 0 the growth rate √−x > 0.

    `terms` (size,) are the sums of the absolute terms of K's diagonal, where springs and gravity may cancel;
    `loss_factor` multiplies errors because of subtractions from M. The decaying counterpart −√−x of a growing mode has
    the same shape and is not listed.
    """
    scale, L, sensitivity = _scaled_factor(M)
    x, v = np.linalg.eigh(in_factors(L, K * scale * scale[:, None]))
    shape = scale[:, None] * np.linalg.solve(L.T, v)
    x = np.where(x == 0, np.finfo(float).tiny, x)
    largest = max(np.abs(x).max(initial=0.0), (terms * scale**2).max(initial=0.0))
    error = 2 * len(M) * EPS * sensitivity * loss_factor * largest / np.abs(x)
    value = np.sqrt(np.abs(x)) * np.where(x < 0, 1.0, 1j)
    return Eigen(value, shape, error, len(L))


def in_phase(shape: NDArray[np.inexact], first: int) -> NDArray[np.inexact]:
    """Rotate each column in the complex plane so that its largest entry in rows `first` … is real and positive."""
    entries = shape[first:]
    leading = np.take_along_axis(entries, np.abs(entries).argmax(0)[None], 0)[0]
    size = np.abs(leading)
    return shape * np.where(size > 0, leading.conj() / np.where(size > 0, size, 1.0), 1.0)


def _scaled_factor(S: Floats) -> tuple[Floats, Floats, float]:
    """Scale to a unit diagonal, Cholesky factor, and sensitivity ‖L⁻¹‖² of a positive definite matrix.

    Roundings of the scaled entries change its quadratic form by at most this factor times their sum.
    """
    scale = 1 / np.sqrt(np.diag(S))
    L = np.asarray(np.linalg.cholesky(S * scale * scale[:, None]), dtype=np.float64)
    return scale, L, float(np.linalg.norm(np.linalg.inv(L), 2) ** 2) if len(S) else 1.0


def is_singular(M: Floats) -> bool:
    """Whether a positive semidefinite matrix, scaled to a unit diagonal, has lost a dimension to rounding."""
    if np.any(np.diag(M) <= 0):
        return True
    scale = 1 / np.sqrt(np.diag(M))
    spectrum = np.linalg.eigvalsh(M * scale * scale[:, None])
    return bool(spectrum[0] <= 4 * EPS * spectrum[-1])


def refuse_beyond(largest: int, size: int, cause: str) -> None:
    """Raise ComputationError for more coordinates than this method allows."""
    if size > largest:
        raise ComputationError(
            f"{cause} need the dense route: {size} coordinates, at most {largest} "
            "(equal pendula count once; without them any size works)"
        )


RATIO_OF_RATES = 1e2
"""Tolerance: ratio up to which rates are solved together: one digit either way."""
FACTORS_OF_RATE = (1.0, 2.0, 0.5)
"""Factor by which a rate may be shifted."""


class Dampers(NamedTuple):
    """Strength of the damper between each coordinate and the one `parents` it (−1: the ground), both (size,).

    Others, such as drag, act on the coordinates with D = `roots`ᵀ diag(`signs`) `roots`, (R, size).  Those below 0
    supply energy.
    """

    strength: Floats
    parents: Ints
    roots: Floats | None = None
    signs: Floats | None = None


@dataclass(frozen=True, eq=False)
class _QuadraticProblem:
    """M, K, the absolute terms of which K is the sum, all (size, size), the dampers, and C of D_modal = CᵀC."""

    M: Floats
    K: Floats
    sizes: Floats
    dampers: Dampers
    modal: Floats

    @property
    def rates(self) -> list[float]:
        """√(k/m) or, where a damper dominates, d/m and k/d of every coordinate; those within RATIO_OF_RATES merged."""
        m, d, k = np.diag(self.M), np.abs(self.dampers.strength), np.diag(self.sizes)
        if self.dampers.roots is not None:
            d = d + (self.dampers.roots**2).sum(0)
        strong = d > np.sqrt(m) * np.sqrt(k)
        candidates = np.concatenate([np.sqrt(k / m)[~strong], (d / m)[strong], (k[strong] / d[strong])])
        ascending = np.sort(candidates[candidates > 0])
        rates = []
        while ascending.size:
            is_near = ascending <= RATIO_OF_RATES * ascending[0]
            rates.append(float(np.sqrt(ascending[0]) * np.sqrt(ascending[is_near][-1])))
            ascending = ascending[~is_near]
        return rates

    def joint_coordinates(self, rate: float) -> tuple[Floats, Floats]:
        """Coordinates q (size, size) as columns of the old ones, and each damper's displacement in terms of q, by rows.

        A joint whose damper outweighs everything else on its link at this rate is described by the difference of its
        angles.
        """
        strength, parents = np.abs(self.dampers.strength), self.dampers.parents
        is_stiff = (parents >= 0) & (rate * strength > rate * (rate * np.diag(self.M)) + np.diag(self.sizes))
        basis = np.eye(len(strength))
        for i in np.flatnonzero(is_stiff):
            basis[i] += basis[parents[i]]
        return basis, basis - np.where(parents[:, None] >= 0, basis[parents], 0.0)


@dataclass(frozen=True, eq=False)
class _Solution:
    """All eigenvalues (N,) by magnitude, shapes (size, N) and relative error bounds (N,)."""

    value: Complexes
    shape: Complexes
    error: Floats

    def take(self, chosen: Ints | slice) -> _Solution:
        return _Solution(self.value[chosen], self.shape[:, chosen], self.error[chosen])

    @property
    def gaps(self) -> np.typing.NDArray[np.bool_]:
        """Whether the first k are certainly smaller than all others, (N + 1,)."""
        size = np.abs(self.value)
        highest_below = np.maximum.accumulate(np.append(0.0, size * (1 + self.error)))
        lowest_above = np.minimum.accumulate(np.append(size / (1 + self.error), np.inf)[::-1])[::-1]
        return np.asarray(highest_below < lowest_above)

    def next_rate(self, rates: list[float]) -> float | None:
        """The magnitude of the best-known eigenvalue that a rate other than these would improve; None without any.

        Each is a digit from all rates so far, so that there are at most as many as the eigenvalues have decades.
        """
        size = np.abs(self.value)
        distance = np.abs(np.log(size[:, None] / np.array(rates))).min(1)
        is_improvable = (self.error > np.sqrt(EPS)) & (self.error < UNCERTAIN)
        asking = np.flatnonzero(is_improvable & (distance > np.log(RATIO_OF_RATES) / 2))
        return float(size[asking[np.argmin(self.error[asking])]]) if asking.size else None

    def join(self, faster: _Solution) -> _Solution:
        """The slow part of this one and the fast part of another, cut where the sum of their bounds is smallest."""
        slower_errors, faster_errors = (np.log(part.error) for part in (self, faster))
        cost = np.append(0.0, np.cumsum(slower_errors)) + np.append(np.cumsum(faster_errors[::-1])[::-1], 0.0)
        may_cut = self.gaps & faster.gaps
        may_cut[[0, -1]] = True
        place = int(np.argmin(np.where(may_cut, cost, np.inf)))
        slow, fast = self.take(slice(place)), faster.take(slice(place, None))
        return _Solution(
            np.append(slow.value, fast.value), np.hstack([slow.shape, fast.shape]), np.append(slow.error, fast.error)
        )


def damped_modes(
    M: Floats, K: Floats, terms: Floats, dampers: Dampers, modal: Floats | None = None, loss_factor: float = 1.0
) -> Eigen:
    """Modes of M q'' + D q' + K q = 0, with `terms` and `loss_factor` of `indefinite_modes`.

    `modal` (R, size) is a C whose CᵀC is added to D.
    """
    sizes = np.abs(K)
    np.fill_diagonal(sizes, terms)
    extra = np.zeros((0, len(M))) if modal is None else modal
    solution, number = _solve_all_rates(_QuadraticProblem(M, K, sizes, dampers, extra))
    value, error = solution.value, loss_factor * solution.error
    rounded_up = (value.imag != 0) & (value.real > 0) & (value.real <= error * np.abs(value))
    value = np.where(rounded_up, 1j * value.imag, value)
    chosen = np.flatnonzero(value.imag >= 0)
    shape = solution.shape[:, chosen]
    return Eigen(value[chosen], shape, error[chosen], 2 * len(M), number)


def _solve_all_rates(problem: _QuadraticProblem) -> tuple[_Solution, int]:
    """The solutions for all rates, joined, and their number."""
    solutions = {rate: _solve(problem, rate) for rate in problem.rates}
    while True:
        solution = reduce(_Solution.join, (solutions[rate] for rate in sorted(solutions)))
        rate = solution.next_rate(list(solutions))
        if rate is None:
            return solution, len(solutions)
        solutions[rate] = _solve(problem, rate)


class _ScaledProblem(NamedTuple):
    """γ²M, K and a C with Cᵀ diag(`signs`) C = γD (a row per damper or drag) in the columns of `shape`, and P⁻¹."""

    rate: float
    shape: Floats
    M: Floats
    K: Floats
    friction: Floats
    signs: Floats
    inverse: Floats

    @property
    def D(self) -> Floats:
        """γD."""
        return np.asarray((self.friction.T * self.signs) @ self.friction)

    @property
    def sensitivity(self) -> float:
        """‖P⁻¹‖."""
        return float(np.linalg.norm(self.inverse, 2))


def _scale(problem: _QuadraticProblem, rate: float) -> _ScaledProblem:
    basis, stretches = problem.joint_coordinates(rate)
    M, K, sizes = (basis.T @ part @ basis for part in (rate * (rate * problem.M), problem.K, problem.sizes))
    friction = np.sqrt(rate * np.abs(problem.dampers.strength))[:, None] * stretches
    signs = np.where(problem.dampers.strength < 0, -1.0, 1.0)
    if len(problem.modal):
        friction = np.vstack([friction, np.sqrt(rate) * problem.modal @ basis])
        signs = np.append(signs, np.ones(len(problem.modal)))
    if problem.dampers.roots is not None:
        friction = np.vstack((friction, np.sqrt(rate) * (problem.dampers.roots @ basis)))
        root_signs = problem.dampers.signs
        signs = np.append(signs, np.ones(len(problem.dampers.roots)) if root_signs is None else root_signs)
    scale = 1 / np.sqrt(np.diag(M) + (friction**2).sum(0) + np.diag(sizes))
    M, K = (part * scale * scale[:, None] for part in (M, K))
    friction = friction * scale
    D = (friction.T * signs) @ friction
    return _ScaledProblem(rate, basis * scale, M, K, friction, signs, np.linalg.inv(M + D + K))


def _solve(problem: _QuadraticProblem, rate: float) -> _Solution:
    """All eigenvalues and shapes; the bound is the first-order one.

    It is the condition number times a backward error of a few roundings of the matrix's norm and of P⁻¹'s sensitivity,
    or, where that is less, as among multiple eigenvalues, what no perturbation of this size exceeds [Elsner1985].
    """
    scaling = min(
        (_scale(problem, rate * factor) for factor in FACTORS_OF_RATE), key=lambda candidate: candidate.sensitivity
    )
    M, K, D, n = scaling.M, scaling.K, scaling.D, len(scaling.M)
    state = np.block([[np.zeros((n, n)), np.eye(n)], [-scaling.inverse @ part for part in (M - D + K, 2 * (M - K))]])
    theta, right = np.linalg.eig(state)
    theta = np.where(np.abs(theta * theta - 1) < EPS, theta * (1 - EPS), theta)
    condition = np.linalg.norm(np.linalg.pinv(right), axis=1) * np.linalg.norm(right, axis=0)
    norm = float(np.linalg.norm(state, 2))
    backward = 16 * len(state) * EPS * scaling.sensitivity * norm
    furthest = backward ** (1 / len(state)) * (2 * norm + backward) ** (1 - 1 / len(state))
    error = 2 * np.minimum(backward * condition, furthest) / np.abs(theta * theta - 1)
    value = _correct_light_damping(np.asarray((theta + 1) / (theta - 1), dtype=complex), right[:n], scaling)
    order = np.argsort(np.abs(value), kind="stable")
    return _Solution(scaling.rate * value, scaling.shape @ right[:n].astype(complex), error).take(order)


def _correct_light_damping(values: Complexes, shape: Complexes, scaling: _ScaledProblem) -> Complexes:
    """Eigenvalues with Re μ = −φᴴDφ/(2 φᴴMφ) where the real part is below the rounding of the state matrix.

    This is exact where μ is not real (μ² φᴴMφ + μ φᴴDφ + φᴴKφ = 0 has real coefficients), and D has no cancellation.
    """
    inertia = np.einsum("ir,ij,jr->r", shape.conj(), scaling.M, shape, optimize=True).real
    dissipation = scaling.signs @ np.abs(scaling.friction @ shape) ** 2
    light = (values.imag != 0) & (np.abs(values.real) < LIGHT * np.abs(values))
    return np.where(light, -dissipation / (2 * inertia) + 1j * values.imag, values)


def square_root(S: Floats) -> tuple[Floats, Floats]:
    """Rows F (R, d) and signs (R,) with S = Fᵀ diag(signs) F: the Cholesky factor if it exists."""
    if not (S - np.diag(np.diag(S))).any():
        is_nonzero = np.diag(S) != 0
        return np.diag(np.sqrt(np.abs(np.diag(S))))[is_nonzero], np.sign(np.diag(S))[is_nonzero]
    diagonal = np.diag(S)
    scale = 1 / np.sqrt(np.where(diagonal > 0, diagonal, 1.0))
    try:
        L = np.linalg.cholesky(S * scale * scale[:, None])
        return np.asarray((L / scale[:, None]).T), np.ones(len(S))
    except np.linalg.LinAlgError:
        values, vectors = np.linalg.eigh(S * scale * scale[:, None])
        is_significant = np.abs(values) > 4 * len(S) * EPS * np.abs(values).max(initial=0.0)
        rows = np.sqrt(np.abs(values[is_significant]))[:, None] * vectors.T[is_significant] / scale
        return rows, np.sign(values[is_significant])
