"""What best numbers are worth: how far each may be off, and the worst that masses ±5 % make of them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import product
from typing import TYPE_CHECKING

import numpy as np
import scipy

from modal.errors import SceneError
from modal.report import Displayed, listed
from modal.scene.parameters import Place, with_numbers
from modal.types import Floats

if TYPE_CHECKING:
    from modal.tuning.objective import Factors, Objective

SHARE = 0.05
"""By which masses may be off."""
CORNERS = 4
"""Masses of which all corners are tried; of more the worst corner is climbed to."""
CLIMBS = 4
STEP, FURTHEST = 0.01, 3.0
"""First and last distances, in logarithms, at which the objective is looked at."""
FEW = 4
"""Masses that are named."""
OFF = 0.01
"""Of the objective, by which it may be worse."""


@dataclass(frozen=True)
class Worth(Displayed):
    """What a number is worth: the objective's relative change where it is 1 % larger, or smaller, and its range.

    Within `low` and `high`, in the number's unit, the objective is at most 1 % worse; infinite or 0 where it always is.
    """

    path: str
    larger: float
    smaller: float
    low: float
    high: float


def worths(objective: Objective, z: Floats) -> tuple[Worth, ...]:
    """What every number is worth."""
    best = objective.value(z)
    answers = []
    for k, entry in enumerate(objective.free):
        loss = _loss(objective, z, k, best)
        low, high = (_edge(loss, way) for way in (-1.0, 1.0))
        number = float(np.exp(z[k]))
        answers.append(
            Worth(
                entry.path,
                loss(np.log1p(0.01)),
                loss(np.log1p(-0.01)),
                number * float(np.exp(low)) if np.isfinite(low) else 0.0,
                number * float(np.exp(high)) if np.isfinite(high) else np.inf,
            )
        )
    return tuple(answers)


def _loss(objective: Objective, z: Floats, k: int, best: float) -> Callable[[float], float]:
    """By what part the objective is worse where a number is changed by a logarithm."""

    def loss(change: float) -> float:
        aside = z.copy()
        aside[k] += change
        try:
            worse = float(objective.direction * (objective.value(aside) - best))
        except SceneError:
            return np.inf
        return worse / abs(best) if best else np.inf * worse if worse else 0.0

    return loss


def _edge(loss: Callable[[float], float], way: float) -> float:
    """The change at which the objective is 1 % worse, infinite where it never is."""
    inner, outer = 0.0, STEP
    while loss(way * outer) < OFF:
        inner, outer = outer, 2 * outer
        if outer > FURTHEST:
            return way * np.inf
    while not np.isfinite(loss(way * outer)):
        outer = (inner + outer) / 2
        if outer - inner < 1e-6:
            return way * outer
    if loss(way * outer) < OFF:
        return way * outer
    root = scipy.optimize.brentq(lambda at: loss(way * at) - OFF, inner, outer, xtol=1e-6, rtol=1e-6)
    return way * float(root)


@dataclass(frozen=True)
class MassCase(Displayed):
    """Masses times `factors` by their places, with the objective's `value` and its `cost` there."""

    factors: Factors
    value: float
    cost: float

    @property
    def words(self) -> str:
        """Which masses are heavier and which lighter."""
        heavier = [with_numbers(place) for place, factor in self.factors.items() if factor > 1]
        lighter = [with_numbers(place) for place, factor in self.factors.items() if factor < 1]
        if not heavier or not lighter:
            return "all heavier" if heavier else "all lighter"
        few, way, other = min(
            (heavier, "heavier", "lighter"), (lighter, "lighter", "heavier"), key=lambda pair: len(pair[0])
        )
        return f"{way}: {listed(few[:FEW], len(few))}; all others {other}"


def worst_case(objective: Objective, z: Floats) -> MassCase:
    """The worst that masses ±5 %, each for itself, make of the objective."""
    nominal = MassCase({}, objective.value(z), _cost(objective, z, {}))
    return max((nominal, *worst_cases(objective, z)), key=lambda case: case.cost)


def worst_cases(objective: Objective, z: Floats) -> list[MassCase]:
    """Corners of the box of masses ±5 % in which one piece of the objective or another is worst."""
    places = _free_masses(objective, z)
    corners: list[Factors]
    if len(places) <= CORNERS:
        signs = product((1 - SHARE, 1 + SHARE), repeat=len(places))
        corners = [dict(zip(places, corner, strict=True)) for corner in signs]
    else:
        corners = list(_climbed(objective, z, places))
    cases: list[MassCase] = []
    for factors in corners:
        if factors and all(case.factors != factors for case in cases):
            cases.append(MassCase(factors, objective.value(z, factors), _cost(objective, z, factors)))
    return cases


def _free_masses(objective: Objective, z: Floats) -> list[Place]:
    """The places of masses that may change without moving the equilibrium."""
    from modal.tuning.pieces import masses_of

    places = []
    for place in masses_of(objective.quantities.scene):
        try:
            objective.scene_at(z, {place: 1 + SHARE})
            objective.scene_at(z, {place: 1 - SHARE})
        except SceneError:
            continue
        places.append(place)
    return places


def _climbed(objective: Objective, z: Floats, places: list[Place]) -> Iterator[Factors]:
    """From the masses as they are along every piece, and from there on along the worst one."""
    first = _signs(objective, z, places, {})
    for signs in first:
        factors = _corner(places, signs)
        for _ in range(CLIMBS):
            better = _signs(objective, z, places, factors, worst=True)
            after = _corner(places, better[0]) if better else factors
            if after == factors or _cost(objective, z, after) <= _cost(objective, z, factors):
                break
            factors = after
        yield factors


def _corner(places: list[Place], signs: Floats) -> Factors:
    return {place: 1 + SHARE * float(np.sign(sign) or 1.0) for place, sign in zip(places, signs, strict=True)}


def _signs(
    objective: Objective, z: Floats, places: list[Place], factors: Factors, *, worst: bool = False
) -> list[Floats]:
    """The direction in which each piece of a cost grows, by the masses; of the worst piece alone where asked."""
    pieces = objective.quantities.at(objective.numbers(z), factors, by=places)
    signs: list[Floats] = []
    for aim, piece in zip(objective.aims, pieces, strict=False):
        if not len(piece.values):
            continue
        costs = aim.sign * piece.values
        order = np.argsort(-costs, kind="stable")
        near = [k for k in order.tolist() if costs[k] >= costs[order[0]] - 0.5 * abs(costs[order[0]])]
        signs += [np.sign(aim.sign * piece.gradients[k]) for k in (near[:1] if worst else near[:6])]
    unique: list[Floats] = []
    for one_sign in signs:
        if all(np.any(one_sign != other) for other in unique):
            unique.append(one_sign)
    return unique


def _cost(objective: Objective, z: Floats, factors: Factors) -> float:
    cases = objective.cases
    try:
        objective.cases = (factors,)
        return objective.evaluate(z, False).cost
    finally:
        objective.cases = cases
