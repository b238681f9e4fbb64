"""Where the ends of springs between points are drawn."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np

from modal.structure import CarrierEnd, End, GroundEnd, LinkEnd, Structure, drawn_together

Vector = tuple[Any, Any]


class Grouped(Protocol):
    """What is asked of a system: its groups of pendula, and what carries them."""

    @property
    def groups(self) -> tuple[Any, ...]:
        """The groups (`nonlinear.system.Group`)."""
        ...

    @property
    def suspension(self) -> Structure:
        """The structure."""
        ...


def place_of(system: Grouped, link: int) -> tuple[Any, int, int]:
    """The group, row and column of a link in the order of the file."""
    for group in system.groups:
        rows, columns = np.nonzero(group.index == link)
        if len(rows):
            return group, int(rows[0]), int(columns[0])
    raise IndexError(link)


def drawn_place(system: Grouped, end: End) -> Vector | None:
    """Where an end is drawn (m); None for the ground below the other end."""
    structure = system.suspension
    if isinstance(end, GroundEnd):
        return end.place
    if isinstance(end, CarrierEnd):
        return _drawn_point(structure, end.carrier, end.where)
    group, row, column = place_of(system, end.link)
    pivot = structure.pivots[int(group.pendula[column])]
    x, z = _drawn_point(structure, pivot.carrier, pivot.where)
    for upper in range(row):
        z = z + group.block.length[upper, column]
    return x, z + (group.block.centre[row, column] if end.below is None else end.below)


def _drawn_point(structure: Structure, number: int, where: Any) -> Vector:
    carrier = structure.carriers[number]
    if isinstance(where, int):
        return carrier.position
    return carrier.position[0] + where[0], carrier.position[1] + where[1]


def ends_may_meet(system: Grouped) -> bool:
    """Whether pendula can bring both ends of a spring with a length as drawn together, where its force turns round.

    There it jumps, which series of a motion do not see and error control does; carriers are taken to stay apart.
    """
    for spring in system.suspension.springs:
        if spring.torsion or not np.any(spring.stiffness) or not any(isinstance(end, LinkEnd) for end in spring.ends):
            continue
        first, second = (drawn_place(system, end) for end in spring.ends)
        if first is not None and second is not None and not np.all(drawn_together(first, second)):
            length = np.min(np.hypot(np.subtract(first[0], second[0]), np.subtract(first[1], second[1])))
            if length <= sum(_reach(system, end) for end in spring.ends):
                return True
    return False


def _reach(system: Grouped, end: End) -> float:
    """How far (m) a pendulum brings an end from where it is drawn."""
    if not isinstance(end, LinkEnd):
        return 0.0
    group, row, column = place_of(system, end.link)
    distance = group.block.centre[row, column] if end.below is None else end.below
    return 2 * float(np.max(np.sum(group.block.length[:row, column], axis=0) + distance))


def slack_of(system: Grouped) -> tuple[Any, ...]:
    """Which springs of a structure have no length as drawn, of arrays each; no torsion spring has one."""
    slack = []
    for spring in system.suspension.springs:
        first, second = (None, None) if spring.torsion else (drawn_place(system, end) for end in spring.ends)
        slack.append(first is None or second is None or drawn_together(first, second))
    return tuple(slack)
