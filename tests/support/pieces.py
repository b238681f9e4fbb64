"""Motions with escapements and dry friction, piece by piece: the oracle of switches.

In every piece each coordinate moves under the forces of `nonlinear.dynamics.maximal`, or of `support.places`.  Friction
is a moment on a link and its reverse on the one above, or a force on the cart; a joint or a cart that sticks is one
more constraint, and a kick is an impulse against all constraints.  At the `breaks` of a load what sticks is tried
again.  The reaction of the rail is the constraint's own multiplier.  Which contacts stick is found by trying every set
of them.  SciPy's DOP853 integrates each piece, to an event of `solve_ivp`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from itertools import product
from typing import Protocol

import numpy as np
from scipy.integrate import solve_ivp

from modal.scene import Cart, Scene
from modal.types import Floats
from nonlinear import State
from nonlinear.dynamics import Maximal
from nonlinear.system import Load, system_of

LONGEST = 0.02  # s of a step: little passes a switch and returns in less
AT_REST, ROUNDED = 1e-11, 1e-9  # rad/s or m/s; of a limit
BESIDE = 1e-12  # s, between which and a break a load is not asked
MEETING, BACK = 1e-9, 1e-6  # s between switches that count as one instant; s over which a slope is taken
STAYING: Mapping[int, float] = {}


class Mechanics(Protocol):
    """Equations of motion of y = (q, q', …), with q and q' of one `size`."""

    @property
    def size(self) -> int:
        """Number of coordinates."""

    def unknowns(self, time: float, y: Floats) -> Floats:
        """The accelerations, then forces of constraints, that of the rail first, without friction."""

    def answers(self, time: float, y: Floats, forces: Floats) -> Floats:
        """What each of these generalized forces (J, size), alone, adds to the unknowns."""

    def begin(self, start: State) -> Floats:
        """The y of a start."""

    def closed(self, y: Floats) -> Floats:
        """The y that satisfies all constraints."""

    def read(self, y: Floats) -> State:
        """The state of a y."""


@dataclass(eq=False)
class Switches:
    """Motion with contacts along `J` (J, size) of these limits, the first that of a rail if it has a `coefficient`.

    Clocks kick along `kicked` (C, size), whose products with q are their angles.  Contacts of `sign` 0 stick; `side` is
    that of each clock's next kick.  `events` counts what has changed since the start.
    """

    mechanics: Mechanics
    J: Floats
    limit: Floats
    coefficient: float
    kicked: Floats
    angle: Floats
    impulse: Floats
    breaks: Sequence[float] = ()
    longest: float = LONGEST
    sign: Floats = field(init=False)
    side: Floats = field(init=False)
    events: int = 0

    @property
    def size(self) -> int:
        """Number of coordinates."""
        return self.mechanics.size

    # ------------------------------------------------------------------------------------------------- one instant

    def answers(self, t: float, y: Floats) -> tuple[Floats, Floats]:
        """The unknowns without friction, and by a unit of friction (J, ...)."""
        free = self.mechanics.unknowns(t, y)
        return free, self.mechanics.answers(t, y, self.J) if len(self.J) else np.zeros((0, len(free)))

    def friction(self, t: float, y: Floats, sign: Floats) -> tuple[Floats, Floats, float]:
        """The friction (J,), the unknowns under it, and |N| of a rail with a coefficient, in this state of contacts."""
        free, units = self.answers(t, y)
        count = len(self.J)
        a, G = self.J @ free[: self.size], self.J @ units[:, : self.size].T
        for e in (1.0, -1.0):
            K, right = np.where((sign == 0)[:, None], G, np.eye(count)), np.where(sign == 0, -a, -sign * self.limit)
            if self.coefficient and sign[0]:  # τ + s μ e (N₀ + n·τ) = 0
                K[0] += sign[0] * self.coefficient * e * units[:, self.size]
                right[0] = -sign[0] * self.coefficient * e * free[self.size]
            tau = np.linalg.solve(K, right)
            unknowns = free + tau @ units
            N = unknowns[self.size] if self.coefficient else 1.0
            if N * e >= 0 or not (self.coefficient and sign[0]):
                break
        return tau, unknowns, abs(N)

    def limits(self, N: float) -> Floats:
        """The limits of friction (J,) where the rail pushes with N."""
        if not self.coefficient:
            return self.limit
        return np.append(self.coefficient * N, self.limit[1:])

    def consistent(self, t: float, y: Floats, choices: Sequence[Sequence[float]]) -> Floats:
        """The one state among these of every contact that obeys Coulomb's law where they are at rest."""
        agreeing = []
        for signs in product(*choices):
            sign = np.array(signs)
            tau, unknowns, N = self.friction(t, y, sign)
            starts = (self.J @ unknowns[: self.size]) * sign
            free = np.array([len(each) > 1 for each in choices])
            held = np.abs(tau) <= self.limits(N) * (1 + ROUNDED)
            if np.all(~free | np.where(sign == 0, held, starts >= -ROUNDED)):
                agreeing.append(sign)
        assert agreeing, "no state of the contacts obeys Coulomb's law"
        return max(agreeing, key=lambda sign: np.count_nonzero(sign == 0))

    def pushed(self, t: float, y: Floats, rows: Floats, jump: Floats) -> Floats:
        """The y after an impulse along these rows: these amounts of it."""
        jumped = y.copy()
        jumped[self.size : 2 * self.size] += self.mechanics.answers(t, y, (jump @ rows)[None])[0, : self.size]
        return jumped

    # ------------------------------------------------------------------------------------------------- the motion

    def begin(self, start: State) -> Floats:
        """The y of a start, with the states of contacts and clocks there."""
        y = self.mechanics.begin(start)
        gamma, speed = self.kicked @ y[: self.size], self.J @ y[self.size : 2 * self.size]
        self.side = np.where(np.abs(gamma) > self.angle, -np.sign(gamma), 0.0)
        self._decide(0.0, y, speed)
        return y

    def _decide(self, t: float, y: Floats, speed: Floats, leaving: Mapping[int, float] = STAYING) -> None:
        """What contacts do that slide at this speed, or are at rest, those `leaving` in their directions."""
        if not len(speed):
            self.sign = speed
            return
        choices = [(float(np.sign(v)),) if abs(v) > AT_REST else (0.0, 1.0, -1.0) for v in speed]
        for j, way in leaving.items():
            choices[j] = (way,)
        self.sign = self.consistent(t, y, choices)

    def _rate(self, t: float, y: Floats) -> Floats:
        unknowns = self.friction(t, y, self.sign)[1] if len(self.J) else self.mechanics.unknowns(t, y)
        return np.concatenate((y[self.size : 2 * self.size], unknowns[: self.size], np.zeros(len(y) - 2 * self.size)))

    def _values(self) -> list[tuple[str, int, Callable[[float, Floats], float]]]:
        def sliding(j: int) -> Callable[[float, Floats], float]:
            return lambda t, y: float(-self.sign[j] * (self.J[j] @ y[self.size : 2 * self.size]))

        def held(j: int) -> Callable[[float, Floats], float]:
            def value(t: float, y: Floats) -> float:
                tau, _, N = self.friction(t, y, self.sign)
                return float(abs(tau[j]) - self.limits(N)[j])

            return value

        def angle(j: int, side: float) -> Callable[[float, Floats], float]:
            return lambda t, y: float(side * (self.kicked[j] @ y[: self.size]) - self.angle[j])

        values = [("slips" if s else "sticks", j, (sliding if s else held)(j)) for j, s in enumerate(self.sign)]
        for j, side in enumerate(self.side):
            values += [("right" if s > 0 else "left", j, angle(j, s)) for s in (1.0, -1.0) if side * s >= 0]
        return values

    def end(self, start: State, seconds: float, tolerance: float = 1e-12) -> State:
        """The state after so many seconds."""
        y, t = self.begin(start), 0.0
        for until in (*(time for time in self.breaks if 0 < time < seconds), seconds):
            if t > 0:
                before = self.sign
                self._decide(t + BESIDE, y, self.J @ y[self.size : 2 * self.size])
                self.events += int(np.count_nonzero(self.sign != before))
            y, t = self._until(until, t, y, tolerance), until
        return self.mechanics.read(y)

    def _until(self, until: float, t: float, y: Floats, tolerance: float) -> Floats:
        """The y at the next break or the end, from y at t."""
        low, high = t + BESIDE, until - BESIDE

        def rate(time: float, y: Floats) -> Floats:
            return self._rate(min(max(time, low), high), y)

        while t < until:
            values = [(kind, j, partial(_clipped, value, low, high)) for kind, j, value in self._values()]
            for _, _, value in values:
                value.terminal, value.direction = True, 1  # type: ignore[attr-defined]
            solution = solve_ivp(
                rate, (t, until), y, "DOP853", rtol=tolerance, atol=tolerance, max_step=self.longest,
                events=[value for _, _, value in values],
            )  # fmt: skip
            t, end = float(solution.t[-1]), solution.y[:, -1]
            y = self.mechanics.closed(end)
            if solution.status:
                happened = [
                    (kind, j)
                    for (kind, j, value), times in zip(values, solution.t_events, strict=True)
                    if len(times) or _is_met(value, t, end, rate(t, end))
                ]
                y = self._changed(happened, min(max(t, low), high), y)
                self.events += len(happened)
        return y

    def _changed(self, happened: Sequence[tuple[str, int]], t: float, y: Floats) -> Floats:
        """The y after all that happens at one instant."""
        kicks = [(j, 1.0 if kind == "right" else -1.0) for kind, j in happened if kind in {"right", "left"}]
        for j, side in kicks:
            y = self.pushed(t, y, self.kicked[j : j + 1], np.array([side * self.impulse[j]]))
            self.side[j] = -side
        speed = self.J @ y[self.size : 2 * self.size]
        if kicks:
            self._decide(t, y, speed)
            return y
        stopping = [j for kind, j in happened if kind == "slips"]
        still = np.flatnonzero((self.sign == 0) | np.isin(np.arange(len(self.J)), stopping))
        units = self.answers(t, y)[1][still, : self.size]
        y = self.pushed(t, y, self.J[still], -np.linalg.solve(self.J[still] @ units.T, speed[still]))
        speed[still] = 0.0
        ways = -np.sign(self.friction(t, y, self.sign)[0])
        self._decide(t, y, speed, {j: float(ways[j]) for kind, j in happened if kind == "sticks"})
        return y


def _clipped(value: Callable[[float, Floats], float], low: float, high: float, t: float, y: Floats) -> float:
    return value(min(max(t, low), high), y)


def _is_met(value: Callable[[float, Floats], float], t: float, y: Floats, rates: Floats) -> bool:
    """Whether a value comes through 0 within MEETING of a time, at which `solve_ivp` has found another one."""
    now = value(t, y)
    slope = (now - value(t - BACK, y - BACK * rates)) / BACK
    return abs(now) <= slope * MEETING


@dataclass(frozen=True, eq=False)
class InMaximalCoordinates:
    """`nonlinear.dynamics.maximal` with friction's moments and kicks as forces next to its own."""

    maximal: Maximal

    @property
    def size(self) -> int:
        """Number of coordinates."""
        return self.maximal.pivots.size

    def unknowns(self, time: float, y: Floats) -> Floats:
        """Accelerations and forces."""
        return self.maximal.unknowns(time, y)

    def answers(self, time: float, y: Floats, forces: Floats) -> Floats:
        """What these forces add."""
        angles = self.maximal.pivots.parts(y[: self.size])[1][:, 2]
        return np.array([self.maximal.pivots.saddle.solve(angles, row, 0.0) for row in forces])

    def begin(self, start: State) -> Floats:
        """The y of a start."""
        return self.maximal.begin(start)

    def closed(self, y: Floats) -> Floats:
        """The y of closed pivots."""
        return self.maximal.project(y)[0]

    def read(self, y: Floats) -> State:
        """The state."""
        return self.maximal.read(y[None])[0]


class Pieces(Switches):
    """The motion of one pendulum in the plane, in maximal coordinates."""

    def __init__(self, scene: Scene, load: Load | None = None, breaks: Sequence[float] = ()) -> None:
        (pendulum,), maximal = scene.pendulum, Maximal(system_of(scene), load)
        links, cart = pendulum.links, scene.support
        first, size = maximal.pivots.first, maximal.pivots.size
        rows, limits = np.zeros((len(links), size)), [link.friction for link in links]
        for i, row in enumerate(rows):
            row[first + 3 * i + 2] = 1.0
            if i:
                row[first + 3 * i - 1] = -1.0
        clocks = [i for i, link in enumerate(links) if link.drive is not None]
        angle, impulse = (
            np.array([getattr(links[i].drive, name) for i in clocks]) for name in ("angle_deg", "impulse")
        )
        rubbing = [i for i, limit in enumerate(limits) if limit]
        J, limit, coefficient = rows[rubbing], np.array([limits[i] for i in rubbing]), 0.0
        if isinstance(cart, Cart) and (cart.friction or cart.friction_coefficient):
            J = np.vstack((np.eye(size)[0], J))
            limit, coefficient = np.append(cart.friction, limit), cart.friction_coefficient
        clockwork = rows[clocks], np.radians(angle), impulse
        super().__init__(InMaximalCoordinates(maximal), J, limit, coefficient, *clockwork, breaks)
