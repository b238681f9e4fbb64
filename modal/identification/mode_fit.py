"""The result of a fit to measured modes: parameters with their covariance, and every mode with its measurement."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from modal.identification.identifiability import Combination, Determined, Undetermined, find_combinations
from modal.identification.measured import MeasuredMode, MeasuredModes
from modal.identification.parameters import FittedNumbers, Parameter, numbers_of, with_error
from modal.report import Displayed, Form, ReportColumn, ReportTable, Summary, brief, records_of, short
from modal.scene import Scene
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
