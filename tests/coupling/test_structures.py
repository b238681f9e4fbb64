"""How structures and springs couple pendula: every number against dense matrices, one cart, or closed forms."""

from __future__ import annotations

import io
import json
from dataclasses import replace
from functools import cache
from typing import Any

import mpmath as mp
import numpy as np
import pytest
import scipy

from modal import Bob, Cart, ComputationError, Fixed, Pendulum, Rod, Scene, load, matrices, natural_modes
from modal.coupling import Coupling, coupling_report, explain
from modal.coupling.report import sections
from modal.plotting import coupling_figure
from modal.scene import Heave, ModalSupport, Platform, Spring, Swing, Tilt, VanDerPol
from modal.scene.supports import Planar
from nonlinear.sweeps import parse_measures


def bob(
    m: float, l: float, count: int = 1, *, on: str | None = None, at: tuple[float, float] = (0.0, 0.0), **link: Any
) -> Pendulum:
    return Pendulum(links=[Bob(mass=m, length=l, **link)], count=count, on=on, position=at)


def scene(supports: Any, *pendula: Pendulum, springs: tuple[Spring, ...] = (), **fields: Any) -> Scene:
    return Scene(gravity=9.81, support=supports, pendulum=pendula, spring=springs, **fields)


LEFT, RIGHT = (
    Cart(name=name, mass=5.0, stiffness=30.0, position=(x, 0.0)) for name, x in (("left", 0.0), ("right", 2.0))
)
BETWEEN = Spring(between=("left", "right"), stiffness=20.0)
CARTS = scene((LEFT, RIGHT), bob(1, 1, 3, on="left"), bob(1, 1, 3, on="right"), springs=(BETWEEN,))
BOBS = scene(
    Cart(mass=1.0).replace(mass=1e6, stiffness=1e9),
    bob(1, 1),
    bob(1, 1, at=(0.4, 0.0)),
    springs=(Spring(between=("pendulum[0].links[0]@0.5", "pendulum[1].links[0]@0.5"), stiffness=5.0),),
)
MIXED = scene(
    (
        Tilt(name="board", mass=4.0, inertia=0.5, centre=(0.1, 0.3), stiffness=60.0, damping=0.3),
        Platform(
            name="deck",
            mass=9.0,
            inertia=2.0,
            position=(3.0, 0.0),
            stiffness=Planar(sway=40.0, heave=900.0, roll=80.0),
            damping=Planar(sway=0.4, heave=2.0, roll=0.3),
        ),
        Swing(name="seat", mass=3.0, length=0.8, position=(5.0, 0.0), damping=0.2),
        Heave(name="lift", mass=2.0, stiffness=300.0, position=(7.0, 0.0)),
        ModalSupport(
            name="frame",
            M=((2.0, 0.1), (0.1, 1.0)),
            K=((90.0, 5.0), (5.0, 200.0)),
            D=((0.1, 0.0), (0.0, 0.2)),
            points=(((1.0, 0.4), (0.1, -0.2)),),
        ),
    ),
    Pendulum(
        links=[
            Rod(mass=1.0, length=0.5, stiffness=3.0, damping=0.1),
            Bob(mass=0.4, length=0.3, damping=0.02, drag=0.05),
        ],
        count=2,
        on="board",
        position=(0.2, 0.4),
    ),
    bob(1.0, 0.7, 3, on="deck", at=(-0.5, 0.3), stiffness=0.7, damping=0.03, drag=0.04),
    bob(0.5, 0.7, on="seat"),
    bob(0.8, 0.9, on="lift"),
    bob(0.8, 0.7, 2, on="frame[0]"),
    springs=(
        Spring(between=("deck@0.5,0.0", "seat"), stiffness=25.0, damping=0.1),
        Spring(between=("pendulum[2].links[0]@0.4", "pendulum[3].links[0]"), stiffness=4.0, damping=0.05),
        Spring(kind="torsion", between=("pendulum[1].copies[1].links[0]", "deck"), stiffness=1.5, damping=0.01),
    ),
)


@cache
def explained(scene: Scene) -> Coupling:
    return explain(scene)


def every_omega(coupling: Coupling) -> list[float]:
    """All frequencies as often as there are modes."""
    still = [family.omega for family in coupling.families for _ in range(family.still)]
    moving = [branch.omega for family in coupling.families for branch in family.branches]
    return sorted([*still, *moving, *(omega for omega, _ in coupling.structure_modes)])


# ------------------------------------------------------------------------------------------ against dense matrices


@pytest.mark.parametrize("scene", [CARTS, MIXED], ids=["carts", "mixed"])
def test_the_dynamic_stiffness_is_a_schur_complement(scene: Scene) -> None:
    """The recursion's modes of each pendulum against elimination from M and K of the whole scene."""
    explanation, dense = explained(scene), matrices(scene)
    d = explanation.reduced.d
    for omega in (0.7, 2.3, 4.1, 9.7):
        S = dense.K - omega**2 * dense.M
        expected = S[:d, :d] - S[:d, d:] @ np.linalg.solve(S[d:, d:], S[d:, :d])
        assert explanation.stiffness(omega) == pytest.approx(expected, abs=1e-12 * np.abs(S).max())
        push = explanation.basis.T @ expected @ explanation.basis
        assert explanation.dynamic(omega) == pytest.approx(-push / omega**2, abs=1e-11 * np.abs(push).max())


@pytest.mark.parametrize("scene", [CARTS, BOBS, MIXED], ids=["carts", "bobs", "mixed"])
def test_families_and_the_structure_have_all_modes(scene: Scene) -> None:
    dense = matrices(scene)
    expected = np.sqrt(scipy.linalg.eigh(dense.K, dense.M, eigvals_only=True))
    assert every_omega(explained(scene)) == pytest.approx(expected, rel=1e-10)


def test_dampers_of_everything_are_in_the_exact_rates() -> None:
    """λ of the reduced coordinates, and of the copies, against those of the whole scene."""
    explanation, dense = explained(MIXED), matrices(MIXED)
    n = len(dense.M)
    whole = np.block(
        [[np.zeros((n, n)), np.eye(n)], [-np.linalg.solve(dense.M, dense.K), -np.linalg.solve(dense.M, dense.D)]]
    )
    values = np.linalg.eigvals(whole)
    values = values[values.imag > 0]
    mine = np.array([mode.exact for mode in explanation.damped_modes for _ in range(mode.fold)])
    for value in values:
        near = np.abs(mine - value).argmin()
        assert abs(mine[near] - value) <= 1e-9 * abs(value)
        mine[near] = np.inf
    assert not np.isfinite(mine).any()


def test_first_order_rates_are_those_of_weak_dampers() -> None:
    for mode in explained(MIXED).damped_modes:
        assert mode.exact is not None
        assert mode.decay == pytest.approx(mode.rate, rel=0.1)


# --------------------------------------------------------------------------------------------- against one cart


@pytest.mark.parametrize("stiffness", [0.0, 60.0])
def test_a_cart_on_a_spring_is_the_cart_that_has_it(stiffness: float) -> None:
    """Families, strengths, splittings to all digits, exchange and damping by the report of one cart."""
    pendula = (bob(1, 1, 2, damping=0.01), bob(2, 0.8, drag=0.02), bob(1, 0.3))
    drive = VanDerPol(strength=0.02, angle_deg=10.0)
    pendula = (pendula[0].replace(links=[pendula[0].links[0].replace(drive=drive)]), *pendula[1:])
    cart = Cart(mass=500.0, damping=0.4, stiffness=stiffness)
    held = Spring(between=("cart", "ground"), stiffness=stiffness, damping=0.4)
    explanation = explain(scene(cart, *pendula))
    other = replace(explained(scene(cart.replace(stiffness=0.0, damping=0.0), *pendula, springs=(held,))), secular=None)
    for mine, theirs in zip(other.families, explanation.families, strict=True):
        (branch,) = mine.branches
        assert (mine.omega, mine.fold, mine.still) == (
            pytest.approx(theirs.omega, rel=1e-14),
            theirs.fold,
            theirs.fold - 1,
        )
        assert branch.strength == pytest.approx(theirs.strength, rel=1e-11)
        assert branch.splitting == pytest.approx(theirs.splitting, rel=1e-11)
        assert mine.masses == pytest.approx([theirs.mass], rel=1e-13)
        assert other.effective_mass(mine, branch) == pytest.approx(theirs.mass, rel=1e-13)
        share = theirs.exchange.most if theirs.exchange else None
        assert (mine.exchange.most if mine.exchange else None) == (share and pytest.approx(share, rel=5e-3))
        assert (other.beat(mine, branch) or 0.0) == pytest.approx(theirs.beat or 0.0, rel=1e-4)
    pairs = {(pair.first, pair.second): pair for pair in explanation.pairs}
    for pair in other.pairs:
        theirs = pairs[pair.first, pair.second]
        assert abs(pair.coupling) == pytest.approx(theirs.coupling, rel=1e-12)
        assert pair.detuning == pytest.approx(theirs.detuning, rel=1e-9)
        assert pair.exchange.most == pytest.approx(theirs.exchange.most, rel=1e-3)
    for mine, theirs in zip(other.damped_modes, explanation.damped_modes, strict=True):
        names = ("omega", "fold", "from_cart", "from_joints", "from_drag", "from_drives", "excitation", "exact")
        assert [getattr(mine, name) for name in names] == pytest.approx(
            [getattr(theirs, name) for name in names], rel=1e-8, abs=1e-12
        )


def test_a_swing_is_a_cart_on_a_spring() -> None:
    """k = (M_s + Σ m) g/L."""
    swing = explained(scene(Swing(mass=3.0, length=0.6), bob(1, 1, 4)))
    cart = explain(scene(Cart(mass=3.0, stiffness=7.0 * 9.81 / 0.6), bob(1, 1, 4)))
    assert swing.families[0].branches[0].omega == pytest.approx(cart.cart_modes[0].omega, rel=1e-13)
    assert swing.structure_modes[0][0] == pytest.approx(cart.cart_modes[1].omega, rel=1e-13)


def test_a_damping_ratio_damps_every_mode() -> None:
    explanation = explained(CARTS.replace(damping_ratio=0.01))
    for mode in explanation.damped_modes:
        assert mode.exact is not None
        assert -mode.exact.real / abs(mode.exact) == pytest.approx(0.01, rel=1e-9)
        assert mode.rate == pytest.approx(0.01 * mode.omega, rel=1e-12)


# ------------------------------------------------------------------------------------------------- closed forms


def test_two_carts_with_three_bobs_each() -> None:
    explanation = explained(CARTS)
    (family,) = explanation.families
    assert (family.fold, family.still) == (6, 4)
    assert [branch.omega for branch in family.branches] == pytest.approx([4.30318038, 4.89542514], abs=5e-9)
    assert [omega for omega, _ in explanation.structure_modes] == pytest.approx([1.78287370, 2.39391159], abs=5e-9)
    # in phase the link is slack, in antiphase it counts twice; 3 bobs ride on each cart of 5 kg
    assert [mode.omega for mode in explanation.modes] == pytest.approx(np.sqrt([30 / 8, 70 / 8]), rel=1e-14)
    assert [mode.mass for mode in explanation.modes] == pytest.approx([16.0, 16.0], rel=1e-14)
    assert explanation.fast == pytest.approx([10.0, 10.0], rel=1e-14)
    # ε = μ/m with the dynamic mass 2 m_c − 2 k/ω² of both carts at ω² = g
    expected = sorted(3 / (5 - k / 9.81) for k in (30.0, 70.0))
    assert sorted(branch.strength for branch in family.branches) == pytest.approx(expected, rel=1e-12)


def test_the_share_of_three_levels_is_that_of_all_modes() -> None:
    """One of six bobs on two heavy carts, by superposition of every mode of the scene."""
    heavy = [cart.replace(mass=200.0, stiffness=500.0) for cart in (LEFT, RIGHT)]
    explanation = explained(CARTS.replace(support=heavy, spring=(BETWEEN.replace(stiffness=300.0),)))
    (family,) = explanation.families
    assert [explanation.effective_mass(family, branch) for branch in family.branches] == pytest.approx(
        [6.0, 6.0], rel=1e-12
    )
    written = matrices(explanation.scene)
    squares, shapes = scipy.linalg.eigh(written.K, written.M)
    bobs = shapes[-6:] * np.sqrt(np.diag(written.M)[-6:])[:, None]
    times = np.linspace(0.0, max(family.beats), 4001)
    swinging = np.abs(np.exp(-1j * np.outer(times, np.sqrt(squares))) @ (bobs * bobs[0]).T) ** 2
    assert family.exchange.most == pytest.approx(swinging[:, 1:].sum(axis=1).max(), rel=0.03)


@pytest.mark.parametrize("mass", [1e2, 1e10])
def test_splittings_keep_their_digits_however_heavy_the_carts(mass: float) -> None:
    """(k − x(m + 3))(g − x) = 3 x² of each cart with its bobs, in phase with k, in antiphase with k + 2κ."""
    held = [cart.replace(mass=mass, stiffness=0.3 * mass) for cart in (LEFT, RIGHT)]
    joined = BETWEEN.replace(stiffness=0.2 * mass)
    branches = explained(CARTS.replace(support=held, spring=(joined,))).families[0].branches
    with mp.workdps(60):
        g, m = mp.mpf(9.81), mp.mpf(mass)
        for branch, spring in zip(branches, (0.3 * mass, 0.3 * mass + 2 * (0.2 * mass)), strict=True):
            a, b, c = m, -(mp.mpf(spring) + (m + 3) * g), spring * g
            roots = [(-b + sign * mp.sqrt(b * b - 4 * a * c)) / (2 * a) for sign in (1, -1)]
            exact = min((mp.sqrt(x) - mp.sqrt(g) for x in roots), key=lambda value: abs(value - branch.splitting))
            assert branch.splitting == pytest.approx(float(exact), rel=1e-13)


def test_a_push_feels_nothing_where_the_scene_swings() -> None:
    explanation = explained(CARTS)
    omegas = np.array([branch.omega for branch in explanation.families[0].branches])
    low, high = explanation.felt_masses(omegas * (1 - 1e-6)), explanation.felt_masses(omegas * (1 + 1e-6))
    assert (np.sign(low) != np.sign(high)).any(axis=1).all()


def test_two_bobs_and_a_spring() -> None:
    """ω² = g/l and g/l + 2 k a²/(m l²); each alone, the other held, has half the shift."""
    explanation = explained(BOBS.replace(support=Cart(mass=1e9, stiffness=1e15)))
    (family,) = explanation.families
    assert [branch.omega for branch in family.branches] == pytest.approx([3.1320919527, 3.5085609586], abs=2e-9)
    assert family.omega == pytest.approx(np.sqrt(9.81 + 5.0 / 4), rel=1e-13)
    assert [branch.strength * family.omega**2 for branch in family.branches] == pytest.approx([-1.25, 1.25], rel=1e-6)
    assert family.beats[0] == pytest.approx(2 * np.pi / (3.5085609586 - 3.1320919527), rel=1e-6)


def test_a_structure_that_falls_over_is_told() -> None:
    fallen = scene(Tilt(mass=5.0, inertia=1.0, centre=(0.0, -1.0), stiffness=20.0), bob(1, 1))
    with pytest.raises(ComputationError, match="falls over"):
        _ = explained(fallen).modes


# ------------------------------------------------------------------------------------------- words and the picture


def test_words_name_what_moves_and_how() -> None:
    explanation = explained(CARTS)
    assert [explanation.words(mode.shape) for mode in explanation.modes] == [
        "two carts in phase",
        "two carts in antiphase",
    ]
    mixed = explained(MIXED)
    told = [mixed.words(np.eye(mixed.reduced.d)[k]) for k in range(8)]
    assert told[:6] == ["board tilts", "deck sways", "deck heaves", "deck rolls", "seat moves", "lift heaves"]


@pytest.mark.parametrize("scene", [CARTS, MIXED], ids=["carts", "mixed"])
def test_the_report_and_its_numbers(scene: Scene) -> None:
    explanation = explained(scene)
    assert {section.title for section in sections(explanation)} >= {
        "The structure alone",
        "Families of modes",
        "Damping by mode",
    }
    record = json.loads(coupling_report(explanation, "json"))
    assert record["coordinates"] == list(explanation.structure.names)
    assert len(record["families"]) == len(explanation.families)
    assert "nan" not in coupling_report(explanation)


def test_the_picture_has_a_panel_for_each_mode_of_the_structure() -> None:
    figure = coupling_figure(explained(CARTS))
    assert [axis.get_title(loc="left") for axis in figure.axes] == [
        "s1: two carts in phase",
        "s2: two carts in antiphase",
        "frequencies",
    ]
    figure.savefig(io.BytesIO(), format="png", dpi=40)


def test_swings_too_light_for_matrices_are_said_and_one_keeps_its_digits() -> None:
    light, other = (Swing(name=name, mass=3e-32, length=0.8, position=(x, 0.0)) for name, x in (("a", 0.0), ("b", 2.0)))
    single = scene(light, bob(1, 1))
    assert every_omega(explained(single)) == pytest.approx(natural_modes(single).omega, rel=1e-12)
    with pytest.raises(ComputationError, match="lost next to the heavy ones"):
        coupling_report(explain(scene((light, other), bob(1, 1, on="a"), bob(1, 1, on="b"))))


# ------------------------------------------------------------------------------------ what nothing joins


@pytest.mark.parametrize("stiffness", [0.0, 1e-6])
def test_pendula_that_nothing_joins_do_not_beat(stiffness: float) -> None:
    """No beat, neither in the families nor between neighbours of the table; ε is that of each cart by itself."""
    carts = Cart(name="a", mass=3.0), Cart(name="b", mass=6.0)
    springs = (Spring(between=("a", "b"), stiffness=stiffness),) * bool(stiffness)
    apart = scene(carts, bob(0.5, 1.5, on="a"), bob(0.5, 1.5, on="b"), springs=springs)
    explanation = explained(apart)
    assert len(explanation.families) == (1 if stiffness else 2)
    assert not any(family.beats for family in explanation.families)
    assert all(row.beat is None for row in explanation.rows())
    assert explanation.families[0].branches[-1].strength == pytest.approx(0.5 / 3.0, rel=1e-3)
    (value,) = parse_measures(["beat:3"])[0].of(apart).values()
    assert value == np.inf


def test_a_pendulum_on_a_wall_is_of_no_family_of_a_cart() -> None:
    wall, trolley = Fixed(name="wall"), Cart(name="trolley", mass=1.0)
    explanation = explained(scene((wall, trolley), bob(0.1, 1, on="wall"), bob(0.1, 1, on="trolley")))
    assert [family.fold for family in explanation.families] == [1, 1]
    assert [row.beat for row in explanation.rows()] == [None, None]
    assert not explanation.joins_pendula
    assert explained(CARTS).joins_pendula


@pytest.mark.parametrize("name", ["beam", "tower", "two-swings"])
def test_levels_repel(name: str) -> None:
    """A mode goes away from the structure's own, as the sign of its strength says."""
    for family in explain(load(name)).families:
        assert all(branch.strength * branch.splitting > 0 for branch in family.branches)


@pytest.mark.parametrize(
    "numbers", [(3.0, 20.0, 1.0, 2.0, 0.5), *map(tuple, np.random.default_rng(9).uniform(0.5, 20, (3, 5)))]
)
def test_the_cart_on_a_spring_owns_the_mode_of_its_spring(numbers: tuple[float, ...]) -> None:
    """The mode that belongs to no family has most of its potential energy in the spring, by dense matrices."""
    mass, stiffness, first, second, length = numbers
    sprung = scene(Cart(mass=mass, stiffness=stiffness), bob(first, 1), bob(second, length))
    explanation = explain(sprung)
    squares, shapes = scipy.linalg.eigh(matrices(sprung).K, matrices(sprung).M)
    leading = int((stiffness * shapes[0] ** 2 / squares).argmax())
    assert [mode.family is None for mode in explanation.cart_modes].index(True) == leading
    assert len({family.cart_mode for family in explanation.families}) == 2
