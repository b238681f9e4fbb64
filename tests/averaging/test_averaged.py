"""Averaged equations, the configurations they keep and the survivors they predict, against closed forms and runs."""

from __future__ import annotations

from dataclasses import replace
from itertools import count, product
from math import acos, pi, radians, sin, sqrt
from types import SimpleNamespace

import numpy as np
import pytest
import survivors
from amounts import usually
from scipy.optimize import brentq

from modal import Bob, Cart, Fixed, Pendulum, Rod, Scene, load, natural_modes
from modal.assembly import matrices
from modal.coupling import explain
from modal.errors import ComputationError, SceneError
from modal.scene import Escapement, InitialCondition, VanDerPol
from modal.scene.links import Drive
from modal.scene.parameters import vary
from nonlinear.averaging import AveragedEquations, average, predict, relative_equilibria, relative_equilibrium, settle
from nonlinear.averaging.describing import pulls
from nonlinear.averaging.equations import BANDS_MAX, ORDER, derivative, lattice
from nonlinear.averaging.equilibria import START_ANGLE
from nonlinear.averaging.prediction import resonant
from nonlinear.averaging.slow_flow import STEP_TURN_MAX, _advance, _going, _pace, _Stretch, below_for_good, runs_away
from nonlinear.simulation import simulate
from nonlinear.synchronization import find_survival
from nonlinear.system import State, initial_state

G = 9.81


def bobs(*angles: float, drive: Drive | None = None, joint: float = 0.0, **cart: float) -> Scene:
    """Bobs of 1 kg and 1 m at these angles (deg)."""
    link = Bob(mass=1.0, length=1.0, damping=joint, drive=drive)
    pendula = tuple(Pendulum(links=(link,), start=InitialCondition(angles_deg=(angle,))) for angle in angles)
    return Scene(gravity=G, support=Cart(**cart) if cart else Fixed(), pendulum=pendula)


def double(drive: Drive | None = None) -> Scene:
    links = (Rod(mass=1.0, length=1.0, drive=drive), Rod(mass=0.7, length=0.6))
    return Scene(gravity=G, support=Fixed(), pendulum=(Pendulum(links=links),))


# ------------------------------------------------------------------------------------------------------ the flow


@pytest.mark.parametrize("angle", [0.01, 0.05])
def test_one_van_der_pol_pendulum(angle: float) -> None:
    """q = a cos χ + Re A e^{3iχ}: the first harmonic of q³ is ¾a²(a + A), A = ρ₃/8Ω² follows the third one, a³/4."""
    e, d, gamma, omega = 0.03, 0.01, radians(2.0), sqrt(G)
    averaged = average(bobs(1.0, drive=VanDerPol(strength=e, angle_deg=2.0), joint=d))
    rate = averaged.flow(np.array([angle + 0j]), averaged.centre)[0] / angle
    cubic = 1 + angle**2 * (-G / 24 + 1j * omega * e / (4 * gamma**2)) / (8 * omega**2)
    expected = (e - d) / 2 - angle**2 * cubic * (e / (8 * gamma**2) + 1j * omega / 16)
    assert rate.real == pytest.approx(expected.real, rel=1e-5)
    assert rate.imag == pytest.approx(expected.imag, rel=angle**2 / 12)


@pytest.mark.parametrize("stiffness", [0.0, 300.0])
def test_noted_decay_as_damped_modes_do(stiffness: float) -> None:
    link = Bob(mass=1.0, length=1.0, damping=0.01)
    pendula = (Pendulum(links=(link,), count=2), Pendulum(links=(Rod(mass=1.0, length=1.1, damping=0.02),)))
    scene = Scene(gravity=G, support=Cart(mass=5.0, damping=0.1, stiffness=stiffness), pendulum=pendula)
    averaged = average(scene)
    for mode in explain(scene).damped_modes:
        assert mode.exact is not None
        turning = np.full(len(averaged.centre), mode.exact.imag)
        values = np.linalg.eigvals(derivative(averaged.flow, np.zeros(len(averaged.omega), dtype=complex), turning))
        assert np.abs(values + 1j * mode.exact.imag - mode.exact).min() < 0.02 * mode.rate


def test_a_braked_cart_slows_no_more_than_it_moves() -> None:
    scene = bobs(1.0, 1.0, mass=50.0, damping=150.0)
    averaged = average(scene)
    values = np.linalg.eigvals(derivative(averaged.flow, np.zeros(2, dtype=complex), averaged.centre))
    still, moving = explain(scene).damped_modes
    assert moving.exact is not None
    first, eigenvalue = -moving.rate, values[np.argmin(values.real)]
    assert eigenvalue.real == pytest.approx(moving.exact.real, rel=0.02)
    assert abs(first / moving.exact.real - 1) > 0.5
    assert still.rate == 0


def test_an_escapement_feeds_what_the_damper_takes() -> None:
    """Gravity takes −G/8 a²(a + A) in the first harmonic, A that of the kicks' third."""
    P, d, gamma = 0.015, 0.05, radians(4.0)
    scene = bobs(9.0, drive=Escapement(impulse=P, angle_deg=4.0), joint=d)
    equilibrium = relative_equilibrium(average(scene), np.array([0.17 + 0j]))
    assert equilibrium is not None
    assert equilibrium.is_stable
    corner = P / (2 * pi * equilibrium.omega)

    def surplus(a: float) -> float:
        ahead = acos((gamma + corner) / a)
        return P / pi * (sin(ahead) - G * a**2 / (8 * (9 * equilibrium.omega**2 - G)) * sin(3 * ahead)) - d * a / 2

    balance = brentq(surplus, 0.15, 0.2)
    assert abs(equilibrium.z[0]) == pytest.approx(balance, rel=5e-6)
    run = simulate(scene, 300.0, tolerance=1e-9, output=6001)
    assert np.abs(run.motion.links[-400:]).max() == pytest.approx(balance, rel=0.02)


def test_kicks_follow_two_frequencies() -> None:
    """Against kicks counted one by one on a motion of two unrelated frequencies."""
    averaged = average(double(Escapement(impulse=0.01, angle_deg=1.0)))
    z = np.array([0.08, 0.01j])
    gamma = averaged.shapes[0] * z
    size, speed = np.abs(averaged.shapes[0] * z), np.abs(averaged.omega * averaged.shapes[0] * z)
    assert size[0] > size[1]
    assert averaged.mixing(z[:, None], averaged.centre[:, None]) == pytest.approx(
        speed[1] / speed[0] / sqrt(1 - (radians(1.0) / size[0]) ** 2)
    )
    assert averaged.mixing(z[:, None], averaged.centre[:, None]) < 1
    times = np.linspace(0.0, 4000.0, 4_000_001)
    waves = np.exp(1j * np.outer(averaged.omega, times))
    angle, rate = (gamma @ waves).real, (1j * averaged.omega * gamma @ waves).real
    out = np.abs(angle) > radians(1.0)
    at = np.flatnonzero(~out[:-1] & out[1:] & (angle[1:] * rate[1:] > 0))
    at = at[np.diff(np.sign(angle[at]), prepend=0) != 0]
    pull = (np.sign(angle[at]) * 0.01 * waves[:, at].conj()).sum(axis=1) / times[-1]
    expected = averaged.shapes[0] * pull / (1j * averaged.omega)
    np.testing.assert_allclose(
        (averaged.forcing(z, averaged.centre) - averaged.smooth(z, averaged.centre)),
        expected,
        rtol=0.05,
        atol=0.03 * abs(expected).max(),
    )


def test_a_strong_band_starves_a_weak_one_twice_as_much_as_itself() -> None:
    """γ = Σ|Γ_b| cos χ_b gives (γ²γ')_b = iωΓ_b (|Γ_b|² + 2|Γ_c|²)/4."""
    e, limit = 0.02, 1e-3
    averaged = average(double(VanDerPol(strength=e, angle_deg=float(np.degrees(limit)))))
    turns, z = averaged.shapes[0], np.array([2e-3, 1e-3j])
    sizes = np.abs(turns * z) ** 2
    expected = e / 2 * turns**2 * (1 - (sizes + 2 * sizes[::-1]) / (4 * limit**2))
    np.testing.assert_allclose((averaged.flow(z, averaged.centre) / z).real, expected, rtol=1e-4)


def test_frequencies_fall_as_kappa_says() -> None:
    for scene in (bobs(1.0, 1.0, mass=3.0), double()):
        averaged, modes = average(scene), natural_modes(scene)
        for place, row in enumerate(averaged.row):
            z = np.where(np.arange(len(averaged.omega)) == place, 0.02 + 0j, 0.0)
            rate = averaged.flow(z, np.full(len(averaged.centre), averaged.omega[place]))[place] / z[place]
            kappa = modes[int(row)].kappa
            assert abs(rate.real) < 1e-12
            assert rate.imag == pytest.approx(averaged.omega[place] * kappa * averaged.largest(z) ** 2, rel=0.01)


@pytest.mark.parametrize("count", range(1, BANDS_MAX + 1))
def test_no_product_of_phases_has_a_mean(count: int) -> None:
    points, steps = lattice(count)
    phases = 2 * pi * np.outer(steps, np.arange(points)) / points
    for word in product(range(-ORDER, ORDER + 1), repeat=count):
        if 0 < sum(map(abs, word)) <= ORDER and sum(word) % 2 == 0:
            assert abs(np.mean(np.exp(1j * np.array(word) @ phases))) < 1e-9


@pytest.mark.parametrize(("size", "within"), [(1.0, 5e-4), (0.1, 1e-9)])
def test_few_phases_do_as_well_as_many(size: float, within: float) -> None:
    """What products of more than ORDER factors leave goes with the sixth power of the swing."""
    few = average(double(VanDerPol(strength=0.02, angle_deg=5.0)))
    many = replace(few)
    grid = 2 * pi * np.array(list(product(range(24), repeat=2))).T / 24
    many.__dict__["_phases"] = np.exp(1j * grid)
    z = size * np.array([0.15 + 0.05j, 0.02 - 0.01j])
    np.testing.assert_allclose(few.flow(z, few.centre), many.flow(z, many.centre), rtol=within)


def test_amplitudes_give_the_motion_and_its_energy_back() -> None:
    scene, rng = double(), np.random.default_rng(4)
    averaged, (q, v) = average(scene), rng.standard_normal((2, 2)) * 1e-3
    z, equations = averaged.amplitudes(State(q, v)), matrices(scene)
    np.testing.assert_allclose((averaged.shapes @ z).real, q)
    np.testing.assert_allclose((averaged.shapes @ (1j * averaged.omega * z)).real, v)
    assert averaged.energies(z).sum() == pytest.approx((v @ equations.M @ v + q @ equations.K @ q) / 2)
    assert averaged.largest(z) >= np.abs(q).max()


# -------------------------------------------------------------------------------------- configurations, slow motion


def clocks(*angles: float, damping: float = 16.0) -> Scene:
    return bobs(*angles, drive=VanDerPol(strength=0.05, angle_deg=4.0), mass=30.0, damping=damping)


def test_two_pendula_keep_in_phase_or_in_antiphase() -> None:
    averaged = average(clocks(5.0, -6.0))
    states = relative_equilibria(averaged)
    angles = [(averaged.shapes[1:] @ state.z) for state in states if state.share.max() > 0.999]
    ratios = sorted(float((left / right).real) for left, right in angles)
    np.testing.assert_allclose(ratios, [-1.0, 1.0], atol=1e-6)
    assert [state.is_stable for state in states if state.share.max() > 0.999] == [True, False]
    apart = next(state for state in states if state.row == 1)
    assert apart.omega == pytest.approx(sqrt(G) * (1 - radians(8.0) ** 2 / 16), rel=1e-4)


def test_many_pendula_in_antiphase_share_the_swing_in_many_ways_and_hold_it_all_the_same() -> None:
    averaged = average(clocks(5.0, -6.0, 4.0, -7.0))
    state = next(
        equilibrium
        for equilibrium in relative_equilibria(averaged)
        if equilibrium.row == 1 and equilibrium.share.max() > 0.999
    )
    assert state.is_stable is None
    assert state.hold > 0.1 * np.abs(state.rates.real).max()


def test_a_disturbance_falls_at_the_rate_of_its_configuration() -> None:
    averaged = average(clocks(5.0, -6.0))
    state = next(equilibrium for equilibrium in relative_equilibria(averaged) if equilibrium.row == 1)
    angles = np.degrees((averaged.shapes[1:] @ state.z).real)
    size = 8.0 / max(abs(angles))
    scene = clocks(*(size * angles + 0.5))
    run = find_survival(simulate(scene, 4 / state.hold, tolerance=1e-9, output=4001))
    other = np.log(1 - run.share.max(axis=1))
    inside = (run.times > 0.5 / state.hold) & (run.times < 3.5 / state.hold)
    slope = np.polyfit(run.times[inside], other[inside], 1)[0]
    assert slope == pytest.approx(-2 * state.hold, rel=0.1)
    assert state.relaxation == 1 / abs(state.growth)


def test_slow_motion_is_that_of_the_run() -> None:
    scene = clocks(6.0, 4.0)
    said = predict(scene)
    run = simulate(scene, float(said.motion.times[100]), tolerance=1e-9, output=20001)
    measured = find_survival(run)
    mine = np.array([np.interp(run.times, said.motion.times, row) for row in said.motion.share[measured.row - 1]]).T
    inside = slice(400, -400)
    assert np.abs(mine[inside] - measured.share[inside]).max() < 0.02
    assert np.ptp(measured.share[:, 0]) > 0.2


def test_the_last_passage_counts() -> None:
    values = np.array([1.0, 0.4, 0.8, 0.2, 0.0])
    assert below_for_good(np.arange(5.0), values, 0.5) == pytest.approx(2.5)
    assert below_for_good(np.arange(5.0), values[::-1], 0.5) is None
    assert below_for_good(np.arange(5.0), values, 2.0) == 0.0


def test_steps_are_short_enough() -> None:
    """Eight times as many steps change nothing that is asked."""
    import nonlinear.averaging.slow_flow as slow

    averaged = average(clocks(6.0, 4.0))
    z = averaged.amplitudes(initial_state(averaged.scene))[:, None]
    (usual,) = settle(averaged, z)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(slow, "STEP_GROWTH_MAX", slow.STEP_GROWTH_MAX / 8)
        patch.setattr(slow, "STEP_TURN_MAX", slow.STEP_TURN_MAX / 8)
        patch.setattr(slow, "SLOW_STEPS_MAX", slow.SLOW_STEPS_MAX * 8)
        (fine,) = settle(averaged, z)
    assert usual.locking_time() == pytest.approx(fine.locking_time(), rel=1e-3)


@pytest.mark.parametrize("row", [0, 1])
def test_modes_that_are_left_out_set_no_pace(row: int) -> None:
    averaged = average(load("huygens"))
    kept = averaged.row == averaged.row[row]
    z = np.where(kept, 1.0 + 0.0j, 0.0)[:, None]
    z = START_ANGLE * z / averaged.largest(z)
    alone = averaged.restricted_to(kept)
    other = replace(alone, omega=np.where(kept, alone.omega, 1.2 * alone.omega))
    turning = averaged.turning(z)
    assert _pace(other, z, turning) == pytest.approx(_pace(alone, z, turning), rel=1e-6)


def test_the_theory_of_two_clocks_takes_few_evaluations(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its outcome keeps many times of the motion, its configurations the end alone, which slow motions soon reach."""
    calls, rates = count(), AveragedEquations._rates
    monkeypatch.setattr(AveragedEquations, "_rates", lambda *given: (next(calls), rates(*given))[1])
    prediction = predict(load("huygens"))
    first = next(calls)
    assert first <= 450
    assert relative_equilibria(prediction.averaged)
    assert next(calls) - first <= 500


def test_a_band_at_rest_changes_no_kick() -> None:
    rng = np.random.default_rng(2)
    impulse, angle = rng.uniform(0.1, 1.0, (2, 3))
    swing = rng.uniform(0.0, 1.5, (1, 3, 5)) * np.exp(2j * pi * rng.random((1, 3, 5)))
    corner, turning = rng.uniform(0.0, 0.3, (3, 5)), rng.uniform(1.0, 2.0, (2, 5))
    points, steps = lattice(2)
    phases = np.exp(2j * pi * np.outer(steps, np.arange(points)) / points)
    alone = pulls(impulse, angle, corner, swing, turning[:1], phases[:1])
    beside = pulls(impulse, angle, corner, np.concatenate((swing, 0 * swing)), turning, phases)
    assert np.any(alone[0] == 0)
    for single, both in zip(alone, beside, strict=True):
        assert single[0] == pytest.approx(both[0], rel=1e-13, abs=1e-15)


def test_what_grows_from_next_to_nothing_is_followed_into_its_cycle() -> None:
    """The beam of this scene swings slowly and decays: steps that fit it are far too long for the clocks it feeds."""
    averaged = average(vary(load("clocks-double"), {"support.mass": 50.0}))
    start = np.where(averaged.row == 0, START_ANGLE / np.abs(averaged.shapes[1:, 0]).max(), 1e-12).astype(complex)
    (motion,) = settle(averaged, start[:, None])
    ending = relative_equilibrium(averaged, motion.z[:, -1])
    assert ending is not None
    assert ending.is_stable
    np.testing.assert_allclose(averaged.energies(motion.z[:, -1]).max(), averaged.energies(ending.z).max(), rtol=0.02)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("nonlinear.averaging.slow_flow.SLOW_STEPS_MAX", 1)
        assert runs_away(averaged, settle(averaged, start[:, None], 10**6)[0].z)


def test_a_cart_that_is_stopped_at_once_makes_no_doubt_of_who_comes_back() -> None:
    """The damper takes its own mode, of a spring, at a rate of more than 10⁴ times that of a clock."""
    scene = bobs(5.0, -6.0, drive=VanDerPol(strength=1e-4, angle_deg=4.0), mass=8.0, stiffness=900.0, damping=40.0)
    state = next(equilibrium for equilibrium in relative_equilibria(average(scene)) if equilibrium.row == 1)
    assert np.abs(state.rates.real).max() > 1e4 * abs(state.growth)
    assert state.growth == pytest.approx(-1e-4, rel=0.01)
    assert state.recovery == pytest.approx(1e-4, rel=0.01)
    assert state.is_stable is True


# ----------------------------------------------------------------------------------------------------- predictions


def test_what_dies_out_is_said() -> None:
    said = predict(bobs(5.0, 2.0, drive=VanDerPol(strength=0.01, angle_deg=4.0), joint=0.05, mass=10.0))
    assert said.motion.dies
    assert said.locking_time() is None
    assert said.certain  # no clock that may go on


@pytest.mark.parametrize(
    ("scene", "start", "message"),
    [
        (bobs(5.0, 2.0, mass=10.0), None, "nothing drives this scene"),
        (clocks(5.0, 2.0), State(np.zeros(2), np.zeros(2)), "starts at rest"),
    ],
)
def test_what_cannot_be_predicted_is_refused(scene: Scene, start: State | None, message: str) -> None:
    with pytest.raises((ComputationError, SceneError), match=message):
        predict(scene, start)


def test_what_cannot_be_averaged_is_refused() -> None:
    space = bobs(1.0).model_copy(update={"space": "space"})
    alone = [Pendulum(links=(Bob(mass=1.0, length=0.2**power),)) for power in range(5)]
    wide = Scene(gravity=G, support=Fixed(), pendulum=tuple(alone))
    many = Scene(gravity=G, support=Fixed(), pendulum=(Pendulum(links=alone[0].links, count=401),))
    up = Pendulum(links=(Bob(mass=1.0, length=1.0, stiffness=30.0),), equilibrium=("up",))
    standing = Scene(gravity=G, support=Fixed(), pendulum=(up,))
    for scene, message in ((many, "400 links, not 401"), (wide, "not 5")):
        with pytest.raises(ComputationError, match=message):
            average(scene)
    for scene, message in ((space, "space"), (standing, "equilibrium")):
        with pytest.raises(SceneError, match=message):
            average(scene)


def test_resonances_are_of_up_to_four_frequencies() -> None:
    for omega in ([1.0, 3.05], [1.0, 2.4, 3.8]):
        assert resonant(np.array(omega), 0.1)
    for omega in ([1.0, 3.2], [1.0, 5.0]):
        assert not resonant(np.array(omega), 0.1)


EVERY = (2104, 2112, 2115, 2118, 2119, 2127, 2006, 2010, 2011, 2015, 2016)
SAMPLE = usually((2112, 2011), EVERY)


def test_certain_survivors_survive() -> None:
    cases = [survivors.judged(seed) for seed in SAMPLE]
    assert sum(case.certain for case in cases) >= len(SAMPLE) - 1
    assert sum(case.timed for case in cases) > len(SAMPLE) / 2
    for case in cases:
        assert case.right or not case.certain, case
        assert case.close or not case.timed, case


FEED = VanDerPol(strength=0.05, angle_deg=5.0)


def in_units(length: float, *angles: float, drive: Drive, cart: float = 10.0) -> Scene:
    """Driven bobs of 1 kg on a cart, as bobs of 1 m are at g = 9.81 m/s² but for the unit of length and of time."""
    unit = length**1.5
    name = "strength" if isinstance(drive, VanDerPol) else "impulse"
    scaled = drive.model_copy(update={name: getattr(drive, name) * unit})
    link = Bob(mass=1.0, length=length, damping=0.01 * unit, drive=scaled)
    pendula = tuple(Pendulum(links=(link,), start=InitialCondition(angles_deg=(angle,))) for angle in angles)
    return Scene(gravity=G, support=Cart(mass=cart, damping=0.1 * length**-0.5 if cart else 0.0), pendulum=pendula)


@pytest.mark.parametrize("length", [1e-12, 1.0, 1e12])
def test_no_doubt_depends_on_units(length: float) -> None:
    assert predict(in_units(length, 10.0, -3.0, drive=FEED)).doubts == ()


def test_a_wide_start_is_doubted() -> None:
    """However small its end: the simulation goes elsewhere."""
    assert any("170 deg" in doubt for doubt in predict(in_units(1.0, 170.0, -169.0, drive=FEED)).doubts)


def test_amplitudes_that_diverge_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """Steps are halved as long as any may be: five hundred of them say the same as all."""
    monkeypatch.setattr("nonlinear.averaging.slow_flow.SLOW_STEPS_MAX", 500)
    with pytest.raises(ComputationError, match="their amplitudes exceed half a turn"):
        predict(in_units(1.0, 10.0, -3.0, drive=Escapement(impulse=500.0, angle_deg=2.0)))


def test_a_massless_cart_without_a_mode_is_refused() -> None:
    with pytest.raises(SceneError, match=r"support\.mass = 0\.0"):
        predict(in_units(1.0, 10.0, -3.0, drive=FEED, cart=0.0))


def test_rates_out_of_all_proportion_end_in_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """A cart of 1e-12 kg: 1e10 steps a second; whatever the largest number of steps is, it ends them."""
    monkeypatch.setattr(settle, "__defaults__", (600, 0.0))
    assert not predict(in_units(1.0, 10.0, -3.0, drive=FEED, cart=1e-12)).certain


def test_the_largest_angle_is_that_of_a_pendulum_not_of_its_modes_one_by_one() -> None:
    """One of eight aside: eight modes of one band add up to the angle it was released from."""
    scene = bobs(10.0, *[0.0] * 7, drive=FEED, mass=10.0)
    averaged = average(scene)
    assert averaged.largest(averaged.amplitudes(initial_state(scene))) == pytest.approx(radians(10.0), rel=1e-12)


def test_a_clock_that_a_beat_brings_to_rest_within_a_step_is_seen() -> None:
    """The least of |1 + exp(iφ)|, 0, while φ turns by 2 rad a step: seen to 8 % of the largest, from any phase."""
    equations = SimpleNamespace(
        system=SimpleNamespace(has_escapements=True),
        forcing=lambda z, turning, active: 0 * z,
        detuning=lambda turning: np.array([[STEP_TURN_MAX], [-STEP_TURN_MAX]]),
        rotation_rates=lambda turning, *_: turning,
        reach=lambda z: np.abs(z.sum(0)),
    )
    for phase in np.linspace(0.0, 1.0, 7):
        z = np.exp(1j * np.array([[phase], [-phase]]))
        stretch = _Stretch(z, np.zeros((1, 1)), 1.0, np.array([np.inf]), h=1.0, steps=3)
        _advance(equations, [stretch], None)
        assert stretch.reach[0] / 2 < 0.08


@pytest.mark.parametrize(("share", "is_going"), [(3e-4, False), (3e-3, True)])
def test_rows_that_exchange_a_thousandth_of_the_energy_are_not_settled(share: float, is_going: bool) -> None:
    """A locked pair whose rows still exchange so much of the energy; nothing is lost."""
    part = 0.5 + share / 2 * np.sin(np.linspace(0.0, 20.0, 400))
    z = np.sqrt(np.array([part, 1 - part]))[:, None].astype(complex)
    equations = SimpleNamespace(energies=lambda z: np.abs(z) ** 2)
    assert _going(equations, z, z[..., 0]).tolist() == [is_going]
    falling = z * np.sqrt(1 - share * np.linspace(0.0, 2.0, 400))  # by `share` in the second half
    assert _going(equations, falling, z[..., 0]).tolist() == [is_going]
