"""The effective (apparent, dynamic) mass of a chain, counts of modes and shapes that keep every digit.

Elimination from the free end.  With t = ω²/k and μ the effective mass at a link's lower joint,

    D = 1 − t (r + μ),    μ' = ((1 − t p) μ + m (1 − t J)) / D        (μ = 0 below the last link),

the number of D < 0 is the number of frequencies below ω (Sylvester's law of inertia: [Parlett1998, §3.3]), and a link
whose upper joint moves by y turns by a = t (m s + μ) y / D and moves its lower joint to y (1 + t q) / D. Counts
separate J, with w = 1 − t J,

    D = w − t (m s² + μ),    μ' = ((w − t m (1 − s)²) μ + m w) / D,

since for a J far above the mass the separate roundings of r, p and m J would act like those of a multiple of the mass.
From above the same equations hold with s → 1 − s, p ↔ r and ν, the effective mass of everything above, in place of μ.

Arrays: links first, then pendula, then trial values x = ω² (natural units, g = 1): (n, P, R).

Counts are of all trial values at once.  On a fixed support the number of modes below ω is that of D < 0.  On a cart the
pivots move together, and the count gains one if the mass at the rail,
m_c − k_c/ω² + Σ μ', is positive.

Many supports of one form are one problem: trial values x = ω² have the shape (R, S), R of each of S supports, and the
constants of the P chains that hang from each (n, P, 1, S), links first.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from modal import pair
from modal.assembly import Block, CartNumbers, masses_below
from modal.pair import Constants
from modal.types import Floats, Ints

Sweep = Callable[[list[Any], float], tuple[float, float]]
NUDGE = 2.0**-60
"""Tolerance: share of its terms taken from a D that is zero: far below its rounding, but it makes a negative of it."""


def at_infinity(block: Block) -> tuple[Floats, Floats, Floats]:
    """(α, β, γ), each (P,), of the effective mass α − β/ω² − γ/ω⁴ − … at the pivot for high frequencies.

    α is the residual mass at the pivot. With R = r + α and u = m s + α below the link,

        α' = (p α + m J)/R,   β' = (k u² + β q²)/R²,   γ' = (k u + β q)²/R³ + γ q²/R²,

    sums of positive terms, from the recursion by expansion in 1/ω².
    """
    alpha = beta = gamma = np.zeros(block.size)
    for link in reversed(_rows(block.constants)):
        R, u = link.r + alpha, link.upper + alpha
        gamma = (link.k * u + beta * link.q) ** 2 / R**3 + gamma * link.q**2 / R**2
        beta = (link.k * u**2 + beta * link.q**2) / R**2
        alpha = (link.p * alpha + link.mJ) / R
    return alpha, beta, gamma


class SweepResult(NamedTuple):
    """Results of elimination in one direction: mass, energy at joints (n + 1, P, R), the rest at links (n, P, R).

    `mass` is the effective mass of that side, `gain` the ratio of the far joint's displacement to the near one's,
    `turn` that of a to the near one's; for a joint displaced by 1, `energy` is twice the kinetic energy over ω² of that
    whole side and `nearest` that of its nearest link.
    """

    mass: Floats
    energy: Floats
    nearest: Floats
    gain: Floats
    turn: Floats


def from_below(block: Block, x: Floats) -> SweepResult:
    """Return the result of eliminating everything below each joint; joint n is free."""
    results = _empty(block, x)
    results.mass[-1] = results.energy[-1] = results.nearest[-1] = 0.0
    for i, link in reversed(list(enumerate(_columns(block)))):
        mu, t = results.mass[i + 1], x / link.k
        D = 1.0 - t * (link.r + mu) - NUDGE
        results.gain[i] = (1.0 + t * link.q) / D
        results.turn[i] = t * (link.upper + mu) / D
        results.mass[i] = _mass_numerator(link, x, link.p, mu) / D
        results.nearest[i] = _kinetic(link, 1.0, results.turn[i])
        results.energy[i] = results.nearest[i] + results.energy[i + 1] * results.gain[i] ** 2
    return results


def from_above(block: Block, x: Floats, nu: Floats | None, energy: Floats | float = 0.0) -> SweepResult:
    """Return the elimination from above each joint; mass `nu` and `energy` (P, R) at the pivot, None if it is fixed."""
    results = _empty(block, x)
    results.mass[0] = np.inf if nu is None else nu
    results.energy[0], results.nearest[0] = energy, 0.0
    for i, link in enumerate(_columns(block)):
        t = x / link.k
        if nu is None:
            results.gain[i], results.turn[i] = 0.0, 1.0
            results.mass[i + 1] = link.r - 1.0 / t
        else:
            D = 1.0 - t * (link.p + nu) - NUDGE
            results.gain[i] = (1.0 + t * link.q) / D
            results.turn[i] = -t * (link.lower + nu) / D
            results.mass[i + 1] = _mass_numerator(link, x, link.r, nu) / D
        results.nearest[i + 1] = _kinetic(link, results.gain[i], results.turn[i])
        results.energy[i + 1] = results.nearest[i + 1] + results.energy[i] * results.gain[i] ** 2
        nu = results.mass[i + 1]
    return results


def kinetic(block: Block, y: Floats, a: Floats) -> Floats:
    """Twice each link's kinetic energy over ω², (n, P, R), from joints y (n + 1, P, R) and turns a (n, P, R)."""
    return np.array([_kinetic(link, y[i], a[i]) for i, link in enumerate(_columns(block))])


def joints(pivot: Floats, a: Floats) -> Floats:
    """Displacements (n + 1, P, R) of all joints from those of the pivots (R,) and the turns a (n, P, R)."""
    places: Floats = pivot + np.concatenate([np.zeros((1, *a.shape[1:])), np.cumsum(a, 0)])
    return places


def joint_masses(p: Floats, r: Floats) -> Floats:
    """Return the mass at each joint with every other joint fixed, (n + 1, …), from the links' p and r (n, …)."""
    masses = np.zeros((len(p) + 1, *p.shape[1:]))
    masses[:-1] += p
    masses[1:] += r
    return masses


def _columns(block: Block) -> list[Constants]:
    return _rows(Constants(*(values[:, :, None] for values in block.constants)))


def _rows(links: Constants) -> list[Constants]:
    """The constants link by link."""
    return [Constants(*row) for row in zip(*links, strict=True)]


def _mass_numerator(link: Constants, x: Floats, inertia: Floats, mass: Floats) -> Floats:
    numerator: Floats = (1.0 - x * (inertia / link.k)) * mass + (link.m - x * (link.mJ / link.k))
    return numerator


def _kinetic(link: Constants, y: Floats | float, a: Floats) -> Floats:
    twice: Floats = link.m * (y + link.upper / link.m * a) ** 2 + link.mJ / link.m * a**2
    return twice


def _empty(block: Block, x: Floats) -> SweepResult:
    shape = (block.size, x.shape[-1])
    joints, links = (np.empty((3, block.n + 1, *shape)), np.empty((2, block.n, *shape)))
    return SweepResult(*joints, *links)


NUMBERS_IN_CACHE = 16_000
"""Cost: size of an array of trials over links that fits a processor's cache (benchmarks/modes.py)."""
FEW_TRIALS = 8
"""Cost: trial values of all chains for which floats take less time than arrays (benchmarks/modes.py)."""


class Chains(NamedTuple):
    """The recursion's constants (n, P, 1, S) with 1/k for k, and the entries of a dense matrix.

    J = I/l² is separate from `top_inertia`, `tip_inertia` and `cross`: m s², m (1 − s)² and m s (1 − s).
    """

    m: Floats
    J: Floats
    top_inertia: Floats
    tip_inertia: Floats
    cross: Floats
    r: Floats
    p: Floats
    q: Floats
    inverse: Floats
    length: Floats
    b: Floats
    diagonal: Floats

    @property
    def n(self) -> int:
        """Number of links in each chain."""
        return len(self.m)

    @property
    def size(self) -> int:
        """Number of links of all chains of one support."""
        return int(self.m.shape[0] * self.m.shape[1])

    def take(self, supports: Ints | slice) -> Chains:
        """The chains of some supports."""
        return Chains(*(values[..., supports] for values in self))

    @property
    def rest(self) -> Chains:
        """All links except the first."""
        return Chains(*(values[1:] for values in self))


def chains_of(mass: Floats, length: Floats, centre: Floats, inertia: Floats) -> Chains:
    """Chains with these numbers, (n, P, 1, S) each."""
    mass_below = masses_below(mass)
    link = pair.link_constants(mass, length, centre, inertia, mass_below)
    b = pair.first_moment(mass, length, centre, mass_below)
    diagonal = pair.second_moment(mass, length, centre, inertia, mass_below)
    levers = lever_masses(link, length, centre, inertia)
    return Chains(link.m, *levers, link.r, link.p, link.q, 1 / link.k, length, b, diagonal)


def lever_masses(link: Constants, length: Any, centre: Any, inertia: Any) -> tuple[Any, Any, Any, Any]:
    """J = I/l², m s², m (1 − s)² and m s (1 − s) of a link, or of as many as the arrays hold."""
    rest = (length - centre) / length
    return inertia / length / length, link.upper * (centre / length), link.lower * rest, link.upper * rest


@dataclass(frozen=True, eq=False)
class Suspension:
    """S supports of one form with their chains; `mass` and `stiffness` (S,) of their carts, None where fixed."""

    chains: tuple[Chains, ...]
    mass: Floats | None = None
    stiffness: Floats | None = None

    @classmethod
    def on_cart(cls, blocks: Sequence[Block], cart: CartNumbers) -> Suspension:
        """All chains on one cart, or on each of S carts."""
        mass, stiffness = np.atleast_1d(cart.mass), np.atleast_1d(cart.stiffness)
        return cls(tuple(_arrange(block, (-1, 1, len(mass))) for block in blocks), mass, stiffness)

    @classmethod
    def on_fixed_support(cls, block: Block) -> Suspension:
        """Return every chain of a block on its own fixed support."""
        return cls((_arrange(block, (1, 1, -1)),))

    @property
    def supports(self) -> int:
        """Number of supports, S."""
        return int(self.chains[0].m.shape[-1])

    @property
    def size(self) -> int:
        """Number of links on each support."""
        return sum(chains.size for chains in self.chains)

    @cached_property
    def total_mass(self) -> Floats:
        """Mass of each cart and everything on it, (S,)."""
        return np.asarray((0.0 if self.mass is None else self.mass) + sum(c.m.sum((0, 1, 2)) for c in self.chains))

    def take(self, supports: Ints | slice) -> Suspension:
        """Some of the supports."""
        chains = tuple(chain.take(supports) for chain in self.chains)
        if self.mass is None or self.stiffness is None:
            return Suspension(chains)
        return Suspension(chains, self.mass[supports], self.stiffness[supports])

    def count(self, x: Floats) -> Ints:
        """Number of oscillatory modes below each x (R, S)."""
        total: Ints = np.zeros(x.shape, dtype=np.int64)
        pivot_mass = np.zeros(x.shape)
        for chains in self.chains:
            counts, mass = count_and_mass(chains, x)
            total += counts.sum(0)
            pivot_mass += mass.sum(0)
        if self.mass is None or self.stiffness is None:
            return total
        return np.asarray(total + (pivot_mass + self.mass > self.stiffness / x) - (self.stiffness == 0))

    @cached_property
    def low(self) -> Floats:
        """A power of two below every ω² > 0, from 1/ω² ≤ trace(K⁻¹ M), (S,)."""
        trace = sum((chains.diagonal / chains.b).sum((0, 1, 2)) for chains in self.chains)
        if self.stiffness is not None:
            has_spring = self.stiffness > 0
            trace = trace + np.where(has_spring, self.total_mass / np.where(has_spring, self.stiffness, 1.0), 0.0)
        power: Floats = 2.0 ** (-np.ceil(np.log2(trace)) - 1)
        return power


def count_and_mass(chains: Chains, x: Floats) -> tuple[Ints, Floats]:
    """Number of fixed-base frequencies of each chain below each x, and the mass at its pivot, (P, R, S)."""
    if results := one_by_one(
        count_in_floats, (chains.inverse, chains.J, chains.top_inertia, chains.tip_inertia, chains.m), x
    ):
        return results[0].astype(np.int64), results[1]
    with np.errstate(all="ignore"):
        counts, mass = _count_in_arrays(chains, x, 0.0)
        if not (fine := np.isfinite(mass).all((0, 2))).all():
            counts[:, ~fine], mass[:, ~fine] = _count_in_arrays(chains, x[~fine], NUDGE)
    return counts, mass


def _count_in_arrays(chains: Chains, x: Floats, nudge: float) -> tuple[Ints, Floats]:
    mu = np.zeros((chains.m.shape[1], *x.shape))
    counts = np.zeros(mu.shape, dtype=np.int64)
    step = min(np.iinfo(np.int8).max, max(1, NUMBERS_IN_CACHE // max(1, mu.size)))  # sums of as many bits are int8
    room = np.empty((5, min(step, chains.n), *mu.shape))
    for end in range(chains.n, 0, -step):
        span = slice(max(0, end - step), end)
        t, light, gains, masses, pivots = room[:, : end - span.start]
        np.multiply(chains.inverse[span], x, out=t)
        np.multiply(chains.J[span], t, out=light)
        np.subtract(1.0, light, out=light)
        np.multiply(chains.tip_inertia[span], t, out=gains)
        np.subtract(light, gains, out=gains)
        np.multiply(chains.m[span], light, out=masses)
        factors = t, light, gains, masses, chains.top_inertia[span], pivots
        for ratio, w, gain, addend, top_inertia, D in zip(*(values[::-1] for values in factors), strict=True):
            np.add(mu, top_inertia, out=D)
            np.multiply(D, ratio, out=D)
            np.subtract(w, D, out=D)
            if nudge:
                np.subtract(D, nudge, out=D)
            mu *= gain
            mu += addend
            mu /= D
        counts += np.add.reduce((pivots < 0).view(np.int8), axis=0, dtype=np.int8)
    return counts, mu


def one_by_one(sweep: Sweep, constants: Sequence[Floats], x: Floats) -> tuple[Floats, Floats] | None:
    """The results of a sweep in floats for each chain (n, P, 1, S) at each x (R, S), (P, R, S), up to FEW_TRIALS.

    None for more of them, or if a pivot is zero.
    """
    _, chains, _, supports = constants[0].shape
    if chains * x.size > FEW_TRIALS:
        return None
    results = np.empty((2, chains, *x.shape))
    for p in range(chains):
        for s in range(supports):
            links = list(zip(*(values[::-1, p, 0, s].tolist() for values in constants), strict=True))
            try:
                results[:, p, :, s] = np.transpose([sweep(links, y) for y in x[:, s].tolist()])
            except ZeroDivisionError:
                return None
    return results[0], results[1]


def count_in_floats(links: list[Any], y: float, nudge: float = 0.0) -> tuple[int, float]:
    """Pivots D < 0, less a nudge, and the mass at the pivot of links (1/k, J, m s², m (1 − s)², m), tip first."""
    mu, count = 0.0, 0
    for k, J, top_inertia, tip_inertia, m in links:
        t = y * k
        w = 1.0 - J * t
        D = w - (mu + top_inertia) * t - nudge
        if D < 0.0:
            count += 1
        mu = (mu * (w - tip_inertia * t) + m * w) / D
    return count, mu


def mass_and_energy_in_floats(links: list[Any], y: float) -> tuple[float, float]:
    """Mass and energy at the pivot of links, their constants before m s (1 − s), r, p and q, tip first."""
    mu = energy = 0.0
    for k, J, top_inertia, tip_inertia, m, cross, r, p, q in links:
        t = y * k
        w = 1.0 - J * t
        D = w - top_inertia * t - t * mu
        gain = (w + cross * t) / D
        mu = (mu * (w - tip_inertia * t) + m * w) / D
        energy = ((energy + r) * gain + 2.0 * q) * gain + p
    return mu, energy


def _arrange(block: Block, shape: tuple[int, int, int]) -> Chains:
    numbers = block.mass, block.length, block.centre, block.inertia
    return chains_of(*(values.reshape(block.n, *shape) for values in numbers))
