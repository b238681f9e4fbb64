"""Flows and orbits through dry friction: derivatives by saltation, against differences and long runs."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from modal.scene import Scene, scene_from
from modal.scene.parameters import Variation
from nonlinear import AppliedForces, State, simulate
from nonlinear.orbits import follow_cycles, limit_cycles, periodic_orbit
from nonlinear.orbits.flow import Flow
from nonlinear.system import system_of

CART = {"kind": "cart", "mass": 1.0}
ESCAPEMENT = {"kind": "escapement", "impulse": 0.05, "angle_deg": 3.0}
TOLERANCE = 1e-12


def bob(**more: Any) -> dict[str, Any]:
    return {"kind": "bob", "mass": 1.0, "length": 1.0, **more}


def hung(*links: dict[str, Any], **more: Any) -> Scene:
    return scene_from(
        {"gravity": 9.81, "pendulum": [{"links": list(links), "start": {"angles_deg": [10.0] * len(links)}}], **more}
    )


RUBBING = hung(bob(friction=0.3), bob(friction=0.2, mass=0.7))
CLOCK = hung(bob(friction=0.02, damping=0.1, drive=ESCAPEMENT))
SCENES = {
    "joints": RUBBING,
    "rail": hung(bob(friction=0.1), support={**CART, "friction": 1.5, "stiffness": 5.0}),
    "coefficient": hung(bob(), support={**CART, "friction_coefficient": 0.1, "stiffness": 5.0}),
    "clock": hung(bob(friction=0.05, drive={**ESCAPEMENT, "impulse": 0.3}), bob(friction=0.02), support=CART),
}


@pytest.mark.parametrize("name", SCENES)
def test_derivatives_through_sticking_and_slipping_are_those_of_differences(name: str) -> None:
    flow, end = Flow(system_of(SCENES[name])), 2.7
    size = len(flow.scale)
    y, none = np.linspace(0.6, -0.4, size), np.zeros((size, 0))
    passed = flow(y, np.eye(size), end)
    assert np.sum(np.diff(passed.path.times) == 0) >= 3
    for k, step in enumerate(1e-6 * np.eye(size)):
        slope = (flow(y + step, none, end).y - flow(y - step, none, end).y) / 2e-6
        assert passed.V[:, k] == pytest.approx(slope, rel=1e-6, abs=1e-6 * np.abs(passed.V).max())


def test_a_flow_goes_on_in_the_state_in_which_it_ended() -> None:
    flow, y, identity = Flow(system_of(RUBBING)), np.array([0.6, -0.3, 0.2, 0.5]), np.eye(4)
    first = flow(y, identity, 1.1)
    second = flow(first.y, first.V, 2.0, first.state, 1.1)
    whole = flow(y, identity, 3.1)
    assert second.y == pytest.approx(whole.y, abs=1e-10)
    assert pytest.approx(whole.V, abs=1e-8) == second.V


def test_a_clock_that_rubs_settles_on_its_limit_cycle_by_its_multiplier() -> None:
    (orbit,) = limit_cycles(CLOCK)
    (multiplier,) = orbit.floquet.others.real
    begun = State(orbit.y[:1], 1.01 * orbit.y[1:])
    times = orbit.period * np.arange(0, 9)
    run = simulate(CLOCK, times[-1], start=State(orbit.y[:1], orbit.y[1:]), output=times, tolerance=TOLERANCE)
    assert np.ptp(run.motion.links) < 1e-8
    moved = simulate(CLOCK, times[-1], start=begun, output=2, tolerance=TOLERANCE)
    near = simulate(CLOCK, times[-2], start=begun, output=2, tolerance=TOLERANCE)
    energies = [trajectory.mechanics.energy[-1] - run.mechanics.energy[0] for trajectory in (moved, near)]
    assert energies[0] / energies[1] == pytest.approx(multiplier, rel=1e-2)
    fed = run.kicks.energy[-2:].sum()
    assert fed == pytest.approx(4 * 0.02 * orbit.amplitude + 0.1 * _square(run, orbit.period), rel=1e-3)


def _square(run: Any, period: float) -> float:
    """∫ θ'² dt over the last period."""
    times = run.times[-1] - period + np.linspace(0, period, 2001)
    again = simulate(CLOCK, run.times[-1], start=run.motion[0], output=np.append(0.0, times), tolerance=TOLERANCE)
    return float(np.trapezoid(again.motion.link_rates[1:, 0] ** 2, times))


def test_an_orbit_that_sticks_under_a_force_is_where_runs_end() -> None:
    period, push = np.pi / 2, 1.2
    orbit = periodic_orbit(
        RUBBING, State(np.zeros(2), np.array([0.1, 0.0])), period, force=lambda t: np.array([push * np.cos(4 * t), 0.0])
    )
    assert orbit.residual < 1e-10
    assert np.sum(np.diff(orbit.path.times) == 0) >= 3
    assert orbit.floquet.is_stable
    run = simulate(
        RUBBING,
        80 * period,
        start=orbit.motion(orbit.y[None])[0],
        load=lambda time, state: AppliedForces(0.0, np.array([push * np.cos(4 * time), 0.0])),
        output=2,
    )
    assert run.motion.links[-1] == pytest.approx(orbit.y[:2], abs=1e-6)


def test_cycles_of_a_clock_that_rubs_are_followed_along_its_friction() -> None:
    (branch,) = follow_cycles(CLOCK, Variation("pendulum[0].links[0].friction", (0.02, 0.03)))
    assert branch.complete
    other = limit_cycles(hung(bob(friction=0.03, damping=0.1, drive=ESCAPEMENT)))[0]
    assert branch.orbits[-1].amplitude == pytest.approx(other.amplitude, rel=1e-6)
