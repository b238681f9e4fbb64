"""The linear model along a hoist: frequencies, swing, the promise of shapers, and files."""

from io import BytesIO
from typing import Any

import hoists
import numpy as np
import pytest
from control_scenes import model_at
from scipy.integrate import solve_ivp
from scipy.io import loadmat
from scipy.special import jv, yv

from modal import load, natural_frequencies, natural_modes
from modal.errors import ComputationError, SceneError
from modal.exports import FORMATS, find_format
from modal.plotting.response import hoist_figure
from modal.scene import Bob, Cart, Fixed, Hoist, Pendulum, Scene, Spring, Swing
from modal.statespace import minimal, shaper_for, state_space, swings_of
from modal.statespace.hoisting import (
    Travel,
    frequencies_along,
    mean_lengths,
    residual_words,
    shaper_residual,
    travel_residuals,
)
from modal.statespace.sampling import hoisting_times, varying_model
from nonlinear.simulation import simulate
from nonlinear.system import AppliedForces, State

G = 9.81


def crane(mass: float = 1e9, **hoist: object) -> Scene:
    bob = Bob(mass=1.0, length=4.0, hoist=Hoist(**({"to": 1.0, "duration": 5.0} | hoist)))
    return Scene(gravity=G, support=Cart(mass=mass), pendulum=(Pendulum(links=(bob,)),))


def test_frequencies_and_swing_of_one_pendulum() -> None:
    curve = frequencies_along(crane(), 7, "cart_acceleration")
    assert np.allclose(curve.omega[:, 0], np.sqrt(G / curve.lengths[:, 0]), rtol=1e-12)
    assert np.allclose(curve.swing[:, 0], (curve.lengths[:, 0] / 4.0) ** -0.75, rtol=1e-12)
    assert curve.lengths[[0, -1], 0] == pytest.approx([4.0, 1.0])
    assert curve.names == ("1",)


def test_frequencies_are_those_of_the_table_at_each_length() -> None:
    scene = load("hoisting-crane")
    curve = frequencies_along(scene, 5)
    assert curve.names == ("2", "3")
    for time, omega in zip(curve.times.tolist(), curve.omega, strict=True):
        assert np.allclose(omega, natural_modes(scene.at(time)).omega[1:], rtol=1e-11)
    rail = scene.replace(support=scene.support.replace(damping=40.0))
    damped = frequencies_along(rail, 3)
    assert np.array_equal(damped.omega, frequencies_along(scene, 3).omega)
    assert damped.names == ("3", "4"), "the cart that creeps on its damper is mode 2 of the table"
    assert np.allclose(damped.omega[0], natural_modes(rail.at(0.0)).omega[2:], rtol=1e-3)
    held = frequencies_along(scene, 3, "cart_acceleration")
    assert held.names == ("1", "2")
    assert np.allclose(held.omega[0], [swing.omega for swing in swings_of(scene.at(0.0))], rtol=1e-11)


def test_a_slow_hoist_changes_the_swing_as_the_adiabatic_invariant_says() -> None:
    scene = crane(duration=60.0)
    run = simulate(
        Scene(gravity=G, pendulum=scene.pendulum), 70.0, start=State(np.array([1e-4]), np.zeros(1)), output=4000
    )
    end = np.abs(run.motion.links[run.times > 62.0]).max() / 1e-4
    assert end == pytest.approx(frequencies_along(scene, 2, "cart_acceleration").swing[-1, 0], rel=2e-3)


def test_the_model_of_one_pendulum_is_the_textbook_equation() -> None:
    scene = crane()
    varying = varying_model(scene, inputs=("cart_acceleration",))
    law = scene.pendulum[0].links[0].hoist.law(4.0)
    length, speed, _ = law(varying.times)
    assert varying.A.shape == (201, 4, 4)
    assert varying.B.shape == (201, 4, 1)
    assert np.allclose(varying.A[:, 3, 1], -G / length, rtol=1e-12)
    assert np.allclose(varying.A[:, 3, 3], -2 * speed / length, rtol=1e-12, atol=1e-15)
    assert np.allclose(varying.B[:, 3, 0], -1 / length, rtol=1e-12)
    assert varying.C.shape == (2, 4)
    assert varying_model(scene, [0.0, 2.5], outputs=("tip_positions",)).C.ndim == 3


def test_lewins_pendulum_is_the_solution_of_the_model() -> None:
    """In the middle of a trapezoidal hoist the speed is constant: Bessel functions satisfy z' = A(t) z there."""
    scene = crane(profile="trapezoidal", ramp=0.2)
    law = scene.pendulum[0].links[0].hoist.law(4.0)
    length, speed, bend = (float(part) for part in law(2.5))
    assert bend == 0
    x = 2 * np.sqrt(G * length) / abs(speed)
    turned = 2 * G / (abs(speed) * x) * np.sign(speed)
    for bessel in (jv, yv):
        angle, rate = bessel(1, x) / x, -bessel(2, x) / x * turned
        # with (Z₁/x)' = −Z₂/x, (Z₂/x)' = Z₁/x − 3 Z₂/x² and x'' = −x'²/x
        second = turned**2 * (4 * bessel(2, x) / x**2 - bessel(1, x) / x)
        A = model_at(scene, 2.5, ("cart_acceleration",)).A
        assert A[3] @ [0, angle, 0, rate] == pytest.approx(second, rel=1e-9)


def test_travel_is_that_of_the_full_equations_at_small_angles() -> None:
    scene, travel = crane(), Travel(0.01, 0.0, 4.0)
    residuals = {residual.words: residual.angle for residual in travel_residuals(scene, travel)}
    heavy = scene.support.mass

    def push(time: float, state: State) -> AppliedForces:
        return AppliedForces(heavy * travel.motion(np.array([time]))[2, 0])

    rest = State(np.zeros(1), np.zeros(1))
    run = simulate(scene, 12.0, start=rest, load=push, breaks=[0.0, 4.0], tolerance=1e-11, output=4000)
    left = np.abs(run.motion.links[run.times > 5.0]).max()
    assert residuals["unshaped"] == pytest.approx(left, rel=1e-4)
    constant = residuals["unshaped, without the hoist"]
    still = simulate(scene.at(0.0), 12.0, start=rest, load=push, breaks=[0.0, 4.0], tolerance=1e-11, output=4000)
    assert constant == pytest.approx(np.abs(still.motion.links[still.times > 4.0]).max(), rel=1e-4)


def test_a_shaper_keeps_its_promise_without_hoist_and_loses_it_with() -> None:
    nearly = crane(to=4.0 * (1 + 1e-9), duration=1.0)
    assert shaper_residual(nearly, shaper_for(nearly.at(0.0))) < 1e-6
    scene = crane(duration=3.0)
    left = shaper_residual(scene, shaper_for(scene.at(0.0)))
    assert 0.01 < left < 2
    words = list(residual_words(scene, 1, "zv", "cart_acceleration", shaper_for(scene.at(0.0))))
    assert f"{100 * left:.3g} %" in words[1]


@pytest.mark.parametrize(("begin", "drag"), [(0.0, 0.0), (100.0, 5.0)])
def test_a_travel_begins_with_the_hoist_and_drags_the_bob(begin: float, drag: float) -> None:
    """Newton's law across the rope: l θ'' + 2 l' θ' + g θ + (d/m)(l θ' + x') = −x'', without a term of d l'."""
    mass = 20.0
    bob = Bob(mass=mass, length=4.0, drag=drag, hoist=Hoist(to=2.0, begin=begin, duration=3.0))
    scene = Scene(gravity=G, support=Cart(mass=100.0), pendulum=(Pendulum(links=(bob,)),))
    place = np.polynomial.Polynomial([0, 0, 0, 10, -15, 6])

    def slope(s: float, y: np.ndarray) -> list[float]:
        shape, rate, bend = (float(place.deriv(k)(s / 3.0)) / 3.0**k for k in range(3))
        length, speed = 4.0 - 2.0 * shape, -2.0 * rate
        drawn = drag / mass * (length * y[1] + 3.0 * rate)
        return [y[1], -(2 * speed * y[1] + G * y[0] + drawn + 3.0 * bend) / length]

    end = solve_ivp(slope, (0.0, 3.0), [0.0, 0.0], "DOP853", rtol=1e-12, atol=1e-14).y[:, -1]
    left = travel_residuals(scene, Travel.along(scene, 3.0))[0]
    assert left.angle == pytest.approx(np.hypot(end[0], end[1] / np.sqrt(G / 2.0)), rel=1e-8)


@pytest.mark.parametrize("seed", range(5))
def test_models_frequencies_and_swing_are_those_of_newtons_equations(seed: int) -> None:
    """Ropes of bobs with linear and quadratic drag, dampers and springs, on a cart that is held or free."""
    scene, oracle, _ = hoists.draw(seed)
    for drive in ("cart_acceleration", "cart_force"):
        trials = [
            *hoists.model(scene, oracle, drive, np.random.default_rng(seed)),
            *hoists.tables(scene, oracle, drive),
        ]
        assert not [trial for trial in trials if trial.broken]


def test_travels_and_shapers_leave_what_newtons_equations_leave() -> None:
    scene, oracle, travel = hoists.draw(116)
    trials = [*hoists.travelling(scene, oracle, travel), *hoists.shaping(scene, oracle, "cart_force")]
    assert not [trial for trial in trials if trial.broken]


def test_pendula_beside_a_cart_that_is_held_are_followed_apart() -> None:
    """A rope that grows shorter than its neighbour keeps its own swing, l^(−3/4), though their frequencies cross."""
    rope, still = crane().pendulum[0], Pendulum(links=(Bob(mass=1.0, length=2.0),))
    scene = Scene(gravity=G, support=Cart(mass=9.0), pendulum=(rope.replace(count=2), still))
    curve = frequencies_along(scene, 3, "cart_acceleration")
    assert curve.names == ("1", "1b", "2")
    assert curve.swing[-1] == pytest.approx([4.0**0.75, 4.0**0.75, 1.0], rel=1e-12)
    free = frequencies_along(scene, 3)
    alone = free.swing[-1, np.argmin(abs(free.omega[0] - np.sqrt(G / 4.0)))]
    assert alone == pytest.approx(4.0**0.75, rel=1e-12), "two equal ropes against each other leave the cart still"


def test_a_massless_cart_has_the_modes_that_it_has() -> None:
    """Its upper rope stays vertical: none of a single bob, g (m₁ + m₂)/(m₁ l₂) of two, whatever the upper length."""
    bob = Bob(mass=2.0, length=4.0, hoist=Hoist(to=2.0, duration=3.0))
    scene = Scene(gravity=G, support=Cart(mass=0.0), pendulum=(Pendulum(links=(bob,)),))
    curve = frequencies_along(scene, 3)
    assert curve.omega.shape == curve.swing.shape == (3, 0)
    assert frequencies_along(scene, 3, "cart_acceleration").omega[-1] == pytest.approx([np.sqrt(G / 2)], rel=1e-12)
    assert len(hoist_figure(curve).axes) == 1
    heavy = scene.replace(support=Cart(mass=7.0))
    travel = Travel.along(scene, 3.0, 2.0)
    assert travel_residuals(scene, travel)[0].angle == pytest.approx(travel_residuals(heavy, travel)[0].angle, rel=1e-9)
    two = scene.replace(pendulum=(Pendulum(links=(bob, Bob(mass=1.0, length=1.0))),))
    assert frequencies_along(two, 3).omega == pytest.approx(np.full((3, 1), np.sqrt(1.5 * G)), rel=1e-12)
    with pytest.raises(ComputationError, match="singular"):
        shaper_residual(two, shaper_for(two.at(0.0)), "cart_force")


def test_a_support_that_moves_is_seen_from_the_laboratory() -> None:
    """The bob of one rope has the acceleration −(g − l'') θ, whatever moves its support."""
    scene = Scene(gravity=G, support=Fixed(), pendulum=crane().pendulum)
    model = model_at(scene, 1.2, ("support_acceleration",), ("tip_accelerations", "pivot_forces"))
    bend = scene.pendulum[0].links[0].hoist.law(4.0)(1.2)[2]
    states = [signal.name for signal in model.states]
    expected = np.where(np.array(states) == "theta_1_1", -(G - bend), 0.0)
    assert pytest.approx(np.array([expected, -expected]), abs=1e-13) == model.C
    assert pytest.approx(np.zeros((2, 1)), abs=1e-13) == model.D
    for jumping in ("support_velocity", "support_displacement"):
        with pytest.raises(SceneError, match="mass matrix; use support_acceleration"):
            varying_model(scene, inputs=(jumping,))


def test_mean_lengths_are_averages_over_time() -> None:
    assert mean_lengths(crane()).pendulum[0].links[0].length == pytest.approx(2.5, rel=1e-9)
    assert not mean_lengths(crane()).is_hoisted


@pytest.mark.parametrize("name", sorted(FORMATS))
def test_models_along_a_hoist_are_written_or_refused(name: str) -> None:
    varying = varying_model(load("hoisting-crane"), np.linspace(0, 8, 5))
    if name not in {"npz", "mat", "control"}:
        with pytest.raises(SceneError, match=f"format {name}: holds a constant model"):
            find_format(name).write_varying(varying)
        return
    content = find_format(name).write_varying(varying)
    read: dict[str, Any] = {}
    if name == "control":
        exec(content, read)
        read |= {"C": read["C"][0], "D": read["D"][0], "time_s": read["times"]}
    else:
        read = np.load(BytesIO(content)) if name == "npz" else loadmat(BytesIO(content))
    for key, values in (("A", varying.A), ("B", varying.B), ("C", varying.C), ("D", varying.D)):
        assert np.array_equal(read[key], values)
    assert np.array_equal(np.ravel(read["time_s"]), varying.times)


def test_constant_models_and_other_scenes_are_refused() -> None:
    scene = load("hoisting-crane")
    for refused in (lambda: state_space(scene), lambda: minimal(scene)):
        with pytest.raises(SceneError, match="constant linear model"):
            refused()
    with pytest.raises(SceneError, match="cart_velocity"):
        varying_model(scene, inputs=("cart_velocity",))
    with pytest.raises(SceneError, match="ascending"):
        varying_model(scene, [1.0, 0.5])
    for call in (hoisting_times, frequencies_along, varying_model):
        with pytest.raises(SceneError, match="no link of this scene has one"):
            call(load("crane-hook"))
    with pytest.raises(SceneError, match="support is fixed"):
        travel_residuals(Scene(gravity=G, pendulum=crane().pendulum), Travel(1.0, 0.0, 1.0))
    upright = crane().pendulum[0].replace(equilibrium=("up",))
    with pytest.raises(ComputationError, match="unstable"):
        frequencies_along(Scene(gravity=G, pendulum=(upright,)))


# ------------------------------------------------------------------------------------------------------ on structures


def towed() -> Scene:
    """A cart next to a swing, each with loads on ropes that are hoisted."""
    rope = Bob(mass=2.0, length=1.5, hoist=Hoist(to=0.8, begin=0.5, duration=3.0))
    return Scene(
        gravity=9.81,
        support=[Cart(name="truck", mass=3.0, stiffness=6.0), Swing(name="stage", mass=2.0, length=0.7)],
        pendulum=[Pendulum(on="truck", links=[rope], count=2), Pendulum(on="stage", links=[rope])],
        spring=[Spring(between=("truck", "stage"), stiffness=20.0)],
    )


def test_frequencies_along_a_hoist_of_a_structure_are_those_at_each_time() -> None:
    along = frequencies_along(towed(), samples=3)
    for time, omega in zip(along.times.tolist(), along.omega, strict=True):
        assert np.allclose(np.sort(omega), natural_frequencies(towed().at(time)), rtol=1e-12)


def test_a_shaper_leaves_nothing_where_the_lengths_of_a_structure_stay() -> None:
    """An impulse on one coordinate, at lengths that hardly change: the promise for constant lengths is kept."""
    scene = towed()
    slow = Hoist(to=1.5 * (1 - 1e-7), begin=0.0, duration=1.0)
    pendula = [pendulum.replace(links=[pendulum.links[0].replace(hoist=slow)]) for pendulum in scene.pendulum]
    scene = scene.replace(pendulum=pendula)
    drive = "stage_force"
    made = shaper_for(scene.at(0.0), 4, "zv", drive)
    assert shaper_residual(scene, made, drive) < 1e-5
    assert shaper_residual(scene, shaper_for(scene.at(0.0), 1, "zv", drive), drive) > 1e-2
