"""Stable orbits along a parameter: each is followed to both sides while it is stable.

The end is a special point (`special`): a fold, a branch point, a Neimark–Sacker point or a period doubling; or a clock
whose swing is too small for kicks grazes its escapement's angle.  As the number grows, that clock starts at the end of
this branch, or stops at its beginning.  A clock that is kicked does not graze on a stable orbit: a kick P at the rate
γ' of passing adds the energy P γ', the slope of which by the energy, P/(I γ') for a moment of inertia I, makes a
multiplier pass 1 before γ' is 0.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import inf, nan

import numpy as np

from modal.report import Displayed
from modal.scene.parameters import Variation
from modal.types import Crew, Floats, map_by_crew
from nonlinear.dynamics.contacts import escaping
from nonlinear.dynamics.forms import joint_value
from nonlinear.orbits.continuation import STEP_MAX, OrbitPoint, at_edge, follow, tangent_of, with_values
from nonlinear.orbits.cycles import Beginning, is_same_orbit
from nonlinear.orbits.orbit import Orbit, largest
from nonlinear.orbits.shooting import Shooting
from nonlinear.orbits.special import along_cycles, bisect

KINDS = {"torus": "Neimark–Sacker", "period doubling": "doubling"}
"""The names of two of these ends, by the kinds of special points."""


@dataclass(frozen=True, eq=False, repr=False)
class StableOrbits(Displayed):
    """A stable orbit at the values of the number between its birth and its death, None if the range ends before.

    `unknowns` (K, n) are the solutions u of the orbits.
    """

    what, shows = "StableOrbits", "birth: birth; death: death"

    orbits: tuple[Orbit, ...]
    unknowns: Floats
    birth: tuple[str, float] | None
    death: tuple[str, float] | None

    def at(self, value: float) -> Orbit | None:
        """The orbit at one of the values of the map."""
        near = [orbit for orbit in self.orbits if np.isclose(orbit.value or 0.0, value, rtol=1e-9, atol=0)]
        return near[0] if near else None


def stable_branches(
    variation: Variation,
    orbits: Sequence[Sequence[Beginning | None]],
    branch_of: Callable[[Beginning], StableOrbits],
    crew: Crew | None,
) -> list[StableOrbits]:
    """The stable orbits of all values, each followed once, by `stable_orbits` or what remembers them."""
    branches: list[StableOrbits] = []
    for value, here in zip(variation.values, orbits, strict=True):
        new: list[Beginning] = []
        for beginning in here:
            if beginning is None or not beginning.orbit.is_stable:
                continue
            known = [branch.at(value) for branch in branches] + [other.orbit for other in new]
            if not any(orbit and is_same_orbit(beginning.orbit, orbit) for orbit in known):
                new.append(beginning)
        branches += map_by_crew(branch_of, new, crew)
    return branches


def stable_orbits(beginning: Beginning) -> StableOrbits:
    """The orbit of a beginning, followed to both sides along its number while it is stable and found."""
    problem = beginning.problem
    down, birth = _follow_while_stable(beginning, -1.0)
    up, death = _follow_while_stable(beginning, 1.0)
    assert problem.variation
    points = with_values(problem, [*down[:0:-1], *up], problem.variation)
    unknowns = np.array([point.u for point in points])
    return StableOrbits(tuple(point.orbit for point in points), unknowns, birth, death)


def _follow_while_stable(beginning: Beginning, direction: float) -> tuple[list[OrbitPoint], tuple[str, float] | None]:
    """The points of stable orbits to one side, and the kind and value of the event that ends them."""
    problem, u = beginning.problem, beginning.u
    towards = np.append(np.zeros(len(u) - 1), direction)
    points = [OrbitPoint(u, tangent_of(problem.equations(u)[1], towards), beginning.orbit)]
    if not 0 < u[-1] + 1e-9 * direction < 1:
        return points, None
    for current in follow(problem, points[0], step=STEP_MAX / 5, longest=STEP_MAX, distance=_by_clocks):
        if current is points[0]:
            continue
        is_inside = 0 < current.u[-1] < 1
        following = current if is_inside else at_edge(problem, points[-1], current)
        if not following.orbit.is_stable:
            return _end_between(problem, points, following)
        points.append(following)
        if not is_inside:
            return points, None
    last = points[-1].orbit  # from which no step leads on
    kind = "a clock starts" if direction > 0 else "a clock stops"
    return points, (kind, float(last.value or 0.0)) if np.any(np.abs(_excess(last)) < 1e-6) else None


def _by_clocks(current: OrbitPoint, following: OrbitPoint) -> float:
    """No distance between neighbours on which the same clocks are kicked: no branch leads from others to them."""
    before, after = (_excess(point.orbit) > 0 for point in (current, following))
    return 0.0 if np.array_equal(before, after) else inf


def _excess(orbit: Orbit) -> Floats:
    """By how much the swings of clocks exceed the angles of their escapements (rad), (K,)."""
    joints, half = escaping(orbit.flow.system), orbit.flow.equations.layout.half
    if not joints.pairs:
        return np.empty(0)
    times, y, rates = orbit.path
    curves = y[:, :half].T, y[:, half:].T, rates[:, half:].T
    swings, speeds, bends = (np.array([joint_value(curve, pair) for pair in joints.pairs]).T for curve in curves)
    return largest(times, swings - joints.joint_rest, speeds, bends) - joints.angle


def _end_between(
    problem: Shooting, points: list[OrbitPoint], unstable: OrbitPoint
) -> tuple[list[OrbitPoint], tuple[str, float]]:
    """The points to the event between a stable orbit and an unstable one, its kind and its value."""
    specials = [special for special in along_cycles(problem, [points[-1], unstable]) if special.kind != "collision"]
    if specials:
        point, kind = specials[0].point, specials[0].kind
    else:  # equal multipliers that pass together
        point = bisect(problem, points[-1], unstable, lambda place: place.orbit.is_stable)
        others = point.orbit.floquet.others
        leading = others[np.abs(others).argmax()]
        kind = "torus" if abs(leading.imag) > abs(leading.real) * 1e-6 else "branch point"
        kind = "period doubling" if kind == "branch point" and leading.real < 0 else kind
    return [*points, point], (KINDS.get(kind, kind), nan if point.orbit.value is None else float(point.orbit.value))
