"""How the cart couples: every number against dense matrices, other scenes or closed forms; the page and the picture."""

from __future__ import annotations

import io
import json
import re
from dataclasses import replace
from typing import Any

import mpmath as mp
import numpy as np
import pytest
import scipy.linalg
from amounts import usually
from compare import flat_omega
from matplotlib.figure import Figure
from oracle import Dense, dense
from scenes import extreme_scene

from modal import Bob, Cart, ComputationError, Fixed, Pendulum, Rod, Scene, SceneError, load, matrices, natural_modes
from modal.coupling import Coupling, coupling_report, explain
from modal.coupling.report import sections
from modal.plotting import coupling_figure, save
from modal.plotting.coupling import draw_mass
from modal.report import fitted
from modal.scene import Spring, VanDerPol


def bob(m: float, l: float, count: int = 1, **link: Any) -> Pendulum:
    return Pendulum(links=[Bob(mass=m, length=l, **link)], count=count)


def scene(cart: Cart | Fixed, *pendula: Pendulum, **fields: str) -> Scene:
    return Scene(gravity=9.81, support=cart, pendulum=pendula, **fields)


def double(count: int = 1, **link: float) -> Pendulum:
    return Pendulum(links=[Rod(mass=1.0, length=1.0, **link), Bob(mass=0.7, length=0.5, **link)], count=count)


HELD = scene(Cart(mass=5.0, stiffness=60.0), bob(1, 1, 2), bob(1, 0.8))
SPRUNG = scene(Cart(mass=5.0), double(2, stiffness=1.5), bob(1, 0.8), double())
COINCIDENT = scene(Cart(mass=20.0), bob(1, 1), bob(3, 1), bob(2, 1, 2), bob(1, 0.5))
CARTS = {f"random {seed}": extreme_scene(seed, copies=True) for seed in range(60)}
CARTS = {name: example for name, example in CARTS.items() if example.support.kind == "cart"}
MILD = {"held": HELD, "sprung": SPRUNG, "coincident": COINCIDENT, "paper": load("paper-cart-3")}


def felt(exact: Dense, omega: float) -> mp.mpf:
    """The dynamic mass as a Schur complement of K − ω²M over −ω²."""
    x, n = mp.mpf(omega) ** 2, exact.size
    S = mp.matrix(n, n)
    for i in range(n):
        for j in range(n):
            S[i, j] = exact.K[i][j] - x * exact.M[i][j]
    inner, edge = S[1:, 1:], S[1:, 0]
    return -(S[0, 0] - (edge.T * mp.lu_solve(inner, edge))[0]) / x


# ----------------------------------------------------------------------------------------------- dynamic mass


@pytest.mark.parametrize("name", [*list(CARTS)[:14], *MILD])
def test_the_dynamic_mass_is_a_schur_complement(name: str) -> None:
    example = {**CARTS, **MILD}[name]
    dynamic, exact = explain(example).dynamic, dense(example)
    mp.mp.prec = 300
    poles = dynamic.omega[:4]
    for omega in (*np.sqrt(poles[1:] * poles[:-1]), poles[0] / 3, poles[-1] * 2.1, *poles * (1 + 1e-7)):
        terms = np.abs(dynamic.mass * dynamic.omega**2 / (dynamic.omega**2 - omega**2)).sum()
        size = dynamic.at_infinity + dynamic.spring / omega**2 + terms
        near = np.abs(dynamic.omega / omega - 1).min()
        assert abs(dynamic([omega])[0] - float(felt(exact, omega))) <= 2e-14 * size * max(1.0, 0.1 / near)


def test_next_to_a_pole_no_digit_is_lost() -> None:
    """m + m_c: one bob of 1 kg at one rounding from its own frequency, by the formula in many digits."""
    dynamic = explain(scene(Cart(mass=1.0), bob(1, 1))).dynamic
    pole = float(dynamic.omega[0])
    beside = np.nextafter(pole, 10.0)
    with mp.workprec(200):
        exact = 1 + mp.mpf(pole) ** 2 / (mp.mpf(pole) ** 2 - mp.mpf(beside) ** 2)
    assert dynamic([beside])[0] == pytest.approx(float(exact), rel=1e-14)
    assert pole**2 / (pole**2 - beside**2) != pytest.approx(float(exact), rel=1e-3)
    assert np.isinf(dynamic([pole])[0])


@pytest.mark.parametrize("name", [*CARTS, *usually([*MILD][::3], [*MILD]), "thousand"])
def test_zeros_and_still_modes_are_the_modes(name: str) -> None:
    """The secular equation against bisection of the count (and dense matrices where joints have springs)."""
    example = {**CARTS, **MILD, "thousand": load("thousand-pendula")}[name]
    explanation = explain(example)
    still = np.repeat([f.omega for f in explanation.families], [f.fold - 1 for f in explanation.families])
    moving = np.array([mode.omega for mode in explanation.cart_modes])
    expected = np.sort(flat_omega(natural_modes(example)))
    assert np.sort(np.concatenate([still, moving])) == pytest.approx(expected, rel=1e-12)
    assert explanation.residual() < 1e-12


def test_participation_is_that_of_the_table() -> None:
    for example in (HELD, SPRUNG, COINCIDENT, scene(Cart(mass=0.0), bob(1, 1), bob(2, 0.7), bob(1, 0.4))):
        modes = natural_modes(example)
        shares = [mode.cart_participation for mode in modes if mode.omega and mode.cart_participation > 1e-12]
        assert [mode.participation for mode in explain(example).cart_modes] == pytest.approx(shares, rel=1e-9)


def test_the_sum_rule_bites() -> None:
    explanation = explain(load("paper-cart-2"))
    wrong = replace(explanation, secular=replace(explanation.dynamic, mass=explanation.dynamic.mass * (1 + 1e-6)))
    assert explanation.residual() < 1e-15
    assert wrong.residual() > 1e-7


# -------------------------------------------------------------------------------------- families, beats, limits


def test_the_papers_cart() -> None:
    explanation = explain(load("paper-cart-2"))
    assert [f.omega for f in explanation.families] == pytest.approx([2.68011401, 7.18867087], abs=5e-9)
    assert [mode.omega for mode in explanation.cart_modes] == pytest.approx([2.71754912, 7.20947810], abs=5e-9)
    assert [f.beat for f in explanation.families] == pytest.approx([167.8, 302.0], abs=0.05)
    omega = natural_modes(explanation.scene).omega
    assert [f.splitting for f in explanation.families] == pytest.approx(
        [omega[2] - omega[1], omega[4] - omega[3]], rel=1e-12
    )


@pytest.mark.parametrize("mass", [1e-6, 0.3, 40.0, 1e12, 1e30])
def test_equal_simple_pendula_in_closed_form(mass: float) -> None:
    """ε = N m/m_c and ω_zero = ω √(1 + ε): the splitting keeps its digits however heavy the cart."""
    family = explain(scene(Cart(mass=mass), bob(2, 1, 3))).families[0]
    assert family.strength == pytest.approx(6 / mass, rel=1e-14)
    with mp.workprec(300):
        omega = mp.sqrt(mp.mpf(9.81))
        exact = omega * (mp.sqrt(1 + mp.mpf(6) / mp.mpf(mass)) - 1)
    assert family.splitting == pytest.approx(float(exact), rel=1e-13)
    if mass > 1e6:
        assert family.splitting == pytest.approx(family.strength * family.omega / 2, rel=1e-11)


@pytest.mark.parametrize("example", [HELD, SPRUNG, COINCIDENT, load("paper-cart-3"), load("crane-hook")])
def test_limits_are_other_scenes(example: Scene) -> None:
    explanation = explain(example)
    spring = example.support.stiffness
    light, heavy = (
        np.array([mode.omega for mode in explain(example.model_copy(update={"support": support})).cart_modes])
        for support in (Cart(mass=0.0, stiffness=spring), Cart(mass=1e15, stiffness=spring))
    )
    lights = np.array([mode.light for mode in explanation.cart_modes])
    assert lights[np.isfinite(lights)] == pytest.approx(light, rel=1e-13)
    massless = natural_modes(example.model_copy(update={"support": Cart(mass=0.0, stiffness=spring)}))
    assert set(np.round(light, 8)) <= set(np.round(massless.omega, 8))
    assert [mode.heavy for mode in explanation.cart_modes] == pytest.approx(heavy, rel=1e-12, abs=1e-6)
    fixed = flat_omega(natural_modes(example.model_copy(update={"support": Fixed()})))
    assert np.repeat([f.omega for f in explanation.families], [f.fold for f in explanation.families]) == pytest.approx(
        fixed, rel=1e-12
    )
    assert explanation.omega_of_carts(np.array([example.support.mass]))[0] == pytest.approx(
        [m.omega for m in explanation.cart_modes], rel=1e-15
    )


def test_first_order_is_the_slope_of_the_splitting() -> None:
    """Δω/(½εω) − 1 falls like ε, whatever else hangs on a heavy cart."""
    for mass, bound in ((1e3, 3e-3), (1e5, 3e-5), (1e7, 3e-7)):
        for family in explain(scene(Cart(mass=mass), double(3), bob(1, 0.3))).families:
            assert abs(family.splitting / (family.strength * family.omega / 2) - 1) < bound


def swing(example: Scene, start: int, times: np.ndarray) -> np.ndarray:
    """θ̇² + ω²θ² of every simple pendulum, over that of pendulum `start`, released alone: (times, pendula)."""
    written = matrices(example)
    squares, shapes = scipy.linalg.eigh(written.K, written.M)
    omega = np.sqrt(np.abs(squares))
    first = np.zeros(len(squares))
    first[1 + start] = 1.0
    weight = shapes.T @ written.M @ first
    theta = (np.cos(np.outer(times, omega)) * weight) @ shapes.T
    rate = (-omega * np.sin(np.outer(times, omega)) * weight) @ shapes.T
    alone = np.diag(written.K)[1:] / np.diag(written.M)[1:]
    inertia = np.diag(written.M)[1:]
    energy = (rate[:, 1:] ** 2 + alone * theta[:, 1:] ** 2) * inertia
    return energy / (alone * inertia)[start]


def test_a_family_has_the_mode_that_the_sign_of_its_strength_tells() -> None:
    """ε = +0.20: the mode 0.25 rad/s above, as first order says, 0.316, and not the one 1.4 rad/s below."""
    example = scene(Cart(mass=3.0, stiffness=20.0), bob(1, 1), bob(2, 0.5))
    omega = np.sqrt(scipy.linalg.eigh(matrices(example).K, matrices(example).M, eigvals_only=True))
    m_rest = 3.0 - 20.0 / 9.81 + 2.0 * 2 * 9.81 / (2 * 9.81 - 9.81)  # the cart, its spring, the other bob at ω² = g
    first_order = np.sqrt(9.81) / m_rest / 2
    assert first_order == pytest.approx(0.316, abs=5e-4)
    assert omega - np.sqrt(9.81) == pytest.approx([-1.415, 0.249, 3.038], abs=5e-4)
    held = example.replace(support=Cart(mass=3.0), spring=[Spring(between=("cart", "ground"), stiffness=20.0)])
    for explanation in map(explain, (example, held)):
        slow, fast = explanation.families
        assert slow.strength * slow.omega / 2 == pytest.approx(first_order, rel=1e-13)
        assert slow.splitting == pytest.approx(omega[1] - np.sqrt(9.81), rel=1e-13)
        assert fast.branches[0].omega == pytest.approx(omega[2], rel=1e-13)
        assert [mode for mode, _ in explanation.structure_modes] == pytest.approx([omega[0]], rel=1e-13)


@pytest.mark.parametrize("example", [HELD, load("crane-two-loads"), load("paper-cart-3"), CARTS["random 8"]])
def test_modes_belong_to_what_has_most_of_their_potential_energy(example: Scene) -> None:
    """Shares of families and of the cart's spring from dense matrices: the largest first, none twice."""
    explanation, written = explain(example), matrices(example)
    squares, shapes = scipy.linalg.eigh(written.K, written.M)
    moving = [int(np.abs(np.sqrt(np.abs(squares)) - mode.omega).argmin()) for mode in explanation.cart_modes]
    held = example.support.stiffness > 0
    shares = [written.K[0, 0] * shapes[0, moving] ** 2 / squares[moving]] * held
    K, within = written.K[1:, 1:], shapes[1:, moving]
    alone, patterns = scipy.linalg.eigh(K, written.M[1:, 1:])
    for family in explanation.families:
        inside = patterns[:, np.abs(np.sqrt(alone) / family.omega - 1) < 1e-9]
        shares.append(((inside.T @ K @ within) ** 2).sum(0) / family.omega**2 / squares[moving])
    left = np.array(shares)
    for _ in moving:
        owner, mode = np.unravel_index(int(left.argmax()), left.shape)
        told = explanation.cart_modes[mode].family
        assert (told is None and owner == 0) if held and owner == 0 else told == owner - held
        left[owner], left[:, mode] = -1.0, -1.0


@pytest.mark.parametrize("n", [2, 3, 5])
def test_energy_is_back_after_a_beat(n: int) -> None:
    example = scene(Cart(mass=2000.0), bob(1, 1, n))
    beat = explain(example).families[0].beat
    assert beat is not None
    after, half = (swing(example, 0, np.linspace(0.999, 1.001, 201) * at)[:, 0] for at in (beat, beat / 2))
    assert after.max() == pytest.approx(1.0, abs=0.01)
    assert np.median(half) == pytest.approx((1 - 2 / n) ** 2, abs=0.01)


@pytest.mark.parametrize(("m", "l"), [(1.0, 1.0008), (2.5, 1.0), (1.0, 1.003), (0.4, 0.998)])
def test_pairs_exchange_what_is_said(m: float, l: float) -> None:
    """One bob of 1 kg and 1 m and another: the share and the time of the exchange in the motion itself."""
    example = scene(Cart(mass=1000.0), bob(1, 1), bob(m, l))
    (pair,) = explain(example).pairs
    times = np.linspace(0.0, 1.2 * pair.period, 20_001)
    passed = swing(example, 0, times)[:, 1]
    assert passed.max() == pytest.approx(pair.share, rel=0.01, abs=1e-4)
    smooth = np.convolve(passed, np.ones(41) / 41, "same")
    assert times[smooth.argmax()] == pytest.approx(pair.period / 2, rel=0.05)


def test_equal_lengths_share_by_mass() -> None:
    (pair,) = explain(scene(Cart(mass=1e6), bob(1, 1), bob(3, 1))).pairs
    assert pair.share == pytest.approx(4 * 3 / (1 + 3) ** 2, rel=1e-9)
    assert explain(scene(Cart(mass=0.0), bob(1, 1), bob(1, 0.8))).pairs == ()


CROWDED = scene(Cart(mass=50.0), bob(1, 0.99), bob(1, 1), bob(1, 1.01))
OCTAVES = scene(Cart(mass=10.0), bob(1, 16), bob(1, 4), bob(1, 1))
NEAR = scene(Cart(mass=1.0), bob(1, 1), bob(1, 1.000001))


def most_passed(example: Scene) -> np.ndarray:
    """The most energy, over its own, that each simple pendulum under a heavy cart passes to each: (Σ |w_aj w_bj|)²."""
    written = matrices(example)
    shapes = scipy.linalg.eigh(written.K, written.M)[1]
    size = np.abs(shapes[1:]) * np.sqrt(np.diag(written.M)[1:])[:, None]
    return (size @ size.T) ** 2


def test_pairs_say_nothing_where_others_take_part() -> None:
    rng = np.random.default_rng(3)
    seen = []
    for _ in range(60):
        lengths = 1 + 10 ** rng.uniform(-4, -0.5) * rng.normal(size=rng.integers(3, 5))
        spring = float(rng.choice([0.0, 10 ** rng.uniform(1, 6)]))
        cart = Cart(mass=float(10 ** rng.uniform(2, 4)), stiffness=spring)
        example = scene(cart, *(bob(rng.uniform(0.3, 3), l) for l in lengths.tolist()))
        explanation, most = explain(example), most_passed(example)
        for pair in explanation.pairs:
            a, b = (
                int(explanation.names[explanation.fixed_base.kind[k]].split()[-1]) - 1
                for k in (pair.first, pair.second)
            )
            seen.append(pair.alone)
            if pair.alone and max(explanation.fixed_base.mass) < 0.1 * abs(pair.cart_mass):
                assert most[a, b] == pytest.approx(pair.share, rel=0.2, abs=0.03)
    assert 0.2 < np.mean(seen) < 0.8
    assert not any(pair.alone for pair in explain(CROWDED).pairs)
    assert most_passed(CROWDED)[0, 2] > 0.4
    assert "not alone" in coupling_report(explain(CROWDED), words=True)
    assert not any(pair.alone for pair in explain(scene(Cart(mass=500.0), *(bob(m, 1) for m in (1, 2, 3)))).pairs)


def test_a_pair_astride_a_third_pole_has_no_mass_between() -> None:
    pairs = json.loads(coupling_report(explain(OCTAVES), "json"))["pairs"]
    (astride,) = (pair for pair in pairs if pair["dynamic_mass_between_kg"] is None)
    assert astride["energy_share"] is astride["beat_period_s"] is None
    assert sum(pair["energy_share"] is not None for pair in pairs) == 2


@pytest.mark.parametrize(
    "example", [NEAR, CROWDED, scene(Cart(mass=0.01), bob(1, 1), bob(0.1, 0.5)), load("metronomes"), HELD, COINCIDENT]
)
def test_first_order_is_told_where_it_is_near(example: Scene) -> None:
    explanation = explain(example)
    for family, told in zip(explanation.families, page(explanation)["Families of modes"], strict=True):
        first = family.strength * family.omega / 2
        near = abs(family.strength) <= 0.5 and first == pytest.approx(family.splitting, rel=0.2)
        assert ("to first order gives" in told) is near
        beats = near and family.fold > 1
        assert ("recovers its energy" in told) is (beats and not explanation.scene.has_damping)
        assert ("set swinging alone" in told) is beats


def test_beats_that_are_told_are_there() -> None:
    """Two equal pendula among others: the slow amplitude Σ w_j² exp(−iω_j t) is back after a beat, gone halfway."""
    rng = np.random.default_rng(2)
    told = []
    for _ in range(60):
        others = (bob(rng.uniform(0.3, 3), 1 + 10 ** rng.uniform(-3.5, -0.5) * rng.normal()) for _ in range(2))
        example = scene(Cart(mass=float(10 ** rng.uniform(1, 4))), bob(1, 1, 2), *others)
        explanation, written = explain(example), matrices(example)
        squares, shapes = scipy.linalg.eigh(written.K, written.M)
        share = shapes[1] ** 2 * written.M[1, 1]
        (family,) = (family for family in explanation.families if family.fold == 2)
        told.append(family.beat is not None)
        assert told[-1] is (
            "recovers its energy" in page(explanation)["Families of modes"][explanation.families.index(family)]
        )
        if family.beat is None:
            continue
        times = family.beat * np.concatenate((np.linspace(0.9, 1.1, 101), np.linspace(0.45, 0.55, 101)))
        swinging = np.abs(np.exp(-1j * np.outer(times, np.sqrt(np.abs(squares)))) @ share) ** 2 / share.sum() ** 2
        assert swinging[:101].max() > 0.8
        assert np.median(swinging[101:]) < 0.1
    assert 0.2 < np.mean(told) < 0.9


def decaying(example: Scene, start: int, step: float, steps: int) -> np.ndarray:
    """As `swing`, of the scene with its dampers: exp(At) of the state matrix, averaged over some two seconds."""
    written, n = matrices(example), 1 + example.n_links
    inverse = np.linalg.inv(written.M)
    state = np.block([[np.zeros((n, n)), np.eye(n)], [-inverse @ written.K, -inverse @ written.D]])
    onwards, at = scipy.linalg.expm(state * step), np.eye(2 * n)[1 + start]
    states = np.array([at, *(at := onwards @ at for _ in range(steps))])
    stiffness, inertia = np.diag(written.K)[1:], np.diag(written.M)[1:]
    energy = inertia * states[:, n + 1 :] ** 2 + stiffness * states[:, 1:n] ** 2
    width = max(1, round(2.0 / step))
    smooth = np.apply_along_axis(np.convolve, 0, energy, np.ones(width) / width, "same")
    return smooth / stiffness[start]


TWENTY = Cart(mass=20.0)
UNEVEN = scene(TWENTY, bob(1, 1, damping=1.0), bob(1, 1))


@pytest.mark.parametrize(
    "example",
    [
        scene(Cart(mass=200.0), bob(1, 1, 2, damping=0.01)),
        scene(Cart(mass=200.0, damping=20.0), bob(1, 1, 3)),
        scene(Cart(mass=200.0, damping=100.0), bob(1, 1, 4, damping=0.005)),
        scene(Cart(mass=200.0, damping=3000.0), bob(1, 1, 2)),
    ],
)
def test_dampers_leave_of_a_beat_what_is_said(example: Scene) -> None:
    """What is back after a beat and the most that the others hold, in the motion of the state matrix."""
    explanation = explain(example)
    (family,) = explanation.families
    passed = family.exchange
    assert passed is not None
    seen = decaying(example, 0, 0.2, 20_000)
    assert seen[20:-20, 1:].sum(axis=1).max() == pytest.approx(passed.most, abs=0.02)
    told = page(explanation)["Families of modes"][0]
    assert ("of its energy after a beat" in told) is passed.beats
    if passed.beats:
        assert seen[round(passed.period / 0.2), 0] == pytest.approx(passed.left, abs=0.03)
    else:
        assert "no beats" in told
        assert seen[1000:-20, 0].max() < seen[100, 0]


@pytest.mark.parametrize(
    "example", [UNEVEN, scene(Cart(mass=20.0, damping=2.0), bob(1, 1, damping=0.1), bob(1, 1, damping=0.05))]
)
def test_pairs_damped_apart_exchange_what_is_said(example: Scene) -> None:
    (pair,) = explain(example).pairs
    passed = [decaying(example, start, 0.05, 4000)[20:-20, 1 - start].max() for start in (0, 1)]
    assert passed == pytest.approx([pair.share] * 2, rel=0.15)
    told = page(explain(example))["Exchange of energy between pendula"][0]
    assert "they exchange energy" not in told
    assert "damping suppresses the exchange" in told
    assert "recovers its energy" not in coupling_report(explain(example), words=True)


def test_no_beats_are_told_of_what_dampers_have_ended() -> None:
    creeping = coupling_report(explain(scene(TWENTY, bob(1, 1, 2, damping=7.0))), words=True)
    held = coupling_report(explain(scene(Cart(mass=20.0, damping=1000.0), bob(1, 1, 2))), words=True)
    for told in (creeping, held, coupling_report(explain(load("huygens")), words=True)):
        assert "recovers its energy" not in told
    assert "overdamped [σ ≥ ω]" in " ".join(creeping.split())
    assert "never receive more than 25 %" in " ".join(held.split())
    assert not explain(scene(TWENTY, bob(1, 1, 2, damping=7.0))).families[0].beat
    record = json.loads(coupling_report(explain(UNEVEN), "json"))
    assert record["pairs"][0]["beat_period_s"] is None
    assert record["pairs"][0]["energy_share"] == pytest.approx(0.02, abs=0.002)


def test_huygens_clocks_lose_more_than_a_beat_gives_back() -> None:
    """The shipped clocks without their drives, by the state matrix: 4 % is back after a beat of 28 s."""
    (family,) = explain(load("huygens")).families
    assert family.exchange
    seen = decaying(load("huygens"), 0, 0.02, 2000)
    assert seen[round(family.exchange.period / 0.02), 0] == pytest.approx(family.exchange.left, abs=0.005)
    assert family.exchange.left < 0.05


def test_near_families_make_beats_a_guide() -> None:
    """Halfway the others hold 89 % of a family that is alone, and 80 % next to one that is near."""
    told = []
    for apart in (0.003, 0.03):
        example = scene(Cart(mass=2080.0), bob(1, 3.03, 3), bob(2, 3.03 * (1 - 2 * apart), 3))
        family = next(family for family in explain(example).families if family.mass < 4)
        half = np.linspace(0.45, 0.55, 201) * family.exchange.period
        held = np.median(swing(example, 0, half)[:, 1:3].sum(axis=1))
        told.append("another family is near" in page(explain(example))["Families of modes"][0])
        assert held == pytest.approx(family.exchange.most, abs=0.1 if told[-1] else 0.015)
    assert told == [True, False]


# --------------------------------------------------------------------------------------------------- damping


def damped_scene(size: float, cart: float = 1.0) -> Scene:
    return scene(
        Cart(mass=20.0, damping=0.5 * size * cart),
        bob(1, 1, damping=0.02 * size),
        bob(3, 1),
        bob(2, 1, 2, damping=0.1 * size),
        double(damping=0.03 * size),
    )


def state_eigenvalues(M: np.ndarray, D: np.ndarray, K: np.ndarray) -> np.ndarray:
    n = len(M)
    inverse = np.linalg.inv(M)
    state = np.block([[np.zeros((n, n)), np.eye(n)], [-inverse @ K, -inverse @ D]])
    values = np.linalg.eigvals(state)
    return values[values.imag > 1e-3]


def test_rates_are_the_slope_of_the_damped_eigenvalues() -> None:
    """The state matrix written out: first order misses by the square of the damping, relative to it."""
    misses = []
    for size in (1e-1, 1e-2):
        example = damped_scene(size)
        written = matrices(example)
        damped = explain(example).damped_modes
        values = state_eigenvalues(written.M, written.D, written.K)
        rates = np.sort(np.repeat([mode.rate for mode in damped], [mode.fold for mode in damped]))
        exact = np.sort(np.repeat([mode.decay for mode in damped], [mode.fold for mode in damped]))
        assert exact == pytest.approx(np.sort(-values.real), rel=1e-9)
        misses.append(np.abs(rates / np.sort(-values.real) - 1).max())
    assert misses[0] < 1e-3
    assert misses[1] < misses[0] / 80


def test_a_cart_damper_spares_antiphase() -> None:
    example = scene(Cart(mass=10.0, damping=2.0), double(3))
    damped = explain(example).damped_modes
    assert [mode.still for mode in damped] == [True, False, True, False]
    assert all((mode.rate == 0) is mode.still and (mode.decay == 0) is mode.still for mode in damped)
    assert all(mode.fold == (2 if mode.still else 1) for mode in damped)
    assert "Huygens" in coupling_report(explain(example), words=True)


@pytest.mark.parametrize("cart", [0.0, 5.0])
def test_a_drive_starts_the_mode_with_the_least_threshold(cart: float) -> None:
    example = scene(Cart(mass=3.0, damping=0.01 * cart), double(2, damping=1e-4), bob(1, 0.9, damping=1e-4))
    least = min(mode.threshold for mode in explain(example).damped_modes)
    written = matrices(example)
    tops = np.diag([1.0 if label.endswith(",1]") else 0.0 for label in written.labels])
    for share, grows in ((0.99, False), (1.01, True)):
        driven = state_eigenvalues(written.M, written.D - share * least * tops, written.K)
        assert bool(driven.real.max() > 0) is grows


def test_what_has_no_damped_eigenvalues_keeps_first_order() -> None:
    explanation = explain(scene(Cart(mass=0.0, damping=1.0), bob(1, 1, damping=0.1), bob(1, 0.8)))
    assert all(mode.exact is None and mode.rate > 0 for mode in explanation.damped_modes)
    assert "cannot be computed" in coupling_report(explanation, words=True)
    overdamped = coupling_report(explain(scene(Cart(mass=1.0), bob(1, 1, 2, damping=50.0))), words=True)
    assert "overdamped" in overdamped
    assert "first order no longer holds" in overdamped


@pytest.mark.parametrize("d", [50.0, 1e3, 1e14])
def test_an_overdamped_mode_ends_as_its_slow_root(d: float) -> None:
    slow = 2 * 9.81 / (d + np.sqrt(d * d - 4 * 9.81))
    explanation = explain(scene(Fixed(), bob(1, 1, damping=d), bob(1, 1.1, damping=0.8)))
    assert [mode.decay for mode in explanation.damped_modes] == pytest.approx([0.8 / 1.21 / 2, slow], rel=1e-9)
    told = " ".join(page(explanation)["Damping by family"])
    assert "The slowest to decay is mode 1 at 3.13209195 rad/s (cart still, pendulum 1)" in told
    assert "A drive" not in told
    both = explain(scene(Cart(mass=10.0), bob(1, 1, 2, damping=d)))
    written = matrices(both.scene)
    state = np.block([[0 * written.M, np.eye(3)], [-np.linalg.solve(written.M, m) for m in (written.K, written.D)]])
    creeping = np.sort(np.linalg.eigvals(state).real)[-4:-2] if d < 1e4 else [-slow, -slow]
    assert sorted(-mode.decay for mode in both.damped_modes) == pytest.approx(creeping, rel=1e-6)


# -------------------------------------------------------------------------------------------- page and picture


def page(coupling: Coupling) -> dict[str, tuple[str, ...]]:
    return {section.title: section.sentences for section in sections(coupling)}


def test_the_page_of_the_papers_cart() -> None:
    text = coupling_report(explain(load("paper-cart-2")), words=True)
    for number in ("2.68011401", "2.71754912", "7.18867087", "7.2094781", "167.842 s", "301.971 s", "104 kg"):
        assert number in text
    assert max(map(len, text.splitlines())) <= 110
    assert coupling_report(explain(load("paper-cart-2")), "markdown").startswith("# Two double pendula on a cart")
    with pytest.raises(ValueError, match="must be one of"):
        coupling_report(explain(load("chain-1")), "html")


@pytest.mark.parametrize("name", ["paper-cart-2", "clocks-double", "crane-two-loads", "two-bobs", "two-swings"])
def test_the_verdict_comes_first_then_one_table(name: str) -> None:
    """At most five lines of a terminal, no formula in brackets but with words, and the same numbers as JSON."""
    explanation = explain(load(name))
    with fitted(80):
        _, told, table, *_ = coupling_report(explanation).split("\n\n")
    assert "couple" in told
    assert len(told.splitlines()) <= 5
    assert table.split()[:2] == ["family", "ω"]
    assert "[" not in coupling_report(explanation)
    assert "[" in coupling_report(explanation, words=True)
    record = json.loads(coupling_report(explanation, "json"))
    assert " ".join(record["verdict_sentences"]) == " ".join(told.split())
    beats = [row.beat for row in explanation.rows() if row.beat]
    assert not beats or f"{max(beats):.4g} s" in told


EVERY = {
    **MILD,
    "fixed": load("chain-3"),
    "space": scene(Cart(mass=1.0), bob(1, 1, 2), space="space"),
    "one": load("crane-hook"),
    "massless": scene(Cart(mass=0.0), bob(1, 1, 3)),
    "immense": scene(Cart(mass=1e12), bob(1, 1, 2), bob(1, 0.8)),
    "damped": damped_scene(1.0),
    "thousand": load("thousand-pendula"),
}


@pytest.mark.parametrize("name", EVERY)
def test_every_number_has_its_formula(name: str) -> None:
    explanation = explain(EVERY[name])
    told = page(explanation)
    for title, sentences in told.items():
        for sentence in sentences:
            assert "[" in sentence or "JSON form" in sentence or not any(map(str.isdigit, sentence)), (title, sentence)
            assert "nan" not in sentence
    assert sum(map(len, told.values())) < 45
    record = json.loads(coupling_report(explanation, "json"))
    assert len(record["families"]) == len(explanation.families)
    assert record["families"][0]["omega_cart_still_rad_per_s"] == explanation.families[0].omega


@pytest.mark.parametrize("name", usually(["held", "fixed"], ["held", "fixed", "immense", "massless", "thousand"]))
def test_pictures_are_drawn(name: str) -> None:
    stream = io.BytesIO()
    save(coupling_figure(explain(EVERY[name])), stream, "png")
    assert stream.getvalue().startswith(b"\x89PNG")
    assert len(stream.getvalue()) > 30_000


@pytest.mark.parametrize("support", [Fixed(), Cart(mass=0.0), Cart(mass=1.0)])
def test_the_dynamic_mass_of_one_pole_is_in_sight(support: Cart | Fixed) -> None:
    axis = Figure().subplots()
    draw_mass(axis, explain(scene(support, bob(1, 1))))
    curve = axis.lines[2 if support.kind == "cart" else 1]
    x, y = curve.get_data()
    (left, right), (bottom, top) = axis.get_xlim(), axis.get_ylim()
    seen = np.asarray(x)[(np.asarray(y) > bottom) & (np.asarray(y) < top)]
    assert np.ptp(seen[seen < 3.1]) > 0.1 * (right - left)
    assert np.ptp(seen[seen > 3.2]) > 0.1 * (right - left)


def test_the_axis_of_an_immense_mass_has_no_factor_aside() -> None:
    stream = io.BytesIO()
    save(coupling_figure(explain(scene(Cart(mass=1e12), bob(1, 1)))), stream, "svg")
    assert b"<!-- 2e+12 -->" in stream.getvalue()
    assert b"<!-- 1e12 -->" not in stream.getvalue()


def test_what_is_said_of_special_scenes() -> None:
    told = {
        name: " ".join(coupling_report(explain(EVERY[name]), words=True).split())
        for name in ("fixed", "space", "one", "massless", "thousand")
    }
    assert "nothing couples pendula" in told["fixed"]
    assert "Across it the support does not move" in told["space"]
    assert "no partner" in told["one"]
    assert "It has no zeros" in told["massless"]
    assert "too many to list in pairs" in told["thousand"]
    assert "Synchronization requires dampers and drives" in told["space"]
    chains = [Pendulum(links=[Bob(mass=1, length=l)] * 25) for l in (1.0, 1.1)]
    assert "50 modes of 2 kinds are too many" in " ".join(
        coupling_report(explain(scene(Cart(mass=5.0), *chains)), words=True).split()
    )


def test_masses_that_miss_their_sum_are_refused() -> None:
    example, other = (
        scene(Cart(mass=10.0), Pendulum(links=[Bob(mass=1, length=1), Bob(mass=m, length=1)])) for m in (1e-16, 1e-32)
    )
    assert explain(example).residual() < 1e-8
    with pytest.raises(ComputationError, match="beyond double precision"):
        explain(other)


def test_standing_links_and_too_many_are_refused() -> None:
    with pytest.raises(SceneError, match="equilibrium"):
        explain(load("cart-upright"))
    with pytest.raises(ComputationError, match="at most 10000"):
        explain(scene(Fixed(), Pendulum(links=[Bob(mass=1.0, length=1.0, count=10_001)])))


DRIVE = VanDerPol(strength=0.05, angle_deg=5.0)


def test_the_scenes_own_drives_feed_what_their_torques_give_noted() -> None:
    driven = scene(Cart(mass=50.0, damping=1.0), bob(1, 1, 2, drive=DRIVE), bob(1, 1))
    still, moves = explain(driven).damped_modes
    model = matrices(driven)
    phi = scipy.linalg.eigh(model.K, model.M)[1][:, -1]
    assert moves.from_drives == pytest.approx(0.05 * (phi[1] ** 2 + phi[2] ** 2) / 2, rel=1e-12)
    assert still.from_drives == pytest.approx(0.05 * 2 / 3 / 2, rel=1e-12)


def test_words_of_a_scene_that_drives_itself() -> None:
    said = coupling_report(explain(scene(Cart(mass=50.0, damping=1.0), bob(1, 1, 2, drive=DRIVE))), words=True)
    assert "with 0.025 1/s" in said
    assert "it grows from rest" in said
    assert "nothing else swings" not in said


@pytest.mark.parametrize("ratio", [0.02, (0.0, 0.01, 0.02, 0.03, 0.04)])
def test_a_damping_ratio_is_explained_beside_dampers(ratio: float | tuple[float, ...]) -> None:
    """ζω to first order, and the eigenvalues of the table."""
    rigged = load("paper-cart-2").replace(damping_ratio=ratio)
    table = {abs(value): value for value in natural_modes(rigged).eigenvalue.tolist() if value}
    for mode in explain(rigged).damped_modes:
        assert mode.exact is not None
        nearest = table[min(table, key=lambda size: abs(size - abs(mode.exact or 0)))]
        assert abs(mode.exact - nearest) < 1e-12 * abs(nearest)
        assert mode.from_ratio == mode.rate == pytest.approx(-nearest.real, rel=1e-12)
    damped = rigged.replace(support=Cart(mass=100.0, damping=3.0))
    for mode in explain(damped).damped_modes:
        assert mode.exact is not None
        assert mode.rate == pytest.approx(-mode.exact.real, rel=1e-3)
        assert (mode.from_cart > 0) == (not mode.still)


def test_a_report_in_no_known_form_is_refused() -> None:
    with pytest.raises(ValueError, match=re.escape("form = 'csv': must be one of text, markdown, json")):
        coupling_report(explain(load("paper-cart-2")), "csv")
