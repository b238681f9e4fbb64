"""Figures behind a slider."""

from __future__ import annotations

import re
from base64 import b64decode
from io import BytesIO

import numpy as np
import pytest
from matplotlib.figure import Figure
from PIL import Image

from modal.plotting import slide


def line(slope: float) -> Figure:
    figure = Figure(figsize=(2, 2))
    figure.subplots().plot([0, 1], [0, slope])
    return figure


def test_every_value_has_its_own_picture_and_one_is_seen() -> None:
    slider = slide(line, [1.0, 2.0, 2.5e-9], "slope <m>", at=-1)
    page = slider.html()
    pictures = [np.asarray(Image.open(BytesIO(b64decode(data)))) for data in re.findall(r"base64,([^\"]*)", page)]
    assert len(pictures) == 6  # on light and on dark paper
    assert not np.array_equal(pictures[0], pictures[4])
    assert re.findall(r'data-value="(.*?)"', page) == ["1", "2", "2.5e-09"]
    assert re.findall(r'style="display:(\w+)"', page) == ["none", "none", "block"]
    assert "<output>2.5e-09</output>" in page
    assert "slope &lt;m&gt;" in page
    assert "<m>" not in page


def test_a_slider_has_the_colours_of_its_page() -> None:
    page = slide(line, [1.0], "slope").html()
    assert re.findall(r"color:([^;\"]*)", page) == ["inherit", "currentcolor"]


def test_what_shows_no_page_shows_the_middle_picture() -> None:
    slider = slide(line, [1.0, 2.0, 3.0], "slope")
    bundle = slider._repr_mimebundle_()
    assert bundle["image/png"] == slider.pictures[1].light
    assert bundle["text/plain"] == "Slider('slope', 3 pictures)"


def test_a_slider_of_nothing_is_refused() -> None:
    with pytest.raises(ValueError, match="at least one value"):
        slide(line, [], "slope")
