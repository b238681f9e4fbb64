"""Natural frequencies at the extremes: hard gates on a quick part of `benchmarks/extremes/modes.py`."""

from __future__ import annotations

import json
from collections.abc import Callable

import mpmath as mp
import numpy as np
import pytest
from amounts import usually
from many_digits import Counter, eigenvalues, pencil, squares, unlike
from modes import case, judge_of
from modes_families import FAMILIES, Family, crowd, damped_cart, damped_joints, detuned, equal, geometric, near_buckling
from scenes import extreme_scene

from modal import Bob, Body, Cart, Fixed, Pendulum, Rod, Scene, matrices, natural_modes
from modal.modes import all_shapes
from modal.modes.tables import table

NAMED = {family.name: family for family in FAMILIES}
STRUCTURED = [f for f in FAMILIES if not f.splitting and f.name not in {"joint damper", "cart damper", "near buckling"}]
EVERY_DIGIT = 1e-15
LARGEST = 20


def ends(family: Family) -> list[float]:
    """The first, the middle and the last parameter that a quick test can afford."""
    small = [p for p in family.parameters if family.scene(p).n_links <= LARGEST]
    return sorted({small[0], small[len(small) // 2], small[-1]})


@pytest.mark.parametrize("family", STRUCTURED, ids=lambda f: f.name)
def test_the_structured_routes_keep_every_digit(family: Family) -> None:
    for parameter in ends(family):
        example = case(family, parameter)
        assert example.ours < EVERY_DIGIT, example
        assert example.ours <= example.bound, example


@pytest.mark.parametrize("name", ["joint damper", "cart damper", "near buckling"])
def test_what_is_claimed_is_within_its_bound(name: str) -> None:
    """Every row either carries a bound that holds or is marked; a refusal claims nothing."""
    for parameter in NAMED[name].parameters[:: 3 if "damper" in name else 2]:
        example = case(NAMED[name], parameter)
        assert np.isnan(example.ours) or example.ours <= example.bound or example.bound == 0, example


@pytest.mark.parametrize("name", ["detuning", "detuning, heavy cart"])
def test_splittings_are_right_to_what_the_bounds_leave(name: str) -> None:
    for parameter in NAMED[name].parameters[1:]:
        example = case(NAMED[name], parameter)
        assert example.ours <= example.bound, example


@pytest.mark.parametrize(("above", "uncertain"), [(1e-2, False), (1e-14, True)])
def test_shapes_of_marked_rows_say_so(above: float, uncertain: bool) -> None:
    """Alone, all at once and in the table; the other rows' do not."""
    modes = natural_modes(near_buckling(above))
    expected = [uncertain, False, False]
    assert [modes.shape(k).uncertain for k in range(3)] == expected
    assert [each[0].uncertain for each in all_shapes(modes)] == expected
    rows = json.loads(table(modes, list(modes), "json", shapes=True))["modes"]
    assert [row["shapes"][0]["uncertain"] for row in rows] == expected


@pytest.mark.parametrize(("detuning", "told"), [(0.0, False), (4.5e-16, True), (1e-15, True), (1e-13, False)])
def test_frequencies_that_are_taken_as_equal_are_told(detuning: float, told: bool) -> None:
    modes = natural_modes(detuned(detuning))
    assert any("taken as equal" in note for note in modes.notes) == told
    assert (len(modes) < len(squares(detuned(detuning))) + 1) == (detuning < 1e-14)


def test_where_float64_ends_the_row_is_marked() -> None:
    assert max(natural_modes(near_buckling(1e-14)).error) > 0.1


def test_the_rivals_lose_what_the_figure_shows() -> None:
    example = case(NAMED["mass ratio"], 1e12)
    assert example.eigh > 1e-6 > EVERY_DIGIT > example.ours
    assert case(NAMED["extreme pendula"], 10).eigh > 1e-2


@pytest.mark.parametrize("seed", range(12))
def test_two_oracles_agree(seed: int) -> None:
    """The pencil over angles and the count over joints, formulated apart, in many digits."""
    scene = extreme_scene(seed, copies=True)
    counter, exact = Counter(scene, 400), squares(scene)
    for number, square in enumerate(exact):
        with mp.workdps(400):
            near = [x for x in exact if abs(x / square - 1) < mp.mpf(10) ** -30]
            below, above = (counter.below(mp.sqrt(square), tilt) for tilt in (-1e-40, 1e-40))
        assert above - below == len(near)
        assert below <= number < above


def test_the_oracle_of_damped_scenes_solves_the_quadratic_problem() -> None:
    scene = damped_joints(3.0)
    with mp.workdps(100):
        model = pencil(scene)
        for value in eigenvalues(scene):
            singular = model.M * value**2 + model.D * value + model.K
            assert abs(mp.det(singular)) < mp.mpf(10) ** -60


def test_wrong_frequencies_are_judged_wrong() -> None:
    for scene in (geometric("mass", 1e16), damped_joints(1.0), equal(Rod, 30)):
        value = np.repeat(natural_modes(scene).eigenvalue, natural_modes(scene).multiplicity)
        assert judge_of(scene, splitting=False)(value * (1 + 1e-13)).max() == pytest.approx(1e-13, rel=0.5)


def rescaled(scene: Scene, mass: float, length: float, gravity: float) -> tuple[Scene, float]:
    """The same scene in other units, dampers and springs with it, and the factor on its rates."""
    rate = (gravity / length) ** 0.5
    force = mass * gravity
    cart = scene.support
    if isinstance(cart, Cart):
        spring = cart.stiffness * force / length
        cart = Cart(mass=cart.mass * mass, stiffness=spring, damping=cart.damping * mass * rate)

    def link(link: Bob | Rod | Body) -> Bob | Rod | Body:
        factors = {
            "mass": mass,
            "length": length,
            "centre": length,
            "inertia": mass * length**2,
            "damping": mass * length**2 * rate,
            "stiffness": force * length,
        }
        return link.model_copy(update={k: getattr(link, k) * f for k, f in factors.items() if k in link.fields})

    pendula = [p.model_copy(update={"links": tuple(map(link, p.links))}) for p in scene.pendulum]
    return Scene(gravity=scene.gravity * gravity, support=cart, pendulum=pendula), rate


def every_route() -> list[Scene]:
    damped = Pendulum(links=[Rod(mass=1.3, length=0.7, damping=0.2, stiffness=2.0), Bob(mass=0.4, length=1.9)], count=2)
    stands = Pendulum(links=[Bob(mass=0.7, length=0.6, stiffness=11.0)] * 2, equilibrium=("up", "up"))
    dense = [
        Scene(gravity=9.81, support=Cart(mass=2.2, damping=0.3, stiffness=1.7), pendulum=[damped]),
        Scene(gravity=9.81, support=Cart(mass=2.2), pendulum=[stands]),
    ]
    return [*(extreme_scene(seed, copies=True) for seed in range(8)), crowd(700, 0.1), *dense]


@pytest.mark.parametrize("scene", every_route())
def test_units_that_are_powers_of_two_change_no_bit(scene: Scene) -> None:
    for factors in ((2.0**10, 2.0**-10, 2.0**20), (2.0**-40, 2.0**30, 2.0**-10)):
        again, rate = rescaled(scene, *factors)
        np.testing.assert_array_equal(natural_modes(again).omega, natural_modes(scene).omega * rate)


@pytest.mark.parametrize("scene", every_route())
def test_other_units_change_no_more_than_rounding(scene: Scene) -> None:
    before = natural_modes(scene)
    omega, error = (np.repeat(part, before.multiplicity) for part in (before.omega, before.error))
    for factors in ((1e3, 1e3, 1e-3), (1e-3, 1e3, 1e-6), (1e3, 1e-3, 1.0)):
        after = natural_modes(rescaled(scene, *factors)[0])
        rate = (factors[2] / factors[1]) ** 0.5
        assert np.all(np.abs(np.repeat(after.omega, after.multiplicity) / rate - omega) <= (2 * error + 4e-16) * omega)


def test_a_massless_cart_under_many_equal_lengths() -> None:
    """Nothing has a frequency of its own but the antiphase modes: ω² = g/l, 699-fold."""
    bobs = [Pendulum(links=[Bob(mass=1.0 + k, length=1.0)]) for k in range(700)]
    modes = natural_modes(Scene(gravity=9.81, support=Cart(mass=0.0), pendulum=bobs))
    assert modes.multiplicity.tolist() == [1, 699]
    np.testing.assert_allclose(modes.omega, [0.0, 9.81**0.5], rtol=1e-15)


@pytest.mark.parametrize("mass", [1e-12, 1e-6])
def test_participations_of_a_light_cart_under_many_heavy_pendula(mass: float) -> None:
    scene = crowd(700, 8.0, mass)
    rows = list(natural_modes(scene))
    assert sum(row.cart_participation for row in rows) == pytest.approx(1, rel=1e-12)
    assert max(row.residual for row in rows) < 1e-12


def every_joint(damping: float) -> Scene:
    return Scene(gravity=9.81, pendulum=[Pendulum(links=[Rod(mass=1.0, length=1.0, damping=damping)] * 5)])


def inner_joint(damping: float) -> Scene:
    """A damper between bobs of different masses, where D hides what M and K say of both angles."""
    links = [Bob(mass=m, length=1.0, damping=d) for m, d in ((1.0, 0.0), (1.0, damping), (0.3, 0.0))]
    return Scene(gravity=9.81, support=Cart(mass=1.0, damping=0.1), pendulum=[Pendulum(links=links)])


def standing(damping: float) -> Scene:
    links = [Bob(mass=1.0, length=1.0, damping=damping, stiffness=5.0), Bob(mass=1.0, length=1.0)]
    return Scene(gravity=9.81, support=Cart(mass=1.0), pendulum=[Pendulum(links=links, equilibrium=("up", "down"))])


def held_cart(damping: float) -> Scene:
    cart = Cart(mass=1.0, damping=damping, stiffness=2.0)
    return Scene(gravity=9.81, support=cart, pendulum=[Pendulum(links=[Rod(mass=1.0, length=1.0)] * 3)])


def mixed(seed: int) -> Scene:
    """Dampers over 32 decades on one to three links, some standing, on a cart or not."""
    rng = np.random.default_rng(seed)
    links = [
        Rod(mass=10 ** rng.uniform(-1, 1), length=10 ** rng.uniform(-0.3, 0.3), damping=10 ** rng.uniform(-16, 16))
        for _ in range(rng.integers(1, 4))
    ]
    cart = Cart(mass=1.0, damping=float(rng.choice([0.0, 10 ** rng.uniform(-16, 16)])))
    ways = tuple(rng.choice(["up", "down"], len(links))) if seed % 3 == 0 else None
    return Scene(
        gravity=9.81, support=cart if seed % 2 else Fixed(), pendulum=[Pendulum(links=links, equilibrium=ways)]
    )


def assert_all_eigenvalues(scene: Scene, bound: float, error: float) -> None:
    """As many as there are, each unmarked, within its bound, with both bounded; and real parts of their own digits."""
    modes, exact = natural_modes(scene), eigenvalues(scene)
    value, claimed = (np.repeat(part, modes.multiplicity) for part in (modes.eigenvalue, modes.error))
    value, claimed = value[value != 0], claimed[value != 0]
    assert np.sum(1 + (value.imag != 0)) == sum(1 + (x.imag != 0) for x in exact)
    off = unlike(value, exact)
    assert np.all(off <= claimed)
    assert claimed.max() < bound
    assert off.max() < error


DAMPED = (damped_joints, damped_cart, every_joint, inner_joint, standing, held_cart)


DAMPINGS = [1e-16, 1e-12, 1e-10, 1e-4, 1.0, 1e4, 1e6, 1e8, 1e10, 1e12, 1e13, 1e16]


@pytest.mark.parametrize("family", DAMPED)
@pytest.mark.parametrize(
    "damping",
    usually(DAMPINGS[::2], DAMPINGS),
)
def test_dampers_of_any_size_cost_no_digits(family: Callable[[float], Scene], damping: float) -> None:
    assert_all_eigenvalues(family(damping), 1e-8, 1e-11)


@pytest.mark.parametrize("seed", range(30))
def test_dampers_of_all_sizes_in_one_scene(seed: int) -> None:
    assert_all_eigenvalues(mixed(seed), 1e-4, 1e-8)


def test_a_long_chain_of_stiff_dampers() -> None:
    """Σ 1/λ = −tr(K⁻¹D), to which the slow ones contribute nearly all, and Σ λ = −tr(M⁻¹D), the fast ones."""
    scene = Scene(gravity=9.81, pendulum=[Pendulum(links=[Rod(mass=1.0, length=1.0, damping=1e8)] * 50)])
    model, modes = matrices(scene), natural_modes(scene)
    assert np.all(modes.error < 1e-7)
    assert np.all(modes.eigenvalue.real < 0)
    assert len(modes) == 100
    for sum_of, matrix in ((modes.eigenvalue, model.M), (1 / modes.eigenvalue, model.K)):
        assert sum_of.sum() == pytest.approx(-np.trace(np.linalg.solve(matrix, model.D)), rel=1e-9)


@pytest.mark.parametrize("damping", [1e-16, 1e-12, 1e-8, 1e6, 1e8, 1e12])
def test_damping_ratios_keep_their_digits_where_they_are_far_below_rounding(damping: float) -> None:
    scene = damped_joints(damping)
    oscillating = [v for v in natural_modes(scene).eigenvalue if v.imag]
    exact = [v for v in eigenvalues(scene) if mp.im(v)]
    for ours, truth in zip(oscillating, exact, strict=True):
        assert ours.real == pytest.approx(float(truth.real), rel=1e-7, abs=0)
