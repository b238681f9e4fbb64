"""Laws of joints that a package brings: every number of them by two routes, in every form of the equations."""

from __future__ import annotations

import pickle
from contextlib import nullcontext
from typing import Any

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import solve_ivp
from support.loops import interpreted
from support.magnets import CART, ENGINE, GREASE, Engine, Grease, Magnet, lawful_scene
from support.uncompiled import uncompiled

from modal import natural_modes
from modal.assembly import matrices
from modal.errors import ExtensionError, SceneError
from modal.extend import JointLaw, Parameter, cos, registration, sin, sqrt
from modal.extend.laws import DamperLaw, SpringLaw, VanDerPolLaw
from modal.modes.sensitivity import of_mode
from modal.scene import CAPABILITIES, FEATURES, Scene, dumps, refusals, scene_from
from modal.scene.capabilities import LIKE
from modal.scene.files import parse
from modal.scene.laws import part_of
from modal.scene.parameters import unit_at, vary
from modal.symbolic import symbolic_structure
from modal.types import Floats
from nonlinear import simulate
from nonlinear.dynamics import Generated, Minimal, Recursion
from nonlinear.dynamics.compiled import Compiled
from nonlinear.dynamics.mechanics import energies
from nonlinear.ensembles import ensemble
from nonlinear.system import State, system_of

SWING = '[support]\nkind = "swing"\nmass = 2.0\nlength = 1.5'
TILT = '[support]\nkind = "tilt"\nmass = 2.0\ninertia = 1.0\ncentre = [0.0, 0.2]\nstiffness = 50.0'
SCENES = {
    "cart": (CART, f"{GREASE}, {ENGINE}", "down"),
    "standing": (CART, f"{GREASE}, {ENGINE}", "up"),
    "swing": (SWING, f"{ENGINE}, {GREASE}", "down"),
    "tilt": (TILT, GREASE, "down"),
    "fixed": ("", '{ kind = "magnet", strength = -0.1 }', "down"),
}
EVERY = pytest.mark.parametrize("name", SCENES)
SECONDS = 2.0


def equations_of(scene: Scene) -> tuple[Minimal, Floats]:
    """The equations by the recursion, and a state with large angles."""
    system = system_of(scene)
    minimal = Minimal(system, tuple(Recursion(group, tail=1) for group in system.groups))
    return minimal, np.random.default_rng(3).normal(size=minimal.layout.size)


@uncompiled()
@EVERY
def test_texts_and_loops_are_the_recursion(name: str) -> None:
    scene = lawful_scene(*SCENES[name])
    minimal, y = equations_of(scene)
    expected = minimal.derivative(0.0, y[:, None])[:, 0]
    for equations in (Generated(minimal.system), Compiled(minimal.system)):
        assert equations.derivative(0.0, y) == pytest.approx(expected, rel=1e-12, abs=1e-12)


@EVERY
def test_power_is_the_rate_of_the_energy(name: str) -> None:
    minimal, y = equations_of(lawful_scene(*SCENES[name]))
    half, slope = minimal.layout.half, minimal.derivative(0.0, y[:, None])[:, 0]
    z = y + 1e-100j * slope
    rate = energies(minimal.system, z[:half, None], z[half : 2 * half, None]).total[0].imag / 1e-100
    power = slope[-1] if minimal.layout.works else 0.0
    assert rate == pytest.approx(power, rel=1e-12, abs=1e-12)


@EVERY
def test_stiffness_and_damping_are_derivatives_of_the_motion_and_of_symbols(name: str) -> None:
    scene = lawful_scene(*SCENES[name])
    minimal, _ = equations_of(scene)
    half, parts = minimal.layout.half, matrices(scene)
    rest = np.zeros(minimal.layout.size)
    rest[minimal.layout.first : half] = minimal.system.rest
    steps = rest[:, None] + 1e-100j * np.eye(len(rest))[:, : 2 * half]
    slopes = minimal.derivative(0.0, steps)[half : 2 * half].imag / 1e-100
    for A, part in ((parts.K, slopes[:, :half]), (parts.D, slopes[:, half:])):
        np.testing.assert_allclose(-parts.M @ part, A, rtol=0, atol=1e-12 * np.abs(parts.K).max())
    symbols = symbolic_structure(scene).matrices()
    for A, exact in zip((parts.M, parts.K, parts.D), symbols, strict=True):
        np.testing.assert_allclose(A, np.array(exact.evalf(), dtype=float), rtol=1e-12, atol=1e-13)


@pytest.mark.parametrize("laws", [ENGINE, '{ kind = "engine", gain = -1.0, lead = 0.4 }', GREASE])
@pytest.mark.parametrize("strength", [0.5, -0.5, -9.0])
@pytest.mark.parametrize("support", [CART, TILT, ""], ids=["cart", "tilt", "fixed"])
def test_modes_are_eigenvalues_also_where_laws_push_and_drive(support: str, strength: float, laws: str) -> None:
    scene = vary(lawful_scene(support, laws), {"pendulum[0].links[0].law.strength": strength})
    parts = matrices(scene)
    n, inverse = len(parts.M), np.linalg.inv(parts.M)
    state = np.block([[np.zeros((n, n)), np.eye(n)], [-inverse @ parts.K, -inverse @ parts.D]])
    eigenvalues = np.linalg.eigvals(state)
    modes = natural_modes(scene)
    for omega, ratio in zip(modes.omega, modes.damping_ratio, strict=True):
        value = complex(-ratio * omega, omega * np.sqrt(max(0.0, 1 - ratio**2)))
        assert np.abs(eigenvalues - value).min() < 1e-9 * abs(value)


def own_rates(t: float, y: Floats) -> list[float]:
    """The motion of `lawful_scene()` by its Lagrangian, written by hand."""
    x, a, b, vx, va, vb = y
    c, I, m = 0.35, 0.5 * 0.7**2 / 12, 0.5
    bend, rate = b - a, vb - va
    first = -0.2 * a - 0.5 * np.sin(3 * a)
    second = -0.01 * rate - 0.1 * (1 + bend**2) * np.tanh(rate) - 0.4 * (np.exp(bend) - 1)
    second += 0.3 * (bend - bend**3) + 0.02 * rate / (1 + bend**2 + bend)
    M = [[3.5, 1.5 * np.cos(a), m * c * np.cos(b)], [1.5 * np.cos(a), 1.5, m * c * np.cos(a - b)]]
    M += [[m * c * np.cos(b), m * c * np.cos(a - b), I + m * c**2]]
    Q = [
        -3.0 * x + 1.5 * np.sin(a) * va**2 + m * c * np.sin(b) * vb**2,
        -1.5 * 9.81 * np.sin(a) - m * c * np.sin(a - b) * vb**2 + first - second,
        -m * 9.81 * c * np.sin(b) + m * c * np.sin(a - b) * va**2 + second,
    ]
    return [vx, va, vb, *np.linalg.solve(M, Q)]


@pytest.fixture(scope="module")
def own_motion() -> Floats:
    start = [0.0, *np.radians([30.0, -20.0]), 0.0, 0.0, 0.0]
    return np.asarray(solve_ivp(own_rates, (0, SECONDS), start, method="DOP853", rtol=1e-12, atol=1e-12).y[1:3, -1])


@pytest.mark.parametrize(
    ("form", "method"),
    [
        ("minimal", "DOP853"),
        ("minimal", "taylor"),
        ("minimal", "LSODA"),
        ("maximal", "DOP853"),
        ("hamiltonian", "DOP853"),
    ],
)
def test_motions_are_those_of_the_equations_written_by_hand(form: str, method: str, own_motion: Floats) -> None:
    if method == "taylor":
        pytest.importorskip("heyoka")
    run = simulate(lawful_scene(), SECONDS, form=form, method=method, tolerance=1e-10, output=[SECONDS])
    assert run.final.links == pytest.approx(own_motion, abs=2e-8)
    assert run.energy_drift() < 1e-7


@pytest.mark.parametrize("engine", ["numpy", "numba"])
def test_members_have_laws_of_their_own(engine: str) -> None:
    scene, numbers = (
        lawful_scene(),
        {
            "pendulum[0].links[0].law.strength": np.linspace(-0.2, 1.0, 3),
            "pendulum[0].links[1].law[0].pull": np.linspace(0.0, 0.4, 3),
        },
    )
    with interpreted() if engine == "numba" else nullcontext():
        members = ensemble(scene, 0.5, vary=numbers, engine=engine, tolerance=1e-10)
    for k, links in enumerate(members.states()[0]):
        run = simulate(vary(scene, {place: values[k] for place, values in numbers.items()}), 0.5, tolerance=1e-11)
        assert links == pytest.approx(run.final.links, abs=1e-7)


def test_our_own_laws_by_name_are_the_keys_of_links() -> None:
    """A spring and a damper named as laws, and a drive, in place of the keys of their own."""
    keys = '{ kind = "bob", mass = 1.0, length = 1.0, stiffness = 0.3, damping = 0.2 }'
    named = 'law = [{ kind = "spring", stiffness = 0.3 }, { kind = "damper", damping = 0.2 }]'
    laws = keys.replace("stiffness = 0.3, damping = 0.2", named)
    drive = '{ kind = "van-der-pol", strength = 0.1, angle_deg = 9.0 }'
    text = "gravity = 9.81\n[[pendulum]]\nlinks = [{}]"
    scenes = [parse(text.format(link).encode()) for link in (laws, keys)]
    motions = [equations_of(scene)[0].derivative(0.0, np.array([[0.4], [0.7], [0.0]])) for scene in scenes]
    np.testing.assert_allclose(*motions, rtol=1e-14)
    np.testing.assert_array_equal(*(matrices(scene).D for scene in scenes))
    as_law, as_drive = (
        parse(text.format(keys.replace(" }", f", {key} = {drive} }}")).encode()) for key in ("law", "drive")
    )
    assert as_law.features - {"law"} == as_drive.features
    motions = [equations_of(scene)[0].derivative(0.0, np.array([[0.4], [0.7], [0.0]])) for scene in (as_law, as_drive)]
    np.testing.assert_array_equal(*motions)


def test_frequencies_change_with_parameters_as_by_differences() -> None:
    scene = lawful_scene()
    path, number, modes = "pendulum[0].links[0].law.order", 2, natural_modes(scene)
    slope = of_mode(modes, modes[number - 1])[path].derivative
    ends = [natural_modes(vary(scene, {path: 3.0 + h})).omega[number - 1] for h in (1e-4, -1e-4)]
    assert slope == pytest.approx((ends[0] - ends[1]) / 2e-4, rel=1e-6)


@pytest.mark.parametrize("law", [Magnet, Grease, Engine, SpringLaw, DamperLaw, VanDerPolLaw])
def test_coefficients_are_sympys(law: type[JointLaw]) -> None:
    x, v, *numbers = sp.symbols(f"x v p0:{len(law.parameters)}", real=True)
    names = [parameter.name for parameter in law.parameters]
    torque, values = law().torque(x, v, dict(zip(names, numbers, strict=True))), [1.3, 2.7][: len(names)]
    slopes = [-sp.diff(torque, by).subs({x: 0, v: 0}) for by in (x, v)]
    at = dict(zip(numbers, values, strict=True))
    parameters = dict(zip(names, values, strict=True))
    expected = [float(slope.subs(at)) for slope in slopes]
    assert law().linear_coefficients(parameters) == pytest.approx(expected, rel=1e-14, abs=1e-15)
    for name, symbol in zip(names, numbers, strict=True):
        expected = [float(sp.diff(slope, symbol).subs(at)) for slope in slopes]
        assert law().coefficient_slopes(parameters)[name] == pytest.approx(expected, rel=1e-8, abs=1e-9)


def test_scenes_with_laws_are_written_and_copied() -> None:
    scene = lawful_scene()
    assert parse(dumps(scene).encode()) == scene == pickle.loads(pickle.dumps(scene))
    assert unit_at(scene, ("pendulum", 0, "links", 1, "law", 0, "pull")) == "N m/rad"
    assert {part.law.name for part in scene.undriven.pendulum[0].links[1].laws} == {"grease", "engine"}
    assert [part.law.name for part in scene.conservative.pendulum[0].links[0].laws] == ["magnet"]
    assert not scene.conservative.pendulum[0].links[1].laws


@pytest.mark.parametrize(
    ("law", "words"),
    [
        ('{ kind = "magnit", strength = 1.0 }', 'law[0].kind = "magnit": must be one of'),
        ('{ kind = "magnet" }', "law[0].strength: is required"),
        ('{ kind = "magnet", strength = 1.0, order = 20.0 }', "law[0].order = 20.0: must be at most 9"),
        ('{ kind = "grease", strength = -1.0 }', "law[0].strength = -1.0: must"),
        ('{ kind = "magnet", stength = 1.0 }', "law[0].stength: is not a known key (did you mean strength?)"),
        ("{ strength = 1.0 }", "law[0].kind: is required"),
        ("3", "law[0].kind: is required"),
    ],
)
def test_mistakes_of_laws_have_their_place(law: str, words: str) -> None:
    with pytest.raises(SceneError) as caught:
        lawful_scene(laws=law)
    assert words in str(caught.value)
    assert str(caught.value).startswith("pendulum[0].links[1].")


def wrong_law(**functions: Any) -> type[JointLaw]:
    """A law that is not what it says."""
    numbers = {"name": "wrong", "parameters": (Parameter("strength", "N m"),)}
    return type("Wrong", (JointLaw,), {**numbers, **functions})


@pytest.mark.parametrize(
    ("law", "words"),
    [
        (wrong_law(torque=lambda self, a, v, p: 1 / 0), "torque raised ZeroDivisionError"),
        (wrong_law(torque=lambda self, a, v, p: p["strength"] + a), "must be 0 at angle 0"),
        (wrong_law(torque=lambda self, a, v, p: [a, v]), "torque returned shape (2,)"),
        (wrong_law(torque=lambda self, a, v, p: a**2, is_odd=True), "says that it is odd"),
        (wrong_law(torque=lambda self, a, v, p: v, is_dissipative=True), "supplies energy"),
        (wrong_law(torque=lambda self, a, v, p: -a, potential=lambda self, a, p: a**2), "its potential's slope"),
        (wrong_law(torque=lambda self, a, v, p: -a - v, potential=lambda self, a, p: a**2 / 2), "depends on the rate"),
        (wrong_law(torque=lambda self, a, v, p: -sqrt(a)), "has no derivative at rest"),
    ],
)
def test_what_is_wrong_with_a_law_is_its_own_mistake(law: type[JointLaw], words: str) -> None:
    with registration(law), pytest.raises(ExtensionError) as caught:
        part_of.__wrapped__(law)(strength=1.0)
    assert words in str(caught.value)
    assert str(caught.value).startswith("extension wrong (package ")


def test_capabilities_take_laws_by_their_nature() -> None:
    for capability in CAPABILITIES.values():
        for name, models in LIKE.items():
            assert len(capability.entries(name)) == 1
            assert all(FEATURES[model] for model in models)
    scene = lawful_scene()
    assert {"joint_springs", "dampers", "law", "active_law"} <= scene.features
    assert {"kinked_law", "van_der_pol"}.isdisjoint(scene.features)
    assert "needs a motion that keeps its energy" in " ".join(refusals(scene, "a Poincaré section"))
    assert "about two axes" in " ".join(refusals(scene.replace(space="space"), "form minimal"))
    assert not refusals(scene, "a derivation")


class Bistable(JointLaw):
    """A law whose potential is not 0 at rest."""

    name = "bistable"
    parameters = (Parameter("strength", "N m"),)

    def torque(self, angle: Any, rate: Any, parameters: Any) -> Any:
        """Of the potential."""
        return -parameters["strength"] * sin(2 * angle)

    def potential(self, angle: Any, parameters: Any) -> Any:
        """Least at rest, where it is −s/2."""
        return -parameters["strength"] * cos(2 * angle) / 2


def test_energies_are_those_above_rest_wherever_a_potential_begins() -> None:
    with registration(Bistable):
        link = {"kind": "bob", "mass": 2, "length": 0.5, "law": {"kind": "bistable", "strength": 0.8}}
        scene = scene_from({"gravity": 9.81, "pendulum": [{"links": [link]}]})
        run = simulate(scene, 1.0, start=State(np.array([0.7]), np.zeros(1)), output=5)
        theta, rate = run.motion.links[:, 0], run.motion.link_rates[:, 0]
        expected = 0.25 * rate**2 + 9.81 * (1 - np.cos(theta)) + 0.4 * (1 - np.cos(2 * theta))
        np.testing.assert_allclose(sum(run.mechanics.energies), expected, rtol=1e-8)
