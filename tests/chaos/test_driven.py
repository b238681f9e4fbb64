"""Exponents of driven scenes: against Floquet multipliers that SciPy finds, two near runs, and the loss of area."""

from __future__ import annotations

import numpy as np
import pytest
from amounts import usually
from scipy.integrate import solve_ivp

from modal.errors import SceneError
from modal.scene import Bob, Moved, Pendulum, RecordMotion, Scene, SineForce, SineMotion, load
from modal.scene.parameters import parse_variations, vary
from modal.types import Floats
from nonlinear import ensemble, simulate
from nonlinear.chaos import lyapunov_exponent
from nonlinear.dynamics.variational import Variational
from nonlinear.sweeps import Study, parse_measures, sweep
from nonlinear.system import State, system_of

DRIVEN = load("driven-pendulum")
BETA, OMEGA_0, OMEGA = 0.375 * np.pi * 2, 3 * np.pi, 2 * np.pi


def textbook(gamma: float) -> Scene:
    return vary(DRIVEN, {"force[0].amplitude": gamma})


def multipliers(gamma: float) -> Floats:
    """Those of the motion of period 1 s from −90°, of θ'' + 2β θ' + ω₀² sin θ = γ ω₀² cos ωt."""

    def rates(t: float, y: Floats) -> list[float]:
        angle, rate, a, b, c, d = y
        slope = -(OMEGA_0**2) * np.cos(angle)
        force = gamma * OMEGA_0**2 * np.cos(OMEGA * t)
        turned = -2 * BETA * rate - OMEGA_0**2 * np.sin(angle) + force
        return [rate, turned, b, slope * a - 2 * BETA * b, d, slope * c - 2 * BETA * d]

    def period(y: Floats) -> Floats:
        begun = [*y, 1.0, 0.0, 0.0, 1.0]
        return solve_ivp(rates, (0.0, 1.0), begun, method="DOP853", rtol=1e-12, atol=1e-12).y[:, -1]

    y = np.array([-np.pi / 2, 0.0])
    for _ in range(8):
        y = period(y)[:2]
    for _ in range(6):
        end = period(y)
        M = end[2:].reshape(2, 2).T
        y = y + np.linalg.solve(np.eye(2) - M, end[:2] - y)
    assert np.abs(period(y)[:2] - y).max() < 1e-10
    return np.linalg.eigvals(M)


@pytest.mark.parametrize("gamma", usually([1.06], [0.9, 1.06]))
def test_of_a_periodic_motion_it_is_the_logarithm_of_the_largest_multiplier(gamma: float) -> None:
    mu = multipliers(gamma)
    assert np.prod(mu).real == pytest.approx(np.exp(-2 * BETA), rel=1e-8)  # the sum of all exponents is −2β
    exponent = lyapunov_exponent(textbook(gamma), 60.0, members=2, spread=1e-6, tolerance=1e-9)
    expected = np.log(np.abs(mu)).max()
    if np.iscomplex(mu).any():
        assert expected == pytest.approx(-BETA, rel=1e-8)
        assert exponent.value == pytest.approx(expected, abs=0.02)  # |v| turns as it shrinks
    else:
        assert exponent.value == pytest.approx(expected, abs=1e-4)
    assert exponent.is_negative
    assert "a small error halves every" in exponent.text()
    assert exponent.words().startswith("-")


def test_a_weak_drive_leaves_the_exponent_half_the_damping() -> None:
    """Both exponents of θ'' + c θ' + … are −c/2 where multipliers are complex: their sum is −c."""
    links = [Bob(mass=1.0, length=1.0, damping=0.6)]
    force = SineForce(on="pendulum[0].links[0]", direction="torque", amplitude=0.1, frequency_hz=0.8)
    scene = Scene(gravity=9.81, pendulum=[Pendulum(links=links, start={"angles_deg": [5.0]})], force=[force])
    exponent = lyapunov_exponent(scene, 50.0, members=2)
    assert exponent.value == pytest.approx(-0.3, abs=0.01)


def test_all_exponents_add_up_to_the_loss_of_area_in_chaos_too() -> None:
    """Their sum is the mean of the trace of the tangent equations, which is −2β wherever the motion goes."""
    tangent = Variational(system_of(DRIVEN))
    assert tangent.inputs_at is not None
    for time, y in enumerate(np.random.default_rng(2).uniform(-9, 9, (5, 2))):
        _, J = tangent.linearize(y, tangent.inputs_at(0.37 * time, y))
        assert np.trace(J) == pytest.approx(-2 * BETA, rel=1e-13)


def test_the_driven_pendulum_of_the_textbook_is_chaotic_at_1105_and_not_at_106() -> None:
    chaotic, regular = (lyapunov_exponent(textbook(gamma), 40.0, members=3) for gamma in (1.105, 1.06))
    assert chaotic.is_positive
    assert 0.5 < chaotic.value < 1.0
    assert regular.is_negative
    study = Study(DRIVEN, parse_variations(["force[0].amplitude=1.06,1.105"]), parse_measures(["lyapunov:15"]))
    low, high = sweep(study, workers=1).values("lyapunov_per_s")
    assert low < 0 < high


def double(**more: object) -> Scene:
    links = [Bob(mass=1.0, length=0.9, damping=0.05), Bob(mass=0.6, length=0.7)]
    return Scene(gravity=9.81, pendulum=[Pendulum(links=links, start={"angles_deg": [25.0, -40.0]})], **more)


SHAKEN = {
    "force": double(force=[SineForce(on="pendulum[0].links[1]", amplitude=3.0, frequency_hz=0.9, phase_deg=40.0)]),
    "both ways": double(
        support=Moved(
            motion=(
                SineMotion(amplitude=0.05, frequency_hz=1.2),
                SineMotion(direction="vertical", amplitude=0.03, frequency_hz=2.4, phase_deg=30.0),
            )
        )
    ),
}


@pytest.mark.parametrize("name", SHAKEN)
def test_of_members_it_is_that_of_two_near_runs(name: str) -> None:
    scene = SHAKEN[name]
    runs = ensemble(scene, 2.0, vary={"gravity": [9.81]}, engine="numpy", measures=["lyapunov"], workers=1, check=0)
    v = np.random.default_rng(0).standard_normal(4)
    scale = np.array([1, 1, np.sqrt(9.81 / 0.7), np.sqrt(9.81 / 0.7)])
    begun, ends = np.append(np.radians([25.0, -40.0]), [0.0, 0.0]), []
    for sign in (1, -1):
        y = begun + sign * 1e-5 * v / np.linalg.norm(v) * scale
        run = simulate(scene, 3.0, start=State(y[:2], y[2:]), output=[0.0, 1.0, 3.0], tolerance=1e-12).motion
        ends.append(np.hstack((run.links, run.link_rates))[1:])
    early, late = np.linalg.norm((ends[0] - ends[1]) / 2e-5 / scale, axis=1)
    assert runs.column("lyapunov_per_s")[0] == pytest.approx(np.log(late / early) / 2.0, abs=1e-5)


def test_a_motion_that_does_not_repeat_is_refused() -> None:
    motion = RecordMotion(time_s=(0.0, 1.0, 2.0, 3.0), displacement_m=(0.0, 0.1, 0.0, 0.1))
    with pytest.raises(SceneError, match=r'support\.motion\.kind = "record": is not periodic'):
        lyapunov_exponent(double(support=Moved(motion=motion)), 20.0)
