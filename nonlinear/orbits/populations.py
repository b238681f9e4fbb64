"""Populations in identical motion in the full equations: periodic orbits, and the multipliers of every sector.

The orbit is one of a few pendula that stand for all (`nonlinear.averaging.populations`), and Newton's method

    Eᵀ[φ_T(E c) − E c] = 0

stays among the motions y = E c of its pattern, so that it goes through values at which neighbours in another sector
begin to grow. Sectors do not mix, so that the multipliers of each are the eigenvalues of FᵀVF, V = ∂φ_T/∂y and F its
basis; those within a population are of one pendulum under the given motion of its support, and belong to N − 1
perturbations of the whole scene.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from modal.errors import ComputationError
from modal.report import Displayed, Summary, brief
from modal.scene import Fixed, Pendulum, Scene, require
from modal.scene.doors import require_type
from modal.types import Complexes, Floats
from nonlinear.averaging import AveragedPattern, Pattern, averaged_pattern
from nonlinear.averaging.equilibria import NEWTON_ROUNDS_MAX
from nonlinear.averaging.populations import MOTION_ANGLE_MIN
from nonlinear.orbits.continuation import CORRECTION_MIN
from nonlinear.orbits.cycles import averaged_start, limit_cycles
from nonlinear.orbits.floquet import PAIR_SPLIT_MIN, deflate, of_monodromy
from nonlinear.orbits.flow import ORBIT_TOLERANCE, Arrival, Flow
from nonlinear.orbits.orbit import Orbit
from nonlinear.orbits.shooting import shooting


@dataclass(frozen=True, eq=False, repr=False)
class PatternOrbit(Displayed):
    """The periodic orbit of a pattern, and V (d, d) over a period in natural units."""

    pattern: Pattern
    orbit: Orbit
    V: Floats

    def _summary(self) -> Summary:
        growth = brief(np.array(self.growth))
        names = ", ".join(sector.name for sector in self.pattern.sectors)
        facts = [("ω (rad/s)", brief(self.orbit.omega)), (f"growth (1/s): {names}", growth)]
        return Summary(f"Periodic orbit, populations {self.pattern.name}", facts)

    @cached_property
    def maps(self) -> tuple[Floats, ...]:
        """The map (2k, 2k) of every sector over a period, of the first without the shift of time."""
        states = [sector.states for sector in self.pattern.sectors]
        inside = states[0].T @ self.V @ states[0]
        flow_direction = states[0].T @ (self.orbit.path.rates[0] / self.orbit.flow.scale)
        return deflate(inside, [flow_direction], []), *(F.T @ self.V @ F for F in states[1:])

    @cached_property
    def multipliers(self) -> tuple[Complexes, ...]:
        """The multipliers of every sector, the largest first, without that of the shift of time."""
        multipliers = []
        for sector_map in self.maps:
            values = np.linalg.eigvals(sector_map).astype(complex)
            multipliers.append(values[np.argsort(-np.abs(values))])
        return tuple(multipliers)

    @property
    def growth(self) -> tuple[float, ...]:
        """The largest growth rate (1/s) of every sector, log |μ|/T."""
        return tuple(float(np.log(np.abs(values[0])) / self.orbit.period) for values in self.multipliers)

    @property
    def beats(self) -> tuple[float, ...]:
        """The rate (rad/s) at which the fastest growing perturbation of every sector oscillates about the orbit."""
        return tuple(float(abs(np.angle(values[0])) / self.orbit.period) for values in self.multipliers)

    @property
    def turns(self) -> tuple[bool, ...]:
        """Whether it oscillates at all: whether its multiplier is one of a pair."""
        return tuple(bool(abs(values[0].imag) > PAIR_SPLIT_MIN) for values in self.multipliers)

    @property
    def is_stable(self) -> bool:
        """Whether perturbations of every sector decay."""
        return max(self.growth) < 0

    @cached_property
    def amplitudes(self) -> tuple[float, ...]:
        """The largest angle (rad) of the pendula of every population."""
        amplitudes, p = [], 0
        for population in self.pattern.populations:
            amplitudes.append(float(self.orbit.amplitudes[self.pattern.system.pendulum == p].max()))
            p += population.halves
        return tuple(amplitudes)


def pattern_orbit(
    pattern: Pattern, near_by: AveragedPattern | PatternOrbit | None = None, *, tolerance: float = ORBIT_TOLERANCE
) -> PatternOrbit:
    """The periodic orbit of a pattern next to an averaged one, or next to that of a scene with other numbers.

    Raise ComputationError if none is found, or it has died out.
    """
    require(pattern.few, "a periodic orbit")
    flow = Flow(pattern.system, tolerance)
    neighbour = near_by or averaged_pattern(pattern)
    if isinstance(neighbour, PatternOrbit):
        orbit = neighbour.orbit
        y, period, leader = orbit.y, orbit.period, int(orbit.amplitudes.argmax())
    else:
        y, period, leader = averaged_start(shooting(pattern.few), neighbour.state)
    E = pattern.sectors[0].states
    half = len(E) // 2
    turning = half + pattern.system.first + leader
    c, T = E.T @ ((y - pattern.rest) / flow.scale), period
    for _ in range(NEWTON_ROUNDS_MAX):
        start, arrival = _ends_of_motion(pattern, flow, c, T)
        gap = E.T @ ((arrival.y - start) / flow.scale)
        slope = E.T @ arrival.V - np.eye(len(c))
        by_time = E.T @ (arrival.path.rates[-1] / flow.scale)
        J = np.block([[slope, by_time[:, None] / pattern.system.rate], [E[turning], np.zeros(1)]])
        step = np.linalg.solve(J, -np.append(gap, E[turning] @ c))
        size = float(np.abs(step).max())
        if not np.isfinite(size):
            break
        part = min(1.0, 0.5 / size) if size else 1.0  # at most half a radian at once
        c, T = c + part * step[:-1], T + part * step[-1] / pattern.system.rate
        if size < CORRECTION_MIN:
            break
    if not size < CORRECTION_MIN:
        raise ComputationError(f"no periodic orbit {pattern.name} was found")
    y, arrival = _ends_of_motion(pattern, flow, c, T, np.eye(len(flow.scale)))
    residual = float(np.abs((arrival.y - y) / flow.scale).max())
    floquet = of_monodromy(arrival.V, [arrival.path.rates[0] / flow.scale], [], conservative=False)
    orbit = Orbit(pattern.few, flow, y, T, floquet, residual, arrival.path, symmetric=False)
    if orbit.amplitude < MOTION_ANGLE_MIN:
        raise ComputationError(f"the motion {pattern.name} dies out")
    return PatternOrbit(pattern, orbit, arrival.V)


def _ends_of_motion(
    pattern: Pattern, flow: Flow, c: Floats, T: float, V: Floats | None = None
) -> tuple[Floats, Arrival]:
    """The start of a motion of the pattern, and its end with V in natural units, by default that of the pattern."""
    E = pattern.sectors[0].states
    y = pattern.rest + flow.scale * (E @ c)
    arrival = flow(y, flow.scale[:, None] * (E if V is None else V), T)
    return y, arrival._replace(V=arrival.V / flow.scale[:, None])


def free_amplitude(scene: Scene, pendulum: Pendulum) -> float | None:
    """The largest angle (rad) of one pendulum on a support at rest, whose drive sustains it; None for none."""
    require_type("scene", scene, "Scene")
    lone_scene = Scene(
        gravity=scene.gravity, support=Fixed(), pendulum=(pendulum.replace(position=(0.0, 0.0), on=None),)
    )
    cycles = limit_cycles(lone_scene)
    return max((orbit.amplitude for orbit in cycles), default=None)
