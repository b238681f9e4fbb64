"""How a structure moves near its drawn rest, by linear combinations of its coordinates η.

A pivot moves along the rail by Φ η and down by Ψ η; a joint on a carrier that turns feels θ − φ, φ = Ω η.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from modal.scene.points import LinkEnd, Where
from modal.structure.carriers import CarrierNumbers
from modal.structure.structure import Structure
from modal.types import Floats

Row = dict[int, float]
"""The entries of a row by their coordinates."""
DRAWN_TOGETHER = 1e-12
"""Ends of a spring this close, over their distance from the origin, are one point as drawn."""


class Phi(NamedTuple):
    """Rows (P, d) of all pivots: displacements along the rail and down, and the angles of their carriers."""

    along: Floats
    down: Floats
    turning: Floats


def phi(structure: Structure) -> Phi:
    """How all pivots move at the drawn rest.

    >>> from modal import Bob, Pendulum, Scene
    >>> from modal.scene import Tilt
    >>> from modal.structure import structure_of
    >>> hung = Pendulum(links=[Bob(mass=1.0, length=1.0)], position=(0.0, 0.25))
    >>> board = Tilt(mass=2.0, inertia=0.5, stiffness=9.0)
    >>> phi(structure_of(Scene(gravity=9.81, support=board, pendulum=[hung]))).along.tolist()
    [[0.25]]
    """
    known: dict[tuple[int, Where], int] = {}
    at = np.array([known.setdefault((pivot.carrier, pivot.where), len(known)) for pivot in structure.pivots])
    rows = np.zeros((3, len(known), structure.size))
    for (carrier, where), k in known.items():
        ways = (*slopes(structure, carrier, where), turning(structure, carrier))
        for part, row in zip(rows, ways, strict=True):
            for column, value in row.items():
                part[k, column] = value
    return Phi(*(part[at] for part in rows))


def slopes(structure: Structure, carrier: int, where: Where) -> tuple[Row, Row]:
    """∂(x, z)/∂η of a point of a carrier at rest."""
    body, first = structure.carriers[carrier], structure.offsets[carrier]
    still = (0.0,) * body.size
    rows = body.moving(where, still, still).slopes
    along, down = ({first + k: float(row[way]) + 0.0 for k, row in enumerate(rows)} for way in (0, 1))
    return along, down


def turning(structure: Structure, carrier: int) -> Row:
    """∂φ/∂η of a carrier."""
    angle = structure.angle_of(carrier)
    return {} if angle is None else {angle: 1.0}


def bends(body: CarrierNumbers, where: Where) -> Iterator[tuple[int, float]]:
    """−∂²z/∂η_k² (1/m, m) of a point of a carrier at rest, by its own coordinates k; mixed derivatives are 0."""
    still = (0.0,) * body.size
    for k in range(body.size) if body.M is None else ():
        rates = tuple(float(k == j) for j in range(body.size))
        if bend := -float(body.moving(where, still, rates).bias[1]):
            yield k, bend


def is_damped(structure: Structure) -> bool:
    """Whether a carrier or a spring has a damper."""
    of_carriers = any(
        any(map(np.any, carrier.damping)) or (carrier.D is not None and carrier.D.any())
        for carrier in structure.carriers
    )
    return of_carriers or any(np.any(spring.damping) for spring in structure.springs)


def drawn_together(first: tuple[Any, Any], second: tuple[Any, Any]) -> bool:
    """Whether two ends of a spring, (m along, m down) or arrays of such, are one point as drawn.

    >>> drawn_together((0.1 + 0.2, 1.0), (0.3, 1.0))
    True
    """
    apart = np.hypot(np.subtract(first[0], second[0]), np.subtract(first[1], second[1]))
    largest = np.max([np.max(np.abs(part)) for part in (*first, *second)])
    return bool(np.all(apart <= DRAWN_TOGETHER * largest))


def tied(structure: Structure, sizes: Sequence[int]) -> frozenset[int]:
    """The pendula, of so many links each, that springs join to something."""
    ends = np.cumsum(sizes)
    links = [end.link for spring in structure.springs for end in spring.ends if isinstance(end, LinkEnd)]
    return frozenset(np.searchsorted(ends, links, side="right").tolist()) if links else frozenset()
