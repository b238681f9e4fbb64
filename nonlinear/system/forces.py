"""Forces on points of a scene, whose sizes are functions of time."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from modal.scene import Scene, places_of
from modal.scene.points import Place
from modal.structure import CarrierEnd, carrier_end
from modal.types import Ints

if TYPE_CHECKING:
    from modal.vibration import Course, PrescribedMotion

Direction = tuple[float, float]
ALONG, UP = (1.0, 0.0), (0.0, -1.0)
"""Components along the rail and down."""
DIRECTIONS: dict[str, Direction] = {"horizontal": ALONG, "vertical": UP}


class Spot(NamedTuple):
    """Where in a group a force acts: the row of the link, the columns of its pendula, the distance from its joint."""

    row: int
    columns: Ints
    below: float | None


@dataclass(frozen=True)
class ActingForce:
    """A force (N) or torque (N m) at `places`, none for the cart; its size is a `course` of time.

    `direction` is along the rail or upwards, None for a torque.  `carrier` is a point of a structure, where it acts on
    one.
    """

    places: tuple[Place, ...]
    direction: Direction | None
    motion: PrescribedMotion
    carrier: CarrierEnd | None = None

    @property
    def course(self) -> Course:
        """Its size in time."""
        from modal.vibration import Course

        return Course(self.motion, self.motion.force)

    def spots(self, index: Ints) -> list[Spot]:
        """Where it acts in a group whose links have these positions (n, P) in the file."""
        where = {int(link): at for at, link in np.ndenumerate(index)}
        columns: dict[tuple[int, float | None], list[Any]] = {}
        for place in self.places:
            if place.link in where:
                row, column = where[place.link]
                columns.setdefault((row, place.below), []).append(column)
        return [Spot(row, np.array(pendula), below) for (row, below), pendula in columns.items()]


def acting_forces(scene: Scene) -> tuple[ActingForce, ...]:
    """The forces on a scene as functions of time."""
    if not scene.force:
        return ()
    from modal.vibration import prescribed_motion

    return tuple(
        ActingForce(
            tuple(places_of(scene, force.on)),
            DIRECTIONS.get(force.direction),
            prescribed_motion(force),
            carrier_end(scene, force.on) if scene.is_structured else None,
        )
        for force in scene.force
    )
