"""Figures written to a file, whatever letters their titles have."""

from __future__ import annotations

import warnings
from typing import IO

from matplotlib.figure import Figure


def save(figure: Figure, stream: IO[bytes], form: str) -> None:
    """Write a figure as png, svg or pdf; letters that the font has not are drawn as boxes, without a warning."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Glyph .* missing from font")
        figure.savefig(stream, format=form)
