"""Self-excitation at the joints as arrays: van der Pol torques and escapements (`modal.scene.drives`)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import radians
from typing import Any

import numpy as np

from modal.scene import Escapement, Pendulum, VanDerPol
from modal.types import Floats, Ints

NONE = (0.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True, eq=False)
class Excitation:
    """What excites the joints of P pendula of n links, each array (n, P), 0 where nothing does.

    `strength` e and `curb` e/γ₀² (N m s/rad, N m s/rad³) of the torque (e − curb γ²) γ'; `impulse` (N m s) of a kick
    and the `angle` (rad) at which it comes.
    """

    strength: Floats
    curb: Floats
    impulse: Floats
    angle: Floats

    @property
    def steady(self) -> bool:
        """Whether any joint has a van der Pol torque."""
        return bool(self.strength.any())

    @property
    def kicks(self) -> bool:
        """Whether any joint has an escapement."""
        return bool(self.impulse.any())

    @property
    def table(self) -> Floats:
        """All four, (4, n, P)."""
        return np.array([self.strength, self.curb, self.impulse, self.angle])

    def take(self, columns: Ints) -> Excitation:
        """Of the pendula in these columns."""
        return Excitation(*self.table[:, :, columns])

    def times(self, factor: Any) -> Excitation:
        """With torques and kicks so many times as large."""
        return Excitation(self.strength * factor, self.curb * factor, self.impulse * factor, self.angle)


def excitation_of(pendula: Sequence[Pendulum]) -> Excitation | None:
    """Of pendula with equally many links, one column each; None where nothing excites them."""
    if not any(link.drive for pendulum in pendula for link in pendulum.links):
        return None
    numbers = [[_numbers(link.drive) for link in own.links for _ in range(link.count)] for own in pendula]
    return Excitation(*np.ascontiguousarray(np.array(numbers).transpose(2, 1, 0)))


def _numbers(drive: VanDerPol | Escapement | None) -> tuple[float, float, float, float]:
    if drive is None:
        return NONE
    angle = radians(drive.angle_deg)
    if isinstance(drive, Escapement):
        return 0.0, 0.0, drive.impulse, angle
    return drive.strength, drive.strength / angle**2, 0.0, 0.0
