"""Small scenes in the plane: one dense matrix of everything, which for a few links beats every cleverer form.

M_ij = A_ij cos(θ_i − θ_j),   M_0i = b_i cos θ_i,   M_00 = m_c + Σ m
M (x'', θ'') = (F + Σ b_i sin θ_i θ_i'²,  Q_i − g b_i sin θ_i − Σ_j A_ij sin(θ_i − θ_j) θ_j'²)
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from modal import pair
from modal.errors import ComputationError
from modal.types import Floats
from nonlinear.dynamics import efforts
from nonlinear.dynamics.minimal import Minimal
from nonlinear.dynamics.suspended import NOTHING

SINGULAR = "the mass matrix is singular in double precision"


@dataclass(frozen=True, eq=False)
class Small(Minimal):
    """The equations of `Minimal` without its bodies, for one y at a time."""

    bodies: tuple[()] = ()

    @cached_property
    def _pair(self) -> tuple[Floats, Floats]:
        """A (L, L), zero between pendula, and b (L,), in the order of the file."""
        size = self.system.n_links
        A, b = np.zeros((size, size)), np.zeros(size)
        for group in self.system.groups:
            block = group.block
            inertia = np.array(pair.inertia_matrix(block.mass, block.length, block.centre, block.inertia))
            for column, places in enumerate(group.index.T):
                A[np.ix_(places, places)] = inertia[..., column]
            b[group.index] = block.b
        return A, b

    @cached_property
    def _acts(self) -> bool:
        """Whether anything acts besides gravity."""
        cart, groups = self.system.cart, self.system.groups
        held = cart is not None and (cart.stiffness or cart.damping)
        return bool(held or self.load or any(group.hinged for group in groups))

    @cached_property
    def _total(self) -> float:
        return (self.system.cart.mass if self.system.cart else 0.0) + float(self.system.mass.sum())

    def derivative(self, time: float, y: Any) -> Any:
        """The rate of one y, (size,)."""
        layout, (A, b) = self.layout, self._pair
        first, half = int(layout.on_cart), layout.half
        angles, squared = y[first:half], y[half + first : 2 * half] ** 2
        sin, cos = np.sin(angles), np.cos(angles)
        turned = sin[:, None] * cos
        M, force, found = np.empty((half, half)), np.empty(half), np.zeros_like(y)
        M[first:, first:] = A * (cos[:, None] * cos + sin[:, None] * sin)
        force[first:] = -self.system.gravity * b * sin - (A * (turned - turned.T)) @ squared
        if first:
            M[0, 0], M[0, 1:] = self._total, b * cos
            M[1:, 0], force[0] = M[0, 1:], (b * sin) @ squared
        found[:half] = y[half : 2 * half]
        if self._acts:
            self._push(time, y, force, found)
        try:
            found[half : 2 * half] = np.linalg.solve(M, force)
        except np.linalg.LinAlgError:
            raise ComputationError(SINGULAR) from None
        return found

    def _push(self, time: float, y: Floats, force: Floats, found: Floats) -> None:
        """Add what springs, dampers and loads do."""
        first, state = int(self.layout.on_cart), self.layout.state(y)
        push = self.load(time, state) if self.load else NOTHING
        force[first:] += efforts.on_links(self.system, state, push)
        if first:
            force[0] += efforts.on_cart(self.system, state, push)
        if self.layout.works:
            found[-1] = efforts.power(self.system, state, push)
