"""The result of a fit: numbers with their covariance, what is not determined, residuals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from modal.identification import (
    Combination,
    Determined,
    Parameter,
    Undetermined,
    find_combinations,
    fitted_columns,
    resampled,
)
from modal.report import Displayed, Summary, brief, counted, deferred, tabulated
from modal.scene import Scene, name_of
from modal.types import Floats, Ints
from nonlinear.identification.problem import FitProblem
from nonlinear.identification.records import Recording

if TYPE_CHECKING:
    from matplotlib.figure import Figure

BLOCKS = 10  # of residuals in a series, at least
POOR = 0.05  # of a reading's standard deviation: residuals that go on from sample to sample and are larger do not fit
BARE = 0.9  # of it: residuals of any kind that leave nothing explained
SURE = 5.0  # standard errors 1/√n of an autocorrelation, for saying so
APART = 10.0  # standard deviations of a gap between two windows that do not join


@dataclass(frozen=True, eq=False, repr=False)
class Fit(Displayed):
    """Numbers fitted to a recording.

    `scene` has them; `parameters` (p) are the ones that were free, `held` (indices) those among them that stayed at the
    scene's values; `unknowns` and `cov` (size, size) are all unknowns of `problem` with their covariance, zero for
    those held; `residuals` (N,) are in units of the sensors' noise.  Where the motion does not fit the record (`fits`),
    its numbers have no standard deviations: they are NaN.
    """

    problem: FitProblem
    unknowns: Floats
    cov: Floats
    held: Ints
    undetermined: tuple[Undetermined, ...]
    condition: float
    residuals: Floats
    scene: Scene
    given: Scene
    rho: tuple[Floats, ...]
    evaluations: int = 0
    loss: str = "linear"
    verdict: tuple[str, ...] = ()

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """The numbers that were free, held ones included."""
        return self.problem.parameters

    @property
    def recording(self) -> Recording:
        """What was fitted."""
        return self.problem.recording

    @cached_property
    def slopes(self) -> Floats:
        """dp/dz, (p,)."""
        return np.array(
            [parameter.slope(float(z)) for parameter, z in zip(self.parameters, self.unknowns, strict=False)]
        )

    @cached_property
    def values(self) -> Floats:
        """The numbers (p,), in the scene's units."""
        return np.array([parameter.at(float(z)) for parameter, z in zip(self.parameters, self.unknowns, strict=False)])

    @cached_property
    def misfit(self) -> Floats:
        """What the motion leaves of every sensor's readings (C,), as a part of their standard deviation.

        Only what goes on from sample to sample counts, √(Σ e_k e_(k+1) / Σ e_k²) times the residuals' rms: noise and
        outliers do not.  Where residuals are nearly as large as the readings, all of them count.
        """
        misfits = []
        for c, rho in enumerate(self.rho):
            read = np.concatenate(
                [segment.values[:, c] - np.nanmean(segment.values[:, c]) for segment in self.recording.segments]
            )
            miss = np.concatenate(
                [
                    reading[:, c] - segment.values[:, c]
                    for reading, segment in zip(self.readings, self.recording.segments, strict=True)
                ]
            )
            left = root_mean_square(miss) / (root_mean_square(read) or 1.0)
            count = int(np.count_nonzero(np.isfinite(miss)))
            again = float(np.abs(rho[1:3]).max()) if len(rho) > 1 else 0.0
            lasting = left * np.sqrt(again) if again > SURE / np.sqrt(count) else 0.0
            misfits.append(left if left > BARE else lasting)
        return np.array(misfits)

    @cached_property
    def gap(self) -> float:
        """The largest gap between a window and its continuation, in standard deviations of a gap; 0 without windows."""
        first = self.recording.n_values
        gaps = self.residuals[first : len(self.residuals) - sum(1 for parameter in self.parameters if parameter.prior)]
        return float(np.abs(gaps).max()) if len(gaps) else 0.0

    @property
    def fits(self) -> bool:
        """Whether the motion fits the record so well that standard deviations mean anything."""
        return bool(np.all(self.misfit < POOR)) and self.gap < APART

    @cached_property
    def covariance(self) -> Floats:
        """Of the numbers (p, p), zero for those held, NaN where the motion does not fit the record."""
        count = len(self.parameters)
        cov = np.asarray(self.slopes[:, None] * self.cov[:count, :count] * self.slopes)
        if not self.fits:
            cov[np.ix_(self.fitted, self.fitted)] = np.nan
        return cov

    @cached_property
    def stds(self) -> Floats:
        """Standard deviations of the numbers (p,), zero for those held, NaN where the motion does not fit."""
        return np.sqrt(np.maximum(np.diag(self.covariance), 0.0))

    def to_dict(self) -> dict[str, Any]:
        """A row for each number, (p,): its place, unit, what the scene gave, its value, its standard deviation."""
        return fitted_columns(self.parameters, self.values, self.stds, self.held)

    def plot(self) -> Figure:
        """A matplotlib figure of the fit beside what was measured."""
        figure: Figure = deferred("nonlinear.plotting.identification:fit_figure")(self)
        return figure

    def _summary(self) -> Summary:
        facts = [
            ("values", str(len(self.residuals))),
            ("rms residual", brief(float(np.sqrt(np.mean(self.residuals**2))))),
        ]
        facts += [("verdict", " ".join(self.verdict))] if self.verdict else []
        title = f"Fit of {name_of(self.given)}: {counted(len(self.fitted), 'number', 'numbers')}"
        return tabulated(title, facts, self.to_dict(), ("number", "unit"))

    def given_at(self, path: str) -> float:
        """The number that the scene gave at one of these places."""
        return next(parameter.value for parameter in self.parameters if parameter.path == path)

    @cached_property
    def fitted(self) -> list[int]:
        """The indices of the numbers that were not held."""
        return [k for k in range(len(self.parameters)) if k not in set(self.held.tolist())]

    @cached_property
    def combinations(self) -> tuple[Combination, ...]:
        """Products of numbers that are determined although the numbers are not."""
        count = len(self.parameters)
        determined = Determined(np.array(self.fitted, dtype=np.int64), self.held, self.undetermined, self.condition)
        return find_combinations(determined, self.parameters, self.unknowns[:count], self.stds)

    def bootstrap(self, draws: int, seed: int = 1) -> Floats:
        """Standard deviations (p,) of the numbers by resampled blocks of residuals, zero for those held.

        Each of the `draws` is one Gauss-Newton step from the fit, to the record with other residuals.
        """
        problem, count, rng = self.problem, len(self.parameters), np.random.default_rng(seed)
        columns = np.flatnonzero(np.diag(self.cov) > 0)
        J = problem.ordered(problem.jacobian(self.unknowns))[:, columns]
        back, residuals = np.linalg.pinv(J, rcond=1e-11), problem.ordered(self.residuals)
        rows = [part for *_, part in problem.series()]
        blocks = max(BLOCKS, int(sum(part.stop - part.start for part in rows) ** (1 / 3)))
        steps = []
        for _ in range(draws):
            drawn = np.zeros(len(residuals))
            series = resampled([residuals[part] for part in rows], blocks, rng)
            for part, values in zip(rows, series, strict=True):
                drawn[part] = values - values.mean()
            steps.append(back @ drawn)
        stds = np.zeros(problem.layout.size)
        stds[columns] = np.std(steps, axis=0) if self.fits else np.nan
        return np.asarray(stds[:count] * np.abs(self.slopes))

    @cached_property
    def readings(self) -> list[Floats]:
        """What the sensors read in the fitted motion: (K, C) for each segment."""
        return self.problem.readings(self.unknowns)

    @cached_property
    def rms(self) -> Floats:
        """Root mean square of the angles' residuals of every segment (rad); of the cart's (m) if it alone is read."""
        return np.array([root_mean_square(self._misses([k])) for k in range(len(self.recording.segments))])

    @property
    def rms_all(self) -> float:
        """Of all segments together."""
        return root_mean_square(self._misses(range(len(self.recording.segments))))

    def _misses(self, segments: Sequence[int]) -> Floats:
        angles = [k for k, sensor in enumerate(self.recording.sensors) if sensor.pendulum]
        chosen = angles or [*range(len(self.recording.sensors))]
        misses = [(self.readings[s] - self.recording.segments[s].values)[:, chosen].ravel() for s in segments]
        return np.concatenate(misses)


def root_mean_square(values: Floats) -> float:
    """Of the values that are there."""
    there = values[np.isfinite(values)]
    return float(np.sqrt(np.mean(there**2))) if len(there) else 0.0
