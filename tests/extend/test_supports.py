"""Supports of other packages, against Lagrange's equations of this file and the built-in ones."""

from __future__ import annotations

import pickle
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
import pytest
import scipy
import sympy as sp

from modal import Scene, natural_frequencies, natural_modes
from modal.errors import ExtensionError, SceneError
from modal.extend import Parameter, Support, SupportCoordinate, cos, exp, log, registration, sin, sqrt, tanh
from modal.extend.scalars import Jet, along
from modal.scene import dump, load, scene_from
from modal.scene.carriers import CartMotion, HeaveMotion, PlatformMotion, SwingMotion, TiltMotion
from modal.scene.parameters import vary
from modal.structure.structure import unit_size
from modal.testing import SupportTests
from modal.types import Floats
from nonlinear import simulate
from nonlinear.dynamics import Generated, Lanes, Minimal, Recursion
from nonlinear.dynamics.mechanics import energies
from nonlinear.ensembles import ensemble
from nonlinear.system import Numbers, State, numbers_of, system_of


class Disc(Support):
    """It rolls along a rail; its coordinate is the angle by which it has turned."""

    name = "disc"
    coordinates = (SupportCoordinate("rad", letter="phi", verb="rolls"),)
    turning = 0
    parameters = (Parameter("radius", "m", low=1e-3), Parameter("magnet", "N m", default=0.0))

    def place(self, eta: Sequence[Any], parameters: Mapping[str, Any]) -> tuple[Any, Any]:
        """Its centre moves to the left as it turns to the left below."""
        return -parameters["radius"] * eta[0], 0.0

    def potential(self, eta: Sequence[Any], parameters: Mapping[str, Any]) -> Any:
        """Flat as drawn, and bent upwards there."""
        return parameters["magnet"] * (1 - cos(2 * eta[0]))


WRITTEN: dict[str, Any] = {
    "gravity": 9.81,
    "support": {
        "kind": "disc",
        "mass": 2.0,
        "inertia": 0.05,
        "radius": 0.3,
        "magnet": 0.4,
        "centre": [0.0, 0.02],
        "damping": 0.03,
        "stiffness": 0.5,
    },
    "pendulum": [
        {"position": [0.05, 0.2], "links": [{"kind": "bob", "mass": 0.7, "length": 0.6}]},
        {"position": [-0.1, 0.1], "links": [{"kind": "rod", "mass": 0.4, "length": 0.5}]},
    ],
}


@pytest.fixture(autouse=True)
def disc() -> Iterator[None]:
    """The class is known while a test of this file runs."""
    with registration(Disc):
        yield


@pytest.fixture
def scene() -> Scene:
    """Two pendula on a disc; moments about the point on the rail are balanced as drawn."""
    return scene_from(WRITTEN)


def lagrange() -> tuple[Any, Any, Any, Any]:
    """T, V and R of the scene, in angles of the disc and of both links, from places alone; (q, v) its symbols."""
    t, g = sp.Symbol("t"), WRITTEN["gravity"]
    phi, a, b = (sp.Function(name)(t) for name in ("phi", "a", "b"))
    body, radius = WRITTEN["support"], WRITTEN["support"]["radius"]

    def on_disc(s: float, h: float) -> tuple[Any, Any]:
        return -radius * phi + s * sp.cos(phi) + h * sp.sin(phi), h * sp.cos(phi) - s * sp.sin(phi)

    def below(place: tuple[Any, Any], reach: float, angle: Any) -> tuple[Any, Any]:
        return place[0] + reach * sp.sin(angle), place[1] + reach * sp.cos(angle)

    first, second = (
        below(on_disc(*p["position"]), p["links"][0]["length"] / n, angle)
        for p, n, angle in zip(WRITTEN["pendulum"], (1, 2), (a, b), strict=True)
    )
    rod = WRITTEN["pendulum"][1]["links"][0]
    masses = [(body["mass"], on_disc(*body["centre"])), (0.7, first), (0.4, second)]
    T = sum(m * (sp.diff(x, t) ** 2 + sp.diff(z, t) ** 2) / 2 for m, (x, z) in masses)
    T += body["inertia"] * sp.diff(phi, t) ** 2 / 2 + rod["mass"] * rod["length"] ** 2 / 24 * sp.diff(b, t) ** 2
    weight = g * (0.7 * 0.05 + 0.4 * -0.1)  # the spring carries what turns the disc as drawn
    V = -sum(m * g * z for m, (_, z) in masses) - weight * phi
    V += body["stiffness"] * phi**2 / 2 + body["magnet"] * (1 - sp.cos(2 * phi))
    return t, (phi, a, b), T, V


@pytest.fixture(scope="module")
def equations() -> tuple[Any, Any, Any]:
    """Own M(q), f(q, v) of M q'' = f, as functions, and K at rest."""
    t, q, T, V = lagrange()
    v = [sp.diff(c, t) for c in q]
    Q, W = sp.symbols("q0:3"), sp.symbols("w0:3")
    plain = [*zip(v, W, strict=True), *zip(q, Q, strict=True)]
    T, V = (sp.sympify(part).subs(plain[:3]).subs(plain[3:]) for part in (T, V))
    M = sp.hessian(T, W)
    right = [
        sp.diff(T - V, c) - sum(sp.diff(sp.diff(T, w), d) * u for d, u in zip(Q, W, strict=True))
        for c, w in zip(Q, W, strict=True)
    ]
    right[0] -= WRITTEN["support"]["damping"] * W[0]
    rest = dict.fromkeys((*Q, *W), 0)
    K = np.array(sp.hessian(V, Q).subs(rest), dtype=float)
    return sp.lambdify((Q, W), M), sp.lambdify((Q, W), right), K


def test_modes_are_those_of_lagrange(scene: Scene, equations: Any) -> None:
    still = scene.replace(support=scene.support.replace(damping=0.0))
    M = np.array(equations[0](np.zeros(3), np.zeros(3)), dtype=float)
    expected = np.sqrt(scipy.linalg.eigh(equations[2], M, eigvals_only=True))
    assert natural_frequencies([still])[0] == pytest.approx(expected, rel=1e-12)
    assert "disc rolls" in str(natural_modes(scene))


def accelerations(equations: Any, y: Floats) -> Floats:
    """Those of Lagrange's equations."""
    q, v = y[:3], y[3:6]
    return np.linalg.solve(np.array(equations[0](q, v), dtype=float), np.array(equations[1](q, v), dtype=float))


def test_every_engine_has_the_accelerations_of_lagrange(scene: Scene, equations: Any) -> None:
    """The recursion in NumPy, what is written out, and lanes."""
    system = system_of(scene)
    y = np.append(np.random.default_rng(1).uniform(-2, 2, 6), 0.0)
    expected = accelerations(equations, y)
    plain = Minimal(system, tuple(Recursion(group) for group in system.groups))
    assert plain.derivative(0.0, y)[3:6] == pytest.approx(expected, rel=1e-11)
    assert Generated(system).derivative(0.0, y)[3:6] == pytest.approx(expected, rel=1e-11)
    numbers = numbers_of(scene)
    lanes = Lanes(Numbers(system, numbers.entries))
    columns = np.repeat(y[:, None], 2, axis=1)
    assert np.array(lanes.rates(lanes.numbers)(columns))[3:6, 1] == pytest.approx(expected, rel=1e-11)


def test_loops_that_do_not_know_it_refuse_it(scene: Scene) -> None:
    pytest.importorskip("numba")
    from nonlinear.dynamics.compiled_structure import flat_of

    with pytest.raises(SceneError, match="supports of kind disc are not compiled"):
        flat_of(system_of(scene))


START = State(np.array([0.9, -0.4]), np.array([0.5, 0.2]), supports=np.array([0.3]), support_rates=np.array([-0.8]))


@pytest.fixture(scope="module")
def there(equations: Any) -> Floats:
    """Where Lagrange's equations arrive after 2 s: the disc and both links."""
    begin = np.array([0.3, 0.9, -0.4, -0.8, 0.5, 0.2])
    run = scipy.integrate.solve_ivp(
        lambda t, y: np.concatenate((y[3:], accelerations(equations, y))),
        (0, 2),
        begin,
        "DOP853",
        rtol=1e-11,
        atol=1e-12,
    )
    return np.asarray(run.y[:3, -1])


@pytest.mark.parametrize("form", ["minimal", "hamiltonian"])
def test_a_run_arrives_where_lagrange_does(scene: Scene, there: Floats, form: str) -> None:
    run = simulate(scene, 2.0, start=START, tolerance=1e-11, form=form, output=3)
    assert [*run.final.supports, *run.final.links] == pytest.approx(there, abs=1e-8)
    assert run.energy_drift() < 1e-9


def test_members_arrive_there(scene: Scene, there: Floats) -> None:
    """A number of its own kind is one of the numbers of an ensemble."""
    runs = ensemble(
        scene,
        2.0,
        starts=[START, START],
        vary={"support.radius": [0.3, 0.35]},
        tolerance=1e-11,
        engine="numpy",
        workers=1,
    )
    assert runs.final.links[0] == pytest.approx(there[1:], abs=1e-8)
    other = simulate(vary(scene, {"support.radius": 0.35}), 2.0, start=START, tolerance=1e-11, output=3)
    assert runs.final.links[1] == pytest.approx(other.final.links, abs=1e-8)


def test_symbols_are_the_equations_in_numbers(scene: Scene, equations: Any) -> None:
    from modal.symbolic.derivation import symbolic_structure

    M, K, _ = (np.array(part.evalf(), dtype=float) for part in symbolic_structure(scene).matrices())
    assert pytest.approx(equations[2], abs=1e-12) == K
    assert pytest.approx(np.array(equations[0](np.zeros(3), np.zeros(3)), dtype=float), abs=1e-12) == M


def test_a_scene_file_names_it(scene: Scene, tmp_path: Path) -> None:
    dump(scene, tmp_path / "disc.toml")
    assert load(tmp_path / "disc.toml") == scene
    assert pickle.loads(pickle.dumps(scene)) == scene
    with pytest.raises(SceneError, match=r"support.radius = -1.0: must be positive"):
        scene_from({**WRITTEN, "support": {**WRITTEN["support"], "radius": -1.0}})
    with pytest.raises(SceneError, match=r"support.radius: is required"):
        scene_from({**WRITTEN, "support": {"kind": "disc", "mass": 1.0, "inertia": 1.0}})
    with pytest.raises(SceneError, match='must be one of "fixed"'):
        scene_from({**WRITTEN, "support": {"kind": "disk", "mass": 1.0}})


def test_mistakes_are_those_of_the_extension() -> None:
    class Off(Disc):
        name = "off"

        def place(self, eta: Any, parameters: Any) -> Any:
            return 1.0 + eta[0], 0.0

    class Wrong(Disc):
        name = "wrong"

        def place(self, eta: Any, parameters: Any) -> Any:
            raise ValueError("no place")

    class Steep(Disc):
        name = "steep"

        def potential(self, eta: Any, parameters: Any) -> Any:
            return eta[0]

    for cls, words in (
        (Off, "place is"),
        (Wrong, "place raised ValueError: no place"),
        (Steep, "potential has a slope"),
    ):
        with registration(cls), pytest.raises(ExtensionError, match=rf"extension {cls.name} .*{words}"):
            scene_from({**WRITTEN, "support": {**WRITTEN["support"], "kind": cls.name}})
    for taken in (type("A", (Disc,), {"name": "cart"}), type("B", (Disc,), {"name": "modal"})):
        with pytest.raises(ExtensionError, match="exists"), registration(taken):
            pass


@pytest.mark.parametrize("cls", [CartMotion, SwingMotion, TiltMotion, HeaveMotion, PlatformMotion])
def test_built_in_supports_move_as_jets_say(cls: type[Support]) -> None:
    """What they state of their motion is what their places give."""
    rng, path = np.random.default_rng(2), cls()
    eta, rates = rng.normal(size=(2, len(cls.coordinates))).tolist()
    values = {"length": 0.7} if cls is SwingMotion else {}
    for got, expected in zip(path.motion(eta, rates, values), Support.motion(path, eta, rates, values), strict=True):
        assert np.asarray(got, dtype=float) == pytest.approx(np.asarray(expected, dtype=float), abs=1e-14)


def test_jets_are_derivatives() -> None:
    x, p = sp.symbols("x p")

    def f(values: Sequence[Any]) -> list[Any]:
        (y,) = values
        return [sin(y) * exp(-y / 3) + tanh(2 - y) ** 3 / (1 + y**2) - log(2 + cos(y)) * sqrt(y), 1 / (3 - y)]

    for jet, expression in zip(along(f, [0.8], [2.0]), f([x]), strict=True):
        for order, part in enumerate((jet.value, jet.first, jet.second)):
            assert float(part) == pytest.approx(float(sp.diff(expression, x, order).subs(x, 0.8)) * 2**order, rel=1e-13)
    symbolic = (p * Jet(x, 1.0)).first
    assert symbolic == p


def test_units_are_products() -> None:
    assert [unit_size(unit, 2.0, 3.0, 12.0) for unit in ("kg m²", "m/s", "N s/m", "", "1/m")] == pytest.approx(
        [18.0, 6.0, 4.0, 1.0, 1 / 3]
    )


def test_energies_are_those_of_lagrange(scene: Scene) -> None:
    t, q, T, V = lagrange()
    values = {sp.diff(c, t): v for c, v in zip(q, (-0.8, 0.5, 0.2), strict=True)}
    places = dict(zip(q, (0.3, 0.9, -0.4), strict=True))
    kinetic, potential = (float(part.doit().subs(values).subs(places)) for part in (T, V - V.subs(dict.fromkeys(q, 0))))
    parts = energies(system_of(scene), np.array([0.3, 0.9, -0.4]), np.array([-0.8, 0.5, 0.2]))
    rest = energies(system_of(scene), np.zeros(3), np.zeros(3))
    assert float(parts.total - rest.total) == pytest.approx(kinetic + potential, rel=1e-12)


class TestDisc(SupportTests):
    """As its package tests it."""

    extension = Disc
    parameters = MappingProxyType({"mass": 2.0, "inertia": 0.05, "radius": 0.3, "magnet": 0.4, "stiffness": 0.5})
