"""Derivatives of frequencies and effective masses of structures in which terms of 13 orders cancel, by 50 digits."""

import mpmath as mp
import numpy as np
import pytest
from structures import DIGITS, Oracle

from modal import Bob, ModalSupport, Pendulum, Platform, Rod, Scene, Spring, Swing, Tilt, natural_modes
from modal.modes import squares
from modal.modes.sensitivity import of_mode
from modal.scene.parameters import vary
from modal.scene.supports import Planar

HEAVY = Bob(mass=2.7e6, length=1252.0, stiffness=3.6e9)
BOARD = Scene(
    gravity=11.6,
    support=Tilt(name="board", mass=2.7e-11, inertia=3.9e-7, centre=(0.0, 209.75)),
    pendulum=[Pendulum(position=(0.0, 419.5), links=[HEAVY])],
)
SHIP = Scene(
    gravity=6.6,
    support=Platform(mass=23.0, inertia=2.9e6, stiffness=Planar(sway=2e3, heave=6.9e9, roll=1.9e10)),
    pendulum=[
        Pendulum(position=(0.25, 1.5), links=[Rod(mass=4.7, length=1.25), Bob(mass=6.4e-12, length=0.375)]),
        Pendulum(links=[Bob(mass=4e-4, length=1.875), Bob(mass=2.9e6, length=0.3125), Rod(mass=0.6, length=1.75)]),
    ],
)
SWING = Scene(
    gravity=9.8,
    support=Swing(name="swing", mass=1e-9, length=3.0),
    pendulum=[Pendulum(links=[Rod(mass=1e-5, length=0.75), Bob(mass=4e5, length=0.5), Bob(mass=0.2, length=0.875)])],
    spring=[Spring(between=("swing", "ground"), stiffness=2e3)],
)


@pytest.mark.parametrize("scene", [BOARD, SHIP, SWING], ids=["board", "ship", "swing"])
def test_what_cancels_keeps_its_digits_on_structures(scene: Scene) -> None:
    """∂x/∂p = φᵀ(∂K/∂p − x ∂M/∂p)φ, x = ω²; M and K are quadratic in numbers of few bits: differences are exact."""
    modes = natural_modes(scene)
    each = [of_mode(modes, row) for row in modes]
    with mp.workdps(DIGITS):
        M, K, _ = Oracle(scene).matrices()
        inverse = mp.cholesky(M) ** -1
        square, V = mp.eigsy(inverse * K * inverse.T)
        true: dict[str, list[float]] = {}
        for place, number in {at: slope.number for at, slope in each[0].items()}.items():
            if place != "support.length":
                sides = [Oracle(vary(scene, {place: number * factor})).matrices() for factor in (1.125, 0.875)]
                dM, dK = ((sides[0][k] - sides[1][k]) * 4 for k in (0, 1))
                shapes = (inverse.T * V[:, k] for k in range(len(modes)))
                slopes = (
                    (phi.T * (dK - x * dM) * phi)[0] / (2 * x) for phi, x in zip(shapes, square, strict=True)
                )  # fmt: skip
                true[place] = list(map(float, slopes))
    for k, of_row in enumerate(each):
        largest = max(abs(slopes[k]) for slopes in true.values())
        for place, slopes in true.items():
            assert of_row[place].relative == pytest.approx(slopes[k], rel=1e-12, abs=1e-12 * largest), (k, place)


def test_what_cancels_and_is_not_refined_has_no_derivative(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(squares, "MOST_REFINED", 0)
    modes = natural_modes(BOARD)
    assert [bool(of_mode(modes, row)) for row in modes] == [True, False]


@pytest.mark.parametrize("scene", [BOARD, SWING], ids=["board", "swing"])
def test_effective_masses_that_cancel_keep_their_digits(scene: Scene) -> None:
    """(φᵀMe)², of a sum over all centres of mass."""
    oracle = Oracle(scene)
    with mp.workdps(DIGITS):
        M, K, _ = oracle.matrices()
        inverse = mp.cholesky(M) ** -1
        _, V = mp.eigsy(inverse * K * inverse.T)
        momentum = mp.zeros(1, oracle.size)
        for mass, (along, _) in oracle._drawn.parts.masses:
            for at, slope in along.first.items():
                momentum[at] += mass * slope
        true = [float((momentum * inverse.T * V[:, k])[0] ** 2) for k in range(oracle.size)]
    assert natural_modes(scene).effective_mass == pytest.approx(true, rel=1e-12, abs=0)
    assert min(true) < 1e-9 * max(true)


def test_a_modal_support_has_no_effective_masses_where_momentum_cancels() -> None:
    support = ModalSupport(name="frame", M=[[5.0]], K=[[2e3]], D=[[0.0]], points=[[[1.0], [0.0]]])
    pendula = [Pendulum(on="frame[0]", links=[Bob(mass=1.0, length=length)]) for length in (1.0, 1.000001)]
    modes = natural_modes(Scene(gravity=9.8, support=support, pendulum=pendula))
    assert np.isnan(modes.effective_mass).tolist() == [True, True, True]
