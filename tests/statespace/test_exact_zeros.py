"""Entries of A and B against rationals of Newton's law: what vanishes is 0.0, all else keeps its digits."""

from __future__ import annotations

from fractions import Fraction
from random import Random

import numpy as np
import pytest

from modal import Bob, Body, Cart, Fixed, Pendulum, Rod, Scene, load, matrices, natural_modes
from modal.statespace import state_space

G = Fraction(9.81)


def random_scene(seed: int, *, on_cart: bool, powers: tuple[int, ...] = (-3, 0, 3)) -> Scene:
    draw = Random(seed)

    def link() -> Bob | Rod | Body:
        mass, length = (round(draw.uniform(0.1, 3.0), 2) * 10.0 ** draw.choice(powers) for _ in range(2))
        kind = draw.choice(["bob", "bob", "bob", "rod", "body"])
        if kind == "body":
            return Body(mass=mass, length=length, centre=0.37 * length, inertia=0.013 * mass * length**2)
        return Bob(mass=mass, length=length) if kind == "bob" else Rod(mass=mass, length=length)

    pendula = [Pendulum(links=[link() for _ in range(draw.choice([1, 2, 4]))]) for _ in range(draw.choice([1, 2]))]
    return Scene(gravity=9.81, support=Cart(mass=1.7) if on_cart else Fixed(), pendulum=pendula)


def solve_rational(M: list[list[Fraction]], right: list[list[Fraction]]) -> list[list[Fraction]]:
    """M⁻¹ right by Gauss and Jordan."""
    rows = [[*left, *columns] for left, columns in zip(M, right, strict=True)]
    for i in range(len(M)):
        pivot = rows[i][i]
        rows[i] = [value / pivot for value in rows[i]]
        for k in range(len(M)):
            if k != i:
                factor = rows[k][i]
                rows[k] = [value - factor * other for value, other in zip(rows[k], rows[i], strict=True)]
    return [row[len(M) :] for row in rows]


def masses_and_arms(scene: Scene) -> tuple[list[Fraction], list[list[Fraction]], list[Fraction]]:
    """Masses, the displacement of each by (x, θ), and the moments of inertia about the centres."""
    links = [(p, link) for p, pendulum in enumerate(scene.pendulum) for link in pendulum.links]
    masses, arms, inertias = [], [], []
    for i, (p, link) in enumerate(links):
        mass, length = Fraction(link.mass), Fraction(link.length)
        centre, inertia = {"bob": (length, Fraction(0)), "rod": (length / 2, mass * length**2 / 12)}.get(
            link.kind, (Fraction(getattr(link, "centre", 0.0)), Fraction(getattr(link, "inertia", 0.0)))
        )
        above = [Fraction(other.length) if q == p else Fraction(0) for q, other in links[:i]]
        arms.append([Fraction(1), *above, centre, *[Fraction(0)] * (len(links) - i - 1)])
        masses.append(mass)
        inertias.append(inertia)
    return masses, arms, inertias


def exact(scene: Scene, *, on_cart: bool) -> tuple[list[list[Fraction]], list[list[Fraction]]]:
    """M⁻¹K and M⁻¹ by rationals, over x on a cart, and the angles."""
    masses, arms, inertias = masses_and_arms(scene)
    n = len(arms[0])
    M = [[sum(m * h[i] * h[j] for m, h in zip(masses, arms, strict=True)) for j in range(n)] for i in range(n)]
    K = [[G * M[0][j] * (i == j > 0) for j in range(n)] for i in range(n)]
    M[0][0] += Fraction(1.7)
    for i, inertia in enumerate(inertias, 1):
        M[i][i] += inertia
    first = 0 if on_cart else 1
    M, K = ([row[first:] for row in part[first:]] for part in (M, K))
    h = [[arm[i] for arm in arms] for i in range(first, n)]
    force = [[Fraction(int(i == 0)), *row] for i, row in enumerate(h)] if on_cart else h
    return solve_rational(M, K), solve_rational(M, force)


def assert_close(values: np.ndarray, expected: list[list[Fraction]]) -> None:
    rational = np.array(expected, dtype=float)
    assert np.array_equal(values == 0.0, rational == 0.0)
    assert np.all(np.abs(values - rational) <= 2e-14 * np.abs(rational))


@pytest.mark.parametrize("on_cart", [True, False])
@pytest.mark.parametrize("seed", range(12))
def test_accelerations_by_angles(seed: int, on_cart: bool) -> None:
    """Every digit at ratios of 1e6; nothing is summed that cancels."""
    scene = random_scene(seed, on_cart=on_cart)
    model = state_space(scene)
    n = len(model.A) // 2
    assert_close(-model.A[n:, :n], exact(scene, on_cart=on_cart)[0])


@pytest.mark.parametrize("on_cart", [True, False])
@pytest.mark.parametrize("seed", range(12))
def test_accelerations_by_forces(seed: int, on_cart: bool) -> None:
    """A force on the centre of a rod, which turns little on a joint that gives way, cancels with the joint's motion."""
    scene = random_scene(seed, on_cart=on_cart, powers=(0,))
    model = state_space(scene, (*["cart_force"] * on_cart, "link_forces"))
    assert_close(model.B[len(model.A) // 2 :], exact(scene, on_cart=on_cart)[1])


def test_a_held_cart_and_a_moved_support_pull_the_first_bob_alone() -> None:
    for drive in ("cart_acceleration", "support_acceleration"):
        model = state_space(load("crane-hook"), (drive,))
        row = {name.name: value for name, value in zip(model.states, model.B[:, 0].tolist(), strict=True)}
        assert row["theta_dot_1_2"] == 0.0


def test_the_second_bob_s_acceleration_is_that_of_its_wire() -> None:
    """By Newton's law for the lower bob: −g θ2 and no more; the pivot feels the upper wire alone."""
    model = state_space(load("crane-hook"), ("cart_force", "link_forces"), ("tip_accelerations", "pivot_forces"))
    assert np.array_equal(model.C != 0, [[0, 0, 1, 0, 0, 0], [0, 1, 0, 0, 0, 0]])
    assert model.C[0, 2] == pytest.approx(-9.81, rel=1e-14)
    assert np.array_equal(model.D != 0, [[0, 0, 1], [0, 0, 0]])


@pytest.mark.parametrize("mass", [1e-9, 1e-12, 1e9])
def test_poles_on_a_light_cart_keep_their_digits(mass: float) -> None:
    scene = Scene(
        gravity=9.81, support=Cart(mass=mass), pendulum=[Pendulum(links=[Bob(mass=1.0, length=1.0) for _ in range(2)])]
    )
    rates = natural_modes(scene).omega
    poles = np.sort(np.linalg.eigvals(state_space(scene).A).imag)[-2:]
    assert np.max(np.abs(poles / rates[1:] - 1)) <= 1e-14


@pytest.mark.parametrize("on_cart", [True, False])
def test_leaning_chains_are_solved_as_their_matrix(on_cart: bool) -> None:
    """By LAPACK, where a constant force turns the links and vertical inertia counts, too."""
    pull = {"kind": "constant", "on": "pendulum[0].links[1]", "amplitude": 4.0}
    links = [Bob(mass=1.0, length=0.7), Rod(mass=0.8, length=1.1), Bob(mass=0.3, length=0.5)]
    support = Cart(mass=2.0, stiffness=30.0) if on_cart else Fixed()
    scene = Scene(gravity=9.81, support=support, pendulum=[Pendulum(links=links)], force=[pull])
    model, system = state_space(scene), matrices(scene)
    n = len(model.A) // 2
    assert any(0.1 < abs(angle) < 1.5 for name, angle in model.operating_point if name.startswith("theta"))
    assert np.max(np.abs(model.A[n:, :n] + np.linalg.solve(system.M, system.K))) <= 1e-12
