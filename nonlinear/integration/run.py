"""Equations, start and integrator combined into a run that is ready to start.

Perturbed runs ("twins"): the same scene from a slightly different start, which breaks any symmetry.

Equal pendula with equal starts pull the cart alike forever, in numbers as in theory, and so do mirror images; where
such motion is unstable real pendula part, and two runs that share the symmetry agree for longer than they are right. A
twin does not share it. Of pendula that move as one only the first is perturbed: how fast it departs from the others
does not depend on their number, and the twin needs at most two pendula of each kind.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import count
from sys import float_info
from typing import TYPE_CHECKING, Any, NamedTuple, cast

import numpy as np

from modal.errors import ComputationError
from modal.report import silent
from modal.scene import Scene, validate_scene
from modal.scene.doors import require_type
from modal.types import Floats
from nonlinear.dynamics import (
    Arranged,
    Maximal,
    Reduced,
    Symmetry,
    Written,
    exactly_symmetric,
    find_symmetries,
    is_unstable_equilibrium,
    symmetrize,
    synchronous,
)
from nonlinear.dynamics.inputs import Inputs
from nonlinear.integration.arguments import estimate_timescales, extent
from nonlinear.integration.driver import Drive, RunRecord
from nonlinear.integration.floats import FloatStepper
from nonlinear.integration.kernels import integrator
from nonlinear.integration.methods import Choice, choose, equations_of, validate_room
from nonlinear.integration.readiness import make_ready, rent
from nonlinear.integration.steppers import AT_EASE, Pace, SciPyStepper, Stepper, first_step_of, tolerance_factor
from nonlinear.integration.switches import Switched
from nonlinear.integration.trajectory import SolverInfo, Trajectory
from nonlinear.integration.within import Watch
from nonlinear.system import NO_KICKS, Equations, Event, Kicks, Layout, Load, State, System, apart

if TYPE_CHECKING:
    from nonlinear.dynamics.compiled import Compiled

Watching = Callable[[Layout, Floats, Floats], list[Watch]]
"""Watches for a layout, y and y' (size, 1) at the start."""
FIRST_STEP_MAX = 0.1
"""Tolerance: over √(l/g), the longest first step of a method, which knows only the rates at the start."""
PHASE_MAX = 1e6
"""Limit: phase (rad) of the fastest oscillation beyond which it is blamed for the failure of a run."""
NEAR_ZERO = 0.1
"""Tolerance: of the motion's size, to which the tolerance is relative where a quantity passes zero."""


class SimulationError(ComputationError):
    """A run that could not reach its end; `trajectory` holds the part that was computed.

    >>> from modal import Bob, Cart, Pendulum, Scene
    >>> from nonlinear import SimulationError, simulate, state_at_rest
    >>> scene = Scene(gravity=9.81, support=Cart(mass=0.0), pendulum=[Pendulum(links=[Bob(mass=1.0, length=1.0)])])
    >>> try:
    ...     simulate(scene, 5.0, start=state_at_rest(scene, [20.0]))
    ... except SimulationError as error:
    ...     print(f"{error.trajectory.times[-1]:.2f} s were computed")
    0.11 s were computed
    """

    def __init__(self, problem: str, trajectory: Trajectory) -> None:
        self.trajectory = trajectory
        super().__init__(problem)


@dataclass(frozen=True, eq=False)
class Prepared:
    """A run of a scene, sampled at `times` (s), that begins at its stepper's time, after the kicks `before`."""

    scene: Scene
    choice: Choice
    equations: Equations
    stepper: Stepper
    times: Floats
    before: Kicks = NO_KICKS

    def go(
        self,
        events: Sequence[Event] = (),
        report: Callable[[float], object] = silent,
        watching: Watching | None = None,
    ) -> Trajectory:
        """Run once, to the end or as far as possible; raise SimulationError if the integrator fails."""
        system, watches = self.equations.system, list[Watch]()
        if watching is not None:
            slope = self.equations.derivative(self.stepper.time, self.stepper.y)
            watches = watching(cast("Arranged", self.equations).layout, self.stepper.y[:, None], slope[:, None])
        record = Drive(self.stepper, self.equations, self.times, events, report, watches).run()
        trajectory = self._trajectory(record)
        if record.failed:
            swing, duration = estimate_timescales(self.scene).swing, float(self.times[-1] - self.times[0])
            hint = _hint(system)
            if not hint and swing * duration >= PHASE_MAX:
                hint = f"; the fastest swing of this scene, {swing:.3g} rad/s, cannot be followed for {duration:g} s"
                hint += ": remove parts that are so light or so stiff, or simulate a shorter time"
            raise SimulationError(f"{record.stopped}{hint}", trajectory)
        return trajectory

    def _trajectory(self, record: RunRecord) -> Trajectory:
        equations, choice = self.equations, self.choice
        words = equations.words if isinstance(equations, Reduced) else ""
        outcome: Any = record.steps, self.stepper.calls, record.drift, record.stopped, record.interrupted, words
        run = SolverInfo(choice.form, choice.method, choice.reason, choice.tolerance, *outcome)
        motion, driven = equations.read(record.rows), equations.load is not None
        changes = tuple(record.happenings), record.kicks, record.friction
        return Trajectory(self.scene, equations.system, record.times, motion, run, *changes, driven, equations)


def prepare(
    scene: Scene,
    equations: Equations,
    choice: Choice,
    start: State,
    times: Floats,
    size: float,
    before: Kicks = NO_KICKS,
    pace: Pace = AT_EASE,
) -> Prepared:
    """The equations of a scene with the chosen integrator, for a motion of this size (`extent`).

    Raise ComputationError if the motion cannot begin.
    """
    validate_scene(scene)
    begun = float(times[0])
    y = equations.begin_at(start, begun) if isinstance(equations, Maximal) else equations.begin(start)
    pace = _sampled(equations, y, times, pace)
    if isinstance(equations, Switched):
        equations.release(begun, y, before)
    slope = _slope(equations, begun, y)
    return Prepared(
        scene, choice, equations, _stepper(scene, equations, choice, y, slope, times, size, pace), times, before
    )


def _sampled(equations: Equations, y: Floats, times: Floats, pace: Pace) -> Pace:
    """A pace that stops at the samples of feedback, the first of which is taken."""
    if not equations.system.is_sampled:
        return pace
    samples = cast("Arranged", equations).inputs.samples
    breaks = samples.begin(*times[[0, -1]].tolist())
    samples.take(float(times[0]), y.tolist())
    return replace(pace, breaks=tuple(sorted({*pace.breaks, *breaks[1:]})), landing=samples.take)


@dataclass(frozen=True, eq=False)
class Request:
    """The requested motion of a scene, `system` in arrays, from a start on, sampled at these times (T,) in s.

    Method and form are chosen where they are "auto".  `before` are the escapements' kicks up to the start.  `pace`
    limits the steps and says where the integrator restarts.  `report` is called with the simulated time after every
    step.  `watching` makes the watches of every step, of minimal coordinates of the whole scene.
    """

    scene: Scene
    system: System
    start: State
    times: Floats
    method: str = "auto"
    form: str = "auto"
    load: Load | None = None
    events: Sequence[Event] = ()
    before: Kicks = NO_KICKS
    pace: Pace = AT_EASE
    report: Callable[[float], object] = silent
    watching: Watching | None = None

    @cached_property
    def smaller(self) -> tuple[Symmetry, ...]:
        """The symmetry reductions that apply."""
        flat = self.form not in {"spatial", "maximal", "hamiltonian"}
        system = self.system
        moved = system.prescribed_motions or system.loops or system.has_drag
        acted_on = self.load or self.watching or moved or system.has_escapements or system.rubs
        return () if acted_on else find_symmetries(self.system, self.start, planar=flat)

    @property
    def reduced_system(self) -> System:
        """The system that remains after symmetry reductions."""
        return self.smaller[-1].system if self.smaller else self.system

    @cached_property
    def size(self) -> float:
        """The size of the motion, at most 1; 1 where a load drives it, on a moving support at least its push over g."""
        if self.system.prescribed_motions and not self.load:
            return extent(self.start, self.system, self.times)
        return 1.0 if self.load else extent(self.start, self.system)

    @property
    def duration(self) -> float:
        """Time from the first sample to the last (s)."""
        return float(self.times[-1] - self.times[0])

    def choice(self, tolerance: float) -> Choice:
        """The method chosen at this tolerance."""
        arguments = self.scene, self.duration, tolerance, self.method, self.form
        driven, has_watches = self.load is not None, bool(self.events or self.watching)
        return choose(*arguments, driven=driven, size=self.size, system=self.reduced_system, has_watches=has_watches)

    def prepare_run(self, choice: Choice) -> Prepared:
        """The run prepared with this choice."""
        validate_room(self.scene, self.reduced_system)
        inputs, pace = Inputs(self.system), self.pace
        accuracy = 0.0 if choice.method == "taylor" else choice.tolerance
        breaks = tuple(sorted({*pace.breaks, *inputs.breaks(accuracy)}))
        pace = replace(pace, longest=min(pace.longest, inputs.longest_step(accuracy)), breaks=breaks)
        if (self.load or self.system.prescribed_motions) and self.system.rubs:
            # A load on sticking parts is sampled at least every radian of the fastest oscillation.
            pace = replace(pace, longest=min(pace.longest, 1 / estimate_timescales(self.scene).swing))
        with make_ready(integrator(self.reduced_system)) if choice.compiled else nullcontext():
            equations = equations_of(self.system, choice, self.load, self.smaller)
            return prepare(self.scene, equations, choice, self.start, self.times, self.size, self.before, pace)

    def run(self, choice: Choice) -> Trajectory:
        """The motion computed with this choice; raise SimulationError if the integrator fails."""
        with rent(choice.forgone):
            return self.prepare_run(choice).go(self.events, self.report, self.watching)


def _stepper(
    scene: Scene, equations: Equations, choice: Choice, y: Floats, slope: Floats, times: Floats, size: float, pace: Pace
) -> Stepper:
    """The chosen integrator, at the first of the times, for a motion of this size (`extent`)."""
    first, last = float(times[0]), float(times[-1])
    inner = equations.inner if isinstance(equations, Reduced) else equations
    if choice.method == "taylor":
        from nonlinear.integration import taylor

        pace = replace(pace, first=taylor.first_step(estimate_timescales(scene).swing))
        return taylor.TaylorStepper(cast("Arranged", inner), y, first, last, choice.tolerance * size, pace)
    relative = choice.tolerance * float(tolerance_factor(slope, equations.scale))
    absolute = NEAR_ZERO * relative * size * equations.scale
    first_step = first_step_of(y, slope, absolute + relative * np.abs(y), FIRST_STEP_MAX / equations.system.rate)
    pace = replace(pace, first=float(first_step))
    if choice.method == "DOP853" and isinstance(inner, Written):
        return FloatStepper(inner, first, y, last, relative, absolute, pace)
    if choice.method == "DOP853" and choice.compiled:
        from nonlinear.integration.compiled import CompiledStepper

        return CompiledStepper(cast("Compiled", inner), first, y, last, relative, absolute, pace)
    return SciPyStepper(choice.method, equations.derivative, first, y, last, relative, absolute, pace)


def _slope(equations: Equations, time: float, y: Floats) -> Floats:
    """The derivative at the start, (size,), checked to be finite: else integrators would seek a first step forever."""
    with np.errstate(all="ignore"):
        slope = equations.derivative(time, y)
    if not np.all(np.isfinite(slope)):
        hint = _hint(equations.system) or "; choose units in which masses and lengths are nearer to 1"
        raise ComputationError(f"the accelerations at the start are not finite in double precision{hint}")
    return slope


def _hint(system: System) -> str:
    if system.cart is None or system.cart.mass:
        return ""
    return "; a massless cart has no equation of motion where all that pulls it hangs straight down: give it a mass"


TWIN_DISTANCE = 1e-9
"""Tolerance: of the motion's size, the perturbation of a twin's start, and the tolerance at which it is followed."""
TWIN_DISTANCE_MIN = 1e-12
"""Tolerance: the least perturbation (rad) of a twin's start, far above rounding."""
DEPARTURE_DISTANCE = 1e-4
"""Limit: distance (rad) at which a twin has departed and is followed no further."""
TWIN_STEPS_MAX = 3000
"""Limit: steps for which a twin is followed, and for which its statement holds."""


class Departure(NamedTuple):
    """The largest `factor` by which the distance of a twin from a symmetric run grew within `seconds`."""

    factor: float
    seconds: float

    @property
    def words(self) -> str:
        """The result as a clause."""
        return f"a small perturbation of it would grow {self.factor:.2g}-fold in {self.seconds:.3g} s"


def aside(system: System, start: State, by: Any) -> State:
    """A start with the angles of every pendulum (of identical ones the first) perturbed by up to `by` (rad).

    In space every component of the unit vectors is perturbed.  `by` is a number or fits `start.links`.
    """
    shift = by * np.random.default_rng(0).uniform(0.5, 1.0, start.links.shape)
    if symmetry := synchronous(system, start):
        number = np.arange(float(system.n_links))
        shift[~np.isin(number, symmetry.restrict(State(number, number)).links)] = 0.0
    links = start.links + shift
    if links.ndim == 2:
        links /= np.linalg.norm(links, axis=1, keepdims=True)
    return replace(start, links=links)


def slightly(system: System, start: State) -> float:
    """The perturbation (rad) of a twin that shows how a difference grows."""
    return max(TWIN_DISTANCE * extent(start, system), TWIN_DISTANCE_MIN)


def perturb_last_digits(request: Request) -> Request | None:
    """The request with a start perturbed in its last digits; None if the start has no exact symmetry to break.

    Without a symmetry or an unstable equilibrium that rounding preserves, runs at two tolerances are as informative.
    """
    system, start = request.system, request.start
    if not (exactly_symmetric(system, start) or is_unstable_equilibrium(system, start)):
        return None
    by = np.maximum(4 * float_info.epsilon * request.size, 4 * np.spacing(np.abs(start.links)))
    return replace(request, start=aside(system, start, by))


def departure(trajectory: Trajectory) -> Departure | None:
    """How fast a twin departs from a run that integrates fewer pendula than there are, or a spatial scene in a plane.

    None for any other run.  The twin is followed until its distance is DEPARTURE_DISTANCE, for at most TWIN_STEPS_MAX.
    """
    require_type("trajectory", trajectory, "Trajectory")
    start, times = trajectory.motion[0], trajectory.times
    request = Request(trajectory.scene, trajectory.system, start, np.linspace(0.0, float(times[-1] - times[0]), 200))
    if not (trajectory.run.reduced and request.duration and any(smaller.ties for smaller in request.smaller)):
        return None
    steps = count(1)

    def distance(state: State) -> float:
        return float(apart(*symmetrize(request.smaller, state))[0])

    def patient(time: float) -> None:
        if next(steps) > TWIN_STEPS_MAX:
            raise ComputationError("the twin is followed no further")

    perturbed_start = aside(request.system, start, slightly(request.system, start))
    leaving = Event("a twin has left", lambda state: distance(state) - DEPARTURE_DISTANCE, stop=True)
    twin = replace(request, start=perturbed_start, events=(leaving,), report=patient)
    try:
        path = twin.run(twin.choice(TWIN_DISTANCE))
    except SimulationError as error:
        path = error.trajectory
    largest = max(distance(path.motion[at]) for at in range(len(path.times)))
    return Departure(largest / distance(perturbed_start), float(path.times[-1]))
