"""Fits of a scene's parameters to measured motions, by least squares with exact derivatives.

The unknowns next to the numbers (initial states, offsets, delays) are fitted with them, first to the beginning of every
segment and then to ever longer parts, so that a motion that loses step with the record is never compared with it.
Numbers that the record does not determine are held at the scene's values and named (`modal.identification`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import scipy

from modal.errors import ComputationError, SceneError
from modal.identification import autocorrelation, covariance, find_determined, find_parameters, starts_of
from modal.identification.decays import EVALUATIONS_MAX, NOISE_AT_FIRST, NOISE_MIN
from modal.identification.mode_fitting import ROUGH_EVALUATIONS
from modal.report import silent
from modal.scene import Scene
from modal.scene.doors import checked, formerly
from modal.scene.parameters import texts_of
from modal.types import Booleans, Floats
from nonlinear.dynamics.inputs import Inputs
from nonlinear.identification.diagnosis import diagnose, find_mistake, require_radians, require_seconds
from nonlinear.identification.points import require_readable
from nonlinear.identification.problem import FitProblem, require_fittable
from nonlinear.identification.records import Recording
from nonlinear.identification.result import MISFIT_MAX, Fit, root_mean_square
from nonlinear.identification.starting import PERIOD_PART, initial_states, starting_numbers
from nonlinear.system import system_of

WEIGHTS: dict[str, Callable[[Floats], Floats]] = {
    "linear": np.ones_like,
    "soft_l1": lambda square: 1 / np.sqrt(1 + square),
    "huber": lambda square: 1 / np.sqrt(np.maximum(square, 1.0)),
    "cauchy": lambda square: 1 / (1 + square),
}
"""The weight of a squared residual under each loss, ρ' of `scipy.optimize.least_squares`."""
LOSSES = tuple(WEIGHTS)
WINDOWS_MAX = 64
"""Cost: short windows in which a record is fitted at first; a longer record is fitted in ever longer parts."""
ROUGH_TOLERANCE = 1e-6
"""Cost: tolerance of motions far from the end."""
ROUGH_PRECISION = 1e-3
"""Cost: relative change of the sum of squares, or of the unknowns, at the end of a rough fit."""
PRECISION = 1e-9
"""Tolerance: relative change of the sum of squares, or of the unknowns, at the end: below the motion's tolerance."""
LOOSE = (1e4, 1e2, 1.0)
"""Tightness of the gaps between windows, one after the other."""
SLIGHT = 0.01
"""Tolerance: a fall of a sum of squares in units of the noise, or of the fall that derivatives promised, and a relative
change of the noise: less moves no number by more than a tenth of its error bar."""
BEGINNING_STEPS = 500
"""Cost: steps of a motion at the beginning; faster ones are none of a right reading."""
DENSE_UNKNOWNS = 25
"""Cost: unknowns beyond which the Jacobian is sparse, as states matter in their own segment alone."""
LSMR = {"atol": 1e-10, "btol": 1e-10, "maxiter": 2000, "regularize": False}
Report = Callable[[float], object]


@formerly(scaled="scale")
@checked
def fit(
    scene: Scene,
    recording: Recording,
    free: str | Sequence[str] = (),
    *,
    priors: str | Sequence[str] = (),
    scale: bool = False,
    shift: bool = False,
    loss: str = "linear",
    window: float | None = None,
    report: Report = silent,
) -> Fit:
    """Fit the parameters at the places `free` to a recording, starting from the scene's values.

    `priors` are texts such as "gravity=9.81±0.01"; `scale` frees the scale of every sensor; `shift` frees the
    delay of all behind the motions and forces that the scene prescribes, up to sqrt(l/g); `loss` is one of
    `scipy.optimize.least_squares`.  A long chaotic segment is fitted in windows of `window` seconds that join (multiple
    shooting; [Bock1984]).  `report` is called with the part that is done.

    Raise SceneError for scenes that cannot be fitted and places that are not free numbers, ComputationError if no
    motion of the scene comes near the record.
    """
    require_fittable(scene)
    if loss not in LOSSES:
        raise SceneError([f"loss {loss}: must be one of {', '.join(LOSSES)}"])
    parameters = find_parameters(scene, texts_of(free, splits_commas=True), texts_of(priors))
    require_fittable(scene, parameters)
    require_readable(system_of(scene), [sensor.name for sensor in recording.sensors if sensor.is_of_point])
    require_seconds(scene, recording)
    full_recording, recording = recording, recording if window is None else recording.windows(window)
    problem = FitProblem(scene, parameters, recording, coarse_noise(recording), scale, shifted=shift)
    if shift and not Inputs(problem.system).count:
        raise SceneError(["shift: no motion or force of the scene depends on time, so a delay has no effect"])

    def beginning(trial: Recording) -> float:
        return _beginning(replace(problem, recording=trial))

    def mistake() -> str:
        return find_mistake(scene, full_recording, beginning)

    require_radians(full_recording, problem.system.rate, beginning)
    try:
        search = Search(problem, loss, report, mistake)
        result = search.run(in_windows=window is not None)
    except ComputationError as error:
        if words := mistake():
            raise ComputationError(f"{error}; {words}") from None
        raise
    if result.misfit.max() < MISFIT_MAX:
        return replace(result, verdict=tuple(diagnose(result)))
    words = search.mistake or mistake()
    if not words and window is None and result.misfit.max() > 4 * MISFIT_MAX:
        search_in_windows = Search(problem, loss, report)
        if search_in_windows.span < np.inf:
            result = min(
                result, search_in_windows.run(in_windows=True), key=lambda outcome: float(outcome.misfit.max())
            )
    return replace(result, verdict=tuple(diagnose(result, words)))


def _beginning(problem: FitProblem) -> float:
    """The misfit of a fit to the first periods of some segments, infinite if none is found."""
    part = 2 * PERIOD_PART * 2 * np.pi / problem.system.rate
    segments = [replace(segment, continued=False) for segment in problem.recording.segments[:3]]
    recording = replace(problem.recording, segments=tuple(segments)).until(part)
    noise = coarse_noise(recording)
    start = replace(problem, recording=recording, noise=noise, tolerance=ROUGH_TOLERANCE, steps=BEGINNING_STEPS)
    search = Search(start, "linear")
    try:
        u = search.solve(start, search.lengthen(search.begin()), rough=True)
        misses = np.vstack(start.misses(u))
    except ComputationError:
        return np.inf
    return max(root_mean_square(miss) / _size(recording, c) for c, miss in enumerate(misses.T))


def coarse_noise(recording: Recording) -> Floats:
    """The noise (C,) of the sensors before the first fit."""
    return np.array([NOISE_AT_FIRST * _size(recording, c) for c in range(len(recording.sensors))])


def _size(recording: Recording, sensor: int) -> float:
    values = np.concatenate([segment.values[:, sensor] for segment in recording.segments])
    values = values[np.isfinite(values)]
    return float(np.std(values)) or 1e-3


class Search:
    """The search for the least squares."""

    def __init__(
        self, problem: FitProblem, loss: str, report: Report = silent, look: Callable[[], str] = lambda: ""
    ) -> None:
        self.problem, self.loss, self.report = problem, loss, report
        self.look, self.mistake = look, ""
        self.kept = np.ones(len(problem.parameters), dtype=bool)
        self.evaluations = 0
        self.begun = np.zeros(0)
        self.starts: list[Floats] = []

    def run(self, in_windows: bool) -> Fit:
        """From the first samples to the whole record: `in_windows` that join more and more, or in ever longer parts."""
        u = self.begin()
        return self.finish(self.join(u) if in_windows and self.span < np.inf else self.lengthen(u))

    def begin(self) -> Floats:
        """Unknowns to start from, and the numbers that are not determined whatever the noise."""
        problem, layout = self.problem, self.problem.layout
        u = np.zeros(layout.size)
        z = starting_numbers(problem.scene, problem.parameters, problem.recording)
        beliefs = [parameter.prior_of_z for parameter in problem.parameters]
        z = np.array([numbers if b is None else b[0] for numbers, b in zip(z, beliefs, strict=True)])
        low, high = problem.bounds
        u[: layout.numbers] = np.clip(z, low[: layout.numbers], high[: layout.numbers])
        states = initial_states(problem)
        for s in range(layout.segments):
            u[layout.state(s)] = states[s]
        if layout.numbers:
            J = problem.jacobian(u)
            determination = find_determined(
                _project_out(J, self._nuisances(problem), layout.numbers), problem.parameters, z, vague=np.inf
            )
            self.kept[determination.held] = False
            u[: layout.numbers][~self.kept] = starts_of(problem.parameters)[~self.kept]
        self.begun = u[: layout.numbers].copy()
        numbers = np.where(
            self.kept,
            [b[0] if b else parameter.start for parameter, b in zip(problem.parameters, beliefs, strict=True)],
            self.begun,
        )
        self.starts = [self.begun] if np.array_equal(numbers, self.begun) else [numbers, self.begun]
        self.report(0.05)
        return u

    def join(self, u: Floats) -> Floats:
        """Fit all short windows at once, joined gradually; initial states come from every window's samples."""
        problem, layout = self.problem, self.problem.layout
        windows = replace(problem, recording=problem.recording.windows(self.span), tolerance=ROUGH_TOLERANCE)
        v = np.concatenate((u[: layout.delays.stop], initial_states(windows).ravel()))
        v = self._nearest(replace(windows, tightness=LOOSE[0]), v)
        for turn, tightness in enumerate(LOOSE[1:]):
            v = self.solve(replace(windows, tightness=tightness), v, rough=True)
            self.report(0.2 + 0.1 * turn)
        rows = np.cumsum([0, *(len(segment.times) for segment in windows.recording.segments)])
        begins = np.cumsum([0, *(len(segment.times) for segment in problem.recording.segments)])[:-1]
        states = [v[windows.layout.state(int(k))] for k in np.searchsorted(rows, begins)]
        return np.concatenate((v[: layout.delays.stop], *states))

    @property
    def span(self) -> float:
        """The duration (s) of short windows; infinite if they would be too many, or a coordinate has no sensor."""
        durations = [segment.times[-1] - segment.times[0] for segment in self.problem.recording.segments]
        period = 2 * np.pi / self.problem.system.rate
        span = max(PERIOD_PART / 2 * period, sum(durations) / max(WINDOWS_MAX - len(durations), 1))
        return span if self.problem.is_seen and span < PERIOD_PART * period else np.inf

    def _nearest(self, part: FitProblem, u: Floats) -> Floats:
        """Fitted to a part of the record, from the given numbers, or if they do not fit from those of the spectrum."""
        tries, numbers = [], self.problem.layout.numbers
        for z in self.starts:
            self.begun, v = z, u.copy()
            v[:numbers] = z
            try:
                v = self.solve(part, v, rough=True)
                tries.append((float(np.mean(np.square(part.residuals(v)))), z, v))
            except ComputationError:
                continue
            if tries[-1][0] < 1:
                break
        if not tries:
            raise ComputationError("the scene's motion cannot be simulated from the first samples of the record")
        cost, self.begun, v = min(tries, key=lambda attempt: attempt[0])
        if cost > (2 * MISFIT_MAX / NOISE_AT_FIRST) ** 2:
            self.mistake = self.look()
        return v

    def lengthen(self, u: Floats) -> Floats:
        """Fit ever longer parts of all segments."""
        problem = self.problem
        longest = max(segment.times[-1] - segment.times[0] for segment in problem.recording.segments)
        part = PERIOD_PART * 2 * np.pi / problem.system.rate
        u = self._nearest(replace(problem, recording=problem.recording.until(part), tolerance=ROUGH_TOLERANCE), u)
        while 2.5 * part < longest:
            part *= 2.5
            beginning = problem.recording.until(part)
            u = self.solve(replace(problem, recording=beginning, tolerance=ROUGH_TOLERANCE), u, rough=True)
            self.report(0.05 + 0.35 * part / longest)
        if any(segment.continued for segment in problem.recording.segments):
            for tightness in LOOSE:
                u = self.solve(replace(problem, tightness=tightness, tolerance=ROUGH_TOLERANCE), u, rough=True)
        return u

    def finish(self, u: Floats) -> Fit:
        """Fit the whole record with the estimated noise, with undetermined parameters fixed."""
        problem = self.problem
        u = self.solve(replace(problem, tolerance=ROUGH_TOLERANCE), u, rough=False)
        for turn in range(2):
            problem = replace(problem, noise=self._noise(problem, u))
            u = self.solve(problem, u, rough=False)
            self.report(0.5 + 0.2 * (turn + 1))
            if np.all(np.abs(np.log(self._noise(problem, u) / problem.noise)) < SLIGHT):
                break
        numbers = problem.layout.numbers
        J = problem.jacobian(u)
        projection = _project_out(J, self._nuisances(problem), numbers)
        undetermined = np.flatnonzero(~self.kept).tolist()
        determination = find_determined(projection, problem.parameters, u[:numbers], held=undetermined)
        fresh = self.kept.copy()
        fresh[determination.held] = False
        if np.any(fresh != self.kept):
            self.kept &= fresh
            u[:numbers][~self.kept] = starts_of(problem.parameters)[~self.kept]
            u = self.solve(problem, u, rough=False)
            problem = replace(problem, noise=self._noise(problem, u))
            J = problem.jacobian(u)
        residuals = problem.residuals(u)
        weight = np.sqrt(WEIGHTS[self.loss](residuals**2))
        cov, rho = _covariance(problem, weight[:, None] * J, weight * residuals, self._free(problem))
        self.report(1.0)
        return Fit(
            problem,
            u,
            cov,
            np.flatnonzero(~self.kept),
            determination.directions,
            determination.condition,
            residuals,
            problem.scene_at(u),
            problem.scene,
            rho,
            self.evaluations,
            self.loss,
        )

    def _free(self, problem: FitProblem) -> Booleans:
        free = problem.free.copy()
        free[: len(self.kept)] &= self.kept
        return free

    def _nuisances(self, problem: FitProblem) -> Booleans:
        free = problem.free.copy()
        free[: problem.layout.numbers] = False
        return free

    def _noise(self, problem: FitProblem, u: Floats) -> Floats:
        """The standard deviation of every sensor's residuals; by their median for a robust loss."""
        noise = []
        for c, misses in enumerate(np.vstack(problem.misses(u, with_derivatives=True)).T):
            residuals = misses[np.isfinite(misses)]
            spread = 1.4826 * float(np.median(np.abs(residuals))) if self.loss != "linear" else 0.0
            noise.append(max(spread or root_mean_square(residuals), NOISE_MIN * _size(problem.recording, c)))
        return np.array(noise)

    def solve(self, problem: FitProblem, u: Floats, *, rough: bool) -> Floats:
        """The unknowns after a search from u; raise ComputationError if it cannot begin.

        In a `rough` one a factor e of a number costs as much as one standard deviation of a reading.
        """
        free, template = self._free(problem), u.copy()
        low, high = (limits[free] for limits in problem.bounds)
        steady = np.flatnonzero(self.kept) if rough else np.zeros(0, dtype=np.int64)
        columns = np.flatnonzero(free)
        where = np.searchsorted(columns, steady)

        def all_unknowns(x: Floats) -> Floats:
            u = template.copy()
            u[columns] = x
            return u

        def residuals(x: Floats) -> Floats:
            self.evaluations += 1
            try:
                values = problem.residuals(all_unknowns(x), with_derivatives=True)
            except ComputationError:
                return np.full(sizes, np.nan)
            now[0] = np.concatenate((values, x[where] - self.begun[steady]))
            return now[0]

        def jacobian(x: Floats) -> Floats:
            rows = np.zeros((len(steady), len(columns)))
            rows[np.arange(len(steady)), where] = 1.0
            J = np.vstack((problem.jacobian(all_unknowns(x))[:, columns], rows))
            if is_sparse or self.loss != "linear":
                return scipy.sparse.csr_array(J) if is_sparse else J
            square, expected_decrease = float(now[0] @ now[0]), _decrement(J[:, x > low + 1e-9], now[0])
            fall, expected_fall = last[0] - square, last[1]
            # a fall by much less than was promised is a kink, such as those that dry friction makes
            is_kink = not rough and fall < SLIGHT * expected_fall
            if expected_decrease < SLIGHT or fall < SLIGHT or is_kink:
                raise _Reached(x)
            last[:] = square, expected_decrease
            return J

        now, last = [np.zeros(0)], [np.inf, 0.0]
        is_sparse = len(columns) > DENSE_UNKNOWNS
        precision = ROUGH_PRECISION if rough else PRECISION
        start = np.clip(u[columns], low + 1e-12, high)
        sizes, first_residuals = 1, residuals(start)
        sizes = len(first_residuals)
        if not np.all(np.isfinite(first_residuals)):
            raise ComputationError("the scene's motion cannot be simulated from the first samples of the record")
        try:
            solution: Any = scipy.optimize.least_squares(
                residuals,
                start,
                jacobian,
                bounds=(low, high),
                x_scale=self._scales(problem)[columns],
                loss=self.loss,
                max_nfev=3 if rough and self.mistake else ROUGH_EVALUATIONS if rough else EVALUATIONS_MAX,
                ftol=precision,
                xtol=precision,
                gtol=None,
                tr_solver="lsmr" if is_sparse else "exact",
                tr_options=LSMR if is_sparse else {},
            )
        except _Reached as reached:
            return all_unknowns(reached.x)
        return all_unknowns(solution.x)

    def _scales(self, problem: FitProblem) -> Floats:
        """The size of a step of each unknown."""
        layout, scales = problem.layout, np.ones(problem.layout.size)
        scales[: layout.numbers] = [parameter.step for parameter in problem.parameters]
        scales[layout.offsets], scales[layout.scales] = 0.01, 0.01
        scales[layout.delays] = 0.1 * (problem.late or 1.0)
        for s in range(layout.segments):
            scales[layout.state(s)] = 0.1 * problem.scale
        return scales


class _Reached(Exception):  # noqa: N818
    """The least squares are reached, at x."""

    def __init__(self, x: Floats) -> None:
        super().__init__()
        self.x = x


def _decrement(J: Floats, residuals: Floats) -> float:
    """By how much the sum of squares can still fall, to first order: the part of the residuals that J can make up."""
    return float(np.sum(np.square(_basis(J).T @ residuals)))


def _basis(columns: Floats) -> Floats:
    """An orthonormal basis of the span of columns, whatever their sizes."""
    size = np.linalg.norm(columns, axis=0)
    if not size.any():
        return columns[:, :0]
    Q, R, _ = scipy.linalg.qr(columns[:, size > 0] / size[size > 0], mode="economic", pivoting=True)
    diagonal = np.abs(np.diag(R))
    return np.asarray(Q[:, diagonal > 1e-10 * diagonal[0]])


def _project_out(J: Floats, nuisances: Booleans, numbers: int) -> Floats:
    """The columns of the numbers without the part that nuisances can compensate."""
    columns, Q = J[:, :numbers], _basis(J[:, nuisances])
    once = columns - Q @ (Q.T @ columns)
    return np.asarray(once - Q @ (Q.T @ once))


def _covariance(problem: FitProblem, J: Floats, residuals: Floats, free: Booleans) -> tuple[Floats, tuple[Floats, ...]]:
    """The covariance of all unknowns (size, size), with the autocorrelation of every sensor's residuals."""
    columns = np.flatnonzero(free)
    J, residuals = problem.sort_by_sensor(J)[:, columns], problem.sort_by_sensor(residuals)
    size = np.linalg.norm(J, axis=0)
    size[size == 0] = 1.0
    G = np.linalg.pinv(J / size, rcond=1e-11).T / size
    series = problem.series()
    freedom = max(1, len(residuals) - len(columns))
    growth = len(residuals) / freedom
    rho = []
    blocks = []
    for c in range(len(problem.recording.sensors)):
        parts = [residuals[rows] for _, sensor, rows in series if sensor == c]
        rho.append(autocorrelation(parts))
        count = sum(map(len, parts))
        variance = growth * sum(float(part @ part) for part in parts) / count if count else 0.0
        blocks += [(rows, variance, rho[c]) for _, sensor, rows in series if sensor == c]
    last = series[-1][2].stop if series else 0
    if last < len(residuals):
        blocks.append((slice(last, len(residuals)), 1.0, np.ones(1)))
    cov = np.zeros((problem.layout.size, problem.layout.size))
    cov[np.ix_(columns, columns)] = covariance(G, blocks)
    return cov, tuple(rho)
