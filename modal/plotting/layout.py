"""Common elements of every figure: title, caption, key, labels, plain logarithmic ticks, mode numbers.

Also the positions of pendula that are drawn next to each other.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from textwrap import fill
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.cm import ScalarMappable
from matplotlib.colorbar import Colorbar
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties
from matplotlib.legend import Legend
from matplotlib.text import Text
from matplotlib.ticker import LogLocator, NullFormatter
from matplotlib.transforms import Bbox

from modal.plotting.style import MARKED, Picture, any_letters, secondary_colour
from modal.report import entitled, visible
from modal.scene import Scene, number_label
from modal.scene.parameters import Variation
from modal.types import Floats, Ints

SMALL = "small"
"""The size of words inside axes, relative to the style's."""
NUMBER = "–"
"""The unit of dimensionless quantities."""
BREADTH = 0.92
"""Format: largest width of titles, captions and keys over the figure's; words differ in width with the resolution."""
HEADLINE_LINES = 3
"""Format: most lines of a headline; a longer title of a scene is shortened."""
NAME_LETTERS = 64
"""Format: most letters of a name in a legend."""
TICKS_MAX = 12
"""Format: most numbers along an axis whose ticks are modes or whole numbers."""
OBLIQUE = 0.5 * np.array([np.cos(np.radians(35)), np.sin(np.radians(35))])
"""Format: how a metre across the rail is drawn, to the right and up: at half its length (cabinet projection)."""
OWN = re.compile(r"ω\$_\{[\w.,]+\}\$")
"""Mathematics of the package's own in a legend; other dollars are letters of a name."""


def headline(figure: Figure, title: str, words: str) -> None:
    """The scene's title and a description, over the whole figure; nothing in it is read as mathematics.

    A title of more than HEADLINE_LINES lines is shortened.
    """
    readable_title = visible(title)
    heading = entitled(readable_title, words) if title else words[:1].upper() + words[1:]
    text = figure.suptitle(heading, parse_math=False)
    _fold(figure, text)
    while text.get_text().count("\n") >= HEADLINE_LINES and len(readable_title) > 1:
        lines = text.get_text().count("\n") + 1
        readable_title = readable_title[
            : min(len(readable_title) - 1, int(1.02 * len(readable_title) * HEADLINE_LINES / lines))
        ].rstrip("… ")
        text.set_text(entitled(f"{readable_title}…", words))
        _fold(figure, text)


def caption(figure: Figure, words: str) -> str:
    """Notes about a figure, below it; the words as they are folded."""
    text = figure.supxlabel(words, fontsize=SMALL, fontweight="normal", color=secondary_colour(), parse_math=False)
    _fold(figure, text)
    return text.get_text()


def _fold(figure: Figure, text: Text) -> None:
    """Wrap a text to the width allowed for titles, in lines of similar length."""
    words = text.get_text()
    letters = len(words)
    with any_letters():
        while (excess := text.get_window_extent().width / (BREADTH * figure.bbox.width)) > 1 and letters > 8:
            letters = min(letters - 1, int(1.1 * letters / excess))
            text.set_text(fill(words, letters))
    if text.get_text() == words:
        return
    lines, longest = text.get_text().count("\n"), max(map(len, words.split()))
    while letters > longest and fill(words, letters - 1).count("\n") == lines:
        letters -= 1
    text.set_text(fill(words, letters))


def key(
    figure: Figure,
    handles: Sequence[Artist],
    names: Sequence[str] | None = None,
    columns: int = 4,
    notes: str = "",
) -> None:
    """A legend below the figure, in at most `columns` columns and as room permits; long names are shortened.

    `notes` stand above it, in place of a caption.
    """
    labels = list(names or [str(handle.get_label()) for handle in handles])
    heading = caption(figure, notes) if notes else ""
    figure.supxlabel("")

    def make(words: list[str], count: int) -> Legend:
        new_legend = figure.legend(handles, words, loc="outside lower center", ncols=count, title=heading)
        new_legend.get_title().set(fontsize=SMALL, color=secondary_colour(), parse_math=False, multialignment="center")
        return new_legend

    _fit_legend(labels, columns, BREADTH * figure.bbox.width, make)


def _fit_legend(labels: list[str], columns: int, room: float, make: Callable[[list[str], int], Legend]) -> Legend:
    """The legend in as few rows as fit into `room` (pixels); nothing in it is read as mathematics."""
    words = [shorten(label) for label in labels]
    rows, letters = -(-len(words) // columns), NAME_LETTERS
    while True:
        count = -(-len(words) // rows)
        new_legend = make(words, count)
        for text in new_legend.get_texts():
            text.set_parse_math(bool(OWN.search(text.get_text())))
        with any_letters():
            fits = new_legend.get_window_extent().width <= room
        if fits or (count == 1 and letters < 6):
            return new_legend
        new_legend.remove()
        if count > 1:
            rows += 1
        else:
            letters -= 4
            words = [shorten(label, letters) for label in labels]


def shorten(name: str, letters: int = NAME_LETTERS) -> str:
    """A name of at most this many letters, its middle omitted where it has more."""
    readable_name = visible(name)
    if len(readable_name) <= letters:
        return readable_name
    half = (letters - 1) // 2
    return f"{readable_name[: letters - 1 - half]}…{readable_name[len(readable_name) - half :]}"


def set_frame(axis: Axes, x_label: str, y_label: str, title: str = "") -> None:
    """Axis labels and title of one of several axes."""
    axis.set(xlabel=x_label, ylabel=y_label)
    axis.set_title(title, loc="left")


def set_values(
    axis: Axes, scene: Scene, variation: Variation, which: str = "x", words: str = "", *, has_limits: bool = True
) -> None:
    """Make an axis one over a number of a scene, from its first value to its last, logarithmic where these are.

    `words` stand below it in place of the name of the number.
    """
    values, side = variation.values, axis.xaxis if which == "x" else axis.yaxis
    if variation.log:
        axis.set(**{f"{which}scale": "log"})
        log_ticks(side, values[-1] / values[0])
    axis.set(**{f"{which}label": words or number_label(scene, variation.path)})
    if has_limits:
        axis.set(**{f"{which}lim": (values[0], values[-1])})


def colour_bar(axis: Axes, mesh: ScalarMappable, words: str) -> Colorbar:
    """The colour bar of a map, next to it."""
    bar = axis.figure.colorbar(mesh, ax=axis, pad=0.02)
    bar.set_label(words)
    bar.outline.set_visible(False)
    axis.grid(visible=False)
    return bar


def legend(axis: Axes, columns: int = 6, title: str | None = None, least_count: int = 2) -> None:
    """A legend in room made above the curves of an axis, as wide as it; none for fewer curves than `least_count`.

    A single one that stands for several, whose name says that they coincide, has a legend.  Columns and room are found
    when the figure is first drawn and the size of the axis is known; a legend never takes room from other axes.
    """
    handles, labels = axis.get_legend_handles_labels()
    if len(labels) < least_count and not any(label.endswith("coincide") for label in labels):
        return

    def make(words: list[str], count: int) -> Legend:
        frame: dict[str, Any] = {"frameon": True, "edgecolor": "none", "borderpad": 0.2, "borderaxespad": 0.2}
        place: dict[str, Any] = {"loc": "upper right", "ncols": count, "title": title, "fontsize": SMALL}
        new_legend = axis.legend(handles, words, **place, **frame)
        new_legend.set_in_layout(False)
        return new_legend

    def fit() -> None:
        _fit_legend(labels, columns, axis.get_window_extent().width, make)
        _raise(axis)

    figure = axis.get_figure()
    if isinstance(figure, Picture):
        make([shorten(label) for label in labels], columns)
        figure.waiting.append(fit)
    else:
        fit()


def _raise(axis: Axes) -> None:
    """Make room above the curves for the legend of an axis."""
    its_legend, scale = axis.get_legend(), axis.yaxis.get_transform()
    assert its_legend is not None
    # A legend of more than half the axis would leave too little of it for the curves: it lies upon them instead.
    part = min(its_legend.get_window_extent().height / axis.get_window_extent().height, 0.5)
    ends = scale.transform(np.array(axis.get_ylim()))
    top = ends[0] + (ends[1] - ends[0]) / (1 - part)
    axis.set_ylim(top=float(scale.inverted().transform(np.array([top]))[0]))


def log_ticks(line: Axis, ratio: float = 1.0) -> None:
    """Plain numbers on a logarithmic axis whose ends have this ratio, more of them where it is small."""
    line.set_major_locator(LogLocator(subs=(1.0,) if np.log10(ratio) > 2 else (1.0, 2.0, 5.0)))
    line.set_major_formatter("{x:g}")
    line.set_minor_formatter(NullFormatter())


def decade_limits(low: float, high: float) -> tuple[float, float]:
    """Limits of a logarithmic axis that span a decade about the same middle, or as much as they do."""
    wider = max((10 * low / high) ** 0.5, 1.0)
    return low / wider, high * wider


def em_of(axis: Axes) -> Floats:
    """The size of small words over the width and over the height of an axis."""
    size = FontProperties(size=SMALL).get_size_in_points() / 72 * axis.figure.dpi
    return np.asarray(size / np.array(axis.get_window_extent().size))


def drop_overlapping(texts: Sequence[Text]) -> None:
    """Remove words that would touch those before them."""
    boxes: list[Bbox] = []
    for text in texts:
        box = text.get_window_extent()
        if box.count_overlaps(boxes):
            text.remove()
        else:
            boxes.append(box)


def mark_modes(axis: Axes, omega: Sequence[tuple[int, float]], *, has_numbers: bool = True) -> None:
    """Dotted lines at modes (number, ω ascending); the numbers of neighbours too close to print apart are joined."""
    groups: list[list[tuple[int, float]]] = []
    share = axis.transData + axis.transAxes.inverted()
    places = [float(share.transform((value, axis.get_ylim()[0]))[0]) for _, value in omega]
    em, last = em_of(axis)[0], -1.0
    for (number, value), place in zip(omega, places, strict=True):
        if place - last > em / 8:  # the width of a line: nearer ones are not seen as two
            axis.axvline(value, color=secondary_colour(), ls=MARKED, lw=0.9, zorder=0)
            last = place
        if groups and place - groups[-1][-1][1] < 3 / 2 * em:
            groups[-1].append((number, place))
        else:
            groups.append([(number, place)])
    for group in groups if has_numbers else ():
        words = f"{group[0][0]}" if len(group) == 1 else f"{group[0][0]}–{group[-1][0]}"
        middle = float(np.mean([group[0][1], group[-1][1]]))
        look: dict[str, Any] = {"ha": "center", "fontsize": SMALL, "annotation_clip": False}
        axis.annotate(words, (middle, 1.0), (0, 3), "axes fraction", "offset points", **look)


def even_choice(count: int, limit: int) -> Ints:
    """The indices, from 0, of the pendula drawn: all, or `limit` of them evenly spaced."""
    return np.unique(np.linspace(0, count - 1, min(count, limit)).astype(np.int64))
