"""The linear model of a scene as a function of its free numbers, and the peaks of its responses.

Its arrays are polynomials in the free numbers, interpolated once: M, K, D and the rows of outputs and inputs are sums
of products of numbers, of degree 2 at most in each.  With u the numbers over those of a scene, Newton's form on the
nodes 1, 2, 1/2 of each number, and for several numbers on products of these where each part of them has terms
together, gives the coefficients; rounding errors are set to 0, so that each entry is right to its own last digits.
Two other points tell whether that is all: lengths that turn springs are no polynomials, and then there is none.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations, product

import numpy as np

from modal.errors import SceneError
from modal.statespace.channels import Arrays, Model
from modal.types import Booleans, Floats

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


COORDINATES_MAX = 200
"""Limit: coordinates of a scene that can be tuned: "at most 200 are tuned"."""
GRID_REACH = 30.0
"""Tolerance: the grid's end over the fastest pole, and the slowest over its beginning: beyond, |H| is monotonic."""
WITHIN = np.concatenate(([0.0], np.geomspace(0.08, 40.0, 9)))
"""Distances of points of the grid from a pole, in its damping rates."""
GRID_POINTS = 80
"""Tolerance: points of the grid in addition to those of poles: zeros between them part peaks by far more."""
FAR_FREQUENCY = 1e-4
"""Tolerance: a frequency, over that of the slowest pole, that stands for 0, its inverse for infinity, and a distance
from an undamped pole at which an infinite peak shows: the neglected part is of second order."""
STILL_RATE = 8 * np.sqrt(np.finfo(float).eps)
"""Tolerance: of the fastest mode, a rate below which a mode moves freely: λ² is right to its ε."""
DAMPING_MIN = 1e-11
"""Tolerance: damping ratio of a mode that nothing damps: rounding leaves so much."""
SIDE_POINTS = 24
"""Cost: most frequencies other than peaks at which |H| bounds the largest."""


@dataclass(frozen=True, eq=False)
class Peaks:
    """Frequencies `omega` (P,) in rad/s of maxima of |H| and of the ends of the band; `inside` (P,) are maxima.

    `beside` (Q,) are frequencies of the grid where |H| is nearly as large: as numbers change, two peaks may merge and
    one wander fast, while |H| at a frequency changes slowly. `endless` says where |H| has no bound, if it has none.
    """

    omega: Floats
    inside: Booleans
    beside: Floats
    endless: str = ""
    static: float = 0.0
    """The frequency that stands for 0 where no band bounds the response."""

    @classmethod
    def none(cls, words: str) -> Peaks:
        """Those of a response without bound."""
        return cls(np.zeros(0), np.zeros(0, bool), np.zeros(0), words)


def find_peaks(model: Model, channel: int, band: tuple[float, float] | None) -> Peaks:
    """The peaks of a channel over a band (rad/s), by default over all frequencies."""
    poles = model.poles_for(channel)
    poles = poles[(poles.imag >= 0) & (np.abs(poles) > 0)]
    rates = np.abs(poles)
    rates = rates[rates > STILL_RATE * rates.max(initial=0.0)] if len(rates) else np.ones(1)
    low, high = band or (float(rates.min()) * FAR_FREQUENCY, float(rates.max()) / FAR_FREQUENCY)
    inner = band or (float(rates.min()) / GRID_REACH, float(rates.max()) * GRID_REACH)
    for pole in poles[np.abs(poles.real) <= DAMPING_MIN * np.abs(poles)].tolist():
        at = abs(pole.imag)
        if low <= at <= high and _is_infinite(model, channel, at):
            return Peaks.none(f"at {at / (2 * np.pi):.6g} Hz, where nothing damps a mode")
    omega = _grid(poles, *inner)
    if band is None:
        omega = np.concatenate(([low], omega, [high]))
    with np.errstate(all="ignore"):
        size = np.abs(model.response(channel, omega))
    size = np.where(np.isfinite(size), size, 0.0)
    if band is None and size[0] > 5 * size[1] > 0:
        return Peaks.none("towards 0 Hz: give `over_hz=…`")
    if band is None and size[-1] > 5 * size[-2] > 0 and size[-1] > FAR_FREQUENCY * size.max():
        return Peaks.none("towards high frequencies: give `over_hz=…`")
    at = np.flatnonzero((size[1:-1] > size[:-2]) & (size[1:-1] >= size[2:])) + 1
    turning = _refine_maxima(model, channel, omega[at - 1], omega[at], omega[at + 1]) if len(at) else np.zeros(0)
    ends = [k for k, neighbour in ((0, 1), (-1, -2)) if size[k] >= size[neighbour] and size[k] > 0]
    all_omega = np.concatenate((turning, omega[ends]))
    large_samples = np.flatnonzero(size >= 0.8 * size.max())
    places = np.linspace(0, len(large_samples) - 1, min(len(large_samples), SIDE_POINTS)).astype(int)
    large_samples = large_samples[places]
    return Peaks(all_omega, np.arange(len(all_omega)) < len(turning), omega[large_samples], static=0.0 if band else low)


def _grid(poles: np.ndarray, low: float, high: float) -> Floats:
    width = np.maximum(np.abs(poles.real), 1e-9 * np.abs(poles))[:, None]
    close_points = (np.abs(poles.imag)[:, None] + width * np.concatenate((-WITHIN[::-1], WITHIN))).ravel()
    close_points = np.concatenate((close_points, np.abs(poles)))
    close_points = close_points[(close_points > low) & (close_points < high)]
    return np.unique(np.concatenate((np.geomspace(low, high, GRID_POINTS), close_points)))


def _is_infinite(model: Model, channel: int, omega: float) -> bool:
    """Whether |H| grows as the inverse of the distance from an undamped pole, which may be in no output."""
    far, near = FAR_FREQUENCY, FAR_FREQUENCY / 64
    sizes = np.abs(model.response(channel, omega * np.array([1 + far, 1 + near, 1 - far, 1 - near])))
    return bool(max(sizes[1] / sizes[0], sizes[3] / sizes[2]) > far / near / 4)


def _refine_maxima(model: Model, channel: int, low: Floats, middle: Floats, high: Floats) -> Floats:
    """Maxima of |H| between the ends of intervals in whose middle it is larger than at both, (P,)."""
    part = np.linspace(0.0, 1.0, 4)
    for _ in range(4):
        left, right = (middle - low)[:, None] * part, (high - middle)[:, None] * part[1:]
        at = np.concatenate((low[:, None] + left, middle[:, None] + right), 1)
        size = np.abs(model.response(channel, at.ravel())).reshape(at.shape)
        best = np.clip(size.argmax(1), 1, at.shape[1] - 2)
        rows = np.arange(len(at))
        low, middle, high = at[rows, best - 1], at[rows, best], at[rows, best + 1]
    return _level(model, channel, low, high)


def _level(model: Model, channel: int, low: Floats, high: Floats) -> Floats:
    """Zeros of the slope of |H| between ends where it rises and falls, by the Illinois method."""

    def rise(omega: Floats) -> Floats:
        H, slope = model.slope(channel, omega)
        return np.asarray((np.conj(H) * slope).real / np.abs(H) ** 2)

    a, b, fa, fb = low, high, rise(low), rise(high)
    for _ in range(40):  # four or five are usual: each two double the digits
        with np.errstate(all="ignore"):
            c = np.where(fa - fb == 0, (a + b) / 2, (a * fb - b * fa) / (fb - fa))
        c = np.where((c > np.minimum(a, b)) & (c < np.maximum(a, b)), c, (a + b) / 2)
        step, fc = np.abs(c - b), rise(c)
        has_crossed = fc * fb <= 0
        a, fa = np.where(has_crossed, b, a), np.where(has_crossed, fb, fa / 2)
        b, fb = c, fc
        if np.all((step <= 2 * np.finfo(float).eps * np.abs(b)) | (fc == 0)):
            break
    return b
