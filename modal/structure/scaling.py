"""A structure in other units of mass, length and time."""

from __future__ import annotations

from dataclasses import replace
from math import sqrt

from modal.structure.carriers import CarrierNumbers
from modal.structure.structure import CarrierEnd, End, GroundEnd, LinkEnd, Pivot, SpringNumbers, Structure, Where


def scaled(structure: Structure, mass: float, length: float, gravity: float) -> Structure:
    """The same structure with these units of mass (kg), length (m) and acceleration (m/s²).

    Coordinates in m change with the unit of length; angles and those of modal supports keep their values.
    """
    force, rate = mass * gravity, sqrt(gravity / length)
    metres = force / length, mass * rate
    angles = force * length, mass * length**2 * rate

    def place(where: Where) -> Where:
        return where if isinstance(where, int) else (where[0] / length, where[1] / length)

    def carrier(own: CarrierNumbers) -> CarrierNumbers:
        position = own.position[0] / length, own.position[1] / length
        if own.M is not None and own.K is not None and own.D is not None and own.points is not None:
            return replace(
                own,
                position=position,
                M=own.M / (mass * length**2),
                K=own.K / angles[0],
                D=own.D / angles[1],
                points=own.points / length,
            )
        units = [angles if suffix.endswith("rad") else metres for suffix in own.suffixes]
        return replace(
            own,
            position=position,
            mass=own.mass / mass,
            inertia=own.inertia / (mass * length**2),
            length=own.length / length,
            centre=(own.centre[0] / length, own.centre[1] / length),
            stiffness=tuple(k / unit[0] for k, unit in zip(own.stiffness, units, strict=True)),
            damping=tuple(c / unit[1] for c, unit in zip(own.damping, units, strict=True)),
        )

    def end(own: End) -> End:
        if isinstance(own, LinkEnd):
            return LinkEnd(own.link, None if own.below is None else own.below / length)
        if isinstance(own, CarrierEnd):
            return CarrierEnd(own.carrier, place(own.where))
        return GroundEnd(None if own.place is None else (own.place[0] / length, own.place[1] / length))

    def spring(own: SpringNumbers) -> SpringNumbers:
        unit = angles if own.torsion else metres
        first, second = own.ends
        ends, stiffness, damping = (end(first), end(second)), own.stiffness / unit[0], own.damping / unit[1]
        return own._replace(ends=ends, stiffness=stiffness, damping=damping)

    return Structure(
        tuple(map(carrier, structure.carriers)),
        tuple(_pivots(structure, place)),
        tuple(map(spring, structure.springs)),
    )


def coordinate_units(structure: Structure, length: float) -> tuple[float, ...]:
    """The unit of every coordinate where that of length is `length` (m): itself in m, 1 of angles and modal ones."""
    return tuple(
        length if own.M is None and not suffix.endswith("rad") else 1.0
        for own in structure.carriers
        for suffix in own.suffixes
    )


def _pivots(structure: Structure, place: object) -> list[Pivot]:
    assert callable(place)
    known: dict[Pivot, Pivot] = {}
    for pivot in structure.pivots:
        if pivot not in known:
            known[pivot] = Pivot(pivot.carrier, place(pivot.where))
    return [known[pivot] for pivot in structure.pivots]
