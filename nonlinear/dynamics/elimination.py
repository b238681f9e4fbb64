"""Chains in the plane without the recursion: short ones by dense matrices, long ones by one band.

The dense matrices of all pendula of a group at once are eliminated from the tips up:

    Σ_j A_ij [cos(θ_i − θ_j) θ_j'' + sin(θ_i − θ_j) θ_j'²] + b_i n_i·ã = Q_i,   n = (cos θ, −sin θ)

is solved for θ_i'' where the first joint has the acceleration ã, and for the response to each coordinate of what
carries it.  Where the length l of a rope changes, θ'' + 2 l' θ'/l stands for θ'' and θ'² − l''/l for θ'².  Few
links take fewer operations so than by the recursion, many would take more: the equations of short chains are written
out from it (`nonlinear.dynamics.forms`).

Joint forces and accelerations of long chains are the solution of one symmetric banded system, by LAPACK.  With n across
and u along a link (`nonlinear.dynamics.recursion`), f the force on it from the joint above, ã the acceleration of that
joint less gravity, α = l θ'', J = I + m c², and primes for the joint below,

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

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
import scipy

from modal import pair
from modal.errors import ComputationError
from modal.types import Floats
from nonlinear.dynamics.forces import relative
from nonlinear.dynamics.minimal import Projection
from nonlinear.system import Group, System

CART_RATIO_MIN = 1e-2
"""Tolerance: cart mass over suspended mass below which the dense form would lose digits."""
LINK_RATIO_MIN = 1e-3
"""Tolerance: mass of a link over that of a heavier one below it, or inertia over J, under which digits are lost."""
SINGULAR = "the mass matrix is singular in double precision"


def loses_digits(group: Group, system: System) -> bool:
    """Whether a support, a link above a heavier one or next to a rotor is so light that dense matrices lose digits."""
    heaviest = np.maximum.accumulate(group.block.mass[::-1])[::-1]
    least = CART_RATIO_MIN * sum(part.block.mass.sum((0, 1)) for part in system.groups)
    carriers = [carrier for carrier in system.suspension.carriers if carrier.size]
    light = any(carrier.M is not None or np.any(carrier.mass < least) for carrier in carriers)
    heavy_rotors = np.any(group.block.diagonal < LINK_RATIO_MIN * group.block.rotor)
    return bool(light or np.any(group.block.mass < LINK_RATIO_MIN * heaviest) or heavy_rotors)


class Elimination:
    """A group of short chains, as arrays (n, P) of any type."""

    def __init__(self, group: Group, winding: Any = None) -> None:
        block = group.block
        self.A = np.array(pair.inertia_matrix(block.mass, block.length, block.centre, block.inertia))
        self.b, self.masses, self.length, self.winding = block.b, block.mass.sum(0), block.length, winding
        self.rotor: Any = block.rotor if group.has_rotors else None

    def square_rates(self, rates: Any, columns: Any = slice(None)) -> Any:
        """θ'², less l''/l where lengths change."""
        squares = rates * rates
        return squares if self.winding is None else squares - self.winding[1][:, columns] / self.length[:, columns]

    def unwound(self, rates: Any, turns: Any, columns: Any = slice(None)) -> Any:
        """θ'' (n, P) from θ'' + 2 l' θ'/l."""
        if self.winding is None:
            return turns
        return turns - 2.0 * self.winding[0][:, columns] * rates / self.length[:, columns]

    @staticmethod
    def equations(
        A: Any, s: Any, c: Any, ww: Any, side: list[Any], rotor: Any = None
    ) -> tuple[list[list[Any]], list[Any]]:
        """The lower half of A cos(θ_i − θ_j) of some pendula, and the right-hand side from their torques `side`.

        The reflected inertias `rotor` of joints are in the matrix, too.
        """
        M: list[list[Any]] = []
        for i, row in enumerate(A):
            M.append([row[j] * (c[i] * c[j] + s[i] * s[j]) for j in range(i)])
            M[i].append(row[i] + 0.0 * s[i])
            for j in range(i):
                thrown = row[j] * (s[i] * c[j] - c[i] * s[j])
                side[i], side[j] = side[i] - thrown * ww[j], side[j] + thrown * ww[i]
        for i, inertia in enumerate([] if rotor is None else rotor):
            M[i][i] = M[i][i] + inertia
            if i:
                M[i - 1][i - 1], M[i][i - 1] = M[i - 1][i - 1] + inertia, M[i][i - 1] - inertia
        return M, side

    def _substitute(self, M: list[list[Any]], right: Iterable[Any]) -> list[Any]:
        """θ'' from the eliminated equations and their remaining right-hand sides."""
        solution: list[Any] = []
        for row, side in zip(M, right, strict=True):
            value = side
            for entry, value_above in zip(row, solution, strict=False):
                value = value - entry * value_above
            solution.append(value / row[-1])
        return solution

    def response(self, angles: Any, rates: Any, torques: Any) -> Projection:
        """The reactions of the pendula to motions of their first joints."""
        return Eliminated(self, angles, rates, torques)


class Eliminated:
    """Pendula on supports, with n across a link, u along it, slopes j_k of first joints and their acceleration ã.

    M_kl = Σ m j_k·j_l − a_kᵀ M⁻¹ a_l,   force_k = Σ m j_k·ã − Σ b u·j_k θ'² + a_kᵀ M⁻¹ (Q − b n·ã),   a_k = b n·j_k
    """

    def __init__(self, body: Elimination, angles: Any, rates: Any, torques: Any) -> None:
        self.body, self.parts = body, (angles, rates, torques)
        self.solutions: list[tuple[Any, Any]] = []

    def project_on_carrier(self, columns: Any, slopes: Sequence[Any], bias: tuple[Any, Any], move_alike: bool) -> Any:
        """The lower half of M_kl and force_k of the pendula in these columns, summed."""
        body, (angles, rates, torques) = self.body, (part[:, columns] for part in self.parts)
        A, b, mass = body.A[:, :, columns], body.b[:, columns], body.masses[columns]
        s, c, ww = np.sin(angles), np.cos(angles), body.square_rates(rates, columns)
        rotor: Any = None if body.rotor is None else body.rotor[:, columns]
        turning, slopes = [turn for *_, turn in slopes], [slope[:2] for slope in slopes]
        M, side = body.equations(A, s, c, ww, list(torques - (b * bias[0]) * c + (b * bias[1]) * s), rotor)
        couplings = [list(b * (c * x - s * z)) for x, z in slopes]
        thrown, counts = b * ww, range(len(slopes))
        force = [-(thrown * (s * x + c * z)).sum(0) for x, z in slopes]
        for k, turn in enumerate(turning) if rotor is not None else ():
            couplings[k][0] = couplings[k][0] - turn * rotor[0]
        if rotor is not None and body.winding is not None:
            excess = -body.unwound(rates, 0.0 * rates, columns)
            torques_of_rotors = rotor * relative(excess)
            for i, torque in enumerate(torques_of_rotors):
                side[i] = side[i] + torque
                if i:
                    side[i - 1] = side[i - 1] - torque
            force = [value + turn * torques_of_rotors[0] for value, turn in zip(force, turning, strict=True)]
        reductions: list[list[Any]] = [[0.0] * (k + 1) for k in counts]
        for k in reversed(range(len(M))):
            for j in range(k):
                share = M[k][j] / M[k][k]
                for i in range(j + 1):
                    M[j][i] = M[j][i] - share * M[k][i]
                side[j] = side[j] - share * side[k]
                for column in couplings:
                    column[j] = column[j] - share * column[k]
            for i, column in enumerate(couplings):
                share = column[k] / M[k][k]
                for j in range(i + 1):
                    reductions[i][j] = reductions[i][j] + share * couplings[j][k]
                force[i] = force[i] + share * side[k]
        self.solutions.append((columns, (M, side, couplings)))
        if move_alike:
            mass = mass.sum(0, keepdims=True)
        block = [
            [(mass * (x * v + z * w)).sum(0) - reductions[k][j].sum(0) for j, (v, w) in enumerate(slopes[: k + 1])]
            for k, (x, z) in enumerate(slopes)
        ]
        for k, turn in enumerate(turning) if rotor is not None else ():
            block[k][k] = block[k][k] + turn * (rotor[0] + 0.0 * s[0]).sum(0)
        return block, [
            (mass * (x * bias[0] + z * bias[1])).sum(0) + parts.sum(0)
            for (x, z), parts in zip(slopes, force, strict=True)
        ]

    def fall(self, pushes: Sequence[Sequence[Any]], accelerations: Any) -> Any:
        """θ'' (n, P, ...) under second derivatives of each bundle's coordinates."""
        turns = np.empty_like(self.parts[0])
        for (columns, (M, side, couplings)), push in zip(self.solutions, pushes, strict=True):
            sides = list(side)
            for column, acceleration in zip(couplings, push, strict=True):
                sides = [entry - part * acceleration for entry, part in zip(sides, column, strict=True)]
            turns[:, columns] = np.array(self.body._substitute(M, sides))
        return self.body.unwound(self.parts[1], turns)


MIDDLE = 6
"""Format: rows above the diagonal in LAPACK's columns of a band that reaches 3 to each side."""
TURN, FORCE_N, FORCE_U, END_N, END_U = range(5)
COSINES = ((FORCE_N, 2), (FORCE_U, 2), (END_N, -2), (END_U, -2))
SINES = ((FORCE_N, 3, 1.0), (FORCE_U, 1, -1.0), (END_N, -1, -1.0), (END_U, -3, 1.0))


class Banded:
    """A group of chains in the plane, as arrays (P, n); one factorization for all motions of its first joints."""

    def __init__(self, group: Group) -> None:
        block = group.block
        mass_below = np.concatenate((block.mass[1:], block.mass[-1:]))
        lever, spin = group.static / block.length, group.moment / block.length**2
        self.m, self.l, self.mc, self.lever, self.spin, self.below = (
            np.ascontiguousarray(array.T) for array in (block.mass, block.length, group.static, lever, spin, mass_below)
        )
        self.straight = self._without_bends()

    def _without_bends(self) -> Floats:
        """LAPACK's columns (P, n, 5, rows): the entry `down` rows below the diagonal is at MIDDLE + down."""
        band = np.zeros((*self.m.shape, 5, MIDDLE + 4))
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
        """The reactions of the pendula to motions of their first joints."""
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

    def sides(self, columns: Any, squares: Floats, Q: Floats, tops: Floats) -> Floats:
        """The right-hand sides (1 + d, P, n, 5) where first joints have accelerations `tops` (1 + d, 2, P) alone.

        They are along their links' n and u; the first also has rates, `squares`, and torques Q.
        """
        mass, lever, ratio = self.m[columns], self.lever[columns], (self.mc / self.m)[columns]
        sides = np.zeros((len(tops), *mass.shape, 5))
        sides[0, :, :, 0] = Q / (self.l[columns] * mass)
        sides[0, :, :, 2] = self.l[columns] * squares
        sides[0, :, :-1, 4] = (ratio * squares)[:, 1:]
        sides[:, :, 0, 0] -= (lever / mass)[:, 0] * tops[:, 0]
        sides[:, :, 0, 1:3] -= np.moveaxis(tops, 1, 2)
        return sides

    @staticmethod
    def solve_band(band: Floats, sides: Floats) -> Floats:
        """The unknowns, (1 + d, P, n, 5)."""
        columns, rows = band.reshape(-1, band.shape[-1]).T, sides.reshape(len(sides), -1).T
        *_, solution, info = scipy.linalg.lapack.dgbsv(3, 3, columns, rows, overwrite_ab=1, overwrite_b=1)
        if info:
            raise ComputationError(f"equation {info} of the chain's joint forces is singular in double precision")
        return np.asarray(solution.T.reshape(sides.shape))


class Linked:
    """A group at angles (P, n), squared rates and torques, by the forces at its first joints."""

    def __init__(self, body: Banded, angles: Floats, squares: Floats, torques: Floats) -> None:
        self.body, self.angles, self.squared, self.torques = body, angles, squares, torques
        self.solutions: list[tuple[Any, Floats]] = []

    def project_on_carrier(self, columns: Any, slopes: Sequence[Any], bias: tuple[Any, Any], move_alike: bool) -> Any:
        """The inertia (lower half) and the force on each coordinate of the supports of the pendula in these columns."""
        body, theta, squares = self.body, self.angles[columns], self.squared[columns]
        sin, cos = np.sin(theta[:, 0]), np.cos(theta[:, 0])
        tops = np.array([(cos * x - sin * z, sin * x + cos * z) for x, z in (bias, *slopes)])
        sides = body.sides(columns, squares, self.torques[columns], tops)
        solution = body.solve_band(body.band(columns, theta[:, :-1] - theta[:, 1:]), sides)
        self.solutions.append((columns, solution[..., TURN] / body.l[columns]))
        turn, force_n, force_u = np.moveaxis(solution[:, :, 0, : FORCE_U + 1], -1, 0)
        mass, lever, mass_below = body.m[columns, 0], body.lever[columns, 0], body.below[columns, 0]
        normal_force = mass * tops[:, 0] + lever * turn + mass_below * force_n
        axial_force = mass * tops[:, 1] + mass_below * force_u
        axial_force[0] -= body.mc[columns, 0] * squares[:, 0]
        forces = list(zip(cos * normal_force + sin * axial_force, cos * axial_force - sin * normal_force, strict=True))
        block = [[(v * fx + w * fz).sum(0) for v, w in slopes[: k + 1]] for k, (fx, fz) in enumerate(forces[1:])]
        return block, [(x * forces[0][0] + z * forces[0][1]).sum(0) for x, z in slopes]

    def fall(self, pushes: Sequence[Sequence[Any]], accelerations: Any) -> Any:
        """θ'' (n, P)."""
        turns = np.empty_like(self.angles)
        for (columns, (free, *responses)), push in zip(self.solutions, pushes, strict=True):
            turns[columns] = free + sum(response * size for response, size in zip(responses, push, strict=True))
        return turns.T
