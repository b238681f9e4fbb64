"""Counts of modes of coordinates whose springs form a tree, with plain chains on each: every digit.

A coordinate η with its own spring k and mass m, on which chains hang that move by h η, has the dynamic stiffness

    s = k − x (m + Σ h² μ(x)) + Σ α² κ s'/(β² κ + s')

of x = ω² and the effective masses μ of `modal.eigen.recursion`; the last sum is over the springs κ (α η − β η')² to
coordinates η' further from the root.  The number of modes below x is that of chains' D < 0, of β²κ + s' < 0 and of
s < 0 at the root (Sylvester's law of inertia).  Every rounding is one of a number of the scene.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from modal.eigen.bisection import located
from modal.eigen.sturm import Chains, count_and_mass
from modal.types import Floats, Ints

NUDGE = 2.0**-60
"""An exact zero of a pivot becomes minus this fraction of its terms."""
LOWER = 2.0**-48
"""Factor by which a trial value is lowered until no mode is below it."""


@dataclass(frozen=True, eq=False)
class Tree:
    """Coordinates, the root first and each after its `parent` (N,), −1 of the root.

    `stiffness` and `mass` (N,) are their own, `spring`, `near` and `far` (N,) are κ, α at the parent and β.  Chains
    hang in groups, h² copies of each folded into their masses, with the coordinate of each, (P,).
    """

    parent: Ints
    stiffness: Floats
    mass: Floats
    spring: Floats
    near: Floats
    far: Floats
    chains: tuple[tuple[Chains, Ints], ...]

    @property
    def free(self) -> int:
        """1 if nothing holds it."""
        return int(not self.stiffness.any())

    @property
    def size(self) -> int:
        """Number of coordinates with those of the chains."""
        return len(self.parent) + sum(chains.size for chains, _ in self.chains)

    def count(self, x: Floats) -> Ints:
        """The number of modes with 0 < ω² < x, (R, 1) as x."""
        trial = x[:, 0]
        s, total = np.zeros((len(self.parent), len(trial))), np.full(len(trial), -self.free)
        for chains, places in self.chains:
            below, mass = count_and_mass(chains, x)
            total += below[:, :, 0].sum(0)
            np.add.at(s, places, mass[:, :, 0])
        passed = np.zeros_like(s)
        for i in reversed(range(len(s))):
            inertia = trial * (self.mass[i] + s[i])
            own = self.stiffness[i] - inertia + passed[i]
            near, far = self.spring[i] * self.near[i] ** 2, self.spring[i] * self.far[i] ** 2
            size = self.stiffness[i] + np.abs(inertia) + np.abs(passed[i]) + far
            pivot = far + own
            pivot = np.where(pivot == 0, -NUDGE * size, pivot)
            total += pivot < 0
            if self.parent[i] >= 0:
                passed[self.parent[i]] += near * (own / pivot)
        return total[:, None]

    def take(self, supports: Ints | slice) -> Tree:
        """The tree itself: it is one problem."""
        return self

    @cached_property
    def low(self) -> Floats:
        """A trial value (1,) below all modes."""
        held = np.concatenate([self.stiffness, self.spring, *((1 / c.inverse).ravel() for c, _ in self.chains)])
        heavy = np.concatenate([self.mass, *(c.m.ravel() for c, _ in self.chains)])
        found = np.array([[held[held > 0].min() / heavy.sum()]])
        while self.count(found)[0, 0] > 0 and found[0, 0] > 0:
            found = found * LOWER
        return np.asarray(found[0])

    def squares(self, lowest: int | None) -> Floats:
        """All ω² > 0, ascending, or the lowest of them."""
        modes = self.size - self.free
        wanted = np.arange(modes)[:lowest]
        return located(self, wanted, modes)[:, 0] if modes else np.zeros(0)
