"""Tubes contain the motion: closed forms, many digits by hand, other forms of the equations, time turned round."""

import itertools
import json
from dataclasses import replace
from decimal import Decimal
from fractions import Fraction
from math import radians
from pathlib import Path

import mpmath as mp
import numpy as np
import pytest

from modal import Bob, Fixed, Pendulum, Scene, load
from modal.errors import ComputationError, SceneError
from modal.scene import refusals
from nonlinear import files, initial_state, simulate, state_at_rest, system_of
from nonlinear.accuracy import Candidate, measure_work_precision
from nonlinear.dynamics import Generated
from nonlinear.dynamics.text import function_in
from nonlinear.integration import enclose_motion, lohner

flint = pytest.importorskip("flint")
BALANCED = Scene(gravity=9.81, support=Fixed(), pendulum=[Pendulum(links=[Bob(mass=2.0, length=0.7)])])
DOUBLE = Scene(
    gravity=9.81,
    support=Fixed(),
    pendulum=[Pendulum(links=[Bob(mass=1.0, length=0.8), Bob(mass=0.4, length=0.6)])],
)


def swing(t, start, length, g=9.81):
    """θ and θ' of a pendulum released at rest: sin(θ/2) = k cd(ω t, k)."""
    omega, k = mp.sqrt(mp.mpf(g) / mp.mpf(length)), mp.sin(mp.mpf(start) / 2)
    functions = {name: mp.ellipfun(name, omega * t, k=k) for name in ("cd", "sd", "dn")}
    sine = k * functions["cd"]
    rate = -2 * k * omega * (1 - k**2) * functions["sd"] / functions["dn"] / mp.sqrt(1 - sine**2)
    return 2 * mp.asin(sine), rate


def double_pendulum(g, m1, m2, l1, l2):
    """The textbook's equations of two bobs, in many digits."""
    g, m1, m2, l1, l2 = (mp.mpf(value) for value in (g, m1, m2, l1, l2))

    def rates(t, y):
        a, b, u, v = y
        d = a - b
        share = 2 * m1 + m2 - m2 * mp.cos(2 * d)
        du = -g * (2 * m1 + m2) * mp.sin(a) - m2 * g * mp.sin(a - 2 * b)
        du -= 2 * mp.sin(d) * m2 * (v * v * l2 + u * u * l1 * mp.cos(d))
        dv = 2 * mp.sin(d) * (u * u * l1 * (m1 + m2) + g * (m1 + m2) * mp.cos(a) + v * v * l2 * m2 * mp.cos(d))
        return [u, v, du / (l1 * share), dv / (l2 * share)]

    return rates


def assert_inside(row, values):
    for ball, value in zip(row.balls, values, strict=True):
        assert abs(mp.mpf(str(ball.mid)) - value) <= mp.mpf(str(ball.radius))


def set_of(scene, start, digits, radius=0.0):
    equations = Generated(system_of(scene))
    balls = [flint.arb(value, radius) for value in equations.layout.begin(start).tolist()]
    return lohner.LohnerSet(equations, balls, Fraction(0), digits)


@pytest.mark.parametrize("degrees", [1e-6, 20.0, 179.0])
def test_one_link_is_an_elliptic_function(degrees):
    tube = enclose_motion(BALANCED, 3.0, radius=1e-40, output=4, start=state_at_rest(BALANCED, [degrees]))
    assert tube.radius < 1e-40
    with mp.workdps(60):
        for row in tube.rows[1:]:
            assert_inside(row, swing(mp.mpf(row.time), radians(degrees), 0.7))


def test_two_links_in_many_digits_by_hand():
    start = state_at_rest(DOUBLE, [90.0, 60.0])
    tube = enclose_motion(DOUBLE, 0.5, radius=1e-20, output=2, start=start)
    with mp.workdps(26):
        values = [*map(mp.mpf, start.links.tolist()), mp.mpf(0), mp.mpf(0)]
        exact = mp.odefun(double_pendulum(9.81, 1.0, 0.4, 0.8, 0.6), 0, values)(mp.mpf(0.5))
        assert_inside(tube.rows[-1], exact)


def test_two_equal_bobs_from_the_horizontal_for_ten_seconds():
    scene = Scene(gravity=9.81, support=Fixed(), pendulum=[Pendulum(links=[Bob(mass=1.0, length=1.0)] * 2)])
    tube = enclose_motion(scene, 10.0, output=2, start=state_at_rest(scene, [90.0, 90.0]))
    assert tube.radius < 1e-10
    assert [ball.words[:12] for ball in tube.rows[-1].balls[:2]] == ["-0.568474664", "-0.526393727"]


def misses(carried):
    """Whether the next step of the swing from 100° misses where it is three quarters of it later."""
    step = carried.advance()
    time = step.time + step.length * Fraction(3, 4)
    balls = step.at(time)
    with mp.workdps(40):
        exact = swing(mp.mpf(time.numerator) / time.denominator, radians(100.0), 0.7)
        words = [mp.nstr(value, 35) for value in exact]
    return not all(ball.contains(flint.arb(word)) for ball, word in zip(balls, words, strict=True))


def test_remainders_hold_where_they_are_large(monkeypatch):
    carried = set_of(BALANCED, state_at_rest(BALANCED, [100.0]), 20)
    carried.order = 5
    assert not any(misses(carried) for _ in range(4))
    assert carried.radius > 1e-4
    monkeypatch.setattr(lohner, "_around", lambda bound: flint.arb(0, 0))
    monkeypatch.setattr(lohner, "_square", lambda bound: flint.acb(flint.arb(0, 1) * bound, flint.arb(0, 1) * bound))
    careless = set_of(BALANCED, state_at_rest(BALANCED, [100.0]), 20)
    careless.order = 5
    assert misses(careless)


def test_a_wrong_sign_is_found(monkeypatch):
    monkeypatch.setitem(lohner.FUNCTIONS["balls"], "sin", lambda x: -x.sin())
    function_in.cache_clear()
    tube = enclose_motion(BALANCED, 1.0, output=2, start=state_at_rest(BALANCED, [20.0]))
    function_in.cache_clear()
    with mp.workdps(30), pytest.raises(AssertionError):
        assert_inside(tube.rows[-1], swing(mp.mpf(1), radians(20.0), 0.7))


def test_time_turned_round_leads_back():
    start = initial_state(load("paper-cart-2"))
    scene = load("paper-cart-2")
    there = set_of(scene, start, 20)
    while there.time < 0.5:
        step = there.advance()
    half = there.balls.size // 2
    ends = step.at(Fraction(1, 2))
    turned = [*ends[:half], *(-ball for ball in ends[half:])]
    back = lohner.LohnerSet(Generated(system_of(scene)), turned, Fraction(0), 20)
    while back.time < 0.5:
        step = back.advance()
    first = Generated(system_of(scene)).layout.begin(start).tolist()
    for ball, value in zip(step.at(Fraction(1, 2)), first, strict=True):
        assert ball.contains(value)
        assert ball.rad() < 1e-12


def test_the_energy_of_the_balls_is_that_of_the_start():
    start = state_at_rest(DOUBLE, [120.0, -30.0])
    carried = set_of(DOUBLE, start, 25)

    def energy(y):
        a, b, u, v = y
        kinetic = 0.5 * 1.4 * 0.8**2 * u * u + 0.5 * 0.4 * 0.6**2 * v * v
        kinetic = kinetic + 0.4 * 0.8 * 0.6 * (a - b).cos() * u * v
        return kinetic - 9.81 * (1.4 * 0.8 * a.cos() + 0.4 * 0.6 * b.cos())

    first = energy([flint.arb(value) for value in (*start.links.tolist(), 0.0, 0.0)])
    while carried.time < 2:
        step = carried.advance()
    last = energy(step.at(Fraction(2)))
    assert last.rad() < 1e-12
    assert (last - first).overlaps(flint.arb(0, 1e-14))  # the masses and lengths above are rounded


def test_a_box_of_starts_holds_all_its_corners():
    start, radius = state_at_rest(DOUBLE, [50.0, 10.0]), 1e-8
    carried = set_of(DOUBLE, start, 12, radius)
    while carried.time < 0.5:
        step = carried.advance()
    balls = step.at(Fraction(1, 2))
    for signs in itertools.product((-1, 1), repeat=2):
        corner = type(start)(start.links + radius * np.array(signs), start.link_rates)
        last = simulate(DOUBLE, 0.5, start=corner, tolerance=1e-13, output=2).final
        values = [*last.links.tolist(), *last.link_rates.tolist()]
        assert all(ball.contains(value) for ball, value in zip(balls, values, strict=True))
    assert max(float(ball.rad()) for ball in balls) < 1e-6


SCENES = Path(__file__).parents[1] / "combinations" / "scenes"
TAKEN = (
    *("rod", "body", "rotor", "cart_spring_and_damper", "joint_springs", "joint_dampers", "linear_drag"),
    *("damping_ratio", "van_der_Pol", "inverted", "feedback", "moved_both_ways", "moved_vertical_and_drag", "force"),
    *("constant_force", "springs", "structure"),
)


@pytest.mark.parametrize("kind", TAKEN)
def test_every_feature_as_in_another_form_of_the_equations(kind):
    scene = load(SCENES / f"{kind}.toml")
    start = swinging(scene)
    tube = enclose_motion(scene, 0.5, radius=1e-14, output=3, start=start)
    form = "minimal" if refusals(scene, "form maximal") else "maximal"
    run = simulate(scene, 0.5, start=start, form=form, method="DOP853", tolerance=1e-13, output=3)
    assert tube.distance(run).max() < 1e-11
    assert abs(tube.trajectory.energy_drift()) < 1e-14


def swinging(scene):
    """A start with links at large, different angles."""
    system = system_of(scene)
    return state_at_rest(scene, [30.0 + 20.0 * (k % 3) for k in range(system.n_links)])


@pytest.mark.parametrize("kind", ["space", "hoist", "escapement", "joint_friction", "sampled_feedback", "loss"])
def test_what_no_tube_follows_is_refused(kind):
    with pytest.raises(SceneError, match="a proved motion"):
        enclose_motion(load(SCENES / f"{kind}.toml"), 0.5)


def test_quadratic_drag_is_followed_until_a_mass_stops():
    scene = load(SCENES / "quadratic_drag.toml")
    start = state_at_rest(scene, [20.0, 40.0])
    with pytest.raises(ComputationError, match="beyond 0 s"):
        enclose_motion(scene, 0.5, start=start)
    moving = replace(start, link_rates=start.link_rates + 5.0)
    tube = enclose_motion(scene, 0.1, radius=1e-14, output=2, start=moving)
    run = simulate(scene, 0.1, start=moving, method="DOP853", tolerance=1e-13, output=2)
    assert tube.distance(run).max() < 1e-12


def test_what_cannot_be_met_or_read_is_told():
    context = flint.ctx.prec, flint.ctx.cap
    with pytest.raises(ComputationError, match="more than 20 digits"):
        enclose_motion(DOUBLE, 5.0, radius=1e-15, digits_max=20, start=state_at_rest(DOUBLE, [90.0, 90.0]))
    with pytest.raises(SceneError, match="radius"):
        enclose_motion(DOUBLE, 5.0, radius=0.0)
    assert (flint.ctx.prec, flint.ctx.cap) == context


def test_a_tube_in_every_form(tmp_path):
    tube = enclose_motion(DOUBLE, 0.5, radius=1e-25, output=3, start=state_at_rest(DOUBLE, [90.0, 60.0]))
    row = json.loads(tube.report("json"))["rows"][-1]
    assert list(row) == ["time_s", *tube.names]
    assert list(row["theta_1_2_rad"]) == ["mid", "radius"]
    assert Decimal(row["theta_1_2_rad"]["radius"]) < Decimal("1e-25")
    assert len(row["theta_1_2_rad"]["mid"]) > 25
    files.save(tube.trajectory, tmp_path / "run.npz")
    assert np.array_equal(files.load(tmp_path / "run.npz").motion.links, tube.trajectory.motion.links)
    assert tube.trajectory.run.error == pytest.approx(2e-16, rel=1.0)


def test_the_errors_of_methods_are_measured_by_a_tube():
    start, candidates = state_at_rest(BALANCED, [100.0]), (Candidate("minimal", "DOP853", 1e-6),)
    comparison = measure_work_precision(BALANCED, 1.0, start=start, candidates=candidates, proved=True)
    assert comparison.reference.is_proved
    assert comparison.reference.floor < 1e-12
    (row,) = comparison.rows
    times = comparison.reference.trajectory.times
    run = simulate(BALANCED, 1.0, start=start, form="minimal", method="DOP853", tolerance=1e-6, output=times)
    with mp.workdps(20):
        exact = [float(swing(mp.mpf(time), radians(100.0), 0.7)[0]) for time in times]
    assert row.error == pytest.approx(np.abs(run.motion.links[:, 0] - exact).max(), rel=1e-6)
    assert "a proved tube" in comparison.text()
