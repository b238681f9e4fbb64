"""Drawing of a structure to scale: supports at their coordinates η, springs between their points, the ground.

A `Scaffold` is made once for a scene; `Scaffold.pieces(eta, joints)` are lines and outlines (F, K, 2) in m, to the
right and up, for F instants or F extremes of a mode. Carts at one place that springs join into a line from the ground
are the storeys of a tower. Other bodies that would overlap are drawn apart along the rail: overlapping supports, and
pendula that hang from one point; long gaps between supports are shortened. All is plain arithmetic of η and the joints,
which may be recorded symbols.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal, NamedTuple

import numpy as np

from modal.scene.points import CarrierEnd, End, GroundEnd, LinkEnd, Where
from modal.structure.carriers import CarrierNumbers
from modal.structure.structure import SpringNumbers, Structure
from modal.types import Floats, Ints

Role = Literal["body", "line", "spring", "dot", "ground", "hatch", "guide"]
STILL: frozenset[Role] = frozenset({"ground", "hatch", "guide"})
"""The roles of parts that do not move with η."""
HALF_HEIGHT = 0.05
"""Format: of a body, and radius of wheels, over the unit of a picture, as all lengths here."""
BODY_MARGIN = 0.13
"""Format: extent of a body beyond its points; those farther above or below it have a stem."""
WALL_GAP = 0.55
"""Format: space between bodies that are set apart, and to the wall that a spring is fixed to."""
SPRING_TEETH = 7
"""Format: of the zigzag of a spring."""
SPRING_LEAD = 0.18
"""Format: straight share of a spring at each of its ends."""
SPIRAL_TURNS = 2.25
"""Format: of a torsion spring."""
GAPS_OF_CARRIERS = (6.0, 2.5)
"""Format: gap between supports, over the unit, above which it is shortened, and the length it is given."""
STOREY = (0.75, 1.3, 0.7)
"""Format: half the width of a storey, and its height with a pendulum in it and without one, over the unit."""


class Piece(NamedTuple):
    """A line, or a closed outline, (F, K, 2) in m; its `role` says how it is drawn."""

    role: Role
    points: Floats
    is_outline: bool = False


@dataclass(frozen=True, eq=False)
class Scaffold:
    """A structure of which the `pendula` are shown, and the first link of every pendulum, `first` (P + 1,).

    `unit` (m), that of the longest chain, is the size of parts without one; `gap`, in that unit, is the space between
    bodies drawn apart. `hanging` are the joints (n + 1, 2) of drawn pendula at rest, if springs join them to the
    ground. Without `has_rails` the axis of the figure replaces the rails of carts.
    """

    structure: Structure
    pendula: Ints
    first: Ints
    unit: float
    gap: float = WALL_GAP
    hanging: Mapping[int, Floats] | None = None
    has_rails: bool = True

    # ------------------------------------------------------------------------------------------- where things are

    @cached_property
    def aside(self) -> Floats:
        """Offset (m) of every drawn pendulum from the others at its point; those of a modal support are one."""
        shift = np.zeros(len(self.pendula))
        places: dict[Any, list[int]] = {}
        for k, pendulum in enumerate(self.pendula.tolist()):
            pivot = self.structure.pivots[pendulum]
            places.setdefault(pivot.carrier if isinstance(pivot.where, int) else pivot, []).append(k)
        for members in places.values():
            step = self.unit * (0.95 if len(members) <= 4 else min(0.5, 5 / len(members)))
            shift[members] = step * (np.arange(len(members)) - (len(members) - 1) / 2)
        return shift

    @cached_property
    def _points(self) -> tuple[Floats, ...]:
        """Every support's points of which something is drawn, (K, 2) in m along and below its origin."""
        points: list[list[tuple[float, float]]] = [[] for _ in self.structure.carriers]
        for pendulum, aside in zip(self.pendula.tolist(), self.aside.tolist(), strict=True):
            carrier, where = self.structure.pivots[pendulum]
            s, h = (0.0, 0.0) if isinstance(where, int) else where
            points[carrier].append((float(s) + aside, float(h)))
        for spring in self.structure.springs:
            for end in spring.ends:
                if isinstance(end, CarrierEnd) and not isinstance(end.where, int) and not spring.torsion:
                    points[end.carrier].append((float(end.where[0]), float(end.where[1])))
        return tuple(np.array(part).reshape(-1, 2) for part in points)

    @cached_property
    def bodies(self) -> tuple[tuple[float, float, float], ...]:
        """Left, right and height (m, along and below its origin) of every support's body."""
        bodies = []
        for body, points in zip(self.structure.carriers, self._points, strict=True):
            close_points = points if body.turning is None else points[np.abs(points[:, 1]) < 10 * self.unit]
            level = 0.0
            if body.kind == "tilt" and len(close_points) and np.ptp(close_points[:, 1]) < BODY_MARGIN * self.unit:
                level = float(close_points[:, 1].mean())
            if body.kind == "platform":
                close_points = close_points[np.abs(close_points[:, 1]) < 0.5 * self.unit]
            half_width = 4 * HALF_HEIGHT * self.unit * (2.5 if body.kind == "platform" else 1.0)
            margin, abscissas = BODY_MARGIN * self.unit, close_points[:, 0]
            extents = np.concatenate([abscissas - margin, abscissas + margin, [-half_width, half_width]])
            bodies.append((float(extents.min()), float(extents.max()), level))
        if self.storeys:
            half = max(STOREY[0] * self.unit, *(max(-bodies[k][0], bodies[k][1]) for k in self.storeys))
            for k in self.storeys:
                bodies[k] = (-half, half, 0.0)
        return tuple(bodies)

    @cached_property
    def storeys(self) -> tuple[int, ...]:
        """Supports that are the storeys of a tower, from below; none unless all moving supports are."""
        moving = [k for k, body in enumerate(self.structure.carriers) if body.size]
        bodies = [self.structure.carriers[k] for k in moving]
        if len(moving) < 2 or len({body.position for body in bodies}) > 1 or {body.kind for body in bodies} != {"cart"}:
            return ()
        joined = [{-1, k} for k in moving if self.structure.carriers[k].stiffness[0]]
        for spring in self.structure.springs:
            if spring.stiffness and all(isinstance(end, CarrierEnd | GroundEnd) for end in spring.ends):
                joined.append({end.carrier if isinstance(end, CarrierEnd) else -1 for end in spring.ends})
        order = [-1]
        while upper := {k for pair in joined if order[-1] in pair for k in pair if k not in order}:
            if len(upper) > 1:
                return ()
            order += upper
        return tuple(order[1:]) if len(order) > len(moving) else ()

    @cached_property
    def shifts(self) -> Floats:
        """Offset (m) of every support in the drawing, along the rail and up, (C, 2)."""
        carriers, high = self.structure.carriers, 3 * HALF_HEIGHT * self.unit
        shifts = np.zeros((len(carriers), 2))
        if self.storeys:
            occupied = {self.structure.pivots[pendulum].carrier for pendulum in self.pendula.tolist()}
            heights = [self.unit * STOREY[1 if k in occupied else 2] for k in self.storeys]
            shifts[list(self.storeys), 1] = np.cumsum(heights)
            return shifts
        boxes = []
        for body, (left_end, right_end, level) in zip(carriers, self.bodies, strict=True):
            x, z = (float(part) for part in body.position)
            boxes.append((x + left_end, x + right_end, z + level))
        moving = [k for k, body in enumerate(carriers) if body.size]
        upon = any(
            boxes[i][0] < boxes[j][1] and boxes[j][0] < boxes[i][1] and abs(boxes[i][2] - boxes[j][2]) < high
            for n, i in enumerate(moving)
            for j in moving[:n]
        )
        end = -np.inf
        for k in moving if upon else ():
            shifts[k, 0] = max(0.0, end - boxes[k][0]) if np.isfinite(end) else 0.0
            end = boxes[k][1] + shifts[k, 0] + self.gap * self.unit
        if not (upon or any(body.points is not None for body in carriers)):
            shifts[:, 0] = self._nearer(boxes)
        return shifts

    def _nearer(self, boxes: Sequence[tuple[float, float, float]]) -> Floats:
        """How far every support moves along the rail where long gaps between their boxes are shortened, (C,)."""
        longest, instead = (share * self.unit for share in GAPS_OF_CARRIERS)
        shifts, moved = np.zeros(len(boxes)), 0.0
        order = sorted(range(len(boxes)), key=lambda k: boxes[k][0])
        for n, k in enumerate(order[1:], 1):
            gap = boxes[k][0] - max(boxes[earlier][1] for earlier in order[:n])
            moved -= gap - instead if gap > longest else 0.0
            shifts[k] = moved
        middle: float = shifts.min() / 2
        return np.asarray(shifts - middle)

    @cached_property
    def notes(self) -> list[str]:
        """Sentences on parts that are not drawn in their places."""
        overlaps = (self.shifts[:, 0] > 0).any() > self.is_nearer or self.aside.any()
        words = ["what would overlap is drawn apart"] * bool(overlaps)
        words += ["heights of storeys not to scale"] * bool(self.storeys)
        return [*words, *["long gaps between supports shortened"] * self.is_nearer]

    @property
    def is_nearer(self) -> bool:
        """Whether long gaps between supports are shortened."""
        return bool((self.shifts[:, 0] < 0).any())

    def place(self, carrier: int, where: Where, eta: Floats, aside: float = 0.0) -> Floats:
        """Return where a point of a support is drawn at η (F, d), (F, 2) to the right and up."""
        body = self.structure.carriers[carrier]
        first = self.structure.offsets[carrier]
        values = [eta[:, first + k] for k in range(body.size)]
        shift, rise = self.shifts[carrier].tolist()
        if isinstance(where, int):
            shift, at = shift + aside, where
        else:
            at = (float(where[0]) + aside, float(where[1]))  # type: ignore[assignment]
        x, z = body.moving(at, values, [0.0] * body.size).place
        return np.stack(np.broadcast_arrays(x + shift + 0 * eta.sum(1), rise - z + 0 * eta.sum(1)), axis=-1)

    def pivots(self, eta: Floats) -> Floats:
        """Return where the drawn pendula hang at η (F, d), (F, D, 2)."""
        pairs = zip(self.pendula.tolist(), self.aside.tolist(), strict=True)
        pivots = self.structure.pivots
        places = [self.place(pivots[p].carrier, pivots[p].where, eta, aside) for p, aside in pairs]
        return np.stack(places, axis=1)

    def reach(self, supports: Any) -> float:
        """Return the displacement of the structure's points in a small motion with these η (d,), over its size."""
        if not len(supports):
            return 0.0
        small = 1e-4 * self.unit / max(float(np.abs(supports).max()), 1e-300)
        eta = np.array([small * np.real(supports), 0.0 * np.real(supports)])
        ends = [piece.points for piece in self.pieces(eta, {}) if piece.role in {"body", "line", "dot"}]
        distances = [np.linalg.norm(points[0] - points[1], axis=-1).max() for points in (*ends, self.pivots(eta))]
        return float(max(distances)) / small

    @cached_property
    def names(self) -> list[tuple[str, float, float]]:
        """The moving supports, if there are several, and the places of their names: next to storeys, else above."""
        moving = [k for k, body in enumerate(self.structure.carriers) if body.size and body.points is None]
        at_rest, names = np.zeros((1, self.structure.size)), []
        for k in moving if len(moving) > 1 else ():
            body, (left_end, right_end, level) = self.structure.carriers[k], self.bodies[k]
            height = float(body.values["length"]) if body.kind == "swing" else 0.0
            place = (right_end + 0.5 * self.unit, level)
            if not self.storeys:
                place = ((left_end + right_end) / 2, level - height - 0.2 * self.unit)
            x, y = self.place(k, place, at_rest)[0].tolist()
            names.append((body.name, x, y))
        return names

    # --------------------------------------------------------------------------------------------------- pieces

    def pieces(self, eta: Floats, joints: Mapping[int, Floats]) -> list[Piece]:
        """Return the whole drawing at η (F, d), with the `joints` (F, n + 1, 2) of the drawn pendula."""
        pieces = [piece for k in range(len(self.structure.carriers)) for piece in self.of_carrier(k, eta)]
        for spring in self.structure.springs:
            pieces += self._spring(spring, eta, joints)
        return pieces

    def _at(self, k: int, points: Sequence[tuple[float, float]], eta: Floats) -> Floats:
        """Points of a support, (F, K, 2)."""
        return np.stack([self.place(k, point, eta) for point in points], axis=1)

    def _ground_points(self, k: int, points: Sequence[tuple[float, float]]) -> Floats:
        """Points of the ground next to a support as drawn, (1, K, 2)."""
        x, z = self.structure.carriers[k].position
        shift, rise = self.shifts[k].tolist()
        return np.array([[(float(x) + shift + s, rise - (float(z) + h)) for s, h in points]])

    def of_carrier(self, k: int, eta: Floats) -> Iterator[Piece]:
        """Return the pieces of one support, with its own springs and foundation."""
        body, u = self.structure.carriers[k], self.unit
        left_end, right_end, level = self.bodies[k]
        if not body.size:
            yield from self._ceiling(k)
            return
        if body.points is not None:
            yield from self._frame(k, eta)
            return
        half = HALF_HEIGHT * u
        if body.kind == "platform":
            low_end, high_end, taper = -half, 2.2 * half, 0.82
        else:
            high = half if body.kind != "tilt" else 0.6 * half
            low_end, high_end, taper = level - high, level + high, 1.0
        upper_edge = [(left_end, low_end), (right_end, low_end)]
        hull = [*upper_edge, (taper * right_end, high_end), (taper * left_end, high_end)]
        yield Piece("body", self._at(k, hull, eta), is_outline=True)
        for s, h in self._points[k].tolist():
            if abs(h - level) > BODY_MARGIN * u:
                foot = (0.3 * s if body.kind == "platform" else s, level)
                yield Piece("line", self._at(k, [foot, (s, h)], eta))
        if (drawing := getattr(self, f"_{body.kind}", None)) is not None:
            yield from drawing(k, body, eta)

    def _ceiling(self, k: int) -> Iterator[Piece]:
        """The fixed parts, hatched from above."""
        points, u = self._points[k], self.unit
        for h in np.unique(points[:, 1]):
            abscissas = points[points[:, 1] == h, 0]
            ends = [(abscissas.min() - 0.16 * u, h), (abscissas.max() + 0.16 * u, h)]
            yield from _hatch(self._ground_points(k, ends), u)

    def _frame(self, k: int, eta: Floats) -> Iterator[Piece]:
        """The points of a modal support where something is fixed to them, as dots."""
        pivots, margin = self.structure.pivots, np.array([2 * HALF_HEIGHT * self.unit, 0.0])
        drawn = list(zip(self.pendula.tolist(), self.aside.tolist(), strict=True))
        ends_of_springs = [end for spring in self.structure.springs for end in spring.ends]
        fixed = [*pivots, *(end for end in ends_of_springs if isinstance(end, CarrierEnd))]
        for where in sorted({end.where for end in fixed if end.carrier == k}, key=str):
            asides = [aside for p, aside in drawn if pivots[p] == (k, where)] or [0.0]
            ends = [self.place(k, where, eta, aside) for aside in (min(asides), max(asides))]
            yield Piece("line", np.stack([ends[0] - margin, ends[1] + margin], axis=1))
            yield Piece("dot", np.stack([(ends[0] + ends[1]) / 2], axis=1))

    def _cart(self, k: int, body: CarrierNumbers, eta: Floats) -> Iterator[Piece]:
        if k in self.storeys:
            yield from self._storey(k, eta)
            return
        left_end, right_end, _ = self.bodies[k]
        u, low = self.unit, 2 * HALF_HEIGHT * self.unit
        for s in (0.75 * left_end + 0.25 * right_end, 0.25 * left_end + 0.75 * right_end):
            middle = self.place(k, (s, low), eta)[:, None]
            turn = np.linspace(0, 2 * np.pi, 25)
            yield Piece(
                "body", middle + HALF_HEIGHT * u * np.stack((np.cos(turn), np.sin(turn)), axis=-1), is_outline=True
            )
        rail = low + HALF_HEIGHT * u
        if self.has_rails:
            yield Piece("ground", self._ground_points(k, [(left_end - 0.3 * u, rail), (right_end + 0.3 * u, rail)]))
        yield from self._to_wall(k, body.stiffness[0], body.damping[0], eta)

    def _storey(self, k: int, eta: Floats) -> Iterator[Piece]:
        """The columns from the storey below, or the ground, which stay upright at both ends."""
        number, half = self.storeys.index(k), HALF_HEIGHT * self.unit
        left_end, right_end, _ = self.bodies[k]
        share = np.linspace(0.0, 1.0, 13)[:, None]
        for s in (left_end + 0.1 * self.unit, right_end - 0.1 * self.unit):
            top = self.place(k, (s, half), eta)
            foot = self._ground_points(k, [(s, self.shifts[k, 1])])[:, 0]
            if number:
                foot = self.place(self.storeys[number - 1], (s, -half), eta)
            bend = np.concatenate([share**2 * (3 - 2 * share), share], axis=1)
            yield Piece("line", foot[:, None] + bend * (top - foot)[:, None])
        if not number:
            level = float(self.shifts[k, 1])
            yield from _hatch(self._ground_points(k, [(left_end, level), (right_end, level)]), self.unit, 1.0)

    def _swing(self, k: int, body: CarrierNumbers, eta: Floats) -> Iterator[Piece]:
        left_end, right_end, _ = self.bodies[k]
        length, u = float(body.values["length"]), self.unit
        for s in (left_end + 0.06 * u, right_end - 0.06 * u):
            top = np.broadcast_to(self._ground_points(k, [(s, -length)]), (len(eta), 1, 2))
            yield Piece("line", np.concatenate([top, self._at(k, [(s, 0.0)], eta)], axis=1))
        yield from _hatch(self._ground_points(k, [(left_end - 0.06 * u, -length), (right_end + 0.06 * u, -length)]), u)
        yield from self._to_wall(k, body.stiffness[0], 0.0, eta)

    def _tilt(self, k: int, body: CarrierNumbers, eta: Floats) -> Iterator[Piece]:
        left_end, right_end, level = self.bodies[k]
        u, way = self.unit, 1.0 if level < 0 or (level == 0 and not len(self._points[k])) else -1.0
        foot = min(max(0.0, left_end), right_end)
        if abs(level) > HALF_HEIGHT * u:
            yield Piece("line", self._at(k, [(0.0, 0.0), (foot, level)], eta))
        apex, base = (0.0, 0.0), way * 0.17 * u
        yield Piece("ground", self._ground_points(k, [apex, (-0.09 * u, base), (0.09 * u, base)]), is_outline=True)
        yield from _hatch(self._ground_points(k, [(-0.16 * u, base), (0.16 * u, base)]), u, way)
        if body.stiffness[0]:
            angle = eta[:, self.structure.offsets[k]]
            yield Piece("spring", _spiral(self.place(k, (0.0, 0.0), eta), angle, u))
        yield Piece("dot", self._at(k, [(float(body.centre[0]), float(body.centre[1]))], eta))

    def _heave(self, k: int, body: CarrierNumbers, eta: Floats) -> Iterator[Piece]:
        left_end, right_end, _ = self.bodies[k]
        u = self.unit
        for s in (left_end - 0.03 * u, right_end + 0.03 * u):
            yield Piece("guide", self._ground_points(k, [(s, -0.3 * u), (s, 0.3 * u)]))
        yield from self._to_floor(k, body.stiffness[0], eta, (left_end + right_end) / 2)

    def _platform(self, k: int, body: CarrierNumbers, eta: Floats) -> Iterator[Piece]:
        left_end, right_end, _ = self.bodies[k]
        sway, heave, roll = body.stiffness
        yield from self._to_wall(k, sway, 0.0, eta)
        at = (0.6 * left_end, 0.6 * right_end) if roll else ((left_end + right_end) / 2,)
        for s in at:
            yield from self._to_floor(k, heave or roll, eta, s)
        yield Piece("dot", self._at(k, [(float(body.centre[0]), float(body.centre[1]))], eta))

    def _to_wall(self, k: int, stiffness: Any, damping: Any, eta: Floats, level: float = 0.0) -> Iterator[Piece]:
        """A spring along the rail to a wall on the side where there is room."""
        if not (stiffness or damping):
            return
        side = self._side(k)
        end = self.bodies[k][1 if side > 0 else 0]
        wall = end + side * WALL_GAP * self.unit
        yield from self._wall(k, wall, level, side)
        body_end = self.place(k, (end, level), eta)
        wall_end = self._ground_points(k, [(wall, level)])[:, 0]
        yield Piece("spring", _zigzag(wall_end, body_end, self.unit, is_damper=not stiffness))

    def _side(self, k: int) -> float:
        """On which side of a support there is room for a wall: −1 left, 1 right."""
        middles = [
            float(body.position[0]) + float(self.shifts[i, 0]) + sum(self.bodies[i][:2]) / 2
            for i, body in enumerate(self.structure.carriers)
        ]
        return 1.0 if len(middles) > 1 and middles[k] == max(middles) and middles[k] > min(middles) else -1.0

    def _wall(self, k: int, at: float, level: float, side: float) -> Iterator[Piece]:
        u = self.unit
        yield Piece("ground", self._ground_points(k, [(at, level - 0.11 * u), (at, level + 0.11 * u)]))
        for h in np.linspace(-0.11, 0.08, 5) * u:
            yield Piece(
                "hatch", self._ground_points(k, [(at, level + h + 0.04 * u), (at + side * 0.05 * u, level + h)])
            )

    def _to_floor(self, k: int, stiffness: Any, eta: Floats, s: float) -> Iterator[Piece]:
        """A spring from below."""
        if not stiffness:
            return
        u, low = self.unit, HALF_HEIGHT * self.unit * (2.2 if self.structure.carriers[k].kind == "platform" else 1.0)
        floor = low + 0.42 * u
        yield from _hatch(self._ground_points(k, [(s - 0.12 * u, floor), (s + 0.12 * u, floor)]), u, 1.0)
        body_end = self.place(k, (s, low), eta)
        floor_end = self._ground_points(k, [(s, floor)])[:, 0]
        yield Piece("spring", _zigzag(floor_end, body_end, u))

    # --------------------------------------------------------------------------------------------------- springs

    def _spring(self, spring: SpringNumbers, eta: Floats, joints: Mapping[int, Floats]) -> Iterator[Piece]:
        """A spring between points, or a spiral for one between angles; nothing of pendula that are not drawn."""
        is_damper = not spring.stiffness
        if self.storeys and not (is_damper or any(isinstance(end, LinkEnd) for end in spring.ends)):
            return  # columns
        ends = [self._end(end, eta, joints, torsion=spring.torsion) for end in spring.ends]
        if spring.torsion:
            for end, place in zip(spring.ends, ends, strict=True):
                if isinstance(end, LinkEnd) and place is not None:
                    yield Piece("spring", _spiral(place, np.zeros(len(eta)), self.unit))
            places = [place for place in ends if place is not None]
            if len(places) == 2:
                yield Piece("guide", np.stack(places, axis=1))
            return
        ground_end = next((k for k, end in enumerate(spring.ends) if isinstance(end, GroundEnd)), None)
        if ground_end is not None and ends[1 - ground_end] is not None:
            yield from self._ground_spring(
                spring.ends[1 - ground_end], spring.ends[ground_end], eta, joints, is_damper=is_damper
            )
            return
        first, second = ends
        if first is not None and second is not None:
            edges = self._edges(spring.ends, first, second)
            if self._is_shortened(spring.ends):
                yield from _broken(*edges, self.unit, is_damper=is_damper)
            else:
                yield Piece("spring", _zigzag(*edges, self.unit, is_damper=is_damper))

    def _is_shortened(self, ends: tuple[End, End]) -> bool:
        """Whether a spring is between supports whose gap is drawn shorter."""
        carriers = [end.carrier for end in ends if isinstance(end, CarrierEnd)]
        return len(carriers) == 2 and self.is_nearer and self.shifts[carriers[0], 0] != self.shifts[carriers[1], 0]

    def _edges(self, ends: tuple[End, End], first: Floats, second: Floats) -> tuple[Floats, Floats]:
        """The ends of a spring between origins of neighbouring supports, at the edges of their bodies."""
        edges, abscissas = [first, second], [self._rest_place(end) for end in ends]
        for k, end in enumerate(ends):
            if isinstance(end, CarrierEnd) and end.where == (0.0, 0.0):
                left_end, right_end, level = self.bodies[end.carrier]
                distance = abscissas[1 - k] - abscissas[k]
                if abs(distance) > right_end - left_end and not level:
                    edges[k] = edges[k] + np.array([right_end if distance > 0 else left_end, 0.0])
                    abscissas[k] += right_end if distance > 0 else left_end
        return edges[0], edges[1]

    def _rest_place(self, end: End) -> float:
        """Where (m, along the rail) an end of a spring that moves is at rest, where links hang straight down."""
        zeros = np.zeros((1, self.structure.size))
        if isinstance(end, LinkEnd):
            pendulum = int(np.searchsorted(self.first, end.link, side="right")) - 1
            return float(self.pivots(zeros)[0, self.pendula.tolist().index(pendulum), 0])
        assert isinstance(end, CarrierEnd)
        return float(self.place(end.carrier, end.where, zeros)[0, 0])

    def _ground_spring(
        self, end: End, ground: End, eta: Floats, joints: Mapping[int, Floats], *, is_damper: bool
    ) -> Iterator[Piece]:
        """A spring from a point to the ground: to its place, or to a wall next to the point as drawn."""
        assert isinstance(ground, GroundEnd)
        moving_end = self._end(end, eta, joints, torsion=False)
        assert moving_end is not None
        carrier = end.carrier if isinstance(end, CarrierEnd) else None
        if ground.place is not None:
            fixed_end = np.array([float(ground.place[0]), -float(ground.place[1])])
            fixed_end = fixed_end + (self.shifts[carrier] if carrier is not None else 0.0)
            yield from _hatch(fixed_end + np.array([[[-0.08, 0.0], [0.08, 0.0]]]) * self.unit, self.unit, 1.0)
            yield Piece("spring", _zigzag(fixed_end[None], moving_end, self.unit, is_damper=is_damper))
        elif carrier is not None and not isinstance(end.where, int):  # type: ignore[union-attr]
            level = self.bodies[carrier][2] if end.where == (0.0, 0.0) else float(end.where[1])  # type: ignore[union-attr]
            yield from self._to_wall(carrier, not is_damper, is_damper, eta, level)
        else:
            rest_joints = {pendulum: place[None] for pendulum, place in (self.hanging or {}).items()}
            rest_end = self._end(end, np.zeros((1, self.structure.size)), rest_joints, torsion=False)
            wall = (moving_end if rest_end is None else rest_end)[0] + np.array([-WALL_GAP * self.unit, 0.0])
            yield Piece("ground", wall + np.array([[[0.0, -0.11], [0.0, 0.11]]]) * self.unit)
            yield Piece("spring", _zigzag(wall[None], moving_end, self.unit, is_damper=is_damper))

    def _end(self, end: End, eta: Floats, joints: Mapping[int, Floats], *, torsion: bool) -> Floats | None:
        """Where an end is drawn, (F, 2); None of the ground, and of pendula that are not drawn."""
        if isinstance(end, GroundEnd):
            return None
        if isinstance(end, CarrierEnd):
            return self.place(end.carrier, end.where, eta)
        pendulum = int(np.searchsorted(self.first, end.link, side="right")) - 1
        if pendulum not in joints:
            return None
        chain, i = joints[pendulum], end.link - int(self.first[pendulum])
        if torsion:
            return chain[:, i]
        link_line = chain[:, i + 1] - chain[:, i]
        if end.below is None:
            return chain[:, i + 1]
        return np.asarray(chain[:, i] + _direction(link_line) * float(end.below))


def _hatch(line: Floats, unit: float, way: float = -1.0) -> Iterator[Piece]:
    """A line of the ground (1, 2, 2) with hatching above (−1) or below it."""
    yield Piece("ground", line)
    (left_end, level), (right_end, _) = line[0]
    lean = max(0.05 * unit, 0.03 * float(right_end - left_end))
    count = max(3, round((right_end - left_end) / (1.6 * lean)))
    for x in np.linspace(left_end, right_end, count + 1)[:-1]:
        yield Piece("hatch", np.array([[(x, level), (x + lean, level - way * lean)]]))


def _direction(line: Floats) -> Floats:
    """Unit vectors (F, 2), along the rail where there is no length."""
    size: Floats = np.sqrt((line * line).sum(axis=-1, keepdims=True))
    if line.dtype.hasobject:
        return np.asarray(line / size)
    unit: Floats = np.divide(line, size, out=np.broadcast_to([1.0, 0.0], line.shape).copy(), where=size > 0)
    return unit


def _zigzag(start: Floats, end: Floats, unit: float, *, is_damper: bool = False) -> Floats:
    """A spring from `start` to `end` (F, 2), either of which may be one place; of a damper alone a box, (F, K, 2)."""
    line = end - start
    way = _direction(line)
    normal = np.stack((-way[:, 1], way[:, 0]), axis=-1)
    if is_damper:
        shares = np.array([0.0, 0.4, 0.4, 0.6, 0.6, 0.4, 0.4, 0.6, 0.6, 1.0])
        aside = np.array([0.0, 0.0, 1.0, 1.0, -1.0, -1.0, 0.0, 0.0, 0.0, 0.0])
    else:
        teeth = np.arange(SPRING_TEETH)
        inner = SPRING_LEAD + (1 - 2 * SPRING_LEAD) * (teeth + 0.5) / SPRING_TEETH
        shares = np.concatenate([[0.0, SPRING_LEAD], inner, [1 - SPRING_LEAD, 1.0]])
        aside = np.concatenate([[0.0, 0.0], np.where(teeth % 2, -1.0, 1.0), [0.0, 0.0]])
    points: Floats = (
        start[:, None] + shares[:, None] * line[:, None] + 2 / 3 * HALF_HEIGHT * unit * aside[:, None] * normal[:, None]
    )
    return points


def _broken(start: Floats, end: Floats, unit: float, *, is_damper: bool = False) -> Iterator[Piece]:
    """A spring in two halves, with the sign of a break between them."""
    middle, way = (start + end) / 2, 0.06 * unit * _direction(end - start)
    slant = 0.1 * unit * np.array([0.4, 1.0])
    for place, other in ((start, middle - way), (end, middle + way)):
        yield Piece("spring", _zigzag(place, other, unit, is_damper=is_damper))
        yield Piece("spring", np.stack([other - slant, other + slant], axis=1))


def _spiral(middle: Floats, angle: Floats, unit: float) -> Floats:
    """A spiral about points (F, 2), turned by an angle (F,)."""
    turn = np.linspace(0, 2 * np.pi * SPIRAL_TURNS, 50)
    radius = 2 * HALF_HEIGHT * unit * (0.15 + 0.85 * turn / turn[-1])
    angles = turn[:-1] - np.pi / 2 + np.outer(angle, 1 - turn[:-1] / turn[-1])
    inner = radius[:-1, None] * np.stack((np.cos(angles), np.sin(angles)), axis=-1)
    anchor = radius[-1] * np.array([np.sin(turn[-1]), -np.cos(turn[-1])])
    ends = np.broadcast_to(anchor, (len(inner), 1, 2))
    return np.asarray(middle[:, None] + np.concatenate([inner, ends], axis=1))
