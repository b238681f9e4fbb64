"""Structures: equations against Newton's and Lagrange's laws from positions alone, and engines against each other."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import nullcontext
from typing import Any

import numpy as np
import pytest
from support.amounts import usually
from support.uncompiled import uncompiled

from modal import Scene
from modal import load as load_scene
from modal.scene import Bob, Body, Cart, Heave, ModalSupport, Platform, Rod, Swing, Tilt, scene_from
from modal.types import Floats
from nonlinear import load as load_run
from nonlinear import save, simulate
from nonlinear.dynamics import Generated, Lanes, Minimal, Recursion
from nonlinear.dynamics.mechanics import energies
from nonlinear.dynamics.variational import Variational
from nonlinear.ensembles import ensemble
from nonlinear.integration import taylor
from nonlinear.postprocessing import reaction_forces_of
from nonlinear.system import AppliedForces, Numbers, State, System, initial_state, numbers_of, system_of, system_with

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
        self.pendula = [(p, copy) for p, pendulum in enumerate(scene.pendulum) for copy in range(pendulum.count)]
        self.first = {}
        for p, copy in self.pendula:
            self.first[p, copy] = at
            at += scene.pendulum[p].n_links
        self.half = at

    def carried(self, k: int, where: Any, q: Any) -> tuple[Any, Any, Any]:
        """A point of a support and its angle."""
        support, at = self.scene.supports[k], self.starts[k]
        x, z = support.position
        if isinstance(support, ModalSupport):
            point, eta = np.array(support.points[where]), q[at : at + len(support.M)]
            moved = [sum(s * e for s, e in zip(row, eta, strict=True)) for row in point]
            return x + moved[0], z + moved[1], 0.0
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
        return next(k for k, support in enumerate(self.scene.supports) if (support.name or support.kind) == name)

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

    def constants(self, k: int) -> tuple[list[float], list[float]]:
        """Springs and dampers of a support."""
        support, ways = self.scene.supports[k], ("sway", "heave", "roll")
        if isinstance(support, Platform):
            stiffness, damping = (
                [getattr(each_way, w) for w in ways] for each_way in (support.stiffness, support.damping)
            )
            return stiffness, damping
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
        left, other = (side * count if len(side) == 1 else side for side in sides)
        for a, b in zip(left, other, strict=True):
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
                    yield (
                        k,
                        d,
                        lambda q, a=a, b=b, r=rest: np.sqrt((b(q)[0] - a(q)[0]) ** 2 + (b(q)[1] - a(q)[1]) ** 2) - r,
                    )
        for p, copy in self.pendula:
            for i, link in enumerate(self.links(p)):
                at = self.first[p, copy] + i
                bend = lambda q, p=p, c=copy, i=i, at=at: q[at] - self.angle_above(p, c, i, q)  # noqa: E731
                yield link.stiffness, link.damping, bend
        for k, support in enumerate(self.scene.supports):
            if not isinstance(support, ModalSupport):
                for j, (stiff, damp) in enumerate(zip(*self.constants(k), strict=True)):
                    if self.starts[k] + j < self.size:
                        yield stiff, damp, lambda q, at=self.starts[k] + j: q[at]

    def potential(self, q: Any) -> Any:
        """Gravity, springs, and what springs of supports carry at the drawn rest."""
        drawn = np.zeros(self.half)
        total = self.weight(q) + sum(k * strain(q) ** 2 / 2 for k, _, strain in self.strains(q))
        carried = self.slopes(self.weight, drawn)
        for k, support in enumerate(self.scene.supports):
            at = self.starts[k]
            if isinstance(support, ModalSupport):
                eta = q[at : at + len(support.M)]
                total = total + eta @ np.array(support.K) @ eta / 2
                total = total - carried[at : at + len(eta)] @ eta
                continue
            for j, stiff in enumerate(self.constants(k)[0]):
                if stiff:
                    total = total - carried[at + j] * q[at + j]
        return total

    def residual(self, q: Floats, v: Floats, a: Floats) -> Floats:
        """Σ m r''·∂r/∂q + Σ I φ'' ∂φ/∂q + ∂V/∂q + forces of dampers and drag, (half,): 0 for a motion."""
        jets = np.array([Jet(*triple) for triple in zip(q, v, a, strict=True)], dtype=object)
        forces = self.slopes(self.potential, q)
        for mass, moment, place in self.bodies():
            J = self.slopes(lambda z, place=place: np.array(place(z)), q)
            moved = [part if isinstance(part, Jet) else Jet(part) for part in place(jets)]
            for weight, row, part in zip((mass, mass, moment), J, moved, strict=True):
                forces = forces + weight * part.a * row
        for _, d, strain in self.strains(q):
            row = self.slopes(strain, q)
            forces = forces + d * (row @ v) * row
        for p, copy in self.pendula:
            for i, link in enumerate(self.links(p)):
                if link.drag:
                    J = self.slopes(lambda z, p=p, c=copy, i=i: np.array(self.link(p, c, i, None, z)), q)
                    forces = forces + link.drag * J.T @ (J @ v)
        for k, support in enumerate(self.scene.supports):
            if isinstance(support, ModalSupport):
                rows = slice(self.starts[k], self.starts[k] + len(support.M))
                forces[rows] += np.array(support.M) @ a[rows]
                if support.D is not None:
                    forces[rows] += np.array(support.D) @ v[rows]
        return forces


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
        {
            "on": "a",
            "count": 2,
            "links": [{**BOB, "stiffness": 0.3, "damping": 0.1, "drag": 0.1}, {**ROD, "stiffness": 0.2}],
        },
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


# ----------------------------------------------------------------------------------------------------------- engines


def without(names: set[str], entries: Any) -> Any:
    """A description without some keys."""
    if isinstance(entries, dict):
        return {key: without(names, entry) for key, entry in entries.items() if key not in names}
    return [without(names, entry) for entry in entries] if isinstance(entries, list) else entries


def varied(
    more: Callable[[dict[str, Any]], None] = lambda d: None, *, lossless: bool = False, modal: bool = True
) -> Scene:
    """The scene of everything with starts and changes."""
    entries = without({"damping", "drag", "D"} if lossless else set(), EVERYTHING)
    if not modal:
        entries["support"], entries["pendulum"], entries["spring"] = (
            entries[name][:-n] for name, n in (("support", 1), ("pendulum", 2), ("spring", 1))
        )
    for k, pendulum in enumerate(entries["pendulum"]):
        pendulum["start"] = {"angles_deg": [20.0 + 5.0 * k] * len(pendulum["links"])}
    more(entries)
    return scene_from(entries)


def test_what_is_written_equals_the_recursion() -> None:
    system = system_of(everything())
    y = np.append(shaken(system, 5), 0.0)
    np.testing.assert_allclose(
        Generated(system).derivative(0.0, y), plain(system).derivative(0.0, y), rtol=0, atol=1e-12
    )


@pytest.mark.parametrize("way", usually([uncompiled], [uncompiled, nullcontext]))
def test_loops_for_numba_equal_the_recursion(way: Any) -> None:
    """As Python runs them, and compiled, which takes ten seconds."""
    pytest.importorskip("numba")
    from nonlinear.dynamics.compiled import Compiled

    system = system_of(varied(lambda d: [p["links"][0].pop("drag", None) for p in d["pendulum"]], modal=False))
    y = np.append(shaken(system, 7), 0.0)
    expected = plain(system).derivative(0.0, y)
    with way():
        np.testing.assert_allclose(Compiled(system).derivative(0.0, y), expected, rtol=0, atol=1e-11)


def test_two_threads_that_run_one_system_get_the_results_of_one() -> None:
    """The loops as Python runs them, which changes threads between any two operations."""
    pytest.importorskip("numba")
    from nonlinear.dynamics.compiled import Compiled

    system = system_of(varied(lambda d: [p["links"][0].pop("drag", None) for p in d["pendulum"]], modal=False))
    starts, interval = [np.append(shaken(system, seed), 0.0) for seed in (7, 8)], sys.getswitchinterval()
    with uncompiled():
        equations = Compiled(system)
        alone = [equations.derivative(0.0, y) for y in starts]
        sys.setswitchinterval(1e-6)
        try:
            with ThreadPoolExecutor(2) as threads:
                together = list(threads.map(lambda y: [equations.derivative(0.0, y) for _ in range(40)], starts))
        finally:
            sys.setswitchinterval(interval)
    for expected, rates in zip(alone, together, strict=True):
        assert all(np.array_equal(expected, rate) for rate in rates)


def test_members_with_numbers_of_their_own() -> None:
    scene = varied(modal=False)
    system, numbers = system_of(scene), numbers_of(scene)
    entries = [np.array([e, 1.1 * e]) if e and k % 3 == 0 else e for k, e in enumerate(numbers.entries)]
    lanes = Lanes(Numbers(system, tuple(entries)))
    y = np.random.default_rng(1).normal(size=(lanes.layout.size, 2))
    written = np.array(lanes.rates(lanes.numbers)(y))
    lanes.__dict__["is_written"] = False
    np.testing.assert_allclose(lanes.rates(lanes.numbers)(y), written, rtol=0, atol=1e-11)
    member = system_with(system, [float(e[1]) if isinstance(e, np.ndarray) else e for e in entries])
    np.testing.assert_allclose(plain(member).derivative(0.0, y[:, 1].copy()), written[:, 1], rtol=0, atol=1e-11)


def test_jacobian_and_slope_of_the_energy_by_complex_steps() -> None:
    system = system_of(everything())
    equations = Variational(system)
    y, size = shaken(system, 2), equations.size
    steps = [y + 1j * STEP * unit for unit in np.eye(size)]
    J = np.array([plain(system).derivative(0.0, np.append(step, 0.0))[:size].imag / STEP for step in steps]).T
    np.testing.assert_allclose(equations.linearize(y)[1], J, rtol=0, atol=1e-12 * np.abs(J).max())
    half = size // 2
    slope = np.array([np.imag(energies(system, step[:half], step[half:]).total) / STEP for step in steps])
    np.testing.assert_allclose(equations.energy_slope(y), slope, rtol=0, atol=1e-12 * np.abs(slope).max())


def forced(d: dict[str, Any]) -> None:
    sine = {"kind": "sine", "amplitude": 3.0, "frequency_hz": 0.7}
    d["force"] = [
        {"on": "b@0.3,0.1", "direction": "vertical", **sine},
        {"on": "c", "direction": "torque", **sine},
        {"on": "pendulum[1].links[0]", "direction": "torque", **sine},
        {"on": "pendulum[0].links[1]@0.2", "direction": "horizontal", **sine},
    ]


def grounded(d: dict[str, Any]) -> None:
    sine = {"kind": "sine", "amplitude": 0.05, "frequency_hz": 0.9}
    d["ground"] = {"motion": [{"direction": "horizontal", **sine}, {"direction": "vertical", **sine}]}


def damped(d: dict[str, Any]) -> None:
    d["damping_ratio"] = 0.02


def driven(d: dict[str, Any]) -> None:
    d["pendulum"][1]["links"][0]["drive"] = {"kind": "van-der-pol", "strength": 0.3, "angle_deg": 20.0}


def kicked(d: dict[str, Any]) -> None:
    d["pendulum"][1]["links"][0]["drive"] = {"kind": "escapement", "impulse": 0.03, "angle_deg": 10.0}


def hoisted(d: dict[str, Any]) -> None:
    d["spring"].pop(1)
    d["pendulum"][1]["links"][0] = {**BOB, "hoist": {"to": 0.5, "begin": 0.1, "duration": 1.5}}


@pytest.mark.parametrize("change", [forced, grounded, damped, driven, kicked, hoisted])
def test_energy_and_work_agree_whatever_acts(change: Callable[[dict[str, Any]], None]) -> None:
    scene = varied(change, modal=False)
    run = simulate(scene, 1.5, tolerance=1e-10, method="DOP853", output=9)
    assert run.energy_drift() < 1e-8
    if change is kicked:
        assert len(run.kicks.time) > 0
        return
    other = simulate(scene, 1.5, tolerance=1e-10, method="LSODA", output=9)
    np.testing.assert_allclose(run.motion.supports[-1], other.motion.supports[-1], rtol=0, atol=1e-8)


def test_energy_is_kept_without_losses() -> None:
    run = simulate(varied(lossless=True), 2.0, tolerance=1e-10, output=5)
    assert run.energy_drift() < 1e-9
    assert not run.motion.work.any()


@pytest.mark.skipif(not taylor.available(), reason="heyoka is not installed")
def test_series_agree_with_steps() -> None:
    scene = load_scene("two-bobs")
    run, other = (simulate(scene, 3.0, tolerance=1e-12, output=5, method=name) for name in ("taylor", "DOP853"))
    np.testing.assert_allclose(run.motion.links, other.motion.links, rtol=0, atol=1e-10)


def test_loads_push_carriers() -> None:
    scene = varied(modal=False)
    size = system_of(scene).first

    def load(time: float, state: State) -> AppliedForces:
        return AppliedForces(supports=np.arange(float(size)) * np.sin(time), moments=0.1 * np.ones(len(state.links)))

    assert simulate(scene, 1.0, tolerance=1e-10, load=load, breaks=[]).energy_drift() < 1e-8


def test_carriers_obey_newton_with_the_forces_of_their_pivots() -> None:
    scene = varied()
    run = simulate(scene, 1.0, output=3)
    system, motion = run.system, run.motion
    place = system.labels.index("d_m")
    link = system.labels.index("theta[7,1]") - system.first
    rates = plain(system).derivative(1.0, run.equations.layout.begin(motion[-1]))  # type: ignore[union-attr]
    heave = rates[system.first + system.n_links + place]
    pull = reaction_forces_of(run).pivots[-1, link, 1]
    assert 2.0 * heave == pytest.approx(-300.0 * motion.supports[-1, place] + 1.0 * 9.81 + pull, rel=1e-12)


@pytest.mark.parametrize("suffix", ["npz", "csv"])
def test_runs_are_read_back(suffix: str, tmp_path: Any) -> None:
    run = simulate(varied(), 0.5, output=4)
    save(run, tmp_path / f"run.{suffix}")
    loaded = load_run(tmp_path / f"run.{suffix}")
    for name in ("links", "supports", "support_rates", "work"):
        np.testing.assert_array_equal(getattr(loaded.motion, name), getattr(run.motion, name))
    columns = run.to_dict()
    assert {"a_m", "b_rad", "c_heave_m", "c_roll_rad_per_s", "g_2", "spring_force_N[0]", "spring_torque_N_m[6]"} <= set(
        columns
    )
    np.testing.assert_array_equal(columns["a_m_per_s"], run.motion.support_rates[:, 0])


# ------------------------------------------------------------------------------------------------------ known motions


def test_a_swing_is_a_cart_for_small_motions() -> None:
    pendulum = {"count": 2, "links": [BOB], "start": {"angles_deg": [1e-3]}}
    stiffness = (5.0 + 2 * 0.6) * 9.81 / 2.0
    swinging = scene_from(
        {"gravity": 9.81, "support": {"kind": "swing", "mass": 5.0, "length": 2.0}, "pendulum": [pendulum]}
    )
    other = scene_from(
        {"gravity": 9.81, "support": {"kind": "cart", "mass": 5.0, "stiffness": stiffness}, "pendulum": [pendulum]}
    )
    swing, cart = (simulate(scene, 5.0, tolerance=1e-12, output=9) for scene in (swinging, other))
    np.testing.assert_allclose(
        swing.motion.supports[:, 0], cart.motion.cart, rtol=0, atol=1e-9 * np.ptp(cart.motion.cart)
    )


def test_one_cart_with_a_spring_to_the_ground_is_a_cart_with_stiffness() -> None:
    pendulum = {"count": 2, "links": [BOB, ROD], "start": {"angles_deg": [50.0, -30.0]}}
    held = scene_from(
        {"gravity": 9.81, "support": {"kind": "cart", "mass": 2.0, "stiffness": 30.0}, "pendulum": [pendulum]}
    )
    spring = [{"between": ["cart", "ground"], "stiffness": 30.0}]
    free = scene_from(
        {"gravity": 9.81, "support": {"kind": "cart", "mass": 2.0}, "pendulum": [pendulum], "spring": spring}
    )
    run, other = (simulate(scene, 3.0, tolerance=1e-11, output=9) for scene in (held, free))
    np.testing.assert_allclose(other.motion.supports[:, 0], run.motion.cart, rtol=0, atol=1e-8)
    np.testing.assert_allclose(other.motion.links, run.motion.links, rtol=0, atol=1e-7)


def test_starts_are_spread_over_the_phases_of_the_first_mode() -> None:
    start = {"angles_deg": [20.0], "spread": True}
    scene = scene_from({"gravity": 9.81, "pendulum": [{"count": 4, "links": [{**BOB, "length": 0.5}], "start": start}]})
    state, omega = initial_state(scene), np.sqrt(9.81 / 0.5)
    np.testing.assert_allclose(np.degrees(state.links), [20.0, 0.0, -20.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(np.degrees(state.link_rates), [0.0, -20.0 * omega, 0.0, 20.0 * omega], atol=1e-9)


def test_supports_start_where_they_are_told() -> None:
    def started(d: dict[str, Any]) -> None:
        d["support"][1]["start"] = {"angle_deg": 10.0, "rate_deg": -5.0}
        d["support"][2]["start"] = {"sway": 0.1, "roll_deg": 3.0, "heave_rate": 0.2}
        d["support"][6]["start"] = {"displacements": [0.01, 0.02]}

    state = initial_state(varied(started))
    np.testing.assert_allclose(state.supports, [0, np.radians(10.0), 0.1, 0, np.radians(3.0), 0, 0, 0.01, 0.02])
    np.testing.assert_allclose(state.support_rates[[1, 3]], [np.radians(-5.0), 0.2])


def test_members_side_by_side_are_runs_by_themselves() -> None:
    scene = varied(modal=False)
    runs = ensemble(
        scene,
        1.0,
        vary={"support.b.stiffness": [30.0, 40.0], "spring[0].stiffness": [20.0, 10.0]},
        engine="numpy",
        workers=1,
        check=2,
    )
    assert not runs.failures
    assert runs.largest_difference < 1e-9
    assert runs.final.supports.shape == (2, 7)
