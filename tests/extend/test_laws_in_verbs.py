"""A law of another package in fits, orbits, tuning, spreads and responses, each against equations written by hand."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp
from support.magnets import Magnet

from modal import Bob, Cart, InitialCondition, Pendulum, Scene, natural_modes
from modal.scene.parameters import vary
from modal.statespace import frequency_response, state_space, to_modal_form
from modal.tuning import tune
from modal.types import Floats
from nonlinear.identification import Recording, Segment, Sensor, fit
from nonlinear.orbits import mode_orbit
from nonlinear.sweeps import find_spread

G, L, S, ORDER = 9.81, 0.5, 0.4, Magnet.parameters[1].default or 0.0
PLACE = "pendulum[0].links[0].law.strength"


def magnetic_scene(**more: float) -> Scene:
    """A bob of 1 kg with a magnet at its joint."""
    bob = Bob(mass=1.0, length=L, law={"kind": "magnet", "strength": S}, **more)  # type: ignore[arg-type]
    return Scene(gravity=G, pendulum=[Pendulum(links=[bob], start=InitialCondition(angles_deg=[50.0]))])


def small_omega(strength: float | Floats) -> Floats:
    """The frequency (rad/s) of small motion."""
    return np.sqrt(G / L + ORDER * np.asarray(strength) / L**2)


def test_its_number_is_identified() -> None:
    """Of a record by hand, with noise."""

    def rates(t: float, y: Floats) -> list[float]:
        return [y[1], -G / L * np.sin(y[0]) - S / L**2 * np.sin(ORDER * y[0])]

    times = np.linspace(0, 3, 121)
    values = solve_ivp(rates, (0, 3), [np.radians(50.0), 0.0], t_eval=times, rtol=1e-11, atol=1e-12).y[0]
    values = values + 1e-3 * np.random.default_rng(1).standard_normal(len(times))
    recording = Recording((Sensor(1, 1),), (Segment("run", "", times, values[:, None]),))
    fitted = fit(vary(magnetic_scene(), {PLACE: 0.3}), recording, [PLACE])
    assert fitted.values[0] == pytest.approx(S, abs=4 * fitted.stds[0])
    assert fitted.stds[0] < 0.01


def test_its_orbit_has_the_period_of_a_quadrature() -> None:
    """∮ dθ/θ' with θ = a sin u."""
    a = 0.9

    def height(x: float) -> float:
        return float(-G * L * np.cos(x) - S / ORDER * np.cos(ORDER * x))

    def slowness(u: float) -> float:
        return float(a * np.cos(u) / np.sqrt(2 * (height(a) - height(a * np.sin(u))) / L**2))

    period = 4 * quad(slowness, 0, np.pi / 2, epsrel=1e-10)[0]
    assert mode_orbit(magnetic_scene(), 1, a).period == pytest.approx(period, rel=1e-6)


def test_its_number_is_tuned() -> None:
    """The most damping is where stiffness is least: ζ = d/(2 m l² ω)."""
    tuned = tune(magnetic_scene(damping=0.1), [f"{PLACE}=0.1:0.8"], maximize="damping")
    assert tuned.numbers[PLACE] == pytest.approx(0.1, rel=1e-6)
    ratio = natural_modes(tuned.scene)[0].damping_ratio
    assert ratio == pytest.approx(0.1 / (2 * L**2 * small_omega(0.1)), rel=1e-6)


def test_its_number_is_spread() -> None:
    spread = find_spread(magnetic_scene(), f"{PLACE}=0.1", members=8)
    np.testing.assert_allclose(spread.omega[:, 0], small_omega(spread.values[PLACE]), rtol=1e-12)


def test_its_response_is_that_of_matrices() -> None:
    """Of a cart with a spring, pushed."""
    scene = magnetic_scene(damping=0.1).replace(support=Cart(mass=2.0, stiffness=3.0))
    omega = np.array([0.5, 2.0, 5.5])
    form = to_modal_form(natural_modes(scene), state_space(scene, ("cart_force",), ("cart_position",)))
    response = frequency_response(form, omega)[0, 0]
    M, D = np.array([[3.0, L], [L, L**2]]), np.diag([0.0, 0.1])
    K = np.diag([3.0, G * L + ORDER * S])
    expected = [np.linalg.solve(K + 1j * w * D - w**2 * M, [1.0, 0.0])[0] for w in omega]
    np.testing.assert_allclose(response, expected, rtol=1e-9)
