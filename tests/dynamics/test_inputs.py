"""What time brings: fast evaluations against the functions themselves, and records within the tolerance of a run."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import nullcontext
from functools import partial
from itertools import pairwise
from math import cos, inf, sin

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from support.loops import interpreted

from modal import Bob, InitialCondition, Pendulum, Scene
from modal.scene import Fixed, Hoist, Moved, RandomMotion, RecordMotion, SineMotion, SweepMotion
from modal.vibration import prescribed_motion
from modal.vibration.prescribed import FloatRows, Polynomials
from nonlinear import ensemble, simulate
from nonlinear.dynamics import inputs
from nonlinear.dynamics.inputs import Inputs
from nonlinear.postprocessing import reaction_forces_of
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


@pytest.mark.parametrize("profile", ["smooth", "trapezoidal", "file", "given"])
@pytest.mark.parametrize("name", MOTIONS)
def test_what_time_brings_is_every_derivative_in_order(name: str, profile: str) -> None:
    more = {"profile": profile} if profile in {"smooth", "trapezoidal"} else {}
    hoist = Hoist(to=0.7, begin=0.2, duration=1.5, **more)  # type: ignore[arg-type]
    if profile == "file":
        hoist = Hoist(time_s=(0.0, 0.4, 1.0, 1.3, 2.0, 2.2), length_m=(L, 1.1, 0.9, 0.95, 0.8, 0.7))
    bob = Bob(mass=1.0, length=L, hoist=None if profile == "given" else hoist)
    scene = Scene(gravity=G, support=Moved(motion=MOTIONS[name]), pendulum=(Pendulum(links=(bob,)),))
    given = {(0, 0): lambda time: (L + 0.1 * sin(time), 0.1 * cos(time), -0.1 * sin(time))}
    system = system_of(scene, given if profile == "given" else None)
    inputs_of_time, motion = Inputs(system), prescribed_motion(MOTIONS[name])
    ((_, law),) = inputs_of_time.laws
    for time in (-0.3, 0.0, 0.21, 0.7, 1.234, 1.7, 2.1, 5.0):
        moved = time if name == "sine" else float(motion.derivative(time, 2))
        assert inputs_of_time.of_time(time) == pytest.approx([moved, *map(float, law(time))], rel=1e-11, abs=1e-11)


def test_a_random_motion_is_never_summed_in_a_run(monkeypatch: pytest.MonkeyPatch) -> None:
    motion = RandomMotion(psd=(0.1, 0.1), frequency_hz=(0.1, 10.0), seed=3, duration=50.0)
    process = prescribed_motion(motion)

    def refuse(*_: object) -> None:
        raise AssertionError

    monkeypatch.setattr(type(process), "derivative", refuse)
    made, fill = [], FloatRows.__missing__
    monkeypatch.setattr(FloatRows, "__missing__", lambda rows, row: made.append(FloatRows.BLOCK) or fill(rows, row))
    bob = Bob(mass=1.0, length=L)
    simulate(Scene(gravity=G, support=Moved(motion=motion), pendulum=(Pendulum(links=(bob,)),)), 1.0)
    assert sum(made) < 0.1 * len(process.polynomials(2).origins)


def test_kinks_are_what_truncated_powers_add() -> None:
    """x³ + 2 (x − 1)²₊ − 5 (x − 3)³₊ in pieces of 1, 2 and 2: half the longer neighbour away, 2·1² and 5·1³ more."""
    knots = np.array([0.0, 1.0, 3.0, 5.0])
    rows = [[0, 0, 0, 0], [0, 0, 0, 1], [1, 3, 5, 1], [35, 35, 11, -4], [141, 0, 0, 0]]
    polynomials = Polynomials(knots, np.array([0.0, 0.0, 1.0, 3.0]), np.array(rows[:4], dtype=float))
    polynomials = Polynomials(knots, np.append(polynomials.origins, 5.0), np.array(rows, dtype=float))
    assert polynomials.kinks[1:3] == pytest.approx([2.0, 5.0], rel=1e-14)
    assert polynomials.kinks[0] == pytest.approx(0.5**3)
    assert polynomials.beside(np.array([-1.0, 2.0, 4.0, 9.0])) == pytest.approx([0.0, 10.0, 77.0, 141.0])


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


def lifted(lengths: np.ndarray) -> tuple[Scene, float]:
    """A bob on a rope of these lengths, and its last angle by l θ'' + 2 l' θ' + g sin θ = 0."""
    hoist = Hoist(time_s=tuple(TIMES.tolist()), length_m=tuple(lengths.tolist()))
    pieces = hoist.law(lengths[0]).coefficients.tolist()

    def rate(s: float, a: float, p: float, piece: int) -> float:
        length, b, c, d = pieces[piece]
        return -(2 * ((3 * d * s + 2 * c) * s + b) * p + G * sin(a)) / (((d * s + c) * s + b) * s + length)

    scene = Scene(gravity=G, support=Fixed(), pendulum=(swinging(hoist=hoist),))
    return scene, by_hand(rate)


def shaken(displacements: np.ndarray) -> Scene:
    """A bob on a support with this record."""
    motion = RecordMotion(time_s=tuple(TIMES.tolist()), displacement_m=tuple(displacements.tolist()))
    return Scene(gravity=G, support=Moved(motion=motion), pendulum=(swinging(),))


def last_angle(displacements: np.ndarray) -> float:
    """Its last angle by l θ'' + g sin θ + s'' cos θ = 0."""
    motion, inner = prescribed_motion(shaken(displacements).support.motion), np.linspace(0.0, TIMES[1] - TIMES[0], 65)
    instants = TIMES[:-1, None] + inner
    instants[:, -1] = np.nextafter(TIMES[1:], 0.0)
    values, part = motion.acceleration(instants).tolist(), inner[1]

    def rate(s: float, a: float, p: float, piece: int) -> float:
        return -(G * sin(a) + values[piece][round(s / part)] * cos(a)) / L

    return by_hand(rate)


HOISTS = {
    "smooth": Hoist(to=0.6, begin=0.2, duration=1.5),
    "trapezoidal": Hoist(to=1.6, begin=0.2, duration=1.5, profile="trapezoidal"),
}
SHAKEN = {
    "sine": SineMotion(direction="vertical", amplitude=0.3, frequency_hz=0.9, phase_deg=20.0),
    "sweep": SweepMotion(amplitude=0.1, from_hz=0.5, to_hz=2.0, duration=1.7),
    "random": RandomMotion(direction="vertical", psd=(1.0, 1.0), frequency_hz=(0.5, 8.0), seed=3, duration=2.0),
    "record": RecordMotion(time_s=tuple(SOME), acceleration_m_per_s2=tuple(np.cos(5 * SOME))),
}


def hoisted(motion: str, hoist: str, **more: float) -> Scene:
    """Two bobs of 1.3 and 0.7 kg on ropes of 1.2 m, which is hoisted, and 0.6 m, below a support that moves."""
    links = (Bob(mass=1.3, length=L, hoist=HOISTS[hoist], **more), Bob(mass=0.7, length=0.6, **more))
    start = InitialCondition(angles_deg=(30.0, -50.0), rates_deg=(10.0, 5.0))
    return Scene(gravity=G, support=Moved(motion=SHAKEN[motion]), pendulum=(Pendulum(links=links, start=start),))


@pytest.mark.parametrize(("motion", "hoist"), [*zip(SHAKEN, [*HOISTS, *HOISTS], strict=True)])
def test_hoists_on_a_moved_support_obey_newtons_law(motion: str, hoist: str) -> None:
    """Of both bobs in the laboratory, projected on what the ropes leave free; the books of energy close."""
    scene = hoisted(motion, hoist)
    support, law = prescribed_motion(SHAKEN[motion]), HOISTS[hoist].law(L)
    vertical = SHAKEN[motion].direction == "vertical"

    def rate(t: float, y: np.ndarray) -> list[float]:
        a, b, p, q = y
        size, (length, speed, bend) = float(support.derivative(t, 2)), (float(part) for part in law(t))
        along, down = (0.0, -size) if vertical else (size, 0.0)
        left = np.array([[2.0 * length, 0.42 * cos(a - b)], [length * cos(a - b), 0.6]])
        first = -0.42 * q * q * sin(a - b) - 2.0 * (2 * speed * p + along * cos(a) + (G - down) * sin(a))
        second = (length * p * p - bend) * sin(a - b) - 2 * speed * p * cos(a - b)
        return [p, q, *np.linalg.solve(left, [first, second - along * cos(b) - (G - down) * sin(b)])]

    y = np.radians([30.0, -50.0, 10.0, 5.0])
    edges = sorted({0.0, 2.0, *(time for time in (*law.breaks, *support.breaks) if 0 < time < 2.0)})
    for begin, end in pairwise(edges):
        inside = partial(np.clip, a_min=begin + 1e-12, a_max=end - 1e-12)
        run = solve_ivp(
            lambda t, y, to=inside: rate(float(to(t)), y), (begin, end), y, "DOP853", rtol=1e-11, atol=1e-12
        )
        y = run.y[:, -1]
    trajectory = simulate(scene, 2.0, tolerance=1e-11, output=9)
    assert trajectory.motion.links[-1] == pytest.approx(y[:2], abs=1e-8)
    assert trajectory.energy_drift() < 1e-9


@pytest.mark.parametrize(("motion", "hoist"), [("sine", "trapezoidal"), ("record", "smooth")])
def test_hoists_on_a_moved_support_in_air_move_alike_in_all_forms(motion: str, hoist: str) -> None:
    scene = hoisted(motion, hoist, drag=0.2, quadratic_drag=0.1, damping=0.05)
    run = simulate(scene, 0.4, tolerance=1e-11, output=5)
    other = simulate(scene, 0.4, form="maximal", tolerance=1e-11, output=5)
    assert run.motion.links == pytest.approx(other.motion.links, abs=1e-8)
    assert max(run.energy_drift(), other.energy_drift()) < 1e-9
    assert reaction_forces_of(run).pivots == pytest.approx(reaction_forces_of(other).pivots, abs=1e-6)


@pytest.mark.parametrize("engine", ["numpy", "numba"])
def test_hoists_on_a_moved_support_go_side_by_side(engine: str) -> None:
    scene, masses = hoisted("sine", "smooth", drag=0.2), [0.5, 0.7]
    options = {"workers": 1, "check": 0, "output": 5, "tolerance": 1e-10}
    with interpreted() if engine == "numba" else nullcontext():
        runs = ensemble(scene, 1.0, vary={"pendulum[0].links[1].mass": masses}, engine=engine, **options)
    run = simulate(scene, 1.0, tolerance=1e-11, output=5)
    assert runs.engine == engine
    assert runs.column("links_rad")[1] == pytest.approx(run.motion.links, abs=2e-8)


@pytest.mark.parametrize("name", RECORDS)
def test_records_of_lengths_are_followed_within_the_tolerance(name: str) -> None:
    scene, exact = lifted(L + 0.3 * (RECORDS[name] - RECORDS[name][0]) / 16)
    run = simulate(scene, 2.0, tolerance=TOLERANCE, output=2)
    assert abs(run.motion.links[-1, 0] - exact) < 5 * TOLERANCE
    assert abs(simulate(scene, 2.0, tolerance=1e-12, output=2).motion.links[-1, 0] - exact) < TOLERANCE / 3


@pytest.mark.parametrize("name", RECORDS)
def test_records_of_a_support_are_followed_within_the_tolerance(name: str) -> None:
    run = simulate(shaken(0.01 * RECORDS[name]), 2.0, tolerance=TOLERANCE, output=2)
    assert abs(run.motion.links[-1, 0] - last_angle(0.01 * RECORDS[name])) < 5 * TOLERANCE


def test_steps_that_pass_over_knots_would_not_do(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(inputs, "BEND_MIN", inf)
    run = simulate(shaken(0.01 * RECORDS["noisy"]), 2.0, tolerance=TOLERANCE, output=2)
    assert abs(run.motion.links[-1, 0] - last_angle(0.01 * RECORDS["noisy"])) > 20 * TOLERANCE


def test_a_bend_below_the_tolerance_ends_no_step() -> None:
    """Of a smooth record only its ends are breaks; of one with a jump those near it; of noise every knot."""
    counts = {}
    for name, values in RECORDS.items():
        inputs = Inputs(system_of(shaken(0.01 * values)))
        counts[name] = [len(inputs.breaks(accuracy)) for accuracy in (1e-6, TOLERANCE, 0.0)]
    assert counts["smooth"][0] == 2
    assert counts["smooth"][2] == 397 <= counts["noisy"][1]
    assert 2 < counts["steps"][0] < counts["steps"][1] < 300


def test_a_step_passes_over_many_samples_of_a_smooth_record() -> None:
    """Of 5,001 samples to 87 steps; the window is narrower for a lower tolerance, four samples where none is given."""
    times = np.linspace(0.0, 5.0, 5001)
    smooth = 0.3 * np.sin(3 * times) + 0.1 * np.sin(19 * times)
    record = RecordMotion(time_s=tuple(times), acceleration_m_per_s2=tuple(smooth))
    moved = shaken(np.zeros(len(TIMES))).replace(support=Moved(motion=record))
    assert simulate(moved, 5.0, tolerance=TOLERANCE, output=2).run.steps < 100
    longest = [Inputs(system_of(moved)).longest_step(accuracy) for accuracy in (TOLERANCE, 1e-12, 0.0)]
    assert longest[0] > longest[1] > 10 * longest[2] == pytest.approx(0.04)


@pytest.mark.parametrize("width", [0.01, 0.1, 0.4])
def test_no_step_passes_over_a_pulse(width: float) -> None:
    """A pulse of 10 to 400 samples in a record of 5,001 that is zero elsewhere, beneath a pendulum at rest."""
    times = np.linspace(0.0, 5.0, 5001)
    within = np.clip((times - 3.2117) / width, -0.5, 0.5)
    record = RecordMotion(time_s=tuple(times), acceleration_m_per_s2=tuple(5 * np.cos(np.pi * within) ** 4))
    scene = shaken(np.zeros(len(TIMES))).replace(support=Moved(motion=record))
    scene = scene.replace(pendulum=(scene.pendulum[0].replace(start=InitialCondition(angles_deg=(0.0,))),))
    runs = [simulate(scene, 5.0, tolerance=TOLERANCE, output=2, max_step=most) for most in (None, 0.002)]
    angles = [float(run.motion.links[-1, 0]) for run in runs]
    assert abs(angles[1]) > 1e-3
    assert angles[0] == pytest.approx(angles[1], abs=5 * TOLERANCE)
