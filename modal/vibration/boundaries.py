"""Instability tongues: boundaries of the regions of amplitude and frequency in which small angles grow.

On a boundary a multiplier μ of one of the systems of `modal.vibration.hill` is 1 (growth at the frequency), −1 (at half
of it), or complex of size 1 (at a combination).  With losses, these are the curves det(M ∓ 1) = 0 and |μ| = 1.  Without
them both edges of a tongue meet at amplitude 0, where det(M ∓ 1) has a double zero; its four factors have simple ones,
since of the first half of a period [a b; c d]

    det(M − 1) ∝ det b det c,    det(M + 1) ∝ det a det d,

and two pairs of multipliers leave the unit circle where two half-traces meet (Krein's collision).

A coarse grid seeds the curves: an edge of it across which a determinant changes its sign, or the number of complex
multipliers off the circle, holds a point of one.  Each is followed in the plane by arclength, with a tangent as
predictor and Newton's method as corrector [Keller1977].  A determinant is replaced by g of the bordered system

    [F p; qᵀ 0] [v; g] = [0; 1],    dg = −wᵀ dF v,    with w of the transposed system

[Govaerts2000, §3.3]; dF comes from complex steps, the
equations being analytic in both parameters.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import cos, hypot, inf, tau
from typing import Any

import numpy as np
import scipy
from numpy.polynomial import Polynomial
from numpy.typing import ArrayLike

from modal.errors import ComputationError, SceneError, refuse_any
from modal.report import Displayed, Summary, brief, counted
from modal.scene import Scene
from modal.scene.doors import checked
from modal.types import EPS, NEWTON_ROUNDS, Floats
from modal.vibration.hill import KINDS, HillSystem, hill_systems, quarters

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


TONGUE_STEP_MAX = 1 / 50
"""Tolerance: longest step along a curve, the sides of the window being 1."""
TURN_MAX = 0.25
"""Tolerance: radians that the tangent turns in a step at most; a third of it lets steps grow."""
SLOW_STEP_MAX = 1e-10
"""Tolerance: last step, in sides of the window, of a slow approach to a double root; what is as near is one point."""
AMPLITUDE_OF_TIP = 1e-3
"""Tolerance: amplitude, in sides of the window, below which two curves that meet at 0 are extrapolated to it."""
MOST_POINTS = 1000
"""Limit: points of a boundary, which ends there, twenty times the steps across the window."""
GROWING = "grows "


@dataclass(frozen=True, eq=False, repr=False)
class Boundary(Displayed):
    """A boundary as a polyline of points, accurate to 1e-9: amplitudes (m) and frequencies (Hz), both (P,).

    `number` says what grows beyond it, by KINDS.  `least` is its point of least amplitude, between two points where it
    `turns` there, else one of its ends.
    """

    number: int
    amplitude: Floats
    frequency_hz: Floats
    least: tuple[float, float]
    turns: bool

    @property
    def kind(self) -> str:
        """The frequency of the motions that grow beyond it: "at half the frequency"."""
        return KINDS[self.number].removeprefix(GROWING)

    def to_dict(self) -> dict[str, Any]:
        """Its numbers by name, for JSON."""
        return {
            "kind": self.kind,
            "least_amplitude_m": self.least[0],
            "least_at_hz": self.least[1],
            "turns": self.turns,
            "amplitude_m": self.amplitude.tolist(),
            "frequency_hz": self.frequency_hz.tolist(),
        }

    def _summary(self) -> Summary:
        facts = [("least amplitude", f"{self.least[0]:.6g} m at {self.least[1]:.6g} Hz")]
        rows = [[brief(a), brief(f)] for a, f in zip(self.amplitude, self.frequency_hz, strict=True)]
        title = f"Boundary of growth {self.kind}: {counted(len(rows), 'point', 'points')}"
        return Summary(title, facts, ("amplitude (m)", "frequency (Hz)"), rows, len(rows))


@dataclass(frozen=True, eq=False, repr=False)
class Tongues(Displayed):
    """The boundaries within a window of amplitudes (m) and frequencies (Hz), found from a grid of both."""

    amplitude: Floats
    frequency_hz: Floats
    boundaries: tuple[Boundary, ...]
    windows: tuple[Window, ...]

    def edges(self, *, amplitude: float | None = None, frequency_hz: float | None = None) -> list[tuple[float, str]]:
        """Where the boundaries cross a line of one amplitude or one frequency: frequencies or amplitudes, and kinds."""
        lines = [(k, value) for k, value in enumerate((amplitude, frequency_hz)) if value is not None]
        if len(lines) != 1:
            raise SceneError(["edges: needs an amplitude or a frequency_hz"])
        fixed_axis, value = lines[0]
        edges = []
        for boundary, window in zip(self.boundaries, self.windows, strict=True):
            points = np.column_stack((boundary.amplitude, boundary.frequency_hz))
            offsets = points[:, fixed_axis] - value
            for k in np.flatnonzero((offsets[:-1] < 0) != (offsets[1:] < 0)):
                share = offsets[k] / (offsets[k] - offsets[k + 1])
                start = points[k] + share * (points[k + 1] - points[k])
                start[fixed_axis] = value
                frame = window.curve.begin(start)
                place = window.settle((start - window.low) / window.extent, frame, np.eye(2)[1 - fixed_axis])
                if place is None:
                    raise ComputationError(f"no edge of a tongue was found near {start[1 - fixed_axis]:.6g}")
                edges.append((float((window.low + window.extent * place.point)[1 - fixed_axis]), boundary.kind))
        return sorted(edges)

    def to_dict(self) -> dict[str, Any]:
        """The boundaries, for JSON."""
        return {"boundaries": [boundary.to_dict() for boundary in self.boundaries]}

    def _summary(self) -> Summary:
        rows = [[boundary.kind, brief(boundary.least[0]), brief(boundary.least[1])] for boundary in self.boundaries]
        heads = ("kind", "least amplitude (m)", "at (Hz)")
        title = f"Tongues: {counted(len(rows), 'boundary', 'boundaries')}"
        return Summary(title, (), heads, rows, len(rows), words=frozenset({0}))


@checked
def tongues(scene: Scene, amplitude: ArrayLike, frequency_hz: ArrayLike) -> Tongues:
    """Trace the boundaries of growth of a scene over amplitudes (m) and frequencies (Hz), ascending grids.

    Curves are found where they pass a line of the grid once, tongues of losses also where they lie between two. Of a
    single amplitude or frequency each boundary is one point. Raise SceneError for a scene without vertical sine
    (`vertical_sine`) and for grids that do not ascend.

    >>> from modal import Bob, Pendulum, Scene
    >>> from modal.scene import Moved, SineMotion
    >>> shaken = Moved(motion=SineMotion(direction="vertical", amplitude=0.02, frequency_hz=1.0))
    >>> bob = Bob(mass=1.0, length=1.0, damping=0.05)
    >>> scene = Scene(gravity=9.81, support=shaken, pendulum=[Pendulum(links=[bob])])
    >>> found = tongues(scene, [0.005, 0.02, 0.04], [0.8, 0.9, 1.0, 1.1, 1.2])
    >>> [(round(1000 * one.least[0], 6), one.kind) for one in found.boundaries]
    [(7.9816, 'at half the frequency')]
    >>> [round(frequency, 9) for frequency, _ in found.edges(amplitude=0.02)]
    [0.979336028, 1.015949762]
    """
    grid = [np.asarray(values, dtype=np.float64).ravel() for values in (amplitude, frequency_hz)]
    names = ("amplitude", "frequency_hz")
    problems = [
        f"{name}: a grid of tongues needs ascending numbers {words}"
        for name, values, lowest, words in zip(names, grid, (0.0, EPS**0.5), ("from 0", "above 0"), strict=True)
        if not len(values) or not np.all(np.diff(values) > 0) or not np.isfinite(values).all() or values[0] < lowest
    ]
    if not problems and len(grid[0]) == len(grid[1]) == 1:
        problems = ["a grid of tongues needs two or more amplitudes or frequencies"]
    refuse_any(problems)
    systems = hill_systems(scene)
    pairs = [pair for system in systems for curve in curves_of(system) for pair in _trace_boundaries(curve, *grid)]
    pairs.sort(key=lambda pair: (pair[0].number, pair[0].least[1]))
    return Tongues(grid[0], grid[1], tuple(boundary for boundary, _ in pairs), tuple(window for _, window in pairs))


# ------------------------------------------------------------------------------------------------------ continuation


@dataclass(frozen=True)
class CurvePlace:
    """A point of a curve in sides of the window, the unit gradient there, and the frame of the next step."""

    point: Floats
    normal: Floats
    frame: Any

    @property
    def tangent(self) -> Floats:
        """The direction with growing motions on its right."""
        return np.array([-self.normal[1], self.normal[0]])


@dataclass(frozen=True, eq=False)
class Window:
    """The plane in which a curve is followed, its sides scaled to 1 from the corner `low`."""

    curve: Curve
    low: Floats
    extent: Floats

    def inside(self, point: Floats) -> bool:
        """Whether a point is in the window."""
        return bool(np.all(point >= -SLOW_STEP_MAX) and np.all(point <= 1 + SLOW_STEP_MAX))

    def settle(self, point: Floats, frame: Any, direction: Floats | None = None) -> CurvePlace | None:
        """The point of the curve nearest to one, or in a direction; None where Newton's method finds none."""
        for _ in range(NEWTON_ROUNDS if direction is None else 4 * NEWTON_ROUNDS):
            try:
                value, gradient, frame = self.curve.at(self.low + self.extent * point, frame)
            except np.linalg.LinAlgError:
                return None
            slope = gradient * self.extent
            size = float(np.linalg.norm(slope))
            way = slope / size if direction is None and size > 0 else direction
            if way is None or not (rise := float(slope @ way)) or not np.isfinite(value / rise):
                return None
            step = value / rise
            if abs(step) > TONGUE_STEP_MAX:
                return None
            point = point - step * way
            if abs(step) < (EPS**0.5 if direction is None else SLOW_STEP_MAX):
                return CurvePlace(point, slope / size, frame)
        return None

    def follow(self, start: CurvePlace, sense: float) -> tuple[list[CurvePlace], bool]:
        """Places from a start to the window's edge, and whether the curve closes before it."""
        places, step = [start], TONGUE_STEP_MAX / 4
        while len(places) < MOST_POINTS and step > EPS**0.5:
            place = places[-1]
            next_place = self.settle(place.point + sense * step * place.tangent, place.frame)
            if (
                next_place is None
                or place.normal @ next_place.normal < cos(TURN_MAX)
                or hypot(*(next_place.point - place.point)) > 2 * step
            ):
                step /= 2
                continue
            if not self.inside(next_place.point):
                return [*places, *self.leave(place, next_place.point)], False
            places.append(next_place)
            back = start.point - next_place.point
            onward = sense * (back @ next_place.tangent) > 0 and next_place.normal @ start.normal > 0.5
            if len(places) > 3 and hypot(*back) < step and onward:
                return [*places, start], True
            if place.normal @ next_place.normal > cos(TURN_MAX / 3):
                step = min(TONGUE_STEP_MAX, 1.5 * step)
        return places, False

    def tip(self, places: list[CurvePlace]) -> list[CurvePlace]:
        """Places up to one where two collisions meet at amplitude 0, by the polynomial of those before: it is flat."""
        last, earlier_places = places[-1], [place for place in places if place.point[0] > AMPLITUDE_OF_TIP]
        flat = isinstance(self.curve, Collision) and not self.low[0] and last.point[0] < AMPLITUDE_OF_TIP
        if not flat or len(earlier_places) < 4:
            return places
        last_points = [place.point for place in earlier_places[-4:]]
        for amplitude in AMPLITUDE_OF_TIP * np.arange(1.0, 5.0):
            start = np.array([amplitude, _cubic(last_points, amplitude)])
            place = self.settle(start, earlier_places[-1].frame, np.eye(2)[1])
            if place is None:
                return earlier_places
            last_points = [*last_points[1:], place.point]
        return [*earlier_places, CurvePlace(np.array([0.0, _cubic(last_points, 0.0)]), last.normal, last.frame)]

    def leave(self, here: CurvePlace, outer_point: Floats) -> list[CurvePlace]:
        """The place on the window's edge between one inside and a point outside."""
        step = outer_point - here.point
        with np.errstate(divide="ignore", invalid="ignore"):
            shares = (np.where(step > 0, 1.0, 0.0) - here.point) / step
        shares = np.where(step == 0, inf, np.maximum(shares, 0.0))
        k = int(np.argmin(shares))
        start = here.point + shares[k] * step
        start[k] = float(step[k] > 0)
        place = self.settle(start, here.frame, np.eye(2)[1 - k])
        return [place] if place and self.inside(place.point) else []

    def lowest(self, places: Sequence[CurvePlace]) -> tuple[Floats, bool]:
        """The point of least amplitude, and whether the curve turns there."""
        turns = [(places[0].point, False), (places[-1].point, False)]
        for here, there in pairwise(places):
            if here.tangent[0] * there.tangent[0] < 0:

                def between(share: float, first_place: CurvePlace = here, last_place: CurvePlace = there) -> CurvePlace:
                    place = self.settle(
                        first_place.point + share * (last_place.point - first_place.point), first_place.frame
                    )
                    place = place and self.settle(place.point, place.frame)  # the slope at the point itself
                    if place is None:
                        raise ComputationError("the least amplitude of a tongue was not found")
                    return place

                share = scipy.optimize.brentq(
                    lambda at, between=between: float(between(at).tangent[0]), 0.0, 1.0, xtol=1e-13
                )
                turns.append((between(share).point, True))
        return min(turns, key=lambda turn: (turn[0][0], not turn[1]))


def _cubic(points: Sequence[Floats], amplitude: float) -> float:
    """The frequency at an amplitude on the cubic through four points."""
    x, y = np.array(points).T
    return float(Polynomial.fit(x, y, 3)(amplitude))


def _trace_boundaries(curve: Curve, amplitude: Floats, hertz: Floats) -> Iterator[tuple[Boundary, Window]]:
    """Every boundary that a function has in the window."""
    low = np.array([amplitude[0], hertz[0]])
    extent = np.array([np.ptp(amplitude), np.ptp(hertz)])
    line = np.eye(2)[int(np.argmax(extent > 0))] if np.any(extent == 0) else None
    window = Window(curve, low, np.where(extent > 0, extent, 1.0))
    traces: list[list[CurvePlace]] = []
    for seed in seeds_of(curve, amplitude, hertz):
        frame = curve.begin(seed)
        start = None if frame is None else window.settle((seed - low) / window.extent, frame, line)
        if start is None or not window.inside(start.point) or any(_holds(trace, start) for trace in traces):
            continue
        places, is_closed = window.follow(start, 1.0) if line is None else ([start], True)
        if not is_closed:
            places = window.tip([*window.follow(start, -1.0)[0][:0:-1], *places])
            places = window.tip(places[::-1])[::-1]
        traces.append(places)
        points = np.clip([place.point for place in places], 0.0, 1.0) * window.extent + low
        lowest_point, turns = window.lowest(places)
        lowest = low + window.extent * lowest_point
        yield Boundary(curve.number, points[:, 0], points[:, 1], (float(lowest[0]), float(lowest[1])), turns), window


def _holds(places: Sequence[CurvePlace], place: CurvePlace) -> bool:
    """Whether a place is on a curve: next to it with what grows on the same side, which of its neighbours is not so."""
    points = np.array([place_on.point for place_on in places])
    if len(points) == 1:
        return hypot(*(points[0] - place.point)) < SLOW_STEP_MAX
    start, step = points[:-1], np.diff(points, axis=0)
    square = np.maximum(np.einsum("ij,ij->i", step, step), 1e-300)
    share = np.clip(np.einsum("ij,ij->i", place.point - start, step) / square, 0.0, 1.0)
    distances = np.linalg.norm(start + share[:, None] * step - place.point, axis=1)
    is_near = distances < TURN_MAX / 4 * np.sqrt(square) + SLOW_STEP_MAX
    return bool(np.any(is_near & (step @ place.tangent > 0)))
