"""How far a linear frequency can be trusted: ω(a) = ω (1 + κ a²) to second order in the amplitude a.

    Γ = (ω²/8) [ −½ φ_x Σ b_i φ_i³ − ¼ Σ_ij A_ij (φ_i − φ_j)² φ_i φ_j ] + (g/64) Σ b_i φ_i⁴
    κ = −4 Γ / (φᵀ M φ ω²)

with σ_i b_i and σ_i σ_j A_ij for b_i and A_ij where links stand up (σ_i = −1); from averaging the fourth-order
Lagrangian, even in the amplitude.  It holds away from 1:1 and 1:3 resonance and for motion in one vertical plane.  A
simple pendulum has κ = −1/16 (1/rad², of the largest angle).
"""

from __future__ import annotations

from math import degrees, inf, sqrt

import numpy as np

from modal.rig import Block, Floats


def quartic(block: Block, x: Floats, cart: Floats, angle: Floats) -> Floats:
    """Each chain's part (P, R) of Γ at g = 1, for x = ω² and cart displacements (R,) and angles (n, P, R)."""
    b = (block.sigma * block.b)[:, :, None]
    inertial = -cart / 2 * (b * angle**3).sum(0) - _pairs(block, angle) / 2
    part: Floats = x / 8 * inertial + (b * angle**4).sum(0) / 64
    return part


def _pairs(block: Block, angle: Floats) -> Floats:
    """Σ_{i above j} A_ij (φ_i − φ_j)² φ_i φ_j of every chain, (P, R), by running sums down the chain."""
    b, length = ((block.sigma * values)[:, :, None] for values in (block.b, block.length))
    total = np.zeros(angle.shape[1:])
    sums = [np.zeros(angle.shape[1:]) for _ in range(3)]
    for i, phi in enumerate(angle):
        total += b[i] * phi * (sums[2] - 2 * sums[1] * phi + sums[0] * phi**2)
        sums = [s + length[i] * phi**power for power, s in enumerate(sums, 1)]
    return total


def coefficient(gamma: Floats, modal_mass: Floats, x: Floats, largest: Floats) -> Floats:
    """κ (R,) of the modes with these Γ, φᵀMφ, ω² and largest angles, (1/rad², of the largest angle)."""
    return -4.0 * gamma / (modal_mass * x) / largest**2


def one_percent_amplitude(kappa: float) -> float:
    """Largest angle of a mode (deg) at which |κ| a² = 0.01; infinite where κ = 0, NaN where κ has no meaning."""
    return degrees(sqrt(0.01 / abs(kappa))) if kappa else inf
