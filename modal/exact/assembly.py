"""M and K of a scene in balls (python-flint), from the small displacements of all masses about its equilibrium.

    M = Σ m (h hᵀ + v vᵀ) + Σ I a aᵀ,      K = Σ k e eᵀ

The rows h and v of a centre of mass are its displacements along the rail and down, a is an angle, e the turn of a
joint, the extension of a spring, or an angle or a coordinate restored by weights. The coordinate of a vertical link is
the displacement of its lower end along the rail, so that M and K of a chain couple neighbours only; that of a link
tilted by constant forces is its angle. The floats of the scene are taken exactly as they are stored.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from importlib import import_module
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from modal import pair
from modal.assembly.equilibrium import equilibrium_of, load_of
from modal.errors import ComputationError, MissingExtraError
from modal.scene import Pendulum, Scene
from modal.scene.points import CarrierEnd, End, GroundEnd
from modal.structure import CarrierNumbers, Structure, drawn_together, structure_of, tied
from modal.types import NEWTON_ROUNDS

Ball = Any
Row = dict[int, Ball]
"""The entries of a row by the numbers of their coordinates."""


def is_zero(ball: Ball) -> bool:
    """Whether a ball is exactly 0: `!=` is also false if it only contains 0."""
    return bool(ball == 0)


def flint() -> Any:
    """Return the python-flint module; raise MissingExtraError if it is not installed."""
    try:
        return import_module("flint")
    except ImportError:
        raise MissingExtraError("python-flint", "certified") from None


def combine(*terms: tuple[Ball, Row]) -> Row:
    """Return the sum of rows, each times a factor."""
    row: Row = {}
    for factor, other in terms:
        for at, value in other.items():
            row[at] = row.get(at, 0) + factor * value
    return row


@dataclass(frozen=True, eq=False)
class BlockInBalls:
    """M and K of coupled coordinates, their lower halves row by row; `multiplicity` equal blocks."""

    label: str
    multiplicity: int
    M: list[Row] = field(default_factory=list)
    K: list[Row] = field(default_factory=list)

    def coordinate(self) -> int:
        """Add a coordinate and return its number."""
        self.M.append({})
        self.K.append({})
        return len(self.M) - 1

    def add(self, S: list[Row], size: Ball, *rows: Row) -> None:
        """Add a size times the squares of rows to M or K."""
        for row in () if is_zero(size) else rows:
            for i, a in row.items():
                for j in (j for j in row if j <= i):
                    S[i][j] = S[i].get(j, 0) + size * a * row[j]

    def pivots(self, x: Ball) -> list[Ball]:
        """Return the pivots of K − x M at a ball or a series x, eliminated from the free ends to the supports."""
        A = [{j: K.get(j, 0) - x * M.get(j, 0) for j in {**K, **M}} for K, M in zip(self.K, self.M, strict=True)]
        pivots = []
        for k in reversed(range(len(A))):
            pivot = A[k].pop(k)
            pivots.append(pivot)
            for i, value in A[k].items():
                factor = value / pivot
                for j in (j for j in A[k] if j <= i):
                    A[i][j] = A[i].get(j, 0) - factor * A[k][j]
        return pivots


class PointInBalls(NamedTuple):
    """A point: its displacements along and down, the rotation of its body, and its position as drawn (m)."""

    along: Row
    down: Row
    turn: Row
    place: tuple[Ball, Ball]


class LinkInBalls(NamedTuple):
    """The numbers of a link, sine and cosine of its angle, and the stiffness (N m/rad) due to weights."""

    mass: Ball
    length: Ball
    centre: Ball
    inertia: Ball
    rotor: Ball
    spring: Ball
    sine: Ball
    cosine: Ball
    hold: Ball


def links_of(pendulum: Pendulum, gravity: Ball) -> list[LinkInBalls]:
    """Return the links of a vertical pendulum."""
    arb, numbers = flint().arb, []
    for link in (each for each in pendulum.links for _ in range(each.count)):
        m, l = arb(link.mass), arb(link.length)
        rotor, spring = arb(link.rotor_inertia) * arb(link.gear_ratio) ** 2, arb(link.linear_coefficients[0])
        numbers.append((m, l, *link.proportions(m, l, arb), rotor, spring))
    b = pair.first_moments(*list(zip(*numbers, strict=True))[:3])
    signs = [arb(1 if way == "down" else -1) for way in pendulum.ways]
    return [
        LinkInBalls(*link, arb(0), sign, sign * gravity * moment)
        for link, sign, moment in zip(numbers, signs, b, strict=True)
    ]


def leaning_links(scene: Scene) -> list[list[LinkInBalls]]:
    """Return the links of every pendulum, counting copies, at the enclosed equilibrium under constant forces."""
    arb, equilibrium = flint().arb, equilibrium_of(scene)
    assert equilibrium is not None
    load, angles = load_of(scene, np.frompyfunc(arb, 1, 1)), equilibrium.rest.angle
    chains, first = list[list[LinkInBalls]](), 0
    for pendulum in (each for each in scene.pendulum for _ in range(each.count)):
        at = slice(first, first + pendulum.n_links)
        first = at.stop
        links = links_of(pendulum, arb(scene.gravity))
        sinking = [link.cosine * link.hold + down for link, down in zip(links, load.down[at], strict=True)]
        pulls = load.horizontal[at], sinking, load.torque[at]
        theta = enclosed_angles(links, *pulls, angles[at].tolist())
        holds = zip(load.horizontal[at], sinking, theta, strict=True)
        chains.append(
            [
                link._replace(sine=t.sin(), cosine=t.cos(), hold=z * t.cos() + x * t.sin())
                for link, t, (x, z, _) in zip(links, theta, holds, strict=True)
            ]
        )
    return chains


def enclosed_angles(links: list[LinkInBalls], x: Any, z: Any, torque: Any, start: list[float]) -> list[Ball]:
    """Return balls that contain the unique equilibrium near a start of a chain pulled along by x and down by z.

    Newton's method in balls [Neumaier1990]: if X contains m − J(X)⁻¹ f(m), X has exactly one root of f, and it is
    there.
    """
    arb, arb_mat, n = flint().arb, flint().arb_mat, len(links)
    relaxed = [arb(0) if link.cosine > 0 else arb.pi() for link in links]
    spring = [link.spring for link in links] + [arb(0)]

    def step(middle: list[Ball], at: list[Ball]) -> list[Ball]:
        f, J = [], arb_mat(n, n)
        turns = [theta - upright for theta, upright in zip(middle, relaxed, strict=True)]
        bends = [turns[0], *(below - above for above, below in pairwise(turns)), arb(0)]
        for i, (m, t) in enumerate(zip(middle, at, strict=True)):
            moment = spring[i] * bends[i] - spring[i + 1] * bends[i + 1]
            f.append([z[i] * m.sin() - x[i] * m.cos() - torque[i] + moment])
            J[i, i] = z[i] * t.cos() + x[i] * t.sin() + spring[i] + spring[i + 1]
            if i:
                J[i, i - 1] = J[i - 1, i] = -spring[i]
        return list(J.solve(arb_mat(f)).entries())

    try:
        middle = [arb(angle) for angle in start]
        for _ in range(NEWTON_ROUNDS):
            change = step(middle, middle)
            middle = [(m - c).mid() for m, c in zip(middle, change, strict=True)]
            width = 4 * max((abs(c).upper() for c in change), key=float)
            enclosed = [m + arb(0, width) for m in middle]
            images = [m - c for m, c in zip(middle, step(middle, enclosed), strict=True)]
            if width < arb(2) ** (-flint().ctx.prec // 2) and all(map(arb.contains, enclosed, images)):
                return images
    except ZeroDivisionError:
        pass
    raise ComputationError("the equilibrium under constant forces is too near to where it ends to be enclosed")


class Assembly:
    """Everything that moves with the supports, and every pendulum that moves while its support is at rest, in balls."""

    def __init__(self, scene: Scene) -> None:
        arb = flint().arb
        self.scene, self.gravity, self.structure = scene, arb(scene.gravity), structure_of(scene)
        carriers = tuple(map(in_balls, self.structure.carriers))
        self.structure = Structure(carriers, self.structure.pivots, self.structure.springs)
        moves = "cart moves" if scene.cart else "structure moves" if self.structure.size else "moves together"
        self.moving, self.joints = BlockInBalls(moves, 1), dict[int, tuple[PointInBalls, Row, LinkInBalls]]()
        for _ in range(self.structure.size):
            self.moving.coordinate()
        for carrier, body in enumerate(carriers):
            self._carry(carrier, body)

    def blocks(self) -> Iterator[BlockInBalls]:
        """Every block, that of the supports first."""
        leaning = leaning_links(self.scene) if "constant_force" in self.scene.features else []
        pendula = [pendulum for pendulum in self.scene.pendulum for _ in range(pendulum.count)]
        joined = tied(self.structure, [pendulum.n_links for pendulum in pendula])
        equal, first = dict[Any, list[int]](), 0
        for p, (pendulum, pivot) in enumerate(zip(pendula, self.structure.pivots, strict=True)):
            body = self.structure.carriers[pivot.carrier]
            links = leaning[p] if leaning else links_of(pendulum, self.gravity)
            self._hold(pivot, sum(link.mass for link in links))
            if leaning or p in joined:
                self._hang(self.moving, links, self.point(pivot), 1, first)
            else:
                chain = tuple(each.replace(count=1) for each in pendulum.links for _ in range(each.count))
                moves_as_one = body.turning is None and body.M is None
                place = (pivot.carrier if body.size else None) if moves_as_one else pivot
                equal.setdefault((chain, tuple(pendulum.ways), place), []).append(p)
            first += len(links)
        stills = [block for members in equal.values() for block in self._hang_equal(members, pendula[members[0]])]
        for spring in self.structure.springs:
            for size, row in self._ways(spring.ends, is_torsion=spring.torsion):
                self.moving.add(self.moving.K, flint().arb(spring.stiffness) * size, row)
        yield from (block for block in (self.moving, *stills) if block.M)

    def _hang_equal(self, members: list[int], pendulum: Pendulum) -> Iterator[BlockInBalls]:
        """Add equal pendula that move alike: their sum moves with the support, their differences leave it still."""
        pivot, links = self.structure.pivots[members[0]], links_of(pendulum, self.gravity)
        is_carried = self.structure.carriers[pivot.carrier].size > 0
        if is_carried:
            self._hang(self.moving, links, self.point(pivot), len(members))
        if still := len(members) * (1 + (self.scene.space == "space")) - is_carried:
            where = ("cart still" if self.scene.cart else "structure still") if is_carried else "fixed support"
            block = BlockInBalls(f"{where}: pendulum {members[0] + 1}", still)
            self._hang(block, links, PointInBalls({}, {}, {}, (0, 0)), 1)
            yield block

    def _carry(self, carrier: int, body: CarrierNumbers) -> None:
        """Add a support itself."""
        first, arb = self.structure.offsets[carrier], flint().arb
        for S, matrix in ((self.moving.M, body.M), (self.moving.K, body.K)):
            for i, row in enumerate([] if matrix is None else matrix.tolist()):  # of a modal support
                S[first + i].update({first + j: arb(row[j]) for j in range(i + 1)})
        if body.path is None:
            return
        for k, stiffness in enumerate(body.stiffness, first):
            self.moving.add(self.moving.K, stiffness, {k: arb(1)})
        centre = CarrierEnd(carrier, body.centre)
        point = self.point(centre)
        self.moving.add(self.moving.M, body.mass, point.along, point.down)
        self.moving.add(self.moving.M, body.inertia, point.turn)
        self._hold(centre, body.mass)

    def _hold(self, end: CarrierEnd, mass: Ball) -> None:
        """Add the stiffness of the weight on a point of a support, as the point moves on an arc: −g m ∂²z/∂η²."""
        body, first = self.structure.carriers[end.carrier], self.structure.offsets[end.carrier]
        arb = flint().arb
        for k in range(body.size) if body.bends else ():
            rates = [arb(int(j == k)) for j in range(body.size)]
            bend = -body.moving(in_arb(end.where), [arb(0)] * body.size, rates).bias[1]
            self.moving.add(self.moving.K, self.gravity * mass * bend, {first + k: arb(1)})

    def point(self, end: CarrierEnd) -> PointInBalls:
        """A point of a support."""
        body, first, arb = self.structure.carriers[end.carrier], self.structure.offsets[end.carrier], flint().arb
        zeros = [arb(0)] * body.size
        moving = body.moving(in_arb(end.where), zeros, zeros)
        along, down = (
            {first + k: arb(row[way]) for k, row in enumerate(moving.slopes) if not is_zero(row[way])} for way in (0, 1)
        )
        return PointInBalls(along, down, {} if body.turning is None else {first + body.turning: arb(1)}, moving.place)

    def _hang(
        self, block: BlockInBalls, links: list[LinkInBalls], pivot: PointInBalls, times: int, first: int | None = None
    ) -> None:
        """Add a chain, `times` as heavy; springs may end on its links, which are numbered from `first`."""
        M, K, upper, unit = block.M, block.K, pivot, flint().arb(1)
        for k, link in enumerate(links):
            l, share, new = link.length, link.centre / link.length, {block.coordinate(): unit}
            lower, angle = new, combine((link.cosine / l, new), (-link.cosine / l, upper.along))
            if not is_zero(link.sine):
                lower, angle = combine((unit, upper.along), (l * link.cosine, new)), new
            centre, bend = (
                combine((share, lower), (1 - share, upper.along)),
                combine((unit, angle), (-unit, upper.turn)),
            )
            block.add(M, times * link.mass, centre, combine((unit, upper.down), (-link.centre * link.sine, angle)))
            block.add(M, times * link.inertia, angle)
            block.add(M, times * link.rotor, bend)
            block.add(K, times * link.hold, angle)
            block.add(K, times * link.spring, bend)
            if first is not None:
                self.joints[first + k] = upper._replace(turn=angle), lower, link
            down = combine((unit, upper.down), (-l * link.sine, angle)) if not is_zero(link.sine) else upper.down
            upper = PointInBalls(lower, down, angle, (upper.place[0], upper.place[1] + l * link.cosine))

    def _end(self, end: End) -> PointInBalls | None:
        """The motion of an end of a spring; None for the ground, wherever the other end is."""
        if isinstance(end, CarrierEnd):
            return self.point(end)
        if isinstance(end, GroundEnd):
            return end.place and PointInBalls({}, {}, {}, in_arb(end.place))
        upper, lower, link = self.joints[end.link]
        below = link.centre if end.below is None else flint().arb(end.below)
        share, place = below / link.length, (upper.place[0], upper.place[1] + below * link.cosine)
        return upper._replace(along=combine((share, lower), (1 - share, upper.along)), place=place)

    def _ways(self, ends: tuple[End, End], *, is_torsion: bool) -> list[tuple[Ball, Row]]:
        """The extension of a spring in each of the ways in which it acts, and the factor of its square."""
        points, unit = [self._end(end) for end in ends], flint().arb(1)
        other = points[0] or points[1]
        assert other is not None, "one end at least has a place"
        a, b = (point or PointInBalls({}, {}, {}, other.place) for point in points)
        along, down = combine((unit, b.along), (-unit, a.along)), combine((unit, b.down), (-unit, a.down))
        if is_torsion:
            return [(unit, combine((unit, b.turn), (-unit, a.turn)))]
        first, second = ((float(point.place[0]), float(point.place[1])) for point in (a, b))
        if drawn_together(first, second):
            return [(unit, along), (unit, down)]
        x, z = b.place[0] - a.place[0], b.place[1] - a.place[1]
        return [(1 / (x * x + z * z), combine((x, along), (z, down)))]


def in_arb(where: Any) -> Any:
    """Return a position in balls; the number of a point of a modal support unchanged."""
    return where if isinstance(where, int) else tuple(map(flint().arb, where))


def in_balls(body: CarrierNumbers) -> CarrierNumbers:
    """The numbers of a support as balls."""
    arb = flint().arb
    return replace(
        body,
        position=in_arb(body.position),
        mass=arb(body.mass),
        inertia=arb(body.inertia),
        parameters=in_arb(body.parameters),
        stiffness=in_arb(body.stiffness),
    )
