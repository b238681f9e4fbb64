"""Rows and shapes where squares leave double precision, where trees have exact zeros, and where a shape is lost."""

from __future__ import annotations

import random

import numpy as np
import pytest
from scenes import extreme_pendulum

from modal.eigen.secular import Poles, solve
from modal.eigen.spectrum import ModalSpectrum
from modal.errors import ComputationError
from modal.modes import natural_modes
from modal.scene import Bob, Cart, Heave, Pendulum, Rod, Scene, Spring, load

NEARLY_EQUAL = (60, 317, 1, 2, 3)
"""Seeds: of the first two the squares of the fastest mode's displacements underflow."""
ROUND = (0.1, 0.2, 0.25, 0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0)


def nearly_equal_chains(seed: int) -> Scene:
    """Chains that differ by 1e-16 to 1e-9 of their numbers, and in some links, on a cart of any mass."""
    rng = random.Random(seed)
    spread = rng.choice([1, 3, 8, 12])
    pendula = [first := extreme_pendulum(rng, spread, longest=rng.choice([2, 5, 8]))]
    for _ in range(rng.choice([1, 2])):
        links = []
        for link in first.links:
            numbers = {
                name: getattr(link, name) * (1 + rng.uniform(-1, 1) * 10 ** rng.uniform(-16, -9))
                for name in ("mass", "length")
            }
            links.append(link.replace(**numbers))
            if rng.random() < 0.2:
                links.append(extreme_pendulum(rng, spread, 1).links[0])
        pendula.append(Pendulum(links=tuple(links)))
    if rng.random() < 0.4:
        pendula.append(extreme_pendulum(rng, spread, 13))
    gravity, cart = 10 ** rng.uniform(-3, 6), 10 ** rng.uniform(-12, 12)
    stiffness = rng.choice([0, 0, 10 ** rng.uniform(-6, 6)])
    return Scene(gravity=gravity, support=Cart(mass=cart, stiffness=stiffness), pendulum=tuple(pendula))


def unjoined_carts(seed: int) -> Scene:
    """Two or three carts, some joined by a spring, of round numbers, by which effective masses cancel exactly."""
    rng = random.Random(seed)
    names = "abc"[: rng.choice([2, 2, 3])]
    supports = tuple(Cart(name=name, mass=rng.choice(ROUND), stiffness=rng.choice([0, 0, 10.0])) for name in names)
    pendula = tuple(
        Pendulum(
            on=name,
            count=rng.choice([1, 1, 2]),
            links=tuple(
                rng.choice([Bob, Rod])(mass=rng.choice(ROUND), length=rng.choice(ROUND))
                for _ in range(rng.choice([1, 1, 2]))
            ),
        )
        for name in names
    )
    springs = (Spring(between=("a", "b"), stiffness=rng.choice(ROUND)),) if rng.random() < 0.4 else ()
    return Scene(gravity=9.81, support=supports, pendulum=pendula, spring=springs)


@pytest.mark.parametrize("seed", NEARLY_EQUAL)
def test_shares_of_energy_of_nearly_equal_chains_are_numbers(seed: int) -> None:
    modes = natural_modes(nearly_equal_chains(seed))
    for number, mode in enumerate(modes):
        shape = modes.shape(number)
        assert mode.family
        assert np.isfinite(shape.kinetic_energy_share).all()
        assert 0 < shape.kinetic_energy_share.sum() <= 1 + 1e-9


def test_shapes_of_carts_whose_masses_cancel_the_masses_felt_are_those_of_the_matrices() -> None:
    """A cart of 3 kg under a bob of 0.5 kg on 1.5 m: at its mode m + μ is 0 to the last digit."""
    for seed in range(60):
        modes = natural_modes(unjoined_carts(seed))
        matrices = modes.matrices
        for number, omega in enumerate(modes.omega):
            phi = modes.column(modes.shape(number))
            stiff, inertial = matrices.K @ phi, omega**2 * (matrices.M @ phi)
            assert np.abs(stiff - inertial).max() <= 1e-9 * max(np.abs(stiff).max(), np.abs(inertial).max(), 1e-6)
    two = Scene(
        gravity=9.81,
        support=(Cart(name="a", mass=3.0), Cart(name="b", mass=6.0)),
        pendulum=[Pendulum(on=name, links=[Bob(mass=0.5, length=1.5)]) for name in "ab"],
    )
    families = natural_modes(two).family.tolist()
    assert families[2:] == [
        "b moves: pendula in antiphase with the support",
        "a moves: pendula in antiphase with the support",
    ]


def test_a_light_pole_has_its_root() -> None:
    """A weight of 1e-165 next to one of 1: the first root is below its pole by less than any float near it."""
    roots = solve(Poles(np.array([1.0, 3.0]), np.array([1e-165, 1.0]), 0.5))
    assert np.isfinite(roots.offset).all()
    assert roots.offset[0] == pytest.approx(1e-165 / (0.5 + 1.0 / 2.0), rel=1e-12)
    assert roots.offset[1] == pytest.approx(2.0, rel=1e-12)


def test_a_row_without_its_shape_says_so_and_the_others_stand(monkeypatch: pytest.MonkeyPatch) -> None:
    expected = [mode.to_dict() for mode in natural_modes(load("paper-cart-2"))]
    details = ModalSpectrum.details
    lost = natural_modes(load("paper-cart-2")).spectrum.groups[3][0]

    def failing(self: ModalSpectrum, source: int, rows: list[int]) -> object:
        if len(self.eigenvalue) == 5 and source == lost.source and lost.row in rows:
            raise ComputationError("a shape that is not found")
        return details(self, source, rows)

    monkeypatch.setattr(ModalSpectrum, "details", failing)
    modes = natural_modes(load("paper-cart-2"))
    rows = [mode.to_dict() for mode in modes]
    assert rows[3]["omega_rad_per_s"] == expected[3]["omega_rad_per_s"]
    assert rows[3]["family"] == "its shape is beyond double precision"
    assert rows[3]["kappa_per_rad2"] is None
    assert [*rows[:3], rows[4]] == [*expected[:3], expected[4]]
    assert "its shape is beyond double precision" in modes.table()


def test_a_star_never_names_a_mode_of_the_selection_in_the_place_of_one_of_the_scene() -> None:
    pendulum = Pendulum(links=(Bob(mass=0.3, length=1.0),))
    scene = Scene(gravity=9.81, support=Heave(mass=1.0, stiffness=20.0), pendulum=(pendulum,))
    whole = natural_modes(scene)
    assert whole[0].resonances == ("1:2 with mode 2",)
    assert natural_modes(scene, modes=slice(0, 1))[0].resonances == ("1:2 with another mode",)
