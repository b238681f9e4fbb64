"""Free-body diagrams: every letter twice with opposite arrows, none upon another, and what is drawn of large scenes."""

from __future__ import annotations

import re

import pytest
from amounts import usually
from matplotlib import colors
from seen import flaws

from modal import Bob, Body, Cart, Pendulum, Rod, Scene, SceneError, load
from modal.plotting import free_body_tikz, plot_free_body
from modal.plotting.free_body import MOST_PARTS, diagrams, in_latex
from modal.plotting.style import theme
from modal.scene import VanDerPol, free_bodies, scene_from

FULL = Scene(
    gravity=9.81,
    support=Cart(mass=5.0, stiffness=3.0),
    pendulum=[
        Pendulum(
            links=[
                Body(mass=1.0, length=1.0, centre=0.4, inertia=0.1, stiffness=2.0, drag=0.1),
                Bob(mass=1.0, length=1.0, damping=0.2, quadratic_drag=0.2),
                Rod(mass=1.0, length=1.0, friction=0.1),
            ]
        ),
        Pendulum(links=[Rod(mass=1.0, length=1.0, drive=VanDerPol(strength=0.1, angle_deg=20.0))]),
    ],
)
PUSHED = scene_from(
    {
        "gravity": 9.81,
        "support": {"kind": "cart", "mass": 2.0},
        "pendulum": [
            {
                "links": [
                    {"kind": "rod", "mass": 1.0, "length": 1.0, "drag": 0.1, "damping": 0.1},
                    {"kind": "bob", "mass": 1.0, "length": 1.0},
                ]
            }
        ],
        "force": [
            {"on": "cart", "kind": "constant", "amplitude": 1.0},
            {"on": "pendulum[0].links[0]@0.3", "kind": "constant", "amplitude": 1.0},
            {"on": "pendulum[0].links[1]", "kind": "constant", "direction": "vertical", "amplitude": 1.0},
            {"on": "pendulum[0].links[1]", "kind": "constant", "direction": "torque", "amplitude": 1.0},
        ],
    }
)
SCENES = {
    "full": FULL,
    "pushed": PUSHED,
    **{name: load(name) for name in ("paper-cart-2", "chain-3", "huygens", "crane-hook")},
}


@pytest.mark.parametrize("name", usually(["full", "chain-3"], [*SCENES]))
def test_no_letter_is_upon_another_or_leaves_the_picture(name: str) -> None:
    letters = "paper" if name.startswith("paper") else "own"
    with theme("dark" if name == "chain-3" else "light"):
        assert flaws(plot_free_body(SCENES[name], letters=letters)) == []


def test_every_effort_is_drawn_with_its_letter_on_every_part() -> None:
    bodies = free_bodies(FULL)
    shown, _ = diagrams(bodies, "1:5")
    for part, diagram in zip(bodies.parts, shown, strict=True):
        texts = [words.text for words in diagram.words]
        for effort in part.efforts:
            for name in filter(None, (effort.along, effort.down, effort.turning)):
                if effort.kind not in {"drag", "normal"}:
                    assert f"${in_latex(name)}$" in texts
        assert any("ddot" in text for text in texts)
        drags = [text for text in texts if text.startswith("$D")]
        assert len(drags) == any(effort.kind == "drag" for effort in part.efforts)


def test_action_and_reaction_point_in_opposite_directions() -> None:
    """The arrows of one letter on two parts are opposite, from its strokes."""
    shown, _ = diagrams(free_bodies(load("paper-cart-1"), "paper"), "1:3")
    ways: dict[str, list[tuple[int, int]]] = {}
    for diagram in shown:
        arrows = [stroke for stroke in diagram.strokes if stroke.kind == "arrow" and stroke.look == "joint"]
        words = [label for label in diagram.words if label.look == "joint"]
        for arrow, label in zip(arrows, words, strict=True):
            (x0, y0), (x1, y1) = arrow.points
            ways.setdefault(label.text, []).append((round(x1 - x0, 6), round(y1 - y0, 6)))
    assert len(ways) == 4
    for first, second in ways.values():
        assert first[0] == -second[0]
        assert first[1] == -second[1]


def test_large_scenes_are_drawn_in_part_unless_asked() -> None:
    figure = plot_free_body(load("rope"))
    assert len(figure.axes) == MOST_PARTS
    assert "12 of 1001 parts are drawn" in figure.get_supxlabel()
    assert len(plot_free_body(load("rope"), parts="7:8").axes) == 2
    with pytest.raises(SceneError, match="the scene has parts 1 to 3"):
        plot_free_body(load("chain-2"), parts="2:9")
    with pytest.raises(SceneError, match="a number or a range"):
        plot_free_body(load("chain-2"), parts="all")
    with pytest.raises(SceneError, match="one picture has room for 120"):
        plot_free_body(load("rope"), parts="1:500")


def test_tikz_has_the_same_letters_and_balanced_braces() -> None:
    scene = load("paper-cart-2")
    text = free_body_tikz(scene, "paper")
    with theme("light"):
        figure = plot_free_body(scene, letters="paper")
    theirs = sorted(text.get_text() for axis in figure.axes for text in axis.texts)
    assert sorted(re.findall(r"text=fb\w+\] at \([^)]*\) \{(.*)\};", text)) == theirs
    assert text.count("{") == text.count("}")
    assert text.count(r"\begin{scope}") == text.count(r"\end{scope}") == len(figure.axes)
    assert all(colors.is_color_like(f"#{hue}") for hue in re.findall(r"\{HTML\}\{(\w{6})\}", text))
