"""Dry friction: closed forms, a smoothed law, energy, rest, kicks, many phases."""

from __future__ import annotations

from dataclasses import replace
from math import cos, pi, sin, sqrt
from typing import Any

import numpy as np
import pytest
from amounts import usually
from scipy.optimize import brentq
from test_hamiltonian import dense_M

from modal.scene import Cart, Scene, scene_from
from nonlinear import SimulationError, simulate
from nonlinear.integration import Choice, Trajectory, equations_of, floats
from nonlinear.integration.floats import samples
from nonlinear.integration.switches import Switched
from nonlinear.postprocessing import reaction_forces_of
from nonlinear.simulation import resume
from nonlinear.system import AppliedForces, State, system_of, turning_point

G = 9.81


def bob(**more: Any) -> dict[str, Any]:
    return {"kind": "bob", "mass": 1.0, "length": 1.0, **more}


def scene_of(*links: dict[str, Any], angles: tuple[float, ...] = (), **more: Any) -> Scene:
    hung = {"links": list(links), "start": {"angles_deg": list(angles or [0.0] * len(links))}}
    return scene_from({"gravity": G, "pendulum": [hung], **more})


def block(**cart: float) -> Scene:
    """A block on a rail; the pendulum on it hardly weighs anything."""
    return scene_of(bob(mass=1e-12, length=1e3), support={"kind": "cart", "mass": 1.0, **cart})


def begun(x: float = 0.0, speed: float = 0.0) -> State:
    return State(np.zeros(1), np.zeros(1), x, speed)


# -------------------------------------------------------------------------------------------------- closed forms


def coulomb(x: float, stuck: float, omega: float, times: np.ndarray) -> np.ndarray:
    """x(t) of a block on a spring let go at x: harmonic about ±stuck in turn until it is within (Lorenz 1902)."""
    positions, half = np.empty_like(times), pi / omega
    for k in range(1 + int(times[-1] / half)):
        here = (times >= k * half) & (times <= (k + 1) * half)
        if abs(x) <= stuck:
            positions[times >= k * half] = x
            break
        centre = stuck * np.sign(x)
        positions[here] = centre + (x - centre) * np.cos(omega * (times[here] - k * half))
        x = 2 * centre - x
    return positions


def test_a_block_on_a_spring_follows_lorenz() -> None:
    run = simulate(block(stiffness=4.0, friction=0.3), 20.0, start=begun(1.0), tolerance=1e-12, output=401)
    assert run.motion.cart == pytest.approx(coulomb(1.0, 0.075, 2.0, run.times), abs=1e-10)
    assert run.friction.begin == pytest.approx([7 * pi / 2], abs=1e-9)
    assert run.friction.link.tolist() == [-1]
    assert run.friction.work[0] == pytest.approx(-0.3 * sum(2 * (1 - 0.15 * k) - 0.15 for k in range(7)), rel=1e-9)


def test_a_coefficient_stops_a_block_on_a_level_rail() -> None:
    run = simulate(block(friction_coefficient=0.2), 3.0, start=begun(0.0, 2.0), tolerance=1e-11)
    assert run.friction.begin == pytest.approx([2.0 / (0.2 * G)], rel=1e-9)
    assert run.final.cart == pytest.approx(2.0**2 / (2 * 0.2 * G), rel=1e-9)
    assert run.friction.work[0] == pytest.approx(-2.0, rel=1e-8)


def swings(amplitude: float, torque: float, weight: float) -> list[float]:
    """The turning angles of a pendulum: weight (cos a' − cos a) = torque (a + a'), exactly, until it is held."""
    amplitudes = [amplitude]
    while weight * sin(amplitudes[-1]) > torque:
        a = amplitudes[-1]
        amplitudes.append(
            brentq(lambda b, a=a: weight * (cos(b) - cos(a)) - torque * (a + b), a * (1e-7 - 1), a, xtol=1e-15)
        )
    return amplitudes


@pytest.mark.parametrize("degrees", [170.0, 40.0, 2.0])
def test_turning_angles_of_a_pendulum(degrees: float) -> None:
    torque = 0.004 * degrees
    scene = scene_of(bob(friction=torque), angles=(degrees,))
    turn = turning_point(simulate_system(scene), "theta[1,1]")
    run = simulate(scene, 60.0, tolerance=1e-12, events=[turn])
    expected = swings(np.radians(degrees), torque, G)
    turned = [abs(float(happening.state.links[0])) for happening in run.happenings]
    assert len(expected) > 5
    assert turned[: len(expected) - 2] == pytest.approx([abs(a) for a in expected[1:-1]], abs=1e-9)
    assert abs(run.final.links[0]) == pytest.approx(abs(expected[-1]), abs=1e-9)
    assert abs(G * sin(run.final.links[0])) <= torque
    assert np.all(run.motion.links[run.times > run.friction.rest] == run.final.links)


def simulate_system(scene: Scene) -> Any:
    from nonlinear.system import system_of

    return system_of(scene)


def test_noted_lose_the_same_angle_each_time() -> None:
    torque = 1e-7
    scene = scene_of(bob(friction=torque), angles=(1e-4,))
    run = simulate(scene, 25.0, tolerance=1e-12, events=[turning_point(simulate_system(scene), "theta[1,1]")])
    turned = np.array([abs(happening.state.links[0]) for happening in run.happenings])
    assert np.diff(turned[:-1]) == pytest.approx(-2 * torque / G, rel=1e-5)


# --------------------------------------------------------------------------------------------- forced: Den Hartog


def forced(beta: float, friction: float, periods: int, tolerance: float = 1e-9) -> Trajectory:
    """m = k = 1, P cos βt with P = 1, sampled 200 times a period, from rest."""
    times = np.linspace(0.0, 2 * pi / beta * periods, 200 * periods + 1)
    scene = block(stiffness=1.0, friction=friction)
    push = lambda time, state: AppliedForces(cos(beta * time))  # noqa: E731
    return simulate(scene, times[-1], start=begun(), load=push, tolerance=tolerance, output=times)


def den_hartog(beta: float, friction: float) -> tuple[float, float]:
    """Amplitude of motion without stops, and the largest friction that permits it (Trans. ASME 53, APM-107 (1931))."""
    V, U = 1 / (1 - beta**2), sin(pi / beta) / (beta * (1 + cos(pi / beta)))
    return sqrt(V**2 - friction**2 * U**2), sqrt(V**2 / (U**2 + 1 / beta**4))


@pytest.mark.parametrize("beta", usually([0.7], [0.7, 1.4]))
def test_amplitude_and_boundary_of_den_hartog(beta: float) -> None:
    _, boundary = den_hartog(beta, 0.0)
    sliding = forced(beta, 0.9 * boundary, 40)
    assert np.abs(sliding.motion.cart[-400:]).max() == pytest.approx(den_hartog(beta, 0.9 * boundary)[0], rel=3e-4)
    late = sliding.friction.end > sliding.times[-1] * 0.8
    assert not late.any()
    stopping = forced(beta, 1.1 * boundary, 20)
    assert np.count_nonzero(stopping.friction.begin > stopping.times[-1] * 0.8) >= 6


def test_hamel_slow_forcing_sticks_and_jumps_without_drift() -> None:
    run = forced(0.1, 0.8, 8, 1e-11)
    phases = run.friction
    late = phases.begin > run.times[-1] / 2
    assert np.count_nonzero(late) > 7
    period = 2 * pi / 0.1
    early, after = run.motion.cart[200 * 4 : 200 * 5], run.motion.cart[200 * 7 : 200 * 8]
    assert after == pytest.approx(early, abs=1e-4)
    assert phases.begin[-1] < run.times[-1] < phases.begin[-1] + period
    assert run.energy_drift() < 1e-9


# --------------------------------------------------------------------------------------- several contacts, smoothing

MANY = {
    "joints": scene_of(bob(friction=0.3), bob(friction=0.2, mass=0.7), angles=(40.0, -30.0)),
    "rail and joint": scene_of(
        bob(), bob(friction=0.2, mass=0.7), angles=(40.0, -30.0), support={"kind": "cart", "mass": 2.0, "friction": 0.5}
    ),
    "coefficient": scene_of(
        bob(friction=0.1),
        bob(friction=0.2, mass=0.7, damping=0.01, quadratic_drag=0.02),
        angles=(70.0, -30.0),
        support={"kind": "cart", "mass": 2.0, "friction_coefficient": 0.1},
    ),
    "escapement": scene_of(
        bob(friction=0.05, drive={"kind": "escapement", "impulse": 0.1, "angle_deg": 2.0}), angles=(10.0,)
    ),
}


@pytest.mark.parametrize("name", MANY)
def test_books_close_and_what_sticks_is_at_rest(name: str) -> None:
    scene = MANY[name]
    run = simulate(scene, usually(6.0 if name == "escapement" else 3.0, 8.0), tolerance=1e-12)
    assert run.energy_drift() < 1e-9
    record, system = run.friction, run.system
    above = np.concatenate([[-1], np.arange(system.n_links - 1)])
    for link, begin, end in zip(record.link, record.begin, record.end, strict=True):
        inside = (run.times > begin) & (run.times < end)
        rates = run.motion.link_rates[inside]
        speed = run.motion.cart_rate[inside]
        if link >= 0:
            speed = rates[:, link] - (rates[:, above[link]] if above[link] >= 0 else 0.0)
        assert not speed.any()
    if name != "coefficient" and name != "escapement":
        assert record.work.sum() == pytest.approx(run.motion.work[-1], rel=1e-9)
    if name == "escapement":
        assert record.work.sum() + run.kicks.energy.sum() == pytest.approx(run.motion.work[-1], abs=1e-9)
        assert len(run.kicks.time) > 5


LONG = 2.5
ROUGH = scene_of(
    bob(friction=0.5),
    bob(friction=0.8, mass=0.7),
    angles=(60.0, -40.0),
    support={"kind": "cart", "mass": 1.0, "friction": 3.0},
)


def test_it_is_the_limit_of_smooth_laws() -> None:
    """τ = −M tanh(γ'/ε) creeps by O(ε): halving ε halves the distance."""
    scene = ROUGH
    limits = [link.friction for link in scene.links()]
    rail = scene.support.friction if isinstance(scene.support, Cart) else 0.0
    times = np.linspace(0.0, LONG, 51)
    exact = simulate(scene, LONG, output=times, tolerance=1e-11)
    assert len(exact.friction.link) > 1

    def smooth(width: float) -> np.ndarray:
        def load(time: float, state: State) -> AppliedForces:
            torque = -np.array(limits) * np.tanh(np.diff(state.link_rates, prepend=0.0) / width)
            return AppliedForces(-rail * np.tanh(state.cart_rate / width), torque - np.append(torque[1:], 0.0))

        bare = scene.frictionless
        return simulate(bare, LONG, output=times, load=load, method="Radau", tolerance=1e-8).motion.links

    distances = [float(np.abs(smooth(width) - exact.motion.links).max()) for width in (2e-3, 1e-3)]
    assert distances[-1] < 3e-3
    assert distances[0] / distances[1] == pytest.approx(2.0, abs=0.2)


def test_friction_on_the_rail_is_the_coefficient_times_its_reaction() -> None:
    run = simulate(MANY["coefficient"], 4.0, tolerance=1e-10, output=101)
    equations = equations_of(run.system, Choice("minimal", "DOP853", False, ""))
    assert isinstance(equations, Switched)
    normal, friction = reaction_forces_of(run).normal, equations.switches.function("friction")
    for row in range(5, 101, 8):
        state, time = run.motion[row], float(run.times[row])
        y = equations.begin(state)
        equations.release(time, y)
        force, *_, reaction = friction(y.tolist(), equations.inputs_at(time, y.tolist()), ())
        assert reaction == pytest.approx(normal[row], rel=1e-9)
        assert abs(force) <= 0.1 * abs(normal[row]) * (1 + 1e-9)
        if state.cart_rate:
            assert force == pytest.approx(-np.sign(state.cart_rate) * 0.1 * abs(normal[row]))


def test_friction_with_a_coefficient_works_in_many_steps_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    calls = []

    def counted(step: Any, times: Any) -> Any:
        calls.append(len(times))
        return samples(step, times)

    monkeypatch.setattr(floats, "samples", counted)

    def push(time: float, state: State) -> AppliedForces:
        return AppliedForces(0.3 * sin(time) - 0.1 * state.links[0])

    run = simulate(MANY["coefficient"], 2.0, tolerance=1e-10, load=push, output=11)
    assert run.run.steps > 50
    assert len(calls) <= 4
    assert run.energy_drift() < 1e-9


def test_a_run_goes_on_where_it_stopped() -> None:
    whole = simulate(MANY["joints"], 10.0, output=101, tolerance=1e-12)
    for stop in (3.0, 5.5):
        first = simulate(MANY["joints"], stop, output=11, tolerance=1e-12)
        rest = resume(first, 10.0 - stop, output=11)
        assert rest.final.links == pytest.approx(whole.final.links, abs=1e-9)


def test_a_start_within_the_limit_stays() -> None:
    run = simulate(scene_of(bob(friction=1.0), angles=(5.0,)), 10.0)
    assert run.friction.rest == 0.0
    assert run.run.steps == 0
    assert np.ptp(run.motion.links) == 0.0


def test_a_load_breaks_what_sticks_loose_when_it_exceeds_the_limit() -> None:
    push = lambda time, state: AppliedForces(0.1 * time)  # noqa: E731
    run = simulate(block(friction=0.5), 8.0, start=begun(), load=push, tolerance=1e-11, output=81)
    assert run.friction.end[0] == pytest.approx(5.0, abs=1e-9)
    assert run.final.cart == pytest.approx(0.1 * 3.0**3 / 6, rel=1e-8)


@pytest.mark.parametrize("cart", [None, {"friction": 1.5}, {"friction_coefficient": 0.08}])
def test_a_hoist_keeps_its_books_with_friction(cart: dict[str, float] | None) -> None:
    """The energy changes by the work of the winch, of friction and of drives alone, through many phases."""
    rope = bob(friction=1.2, mass=3.0, hoist={"to": 0.5, "begin": 0.5, "duration": 3.0})
    more = {"support": {"kind": "cart", "mass": 2.0, **cart}} if cart else {}
    run = simulate(scene_of(rope, bob(friction=0.8, length=0.6), angles=(50.0, -30.0), **more), 6.0, tolerance=1e-12)
    assert len(run.friction.begin) > 1
    assert np.all(run.friction.work < 0)
    assert run.energy_drift() < 1e-9


def test_lowering_breaks_a_rope_loose_where_its_weight_exceeds_the_friction() -> None:
    """m g l sin θ = M at l = 1.5, half-way; nothing else turns a rope at rest, and what holds it knows no l''."""
    scene = scene_of(
        bob(friction=1.5 * G * sin(pi / 6), hoist={"to": 2.0, "begin": 0.5, "duration": 2.0}), angles=(30.0,)
    )
    run = simulate(scene, 3.0, tolerance=1e-11)
    assert run.friction.begin[0] == 0.0
    assert run.friction.end[0] == pytest.approx(1.5, abs=1e-9)
    assert np.isnan(run.friction.rest)


def test_a_shaken_pivot_breaks_its_link_loose() -> None:
    """m l A ω² sin ωt = M, from rest."""
    shaken = {"kind": "moved", "motion": {"kind": "sine", "amplitude": 0.1, "frequency_hz": 1.0}}
    run = simulate(scene_of(bob(friction=2.0), support=shaken), 1.0, tolerance=1e-11)
    omega = 2 * pi
    assert run.friction.end[0] == pytest.approx(np.arcsin(2.0 / (0.1 * omega**2)) / omega, abs=1e-9)
    assert run.energy_drift() < 1e-9


def test_chatter_ends() -> None:
    """A load that exceeds the limit only by rounding, at its peak, and a mass that is pushed from both sides."""
    push = lambda time, state: AppliedForces(0.5 * sin(3 * time) * (1 + 1e-15))  # noqa: E731
    run = simulate(block(friction=0.5), 20.0, start=begun(), load=push)
    assert np.abs(run.motion.cart).max() < 1e-9
    assert run.run.steps < 3000


def test_who_cannot_take_friction_says_so() -> None:
    from modal.errors import SceneError

    scene = scene_of(bob(friction=0.1), angles=(5.0,))
    for how, words in [
        ({"form": "maximal"}, "friction = 0.1: form maximal"),
        ({"form": "hamiltonian"}, "friction = 0.1: form hamiltonian"),
        ({"method": "taylor"}, "friction = 0.1: method taylor"),
        (
            {"method": "RK45"},
            "friction = 0.1: a method other than DOP853 does not support stick-slip.* DOP853 takes it",
        ),
        ({"method": "Radau"}, "friction = 0.1: an implicit method does not support stick-slip.* DOP853 takes it"),
    ]:
        with pytest.raises(SceneError, match=words):
            simulate(scene, 1.0, **how)


def test_hundreds_of_phases_do_not_drift() -> None:
    run = forced(0.5, 0.9, 50)
    assert len(run.friction.link) > 95
    cart = run.motion.cart.reshape(-1)[:-1].reshape(50, 200)
    assert cart[-1] == pytest.approx(cart[30], abs=1e-7)
    assert run.energy_drift() < 1e-7


@pytest.mark.parametrize("kind", ["npz", "csv"])
def test_files_keep_what_friction_did(tmp_path: Any, kind: str) -> None:
    from nonlinear import files

    path = tmp_path / f"run.{kind}"
    for scene in (MANY["joints"], scene_of(bob(friction=1.0), angles=(5.0,))):
        run = simulate(scene, 15.0, output=31)
        files.save(run, path)
        read = files.load(path)
        assert repr(read.friction) == repr(run.friction)
        assert resume(read, 1.0).final.links == pytest.approx(run.final.links)
    files.save(replace(run, run=replace(run.run, method="RK45")), path)  # which took friction once
    assert files.load(path).run.method == "RK45"


@pytest.mark.parametrize("seed", range(4))
def test_random_scenes_keep_their_books(seed: int) -> None:
    """Friction of every size at every joint, with springs, drag, drives and loads, on carts and off."""
    rng = np.random.default_rng(seed)

    def link() -> dict[str, Any]:
        return bob(
            mass=rng.uniform(0.2, 2.0),
            length=rng.uniform(0.3, 1.0),
            friction=rng.choice([0.0, 0.05, 0.5, 3.0]),
            stiffness=rng.choice([0.0, 2.0]),
            quadratic_drag=rng.choice([0.0, 0.1]),
            drive={"kind": "van-der-pol", "strength": 0.1, "angle_deg": 20.0},
        )

    links = [link() for _ in range(2 + seed % 2)]
    cart = {"support": {"kind": "cart", "mass": 1.0, "friction": 1.5}} if seed % 2 else {}
    scene = scene_of(*links, angles=tuple(rng.uniform(-90, 90, len(links))), **cart)
    push = lambda time, state: AppliedForces(0.0, np.full(len(links), 0.3 * cos(4 * time)))  # noqa: E731
    run = simulate(scene, 4.0, tolerance=1e-11, load=push if seed > 1 else None)
    assert run.energy_drift() < 1e-9
    assert np.all(run.friction.end >= run.friction.begin)
    assert np.all(run.friction.work <= 0)


def jamming() -> Scene:
    """Two links above one another that turn fast push the cart into its rail the harder, the more the rail rubs."""
    links = [{"kind": "bob", "mass": 1.0, "length": 0.761}, {"kind": "rod", "mass": 1.0, "length": 0.753}]
    start = {"angles_deg": [30.0, 30.0], "rates_deg": [1292.0, 1292.0]}
    support = {"kind": "cart", "mass": 0.032, "friction_coefficient": 0.752}
    return scene_from({"gravity": 9.81, "support": support, "pendulum": [{"links": links, "start": start}]})


@pytest.mark.parametrize("tolerance", usually([1e-3, 1e-9], [1e-3, 1e-9, 1e-13]))
def test_a_rail_that_jams_says_so_where_the_mass_matrix_does(tolerance: float) -> None:
    """N = (N₀)/(1 + s μ e n₀) loses its value where 1 = μ n₀, n₀ = Σ b sin θ (M⁻¹ e_x), by the dense M of the scene."""
    scene = jamming()
    with pytest.raises(SimulationError, match="coefficient is too large") as caught:
        simulate(scene, 1.0, tolerance=tolerance, output=1001)
    run = caught.value.trajectory
    assert run.times[-1] == pytest.approx(0.12481666, abs=2e-4 if tolerance > 1e-5 else 2e-5)
    links = run.final.links
    pair = system_of(scene).groups[0].block.b.ravel()
    response = np.linalg.solve(dense_M(scene, np.concatenate(([run.final.cart], links))), np.eye(3)[0])
    assert 1 - 0.752 * float(pair * np.sin(links) @ response[1:]) == pytest.approx(0.0, abs=1e-2)
