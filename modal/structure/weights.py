"""The weights that a structure carries as drawn: what its springs hold at rest, and what nothing holds.

    W_i = g Σ m ∂z/∂η_i    (z down, of every mass that the carriers and their pendula have, at the drawn rest)

A carrier's own spring carries W_i where it has one, so that its potential is ½ k η² + W η; a modal support always does,
and holds its own weight in K.  Springs between points are unstretched as drawn.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import groupby
from typing import Any, NamedTuple

import numpy as np

from modal.scene import Scene
from modal.scene.doors import require_type
from modal.scene.points import Where
from modal.structure.structure import Structure, structure_of

BALANCED = 1e-12
"""Of the sum of the sizes of all moments: what is left of moments that balance."""
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
    """A coordinate of η, and m ∂z/∂η (kg, kg m) of one mass by it, of all that the carriers are and carry."""
    masses: list[tuple[int, Where, Any]] = [
        (index, carrier.centre, carrier.mass)
        for index, carrier in enumerate(structure.carriers)
        if carrier.size and carrier.M is None
    ]
    hung = zip(structure.pivots, hung_mass, strict=True)
    for _, together in groupby(hung, key=lambda each: id(each[0])):
        pivots, below = zip(*together, strict=True)
        masses.append((*pivots[0], sum(below[1:], below[0])))
    for index, where, mass in masses:
        carrier = structure.carriers[index]
        rest = [0.0] * carrier.size
        for k, (_, down) in enumerate(carrier.moving(where, rest, rest).slopes, structure.offsets[index]):
            yield k, mass * down


def weights(structure: Structure, hung_mass: Sequence[float], gravity: float) -> list[Weight]:
    """W_i of every coordinate η at the drawn rest; `hung_mass` (kg) is that below every pivot."""
    forces, sizes = [0.0] * structure.size, [0.0] * structure.size
    for k, moment in _moments(structure, hung_mass):
        forces[k] += gravity * moment
        sizes[k] += gravity * abs(moment)
    return list(map(Weight, forces, sizes))


def carried(structure: Structure, hung_mass: Sequence[Any], gravity: Any) -> list[Any]:
    """W_i (N, N m) of every coordinate whose own spring carries it, 0 of any other.

    Numbers may be floats, arrays of any one shape, or symbols.  A stiffness of 0 carries nothing; a symbol is taken to
    carry, and an array where any of it is not 0.

    >>> from modal import load
    >>> from modal.structure import structure_of
    >>> ship = load("ship-crane")  # in heave −g (2,000 t + 50 t), in roll −g 50 t · 12 m
    >>> [float(force) for force in carried(structure_of(ship), hung_masses(ship), ship.gravity)]
    [0.0, -20110500.0, -5886000.0]
    """
    held, moments = _held(structure), [0.0] * structure.size
    for k, moment in _moments(structure, hung_mass):
        moments[k] = moments[k] + moment
    return [gravity * moment if holds else 0.0 for moment, holds in zip(moments, held, strict=True)]


def _held(structure: Structure) -> list[bool]:
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


def unbalanced(scene: Scene) -> Iterator[str]:
    """A sentence for every coordinate whose weights nothing holds: the drawn scene is then no equilibrium."""
    require_type("scene", scene, "Scene")
    structure = structure_of(scene)
    coordinates = [(carrier.name, suffix) for carrier in structure.carriers for suffix in carrier.suffixes]
    every = weights(structure, hung_masses(scene), scene.gravity)
    for (name, suffix), weight, held in zip(coordinates, every, _held(structure), strict=True):
        if held or abs(weight.force) <= BALANCED * weight.size:
            continue
        verb, unit = VERBS[suffix.rpartition("_")[2]]
        key = "stiffness" + (f".{suffix.partition('_')[0]}" if "_" in suffix else "")
        place = f"support.{name}" if isinstance(scene.support, tuple) else "support"
        way = "balance them" if unit == "N m" else "hold it otherwise"
        force = abs(weight.force) if unit == "N" else weight.force
        yield f"{place}: the weights {verb} {force:.6g} {unit}, which nothing holds: give it {key}, or {way}"
