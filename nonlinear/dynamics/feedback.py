"""Inputs of feedback loops (`nonlinear.system.loops`) for a state in any arithmetic, and held between samples."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from math import ulp
from typing import TYPE_CHECKING, Any

import numpy as np

from modal.errors import ComputationError, SceneError
from modal.types import NOISE_OF_SUM
from nonlinear.dynamics.tape import Symbol, where

if TYPE_CHECKING:
    from nonlinear.system.loops import ActingLoop


def input_of(loop: ActingLoop, y: Any) -> Any:
    """The input (N or N m) of a loop at y = (q, q', …), floats, arrays of many states, complex numbers or symbols."""
    total: Any = 0.0
    for k, (gain, (places, rest)) in enumerate(zip(loop.gains, loop.readings, strict=True)):
        value: Any = 0.0 - rest if rest else 0.0
        for place, factor in places:
            value = value + (y[place] if factor == 1.0 else factor * y[place])
        total = total - gain * (value - loop.references[k] if loop.references else value)
    return total if loop.limit is None or not loop.gains else _clip(total, loop.limit)


def _clip(value: Any, limit: Any) -> Any:
    """The value within ±limit."""
    choose = Symbol.where if isinstance(value, Symbol) else where
    below = choose(value - limit, limit, value)
    return choose(-limit - below, -limit, below)


class HeldInputs:
    """The inputs of sampled loops, each computed at its sample time and held until the next one."""

    def __init__(self, loops: Sequence[ActingLoop]) -> None:
        self.loops = [loop for loop in loops if loop.sample_time]
        self.times: list[list[float]] = [[] for _ in self.loops]
        self.inputs: list[list[float]] = [[] for _ in self.loops]

    def begin(self, start: float, end: float, most: int = 1_000_000) -> list[float]:
        """Forget all; the times (s) of samples until the end, ascending; raise SceneError for too many."""
        self.inputs = [[] for _ in self.loops]
        counts = [(end - start) / loop.sample_time * (1 + NOISE_OF_SUM) for loop in self.loops]
        for loop, count in zip(self.loops, counts, strict=True):
            if count > most:
                place = f"feedback[{loop.entry}].sample_time = {loop.sample_time!r}"
                raise SceneError([f"{place}: makes {count:.3g} samples in this run: at most {most} are taken"])
        self.times = [
            (start + loop.sample_time * np.arange(int(count) + 1)).tolist()
            for loop, count in zip(self.loops, counts, strict=True)
        ]
        every = np.unique([time for times in self.times for time in times])
        apart = np.append(True, np.diff(every) > NOISE_OF_SUM * np.abs(every[1:]))
        return [float(time) for time in every[apart]]

    def take(self, time: float, y: Sequence[float]) -> None:
        """The samples that are due at a time (s) and a state."""
        for loop, times, inputs in zip(self.loops, self.times, self.inputs, strict=True):
            k = bisect_right(times, time + NOISE_OF_SUM * abs(time) + ulp(0.0)) - 1
            if k >= 0 and time - times[k] <= NOISE_OF_SUM * abs(time):
                inputs[k:] = [float(input_of(loop, y))]

    def at(self, time: float) -> list[float]:
        """Held inputs of all loops at a time (s) of the motion; raise ComputationError if its samples are not known."""
        held = []
        for loop, times, inputs in zip(self.loops, self.times, self.inputs, strict=True):
            k = bisect_right(times, time) - 1 - loop.delayed_samples
            if not times or k >= len(inputs):
                raise ComputationError("the held inputs of sampled feedback are not stored with a run")
            held.append(inputs[k] if k >= 0 else 0.0)
        return held

    def beside(self, times: Any) -> list[Any]:
        """The same at times (S,) at once, each (S,)."""
        if not self.loops:
            return []
        columns = [self.at(time) for time in np.ravel(times).tolist()]
        return [np.reshape(row, np.shape(times)) for row in zip(*columns, strict=True)]
