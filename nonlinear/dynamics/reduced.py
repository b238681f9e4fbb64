"""A system whose motion is found by a smaller one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from modal.types import Floats
from nonlinear.dynamics.symmetries import Symmetry
from nonlinear.system import Equations, Load, Motion, State, System


@dataclass(frozen=True, eq=False)
class Reduced:
    """The equations `inner` of the last of these symmetries, read as the motion of the whole `system`."""

    system: System
    inner: Equations
    symmetries: Sequence[Symmetry]

    @property
    def words(self) -> str:
        """What is integrated."""
        return "; ".join(symmetry.words for symmetry in self.symmetries)

    @property
    def load(self) -> Load | None:
        """Nothing acts from outside: it might break the symmetry."""
        return None

    @property
    def scale(self) -> Floats:
        """Natural units of y, (size,)."""
        return self.inner.scale

    def derivative(self, time: float, y: Floats) -> Floats:
        """The rate of y, (size,)."""
        return self.inner.derivative(time, y)

    def begin(self, state: State) -> Floats:
        """The vector y of a state."""
        for symmetry in self.symmetries:
            state = symmetry.restrict(state)
        return self.inner.begin(state)

    def read(self, rows: Floats) -> Motion:
        """The motion of the whole in vectors (T, size)."""
        motion = self.inner.read(rows)
        for symmetry in reversed(self.symmetries):
            motion = symmetry.extend(motion)
        return motion

    def project(self, y: Floats) -> tuple[Floats, float]:
        """The nearest y that keeps every constraint, and the largest violation that it mends."""
        return self.inner.project(y)
