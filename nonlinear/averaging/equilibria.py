"""The steady oscillations of a self-excited scene: relative equilibria of its averaged equations, and their stability.

If every band rotates at its own constant rate Ω_b, shapes and amplitudes are constant:

    F(z, Ω) = 0.

In-phase, antiphase and intermediate oscillations are such states: harmonic balance with the unknowns z and Ω.
Perturbations grow like exp(μt), μ the eigenvalues of ∂F/∂z; one of them is 0 for every oscillating band, whose phase is
arbitrary.  A state is stable if all others have negative real parts.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import chain, combinations, islice

import numpy as np

from modal.modes import table_numbers
from modal.report import Displayed, silent
from modal.types import Booleans, Complexes, Floats, Ints
from nonlinear.averaging.equations import STEP, AveragedEquations
from nonlinear.averaging.slow_flow import settle_apart
from nonlinear.averaging.symmetry import count_copies, exchanged, kinds, order_of, overlap, spread_evenly

FAINT = 1e-3  # fraction of the largest amplitude below which a band counts as at rest
LEAP = 0.1  # largest Newton step over the largest amplitude: nearly neutral families would cause long ones
NEWTON, DONE, FREE = 40, 1e-10, 1e-8  # FREE: of ω; slower rates belong to a continuous family of states
GONE = 1e-9  # fraction of the initial amplitudes below which a motion has died out
FLAT = 1e-4  # fraction of the recovery rate below which an eigenvalue is taken as 0
WITHIN = 1e-2  # energy outside its row, as a fraction, up to which a motion stays in that row
SAME = 1e-3
COPIES = 48  # most starts that are copies of states found already
FIRST = 0.1  # largest angle (rad) of a start
HANGING = np.pi / 2  # rad, the largest angle for which averaged equations are used
SEED = 5
ASIDE = 1e-9
"""Relative deviation of a start from a pattern, so that it leaves an unstable one."""
EFFORT = 1_500  # steps after which Newton's method takes over from a start that has not settled


@dataclass(frozen=True, eq=False, repr=False)
class RelativeEquilibrium(Displayed):
    """A motion of constant shape: amplitudes z (C,), rotation rates Ω (B,) in rad/s, growth rates (1/s).

    `rates` are the eigenvalues μ except the neutral ones, the slowest first, and `leaving` the fraction of the energy
    of each eigenvector outside the row that holds most: many pendula in antiphase may share it in many ways. `recovery`
    is the size of Re z*ᵀJz/|z|² (1/s), the rate at which the overall amplitude changes by itself.
    """

    what = "Motion of constant shape, by averaged equations"
    shows = "turning: rotation rates, rad/s; rates: growth rates, 1/s; z: amplitudes"

    averaged: AveragedEquations
    z: Complexes
    turning: Floats
    rates: Complexes
    leaving: Floats
    recovery: float

    @cached_property
    def share(self) -> Floats:
        """Share of the energy in every row of the table, (R,)."""
        energy = self.averaged.energies(self.z)
        return np.asarray(energy / energy.sum())

    @property
    def row(self) -> int:
        """The row of the mode table without dampers that holds most energy, from 0."""
        return int(self.share.argmax())

    @property
    def number(self) -> int:
        """The number of that mode in the table of the scene."""
        return int(table_numbers(self.averaged.scene, self.averaged.modes)[self.row])

    @property
    def growth(self) -> float:
        """The growth rate (1/s) of perturbations; negative if neighbouring motions converge."""
        return float(self.rates.real.max(initial=-np.inf))

    @property
    def is_stable(self) -> bool | None:
        """Whether all neighbouring motions converge; None if some neither converge nor diverge."""
        return None if abs(self.growth) <= FLAT * self.recovery else self.growth < 0

    @cached_property
    def is_family(self) -> bool:
        """Whether it is one of a continuous family of states: an eigenvalue beside those of the phases is 0."""
        return bool(np.any(np.abs(self.rates) <= FLAT * self.recovery))

    @cached_property
    def copies(self) -> int:
        """How many states equal pendula have by exchanging their parts, this one among them; 1 of a family."""
        return 1 if self.is_family else count_copies(self.averaged, self.z)

    @property
    def hold(self) -> float:
        """The rate (1/s) at which energy in other rows decays, negative where it grows; infinite without any."""
        others = self.rates.real[self.leaving > WITHIN]
        return -float(others.max(initial=-np.inf))

    @property
    def relaxation(self) -> float:
        """The e-folding time 1/|growth| (s) of perturbations."""
        return 1 / abs(self.growth) if self.growth else np.inf

    @property
    def band(self) -> int:
        """The band that holds most energy."""
        return int(self.averaged.band[int((self.averaged.omega * np.abs(self.z)).argmax())])

    @property
    def omega(self) -> float:
        """Frequency (rad/s) of the band that holds most energy, at this amplitude."""
        return float(self.turning[self.band])


def relative_equilibria(
    averaged: AveragedEquations, report: Callable[[float], object] = silent
) -> tuple[RelativeEquilibrium, ...]:
    """The relative equilibria reached from each row of the mode table alone and from patterns of pendula.

    The patterns are pendula in phase and in antiphase.  Copies by exchange of equal pendula are one state
    (`RelativeEquilibrium.copies`).  The stable ones with their phases reversed, or spread evenly, or with the parts of
    unequal pendula exchanged, are starts too.  Not necessarily all: any wider than HANGING, or missed by Newton's
    method, are not found.  `report` is called with the part of the search that is done.
    """
    equilibria: list[RelativeEquilibrium] = []

    def add(start: Complexes) -> None:
        equilibrium = relative_equilibrium(averaged, start)
        if (
            equilibrium
            and equilibrium.averaged.largest(equilibrium.z) < HANGING
            and not any(same(equilibrium, other) for other in equilibria)
        ):
            equilibria.append(equilibrium)

    starts = list(_starts(averaged))
    copies = (start for equilibrium in equilibria for start in _nearly_copies(equilibrium))
    for tried, start in enumerate(chain(starts, islice(copies, COPIES)), start=1):
        add(start)
        report(tried / (len(starts) + COPIES))
    report(1.0)
    return tuple(sorted(equilibria, key=lambda equilibrium: (equilibrium.row, equilibrium.omega)))


@np.errstate(all="ignore")
def relative_equilibrium(averaged: AveragedEquations, z: Complexes) -> RelativeEquilibrium | None:
    """The relative equilibrium closest to these amplitudes, None where Newton's method finds none."""
    bands = swinging(averaged, z)
    if not len(bands):
        return None
    active = np.isin(averaged.band, bands)
    z = np.where(active, z, 0.0)
    turning, least = averaged.turning(z), GONE * np.abs(z).max()
    for _ in range(NEWTON):
        flow, slope = _expanded(averaged, z, turning, bands)
        left = np.where(active, flow, 0.0)
        if not np.all(np.isfinite(left)):
            return None
        if np.abs(left).max() <= DONE * np.abs(averaged.omega * z).max():
            return RelativeEquilibrium(averaged, z, turning, *_rates(averaged, z, slope[:, : 2 * len(z)], len(bands)))
        step, change = _step(averaged, z, left, slope, bands)
        part = min(1.0, LEAP * np.abs(z).max() / np.abs(step).max()) if np.any(step) else 1.0
        z, turning = z + part * step, turning + part * change
        if not np.all(np.isfinite(z)) or not np.all(turning > 0):
            return None
        if len(dead := bands[_sizes(averaged, z)[bands] <= least]):
            return relative_equilibrium(averaged, np.where(np.isin(averaged.band, dead), 0.0, z))
    return None


def _starts(averaged: AveragedEquations) -> Iterator[Complexes]:
    """Final amplitudes of the slow flow from each row, restricted to it, and from each pattern of pendula."""
    every = [*_rows(averaged), *_patterns(averaged)]
    starts = np.array([FIRST * z / averaged.largest(z) for z, _ in every]).T
    yield from settle_apart(averaged, starts, np.array([kept for _, kept in every]).T, EFFORT)


def _nearly_copies(equilibrium: RelativeEquilibrium) -> Iterator[Complexes]:
    """Its phases reversed, or spread evenly, or the parts of two unequal pendula of as many links exchanged."""
    if not equilibrium.is_stable or equilibrium.is_family:
        return
    averaged = equilibrium.averaged
    kind, links = kinds(averaged.scene), np.bincount(averaged.system.pendulum)
    yield equilibrium.z.conj()
    if len(links) > 2:
        yield spread_evenly(averaged, equilibrium.z)
    for p, q in combinations(range(len(links)), 2):
        if kind[p] != kind[q] and links[p] == links[q]:
            order = np.arange(len(links))
            order[[p, q]] = q, p
            yield exchanged(averaged, equilibrium.z, order)


def _rows(averaged: AveragedEquations) -> Iterator[tuple[Complexes, Booleans]]:
    """An arbitrary motion in the modes of one row, and these modes."""
    random = np.random.default_rng(SEED)
    for row in sorted(set(averaged.row.tolist())):
        members = averaged.row == row
        yield (
            np.where(members, random.standard_normal(len(members)) + 1j * random.standard_normal(len(members)), 0.0),
            members,
        )


def _patterns(averaged: AveragedEquations) -> Iterator[tuple[Complexes, Booleans]]:
    """All pendula nearly in phase, and alternate ones nearly in antiphase, in every band separately, and all modes."""
    random = np.random.default_rng(SEED)
    pendulum = averaged.system.pendulum
    first = averaged.system.first
    for band in range(len(averaged.centre)):
        members = averaged.band == band
        busiest = np.abs(averaged.link_shapes[:, members]).max(axis=1)
        for sign in (np.ones(len(pendulum)), (-1.0) ** pendulum):
            z = np.where(members, (sign * busiest) @ averaged.dual[first:], 0.0).astype(complex)
            if np.any(z):
                beside = random.standard_normal(len(members)) + 1j * random.standard_normal(len(members))
                yield z + ASIDE * np.abs(z).max() * beside, np.ones_like(members)


def swinging(averaged: AveragedEquations, z: Complexes) -> Ints:
    """The bands that oscillate."""
    return np.flatnonzero(_sizes(averaged, z) > FAINT * np.abs(z).max())


def _sizes(averaged: AveragedEquations, z: Complexes) -> Floats:
    """The largest amplitude in every band, (B,)."""
    sizes = np.zeros(len(averaged.centre))
    np.maximum.at(sizes, averaged.band, np.abs(z))
    return sizes


def _step(
    averaged: AveragedEquations, z: Complexes, left: Complexes, slope: Floats, bands: Ints
) -> tuple[Complexes, Floats]:
    """Newton's step of z and Ω, the shortest one that keeps the phase of every band."""
    count, size, scale = len(z), np.abs(z).max(), averaged.omega.max()
    turns = np.array([np.where(averaged.band == band, 1j * z, 0.0) for band in bands]).T
    turns /= np.linalg.norm(turns, axis=0)
    columns = np.vstack((turns.real, turns.imag))
    scaled = slope / np.repeat((scale, size), (2 * count, len(bands)))
    equations = np.block([[scaled], [columns.T, np.zeros((len(bands), len(bands)))]])
    active = np.isin(averaged.band, bands)
    kept = np.concatenate((active, active, np.ones(len(bands), dtype=bool)))
    right = -np.concatenate((left.real, left.imag, np.zeros(len(bands)))) / (scale * size)
    step, change = np.zeros(len(kept)), np.zeros(len(averaged.centre))
    step[kept] = np.linalg.lstsq(equations[np.ix_(kept, kept)], right[kept], rcond=FREE)[0]
    change[bands] = scale * step[2 * count :]
    return np.asarray(size * (step[:count] + 1j * step[count : 2 * count])), change


def _expanded(averaged: AveragedEquations, z: Complexes, turning: Floats, bands: Ints) -> tuple[Complexes, Floats]:
    """F (C,), and ∂F by the parts of z and the Ω of these bands by central differences, (2C, 2C + len(bands))."""
    unit, none = np.eye(len(z)), np.zeros((len(turning), 2 * len(z)))
    h = STEP * np.concatenate((np.full(2 * len(z), np.abs(z).max()), turning[bands]))
    ways = h * np.hstack((unit, 1j * unit, np.zeros((len(z), len(bands)))))
    faster = h * np.hstack((none, np.arange(len(turning))[:, None] == bands))
    places = (base[:, None] + np.hstack((0 * way[:, :1], way, -way)) for base, way in ((z, ways), (turning, faster)))
    here, above, below = np.split(averaged.flow(*places), (1, 1 + len(h)), axis=1)
    slope = (above - below) / (2 * h)
    return here[:, 0], np.vstack((slope.real, slope.imag))


def _rates(
    averaged: AveragedEquations, z: Complexes, jacobian: Floats, neutral: int
) -> tuple[Complexes, Floats, float]:
    """All μ but the `neutral` ones closest to 0, the slowest first, how far each leaves the row of z, the recovery."""
    parts = np.concatenate((z.real, z.imag))
    values, vectors = np.linalg.eig(jacobian)
    energy = np.sum([averaged.energies(np.abs(part) + 0j) for part in np.split(vectors, 2)], axis=0)
    leaving = 1 - energy[int(averaged.energies(z).argmax())] / energy.sum(axis=0)
    kept = np.argsort(np.abs(values))[neutral:]
    kept = kept[np.argsort(-values[kept].real)]
    return values[kept].astype(complex), leaving[kept], abs(float(parts @ jacobian @ parts / (parts @ parts)))


def same(equilibrium: RelativeEquilibrium, other: RelativeEquilibrium, within: float = SAME) -> bool:
    """Whether two are the same motion within this relative tolerance, but for phases and equal pendula exchanged.

    Of two members of a continuous family the energies by rows and the stability tell.
    """
    energies = [state.averaged.energies(state.z) for state in (equilibrium, other)]
    near = np.abs(energies[0] - energies[1]).max() <= within * energies[0].sum()
    scale = max(np.abs(equilibrium.rates.real).max(initial=0.0), np.abs(other.rates.real).max(initial=0.0))
    if not near or abs(equilibrium.growth - other.growth) > 10 * within * scale:
        return False
    if equilibrium.is_family and other.is_family:
        return True
    return bool(likeness(equilibrium, other.z[:, None])[0] >= 1 - (10 * within) ** 2 / 2)


def likeness(equilibrium: RelativeEquilibrium, z: Complexes, settled: float = 1 - 1e-9) -> Floats:
    """How alike motions z (C, S) are to a state but for size, phases and equal pendula exchanged, from 0 to 1, (S,).

    Of a continuous family the energies by rows tell.  No exchange is looked for from the likeness `settled` on.
    """
    averaged = equilibrium.averaged
    if equilibrium.is_family:
        energy = averaged.energies(z)
        whole = energy.sum(axis=0)
        share = np.divide(energy, whole, out=np.zeros_like(energy), where=whole > 0)
        return np.asarray(np.sqrt(equilibrium.share[:, None] * share).sum(axis=0))
    alike = overlap(averaged, equilibrium.z, z)
    if len(set(kinds(averaged.scene).tolist())) < averaged.system.n_pendula:
        for k in np.flatnonzero(alike < settled):
            copy = exchanged(averaged, z[:, k], order_of(averaged, equilibrium.z, z[:, k]))
            alike[k] = max(alike[k], overlap(averaged, equilibrium.z, copy[:, None])[0])
    return alike
