"""Figures that keep the style in which they were created, output of figures, and colours by their meaning.

Colours come from the matplotlib style in force: its cycle, and mixtures of its ink and paper.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from io import BytesIO
from pathlib import Path
from typing import IO, Any

import numpy as np
from matplotlib import rc_context, rcParams, rcParamsDefault, style
from matplotlib.axes import Axes
from matplotlib.backend_bases import RendererBase
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_hex, to_rgb
from matplotlib.figure import Figure

from modal.report import deferred
from modal.types import Floats

WIDTH = 8.0
"""Format: width in inches of a figure of one column of panels, in both styles."""
WIDE = 10.5
"""Format: width in inches of a figure of several columns."""
HEAD = 1.2
"""Format: inches of a figure's height for its title, its caption or key, and the labels below its panels."""
ROW = 2.4
"""Format: inches of a figure's height for a row of panels; a panel alone has one and a half."""
KEPT = ("axes", "figure", "font", "grid", "hatch", "lines", "mathtext", "patch", "savefig", "text", "xtick", "ytick")
"""Groups of settings that a picture keeps: matplotlib creates ticks only when a figure is drawn."""
HUES = 6
"""Format: colours of the cycle; curves drawn next to each other where a panel has many."""
CURVE_POINTS = 6000
"""Format: points along a curve, so that a hundred swings have no corners."""
SOLVED_POINTS = 200
"""Cost: points along a smooth curve each of which is an eigenvalue problem (`benchmarks/forms.py` for one of them)."""
BAND_OPACITY = 0.2
"""Format: opacity of a band, through which curves and the grid are seen."""
VISIBLE_SHARE = 1e-6
"""Format: share of the largest below which nothing is drawn: six decades, more than any axis here shows."""
LOG_RATIO = 30.0
"""Format: ratio of largest to smallest from which a scale is logarithmic."""
COMPUTED = "-"
"""The line of the model's or measured values: solid."""
PREDICTED = "--"
"""The line of a simpler theory, for comparison (small angles, κ, averaged equations, regular motion): dashed."""
MARKED = ":"
"""The line of a value, of an instant or of a construction, where there is no curve: dotted."""
UNSTABLE = "-."
"""The line of a motion that exists and does not last: dash-dotted.

These four mean the same in every figure, and a test reads that no module of figures writes another.  Curves that need
telling apart differ in colour, then in `spots`, never in dashes.  Two curves on one place are stripes of both colours
without a gap: see `draw_curves`.
"""
SPOTS = ("", "o", "s")
MOST_CURVES = HUES * len(SPOTS)
"""Most curves that can be distinguished on one axis."""
QUIET = "quiet"
"""The gid of deliberately faint elements: an equilibrium position, a broad band."""


class Picture(Figure):
    """A figure that is always drawn in the style in which it was made; notebooks show it as the last line of a cell."""

    def __init__(self, width: float, height: float) -> None:
        super().__init__(figsize=(width, height), layout="constrained")
        FigureCanvasAgg(self)
        self.style = {name: value for name, value in rcParams.items() if name.partition(".")[0] in KEPT}
        self.waiting: list[Callable[[], None]] = []

    def draw(self, renderer: RendererBase) -> None:
        """Draw, whatever the style in force; first what is `waiting` for the sizes of the axes."""
        with rc_context(self.style), any_letters():
            waiting, self.waiting = self.waiting, []
            if waiting and (engine := self.get_layout_engine()):
                engine.execute(self)
            for fit in waiting:
                fit()
            super().draw(renderer)

    def _repr_png_(self) -> bytes:
        buffer = BytesIO()
        self.savefig(buffer, format="png", dpi=self.dpi)
        return buffer.getvalue()


def sheet(width: float, height: float) -> Picture:
    """An empty picture (inches) in the style in force."""
    return Picture(width, height)


def sheet_of_rows(rows: float, width: float = WIDTH) -> Picture:
    """An empty picture as high as this many rows of panels need; one panel alone has one and a half."""
    return Picture(width, HEAD + ROW * max(rows, 3 / 2))


def stack(count: int, rows: float | None = None, width: float = WIDTH, **options: Any) -> tuple[Picture, list[Axes]]:
    """A picture of this many panels below each other, as high as `rows` of them, with the `options` of subplots."""
    figure = sheet_of_rows(count if rows is None else rows, width)
    return figure, figure.subplots(count, 1, squeeze=False, **options)[:, 0].tolist()


def theme(name: str) -> AbstractContextManager[None]:
    """One of the package's own styles, "light" or "dark", independent of any other settings."""
    return style.context(f"modal.plotting.{name}", after_reset=True)


def figure_at(place: str, *arguments: Any, theme: str = "", **options: Any) -> Figure:
    """The figure that the function at `module:name` draws in a theme, by default in the style in force.

    Where no style was chosen, and matplotlib's own is in force, that is the light theme.
    """
    is_own = rcParams["axes.prop_cycle"] == rcParamsDefault["axes.prop_cycle"]
    with style.context(f"modal.plotting.{theme or 'light'}", after_reset=True) if theme or is_own else nullcontext():
        figure: Figure = deferred(place)(*arguments, **options)
    return figure


def save(figure: Figure, stream: IO[bytes], form: str) -> None:
    """Write a figure as png, svg or pdf: the same bytes for the same figure."""
    metadata = {"svg": {"Date": None}, "pdf": {"CreationDate": None}}
    with any_letters(), rc_context({"svg.hashsalt": "multipendula"}):
        figure.savefig(stream, format=form, metadata=metadata.get(form))


def in_both_themes(draw: Callable[[], Figure], path: Path) -> None:
    """Write what `draw` returns in light and dark versions: NAME.png and NAME-dark.png."""
    for name, file in (("light", path), ("dark", path.with_stem(f"{path.stem}-dark"))):
        with theme(name), file.open("wb") as stream:
            save(draw(), stream, file.suffix.removeprefix("."))


@contextmanager
def any_letters() -> Iterator[None]:
    """Letters missing from the font are drawn as boxes, without a warning."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Glyph .* missing from ")
        yield


def colour(k: int) -> str:
    """The colour of curve k, from 0."""
    cycle = rcParams["axes.prop_cycle"].by_key().get("color", [ink()])
    return to_hex(cycle[k % HUES % len(cycle)])


def spots(k: int, values: Floats | None = None) -> dict[str, Any]:
    """The style of the sparse hollow marks of curve k: none, circles, squares, another each time the colours repeat.

    None either where none of the `values` is finite: matplotlib cannot space marks along nothing.
    """
    is_drawn = values is None or np.isfinite(values).any()
    marker = SPOTS[k // HUES % len(SPOTS)] if is_drawn else ""
    spacing = (0.02 * (k % HUES), 0.14)
    return {"marker": marker, "ms": 4.5, "mfc": paper(), "mew": 1.1, "markevery": spacing} if marker else {}


def dashes_of_prediction(k: int) -> tuple[float, tuple[float, float]]:
    """The dashes of prediction k: of two on one place each shows in the gaps of the other."""
    dash = rcParams["lines.dashed_pattern"][0]
    return (dash * (k % 2), (dash, dash))


def dot_size(count: int) -> float:
    """The width of each of so many dots in points, so that few are seen and many are not upon each other."""
    return float(np.clip(4000 / max(count, 1), 2, 6))


def thickness(k: int, first: float = 2.3) -> float:
    """The width of curve k in points, each thinner than the previous one, so that coinciding curves both show."""
    return first * (1 - 0.12 * min(k, HUES - 1))


def narrowing(k: int) -> float:
    """The width of curve k in points where dashes have a meaning: a wider one shows next to those upon it."""
    return 4.2 * 0.7 ** min(k, HUES - 1)


def shade(part: float) -> str:
    """A mixture of ink and paper: 1 is ink, 0 is paper."""
    ink_colour, plain = (np.array(to_rgb(rcParams[name])) for name in ("text.color", "axes.facecolor"))
    return to_hex(tuple((part * ink_colour + (1 - part) * plain).tolist()))


def mixture(hue: str, part: float) -> str:
    """A mixture of a colour and paper: 1 is the colour, 0 is paper."""
    hue_colour, plain = (np.array(to_rgb(end)) for end in (hue, paper()))
    return to_hex(tuple((part * hue_colour + (1 - part) * plain).tolist()))


def ink() -> str:
    """The colour of words and axes."""
    return shade(1.0)


def paper() -> str:
    """The background colour."""
    return shade(0.0)


def secondary_colour() -> str:
    """The colour of secondary marks and captions, still easy to read."""
    return shade(0.68)


def rest() -> str:
    """The colour of background elements: equilibrium positions, bands, hatching."""
    return shade(0.27)
