"""Time against accuracy: every candidate on one scene and start, compared with a reference.

All candidates run up to the reference's horizon and no further (`nonlinear.accuracy.references`). An error is the
largest deviation of any link's angle at any sample, modulo full turns: it never exceeds π. The phase error is the time
shift τ (s) that explains most of the deviation in the last fifth, by least squares on the coordinates q (lengths in
units of the longest link),

    q(t) ≈ q_ref(t − τ),   τ = −Σ q_ref'·(q − q_ref) / Σ q_ref'·q_ref',

positive for a motion that lags.  It is undefined where a link then deviates by more than 1 rad, where τ is longer
than that fifth, as in motion that has died away, and where the error itself is too small to be measured.

Time against accuracy of natural frequencies: dense matrices, a permitted relative error, and every digit.

Errors of ω are those to the roots of the characteristic polynomial in integers, proved to PROVED_DIGITS
(`modal.exact`); times are those of the processor, from a scene to all its frequencies, but for dense matrices, which
are at hand.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import partial
from math import inf, nan, pi
from statistics import median
from time import perf_counter, process_time
from timeit import Timer
from typing import Any

import numpy as np
import scipy

from modal.assembly import matrices
from modal.errors import ComputationError, SceneError
from modal.exact import isolate, of_scene
from modal.modes import natural_modes
from modal.report import NOTHING, Displayed, Form, ReportColumn, Result, silent
from modal.scene import Scene, require, validate_scene
from modal.scene.doors import checked
from modal.statespace.model import without_carrier
from modal.types import Floats
from nonlinear.accuracy.advice import error_time_count
from nonlinear.accuracy.references import (
    Candidate,
    GivenUpError,
    Question,
    Reference,
    enclose_reference,
    list_candidates,
    reference_of,
)
from nonlinear.integration import Trajectory, estimate_timescales, taylor, validate_numbers
from nonlinear.system import Layout, Motion, State, apart, initial_state, system_of, validate_state

REFERENCE_PATIENCE = 120.0
"""Limit: seconds of the reference's run, beyond which a shorter duration is requested."""
FIRST_PERIODS = 32
"""Cost: initial length of the reference in fastest periods, four times as long each time (benchmarks/simulation.py)."""
PHASE_WINDOW = 0.2
"""Format: final fraction of the time from which the phase is estimated, as the report says."""
INTERRUPTED = "interrupted"


@dataclass(frozen=True, repr=False)
class WorkPrecisionRow(Displayed):
    """One candidate up to the horizon: seconds of preparation, median seconds of a run, right-hand sides.

    `error` (rad), `shift` in time (s, NaN where undefined), `drift` of energy (relative, NaN for modes with dampers,
    whose losses are not computed).  For a Taylor method `calls` counts its series.
    """

    what = "One method for a motion"
    shows = (
        "candidate: method; seconds: time, s; prepared: preparation, s; calls: derivatives; error: error, rad; drift:"
        " energy drift"
    )

    candidate: Candidate
    prepared: float
    seconds: float
    calls: int
    error: float
    shift: float
    drift: float


@dataclass(frozen=True, eq=False, repr=False)
class WorkPrecision(Result):
    """The reference, the candidates in order of fidelity, and (family or candidate, reason) of those omitted."""

    scene: Scene
    reference: Reference
    rows: tuple[WorkPrecisionRow, ...]
    skipped: tuple[tuple[str, str], ...]

    @property
    def interrupted(self) -> bool:
        """Whether Ctrl-C ended it before all candidates were done."""
        return any(reason == INTERRUPTED for _, reason in self.skipped)

    def measurable_error(self, row: WorkPrecisionRow) -> float:
        """The error (rad) as far as it can be measured: not below the reference's floor."""
        return max(row.error, self.reference.floor)

    @property
    def pareto(self) -> tuple[WorkPrecisionRow, ...]:
        """The candidates, without the reference, that no other beats in both time and error, fastest first."""
        front: list[WorkPrecisionRow] = []
        candidates = [row for row in self.rows if row.candidate != self.reference.candidate]
        for row in sorted(candidates, key=lambda row: (row.seconds, self.measurable_error(row))):
            if not front or self.measurable_error(row) < self.measurable_error(front[-1]):
                front.append(row)
        return tuple(front)

    what = "time against accuracy"
    key = "rungs"

    def columns(self) -> tuple[ReportColumn, ...]:
        """The quantities of a candidate."""
        floor, best = self.reference.floor, self.pareto
        return (
            ReportColumn(lambda row: "*" if row in best else "", heading="Pareto"),
            ReportColumn("candidate.family", heading="method"),
            ReportColumn("candidate.kind", "kind"),
            ReportColumn(lambda row: row.candidate.method or None, "method"),
            ReportColumn("candidate.compiled", "compiled"),
            ReportColumn(
                lambda row: nan if row.candidate.modal else row.candidate.tolerance, None, "tolerance", _power
            ),
            ReportColumn("candidate.tolerance", "tolerance"),
            ReportColumn("seconds", "seconds", "time (ms)", lambda seconds: f"{1e3 * seconds:.3g}"),
            ReportColumn("prepared", "prepared_seconds", "prepared (ms)", lambda seconds: f"{1e3 * seconds:.3g}"),
            ReportColumn("calls", "derivatives", "derivatives"),
            ReportColumn("error", "error_rad", "error (rad)", lambda x: f"{x:.1e}" if x > floor else f"<{floor:.1e}"),
            ReportColumn(lambda row: row.error > floor, "certain"),
            ReportColumn("shift", "late_s", "late (s)", ".1e"),
            ReportColumn("drift", "energy_drift", "energy", ".1e"),
            ReportColumn(lambda row: row in best, "pareto"),
        )

    def facts(self) -> dict[str, Any]:
        """The reference, and how far it goes."""
        reference = self.reference
        return {
            "reference": reference.candidate.name,
            "held_against": reference.check.name,
            "difference_rad": float(reference.difference[-1]),
            "floor_rad": reference.floor,
            "duration_s": reference.duration,
            "horizon_s": reference.horizon,
            "growth": float(reference.growth[-1]),
        }

    def whole(self) -> dict[str, Any]:
        """The reference, every candidate, and those omitted."""
        return {**super().whole(), "skipped": [{"rung": name, "reason": reason} for name, reason in self.skipped]}

    def footnotes(self) -> Iterator[str]:
        """The basis of the comparison, and the meanings of its columns."""
        reference = self.reference
        yield (
            "reference: a proved tube, which shares no error with any method."
            if reference.is_proved
            else (
                f"reference: {reference.candidate.name}, checked against {reference.check.name}: they differ by "
                f"{reference.difference[-1]:.1e} rad, and a small error grows {reference.growth[-1]:.2g} times, so no "
                f"error below {reference.floor:.1e} rad can be resolved."
            )
        )
        rate = reference.exponent
        until = f": until then the e-folding time of a small error is {1 / rate:.2g} s" if rate else ""
        if reference.whole:
            yield f"all {reference.horizon:g} s are compared."
        else:
            yield (
                f"only the first {reference.horizon:.4g} s of {reference.duration:g} s are compared{until}; "
                "the reference cannot be trusted further."
            )
        yield from (f"{name} was omitted: {reason}." for name, reason in self.skipped)
        yield (
            "*: on the Pareto front: no other is both faster and more accurate. time: a run, once prepared; "
            "derivatives: right-hand sides, or series of Taylor methods. error: the largest of any link, modulo whole "
            f"turns, so never above 3.14 rad. late: shift in time in the last {100 * PHASE_WINDOW:.0f} %. energy: "
            "drift, relative."
        )


def _power(tolerance: float) -> str:
    return NOTHING if tolerance != tolerance else f"{tolerance:.1e}".replace(".0e", "e")  # noqa: PLR0124


@checked
def tradeoff_table(result: WorkPrecision, form: Form) -> str:
    """Every candidate as text, markdown, csv (one line per candidate) or json, as `form` says."""
    return result.report(form)


def measure_work_precision(
    scene: Scene,
    duration: float,
    *,
    start: State | None = None,
    candidates: Sequence[Candidate] | None = None,
    proved: bool = False,
    patience: float = 5.0,
    report: Callable[[float], object] = silent,
) -> WorkPrecision:
    """Run every candidate, or these, on a scene from its own start or another for `duration` seconds.

    With `proved` the reference is a tube that provably contains the motion (extra `certified`). A family of candidates
    ends with the first that exceeds `patience` seconds or clearly will. `report` is called with the number of
    candidates done, the reference included, and during each with parts of it. After Ctrl-C those done are returned,
    once there is a reference. Raise SceneError for invalid arguments, ComputationError if there is no reference to
    compare with.
    """
    validate_scene(scene)
    validate_numbers(duration, 1e-9, 0.0)
    require(scene, "a comparison of methods")
    if scene.n_links > taylor.SERIES_LINKS_MAX:
        raise SceneError(
            [f"the scene has {scene.n_links} links: methods are compared for at most {taylor.SERIES_LINKS_MAX}"]
        )
    state = validate_state(start if start is not None else initial_state(scene), system_of(scene))
    chosen_candidates = list_candidates(scene) if candidates is None else tuple(candidates)
    if proved:
        reference = enclose_reference(Question(scene, state, _samples(scene, duration), report=_part(0, report)))
    else:
        reference = _reference(scene, state, duration, report)
    question = Question(scene, state, reference.trajectory.times)
    first = () if proved else (measure(reference.candidate, question, reference),)
    report(1)
    rows, reasons = _climb(chosen_candidates, replace(question, patience=patience), reference, report)
    return WorkPrecision(scene, reference, (*first, *rows), tuple(reasons.items()))


def _part(
    count: int, report: Callable[[float], object], fraction: float = 1.0, base: float = 0.0
) -> Callable[[float], object]:
    """A report of the share of a run, the `fraction` of which is a part of one candidate after those `count`.

    It rises from the former `base`.
    """
    reached_share = base

    def report_share(share: float) -> None:
        nonlocal reached_share
        reached_share = max(reached_share, share * fraction)
        report(count + reached_share)

    return report_share


def _reference(scene: Scene, state: State, duration: float, report: Callable[[float], object]) -> Reference:
    """A reference of longer and longer duration, so that nothing far beyond its horizon is computed."""
    part = FIRST_PERIODS * 2 * pi / estimate_timescales(scene).swing
    previous = 0.0
    while True:
        length = min(part, duration)
        progress = _part(0, report, length / duration, previous / duration)
        try:
            reference = reference_of(Question(scene, state, _samples(scene, length), REFERENCE_PATIENCE, progress))
        except GivenUpError as error:
            raise ComputationError(f"the reference was {error}: use a shorter duration") from None
        if length == duration or not reference.whole:
            return replace(reference, duration=duration)
        previous, part = length, part * 4


def _samples(scene: Scene, duration: float) -> Floats:
    count = error_time_count(duration, estimate_timescales(scene).swing)
    return np.linspace(0.0, duration, count + 1)


def _climb(
    candidates: Sequence[Candidate], question: Question, reference: Reference, report: Callable[[float], object]
) -> tuple[list[WorkPrecisionRow], dict[str, str]]:
    """Every candidate that can be measured, and why the others were not."""
    rows: list[WorkPrecisionRow] = []
    reasons: dict[str, str] = {}
    for count, candidate in enumerate(candidates):
        try:
            if candidate.family not in reasons:
                timed_question = replace(question, report=_part(count + 1, report))
                rows.append(measure(candidate, timed_question, reference))
            report(count + 2)
        except SceneError as error:
            reasons[candidate.family] = str(error)
        except ComputationError as error:
            reasons[candidate.family] = str(error) if candidate.modal else f"from {candidate.tolerance:g} on: {error}"
        except KeyboardInterrupt:
            measured_candidates = {row.candidate for row in rows}
            remaining = [candidate for candidate in candidates[count:] if candidate not in measured_candidates]
            return rows, reasons | {candidate.name: INTERRUPTED for candidate in remaining}
    return rows, reasons


def measure(candidate: Candidate, question: Question, reference: Reference) -> WorkPrecisionRow:
    """One candidate, run several times; raise ComputationError if it fails or takes too long."""
    preparations: list[float] = []
    seconds: list[float] = []
    while len(seconds) < 3 and sum(preparations) + sum(seconds) < 1:
        start = perf_counter()
        task = candidate.prepare(question)
        ready = perf_counter()
        solution = task()
        preparations.append(ready - start)
        seconds.append(perf_counter() - ready)
    finest = reference.trajectory
    error = float(apart(solution.motion, finest.motion).max())
    shift = late(solution.motion, finest) if error > reference.floor else nan
    drift = nan if candidate.modal and solution.system.works else solution.energy_drift()
    return WorkPrecisionRow(candidate, preparations[0], median(seconds), solution.run.calls, error, shift, drift)


def late(motion: Motion, reference: Trajectory) -> float:
    """The lag (s) of a motion behind the reference at the end; NaN if no time shift explains the deviation."""
    last = reference.times >= (1 - PHASE_WINDOW) * reference.times[-1]
    if apart(motion, reference.motion)[last].max() > 1:
        return nan
    system = reference.system
    layout = Layout.of(system, works=False, width=3 if system.spatial else 1)
    units = layout.natural(system)[: layout.half]
    moved, sure = (layout.rows(states.at(last)) for states in (motion, reference.motion))
    (lag, _), (_, rate) = (np.split(rows, 2, axis=1) for rows in (moved - sure, sure))
    shift = 0.0 - float(np.sum(rate * lag / units**2) / (np.sum((rate / units) ** 2) or 1.0))
    return shift if abs(shift) <= PHASE_WINDOW * reference.times[-1] else nan


PROVED_DIGITS = 20
"""Format: digits to which roots are proved, four beyond a double's."""
FREQUENCIES_MAX = 60
"""Limit: different frequencies of a scene, whose roots are proved within seconds."""
COMPARED_LINKS_MAX = 1500
"""Limit: links of a scene, whose dense matrices are solved within seconds."""
NOTES = (
    "*: on the Pareto front: no other is both faster and more accurate. time: of the processor, for all frequencies; "
    f"for dense, without making the matrices. error: the largest, to roots proved to {PROVED_DIGITS} digits."
)


@dataclass(frozen=True, repr=False)
class FrequencyRow(Displayed):
    """One method for all frequencies: its name, seconds, the bound that it states (NaN: none), the true error."""

    what = "One way to all frequencies"
    shows = "way: way; route: route; seconds: time, s; bound: stated bound; error: error"

    way: str
    route: str
    seconds: float
    bound: float
    error: float


@dataclass(frozen=True, eq=False, repr=False)
class FrequencyTradeoff(Result):
    """Dense matrices, the relative errors allowed, and every digit, in this order."""

    scene: Scene
    rows: tuple[FrequencyRow, ...]

    @property
    def pareto(self) -> tuple[FrequencyRow, ...]:
        """The methods that no other beats in both time and error."""
        return tuple(
            row
            for row in self.rows
            if not any(rival.seconds < row.seconds and rival.error <= row.error for rival in self.rows)
        )

    what = "time against accuracy of frequencies"
    key = "rungs"

    def columns(self) -> tuple[ReportColumn, ...]:
        """The quantities of a way."""
        best, dense = self.pareto, self.rows[0].seconds
        return (
            ReportColumn(lambda row: "*" if row in best else "", heading="Pareto"),
            ReportColumn("way", "way", "way"),
            ReportColumn("route", "route", "route"),
            ReportColumn("seconds", "seconds", "time (ms)", lambda seconds: f"{1e3 * seconds:.3g}"),
            ReportColumn(lambda row: row.seconds / dense, None, "/ dense", ".2g"),
            ReportColumn("bound", "bound", "bound", ".1e"),
            ReportColumn("error", "error", "error of ω", ".1e"),
            ReportColumn(lambda row: row in best, "pareto"),
        )

    def footnotes(self) -> tuple[str, ...]:
        """The meanings of the columns."""
        return (NOTES,)

    def facts(self) -> dict[str, Any]:
        """The digits with which errors are computed."""
        return {"digits": PROVED_DIGITS}


@checked
def measure_frequencies(scene: Scene, accuracies: tuple[float, ...] = (1e-8,)) -> FrequencyTradeoff:
    """Measure times and true errors of all natural frequencies of a scene, by every method.

    Raise SceneError for scenes with losses or structures, and for too large ones.

    >>> from modal import load
    >>> [row.way for row in measure_frequencies(load("chain-2")).rows]
    ['dense', 'to 1e-8', 'every digit']
    """
    require(validate_scene(scene), "a polynomial in ω²")
    if (size := len(natural_modes(scene))) > FREQUENCIES_MAX or scene.n_links > COMPARED_LINKS_MAX:
        limits = f"at most {FREQUENCIES_MAX}, and {COMPARED_LINKS_MAX} links, can be compared"
        raise SceneError([f"the scene has {size} different frequencies and {scene.n_links} links: {limits}"])
    squares = _squares(scene)
    planes = [matrices(plane) for plane in ((scene, without_carrier(scene)) if scene.space == "space" else (scene,))]
    dense = partial(_dense, [(plane.K, plane.M) for plane in planes], len(squares))
    limits_by_way = {
        **{f"to {accuracy:g}".replace("e-0", "e-"): accuracy for accuracy in accuracies},
        "every digit": None,
    }
    ours = {way: partial(natural_modes, scene, accuracy=limit) for way, limit in limits_by_way.items()}
    ways: dict[str, Callable[[], object]] = {"dense": dense, **ours}
    seconds = {}
    for way, solve in ways.items():
        number, total = Timer(solve, timer=process_time).autorange()
        seconds[way] = total / number
    rows = [FrequencyRow("dense", "eigh of K and M", seconds["dense"], nan, _error(dense(), squares))]
    for way, solve in ours.items():
        modes = solve()
        omega = np.repeat(modes.omega, modes.multiplicity)
        rows.append(FrequencyRow(way, modes.route, seconds[way], float(modes.error.max()), _error(omega, squares)))
    return FrequencyTradeoff(scene, tuple(rows))


def _squares(scene: Scene) -> list[Fraction]:
    """Every ω², in the order of the frequencies."""
    squares: list[Fraction] = []
    for polynomial, copies, _ in of_scene(scene):
        coefficients = list(polynomial.coefficients)
        while not coefficients[-1]:
            coefficients.pop()
            squares += [Fraction(0)] * copies
        for low, high, times in isolate(coefficients, Fraction(1, 10**PROVED_DIGITS), relative=True):
            squares += [(low + high) / 2] * (times * copies)
    return sorted(squares, key=abs)


def _dense(planes: list[tuple[Floats, Floats]], size: int) -> Floats:
    """ω (R,) by LAPACK, NaN if that gives up; a massless cart has one row more than modes."""
    try:
        values = np.concatenate([scipy.linalg.eigh(K, M, eigvals_only=True) for K, M in planes])
    except np.linalg.LinAlgError:
        return np.full(size, nan)
    return np.asarray(np.sort(np.sqrt(np.abs(values)))[:size])


def _error(omega: Floats, squares: list[Fraction]) -> float:
    """The largest relative error of ω, to first order, of all but rigid motions; infinite without a number."""
    if not np.isfinite(omega).all():
        return inf
    pairs = zip(map(Fraction, omega.tolist()), squares, strict=True)
    return max(
        (float(abs(computed_omega**2 / abs(square) - 1) / 2) for computed_omega, square in pairs if square), default=0.0
    )


@checked
def frequencies_table(result: FrequencyTradeoff, form: Form) -> str:
    """Every way as text, markdown, csv (one line per way) or json, as `form` says."""
    return result.report(form)
