"""One meaning a line style: what figures draw solid, dashed, dotted and dash-dotted."""

from __future__ import annotations

import ast
from pathlib import Path

import numpy as np
import pytest
from matplotlib.colors import to_hex

import modal
import nonlinear
from modal.plotting import sheet
from modal.plotting.curves import draw_curves
from modal.plotting.layout import legend
from modal.plotting.style import COMPUTED, HUES, MARKED, MOST_CURVES, PREDICTED, UNSTABLE, spots, theme
from nonlinear.orbits import nonlinear_mode
from nonlinear.plotting import orbits_figure

ROOMS = [Path(package.__file__).parent / "plotting" for package in (modal, nonlinear)]
MODULES = sorted(path for room in ROOMS for path in room.glob("*.py") if path.name != "style.py")


def written(source: str) -> list[str]:
    """Line styles that a module writes itself: of `ls` and `linestyle`, and in the third place of `plot`."""
    styles = []
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Call):
            places = [word.value for word in node.keywords if word.arg in {"ls", "linestyle"}]
            places += node.args[2:] if getattr(node.func, "attr", "") == "plot" else []
        elif isinstance(node, ast.Dict):
            pairs = zip(node.keys, node.values, strict=True)
            places = [
                value for key, value in pairs if isinstance(key, ast.Constant) and key.value in {"ls", "linestyle"}
            ]
        else:
            continue
        for place in places:
            is_dashed = isinstance(place, ast.Constant) and any(mark in str(place.value) for mark in ("--", "-.", ":"))
            styles += [ast.unparse(place)] * (is_dashed or isinstance(place, ast.Tuple))
    return styles


def test_line_styles_are_those_of_the_style_module() -> None:
    by_module = {path.name: written(path.read_text(encoding="utf-8")) for path in MODULES}
    assert len(by_module) > 20
    assert {name: styles for name, styles in by_module.items() if styles} == {}
    for line in (
        'axis.plot(x, y, "--")',
        'axis.axvline(1, ls=":")',
        'look = {"ls": "-."}',
        "axis.plot(x, ls=(0, (3, 2)))",
    ):
        assert len(written(line)) == 1


def test_curves_differ_in_colour_then_in_marks_and_never_in_dashes() -> None:
    x = np.linspace(0, 1, 50)
    with theme("light"):
        axis = sheet(8, 5).subplots()
        draw_curves(axis, [(x, x + k) for k in range(MOST_CURVES)])
    assert {line.get_linestyle() for line in axis.lines} == {COMPUTED}
    looks = {(to_hex(line.get_color()), line.get_marker()) for line in axis.lines}
    assert len(looks) == MOST_CURVES == 3 * HUES
    assert spots(0) == {}


def test_a_legend_shows_curves_on_one_place_as_solid_lines() -> None:
    x = np.linspace(0, 1, 50)
    with theme("light"):
        axis = sheet(8, 3).subplots()
        draw_curves(axis, [(x, x), (x, x), (x, np.where(x < 0.5, x, 0.5))], names=["one", "two", "three"])
        legend(axis)
    handles, labels = axis.get_legend_handles_labels()
    assert labels == ["one", "two", "three"]
    assert {line.get_linestyle() for line in handles} == {COMPUTED}
    assert any(line.get_linestyle() != COMPUTED for line in axis.lines)


def test_a_backbone_is_solid_its_prediction_dashed_and_the_linear_frequency_dotted() -> None:
    """κ of one bob is −1/16: θ'' + (g/l) sin θ = 0 swings at ω(1 − a²/16 + …)."""
    scene = modal.load("chain-1")
    mode = modal.natural_modes(scene)[0]
    with theme("light"):
        axis = orbits_figure(scene, [nonlinear_mode(scene, 1, np.deg2rad(60))], mode).axes[0]
    lines = {line.get_linestyle(): line for line in axis.lines if len(line.get_xydata()) > 1}
    assert set(lines) == {COMPUTED, PREDICTED, MARKED}
    omega, angle = lines[PREDICTED].get_data()
    assert omega / mode.omega == pytest.approx(1 - np.radians(angle) ** 2 / 16)
    assert lines[MARKED].get_xdata() == pytest.approx([np.sqrt(9.81)] * 2)
    assert UNSTABLE not in lines
