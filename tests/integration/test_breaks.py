"""Loads that act for a short while: steps end where they jump, or are short enough to see them."""

from __future__ import annotations

from itertools import pairwise
from math import inf, radians
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from modal import Bob, Cart, ComputationError, Pendulum, Scene, SceneError, load
from modal.types import Floats
from nonlinear import AppliedForces, Trajectory, resume, simulate, state_at_rest
from nonlinear import files as recordings
from nonlinear.integration.steppers import Pace, SciPyStepper
from nonlinear.integration.taylor import available
from nonlinear.simulation import advise
from nonlinear.system import Load, State

BOB = Scene(gravity=9.81, pendulum=[Pendulum(links=[Bob(mass=1.0, length=1.0)])])
IMPULSE, BEGINS = 0.5, 3.3  # N m s, s
WAYS: list[dict[str, Any]] = [{"method": name} for name in ("DOP853", "RK45", "RK23", "Radau", "BDF", "LSODA")]
WAYS += [{"form": "maximal"}, {"form": "hamiltonian"}]


def kick(seconds: float, first: float = BEGINS) -> Load:
    """A moment of IMPULSE in all, for so long."""
    moment = np.array([IMPULSE / seconds])
    return lambda time, state: AppliedForces(moments=moment if first <= time < first + seconds else 0.0 * moment)


def stretches(seconds: float, times: Floats) -> Floats:
    """The angle of BOB let go at 5 degrees, each stretch of constant moment by SciPy alone."""
    edges, y, angles = [0.0, BEGINS, BEGINS + seconds, 10.0], [radians(5.0), 0.0], np.full(len(times), np.nan)
    for moment, (begin, end) in zip((0.0, IMPULSE / seconds, 0.0), pairwise(edges), strict=True):

        def rate(_: float, y: Floats, moment: float = moment) -> list[float]:
            return [y[1], moment - 9.81 * np.sin(y[0])]

        solved = solve_ivp(rate, (begin, end), y, "DOP853", rtol=1e-12, atol=1e-14, dense_output=True)
        within = (begin <= times) & (times <= end)
        angles[within], y = solved.sol(times[within])[0], solved.y[:, -1]
    return angles


def ends(scene: Scene, duration: float, **more: Any) -> tuple[Floats, Trajectory]:
    """Where the steps of a run end (s after its start), and the run."""
    heard: list[float] = []
    run = simulate(scene, duration, output=3, report=heard.append, **more)
    return np.array(heard), run


@pytest.mark.parametrize("how", ["breaks", "max_step"])
@pytest.mark.parametrize(("accuracy", "seconds"), [(1e-2, 0.05), (1e-2, 0.1), (1e-4, 0.02)])
def test_an_accuracy_is_met_under_a_short_load(accuracy: float, seconds: float, how: str) -> None:
    told: dict[str, Any] = {"breaks": [BEGINS, BEGINS + seconds], "max_step": seconds}
    start, pushed = state_at_rest(BOB, [5.0]), kick(seconds)
    advice = advise(BOB, 10.0, accuracy, start=start, load=pushed, **{how: told[how]})
    trajectory = advice.trajectory
    true = np.abs(trajectory.motion.links[:, 0] - stretches(seconds, trajectory.times)).max()
    assert advice.is_met
    assert true < trajectory.run.error <= accuracy
    missed = [
        simulate(BOB, 10.0, start=start, load=pushed, tolerance=t, output=trajectory.times) for t in (4e-3, 1.3e-4)
    ]
    assert max(np.abs(run.motion.links[:, 0] - stretches(seconds, trajectory.times)).max() for run in missed) > 0.1


def test_an_accuracy_wants_to_know_how_soon_a_load_changes() -> None:
    for run in (simulate, advise):
        with pytest.raises(SceneError, match=r"(?s)duration.*load: .*as breaks, \[\] where .*max_step") as refused:
            run(BOB, -1.0, accuracy=1e-3, start=state_at_rest(BOB, [5.0]), load=kick(0.1))  # type: ignore[operator]
        assert "--" not in str(refused.value)
    start = state_at_rest(BOB, [5.0])
    smooth = simulate(
        BOB, 1.0, accuracy=1e-3, start=start, breaks=[], load=lambda time, state: AppliedForces(moments=np.ones(1))
    )
    assert smooth.run.error <= 1e-3
    assert simulate(BOB, 1.0, start=start, load=kick(0.1)).complete


@pytest.mark.parametrize("how", WAYS, ids=str)
def test_steps_end_at_the_breaks_and_are_no_longer_than_asked(how: dict[str, Any]) -> None:
    cart = Scene(gravity=9.81, support=Cart(mass=2.0), pendulum=BOB.pendulum)
    start = state_at_rest(cart, [60.0])
    for tolerance in (1e-3, 1e-9):
        options = {**how, "start": start, "tolerance": tolerance, "start_time": 5.0}
        heard, run = ends(cart, 1.0, breaks=[5.7, 0.0, 5.123, 5.7, 99.0], **options)
        assert {5.123 - 5.0, 5.7 - 5.0} <= set(heard)
        heard, short = ends(cart, 1.0, max_step=0.01, **options)
        assert np.diff(heard, prepend=0.0).max() < 0.01 * (1 + 1e-9)
        assert short.run.steps >= 100
        sure = simulate(cart, 1.0, start=start, start_time=5.0, tolerance=1e-12, output=3)
        for each in (run, short):
            assert np.abs(each.motion.links - sure.motion.links).max() < 100 * tolerance


@pytest.mark.skipif(not available(), reason="heyoka is not installed")
def test_series_end_at_the_breaks_and_are_no_longer_than_asked() -> None:
    test_steps_end_at_the_breaks_and_are_no_longer_than_asked({"method": "taylor"})


def test_in_space_too() -> None:
    scene = load("chain-spatial")
    heard, run = ends(scene, 0.5, breaks=[0.2], tolerance=1e-9)
    assert 0.2 in heard
    assert np.abs(run.motion.links - simulate(scene, 0.5, tolerance=1e-12, output=3).motion.links).max() < 1e-7


def test_a_load_is_seen_as_it_is_beside_a_break() -> None:
    """On the side of the step: so a jump costs no rejected steps, whichever side it counts itself to."""
    start, seconds = state_at_rest(BOB, [5.0]), 0.1

    def open_left(time: float, state: State) -> AppliedForces:
        return AppliedForces(moments=np.array([IMPULSE / seconds * (BEGINS < time <= BEGINS + seconds)]))

    free = simulate(BOB, 10.0, start=start, tolerance=1e-10, method="DOP853")
    for pushed in (kick(seconds), open_left):
        heard: list[float] = []

        def seen(time: float, state: State, pushed: Load = pushed, heard: list[float] = heard) -> AppliedForces:
            heard.append(time)
            return pushed(time, state)

        breaks = [BEGINS, BEGINS + seconds]
        run = simulate(BOB, 10.0, start=start, load=seen, tolerance=1e-10, method="DOP853", breaks=breaks)
        assert np.abs(run.motion.links[:, 0] - stretches(seconds, run.times)).max() < 1e-8
        assert not {BEGINS, BEGINS + seconds} & set(heard)
        assert run.run.calls < 1.6 * free.run.calls + 200
        blind = simulate(BOB, 10.0, start=start, load=pushed, tolerance=1e-10, method="DOP853", max_step=seconds)
        assert blind.run.calls > 1.5 * run.run.calls


def test_events_and_kicks_between_breaks() -> None:
    clock = load("huygens")
    plain = simulate(clock, 5.0, tolerance=1e-11, output=11)
    broken = simulate(clock, 5.0, tolerance=1e-11, output=11, breaks=np.linspace(0.0, 5.0, 40))
    assert len(plain.kicks.time) > 3
    assert broken.kicks.time == pytest.approx(plain.kicks.time, abs=1e-8)
    assert np.abs(broken.motion.links - plain.motion.links).max() < 1e-8


def test_runs_that_are_judged_differ_whatever_holds_their_steps_down() -> None:
    """Every run is held down by the load's own stretches, so that the tolerance changes nothing."""

    def wave(time: float, state: State) -> AppliedForces:
        return AppliedForces(moments=np.array([np.sign(np.sin(20 * np.pi * time))]))

    start, breaks = state_at_rest(BOB, [5.0]), np.arange(0, 2.01, 0.05)
    for method in ("RK23", "DOP853"):
        advice = advise(BOB, 2.0, 1e-3, start=start, load=wave, breaks=breaks, method=method, output=21)
        sure = simulate(BOB, 2.0, start=start, load=wave, breaks=breaks, tolerance=1e-13, output=21)
        assert advice.is_met
        true = np.abs(advice.trajectory.motion.links - sure.motion.links).max()
        assert true <= advice.trajectory.run.error <= 1e-3


def test_a_driven_run_goes_on_with_its_breaks(tmp_path: Path) -> None:
    start, pushed, breaks = state_at_rest(BOB, [5.0]), kick(0.02), [BEGINS, BEGINS + 0.02]
    recordings.save(simulate(BOB, 2.0, start=start, load=pushed, accuracy=1e-6, breaks=breaks), tmp_path / "run.npz")
    kept = recordings.load(tmp_path / "run.npz")
    with pytest.raises(SceneError, match="max_step"):
        resume(kept, 8.0, load=pushed, accuracy=1e-6)
    on = resume(kept, 8.0, load=pushed, accuracy=1e-6, breaks=breaks)
    assert np.abs(on.motion.links[:, 0] - stretches(0.02, on.times)).max() < 5e-6


def test_bad_breaks_and_steps_are_refused_together() -> None:
    for breaks in ([np.nan], [[1.0]], "soon", [None], inf):
        with pytest.raises(SceneError, match=r"(?s)breaks: must be times in seconds.*max_step -1.0"):
            simulate(BOB, 1.0, breaks=breaks, max_step=-1.0)  # type: ignore[arg-type]
    for step in (0.0, inf, True, "short"):
        with pytest.raises(SceneError, match=r"max_step .*: must be a positive number of seconds"):
            simulate(BOB, 1.0, max_step=step)  # type: ignore[arg-type]


def test_the_stretch_between_two_breaks() -> None:
    pace = Pace(breaks=(1.0, 2.0))
    assert [pace.stretch(time) for time in (0.5, 1.0, 1.5, 2.0)] == [(-inf, 1.0), (1.0, 2.0), (1.0, 2.0), (2.0, inf)]
    assert (pace.longest_between(1.0, 2.0), Pace(share=0.5).longest_between(1.0, 2.0)) == (inf, 0.5)
    assert Pace(longest=0.1, share=0.5).longest_between(1.0, 2.0) == 0.05


@pytest.mark.parametrize("method", ["Radau", "BDF"])
def test_a_jacobian_that_overflows_ends_the_run_in_words(method: str) -> None:
    """As that of a stiff scene does whose rates are about to; a mistake of the caller's own stays what it is."""
    stepper = SciPyStepper(
        method, lambda time, y: 1e200 * y**2, 0.0, np.array([1e60]), 1.0, 1e-6, np.array([1e-6]), Pace(first=1e-3)
    )
    with pytest.raises(ComputationError, match=rf"{method} stopped at 0 s: "), np.errstate(all="ignore"):
        stepper.step()

    def wrong(time: float, y: Floats) -> Floats:
        if time > 0:
            raise ValueError("the caller's own")
        return -y

    stepper = SciPyStepper(method, wrong, 0.0, np.array([1.0]), 1.0, 1e-6, np.array([1e-6]), Pace(first=1e-3))
    with pytest.raises(ValueError, match="the caller's own"):
        stepper.step()
