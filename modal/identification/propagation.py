"""Standard deviations of modes, responses and shaped commands from the covariance of fitted parameters.

To first order, with exact derivatives, for a result r(p)

    std(r)² = (∂r/∂p)ᵀ cov (∂r/∂p)

[Ljung1999, §9.2].
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import nan, pi

import numpy as np

from modal.assembly import shared_differences
from modal.identification.estimate import Estimate
from modal.identification.identifiability import ModeDerivatives, matrix_derivatives, polar, require_polynomial
from modal.modes import Modes
from modal.report import percent
from modal.scene.doors import checked
from modal.statespace.channels import Arrays, Channel, Model, channel_model
from modal.statespace.model import StateSpace
from modal.statespace.shapers import Drive, Shaper, residual_vibration, swing_rows
from modal.types import Complexes, Floats

NODES = 21
"""Cost: nodes of a quadrature along either direction, and points of a band."""


@dataclass(frozen=True)
class ModeStds:
    """Standard deviations of a mode's ω (rad/s) and ζ; NaN if fitted parameters split a repeated frequency."""

    omega: float
    zeta: float

    @property
    def frequency(self) -> float:
        """The natural frequency, in Hz."""
        return self.omega / (2 * pi)


def mode_slopes(modes: Modes, estimate: Estimate, rows: Sequence[int]) -> tuple[Floats, Floats]:
    """∂ω/∂p and ∂ζ/∂p, (rows, p), of the modes with these indices."""
    dM, dK, dD = matrix_derivatives(estimate.scene, estimate.shared, estimate.units)
    first = int(modes.scene.cart is None and estimate.scene.cart is not None)  # of modes on a fixed cart
    derivatives = ModeDerivatives(modes, dM[:, first:, first:], dK[:, first:, first:], dD[:, first:, first:])
    pairs = [polar(complex(modes.eigenvalue[row]), derivatives.eigenvalue(row)) for row in rows]
    omega, zeta = (np.array(part).reshape(len(rows), len(estimate.unknowns)) for part in zip(*pairs, strict=True))
    return omega, zeta


@checked
def mode_stds(modes: Modes, estimate: Estimate, rows: Sequence[int]) -> list[ModeStds]:
    """Standard deviations of the modes with these indices, from 0; `modes` are those of the estimate's scene.

    Raise ComputationError for scenes too large for dense matrices.
    """
    if not rows:
        return []
    omega, zeta = mode_slopes(modes, estimate, rows)
    return [ModeStds(float(a), float(b)) for a, b in zip(estimate.std(omega), estimate.std(zeta), strict=True)]


# ----------------------------------------------------------------------------------------------------- response


def response_slopes(model: StateSpace, estimate: Estimate, omega: Floats) -> tuple[Complexes, Complexes]:
    """G(iω) (p, m, W) and its derivatives (p, m, W, numbers) by the estimate's numbers; NaN at a pole without a damper.

    Those of every input and output separately (`modal.statespace.channels`); a cart whose motion is an input is fixed
    under all others.
    """
    scene, at = estimate.scene, np.atleast_1d(omega)
    require_polynomial(scene)
    form = channel_model(scene, [Channel(read.name, push.name) for read in model.outputs for push in model.inputs])
    if any(kind.moves == "cart" for kind in form.kinds):
        form = replace(form, kinds=tuple(kind._replace(moves=kind.moves or "held") for kind in form.kinds))
    parts = [
        shared_differences(scene, places, unit, form.arrays)
        for places, unit in zip(estimate.shared, estimate.units, strict=True)
    ]
    slopes = Arrays(*(np.array(part) for part in zip(*parts, strict=True)))
    responses = Model(form.kinds, form.arrays(scene))
    with np.errstate(all="ignore"):
        pairs = [responses.gradient(channel, at, slopes) for channel in range(len(form.channels))]
        at_pole = ~(responses.condition(at) < 1 / np.finfo(float).eps)
    shape = len(model.outputs), len(model.inputs), len(at)
    G, changes = (np.array(part).reshape(*shape, *part[0].shape[1:]) for part in zip(*pairs, strict=True))
    G[:, :, at_pole] = changes[:, :, at_pole] = np.nan
    return G, changes


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
    """Residual vibration of a mode after a shaped command with uncertain parameters.

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
        """Return the residual of mode `number`, from 1 among those that the drive excites."""
        if np.isnan(self.rms):
            return f"shaped mode {number}: the fitted numbers split it, so it has no standard deviation of its own"
        return (
            f"shaped mode {number}: {self.omega:.6g} ± {self.omega_std:.2g} rad/s, damping ratio {self.zeta:.3g} ± "
            f"{self.zeta_std:.2g}: residual vibration {percent(self.rms)} rms, at most {percent(self.worst)} within "
            "2 standard deviations"
        )


def shaped_modes(shaper: Shaper, estimate: Estimate, drive: Drive, count: int) -> list[ShapedMode]:
    """Return the residuals of the `count` slowest modes over the band of the fitted parameters."""
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
    """The RMS of the residual vibration over ω and ζ with derivatives (2, p), by Gauss-Hermite quadrature."""
    strength, axes = np.linalg.eigh(slopes @ estimate.covariance @ slopes.T / np.outer([omega, 1.0], [omega, 1.0]))
    nodes, weights = np.polynomial.hermite_e.hermegauss(NODES)
    steps = np.stack(np.meshgrid(nodes, nodes)).reshape(2, -1) * np.sqrt(np.maximum(strength, 0.0))[:, None]
    changes = axes @ steps
    weight = np.outer(weights, weights).ravel() / weights.sum() ** 2
    square = residual_vibration(shaper, omega * (1 + changes[0]), np.clip(zeta + changes[1], 0.0, 1 - 1e-9)) ** 2
    return float(np.sqrt(weight @ square))
