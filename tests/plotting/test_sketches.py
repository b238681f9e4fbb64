"""Sketches of scenes: every symbol in its place, what is drawn where the scene says, and what does not fit."""

from __future__ import annotations

import itertools
from collections import Counter

import numpy as np
import pytest
from matplotlib.figure import Figure
from seen import flaws

import modal
from modal import Bob, Body, Cart, ComputationError, Pendulum, Rod, Scene
from modal.plotting import sketch_figure
from modal.plotting.sketches import INCHES
from modal.plotting.style import theme
from modal.scene import Moved, SineMotion

BOB, HEAVY = Bob(mass=1.0, length=1.0), Bob(mass=3.0, length=1.0)
SCENES = {
    "a bob": Scene(gravity=9.81, pendulum=[Pendulum(links=[BOB])]),
    "a double pendulum": Scene(gravity=9.81, pendulum=[Pendulum(links=[BOB, HEAVY])]),
    "four bobs": Scene(gravity=9.81, pendulum=[Pendulum(links=[BOB.replace(count=2), HEAVY.replace(count=2)])]),
    "two rods": Scene(gravity=9.81, pendulum=[Pendulum(links=[Rod(mass=1.0, length=1.0), Rod(mass=2.0, length=1.2)])]),
    "a body": Scene(
        gravity=9.81, pendulum=[Pendulum(links=[Body(mass=1.0, length=1.0, centre=0.3, inertia=0.1), BOB])]
    ),
    "three arms": Scene(
        gravity=9.81,
        pendulum=[
            Pendulum(
                links=[
                    Body(mass=0.26, centre=0.160, length=0.173, inertia=1e-4),
                    Body(mass=0.28, centre=0.203, length=0.229, inertia=3e-4),
                    Body(mass=0.12, centre=0.184, length=0.3, inertia=2e-4),
                ]
            )
        ],
    ),
    "uneven bodies": Scene(
        gravity=9.81,
        pendulum=[
            Pendulum(
                links=[
                    Body(mass=1.0, length=1.0, centre=0.6, inertia=0.1),
                    Body(mass=2.0, length=1.2, centre=0.5, inertia=0.1),
                ]
            )
        ],
    ),
    "three on a cart": Scene(
        gravity=9.81, support=Cart(mass=1.0), pendulum=[Pendulum(links=[BOB], count=2), Pendulum(links=[HEAVY])]
    ),
    "a shaken support": Scene(
        gravity=9.81,
        support=Moved(motion=SineMotion(direction="horizontal", amplitude=0.1, frequency_hz=1.0)),
        pendulum=[Pendulum(links=[BOB])],
    ),
    "in space": Scene(gravity=9.81, space="space", pendulum=[Pendulum(links=[BOB])]),
    **{name: modal.load(name) for name in ("paper-cart-1", "paper-cart-2", "crane-hook", "huygens", "metronomes")},
}


def symbols(figure: Figure) -> list[str]:
    return [text.get_text().strip("$").replace(" ", "") for text in figure.axes[0].texts if text.get_text()]


@pytest.mark.parametrize(("scene", "name"), [*zip(SCENES.values(), itertools.cycle(["light", "dark"]))], ids=SCENES)
def test_no_symbol_is_upon_another_or_leaves_the_sketch(scene: Scene, name: str) -> None:
    push = "F" if isinstance(scene.support, Cart) else ""
    with theme(name):
        assert flaws(sketch_figure(scene, push=push)) == []


def crossed(figure: Figure) -> list[str]:
    """The symbols through which a line goes."""
    (axis,) = figure.axes
    figure.draw_without_rendering()
    words = []
    for line in axis.lines:
        ends = axis.transData.transform(np.array(line.get_xydata()))
        points = np.concatenate([np.linspace(begin, end, 200) for begin, end in itertools.pairwise(ends)] or [ends])
        for text in axis.texts:
            box = text.get_window_extent().shrunk(0.8, 0.7)
            if text.get_text() != "$m_c$" and np.any(np.all((points > box.min) & (points < box.max), axis=1)):
                words.append(text.get_text())
    return words


@pytest.mark.parametrize("scene", SCENES.values(), ids=SCENES)
def test_no_line_goes_through_a_symbol(scene: Scene) -> None:
    assert crossed(sketch_figure(scene)) == []


def test_a_line_through_a_symbol_would_be_seen() -> None:
    figure = sketch_figure(SCENES["a bob"])
    figure.axes[0].plot([-1, 2], [0.0, 0.0])
    assert "$g$" in crossed(figure)


@pytest.mark.parametrize("tilt", [-55.0, -20.0, 12.0, 60.0])
def test_symbols_keep_apart_at_other_angles(tilt: float) -> None:
    with theme("light"):
        assert flaws(sketch_figure(SCENES["a double pendulum"], [tilt, tilt])) == []


def test_every_coordinate_length_mass_and_force_has_its_symbol() -> None:
    counts = Counter(symbols(sketch_figure(SCENES["three on a cart"], push="F")))
    assert counts.keys() == {"g", "m_c", "x", "F", *(f"\\theta_{{{k}}}" for k in (1, 2, 3)), "l"} | {
        f"m_{{{k}}}g" for k in (1, 2, 3)
    }
    assert counts["l"] == 3
    double = symbols(sketch_figure(modal.load("paper-cart-2")))
    assert {r"\theta_{1,1}", r"\theta_{2,2}", "l", "c", "mg"} <= set(double)
    assert "s" in symbols(sketch_figure(SCENES["a shaken support"]))
    assert {"x", "y", "z", r"\theta", r"\varphi", "l", "mg"} == set(symbols(sketch_figure(SCENES["in space"])))


def test_a_link_leans_by_its_angle() -> None:
    axis = sketch_figure(SCENES["a double pendulum"], [30.0, -40.0]).axes[0]
    drawn = [np.array(line.get_xydata()) for line in axis.lines if line.get_zorder() == 3]
    angles = [np.degrees(np.arctan2(end[0] - start[0], start[1] - end[1])) for start, end in drawn]
    np.testing.assert_allclose(angles, [30, -40], atol=1e-12)
    assert np.allclose(drawn[0][1], drawn[1][0])


def test_angles_are_as_long_as_they_look() -> None:
    """One unit is INCHES inches along both axes, so that angles are not distorted."""
    figure = sketch_figure(SCENES["a body"])
    width, height = figure.get_size_inches()
    (left, right), (bottom, top) = figure.axes[0].get_xlim(), figure.axes[0].get_ylim()
    np.testing.assert_allclose([width / (right - left), height / (top - bottom)], INCHES)


def refused(words: str, scene: Scene, *angles: float, push: str = "") -> None:
    with pytest.raises(ComputationError, match=words):
        sketch_figure(scene, angles or None, push=push)


def test_what_has_no_room_is_refused() -> None:
    many = Scene(gravity=9.81, pendulum=[Pendulum(links=[BOB], count=4)])
    refused("room for 3 pendula of 4 links, not for 4 pendula of up to 1 links", many)
    refused("up to 5 links", Scene(gravity=9.81, pendulum=[Pendulum(links=[BOB.replace(count=5)])]))
    refused("2 angles for 1 links", SCENES["a bob"], 10.0, 20.0)
    refused("push needs a cart", SCENES["a bob"], push="F")
    refused("one link only", modal.load("chain-spatial"))
    upright = Bob(mass=1.0, length=1.0, stiffness=20.0)
    refused("upright", Scene(gravity=9.81, pendulum=[Pendulum(links=[upright], equilibrium=["up"])]))
