"""Averaged equations against the exact periodic motions of two clocks and their Floquet multipliers."""

from __future__ import annotations

from functools import cache
from math import exp

import floquet
import numpy as np
import pytest
from amounts import usually
from scipy.integrate import solve_ivp

from nonlinear.averaging import RelativeEquilibrium, average, relative_equilibria
from nonlinear.simulation import simulate
from nonlinear.synchronization import agreement, find_survival
from nonlinear.system import State

WITHIN = 6e-4  # 1/s


@cache
def said(pair: floquet.Pair) -> dict[str, RelativeEquilibrium]:
    return {agreement(equilibrium): equilibrium for equilibrium in relative_equilibria(average(pair.scene))}


@cache
def exact(pair: floquet.Pair, words: str) -> floquet.Orbit:
    return floquet.near(pair, said(pair)[words])


STRONG = floquet.metronomes(10.0, 3.0, 6e-5)


TOLD = [(6.0, -0.01932), (8.0, -0.00461), (9.0, 0.00396), (11.0, 0.02321)]


@pytest.mark.parametrize(("angle", "told"), usually(TOLD[1:3], TOLD))
def test_antiphase_of_metronomes_grows_as_it_does(angle: float, told: float) -> None:
    """Against figures of another's shooting; with each mode's own frequency they were off by 0.017, two in sign."""
    pair = floquet.metronomes(angle)
    growth = exact(pair, "antiphase").growth
    assert growth == pytest.approx(told, abs=1e-5)
    state = said(pair)["antiphase"]
    assert state.growth == pytest.approx(growth, abs=WITHIN)
    assert state.is_stable is (told < 0)


def test_strong_metronomes_on_a_heavy_beam_come_back_in_phase() -> None:
    state, growth = said(STRONG)["in phase"], exact(STRONG, "in phase").growth
    assert growth == pytest.approx(-0.0102, abs=1e-4)
    assert state.growth == pytest.approx(growth, abs=1e-3)
    assert state.is_stable is True


def test_the_simulator_comes_back_at_the_same_rate() -> None:
    state = said(STRONG)["in phase"]
    q = state.averaged.shapes @ state.z
    q[1:] *= np.exp(1j * np.array([0.02, -0.02]))
    v = (1j * state.omega * q).real
    start = State(q[1:].real, v[1:], float(q[0].real), float(v[0]))
    run = find_survival(simulate(STRONG.scene, 250.0, start=start, tolerance=1e-9, output=12_001))
    inside = (run.times > 50) & (run.times < 240)
    slope = np.polyfit(run.times[inside], np.log(run.share[inside, 0]), 1)[0] / 2
    assert slope == pytest.approx(exact(STRONG, "in phase").growth, rel=0.1)


KICKED = [
    (floquet.huygens(3.0), "antiphase", 5e-5),
    (floquet.huygens(10.0), "in phase", 5e-5),
    (floquet.huygens(40.0), "in phase", 5e-5),
    (floquet.huygens(10.0, 10.0), "in phase", 2e-3),
    (floquet.huygens(10.0, 10.0), "antiphase", 2e-3),
]


@pytest.mark.parametrize(
    ("pair", "words", "within"),
    usually(KICKED[1::3], KICKED),
)
def test_kicked_clocks_grow_as_they_do(pair: floquet.Pair, words: str, within: float) -> None:
    state, motion = said(pair)[words], exact(pair, words)
    assert state.growth == pytest.approx(motion.growth, abs=within)
    assert state.is_stable is (motion.growth < 0)
    assert state.omega == pytest.approx(2 * np.pi / motion.period, rel=1e-4)


def test_volumes_shrink_as_the_equations_say() -> None:
    """Liouville: the multipliers' product is exp ∫ tr ∂f/∂y dt."""
    pair = floquet.metronomes(9.0)
    motion = exact(pair, "antiphase")
    run = solve_ivp(
        lambda _, y: [*pair.rate(y[:5]), np.trace(pair.slope(y[:5]))],
        (0.0, motion.period),
        [*motion.y, 0.0],
        method="DOP853",
        rtol=1e-11,
        atol=1e-13,
    )
    assert np.linalg.det(motion.monodromy) == pytest.approx(exp(run.y[-1, -1]), rel=1e-8)
    np.testing.assert_allclose(run.y[:5, -1], motion.y, atol=1e-9)


def test_a_saltation_matrix_is_the_derivative_of_a_kicked_run() -> None:
    """One clock is kicked in the run and the other is not, nor do disturbances change their order."""
    pair, y = floquet.huygens(3.0), np.array([0.02, -0.01, 0.7, 0.2, 0.01])
    matrix, h = pair.flow(y, 0.1)[1], 1e-6
    ends = [[pair.flow(y + sign * h * way, 0.1)[0] for sign in (1, -1)] for way in np.eye(5)]
    slopes = np.array([(after - before) / (2 * h) for after, before in ends]).T
    np.testing.assert_allclose(matrix, slopes, rtol=1e-5, atol=1e-6)
    still = floquet.metronomes(9.0).flow(y, 0.1)[1]
    assert np.linalg.det(matrix) != pytest.approx(np.linalg.det(still), rel=1e-3)
