"""Functions that vanish on the boundaries of tongues, with derivatives, and points near them on the edges of a grid."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass
from math import hypot, inf, tau
from typing import Any

import numpy as np
import scipy

from modal.types import EPS, NEWTON_ROUNDS, Floats
from modal.vibration.hill import HillSystem, quarters

DISTANCE_FROM_CIRCLE = 1e-3
"""Tolerance: distance of a multiplier from the circle, or a half-trace from the real axis, at a point near it."""
Point = Floats
"""Amplitude (m) and frequency (Hz)."""


@dataclass(eq=False)
class Curve(ABC):
    """A function of amplitude and frequency that is zero on boundaries of one kind of one system."""

    system: HillSystem
    number: int

    @abstractmethod
    def side(self, amplitude: Floats, hertz: Floats) -> Floats:
        """A number at points (B,) that changes across a boundary."""

    @abstractmethod
    def begin(self, point: Point) -> Any:
        """The part of the system at a point to which the function refers; None if there is none."""

    @abstractmethod
    def at(self, point: Point, frame: Any) -> tuple[float, Floats, Any]:
        """The function and its derivatives by amplitude and frequency near a frame's point, and the frame there."""


@dataclass(eq=False)
class Singular(Curve):
    """Where a matrix is singular: the quarter `part` of half a period, without one M − 1 or M + 1 (`number` 1 or 2)."""

    part: int | None = None

    def matrix(self, amplitude: Any, hertz: Any) -> Any:
        """The matrices (B, s, s) at points (B,)."""
        if self.part is not None:
            return quarters(self.system.half(amplitude, tau * hertz, 1))[self.part]
        return self.system.monodromy(amplitude, tau * hertz) - (3 - 2 * self.number) * np.eye(2 * self.system.size)

    def determinant(self, amplitude: Floats, hertz: Floats) -> Floats:
        """The determinant of the matrices."""
        sign, size = np.linalg.slogdet(self.matrix(amplitude, hertz))
        return np.asarray(sign * np.exp(np.minimum(size, 600.0)))

    def side(self, amplitude: Floats, hertz: Floats) -> Floats:
        """The sign of the determinant."""
        return np.asarray(np.sign(self.determinant(amplitude, hertz)))

    def begin(self, point: Point) -> Any:
        """The singular vectors of the smallest singular value."""
        left_vectors, _, right = np.linalg.svd(self.matrix(*point[:, None])[0])
        return left_vectors[:, -1], right[-1]

    def at(self, point: Point, frame: Any) -> tuple[float, Floats, Any]:
        """The number g of the bordered system, with the sign of the determinant, which is g times its own."""
        F, slopes = _slopes(self.matrix, point)
        matrix = np.block([[F, frame[0][:, None]], [frame[1], np.zeros((1, 1))]])
        last = np.eye(len(matrix))[-1]
        v, w = np.linalg.solve(matrix, last), np.linalg.solve(matrix.T, last)
        sign = float(np.linalg.slogdet(matrix)[0])
        gradient = -sign * np.array([w[:-1] @ slope @ v[:-1] for slope in slopes])
        return sign * float(v[-1]), gradient, (w[:-1] / np.linalg.norm(w[:-1]), v[:-1] / np.linalg.norm(v[:-1]))


@dataclass(eq=False)
class Circle(Curve):
    """Where a complex multiplier of a system with losses is on the unit circle: log |μ|."""

    def side(self, amplitude: Floats, hertz: Floats) -> Floats:
        """How many there are outside."""
        values = self.system.multipliers(amplitude, tau * hertz)
        return np.asarray(np.sum((values.imag > 0) & (np.abs(values) > 1), axis=1, dtype=np.float64))

    def begin(self, point: Point) -> Any:
        """The complex multiplier nearest the circle."""
        values = self.system.multipliers(*(point[:, None] * [[1], [tau]]))[0]
        values = values[values.imag > 0]
        nearest = min(values, key=lambda value: abs(abs(value) - 1), default=inf)
        return nearest if abs(abs(nearest) - 1) < DISTANCE_FROM_CIRCLE else None

    def at(self, point: Point, frame: Any) -> tuple[float, Floats, Any]:
        """Of the multiplier nearest to that of the frame."""
        M, slopes = _slopes(lambda amplitude, hertz: self.system.monodromy(amplitude, tau * hertz), point)
        values, right = np.linalg.eig(M)
        k = int(np.argmin(np.abs(values - frame)))
        w, v = np.linalg.inv(right)[k], right[:, k]
        gradient = np.array([(w @ slope @ v / values[k]).real for slope in slopes])
        return float(np.log(abs(values[k]))), gradient, values[k]


@dataclass(eq=False)
class Collision(Curve):
    """Where two half-traces of a system without losses meet between −1 and 1: the square of half their difference."""

    def trace(self, amplitude: Any, hertz: Any) -> Any:
        """The matrices whose eigenvalues are the half-traces."""
        return self.system.traces(amplitude, tau * hertz)

    def side(self, amplitude: Floats, hertz: Floats) -> Floats:
        """How many are complex."""
        return np.asarray(np.sum(np.linalg.eigvals(self.trace(amplitude, hertz)).imag > 0, axis=1, dtype=np.float64))

    def begin(self, point: Point) -> Any:
        """The mean of the two that are nearest to each other."""
        values = np.linalg.eigvals(self.trace(*point[:, None]))[0]
        distances = np.abs(values[:, None] - values) + np.where(np.eye(len(values)), inf, 0.0)
        i, j = np.unravel_index(np.argmin(distances), distances.shape)
        mean = (values[i] + values[j]) / 2
        return mean.real if abs(mean.imag) < DISTANCE_FROM_CIRCLE and abs(mean.real) < 1 else None

    def at(self, point: Point, frame: Any) -> tuple[float, Floats, Any]:
        """Of the two nearest to the mean of the frame, by their invariant subspaces."""
        X, slopes = _slopes(self.trace, point)
        distances = np.sort(np.abs(np.linalg.eigvals(X) - frame))
        room = inf if len(distances) < 3 else (distances[1] + distances[2]) / 2
        (right, n_right), (left_basis, n_left) = (_subspace(matrix, frame, room) for matrix in (X, X.T))
        if n_right != 2 or n_left != 2:
            raise np.linalg.LinAlgError
        inner = np.linalg.solve(
            left_basis.T @ right, np.stack([left_basis.T @ matrix @ right for matrix in (X, *slopes)])
        )
        mean = np.trace(inner[0]) / 2
        deviation = inner[0] - mean * np.eye(2)
        gradient = np.array([np.sum(deviation.T * slope) for slope in inner[1:]])
        return float(-np.linalg.det(deviation)), gradient, mean


def _subspace(X: Floats, middle: float, room: float) -> tuple[Floats, int]:
    """An orthonormal basis of the invariant subspace of eigenvalues within `room` of `middle`, and its dimension."""
    _, Z, size = scipy.linalg.schur(X, sort=lambda re, im=0.0: hypot(re - middle, im) <= room)
    return np.asarray(Z[:, :size]), int(size)


def _slopes(matrix: Any, point: Point) -> tuple[Floats, Floats]:
    """A matrix at a point, and its derivatives by amplitude and frequency (2, s, s)."""
    step = EPS**2  # imaginary, so that nothing is subtracted
    amplitude, hertz = point[:, None] + 1j * step * np.eye(2)
    values = matrix(amplitude, hertz)
    return np.asarray(values[0].real), np.asarray(values.imag / step)


def curves_of(system: HillSystem) -> Iterator[Curve]:
    """The functions that are zero on the boundaries of a system."""
    if not system.is_reversible:
        yield from (Singular(system, number) for number in (1, 2))
    else:
        yield from (Singular(system, number, part=part) for part, number in enumerate((2, 1, 1, 2)))
    if system.size > 1:
        yield (Collision if system.is_reversible else Circle)(system, 3)


# ---------------------------------------------------------------------------------------------------------- seeds


def seeds_of(curve: Curve, amplitude: Floats, hertz: Floats) -> Floats:
    """Points (S, 2) of the curve, almost, on edges of the grid."""
    grid = np.stack(np.meshgrid(amplitude, hertz, indexing="ij"), axis=-1)
    side = curve.side(grid[..., 0].ravel(), grid[..., 1].ravel()).reshape(grid.shape[:2])
    ends = []
    for lower, upper in ((np.s_[:-1, :], np.s_[1:, :]), (np.s_[:, :-1], np.s_[:, 1:])):
        is_crossing = side[lower] != side[upper]
        ends.append(np.stack((grid[lower][is_crossing], grid[upper][is_crossing])))
    if isinstance(curve, Singular) and curve.part is None:
        ends.append(_between(curve, amplitude, hertz))
    low, high = np.concatenate(ends, axis=1)
    reference = curve.side(*low.T)
    for _ in range(NEWTON_ROUNDS if len(low) else 0):
        middle = (low + high) / 2
        is_on_side = (curve.side(*middle.T) == reference)[:, None]
        low, high = np.where(is_on_side, middle, low), np.where(is_on_side, high, middle)
    return np.asarray((low + high) / 2)


def _between(curve: Singular, amplitude: Floats, hertz: Floats) -> Floats:
    """Both edges (2, S, 2) of tongues that pass between two frequencies of the grid, by their least determinants."""
    grid = np.stack(np.meshgrid(amplitude, hertz, indexing="ij"), axis=-1)
    size = curve.determinant(grid[..., 0].ravel(), grid[..., 1].ravel()).reshape(grid.shape[:2])
    inner = size[:, 1:-1]
    rows, columns = np.nonzero((inner > 0) & (inner < size[:, :-2]) & (inner <= size[:, 2:]) & (size[:, 2:] > 0))
    if not len(rows):
        return np.zeros((2, 0, 2))
    a, lower_hertz, upper_hertz = amplitude[rows], hertz[columns], hertz[columns + 2]
    low, high, share = lower_hertz, upper_hertz, (5**0.5 - 1) / 2
    for _ in range(2 * NEWTON_ROUNDS):
        first, second = high - share * (high - low), low + share * (high - low)
        down = curve.determinant(a, first) < curve.determinant(a, second)
        low, high = np.where(down, low, first), np.where(down, second, high)
    middle = (low + high) / 2
    is_negative = curve.determinant(a, middle) < 0
    outer = np.concatenate((lower_hertz[is_negative], upper_hertz[is_negative]))
    both = np.tile(a[is_negative], 2), np.tile(middle[is_negative], 2)
    return np.stack((np.column_stack((both[0], outer)), np.column_stack(both)))
