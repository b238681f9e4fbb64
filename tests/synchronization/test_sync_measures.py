"""Phases, surviving modes and locking times, each against closed forms, other routes or plain angles."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from io import BytesIO
from math import isnan, log, pi, sqrt
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from amounts import usually
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scenes import motion_scene, random_state

import modal
from modal import Bob, Cart, Fixed, Pendulum, Scene
from modal.assembly import rig_of
from modal.coupling.reduced import fixed_base_modes
from modal.errors import ComputationError
from modal.plotting import save
from modal.plotting.style import HUES
from modal.scene import InitialCondition, VanDerPol
from nonlinear.dynamics import Mechanics
from nonlinear.ensembles.measures import ending_times
from nonlinear.integration import SolverInfo, Trajectory
from nonlinear.plotting import sync_figure
from nonlinear.postprocessing import last, smooth
from nonlinear.reduction import modal_motion, start_in_mode
from nonlinear.simulation import simulate
from nonlinear.sweeps import measures, parse_measures
from nonlinear.sweeps.measures import Portion
from nonlinear.synchronization import Phases, find_survival, phases_of
from nonlinear.synchronization.phases import own_shapes
from nonlinear.system import Motion, state_at_rest, system_of

PAPER = modal.load("paper-cart-2")
DRIVE = VanDerPol(strength=0.05, angle_deg=5.0)


def bobs(*lengths: float, cart: float | None = 10.0, angles: tuple[float, ...] = (), **link: Any) -> Scene:
    pendula = tuple(
        Pendulum(links=(Bob(mass=1.0, length=length, **link),), start=InitialCondition(angles_deg=(angle,)))
        for length, angle in zip(lengths, angles or (5.0,) * len(lengths), strict=True)
    )
    return Scene(gravity=9.81, support=Fixed() if cart is None else Cart(mass=cart), pendulum=pendula)


def closed(scene: Scene, times: Any, links: Any, rates: Any, cart: Any = 0.0, cart_rate: Any = 0.0) -> Trajectory:
    """A run that somebody wrote down."""
    none = np.zeros(len(times))
    motion = Motion(np.asarray(links), np.asarray(rates), none + cart, none + cart_rate, none)
    return Trajectory(scene, system_of(scene), np.asarray(times), motion, SolverInfo("by hand", "closed form", "", 0.0))


def swinging(scene: Scene, times: Any, omega: Any, size: Any, phase: Any) -> Trajectory:
    angle = np.outer(times, omega) + phase
    return closed(scene, times, size * np.cos(angle), -np.multiply(size, omega) * np.sin(angle))


@lru_cache
def paired(first: float, second: float) -> Trajectory:
    return simulate(bobs(1.0, 1.0, angles=(first, second), drive=DRIVE), 400.0, tolerance=1e-8)


# --------------------------------------------------------------------------------------------------- own modes


@pytest.mark.parametrize("seed", range(12))
def test_own_modes_are_those_of_each_pendulum_alone(seed: int) -> None:
    scene = motion_scene(seed, standing=False)
    phases = phases_of(closed(scene, [0.0, 1.0], *np.zeros((2, 2, scene.n_links))))
    count = min(pendulum.n_links for pendulum in scene.pendulum)
    assert phases.omega.shape == (len(scene.pendulum), count)
    for index, pendulum in enumerate(scene.pendulum):
        alone = scene.model_copy(update={"support": Fixed(), "pendulum": (pendulum,)}).conservative
        modes = modal.natural_modes(alone)
        assert phases.omega[index] == pytest.approx(modes.omega[:count], rel=1e-10)
        masses = [modes.shape(number).modal_mass for number in range(count)]
        assert phases.mass[index] == pytest.approx(masses, rel=1e-8)


def test_own_frequencies_are_those_of_the_coupling() -> None:
    phases = phases_of(closed(PAPER, [0.0, 1.0], *np.zeros((2, 2, 4))))
    assert phases.omega[0] == pytest.approx(fixed_base_modes(rig_of(PAPER)).omega, rel=1e-12)


def test_a_spring_can_hold_a_pendulum_up_and_without_one_it_has_no_phase() -> None:
    held = Pendulum(links=(Bob(mass=2.0, length=0.5, stiffness=30.0),), equilibrium=("up",))
    scene = Scene(gravity=9.81, pendulum=(held,))
    expected = sqrt((30.0 - 2.0 * 9.81 * 0.5) / (2.0 * 0.25))
    times = np.linspace(0, 20, 2001)
    run = swinging(scene, times, [expected], [0.1], [0.3])
    run = replace(run, motion=replace(run.motion, links=run.motion.links + pi))
    phases = phases_of(run)
    assert phases.omega[0, 0] == pytest.approx(expected, rel=1e-14)
    assert phases.frequency == pytest.approx([expected], rel=1e-12)
    free = scene.model_copy(update={"pendulum": (Pendulum(links=(Bob(mass=2.0, length=0.5),), equilibrium=("up",)),)})
    with pytest.raises(ComputationError, match="does not oscillate"):
        phases_of(replace(run, scene=free, system=system_of(free)))
    with pytest.raises(ComputationError, match="no mode of this scene oscillates"):
        find_survival(replace(run, scene=free, system=system_of(free)))


# ------------------------------------------------------------------------------------------------------ phases


@pytest.mark.parametrize("number", [1, 2, 3, 4])
def test_small_motion_in_one_mode_turns_at_its_frequency_and_keeps_its_share(number: int) -> None:
    modes = modal.natural_modes(PAPER)
    run = simulate(PAPER, 30.0, start=start_in_mode(PAPER, modes, number, amplitude=1e-5), tolerance=1e-12)
    phases, survival = phases_of(run), find_survival(run)
    assert phases.leading == (number - 1) // 2
    assert phases.frequency == pytest.approx([modes.omega[number]] * 2, rel=1e-6)
    assert phases.locked
    assert survival.survivor == number + 1
    assert survival.row.tolist() == [2, 3, 4, 5]
    assert survival.share[:, number - 1] == pytest.approx(1.0, abs=1e-7)
    assert survival.mode.family.startswith("cart still" if number % 2 else "cart moves")
    assert phases.order[:, phases.leading] == pytest.approx(0.0 if number % 2 else 1.0, abs=1e-5)


def test_an_own_mode_by_itself_goes_round_a_circle() -> None:
    """Arg z runs forward as ωt, |z| is the largest angle, the top link's angle positive at phase 0."""
    scene = modal.load("chain-3")
    modes = modal.natural_modes(scene)
    times = np.linspace(0, 5, 400)
    for number in range(3):
        omega, shape = modes.omega[number], modes.shape(number).angles.real
        shape = shape * np.sign(shape[0]) / np.abs(shape).max()
        turned = omega * times + 0.4
        rates = -0.2 * omega * np.outer(np.sin(turned), shape)
        phases = phases_of(closed(scene, times, 0.2 * np.outer(np.cos(turned), shape), rates))
        assert phases.z[:, 0, number] == pytest.approx(0.2 * np.exp(1j * turned), rel=1e-10)
        assert np.abs(np.delete(phases.z[:, 0], number, axis=1)).max() < 1e-12
        assert phases.leading == number
        assert phases.amplitude[:, 0, number] == pytest.approx(0.2)
        assert np.exp(1j * phases.phase[:, 0, number]) == pytest.approx(np.exp(1j * turned))


def test_order_of_phases_that_are_known() -> None:
    omega, times = sqrt(9.81), np.linspace(0, 10, 500)
    for phase, expected in (
        ([0, 0], 1.0),
        ([0, pi], 0.0),
        ([0, pi / 2], sqrt(0.5)),
        ([0, 2 * pi / 3, 4 * pi / 3], 0.0),
        ([0, 0, pi], 1 / 3),
    ):
        scene, sizes = bobs(*[1.0] * len(phase)), np.linspace(0.1, 0.2, len(phase))
        phases = phases_of(swinging(scene, times, [omega] * len(phase), sizes, phase))
        assert phases.order[:, 0] == pytest.approx(expected, abs=1e-12)
    middle = phases_of(swinging(bobs(1.0, 1.0), times, [omega] * 2, [0.1, 0.2], [0.2, 0.8])).mean_phase[:, 0]
    assert np.exp(1j * middle) == pytest.approx(np.exp(1j * (omega * times + 0.5)))


def test_a_pendulum_at_rest_has_no_phase_and_locks_with_nobody() -> None:
    run = swinging(bobs(1.0, 1.0), np.linspace(0, 10, 500), [sqrt(9.81)] * 2, [0.1, 0.0], [0, 0])
    phases = phases_of(run)
    assert phases.order == pytest.approx(0.5)
    assert isnan(phases.frequency[1])
    assert not phases.locked


def test_whole_turns_do_not_count() -> None:
    run = swinging(bobs(1.0, 1.0), np.linspace(0, 10, 500), [sqrt(9.81)] * 2, [0.1, 0.2], [0, 1])
    turned = replace(run, motion=replace(run.motion, links=run.motion.links + np.array([2 * pi, -6 * pi])))
    assert phases_of(turned).z == pytest.approx(phases_of(run).z, abs=1e-13)
    assert find_survival(turned).share == pytest.approx(find_survival(run).share, abs=1e-12)


@pytest.mark.parametrize("seed", range(6))
def test_energies_are_those_of_the_pendula_and_cart_by_themselves(seed: int) -> None:
    scene = motion_scene(seed, standing=False)
    states = [random_state(system_of(scene), at) for at in range(3)]
    columns = [np.array([getattr(state, name) for state in states]) for name in ("links", "link_rates")]
    cart = [np.array([getattr(state, name) for state in states]) for name in ("cart", "cart_rate")]
    run = closed(scene, [0.0, 1.0, 2.0], *columns, *cart)
    energy, at = phases_of(run).energy, 0
    for index, pendulum in enumerate(scene.pendulum):
        alone = scene.model_copy(update={"pendulum": (pendulum,)})
        here = slice(at, at := at + pendulum.n_links)
        motion = Motion(*(part[:, here] for part in columns), *cart, np.zeros(3))
        single = Mechanics(system_of(alone), motion)
        assert energy[:, index] == pytest.approx(single.energy - single.cart_kinetic - single.cart_potential, rel=1e-12)
    whole = energy.sum(1) + run.mechanics.cart_kinetic + run.mechanics.cart_potential
    assert whole == pytest.approx(run.mechanics.energy, rel=1e-12)


def test_a_thousand_pendula() -> None:
    """Against the formula for one bob; nothing here takes a matrix of the whole scene."""
    lengths, rng = np.linspace(0.9, 1.1, 1000), np.random.default_rng(7)
    scene, omega = bobs(*lengths, cart=1000.0), np.sqrt(9.81 / lengths)
    size, phase = rng.uniform(0.01, 0.1, 1000), rng.uniform(-1, 1, 1000)
    times = np.linspace(0, 30, 300)
    phases = phases_of(swinging(scene, times, omega, size, phase))
    turned = np.exp(1j * (np.outer(times, omega) + phase))
    assert np.allclose(phases.z[:, :, 0], size * turned, rtol=1e-10, atol=0)
    assert phases.order[:, 0] == pytest.approx(np.abs(turned.mean(1)), rel=1e-10)
    assert phases.frequency == pytest.approx(omega, rel=1e-10)
    assert not phases.locked


# ------------------------------------------------------------------------------------------------- frequencies


def test_locked_says_what_the_length_of_the_run_can_tell() -> None:
    scene = bobs(1.0, 1.05, cart=None)
    omega = np.sqrt(9.81 / np.array([1.0, 1.05]))
    gap = float(omega[0] - omega[1])
    for seconds, expected in ((0.9 * pi / gap, True), (1.1 * pi / gap, False)):
        phases = phases_of(swinging(scene, np.linspace(0, seconds, 2000), omega, [0.1, 0.1], [0, 1]))
        assert phases.frequency == pytest.approx(omega, rel=1e-9)
        assert phases.resolution == pytest.approx(pi / seconds, rel=2e-3)
        assert phases.locked is expected


def test_samples_too_far_apart_are_refused_and_the_advice_is_good() -> None:
    def run(output: int) -> Phases:
        return phases_of(simulate(bobs(1.0, 1.0, angles=(5.0, 5.0)), 60.0, output=output))

    with pytest.raises(ComputationError, match=r"rotate at 3\.\d+ rad/s: .* `output=(\d+)`$") as refusal:
        _ = run(50).frequency
    needed = int(str(refusal.value).rpartition("=")[2].strip("`"))
    assert needed < 130
    assert run(needed).frequency == pytest.approx(run(2000).frequency, rel=1e-3)


def test_samples_once_a_period_are_refused_though_nothing_seems_to_move() -> None:
    scene, omega = bobs(1.0), sqrt(9.81)
    run = swinging(scene, np.arange(20) * 2 * pi / omega, [omega], [0.1], [0.0])
    with pytest.raises(ComputationError, match="too few"):
        _ = phases_of(run).frequency
    for few in (1, 2, 3):
        with pytest.raises(ComputationError, match="too few samples"):
            _ = phases_of(swinging(scene, np.arange(few) / 100, [omega], [0.1], [0.0])).frequency


def test_motion_in_space_is_refused() -> None:
    run = simulate(modal.load("chain-spatial"), 1.0, output=10)
    for measured in (phases_of, find_survival):
        with pytest.raises(ComputationError, match="only for motion in the plane"):
            measured(run)


# ---------------------------------------------------------------------------------------------------- survival


def test_energies_by_modes_are_those_of_modal_coordinates() -> None:
    """Four double pendula, two of them equal and driven, in any motion, on a cart with a spring: rows with copies."""
    links = tuple(Bob(mass=m, length=1.0, damping=0.1, drive=DRIVE) for m in (1.0, 0.5))
    other = tuple(Bob(mass=m, length=0.8) for m in (1.0, 2.0))
    pendula = (Pendulum(links=links, count=3), Pendulum(links=other))
    scene = Scene(gravity=9.81, support=Cart(mass=5.0, stiffness=20.0, damping=1.0), pendulum=pendula)
    rng, times = np.random.default_rng(3), np.linspace(0, 1e-9, 5)
    parts = rng.uniform(-0.5, 0.5, (2, 5, 8))
    run = closed(scene, times, *parts, *rng.uniform(-1, 1, (2, 5)))
    survival = find_survival(run)
    coordinates = modal_motion(run.motion, modal.natural_modes(scene.conservative))
    expected = np.array([coordinates.energy[:, coordinates.number == row - 1].sum(1) for row in survival.row]).T
    assert survival.modes.multiplicity.max() == 2
    assert survival.energy == pytest.approx(smooth(times, expected, 1.0), rel=1e-9)
    assert survival.energy.sum(1) == pytest.approx(smooth(times, coordinates.total_energy, 1.0), rel=1e-9)


@pytest.mark.parametrize("cart", [None, Cart(mass=3.0, stiffness=7.0)])
def test_no_energy_is_lost_where_different_pendula_swing_alike(cart: Cart | None) -> None:
    pendula = tuple(Pendulum(links=(Bob(mass=mass, length=1.0),), count=2) for mass in (1.0, 2.0, 5.0))
    scene = Scene(gravity=9.81, support=cart or Fixed(), pendulum=pendula)
    parts, times = np.random.default_rng(5).uniform(-0.5, 0.5, (2, 4, 6)), np.linspace(0, 1e-9, 4)
    run = closed(scene, times, *parts)
    survival = find_survival(run)
    whole = modal_motion(run.motion, survival.modes).total_energy
    assert survival.energy.sum(1) == pytest.approx(smooth(times, whole, 1.0), rel=1e-12)
    assert survival.modes.multiplicity.max() == (6 if cart is None else 5)


@pytest.mark.parametrize(("sigma", "size"), [(0.02, 1.0), (0.05, 3.0)])
def test_locking_time_of_a_decay_that_is_known(sigma: float, size: float) -> None:
    """E₂/E₁ = ρ exp(−2σt), ρ known from the modal masses, falls below 1/99 at ln(99 ρ)/2σ."""
    scene = bobs(1.0, 1.2)
    modes = modal.natural_modes(scene)
    (lower, w1), (two, w2) = ((modes.shape(k), float(modes.omega[k])) for k in (1, 2))
    times = np.linspace(0, 400, 20001)
    fade = size * np.exp(-sigma * times)
    first = np.cos(w1 * times), -w1 * np.sin(w1 * times)
    second = fade * np.cos(w2 * times), -fade * (w2 * np.sin(w2 * times) + sigma * np.cos(w2 * times))
    links, rates = (np.outer(a, lower.angles) + np.outer(b, two.angles) for a, b in zip(first, second, strict=True))
    cart, cart_rate = (a * lower.cart + b * two.cart for a, b in zip(first, second, strict=True))
    survival = find_survival(closed(scene, times, 0.01 * links, 0.01 * rates, 0.01 * cart, 0.01 * cart_rate))
    ratio = size**2 * two.modal_mass * w2**2 / (lower.modal_mass * w1**2)
    assert survival.survivor == 2
    assert survival.locking_time() == pytest.approx(log(99 * ratio) / (2 * sigma), abs=0.15)
    assert survival.locking_time(0.1) == pytest.approx(log(9 * ratio) / (2 * sigma), abs=0.15)
    assert survival.locking_time(0.0) is None
    assert survival.locking_time(1.1) == 0.0


def test_at_rest_nothing_survives_and_immense_scenes_are_refused() -> None:
    still = closed(PAPER, [0.0, 1.0], *np.zeros((2, 2, 4)))
    with pytest.raises(ComputationError, match="nothing moves"):
        _ = find_survival(still).survivor
    crowd = Scene(gravity=9.81, pendulum=(Pendulum(links=(Bob(mass=1, length=1),), count=2001),))
    run = swinging(crowd, np.linspace(0, 9, 90), [sqrt(9.81)] * 2001, [0.1] * 2001, [0.0] * 2001)
    with pytest.raises(ComputationError, match="2001 coordinates"):
        find_survival(run)
    assert phases_of(run).order == pytest.approx(1.0)


@pytest.mark.parametrize(("start", "row"), [((5.0, -3.0), 2), ((8.0, 1.0), 3)])
def test_what_survives_between_two_clocks_is_what_their_angles_show(start: tuple[float, float], row: int) -> None:
    run = paired(*start)
    survival, phases = find_survival(run), phases_of(run)
    end = run.motion.links[last(run.times, 0.1)]
    difference, total = np.ptp(end[:, 0] - end[:, 1]), np.ptp(end.sum(1))
    assert (difference > 1e3 * total) == (row == 2)
    assert (total > 1e3 * difference) == (row == 3)
    assert (survival.survivor, survival.survivor_share) == (row, pytest.approx(1.0, abs=1e-6))
    assert phases.order[-1, 0] == pytest.approx(row - 2, abs=1e-3)
    assert phases.locked
    crossings = np.flatnonzero(np.diff(np.signbit(run.motion.links[:, 0])) & (run.times[1:] > 200))
    counted = pi * (len(crossings) - 1) / (run.times[crossings[-1]] - run.times[crossings[0]])
    assert phases.frequency == pytest.approx([counted] * 2, rel=2e-3)
    time = survival.locking_time()
    assert time is not None
    small, large = (run.motion.links @ [[1, 1], [1, -1]]).T[:: 1 if row == 2 else -1]
    spread = [np.ptp(small[part]) / np.ptp(large[part]) for part in (run.times > time, run.times < time)]
    assert spread[0] < 0.13 < spread[1]


# ---------------------------------------------------------------------------------------------------- measures


def measured(text: str, scene: Scene) -> dict[str, float]:
    """One measure of a sweep."""
    return parse_measures([text])[0].of(scene)


def test_measures_of_a_sweep(monkeypatch: pytest.MonkeyPatch) -> None:
    scene, runs = bobs(1.0, 1.0, angles=(5.0, -3.0), drive=DRIVE), []
    monkeypatch.setattr(
        measures, "simulate", lambda *arguments, **more: runs.append(arguments) or simulate(*arguments, **more)
    )
    run = simulate(scene, 90.0, output=np.union1d(simulate(scene, 90.0).times, ending_times(scene, 90.0)))
    numbers: dict[str, float] = {}
    portion = Portion([scene], scene)
    for request in parse_measures([f"{name}:90" for name in ("order", "survivor", "locking", "pendulum_energy")]):
        numbers |= request.measure.of_scene(scene, request.number, portion)
    assert len(runs) == 1
    late = np.isin(run.times, ending_times(scene, 90.0))
    survival, mechanics = find_survival(run), run.mechanics
    assert numbers["survivor"] == 2
    assert numbers["survivor_share"] == pytest.approx(survival.share[-1, 0], rel=1e-9)
    assert survival.share[-1, 0] > 0.99
    assert 60 < numbers["locking_time_s"] < 90
    angles, rates = run.motion.links[late], run.motion.link_rates[late]
    expected = np.abs(np.exp(1j * np.angle(angles - 1j * rates / sqrt(9.81))).mean(1)).mean()
    assert numbers["order"] == pytest.approx(expected, rel=1e-6)
    energy = (mechanics.kinetic + mechanics.potential)[late].mean(0)
    assert [numbers[f"pendulum_{k}_energy_J"] for k in (1, 2)] == pytest.approx(energy, rel=1e-6)
    assert numbers["pendula_energy_J"] == pytest.approx(energy.sum(), rel=1e-6)
    assert numbers["cart_energy_J"] == pytest.approx((10 * run.motion.cart_rate[late] ** 2 / 2).mean(), rel=1e-6)
    assert isnan(measured("locking:20", scene)["locking_time_s"])


def test_crowds_and_fixed_supports_have_fewer_numbers() -> None:
    scene = bobs(*[1.0] * 5, cart=None)
    assert list(measured("pendulum_energy:5", scene)) == [
        "pendula_energy_J",
        *(f"pendulum_{k}_energy_J" for k in range(1, 6)),
    ]
    assert measured("order:5", scene)["order"] == pytest.approx(1.0)
    assert measured("survivor:5", scene) == {"survivor": 1.0, "survivor_share": pytest.approx(1.0)}


def test_means_over_time() -> None:
    """Against the integral of the straight lines on a fine grid that holds the samples."""
    times = np.sort(np.append(np.random.default_rng(0).integers(1, 10_000, 300), [0, 10_000])) / 1000
    times = np.unique(times)
    wave, fine = np.cos(2 * pi * times), np.linspace(0, 10, 10_001)
    lines = np.interp(fine, times, wave)
    for span in (0.002, 0.7, 3.0, 50.0):
        means = smooth(times, np.stack((wave, 2 * times), axis=1), span)
        for at in (0, 1, 57, 150, len(times) - 1):
            low, high = max(times[at] - span / 2, 0), min(times[at] + span / 2, 10)
            near = (fine >= low - 1e-9) & (fine <= high + 1e-9)
            assert means[at, 0] == pytest.approx(np.trapezoid(lines[near], fine[near]) / (high - low), abs=1e-9)
            assert means[at, 1] == pytest.approx(low + high)
    assert smooth(times[:1], wave[:1], 1.0) == wave[:1]
    assert times[last(times, 0.1)][0] >= 9.0 > times[last(times, 0.1).start - 1]
    assert len(times[last(times, 0.0)]) == 2


def test_means_of_what_decays_keep_their_digits() -> None:
    times = np.linspace(0, 100, 4001)
    values = np.exp(-times)
    assert smooth(times, values, 1.0)[100:-100] == pytest.approx(2 * np.sinh(0.5) * values[100:-100], rel=1e-4, abs=0)


# ----------------------------------------------------------------------------------------------------- figures


def panel(figure: Figure, title: str) -> Axes:
    (chosen,) = [axis for axis in figure.axes if title in axis.get_title(loc="left") + axis.get_title()]
    return chosen


@pytest.mark.parametrize("name", usually(["metronomes"], ["paper-cart-2", "metronomes", "crane-two-loads"]))
def test_every_panel_has_curves_units_and_room(name: str) -> None:
    run = simulate(modal.load(name), 20.0, tolerance=1e-7)
    figure = sync_figure(run, phases_of(run))
    figure.canvas.draw()
    assert len(figure.axes) == 6
    page = figure.bbox
    for axis in figure.axes:
        assert axis.lines
        for text in (axis.xaxis.label, axis.yaxis.label, axis.title):
            box = text.get_window_extent()
            assert box.x0 >= page.x0 - 1
            assert box.x1 <= page.x1 + 1
            assert box.y0 >= page.y0 - 1
            assert box.y1 <= page.y1 + 1
    for axis in figure.axes[:5]:
        assert axis.get_xlabel() == "time (s)"
    for title in ("at first", "Agreement", "hold the energy", "Energy of each"):
        assert panel(figure, title).get_ylabel().endswith(")")


def test_the_picture_shows_what_was_measured() -> None:
    run = paired(5.0, -3.0)
    phases, survival = phases_of(run), find_survival(run)
    figure = sync_figure(run, phases)
    assert panel(figure, "Agreement").lines[0].get_ydata() == pytest.approx(phases.order[:, 0])
    shares = panel(figure, "hold the energy")
    assert [line.get_label() for line in shares.lines] == ["cart still 3.132 rad/s", "cart moves 3.431 rad/s"]
    for line, share in zip(shares.lines, survival.share.T, strict=True):
        assert line.get_ydata() == pytest.approx(share)
    start, end = panel(figure, "at first").lines[0], panel(figure, "links at the end").lines[1]
    assert (start.get_xdata()[0], end.get_xdata()[-1]) == (0.0, 400.0)
    assert (start.get_ydata()[0], end.get_ydata()[-1]) == pytest.approx((5.0, np.degrees(run.motion.links[-1, 1])))
    dots = [line for line in panel(figure, "Phases at the end").lines if line.get_marker() == "o"]
    assert np.cos([float(dot.get_xdata()[0]) for dot in dots]) == pytest.approx([1, -1], abs=1e-6)
    assert [float(dot.get_ydata()[0]) for dot in dots] == pytest.approx([10.0, 10.0], rel=1e-2)


def test_crowds_are_drawn_as_bands_and_what_cannot_be_told_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("nonlinear.synchronization.modal_energy.MODAL_COORDINATES_MAX", 20)
    scene = bobs(*np.linspace(0.9, 1.1, 30))
    run = simulate(scene, 20.0, start=state_at_rest(scene, np.linspace(1, 9, 30).tolist()))
    figure = sync_figure(run, phases_of(run))
    (text,) = panel(figure, "hold the energy").texts
    assert "31 coordinates" in text.get_text()
    energies = panel(figure, "Energy of each")
    assert len(energies.collections) == 1
    assert [line.get_label() for line in energies.lines] == ["median"]
    names = [entry.get_text() for entry in figure.legends[0].get_texts()]
    assert names == [f"pendulum {number}" for number in (1, 7, 13, 18, 24, 30)]


def test_many_rows_are_drawn_as_one_and_pictures_are_written() -> None:
    scene = bobs(*np.linspace(0.8, 1.2, 9))
    run = simulate(scene, 20.0, start=state_at_rest(scene, np.linspace(-5, 9, 9).tolist()))
    lines = panel(sync_figure(run, phases_of(run)), "hold the energy").lines
    named = [line for line in lines if not line.get_label().startswith("_")]
    assert len(named) == HUES
    assert lines[-1].get_label() == "4 other modes"
    curves: dict[str, np.ndarray] = {}
    for line in lines:  # a curve upon another one is in pieces
        whole = curves.setdefault(line.get_label().lstrip("_"), np.array(line.get_ydata(), dtype=float))
        whole[np.isnan(whole)] = line.get_ydata()[np.isnan(whole)]
    assert sum(curves.values()) == pytest.approx(1.0)
    stream = BytesIO()
    save(sync_figure(run, phases_of(run)), stream, "svg")
    assert b"<svg" in stream.getvalue()
    with pytest.raises(ComputationError, match="single sample"):
        sync_figure(run.at(slice(0, 1)), phases_of(run.at(slice(0, 1))))


def test_a_run_at_rest_can_be_drawn() -> None:
    run = closed(PAPER, np.linspace(0, 3, 50), np.zeros((50, 4)), np.zeros((50, 4)))
    sync_figure(run, phases_of(run)).canvas.draw()


def test_too_many_links_have_no_fixed_base_modes() -> None:
    crowd = SimpleNamespace(n=1000, index=np.zeros((1000, 4001), dtype=int))
    with pytest.raises(ComputationError, match="4001 pendula of 1000 links are too many"):
        own_shapes(crowd, 9.81, 1)
