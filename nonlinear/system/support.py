"""A support that moves as prescribed.  The scene is described in its frame, which accelerates with it.

In that frame every mass m feels, besides gravity, the force −m a; positions in the laboratory are those in the frame
plus the support's displacement.  Vectors have the components (along the rail, down), in space (along, across, down).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from modal.scene import Moved
from modal.types import Floats
from modal.vibration import PrescribedMotion, prescribed_motion


@dataclass(frozen=True)
class MovingSupport:
    """The support's motion in one direction: along the rail, or (`vertical`) upwards."""

    vertical: bool
    motion: PrescribedMotion

    @cached_property
    def direction(self) -> tuple[float, float]:
        """Its components along the rail and down."""
        return (0.0, -1.0) if self.vertical else (1.0, 0.0)

    def acceleration(self, time: float) -> tuple[float, float]:
        """Its acceleration (m/s²) along the rail and down, at one time (s)."""
        size, (along, down) = self.motion.acceleration_at(time), self.direction
        return along * size, down * size

    def velocity(self, time: float) -> tuple[float, float]:
        """Its velocity (m/s) along the rail and down, at one time (s)."""
        size, (along, down) = self.motion.velocity_at(time), self.direction
        return along * size, down * size

    def displacements(self, times: Floats, dimensions: int) -> Floats:
        """Its place in the laboratory (m), (T, d)."""
        return self._vectors(self.motion.displacement(times), dimensions)

    def accelerations(self, times: Floats, dimensions: int) -> Floats:
        """Its acceleration (m/s²), (T, d)."""
        return self._vectors(self.motion.acceleration(times), dimensions)

    def velocities(self, times: Floats, dimensions: int) -> Floats:
        """Its velocity (m/s), (T, d)."""
        return self._vectors(self.motion.velocity(times), dimensions)

    def _vectors(self, sizes: Floats, dimensions: int) -> Floats:
        found = np.zeros((len(sizes), dimensions))
        found[:, 0], found[:, -1] = self.direction[0] * sizes, self.direction[1] * sizes
        return found


def moving_support(support: Moved) -> MovingSupport:
    """The motion of a moved support as functions of time."""
    return MovingSupport(support.motion.direction == "vertical", prescribed_motion(support.motion))
