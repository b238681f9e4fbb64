"""A support that moves as prescribed.  The scene is described in its frame, which accelerates with it.

In that frame every mass m feels, besides gravity, the force −m a; positions in the laboratory are those in the frame
plus the support's displacement.  Vectors have the components (along the rail, down), in space (along, across, down).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from modal.scene import SupportMotion
from modal.types import Floats
from modal.vibration import PrescribedMotion, prescribed_motion
from nonlinear.system.forces import DIRECTIONS, Direction


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
        """Those of all motions."""
        return tuple(direction for direction, _ in self.motions)

    def combined(self, sizes: Any) -> tuple[Any, Any]:
        """The components along the rail and down of one number for each motion; 0.0 where none has any."""
        along, down = 0.0, 0.0
        for (x, z), size in zip(self.directions, sizes, strict=True):
            along = along + x * size if x else along
            down = down + z * size if z else down
        return along, down

    def acceleration(self, time: float) -> tuple[float, float]:
        """Its acceleration (m/s²) along the rail and down, at one time (s)."""
        return self.combined([motion.acceleration_at(time) for _, motion in self.motions])

    def velocity(self, time: float) -> tuple[float, float]:
        """Its velocity (m/s) along the rail and down, at one time (s)."""
        return self.combined([motion.velocity_at(time) for _, motion in self.motions])

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
        vectors[:, 0], vectors[:, -1] = self.combined(sizes)
        return vectors

    def largest(self, times: Floats) -> Any:
        """The largest acceleration (m/s²) at times (T, ...), (...)."""
        sizes = [motion.acceleration(times) for _, motion in self.motions]
        return np.sqrt(sum(size * size for size in sizes)).max(0)


def moving_support(motions: Sequence[SupportMotion]) -> MovingSupport:
    """The motions of a support or of the ground as functions of time."""
    return MovingSupport(tuple((DIRECTIONS[motion.direction], prescribed_motion(motion)) for motion in motions))
