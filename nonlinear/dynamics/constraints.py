"""Pivots as constraints: every link free in the plane, held to the link above it or to the support.

Coordinates q = (x, z of the cart; x, z, θ of the centre of every link) with z down, the cart's left out on a fixed
support.  With u = (sin θ, cos θ) along a link, n = (cos θ, −sin θ) across it and e = l − c, link i hangs from h where

    g_i = r_h + e_h u_h − (r_i − c_i u_i) = 0,    G q' = g_i with r' for r and θ' n for u,    G q'' = γ,
    γ_i = e_h θ_h'² u_h + c_i θ_i'² u_i

The end of the support is the cart's centre, whose own constraint, the first, is z = 0.  Source: the constraints of
paper 000, section IV.B, corrected (`modal.symbolic.papers.cart_dae`), written link to link.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from modal.types import Floats, Ints
from nonlinear.system import State, System


@dataclass(frozen=True, eq=False)
class Pivots:
    """The constraints of a plane scene: 2L of them, and one more on a cart, on 3L coordinates, and two more."""

    system: System

    @cached_property
    def first(self) -> int:
        """Coordinates of the cart."""
        return 2 if self.system.cart else 0

    @cached_property
    def size(self) -> int:
        """Number of coordinates."""
        return self.first + 3 * self.system.n_links

    @cached_property
    def above(self) -> Ints:
        """The link that each link hangs from, −1 for the support, (L,)."""
        found = np.full(self.system.n_links, -1)
        for group in self.system.groups:
            found[group.index[1:]] = group.index[:-1]
        return found

    @cached_property
    def centre(self) -> Floats:
        """From the upper pivot to the centre of mass (m), (L,)."""
        return self.system.by_link("centre")

    @cached_property
    def rest(self) -> Floats:
        """From the centre of mass to the lower pivot (m), (L,)."""
        return self.system.by_link("length") - self.centre

    @cached_property
    def reach(self) -> float:
        """Length (m) of the longest pendulum, of which violations are fractions."""
        return max(float(group.block.length.sum(0).max()) for group in self.system.groups)

    def parts(self, q: Floats) -> tuple[Floats, Floats]:
        """Support (2,) and links (L, 3) in a vector of coordinates, of velocities or of accelerations."""
        support = q[:2] if self.first else np.zeros(2)
        return support, q[self.first :].reshape(-1, 3)

    def placed(self, state: State) -> tuple[Floats, Floats]:
        """Q and q' of a state, every constraint kept."""
        u, n = directions(state.links)
        q = self._hung(u, state.links, state.cart)
        return q, self._hung(state.link_rates[:, None] * n, state.link_rates, state.cart_rate)

    def _hung(self, arms: Floats, turns: Floats, cart: float) -> Floats:
        support = np.array([cart, 0.0])
        links = np.column_stack((arms, turns))
        for group in self.system.groups:
            own = arms[group.index]
            ends = np.cumsum(group.block.length[..., None] * own, axis=0)
            links[group.index, :2] = support + ends - self.rest[group.index][..., None] * own
        return np.concatenate((support[: self.first], links.ravel()))

    def gaps(self, q: Floats) -> Floats:
        """By how much the pivots stand open (m)."""
        support, links = self.parts(q)
        return self._apart(links[:, :2], directions(links[:, 2])[0], support)

    def opening(self, q: Floats, v: Floats) -> Floats:
        """G q', how fast the pivots open (m/s)."""
        support, rates = self.parts(v)
        n = directions(self.parts(q)[1][:, 2])[1]
        return self._apart(rates[:, :2], rates[:, 2:] * n, support)

    def gamma(self, angles: Floats, rates: Floats) -> Floats:
        """γ (m/s²), what G q'' must be for the pivots to stay closed."""
        arms = rates[:, None] ** 2 * directions(angles)[0]
        return self._apart(np.zeros_like(arms), arms, np.zeros(2))

    def _apart(self, middle: Floats, arms: Floats, support: Floats) -> Floats:
        ends = np.vstack((middle + self.rest[:, None] * arms, support))
        gaps = ends[self.above] - (middle - self.centre[:, None] * arms)
        return np.concatenate((support[self.first // 2 : self.first], gaps.ravel()))


def directions(angles: Floats) -> tuple[Floats, Floats]:
    """U along and n across every link as (along the rail, down), (L, 2) each."""
    sin, cos = np.sin(angles), np.cos(angles)
    return np.column_stack((sin, cos)), np.column_stack((cos, -sin))
