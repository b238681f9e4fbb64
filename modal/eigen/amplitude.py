"""The range of validity of a linear frequency: ω(a) = ω (1 + κ a²) to second order in the amplitude a.

    Γ = (ω²/8) [ −½ φ_x Σ b_i φ_i³ − ¼ Σ_ij A_ij (φ_i − φ_j)² φ_i φ_j ] + (g/64) Σ b_i φ_i⁴
    κ = −4 Γ / (φᵀ M φ ω²)

with σ_i b_i and σ_i σ_j A_ij for b_i and A_ij where links are inverted (σ_i = −1); from averaging the fourth-order
Lagrangian, even in the amplitude.  It holds away from 1:1 and 1:3 resonance and for motion in one vertical plane.  A
simple pendulum has κ = −1/16 (1/rad², of the largest angle).

A second mode ψ is driven by the cubic forces of φ at k = 1 or 3 times its frequency.  Averaged over
q = aφ cos τ + cψ cos kτ the Lagrangian has the terms Γa⁴ + G₁a³c + G₂a²c², so that

    c/a = 2G₁a² / (ψᵀMψ (ω_ψ² − k²ω(a)²) − 4G₂a²),        ω(a)²/ω² − 1 = 2κa² (1 + ¾ G₁c/(Γa)):

G₂ is the drift of the other frequency.  Near 1:1 or 1:3 the response c changes the shape and the frequency.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import degrees, inf, pi, sqrt
from typing import NamedTuple

import numpy as np

from modal.assembly import Block
from modal.types import Floats

RATIOS = np.array([[0.0], [1.0], [-1.0], [2.0], [-2.0]])
"""Ratios of the amplitudes of two modes at which their mean Lagrangian is evaluated."""
INSTANTS = 33
"""Tolerance: instants of a quarter period among which the largest angle is sought, 1 % of it between two."""
ONE_PERCENT = 0.01
"""Physics: relative shift of a frequency up to which it is linear, the amplitude of which is stated."""
LIGHT = 0.1
"""Tolerance: damping ratio, and out-of-phase share of a shape, up to which a mode has an amplitude coefficient."""


def quartic(block: Block, x: Floats, cart: Floats, angle: Floats) -> Floats:
    """Each chain's part (P, R) of Γ at g = 1, for x = ω², cart displacements (R,) and angles (n, P, R)."""
    b = (block.sigma * block.b)[:, :, None]
    cube = b * (angle * angle * angle)
    inertial = -cart / 2 * cube.sum(0) - _pairs(block, angle, angle) / 2
    part: Floats = x / 8 * inertial + (cube * angle).sum(0) / 64
    return part


def fourth_order(block: Block, angle: Floats, cart_velocity: Floats, speed: Floats) -> Floats:
    """The contribution of each chain (P, R) to the fourth-order Lagrangian at g = 1, at one instant."""
    b = (block.sigma * block.b)[:, :, None]
    square = angle * angle
    inertial = cart_velocity * (b * square * speed).sum(0) + _pairs(block, angle, speed)
    lagrangian: Floats = (b * square * square).sum(0) / 24 - inertial / 2
    return lagrangian


def _pairs(block: Block, angle: Floats, speed: Floats) -> Floats:
    """Σ_{i above j} A_ij (θ_i − θ_j)² θ_i' θ_j' of every chain, (P, R), by running sums down the chain."""
    b, length = ((block.sigma * values)[:, :, None] for values in (block.b, block.length))
    sums = []
    for power in range(3):
        terms = length * speed * angle**power
        sums.append(np.concatenate([np.zeros_like(terms[:1]), np.cumsum(terms[:-1], axis=0)]))
    total: Floats = (b * speed * (sums[2] - 2 * sums[1] * angle + sums[0] * angle**2)).sum(0)
    return total


def coefficient(gamma: Floats, modal_mass: Floats, x: Floats, largest: Floats) -> Floats:
    """κ (R,) of the modes with these Γ, φᵀMφ, ω² and largest angles, (1/rad², of the largest angle)."""
    return -4.0 * gamma / (modal_mass * x) / largest**2


def one_percent_amplitude(kappa: float) -> float:
    """Largest angle of a mode (deg) at which |κ| a² = 0.01; infinite where κ = 0, NaN where κ is undefined."""
    return degrees(sqrt(ONE_PERCENT / abs(kappa))) if kappa else inf


class ModeSwing(NamedTuple):
    """R shapes with a largest angle of 1: ω² and φᵀMφ (R,), the cart (R,) and the angles (n, P, R) of each block."""

    x: Floats
    modal_mass: Floats
    cart: Floats
    angles: tuple[Floats, ...]


def distortion(
    blocks: tuple[Block, ...], swing: ModeSwing, answers: Sequence[tuple[int, ModeSwing]], kappa: float
) -> Floats:
    """Return the relative error of one shape's 1 % angle, then its changes by the responses of others, (1 + R,).

    `answers` are R shapes with the harmonic k in which each is driven; the error is by all of them and by the next
    order of the shape's own frequency. The angle is the largest of any link over the period; errors and changes are
    infinite if two frequencies meet below it.
    """
    a2 = min(ONE_PERCENT / abs(kappa), (pi / 2) ** 2)
    chosen = np.vstack((np.ones(len(answers)), np.eye(len(answers))))
    size, bend, meets = np.zeros((3, len(answers)))
    for at, (harmonic, response) in enumerate(answers):
        driven = harmonic**2 * swing.x
        gamma, first, second = _quartic_terms(blocks, swing, response, harmonic)
        linear_detuning = response.modal_mass * (response.x - driven)
        detuning = response.modal_mass * (response.x - driven * (1 + 2 * kappa * a2)) - 4 * second * a2
        size[at] = (2 * first * a2 / detuning).item()
        bend[at] = (0.75 * first * size[at] / gamma).item()
        meets[at] = (linear_detuning * detuning <= 0).item()
    shift_factor = 1 + chosen @ bend
    is_infinite = (chosen @ meets > 0) | (shift_factor <= 0)
    angles = _largest(swing, answers, chosen * size) / np.sqrt(np.where(is_infinite, 1, shift_factor))
    angles[0] *= _amplitude_ratio(blocks, swing, kappa)
    return np.where(is_infinite, inf, angles - 1)


def _amplitude_ratio(blocks: tuple[Block, ...], swing: ModeSwing, kappa: float) -> float:
    """The angle of 1 % over its first guess, without other modes.

    With a share p of the potential in Γ the averaged Lagrangian is stationary at r² = ω(a)²/ω² where
    1 − r² = −2κa² (p + (1 − p) r²), exact in r for terms up to a⁴.
    """
    pairs = zip(blocks, swing.angles, strict=True)
    potential = sum(float(((block.sigma * block.b)[:, :, None] * angle**4).sum()) for block, angle in pairs) / 64
    p = -4 * potential / (swing.modal_mass * swing.x * kappa).item()
    r = 1 + np.copysign(ONE_PERCENT, kappa)
    square = (1 - r**2) / (p + (1 - p) * r**2) / -2 / kappa
    return sqrt(max(square, 0.0) * abs(kappa) / ONE_PERCENT)


def _quartic_terms(
    blocks: tuple[Block, ...], swing: ModeSwing, response: ModeSwing, harmonic: int
) -> tuple[Floats, Floats, Floats]:
    """(Γ, G₁, G₂) from the average at RATIOS, exact for a polynomial of fourth degree."""
    phase = (np.arange(4) + 0.5) * pi / 2 / 4  # whose mean is exact for products of four factors cos τ and cos 3τ
    elongation, velocity = RATIOS * np.cos(harmonic * phase), -RATIOS * harmonic * np.sin(harmonic * phase)
    cos, sin, omega = np.cos(phase), -np.sin(phase), np.sqrt(swing.x)
    cart_velocity = _lanes(swing.cart * omega, sin) + _lanes(response.cart * omega, velocity)
    total = np.zeros(len(cart_velocity))
    for block, swung, its in zip(blocks, swing.angles, response.angles, strict=True):
        angle = _lanes(swung, cos) + _lanes(its, elongation)
        speed = _lanes(swung * omega, sin) + _lanes(its * omega, velocity)
        total += fourth_order(block, angle, cart_velocity, speed).sum(0)
    none, plus_one, minus_one, plus_two, minus_two = total.reshape(len(omega), len(RATIOS), -1).mean(2).T
    first = (8 * (plus_one - minus_one) - (plus_two - minus_two)) / 12
    second = (16 * (plus_one + minus_one) - (plus_two + minus_two) - 30 * none) / 24
    return none, first, second


def _lanes(values: Floats, factors: Floats) -> Floats:
    """(…, R · L) from values (…, R) and L factors."""
    per_ratio = np.broadcast_to(factors, (len(RATIOS), factors.shape[-1]))
    lanes: Floats = (values[..., None] * per_ratio.ravel()).reshape(*values.shape[:-1], -1)
    return lanes


def _largest(swing: ModeSwing, answers: Sequence[tuple[int, ModeSwing]], sizes: Floats) -> Floats:
    """The largest angle over the period (C,), for a = 1 and C sets of sizes (C, R) of the responses."""
    time = np.linspace(0.0, pi / 2, INSTANTS)
    waves = np.array([np.cos(harmonic * time) for harmonic, _ in answers]).reshape(-1, INSTANTS)
    largest = []
    for at, angles in enumerate(swing.angles):
        theirs = np.concatenate([angles[..., :0], *(response.angles[at] for _, response in answers)], axis=-1)
        response_angles = np.tensordot(theirs, sizes[:, :, None] * waves, axes=(2, 1))
        largest.append(np.abs(angles[..., None] * np.cos(time) + response_angles).max((0, 1, 3)))
    return np.asarray(np.max(largest, axis=0))
