"""Linear kinematics of a structure near its drawn equilibrium, in its coordinates η.

A pivot moves along the rail by Φ η and down by Ψ η; a joint on a support that turns acts on θ − φ, φ = Ω η.  As drawn,
the weights pull each coordinate with

    W_i = g Σ m ∂z/∂η_i (z down,

    of every mass of the supports and their pendula) A support's own spring, if any, carries W_i, so that its potential
    is ½ k η² + W η; a modal support always does,
and holds its own weight in K.  Springs between points are unstretched as drawn.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import groupby
from typing import Any, NamedTuple

import numpy as np

from modal.scene import Scene
from modal.scene.doors import require_type
from modal.scene.points import LinkEnd, Where
from modal.structure.carriers import CarrierNumbers
from modal.structure.structure import Structure, structure_of
from modal.types import NOISE_OF_SUM, Floats

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
