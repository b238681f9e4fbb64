"""Motions with exact derivatives: against `simulate`, differences, and closed forms of dry friction."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from amounts import usually

from modal import Scene
from modal.identification import find_parameters, numbers_at, scene_with
from modal.scene import load, scene_from
from modal.types import Floats
from nonlinear import State, simulate
from nonlinear.dynamics.inputs import Inputs
from nonlinear.identification.problem import FitProblem
from nonlinear.identification.records import Recording, Segment, Sensor

TIMES = np.linspace(0.0, 1.4, 29)
TWO: list[dict[str, Any]] = [
    {"kind": "bob", "mass": 1.0, "length": 0.5, "damping": 0.01},
    {"kind": "rod", "mass": 0.5, "length": 0.4, "damping": 0.02},
]
CART = {"kind": "cart", "mass": 2.0, "stiffness": 30.0, "damping": 0.3}
SCENES = {
    "cart": {"gravity": 9.81, "support": CART, "pendulum": [{"links": TWO}]},
    "friction": {
        "gravity": 9.81,
        "pendulum": [{"links": [{**link, "friction": 0.05 - 0.04 * k} for k, link in enumerate(TWO)]}],
    },
    "rail": {"gravity": 9.81, "support": {**CART, "friction": 0.4}, "pendulum": [{"links": TWO}]},
    "drag": {
        "gravity": 9.81,
        "support": CART,
        "pendulum": [{"links": [{**link, "drag": 0.1, "quadratic_drag": 0.3} for link in TWO]}],
    },
    "all": {
        "gravity": 9.81,
        "pendulum": [{"links": [{**link, "friction": 0.02, "drag": 0.1, "quadratic_drag": 0.3} for link in TWO]}],
    },
    "two": {
        "gravity": 9.81,
        "support": CART,
        "pendulum": [{"links": TWO[:1]}, {"links": [{**TWO[1], "friction": 0.02}]}],
    },
}
SCENES |= {
    name: load(Path(__file__).parents[1] / "combinations" / "scenes" / f"{name}.toml").model_dump()
    for name in ("escapement", "rail_coefficient", "moved_vertical_and_drag", "moved_horizontal", "hoist_and_drag")
}
SHAKEN = 0.05 * np.sin(3.0 * np.linspace(-1.0, 4.0, 51))
SCENES["recorded"] = {
    "gravity": 9.81,
    "support": {
        "kind": "moved",
        "motion": {"kind": "record", "time_s": np.linspace(-1.0, 4.0, 51).tolist(), "displacement_m": SHAKEN.tolist()},
    },
    "pendulum": [{"links": [{**link, "quadratic_drag": 0.3} for link in TWO]}],
}
SCENES["struck"] = {
    "gravity": 9.81,
    "support": {**CART, "friction": 0.3},
    "pendulum": [
        {"links": [{**link, "friction": 0.02, "drive": {"kind": "escapement", "impulse": 0.04, "angle_deg": angle}}]}
        for link, angle in zip(TWO, (6.0, 3.0), strict=True)
    ],
}
CLOCK = np.linspace(-0.5, 2.5, 61)
SCENES["turned"] = {
    "gravity": 9.81,
    "pendulum": [{"links": [{**link, "friction": 0.02} for link in TWO]}],
    "force": [
        {
            "on": f"pendulum[0].links[{k}]",
            "direction": "torque",
            "kind": "record",
            "time_s": CLOCK.tolist(),
            "moment_nm": (0.4 * np.sin(4.0 * CLOCK + k) + 0.02 * np.cos(50.0 * CLOCK**2)).tolist(),
        }
        for k in range(2)
    ],
}
FREE = {
    "turned": ["pendulum[0].links[*].friction", "pendulum[0].links[*].damping", "pendulum[0].links[0].mass"],
    "escapement": ["pendulum[0].links[0].drive.impulse", "pendulum[0].links[*].mass", "pendulum[0].links[1].damping"],
    "rail_coefficient": ["support.friction_coefficient", "pendulum[0].links[0].mass"],
    "moved_vertical_and_drag": [
        "pendulum[0].links[*].drag",
        "pendulum[0].links[*].quadratic_drag",
        "pendulum[0].links[0].length",
    ],
    "recorded": ["pendulum[0].links[*].quadratic_drag", "pendulum[0].links[0].length", "gravity"],
    "moved_horizontal": ["gravity", "pendulum[0].links[1].mass"],
    "hoist_and_drag": ["pendulum[0].links[0].drag", "pendulum[0].links[*].quadratic_drag", "gravity"],
    "struck": [
        "pendulum[0].links[0].drive.angle_deg",
        "pendulum[1].links[0].drive.impulse",
        "pendulum[1].links[0].friction",
        "support.friction",
        "support.mass",
    ],
    "cart": [
        "pendulum[0].links[*].length",
        "pendulum[0].links[0].damping",
        "support.mass",
        "support.stiffness",
        "gravity",
    ],
    "friction": ["pendulum[0].links[*].friction", "pendulum[0].links[*].mass"],
    "rail": ["support.friction", "support.damping", "pendulum[0].links[0].mass"],
    "drag": ["pendulum[0].links[*].drag", "pendulum[0].links[*].quadratic_drag"],
    "all": ["pendulum[0].links[*].friction", "pendulum[0].links[0].drag"],
    "two": ["pendulum[1].links[0].friction", "pendulum[0].links[0].length"],
}


def problem_of(scene: Scene, free: list[str], tolerance: float = 1e-11) -> FitProblem:
    pendula = [pendulum for pendulum in scene.pendulum for _ in range(pendulum.count)]
    sensors = tuple(Sensor(p + 1, i + 1) for p, pendulum in enumerate(pendula) for i in range(pendulum.n_links))
    if scene.support.kind == "cart":
        sensors = (Sensor(), *sensors)
    blank = Segment("", "", TIMES, np.zeros((len(TIMES), len(sensors))))
    parameters = find_parameters(scene, free)
    problem = FitProblem(scene, parameters, Recording(sensors, (blank,)), np.ones(len(sensors)), tolerance=tolerance)
    later = replace(blank, times=TIMES + problem.late)  # so that its motion begins at 0 s
    return replace(problem, recording=Recording(sensors, (later,)))


def unknowns_of(problem: FitProblem) -> Floats:
    rng = np.random.default_rng(3)
    u = np.zeros(problem.layout.size)
    u[: problem.layout.numbers] = [parameter.start for parameter in problem.parameters]
    u[problem.layout.state(0)] = rng.normal(0, 0.4, problem.layout.width)
    return u


@pytest.mark.parametrize("name", SCENES)
def test_readings_are_those_of_simulate(name: str) -> None:
    scene = scene_from(SCENES[name])
    problem = problem_of(scene, [])
    u = unknowns_of(problem)
    state, half, on_cart = u[problem.layout.state(0)], problem.coordinates, int(scene.support.kind == "cart")
    cart = (float(state[0]), float(state[half])) if on_cart else (0.0, 0.0)
    begun = State(state[on_cart:half], state[half + on_cart :], *cart)
    late = problem.late
    run = simulate(scene, float(TIMES[-1] + late), start=begun, output=np.append(0.0, TIMES + late), tolerance=1e-12)
    expected = np.column_stack((run.motion.cart, run.motion.links))[1:, 1 - on_cart :]
    assert problem.readings(u)[0] == pytest.approx(expected, abs=2e-8)


@pytest.mark.parametrize("name", usually(["moved_vertical_and_drag", "struck"], [*SCENES]))
def test_derivatives_are_those_of_differences(name: str) -> None:
    """By every number and component of the start, through all changes between slip and stick."""
    problem = problem_of(scene_from(SCENES[name]), FREE[name])
    u = unknowns_of(problem)
    J = problem.jacobian(u)
    rng, free = np.random.default_rng(4), np.flatnonzero(problem.free)
    along = np.zeros_like(u)
    along[free] = rng.normal(0, 1, len(free)) * np.maximum(np.abs(u[free]), 0.1)
    step = 1e-5 * along
    wide = [(problem.residuals(u + f * step) - problem.residuals(u - f * step)) / (2e-5 * f) for f in (1, 2)]
    told = (4 * wide[0] - wide[1]) / 3
    assert J @ along == pytest.approx(told, abs=2e-6 * max(1.0, float(np.abs(told).max())))


@pytest.mark.parametrize("name", usually(["drag", "cart"], ["cart", "drag", "struck"]))
def test_many_segments_have_the_derivatives_of_each_alone(name: str) -> None:
    """Wide columns are computed to first order, narrow ones as complex numbers."""
    single = problem_of(scene_from(SCENES[name]), FREE[name], tolerance=1e-9)
    u, count = unknowns_of(single), 40
    segment = replace(
        single.recording.segments[0], times=single.recording.segments[0].times[:26], values=np.zeros((26, 3))
    )
    single = replace(single, recording=replace(single.recording, segments=(segment,)))
    many = replace(single, recording=replace(single.recording, segments=(segment,) * count))
    v = np.concatenate((u[: single.layout.state(0).start], np.tile(u[single.layout.state(0)], count)))
    alone = single.jacobian(u)
    J = many.jacobian(v).reshape(count, len(alone), -1)
    for s in (0, count - 1):
        kept = np.r_[0 : single.layout.state(0).start, many.layout.state(s)]
        assert J[s][:, kept] == pytest.approx(alone, abs=1e-8 * float(np.abs(alone).max()))
    assert not J[0][:, many.layout.state(1).start :].any()


def test_a_step_looks_up_recorded_torques_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """In addition to the start after a knot of the record, and the needs of its interpolation."""
    scene = scene_from({**SCENES["turned"], "pendulum": [{"links": TWO}]})
    problem, beside, times_of_calls = problem_of(scene, FREE["turned"][1:], tolerance=1e-8), Inputs.beside, []

    def count(inputs: Inputs, times: Any) -> list[Any]:
        times_of_calls.append(times)
        return beside(inputs, times)

    monkeypatch.setattr(Inputs, "beside", count)
    problem.jacobian(unknowns_of(problem))
    assert len(times_of_calls) < 5 * problem.evaluations[0].flow.steps


def test_half_swings_lose_what_coulomb_says() -> None:
    """2 M_f/(m g l) a half swing in the limit of small angles, and rest within the stick zone |θ| ≤ M_f/(m g l)."""
    scene = scene_from({"gravity": 9.81, "pendulum": [{"links": [{**TWO[0], "damping": 0.0, "friction": 1e-5}]}]})
    times = np.linspace(0, 20, 4001)
    blank = Segment("", "", times, np.zeros((len(times), 1)))
    problem = FitProblem(scene, (), Recording((Sensor(1, 1),), (blank,)), np.ones(1), tolerance=1e-12)
    u = np.zeros(problem.layout.size)
    zone = 1e-5 / (9.81 * 0.5)
    u[problem.layout.state(0)] = [9.3 * zone, 0.0]
    theta = problem.readings(u)[0][:, 0]
    turning = [theta[0], *(b for a, b, c in zip(theta, theta[1:], theta[2:], strict=False) if (b - a) * (c - b) < 0)]
    assert np.abs(turning[:5]) / zone == pytest.approx([9.3, 7.3, 5.3, 3.3, 1.3], abs=2e-3)
    assert abs(theta[-1]) / zone == pytest.approx(0.7, abs=2e-3)
    assert np.ptp(theta[-1000:]) == 0.0


def test_numbers_and_coordinates_go_both_ways() -> None:
    scene = scene_from(SCENES["drag"])
    for parameter in find_parameters(scene, [*FREE["cart"], *FREE["drag"]]):
        z = parameter.start + 0.3
        assert parameter.z_of(parameter.at(z)) == pytest.approx(z)
        assert parameter.slope(z) == pytest.approx((parameter.at(z + 1e-6) - parameter.at(z - 1e-6)) / 2e-6, rel=1e-6)
        moved = scene_with(scene, numbers_at([parameter], np.array([z])))
        assert find_parameters(moved, [parameter.path])[0].value == pytest.approx(parameter.at(z))
