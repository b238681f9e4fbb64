"""The motion of any plane scene from the places of its masses, with nothing of the packages but its numbers: an oracle.

A place is a function of the coordinates z: those of the supports, the absolute angles of links, and what is prescribed,
the displacement of the ground along and down, the lengths of hoisted ropes, and one that is always 0, a cart's way
down.  Each scalar s(z) (a part of a place, an angle, the length of a spring) acts along its gradient:

    Σ m ∇s (∇s·z'' + z'ᵀ ∇²s z') = −∇V − Σ d ∇s (∇s·z') + forces

The rows of free coordinates give their accelerations, that of the cart's way down the push of its rail.  SymPy
differentiates the places once; friction and kicks are those of `support.pieces`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from math import pi, radians, sin, tau
from typing import Any

import numpy as np
import scipy
import sympy as sp
from support.pieces import LONGEST, Switches

from modal.scene import Escapement, Scene, VanDerPol
from modal.scene.points import CarrierPoint, GroundPoint, PendulumPoint, parse_point
from modal.types import Floats
from nonlinear import State

Law = Callable[[float], tuple[float, float, float]]
"""A value with its rate and acceleration at a time (s)."""
Place = tuple[Any, Any]

TURNED = {"tilt": 0, "platform": 2}
SIZES = {"fixed": 0, "moved": 0, "platform": 3}


# --------------------------------------------------------------------------------------------------- laws of time


def sine(amplitude: float, frequency: float, phase_deg: float) -> Law:
    rate, phase = tau * frequency, radians(phase_deg)
    return lambda t: (
        amplitude * sin(rate * t + phase),
        amplitude * rate * sin(rate * t + phase + pi / 2),
        -amplitude * rate**2 * sin(rate * t + phase),
    )


def motion_law(motion: Any) -> tuple[Law, list[float]]:
    """The displacement of a support, and where it is not smooth."""
    if motion.kind == "sine":
        return sine(motion.amplitude, motion.frequency_hz, motion.phase_deg), []
    times, (of, values) = np.array(motion.time_s), motion.samples
    spline = scipy.interpolate.make_interp_spline(times, values, k=5)
    order = ("displacement", "velocity", "acceleration").index(of)
    curves = [spline.antiderivative(order - k) if k < order else spline.derivative(k - order) for k in range(3)]

    def law(t: float) -> tuple[float, float, float]:
        within = min(max(t, times[0]), times[-1])
        inside = times[0] <= t <= times[-1]
        return 0.0, float(curves[1](within)), float(curves[2](t)) if inside else 0.0

    return law, times.tolist()


def force_law(force: Any) -> tuple[Callable[[float], float], list[float]]:
    """A force (N) or torque (N m), and where it is not smooth."""
    if force.kind == "constant":
        return (lambda t: force.amplitude), []
    if force.kind == "sine":
        law = sine(force.amplitude, force.frequency_hz, force.phase_deg)
        return (lambda t: law(t)[0]), []
    times = np.array(force.time_s)
    spline = scipy.interpolate.make_interp_spline(times, force.samples, k=5)
    return (lambda t: float(spline(t)) if times[0] <= t <= times[-1] else 0.0), times.tolist()


def rope_law(link: Any) -> tuple[Law, list[float]]:
    """The length of a rope, and where it is not smooth."""
    hoist, l = link.hoist, link.length
    if hoist.is_recorded:
        spline = scipy.interpolate.CubicSpline(hoist.time_s, hoist.length_m, bc_type="clamped")
        first, last = hoist.time_s[0], hoist.time_s[-1]

        def recorded(t: float) -> tuple[float, float, float]:
            inside = first <= t < last
            return tuple(float(spline(min(max(t, first), last), k)) * (inside or k == 0) for k in range(3))  # type: ignore[return-value]

        return recorded, list(hoist.time_s)
    begin, T, change = hoist.begin, hoist.duration, hoist.to - l
    if hoist.profile == "smooth":

        def smooth(t: float) -> tuple[float, float, float]:
            s = min(max((t - begin) / T, 0.0), 1.0)
            shape = 10 * s**3 - 15 * s**4 + 6 * s**5
            return (
                l + change * shape,
                change / T * 30 * s**2 * (1 - s) ** 2,
                change / T**2 * 60 * s * (1 - s) * (1 - 2 * s),
            )

        return smooth, [begin, begin + T]
    ramp = T * (0.25 if hoist.ramp is None else hoist.ramp)
    speed = change / (T - ramp)

    def trapezoidal(t: float) -> tuple[float, float, float]:
        s = t - begin
        if s <= 0 or s >= T:
            return l + change * (s >= T), 0.0, 0.0
        if s < ramp:
            return l + speed * s**2 / ramp / 2, speed * s / ramp, speed / ramp
        if s <= T - ramp:
            return l + speed * (s - ramp / 2), speed, 0.0
        return l + change - speed * (T - s) ** 2 / ramp / 2, speed * (T - s) / ramp, -speed / ramp

    return trapezoidal, [begin, begin + ramp, begin + T - ramp, begin + T]


# ---------------------------------------------------------------------------------------------------- the scalars


@dataclass
class Hung:
    """A link: its upper joint, its angle by place among z, the place of the angle above (None: nothing turns)."""

    joint: Place
    angle: int
    above: int | None
    upright: bool
    length: Any
    link: Any
    z: Sequence[Any]

    def at(self, below: Any) -> Place:
        theta = self.z[self.angle]
        return self.joint[0] + below * sp.sin(theta), self.joint[1] + below * sp.cos(theta)

    @property
    def centre(self) -> Place:
        return self.at({"bob": self.length, "rod": self.length / 2}.get(self.link.kind, self.link.centre))


@dataclass
class Scalars:
    """Functions of z: each with a mass, a potential's slope, a dashpot or a force; `rates` are laws of their rates."""

    s: list[Any] = field(default_factory=list)
    mass: list[float] = field(default_factory=list)
    damping: list[float] = field(default_factory=list)
    pushes: list[tuple[int, Callable[[float], float]]] = field(default_factory=list)
    drags: list[tuple[int, int, float]] = field(default_factory=list)  # two parts of a place, and quadratic drag
    drives: list[tuple[int, float, float]] = field(default_factory=list)

    def add(self, s: Any, *, mass: float = 0.0, damping: float = 0.0) -> int:
        self.s.append(sp.sympify(s))
        self.mass.append(mass)
        self.damping.append(damping)
        return len(self.s) - 1


class Places:
    """A scene in the plane; `names` of z are those of free coordinates, then of what is prescribed."""

    def __init__(self, scene: Scene) -> None:
        self.scene, self.scalars, self.V = scene, Scalars(), sp.S.Zero
        sizes = [SIZES.get(support.kind, 1) for support in scene.supports]
        self.firsts = np.cumsum([0, *sizes]).tolist()
        self.carried, self.size = self.firsts[-1], self.firsts[-1] + scene.n_links
        self.laws: list[Law] = []
        self.breaks: set[float] = set()
        ropes = [link for p in scene.pendulum for link in p.links if link.hoist]
        self.z = sp.symbols(f"z:{self.size + 3 + len(ropes)}", real=True)
        self.v = sp.symbols(f"v:{len(self.z)}", real=True)
        self._prescribe(ropes)
        self.hung: list[Hung] = []
        self.copies: list[list[int]] = []
        self.bodies = [self._body(k) for k in range(len(scene.supports))]
        for pendulum in scene.pendulum:
            self.copies.append([])
            for _ in range(pendulum.count):
                self.copies[-1].append(len(self.hung))
                self._chain(pendulum)
        self.drawn = {**dict.fromkeys(self.z, sp.S.Zero), **{h.z[h.angle]: sp.pi * int(h.upright) for h in self.hung}}
        self.drawn |= {self.rope[id(link)]: sp.Float(link.length) for link in ropes}
        self._own_springs()
        for spring in scene.spring:
            self._spring(spring)
        for force in scene.force:
            self._force(force)

    # ----------------------------------------------------------------------------------------------------- places

    def _prescribe(self, ropes: list[Any]) -> None:
        """The ground's two, the cart's way down, and the ropes'."""
        still: Law = lambda t: (0.0, 0.0, 0.0)  # noqa: E731
        ground = [still, still]
        carrier = next((part for part in (self.scene.ground, self.scene.support) if hasattr(part, "motions")), None)
        for motion in carrier.motions if carrier else ():
            law, breaks = motion_law(motion)
            vertical = motion.direction == "vertical"
            ground[vertical] = (lambda t, law=law: tuple(-x for x in law(t))) if vertical else law  # type: ignore[misc]
            self.breaks.update(breaks)
        self.laws += [*ground, still]
        self.ground, self.lift = self.z[self.size : self.size + 2], self.z[self.size + 2]
        self.rope = {}
        for k, link in enumerate(ropes):
            law, breaks = rope_law(link)
            self.laws.append(law)
            self.breaks.update(breaks)
            self.rope[id(link)] = self.z[self.size + 3 + k]

    def _body(self, k: int) -> tuple[Callable[[Any], Place], int | None]:
        """Where a support's points are, and the place of its angle."""
        support, first = self.scene.supports[k], self.firsts[k]
        x, z = map(sp.Float, getattr(support, "position", (0.0, 0.0)))
        eta = self.z[first : self.firsts[k + 1]]
        if support.kind == "cart":
            origin = x + eta[0], z + self.lift
        elif support.kind == "swing":
            L = sp.Float(support.length)
            origin = x + L * sp.sin(eta[0] / L), z + L * sp.cos(eta[0] / L) - L
        elif support.kind == "heave":
            origin = x, z - eta[0]
        elif support.kind == "platform":
            origin = x + eta[0], z - eta[1]
        else:
            origin = x, z
        turned = TURNED.get(support.kind)
        angle = None if turned is None else first + turned
        S, C = (sp.S.Zero, sp.S.One) if angle is None else (sp.sin(self.z[angle]), sp.cos(self.z[angle]))

        def at(where: Any) -> Place:
            s, h = map(sp.Float, where)
            return origin[0] + s * C + h * S, origin[1] + h * C - s * S

        if support.kind not in {"fixed", "moved"}:
            self._weigh(support.mass, at(getattr(support, "centre", (0.0, 0.0))))
            if angle is not None:
                self.scalars.add(self.z[angle], mass=support.inertia)
        return at, angle

    def _weigh(self, mass: float, place: Place) -> tuple[int, int]:
        along, down = (part + moved for part, moved in zip(place, self.ground, strict=True))
        self.V -= self.scene.gravity * mass * down
        return self.scalars.add(along, mass=mass), self.scalars.add(down, mass=mass)

    def _chain(self, pendulum: Any) -> None:
        name = pendulum.on
        at, above = self.bodies[0 if name is None else self.scene.support_names.index(parse_point(name).name)]
        joint, turned, ways = at(pendulum.position), False, iter(pendulum.ways)
        for link in (part for part in pendulum.links for _ in range(part.count)):
            upright, angle = next(ways) == "up", self.carried + len(self.hung)
            length = self.rope.get(id(link), sp.Float(link.length))
            hung = Hung(joint, angle, above, upright, length, link, self.z)
            gamma = self.z[angle] - (0 if above is None else self.z[above]) - sp.pi * (int(upright) - int(turned))
            x, z = self._weigh(link.mass, hung.centre)
            self.scalars.add(self.z[angle], mass=link.inertia)
            bend = self.scalars.add(gamma, mass=link.rotor_inertia * link.gear_ratio**2, damping=link.damping)
            self.V += link.stiffness * gamma**2 / 2
            self.scalars.damping[x] = self.scalars.damping[z] = link.drag
            if link.quadratic_drag:
                self.scalars.drags.append((x, z, link.quadratic_drag))
            if isinstance(link.drive, VanDerPol):
                self.scalars.drives.append((bend, link.drive.strength, radians(link.drive.angle_deg)))
            self.hung.append(hung)
            joint, above, turned = hung.at(length), angle, upright

    # ---------------------------------------------------------------------------------------------- springs, forces

    def _own_springs(self) -> None:
        """½ k η² + W η with W the slope of all weights as drawn; and dampers."""
        weights = self.V
        for support, first in zip(self.scene.supports, self.firsts, strict=False):
            if support.kind in {"fixed", "moved"}:
                continue
            for k, name in enumerate(("sway", "heave", "roll") if support.kind == "platform" else ("",)):
                stiffness, damping = (
                    getattr(part, name) if name else part for part in (support.stiffness, support.damping)
                )
                eta = self.z[first + k]
                self.scalars.add(eta, damping=damping)
                if stiffness:
                    self.V += stiffness * eta**2 / 2 - sp.diff(weights, eta).subs(self.drawn).evalf() * eta

    def ends(self, text: str) -> Iterator[Place]:
        point = parse_point(text)
        if isinstance(point, GroundPoint):
            assert point.place is not None
            yield sp.Float(point.place[0]), sp.Float(point.place[1])
        elif isinstance(point, PendulumPoint):
            yield from (h.centre if point.below is None else h.at(sp.Float(point.below)) for h in self._named(point))
        else:
            carrier = 0 if point is None else self.scene.support_names.index(point.name)
            yield self.bodies[carrier][0]((0.0, 0.0) if point is None else point.place)

    def _named(self, point: PendulumPoint) -> Iterator[Hung]:
        for copy, first in enumerate(self.copies[point.pendulum]):
            if point.copy in {None, copy}:
                yield self.hung[first + point.link]

    def angles(self, text: str, *, joint: bool = False) -> Iterator[Any]:
        """Absolute angles, or at a joint those between a link and the one above."""
        point = parse_point(text)
        if isinstance(point, PendulumPoint):
            for h in self._named(point):
                bent = joint and point.below is None and h.above is not None
                yield self.z[h.angle] - (self.z[h.above] if bent else 0)
        elif isinstance(point, CarrierPoint):
            angle = self.bodies[self.scene.support_names.index(point.name)][1]
            yield sp.S.Zero if angle is None else self.z[angle]
        else:
            yield sp.S.Zero

    def _spring(self, spring: Any) -> None:
        of = self.angles if spring.kind == "torsion" else self.ends
        starts, ends = (list(of(text)) for text in spring.between)  # type: ignore[operator]
        count = max(len(starts), len(ends))
        for a, b in zip(*(each * count if len(each) == 1 else each for each in (starts, ends)), strict=True):
            if spring.kind == "torsion":
                long, rest = b - a, sp.S.Zero
            else:
                long = sp.sqrt((b[0] - a[0]) ** 2 + (b[1] - a[1]) ** 2)
                rest = long.subs(self.drawn).evalf()
            self.V += spring.stiffness * (long - rest) ** 2 / 2
            self.scalars.add(long, damping=spring.damping)

    def _force(self, force: Any) -> None:
        law, breaks = force_law(force)
        self.breaks.update(breaks)
        if force.direction == "torque":
            scalars = list(self.angles(force.on, joint=True))
        else:
            along = force.direction == "horizontal"
            scalars = [place[0] if along else -place[1] for place in self.ends(force.on)]
        self.scalars.pushes += [(self.scalars.add(s), law) for s in scalars]

    # -------------------------------------------------------------------------------------------------- equations

    @cached_property
    def _numbers(self) -> Callable[..., Any]:
        """By z and v: s, its gradient, its second derivative along v, and ∇V."""
        flat: list[Any] = []
        self._entries = []
        for k, s in enumerate(self.scalars.s):
            for j in sorted(self.z.index(x) for x in s.free_symbols):
                slope = sp.diff(s, self.z[j])
                self._entries.append((k, j))
                flat.append(slope)
        gradients = list(flat)
        curved = [sp.S.Zero] * len(self.scalars.s)
        for (k, j), slope in zip(self._entries, gradients, strict=True):
            curved[k] += sum(
                sp.diff(slope, x) * self.v[self.z.index(x)] * self.v[j] for x in sorted(slope.free_symbols, key=str)
            )
        driven = [self.scalars.s[k] for k, _, _ in self.scalars.drives]
        potential = [sp.diff(self.V, x) for x in self.z]
        return sp.lambdify((self.z, self.v), [gradients, curved, driven, potential], modules="math", cse=True)

    def _instant(self, t: float, q: Floats, v: Floats) -> tuple[Floats, Floats]:
        """M (z, z) and the forces (z,) but for those that hold what is prescribed, with M z'' of what is prescribed."""
        laws = np.array([law(t) for law in self.laws])
        z, rates = np.append(q, laws[:, 0]), np.append(v, laws[:, 1])
        gradients, curved, driven, slopes = self._numbers(z.tolist(), rates.tolist())
        scalars = self.scalars
        G = np.zeros((len(scalars.s), len(z)))
        G[self._rows] = gradients
        speed, mass = G @ rates, np.array(scalars.mass)
        along = -mass * (np.array(curved) + G[:, self.size :] @ laws[:, 2]) - np.array(scalars.damping) * speed
        for k, law in scalars.pushes:
            along[k] += law(t)
        for i, j, drag in scalars.drags:
            along[[i, j]] -= drag * np.hypot(speed[i], speed[j]) * speed[[i, j]]
        for (k, strength, width), gamma in zip(scalars.drives, driven, strict=True):
            along[k] += strength * (1 - (gamma / width) ** 2) * speed[k]
        force = G.T @ along - np.array(slopes)
        if self.modal is not None:
            force[: self.size] -= self.modal @ v
        return G.T @ (mass[:, None] * G), force

    @cached_property
    def _rows(self) -> tuple[Any, Any]:
        rows, columns = zip(*self._entries, strict=True)
        return np.array(rows), np.array(columns)

    @cached_property
    def modal(self) -> Floats | None:
        """M Φ diag(2 ζ ω) Φᵀ M of one damping ratio, at the drawn rest without dampers."""
        ratio = self.scene.damping_ratio
        if not ratio:
            return None
        q = np.array([float(self.drawn[x]) for x in self.z])
        free = self.z[: self.size]
        still = dict(zip(self.z, q.tolist(), strict=True))
        K = np.array(sp.hessian(self.V, free).subs(still).evalf(), dtype=float)
        G = np.array(sp.Matrix(self.scalars.s).jacobian(free).subs(still).evalf(), dtype=float)
        M = G.T @ (np.array(self.scalars.mass)[:, None] * G)
        squares, shapes = scipy.linalg.eigh(K, M)
        omega = np.sqrt(np.where(squares > 1e-9 * abs(squares).max(), squares, 0.0))
        return np.asarray(M @ shapes @ np.diag(2 * ratio * omega) @ shapes.T @ M)

    def unknowns(self, time: float, y: Floats) -> Floats:
        """Accelerations, and the push (N) of the rail upwards."""
        n = self.size
        M, force = self._instant(time, y[:n], y[n:])
        accelerations = np.linalg.solve(M[:n, :n], force[:n])
        return np.append(accelerations, force[n + 2] - M[n + 2, :n] @ accelerations)

    def answers(self, time: float, y: Floats, forces: Floats) -> Floats:
        """What these generalized forces (J, size) add to them."""
        n = self.size
        M, _ = self._instant(time, y[:n], y[n:])
        accelerations = np.linalg.solve(M[:n, :n], forces.T).T
        return np.column_stack((accelerations, -accelerations @ M[n + 2, :n]))

    def begin(self, start: State) -> Floats:
        """The y of a start."""
        carts = ([start.cart], [start.cart_rate]) if self.carried and not len(start.supports) else ([], [])
        q = [*start.supports, *carts[0], *start.links]
        return np.array([*q, *start.support_rates, *carts[1], *start.link_rates], dtype=float)

    def closed(self, y: Floats) -> Floats:
        """It has no constraints."""
        return y

    def read(self, y: Floats) -> State:
        """The state, the supports' coordinates as those of a structure."""
        n, d = self.size, self.carried
        return State(y[d:n], y[n + d :], supports=y[:d], support_rates=y[n : n + d])


class SwitchedPlaces(Switches):
    """The motion of a scene with contacts and clocks."""

    def __init__(self, scene: Scene, longest: float = LONGEST) -> None:
        places = Places(scene)
        unit, J, limits, kicked, drives = np.eye(places.size), [], [], [], []
        cart = scene.supports[0]
        rubs = [getattr(cart, name, 0.0) for name in ("friction", "friction_coefficient")]
        if any(rubs):
            J.append(unit[0])
            limits.append(rubs[0])
        for h in places.hung:
            row = unit[h.angle] - (0 if h.above is None else unit[h.above])
            if h.link.friction:
                J.append(row)
                limits.append(h.link.friction)
            if isinstance(h.link.drive, Escapement):
                kicked.append(row)
                drives.append((radians(h.link.drive.angle_deg), h.link.drive.impulse))
        shape = (-1, places.size)
        super().__init__(
            places,
            np.reshape(J, shape) if J else np.zeros((0, places.size)),
            np.array(limits),
            rubs[1],
            np.reshape(kicked, shape) if kicked else np.zeros((0, places.size)),
            *np.reshape(drives, (-1, 2)).T,
            sorted(places.breaks),
            longest,
        )
