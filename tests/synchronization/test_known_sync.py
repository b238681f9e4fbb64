"""Known results on clocks that share a beam, reproduced by the full simulator and compared with averaging."""

from __future__ import annotations

import math

import exchange
import huygens
import koluda
import numpy as np
import pantaleone
import pytest
from amounts import usually

from modal import load
from nonlinear.simulation import simulate
from nonlinear.system import state_at_rest


def test_the_shipped_clocks_end_as_their_titles_say() -> None:
    for name, seconds, sign in (("huygens", 120.0, -1), ("metronomes", 60.0, 1)):
        run = simulate(load(name), seconds, tolerance=1e-7, output=np.linspace(seconds - 10, seconds, 2001))
        assert sign * np.corrcoef(run.motion.links[1:].T)[0, 1] > 0.99
        assert np.abs(run.motion.links[1:]).max(axis=0).min() > math.radians(5)
    scene = load("clocks-double")
    run = simulate(scene, 300.0, tolerance=1e-7, output=np.linspace(290, 300, 2001))
    assert np.corrcoef(run.motion.links[1:, [0, 2]].T)[0, 1] < -0.99


# ------------------------------------------------------------------------------------------------------- Huygens


def test_a_clock_alone_takes_the_larger_amplitude_and_dies_below_the_smaller() -> None:
    needed, taken = huygens.amplitudes_deg(load("huygens"))
    pair = huygens.on(1e9)
    for start, expected in ((0.97 * needed, 0.0), (1.03 * needed, taken)):
        run = simulate(
            pair, 400.0, start=state_at_rest(pair, [start]), tolerance=1e-7, output=np.linspace(390, 400, 2001)
        )
        amplitude = math.degrees(abs(run.motion.links[1:]).max())
        assert amplitude == pytest.approx(expected, rel=0.02) if expected else amplitude < 0.9 * needed


@pytest.mark.parametrize("mass", usually([0.1, 10.0], [0.1, 1.0, 10.0]))
def test_antiphase_survives_on_any_beam(mass: float) -> None:
    assert huygens.outcome(huygens.on(mass), (7.0, -4.0), 200.0) == "antiphase"


def test_in_phase_both_stop_on_beams_lighter_than_derived() -> None:
    bound = huygens.lightest(load("huygens"))
    assert bound == pytest.approx(4.87, abs=0.01)
    assert huygens.outcome(huygens.on(0.95 * bound), (7.0, 7.0), 300.0) == "both stop"
    assert huygens.outcome(huygens.on(1.05 * bound), (7.0, 7.0), 300.0) == "in phase"


# ---------------------------------------------------------------------------------------------------- metronomes


@pytest.mark.parametrize("damping", usually([0.4], [0.0, 0.4]))
def test_antiphase_of_metronomes_loses_its_stability_where_derived(damping: float) -> None:
    base = pantaleone.Base(0.005, damping=damping)
    assert pantaleone.multiplier(base, 0.90 * base.limit_deg) < 1
    assert pantaleone.multiplier(base, 1.02 * base.limit_deg) > 1


def test_metronomes_take_the_phase_that_their_stability_says() -> None:
    base = pantaleone.Base(0.01)
    assert pantaleone.settled(base, 0.7 * base.limit_deg, (10.0, -9.0), 200.0) < -0.999
    assert pantaleone.settled(base, 1.4 * base.limit_deg, (10.0, -9.0), 400.0) > 0.999
    assert pantaleone.settled(base, 0.7 * base.limit_deg, (10.0, 9.0), 200.0) > 0.999


# ------------------------------------------------------------------------------------------ two double pendula


def test_all_four_configurations_attract_on_a_beam_of_six_kilograms() -> None:
    scene = koluda.varied(6.0, 0.5)
    assert koluda.averages(scene) == ("stable",) * 4
    for start in range(4):
        assert koluda.attracts(scene, start, 200.0) == "stays"


def test_on_the_shipped_beam_fast_antiphase_shares_its_energy_for_ever() -> None:
    """Nine tenths of it stay, so that only the initial share decides; the averaged equations say so too."""
    scene = load("clocks-double")
    assert koluda.varied(scene.support.mass, 0.5) == scene
    assert koluda.averages(scene) == ("stable", "stable", "unstable", "stable")
    assert koluda.attracts(scene, 2) == "mixed"
    begun, ended = koluda.shares(scene, 2)
    assert begun[2] > 0.99 > ended[2] > 0.8
    assert ended[[2, 3]].sum() > 0.999


def test_on_heavy_and_light_beams_one_configuration_gives_way() -> None:
    assert koluda.attracts(koluda.varied(2.0, 0.5), 1, 250.0) == "to 4"
    assert koluda.averages(koluda.varied(2.0, 0.5))[1] == "none"
    assert koluda.attracts(koluda.varied(20.0, 0.5), 2, 150.0) == "to 4"
    assert koluda.averages(koluda.varied(20.0, 0.5))[2] == "unstable"


# ------------------------------------------------------------------------------------------ the paper's own cart


def test_one_pendulum_gives_its_energy_to_the_other_with_both_of_the_tables_periods() -> None:
    np.testing.assert_allclose(exchange.tabled(), [167.842, 301.971], atol=5e-4)
    np.testing.assert_allclose(exchange.periods(exchange.run(800.0, 1.0)), exchange.tabled(), rtol=2e-3)


def test_an_exchange_that_was_not_seen_twice_has_no_period() -> None:
    assert math.isnan(exchange.periods(exchange.run(100.0, 1.0))[1])
