"""Every figure in both themes, examined as it is seen; and the examination fails on figures that are wrong."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache
from io import BytesIO
from itertools import combinations
from math import inf
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pytest
import swings
from amounts import usually
from matplotlib import style
from matplotlib.figure import Figure
from PIL import Image
from seen import LEAST, contrast, flaws, hidden_curves

import modal
from modal import Bob, Cart, Pendulum, Rod, Scene, natural_modes
from modal.coupling import Coupling, explain
from modal.loci import Loci, follow_loci
from modal.modes import Modes
from modal.plotting import bode_figure, coupling_figure, in_both_themes, save, shapes_figure, sheet
from modal.plotting.layout import headline, key
from modal.plotting.loci import loci_figure
from modal.plotting.response import hoist_figure, impulse_figure
from modal.plotting.style import HUES, QUIET, colour, ink, paper, secondary_colour, shade, theme, thickness
from modal.scene import InitialCondition, VanDerPol
from modal.scene.parameters import parse_variations
from modal.statespace import ModalForm, state_space, to_modal_form
from modal.statespace.hoisting import frequencies_along
from multipendula.cli import main
from nonlinear.accuracy import list_candidates, measure_frequencies, measure_work_precision
from nonlinear.chaos import Exponent, Finding, lyapunov_exponent, study
from nonlinear.integration import Trajectory
from nonlinear.plotting import (
    branches_figure,
    check_figure,
    frequencies_figure,
    populations_figure,
    sync_figure,
    tradeoff_figure,
)
from nonlinear.plotting.animation import Film
from nonlinear.plotting.chaos import exponent_figure, finding_figure
from nonlinear.plotting.run import run_figure
from nonlinear.plotting.sweeps import sweep_figure
from nonlinear.plotting.verification import spectrum_figure
from nonlinear.simulation import simulate
from nonlinear.sweeps import Study, Sweep, sweep
from nonlinear.synchronization import follow_branches, phases_of
from nonlinear.verification import Comparison, check, compare

THEMES = ("light", "dark")
LONG = "A crane of the northern harbour, its trolley on worn rails, two hooks of unequal weight and loads that lean $x_"
STYLES = Path(modal.__file__).parent / "plotting"

# ------------------------------------------------------------------------------------------------ what is drawn


def hung(count: int, *, cart: float | None = None, length: float = 1.0, mass: float = 1.0, title: str = "") -> Scene:
    """Pendula of slightly different lengths."""
    links = [(Bob(mass=mass, length=length * (1 + 0.05 * k)),) for k in range(count)]
    pendula = tuple(
        Pendulum(links=chain, start=InitialCondition(angles_deg=(20.0 + k,))) for k, chain in enumerate(links)
    )
    return Scene(title=title, gravity=9.81, pendulum=pendula, **({} if cart is None else {"support": Cart(mass=cart)}))


def clocks(count: int, apart: float = 1.0) -> Scene:
    """Clocks on a light beam."""
    links = (Bob(mass=1.0, length=1.0, drive=VanDerPol(strength=0.05, angle_deg=5.0)),)
    starts = (InitialCondition(angles_deg=(5.0 + apart * k,)) for k in range(count))
    pendula = tuple(Pendulum(links=links, start=start) for start in starts)
    return Scene(gravity=9.81, support=Cart(mass=50.0, damping=15.0), pendulum=pendula)


def equal(count: int, links: int = 1) -> Scene:
    """Equal pendula on a cart that start alike."""
    start = InitialCondition(angles_deg=(15.0,) * links)
    alike = Pendulum(links=(Bob(mass=1.0, length=1.0, count=links),), count=count, start=start)
    return Scene(title=f"{count} equal pendula", gravity=9.81, support=Cart(mass=10.0), pendulum=(alike,))


HOSTILE = r"$\frac{x$ 振り子の連成振動 _{_ % # & \mathrm{ " * 4
OVERDAMPED = Scene(
    gravity=9.81,
    pendulum=(Pendulum(links=(Bob(mass=1.0, length=1.0, damping=20.0), Bob(mass=1.0, length=1.0, damping=0.2))),),
)
WIDE_CHAIN = Scene(title=LONG, gravity=9.81, pendulum=(Pendulum(links=(Rod(mass=1.0, length=1.0, count=18),)),))
EXTREME = hung(2, cart=1e9, length=1e7, mass=1e-12, title=LONG)
MANY, TITLED = hung(30, cart=10.0), hung(8, cart=10.0, title=LONG)


@cache
def run(scene: str | Scene, duration: float = 6.0) -> Trajectory:
    return simulate(modal.load(scene) if isinstance(scene, str) else scene, duration)


@cache
def compared(scene: str | Scene, duration: float) -> Comparison:
    return compare(run(scene, duration))


@cache
def form(scene: str | Scene, outputs: tuple[str, ...] = ()) -> ModalForm:
    whole = modal.load(scene) if isinstance(scene, str) else scene
    return to_modal_form(natural_modes(whole), state_space(whole, (), outputs))


@cache
def swept(*vary: str, measures: tuple[str, ...] = ("frequencies", "beat")) -> Sweep:
    from nonlinear.sweeps import parse_measures

    return sweep(
        Study(modal.load("paper-cart-2"), parse_variations(list(vary)), parse_measures(list(measures))), workers=1
    )


@cache
def modes_of(scene: str | Scene) -> Modes:
    return natural_modes(modal.load(scene) if isinstance(scene, str) else scene)


def shapes(scene: str | Scene, count: int | None = None) -> Figure:
    modes = modes_of(scene)
    return shapes_figure(modes, range(count or len(modes)))


@cache
def explanation(scene: str | Scene) -> Coupling:
    return explain(modal.load(scene) if isinstance(scene, str) else scene)


def coupled(scene: str | Scene) -> Figure:
    return coupling_figure(explanation(scene))


@cache
def path_of(scene: str | Scene, text: str) -> Loci:
    return follow_loci(modal.load(scene) if isinstance(scene, str) else scene, parse_variations([text])[0])


def followed(scene: str | Scene, text: str) -> Figure:
    return loci_figure(path_of(scene, text))


@cache
def exponent() -> Exponent:
    return lyapunov_exponent(modal.load("paper-cart-1"), 7.0, members=2)


def claimed(paper_number: str, rates: list[float]) -> Figure:
    short, times = study(paper_number, quick=True), np.arange(0.0, 1501.0)
    wave = np.tile([1.0, -1.0], 5).repeat(100) / 30
    growth = [np.concatenate((np.zeros(500), rate + wave))[:, None] for rate in rates]
    exponents = (
        Exponent(case.scene, times, series, 500.0, 0.0) for case, series in zip(short.cases, growth, strict=True)
    )
    return finding_figure(Finding(short, tuple(exponents)))


def synced(scene: str | Scene, duration: float) -> Figure:
    trajectory = run(scene, duration)
    return sync_figure(trajectory, phases_of(trajectory))


def frame(scene: str | Scene) -> Figure:
    trajectory = run(scene, 3.0)
    film = Film(trajectory, np.linspace(0, 3, 5), 25.0, 1.0)
    film.show(3)
    return film.figure


@cache
def branching():
    return follow_branches(clocks(2), parse_variations(["support.mass=20:500:4log"])[0])


@cache
def traded():
    scene = modal.load("paper-cart-2")
    return measure_work_precision(
        scene,
        0.2,
        candidates=[
            candidate
            for candidate in list_candidates(scene)
            if candidate.modal or (candidate.tolerance > 1e-5 and not candidate.compiled)
        ],
        patience=inf,
    )


@cache
def checked(scene: str | Scene, angles: tuple[float, ...]):
    whole = modal.load(scene) if isinstance(scene, str) else scene
    return check(whole, [0], list(angles), periods=8)


FIGURES: dict[str, Callable[[], Figure]] = {
    "shapes of one bob": lambda: shapes("chain-1"),
    "shapes": lambda: shapes("paper-cart-2"),
    "shapes of a crane": lambda: shapes("crane-hook"),
    "shapes of a rope": lambda: shapes("rope", 2),
    "shapes upright": lambda: shapes("cart-upright"),
    "shapes in space": lambda: shapes("chain-spatial"),
    "shapes of clocks": lambda: shapes("huygens"),
    "shapes of many": lambda: shapes(WIDE_CHAIN),
    "shapes of thirteen": lambda: shapes(hung(13, cart=10.0), 4),
    "shapes of a hundred equal": lambda: shapes(equal(100, 2)),
    "shapes of a thousand equal": lambda: shapes(equal(1000)),
    "shapes overdamped": lambda: shapes(OVERDAMPED),
    "shapes extreme": lambda: shapes(EXTREME),
    "shapes of a crowd": lambda: shapes(MANY, 12),
    "coupling": lambda: coupled("paper-cart-2"),
    "coupling of two": lambda: coupled("crane-two-loads"),
    "coupling, fixed": lambda: coupled("chain-3"),
    "coupling of one": lambda: coupled(hung(1, cart=10.0)),
    "coupling of a hundred": lambda: coupled(hung(100, cart=10.0)),
    "coupling of a thousand equal": lambda: coupled(equal(1000)),
    "coupling of a crowd": lambda: coupled(MANY),
    "coupling extreme": lambda: coupled(EXTREME),
    "bode": lambda: bode_figure(form("crane-hook")),
    "bode of many": lambda: bode_figure(form(WIDE_CHAIN), outputs=range(18)),
    "bode extreme": lambda: bode_figure(form(EXTREME)),
    "bode of five": lambda: bode_figure(form(hung(5, cart=10.0, title=HOSTILE))),
    "bode of clocks": lambda: bode_figure(form("huygens")),
    "impulse of clocks": lambda: impulse_figure(form("huygens")),
    "impulse": lambda: impulse_figure(form("crane-hook")),
    "impulse of many": lambda: impulse_figure(form(WIDE_CHAIN), outputs=range(18)),
    "impulse extreme": lambda: impulse_figure(form(EXTREME)),
    "loci": lambda: followed("crane-two-loads", "pendulum[0].links[0].length=6:14:20"),
    "loci of many": lambda: followed(hung(17, cart=10.0, title=LONG), "support.mass=0.1:100:8log"),
    "hoist": lambda: hoist_figure(frequencies_along(modal.load("hoisting-crane"), 41)),
    "run": lambda: run_figure(run("paper-cart-3")),
    "run of one": lambda: run_figure(run("chain-1")),
    "run in space": lambda: run_figure(run("chain-spatial")),
    "run of many": lambda: run_figure(run(MANY)),
    "run of five": lambda: run_figure(run(hung(5, cart=10.0, title=HOSTILE), 5.0)),
    "run of equals": lambda: run_figure(run(equal(100, 2), 2.0)),
    "run of a thousand equal": lambda: run_figure(run(equal(1000), 1.0)),
    "run extreme": lambda: run_figure(run(EXTREME)),
    "check of one amplitude": lambda: check_figure(checked("chain-1", (10.0,))),
    "check": lambda: check_figure(checked("chain-2", (5.0, 20.0))),
    "spectrum": lambda: spectrum_figure(compared("chain-2", 10.0)),
    "spectrum of many": lambda: spectrum_figure(compared(hung(4, cart=10.0, title=LONG), 10.0)),
    "sync": lambda: synced("metronomes", 5.0),
    "sync of equals": lambda: synced(clocks(6, 0.0), 8.0),
    "sync of many": lambda: synced(clocks(12), 20.0),
    "branches": lambda: branches_figure(branching()),
    "populations": lambda: populations_figure(swings.diagram("carts", (0.2, 0.21, 0.26))),
    "sync of populations": lambda: synced(swings.two_swings(0.22, count=2), 8.0),
    "sweep": lambda: sweep_figure(swept("support.mass=1:1000:9log")),
    "sweep of much": lambda: sweep_figure(
        swept("gravity=1:3:3", measures=("frequencies", "damping", "beat", "largest_angle"))
    ),
    "map": lambda: sweep_figure(swept("support.mass=1:1000:5log", "gravity=1:20:4", measures=("beat",))),
    "maps": lambda: sweep_figure(
        swept("support.mass=1:1000:5log", "gravity=1:20:4", measures=("frequencies:3", "beat"))
    ),
    "tradeoff": lambda: tradeoff_figure(traded()),
    "tradeoff of frequencies": lambda: frequencies_figure(measure_frequencies(modal.load("paper-cart-2"))),
    "exponent": lambda: exponent_figure(exponent()),
    "claim of chains": lambda: claimed("001", [0.0, 1.0, 2.0, 3.0]),
    "claim of carts": lambda: claimed("000", [1.0, 0.8, 0.9, 1.0, 1.0, 1.3]),
    "film": lambda: frame("paper-cart-3"),
    "film in space": lambda: frame("chain-spatial"),
    "film of many": lambda: frame(TITLED),
}


USUAL = ("loci", "spectrum", "sync", "claim of chains")
"""Figures of every day, of which other tests draw the rest."""
IN_TURN = [(kind, THEMES[index % 2]) for index, kind in enumerate(FIGURES)]
"""Every figure in one theme: that the themes differ in colours alone is a test of its own."""


@pytest.mark.parametrize(
    ("kind", "name"),
    usually([case for case in IN_TURN if case[0] in USUAL], [(kind, name) for kind in FIGURES for name in THEMES]),
)
def test_nothing_is_wrong_with_the_figure(kind: str, name: str) -> None:
    with theme(name):
        figure = FIGURES[kind]()
    assert flaws(figure) == []


SHARED = (
    "run of five",
    "run of equals",
    "bode of clocks",
    "impulse of clocks",
    "shapes of a hundred equal",
    "sync of equals",
)
"""Figures in which curves coincide."""


@pytest.mark.parametrize("kind", usually(SHARED[2:4], SHARED))
def test_no_curve_is_hidden_under_others(kind: str) -> None:
    with theme("light"):
        assert hidden_curves(FIGURES[kind]()) == []


def test_branches_upon_each_other_all_show() -> None:
    branches = branching()
    with theme("light"):
        hidden = hidden_curves(branches_figure(replace(branches, branches=branches.branches[:1] * 3)))
    assert [problem for problem in hidden if "child" not in problem] == []  # rings of one value are one ring


# --------------------------------------------------------------------------------------------- the tests themselves


def good() -> Figure:
    """A figure with which nothing is wrong, a curve at hand as its first line."""
    figure = sheet(4.0, 3.0)
    axis = figure.subplots()
    axis.plot([0.0, 1.0], [0.0, 2.0], color=colour(0), label="swing")
    axis.set(xlabel="time (s)", ylabel="share (–)", title="A swing")
    headline(figure, "A pendulum", "motion")
    key(figure, axis.lines)
    return figure


def empty(figure: Figure) -> None:
    figure.axes[0].lines[0].remove()


def beyond(figure: Figure) -> None:
    figure.axes[0].set(xlim=(2.0, 3.0))


def beside(figure: Figure) -> None:
    """A line of which not one bit is in the panel, though its box is upon it."""
    figure.axes[0].set(xlim=(0.8, 1.0), ylim=(0.0, 0.2))


def impossible(figure: Figure) -> None:
    figure.axes[0].lines[0].set_ydata([-1.0, -2.0])
    figure.axes[0].set_yscale("log")


def only_marked(figure: Figure) -> None:
    empty(figure)
    figure.axes[0].axvline(0.5, color=ink())


def unseen(figure: Figure) -> None:
    figure.axes[0].lines[0].set_visible(False)


def wide_title(figure: Figure) -> None:
    figure.axes[0].set_title(60 * "wide ")


def wide_key(figure: Figure) -> None:
    figure.legend(figure.axes[0].lines, [100 * "w"], loc="outside upper center")


def cut_word(figure: Figure) -> None:
    figure.axes[0].text(0.9, 1.0, "a word cut off", clip_on=True)


def beyond_the_page(figure: Figure) -> None:
    figure.axes[0].annotate("away", (0.5, 1.0), (5000, 0), "data", "offset points").set_in_layout(False)


def crowded_ticks(figure: Figure) -> None:
    figure.axes[0].set_xticks(np.linspace(0, 1, 40))


def titles_that_meet(figure: Figure) -> None:
    figure.axes[0].set_title("A title from the left, long", loc="left")


def nameless(figure: Figure) -> None:
    figure.axes[0].set_xlabel("")


def without_unit(figure: Figure) -> None:
    figure.axes[0].set_ylabel("share")


def unit_amid(figure: Figure) -> None:
    figure.axes[0].set_ylabel("share (kg) of all")


def faint_line(figure: Figure) -> None:
    figure.axes[0].lines[0].set_color(shade(0.3))


def thin_line(figure: Figure) -> None:
    figure.axes[0].lines[0].set_alpha(0.3)


def faint_word(figure: Figure) -> None:
    figure.axes[0].xaxis.label.set_color(shade(0.3))


def spilled_legend(figure: Figure) -> None:
    axis = figure.axes[0]
    axis.legend(list(axis.lines) * 6, ["a pendulum"] * 6, ncols=6, loc="upper right").set_in_layout(False)


def tall_legend(figure: Figure) -> None:
    axis = figure.axes[0]
    axis.legend(list(axis.lines) * 12, ["a rather long name"] * 12)


def legend_on_a_curve(figure: Figure) -> None:
    axis = figure.axes[0]
    axis.lines[0].set_data(np.linspace(0, 1, 50), np.linspace(0, 2, 50))
    axis.legend(loc="upper right")


def legend_on_others(figure: Figure) -> None:
    figure.set_layout_engine("none")
    figure.axes[0].set_position((0.2, 0.2, 0.7, 0.3))
    axis = figure.add_axes((0.2, 0.55, 0.7, 0.35))
    axis.plot([0.0, 1.0], [0.0, 1.0], color=ink(), label="a line")
    axis.legend(loc="upper right", bbox_to_anchor=(1.0, 0.1))


def tall_key(figure: Figure) -> None:
    figure.legend(list(figure.axes[0].lines) * 12, ["a rather long name in a figure"] * 12, loc="lower center")


WRONG = {
    spilled_legend: ["the legend leaves its axes"],
    tall_legend: ["takes more than its share"],
    legend_on_a_curve: ["upon a curve"],
    legend_on_others: ["upon other axes"],
    tall_key: ["legend of the figure takes more than its share"],
    empty: ["nothing is drawn"],
    beyond: ["nothing is drawn"],
    beside: ["nothing is drawn"],
    impossible: ["nothing is drawn"],
    only_marked: ["nothing is drawn"],
    unseen: ["nothing is drawn"],
    wide_title: ["leaves the page"],
    wide_key: ["leaves the page"],
    cut_word: ["is clipped"],
    beyond_the_page: ["leaves the page"],
    crowded_ticks: ["upon each other"],
    titles_that_meet: ["upon each other"],
    nameless: ["label '' of x ends in no unit"],
    without_unit: ["label 'share' of y ends in no unit"],
    unit_amid: ["of y ends in no unit"],
    faint_line: ["stands out only"],
    thin_line: ["stands out only"],
    faint_word: ["stands out only"],
}


@pytest.mark.parametrize("name", THEMES)
def test_a_good_figure_passes(name: str) -> None:
    with theme(name):
        assert flaws(good()) == []


@pytest.mark.parametrize("spoil", WRONG, ids=lambda spoil: spoil.__name__)
def test_a_wrong_figure_is_found_out(spoil: Callable[[Figure], None]) -> None:
    """Whatever else may then be wrong, this is named."""
    with theme("light"):
        figure = good()
        spoil(figure)
    (words,) = WRONG[spoil]
    assert any(words in problem for problem in flaws(figure))


def test_what_is_quiet_on_purpose_or_says_why_it_is_empty_is_no_flaw() -> None:
    with theme("light"):
        figure = good()
        faint_line(figure)
        figure.axes[0].lines[0].set_gid(QUIET)
        assert flaws(figure) == []
        empty(figure)
        figure.axes[0].text(0.5, 0.5, "too few samples", transform=figure.axes[0].transAxes, ha="center")
        assert flaws(figure) == []


def test_a_hidden_curve_is_found_out() -> None:
    """One of the same width, colour apart; not one that shows next to it or in its gaps."""
    x = np.linspace(0, 10, 200)
    with theme("light"):
        figure = sheet(4.0, 3.0)
        axis = figure.subplots()
        for k in range(2):
            axis.plot(x, np.sin(x), color=colour(k), lw=2.0, label=f"curve {k}")
        (problem,) = hidden_curves(figure)
        assert "curve 0 is hidden" in problem
        axis.lines[1].set_linestyle((0, (3, 3)))
        assert hidden_curves(figure) == []


def test_contrast_is_that_of_the_guidelines() -> None:
    """Black on white 21:1, and the grey #767676 the lightest that reaches 4.5:1."""
    assert contrast("black", "white") == pytest.approx(21.0)
    assert contrast("#767676", "white") > 4.5 > contrast("#777777", "white")
    assert contrast((0, 0, 0, 0), "white") == 1.0


# ------------------------------------------------------------------------------------------------------ the styles

DICHROMATS = {
    "protan": [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]],
    "deutan": [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]],
    "tritan": [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.303900]],
}
"""Linear RGB as seen without one kind of cone (Machado, Oliveira and Fernandes 2009, table 1, severity 1.0)."""


def lab(linear: np.ndarray) -> np.ndarray:
    """CIE L*a*b* of linear sRGB, white D65."""
    xyz = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])
    parts = xyz @ np.clip(linear, 0, 1) / [0.9505, 1.0, 1.089]
    f = np.where(parts > 0.008856, np.cbrt(parts), 7.787 * parts + 16 / 116)
    return np.array([116 * f[1] - 16, 500 * (f[0] - f[1]), 200 * (f[1] - f[2])])


def linear(colour: str) -> np.ndarray:
    rgb = np.array(mpl.colors.to_rgb(colour))
    return np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)


@pytest.mark.parametrize("name", THEMES)
def test_colours_stand_out_and_are_told_apart_by_everybody(name: str) -> None:
    """Between any two colours at least 12 of ΔE*; about 2 can just be distinguished next to each other."""
    with theme(name):
        colours = [colour(k) for k in range(HUES)]
        assert all(contrast(colour, paper()) >= LEAST for colour in colours)
        assert min(contrast(ink(), paper()), contrast(secondary_colour(), paper())) >= 4.5
        assert paper() == mpl.colors.to_hex(mpl.rcParams["figure.facecolor"])
    for matrix in (np.eye(3), *map(np.array, DICHROMATS.values())):
        seen = [lab(matrix @ linear(colour)) for colour in colours]
        assert min(np.linalg.norm(a - b) for a, b in combinations(seen, 2)) > 12


def test_of_curves_that_coincide_the_lower_one_shows_on_both_sides_of_the_upper() -> None:
    widths = [thickness(k) for k in range(HUES)]
    assert min(np.diff(widths[::-1])) > 0.25
    assert widths[-1] == thickness(HUES) > 0.9


def test_the_themes_differ_in_colours_only() -> None:
    light, dark = ((STYLES / f"{name}.mplstyle").read_text().partition("# The same")[2] for name in THEMES)
    assert light == dark != ""
    named = re.findall(r"^(\S*color): (.*)", light, re.MULTILINE)
    assert set(named) == {("savefig.facecolor", "auto"), ("savefig.edgecolor", "auto")}


KINDS = ("bode", "shapes of a crane", "run of one", "claim of carts", "map")[: usually(2, 5)]


@pytest.mark.parametrize("name", usually(THEMES[1:], THEMES))
def test_a_style_is_found_by_its_name_and_makes_all_figures_alike(name: str) -> None:
    with style.context(f"modal.plotting.{name}"):
        figures = [FIGURES[kind]() for kind in KINDS]
        sizes = mpl.rcParams["axes.titlesize"], mpl.rcParams["axes.labelsize"]
    for figure in figures:
        figure.canvas.draw()
        assert figure.get_suptitle()
        for axis in figure.axes:
            assert {axis.xaxis.label.get_fontsize(), axis.yaxis.label.get_fontsize()} == {sizes[1]}
            assert axis.title.get_fontsize() == sizes[0]
            assert axis.title.get_fontfamily() == ["sans-serif"]
        assert {text.get_fontsize() for text in [figure._suptitle]} == {12.0}


@pytest.mark.parametrize("name", THEMES)
@pytest.mark.parametrize("form", ["png", "svg", "pdf"])
def test_a_picture_keeps_its_theme_wherever_it_is_written(name: str, form: str) -> None:
    with theme(name):
        figure, plain = good(), paper()
        within = written(figure, form)
    outside = written(figure, form)
    assert {"png": b"\x89PNG", "svg": b"<?xml", "pdf": b"%PDF"}[form] == outside[: 5 if form == "svg" else 4]
    if form == "svg":
        assert f"fill: {plain}".encode() in outside
        assert set(re.findall(rb"#[0-9a-f]{6}", outside)) == set(re.findall(rb"#[0-9a-f]{6}", within))
    if form == "png":
        assert mpl.colors.to_hex(np.array(Image.open(BytesIO(outside)).convert("RGB"))[1, 1] / 255) == plain


def written(figure: Figure, form: str) -> bytes:
    stream = BytesIO()
    save(figure, stream, form)
    return stream.getvalue()


def test_a_notebook_shows_a_figure_once() -> None:
    """Pyplot, which would show it again, does not know it; without pyplot it is a picture all the same."""
    from matplotlib import pyplot

    with theme("dark"):
        figure = good()
    assert pyplot.get_fignums() == []
    picture = np.array(Image.open(BytesIO(figure._repr_png_())).convert("RGB"))
    assert picture.shape == (330, 440, 3)


@pytest.fixture(autouse=True)
def _no_figure_of_pyplot() -> Iterator[None]:
    yield
    assert "matplotlib.pyplot" not in __import__("sys").modules or not mpl.pyplot.get_fignums()


def test_a_figure_is_written_in_both_themes(tmp_path: Path) -> None:
    in_both_themes(lambda: sheet(1, 1), tmp_path / "a.png")
    corners = [Image.open(tmp_path / name).convert("RGB").getpixel((1, 1)) for name in ("a.png", "a-dark.png")]
    assert corners == [(255, 255, 255), (0x12, 0x18, 0x1D)]


@pytest.mark.parametrize("name", usually(THEMES[1:], THEMES))
def test_the_commands_draw_in_the_theme_they_are_told(name: str, tmp_path: Path) -> None:
    paper_of = {"light": "#ffffff", "dark": "#12181d"}[name]
    before = dict(mpl.rcParams)
    picture, film, drawing = (tmp_path / file for file in ("shapes.png", "film.html", "bode.svg"))
    assert main(["shapes", "chain-1", "-o", str(picture), "--theme", name]) == 0
    assert mpl.colors.to_hex(np.array(Image.open(picture).convert("RGB"))[1, 1] / 255) == paper_of
    assert main(["animate", "chain-1", "--duration", "0.1", "-o", str(film), "--theme", name]) == 0
    assert f"background: {paper_of}" in film.read_text(encoding="utf-8")
    assert main(["response", "chain-1", "-o", str(drawing), "--theme", name]) == 0
    assert f"fill: {paper_of}" in drawing.read_text(encoding="utf-8")
    assert dict(mpl.rcParams) == before
