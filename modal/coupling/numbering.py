"""The numbers that modes have in the table of a scene, by their frequencies without dampers."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from modal.errors import ComputationError
from modal.modes import MOST_COMPARED, natural_modes, table_numbers
from modal.scene import Scene
from modal.types import Floats, Ints


class Numbered:
    """A result of a `scene` whose modes are called by their numbers in its table."""

    scene: Scene

    @cached_property
    def _table(self) -> tuple[Floats, Ints] | None:
        """ω of the modes without dampers and their numbers in the table; None where the table is not available."""
        if self.scene.has_damping and self.scene.n_links > MOST_COMPARED:
            return None
        try:
            return natural_modes(self.scene.conservative).omega, table_numbers(self.scene)
        except ComputationError:
            return None

    def number(self, omega: float) -> int | None:
        """The number in the table of the undamped mode of this frequency (rad/s), None where unknown."""
        if self._table is None:
            return None
        known, numbers = self._table
        return int(numbers[np.abs(known - omega).argmin()])
