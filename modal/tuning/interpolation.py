"""The arrays of a linear model as polynomials in the free numbers, interpolated once.

M, K, D and the rows of outputs and inputs are sums of products of numbers, of degree 2 at most in each.  With u the
numbers over those of a scene, Newton's form on the nodes 1, 2, 1/2 of each number, and for several numbers on products
of these where each part of them has terms together, gives the coefficients; rounding errors are set to 0, so that each
entry is right to its own last digits.  Two other points tell whether that is all: lengths that turn springs are no
polynomials, and then there is none.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import combinations, product

import numpy as np

from modal.errors import SceneError
from modal.statespace.channels import Arrays
from modal.types import Floats

NODES = (1.0, 2.0, 0.5)
ENTRY_ROUNDING = 2**13 * np.finfo(float).eps
"""Tolerance: part of an entry's size below which a coefficient is rounding, and within which other points are met."""
ASSEMBLIES_MAX = 400
"""Cost: points at which a scene is assembled for its polynomials; of more numbers each scene is assembled itself."""
BASIS = np.array([[1.0, 0.0, 0.0], [-1.0, 1.0, 0.0], [2.0, -3.0, 1.0]])
"""Coefficients of 1, u − 1 and (u − 1)(u − 2)."""
Powers = tuple[int, ...]


class Interpolated:
    """Arrays at numbers (n,) near `start` (n,), and their derivatives."""

    def __init__(
        self, start: Floats, powers: np.ndarray, coefficients: Floats, shapes: Sequence[tuple[int, ...]]
    ) -> None:
        self.start, self.powers, self.coefficients, self.shapes = start, powers, coefficients, tuple(shapes)

    def arrays(self, numbers: Floats) -> Arrays:
        """Those at these numbers."""
        u = np.asarray(numbers) / self.start
        return Arrays(*_unpack(np.prod(u**self.powers, axis=1) @ self.coefficients, self.shapes))

    def slopes(self, numbers: Floats, columns: Sequence[int]) -> Arrays:
        """Derivatives by these numbers, in the first axis."""
        u = np.asarray(numbers) / self.start
        parts_of_slopes = []
        for k in columns:
            lower = self.powers.copy()
            lower[:, k] = np.maximum(lower[:, k] - 1, 0)
            weights = self.powers[:, k] * np.prod(u**lower, axis=1) / self.start[k]
            parts_of_slopes.append(_unpack(weights @ self.coefficients, self.shapes))
        return Arrays(*(np.array(part) for part in zip(*parts_of_slopes, strict=True)))


def interpolate(arrays_at: Callable[[Floats], Arrays], start: Floats) -> Interpolated | None:
    """The polynomials that arrays are in the numbers `start` (n,), all above 0; None if they are none."""
    n, samples = len(start), dict[Powers, Floats]()
    shapes = [np.shape(part) for part in arrays_at(start)]

    def at(u: Floats | Sequence[float]) -> Floats:
        return np.concatenate([np.ravel(part) for part in arrays_at(start * np.asarray(u))])

    try:
        newton = _coefficients(at, n, samples)
        if newton is None:
            return None
        powers = np.array([*newton])
        rows = np.array([*newton.values()])
        monomials = _monomials(powers, rows)
        polynomials = Interpolated(
            np.asarray(start), *_clean(*monomials, np.abs(np.array([*samples.values()])).max(0)), shapes
        )
        for u in (np.linspace(0.7, 1.6, n), np.linspace(1.7, 0.6, n)):
            true, approximate = at(u), np.concatenate([np.ravel(part) for part in polynomials.arrays(start * u)])
            if np.any(np.abs(true - approximate) > ENTRY_ROUNDING * np.abs(np.array([*samples.values()])).max(0)):
                return None
    except SceneError:
        return None
    return polynomials


def _coefficients(
    at: Callable[[Sequence[float]], Floats], n: int, samples: dict[Powers, Floats]
) -> dict[Powers, Floats] | None:
    """The coefficients of Newton's form by the powers of all numbers; None for too many points."""
    coefficients: dict[Powers, Floats] = {}
    active: set[tuple[int, ...]] = set()
    for subset in _subsets(n, active):
        for levels in product((1, 2), repeat=len(subset)):
            if len(samples) >= ASSEMBLIES_MAX:
                return None
            index = [0] * n
            for k, level in zip(subset, levels, strict=True):
                index[k] = level
            u = [NODES[level] for level in index]
            value = samples[tuple(index)] = at(u)
            for powers, row in coefficients.items():
                if all(a <= b for a, b in zip(powers, index, strict=True)):
                    value = value - row * float(
                        np.prod([_newton(level, x) for level, x in zip(powers, u, strict=True)])
                    )
            basis = float(np.prod([_newton(level, x) for level, x in zip(index, u, strict=True)]))
            coefficients[tuple(index)] = value / basis
        size = np.abs(np.array([*samples.values()])).max(0)
        if any(
            np.any(np.abs(row) > ENTRY_ROUNDING * size)
            for index, row in coefficients.items()
            if tuple(k for k, level in enumerate(index) if level) == subset
        ):
            active.add(subset)
    return coefficients


def _subsets(n: int, active: set[tuple[int, ...]]) -> Iterator[tuple[int, ...]]:
    """The numbers by themselves, then those together of which each part has terms."""
    yield ()
    for size in range(1, min(n, 4) + 1):  # m l² ω of a spring or damper has four factors at most
        for subset in combinations(range(n), size):
            if size == 1 or all(part in active for part in combinations(subset, size - 1)):
                yield subset


def _newton(level: int, u: float) -> float:
    return (1.0, u - 1.0, (u - 1.0) * (u - 2.0))[level]


def _monomials(powers: np.ndarray, rows: Floats) -> tuple[np.ndarray, Floats]:
    """The same polynomial by powers of the numbers."""
    monomials: dict[Powers, Floats] = {}
    for index, row in zip(powers.tolist(), rows, strict=True):
        used = [k for k, level in enumerate(index) if level]
        for lower in product(*(range(index[k] + 1) for k in used)):
            weight = float(np.prod([BASIS[index[k], power] for k, power in zip(used, lower, strict=True)]))
            if weight:
                degrees = [0] * len(index)
                for k, power in zip(used, lower, strict=True):
                    degrees[k] = power
                monomials[tuple(degrees)] = monomials.get(tuple(degrees), 0.0) + weight * row
    return np.array([*monomials]), np.array([*monomials.values()])


def _clean(powers: np.ndarray, rows: Floats, size: Floats) -> tuple[np.ndarray, Floats]:
    """With entries that are rounding errors for their size set to 0."""
    large_rows = np.where(np.abs(rows) > ENTRY_ROUNDING * size, rows, 0.0)
    is_used = np.any(large_rows != 0, axis=1)
    is_used[0] = True
    return powers[is_used], large_rows[is_used]


def _unpack(flat: Floats, shapes: Sequence[tuple[int, ...]]) -> Iterator[Floats]:
    at = 0
    for shape in shapes:
        size = int(np.prod(shape))
        yield flat[at : at + size].reshape(shape)
        at += size
