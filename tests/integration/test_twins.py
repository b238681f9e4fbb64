"""Twins: what a symmetric run cannot show is shown by one with a perturbed start."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from modal import Bob, Cart, Pendulum, Rod, Scene, load
from multipendula.cli import main
from nonlinear import AppliedForces, SimulationError, State, simulate, state_at_rest, system_of
from nonlinear.accuracy import advice_table
from nonlinear.dynamics import exactly_symmetric, is_unstable_equilibrium
from nonlinear.integration import Request, aside, departure, perturb_last_digits
from nonlinear.integration.run import DEPARTURE_DISTANCE, TWIN_DISTANCE
from nonlinear.postprocessing.summary import text
from nonlinear.simulation import advise, certain
from nonlinear.system import apart, of_plane

ROD = Rod(mass=1.0, length=1.0)
PAIR = Scene(gravity=9.81, support=Cart(mass=1.0), pendulum=[Pendulum(links=[ROD, ROD], count=2)])
LEVEL = state_at_rest(PAIR, [90.0, 90.0])
ONE = load("chain-1")


def moved(start: State, link: int, by: float) -> State:
    links = start.links.copy()
    links[link] += by
    return replace(start, links=links)


def test_a_promise_ends_where_the_last_digits_of_the_start_decide() -> None:
    """Two runs that integrate one of the two rods agree to 4e-5 rad over 12 s; rods that differ by 1e-15 part."""
    advice = advise(PAIR, 12.0, 1e-3, start=LEVEL)
    assert not advice.is_met
    assert advice.has_parted
    assert 8.0 < advice.horizon < 12.0
    assert "since starts that differ only in their last digits diverge" in advice_table(advice, "text")
    start = moved(LEVEL, 3, -2e-15)
    beside = simulate(PAIR, 12.0, start=start, tolerance=1e-12, output=advice.trajectory.times)
    gone = apart(beside.motion, advice.trajectory.motion)
    assert gone[advice.trajectory.times <= advice.horizon - 1.0].max() < 1e-3
    assert gone[-1] > 1e-3
    with pytest.raises(SimulationError, match="no further: beyond it double precision cannot determine"):
        certain(advice)


def test_where_nothing_grows_the_twin_costs_one_more_run() -> None:
    calm = advise(PAIR, 3.0, 1e-4, start=state_at_rest(PAIR, [10.0, -5.0]), method="DOP853")
    assert calm.is_met
    assert not calm.has_parted
    free = advise(PAIR, 3.0, 1e-4, start=state_at_rest(PAIR, [10.0, -5.0, 10.0, -5.001]), method="DOP853")
    spent, usual = (sum(attempt.calls for attempt in advice.attempts) for advice in (calm, free))
    assert usual < spent < 3 * usual


def test_loads_do_not_hide_a_symmetry() -> None:
    """Nothing is omitted then, and equal pendula still move alike to rounding."""
    asked = Request(PAIR, system_of(PAIR), LEVEL, np.linspace(0.0, 1.0, 11), load=lambda time, state: AppliedForces())
    twin = perturb_last_digits(asked)
    assert twin is not None
    whole, beside = (request.run(request.choice(1e-9)).motion.links for request in (asked, twin))
    assert np.abs(whole[:, :2] - whole[:, 2:]).max() < 1e-12
    assert 0 < np.abs(beside - whole).max() < 1e-8
    assert np.abs(beside[0] - whole[0]).max() < 1e-14
    assert perturb_last_digits(replace(asked, start=state_at_rest(PAIR, [90.0, 90.0, 80.0, 70.0]))) is None


@pytest.mark.parametrize(
    ("angles", "expected"),
    [
        ([90.0, 90.0, 90.0, 90.0], True),
        ([90.0, 90.0, -90.0, -90.0], True),
        ([90.0, 90.0, 270.0, -90.0], True),
        ([180.0, 180.0, 0.0, 0.0], True),
        ([90.0, 90.0, -90.0, -89.0], False),
        ([90.0, 40.0, 40.0, 90.0], False),
        ([180.0, 1.0, 0.0, 0.0], False),
    ],
)
def test_starts_with_a_symmetry_are_told(angles: list[float], expected: bool) -> None:
    start = state_at_rest(PAIR, angles)
    assert exactly_symmetric(system_of(PAIR), start) is expected
    held = PAIR.replace(support=Cart(mass=1.0, stiffness=1.0))
    assert exactly_symmetric(system_of(held), replace(start, cart=0.1)) is (expected and angles[:2] == angles[2:])
    spatial = PAIR.replace(space="space")
    assert exactly_symmetric(system_of(spatial), of_plane(start))
    turned = of_plane(start).links @ np.array([[0.6, 0.8, 0.0], [-0.8, 0.6, 0.0], [0.0, 0.0, 1.0]])
    assert exactly_symmetric(system_of(spatial), State(turned, 0 * turned)) is (
        angles[:2] == angles[2:] or angles[0] == 180.0
    )


def test_only_the_first_of_equal_pendula_is_put_aside() -> None:
    many = Scene(gravity=9.81, support=Cart(mass=9.0), pendulum=[Pendulum(links=[ROD, ROD], count=50)])
    start = state_at_rest(many, [40.0, 10.0])
    shift = aside(system_of(many), start, 1e-6).links - start.links
    assert np.all((shift[:2] > 4e-7) & (shift[:2] < 1.1e-6))
    assert not shift[2:].any()
    assert aside(system_of(PAIR), state_at_rest(PAIR, [40.0, 10.0, 5.0, 0.0]), 1e-6).links[3] > 4e-7


def test_the_growth_is_that_of_a_finer_run() -> None:
    scene, start = PAIR, LEVEL
    run = simulate(scene, 8.0, start=start, output=21)
    growth = departure(run)
    assert growth is not None
    begun = aside(system_of(scene), start, TWIN_DISTANCE)
    beside = simulate(scene, growth.seconds, start=begun, tolerance=1e-12, output=400)
    links = beside.motion.links.reshape(400, 2, 2)
    gone = np.abs(links[:, 0] - links[:, 1]).max(axis=1)
    assert growth.factor == pytest.approx(gone.max() / gone[0], rel=0.1)
    assert growth.factor * gone[0] == pytest.approx(DEPARTURE_DISTANCE, rel=0.01)
    assert growth.words in text(run)


def test_noted_hardly_grow_and_whole_scenes_have_nothing_to_tell() -> None:
    calm = departure(simulate(PAIR, 5.0, start=state_at_rest(PAIR, [2.0, 2.0])))
    assert calm is not None
    assert calm.seconds == 5.0
    assert calm.factor < 5.0
    assert departure(simulate(PAIR, 1.0, start=state_at_rest(PAIR, [90.0, 90.0, -90.0, 80.0]))) is None
    far = replace(state_at_rest(ONE, [30.0]), links=np.array([100.0]))
    alone = simulate(ONE, 1.0, start=far)
    assert alone.run.reduced
    assert departure(alone) is None


def test_what_leaves_the_plane_of_the_rail_is_told() -> None:
    spatial = Scene(gravity=9.81, space="space", pendulum=[Pendulum(links=[ROD, ROD])])
    run = simulate(spatial, 2.0, start=state_at_rest(spatial, [150.0, 150.0]), output=11)
    growth = departure(run)
    assert growth is not None
    assert run.run.reduced == "one vertical plane of space"
    assert growth.factor > 1.0


def test_a_stiff_twin_is_followed_for_a_while_only(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("nonlinear.integration.run.TWIN_STEPS_MAX", 20)
    growth = departure(simulate(PAIR, 12.0, start=LEVEL))
    assert growth is not None
    assert 0.0 < growth.seconds < 3.0


TWO = Scene(gravity=9.81, pendulum=[Pendulum(links=[Bob(mass=1.0, length=1.0)], count=2)])
HELD = Scene(
    gravity=9.81,
    pendulum=[Pendulum(links=[Bob(mass=1.0, length=1.0, stiffness=9.9)], equilibrium=["up"])],
)
SOFT_LINK = Bob(mass=1.0, length=1.0, stiffness=9.7)
SOFT = HELD.replace(pendulum=(Pendulum(links=[SOFT_LINK], equilibrium=["up"]),))


@pytest.mark.parametrize(
    ("scene", "angles", "expected"),
    [
        (ONE, [180.0], True),
        (ONE, [540.0], True),
        (ONE, [179.999], False),
        (ONE, [0.0], False),
        (TWO, [30.0, 180.0], True),
        (TWO.replace(support=Cart(mass=1.0)), [30.0, 180.0], False),
        (TWO.replace(support=Cart(mass=1.0)), [0.0, 180.0], True),
        (HELD, [180.0], False),
        (SOFT, [180.0], True),
        (PAIR, [0.0, 180.0, 0.0, 0.0], True),
    ],
)
def test_unstable_equilibria_are_reported(scene: Scene, angles: list[float], expected: bool) -> None:
    start = state_at_rest(scene, angles)
    system = system_of(scene)
    assert is_unstable_equilibrium(system, start) is expected
    assert not is_unstable_equilibrium(system, replace(start, link_rates=start.link_rates + 1e-9))
    run = simulate(scene, 0.1, start=start, output=3)
    assert ("an unstable equilibrium: the motion is due to rounding" in text(run)) is expected
    if not any(link.stiffness for link in scene.links()):
        spatial = scene.replace(space="space")
        assert is_unstable_equilibrium(system_of(spatial), of_plane(start)) is expected


def test_no_accuracy_is_promised_for_leaving_an_unstable_equilibrium() -> None:
    advice = advise(ONE, 11.0, 1e-2, start=state_at_rest(ONE, [180.0]), method="DOP853")
    assert not advice.is_met
    assert 5.0 < advice.horizon < 11.0


def test_the_command_tells_both(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["simulate", "paper-cart-2", "--start", "angles:90,90", "--duration", "3"]) == 0
    told = capsys.readouterr().out
    assert "integrated  1 of 2 pendula" in told
    assert "symmetry    a small perturbation of it would grow" in told
    assert main(["simulate", "chain-1", "--start", "angles:180", "--duration", "1"]) == 0
    assert "start       an unstable equilibrium: the motion is due to rounding" in capsys.readouterr().out


@pytest.mark.parametrize("method", ["taylor", "DOP853"])
def test_a_swing_too_fast_to_follow_says_what_to_do(method: str) -> None:
    if method == "taylor":
        pytest.importorskip("heyoka")
    links = [Bob(mass=1.0, length=1.0), Bob(mass=1e24, length=1.0)]
    scene = Scene(gravity=9.81, pendulum=[Pendulum(links=links)])
    with pytest.raises(SimulationError, match=r"stopped at .* remove parts that are so light") as caught:
        simulate(scene, 20.0, start=state_at_rest(scene, [30.0, 20.0]), method=method, output=3)
    assert "err_" not in str(caught.value)
