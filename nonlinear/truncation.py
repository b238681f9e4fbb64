"""Nonlinear motion in a few modes: which to keep, the run, and how far it is from the motion of the whole scene.

The Lagrangian of a plane scene is even about its rest: modes that are left out answer at the third power of the
amplitude and act back at the fifth, so a single mode already has the κ of ω(a) = ω (1 + κ a²).  Measured, the lowest
mode of 2 to 10 bobs by itself swings at the wrong frequency by 0.006 % at 20°, 0.1 % at 40°, 0.6 % at 60°, with two
more modes by 0.004 % at 60°; shapes are wrong sooner, by a³.  What is left out is stated.  The largest angle by which
any link is wrong is taken to be the sum of

- SAFETY times the largest distance to a second run, with the next modes up to about twice as many shapes, at a tenth
  of the tolerance (so that it sees the integrator's error too);
- what of the start lies outside even those, by their linear motion: max_i Σ_s |φ_is| (η_s² + (η_s'/ω_s)²)^½.

It is an estimate, not a bound: it trusts that twice the modes are nearer to all of them.  Where a mode beyond those is
in 1:3 resonance with one that swings, both runs may miss it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from numbers import Integral
from typing import Any, NamedTuple

import numpy as np

from modal.all_shapes import all_shapes
from modal.errors import SceneError
from modal.linear import matrices
from modal.modes import Modes, natural_modes
from modal.rig import Floats
from modal.scene import Scene
from nonlinear.methods import Choice
from nonlinear.modal_coordinates import rest_angles
from nonlinear.plant import Plant, plant_of
from nonlinear.preparation import prepared
from nonlinear.requests import extent, gathered, insist_numbers, sampled
from nonlinear.starts import checked, start_of
from nonlinear.state import State
from nonlinear.steppers import SCIPY, SMALLEST
from nonlinear.trajectory import TRUNCATED, Trajectory
from nonlinear.truncated import Truncated

SAFETY = 2.0
NEGLIGIBLE = 1e-8  # share of the start's energy that an automatic choice may leave out
MARGIN = 4  # modes that it keeps beyond those of the start: a twentieth of the error, a quarter more calls
FURTHEST = 600.0  # the largest exponent of a growth that is written out


class Kept(NamedTuple):
    """One shape: the number of its mode in the table and which of that mode's copies it is, both from 1."""

    mode: int
    copy: int


@dataclass(frozen=True, eq=False)
class Truncation:
    """A trajectory in the `kept` shapes (R,) with natural frequencies `omega` (R,) in rad/s.

    `outside` is the share of the start's linear energy that they leave out, `error` (rad) what the largest angle of
    any link is stated to be wrong by at the times kept, `frozen` the shortest period kept (s).
    """

    trajectory: Trajectory
    kept: tuple[Kept, ...]
    omega: Floats
    outside: float
    error: float

    @property
    def frozen(self) -> float:
        """The shortest period kept (s): all that is faster is frozen; infinite where nothing swings."""
        fastest = float(self.omega.max())
        return 2 * np.pi / fastest if fastest else np.inf


@dataclass(frozen=True, eq=False)
class Survey:
    """A start seen in all C shapes of the undamped scene, φᵀMφ = 1: `shapes` and `dual` = MΦ are (half, C)."""

    scene: Scene
    plant: Plant
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
    def amplitude(self) -> Floats:
        """(η² + (η'/ω)²)^½ of every shape, (C,); 0 of a translation, which is always kept."""
        y, omega = self.system(len(self.kept)).begin(self.start), np.abs(self.value)
        swings = omega > 0
        return np.where(swings, np.hypot(y[: len(omega)], y[len(omega) : 2 * len(omega)] / (omega + ~swings)), 0.0)

    @cached_property
    def outside(self) -> Floats:
        """Share of the start's energy in the shapes from each one on, (C + 1,)."""
        energy = (self.amplitude * np.abs(self.value)) ** 2
        left = np.append(np.cumsum(energy[::-1])[::-1], 0.0)
        return left / (left[0] or 1.0)

    def columns(self, modes: int) -> int:
        """How many shapes the lowest modes have."""
        return int(self.modes.multiplicity[:modes].sum())

    def automatic(self) -> int:
        """The lowest modes that hold the start, and MARGIN more."""
        count = int(np.argmax(self.outside <= NEGLIGIBLE))
        return min(self.kept[max(count, 1) - 1].mode + MARGIN, len(self.modes))

    def missed(self, count: int, duration: float) -> float:
        """Largest angle (rad) to which the shapes from the count-th on can add up in their linear motion."""
        growth = np.exp(np.minimum(self.value.real[count:] * duration, FURTHEST))
        angles = np.abs(self.shapes[-self.plant.n_links :, count:]) @ (self.amplitude[count:] * growth)
        return float(angles.max())

    def system(self, count: int) -> Truncated:
        """The reduced equations in the first so many shapes."""
        shapes, dual = (np.ascontiguousarray(part[:, :count]) for part in (self.shapes, self.dual))
        return Truncated(self.plant, rest_angles(self.scene), shapes, dual)


def truncated(
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
    """The motion of a plane scene over `duration` seconds in the lowest `modes` of its table, dampers left out there.

    All shapes that share a frequency are kept together, the translation of a free cart always.  Left out, `modes` is
    as many as hold the start, and a margin.  `method` is one of SciPy's; all else is as in `nonlinear.simulate`, but
    that `report` hears of two runs.  Where Ctrl-C stops the second one the error is infinite.

    Raises SceneError for a scene in space and for arguments that cannot be, ComputationError where the modes cannot be
    had, SimulationError where the integrator gives up.
    """
    insist_numbers(duration, tolerance, 0.0)
    _insist(scene, modes, method)
    plant = plant_of(scene)
    state, times = gathered(
        lambda: checked(start if start is not None else start_of(scene), plant),
        lambda: sampled(scene, duration, 0.0, output),
    )
    survey = surveyed(scene, plant, state)
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
    """The motion of a survey's start at these times (T,) in s, in so many of its lowest modes."""
    fewer = survey.columns(modes)
    more = survey.columns(_next(survey, fewer))
    first = _run(survey, fewer, times, method, tolerance, report)
    second = _run(survey, more, first.times, method, tolerance / 10, report)
    apart = np.inf if second.run.stopped else float(np.abs(first.motion.links - second.motion.links).max())
    error = SAFETY * apart + survey.missed(more, float(times[-1] - times[0]))
    return Truncation(
        trajectory=replace(first, run=replace(first.run, error=error)),
        kept=survey.kept[:fewer],
        omega=np.abs(survey.value[:fewer]),
        outside=float(survey.outside[fewer]),
        error=error,
    )


def _insist(scene: Scene, modes: int | None, method: str) -> None:
    problems = [] if scene.space == "plane" else ["space: modal truncation is of motion in the plane"]
    whole = isinstance(modes, Integral) and not isinstance(modes, bool)
    if modes is not None and not (whole and modes >= 1):
        problems.append(f"modes {modes!r}: must be a whole number from 1")
    if scene.is_driven:
        problems.append("drive: motion that excites itself is not kept to a few modes")
    if method not in SCIPY:
        problems.append(f"method {method}: must be one of {', '.join(SCIPY)}")
    if problems:
        raise SceneError(problems)


def surveyed(scene: Scene, plant: Plant, start: State) -> Survey:
    """The modes of the scene without its dampers, and the start in them; SceneError where a massless cart lacks one."""
    still = scene.conservative
    modes = natural_modes(still)
    each = [(Kept(mode, copy), one) for mode, row in enumerate(all_shapes(modes), 1) for copy, one in enumerate(row, 1)]
    head = [[one.cart.real] if modes.on_cart else [] for _, one in each]
    if len(each) < modes.on_cart + scene.n_links:
        raise SceneError(["support.mass = 0.0: the modes of this scene do not span its motion"])
    shapes = np.array([np.concatenate((x, one.angles.real)) for x, (_, one) in zip(head, each, strict=True)]).T
    return Survey(scene, plant, modes, tuple(kept for kept, _ in each), shapes, matrices(still).M @ shapes, start)


def _next(survey: Survey, count: int) -> int:
    """The number of modes that about doubles so many shapes."""
    wanted = min(2 * count, len(survey.kept))
    return survey.kept[wanted - 1].mode


def _run(
    survey: Survey, count: int, times: Floats, method: str, tolerance: float, report: Callable[[float], object]
) -> Trajectory:
    system, size = survey.system(count), extent(survey.start, survey.plant)
    choice = Choice(TRUNCATED, method, False, f"{count} of {len(survey.kept)} shapes", max(tolerance, SMALLEST))
    ready = prepared(survey.scene, system, choice, survey.start, times, size)
    return ready.go(report=report)
