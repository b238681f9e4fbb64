"""Displacements of supports under which a scene is invariant: those of free carts."""

from __future__ import annotations

import numpy as np

from modal.structure import CarrierEnd, End, LinkEnd, Structure
from modal.types import Floats
from nonlinear.system.system import System


def translations(system: System) -> Floats:
    """Displacements (m) of the coordinates before those of links that leave every force as it is, (k, first).

    One of a cart that no spring holds; on a structure one of each set of carts and platforms that springs join to each
    other and to nothing else.  Dampers may resist them.

    >>> from modal import load
    >>> from nonlinear.system import system_of
    >>> translations(system_of(load("paper-cart-2"))).tolist()
    [[1.0]]
    """
    structure, sets = system.suspension, _sets(system, system.suspension)
    moves = np.zeros((len(structure.carriers), system.first))
    for owner, carrier, offset in zip(sets[1:], structure.carriers, structure.offsets, strict=False):
        if owner != -1 and carrier.sliding is not None:
            moves[owner, offset + carrier.sliding] = 1.0
    return moves[moves.any(1)]


def _sets(system: System, structure: Structure) -> list[int]:
    """The set to which the ground and each support belong; those that something holds are in the ground's, −1."""
    sets = [-1, *range(len(structure.carriers))]

    def join(member: int, other: int) -> None:
        first, second = sorted((sets[member], sets[other]))
        sets[:] = [first if number == second else number for number in sets]

    for number, carrier in enumerate(structure.carriers, 1):
        if carrier.sliding is None or carrier.stiffness[carrier.sliding]:
            join(0, number)
    for spring, is_slack in zip(structure.springs, system.slack, strict=True):
        first_set, right = (_carrier(system, structure, end) for end in spring.ends)
        turns_damper = not is_slack and not (first_set and right)  # its direction depends on where the free end is
        if not spring.torsion and (spring.stiffness or (spring.damping and turns_damper)):
            join(first_set, right)
    return sets


def _carrier(system: System, structure: Structure, end: End) -> int:
    """The number from 1 of the support on which an end is, or below which it hangs; 0 of the ground."""
    if isinstance(end, LinkEnd):
        return structure.pivots[int(system.pendulum[end.link])].carrier + 1
    return end.carrier + 1 if isinstance(end, CarrierEnd) else 0
