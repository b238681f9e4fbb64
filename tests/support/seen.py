"""What is wrong with a figure as it is seen: empty axes, words cut off or upon each other, missing units, faint ink."""

from __future__ import annotations

import re
from collections.abc import Iterator

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import Collection
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.projections.polar import PolarAxes
from matplotlib.text import Text
from matplotlib.ticker import FixedFormatter, FuncFormatter
from matplotlib.transforms import Bbox

from modal.plotting.style import QUIET

LEAST = 3.0
"""Contrast of words and lines with what is behind them, as the Web Content Accessibility Guidelines count it."""
UNIT = re.compile(r"\(([^()]*(°|rad|m|s|kg|N|J|W|Hz|–|each unit)[^()]*)\)$")
"""How a label ends: in a unit in parentheses, which is a dash for numbers without a dimension."""
SHARE = 0.4
"""Largest part of its axes, or of the page, that a legend takes."""
COVERED = 0.05
"""Largest part of a curve that a legend is upon."""
FRAME = 6.0
"""Pixels by which the frame of a legend may be wider than its axes."""
SEEN, FILLED, CHANGED, DPI = 0.04, 245, 30, 160
"""Least visible part of a curve; opacity of a pixel within it; least change of a pixel; dots an inch."""
SLACK = 1.0
"""Pixels by which boxes of words may overlap or leave the page: they are that much larger than the letters."""


def flaws(figure: Figure) -> list[str]:
    """Everything that is wrong with a figure, in words."""
    figure.draw_without_rendering()
    axes = [axis for axis in figure.axes if axis.get_visible()]
    problems = [f"{_named(axis)}: nothing is drawn within its limits" for axis in axes if not _filled(axis)]
    problems += [problem for axis in axes for problem in _labels(axis)]
    texts = list(_texts(figure))
    problems += [f"{_quoted(text)}: leaves the page" for text in texts if _outside(_box(text), figure.bbox)]
    problems += [f"{_quoted(text)}: is clipped" for text in texts if _clipped(text)]
    problems += [f"{_quoted(first)} and {_quoted(two)}: upon each other" for first, two in _upon(texts)]
    problems += list(_legends(figure, axes))
    return problems + [problem for axis in axes for problem in _faint_lines(axis)] + _faint_words(figure, texts)


def hidden_curves(figure: Figure) -> list[str]:
    """Curves that could be omitted with hardly a pixel changed, because others are drawn upon them.

    Pieces of one curve, of one colour and one label but for leading underscores, count as one.
    """
    figure.draw_without_rendering()
    figure.set_layout_engine("none")
    figure.set_dpi(DPI)
    canvas = FigureCanvasAgg(figure)
    renderer, hidden = canvas.get_renderer(), []  # type: ignore[no-untyped-call]

    def pixels(lines: list[Line2D]) -> np.ndarray:
        renderer.clear()
        for line in sorted(lines, key=Artist.get_zorder):
            line.draw(renderer)
        return np.asarray(renderer.buffer_rgba())[rows, columns].astype(np.int16)

    for axis in figure.axes:
        (left, low), (right, high) = np.clip(np.rint(axis.get_window_extent().get_points()), 0, None).astype(int)
        rows, columns = (
            slice(max(canvas.get_width_height()[1] - high, 0), canvas.get_width_height()[1] - low),
            slice(left, right),
        )
        lines = [line for line in axis.lines if line.get_visible() and _placed(line, axis)]
        curves: dict[tuple[str, object], list[Line2D]] = {}
        for line in lines:
            if line.get_gid() != QUIET and len(line.get_xydata()):
                curves.setdefault((str(line.get_label()).lstrip("_"), line.get_color()), []).append(line)
        whole = pixels(lines)
        for (label, _), strokes in curves.items():
            filled = pixels(strokes)[..., 3] > FILLED
            rest = [line for line in lines if line not in strokes]
            changed = np.abs(pixels(rest) - whole).max(-1) > CHANGED
            if (changed & filled).sum() < SEEN * filled.sum():
                hidden.append(f"{_named(axis)}: {label} is hidden under other curves")
    return hidden


def _legends(figure: Figure, axes: list[Axes]) -> Iterator[str]:
    """Legends outside their axes or the page, too large, or upon curves."""
    for axis in axes:
        if (made := axis.get_legend()) and made.get_visible():
            box, window = made.get_window_extent(), axis.get_window_extent()
            if box.x0 < window.x0 - FRAME or box.x1 > window.x1 + FRAME or _outside(box, figure.bbox):
                yield f"{_named(axis)}: the legend leaves its axes"
            if any(Bbox.intersection(box, other.get_window_extent()) for other in axes if other is not axis):
                yield f"{_named(axis)}: the legend is upon other axes"
            if box.width * box.height > SHARE * window.width * window.height:
                yield f"{_named(axis)}: the legend takes more than its share"
            if any(_covered(line, box, window) > COVERED for line in axis.lines if _placed(line, axis)):
                yield f"{_named(axis)}: the legend is upon a curve"
    for made in figure.legends:
        box = made.get_window_extent()
        if _outside(box, figure.bbox):
            yield "the legend of the figure leaves the page"
        if box.width * box.height > SHARE * figure.bbox.width * figure.bbox.height:
            yield "the legend of the figure takes more than its share"


def _covered(line: Line2D, box: Bbox, window: Bbox) -> float:
    """The part of a curve's points within its axes that is under a box."""
    points = line.get_transform().transform(np.asarray(line.get_xydata(), dtype=float))
    seen = points[np.isfinite(points).all(1)]
    within, under = (((seen > area.min) & (seen < area.max)).all(1).sum() for area in (window, box))
    return float(under / within) if line.get_visible() and within else 0.0


# -------------------------------------------------------------------------------------------------------- words


def _texts(artist: Artist) -> Iterator[Text]:
    """Every text that is drawn: of ticks those within the limits, of axes that are off none but the titles."""
    if not artist.get_visible():
        return
    if isinstance(artist, Text) and artist.get_text().strip() and _box(artist).width > 0:
        yield artist
    if isinstance(artist, Axis):
        yield from (text for part in (artist.label, artist.offsetText) for text in _texts(part))
        yield from _tick_labels(artist)
        return
    hidden = (artist.xaxis, artist.yaxis) if isinstance(artist, Axes) and not artist.axison else ()
    for child in artist.get_children():
        if child not in hidden:
            yield from _texts(child)


def _tick_labels(axis: Axis) -> Iterator[Text]:
    low, high = np.sort(axis.get_transform().transform(np.array(axis.get_view_interval(), dtype=float)))
    room = 1e-9 * (high - low)
    for tick in [*axis.get_major_ticks(), *axis.get_minor_ticks()]:
        place = axis.get_transform().transform(np.array([tick.get_loc()], dtype=float))[0]
        if tick.get_visible() and low - room <= place <= high + room:
            yield from (text for label in (tick.label1, tick.label2) for text in _texts(label))


def _box(text: Text) -> Bbox:
    return text.get_window_extent()


def _outside(box: Bbox, page: Bbox) -> bool:
    return bool(np.any(box.min < page.min - SLACK) or np.any(box.max > page.max + SLACK))


def _clipped(text: Text) -> bool:
    return bool(text.get_clip_on() and text.get_clip_box() is not None and _outside(_box(text), text.get_clip_box()))


def _upon(texts: list[Text]) -> list[tuple[Text, Text]]:
    boxes = np.array([_box(text).extents for text in texts]).reshape(-1, 4)
    low, high = (np.stack([boxes[:, side]] * len(texts)) for side in ([0, 1], [2, 3]))
    common = np.minimum(high, high.swapaxes(0, 1)) - np.maximum(low, low.swapaxes(0, 1))
    return [(texts[k], texts[m]) for k, m in np.argwhere(common.min(axis=-1) > SLACK) if k < m]


def _quoted(text: Text) -> str:
    return repr(text.get_text().replace("\n", " / "))


# ------------------------------------------------------------------------------------------------------- labels


def _named(axis: Axes) -> str:
    words = [axis.get_title(loc) for loc in ("left", "center", "right")] + [axis.get_xlabel(), axis.get_ylabel()]  # type: ignore[arg-type]
    return next((word for word in words if word), "an axis without words")


def _labels(axis: Axes) -> Iterator[str]:
    """Numbers along an axis need a label that ends in a unit; a title at the left end may stand for that of y."""
    if not axis.axison:
        return
    if isinstance(axis, PolarAxes):
        if not UNIT.search(axis.get_title()):
            yield f"{_named(axis)}: the title tells no unit of the radius"
        return
    for line, others in ((axis.xaxis, ()), (axis.yaxis, (axis.get_title("left"),))):
        named = isinstance(line.get_major_formatter(), FixedFormatter | FuncFormatter)
        numbers = [] if named else [text for text in _tick_labels(line) if re.match(r"[\d−$.+-]", text.get_text())]
        words = [line.get_label_text(), *others]
        if numbers and not any(UNIT.search(word) for word in words):
            yield f"{_named(axis)}: the label {words[0]!r} of {line.axis_name} ends in no unit"


# -------------------------------------------------------------------------------------------------------- curves


def _filled(axis: Axes) -> bool:
    """Whether there is a curve, an area, a point or an image within the limits, or words that say why there is not."""
    drawn = [part for part in axis.get_children() if part.get_visible() and part is not axis.patch]
    excuses = [text for text in axis.texts if text.get_transform() == axis.transAxes and text.get_text()]
    return bool(excuses) or any(_within(part, axis) for part in drawn)


def _within(part: Artist, axis: Axes) -> bool:
    window = axis.get_window_extent()
    if isinstance(part, AxesImage):
        return bool(part.get_array() is not None and part.get_window_extent().overlaps(window))
    if isinstance(part, Line2D) and _placed(part, axis):
        path = part.get_transform().transform_path(part.get_path()).cleaned(remove_nans=True)
        points = path.vertices[:-1]
        inside = (points > window.min - 1) & (points < window.max + 1)
        crosses = part.get_linestyle() != "None" and len(points) > 1 and path.intersects_bbox(window, filled=False)
        return bool(np.any(inside.all(axis=1)) or crosses)
    if isinstance(part, Collection) and _placed(part, axis, offsets=len(part.get_offsets()) > 1):
        return part.get_window_extent().overlaps(window)
    placed = isinstance(part, Patch) and _placed(part, axis)
    return placed and part.get_window_extent().overlaps(window)


def _placed(part: Artist, axis: Axes, *, offsets: bool = False) -> bool:
    """Whether a part stands where its data say in both directions, unlike lines across the whole axis."""
    transform = part.get_offset_transform() if offsets and isinstance(part, Collection) else part.get_transform()
    return all(transform.contains_branch_seperately(axis.transData))


# ----------------------------------------------------------------------------------------------------- contrast


def contrast(colour: object, two: object) -> float:
    """(L₁ + 0.05)/(L₂ + 0.05) of the lighter over the darker, L the relative luminance of a colour on another."""
    behind = np.array(to_rgba(two)[:3])  # type: ignore[arg-type]
    *rgb, alpha = to_rgba(colour)  # type: ignore[arg-type]
    light = sorted(map(_luminance, (behind, alpha * np.array(rgb) + (1 - alpha) * behind)))
    return (light[1] + 0.05) / (light[0] + 0.05)


def _luminance(rgb: np.ndarray) -> float:
    linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
    return float(linear @ (0.2126, 0.7152, 0.0722))


def _faint_lines(axis: Axes) -> Iterator[str]:
    for line in axis.lines:
        if line.get_visible() and line.get_gid() != QUIET and len(line.get_xydata()):
            best = max((contrast(colour, axis.get_facecolor()) for colour in _colours(line)), default=LEAST)
            if best < LEAST:
                yield f"{_named(axis)}: a line in {line.get_color()} stands out only {best:.2f}:1"


def _colours(line: Line2D) -> Iterator[object]:
    """What a line is drawn in, its transparency with it."""
    alpha = line.get_alpha()
    stroke = [line.get_color()] if line.get_linestyle() != "None" and line.get_linewidth() > 0 else []
    dots = [line.get_markeredgecolor(), line.get_markerfacecolor()] if line.get_marker() not in ("None", "") else []
    for colour in [*stroke, *dots]:
        if isinstance(colour, str) and colour == "none":
            continue
        yield to_rgba(colour, alpha)


def _faint_words(figure: Figure, texts: list[Text]) -> list[str]:
    faint = []
    for text in texts:
        behind = text.axes.get_facecolor() if text.axes else figure.get_facecolor()
        if (best := contrast(to_rgba(text.get_color(), text.get_alpha()), behind)) < LEAST:
            faint.append(f"{_quoted(text)}: stands out only {best:.2f}:1")
    return faint
