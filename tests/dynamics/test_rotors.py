"""Rotors at joints: their inertia J on the turn of one link against the one above, in every form of the equations."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import scipy
import sympy as sp
from scenes import geared, plane_scene
from support.dense_form import DenseForm
from support.places import SwitchedPlaces
from support.uncompiled import uncompiled

from modal import Bob, Cart, Pendulum, Rod, Scene
from modal.errors import SceneError
from modal.scene import InitialCondition, scene_from
from modal.types import Floats
from nonlinear import simulate
from nonlinear.dynamics import Generated, Minimal, Recursion
from nonlinear.dynamics.compiled import Compiled
from nonlinear.dynamics.elimination import Elimination
from nonlinear.system import initial_state, system_of

MOTOR: dict[str, Any] = {"rotor_inertia": 6.3e-5, "gear_ratio": 36.0}
"""J = 0.081648 kg m²."""


def arm(**numbers: Any) -> Scene:
    """A rod and a bob with motors on a cart, released from rest."""
    first = Rod(mass=0.4, length=0.5, **MOTOR)
    second = Bob(mass=0.3, length=0.4, rotor_inertia=1e-4, gear_ratio=30.0)
    pendulum = Pendulum(links=[first, second], start=InitialCondition(angles_deg=[40.0, -30.0], rates_deg=[0.0, 90.0]))
    return Scene(gravity=9.81, support=Cart(mass=1.0), pendulum=[pendulum], **numbers)


def own_lagrangian() -> Any:
    """x'', θ1'', θ2'' of the arm by (q, q'), from T and V written by hand."""
    t = sp.Symbol("t")
    x, a, b = (sp.Function(name)(t) for name in "xab")
    q = [x, a, b]
    rod, bob, g = sp.Rational(4, 10), sp.Rational(3, 10), sp.Rational(981, 100)
    l, r = sp.Rational(5, 10), sp.Rational(4, 10)
    middle = x + l / 2 * sp.sin(a), l / 2 * sp.cos(a)
    end = x + l * sp.sin(a) + r * sp.sin(b), l * sp.cos(a) + r * sp.cos(b)

    def moving(mass: Any, place: tuple[Any, Any]) -> Any:
        return mass * sum(sp.diff(part, t) ** 2 for part in place) / 2

    spin = sp.Rational(63, 10**6) * 36**2, sp.Rational(1, 10**4) * 30**2
    T = sp.diff(x, t) ** 2 / 2 + moving(rod, middle) + rod * l**2 / 24 * sp.diff(a, t) ** 2 + moving(bob, end)
    T += spin[0] * sp.diff(a, t) ** 2 / 2 + spin[1] * (sp.diff(b, t) - sp.diff(a, t)) ** 2 / 2
    L = T + g * (rod * middle[1] + bob * end[1])
    rows = [sp.diff(sp.diff(L, sp.diff(c, t)), t) - sp.diff(L, c) for c in q]
    names = [sp.symbols(f"{letter}:3") for letter in "qva"]
    for order, row in ((2, names[2]), (1, names[1]), (0, names[0])):
        rows = [
            form.subs({sp.diff(c, t, order) if order else c: s for c, s in zip(q, row, strict=True)}) for form in rows
        ]
    M, force = sp.linear_eq_to_matrix(rows, names[2])
    return sp.lambdify([names[0], names[1]], [M, force], "numpy")


def test_the_motion_of_an_arm_is_that_of_its_lagrangian() -> None:
    equations = own_lagrangian()

    def rates(_: float, y: Floats) -> Floats:
        M, force = equations(y[:3], y[3:])
        return np.append(y[3:], np.linalg.solve(M, np.ravel(force)))

    start = [0.0, *np.radians([40.0, -30.0]), 0.0, 0.0, np.pi / 2]
    end = scipy.integrate.solve_ivp(rates, (0.0, 3.0), start, method="DOP853", rtol=1e-12, atol=1e-12).y[:, -1]
    for options in ({}, {"method": "Radau"}, {"form": "maximal"}, {"form": "hamiltonian"}):
        run = simulate(arm(), 3.0, output=2, tolerance=1e-11, **options)
        assert [run.final.cart, *run.final.links] == pytest.approx(end[:3], abs=1e-8)
        assert run.energy_drift() < 1e-9
    pytest.importorskip("heyoka")
    run = simulate(arm(), 3.0, output=2, tolerance=1e-13, method="taylor")
    assert [run.final.cart, *run.final.links] == pytest.approx(end[:3], abs=1e-9)


@pytest.mark.parametrize("seed", range(15))
def test_every_body_answers_as_the_dense_matrix(seed: int) -> None:
    """Fixed supports and carts, light and massless, with springs, dampers and inverted links."""
    system = system_of(geared(plane_scene(seed), seed))
    dense = DenseForm(system)
    y = np.random.default_rng(seed).normal(size=dense.layout.size)
    expected = dense.derivative(0.0, y)
    bodies = (tuple(map(kind, system.groups)) for kind in (Recursion, Elimination))
    with uncompiled():
        for each in (*(Minimal(system, groups) for groups in bodies), Generated(system), Compiled(system)):
            assert np.abs(each.derivative(0.0, y) - expected).max() < 1e-13 * np.abs(expected).max()


def test_a_chain_of_a_thousand_takes_one_pass_up_and_one_down() -> None:
    links = [Rod(mass=1.0, length=0.1, rotor_inertia=1e-4, gear_ratio=30.0, count=1000)]
    system = system_of(Scene(gravity=9.81, support=Cart(mass=3.0), pendulum=[Pendulum(links=links)]))
    dense = DenseForm(system)
    y = np.random.default_rng(1).normal(size=dense.layout.size) * 0.3
    expected = dense.derivative(0.0, y)
    answer = Minimal(system, tuple(map(Recursion, system.groups))).derivative(0.0, y)
    assert np.abs(answer - expected).max() < 1e-11 * np.abs(expected).max()


@pytest.mark.parametrize("decades", [-12, 12])
def test_a_rotor_of_no_weight_or_immense_leaves_or_locks_its_joint(decades: int) -> None:
    """Locked, both links turn as one body; light ones move as without."""
    start = InitialCondition(angles_deg=[50.0, 50.0])
    heavy = Bob(mass=0.3, length=0.4, rotor_inertia=10.0**decades)
    free = Scene(gravity=9.81, pendulum=[Pendulum(links=[Rod(mass=0.4, length=0.5), heavy], start=start)])
    links = simulate(free, 2.0, output=2, tolerance=1e-11).final.links
    if decades < 0:
        bare = free.replace(
            pendulum=[free.pendulum[0].replace(links=(free.pendulum[0].links[0], Bob(mass=0.3, length=0.4)))]
        )
        assert links == pytest.approx(simulate(bare, 2.0, output=2, tolerance=1e-11).final.links, abs=1e-9)
        return
    moment, inertia = 0.4 * 0.25 + 0.3 * 0.9, 0.4 * 0.25 / 3 + 0.3 * 0.81
    locked = scipy.integrate.solve_ivp(
        lambda _, y: [y[1], -9.81 * moment / inertia * np.sin(y[0])],
        (0, 2),
        [np.radians(50), 0],
        rtol=1e-12,
        atol=1e-12,
    )
    assert links == pytest.approx([locked.y[0, -1]] * 2, abs=1e-8)


TILTED: dict[str, Any] = {
    "gravity": 9.81,
    "support": [{"kind": "tilt", "name": "a", "mass": 1.0, "inertia": 0.4, "stiffness": 20.0, "centre": [0.1, 0.2]}],
}
CASES: dict[str, dict[str, Any]] = {
    "a carrier that turns": {**TILTED},
    "friction": {"gravity": 9.81, "support": {"kind": "cart", "mass": 1.0, "friction": 0.3}},
    "a rope that is wound": {"gravity": 9.81, "support": {"kind": "cart", "mass": 1.0}},
}


@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("n", [2, 7])
def test_motions_are_those_of_the_places_of_all_masses(name: str, n: int) -> None:
    """Of chains that are eliminated, and of those that take the recursion."""
    rng = np.random.default_rng(n)
    links = [{"kind": "rod", "mass": m, "length": l, **MOTOR} for m, l in rng.uniform(0.3, 0.8, (n, 2)).tolist()]
    if name == "friction":
        links = [{**link, "friction": 0.05} for link in links]
    if name == "a rope that is wound":
        links[1] |= {"kind": "bob", "hoist": {"to": 0.9, "duration": 0.5}}
    start = {"angles_deg": rng.uniform(-50, 50, n).tolist()}
    scene = scene_from({**CASES[name], "pendulum": [{"links": links, "start": start}]})
    end = SwitchedPlaces(scene, 0.02).end(initial_state(scene), 0.2, 1e-11)
    mine = simulate(scene, 0.2, output=2, tolerance=1e-11).final
    assert mine.links == pytest.approx(end.links, abs=1e-9)


def test_what_rotors_do_not_meet_is_said() -> None:
    data = {
        "gravity": 9.81,
        "space": "space",
        "pendulum": [{"links": [{"kind": "bob", "mass": 1, "length": 1, **MOTOR}]}],
    }
    with pytest.raises(SceneError, match=r"rotor_inertia|a rotor turns about one"):
        simulate(scene_from(data), 1.0)
    link = {"kind": "bob", "mass": 1.0, "length": 1.0, "rotor_inertia": -1.0, "gear_ratio": 0.0}
    with pytest.raises(SceneError) as error:
        scene_from({"gravity": 9.81, "pendulum": [{"links": [link]}]})
    assert {problem.partition(" = ")[0] for problem in error.value.problems} == {
        "pendulum[0].links[0].rotor_inertia",
        "pendulum[0].links[0].gear_ratio",
    }
