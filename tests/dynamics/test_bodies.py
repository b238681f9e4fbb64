"""Three bodies, a dense matrix and a Taylor series for one set of equations: all agree, fast ones with all digits."""

from __future__ import annotations

import sys
from collections.abc import Callable
from importlib import import_module
from math import inf, pi
from typing import Any

import mpmath as mp
import numpy as np
import pytest
import scipy
from amounts import usually
from dense_form import DenseForm
from scenes import long_scene, motion_scene, random_state
from scipy.integrate import solve_ivp
from support.uncompiled import uncompiled

from modal import Bob, Cart, ComputationError, Pendulum, Rod, Scene, load, natural_modes, pair
from modal.errors import MissingExtraError
from modal.types import Floats
from nonlinear.dynamics import (
    Banded,
    Generated,
    Minimal,
    Recursion,
    compiled,
    compiling,
    forces,
    module_of,
)
from nonlinear.dynamics.compiled import Compiled
from nonlinear.dynamics.recursion import RecursiveLink, downward, upward
from nonlinear.integration import TIGHTEST, taylor
from nonlinear.integration.steppers import Pace
from nonlinear.integration.taylor import TaylorStepper
from nonlinear.simulation import simulate
from nonlinear.system import AppliedForces, State, system_of

fast = pytest.mark.skipif(not compiled.available(), reason="numba is not installed")
series = pytest.mark.skipif(not taylor.available(), reason="heyoka is not installed")


def minimal(scene: Scene, body: type = Recursion, load: object = None) -> Minimal:
    system = system_of(scene)
    return Minimal(system, tuple(body(group) for group in system.groups), load)


def random_y(equations: Minimal, seed: int = 0) -> Floats:
    return np.random.default_rng(seed).uniform(-3, 3, equations.layout.size)


def apart(values: Floats, expected: Floats) -> float:
    return float(np.max(np.abs(values - expected)) / np.max(np.abs(expected)))


def exact(scene: Scene, y: Floats) -> Floats:
    """θ'' of one chain without joints on a cart, by the recursion in 60 digits; the cart's x'' first."""
    (group,), cart = system_of(scene).groups, scene.support
    assert isinstance(cart, Cart)
    with mp.workdps(60):
        block, g = group.block, mp.mpf(scene.gravity)
        rows = zip(
            *(map(mp.mpf, getattr(block, name)[:, 0]) for name in ("mass", "length", "centre", "inertia")), strict=True
        )
        links = [
            RecursiveLink(m, l, m * c, I + m * c * c, I, I + m * (l - c) ** 2, I - m * c * (l - c))
            for m, l, c, I in rows
        ]
        angles, rates = (list(map(mp.mpf, part)) for part in (y[1 : group.n + 1], y[group.n + 2 :]))
        sides = upward(links, list(map(mp.sin, angles)), list(map(mp.cos, angles)), rates, [0] * group.n)
        x2 = -(sides[0].px - g * sides[0].xz) / (mp.mpf(cart.mass) + sides[0].xx)
        return np.array([x2, *downward(links, sides[1], x2, -g)], dtype=float)


@uncompiled()
@pytest.mark.parametrize("seed", range(60))
def test_bodies_agree(seed: int) -> None:
    plain = minimal(long_scene(seed))
    y = random_y(plain, seed)
    expected = plain.derivative(0.0, y)
    assert apart(DenseForm(plain.system).derivative(0.0, y), expected) < 1e-10
    assert apart(minimal(long_scene(seed), Banded).derivative(0.0, y), expected) < 1e-11
    if compiled.available():
        assert apart(Compiled(plain.system).derivative(0.0, y), expected) < 1e-14


@pytest.mark.parametrize("body", [Recursion, Banded])
@pytest.mark.parametrize("kind", [Bob, Rod])
@pytest.mark.parametrize(
    ("masses", "digits"),
    [
        ([10.0 ** (-8 * (k % 2)) for k in range(10)], 1e-10),
        ([10.0 ** (-8 * k / 9) for k in range(10)], 1e-13),
        ([10.0 ** (8 * k / 9 - 8) for k in range(10)], 1e-11),
        ([1.0] * 9 + [1e-8], 1e-13),
        ([1.0] * 9 + [1e8], 1e-6),
    ],
    ids=["alternating", "lighter", "heavier", "light tip", "heavy tip"],
)
def test_mass_ratios_of_1e8(masses: list[float], digits: float, kind: type, body: type) -> None:
    chain = Pendulum(links=[kind(mass=m, length=1.0) for m in masses])
    scene = Scene(gravity=9.81, support=Cart(mass=1.0), pendulum=[chain])
    equations = minimal(scene, body)
    for seed in range(3):
        y = random_y(equations, seed)
        assert apart(equations.derivative(0.0, y)[equations.layout.half :], exact(scene, y)) < digits


def test_a_thousand_links() -> None:
    scene = Scene(
        gravity=9.81, support=Cart(mass=3.0), pendulum=[Pendulum(links=[Rod(mass=1.0, length=1.0, count=1000)])]
    )
    plain = minimal(scene)
    y = random_y(plain)
    assert apart(minimal(scene, Banded).derivative(0.0, y), plain.derivative(0.0, y)) < 1e-12


def test_a_singular_band_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    equations = minimal(load("chain-3"), Banded)
    monkeypatch.setattr(scipy.linalg.lapack, "dgbsv", lambda *_, **__: (None, None, np.zeros((15, 2)), 7))
    with pytest.raises(ComputationError, match="equation 7"):
        equations.derivative(0.0, np.zeros(6))


# ------------------------------------------------------------------------------------------------------ compiled


def energy(equations: Minimal, y: Any) -> Any:
    """T + V (J) from A and b."""
    system, half, first = equations.system, equations.layout.half, equations.layout.first
    x, speed = (y[0], y[half]) if system.cart else (0.0, 0.0)
    total = (system.cart.mass * speed**2 + system.cart.stiffness * x**2) / 2 if system.cart else 0.0
    for group in system.groups:
        block, q, w = group.block, y[first:half][group.index], y[half + first :][group.index]
        A = np.array(pair.inertia_matrix(block.mass, block.length, block.centre, block.inertia))
        turning = np.sum(A * np.cos(q[:, None] - q) * w[:, None] * w) / 2
        sliding = block.mass.sum() * speed**2 / 2 + speed * np.sum(block.b * np.cos(q) * w)
        bend = forces.relative(q) - group.joint_rest
        total += (
            turning + sliding + np.sum(block.stiffness * bend**2) / 2 - system.gravity * np.sum(block.b * np.cos(q))
        )
    return total


@fast
@uncompiled()
@pytest.mark.parametrize("turned", [1e3, 1e6, 1e9])
def test_compiled_after_many_turns(turned: float) -> None:
    """Angles beyond those that the kernel reduces several at once keep their digits, too."""
    plain = minimal(load("paper-cart-3"))
    y = random_y(plain, 0)
    y[1 : plain.layout.half] += turned
    assert apart(Compiled(plain.system).derivative(0.0, y), plain.derivative(0.0, y)) < 1e-13


@fast
@uncompiled()
@pytest.mark.parametrize("seed", range(8))
def test_compiled_work_is_the_change_of_energy(seed: int) -> None:
    """The last component of y' is dE/dt along y', E from the pair, by a complex step."""
    equations = Compiled(system_of(long_scene(seed, 5)))
    y = random_y(equations, seed)
    rates = equations.derivative(0.0, y)
    rate = energy(equations, y + 1e-30j * rates).imag / 1e-30
    power = rates[-1] if equations.layout.works else 0.0
    assert abs(rate - power) < 1e-11 * energy(equations, np.abs(y)).real


def test_missing_numba_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(compiled, "available", lambda: False)
    assert not compiled.available()
    with pytest.raises(MissingExtraError, match=r"\.\[fast\]"):
        Compiled(system_of(load("chain-1")))


@fast
def test_compiled_without_a_place_for_its_cache(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where numba finds no folder to write to, what it compiles stays in memory."""
    for locator in import_module("numba.core.caching").CacheImpl._locator_classes:
        monkeypatch.setattr(locator, "from_function", classmethod(lambda *_: None))
    kernel = compiling.compiled(forces.joint_law)
    assert kernel(0.5, -2.0, 3.0, 4.0) == pytest.approx(forces.joint_law(0.5, -2.0, 3.0, 4.0), rel=1e-15)
    assert kernel.signatures
    assert kernel.stats.cache_path is None


# --------------------------------------------------------------------------------------------------------- small


@pytest.mark.parametrize("seed", range(40))
def test_one_dense_matrix_is_the_recursion(seed: int) -> None:
    scene = motion_scene(seed)

    def load(time: float, state: State) -> AppliedForces:
        moments = np.sin(time + np.arange(len(state.links)))
        return AppliedForces(2.0 * time if scene.support.kind == "cart" else 0.0, moments)

    system, state = system_of(scene), random_state(system_of(scene), seed)
    for pushed in (None, load):
        plain, dense = Minimal(system, tuple(map(Recursion, system.groups)), pushed), DenseForm(system, load=pushed)
        y = plain.begin(state)
        expected = plain.derivative(0.7, y)
        assert np.max(np.abs(dense.derivative(0.7, y) - expected)) < 1e-11 * np.max(np.abs(expected))


# -------------------------------------------------------------------------------------------------------- Taylor


def released(scene: Scene, angles_deg: list[float]) -> tuple[Minimal, Floats, float]:
    """The system, its y at rest at these angles, and the cap on its first step."""
    equations = minimal(scene)
    state = State(np.radians(angles_deg), np.zeros(len(angles_deg)))
    return equations, equations.begin(state), taylor.first_step(float(natural_modes(scene).omega.max()))


def by_series(equations: Minimal, y0: Floats, end: float, cap: float, tolerance: float = 1e-15) -> Floats:
    stepper = TaylorStepper(equations, y0, 0.0, end, tolerance, Pace(cap))
    while stepper.time < end:
        stepper.step()
    assert stepper.time == end
    return stepper.y


def by_runge_kutta(equations: Minimal, y0: Floats, end: float) -> Floats:
    return np.asarray(solve_ivp(equations.derivative, (0, end), y0, method="DOP853", rtol=2.3e-14, atol=1e-16).y[:, -1])


def chain(n: int, kind: type = Bob) -> Scene:
    return Scene(gravity=9.81, pendulum=[Pendulum(links=[kind(mass=1.0, length=1.0, count=n)])])


PAPER = [90.0, 90.0, -90.0, -90.0]
STARTS: dict[str, Callable[[], tuple[Minimal, Floats, float]]] = {
    "the paper's cart": lambda: released(load("paper-cart-2"), PAPER),
    "a bob at 90": lambda: released(chain(1), [90.0]),
    "three bobs at 90": lambda: released(chain(3), [90.0] * 3),
    "all but standing": lambda: released(chain(2, Rod), [180 - 1e-9] * 2),
    "hanging still": lambda: released(chain(2), [0.0] * 2),
}


@series
@pytest.mark.parametrize("tolerance", [1e-15, 2.3e-16])
@pytest.mark.parametrize("name", STARTS)
def test_series_from_rest(name: str, tolerance: float) -> None:
    equations, y0, cap = STARTS[name]()
    end = 0.7
    expected = by_runge_kutta(equations, y0, end)
    assert np.max(np.abs(by_series(equations, y0, end, cap, tolerance) - expected)) < 1e-11
    assert np.max(np.abs(by_series(equations, y0, end, inf, tolerance) - expected)) < 1e-11


@series
def test_the_trap() -> None:
    """heyoka on its own is wrong in the third digit; so the tests above fail where both guards are taken away."""
    import heyoka

    equations, y0, cap = STARTS["the paper's cart"]()
    expected = by_runge_kutta(equations, y0, 0.7)

    def at(first: float) -> float:
        written = Generated(equations.system)
        rates = taylor.expressions(module_of(written.form), written.layout.size)
        alone = heyoka.taylor_adaptive(rates, y0, compact_mode=True, pars=written.constants)
        assert alone.order % 4 == 0
        alone.step(max_delta_t=first)
        alone.propagate_until(0.7)
        return float(np.max(np.abs(alone.state - expected)))

    assert at(inf) > 1e-3
    assert at(cap) < 1e-11


def test_no_order_is_a_multiple_of_four() -> None:
    for tolerance in 10.0 ** np.linspace(-16, -3, 200):
        used = taylor.uneven(tolerance)
        assert np.ceil(1 - np.log(used) / 2) % 4
        assert used in (tolerance, TIGHTEST) or 0.1 < used / tolerance <= 1


def test_the_first_step() -> None:
    assert taylor.first_step(2.0) == pytest.approx(pi / 20)
    assert taylor.first_step(0.0) == inf


@series
@pytest.mark.parametrize("seed", usually([4], [1, 4, 7]))
def test_series_of_damped_and_sprung_scenes(seed: int) -> None:
    equations = minimal(long_scene(seed, 3))
    y0 = random_y(equations, seed)
    y0[-1] = 0.0 if equations.layout.works else y0[-1]
    expected = by_runge_kutta(equations, y0, 0.2)
    assert apart(by_series(equations, y0, 0.2, inf), expected) < 1e-11


@series
def test_the_first_step_is_capped() -> None:
    """Of a pendulum at rest every coefficient is zero: heyoka would step to the end at once."""
    equations, y0, cap = STARTS["hanging still"]()
    stepper = TaylorStepper(equations, y0, 0.0, 2.5, 1e-12, Pace(cap))
    stepper.step()
    assert stepper.time == pytest.approx(cap)
    stepper.step()
    assert stepper.time == 2.5


@series
def test_small_motions_keep_their_digits() -> None:
    """Seven digits of an angle of 1e-9 rad, by either integrator."""
    scene = chain(1)
    for method in ("taylor", "DOP853"):
        run = simulate(scene, 20, start=State(np.array([1e-9]), np.zeros(1)), method=method, tolerance=1e-11)
        exact = 1e-9 * np.cos(np.sqrt(9.81) * run.times)
        assert abs(run.motion.links[:, 0] - exact).max() < 1e-7 * 1e-9
        assert run.energy_drift() < 1e-7


@series
def test_a_light_cart_does_not_hold_the_series_up() -> None:
    scene = Scene(gravity=9.81, support=Cart(mass=1e-6), pendulum=chain(1).pendulum)
    run = simulate(scene, 2, start=State(np.array([0.7]), np.zeros(1)), method="taylor")
    assert run.run.steps < 1000
    assert run.energy_drift() < 1e-8


@series
def test_series_between_the_steps() -> None:
    equations, y0, cap = STARTS["the paper's cart"]()
    stepper = TaylorStepper(equations, y0, 0.5, 2.0, 1e-15, Pace(cap))
    assert np.array_equal(stepper.exact(0.5), y0)
    for _ in range(3):
        start = stepper.time, stepper.y
        stepper.step()
    middle = (start[0] + stepper.time) / 2
    inside = stepper.inside(np.array([start[0], middle, stepper.time]))
    assert inside.shape == (3, 10)
    assert np.max(np.abs(inside[0] - start[1])) < 1e-15
    assert np.max(np.abs(inside[2] - stepper.y)) < 1e-13
    assert np.max(np.abs(inside[1] - by_runge_kutta(equations, y0, middle - 0.5))) < 1e-12
    assert stepper.calls == 3


@series
def test_series_refuse() -> None:
    y = np.zeros(2 * (taylor.LONGEST_CHAIN + 1))
    with pytest.raises(ComputationError, match="at most 24 links a chain and 400 in all, not 25 and 25"):
        TaylorStepper(minimal(chain(25)), y, 0.0, 1.0, 1e-15, Pace())
    with pytest.raises(ComputationError, match="load"):
        TaylorStepper(minimal(chain(1), load=lambda *_: AppliedForces()), np.zeros(3), 0.0, 1.0, 1e-15, Pace())
    stepper = TaylorStepper(minimal(chain(1)), np.array([np.nan, 0.0]), 0.0, 1.0, 1e-15, Pace(0.1))
    with pytest.raises(ComputationError, match="its series overflow"):
        stepper.step()


def test_missing_heyoka_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "heyoka", None)
    with pytest.raises(MissingExtraError, match=r"\.\[taylor\]"):
        TaylorStepper(minimal(chain(1)), np.zeros(2), 0.0, 1.0, 1e-15, Pace())
