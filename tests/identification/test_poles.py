"""Poles of records: those of a linear decay to many digits, with noise within their error bars; random responses."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from amounts import usually
from scipy.linalg import expm, solve_continuous_lyapunov

from modal import load
from modal.errors import ComputationError, SceneError
from modal.identification import identify, poles_table
from modal.identification.decays import log_decrement, realize, tall_qr
from modal.modes import natural_modes
from modal.scene import Cart, Scene
from modal.scene.parameters import vary
from modal.statespace import state_space
from nonlinear.integration import Trajectory
from nonlinear.simulation import simulate
from nonlinear.system import state_at_rest

NAMES = ("theta_1_1", "theta_1_2", "theta_1_3")
STEP = 0.02


def scene() -> Scene:
    return vary(load("chain-3"), {"pendulum[0].links[0].damping": 0.02})


@cache
def decay(samples: int = 1000, start: tuple[float, ...] = (0.1, 0.05, -0.1)) -> tuple[np.ndarray, np.ndarray]:
    model = state_space(scene())
    step, state = expm(STEP * model.A), np.array([*start, 0.0, 0.0, 0.0])
    states = [state]
    for _ in range(samples - 1):
        states.append(step @ states[-1])
    return STEP * np.arange(samples), np.array(states) @ model.C.T


def test_the_realization_alone_has_the_poles_of_a_linear_decay() -> None:
    poles, shapes = realize([decay()[1]], STEP, 4).poles(6)
    modes = natural_modes(scene())
    assert np.allclose(poles, modes.eigenvalue, rtol=1e-9)
    exact = modes.matrix.shapes
    assert np.allclose(shapes / shapes[-1], exact / exact[-1], rtol=1e-7)


def test_the_poles_of_a_linear_decay_are_found_to_the_last_digits() -> None:
    identified = identify([decay()], NAMES)
    modes = natural_modes(scene())
    assert np.allclose([mode.pole for mode in identified.modes], modes.eigenvalue, rtol=1e-12)
    assert np.allclose(
        [mode.damping_ratio for mode in identified.modes], [mode.damping_ratio for mode in modes], rtol=1e-9
    )
    assert all(mode.frequency_std < 1e-10 for mode in identified.modes)


def test_offsets_gaps_and_uneven_samples_change_nothing() -> None:
    times, values = decay()
    rng = np.random.default_rng(0)
    kept = np.sort(rng.choice(len(times), 900, replace=False))
    values = values[kept] + np.array([0.2, -0.1, 0.05])
    values[rng.random(values.shape) < 0.02] = np.nan
    identified = identify([(times[kept] + 7.0, values)], NAMES)
    assert np.allclose([mode.pole for mode in identified.modes], natural_modes(scene()).eigenvalue, rtol=1e-9)
    assert any("uneven or missing" in note for note in identified.notes)


def test_noise_lies_within_the_error_bars() -> None:
    times, values = decay()
    other = decay(700, (-0.03, 0.1, 0.02))
    modes, rng, deviations = natural_modes(scene()), np.random.default_rng(1), []
    noise = np.array([2e-3, 1e-3, 3e-3])
    for _ in range(usually(5, 10)):
        segments = [(t, y + noise * rng.standard_normal(y.shape)) for t, y in ((times, values), other)]
        identified = identify(segments, NAMES)
        assert len(identified.modes) == 3
        for measured, mode in zip(identified.modes, modes, strict=True):
            deviations.append((measured.frequency - mode.omega / (2 * np.pi)) / measured.frequency_std)
            deviations.append((measured.damping_ratio - mode.damping_ratio) / measured.damping_ratio_std)
    assert 0.75 < np.std(deviations) < 1.25
    assert np.mean(np.abs(deviations) < 1.96) > 0.88


def test_the_noise_of_a_shape_is_stated() -> None:
    times, values = decay()
    rng, misses, stds = np.random.default_rng(2), [], []
    exact = natural_modes(scene()).matrix.shapes[:, 0].real
    for _ in range(usually(4, 6)):
        mode = identify([(times, values + 2e-3 * rng.standard_normal(values.shape))], NAMES).modes[0]
        misses.append((mode.shape.real - exact / exact[np.argmax(np.abs(exact))])[:2])
        stds.append(mode.shape_std)
    assert np.sqrt(np.mean(np.square(misses))) == pytest.approx(np.mean(stds), rel=0.6)


@cache
def shaken(samples: int = 30_000) -> np.ndarray:
    """Responses to white joint torques, sampled exactly."""
    model = state_space(scene())
    stationary = solve_continuous_lyapunov(model.A, -model.B @ model.B.T)
    step = expm(STEP * model.A)
    noise = stationary - step @ stationary @ step.T
    strength, axes = np.linalg.eigh((noise + noise.T) / 2)
    rng = np.random.default_rng(3)
    kicks = rng.standard_normal((samples, 6)) * np.sqrt(np.maximum(strength, 0.0)) @ axes.T
    states, state = [], np.zeros(6)
    for kick in kicks:
        state = step @ state + kick
        states.append(state)
    return np.array(states) @ model.C.T


def test_random_responses_give_the_poles_within_their_error_bars() -> None:
    values = shaken()
    identified = identify([(STEP * np.arange(len(values)), values)], NAMES, excitation="random")
    modes = natural_modes(scene())
    assert len(identified.modes) == 3
    for measured, mode in zip(identified.modes, modes, strict=True):
        assert abs(measured.frequency - mode.omega / (2 * np.pi)) < 3.5 * measured.frequency_std
        assert abs(measured.damping_ratio - mode.damping_ratio) < 3.5 * measured.damping_ratio_std
        assert measured.frequency_std < 0.01 * measured.frequency
    assert any(pole.stable for pole in identified.stabilization)


def test_the_decrement_of_one_mode_is_that_of_its_pole() -> None:
    times = 0.01 * np.arange(2000)
    pole = complex(-0.1, 3.0)
    values = 0.3 + 0.2 * np.exp(pole * times).real
    decrement = log_decrement(times, values)
    assert decrement.pole == pytest.approx(pole, rel=1e-4)
    noisy = values + 1e-3 * np.random.default_rng(4).standard_normal(len(times))
    mode = identify([(times, noisy[:, None])], ("theta_1_1",), method="decrement").modes[0]
    assert abs(mode.damping_ratio - 0.1 / abs(pole)) < 4 * mode.damping_ratio_std < 0.01
    assert abs(mode.frequency - abs(pole) / (2 * np.pi)) < 4 * mode.frequency_std


def test_two_modes_have_no_decrement() -> None:
    times = 0.01 * np.arange(2000)
    values = np.exp(-0.1 * times) * (np.cos(3 * times) + np.cos(4.3 * times))
    with pytest.raises(ComputationError, match="turning points"):
        identify([(times, values[:, None])], NAMES[:1], method="decrement")


@cache
def swing(links: int, start: tuple[float, ...], duration: float, damping: float) -> tuple[Scene, Trajectory]:
    """A clean swing of a few degrees of bobs below each other, or of two that hang from a heavy cart."""
    scene = vary(load(f"chain-{links}"), {"pendulum[*].links[*].damping": damping})
    if len(start) > links:
        scene = scene.replace(pendulum=scene.pendulum * 2, support=Cart(mass=200.0))
    times = np.arange(0, duration, 0.04)
    return scene, simulate(scene, duration, start=state_at_rest(scene, start), output=times, tolerance=1e-10)


def test_a_frequency_that_changes_with_amplitude_is_no_second_mode() -> None:
    scene, run = swing(2, (-2.6, 2.2), 25.0, 0.03)
    parts = [(run.times, run.motion.links), (run.times[:300], run.motion.links[-300:])]
    for segments, sensors in usually(((parts, 2),), ((parts[:1], 2), (parts[:1], 1), (parts, 2))):
        identified = identify([(times, values[:, :sensors]) for times, values in segments], NAMES[:sensors])
        assert len(identified.modes) == 2
        fast, mode = identified.modes[1], natural_modes(scene)[1]
        assert abs(fast.frequency - mode.omega / (2 * np.pi)) < 3 * fast.frequency_std < 3e-3 * fast.frequency
        assert fast.damping_ratio == pytest.approx(mode.damping_ratio, rel=0.02)
        assert fast.frequency_shift is not None
        assert fast.frequency_shift < -1e-3 * fast.frequency
    assert any("one mode whose frequency changes with amplitude" in note for note in identified.notes)


def test_the_change_of_a_single_pendulums_frequency_is_a_sixteenth_of_its_squared_angle() -> None:
    """ω = √(g/l) (1 − θ²/16 + …) (Landau & Lifshitz, Mechanics, §11)."""
    scene, run = swing(1, (3.0,), 100.0, 0.1)
    (mode,) = identify([(run.times, run.motion.links)], NAMES[:1]).modes
    assert mode.frequency == pytest.approx(natural_modes(scene)[0].omega / (2 * np.pi), rel=3e-6)
    assert mode.frequency_shift is not None
    assert mode.frequency_shift / mode.frequency == pytest.approx(-(np.radians(3.0) ** 2) / 16, rel=0.02)


@pytest.mark.parametrize("start", [(60.0, 70.0), (30.0, 35.0)])
def test_large_swings_of_two_links_are_two_modes_and_their_tones(start: tuple[float, float]) -> None:
    scene, run = swing(2, start, 30.0, 0.05)
    identified = identify([(run.times, run.motion.links)], NAMES[:2])
    slow, fast = (mode.omega / (2 * np.pi) for mode in natural_modes(scene))
    assert len(identified.modes) == 2
    for mode, frequency in zip(identified.modes, (slow, fast), strict=True):
        assert mode.frequency_of == "large swings" or abs(mode.frequency - frequency) < 2 * mode.frequency_std
        assert mode.frequency == pytest.approx(frequency, rel=np.radians(max(start)) ** 2 / 16)
    assert any("perhaps not a mode, but due to large swings, as +3 f1" in note for note in identified.notes)


def test_dry_friction_is_one_mode_whose_turning_points_lose_the_same() -> None:
    """In each half swing about ±f the turning point is nearer by 2 f, and its frequency stays (Coulomb 1785)."""
    omega, friction, times, start = 8.0, 0.003, 0.01 * np.arange(900), 0.0661
    half = np.minimum(times * omega / np.pi, 10).astype(int)  # at rest within ±f after ten of them and the next
    turns = np.minimum(omega * times - np.pi * half, np.pi)
    values = (-1.0) ** half * ((start - 2 * friction * half - friction) * np.cos(turns) + friction)
    (mode,) = (identified := identify([(times, values[:, None])], NAMES[:1])).modes
    assert mode.frequency == pytest.approx(omega / (2 * np.pi), rel=5e-3)
    assert log_decrement(times, values).loss == pytest.approx(2 * friction, rel=0.02)
    assert any("as with dry friction" in note for note in identified.notes)
    viscous = 0.06 * np.exp(-0.1 * times) * np.cos(omega * times)
    assert log_decrement(times, viscous).loss is None


def test_tall_matrices_are_factored_by_blocks() -> None:
    matrix = np.random.default_rng(2).standard_normal((1003, 7))
    Q, R = tall_qr(matrix, 100)
    assert np.allclose(Q @ R, matrix, rtol=0, atol=1e-13)
    assert np.allclose(Q.T @ Q, np.eye(7), rtol=0, atol=1e-14)
    assert np.allclose(np.abs(R), np.abs(np.linalg.qr(matrix)[1]), rtol=0, atol=1e-13)


def test_close_modes_stay_two() -> None:
    """By their shapes, in phase and in antiphase on a heavy cart, or where one sensor sees them beat."""
    scene, run = swing(1, (2.5, 1.5), 30.0, 0.02)
    motion = np.column_stack((run.motion.links, run.motion.cart))
    identified = identify([(run.times, motion)], ("theta_1_1", "theta_2_1", "cart"))
    frequencies = [mode.omega / (2 * np.pi) for mode in natural_modes(scene) if mode.oscillates]
    assert np.allclose([mode.frequency for mode in identified.modes], frequencies, rtol=3e-4)
    assert frequencies[1] / frequencies[0] < 1.01
    times, rng = 2 * STEP * np.arange(1500), np.random.default_rng(6)
    for beats in (1.5, 4.0):
        poles = 2j * np.pi * np.array([1.0, 1.0 + beats / 60]) - np.array([0.01, 0.015])
        values = (np.exp(np.outer(times, poles)) @ np.array([0.04, 0.02 - 0.01j])).real
        for noise in (0.0, 1e-5):
            two = identify([(times, (values + noise * rng.standard_normal(1500))[:, None])], NAMES[:1]).modes
            assert np.allclose([mode.frequency for mode in two], np.abs(poles) / (2 * np.pi), rtol=1e-4)
            assert all(mode.frequency_shift is None for mode in two)


def test_noise_alone_has_no_poles() -> None:
    rng = np.random.default_rng(5)
    with pytest.raises(ComputationError, match="no oscillation"):
        identify([(STEP * np.arange(400), rng.standard_normal((400, 2)))], NAMES[:2])
    with pytest.raises(SceneError, match="5 samples"):
        identify([(STEP * np.arange(5), np.zeros((5, 1)))], NAMES[:1])
    with pytest.raises(ComputationError, match="too short for random excitation"):
        identify([decay(300)], NAMES, excitation="random")


def test_tables_have_the_columns_of_measured_modes() -> None:
    identified = identify([decay()], NAMES)
    header, first, *_ = poles_table(identified, "csv").splitlines()
    assert header == "mode,frequency_hz,std_hz,damping_ratio,damping_ratio_std,theta_1_1,theta_1_2,theta_1_3,shape_std"
    assert float(first.split(",")[1]) == pytest.approx(identified.modes[0].frequency, rel=1e-15)
    assert "eigensystem realization" in poles_table(identified, "text", "run.csv")
