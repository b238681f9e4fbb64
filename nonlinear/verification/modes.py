"""Verification of the table of modes: the frequency of each mode is measured at several amplitudes.

The linear frequency ω is the limit of small angles; `modal.eigen.amplitude` predicts ω(a) = ω (1 + κ a²) for the next
order.  A full simulation starts in the shape of a mode with a largest angle a; the strongest line of the mode's own
coordinate η (`nonlinear.reduction.modal_coordinates`) is compared with both.  κ is measured as the limit of
(ω(a)/ω − 1)/a² for a → 0, extrapolated in a² (Neville), with the mode's periodic orbits to bound the error, and
the angle at which the table is wrong by 1 % by a secant in a².

A lightly damped mode is measured on η exp(−Re λ t) and compared with Im λ.  Its amplitude decays during the run and its
frequency changes with it, so it is sampled evenly on a clock u that changes likewise, as far as κ describes it,

    du/dt = 1 + κ a² exp(2 Re λ t),

and the line belongs to the mean of a² exp(2 Re λ t), weighted as in `lines.attention`: the *effective* amplitude.

Any motion compared with the table of modes: the contribution of each mode, and the lines of each modal coordinate.

In linear motion a coordinate has one line, at the mode's own frequency.  Large angles add lines of other modes that
drive it, odd multiples and combinations of frequencies, and shift its own line.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from math import degrees, inf, isfinite, nan, pi, radians, sqrt

import numpy as np

from modal.eigen import is_singular
from modal.errors import ComputationError, SceneError
from modal.modes import Mode, Modes, natural_modes
from modal.report import Displayed, TextResult, silent
from modal.scene import Scene, require
from modal.scene.doors import checked, checked_index
from modal.types import Floats
from nonlinear.integration import TIGHTEST, Trajectory
from nonlinear.integration.arguments import SAMPLES_MAX
from nonlinear.orbits import Branch, at_amplitude, nonlinear_mode
from nonlinear.postprocessing import LEAST_PERIODS, PushingLink, SpectralLine, attention, line, lines, pushing_links
from nonlinear.reduction import SAMPLES_PER_PERIOD, ModalMotion, along_rail, modal_motion, start_in_mode
from nonlinear.simulation import simulate

FREQUENCY_ERROR_MIN = 1e-8
"""Tolerance: of a run over its amplitude, and so the relative error that a frequency has at least."""
MODE_TOLERANCE_MAX = 1e-10
"""Tolerance: of a run at large angles."""
FREQUENCY_ERROR_MAX = 1e-3
"""Limit: relative error of a frequency beyond which the report calls the motion irregular."""


@dataclass(frozen=True)
class Measurement:
    """One run: the largest angle at release and its effective value (rad), and the measured frequency.

    `omega` in rad/s with its relative `error`, `shift` ω(a)/ω − 1 from the table, `outside` the largest fraction of the
    energy found in other modes; `pushing` are the links of bobs that push, if that can be decided.
    """

    amplitude: float
    effective: float
    omega: float
    error: float
    shift: float
    outside: float
    pushing: tuple[PushingLink, ...] = ()

    @property
    def irregular(self) -> bool:
        """Whether the motion has no steady frequency."""
        return not self.error <= FREQUENCY_ERROR_MAX


def measure_mode(modes: Modes, number: int, amplitude: float, periods: float = 40, method: str = "auto") -> Measurement:
    """One run from rest in the shape of the mode with this index (from 0), its largest angle `amplitude` rad."""
    scene, value, copy = modes.scene, complex(modes.eigenvalue[number]), along_rail(modes, number)[0][0]
    count = min(SAMPLES_MAX, int(SAMPLES_PER_PERIOD * periods * max(2.0, modes.omega.max() / value.imag)) + 1)
    kappa = modes[number].kappa
    bend = max(kappa * amplitude**2, -0.5) if isfinite(kappa) else 0.0
    times, clock = sample_times(2 * pi * periods / value.imag, count, bend, 2 * value.real)
    tolerance = float(np.clip(FREQUENCY_ERROR_MIN * amplitude, TIGHTEST, MODE_TOLERANCE_MAX))
    start, duration = start_in_mode(scene, modes, number, copy, amplitude), float(times[-1])
    trajectory = simulate(scene.in_plane, duration, method=method, tolerance=tolerance, output=times, start=start)
    if trajectory.run.interrupted:
        raise KeyboardInterrupt
    motion = modal_motion(trajectory.motion, modes, [number])
    at = motion.copy.tolist().index(copy)
    outside = float(np.clip(motion.share_outside(at).max(), 0.0, 1.0))
    pushing = pushing_in(trajectory)
    mean_square = float(attention(count) @ np.exp(2 * value.real * times))
    try:
        spectral_line = line(clock, motion.coordinate[:, at] * np.exp(-value.real * times))
    except ComputationError:
        return Measurement(amplitude, amplitude * sqrt(mean_square), nan, inf, nan, outside, pushing)
    omega = spectral_line.omega * (1 + bend * mean_square if value.real else 1.0)
    error = spectral_line.relative_error + FREQUENCY_ERROR_MIN
    return Measurement(amplitude, amplitude * sqrt(mean_square), omega, error, omega / value.imag - 1, outside, pushing)


def pushing_in(trajectory: Trajectory) -> tuple[PushingLink, ...]:
    """The links of bobs that push in a run; none where that cannot be decided."""
    try:
        return pushing_links(trajectory)
    except ComputationError:
        return ()


def sample_times(duration: float, count: int, bend: float, rate: float) -> tuple[Floats, Floats]:
    """Times (count,) evenly spaced on the clock u = t + bend (exp(rate t) − 1)/rate, and u there; u = t for rate 0."""
    if not rate:
        return (times_even := np.linspace(0.0, duration, count)), times_even
    clock = np.linspace(0.0, duration + bend * np.expm1(rate * duration) / rate, count)
    times = clock * (duration / clock[-1])
    for _ in range(8):
        slow = times + bend * np.expm1(rate * times) / rate - clock
        times = np.clip(times - slow / (1 + bend * np.exp(rate * times)), 0.0, duration)
    times[[0, -1]] = 0.0, duration
    return times, clock


AMPLITUDES_DEG = (1.0, 5.0, 10.0, 30.0)
SHIFT_ERROR_MAX = 0.01
"""Tolerance: relative error of a shift from which κ is extrapolated."""
DECAY_MAX = 1.5
"""Tolerance: e-folds of the amplitude in a run, and this many more periods than a line needs, or a mode is skipped."""
INTERRUPTED = "interrupted"
GROWTH_NOISE = 1e-9
"""Tolerance: Re λ/|λ| of a growing mode, above rounding."""
ORBIT_FREQUENCY_ERROR = 1e-11
"""Tolerance: relative error of the frequency of an orbit."""
ORBIT_LINKS_MAX = 12
"""Cost: links of scenes of which periodic orbits are found in addition to the runs (benchmarks/orbits.py)."""
ORBIT_ANGLE_MAX = 3.1
"""Limit: angle (rad) of an orbit, short of the top."""
ONE_PERCENT = 0.01
"""Format: the relative difference whose angle is reported."""
ANGLE_MAX_DEG = 90.0
"""Limit: angle (deg) beyond which that is not sought; tables print >90."""


@dataclass(frozen=True, repr=False)
class ModeCheck(Displayed):
    """A mode of the table, its measurements, and the angle (deg) at which the table is wrong by 1 %.

    `one_percent_deg` is infinite if it lies beyond 90°, NaN if the motion there is irregular. `backbone` are the
    periodic orbits of the mode without dampers, in scenes of up to ORBIT_LINKS_MAX links.
    """

    what = "Mode of the table against simulation"
    shows = "mode: mode; one_percent_deg: 1 % off at, °"

    mode: Mode
    measurements: tuple[Measurement, ...]
    one_percent_deg: float
    backbone: Branch | None = None

    @cached_property
    def kappa(self) -> tuple[float, float]:
        """The measured κ (1/rad²) and a bound on its error; NaN where every run was irregular."""
        return limit([m for m in self.measurements if not m.irregular], self.exact, self.at_rest)

    @cached_property
    def at_rest(self) -> tuple[float, float]:
        """κ (1/rad²) of the smallest periodic orbits and its uncertainty; NaN without any."""
        if not self.backbone or not self.backbone.linear:
            return nan, inf
        x = self.backbone.amplitude[:4] ** 2
        y = (self.backbone.omega[:4] / self.backbone.linear - 1) / x
        value, coarser = (float(_at_zero(x[:count]) @ y[:count]) for count in (len(x), len(x) - 1))
        noise = float(np.abs(_at_zero(x)) @ (ORBIT_FREQUENCY_ERROR / x))
        return (value, abs(value - coarser) + noise) if len(x) > 2 else (nan, inf)

    def exact(self, measurement: Measurement) -> float:
        """ω(a)/ω − 1 of the periodic orbit with the largest angle of a run; NaN without one."""
        if measurement not in self._exact:
            orbit = at_amplitude(self.backbone, measurement.effective) if self.backbone else None
            linear = self.backbone.linear if self.backbone else None
            self._exact[measurement] = orbit.omega / linear - 1 if orbit and linear else nan
        return self._exact[measurement]

    @cached_property
    def _exact(self) -> dict[Measurement, float]:
        return {}

    def predicted_shift(self, measurement: Measurement) -> float:
        """κ a² of a run."""
        return self.mode.kappa * measurement.effective**2


@dataclass(frozen=True, repr=False)
class Check(TextResult):
    """Every mode that was checked, and (number from 1, reason) for those that were not."""

    scene: Scene
    rows: tuple[ModeCheck, ...]
    skipped: tuple[tuple[int, str], ...]
    writer = "nonlinear.verification.tables:check_table"

    @property
    def interrupted(self) -> bool:
        """Whether Ctrl-C ended it before all modes were done."""
        return any(reason == INTERRUPTED for _, reason in self.skipped)


@checked
def check(
    scene: Scene,
    numbers: Sequence[int] | None = None,
    amplitudes_deg: Sequence[float] = AMPLITUDES_DEG,
    *,
    periods: int = 40,
    method: str = "auto",
    report: Callable[[float], object] = silent,
) -> Check:
    """Check the modes with these indices (from 0; by default all) at these largest angles over this many periods.

    For a scene in space, the modes along the rail are used; drives, dry
    friction, quadratic drag and loads in time are ignored.  `method` is that of `simulate`;
    `report` is called with the number of modes done.  Modes that do not oscillate for long enough are skipped with a
    reason; after Ctrl-C, so are those not done.
    """
    checked_index("periods", periods, 1, SAMPLES_MAX)
    require(scene, "a check of modes")
    given_scene, scene = scene, scene.linearizable.lossless.timeless
    modes = natural_modes(scene)
    chosen = range(len(modes)) if numbers is None else numbers
    reasons = {number: _reason(modes, mode) for number, mode in zip(chosen, modes.rows(list(chosen)), strict=True)}
    measure = partial(measure_mode, modes, method=method)
    rows, remaining = [], list(chosen)
    try:
        for number in chosen:
            if not reasons[number]:
                rows.append(_check_mode(modes, number, amplitudes_deg, periods, measure))
            remaining.remove(number)
            report(len(chosen) - len(remaining))
    except KeyboardInterrupt:
        reasons |= dict.fromkeys(remaining, INTERRUPTED)
    reasons_skipped = tuple((number + 1, reasons[number]) for number in chosen if reasons[number])
    return Check(given_scene, tuple(rows), reasons_skipped)


def _reason(modes: Modes, mode: Mode) -> str:
    """Why a mode cannot be checked, in words; empty if it can."""
    if mode.is_uncertain:
        return "its frequency is beyond double precision"
    if mode.omega == 0:
        return "a rigid translation does not oscillate"
    if np.any(modes.eigenvalue.real > GROWTH_NOISE * modes.omega):
        return "the equilibrium is unstable"
    if not mode.oscillates:
        return "overdamped: it does not oscillate"
    if _periods_left(mode) < DECAY_MAX * LEAST_PERIODS:
        return f"it dies out within {_periods_left(mode):.2g} periods"
    copies, shapes = along_rail(modes, mode.number - 1)
    if not copies:
        return "it moves across the rail"
    if modes.on_cart and shapes[0].any() and is_singular(modes.matrices.M):
        return "the massless cart that it moves has no equation of motion where all bobs hang straight down"
    return ""


def _periods_left(mode: Mode) -> float:
    return DECAY_MAX / (2 * pi * mode.damping_ratio) if mode.damping_ratio > 0 else inf


def _check_mode(
    modes: Modes,
    number: int,
    amplitudes_deg: Sequence[float],
    periods: int,
    measure: Callable[..., Measurement],
) -> ModeCheck:
    mode = modes[number]

    def measure_at(amplitude: float) -> Measurement:
        return measure(number, amplitude, min(periods, _periods_left(mode)))

    measurements = [measure_at(radians(angle)) for angle in sorted(set(amplitudes_deg))]
    furthest = max((measurement.effective for measurement in measurements), default=0.0)
    angle = one_percent(measure_at, mode.linear_to_1_percent_deg)
    return ModeCheck(mode, tuple(measurements), angle, _backbone(modes.scene, number + 1, furthest))


def _backbone(scene: Scene, number: int, to: float) -> Branch | None:
    """The periodic orbits of a mode up to a little beyond this largest angle (rad); None if there are none."""
    if scene.n_links > ORBIT_LINKS_MAX or not 0 < to < ORBIT_ANGLE_MAX:
        return None
    try:
        return nonlinear_mode(scene, number, min(1.01 * to, ORBIT_ANGLE_MAX), longest=0.2, locate=False)
    except (ComputationError, SceneError):
        return None


def limit(
    runs: Sequence[Measurement],
    exact: Callable[[Measurement], float] = lambda measurement: nan,
    at_rest: tuple[float, float] = (nan, inf),
) -> tuple[float, float]:
    """(ω(a)/ω − 1)/a² at a → 0 and a bound on its error, from the neighbouring amplitudes that minimize that bound.

    Where periodic orbits are known, `exact` their shift at the angle of a run and `at_rest` their κ with its
    uncertainty, the bound is the error of the same extrapolation of the orbits, and of the runs' distances from them.
    Elsewhere higher orders are taken to be at most three times the shift of a single run, or twice the last difference
    of the extrapolation, to which come the effects of the errors of the frequencies and of companions: other modes in
    the motion shift a frequency by about their share of the energy, which is no longer proportional to a² alone.
    """
    known = [run for run in runs if run.error < SHIFT_ERROR_MAX * abs(run.shift)]
    certain = sorted(known, key=lambda measurement: measurement.effective)
    pieces = [certain[at : at + 3] for at in range(max(1, len(certain) - 2))]
    limits = [_extrapolate(piece, np.array([exact(run) for run in piece]), at_rest) for piece in pieces if piece]
    return min(limits, key=lambda value: value[1], default=(nan, inf))


def _extrapolate(runs: Sequence[Measurement], exact: Floats, at_rest: tuple[float, float]) -> tuple[float, float]:
    x = np.array([measurement.effective**2 for measurement in runs])
    y, weights = np.array([measurement.shift for measurement in runs]) / x, _at_zero(x)
    error, value = np.array([measurement.error for measurement in runs]) / x, float(weights @ y)
    if np.all(np.isfinite(exact)) and isfinite(at_rest[1]):
        miss, distance = weights @ (exact / x) - at_rest[0], weights @ (y - exact / x)
        return value, float(abs(miss) + abs(distance) + np.abs(weights) @ error + at_rest[1])
    miss = 2 * abs(value - float(_at_zero(x[:-1]) @ y[:-1])) if len(x) > 1 else 3 * value * runs[0].shift
    return value, abs(miss) + float(
        np.abs(weights) @ (error + np.abs(y) * [measurement.outside for measurement in runs])
    )


def _at_zero(x: Floats) -> Floats:
    """Lagrange's weights (n,) for the value at 0 of the polynomial through n points x."""
    return np.array([np.prod([node / (node - place) for node in x if node != place]) for place in x])


def one_percent(measure_at: Callable[[float], Measurement], guess_deg: float) -> float:
    """The effective largest angle (deg) at which a run deviates by 1 % from the table, near a guess; else infinite."""
    if not guess_deg <= ANGLE_MAX_DEG:
        return guess_deg if not isfinite(guess_deg) else inf
    square, points = radians(guess_deg) ** 2, [(0.0, 0.0)]
    for _ in range(3):
        measurement = measure_at(sqrt(square))
        if measurement.irregular:
            return nan
        points.append((square, abs(measurement.shift)))
        (x0, y0), (x1, y1) = points[-2:]
        ratio = (measurement.effective / measurement.amplitude) ** 2
        square = x1 + (ONE_PERCENT - y1) * (x1 - x0) / (y1 - y0)
        if not 0 < square * ratio <= radians(ANGLE_MAX_DEG) ** 2:
            return inf
        if abs(square - x1) < 1e-4 * square:
            break
    return degrees(sqrt(square * ratio))


LINE_ERROR_MAX = 1e-2
"""Tolerance: relative error of a line above which it is not steady."""


@dataclass(frozen=True, repr=False)
class ModeInMotion(Displayed):
    """One modal coordinate: its mode and copy (from 0), its largest value (rad), its mean share of the energy, lines.

    `note` says why there are no lines.
    """

    what = "Mode in a motion"
    shows = "mode: mode; largest: largest, rad; share: share of the energy; lines: lines; note: note"

    mode: Mode
    copy: int
    largest: float
    share: float
    lines: tuple[SpectralLine, ...]
    note: str


@dataclass(frozen=True, eq=False, repr=False)
class Comparison(TextResult):
    """A motion and the results for each modal coordinate; `pushing` are the links of bobs that push."""

    modes: Modes
    times: Floats
    motion: ModalMotion
    rows: tuple[ModeInMotion, ...]
    pushing: tuple[PushingLink, ...] = ()
    writer = "nonlinear.verification.tables:comparison_table"

    @cached_property
    def swinging(self) -> Floats:
        """Frequencies |Im λ| (rad/s) of the modes that oscillate."""
        omega = np.abs(self.modes.eigenvalue.imag)
        return np.asarray(omega[omega > 0])

    def nearest(self, line: SpectralLine) -> tuple[int, float]:
        """The mode (from 1) with the frequency nearest to a line, and the line's relative distance from it."""
        omega = np.abs(self.modes.eigenvalue.imag)
        number = int(np.argmin(np.where(omega > 0, np.abs(line.omega - omega), np.inf)))
        return number + 1, line.omega / float(omega[number]) - 1


@checked
def compare(trajectory: Trajectory, numbers: Sequence[int] | None = None, *, count: int = 3) -> Comparison:
    """Project a motion in the plane, sampled evenly, on the modes with these indices (from 0; by default all).

    At most `count` lines are sought in every coordinate. A decaying mode's lines are those of η exp(−Re λ t). Raise
    ComputationError for a motion out of the plane.
    """
    require(trajectory.scene, "a comparison with modes")
    modes = natural_modes(trajectory.scene)
    chosen = list(range(len(modes))) if numbers is None else list(numbers)
    motion = modal_motion(trajectory.motion, modes, chosen)
    modes_by_number = dict(zip(chosen, modes.rows(chosen), strict=True))
    share = motion.energy.sum(0) / motion.total_energy.sum()
    rows = []
    for at, number in enumerate(motion.number.tolist()):
        eta = motion.coordinate[:, at]
        spectrum, note = _lines(trajectory.times, eta, complex(modes.eigenvalue[number]), count)
        largest = float(np.abs(eta).max())
        rows.append(
            ModeInMotion(modes_by_number[number], int(motion.copy[at]), largest, float(share[at]), spectrum, note)
        )
    return Comparison(modes, trajectory.times, motion, tuple(rows), pushing_in(trajectory))


def _lines(times: Floats, eta: Floats, value: complex, count: int) -> tuple[tuple[SpectralLine, ...], str]:
    if not value.imag:
        return (), "does not oscillate"
    try:
        spectrum = lines(times, eta * np.exp(-min(value.real, 0.0) * (times - times[0])), count)
    except ComputationError as error:
        return (), str(error)
    steady = tuple(peak for peak in spectrum if peak.relative_error < LINE_ERROR_MAX)
    return steady, "" if steady else "irregular"
