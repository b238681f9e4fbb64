"""Modal superposition: the predicted motion in closed form, without integration.

With the coordinate η of each mode at the start (`nonlinear.reduction.modal_coordinates`) and c = η − i (η' − σ η)/ω, λ
= σ + iω,

    q(t) = Σ_r Re φ_r c_r exp(σ_r t + i ω_r u_r),    u = t,

cosh and sinh about an undamped unstable equilibrium, η + η' t for a rigid translation.  In the amplitude-corrected
motion the phase of each mode follows a clock set by its own amplitude a = |c|, the largest angle of the mode at the
start (rad),

    u = t + κ a² (exp(2 σ t) − 1)/2σ,    undamped  u = (1 + κ a²) t,

which is ω(1 + κ a²) of `modal.eigen.amplitude` for every mode by itself: the effect of modes on each other's
frequencies is neglected.  For a scene in space both vertical planes are used; across the rail a cart is a fixed
support.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from modal.errors import ComputationError
from modal.modes import Modes, natural_modes
from modal.report import Displayed
from modal.scene import Fixed, Scene, require
from modal.scene.doors import checked
from modal.types import Complexes, Floats
from nonlinear.reduction.modal_coordinates import (
    along_rail,
    deflection,
    join,
    layout_of,
    modal_motion,
    rest_coordinates,
    split,
)
from nonlinear.system import Motion, State, motion_of

LINEAR, CORRECTED = "linear modes", "corrected modes"
UNSPANNED_MAX = 1e-6
"""Limit: the largest part of a start outside the span of the modes, beyond which it is refused."""
INCOMPLETE = "the modes do not span this start: some of them share an eigenvalue and a mode shape"


@dataclass(frozen=True, eq=False)
class ModalSwing:
    """One mode in a motion: its shape φ (n,), λ (rad/s), κ (1/rad²; 0 for linear motion), η and η' at the start."""

    shape: Complexes
    value: complex
    kappa: float
    eta: float
    rate: float
    decays: bool

    def motion(self, times: Floats) -> Floats:
        """The contribution of the mode to q, q' and q'', (3, T, n)."""
        return sum_swings([self], times)

    @property
    def amplitude(self) -> complex:
        """The c of an oscillating mode."""
        return complex(self.eta, (self.value.real * self.eta - self.rate) / self.value.imag)

    @property
    def bend(self) -> float:
        """The relative change κ a² of its frequency by its amplitude at the start."""
        return max(self.kappa * abs(self.amplitude) ** 2, -0.5)

    def coordinate(self, times: Floats) -> tuple[Any, Any, Any]:
        """Its coordinate z and two time derivatives, (T,), with q = Re φ z."""
        s = self.value.real
        if self.value.imag:
            return self._turning(times)
        if s == 0:
            return self.eta + self.rate * times, np.full(len(times), self.rate), np.zeros(len(times))
        if self.decays:
            z = self.eta * np.exp(s * times)
            return z, s * z, s * s * z
        cosh, sinh = np.cosh(s * times), np.sinh(s * times)
        z = self.eta * cosh + self.rate / s * sinh
        return z, s * self.eta * sinh + self.rate * cosh, s * s * z

    def _turning(self, times: Floats) -> tuple[Any, Any, Any]:
        s, omega, bend = self.value.real, self.value.imag, self.bend
        fade = np.exp(2 * s * times)
        clock = times + bend * ((fade - 1) / (2 * s) if s else times)
        z = self.amplitude * np.exp(s * times + 1j * omega * clock)
        speed = s + 1j * omega * (1 + bend * fade)
        return z, z * speed, z * (speed**2 + 2j * omega * s * bend * fade)


def sum_swings(swings: Sequence[ModalSwing], times: Floats) -> Floats:
    """The contribution of these modes to q, q' and q'', (3, T, n)."""
    z = np.moveaxis(np.array([swing.coordinate(times) for swing in swings]), 0, 2)
    phi = np.array([swing.shape for swing in swings])
    return np.asarray(z.real @ phi.real - z.imag @ phi.imag if np.iscomplexobj(z) else z @ phi.real)


@dataclass(frozen=True, eq=False)
class Flat:
    """The motion of a scene in one vertical plane: its modes, and q and q' (n,) at the start."""

    scene: Scene
    swings: tuple[ModalSwing, ...]
    start: tuple[Floats, Floats]

    def deflections(self, times: Floats) -> Floats:
        """The closed form of q, q' and q'', (3, T, n)."""
        return sum_swings(self.swings, times)

    def motion(self, times: Floats) -> Motion:
        """The same as angles (T, L) and a cart or supports."""
        q, v, _ = self.deflections(times)
        return layout_of(self.scene).read(np.hstack((q + rest_coordinates(self.scene), v)))


@dataclass(frozen=True, eq=False, repr=False)
class Superposition(Displayed):
    """The motion of a scene as a function of times (T,) in s, and the vertical planes of which it consists.

    These are the plane itself, or for a scene in space the one along the rail and the one across it.
    """

    what = "Motion by modes in closed form"
    shows = "scene: scene; planes: vertical planes"

    scene: Scene
    planes: tuple[Flat, ...]

    def __call__(self, times: Floats) -> Motion:
        """The motion at these times."""
        with np.errstate(all="ignore"):
            parts = [plane.motion(times) for plane in self.planes]
        return parts[0] if self.scene.space == "plane" else join(self.scene, *parts)

    @property
    def linear(self) -> Superposition:
        """The same motion without amplitude correction."""
        linear_swings = (tuple(replace(swing, kappa=0.0) for swing in plane.swings) for plane in self.planes)
        planes = (replace(plane, swings=swings) for plane, swings in zip(self.planes, linear_swings, strict=True))
        return replace(self, planes=tuple(planes))


@checked
def superpose(scene: Scene, start: State, *, corrected: bool) -> Superposition:
    """The motion from this start as a function of times (T,) in s, amplitude-corrected or linear.

    Raise ComputationError if the modes do not span the start, as where eigenvalues of damped modes coincide, and for
    dry friction and quadratic drag.
    """
    require(scene, "motion in closed form")
    if scene.space == "plane":
        return Superposition(scene, (_flat(scene, start, corrected),))
    along, across = split(scene, start)
    plane = scene.in_plane
    fixed_plane = plane.replace(support=Fixed())
    return Superposition(scene, (_flat(plane, along, corrected), _flat(fixed_plane, across, corrected)))


def _flat(scene: Scene, start: State, corrected: bool) -> Flat:
    q, v = (part[0] for part in deflection(scene, motion_of([start])))
    return Flat(scene, tuple(swings(scene, start, corrected=corrected)), (q, v))


def swings(scene: Scene, start: State, *, corrected: bool) -> list[ModalSwing]:
    """The modes of a plane scene that this start excites."""
    modes, motion = natural_modes(scene), motion_of([start])
    drifting = [number for number in range(len(modes)) if _drifts(scene, modes, number)]
    try:
        coordinates = modal_motion(motion, modes, [number for number in range(len(modes)) if number not in drifting])
    except np.linalg.LinAlgError:
        raise ComputationError(INCOMPLETE) from None
    kappa = [mode.kappa if corrected and np.isfinite(mode.kappa) else 0.0 for mode in modes]
    decays = scene.has_damping and not modes.is_classical
    at_start = coordinates.number, coordinates.shapes.T, coordinates.coordinate[0], coordinates.rate[0]
    parts = [
        ModalSwing(phi, complex(modes.eigenvalue[number]), kappa[number], eta, rate, decays)
        for number, phi, eta, rate in zip(*at_start, strict=True)
    ]
    parts += [_drift(scene, modes, number, *deflection(scene, motion)) for number in drifting]
    _validate(parts, *deflection(scene, motion))
    return parts


def _drifts(scene: Scene, modes: Modes, number: int) -> bool:
    """Whether the mode is an undamped translation."""
    if modes.eigenvalue[number] != 0:
        return False
    if scene.is_structured:
        return not (modes.matrices.D @ along_rail(modes, number)[1]).any()
    return not (scene.cart is not None and scene.cart.damping)


def _drift(scene: Scene, modes: Modes, number: int, q: Floats, v: Floats) -> ModalSwing:
    """A translation in a scene whose other modes may be damped: it is still orthogonal to them in M."""
    phi = along_rail(modes, number)[1][:, 0].real
    weight = modes.matrices.M @ phi
    eta, rate = (float(part[0] @ weight / (phi @ weight)) for part in (q, v))
    return ModalSwing(phi, 0j, 0.0, eta, rate, decays=False)


def _validate(parts: list[ModalSwing], q: Floats, v: Floats) -> None:
    linear = [replace(swing, kappa=0.0) for swing in parts]
    missing = np.array([q, v]) - sum(swing.motion(np.zeros(1))[:2] for swing in linear)
    if not all(np.abs(gap).max() <= UNSPANNED_MAX * max(np.abs(q).max(), np.abs(v).max()) for gap in missing):
        raise ComputationError(INCOMPLETE)
