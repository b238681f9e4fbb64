"""Records with steps, corners, rests and holes, through which splines would leave their samples."""

from __future__ import annotations

import json
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline, PchipInterpolator, make_interp_spline

from modal import SceneError
from modal.scene import Bob, Cart, Hoist, InitialCondition, Pendulum, RecordForce, RecordMotion, Scene
from modal.scene.length_laws import monotone_slopes, spline, unsplined_intervals
from modal.vibration import shock_response
from modal.vibration.prescribed import Record, prescribed_motion
from multipendula import cli
from nonlinear import simulate

RNG = np.random.default_rng(3)
EVEN = np.linspace(0.0, 4.0, 201)
HOLE = np.concatenate((EVEN[EVEN < 2.0], EVEN[EVEN > 2.25]))
ROUGH = {
    "trapezoid": (np.array([0.0, 0.2, 4.0, 4.2, 8.0]), np.array([0.0, 1.0, 1.0, 0.0, 0.0])),
    "step": (np.array([0.0, 1.0, 1.01, 3.0, 3.01, 6.0]), np.array([0.0, 0.0, 10.0, 10.0, 0.0, 0.0])),
    "pulse in a rest": (EVEN, np.where(np.abs(EVEN - 1.5) < 0.2, 1.0, 0.0)),
    "corners": (EVEN, np.clip(EVEN - 1.0, 0.0, 1.0)),
    "hole in noise": (HOLE, 0.05 * RNG.standard_normal(len(HOLE)).cumsum()),
}
QUANTITIES = ("displacement_m", "velocity_m_per_s", "acceleration_m_per_s2")


def record_of(times: np.ndarray, values: np.ndarray, of: str) -> Record:
    motion = prescribed_motion(RecordMotion(time_s=tuple(times.tolist()), **{of: tuple(values.tolist())}))
    assert isinstance(motion, Record)
    return motion


@pytest.mark.parametrize("of", QUANTITIES)
@pytest.mark.parametrize("name", ROUGH)
def test_no_record_leaves_its_samples(name: str, of: str) -> None:
    """And its derivatives and integrals are those of one function, without a jump of the velocity."""
    times, values = ROUGH[name]
    record, order = record_of(times, values, of), QUANTITIES.index(of)
    np.testing.assert_allclose(record.derivative(times[:-1], order), values[:-1], atol=1e-12)
    fine = np.linspace(times[0], times[-1], 20_001)[:-1]
    joined, range_of = record.derivative(fine, order), np.ptp(values)
    assert values.min() - 0.1 * range_of <= joined.min()
    assert joined.max() <= values.max() + 0.1 * range_of
    assert ("leave their range" in record.words) == (name != "corners")
    velocity, displacement = record.velocity(fine), record.displacement(fine)
    step = fine[1] - fine[0]
    assert np.abs(np.diff(displacement) / step - (velocity[1:] + velocity[:-1]) / 2).max() < 0.02 * np.ptp(velocity)
    assert np.abs(np.diff(velocity)).max() <= 1.01 * step * np.abs(record.acceleration(fine)).max() + 1e-12
    assert {*record.breaks} <= {*times.tolist()}


def test_where_no_spline_is_left_there_are_straight_lines() -> None:
    times, values = ROUGH["trapezoid"]
    record = record_of(times, values, "velocity_m_per_s")
    fine = np.linspace(0.0, 8.0, 999)[:-1]
    np.testing.assert_allclose(record.velocity(fine), np.interp(fine, times, values), atol=1e-14)
    assert record.displacement(8.0) == pytest.approx(4.0, abs=1e-14)
    assert record.breaks == (0.0, 0.2, 4.0, 4.2, 8.0)


@pytest.mark.parametrize("per_period", [3.5, 4.0, 9.0, 40.0])
def test_smooth_records_are_the_spline_to_the_last_digit(per_period: float) -> None:
    times = np.arange(60.0) * 0.1
    values = np.sin(2 * np.pi * times / (0.1 * per_period) + 0.4)
    curve = make_interp_spline(times, values, k=5)
    record = record_of(times, values, "acceleration_m_per_s2")
    fine = np.linspace(0.05, 5.85, 500)
    np.testing.assert_array_equal(record.acceleration(fine), curve(fine))
    assert record.breaks == (0.0, times[-1])
    assert "leave" not in record.words


def test_beside_a_rest_the_spline_is_that_of_its_own_samples() -> None:
    """A rest, then a burst: within the burst, two samples from its ends, nothing has changed."""
    times = np.arange(120.0) * 0.1
    values = np.where(times < 4.0, 0.0, 5.0 + np.sin(3 * times))
    unsplined = unsplined_intervals(
        times, values, lambda a, b: make_interp_spline(times[a : b + 1], values[a : b + 1], k=5)
    )
    assert unsplined[37:39].all()
    assert not unsplined[45:].any()
    fine = np.linspace(5.0, 11.0, 300)
    record = record_of(times, values, "velocity_m_per_s")
    assert np.abs(record.velocity(fine) - 5.0 - np.sin(3 * fine)).max() < 1e-4
    assert np.abs(record.velocity(np.linspace(0.0, 3.8, 100))).max() < 1e-9


def test_slopes_are_those_of_pchip() -> None:
    times = np.sort(RNG.uniform(0.0, 5.0, 40))
    values = RNG.standard_normal(40).cumsum()
    expected = PchipInterpolator(times, values).derivative()(times)
    np.testing.assert_allclose(monotone_slopes(times, values)[1:-1], expected[1:-1], rtol=1e-12)


def test_a_hoist_rests_where_its_record_does() -> None:
    times, lengths = np.array([0.0, 5.0, 6.0, 7.0, 8.0, 30.0]), np.array([12.0, 12.0, 10.0, 8.0, 8.0, 8.0])
    law = spline(times, lengths)
    np.testing.assert_allclose(law(np.array([0.0, 3.0, 5.0, 7.5, 15.0, 40.0]))[0], [12, 12, 12, 8, 8, 8], atol=1e-12)
    assert law.extremes == pytest.approx((8.0, 12.0), abs=1e-12)
    assert "6 s" not in law.words
    assert "all intervals" in law.words
    _, before, _ = law(times - 1e-9)
    _, after, _ = law(times + 1e-9)
    np.testing.assert_allclose(before, after, atol=1e-6)


def test_a_step_of_force_sends_a_cart_where_newton_says(tmp_path: object) -> None:
    times, force = ROUGH["step"]
    pushed = RecordForce(on="cart", direction="horizontal", time_s=tuple(times.tolist()), force_n=tuple(force.tolist()))
    scene = Scene(
        gravity=9.81,
        support=Cart(mass=5.0),
        pendulum=(Pendulum(links=(Bob(mass=1.0, length=1.0),), start=InitialCondition(angles_deg=(0.0,))),),
        force=(pushed,),
    )

    def rate(t: float, y: np.ndarray) -> list[float]:
        _, a, v, p = y
        push = float(np.interp(t, times, force)) + p * p * np.sin(a)
        bent = np.linalg.solve([[6.0, np.cos(a)], [np.cos(a), 1.0]], [push, -9.81 * np.sin(a)])
        return [v, p, *bent]

    y = np.zeros(4)
    for begin, end in pairwise(times):
        y = solve_ivp(rate, (begin, end), y, "DOP853", rtol=1e-11, atol=1e-12).y[:, -1]
    run = simulate(scene, 6.0, output=[6.0], tolerance=1e-11)
    assert (run.motion.cart[-1], run.motion.cart_rate[-1]) == pytest.approx((y[0], y[2]), abs=1e-8)
    assert y[0] == pytest.approx(13.302, abs=1e-3)


def test_the_line_is_in_text_and_in_json(tmp_path: object, capsys: pytest.CaptureFixture[str]) -> None:
    path = f"{tmp_path}/hoist.toml"
    with open(path, "w", encoding="utf-8") as file:
        file.write(
            "gravity = 9.81\n[[pendulum]]\nlinks = [{ kind = 'bob', mass = 1.0, length = 12.0, hoist = "
            "{ time_s = [0, 5, 6, 7, 8, 30], length_m = [12, 12, 10, 8, 8, 8] } }]\nstart = { angles_deg = [3] }\n"
        )
    assert cli.main(["hoist", path]) == 0
    assert "cubics join the samples" in capsys.readouterr().out
    assert cli.main(["hoist", path, "--format", "json"]) == 0
    assert "cubics join the samples" in json.loads(capsys.readouterr().out)["notes"][0]
    assert cli.main(["simulate", path, "--duration", "9"]) == 0
    assert "cubics join the samples" in capsys.readouterr().out


def test_a_shock_knows_the_acceleration_on_both_sides_of_a_corner() -> None:
    """A trapezoid of velocities: jumps of the acceleration by 1 m/s² within 0.2 s, with immediate effect on the tip."""
    times, values = ROUGH["trapezoid"]
    motion = RecordMotion(time_s=tuple(times.tolist()), velocity_m_per_s=tuple(values.tolist()))
    scene = Scene(gravity=9.81, pendulum=(Pendulum(links=(Bob(mass=0.5, length=1.0, damping=1e-3),)),))
    response = shock_response(scene, motion, ("angles",))
    omega, decay = np.sqrt(9.81), 1e-3 / 2 / 0.5
    turned = np.sqrt(omega**2 - decay**2)

    def swung(since: np.ndarray) -> np.ndarray:
        """The angle after a step of the support's acceleration by 1 m/s²."""
        t = np.maximum(since, 0.0)
        return (np.exp(-decay * t) * (np.cos(turned * t) + decay / turned * np.sin(turned * t)) - 1) / omega**2

    steps = [(0.0, 5.0), (0.2, -5.0), (4.0, -5.0), (4.2, 5.0)]
    exact = sum(size * swung(response.times - at) for at, size in steps)
    assert response.history[0] == pytest.approx(exact, abs=1e-12)


@pytest.mark.parametrize("of", QUANTITIES[1:])
@pytest.mark.parametrize("name", ["trapezoid", "corners"])
def test_samples_are_joined_as_asked_for(name: str, of: str) -> None:
    times, values = ROUGH[name]
    motions = {
        how: Record(RecordMotion(time_s=tuple(times), **{of: tuple(values)}, interpolation=how))
        for how in ("linear", "cubic")
    }
    order, at = QUANTITIES.index(of), np.linspace(times[0], times[-1], 601)
    assert np.abs(motions["linear"].derivative(at, order) - np.interp(at, times, values)).max() < 1e-12
    assert np.abs(motions["cubic"].derivative(at, order) - CubicSpline(times, values)(at)).max() < 1e-12
    assert motions["linear"].breaks == tuple(times.tolist())
    assert "straight lines join the samples" in motions["linear"].words


def test_a_pendulum_pushed_along_straight_lines_and_along_a_cubic() -> None:
    times, pushes = (0.0, 0.5, 0.6, 1.4, 2.0), (0.0, 0.0, 0.8, -0.5, 0.0)
    for how, push in (("linear", lambda t: np.interp(t, times, pushes)), ("cubic", CubicSpline(times, pushes))):
        force = RecordForce(on="pendulum[0].links[0]", time_s=times, force_n=pushes, interpolation=how)
        scene = Scene(gravity=9.81, pendulum=[Pendulum(links=[Bob(mass=2.0, length=1.5)])], force=[force])
        run = simulate(scene, 2.0, output=[2.0], tolerance=1e-12)
        angle, rate = 0.0, 0.0
        for start, end in pairwise(times):
            motion = solve_ivp(
                lambda t, y, push=push: (y[1], (push(t) * np.cos(y[0]) / 2.0 - 9.81 * np.sin(y[0])) / 1.5),
                (start, end),
                (angle, rate),
                method="DOP853",
                rtol=1e-12,
                atol=1e-14,
            )
            angle, rate = motion.y[:, -1]
        assert abs(run.motion.links[-1, 0] - angle) < 1e-10


def test_straight_lines_through_displacements_and_lengths_are_refused() -> None:
    with pytest.raises(SceneError, match="interpolation: straight lines would change the velocity at once"):
        RecordMotion(time_s=(0, 1, 2, 3), displacement_m=(0, 1, 0, 0), interpolation="linear")
    with pytest.raises(SceneError, match=r"interpolation = .linear.: must be"):
        Hoist(time_s=(0, 1), length_m=(1, 2), interpolation="linear")
    with pytest.raises(SceneError, match="is that of a record"):
        Hoist(to=2.0, duration=1.0, interpolation="cubic")
    cubic = Hoist(time_s=(0, 1, 2), length_m=(1, 1, 2), interpolation="cubic").law(1.0)
    assert abs(cubic(0.5)[0] - CubicSpline((0, 1, 2), (1, 1, 2), bc_type="clamped")(0.5)) < 1e-14
