"""Populations of equal pendula on a structure: locking within and between them.

With the phases ψ_p of the pendula (`nonlinear.synchronization.phases`) population s of N pendula has

    R_s e^{iΨ_s} = (1/N) Σ_p e^{iψ_p}

the order parameter R_s, and the mean and the spread of its pendula's mean rates; all are means over the last quarter of
a run.  A population is locked where R_s > 0.99.  Populations that are all locked, each to the first one,

    |⟨e^{i(Ψ_s − Ψ_1)}⟩| > 0.99     at rates equal within 1e-3, on supports that something joins,

are in phase, in antiphase or locked at another phase Ψ_s − Ψ_1.  One locked and another one not, though all pendula are
equal, is a chimera [Martens2013].
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy

from modal.assembly import matrices
from modal.errors import ComputationError
from modal.report import Displayed, Summary, counted, first_line
from modal.structure import phi, structure_of
from modal.types import Booleans, Complexes, Floats, Ints
from nonlinear.averaging import ANTIPHASE, IN_PHASE
from nonlinear.postprocessing import last
from nonlinear.synchronization.phases import ENDING, Phases
from nonlinear.system import Population, burdens, populations_of

LOCKED_ORDER_MIN = 0.99
"""Physics: least R of a locked population, as above."""
RATE_DIFFERENCE_MAX = 1e-3
"""Physics: largest relative difference of equal rates, as above."""
POPULATION_PHASE_MAX = np.pi / 36
"""Limit: phase (rad) up to which populations are "in phase" or in "antiphase", and not "locked" at another one."""
CHIMERA, NEITHER, AT, STILL = "a chimera", "neither", "locked", "dies out"
DEATH_SWING_RATIO = 0.01
"""Limit: of the widest swing of a run, below which "the swing dies out"."""


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
        unit = np.divide(z, size, out=np.zeros_like(z), where=size > 0)
        return np.stack([unit[:, population.pendula].mean(axis=1) for population in self.populations], axis=1)

    @cached_property
    def order(self) -> Floats:
        """The order parameter of every population, (T, P)."""
        return np.abs(self._means)

    @cached_property
    def late_order(self) -> Floats:
        """Its means over the last quarter, (P,)."""
        return np.asarray(self.order[last(self.phases.times, 1 / 4)].mean(axis=0))

    @cached_property
    def pendulum_rates(self) -> Floats:
        """The mean rate (rad/s) of every pendulum over the last quarter, (N,); NaN where samples are too few."""
        try:
            return self.phases.mean_rates(1 / 4)
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
    def _relative(self) -> Complexes:
        """The mean e^{i(Ψ_s − Ψ_1)} over the last quarter, (P,); of a pair that of its second pendulum, (2,)."""
        if self.pair is None:
            late = self._means[last(self.phases.times, 1 / 4)]
        else:
            late = self.phases.z[last(self.phases.times, 1 / 4), :, self.phases.leading]
        product = late * late[:, :1].conj()
        size = np.abs(product)
        return np.asarray(np.divide(product, size, out=np.zeros_like(product), where=size > 0).mean(axis=0))

    @property
    def phase(self) -> Floats:
        """By how much the phase of every population is ahead of the first's (rad), in (−π, π], (P,)."""
        return np.angle(self._relative) if self.pair is None else np.zeros(1)

    @cached_property
    def is_coupled(self) -> bool:
        """Whether something joins all pendula: inertia, a spring or a damper, or motion of the pivots of both."""
        scene = self.phases.trajectory.scene
        small, pivots = matrices(scene), phi(structure_of(scene))
        links = np.abs(small.M) + np.abs(small.K) + np.abs(small.D)
        first = np.cumsum([0, *(each.n_links for each in scene.pendulum for _ in range(each.count))])[:-1]
        d = pivots.rail.shape[1]
        links[:d, d + first] += (np.abs(pivots.rail) + np.abs(pivots.down)).T
        _, labels = scipy.sparse.csgraph.connected_components(links, directed=False)
        return len(np.unique(labels[-scene.n_links :])) == 1

    @cached_property
    def pair(self) -> float | None:
        """Of one population of two pendula by how much the second is ahead of the first (rad); else None."""
        if len(self.populations) > 1 or self.populations[0].size != 2:
            return None
        z = self.phases.z[last(self.phases.times, 1 / 4), :, self.phases.leading]
        product = z[:, 1] * z[:, 0].conj()
        return float(np.angle(product.mean())) if np.abs(product).any() else None

    @cached_property
    def locked(self) -> Booleans:
        """Whether each population is locked, (P,)."""
        return np.asarray(self.late_order > LOCKED_ORDER_MIN)

    @property
    def is_identical(self) -> bool:
        """Whether all populations are of equal pendula, as many, on equal supports."""
        scene = self.phases.trajectory.scene
        alike = {"name": "a", "position": (0.0, 0.0), "start": None}
        supports = [
            support.replace(**{key: value for key, value in alike.items() if key in support.fields})
            for support in scene.supports
        ]
        kinds = {(group.pendulum, group.size, supports[group.support]) for group in self.populations}
        return len(kinds) == 1 and len(set(burdens(scene))) == 1

    @cached_property
    def is_even(self) -> bool:
        """Whether all populations keep their phases from the first, at equal rates; of one pair its pendula."""
        rates = self.rate if self.pair is None else self.pendulum_rates
        is_steady = np.abs(self._relative).min() > LOCKED_ORDER_MIN
        return bool(is_steady and np.ptp(rates) <= RATE_DIFFERENCE_MAX * np.abs(rates).max())

    @cached_property
    def kind(self) -> str:
        """Their motion: "in phase", "antiphase", "locked" at another phase, "a chimera", "neither" or "dies out"."""
        swing = self.phases.amplitude.max(axis=(1, 2))
        if swing[last(self.phases.times, ENDING)].max() <= DEATH_SWING_RATIO * swing.max():
            return STILL
        if self.locked.any() and not self.locked.all():
            return CHIMERA if self.is_coupled and self.is_identical else NEITHER
        if not (self.locked.all() or self.pair is not None) or not self.is_even or not self.is_coupled:
            return NEITHER
        off = np.abs(np.angle(self._relative))
        if np.all(off <= POPULATION_PHASE_MAX):
            return IN_PHASE
        return ANTIPHASE if len(off) == 2 and off[1] >= np.pi - POPULATION_PHASE_MAX else AT

    @property
    def is_held(self) -> bool:
        """Whether the populations keep their phases."""
        return self.kind in {IN_PHASE, ANTIPHASE, AT}

    @property
    def verdict(self) -> str:
        """The same in words, with the populations and their phases."""
        numbers = np.arange(1, len(self.populations) + 1)
        if self.kind == CHIMERA:
            locked, loose = (_list(numbers[rates]) for rates in (self.locked, ~self.locked))
            several = "populations" if self.locked.sum() > 1 else "population"
            return f"{several} {locked} locked, {loose} not: a chimera"
        if self.kind == AT:
            return "locked at " + ", ".join(f"{angle:.4g}°" for angle in np.rad2deg(np.angle(self._relative[1:])))
        if self.kind == STILL:
            return "the swing dies out"
        if self.kind != NEITHER:
            return self.kind
        if self.locked.all() and not self.is_coupled:
            locked = "the population is" if len(numbers) == 1 else "every population is"
            return f"neither in phase nor antiphase: {locked} locked, and nothing joins the pendula"
        if len(numbers) == 1:
            return "not in phase: the population is not locked"
        if self.locked.all():
            return "neither in phase nor antiphase: every population is locked, at a phase that drifts"
        if self.locked.any():
            locked, loose = (_list(numbers[which]) for which in (self.locked, ~self.locked))
            why = "the populations are not alike" if self.is_coupled else "nothing joins them"
            return f"neither in phase nor antiphase: population {locked} locked, {loose} not; {why}"
        return "neither in phase nor antiphase: no population is locked"


def _list(numbers: Ints) -> str:
    return " and ".join(str(int(number)) for number in numbers)


def population_phases(phases: Phases) -> PopulationPhases | None:
    """The phases of a run by populations; None if the scene is not structured."""
    scene = phases.trajectory.scene
    return PopulationPhases(phases, populations_of(scene)) if scene.is_structured else None
