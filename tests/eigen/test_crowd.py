"""The secular equation: against its own definition, against the effective mass, and in its cost."""

from __future__ import annotations

import mpmath as mp
import numpy as np
import pytest

from modal import Bob, Body, Cart, Pendulum, Scene, load, natural_modes
from modal.assembly import rig_of
from modal.eigen import Poles, degenerate_modes, secular, solve
from modal.eigen.chains import cart_shapes, fixed_squares
from modal.eigen.coupled import CartPendula, CoupledPendula
from modal.errors import ComputationError
from modal.modes import Modes


def random_crowd(seed: int, size: int = 40) -> Scene:
    rng = np.random.default_rng(seed)
    pendula = [
        Pendulum(links=[Body(mass=m, length=l, centre=c * l, inertia=i) for m, l, c, i in rng.uniform(0.3, 2, (n, 4))])
        for n in rng.integers(1, 4, size=size)
    ]
    mass = float(10 ** rng.uniform(-6, 6))
    return Scene(gravity=9.81, support=Cart(mass=mass, stiffness=float(rng.choice([0, 5.0]))), pendulum=pendula)


def problems(scene: Scene) -> tuple[CoupledPendula, CartPendula]:
    """The secular equation, and the effective mass."""
    rig, _ = rig_of(scene).natural()
    direct = CartPendula(rig)
    squares = tuple(fixed_squares(block).x for block in rig.blocks)
    return CoupledPendula(direct.blocks, direct.cart, squares, degenerate_modes(squares)), direct


@pytest.mark.parametrize("seed", range(20))
def test_two_routes_to_the_same_modes(seed: int) -> None:
    crowd, direct = problems(random_crowd(seed))
    x = crowd.squares
    np.testing.assert_allclose(x, direct.squares, rtol=1e-14)
    by_crowd = crowd.shapes(np.arange(len(x)), x)
    two = cart_shapes(direct.blocks, direct.cart, direct.squares)
    gap = np.diff(x, prepend=0, append=2 * x[-1])
    apart = np.minimum(gap[1:], gap[:-1]) / x
    for a, b in zip((by_crowd.cart[None, None], *by_crowd.turns), (two.cart[None, None], *two.turns), strict=True):
        scaled = [m * np.sign(s.cart) / np.sqrt(s.modal_mass) for m, s in ((a, by_crowd), (b, two))]
        assert np.all(np.abs(scaled[0] - scaled[1]).max((0, 1)) <= 1e-13 / apart * np.abs(scaled[1]).max())
    assert by_crowd.residual.max() < 1e-13


def many_digit_root(poles: Poles, anchor: int, offset: float) -> float:
    """The offset's root of f by Newton steps in 60 digits."""
    mp.mp.dps = 60
    square, weight = [[mp.mpf(v) for v in values] for values in (poles.square, poles.weight)]
    delta = mp.mpf(offset)
    for _ in range(4):
        far = [(s - square[anchor]) - delta for s in square]
        value = poles.constant + mp.fsum(w / d for w, d in zip(weight, far, strict=True))
        delta -= value / mp.fsum(w / d**2 for w, d in zip(weight, far, strict=True))
    return float(delta)


@pytest.mark.parametrize("spread", [1e-3, 1.0, 1e6])
def test_offsets_keep_their_own_digits(spread: float) -> None:
    """200 poles in clusters, weights over twenty decades: the far sums by tables, each root to 1e-10 of its offset."""
    rng = np.random.default_rng(3)
    centres = rng.uniform(1, 1 + spread, 8)
    square = np.sort((centres[:, None] + 1e-6 * rng.uniform(0, 1, (8, 25))).ravel())
    poles = Poles(square, 10.0 ** rng.uniform(-20, 0, 200), 0.5)
    roots = solve(poles)
    assert len(roots.offset) == 200
    for k in range(0, 200, 7):
        exact = many_digit_root(poles, roots.anchor[k], roots.offset[k])
        assert roots.offset[k] == pytest.approx(exact, rel=1e-9)


def test_roots_interlace_with_the_poles() -> None:
    rng = np.random.default_rng(1)
    square = np.sort(rng.uniform(0.9, 1.1, 5000))
    roots = solve(Poles(square, rng.uniform(0.5, 1.5, 5000) / 5000, 3.0))
    x = square[roots.anchor] + roots.offset
    assert np.all(np.diff(x) > 0)
    assert np.all((x[:-1] > square[:-1]) & (x[:-1] < square[1:]))
    assert x[-1] > square[-1]


def test_no_root_beyond_the_last_pole_without_inertia() -> None:
    roots = solve(Poles(np.array([1.0, 2.0]), np.array([1.0, 1.0]), 0.0))
    assert (1.0 + roots.offset if roots.anchor[0] == 0 else 2.0 + roots.offset) == pytest.approx([1.5])


def test_a_secular_equation_without_a_zero_raises() -> None:
    with pytest.raises(ComputationError, match="did not converge"):
        solve(Poles(np.array([1.0, 2.0]), np.array([np.nan, 1.0]), 1.0))


def test_thousand_pendula_take_the_secular_route() -> None:
    modes = natural_modes(load("thousand-pendula"))
    assert "secular equation" in modes.route
    assert len(modes) == 1001
    by_count = natural_modes_by_count(modes)
    np.testing.assert_allclose(modes.omega[1:], by_count, rtol=1e-14)
    row = modes[500]
    assert row.residual < 1e-12
    assert sum(r.cart_participation for r in modes) == pytest.approx(1, rel=1e-10)


def natural_modes_by_count(modes: Modes) -> np.ndarray:
    rig, units = modes.rig.natural()
    return np.sqrt(CartPendula(rig).squares) * units.rate


def test_two_thousand_equal_lengths_of_different_mass() -> None:
    """One mode moves the cart, ω² = (g/l)(1 + Σm/m_c); 1999 leave it still, whatever the masses."""
    masses = np.random.default_rng(0).uniform(0.5, 1.5, 2000).tolist()
    pendula = [Pendulum(links=(Bob(mass=m, length=1.0),)) for m in masses]
    modes = natural_modes(Scene(gravity=9.81, support=Cart(mass=7.0), pendulum=pendula))
    assert "secular equation" in modes.route
    assert modes.multiplicity.tolist() == [1, 1999, 1]
    np.testing.assert_allclose(modes.omega[1:] ** 2, [9.81, 9.81 * (1 + sum(masses) / 7.0)], rtol=1e-14)
    for copy in (0, 1, 700, 1998):
        shape = modes.shape(1, copy)
        assert shape.cart == 0.0
        assert abs(shape.angles @ masses) < 1e-12 * (np.abs(shape.angles) @ masses)


def test_nearly_equal_poles_are_not_taken_for_one_beyond_rounding() -> None:
    lengths = 1.0 + 2.0**-46 * np.arange(700)
    pendula = [Pendulum(links=(Bob(mass=1.0, length=float(l)),)) for l in lengths]
    modes = natural_modes(Scene(gravity=9.81, support=Cart(mass=7.0), pendulum=pendula))
    assert modes.multiplicity.max() == 1
    assert all(modes.omega[1:700] < np.sqrt(9.81 / lengths[0]) * (1 + 1e-15))


def terms_summed(size: int, monkeypatch: pytest.MonkeyPatch) -> int:
    """How many terms W/(λ − x) are summed one by one for `size` evenly spread poles."""
    seen = 0
    original = secular._Run._value

    def counted(run: secular._Run, anchor: np.ndarray, offset: np.ndarray) -> np.ndarray:
        nonlocal seen
        seen += len(anchor) * (run.pole_stop - run.pole_start)
        return original(run, anchor, offset)

    with monkeypatch.context() as patch:
        patch.setattr(secular._Run, "_value", counted)
        solve(Poles(np.linspace(0.9, 1.1, size), np.full(size, 1.0 / size), 1.0))
    return seen


def test_the_near_sums_grow_like_N(monkeypatch: pytest.MonkeyPatch) -> None:
    """Counted, not timed."""
    assert terms_summed(4000, monkeypatch) < 1.5 * 4 * terms_summed(1000, monkeypatch)
