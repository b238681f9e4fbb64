"""Tongues: Floquet multipliers and boundaries of growth against Mathieu's equation, ODEs of SciPy, and averaging."""

from __future__ import annotations

from math import sqrt, tau

import numpy as np
import pytest
from amounts import usually
from scipy.integrate import solve_ivp
from scipy.special import mathieu_a, mathieu_b

from modal import Bob, Cart, Pendulum, Scene, SceneError, matrices
from modal.scene import ConstantForce, Moved, SineMotion, SweepMotion
from modal.statespace.geometry import geometry_of
from modal.vibration import hill, parametric_stability, stabilities, tongues

G = 9.81
HALF, WHOLE, COMBINED = "at half the frequency", "at the frequency", "at a combination"


def shaken(
    *links: Bob, way: str | None = None, amplitude: float = 0.02, frequency: float = 1.0, beside: bool = False
) -> Scene:
    motion = SineMotion(direction="vertical", amplitude=amplitude, frequency_hz=frequency)
    along = SineMotion(direction="horizontal", amplitude=0.3, frequency_hz=0.7)
    hung = Pendulum(links=links, equilibrium=(way,) * len(links) if way else None)
    return Scene(gravity=G, support=Moved(motion=(along, motion) if beside else motion), pendulum=(hung,))


def bob(length: float = 1.0, damping: float = 0.0, **more: float) -> Bob:
    return Bob(mass=1.0, length=length, damping=damping, **more)


def multipliers(scene: Scene, amplitude: float, hertz: float) -> np.ndarray:
    """By DOP853 on the matrices of the whole scene, over a period of sines."""
    model, geometry, omega = matrices(scene), geometry_of(scene), tau * hertz
    n, weights = len(model.M), geometry.centres.T @ geometry.mass

    def rate(time: float, y: np.ndarray) -> np.ndarray:
        angles, rates = y.reshape(2, n, 2 * n)
        K = model.K - np.diag(weights) * amplitude * omega**2 * np.sin(omega * time)
        return np.concatenate((rates, -np.linalg.solve(model.M, K @ angles + model.D @ rates))).ravel()

    run = solve_ivp(rate, (0, 1 / hertz), np.eye(2 * n).ravel(), "DOP853", rtol=1e-13, atol=1e-13)
    return np.linalg.eigvals(run.y[:, -1].reshape(2 * n, 2 * n))


SPRUNG = shaken(bob(0.5), Bob(mass=0.5, length=0.4, stiffness=3.0))
DAMPED = shaken(bob(0.5, 0.01), Bob(mass=0.5, length=0.4, stiffness=3.0, damping=0.01))


def test_mathieus_tongues_at_any_amplitude() -> None:
    """a = 4g/(lΩ²) and q = 2A/l are characteristic numbers on each edge, from the tips at Ω = 2ω/k."""
    diagram = tongues(shaken(bob()), np.linspace(0.0, 0.4, 9), np.linspace(0.3, 2.2, 24))
    kinds = [(boundary.kind, boundary.least[1] * tau / sqrt(G)) for boundary in diagram.boundaries]
    assert [kind for kind, _ in kinds] == [WHOLE] * 2 + [HALF] * 4
    assert sorted(ratio for _, ratio in kinds) == pytest.approx([2 / 3, 2 / 3, 1, 1, 2, 2], abs=1e-12)
    for boundary in diagram.boundaries:
        omega, q = tau * boundary.frequency_hz, 2 * boundary.amplitude
        order = round(2 * sqrt(G) / (tau * boundary.least[1]))
        each = [np.sqrt(4 * G / function(order, q)) for function in (mathieu_a, mathieu_b)]
        assert min(np.abs(omega - edge).max() for edge in each) < 1e-9


EDGES = {0.02: (0.9793360277, 1.0159497622), 0.05: (0.9517370503, 1.0509516172), 0.1: (0.9123522438, 1.1177076445)}


def test_a_damper_lifts_the_tongue_off_the_axis() -> None:
    diagram = tongues(shaken(bob(damping=0.05)), [0.005, 0.05, 0.12], np.linspace(0.8, 1.3, 6))
    (boundary,) = diagram.boundaries
    assert boundary.turns
    assert boundary.least == pytest.approx((0.0079815996, 0.9970552394), abs=1e-9)
    for amplitude, expected in EDGES.items():
        edges = diagram.edges(amplitude=amplitude)
        assert [hertz for hertz, _ in edges] == pytest.approx(expected, abs=1e-9)
        for hertz, kind in edges:
            assert kind == HALF
            assert np.min(np.abs(multipliers(shaken(bob(damping=0.05)), amplitude, hertz) + 1)) < 1e-9
    below, above = (
        tongues(shaken(bob(damping=0.05)), amplitudes, [0.9, 1.0, 1.1]) for amplitudes in ([0.00798], [0.00799])
    )
    assert (len(below.boundaries), len(above.boundaries)) == (0, 2)


def test_what_holds_up_an_inverted_pendulum() -> None:
    diagram = tongues(shaken(bob(0.25, 0.05 * 0.25**2), way="up"), [0.01, 0.02, 0.03], np.linspace(10, 40, 7))
    assert diagram.edges(amplitude=0.02) == [(pytest.approx(17.6487919937, abs=1e-9), WHOLE)]


def test_what_holds_up_three_inverted_links() -> None:
    """Held from about √2 g/(ω_min A), lost above about 0.450 g/ω_max²."""
    scene = shaken(bob(0.2), bob(0.2), bob(0.2), way="up")
    rates = np.sqrt(-np.linalg.eigvals(np.linalg.solve(matrices(scene).M, matrices(scene).K)).real)
    diagram = tongues(scene, np.linspace(0.005, 0.02, 7), np.linspace(20, 210, 20))
    held, lost = diagram.edges(amplitude=0.01)[-1], diagram.edges(frequency_hz=200.0)[0]
    assert held == (pytest.approx(48.898633, abs=1e-6), WHOLE)
    assert lost == (pytest.approx(0.014446906, abs=1e-9), HALF)
    assert held[0] == pytest.approx(sqrt(2) * G / (rates.min() * 0.01) / tau, rel=2e-4)
    assert lost[0] == pytest.approx(0.450 * G / rates.max() ** 2, rel=0.02)


@pytest.mark.parametrize(("scene", "room"), usually([(SPRUNG, 1e-5)], [(SPRUNG, 1e-5), (DAMPED, 1e-9)]))
def test_combinations_of_two_modes_that_couple(scene: Scene, room: float) -> None:
    """On each edge a pair of multipliers is on the unit circle, and beyond it is not; two are equal without losses."""
    diagram = tongues(scene, np.linspace(0.0, 0.06, 7), np.linspace(2.2, 3.0, 17))
    edges = [hertz for hertz, kind in diagram.edges(amplitude=0.04) if kind == COMBINED]
    assert len(edges) == 2
    for hertz, way in zip(edges, (1, -1), strict=True):
        on, within = (np.abs(multipliers(scene, 0.04, hertz + way * step)) for step in (0.0, 1e-4))
        assert np.sort(np.abs(on - 1))[1] < room
        assert np.sort(within)[-2] > 1 + 5e-6
    if scene is SPRUNG:
        square = np.linalg.eigvals(np.linalg.solve(matrices(scene).M, matrices(scene).K)).real
        tips = [boundary.least for boundary in diagram.boundaries if boundary.kind == COMBINED]
        assert np.array(tips) == pytest.approx(np.array([[0.0, np.sqrt(square).sum() / tau]] * 2), abs=1e-10)


@pytest.mark.parametrize("scene", [SPRUNG, DAMPED, shaken(bob(0.3, 0.02), bob(0.2))])
def test_multipliers_are_those_of_an_integration(scene: Scene) -> None:
    amplitude, hertz = np.array([0.03, 0.05]), np.array([2.54, 1.2])
    for k in range(2):
        by_family = [system.multipliers(amplitude, tau * hertz)[k] for system in hill.hill_systems(scene)]
        expected = multipliers(scene, amplitude[k], hertz[k])
        assert np.poly(np.concatenate(by_family)) == pytest.approx(np.poly(expected), abs=1e-9)


def test_the_series_keep_eleven_digits(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = shaken(*[bob(0.1, 0.001, stiffness=0.5, drag=0.02, quadratic_drag=0.1 * k) for k in range(4)])
    (system,) = hill.hill_systems(scene)
    point = np.array([0.01]), np.array([20.0])
    usual = system.monodromy(*point)
    monkeypatch.setattr(hill, "REACH", 0.3)
    assert usual == pytest.approx(system.monodromy(*point), abs=1e-11 * np.abs(usual).max())


def test_fifty_links_with_springs_and_dampers() -> None:
    """Without motion the multipliers are those of the modes."""
    scene = shaken(*[bob(0.02, 0.001, stiffness=0.1) for _ in range(50)], amplitude=0.0, frequency=20.0)
    stability, model = parametric_stability(scene), matrices(scene)
    n = len(model.M)
    state = np.block([[np.zeros((n, n)), np.eye(n)], [-np.linalg.solve(model.M, np.hstack((model.K, model.D)))]])
    assert stability.multipliers.shape == (100,)
    assert stability.largest == pytest.approx(np.exp(np.linalg.eigvals(state).real.max() / 20.0), abs=1e-10)
    assert stability.kind == "decays"


def test_kinds_and_a_motion_along_the_rail_beside() -> None:
    scenes = [
        shaken(bob(damping=0.05), amplitude=0.005),
        shaken(bob(), frequency=2.0),
        shaken(bob(), amplitude=0.1, frequency=0.4976),
        shaken(bob()),
        shaken(*SPRUNG.pendulum[0].links, amplitude=0.04, frequency=2.54),
        shaken(bob(), amplitude=0.0, frequency=2 * sqrt(G) / tau),
    ]
    listed = stabilities(scenes)
    assert [stability.number for stability in listed] == [-1, 0, 1, 2, 3, 0]
    assert abs(listed[1].largest - 1) < 1e-9
    both = parametric_stability(shaken(bob(), beside=True))
    assert both.multipliers.tolist() == listed[3].multipliers.tolist()


def test_what_has_no_tongues_is_refused() -> None:
    hanging = shaken(bob())
    swept = SweepMotion(direction="vertical", amplitude=0.1, from_hz=1.0, to_hz=2.0, duration=9.0)
    push = ConstantForce(on="pendulum[0].links[0]", amplitude=1.0)
    for scene, words in (
        (hanging.replace(support=Cart(mass=1.0)), 'kind = "moved"'),
        (hanging.replace(support=Moved(motion=swept)), 'kind = "sweep"'),
        (hanging.replace(force=(push,)), "remove the force"),
        (shaken(bob(quadratic_drag=0.1), beside=True), "couples both motions"),
    ):
        with pytest.raises(SceneError, match=words):
            tongues(scene, [0.0, 0.1], [1.0, 2.0])
    with pytest.raises(SceneError, match=r"(?s)amplitude: .*frequency_hz: "):
        tongues(hanging, [0.1, 0.0], [0.0, 1.0])
