"""Self-excitation: van der Pol torques in every form of the equations, and what escapements do kick by kick."""

from __future__ import annotations

import math
import os
import signal
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
from amounts import usually
from dense_form import DenseForm
from scenes import motion_scene, random_state
from scipy.integrate import solve_ivp
from support.uncompiled import uncompiled

from modal import load, natural_modes
from modal.assembly import matrices
from modal.errors import SceneError
from modal.scene import (
    Bob,
    Body,
    Cart,
    Escapement,
    InitialCondition,
    Pendulum,
    Rod,
    Scene,
    VanDerPol,
    describe,
    scene_from,
)
from modal.scene.links import Drive
from modal.types import Floats
from nonlinear import files as recordings
from nonlinear.dynamics import Banded, Mechanics, Minimal, Recursion, escaping
from nonlinear.dynamics.compiled import Compiled
from nonlinear.dynamics.compiled import available as numba_here
from nonlinear.integration import Trajectory
from nonlinear.integration.switches import switches_of
from nonlinear.postprocessing import summary
from nonlinear.reduction import simulate_truncated
from nonlinear.simulation import resume, simulate
from nonlinear.system import Event, Motion, State, System, level_crossing, system_of, turning_point
from nonlinear.verification import check, check_table

G = 9.81


def with_drives(scene: Scene, seed: int, kinds: str) -> Scene:
    """A scene whose joints have drives at random: v van der Pol, e escapement, - none."""
    rng = np.random.default_rng(seed)

    def drive(mass: float, length: float) -> Drive | None:
        kind, size, angle = rng.choice(list(kinds)), mass * length**2 * rng.uniform(0.1, 1), rng.uniform(1, 40)
        if kind == "-":
            return None
        return VanDerPol(strength=size, angle_deg=angle) if kind == "v" else Escapement(impulse=size, angle_deg=angle)

    def driven(pendulum: Pendulum) -> Pendulum:
        links = tuple(k.model_copy(update={"drive": drive(k.mass, k.length)}) for k in pendulum.links)
        return pendulum.model_copy(update={"links": links})

    return scene.model_copy(update={"pendulum": tuple(map(driven, scene.pendulum))})


def clock(
    impulse: float, angle: float, start: float, *, rate: float = 0.0, length: float = 1.0, damping: float = 0.0
) -> Pendulum:
    """A bob of 1 kg with an escapement."""
    drive = Escapement(impulse=impulse, angle_deg=angle)
    links = (Bob(mass=1.0, length=length, damping=damping, drive=drive),)
    return Pendulum(links=links, start=InitialCondition(angles_deg=(start,), rates_deg=(rate,)))


def own_mass(scene: Scene, angles: Floats) -> Floats:
    """M(q) of the cart (if there is one) and the absolute angles from Σ m JᵀJ + I of every centre's Jacobian J."""
    on_cart, links = int(scene.support.kind == "cart"), [(p, k) for p in scene.pendulum for k in p.links]
    size = on_cart + len(links)
    M = np.zeros((size, size))
    if on_cart:
        M[0, 0] = scene.support.mass
    at = on_cart
    for pendulum in scene.pendulum:
        joint = np.zeros((2, size))
        joint[0, :on_cart] = 1.0
        for link in pendulum.links:
            along = np.zeros((2, size))
            theta = angles[at - on_cart]
            along[:, at] = math.cos(theta), -math.sin(theta)
            centre = joint + link.centre * along
            M += link.mass * centre.T @ centre
            M[at, at] += link.inertia
            joint = joint + link.length * along
            at += 1
    return M


def own_torques(scene: Scene, angles: Floats, rates: Floats) -> Floats:
    """The van der Pol torques on the absolute angles, link by link."""
    torques, at = np.zeros(len(angles)), 0
    for pendulum in scene.pendulum:
        above, turning_above, up = 0.0, 0.0, 0.0
        for number, link in enumerate(pendulum.links):
            rest = math.pi if pendulum.ways[number] == "up" else 0.0
            gamma, rate = angles[at] - above - (rest - up), rates[at] - turning_above
            if isinstance(link.drive, VanDerPol):
                torque = link.drive.strength * (1 - (gamma / math.radians(link.drive.angle_deg)) ** 2) * rate
                torques[at] += torque
                if number:
                    torques[at - 1] -= torque
            above, turning_above, up, at = angles[at], rates[at], rest, at + 1
    return torques


# ------------------------------------------------------------------------------------------------- van der Pol


@uncompiled()
@pytest.mark.parametrize("seed", range(8))
def test_a_van_der_pol_torque_adds_its_moments_over_the_mass_matrix_and_its_power_in_every_body(seed: int) -> None:
    bare = motion_scene(seed)
    scene = with_drives(bare, seed, "vv-")
    system, free, state = system_of(scene), system_of(bare), random_state(system_of(scene), seed)
    systems = [
        DenseForm(system),
        *(Minimal(system, tuple(map(body, system.groups))) for body in (Recursion, Banded)),
    ]
    systems += [Compiled(system)] * numba_here()
    on_cart = system.first
    torques = own_torques(scene, state.links, state.link_rates)
    expected = np.linalg.solve(own_mass(scene, state.links), np.concatenate((np.zeros(on_cart), torques)))
    still = DenseForm(free)
    half = still.layout.half
    bare_rate = still.derivative(0.0, still.begin(state))
    for equations in systems:
        rate = equations.derivative(0.0, equations.begin(state))
        difference = rate[half : 2 * half] - bare_rate[half : 2 * half]
        np.testing.assert_allclose(difference, expected, rtol=1e-8, atol=1e-9 * abs(rate).max())
        lost = bare_rate[-1] if still.layout.works else 0.0
        if equations.layout.works:
            assert rate[-1] - lost == pytest.approx(torques @ state.link_rates, rel=1e-10, abs=1e-10 * abs(rate[-1]))


@pytest.mark.parametrize("seed", usually([3], [1, 3]))
def test_every_form_and_method_goes_the_same_way_with_van_der_pol(seed: int) -> None:
    scene = with_drives(motion_scene(seed, standing=False, longest=2, most=2), seed, "v")
    ways = [{}, {"form": "maximal"}, {"form": "hamiltonian"}, {"method": "Radau"}, {"method": "LSODA"}]
    ways += [{"method": "taylor"}] * (find_spec("heyoka") is not None)
    runs = [simulate(scene, 1.0, tolerance=1e-11, output=11, **way) for way in ways]
    for run in runs[1:]:
        np.testing.assert_allclose(run.motion.links, runs[0].motion.links, atol=2e-7)
        np.testing.assert_allclose(run.motion.work, runs[0].motion.work, rtol=1e-6, atol=1e-7 * run.energy_scale)
    assert max(run.energy_drift() for run in runs) < 1e-8


@pytest.mark.parametrize(("damping", "start"), [(0.0, 1.0), (0.004, 8.0)])
def test_the_limit_cycle_has_the_amplitude_of_the_averaged_equation(damping: float, start: float) -> None:
    e, gamma0 = 0.01, 2.0
    link = Bob(mass=1.0, length=0.25, damping=damping, drive=VanDerPol(strength=e, angle_deg=gamma0))
    scene = Scene(gravity=G, pendulum=(Pendulum(links=(link,), start=InitialCondition(angles_deg=(start,))),))
    run = simulate(scene, 120.0, tolerance=1e-9, output=np.linspace(110, 120, 4001))
    amplitude = np.rad2deg(run.motion.links[1:].max())
    assert amplitude == pytest.approx(2 * gamma0 * math.sqrt(1 - damping / e), rel=2e-3)


def test_equal_pendula_with_equal_starts_move_as_one_and_as_without_the_symmetry() -> None:
    link = Rod(mass=0.3, length=0.4, damping=0.001, drive=VanDerPol(strength=0.01, angle_deg=10))
    pendulum = Pendulum(links=(link, Rod(mass=0.2, length=0.3)), count=3, start=InitialCondition(angles_deg=(20, 15)))
    scene = Scene(gravity=G, support=Cart(mass=1.0, damping=0.3), pendulum=(pendulum,))
    together = simulate(scene, 1.0, tolerance=1e-12, output=11)
    apart = simulate(scene, 1.0, tolerance=1e-12, output=11, form="hamiltonian")
    assert "1 of 3 pendula" in together.run.reduced
    np.testing.assert_allclose(together.motion.links, apart.motion.links, atol=1e-8)
    np.testing.assert_allclose(together.motion.work, apart.motion.work, atol=1e-8)
    system = system_of(scene)
    whole = Minimal(system, tuple(map(Recursion, system.groups)))
    solved = solve_ivp(
        whole.derivative, (0, 1), whole.begin(together.motion[0]), method="DOP853", rtol=1e-12, atol=1e-13
    )
    np.testing.assert_allclose(solved.y[1:7, -1], together.motion.links[-1], atol=1e-8)


def scaled(scene: Scene, mass: float, length: float) -> Scene:
    """In units so many times as large: masses, lengths and gravity, moments and impulses with m l²."""
    moment = mass * length**2

    def big(link: Bob) -> Bob:
        drive = link.drive
        name = "strength" if isinstance(drive, VanDerPol) else "impulse"
        more = drive.model_copy(update={name: getattr(drive, name) * moment}) if drive else None
        new = {"mass": link.mass * mass, "length": link.length * length, "damping": link.damping * moment}
        return link.model_copy(update={**new, "drive": more})

    pendula = tuple(p.model_copy(update={"links": tuple(map(big, p.links))}) for p in scene.pendulum)
    cart = Cart(mass=scene.support.mass * mass, damping=scene.support.damping * mass)
    return Scene(gravity=scene.gravity * length, support=cart, pendulum=pendula)


@pytest.mark.parametrize("length", [1e-12, 1e12])
@pytest.mark.parametrize("mass", usually([1e12], [1e12, 1e-12]))
def test_units_change_neither_motion_nor_kicks(mass: float, length: float) -> None:
    steady = Bob(mass=0.5, length=0.3, damping=0.001, drive=VanDerPol(strength=0.02, angle_deg=5))
    pendulum = Pendulum(links=(steady,), start=InitialCondition(angles_deg=(7,)))
    scene = Scene(gravity=G, support=Cart(mass=2.0, damping=0.2), pendulum=(clock(0.05, 4, 12, damping=0.02), pendulum))
    here, there = (
        simulate(s, 8.0, tolerance=1e-11, output=81, method="DOP853") for s in (scene, scaled(scene, mass, length))
    )
    np.testing.assert_allclose(there.motion.links, here.motion.links, atol=1e-8)
    np.testing.assert_allclose(there.motion.cart / length, here.motion.cart, atol=1e-8)
    np.testing.assert_allclose(there.kicks.time, here.kicks.time, atol=1e-8)
    np.testing.assert_allclose(there.kicks.energy / (mass * length**2), here.kicks.energy, rtol=1e-7)
    assert len(here.kicks.time) > 6


# -------------------------------------------------------------------------------------------------- one kick


def kicked(system: System, q: Floats, v: Floats, impulses: Floats) -> Floats:
    """The change of the velocities at q by impulses at all joints with escapements."""
    switches = switches_of(system)
    at, y = switches.places, [*q, *v, *[0.0] * switches.form.works]
    told = (
        [0.0] * at.size
        + [*impulses]
        + [0.0] * (at.state_count - at.K)
        + [*switches.numbers[:-1]]
        + [0.0] * at.input_count
    )
    after = switches.function("kick")(y, switches.inputs([0.0] * at.length), told)
    return np.array(after[at.half : 2 * at.half]) - v


def test_a_kick_of_a_single_pendulum_changes_its_rate_by_the_impulse_over_its_moment() -> None:
    body = Body(mass=2.0, length=0.7, centre=0.4, inertia=0.05, drive=Escapement(impulse=0.03, angle_deg=6))
    scene = Scene(gravity=G, pendulum=(Pendulum(links=(body,)),))
    system = system_of(scene)
    moment = 0.05 + 2.0 * 0.4**2
    jump = kicked(system, np.array([0.1]), np.zeros(1), np.array([0.03]))
    assert jump == pytest.approx([0.03 / moment], rel=1e-14)


@pytest.mark.parametrize("seed", range(6))
def test_kicks_at_any_joints_are_a_dense_solve_and_feed_what_the_kinetic_energy_gains(seed: int) -> None:
    scene = with_drives(motion_scene(seed, standing=seed % 2 == 1), seed, "e")
    system, state = system_of(scene), random_state(system_of(scene), seed)
    joints, on_cart = escaping(system), system.first
    rng = np.random.default_rng(seed)
    kick = joints.impulse * rng.choice([-1.0, 0.0, 1.0], len(joints.impulse))
    J = np.zeros(on_cart + system.n_links)
    for below, above, moment in zip(joints.below, joints.above, kick, strict=True):
        J[on_cart + below] += moment
        if above >= 0:
            J[on_cart + above] -= moment
    M = own_mass(scene, state.links)
    before = np.concatenate(([state.cart_rate] * on_cart, state.link_rates))
    jump = kicked(system, np.append([state.cart] * on_cart, state.links), before, kick)
    np.testing.assert_allclose(jump, np.linalg.solve(M, J), rtol=1e-9, atol=1e-12 * abs(jump).max())
    fed = kick @ joints.gamma(before + jump / 2)
    after = before + jump
    assert fed == pytest.approx((after @ M @ after - before @ M @ before) / 2, rel=1e-9, abs=1e-12)


def test_the_joints_of_a_chain_are_the_files_and_the_support_is_above_the_first() -> None:
    scene = with_drives(motion_scene(5, standing=False), 5, "e")
    joints = escaping(system_of(scene))
    firsts = np.cumsum([0, *(p.n_links for p in scene.pendulum)])[:-1]
    for below, above in zip(joints.below, joints.above, strict=True):
        assert above == (-1 if below in firsts else below - 1)


def energies(run: Trajectory) -> Floats:
    return np.asarray(Mechanics(run.system, run.motion).energy)


def test_the_record_of_kicks_holds_time_link_and_what_the_energy_jumps_by() -> None:
    """Two forms of bookkeeping: the record, and the energy of the motion just before and after."""
    top, low = (Escapement(impulse=p, angle_deg=a) for p, a in ((0.05, 6), (0.01, 4)))
    links = (Rod(mass=1.0, length=0.5, drive=top), Rod(mass=0.5, length=0.4, drive=low))
    pendulum = Pendulum(links=links, start=InitialCondition(angles_deg=(15, 20)))
    scene = Scene(gravity=G, support=Cart(mass=3.0), pendulum=(pendulum,))
    run = simulate(scene, 5.0, tolerance=1e-12, output=3)
    assert set(run.kicks.link.tolist()) == {0, 1}
    for time, energy in list(zip(run.kicks.time, run.kicks.energy, strict=True))[:6]:
        near = simulate(scene, 5.0, tolerance=1e-12, output=[time - 1e-6, time + 1e-6])
        before, after = energies(near)[1:]
        assert after - before == pytest.approx(energy, abs=1e-9)
    assert run.motion.work[-1] == pytest.approx(run.kicks.energy.sum(), rel=1e-12)
    assert run.momentum_drift() < 1e-12


# ------------------------------------------------------------------------------------------------ when they come


def own_kicks(impulse: float, angle: float, start: float, length: float, damping: float, seconds: float) -> list[float]:
    """Kicks of one bob of 1 kg released at rest outside the angle, by SciPy's own events."""
    bound = math.radians(angle)
    side, kick_times, time = -math.copysign(1.0, start), [], 0.0
    y = np.array([math.radians(start), 0.0])

    def slope(time: float, y: Floats) -> list[float]:
        return [y[1], -G / length * math.sin(y[0]) - damping / length**2 * y[1]]

    while True:

        def passes(time: float, y: Floats, side: float = side) -> float:
            return float(side * y[0] - bound)

        passes.terminal, passes.direction = True, 1.0  # type: ignore[attr-defined]
        run = solve_ivp(slope, (time, seconds), y, method="DOP853", rtol=1e-12, atol=1e-14, events=passes, max_step=0.1)
        if not len(run.t_events[0]):
            return kick_times
        time, y = float(run.t_events[0][0]), np.array(run.y_events[0][0])
        y[1] += side * impulse / length**2
        kick_times, side = [*kick_times, time], -side


THREE = ((0.05, 5.0, 20.0, 1.0, 0.0), (0.05, 5.2, 20.0, 1.01, 0.02), (0.02, 0.0, -15.0, 0.9, 0.01))


def test_kicks_come_when_an_integration_of_each_clock_alone_finds_them() -> None:
    clocks = [clock(p, a, s, length=l, damping=d) for p, a, s, l, d in THREE]
    run = simulate(Scene(gravity=G, pendulum=tuple(clocks)), 5.0, tolerance=1e-10)
    for number, numbers in enumerate(THREE):
        times = run.kicks.time[run.kicks.link == number]
        np.testing.assert_allclose(times, own_kicks(*numbers, 5.0), atol=1e-8)
    assert run.energy_drift() < 1e-6


@pytest.mark.parametrize("method", ["RK45", "Radau", "taylor"])
def test_methods_that_do_not_end_their_steps_at_kicks_say_so(method: str) -> None:
    with pytest.raises(SceneError, match=r"does not end its steps at kicks.* DOP853 takes it"):
        simulate(Scene(gravity=G, pendulum=(clock(0.05, 5, 20),)), 1.0, method=method)


@pytest.mark.parametrize("angle", [22.35, 22.38, 22.41, 22.44])
def test_the_first_of_two_kicks_within_one_step_is_the_first(angle: float) -> None:
    """One swing is about to turn, the other passes fast: a straight line between two samples gives the wrong order."""
    both = ((0.03, 19.8, 20.0, 1.0, 0.001), (0.03, angle, 25.0, 1.25, 0.001))
    scene = Scene(gravity=G, pendulum=tuple(clock(p, a, s, length=l, damping=d) for p, a, s, l, d in both))
    for tolerance, bound in ((1e-5, 1e-4), (1e-6, 1e-5), (1e-8, 1e-7)):
        run = simulate(scene, 1.2, method="DOP853", tolerance=tolerance)
        for number, numbers in enumerate(both):
            np.testing.assert_allclose(run.kicks.time[run.kicks.link == number], own_kicks(*numbers, 1.2), atol=bound)


@pytest.mark.parametrize("short_by", [1e-3, 1e-5, 1e-7, 1e-9, -1e-9, -1e-7, -1e-5, -1e-3])
def test_a_grazing_swing_is_kicked_where_it_reaches_its_angle_and_only_there(short_by: float) -> None:
    """From the rest with the energy of 20 deg; the angle is short_by degrees more."""
    rate = math.degrees(2 * math.sqrt(G) * math.sin(math.radians(10)))
    scene = Scene(gravity=G, pendulum=(clock(1e-3, 20 + short_by, 0, rate=rate, damping=1e-15),))
    run = simulate(scene, 0.8, tolerance=1e-13)
    assert len(run.kicks.time) == (short_by < 0)


def test_equal_clocks_are_kicked_together_and_nearly_equal_ones_too() -> None:
    for aside in (0.0, 1e-13, 1e-9):
        twins = (clock(0.05, 5, 20, damping=0.02), clock(0.05, 5, 20 + math.degrees(aside), damping=0.02))
        run = simulate(Scene(gravity=G, support=Cart(mass=4.0), pendulum=twins), 10.0, tolerance=1e-12)
        first, second = (run.kicks.time[run.kicks.link == number] for number in (0, 1))
        assert len(first) == len(second) > 8
        np.testing.assert_allclose(first, second, atol=1e-9 + 100 * aside)
        assert run.energy_drift() < 1e-10
        assert run.momentum_drift() < 1e-11
        if not aside:
            np.testing.assert_array_equal(first, second)
            np.testing.assert_allclose(run.motion.links[:, 0], run.motion.links[:, 1], atol=1e-12)


def test_copies_have_their_own_escapements() -> None:
    three = clock(0.05, 5, 20, damping=0.02).model_copy(update={"count": 3})
    run = simulate(Scene(gravity=G, support=Cart(mass=4.0), pendulum=(three,)), 5.0, tolerance=1e-11)
    singles = Scene(gravity=G, support=Cart(mass=4.0), pendulum=(three.model_copy(update={"count": 1}),) * 3)
    np.testing.assert_array_equal(simulate(singles, 5.0, tolerance=1e-11).kicks.time, run.kicks.time)
    assert [int(np.sum(run.kicks.link == k)) for k in range(3)] == [len(run.kicks.time) // 3] * 3


@pytest.mark.parametrize(
    ("angle", "start", "rate", "first"),
    [
        (5.0, 5.0, 10.0, 0.0),  # at the angle, on the way out: at once
        (5.0, 5.0, -60.0, None),  # on the way in: not there, but on the other side
        (5.0, 12.0, 10.0, None),  # beyond it: the kick on that side is past
        (0.0, 0.0, 10.0, 0.0),
        (0.0, 0.0, -10.0, 0.0),
    ],
)
def test_a_start_at_the_angle_or_beyond(angle: float, start: float, rate: float, first: float | None) -> None:
    run = simulate(Scene(gravity=G, pendulum=(clock(0.01, angle, start, rate=rate),)), 3.0, tolerance=1e-10)
    assert len(run.kicks.time) > 1
    assert run.kicks.time[0] == first if first is not None else run.kicks.time[0] > 0.1
    assert np.all(run.kicks.energy > 0)


def test_a_clock_at_rest_at_its_angle_that_another_sets_going_is_kicked_as_it_leaves() -> None:
    """With an angle of 0 and no speed the way out is the way it is pulled."""
    scene = Scene(gravity=G, support=Cart(mass=4.0), pendulum=(clock(0.02, 0, 0), clock(0.02, 0, 20)))
    runs = [simulate(scene, 4.0, tolerance=tolerance) for tolerance in (1e-6, 1e-10, 1e-8)]
    for run in runs:
        assert run.kicks.time[0] == 0.0
        assert run.kicks.link[0] == 0
        np.testing.assert_allclose(run.kicks.time, runs[1].kicks.time, atol=1e-5)


def test_a_swing_within_the_angle_gets_nothing_and_dies() -> None:
    run = simulate(Scene(gravity=G, pendulum=(clock(0.1, 8, 7.9, damping=0.02),)), 30.0)
    assert len(run.kicks.time) == 0
    assert abs(run.motion.links[-1, 0]) < math.radians(7.9)


def test_standing_links_count_their_angle_from_the_standing_rest() -> None:
    """On a spring that holds it up."""
    link = Rod(mass=1.0, length=0.5, stiffness=20.0, damping=0.01, drive=Escapement(impulse=0.01, angle_deg=2))
    pendulum = Pendulum(links=(link,), equilibrium=("up",), start=InitialCondition(angles_deg=(185,)))
    run = simulate(Scene(gravity=G, pendulum=(pendulum,)), 10.0, tolerance=1e-12)
    at = [simulate(run.scene, 10.0, tolerance=1e-12, output=[t]).motion.links[-1, 0] for t in run.kicks.time[:3]]
    np.testing.assert_allclose(np.abs(np.rad2deg(at) - 180), 2.0, atol=1e-8)
    assert run.energy_drift() < 1e-10


# ----------------------------------------------------------------------------------------------- long runs, energy


def test_the_steady_swing_of_a_small_clock_is_where_feed_and_loss_balance() -> None:
    """Angle 0: v₊ = v₋ + P/I and v₋ = v₊ exp(−πζ/√(1−ζ²))."""
    P, damping, length = 2e-4, 0.01, 0.25
    moment, omega = length**2, math.sqrt(G / length)
    zeta = damping / moment / (2 * omega)
    fast = P / moment / (1 - math.exp(-math.pi * zeta / math.sqrt(1 - zeta**2)))
    run = simulate(Scene(gravity=G, pendulum=(clock(P, 0, 1, length=length, damping=damping),)), 250.0, tolerance=1e-11)
    assert run.kicks.energy[-20:].mean() == pytest.approx(P * (fast - P / moment / 2), rel=1e-5)
    assert np.diff(run.kicks.time[-5:]) == pytest.approx(math.pi / omega / math.sqrt(1 - zeta**2), rel=1e-4)


def test_energy_closes_over_hundreds_of_kicks_with_dampers_everywhere() -> None:
    links = (Rod(mass=1.0, length=0.3, damping=0.005, drive=Escapement(impulse=0.01, angle_deg=3)),)
    low = Rod(mass=0.3, length=0.2, damping=0.002, drive=Escapement(impulse=0.001, angle_deg=1))
    two = Pendulum(links=(*links, low), start=InitialCondition(angles_deg=(12, 15)))
    single = Pendulum(links=links, start=InitialCondition(angles_deg=(-9,)))
    scene = Scene(gravity=G, support=Cart(mass=8.0, damping=0.5, stiffness=2.0), pendulum=(two, single))
    run = simulate(scene, 50.0, tolerance=1e-12, output=101)
    assert len(run.kicks.time) >= 200
    assert run.energy_drift() < 1e-9
    assert np.all(np.diff(run.kicks.time) >= 0)


# ------------------------------------------------------------------------------- stopping, going on, keeping on disk


def beside_a_clock(**cart: float) -> Scene:
    pendula = (clock(0.05, 5, 20, damping=0.02), clock(0.05, 4, -13, damping=0.02, length=0.8))
    return Scene(gravity=G, support=Cart(mass=4.0, **cart), pendulum=pendula)


def test_an_event_that_stops_leaves_only_the_kicks_before_it() -> None:
    scene = beside_a_clock()
    whole = simulate(scene, 6.0, tolerance=1e-11)
    event = level_crossing(system_of(scene), "theta[1,1]", math.radians(4.0), 1, stop=True)
    run = simulate(scene, 6.0, tolerance=1e-11, events=[event])
    assert not run.complete
    np.testing.assert_allclose(run.kicks.time, whole.kicks.time[whole.kicks.time <= run.times[-1]], atol=1e-9)


@pytest.mark.parametrize(("impulse", "mass"), [(0.2, 2.0), (0.4, 0.5)])
def test_a_cart_that_a_kick_turns_back_has_turned(impulse: float, mass: float) -> None:
    """Every change of sign of its velocity is found, those in an instant too."""
    pendula = (clock(impulse, 8, 12), clock(0.05, 3, -15, length=0.9))
    scene = Scene(gravity=G, support=Cart(mass=mass), pendulum=pendula)
    run = simulate(scene, 6.0, tolerance=1e-10, events=[turning_point(system_of(scene), "x")], output=60001)
    signs = np.sign(run.motion.cart_rate)
    assert len(run.happenings) == np.count_nonzero(signs[1:] * signs[:-1] < 0)
    at = [happening.time for happening in run.happenings if np.any(happening.time == run.kicks.time)]
    assert at
    stopped = simulate(
        scene, 6.0, tolerance=1e-10, events=[turning_point(system_of(scene), "x", stop=True)], start=run.motion[0]
    )
    assert stopped.run.stopped.startswith("x turns")
    assert stopped.times[-1] == pytest.approx(run.happenings[0].time, abs=1e-8)


def test_a_run_that_a_kick_stops_ends_behind_the_kick() -> None:
    scene = Scene(gravity=G, support=Cart(mass=0.5), pendulum=(clock(1.0, 8, 12), clock(0.05, 3, -15, length=0.9)))
    event = Event("it is fast", lambda state: abs(state.link_rates[0]) - 1.0, stop=True)
    run = simulate(scene, 6.0, tolerance=1e-10, events=[event])
    assert run.times[-1] == run.kicks.time[-1]
    assert run.kicks.link[-1] == 0
    assert run.energy_drift() < 1e-8
    assert abs(run.final.link_rates[0]) > 1.0


def test_the_summary_says_what_escapements_did() -> None:
    run = simulate(beside_a_clock(), 6.0)
    assert f"drives      {len(run.kicks.time)} kicks supplied {run.kicks.energy.sum():.6g} J" in summary.text(run)
    assert "drives" not in summary.text(simulate(load("paper-cart-1"), 1.0))


def test_a_run_goes_on_where_it_stopped() -> None:
    scene = beside_a_clock(damping=0.3)
    whole = simulate(scene, 12.0, tolerance=1e-12, output=13)
    half = simulate(scene, 6.0, tolerance=1e-12, output=7)
    rest = resume(half, 6.0, output=7)
    np.testing.assert_allclose(rest.motion.links, whole.motion.links[6:], atol=1e-9)
    both = np.concatenate((half.kicks.time, rest.kicks.time))
    np.testing.assert_allclose(both, whole.kicks.time, atol=1e-9)


@pytest.mark.parametrize("kind", ["npz", "csv"])
def test_kicks_on_disk(tmp_path: Path, kind: str) -> None:
    run = simulate(beside_a_clock(), 6.0)
    path = tmp_path / f"run.{kind}"
    recordings.save(run, path)
    back = recordings.load(path)
    for column, other in zip(run.kicks, back.kicks, strict=True):
        np.testing.assert_array_equal(column, other)
    assert back.scene == run.scene
    assert len(back.kicks.time) > 8


def test_a_run_that_goes_on_knows_which_side_has_had_its_kick() -> None:
    pendulum = clock(1e-3, 8.0, -10.0, damping=0.1)
    first = simulate(Scene(gravity=G, pendulum=(pendulum,)), 1.6)
    assert first.kicks.impulse.tolist() == [1e-3]
    pushed = replace(first.final, links=np.radians([6.0]), link_rates=np.array([1.0]))
    again = resume(replace(first, motion=_ending(first, pushed)), 0.5)
    assert np.degrees(again.motion.links.max()) > 8.0
    assert again.kicks.time.size == 0
    assert simulate(first.scene, 0.5, start=pushed).kicks.time.size == 1


def _ending(run: Trajectory, state: State) -> Motion:
    links, rates = run.motion.links.copy(), run.motion.link_rates.copy()
    links[-1], rates[-1] = state.links, state.link_rates
    return replace(run.motion, links=links, link_rates=rates)


def test_ctrl_c_keeps_the_kicks_so_far() -> None:
    def interrupt(elapsed: float) -> None:
        if elapsed > 3.0:
            os.kill(os.getpid(), signal.SIGINT)

    run = simulate(beside_a_clock(), 10.0, report=interrupt)
    assert run.run.interrupted
    assert len(run.kicks.time) > 3
    assert run.kicks.time[-1] <= run.times[-1]
    assert run.energy_drift() < 1e-6


# ------------------------------------------------------------------------------------------------------- refusals


def link_with(**drive: object) -> dict[str, object]:
    link = {"kind": "bob", "mass": 1.0, "length": 1.0, "drive": drive}
    return {"gravity": G, "pendulum": [{"links": [link], "start": {"angles_deg": [10]}}]}


@pytest.mark.parametrize(
    ("drive", "words"),
    [
        ({"kind": "van-der-pol", "strength": -1.0, "angle_deg": 5.0}, "drive.strength = -1.0: must be positive"),
        ({"kind": "van-der-pol", "strength": 1.0, "angle_deg": 0.0}, "drive.angle_deg = 0.0: must be positive"),
        ({"kind": "van-der-pol", "strength": 1.0}, "drive.angle_deg: is required"),
        ({"kind": "van-der-pol", "strength": math.nan, "angle_deg": 5.0}, "drive.strength = nan: must be finite"),
        ({"kind": "van-der-pol", "strength": 1e300, "angle_deg": 5.0}, "drive.strength = 1e+300"),
        ({"kind": "van-der-pol", "strength": 1.0, "impulse": 1.0, "angle_deg": 5.0}, "drive.impulse: does not belong"),
        ({"kind": "escapement", "angle_deg": 5.0}, "drive.impulse: is required"),
        ({"kind": "escapement", "impulse": 0.0}, "drive.impulse = 0.0: must be positive"),
        ({"kind": "escapement", "impulse": 1.0, "angle_deg": -3.0}, "drive.angle_deg = -3.0: must not be negative"),
        ({"kind": "escapement", "impulse": 1.0, "angle_deg": 180.0}, "drive.angle_deg = 180.0"),
        ({"kind": "escapement", "impulse": "hard"}, 'drive.impulse = "hard": must be a number'),
        ({"kind": "verge", "impulse": 1.0}, 'drive.kind = "verge": must be one of'),
        ({"impulse": 1.0}, 'drive: needs a kind, one of "van-der-pol", "escapement"'),
    ],
)
def test_what_is_wrong_with_a_drive_is_said_once_with_its_place(drive: dict[str, object], words: str) -> None:
    with pytest.raises(SceneError) as refusal:
        scene_from(link_with(**drive))
    assert refusal.value.problems[0].startswith(f"pendulum[0].links[0].{words}")
    assert len(refusal.value.problems) == 1


PLACE = "pendulum[0].links[0].drive"


def test_each_refusal_of_a_drive_names_the_place_or_the_argument() -> None:
    scene = beside_a_clock()
    with pytest.raises(SceneError) as refusal:
        scene_from(link_with(kind="escapement", impulse=1.0) | {"space": "space"})
    assert refusal.value.problems == (f'{PLACE}: needs space = "plane"',)
    for form in ("maximal", "hamiltonian"):
        with pytest.raises(SceneError, match=f"drive: form {form}"):
            simulate(scene, 1.0, form=form)
    refusals = {
        "drive: motion in a few modes": lambda: simulate_truncated(scene, 1.0, 2),
    }
    for words, action in refusals.items():
        with pytest.raises(SceneError, match=words) as refused:
            action()
        assert len(refused.value.problems) == 1


def test_tables_and_matrices_leave_drives_out_and_the_table_says_so() -> None:
    scene = beside_a_clock()
    driven, bare = natural_modes(scene), natural_modes(scene.undriven)
    np.testing.assert_array_equal(driven.eigenvalue, bare.eigenvalue)
    assert any("Drives are omitted" in note for note in driven.notes)
    assert not any("Drives are omitted" in note for note in bare.notes)
    model, other = matrices(scene), matrices(scene.undriven)
    for name in ("M", "K", "D"):
        np.testing.assert_array_equal(getattr(model, name), getattr(other, name))
    assert scene_from(describe(scene)) == scene


def test_a_check_leaves_drives_out_and_says_so() -> None:
    scene = beside_a_clock(damping=0.1)
    driven, bare = (check(each, [2], (1.0, 10.0), periods=12) for each in (scene, scene.undriven))
    assert driven.rows[0].kappa == bare.rows[0].kappa
    assert "Drives are omitted" in check_table(driven, "text")
    assert "drives" not in check_table(bare, "text")
