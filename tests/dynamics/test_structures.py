"""Structures: equations against Newton's and Lagrange's laws from positions alone, and engines against each other."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest

from modal import Scene
from modal.scene import Bob, Body, Cart, Heave, ModalSupport, Platform, Rod, Swing, Tilt, scene_from
from modal.types import Floats
from nonlinear.dynamics import Generated, Minimal, Recursion
from nonlinear.system import State, System, initial_state, system_of

STEP = 1e-30


# ------------------------------------------------------------------------------- an oracle that knows positions alone


class Jet:
    """A number with its first two derivatives by the time."""

    def __init__(self, x: Any, v: Any = 0.0, a: Any = 0.0) -> None:
        self.x, self.v, self.a = x, v, a

    def __add__(self, other: Any) -> Jet:
        other = other if isinstance(other, Jet) else Jet(other)
        return Jet(self.x + other.x, self.v + other.v, self.a + other.a)

    def __mul__(self, other: Any) -> Jet:
        other = other if isinstance(other, Jet) else Jet(other)
        mixed = self.x * other.a + 2 * self.v * other.v + self.a * other.x
        return Jet(self.x * other.x, self.x * other.v + self.v * other.x, mixed)

    __radd__, __rmul__ = __add__, __mul__

    def sin(self) -> Jet:
        s, c = np.sin(self.x), np.cos(self.x)
        return Jet(s, c * self.v, c * self.a - s * self.v**2)

    def cos(self) -> Jet:
        s, c = np.sin(self.x), np.cos(self.x)
        return Jet(c, -s * self.v, -s * self.a - c * self.v**2)


class Oracle:
    """The places of a scene's points and centres as functions of q = (η, θ)."""

    def __init__(self, scene: Scene) -> None:
        self.scene, self.starts, at = scene, [], 0
        for support in scene.supports:
            self.starts.append(at)
            at += {"fixed": 0, "platform": 3}.get(support.kind, 1) if support.kind != "modal" else len(support.M)
        self.size = at
        self.pendula = [(p, copy) for p, one in enumerate(scene.pendulum) for copy in range(one.count)]
        self.first = {}
        for p, copy in self.pendula:
            self.first[p, copy] = at
            at += scene.pendulum[p].n_links
        self.half = at

    def carried(self, k: int, where: Any, q: Any) -> tuple[Any, Any, Any]:
        """A point of a carrier and its angle."""
        support, at = self.scene.supports[k], self.starts[k]
        x, z = support.position
        if isinstance(support, ModalSupport):
            point, eta = np.array(support.points[where]), q[at : at + len(support.M)]
            return (*(base + sum(s * e for s, e in zip(row, eta, strict=True)) for base, row in zip((x, z), point, strict=True)), 0.0)
        s, h, phi = *where, 0.0
        if isinstance(support, Cart):
            x = x + q[at]
        elif isinstance(support, Heave):
            z = z + -1.0 * q[at]
        elif isinstance(support, Swing):
            angle = q[at] * (1 / support.length)
            x, z = x + support.length * np.sin(angle), z + support.length * np.cos(angle) + -support.length
        elif isinstance(support, Tilt):
            phi = q[at]
        elif isinstance(support, Platform):
            x, z, phi = x + q[at], z + -1.0 * q[at + 1], q[at + 2]
        if isinstance(phi, float) and phi == 0.0:
            return x + s, z + h, phi
        S, C = np.sin(phi), np.cos(phi)
        return x + s * C + h * S, z + h * C + -s * S, phi

    def carrier(self, name: str) -> int:
        """The number of a support by its name."""
        return next(k for k, one in enumerate(self.scene.supports) if (one.name or one.kind) == name)

    def pivot(self, p: int, q: Any) -> tuple[Any, Any, Any]:
        """Where a pendulum hangs."""
        pendulum = self.scene.pendulum[p]
        name, _, point = (pendulum.on or "").partition("[")
        k = self.carrier(name) if name else 0
        return self.carried(k, int(point[:-1]) if point else pendulum.position, q)

    def link(self, p: int, copy: int, i: int, below: float | None, q: Any) -> tuple[Any, Any]:
        """A point of a link, by default its centre of mass."""
        (x, z, _), links, at = self.pivot(p, q), self.links(p), self.first[p, copy]
        for k in range(i + 1):
            reach = links[k].length if k < i else links[k].centre if below is None else below
            x, z = x + reach * np.sin(q[at + k]), z + reach * np.cos(q[at + k])
        return x, z

    def links(self, p: int) -> list[Bob | Rod | Body]:
        """Every link of a pendulum."""
        return [link for link in self.scene.pendulum[p].links for _ in range(link.count)]

    def bodies(self) -> Iterator[tuple[float, float, Callable[[Any], Any]]]:
        """Mass, inertia and (x, z, angle) of all that has mass, modal supports excepted."""
        for k, support in enumerate(self.scene.supports):
            if isinstance(support, Tilt | Platform):
                yield support.mass, support.inertia, lambda q, k=k, s=support: self.carried(k, s.centre, q)
            elif isinstance(support, Cart | Swing | Heave):
                yield support.mass, 0.0, lambda q, k=k: self.carried(k, (0.0, 0.0), q)
        for p, copy in self.pendula:
            for i, link in enumerate(self.links(p)):
                at = self.first[p, copy] + i
                yield (
                    link.mass,
                    link.inertia,
                    lambda q, p=p, c=copy, i=i, at=at: (*self.link(p, c, i, None, q), q[at]),
                )

    def slopes(self, function: Callable[[Any], Any], q: Floats) -> Any:
        """Derivatives by q, (..., half)."""
        columns = []
        for i in range(self.half):
            z = q.astype(complex)
            z[i] += 1j * STEP
            columns.append(np.imag(function(z)) / STEP)
        return np.stack(np.broadcast_arrays(*columns), axis=-1)

    def own(self, k: int) -> tuple[list[float], list[float]]:
        """Springs and dampers of a carrier."""
        support = self.scene.supports[k]
        if isinstance(support, Platform):
            return [getattr(support.stiffness, w) for w in ("sway", "heave", "roll")], [
                getattr(support.damping, w) for w in ("sway", "heave", "roll")
            ]
        return [getattr(support, "stiffness", 0.0)], [getattr(support, "damping", 0.0)]

    def weight(self, q: Any) -> Any:
        """Potential energy of gravity."""
        return sum(-self.scene.gravity * mass * place(q)[1] for mass, _, place in self.bodies())

    def angle_above(self, p: int, copy: int, i: int, q: Any) -> Any:
        """The angle of what link i hangs from."""
        return q[self.first[p, copy] + i - 1] if i else self.pivot(p, q)[2]

    def ends(self, spring: Any) -> Iterator[tuple[Callable[[Any], Any], Callable[[Any], Any]]]:
        """The two ends of a spring, (x, z, angle) each, copies pairwise."""
        sides = [list(self.end(text)) for text in spring.between]
        count = max(map(len, sides))
        one, other = (side * count if len(side) == 1 else side for side in sides)
        for a, b in zip(one, other, strict=True):
            yield a or (lambda q, b=b: (*b(0.0 * q)[:2], 0.0)), b or (lambda q, a=a: (*a(0.0 * q)[:2], 0.0))

    def end(self, text: str) -> Iterator[Any]:
        """Functions for a point; None for the ground at the other end."""
        head, _, at = text.partition("@")
        place = tuple(float(part) for part in at.split(",")) if at else ()
        if head == "ground":
            yield (lambda q: (*place, 0.0)) if place else None
        elif head.startswith("pendulum"):
            p, *copy, i = [int(part.split("]")[0]) for part in head.split("[")[1:]]
            for number in copy or range(self.scene.pendulum[p].count):
                row = self.first[p, number] + i
                yield lambda q, n=number, row=row: (*self.link(p, n, i, place[0] if place else None, q), q[row])
        else:
            name, _, point = head.partition("[")
            k = self.carrier(name)
            yield lambda q: self.carried(k, int(point[:-1]) if point else (place or (0.0, 0.0)), q)

    def strains(self, q: Any) -> Iterator[tuple[float, float, Callable[[Any], Any]]]:
        """k, d and what is stretched, of every spring that has an energy k e²/2: of slack ones both components."""
        for spring in self.scene.spring:
            for a, b in self.ends(spring):
                k, d = spring.stiffness, spring.damping
                if spring.kind == "torsion":
                    yield k, d, lambda q, a=a, b=b: b(q)[2] - a(q)[2]
                    continue
                none = np.zeros(self.half)
                rest = np.hypot(b(none)[0] - a(none)[0], b(none)[1] - a(none)[1])
                if rest == 0:
                    yield from ((k, d, lambda q, a=a, b=b, w=w: b(q)[w] - a(q)[w]) for w in (0, 1))
                else:
                    yield k, d, lambda q, a=a, b=b, r=rest: np.sqrt(
                        (b(q)[0] - a(q)[0]) ** 2 + (b(q)[1] - a(q)[1]) ** 2
                    ) - r
        for p, copy in self.pendula:
            for i, link in enumerate(self.links(p)):
                at = self.first[p, copy] + i
                yield link.stiffness, link.damping, lambda q, p=p, c=copy, i=i, at=at: q[at] - self.angle_above(p, c, i, q)
        for k, support in enumerate(self.scene.supports):
            if not isinstance(support, ModalSupport):
                for j, (stiff, damp) in enumerate(zip(*self.own(k), strict=True)):
                    if self.starts[k] + j < self.size:
                        yield stiff, damp, lambda q, at=self.starts[k] + j: q[at]

    def potential(self, q: Any) -> Any:
        """Gravity, springs, and what springs of carriers carry at the drawn rest."""
        drawn = np.zeros(self.half)
        found = self.weight(q) + sum(k * strain(q) ** 2 / 2 for k, _, strain in self.strains(q))
        carried = self.slopes(self.weight, drawn)
        for k, support in enumerate(self.scene.supports):
            at = self.starts[k]
            if isinstance(support, ModalSupport):
                eta = q[at : at + len(support.M)]
                found = found + eta @ np.array(support.K) @ eta / 2
                found = found - carried[at : at + len(eta)] @ eta
                continue
            for j, stiff in enumerate(self.own(k)[0]):
                if stiff:
                    found = found - carried[at + j] * q[at + j]
        return found

    def residual(self, q: Floats, v: Floats, a: Floats) -> Floats:
        """Σ m r''·∂r/∂q + Σ I φ'' ∂φ/∂q + ∂V/∂q + forces of dampers and drag, (half,): 0 for a motion."""
        jets = np.array([Jet(*own) for own in zip(q, v, a, strict=True)], dtype=object)
        found = self.slopes(self.potential, q)
        for mass, moment, place in self.bodies():
            J = self.slopes(lambda z, place=place: np.array(place(z)), q)
            moved = [part if isinstance(part, Jet) else Jet(part) for part in place(jets)]
            for weight, row, part in zip((mass, mass, moment), J, moved, strict=True):
                found = found + weight * part.a * row
        for _, d, strain in self.strains(q):
            row = self.slopes(strain, q)
            found = found + d * (row @ v) * row
        for p, copy in self.pendula:
            for i, link in enumerate(self.links(p)):
                if link.drag:
                    J = self.slopes(lambda z, p=p, c=copy, i=i: np.array(self.link(p, c, i, None, z)), q)
                    found = found + link.drag * J.T @ (J @ v)
        for k, support in enumerate(self.scene.supports):
            if isinstance(support, ModalSupport):
                own = slice(self.starts[k], self.starts[k] + len(support.M))
                found[own] += np.array(support.M) @ a[own]
                if support.D is not None:
                    found[own] += np.array(support.D) @ v[own]
        return found


# ----------------------------------------------------------------------------------------------------------- scenes

ROD, BOB = {"kind": "rod", "mass": 1.0, "length": 0.7}, {"kind": "bob", "mass": 0.6, "length": 0.9}
EVERYTHING: dict[str, Any] = {
    "gravity": 9.81,
    "support": [
        {"kind": "swing", "name": "a", "mass": 5.0, "length": 2.0, "damping": 0.3},
        {
            "kind": "tilt",
            "name": "b",
            "mass": 4.0,
            "inertia": 0.7,
            "centre": [0.05, 0.2],
            "position": [2.0, 0.3],
            "stiffness": 30.0,
            "damping": 0.2,
        },
        {
            "kind": "platform",
            "name": "c",
            "mass": 4.0,
            "inertia": 0.7,
            "centre": [0.05, 0.2],
            "position": [4.0, 0.3],
            "stiffness": {"sway": 50.0, "heave": 300.0, "roll": 30.0},
            "damping": {"sway": 1.0, "heave": 1.0, "roll": 0.2},
        },
        {"kind": "heave", "name": "d", "mass": 2.0, "stiffness": 300.0, "position": [6.0, 0.0]},
        {"kind": "cart", "name": "e", "mass": 2.0, "stiffness": 30.0, "position": [7.0, 0.0]},
        {"kind": "fixed", "name": "f", "position": [8.0, 0.0]},
        {
            "kind": "modal",
            "name": "g",
            "M": [[2.0, 0.3], [0.3, 1.5]],
            "K": [[60.0, 4.0], [4.0, 90.0]],
            "D": [[0.2, 0.0], [0.0, 0.3]],
            "points": [[[1.0, 0.2], [0.1, 0.6]], [[0.5, -0.4], [0.0, 1.0]]],
            "position": [9.0, 0.0],
        },
    ],
    "pendulum": [
        {"on": "a", "count": 2, "links": [{**BOB, "stiffness": 0.3, "damping": 0.1, "drag": 0.1}, {**ROD, "stiffness": 0.2}]},
        {"on": "b", "position": [0.3, 0.2], "links": [{**ROD, "stiffness": 2.0, "damping": 0.1}]},
        {"on": "b", "position": [-0.4, 0.1], "count": 2, "links": [{**ROD, "damping": 0.1, "drag": 0.2}]},
        {"on": "c", "position": [-0.4, 0.1], "links": [{**ROD, "damping": 0.1}, {**ROD, "stiffness": 3.0}]},
        {"on": "d", "links": [{**ROD, "damping": 0.1}]},
        {"on": "e", "links": [{**BOB, "damping": 0.1}]},
        {"on": "f", "links": [{**BOB, "damping": 0.1}]},
        {"on": "g[1]", "links": [{**BOB, "damping": 0.1}]},
        {"on": "g[0]", "links": [BOB]},
    ],
    "spring": [
        {"between": ["a@0.1,0.2", "b@0.1,0.3"], "stiffness": 20.0, "damping": 0.5},
        {"between": ["pendulum[0].links[1]@0.3", "pendulum[1].links[0]@0.5"], "stiffness": 7.0, "damping": 0.2},
        {"between": ["pendulum[2].links[0]", "ground"], "stiffness": 4.0, "damping": 0.2},
        {"between": ["pendulum[3].links[1]", "pendulum[2].copies[1].links[0]"], "stiffness": 4.0, "damping": 0.2},
        {"between": ["pendulum[3].links[1]", "c"], "kind": "torsion", "stiffness": 4.0, "damping": 0.2},
        {"between": ["e", "ground@7.5,0.4"], "stiffness": 4.0, "damping": 0.2},
        {"between": ["g[1]", "pendulum[6].links[0]@0.2"], "stiffness": 4.0, "damping": 0.2},
    ],
}


def everything() -> Scene:
    """Carriers of every kind, joined by springs."""
    return scene_from(EVERYTHING)


def shaken(system: System, seed: int, size: float = 0.8) -> Floats:
    """A random large q and v."""
    return size * np.random.default_rng(seed).normal(size=2 * (system.first + system.n_links))


def plain(system: System) -> Minimal:
    """The equations by the recursion in NumPy."""
    return Minimal(system, tuple(Recursion(group) for group in system.groups))


@pytest.mark.parametrize("seed", range(3))
def test_accelerations_obey_newton_and_lagrange(seed: int) -> None:
    scene = everything()
    system, oracle = system_of(scene), Oracle(scene)
    half = oracle.half
    y = np.append(shaken(system, seed), 0.0)
    rates = plain(system).derivative(0.0, y)
    residual = oracle.residual(y[:half], y[half : 2 * half], rates[half : 2 * half])
    forces = oracle.residual(y[:half], y[half : 2 * half], 0 * rates[:half])
    assert np.abs(residual).max() < 1e-13 * np.abs(forces).max()
    assert np.abs(oracle.residual(y[:half], y[half : 2 * half], 1.001 * rates[half : 2 * half])).max() > 1e-4
