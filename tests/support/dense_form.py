"""The equations of motion of a plane scene as one dense matrix, from the pair, solved by LAPACK: an oracle.

M_ij = A_ij cos(θ_i − θ_j),   M_0i = b_i cos θ_i,   M_00 = m_c + Σ m
M (x'', θ'') = (F + Σ b_i sin θ_i θ_i'²,  Q_i − g b_i sin θ_i − Σ_j A_ij sin(θ_i − θ_j) θ_j'²)
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import scipy

from modal import pair
from modal.types import Floats
from nonlinear.dynamics import Minimal


@dataclass(frozen=True, eq=False)
class DenseForm(Minimal):
    """The equations of `Minimal` without its bodies, for one y at a time."""

    bodies: tuple[()] = ()

    @cached_property
    def arrays(self) -> tuple[Floats, Floats]:
        """A (L, L), zero between pendula, and b (L,)."""
        size = self.system.n_links
        A, b = np.zeros((size, size)), np.zeros(size)
        for group in self.system.groups:
            block = group.block
            inertia = np.array(pair.inertia_matrix(block.mass, block.length, block.centre, block.inertia))
            for column, places in enumerate(group.index.T):
                A[np.ix_(places, places)] = inertia[..., column]
            b[group.index] = block.b
        return A, b

    def derivative(self, time: float, y: Any) -> Any:
        """The time derivative of one y, (size,)."""
        (A, b), system, layout = self.arrays, self.system, self.layout
        first, half = layout.first, layout.half
        angles, squared = y[first:half], y[half + first : 2 * half] ** 2
        apart = angles[:, None] - angles
        M, force, slopes = np.empty((half, half)), np.empty(half), np.zeros(y.size)
        M[first:, first:] = A * np.cos(apart)
        for group in system.groups:
            turn = np.eye(group.n) - np.eye(group.n, k=-1)
            for places, rotor in zip(first + group.index.T, group.block.rotor.T, strict=True):
                M[np.ix_(places, places)] += turn.T @ np.diag(rotor) @ turn
        instant = self.inputs.at(time, y, layout)
        (Q, power), (along, down) = self.forces(y, instant), instant.support
        weight = b * ((system.gravity - down) * np.sin(angles) + along * np.cos(angles))
        force[first:] = Q[first:] - weight - (A * np.sin(apart)) @ squared
        if system.cart:
            M[0, 0], M[0, 1:] = system.cart.mass + float(system.mass.sum()), b * np.cos(angles)
            M[1:, 0], force[0] = M[0, 1:], Q[0] + (b * np.sin(angles)) @ squared
        slopes[:half] = y[half : 2 * half]
        slopes[half : 2 * half] = scipy.linalg.solve(M, force, assume_a="pos")
        if layout.works:
            slopes[-1] = power
        return slopes
