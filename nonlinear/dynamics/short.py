"""Short chains in the plane: every pendulum's A cos(θ_i − θ_j) as a small dense matrix, all of them solved at once.

    Σ_j A_ij [cos(θ_i − θ_j) θ_j'' + sin(θ_i − θ_j) θ_j'²] + b_i cos θ_i x'' + g b_i sin θ_i = Q_i

is solved for θ_i'' at rest of the cart and for its answer to x'' = 1.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from modal import pair
from modal.errors import ComputationError
from nonlinear.dynamics.dense import SINGULAR
from nonlinear.system import Group


class Dense:
    """A group of short chains; the cart feels Σ b cos θ θ'' less what the swinging throws out."""

    def __init__(self, group: Group) -> None:
        block = group.block
        A = pair.inertia_matrix(block.mass, block.length, block.centre, block.inertia)
        self.A = np.ascontiguousarray(np.moveaxis(np.array(A), 2, 0))
        self.b = block.b.T
        self.mass = float(block.mass.sum())

    def pull(self, angles: Any, rates: Any, moments: Any, gravity: float) -> tuple[Any, Any, Any]:
        """The effective mass (kg) and force (N) along the rail."""
        theta, squared = angles.T, rates.T**2
        apart = theta[:, :, None] - theta[:, None, :]
        across, along = self.b * np.cos(theta), self.b * np.sin(theta)
        thrown = (self.A * np.sin(apart)) @ squared[..., None]
        sides = np.stack((moments.T - gravity * along - thrown[..., 0], across), axis=-1)
        try:
            free, pushed = np.moveaxis(np.linalg.solve(self.A * np.cos(apart), sides), -1, 0)
        except np.linalg.LinAlgError:
            raise ComputationError(SINGULAR) from None
        force = np.sum(across * free) - np.sum(along * squared)
        return self.mass - np.sum(across * pushed), force, (free, pushed)

    def turn(self, memory: Any, push: Any) -> Any:
        """θ'' (n, P)."""
        free, pushed = memory
        return (free - pushed * push).T
