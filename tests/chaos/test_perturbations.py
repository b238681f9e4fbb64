"""Perturbations through kicks, dry friction and drag, against the flow of orbits, whose loop is its own, and runs."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from amounts import usually

from modal.scene import Scene, scene_from
from nonlinear import ensemble, simulate
from nonlinear.chaos import TRANSIENT as AFTER
from nonlinear.chaos import lyapunov_exponent
from nonlinear.ensembles.lanes import stretching
from nonlinear.ensembles.results import Wanted
from nonlinear.integration.pacing import stretched
from nonlinear.integration.switches import numbers_of as switching_numbers
from nonlinear.orbits.flow import Flow
from nonlinear.system import State, initial_state, numbers_of, system_of

CLOCK = {"kind": "escapement", "impulse": 0.2, "angle_deg": 3.0}
BOB = {"kind": "bob", "mass": 1.0, "length": 1.0, "damping": 0.02}
SECONDS = 4.0


def hung(*links: dict[str, Any], **more: Any) -> Scene:
    start = {"angles_deg": [20.0, 25.0][: len(links)]}
    return scene_from({"gravity": 9.81, "pendulum": [{"links": list(links), "start": start}], **more})


SUPPORTS: list[dict[str, Any]] = [
    {"kind": "fixed"},
    {"kind": "cart", "mass": 2.0, "stiffness": 3.0},
    {"kind": "moved", "motion": {"kind": "sine", "amplitude": 0.1, "frequency_hz": 0.7}},
]


SWITCHING = {"kicks": {"drive": CLOCK}, "friction": {"friction": 0.3}, "both": {"drive": CLOCK, "friction": 0.1}}
RAIL = {"kind": "cart", "mass": 1.0, "friction_coefficient": 0.1}


CASES = [*((support, name) for support in SUPPORTS for name in SWITCHING), (RAIL, "friction")]


@pytest.mark.parametrize(("support", "switching"), usually(CASES[5:7], CASES))
def test_a_perturbation_goes_through_switches_as_in_the_flow_of_orbits(support: dict[str, Any], switching: str) -> None:
    rail = {"friction": 1.0} if support in SUPPORTS[1:2] and switching != "kicks" else {}
    scene = hung({**BOB, **SWITCHING[switching]}, BOB, support=support | rail)
    flow, wanted = Flow(system_of(scene)), Wanted(SECONDS, 1e-12, stretching=True)
    numbers = replace(numbers_of(scene), switching=switching_numbers(flow.system))
    y = flow.equations.begin(initial_state(scene))
    task, scale = stretched(numbers, y[:, None], wanted.duration, wanted.tolerance)
    v = task.initial[len(y) :]
    early, late = AFTER * SECONDS, (1 + AFTER) * SECONDS
    assert np.count_nonzero(np.diff(flow(y, v, late).path.times) == 0) >= 2

    def gain(along: Flow) -> float:
        before, after = (np.linalg.norm(along(y, v, end).V / scale) for end in (early, late))
        return float(np.log(after / before))

    expected = gain(flow)
    assert stretching(numbers, y[:, None], wanted)[0] == pytest.approx(expected, abs=1e-7)
    bare = {name: value for name, value in support.items() if name != "friction_coefficient"}
    without = Flow(system_of(hung(BOB, BOB, support=bare)))
    assert abs(gain(without) - expected) > 1e-2
    many = {"gravity": [9.81, 9.7]}
    runs = ensemble(scene, SECONDS, vary=many, measures=["lyapunov"], engine="numpy", workers=1, tolerance=1e-12)
    assert runs.column("lyapunov_per_s")[0] * SECONDS == pytest.approx(expected, abs=1e-7)


def test_a_perturbation_feels_quadratic_drag_as_neighbours_do() -> None:
    scene = hung({**BOB, "quadratic_drag": 0.3}, {**BOB, "quadratic_drag": 0.3}, support={"kind": "cart", "mass": 2.0})
    numbers, wanted, system = numbers_of(scene), Wanted(SECONDS, 1e-11, stretching=True), system_of(scene)
    y = Flow(system).equations.begin(initial_state(scene))
    task, scale = stretched(numbers, y[:, None], wanted.duration, wanted.tolerance)
    v = task.initial[len(y) :, 0]

    def ended(aside: float, seconds: float) -> Any:
        x, a, b, dx, da, db = y + aside * v
        start = State(np.array([a, b]), np.array([da, db]), x, dx)
        run = simulate(scene, seconds, start=start, tolerance=1e-12, output=2).motion
        return np.array([run.cart[-1], *run.links[-1], run.cart_rate[-1], *run.link_rates[-1]])

    ends = AFTER * SECONDS, (1 + AFTER) * SECONDS
    beside = [(ended(1e-4, end) - ended(-1e-4, end)) / 2e-4 / scale[:, 0] for end in ends]
    gain = np.log(np.linalg.norm(beside[1]) / np.linalg.norm(beside[0]))
    assert stretching(numbers, y[:, None], wanted)[0] == pytest.approx(gain, abs=1e-6)


def test_a_clock_that_ticks_regularly_is_not_chaotic() -> None:
    """Along its motion a perturbation lasts, across it none does."""
    exponent = lyapunov_exponent(hung({**BOB, "damping": 0.3, "drive": CLOCK}), 60.0, members=4)
    assert not exponent.is_positive
    assert abs(exponent.value) < 0.02


def test_what_comes_to_rest_forgets_how_fast_it_was() -> None:
    """Where every joint sticks a perturbation of angles stays as it is, one of rates is gone."""
    scene, y = hung({**BOB, "friction": 2.0}), np.array([0.15, 0.3])
    flow, seconds = Flow(system_of(scene)), 0.12
    early, end = flow(y, np.eye(2), AFTER * seconds), flow(y, np.eye(2), (1 + AFTER) * seconds)
    assert end.y[1] == 0.0
    assert end.V[1] == pytest.approx(np.zeros(2), abs=1e-15)
    numbers = replace(numbers_of(scene), switching=switching_numbers(system_of(scene)))
    task, scale = stretched(numbers, y[:, None], seconds, 1e-12)
    gain = np.log(np.linalg.norm(end.V @ task.initial[2:] / scale) / np.linalg.norm(early.V @ task.initial[2:] / scale))
    assert gain < -0.01
    assert stretching(numbers, y[:, None], Wanted(seconds, 1e-12, stretching=True))[0] == pytest.approx(gain, abs=1e-7)
