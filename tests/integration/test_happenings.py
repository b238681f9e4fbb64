"""What a run that looks for something costs, in counts, and what it finds, against samples and closed forms."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.special import ellipk
from support.uncompiled import uncompiled

from modal import Bob, Cart, Pendulum, Scene, load
from modal.scene import scene_from
from nonlinear import Event, SimulationError, level_crossing, simulate, state_at_rest, system_of, turning_point
from nonlinear.dynamics.compiling import available
from nonlinear.integration import driver
from nonlinear.integration.floats import FloatStepper
from nonlinear.integration.method import EXTRA, STAGES
from nonlinear.integration.methods import Choice
from nonlinear.integration.run import Request
from nonlinear.integration.steppers import STEPS_AT_ONCE
from nonlinear.integration.within import Step
from nonlinear.system import Motion

ONE = Scene(gravity=9.81, pendulum=[Pendulum(links=[Bob(mass=1.0, length=1.0)])])
AMPLITUDE = 2.0
PERIOD = 4 * ellipk(np.sin(AMPLITUDE / 2) ** 2) / np.sqrt(9.81)


def counted(monkeypatch: pytest.MonkeyPatch, kind: type, name: str) -> list[int]:
    calls, usual = [0], getattr(kind, name)

    def counting(self: Any, *arguments: Any) -> Any:
        calls[0] += 1
        return usual(self, *arguments)

    monkeypatch.setattr(kind, name, counting)
    return calls


def test_a_crossing_that_is_looked_for_costs_next_to_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    """A state for each crossing and none else; interpolants of hundreds of steps at once; a step again for each."""
    start = state_at_rest(ONE, [np.degrees(AMPLITUDE)])
    plain = simulate(ONE, 60.0, start=start, method="DOP853", output=2)
    states, interpolants = counted(monkeypatch, Motion, "__getitem__"), counted(monkeypatch, Step, "extend_stages")
    event = level_crossing(system_of(ONE), "theta[1,1]")
    run = simulate(ONE, 60.0, start=start, method="DOP853", output=2, events=[event])
    expected = PERIOD * (0.25 + 0.5 * np.arange(len(run.happenings)))
    assert len(run.happenings) == int(60 / PERIOD * 2 + 0.5)
    np.testing.assert_allclose([each.time for each in run.happenings], expected, rtol=1e-9)
    assert run.run.steps == plain.run.steps > 400
    assert states[0] <= len(run.happenings) + 4
    assert interpolants[0] <= 2 * (run.run.steps // 256 + 1)
    assert run.run.calls - plain.run.calls <= (STAGES + 1 + 2 * EXTRA) * len(run.happenings)


@pytest.mark.skipif(not available(), reason="numba is not installed")
def test_compiled_steps_are_not_traced_again(monkeypatch: pytest.MonkeyPatch) -> None:
    """Rates other than those of the steps are of the steps with crossings alone; the crossings are those of floats."""
    start, event = state_at_rest(ONE, [np.degrees(AMPLITUDE)]), level_crossing(system_of(ONE), "theta[1,1]")
    kwargs: dict[str, Any] = {"start": start, "method": "DOP853", "output": 2}
    usual = simulate(ONE, 10.0, events=[event], **kwargs)
    monkeypatch.setattr(Request, "choice", lambda self, tolerance: Choice("minimal", "DOP853", True, ""))
    with uncompiled():
        plain, run = simulate(ONE, 10.0, **kwargs), simulate(ONE, 10.0, events=[event], **kwargs)
        monkeypatch.setattr(driver, "STEPS_AT_ONCE", 8)
        parts = simulate(ONE, 10.0, events=[event], **kwargs)
    assert run.run.steps == plain.run.steps == usual.run.steps
    assert run.run.calls - plain.run.calls == (STAGES + 1 + EXTRA) * len(run.happenings)
    times = [[each.time for each in motion.happenings] for motion in (run, parts, usual)]
    assert times[0] == times[1]
    np.testing.assert_allclose(times[0], times[2], rtol=1e-12)


@pytest.mark.parametrize("way", ["DOP853", "RK45", "LSODA", "maximal", "hamiltonian"])
def test_crossings_are_the_same_by_every_method(way: str) -> None:
    """Also as an arbitrary function of the state, which is looked at."""
    scene = load("paper-cart-1")
    system, how = system_of(scene), {"form" if way.islower() else "method": way}
    events = [level_crossing(system, "x", 0.001, 1), turning_point(system, "theta[1,2]")]
    events.append(Event("function", lambda state: state.cart - 0.001, direction=1))
    times: list[list[tuple[str, float]]] = []
    for options in ({"tolerance": 1e-8, **how}, {"tolerance": 1e-13, "method": "DOP853"}):
        run = simulate(scene, 0.7, events=events, **options)  # type: ignore[arg-type]
        times.append(sorted((each.name, each.time) for each in run.happenings))
    assert len(times[1]) > 2
    assert [name for name, _ in times[0]] == [name for name, _ in times[1]]
    np.testing.assert_allclose([time for _, time in times[0]], [time for _, time in times[1]], atol=1e-6)


def test_a_run_that_an_event_ends_does_not_go_far_beyond() -> None:
    """The steps taken at once grow with those that were taken."""
    event = level_crossing(system_of(ONE), "theta[1,1]", stop=True)
    run = simulate(ONE, 60.0, start=state_at_rest(ONE, [10.0]), method="DOP853", events=[event])
    assert len(run.happenings) == 1
    assert run.run.calls < 3 * STAGES * run.run.steps + 100
    assert run.times[-1] == run.happenings[0].time
    assert abs(run.final.links[0]) < 1e-12


def test_a_stop_that_never_comes_shows_many_steps_at_once_in_scenes_with_switches(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    scene = load("huygens")
    plain, sweeps = simulate(scene, 10.0, output=2), counted(monkeypatch, FloatStepper, "sweep")
    run = simulate(scene, 10.0, output=2, events=[level_crossing(system_of(scene), "theta[1,1]", 9.0, stop=True)])
    assert run.complete
    assert (run.run.steps, run.run.calls) == (plain.run.steps, plain.run.calls)
    assert len(run.kicks.time) > 40
    assert sweeps[0] <= np.log2(STEPS_AT_ONCE / 4) + run.run.steps / STEPS_AT_ONCE + 2


@pytest.mark.parametrize(("kind", "angle"), [("friction", -0.05), ("friction", 0.2), ("friction_coefficient", -0.1)])
def test_a_stop_undoes_what_happened_in_later_steps(kind: str, angle: float) -> None:
    """Kicks, phases and works are those of a run that ends there."""
    bobs: list[dict[str, Any]] = [
        {"kind": "bob", "mass": 1.0, "length": 1.0},
        {"kind": "bob", "mass": 0.7, "length": 1.0, "friction": 0.4},
    ]
    if kind == "friction":
        bobs[0]["drive"] = {"kind": "escapement", "impulse": 1.0, "angle_deg": 2.0}
    hung = {"links": bobs, "start": {"angles_deg": [20.0, -10.0]}}
    support = {"kind": "cart", "mass": 2.0, kind: 3.0 if kind == "friction" else 0.1}
    scene = scene_from({"gravity": 9.81, "support": support, "pendulum": [hung]})
    event = level_crossing(system_of(scene), "theta[1,1]", angle, stop=True)
    run = simulate(scene, 6.0, output=2, tolerance=1e-10, events=[event])
    whole = simulate(scene, run.times[-1], output=2, tolerance=1e-10)
    assert not run.complete
    assert abs(run.final.links[0] - angle) < 1e-12
    happened: list[tuple[Any, ...]] = [(*each.kicks, *each.friction) for each in (run, whole)]
    for values, expected in zip(*happened, strict=True):
        np.testing.assert_allclose(values, expected, rtol=1e-8, atol=1e-8)


def test_a_stop_at_a_kick_is_after_it() -> None:
    """A speed that is passed by the jump of a kick alone, with other kicks in later steps."""
    clock = {
        "kind": "bob",
        "mass": 1.0,
        "length": 1.0,
        "drive": {"kind": "escapement", "impulse": 0.1, "angle_deg": 2.0},
    }
    scene = scene_from({"gravity": 9.81, "pendulum": [{"links": [clock], "start": {"angles_deg": [10.0]}}]})
    kick = simulate(scene, 10.0).kicks.time[5]
    before, after = (abs(simulate(scene, kick + aside).final.link_rates[0]) for aside in (-1e-9, 1e-9))
    event = Event("fast", lambda state: abs(state.link_rates[0]) - (before + after) / 2, direction=1, stop=True)
    run = simulate(scene, 10.0, events=[event])
    assert len(run.kicks.time) > 0
    assert run.times[-1] == run.kicks.time[-1]
    assert event.value(run.final) > 0


def test_an_event_without_a_number_ends_the_run_where_it_has_none() -> None:
    """What was computed up to there is kept."""
    odd = Event("odd", lambda state: float(np.sqrt(state.links[0] + 0.1)) if state.links[0] > -0.1 else float("nan"))
    with pytest.raises(SimulationError, match="event odd is nan at") as failure:
        simulate(ONE, 60.0, start=state_at_rest(ONE, [10.0]), method="DOP853", events=[odd])
    assert 0.4 < failure.value.trajectory.times[-1] < 0.9


def test_a_reading_is_found_in_equal_pendula_that_share_an_equation() -> None:
    pendula = [Pendulum(links=[Bob(mass=1.0, length=1.0)], count=3)]
    scene = Scene(gravity=9.81, support=Cart(mass=5.0), pendulum=pendula)
    system, start = system_of(scene), state_at_rest(scene, [30.0])
    events = [level_crossing(system, f"theta[{k},1]", 0.1, -1) for k in (1, 3)]
    run = simulate(scene, 1.0, start=start, events=events)
    assert run.run.reduced
    assert len(run.happenings) == 2
    assert run.happenings[0].time == run.happenings[1].time
