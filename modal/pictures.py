"""Figures in the style in force, written to files whatever letters their titles have."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from io import BytesIO
from textwrap import fill
from typing import IO, Any

from matplotlib import rc_context, rcParams
from matplotlib.backend_bases import RendererBase
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from modal.palette import INK

LETTER = 0.115  # inches that a bold letter of a title takes
LASTING = ("axes", "figure", "font", "grid", "hatch", "lines", "mathtext", "patch", "savefig", "text", "xtick", "ytick")
"""Groups of settings that a picture keeps from where it was made, since ticks are made when it is drawn."""


class Picture(Figure):
    """A figure that keeps the style it was made in, and that notebooks show as the last line of a cell."""

    def __init__(self, width: float, height: float) -> None:
        super().__init__(figsize=(width, height), layout="constrained")
        FigureCanvasAgg(self)
        self.style = {name: value for name, value in rcParams.items() if name.partition(".")[0] in LASTING}

    def draw(self, renderer: RendererBase) -> None:
        """Draw in the picture's own style."""
        with rc_context(self.style):
            super().draw(renderer)

    def savefig(self, fname: Any, **look: Any) -> None:
        """Write in the picture's own style; letters that the font has not are drawn as boxes, without a warning."""
        with rc_context(self.style), _any_letters():
            super().savefig(fname, **look)

    def _repr_png_(self) -> bytes:
        buffer = BytesIO()
        self.savefig(buffer, format="png", dpi=self.dpi)
        return buffer.getvalue()


def sheet(width: float, height: float) -> Picture:
    """An empty picture (inches) in the style in force."""
    return Picture(width, height)


def entitle(figure: Figure, words: str) -> None:
    """A title over the whole figure, on as many lines as it needs; nothing in it is read as mathematics."""
    lines = fill(words, max(20, int(figure.get_figwidth() / LETTER)))
    figure.suptitle(lines, fontsize=12, fontweight="bold", color=INK, parse_math=False)


def save(figure: Figure, stream: IO[bytes], form: str) -> None:
    """Write a figure as png, svg or pdf; letters that the font has not are drawn as boxes, without a warning."""
    with _any_letters():
        figure.savefig(stream, format=form)


@contextmanager
def _any_letters() -> Iterator[None]:
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Glyph .* missing from font")
        yield
