"""The objective: quantities with weights and limits, in the logarithms of free parameters, over several cases.

Sensitivities of the best numbers follow from it: how far each may be off, the worst that masses ±5 % make of them, and
the loads on the tuned dampers, their stroke and their torque or force, of the peak or the RMS that is tuned.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import product

import numpy as np
import scipy

from modal.errors import SceneError
from modal.report import Displayed, Summary, listed
from modal.scene import Scene, number_words
from modal.scene.parameters import Place, with_numbers
from modal.statespace.geometry import geometry_of
from modal.tuning.minimax import LABEL_STEP, Evaluation, Faces
from modal.tuning.pieces import Pieces, Quantities, Setting, masses_of
from modal.tuning.quantities import FreeNumber, Limit, Quantity
from modal.types import Crew, Floats, map_by_crew

Factors = Mapping[Place, float]


MASS_SHARE = 0.05
"""Limit: by which masses may be off, ±5 % in the report."""
PERCENT = 0.01
"""Format: of a number and the objective, its sensitivities: `one_percent_larger`, `within_one_percent`."""


@dataclass(frozen=True, repr=False)
class Aim(Displayed):
    """A quantity that is to be small, or large where it is `maximized`."""

    quantity: Quantity
    maximized: bool = False

    @property
    def sign(self) -> float:
        """Of its cost, times its weight."""
        return -self.quantity.weight if self.maximized else self.quantity.weight

    def _summary(self) -> Summary:
        return Summary(self.words)

    @property
    def words(self) -> str:
        """Its treatment in words."""
        weight = f"{self.quantity.weight:g}*" if self.quantity.weight != 1 else ""
        return f"{'maximize' if self.maximized else 'minimize'} {weight}{self.quantity.name}"


class Objective:
    """Costs and limits of a scene at z, logarithms of its free numbers.

    One quantity that is positive by nature counts by its logarithm, a sum or a damping ratio by itself over `scale`.
    `cases` are factors of masses; of every cost the worst of them counts.
    """

    def __init__(
        self,
        scene: Scene,
        free: Sequence[FreeNumber],
        aims: Sequence[Aim],
        limits: Sequence[Limit],
        setting: Setting,
    ) -> None:
        self.aims, self.limits, self.free = tuple(aims), tuple(limits), tuple(free)
        quantities = [*(item.quantity for item in aims), *(item.quantity for item in limits)]
        self.quantities = Quantities(scene, free, quantities, setting)
        self.is_log = len(aims) == 1 and aims[0].quantity.is_positive
        self.scale = 1.0
        self.cases: tuple[Factors, ...] = ({},)
        self.low = np.log([item.low for item in free])
        self.high = np.log([item.high for item in free])
        self.start = np.log([item.start for item in free])
        self._places = [item.places for item in free]

    def numbers(self, z: Floats) -> Floats:
        """The levels of the free numbers (n,)."""
        return np.asarray(np.exp(z))

    def free_numbers(self, z: Floats) -> Floats:
        """The free numbers themselves (n,): of a shift the amount added."""
        return np.array([item.at(level) for item, level in zip(self.free, self.numbers(z).tolist(), strict=True)])

    def scene_at(self, z: Floats, factors: Factors | None = None) -> Scene:
        """The scene with these numbers."""
        return self.quantities.scene_at(self.numbers(z), factors)

    def pieces(self, z: Floats, factors: Factors | None = None) -> list[Pieces]:
        """Those of every quantity without derivatives, those of limits last."""
        return self.quantities.at(self.numbers(z), factors)

    def evaluate(self, z: Floats, with_gradients: bool) -> Evaluation:
        """Costs and limits, the worst of all cases."""
        values, n = self.numbers(z), len(z)
        faces_of_cases: list[list[Faces]] = []
        for k, factors in enumerate(self.cases):
            pieces = self.quantities.at(values, factors, by=self._places if with_gradients else None)
            faces_of_cases.append(
                [self._face(j, piece, values, k, n, with_gradients=with_gradients) for j, piece in enumerate(pieces)]
            )
        faces = []
        for parts in zip(*faces_of_cases, strict=True):
            empty = [part for part in parts if not len(part.values)]
            arrays = [[part.values for part in parts], [part.gradients for part in parts], [part.at for part in parts]]
            faces.append(empty[0] if empty else Faces(*map(np.concatenate, arrays)))
        return Evaluation(np.asarray(z), tuple(faces[: len(self.aims)]), tuple(faces[len(self.aims) :]))

    def _face(self, j: int, piece: Pieces, numbers: Floats, case: int, n: int, *, with_gradients: bool) -> Faces:
        values, gradients, at = piece.values, piece.gradients, piece.at
        slopes = gradients * numbers if with_gradients else np.zeros((len(values), n))
        labels = np.log(np.maximum(at, 1e-12)) + 4 * LABEL_STEP * case
        labels = labels if piece.helps is None else labels + LABEL_STEP * piece.helps
        relative_slopes = slopes / np.maximum(values, 1e-300)[:, None]
        if j >= len(self.aims):
            limit = self.limits[j - len(self.aims)]
            return Faces(np.log(np.maximum(values, 1e-300) / limit.most), relative_slopes, labels)
        aim = self.aims[j]
        sign = aim.sign
        is_convex = (sign > 0) == aim.quantity.is_largest
        if len(values) and not is_convex:
            best = int(values.argmax() if aim.quantity.is_largest else values.argmin())
            values, slopes, labels = values[[best]], slopes[[best]], labels[[best]]
            relative_slopes = relative_slopes[[best]]
        if self.is_log:
            way = float(np.sign(sign))
            return Faces(way * np.log(np.maximum(values, 1e-300)), way * relative_slopes, labels)
        return Faces(sign * values / self.scale, sign * slopes / self.scale, labels)

    def value_of(self, pieces: Sequence[Pieces]) -> float:
        """The objective itself, a quantity alone without its sign and weight; infinite if it has no value."""
        values = [extreme(aim.quantity, piece) for aim, piece in zip(self.aims, pieces, strict=False)]
        if len(self.aims) == 1:
            return values[0]
        return float(sum(aim.sign * value for aim, value in zip(self.aims, values, strict=True)))

    def value(self, z: Floats, factors: Factors | None = None) -> float:
        """The same at z."""
        return self.value_of(self.pieces(z, factors))

    @property
    def direction(self) -> float:
        """1 where a larger objective is worse, −1 where it is better."""
        return -1.0 if len(self.aims) == 1 and self.aims[0].maximized else 1.0


def extreme(quantity: Quantity, pieces: Pieces) -> float:
    """The quantity itself, infinite if it has no value."""
    if not len(pieces.values):
        return np.inf if quantity.is_largest else -np.inf
    return float(pieces.values.max() if quantity.is_largest else pieces.values.min())


@dataclass(frozen=True)
class Worth(Displayed):
    """Sensitivity to a parameter: the objective's relative change for ±1 %, and the range within 1 %.

    Within `low` and `high`, in the number's unit, the objective is at most 1 % worse; infinite or 0 if it always is.
    """

    path: str
    larger: float
    smaller: float
    low: float
    high: float


def worths(objective: Objective, z: Floats) -> tuple[Worth, ...]:
    """Return the sensitivity to every parameter."""
    best = objective.value(z)
    answers = []
    for k, entry in enumerate(objective.free):
        loss = _loss(objective, z, k, best)
        low, high = (_edge(loss, way) for way in (-1.0, 1.0))
        number = float(np.exp(z[k]))
        answers.append(
            Worth(
                entry.path,
                loss(np.log1p(PERCENT)),
                loss(np.log1p(-PERCENT)),
                entry.at(number * float(np.exp(low))) if np.isfinite(low) else -entry.base,
                entry.at(number * float(np.exp(high))) if np.isfinite(high) else np.inf,
            )
        )
    return tuple(answers)


def _loss(objective: Objective, z: Floats, k: int, best: float) -> Callable[[float], float]:
    """The fraction by which the objective is worse where a number is changed by a logarithm."""

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
    """The change at which the objective is 1 % worse, infinite if it never is."""
    inner, outer = 0.0, PERCENT
    while loss(way * outer) < PERCENT:
        inner, outer = outer, 2 * outer
        if outer > 3:  # a factor of 20
            return way * np.inf
    while not np.isfinite(loss(way * outer)):
        outer = (inner + outer) / 2
        if outer - inner < 1e-6:
            return way * outer
    if loss(way * outer) < PERCENT:
        return way * outer
    root = scipy.optimize.brentq(lambda at: loss(way * at) - PERCENT, inner, outer, xtol=1e-6, rtol=1e-6)
    return way * float(root)


@dataclass(frozen=True)
class MassCase(Displayed):
    """Masses times `factors` by their places, with the objective's `value` and its `cost` there."""

    factors: Factors
    value: float
    cost: float

    @classmethod
    def at(cls, objective: Objective, z: Floats, factors: Factors) -> MassCase:
        """Evaluate the objective at z with these factors."""
        return cls(factors, objective.value(z, factors), _cost(objective, z, factors))

    def words(self, scene: Scene) -> str:
        """Which masses of the scene are heavier and which lighter."""
        names = {place: number_words(scene, with_numbers(place)) for place in self.factors}
        heavier = [names[place] for place, factor in self.factors.items() if factor > 1]
        lighter = [names[place] for place, factor in self.factors.items() if factor < 1]
        if not heavier or not lighter:
            return "all heavier" if heavier else "all lighter"
        changed_masses, way, other_way = min(
            (heavier, "heavier", "lighter"), (lighter, "lighter", "heavier"), key=lambda pair: len(pair[0])
        )
        return f"{way}: {listed(changed_masses[:4], len(changed_masses))}; all others {other_way}"


def worst_case(objective: Objective, z: Floats) -> MassCase:
    """Return the worst case of the objective for independent masses ±5 %."""
    nominal = MassCase.at(objective, z, {})
    return max((nominal, *worst_cases(objective, z)), key=lambda case: case.cost)


def worst_cases(objective: Objective, z: Floats, crew: Crew | None = None) -> list[MassCase]:
    """Corners of the box of masses ±5 % in which a piece of the objective is worst; a `crew` shares them."""
    places = _free_masses(objective, z)
    corners: list[Factors]
    if len(places) <= 4:  # all 16 corners; of more masses the worst corner is climbed to
        signs = product((1 - MASS_SHARE, 1 + MASS_SHARE), repeat=len(places))
        corners = [dict(zip(places, corner, strict=True)) for corner in signs]
    else:
        pieces = _signs(objective, z, places, {})
        corners = list(map_by_crew(partial(_climb, objective, z, places), pieces, crew))
    different = [factors for k, factors in enumerate(corners) if factors and factors not in corners[:k]]
    return list(map_by_crew(partial(MassCase.at, objective, z), different, crew))


def _free_masses(objective: Objective, z: Floats) -> list[Place]:
    """The places of masses that may change without moving the equilibrium."""
    places = []
    for place in masses_of(objective.quantities.scene):
        try:
            objective.scene_at(z, {place: 1 + MASS_SHARE})
            objective.scene_at(z, {place: 1 - MASS_SHARE})
        except SceneError:
            continue
        places.append(place)
    return places


def _climb(objective: Objective, z: Floats, places: list[Place], signs: Floats) -> Factors:
    """From the masses as they are in the direction in which a piece grows, and from there on along the worst one."""
    factors = _corner(places, signs)
    while True:  # to ever higher costs of corners, of which there are not many
        better = _signs(objective, z, places, factors, worst=True)
        next_factors = _corner(places, better[0]) if better else factors
        if next_factors == factors or _cost(objective, z, next_factors) <= _cost(objective, z, factors):
            return factors
        factors = next_factors


def _corner(places: list[Place], signs: Floats) -> Factors:
    return {place: 1 + MASS_SHARE * float(np.sign(sign) or 1.0) for place, sign in zip(places, signs, strict=True)}


def _signs(
    objective: Objective, z: Floats, places: list[Place], factors: Factors, *, worst: bool = False
) -> list[Floats]:
    """The direction in which each piece of a cost grows, by the masses; of the worst piece alone where asked."""
    pieces = objective.quantities.at(objective.numbers(z), factors, by=[(place,) for place in places])
    signs: list[Floats] = []
    for aim, piece in zip(objective.aims, pieces, strict=False):
        if not len(piece.values):
            continue
        costs = aim.sign * piece.values
        order = np.argsort(-costs, kind="stable")
        large_pieces = [k for k in order.tolist() if costs[k] >= costs[order[0]] - 0.5 * abs(costs[order[0]])]
        signs += [np.sign(aim.sign * piece.gradients[k]) for k in (large_pieces[:1] if worst else large_pieces[:6])]
    return list({row.tobytes(): row for row in signs}.values())


def _cost(objective: Objective, z: Floats, factors: Factors) -> float:
    cases = objective.cases
    try:
        objective.cases = (factors,)
        return objective.evaluate(z, False).cost
    finally:
        objective.cases = cases


@dataclass(frozen=True)
class Load(Displayed):
    """The `stroke` of a damper in `unit` (rad or m) and its `effort` in N m or N, per unit of an input or as RMS.

    `at_hz` and `effort_at_hz` are where they are largest, 0 for an RMS.
    """

    path: str
    per: str
    stroke: float
    unit: str
    at_hz: float
    effort: float
    effort_unit: str
    effort_at_hz: float


def loads(objective: Objective, scene: Scene) -> tuple[Load, ...]:
    """The loads of the dampers of a scene that belong to links and springs with a free number."""
    aim = next((aim.quantity for aim in objective.aims if aim.quantity.kind in {"peak", "rms"}), None)
    if aim is None:
        return ()
    felt_loads = []
    for place, output, damping, unit in _dampers(objective, scene):
        rate = output.replace("rel_", "rel_dot_", 1)
        quantity = Quantity(aim.kind, output, aim.input)
        outputs = [quantity, Quantity(aim.kind, rate, aim.input)] if unit == "rad" else [quantity]
        quantities = Quantities(scene, (), outputs, objective.quantities.setting)
        pieces = quantities.at(np.zeros(0))
        if not all(len(aim.values) for aim in pieces):
            continue
        stroke, at = _largest(pieces[0].values, pieces[0])
        if unit == "rad":
            effort, effort_at = _largest(damping * pieces[1].values, pieces[1])
        else:
            effort, effort_at = _largest(damping * pieces[0].values * pieces[0].at, pieces[0])
        per = quantities.form.signals[0][1].unit if aim.kind == "peak" else ""
        felt_loads.append(
            Load(with_numbers(place), per, stroke, unit, at, effort, "N m" if unit == "rad" else "N", effort_at)
        )
    return tuple(felt_loads)


def _largest(values: Floats, pieces: Pieces) -> tuple[float, float]:
    """The largest of the values with its frequency (Hz)."""
    best = int(values.argmax())
    return float(values[best]), pieces.hertz(best)


def _dampers(objective: Objective, scene: Scene) -> list[tuple[Place, str, float, str]]:
    """Places of dampers with their relative motions, their constants and the unit of their stroke."""
    dampers: list[tuple[Place, str, float, str]] = []
    geometry = geometry_of(scene)
    first_numbers = np.concatenate(([0], np.cumsum([entry.count for entry in scene.pendulum])))
    free = [place for entry in objective.free for place in entry.places]
    for place in dict.fromkeys(place[:4] if place[0] == "pendulum" else place[:2] for place in free):
        if place[0] == "pendulum" and len(place) == 4:
            p, i = int(place[1]), int(place[3])
            link = scene.pendulum[p].links[i]
            number = sum(entry.count for entry in scene.pendulum[p].links[:i]) + 1
            if link.damping:
                dampers.append(((*place, "damping"), f"rel_{first_numbers[p] + 1}_{number}", link.damping, "rad"))
        if place[0] == "spring":
            spring = scene.spring[int(place[1])]
            label = str(int(place[1]) + 1)
            labels = [row.label for row in geometry.springs]
            if spring.damping and label in labels and spring.kind == "linear":
                dampers.append(((*place, "damping"), f"spring_extension_{label}", spring.damping, "m"))
    return dampers
