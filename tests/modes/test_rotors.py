"""Rotors at joints in linear models: closed forms, proved enclosures, and the same numbers by other routes."""

from __future__ import annotations

from decimal import Decimal
from math import sqrt

import numpy as np
import pytest
import scipy
from scenes import geared, mild_scene, sprung_scene, structured_scene

from modal import Bob, Cart, Pendulum, Rod, Scene, SceneError, natural_modes
from modal.assembly import assemble_pendula, matrices, rig_of
from modal.coupling.dynamic_mass import dynamic_mass
from modal.coupling.reduced import reduced, without_damping
from modal.exact import enclose
from modal.modes.sensitivity import of_mode
from modal.scene.parameters import vary


def test_one_link_and_two_are_those_of_their_closed_forms() -> None:
    """ω² = m g c/(I + J); of two bobs the roots of the determinant of 2 by 2."""
    rod = Rod(mass=0.4, length=0.5, rotor_inertia=6.3e-5, gear_ratio=36.0)
    (row,) = natural_modes(Scene(gravity=9.81, pendulum=[Pendulum(links=[rod])]))
    assert row.omega == pytest.approx(sqrt(0.4 * 9.81 * 0.25 / (0.4 * 0.25 / 3 + 6.3e-5 * 36**2)), rel=1e-15)
    m, l, g, J, N = 0.3, 0.7, 9.81, 0.05, 0.02
    first, second = Bob(mass=m, length=l, rotor_inertia=J), Bob(mass=m, length=l, rotor_inertia=N / 25, gear_ratio=5.0)
    a, b, c = 2 * m * l * l + J + N, m * l * l - N, m * l * l + N
    p, q = 2 * m * g * l, m * g * l
    square = np.roots([a * c - b * b, -(a * q + c * p), p * q])
    modes = natural_modes(Scene(gravity=g, pendulum=[Pendulum(links=[first, second])]))
    assert np.sort(modes.omega) == pytest.approx(np.sqrt(np.sort(square)), rel=1e-14)


@pytest.mark.parametrize("decades", [0.0, 3.0, 12.0])
@pytest.mark.parametrize("seed", range(12))
def test_the_table_keeps_its_promise(seed: int, decades: float) -> None:
    """Every frequency is within its error bound of a proved one, however heavy the rotors are."""
    scene = geared(sprung_scene(seed, 2.0), seed, decades)
    modes, proved = natural_modes(scene), enclose(scene, 25)
    assert sorted(modes.multiplicity) == sorted(row.multiplicity for row in proved)
    exact = np.repeat([float(Decimal(row.low)) for row in proved], [row.multiplicity for row in proved])
    omega, error = (np.repeat(part, modes.multiplicity) for part in (modes.omega, modes.error))
    order = np.argsort(omega)
    assert (np.abs(omega[order] - exact) <= error[order] * exact).all()


@pytest.mark.parametrize("seed", range(8))
def test_shapes_and_derivatives_on_structures_and_carts(seed: int) -> None:
    """K φ = ω² M φ with M from the rows, and ∂ω/∂J against differences."""
    scene = geared((mild_scene if seed % 2 else structured_scene)(seed, **({} if seed % 2 else {"spread": 0.5})), seed)
    modes, parts = natural_modes(scene), matrices(scene)
    for row in modes:
        for copy in range(row.multiplicity):
            shape = modes.column(modes.shape(modes.index_of(row), copy, "mass")).real
            force = parts.K @ shape - row.omega**2 * (parts.M @ shape)
            assert np.abs(force).max() < 1e-9 * (1 + np.abs(parts.K @ shape).max())
        if row.multiplicity > 1 or not row.omega or np.sum(np.abs(modes.omega / row.omega - 1) < 1e-2) > 1:
            continue
        for place, slope in of_mode(modes, row).items():
            if place.endswith(("rotor_inertia", "gear_ratio")):
                ends = [natural_modes(vary(scene, {place: slope.number * f})).omega for f in (1 - 1e-5, 1 + 1e-5)]
                low, high = (omega[np.abs(omega - row.omega).argmin()] for omega in ends)
                assert (high - low) / 2e-5 == pytest.approx(slope.derivative * slope.number, abs=1e-7 * row.omega)


@pytest.mark.parametrize("seed", range(8))
def test_the_coupling_has_them(seed: int) -> None:
    """In the coordinates of a structure and the fixed-base modes; the residual mass is the Schur complement."""
    scene = geared(structured_scene(seed, 0.5), seed)
    structure = reduced(without_damping(rig_of(scene)))
    parts = matrices(scene)
    squares = scipy.linalg.eigh(parts.K, parts.M, eigvals_only=True)
    for square in scipy.linalg.eigh(structure.K, structure.M, eigvals_only=True):
        assert np.abs(squares - square).min() < 1e-9 * np.abs(squares).max()
    hung = geared(mild_scene(4 * seed), seed)
    rig = rig_of(hung.replace(pendulum=[pendulum.replace(count=1) for pendulum in hung.pendulum]))
    mass = dynamic_mass(reduced(without_damping(rig)), as_one_part=True)
    kinds = [
        (block, column) for block in rig.blocks for column in range(block.size) for _ in range(block.count[column])
    ]
    M, _ = assemble_pendula(kinds, rig_cart(), 9.81)
    schur = M[0, 0] - M[0, 1:] @ np.linalg.solve(M[1:, 1:], M[1:, 0])
    assert mass.residual == pytest.approx(schur, rel=1e-9)


def rig_cart() -> object:
    """A cart without mass."""
    return rig_of(
        Scene(gravity=1.0, support=Cart(mass=0.0), pendulum=[Pendulum(links=[Rod(mass=1.0, length=1.0)])])
    ).cart


@pytest.mark.parametrize(("rotors", "count"), [("001", 3), ("01", 3), ("1", 2), ("010", 4)])
def test_a_massless_cart_loses_a_mode_where_no_rotor_moves_with_it(rotors: str, count: int) -> None:
    """It moves a rotor at the first joint or the second, and a third bob holds still."""
    links = [Bob(mass=1.0, length=1.0, rotor_inertia=0.1 * int(rotor)) for rotor in rotors]
    scene = Scene(gravity=9.81, support=Cart(mass=0.0), pendulum=[Pendulum(links=links)])
    modes, proved = natural_modes(scene), enclose(scene, 20)
    assert len(modes) == len(proved) == count
    assert ("massless_cart" in scene.features) == (count == len(links))
    assert modes.omega == pytest.approx([float(row.low) for row in proved], rel=1e-13)


def test_a_gear_without_a_rotor_is_refused() -> None:
    with pytest.raises(SceneError, match=r"gear_ratio = 36: needs a rotor_inertia"):
        Pendulum(links=[Bob(mass=1.0, length=1.0, gear_ratio=36.0)])
