"""Random vibration against Lyapunov's equation, Miles' equation, quadrature and simulated histories."""

from __future__ import annotations

from itertools import pairwise
from math import pi, sqrt, tau

import mpmath as mp
import numpy as np
import pytest
from scenes import mild_scene
from scipy.integrate import solve_ivp
from scipy.linalg import expm, solve_continuous_lyapunov

from modal import Bob, Cart, ComputationError, Fixed, Pendulum, Scene
from modal.scene.records import Spectrum
from modal.statespace import frequency_response, state_space
from modal.vibration import RandomResponse, random_response

HELD = Fixed()
WHITE = Spectrum((0.0, 1e5), (2.0, 2.0), "acceleration")


def oscillator(damping: float) -> Scene:
    return Scene(gravity=9.81, pendulum=(Pendulum(links=(Bob(mass=2.0, length=0.5, damping=damping),)),))


def double(damping: float, support: Fixed | Cart = HELD) -> Scene:
    links = (Bob(mass=1.3, length=0.8, damping=damping), Bob(mass=0.4, length=0.5, damping=damping))
    return Scene(gravity=9.81, support=support, pendulum=(Pendulum(links=links),))


@pytest.mark.parametrize("damping", [0.1, 1e-3, 1e-6])
def test_white_noise_through_one_mode_is_its_closed_form(damping: float) -> None:
    """θ'' + 2ζωθ' + ω²θ = −a/l: σ_θ² = S / (8 ζ ω³ l²) for the one-sided S in (m/s²)²/Hz."""
    response = random_response(oscillator(damping), WHITE, ("angles", "rates"))
    omega = sqrt(9.81 / 0.5)
    zeta = damping / (2.0 * 0.5**2) / (2 * omega)
    exact = sqrt(2.0 / (8 * zeta * omega**3 * 0.5**2))
    assert response.rms[0] == pytest.approx(exact, rel=1e-9)
    assert response.rms[1] == pytest.approx(omega * exact, rel=2e-5)
    assert response.white[0] == pytest.approx([exact, omega * exact], rel=1e-12)
    assert response.by_mode[0] == pytest.approx(response.rms, rel=1e-12)


def test_miles_equation() -> None:
    """The acceleration of an oscillator, ω² times its displacement, is √(π f Q S/2)."""
    response = random_response(oscillator(0.01), WHITE, ("angles",))
    omega = sqrt(9.81 / 0.5)
    Q = omega * 2.0 * 0.5**2 / 0.01
    assert omega**2 * 0.5 * response.rms[0] == pytest.approx(sqrt(pi / 2 * omega / tau * Q * 2.0), rel=1e-6)


@pytest.mark.parametrize("support", [Fixed(), Cart(mass=2.0, stiffness=20.0, damping=0.5)])
@pytest.mark.parametrize("damping", [0.1, 1e-4])
def test_white_noise_is_the_lyapunov_equation(damping: float, support: Fixed | Cart) -> None:
    scene = double(damping, support)
    wanted = ("angles", "relative_angles")
    model = state_space(scene, ("support_acceleration",), wanted)
    moving = [k for k, signal in enumerate(model.states) if not signal.name.startswith("support")]
    A, B, C = model.A[np.ix_(moving, moving)], model.B[moving], model.C[:, moving]
    covariance = solve_continuous_lyapunov(A, -B @ B.T)  # a one-sided PSD of 2 per hertz is an intensity of 1
    response = random_response(scene, WHITE, wanted)
    assert response.rms == pytest.approx(np.sqrt(np.diag(C @ covariance @ C.T)), rel=1e-5 if damping > 0.01 else 1e-8)


@pytest.mark.parametrize("seed", range(3))
def test_a_coloured_psd_is_the_integral_of_the_response(seed: int) -> None:
    scene = mild_scene(seed, damping=0.05).replace(support=Fixed(), space="plane")
    spectrum = Spectrum((0.1, 0.7, 2.0, 9.0), (1.0, 0.3, 2.0, 0.1), ("acceleration", "velocity", "displacement")[seed])
    response = random_response(scene, spectrum, ("angles",))
    edges = sorted({*spectrum.frequency_hz, *(f for f in response.modes.omega / tau if 0.1 < f < 9.0)})
    ends = np.unique(np.concatenate([np.linspace(low, high, 41) for low, high in pairwise(edges)]))
    nodes, weights = np.polynomial.legendre.leggauss(24)
    f = (ends[:-1, None] + ends[1:, None] + np.diff(ends)[:, None] * nodes) / 2
    total = response.psd(f.ravel())[0] @ (np.diff(ends)[:, None] * weights / 2).ravel()
    assert response.rms[0] ** 2 == pytest.approx(total, rel=1e-7)


def test_a_psd_of_displacement_is_one_of_acceleration() -> None:
    f = np.geomspace(0.1, 30.0, 40)
    of = [
        random_response(double(0.05), Spectrum(tuple(f), tuple((S * (tau * f) ** -p).tolist()), what)).rms
        for S, p, what in ((3.0, 0, "acceleration"), (3.0, 2, "velocity"), (3.0, 4, "displacement"))
    ]
    assert of[1] == pytest.approx(of[0], rel=1e-12)
    assert of[2] == pytest.approx(of[0], rel=1e-12)


def test_an_undamped_mode_has_no_finite_rms() -> None:
    reached = random_response(double(0.0), Spectrum((0.1, 10.0), (1.0, 1.0), "acceleration"), ("angles",))
    assert np.all(np.isinf(reached.rms))
    assert np.all(np.isinf(reached.by_mode))
    assert "modes 1, 2 are undamped" in reached.words[0]
    beyond = random_response(double(0.0), Spectrum((3.0, 10.0), (1.0, 1.0), "acceleration"), ("angles",))
    assert np.all(np.isfinite(beyond.rms))
    assert not beyond.words
    response = random_response(double(0.0), Spectrum((0.4, 0.8), (1.0, 1.0), "acceleration"), ("angles",))
    assert np.isinf(response.by_mode[0, 0])
    assert np.isfinite(response.by_mode[1, 0])


def test_a_mode_that_the_noise_does_not_reach_is_silent() -> None:
    """Two equal pendula on a free cart, which the ground does not move at all."""
    pair = double(0.0, Cart(mass=3.0))
    pair = pair.replace(pendulum=(pair.pendulum[0].replace(count=2),))
    response = random_response(pair, Spectrum((0.1, 10.0), (1.0, 1.0), "acceleration"), ("angles", "cart_position"))
    assert response.rms == pytest.approx(np.zeros(5), abs=1e-12)
    assert not response.words
    held = pair.replace(support=Cart(mass=3.0, damping=1.0))
    damped = random_response(held, Spectrum((0.1, 10.0), (1.0, 1.0), "acceleration"), ("angles",))
    assert np.all(np.isfinite(damped.rms))


def test_too_many_modes_and_outputs_are_refused() -> None:
    rope = Scene(gravity=9.81, pendulum=(Pendulum(links=(Bob(mass=1.0, length=0.1, damping=0.1, count=180),)),))
    with pytest.raises(ComputationError, match="choose fewer outputs"):
        random_response(rope, WHITE, ("angles",))


def test_a_position_in_the_laboratory_drifts_under_white_noise() -> None:
    response = random_response(double(0.1), WHITE, ("tip_positions",))
    assert np.isinf(response.rms[0])
    assert "0 Hz" in response.words[0]


def test_what_grows_by_itself_is_refused() -> None:
    standing = oscillator(0.1).pendulum[0].replace(equilibrium=("up",))
    with pytest.raises(ComputationError, match=r"mode \d grows"):
        random_response(oscillator(0.1).replace(pendulum=(standing,)), WHITE)


def test_two_hundred_histories_have_that_rms() -> None:
    """Exact steps of the linear equations under white noise: the covariance of a step is an integral of expm."""
    scene = double(0.2)
    model = state_space(scene, ("support_acceleration",), ("angles",))
    moving = [k for k, signal in enumerate(model.states) if not signal.name.startswith("support")]
    A, B, C = model.A[np.ix_(moving, moving)], model.B[moving], model.C[:, moving]
    step = 0.05
    n = len(A)
    block = expm(np.block([[-A, B @ B.T], [np.zeros((n, n)), A.T]]) * step)
    forward = block[n:, n:].T
    noise = np.linalg.cholesky(forward @ block[:n, n:] + 1e-18 * np.eye(n))
    rng = np.random.default_rng(3)
    z, squares, count = np.zeros((n, 200)), np.zeros(len(C)), 0
    for k in range(4000):
        z = forward @ z + noise @ rng.normal(size=(n, 200))
        if k > 1000:
            squares, count = squares + np.mean((C @ z) ** 2, axis=1), count + 1
    assert random_response(scene, WHITE, ("angles",)).rms == pytest.approx(np.sqrt(squares / count), rel=0.02)


def test_a_realization_has_that_rms() -> None:
    """The steady response to the sum of sines of a random support, over one of its durations."""
    from modal.scene import RandomMotion
    from modal.vibration import prescribed_motion

    scene, f, S = double(0.5), (0.2, 1.0, 6.0), (0.5, 2.0, 0.1)
    model = state_space(scene, ("support_acceleration",), ("angles",))
    moving = [k for k, signal in enumerate(model.states) if not signal.name.startswith("support")]
    A, B, C = model.A[np.ix_(moving, moving)], model.B[moving], model.C[:, moving]
    motion = prescribed_motion(RandomMotion(psd=S, frequency_hz=f, seed=4, duration=30.0))
    run = solve_ivp(
        lambda t, z: A @ z + B[:, 0] * motion.acceleration_at(t),
        (0.0, 60.0),
        np.zeros(len(A)),
        rtol=1e-7,
        atol=1e-9,
        t_eval=np.linspace(30.0, 60.0, 3001),
        max_step=0.05,
    )
    seen = np.sqrt(np.mean((C @ run.y[:, :-1]) ** 2, axis=1))
    assert random_response(scene, Spectrum(f, S, "acceleration"), ("angles",)).rms == pytest.approx(seen, rel=0.02)


def test_the_answer_is_finite_where_a_mode_is_extremely_sharp() -> None:
    response: RandomResponse = random_response(oscillator(1e-9), WHITE, ("angles",))
    assert response.rms[0] == pytest.approx(response.white[0, 0], rel=1e-6)


@pytest.mark.parametrize("quality", [1e9, 3e12, 1e14])
def test_no_digit_is_lost_however_sharp_a_mode_is(quality: float) -> None:
    for length in np.random.default_rng(7).uniform(0.3, 2.0, 3).tolist():
        omega = sqrt(9.81 / length)
        link = Bob(mass=2.0, length=length, damping=omega / quality * 2.0 * length**2)
        response = random_response(Scene(gravity=9.81, pendulum=[Pendulum(links=[link])]), WHITE, ("angles",))
        exact = sqrt(2.0 * quality / (4 * omega**3 * length**2))
        assert [response.rms[0], response.by_mode[0, 0]] == pytest.approx([exact, exact], rel=1e-11)


def test_a_response_beside_a_sharp_mode_is_that_of_50_digits() -> None:
    """Relative offsets of 1e-4 to 1e-11 from a mode of Q = 1e9, where only the rounding of ω² matters."""
    damping = 0.5 * sqrt(9.81 / 0.5) / 1e9
    omega = sqrt(9.81 / 0.5) * (1 + np.geomspace(1e-11, 1e-4, 40))
    form = random_response(oscillator(damping), WHITE, ("angles",)).form
    with mp.workdps(50):
        exact = [complex(-1 / (mp.mpf(9.81) - mp.mpf(w) ** 2 / 2 + 1j * mp.mpf(w) * mp.mpf(damping))) for w in omega]
    assert frequency_response(form, omega)[0, 0] == pytest.approx(np.array(exact), rel=2e-12)
