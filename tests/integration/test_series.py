"""Taylor series over many steps at once, compiled once for all scenes that differ in numbers alone."""

from __future__ import annotations

from copy import deepcopy
from typing import Any

import numpy as np
import pytest
from amounts import usually

from modal import Bob, Cart, ComputationError, Pendulum, Scene, load
from modal.report import silent
from nonlinear.dynamics import Generated, form_of
from nonlinear.integration import SimulationError, readiness, taylor
from nonlinear.integration.steppers import Pace, Sweeper
from nonlinear.integration.taylor import TaylorStepper
from nonlinear.simulation import simulate
from nonlinear.system import initial_state, state_at_rest, system_of

pytestmark = pytest.mark.skipif(not taylor.available(), reason="heyoka is not installed")
NEARLY = 1e-12


def double(mass: float, length: float) -> Scene:
    links = [Bob(mass=mass, length=length, damping=0.01 * mass), Bob(mass=0.37, length=0.81)]
    return Scene(gravity=9.81, support=Cart(mass=4.3), pendulum=[Pendulum(links=links)])


def stepper(name: str, pace: Pace, end: float) -> TaylorStepper:
    scene = load(name)
    equations = Generated(system_of(scene))
    return TaylorStepper(equations, equations.begin(initial_state(scene)), 0.0, end, 1e-12, pace)


@pytest.mark.parametrize("pace", [Pace(0.05), Pace(0.05, breaks=(0.7, 1.3)), Pace(0.05, longest=0.01)], ids=str)
@pytest.mark.parametrize("name", usually(["chain-3"], ["paper-cart-3", "chain-3"]))
def test_samples_of_many_steps_are_those_of_each(name: str, pace: Pace) -> None:
    times = np.sort(np.append(np.random.default_rng(0).uniform(0.0, 4.0, 200), [0.7, 4.0]))
    far, near = (stepper(name, pace, 4.0) for _ in range(2))
    assert isinstance(far, Sweeper)
    rows: list[Any] = []
    ends: list[float] = []
    while len(rows) < len(times):
        samples, passed, _ = far.sweep(times[len(rows) :])
        rows += list(samples)
        ends += [time for time, _ in passed]
        assert np.array_equal(passed[-1][1], far.y)
    for end in ends:
        before = near.time
        near.step()
        assert near.time == pytest.approx(end, rel=1e-6)
        within = (before < times) & (times <= min(near.time, end))
        assert np.abs(np.array(rows)[within] - near.inside(times[within])).max(initial=0.0) < NEARLY
    assert set(pace.breaks) <= set(ends)
    assert far.calls == near.calls == len(ends)
    assert np.diff(ends, prepend=0.0).max() < pace.longest * (1 + 1e-9)
    inside = far.inside(np.array([ends[-2], ends[-1]]))
    assert np.abs(inside[-1] - far.y).max() < NEARLY


def loaded(scene: Scene, tolerance: float) -> bool:
    return taylor.code_of(form_of(system_of(scene)), (), taylor.uneven(tolerance)).is_ready


def test_scenes_that_differ_in_numbers_alone_share_one_series(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(readiness, "_ready", set())
    taylor._COMPILED.clear()
    for mass, length in ((1.3, 0.7), (2.9, 1.9)):
        scene = double(mass, length)
        run = simulate(scene, 2.0, start=state_at_rest(scene, [70.0, 40.0]), method="taylor", tolerance=1e-13)
        sure = simulate(scene, 2.0, start=state_at_rest(scene, [70.0, 40.0]), method="DOP853", tolerance=1e-13)
        assert np.abs(run.motion.links - sure.motion.links).max() < 1e-9
        assert run.energy_drift() < 1e-12
    assert len(taylor._COMPILED) == 1
    assert loaded(double(0.9, 1.1), 1e-13)
    assert not loaded(double(0.9, 1.1), 1e-3)
    assert not loaded(load("chain-3"), 1e-13)


def test_only_so_many_series_are_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(taylor, "INTEGRATORS_MAX", 2)
    monkeypatch.setattr(readiness, "_ready", set())
    taylor._COMPILED.clear()
    for tolerance in (1e-3, 1e-6, 1e-9):
        scene = load("chain-1")
        simulate(scene, 0.1, start=state_at_rest(scene, [70.0]), method="taylor", tolerance=tolerance)
        assert loaded(scene, tolerance)
    assert len(taylor._COMPILED) == 2


def test_a_series_serves_one_run_after_another_and_no_two_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    copies: list[Any] = []
    monkeypatch.setattr(taylor, "deepcopy", lambda original: copies.append(deepcopy(original)) or copies[-1])
    monkeypatch.setattr(taylor, "_COMPILED", taylor.Originals())
    runs = [simulate(load("chain-3"), 3.0, method="taylor", output=20) for _ in range(3)]
    assert len(copies) == 1
    assert all(np.array_equal(run.motion.links, runs[0].motion.links) for run in runs)
    first, other = (stepper("chain-3", Pace(0.05), 4.0) for _ in range(2))
    first.step()
    assert first.integrator is not other.integrator
    assert other.time == 0.0


@pytest.mark.parametrize("name", usually(["chain-3"], ["paper-cart-3", "chain-3"]))
def test_a_run_that_nobody_watches_takes_the_same_steps(name: str) -> None:
    heard: list[float] = []
    watched = simulate(load(name), 3.0, method="taylor", report=heard.append)
    alone = simulate(load(name), 3.0, method="taylor")
    assert (watched.run.steps, watched.run.calls) == (alone.run.steps, alone.run.calls) == (len(heard), len(heard))
    assert np.array_equal(watched.motion.links, alone.motion.links)


@pytest.mark.parametrize("report", [silent, lambda elapsed: None])
def test_a_series_that_breaks_down_on_the_way_keeps_what_it_has(report: Any) -> None:
    scene = Scene(gravity=9.81, support=Cart(mass=0.0), pendulum=[Pendulum(links=[Bob(mass=1.0, length=1.0)])])
    start = state_at_rest(scene, [60.0])
    with pytest.raises(SimulationError, match=r"taylor stopped at [\d.]+ s") as caught:
        simulate(scene, 10.0, method="taylor", start=start, report=report)
    trajectory = caught.value.trajectory
    assert 0.1 < trajectory.times[-1] < 2.0
    assert np.isfinite(trajectory.motion.links).all()
    assert trajectory.run.steps > 5


def test_what_leaves_the_finite_numbers_stops_in_words() -> None:
    equations = Generated(system_of(double(1.0, 1.0)))
    y = np.append(np.zeros(6), 0.0)
    y[4] = 1e200
    broken = TaylorStepper(equations, y, 0.0, 1.0, 1e-12, Pace(1e-3))
    with pytest.raises(ComputationError, match=taylor.GIVES_UP["err_nf_state"]):
        broken.sweep(np.array([1.0]))
