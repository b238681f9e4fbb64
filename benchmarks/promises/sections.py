"""Passages of a level and first turns over the top by every engine are those of equations of motion written here.

Chains of one to three bobs, on a fixed support or on a cart, by SciPy's DOP853 at 1e-12, whose dense output is taken
apart at its turning points.  Levels lie anywhere, at a start with and without a rate, and just within a turning point,
so that a link passes there and back within a step; links start anywhere, and at exactly ±180°, each motion next to its
mirror image.  A count must be equal; of times the error is that of the angle (m on the rail) then, |rate| |Δt|.
"""

from __future__ import annotations

from collections.abc import Iterator
from importlib.util import find_spec
from typing import Any, NamedTuple

import numpy as np
from promise import Trial, attack
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from modal.scene import Bob, Cart, Pendulum, Scene
from nonlinear.ensembles import ensemble
from nonlinear.system import State

GRAVITY, DURATION, STEP = 9.81, 2.5, 0.002
ERRORS = 10  # times what the ensemble estimates an error to be at the end of the motion
NEAR = 2e-7  # of a level, within which a turning point leaves open whether it is passed
ALLOWED = {1e-9: 1e-6, 1e-6: 1e-3}  # errors of angles (rad) by tolerance, where those are smaller
ENGINES = ["numpy", *(["numba"] if find_spec("numba") else []), "simulate"]


class Chain(NamedTuple):
    """Masses (kg), lengths (m), and the mass of the cart (kg), 0 for a fixed support."""

    mass: Any
    length: Any
    cart: float

    @property
    def scene(self) -> Scene:
        """For the packages."""
        links = [Bob(mass=m, length=length) for m, length in zip(self.mass, self.length, strict=True)]
        support = {"support": Cart(mass=self.cart)} if self.cart else {}
        return Scene(gravity=GRAVITY, pendulum=[Pendulum(links=links)], **support)

    def rates(self, time: float, y: Any) -> Any:
        """Of (x, θ, x', θ'), by Lagrange's equations."""
        n = len(self.mass)
        q, v = y[1 : n + 1], y[n + 2 :]
        below = np.cumsum(self.mass[::-1])[::-1]
        shared = below[np.maximum.outer(np.arange(n), np.arange(n))] * np.outer(self.length, self.length)
        aside = q[:, None] - q
        mass, force = np.zeros((n + 1, n + 1)), np.zeros(n + 1)
        mass[1:, 1:] = shared * np.cos(aside)
        mass[0, 1:] = mass[1:, 0] = below * self.length * np.cos(q)
        mass[0, 0] = self.cart + below[0]
        force[0] = below * self.length * np.sin(q) @ v**2
        force[1:] = -(shared * np.sin(aside)) @ v**2 - below * GRAVITY * self.length * np.sin(q)
        if not self.cart:
            return np.concatenate((y[n + 1 :], [0.0], np.linalg.solve(mass[1:, 1:], force[1:])))
        return np.concatenate((y[n + 1 :], np.linalg.solve(mass, force)))


class Motion:
    """A motion of a chain, with the turning points of every component."""

    def __init__(self, chain: Chain, y: Any) -> None:
        self.begun, self.half = y, len(y) // 2
        self.slope = chain.rates(0.0, y)
        options = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-13, "max_step": 0.02, "dense_output": True}
        self.sol = solve_ivp(chain.rates, (0.0, DURATION), y, **options).sol

    def nodes(self, row: int) -> Any:
        """The start, turning points of a component and the end (s)."""
        grid = np.linspace(0.0, DURATION, round(DURATION / STEP) + 1)[1:]
        rate = self.sol(grid)[self.half + row]
        at = np.flatnonzero(rate[:-1] * rate[1:] < 0)
        turns = [brentq(lambda t: self.sol(t)[self.half + row], grid[k], grid[k + 1], xtol=1e-15) for k in at]
        return np.array([0.0, *turns, DURATION])

    def passages(self, row: int, level: float, wraps: bool) -> tuple[list[tuple[float, int]], bool]:
        """Times (s) and ways in which a component passes a level; whether a turning point leaves that open."""
        nodes, turn = self.nodes(row), 2 * np.pi
        values = self.sol(nodes)[row] - level
        aside = np.abs(values - turn * np.rint(values / turn)) if wraps else np.abs(values)
        passages, rate = [], self.begun[self.half + row]
        if on := bool(abs(aside[0]) < 1e-12):
            values[0] = turn * np.rint(values[0] / turn) if wraps else 0.0
            if rate:
                passages.append((0.0, int(np.sign(rate))))
        for k in range(len(nodes) - 1):
            low, high = sorted((values[k], values[k + 1]))
            levels = turn * np.arange(np.ceil(low / turn), np.floor(high / turn) + 1) if wraps else np.zeros(1)
            way = int(np.sign(values[k + 1] - values[k]))
            inner = [inner_level for inner_level in levels if low < inner_level < high]
            for inner_level in inner[:: way or 1]:
                target = level + inner_level
                passages.append((float(brentq(lambda t, at=target: self.sol(t)[row] - at, *nodes[k : k + 2])), way))  # type: ignore[misc]
        return passages, bool(np.any(aside[1 if on else 0 :] < NEAR))


def trials(seed: int) -> Iterator[Trial]:
    """A chain, its starts with their mirror images, one level, every engine."""
    rng = np.random.default_rng(seed)
    n, tolerance = int(rng.integers(1, 4)), [1e-9, 1e-6][seed % 2]
    chain = Chain(rng.uniform(0.3, 2, n), rng.uniform(0.3, 1.2, n), rng.uniform(0.5, 5) * float(rng.integers(2)))
    row = int(rng.integers(0 if chain.cart else 1, n + 1))
    starts = [start_of(rng, n) for _ in range(3)]
    starts += [-start for start in starts]
    motions = [Motion(chain, start) for start in starts]
    level, wraps = level_of(rng, motions[0], row), row > 0
    direction = int(rng.integers(-1, 2))
    true = [motion.passages(row, level, wraps) for motion in motions]
    tops = [[motion.passages(link, np.pi, True) for link in range(1, n + 1)] for motion in motions]
    states = [State(start[1 : n + 1], start[n + 2 :], cart=start[0], cart_rate=start[n + 1]) for start in starts]
    name = f"theta[1,{row}]" if wraps else "x"
    text = f"section:{name}{'<=>'[direction + 1]}{float(np.degrees(level) if wraps else level)!r}"
    estimated = np.zeros(len(starts))
    for engine in ENGINES:
        options: dict[str, Any] = {"engine": engine, "workers": 1, "check": 0, "tolerance": tolerance}
        members = ensemble(chain.scene, DURATION, starts=states, measures=[text, "first_turn"], **options)
        about = f"{engine} at {tolerance:g}, {n} links{', cart' * bool(chain.cart)}"
        estimated = np.fmax(estimated, members.column("error_rad"))
        allowed = np.maximum(ALLOWED[tolerance], ERRORS * estimated)
        member, time = members.column("crossing_member"), members.column("crossing_time_s")
        for k, (passed, open_) in enumerate(true):
            if not open_:
                wanted = [passage for passage in passed if direction in (0, passage[1])]
                yield from compared(
                    f"{about}, start {k} through {text}", motions[k], row, wanted, time[member == k], allowed[k]
                )
        for link in range(n):
            times = members.column(f"first_turn_1_{link + 1}_s")
            for k, each in enumerate(tops):
                passed, open_ = each[link]
                first = times[k : k + 1][np.isfinite(times[k : k + 1])]
                if not open_:
                    yield from compared(
                        f"{about}, first turn of {link + 1}, start {k}",
                        motions[k],
                        link + 1,
                        passed[:1],
                        first,
                        allowed[k],
                    )


def compared(
    about: str, motion: Motion, row: int, true: list[tuple[float, int]], times: Any, allowed: float
) -> Iterator[Trial]:
    """Counts, then errors of times."""
    yield Trial(f"{about}: {len(times)} passages for {len(true)}", float(abs(len(times) - len(true))), 0.0)
    if len(times) == len(true) and true:
        rates = [abs(motion.sol(time)[motion.half + row]) for time, _ in true]
        errors = [rate * abs(read - time) for rate, read, (time, _) in zip(rates, times, true, strict=True)]
        yield Trial(f"{about}: times", float(max(errors)), allowed)


def start_of(rng: np.random.Generator, n: int) -> Any:
    """Anywhere, upright or hanging exactly, at rest or not."""
    y = np.zeros(2 * n + 2)
    y[1 : n + 1] = rng.uniform(-3, 3, n)
    if rng.integers(2) and n > 1:
        y[rng.integers(1, n + 1)] = np.radians(rng.choice([-180.0, 180.0, 540.0]))
    if rng.integers(2):
        y[n + 2 :] = rng.uniform(-6, 6, n)
    return y


def level_of(rng: np.random.Generator, motion: Motion, row: int) -> float:
    """At the start, just within a turning point, or anywhere."""
    kind = rng.integers(4)
    turns = motion.nodes(row)[1:-1]
    if kind == 0:
        return float(motion.begun[row])
    if kind < 3 and len(turns):
        time = turns[rng.integers(len(turns))]
        y = motion.sol(time)
        way = np.sign(motion.sol(time - 1e-4)[motion.half + row])
        return float(y[row] - way * 10 ** rng.uniform(-5, -1.5))
    return float(rng.uniform(-1, 1) * (0.1 if row == 0 else 3))


if __name__ == "__main__":
    attack(__doc__ or "", trials, cases=200, quick=4)
