"""Standard deviations of modes, responses and shaped commands from the covariance of a scene's fitted numbers.

To first order, with exact derivatives, for a result r(p)

    std(r)² = (∂r/∂p)ᵀ cov (∂r/∂p)

[Ljung1999, §9.2].
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from math import nan, pi
from typing import Any

import numpy as np

from modal.assembly import Arrays, matrices, shared_differences
from modal.errors import ComputationError
from modal.identification.derivatives import ModeDerivatives, matrix_derivatives, polar, require_polynomial
from modal.identification.estimate import Estimate
from modal.modes import Modes
from modal.report import percent
from modal.scene import Scene
from modal.scene.doors import checked
from modal.statespace.geometry import Geometry, geometry_of
from modal.statespace.model import StateSpace
from modal.statespace.shapers import Drive, Shaper, residual_vibration, swing_rows
from modal.statespace.signals import (
    DRIVES,
    OF_A_CART,
    PUSHES,
    READINGS,
    SUPPORT,
    Signal,
    is_point,
    push_of,
    reading_in,
)
from modal.types import Complexes, Floats

NODES = 21
"""Cost: nodes of a quadrature along either direction, and points of a band."""


@dataclass(frozen=True)
class ModeStds:
    """Standard deviations of a mode's ω (rad/s) and ζ; NaN where fitted numbers split a shared frequency."""

    omega: float
    zeta: float

    @property
    def frequency(self) -> float:
        """Of the natural frequency, in Hz."""
        return self.omega / (2 * pi)


def mode_slopes(modes: Modes, estimate: Estimate, rows: Sequence[int]) -> tuple[Floats, Floats]:
    """∂ω/∂p and ∂ζ/∂p, (rows, p), of the modes with these indices."""
    dM, dK, dD = matrix_derivatives(estimate.scene, estimate.shared, estimate.units)
    first = int(modes.scene.cart is None and estimate.scene.cart is not None)  # of modes on a cart that is held
    derivatives = ModeDerivatives(modes, dM[:, first:, first:], dK[:, first:, first:], dD[:, first:, first:])
    pairs = [polar(complex(modes.eigenvalue[row]), derivatives.eigenvalue(row)) for row in rows]
    omega, zeta = (np.array(part).reshape(len(rows), len(estimate.unknowns)) for part in zip(*pairs, strict=True))
    return omega, zeta


@checked
def mode_stds(modes: Modes, estimate: Estimate, rows: Sequence[int]) -> list[ModeStds]:
    """Standard deviations of the modes with these indices, from 0; `modes` are those of the estimate's scene.

    Raises ComputationError for scenes too large for dense matrices.
    """
    if not rows:
        return []
    omega, zeta = mode_slopes(modes, estimate, rows)
    return [ModeStds(float(a), float(b)) for a, b in zip(estimate.std(omega), estimate.std(zeta), strict=True)]


# ----------------------------------------------------------------------------------------------------- response


def response_slopes(model: StateSpace, estimate: Estimate, omega: Floats) -> tuple[Complexes, Complexes]:
    """G(iω) (p, m, W) and its derivatives (p, m, W, numbers) by the estimate's numbers.

    With Q = s²M + sD + K, y = (Y₀ + sY₁ + s²Y₂) q + T u and Q q = F u, or without the row of a cart whose motion
    q₀ = X u₀ is prescribed, (∂Q/∂p) q + Q ∂q/∂p = ∂F/∂p u.
    """
    scene = estimate.scene
    geometry = geometry_of(scene)
    require_polynomial(scene)
    drive = next((signal.name for signal in model.inputs if signal.name in DRIVES), None)
    motions = [signal.name for signal in model.inputs if signal.name in SUPPORT]
    if motions:
        raise ComputationError(
            f"responses to {motions[0]} have no standard deviations: choose forces or the cart's motion"
        )
    inputs, outputs = _groups(geometry, model.inputs, PUSHES), _groups(geometry, model.outputs, READINGS)

    def arrays_of(response: Scene) -> Arrays:
        return _linear(response, inputs, outputs)

    arrays = arrays_of(scene)
    slopes = [
        shared_differences(scene, places, unit, arrays_of)
        for places, unit in zip(estimate.shared, estimate.units, strict=True)
    ]
    with np.errstate(all="ignore"):
        responses = [_at(1j * w, arrays, slopes, drive) for w in np.atleast_1d(omega).tolist()]
    G = np.stack([response for response, _ in responses], axis=-1)
    return G, np.stack([change for _, change in responses], axis=2)


def _groups(geometry: Geometry, signals: Iterable[Signal], known_groups: Mapping[str, Any]) -> tuple[str, ...]:
    """The names of the groups that signals belong to, in their order; of a signal of a structure alone its own."""
    names = [name for name in known_groups if geometry.on_cart or name not in OF_A_CART]
    present = {signal.name for signal in signals}
    owner: dict[str, str] = {}
    for name in names:
        members = [signal.name for signal in known_groups[name](geometry).signals]
        owner |= {signal_name: name if present.issuperset(members) else signal_name for signal_name in members}
    owner |= {signal.name: signal.name for signal in signals if is_point(signal.name)}
    return tuple(dict.fromkeys(owner[signal.name] for signal in signals if signal.name in owner))


def _linear(scene: Scene, inputs: Sequence[str], outputs: Sequence[str]) -> Arrays:
    """M, K, D, F, T and Y₀, Y₁, Y₂ of these groups of signals."""
    linear, geometry = matrices(scene), geometry_of(scene)
    pushes = [push_of(scene, geometry, name) for name in inputs]
    F = np.hstack([np.zeros((geometry.size, 0)), *(push.F for push in pushes)])
    thrust = np.hstack([np.zeros((len(geometry.tips), 0)), *(push.thrust for push in pushes)])
    parts: list[list[Floats]] = [[], [], [], []]
    for name in outputs:
        reading = reading_in(geometry, name)
        rows = len(reading.signals)
        for rows_of, part in zip(parts, (reading.position, reading.rate, reading.acceleration), strict=False):
            rows_of.append(np.zeros((rows, geometry.size)) if part is None else part)
        parts[3].append(thrust if reading.pushed else np.zeros((rows, F.shape[1])))
    Y0, Y1, Y2, T = (np.vstack(rows_of) for rows_of in parts)
    return linear.M, linear.K, linear.D, F, T, Y0, Y1, Y2


def _at(s: complex, arrays: Arrays, slopes: Sequence[Arrays], drive: str | None) -> tuple[Complexes, Complexes]:
    """G (p, m) and its derivatives (p, m, numbers) at one s."""
    M, K, D, F, T, Y0, Y1, Y2 = arrays
    n_driven = int(drive is not None)
    Q, Y = (s * s * M + s * D + K).astype(np.complex128), Y0 + s * Y1 + s * s * Y2
    size, m = len(Q), F.shape[1] + n_driven
    q = np.zeros((size, m), dtype=np.complex128)
    force, thrust = np.zeros((size, m), dtype=np.complex128), np.zeros((len(Y), m), dtype=np.complex128)
    force[:, n_driven:], thrust[:, n_driven:] = F, T
    if n_driven:
        q[0, 0] = 1 / s**2 if drive == "cart_acceleration" else 1 / s
    free = slice(n_driven, None)
    inner = Q[free, free]
    if not np.linalg.cond(inner) < 1 / np.finfo(float).eps:  # at a pole of a mode without a damper
        nothing = np.full((len(Y), m), np.nan + 0j)
        return nothing, np.repeat(nothing[..., None], len(slopes), axis=2)
    q[free] = np.linalg.solve(inner, force[free] - Q[free, :n_driven] @ q[:n_driven])
    changes = []
    for dM, dK, dD, dF, dT, dY0, dY1, dY2 in slopes:
        dQ = s * s * dM + s * dD + dK
        d_force = np.zeros_like(force)
        d_force[:, n_driven:] = dF
        dq = np.zeros_like(q)
        dq[free] = np.linalg.solve(inner, (d_force - dQ @ q)[free])
        d_thrust = np.zeros_like(thrust)
        d_thrust[:, n_driven:] = dT
        changes.append((dY0 + s * dY1 + s * s * dY2) @ q + Y @ dq + d_thrust)
    return Y @ q + thrust, np.stack(changes, axis=-1)


def magnitude_std(model: StateSpace, estimate: Estimate, omega: Floats) -> Floats:
    """Standard deviations of |G(iω)|, (p, m, W); NaN where G is infinite."""
    G, slopes = response_slopes(model, estimate, omega)
    size = np.abs(G)
    unit = np.divide(np.conj(G), size, out=np.zeros_like(G), where=size > 0)
    stds = estimate.std((unit[..., None] * slopes).real)
    exact = estimate.std(slopes.real) + estimate.std(slopes.imag)
    return np.where(size > 0, stds, exact)


# ------------------------------------------------------------------------------------------------------- shaper


@dataclass(frozen=True)
class ShapedMode:
    """A mode that a shaped command leaves swinging where the scene's numbers are off.

    `omega` and `zeta` with their standard deviations; `rms` is the root mean square of the residual vibration over the
    normal distribution of ω and ζ, `worst` its largest within ±2 standard deviations of ω and ζ; both as
    fractions of the swing that an unshaped command leaves.
    """

    omega: float
    omega_std: float
    zeta: float
    zeta_std: float
    rms: float
    worst: float

    def words(self, number: int) -> str:
        """What mode `number` retains, from 1 among those that the drive excites."""
        if np.isnan(self.rms):
            return f"shaped mode {number}: the fitted numbers split it, so it has no standard deviation of its own"
        return (
            f"shaped mode {number}: {self.omega:.6g} ± {self.omega_std:.2g} rad/s, damping ratio {self.zeta:.3g} ± "
            f"{self.zeta_std:.2g}: residual vibration {percent(self.rms)} rms, at most {percent(self.worst)} within "
            "2 standard deviations"
        )


def shaped_modes(shaper: Shaper, estimate: Estimate, drive: Drive, count: int) -> list[ShapedMode]:
    """What the `count` slowest modes retain of a shaped command over the band of the fitted numbers."""
    modes, rows = swing_rows(estimate.scene, drive)
    omega_p, zeta_p = mode_slopes(modes, estimate, rows[:count])
    modes_of_shaper = []
    for mode, by_omega, by_zeta in zip(modes.rows(rows[:count]), omega_p, zeta_p, strict=True):
        omega, zeta = mode.omega, mode.damping_ratio
        spread, wider = float(estimate.std(by_omega)), float(estimate.std(by_zeta))
        if np.isnan(spread + wider):
            modes_of_shaper.append(ShapedMode(omega, nan, zeta, nan, nan, nan))
            continue
        rms = _rms(shaper, omega, zeta, np.stack((by_omega, by_zeta)), estimate)
        grid = np.linspace(-2, 2, NODES)
        band = np.maximum(omega + spread * grid, 0.0)[:, None], np.clip(zeta + wider * grid, 0.0, 1 - 1e-9)
        worst = float(residual_vibration(shaper, *band).max())
        modes_of_shaper.append(ShapedMode(omega, spread, zeta, wider, rms, worst))
    return modes_of_shaper


def _rms(shaper: Shaper, omega: float, zeta: float, slopes: Floats, estimate: Estimate) -> float:
    """Of the residual vibration over ω and ζ with derivatives (2, p), by Gauss-Hermite quadrature."""
    strength, axes = np.linalg.eigh(slopes @ estimate.covariance @ slopes.T / np.outer([omega, 1.0], [omega, 1.0]))
    nodes, weights = np.polynomial.hermite_e.hermegauss(NODES)
    steps = np.stack(np.meshgrid(nodes, nodes)).reshape(2, -1) * np.sqrt(np.maximum(strength, 0.0))[:, None]
    changes = axes @ steps
    weight = np.outer(weights, weights).ravel() / weights.sum() ** 2
    square = residual_vibration(shaper, omega * (1 + changes[0]), np.clip(zeta + changes[1], 0.0, 1 - 1e-9)) ** 2
    return float(np.sqrt(weight @ square))
