"""Forced oscillations: branches along a parameter, through folds, starting from the linear response.

Their period is that of the drives. A branch begins at an end of the range where Newton's method finds an orbit: next to
the linear response, the steady solution of

    y' = A (y − y_e) + f(y_e, t),   A = mean of ∂f/∂y at y_e

about the equilibrium y_e under the mean load [Nayfeh1979, section 2.2], or
else where the motion from there settles.

The highest peak of a response at finite swing is found over the frequencies of a band, at each of which a sine of one
size pushes the scene; the size is that at which the largest angle of any link over the band is the one requested. Each
orbit is the one next to the linear response, or where the motion from there settles; where several motions coexist,
others are not seen there, and `follow_forced_orbits` follows them.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from modal.errors import ComputationError, SceneError
from modal.report import Displayed, Summary, silent
from modal.scene import Scene, SineForce, drive_period, require
from modal.scene.doors import checked, formerly
from modal.scene.motion import Acting
from modal.scene.parameters import Variation, variation_of, vary
from modal.types import Floats
from nonlinear.averaging.equilibria import NEWTON_ROUNDS_MAX
from nonlinear.orbits.branch import Branch, Report
from nonlinear.orbits.continuation import DENSE_BRANCH_ORBITS_MAX, STEP_MAX, relative_distance
from nonlinear.orbits.cycles import Beginning, BranchWalk, require_range, solution
from nonlinear.orbits.flow import ORBIT_TOLERANCE, Flow
from nonlinear.orbits.orbit import CYCLE_SAMPLES, ORBIT_RESIDUAL_MAX, Orbit
from nonlinear.orbits.shooting import Shooting, shooting
from nonlinear.system import State, system_of

SETTLING_PERIODS = (20, 40, 120)
"""Cost: after which Newton's method is tried on a motion, one after the other; benchmarks/orbits.py."""
NOWHERE = (
    "no periodic motion was found, neither near the linear response nor where the motion from there settles: give "
    "another start: one whose motion settles"
)
BAND_FREQUENCIES = 33
"""Format: `frequencies` over the band; near the highest they are five times as close."""
SWING_ANGLE_ERROR = 2e-3
"""Limit: relative error of the largest angle, above which "no force was found"."""


@dataclass(frozen=True, eq=False, repr=False)
class LinearResponse(Displayed):
    """The steady motion of the linear model at N even times of a `period` (s): `y` (N, d), `deflections` (N, L).

    These are the angles (rad) of the links from where they hang or stand without drives.
    """

    period: float
    y: Floats = field(repr=False)
    deflections: Floats = field(repr=False)

    @property
    def amplitude(self) -> float:
        """The largest angle (rad) of any link."""
        return float(np.abs(self.deflections).max())

    def _summary(self) -> Summary:
        facts = [("period", f"{self.period:.6g} s"), ("largest angle", f"{np.degrees(self.amplitude):.5g}°")]
        return Summary("Linear response to the drives", facts)


@checked
def linear_response(scene: Scene) -> LinearResponse:
    """The steady motion of the linear model under the drives of a scene.

    Raise SceneError if there are none, or no common period, ComputationError if it has no value.

    >>> from math import pi
    >>> from modal import Bob, Pendulum, Scene
    >>> from modal.scene import SineForce
    >>> push = SineForce(on="pendulum[0].links[0]", amplitude=0.01, frequency_hz=0.25)
    >>> scene = Scene(gravity=9.81, pendulum=[Pendulum(links=[Bob(mass=1.0, length=1.0)])], force=[push])
    >>> round(linear_response(scene).amplitude * (9.81 - (pi / 2) ** 2), 9)
    0.01
    """
    require(scene, "a forced periodic orbit")
    drives, flow = drive_period(scene), Flow(system_of(scene.frictionless))  # nothing sticks in a linear model
    equations, size, n_samples = flow.equations, len(flow.scale), CYCLE_SAMPLES * max(drives.cycles)
    u = equations.inputs_beside(np.arange(n_samples) * (drives.seconds / n_samples), np.zeros((size, n_samples)))
    y = np.concatenate((flow.rest, np.zeros(size // 2)))
    for _ in range(NEWTON_ROUNDS_MAX):
        b, J = equations.linearize(np.repeat(y[:, None], n_samples, axis=1), np.array(u))
        A, acting = J.mean(axis=0), np.fft.rfft(b, axis=1).T
        shift = np.linalg.lstsq(-A, acting[0].real / n_samples, rcond=None)[0]
        if not np.all(np.isfinite(shift)):
            break
        y = y + shift
        if np.abs(shift / flow.scale).max() < ORBIT_TOLERANCE:
            break
    response, rates = np.zeros_like(acting), 2j * np.pi * np.fft.rfftfreq(n_samples, drives.seconds / n_samples)
    for k in np.flatnonzero(np.abs(acting).max(axis=1) > ORBIT_TOLERANCE * np.abs(acting).max()):
        if k:
            response[k] = np.linalg.lstsq(rates[k] * np.eye(size) - A, acting[k], rcond=None)[0]
    motion = y + np.fft.irfft(response.T, n_samples).T
    if not np.all(np.isfinite(motion)):
        raise ComputationError("the linear model has no steady response here")
    links = slice(equations.layout.first, equations.layout.half)
    return LinearResponse(drives.seconds, motion, motion[:, links] - flow.rest[links])


@formerly(cycles="periods")
@checked
def forced_orbit(
    scene: Scene, *, start: State | None = None, periods: int = 1, tolerance: float = ORBIT_TOLERANCE
) -> Orbit:
    """Find the periodic motion of a scene under its drives with this number of common `periods`.

    It is the one next to a `start` at the time 0, by default next to the linear response or where the motion from there
    settles. Raise SceneError if no drives have a common period, ComputationError if no orbit is found.

    >>> from modal import Bob, Pendulum, Scene
    >>> from modal.scene import SineForce
    >>> push = SineForce(on="pendulum[0].links[0]", amplitude=2.0, frequency_hz=0.25)
    >>> scene = Scene(gravity=9.81, pendulum=[Pendulum(links=[Bob(mass=1.0, length=1.0)])], force=[push])
    >>> orbit = forced_orbit(scene)
    >>> orbit.period, round(orbit.amplitude, 6), round(linear_response(scene).amplitude, 6)
    (4.0, 0.269091, 0.272383)
    """
    return _beginning(scene, None, None, start, periods, tolerance).orbit


@formerly(variation="vary", cycles="periods")
@checked
def follow_forced_orbits(
    scene: Scene,
    vary: str | Variation,
    *,
    start: State | None = None,
    periods: int = 1,
    tolerance: float = ORBIT_TOLERANCE,
    longest: float = STEP_MAX,
    max_orbits: int = DENSE_BRANCH_ORBITS_MAX,
    report: Report = silent,
) -> tuple[Branch, ...]:
    """Follow the forced periodic motions of a scene along a parameter, through folds, within its range.

    They have this many `periods` of the drives and begin at both ends of the range, or at its first value next to a
    `start` at the time 0. Neighbours differ by at most 2 % in amplitude and 0.1 in phase (`continuation`). `report` is
    called with the number of branches followed so far. Raise SceneError for a variation of fewer than two values or of
    a count and where the drives have no common period, ComputationError if no orbit is found at either end.
    """
    variation = variation_of(vary)
    require_forced_orbits(scene, variation)
    branches, failures = list[Branch](), dict[float, ComputationError]()
    ends = (variation.values[0], variation.values[-1])
    walk = BranchWalk(longest, max_orbits, relative_distance)
    for value in ends[: 1 if start else 2]:
        try:
            beginning = _beginning(scene, variation, value, start, periods, tolerance)
        except ComputationError as error:
            failures[value] = error
            continue
        if beginning.is_new(branches):
            branches.append(walk(beginning))
            report(len(branches))
    if not branches:
        places = " and ".join(f"{value:g}" for value in failures)
        raise ComputationError(f"{variation.path} = {places}: {failures[variation.values[0]]}")
    return tuple(branches)


@checked
def require_forced_orbits(scene: Scene, variation: Variation) -> None:
    """Raise, without computing anything, what `follow_forced_orbits` raises for this scene and variation."""
    require_range(scene, variation)
    shooting(scene, variation=variation, cycles=1)


def _beginning(
    scene: Scene, variation: Variation | None, value: float | None, start: State | None, cycles: int, tolerance: float
) -> Beginning:
    """An orbit at a value of the number; raise ComputationError if none is found."""
    varied_scene = scene if variation is None or value is None else vary(scene, {variation.path: value})
    problem = shooting(scene, tolerance=tolerance, variation=variation, cycles=cycles, segments=cycles)
    flow = problem.flow_at(value)
    if start:
        return _beginning_near(problem, flow.equations.begin(start), value, "start")
    y = linear_response(varied_scene).y[0]
    period = problem.clock.period(value) if problem.clock else np.inf
    for settling in (0, *SETTLING_PERIODS):
        try:
            for _k in range(settling):
                y = flow(y, np.zeros((len(y), 0)), period).y
            return _beginning_near(problem, y, value, "a settled motion" if settling else "the linear response")
        except ComputationError:
            continue
    raise ComputationError(NOWHERE)


def _beginning_near(problem: Shooting, y: Floats, value: float | None, words: str) -> Beginning:
    """The orbit next to the motion from y, whose links gain the full turns that they gain there."""
    flow = problem.flow_at(value)
    layout, period = flow.equations.layout, problem.clock.period(value) if problem.clock else np.inf
    links, path = slice(layout.first, layout.half), flow(y, np.zeros((len(y), 0)), period).path
    angles = path.states[:, links]
    y, turns = y.copy(), np.round((angles[-1] - angles[0]) / (2 * np.pi)).astype(int)
    middle = (angles.min(axis=0) + angles.max(axis=0)) / 2 - flow.rest[links]
    y[links] -= 2 * np.pi * np.round(middle / (2 * np.pi))
    y = problem.centred_state(y)
    problem = replace(problem, turns=tuple(turns.tolist()) if turns.any() else ())
    u = solution(problem, y, period, value)
    orbit = problem.orbit(u)
    if orbit.residual > ORBIT_RESIDUAL_MAX:
        raise ComputationError("the motion near this one does not close")
    return Beginning(problem, u, orbit, words)


@dataclass(frozen=True, eq=False, repr=False)
class FiniteSwing(Displayed):
    """A force of `size` (N or N m), with which links turn by `angle` (rad) at most; per unit of it the highest `peak`.

    `peak` is half the way between the extremes of the output, in its unit per that of the force, at `frequency` (Hz);
    `responses` (W,) are those at `frequencies` (W,), and `stable` whether the orbit of the peak is.
    """

    size: float
    angle: float
    peak: float
    frequency: float
    stable: bool
    frequencies: Floats
    responses: Floats

    def _summary(self) -> Summary:
        facts = [("force", f"{self.size:.5g}"), ("largest angle", f"{np.degrees(self.angle):.4g}°")]
        return Summary(f"Peak at finite swing: {self.peak:.6g} at {self.frequency:.5g} Hz", facts)


@checked
def finite_swing(
    scene: Scene, on: str, direction: Acting, column: int, angle: float, band: tuple[float, float]
) -> FiniteSwing:
    """The highest peak of a coordinate under a sine at a point, where the largest angle of any link is `angle` (rad).

    `column` is the coordinate's, a cart's 0 and links after it; `band` in Hz. Raise SceneError for scenes without
    forced orbits, ComputationError if an orbit is not found.

    >>> from modal import Bob, Pendulum, Scene
    >>> scene = Scene(gravity=9.81, pendulum=[Pendulum(links=[Bob(mass=1.0, length=1.0, damping=0.3)])])
    >>> found = finite_swing(scene, "pendulum[0].links[0]", "horizontal", 0, 0.3, (0.4, 0.6))
    >>> round(found.angle, 3), found.stable
    (0.3, True)
    """
    if not 0 < angle < np.pi:
        raise SceneError([f"angle {np.degrees(angle):g}: is above 0 and below 180 degrees"])
    plain = scene.replace(force=())
    grid = np.geomspace(*band, BAND_FREQUENCIES)

    def forced_scene(size: float, frequency: float) -> Scene:
        return plain.replace(force=(SineForce(on=on, direction=direction, amplitude=size, frequency_hz=frequency),))

    size = angle / max(linear_response(forced_scene(1.0, f)).amplitude for f in grid.tolist())
    for _ in range(4):
        orbits = {f: forced_orbit(forced_scene(size, f)) for f in grid.tolist()}
        widest = max(orbits, key=lambda f: orbits[f].amplitude)
        orbits |= {f: forced_orbit(forced_scene(size, f)) for f in _between(sorted(orbits), widest)}
        largest = max(orbit.amplitude for orbit in orbits.values())
        if abs(largest / angle - 1) < SWING_ANGLE_ERROR:
            break
        size *= angle / largest
    else:
        raise ComputationError(f"no force was found at which the largest angle is {np.degrees(angle):g}°")
    highest = max(orbits, key=lambda f: _half(orbits[f], column))
    orbits |= {f: forced_orbit(forced_scene(size, f)) for f in _between(sorted(orbits), highest)}
    frequencies = sorted(orbits)
    responses = np.array([_half(orbits[f], column) for f in frequencies]) / size
    best = int(responses.argmax())
    orbit = orbits[frequencies[best]]
    peak = float(responses[best])
    return FiniteSwing(size, largest, peak, frequencies[best], orbit.is_stable, np.array(frequencies), responses)


def _between(frequencies: list[float], middle: float) -> list[float]:
    """More frequencies on both sides of one."""
    at = frequencies.index(middle)
    ends = frequencies[max(at - 1, 0)], frequencies[min(at + 1, len(frequencies) - 1)]
    return [f for f in np.linspace(*ends, BAND_FREQUENCIES // 3).tolist() if f not in frequencies]


def _half(orbit: Orbit, column: int) -> float:
    """Half the way between the extremes of a coordinate over an orbit."""
    values = orbit.coordinates[:, column]
    return float(values.max() - values.min()) / 2
