"""Branches of periodic orbits."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import isclose
from typing import TYPE_CHECKING, Any

import numpy as np

from modal.errors import ComputationError
from modal.modes import natural_modes
from modal.report import TextResult, by_column, deferred
from modal.scene.parameters import Variation
from modal.types import Floats
from nonlinear.orbits.between import refined_points
from nonlinear.orbits.continuation import OrbitPoint, OrbitProblem, with_values
from nonlinear.orbits.orbit import Orbit
from nonlinear.orbits.special import Special

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Report = Callable[[float], object]


@dataclass(frozen=True, eq=False, repr=False)
class Branch(TextResult):
    """Orbits in the order of their continuation and the special points between them.

    `origin` says where it begins, `variation` along which number of the scene it goes, if any; it is `complete` where
    it reaches the requested end. `linear` is the frequency (rad/s) of the mode in which it begins, if it does.
    """

    origin: str
    points: tuple[OrbitPoint, ...]
    special: tuple[Special, ...]
    problem: OrbitProblem
    variation: Variation | None = None
    complete: bool = True
    linear: float | None = None

    @cached_property
    def orbits(self) -> tuple[Orbit, ...]:
        """The orbits."""
        return tuple(point.orbit for point in self.points)

    @cached_property
    def amplitude(self) -> Floats:
        """The largest angle (rad) of any link over every orbit, (K,)."""
        return np.array([orbit.amplitude for orbit in self.orbits])

    @cached_property
    def omega(self) -> Floats:
        """Frequency (rad/s) of every orbit, (K,)."""
        return np.array([orbit.omega for orbit in self.orbits])

    @cached_property
    def energy(self) -> Floats:
        """Energy (J) of every orbit at its start, (K,)."""
        return np.array([orbit.energy for orbit in self.orbits])

    @property
    def is_forced(self) -> bool:
        """Whether drives set the period of its orbits."""
        return bool(self.orbits[0].cycles)

    @property
    def returns(self) -> bool:
        """Whether it leaves the range of its parameter where it began, after a fold."""
        first, last = float(self.value[0]), float(self.value[-1])
        return self.complete and self.variation is not None and isclose(first, last, rel_tol=1e-9)

    @cached_property
    def value(self) -> Floats:
        """The number along which it goes at every orbit, (K,); NaN without one."""
        return np.array([np.nan if orbit.value is None else orbit.value for orbit in self.orbits])

    def to_dict(self) -> dict[str, Any]:
        """The columns of CSV, (K,): the continuation parameter, frequency, stability, amplitude, energy and more."""
        return by_column(list(deferred("nonlinear.orbits.report:orbit_rows")(self)))

    def plot(self, theme: str = "") -> Figure:
        """A matplotlib figure of the branch in a theme, light or dark, next to the linear mode in which it begins.

        Raise ComputationError for a branch that goes along nothing and begins in no mode.
        """
        scene = self.orbits[0].scene
        mode = None
        if self.variation is None:
            if self.linear is None:
                raise ComputationError("this branch follows no number and begins in no mode: nothing to draw")
            modes = natural_modes(scene)
            mode = modes[int(np.argmin(np.abs(modes.omega - self.linear)))]
        figure: Figure = deferred("modal.plotting.style:figure_at")(
            "nonlinear.plotting.orbits:orbits_figure", scene, [self], mode, theme=theme
        )
        return figure

    def text(self) -> str:
        """The branch as `orbits` prints it, with its orbits, special points and omissions."""
        words: str = deferred("nonlinear.orbits.report:orbits_text")(self.orbits[0].scene, [self], self.linear)
        return words

    @cached_property
    def is_stable(self) -> tuple[bool, ...]:
        """Whether every orbit is stable."""
        return tuple(orbit.is_stable for orbit in self.orbits)


def finished_branch(
    origin: str,
    problem: OrbitProblem,
    points: Sequence[OrbitPoint],
    specials: Callable[[Any, Sequence[OrbitPoint]], Iterator[Special]],
    variation: Variation | None = None,
    *,
    complete: bool = True,
    linear: float | None = None,
) -> Branch:
    """The branch of these points, of those between whose stability differs, and of those at values of the number."""
    points = refined_points(problem, points)
    points = with_values(problem, points, variation) if variation else points
    special = tuple(specials(problem, points))
    return Branch(origin, tuple(points), special, problem, variation, complete, linear)
