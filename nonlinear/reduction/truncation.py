"""Nonlinear motion in a few modes: which to retain, the run, and its error with respect to the whole scene.

The Lagrangian of a plane scene is even about its equilibrium: neglected modes respond at the third power of the
amplitude and act back at the fifth, so a single mode already has the κ of ω(a) = ω (1 + κ a²).  As measured, the
frequency of the lowest mode of 2 to 10 bobs alone is wrong by 0.006 % at 20°, 0.1 % at 40°, 0.6 % at 60°, with two
more modes by 0.004 % at 60°; shapes are wrong sooner, by a³.  The truncation error is reported.  The largest error of
any angle is estimated as the sum of

- SAFETY times the largest distance, so far and within the slowest period to come, to a second, finer run: with
  the next MORE shapes, or about twice as many as there are, and every mode within NEAR of 1:1, 1:2 or 1:3 of a kept
  one, wherever it is in the table, at a tenth of the tolerance (so that it sees the integrator's error too);
- the part of the start outside even those, by its linear motion: max_i Σ_s |φ_is| (η_s² + (η_s'/ω_s)²)^½.

It grows with time, and is an estimate, not a bound: it assumes that the finer run is closer to the whole motion.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from numbers import Integral
from typing import Any, NamedTuple

import numpy as np

from modal.errors import SceneError
from modal.modes import Modes
from modal.report import Displayed
from modal.scene import Scene, refusals
from modal.types import Floats, Ints
from nonlinear.integration import (
    SCIPY,
    SMALLEST,
    TRUNCATED,
    Choice,
    Trajectory,
    extent,
    modes_of,
    prepare,
    sample_times,
    validate,
    validate_numbers,
)
from nonlinear.reduction.truncated import Truncated
from nonlinear.system import State, System, initial_state, system_of, validate_state

SAFETY = 2.0
NEGLIGIBLE = 1e-8  # fraction of the start's energy that an automatic choice may neglect
MARGIN = 4  # modes kept beyond those of the start: a twentieth of the error, a quarter more calls
MORE = 8  # least number of further shapes in the finer run
RATIOS, NEAR = (1, 2, 3), 0.1  # resonant ratios of frequencies, and the relative width of a resonance
FURTHEST = 600.0  # largest exponent of a growth that is evaluated


class Kept(NamedTuple):
    """One shape: the number of its mode in the table and of its copy, both from 1."""

    mode: int
    copy: int


@dataclass(frozen=True, eq=False, repr=False)
class Truncation(Displayed):
    """A trajectory in the `kept` shapes (R,) with natural frequencies `omega` (R,) in rad/s.

    `outside` is the fraction of the start's linear energy outside them, `errors` (T,) in rad the estimated largest
    error of any angle so far.
    """

    trajectory: Trajectory
    kept: tuple[Kept, ...]
    omega: Floats
    outside: float
    errors: Floats

    @property
    def error(self) -> float:
        """The estimated largest error of any angle at the end (rad)."""
        return float(self.errors[-1])

    @property
    def frozen(self) -> float:
        """The shortest period kept (s): all faster modes are frozen; infinite where nothing oscillates."""
        fastest = float(self.omega.max())
        return 2 * np.pi / fastest if fastest else np.inf


@dataclass(frozen=True, eq=False, repr=False)
class Survey(Displayed):
    """A start expanded in all C shapes of the undamped scene, φᵀMφ = 1: `shapes` and `dual` = MΦ are (half, C)."""

    scene: Scene
    system: System
    modes: Modes
    kept: tuple[Kept, ...]
    shapes: Floats
    dual: Floats
    start: State

    @cached_property
    def value(self) -> Any:
        """λ of every shape (rad/s), (C,)."""
        return self.modes.eigenvalue[[one.mode - 1 for one in self.kept]]

    @cached_property
    def swings(self) -> Floats:
        """ω of every shape (rad/s), or its growth rate (1/s), (C,)."""
        return np.asarray(np.abs(self.value))

    @cached_property
    def amplitude(self) -> Floats:
        """(η² + (η'/ω)²)^½ of every shape, (C,); 0 of a translation, which is always kept."""
        y, omega = self.equations(np.arange(len(self.kept))).begin(self.start), self.swings
        swings = omega > 0
        return np.where(swings, np.hypot(y[: len(omega)], y[len(omega) : 2 * len(omega)] / (omega + ~swings)), 0.0)

    @cached_property
    def outside(self) -> Floats:
        """Fraction of the start's energy in the shapes from each one on, (C + 1,)."""
        energy = (self.amplitude * self.swings) ** 2
        left = np.append(np.cumsum(energy[::-1])[::-1], 0.0)
        return left / (left[0] or 1.0)

    def columns(self, modes: int) -> int:
        """Number of shapes of the lowest modes."""
        return int(self.modes.multiplicity[:modes].sum())

    def automatic(self) -> int:
        """Number of lowest modes that contain the start, plus MARGIN."""
        count = int(np.argmax(self.outside <= NEGLIGIBLE))
        return min(self.kept[max(count, 1) - 1].mode + MARGIN, len(self.modes))

    def judging(self, count: int) -> Ints:
        """The shapes of the finer run for the first `count` shapes: the next ones, and all that resonate with them."""
        tuned = np.multiply.outer(RATIOS, self.swings[:count]).ravel()
        answers = np.any(np.abs(self.swings[:, None] - tuned) < NEAR * tuned, axis=1)
        answers[: self.columns(self.kept[min(max(2 * count, count + MORE), len(self.kept)) - 1].mode)] = True
        return np.flatnonzero(answers)

    def missed(self, judging: Ints, elapsed: Floats) -> Floats:
        """Largest angle (rad) to which all other shapes can add up in their linear motion so far, (T,)."""
        left = np.delete(np.arange(len(self.kept)), judging)
        angles, rate = np.abs(self.shapes[-self.system.n_links :, left]) * self.amplitude[left], self.value.real[left]
        grows = rate > 0
        growth = np.exp(np.minimum(np.multiply.outer(elapsed, rate[grows]), FURTHEST))
        return np.asarray(angles[:, ~grows].sum(axis=1).max() + growth @ angles[:, grows].max(axis=0))

    def equations(self, chosen: Ints) -> Truncated:
        """The reduced equations in these shapes."""
        shapes, dual = (np.ascontiguousarray(part[:, chosen]) for part in (self.shapes, self.dual))
        return Truncated(self.system, self.system.rest, shapes, dual)


def simulate_truncated(
    scene: Scene,
    duration: float,
    modes: int | None = None,
    *,
    start: State | None = None,
    tolerance: float = 1e-9,
    method: str = "DOP853",
    output: int | Sequence[float] | Floats | None = None,
    report: Callable[[float], object] = lambda elapsed: None,
) -> Truncation:
    """The motion of a plane scene over `duration` seconds in the lowest `modes` of the table without dampers.

    All shapes that share a frequency are kept together, and the translation of a free cart always.  By default, `modes`
    is the number that contain the start, plus a margin.  `method` is one of SciPy's; everything else is as in
    `nonlinear.simulate`, except that `report` covers two runs.  Where Ctrl-C stops the second one the error is
    infinite. Raises SceneError for a scene in space and for invalid arguments, ComputationError where the modes cannot
    be computed, SimulationError where the integrator fails.
    """
    validate_numbers(duration, tolerance, 0.0)
    _validate(scene, modes, method)
    system = system_of(scene)
    state, times = validate(
        lambda: validate_state(start if start is not None else initial_state(scene), system),
        lambda: sample_times(scene, duration, 0.0, output),
    )
    survey = survey_modes(scene, system, state)
    if modes is not None and modes > len(survey.modes):
        raise SceneError([f"modes {modes}: this scene has {len(survey.modes)}"])
    return in_modes(survey, modes or survey.automatic(), times, method=method, tolerance=tolerance, report=report)


def in_modes(
    survey: Survey,
    modes: int,
    times: Floats,
    *,
    method: str = "DOP853",
    tolerance: float,
    report: Callable[[float], object] = lambda elapsed: None,
) -> Truncation:
    """The motion of a survey's start at these times (T,) in s, in its lowest `modes`."""
    fewer = survey.columns(modes)
    judging = survey.judging(fewer)
    first = _run(survey, np.arange(fewer), times, method, tolerance, report)
    second = _run(survey, judging, first.times, method, tolerance / 10, report)
    whole = second.complete
    gone = np.abs(first.motion.links - second.motion.links).max(axis=1) if whole else np.full(len(first.times), np.inf)
    elapsed, swings = first.times - first.times[0], survey.swings[:fewer]
    period = 2 * np.pi / float(swings[swings > 0].min(initial=np.inf))
    errors = SAFETY * _within(elapsed, gone, period) + survey.missed(judging, elapsed)
    return Truncation(
        trajectory=replace(first, run=replace(first.run, error=float(errors[-1]))),
        kept=survey.kept[:fewer],
        omega=survey.swings[:fewer],
        outside=float(survey.outside[fewer]),
        errors=errors,
    )


def _within(elapsed: Floats, values: Floats, period: float) -> Floats:
    """The largest of the values (T,) so far and in the next `period` (s)."""
    last = np.searchsorted(elapsed, elapsed + period, side="right") - 1
    return np.asarray(np.maximum.accumulate(values)[last])


def _validate(scene: Scene, modes: int | None, method: str) -> None:
    found = refusals(scene, "motion in a few modes")
    whole = isinstance(modes, Integral) and not isinstance(modes, bool)
    if modes is not None and not (whole and modes >= 1):
        found.append(f"modes {modes!r}: must be a whole number from 1")
    if method not in SCIPY:
        found.append(f"method {method}: must be one of {', '.join(SCIPY)}")
    if found:
        raise SceneError(found)


def survey_modes(scene: Scene, system: System, start: State) -> Survey:
    """The modes of the scene without its dampers, and the start in them; SceneError where they do not span it."""
    still = scene.conservative
    modes = modes_of(still)
    phi = modes.matrix.real
    if len(phi.row) < modes.on_cart + scene.n_links:
        raise SceneError(["support.mass = 0.0: the modes of this scene do not span its motion"])
    kept = tuple(Kept(row + 1, copy + 1) for row, copy in zip(phi.row.tolist(), phi.copy.tolist(), strict=True))
    return Survey(scene, system, modes, kept, phi.shapes, phi.dual, start)


def _run(
    survey: Survey, chosen: Ints, times: Floats, method: str, tolerance: float, report: Callable[[float], object]
) -> Trajectory:
    equations, size = survey.equations(chosen), extent(survey.start, survey.system)
    words = f"{len(chosen)} of {len(survey.kept)} shapes"
    choice = Choice(TRUNCATED, method, False, words, max(tolerance, SMALLEST))
    ready = prepare(survey.scene, equations, choice, survey.start, times, size)
    return ready.go(report=report)
