"""Two clocks on a free beam: exact periodic motions and Floquet multipliers, compared with averaging.

    python benchmarks/sync/floquet.py

The equations are written out here and share no line with the package: with J and b the moment of inertia and the first
moment of each clock about its joint, M all masses together,

    J θ_i'' + b cos θ_i x'' + g b sin θ_i = (e (1 − θ_i²/γ₀²) − d) θ_i',        M x'' + c x' + b Σ (sin θ_i)'' = 0.

A periodic motion is found by shooting: Newton's method on a start with θ₁' = 0 and on the period, with the monodromy
matrix from the variational equations.  A kick of an escapement, at a crossing n·y = a, carries disturbances over by the
saltation matrix Dg + (f₊ − Dg f₋) nᵀ/(nᵀf₋) (Leine & Nijmeijer, Dynamics and Bifurcations of Non-Smooth Mechanical
Systems, 2004, ch. 7).  Clocks that are kicked together are kicked one after the other.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import radians

import numpy as np
from scipy.integrate import solve_ivp

from modal import Bob, Body, Cart, Pendulum, Scene
from modal.scene import Escapement, VanDerPol
from modal.types import Complexes, Floats
from nonlinear.averaging import RelativeEquilibrium, average, relative_equilibria
from nonlinear.synchronization import agreement

G = 9.81
TOLERANCE, DONE, NEWTON = 1e-12, 1e-11, 12
SMALL = 1e-200  # a complex step
TOGETHER = 1e-9  # rad


@dataclass(frozen=True)
class Pair:
    """Two clocks, the second with `extra` more inertia; y = (θ₁, θ₂, θ₁', θ₂', x')."""

    mass: float
    length: float
    centre: float
    inertia: float
    joint: float
    beam: float
    damper: float
    drive: VanDerPol | Escapement
    extra: float = 0.0

    @property
    def moment(self) -> tuple[float, float]:
        """J (kg m²) of both."""
        first = self.inertia + self.mass * self.centre**2
        return first, first + self.extra

    @property
    def first(self) -> float:
        """First moment b (kg m)."""
        return self.mass * self.centre

    @property
    def drift(self) -> float:
        """The rate c/M (1/s) at which a beam drifting along with its clocks is stopped, exactly."""
        return self.damper / (self.beam + 2 * self.mass)

    @cached_property
    def scene(self) -> Scene:
        """The same clocks as a scene of the package."""
        size = {"mass": self.mass, "length": self.length, "damping": self.joint, "drive": self.drive}
        inertias = (self.inertia, self.inertia + self.extra)
        links = [Body(**size, centre=self.centre, inertia=inertia) if inertia else Bob(**size) for inertia in inertias]
        pendula = tuple(Pendulum(links=(link,)) for link in links)
        return Scene(gravity=G, support=Cart(mass=self.beam, damping=self.damper), pendulum=pendula)

    def _mass(self, cosine: Complexes) -> Complexes:
        b, J, zero = self.first, self.moment, 0 * cosine[0]
        rows = ((J[0] + zero, zero, b * cosine[0]), (zero, J[1] + zero, b * cosine[1]))
        total = self.beam + 2 * self.mass + zero
        return np.moveaxis(np.array([*rows, (b * cosine[0], b * cosine[1], total)]), (0, 1), (-2, -1))

    def rate(self, y: Complexes) -> Complexes:
        """The time derivative of y (5, ...)."""
        q, v = y[:2], y[2:4]
        drain = -self.joint * v
        if isinstance(self.drive, VanDerPol):
            drain = drain + self.drive.strength * (1 - (q / radians(self.drive.angle_deg)) ** 2) * v
        left = drain - G * self.first * np.sin(q)
        beam = self.first * np.sum(np.sin(q) * v**2, axis=0) - self.damper * y[4]
        forces = np.moveaxis(np.array([*left, beam]), 0, -1)
        rates = np.linalg.solve(self._mass(np.cos(q)), forces[..., None])[..., 0]
        return np.array([*v, *np.moveaxis(rates, -1, 0)])

    def slope(self, y: Floats) -> Floats:
        """The Jacobian of the rate (5, 5), by complex steps."""
        return np.asarray(self.rate(y[:, None] + 1j * SMALL * np.eye(5)).imag / SMALL)

    def kicked(self, y: Complexes, clock: int, side: float) -> Complexes:
        """The state after a kick of one clock."""
        assert isinstance(self.drive, Escapement)
        push = np.zeros((*y.shape[1:], 3, 1))
        push[..., clock, 0] = side * self.drive.impulse
        jump = np.linalg.solve(self._mass(np.cos(y[:2])), push)[..., 0]
        return np.asarray(y + np.array([0 * y[0], 0 * y[0], *np.moveaxis(jump, -1, 0)]))

    def flow(self, y: Floats, period: float) -> tuple[Floats, Floats]:
        """The end of a run and its derivative by the start; clocks turn back at the start, or near it."""
        time, matrix, waiting = 0.0, np.eye(5), [0.0, 0.0]
        if isinstance(self.drive, Escapement):
            waiting = [-float(np.sign(angle)) for angle in y[:2]]  # where each clock is kicked next
        while True:
            run = solve_ivp(
                self._with_slope,
                (time, period),
                np.concatenate((y, matrix.ravel())),
                method="DOP853",
                rtol=TOLERANCE,
                atol=1e-14,
                events=[self._passing(clock, side) for clock, side in enumerate(waiting) if side],
            )
            time, y, matrix = float(run.t[-1]), run.y[:5, -1], run.y[5:, -1].reshape(5, 5)
            if run.status == 0:
                return y, matrix
            for clock, side in enumerate(waiting):
                if abs(side * y[clock] - radians(self.drive.angle_deg)) < TOGETHER:
                    y, matrix = self._carried(y, matrix, clock, side)
                    waiting[clock] = -side

    def _with_slope(self, _: float, both: Floats) -> Floats:
        y, matrix = both[:5], both[5:].reshape(5, 5)
        return np.concatenate((self.rate(y), (self.slope(y) @ matrix).ravel()))

    def _passing(self, clock: int, side: float):  # type: ignore[no-untyped-def]
        def over(_: float, both: Floats) -> float:
            return float(side * both[clock] - radians(self.drive.angle_deg))

        over.terminal, over.direction = True, 1.0  # type: ignore[attr-defined]
        return over

    def _carried(self, y: Floats, matrix: Floats, clock: int, side: float) -> tuple[Floats, Floats]:
        after = self.kicked(y, clock, side)
        slope = self.kicked(y[:, None] + 1j * SMALL * np.eye(5), clock, side).imag / SMALL
        before = self.rate(y)
        jump = np.outer(self.rate(after) - slope @ before, np.eye(5)[clock]) / before[clock]
        return np.asarray(after), (slope + jump) @ matrix


@dataclass(frozen=True)
class Orbit:
    """A periodic motion: a state y, its period (s) and the monodromy matrix."""

    pair: Pair
    y: Floats
    period: float
    monodromy: Floats

    @cached_property
    def exponents(self) -> Complexes:
        """Floquet exponents (1/s), the largest first, without those of the phase and of the drifting beam."""
        values = np.linalg.eigvals(self.monodromy)
        for known in (1.0, np.exp(-self.pair.drift * self.period)):
            values = np.delete(values, np.abs(values - known).argmin())
        exponents = np.log(values.astype(complex)) / self.period
        return np.asarray(exponents[np.argsort(-exponents.real)])

    @property
    def growth(self) -> float:
        """The largest growth rate (1/s) of perturbations."""
        return float(self.exponents[0].real)


def orbit(pair: Pair, y: Floats, period: float) -> Orbit:
    """The periodic motion closest to this one, by Newton's method; the first clock turns back at its start."""
    for _ in range(NEWTON):
        end, matrix = pair.flow(y, period)
        if np.abs(end - y).max() < DONE:
            return Orbit(pair, y, period, matrix)
        free = [0, 1, 3, 4]
        equations = np.column_stack(((matrix - np.eye(5))[:, free], pair.rate(end)))
        step = np.linalg.solve(equations, y - end)
        y, period = y.copy(), period + float(step[-1])
        y[free] += step[:-1]
    raise ArithmeticError("no periodic motion was found")


def near(pair: Pair, equilibrium: RelativeEquilibrium) -> Orbit:
    """The exact motion close to an averaged configuration."""
    place = equilibrium.averaged.shapes @ equilibrium.z
    turn = np.exp(-1j * np.angle(place[1]))
    q, v = (place * turn).real, (1j * equilibrium.omega * place * turn).real
    return orbit(pair, np.array([q[1], q[2], 0.0, v[2], v[0]]), 2 * np.pi / equilibrium.omega)


def metronomes(angle_deg: float, beam: float = 0.95, strength: float = 2e-5, damper: float = 0.01) -> Pair:
    """Metronomes like the shipped ones, with this γ₀, on other beams."""
    drive = VanDerPol(strength=strength, angle_deg=angle_deg)
    return Pair(0.025, 0.1, 0.02, 1e-5, 1e-6, beam, damper, drive)


def huygens(beam: float, factor: float = 1.0) -> Pair:
    """The shipped clocks on a beam of this mass (kg), with joint dampers and kicks multiplied by a factor."""
    drive = Escapement(impulse=2.9e-5 * factor, angle_deg=3.0)
    return Pair(0.082, 0.14, 0.14, 0.0, 1.35e-4 * factor, beam, 4.0, drive)


PAIRS = (
    *((f"metronomes, γ₀ = {angle}°", metronomes(angle)) for angle in (6, 8, 9, 11)),
    ("metronomes on 3 kg, three times as strong, γ₀ = 10°", metronomes(10, 3.0, 6e-5)),
    *((f"Huygens' clocks on {beam} kg", huygens(beam)) for beam in (3, 10, 40)),
    ("Huygens' clocks on 10 kg, ten times as strong", huygens(10, 10.0)),
)


def main() -> None:
    print(f"{'scene':52} {'pendula':>9} {'exact (1/s)':>12} {'averaged':>9} {'exact (rad/s)':>14} {'averaged':>10}")
    for name, pair in PAIRS:
        for equilibrium in relative_equilibria(average(pair.scene)):
            exact = near(pair, equilibrium)
            rates = f"{exact.growth:12.5f} {equilibrium.growth:9.5f} "
            rates += f"{2 * np.pi / exact.period:14.6f} {equilibrium.omega:10.6f}"
            print(f"{name:52} {agreement(equilibrium):>9} {rates}", flush=True)


if __name__ == "__main__":
    main()
