"""The structure of a scene: its supports, the first joints on them, and the springs between points.

With the coordinates η of all supports one after another, the pivots r_p(η) with J_p = ∂r_p/∂η, and a chain whose
reaction to an acceleration a of its pivot is the force R (a − g e_z) + p,

    (M_s(η) + Σ J_pᵀ R_p J_p) η'' = Q_s − Σ J_pᵀ [p_p + R_p (J_p' η' − g e_z)] − Σ (torques of first joints)

A first joint on a support that turns measures its angle from the support. A support's own spring acts on η and carries
the weight at the drawn equilibrium: its potential is ½ k η² + W η with W_i = g Σ m ∂z/∂η_i there (z down, of every mass
of the supports and their pendula), where k_i > 0; a modal support always does, and holds its own weight in K. Springs
between points are unstretched as drawn.

Near the drawn equilibrium a pivot moves along the rail by Φ η and down by Ψ η; a joint on a support that turns acts on
θ − φ, φ = Ω η.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import groupby
from math import sqrt
from typing import Any, NamedTuple

import numpy as np

from modal.scene import Scene
from modal.scene.doors import require_type
from modal.scene.points import CarrierEnd, End, GroundEnd, LinkEnd, Where, hanging_points, joined_points
from modal.structure.carriers import CarrierNumbers, carrier_numbers
from modal.types import NOISE_OF_SUM, Floats


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


Row = dict[int, float]
"""The entries of a row by their coordinates."""


class Phi(NamedTuple):
    """Rows (P, d) of all pivots: displacements along the rail and down, and the angles of their supports."""

    rail: Floats
    down: Floats
    turning: Floats


def phi(structure: Structure) -> Phi:
    """Return the linear motion of all pivots at the drawn equilibrium.

    >>> from modal import Bob, Pendulum, Scene
    >>> from modal.scene import Tilt
    >>> from modal.structure import structure_of
    >>> hung = Pendulum(links=[Bob(mass=1.0, length=1.0)], position=(0.0, 0.25))
    >>> board = Tilt(mass=2.0, inertia=0.5, stiffness=9.0)
    >>> phi(structure_of(Scene(gravity=9.81, support=board, pendulum=[hung]))).rail.tolist()
    [[0.25]]
    """
    numbers: dict[tuple[int, Where], int] = {}
    at = np.array([numbers.setdefault((pivot.carrier, pivot.where), len(numbers)) for pivot in structure.pivots])
    rows = np.zeros((3, len(numbers), structure.size))
    for (carrier, where), k in numbers.items():
        ways = (*slopes(structure, carrier, where), turning(structure, carrier))
        for part, row in zip(rows, ways, strict=True):
            for column, value in row.items():
                part[k, column] = value
    return Phi(*rows[:, at])


def slopes(structure: Structure, carrier: int, where: Where) -> tuple[Row, Row]:
    """Return ∂(x, z)/∂η of a point of a support at rest."""
    body, first = structure.carriers[carrier], structure.offsets[carrier]
    zeros = (0.0,) * body.size
    rows = body.moving(where, zeros, zeros).slopes
    rail_row, down_row = ({first + k: float(row[way]) + 0.0 for k, row in enumerate(rows)} for way in (0, 1))
    return rail_row, down_row


def turning(structure: Structure, carrier: int) -> Row:
    """Return ∂φ/∂η of a support."""
    angle = structure.angle_of(carrier)
    return {} if angle is None else {angle: 1.0}


def bends(body: CarrierNumbers, where: Where) -> Iterator[tuple[int, float]]:
    """Return −∂²z/∂η_k² (1/m, m) of a point of a support at rest, by its own coordinates k; mixed derivatives are 0."""
    zeros = (0.0,) * body.size
    for k in range(body.size) if body.bends else ():
        rates = tuple(float(k == j) for j in range(body.size))
        if bend := -float(body.moving(where, zeros, rates).bias[1]):
            yield k, bend


def is_damped(structure: Structure) -> bool:
    """Whether a support or a spring has a damper."""
    of_carriers = any(
        any(map(np.any, carrier.damping)) or (carrier.D is not None and carrier.D.any())
        for carrier in structure.carriers
    )
    return of_carriers or any(np.any(spring.damping) for spring in structure.springs)


def drawn_together(first: tuple[Any, Any], second: tuple[Any, Any]) -> Any:
    """Whether two ends of a spring, (m along, m down), coincide as drawn; elementwise for arrays.

    >>> bool(drawn_together((0.1 + 0.2, 1.0), (0.3, 1.0)))
    True
    """
    parts = np.array(np.broadcast_arrays(*first, *second))
    distance = np.hypot(*(parts[:2] - parts[2:]))
    return distance <= NOISE_OF_SUM * np.abs(parts).max(0)


def tied(structure: Structure, sizes: Sequence[int]) -> frozenset[int]:
    """Return the pendula, with these numbers of links, to which springs are attached."""
    ends = np.cumsum(sizes)
    links = [end.link for spring in structure.springs for end in spring.ends if isinstance(end, LinkEnd)]
    return frozenset(np.searchsorted(ends, links, side="right").tolist()) if links else frozenset()


VERBS = {"rad": ("turn it with", "N m"), "m": ("pull it with", "N")}


class Weight(NamedTuple):
    """The generalized force of all weights on a coordinate, N or N m, and the sum of the sizes of its parts."""

    force: float
    size: float


def hung_masses(scene: Scene) -> list[float]:
    """The mass (kg) that hangs from every pivot, in the order of `Structure.pivots`."""
    require_type("scene", scene, "Scene")
    masses = [(sum(link.mass * link.count for link in pendulum.links), pendulum.count) for pendulum in scene.pendulum]
    return [mass for mass, count in masses for _ in range(count)]


def _moments(structure: Structure, hung_mass: Sequence[Any]) -> Iterator[tuple[int, Any]]:
    """A coordinate of η, and m ∂z/∂η (kg, kg m) of one mass by it, of all that the supports are and carry."""
    masses: list[tuple[int, Where, Any]] = [
        (index, carrier.centre, carrier.mass)
        for index, carrier in enumerate(structure.carriers)
        if carrier.size and carrier.M is None
    ]
    pairs = zip(structure.pivots, hung_mass, strict=True)
    for _, members in groupby(pairs, key=lambda pair: id(pair[0])):
        pivots, masses_of_pivots = zip(*members, strict=True)
        masses.append((*pivots[0], sum(masses_of_pivots[1:], masses_of_pivots[0])))
    for index, where, mass in masses:
        carrier = structure.carriers[index]
        rest = [0.0] * carrier.size
        for k, (_, down) in enumerate(carrier.moving(where, rest, rest).slopes, structure.offsets[index]):
            yield k, mass * down


def weights(structure: Structure, hung_mass: Sequence[float], gravity: float) -> list[Weight]:
    """Return W_i of every coordinate η at the drawn equilibrium; `hung_mass` (kg) is that below every pivot."""
    forces, sizes = [0.0] * structure.size, [0.0] * structure.size
    for k, moment in _moments(structure, hung_mass):
        forces[k] += gravity * moment
        sizes[k] += gravity * abs(moment)
    return list(map(Weight, forces, sizes))


def carried_weights(structure: Structure, hung_mass: Sequence[Any], gravity: Any) -> list[Any]:
    """Return W_i (N, N m) of every coordinate whose own spring carries it, 0 for any other.

    Numbers may be floats, arrays of one shape, or symbols. A stiffness of 0 carries nothing; a symbol carries, and so
    does an array with a nonzero entry.

    >>> from modal import load
    >>> from modal.structure import structure_of
    >>> ship = load("ship-crane")  # in heave −g (2,000 t + 50 t), in roll −g 50 t · 12 m
    >>> [float(force) for force in carried_weights(structure_of(ship), hung_masses(ship), ship.gravity)]
    [0.0, -20110500.0, -5886000.0]
    """
    is_held, moments = _has_spring(structure), [0.0] * structure.size
    for k, moment in _moments(structure, hung_mass):
        moments[k] = moments[k] + moment
    return [gravity * moment if holds else 0.0 for moment, holds in zip(moments, is_held, strict=True)]


def _has_spring(structure: Structure) -> list[bool]:
    """Whether each coordinate has a spring of its own; a modal support holds all of its own."""
    return [
        carrier.M is not None or _is_there(carrier.stiffness[k])
        for carrier in structure.carriers
        for k in range(carrier.size)
    ]


def _is_there(number: Any) -> bool:
    """Whether a number is not 0: of symbols all, of arrays any."""
    if isinstance(number, np.ndarray):
        return number.dtype.hasobject or bool(number.any())
    return not isinstance(number, float | int) or number != 0


def find_imbalance(scene: Scene) -> Iterator[str]:
    """Return a sentence for every coordinate with unbalanced weights: the drawn scene is then not an equilibrium."""
    require_type("scene", scene, "Scene")
    structure = structure_of(scene)
    coordinates = [(carrier.name, suffix) for carrier in structure.carriers for suffix in carrier.suffixes]
    coordinate_weights = weights(structure, hung_masses(scene), scene.gravity)
    for (name, suffix), weight, is_held in zip(coordinates, coordinate_weights, _has_spring(structure), strict=True):
        if is_held or abs(weight.force) <= NOISE_OF_SUM * weight.size:
            continue
        verb, unit = VERBS[suffix.rpartition("_")[2]]
        key = "stiffness" + (f".{suffix.partition('_')[0]}" if "_" in suffix else "")
        place = f"support.{name}" if isinstance(scene.support, tuple) else "support"
        way = "balance them" if unit == "N m" else "hold it otherwise"
        force = abs(weight.force) if unit == "N" else weight.force
        yield f"{place}: the weights {verb} {force:.6g} {unit}, which nothing holds: give it {key}, or {way}"
