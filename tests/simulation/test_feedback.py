"""Loops of feedback in motion, against one's own equations of a cart with a bob, and as loads written in Python."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from modal.errors import ComputationError, SceneError
from modal.scene import Scene, scene_from
from nonlinear import ensemble, simulate
from nonlinear.postprocessing import reaction_forces_of
from nonlinear.system import AppliedForces, State

MASS, BOB, LENGTH, GRAVITY = 100.0, 20.0, 5.0, 9.81
K = np.array([30.0, -200.0, 80.0, -100.0])
"""Of x, theta, x', theta'."""
STATES = ["x", "theta_1_1", "x_dot", "theta_dot_1_1"]
REFERENCE = 0.5


def crane(feedback: list[dict[str, Any]], **more: Any) -> Scene:
    link = {"kind": "bob", "mass": BOB, "length": LENGTH}
    pendulum = [{"links": [link], "start": {"angles_deg": [20.0]}}]
    support = {"kind": "cart", "mass": MASS}
    return scene_from({"gravity": GRAVITY, "support": support, "pendulum": pendulum, "feedback": feedback, **more})


def single_loops(**more: Any) -> list[dict[str, Any]]:
    loops = [{"input": "cart_force", "output": name, "gain": g} for name, g in zip(STATES, K.tolist(), strict=True)]
    return [{**loop, **more, **({"reference": REFERENCE} if loop["output"] == "x" else {})} for loop in loops]


def falls(t: float, z: Any, force: Any) -> Any:
    """Newton's law for the cart and, about the pivot, for the bob; the last is the work of the force."""
    _x, theta, v, w, _ = z
    u = force(t, z)
    M = np.array([[MASS + BOB, BOB * LENGTH * np.cos(theta)], [np.cos(theta), LENGTH]])
    rest = [u + BOB * LENGTH * np.sin(theta) * w * w, -GRAVITY * np.sin(theta)]
    return [v, w, *np.linalg.solve(M, rest), u * v]


def swung(force: Any, begin: float, end: float, z: Any) -> Any:
    limits = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-13, "max_step": 0.05}
    return solve_ivp(falls, (begin, end), z, args=(force,), **limits).y[:, -1]


AT_START = np.array([0.0, np.radians(20.0), 0.0, 0.0, 0.0])


def last(run: Any) -> Any:
    motion = run.motion
    return np.array(
        [motion.cart[-1], motion.links[-1, 0], motion.cart_rate[-1], motion.link_rates[-1, 0], motion.work[-1]]
    )


def law(z: Any, limit: float = np.inf) -> float:
    """The four loops, each within its limit."""
    return float(np.clip(-K * (z[:4] - [REFERENCE, 0.0, 0.0, 0.0]), -limit, limit).sum())


@pytest.mark.parametrize(
    ("form", "method"),
    [
        ("minimal", "DOP853"),
        ("minimal", "taylor"),
        ("minimal", "Radau"),
        ("minimal", "LSODA"),
        ("hamiltonian", "DOP853"),
    ],
)
@pytest.mark.parametrize("limit", [None, 12.0])
def test_a_continuous_loop_is_that_of_own_equations(form: str, method: str, limit: float | None) -> None:
    if method == "taylor":
        pytest.importorskip("heyoka")
    scene = crane(single_loops() if limit is None else single_loops(limit=limit))
    if method == "taylor" and limit is not None:
        with pytest.raises(SceneError, match="no series across the kink"):
            simulate(scene, 4.0, form=form, method=method)
        return
    run = simulate(scene, 4.0, form=form, method=method, tolerance=1e-11)
    expected = swung(lambda t, z: law(z, limit or np.inf), 0.0, 4.0, AT_START)
    assert last(run) == pytest.approx(expected, abs=1e-8)
    assert run.energy_drift() < 1e-8  # the books count the work of the loop, expected[-1]


@pytest.mark.parametrize("method", ["DOP853", "RK45", "LSODA", "Radau"])
def test_a_sampled_loop_is_held_between_samples_and_acts_after_its_delay(method: str) -> None:
    period, late, limit = 0.1, 2, 30.0
    matrix = {"input": "cart_force", "gains": {"states": STATES, "rows": [K.tolist()]}}
    scene = crane([{**matrix, "limit": limit, "sample_time": period, "delay": late * period}])
    z, held = AT_START, list[float]()
    for k in range(30):
        held.append(float(np.clip(-K @ z[:4], -limit, limit)))
        u = held[k - late] if k >= late else 0.0
        z = swung(lambda t, z, u=u: u, k * period, (k + 1) * period, z)
    run = simulate(scene, 30 * period, method=method, tolerance=1e-10)
    assert last(run) == pytest.approx(z, abs=1e-7)
    assert run.energy_drift() < 1e-7
    fast = simulate(scene, 30 * period, method=method, tolerance=1e-10)  # samples are those of this run alone
    assert np.array_equal(last(fast), last(run))


def test_loops_with_samples_of_their_own_meet_at_common_times() -> None:
    """0.3 s is 3 × 0.1 s to a rounding."""
    loops = [
        {"input": "cart_force", "output": "x_dot", "gain": 80.0, "sample_time": 0.1},
        {"input": "torque_1_1", "output": "theta_dot_1_1", "gain": 50.0, "sample_time": 0.3},
    ]
    force = {"on": "cart", "kind": "sine", "amplitude": 5.0, "frequency_hz": 0.4}
    scene = crane(loops, force=[force])
    run = simulate(scene, 2.0)
    z, u, tau = AT_START, 0.0, 0.0
    for k in range(20):
        u = -80.0 * z[2]
        tau = -50.0 * z[3] if k % 3 == 0 else tau

        def push(t: float, z: Any, u: float = u) -> float:
            return u + 5.0 * np.sin(2 * np.pi * 0.4 * t)

        def both(t: float, z: Any, tau: float = tau, push: Any = push) -> Any:
            rates = np.array(falls(t, z, push))
            M = np.array([[MASS + BOB, BOB * LENGTH * np.cos(z[1])], [BOB * LENGTH * np.cos(z[1]), BOB * LENGTH**2]])
            rates[2:4] += np.linalg.solve(M, [0.0, tau])
            rates[4] += tau * z[3]
            return rates

        z = solve_ivp(both, (0.1 * k, 0.1 * (k + 1)), z, method="DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
    assert last(run) == pytest.approx(z, abs=1e-8)


def test_loops_are_loads_written_in_python_on_chains_points_and_structures() -> None:
    """The same motion by a second route: forces that a Python function returns."""
    link = {"kind": "rod", "mass": 1.0, "length": 0.8}
    chain = {"gravity": 9.81, "pendulum": [{"links": [link, link], "start": {"angles_deg": [20.0, -10.0]}}]}
    torque = {"input": "torque_1_2", "output": "rel_1_2", "gain": 4.0}
    wind = {"input": "force:pendulum[0].links[1]@0.5", "output": "theta_dot_1_1", "gain": 1.5, "limit": 0.7}

    def moments(time: float, state: State) -> AppliedForces:
        (a, b), (da, _) = state.links, state.link_rates
        bending, push = -4.0 * (b - a), float(np.clip(-1.5 * da, -0.7, 0.7))
        return AppliedForces(moments=np.array([push * 0.8 * np.cos(a) - bending, push * 0.5 * np.cos(b) + bending]))

    looped = simulate(scene_from({**chain, "feedback": [torque, wind]}), 3.0, tolerance=1e-11)
    loaded = simulate(scene_from(chain), 3.0, load=moments, max_step=0.02, tolerance=1e-11)
    assert looped.motion.links[-1] == pytest.approx(loaded.motion.links[-1], abs=1e-8)
    assert looped.motion.work[-1] == pytest.approx(loaded.motion.work[-1], abs=1e-8)
    beam = {"kind": "tilt", "name": "beam", "mass": 2.0, "inertia": 0.5, "stiffness": 30.0}
    hung = {"links": [link], "on": "beam", "position": [0.4, 0.0], "start": {"angles_deg": [15.0]}}
    tilting = {"gravity": 9.81, "support": [beam], "pendulum": [hung]}
    loop = {"input": "beam_torque", "output": "theta_dot_1_1", "gain": 0.8}
    looped = simulate(scene_from({**tilting, "feedback": [loop]}), 3.0, tolerance=1e-11)
    loaded = simulate(
        scene_from(tilting),
        3.0,
        load=lambda t, state: AppliedForces(supports=np.array([-0.8 * state.link_rates[0]])),
        max_step=0.02,
        tolerance=1e-11,
    )
    assert looped.motion.links[-1] == pytest.approx(loaded.motion.links[-1], abs=1e-8)


def test_an_inverted_pendulum_is_held_at_its_angle_from_the_upright() -> None:
    rod = {"kind": "rod", "mass": 0.5, "length": 0.6}
    pendulum = [{"links": [rod], "equilibrium": ["up"], "start": {"angles_deg": [172.0]}}]
    gains = {"states": STATES, "rows": [[-1.0, 60.0, -5.0, 10.0]]}
    described = {"gravity": 9.81, "support": {"kind": "cart", "mass": 2.0}, "pendulum": pendulum}
    scene = scene_from({**described, "feedback": [{"input": "cart_force", "gains": gains}]})
    assert simulate(scene, 12.0).motion.links[-1, 0] == pytest.approx(np.pi, abs=1e-2)


@pytest.mark.parametrize("engine", ["numpy", "numba", "simulate"])
def test_members_of_an_ensemble_have_gains_of_their_own(engine: str) -> None:
    if engine == "numba":
        pytest.importorskip("numba")
    loops, gains = single_loops(limit=12.0), [-400.0, -100.0]
    scene = crane(loops)
    members = ensemble(scene, 2.0, vary={"feedback[1].gain": gains}, engine=engine, workers=1, check=0)
    for gain, angle in zip(gains, members.final.links[:, 0], strict=True):
        alone = simulate(crane([loops[0], {**loops[1], "gain": gain}, *loops[2:]]), 2.0)
        assert angle == pytest.approx(alone.motion.links[-1, 0], abs=1e-6)


def test_reactions_are_those_of_newtons_law_with_the_loop_on_the_link() -> None:
    """A wind on the bob that brakes it; the string carries the rest."""
    loop = {"input": "force_1_1", "output": "theta_dot_1_1", "gain": 40.0}
    run = simulate(crane([loop]), 1.0)
    z, wind = last(run), -40.0 * run.motion.link_rates[-1, 0]
    M = np.array([[MASS + BOB, BOB * LENGTH * np.cos(z[1])], [np.cos(z[1]), LENGTH]])
    rest = [wind + BOB * LENGTH * np.sin(z[1]) * z[3] ** 2, -GRAVITY * np.sin(z[1]) + wind * np.cos(z[1]) / BOB]
    a, alpha = np.linalg.solve(M, rest)
    along = BOB * (a + LENGTH * (np.cos(z[1]) * alpha - np.sin(z[1]) * z[3] ** 2)) - wind
    assert reaction_forces_of(run).pivots[-1, 0, 0] == pytest.approx(along, abs=1e-6)
    sampled = simulate(crane([{**loop, "sample_time": 0.1}]), 1.0)
    with pytest.raises(ComputationError, match="the held inputs of sampled feedback"):
        reaction_forces_of(sampled)


def test_samples_and_dry_friction_on_the_rail_go_together() -> None:
    """The cart slides and turns back: the stretches between samples and turns one by one."""
    loop, friction = {"input": "cart_force", "output": "theta_1_1", "gain": -160.0, "sample_time": 0.1}, 6.0
    support = {"kind": "cart", "mass": MASS, "friction": friction}
    run = simulate(crane([loop]).replace(support=support), 4.0, tolerance=1e-11)
    z, turns = AT_START, 0

    def turning(t: float, z: Any, force: Any) -> float:
        return float(z[2])

    for k in range(40):
        now, end, u = 0.1 * k, 0.1 * (k + 1), 160.0 * z[1]
        while now < end:
            ahead = z[2] if abs(z[2]) > 1e-9 else falls(now, z, lambda t, z, u=u: u)[2]
            turning.terminal, turning.direction = True, -np.sign(ahead)  # type: ignore[attr-defined]
            push = u - np.sign(ahead) * friction
            limits = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-14, "events": turning}
            part = solve_ivp(falls, (now, end), z, args=(lambda t, z, push=push: push,), **limits)
            z, now, turns = part.y[:, -1], float(part.t[-1]), turns + part.status
    assert turns == 2
    assert last(run)[:4] == pytest.approx(z[:4], abs=1e-7)


def test_gains_of_nothing_do_nothing() -> None:
    matrix = {"input": "cart_force", "gains": {"states": STATES, "rows": [[0.0] * 4]}, "limit": 1.0}
    still = {"input": "cart_force", "output": "x", "gain": 0.0, "sample_time": 0.1}
    assert last(simulate(crane([matrix, still]), 2.0)) == pytest.approx(
        swung(lambda t, z: 0.0, 0.0, 2.0, AT_START), abs=1e-7
    )


def test_too_many_samples_are_refused() -> None:
    loop = {"input": "cart_force", "output": "x_dot", "gain": 80.0, "sample_time": 1e-9}
    with pytest.raises(SceneError, match=r"feedback\[0\].sample_time = 1e-09: makes 1e\+09 samples"):
        simulate(crane([loop]), 1.0)
