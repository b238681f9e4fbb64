"""Branch switching at a special point.

At a branch point the equations have two null vectors: the tangent of the branch and another one, along which the other
branch leaves.  At a period doubling the same holds for the equations of twice the period.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import islice, product

import numpy as np

from modal.errors import ComputationError
from modal.types import Floats
from nonlinear.orbits.between import refined_points
from nonlinear.orbits.branch import Branch
from nonlinear.orbits.continuation import (
    BRANCH_ORBITS_MAX,
    DENSE_BRANCH_ORBITS_MAX,
    OrbitPoint,
    at_edge,
    follow,
    level,
    point,
    relative_distance,
    with_values,
)
from nonlinear.orbits.cycles import turning
from nonlinear.orbits.orbit import Orbit
from nonlinear.orbits.shooting import Shooting, shooting, spread
from nonlinear.orbits.special import Special, along_cycles

FIRST_STEPS = (0.02, 0.05, 0.01, 0.1)
"""Cost: first steps along the new branch that are tried, in natural units; benchmarks/orbits.py."""
LEAVES = ("branch point", "period doubling")


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
    points = refined_points(problem, points)
    points = with_values(problem, points, problem.variation) if problem.variation else points
    specials = tuple(along_cycles(problem, points))
    return Branch(f"{special.kind} of {branch.origin}", tuple(points), specials, problem, problem.variation)


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
