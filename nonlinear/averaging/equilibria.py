"""The steady oscillations of a self-excited scene: relative equilibria of its averaged equations, and their stability.

If every band rotates at its own constant rate Ω_b, shapes and amplitudes are constant:

    F(z, Ω) = 0.

In-phase, antiphase and intermediate oscillations are such states: harmonic balance with the unknowns z and Ω.
Perturbations grow like exp(μt), μ the eigenvalues of ∂F/∂z; one of them is 0 for every oscillating band, whose phase is
arbitrary.  A state is stable if all others have negative real parts.

All pendula hang from one support, so that a motion in which equal ones have exchanged their parts is a motion too, and
averaged equations do not know phases common to a band:

    z' = e^{iφ_b} Φ⁻¹ P Φ z

is as good a state as z, for every permutation P of equal pendula.  The two splay states of three equal metronomes are
such copies.  A mirror image θ → −θ, x → −x is the motion itself, half a swing later.

A motion is compared pendulum by pendulum: one that swings widest is brought to each pendulum that could have its part,
which gives the φ_b, and the others are assigned to it as well as they fit.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import chain, combinations, islice
from math import factorial, prod

import numpy as np
import scipy

from modal.modes import table_numbers
from modal.report import Displayed, silent
from modal.scene import Scene
from modal.types import Booleans, Complexes, Floats, Ints
from nonlinear.averaging.equations import DIFFERENCE_STEP, AveragedEquations
from nonlinear.averaging.slow_flow import DEAD_AMPLITUDE_RATIO, LOCKED, settle_apart
from nonlinear.system import burdens

NEWTON_LEAP_MAX = 0.1
"""Cost: Newton's step over the largest amplitude: nearly neutral families would cause long ones;
benchmarks/sync/survivors.py."""
NEWTON_ROUNDS_MAX = 40
"""Limit: rounds of Newton's method with a limited step, after which nothing is found."""
RATE_RESIDUAL_MAX = 1e-10
"""Tolerance: of ω|z|, the rates that are left of a state: rounding leaves 1e-14, a slow growth rate is 1e-5."""
NEUTRAL_RATE_RATIO = 1e-4
"""Tolerance: of the recovery rate, below which an eigenvalue is 0: central differences know it to 1e-9."""
START_SEED = 5
"""Format: of the random starts, which are the same in every run."""
START_ANGLE = 0.1
"""Cost: largest angle (rad) of a start, within the range of averaging; benchmarks/sync/survivors.py."""
HANGING_ANGLE_MAX = np.pi / 2
"""Limit: largest angle (rad) of a state: wider ones are not found."""
SETTLING_STEPS = 1_500
"""Cost: steps after which Newton's method takes over from a start that moves on; benchmarks/sync/survivors.py."""
IMAGES_MAX = 24
"""Cost: pendula tried as the image of the widest; benchmarks/sync/exchange.py."""
AMPLITUDE_DIFFERENCE_MIN = 1e-3
"""Tolerance: over the widest amplitude, from which on two pendula do not do the same, and a band is not at rest:
settling leaves 1e-4."""


@dataclass(frozen=True, eq=False, repr=False)
class RelativeEquilibrium(Displayed):
    """A motion of constant shape: amplitudes z (C,), rotation rates Ω (B,) in rad/s, growth rates (1/s).

    `rates` are the eigenvalues μ except the neutral ones, the slowest first, and `leaving` the fraction of the energy
    of each eigenvector outside the row that holds most: many pendula in antiphase may share it in many ways. `rivals`
    are the rows, from 0, that hold most of these fractions.  `recovery`
    is the size of Re z*ᵀJz/|z|² (1/s), the rate at which the overall amplitude changes by itself.
    """

    what = "Motion of constant shape, by averaged equations"
    shows = "turning: rotation rates, rad/s; rates: growth rates, 1/s; z: amplitudes"

    averaged: AveragedEquations
    z: Complexes
    turning: Floats
    rates: Complexes
    leaving: Floats
    rivals: Ints
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
        return None if abs(self.growth) <= NEUTRAL_RATE_RATIO * self.recovery else self.growth < 0

    @cached_property
    def is_family(self) -> bool:
        """Whether it belongs to a continuous family of states: an eigenvalue other than those of the phases is 0."""
        return bool(np.any(np.abs(self.rates) <= NEUTRAL_RATE_RATIO * self.recovery))

    @cached_property
    def copies(self) -> int:
        """The number of states, including this one, that exchanges of equal pendula produce; 1 for a family."""
        return 1 if self.is_family else count_copies(self.averaged, self.z)

    @property
    def hold(self) -> float:
        """The rate (1/s) at which energy in other rows decays, negative where it grows; infinite without any."""
        others = self.rates.real[self.leaving > LOCKED]
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
    equations: AveragedEquations, report: Callable[[float], object] = silent
) -> tuple[RelativeEquilibrium, ...]:
    """Find the relative equilibria from each row of the mode table and from patterns of pendula.

    The patterns are pendula in phase and in antiphase.  Copies by exchange of equal pendula are one state
    (`RelativeEquilibrium.copies`).  The stable ones with their phases reversed, or spread evenly, or with the parts of
    unequal pendula exchanged, are starts too.  Not necessarily all: any wider than a right angle, or missed by Newton's
    method, are not found.  `report` is called with the part of the search that is done.
    """
    equilibria: list[RelativeEquilibrium] = []

    def add(start: Complexes) -> None:
        equilibrium = relative_equilibrium(equations, start)
        if (
            equilibrium
            and equilibrium.averaged.largest(equilibrium.z) < HANGING_ANGLE_MAX
            and not any(is_same_motion(equilibrium, neighbour) for neighbour in equilibria)
        ):
            equilibria.append(equilibrium)

    starts = list(_starts(equations))
    copies = (start for equilibrium in equilibria for start in _nearly_copies(equilibrium))
    for count, start in enumerate(chain(starts, islice(copies, 2 * IMAGES_MAX)), start=1):
        add(start)
        report(count / (len(starts) + 2 * IMAGES_MAX))
    report(1.0)
    return tuple(sorted(equilibria, key=lambda equilibrium: (equilibrium.row, equilibrium.omega)))


@np.errstate(all="ignore")
def relative_equilibrium(equations: AveragedEquations, z: Complexes) -> RelativeEquilibrium | None:
    """The relative equilibrium closest to these amplitudes, None where Newton's method finds none."""
    bands = swinging(equations, z)
    if not len(bands):
        return None
    active = np.isin(equations.band, bands)
    z = np.where(active, z, 0.0)
    turning, threshold = equations.turning(z), DEAD_AMPLITUDE_RATIO * np.abs(z).max()
    for _ in range(NEWTON_ROUNDS_MAX):
        flow, slope = _linearize(equations, z, turning, bands)
        residual = np.where(active, flow, 0.0)
        if np.abs(residual).max() <= RATE_RESIDUAL_MAX * np.abs(equations.omega * z).max():
            return RelativeEquilibrium(equations, z, turning, *_rates(equations, z, slope[:, : 2 * len(z)], len(bands)))
        step, change = _step(equations, z, residual, slope, bands)
        part = min(1.0, NEWTON_LEAP_MAX * np.abs(z).max() / np.abs(step).max()) if np.any(step) else 1.0
        z, turning = z + part * step, turning + part * change
        if not np.all(np.isfinite(z)) or not np.all(turning > 0):
            return None
        if len(dead := bands[_sizes(equations, z)[bands] <= threshold]):
            return relative_equilibrium(equations, np.where(np.isin(equations.band, dead), 0.0, z))
    return None


def _starts(equations: AveragedEquations) -> Iterator[Complexes]:
    """Final amplitudes of the slow flow from each row, restricted to it, and from each pattern of pendula."""
    pairs = [*_rows(equations), *_patterns(equations)]
    starts = np.array([START_ANGLE * z / equations.largest(z) for z, _ in pairs]).T
    yield from settle_apart(equations, starts, np.array([members for _, members in pairs]).T, SETTLING_STEPS)


def _nearly_copies(equilibrium: RelativeEquilibrium) -> Iterator[Complexes]:
    """Its phases reversed, or spread evenly, or the parts of two unequal pendula of as many links exchanged."""
    if not equilibrium.is_stable or equilibrium.is_family:
        return
    equations = equilibrium.averaged
    kind, links = kinds(equations.scene), np.bincount(equations.system.pendulum)
    yield equilibrium.z.conj()
    if len(links) > 2:
        yield spread_evenly(equations, equilibrium.z)
    for p, q in combinations(range(len(links)), 2):
        if kind[p] != kind[q] and links[p] == links[q]:
            order = np.arange(len(links))
            order[[p, q]] = q, p
            yield exchange(equations, equilibrium.z, order)


def _rows(equations: AveragedEquations) -> Iterator[tuple[Complexes, Booleans]]:
    """An arbitrary motion in the modes of one row, and these modes."""
    random = np.random.default_rng(START_SEED)
    for row in sorted(set(equations.row.tolist())):
        members = equations.row == row
        yield (
            np.where(members, random.standard_normal(len(members)) + 1j * random.standard_normal(len(members)), 0.0),
            members,
        )


def _patterns(equations: AveragedEquations) -> Iterator[tuple[Complexes, Booleans]]:
    """All pendula nearly in phase, and alternate ones nearly in antiphase, in every band separately, and all modes."""
    random = np.random.default_rng(START_SEED)
    pendulum = equations.system.pendulum
    first = equations.system.first
    for band in range(len(equations.centre)):
        members = equations.band == band
        busiest = np.abs(equations.link_shapes[:, members]).max(axis=1)
        for sign in (np.ones(len(pendulum)), (-1.0) ** pendulum):
            z = np.where(members, (sign * busiest) @ equations.dual[first:], 0.0).astype(complex)
            if np.any(z):
                noise = random.standard_normal(len(members)) + 1j * random.standard_normal(len(members))
                # hardly aside, so that it leaves an unstable pattern
                aside = np.sqrt(np.finfo(float).eps) * np.abs(z).max()
                yield z + aside * noise, np.ones_like(members)


def swinging(equations: AveragedEquations, z: Complexes) -> Ints:
    """The bands that oscillate."""
    return np.flatnonzero(_sizes(equations, z) > AMPLITUDE_DIFFERENCE_MIN * np.abs(z).max())


def _sizes(equations: AveragedEquations, z: Complexes) -> Floats:
    """The largest amplitude in every band, (B,)."""
    sizes = np.zeros(len(equations.centre))
    np.maximum.at(sizes, equations.band, np.abs(z))
    return sizes


def _step(
    averaged_equations: AveragedEquations, z: Complexes, residual: Complexes, slope: Floats, bands: Ints
) -> tuple[Complexes, Floats]:
    """Newton's step of z and Ω, the shortest one that keeps the phase of every band; NaN if numbers overflow."""
    count, size, scale = len(z), np.abs(z).max(), averaged_equations.omega.max()
    turns = np.array([np.where(averaged_equations.band == band, 1j * z, 0.0) for band in bands]).T
    turns /= np.linalg.norm(turns, axis=0)
    columns = np.vstack((turns.real, turns.imag))
    slope_matrix = slope / np.repeat((scale, size), (2 * count, len(bands)))
    equations = np.block([[slope_matrix], [columns.T, np.zeros((len(bands), len(bands)))]])
    active = np.isin(averaged_equations.band, bands)
    is_free = np.concatenate((active, active, np.ones(len(bands), dtype=bool)))
    right = -np.concatenate((residual.real, residual.imag, np.zeros(len(bands)))) / (scale * size)
    matrix, change = equations[np.ix_(is_free, is_free)], np.zeros(len(averaged_equations.centre))
    if not (np.all(np.isfinite(matrix)) and np.all(np.isfinite(right))):
        return np.full(count, np.nan, dtype=complex), change
    step = np.zeros(len(is_free))
    step[is_free] = np.linalg.lstsq(matrix, right[is_free], rcond=np.sqrt(np.finfo(float).eps))[0]
    change[bands] = scale * step[2 * count :]
    return np.asarray(size * (step[:count] + 1j * step[count : 2 * count])), change


def _linearize(equations: AveragedEquations, z: Complexes, turning: Floats, bands: Ints) -> tuple[Complexes, Floats]:
    """F (C,), and ∂F by the parts of z and the Ω of these bands by central differences, (2C, 2C + len(bands))."""
    unit, none = np.eye(len(z)), np.zeros((len(turning), 2 * len(z)))
    h = DIFFERENCE_STEP * np.concatenate((np.full(2 * len(z), np.abs(z).max()), turning[bands]))
    ways = h * np.hstack((unit, 1j * unit, np.zeros((len(z), len(bands)))))
    faster = h * np.hstack((none, np.arange(len(turning))[:, None] == bands))
    places = (base[:, None] + np.hstack((0 * way[:, :1], way, -way)) for base, way in ((z, ways), (turning, faster)))
    flow, flow_up, flow_down = np.split(equations.flow(*places), (1, 1 + len(h)), axis=1)
    slope = (flow_up - flow_down) / (2 * h)
    return flow[:, 0], np.vstack((slope.real, slope.imag))


def _rates(
    equations: AveragedEquations, z: Complexes, jacobian: Floats, neutral: int
) -> tuple[Complexes, Floats, Ints, float]:
    """All μ but the `neutral` ones closest to 0, the slowest first, how far each leaves the row of z and for which.

    Last the recovery.
    """
    parts = np.concatenate((z.real, z.imag))
    values, vectors = np.linalg.eig(jacobian)
    energy = np.sum([equations.energies(np.abs(part) + 0j) for part in np.split(vectors, 2)], axis=0)
    holder = int(equations.energies(z).argmax())
    leaving = 1 - energy[holder] / energy.sum(axis=0)
    energy[holder] = 0.0
    order = np.argsort(np.abs(values))[neutral:]
    order = order[np.argsort(-values[order].real)]
    recovery = abs(float(parts @ jacobian @ parts / (parts @ parts)))
    return values[order].astype(complex), leaving[order], energy.argmax(axis=0)[order], recovery


def is_same_motion(
    equilibrium: RelativeEquilibrium, second: RelativeEquilibrium, within: float = AMPLITUDE_DIFFERENCE_MIN
) -> bool:
    """Whether two are the same motion within this relative tolerance, up to phases and exchanges of equal pendula.

    Two members of a continuous family are compared by their energies by rows and their stability.
    """
    energies = [state.averaged.energies(state.z) for state in (equilibrium, second)]
    is_near = np.abs(energies[0] - energies[1]).max() <= within * energies[0].sum()
    scale = max(np.abs(equilibrium.rates.real).max(initial=0.0), np.abs(second.rates.real).max(initial=0.0))
    if not is_near or abs(equilibrium.growth - second.growth) > 10 * within * scale:
        return False
    if equilibrium.is_family and second.is_family:
        return True
    return bool(likeness(equilibrium, second.z[:, None])[0] >= 1 - (10 * within) ** 2 / 2)


def likeness(equilibrium: RelativeEquilibrium, z: Complexes, threshold: float = 1 - 1e-9) -> Floats:
    """Return the similarity, 0 to 1, of motions z (C, S) to a state up to size, phases and exchanges of pendula, (S,).

    In a continuous family the energies by rows decide.  No exchange is looked for from the likeness `threshold` on.
    """
    equations = equilibrium.averaged
    if equilibrium.is_family:
        energy = equations.energies(z)
        total = energy.sum(axis=0)
        share = np.divide(energy, total, out=np.zeros_like(energy), where=total > 0)
        return np.asarray(np.sqrt(equilibrium.share[:, None] * share).sum(axis=0))
    alike = overlap(equations, equilibrium.z, z)
    if len(set(kinds(equations.scene).tolist())) < equations.system.n_pendula:
        for k in np.flatnonzero(alike < threshold):
            copy = exchange(equations, z[:, k], order_of(equations, equilibrium.z, z[:, k]))
            alike[k] = max(alike[k], overlap(equations, equilibrium.z, copy[:, None])[0])
    return alike


@lru_cache(maxsize=16)
def kinds(scene: Scene) -> Ints:
    """The number of the first pendulum that each is equal to but for its start, from 0, (N,).

    Equal ones bear equal springs and forces.
    """
    bare = [pendulum.replace(start=None, count=1) for pendulum in scene.pendulum]
    numbers = [
        bare.index(plain) for plain, pendulum in zip(bare, scene.pendulum, strict=True) for _ in range(pendulum.count)
    ]
    first: dict[tuple[int, int], int] = {}
    return np.array([first.setdefault(pair, p) for p, pair in enumerate(zip(numbers, burdens(scene), strict=True))])


def exchange(equations: AveragedEquations, z: Complexes, order: Ints) -> Complexes:
    """Amplitudes (C,) of the motion in which pendulum p does what pendulum `order[p]` does in z (C,)."""
    q = equations.shapes @ z
    first, places = equations.system.first, _places(equations)
    new_q = q.copy()
    for p, source in enumerate(order):
        new_q[first + places[p]] = q[first + places[source]]
    return np.asarray(equations.dual.T @ new_q)


def spread_evenly(equations: AveragedEquations, z: Complexes) -> Complexes:
    """Amplitudes (C,) of pendula that all swing as wide as the widest in z (C,), one after the other in time."""
    first, places = equations.system.first, _places(equations)
    links = equations.link_shapes @ z
    widest = np.abs(links).max()
    for p, place in enumerate(places):
        shape = links[place] if np.abs(links[place]).max() > AMPLITUDE_DIFFERENCE_MIN * widest else np.ones(len(place))
        lead = shape[np.abs(shape).argmax()]
        links[place] = widest / lead * np.exp(2j * np.pi * p / len(places)) * shape
    return np.asarray(links @ equations.dual[first:])


def overlap(equations: AveragedEquations, reference: Complexes, z: Complexes) -> Floats:
    """How alike amplitudes z (C, S) are to `one` (C,), but for size and the phase of each band: from 0 to 1, (S,)."""
    weights = equations.omega**2
    products = ((weights * reference.conj())[:, None] * z)[None] * equations.member[..., None]
    norm = np.sqrt(np.sum(weights * np.abs(reference) ** 2) * (weights @ np.abs(z) ** 2))
    alike = np.abs(products.sum(axis=1)).sum(axis=0)
    return np.asarray(np.divide(alike, norm, out=np.zeros_like(norm), where=norm > 0))


def order_of(equations: AveragedEquations, reference: Complexes, z: Complexes) -> Ints:
    """The exchange of equal pendula (N,) that makes z (C,) as like `one` (C,) as possible."""
    links, others = _by_pendulum(equations, reference), _by_pendulum(equations, z)
    kind = kinds(equations.scene)
    best, order = -np.inf, np.arange(len(kind))
    for turn in _turns(links, others, kind):
        gain = np.einsum("pnb,qnb->pq", links.conj(), others * turn).real
        rows, columns = scipy.optimize.linear_sum_assignment(
            np.where(kind[:, None] == kind, gain, -1e9 * np.abs(gain).max()), True
        )
        if (total := float(gain[rows, columns].sum())) > best:
            best, order = total, columns
    return order


def count_copies(equations: AveragedEquations, z: Complexes) -> int:
    """How many different motions the exchanges of equal pendula make of z (C,): N! over those that change nothing."""
    kind, links = kinds(equations.scene), _by_pendulum(equations, z)
    alike = _alike(links, links, kind)
    set_sizes = map(sum, set(map(tuple, alike.tolist())))
    distinct: list[Complexes] = []
    for turn in _turns(links, links, kind, max_images=len(kind)):
        if all(np.abs(turn - neighbour).max() > AMPLITUDE_DIFFERENCE_MIN for neighbour in distinct):
            matches = _alike(links, links * turn, kind)
            if np.array_equal(np.sort(matches.sum(axis=0)), np.sort(alike.sum(axis=0))) and matches.any(axis=0).all():
                distinct.append(turn)
    n_permutations = prod(map(factorial, Counter(kind.tolist()).values()))
    return n_permutations // (max(len(distinct), 1) * prod(map(factorial, set_sizes)))


def _turns(links: Complexes, others: Complexes, kind: Ints, max_images: int = IMAGES_MAX) -> list[Complexes]:
    """The factors e^{−iφ_b} (B,) that bring the images of the pendulum that swings widest to its phases."""
    size = np.abs(links).max(axis=(1, 2))
    widest = int(size.argmax())
    images = np.flatnonzero(kind == kind[widest])
    images = images[np.argsort(np.abs(np.abs(others).max(axis=(1, 2))[images] - size[widest]), kind="stable")][
        :max_images
    ]
    shifts = (np.sum(links[widest] * others[image].conj(), axis=0) for image in images)
    return [np.where(np.abs(shift) > 0, shift / np.maximum(np.abs(shift), 1e-300), 1.0) for shift in shifts]


def _alike(links: Complexes, others: Complexes, kind: Ints) -> Booleans:
    """Which pendula of one kind do the same in two motions, (N, N)."""
    distance = np.abs(links[:, None] - others[None]).max(axis=(2, 3))
    return np.asarray((distance <= AMPLITUDE_DIFFERENCE_MIN * np.abs(links).max()) & (kind[:, None] == kind))


def _places(equations: AveragedEquations) -> list[Ints]:
    """The links of every pendulum from top to bottom."""
    pendulum = equations.system.pendulum
    return np.split(np.arange(len(pendulum)), np.flatnonzero(np.diff(pendulum)) + 1)


def _by_pendulum(equations: AveragedEquations, z: Complexes) -> Complexes:
    """Complex angles (rad) of every link in every band, (N, n, B), 0 beyond the last link of a pendulum."""
    links, places = equations.link_shapes @ (z[:, None] * equations.member.T), _places(equations)
    angles = np.zeros((len(places), max(map(len, places)), links.shape[1]), dtype=complex)
    for p, place in enumerate(places):
        angles[p, : len(place)] = links[place]
    return angles
