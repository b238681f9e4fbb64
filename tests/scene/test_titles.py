"""What hangs in a scene without a title, in words: count, kinds, plane or space, upright, springs."""

from __future__ import annotations

import json

import pytest

from modal import Bob, Body, Cart, Fixed, Pendulum, Rod, Scene, load, natural_modes
from modal.modes.tables import table
from modal.scene import SineMotion, describe, title_of
from modal.scene.motion import Moved

BOB, ROD = Bob(mass=1.0, length=1.0), Rod(mass=1.0, length=1.0)
BODY = Body(mass=1.0, length=1.0, centre=0.5, inertia=0.1)
CART = Cart(mass=2.0)


def bobs(n: int, count: int = 1, **more: object) -> Pendulum:
    return Pendulum(links=[BOB.replace(count=n)], count=count, **more)


@pytest.mark.parametrize(
    ("support", "pendula", "words"),
    [
        (CART, [bobs(2, 2)], "Two double pendula of bobs on a cart"),
        (Fixed(), [Pendulum(links=[ROD.replace(count=5)])], "A chain of five rods on a fixed support"),
        (Fixed(), [bobs(1)], "A simple pendulum on a fixed support"),
        (Fixed(), [bobs(1, 3)], "Three simple pendula on a fixed support"),
        (CART, [Pendulum(links=[ROD])], "A rod pendulum on a cart"),
        (CART, [Pendulum(links=[BODY])], "A compound pendulum on a cart"),
        (CART, [bobs(1), bobs(1)], "Two simple pendula on a cart"),
        (CART, [bobs(3, 1000)], "1000 triple pendula of bobs on a cart"),
        (CART, [bobs(1000)], "A chain of 1000 bobs on a cart"),
        (CART, [Pendulum(links=[ROD, BOB])], "A double pendulum of one rod and one bob on a cart"),
        (CART, [bobs(2), bobs(1)], "A double pendulum of bobs and a simple pendulum on a cart"),
        (
            CART,
            [bobs(1), bobs(2), Pendulum(links=[ROD]), Pendulum(links=[BODY])],
            "Four pendula of five links in all on a cart",
        ),
        (Fixed(), [Pendulum(links=[BODY, BODY, BODY, BODY])], "A chain of four rigid bodies on a fixed support"),
        (
            Fixed(),
            [Pendulum(links=[ROD, BOB, ROD, BOB, ROD])],
            "A chain of five links on a fixed support",
        ),
        (CART, [bobs(2, equilibrium=("up", "up"))], "An inverted double pendulum of bobs on a cart"),
        (CART, [bobs(2, equilibrium=("up", "down"))], "A partly inverted double pendulum of bobs on a cart"),
        (Cart(mass=0.0), [bobs(2)], "A double pendulum of bobs on a massless cart"),
        (Cart(mass=1.0, stiffness=3.0), [bobs(2)], "A double pendulum of bobs on a cart with a spring"),
        (
            Fixed(),
            [Pendulum(links=[BOB, BOB.replace(stiffness=1.0)])],
            "A double pendulum of bobs with springs on a fixed support",
        ),
        (
            Moved(motion=SineMotion(amplitude=0.1, frequency_hz=1.0)),
            [bobs(1)],
            "A simple pendulum on a moved support",
        ),
    ],
)
def test_a_title_says_what_hangs_there(support: Fixed | Cart, pendula: list[Pendulum], words: str) -> None:
    assert title_of(Scene(gravity=9.81, support=support, pendulum=pendula)) == words


def test_figures_reports_and_pages_have_it(tmp_path: object) -> None:
    from modal.coupling import coupling_report, explain
    from modal.plotting.shapes import shapes_figure
    from multipendula.page import page, scene_data
    from nonlinear import simulate
    from nonlinear.postprocessing import summary

    scene = Scene(gravity=9.81, support=CART, pendulum=[bobs(2, 2, start={"angles_deg": [5, 0]})])
    title = title_of(scene)
    assert title == "Two double pendula of bobs on a cart"
    figure = shapes_figure(natural_modes(scene), range(1, 3))
    assert title in " ".join(figure.get_suptitle().split())
    assert coupling_report(explain(scene)).startswith(title)
    assert summary.text(simulate(scene, 0.1)).startswith(title)
    whole = page(scene_data(scene))
    assert f"<title>{title}" in whole
    assert '"title"' not in whole.partition('id="data"')[2].partition("</script>")[0]


def test_so_have_responses_and_figures_of_many() -> None:
    from modal.plotting import bode_figure, shapes_figure
    from modal.statespace import response_table, state_space, to_modal_form

    crane = load("crane-hook").replace(title="")
    form = to_modal_form(natural_modes(crane), state_space(crane))
    assert response_table(form, [0.1], 0, [0], "text").startswith(title_of(crane))
    assert title_of(crane) in " ".join(bode_figure(form).get_suptitle().split())
    many = Scene(gravity=9.81, support=CART, pendulum=[bobs(1, 20)])
    figure = shapes_figure(natural_modes(many), [1])
    assert "20 simple pendula on a cart" in " ".join(figure.get_suptitle().split())


def test_space_is_named() -> None:
    scene = Scene(gravity=9.81, space="space", pendulum=[bobs(2)])
    assert title_of(scene) == "A double pendulum of bobs on a fixed support, in space"


def test_the_scenes_own_title_comes_first_and_json_has_that_alone() -> None:
    scene = load("crane-hook")
    assert title_of(scene) == scene.title
    untitled = scene.replace(title="")
    assert "title" not in describe(untitled)
    modes = natural_modes(untitled)
    assert "title" not in json.loads(table(modes, list(modes), "json"))["scene"]
    for form in ("text", "markdown", "html", "latex"):
        assert title_of(untitled) in table(modes, list(modes), form)
