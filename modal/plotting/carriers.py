"""Structures on an axis: the pieces of a scaffold as lines and bodies."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Polygon

from modal.plotting.style import COMPUTED, MARKED, ink, mixture, paper, secondary_colour
from modal.structure import STILL, Piece

WIDTHS = {"body": 1.3, "line": 1.6, "spring": 1.0, "dot": 1.2, "ground": 1.8, "hatch": 0.8, "guide": 0.9}
ORDER = {"body": 1.5, "line": 1.2, "spring": 1.1, "dot": 1.8, "ground": 0.8, "hatch": 0.7, "guide": 0.6}


def draw_pieces(axis: Axes, pieces: Iterable[Piece], look: dict[str, Any], *, rests: bool) -> None:
    """The pieces of one instant with the colour of a `look`; at rest bodies are filled, and the ground is drawn."""
    for piece in pieces:
        if piece.role not in STILL:
            draw_piece(axis, piece, look, mixture(look["color"], 0.5) if rests else "none")
        elif rests:
            draw_piece(axis, piece, look | {"color": ink() if piece.role == "ground" else secondary_colour()}, "none")


def draw_piece(axis: Axes, piece: Piece, look: dict[str, Any], face: str) -> Polygon | Line2D:
    """A piece where it is first; `face` is the colour within a closed outline."""
    points, width, order = piece.points[0], WIDTHS[piece.role], ORDER[piece.role]
    if piece.is_outline:
        edge = {"ec": look["color"], "lw": width, "joinstyle": "round", "gid": look.get("gid")}
        outline = Polygon(points, closed=True, fc=face, zorder=order, **edge)
        axis.add_patch(outline)
        return outline
    look = look | {"ls": MARKED if piece.role == "guide" else COMPUTED}
    if piece.role == "dot":
        look |= {"ls": "", "marker": "o", "ms": 4.0, "color": paper(), "mec": look["color"], "mew": 1.2}
    return axis.plot(*points.T, **look, lw=width, solid_joinstyle="round", zorder=order)[0]
