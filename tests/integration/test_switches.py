"""Switches: the values of kicks and contacts, what happens at each, which contacts stick, and saltation."""

from __future__ import annotations

import re
from collections.abc import Callable
from itertools import product
from typing import Any

import numpy as np
import pytest
from amounts import usually
from scipy.integrate import solve_ivp

from modal import load
from modal.errors import ComputationError
from modal.scene import Scene, scene_from
from nonlinear import State, simulate
from nonlinear.dynamics import Generated
from nonlinear.dynamics.inputs import Inputs
from nonlinear.integration import Trajectory
from nonlinear.integration.driver import lowest, root
from nonlinear.integration.meeting import AGAIN, MET, cubic_at, highest, meet
from nonlinear.integration.method import LOOKS
from nonlinear.integration.switches import Switched, Switches, switches_of
from nonlinear.system import system_of

ESCAPEMENT = {"kind": "escapement", "impulse": 0.05, "angle_deg": 3.0}
CART = {"kind": "cart", "mass": 1.0}


def scene_of(
    *links: dict[str, Any], angles: tuple[float, ...], copies: int = 1, ratio: float = 0.9, **more: Any
) -> Scene:
    rows = [{"kind": "bob", "mass": 1.0, "length": 1.0, **link} for link in links]
    pendula = [
        {"links": rows, "start": {"angles_deg": [a * (ratio if p else 1.0) for a in angles]}} for p in range(copies)
    ]
    return scene_from({"gravity": 9.81, "pendulum": pendula, **more})


SHAKEN = {"kind": "moved", "motion": {"kind": "sine", "amplitude": 0.1, "frequency_hz": 1.0}}
SCENES = {
    "clock": scene_of({"damping": 0.05, "drive": ESCAPEMENT}, {"length": 0.7, "damping": 0.02}, angles=(10.0, -5.0)),
    "two clocks": scene_of({"damping": 0.05, "drive": ESCAPEMENT}, angles=(9.0,), copies=2, support=CART),
    "rubbing": scene_of({"friction": 0.5}, {"length": 0.7, "friction": 0.4}, angles=(60.0, -50.0)),
    "rubbing clock": scene_of({"friction": 0.1, "drive": ESCAPEMENT}, {"friction": 0.02}, angles=(10.0, -5.0)),
    "rail": scene_of({"friction": 0.1}, {}, angles=(80.0, -50.0), support={**CART, "friction": 2.0}),
    "shaken": scene_of({"friction": 1.5, "drive": ESCAPEMENT}, {"friction": 0.2}, angles=(20.0, 10.0), support=SHAKEN),
    "coefficient": scene_of({"friction": 0.1}, {}, angles=(80.0, -50.0), support={**CART, "friction_coefficient": 0.2}),
}


def first_of(run: Trajectory, switches: Switches) -> list[float]:
    """The y at the start of a run."""
    motion, cart = run.motion, switches.form.first
    parts = (motion.cart[:cart], motion.links[0], motion.cart_rate[:cart], motion.link_rates[0])
    y = np.concatenate([np.ravel(part) for part in parts]).tolist()
    return [*y, *[0.0] * (switches.places.size - len(y))]


def moved(
    switches: Switches, y: list[float], end: float, V: list[list[float]] | None = None
) -> tuple[list[float], list[float]]:
    """The y and the state at the end by SciPy's DOP853 with the switches as its events, and columns V along with it."""
    rate = switches.function("sticking" if switches.places.J else "rates")
    timed, t, size = Inputs(switches.form.system).of_time, 0.0, len(y)
    state = switches.begin(0.0, y, timed(0.0))

    def derivative(t: float, both: Any) -> Any:
        u = [*timed(t), *switches.inputs(state)]
        rates = rate([*both[:size]], u, ())
        columns = [
            _sloped(lambda values: rate([*values], u, ()), both[:size], v) for v in np.reshape(both[size:], (-1, size))
        ]
        return np.concatenate([rates, *columns])

    def passing(j: int) -> Callable[[float, Any], float]:
        def value(t: float, both: Any) -> float:
            y, u = [*both[:size]], [*timed(t), *switches.inputs(state)]
            return float(switches.values(y, rate(y, u, ()), u, state)[0][j])

        value.terminal, value.direction = True, 1  # type: ignore[attr-defined]
        return value

    columns = np.array([] if V is None else V).ravel()
    events = [passing(j) for j in range(switches.count)]
    while True:
        solution = solve_ivp(
            derivative,
            (t, end),
            [*y, *columns],
            method="DOP853",
            rtol=1e-10,
            atol=1e-11,
            events=events,
            first_step=1e-5,
            dense_output=True,
        )

        def inside(times: Any, solution: Any = solution) -> Any:
            return solution.sol(times).T[:, :size]

        spans = np.stack((solution.t[:-1], solution.t[1:]), axis=1)
        held = [switches.inputs(state)] * len(spans)
        switches.add_rail_work(inside, spans, held, state, lambda times, _: Inputs(switches.form.system).beside(times))
        t, y, columns = solution.t[-1], solution.y[:size, -1].tolist(), solution.y[size:, -1]
        passed = [j for j, times in enumerate(solution.t_events) if len(times)]
        if V is not None:
            V[:] = columns.reshape(-1, size).tolist()
        if not passed:
            return y, state
        f = derivative(t, y)[:size].tolist()
        y = switches.change(t, passed[0], y, f, state, V or [], timed(t))[0]
        columns = np.array([] if V is None else V).ravel()


def _sloped(rate: Callable[[Any], Any], y: Any, v: Any, h: float = 1e-5) -> Any:
    y, v = np.array(y), np.array(v)
    first = [np.subtract(rate(y + s * v), rate(y - s * v)) / (2 * s) for s in (h, 2 * h)]
    return (4 * first[0] - first[1]) / 3


@pytest.mark.parametrize("name", SCENES)
def test_a_motion_with_switches_is_that_of_simulate(name: str) -> None:
    run, switches = simulate(SCENES[name], 4.0, tolerance=1e-11, output=3), switches_of(system_of(SCENES[name]))
    y, state = moved(switches, first_of(run, switches), 4.0)
    half, links = switches.places.half, run.final.links.size
    assert y[half - links : half] == pytest.approx(run.final.links, abs=2e-8)
    if switches.places.K:
        kicks = switches.kicks_so_far()
        assert kicks.time == pytest.approx(run.kicks.time, abs=2e-8)
        assert kicks.link.tolist() == run.kicks.link.tolist()
        assert kicks.impulse.tolist() == run.kicks.impulse.tolist()
        assert kicks.energy == pytest.approx(run.kicks.energy, abs=1e-8)
    if switches.places.J:
        friction = switches.friction_record(4.0, y, state)
        assert friction.link.tolist() == run.friction.link.tolist()
        assert friction.begin == pytest.approx(run.friction.begin, abs=1e-7)
        assert friction.end == pytest.approx(run.friction.end, abs=1e-7)
        assert friction.work == pytest.approx(run.friction.work, abs=1e-7)


def test_a_rail_with_a_coefficient_takes_few_operations_more() -> None:
    """Where all slides, with N by moments of the links in place of forces at every joint."""
    scene = scene_of({}, {"length": 0.7}, angles=(20.0, 10.0), support={**CART, "friction_coefficient": 0.1})
    run = Switched(Generated(system_of(scene)))
    y = np.array([0.0, 0.3, -0.2, 0.5, 0.0, 0.0, 0.0])
    run.release(0.0, y)
    text, u = run.switches.module, run.contact_inputs
    assert len(re.findall(r" [-+*/] ", text.python("rates"))) <= 83
    sliding, sticking = (run.switches.function(name)(y.tolist(), u, ()) for name in ("rates", "sticking"))
    assert run.rate(y.tolist(), u) == sliding == pytest.approx(sticking, rel=1e-13)


def test_two_joints_kicked_at_once_get_the_energy_of_both() -> None:
    switches = switches_of(system_of(SCENES["two clocks"]))
    angle = np.radians(3.0)
    y = [0.0, angle, -angle + 1e-14, 0.1, 0.4, -0.5, 0.0]
    state = switches.begin(0.0, [0.0] * 7)
    f = switches.function("rates")(y, (), ())
    changed = switches.change(0.0, 0, y, f, state)
    assert state == [-1.0, 1.0]
    M = np.array([[3.0, np.cos(y[1]), np.cos(y[2])], [np.cos(y[1]), 1.0, 0.0], [np.cos(y[2]), 0.0, 1.0]])
    v, w = np.array(y[3:6]), np.array(changed[3:6])
    assert M @ (w - v) == pytest.approx([0.0, 0.05, -0.05], abs=1e-15)
    assert changed[6] == pytest.approx((w @ M @ w - v @ M @ v) / 2, rel=1e-13)
    assert switches.kicks_so_far().energy.sum() == pytest.approx(changed[6], rel=1e-13)


def test_a_side_that_was_kicked_waits_for_the_other() -> None:
    switches = switches_of(system_of(SCENES["clock"]))
    y = [0.1, 0.0, 0.3, 0.0, 0.0]
    V, R = switches.values(y, y[2:4] + [0.0] * 3, (), [1.0])
    assert V[0] == pytest.approx(0.1 - np.radians(3.0))
    assert (V[1], R) == (-1000.0, [0.3, 0.0])
    assert switches.begin(0.0, y) == [-1.0]


@pytest.mark.parametrize("seed", range(6))
def test_which_contacts_stick_is_the_one_of_all_states_that_agrees(seed: int) -> None:
    rng = np.random.default_rng(seed)
    links = [{"friction": float(M), "length": float(l)} for M, l in rng.uniform(0.2, 3.0, (4, 2))]
    switches = switches_of(system_of(scene_of(*links, angles=(0.0,) * 4)))
    y = [*rng.normal(size=4), *[0.0] * 4, *[0.0] * (switches.places.size - 8)]
    state = switches.begin(0.0, y)
    rates, friction = switches.function("sticking"), switches.function("friction")
    M, agreeing = switches.numbers[:4], []
    for signs in product((-1.0, 0.0, 1.0), repeat=4):
        u = switches.inputs([*signs, *state[4:]])
        a, tau = np.diff(rates(y, u, ())[4:8], prepend=0.0), friction(y, u, ())
        if all(abs(t) <= m if s == 0 else s * g >= 0 for s, t, m, g in zip(signs, tau, M, a, strict=True)):
            agreeing.append(list(signs))
    assert agreeing == [state[:4]]


def test_too_large_a_coefficient_jams() -> None:
    support = {"kind": "cart", "mass": 0.01, "friction_coefficient": 5.0}
    switches = switches_of(system_of(scene_of({}, angles=(45.0,), support=support)))
    assert switches.begin(0.0, [0.0, np.radians(45.0), -1.0, 0.0, 0.0])[0] == -1.0
    with pytest.raises(ComputationError, match="coefficient is too large"):
        switches.begin(0.0, [0.0, np.radians(45.0), 1.0, 0.0, 0.0])


@pytest.mark.parametrize("name", SCENES)
def test_values_and_their_rates_of_many_are_those_of_each(name: str) -> None:
    rng, switches = np.random.default_rng(1), switches_of(system_of(SCENES[name]))
    at = switches.places
    rows = rng.normal(size=(5, at.size)) * 0.2
    timed = Inputs(switches.form.system).of_time
    states = [switches.begin(0.3, row, timed(0.3)) for row in rows]
    for state in states:
        if at.J:
            state[at.K] = 0.0
    rate, each = switches.function("sticking" if at.J else "rates"), []
    for row, state in zip(rows.tolist(), states, strict=True):
        u = [*timed(0.3), *switches.inputs(state)]
        f = rate(row, u, ())
        each.append((f, switches.values(row, f, u, state)))
        sides = []
        for s in (1e-6, -1e-6):
            y, w = np.add(row, np.multiply(s, f)).tolist(), [*timed(0.3 + s), *switches.inputs(state)]
            sides.append(switches.values(y, rate(y, w, ()), w, state)[0])
        assert np.subtract(*sides) / 2e-6 == pytest.approx(each[-1][1][1], rel=1e-6, abs=1e-6)
    side = np.array(states).T
    V, R = switches.values(rows.T, np.array([f for f, _ in each]).T, [*timed(0.3), *switches.inputs(side)], side)
    for k, (_, pair) in enumerate(each):
        assert [np.broadcast_to(lane, 5)[k] for lane in V] == pytest.approx(pair[0], rel=1e-13)
        assert [np.broadcast_to(lane, 5)[k] for lane in R] == pytest.approx(pair[1], rel=1e-12, abs=1e-12)


@pytest.mark.parametrize("name", SCENES)
def test_columns_through_switches_are_differences_of_motions(name: str) -> None:
    run, switches = simulate(SCENES[name], 0.1, output=2), switches_of(system_of(SCENES[name]))
    y, at, end = first_of(run, switches), switches.places, usually(1.2, 2.5)
    y[at.half : 2 * at.half] = np.linspace(0.7, -0.4, at.half).tolist()
    direction = np.append(np.random.default_rng(2).normal(size=2 * at.half), 0.0)
    V = [direction[: at.size].tolist()]
    moved(switches, y, end, V)
    switched = [happening[1] for happening in switches.events]
    sides, h = [], 1e-5
    for s in (h, -h):
        switches.events.clear()
        sides.append(moved(switches, (np.array(y) + s * direction[: at.size]).tolist(), end)[0])
        assert [happening[1] for happening in switches.events] == switched
    assert V[0] == pytest.approx(np.subtract(*sides) / (2 * h), rel=2e-5, abs=2e-5)


@pytest.mark.parametrize("kicked", [True, False])
def test_columns_through_two_switches_at_once_are_those_of_one_after_the_other(kicked: bool) -> None:
    link = {"drive": ESCAPEMENT} if kicked else {"friction": 0.4}
    more = {"support": CART} if kicked else {}
    switches = switches_of(system_of(scene_of(link, angles=(0.0,), copies=2, ratio=1.0, **more)))
    at, h, end = switches.places, 1e-5, 0.1 if kicked else 1.2
    y = [*[0.0] * switches.form.first, 0.04, 0.04, *[0.0] * switches.form.first, 0.6, 0.6]
    y += [0.0] * (at.size - len(y))
    direction = np.zeros(at.size)
    direction[[at.half - 2, at.half - 1, 2 * at.half - 2, 2 * at.half - 1]] = 1.0, -0.3, 0.2, -0.4  # the first leads
    V = [direction.tolist()]
    motions = [np.array(moved(switches, y, end, V)[0])]
    motions += [np.array(moved(switches, (y + k * h * direction).tolist(), end)[0]) for k in (1, 2)]
    assert len(switches.events) == (6 if kicked else 0)
    assert V[0] == pytest.approx((4 * motions[1] - 3 * motions[0] - motions[2]) / (2 * h), rel=1e-4, abs=1e-4)


@pytest.mark.parametrize("name", ["two clocks", "coefficient"])
def test_the_source_for_numba_does_the_same(name: str) -> None:
    switches = switches_of(system_of(SCENES[name]))
    at, rng = switches.places, np.random.default_rng(4)
    y, V, space = (0.2 * rng.normal(size=at.size)).tolist(), rng.normal(size=(2, at.size)), {"part": lambda f: f}
    exec(compile(switches.source(), "<switches>", "exec"), space)
    state = switches.begin(0.0, y)
    f = switches.function("sticking" if at.J else "rates")(y, switches.inputs(state), ())
    for j in range(switches.count):
        states, columns, happened = ([*state], [*state]), V.copy(), []
        changed, W = switches.change(0.5, j, y, f, states[0], V.tolist())
        rest = (states[1], [*switches.numbers], switches.constants, [], columns, happened)
        assert space["change"](0.5, j, y, f, *rest) == changed  # type: ignore[operator]
        assert (states[1], columns.tolist()) == (states[0], W)
        assert happened == switches.events[len(switches.events) - len(happened) :]


def test_a_swing_that_turns_back_just_below_the_angle_of_a_kick_costs_no_steps() -> None:
    """It turns 1.7e-6 rad below the angle right after a step has begun."""
    start = State(np.array([-0.05175136, 0.08385203]), np.zeros(2))
    run = simulate(load("huygens"), 10.0, start=start, output=2, tolerance=1e-9)
    assert run.run.steps < 400


def test_where_a_cubic_is_highest() -> None:
    for a, b, da, db in (
        (-1.0, -1.0, 4.0, -4.0),
        (-1e-6, -0.3, 1e-5, -2.0),
        (-1.0, -2.0, 0.1, -9.0),
        (-3.0, -1.0, 9.0, -1e-9),
    ):
        x = highest(a, b, da, db)
        assert 0 < x < 1
        values = [cubic_at(part, a, b, da, db) for part in np.linspace(0, 1, 2001)]
        assert cubic_at(x, a, b, da, db) == pytest.approx(max(values), abs=1e-6)
        assert cubic_at(x, a, b, da, db) >= max(values) - 1e-15


CLOCKS = scene_from(
    {
        "gravity": 9.81,
        "support": {"kind": "cart", "mass": 7.5},
        "pendulum": [
            {"links": [{"kind": "bob", "mass": 1.59, "length": length, "damping": damping, "drive": drive}]}
            | {"start": {"angles_deg": [angle]}}
            for length, damping, angle, drive in (
                (0.250137, 0.008013, -1.54, {"kind": "escapement", "impulse": 0.001757, "angle_deg": 2.0}),
                (0.2504, 0.006071, -8.8, {"kind": "escapement", "impulse": 0.001332, "angle_deg": 2.0}),
            )
        ],
    }
)


def test_a_motion_costs_the_same_however_late_it_begins() -> None:
    """From 1,024 s on the floats of the time are farther apart than a switch within a short step was sought to."""
    early = simulate(CLOCKS, 1.0, output=[0, 1.0], tolerance=1e-6)
    for late in (1e3, 1e6, 1e9):
        run = simulate(CLOCKS, 1.0, output=[0, 1.0], tolerance=1e-6, start_time=late)
        assert (run.run.calls, len(run.kicks.time)) == (early.run.calls, len(early.kicks.time))
        spacing = np.spacing(late) * (len(run.kicks.time) + 4)
        np.testing.assert_allclose(run.motion.links, early.motion.links, rtol=0, atol=1e-12 + 2 * spacing)
        np.testing.assert_allclose(run.kicks.time - late, early.kicks.time, rtol=0, atol=1e-12 + 2 * spacing)


@pytest.mark.parametrize("late", [0.0, 1e3, 1e6])
def test_lows_and_roots_are_found_at_late_times(late: float) -> None:
    place, height = lowest(lambda time: np.cos(3 * (time - late)), late + 0.5, late + 1.5)
    assert place - late == pytest.approx(np.pi / 3, abs=1e-7)
    assert height == pytest.approx(-1, abs=1e-9)
    assert root(lambda time: np.cos(3 * (time - late)), late, late + 1.0) - late == pytest.approx(
        np.pi / 6, abs=4 * np.spacing(late + 1)
    )


def test_a_switch_near_the_start_of_a_step_is_met() -> None:
    """The value is 0.63 sin(s − place) at s of a step, whose length is found on its own scale."""
    for place in (1e-12, 3e-7, 2.907e-5, 0.03):
        h, low, high, tried, usual, which = [0.06], [0.0], [np.inf], [0.06], [0.06], [-1]
        answer = AGAIN
        for _ in range(60):
            phases = [x * h[0] - place for x in LOOKS]
            V, R = ([[0.63 * function(phase)] for phase in phases] for function in (np.sin, np.cos))
            answer = meet(0, h, V, R, LOOKS, which, low, high, tried, usual)
            if answer != AGAIN:
                break
            h[0] = tried[0]
        assert answer == MET
        assert h[0] == pytest.approx(place, abs=1e-10)
