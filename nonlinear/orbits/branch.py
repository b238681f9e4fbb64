"""Branches of periodic orbits."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from modal.scene.parameters import Variation
from modal.types import Floats
from nonlinear.orbits.continuation import Point, Problem
from nonlinear.orbits.orbit import Orbit
from nonlinear.orbits.special import Special

Report = Callable[[float], object]


@dataclass(frozen=True, eq=False)
class Branch:
    """Orbits in the order of their continuation and the special points between them.

    `origin` says where it begins, `variation` along which number of the scene it goes, if any; it is `complete` where
    it reaches what was asked for.  `linear` is the frequency (rad/s) of the mode in which it begins, if it does.
    """

    origin: str
    points: tuple[Point, ...]
    special: tuple[Special, ...]
    problem: Problem
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

    @cached_property
    def value(self) -> Floats:
        """The number along which it goes at every orbit, (K,); NaN without one."""
        return np.array([np.nan if orbit.value is None else orbit.value for orbit in self.orbits])

    @cached_property
    def is_stable(self) -> tuple[bool, ...]:
        """Whether every orbit is stable."""
        return tuple(orbit.is_stable for orbit in self.orbits)
