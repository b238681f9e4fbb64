"""The modal effective mass with the cart held, by residues of the dynamic mass, by matrices and by the sum rule."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import eigh

from modal import Bob, Body, Cart, Fixed, Pendulum, Rod, Scene, load, natural_modes
from modal.assembly import matrices
from modal.coupling import explain
from modal.errors import SceneError
from modal.modes.numbering import fixed_base_masses
from modal.modes.tables import COLUMNS, DROPPED, columns_of, printed_columns, table
from modal.report import fitted
from modal.scene.parameters import number_at, vary

SCENES = (
    *("paper-cart-1", "paper-cart-2", "paper-cart-3", "crane-hook", "crane-two-loads"),
    Scene(
        gravity=9.81,
        support=Cart(mass=3.0),
        pendulum=[
            Pendulum(links=[Rod(mass=1.0, length=0.4), Bob(mass=0.3, length=0.9)], count=3),
            Pendulum(links=[Body(mass=2.0, length=0.7, centre=0.3, inertia=0.2, stiffness=4.0)]),
            Pendulum(links=[Bob(mass=0.5, length=1.1)], count=2),
        ],
    ),
    Scene(  # two different pendula of one frequency, next to another
        gravity=9.81,
        support=Cart(mass=1.0),
        pendulum=[Pendulum(links=[Bob(mass=m, length=l)]) for m, l in ((1.0, 1.0), (5.0, 1.0), (2.0, 0.5))],
    ),
    Scene(
        gravity=9.81, space="space", support=Cart(mass=1.0), pendulum=[Pendulum(links=[Bob(mass=1, length=1)], count=2)]
    ),
)


def scene_of(example: str | Scene) -> Scene:
    return load(example) if isinstance(example, str) else example


def clamped(scene: Scene) -> tuple[np.ndarray, np.ndarray]:
    """ω² and (φᵀb)²/(φᵀAφ) of the pendula on a fixed support, from dense matrices: b is the cart's row of M."""
    whole = matrices(scene.in_plane)
    square, shapes = eigh(whole.K[1:, 1:], whole.M[1:, 1:])
    return square, (shapes.T @ whole.M[1:, 0]) ** 2


@pytest.mark.parametrize("example", SCENES, ids=str)
def test_every_route_gives_the_same_mass(example: str | Scene) -> None:
    scene = scene_of(example)
    modes = natural_modes(scene)
    masses = fixed_base_masses(modes)
    dynamic = explain(scene).dynamic
    square, mass = clamped(scene)
    assert np.allclose(np.sort(masses[masses > 1e-12]), np.sort(dynamic.mass[dynamic.mass > 1e-12]), rtol=1e-9)
    for omega, base_mass in zip(modes.omega, masses, strict=True):  # the pole at or below the mode that has its mass
        if base_mass > 1e-12:
            r = np.flatnonzero(dynamic.omega <= omega * (1 + 1e-9))[-1]
            assert base_mass == pytest.approx(dynamic.mass[r], rel=1e-9)
            assert base_mass == pytest.approx(
                mass[np.isclose(square, dynamic.omega[r] ** 2, rtol=1e-9)].sum(), rel=1e-7
            )
    hanging = sum(link.mass * link.count * pendulum.count for pendulum in scene.pendulum for link in pendulum.links)
    assert masses.sum() + dynamic.residual == pytest.approx(hanging, rel=1e-12)


@pytest.mark.parametrize("example", SCENES, ids=str)
def test_residues_of_the_dynamic_mass_are_these_masses(example: str | Scene) -> None:
    scene = scene_of(example)
    dynamic, masses = explain(scene).dynamic, fixed_base_masses(natural_modes(scene))
    step = 1e-7
    residues = [  # m_dyn ≈ μ ω_r²/(ω_r² − ω²) next to a pole: half the difference across it, where all else cancels
        float((dynamic([w * (1 - step)]) - dynamic([w * (1 + step)]))[0]) / 2 * (2 * step) for w in dynamic.omega
    ]
    assert sum(residues) == pytest.approx(masses.sum(), rel=1e-5)


@pytest.mark.parametrize("name", SCENES[:5])
def test_a_mode_goes_to_its_fixed_base_mode_as_the_cart_grows(name: str) -> None:
    scene = load(name)
    heavy = natural_modes(scene.replace(support=Cart(mass=1e9)))
    masses, base = fixed_base_masses(heavy), natural_modes(scene.replace(support=Fixed()))
    assert np.allclose(masses, fixed_base_masses(natural_modes(scene)), rtol=1e-9)
    for omega, base_mass in zip(heavy.omega, masses, strict=True):
        if base_mass > 1e-12:
            row = int(np.abs(base.omega - omega).argmin())
            assert base.omega[row] == pytest.approx(omega, rel=1e-6)
            assert base[row].effective_mass == pytest.approx(base_mass, rel=1e-9)


def test_on_a_fixed_support_it_is_the_modes_own() -> None:
    modes = natural_modes(load("chain-unequal"))
    assert np.allclose(fixed_base_masses(modes), [mode.effective_mass for mode in modes], rtol=1e-13)


def test_some_of_the_modes_have_the_same_as_all() -> None:
    scene = load("thousand-pendula")
    whole = natural_modes(scene)
    every = fixed_base_masses(whole)
    for first, last in ((0, 5), (3, 7), (500, 503)):
        some = natural_modes(scene, modes=slice(first, last))
        assert np.allclose(fixed_base_masses(some), every[first:last], rtol=1e-9)
    assert np.allclose(fixed_base_masses(whole, [4, 2]), every[[4, 2]])
    assert every.sum() == pytest.approx(1000.0)


def test_there_is_none_where_modes_do_not_belong_together() -> None:
    scene = load("crane-hook").replace(support=Cart(mass=1000.0, stiffness=1.0))
    assert np.isnan(fixed_base_masses(natural_modes(scene))).all()
    assert np.isnan(fixed_base_masses(natural_modes(load("cart-upright")))).all()


# --------------------------------------------------------------------------------------------------- with dampers

DAMPED = Scene(
    gravity=9.81,
    support=Cart(mass=5.0, stiffness=20.0, damping=0.3),
    pendulum=[
        Pendulum(links=[Bob(mass=1.0, length=1.0, damping=0.02), Rod(mass=0.5, length=0.6)], count=2),
        Pendulum(links=[Bob(mass=0.7, length=0.5, drag=0.05)]),
    ],
)


def test_light_dampers_leave_the_effective_masses() -> None:
    """(φᵀMe)²/(φᵀMφ) of eigh(K, M) for every light mode, their sum, and nothing where the cart hardly swings."""
    whole = matrices(DAMPED)
    square, shapes = eigh(whole.K, whole.M)
    expected = (shapes.T @ whole.M[:, 0]) ** 2
    modes = natural_modes(DAMPED)
    for mode in modes:
        near = int(np.abs(np.sqrt(square) - mode.omega).argmin())
        assert mode.effective_mass == pytest.approx(expected[near], rel=1e-9, abs=1e-12)
        assert mode.effective_mass_share == pytest.approx(mode.effective_mass / 8.7, rel=1e-12)
    assert modes.effective_mass.sum() == pytest.approx(8.7, rel=1e-9)
    braked = natural_modes(DAMPED.replace(support=Cart(mass=5.0, stiffness=20.0, damping=6.0)))
    light = np.isfinite(braked.effective_mass)
    assert light.any()
    assert not light.all()
    assert "T is that of the damped swing" in table(braked, list(braked), "text")
    undamped = natural_modes(DAMPED.conservative)
    assert "damped swing" not in table(undamped, list(undamped), "text")


def test_what_is_light_is_judged_by_shape_and_damping_ratio() -> None:
    """By the definition, |φᴴMψ|²/(φᴴMφ ψᵀMψ) of state-space eigenvectors, over scenes with ever more damping."""
    seen = []
    for damping in (0.1, 4.0):
        scene = DAMPED.replace(support=Cart(mass=5.0, stiffness=20.0, damping=damping))
        whole, modes = matrices(scene), natural_modes(scene)
        n = len(whole.M)
        inverse = np.linalg.inv(whole.M)
        values, vectors = np.linalg.eig(
            np.block([[np.zeros((n, n)), np.eye(n)], [-inverse @ whole.K, -inverse @ whole.D]])
        )
        psi = eigh(whole.K, whole.M)[1]
        for row, value in enumerate(modes.eigenvalue.tolist()):
            phi = vectors[:n, np.abs(values - value).argmin()]
            alike = (np.abs(phi.conj() @ whole.M @ psi) ** 2 / (phi.conj() @ whole.M @ phi).real).max()
            light = alike >= 0.99 and 0 <= modes.damping_ratio[row] < 0.1
            seen.append(light)
            assert np.isfinite(modes[row].effective_mass) == light
    assert 0.2 < np.mean(seen) < 0.95


def test_dampers_leave_the_fixed_base_masses_of_clocks() -> None:
    masses = fixed_base_masses(natural_modes(load("huygens")))
    (mass,) = (each for each in masses if each > 1e-12)
    assert mass == pytest.approx(0.164, rel=1e-12)
    assert np.isnan(masses[1])


def test_a_note_says_whose_masses_they_are() -> None:
    modes = natural_modes(DAMPED)
    assert "those of the modes without dampers" in table(modes, list(modes), "text")
    bare = natural_modes(DAMPED.conservative)
    assert "without dampers" not in table(bare, list(bare), "text")


def test_a_cart_on_a_spring_tells_its_own_mode_from_the_pendulas() -> None:
    """By the sign of x θ: below the pendula's frequency they swing with the cart, above it against it."""
    words = ["in phase with the support", "in antiphase with the support"]
    for stiffness, expected in ((4.0, words), (4000.0, words)):
        pair = Pendulum(links=[Bob(mass=1.0, length=1.0)], count=2)
        scene = Scene(gravity=9.81, support=Cart(mass=10.0, stiffness=stiffness), pendulum=[pair])
        whole = matrices(scene)
        _, shapes = eigh(whole.K, whole.M)
        told = [mode.family for mode in natural_modes(scene) if mode.family.startswith("cart moves")]
        assert told == [f"cart moves: pendula {word}" for word in expected]
        moving = [shape for shape in shapes.T if abs(shape[0]) > 1e-9]
        assert [shape[0] * shape[1] > 0 for shape in moving] == [True, False]


# ------------------------------------------------------------------------------------------------------ columns


def keys(name: str, chosen: str = "") -> list[str]:
    modes = natural_modes(load(name))
    rows = list(modes)
    return [column.key for column in printed_columns(modes, rows, columns_of(modes, rows, chosen), chosen)]


def test_columns_that_say_nothing_are_left_out() -> None:
    hook, chain, many = keys("crane-hook"), keys("chain-3"), keys("paper-cart-3")
    assert "fixed_base_effective_mass_kg" in hook
    assert not {"effective_mass_kg", "effective_mass_share", "multiplicity"} & set(hook)
    assert {"effective_mass_kg", "effective_mass_share"} < set(chain)
    assert not {"cart_participation", "fixed_base_effective_mass_kg", "multiplicity"} & set(chain)
    assert "multiplicity" in many
    assert {"damping_ratio", "fixed_base_effective_mass_kg"} < set(keys("huygens"))


def test_columns_are_chosen_by_name() -> None:
    from multipendula.commands.modes import COLUMN_NAMES

    every = keys("crane-hook", "all")
    assert every == list(COLUMN_NAMES) == [column.key for column in COLUMNS if column.cell]
    assert keys("crane-hook", "omega,effective_mass_kg") == ["mode", "omega_rad_per_s", "effective_mass_kg"]
    for name, cumulative in (
        ("crane-hook", "cumulative_fixed_base_mass_share"),
        ("chain-3", "cumulative_effective_mass_share"),
    ):
        assert set(keys(name, "+cumulative")) - set(keys(name)) == {cumulative}


@pytest.mark.parametrize(("chosen", "told"), [("+", "+"), (",", ","), ("omega,,nothing,nothing", "nothing")])
def test_names_that_no_column_has_are_told_once(chosen: str, told: str) -> None:
    with pytest.raises(SceneError) as refused:
        keys("crane-hook", chosen)
    assert [problem for problem in refused.value.problems if problem.startswith(f"columns {told}: no such column")]
    assert len(refused.value.problems) == len(set(refused.value.problems))


def test_an_unknown_column_has_a_short_message() -> None:
    """One line for each name; the names there are, folded, where none of them is near."""
    with pytest.raises(SceneError) as caught:
        keys("chain-2", "omega_rad_per_sec")
    assert list(caught.value.problems) == ["columns omega_rad_per_sec: no such column (did you mean omega_rad_per_s?)"]
    with pytest.raises(SceneError) as caught:
        keys("chain-2", "zeta,foo")
    first, second, *names = caught.value.problems
    assert (first, second) == ("columns zeta: no such column", "columns foo: no such column")
    assert " ".join(names).startswith("columns are all, mode, omega_rad_per_s, ")
    assert max(map(len, names)) < 110


def test_every_column_but_two_may_go_and_the_order_is_documented() -> None:
    from pathlib import Path

    usual = {column.key for column in COLUMNS if column.cell and column.usual}
    kept = {key for key in usual if not any(key.startswith(start) for start in DROPPED)}
    assert kept == {"mode", "omega_rad_per_s", "family", "damping_ratio"}
    manual = Path(__file__).parents[2] / "docs" / "reference" / "columns.md"
    text = manual.read_text(encoding="utf-8").partition("## On a narrow terminal")[2]
    places = [text.index(f"`{key}`") for key in DROPPED if key in usual]
    assert places == sorted(places)


def test_the_cumulative_mass_is_all_of_it_in_the_end() -> None:
    modes = natural_modes(load("chain-unequal"))
    rows = list(modes)
    columns = {column.key: column for column in columns_of(modes, rows, "all")}
    shares = [columns["cumulative_effective_mass_share"].value(row) for row in rows]
    assert shares == pytest.approx(np.cumsum([row.effective_mass_share for row in rows]))
    assert shares[-1] == pytest.approx(1.0)
    factors = [columns["participation_factor_per_m"].value(row) for row in rows]
    for k, (factor, row) in enumerate(zip(factors, rows, strict=True)):
        shape = modes.shape(k)
        assert factor**2 * shape.modal_mass == pytest.approx(row.effective_mass)


# ------------------------------------------------------------------------------------------------ sensitivities


@pytest.mark.parametrize("name", ["crane-hook", "chain-unequal", "paper-cart-2", "crane-two-loads"])
def test_sensitivities_are_those_of_the_numbers_in_the_file(name: str) -> None:
    from modal.modes.sensitivity import of_mode
    from modal.scene.parameters import find_places

    scene = load(name)
    modes = natural_modes(scene)
    for k, row in enumerate(modes):
        for path, derivative in of_mode(modes, row).items():
            (place, *_) = find_places(scene, path)
            assert number_at(scene, place) == derivative.number
            step = 1e-4 * derivative.number
            above, below = (natural_modes(vary(scene, {path: derivative.number + s})).omega[k] for s in (step, -step))
            assert derivative.derivative == pytest.approx(
                (above - below) / (2 * step), rel=1e-5, abs=1e-7 / derivative.number
            )
            if row.omega:
                assert derivative.relative == pytest.approx(derivative.number / row.omega * derivative.derivative)


def test_sensitivities_in_every_format() -> None:
    import json

    modes = natural_modes(load("paper-cart-3"))
    rows = list(modes)
    entries = json.loads(table(modes, rows, "json", sensitive=True))["modes"]
    assert [bool(entry["sensitivities"]) for entry in entries] == [row.multiplicity == 1 for row in rows]
    assert "d_omega_d_gravity" in table(modes, rows, "csv", sensitive=True).splitlines()[0]
    for form in ("text", "markdown", "latex", "html"):
        text = table(modes, rows, form, sensitive=True)
        assert "length of links 1–2 of" in text
        assert (
            text.count(
                "No single derivative: modes 2 and 4 (growing, damped by a damping_ratio, or shared by several modes)."
            )
            == 1
        )
    with fitted(50):
        narrow = table(modes, rows, "text", sensitive=True)
    assert max(map(len, narrow.splitlines())) <= 50
    assert narrow.count("length of") > 1
