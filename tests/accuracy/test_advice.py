"""The cheapest way to a wished accuracy: it is met, it is cheap, and what cannot be met is said."""

from __future__ import annotations

import csv
import io
import json
from dataclasses import replace
from functools import cache
from itertools import pairwise
from math import inf, radians
from pathlib import Path

import numpy as np
import pytest
from advice import held
from amounts import usually
from scenes import motion_scene
from scipy.special import ellipj, ellipk

from modal import Bob, Body, Cart, Pendulum, Rod, Scene, SceneError, load, natural_modes
from multipendula.cli import main
from nonlinear import AppliedForces, initial_state, level_crossing, resume, simulate, state_at_rest, system_of
from nonlinear import files as recordings
from nonlinear import load as load_run
from nonlinear.accuracy import advice_table
from nonlinear.accuracy.advice import TOLERANCE_RATIO, Advice, Attempt, TriedRun, _difference, _with_errors
from nonlinear.integration import Choice, Request, SimulationError, Trajectory
from nonlinear.reduction import start_in_mode
from nonlinear.simulation import advise
from nonlinear.system import State, apart

PAPER = load("paper-cart-2")


def asked(seed: int) -> tuple[Scene, State, float, float]:
    """A scene, a start of any size, a duration (s) and an accuracy (rad)."""
    rng = np.random.default_rng(seed)
    scene = motion_scene(4000 + seed, damped=bool(rng.random() < 0.3), standing=False, most=2)
    start, size = initial_state(scene), 10 ** rng.uniform(-3, -0.3)
    start = replace(start, links=size * start.links, link_rates=size * start.link_rates)
    return scene, start, float(10 ** rng.uniform(0, 1)), float(10 ** rng.uniform(-7, -2))


@pytest.mark.parametrize("seed", usually(range(1, 24, 12), range(24)))
def test_the_accuracy_is_met(seed: int) -> None:
    scene, start, duration, accuracy = asked(seed)
    advice = advise(scene, duration, accuracy, start=start, output=101)
    assert advice.is_met
    sure = simulate(scene, duration, start=start, output=101, form="hamiltonian", tolerance=1e-12)
    assert apart(advice.trajectory.motion, sure.motion).max() < accuracy
    assert advice.trajectory.run.error == advice.attempts[-1].error == advice.errors[-1] <= accuracy
    assert len(advice.trajectory.times) == len(advice.errors) == 101


def test_it_takes_few_times_the_derivatives_of_the_loosest_tolerance_that_would_do() -> None:
    spent, needed = [], []
    for seed in usually(range(4), range(12)):
        scene, start, duration, accuracy = asked(100 + seed)
        start = replace(start, links=start.links + 0.3)
        advice = advise(scene, duration, accuracy, start=start, method="DOP853")
        sure = simulate(scene, duration, start=start, method="DOP853", tolerance=1e-13)
        for exponent in np.arange(-2.0, -13.0, -0.25):
            run = simulate(scene, duration, start=start, method="DOP853", tolerance=float(10**exponent))
            if apart(run.motion, sure.motion).max() < accuracy:
                break
        assert advice.is_met
        spent.append(sum(attempt.calls for attempt in advice.attempts))
        needed.append(run.run.calls)
    ratios = np.array(spent) / needed
    assert np.median(ratios) < 4
    assert ratios.max() < 6


def test_two_runs_that_share_an_error_are_not_believed() -> None:
    """Both have the phase of the fastest swing, on a stiff joint, wrong by nearly the same."""
    scene, start, duration, accuracy = held(910_167)
    advice = advise(scene, duration, accuracy, start=start)
    sure = simulate(scene, duration, start=start, method="DOP853", tolerance=1e-12, output=advice.trajectory.times)
    assert apart(advice.trajectory.motion, sure.motion).max() <= min(advice.attempts[-1].error, accuracy)


def found_with(tolerance: float, error: float) -> TriedRun:
    """A run whose one angle is off by this at its end, half as much halfway."""
    scene = Scene(gravity=9.81, pendulum=[Pendulum(links=[Bob(mass=1.0, length=1.0)])])
    run = simulate(scene, 1.0, start=state_at_rest(scene, [30.0]), tolerance=1e-12, output=3)
    links = run.motion.links + error * np.array([[0.0], [0.5], [1.0]])
    moved = replace(run, motion=replace(run.motion, links=links))
    return TriedRun(moved, np.full(3, inf), Attempt("minimal DOP853", tolerance, 0.0, 1, inf), lambda _: moved)


def test_only_the_convergence_that_was_observed_is_credited() -> None:
    """Errors fell to a third from the first tolerance to the second, whatever a hundredfold tolerance may promise."""
    runs = [found_with(2.6e-4, 4.7e-3), found_with(8.0e-6, 1.9e-3)]
    last = found_with(6.7e-8, 5.0e-4)
    assert np.all(_with_errors(last, runs, 0.0).errors[1:] > [2.5e-4, 5.0e-4])
    assert np.all(_with_errors(last, runs[1:], 0.0).errors[1:] > [2.5e-4, 5.0e-4])
    falling = _with_errors(found_with(1e-8, 1e-7), [found_with(1e-4, 1e-3), found_with(1e-6, 1e-5)], 0.0)
    assert 1e-7 < falling.errors[-1] < 1e-5
    risen = _with_errors(found_with(1e-8, 1e-3), [found_with(1e-4, 2e-3), found_with(1e-6, 3e-3)], 0.0)
    assert risen.errors[-1] > 1e-3


def test_where_a_run_has_parted_errors_fall_as_they_did_before() -> None:
    parted, loose, tight = found_with(1e-4, 0.5), found_with(1e-6, 2.6e-3), found_with(1e-8, 2.6e-5)
    halfway, end = _with_errors(tight, [parted, loose], 0.0).errors[1:]
    assert end == pytest.approx(2 * halfway)
    assert 2.6e-5 < end < 2.6e-3


def test_a_light_rod_above_a_heavy_body() -> None:
    """Few steps, and an error that is larger than what the tolerances let expect."""
    first = [
        Rod(mass=0.2266, length=2.0298, damping=0.06733),
        Body(mass=8.22, length=2.889, centre=1.7335, inertia=6.861, damping=14.146),
    ]
    second = [
        Bob(mass=0.5862, length=1.1796, damping=0.016575),
        Rod(mass=0.2173, length=2.013, damping=0.1594),
    ]
    third = [
        Rod(mass=0.46185, length=0.77707),
        Body(mass=1.4797, length=2.03956, centre=1.22374, inertia=0.6155),
        Bob(mass=0.51275, length=0.49649, damping=0.01753),
    ]
    scene = Scene(
        gravity=9.81,
        support=Cart(mass=3.99755, damping=0.9687),
        pendulum=[Pendulum(links=each) for each in (first, second, third)],
    )
    angles = 1e-4 * np.array([2.6398, 3.4145, -1.7269, -0.3626, -0.4716, -0.3325, 0.3259])
    start = State(angles, 1e-4 * np.array([-2.2908, 3.2028, -2.685, 1.1676, -2.2873, 2.1908, -3.1429]))
    sure = simulate(scene, 5.4, start=start, tolerance=1e-12, output=201)
    for accuracy in (1e-2, 1e-3, 1e-4, 1e-5):
        advice = advise(scene, 5.4, accuracy, start=start, output=201, method="DOP853")
        assert apart(advice.trajectory.motion, sure.motion).max() < advice.errors[-1] <= accuracy


def test_driven_pendula() -> None:
    scene, accuracy = load(Path(__file__).parent / "driven.toml"), 2.2204330235142645e-4
    advice = advise(scene, 15.0, accuracy)
    sure = simulate(scene, 15.0, tolerance=1e-11, output=advice.trajectory.times)
    assert apart(advice.trajectory.motion, sure.motion).max() < advice.errors[-1] <= accuracy


def test_small_motions_are_not_integrated() -> None:
    start = start_in_mode(PAPER, natural_modes(PAPER), 1, 0, radians(0.5))
    linear = advise(PAPER, 60.0, 1e-3, start=start)
    assert [attempt.way for attempt in linear.attempts] == ["linear modes"]
    assert linear.attempts[0].calls == 0
    corrected = advise(PAPER, 60.0, 2e-6, start=start)
    assert [attempt.way for attempt in corrected.attempts] == ["linear modes", "corrected modes"]
    sure = simulate(PAPER, 60.0, start=start, tolerance=1e-13)
    for advice in (linear, corrected):
        true = apart(advice.trajectory.motion, sure.motion).max()
        assert 0.3 * advice.errors[-1] < true < advice.errors[-1] <= advice.accuracy
    integrated = advise(PAPER, 60.0, 1e-9, start=start)
    assert integrated.attempts[-1].calls > 0


def test_a_long_chain_in_its_lowest_mode_moves_in_a_few() -> None:
    chain = Scene(gravity=9.81, pendulum=[Pendulum(links=[Bob(mass=1.0, length=0.01, count=240)])])
    start = start_in_mode(chain, natural_modes(chain), 0, 0, radians(3.0))
    advice = advise(chain, 1.0, 1e-4, start=start, output=11)
    assert [attempt.way for attempt in advice.attempts] == ["5 mode shapes"]
    sure = simulate(chain, 1.0, start=start, tolerance=1e-9, output=11)
    true = apart(advice.trajectory.motion, sure.motion).max()
    assert true < advice.errors[-1] <= 1e-4
    assert advice.attempts[0].calls < sure.run.calls / 10
    asked = advise(chain, 0.1, 1e-4, start=start, output=3, method="DOP853")
    assert "mode shapes" not in asked.attempts[-1].way


@cache
def chaotic() -> Advice:
    """A run that lasts longer than its digits."""
    return advise(load("paper-cart-3"), 25.0, 1e-3)


def test_beyond_the_horizon_nothing_is_promised() -> None:
    scene, advice = load("paper-cart-3"), chaotic()
    assert not advice.is_met
    assert 8.0 < advice.horizon < 22.0
    sure = simulate(scene, advice.horizon, tolerance=3e-14, method="DOP853", output=advice.certain.times)
    assert apart(advice.certain.motion, sure.motion).max() < 1e-2
    assert advice.certain.run.error <= 1e-3
    assert advice.certain.run.stopped.startswith("0.001 rad cannot be met beyond")
    with pytest.raises(SimulationError, match="no further: beyond it double precision") as caught:
        simulate(scene, 25.0, accuracy=1e-3)
    assert caught.value.trajectory.times[-1] == pytest.approx(advice.horizon, rel=0.1)


def test_a_run_knows_its_error_and_can_be_kept_and_gone_on_from(tmp_path) -> None:  # type: ignore[no-untyped-def]
    start = start_in_mode(PAPER, natural_modes(PAPER), 1, 0, 0.01)
    for accuracy in (1e-3, 1e-8):
        first = simulate(PAPER, 5.0, start=start, accuracy=accuracy)
        assert first.run.error <= accuracy
        recordings.save(first, tmp_path / "run.npz")
        again = load_run(tmp_path / "run.npz")
        assert again.run == first.run
        on = resume(again, 5.0, accuracy=accuracy)
        whole = simulate(PAPER, 10.0, start=start, tolerance=1e-12, output=[10.0])
        assert on.times[0] == 5.0
        assert np.abs(on.final.links - whole.final.links).max() < 20 * accuracy
        assert resume(again, 1.0).complete
    assert simulate(PAPER, 5.0, start=start).run.error == inf


def test_loads_events_and_times_go_with_an_accuracy() -> None:
    scene = Scene(gravity=9.81, support=Cart(mass=2.0), pendulum=[Pendulum(links=[Bob(mass=1.0, length=1.0)])])
    start = state_at_rest(scene, [30.0])

    def load_of(time: float, state: State) -> AppliedForces:
        return AppliedForces(cart=float(np.sin(time)))

    pushed = simulate(
        scene, 4.0, start=start, load=load_of, accuracy=1e-6, output=[1.0, 4.0], start_time=3.0, breaks=[]
    )
    sure = simulate(scene, 4.0, start=start, load=load_of, tolerance=1e-12, output=[1.0, 4.0], start_time=3.0)
    assert list(pushed.times) == [3.0, 4.0, 7.0]
    assert apart(pushed.motion, sure.motion).max() < 1e-6
    stop = level_crossing(system_of(scene), "theta[1,1]", stop=True)
    ended = simulate(scene, 4.0, start=start, events=[stop], accuracy=1e-6)
    assert ended.run.stopped.startswith("theta[1,1]")
    assert abs(ended.final.links[0]) < 1e-6
    assert ended.run.error <= 1e-6


def test_in_space_and_with_equal_pendula() -> None:
    spatial = load("chain-spatial")
    run = simulate(spatial, 3.0, accuracy=1e-5)
    sure = simulate(spatial, 3.0, tolerance=1e-12)
    assert apart(run.motion, sure.motion).max() < 1e-5
    pendulum = Pendulum(links=[Bob(mass=1.0, length=1.0)] * 2, count=50)
    many = Scene(gravity=9.81, support=Cart(mass=100.0), pendulum=[pendulum])
    crowd = simulate(many, 3.0, start=state_at_rest(many, [60.0, 20.0]), accuracy=1e-4)
    assert crowd.run.reduced.startswith("1 of 50 pendula")


def test_bad_wishes_are_refused() -> None:
    for accuracy in (0.0, -1.0, float("nan"), inf, 1.0, "fine", True):
        with pytest.raises(SceneError, match="accuracy"):
            advise(PAPER, 1.0, accuracy)  # type: ignore[arg-type]
    with pytest.raises(SceneError, match=r"^accuracy: .*tolerance"):
        simulate(PAPER, 1.0, accuracy=1e-3, tolerance=1e-6)
    with pytest.raises(SceneError, match=r"(?s)duration.*accuracy"):
        advise(PAPER, -1.0, 0.0)


def test_control_c_gives_what_there_is_without_a_promise() -> None:
    def report(elapsed: float) -> None:
        if elapsed > 3.0:
            raise KeyboardInterrupt

    advice = advise(load("paper-cart-3"), 10.0, 1e-6, report=report)
    assert advice.trajectory.run.interrupted
    assert not advice.is_met
    assert advice.trajectory.run.error == inf
    assert 3.0 < advice.trajectory.times[-1] < 5.0


def test_two_runs_that_may_be_one_are_no_evidence() -> None:
    scene = load("paper-cart-3")
    attempts = advise(scene, 60.0, 1e-12).attempts
    tolerances = [attempt.tolerance for attempt in attempts if attempt.calls]
    assert tolerances[0] == pytest.approx(TOLERANCE_RATIO * tolerances[1])
    assert all(4 * tight < loose for loose, tight in pairwise(tolerances))
    assert attempts[-1].error == inf


def test_the_table_in_every_form(capsys: pytest.CaptureFixture[str]) -> None:
    advice = advise(PAPER, 5.0, 1e-3, start=start_in_mode(PAPER, natural_modes(PAPER), 1, 0, 0.3))
    text, markdown, comma, whole = (advice_table(advice, form) for form in ("text", "markdown", "csv", "json"))
    assert f"no angle is off by more than {advice.errors[-1]:.2g} rad until 5 s." in text
    assert "".join(markdown.splitlines()[2].split()) == "|way|tolerance|time(ms)|derivatives|error(rad)|"
    rows = list(csv.DictReader(io.StringIO(comma)))
    assert len(rows) == len(advice.attempts)
    record = json.loads(whole)
    assert record["met"] is True
    assert record["attempts"][-1]["error_rad"] == advice.attempts[-1].error


def test_the_command(tmp_path, capsys: pytest.CaptureFixture[str]) -> None:  # type: ignore[no-untyped-def]
    words = "simulate paper-cart-2 --start mode:2:5 --accuracy 1e-3 --duration 10"
    assert main([*words.split(), "-o", str(tmp_path / "run.npz")]) == 0
    assert "the cheapest method for 0.001 rad" in capsys.readouterr().out
    assert load_run(tmp_path / "run.npz").run.error <= 1e-3
    assert (
        main([*["simulate", "paper-cart-3", "--accuracy", "1e-3", "--duration", "25"], "-o", str(tmp_path / "b.npz")])
        == 1
    )
    told = capsys.readouterr()
    assert "no further" in told.out
    assert "\nmultipendula: 0.001 rad can be shown to be met up to" in told.err
    kept = load_run(tmp_path / "b.npz")
    assert kept.run.error <= 1e-3
    assert kept.times[-1] < 22.0
    with pytest.raises(SystemExit) as left:
        main(["simulate", "paper-cart-2", "--accuracy", "nan"])
    assert left.value.code == 2
    assert main(["simulate", "paper-cart-2", "--duration", "2", "--accuracy", "1e-3"]) == 0
    assert "no angle is off by more than" in capsys.readouterr().out
    assert main(["simulate", "paper-cart-2", "--duration", "2", "--accuracy", "1e-3", "--tolerance", "1e-6"]) == 2
    assert "--tolerance: cannot be combined with --accuracy" in capsys.readouterr().err
    assert main(["simulate", "nowhere.toml", "--accuracy", "1e-3", "-o", "a.txt"]) == 2


def test_the_horizon_does_not_depend_on_the_instants_kept() -> None:
    every, few = chaotic(), advise(load("paper-cart-3"), 25.0, 1e-3, output=[23.0, 25.0])
    assert few.horizon == pytest.approx(every.horizon, abs=3.0)
    assert list(few.certain.times) == [0.0, few.horizon]
    assert few.certain.run.error <= 1e-3


def test_what_happens_beyond_the_horizon_is_left_out() -> None:
    scene = load("paper-cart-3")
    advice = advise(scene, 25.0, 1e-3, events=[level_crossing(system_of(scene), "x")])
    assert advice.trajectory.happenings[-1].time > advice.horizon
    assert 0 < len(advice.certain.happenings) < len(advice.trajectory.happenings)
    assert advice.certain.happenings[-1].time <= advice.horizon


def test_a_run_that_ended_early_says_nothing_of_what_follows() -> None:
    start = start_in_mode(PAPER, natural_modes(PAPER), 1, 0, 0.3)
    long, short = (simulate(PAPER, 4.0, start=start, tolerance=t, output=101) for t in (1e-9, 1e-6))
    ended = _difference(long, short.at(slice(30)))
    assert np.all(ended[:30] < 1e-3)
    assert np.all(ended[30:] == inf)
    assert _difference(long, short.at(slice(100)))[-1] < 1e-3


def test_no_error_below_rounding_is_promised() -> None:
    pytest.importorskip("heyoka")
    scene = Scene(gravity=9.81, pendulum=[Pendulum(links=[Bob(mass=1.0, length=1.0)])])
    start = state_at_rest(scene, [60.0])
    k, omega = np.sin(start.links[0] / 2), np.sqrt(9.81)
    for duration in (1.0, 10.0):
        advice = advise(scene, duration, 1e-12, start=start, method="taylor", output=21)
        sine = ellipj(ellipk(k * k) - omega * advice.trajectory.times, k * k)[0]
        true = np.abs(2 * np.arcsin(k * sine) - advice.trajectory.motion.links[:, 0]).max()
        assert max(true, 1e-15) < advice.errors[-1]


def test_what_was_interrupted_is_not_called_a_limit_of_the_digits() -> None:
    def report(elapsed: float) -> None:
        if elapsed > 3.0:
            raise KeyboardInterrupt

    told = advice_table(advise(load("paper-cart-3"), 10.0, 1e-6, report=report), "text")
    assert "no accuracy is guaranteed" in told
    assert "digits" not in told


def test_a_loose_run_that_gives_up_is_an_attempt_that_failed(monkeypatch: pytest.MonkeyPatch) -> None:
    """A stiff scene at the first tolerance ends in nonsense that a tighter run never meets."""
    whole, given_up = Request.run, []

    def loose(request: Request, choice: Choice) -> Trajectory:
        trajectory = whole(request, choice)
        if choice.tolerance < least:
            return trajectory
        given_up.append(choice.tolerance)
        raise SimulationError("nonsense", trajectory.at(trajectory.times <= 0.5))

    monkeypatch.setattr(Request, "run", loose)
    start, least = state_at_rest(PAPER, [60.0, 0.0, 0.0, 0.0]), 1e-7
    advice = advise(PAPER, 1.0, 1e-3, start=start)
    assert advice.is_met
    assert 0 < len(given_up) < len(advice.attempts)
    assert all(attempt.error == inf for attempt in advice.attempts if attempt.tolerance in given_up)
    least = 0.0
    with pytest.raises(SimulationError, match="nonsense"):
        advise(PAPER, 1.0, 1e-3, start=start)
