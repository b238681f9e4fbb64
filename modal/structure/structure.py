"""The structure of a scene: its supports, the first joints on them, and the springs between points.

With the coordinates η of all supports one after another, the pivots r_p(η) with J_p = ∂r_p/∂η, and a chain whose
reaction to an acceleration a of its pivot is the force R (a − g e_z) + p,

    (M_s(η) + Σ J_pᵀ R_p J_p) η'' = Q_s − Σ J_pᵀ [p_p + R_p (J_p' η' − g e_z)] − Σ (torques of first joints)

A first joint on a support that turns measures its angle from the support. A support's own spring acts on η and carries
the weight at the drawn equilibrium: its potential is ½ k η² + W η with W_i = g Σ m ∂z/∂η_i there, where k_i > 0.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import sqrt
from typing import Any, NamedTuple

from modal.scene import Scene
from modal.scene.doors import require_type
from modal.scene.points import CarrierEnd, End, GroundEnd, LinkEnd, Where, hanging_points, joined_points
from modal.structure.carriers import CarrierNumbers, carrier_numbers


class SpringNumbers(NamedTuple):
    """A spring and damper between two ends, N/m and N s/m; `torsion` N m/rad and N m s/rad between their angles.

    `entry` is its entry in the file.
    """

    ends: tuple[End, End]
    torsion: bool
    stiffness: Any
    damping: Any
    entry: int = 0


@dataclass(frozen=True, eq=False)
class Structure:
    """Supports in the order of the file, a pivot for each pendulum counting copies, springs."""

    carriers: tuple[CarrierNumbers, ...]
    pivots: tuple[CarrierEnd, ...]
    springs: tuple[SpringNumbers, ...]

    @cached_property
    def offsets(self) -> tuple[int, ...]:
        """The first coordinate of each support, and the number of all."""
        ends = [0]
        for carrier in self.carriers:
            ends.append(ends[-1] + carrier.size)
        return tuple(ends)

    @property
    def size(self) -> int:
        """The number of coordinates η."""
        return self.offsets[-1]

    @cached_property
    def names(self) -> tuple[str, ...]:
        """The name of every coordinate with its unit: NAME_m, NAME_rad, NAME_sway_m, …; x for a single cart."""
        if [carrier.kind for carrier in self.carriers] == ["cart"]:
            return ("x",)
        return tuple(f"{carrier.name}_{suffix}" for carrier in self.carriers for suffix in carrier.suffixes)

    @cached_property
    def turning(self) -> tuple[int, ...]:
        """Which of η are rotation angles of supports."""
        angles = (self.angle_of(carrier) for carrier in range(len(self.carriers)))
        return tuple(angle for angle in angles if angle is not None)

    def part(self, carrier: int, values: Sequence[Any]) -> Sequence[Any]:
        """Return the coordinates of a support."""
        return values[self.offsets[carrier] : self.offsets[carrier + 1]]

    def angle_of(self, carrier: int) -> int | None:
        """Return which of η is the angle of a support; None if it does not turn."""
        turning = self.carriers[carrier].turning
        return None if turning is None else self.offsets[carrier] + turning


def structure_of(scene: Scene) -> Structure:
    """Return the structure of a scene with `Scene.is_structured`."""
    require_type("scene", scene, "Scene")
    carriers = tuple(carrier_numbers(support) for support in scene.supports)
    pivots = tuple(hanging_points(scene))
    springs = tuple(
        SpringNumbers(ends, spring.kind == "torsion", spring.stiffness, spring.damping, entry)
        for entry, ends in joined_points(scene)
        for spring in [scene.spring[entry]]
    )
    return Structure(carriers, pivots, springs)


def unit_size(unit: str, mass: float, length: float, gravity: float) -> float:
    """Return the size of a unit of kg, m, s, N, J and rad in units of mass (kg), length (m) and acceleration (m/s²).

    >>> from modal.structure.structure import unit_size
    >>> unit_size("N m/rad", 2.0, 0.5, 10.0)
    10.0
    """
    sizes = {"kg": mass, "m": length, "s": sqrt(length / gravity), "N": mass * gravity, "J": mass * gravity * length}
    size, (over, _, under) = 1.0, unit.partition("/")
    for part, sign in ((over, 1), (under, -1)):
        for word in part.split():
            name = word.rstrip("²³")
            size *= sizes.get(name, 1.0) ** (sign * {"": 1, "²": 2, "³": 3}[word.removeprefix(name)])
    return size


def scale_structure(structure: Structure, mass: float, length: float, gravity: float) -> Structure:
    """Return the structure in these units of mass (kg), length (m) and acceleration (m/s²).

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
            parameters=tuple(
                value / unit_size(parameter.unit, mass, length, gravity)
                for parameter, value in zip(
                    numbers.path.parameters if numbers.path else (), numbers.parameters, strict=True
                )
            ),
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

    pivots = {pivot: CarrierEnd(pivot.carrier, place(pivot.where)) for pivot in set(structure.pivots)}
    carriers, springs = tuple(map(carrier, structure.carriers)), tuple(map(spring, structure.springs))
    return Structure(carriers, tuple(pivots[pivot] for pivot in structure.pivots), springs)


def coordinate_units(structure: Structure, length: float) -> tuple[float, ...]:
    """Return the unit of every coordinate for the unit of length `length` (m); 1 for angles and modal coordinates."""
    return tuple(
        length if carrier.M is None and not suffix.endswith("rad") else 1.0
        for carrier in structure.carriers
        for suffix in carrier.suffixes
    )
