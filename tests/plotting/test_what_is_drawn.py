"""What figures say and draw: words in place of identifiers, closed curves of sections, travels along a hoist."""

from __future__ import annotations

import re

import numpy as np
import pytest
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.text import Text

from modal import load, natural_modes
from modal.plotting import bode_figure, theme, travel_figure
from modal.plotting.vibration import random_figure
from modal.scene.records import Spectrum
from modal.scene.signal_names import link_names, signal_words
from modal.statespace import shaper_for, state_space, to_modal_form
from modal.statespace.travels import shaped_travel
from modal.vibration import random_response
from nonlinear.ensembles import find_section
from nonlinear.plotting import section_figure
from nonlinear.plotting.ensembles import closed_curves
from nonlinear.plotting.run import resolving_duration
from nonlinear.postprocessing import resolution


def words_of(figure: Figure) -> list[str]:
    return [text.get_text() for text in figure.findobj(Text) if text.get_text()]


def identifiers(figure: Figure) -> list[str]:
    return [words for words in words_of(figure) if re.search(r"[a-z0-9]_[a-z0-9]|theta|\[\d|\^", words)]


# ------------------------------------------------------------------------------------------------------- words


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("theta_dot_12_3", "rate of θ₁₂,₃"),
        ("rel_1_2", "relative θ₁₂"),
        ("tip_ddot_2", "acceleration of the tip of pendulum 2"),
        ("joint_2_1", "lower end of link 1 of pendulum 2"),
        ("ship_roll_ddot_rad_per_s2", "acceleration of ship roll"),
        ("x_dot", "cart velocity"),
        ("cart_force", "force on the cart"),
        ("support_acceleration", "support acceleration"),
    ],
)
def test_signals_have_words(name: str, words: str) -> None:
    assert signal_words(name) == words


def test_links_of_many_pendula_are_told_apart() -> None:
    """θ₁₁₁ would be link 11 of pendulum 1 or link 1 of pendulum 11."""
    labels = [f"theta[{pendulum},{link}]" for pendulum in range(1, 12) for link in (1, 2)]
    assert link_names(labels)[-2:] == ["θ₁₁,₁", "θ₁₁,₂"]
    assert len(set(link_names(labels))) == 22


def test_pictures_of_linear_models_have_no_identifiers_and_units_once() -> None:
    tower = load("tower")
    model = state_space(tower, ["support_acceleration"], ["coordinates", "angles"])
    form = to_modal_form(natural_modes(tower), model)
    suspension = load("damped-suspension")
    white = Spectrum((0.05, 30.0), (1e-12, 1e-12), "acceleration")
    noise = random_response(suspension, white, ("tip_positions", "relative_angles"))
    with theme("light"):
        bode, psd = bode_figure(form), random_figure(noise)
    assert identifiers(bode) == identifiers(psd) == []
    assert sum("m/s²" in words for words in words_of(bode)) == 1
    titles = [axis.get_title(loc="left") for axis in psd.axes]
    assert titles == ["driven by: support acceleration", "response: position", "response: angle"]


def test_peaks_of_hardly_damped_modes_are_cut_and_said_so() -> None:
    """A mode of ζ = 1e-7 rises seven decades of power above all else, as one line."""
    white = Spectrum((0.05, 30.0), (1e-12, 1e-12), "acceleration")
    for name, are_cut in (("suspension", True), ("damped-suspension", False)):
        axis = random_figure(random_response(load(name), white, ("tip_positions",))).axes[1]
        curve = np.asarray(axis.lines[0].get_ydata(), dtype=float)
        assert (np.nanmax(curve) > axis.get_ylim()[1]) == are_cut
        assert axis.get_title(loc="left").endswith("sharp peaks cut") == are_cut


# ---------------------------------------------------------------------------------------------------- sections


def crossings(rotation: float, count: int = 100) -> np.ndarray:
    """Successive points of a curve like a banana, at phases that grow by a rotation number."""
    phase = 2 * np.pi * rotation * np.arange(count)
    x, y = np.cos(phase), 0.2 * np.sin(phase)
    return np.column_stack((x, y + x**2))


def test_a_regular_motion_is_a_closed_curve_whatever_its_shape() -> None:
    points = crossings(0.3819660)
    (curve,) = closed_curves(points)
    assert len(curve) == 101
    assert curve[0] == pytest.approx(curve[-1])
    fine = crossings(1e-4, 10_000)
    length = np.linalg.norm(np.diff(fine, axis=0), axis=1).sum()
    assert np.linalg.norm(np.diff(curve, axis=0), axis=1).sum() == pytest.approx(length, rel=0.01)


def test_islands_are_as_many_curves_and_no_order_is_none() -> None:
    islands = crossings(0.3819660, 99) / 10
    islands[:, 0] += np.arange(99) % 3
    assert len(closed_curves(islands)) == 3
    disorder = np.random.default_rng(1).uniform(size=(200, 2))
    assert closed_curves(disorder) == closed_curves(crossings(0.38, 10)) == []
    assert closed_curves(np.ones((50, 2))) == []  # a periodic orbit


def test_regular_motions_of_a_section_are_joined_and_chaotic_ones_are_not() -> None:
    """Of two bobs at 14 J some motions are regular, most are not; each has a shade of one hue."""
    section = find_section(load("chain-2"), 200.0, energy=14.0, members=8)
    with theme("light"):
        lines = section_figure(section).axes[0].lines
    regular = {line.get_color() for line in lines if line.get_linestyle() == "-"}
    assert 2 <= len(regular) <= 4
    hues = {line.get_color() for line in lines}
    assert len(hues) == 8
    assert all(blue > green > red for red, green, blue in map(to_rgb, hues))


# ------------------------------------------------------------------------------------------ travels and durations


def test_a_travel_along_a_hoist_shows_the_length_the_swing_and_what_is_left() -> None:
    crane = load("hoisting-crane")
    travel = shaped_travel(crane, shaper_for(crane.at(0.0), 1), 20.0)
    with theme("light"):
        figure = travel_figure(travel)
    titles = [axis.get_title(loc="left") for axis in figure.axes]
    assert titles == ["Cart, as prescribed", "Hoist, as prescribed", "Swing, unshaped", "Swing, shaped"]
    (rope,) = figure.axes[1].lines
    assert rope.get_ydata()[[0, -1]] == pytest.approx([12.0, 6.0])
    left = [words for words in words_of(figure) if words.startswith("residual swing")]
    assert left == [f"residual swing {np.degrees(angle):.3g}°" for angle in travel.residual]


def test_a_plot_runs_as_long_as_its_spectrum_takes_to_separate_the_modes() -> None:
    tower = load("tower")
    duration = resolving_duration(tower, 20.0)
    assert 20.0 < duration <= 100.0
    gaps = np.diff(natural_modes(tower).omega)
    assert resolution(np.array([0.0, duration])) <= gaps.min() < resolution(np.array([0.0, duration - 1.0]))
    assert resolving_duration(load("paper-cart-2"), 20.0) == 20.0
    assert resolving_duration(load("thousand-pendula"), 20.0) == 20.0
