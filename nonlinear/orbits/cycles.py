"""Limit cycles of self-excited and damped scenes, and forced oscillations."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import islice
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from modal.errors import ComputationError, SceneError
from modal.report import silent
from modal.scene import Scene, require
from modal.scene.doors import checked, checked_index, checked_number, formerly
from modal.scene.parameters import Variation, validate_variations, variation_of, vary
from modal.types import Crew, Floats, map_by_crew
from nonlinear.averaging import RelativeEquilibrium, average, relative_equilibria
from nonlinear.dynamics.variational import Force
from nonlinear.orbits.between import refined_points
from nonlinear.orbits.branch import Branch, Report
from nonlinear.orbits.continuation import (
    BRANCH_ORBITS_MAX,
    STEP_MAX,
    OrbitPoint,
    at_edge,
    correct,
    follow,
    level,
    tangent_of,
    with_values,
)
from nonlinear.orbits.flow import ORBIT_TOLERANCE
from nonlinear.orbits.orbit import ORBIT_RESIDUAL_MAX, Orbit
from nonlinear.orbits.shooting import TOLERANCE_MAX, TOLERANCE_MIN, Clock, Shooting, shooting, spread
from nonlinear.orbits.special import Special, along_cycles
from nonlinear.system import Motion, State, system_of, translations, validate_state

SEGMENTS_MAX = 10_000
"""Limit: most `segments`, "must be a whole number from 1 to 10000"."""
ORBIT_DIFFERENCE_MIN = 1e-6
"""Tolerance: relative, from which on two orbits are different: their multipliers are known to 1e-7."""
DRIFT_RATE_ERROR = 1e-2
"""Tolerance: how close to c/M the rate of the cart's drift is: pendula that swing with it change that rate."""
DYING_AMPLITUDE_RATIO = 1e-2
"""Limit: of the first amplitude, below which a branch ends, not `complete`."""


@checked
def periodic_orbit(
    scene: Scene,
    start: State,
    period: float,
    *,
    force: Force | None = None,
    tolerance: float = ORBIT_TOLERANCE,
    segments: int = 2,
    rcond: float | None = None,
) -> Orbit:
    """Find the periodic orbit close to a motion from a start, by Newton's method.

    Under a `force`, a function of the time (s) that gives the generalized forces (cart first, then all links: N, N m),
    the `period` (s) is kept; otherwise it is the first guess, and the link that moves furthest turns back at the start.
    Directions whose singular values are below `rcond`, relative, are left as guessed: along a family of orbits.  Raise
    ComputationError if the method finds none.
    """
    checked_number("tolerance", tolerance, TOLERANCE_MIN, TOLERANCE_MAX)
    checked_index("segments", segments, 1, SEGMENTS_MAX)
    checked_number("period", period, ORBIT_TOLERANCE)
    validate_state(start, system_of(scene))
    probe = shooting(scene, tolerance=tolerance, segments=segments, force=force)
    y = probe.first.equations.begin(start)
    if force is not None:
        return solve_orbit(replace(probe, clock=Clock(period)), y, period, rcond=rcond)
    y, leader = turning(probe, y, period)
    return solve_orbit(replace(probe, leader=leader), y, period, rcond=rcond)


def solve_orbit(
    problem: Shooting, y: Floats, period: float, value: float | None = None, rcond: float | None = None
) -> Orbit:
    """The orbit close to the motion from y; raise ComputationError if Newton's method finds none."""
    return problem.orbit(solution(problem, y, period, value, rcond))


def solution(
    problem: Shooting, y: Floats, period: float, value: float | None = None, rcond: float | None = None
) -> Floats:
    """The unknowns of that orbit; a varied number keeps its value."""
    flow = problem.flow_at(value)
    u = problem.unknown(spread(problem, flow, y, period), period, value)
    row = np.eye(len(u))[-1] if problem.variation else None
    solved_for = correct(problem, u, row, rcond)
    if solved_for is None:
        raise ComputationError("no periodic orbit was found near this motion")
    return solved_for[0]


def turning(problem: Shooting, y: Floats, period: float) -> tuple[Floats, int]:
    """Where on the motion from y the link that moves furthest begins an orbit, and that link (from 0).

    There it turns back; with dry friction it passes its angle at rest to the right.
    """
    flow = problem.first
    layout, path = flow.equations.layout, flow(y, np.zeros((len(y), 0)), period).path
    first = layout.first
    angles = path.states[:, first : layout.half] - flow.system.rest
    leader = int(np.abs(angles).max(axis=0).argmax())
    if problem.passes:
        risen = np.flatnonzero((angles[:-1, leader] <= 0) & (angles[1:, leader] > 0))
        if not len(risen):
            raise ComputationError("the motion does not swing through the angle at rest")
        at = int(risen[-1]) + int(abs(angles[risen[-1] + 1, leader]) < abs(angles[risen[-1], leader]))
        start_state = path.states[at].copy()
        start_state[first + leader] = flow.rest[first + leader]
    else:
        at, rate = int(np.abs(angles[:, leader]).argmax()), layout.half + first + leader
        bend = path.rates[at, rate] or 1.0  # none at rest
        time = path.times[at] - path.states[at, rate] / bend
        # not at the nearest sample: that may be the kick of another clock
        start_state = flow(y, np.zeros((len(y), 0)), float(np.clip(time, 0.0, period))).y
        start_state[rate] = 0.0
    return problem.centred_state(start_state), leader


def last_swing(times: Floats, motion: Motion) -> float:
    """The time (s) between the last two passages of the widest link to the right through its mean angle.

    Raise ComputationError if it does not pass twice.
    """
    late = motion.links[len(times) // 2 :]
    widest = int(np.ptp(late, axis=0).argmax())
    x = motion.links[:, widest] - late[:, widest].mean()
    passages = np.flatnonzero((x[:-1] < 0) & (x[1:] >= 0))[-2:]
    if len(passages) < 2:
        raise ComputationError("the run does not oscillate: it shows no period")
    moments = times[passages] - x[passages] * (times[passages + 1] - times[passages]) / (x[passages + 1] - x[passages])
    return float(np.diff(moments)[0])


def averaged_start(problem: Shooting, equilibrium: RelativeEquilibrium) -> tuple[Floats, float, int]:
    """The start of an averaged configuration: y, period (s), and the link that is the widest, which turns or passes."""
    system = equilibrium.averaged.system
    place = equilibrium.averaged.shapes @ equilibrium.z
    first = system.first
    leader = int(np.abs(place[first:]).argmax())
    turn = np.exp(-1j * np.angle(place[first + leader])) * (-1j if problem.passes else 1)
    q, v = (place * turn).real, (1j * equilibrium.omega * place * turn).real
    q = problem.centred_state(q)
    q[first:] += system.rest
    if problem.passes:
        q[first + leader] = system.rest[leader]
    else:
        v[first + leader] = 0.0
    return np.concatenate((q, v)), 2 * np.pi / equilibrium.omega, leader


@checked
def cycle_of(scene: Scene, equilibrium: RelativeEquilibrium, *, tolerance: float = ORBIT_TOLERANCE) -> Orbit:
    """The limit cycle close to an averaged configuration; raise ComputationError if there is none."""
    problem = shooting(scene, tolerance=tolerance)
    y, period, leader = averaged_start(problem, equilibrium)
    return solve_orbit(replace(problem, leader=leader), y, period)


@checked
def limit_cycles(scene: Scene, *, tolerance: float = ORBIT_TOLERANCE) -> tuple[Orbit, ...]:
    """The limit cycles close to the averaged configurations of a driven scene, each once."""
    checked_number("tolerance", tolerance, TOLERANCE_MIN, TOLERANCE_MAX)
    cycles: list[Orbit] = []
    for equilibrium in relative_equilibria(average(scene)):
        try:
            orbit = cycle_of(scene, equilibrium, tolerance=tolerance)
        except ComputationError:
            continue
        if not any(is_same_orbit(orbit, cycle) for cycle in cycles):
            cycles.append(orbit)
    return tuple(cycles)


def is_same_orbit(cycle: Orbit, reference: Orbit) -> bool:
    """Whether two orbits have equal frequencies, amplitudes and largest multipliers."""
    numbers = [[orbit.omega, orbit.amplitude, *np.sort(np.abs(orbit.floquet.others))] for orbit in (cycle, reference)]
    return bool(np.allclose(numbers[0], numbers[1], rtol=ORBIT_DIFFERENCE_MIN, atol=ORBIT_DIFFERENCE_MIN))


def growth(orbit: Orbit) -> float:
    """The largest growth rate (1/s) of perturbations, −∞ where there are no others.

    The drift of a free cart that its damper brings to rest, by which no pendulum moves against another, is omitted, as
    is that of free supports.
    """
    rates, is_drift = _rates(orbit)
    return float(rates[~is_drift].max(initial=-np.inf))


def drift_growth(orbit: Orbit) -> float:
    """The growth rate (1/s) of what `growth` omits, −∞ where there is nothing."""
    rates, is_drift = _rates(orbit)
    return float(rates[is_drift].max(initial=-np.inf))


def _rates(orbit: Orbit) -> tuple[Floats, NDArray[np.bool_]]:
    """The growth rates (1/s) of all perturbations, and which are drifts of a cart or of carriers."""
    rates = np.log(np.abs(orbit.floquet.others)) / orbit.period
    is_drift = np.zeros(len(rates), dtype=bool)
    for drift in _drifts(orbit) if len(rates) else ():
        at = int(np.where(is_drift, np.inf, np.abs(rates - drift)).argmin())
        is_drift[at] |= abs(rates[at] / drift - 1) < DRIFT_RATE_ERROR
    return rates, is_drift


def _drifts(orbit: Orbit) -> Iterator[float]:
    """The rates (1/s) at which dampers of free carts and supports bring these to rest."""
    system, equations = orbit.flow.system, orbit.flow.equations
    for translation in translations(system):
        if system.structure is None:
            resisting, mass = float(equations.momentum_slope(orbit.y)[0]), system.total_mass
        else:
            # the supports' own dampers, not those between points
            dampers = [
                carrier.damping if carrier.D is None else np.zeros(carrier.size)
                for carrier in system.structure.carriers
            ]
            half = equations.layout.half
            displacement = np.pad(translation, (0, half - len(translation)))
            resisting = float(np.concatenate(dampers) @ translation**2)
            mass = float(displacement @ equations.momenta(orbit.y[:half, None], displacement[:, None])[:, 0])
        if resisting:
            yield -resisting / mass


@formerly(variation="vary")
@checked
def follow_cycles(
    scene: Scene,
    vary: str | Variation,
    *,
    start: tuple[State, float] | None = None,
    tolerance: float = ORBIT_TOLERANCE,
    longest: float = STEP_MAX,
    max_orbits: int = BRANCH_ORBITS_MAX,
    crew: Crew | None = None,
    report: Report = silent,
) -> tuple[Branch, ...]:
    """Follow the limit cycles of a driven scene along a parameter, through folds, within its range.

    They begin at both ends of the range next to the averaged configurations, or at its first value next to a motion
    given by a `start` and an approximate period (s). A `crew` follows branches from one end together: each is followed
    from orbit to orbit. `report` is called with the number of branches followed so far. Raise SceneError for a
    variation of fewer than two values or of a count, ComputationError if nothing excites the scene or no limit cycle is
    found.
    """
    variation = variation_of(vary)
    require_cycles(scene, variation)
    ends = (variation.values[0], variation.values[-1])
    branches: list[Branch] = []
    walk = BranchWalk(longest, max_orbits)
    for value in ends[: 1 if start else 2]:
        orbits = beginnings(scene, variation, value, start, tolerance)
        for branch in map_by_crew(walk, (beginning for beginning in orbits if beginning.is_new(branches)), crew):
            if not is_known(branch.orbits[0], branches):
                branches.append(branch)
                report(len(branches))
    if not branches:
        raise ComputationError("no limit cycle was found at the ends of the range")
    return tuple(branches)


@checked
def require_cycles(scene: Scene, variation: Variation) -> None:
    """Raise, without computing anything, what `follow_cycles` raises for this scene and variation."""
    validate_variations(scene, [variation])
    if len(variation.values) < 2 or variation.path.endswith("count"):
        raise SceneError([f"{variation.path}: orbits need two or more values of a continuous parameter"])
    require(scene, "a limit cycle")


def beginnings(
    scene: Scene,
    variation: Variation,
    value: float,
    start: tuple[State, float] | None,
    tolerance: float,
) -> Iterator[Beginning]:
    """Limit cycles at one value of the number."""
    varied_scene = vary(scene, {variation.path: value})
    probe = shooting(varied_scene, tolerance=tolerance)
    guesses: list[tuple[Floats, float, int, str]] = []
    if start:
        y, leader = turning(probe, probe.first.equations.begin(start[0]), start[1])
        guesses.append((y, start[1], leader, "start"))
    else:
        for equilibrium in relative_equilibria(average(varied_scene)):
            guesses.append((*averaged_start(probe, equilibrium), f"mode {equilibrium.number}"))
    for y, period, leader, words in guesses:
        problem = shooting(scene, leader=leader, tolerance=tolerance, variation=variation)
        try:
            u = solution(problem, y, period, value)
            orbit = problem.orbit(u)
            if orbit.residual < ORBIT_RESIDUAL_MAX < orbit.amplitude:
                yield Beginning(problem, u, orbit, words)
        except ComputationError:
            continue


class Beginning(NamedTuple):
    """An orbit at an end of the range of a number: its equations, the unknowns, and in words where it comes from."""

    problem: Shooting
    u: Floats
    orbit: Orbit
    words: str

    def is_new(self, branches: Sequence[Branch]) -> bool:
        """Whether none of these branches begins or ends with it."""
        return not is_known(self.orbit, branches)


@dataclass(frozen=True)
class BranchWalk:
    """Follows branches by steps up to `longest`, to at most `max_orbits` orbits; `distance` is at most 1 nearby."""

    longest: float
    max_orbits: int
    distance: Callable[[OrbitPoint, OrbitPoint], float] = level

    def __call__(self, beginning: Beginning) -> Branch:
        """The branch from one end of the range until it leaves that, with its special points and the values."""
        problem, variation = beginning.problem, beginning.problem.variation
        assert variation
        points, complete = self._follow(beginning)
        points = refined_points(problem, points)
        special = tuple(along_cycles(problem, points))
        points = with_values(problem, points, variation)
        return Branch(beginning.words, tuple(points), special, problem, variation, complete)

    def _follow(self, beginning: Beginning) -> tuple[list[OrbitPoint], bool]:
        """The points until the branch leaves the range, and whether it does."""
        problem, u = beginning.problem, beginning.u
        inward = np.zeros(len(u))
        inward[-1] = 1.0 if u[-1] < 0.5 else -1.0
        points: list[OrbitPoint] = []
        first = OrbitPoint(u, tangent_of(problem.equations(u)[1], inward), beginning.orbit)
        for current in follow(problem, first, step=self.longest / 5, longest=self.longest, distance=self.distance):
            points.append(current)
            if len(points) > 1 and not 0 < current.u[-1] < 1:
                points[-1] = at_edge(problem, points[-2], current)
                return points, True
            dies = not problem.clock and current.orbit.amplitude < DYING_AMPLITUDE_RATIO * beginning.orbit.amplitude
            if len(points) >= self.max_orbits or dies:
                break
        return points, False


def is_known(orbit: Orbit, branches: Sequence[Branch]) -> bool:
    """Whether one of these branches begins or ends with this orbit."""
    ends = [end for branch in branches for end in (branch.orbits[0], branch.orbits[-1])]
    return any(
        orbit.value is not None and np.isclose(end.value or 0.0, orbit.value, rtol=1e-9) and is_same_orbit(end, orbit)
        for end in ends
    )


@checked
def first_special_point(
    scene: Scene, variation: Variation, equilibrium: RelativeEquilibrium, value: float, at: float
) -> Special | None:
    """The first special point on the orbits that begin next to a configuration at a value of a number, towards `at`.

    None if there is none until four times as far; raise ComputationError if no orbit is found at the beginning.
    """
    y, period, leader = averaged_start(shooting(equilibrium.averaged.scene), equilibrium)
    problem = shooting(scene, leader=leader, variation=variation)
    u = solution(problem, y, period, value)
    distance = problem.place(at) - problem.place(value)
    towards = np.append(np.zeros(len(u) - 1), np.sign(distance))
    previous = OrbitPoint(u, tangent_of(problem.equations(u)[1], towards), problem.orbit(u))
    steps = follow(problem, previous, step=abs(distance) / 2, longest=max(2 * abs(distance), 0.05))
    for current in islice(steps, 1, BRANCH_ORBITS_MAX):
        if special := next(along_cycles(problem, [previous, current]), None):
            return special
        if (current.u[-1] - u[-1]) / distance > 4:
            break
        previous = current
    return None
