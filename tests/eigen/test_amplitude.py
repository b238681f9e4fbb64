"""The amplitude coefficient κ against the Lagrangian itself, averaged numerically in many digits."""

from __future__ import annotations

import mpmath as mp
import numpy as np
import pytest
from amounts import usually
from scenes import mild_scene
from test_identities import chains

from modal import Cart, Scene, natural_modes
from modal.eigen import one_percent_amplitude


def lagrangian(scene: Scene, q: list[mp.mpf], rate: list[mp.mpf]) -> mp.mpf:
    """T − V of the exact planar scene from Cartesian positions and velocities."""
    cart = isinstance(scene.support, Cart)
    at, value = int(cart), mp.mpf(0)
    speed = rate[0] if cart else mp.mpf(0)
    if isinstance(scene.support, Cart):
        value += mp.mpf(scene.support.mass) * speed**2 / 2 - mp.mpf(scene.support.stiffness) * q[0] ** 2 / 2
    for links in chains(scene):
        x, z, down = speed, mp.mpf(0), mp.mpf(0)
        for link in links:
            s, c, w = mp.sin(q[at]), mp.cos(q[at]), rate[at]
            arm = mp.mpf(link.centre)
            vx, vz = x + arm * c * w, z - arm * s * w
            value += (
                link.mass * (vx**2 + vz**2) / 2 + link.inertia * w**2 / 2 + link.mass * scene.gravity * (down + arm * c)
            )
            x, z, down = x + link.length * c * w, z - link.length * s * w, down + link.length * c
            at += 1
    return value


def fourth_order_average(scene: Scene, phi: list[float], omega: float) -> mp.mpf:
    """⟨L⟩ at fourth order in a, for q = a φ cos τ, by Richardson on three amplitudes and the trapezoidal rule."""
    mp.mp.dps = 50

    def average(a: mp.mpf) -> mp.mpf:
        times = [2 * mp.pi * k / 16 for k in range(16)]
        return (
            mp.fsum(
                lagrangian(scene, [a * f * mp.cos(t) for f in phi], [-a * omega * f * mp.sin(t) for f in phi])
                for t in times
            )
            / 16
        )

    a = mp.mpf("1e-3")
    rest, single, two, three = (average(k * a) for k in (0, 1, 2, 3))
    matrix = mp.matrix([[(k * a) ** p for p in (2, 4, 6)] for k in (1, 2, 3)])
    return mp.lu_solve(matrix, mp.matrix([single - rest, two - rest, three - rest]))[1]


@pytest.mark.parametrize("seed", usually(range(5), range(10)))
def test_kappa_is_the_average_of_the_fourth_order_lagrangian(seed: int) -> None:
    """With ∂⟨L⟩/∂a = 0: ω² shifts by −4Γ/(φᵀMφ)·2 a², Γ = ⟨L₄⟩, so κ = −4Γ/(φᵀMφ ω²) for q = a φ cos τ."""
    scene = mild_scene(seed)
    modes = natural_modes(scene)
    for number, row in enumerate(modes):
        if row.omega == 0 or row.multiplicity > 1 or row.family.startswith("cart still"):
            continue
        shape, unit = modes.shape(number, 0, "angle"), modes.shape(number, 0, "mass")
        phi = [*([float(shape.cart)] if modes.rig.cart else []), *map(float, shape.angles)]
        k = int(np.abs(shape.angles).argmax())
        modal_mass = float(shape.angles[k] / unit.angles[k]) ** 2
        gamma = fourth_order_average(scene, phi, row.omega)
        assert row.kappa == pytest.approx(float(-4 * gamma / (modal_mass * row.omega**2)), rel=1e-6, abs=1e-9)


def test_one_percent_amplitude() -> None:
    assert one_percent_amplitude(-1 / 16) == pytest.approx(np.degrees(0.4))
    assert one_percent_amplitude(0.0) == np.inf
    assert np.isnan(one_percent_amplitude(np.nan))
