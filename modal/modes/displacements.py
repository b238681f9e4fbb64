"""Displacements of centres of mass along the rail in a mode, where sums of angles cancel.

The frequency is refined in DIGITS digits, as the zero of 1/G for the turn G of one joint by its own torque, and the
shape is what that torque excites there (`modal.eigen.elimination`): a centre that hardly moves keeps its digits.
"""

from __future__ import annotations

from decimal import Context, Decimal, localcontext
from typing import Any

import numpy as np

from modal.assembly import Rig
from modal.eigen import TORQUE, Digits, cart_of, hung
from modal.modes.shapes import Shape
from modal.types import Complexes

DIGITS, AWAY, STEPS = 80, -25, 8
"""Decimal digits, the first step over the frequency as a power of ten, and most steps of the secant."""


def centre_displacements(rig: Rig, value: complex, shape: Shape) -> list[Complexes]:
    """The displacement z (copies, n) of every centre of mass, for each pendulum of the file, in a simple mode.

    `value` is its eigenvalue in 1/s and `shape` its shape, in the scale of which z is.
    """
    angles = np.split(shape.angles, np.cumsum([copies * rig.blocks[block].n for block, _, copies in rig.members])[:-1])
    each = [
        chain.reshape(copies, rig.blocks[block].n)
        for chain, (block, _, copies) in zip(angles, rig.members, strict=True)
    ]
    member = int(np.argmax([np.abs(chain).max() for chain in each]))
    copy, link = np.unravel_index(np.abs(each[member]).argmax(), each[member].shape)
    with localcontext(Context(prec=DIGITS)):
        centres, turns = _excited(rig, value, rig.members[member][:2], int(link), moved=shape.cart != 0)
        places = []
        for chain, (block, column, copies) in zip(each, rig.members, strict=True):
            z = np.zeros((copies, chain.shape[1]), dtype=np.complex128)
            for k in range(copies):
                at = int(np.abs(chain[k]).argmax())
                if shape.cart != 0 or ((block, column) == rig.members[member][:2] and chain[k, at] != 0):
                    ratio = centres[block][:, column] / turns[block][at, column]
                    z[k] = chain[k, at] * np.array([complex(factor) for factor in ratio])
            places.append(z)
    assert places[member][copy].any() or not shape.cart
    return places


def _excited(rig: Rig, value: complex, kind: tuple[int, int], link: int, *, moved: bool) -> tuple[list[Any], list[Any]]:
    """Centres and angles (n, P) of every block where the torque of one link excites the mode alone."""
    numbers = Digits(np.ones(1), DIGITS, is_real=not rig.is_damped)
    omega = numbers.number(np.array([value.imag]))
    if rig.is_damped:
        omega = omega - numbers.imaginary(numbers.number(np.array([value.real])))
    last: Any = None
    ahead = omega * (numbers.exact(np.array([1 + Decimal(1).scaleb(AWAY)])))
    for _ in range(STEPS):
        numbers.omega = omega
        centres, turns, turn = _loaded(rig, kind, link, numbers, moved=moved)
        inverse = numbers.exact(np.array([Decimal(1)])) / turn
        if last is None:
            last, omega = (omega, inverse), ahead
            continue
        slope = inverse - last[1]
        step = abs(complex(slope[0]))
        if not step or abs(complex(inverse[0])) < 1e-60 * abs(complex(last[1][0])) or _close(omega, last[0]):
            break
        following = omega - inverse * (omega - last[0]) / slope
        last, omega = (omega, inverse), following
    return centres, turns


def _close(omega: Any, last: Any) -> bool:
    return abs(complex((omega - last)[0])) <= 10.0 ** (20 - DIGITS) * abs(complex(omega[0]))


def _loaded(
    rig: Rig, kind: tuple[int, int], link: int, numbers: Digits, *, moved: bool
) -> tuple[list[Any], list[Any], Any]:
    """Centres (n, P) and angles with a torque on this link of every copy of a kind, and the turn of its joint (1,)."""
    loads = [[(TORQUE, link)] if block == kind[0] else [] for block in range(len(rig.blocks))]
    every = [hung(block, load, rig.gravity, numbers) for block, load in zip(rig.blocks, loads, strict=True)]
    pivot: Any = None
    if moved and rig.cart:
        counts = [numbers.number(block.count[:, None]) for block in rig.blocks]
        mass = np.sum([(count * hanging.mass).sum(0) for count, hanging in zip(counts, every, strict=True)], axis=0)
        _, inertial, _ = cart_of(rig.cart, mass, numbers)
        pivot = inertial * counts[kind[0]][kind[1]] * every[kind[0]].inertial[kind[1], 0]
    centres, turns = [], []
    for number, (block, hanging) in enumerate(zip(rig.blocks, every, strict=True)):
        zero = 0 * numbers.omega
        y = hanging.joints[:, :, 0] * pivot if pivot is not None else hanging.joints[:, :, 0] * 0
        theta = hanging.angles[:, :, 0] * pivot if pivot is not None else hanging.angles[:, :, 0] * 0
        if number == kind[0]:
            y[:, kind[1]] = y[:, kind[1]] + hanging.joints[:, kind[1], 1]
            theta[:, kind[1]] = theta[:, kind[1]] + hanging.angles[:, kind[1], 1]
            turn = theta[link, kind[1]] - (theta[link - 1, kind[1]] if link else zero)
        offset = numbers.number((block.sigma * block.centre)[..., None])
        centres.append((y[:-1] + offset * theta)[..., 0])
        turns.append(theta[..., 0])
    return centres, turns, turn
