"""Motion at the ends of what can be written: against many digits, elliptic functions, and itself in other units."""

import math
import re

import digits
import elliptic
import families
import numpy as np
import pytest
import rival
import simulation as extremes
import units
from amounts import usually
from families import at_rest, bob, hung

from modal import Cart
from nonlinear import simulate

FAST = ("carts", "gravities", "lengths", "pendula")
ALLOWED = 2e-8  # relative error at the default tolerance of 1e-9


@pytest.mark.parametrize("degrees", [1e-9, 30.0, 179.0])
def test_the_digits_are_the_elliptic_functions(degrees):
    angle, times = float(np.deg2rad(degrees)), [0.4, 1.0]
    angles = digits.motion(hung(bob()), at_rest([angle]), times)[:, 0]
    assert angles == pytest.approx(elliptic.angles(angle, 9.81, times), rel=1e-15, abs=0)


def test_the_digits_are_those_of_two_routes():
    scene, start = hung(bob(), bob(mass=1e-6, length=0.1), cart=Cart(mass=0.3)), at_rest([0.7, -0.4])
    right = digits.motion(scene, start, [0.5])[0]
    for form in ("minimal", "hamiltonian", "maximal"):
        run = simulate(scene, 0.5, start=start, output=[0.5], form=form, method="DOP853", tolerance=1e-13)
        assert run.final.links == pytest.approx(right, abs=1e-11)


@pytest.mark.parametrize("family", FAST)
def test_the_default_holds_to_the_ends(family):
    for example in getattr(families, family)(quick=True):
        if example.family.startswith("massless"):
            continue
        run, said, _ = extremes.ours(example)
        assert said == "ran"
        assert extremes._error(run.motion.links[1:], example.reference()) < ALLOWED, (example.family, example.parameter)
        assert run.energy_drift() < ALLOWED


@pytest.mark.parametrize("ratio", usually([1e-16], [1e-16, 1e-8, 1.0, 1e4]))
def test_light_links_below_heavy_ones(ratio):
    example = next(each for each in families.masses(quick=False) if each.parameter == pytest.approx(ratio))
    run, _, _ = extremes.ours(example)
    assert extremes._error(run.motion.links[1:], example.reference()) < ALLOWED


@pytest.mark.parametrize("degrees", [1e-12, 1e-6, 1.0])
def test_noted_keep_their_digits_and_the_textbook_does_not(degrees):
    example = next(each for each in families.amplitudes(quick=False) if each.parameter == degrees)
    run, _, _ = extremes.ours(example)
    right = example.reference()
    assert extremes._error(run.motion.links[1:], right) < 5e-9
    textbook = rival.run(example.scene, example.start, example.times, patience=math.inf, **extremes.FINE)
    assert extremes._error(textbook.angles, right) > 1e-7


@pytest.mark.parametrize("damping", [1e6, 1e9, 1e12])
def test_syrup_creeps(damping):
    example = next(each for each in families.dampers(quick=False) if each.parameter == damping)
    run, said, _ = extremes.ours(example)
    assert (run.run.method, said) == ("Radau", "ran")
    assert extremes._error(run.motion.links[1:], example.reference()) < 1e-9


def test_a_stiff_damper_makes_two_links_one():
    example = next(each for each in families.dampers(quick=True) if "joint" in each.family)
    run, _, _ = extremes.ours(example)
    assert extremes._error(run.motion.links[1:], example.reference()) < 1e-7


def test_a_massless_cart_of_a_bob_says_where_it_stops():
    example = next(each for each in families.carts(quick=True) if each.family == "massless cart of a bob")
    run, said, _ = extremes.ours(example)
    assert re.match(r"SimulationError: \w+ stopped at 0\.157", said)
    assert "give it a mass" in said
    assert not run.complete


@pytest.mark.parametrize("form", ["minimal", "hamiltonian", *usually([], ["maximal"])])
@pytest.mark.parametrize("factors", ["masses by 2^40", "the same second"])
def test_powers_of_two_change_no_step_and_no_bit(factors, form):
    comparison = units.compared(factors, form, "DOP853")
    assert comparison.steps[0] == comparison.steps[1]
    pivots_elsewhere = (factors, form) == ("the same second", "minimal")
    assert comparison.apart < 1e-13 if pivots_elsewhere else comparison.identical


@pytest.mark.parametrize("form", usually(["minimal"], ["minimal", "hamiltonian"]))
def test_other_units_stay_within_the_tolerance(form):
    comparison = units.compared("g, mm, ms", form, "DOP853")
    assert 0 < comparison.apart < 2e-8


def test_a_cart_far_away_changes_nothing_for_scipy():
    scene = hung(bob(), cart=Cart(mass=1.0))
    near, far = (
        simulate(scene, 2.0, start=type(at_rest([1.0]))(np.array([1.0]), np.zeros(1), x), output=9, method="DOP853")
        for x in (0.0, 1e8)
    )
    assert near.motion.links == pytest.approx(far.motion.links, abs=1e-8)


def test_an_error_that_is_there_is_seen():
    example = next(iter(families.gravities(quick=True)))
    loose = example._replace(options={"tolerance": 1e-3, "method": "RK23"})
    assert extremes._error(extremes.ours(loose)[0].motion.links[1:], example.reference()) > 1e-4
