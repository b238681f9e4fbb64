"""Fits of a scene's parameters to measured modes, by weighted least squares with exact derivatives.

The residuals are those of frequencies, of damping ratios and of shapes, each in units of its standard deviation:

    (f(p) − f)/σ_f,    (ζ(p) − ζ)/σ_ζ,    (s u(p) − v)/σ_v

with v a measured shape whose largest component is 1, u the computed one and s the scale that brings it nearest.
Derivatives are exact (`identifiability`); identifiability is judged as for motions.  [Friswell1995, ch. 8]

Modes are polynomials in the numbers, so several sets of numbers may have the same ones: two bobs swing with the same
frequencies when their lengths change places.  The fit is repeated from other starts, and every minimum within the
confidence region of the best one is a solution.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations
from typing import Any

import numpy as np
import scipy

from modal.errors import ComputationError, SceneError, refuse_any
from modal.identification.decays import CHANCE_MAX, NOISE_AT_FIRST, NOISE_MIN
from modal.identification.identifiability import (
    Combination,
    Determined,
    ModeDerivatives,
    Undetermined,
    find_combinations,
    find_determined,
    matrix_derivatives,
    polar,
)
from modal.identification.measured import MeasuredMode, MeasuredModes, component_rows, mac_with
from modal.identification.parameters import (
    BOUND_DISTANCE,
    FittedNumbers,
    Parameter,
    find_parameters,
    means_of,
    numbers_at,
    numbers_of,
    scene_with,
    starts_of,
    with_error,
)
from modal.modes import Modes, natural_modes
from modal.report import Displayed, Form, ReportColumn, ReportTable, Summary, brief, listed, percent, records_of, short
from modal.scene import Scene
from modal.scene.doors import checked
from modal.types import Floats, Ints


@dataclass(frozen=True, repr=False)
class FittedMode(Displayed):
    """A measured mode next to the computed one; residuals in standard deviations of the measurement."""

    measured: MeasuredMode
    frequency: float
    damping_ratio: float
    damping_ratio_std: float | None
    mac: float | None

    @property
    def deviation(self) -> float:
        """The deviation of the frequency."""
        return (self.frequency - self.measured.frequency) / self.measured.std


MODE = (
    ReportColumn("measured.number", "mode", "mode"),
    ReportColumn("measured.frequency", "measured_frequency_hz"),
    ReportColumn(lambda mode: with_error(mode.measured.frequency, mode.measured.std), None, "f (Hz)"),
    ReportColumn("measured.std", "std_hz", "±", ".2g"),
    ReportColumn("frequency", "fitted_frequency_hz"),
    ReportColumn(lambda mode: with_error(mode.frequency, mode.measured.std), None, "fitted (Hz)"),
    ReportColumn("deviation", "deviation_in_stds", "off by (±)", "+.2f"),
    ReportColumn("measured.damping_ratio", "measured_damping_ratio", "ζ", ".6g"),
    ReportColumn("damping_ratio_std", "damping_ratio_std"),
    ReportColumn("damping_ratio", "fitted_damping_ratio", "fitted ζ", lambda ratio: short(ratio + 0.0)),
    ReportColumn("mac", "mac", "MAC", ".4f"),
)
"""The quantities of a fitted mode."""


@dataclass(frozen=True, eq=False, repr=False)
class Solution(Displayed):
    """Numbers at a minimum, by z (p,) with its covariance `cov` (p, p), and chi-square there.

    `values` and `covariance`, zero for numbers held fixed, are in the scene's units.
    """

    parameters: tuple[Parameter, ...]
    z: Floats
    cov: Floats
    chi_square: float

    @cached_property
    def values(self) -> Floats:
        """The numbers (p,)."""
        return np.array([parameter.at(float(z)) for parameter, z in zip(self.parameters, self.z, strict=True)])

    @cached_property
    def covariance(self) -> Floats:
        """The covariance of the numbers, (p, p)."""
        slopes = np.array([parameter.slope(float(z)) for parameter, z in zip(self.parameters, self.z, strict=True)])
        return np.asarray(slopes[:, None] * self.cov * slopes)

    @cached_property
    def stds(self) -> Floats:
        """Standard deviations (p,)."""
        return np.sqrt(np.maximum(np.diag(self.covariance), 0.0))

    def _summary(self) -> Summary:
        return Summary(f"Solution of a fit: chi-square {self.chi_square:.4g}", [("numbers", brief(self.values))])


@dataclass(frozen=True, eq=False, repr=False)
class ModeFit(FittedNumbers, Solution):
    """Numbers fitted to measured modes: `scene` has them, `given` those of the start.

    `chi_square` is the sum of squares of the residuals with `freedom` degrees of freedom, `held` the indices of numbers
    that the modes do not determine; `others` are solutions that fit as well.
    """

    given: Scene
    scene: Scene
    measured: MeasuredModes
    determined: Determined
    held: Ints
    modes: tuple[FittedMode, ...]
    freedom: int
    shape_std: float | None
    verdict: tuple[str, ...] = ()
    others: tuple[Solution, ...] = ()

    what = "fit to measured modes"
    figure = "modal.plotting.identification:mode_fit_figure"

    def parts(self, form: Form = "text") -> Iterator[ReportTable | str]:
        """The numbers, which of them the modes determine, every mode, and the verdict."""
        yield self.table_of_numbers({})
        yield from self.determination()
        yield ReportTable.of(MODE, self.modes)
        yield "\n".join(self.footnotes())

    def whole(self) -> dict[str, Any]:
        """Every number and mode; `covariance` is that of `parameters` in their order."""
        numbers = self.fitted
        return {
            **self.facts(),
            "segments": [],
            "modes": records_of(MODE, self.modes),
            "chi_square": self.chi_square,
            "degrees_of_freedom": self.freedom,
            "shape_std": self.shape_std,
            "condition": self.determined.condition,
            "covariance": self.covariance[np.ix_(numbers, numbers)].tolist(),
            "other_solutions": [
                {
                    "parameters": numbers_of(other, numbers),
                    "chi_square": other.chi_square,
                    "covariance": other.covariance[np.ix_(numbers, numbers)].tolist(),
                }
                for other in self.others
            ],
            "verdict": list(self.verdict),
        }

    @property
    def fitted(self) -> list[int]:
        """The indices of the numbers that were not fixed."""
        return [int(k) for k in self.determined.kept]

    @property
    def undetermined(self) -> tuple[Undetermined, ...]:
        """The undetermined directions."""
        return self.determined.directions

    @cached_property
    def combinations(self) -> tuple[Combination, ...]:
        """Products of numbers that are determined although the numbers are not."""
        return find_combinations(self.determined, self.parameters, self.z, self.stds)


def mode_fit_json(result: ModeFit) -> str:
    """The report as JSON."""
    return result.report("json")


def mode_fit_text(result: ModeFit) -> str:
    """The report as text."""
    return result.report()


FIT_ROUNDS = 4
"""Cost: rounds of fitting and estimating the noise of shapes, and of Gauss-Newton steps per direction."""
CONFIDENCE = 0.95
"""Physics: of the region about the best fit in which other minima are solutions, and of an interval of 1.96 σ."""
ROUGH_EVALUATIONS = 12
"""Cost: evaluations of a search from another start before it is seen whether it leads anywhere."""
CHI_SQUARE_LEFT = 1e3
"""Cost: chi-square that such a search may still have to lose: Gauss-Newton's method is near its end there."""
GENERIC_STEP = 0.03
"""Tolerance: by which numbers are moved to judge identifiability: at equal lengths derivatives vanish."""
LOSSES = ("linear", "soft_l1", "huber", "cauchy")


@checked
def fit_modes(
    scene: Scene,
    measured: MeasuredModes,
    free: Sequence[str] = (),
    *,
    priors: Sequence[str] = (),
    loss: str = "linear",
) -> ModeFit:
    """Fit the parameters at the places `free` to measured modes, starting from the scene's values.

    `priors` are texts such as "gravity=9.81±0.01". Raise SceneError for places that are no free numbers and for modes
    that the scene does not have, ComputationError if a mode has no derivative.
    """
    if loss not in LOSSES:
        raise SceneError([f"loss {loss}: must be one of {', '.join(LOSSES)}"])
    parameters = find_parameters(scene, free, priors)
    problem = _ModeFitProblem(scene, parameters, measured)
    z, shape_std = _search(problem, loss)
    minima = _minima(problem, z, loss) if problem.is_fitted.any() else []
    if minima and minima[0][0] < _square(problem, z) - 1:  # a smaller difference does not separate two minima
        z, shape_std = _refine(problem, minima[0][1], loss)
    return _certify(problem, z, shape_std, loss, [minimum for _, minimum in minima])


class _ModeFitProblem:
    """Residuals and their derivatives, by z of the numbers."""

    def __init__(self, scene: Scene, parameters: tuple[Parameter, ...], measured: MeasuredModes) -> None:
        self.scene, self.parameters, self.measured = scene, parameters, measured
        self.is_fitted = np.ones(len(parameters), dtype=bool)
        self.shape_std = NOISE_AT_FIRST
        self.rows = component_rows(scene, measured.components)
        self.places = _places(natural_modes(scene), measured)
        self.with_shapes = [mode for mode in measured.modes if mode.shape is not None]

    @property
    def estimates_noise(self) -> bool:
        """Whether the noise of shapes can be estimated from their residuals."""
        return any(mode.shape_std is None for mode in self.with_shapes)

    def pairs(self, modes: Modes) -> Iterator[tuple[MeasuredMode, int]]:
        """Every measured mode with the row of its computed one; ComputationError if it does not oscillate any more."""
        ends = np.cumsum(np.where(_swings(modes), modes.multiplicity, 0))
        for measured_mode, place in zip(self.measured.modes, self.places, strict=True):
            row = int(np.searchsorted(ends, place, side="right"))
            if row >= len(modes):
                raise ComputationError("a measured mode does not oscillate with these numbers")
            yield measured_mode, row

    def modes_at(self, z: Floats) -> tuple[Scene, Modes]:
        """The scene with these numbers, and its modes."""
        scene = scene_with(self.scene, numbers_at(self.parameters, z))
        return scene, natural_modes(scene)

    def residuals(self, z: Floats) -> Floats:
        """In standard deviations, priors last; raise ComputationError if a measured mode is none any more."""
        _, modes = self.modes_at(z)
        residuals: list[Any] = []
        for measured_mode, row in self.pairs(modes):
            value = modes.eigenvalue[row]
            residuals.append([(abs(value) / (2 * np.pi) - measured_mode.frequency) / measured_mode.std])
            if measured_mode.damping_ratio is not None:
                residuals.append([(-value.real / abs(value) - measured_mode.damping_ratio) / _ratio_std(measured_mode)])
            if measured_mode.shape is not None:
                phi = modes.matrix.shapes[:, modes.matrix.row == row][:, 0]
                residuals.append(self._shape(measured_mode, phi.astype(np.complex128), None)[0])
        return np.concatenate([*residuals, self._beliefs(z)[0]])

    def jacobian(self, z: Floats) -> Floats:
        """Derivatives of the residuals by z, (N, p)."""
        scene, modes = self.modes_at(z)
        count = len(self.parameters)
        if not count:
            return np.zeros((len(self.residuals(z)), 0))
        units = [parameter.unit for parameter in self.parameters]
        derivatives = ModeDerivatives(
            modes, *matrix_derivatives(scene, [parameter.places for parameter in self.parameters], units)
        )
        slopes = np.array([parameter.slope(float(value)) for parameter, value in zip(self.parameters, z, strict=True)])
        rows: list[Floats] = []
        for measured_mode, row in self.pairs(modes):
            by_number = derivatives.eigenvalue(row)
            if np.any(np.isnan(by_number)):
                k = int(np.flatnonzero(np.isnan(by_number))[0])
                raise ComputationError(
                    f"mode {measured_mode.number} shares its frequency with others, and {self.parameters[k].path} "
                    "splits it: it has no single derivative; free a number of all equal pendula, or omit the mode"
                )
            omega, zeta = polar(complex(modes.eigenvalue[row]), by_number)
            rows.append((omega / (2 * np.pi) / measured_mode.std)[None])
            if measured_mode.damping_ratio is not None:
                rows.append((zeta / _ratio_std(measured_mode))[None])
            if measured_mode.shape is not None:
                phi, by, _ = derivatives.shape(row)
                rows.append(self._shape(measured_mode, phi, by)[1])
        return np.vstack((np.vstack(rows) * slopes, self._beliefs(z)[1]))

    def _shape(self, measured_mode: MeasuredMode, phi: Any, by: Any) -> tuple[Floats, Floats]:
        """Residuals of a shape, and their derivatives."""
        assert measured_mode.shape is not None
        is_measured = np.isfinite(measured_mode.shape)
        v = measured_mode.shape[is_measured]
        v = v / np.abs(v).max()
        psi = phi[self.rows][is_measured]
        square = np.sum(psi**2)
        turn = np.exp(-0.5j * np.angle(square))
        u = (psi * turn).real
        noise = measured_mode.shape_std or self.shape_std
        s = (u @ v) / (u @ u)
        miss = (s * u - v) / noise
        if by is None:
            return miss, np.zeros((len(v), 0))
        change = by[self.rows][is_measured]
        alpha = np.imag(2 * psi @ change / square) / 2
        du = ((change - 1j * psi[:, None] * alpha) * turn).real
        ds = (v @ du - 2 * s * (u @ du)) / (u @ u)
        return miss, np.asarray((s * du + u[:, None] * ds) / noise)

    def _beliefs(self, z: Floats) -> tuple[Floats, Floats]:
        """Residuals of priors, and their derivatives."""
        priors = [(k, parameter.prior_of_z) for k, parameter in enumerate(self.parameters)]
        beliefs = [(k, *prior) for k, prior in priors if prior is not None]
        rows = np.zeros((len(beliefs), len(self.parameters)))
        for row, (k, _, std) in zip(rows, beliefs, strict=True):
            row[k] = 1 / std
        return np.array([(z[k] - mean) / std for k, mean, std in beliefs]), rows

    def freedom(self) -> int:
        """Number of residuals less that of the numbers fitted and of the shapes' scales."""
        values = len(self.residuals(starts_of(self.parameters)))
        return values - int(np.count_nonzero(self.is_fitted)) - len(self.with_shapes)


def _places(modes: Modes, measured: MeasuredModes) -> list[int]:
    """The position of every measured mode among the oscillating ones, each counted as often as it occurs."""
    problems, places = [], []
    starts = np.concatenate(([0], np.cumsum(np.where(_swings(modes), modes.multiplicity, 0))))
    for measured_mode in measured.modes:
        if measured_mode.number > len(modes):
            problems.append(f"mode {measured_mode.number}: the scene has modes 1 to {len(modes)}")
        elif not _swings(modes)[measured_mode.number - 1]:
            problems.append(f"mode {measured_mode.number}: does not oscillate in this scene")
        elif measured_mode.shape is not None and modes.multiplicity[measured_mode.number - 1] > 1:
            problems.append(
                f"mode {measured_mode.number}: is shared by several modes, so that its shape is not determined"
            )
        else:
            places.append(int(starts[measured_mode.number - 1]))
    refuse_any([f"{measured.file}: {problem}" for problem in problems])
    return places


def _swings(modes: Modes) -> Any:
    return modes.eigenvalue.imag > 0


def _ratio_std(measured_mode: MeasuredMode) -> float:
    """Of a damping ratio; without a stated one that of the frequency, relative: a pole is as uncertain either way."""
    return measured_mode.damping_ratio_std or measured_mode.std / measured_mode.frequency


def _search(problem: _ModeFitProblem, loss: str) -> tuple[Floats, float | None]:
    z = starts_of(problem.parameters)
    if len(z):
        problem.jacobian(z)
        problem.is_fitted[_undetermined_around(problem, z, [], np.inf)] = False
    z, _ = _refine(problem, z, loss)
    if len(z):
        undetermined = np.flatnonzero(~problem.is_fitted).tolist()
        held = _undetermined_around(problem, z, undetermined, 1.0)
        if len(held) > len(undetermined):
            problem.is_fitted[held] = False
            z[~problem.is_fitted] = starts_of(problem.parameters)[~problem.is_fitted]
            z = _solve(problem, z, loss)
            problem.shape_std = _shape_noise(problem, z) if problem.estimates_noise else problem.shape_std
    return z, problem.shape_std if problem.estimates_noise else None


def _undetermined_around(problem: _ModeFitProblem, z: Floats, held: Sequence[int], vague: float) -> Ints:
    """The numbers that are fixed since the modes do not determine them, a few percent to either side.

    At z itself derivatives may vanish, as at equal lengths.
    """
    factors = GENERIC_STEP * (1 + np.arange(len(z)) / len(z)) * (-1.0) ** np.arange(len(z))
    logs = np.array([parameter.log or parameter.unknown.is_shift for parameter in problem.parameters], dtype=bool)
    undetermined = []
    for shift in (factors, -factors):
        aside = np.where(logs, z + shift, z * np.exp(shift))
        try:
            J = problem.jacobian(aside)
        except (ComputationError, SceneError):
            aside, J = z, problem.jacobian(z)
        undetermined.append(find_determined(J, problem.parameters, aside, vague=vague, held=held).held)
    return min(undetermined, key=len)


def _refine(problem: _ModeFitProblem, z: Floats, loss: str) -> tuple[Floats, float | None]:
    """The minimum from this z on, and the noise of shapes where it is estimated."""
    for _ in range(FIT_ROUNDS):
        z = _solve(problem, z, loss)
        if not problem.estimates_noise:
            return z, None
        problem.shape_std = _shape_noise(problem, z)
    return z, problem.shape_std


def _minima(problem: _ModeFitProblem, z: Floats, loss: str) -> list[tuple[float, Floats]]:
    """Minima from other starts than that of the minimum z, each with its sum of squares, from the least on."""
    minima = []
    for start in _starts(problem, z):
        try:
            minimum = _solve(problem, start, loss, ROUGH_EVALUATIONS)
            if _square(problem, minimum) < CHI_SQUARE_LEFT + _square(problem, z):
                minimum = _solve(problem, minimum, loss)
                minima.append((_square(problem, minimum), minimum))
        except (ComputationError, SceneError):
            continue
    return sorted(minima, key=lambda pair: pair[0])


def _starts(problem: _ModeFitProblem, z: Floats) -> Iterator[Floats]:
    """The minimum with two numbers of one kind exchanged, and random ones around it."""
    fitted = np.flatnonzero(problem.is_fitted).tolist()
    kinds = [(problem.parameters[k].place[-1], problem.parameters[k].log) for k in range(len(z))]
    pairs = [(j, k) for j, k in combinations(fitted, 2) if kinds[j] == kinds[k]]
    for j, k in pairs[: 4 * len(z)]:  # of many numbers not every pair, as their number goes with the square
        start, first, second = z.copy(), problem.parameters[j], problem.parameters[k]
        start[j], start[k] = first.z_of(second.at(float(z[k]))), second.z_of(first.at(float(z[j])))
        yield start
    rng = np.random.default_rng(len(z))
    for _ in range(4):
        start = z.copy()
        for k, factor in zip(fitted, (rng.standard_normal(len(fitted)) / 2).tolist(), strict=True):
            start[k] = z[k] + factor if problem.parameters[k].log else z[k] * np.exp(factor)
        yield start


def _square(problem: _ModeFitProblem, z: Floats) -> float:
    residuals = problem.residuals(z)
    return float(residuals @ residuals)


def _shape_noise(problem: _ModeFitProblem, z: Floats) -> float:
    """The standard deviation of shapes' components by their residuals, one scale being fitted to each."""
    _, modes = problem.modes_at(z)
    square, count = 0.0, 0
    for measured_mode, row in problem.pairs(modes):
        if measured_mode.shape is None or measured_mode.shape_std is not None:
            continue
        phi = modes.matrix.shapes[:, modes.matrix.row == row][:, 0].astype(np.complex128)
        miss = problem._shape(measured_mode, phi, None)[0] * problem.shape_std
        square, count = square + float(miss @ miss), count + len(miss) - 1
    return max(NOISE_MIN, float(np.sqrt(square / max(count, 1))))


def _solve(problem: _ModeFitProblem, z: Floats, loss: str, evaluations: int | None = None) -> Floats:
    """The minimum of a search from z, after at most this many evaluations."""
    columns = np.flatnonzero(problem.is_fitted)
    if not len(columns):
        return z
    low = np.array([parameter.z_min for parameter in problem.parameters])[columns]
    size, start = len(problem.residuals(z)), z

    def z_of(x: Floats) -> Floats:
        z = start.copy()
        z[columns] = x
        return z

    def residuals(x: Floats) -> Floats:
        try:
            return problem.residuals(z_of(x))
        except (ComputationError, SceneError):
            return np.full(size, 1e12)

    def jacobian(x: Floats) -> Floats:
        return problem.jacobian(z_of(x))[:, columns]

    tolerances = dict.fromkeys(("ftol", "xtol", "gtol"), 64 * np.finfo(float).eps)
    solution = scipy.optimize.least_squares(
        residuals,
        np.maximum(z[columns], low + 1e-12),
        jacobian,
        bounds=(low, np.inf),
        x_scale=np.array([parameter.step for parameter in problem.parameters])[columns],
        loss=loss,
        max_nfev=evaluations,
        **tolerances,
    )
    return z_of(solution.x)


def _covariance(problem: _ModeFitProblem, z: Floats) -> Floats:
    """The covariance of z, (p, p), zero for numbers that are fixed, at a minimum.

    Along each singular vector of the Jacobian the standard deviation is a half of the 95 % interval (1.96 to either
    side) in which chi-square, the least over the other directions, rises by 3.84: 1/s where residuals are linear.
    """
    fitted = np.flatnonzero(problem.is_fitted)
    cov = np.zeros((len(z), len(z)))
    if not len(fitted):
        return cov
    J = problem.jacobian(z)[:, fitted]
    size = np.maximum(np.linalg.norm(J, axis=0), 1e-300)
    _, singular, V = np.linalg.svd(np.vstack((J / size, np.zeros((len(fitted), len(fitted))))), full_matrices=False)
    steps = np.zeros((len(z), len(fitted)))
    # where a derivative vanishes, as at equal lengths, the step of a linear fit is infinite: `_reach` finds its end
    steps[fitted] = V.T / size[:, None] / np.maximum(singular, 1e-12 * singular[0])
    reaches = steps * np.array([_reach(problem, z, steps, k) for k in range(len(fitted))])
    return np.asarray(reaches @ reaches.T)


def _reach(problem: _ModeFitProblem, z: Floats, steps: Floats, k: int) -> float:
    """By how much the standard deviation along the step (p,) number k differs from its length, that of a linear fit."""
    rise = _quantile(1)
    normal, level = np.sqrt(rise), _square(problem, z) + rise
    lows = [parameter.z_min for parameter in problem.parameters]
    furthest = 2 / max(float(np.abs(steps[:, k]).max()), 1e-300)  # z ± 2, a factor of 7, is as good as anything

    ends = []
    for side in (-1.0, 1.0):
        straight_end = np.maximum(z + side * normal * steps[:, k], lows)
        try:
            is_linear = normal < furthest and abs(_square(problem, straight_end) - level) < rise / 4
        except (ComputationError, SceneError):
            is_linear = False
        if is_linear:
            ends.append(normal)
            continue
        low, high, y = 0.0, min(normal, furthest) / 4, np.zeros(steps.shape[1])

        def is_within(t: float, y: Floats = y, side: float = side) -> bool:
            y[k] = side * t
            return _least_beside(problem, z, steps, y, k) < level

        while high < furthest and is_within(high):
            low, high = high, 1.5 * high
        high = min(high, furthest)
        while 4 * (high - low) > low:
            middle = (low + high) / 2
            low, high = (middle, high) if is_within(middle) else (low, middle)
        ends.append((low + high) / 2)
    return float(max(ends) / normal)


def _least_beside(problem: _ModeFitProblem, z: Floats, steps: Floats, y: Floats, k: int) -> float:
    """The sum of squares at z + steps y, the least over all y but y_k, which it moves: Gauss-Newton's method.

    Infinite where there are no modes.
    """
    lows = np.array([parameter.z_min for parameter in problem.parameters])
    others = np.delete(np.arange(len(y)), k)
    best = np.inf
    try:
        for _ in range(FIT_ROUNDS):
            trial = np.maximum(z + steps @ y, lows)
            residuals = problem.residuals(trial)
            square = float(residuals @ residuals)
            if not len(others) or square >= best:
                return min(square, best)
            best = square
            y[others] -= np.linalg.lstsq(problem.jacobian(trial) @ steps[:, others], residuals, rcond=None)[0]
    except (ComputationError, SceneError):
        pass  # beyond the numbers at which a measured mode ceases to swing, chi-square is infinite
    return best


def _solutions(problem: _ModeFitProblem, z: Floats, cov: Floats, minima: Sequence[Floats]) -> list[Solution]:
    """The solutions at other minima that fit as well as z and differ from it, and from each other."""
    largest = _square(problem, z) + _quantile(max(1, int(np.count_nonzero(problem.is_fitted))))
    solutions: list[Solution] = []
    regions = [(z, cov)]
    for minimum in minima:
        square = _square(problem, minimum)
        distances = [np.abs(minimum - centre) - np.sqrt(np.diag(spread)) / 2 for centre, spread in regions]
        if square > largest or any(np.all(distance < 1e-6) for distance in distances):
            continue
        regions.append((minimum, _covariance(problem, minimum)))
        solutions.append(Solution(problem.parameters, *regions[-1], square))
    return solutions


def _quantile(freedom: int) -> float:
    """The χ² of this many degrees of freedom that is not exceeded with probability CONFIDENCE."""
    return float(2 * scipy.special.gammaincinv(freedom / 2, CONFIDENCE))


def _certify(
    problem: _ModeFitProblem, z: Floats, shape_std: float | None, loss: str, minima: Sequence[Floats] = ()
) -> ModeFit:
    """The fit at the minimum z, with all remarks."""
    fitted, held = np.flatnonzero(problem.is_fitted), np.flatnonzero(~problem.is_fitted)
    residuals, J = problem.residuals(z), problem.jacobian(z)
    cov = _covariance(problem, z)
    determined = Determined(fitted, held, (), 1.0)
    if problem.parameters:
        determination = find_determined(J, problem.parameters, z, vague=np.inf, held=held.tolist())
        paths = {problem.parameters[k].path for k in held.tolist()}
        directions = tuple(direction for direction in determination.directions if direction.held in paths)
        determined = Determined(fitted, held, directions, determination.condition)
    scene, modes = problem.modes_at(z)
    fitted_modes = tuple(_fitted_mode(problem, modes, *pair) for pair in problem.pairs(modes))
    fit = ModeFit(
        parameters=problem.parameters,
        z=z,
        cov=cov,
        chi_square=float(residuals @ residuals),
        given=problem.scene,
        scene=scene,
        measured=problem.measured,
        determined=determined,
        held=held,
        modes=fitted_modes,
        freedom=problem.freedom(),
        shape_std=shape_std,
        others=tuple(_solutions(problem, z, cov, minima)),
    )
    return ModeFit(**{**vars(fit), "verdict": tuple(_verdict(problem, fit, loss))})


def _fitted_mode(problem: _ModeFitProblem, modes: Modes, measured_mode: MeasuredMode, row: int) -> FittedMode:
    value = modes.eigenvalue[row]
    mac = None
    if measured_mode.shape is not None:
        is_measured = np.isfinite(measured_mode.shape)
        phi = modes.matrix.shapes[:, modes.matrix.row == row][problem.rows, 0].astype(np.complex128)
        mac = mac_with(measured_mode.shape[is_measured], phi[is_measured][:, None])
    std = None if measured_mode.damping_ratio is None else _ratio_std(measured_mode)
    return FittedMode(measured_mode, float(abs(value)) / (2 * np.pi), float(-value.real / abs(value)), std, mac)


def _solution_words(solution: Solution, fitted: Sequence[int]) -> str:
    numbers = [(solution.parameters[k].path, solution.values[k], solution.stds[k]) for k in fitted]
    words = [f"{path} = {with_error(value, std)} ± {std:.2g}" for path, value, std in numbers]
    return listed(words, len(words))


def _verdict(problem: _ModeFitProblem, result: ModeFit, loss: str) -> list[str]:
    words = []
    if result.freedom > 0:
        chance = float(scipy.special.chdtrc(result.freedom, result.chi_square))
        test = f"chi-square {short(result.chi_square)} with {result.freedom} degrees of freedom"
        if chance < CHANCE_MAX:
            words.append(
                f"{test}: so large by chance in {percent(chance)} of cases, so the stated standard deviations are too "
                "small or the model lacks something"
            )
        else:
            words.append(f"{test}: as the stated standard deviations suggest (larger by chance in {percent(chance)})")
    else:
        words.append("as many numbers as measured values: nothing is left to test the model by")
    for other in result.others:
        numbers = _solution_words(other, result.fitted)
        words.append(
            f"another solution fits as well, with chi-square {short(other.chi_square)}: {numbers}; a measured shape or "
            "a prior can tell which is right"
        )
    worst = max(result.modes, key=lambda mode: abs(mode.deviation))
    if abs(worst.deviation) > 3:
        words.append(f"mode {worst.measured.number} is off by {worst.deviation:+.1f} standard deviations in frequency")
    if any(mode.damping_ratio is not None and mode.damping_ratio_std is None for mode in problem.measured.modes):
        words.append(
            "damping ratios without a standard deviation are taken to have that of the frequency, relative to it"
        )
    if result.shape_std is not None:
        words.append(
            f"the noise of the shapes is estimated from their residuals: {result.shape_std:.2g} of the largest"
        )
    for k in result.fitted:
        if result.parameters[k].z_min == 0.0 and result.z[k] < BOUND_DISTANCE:
            words.append(f"{result.parameters[k].words} is at its bound, 0: the modes give no sign of it")
    words += means_of(result.parameters)
    if loss != "linear":
        words.append(f"standard deviations are those of the linear loss at the optimum of {loss}")
    return words
