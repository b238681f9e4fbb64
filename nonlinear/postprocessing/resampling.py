"""A motion at other times, by the cubic through neighbouring samples and their rates, with an error of h⁴ θ''''/384.

With s = (t − t_i)/h and h = t_{i+1} − t_i, Hermite's basis on values y and rates v is

    y(t) = (1 + 2s)(1 − s)² y_i + s²(3 − 2s) y_{i+1} + h s (1 − s) [(1 − s) v_i − s v_{i+1}].

Samples miss an extreme by up to the square of their distance, and in space, where an angle from the vertical passes its
smallest value as |t| does, by their distance itself.  Where cubics between the samples come near an extreme, the motion
is integrated again from one sample to the next.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from modal.errors import ComputationError
from modal.scene.doors import checked, require_type
from modal.types import Floats, Ints
from nonlinear.integration import EXPLICIT, Choice, Trajectory, equations_of, prepare
from nonlinear.system import Equations, Motion

DEFECT_MAX = 0.25
"""Limit: largest trapezoidal defect h³ θ'''/12 (rad) across which a cubic is trusted: 1 rad swings are right to
0.01 rad."""
FORMS = {"minimal", "maximal", "hamiltonian", "spatial"}
CUBIC_PLACES = 8
"""Tolerance: places on each cubic, between which a parabola passes them by an eighth of their second differences."""
STRETCH_LOOKS = 64
"""Cost: samples of a stretch that is integrated again, and again around its extreme (benchmarks/engines.py)."""
STRETCHES_MAX = 24
"""Cost: stretches integrated again for an extreme: a steady motion comes as near to it in every period."""
PLACES_MAX = 2_000_000
"""Cost: places on cubics in a run beyond which extremes are those of the samples, as the summary says."""
EXTENT_TURN_MAX = 1.5
"""Tolerance: rad from one sample to the next, above which cubics do not locate extremes."""
Quantity = Callable[[Motion], Floats]
WAY = Choice("minimal", "DOP853", compiled=False, reason="")


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


class Extent(NamedTuple):
    """The smallest and the largest value; `between` says whether also between the samples."""

    low: float
    high: float
    between: bool


def angles_of(motion: Motion) -> Floats:
    """The angles (T, L) of links in rad, in space those from the downward vertical."""
    links = motion.links
    return links if links.ndim == 2 else np.arctan2(np.hypot(links[..., 0], links[..., 1]), links[..., 2])


def places_of(motion: Motion) -> Floats:
    """The places (T, 1) of the cart in m."""
    return motion.cart[:, None]


@checked
def extent_of(trajectory: Trajectory, quantity: Quantity | None = None) -> Extent:
    """The extremes of a quantity, by default of the angles (rad), over the whole run.

    Between the samples they are known of motion without jumps of the rates, by an explicit method, whose samples are
    near enough to each other.
    """
    quantity = quantity or angles_of
    values = quantity(trajectory.motion)
    samples = Extent(float(values.min()), float(values.max()), between=False)
    if not _can_interpolate(trajectory):
        return samples
    between = _on_cubics(trajectory, quantity)
    equations = _equations(trajectory)
    low = _furthest(trajectory, quantity, equations, between, -1.0)
    high = _furthest(trajectory, quantity, equations, between, 1.0)
    return Extent(min(samples.low, low), max(samples.high, high), between=True)


def largest_angle(trajectory: Trajectory) -> float:
    """The largest angle (rad) of any link from the downward vertical, also between the samples."""
    require_type("trajectory", trajectory, "Trajectory")
    times, motion = trajectory.times, trajectory.motion
    if not trajectory.system.spatial:
        return float(np.abs(extremes(times, motion.links, motion.link_rates)).max())
    if (extent := extent_of(trajectory)).between:
        return extent.high
    height, _ = extremes(times, motion.links[..., 2], motion.link_rates[..., 2])
    return float(np.arccos(np.clip(height, -1.0, 1.0)).max())


def _can_interpolate(trajectory: Trajectory) -> bool:
    """Whether the motion between samples can be found."""
    run, system, times, motion = trajectory.run, trajectory.system, trajectory.times, trajectory.motion
    jumps = system.has_escapements or system.rubs or system.hoisting is not None or system.is_sampled
    has_lost_load = trajectory.driven and trajectory.equations is None
    if jumps or has_lost_load or run.form not in FORMS or run.method not in {*EXPLICIT, "taylor"} or len(times) < 2:
        return False
    if len(times) * motion.links[0].size * CUBIC_PLACES > PLACES_MAX:
        return False
    rates = np.abs(motion.link_rates).reshape(len(times), -1).max(1)
    return bool(np.max(np.diff(times) * np.maximum(rates[:-1], rates[1:])) < EXTENT_TURN_MAX)


def _equations(trajectory: Trajectory) -> Equations:
    load = trajectory.equations.load if trajectory.equations else None
    form = "spatial" if trajectory.system.spatial else "minimal"
    return equations_of(trajectory.system, replace(WAY, form=form), load)


def _on_cubics(trajectory: Trajectory, quantity: Quantity) -> Floats:
    """The quantity at places of the cubics between samples, (T − 1, CUBIC_PLACES, …)."""
    motion, gaps = trajectory.motion, np.diff(trajectory.times)
    samples = np.repeat(np.arange(len(gaps)), CUBIC_PLACES)
    place = _Place(samples, gaps[samples], np.tile(np.linspace(0.0, 1.0, CUBIC_PLACES), len(gaps)))
    links, _ = _between(place, motion.links, motion.link_rates)
    cart, _ = _between(place, motion.cart, motion.cart_rate)
    supports, _ = _between(place, motion.supports, motion.support_rates)
    rows = quantity(Motion(links, links, cart, cart, cart, supports, supports))
    return rows.reshape(len(gaps), CUBIC_PLACES, -1)


def _furthest(trajectory: Trajectory, quantity: Quantity, equations: Equations, between: Floats, side: float) -> float:
    """The largest of side · quantity, as the quantity, in the stretches that come nearest to it."""
    values = side * between
    bend = np.abs(np.diff(values, 2, axis=1)).max(1)
    hopeful = values.max(1) + bend / 4  # a parabola passes its places by an eighth of it, a kink by a fourth
    furthest = -np.inf
    order = np.argsort(hopeful, axis=None)[::-1][:STRETCHES_MAX]
    for row, column in zip(*np.unravel_index(order, hopeful.shape), strict=True):
        if hopeful[row, column] > furthest:
            furthest = max(furthest, _turning(trajectory, quantity, equations, int(row), int(column), side))
    return side * furthest


def _turning(
    trajectory: Trajectory, quantity: Quantity, equations: Equations, row: int, column: int, side: float
) -> float:
    """The largest of side · quantity from one sample to the next."""
    start, end = trajectory.times[row : row + 2].tolist()
    state, furthest = trajectory.motion[row], -np.inf
    for _ in range(STRETCH_LOOKS):
        looks = np.linspace(start, end, STRETCH_LOOKS)
        anew = prepare(trajectory.scene, equations, WAY, state, looks, 1.0).go()
        if anew.run.interrupted:
            raise KeyboardInterrupt
        values = side * quantity(anew.motion)[:, column]
        best = int(np.argmax(values))
        furthest, low, high = max(furthest, float(values[best])), max(best - 1, 0), min(best + 1, STRETCH_LOOKS - 1)
        if furthest - min(values[low], values[high]) < WAY.tolerance:
            break
        start, end, state = looks[low], looks[high], anew.motion[low]
    return furthest
