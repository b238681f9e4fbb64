"""The result of a fit to measured modes: numbers with their covariance, and every mode beside its measurement."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from modal.identification.identifiability import Combination, Determined, Undetermined, find_combinations
from modal.identification.measured import MeasuredMode, MeasuredModes
from modal.identification.parameters import Parameter, fitted_columns
from modal.report import Displayed, Summary, brief, counted, deferred, tabulated
from modal.scene import Scene, name_of
from modal.types import Floats, Ints

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True, repr=False)
class FittedMode(Displayed):
    """A measured mode beside the computed one; residuals in standard deviations of the measurement."""

    measured: MeasuredMode
    frequency: float
    damping_ratio: float
    damping_ratio_std: float | None
    mac: float | None

    @property
    def deviation(self) -> float:
        """Of the frequency."""
        return (self.frequency - self.measured.frequency) / self.measured.std


@dataclass(frozen=True, eq=False, repr=False)
class Solution(Displayed):
    """Numbers at a minimum, by z (p,) with its covariance `cov` (p, p), and chi-square there.

    `values` and `covariance`, zero for numbers that were held, are in the scene's units.
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
        """Of the numbers, (p, p)."""
        slopes = np.array([parameter.slope(float(z)) for parameter, z in zip(self.parameters, self.z, strict=True)])
        return np.asarray(slopes[:, None] * self.cov * slopes)

    @cached_property
    def stds(self) -> Floats:
        """Standard deviations (p,)."""
        return np.sqrt(np.maximum(np.diag(self.covariance), 0.0))

    def _summary(self) -> Summary:
        return Summary(f"Solution of a fit: chi-square {self.chi_square:.4g}", [("numbers", brief(self.values))])


@dataclass(frozen=True, eq=False, repr=False)
class ModeFit(Solution):
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

    def to_dict(self) -> dict[str, Any]:
        """A row for each number, (p,): its place, unit, what the scene gave, its value, its standard deviation."""
        return fitted_columns(self.parameters, self.values, self.stds, self.held)

    def plot(self) -> Figure:
        """A matplotlib figure of the fit beside what was measured."""
        figure: Figure = deferred("modal.plotting.identification:mode_fit_figure")(self)
        return figure

    def _summary(self) -> Summary:
        facts = [("measured modes", str(len(self.modes))), ("chi-square", f"{self.chi_square:.4g} of {self.freedom}")]
        facts += [("verdict", " ".join(self.verdict))] if self.verdict else []
        title = f"Fit of {name_of(self.given)}: {counted(len(self.fitted), 'number', 'numbers')}"
        return tabulated(title, facts, self.to_dict(), ("number", "unit"))

    @property
    def fitted(self) -> list[int]:
        """The indices of the numbers that were not held."""
        return [int(k) for k in self.determined.kept]

    @property
    def undetermined(self) -> tuple[Undetermined, ...]:
        """What the modes do not determine."""
        return self.determined.directions

    @cached_property
    def combinations(self) -> tuple[Combination, ...]:
        """Products of numbers that are determined although the numbers are not."""
        return find_combinations(self.determined, self.parameters, self.z, self.stds)
