"""Rates, accelerations and marks: readings of motions by other equations and another integrator, and what is fitted.

The oracle integrates the equations of each scene, written out by hand, with SciPy; the accelerations of points are
differences of their positions, in which gravity is added in the frame of the ground.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
import scipy

from modal.errors import SceneError
from modal.identification import find_parameters, identify
from modal.scene import Scene, load, scene_from
from modal.types import Floats
from nonlinear.identification import Recording, Segment, Sensor, fit, read_recording
from nonlinear.identification.problem import FitProblem

G, LENGTHS, MASSES, DAMPERS = 9.81, (0.5, 0.4), (1.0, 0.6), (0.01, 0.02)
CART = {"mass": 2.0, "stiffness": 30.0, "damping": 0.3}
TIMES = np.linspace(0.0, 1.0, 21)


def carried_accelerations(q: Floats, v: Floats) -> Floats:
    """Those of a cart on a spring with two bobs, from Lagrange's equations."""
    (m, n), (l, k), (c, d) = MASSES, LENGTHS, DAMPERS
    x, a, b = q
    dot, rate, fast = v
    M = np.array(
        [
            [CART["mass"] + m + n, (m + n) * l * np.cos(a), n * k * np.cos(b)],
            [(m + n) * l * np.cos(a), (m + n) * l**2, n * l * k * np.cos(a - b)],
            [n * k * np.cos(b), n * l * k * np.cos(a - b), n * k**2],
        ]
    )
    forces = [
        -CART["stiffness"] * x - CART["damping"] * dot,
        -(m + n) * G * l * np.sin(a) - n * l * k * np.sin(a - b) * fast**2 - c * rate - d * (rate - fast),
        -n * G * k * np.sin(b) + n * l * k * np.sin(a - b) * rate**2 - d * (fast - rate),
    ]
    forces[0] += (m + n) * l * np.sin(a) * rate**2 + n * k * np.sin(b) * fast**2
    return np.linalg.solve(M, forces)


def swing_acceleration(q: Floats, v: Floats) -> Floats:
    """That of a bob on a fixed support."""
    return -G / LENGTHS[0] * np.sin(q) - DAMPERS[0] / (MASSES[0] * LENGTHS[0] ** 2) * v


@dataclass(frozen=True)
class Oracle:
    """A motion of x, θ_1 and θ_2 (3,) at times (s), or of θ alone."""

    motion: Callable[[Any], Floats]
    on_cart: bool

    def angle(self, t: Any, link: int) -> Floats:
        """The angle of link 1 or 2."""
        return self.motion(t)[link - 1 + self.on_cart]

    def rate(self, t: Any, link: int) -> Floats:
        """Its rate."""
        y = self.motion(t)
        return y[len(y) // 2 + link - 1 + self.on_cart]

    def point(self, t: Any, link: int, distance: float) -> Floats:
        """Where a point of a link is, to the right and up (2, ...)."""
        reaches = [*LENGTHS[: link - 1], distance]
        angles = [self.angle(t, k) for k in range(1, link + 1)]
        x = sum(reach * np.sin(angle) for reach, angle in zip(reaches, angles, strict=True))
        y = -sum(reach * np.cos(angle) for reach, angle in zip(reaches, angles, strict=True))
        return np.array([x + self.motion(t)[0] * self.on_cart, y])

    def force(self, t: Any, link: int, distance: float) -> tuple[Floats, Floats]:
        """The specific force along and across a link at a point of it."""
        h = 2e-4
        weights = {-2: -1, -1: 16, 0: -30, 1: 16, 2: -1}
        a = sum(w * self.point(t + k * h, link, distance) for k, w in weights.items()) / (12 * h**2)
        a[1] += G
        theta = self.angle(t, link)
        return a[0] * np.sin(theta) - a[1] * np.cos(theta), a[0] * np.cos(theta) + a[1] * np.sin(theta)


def oracle(begun: Sequence[float], seconds: float = 1.5) -> Oracle:
    half = len(begun) // 2
    accelerations = carried_accelerations if half > 1 else swing_acceleration
    run = scipy.integrate.solve_ivp(
        lambda _, y: np.concatenate((y[half:], accelerations(y[:half], y[half:]))),
        (-0.1, seconds),
        begun,
        method="DOP853",
        rtol=1e-11,
        atol=1e-12,
        dense_output=True,
    )
    return Oracle(run.sol, half > 1)


def scene_of(links: int, off: float = 1.0) -> Scene:
    support = {"kind": "cart", **CART} if links > 1 else {"kind": "fixed"}
    bobs = [
        {"kind": "bob", "mass": m, "length": l * off, "damping": c / off}
        for m, l, c in zip(MASSES[:links], LENGTHS, DAMPERS, strict=False)
    ]
    return scene_from({"gravity": G, "support": support, "pendulum": [{"links": bobs}]})


SENSORS = (
    Sensor(),
    Sensor(1, 2, "", "rate"),
    Sensor(1, 2, "", "relative"),
    Sensor(1, 2, "", "along", 0.25),
    Sensor(1, 2, "", "across", 0.25),
    Sensor(1, 1, "", "across", 0.1),
    Sensor(1, 2, "", "x"),
    Sensor(1, 2, "", "y"),
)
FREE = ["gravity", "pendulum[0].links[*].length", "pendulum[0].links[1].damping", "support.mass"]


def problem_and_unknowns() -> tuple[FitProblem, Floats]:
    scene, begun = scene_of(2), [0.02, 0.5, -0.8, 0.1, 0.4, 1.0]
    blank = Segment("", "", TIMES, np.zeros((len(TIMES), len(SENSORS))))
    parameters = find_parameters(scene, FREE)
    problem = FitProblem(scene, parameters, Recording(SENSORS, (blank,)), np.ones(len(SENSORS)), tolerance=1e-11)
    later = replace(blank, times=TIMES + problem.late)
    problem = replace(problem, recording=Recording(SENSORS, (later,)))
    u = np.zeros(problem.layout.size)
    u[: problem.layout.numbers] = [parameter.start for parameter in problem.parameters]
    u[problem.layout.state(0)] = begun
    return problem, u


def test_readings_are_those_of_another_integration() -> None:
    problem, u = problem_and_unknowns()
    late = problem.late
    run = scipy.integrate.solve_ivp(
        lambda _, y: np.concatenate((y[3:], carried_accelerations(y[:3], y[3:]))),
        (0, -0.1),
        u[problem.layout.state(0)],
        rtol=1e-11,
        atol=1e-12,
    )
    motion, t = oracle(run.y[:, -1].tolist()), TIMES + late
    expected = [
        motion.motion(t)[0],
        motion.rate(t, 2),
        motion.angle(t, 2) - motion.angle(t, 1),
        *motion.force(t, 2, 0.25),
        motion.force(t, 1, 0.1)[1],
        *motion.point(t, 2, LENGTHS[1]),
    ]
    readings = problem.readings(u)[0].T
    for reading, values, tolerance in zip(readings, expected, [1e-8] * 3 + [2e-6] * 3 + [1e-8] * 2, strict=True):
        assert reading == pytest.approx(values, abs=tolerance)


def test_derivatives_are_those_of_differences() -> None:
    """By numbers, states, offsets, scales and delays, along one direction."""
    problem, u = problem_and_unknowns()
    J, rng = problem.jacobian(u), np.random.default_rng(5)
    along = rng.normal(0, 1, len(u)) * np.maximum(np.abs(u), 0.1)
    along[problem.layout.delays] *= 0.1 * problem.late
    step = 1e-5 * along
    wide = [(problem.residuals(u + f * step) - problem.residuals(u - f * step)) / (2e-5 * f) for f in (1, 2)]
    expected = (4 * wide[0] - wide[1]) / 3
    assert J @ along == pytest.approx(expected, abs=1e-6 * float(np.abs(expected).max()))


def test_an_accelerometer_at_rest_reads_gravity() -> None:
    """Along a hanging link −g, and with a bob as a point nothing across it, wherever it swings."""
    sensors = (Sensor(1, 1, "", "across", LENGTHS[0]), Sensor(1, 1, "", "along", 0.2))
    scene = scene_from({"gravity": G, "pendulum": [{"links": [{"kind": "bob", "mass": 1.0, "length": LENGTHS[0]}]}]})
    blank = Segment("", "", TIMES, np.zeros((len(TIMES), 2)))
    problem = FitProblem(scene, (), Recording(sensors, (blank,)), np.ones(2), tolerance=1e-10)
    u = np.zeros(problem.layout.size)
    assert problem.readings(u)[0] == pytest.approx(np.array([[0.0, -G]] * len(TIMES)), abs=1e-12)
    u[problem.layout.state(0)] = [0.9, 0.0]
    across, along = problem.readings(u)[0].T
    assert across == pytest.approx(0.0, abs=1e-8)
    assert np.ptp(along) > 3.0


RATE, ALONG, ACROSS = "theta_dot_1_1_deg_per_s", "acceleration_along_1_1_m_per_s2@0.2", "acceleration_across_1_1_g@0.2"


def one_link(seed: int) -> dict[str, Floats]:
    """A record of one link by every sensor, with noise, an offset and a delay of each behind the first."""
    rng, t = np.random.default_rng(seed), np.arange(0.0, 3.0, 0.02)
    motion = oracle([rng.uniform(0.3, 1.0), rng.normal()], 3.2)
    along, across = motion.force(t, 1, 0.2)
    x, y = motion.point(t, 1, LENGTHS[0])
    columns = {
        RATE: (np.degrees(motion.rate(t, 1)), 0.5),
        ALONG: (along, 0.05),
        ACROSS: (across / 9.80665, 0.005),
        "x_1_1_px": (x / 0.002, 1.0),
        "y_1_1_px": (y / 0.002, 1.0),
    }
    record = {name: v + rng.normal(0, 5 * s) + rng.normal(0, s, len(t)) for name, (v, s) in columns.items()}
    return {"time_s": t, **record}


@pytest.mark.parametrize("sensors", [[RATE], [ALONG], [ACROSS], ["x_1_1_px", "y_1_1_px"]])
def test_a_length_and_a_damper_are_within_their_error_bars(sensors: list[str]) -> None:
    data = one_link(3)
    recording = read_recording(scene_of(1), [{name: data[name] for name in ["time_s", *sensors]}], pixel=0.002)
    fitted = fit(scene_of(1, 1.06), recording, ["pendulum[0].links[0].length", "pendulum[0].links[0].damping"])
    assert fitted.fits
    assert not len(fitted.held)
    pulls = (fitted.values - [LENGTHS[0], DAMPERS[0]]) / fitted.stds
    assert np.abs(pulls).max() < 3
    assert fitted.stds[0] < 3e-3


@pytest.mark.parametrize("seed", [0, 1])
@pytest.mark.parametrize("relative", [True, False])
def test_two_links_on_a_cart_by_marks_or_by_the_angle_between_them(relative: bool, seed: int) -> None:
    rng, t = np.random.default_rng(seed), np.arange(0.0, 3.0, 0.02)
    motion = oracle([0.02, *rng.uniform(0.3, 0.7, 2), 0.1, *rng.normal(0, 0.7, 2)], 3.1)
    upper, lower = motion.angle(t, 1), motion.angle(t, 2)
    columns = {"x_1_1_m": motion.point(t, 1, LENGTHS[0])[0], "x_1_2_m": motion.point(t, 2, LENGTHS[1])[0]}
    if relative:
        columns = {"theta_1_1_rad": upper, "theta_1_2_relative_rad": lower - upper}
    record = {name: v + rng.normal(0, 0.01) + rng.normal(0, 2e-3, len(t)) for name, v in columns.items()}
    recording = read_recording(scene_of(2), [{"time_s": t, **record}])
    fitted = fit(scene_of(2, 1.05), recording, ["pendulum[0].links[*].length", "pendulum[0].links[*].damping"])
    assert fitted.fits
    assert np.abs((fitted.values - [*LENGTHS[:2], *DAMPERS[:2]]) / fitted.stds).max() < 3.3


def test_a_scale_and_the_delay_of_a_sensor_are_found() -> None:
    data = one_link(4)
    t = data["time_s"]
    motion = oracle([0.8, 0.3], 3.2)
    rng = np.random.default_rng(6)
    record = {
        "time_s": t,
        "theta_1_1_rad": motion.angle(t, 1) + rng.normal(0, 1e-3, len(t)),
        "x_1_1_m": 1.1 * motion.point(t - 0.012, 1, LENGTHS[0])[0] + 0.3 + rng.normal(0, 1e-3, len(t)),
    }
    fitted = fit(scene_of(1), read_recording(scene_of(1), [record]), scale=True)
    layout, stds = fitted.problem.layout, np.sqrt(np.diag(fitted.cov))
    for block, value in ((layout.offsets, 0.3), (layout.scales, 0.1), (layout.delays, 0.012)):
        at = block.start + 1
        assert abs(fitted.unknowns[at] - value) < 4 * stds[at] < 0.01


def test_the_clock_of_a_drive_is_found_from_a_mark_and_an_accelerometer() -> None:
    """A bob on a support that shakes; places and accelerations are those in the frame of the ground."""
    size, omega, l, late = 0.05, 2 * np.pi, LENGTHS[0], 0.06
    motion = {"kind": "sine", "amplitude": size, "frequency_hz": 1.0}
    links = [{"kind": "bob", "mass": MASSES[0], "length": l, "damping": DAMPERS[0]}]
    support = {"kind": "moved", "motion": motion}
    scene = scene_from({"gravity": G, "support": support, "pendulum": [{"links": links}]})

    def rates(t: float, y: Floats) -> list[float]:
        push = size * omega**2 * np.sin(omega * t) / l
        return [y[1], swing_acceleration(y[0], y[1]) + push * np.cos(y[0])]

    t = np.arange(0.2, 3.2, 0.02)
    run = scipy.integrate.solve_ivp(rates, (0, 3.2), [0.3, 0.0], rtol=1e-10, atol=1e-10, dense_output=True)
    theta, rate = run.sol(t - late)
    shake = -size * omega**2 * np.sin(omega * (t - late))  # the acceleration of the support
    angular = swing_acceleration(theta, rate) - shake * np.cos(theta) / l
    across = 0.2 * angular + (shake * np.cos(theta) + G * np.sin(theta))
    rng = np.random.default_rng(2)
    record = {
        "time_s": t,
        "x_1_1_m": size * np.sin(omega * (t - late)) + l * np.sin(theta) + rng.normal(0, 1e-3, len(t)),
        "acceleration_across_1_1_m_per_s2@0.2": across + rng.normal(0, 0.02, len(t)),
    }
    recording = read_recording(scene, [record])
    fitted = fit(scene, recording, ["pendulum[0].links[0].length"], shift=True)
    at, stds = fitted.problem.layout.delays.start, np.sqrt(np.diag(fitted.cov))
    assert fitted.fits
    assert np.abs(fitted.unknowns[at : at + 2] - late) / stds[at : at + 2] == pytest.approx(0.0, abs=3.5)
    assert abs(fitted.values[0] - l) < 3.5 * fitted.stds[0] < 3e-3
    with pytest.raises(SceneError, match="shift: no motion or force"):
        fit(scene_of(1), recording, shift=True)


def test_columns_of_sensors_are_read_in_their_units() -> None:
    data = {
        "time_s": [0, 1, 2, 3],
        "theta_1_2_relative_deg": [90, 0, 0, 0],
        "theta_dot_1_1_deg_per_s": [180, 0, 0, 0],
        "x_1_1_px": [3, 0, 0, 0],
        "-y_1_2_mm": [7, 0, 0, 0],
        "acceleration_along_1_2_g@0.25": [1, 0, 0, 0],
    }
    recording = read_recording(load("chain-2"), [data], pixel=0.01)
    readings = dict(zip((s.name for s in recording.sensors), recording.segments[0].values[0].tolist(), strict=True))
    assert readings == pytest.approx(
        {
            "theta_1_2_relative": np.pi / 2,
            "theta_dot_1_1": np.pi,
            "x_1_1": 0.03,
            "y_1_2": -0.007,
            "acceleration_along_1_2@0.25": 9.80665,
        }
    )
    with pytest.raises(SceneError, match="needs `pixel`"):
        read_recording(load("chain-2"), [data])
    with pytest.raises(SceneError, match="acceleration_along_1_2_m_per_s2: must be"):
        read_recording(load("chain-2"), [{"time_s": [0, 1], "acceleration_along_1_2_m_per_s2": [1, 2]}])
    with pytest.raises(SceneError, match="hang from a structure"):
        read_recording(load("ship-crane"), [{"time_s": [0, 1, 2, 3], "x_1_1_m": [1, 2, 3, 4]}])


def test_a_rate_beside_its_angle_is_a_sensor_where_it_is_named() -> None:
    data = {"time_s": [0, 1, 2, 3], "theta_1_1_rad": [1, 0, 0, 0], "theta_dot_1_1_rad_per_s": [0, 1, 0, 0]}
    recording = read_recording(load("chain-2"), [data])
    assert [sensor.name for sensor in recording.sensors] == ["theta_1_1"]
    assert recording.unused == ("theta_dot_1_1_rad_per_s",)
    named = {"theta_dot_1_1_rad_per_s": "theta_dot_1_1_rad_per_s"}
    recording = read_recording(load("chain-2"), [data], columns=named)
    assert [sensor.name for sensor in recording.sensors] == ["theta_1_1", "theta_dot_1_1"]


def test_poles_are_those_of_any_signal() -> None:
    """A small swing: a rate, an acceleration and a mark have the frequency √(g/l) of the angle."""
    data = one_link(3)
    t, motion = data["time_s"], oracle([0.02, 0.0], 3.2)
    across = motion.force(t, 1, 0.2)[1]
    record = {
        "time_s": t,
        RATE: np.degrees(motion.rate(t, 1)),
        ACROSS: across / 9.8,
        "x_1_1_m": motion.point(t, 1, 1.0)[0],
    }
    recording = read_recording(None, [record]).absolute()
    segment = recording.segments[0]
    modes = identify([(segment.times, segment.values)], [sensor.name for sensor in recording.sensors])
    (mode,) = modes.records()
    assert mode["frequency_hz"] == pytest.approx(np.sqrt(G / LENGTHS[0]) / (2 * np.pi), rel=1e-4)
