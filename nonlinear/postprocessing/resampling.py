"""A motion at other times, by the cubic through neighbouring samples and their rates, with an error of h⁴ θ''''/384.

With s = (t − t_i)/h and h = t_{i+1} − t_i, Hermite's basis on values y and rates v is

    y(t) = (1 + 2s)(1 − s)² y_i + s²(3 − 2s) y_{i+1} + h s (1 − s) [(1 − s) v_i − s v_{i+1}].
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from modal.errors import ComputationError
from modal.types import Floats, Ints
from nonlinear.system import Motion

DEFECT_MAX = 0.25
"""Limit: largest trapezoidal defect h³ θ'''/12 (rad) across which a cubic is trusted: 1 rad swings are right to
0.01 rad."""


def resample(times: Floats, motion: Motion, at: Floats) -> Motion:
    """The motion at times `at` (F,) in s, within `times` (T,); unit vectors remain unit and orthogonal to their rates.

    Raise ComputationError if the samples are too far apart to interpolate.
    """
    if len(times) < 2:
        raise ComputationError("the run has a single sample: there is no motion to draw")
    sample = np.clip(np.searchsorted(times, at, side="right") - 1, 0, len(times) - 2)
    step = times[sample + 1] - times[sample]
    place = _Place(sample, step, (at - times[sample]) / step)
    _validate(times, motion, place)
    links, link_rates = _between(place, motion.links, motion.link_rates)
    if links.ndim == 3:
        length = np.linalg.norm(links, axis=-1, keepdims=True)
        links, link_rates = links / length, link_rates / length
        link_rates = link_rates - links * np.sum(links * link_rates, axis=-1, keepdims=True)
    cart, cart_rate = _between(place, motion.cart, motion.cart_rate)
    supports = _between(place, motion.supports, motion.support_rates)
    return Motion(links, link_rates, cart, cart_rate, np.interp(at, times, motion.work), *supports)


def extremes(times: Floats, values: Floats, rates: Floats) -> tuple[Floats, Floats]:
    """The minimum and maximum (...) of samples (T, ...) and of the cubics between them."""
    h = np.diff(times).reshape(-1, *[1] * (values.ndim - 1))
    turns = rates[:-1] * rates[1:] < 0
    v, v1, rise = rates[:-1], rates[1:], np.diff(values, axis=0) / h
    with np.errstate(divide="ignore", invalid="ignore"):
        B, A = 3 * rise - 2 * v - v1, 3 * (v + v1 - 2 * rise)  # slope v + 2 B s + A s²
        s = np.abs(v) / (np.sqrt(B * B - A * v) - np.sign(v) * B)
        inside = values[:-1] + h * s * (v + s * (B + s * A / 3))
    between = np.where(turns, inside, values[:-1])
    return np.minimum(values.min(0), between.min(0)), np.maximum(values.max(0), between.max(0))


def pick_links(motion: Motion, links: Ints) -> Motion:
    """The same motion with these links only."""
    return replace(motion, links=motion.links[:, links], link_rates=motion.link_rates[:, links])


class _Place(NamedTuple):
    """The sample before each time (F,), the step (s) to the next, and the fraction of the step elapsed."""

    sample: Ints
    step: Floats
    part: Floats


def _between(place: _Place, values: Floats, rates: Floats) -> tuple[Floats, Floats]:
    """The cubic and its derivative."""
    h, s = (part.reshape(-1, *[1] * (values.ndim - 1)) for part in (place.step, place.part))
    y, y1, v, v1 = (array[place.sample + k] for array in (values, rates) for k in (0, 1))
    cubic = (1 + 2 * s) * (1 - s) ** 2 * y + s**2 * (3 - 2 * s) * y1 + h * s * (1 - s) * ((1 - s) * v - s * v1)
    slope = 6 * s * (1 - s) * (y1 - y) / h + (1 - s) * (1 - 3 * s) * v + s * (3 * s - 2) * v1
    return cubic, slope


def _validate(times: Floats, motion: Motion, place: _Place) -> None:
    first, last = int(place.sample.min()), int(place.sample.max()) + 2
    h = np.diff(times[first:last]).reshape(-1, *[1] * (motion.links.ndim - 1))
    links, rates = motion.links[first:last], motion.link_rates[first:last]
    worst = float(np.max(np.abs(np.diff(links, axis=0) - h * (rates[1:] + rates[:-1]) / 2)))
    if not worst <= DEFECT_MAX:
        closer = min(float(np.max(h)) * (DEFECT_MAX / worst) ** (1 / 3), DEFECT_MAX / float(np.max(np.abs(rates))))
        raise ComputationError(
            f"samples every {np.max(h):.3g} s are too few to interpolate between: "
            f"simulate with one every {closer:.2g} s, `output={int((times[-1] - times[0]) / closer) + 2}`"
        )
