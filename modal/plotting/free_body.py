"""Free-body diagrams: every part of a scene with its weight, the forces and moments of its joints, and its inertia.

Paper 000, figures 2 and 4 to 7: the whole scene with the forces from outside, the cart with its wheels, each pendulum
as a whole, and each link.  The strokes of `free_body_diagrams` are drawn by matplotlib, or as TikZ, whose text LaTeX
sets.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import hypot
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, FancyArrowPatch, Rectangle

from modal.plotting.free_body_diagrams import (
    HIGH,
    LEFT_EDGE,
    LINK_INCHES,
    LOOKS,
    RIGHT_EDGE,
    Diagram,
    Lettering,
    Stroke,
    diagrams,
    point,
)
from modal.plotting.layout import SMALL, caption, headline
from modal.plotting.style import HEAD, QUIET, colour, ink, mixture, paper, secondary_colour, sheet, theme
from modal.scene import FreeBodies, Scene, free_bodies, title_of
from modal.scene.doors import checked
from modal.scene.free_body import normal

COLUMNS = 3
"""Format: diagrams in a row."""

# ------------------------------------------------------------------------------------------------------- the door


@checked
def plot_free_body(scene: Scene, *, letters: str = "own", parts: str = "") -> Figure:
    """The free-body diagrams of a scene's parts, the support first, then link by link.

    `letters` are the toolkit's "own", or those of paper 000, "paper"; `parts` "1:8" chooses, counted from 1, else at
    most MOST_PARTS are drawn. Raise SceneError for scenes that are not taken apart, and for a wrong choice.

    >>> from modal import load
    >>> from modal.plotting import plot_free_body
    >>> figure = plot_free_body(load("paper-cart-1"), letters="paper")
    >>> [axis.get_title(loc="left") for axis in figure.axes]
    ['whole scene', 'cart', 'pendulum 1', 'link 1', 'link 2']
    """
    bodies = free_bodies(scene, letters)
    pictures, note = diagrams(bodies, parts)
    rows = _rows(pictures)
    width, height = RIGHT_EDGE - LEFT_EDGE, 2 * HIGH
    figure = sheet(LINK_INCHES * width * COLUMNS, LINK_INCHES * height * len(rows) + HEAD)
    grid = figure.add_gridspec(len(rows), COLUMNS)
    for k, row in enumerate(rows):
        at = 0
        for diagram in row:
            axis = figure.add_subplot(grid[k, at : at + diagram.columns])
            middle, half = (LEFT_EDGE + RIGHT_EDGE) / 2, width * diagram.columns / 2
            axis.set(xlim=(middle - half, middle + half), ylim=(-HIGH, HIGH), aspect="equal")
            axis.set_axis_off()
            axis.set_title(diagram.title, loc="left")
            for stroke in diagram.strokes:
                _draw(axis, stroke)
            for words in diagram.words:
                _write(axis, words)
            at += diagram.columns
    headline(figure, title_of(scene), "free-body diagrams")
    caption(figure, f"{_caption_words(bodies)}{note}")
    return figure


def free_body_tikz(scene: Scene, letters: str = "own", parts: str = "") -> str:
    r"""The same diagrams as a TikZ picture, as wide as a line of LaTeX's article, for a document with the package tikz.

    >>> from modal import load
    >>> print(free_body_tikz(load("chain-2")).splitlines()[0])
    \definecolor{fbbody}{HTML}{005F9E}
    """
    bodies = free_bodies(scene, letters)
    pictures, _ = diagrams(bodies, parts)
    with theme("light"):
        hues = {look: _hue(look).removeprefix("#").upper() for look in LOOKS}
    lines = [rf"\definecolor{{fb{look}}}{{HTML}}{{{hue}}}" for look, hue in hues.items()]
    unit = 10.9 / (2 * (RIGHT_EDGE - LEFT_EDGE))  # cm: two diagrams and their letters fill a line of the article class
    style = rf"x={unit:.3f}cm, y={unit:.3f}cm, line cap=round, >=stealth, font=\footnotesize"
    lines.append(rf"\begin{{tikzpicture}}[{style}]")
    for k, row in enumerate(_rows(pictures, 2)):
        at = 0
        for diagram in row:
            shift = (
                at * (RIGHT_EDGE - LEFT_EDGE) + (diagram.columns - 1) * (RIGHT_EDGE - LEFT_EDGE) / 2,
                -k * (2 * HIGH + 0.5),
            )
            lines.append(rf"\begin{{scope}}[shift={{({shift[0]:.3f},{shift[1]:.3f})}}]")
            lines.append(rf"\node[right] at ({LEFT_EDGE:.3f},{HIGH + 0.2:.3f}) {{{diagram.title}}};")
            lines += [_tikz(stroke) for stroke in diagram.strokes]
            lines += [
                rf"\node[{_ANCHORS[lettering.side]}inner sep=1pt, text=fb{lettering.look}] "
                rf"at ({lettering.x:.3f},{lettering.y:.3f}) {{{lettering.text}}};"
                for lettering in diagram.words
            ]
            lines.append(r"\end{scope}")
            at += diagram.columns
    return "\n".join([*lines, r"\end{tikzpicture}", ""])


_ANCHORS = {"center": "", "left": "anchor=east, ", "right": "anchor=west, "}


def _caption_words(bodies: FreeBodies) -> str:
    down = bodies.downward
    words = (
        f"x along the rail, {down} down. Green: joints, equal and opposite on the adjoining part; "
        f"red: forces from outside; pink: the mass times acceleration that they cause."
    )
    if bodies.support.kind == "cart":
        R = normal(bodies.letters)
        words += f" The wheels share {R} = {R}1 + {R}2."
    return words


def _rows(pictures: Sequence[Diagram], columns: int = COLUMNS) -> list[list[Diagram]]:
    """Diagrams in rows of this many columns; the links of a pendulum begin a row where they fit into one."""
    several = sum(diagram.title.startswith("pendulum") for diagram in pictures) > 1
    rows: list[list[Diagram]] = [[]]
    for diagram in pictures:
        begins = several and diagram.title.startswith("pendulum")
        if rows[-1] and (begins or sum(neighbour.columns for neighbour in rows[-1]) + diagram.columns > columns):
            rows.append([])
        rows[-1].append(diagram)
    return rows


# ------------------------------------------------------------------------------------------------- with matplotlib


def _hue(look: str) -> str:
    hues = {
        "body": colour(0),
        "faint": mixture(colour(0), 0.3),
        "force": colour(4),
        "joint": colour(2),
        "inertia": colour(3),
        "guide": secondary_colour(),
        "ink": ink(),
    }
    return hues[look]


def _draw(axis: Axes, stroke: Stroke) -> None:
    hue, points = _hue(stroke.look), stroke.points
    if stroke.kind == "line":
        dash = "--" if stroke.is_dashed else "-"
        faint: dict[str, Any] = {"gid": QUIET} if stroke.look == "faint" else {}
        axis.plot(*np.transpose(points), dash, color=hue, lw=stroke.width, solid_capstyle="round", zorder=3, **faint)
    elif stroke.kind in {"arrow", "measure"}:
        _arrow(axis, stroke, hue)
    elif stroke.kind == "box":
        (left, bottom), (right, top) = points
        face = mixture(ink(), 0.1) if stroke.look == "ink" else paper()
        box = Rectangle((left, bottom), right - left, top - bottom, fc=face, ec=hue, lw=stroke.width, zorder=2)
        axis.add_patch(box)
    else:
        (x, y), edge = points
        face = hue if stroke.kind == "disc" else paper()
        radius = hypot(edge[0] - x, edge[1] - y)
        order = 2.5 if stroke.kind == "wheel" else 6
        axis.add_patch(Circle((x, y), radius, fc=face, ec=hue, lw=stroke.width, zorder=order))


def _arrow(axis: Axes, stroke: Stroke, hue: str) -> None:
    """An arrow along its points, with the head at the last, of a measure at both ends."""
    points = np.array(stroke.points)
    if len(points) > 2:
        axis.plot(*points[:-2].T, color=hue, lw=stroke.width, zorder=5)
        points = points[-3:]
    look: dict[str, Any] = {"color": hue, "lw": stroke.width, "shrinkA": 0, "shrinkB": 0, "zorder": 5}
    style = "<->" if stroke.kind == "measure" else "-|>"
    start, end = point(points[0]), point(points[-1])
    axis.add_patch(FancyArrowPatch(start, end, arrowstyle=style, mutation_scale=10, **look))


def _write(axis: Axes, words: Lettering) -> None:
    side = {"left": "right", "right": "left"}.get(words.side, "center")
    size = "medium" if words.text.startswith("$") else SMALL
    axis.text(words.x, words.y, words.text, ha=side, va="center", color=_hue(words.look), fontsize=size, zorder=8)


# ------------------------------------------------------------------------------------------------------- with TikZ


def _tikz(stroke: Stroke) -> str:
    look, points = f"fb{stroke.look}", " -- ".join(f"({x:.3f},{y:.3f})" for x, y in stroke.points)
    width = f"line width={stroke.width:g}pt"
    if stroke.kind == "box":
        (left, bottom), (right, top) = stroke.points
        fill = "fill=fbink!10" if stroke.look == "ink" else "fill=white"
        return rf"\draw[{look}, {fill}, {width}] ({left:.3f},{bottom:.3f}) rectangle ({right:.3f},{top:.3f});"
    if stroke.kind in {"disc", "ring", "wheel"}:
        (x, y), edge = stroke.points
        fill = look if stroke.kind == "disc" else "white"
        return rf"\draw[{look}, fill={fill}, {width}] ({x:.3f},{y:.3f}) circle ({hypot(edge[0] - x, edge[1] - y):.3f});"
    line_style = {"arrow": ", ->", "measure": ", <->"}.get(stroke.kind, ", dashed" if stroke.is_dashed else "")
    return rf"\draw[{look}, {width}{line_style}] {points};"
