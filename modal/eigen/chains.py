"""Shapes by the effective mass, for chains on a fixed support and chains that share a cart.

A shape is computed from both ends and joined at one joint (a twisted factorization: [Dhillon2004, §2]). There it is out
of balance by ω² (μ + ν) y, so its Rayleigh quotient deviates from ω² by |μ + ν| y² over the kinetic energy T: a
residual that certifies the mode. The joint is one where the halves agree to rounding (|μ + ν| against the joint's own
mass) and the neighbouring links have most of the kinetic energy: where the mode is localized.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from modal.assembly import Block, CartNumbers
from modal.eigen.recursion import Suspension, SweepResult, from_above, from_below, joint_masses, kinetic
from modal.eigen.squares import EVERYTHING, Limits, Squares, squares_of
from modal.types import EPS, Booleans, Floats


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
    return squares_of(Suspension.on_fixed_support(block), np.arange(block.n)[: limits.lowest], block.n, limits.accuracy)


def fixed_shapes(chains: Block, x: Floats) -> ChainShapes:
    """Shape r of chain r at x[r], for R chains (columns, repeated as needed) or one: a block with arrays (n, 1, R)."""
    square = x[None] if chains.size == 1 else x[:, None]
    lower_half, upper_half = from_below(chains, square), from_above(chains, square, None)
    gap, cost = _mismatch(lower_half, upper_half, joint_masses(chains.constants.p, chains.constants.r))
    cost[0] = np.inf
    twist = np.arange(chains.n + 1)[:, None, None] == cost.argmin(0)
    y, a = _join_halves(lower_half, _climb(upper_half, twist), upper_half.turn, twist, np.zeros(square.shape))
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
    """Return shapes at x (R,) of chains that share a cart, with the cart."""
    lower_halves, upper_halves = _eliminate_both_ways(blocks, cart, x)
    joints = [joint_masses(block.constants.p, block.constants.r) for block in blocks]
    pivot = cart.mass + sum(float(masses[0].sum()) for masses in joints)
    for masses in joints:
        masses[0] = pivot
    gaps, costs = zip(*map(_mismatch, lower_halves, upper_halves, joints), strict=True)
    twists = _cheapest(costs)
    upper_joints = [_climb(upper, twist) for upper, twist in zip(upper_halves, twists, strict=True)]
    cart_displacement = np.sum([y[0].sum(0) for y in upper_joints], axis=0)
    shapes = [
        _join_halves(lower, y, upper.turn, twist, np.broadcast_to(cart_displacement, y[0].shape))
        for lower, y, upper, twist in zip(lower_halves, upper_joints, upper_halves, twists, strict=True)
    ]
    energies = tuple(kinetic(block, y, a) for block, (y, a) in zip(blocks, shapes, strict=True))
    modal_mass = cart.mass * cart_displacement**2 + sum(energy.sum((0, 1)) for energy in energies)
    imbalance = sum(np.where(twist, gap, 0.0).sum((0, 1)) for twist, gap in zip(twists, gaps, strict=True))
    turns = tuple(a for _, a in shapes)
    return ChainShapes(
        cart_displacement, turns, energies, modal_mass, cart.stiffness * cart_displacement / x, imbalance / modal_mass
    )


def _eliminate_both_ways(
    blocks: tuple[Block, ...], cart: CartNumbers, x: Floats
) -> tuple[list[SweepResult], list[SweepResult]]:
    """Elimination from the free ends, and from the cart with all the other chains on it."""
    lower_halves = [from_below(block, x[None]) for block in blocks]
    others = sums_without_each(cart.mass - cart.stiffness / x, [half.mass[0] for half in lower_halves])
    energy = sums_without_each(np.full(x.shape, cart.mass), [half.energy[0] for half in lower_halves])
    upper_halves = [
        from_above(block, x[None], *pivot_values) for block, *pivot_values in zip(blocks, others, energy, strict=True)
    ]
    pivot = cart.mass + sum(half.nearest[0].sum(0) for half in lower_halves)
    for half in lower_halves:
        half.nearest[0] = pivot
    return lower_halves, upper_halves


def _mismatch(lower_half: SweepResult, upper_half: SweepResult, masses: Floats) -> tuple[Floats, Floats]:
    """|μ + ν| at each joint, and the cost of joining the halves there, given the joints' own masses (n + 1, P)."""
    gap = np.abs(lower_half.mass + upper_half.mass)
    nearest_energy, total_energy = lower_half.nearest + upper_half.nearest, lower_half.energy + upper_half.energy
    joinable = (masses[:, :, None] > 0) & (nearest_energy > 1e-150 * total_energy)
    weight = np.where(joinable, masses[:, :, None], 1.0)
    share = np.where(joinable, nearest_energy, 1.0) / np.where(joinable, total_energy, 1.0)
    return gap, np.where(joinable, np.maximum(gap / weight, 4 * EPS) / share, np.inf)  # below, the energy decides


def _cheapest(costs: tuple[Floats, ...]) -> list[Booleans]:
    """For every mode the one joint of all chains with the least cost, marked in arrays (n + 1, P, R)."""
    home = np.array([cost.min((0, 1)) for cost in costs]).argmin(0)
    masks = []
    for index, cost in enumerate(costs):
        flat = cost.reshape(-1, cost.shape[-1])
        mask = (np.arange(len(flat))[:, None] == flat.argmin(0)) & (home == index)
        masks.append(mask.reshape(cost.shape))
    return masks


def _climb(upper_half: SweepResult, twist: Booleans) -> Floats:
    """Joints y from the twist upward, 1 at the twist, in the chains that contain it; 0 elsewhere."""
    y = np.where(twist, 1.0, 0.0)
    for i in reversed(range(len(y) - 1)):
        y[i] += y[i + 1] * upper_half.gain[i]
    return y


def _join_halves(
    lower_half: SweepResult, upper_joints: Floats, turn_above: Floats, twist: Booleans, pivot: Floats
) -> tuple[Floats, Floats]:
    """Joints and turns of the shapes: climbed above the twist, descended below it and in every other chain."""
    y, a = np.empty_like(lower_half.mass), np.empty_like(lower_half.gain)
    over = twist.any(0)
    y[0] = np.where(over, upper_joints[0], pivot)
    for i in range(len(a)):
        over = over & ~twist[i]
        y[i + 1] = np.where(over, upper_joints[i + 1], y[i] * lower_half.gain[i])
        a[i] = np.where(over, upper_joints[i + 1] * turn_above[i], y[i] * lower_half.turn[i])
    return y, a


def sums_without_each(base: Floats, parts: list[Floats]) -> list[Floats]:
    """Return `own` + Σ of all rows except each one, for rows (P, …) in several arrays, without subtraction."""
    rows = np.concatenate(parts)
    before, after = np.zeros_like(rows), np.zeros_like(rows)
    np.cumsum(rows[:-1], axis=0, out=before[1:])
    after[:-1] = np.cumsum(rows[:0:-1], axis=0)[::-1]
    return np.split(base + (before + after), np.cumsum([len(part) for part in parts])[:-1])
