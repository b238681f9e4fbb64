"""Derivatives of frequencies against finite differences, symbols and the identities that units impose."""

from __future__ import annotations

from functools import cache
from typing import Any, Literal

import mpmath as mp
import numpy as np
import pytest
import sympy as sp
from amounts import usually
from response_oracle import Oracle

from modal import Bob, Body, Cart, ComputationError, Fixed, Pendulum, Rod, Scene, natural_modes
from modal.modes import Modes
from modal.modes.sensitivity import (
    Sensitivities,
    _centres,
    _chains_with_angles,
    centre_displacements,
    of_mode,
    sensitivities,
)
from modal.symbolic import symbolic

STEP = 2e-5
OF_A_LINK = ("mass", "length", "centre", "inertia", "stiffness")


def mixed(seed: int, stiffness: float = 0.0, *, standing: bool = False) -> Scene:
    """Bobs, rods and bodies, runs and copies, on a cart (with a spring every second time) or a fixed support."""
    rng = np.random.default_rng(seed)

    def link() -> Bob | Rod | Body:
        m, l, c, I = rng.uniform(0.3, 2, 4)
        size = {"mass": m, "length": l, "stiffness": stiffness, "count": int(rng.integers(1, 3))}
        kind = rng.choice(["bob", "rod", "body"])
        return Body(**size, centre=c * l, inertia=I) if kind == "body" else (Bob if kind == "bob" else Rod)(**size)

    pendula = [
        Pendulum(links=[link() for _ in range(rng.integers(1, 3))], count=int(rng.integers(1, 3)))
        for _ in range(rng.integers(1, 4))
    ]
    if standing:
        ways = ("up", "down") * 4
        pendula = [p.model_copy(update={"equilibrium": ways[k : k + p.n_links]}) for k, p in enumerate(pendula)]
    cart = Cart(mass=rng.uniform(0.5, 5), stiffness=float(rng.choice([0.0, 20.0])))
    return Scene(gravity=9.81, support=cart if seed % 4 else Fixed(), pendulum=pendula)


def simple(modes: Modes, gap: float = 0.02) -> list[int]:
    """Indices of modes that move, shared by no other and some way from their neighbours."""
    omega = modes.omega
    return [
        k
        for k in range(len(modes))
        if modes.eigenvalue[k].imag > 0
        and modes.multiplicity[k] == 1
        and all(abs(other / omega[k] - 1) > gap for other in np.delete(omega, k))
    ]


def counted_out(scene: Scene) -> Scene:
    """Every copy and every link of a run written apart."""
    pendula = tuple(
        Pendulum(
            links=tuple(link.model_copy(update={"count": 1}) for link in p.links for _ in range(link.count)),
            equilibrium=p.equilibrium,
        )
        for p in scene.pendulum
        for _ in range(p.count)
    )
    return scene.model_copy(update={"pendulum": pendula})


def with_link(scene: Scene, index: int, **update: float) -> Scene:
    """A scene that is counted out, with other numbers in one of its links."""
    pendula = list(scene.pendulum)
    for place, pendulum in enumerate(pendula):
        if index < len(pendulum.links):
            links = list(pendulum.links)
            links[index] = links[index].model_copy(update=update)
            pendula[place] = pendulum.model_copy(update={"links": tuple(links)})
            return scene.model_copy(update={"pendulum": tuple(pendula)})
        index -= len(pendulum.links)
    raise IndexError(index)


def difference(at: Any, value: float, rank: int) -> float:
    """Central difference of the rank-th frequency, copies counted, of the scenes at(value ± h)."""
    h = STEP * value
    high, low = (frequencies(at(value + sign * h))[rank] for sign in (1, -1))
    return float(high - low) / (2 * h)


@cache
def frequencies(scene: Scene) -> np.ndarray:
    """All of them, copies counted; kept, as each mode is compared in the same neighbouring scenes."""
    modes = natural_modes(scene)
    return np.repeat(modes.omega, modes.multiplicity)


def assert_close(value: float, expected: float, scale: float) -> None:
    assert value == pytest.approx(expected, rel=1e-6, abs=1e-6 * scale)


@pytest.mark.parametrize(("stiffness", "standing"), [(0.0, False), (1.5, False), (0.0, True)])
@pytest.mark.parametrize("seed", usually([6], range(8)))
def test_links_agree_with_central_differences(seed: int, stiffness: float, standing: bool) -> None:
    scene = mixed(seed, stiffness, standing=standing)
    modes, apart = natural_modes(scene), counted_out(scene)
    links = [link for p in apart.pendulum for link in p.links]
    some = np.random.default_rng(seed).permutation(len(links))[:3]
    for number in simple(modes)[:4]:
        derivatives, rank = sensitivities(modes, number), int(modes.multiplicity[:number].sum())
        for index in some:
            link = links[index]
            names = [
                n for n in OF_A_LINK if getattr(link, n) and (n not in {"centre", "inertia"} or link.kind == "body")
            ]
            for name in names:
                value = getattr(link, name)
                expected = difference(lambda v, i=index, n=name: with_link(apart, i, **{n: v}), value, rank)
                assert_close(getattr(derivatives, name)[index], expected, modes.omega[number] / value)


@pytest.mark.parametrize("seed", usually(range(0, 12, 2), range(12)))
def test_cart_and_gravity_agree_with_central_differences(seed: int) -> None:
    scene = mixed(seed, stiffness=1.5 * (seed % 3 == 0))
    modes = natural_modes(scene)
    for number in simple(modes):
        derivatives, rank = sensitivities(modes, number), int(modes.multiplicity[:number].sum())
        expected = difference(lambda v: scene.model_copy(update={"gravity": v}), scene.gravity, rank)
        assert_close(derivatives.gravity, expected, modes.omega[number] / scene.gravity)
        if isinstance(scene.support, Fixed):
            assert (derivatives.cart_mass, derivatives.cart_stiffness) == (0.0, 0.0)
            continue
        for name in ("mass", "stiffness"):
            if value := getattr(scene.support, name):

                def at(v: float, name: str = name) -> Scene:
                    return scene.model_copy(update={"support": scene.support.model_copy(update={name: v})})

                expected = difference(at, value, rank)
                assert_close(getattr(derivatives, f"cart_{name}"), expected, modes.omega[number] / value)


def test_the_comparison_bites() -> None:
    with pytest.raises(AssertionError):
        assert_close(1.0, 1 + 1e-5, 1.0)


@pytest.mark.parametrize("cart", [False, True])
@pytest.mark.parametrize("kind", ["bob", "rod"])
@pytest.mark.parametrize("n", usually([2], [2, 3]))
def test_symbols_give_the_same(n: int, kind: Literal["bob", "rod"], cart: bool) -> None:
    """∂ω/∂p = −P_p/(2ω P_x) of the characteristic polynomial P(x = ω²; p)."""
    P, x = symbolic(n, kind, cart=cart), sp.Symbol("x")
    masses, lengths = [1.5, 0.25, 3.0][:n], [0.75, 2.0, 1.25][:n]
    values = {"g": 9.8125, "m_c": 2.5}
    values |= {f"{p}_{i}": v for p, row in (("m", masses), ("l", lengths)) for i, v in enumerate(row, 1)}
    link = {"bob": Bob, "rod": Rod}[kind]
    links = [link(mass=m, length=l) for m, l in zip(masses, lengths, strict=True)]
    modes = natural_modes(
        Scene(
            gravity=values["g"], support=Cart(mass=values["m_c"]) if cart else Fixed(), pendulum=[Pendulum(links=links)]
        )
    )
    exact = {symbol: sp.Rational(values[symbol.name]) for symbol in P.free_symbols - {x}}
    for number, root in enumerate(sorted(sp.Poly(P.subs(exact), x).nroots(n=40)), start=int(cart)):
        derivatives = sensitivities(modes, number)
        mine = {"g": derivatives.gravity, "m_c": derivatives.cart_mass}
        mine |= {
            f"{p}_{i}": v
            for p, row in (("m", derivatives.mass), ("l", derivatives.length))
            for i, v in enumerate(row, 1)
        }
        for symbol, value in exact.items():
            slope = -P.diff(symbol) / (2 * sp.sqrt(x) * P.diff(x))
            expected = float(slope.subs(exact).subs(x, root))
            assert mine[symbol.name] == pytest.approx(
                expected, rel=1e-11, abs=1e-12 * modes.omega[number] / float(value)
            )


@pytest.mark.parametrize("stiffness", [0.0, 1.5])
@pytest.mark.parametrize("seed", range(24))
def test_units_impose_three_identities(seed: int, stiffness: float) -> None:
    """Euler: ω has no kilogram, no metre and one reciprocal second."""
    scene = mixed(seed, stiffness)
    modes = natural_modes(scene)
    for number in simple(modes, gap=1e-9):
        omega, derivatives = modes.omega[number], sensitivities(modes, number)
        terms = euler_terms(scene, derivatives)
        size = max(np.abs(values).max() for values in terms.values())
        kilogram = sum(terms[name].sum() for name in ("m", "m_c", "I", "k", "k_c"))
        metre = sum(power * terms[name].sum() for name, power in {"l": 1, "c": 1, "I": 2, "k": 2, "g": 1}.items())
        second = sum(-2 * terms[name].sum() for name in ("k", "k_c", "g"))
        assert (kilogram, metre, second) == pytest.approx((0, 0, -omega), abs=1e-12 * size)


def euler_terms(scene: Scene, derivatives: Sensitivities) -> dict[str, np.ndarray]:
    """p ∂ω/∂p of everything; a rod's inertia and centre and a bob's centre follow their mass and length already."""
    links = [link for p in scene.pendulum for _ in range(p.count) for link in p.links for _ in range(link.count)]
    bodies = np.array([link.kind == "body" for link in links])
    numbers = {name: np.array([getattr(link, name) for link in links]) for name in OF_A_LINK}
    cart = scene.support if isinstance(scene.support, Cart) else Cart(mass=0.0)
    return {
        "m": numbers["mass"] * derivatives.mass,
        "l": numbers["length"] * derivatives.length,
        "c": numbers["centre"] * derivatives.centre * bodies,
        "I": numbers["inertia"] * derivatives.inertia * bodies,
        "k": numbers["stiffness"] * derivatives.stiffness,
        "m_c": np.array([cart.mass * derivatives.cart_mass]),
        "k_c": np.array([cart.stiffness * derivatives.cart_stiffness]),
        "g": np.array([scene.gravity * derivatives.gravity]),
    }


@pytest.mark.parametrize("support", [Fixed(), Cart(mass=2.0)])
def test_bobs_and_rods_scale_with_length(support: Fixed | Cart) -> None:
    """Σ l ∂ω/∂l = −ω/2, and all masses together change nothing."""
    links = (Bob(mass=1.0, length=0.7), Rod(mass=0.3, length=1.9, count=2), Bob(mass=4.0, length=0.2))
    scene = Scene(gravity=9.81, support=support, pendulum=[Pendulum(links=links), Pendulum(links=links[1:3])])
    every = [link for p in scene.pendulum for link in p.links for _ in range(link.count)]
    modes = natural_modes(scene)
    for number in simple(modes, gap=1e-9):
        derivatives = sensitivities(modes, number)
        by_length = sum(link.length * slope for link, slope in zip(every, derivatives.length, strict=True))
        by_mass = sum(link.mass * slope for link, slope in zip(every, derivatives.mass, strict=True))
        assert by_length == pytest.approx(-modes.omega[number] / 2, rel=1e-12)
        assert by_mass + 2.0 * derivatives.cart_mass == pytest.approx(0, abs=1e-12 * modes.omega[number])


def test_a_simple_pendulum() -> None:
    derivatives = sensitivities(
        natural_modes(Scene(gravity=9.81, pendulum=[Pendulum(links=[Bob(mass=2.0, length=3.0)])])), 0
    )
    omega = np.sqrt(9.81 / 3)
    assert derivatives.mass[0] == pytest.approx(0, abs=1e-16)
    assert derivatives.length[0] == pytest.approx(-omega / 6, rel=1e-14)
    assert derivatives.gravity == pytest.approx(omega / 2 / 9.81, rel=1e-14)
    assert derivatives.inertia[0] == pytest.approx(-omega / (2 * 2 * 9), rel=1e-14)


def test_antiphase_of_two_answers_each_pendulum_by_half_its_own_derivative() -> None:
    links = (Rod(mass=1.0, length=1.0), Bob(mass=2.0, length=0.5))
    alone = natural_modes(Scene(gravity=9.81, pendulum=[Pendulum(links=links)]))
    pair = natural_modes(Scene(gravity=9.81, support=Cart(mass=3.0), pendulum=[Pendulum(links=links, count=2)]))
    for number in range(2):
        still = int(np.flatnonzero(pair.omega == alone.omega[number])[0])
        derivatives, two = sensitivities(alone, number), sensitivities(pair, still)
        np.testing.assert_allclose(two.length, np.tile(derivatives.length / 2, 2), rtol=1e-11)
        assert two.cart_mass == 0.0


def test_across_the_rail_the_cart_does_not_matter() -> None:
    scene = Scene(
        gravity=9.81, space="space", support=Cart(mass=3.0), pendulum=[Pendulum(links=[Bob(mass=1.0, length=1.0)])]
    )
    modes = natural_modes(scene)
    across, along = sensitivities(modes, 1), sensitivities(modes, 2)
    assert across.cart_mass == 0.0
    assert along.cart_mass == pytest.approx(-modes.omega[2] / 2 * (1 / 9) / (4 / 3), rel=1e-13)


def test_the_translation_of_a_free_cart_answers_nothing() -> None:
    modes = natural_modes(mixed(5).model_copy(update={"support": Cart(mass=1.0)}))
    derivatives = sensitivities(modes, 0)
    assert modes.omega[0] == 0
    assert derivatives.mass.shape == (modes.scene.n_links,)
    assert all(not np.any(getattr(derivatives, name)) for name in Sensitivities.__dataclass_fields__)


def test_a_damper_that_an_antiphase_mode_does_not_feel() -> None:
    dragged = Cart(mass=3.0, damping=2.0)
    modes = natural_modes(
        Scene(gravity=9.81, support=dragged, pendulum=[Pendulum(links=[Bob(mass=1.0, length=1.0)], count=2)])
    )
    still = next(row.number - 1 for row in modes if row.family.startswith("cart still"))
    moving = next(row.number - 1 for row in modes if row.damping_ratio > 0 and row.omega > 0)
    np.testing.assert_allclose(sensitivities(modes, still).length, -modes.omega[still] / 4, rtol=1e-13)
    assert sensitivities(modes, moving).cart_damping != 0 == sensitivities(modes, still).cart_damping


GANTRY = {"cart": 8400.0, "rail": 400.0, "m": 650.0, "l": 12.5, "d": 3e4, "M": 21e3, "c": 4.5, "I": 76e3, "e": 900.0}


def damped_crane(**update: float) -> Scene:
    """A trolley, a hook block and a container, with every kind of damper; `update` sets numbers by their names."""
    n = GANTRY | update
    hook = Bob(mass=n["m"], length=n["l"], damping=n["d"])
    load = Body(mass=n["M"], length=5.8, centre=n["c"], inertia=n["I"], drag=n["e"])
    trolley = Cart(mass=n["cart"], damping=n["rail"])
    return Scene(gravity=9.81, support=trolley, pendulum=[Pendulum(links=[hook, load])])


def test_damped_modes_agree_with_central_differences() -> None:
    names = {"cart": "cart_mass", "rail": "cart_damping", "m": "mass", "l": "length", "d": "damping", "M": "mass"}
    names |= {"c": "centre", "I": "inertia", "e": "drag"}
    modes = natural_modes(damped_crane())
    assert [mode.damping_ratio > 0 for mode in modes] == [False, True, True, True]
    derivatives = [sensitivities(modes, number) for number in range(1, 4)]
    for key, value in GANTRY.items():
        high, low = (natural_modes(damped_crane(**{key: value * (1 + h)})).omega[1:] for h in (STEP, -STEP))
        parts = [np.atleast_1d(getattr(entry, names[key])) for entry in derivatives]
        derivative = [part[int(key in "McIe" and len(part) > 1)] * value for part in parts]
        np.testing.assert_allclose(derivative, (high - low) / (2 * STEP), rtol=1e-6, atol=1e-8 * modes.omega[3])


def test_a_damping_ratio_and_growth_have_no_derivative() -> None:
    bob = Pendulum(links=[Bob(mass=1.0, length=1.0)])
    with pytest.raises(ComputationError, match="damping_ratio of the scene"):
        sensitivities(natural_modes(Scene(gravity=9.81, damping_ratio=0.1, pendulum=[bob])), 0)
    with pytest.raises(ComputationError, match="grows"):
        sensitivities(natural_modes(Scene(gravity=9.81, pendulum=[bob.replace(equilibrium=["up"])])), 0)


def test_a_repeated_frequency_has_no_one_derivative() -> None:
    modes = natural_modes(
        Scene(gravity=9.81, support=Cart(mass=3.0), pendulum=[Pendulum(links=[Bob(mass=1.0, length=1.0)], count=3)])
    )
    with pytest.raises(ComputationError, match=r"shared by 2 modes: a repeated frequency splits"):
        sensitivities(modes, 1)
    with pytest.raises(IndexError):
        sensitivities(modes, 3)


def test_what_double_precision_does_not_give_has_no_derivative(monkeypatch: pytest.MonkeyPatch) -> None:
    modes = natural_modes(Scene(gravity=9.81, pendulum=[Pendulum(links=[Bob(mass=1.0, length=1.0)])]))
    monkeypatch.setattr(Modes, "error", np.array([1.0]))
    with pytest.raises(ComputationError, match="beyond double precision"):
        sensitivities(modes, 0)


def heavy_and_light() -> Scene:
    """Masses from 1e-4 to 1e4 kg: in the fastest modes heavy centres hardly move."""
    chain = (
        Body(mass=0.000148, length=0.379, centre=0.2421, inertia=4.219e-07, stiffness=4.094),
        Bob(mass=5060.0, length=31.3, stiffness=1.153),
        Rod(mass=0.0803, length=41.8),
    )
    other = (
        Body(mass=8740.0, length=32.6, centre=9.672, inertia=1888000.0, stiffness=0.3307),
        Bob(mass=80.6, length=36.7, stiffness=58.48),
        Bob(mass=0.0169, length=0.0439),
    )
    return Scene(gravity=3.7, support=Cart(mass=101.9), pendulum=(Pendulum(links=chain), Pendulum(links=other)))


def test_a_centre_that_hardly_moves_keeps_its_digits() -> None:
    """∂ω/∂l = φᵀ(∂K/∂l − ω² ∂M/∂l)φ/2ω in 80 digits, M being quadratic in l, so that differences are derivatives."""
    scene, h = heavy_and_light(), 0.125
    modes = natural_modes(scene)
    oracle = Oracle(scene, 80)
    sides = [Oracle(with_link(scene, 0, length=0.379 + step), 80) for step in (h, -h)]
    with mp.workdps(80):
        inverse = mp.cholesky(oracle.M) ** -1
        square, V = mp.eigsy(inverse * oracle.K * inverse.T)
        for number in range(1, len(modes)):
            phi, x = inverse.T * V[:, number], square[number]
            change = [(getattr(sides[0], part) - getattr(sides[1], part)) / (2 * h) for part in "KM"]
            true = (phi.T * (change[0] - x * change[1]) * phi)[0] * mp.mpf(0.379) / (2 * x)
            sensitivity = of_mode(modes, modes[number])["pendulum[0].links[0].length"]
            assert sensitivity.relative == pytest.approx(float(true), rel=1e-12, abs=1e-13)


def test_centres_in_digits_are_the_running_sums_of_ordinary_scenes() -> None:
    links = (Rod(mass=1.0, length=0.7, damping=0.1), Bob(mass=0.4, length=1.1, stiffness=0.5))
    two, single = Pendulum(links=links, count=2), Pendulum(links=(Bob(mass=2.0, length=0.9),))
    on_cart = Scene(gravity=9.81, support=Cart(mass=3.0, damping=0.2), pendulum=(two, single))
    for scene in (
        on_cart,
        on_cart.conservative,
        on_cart.replace(support=Fixed(), pendulum=(single, Pendulum(links=links))),
    ):
        modes, tried = natural_modes(scene), 0
        for number, value in enumerate(modes.eigenvalue.tolist()):
            if modes.multiplicity[number] > 1 or not value.imag:
                continue
            shape = modes.shape(number, 0, "mass")
            displacements = centre_displacements(modes.rig, value, shape)
            for z, hung in zip(displacements, _chains_with_angles(modes, shape), strict=True):
                assert np.abs(z - _centres(*hung, shape.cart)).max() < 1e-10 * np.abs(hung[1]).max() + 1e-12
            tried += 1
        assert tried >= 3


def test_a_massless_cart_has_a_sensitivity_to_its_mass() -> None:
    scene = Scene(gravity=9.81, support=Cart(mass=0.0), pendulum=[Pendulum(links=[Rod(mass=1.0, length=1.0)])])
    modes = natural_modes(scene)
    sensitivity = of_mode(modes, modes[len(modes) - 1])["support.mass"]
    heavier = natural_modes(scene.replace(support=Cart(mass=1e-6)))
    assert sensitivity.derivative == pytest.approx((heavier.omega[-1] - modes.omega[-1]) / 1e-6, rel=1e-4)
    assert (sensitivity.number, sensitivity.relative) == (0.0, 0.0)
