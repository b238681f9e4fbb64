"""An oracle of structures that shares no line with the packages' mechanics: positions of all masses, in 50 digits.

Everything follows from places r(q, t) as the scene reference draws them, on second-order jets (a value, its gradient,
its Hessian) in mpmath:

    Σ m ∇r (∇r·q'' + q'ᵀ ∇²r q') + Σ I ∇α (∇α·q'') = −∇V − Σ d ∇s (∇s·q') + forces

with a potential V and dashpots d between what moves by s.  Time is one more coordinate, of rate 1: ropes that are
hoisted and a ground that moves need no frame of their own.  Coordinates: η of the supports, then absolute angles θ.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import accumulate
from typing import Any

import mpmath as mp

from modal.scene import Scene, VanDerPol
from modal.scene.motion import SineForce, SineMotion
from modal.scene.points import CarrierPoint, GroundPoint, PendulumPoint, parse_point

DIGITS = 50
Number = float | mp.mpf


# ------------------------------------------------------------------------------------------------------------- jets


@dataclass
class Jet:
    """A value with its first and second derivatives by coordinates, zeros omitted; `second` by (i, j) and (j, i)."""

    value: mp.mpf
    first: dict[int, mp.mpf] = field(default_factory=dict)
    second: dict[tuple[int, int], mp.mpf] = field(default_factory=dict)

    def __add__(self, other: Jet | Number) -> Jet:
        if not isinstance(other, Jet):
            return Jet(self.value + other, self.first, self.second)
        return Jet(self.value + other.value, _sum(self.first, other.first), _sum(self.second, other.second))

    __radd__ = __add__

    def __mul__(self, other: Jet | Number) -> Jet:
        if not isinstance(other, Jet):
            first = {i: other * a for i, a in self.first.items()}
            return Jet(self.value * other, first, {ij: other * a for ij, a in self.second.items()})
        plain = self * other.value + other * self.value
        crossed = dict(plain.second)
        for i, a in self.first.items():
            for j, b in other.first.items():
                for pair in ((i, j), (j, i)):
                    crossed[pair] = crossed.get(pair, 0) + a * b
        return Jet(self.value * other.value, plain.first, crossed)

    __rmul__ = __mul__

    def __neg__(self) -> Jet:
        return self * -1

    def __sub__(self, other: Jet | Number) -> Jet:
        return self + -1 * other

    def through(self, f: Number, slope: Number, curve: Number) -> Jet:
        """f of it, with f' and f'' there."""
        bent = {(i, j): curve * a * b for i, a in self.first.items() for j, b in self.first.items()}
        return Jet(f, (self * slope).first, _sum((self * slope).second, bent))

    def rate(self, v: Sequence[Number]) -> mp.mpf:
        """∇·v."""
        return mp.fsum(a * v[i] for i, a in self.first.items())

    def bias(self, v: Sequence[Number]) -> mp.mpf:
        """vᵀ ∇² v."""
        return mp.fsum(a * v[i] * v[j] for (i, j), a in self.second.items())


def _sum(a: dict[Any, mp.mpf], b: dict[Any, mp.mpf]) -> dict[Any, mp.mpf]:
    return {key: a.get(key, 0) + b.get(key, 0) for key in [*a, *(key for key in b if key not in a)]}


def sine(jet: Jet) -> Jet:
    s, c = mp.sin(jet.value), mp.cos(jet.value)
    return jet.through(s, c, -s)


def cosine(jet: Jet) -> Jet:
    s, c = mp.sin(jet.value), mp.cos(jet.value)
    return jet.through(c, -s, -c)


def root(jet: Jet) -> Jet:
    r = mp.sqrt(jet.value)
    return jet.through(r, 1 / (2 * r), -1 / (4 * r**3))


# ---------------------------------------------------------------------------------------------- a scene at one state

At = tuple[Jet, Jet]


@dataclass
class Parts:
    """What a scene consists of at one state, places in the frame of still air."""

    masses: list[tuple[Number, At]] = field(default_factory=list)
    turning: list[tuple[Number, Jet]] = field(default_factory=list)
    weights: list[Jet] = field(default_factory=list)  # −m g z, also of what a modal support carries
    stored: list[Jet] = field(default_factory=list)  # energies of springs
    dashpots: list[tuple[Number, Jet]] = field(default_factory=list)
    pushed: list[tuple[Number, Jet]] = field(default_factory=list)  # a generalized force on what moves by a jet

    def inertia(self) -> Iterator[tuple[Number, Jet]]:
        """Every ½ weight (rate of a jet)² of the kinetic energy."""
        for m, place in self.masses:
            yield from ((m, part) for part in place)
        yield from self.turning


@dataclass
class _Body:
    """The pose of a support, or the points of a modal one."""

    origin: At
    angle: Jet | None
    eta: list[Jet]
    points: Any = None

    def at(self, where: tuple[Number, Number] | int) -> At:
        x, z = self.origin
        if self.points is not None:
            row = self.points[where]
            moved = [
                sum((mp.mpf(a) * e for a, e in zip(row[k], self.eta, strict=True)), Jet(mp.mpf(0))) for k in (0, 1)
            ]
            return x + moved[0], z + moved[1]
        s, h = map(mp.mpf, where)  # type: ignore[arg-type]
        if self.angle is None:
            return x + s, z + h
        S, C = sine(self.angle), cosine(self.angle)
        return x + s * C + h * S, z + h * C - s * S


@dataclass
class _Hung:
    """A `link` of a chain: its upper joint, its angle, the angle above (None: nothing turns), γ from equilibrium."""

    joint: At
    theta: Jet
    above: Jet | None
    gamma: Jet
    link: Any

    def at(self, below: Number | Jet) -> At:
        return self.joint[0] + below * sine(self.theta), self.joint[1] + below * cosine(self.theta)


@dataclass
class Oracle:
    """A scene in the plane without dry friction; `names` are those of its coordinates."""

    scene: Scene

    def __post_init__(self) -> None:
        sizes = [_size(support) for support in self.scene.supports]
        self.firsts = [0, *accumulate(sizes)]
        self.carried = self.firsts[-1]
        self.size = self.carried + self.scene.n_links
        self.names = [name for support in self.scene.supports for name in _names(support)]
        if [support.kind for support in self.scene.supports] == ["cart"]:
            self.names = ["x"]

    # ------------------------------------------------------------------------------------------------------ answers

    def accelerations(self, q: Sequence[Number], v: Sequence[Number], time: Number = 0.0) -> list[mp.mpf]:
        """q'' (size,) to 40 digits at any state."""
        with mp.workdps(DIGITS):
            parts, rates = self._parts(q, v, time), [*map(mp.mpf, v), mp.mpf(1)]
            M, right = mp.zeros(self.size), mp.zeros(self.size, 1)
            for m, jet in parts.inertia():
                self._add(M, m, jet)
                self._push(right, -m * jet.bias(rates), jet)
            for energy in (*parts.weights, *parts.stored):
                self._push(right, mp.mpf(-1), energy)
            for d, jet in parts.dashpots:
                self._push(right, -d * jet.rate(rates), jet)
            for force, jet in parts.pushed:
                self._push(right, force, jet)
            return list(mp.lu_solve(M, right))

    def energy(self, q: Sequence[Number], v: Sequence[Number], time: Number = 0.0) -> mp.mpf:
        """T + V (J), in the frame of still air."""
        with mp.workdps(DIGITS):
            parts, rates = self._parts(q, v, time), [*map(mp.mpf, v), mp.mpf(1)]
            kinetic = mp.fsum(m * jet.rate(rates) ** 2 / 2 for m, jet in parts.inertia())
            return kinetic + mp.fsum(energy.value for energy in (*parts.weights, *parts.stored))

    def matrices(self) -> tuple[mp.matrix, mp.matrix, mp.matrix]:
        """M, K and D (size, size) about the drawn rest, without drives; in deviations of the angles."""
        with mp.workdps(DIGITS):
            parts = self._parts(self.rest, [0] * self.size, 0.0)
            M, K, D = (mp.zeros(self.size) for _ in range(3))
            for m, jet in parts.inertia():
                self._add(M, m, jet)
            for energy in (*parts.weights, *parts.stored):
                for (i, j), a in energy.second.items():
                    if max(i, j) < self.size:
                        K[i, j] += a
            for d, jet in parts.dashpots:
                self._add(D, d, jet)
            return M, K, D

    def unbalanced(self) -> list[mp.mpf]:
        """The generalized forces at the drawn rest: zero in an equilibrium."""
        with mp.workdps(DIGITS):
            parts, force = self._parts(self.rest, [0] * self.size, 0.0), mp.zeros(self.size, 1)
            for energy in (*parts.weights, *parts.stored):
                self._push(force, mp.mpf(-1), energy)
            return list(force)

    def frequencies(self) -> list[mp.mpf]:
        """ω (rad/s) of M and K in ascending order, of ω² < 0 as zero."""
        with mp.workdps(DIGITS):
            M, K, _ = self.matrices()
            L = mp.cholesky(M) ** -1
            A = L * K * L.T
            return sorted(mp.sqrt(max(x, mp.mpf(0))) for x in mp.eigsy((A + A.T) / 2, eigvals_only=True))

    @property
    def rest(self) -> list[mp.mpf]:
        """The drawn rest: η = 0, and θ = 0 or π."""
        ways = [way for pendulum in self.scene.pendulum for way in pendulum.ways * pendulum.count]
        return [mp.mpf(0)] * self.carried + [+mp.pi if way == "up" else mp.mpf(0) for way in ways]

    def _push(self, right: mp.matrix, force: mp.mpf, jet: Jet) -> None:
        for i, a in jet.first.items():
            if i < self.size:
                right[i] += force * a

    def _add(self, A: mp.matrix, weight: Number, jet: Jet) -> None:
        for i, a in jet.first.items():
            for j, b in jet.first.items():
                if max(i, j) < self.size:
                    A[i, j] += weight * a * b

    # ------------------------------------------------------------------------------------------------------- places

    def _parts(self, q: Sequence[Number], v: Sequence[Number], time: Number) -> Parts:
        """All parts at one state; springs are unstretched, and supports' springs carry the weights, as drawn."""
        here = _Assembled(self, q, time)
        here.own_springs(self._drawn)
        here.springs(self._drawn)
        here.drives([*map(mp.mpf, v), mp.mpf(1)])
        here.forces(mp.mpf(time))
        return here.parts

    @cached_property
    def _drawn(self) -> _Assembled:
        return _Assembled(self, self.rest, None)


class _Assembled:
    """A scene at one state: bodies, links, and the parts that they make; `time` None: as drawn, on a ground at rest."""

    def __init__(self, oracle: Oracle, q: Sequence[Number], time: Number | None) -> None:
        self.scene, self.oracle, self.parts = oracle.scene, oracle, Parts()
        self.q = [Jet(mp.mpf(value), {i: mp.mpf(1)}) for i, value in enumerate(q)]
        self.time = None if time is None else Jet(mp.mpf(time), {oracle.size: mp.mpf(1)})
        self.ground = self._ground()
        self.bodies = [
            _body(support, self.q[first : first + _size(support)])
            for support, first in zip(self.scene.supports, oracle.firsts, strict=False)
        ]
        self.links: list[_Hung] = []
        self.firsts: list[list[int]] = []  # of each pendulum, the first link of every copy
        for support, body in zip(self.scene.supports, self.bodies, strict=True):
            self._carrier(support, body)
        for pendulum in self.scene.pendulum:
            self.firsts.append([])
            for _ in range(pendulum.count):
                self.firsts[-1].append(len(self.links))
                self._chain(pendulum)

    def _ground(self) -> At:
        along, down = Jet(mp.mpf(0)), Jet(mp.mpf(0))
        for motion in _motions(self.scene) if self.time is not None else ():
            assert isinstance(motion, SineMotion)
            moved = mp.mpf(motion.amplitude) * sine(_phase(motion, self.time))
            along, down = (along + moved, down) if motion.direction == "horizontal" else (along, down - moved)
        return along, down

    def _moved(self, place: At) -> At:
        return place[0] + self.ground[0], place[1] + self.ground[1]

    def _weigh(self, mass: Number, place: At) -> None:
        place = self._moved(place)
        self.parts.masses.append((mass, place))
        self.parts.weights.append(-mp.mpf(self.scene.gravity) * mass * place[1])

    def _carrier(self, support: Any, body: _Body) -> None:
        if support.kind in {"fixed", "moved"}:
            return
        if support.kind == "modal":
            assert not _motions(self.scene), "a modal support's own inertia on a ground that moves is not known"
            d = len(support.M)
            for i in range(d):
                for j in range(d):
                    m = mp.mpf(support.M[i][j])
                    self.parts.turning += [(m / 4, body.eta[i] + body.eta[j]), (-m / 4, body.eta[i] - body.eta[j])]
            return
        self._weigh(mp.mpf(support.mass), body.at(getattr(support, "centre", (0, 0))))
        if body.angle is not None:
            self.parts.turning.append((mp.mpf(support.inertia), body.angle))

    def _chain(self, pendulum: Any) -> None:
        point = None if pendulum.on is None else parse_point(pendulum.on)
        body, where = self.bodies[0], pendulum.position
        if isinstance(point, CarrierPoint):
            body, where = self._named(point.name), where if point.point is None else point.point
        joint = body.at(where)
        above = body.angle
        rest = iter(self.oracle.rest[self.oracle.carried + len(self.links) :])
        turned = mp.mpf(0)
        for link in (part for part in pendulum.links for _ in range(part.count)):
            theta, straight = self.q[self.oracle.carried + len(self.links)], next(rest)
            gamma = (theta if above is None else theta - above) - (straight - turned)
            hung = _Hung(joint, theta, above, gamma, link)
            self.links.append(hung)
            length, m = self._length(link), mp.mpf(link.mass)
            centre, inertia = _geometry(link, length)
            self._weigh(m, hung.at(centre))
            self.parts.turning.append((inertia, theta))
            self.parts.turning.append((mp.mpf(link.rotor_inertia) * mp.mpf(link.gear_ratio) ** 2, gamma))
            self.parts.stored.append(mp.mpf(link.stiffness) / 2 * _square(gamma))
            self.parts.dashpots.append((mp.mpf(link.damping), gamma))
            self.parts.dashpots += [(mp.mpf(link.drag), way) for way in self._moved(hung.at(centre))]
            joint, above, turned = hung.at(length), theta, straight

    def _length(self, link: Any) -> Number | Jet:
        if link.hoist is None or self.time is None:
            return mp.mpf(link.length)
        law = link.hoist.law(link.length)(float(self.time.value))
        return self.time.through(*(mp.mpf(float(value)) for value in law))

    def _named(self, name: str) -> _Body:
        return self.bodies[self.scene.support_names.index(name)]

    # ---------------------------------------------------------------------------------------------- springs, forces

    def own_springs(self, drawn: _Assembled) -> None:
        """½ k η² + W η, W the slope of −V of all weights at the drawn rest, of every η with a spring; and dampers."""
        for support, body, first in zip(self.scene.supports, self.bodies, self.oracle.firsts, strict=False):
            rows, dampers = _own(support, "stiffness"), _own(support, "damping")
            for i, (row, losses) in enumerate(zip(rows, dampers, strict=True)):
                extension = sum((mp.mpf(k) * eta for k, eta in zip(row, body.eta, strict=True)), Jet(mp.mpf(0)))
                self.parts.stored.append(mp.mpf(1) / 2 * body.eta[i] * extension)
                if any(row) or support.kind == "modal":
                    weight = mp.fsum(-energy.first.get(first + i, 0) for energy in drawn.parts.weights)
                    self.parts.stored.append(weight * body.eta[i])
                for j, d in enumerate(map(mp.mpf, losses)):
                    both, apart = body.eta[i] + body.eta[j], body.eta[i] - body.eta[j]
                    self.parts.dashpots += [(d / 4, both), (-d / 4, apart)]

    def springs(self, drawn: _Assembled) -> None:
        """Springs and dampers between points, along the line between them, or where they meet as drawn in all ways."""
        for spring in self.scene.spring:
            k, d = mp.mpf(spring.stiffness), mp.mpf(spring.damping)
            if spring.kind == "torsion":
                for a, b in _paired(*(self._angles(text) for text in spring.between)):
                    self.parts.stored.append(k / 2 * _square(b - a))
                    self.parts.dashpots.append((d, b - a))
                continue
            now, then = (_paired(*(structure.ends(text) for text in spring.between)) for structure in (self, drawn))
            for ends, rest in zip(now, then, strict=True):
                start, end = (at or other for at, other in (rest, rest[::-1]))
                # An end on the ground without a place is where the other end is drawn.
                a, b = ((ends[n] or tuple(Jet(part.value) for part in (start, end)[n])) for n in (0, 1))
                dx, dz = b[0] - a[0], b[1] - a[1]
                length = mp.hypot(end[0].value - start[0].value, end[1].value - start[1].value)
                if length == 0:
                    self.parts.stored.append(k / 2 * (_square(dx) + _square(dz)))
                    self.parts.dashpots += [(d, dx), (d, dz)]
                else:
                    long = root(_square(dx) + _square(dz))
                    self.parts.stored.append(k / 2 * _square(long - length))
                    self.parts.dashpots.append((d, long))

    def ends(self, text: str) -> list[At | None]:
        """The places that one end of a spring means, in the frame of the ground; None below the other end."""
        point = parse_point(text)
        if isinstance(point, GroundPoint):
            return [None if point.place is None else tuple(Jet(mp.mpf(part)) for part in point.place)]  # type: ignore[list-item]
        if isinstance(point, PendulumPoint):
            return [
                hung.at(self._centre(hung) if point.below is None else mp.mpf(point.below))
                for hung in self._hung(point)
            ]
        name, place = ("cart", (0.0, 0.0)) if point is None else (point.name, point.place)
        where = place if point is None or point.point is None else point.point
        return [self._named(name).at(where)]

    def _angles(self, text: str) -> list[Jet]:
        point = parse_point(text)
        if isinstance(point, PendulumPoint):
            return [hung.theta for hung in self._hung(point)]
        if isinstance(point, GroundPoint):
            return [Jet(mp.mpf(0))]
        angle = self._named("cart" if point is None else point.name).angle
        return [angle or Jet(mp.mpf(0))]

    def _hung(self, point: PendulumPoint) -> Iterator[_Hung]:
        links = self.scene.pendulum[point.pendulum].links
        before = sum(link.count for link in links[: point.link])
        for copy, first in enumerate(self.firsts[point.pendulum]):
            if point.copy in {None, copy}:
                yield from self.links[first + before : first + before + links[point.link].count]

    def _centre(self, hung: _Hung) -> Number | Jet:
        return _geometry(hung.link, self._length(hung.link))[0]

    def drives(self, rates: Sequence[mp.mpf]) -> None:
        """Van der Pol torques at joints, and quadratic drag at centres."""
        for hung in self.links:
            drive = hung.link.drive
            if isinstance(drive, VanDerPol):
                share = hung.gamma.value / mp.radians(mp.mpf(drive.angle_deg))
                torque = mp.mpf(drive.strength) * (1 - share**2) * hung.gamma.rate(rates)
                self.parts.pushed.append((torque, hung.gamma))
            if hung.link.quadratic_drag:
                ways = self._moved(hung.at(self._centre(hung)))
                speed = mp.sqrt(mp.fsum(way.rate(rates) ** 2 for way in ways))
                drag = mp.mpf(hung.link.quadratic_drag) * speed
                self.parts.pushed += [(-drag * way.rate(rates), way) for way in ways]

    def forces(self, time: mp.mpf) -> None:
        """Sines on points, and torques."""
        for force in self.scene.force:
            assert isinstance(force, SineForce)
            value = mp.mpf(force.amplitude) * mp.sin(_phase(force, Jet(time)).value)
            point = parse_point(force.on)
            if force.direction == "torque":
                for jet in self._angles(force.on) if not isinstance(point, PendulumPoint) else self._twisted(point):
                    self.parts.pushed.append((value, jet))
                continue
            for place in self.ends(force.on):
                assert place is not None
                self.parts.pushed.append((value, place[0]) if force.direction == "horizontal" else (-value, place[1]))

    def _twisted(self, point: PendulumPoint) -> Iterator[Jet]:
        for hung in self._hung(point):
            alone = hung.above is None or point.below is not None
            yield hung.theta if alone else hung.theta - hung.above


# ---------------------------------------------------------------------------------------------------- of the scene


def _names(support: Any) -> list[str]:
    name = getattr(support, "name", "") or support.kind
    suffixes: dict[str, list[str]] = {
        "cart": ["m"],
        "swing": ["m"],
        "tilt": ["rad"],
        "heave": ["m"],
        "platform": ["sway_m", "heave_m", "roll_rad"],
        "modal": [str(k + 1) for k in range(_size(support))],
    }
    return [f"{name}_{suffix}" for suffix in suffixes.get(support.kind, [])]


def _size(support: Any) -> int:
    sizes = {"fixed": 0, "moved": 0, "platform": 3}
    return len(support.M) if support.kind == "modal" else sizes.get(support.kind, 1)


def _own(support: Any, name: str) -> list[list[float]]:
    """The matrix of a support's own springs or dampers."""
    if support.kind == "modal":
        d = _size(support)
        return [list(row) for row in (support.K if name == "stiffness" else support.D) or [[0.0] * d] * d]
    if support.kind in {"fixed", "moved"}:
        return []
    values = getattr(support, name)
    if support.kind != "platform":
        return [[values]]
    return [[value * (i == j) for j in range(3)] for i, value in enumerate((values.sway, values.heave, values.roll))]


def _body(support: Any, eta: list[Jet]) -> _Body:
    x, z = (Jet(mp.mpf(part)) for part in getattr(support, "position", (0.0, 0.0)))
    makers: dict[str, Callable[[], _Body]] = {
        "cart": lambda: _Body((x + eta[0], z), None, eta),
        "swing": lambda: _swung(support, (x, z), eta),
        "tilt": lambda: _Body((x, z), eta[0], eta),
        "heave": lambda: _Body((x, z - eta[0]), None, eta),
        "platform": lambda: _Body((x + eta[0], z - eta[1]), eta[2], eta),
        "modal": lambda: _Body((x, z), None, eta, support.points),
    }
    return makers.get(support.kind, lambda: _Body((x, z), None, eta))()


def _swung(support: Any, place: At, eta: list[Jet]) -> _Body:
    L = mp.mpf(support.length)
    angle = eta[0] * (1 / L)
    return _Body((place[0] + L * sine(angle), place[1] + L * cosine(angle) - L), None, eta)


def _motions(scene: Scene) -> tuple[Any, ...]:
    return next((carrier.motions for carrier in (scene.ground, scene.support) if hasattr(carrier, "motions")), ())


def _phase(signal: Any, time: Jet) -> Jet:
    return time * (2 * mp.pi * mp.mpf(signal.frequency_hz)) + mp.radians(mp.mpf(signal.phase_deg))


def _geometry(link: Any, length: Number | Jet) -> tuple[Number | Jet, mp.mpf]:
    """The centre and the inertia of a link of a length, which changes for bobs alone."""
    if link.kind == "bob":
        return length, mp.mpf(0)
    if link.kind == "rod":
        return mp.mpf(link.length) / 2, mp.mpf(link.mass) * mp.mpf(link.length) ** 2 / 12
    return mp.mpf(link.centre), mp.mpf(link.inertia)


def _square(jet: Jet) -> Jet:
    return jet * jet


def _paired(a: list[Any], b: list[Any]) -> list[tuple[Any, Any]]:
    count = max(len(a), len(b))
    a, b = (ends * count if len(ends) == 1 else ends for ends in (a, b))
    return list(zip(a, b, strict=True))
