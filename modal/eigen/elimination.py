"""Frequency responses by elimination of K + iωD − ω²M from the tips: no digit is lost however far the modes are.

A link whose upper joint is displaced by y and lower one by y + a (a = σ l θ), with r, p, q, u and J of
`modal.pair.Constants`, feels from all below it the effective mass μ on its lower joint and, through a joint with a
spring and a damper, κ = stiffness + iω damping, the coupling ν and the stiffness S on its turn.  With loads F on its
centre of mass (s = c/l along it), T on its turn, e + ω²ε on its lower joint, and c = κ/(l l′) to the link above it,

    k̃ = k + S + κ/l²,   P = k̃ − ω²(r + μ + 2ν),   N = k̃ + ω²(q − ν),   β = u + μ + ν,   E = T + s F + e + ω²ε
    a = (c a′ + E + ω²β y)/P                            y + a = (c a′ + E + N y)/P
    μ′ = ((m + μ) k̃ − ω²(m J + p μ + 2 m(1 − s) ν − ν²))/P      ν′ = c β/P      S′ = κ (P − κ/l²)/(P l′²)
    e′ = (N e + (k̃ − ω²(J + (1 − s) μ + (2 − s) ν)) F)/P,     ε′ = (N ε + β T)/P,     T′ = c E/P

where primes are for the link above.  Nothing is subtracted that is not subtracted in the data: μ of bobs becomes
k/ω² above their modes, where m_dyn as a sum over modes cancels, and torques alone push the cart with ω²ε, whose ω² is
that of the cart's inertia.  A linear drag d on a centre of mass adds −i d/ω to its mass, loss angles φ make k and κ's
stiffness k (1 + iφ).
(The recursion of `modal.eigen.recursion`, at a complex frequency; Parlett, The Symmetric Eigenvalue Problem, §3.3.)
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from modal import pair
from modal.assembly import Block, CartNumbers
from modal.eigen.arithmetic import Arithmetic
from modal.types import Floats

TORQUE, FORCE, TURN = "torque", "force", "turn"
Load = tuple[str, int]
"""A torque at the upper joint of a link, a force on its centre or a torque on it alone, and the link, from 0."""


class Hung(NamedTuple):
    """P chains on a pivot: `mass` (P, W) felt there, `direct` and `inertial` (P, L, W), e and ε of the loads there.

    Joints (n + 1, P, 1 + L, W) and angles (n, P, 1 + L, W) for a pivot displaced by 1, then for each load on a pivot at
    rest.
    """

    mass: Any
    direct: Any
    inertial: Any
    joints: Any
    angles: Any


def hung(
    block: Block, loads: list[Load], gravity: float, numbers: Arithmetic, losses: tuple[Floats, Floats] | None = None
) -> Hung:
    """Chains with unit loads at the frequencies of `numbers`; `losses` are the loss angles of joints and wires.

    Each is (n, P, W), at the frequencies `numbers.rates`.
    """
    square, felt = numbers.omega * numbers.omega, numbers.felt
    parts = (block.mass, block.length, block.centre, block.inertia, block.sigma)
    m, length, c, I, sigma = (numbers.number(part[..., None]) for part in parts)
    below = np.array(pair.masses_below(m))
    links = pair.link_constants(m, length, c, I, below, numbers.number(gravity))
    k = sigma * links.k
    if block.drag.any():
        heavy = m - numbers.imaginary(numbers.number(block.drag[..., None]) / numbers.omega)
        links = pair.link_constants(heavy, length, c, I, below)
    joint = numbers.number(block.stiffness[..., None])
    if block.damping.any():
        joint = joint + numbers.imaginary(numbers.number(block.damping[..., None]) * numbers.omega)
    if losses is not None:
        of_joints, of_wires = (numbers.number(angle) for angle in losses)
        joint = joint + numbers.imaginary(numbers.number(block.stiffness[..., None]) * of_joints)
        k = k + numbers.imaginary(k * of_wires)
    is_sprung = bool(block.stiffness.any() or block.damping.any())
    torque, force = _loaded(block, loads)
    torques, forces = numbers.number(torque) * sigma[:, :, None] / length[:, :, None], numbers.number(force)
    mu: Any = numbers.number(np.zeros((block.size, 1)))
    nu: Any = 0
    stiff: Any = 0
    turned: Any = 0
    e: Any = numbers.number(np.zeros((block.size, len(loads), 1)))
    epsilon, passed = e, []
    for i in range(block.n - 1, -1, -1):
        m, mJ, r, p, q, upper, lower = (part[i] for part in links[:-1])
        s, rest, J = upper / m, lower / m, mJ / m
        spring = joint[i] / length[i] / length[i]
        total = k[i] + stiff + spring
        P = felt(numbers.pivot(total - square * (r + mu + nu + nu), total))
        N = felt(total + square * (q - nu))
        beta = felt(upper + mu + nu)
        T = turned + torques[i]
        E = felt(T + _wide(s) * forces[i] + e + square * epsilon)
        coupling = joint[i] * sigma[i] * sigma[i - 1] / length[i] / length[i - 1] if i and is_sprung else None
        passed.append((P, N, beta, E, coupling))
        moved = felt(total - square * (J + rest * mu + (1 + rest) * nu))
        e = felt((_wide(N) * e + _wide(moved) * forces[i]) / _wide(P))
        epsilon = felt((_wide(N) * epsilon + _wide(beta) * T) / _wide(P))
        mu = felt(((m + mu) * total - square * (mJ + p * mu + (lower + lower) * nu - nu * nu)) / P)
        if coupling is not None:
            nu = felt(coupling * beta / P)
            stiff = felt(joint[i] * (P - spring) / P / length[i - 1] / length[i - 1])
            turned = felt(_wide(coupling) * E / _wide(P))
    joints, angles = _followed(passed[::-1], numbers.number(np.eye(1, 1 + len(loads))[..., None]), square, felt)
    return Hung(mu, e, epsilon, joints, np.array(angles) * sigma[:, :, None] / length[:, :, None])


def _followed(passed: list[Any], pivot: Any, square: Any, felt: Any) -> tuple[Any, list[Any]]:
    """Joints and turns, from the pivot down."""
    y, above = pivot, None
    joints, turns = [], []
    for P, N, beta, E, coupling in passed:
        pushed = np.concatenate([0 * E[:, :1], E], axis=1) if E.shape[1] else 0 * _wide(P)
        if coupling is not None:
            pushed = pushed + _wide(coupling) * above
        joints.append(y)
        above, y = felt((pushed + square * _wide(beta) * y) / _wide(P)), felt((pushed + _wide(N) * y) / _wide(P))
        turns.append(above)
    joints.append(y)
    shape = np.broadcast_shapes(*(np.shape(values) for values in joints))
    return np.array([np.broadcast_to(values, shape) for values in joints]), turns


def _wide(values: Any) -> Any:
    """Numbers of chains (P, W) beside those of chains and loads (P, L, W)."""
    return values[:, None]


def _loaded(block: Block, loads: list[Load]) -> tuple[Any, Any]:
    """Torques on links and forces on their centres, (n, 1, L, 1), of unit loads."""
    torque, force = np.zeros((2, block.n, 1, len(loads), 1))
    for column, (what, link) in enumerate(loads):
        if what == FORCE:
            force[link, 0, column] = 1.0
        else:
            torque[link, 0, column] = 1.0
            torque[link - 1 : link, 0, column] = -1.0 if what == TORQUE else 0.0
    return torque, force


def cart_of(cart: CartNumbers, mass: Any, numbers: Arithmetic) -> tuple[Any, Any, Any]:
    """The cart's displacement (W,) for a unit force, for a unit of ω²ε, and for the ground's.

    `mass` (W,) is what it feels of the pendula; without a spring and a damper its equation is divided by ω².
    """
    omega, felt = numbers.omega, numbers.felt
    whole = felt(numbers.number(cart.mass) + mass)
    if not (cart.stiffness or cart.damping):
        inertial = numbers.number(-1.0) / numbers.pivot(whole, numbers.number(cart.mass) + abs(whole))
        return inertial / (omega * omega), inertial, 0 * whole
    held = numbers.number(cart.stiffness)
    if cart.damping:
        held = held + numbers.imaginary(numbers.number(cart.damping) * omega)
    direct = numbers.number(1.0) / felt(numbers.pivot(held - omega * omega * whole, held))
    return direct, direct * omega * omega, direct * held
