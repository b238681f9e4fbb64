"""Where bobs' links push: against quadratures by mpmath, and against multipliers of maximal coordinates."""

from __future__ import annotations

import json
from math import cos, radians

import mpmath
import numpy as np
import pytest

from modal import Bob, Cart, Pendulum, Rod, Scene, load
from modal.errors import ComputationError
from modal.scene import Fixed
from nonlinear import simulate, state_at_rest
from nonlinear.integration import Choice, equations_of
from nonlinear.postprocessing import pushing_links, reaction_forces_of, slack_words
from nonlinear.postprocessing.reaction_forces import _one_by_one, states_and_slopes
from nonlinear.postprocessing.summary import text
from nonlinear.verification import check, check_table, compare, comparison_table

G, MASS, LENGTH = 9.81, 2.0, 0.7


def bob(cart: float | None = None, space: str = "plane") -> Scene:
    support = Fixed() if cart is None else Cart(mass=cart)
    return Scene(gravity=G, support=support, space=space, pendulum=[Pendulum(links=[Bob(mass=MASS, length=LENGTH)])])


def slack_until(degrees: float, cart: float | None) -> mpmath.mpf:
    """When S = 0 after a release at rest: there m g cos θ + m l θ'² = 0, as the cart is not accelerated.

    With the share s = m/(m + M) of the bob, energy and momentum give θ'² = 2 g (cos θ − cos θ₀)/(l (1 − s cos² θ)).
    """
    share = 0 if cart is None else mpmath.mpf(MASS) / (MASS + cart)
    start = mpmath.radians(degrees)

    def square(fallen: mpmath.mpf) -> mpmath.mpf:
        turned = 2 * mpmath.sin(start - fallen / 2) * mpmath.sin(fallen / 2)  # cos θ − cos θ₀
        return 2 * G * turned / (LENGTH * (1 - share * mpmath.cos(start - fallen) ** 2))

    tight = mpmath.findroot(
        lambda fallen: G * mpmath.cos(start - fallen) + LENGTH * square(fallen), (0.1, 0.4), solver="anderson"
    )
    return mpmath.quad(lambda p: 2 * p / mpmath.sqrt(square(p**2)), [0, mpmath.sqrt(tight)])  # θ = θ₀ − p²


@pytest.mark.parametrize("cart", [None, 3.0])
def test_a_bob_pushes_until_its_rope_would_be_tight(cart: float | None) -> None:
    scene = bob(cart)
    run = simulate(scene, 4.0, start=state_at_rest(scene, [120.0]), tolerance=1e-12)
    (link,) = pushing_links(run)
    until = float(slack_until(120.0, cart))
    assert (link.pendulum, link.link, link.intervals[0][0]) == (1, 1, 0.0)
    assert link.intervals[0][1] == pytest.approx(until, abs=1e-8)
    middle = np.mean(link.intervals[1])  # about the turning point, as long before it as after
    assert np.array(link.intervals[1]) - middle == pytest.approx([-until, until], abs=1e-8)
    if cart is None:
        assert link.largest == pytest.approx(-MASS * G * cos(radians(120)), rel=1e-9)


def test_fewer_samples_and_space_tell_the_same() -> None:
    until = float(slack_until(120.0, None))
    for scene, samples, error in ((bob(), 81, 1e-4), (bob(space="space"), 801, 1e-4)):
        start = state_at_rest(scene, [120.0])
        (link,) = pushing_links(simulate(scene, 2.0, start=start, output=samples))
        assert link.intervals[0][1] == pytest.approx(until, abs=error)


def test_links_push_where_multipliers_do() -> None:
    """Of two bobs, by the pivot forces of maximal coordinates, at samples and at every zero."""
    scene = load("chain-2")
    run = simulate(scene, 4.0, start=state_at_rest(scene, [120.0, 100.0]), tolerance=1e-11)
    equations = equations_of(run.system, Choice("maximal", "", compiled=False, reason=""), None)
    pivots = equations.reactions(run.motion).pivots
    u = np.stack((np.sin(run.motion.links), np.cos(run.motion.links)), axis=-1)
    tensions = -np.sum(pivots * u, axis=-1)
    links = {link.link: link for link in pushing_links(run)}
    assert len(links) == 2
    for number, link in links.items():
        inside = np.any([(run.times >= since) & (run.times <= until) for since, until in link.intervals], axis=0)
        assert np.array_equal(inside, tensions[:, number - 1] < 0)
        zeros = np.unique(link.intervals)[1:]
        at = simulate(scene, 4.0, start=state_at_rest(scene, [120.0, 100.0]), tolerance=1e-11, output=zeros)
        pulls = reaction_forces_of(at).pivots[1:, number - 1]
        angles = at.motion.links[1:, number - 1]
        along = pulls[:, 0] * np.sin(angles) + pulls[:, 1] * np.cos(angles)
        assert np.abs(along[zeros < 4.0]).max() < 1e-5


def test_small_motion_rods_and_links_that_stand_do_not() -> None:
    for name, degrees in (("chain-2", 60.0), ("chain-3", 10.0)):
        scene = load(name)
        assert pushing_links(simulate(scene, 5.0, start=state_at_rest(scene, [degrees] * scene.n_links))) == ()
    rod = Scene(gravity=G, pendulum=[Pendulum(links=[Rod(mass=MASS, length=LENGTH)])])
    assert pushing_links(simulate(rod, 2.0, start=state_at_rest(rod, [150.0]))) == ()
    standing = bob().replace(pendulum=[Pendulum(links=[Bob(mass=MASS, length=LENGTH)], equilibrium=["up"])])
    assert pushing_links(simulate(standing, 2.0, start=state_at_rest(standing, [150.0]))) == ()


def test_what_cannot_be_told_is_said() -> None:
    scene = bob()
    run = simulate(scene, 20.0, start=state_at_rest(scene, [120.0]), output=11)
    with pytest.raises(ComputationError, match="too few to interpolate"):
        pushing_links(run)
    assert "whether a rope would be slack was not determined" in text(run)
    assert "ropes" not in text(run, ropes=False)


def test_reports_say_it() -> None:
    scene = bob()
    run = simulate(scene, 30.0, start=state_at_rest(scene, [120.0]))
    (words,) = slack_words(run)
    assert words.startswith("link 1 pushes from 0 to ")
    assert words.endswith("more intervals: a rope would be slack there")
    assert words in text(run)
    general = compare(run)
    assert words in comparison_table(general, "text")
    assert json.loads(comparison_table(general, "json"))["pushing"][0]["link"] == 1
    twins = scene.replace(pendulum=[scene.pendulum[0].replace(count=2)])
    pair = slack_words(simulate(twins, 1.0, start=state_at_rest(twins, [120.0, 10.0])))
    assert [sentence.startswith("link 1 of pendulum 1 pushes") for sentence in pair] == [True]


def test_a_check_says_it() -> None:
    checked = check(bob(), [0], [30.0, 120.0], periods=10)
    runs = json.loads(check_table(checked, "json"))["modes"][0]["runs"]
    assert [len(run["pushing"]) for run in runs] == [0, 1]
    assert runs[1]["pushing"][0]["intervals_s"][0] == pytest.approx([0.0, float(slack_until(120.0, None))], abs=1e-6)
    assert "mode 1 at 120°: link 1 pushes from 0 to" in check_table(checked, "text")


def test_accelerations_side_by_side_are_those_one_by_one() -> None:
    for name in ("paper-cart-2", "huygens", "two-swings", "beam"):
        run = simulate(load(name), 0.5, output=6)
        layout, _, slopes = states_and_slopes(run)
        together, apart = layout.read(slopes), _one_by_one(run, run.motion)
        for part in ("links", "link_rates", "cart_rate", "support_rates"):
            np.testing.assert_allclose(getattr(together, part), getattr(apart, part), rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize(("aside", "pushes"), [(3e-9, True), (3e-10, False)])
def test_a_push_that_is_rounding_is_none(aside: float, pushes: bool) -> None:
    """Released so far above the horizontal, a bob is pushed by this part of its weight."""
    start = state_at_rest(bob(), [90.0 + np.degrees(aside)])
    assert bool(pushing_links(simulate(bob(), 0.1, start=start))) == pushes
