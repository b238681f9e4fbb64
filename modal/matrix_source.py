"""Modes from matrices, for joint springs and dampers: one chain, or one heavy pendulum of each kind and the cart."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from modal import dense
from modal.amplitude import coefficient, quartic
from modal.effective import CartProblem
from modal.linear import assembled
from modal.rig import Block, Floats, Ints, Rig
from modal.sources import Details, largest_angle, per_copy

LIGHT = 0.1
"""Damping ratio up to which a mode has an amplitude coefficient."""


@dataclass(frozen=True, eq=False)
class Dense:
    """Modes of one chain (`cart` None) or of everything together, from matrices: joint springs or dampers."""

    blocks: tuple[Block, ...]
    counts: tuple[Ints, ...]
    cart: tuple[float, float, float] | None
    bare_mobility: float
    route = "dense"

    @cached_property
    def matrices(self) -> tuple[Floats, Floats, Floats]:
        """(M, K, D) with copies folded into one heavy pendulum of each kind."""
        columns = [(block, p) for block in self.blocks for p in range(block.size)]
        support = Rig(1.0, (), (), self.cart, False)
        return assembled(support, columns)

    @property
    def is_damped(self) -> bool:
        """Whether the modes are complex."""
        return bool(self.matrices[2].any())

    @cached_property
    def modes(self) -> dense.DenseModes:
        """Eigenvalues, shapes, errors."""
        M, K, D = self.matrices
        free = self.cart is not None and self.cart[2] == 0
        if self.is_damped:
            return dense.damped(M, D, K, free=free)
        singular = self.cart is not None and CartProblem(self.blocks, self.cart[0], self.cart[2]).bare_mass == 0
        return dense.undamped(M, K, free=free, singular=singular)

    @property
    def eigenvalue(self) -> NDArray[np.complex128]:
        """−ζω + iω√(1−ζ²)."""
        return self.modes.eigenvalue

    @property
    def error(self) -> Floats:
        """Relative error bounds."""
        return self.modes.error

    def details(self, rows: Ints) -> Details:
        """Shapes, turned so that the largest angle is real; what a damped mode lacks is NaN."""
        M, K, D = self.matrices
        first = 1 if self.cart else 0
        value, shape = self.modes.eigenvalue[rows], _in_phase(self.modes.shape[:, rows], first)
        energy = np.einsum("ir,ij,jr->r", shape.conj(), M, shape).real
        cart = shape[0] if self.cart else np.zeros(len(rows), dtype=np.complex128)
        angles = self._split(shape[first:])
        push = M @ shape * value**2 + D @ shape * value + K @ shape
        size = abs(M) @ abs(shape) * abs(value) ** 2 + abs(D) @ abs(shape) * abs(value) + abs(K) @ abs(shape)
        found = Details(
            modal_mass=energy,
            effective_mass=np.full(len(rows), np.nan),
            cart=cart,
            mobility=np.abs(cart) ** 2 / energy / self.bare_mobility,
            kappa=np.where(
                np.abs(value.real) < LIGHT * np.abs(value), self._kappa(cart, angles, energy, np.abs(value)), np.nan
            ),
            residual=(np.abs(push) / np.where(size > 0, size, 1.0)).max(0),
            angles=angles,
            shares=per_copy(self._energies(cart, angles), energy, self.counts),
        )
        return found if self.is_damped else self._conservative(found, np.abs(value))

    def _kappa(
        self, cart: NDArray[np.inexact], angles: tuple[NDArray[np.inexact], ...], energy: Floats, omega: Floats
    ) -> Floats:
        """κ of the part of each shape that moves in phase: exact without dampers, to first order in light ones."""
        in_phase, x = tuple(angle.real for angle in angles), omega**2
        parts = [quartic(block, x, cart.real, angle).sum(0) for block, angle in zip(self.blocks, in_phase, strict=True)]
        return coefficient(np.sum(parts, axis=0), energy, x, largest_angle(in_phase))

    def _conservative(self, found: Details, omega: Floats) -> Details:
        """The same with real shapes and effective masses, which damped modes do not have."""
        cart, angles = found.cart.real, tuple(angle.real for angle in found.angles)
        if self.cart:
            momentum = self.cart[2] * cart / omega**2
        else:
            momentum = (self.blocks[0].b[:, :, None] * angles[0]).sum((0, 1))
        return replace(found, cart=cart, angles=angles, effective_mass=momentum**2 / found.modal_mass)

    def _split(self, angles: NDArray[np.inexact]) -> tuple[NDArray[np.inexact], ...]:
        ends = np.cumsum([block.mass.size for block in self.blocks])[:-1]
        parts = np.split(angles, ends)
        return tuple(
            part.reshape(block.size, block.n, -1).swapaxes(0, 1) for part, block in zip(parts, self.blocks, strict=True)
        )

    def _energies(self, cart: NDArray[np.inexact], angles: tuple[NDArray[np.inexact], ...]) -> tuple[Floats, ...]:
        found = []
        for block, angle in zip(self.blocks, angles, strict=True):
            turn = angle * block.length[:, :, None]
            top = cart + np.concatenate([np.zeros((1, *turn.shape[1:])), np.cumsum(turn, 0)[:-1]])
            centre = top + angle * block.centre[:, :, None]
            found.append(block.mass[:, :, None] * np.abs(centre) ** 2 + block.inertia[:, :, None] * np.abs(angle) ** 2)
        return tuple(found)


def _in_phase(shape: NDArray[np.complex128], first: int) -> NDArray[np.complex128]:
    """Each column turned in the complex plane until its largest angle, in rows `first` …, is real and positive."""
    angles = shape[first:]
    leading = np.take_along_axis(angles, np.abs(angles).argmax(0)[None], 0)[0]
    size = np.abs(leading)
    return shape * np.where(size > 0, leading.conj() / np.where(size > 0, size, 1.0), 1.0)
