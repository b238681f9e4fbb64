"""Shapes by the effective mass, of chains on a fixed support and of chains that share a cart.

A shape is built from both ends and joined at one joint (a twisted factorization: [Dhillon2004, §2]).  There it is out
of balance by ω² (μ + ν) y, so its Rayleigh quotient deviates from ω² by |μ + ν| y² over the kinetic energy T: a
residual that certifies the mode.  The joint is one where the halves agree to rounding (|μ + ν| against the joint's own
mass) and the neighbouring links have most of the kinetic energy: where the mode is localized.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from modal.assembly import Block, CartNumbers
from modal.eigen.recursion import Suspension, Swept, from_above, from_below, joint_masses, kinetic
from modal.eigen.seeds import without_each
from modal.eigen.squares import EVERYTHING, Limits, Squares, squares_of
from modal.types import Booleans, Floats

ROUNDING = 1e-15


@dataclass(frozen=True, eq=False)
class ChainShapes:
    """Shapes φ of R modes: the cart's displacement (R,), turns a = l θ and energies (n, P, R) of each block.

    Energies are twice the kinetic energy of each link over ω², `modal_mass` (R,) their sum φᵀMφ with the cart's;
    `momentum` (R,) is φᵀMe for the unit translation e of everything, and `residual` (R,) the relative distance of
    the Rayleigh quotient from ω².
    """

    cart: Floats
    turns: tuple[Floats, ...]
    energies: tuple[Floats, ...]
    modal_mass: Floats
    momentum: Floats
    residual: Floats


def fixed_squares(block: Block, limits: Limits = EVERYTHING) -> Squares:
    """ω² of every chain on a fixed support, shape (n, P), ascending."""
    if limits.squares is not None:
        return Squares.exact(limits.squares[:, None])
    return squares_of(Suspension.fixed(block), np.arange(block.n)[: limits.lowest], block.n, limits.accuracy)


def fixed_shapes(chains: Block, x: Floats) -> ChainShapes:
    """Shape r of chain r at x[r], for R chains (columns, repeated as needed) or one: a block with arrays (n, 1, R)."""
    square = x[None] if chains.size == 1 else x[:, None]
    below, above = from_below(chains, square), from_above(chains, square, None)
    gap, cost = _mismatch(below, above, joint_masses(chains.constants.p, chains.constants.r))
    cost[0] = np.inf
    twist = np.arange(chains.n + 1)[:, None, None] == cost.argmin(0)
    y, a = _joined(below, _climb(above, twist), above.turn, twist, np.zeros(square.shape))
    energies = kinetic(chains, y, a)
    modal_mass = energies.sum(0).ravel()
    return ChainShapes(
        cart=np.zeros(len(x)),
        turns=(a.reshape(chains.n, 1, -1),),
        energies=(energies.reshape(chains.n, 1, -1),),
        modal_mass=modal_mass,
        momentum=a[0].ravel() * (chains.constants.k[0] / x + chains.constants.q[0]),
        residual=np.where(twist, gap, 0.0).sum(0).ravel() / modal_mass,
    )


# -------------------------------------------------------------------------------------------------- on a cart


def cart_shapes(blocks: tuple[Block, ...], cart: CartNumbers, x: Floats) -> ChainShapes:
    """Shapes at x (R,) of chains that share a cart, all of them and the cart together."""
    below, above = _both_ways(blocks, cart, x)
    joints = [joint_masses(block.constants.p, block.constants.r) for block in blocks]
    pivot = cart.mass + sum(float(masses[0].sum()) for masses in joints)
    for masses in joints:
        masses[0] = pivot
    gaps, costs = zip(*map(_mismatch, below, above, joints), strict=True)
    twists = _cheapest(costs)
    climbed = [_climb(upper, twist) for upper, twist in zip(above, twists, strict=True)]
    moved = np.sum([y[0].sum(0) for y in climbed], axis=0)
    shapes = [
        _joined(lower, y, upper.turn, twist, np.broadcast_to(moved, y[0].shape))
        for lower, y, upper, twist in zip(below, climbed, above, twists, strict=True)
    ]
    energies = tuple(kinetic(block, y, a) for block, (y, a) in zip(blocks, shapes, strict=True))
    modal_mass = cart.mass * moved**2 + sum(energy.sum((0, 1)) for energy in energies)
    missed = sum(np.where(twist, gap, 0.0).sum((0, 1)) for twist, gap in zip(twists, gaps, strict=True))
    turns = tuple(a for _, a in shapes)
    return ChainShapes(moved, turns, energies, modal_mass, cart.stiffness * moved / x, missed / modal_mass)


def _both_ways(blocks: tuple[Block, ...], cart: CartNumbers, x: Floats) -> tuple[list[Swept], list[Swept]]:
    """Elimination from the free ends, and from the cart with all the other chains on it."""
    below = [from_below(block, x[None]) for block in blocks]
    others = without_each(cart.mass - cart.stiffness / x, [swept.mass[0] for swept in below])
    energy = without_each(np.full(x.shape, cart.mass), [swept.energy[0] for swept in below])
    above = [from_above(block, x[None], *felt) for block, *felt in zip(blocks, others, energy, strict=True)]
    pivot = cart.mass + sum(swept.nearest[0].sum(0) for swept in below)
    for swept in below:
        swept.nearest[0] = pivot
    return below, above


def _mismatch(below: Swept, above: Swept, masses: Floats) -> tuple[Floats, Floats]:
    """|μ + ν| at each joint, and the cost of joining the halves there, given the joints' own masses (n + 1, P)."""
    gap = np.abs(below.mass + above.mass)
    near, whole = below.nearest + above.nearest, below.energy + above.energy
    joinable = (masses[:, :, None] > 0) & (near > 1e-150 * whole)
    weight = np.where(joinable, masses[:, :, None], 1.0)
    share = np.where(joinable, near, 1.0) / np.where(joinable, whole, 1.0)
    return gap, np.where(joinable, np.maximum(gap / weight, ROUNDING) / share, np.inf)


def _cheapest(costs: tuple[Floats, ...]) -> list[Booleans]:
    """For every mode the one joint of all chains with the least cost, marked in arrays (n + 1, P, R)."""
    home = np.array([cost.min((0, 1)) for cost in costs]).argmin(0)
    marked = []
    for index, cost in enumerate(costs):
        flat = cost.reshape(-1, cost.shape[-1])
        here = (np.arange(len(flat))[:, None] == flat.argmin(0)) & (home == index)
        marked.append(here.reshape(cost.shape))
    return marked


def _climb(above: Swept, twist: Booleans) -> Floats:
    """Joints y from the twist upward, 1 at the twist, in the chains that contain it; 0 elsewhere."""
    y = np.where(twist, 1.0, 0.0)
    for i in reversed(range(len(y) - 1)):
        y[i] += y[i + 1] * above.gain[i]
    return y


def _joined(below: Swept, climbed: Floats, turn_above: Floats, twist: Booleans, pivot: Floats) -> tuple[Floats, Floats]:
    """Joints and turns of the shapes: climbed above the twist, descended below it and in every other chain."""
    y, a = np.empty_like(below.mass), np.empty_like(below.gain)
    over = twist.any(0)
    y[0] = np.where(over, climbed[0], pivot)
    for i in range(len(a)):
        over = over & ~twist[i]
        y[i + 1] = np.where(over, climbed[i + 1], y[i] * below.gain[i])
        a[i] = np.where(over, climbed[i + 1] * turn_above[i], y[i] * below.turn[i])
    return y, a
