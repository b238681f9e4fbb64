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

from collections.abc import Sequence
from typing import Any

import numpy as np
import scipy

from modal.errors import ComputationError
from modal.types import Floats
from nonlinear.dynamics.minimal import Projection
from nonlinear.system import Group

REACH = 3
MIDDLE = 2 * REACH
TURN, FORCE_N, FORCE_U, END_N, END_U = range(5)
COSINES = ((FORCE_N, 2), (FORCE_U, 2), (END_N, -2), (END_U, -2))
SINES = ((FORCE_N, 3, 1.0), (FORCE_U, 1, -1.0), (END_N, -1, -1.0), (END_U, -3, 1.0))


class Banded:
    """A group of chains in the plane, as arrays (P, n); one factorization for all motions of its first joints."""

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

    def response(self, angles: Any, rates: Any, torques: Any) -> Projection:
        """What the pendula answer to motions of their first joints."""
        return Linked(self, angles.T, rates.T**2, torques.T)

    def band(self, columns: Any, bend: Floats) -> Floats:
        """The matrix of the pendula in these columns at relative angles (P, n − 1)."""
        band: Floats = self.straight[columns].copy()
        sine, cosine = np.sin(bend), np.cos(bend)
        for column, down in COSINES:
            band[:, :-1, column, MIDDLE + down] = -cosine
            band[:, -1, column, MIDDLE + down] = -1.0
        for column, down, sign in SINES:
            band[:, :-1, column, MIDDLE + down] = sign * sine
        return band

    def sides(self, columns: Any, squared: Floats, Q: Floats, tops: Floats) -> Floats:
        """The right-hand sides (1 + d, P, n, 5) where first joints have accelerations `tops` (1 + d, 2, P) alone.

        They are along their links' n and u; the first also has rates, `squared`, and torques Q.
        """
        mass, lever, ratio = self.m[columns], self.lever[columns], (self.mc / self.m)[columns]
        sides = np.zeros((len(tops), *mass.shape, 5))
        sides[0, :, :, 0] = Q / (self.l[columns] * mass)
        sides[0, :, :, 2] = self.l[columns] * squared
        sides[0, :, :-1, 4] = (ratio * squared)[:, 1:]
        sides[:, :, 0, 0] -= (lever / mass)[:, 0] * tops[:, 0]
        sides[:, :, 0, 1:3] -= np.moveaxis(tops, 1, 2)
        return sides

    @staticmethod
    def solved(band: Floats, sides: Floats) -> Floats:
        """The unknowns, (1 + d, P, n, 5)."""
        columns, rows = band.reshape(-1, band.shape[-1]).T, sides.reshape(len(sides), -1).T
        *_, solution, info = scipy.linalg.lapack.dgbsv(REACH, REACH, columns, rows, overwrite_ab=1, overwrite_b=1)
        if info:
            raise ComputationError(f"equation {info} of the chain's joint forces is singular in double precision")
        return np.asarray(solution.T.reshape(sides.shape))


class Linked:
    """A group at angles (P, n), squared rates and torques, by the forces at its first joints."""

    def __init__(self, body: Banded, angles: Floats, squared: Floats, torques: Floats) -> None:
        self.body, self.angles, self.squared, self.torques = body, angles, squared, torques
        self.solutions: list[tuple[Any, Floats]] = []

    def projected(self, columns: Any, slopes: Sequence[Any], felt: tuple[Any, Any], together: bool) -> Any:
        """The inertia (lower half) and the force on each coordinate of what carries the pendula in these columns."""
        body, theta, squared = self.body, self.angles[columns], self.squared[columns]
        sin, cos = np.sin(theta[:, 0]), np.cos(theta[:, 0])
        tops = np.array([(cos * x - sin * z, sin * x + cos * z) for x, z in (felt, *slopes)])
        sides = body.sides(columns, squared, self.torques[columns], tops)
        solution = body.solved(body.band(columns, theta[:, :-1] - theta[:, 1:]), sides)
        self.solutions.append((columns, solution[..., TURN] / body.l[columns]))
        turn, force_n, force_u = np.moveaxis(solution[:, :, 0, : FORCE_U + 1], -1, 0)
        mass, lever, below = body.m[columns, 0], body.lever[columns, 0], body.below[columns, 0]
        across = mass * tops[:, 0] + lever * turn + below * force_n
        along = mass * tops[:, 1] + below * force_u
        along[0] -= body.mc[columns, 0] * squared[:, 0]
        forces = list(zip(cos * across + sin * along, cos * along - sin * across, strict=True))
        block = [[(v * fx + w * fz).sum(0) for v, w in slopes[: k + 1]] for k, (fx, fz) in enumerate(forces[1:])]
        return block, [(x * forces[0][0] + z * forces[0][1]).sum(0) for x, z in slopes]

    def fall(self, pushes: Sequence[Sequence[Any]], accelerations: Any) -> Any:
        """θ'' (n, P)."""
        turns = np.empty_like(self.angles)
        for (columns, (free, *pushed)), push in zip(self.solutions, pushes, strict=True):
            turns[columns] = free + sum(each * size for each, size in zip(pushed, push, strict=True))
        return turns.T
