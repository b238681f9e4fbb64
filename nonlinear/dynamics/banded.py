"""Long chains in the plane: joint forces and accelerations from one symmetric banded system, solved by LAPACK.

With n across and u along a link (`nonlinear.dynamics.recursion`), f the force on it from the joint above, ã the
acceleration of that joint less gravity, α = l θ'', J = I + m c², and primes for the joint below,

    (m c/l) ã_n + (J/l²) α + f'_n = Q/l                     about the upper joint
    ã + α n − ã' = l ω² u                                   to the lower joint
    −f + m ã + (m c/l) α n + f' = m c ω² u                  the whole link

for one link after another, in the unknowns α, f', ã', each in the basis of its link: the change to the basis of the
next link needs only the sine and cosine of θ_i − θ_{i+1}.  Nothing is subtracted before LAPACK pivots and nothing is
divided by an inertia, so bobs (I = 0) need no special treatment; a massless phantom link with f' = 0 ends every chain.
The matrix is symmetric, with three diagonals on either side, once forces and the rows in kg are scaled by the link's
mass.  The pendula of a group follow one another in one band.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy

from modal.errors import ComputationError
from modal.types import Floats
from nonlinear.system import Group

REACH = 3
MIDDLE = 2 * REACH
TURN, FORCE_N, FORCE_U, END_N, END_U = range(5)
COSINES = ((FORCE_N, 2), (FORCE_U, 2), (END_N, -2), (END_U, -2))
SINES = ((FORCE_N, 3, 1.0), (FORCE_U, 1, -1.0), (END_N, -1, -1.0), (END_U, -3, 1.0))


class Banded:
    """A group of chains in the plane, as arrays (P, n); one factorization for the cart at rest and its acceleration."""

    def __init__(self, group: Group) -> None:
        block = group.block
        below = np.concatenate((block.mass[1:], block.mass[-1:]))
        lever, spin = group.static / block.length, group.moment / block.length**2
        self.m, self.l, self.mc, self.lever, self.spin, self.below = (
            np.ascontiguousarray(array.T) for array in (block.mass, block.length, group.static, lever, spin, below)
        )
        self.straight = self._without_bends()

    def _without_bends(self) -> Floats:
        """LAPACK's columns (P, n, 5, rows): the entry `down` rows below the diagonal is at MIDDLE + down."""
        band = np.zeros((*self.m.shape, 5, MIDDLE + REACH + 1))
        ratio = self.below / self.m
        band[..., TURN, MIDDLE] = self.spin / self.m
        band[..., TURN, MIDDLE + 1] = 1.0
        band[..., FORCE_N, MIDDLE - 1] = ratio
        band[:, 1:, TURN, MIDDLE - 2] = band[:, :-1, END_N, MIDDLE + 2] = (self.lever / self.m)[:, 1:]
        for force, end in ((FORCE_N, END_N), (FORCE_U, END_U)):
            band[:, 1:, force, MIDDLE - 3] = ratio[:, 1:]
            band[:, :-1, end, MIDDLE] = 1.0
            band[:, :-1, end, MIDDLE + 3] = 1.0
        return band

    def pull(self, angles: Any, rates: Any, moments: Any, gravity: float) -> tuple[Any, Any, Any]:
        """The effective mass (kg) and force (N) along the rail."""
        theta, squared, Q = angles.T, rates.T**2, moments.T
        sin, cos = np.sin(theta[:, 0]), np.cos(theta[:, 0])
        top = np.array(((gravity * sin, -gravity * cos), (cos, sin)))
        solution = self._solved(self._band(theta[:, :-1] - theta[:, 1:]), self._sides(squared, Q, top))
        turn, force_n, force_u = np.moveaxis(solution[:, :, 0, : FORCE_U + 1], -1, 0)
        across = self.m[:, 0] * top[:, 0] + self.lever[:, 0] * turn + self.below[:, 0] * force_n
        along = self.m[:, 0] * top[:, 1] + self.below[:, 0] * force_u
        along[0] -= self.mc[:, 0] * squared[:, 0]
        force, mass = np.sum(cos * across + sin * along, axis=1)
        return mass, force, solution[..., TURN] / self.l

    def turn(self, memory: Any, push: Any) -> Any:
        """θ'' (n, P)."""
        free, pushed = memory
        return (free + pushed * push).T

    def _band(self, bend: Floats) -> Floats:
        band, sine, cosine = self.straight.copy(), np.sin(bend), np.cos(bend)
        for column, down in COSINES:
            band[:, :-1, column, MIDDLE + down] = -cosine
            band[:, -1, column, MIDDLE + down] = -1.0
        for column, down, sign in SINES:
            band[:, :-1, column, MIDDLE + down] = sign * sine
        return band

    def _sides(self, squared: Floats, Q: Floats, top: Floats) -> Floats:
        """The right-hand sides (2, P, n, 5): cart at rest, and a cart acceleration of 1 m/s² alone."""
        sides = np.zeros((2, *self.straight.shape[:3]))
        sides[0, :, :, 0] = Q / (self.l * self.m)
        sides[0, :, :, 2] = self.l * squared
        sides[0, :, :-1, 4] = (self.mc / self.m * squared)[:, 1:]
        sides[:, :, 0, 0] -= (self.lever / self.m)[:, 0] * top[:, 0]
        sides[:, :, 0, 1:3] -= np.moveaxis(top, 1, 2)
        return sides

    @staticmethod
    def _solved(band: Floats, sides: Floats) -> Floats:
        columns, rows = band.reshape(-1, band.shape[-1]).T, sides.reshape(2, -1).T
        *_, solution, info = scipy.linalg.lapack.dgbsv(REACH, REACH, columns, rows, overwrite_ab=1, overwrite_b=1)
        if info:
            raise ComputationError(f"equation {info} of the chain's joint forces is singular in double precision")
        return np.asarray(solution.T.reshape(sides.shape))
