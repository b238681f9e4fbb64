"""Forces on centres of mass that a package brings: by their work, by own equations, in every form and with drag."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from support.magnets import CART, Wake

from modal.assembly import matrices
from modal.errors import ExtensionError, SceneError
from modal.extend import Parameter, PointForce, registration
from modal.scene import Scene, dumps, free_bodies, refusals
from modal.scene.files import parse
from modal.scene.laws import part_of
from modal.scene.parameters import unit_at, vary
from modal.symbolic.newton_euler import NewtonEuler
from modal.types import Floats
from nonlinear import simulate
from nonlinear.dynamics import Generated, Minimal, Recursion
from nonlinear.dynamics.mechanics import energies
from nonlinear.ensembles import ensemble
from nonlinear.system import system_of

DRAG = "drag = 0.2, quadratic_drag = 0.1"
SAME = '{ kind = "drag", drag = 0.2, quadratic_drag = 0.1 }'
WAKE = '{ kind = "wake", drag = 0.2, growth = 0.05 }'


def airy_scene(air: str, support: str = CART) -> Scene:
    """Two links, the lower in this air."""
    links = f'{{ kind = "bob", mass = 1.0, length = 1.0 }}, {{ kind = "rod", mass = 0.5, length = 0.7, {air} }}'
    start = "start = { angles_deg = [30.0, -20.0] }"
    return parse(f"gravity = 9.81\n{support}\n[[pendulum]]\nlinks = [{links}]\n{start}".encode())


def test_drag_by_its_name_is_the_keys_of_links() -> None:
    scenes = [airy_scene(DRAG), airy_scene(f"point_force = {SAME}"), airy_scene(f"point_force = [{SAME}]")]
    assert scenes[0].features == scenes[1].features
    for form in ("minimal", "hamiltonian"):
        runs = [simulate(scene, 0.5, form=form, output=[0.5]).final.links for scene in scenes]
        assert runs[1] == pytest.approx(runs[0], rel=1e-12)
        np.testing.assert_array_equal(runs[1], runs[2])
    np.testing.assert_array_equal(matrices(scenes[0]).D, matrices(scenes[1]).D)
    assert parse(dumps(scenes[1]).encode()) == scenes[1]


@pytest.mark.parametrize("space", ["plane", "space"])
def test_power_is_the_rate_of_the_energy(space: str) -> None:
    run = simulate(airy_scene(f"point_force = {WAKE}").replace(space=space), 1.0, tolerance=1e-11)
    assert run.energy_drift() < 1e-9
    assert run.motion.work[-1] < -0.01


def test_texts_are_the_recursion_and_work_is_drained() -> None:
    system = system_of(airy_scene(f"point_force = {WAKE}"))
    minimal = Minimal(system, tuple(Recursion(group, tail=1) for group in system.groups))
    y, half = np.random.default_rng(3).normal(size=minimal.layout.size), minimal.layout.half
    slope = minimal.derivative(0.0, y[:, None])[:, 0]
    assert Generated(system).derivative(0.0, y) == pytest.approx(slope, rel=1e-12, abs=1e-12)
    z = y + 1e-100j * slope
    rate = energies(system, z[:half, None], z[half : 2 * half, None]).total[0].imag / 1e-100
    assert rate == pytest.approx(slope[-1], rel=1e-12)


def hand_rates(t: float, y: Floats) -> list[float]:
    """One bob on a fixed support with a wake, by its own equation."""
    speed = 1.3 * y[1]
    return [y[1], -9.81 / 1.3 * np.sin(y[0]) - (0.2 + 0.05 * speed**2) * speed / (0.8 * 1.3)]


@pytest.mark.parametrize("form", ["minimal", "maximal", "hamiltonian"])
def test_a_pendulum_in_a_wake_is_that_of_its_equation(form: str) -> None:
    link = f'{{ kind = "bob", mass = 0.8, length = 1.3, point_force = {WAKE} }}'
    start = "start = { angles_deg = [100.0] }"
    scene = parse(f"gravity = 9.81\n[[pendulum]]\nlinks = [{link}]\n{start}".encode())
    expected = solve_ivp(hand_rates, (0, 1.0), [np.radians(100.0), 0.0], rtol=1e-12, atol=1e-12).y[0, -1]
    run = simulate(scene, 1.0, form=form, tolerance=1e-11, output=[1.0])
    assert run.final.links[0] == pytest.approx(expected, abs=1e-8)


def test_members_have_forces_of_their_own() -> None:
    scene, place = airy_scene(f"point_force = {WAKE}"), "pendulum[0].links[1].point_force.growth"
    members = ensemble(scene, 0.5, vary={place: np.array([0.0, 0.3])}, engine="numpy", tolerance=1e-10)
    for growth, links in zip((0.0, 0.3), members.states()[0], strict=True):
        run = simulate(vary(scene, {place: growth}), 0.5, tolerance=1e-11)
        assert links == pytest.approx(run.final.links, abs=1e-8)


def test_what_is_wrong_is_told() -> None:
    with pytest.raises(SceneError, match=r"point_force\.kind = \"wak\": must be one of drag, wake \(did you mean wake"):
        airy_scene('point_force = { kind = "wak" }')
    assert "has no symbols" in " ".join(refusals(airy_scene(f"point_force = {WAKE}"), "a derivation"))
    assert Wake().linear_drag({"drag": 0.3, "growth": 2.0}) == pytest.approx(0.3)
    wind = {"name": "wind", "parameters": (Parameter("push", "N"),)}
    steady = type("Wind", (PointForce,), {**wind, "force": lambda self, v, p: [p["push"]] * 2})
    sideways = type("Wind", (PointForce,), {**wind, "force": lambda self, v, p: [-v[0], -2 * v[1]]})
    for law, words in ((steady, "not 0 at rest"), (sideways, "differs from one direction")):
        with registration(law), pytest.raises(ExtensionError, match=f"extension wind .*{words}"):
            part_of.__wrapped__(law)(push=1.0)


def test_diagrams_and_units_know_them() -> None:
    scene = airy_scene(f"point_force = {WAKE}")
    assert unit_at(scene, ("pendulum", 0, "links", 1, "point_force", "growth")) == "N s³/m³"
    laws = dict(NewtonEuler(free_bodies(scene)).laws())
    along = laws["drag of link 2 along the rail"].rhs
    rates = sorted(along.free_symbols, key=str)
    assert [float(along.subs(dict.fromkeys(rates, 0.5)))] == pytest.approx([-(0.2 + 0.05 * 0.5) * 0.5])
