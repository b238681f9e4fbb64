"""The modes of a scene at one value of a parameter after another, each followed by its shape.

Shapes φ at one value and χ at the next are compared by the modal assurance criterion weighted with the mass matrix,

    MAC = (φᵀ M χ)² / ((φᵀ M φ)(χᵀ M χ)),        M the mean of the two mass matrices

(Allemang & Brown, Proc. 1st IMAC, 110 (1982)): 1 for one shape, 0 for different modes.  Where frequencies are equal to
within their error bounds only the space spanned by their shapes is meaningful; followed shapes are projected on it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from modal.errors import ComputationError
from modal.modes import UNCERTAIN, Modes, natural_modes, paired
from modal.scene import Scene
from modal.scene.parameters import vary
from modal.types import Floats, Ints

MOST_MODES = 400
SURE = 0.97
"""The MAC above which a mode is identified with the previous one: its shape has turned by less than 10°."""


@dataclass(frozen=True, eq=False)
class LociPoint:
    """All R modes at one value of the parameter, one for each independent shape.

    `omega` (R,) in rad/s; `shapes` (planes, n, R) with φᵀMφ = 1 over the coordinates of `M` (n, n), along the rail and,
    in space, across it; `group` (R,): modes of one number have frequencies that error bounds cannot separate; `row`
    (R,) is the row of each in the table there, from 0.
    """

    value: float
    omega: Floats
    shapes: Floats
    group: Ints
    row: Ints
    M: Floats

    def reordered(self, order: Ints, shapes: Floats) -> LociPoint:
        """The same modes in another order, with shapes that span the same spaces."""
        return replace(self, omega=self.omega[order], group=self.group[order], row=self.row[order], shapes=shapes)


def solve_at(scene: Scene, path: str, value: float) -> LociPoint:
    """The modes of the scene with this value at a path, in ascending order.

    Raises ComputationError for damped or growing modes, uncertain ones and more than MOST_MODES.
    """
    here = vary(scene, {path: value})
    size = here.n_links * (2 if here.space == "space" else 1) + 1
    if size > MOST_MODES:
        raise ComputationError(f"{size} modes are too many to follow by their shapes; the limit is {MOST_MODES}")
    modes = natural_modes(here)
    where = f"at {path} = {value:.6g}"
    if np.any(modes.error >= UNCERTAIN):
        raise ComputationError(f"{where} some modes are beyond double precision")
    if np.any(modes.eigenvalue.real):
        raise ComputationError(
            f"{where} some modes decay or grow: loci need an undamped scene about a stable equilibrium"
        )
    fold = modes.multiplicity
    group, row = (np.repeat(each, fold) for each in (_groups(modes), np.arange(len(modes))))
    return LociPoint(value, np.repeat(modes.omega, fold), _shapes(modes), group, row, modes.matrices.M)


def _groups(modes: Modes) -> Ints:
    """A number for every distinct frequency (R,), equal where the next is no further away than the error bounds."""
    bound = modes.error * modes.omega
    apart = np.diff(modes.omega) > bound[1:] + bound[:-1]
    return np.concatenate(([0], np.cumsum(apart)))


def _shapes(modes: Modes) -> Floats:
    """Φ (planes, n, R): the part of every shape along the rail and, in space, the part across it."""
    phi, planes = modes.matrix.real, 2 if modes.rig.spatial else 1
    return np.array([phi.shapes * (phi.across == plane) for plane in range(planes)])


def overlaps(before: LociPoint, after: LociPoint) -> Floats:
    """φᵀMχ of unit shapes: (R, R'), rows for the modes of `after`, columns for those of `before`."""
    M = (before.M + after.M) / 2
    left, right = (
        shapes / np.sqrt(np.sum(shapes * (M @ shapes), axis=(0, 1))) for shapes in (after.shapes, before.shapes)
    )
    return np.asarray(np.sum(left.swapaxes(1, 2) @ M @ right, axis=0))


def follow(before: LociPoint, after: LociPoint) -> tuple[LociPoint, bool]:
    """The modes of `after` in the order of `before`, with signs and bases aligned to it; and whether this is certain.

    Raises ComputationError where the number of modes has changed.
    """
    if before.omega.size != after.omega.size:
        raise ComputationError(f"the number of modes changes between {before.value:.6g} and {after.value:.6g}")
    overlap = overlaps(before, after)
    names, members = np.unique(after.group, return_inverse=True)
    shares = np.zeros((names.size, after.omega.size))
    np.add.at(shares, members, overlap**2)
    best, free = np.argmax(shares, axis=0), np.bincount(members)
    sure = bool(np.all(shares.max(axis=0) >= SURE) and np.array_equal(np.bincount(best, minlength=names.size), free))
    chosen = best if sure else paired(shares.T, free)
    order, shapes = np.zeros_like(members), np.zeros_like(after.shapes)
    for number in range(names.size):
        rows, tracks = np.flatnonzero(members == number), np.flatnonzero(chosen == number)
        order[tracks] = rows
        shapes[..., tracks] = after.shapes[..., rows] @ _turn(before, after, rows, tracks)
    return after.reordered(order, shapes), sure


def _turn(before: LociPoint, after: LociPoint, rows: Ints, tracks: Ints) -> Floats:
    """The rotation (G, G) of a group's shapes that aligns them with the followed ones, projected on their span."""
    M, basis = (before.M + after.M) / 2, after.shapes[..., rows]
    products = (np.sum(basis.swapaxes(1, 2) @ M @ s, axis=0) for s in (basis, before.shapes[..., tracks]))
    left, _, right = np.linalg.svd(np.linalg.solve(*products))
    return np.asarray(left @ right)
