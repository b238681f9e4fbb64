"""Crossings of a level by a component of y: the rules for every engine, and the crossings within a step of lanes.

A motion passes a level where it is on one side before, and after on the other or on the level.  At its start a motion
passes a level that it is on, to rounding, if it has a rate there: its equations go back in time as well.  Released from
rest on a level it leaves it, or touches it, and does not pass.  An angle has the same level again at every whole turn,
θ = level + 2πk.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import tau
from typing import Any, NamedTuple

import numpy as np

from modal.types import Booleans, Floats, Ints
from nonlinear.integration.steppers import BREAK_ULPS
from nonlinear.integration.within import Step
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
