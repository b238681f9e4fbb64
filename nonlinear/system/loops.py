"""Loops of feedback: the measurement of each, and where its input acts.

    u = −Σ gain (Σ c y − rest − reference),    limited to ±limit,

with y = (q, q').  Its numbers are gains, references and the limit; its measurement belongs to the form of a scene.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from modal.scene import Scene
from modal.scene.points import Place, carrier_end
from modal.statespace.geometry import geometry_of
from modal.statespace.loops import Loop, loops_of
from modal.statespace.signals import is_point, point_input
from nonlinear.system.prescribed import ALONG, DIRECTIONS, ActingForce

Reading = tuple[tuple[tuple[int, float], ...], float]
"""The places in y with their factors c, and the rest."""


@dataclass(frozen=True)
class ActingLoop(ActingForce):
    """A force (N) or torque (N m) whose size depends on the measurement, or (`coordinate`) one on a coordinate.

    With a `sample_time` (s) it is held between samples, and acts so many samples later; `entry` is that of the scene.
    """

    coordinate: int | None = None
    entry: int = 0
    readings: tuple[Reading, ...] = ()
    gains: tuple[Any, ...] = ()
    references: tuple[Any, ...] = ()
    limit: Any = None
    sample_time: float = 0.0
    delayed_samples: int = 0

    @property
    def numbers(self) -> list[Any]:
        """Its numbers in order."""
        return [*self.gains, *self.references, *([] if self.limit is None else [self.limit])]

    @property
    def keys(self) -> list[str]:
        """Their names in a scene; "" for those of a matrix."""
        gains = [""] * len(self.gains) if not self.references else ["gain"]
        return [*gains, *(["reference"] * len(self.references)), *([] if self.limit is None else ["limit"])]

    def with_numbers(self, numbers: Iterator[Any]) -> ActingLoop:
        """The same with the next of these numbers."""
        gains, references = (tuple(next(numbers) for _ in part) for part in (self.gains, self.references))
        limit = None if self.limit is None else next(numbers)
        return replace(self, gains=gains, references=references, limit=limit)

    @property
    def shape(self) -> tuple[Any, ...]:
        """Its non-numeric part."""
        acting = self.places, self.direction, self.carrier, self.coordinate
        return (*acting, self.readings, len(self.references), self.limit is None, bool(self.sample_time))


def acting_loops(scene: Scene) -> tuple[ActingLoop, ...]:
    """The loops of a scene, input by input."""
    if not scene.feedback:
        return ()
    return tuple(_acting(scene, loop) for loop in loops_of(scene))


def _acting(scene: Scene, loop: Loop) -> ActingLoop:
    felt = np.flatnonzero(loop.gains) if loop.entry.gains else np.array([0])
    readings = tuple(
        (tuple((int(k), float(loop.rows[row, k])) for k in np.flatnonzero(loop.rows[row])), float(loop.rests[row]))
        for row in felt.tolist()
    )
    places, direction, carrier, coordinate = _where(scene, loop.signal.name)
    return ActingLoop(
        places,
        direction,
        motion=None,  # type: ignore[arg-type]
        carrier=carrier,
        coordinate=coordinate,
        entry=loop.number,
        readings=readings,
        gains=tuple(loop.gains[felt].tolist()),
        references=() if loop.entry.gains else (loop.entry.reference,),
        limit=loop.entry.limit,
        sample_time=loop.entry.sample_time or 0.0,
        delayed_samples=loop.entry.delayed_samples,
    )


def _where(scene: Scene, name: str) -> tuple[tuple[Place, ...], Any, Any, int | None]:
    """The places of an input, its direction, its point of a support, or the coordinate that it acts on."""
    if is_point(name):
        point = point_input(scene, name)
        if not point.places and point.carrier is None:
            return (), ALONG, None, 0
        return point.places, DIRECTIONS.get(point.direction), carrier_end(scene, point.on), None
    geometry = geometry_of(scene)
    coordinates = [coordinate.force for coordinate in geometry.coordinates]
    if name in coordinates:
        return (), ALONG, None, coordinates.index(name)
    kind, _, label = name.partition("_")
    link = geometry.labels.index(label)
    above = link - 1 if link and geometry.pendulum[link - 1] == geometry.pendulum[link] else -1
    return (Place(link, above, None),), ALONG if kind == "force" else None, None, None
