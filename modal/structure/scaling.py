"""A structure in other units of mass, length and time."""

from __future__ import annotations

from dataclasses import replace
from math import sqrt

from modal.scene.points import CarrierEnd, End, GroundEnd, LinkEnd, Where
from modal.structure.carriers import CarrierNumbers
from modal.structure.structure import Pivot, SpringNumbers, Structure


def scaled(structure: Structure, mass: float, length: float, gravity: float) -> Structure:
    """The same structure with these units of mass (kg), length (m) and acceleration (m/s²).

    Coordinates in m change with the unit of length; angles and those of modal supports keep their values.
    """
    force, rate = mass * gravity, sqrt(gravity / length)
    metres = force / length, mass * rate
    angles = force * length, mass * length**2 * rate

    def place(where: Where) -> Where:
        return where if isinstance(where, int) else (where[0] / length, where[1] / length)

    def carrier(numbers: CarrierNumbers) -> CarrierNumbers:
        position = numbers.position[0] / length, numbers.position[1] / length
        if numbers.M is not None and numbers.K is not None and numbers.D is not None and numbers.points is not None:
            return replace(
                numbers,
                position=position,
                M=numbers.M / (mass * length**2),
                K=numbers.K / angles[0],
                D=numbers.D / angles[1],
                points=numbers.points / length,
            )
        units = [angles if suffix.endswith("rad") else metres for suffix in numbers.suffixes]
        return replace(
            numbers,
            position=position,
            mass=numbers.mass / mass,
            inertia=numbers.inertia / (mass * length**2),
            length=numbers.length / length,
            centre=(numbers.centre[0] / length, numbers.centre[1] / length),
            stiffness=tuple(k / unit[0] for k, unit in zip(numbers.stiffness, units, strict=True)),
            damping=tuple(c / unit[1] for c, unit in zip(numbers.damping, units, strict=True)),
        )

    def end(side: End) -> End:
        if isinstance(side, LinkEnd):
            return LinkEnd(side.link, None if side.below is None else side.below / length)
        if isinstance(side, CarrierEnd):
            return CarrierEnd(side.carrier, place(side.where))
        return GroundEnd(None if side.place is None else (side.place[0] / length, side.place[1] / length))

    def spring(numbers: SpringNumbers) -> SpringNumbers:
        unit = angles if numbers.torsion else metres
        first, second = numbers.ends
        ends, stiffness, damping = (end(first), end(second)), numbers.stiffness / unit[0], numbers.damping / unit[1]
        return numbers._replace(ends=ends, stiffness=stiffness, damping=damping)

    return Structure(
        tuple(map(carrier, structure.carriers)),
        tuple(_pivots(structure, place)),
        tuple(map(spring, structure.springs)),
    )


def coordinate_units(structure: Structure, length: float) -> tuple[float, ...]:
    """The unit of every coordinate where that of length is `length` (m): itself in m, 1 of angles and modal ones."""
    return tuple(
        length if carrier.M is None and not suffix.endswith("rad") else 1.0
        for carrier in structure.carriers
        for suffix in carrier.suffixes
    )


def _pivots(structure: Structure, place: object) -> list[Pivot]:
    assert callable(place)
    known: dict[Pivot, Pivot] = {}
    for pivot in structure.pivots:
        if pivot not in known:
            known[pivot] = Pivot(pivot.carrier, place(pivot.where))
    return [known[pivot] for pivot in structure.pivots]
