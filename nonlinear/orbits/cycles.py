"""Limit cycles of self-excited and damped scenes, forced oscillations, and the branches that leave others.

At a branch point the equations have two null vectors: the tangent of the branch and another one, along which the other
branch leaves.  At a period doubling the same holds for the equations of twice the period.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import islice, product
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
from nonlinear.orbits.branch import Branch, Report, finished_branch
from nonlinear.orbits.continuation import (
    BRANCH_ORBITS_MAX,
    DENSE_BRANCH_ORBITS_MAX,
    STEP_MAX,
    OrbitPoint,
    at_edge,
    correct,
    follow,
    follow_until,
    level,
    outside_range,
    place_in,
    point,
    relative_distance,
    tangent_of,
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
FIRST_STEPS = (0.02, 0.05, 0.01, 0.1)
"""Cost: first steps along the new branch that are tried, in natural units; benchmarks/orbits.py."""
LEAVES = ("branch point", "period doubling")


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
    require_range(scene, variation)
    require(scene, "a limit cycle")


def require_range(scene: Scene, variation: Variation) -> None:
    """Raise SceneError for a number of the scene along which no branch can be followed."""
    validate_variations(scene, [variation])
    if len(variation.values) < 2 or variation.path.endswith("count"):
        raise SceneError([f"{variation.path}: orbits need two or more values of a continuous parameter"])


def beginnings(
    scene: Scene, variation: Variation | None, value: float | None, start: tuple[State, float] | None, tolerance: float
) -> Iterator[Beginning]:
    """Limit cycles at one value of the number, or of the scene itself."""
    varied_scene = scene if variation is None or value is None else vary(scene, {variation.path: value})
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
        problem, u = beginning.problem, beginning.u
        inward = np.append(np.zeros(len(u) - 1), 1.0 if u[-1] < 0.5 else -1.0)
        first = OrbitPoint(u, tangent_of(problem.equations(u)[1], inward), beginning.orbit)
        smallest = 0.0 if problem.clock else DYING_AMPLITUDE_RATIO * beginning.orbit.amplitude
        steps = follow(problem, first, step=self.longest / 5, longest=self.longest, distance=self.distance)
        points, complete = follow_until(problem, steps, outside_range(first), self.max_orbits, smallest=smallest)
        return finished_branch(beginning.words, problem, points, along_cycles, problem.variation, complete=complete)


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
    distance = place_in(variation, at) - place_in(variation, value)
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


def leaving_branch(branch: Branch, special: Special, *, max_orbits: int | None = None, step: float = 0.05) -> Branch:
    """Compute the branch that starts at a branch point or a period doubling.

    It has up to `max_orbits` orbits, by default 100, of a forced motion 1,000. Raise ComputationError at other points
    and where no branch is found.
    """
    if special.kind not in LEAVES:
        raise ComputationError(f"no other branch leaves at a {special.kind}")
    times = 2 if special.kind == "period doubling" else 1
    problem, u, old = _at(branch, special, times)
    _, J = problem.equations(u)
    null = np.linalg.svd(J)[2][-2:]
    old = null.T @ (null @ old)
    new = null[0] * (null[1] @ old) - null[1] * (null[0] @ old)
    new /= np.linalg.norm(new)
    for offset, sign in product(FIRST_STEPS, (1.0, -1.0)):
        first = point(problem, u + offset * sign * new, sign * new)
        if first and abs((first.u - u) @ new) > offset / 2:  # it has not fallen back to the old branch
            break
    else:
        raise ComputationError(f"no branch was found that leaves at this {special.kind}")
    max_orbits = max_orbits or (DENSE_BRANCH_ORBITS_MAX if problem.clock else BRANCH_ORBITS_MAX) // 4
    points = list(islice(_inside(problem, first, step), max_orbits))
    return finished_branch(f"{special.kind} of {branch.origin}", problem, points, along_cycles, problem.variation)


def _at(branch: Branch, special: Special, times: int) -> tuple[Shooting, Floats, Floats]:
    """Equations without symmetry, their solution at the special point and the direction of the branch there."""
    orbit = special.orbit
    if isinstance(branch.problem, Shooting):
        source = branch.problem
        clock = source.clock and replace(source.clock, seconds=times * source.clock.seconds)
        turns, cycles = tuple(times * turn for turn in source.turns), times * source.cycles
        problem = replace(source, segments=times * source.segments, clock=clock, cycles=cycles, turns=turns)
    else:
        probe = shooting(orbit.scene, tolerance=orbit.flow.tolerance)
        _, leader = turning(probe, orbit.y, orbit.period)
        problem = replace(probe, leader=leader, segments=times * probe.segments)

    def unknowns(orbit: Orbit) -> Floats:
        states = spread(problem, orbit.flow, problem.centred_state(orbit.y), times * orbit.period)
        return problem.unknown(states, times * orbit.period, orbit.value)

    start, end = branch.orbits[special.after], branch.orbits[special.after + 1]
    return problem, unknowns(orbit), unknowns(end) - unknowns(start)


def _inside(problem: Shooting, first: OrbitPoint, step: float) -> Iterator[OrbitPoint]:
    """The points of the branch as long as its number is within the range, to its edge, and once around a closed one."""
    previous, has_left = first, False
    for current in follow(
        problem, first, step=step / 2, longest=step, distance=relative_distance if problem.clock else level
    ):
        if problem.variation and not 0 <= current.u[-1] <= 1:
            if current is not first:
                yield at_edge(problem, previous, current)
            return
        yield current
        has_left = has_left or float(np.linalg.norm(current.u - first.u)) > 2 * step
        if has_left and np.linalg.norm(current.u - first.u) < np.linalg.norm(current.u - previous.u):
            return
        previous = current
