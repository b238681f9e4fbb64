"""Curves that coincide, and what pictures of few and of many pendula, of damped and of undamped modes must show."""

from __future__ import annotations

from functools import cache
from itertools import pairwise

import numpy as np
import pytest
from amounts import usually
from matplotlib.figure import Figure
from scipy.linalg import eigh
from scipy.signal import get_window
from seen import flaws, hidden_curves

from modal import Bob, Cart, Pendulum, Scene, matrices, natural_modes
from modal.coupling import explain
from modal.plotting import bode_figure, coupling_figure, shapes_figure, sheet
from modal.plotting.curves import CURVE_GAP_MAX, coinciding, common_name, draw_curves, pick
from modal.plotting.layout import HEADLINE_LINES, headline, key, legend, shorten
from modal.plotting.style import colour, theme
from modal.statespace import state_space, to_modal_form
from nonlinear.plotting import check_figure
from nonlinear.postprocessing import power_spectrum, resolution
from nonlinear.verification import check

X = np.linspace(0.0, 10.0, 500)


def panel(count: int) -> Figure:
    """Curves one upon the other."""
    with theme("light"):
        figure = sheet(8.0, 3.0)
        axis = figure.subplots()
        curves = [(X, np.sin(X) * (1 + CURVE_GAP_MAX * k / 10)) for k in range(count)]
        draw_curves(axis, curves, names=[f"link {k}" for k in range(count)])
        axis.set(xlabel="time (s)", ylabel="angle (rad)")
        legend(axis)
    return figure


# ------------------------------------------------------------------------------------------------------- coinciding


def test_curves_coincide_within_less_than_a_line() -> None:
    curves = np.array([np.sin(X), np.cos(X), np.sin(X) + 0.9 * CURVE_GAP_MAX, np.cos(X) + 3 * CURVE_GAP_MAX])
    assert coinciding(curves) == [[0, 2], [1], [3]]


def test_gaps_coincide_with_gaps_only() -> None:
    broken = np.where(X < 5, X, np.nan)
    assert coinciding(np.array([X, broken, broken])) == [[0], [1, 2]]
    assert coinciding(np.full((2, 5), np.nan)) == [[0, 1]]
    assert coinciding(np.zeros((3, 0))) == [[0, 1, 2]]


@pytest.mark.parametrize(
    ("names", "expected"),
    [
        (["link 4"], "link 4"),
        (["pendulum 1", "pendulum 2", "pendulum 3", "pendulum 7"], "pendula 1–3, 7 coincide"),
        (["1.1", "2.1", "3.1"], "1.1–3.1 coincide"),
        (["1.1", "2.2"], "1.1, 2.2 coincide"),
        (["kinetic", "total"], "kinetic, total coincide"),
        ([f"pendulum {k}" for k in range(1, 100, 2)], "pendula 1, 3, 5, 7, 9, 11, 13, … (43 more) coincide"),
    ],
)
def test_coinciding_curves_are_named_together(names: list[str], expected: str) -> None:
    assert common_name(names) == expected


def test_of_many_curves_some_are_picked_evenly_and_of_equal_ones_one() -> None:
    many = np.arange(100.0)[:, None] + np.zeros(5)
    numbers, names, stand_for = pick(many, [f"link {k}" for k in range(100)], 6)
    assert (numbers[0], numbers[-1], len(names), stand_for) == (0, 99, 6, 6)
    numbers, names, stand_for = pick(np.tile(np.sin(X), (1000, 1)), [f"link {k}" for k in range(1000)], 6)
    assert (numbers.tolist(), names, stand_for) == ([0], ["link 0–999 coincide"], 1000)


@pytest.mark.parametrize("count", usually([3], [2, 3, 6]))
def test_curves_upon_each_other_all_show(count: int) -> None:
    figure = panel(count)
    assert hidden_curves(figure) == []
    for line in figure.axes[0].lines:
        line.set_linestyle("-")
        line.set_linewidth(2.0)
    assert len(hidden_curves(figure)) == count - 1


def test_curves_that_cross_stay_solid() -> None:
    with theme("light"):
        axis = sheet(8.0, 3.0).subplots()
        draw_curves(axis, [(X, np.sin(X)), (X, np.cos(X)), (X, 0 * X)])
    assert [line.get_linestyle() for line in axis.lines] == ["-"] * 3


# ---------------------------------------------------------------------------------------------------- words in figures


@pytest.mark.parametrize(
    "title",
    ["by a spring: a chimera", "$\\frac{" * 80, "W" * 900, "a_b " * 300, "振り子の連成振動" * 60][: usually(3, 5)],
)
def test_a_title_of_any_length_leaves_room_and_tells_what_is_drawn(title: str) -> None:
    with theme("light"):
        figure = panel(2)
        headline(figure, title, "motion")
    assert flaws(figure) == []
    words = figure.get_suptitle()
    assert words.count("\n") < HEADLINE_LINES
    assert words.endswith(" – motion" if ":" in title else "motion")
    assert figure.axes[0].get_window_extent().height > 0.3 * figure.bbox.height


def test_long_and_hostile_names_fit_their_legends() -> None:
    names = [(r"$x_{ the rope of the northern harbour's second crane \frac{ " * 3) + str(k) for k in range(7)]
    with theme("light"):
        figure = sheet(8.0, 6.0)
        axis = figure.subplots()
        for k, name in enumerate(names):
            axis.plot(X, np.sin(X + k), color=colour(k), label=name)
        axis.set(xlabel="time (s)", ylabel="angle (rad)")
        legend(axis)
        key(figure, axis.lines[:3], names[:3])
    assert flaws(figure) == []
    assert shorten("abcdefghij", 7) == "abc…hij"
    assert shorten("short") == "short"


def test_a_legend_on_a_logarithmic_axis_has_room_above_the_curves() -> None:
    with theme("light"):
        figure = sheet(6.0, 3.0)
        axis = figure.subplots()
        for k in range(5):
            axis.plot(X, 10 ** (k + np.sin(X)), color=colour(k), label=f"pendulum {k}")
        axis.set(yscale="log", xlabel="time (s)", ylabel="energy (J)")
        legend(axis)
    assert flaws(figure) == []


# -------------------------------------------------------------------------------------------------------------- modes


def test_profiles_are_the_shapes_of_the_dense_matrices() -> None:
    links = [(Bob(mass=1.0, length=1.0 + 0.1 * k), Bob(mass=1.0, length=0.5)) for k in range(13)]
    scene = Scene(gravity=9.81, support=Cart(mass=10.0), pendulum=tuple(Pendulum(links=pair) for pair in links))
    modes = natural_modes(scene)
    number = 9
    dense = matrices(scene)
    values, vectors = eigh(dense.K, dense.M)
    at = int(np.argmin(np.abs(np.sqrt(np.abs(values)) - modes.omega[number])))
    angles = vectors[1:, at] / vectors[1 + np.abs(vectors[1:, at]).argmax(), at]
    with theme("light"):
        figure = shapes_figure(modes, [number])
    drawn: dict[str, np.ndarray] = {}
    for line in figure.axes[0].lines:
        if len(line.get_xydata()) == 13:
            profile = drawn.setdefault(line.get_color(), np.full(13, np.nan))
            y = np.array(line.get_ydata(), dtype=float)
            profile[np.isfinite(y)] = y[np.isfinite(y)]
    assert list(drawn) == [colour_of(0), colour_of(1)]
    profiles = np.column_stack(list(drawn.values())).ravel()
    assert profiles == pytest.approx(25 * angles * np.sign(angles @ profiles), abs=1e-9)
    assert figure.axes[0].get_xlabel() == "number of the pendulum (–)"


@cache
def colour_of(k: int) -> str:
    with theme("light"):
        return colour(k)


def test_an_overdamped_mode_does_not_swing() -> None:
    link = (Bob(mass=1.0, length=1.0, damping=20.0),)
    modes = natural_modes(Scene(gravity=9.81, pendulum=(Pendulum(links=link),)))
    with theme("light"):
        figure = shapes_figure(modes, [0])
    axis = figure.axes[0]
    ends = [line.get_xdata()[-1] for line in axis.lines if len(line.get_xydata()) == 2 and line.get_ydata()[-1] < -0.1]
    moved = sorted(float(end) for end in ends if abs(end) > 1e-9)
    assert [moved[1] / moved[0], moved[2] / moved[1]] == pytest.approx([np.e, np.e], rel=0.05)
    # λ = (−c ± √(c² − 4 g))/2 of θ'' + cθ' + gθ = 0 with c = 20, m = l = 1
    assert f"decays at {10 - np.sqrt(100 - 9.81):.5g} 1/s without a swing" in axis.get_title().replace("\n", " ")
    assert "swing;" not in figure.get_supxlabel()


# ------------------------------------------------------------------------------------------------------------ Bode


def bob(ratio: float) -> Scene:
    options = {"damping_ratio": ratio} if ratio else {}
    return Scene(gravity=9.81, pendulum=(Pendulum(links=(Bob(mass=1.0, length=1.0),)),), **options)


def bode(scene: Scene, band: tuple[float, float] | None = None) -> Figure:
    with theme("light"):
        return bode_figure(to_modal_form(natural_modes(scene), state_space(scene)), band=band)


@pytest.mark.parametrize("ratio", [0.3, 1e-2, 1e-4, 1e-7])
@pytest.mark.parametrize("band", [None, (0.7, 5.1), (3.0, 3.3)])
def test_a_damped_peak_has_its_height_in_any_band(ratio: float, band: tuple[float, float] | None) -> None:
    """|G| = 1/(2ζω²√(1 − ζ²)) for θ'' + 2ζωθ' + ω²θ = τ."""
    axis = bode(bob(ratio), band).axes[0]
    expected = 20 * np.log10(1 / (2 * ratio * 9.81 * np.sqrt(1 - ratio**2)))
    height = max(float(np.nanmax(line.get_ydata())) for line in axis.lines if len(line.get_xydata()) > 2)
    if band != (3.0, 3.3) or ratio < 0.3:
        assert height == pytest.approx(expected, abs=1e-3)
    assert axis.get_ylim()[1] > height


def test_undamped_peaks_and_zeros_reach_the_levels_that_are_stated() -> None:
    links = (Bob(mass=1.0, length=1.0), Bob(mass=2.0, length=3.0))
    scene = Scene(gravity=9.81, support=Cart(mass=5.0), pendulum=(Pendulum(links=links),))
    figure = bode(scene)
    axis = figure.axes[0]
    low, high = axis.get_ylim()
    assert figure.legends[0].get_title().get_text() == (
        f"peaks of undamped modes are infinite and cut at {high:g} dB; zeros cut at {low:g} dB".replace("-", "−")
    )
    zeros = [mode.omega for mode in natural_modes(scene) if mode.omega]
    cart = {text.get_text(): k for k, text in enumerate(figure.legends[0].get_texts())}["cart position"]
    pieces = [line for line in axis.lines if line.get_color() == colour_of(cart) and len(line.get_xydata()) > 2]
    x = np.concatenate([line.get_xdata() for line in pieces])
    y = np.concatenate([np.asarray(line.get_ydata(), dtype=float) for line in pieces])
    order = np.argsort(x)
    x, y = x[order], y[order]
    for omega in zeros:
        assert y[np.argmin(np.abs(2 * np.pi * x - omega))] > high
    # the zeros of the cart are the modes of the double pendulum on a fixed support
    fixed = natural_modes(Scene(gravity=9.81, pendulum=scene.pendulum)).omega
    deep = 2 * np.pi * x[y < low]
    assert np.abs(deep[:, None] / fixed - 1).min(axis=0).max() < 1e-5
    assert np.abs(deep[:, None] / fixed - 1).min(axis=1).max() < 1e-3


def test_labels_name_input_output_and_units() -> None:
    figure = bode(Scene(gravity=9.81, support=Cart(mass=5.0), pendulum=(Pendulum(links=(Bob(mass=1.0, length=1.0),)),)))
    assert figure.axes[0].get_ylabel() == "magnitude\n(dB re 1 m or rad per N)"
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["cart position", "θ₁₁"]
    assert "response to the force on the cart" in figure.get_suptitle()


# -------------------------------------------------------------------------------------- coupling, check and spectra


def single(count: int, mass: float) -> Scene:
    links = [(Bob(mass=1.0, length=1.0 + 0.1 * k / count),) for k in range(count)]
    return Scene(gravity=9.81, support=Cart(mass=mass), pendulum=tuple(Pendulum(links=chain) for chain in links))


def test_of_one_pendulum_the_rise_with_a_light_cart_is_seen() -> None:
    """ω² = (g/l)(1 + m/m_c) without limit: on the axis up to more than twice that of the scene."""
    with theme("light"):
        axis = coupling_figure(explain(single(1, 10.0))).axes[-1]
    now = np.sqrt(9.81 * 1.1)
    low, high = axis.get_ylim()
    assert high > 2 * now
    assert low > 0.5 * np.sqrt(9.81)
    (curve,) = [line for line in axis.lines if len(line.get_xydata()) > 20]
    masses, omega = curve.get_data()
    assert omega == pytest.approx(np.sqrt(9.81 * (1 + 1 / masses)))


def test_of_a_hundred_pendula_the_poles_are_a_band_beside_the_mode_outside_it() -> None:
    explanation = explain(single(100, 10.0))
    with theme("light"):
        axis = coupling_figure(explanation).axes[-1]
    curves = [line for line in axis.lines if len(line.get_xydata()) > 20]
    assert len(curves) == 1
    assert curves[0].get_ydata().min() >= explanation.dynamic.omega[-1]
    words = [text.get_text() for text in axis.texts]
    assert "band: 100 poles, with 99 modes that move the cart between them" in words


def test_a_check_of_one_amplitude_has_a_decade_and_the_level_of_one_per_cent() -> None:
    scene = Scene(gravity=9.81, pendulum=(Pendulum(links=(Bob(mass=1.0, length=1.0),)),))
    with theme("light"):
        figure = check_figure(check(scene, [0], [10.0], periods=8))
    figure.draw_without_rendering()
    axis = figure.axes[0]
    (left, right), (bottom, top) = axis.get_xlim(), axis.get_ylim()
    assert right / left >= 10
    assert bottom < 0.01 < top
    named = [tick for tick in axis.get_xticks() if left <= tick <= right]
    assert len(named) >= 3


def test_the_spectrum_of_five_seconds_is_a_curve_with_its_peak_in_place() -> None:
    times = np.linspace(0, 5, 251)
    for rate in (6.1, 7.3, 8.9):
        omega, power = power_spectrum(times, np.cos(rate * times))
        assert omega[1] < 0.2
        assert omega[np.argmax(power)] == pytest.approx(rate, abs=0.1)


def test_the_stated_resolution_is_the_width_of_the_windows_peak() -> None:
    """Six decibels down, from the transform of the window itself."""
    count, fine = 1000, 64
    window = get_window("blackmanharris", count)
    size = np.abs(np.fft.rfft(window, fine * count)) / window.sum()
    half = int(np.argmax(size < 10 ** (-6 / 20)))
    times = np.linspace(0, 10, count)
    assert resolution(times) == pytest.approx(2 * half / fine * 2 * np.pi / 10, rel=0.02)


def test_two_lines_at_the_resolution_are_two_peaks() -> None:
    times = np.linspace(0, 40, 2001)
    apart = 1.15 * resolution(times)
    omega, power = power_spectrum(times, np.cos(9 * times) + np.cos((9 + apart) * times + 0.9))
    peaks = [k for k in range(1, len(power) - 1) if power[k] > max(power[k - 1], power[k + 1], 0.05 * power.max())]
    assert len(peaks) == 2
    assert all(b - a > 0 for a, b in pairwise(peaks))
    assert omega[peaks] == pytest.approx([9, 9 + apart], abs=0.1)


DEGENERATE = {
    "empty": lambda y: y[:0],
    "constant": np.zeros_like,
    "nan": lambda y: np.full_like(y, np.nan),
    "infinite": lambda y: np.full_like(y, np.inf),
    "of one point": lambda y: y[:1],
}


@pytest.mark.parametrize("kind", DEGENERATE)
@pytest.mark.parametrize("log", ["", "x", "xy"])
@pytest.mark.parametrize("bands", [False, True])
def test_curves_of_nothing_are_drawn_as_nothing_beside_others(kind: str, log: str, bands: bool) -> None:
    """In every place of the colours and marks, among curves that are upon each other and alone."""
    x = np.linspace(0.5, 3.0, 200)
    good = [(x, 2 + np.sin((k // 2) * x)) for k in range(9)]
    bad = [(DEGENERATE[kind](x), DEGENERATE[kind](y)) for x, y in good]
    if kind in {"nan", "infinite", "constant"}:
        bad = [(x, y) for _, y in bad]
    for curves in (bad, [bad[k] if k % 3 == 0 else good[k] for k in range(9)]):
        with theme("light"):
            figure = sheet(8.0, 3.0)
            axis = figure.subplots()
            draw_curves(axis, curves, names=[f"curve {k}" for k in range(9)], log=log, bands=bands)
            if log:
                axis.set_xscale("log")
            figure.draw_without_rendering()
            drawn = [np.isfinite(np.asarray(line.get_ydata(), dtype=float)).any() for line in axis.lines]
    assert any(drawn)


@pytest.mark.parametrize("outputs", usually([[0, 1]], [[1], [0, 1], list(range(9))]))
def test_an_output_that_the_input_does_not_reach_is_drawn_as_nothing(outputs: list[int]) -> None:
    """Pendula on a fixed support, also more than there are colours: the torque on one leaves the others at rest."""
    links = [(Bob(mass=1.0, length=1.0 + k),) for k in range(max(2, len(outputs)))]
    scene = Scene(gravity=9.81, pendulum=tuple(Pendulum(links=chain) for chain in links))
    with theme("light"):
        figure = bode_figure(to_modal_form(natural_modes(scene), state_space(scene)), outputs=outputs)
    figure.draw_without_rendering()
    upper = figure.axes[0]
    drawn = [np.isfinite(np.asarray(line.get_ydata(), dtype=float)).any() for line in upper.lines[: len(outputs)]]
    assert drawn == [output == 0 for output in outputs]


def test_a_label_with_long_units_stays_beside_its_panel() -> None:
    scene = Scene(gravity=9.81, support=Cart(mass=2.0), pendulum=[Pendulum(links=[Bob(mass=1.0, length=1.0)])])
    model = state_space(scene, ("cart_acceleration",), ("angles", "pivot_forces"))
    with theme("light"):
        figure = bode_figure(to_modal_form(natural_modes(scene), model))
    figure.draw_without_rendering()
    panel = figure.axes[0]
    label, room = panel.yaxis.label.get_window_extent(), panel.get_window_extent()
    assert label.y0 >= room.y0
    assert label.y1 <= room.y1
