"""Columns of the modes of a scene that follow from the eigenvalues alone, without any shape."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from modal.assembly import Hanging, Rig, Units, rig_of, single
from modal.eigen import (
    EVERYTHING,
    LIGHT,
    UNCERTAIN,
    Limits,
    ModalSpectrum,
    find_spectrum,
    short_squares,
    structured_error,
)
from modal.modes.mode import MOST_REFINED, Mode, hertz, oscillating, swing_period
from modal.report import deferred
from modal.scene import Scene
from modal.types import Booleans, Floats, Ints

if TYPE_CHECKING:
    from modal.modes.expansion import FiniteMotion

A = TypeVar("A", bound=NDArray[Any])


class ShortChain(NamedTuple):
    """A short chain: its ω² (R,) in natural units, computed before its rig.

    A free cart's rigid translation is not among the squares.
    """

    squares: Floats
    units: Units
    links: int
    is_free: bool

    @classmethod
    def of(cls, scene: Scene) -> ShortChain | None:
        """Those of a scene that is one short chain with distinct modes, None for any other."""
        chain = single(scene)
        squares = short_squares(chain.links, chain.cart) if chain else None
        if chain is None or squares is None:
            return None
        return cls(squares, chain.units, len(chain.links), chain.cart is not None and chain.cart.stiffness == 0)

    @property
    def omega(self) -> Floats:
        """ω (R,) in rad/s, with that of a free cart."""
        swinging: Floats = np.sqrt(self.squares) * self.units.rate
        return np.concatenate(([0.0], swinging)) if self.is_free else swinging

    @property
    def error(self) -> Floats:
        """Bounds on the relative errors of ω, (R,); that of a free cart is exact."""
        bounds = np.full(len(self.squares) + self.is_free, structured_error(self.links, 1))
        bounds[: self.is_free] = 0.0
        return bounds


@dataclass(frozen=True, eq=False, repr=False)
class Eigenvalues:
    """The eigenvalues of a scene in ascending order of natural frequency, and the columns that follow from them.

    These are those in `which`, or all. `rig` is the scene as arrays, `spectrum` the source of each mode in natural
    `units`: for a `short_chain` both are made when a shape is needed.
    """

    scene: Scene
    limits: Limits = EVERYTHING
    which: slice | None = None
    short_chain: ShortChain | None = None

    @cached_property
    def rig(self) -> Rig:
        """The scene as arrays, in SI units."""
        return rig_of(self.scene)

    @cached_property
    def _natural_form(self) -> tuple[Rig, Units]:
        with np.errstate(all="ignore"):
            return self.rig.natural()

    @property
    def natural(self) -> Rig:
        """The scene as arrays in natural units."""
        return self._natural_form[0]

    @property
    def units(self) -> Units:
        """The natural units."""
        return self.short_chain.units if self.short_chain else self._natural_form[1]

    @cached_property
    def _full_spectrum(self) -> ModalSpectrum:
        limits = self.limits._replace(squares=self.short_chain.squares) if self.short_chain else self.limits
        with np.errstate(all="ignore"):
            return find_spectrum(self.natural, limits)

    @cached_property
    def spectrum(self) -> ModalSpectrum:
        """The eigenvalues in natural units, each with the source of its shape."""
        if not self.is_partial:
            return self._full_spectrum
        return self._full_spectrum.take(slice(self.first, self.first + len(self._range)))

    @property
    def _range(self) -> range:
        return range(len(self._full_spectrum.eigenvalue))[self.which or slice(None)]

    @property
    def is_expanded(self) -> bool:
        """Whether 1 % angles need the expansion: on structures, about displaced equilibria, and with joint laws."""
        return self.scene.is_structured or self.rig.leans or "law" in self.scene.features

    @cached_property
    def not_expanded(self) -> str:
        """Why the expansion is not available, in words; "" if it is."""
        if self.rig.spatial:
            return "on structures in space"
        if self.rig.has_loops:
            return "with feedback"
        if self.scene.n_links + self.rig.leading > MOST_REFINED:
            return f"beyond {MOST_REFINED} coordinates where pivots move down" * bool(self.hanging.phi.down.any())
        return "" if self.finite_motion.is_known else "with laws of joints that do work without a potential"

    @cached_property
    def finite_motion(self) -> FiniteMotion:
        """The nonlinear equations of the expansion, in the plane."""
        motion: FiniteMotion = deferred("modal.modes.expansion:FiniteMotion")(self.scene, self.rig)
        return motion

    @cached_property
    def hanging(self) -> Hanging:
        """The pendula, one of each kind on a cart or a fixed support, and their supports as a structure, natural."""
        natural = self.natural
        members = natural.members if natural.structure else tuple((*kind, 1) for kind in natural.names)
        return Hanging(replace(natural, members=members))

    @cached_property
    def inertia(self) -> Floats:
        """The inertia of each support coordinate with locked pendula, (d,); 1 for a single one."""
        d = self.rig.leading
        return self.hanging.inertia.diagonal() if d > 1 else np.ones(d)

    def resonance_near(self, mode: Mode, harmonic: int) -> str:
        """Return the mode of the scene nearest to a multiple of the frequency of another, if they are known."""
        sizes = np.abs(self._full_spectrum.eigenvalue) * self.units.rate
        sizes[mode.number - 1] = np.inf
        nearest = f"mode {int(np.abs(sizes - harmonic * mode.omega).argmin()) + 1}"
        return f"1:{harmonic} with {nearest if np.isfinite(sizes).any() else 'another mode'}"

    @property
    def is_partial(self) -> bool:
        """Whether only some of the modes were requested."""
        return self.which is not None

    @property
    def first(self) -> int:
        """The index of the first of these among all modes of the scene."""
        return self._range.start if self.is_partial else 0

    def __len__(self) -> int:
        return len(self.short_chain.error if self.short_chain else self.spectrum.eigenvalue)

    @property
    def is_classical(self) -> bool:
        """Whether all dampers are those of a `damping_ratio`, which do not change the undamped shapes."""
        return self.scene.has_modal_damping and not self.scene.has_dampers

    @property
    def on_cart(self) -> bool:
        """Whether the support is a cart."""
        return self.rig.cart is not None

    @property
    def number(self) -> Ints:
        """The numbers of the modes in the table, from 1, (R,)."""
        return read_only(np.arange(self.first + 1, self.first + len(self) + 1))

    @cached_property
    def eigenvalue(self) -> NDArray[np.complex128]:
        """λ (R,) in rad/s: iω for undamped modes, −ζω + iω√(1−ζ²) for damped ones."""
        eigenvalues = self.short_chain.omega * 1j if self.short_chain else self.spectrum.eigenvalue * self.units.rate
        return read_only(eigenvalues.astype(np.complex128, copy=False))

    @cached_property
    def omega(self) -> Floats:
        """Natural frequencies |λ| (R,) in rad/s; NaN if no digit is certain."""
        if self.short_chain:
            return read_only(self.short_chain.omega)
        return read_only(np.where(self.error < UNCERTAIN, np.abs(self.eigenvalue), np.nan))

    @property
    def multiplicity(self) -> Ints:
        """The number of independent modes with each frequency, (R,)."""
        return read_only(np.ones(len(self), dtype=np.int64) if self.short_chain else self.spectrum.multiplicity.view())

    @property
    def error(self) -> Floats:
        """Bounds on the relative errors of `eigenvalue`, (R,)."""
        return read_only(self.short_chain.error if self.short_chain else self.spectrum.error.view())

    @property
    def relative_error_bound(self) -> Floats:
        """Bounds on the relative errors of `omega`, (R,): those of `error`."""
        return self.error

    @cached_property
    def damping_ratio(self) -> Floats:
        """−Re λ/|λ| (R,); NaN if no digit is certain."""
        ratio = np.zeros(len(self))
        np.divide(-self.eigenvalue.real, self.omega, out=ratio, where=self.omega > 0)
        certain = self.error < UNCERTAIN
        return read_only(np.where(certain, np.clip(ratio, -1.0, 1.0) + 0.0, np.nan))

    @cached_property
    def frequency(self) -> Floats:
        """Natural frequencies |λ|/2π (R,) in Hz: 0 for a rigid translation, NaN for modes that do not oscillate."""
        has_frequency = oscillating(self.omega, self.damping_ratio) | (self.omega == 0)
        return read_only(np.where(has_frequency, hertz(self.omega), np.nan))

    @cached_property
    def period(self) -> Floats:
        """Periods 2π/|Im λ| (R,) in s; NaN for modes that do not oscillate."""
        periods, swings = np.full(len(self), np.nan), oscillating(self.omega, self.damping_ratio)
        periods[swings] = swing_period(self.omega[swings], self.damping_ratio[swings])
        return read_only(periods)

    @cached_property
    def growth_rate(self) -> Floats:
        """Re λ (R,) in 1/s of unstable modes; NaN for all others."""
        return read_only(np.where(self.damping_ratio < 0, -self.damping_ratio * self.omega, np.nan))

    @cached_property
    def indistinct(self) -> Booleans:
        """Whether a neighbour of each mode is closer than the sum of both bounds, (R,)."""
        size = np.abs(self.eigenvalue)
        radius = np.where(size > 0, self.error * size, 0.0)
        is_close = (np.diff(size) <= radius[1:] + radius[:-1]) & (size[1:] > 0)
        return read_only(np.concatenate((is_close, [False])) | np.concatenate(([False], is_close)))

    @cached_property
    def is_light(self) -> Booleans:
        """The modes with any certain digit that are at most lightly damped, ζ < 0.1, (R,)."""
        light = np.abs(self.eigenvalue.real) < LIGHT * np.abs(self.eigenvalue)
        return read_only(light & (self.error < UNCERTAIN))


def read_only(values: A) -> A:
    """A read-only array."""
    values.flags.writeable = False
    return values
