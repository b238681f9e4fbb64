"""The engine that is always available: DOP853 over lanes, in NumPy."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from modal.types import Floats
from nonlinear.chaos import TRANSIENT
from nonlinear.dynamics import Lanes
from nonlinear.ensembles.results import MemberResults, Wanted
from nonlinear.integration import pacing
from nonlinear.integration.arguments import extents, shaken
from nonlinear.integration.crowds import RailWork, switching
from nonlinear.integration.lanes import LaneTask, integrate
from nonlinear.integration.watches import Crossings, FirstTurns, Growth, GrowthSamples, Largest, Samples
from nonlinear.integration.within import Watch, fill
from nonlinear.system import Layout, Numbers


def run(numbers: Numbers, y: Floats, wanted: Wanted) -> MemberResults:
    """Members with these numbers from y (size, S) on."""
    plain = Lanes(numbers)
    results = _run(plain, numbers, y, wanted)
    if wanted.stretching:
        results.stretching = stretching(numbers, y[: 2 * plain.layout.half], wanted)
    return results


def task_of(lanes: Lanes, numbers: Numbers, y: Floats, wanted: Wanted) -> tuple[LaneTask, Floats, Floats]:
    """What to integrate, natural units of y, and the error (in these) allowed in a step."""
    units, layout = pacing.units_of(numbers), lanes.layout
    scale, slope = units.scale(layout), slope_of(lanes, numbers, y)
    start = numbers.arrays, numbers.system.rest[:, None], layout, y, scale
    size = shaken(*start, np.array([0.0, wanted.duration])) if numbers.system.prescribed_motions else extents(*start)
    relative, absolute, first = pacing.tolerances(y, slope, scale, size, units.rate, wanted.tolerance)
    absolute = np.ascontiguousarray(np.broadcast_to(absolute, y.shape))
    return LaneTask(lanes, numbers, y, wanted.duration, relative, absolute, first), scale, relative * size


@dataclass(eq=False)
class Watches:
    """The measures within steps."""

    samples: Samples | None = None
    turns: FirstTurns | None = None
    largest: Largest | None = None
    section: Crossings | None = None

    @property
    def all(self) -> list[Watch]:
        """Those that there are."""
        return [watch for watch in (self.samples, self.turns, self.largest, self.section) if watch is not None]

    def added_to(self, results: MemberResults) -> MemberResults:
        """With the findings of these."""
        return replace(
            results,
            rows=self.samples.rows if self.samples else None,
            first_turns=self.turns.times if self.turns else None,
            largest=self.largest.angle if self.largest else None,
            crossed=self.section.crossings if self.section else None,
        )


def watches_of(layout: Layout, y: Floats, slope: Floats, wanted: Wanted) -> Watches:
    """Return the measurements of members from y (size, S) on, with y' there."""
    section = wanted.section
    return Watches(
        Samples(np.array(wanted.times), y) if wanted.times else None,
        FirstTurns(layout, y, slope) if wanted.first_turns else None,
        Largest(layout, y) if wanted.largest else None,
        Crossings(layout, y, slope, section.row, section.level, section.direction) if section else None,
    )


def slope_of(lanes: Lanes, numbers: Numbers, y: Floats) -> Floats:
    """The y' of members at y (size, S)."""
    slope = np.empty_like(y)
    fill(lanes.rates(numbers)(y), slope)
    return slope


def _run(lanes: Lanes, numbers: Numbers, y: Floats, wanted: Wanted) -> MemberResults:
    layout = lanes.layout
    task, scale, local = task_of(lanes, numbers, y, wanted)
    growth, watches = Growth(layout, scale, local), watches_of(layout, y, slope_of(lanes, numbers, y), wanted)
    if not numbers.switching:
        outcome = integrate(task, [growth, *watches.all])
        return watches.added_to(MemberResults(outcome.y, growth.error, growth.horizon, outcome.reasons))
    task, none = switching(task), np.full(y.shape[1], np.nan)
    rubbing = [RailWork(task.lanes, y.shape[1])] if task.lanes.presses else []
    outcome = integrate(task, [*rubbing, *watches.all])
    rubbed = 0.0 if layout.works else task.lanes.work(outcome.y, outcome.state) + sum(watch.work for watch in rubbing)
    return watches.added_to(MemberResults(outcome.y, none, none.copy(), outcome.reasons, rubbed=rubbed))


def stretching(numbers: Numbers, y: Floats, wanted: Wanted) -> Floats:
    """What ln |v| gains of a tangent vector in this many seconds after a transient, (S,).

    It begins in a direction drawn at random, the same for all.
    """
    task, scale = pacing.stretched(numbers, y, (1 + TRANSIENT) * wanted.duration, wanted.tolerance)
    watch = GrowthSamples(scale, np.array([TRANSIENT, 1 + TRANSIENT]) * wanted.duration, y, lambda elapsed: None)
    outcome = integrate(switching(task), [watch])
    growth = watch.rows[1] - watch.rows[0]
    growth[[*outcome.reasons]] = np.nan
    return np.asarray(growth)
