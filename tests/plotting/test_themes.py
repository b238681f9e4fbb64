"""Figures in both themes: each colour has its twin, nothing else differs, and pages choose one of the two."""

from __future__ import annotations

import re
from base64 import b64decode
from io import BytesIO
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pytest
from chromium import Chromium
from IPython.core.interactiveshell import InteractiveShell
from live import BROWSER
from matplotlib import cycler, rc_context, rcParams
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from PIL import Image

import modal
from modal import natural_modes
from modal.plotting import ThemedPicture, pair_of, shapes_figure, show_both_themes
from modal.plotting.style import save, theme
from modal.plotting.themes import dark_twin
from modal.types import Floats
from nonlinear import simulate
from nonlinear.plotting import show_film


def pixels(picture: bytes) -> Floats:
    return np.asarray(Image.open(BytesIO(picture)).convert("RGB"), dtype=float)


def drawn(name: str) -> bytes:
    """A figure with everything that has a colour, made and drawn in one style."""
    with theme(name):
        figure, axis = plt.subplots(figsize=(4, 3))
        axis.plot([0, 1], [0, 1], "o-", label="a line")
        axis.scatter([0.1, 0.5], [0.8, 0.2], [40, 90], color="C3")
        axis.bar([0.7, 0.85], [0.5, 0.4], 0.1, color="C2", hatch="//", edgecolor="C4")
        axis.fill_between([0.2, 0.4], [0, 0], [0.3, 0.5], color="C1", alpha=0.4)
        axis.fill_between([0.5, 0.6], [0, 0], [0.3, 0.5], facecolor="none", edgecolor="C5", hatch="//")
        axis.annotate("words", (0.3, 0.4), (0.1, 0.6), arrowprops={"arrowstyle": "->", "color": rcParams["text.color"]})
        axis.set(xlabel="time (s)", ylabel=r"$\theta^2/2$ (rad²)", title="a title")
        axis.legend(frameon=True, edgecolor=rcParams["legend.edgecolor"])
        plt.close(figure)
        if name == "light":
            return pair_of(figure).dark
        buffer = BytesIO()
        figure.savefig(buffer, format="png", dpi=figure.dpi)
        return buffer.getvalue()


@pytest.mark.parametrize("form", ["svg", "pdf"])
def test_equal_figures_are_equal_bytes(form: str, monkeypatch: pytest.MonkeyPatch) -> None:
    def written(second: str) -> bytes:
        monkeypatch.setenv("SOURCE_DATE_EPOCH", second)
        buffer = BytesIO()
        with theme("light"):
            figure, axis = plt.subplots(figsize=(2, 1))
            axis.plot([0, 1], [0, 1], "o-", clip_on=True)
            plt.close(figure)
            save(figure, buffer, form)
        return buffer.getvalue()

    assert written("0") == written("86400")


def test_a_light_figure_in_dark_is_the_figure_made_in_dark() -> None:
    """Pixel by pixel, but for rounding and the 256 colours of its palette."""
    difference = np.abs(pixels(drawn("light")) - pixels(drawn("dark")))
    assert difference.max() <= 16
    assert difference.mean() < 0.2


def test_the_figure_itself_is_not_changed() -> None:
    with theme("light"):
        figure = shapes_figure(natural_modes(modal.load("chain-2")), [0, 1])
        canvas, layout = figure.canvas, figure.get_layout_engine()
        before = [line.get_color() for axis in figure.axes for line in axis.lines]
        first = pair_of(figure)
    assert (figure.canvas, figure.get_layout_engine()) == (canvas, layout)
    assert [line.get_color() for axis in figure.axes for line in axis.lines] == before
    assert pixels(first.light)[0, 0].tolist() == [255, 255, 255]
    assert pixels(first.dark)[0, 0].tolist() == [0x12, 0x18, 0x1D]


def test_greys_keep_their_order_and_other_colours_stay() -> None:
    greys = [dark_twin(str(part))[:3] for part in np.linspace(0, 1, 11)]
    assert np.all(np.diff(np.array(greys), axis=0) <= 0)
    assert to_hex(dark_twin("black")) == "#dfe5ea"
    assert dark_twin("0.5")[3] == 1
    assert dark_twin((0, 0, 0, 0.25))[3] == 0.25
    assert to_hex(dark_twin("#fde725")) == "#fde725"


def test_images_keep_their_colours() -> None:
    with theme("light"):
        figure = Figure(figsize=(2, 2))
        figure.set_layout_engine("none")
        axis = figure.add_axes((0, 0, 1, 1))
        axis.imshow([[0.0, 1.0], [0.5, 0.2]])
        axis.set_axis_off()
        pair = pair_of(figure)
    np.testing.assert_allclose(pixels(pair.light), pixels(pair.dark), atol=1)


def test_a_page_has_both_and_its_words() -> None:
    page = ThemedPicture(b"one", b"two", "ω < 2").html()
    assert [b64decode(data) for data in re.findall(r"base64,([^\"]*)", page)] == [b"one", b"two"]
    assert re.findall(r'class="(.*?)"', page) == ["in-light", "in-dark"]
    assert page.count('alt="ω &lt; 2"') == 2


@pytest.mark.filterwarnings("ignore:.*deprecated in traitlets:DeprecationWarning")
def test_a_notebook_shows_figures_in_both_themes() -> None:
    shell = InteractiveShell.instance()
    try:
        with theme("light"):
            show_both_themes()
            figure = Figure(figsize=(1, 1))
            figure.subplots().set(xlabel="time (s)")
            shown = shell.display_formatter.format(figure)[0]["text/html"]  # type: ignore[union-attr]
            assert shown.count("data:image/png;base64,") == 2
            assert 'alt="time (s)"' in shown
            picture = shapes_figure(natural_modes(modal.load("chain-1")), [0])
            assert "in-dark" in shell.display_formatter.format(picture)[0]["text/html"]  # type: ignore[union-attr]
    finally:
        InteractiveShell.clear_instance()


def test_outside_a_notebook_the_style_is_set() -> None:
    with theme("dark"):
        show_both_themes()
        assert rcParams["figure.facecolor"] == "#ffffff"


def test_a_result_draws_in_a_theme_and_in_the_style_that_was_chosen() -> None:
    modes = natural_modes(modal.load("chain-1"))

    def paper(name: str = "") -> str:
        return to_hex(modes.plot(theme=name).get_facecolor())

    with rc_context({"figure.facecolor": "#112233"}):
        assert paper() == "#ffffff"  # nobody has chosen colours of curves: the light theme
        assert paper("dark") == "#12181d"
    with theme("dark"):
        assert paper() == "#12181d"
        assert paper("light") == "#ffffff"
    with rc_context({"figure.facecolor": "#112233", "axes.prop_cycle": cycler("color", ["r", "b"])}):
        assert paper() == "#112233"


@BROWSER
def test_a_page_shows_the_one_of_its_theme(tmp_path: Path) -> None:
    """As the manual says by its attribute, JupyterLab by its own, or the system where the manual leaves it to that."""
    with theme("light"):
        figure = Figure(figsize=(1, 1))
        figure.subplots()
        fragment = pair_of(figure).html()
    cases = {
        ("", False): "in-light",
        ("", True): "in-light",
        ('data-theme="light"', True): "in-light",
        ('data-theme="dark"', False): "in-dark",
        ('data-theme="auto"', False): "in-light",
        ('data-theme="auto"', True): "in-dark",
        ('data-jp-theme-light="true"', True): "in-light",
        ('data-jp-theme-light="false"', False): "in-dark",
        ('class="vscode-dark"', False): "in-dark",
    }
    jupyter = "<style>.cell > img { display: block; }</style>"
    with Chromium(clockwork=False) as browser:
        for (said, dark), expected in cases.items():
            page = tmp_path / "page.html"
            page.write_text(f"<!doctype html>{jupyter}<body {said}><div class=cell>{fragment}</div>", encoding="utf-8")
            browser.size(600, 400, dark=dark)
            browser.open(page)
            seen = "[...document.images].filter((one) => one.offsetWidth > 0).map((one) => one.className)"
            assert browser.run(seen) == [expected], (said, dark)


def test_a_film_plays_in_both_themes() -> None:
    film = show_film(simulate(modal.load("chain-1"), 1.0), seconds=0.5, fps=10)
    for data, paper in ((film.light, [255, 255, 255]), (film.dark, [0x12, 0x18, 0x1D])):
        image = Image.open(BytesIO(data))
        assert image.format == "GIF"
        assert image.n_frames == 5  # type: ignore[attr-defined]
        assert pixels(data)[0, 0].tolist() == paper
    assert "image/gif;base64" in film._repr_mimebundle_()["text/html"]  # type: ignore[operator]
