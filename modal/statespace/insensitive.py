"""The shortest input shaper with little residual vibration over a range of a parameter: specified insensitivity.

In: modes (ω_j, ζ_j) at many values of the number.  Out: impulses A_i ≥ 0 at t_i, Σ A_i = 1, with the least duration t_n
such that the residual vibration of none exceeds the tolerance v,

    e^{−ζ_j ω_j t_n} |Σ A_i e^{s_j t_i}| ≤ v,     s_j = ζ_j ω_j + iω_j √(1−ζ_j²)        ([Singhose1996]).

With times on a grid these are convex: a linear program, with a tangent plane of a cone wherever what its solution
leaves is too much ([Kelley1960]). The duration is bisected. Then the grid is refined next to the impulses, again and
again, unless a controller's samples are the grid.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import inf

import numpy as np
import scipy

from modal.errors import ComputationError, SceneError
from modal.scene import Scene
from modal.scene.doors import checked
from modal.scene.parameters import parse_vary, vary
from modal.statespace.shapers import (
    TOLERANCE_OF_RESIDUAL,
    DampedSwing,
    Drive,
    Shaper,
    Train,
    residual_vibration,
    robustness,
    swings_of,
)
from modal.types import EPS, NEWTON_ROUNDS, Complexes, Floats, Ints


@checked
def shaper_over(
    scene: Scene,
    span: str,
    count: int = 1,
    drive: Drive = "cart_acceleration",
    *,
    step: float = 0.0,
    tolerance: float = TOLERANCE_OF_RESIDUAL,
    samples: int = 65,
) -> tuple[Shaper, float]:
    """Return the shortest shaper for a `span` such as "pendulum[0].links[0].length=8:14", and its largest residual.

    Of none of the `count` slowest modes that the `drive` excites more than `tolerance` is left, of the swing after one
    impulse, at `samples` points of the span and between them: there the modes are those of a spline, sixteen times as
    close, where the shaper is made, and of the scene half-way, where it is checked.  With a `step` (s) impulses come at
    its multiples. Raise SceneError for another span, ComputationError if a mode does not oscillate, no shaper is short
    enough, or the check fails.

    >>> from modal import load
    >>> shaper, most = shaper_over(load("crane-hook"), "pendulum[0].links[0].length=11:13", samples=9)
    >>> len(shaper.times), round(shaper.duration, 2), most <= 0.05
    (3, 4.32, True)
    """
    path, sign, ends = span.partition("=")
    if not sign or ends.count(":") != 1:
        raise SceneError([f"span {span}: must be PLACE=FROM:TO, such as pendulum[0].links[0].length=8:14"])
    try:
        is_ascending = 0 < float(ends.partition(":")[2]) - float(ends.partition(":")[0]) < inf
    except ValueError:
        is_ascending = False
    if not is_ascending:
        raise SceneError([f"span {span}: must run from a number to a larger one"])
    variation = parse_vary(scene, [f"{path}={ends}:{2 * samples - 1}"])[0][0]
    scenes = [vary(scene, {path: value}) for value in variation.values]
    swings = [swings_of(each, drive)[:count] for each in scenes[::2]]
    if any(len(each) < count for each in swings):
        raise ComputationError(f"count {count}: at some points of {span} this drive excites fewer modes")
    curve = scipy.interpolate.make_interp_spline(variation.values[::2], np.array(swings), k=3)
    between = np.linspace(variation.values[0], variation.values[-1], 16 * samples)
    omega, zeta = np.moveaxis(curve(between), -1, 0)
    modes = [swing for each in swings for swing in each]
    for _ in range(NEWTON_ROUNDS):
        shaper = shortest(modes, tolerance, step)
        left = residual_vibration(shaper, omega, np.maximum(zeta, 0.0))
        is_peak = np.pad((left[1:-1] >= left[:-2]) & (left[1:-1] >= left[2:]), ((1, 1), (0, 0)))
        excess = is_peak & (left > tolerance)
        if not excess.any():
            break
        modes += map(DampedSwing, omega[excess].tolist(), np.maximum(zeta[excess], 0.0).tolist())
    most = float(robustness(shaper, scenes, variation.values, drive, count).residual.max()) / 100
    if most > tolerance:
        raise ComputationError(f"span {span}: between {samples} samples a shaper leaves up to {most:.3g}: take more")
    return shaper, most


def shortest(swings: Sequence[DampedSwing], tolerance: float, step: float = 0.0, places: int = 5000) -> Shaper:
    """Return the shortest shaper of positive impulses with at most the residual `tolerance` in each of these modes.

    Raise ComputationError for a mode that does not oscillate, and if ten periods of the slowest are too short, or so
    many `places` for impulses, 32 in a period of the fastest or a `step` (s) apart, too few.
    """
    program = _Program(swings, tolerance * (1 - EPS ** (1 / 3)))
    grid = step or program.fastest / 32
    longest, last = min(10 * program.slowest, places * grid), max(1, int(program.slowest / 4 / grid))
    amplitudes = None
    while amplitudes is None:
        if last * grid > longest:
            raise ComputationError(
                f"no shaper of at most {longest:.3g} s, {longest / grid:.0f} places {grid:.3g} s apart, leaves so "
                "little over all of this range"
            )
        amplitudes = program.solve(grid * np.arange(last + 1.0))
        last *= 2 if amplitudes is None else 1
    ticks, amplitudes = program.shorten(grid, np.arange(last + 1), amplitudes)
    is_active = amplitudes > EPS**0.5
    times, amplitudes = grid * ticks[is_active], amplitudes[is_active]
    if not step:
        joined = _joined(times, amplitudes, 2.5 * grid)
        train = program.polish(*joined) or program.polish(times, amplitudes) or (times, amplitudes)
        times, amplitudes = (program.polish(*train) or train) if len(train[0]) > len(joined[0]) else train
    return Shaper(times, amplitudes / amplitudes.sum(), step)


def _joined(times: Floats, amplitudes: Floats, gap: float) -> Train:
    """One impulse in place of those (n,) that follow each other within a `gap` (s), at their centre."""
    group = np.cumsum(np.diff(times, prepend=0.0) > gap)
    sums = np.bincount(group, amplitudes)
    return np.bincount(group, amplitudes * times) / sums, np.asarray(sums, dtype=np.float64)


class _Program:
    """Linear programs for amplitudes at given times, with the tangent planes found so far."""

    def __init__(self, swings: Sequence[DampedSwing], tolerance: float) -> None:
        omega, zeta = np.array(swings).T
        if not (np.all(omega > 0) and np.all((zeta >= 0) & (zeta < 1))):
            raise ComputationError("a mode does not oscillate at all points of the range: a shaper cannot suppress it")
        self.exponents = (zeta + 1j * np.sqrt((1 - zeta) * (1 + zeta))) * omega
        self.slowest, self.fastest = (2 * np.pi / end for end in (omega.min(), omega.max()))
        self.tolerance, self.planes = tolerance, list[tuple[int, complex]]()

    def solve(self, times: Floats) -> Floats | None:
        """Amplitudes at these times (N,) of which no mode retains more than the tolerance; None if there are none."""
        s = self.exponents[:, None]
        turns = np.exp(s * times - s.real * times[-1])
        n = len(times)
        for _ in range(2 * NEWTON_ROUNDS):
            rows = [np.append((np.conj(way) * turns[mode]).real, -1.0) for mode, way in self.planes]
            planes = {"A_ub": np.array(rows), "b_ub": np.zeros(len(rows))} if rows else {}
            total = np.append(np.ones(n), 0.0)[None]
            solution = scipy.optimize.linprog(np.append(np.zeros(n), 1.0), **planes, A_eq=total, b_eq=[1.0])
            if solution.x is None or solution.x[n] > self.tolerance:
                return None
            amplitudes = solution.x[:n] / solution.x[:n].sum()
            left = turns @ amplitudes
            worst = np.argsort(np.abs(left))[:-9:-1]
            if np.abs(left[worst[0]]) <= self.tolerance:
                return np.asarray(amplitudes)
            self.planes += [(int(k), left[k] / abs(left[k])) for k in worst if abs(left[k]) > self.tolerance]
        return None

    def shorten(self, grid: float, ticks: Ints, amplitudes: Floats) -> tuple[Ints, Floats]:
        """The fewest of these ascending multiples of a `grid` (s) for which there are amplitudes, by bisection."""
        least, most = 0, len(ticks)
        while most - least > 1:
            middle = (least + most) // 2
            solution = self.solve(np.asarray(grid * ticks[:middle]))
            if solution is None:
                least = middle
            else:
                most, amplitudes = middle, solution
        return ticks[:most], amplitudes

    def polish(self, times: Floats, amplitudes: Floats) -> Train | None:
        """A local minimum of the duration near these impulses (n,), those that meet there joined; None if none is.

        The variables are the times but the first, which stays 0, then the amplitudes.
        """
        n, s = len(times), self.exponents[:, None]

        def left(x: Floats) -> tuple[Complexes, Complexes]:
            t = np.append(0.0, x[: n - 1])
            turns = np.exp(s * t - s.real * t[-1])
            return turns, turns @ x[n - 1 :]

        def room(x: Floats) -> Floats:
            return np.asarray(1 - np.abs(left(x)[1] / self.tolerance) ** 2)

        def slopes(x: Floats) -> Floats:
            turns, remainder = left(x)
            by_time = (s * turns * x[n - 1 :])[:, 1:]
            by_time[:, -1] -= s[:, 0].real * remainder
            by = np.hstack((by_time, turns)) / self.tolerance**2
            return np.asarray(-2 * (np.conj(remainder)[:, None] * by).real)

        total = np.append(np.zeros(n - 1), np.ones(n))
        solution = scipy.optimize.minimize(
            lambda x: x[n - 2] / times[-1],
            np.append(times[1:], amplitudes),
            jac=lambda x: np.eye(2 * n - 1)[n - 2] / times[-1],
            bounds=[(0.0, times[-1])] * (n - 1) + [(0.0, 1.0)] * n,
            constraints=(
                {"type": "ineq", "fun": room, "jac": slopes},
                {"type": "eq", "fun": lambda x: total @ x - 1, "jac": lambda x: total},
            ),
            method="SLSQP",
            options={"maxiter": 150, "ftol": 1e-12},
        )
        if room(solution.x).min() < -(EPS ** (1 / 3)):
            return None
        order = np.argsort(np.append(0.0, solution.x[: n - 1]))
        times, amplitudes = np.append(0.0, solution.x[: n - 1])[order], solution.x[n - 1 :][order]
        is_active = amplitudes > EPS**0.5
        return _joined(times[is_active], amplitudes[is_active], EPS ** (1 / 3) * self.fastest)
