"""The motion that the modes promise, in closed form: no equation is integrated.

With the coordinate η of each mode at the start (`nonlinear.modal_coordinates`) and c = η − i (η' − σ η)/ω, λ = σ + iω,

    q(t) = Σ_r Re φ_r c_r exp(σ_r t + i ω_r u_r),    u = t,

cosh and sinh where an undamped rest is left, η + η' t for a rigid translation.  The amplitude-corrected motion lets the
phase of each mode run on the clock of its own amplitude a = |c|, the largest angle of the mode at the start (rad),

    u = t + κ a² (exp(2 σ t) − 1)/2σ,    undamped  u = (1 + κ a²) t,

which is ω(1 + κ a²) of `modal.amplitude` with every mode by itself: what modes do to each other's frequencies is left
out.  Of a scene in space both vertical planes are taken; across its rail a cart is a fixed support.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from modal.errors import ComputationError
from modal.linear import matrices
from modal.modes import Modes, natural_modes
from modal.rig import Floats
from modal.scene import Fixed, Scene
from nonlinear.modal_coordinates import Complexes, along_rail, deflection, modal_motion, rest_angles
from nonlinear.state import Motion, State
from nonlinear.two_planes import joined, split

LEAST = -0.5  # κ a² below which it is no correction any more
SPANNED = 1e-6  # part of a start that the modes may miss
INCOMPLETE = "the modes do not add up to this start: some of them share an eigenvalue and a shape"

Predicted = Callable[[Floats], Motion]


@dataclass(frozen=True, eq=False)
class Swing:
    """One mode at work: its shape φ (n,), λ (rad/s), κ (1/rad²; 0 for the linear motion), η and η' at the start."""

    shape: Complexes
    value: complex
    kappa: float
    eta: float
    rate: float
    damped: bool

    def motion(self, times: Floats) -> Floats:
        """What the mode adds to q and to q', (2, T, n)."""
        return np.array([np.outer(part, self.shape).real for part in self._coordinate(times)])

    def _coordinate(self, times: Floats) -> tuple[Any, Any]:
        s = self.value.real
        if self.value.imag:
            return self._turning(times)
        if s == 0:
            return self.eta + self.rate * times, np.full(len(times), self.rate)
        if self.damped:
            return self.eta * np.exp(s * times), s * self.eta * np.exp(s * times)
        even, odd = np.cosh(s * times), np.sinh(s * times)
        return self.eta * even + self.rate / s * odd, s * self.eta * odd + self.rate * even

    def _turning(self, times: Floats) -> tuple[Any, Any]:
        s, omega = self.value.real, self.value.imag
        c = self.eta - 1j * (self.rate - s * self.eta) / omega
        bend, fade = max(self.kappa * abs(c) ** 2, LEAST), np.exp(2 * s * times)
        clock = times + bend * ((fade - 1) / (2 * s) if s else times)
        z = c * np.exp(s * times + 1j * omega * clock)
        return z, z * (s + 1j * omega * (1 + bend * fade))


def superposed(scene: Scene, start: State, *, corrected: bool) -> Predicted:
    """The motion from this start as a function of times (T,) in s, amplitude-corrected or linear.

    Raises ComputationError where the modes do not add up to the start, as where eigenvalues of damped modes coincide.
    """
    if scene.space == "plane":
        return _in_plane(scene, start, corrected)
    along, across = split(scene, start)
    plane = scene.model_copy(update={"space": "plane"})
    parts = (
        _in_plane(plane, along, corrected),
        _in_plane(plane.model_copy(update={"support": Fixed()}), across, corrected),
    )
    return lambda times: joined(scene, *(part(times) for part in parts))


def _in_plane(scene: Scene, start: State, corrected: bool) -> Predicted:
    found, on = swings(scene, start, corrected=corrected), int(scene.support.kind == "cart")

    def motion(times: Floats) -> Motion:
        q, v = sum((swing.motion(times) for swing in found), np.zeros((2, len(times), on + scene.n_links)))
        none = np.zeros(len(times))
        cart, cart_rate = (q[:, 0], v[:, 0]) if on else (none, none)
        return Motion(q[:, on:] + rest_angles(scene), v[:, on:], cart, cart_rate, none)

    return motion


def swings(scene: Scene, start: State, *, corrected: bool) -> list[Swing]:
    """The modes of a plane scene that this start sets going."""
    modes, here = natural_modes(scene), _instant(start)
    drifting = [number for number in range(len(modes)) if _drifts(scene, modes, number)]
    try:
        found = modal_motion(here, modes, [number for number in range(len(modes)) if number not in drifting])
    except np.linalg.LinAlgError:
        raise ComputationError(INCOMPLETE) from None
    kappa = [mode.kappa if corrected and np.isfinite(mode.kappa) else 0.0 for mode in modes]
    each = [
        Swing(phi, complex(modes.eigenvalue[number]), kappa[number], eta, rate, scene.has_damping)
        for number, phi, eta, rate in zip(found.number, found.shapes.T, found.coordinate[0], found.rate[0], strict=True)
    ]
    each += [_drift(scene, modes, number, *deflection(scene, here)) for number in drifting]
    _insist(each, *deflection(scene, here))
    return each


def _instant(start: State) -> Motion:
    cart, rate = np.array([start.cart]), np.array([start.cart_rate])
    return Motion(start.links[None], start.link_rates[None], cart, rate, np.zeros(1))


def _drifts(scene: Scene, modes: Modes, number: int) -> bool:
    """Whether it is a translation that nothing damps."""
    return modes.eigenvalue[number] == 0 and not (scene.support.kind == "cart" and scene.support.damping)


def _drift(scene: Scene, modes: Modes, number: int, q: Floats, v: Floats) -> Swing:
    """A translation in a scene whose other modes may be damped: to them it is still orthogonal in M."""
    phi = along_rail(modes, number)[1][:, 0].real
    weight = matrices(scene).M @ phi
    eta, rate = (float(part[0] @ weight / (phi @ weight)) for part in (q, v))
    return Swing(phi, 0j, 0.0, eta, rate, damped=False)


def _insist(each: list[Swing], q: Floats, v: Floats) -> None:
    linear = [replace(one, kappa=0.0) for one in each]
    missing = np.array([q, v]) - sum(one.motion(np.zeros(1)) for one in linear)
    if not all(np.abs(gap).max() <= SPANNED * max(np.abs(q).max(), np.abs(v).max()) for gap in missing):
        raise ComputationError(INCOMPLETE)
