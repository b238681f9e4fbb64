"""Fit the numbers of a scene to measured modes, by weighted least squares on exact derivatives.

The residuals are those of frequencies, of damping ratios and of shapes, each in units of its standard deviation:

    (f(p) − f)/σ_f,    (ζ(p) − ζ)/σ_ζ,    (s u(p) − v)/σ_v

with v a measured shape whose largest component is 1, u the computed one and s the scale that brings it nearest.
Derivatives are those of `derivatives`; what the modes determine is found as for motions.  [Friswell1995, ch. 8]

Modes are polynomials in the numbers, so several sets of numbers may have the same ones: two bobs swing with the same
frequencies when their lengths change places.  The fit is repeated from other starts, and every minimum within the
confidence region of the best one is a solution.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import combinations
from typing import Any

import numpy as np
import scipy

from modal.errors import ComputationError, SceneError
from modal.identification.derivatives import ModeDerivatives, matrix_derivatives, polar
from modal.identification.identifiability import VAGUE, Determined, find_determined
from modal.identification.measured import MeasuredMode, MeasuredModes, component_rows, turned
from modal.identification.mode_fit import FittedMode, ModeFit, Solution
from modal.identification.parameters import (
    Parameter,
    find_parameters,
    numbers_at,
    scene_with,
    starts_of,
    with_error,
)
from modal.modes import Modes, natural_modes
from modal.report import listed, percent, short
from modal.scene import Scene
from modal.scene.doors import checked
from modal.types import Floats, Ints

ROUGH_SHAPE = 0.02  # standard deviation of a shape's component before the residuals tell it
FINEST_SHAPE = 1e-9
ROUNDS = 4  # of fitting and estimating the noise of shapes
MOST, CLOSE = 200, 1e-13  # evaluations; relative change of the sum of squares, or of the numbers, at the end
WHATEVER = 1e100  # standard deviation of z that is not too vague before the fit
FEWER, ROUGHLY, NEARLY = 12, 1e-6, 1e3  # from other starts: evaluations, such a change, chi-square still to lose
STARTS, TESTED, SPREAD = (
    8,
    3,
    0.5,
)  # other starts, where there is a chi-square to tell them apart, and the standard deviation of their logarithms
MOST_EXCHANGES = 24  # of two numbers of one kind
CONFIDENCE = 0.95  # of the region about the best fit in which other minima are solutions
SAME = 1e-4  # of z, within which a rough minimum is the known one
DISTINCT = 0.5  # standard deviations by which another solution differs in some number
SINGULAR = 1e-12  # of the largest singular value: where a derivative vanishes
LINEAR = 0.3  # of 3.84, by which chi-square at the ends of a linear fit's interval may be off
FURTHEST, BISECTIONS, SETTLED = 1.5, 5, 1e-3  # |z| of an interval's ends; halvings to find them; change at the end
GENERIC = 0.03  # by which numbers are moved to see what is determined at no special values, such as equal lengths
BETTER = 1.0  # chi-square by which another minimum is the fit itself
UNLIKELY = 0.01  # probability of a larger chi-square below which the model is doubted
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
    """The numbers at the places `free` that fit measured modes best, from the scene's values on.

    `priors` are texts such as "gravity=9.81±0.01".  Raises SceneError for places that are no free numbers and for modes
    that the scene does not have, ComputationError where a mode has no derivative.
    """
    if loss not in LOSSES:
        raise SceneError([f"loss {loss}: must be one of {', '.join(LOSSES)}"])
    parameters = find_parameters(scene, free, priors)
    problem = _ModeFitProblem(scene, parameters, measured)
    z, shape_std = _search(problem, loss)
    minima = _minima(problem, z, loss) if problem.kept.any() else []
    if minima and minima[0][0] < _square(problem, z) - BETTER:
        z, shape_std = _refined(problem, minima[0][1], loss)
    return _certified(problem, z, shape_std, loss, [other for _, other in minima])


class _ModeFitProblem:
    """Residuals and their derivatives, by z of the numbers."""

    def __init__(self, scene: Scene, parameters: tuple[Parameter, ...], measured: MeasuredModes) -> None:
        self.scene, self.parameters, self.measured = scene, parameters, measured
        self.kept = np.ones(len(parameters), dtype=bool)
        self.shape_std = ROUGH_SHAPE
        self.rows = component_rows(scene, measured.components)
        self.places = _places(natural_modes(scene), measured)
        self.shaped = [mode for mode in measured.modes if mode.shape is not None]

    @property
    def estimates_noise(self) -> bool:
        """Whether the residuals of shapes tell their noise."""
        return any(mode.shape_std is None for mode in self.shaped)

    def modes_at(self, z: Floats) -> tuple[Scene, Modes]:
        """The scene with these numbers, and its modes."""
        scene = scene_with(self.scene, numbers_at(self.parameters, z))
        return scene, natural_modes(scene)

    def residuals(self, z: Floats) -> Floats:
        """In standard deviations, priors last; ComputationError where a measured mode is none any more."""
        _, modes = self.modes_at(z)
        residuals: list[Any] = []
        for measured_mode, place in zip(self.measured.modes, self.places, strict=True):
            row = _row(modes, place)
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
            modes, *matrix_derivatives(scene, [parameter.place for parameter in self.parameters], units)
        )
        slopes = np.array([parameter.slope(float(value)) for parameter, value in zip(self.parameters, z, strict=True)])
        rows: list[Floats] = []
        for measured_mode, place in zip(self.measured.modes, self.places, strict=True):
            row = _row(modes, place)
            by_number = derivatives.eigenvalue(row)
            if np.any(np.isnan(by_number)):
                k = int(np.flatnonzero(np.isnan(by_number))[0])
                raise ComputationError(
                    f"mode {measured_mode.number} shares its frequency with others, and {self.parameters[k].path} "
                    "splits it: it has no single derivative; free a number of all equal pendula, or leave the mode out"
                )
            omega, zeta = polar(complex(modes.eigenvalue[row]), by_number)
            rows.append((omega / (2 * np.pi) / measured_mode.std)[None])
            if measured_mode.damping_ratio is not None:
                rows.append((zeta / _ratio_std(measured_mode))[None])
            if measured_mode.shape is not None:
                phi, by, _ = derivatives.shape(row)
                rows.append(self._shape(measured_mode, phi, by)[1])
        whole = np.vstack(rows) * slopes
        return np.vstack((whole, self._beliefs(z)[1]))

    def _shape(self, measured_mode: MeasuredMode, phi: Any, by: Any) -> tuple[Floats, Floats]:
        """Residuals of a shape, and their derivatives."""
        assert measured_mode.shape is not None
        there = np.isfinite(measured_mode.shape)
        v = measured_mode.shape[there]
        v = v / np.abs(v).max()
        psi = phi[self.rows][there]
        square = np.sum(psi**2)
        turn = np.exp(-0.5j * np.angle(square))
        u = (psi * turn).real
        noise = measured_mode.shape_std or self.shape_std
        s = (u @ v) / (u @ u)
        miss = (s * u - v) / noise
        if by is None:
            return miss, np.zeros((len(v), 0))
        change = by[self.rows][there]
        alpha = np.imag(2 * psi @ change / square) / 2
        du = ((change - 1j * psi[:, None] * alpha) * turn).real
        ds = (v @ du - 2 * s * (u @ du)) / (u @ u)
        return miss, np.asarray((s * du + u[:, None] * ds) / noise)

    def _beliefs(self, z: Floats) -> tuple[Floats, Floats]:
        known = [
            (k, parameter.believed) for k, parameter in enumerate(self.parameters) if parameter.believed is not None
        ]
        rows = np.zeros((len(known), len(self.parameters)))
        miss = np.zeros(len(known))
        for at, (k, belief) in enumerate(known):
            assert belief is not None
            rows[at, k], miss[at] = 1 / belief[1], (z[k] - belief[0]) / belief[1]
        return miss, rows

    def freedom(self) -> int:
        """Number of residuals less that of the numbers fitted and of the shapes' scales."""
        values = len(self.residuals(starts_of(self.parameters)))
        return values - int(np.count_nonzero(self.kept)) - len(self.shaped)


def _places(modes: Modes, measured: MeasuredModes) -> list[int]:
    """The position of every measured mode among the oscillating ones, each counted as often as it occurs."""
    problems, places = [], []
    before = np.concatenate(([0], np.cumsum(np.where(_swings(modes), modes.multiplicity, 0))))
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
            places.append(int(before[measured_mode.number - 1]))
    if problems:
        raise SceneError([f"{measured.file}: {problem}" for problem in problems])
    return places


def _swings(modes: Modes) -> Any:
    return modes.eigenvalue.imag > 0


def _row(modes: Modes, place: int) -> int:
    """The row of the mode at a position among the oscillating ones."""
    ends = np.cumsum(np.where(_swings(modes), modes.multiplicity, 0))
    row = int(np.searchsorted(ends, place, side="right"))
    if row >= len(modes):
        raise ComputationError("a measured mode does not oscillate with these numbers")
    return row


def _ratio_std(measured_mode: MeasuredMode) -> float:
    """Of a damping ratio; without a stated one that of the frequency, relative: a pole is as uncertain either way."""
    return measured_mode.damping_ratio_std or measured_mode.std / measured_mode.frequency


def _search(problem: _ModeFitProblem, loss: str) -> tuple[Floats, float | None]:
    z = starts_of(problem.parameters)
    if len(z):
        problem.jacobian(z)
        problem.kept[_lost_around(problem, z, [], WHATEVER)] = False
    z, _ = _refined(problem, z, loss)
    if len(z):
        lost = np.flatnonzero(~problem.kept).tolist()
        held = _lost_around(problem, z, lost, VAGUE)
        if len(held) > len(lost):
            problem.kept[held] = False
            z[~problem.kept] = starts_of(problem.parameters)[~problem.kept]
            z = _solved(problem, z, loss)
            problem.shape_std = _shape_noise(problem, z) if problem.estimates_noise else problem.shape_std
    return z, problem.shape_std if problem.estimates_noise else None


def _lost_around(problem: _ModeFitProblem, z: Floats, held: Sequence[int], vague: float) -> Ints:
    """The numbers that are held since the modes do not determine them, a few percent to either side.

    At z itself derivatives may vanish, as at equal lengths.
    """
    factors = GENERIC * (1 + np.arange(len(z)) / len(z)) * (-1.0) ** np.arange(len(z))
    logs = np.array([parameter.log for parameter in problem.parameters], dtype=bool)
    lost = []
    for shift in (factors, -factors):
        moved = np.where(logs, z + shift, z * np.exp(shift))
        try:
            J = problem.jacobian(moved)
        except (ComputationError, SceneError):
            moved, J = z, problem.jacobian(z)
        lost.append(find_determined(J, problem.parameters, moved, vague=vague, held=held).held)
    return min(lost, key=len)


def _refined(problem: _ModeFitProblem, z: Floats, loss: str) -> tuple[Floats, float | None]:
    """The minimum from this z on, and the noise of shapes where it is estimated."""
    for _ in range(ROUNDS):
        z = _solved(problem, z, loss)
        if not problem.estimates_noise:
            return z, None
        problem.shape_std = _shape_noise(problem, z)
    return z, problem.shape_std


def _minima(problem: _ModeFitProblem, z: Floats, loss: str) -> list[tuple[float, Floats]]:
    """Minima from other starts than that of the minimum z, each with its sum of squares, from the least on."""
    minima = []
    for start in _starts(problem, z):
        try:
            minimum = _solved(problem, start, loss, FEWER, ROUGHLY)
            if _square(problem, minimum) < NEARLY + _square(problem, z) and np.abs(minimum - z).max() > SAME:
                minimum = _solved(problem, minimum, loss)
                minima.append((_square(problem, minimum), minimum))
        except (ComputationError, SceneError):
            continue
    return sorted(minima, key=lambda pair: pair[0])


def _starts(problem: _ModeFitProblem, z: Floats) -> Iterator[Floats]:
    """The minimum with two numbers of one kind exchanged, and random ones around it."""
    kept = np.flatnonzero(problem.kept).tolist()
    kinds = [(problem.parameters[k].place[-1], problem.parameters[k].log) for k in range(len(z))]
    pairs = [(j, k) for j, k in combinations(kept, 2) if kinds[j] == kinds[k]]
    for j, k in pairs[:MOST_EXCHANGES]:
        exchanged, first, second = z.copy(), problem.parameters[j], problem.parameters[k]
        exchanged[j], exchanged[k] = first.z_of(second.at(float(z[k]))), second.z_of(first.at(float(z[j])))
        yield exchanged
    rng = np.random.default_rng(len(z))
    for _ in range(TESTED if problem.freedom() > 0 else STARTS):
        factors = SPREAD * rng.standard_normal(len(kept))
        drawn = z.copy()
        for k, factor in zip(kept, factors.tolist(), strict=True):
            drawn[k] = z[k] + factor if problem.parameters[k].log else z[k] * np.exp(factor)
        yield drawn


def _square(problem: _ModeFitProblem, z: Floats) -> float:
    residuals = problem.residuals(z)
    return float(residuals @ residuals)


def _shape_noise(problem: _ModeFitProblem, z: Floats) -> float:
    """The standard deviation of shapes' components by their residuals, one scale being fitted to each."""
    _, modes = problem.modes_at(z)
    square, count = 0.0, 0
    for measured_mode, place in zip(problem.measured.modes, problem.places, strict=True):
        if measured_mode.shape is None or measured_mode.shape_std is not None:
            continue
        phi = modes.matrix.shapes[:, modes.matrix.row == _row(modes, place)][:, 0].astype(np.complex128)
        miss = problem._shape(measured_mode, phi, None)[0] * problem.shape_std
        square, count = square + float(miss @ miss), count + len(miss) - 1
    return max(FINEST_SHAPE, float(np.sqrt(square / max(count, 1))))


def _solved(problem: _ModeFitProblem, z: Floats, loss: str, most: int = MOST, close: float = CLOSE) -> Floats:
    columns = np.flatnonzero(problem.kept)
    if not len(columns):
        return z
    least = np.array([parameter.least for parameter in problem.parameters])[columns]

    def whole(x: Floats) -> Floats:
        every = z.copy()
        every[columns] = x
        return every

    def residuals(x: Floats) -> Floats:
        try:
            return problem.residuals(whole(x))
        except (ComputationError, SceneError):
            return np.full(size, 1e12)

    size = len(problem.residuals(z))
    steps = [0.1 if parameter.log else 0.1 * max(parameter.start, 0.05) for parameter in problem.parameters]
    jacobian: Callable[[Floats], Floats] = lambda x: problem.jacobian(whole(x))[:, columns]  # noqa: E731
    solution = scipy.optimize.least_squares(
        residuals,
        np.maximum(z[columns], least + 1e-12),
        jacobian,
        bounds=(least, np.inf),
        x_scale=np.array(steps)[columns],
        loss=loss,
        max_nfev=most,
        ftol=close,
        xtol=close,
        gtol=close,
    )
    return whole(solution.x)


def _covariance(problem: _ModeFitProblem, z: Floats) -> Floats:
    """Of z, (p, p), zero for numbers that are held, at a minimum.

    Along each singular vector of the Jacobian the standard deviation is a half of the 95 % interval (1.96 to either
    side) in which chi-square, the least over the other directions, rises by 3.84: 1/s where residuals are linear.
    """
    kept = np.flatnonzero(problem.kept)
    cov = np.zeros((len(z), len(z)))
    if not len(kept):
        return cov
    J = problem.jacobian(z)[:, kept]
    size = np.maximum(np.linalg.norm(J, axis=0), 1e-300)
    _, singular, V = np.linalg.svd(np.vstack((J / size, np.zeros((len(kept), len(kept))))), full_matrices=False)
    steps = np.zeros((len(z), len(kept)))
    steps[kept] = V.T / size[:, None] / np.maximum(singular, SINGULAR * singular[0])
    reach = np.array([_reach(problem, z, steps, k) for k in range(len(kept))])
    scaled = steps * reach
    return np.asarray(scaled @ scaled.T)


def _rise(problem: _ModeFitProblem, z: Floats) -> float:
    """The sum of squares, infinite where there are no modes."""
    try:
        return _square(problem, z)
    except (ComputationError, SceneError):
        return np.inf


def _reach(problem: _ModeFitProblem, z: Floats, steps: Floats, k: int) -> float:
    """By how much the standard deviation along the step (p,) number k differs from its length, that of a linear fit."""
    rise = _quantile(1)
    normal, level = np.sqrt(rise), _square(problem, z) + rise
    furthest = FURTHEST / max(float(np.abs(steps[:, k]).max()), 1e-300)

    ends = []
    for side in (-1.0, 1.0):
        straight = np.maximum(z + side * normal * steps[:, k], [parameter.least for parameter in problem.parameters])
        if normal < furthest and abs(_rise(problem, straight) - level) < LINEAR * rise:
            ends.append(normal)
            continue
        low, high, y = 0.0, min(normal, furthest) / 4, np.zeros(steps.shape[1])

        def within(t: float, y: Floats = y, side: float = side) -> bool:
            y[k] = side * t
            return _least_beside(problem, z, steps, y, k) < level

        while high < furthest and within(high):
            low, high = high, 1.5 * high
        high = min(high, furthest)
        for _ in range(BISECTIONS):
            middle = (low + high) / 2
            low, high = (middle, high) if within(middle) else (low, middle)
        ends.append(high)
    return float(max(ends) / normal)


def _least_beside(problem: _ModeFitProblem, z: Floats, steps: Floats, y: Floats, k: int) -> float:
    """The sum of squares at z + steps y, the least over all y but y_k, which it moves: Gauss-Newton's method.

    Infinite where there are no modes.
    """
    least = np.array([parameter.least for parameter in problem.parameters])
    others = np.delete(np.arange(len(y)), k)
    free, best = steps[:, others], np.inf
    try:
        for _ in range(ROUNDS):
            place = np.maximum(z + steps @ y, least)
            residuals = problem.residuals(place)
            square = float(residuals @ residuals)
            if not len(others) or square > best * (1 - SETTLED):
                return min(square, best)
            best = square
            y[others] -= np.linalg.lstsq(problem.jacobian(place) @ free, residuals, rcond=None)[0]
    except (ComputationError, SceneError):
        return min(best, np.inf)
    return best


def _solutions(problem: _ModeFitProblem, z: Floats, cov: Floats, minima: Sequence[Floats]) -> list[Solution]:
    """Those of other minima that fit as well as z and differ from it, and from each other."""
    most = _square(problem, z) + _quantile(max(1, int(np.count_nonzero(problem.kept))))
    solutions: list[Solution] = []
    known = [(z, cov)]
    for other in minima:
        square = _square(problem, other)
        if square > most or any(_same(other, earlier, spread) for earlier, spread in known):
            continue
        known.append((other, _covariance(problem, other)))
        solutions.append(Solution(problem.parameters, *known[-1], square))
    return solutions


def _quantile(freedom: int) -> float:
    """The χ² of this many degrees of freedom that is not exceeded with probability CONFIDENCE."""
    return float(2 * scipy.special.gammaincinv(freedom / 2, CONFIDENCE))


def _same(numbers: Floats, other: Floats, cov: Floats) -> bool:
    """Whether numbers are others within a part of the standard deviations of these."""
    return bool(np.all(np.abs(numbers - other) < DISTINCT * np.sqrt(np.maximum(np.diag(cov), 0.0)) + 1e-6))


def _certified(
    problem: _ModeFitProblem, z: Floats, shape_std: float | None, loss: str, minima: Sequence[Floats] = ()
) -> ModeFit:
    count, kept = len(problem.parameters), np.flatnonzero(problem.kept)
    residuals, J = problem.residuals(z), problem.jacobian(z)
    cov = _covariance(problem, z)
    determined = Determined(kept, np.flatnonzero(~problem.kept), (), 1.0)
    if count:
        lost = np.flatnonzero(~problem.kept).tolist()
        judged = find_determined(J, problem.parameters, z, vague=WHATEVER, held=lost)
        directions = tuple(
            direction for direction in judged.directions if direction.held in {problem.parameters[k].path for k in lost}
        )
        determined = Determined(kept, np.flatnonzero(~problem.kept), directions, judged.condition)
    scene, modes = problem.modes_at(z)
    square, freedom = float(residuals @ residuals), problem.freedom()
    beside = tuple(
        _beside(problem, modes, measured_mode, place)
        for measured_mode, place in zip(problem.measured.modes, problem.places, strict=True)
    )
    fit = ModeFit(
        parameters=problem.parameters,
        z=z,
        cov=cov,
        chi_square=square,
        given=problem.scene,
        scene=scene,
        measured=problem.measured,
        determined=determined,
        held=determined.held,
        modes=beside,
        freedom=freedom,
        shape_std=shape_std,
        others=tuple(_solutions(problem, z, cov, minima)),
    )
    return ModeFit(**{**vars(fit), "verdict": tuple(_verdict(problem, fit, loss))})


def _beside(problem: _ModeFitProblem, modes: Modes, measured_mode: MeasuredMode, place: int) -> FittedMode:
    row = _row(modes, place)
    value = modes.eigenvalue[row]
    mac = None
    if measured_mode.shape is not None:
        there = np.isfinite(measured_mode.shape)
        phi = modes.matrix.shapes[:, modes.matrix.row == row][problem.rows, 0].astype(np.complex128)
        u, v = turned(phi[there]).real, measured_mode.shape[there]
        mac = float((u @ v) ** 2 / ((u @ u) * (v @ v)))
    stated = None if measured_mode.damping_ratio is None else _ratio_std(measured_mode)
    return FittedMode(measured_mode, float(abs(value)) / (2 * np.pi), float(-value.real / abs(value)), stated, mac)


def _words(solution: Solution, fitted: Sequence[int]) -> str:
    numbers = [(solution.parameters[k].path, solution.values[k], solution.stds[k]) for k in fitted]
    told = [f"{path} = {with_error(value, std)} ± {std:.2g}" for path, value, std in numbers]
    return listed(told, len(told))


def _verdict(problem: _ModeFitProblem, result: ModeFit, loss: str) -> list[str]:
    words = []
    if result.freedom > 0:
        chance = float(scipy.special.chdtrc(result.freedom, result.chi_square))
        told = f"chi-square {short(result.chi_square)} with {result.freedom} degrees of freedom"
        if chance < UNLIKELY:
            words.append(
                f"{told}: so large by chance in {percent(chance)} of cases, so the stated standard deviations are too "
                "small or the model lacks something"
            )
        else:
            words.append(f"{told}: as the stated standard deviations suggest (larger by chance in {percent(chance)})")
    else:
        words.append("as many numbers as measured values: nothing is left to test the model by")
    words += [
        f"another solution fits as well, with chi-square {short(other.chi_square)}: {_words(other, result.fitted)}; a "
        "measured shape or a prior can tell which is right"
        for other in result.others
    ]
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
        if result.parameters[k].least == 0.0 and result.z[k] < 1e-6:
            words.append(f"{result.parameters[k].path} is at its bound, 0: the modes give no sign of it")
    if loss != "linear":
        words.append(f"standard deviations are those of the linear loss at the optimum of {loss}")
    return words
