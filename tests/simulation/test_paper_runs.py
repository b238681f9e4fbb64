"""Paper 000's own runs for one, two and three double pendula, ten seconds and on; and the beats it could not reach."""

from __future__ import annotations

import math
from importlib.util import find_spec

import numpy as np
import pytest
from amounts import usually

import modal
from modal import natural_modes
from modal.types import Floats
from nonlinear.simulation import simulate
from nonlinear.system import State, state_at_rest

TAYLOR = pytest.mark.skipif(find_spec("heyoka") is None, reason="an hour needs the extra `taylor`")


@pytest.mark.parametrize("count", usually([1], [1, 2, 3]))
def test_runs_by_two_forms_of_the_equations_agree(count: int) -> None:
    scene, seconds = modal.load(f"paper-cart-{count}"), usually(3, 10)
    run = simulate(scene, seconds, tolerance=1e-13, method="DOP853", output=101)
    other = simulate(scene, seconds, tolerance=1e-13, form="hamiltonian", method="DOP853", output=101)
    assert abs(run.motion.links - other.motion.links).max() < 1e-8
    assert run.energy_drift() < 1e-11
    assert run.momentum_drift() < 1e-11


def test_the_mirror_symmetric_start_leaves_the_cart_still_and_the_others_do_not() -> None:
    moved = [
        abs(simulate(modal.load(f"paper-cart-{n}"), 10, tolerance=1e-12, method="DOP853").motion.cart).max()
        for n in (1, 2, 3)
    ]
    assert moved[1] < 1e-10
    assert moved[0] > 1e-3
    assert moved[2] > 1e-3
    askew = state_at_rest(modal.load("paper-cart-2"), [90, 90, -89, -90])
    assert abs(simulate(modal.load("paper-cart-2"), 10, start=askew).motion.cart).max() > 1e-3


def test_two_pendula_without_the_cart_are_the_symmetric_pair_on_it() -> None:
    """Exactly uncoupled: one double pendulum on a fixed support moves the same way."""
    pair = modal.load("paper-cart-2")
    alone = pair.model_copy(update={"support": modal.Fixed(), "pendulum": pair.pendulum[:1]})
    together, single = (simulate(s, 10, tolerance=1e-13, method="DOP853", output=101) for s in (pair, alone))
    assert abs(together.motion.links[:, :2] - single.motion.links).max() < 1e-8


def exchanged(seconds: float, degrees: float, method: str) -> tuple[Floats, Floats]:
    """Times (s) and the second of two pendula's share of the energy, the first one released in its own slow shape."""
    scene = modal.load("paper-cart-2")
    modes = natural_modes(scene)
    still, moving = (modes.shape(number).angles.real for number in (1, 2))
    both = still[:2] / abs(still[0]) + moving[:2] / abs(moving[0])
    links = np.concatenate((both, np.zeros(2)))
    start = State(math.radians(degrees) * links / abs(links).max(), np.zeros(4))
    run = simulate(scene, seconds, tolerance=1e-10, start=start, method=method, output=int(20 * seconds) + 1)
    mechanics = run.mechanics
    energies = mechanics.of_pendula(mechanics.kinetic + mechanics.potential)
    share = energies[:, 1] / energies.sum(1)
    return run.times[30:-30], np.convolve(share, np.ones(61) / 61, mode="valid")


def test_energy_wanders_to_the_other_pendulum_in_half_a_beat() -> None:
    modes = natural_modes(modal.load("paper-cart-2"))
    beat = 2 * math.pi / (modes.omega[2] - modes.omega[1])
    assert beat == pytest.approx(167.8, abs=0.1)
    times, share = exchanged(120.0, 2.0, "DOP853")
    assert times[np.argmax(share)] == pytest.approx(beat / 2, rel=0.02)
    assert share.max() > 0.98


@TAYLOR
def test_an_hour_of_beats_has_the_tables_period() -> None:
    """The share of the second pendulum passes one half twice a beat."""
    modes = natural_modes(modal.load("paper-cart-2"))
    beat = 2 * math.pi / (modes.omega[2] - modes.omega[1])
    times, share = exchanged(3600.0, 2.0, "taylor")
    up = np.flatnonzero((share[:-1] < 0.5) & (share[1:] >= 0.5))
    assert len(up) in (21, 22)
    assert (times[up[-1]] - times[up[0]]) / (len(up) - 1) == pytest.approx(beat, rel=0.01)


@TAYLOR
@pytest.mark.parametrize("count", [1, 2, 3])
def test_an_hour(count: int) -> None:
    run = simulate(modal.load(f"paper-cart-{count}"), 3600, tolerance=1e-15, method="taylor", output=3601)
    assert run.complete
    assert run.energy_drift() < 1e-10
    assert run.momentum_drift() < 1e-10
