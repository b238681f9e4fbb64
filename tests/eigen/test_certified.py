"""Frequencies to 1e-14 and shapes to 1e-10 against the many-digit dense oracle, on hundreds of seeded scenes."""

import pytest
from amounts import usually
from compare import assert_certified, assert_shapes
from hypothesis import given, settings
from hypothesis import strategies as st
from scenes import extreme_scene

from modal import Bob, Body, Cart, ComputationError, Fixed, Pendulum, Rod, Scene, natural_modes

SCENES, CHUNK = 2400, usually(25, 50)
FIRST = range(0, SCENES, usually(600, CHUNK))


@pytest.mark.parametrize("first", FIRST)
def test_every_frequency_and_shape(first: int) -> None:
    shapes = 0
    for seed in range(first, first + CHUNK):
        modes = natural_modes(extreme_scene(seed, copies=seed % 4 == 0))
        assert modes.omega.min() >= 0
        exact = assert_certified(modes, min(1e-14, max(1e-16, float(modes.error.max()))))
        shapes += assert_shapes(modes, exact)
    assert shapes >= CHUNK


def test_the_sample_holds_every_kind() -> None:
    scenes = [extreme_scene(seed, copies=seed % 4 == 0) for first in FIRST for seed in range(first, first + CHUNK)]
    supports = {(s.support.mass > 0, s.support.stiffness > 0) for s in scenes if isinstance(s.support, Cart)}
    assert supports == {(heavy, sprung) for heavy in (False, True) for sprung in (False, True)}
    assert {len(s.pendulum) for s in scenes if isinstance(s.support, Fixed)} == {1, 2, 3, 4}
    assert {p.count for s in scenes for p in s.pendulum} == {1, 2, 3}
    links = [link for s in scenes for p in s.pendulum for link in p.links]
    assert {link.kind for link in links} == {"bob", "rod", "body"}
    bodies = [link for link in links if isinstance(link, Body)]
    assert {(b.centre > b.length, b.inertia > 0) for b in bodies} == {
        (x, y) for x in (False, True) for y in (False, True)
    }
    assert max(link.mass for link in links) / min(link.mass for link in links) > 1e15


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


@settings(max_examples=60, deadline=None, derandomize=True)
@given(scenes())
def test_corners(scene: Scene) -> None:
    try:
        modes = natural_modes(scene)
    except ComputationError:
        return
    assert_certified(modes, 1e-14)


@pytest.mark.parametrize("n", usually([39], [39, 60]))
def test_long_chains_of_any_links(n: int) -> None:
    kinds = [Bob(mass=1.0, length=0.7), Rod(mass=2.5, length=1.1), Body(mass=0.3, length=0.9, centre=1.2, inertia=0.02)]
    scene = Scene(gravity=9.81, support=Cart(mass=3.0), pendulum=(Pendulum(links=tuple(kinds * (n // 3))),))
    assert_certified(natural_modes(scene), 1e-14)
