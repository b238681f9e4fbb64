"""A cart with many different pendula: each one's own modes, coupled by the secular equation.

With the cart displaced by X, the fixed-support mode r of a pendulum follows with amplitude
x P_r X / (E_r (λ_r − x)), where P_r = φ_rᵀ b is its momentum, E_r = φ_rᵀ A φ_r and μ_r = P_r²/E_r.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from modal.chain import at_infinity, kinetic
from modal.effective import Motion, fixed_shapes, fixed_squares
from modal.rig import Block, Floats, Ints
from modal.secular import Poles, Roots, solve


@dataclass(frozen=True, eq=False)
class _Own:
    """A block's own modes: squares, momenta and energies (n modes, P), turns (n links, n modes, P)."""

    square: Floats
    momentum: Floats
    energy: Floats
    turn: Floats


@dataclass(frozen=True, eq=False)
class Crowd:
    """Chains that share a cart; counts are folded into the chains' masses."""

    blocks: tuple[Block, ...]
    mass: float
    stiffness: float

    @cached_property
    def own(self) -> tuple[_Own, ...]:
        """Fixed-support modes of every block."""
        return tuple(_own_modes(block) for block in self.blocks)

    @cached_property
    def poles(self) -> tuple[Poles, Ints]:
        """All poles in ascending order, and where each stood before sorting (−1: the spring)."""
        square = np.concatenate([own.square.ravel() for own in self.own])
        weight = np.concatenate([(own.momentum**2 / own.energy * own.square).ravel() for own in self.own])
        order = np.argsort(square, kind="stable")
        square, weight = _apart(square[order]), np.maximum(weight[order], 1e-290)
        if self.stiffness > 0:
            order = np.append(-1, order)
            square, weight = np.append(0.0, square), np.append(self.stiffness, weight)
        constant = self.mass + float(sum(at_infinity(block)[0].sum() for block in self.blocks))
        return Poles(square, weight, constant), order

    @cached_property
    def roots(self) -> Roots:
        """The modes, as offsets from the nearest pole."""
        return solve(self.poles[0])

    def squares(self) -> Floats:
        """ω² of every oscillatory mode, ascending."""
        return self.poles[0].square[self.roots.anchor] + self.roots.offset

    def shapes(self, rows: Ints) -> Motion:
        """Shapes of the modes with these indices."""
        poles, order = self.poles
        anchor, offset = self.roots.anchor[rows], self.roots.offset[rows]
        x = poles.square[anchor] + offset
        distance = np.empty((len(order), len(rows)))
        distance[order] = poles.square[:, None] - poles.square[anchor] - offset
        distance = distance[: len(order) - (self.stiffness > 0)]
        ends = np.cumsum([own.square.size for own in self.own])[:-1]
        amplitudes = [
            (own.momentum / own.energy)[..., None] * x / part.reshape(*own.square.shape, len(rows))
            for own, part in zip(self.own, np.split(distance, ends), strict=True)
        ]
        cart = 1.0 / np.maximum(1.0, np.max([np.abs(part).max((0, 1)) for part in amplitudes], axis=0))
        turns = tuple(
            np.einsum("imp,mpr->ipr", own.turn, part * cart) for own, part in zip(self.own, amplitudes, strict=True)
        )
        joints = [cart + np.concatenate([np.zeros((1, *a.shape[1:])), np.cumsum(a, 0)]) for a in turns]
        energies = tuple(kinetic(block, y, a) for block, y, a in zip(self.blocks, joints, turns, strict=True))
        total = self.mass * cart**2 + sum(part.sum((0, 1)) for part in energies)
        push = (self.mass - self.stiffness / x) * cart + sum(
            (_momentum(block, y, a)).sum((0, 1)) for block, y, a in zip(self.blocks, joints, turns, strict=True)
        )
        return Motion(cart, turns, energies, np.abs(push * cart) / total)


def _own_modes(block: Block) -> _Own:
    square = fixed_squares(block)
    column = np.broadcast_to(np.arange(block.size), square.shape).ravel()
    motion = fixed_shapes(block.take(column), square.ravel())
    turn = motion.turns[0][:, 0].reshape(block.n, block.n, block.size)
    energy = motion.energies[0].sum((0, 1)).reshape(square.shape)
    top = block.constants[0]
    return _Own(square, turn[0] * (top.k / square + top.q), energy, turn)


def _momentum(block: Block, y: Floats, a: Floats) -> Floats:
    links = zip(block.constants, y[:-1], a, strict=True)
    return np.array([link.m[:, None] * top + link.upper[:, None] * turn for link, top, turn in links])


def _apart(square: Floats) -> Floats:
    """Ascending squares with repetitions moved up by single roundings."""
    square = square.copy()
    while (repeated := np.flatnonzero(np.diff(square) <= 0) + 1).size:
        square[repeated] = np.nextafter(square[repeated - 1], np.inf)
    return square
