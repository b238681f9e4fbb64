"""What is known of all modes of a scene from their eigenvalues alone, without any shape, as columns."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from modal.assembly import Rig, Units
from modal.eigen import LIGHT, Spectrum
from modal.modes.mode import UNCERTAIN, hertz, oscillating, swing_period
from modal.scene import Scene
from modal.types import Booleans, Floats, Ints

A = TypeVar("A", bound=NDArray[Any])


@dataclass(frozen=True, eq=False, repr=False)
class Eigenvalues:
    """The eigenvalues of a scene in ascending order of natural frequency, and the columns that follow from them.

    `rig` is the scene as arrays, `spectrum` the source of each mode in natural `units`; `first` is the index of the
    first of them among all modes of the scene, of which only some were `selected`.
    """

    scene: Scene
    rig: Rig
    units: Units
    spectrum: Spectrum
    first: int = 0
    selected: bool = False

    def __len__(self) -> int:
        return len(self.spectrum.eigenvalue)

    @property
    def is_classical(self) -> bool:
        """Whether all dampers are those of a `damping_ratio`, which leave the undamped shapes as they are."""
        return self.scene.has_modal_damping and not self.scene.has_dampers

    @property
    def on_cart(self) -> bool:
        """Whether the support is a cart."""
        return self.rig.cart is not None

    @property
    def number(self) -> Ints:
        """The numbers of the modes in the table, from 1, (R,)."""
        return kept(np.arange(self.first + 1, self.first + len(self) + 1))

    @cached_property
    def eigenvalue(self) -> NDArray[np.complex128]:
        """λ (R,) in rad/s: iω for undamped modes, −ζω + iω√(1−ζ²) for damped ones."""
        return kept(self.spectrum.eigenvalue * self.units.rate)

    @cached_property
    def omega(self) -> Floats:
        """Natural frequencies |λ| (R,) in rad/s."""
        return kept(np.abs(self.eigenvalue))

    @property
    def multiplicity(self) -> Ints:
        """The number of independent modes with each frequency, (R,)."""
        return kept(self.spectrum.multiplicity.view())

    @property
    def error(self) -> Floats:
        """Bounds on the relative errors of `eigenvalue`, (R,)."""
        return kept(self.spectrum.error.view())

    @property
    def relative_error_bound(self) -> Floats:
        """Bounds on the relative errors of `omega`, (R,): those of `error`."""
        return self.error

    @cached_property
    def damping_ratio(self) -> Floats:
        """−Re λ/|λ| (R,); NaN where no digit is certain."""
        ratio = np.zeros(len(self))
        np.divide(-self.eigenvalue.real, self.omega, out=ratio, where=self.omega > 0)
        certain = self.error < UNCERTAIN
        return kept(np.where(certain, np.clip(ratio, -1.0, 1.0) + 0.0, np.nan))

    @cached_property
    def frequency(self) -> Floats:
        """Natural frequencies |λ|/2π (R,) in Hz: 0 for a rigid translation, NaN for modes that do not oscillate."""
        known = oscillating(self.omega, self.damping_ratio) | (self.omega == 0)
        return kept(np.where(known, hertz(self.omega), np.nan))

    @cached_property
    def period(self) -> Floats:
        """Periods 2π/|Im λ| (R,) in s; NaN for modes that do not oscillate."""
        found, swings = np.full(len(self), np.nan), oscillating(self.omega, self.damping_ratio)
        found[swings] = swing_period(self.omega[swings], self.damping_ratio[swings])
        return kept(found)

    @cached_property
    def growth_rate(self) -> Floats:
        """Re λ (R,) in 1/s of unstable modes; NaN for all others."""
        return kept(np.where(self.damping_ratio < 0, -self.damping_ratio * self.omega, np.nan))

    @cached_property
    def indistinct(self) -> Booleans:
        """Whether a neighbour of each mode is closer than the sum of both bounds, (R,)."""
        close = np.diff(self.omega) <= (self.error * self.omega)[1:] + (self.error * self.omega)[:-1]
        return kept(np.concatenate((close, [False])) | np.concatenate(([False], close)))

    @cached_property
    def lightly_damped(self) -> Booleans:
        """The modes that are at most lightly damped, ζ < 0.1, (R,)."""
        return kept(np.abs(self.eigenvalue.real) < LIGHT * np.abs(self.eigenvalue))

    @cached_property
    def natural(self) -> Rig:
        """The scene as arrays in natural units."""
        return self.rig.natural()[0]


def kept(values: A) -> A:
    """A read-only array."""
    values.flags.writeable = False
    return values
