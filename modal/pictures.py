"""Figures written to a file, whatever letters their titles have."""

from __future__ import annotations

import warnings
from textwrap import fill
from typing import IO

from matplotlib.figure import Figure

from modal.palette import INK

LETTER = 0.115  # inches that a bold letter of a title takes


def entitle(figure: Figure, words: str) -> None:
    """A title over the whole figure, on as many lines as it needs; nothing in it is read as mathematics."""
    lines = fill(words, max(20, int(figure.get_figwidth() / LETTER)))
    figure.suptitle(lines, fontsize=12, fontweight="bold", color=INK, parse_math=False)


def save(figure: Figure, stream: IO[bytes], form: str) -> None:
    """Write a figure as png, svg or pdf; letters that the font has not are drawn as boxes, without a warning."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Glyph .* missing from font")
        figure.savefig(stream, format=form)
