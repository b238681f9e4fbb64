"""Frequencies to 1e-14 and shapes to 1e-10 against the many-digit dense oracle, on thousands of seeded scenes."""

import pytest
from compare import assert_certified, assert_shapes
from hypothesis import given, settings
from hypothesis import strategies as st
from random_scenes import random_scene

from modal import Bob, Body, Cart, ComputationError, Fixed, Pendulum, Rod, Scene, natural_modes

SCENES, CHUNK = 2400, 50


@pytest.mark.parametrize("first", range(0, SCENES, CHUNK))
def test_every_frequency_and_shape(first: int) -> None:
    shapes = 0
    for seed in range(first, first + CHUNK):
        modes = natural_modes(random_scene(seed, copies=seed % 4 == 0))
        assert modes.omega.min() >= 0
        exact = assert_certified(modes, 1e-14)
        assert_certified(modes, max(1e-16, float(modes.error.max())))
        shapes += assert_shapes(modes, exact)
    assert shapes >= CHUNK


SIZES = st.floats(1e-12, 1e12)


@st.composite
def links(draw: st.DrawFn) -> Bob | Rod | Body:
    mass, length = draw(SIZES), draw(SIZES)
    kind = draw(st.sampled_from([Bob, Rod, Body]))
    if kind is not Body:
        return kind(mass=mass, length=length)
    centre = draw(st.floats(1e-3, 3.0)) * length
    return Body(
        mass=mass, length=length, centre=centre, inertia=draw(st.sampled_from([0.0, 1e-6, 0.1])) * mass * length**2
    )


@st.composite
def scenes(draw: st.DrawFn) -> Scene:
    cart = st.builds(Cart, mass=st.just(0.0) | SIZES, stiffness=st.just(0.0) | SIZES)
    pendulum = st.builds(Pendulum, links=st.lists(links(), min_size=1, max_size=3).map(tuple), count=st.integers(1, 2))
    return Scene(
        gravity=draw(st.floats(1e-6, 1e6)),
        support=draw(st.just(Fixed()) | cart),
        pendulum=tuple(draw(st.lists(pendulum, min_size=1, max_size=3))),
    )


@settings(max_examples=150, deadline=None, derandomize=True)
@given(scenes())
def test_corners(scene: Scene) -> None:
    try:
        modes = natural_modes(scene)
    except ComputationError:
        return
    assert_certified(modes, 1e-14)


@pytest.mark.parametrize("n", [40, 60])
def test_long_chains_of_any_links(n: int) -> None:
    kinds = [Bob(mass=1.0, length=0.7), Rod(mass=2.5, length=1.1), Body(mass=0.3, length=0.9, centre=1.2, inertia=0.02)]
    scene = Scene(gravity=9.81, support=Cart(mass=3.0), pendulum=(Pendulum(links=tuple(kinds * (n // 3))),))
    assert_certified(natural_modes(scene), 1e-14)
