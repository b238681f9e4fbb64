"""When a motion passes a level: one meaning in every engine, against a pendulum in closed form and mirror images."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from scipy.special import ellipk

from modal import load
from modal.scene import Bob, Cart, Pendulum, Scene
from nonlinear import Event, State, simulate
from nonlinear.ensembles import Ensemble, ensemble, find_section

ENGINES = ["numpy", "simulate"]
ONE = Scene(gravity=9.81, pendulum=[Pendulum(links=[Bob(mass=1.0, length=1.0)])])
AMPLITUDE = 2.0
PERIOD = 4 * ellipk(np.sin(AMPLITUDE / 2) ** 2) / np.sqrt(9.81)


def run(engine: str, starts: list[State], duration: float, section: str, scene: Scene = ONE) -> Ensemble:
    measures = ["first_turn", "largest_angle", f"section:{section}"]
    return ensemble(scene, duration, starts=starts, measures=measures, engine=engine, workers=1, check=0)


def state(angle: float, rate: float = 0.0) -> State:
    return State(np.array([angle]), np.array([rate]))


@pytest.mark.parametrize("engine", ENGINES)
def test_a_pendulum_passes_and_returns_about_its_turning_point(engine: str) -> None:
    """A hundredth of a degree before it, at ½ sqrt(2 δ/|θ''|) on either side of every half period."""
    level = AMPLITUDE - 2e-4
    passed = run(engine, [state(AMPLITUDE)], 2.2 * PERIOD, f"theta[1,1]={float(np.degrees(level))!r}")
    aside = np.sqrt(2 * 2e-4 / (9.81 * np.sin(AMPLITUDE)))
    expected = [aside, *(k * PERIOD + way * aside for k in (1, 2) for way in (-1, 1))]
    np.testing.assert_allclose(passed.column("crossing_time_s"), expected, atol=1e-5)
    assert np.radians(passed.column("largest_angle_deg")) == pytest.approx(AMPLITUDE, abs=1e-7)


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("way", "<=>")
def test_a_start_on_a_section_counts_if_it_passes(engine: str, way: str) -> None:
    """With a rate the way asked for; released from rest it does not, to whichever side; mirror images are alike."""
    starts = [state(0.5, 1.0), state(0.5, -1.0), state(0.5), state(0.5 + 2 * np.pi, 1.0), state(0.5 - 2 * np.pi)]
    passed = run(engine, starts, 0.4 * PERIOD, f"theta[1,1]{way}{float(np.degrees(0.5))!r}")
    up, down = way in "=>", way in "=<"
    member, time = passed.column("crossing_member"), passed.column("crossing_time_s")
    at_start = [np.count_nonzero((member == k) & (time == 0)) for k in range(5)]
    assert at_start == [up, down, 0, up, 0]
    later = [np.count_nonzero((member == k) & (time > 0)) for k in range(5)]
    assert later == [down, 0, 0, down, 0]
    mirrored = {"<": ">", ">": "<", "=": "="}[way]
    images = [State(-start.links, -start.link_rates) for start in starts]
    other = run(engine, images, 0.4 * PERIOD, f"theta[1,1]{mirrored}{-float(np.degrees(0.5))!r}")
    np.testing.assert_allclose(other.column("crossing_time_s"), time, atol=1e-12)


@pytest.mark.parametrize("engine", [*ENGINES, "numba"])
def test_a_start_at_the_top_turns_over_if_it_passes(engine: str) -> None:
    """Upright at rest the upper link is driven off by the lower one, and comes over the top later, or never."""
    angles = np.array([[np.pi, 1.0], [-np.pi, -1.0], [np.pi, -1.0], [-np.pi, 1.0], [3 * np.pi, 1.0]])
    rates = [np.zeros(2)] * 5 + [np.array([0.3, 0.0]), np.array([-0.3, 0.0])]
    places = [*angles, angles[0], angles[0]]
    starts = [State(place, rate) for place, rate in zip(places, rates, strict=True)]
    first = run(engine, starts, 2.0, "theta[1,1]=0", load("chain-2")).column("first_turn_1_1_s")
    assert np.all(first[5:] == 0)
    assert np.all(first[:5] > 0.1)
    np.testing.assert_allclose(first[[1, 2, 3, 4]], first[[0, 3, 2, 0]], atol=1e-7)


@cache
def reference() -> float:
    """When the upper link of a double pendulum from 180° and 1 rad first passes 180° ± 360° k, by dense samples."""
    run = simulate(load("chain-2"), 2.0, start=State(np.array([np.pi, 1.0]), np.zeros(2)), output=40_001)
    cell = np.floor((run.motion.links[:, 0] - np.pi) / (2 * np.pi))
    passed = run.times[1:][np.diff(cell) != 0]
    return float(passed[passed > 0.01].min(initial=np.inf))


@pytest.mark.parametrize("engine", ENGINES)
def test_the_first_turn_after_a_start_at_the_top_is_that_of_samples(engine: str) -> None:
    start = [State(np.array([np.pi, 1.0]), np.zeros(2))]
    first = run(engine, start, 2.0, "theta[1,1]=0", load("chain-2")).column("first_turn_1_1_s")
    assert first[0] == pytest.approx(reference(), abs=1e-4)


def test_compiled_members_pass_and_return_as_others_do() -> None:
    """Just within the first turning points of two links."""
    start, at = State(np.array([1.5, -0.5]), np.zeros(2)), []
    for link in range(2):
        event = Event("turns", lambda state, link=link: state.link_rates[link])
        turn = simulate(load("chain-2"), 2.0, start=start, events=[event], tolerance=1e-12).happenings[0].state
        level = np.degrees(turn.links[link] - 1e-4 * np.sign(turn.links[link]))
        for engine in ("numpy", "numba"):
            passed = run(engine, [start], 2.0, f"theta[1,{link + 1}]={float(level)!r}", load("chain-2"))
            at.append(passed.column("crossing_time_s"))
        assert len(at[-1]) >= 2
        np.testing.assert_allclose(at[-1], at[-2], atol=1e-6)


@pytest.mark.parametrize("engine", ["numpy", "simulate"])
def test_a_cart_passes_and_returns(engine: str) -> None:
    """x = −m l sin θ/(M + m) from rest: it goes there and back about θ = ±90° within each swing."""
    scene = ONE.replace(support=Cart(mass=3.0))
    start = [State(np.array([1.7]), np.zeros(1))]
    most = 0.25 * (np.sin(1.7) - 1.0)
    passed = run(engine, start, 1.2, f"x={float(most) + 1e-5!r}", scene)
    dense = simulate(scene, 1.2, start=start[0], output=60_001)
    below = dense.motion.cart < most + 1e-5
    np.testing.assert_allclose(passed.column("crossing_time_s"), dense.times[1:][np.diff(below)], atol=5e-5)
    assert len(passed.column("crossing_time_s")) >= 2


def test_every_motion_of_a_section_begins_with_its_start() -> None:
    section = find_section(load("chain-2"), 1.0, energy=12.0, members=4, workers=1, check=0, engine="numpy")
    times, motions = section.ensemble.column("crossing_time_s"), section.orbit
    assert [times[motions == k].min() for k in range(4)] == [0.0] * 4


def test_an_event_there_and_back_between_two_looks_is_seen() -> None:
    """By `simulate` with a single look a step, and in neither where the level is just beyond the turning point."""
    for beyond, count in ((-1e-4, 2), (1e-4, 0)):
        event = Event("there", lambda state, at=AMPLITUDE + beyond: state.links[0] - at, looks=1)
        run = simulate(ONE, 1.3 * PERIOD, start=state(AMPLITUDE), events=[event], method="DOP853")
        assert len([happening for happening in run.happenings if happening.time > 0.5 * PERIOD]) == count
