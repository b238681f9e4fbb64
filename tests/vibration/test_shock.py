"""Shock: exact histories, spectra, and combinations of peaks against the textbook."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from math import pi, tau
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import minimize_scalar

from modal import Bob, Cart, Fixed, Pendulum, Rod, Scene
from modal.scene import RecordMotion
from modal.statespace import state_space
from modal.vibration import Record, correlation, cqc, prescribed_motion, response_spectrum, shock_response, srss
from modal.vibration.shock import phi

TIMES = np.arange(120) * 0.05
PUSH = RecordMotion(
    time_s=tuple(TIMES.tolist()),
    acceleration_m_per_s2=tuple((np.sin(3.0 * TIMES) * np.sin(pi * TIMES / 5.95) ** 2 + 0.1).tolist()),
)
HELD = Fixed()
ALL = ("angles", "tip_accelerations", "tip_positions", "pivot_forces")


def scene(support: Fixed | Cart = HELD, damping: float = 0.02, drag: float = 0.0) -> Scene:
    links = (Bob(mass=1.3, length=0.8, damping=damping, drag=drag), Rod(mass=0.4, length=0.5, damping=2 * damping))
    return Scene(gravity=9.81, support=support, pendulum=(Pendulum(links=links),))


def whole(scene: Scene, record: Record, times: np.ndarray, outputs: tuple[str, ...]) -> np.ndarray:
    """The outputs by an integrator of the whole model."""
    model = state_space(scene, ("support_acceleration",), outputs)
    moving = {"support": record.displacement(record.first), "support_dot": record.velocity(record.first)}
    begun = [float(moving.get(state.name, 0.0)) for state in model.states]
    run = solve_ivp(
        lambda t, z: model.A @ z + model.B[:, 0] * record.acceleration_at(t),
        (times[0], times[-1]), begun, "DOP853", t_eval=times, rtol=1e-10, atol=1e-12, max_step=0.05,
    )  # fmt: skip
    return np.asarray(model.C @ run.y + model.D * record.acceleration(times))


@pytest.mark.parametrize(
    "support", [Fixed(), Cart(mass=2.0), Cart(mass=2.0, stiffness=3.0, damping=1.0), Cart(mass=0.5, damping=90.0)]
)
@pytest.mark.parametrize(("damping", "drag"), [(0.0, 0.0), (0.02, 0.0), (0.0, 0.3)])
def test_histories_are_those_of_the_whole_model(support: Fixed | Cart, damping: float, drag: float) -> None:
    example = scene(support, damping, drag)
    response = shock_response(example, PUSH, ALL)
    inside = response.times <= response.record.last
    exact = whole(example, response.record, response.times[inside], ALL)
    assert response.history[:, inside] == pytest.approx(exact, abs=1e-7 * max(1.0, np.abs(exact).max()))
    assert response.times[-1] > response.record.last
    assert response.peaks[:, 0] == pytest.approx(np.abs(response.history).max(1), rel=2e-3, abs=1e-9)


MOVING = {
    "velocity": RecordMotion(time_s=(0.0, 0.5, 1.0, 1.5, 2.0), velocity_m_per_s=(0.1,) * 5),
    "displacement_m": RecordMotion(
        time_s=tuple((TIMES + 0.4).tolist()), displacement_m=tuple(np.cos(2.0 * TIMES + 0.3))
    ),
    "velocity_m_per_s": RecordMotion(time_s=PUSH.time_s, velocity_m_per_s=tuple(np.cos(1.7 * TIMES) + 0.3)),
}


@pytest.mark.parametrize("name", MOVING)
@pytest.mark.parametrize("support", [Fixed(), Cart(mass=2.0), Cart(mass=2.0, stiffness=3.0, damping=1.0)])
def test_a_support_that_begins_to_move_carries_along_what_hangs_from_it(support: Fixed | Cart, name: str) -> None:
    outputs = (*ALL, "cart_velocity") if isinstance(support, Cart) else ALL
    example = scene(support)
    response = shock_response(example, MOVING[name], outputs)
    inside = response.times <= response.record.last
    exact = whole(example, response.record, response.times[inside], outputs)
    assert response.history[:, inside] == pytest.approx(exact, abs=1e-7 * max(1.0, np.abs(exact).max()))
    if name == "velocity" and support == HELD:
        tip = [signal.name for signal in response.outputs].index("tip_1")
        assert response.history[tip] == pytest.approx(0.1 * response.times, abs=1e-12)


def test_a_record_of_displacement_is_the_same_motion() -> None:
    smooth = np.sin(1.9 * TIMES)
    moves = RecordMotion(time_s=PUSH.time_s, displacement_m=tuple(smooth.tolist()))
    pushes = RecordMotion(time_s=PUSH.time_s, acceleration_m_per_s2=tuple((-(1.9**2) * smooth).tolist()))
    response, other = (shock_response(scene(), motion, ("angles",)) for motion in (moves, pushes))
    assert response.peaks[:, 0] == pytest.approx(other.peaks[:, 0], rel=1e-4)


def test_the_spectrum_is_the_peak_of_one_pendulum() -> None:
    """A simple pendulum of length l is an oscillator whose displacement is l θ."""
    length, zeta = 0.7, 0.05
    omega = np.sqrt(9.81 / length)
    link = Bob(mass=2.0, length=length, damping=2 * zeta * omega * 2.0 * length**2)
    single = Scene(gravity=9.81, pendulum=(Pendulum(links=(link,)),))
    response = shock_response(single, PUSH, ("angles",))
    spectrum = response_spectrum(response.record, np.array([omega / tau]), zeta)
    assert length * response.peaks[0, 0] == pytest.approx(spectrum[0], rel=1e-6)
    assert response.srss[0] == pytest.approx(response.peaks[0, 0], rel=1e-12)
    assert response.cqc[0] == pytest.approx(response.peaks[0, 0], rel=1e-12)


def test_a_half_sine_pulse_has_its_textbook_spectrum() -> None:
    """An undamped oscillator of T = t_d/1.5… under a half sine: closed form after the pulse (Chopra, §4.8)."""
    pulse, f = 1.0, 0.3
    t = np.linspace(0.0, pulse, 401)
    record = prescribed_motion(
        RecordMotion(time_s=tuple(t.tolist()), acceleration_m_per_s2=tuple(np.sin(pi * t / pulse).tolist()))
    )
    assert isinstance(record, Record)
    ratio = f * pulse
    amplification = 2 * ratio * np.cos(pi * ratio) / (4 * ratio**2 - 1)
    omega = tau * f
    assert response_spectrum(record, np.array([f]), 0.0)[0] == pytest.approx(
        abs(2 * amplification) / omega**2, rel=1e-3
    )


def test_srss_and_cqc_are_the_textbook_formulas() -> None:
    """Der Kiureghian's coefficient for equal damping (Chopra, Dynamics of Structures, equation (13.7.10))."""
    omega, zeta = np.array([4.0, 4.4, 9.0]), np.full(3, 0.05)
    beta = omega[:, None] / omega
    equal = 8 * 0.05**2 * (1 + beta) * beta**1.5 / ((1 - beta**2) ** 2 + 4 * 0.05**2 * beta * (1 + beta) ** 2)
    assert correlation(omega, zeta) == pytest.approx(equal, rel=1e-12)
    uneven = correlation(omega, np.array([0.02, 0.05, 0.1]))
    assert uneven == pytest.approx(uneven.T, rel=1e-12)
    assert np.diag(uneven) == pytest.approx(np.ones(3))
    peaks = np.array([1.0, -2.0, 0.5])
    assert srss(peaks) == pytest.approx(np.sqrt(5.25))
    by_hand = sum(equal[r, s] * peaks[r] * peaks[s] for r in range(3) for s in range(3))
    assert cqc(peaks, omega, zeta) == pytest.approx(np.sqrt(by_hand), rel=1e-12)
    far = np.array([1.0, 30.0, 900.0])
    assert cqc(peaks, far, zeta) == pytest.approx(srss(peaks), rel=1e-2)
    assert cqc(np.array([1.0, -1.0]), np.array([2.0, 2.0]), np.array([0.05, 0.05])) == pytest.approx(0.0, abs=1e-12)
    assert correlation(np.array([1.0, 2.0]), np.zeros(2)) == pytest.approx(np.eye(2))


def test_combinations_are_near_the_exact_peak_and_masses_add_up() -> None:
    response = shock_response(scene(), PUSH, ("angles", "tip_positions"))
    assert response.cqc[:2] == pytest.approx(response.peaks[:2, 0], rel=0.3)
    assert np.isnan(response.cqc[2])
    assert response.mass_shares.sum() == pytest.approx(1.0, rel=1e-12)
    cumulative = np.cumsum(response.mass_shares)
    assert response.enough == 1 + int(np.argmax(cumulative >= 0.9))


def test_phi_functions() -> None:
    z = np.array([1e-9, -0.3 + 0.2j, 0.999, -1.001, -40.0 + 300j])
    expected = [(np.expm1(z) / z), (np.expm1(z) - z) / z**2]
    assert phi(z, 2)[0] == pytest.approx(expected[0], rel=1e-13)
    assert phi(z, 2)[1][1:] == pytest.approx(expected[1][1:], rel=1e-11)
    assert phi(z, 3)[2][0] == pytest.approx(1 / 6)


def test_a_peak_is_never_taken_across_a_jump() -> None:
    """A rod under a ramp that ends at 120 m/s²: θ'' = −ω²θ − (3/2l) a in closed form, with a jump at the end."""
    ramp = RecordMotion(time_s=(0.0, 0.04, 0.08, 0.12), acceleration_m_per_s2=(0.0, 40.0, 80.0, 120.0))
    scene = Scene(gravity=9.81, pendulum=(Pendulum(links=(Rod(mass=1.0, length=1.0),)),))
    response = shock_response(scene, ramp, ("tip_accelerations", "pivot_forces"))
    omega, slope = np.sqrt(1.5 * 9.81), 1000.0
    angle = -1.5 * slope * (0.12 - np.sin(0.12 * omega) / omega) / omega**2
    bend = -(omega**2) * angle - 1.5 * 120.0
    assert response.peaks[:, 0] == pytest.approx([abs(120.0 + bend), abs(120.0 + bend / 2)], rel=1e-12)
    assert response.peaks[:, 1] == pytest.approx([0.12, 0.12], rel=1e-12)
    assert response.times[response.times > 0.12][0] == np.nextafter(0.12, 1.0), "what is there just after the end"
    sudden = RecordMotion(time_s=ramp.time_s, acceleration_m_per_s2=(9.0, 9.0, 9.0, 9.0))
    begun = shock_response(scene, sudden, ("tip_accelerations", "pivot_forces")).history[:, 0]
    assert begun == pytest.approx([9.0 - 13.5, -(9.0 - 6.75)], rel=1e-12)


@pytest.mark.parametrize("quantity", ["displacement_m", "velocity_m_per_s", "acceleration_m_per_s2"])
@pytest.mark.parametrize("samples", [4, 7])
def test_peaks_are_those_of_the_smooth_pieces(quantity: str, samples: int) -> None:
    """The largest values by an integrator with dense output, knot to knot, sought by a bounded minimum."""
    rng = np.random.default_rng(samples)
    times = np.concatenate(([0.0], np.cumsum(rng.uniform(0.05, 0.3, samples - 1))))
    motion_values = {quantity: tuple(rng.normal(size=samples).tolist())}
    record, example = RecordMotion(time_s=tuple(times.tolist()), **motion_values), scene(Cart(mass=1.0, stiffness=20.0))
    wanted = ("angles", "tip_accelerations", "pivot_forces")
    response = shock_response(example, record, wanted)
    model, motion = state_space(example, ("support_acceleration",), wanted), response.record
    z, largest = np.zeros(len(model.A)), np.zeros(len(model.C))
    for begin, end in pairwise([*motion.pieces[0].tolist(), float(response.times[-1])]):
        push = motion.acceleration_at if begin < motion.last else lambda t: 0.0

        def slope(t: float, z: np.ndarray, push: Callable[[float], float] = push) -> np.ndarray:
            return model.A @ z + model.B[:, 0] * push(t)

        run = solve_ivp(slope, (begin, end), z, "DOP853", rtol=1e-11, atol=1e-13, dense_output=True)
        fine = np.linspace(begin, end, 400)
        pushes = np.array([push(t) for t in fine.tolist()])
        values = np.abs(model.C @ run.sol(fine) + model.D * pushes)
        for k, at in enumerate(values.argmax(1).tolist()):
            around = fine[max(at - 1, 0)], fine[min(at + 1, 399)]

            def size(t: float, k: int = k, run: Any = run, push: Callable[[float], float] = push) -> float:
                return -abs(float(model.C[k] @ run.sol(t) + model.D[k, 0] * push(t)))

            best = minimize_scalar(size, bounds=around, method="bounded", options={"xatol": 1e-9})
            largest[k] = max(largest[k], -best.fun, values[k, at])
        z = run.y[:, -1]
    assert response.peaks[:, 0] == pytest.approx(largest, rel=1e-7)


def test_spectra_and_peaks_of_modes_know_where_a_record_ends() -> None:
    """A step of constant acceleration: u = −(1 − cos ωt)/ω² until its end, then a free swing about zero."""
    record = prescribed_motion(RecordMotion(time_s=(0.0, 0.1, 0.2, 0.3), acceleration_m_per_s2=(1.0, 1.0, 1.0, 1.0)))
    assert isinstance(record, Record)
    frequencies = np.array([0.2, 0.7, 1.3, 3.0])
    turned = tau * frequencies * 0.3
    ended = 2 * np.abs(np.sin(turned / 2))
    expected = np.where(turned < pi, ended, 2.0) / (tau * frequencies) ** 2
    assert response_spectrum(record, frequencies, 0.0) == pytest.approx(expected, rel=1e-7)
