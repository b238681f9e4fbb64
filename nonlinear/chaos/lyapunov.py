"""The largest Lyapunov exponent λ of motions in the plane: the mean growth rate of ln |v| for a small perturbation v.

    λ = lim ln(|v(t)| / |v(0)|) / t

v obeys the tangent equations and is rescaled to length 1 again and again, its gains being added up [Benettin1980a],
[Benettin1980b]; a kick of an escapement changes it by saltation (`nonlinear.integration.changes`). Under forces and on
a moving support y' depends on time; v does not change it, so that its own exponent, 0, is not among these. A run of
finite length cannot distinguish every λ from zero: in regular motion |v| grows like t, in natural units from 1 to about
sqrt(g/l) t, which over T seconds looks like λ = ln(sqrt(g/l) t)/T.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from math import ceil, log, sqrt
from typing import Any

import numpy as np
import scipy

from modal.errors import ComputationError, SceneError
from modal.report import TextResult, silent, visible
from modal.scene import Scene, frequencies_of, require, title_of, validate_scene
from modal.scene.doors import checked, checked_number, formerly
from modal.types import Crew, Floats, map_by_crew
from nonlinear.dynamics import Mechanics
from nonlinear.integration import validate, validate_numbers, validate_whole
from nonlinear.integration.crowds import switching
from nonlinear.integration.lanes import integrate
from nonlinear.integration.pacing import stretched
from nonlinear.integration.switches import numbers_of as switching_numbers
from nonlinear.integration.watches import GrowthSamples
from nonlinear.system import Layout, State, initial_state, numbers_of, system_of, validate_state

TRANSIENT = 0.5
"""Format: fraction of the duration run beforehand, for v to align with the fastest growing direction."""
SPREAD_MAX = 10.0
"""Limit: largest `spread` (rad), "must be a finite number from 0 to 10"."""
STARTS_TOGETHER = 256
"""Cost: starts that a crew computes together: 64 at once take hardly longer than 4; twice as many of a sweep at
energies, four times as many motions of one over numbers; benchmarks/ensembles.py."""
GROWTH_SAMPLES_MAX = 50_000_000
"""Limit: stored numbers of the growth, half of those of an ensemble's samples: "must be at most … s for … starts
of this scene"."""
DURATION_TIMES = 200.0
"""Limit: default of `duration` in sqrt(l/g) of the longest link."""
DURATION_TIMES_MIN = 20.0
"""Limit: the shortest duration, "must be at least … s for this scene, 20 sqrt(l/g)"."""
TOLERANCE = 1e-7
"""Limit: default of `tolerance`: a trajectory soon leaves the true one, but both have the same mean growth."""
BLOCKS = 10
"""Format: blocks of time for an uncertainty, each longer than the memory of the growth."""
STARTS_FOR_SPREAD_MIN = 4
"""Limit: number of starts whose spread gives an uncertainty; with fewer "use 4 starts or more"."""
BLOCKS_WIDENING = 1.4
"""Physics: an uncertainty that blocks of time miss, as chaotic motion sticks to islands for longer than a block.

Measured on 700 single runs: 2 standard uncertainties from the blocks contain λ in 84 to 92 of 100, not in 95.
"""
CONFIDENCE = 0.95
"""Format: coverage probability of the intervals, as reports say."""


@dataclass(frozen=True, eq=False, repr=False)
class Exponent(TextResult):
    """λ of E starts: `growth` (K, E) is the gain of ln |v| between the `times` (K + 1,) in s, including the transient.

    `energy_drift` is the largest change of energy over a run, relative to g Σ b; NaN in a scene with dampers.
    """

    scene: Scene
    times: Floats
    growth: Floats
    transient: float
    energy_drift: float

    @property
    def interrupted(self) -> bool:
        """Whether Ctrl-C ended the measurement early."""
        return float(self.times[-1]) < (1 + TRANSIENT) / TRANSIENT * self.transient * (1 - 1e-9)

    @property
    def _first(self) -> int:
        return int(np.searchsorted(self.times, self.transient))

    @property
    def ensemble(self) -> int:
        """Number of starts, E."""
        return int(self.growth.shape[1])

    @property
    def duration(self) -> float:
        """Time (s) over which each start was measured, without the transient."""
        return float(self.times[-1] - self.times[self._first])

    @property
    def members(self) -> Floats:
        """λ (1/s) of every start, (E,)."""
        return np.asarray(self.growth[self._first :].sum(0) / self.duration)

    @property
    def value(self) -> float:
        """λ (1/s), the mean over the starts."""
        return float(self.members.mean())

    @property
    def blocks(self) -> Floats:
        """λ (1/s), the mean over the starts, in consecutive blocks of time."""
        rows = np.array_split(np.arange(self._first, len(self.growth)), BLOCKS)
        return np.array([self.growth[k].sum(0).mean() / (self.times[k[-1] + 1] - self.times[k[0]]) for k in rows])

    @property
    def spread(self) -> float:
        """Standard deviation (1/s) of λ between the starts; 0 for one start."""
        return float(self.members.std(ddof=1)) if self.ensemble > 1 else 0.0

    @property
    def by_starts(self) -> bool:
        """Whether there are enough starts to estimate the uncertainty from their spread."""
        return self.ensemble >= STARTS_FOR_SPREAD_MIN

    @property
    def error(self) -> float:
        """Standard uncertainty (1/s): from the blocks of time or from the starts, whichever is larger.

        With fewer than four starts the uncertainty from the blocks is multiplied by 1.4.
        """
        in_time = float(self.blocks.std(ddof=1)) / sqrt(BLOCKS)
        return max(in_time if self.by_starts else BLOCKS_WIDENING * in_time, self.spread / sqrt(self.ensemble))

    @property
    def coverage(self) -> float:
        """Student's t: half a 95 % confidence interval in standard uncertainties."""
        return float(scipy.special.stdtrit((self.ensemble if self.by_starts else BLOCKS) - 1, (1 + CONFIDENCE) / 2))

    @property
    def half_width(self) -> float:
        """Half the 95 % confidence interval (1/s)."""
        return self.coverage * self.error

    def regular(self, since: Any) -> Any:
        """The apparent λ of regular motion (1/s), `since` seconds after the transient: |v| grows to e sqrt(g/l) t."""
        return _apparent(self.scene, self.transient, since)

    @property
    def floor(self) -> float:
        """The apparent λ of regular motion at the end (1/s)."""
        return float(self.regular(self.duration))

    @property
    def is_positive(self) -> bool:
        """Whether λ is distinguishable from zero, and above it."""
        return self.value - self.half_width > self.floor

    @property
    def is_negative(self) -> bool:
        """Whether λ is distinguishable from zero, and below it: nearby motions converge."""
        return self.value + self.half_width < -self.floor

    @property
    def bound(self) -> float:
        """An upper bound of λ (1/s), where it is indistinguishable from zero."""
        return max(1 / self.duration, self.value + self.half_width)

    @property
    def chaotic(self) -> int:
        """The number of starts whose λ is too large for regular motion."""
        return int(np.sum(self.members > self.floor))

    @property
    def of_the_chaotic(self) -> Exponent:
        """The exponent of the chaotic starts alone: with regular islands, λ of all starts is a mixture."""
        return self.of(self.members > self.floor)

    def of(self, starts: Any) -> Exponent:
        """The exponent of some of the starts: indices or a mask."""
        return replace(self, growth=self.growth[:, starts])

    def running(self) -> tuple[Floats, Floats]:
        """Times (s) after the transient and the estimate of λ at each, for every start: (K,) and (K, E)."""
        times = self.times[self._first :]
        return times[1:], np.cumsum(self.growth[self._first :], axis=0) / (times[1:] - times[0])[:, None]

    def words(self, unit: float = 1.0) -> str:
        """λ ± its standard uncertainty as a multiple of `unit` (1/s), or its upper bound."""
        if not (self.is_positive or self.is_negative):
            return f"< {self.bound / unit:.2g}"
        places = max(0, 1 - int(np.floor(np.log10(max(self.error / unit, 1e-12)))))
        return f"{self.value / unit:.{places}f} ± {self.error / unit:.{places}f}"

    @property
    def equation(self) -> str:
        """λ = … ± … 1/s, or λ < … 1/s."""
        return f"λ {'= ' if self.is_positive or self.is_negative else ''}{self.words()} 1/s"

    def text(self) -> str:
        """A report of λ, its meaning and its measurement, in a few lines."""
        lines = [f"{visible(title_of(self.scene))}: largest Lyapunov exponent"]
        if self.is_positive or self.is_negative:
            change = "doubles" if self.is_positive else "halves"
            lines.append(f"  {self.equation}: a small error {change} every {log(2) / abs(self.value):.3g} s")
            low, high = (f"{self.value + side * self.half_width:.3g}" for side in (-1, 1))
            lines.append(f"  ± is one standard uncertainty; 95 % confidence interval: {low} to {high} 1/s")
        else:
            lines.append(f"  {self.equation}: not distinguishable from zero in a run of this length")
        lines.append(
            f"  {self.ensemble} starts over {self.duration:.4g} s each, after {self.times[self._first]:.3g} s; "
            f"{self.chaotic} of them above {self.floor:.2g} 1/s, the limit for regular motion"
        )
        if STARTS_FOR_SPREAD_MIN <= self.chaotic < self.ensemble:
            lines.append(f"  of those alone {self.of_the_chaotic.equation}")
        if not self.by_starts:
            lines.append(
                f"  the uncertainty rests on blocks of time, widened {BLOCKS_WIDENING:g}-fold: "
                f"use {STARTS_FOR_SPREAD_MIN} starts or more"
            )
        if np.isfinite(self.energy_drift):
            lines.append(f"  energy drift {self.energy_drift:.1e}")
        return "\n".join(lines)


def _apparent(scene: Scene, transient: float, since: Any) -> Any:
    """The λ (1/s) that regular motion shows, `since` seconds after a transient."""
    return (1 + np.log(_fastest(scene) * (transient + since))) / since


def _fastest(scene: Scene) -> float:
    """sqrt(g/l) of the shortest link (rad/s), in which tangent vectors are measured."""
    return sqrt(scene.gravity / min(link.length for link in scene.links()))


@checked
def regular_exponent(scene: Scene, duration: float) -> float:
    """The apparent λ (1/s) of regular motion in this many seconds after the transient: values above it are chaotic.

    >>> from modal import load
    >>> from nonlinear.chaos import regular_exponent
    >>> f"{regular_exponent(load('chain-2'), 100.0):.4f}"
    '0.0715'
    """
    return float(_apparent(scene, TRANSIENT * duration, duration))


@formerly(ensemble="members")
@checked
def lyapunov_exponent(
    scene: Scene,
    duration: float | None = None,
    *,
    members: int = 16,
    starts: Sequence[State] | None = None,
    start: State | None = None,
    spread: float = 1e-3,
    tolerance: float = TOLERANCE,
    seed: int = 0,
    crew: Crew | None = None,
    report: Callable[[float], object] = silent,
) -> Exponent:
    """Compute λ of a plane scene from `duration` seconds, after a discarded transient of half that length.

    By default the duration is 200 sqrt(l/g) of the longest link, and the `starts` are `start`, by default the scene's
    own, and `members` − 1 more whose angles differ from it by up to `spread` (rad): in chaos they soon become
    independent, and together, if there are at least four, they give the uncertainty of λ.  `report` is called with the
    simulated time, out of 1.5 times the duration.  A `crew` computes 256 starts at a time.  After Ctrl-C λ comes
    from the part measured so far, if that is long enough.

    Raise SceneError for a scene in space, for motions of a support and forces that are no sines and for a duration that
    is too short.
    """
    require(scene, "a Lyapunov exponent")
    frequencies_of(scene)
    checked_number("spread", spread, 0.0, SPREAD_MAX)
    duration = usual_duration(scene) if duration is None else duration
    validate(
        lambda: validate_numbers(duration, tolerance, 0.0),
        lambda: validate_whole(1, members=members),
        lambda: validate_whole(0, seed=seed),
    )
    validate_duration(scene, duration)
    system = system_of(scene)
    layout = Layout.of(system, works=False)
    _refuse_endless(duration, _fastest(scene), members if starts is None else len(starts))
    rng = np.random.default_rng(seed)
    states = starts if starts is not None else nearby(start or initial_state(scene), members, spread, rng)
    y = np.stack([layout.begin(validate_state(state, system)) for state in states], axis=1)
    shortest = TRANSIENT * duration + DURATION_TIMES_MIN / DURATION_TIMES * usual_duration(scene)
    end = (1 + TRANSIENT) * duration
    grow = partial(_grow, scene, end, tolerance, shortest)
    if crew is None or y.shape[1] <= STARTS_TOGETHER:
        times, growth, last = grow(y, report)
    else:
        portions = np.array_split(y, range(STARTS_TOGETHER, y.shape[1], STARTS_TOGETHER), axis=1)
        parts = []
        for part in map_by_crew(grow, portions, crew):
            parts.append(part)
            report(end * len(parts) / len(portions))
        common_times = min((times for times, _, _ in parts), key=len)
        times, growth = (
            common_times,
            np.concatenate([growth[: len(common_times) - 1] for _, growth, _ in parts], axis=1),
        )
        last = np.concatenate([last for _, _, last in parts], axis=1)
    drift = float("nan")
    if not system.works:
        before, after = (Mechanics(system, layout.read(rows.T)).energy for rows in (y, last))
        largest = system.gravity * sum(float(group.block.b.sum()) for group in system.groups)
        drift = float(np.max(np.abs(after - before)) / largest)
    return Exponent(scene, times, growth, TRANSIENT * duration, drift)


def usual_duration(scene: Scene) -> float:
    """200 sqrt(l/g) of the longest link (s)."""
    validate_scene(scene)
    return DURATION_TIMES * sqrt(max(link.length for link in scene.links()) / scene.gravity)


def nearby(state: State, members: int, spread: float, rng: np.random.Generator) -> list[State]:
    """The state and further ones to make `members`, with angles perturbed by up to `spread` (rad)."""
    asides = rng.uniform(-spread, spread, (members, state.links.size))
    asides[0] = 0.0
    return [replace(state, links=state.links + aside) for aside in asides]


def validate_duration(scene: Scene, duration: float) -> None:
    """Raise SceneError for a duration (s) that is too short to distinguish growth from regular motion."""
    shortest = DURATION_TIMES_MIN / DURATION_TIMES * usual_duration(scene)
    if not shortest <= duration < float("inf"):
        words = f"must be at least {shortest:.3g} s for this scene, {DURATION_TIMES_MIN:g} sqrt(l/g)"
        raise SceneError([f"duration {duration!r}: {words}"])


def _refuse_endless(duration: float, rate: float, members: int) -> None:
    """Raise SceneError for more samples of the growth than can be stored."""
    if (samples := (1 + TRANSIENT) * duration * rate * members) > GROWTH_SAMPLES_MAX:
        longest = duration * GROWTH_SAMPLES_MAX / samples
        raise SceneError([f"duration {duration:g}: must be at most {longest:.3g} s for {members} starts of this scene"])


def _grow(
    scene: Scene, end: float, tolerance: float, shortest: float, y: Floats, report: Callable[[float], object] = silent
) -> tuple[Floats, Floats, Floats]:
    """Times (K + 1,), the gains of ln |v| between them (K, E), and the last y (size, E).

    Every start goes with its own steps; after Ctrl-C the times are those that all of them have reached.
    """
    system = system_of(scene)
    numbers = replace(numbers_of(scene, system=system), switching=switching_numbers(system))
    times = np.linspace(0.0, end, 3 * ceil(end * _fastest(scene) / 3) + 1)  # the transient is the first third
    task, scale = stretched(numbers, y, end, tolerance)
    gains = GrowthSamples(scale, times[1:], y, report)
    try:
        if reasons := integrate(switching(task), [gains]).reasons:
            raise ComputationError(f"a start {next(iter(reasons.values()))}")
    except KeyboardInterrupt:
        if not np.isfinite(gains.rows[times[1:] >= shortest]).all(1).any():
            raise
    count_known = int(np.isfinite(gains.rows).all(1).sum())
    return times[: count_known + 1], np.diff(gains.rows[:count_known], axis=0, prepend=0.0), gains.last
