"""Readings of sensors at points: positions of link ends, and accelerations at points along links.

With x along the rail and y upwards, a link at angle θ from the downward vertical points along e_r = (sin θ, −cos θ),
and its angle grows in the direction e_θ = (cos θ, sin θ).  A mark at the end of link i is at

    x = x_0 + Σ_(j ≤ i) l_j sin θ_j,        y = y_0 − Σ_(j ≤ i) l_j cos θ_j

of a support at (x_0, y_0), and an accelerometer at the distance r from the joint of link i reads the specific force

    f = a − g,    a = a_0 + Σ_(j < i) l_j (θ_j'' e_θj − θ_j'² e_rj) + r (θ_i'' e_θi − θ_i'² e_ri),    g = (0, −g),

along as f · e_r and across as f · e_θ: at rest on a hanging link along is −g.  All is analytic, so that complex y and
numbers carry derivatives.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from modal.errors import SceneError
from modal.types import Floats
from nonlinear.system import System
from nonlinear.system.numbers import BEFORE, FIELDS

AXES = ("x", "y")
ACCELERATIONS = ("along", "across")


@dataclass(frozen=True, eq=False)
class PointReading:
    """The `quantity` x, y (m), along or across (m/s²) of a point of the last of the `links`, from the first joint down.

    `radius` (m) is the distance from that link's joint of an accelerometer.
    """

    system: System
    quantity: str
    links: tuple[int, ...]
    radius: float = 0.0

    @property
    def is_acceleration(self) -> bool:
        """Whether it needs the accelerations of the motion."""
        return self.quantity in ACCELERATIONS

    def at(self, y: Any, slopes: Any, entries: Sequence[Any], times: Floats) -> Any:
        """The reading (...) of y (size, ...), of y' where it needs it, and of the `entries` of `Numbers`."""
        if not self.is_acceleration:
            return self._place(y, self._lengths(entries), times)
        first, half = self.system.first, len(y) // 2
        along, up = self._support(2, times)
        along = along + (slopes[half] if first else 0.0)
        up = up + entries[0]
        for row, length in zip(self.links, [*self._lengths(entries)[:-1], self.radius], strict=True):
            sin, cos = np.sin(y[first + row]), np.cos(y[first + row])
            turn, rate = slopes[half + first + row], y[half + first + row]
            along = along + length * (turn * cos - rate * rate * sin)
            up = up + length * (turn * sin + rate * rate * cos)
        theta = y[first + self.links[-1]]
        if self.quantity == "along":
            return along * np.sin(theta) - up * np.cos(theta)
        return along * np.cos(theta) + up * np.sin(theta)

    def _place(self, y: Any, lengths: Sequence[Any], times: Floats) -> Any:
        first, support = self.system.first, self._support(0, times)
        angles = [y[first + row] for row in self.links]
        if self.quantity == "x":
            place = support[0] + (y[0] if first else 0.0)
            return sum((length * np.sin(theta) for length, theta in zip(lengths, angles, strict=True)), place)
        return support[1] - sum(length * np.cos(theta) for length, theta in zip(lengths, angles, strict=True))

    def _lengths(self, entries: Sequence[Any]) -> list[Any]:
        at = BEFORE + FIELDS.index("length") * self.system.n_links
        return [entries[at + row] for row in self.links]

    def _support(self, order: int, times: Floats) -> tuple[Any, Any]:
        """The displacement (m) of a moving support along the rail and upwards, or its second derivative."""
        support = self.system.support
        if support is None:
            return 0.0, 0.0
        vectors = (support.displacements if order == 0 else support.accelerations)(np.ravel(times), 2)
        along, down = (np.reshape(part, np.shape(times)) for part in vectors.T)
        return along, -down


def unreadable(system: System) -> str:
    """Why sensors at points of links cannot be read of a system, "" where they can."""
    if system.structure is not None and system.structure.names != ("x",):
        return "the links hang from a structure"
    if system.hoisting is not None:
        return "lengths change in time"
    return "links swing in space" if system.spatial else ""


def require_readable(system: System, names: Sequence[str]) -> None:
    """Raise SceneError for sensors of these names where points cannot be read."""
    if names and (reason := unreadable(system)):
        raise SceneError([f"column {name}: {reason}, where only angles and rates are read" for name in names])
