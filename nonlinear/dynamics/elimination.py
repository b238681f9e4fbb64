"""Short chains in the plane: the dense matrices of all pendula of a group at once, eliminated from the tips up.

    Σ_j A_ij [cos(θ_i − θ_j) θ_j'' + sin(θ_i − θ_j) θ_j'²] + b_i n_i·ã = Q_i,   n = (cos θ, −sin θ)

is solved for θ_i'' where the first joint feels the acceleration ã, and for the response to each coordinate of what
carries it.  Of few links it takes fewer operations than the recursion, of many it would take more: it is what their
text says (`nonlinear.dynamics.forms`).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from modal import pair
from nonlinear.dynamics.minimal import Projection
from nonlinear.system import Group, System

LIGHT = 1e-2  # cart mass over suspended mass below which the dense form would lose digits
FRAIL = 1e-3  # mass of a link over that of a heavier one below it, under which dense forms lose digits
LIGHTEST = 0.0  # that of a modal support may be anything
SINGULAR = "the mass matrix is singular in double precision"


def loses_digits(group: Group, system: System) -> bool:
    """Whether a carrier, or a link above a heavier one, is so light that dense matrices would lose digits."""
    heaviest = np.maximum.accumulate(group.block.mass[::-1])[::-1]
    masses = [
        LIGHTEST if carrier.M is not None else carrier.mass for carrier in system.suspension.carriers if carrier.size
    ]
    light = min(masses, default=np.inf) < LIGHT * float(system.mass.sum())
    return bool(light or np.any(group.block.mass < FRAIL * heaviest))


class Elimination:
    """A group of short chains, as arrays (n, P, ...) of any type that `sine` and `cosine` accept."""

    def __init__(self, group: Group, tail: int = 0, sine: Any = np.sin, cosine: Any = np.cos) -> None:
        block, self.sine, self.cosine = group.block, sine, cosine
        numbers = (block.mass, block.length, block.centre, block.inertia)
        self.A = np.array(pair.inertia_matrix(*numbers)).reshape(group.n, *block.b.shape, *[1] * tail)
        self.b = block.b.reshape(*block.b.shape, *[1] * tail)
        self.masses = block.mass.sum(0).reshape(*block.b.shape[1:], *[1] * tail)

    @staticmethod
    def equations(A: Any, s: Any, c: Any, ww: Any, side: list[Any]) -> tuple[list[list[Any]], list[Any]]:
        """The lower half of A cos(θ_i − θ_j) of some pendula, and the right-hand side from their torques `side`."""
        M: list[list[Any]] = []
        for i, row in enumerate(A):
            M.append([row[j] * (c[i] * c[j] + s[i] * s[j]) for j in range(i)])
            M[i].append(row[i] + 0.0 * s[i])
            for j in range(i):
                thrown = row[j] * (s[i] * c[j] - c[i] * s[j])
                side[i], side[j] = side[i] - thrown * ww[j], side[j] + thrown * ww[i]
        return M, side

    def _substituted(self, M: list[list[Any]], right: Iterable[Any]) -> list[Any]:
        """θ'' from the eliminated equations and what is left on their right-hand sides."""
        solution: list[Any] = []
        for row, left in zip(M, right, strict=True):
            value = left
            for entry, above in zip(row, solution, strict=False):
                value = value - entry * above
            solution.append(value / row[-1])
        return solution

    def response(self, angles: Any, rates: Any, torques: Any) -> Projection:
        """What the pendula answer to motions of their first joints."""
        return Eliminated(self, angles, rates, torques)


class Eliminated:
    """Pendula on carriers, with n across a link, u along it, slopes j_k of first joints and their acceleration ã.

    M_kl = Σ m j_k·j_l − a_kᵀ M⁻¹ a_l,   force_k = Σ m j_k·ã − Σ b u·j_k θ'² + a_kᵀ M⁻¹ (Q − b n·ã),   a_k = b n·j_k
    """

    def __init__(self, body: Elimination, angles: Any, rates: Any, torques: Any) -> None:
        self.body, self.parts = body, (angles, rates, torques)
        self.solutions: list[tuple[Any, Any]] = []

    def projected(self, columns: Any, slopes: Sequence[Any], felt: tuple[Any, Any], together: bool) -> Any:
        """The lower half of M_kl and force_k of the pendula in these columns, summed."""
        body, (angles, rates, torques) = self.body, (part[:, columns] for part in self.parts)
        A, b, mass = body.A[:, :, columns], body.b[:, columns], body.masses[columns]
        s, c, ww = body.sine(angles), body.cosine(angles), rates * rates
        M, side = body.equations(A, s, c, ww, list(torques - (b * felt[0]) * c + (b * felt[1]) * s))
        across = [list(b * (c * x - s * z)) for x, z in slopes]
        thrown, counts = b * ww, range(len(slopes))
        force = [-(thrown * (s * x + c * z)).sum(0) for x, z in slopes]
        lost: list[list[Any]] = [[0.0] * (k + 1) for k in counts]
        for k in reversed(range(len(M))):
            for j in range(k):
                share = M[k][j] / M[k][k]
                for i in range(j + 1):
                    M[j][i] = M[j][i] - share * M[k][i]
                side[j] = side[j] - share * side[k]
                for column in across:
                    column[j] = column[j] - share * column[k]
            for i, column in enumerate(across):
                share = column[k] / M[k][k]
                for j in range(i + 1):
                    lost[i][j] = lost[i][j] + share * across[j][k]
                force[i] = force[i] + share * side[k]
        self.solutions.append((columns, (M, side, across)))
        if together:
            mass = mass.sum(0, keepdims=True)
        block = [
            [(mass * (x * v + z * w)).sum(0) - lost[k][j].sum(0) for j, (v, w) in enumerate(slopes[: k + 1])]
            for k, (x, z) in enumerate(slopes)
        ]
        return block, [
            (mass * (x * felt[0] + z * felt[1])).sum(0) + each.sum(0)
            for (x, z), each in zip(slopes, force, strict=True)
        ]

    def fall(self, pushes: Sequence[Sequence[Any]], accelerations: Any) -> Any:
        """θ'' (n, P, ...) under second derivatives of each bundle's coordinates."""
        turns = np.empty_like(self.parts[0])
        for (columns, (M, side, across)), push in zip(self.solutions, pushes, strict=True):
            left = list(side)
            for column, acceleration in zip(across, push, strict=True):
                left = [each - part * acceleration for each, part in zip(left, column, strict=True)]
            turns[:, columns] = np.array(self.body._substituted(M, left))
        return turns
