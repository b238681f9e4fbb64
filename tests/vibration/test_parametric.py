"""Parametric excitation: Ince and Strutt's chart, Kapitza's pendulum, many links."""

from __future__ import annotations

from math import sqrt, tau

import numpy as np
import pytest
from scipy.special import mathieu_a, mathieu_b

from modal import Bob, Pendulum, Rod, Scene, SceneError, natural_modes
from modal.scene import Moved, SineMotion
from modal.vibration import parametric_stability

G, LENGTH = 9.81, 1.0


def shaken(
    amplitude: float, frequency: float, *, damping: float = 0.0, way: str = "down", length: float = LENGTH
) -> Scene:
    link = Bob(mass=1.0, length=length, damping=damping)
    motion = SineMotion(direction="vertical", amplitude=amplitude, frequency_hz=frequency)
    hung = Pendulum(links=(link,), equilibrium=(way,))
    return Scene(gravity=G, support=Moved(motion=motion), pendulum=(hung,))


@pytest.mark.parametrize("q", [0.1, 0.5])
@pytest.mark.parametrize("edge", [(mathieu_b, 1, -1), (mathieu_a, 1, 1), (mathieu_b, 2, -1), (mathieu_a, 2, 1)])
def test_tongues_are_those_of_mathieus_equation(q: float, edge: tuple[object, int, int]) -> None:
    """y'' + (a − 2 q cos 2τ) y = 0 with a = 4g/(lΩ²) and q = 2A/l: unstable between b_k and a_k."""
    function, order, side = edge
    a = float(function(order, q))  # type: ignore[operator]
    for step, grows in ((1e-3 * side * q**order, False), (-1e-3 * side * q**order, True)):
        omega = sqrt(4 * G / LENGTH / (a + step))
        assert parametric_stability(shaken(q * LENGTH / 2, omega / tau)).grows == grows


def test_on_a_tongues_edge_the_trace_is_two() -> None:
    q = 0.3
    for a in (float(mathieu_b(1, q)), float(mathieu_a(1, q)), float(mathieu_b(2, q)), float(mathieu_a(2, q))):
        stability = parametric_stability(shaken(q * LENGTH / 2, sqrt(4 * G / LENGTH / a) / tau))
        assert abs(stability.multipliers.sum().real) == pytest.approx(2.0, abs=1e-10)
        assert abs(np.prod(stability.multipliers)) == pytest.approx(1.0, rel=1e-10)


def test_kapitzas_condition() -> None:
    """An inverted pendulum stands where a²Ω² > 2 g l, in the limit of small amplitudes."""
    amplitude = 0.002
    for share, grows in ((0.99, True), (1.01, False)):
        omega = sqrt(share * 2 * G * LENGTH) / amplitude
        assert parametric_stability(shaken(amplitude, omega / tau, way="up")).grows == grows


def test_kapitzas_averaged_frequency() -> None:
    """ω² = a²Ω²/(2 l²) − g/l about the upper position (Landau & Lifshitz, §30, problem 1)."""
    amplitude, omega = 0.004, 3000.0
    stability = parametric_stability(shaken(amplitude, omega / tau, way="up"))
    averaged = sqrt((amplitude * omega) ** 2 / (2 * LENGTH**2) - G / LENGTH)
    assert abs(np.angle(stability.multipliers[0])) / stability.period == pytest.approx(averaged, rel=2e-3)
    assert stability.growth_rate == pytest.approx(0.0, abs=1e-6)


def test_without_motion_the_multipliers_are_those_of_the_modes() -> None:
    links = (Rod(mass=1.0, length=0.4, damping=0.01), Bob(mass=0.5, length=0.3, stiffness=0.2))
    motion = SineMotion(direction="vertical", amplitude=0.0, frequency_hz=2.0)
    scene = Scene(gravity=G, support=Moved(motion=motion), pendulum=(Pendulum(links=links),))
    values = natural_modes(scene).eigenvalue
    expected = np.exp(np.concatenate([values, values.conj()]) / 2.0)
    multipliers = parametric_stability(scene).multipliers
    assert sorted(multipliers, key=lambda z: (abs(z), z.imag)) == pytest.approx(
        sorted(expected, key=lambda z: (abs(z), z.imag)), rel=1e-9
    )


def test_damping_lifts_the_tongue() -> None:
    at = 2 * sqrt(G / LENGTH) / tau
    assert parametric_stability(shaken(0.02, at, damping=0.0)).grows
    lost = parametric_stability(shaken(0.02, at, damping=0.5))
    assert not lost.grows
    assert lost.growth_rate < 0
    assert "decay" in lost.words


def test_other_motions_are_refused() -> None:
    along = SineMotion(direction="horizontal", amplitude=0.1, frequency_hz=1.0)
    with pytest.raises(SceneError, match='kind = "moved"'):
        parametric_stability(shaken(0.1, 1.0).still)
    with pytest.raises(SceneError, match="along the rail only"):
        parametric_stability(shaken(0.1, 1.0).replace(support=Moved(motion=along)))
