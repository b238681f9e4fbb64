"""Measurements within the steps of lanes: samples, crossings of a level, largest angles, growth of errors.

Each is a `Watch` of `nonlinear.integration.lanes`, stores its findings by member, and asks for the motion inside a step
only in lanes where something happens there.

Crossings of a level by a component of y: the rules for every engine, and the crossings within a step of lanes.

A motion passes a level where it is on one side before, and after on the other or on the level.  At its start a motion
passes a level that it is on, to rounding, if it has a rate there: its equations go back in time as well.  Released from
rest on a level it leaves it, or touches it, and does not pass.  An angle has the same level again at every whole turn,
θ = level + 2πk.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from math import inf, pi, sqrt, tau
from sys import float_info
from typing import Any, NamedTuple

import numpy as np

from modal.types import Booleans, Floats, Ints
from nonlinear.integration.steppers import BREAK_ULPS
from nonlinear.integration.within import Inside, Step, align_lanes, sums_of_squares
from nonlinear.system import Layout

ACCELERATION_NOISE = 1e-13
"""Tolerance: of the largest acceleration, below which one is rounding and does not show where a start goes."""


@dataclass(frozen=True)
class Level:
    """A level (rad or m) of a component of y, by its row; of an angle, which `turns`, also full turns from it."""

    row: int
    value: float
    turns: bool

    def number_below(self, values: Any) -> Floats:
        """The k of the last level that is not above a value; −1 below a level that does not turn."""
        excess = np.asarray(values) - self.value
        return np.floor(excess / tau) if self.turns else np.where(excess >= 0, 0.0, -1.0)

    def number_above(self, values: Any) -> Floats:
        """The k of the first level that is not below a value; 1 above a level that does not turn."""
        excess = np.asarray(values) - self.value
        return np.ceil(excess / tau) if self.turns else np.where(excess > 0, 1.0, 0.0)

    def number(self, values: Any) -> Floats:
        """The k of the nearest level."""
        excess = np.asarray(values) - self.value
        return np.rint(excess / tau) if self.turns else 0.0 * excess

    def at(self, number: Any) -> Floats:
        """The level of this k."""
        return np.asarray(self.value + tau * number)


def level_of(layout: Layout, row: int, value: float) -> Level:
    """The level of a component of y."""
    return Level(row, value, turns=layout.first <= row < layout.half)


class Starts(NamedTuple):
    """Of S members, whether each is `on` a level at its start, its `number`, and the `way` that it goes from there.

    Upwards is 1, downwards −1, 0 if its rate and acceleration do not decide; `passes` where that is by its rate.
    """

    on: Booleans
    number: Floats
    way: Floats
    passes: Booleans


def starts_of(level: Level, layout: Layout, y: Floats, slope: Floats) -> Starts:
    """Of members from y (size, S) on, with this y' (size, S)."""
    values, number = y[level.row], level.number(y[level.row])
    place = level.at(number)
    on = np.abs(values - place) <= BREAK_ULPS * np.spacing(np.maximum(np.abs(values), np.abs(place)))
    rate, faster = y[layout.half + level.row], slope[layout.half + level.row]
    accelerates = np.abs(faster) > ACCELERATION_NOISE * np.abs(slope[layout.half : 2 * layout.half]).max(0)
    way = np.where(rate != 0, np.sign(rate), np.sign(faster) * accelerates)
    return Starts(on, number, way, on & (rate != 0))


class Passages(NamedTuple):
    """C passages: the member, time (s) and y (C, size) of each, the `number` of its level and the `way`, 1 upwards."""

    member: Ints
    time: Floats
    rows: Floats
    number: Floats
    way: Floats

    def take(self, which: Any) -> Passages:
        """Some of them."""
        return Passages(*(values[which] for values in self))


def join_passages(parts: list[Passages], size: int) -> Passages:
    """All of these, of y of this size."""
    none = np.zeros(0)
    empty = Passages(np.zeros(0, dtype=np.int64), none, np.zeros((0, size)), none, none)
    return Passages(*(np.concatenate(values) for values in zip(empty, *parts, strict=True)))


def passages_that_count(passages: Passages, starts: Starts, start: Floats, direction: int = 0) -> Passages:
    """Those that count, member by member in the order of time, with those at the starts of y (size, S).

    Two in a row through one level the same way are one: seen at a start, or at the end of a step.
    """
    on = np.flatnonzero(starts.on)
    first = Passages(on, np.zeros(len(on)), start[:, on].T, starts.number[on], starts.way[on])
    passages = passages.take(~(starts.on[passages.member] & (passages.time <= 0)))
    candidates = join_passages([first, passages], len(start))
    order = np.lexsort((candidates.time, candidates.member))
    candidates = candidates.take(order)
    counts = np.concatenate((starts.passes[on], np.ones(len(passages.member), dtype=bool)))[order]
    is_repeat = (np.diff(candidates.member) == 0) & (np.diff(candidates.number) == 0) & (np.diff(candidates.way) == 0)
    counts[1:] &= ~is_repeat
    if direction:
        counts &= candidates.way == direction
    return candidates.take(counts)


def leaving(passages: Passages, starts: Starts) -> Booleans:
    """Which passages are those of a start on a level, (C,)."""
    on, number, way, _ = (values[passages.member] for values in starts)
    return np.asarray(on & (passages.number == number) & ((passages.way == way) | (passages.time <= 0)))


def passages(step: Step, level: Level, among: Booleans | None = None) -> Passages | None:
    """The components that pass a level within an accepted step, also there and back; None if none does."""
    low, high = step.reach(level.row)
    possible = (
        (level.number_below(low) != level.number_below(high)) | (level.number_above(low) != level.number_above(high))
    ) & step.taken
    columns = np.flatnonzero(possible if among is None else possible & among)
    if not len(columns):
        return None
    inside = step.within(columns)
    parts, values = inside.pieces(level.row, step.motion(step.after[level.row])[columns])
    below, above = level.number_below(values), level.number_above(values)
    change = np.where(np.diff(values, axis=0) > 0, np.diff(below, axis=0), np.diff(above, axis=0)).astype(np.int64)
    piece, lane = np.nonzero(change)
    if not len(piece):
        return None
    times = np.abs(change[piece, lane])
    nth = np.arange(times.sum()) - np.repeat(np.cumsum(times) - times, times)
    piece, lane = np.repeat(piece, times), np.repeat(lane, times)
    way = np.sign(change[piece, lane])
    number = np.where(way > 0, below[piece, lane] + 1 + nth, above[piece, lane] - 1 - nth)
    lanes_inside, place = inside.take(lane), level.at(number)
    low, high = parts[piece, lane], parts[piece + 1, lane]
    part = lanes_inside.root(level.row, place, low, high)
    member_columns = columns[lane]
    y, time = lanes_inside.at(part), step.start[member_columns] + part * step.length[member_columns]
    if step.is_single_run:
        # As accurate as the steps of the run: one step of Newton's method, unless it leaves where the component rises.
        y, slope = step.ending(member_columns, part)
        late = (place - y[level.row]) / slope[level.row]
        length = step.length[member_columns]
        late = np.where((low <= part + late / length) & (part + late / length <= high), late, 0.0)
        y, time = y + late * slope, time + late
    return Passages(step.member[member_columns], time, np.moveaxis(y, 1, 0), number, way.astype(float))


NEIGHBOUR_DISTANCE = sqrt(float_info.epsilon)
"""Natural units by which a neighbour is aside, where rounding and the curvature of a distance's growth are alike."""
EPSILON = float_info.epsilon
ERROR_KNOWN_MAX = 0.1
"""Limit: error (rad) beyond which nothing is known of a member, which reports call its horizon."""


def _instants(step: Step, due: Ints, until: Ints) -> Iterator[tuple[Ints, Ints, Inside]]:
    """The samples from `due` to `until` of every lane of a step that was taken, one of each lane at a time.

    The lanes, the numbers of their samples, and the motion inside the step there.
    """
    columns = np.flatnonzero(step.taken & (due < until))
    if not len(columns):
        return
    inside, due, until = step.within(columns), due[columns], until[columns]
    remaining = np.arange(len(columns))
    while len(remaining):
        yield columns[remaining], due[remaining], inside.take(remaining)
        due[remaining] += 1
        remaining = remaining[due[remaining] < until[remaining]]


@dataclass(eq=False)
class Samples:
    """The y of S members at their `times` (S, K), or (K,) for all; `rows` (S, K, size) or (S, K, size, 1 + k).

    NaN stands where no sample came.  Steps may come in any order, and several of one member at a time.
    """

    times: Floats
    initial: Floats
    rows: Floats = field(init=False)

    def __post_init__(self) -> None:
        start = np.moveaxis(self.initial, 1, 0)
        self.rows = np.full((len(start), self.times.shape[-1], *start.shape[1:]), np.nan, start.dtype)
        at_start = np.broadcast_to(self.times[..., 0] == 0, len(start))
        self.rows[at_start, 0] = start[at_start]

    def see(self, step: Step) -> None:
        """Samples that fall into the step."""
        end = step.start + step.length
        due, until = self._sample_count(step.member, step.start), self._sample_count(step.member, end)
        for columns, sample, inside in _instants(step, due, until):
            members = step.member[columns]
            time = self.times[members, sample] if self.times.ndim > 1 else self.times[sample]
            part = (time - step.start[columns]) / step.length[columns]
            y = np.where(align_lanes(time == end[columns], step.after), step.after[:, columns], inside.at(part))
            self.rows[members, sample] = np.moveaxis(y, 1, 0)

    def _sample_count(self, members: Ints, time: Floats) -> Ints:
        """How many samples of each member come until a time."""
        if self.times.ndim > 1:
            return np.asarray((self.times[members] <= time[:, None]).sum(1))
        return np.searchsorted(self.times, time, side="right")


@dataclass(eq=False)
class FirstTurns:
    """The times (s) at which each link first goes over the top, θ = π + 2πk; (L, S), inf if it never does.

    Members begin with y and y' (size, S).
    """

    layout: Layout
    initial: Floats
    slope: Floats
    times: Floats = field(init=False)

    def __post_init__(self) -> None:
        first, half = self.layout.first, self.layout.half
        self._levels = [Level(row, pi, turns=True) for row in range(first, half)]
        self._starts = [starts_of(level, self.layout, self.initial, self.slope) for level in self._levels]
        self.times = np.array([np.where(starts.passes, 0.0, inf) for starts in self._starts])

    def see(self, step: Step) -> None:
        """Links that go over the top in the step."""
        for level, starts, times in zip(self._levels, self._starts, self.times, strict=True):
            if (crossings := passages(step, level, times[step.member] > step.start)) is not None:
                crossings = crossings.take(~leaving(crossings, starts))
                np.minimum.at(times, crossings.member, crossings.time)


@dataclass(eq=False)
class Crossings:
    """Where one component of y passes a level, an angle at any turn, upwards (`direction` 1), downwards or both (0).

    Members begin with y and y' (size, S).  Found are the member, the time (s) and y of each.
    """

    layout: Layout
    initial: Floats
    slope: Floats
    row: int
    level: float
    direction: int = 0
    _passages: list[Passages] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._level = level_of(self.layout, self.row, self.level)

    def see(self, step: Step) -> None:
        """Passages within the step."""
        if (crossings := passages(step, self._level)) is not None:
            self._passages.append(crossings)

    @property
    def crossings(self) -> tuple[Ints, Floats, Floats]:
        """Members (C,), times (C,) and y (C, size), member by member in the order of time."""
        starts = starts_of(self._level, self.layout, self.initial, self.slope)
        return passages_that_count(
            join_passages(self._passages, len(self.initial)), starts, self.initial, self.direction
        )[:3]


@dataclass(eq=False)
class Largest:
    """The largest |θ| (rad) of any link, (S,), read at the turning points within steps."""

    layout: Layout
    initial: Floats
    angle: Floats = field(init=False)

    def __post_init__(self) -> None:
        first, half = self.layout.first, self.layout.half
        self.angle = np.abs(self.initial[first:half]).max(0)

    def see(self, step: Step) -> None:
        """Ends of steps, and turning points that may lie further out."""
        first, half = self.layout.first, self.layout.half
        largest = self.angle[step.member]
        largest = np.where(step.taken, np.maximum(largest, np.abs(step.after[first:half]).max(0)), largest)
        furthest = np.array([np.maximum(-low, high) for low, high in (step.reach(row) for row in range(first, half))])
        turning = (furthest > largest) & step.taken
        columns = np.flatnonzero(turning.any(0))
        if len(columns):
            inside = step.within(columns)
            for link in np.flatnonzero(turning.any(1)):
                lanes = np.flatnonzero(turning[link, columns])
                at, row = columns[lanes], first + int(link)
                _, values = inside.take(lanes).pieces(row, step.after[row, at])
                largest[at] = np.maximum(largest[at], np.abs(values).max(0))
        np.maximum.at(self.angle, step.member, largest)


@dataclass(eq=False)
class Growth:
    """An estimate of every member's error in natural units, and the time when it is more than ERROR_KNOWN_MAX.

    A neighbour's distance v = (δq, δq') is carried along by one more rate a step, δq' += h (q''(y + v) − q''(y)) and
    then δq += h δq' (symplectic Euler, so that oscillations keep their size); with g = |v after|/|v before| the error e
    becomes g e and `local`, the tolerance.
    """

    layout: Layout
    scale: Floats
    local: Floats
    error: Floats = field(init=False)
    horizon: Floats = field(init=False)

    def __post_init__(self) -> None:
        members, half = len(self.local), self.layout.half
        self.error, self.horizon = np.zeros(members), np.full(members, inf)
        self._v = np.full((2 * half, members), (2 * half) ** -0.5)

    def see(self, step: Step) -> None:
        """One step of the distance."""
        half, members = self.layout.half, step.member
        scale = self.scale[: 2 * half]
        if scale.shape[1] > 1:
            scale = scale[:, members]
        v = self._v[:, members] * scale
        neighbour = step.after.copy()
        neighbour[: 2 * half] += NEIGHBOUR_DISTANCE * v
        rates = step.rates(neighbour, step.times(1.0))
        for row in range(half):
            v[half + row] += step.length * ((rates[half + row] - step.stages[-1, half + row]) / NEIGHBOUR_DISTANCE)
        v[:half] += step.length * v[half:]
        v /= scale
        grown = np.sqrt(sums_of_squares(v))
        v /= grown
        is_valid = step.taken & np.isfinite(grown) & (grown > 0)
        largest_angle = np.abs(step.after[self.layout.first : half]).max(0)
        error = self.error[members] * grown + np.maximum(self.local[members], EPSILON / 2 * largest_angle)
        columns = np.flatnonzero(is_valid)
        members_in = members[columns]
        self._v[:, members_in] = v[:, columns]
        self.error[members_in] = error[columns]
        late = members_in[(self.error[members_in] > ERROR_KNOWN_MAX) & (self.horizon[members_in] == inf)]
        if len(late):
            times = np.empty(len(self.horizon))
            times[members] = step.start + step.length
            self.horizon[late] = times[late]


@dataclass(eq=False)
class GrowthSamples:
    """What ln |v| has gained until each of the `times` (K,) in s, `rows` (K, S), NaN if none came; `last` is y.

    Tangent vectors are brought back to length 1 after every step.  `report` hears how far (s) the slowest has come.
    """

    scale: Floats
    times: Floats
    initial: Floats
    report: Callable[[float], object]
    rows: Floats = field(init=False)
    last: Floats = field(init=False)

    def __post_init__(self) -> None:
        members = self.initial.shape[1]
        self.rows, self.last = np.full((len(self.times), members), np.nan), self.initial.copy()
        self._whole = Stretching(self.scale, members)
        self._reached = np.zeros(members)

    def see(self, step: Step) -> None:
        """Times that fall into the step, then its end."""
        end, half = step.start + step.length, len(self.initial)
        due, until = (np.searchsorted(self.times, time, side="right") for time in (step.start, end))
        for columns, sample, inside in _instants(step, due, until):
            part = (self.times[sample] - step.start[columns]) / step.length[columns]
            scale = self.scale if self.scale.shape[1] == 1 else self.scale[:, step.member[columns]]
            length = np.sqrt(np.sum((inside.at(part)[half:] / scale) ** 2, axis=0))
            self.rows[sample, step.member[columns]] = self._whole.growth[step.member[columns]] + np.log(length)
        self._whole.see(step)
        members = step.member[step.taken]
        self.last[:, members] = step.after[:half, step.taken]
        self._reached[members] = end[step.taken]
        self.report(float(self._reached.min()))


def tangent_direction(size: int) -> Floats:
    """The direction of length 1, (size, 1), in which tangent vectors begin, in natural units: drawn once for all."""
    vector = np.random.default_rng(0).standard_normal((size, 1))
    return np.asarray(vector / np.linalg.norm(vector))


@dataclass(eq=False)
class Stretching:
    """What ln |v| has gained of tangent vectors, (S,), which are brought back to length 1 after every step."""

    scale: Floats
    members: int
    growth: Floats = field(init=False)

    def __post_init__(self) -> None:
        self.growth = np.zeros(self.members)

    def see(self, step: Step) -> None:
        """Bring the tangent vectors of the step back to length 1."""
        half = len(step.after) // 2
        scale = self.scale if self.scale.shape[1] == 1 else self.scale[:, step.member]
        length = np.sqrt(np.sum((step.after[half:] / scale) ** 2, axis=0))
        length = np.where(step.taken & (length > 0), length, 1.0)
        self.growth[step.member] += np.log(length)
        step.after[half:] /= length
        step.stages[-1, half:] /= length
