"""Colours by what they mean, from the matplotlib style in force: its cycle, and its ink thinned with its paper."""

from __future__ import annotations

import numpy as np
from matplotlib import rcParams
from matplotlib.colors import to_hex, to_rgb

HUES, DASHES = 6, ("-", "--", ":")
MOST_CURVES = HUES * len(DASHES)
"""Curves that are told apart on one axis."""
QUIET = "quiet"
"""The gid of what stands back on purpose: a rest position, a broad band."""


def colour(k: int) -> str:
    """The colour of curve k, from 0."""
    cycle = rcParams["axes.prop_cycle"].by_key().get("color", [ink()])
    return to_hex(cycle[k % HUES % len(cycle)])


def dash(k: int) -> str:
    """The dashes of curve k: another kind each time that the colours begin anew."""
    return DASHES[k // HUES % len(DASHES)]


def thickness(k: int, first: float = 2.4) -> float:
    """The width of curve k in points, each thinner than the one before, so that of two that coincide both show."""
    return first * (1 - 0.12 * min(k, HUES - 1))


def shade(part: float) -> str:
    """Ink thinned with paper: 1 is ink, 0 is paper."""
    inked, plain = (np.array(to_rgb(rcParams[name])) for name in ("text.color", "axes.facecolor"))
    return to_hex(tuple((part * inked + (1 - part) * plain).tolist()))


def ink() -> str:
    """What words and axes are drawn in."""
    return shade(1.0)


def paper() -> str:
    """What all is drawn on."""
    return shade(0.0)


def muted() -> str:
    """Marks and captions beside what counts, still easy to read."""
    return shade(0.68)


def rest() -> str:
    """What stands back: rest positions, bands, hatching."""
    return shade(0.27)
