"""What time brings: fast evaluations against the functions themselves, and records within the tolerance of a run."""

from __future__ import annotations

from collections.abc import Callable
from math import cos, inf, sin
from pathlib import Path

import numpy as np
import pytest
from scipy.interpolate import CubicSpline, make_interp_spline

from modal import Bob, InitialCondition, Pendulum, Scene
from modal.scene import Fixed, Hoist, Moved, RandomMotion, RecordMotion, SineMotion, SweepMotion
from modal.vibration import prescribed_motion
from modal.vibration.prescribed import Polynomials
from nonlinear import simulate
from nonlinear.dynamics import inputs
from nonlinear.dynamics.inputs import Inputs
from nonlinear.system import system_of

G, L, START, TOLERANCE = 9.81, 1.2, 0.4, 1e-9
TIMES = np.linspace(0.0, 2.0, 401)
NOISE = np.random.default_rng(7).standard_normal(len(TIMES))
RECORDS = {
    "smooth": 0.3 * np.sin(4 * TIMES),
    "noisy": 0.3 * np.sin(4 * TIMES) + 0.05 * NOISE,
    "steps": 0.3 * np.sign(np.sin(4 * TIMES)),
}
SOME = np.arange(40) * 0.05 + 0.3
MOTIONS = {
    "sine": SineMotion(amplitude=0.1, frequency_hz=2.0, phase_deg=20.0),
    "sweep": SweepMotion(amplitude=0.1, from_hz=0.5, to_hz=4.0, duration=1.7),
    "random": RandomMotion(psd=(1.0, 1.0), frequency_hz=(0.5, 8.0), seed=3, duration=2.0),
    "acceleration": RecordMotion(
        time_s=tuple(SOME), acceleration_m_per_s2=tuple(np.cos(5 * SOME)), baseline="velocity"
    ),
    "velocity": RecordMotion(time_s=tuple(SOME), velocity_m_per_s=tuple(np.cos(5 * SOME))),
    "displacement": RecordMotion(time_s=tuple(SOME**1.3), displacement_m=tuple(np.cos(5 * SOME))),
}


@pytest.mark.parametrize("name", MOTIONS)
def test_floats_and_arrays_are_the_derivatives_of_a_motion(name: str) -> None:
    motion = prescribed_motion(MOTIONS[name])
    times = np.concatenate((np.random.default_rng(1).uniform(-1.0, 4.0, 200), [0.0, 1.7, SOME[0], SOME[7]]))
    for order, at in ((1, motion.velocity_at), (2, motion.acceleration_at)):
        exact = np.asarray(motion.derivative(times, order))
        near = 2e-12 * np.abs(exact).max()
        assert np.allclose([at(time) for time in times.tolist()], exact, rtol=0, atol=near)
        assert np.allclose(motion.beside(times[:, None], order)[:, 0], exact, rtol=0, atol=near)


def test_kinks_are_what_truncated_powers_add() -> None:
    """x³ + 2 (x − 1)²₊ − 5 (x − 3)³₊ in pieces of 1, 2 and 2: half the longer neighbour away, 2·1² and 5·1³ more."""
    knots = np.array([0.0, 1.0, 3.0, 5.0])
    rows = [[0, 0, 0, 0], [0, 0, 0, 1], [1, 3, 5, 1], [35, 35, 11, -4], [141, 0, 0, 0]]
    own = Polynomials(knots, np.array([0.0, 0.0, 1.0, 3.0]), np.array(rows[:4], dtype=float))
    own = Polynomials(knots, np.append(own.origins, 5.0), np.array(rows, dtype=float))
    assert own.kinks[1:3] == pytest.approx([2.0, 5.0], rel=1e-14)
    assert own.kinks[0] == pytest.approx(0.5**3)
    assert own.beside(np.array([-1.0, 2.0, 4.0, 9.0])) == pytest.approx([0.0, 10.0, 77.0, 141.0])


def swinging(**link: object) -> Pendulum:
    angle = InitialCondition(angles_deg=(float(np.degrees(START)),))
    return Pendulum(links=(Bob(mass=1.0, length=L, **link),), start=angle)


def by_hand(rate: Callable[[float, float, float, int], float]) -> float:
    """The last angle of θ'' = rate(s, θ, θ', piece) by the classical Runge-Kutta method, extrapolated."""
    coarse, fine = (_by_hand(rate, steps) for steps in (16, 32))
    return fine + (fine - coarse) / 15


def _by_hand(rate: Callable[[float, float, float, int], float], steps: int) -> float:
    a, p, h = START, 0.0, (TIMES[1] - TIMES[0]) / steps
    for piece in range(len(TIMES) - 1):
        for step in range(steps):
            s, half = step * h, h / 2
            k1, m1 = p, rate(s, a, p, piece)
            k2, m2 = p + half * m1, rate(s + half, a + half * k1, p + half * m1, piece)
            k3, m3 = p + half * m2, rate(s + half, a + half * k2, p + half * m2, piece)
            k4, m4 = p + h * m3, rate(s + h, a + h * k3, p + h * m3, piece)
            a, p = a + h / 6 * (k1 + 2 * (k2 + k3) + k4), p + h / 6 * (m1 + 2 * (m2 + m3) + m4)
    return a


def lifted(lengths: np.ndarray, folder: Path) -> tuple[Scene, float]:
    """A bob on a rope of these lengths, and its last angle by l θ'' + 2 l' θ' + g sin θ = 0."""
    path = folder / "lengths.csv"
    rows = [f"{time!r},{length!r}" for time, length in zip(TIMES.tolist(), lengths.tolist(), strict=True)]
    path.write_text("\n".join(["time_s,length_m", *rows]), encoding="utf-8")
    pieces = CubicSpline(TIMES, lengths, bc_type="clamped").c.T.tolist()

    def rate(s: float, a: float, p: float, piece: int) -> float:
        d, c, b, length = pieces[piece]
        return -(2 * ((3 * d * s + 2 * c) * s + b) * p + G * sin(a)) / (((d * s + c) * s + b) * s + length)

    scene = Scene(gravity=G, support=Fixed(), pendulum=(swinging(hoist=Hoist(file=str(path))),))
    return scene, by_hand(rate)


def shaken(displacements: np.ndarray) -> Scene:
    """A bob on a support with this record."""
    motion = RecordMotion(time_s=tuple(TIMES.tolist()), displacement_m=tuple(displacements.tolist()))
    return Scene(gravity=G, support=Moved(motion=motion), pendulum=(swinging(),))


def last_angle(displacements: np.ndarray) -> float:
    """Its last angle by l θ'' + g sin θ + s'' cos θ = 0."""
    spline = make_interp_spline(TIMES, displacements, k=5).derivative(2)
    inner = np.linspace(0.0, TIMES[1] - TIMES[0], 65)[:-1]
    values = spline(TIMES[:-1, None] + inner).tolist()
    values = [[*row, after[0]] for row, after in zip(values, [*values[1:], [float(spline(TIMES[-1]))]], strict=True)]
    part = inner[1]

    def rate(s: float, a: float, p: float, piece: int) -> float:
        return -(G * sin(a) + values[piece][round(s / part)] * cos(a)) / L

    return by_hand(rate)


@pytest.mark.parametrize("name", RECORDS)
def test_records_of_lengths_are_followed_within_the_tolerance(name: str, tmp_path: Path) -> None:
    scene, exact = lifted(L + 0.3 * (RECORDS[name] - RECORDS[name][0]) / 4, tmp_path)
    run = simulate(scene, 2.0, tolerance=TOLERANCE, output=2)
    assert abs(run.motion.links[-1, 0] - exact) < 5 * TOLERANCE
    assert abs(simulate(scene, 2.0, tolerance=1e-12, output=2).motion.links[-1, 0] - exact) < TOLERANCE / 3


@pytest.mark.parametrize("name", RECORDS)
def test_records_of_a_support_are_followed_within_the_tolerance(name: str) -> None:
    run = simulate(shaken(0.01 * RECORDS[name]), 2.0, tolerance=TOLERANCE, output=2)
    assert abs(run.motion.links[-1, 0] - last_angle(0.01 * RECORDS[name])) < 5 * TOLERANCE


def test_steps_that_pass_over_knots_would_not_do(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(inputs, "LEAST_BEND", inf)
    run = simulate(shaken(0.01 * RECORDS["noisy"]), 2.0, tolerance=TOLERANCE, output=2)
    assert abs(run.motion.links[-1, 0] - last_angle(0.01 * RECORDS["noisy"])) > 20 * TOLERANCE


def test_a_bend_below_the_tolerance_ends_no_step() -> None:
    """Of a smooth record only its ends are breaks; of one with a jump those near it; of noise every knot."""
    counts = {}
    for name, values in RECORDS.items():
        own = Inputs(system_of(shaken(0.01 * values)))
        counts[name] = [len(own.breaks(accuracy)) for accuracy in (1e-6, TOLERANCE, 0.0)]
    assert counts["smooth"][0] == 2
    assert counts["noisy"][1:] == [397, 397]
    assert 2 < counts["steps"][0] < counts["steps"][1] < 300
    assert {own[2] for own in counts.values()} == {397}
