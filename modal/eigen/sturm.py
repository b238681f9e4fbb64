"""Sturm counts: the number of modes of pendula on a support below ω, for all trial values at once.

The pivots D of `modal.eigen.recursion` change sign as the eigenvalues do (Sylvester's law of inertia: Parlett, The
Symmetric Eigenvalue Problem, §3.3).  On a fixed support the number of modes below ω is that of D < 0.  On a cart the
pivots move together, and the count gains one where the mass felt by the rail, m_c − k_c/ω² + Σ μ', is positive.

Many supports of one form are one problem: trial values x = ω² have the shape (R, S), R of each of S supports, and the
constants of the P chains that hang from each (n, P, 1, S), links first.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from modal import pair
from modal.assembly import Block, CartNumbers, masses_below
from modal.eigen.recursion import NUDGE
from modal.types import Floats, Ints

ROOM = 16_000
"""Size of an array of trials over links that fits a processor's cache."""
MOST_COUNTED = 127
"""Links of which an integer of eight bits is a count."""


class Chains(NamedTuple):
    """The recursion's constants (n, P, 1, S) with 1/k for k, and the entries of a dense matrix."""

    m: Floats
    mJ: Floats
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
        """All links but the first."""
        return Chains(*(values[1:] for values in self))


def chains_of(mass: Floats, length: Floats, centre: Floats, inertia: Floats) -> Chains:
    """Chains with these numbers, (n, P, 1, S) each."""
    below = masses_below(mass)
    link = pair.link_constants(mass, length, centre, inertia, below)
    b = pair.first_moment(mass, length, centre, below)
    diagonal = pair.second_moment(mass, length, centre, inertia, below)
    return Chains(link.m, link.mJ, link.r, link.p, link.q, 1 / link.k, length, b, diagonal)


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
        return cls(tuple(_arranged(block, (-1, 1, len(mass))) for block in blocks), mass, stiffness)

    @classmethod
    def fixed(cls, block: Block) -> Suspension:
        """Every chain of a block on a fixed support of its own."""
        return cls((_arranged(block, (1, 1, -1)),))

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
        below: Ints = np.zeros(x.shape, dtype=np.int64)
        felt = np.zeros(x.shape)
        for chains in self.chains:
            counts, mass = count_and_mass(chains, x)
            below += counts.sum(0)
            felt += mass.sum(0)
        if self.mass is None or self.stiffness is None:
            return below
        return np.asarray(below + (felt + self.mass > self.stiffness / x) - (self.stiffness == 0))

    @cached_property
    def low(self) -> Floats:
        """A power of two below every ω² > 0, from 1/ω² ≤ trace(K⁻¹ M), (S,)."""
        trace = sum((chains.diagonal / chains.b).sum((0, 1, 2)) for chains in self.chains)
        if self.stiffness is not None:
            held = self.stiffness > 0
            trace = trace + np.where(held, self.total_mass / np.where(held, self.stiffness, 1.0), 0.0)
        power: Floats = 2.0 ** (-np.ceil(np.log2(trace)) - 1)
        return power


def count_and_mass(chains: Chains, x: Floats) -> tuple[Ints, Floats]:
    """Number of fixed-base frequencies of each chain below each x, and the mass felt at its pivot, (P, R, S)."""
    with np.errstate(all="ignore"):
        below, mass = _counted(chains, x, 0.0)
        if not (fine := np.isfinite(mass).all((0, 2))).all():
            below[:, ~fine], mass[:, ~fine] = _counted(chains, x[~fine], NUDGE)
    return below, mass


def _counted(chains: Chains, x: Floats, nudge: float) -> tuple[Ints, Floats]:
    mu = np.zeros((chains.m.shape[1], *x.shape))
    below = np.zeros(mu.shape, dtype=np.int64)
    step = min(MOST_COUNTED, max(1, ROOM // max(1, mu.size)))
    room = np.empty((4, min(step, chains.n), *mu.shape))
    for end in range(chains.n, 0, -step):
        some = slice(max(0, end - step), end)
        t, gains, masses, pivots = room[:, : end - some.start]
        np.multiply(chains.inverse[some], x, out=t)
        np.multiply(chains.p[some], t, out=gains)
        np.subtract(1.0, gains, out=gains)
        np.multiply(chains.mJ[some], t, out=masses)
        np.subtract(chains.m[some], masses, out=masses)
        factors = t, gains, masses, chains.r[some], pivots
        for stretched, gain, added, r, D in zip(*(values[::-1] for values in factors), strict=True):
            np.add(mu, r, out=D)
            np.multiply(D, stretched, out=D)
            np.subtract(1.0, D, out=D)
            if nudge:
                np.subtract(D, nudge, out=D)
            mu *= gain
            mu += added
            mu /= D
        below += np.add.reduce((pivots < 0).view(np.int8), axis=0, dtype=np.int8)
    return below, mu


def _arranged(block: Block, shape: tuple[int, int, int]) -> Chains:
    numbers = block.mass, block.length, block.centre, block.inertia
    return chains_of(*(values.reshape(block.n, *shape) for values in numbers))
