"""Poles of loops in samples: the characteristic polynomial by hand, and how small motions of the equations grow."""

from __future__ import annotations

from typing import Any

import mpmath
import numpy as np
import pytest

from modal import natural_modes
from modal.errors import ComputationError
from modal.scene import Scene, dump, scene_from
from modal.statespace import state_space, to_modal_form
from modal.statespace.loops import without_samples
from multipendula.cli import main
from nonlinear import simulate
from nonlinear.system import State

MASS, LENGTH, GRAVITY = 2.0, 1.5, 9.81
OMEGA = np.sqrt(GRAVITY / LENGTH)


def scene_of(*feedback: dict[str, Any], **more: Any) -> Scene:
    links = [{"kind": "bob", "mass": MASS, "length": LENGTH}]
    return scene_from({"gravity": GRAVITY, "pendulum": [{"links": links}], "feedback": [*feedback], **more})


def torque(*gains: float, **more: Any) -> dict[str, Any]:
    return {"input": "torque_1_1", "gains": {"states": ["theta_1_1", "theta_dot_1_1"], "rows": [[*gains]]}, **more}


def on_cart(*feedback: dict[str, Any]) -> Scene:
    return scene_of(*feedback, support={"kind": "cart", "mass": 4.0})


@pytest.mark.parametrize("late", [0, 1, 3])
@pytest.mark.parametrize(("T", "gains"), [(0.1, (6.0, 3.0)), (0.9, (2.0, -1.0)), (0.4, (-4.0, 9.0))])
def test_poles_are_the_roots_of_the_polynomial_of_one_pendulum(T: float, gains: Any, late: int) -> None:
    """z^d det(z − Φ) + gains adj(z − Φ) Γ, of a pendulum that a torque holds between samples."""
    c, s = np.cos(OMEGA * T), np.sin(OMEGA * T)
    step = np.array([(1 - c) / OMEGA**2, s / OMEGA]) / (MASS * LENGTH**2)
    adjugate = [np.array([[1.0, 0.0], [0.0, 1.0]]), np.array([[-c, s / OMEGA], [-OMEGA * s, -c]])]
    whole = np.zeros(late + 3)
    whole[:3] = 1.0, -2 * c, 1.0
    whole[-2:] += [np.array(gains) @ part @ step for part in adjugate]
    z = np.roots(whole)
    largest = sorted(z[z.imag >= 0], key=abs)[::-1]
    modes = natural_modes(scene_of(torque(*gains, sample_time=T, delay=late * T)))
    table = sorted(np.exp(modes.eigenvalue * T), key=abs)[::-1]
    for value, expected in zip(table, largest, strict=False):
        assert min(abs(value - expected), abs(value - expected.conjugate())) < 1e-12 * max(1.0, abs(expected))
    assert modes.relative_error_bound.max() < 1e-11


def test_many_samples_are_a_loop_that_never_waits_and_a_pendulum_faster_than_samples_keeps_its_frequency() -> None:
    quick = scene_of(torque(6.0, 3.0, sample_time=1e-5))
    expected = natural_modes(without_samples(quick)).eigenvalue
    assert natural_modes(quick).eigenvalue == pytest.approx(expected, rel=1e-4)
    T = 3.7 * 2 * np.pi / OMEGA  # 3.7 swings between samples
    assert natural_modes(scene_of(torque(0.0, 0.0, sample_time=T))).omega == pytest.approx([OMEGA], rel=1e-12)


def test_a_trolley_whose_place_nothing_feels_has_the_pole_zero_and_moves_with_its_load() -> None:
    brake = {"input": "cart_force", "output": "theta_dot_1_1", "gain": -3.0, "sample_time": 0.2}
    modes = natural_modes(on_cart(brake))
    assert modes.eigenvalue[0] == 0
    assert modes[0].family == "rigid translation"
    swing = np.log(np.linalg.eigvals(_by_hand(0.2, [0.0, 0.0, 0.0, -3.0])).astype(complex)) / 0.2
    assert np.abs(swing - modes.eigenvalue[-1]).min() < 1e-12
    shape = modes.shape(len(modes) - 1)
    assert abs((4.0 + MASS) * shape.cart + MASS * LENGTH * shape.angles[0]) > 1e-3 * abs(shape.cart)  # a force acts


@pytest.mark.parametrize("T", [0.2, 20.0, 2e3, 2e5])
def test_the_error_bound_holds_where_the_load_swings_often_between_samples(T: float) -> None:
    """Against z² − (tr Φ − 3 c) z + … of the swing alone in 50 digits."""
    brake = {"input": "cart_force", "output": "theta_dot_1_1", "gain": -3.0, "sample_time": T}
    modes = natural_modes(on_cart(brake))
    pole, bound = complex(modes.eigenvalue[-1]), modes.relative_error_bound[-1]
    with mpmath.workdps(50):
        push, square = mpmath.mpf(-1) / (4 * mpmath.mpf(LENGTH)), mpmath.mpf(GRAVITY) * 6 / (4 * mpmath.mpf(LENGTH))
        omega = mpmath.sqrt(square)
        c, s = mpmath.cos(omega * mpmath.mpf(T)), mpmath.sin(omega * mpmath.mpf(T))
        step = mpmath.matrix([[c, s / omega + 3 * push * (1 - c) / square], [-omega * s, c + 3 * push * s / omega]])
        half = (step[0, 0] + step[1, 1]) / 2
        z = half + mpmath.sqrt(half**2 - mpmath.det(step))
        turns = mpmath.nint((pole.imag * T - mpmath.arg(z)) / (2 * mpmath.pi))
        exact = (mpmath.log(z) + 2j * mpmath.pi * turns) / mpmath.mpf(T)
        error = float(abs(exact - pole) / abs(exact))
    assert error <= bound < 1e-4


def _by_hand(T: float, gains: list[float]) -> Any:
    """The step of (x, θ, x', θ') of a trolley and a bob under a held force, in powers of T."""
    A = np.zeros((4, 4))
    A[:2, 2:] = np.eye(2)
    A[2:, 1] = MASS * GRAVITY / 4.0, -GRAVITY * (4.0 + MASS) / (4.0 * LENGTH)
    B = np.array([0.0, 0.0, 1 / 4.0, -1 / (4.0 * LENGTH)])
    term, Phi, Gamma = np.eye(4), np.zeros((4, 4)), np.zeros(4)
    for k in range(1, 40):
        Phi, Gamma = Phi + term, Gamma + term @ B * T / k
        term = term @ A * T / k
    return Phi - np.outer(Gamma, gains)


CRANE = {
    "one clock, a delay": ({"sample_time": 0.35, "delay": 0.35},) * 2,
    "two clocks": ({"sample_time": 0.3}, {"sample_time": 0.45, "delay": 0.45}),
    "one that never waits": ({}, {"sample_time": 0.8}),
}


@pytest.mark.parametrize("kind", CRANE)
def test_small_motions_of_the_full_equations_grow_and_turn_so(kind: str) -> None:
    """The last samples of a motion obey y[k+2] = 2 Re(z) y[k+1] − |z|² y[k] of the largest multiplier."""
    place, swing = CRANE[kind]
    scene = on_cart(
        {"input": "cart_force", "output": "x", "gain": 6.0, **place},
        {"input": "cart_force", "output": "x_dot", "gain": 4.0, **swing},
    )
    T = {"one clock, a delay": 0.35, "two clocks": 0.9, "one that never waits": 0.8}[kind]
    modes = natural_modes(scene)
    z = np.exp(modes.eigenvalue * T)
    largest = z[np.argmax(np.abs(z))]
    assert np.sort(np.abs(z))[-2] < 0.99 * abs(largest)
    count = int(np.ceil(25 / np.log(abs(largest) / np.sort(np.abs(z))[-2])))
    start = State(np.array([1e-6]) / max(1.0, abs(largest) ** count), np.zeros(1), cart=0.0, cart_rate=0.0)
    run = simulate(scene, count * T, start=start, output=count + 1, tolerance=1e-12)
    y = run.motion.links[:, 0]
    rows = np.array([y[k : k + 2] for k in range(count - 6, count - 1)])
    scale = np.abs(rows).max(1)
    fit = np.linalg.lstsq(rows / scale[:, None], y[count - 4 : count + 1] / scale, rcond=None)[0]
    assert fit == pytest.approx([-(abs(largest) ** 2), 2 * largest.real], rel=1e-6)


def test_a_table_says_that_slow_samples_make_a_loop_unstable(tmp_path: Any, capsys: Any) -> None:
    scene = on_cart({"input": "cart_force", "output": "x_dot", "gain": 4.0, "sample_time": 1.5, "delay": 1.5})
    assert natural_modes(without_samples(scene)).eigenvalue.real.max() <= 0 < natural_modes(scene).eigenvalue.real.max()
    dump(scene, tmp_path / "slow.toml")
    assert main(["table", str(tmp_path / "slow.toml")]) == 0
    text = capsys.readouterr().out
    assert "unstable" in text
    assert "T = 1.5 s" in text
    model = state_space(scene, ("cart_force",))
    closed = to_modal_form(natural_modes(scene), model).modes.eigenvalue
    assert closed == pytest.approx(natural_modes(without_samples(scene)).eigenvalue)


def test_clocks_that_never_meet_and_what_doubles_do_not_hold_are_refused() -> None:
    loops = [torque(1.0, 1.0, sample_time=T) for T in (0.1, 0.1 * np.sqrt(2))]
    with pytest.raises(ComputationError, match="do not meet within 1000 samples"):
        natural_modes(scene_of(*loops))
    with pytest.raises(ComputationError, match="samples and delays of feedback"):
        natural_modes(scene_of(torque(1.0, 1.0, sample_time=0.001, delay=1.0)))
    links = [{"kind": "bob", "mass": MASS, "length": LENGTH}]
    standing = {"pendulum": [{"links": links, "equilibrium": ["up"]}], "feedback": [torque(30.0, 5.0, sample_time=1e3)]}
    with pytest.raises(ComputationError, match="a fast instability overflows"):
        natural_modes(scene_from({"gravity": GRAVITY, **standing}))
    brake = {"input": "cart_force", "output": "x_dot", "gain": 4.0, "sample_time": 0.1}
    with pytest.raises(ComputationError, match="the mass matrix is singular"):
        natural_modes(scene_of(brake, support={"kind": "cart", "mass": 0.0}))
