"""Structures on an axis: the pieces of a scaffold as lines and bodies."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from matplotlib.axes import Axes
from matplotlib.patches import Polygon

from modal.plotting.style import COMPUTED, MARKED, ink, mixture, paper, secondary_colour
from modal.structure import STILL, Piece

WIDTHS = {"body": 1.3, "line": 1.6, "spring": 1.0, "dot": 1.2, "ground": 1.8, "hatch": 0.8, "guide": 0.9}
ORDER = {"body": 1.5, "line": 1.2, "spring": 1.1, "dot": 1.8, "ground": 0.8, "hatch": 0.7, "guide": 0.6}


def draw_pieces(axis: Axes, pieces: Iterable[Piece], look: dict[str, Any], *, rests: bool) -> None:
    """The pieces of one instant with the colour of a `look`; at rest bodies are filled, and the ground is drawn."""
    for piece in pieces:
        points = piece.points[0]
        if piece.role in STILL:
            if rests:
                hue = ink() if piece.role == "ground" else secondary_colour()
                line = MARKED if piece.role == "guide" else COMPUTED
                outline = [*points, points[0]] if piece.is_outline else points
                x, y = zip(*outline, strict=True)
                axis.plot(
                    x, y, ls=line, color=hue, lw=WIDTHS[piece.role], gid=look.get("gid"), zorder=ORDER[piece.role]
                )
        elif piece.role == "dot":
            axis.plot(*points.T, "o", ms=4.0, **look | {"color": paper()}, mec=look["color"], mew=1.2, zorder=1.8)
        elif piece.is_outline:
            face = mixture(look["color"], 0.5) if rests else "none"
            style = {"fc": face, "ec": look["color"], "lw": WIDTHS["body"], "joinstyle": "round"}
            axis.add_patch(Polygon(points, closed=True, gid=look.get("gid"), zorder=ORDER["body"], **style))
        else:
            axis.plot(*points.T, **look, lw=WIDTHS[piece.role], solid_joinstyle="round", zorder=ORDER[piece.role])
