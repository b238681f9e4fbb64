"""The damping of a structure with pendula: to first order in the dampers, and the damped eigenvalues beside it.

With vᵀMv = 1 the modes v of the reduced pencil (K, M) decay at the rates σ = ½ vᵀDv; modes of equal frequency are
rotated until D is diagonal among them.  The damped eigenvalues are those of λ²M + λD + K.  Equal pendula that move
nothing else are a pencil of their own.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from modal.assembly import ratio_at
from modal.coupling.damping import Damped, nearest_values, negative_damping, slowest
from modal.coupling.fixed_base import FixedBaseModes
from modal.coupling.reduced import ReducedStructure
from modal.scene import Scene
from modal.types import Floats

STILL = 1e-20
"""Largest share of a mode's kinetic energy in a structure that is said to stand still."""
CREEPING = 1e-12
"""Smallest eigenvalue over the largest that is not 0."""
MOST_SOLVED = 400
"""Coordinates up to which damped eigenvalues are computed."""


@dataclass(frozen=True, eq=False)
class StructureDamping:
    """What drains and feeds the modes of a structure: `squares` ω² (R,) and `vectors` (N, R) of all of them."""

    scene: Scene
    reduced: ReducedStructure
    squares: Floats
    vectors: Floats

    @property
    def fixed_base(self) -> FixedBaseModes:
        """The modes of every kind of pendulum alone, all else held."""
        return self.reduced.fixed_base

    @cached_property
    def losses(self) -> dict[str, Floats]:
        """Matrices of what drains and feeds modes, by where it comes from."""
        rig, reduced = self.reduced.hanging.rig, self.reduced
        driven = negative_damping(self.scene, rig)
        return {
            "from_cart": reduced.carried,
            "from_joints": reduced.joined(lambda kind: rig.blocks[kind[0]].damping[:, kind[1]]),
            "from_drag": reduced.dragged,
            "from_drives": reduced.joined(lambda kind: driven[kind[0]][:, kind[1]]),
            "fed": reduced.joined(lambda kind: np.eye(rig.blocks[kind[0]].n)[0]),
        }

    @cached_property
    def matrix(self) -> Floats | None:
        """D of all dampers and drag, and of the damping ratio; None where there are none."""
        if not self.scene.has_damping:
            return None
        losses = self.losses
        matrix = losses["from_cart"] + losses["from_joints"] + losses["from_drag"]
        if self.reduced.hanging.rig.damping_ratio:
            square, vectors = self.squares, self.vectors
            momenta = self.reduced.M @ vectors
            omega = np.sqrt(square)
            matrix = matrix + (momenta * (2 * ratio_at(self.reduced.hanging.rig)(omega) * omega)) @ momenta.T
        return np.asarray(matrix)

    @cached_property
    def modes(self) -> tuple[Damped, ...]:
        """The damping and excitation of each mode that oscillates, ascending; `from_cart` is that of the structure."""
        return tuple(sorted([*self._together(), *self._copies()], key=lambda mode: mode.omega))

    def _together(self) -> list[Damped]:
        square, vectors = self.squares, self.vectors
        order = np.argsort(square, kind="stable")
        square, vectors = square[order], vectors[:, order]
        swinging = square > 0
        square, vectors = square[swinging], vectors[:, swinging]
        losses = self.losses
        drained = sum(losses[name] for name in ("from_cart", "from_joints", "from_drag"))
        gaps = np.flatnonzero(np.diff(square) > 1e-12 * square[1:]) + 1
        for group in np.split(np.arange(len(square)), gaps):
            if len(group) > 1:
                vectors[:, group] = (
                    vectors[:, group] @ np.linalg.eigh(vectors[:, group].T @ drained @ vectors[:, group])[1]
                )
        parts = {name: np.einsum("ik,ij,jk->k", vectors, S, vectors) / 2 for name, S in losses.items()}
        omega, d = np.sqrt(square), self.reduced.d
        ratio = ratio_at(self.reduced.hanging.rig)(omega) * omega
        rate = parts["from_cart"] + parts["from_joints"] + parts["from_drag"] + ratio
        exact = self._exact(np.column_stack((rate, omega)))
        share = np.einsum("ik,ij,jk->k", vectors[:d], self.reduced.M[:d, :d], vectors[:d])
        return [
            Damped(
                omega=float(omega[k]),
                fold=1,
                still=bool(share[k] <= STILL),
                kind=None,
                exact=exact[k],
                from_ratio=float(ratio[k]),
                **{name: float(part[k]) for name, part in parts.items()},
            )
            for k in range(len(omega))
        ]

    def _exact(self, first: Floats) -> list[complex | None]:
        """The damped eigenvalue of each mode of rates and frequencies `first` (R, 2)."""
        D, n = self.matrix, len(self.reduced.M)
        if D is None:
            return [complex(0.0, omega) for omega in first[:, 1]]
        if n > MOST_SOLVED:
            return [None] * len(first)
        values = _quadratic(self.reduced.M, D, self.reduced.K)
        return nearest_values(first, slowest(_upper(values), len(first)))

    def _copies(self) -> list[Damped]:
        """Equal pendula in antiphase, which move nothing else."""
        damped, losses, modes, d = [], self.losses, self.fixed_base, self.reduced.d
        rig = self.reduced.hanging.rig
        for k, name in enumerate(self.reduced.names):
            columns = np.array(self.reduced.columns(k))
            if (copies := int(modes.count[columns[0] - d])) < 2:
                continue
            omega = modes.omega[columns - d]
            parts = {key: S[np.ix_(columns, columns)] for key, S in losses.items() if key != "from_cart"}
            ratio = ratio_at(rig)(omega) * omega
            D = parts["from_joints"] + parts["from_drag"] + 2 * np.diag(ratio)
            rate = np.diag(D) / 2
            exact: list[complex | None] = [complex(0.0, value) for value in omega]
            if D.any():
                values = _quadratic(np.eye(len(columns)), D, np.diag(omega**2))
                exact = nearest_values(np.column_stack((rate, omega)), slowest(_upper(values), len(columns)))
            damped += [
                Damped(
                    omega=float(omega[i]),
                    fold=copies - 1,
                    still=True,
                    kind=name,
                    from_cart=0.0,
                    exact=exact[i],
                    from_ratio=float(ratio[i]),
                    **{key: float(S[i, i]) / 2 for key, S in parts.items()},
                )
                for i in range(len(columns))
            ]
        return damped


def _quadratic(M: Floats, D: Floats, K: Floats) -> NDArray[np.complex128]:
    """All λ of λ²M + λD + K."""
    n = len(M)
    inverse = np.linalg.solve(M, np.hstack([K, D]))
    values: NDArray[np.complex128] = np.linalg.eigvals(
        np.block([[np.zeros((n, n)), np.eye(n)], [-inverse[:, :n], -inverse[:, n:]]])
    )
    return values


def _upper(values: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """One of each conjugate pair, without the zeros of what nothing holds."""
    upper: NDArray[np.complex128] = values[(values.imag >= 0) & (np.abs(values) > CREEPING * np.abs(values).max())]
    return upper
