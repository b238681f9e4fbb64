"""Nonlinear motion in a few modes: their selection, the run, and its error with respect to the full scene.

The Lagrangian of a plane scene is even about its equilibrium: neglected modes respond at the third power of the
amplitude and act back at the fifth, so a single mode already has the κ of ω(a) = ω (1 + κ a²).  As measured, the
frequency of the lowest mode of 2 to 10 bobs alone is wrong by 0.006 % at 20°, 0.1 % at 40°, 0.6 % at 60°, with two
more modes by 0.004 % at 60°; shapes are wrong sooner, by a³.  The truncation error is reported.  The largest error of
any angle is estimated as twice the largest distance, so far and within the slowest period to come, to a second
run at a hundredth of the tolerance (so that it sees the integrator's error too):

- of the whole scene, where that costs at most four times as much as the following;
- else in the retained shapes and those that their motion excites (`nonlinear.reduction.residual`), all but
  EXCITATION_LEFT of the sum of the angles that it gives them, and all that it reaches and that are near enough to grow
  by themselves: two neglected shapes take energy of two kept ones where ω_s + ω_t = ω_i + ω_j, so
  ω_s ≤ (1 + 2 RESONANCE_WIDTH) max ω_i.  The motion that the rest make in answer to the second run is added to the
  distance.

It grows with time, and is an estimate, not a bound: it assumes that the second run is closer to the whole motion.
Where the second run does not reach its end nothing is stated, and the run says so.

Motion in the plane restricted to the span of a few shapes: the reduced equations of a truncated set of modes.

With q = (x, θ − rest) = Φ η the shapes Φ are a holonomic constraint, so the reduced motion is Lagrangian, with the T
and V of the scene at q = Φ η, and its energy balance is exact.  Link i turns by F_i η, n = (cos θ, −sin θ) lies
across it and u = (sin θ, cos θ) along it.  From the joint above it, by running sums from the cart down each chain,

    p_i = φ_x e_x + Σ_{k above i} l_k n_k F_k        velocity p_i η',
    a_i = −Σ_{k above i} l_k u_k θ_k'²               acceleration at η'' = 0,

and with the pair (A, b) the equations of R unknowns, at a cost of O(n R²) and without any n × n matrix, are

    ΦᵀMΦ = M φ_xᵀφ_x + Σ_i [A_ii F_iᵀF_i + b_i (F_iᵀ n_i·p_i + p_iᵀ·n_i F_i)]
    ΦᵀMΦ η'' = Φᵀ Q − Σ_i b_i [F_iᵀ (n_i·a_i + g sin θ_i) − θ_i'² p_iᵀ·u_i],

Q being the forces of springs, dampers and loads on q [Kane1985, §4.11].
On a structure x becomes its coordinates; with the accelerations a of the whole scene's equations at q = Φ η, q' = Φ η',

    ΦᵀMΦ η'' = (MΦ)ᵀ a.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from modal.errors import ComputationError, SceneError, refuse_any
from modal.modes import Modes
from modal.report import Displayed, silent
from modal.scene import Scene, refusals
from modal.scene.doors import checked
from modal.types import Floats, Ints
from nonlinear.dynamics import Generated, Minimal
from nonlinear.dynamics.variational import Variational
from nonlinear.integration import (
    SCIPY,
    SMALLEST,
    TRUNCATED,
    Choice,
    Request,
    SimulationError,
    Trajectory,
    extent,
    modes_of,
    prepare,
    sample_times,
    validate,
    validate_numbers,
    validate_whole,
)
from nonlinear.integration.arguments import NUMBERS_MAX
from nonlinear.integration.methods import DOP853_TOLERANCE_MIN
from nonlinear.reduction.residual import BLOCK, SAMPLES_PER_PERIOD, ExcitedShapes, dominant_shapes, excite
from nonlinear.system import Group, Layout, Load, Motion, State, System, initial_state, system_of, validate_state


@dataclass(frozen=True, eq=False)
class Turning:
    """One group of P chains of n links: `F` (R, P, n) of the links, and the constant part of ΦᵀMΦ."""

    group: Group
    F: Floats

    @cached_property
    def constant(self) -> Floats:
        """Σ A_ii F_iᵀ F_i, and of rotors Σ J (F_i − F_{i−1})ᵀ (F_i − F_{i−1}), (R, R)."""
        block, bends = self.group.block, np.diff(self.F, axis=-1, prepend=0.0)
        parts = ((self.F, block.diagonal), (bends, block.rotor))
        rows = ((part.reshape(len(part), -1), size.T.ravel()) for part, size in parts)
        return np.asarray(sum((row * size) @ row.T for row, size in rows))

    @cached_property
    def b(self) -> Floats:
        """First moments (kg m), (P, n)."""
        return np.ascontiguousarray(self.group.block.b.T)

    @cached_property
    def length(self) -> Floats:
        """Lengths (m), (P, n)."""
        return np.ascontiguousarray(self.group.block.length.T)

    def equations(self, cart: Floats, angles: Floats, rates: Floats, gravity: float) -> tuple[Floats, Floats]:
        """The group's contribution to ΦᵀMΦ (R, R), without its mass on the cart, and to the force on η (R,).

        `cart` (R,) is φ_x; angles and rates are (P, n).
        """
        sin, cos = np.sin(angles), np.cos(angles)
        n, u = np.stack((cos, -sin)), np.stack((sin, cos))
        normals = n * self.F[:, None]
        p = sums_above(self.length * normals)
        p[:, 0] += cart[:, None, None]
        cross = _rows(self.b * normals) @ _rows(p).T
        thrown = self.b * rates**2 * u
        a = sums_above(-self.length * u * rates**2)
        moments = self.b * ((n * a).sum(0) + gravity * sin)
        return self.constant + cross + cross.T, _rows(p) @ thrown.ravel() - _rows(self.F) @ moments.ravel()


def sums_above(values: Floats) -> Floats:
    """The sum over all links above each one, along the last axis."""
    sums = np.empty_like(values)
    sums[..., 0] = 0.0
    np.cumsum(values[..., :-1], axis=-1, out=sums[..., 1:])
    return sums


def _rows(values: Floats) -> Floats:
    return values.reshape(len(values), -1)


@dataclass(frozen=True, eq=False)
class Truncated:
    """The reduced equations of a plane scene, y = (η, η', work).

    `rest` (L,) are the angles at η = 0, `shapes` (half, R) the columns of Φ over (x or a structure, then links), and
    `dual` (half, R) with dualᵀΦ = 1 maps a start to its η.
    """

    system: System
    rest: Floats
    shapes: Floats
    dual: Floats
    load: Load | None = None

    @property
    def size(self) -> int:
        """The number R of shapes."""
        return int(self.shapes.shape[1])

    @cached_property
    def links(self) -> Floats:
        """The links' part of the shapes, (L, R)."""
        return self.shapes[-self.system.n_links :]

    @cached_property
    def cart(self) -> Floats:
        """The cart's part of the shapes, (R,), 0 on a fixed support."""
        return self.shapes[0] if self.system.cart else np.zeros(self.size)

    @cached_property
    def layout(self) -> Layout:
        """The arrangement of the y of the whole scene."""
        return Layout.of(self.system, works=self.works)

    @cached_property
    def works(self) -> bool:
        """Whether the work is the last component of y."""
        return self.system.works or self.load is not None

    @cached_property
    def turnings(self) -> tuple[Turning, ...]:
        """The groups with their shapes."""
        rows = self.links.T
        return tuple(Turning(group, np.ascontiguousarray(rows[:, group.index.T])) for group in self.system.groups)

    @cached_property
    def _constant(self) -> Floats:
        return self.system.total_mass * np.outer(self.cart, self.cart)

    @cached_property
    def acting(self) -> Minimal:
        """The loads on the whole scene."""
        return Minimal(self.system, (None,) * len(self.system.groups), self.load)

    @cached_property
    def full_equations(self) -> tuple[Generated, Variational]:
        """The equations of the whole scene on a structure."""
        return Generated(self.system, self.load), Variational(self.system)

    def _on_structure(self, time: float, y: Floats) -> Floats:
        R, (equations, momenta) = self.size, self.full_equations
        half, rates = equations.layout.half, equations.derivative(time, equations.begin(self.state(y)))
        q = self.rest + y[:R] @ self.shapes.T
        p = momenta.momenta(np.broadcast_to(q[:, None], (half, R)), self.shapes)
        accelerations = np.linalg.solve(self.shapes.T @ p, p.T @ rates[half : 2 * half])
        return np.concatenate((y[R : 2 * R], accelerations, rates[2 * half :]))

    def derivative(self, time: float, y: Floats) -> Floats:
        """The derivative y', (size,)."""
        if self.system.structure is not None:
            return self._on_structure(time, y)
        state, R = self.state(y), self.size
        M, z, first = self._constant.copy(), self.acting.layout.begin(state), self.system.first
        Q, power = self.acting.forces(z, self.acting.inputs.at(time, z, self.acting.layout))
        force = Q[first:] @ self.links + (Q[0] * self.cart if first else 0.0)
        for turning in self.turnings:
            place = turning.group.index.T
            mass, pull = turning.equations(self.cart, state.links[place], state.link_rates[place], self.system.gravity)
            M, force = M + mass, force + pull
        try:
            accelerations = np.linalg.solve(M, force)
        except np.linalg.LinAlgError:
            raise ComputationError("the reduced mass matrix is singular: keep fewer modes") from None
        return np.concatenate((y[R : 2 * R], accelerations, [power] * self.works))

    def state(self, y: Floats) -> State:
        """The state of one vector y."""
        return self.read(y[None])[0]

    def begin(self, state: State) -> Floats:
        """The vector y of the closest state in the mass metric, with zero work."""
        y, half = self.layout.begin(state), self.layout.half
        return np.concatenate(((y[:half] - self.rest) @ self.dual, y[half : 2 * half] @ self.dual, y[2 * half :]))

    def read(self, rows: Floats) -> Motion:
        """The motion of every link in vectors (T, size)."""
        R = self.size
        q, v = self.rest + rows[:, :R] @ self.shapes.T, rows[:, R : 2 * R] @ self.shapes.T
        return self.layout.read(np.hstack((q, v, rows[:, 2 * R :])))

    @property
    def scale(self) -> Floats:
        """Natural units of y, (size,): those that move some coordinate by its natural unit."""
        units, size = self.layout.natural(self.system), self.layout.half
        half = 1 / (np.abs(self.shapes) / units[:size, None]).max(axis=0)
        return np.concatenate((half, half * self.system.rate, units[2 * size :]))

    def project(self, y: Floats) -> tuple[Floats, float]:
        """The shapes are the coordinates: there are no constraints."""
        return y, 0.0


EXCITATION_LEFT = 0.1
"""Tolerance: of the sum of the excited angles, the part that the second run may omit."""
RESONANCE_WIDTH = 0.1
"""Tolerance: relative width of a resonance."""
EXCITATION_NOISE = 1e-13
"""Tolerance: angle (rad) below which a shape is moved by rounding alone."""
CALL_LINKS = 100.0
"""Cost: links that take as long as the rest of a derivative (benchmarks/few_modes.py)."""
PRODUCT_LINKS = 1e-3
"""Cost: links that take as long as a product of a link with R² numbers (benchmarks/few_modes.py)."""
LOOKS_MAX = 20_000
"""Cost: times at which two runs are compared (benchmarks/few_modes.py)."""
JUDGE_RATIO = 100.0
"""Tolerance: of the run over that of its judge, which sees the integrator's error too."""
UNJUDGED = "not estimated, since the second run did not reach its end"


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
        """The shortest retained period (s): all faster modes are frozen; infinite if nothing oscillates."""
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
        return self.modes.eigenvalue[[shape.mode - 1 for shape in self.kept]]

    @cached_property
    def swings(self) -> Floats:
        """ω of every shape (rad/s), or its growth rate (1/s), (C,)."""
        return np.asarray(np.abs(self.value))

    @cached_property
    def amplitude(self) -> Floats:
        """(η² + (η'/ω)²)^½ of every shape, (C,); 0 of a translation, which is always retained."""
        y, omega = self.equations(np.arange(len(self.kept))).begin(self.start), self.swings
        swings = omega > 0
        return np.where(swings, np.hypot(y[: len(omega)], y[len(omega) : 2 * len(omega)] / (omega + ~swings)), 0.0)

    @cached_property
    def outside(self) -> Floats:
        """Fraction of the start's energy in the shapes from each one on, (C + 1,)."""
        energy = (self.amplitude * self.swings) ** 2
        remainders = np.append(np.cumsum(energy[::-1])[::-1], 0.0)
        return remainders / (remainders[0] or 1.0)

    def columns(self, modes: int) -> int:
        """Number of shapes of the lowest modes."""
        return int(self.modes.multiplicity[:modes].sum())

    def automatic(self) -> int:
        """Number of lowest modes that contain the start, with half of its energy's digits, and four.

        These four are a twentieth of the error, for a quarter more calls.
        """
        count = int(np.argmax(self.outside <= np.sqrt(np.finfo(float).eps)))
        return min(self.kept[max(count, 1) - 1].mode + 4, len(self.modes))

    def excitation(self, run: Trajectory, chosen: Ints, look_times: Floats) -> tuple[Ints, ExcitedShapes]:
        """The other shapes, and how far a run in the chosen ones moves each, seen at even `look_times` (s)."""
        others = np.delete(np.arange(len(self.kept)), chosen)
        others = others[self.value.real[others] <= 0]
        starts = self.equations(others).begin(self.start)[: 2 * len(others)].reshape(2, -1)
        motion = run.motion.at(np.isin(run.times, look_times))
        return others, excite(self.system, look_times, motion, self.shapes[:, others], self.swings[others], starts)

    def judging(self, run: Trajectory, count: int, look_times: Floats) -> Ints:
        """The shapes of the second run for a run in the first `count`: these, and those that it excites."""
        others, survey = self.excitation(run, np.arange(count), look_times)
        moves = survey.angles > EXCITATION_NOISE
        is_close = self.swings[others] <= (1 + 2 * RESONANCE_WIDTH) * self.swings[:count].max()
        grows = np.flatnonzero(self.value.real > 0)
        dominant = others[dominant_shapes(np.where(moves, survey.angles, 0.0), EXCITATION_LEFT)]
        return np.unique(np.concatenate((np.arange(count), grows, others[moves & is_close], dominant)))

    def cheap(self, judging: Ints) -> bool:
        """Whether the whole scene costs no more than four times a run in these shapes."""
        links, fast = self.system.n_links, float(self.swings[judging].max())
        reduced_cost = fast * (CALL_LINKS + PRODUCT_LINKS * links * len(judging) ** 2)
        return len(judging) == len(self.kept) or float(self.swings.max()) * (CALL_LINKS + links) <= 4 * reduced_cost

    def equations(self, chosen: Ints) -> Truncated:
        """The reduced equations in these shapes."""
        shapes, dual = (np.ascontiguousarray(part[:, chosen]) for part in (self.shapes, self.dual))
        return Truncated(self.system, self.system.coordinates_at_rest, shapes, dual)


@checked
def simulate_truncated(
    scene: Scene,
    duration: float,
    modes: int | None = None,
    *,
    start: State | None = None,
    tolerance: float = 1e-9,
    method: str = "DOP853",
    output: int | Sequence[float] | Floats | None = None,
    report: Callable[[float], object] = silent,
) -> Truncation:
    """The motion of a plane scene over `duration` seconds in the lowest `modes` of the table without dampers.

    All shapes that share a frequency stay together, and the translation of a free cart always. By default, `modes`
    is the number that contain the start, plus a margin. `method` is one of SciPy's; everything else is as in
    `nonlinear.simulate`, except that `report` covers two runs. Where Ctrl-C stops the second one the error is infinite.
    Raise SceneError for a scene in space and for invalid arguments, ComputationError if the modes cannot be computed,
    SimulationError where the integrator fails.
    """
    validate(
        lambda: validate_numbers(duration, tolerance, 0.0),
        lambda: validate_whole(1, optional=True, modes=modes),
        lambda: _validate(scene, method),
    )
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
    report: Callable[[float], object] = silent,
) -> Truncation:
    """The motion of a survey's start at these times (T,) in s, in its lowest `modes`."""
    fewer = survey.columns(modes)
    look_times = _look_times(survey, np.arange(fewer), times)
    first = _simulate(survey, np.arange(fewer), np.union1d(times, look_times), method, tolerance, report)
    errors, judge = np.full(len(first.times), np.inf), "not estimated, since the run did not reach its end"
    if first.complete:
        errors, judge = _judge(survey, first, fewer, look_times, report)
    run = replace(first.run, error=float(errors[-1]), reason=f"{first.run.reason}; error {judge}")
    is_output = np.isin(first.times, times)
    is_output[-1] = True
    return Truncation(
        trajectory=replace(first, run=run).at(is_output),
        kept=survey.kept[:fewer],
        omega=survey.swings[:fewer],
        outside=float(survey.outside[fewer]),
        errors=errors[is_output],
    )


def _judge(
    survey: Survey, first: Trajectory, fewer: int, look_times: Floats, report: Callable[[float], object]
) -> tuple[Floats, str]:
    """The largest error (rad) of a run in the first shapes so far, (T,), and the basis of the estimate."""
    judging, tolerance = survey.judging(first, fewer, look_times), first.run.tolerance / JUDGE_RATIO
    is_full = survey.cheap(judging)
    times = first.times if is_full else np.union1d(first.times, finer := _look_times(survey, judging, first.times))
    try:
        if is_full:
            request = Request(survey.scene, survey.system, survey.start, times, report=report)
            second = request.run(request.choice(max(tolerance, DOP853_TOLERANCE_MIN)))
        else:
            second = _simulate(survey, judging, times, first.run.method, tolerance, report)
    except SimulationError as error:
        second = error.trajectory
    if not second.complete:
        return np.full(len(first.times), np.inf), f"{UNJUDGED}: {second.run.stopped}"
    durations, swings = first.times - first.times[0], survey.swings[:fewer]
    distances = np.abs(first.motion.links - second.motion.at(np.isin(times, first.times)).links).max(axis=1)
    errors = _within(durations, distances, 2 * np.pi / float(swings[swings > 0].min(initial=np.inf)))
    if is_full:
        return 2 * errors, "estimated with all shapes"
    errors = errors + survey.excitation(second, judging, finer)[1].sum(durations)
    return 2 * errors, f"estimated with {len(judging)} more shapes, those that they excite"


def _look_times(survey: Survey, chosen: Ints, times: Floats) -> Floats:
    """Even times (s) at which the forces of a motion in the chosen shapes are sampled, as far as storage allows.

    Forces have the third harmonic of the motion.
    """
    rate = 3 * SAMPLES_PER_PERIOD * float(survey.swings[chosen].max()) / (2 * np.pi)
    limit = min(LOOKS_MAX, NUMBERS_MAX // survey.system.n_links)
    count = float(times[-1] - times[0]) * rate
    if count < limit:
        return np.linspace(times[0], times[-1], int(np.ceil(count)) + BLOCK)
    return np.asarray(times[0] + np.arange(limit + 1) / rate)


def _within(durations: Floats, values: Floats, period: float) -> Floats:
    """The largest of the values (T,) so far and in the next `period` (s)."""
    last = np.searchsorted(durations, durations + period, side="right") - 1
    return np.asarray(np.maximum.accumulate(values)[last])


def _validate(scene: Scene, method: str) -> None:
    mistakes = refusals(scene, "motion in a few modes")
    if method not in SCIPY:
        mistakes.append(f"method {method}: must be one of {', '.join(SCIPY)}")
    refuse_any(mistakes)


@checked
def survey_modes(scene: Scene, system: System, start: State) -> Survey:
    """The modes of the scene without its dampers, and the start in them; raise SceneError if they do not span it."""
    conservative = scene.conservative
    modes = modes_of(conservative)
    phi = modes.matrix.real
    if len(phi.row) < system.first + scene.n_links:
        raise SceneError(["support.mass = 0.0: the modes of this scene do not span its motion"])
    shapes = tuple(Kept(row + 1, copy + 1) for row, copy in zip(phi.row.tolist(), phi.copy.tolist(), strict=True))
    return Survey(scene, system, modes, shapes, phi.shapes, phi.dual, start)


def _simulate(
    survey: Survey, chosen: Ints, times: Floats, method: str, tolerance: float, report: Callable[[float], object]
) -> Trajectory:
    equations, size = survey.equations(chosen), extent(survey.start, survey.system)
    words = f"{len(chosen)} of {len(survey.kept)} shapes"
    choice = Choice(TRUNCATED, method, False, words, max(tolerance, SMALLEST))
    ready = prepare(survey.scene, equations, choice, survey.start, times, size)
    return ready.go(report=report)
