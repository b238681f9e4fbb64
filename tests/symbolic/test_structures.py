"""Structures by three routes: places of masses in 50 digits, energies in symbols, the packages' matrices and motion."""

from __future__ import annotations

from typing import Any

import mpmath as mp
import numpy as np
import pytest
import scipy
import sympy as sp
from structured_scenes import STRUCTURED
from structures import Oracle

from modal import Bob, Cart, Pendulum, Scene, SceneError, load, natural_modes
from modal.assembly import matrices
from modal.scene import Spring
from modal.scene.supports import Swing, Tilt
from modal.symbolic import derive, plain, symbolic_structure, vanishes
from modal.symbolic.derivation import EQUAL, Letters, rational, structure_with, target
from modal.symbolic.typesetting import PlusMinus
from modal.types import Floats

SCENES = pytest.mark.parametrize("name", STRUCTURED)


def undriven(scene: Scene) -> Scene:
    """What a derivation takes: without drives and drag."""
    return scene.undriven._with(drag=0.0, quadratic_drag=0.0)


def frequencies(scene: Scene) -> list[float]:
    return [float(omega) for omega in Oracle(scene).frequencies()]


# --------------------------------------------------------------------------------------- the oracle and closed forms


def test_two_bobs_joined_by_a_spring() -> None:
    bobs = [Pendulum(links=[Bob(mass=1.0, length=1.0)], position=(x, 0.0)) for x in (0.0, 2.0)]
    spring = Spring(between=("pendulum[0].links[0]@0.5", "pendulum[1].links[0]@0.5"), stiffness=5.0)
    scene = Scene(gravity=9.81, pendulum=bobs, spring=[spring])
    assert frequencies(scene) == pytest.approx([3.1320919527, 3.5085609586], rel=1e-10)
    (first, second), _ = zip(*polynomials(scene), strict=True)
    assert (first, second) == ("100 x - 981 = 0", "100 x - 1231 = 0")


def polynomials(scene: Scene) -> list[tuple[str, str]]:
    """Those in x and in λ of a scene in numbers, in ω² alone where x is a place along the rail."""
    (section,) = derive(symbolic_structure(scene), ("polynomial",), scene)
    written = [plain(line.formula) for line in section.lines]
    if "$ω²" in section.lines[0].words:
        return [(formula, "") for formula in written]
    return list(zip(written[::2], written[1::2], strict=True))


@pytest.mark.parametrize("count", [2, 5])
def test_a_row_of_pendula_joined_by_torsion(count: int) -> None:
    """ω_k² = g/l + 4 κ/(m l²) sin²(k π/2N), free ends."""
    m, l, kappa = 0.7, 0.9, 2.0
    pendula = [Pendulum(links=[Bob(mass=m, length=l)], position=(float(k), 0.0)) for k in range(count)]
    springs = [
        Spring(kind="torsion", between=(f"pendulum[{k}].links[0]", f"pendulum[{k + 1}].links[0]"), stiffness=kappa)
        for k in range(count - 1)
    ]
    expected = np.sqrt(9.81 / l + 4 * kappa / (m * l**2) * np.sin(np.arange(count) * np.pi / (2 * count)) ** 2)
    assert frequencies(Scene(gravity=9.81, pendulum=pendula, spring=springs)) == pytest.approx(expected, rel=1e-14)


def two_carts() -> Scene:
    names, bob = ("left", "right"), Bob(mass=1.0, length=1.0)
    ends = (("ground", "left", 30.0), ("ground", "right", 30.0), ("left", "right", 20.0))
    return Scene(
        gravity=9.81,
        support=[Cart(name=name, mass=5.0, position=(3.0 * k, 0.0)) for k, name in enumerate(names)],
        pendulum=[Pendulum(on=name, links=[bob], count=3) for name in names],
        spring=[Spring(between=(left, right), stiffness=k) for left, right, k in ends],
    )


def test_two_carts_in_a_row() -> None:
    expected = [1.78287370, 2.39391159, *[3.13209195] * 4, 4.30318038, 4.89542514]
    assert frequencies(two_carts()) == pytest.approx(expected, rel=2e-9)
    assert [line for line, _ in polynomials(two_carts())] == [
        "250 ω^4 - 5424 ω^2 + 14715 = 0",
        "250 ω^4 - 7424 ω^2 + 34335 = 0",
        "100 ω^2 - 981 = 0",
    ]


def test_a_swing_is_a_cart_with_the_weights_as_its_spring() -> None:
    bobs = [Pendulum(links=[Bob(mass=0.3, length=length)]) for length in (0.1, 0.2)]
    swing = Scene(gravity=9.81, support=Swing(mass=2.0, length=0.22), pendulum=bobs)
    cart = Cart(mass=2.0, stiffness=(2.0 + 0.6) * 9.81 / 0.22)
    assert frequencies(swing) == pytest.approx(frequencies(swing.replace(support=cart)), rel=1e-14)


def test_a_board_is_a_cart_where_nothing_is_at_its_top_joints() -> None:
    """X = h φ with m_c = (I + M d² + Σ m s²)/h² and k_c = (k_φ + M g d + g Σ m h)/h²."""
    M, I, d, h, k, m, places = 6.0, 1.5, 0.4, 0.3, 25.0, 1.2, (-0.8, 0.5, 0.3)
    pendula = [Pendulum(links=[Bob(mass=m, length=0.9)], position=(s, h)) for s in places]
    board = Scene(gravity=9.81, support=Tilt(mass=M, inertia=I, centre=(0.0, d), stiffness=k), pendulum=pendula)
    mass = (I + M * d**2 + sum(m * s**2 for s in places)) / h**2
    stiffness = (k + M * 9.81 * d + 9.81 * 3 * m * h) / h**2
    cart = board.replace(support=Cart(mass=mass, stiffness=stiffness))
    assert frequencies(board) == pytest.approx(frequencies(cart), rel=1e-13)
    sprung = board.replace(
        pendulum=[pendulum.replace(links=[pendulum.links[0].replace(stiffness=1.0)]) for pendulum in pendula]
    )
    held = cart.replace(pendulum=[pendulum.replace(position=(0.0, 0.0)) for pendulum in sprung.pendulum])
    assert frequencies(sprung)[-1] > 1.001 * frequencies(held)[-1]


def test_the_beam_of_the_two_clocks() -> None:
    bob = Bob(mass=2.0, length=0.25, stiffness=1.0)
    beam = Scene(
        gravity=9.81,
        support=Tilt(mass=10.0, inertia=0.5, centre=(0.0, -0.3), stiffness=300.0),
        pendulum=[Pendulum(links=[bob], position=(s, 0.6)) for s in (-0.4, 0.4)],
    )
    assert frequencies(beam) == pytest.approx([5.92062, 6.87314, 13.97826], rel=1e-6)


@SCENES
def test_every_scene_is_at_rest_as_drawn_and_its_energy_goes_into_dampers(name: str) -> None:
    """∂E/∂q·q' + ∂E/∂q'·q'' by differences in 50 digits is what drives, drag and dampers do: 0 without them."""
    scene = undriven(STRUCTURED[name]).conservative
    oracle = Oracle(scene)
    assert max(map(abs, oracle.unbalanced()), default=0) < 1e-13
    q, v = states(oracle.size, 1)
    with mp.workdps(50):
        a, h = oracle.accelerations(q, v), mp.mpf("1e-20")
        ahead, behind = (
            oracle.energy(
                [x + s * h * u for x, u in zip(q, v, strict=True)], [u + s * h * w for u, w in zip(v, a, strict=True)]
            )
            for s in (1, -1)
        )
        assert abs(ahead - behind) / (2 * h) < 1e-15
        assert abs(ahead - oracle.energy(q, [1.01 * u for u in v])) > 1e-3


def states(size: int, seed: int) -> tuple[Floats, Floats]:
    rng = np.random.default_rng(seed)
    return rng.uniform(-2.5, 2.5, size), rng.uniform(-4, 4, size)


# --------------------------------------------------------------------------------------------------------- symbols


@SCENES
def test_symbols_and_places_give_one_M_K_and_D(name: str) -> None:
    scene = undriven(STRUCTURED[name])
    for derived, exact in zip(symbolic_structure(scene).matrices(), Oracle(scene).matrices(), strict=True):
        assert derived.is_symmetric()
        assert all(entry.is_Rational for entry in derived)
        np.testing.assert_allclose(as_floats(derived), as_floats(exact), rtol=1e-14, atol=1e-14)


def as_floats(matrix: object) -> Floats:
    return np.array(matrix.tolist(), dtype=float)  # type: ignore[attr-defined]


@SCENES
def test_lagranges_equations_vanish_in_the_motion_of_all_masses(name: str) -> None:
    scene = undriven(STRUCTURED[name])
    oracle, system = Oracle(scene), symbolic_structure(scene)
    q, v = states(oracle.size, 2)
    a = oracle.accelerations(q, v)
    names = [part for c in system.coordinates for part in c]
    forms = sp.lambdify(names, [system.written_out(form) for form in system.equations()], "mpmath", cse=True)
    state = [part for parts in zip(q, v, a, strict=True) for part in parts]
    assert max(map(abs, forms(*state))) < 1e-12 * max(map(abs, a))
    wrong = [*state[:-1], state[-1] * (1 + 1e-6)]
    assert max(map(abs, forms(*wrong))) > 1e-9


@SCENES
def test_the_printed_kinetic_energy_is_that_of_all_velocities(name: str) -> None:
    system = symbolic_structure(undriven(STRUCTURED[name]))
    T = sp.Add(*(part.T for part in system.parts))
    assert vanishes(system.cartesian() - T)
    assert not vanishes(system.cartesian() - 2 * T)


def test_symbols_for_masses_springs_and_supports() -> None:
    """Two equal bobs with a spring: ω² = g/l and g/l + 2 k s²/(m l²)."""
    bob = Pendulum(links=[Bob(mass=1.0, length=1.0)], count=2)
    spring = Spring(between=("pendulum[0].copies[0].links[0]@0.5", "pendulum[0].copies[1].links[0]@0.5"), stiffness=5.0)
    scene = Scene(gravity=9.81, pendulum=[bob], spring=[spring])
    system = symbolic_structure(scene, ("masses", "lengths", "gravity", "springs"))
    (section,) = derive(system, ("modes",), scene)
    g, k, l, m = (sp.Symbol(name, positive=True) for name in ("g", "k_1", "l", "m"))
    squares = {sp.expand(line.formula.rhs) for line in section.lines if line.words != "shape"}
    assert squares == {g / l, g / l + k / (2 * m * l**2)}


def test_symbols_of_a_board_tell_when_it_is_in_balance() -> None:
    board = Tilt(name="board", mass=2.0, inertia=0.1)
    pendula = [Pendulum(links=[Bob(mass=1.0, length=0.5)], position=(s, 0.2)) for s in (-0.3, 0.3)]
    scene = Scene(gravity=9.81, support=board, pendulum=pendula)
    (section,) = derive(symbolic_structure(scene, ("masses", "supports")), ("matrices",))
    (line,) = (line for line in section.lines if "where" in line.words)
    first, second = (sp.Symbol(f"m_{p}", positive=True) for p in (1, 2))
    assert sp.solve(line.formula.lhs, first) == [second]
    assert sp.Symbol("I_board", positive=True) in section.lines[2].formula.rhs.free_symbols


def test_long_polynomials_are_left_out() -> None:
    scene = two_carts()
    long = scene.replace(pendulum=[pendulum.replace(count=9) for pendulum in scene.pendulum])
    (section,) = derive(symbolic_structure(long), ("polynomial",), long)
    assert [line.words for line in section.lines] == ["20 coordinates of a structure: too long to write out"]
    longest = scene.replace(pendulum=[pendulum.replace(count=21) for pendulum in scene.pendulum])
    with pytest.raises(SceneError, match="at most 40"):
        derive(symbolic_structure(longest))


def test_a_cart_alone_keeps_its_x() -> None:
    scene = Scene(
        gravity=9.81,
        support=Cart(mass=1.0),
        pendulum=[Pendulum(links=[Bob(mass=1.0, length=1.0)])],
        spring=[Spring(between=("cart", "ground"), stiffness=2.0)],
    )
    assert [str(c.q) for c in symbolic_structure(scene).coordinates] == ["x", "theta"]
    held = scene.replace(support=Cart(mass=1.0, stiffness=2.0), spring=())
    assert frequencies(scene) == pytest.approx(frequencies(held), rel=1e-15)


# ---------------------------------------------------------------------------------------------------- the linear side


@SCENES
def test_the_matrices_are_those_of_all_masses(name: str) -> None:
    scene = STRUCTURED[name]
    model, oracle = matrices(scene), Oracle(scene)
    for entries, exact in zip((model.M, model.K, model.D), map(as_floats, oracle.matrices()), strict=True):
        scale = np.sqrt(np.outer(np.diag(exact), np.diag(exact)))
        assert np.all(np.abs(entries - exact) <= 1e-14 * scale + 1e-16)
    assert list(model.labels[: oracle.carried]) == oracle.names


@SCENES
def test_frequencies_are_those_of_all_masses(name: str) -> None:
    scene = STRUCTURED[name].undriven.conservative
    modes = natural_modes(scene)
    assert np.repeat(modes.omega, modes.multiplicity) == pytest.approx(frequencies(scene), rel=1e-14)


SHARED = ["two-bobs", "crane-hook", "crane-two-loads", "metronomes", "tower", "two-swings", "cart-upright", "beam"]


@pytest.mark.parametrize("name", SHARED)
def test_numbers_that_are_equal_share_a_symbol(name: str) -> None:
    """With the numbers of its symbols a structure has the M, K and D of exact numbers."""
    scene, letters = load(name), Letters((EQUAL,))
    structure_with(scene, letters)
    system = structure_with(scene, letters)
    values = {at: rational(letters.values[at]) for at in system.symbols if str(at) != "g"}
    families = [(str(at).rstrip("0123456789"), value) for at, value in values.items()]
    assert len(set(families)) == len(families)
    values[next(at for at in system.symbols if str(at) == "g")] = sp.Rational(str(scene.gravity))
    numbers = symbolic_structure(scene).matrices()
    assert [part.subs(values) for part in system.matrices()] == list(numbers)


def test_the_textbooks_pendula_have_the_textbooks_roots() -> None:
    (section,) = derive(symbolic_structure(load("two-bobs"), (EQUAL,)), ("modes",))
    assert [plain(line.formula) for line in section.lines] == [
        *("ω^2 = g/l", "(θ1, θ2) = (1, 1)"),
        *("ω^2 = g/l + 2 k a^2/(m l^2)", "(θ1, θ2) = (1, -1)"),
    ]
    assert r"\omega^{2} = \frac{g}{l} + \frac{2 k a^{2}}{m l^{2}}" in section._repr_latex_()
    assert (
        r"K = \begin{bmatrix}m g l + k a^{2} & - k a^{2}"
        in symbolic_structure(load("two-bobs"), (EQUAL,))._repr_latex_()
    )


SHAPED = [("chain:2", "masses,lengths"), ("cart:3x1", "masses,lengths"), ("two-bobs", "equal"), ("two-bobs", "masses")]


@pytest.mark.parametrize(("name", "symbols"), SHAPED)
def test_shapes_solve_the_linear_equations(name: str, symbols: str) -> None:
    """(K − ω² M) q = 0 with other numbers for all symbols, at each frequency that stands before the shape."""
    system, scene = target(name, chosen=tuple(symbols.split(",")))
    (section,) = derive(system, ("modes",), scene)
    M, K, _ = system.matrices()
    values = {letter: sp.Rational(k + 3, k + 2) for k, letter in enumerate(sorted(system.symbols, key=str))}
    squares: set[Any] = set()
    count = 0
    for words, formula in section.lines:
        if "shape" not in words:
            middle, half = formula.rhs.args if isinstance(formula.rhs, PlusMinus) else (formula.rhs, 0)
            squares = {middle + half, middle - half}
            continue
        for square in squares:
            numbers = {**values, sp.Symbol("omega"): sp.sqrt(square.subs(values))}
            shape = sp.Matrix(formula.rhs).subs(numbers)
            left = (K - square * M).subs(values) * shape
            assert max(abs(complex(value)) for value in left.evalf(30)) < 1e-25
            count += 1
    assert count == len(system.coordinates) - (name == "cart:3x1") * 2  # one of two equal ones, and no translation


def test_a_single_link_has_the_books_letter_and_dampers_leave_the_undamped_polynomial() -> None:
    system, _ = target("chain:1")
    assert [str(c.q) for c in system.coordinates] == ["theta"]
    scene = load("tower")
    (section,) = derive(symbolic_structure(scene), ("polynomial",), scene)
    undamped = sp.Poly(section.lines[-1].formula.lhs.subs(sp.Symbol("omega") ** 2, sp.Symbol("x")))
    M, K, _ = structure_with(scene, Letters(())).matrices()
    expected = scipy.linalg.eigvalsh(np.array(K, dtype=float), np.array(M, dtype=float))
    assert section.lines[-1].words.startswith("without dampers")
    assert [float(root) for root in undamped.nroots(20)] == pytest.approx(expected, rel=1e-12)


def test_both_roots_stand_in_one_line_and_none_begins_with_a_minus() -> None:
    (section,) = derive(symbolic_structure(load("crane-two-loads"), (EQUAL,)), ("modes",))
    written = [plain(line.formula) for line in section.lines]
    assert written[0] == "ω^2 = 0"
    assert written[1].count("±") == 1
    assert not [formula for formula in written if "= -" in formula]
