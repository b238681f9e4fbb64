"""Branches of steady and periodic motions: solid where stable, dash-dotted where not, their special points marked."""

from __future__ import annotations

from collections.abc import Container, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from modal.plotting import COMPUTED, UNSTABLE, colour, ink, narrowing, paper
from modal.types import Floats

LINES: dict[bool, Any] = {True: COMPUTED, False: UNSTABLE}
"""Of what is stable, and of what is not."""


def draw_branch(axis: Axes, x: Floats, y: Floats, is_stable: Sequence[bool], number: int) -> None:
    """One branch, in pieces of equal stability that meet; unstable ones are half as wide."""
    fates = np.array(is_stable)
    breaks = [0, *(np.flatnonzero(np.diff(fates)) + 1), len(fates)]
    for start, stop in pairwise(breaks):
        piece = slice(max(start - 1, 0), stop)
        fate = bool(fates[start])
        look = {"color": colour(number), "ls": LINES[fate], "lw": narrowing(number) * (1.0 if fate else 0.5)}
        axis.plot(x[piece], y[piece], **look, zorder=3, label=f"_{number}")


def mark(shape: str = "o") -> dict[str, Any]:
    """The style of a special point."""
    return {"ls": "", "marker": shape, "mfc": paper(), "mec": ink(), "ms": 6.0, "mew": 1.2, "zorder": 5}


def branch_keys(names: Sequence[str]) -> list[Line2D]:
    """The legend's line of each branch, with its number."""
    return [
        Line2D([], [], color=colour(number), lw=narrowing(number), label=f"{number + 1}: {name}")
        for number, name in enumerate(names)
    ]


def stability_keys(fates: Container[bool] = (True, False)) -> list[Line2D]:
    """The legend's lines of stable and unstable pieces, of those there are."""
    return [
        Line2D([], [], color=ink(), ls=style, label="stable" if fate else "unstable")
        for fate, style in LINES.items()
        if fate in fates
    ]
