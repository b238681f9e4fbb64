"""The weights that a structure carries as drawn: what its springs hold at rest, and what nothing holds.

    W_i = g Σ m ∂z/∂η_i    (z down, of every mass that the carriers and their pendula have, at the drawn rest)

A carrier's own spring carries W_i where it has one, so that its potential is ½ k η² + W η; a modal support always does,
and holds its own weight in K.  Springs between points are unstretched as drawn.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

from modal.scene import Scene
from modal.scene.doors import require_type
from modal.structure.carriers import CarrierNumbers
from modal.structure.structure import Structure, Where, structure_of

BALANCED = 1e-12
"""Of the sum of the sizes of all moments: what is left of moments that balance."""
VERBS = {"rad": ("turn it with", "N m"), "m": ("pull it with", "N")}


class Weight(NamedTuple):
    """The generalized force of all weights on a coordinate, N or N m, and the sum of the sizes of its parts."""

    force: Any
    size: Any


def hung_masses(scene: Scene) -> list[float]:
    """The mass (kg) that hangs from every pivot, in the order of `Structure.pivots`."""
    require_type("scene", scene, "Scene")
    masses = [(sum(link.mass * link.count for link in one.links), one.count) for one in scene.pendulum]
    return [mass for mass, count in masses for _ in range(count)]


def weights(structure: Structure, hung_mass: Sequence[Any], gravity: Any) -> list[Weight]:
    """W_i of every coordinate η at the drawn rest; `hung_mass` (kg) is that below every pivot."""
    own = [[(0.0, 0.0)] * carrier.size for carrier in structure.carriers]
    parts: list[tuple[int, Where, Any]] = [
        (index, carrier.centre, carrier.mass)
        for index, carrier in enumerate(structure.carriers)
        if carrier.size and carrier.M is None
    ]
    hung = [(pivot.carrier, pivot.where, mass) for pivot, mass in zip(structure.pivots, hung_mass, strict=True)]
    for index, where, mass in (*parts, *hung):
        carrier = structure.carriers[index]
        rest = [0.0] * carrier.size
        for k, (_, down) in enumerate(carrier.moving(where, rest, rest).slopes):
            force, size = own[index][k]
            own[index][k] = force + gravity * mass * down, size + gravity * mass * abs(down)
    return [Weight(*pair) for pairs in own for pair in pairs]


def carried(structure: Structure, hung_mass: Sequence[Any], gravity: Any) -> list[Any]:
    """W_i (N, N m) of every coordinate whose own spring carries it, 0 of any other.

    A stiffness that is the number 0 carries nothing; an array or a symbol is taken to carry.

    >>> from modal import load
    >>> from modal.structure import structure_of
    >>> ship = load("ship-crane")  # in heave −g (2,000 t + 50 t), in roll −g 50 t · 12 m
    >>> [float(force) for force in carried(structure_of(ship), hung_masses(ship), ship.gravity)]
    [0.0, -20110500.0, -5886000.0]
    """
    holds = [k for carrier in structure.carriers for k in _holds(carrier)]
    every = weights(structure, hung_mass, gravity)
    return [weight.force if held else 0.0 for weight, held in zip(every, holds, strict=True)]


def _holds(carrier: CarrierNumbers) -> list[bool]:
    """Whether each coordinate of a carrier has a spring of its own."""
    if carrier.M is not None:
        return [True] * carrier.size
    return [not (isinstance(stiffness, int | float) and stiffness == 0) for stiffness in carrier.stiffness]


def unbalanced(scene: Scene) -> Iterator[str]:
    """A sentence for every coordinate whose weights nothing holds: the drawn scene is then no equilibrium."""
    require_type("scene", scene, "Scene")
    structure = structure_of(scene)
    holds = [k for carrier in structure.carriers for k in _holds(carrier)]
    carriers = [carrier for carrier in structure.carriers for _ in range(carrier.size)]
    suffixes = [suffix for carrier in structure.carriers for suffix in carrier.suffixes]
    every = weights(structure, hung_masses(scene), scene.gravity)
    for carrier, suffix, weight, held in zip(carriers, suffixes, every, holds, strict=True):
        if held or abs(weight.force) <= BALANCED * weight.size:
            continue
        verb, unit = VERBS[suffix.rpartition("_")[2]]
        key = "stiffness" + (f".{suffix.partition('_')[0]}" if "_" in suffix else "")
        place = f"support.{carrier.name}" if isinstance(scene.support, tuple) else "support"
        way = "balance them" if unit == "N m" else "hold it otherwise"
        force = abs(weight.force) if unit == "N" else weight.force
        yield f"{place}: the weights {verb} {force:.6g} {unit}, which nothing holds: give it {key}, or {way}"
