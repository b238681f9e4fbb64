"""Populations of equal pendula on a structure: which of them are locked, each by itself and to each other.

With the phases ψ_p of the pendula (`nonlinear.synchronization.phases`) population s of N pendula has

    R_s e^{iΨ_s} = (1/N) Σ_p e^{iψ_p}

the order parameter R_s, and the mean and the spread of its pendula's mean rates; all are means over the last quarter of
a run.  A population is locked where R_s > 0.99.  Populations that are all locked, at rates equal within 1e-3, are in
phase, in antiphase or locked at another phase Ψ_s − Ψ_1.  One locked and another one not, though all pendula are equal,
is a chimera (Martens, Thutupalli, Fourrière & Hallatschek, PNAS 110, 10563 (2013)).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from modal.errors import ComputationError
from modal.report import Displayed, Summary, counted, first_line
from modal.types import Booleans, Complexes, Floats, Ints
from nonlinear.averaging import ANTIPHASE, IN_PHASE
from nonlinear.postprocessing import last
from nonlinear.synchronization.phases import Phases
from nonlinear.system import Population, populations_of

QUARTER = 0.25  # the last part of a run, over which means are taken
LOCKED, EQUAL = 0.99, 1e-3  # least R of a locked population, and largest relative difference of equal rates
NEAR = np.pi / 36  # rad, tolerance of in phase and antiphase
CHIMERA, NEITHER, AT = "a chimera", "neither", "locked"


@dataclass(frozen=True, eq=False, repr=False)
class PopulationPhases(Displayed):
    """The phases of a run by populations, P of them."""

    phases: Phases
    populations: tuple[Population, ...]

    def _summary(self) -> Summary:
        several = counted(len(self.populations), "population", "populations")
        return Summary(f"{several}: {self.verdict}", [("of", first_line(self.phases))])

    @cached_property
    def _means(self) -> Complexes:
        """The mean e^{iψ} of every population, (T, P)."""
        z = self.phases.z[:, :, self.phases.leading]
        size = np.abs(z)
        turned = np.divide(z, size, out=np.zeros_like(z), where=size > 0)
        return np.stack([turned[:, population.pendula].mean(axis=1) for population in self.populations], axis=1)

    @cached_property
    def order(self) -> Floats:
        """The order parameter of every population, (T, P)."""
        return np.abs(self._means)

    @cached_property
    def late_order(self) -> Floats:
        """Its means over the last quarter, (P,)."""
        return np.asarray(self.order[last(self.phases.times, QUARTER)].mean(axis=0))

    @cached_property
    def pendulum_rates(self) -> Floats:
        """The mean rate (rad/s) of every pendulum over the last quarter, (N,); NaN where samples are too few."""
        try:
            return self.phases.mean_rates(QUARTER)
        except ComputationError:
            return np.full(self.phases.z.shape[1], np.nan)

    @cached_property
    def rate(self) -> Floats:
        """The mean rate (rad/s) of every population, (P,)."""
        return np.array([self.pendulum_rates[population.pendula].mean() for population in self.populations])

    @cached_property
    def spread(self) -> Floats:
        """The standard deviation (rad/s) of its pendula's mean rates, (P,)."""
        return np.array([self.pendulum_rates[population.pendula].std() for population in self.populations])

    @cached_property
    def phase(self) -> Floats:
        """By how much the phase of every population is ahead of the first's (rad), in (−π, π], (P,)."""
        late = self._means[last(self.phases.times, QUARTER)]
        return np.asarray(np.angle((late * late[:, :1].conj()).mean(axis=0)))

    @cached_property
    def pair(self) -> float | None:
        """Of one population of two pendula by how much the second is ahead of the first (rad); else None."""
        if len(self.populations) > 1 or self.populations[0].size != 2:
            return None
        z = self.phases.z[last(self.phases.times, QUARTER), :, self.phases.leading]
        turned = z[:, 1] * z[:, 0].conj()
        return float(np.angle(turned.mean())) if np.abs(turned).any() else None

    @cached_property
    def locked(self) -> Booleans:
        """Whether each population is locked, (P,)."""
        return np.asarray(self.late_order > LOCKED)

    @cached_property
    def is_even(self) -> bool:
        """Whether the rates of all populations are equal; of one pair, those of its pendula."""
        rates = self.rate if self.pair is None else self.pendulum_rates
        return bool(np.ptp(rates) <= EQUAL * np.abs(rates).max())

    @property
    def _off(self) -> Floats:
        """The phases (rad) that are compared: those of populations, or of the second of a pair."""
        return self.phase if self.pair is None else np.array([0.0, self.pair])

    @cached_property
    def kind(self) -> str:
        """What they do: "in phase", "antiphase", "locked" at another phase, "a chimera" or "neither"."""
        if self.locked.any() and not self.locked.all():
            return CHIMERA
        if not (self.locked.all() or self.pair is not None) or not self.is_even:
            return NEITHER
        off = np.abs(self._off)
        if np.all(off <= NEAR):
            return IN_PHASE
        return ANTIPHASE if len(off) == 2 and off[1] >= np.pi - NEAR else AT

    @property
    def verdict(self) -> str:
        """The same in words, with the populations and their phases."""
        numbers = np.arange(1, len(self.populations) + 1)
        if self.kind == CHIMERA:
            held, loose = (_listed(numbers[rates]) for rates in (self.locked, ~self.locked))
            several = "populations" if self.locked.sum() > 1 else "population"
            return f"{several} {held} locked, {loose} not: a chimera"
        if self.kind == AT:
            return "locked at " + ", ".join(f"{angle:.4g}°" for angle in np.rad2deg(self._off[1:]))
        if self.kind != NEITHER:
            return self.kind
        if len(numbers) == 1:
            return "not in phase: the population is not locked"
        if self.locked.all():
            return "neither in phase nor antiphase: every population is locked, at a rate of its own"
        return "neither in phase nor antiphase: no population is locked"


def _listed(numbers: Ints) -> str:
    return " and ".join(str(int(number)) for number in numbers)


def population_phases(phases: Phases) -> PopulationPhases | None:
    """The phases of a run by populations; None where the scene is not structured."""
    scene = phases.trajectory.scene
    return PopulationPhases(phases, populations_of(scene)) if scene.is_structured else None
