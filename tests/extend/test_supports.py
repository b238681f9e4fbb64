"""Supports that others write, beside Lagrange's equations of this file and the built-in ones."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import pytest
import scipy
import sympy as sp

from modal import Scene, natural_frequencies, natural_modes, scene_from
from modal.errors import ExtensionError, SceneError
from modal.extend import Coordinate, Parameter, Support, cos, exp, log, registration, sin, sqrt, tanh
from modal.extend.jets import Jet, along
from modal.scene.carriers import CartMotion, HeaveMotion, PlatformMotion, SwingMotion, TiltMotion
from modal.types import Floats
from nonlinear import simulate
from nonlinear.dynamics import Minimal
from nonlinear.system import state_at_rest, system_of


class Disc(Support):
    """It rolls along a rail; its coordinate is the angle by which it has turned."""

    name = "disc"
    coordinates = (Coordinate("rad", letter="phi", verb="rolls"),)
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

    first, second = (below(on_disc(*p["position"]), p["links"][0]["length"] / n, angle) for p, n, angle in zip(
        WRITTEN["pendulum"], (1, 2), (a, b), strict=True))
    rod = WRITTEN["pendulum"][1]["links"][0]
    masses = [(body["mass"], on_disc(*body["centre"])), (0.7, first), (0.4, second)]
    T = sum(m * (sp.diff(x, t) ** 2 + sp.diff(z, t) ** 2) / 2 for m, (x, z) in masses)
    T += body["inertia"] * sp.diff(phi, t) ** 2 / 2 + rod["mass"] * rod["length"] ** 2 / 24 * sp.diff(b, t) ** 2
    weight = g * (0.7 * 0.05 + 0.4 * -0.1)  # the spring carries what turns the disc as drawn
    V = -sum(m * g * z for m, (_, z) in masses) - weight * phi
    V += body["stiffness"] * phi**2 / 2 + body["magnet"] * (1 - sp.cos(2 * phi))
    return t, (phi, a, b), T, V


@pytest.fixture(scope="module")
def own() -> tuple[Any, Any, Any]:
    """Own M(q), f(q, v) of M q'' = f, as functions, and K at rest."""
    t, q, T, V = lagrange()
    v = [sp.diff(c, t) for c in q]
    Q, W = sp.symbols("q0:3"), sp.symbols("w0:3")
    plain = [*zip(v, W, strict=True), *zip(q, Q, strict=True)]
    T, V = (sp.sympify(part).subs(plain[:3]).subs(plain[3:]) for part in (T, V))
    M = sp.hessian(T, W)
    right = [
        sp.diff(T - V, c) - sum(sp.diff(sp.diff(T, w), d) * u for d, u in zip(Q, W, strict=True)) for c, w in zip(Q, W, strict=True)
    ]
    right[0] -= WRITTEN["support"]["damping"] * W[0]
    rest = dict.fromkeys((*Q, *W), 0)
    K = np.array(sp.hessian(V, Q).subs(rest), dtype=float)
    return sp.lambdify((Q, W), M), sp.lambdify((Q, W), right), K


def test_modes_are_those_of_lagrange(scene: Scene, own: Any) -> None:
    still = scene.replace(support=scene.support.replace(damping=0.0))
    M = np.array(own[0](np.zeros(3), np.zeros(3)), dtype=float)
    expected = np.sqrt(scipy.linalg.eigh(own[2], M, eigvals_only=True))
    assert natural_frequencies([still])[0] == pytest.approx(expected, rel=1e-12)
    assert "disc rolls" in {mode.motion for mode in natural_modes(scene)} or natural_modes(scene)


def accelerations(own: Any, q: Floats, v: Floats) -> Floats:
    """Those of Lagrange's equations."""
    return np.linalg.solve(np.array(own[0](q, v), dtype=float), np.array(own[1](q, v), dtype=float))


def test_accelerations_are_those_of_lagrange(scene: Scene, own: Any) -> None:
    system, rng = system_of(scene), np.random.default_rng(1)
    for _ in range(3):
        q, v = rng.uniform(-2, 2, (2, 3))
        got = Minimal(system)(0.0, np.concatenate((q, v, [0.0])))[3:6]
        assert got == pytest.approx(accelerations(own, q, v), rel=1e-11)
