"""Symmetric motions of populations along a parameter of the scene, and the changes of their stability.

The growth rates of every sector are computed at the values of the variation; between two at which one has opposite
signs its root is found (Brent's method), by the Floquet multipliers and by the averaged equations.  So is the value at
which the motion itself dies out: where small swings about rest begin to decay.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from math import ceil

import numpy as np
import scipy

from modal.errors import ComputationError
from modal.report import Displayed, Summary, TextResult, counted, silent
from modal.scene import Scene, require
from modal.scene.doors import checked, formerly
from modal.scene.parameters import Variation, variation_of, vary
from modal.types import Crew, Floats, map_by_crew
from nonlinear.averaging import averaged_pattern, patterns_of, rest_growth
from nonlinear.orbits import PatternOrbit, pattern_orbit, require_cycles
from nonlinear.orbits.continuation import PLACE_ACCURACY
from nonlinear.synchronization.sectors import SymmetricMotion, symmetric_motion
from nonlinear.system import populations_of, representation_obstacles

Report = Callable[[int], object]


@dataclass(frozen=True)
class Threshold:
    """A value at which disturbances of a `sector` of a motion begin to grow (`rises`) or to decay, as the number grows.

    `averaged` is the same by the averaged equations, None if they have none next to it; `beat` (rad/s) the rate at
    which the perturbation oscillates about the orbit, and `reason` a sentence. A `sector` "" is the motion itself: it
    emerges from rest or dies out.
    """

    value: float
    averaged: float | None
    pattern: str
    sector: str
    rises: bool
    becomes: str
    beat: float = 0.0
    reason: str = ""


Crossing = tuple[Threshold, SymmetricMotion | None]
"""A threshold with the motion there."""


@dataclass(frozen=True, eq=False, repr=False)
class MotionBranch(Displayed):
    """A symmetric motion at K ascending values of a number, those at which it exists."""

    name: str
    variation: Variation
    values: Floats
    motions: tuple[SymmetricMotion, ...]

    def _summary(self) -> Summary:
        return Summary(f"Populations {self.name} at {counted(len(self.values), 'value', 'values')}", [])

    @cached_property
    def sectors(self) -> tuple[str, ...]:
        """The names of its sectors: of the first value."""
        return self.motions[0].names if self.motions else ()

    def growth(self, sector: str) -> Floats:
        """The growth rate (1/s) of a sector at every value, (K,); NaN if the motion has no such sector."""
        return np.array([self._of(motion, sector, motion.orbit) for motion in self.motions])

    def averaged_growth(self, sector: str) -> Floats:
        """The same by the averaged equations, (K,)."""
        return np.array([self._of(motion, sector, motion.averaged) for motion in self.motions])

    def _of(self, motion: SymmetricMotion, sector: str, column: object) -> float:
        growth = getattr(column, "growth", None)
        return growth[motion.names.index(sector)] if growth is not None and sector in motion.names else np.nan

    @cached_property
    def is_stable(self) -> tuple[bool, ...]:
        """Whether all perturbations decay, at every value."""
        return tuple(motion.is_stable for motion in self.motions)

    @cached_property
    def angle(self) -> Floats:
        """The largest angle (rad) of any link, (K,)."""
        return np.array([motion.orbit.orbit.amplitude if motion.orbit else np.nan for motion in self.motions])

    @cached_property
    def omega(self) -> Floats:
        """The frequency (rad/s), (K,)."""
        return np.array([motion.orbit.orbit.omega if motion.orbit else np.nan for motion in self.motions])


@dataclass(frozen=True, eq=False, repr=False)
class PopulationDiagram(TextResult):
    """The symmetric motions of a scene's populations along a number, and all thresholds in ascending order."""

    scene: Scene
    variation: Variation
    branches: tuple[MotionBranch, ...]
    thresholds: tuple[Threshold, ...]
    writer = "nonlinear.synchronization.population_report:diagram_text"

    def windows(self, branch: MotionBranch) -> tuple[tuple[float, float], ...]:
        """The intervals in which a motion exists; of one that was not found everywhere in between, its ends."""
        values, windows = self.variation.values, list[tuple[float, float]]()
        begin = float(values[0]) if branch.values[0] == values[0] else None
        for threshold in self.thresholds:
            if threshold.pattern == branch.name and not threshold.sector:
                if not threshold.rises and begin is not None:
                    windows.append((begin, threshold.value))
                begin = threshold.value if threshold.rises else None
        if begin is not None:
            windows.append((begin, float(branch.values[-1])))
        return tuple(windows) or ((float(branch.values[0]), float(branch.values[-1])),)

    def intervals(self, branch: MotionBranch) -> tuple[tuple[float, float], ...]:
        """The intervals in which a motion is stable."""
        return tuple(inside for low, high in self.windows(branch) for inside in self._stable(branch, low, high))

    def _stable(self, branch: MotionBranch, low: float, high: float) -> Iterator[tuple[float, float]]:
        """Those within one interval in which it exists."""
        first = branch.motions[int(np.searchsorted(branch.values, low))]
        growth = first.orbit.growth if first.orbit else ()
        growing = {name for name, rate in zip(first.names, growth, strict=True) if rate > 0}
        begin = None if growing else low
        for threshold in self.thresholds:
            if threshold.pattern == branch.name and threshold.sector and low < threshold.value < high:
                growing = growing | {threshold.sector} if threshold.rises else growing - {threshold.sector}
                if growing and begin is not None:
                    yield begin, threshold.value
                begin = None if growing else threshold.value if begin is None else begin
        if begin is not None:
            yield begin, high


@checked
def has_patterns(scene: Scene) -> bool:
    """Whether the populations of a scene have symmetric motions."""
    return scene.is_structured and len(populations_of(scene)) <= 2 and not any(representation_obstacles(scene))


@formerly(variation="vary")
def follow_populations(
    scene: Scene, vary: str | Variation, report: Report = silent, *, crew: Crew | None = None
) -> PopulationDiagram:
    """The symmetric motions of a scene along a number; `report` is called with the number followed so far.

    A `crew` follows several motions at once.

    Raise SceneError for a variation of fewer than two values or of a count, ComputationError if nothing excites the
    scene or populations have no symmetric motions.
    """
    variation = variation_of(vary)
    require_cycles(scene, variation)
    require(scene, "a prediction of synchronization")
    walk = PopulationWalk(scene, _divided(variation))
    branches, thresholds = list[MotionBranch](), list[Threshold]()
    names = [pattern.name for pattern in patterns_of(walk.scene_at(variation.values[0]))]
    for branch, crossings in map_by_crew(walk.follow, names, crew):
        branches.append(_join(branch, crossings))
        thresholds += [threshold for threshold, _ in crossings]
        report(len(branches))
    return PopulationDiagram(
        scene, variation, tuple(branches), tuple(sorted(thresholds, key=lambda threshold: threshold.value))
    )


def _divided(variation: Variation, steps: int = 8) -> Variation:
    """The same range in at least so many steps, each short enough that a motion is found next to the one before."""
    values = np.array(variation.values)
    parts = max(1, ceil(steps / (len(values) - 1)))
    places = np.arange(parts * (len(values) - 1) + 1) / parts
    scale = np.log(values) if variation.log else values
    finer = np.interp(places, np.arange(len(values)), scale)
    finer = np.exp(finer) if variation.log else finer
    finer[::parts] = values
    return replace(variation, values=tuple(finer.tolist()))


def _join(branch: MotionBranch, crossings: list[Crossing]) -> MotionBranch:
    """The branch with the motions at its thresholds."""
    points = [*zip(branch.values.tolist(), branch.motions, strict=True)]
    points += [(threshold.value, motion) for threshold, motion in crossings if motion is not None]
    points.sort(key=lambda pair: pair[0])
    values, motions = [value for value, _ in points], tuple(motion for _, motion in points)
    return MotionBranch(branch.name, branch.variation, np.array(values), motions)


def _root(growth: Callable[[float], float], a: float, b: float) -> float:
    """Where a growth rate vanishes between two values, by Brent's method, as accurate as an orbit is."""
    return float(scipy.optimize.brentq(growth, a, b, xtol=PLACE_ACCURACY * abs(b), rtol=PLACE_ACCURACY))


class PopulationWalk:
    """Symmetric motions at the values of a variation, each found next to the one before."""

    def __init__(self, scene: Scene, variation: Variation) -> None:
        self.scene, self.variation = scene, variation

    def scene_at(self, value: float) -> Scene:
        """The scene with the number at a value."""
        return vary(self.scene, {self.variation.path: value})

    def motion(self, name: str, value: float, neighbour: SymmetricMotion | None) -> SymmetricMotion:
        """The motion of a name at a value."""
        pattern = next(motion for motion in patterns_of(self.scene_at(value)) if motion.name == name)
        return symmetric_motion(pattern, neighbour if neighbour is not None and neighbour.orbit else None)

    def follow(self, name: str) -> tuple[MotionBranch, list[Crossing]]:
        """The motion of a name and its thresholds, in ascending order."""
        branch = self.branch(name)
        return branch, sorted(self.thresholds(name, branch), key=lambda pair: pair[0].value)

    def branch(self, name: str) -> MotionBranch:
        """The motion of a name at all values at which it exists."""
        values, motions = list[float](), list[SymmetricMotion]()
        previous: SymmetricMotion | None = None
        for value in self.variation.values:
            previous = self.motion(name, value, previous)
            if previous.orbit is not None:
                values.append(value)
                motions.append(previous)
        return MotionBranch(name, self.variation, np.array(values), tuple(motions))

    def thresholds(self, name: str, branch: MotionBranch) -> Iterator[Crossing]:
        """All its thresholds, with the motions there."""
        motions_at = dict(zip(branch.values.tolist(), branch.motions, strict=True))
        for a, b in pairwise(self.variation.values):
            motion, following = motions_at.get(a), motions_at.get(b)
            if motion and following and motion.names == following.names and motion.orbit and following.orbit:
                for sector, (low, high) in enumerate(zip(motion.orbit.growth, following.orbit.growth, strict=True)):
                    if low * high < 0:
                        yield self._crossing(name, sector, (a, motion), (b, following))
        yield from self._ends(name, set(motions_at))

    def _crossing(
        self, name: str, sector: int, low: tuple[float, SymmetricMotion], high: tuple[float, SymmetricMotion]
    ) -> tuple[Threshold, SymmetricMotion]:
        """Where the growth rate of a sector vanishes between two values."""
        (a, before), (b, after) = low, high
        orbits: list[PatternOrbit] = [orbit for orbit in (before.orbit,) if orbit]
        assert after.orbit is not None

        def exact(value: float) -> float:
            pattern = orbits[-1].pattern.at(self.scene_at(value))
            orbits.append(pattern_orbit(pattern, orbits[-1]))
            return orbits[-1].growth[sector]

        at = _root(exact, a, b)
        motion = self.motion(name, at, before)
        orbit = motion.orbit
        assert orbit is not None
        rises = after.orbit.growth[sector] > 0
        others = max((rate for k, rate in enumerate(orbit.growth) if k != sector), default=-1.0)
        becomes = ("loses stability" if rises else "becomes stable") if others < 0 else ""
        within = self._averaged_root(name, sector, (a, before), (b, after))
        beat = orbit.beats[sector] if orbit.turns[sector] else 0.0
        root = Threshold(at, within, name, motion.names[sector], rises, becomes, beat, motion.crossing(sector))
        return root, motion

    def _averaged_root(
        self, name: str, sector: int, low: tuple[float, SymmetricMotion], high: tuple[float, SymmetricMotion]
    ) -> float | None:
        """The same by the averaged equations, within the range; None if there is none."""
        (a, motion), (b, _) = low, high
        neighbour = motion.averaged
        assert neighbour is not None
        first, last = self.variation.values[0], self.variation.values[-1]

        def growth(value: float) -> float:
            return averaged_pattern(neighbour.pattern.at(self.scene_at(value)), neighbour).growth[sector]

        try:
            for share in (0.0, 0.5, 1.0, 2.0):
                ends = max(first, a - share * (b - a)), min(last, b + share * (b - a))
                if growth(ends[0]) * growth(ends[1]) < 0:
                    return _root(growth, *ends)
        except ComputationError:
            pass
        return None

    def _ends(self, name: str, values: set[float]) -> Iterator[tuple[Threshold, None]]:
        """Where the motion emerges from rest or dies out: small swings about rest neither grow nor decay."""
        if len(values) == len(self.variation.values):
            return

        def growth(value: float) -> float:
            return rest_growth(next(motion for motion in patterns_of(self.scene_at(value)) if motion.name == name))

        for a, b in pairwise(self.variation.values):
            low, high = growth(a), growth(b)
            if low * high < 0:
                at = _root(growth, a, b)
                yield Threshold(at, at, name, "", high > 0, "emerges from rest" if high > 0 else "dies out"), None
