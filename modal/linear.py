"""M, K and D about a scene's rest, written out: for printing, for small dense problems and for oracles.

    M = [[M_tot, σ_i b_i], [σ_i b_i, σ_i σ_j A_ij]],   K = diag(k_c, g σ_i b_i) + torsion springs,
    D = diag(c_c, 0) + joint dampers

over the coordinates x (on a cart), then the absolute angle of every link from its rest, pendulum by pendulum, top to
bottom; σ_i is 1 for a link that hangs and −1 for one that stands.  A spring or damper at a joint acts on the
difference of two neighbouring angles, the spring being relaxed at the rest.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from modal import pair
from modal.errors import ComputationError
from modal.rig import Block, CartNumbers, Floats, Rig, rig_of
from modal.scene import Scene

LARGEST_DENSE = 4000


@dataclass(frozen=True, eq=False)
class Matrices:
    """Symmetric M, K and D of one plane, with the name of each coordinate (units: m for x, rad for angles)."""

    M: Floats
    K: Floats
    D: Floats
    labels: tuple[str, ...]


def matrices(scene: Scene) -> Matrices:
    """M (kg, kg m, kg m²), K and D of the whole scene, in SI units.

    In space these describe the motion along the rail; across it a cart is a fixed support.
    Raises ComputationError beyond LARGEST_DENSE coordinates.
    """
    size = scene.n_links + (scene.support.kind == "cart")
    if size > LARGEST_DENSE:
        raise ComputationError(
            f"M, K and D would be dense {size} × {size} matrices: at most {LARGEST_DENSE} coordinates are written out"
        )
    rig = rig_of(scene)
    columns = [(rig.blocks[block], column) for block, column, copies in rig.members for _ in range(copies)]
    return Matrices(*assembled(columns, rig.cart, rig.gravity), labels=coordinate_labels(rig))


def coordinate_labels(rig: Rig) -> tuple[str, ...]:
    """`x`, then `theta[pendulum,link]`, both counted from 1 with copies counted out."""
    links = [rig.blocks[block].n for block, _, copies in rig.members for _ in range(copies)]
    angles = [f"theta[{p},{i}]" for p, n in enumerate(links, 1) for i in range(1, n + 1)]
    return (*(["x"] if rig.cart else []), *angles)


def assembled(
    columns: list[tuple[Block, int]], cart: CartNumbers | None, gravity: float
) -> tuple[Floats, Floats, Floats]:
    """(M, K, D) of a cart or (None) a fixed support with one pendulum for each (block, column)."""
    first = 1 if cart else 0
    size = first + sum(block.n for block, _ in columns)
    M, K, D = (np.zeros((size, size)) for _ in range(3))
    at = first
    for block, column in columns:
        own = slice(at, at + block.n)
        geometry = (block.mass, block.length, block.centre, block.inertia)
        sigma = block.sigma[:, column]
        M[own, own] = pair.inertia_matrix(*(values[:, column].tolist() for values in geometry))
        M[own, own] *= np.outer(sigma, sigma)
        K[own, own] = np.diag(gravity * sigma * block.b[:, column]) + _on_joints(block.stiffness[:, column])
        D[own, own] = _on_joints(block.damping[:, column])
        if cart:
            M[0, own] = M[own, 0] = sigma * block.b[:, column]
            M[0, 0] += block.mass[:, column].sum()
        at += block.n
    if cart:
        M[0, 0] += cart.mass
        D[0, 0], K[0, 0] = cart.damping, cart.stiffness
    return M, K, D


def _on_joints(strength: Floats) -> Floats:
    """Σ s_i (θ_i − θ_{i−1})²/2 as a tridiagonal matrix, with θ_0 = 0 at the support."""
    relative = np.eye(len(strength)) - np.eye(len(strength), k=-1)
    return relative.T @ (strength[:, None] * relative)
