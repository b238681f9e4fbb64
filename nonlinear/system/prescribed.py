"""Prescribed functions of time: forces on points of a scene, and the motion of a support.

The scene is described in the frame of its support, which accelerates with it.  There every mass m has, besides
gravity, the force −m a; positions in the laboratory are those in the frame plus the support's displacement.  Vectors
have the components (along the rail, down), in space (along, across, down).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from modal.scene import Scene, SupportMotion, places_of
from modal.scene.points import Place, carrier_end
from modal.structure import CarrierEnd
from modal.types import Floats, Ints
from modal.vibration import Course, PrescribedMotion, prescribed_motion

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
    forces = []
    for force in scene.force:
        places, direction = tuple(places_of(scene, force.on)), DIRECTIONS.get(force.direction)
        forces.append(ActingForce(places, direction, prescribed_motion(force), carrier_end(scene, force.on)))
    return tuple(forces)


@dataclass(frozen=True)
class MovingSupport:
    """The support's motions, each with its direction: along the rail, or upwards."""

    motions: tuple[tuple[Direction, PrescribedMotion], ...]

    @property
    def ways(self) -> list[str]:
        """The directions in words."""
        return ["along the rail" if along else "upwards" for along, _ in self.directions]

    @property
    def directions(self) -> tuple[Direction, ...]:
        """The directions of all motions."""
        return tuple(direction for direction, _ in self.motions)

    def components(self, sizes: Any) -> tuple[Any, Any]:
        """The components along the rail and down of one number for each motion; 0.0 if none has any."""
        along, down = 0.0, 0.0
        for (x, z), size in zip(self.directions, sizes, strict=True):
            along = along + x * size if x else along
            down = down + z * size if z else down
        return along, down

    def acceleration(self, time: float) -> tuple[float, float]:
        """Its acceleration (m/s²) along the rail and down, at one time (s)."""
        return self.components([motion.acceleration_at(time) for _, motion in self.motions])

    def velocity(self, time: float) -> tuple[float, float]:
        """Its velocity (m/s) along the rail and down, at one time (s)."""
        return self.components([motion.velocity_at(time) for _, motion in self.motions])

    def displacements(self, times: Floats, dimensions: int) -> Floats:
        """Its place in the laboratory (m), (T, d)."""
        return self._vectors(times, 0, dimensions)

    def accelerations(self, times: Floats, dimensions: int) -> Floats:
        """Its acceleration (m/s²), (T, d)."""
        return self._vectors(times, 2, dimensions)

    def velocities(self, times: Floats, dimensions: int) -> Floats:
        """Its velocity (m/s), (T, d)."""
        return self._vectors(times, 1, dimensions)

    def _vectors(self, times: Floats, order: int, dimensions: int) -> Floats:
        vectors = np.zeros((len(times), dimensions))
        sizes = [np.asarray(motion.derivative(times, order)) for _, motion in self.motions]
        vectors[:, 0], vectors[:, -1] = self.components(sizes)
        return vectors

    def largest(self, times: Floats) -> Any:
        """The largest acceleration (m/s²) at times (T, ...), (...)."""
        sizes = [motion.beside(times, 2) for _, motion in self.motions]
        return np.sqrt(sum(size * size for size in sizes)).max(0)


def moving_support(motions: Sequence[SupportMotion]) -> MovingSupport:
    """The motions of a support or of the ground as functions of time."""
    return MovingSupport(tuple((DIRECTIONS[motion.direction], prescribed_motion(motion)) for motion in motions))
