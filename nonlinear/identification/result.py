"""The result of a fit: parameters with their covariance, undetermined combinations, residuals."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any

import numpy as np

from modal.identification import (
    Combination,
    Determined,
    FittedNumbers,
    Parameter,
    Undetermined,
    find_combinations,
    resampled,
)
from modal.report import NOTHING, Form, ReportColumn, ReportTable, finite, records_of
from modal.scene import Scene
from modal.scene.signal_names import signal_words
from modal.types import Floats, Ints
from nonlinear.identification.problem import FitProblem
from nonlinear.identification.records import Recording

BOOTSTRAP_BLOCKS = 10
"""Tolerance: blocks of residuals in a series, at least: of fewer the spread is not seen."""
MISFIT_MAX = 0.05
"""Tolerance: of a reading's standard deviation: larger correlated residuals do not fit."""
NOISE_MISFIT_MAX = 0.9
"""Tolerance: of it: larger residuals of any kind leave nothing explained."""
SIGNIFICANCE = 5.0
"""Tolerance: standard deviations for a remark on a record; twice as many of a gap, as windows have many."""


@dataclass(frozen=True, eq=False, repr=False)
class Fit(FittedNumbers):
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
        """The numbers that were free, fixed ones included."""
        return self.problem.parameters

    @property
    def recording(self) -> Recording:
        """The fitted recording."""
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
        """The unexplained part of every sensor's readings (C,), relative to their standard deviation.

        Only the correlated part counts, √(Σ e_k e_(k+1) / Σ e_k²) times the residuals' rms: noise and
        outliers do not.  Where residuals are nearly as large as the readings, all of them count.
        """
        misfits = []
        about_means = [segment.values - np.nanmean(segment.values, axis=0) for segment in self.recording.segments]
        for rho, readings_about_mean, miss in zip(
            self.rho, np.vstack(about_means).T, np.vstack(self.misses).T, strict=True
        ):
            share = root_mean_square(miss) / (root_mean_square(readings_about_mean) or 1.0)
            count = int(np.count_nonzero(np.isfinite(miss)))
            correlation = float(np.abs(rho[1:3]).max()) if len(rho) > 1 else 0.0
            lasting = share * np.sqrt(correlation) if correlation > SIGNIFICANCE / np.sqrt(count) else 0.0
            misfits.append(share if share > NOISE_MISFIT_MAX else lasting)
        return np.array(misfits)

    @cached_property
    def gap(self) -> float:
        """The largest gap between a window and its continuation, in standard deviations of a gap; 0 without windows."""
        first = self.recording.n_values
        gaps = self.residuals[first : len(self.residuals) - sum(1 for parameter in self.parameters if parameter.prior)]
        return float(np.abs(gaps).max()) if len(gaps) else 0.0

    @property
    def fits(self) -> bool:
        """Whether the motion fits the record well enough for standard deviations to be meaningful."""
        return bool(np.all(self.misfit < MISFIT_MAX)) and self.gap < 2 * SIGNIFICANCE

    @cached_property
    def covariance(self) -> Floats:
        """The covariance of the numbers (p, p), zero for fixed ones, NaN if the motion does not fit the record."""
        count = len(self.parameters)
        cov = np.asarray(self.slopes[:, None] * self.cov[:count, :count] * self.slopes)
        if not self.fits:
            cov[np.ix_(self.fitted, self.fitted)] = np.nan
        return cov

    @cached_property
    def stds(self) -> Floats:
        """Standard deviations of the numbers (p,), zero for fixed ones, NaN if the motion does not fit."""
        return np.sqrt(np.maximum(np.diag(self.covariance), 0.0))

    what = "fit to measured motions"
    figure = "nonlinear.plotting.identification:fit_figure"

    def parts(
        self, form: Form = "text", *, candidates: Sequence[Any] = (), draws: int = 0
    ) -> Iterator[ReportTable | str]:
        """The numbers, sensors, segments, laws compared and the verdict; `draws` add deviations of a bootstrap."""
        unit = UNIT_WORDS.get(self.rms_unit, self.rms_unit)
        yield self.table_of_numbers({"bootstrap": self.bootstrap(draws)} if draws else {})
        yield from self.determination()
        yield ReportTable.of(SENSOR, [sensor_record(self, c) for c in range(len(self.recording.sensors))])
        yield ReportTable.of(segment_columns(unit), zip(self.recording.segments, self.rms.tolist(), strict=True))
        yield f"rms residual of all: {self.rms_all:.3g} {unit}"
        yield ReportTable.of(LAW, candidates)
        yield "\n".join(self.footnotes())

    def whole(self, *, candidates: Sequence[Any] = (), draws: int = 0) -> dict[str, Any]:
        """Everything for JSON; `covariance` is that of `parameters` in their order.

        With `draws` every parameter has its `bootstrap_std` of this many resampled records.
        """
        numbers, sensors = self.fitted, self.recording.sensors
        record: dict[str, Any] = {
            **self.facts(),
            "sensors": [sensor_record(self, c) for c in range(len(sensors))],
            "segments": [
                {
                    "file": segment.file,
                    "segment": segment.name,
                    f"rms_residual_{self.rms_unit}": float(self.rms[s]),
                    "initial": initial_record(self, s),
                }
                for s, segment in enumerate(self.recording.segments)
            ],
            f"rms_residual_{self.rms_unit}": self.rms_all,
            "condition": self.condition,
            "fits": self.fits,
            "misfit": dict(zip((sensor.name for sensor in sensors), self.misfit.tolist(), strict=True)),
            "covariance": self.covariance[np.ix_(numbers, numbers)].tolist() if self.fits else None,
            "verdict": list(self.verdict),
        }
        if draws:
            stds = self.bootstrap(draws)
            for number, k in zip(record["parameters"], numbers, strict=True):
                number["bootstrap_std"] = finite(float(stds[k]))
        return record | ({"comparison": records_of(LAW, candidates)} if candidates else {})

    def given_at(self, path: str) -> float:
        """The number that the scene gave at one of these places."""
        return next(parameter.value for parameter in self.parameters if parameter.path == path)

    @cached_property
    def fitted(self) -> list[int]:
        """The indices of the numbers that were not fixed."""
        return [k for k in range(len(self.parameters)) if k not in set(self.held.tolist())]

    @cached_property
    def combinations(self) -> tuple[Combination, ...]:
        """Products of numbers that are determined although the numbers are not."""
        count = len(self.parameters)
        determination = Determined(np.array(self.fitted, dtype=np.int64), self.held, self.undetermined, self.condition)
        return find_combinations(determination, self.parameters, self.unknowns[:count], self.stds)

    def bootstrap(self, draws: int, seed: int = 1) -> Floats:
        """Standard deviations (p,) of the numbers by resampled blocks of residuals, zero for fixed ones.

        Each of the `draws` is one Gauss-Newton step from the fit, to the record with other residuals.
        """
        problem, count, rng = self.problem, len(self.parameters), np.random.default_rng(seed)
        columns = np.flatnonzero(np.diag(self.cov) > 0)
        J = problem.sort_by_sensor(problem.jacobian(self.unknowns))[:, columns]
        back, residuals = np.linalg.pinv(J, rcond=1e-11), problem.sort_by_sensor(self.residuals)
        rows = [part for *_, part in problem.series()]
        blocks = max(BOOTSTRAP_BLOCKS, int(sum(part.stop - part.start for part in rows) ** (1 / 3)))
        steps = []
        for _ in range(draws):
            sample = np.zeros(len(residuals))
            series = resampled([residuals[part] for part in rows], blocks, rng)
            for part, values in zip(rows, series, strict=True):
                sample[part] = values - values.mean()
            steps.append(back @ sample)
        stds = np.zeros(problem.layout.size)
        stds[columns] = np.std(steps, axis=0) if self.fits else np.nan
        return np.asarray(stds[:count] * np.abs(self.slopes))

    @cached_property
    def readings(self) -> list[Floats]:
        """The sensor readings of the fitted motion: (K, C) for each segment."""
        return self.problem.readings(self.unknowns)

    @cached_property
    def misses(self) -> list[Floats]:
        """These less their readings."""
        return self.problem.misses(self.unknowns)

    @cached_property
    def rms(self) -> Floats:
        """Root mean square of residuals of every segment in `rms_unit`: of angles, or of sensors like the first."""
        return np.array([root_mean_square(self._misses([k])) for k in range(len(self.recording.segments))])

    @property
    def rms_all(self) -> float:
        """The RMS of all segments together."""
        return root_mean_square(self._misses(range(len(self.recording.segments))))

    @property
    def rms_unit(self) -> str:
        """The unit of `rms`: rad where an angle is read, else that of the first sensor."""
        sensors = self.recording.sensors
        units = [sensor.unit for sensor in sensors if sensor.is_angle or not sensor.pendulum]
        return "rad" if "rad" in units else sensors[0].unit

    def _misses(self, segments: Sequence[int]) -> Floats:
        chosen = [k for k, sensor in enumerate(self.recording.sensors) if sensor.unit == self.rms_unit]
        return np.concatenate([self.misses[s][:, chosen].ravel() for s in segments])


def root_mean_square(values: Floats) -> float:
    """The root mean square of the available values."""
    numbers = values[np.isfinite(values)]
    return float(np.sqrt(np.mean(numbers**2))) if len(numbers) else 0.0


def sensor_record(result: Fit, c: int) -> dict[str, Any]:
    """The noise, offset, delay and scale of a sensor."""
    layout, sensor = result.problem.layout, result.recording.sensors[c]
    offset, delay, scale = (block.start + c for block in (layout.offsets, layout.delays, layout.scales))
    std = np.sqrt(np.maximum(np.diag(result.cov), 0.0))
    if not result.fits:
        std = np.where(std > 0, np.nan, 0.0)
    return {
        "sensor": sensor.name,
        f"noise_{sensor.unit}": float(result.problem.noise[c]),
        f"offset_{sensor.unit}": float(result.unknowns[offset]),
        f"offset_std_{sensor.unit}": finite(float(std[offset])),
        "delay_s": float(result.unknowns[delay]),
        "delay_std_s": finite(float(std[delay])),
        "scale": 1 + float(result.unknowns[scale]),
        "scale_std": finite(float(std[scale])),
    }


def initial_record(result: Fit, s: int) -> dict[str, float]:
    """The state at the segment's first time less the longest delay."""
    problem = result.problem
    state = result.unknowns[problem.layout.state(s)]
    structure, first = problem.system.structure, problem.system.first
    half = problem.coordinates
    names, counts = [], dict[int, int]()
    for pendulum in problem.system.pendulum.tolist():
        counts[pendulum] = counts.get(pendulum, 0) + 1
        names.append(f"theta_{pendulum + 1}_{counts[pendulum]}")
    initial = {"time_s": float(result.recording.segments[s].times[0] - problem.late)}
    for k, name in enumerate(structure.names if structure and structure.names != ("x",) else ()):
        initial |= {name: float(state[k]), f"{name}_per_s": float(state[half + k])}
    if first and not (structure and structure.names != ("x",)):
        initial |= {"cart_m": float(state[0]), "cart_velocity_m_per_s": float(state[half])}
    initial |= {f"{name}_rad": float(state[first + k]) for k, name in enumerate(names)}
    initial |= {
        f"{name.replace('theta', 'theta_dot')}_rad_per_s": float(state[half + first + k])
        for k, name in enumerate(names)
    }
    return initial


def _figure(name: str, sensor: dict[str, Any]) -> str:
    key = next(key for key in sensor if key == name or (key.startswith(f"{name}_") and "std" not in key))
    spread = next((sensor[key] for key in sensor if key.startswith(f"{name}_std")), 0.0)
    return f"{sensor[key]:.3g}" + (f" ± {spread:.2g}" if spread else "")


SENSOR = (
    ReportColumn(lambda sensor: signal_words(sensor["sensor"]), None, "sensor"),
    *(
        ReportColumn(partial(_figure, name), None, f"{name} (s)" if name == "delay" else name)
        for name in ("noise", "offset", "delay", "scale")
    ),
)
LAW = (
    ReportColumn("name", "model", "law"),
    ReportColumn("fit.rms_all", "rms_residual_rad", "rms (rad)", "{:.3g}".format),
    ReportColumn("held_out_rms", "held_out_rms_residual_rad", "rms held out (rad)", "{:.3g}".format),
    ReportColumn("aic", "aic", "AIC", "{:.1f}".format),
    ReportColumn("bic", "bic", "BIC", "{:.1f}".format),
)
"""The quantities of a sensor and of a law."""
UNIT_WORDS = {"rad_per_s": "rad/s", "m_per_s2": "m/s²"}


def segment_columns(unit: str) -> tuple[ReportColumn, ...]:
    """The quantities of a segment with its residual in a unit."""
    return (
        ReportColumn(lambda row: row[0].file, None, "file"),
        ReportColumn(lambda row: row[0].name or NOTHING, None, "segment"),
        ReportColumn(lambda row: len(row[0].times), None, "rows"),
        ReportColumn(lambda row: row[1], None, f"rms residual ({unit})", ".3g"),
    )


def fit_record(result: Fit, candidates: Sequence[Any] = (), draws: int = 0) -> dict[str, Any]:
    """The report of a fit for JSON (`Fit.whole`)."""
    return result.whole(candidates=candidates, draws=draws)


def fit_json(result: Fit, candidates: Sequence[Any] = (), draws: int = 0) -> str:
    """The report as JSON."""
    return result.report("json", candidates=candidates, draws=draws)


def fit_text(result: Fit, candidates: Sequence[Any] = (), draws: int = 0) -> str:
    """The report as text; with `draws` a column has the standard deviations of a bootstrap."""
    return result.report("text", candidates=candidates, draws=draws)
