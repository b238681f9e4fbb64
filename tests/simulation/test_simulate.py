"""The simulator: its equations against Lagrange's, certificates, orders, events, and what it refuses."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from amounts import usually
from positions import Positions
from scenes import motion_scene, random_state
from scipy.integrate import solve_ivp
from scipy.special import ellipk

import modal
from modal import Bob, Cart, InitialCondition, Pendulum, Rod, Scene, SceneError
from modal.assembly import matrices
from modal.scene import scene_from
from modal.symbolic import symbolic_structure
from nonlinear import ensemble
from nonlinear.dynamics import Banded, Maximal, Recursion
from nonlinear.integration import Choice, SimulationError, choose, equations_of, estimate_timescales
from nonlinear.integration.methods import body_of
from nonlinear.postprocessing import reaction_forces_of, summary
from nonlinear.simulation import resume, simulate
from nonlinear.system import (
    AppliedForces,
    Equations,
    Event,
    State,
    initial_state,
    level_crossing,
    state_at_rest,
    system_of,
    turning_point,
)

MINIMAL = Choice("minimal", "DOP853", compiled=False, reason="")


def minimal(scene: Scene) -> Equations:
    return equations_of(system_of(scene), MINIMAL)


# ---------------------------------------------------------------------------------------------- equations


@pytest.mark.parametrize("seed", usually(range(5), range(12)))
def test_accelerations_solve_lagranges_equations_from_cartesian_positions(seed: int) -> None:
    scene = motion_scene(seed, longest=2)
    state, equations = random_state(system_of(scene), seed), minimal(scene)
    rate = equations.derivative(0.0, equations.begin(state))
    slope, exact = equations.read(rate[None])[0], Positions(symbolic_structure(scene))
    on_cart = scene.support.kind == "cart"
    values: dict[Any, float] = {}
    for coordinate, q, v, a in zip(
        exact.coordinates,
        [*([state.cart] if on_cart else []), *state.links],
        [*([state.cart_rate] if on_cart else []), *state.link_rates],
        [*([slope.cart_rate] if on_cart else []), *slope.link_rates],
        strict=True,
    ):
        values |= {coordinate.q: q, coordinate.v: v, coordinate.a: a}
    for equation in exact.equations:
        terms = [abs(float(term.subs(values))) for term in equation.expand().args]
        assert abs(float(equation.subs(values))) < 1e-11 * max(terms)


@pytest.mark.parametrize("seed", range(20))
def test_small_motion_obeys_the_linear_matrices(seed: int) -> None:
    """M q'' + D q' + K q = 0 about the rest, by central differences of the derivative."""
    scene = motion_scene(seed)
    system, equations, linear = system_of(scene), minimal(scene), matrices(scene)
    rest = np.where(system.by_link("sigma") > 0, 0.0, np.pi)
    none = np.zeros(system.n_links)
    y, half = equations.begin(State(rest, none)), len(linear.labels)

    def pushed(direction: Any) -> Any:
        step = np.zeros_like(y)
        step[: 2 * half] = 1e-5 * direction
        return (equations.derivative(0, y + step) - equations.derivative(0, y - step))[half : 2 * half] / 2e-5

    J = np.array([pushed(direction) for direction in np.eye(2 * half)]).T
    expected = -np.linalg.solve(linear.M, np.hstack((linear.K, linear.D)))
    assert abs(J - expected).max() < 1e-7 * abs(expected).max()


@pytest.mark.parametrize("seed", range(10))
def test_energy_changes_by_the_work_of_dampers_and_of_what_pushes(seed: int) -> None:
    def load(time: float, state: State) -> AppliedForces:
        return AppliedForces(3 * math.sin(2 * time) if on_cart else 0.0, np.cos(time + np.arange(len(state.links))))

    scene = motion_scene(seed)
    on_cart = scene.support.kind == "cart"
    trajectory = simulate(scene, 3, tolerance=1e-11, load=load, method="DOP853")
    assert trajectory.driven
    assert abs(trajectory.motion.work).max() > 1e-3 * trajectory.energy_scale
    assert trajectory.energy_drift() < 1e-8


def test_the_energy_certificate_bites() -> None:
    rough = simulate(modal.load("paper-cart-2"), 10, tolerance=1e-2)
    assert rough.energy_drift() > 1e-4


# ------------------------------------------------------------------------------------------ certificates


def test_energy_and_momentum_keep_nine_digits_for_a_thousand_seconds() -> None:
    scene = Scene(gravity=9.81, support=Cart(mass=2.0), pendulum=(Pendulum(links=(Bob(mass=1.0, length=1.0),)),))
    start = State(np.array([0.5]), np.zeros(1), cart_rate=0.1)
    trajectory = simulate(scene, 1000, tolerance=1e-12, start=start, method="DOP853")
    assert trajectory.complete
    assert trajectory.energy_drift() < 1e-9
    assert trajectory.momentum_drift() < 1e-9
    assert abs(trajectory.mechanics.momentum[0]) > 0.1


@pytest.mark.parametrize(("method", "order", "within"), [("RK23", 3, 0.1), ("RK45", 5, 0.1), ("DOP853", 8, 0.5)])
def test_observed_orders(method: str, order: int, within: float) -> None:
    """Errors at a fixed step, halved; the leading error of DOP853 is so small that its next term still shows."""
    scene = modal.load("chain-2")
    equations = minimal(scene)
    y = equations.begin(state_at_rest(scene, [20, 30]))

    def end(step: float) -> Any:
        how = {"rtol": 1e-2, "atol": 1e2, "first_step": step, "max_step": step}
        return solve_ivp(equations.derivative, (0, 2), y, method=method, **how).y[:, -1]

    best = solve_ivp(equations.derivative, (0, 2), y, method="DOP853", rtol=3e-14, atol=1e-15).y[:, -1]
    steps = {3: (1 / 128, 1 / 256), 5: (1 / 32, 1 / 64), 8: (1 / 8, 1 / 16)}[order]
    coarse, fine = (np.linalg.norm(end(step) - best) for step in steps)
    assert math.log2(coarse / fine) == pytest.approx(order, abs=within)


# ------------------------------------------------------------------------------------------------ events


@pytest.mark.parametrize("degrees", [1.0, 60.0, 90.0, 150.0, 179.0])
def test_periods_of_a_simple_pendulum_are_elliptic_integrals(degrees: float) -> None:
    scene = Scene(gravity=9.81, pendulum=(Pendulum(links=(Bob(mass=1.0, length=2.0),)),))
    passing = level_crossing(system_of(scene), "theta[1,1]", direction=1)
    exact = 4 * math.sqrt(2 / 9.81) * ellipk(math.sin(math.radians(degrees) / 2) ** 2)
    trajectory = simulate(
        scene, 3.1 * exact, tolerance=1e-14, start=state_at_rest(scene, [degrees]), events=[passing], method="DOP853"
    )
    times = [happening.time for happening in trajectory.happenings]
    assert len(times) == 3
    assert times[1] - times[0] == pytest.approx(exact, rel=1e-10)
    assert times[0] == pytest.approx(0.75 * exact, rel=1e-10)


def test_turning_points_are_those_of_the_release_and_can_end_a_run() -> None:
    scene = modal.load("chain-1")
    system, start = system_of(scene), state_at_rest(scene, [70])
    every = simulate(scene, 10, start=start, tolerance=1e-12, events=[turning_point(system, "theta[1,1]")])
    assert len(every.happenings) > 3
    assert all(abs(abs(h.state.links[0]) - math.radians(70)) < 1e-9 for h in every.happenings)
    first = simulate(scene, 10, start=start, tolerance=1e-12, events=[turning_point(system, "theta[1,1]", stop=True)])
    assert first.happenings[0].time == pytest.approx(every.happenings[0].time, rel=1e-12)
    assert first.run.stopped.startswith("theta[1,1] turns at")
    assert first.times[-1] == first.happenings[0].time
    assert abs(first.final.link_rates[0]) < 1e-9
    assert not first.complete


@pytest.mark.parametrize("method", ["DOP853", "RK45", "Radau", "LSODA"])
@pytest.mark.parametrize("form", ["minimal", "hamiltonian"])
def test_a_stop_does_not_stop_the_run_that_goes_on_from_it(method: str, form: str) -> None:
    scene = modal.load("chain-1")
    stop = level_crossing(system_of(scene), "theta[1,1]", stop=True)
    run = simulate(scene, 20, start=state_at_rest(scene, [30]), events=[stop], tolerance=1e-8, method=method, form=form)
    ends = [run.times[-1]]
    for _ in range(3):
        run = resume(run, 20, events=[stop])
        ends.append(run.times[-1])
    half = 2 * math.sqrt(1 / 9.81) * ellipk(math.sin(math.radians(15)) ** 2)
    assert np.diff(ends) == pytest.approx(half, rel=1e-5)


def test_two_events_within_one_step_are_found_in_their_order() -> None:
    scene = modal.load("chain-1")
    levels = [level_crossing(system_of(scene), "theta[1,1]", level) for level in (0.1, 0.11, 0.12)]
    happenings = simulate(scene, 3, start=state_at_rest(scene, [20]), tolerance=1e-4, events=levels[::-1]).happenings
    assert [h.name for h in happenings[:3]] == [f"theta[1,1] = {level}" for level in (0.12, 0.11, 0.1)]
    assert [h.time for h in happenings] == sorted(h.time for h in happenings)


def test_an_event_may_look_at_anything() -> None:
    scene = modal.load("paper-cart-3")
    swift = Event("cart faster than 0.05 m/s", lambda state: abs(state.cart_rate) - 0.05, stop=True)
    assert abs(simulate(scene, 10, events=[swift]).happenings[0].state.cart_rate) == pytest.approx(0.05, abs=1e-9)
    with pytest.raises(SceneError, match=r"event theta\[9,9\]: must be one of x, theta\[1,1\]"):
        level_crossing(system_of(scene), "theta[9,9]")


# ----------------------------------------------------------------------------------------------- running


def test_a_run_goes_on_where_it_ended() -> None:
    scene = modal.load("chain-unequal")
    whole = simulate(scene, 4, tolerance=1e-12, output=[0, 2, 4])
    half = simulate(scene, 2, tolerance=1e-12, output=2)
    rest = resume(half, 2, tolerance=1e-12, output=2)
    assert rest.times.tolist() == [2.0, 4.0]
    assert abs(rest.final.links - whole.final.links).max() < 1e-9


def test_a_run_goes_on_as_it_was_made() -> None:
    rough = simulate(modal.load("chain-2"), 1, method="RK45", tolerance=1e-5, form="hamiltonian")
    assert (rough.run.form, rough.run.method, rough.run.tolerance) == ("hamiltonian", "RK45", 1e-5)
    assert resume(rough, 1).run.method == "RK45"
    assert resume(rough, 1).run.form == "hamiltonian"
    driven = simulate(modal.load("chain-2"), 1, load=lambda time, state: AppliedForces())
    with pytest.raises(SceneError, match="load: this run had applied forces"):
        resume(driven, 1)


@pytest.mark.parametrize(
    ("push", "message"),
    [
        (AppliedForces(3.0), "load: .*the support is fixed"),
        (AppliedForces(0.0, np.zeros(7)), r"load: moments have shape \(7,\), this scene needs \(2,\)"),
        (AppliedForces(math.nan), "load: must be finite"),
        (None, "load: must return AppliedForces, not NoneType"),
    ],
)
def test_loads_that_do_not_fit(push: Any, message: str) -> None:
    with pytest.raises(SceneError, match=message):
        simulate(modal.load("chain-2"), 1, load=lambda time, state: push)


def test_long_damped_chains_simulate() -> None:
    scene = Scene(gravity=9.81, pendulum=(Pendulum(links=(Bob(mass=1.0, length=1.0, damping=1e-4, count=600),)),))
    run = simulate(scene, 0.05, start=state_at_rest(scene, [10.0] * 600), tolerance=1e-6, output=3)
    assert run.energy_drift() < 1e-6


def test_right_runs_of_hardly_any_motion_have_small_drifts() -> None:
    scene = modal.load("chain-1")
    assert simulate(scene, 1e-9, start=state_at_rest(scene, [90.0])).energy_drift() < 1e-9
    assert simulate(scene, 5, start=state_at_rest(scene, [1e-5])).energy_drift() < 1e-6


def test_the_certificate_sees_small_motion_about_a_standing_rest_and_on_a_coasting_cart() -> None:
    link = Bob(mass=1.0, length=1.0, stiffness=30.0)
    standing = Scene(gravity=9.81, pendulum=(Pendulum(links=(link,), equilibrium=("up",)),))
    rough = simulate(
        standing, 60, start=State(np.array([math.pi - 1e-6]), np.zeros(1)), tolerance=1e-2, method="DOP853"
    )
    assert rough.energy_drift() > 1e-3
    assert "too much to trust" in summary.text(rough)
    cart = modal.load("paper-cart-1")
    coasting = State(np.full(2, 1e-3), np.zeros(2), cart_rate=10.0)
    assert simulate(cart, 60, start=coasting, tolerance=1e-2, method="DOP853").energy_drift() > 1e-4


def test_what_is_harmless_does_not_spoil_noted() -> None:
    scene = modal.load("chain-1")
    for turns in (0.0, 2 * math.pi):
        run = simulate(scene, 20, start=State(np.array([turns + 1e-6]), np.zeros(1)), method="DOP853")
        exact = 1e-6 * np.cos(math.sqrt(9.81) * run.times)
        assert abs(run.motion.links[:, 0] - turns - exact).max() < 2e-7 * 1e-6 + 1e-14


def test_a_rest_about_which_nothing_swings_still_has_a_time_scale() -> None:
    standing = modal.load("chain-1").model_copy(
        update={"pendulum": (Pendulum(links=(Bob(mass=1.0, length=1.0),), equilibrium=("up",)),)}
    )
    assert estimate_timescales(standing).swing == pytest.approx(math.sqrt(9.81))


def test_stiff_dampers_in_space_are_named() -> None:
    link = Bob(mass=1.0, length=1.0, damping=1e4)
    scene = Scene(
        gravity=9.81, space="space", pendulum=(Pendulum(links=(link,), start=InitialCondition(angles_deg=(60,))),)
    )
    assert "has only explicit methods" in choose(scene, 10, 1e-6).reason


def test_an_event_that_is_no_number_says_so() -> None:
    with pytest.raises(SimulationError, match="event odd is nan at 0"):
        simulate(modal.load("chain-1"), 1, events=[Event("odd", lambda state: math.nan)])


def test_quick_events_need_more_looks() -> None:
    scene = modal.load("chain-1")

    def seen(looks: int) -> int:
        quick = Event("quick", lambda state: math.sin(200 * state.links[0] + 0.3), looks=looks)
        return len(simulate(scene, 3, start=state_at_rest(scene, [40]), events=[quick], method="DOP853").happenings)

    assert seen(4) < seen(64) == seen(128)


def test_ctrl_c_keeps_what_was_computed() -> None:
    def report(elapsed: float) -> None:
        if elapsed > 3:
            raise KeyboardInterrupt

    run = simulate(modal.load("paper-cart-3"), 10, report=report)
    assert run.run.stopped.startswith("interrupted at 3.")
    assert 2.9 < run.times[-1] < 3.2
    assert len(run.times) == len(run.motion.links)
    assert run.energy_drift() < 1e-7


def test_a_failure_says_how_far_it_came_and_keeps_that() -> None:
    """A massless cart under a single bob has a singular mass matrix at the hanging rest."""
    scene = Scene(
        gravity=9.81,
        support=Cart(mass=0.0),
        pendulum=(Pendulum(links=(Bob(mass=1.0, length=1.0),), start=InitialCondition(angles_deg=(60.0,))),),
    )
    with pytest.raises(SimulationError, match=r"stopped at [\d.]+ s") as caught:
        simulate(scene, 10)
    assert 0 < caught.value.trajectory.times[-1] < 2


def test_samples_are_where_they_were_asked_for() -> None:
    scene = modal.load("chain-2")
    assert simulate(scene, 1, output=5).times.tolist() == [0, 0.25, 0.5, 0.75, 1]
    assert simulate(scene, 1, output=[0.3, 0.9]).times.tolist() == [0, 0.3, 0.9]
    dense, sparse = simulate(scene, 1, tolerance=1e-12, output=1001), simulate(scene, 1, tolerance=1e-12, output=3)
    assert abs(dense.motion.links[500] - sparse.motion.links[1]).max() < 1e-10


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"duration": math.nan}, "duration nan: must be a positive number of seconds"),
        ({"duration": -1.0}, "duration -1.0: must be"),
        ({"duration": "x"}, "duration 'x': must be"),
        ({"start_time": math.nan}, "start_time nan: must be"),
        ({"start_time": 1e9, "duration": 1e-9}, "duration 1e-09: too short compared with the start"),
        ({"output": ["a"]}, "output: must be a number of samples"),
        ({"output": True}, "output: must be a number of samples"),
        ({"start": [40.0]}, "start: must be a State"),
        ({"tolerance": 0.5}, "tolerance 0.5: must be from 1e-15 to 0.01"),
        ({"tolerance": math.nan}, "tolerance nan"),
        ({"method": "Euler"}, "method Euler: must be one of auto, DOP853"),
        ({"form": "spatial", "method": "taylor"}, "form spatial: works in space only"),
        ({"form": "maximal", "method": "LSODA"}, "method LSODA: cannot keep the constraints of the maximal form"),
        ({"form": "polar"}, "form polar: must be one of auto, minimal"),
        ({"output": 10**12}, "output 1000000000000: must be from 2 to"),
        ({"output": 1}, "output 1: must be from 2"),
        ({"output": [0, 0]}, "output: must be a number of samples or ascending times"),
        ({"output": [0, 99]}, "output: must lie between 0 and 10 s"),
        ({"start": State(np.zeros(3), np.zeros(2))}, r"start.links: has shape \(3,\), this scene needs \(2,\)"),
        ({"start": State(np.array([0, math.nan]), np.zeros(2))}, "start.links: must be finite"),
        ({"start": State(np.zeros(2), np.zeros(2), cart=1.0)}, "start.cart: the support of this scene is fixed"),
    ],
)
def test_what_is_refused(options: dict[str, Any], message: str) -> None:
    with pytest.raises(SceneError, match=message):
        simulate(modal.load("chain-2"), **{"duration": 10.0, **options})


def test_starts() -> None:
    scene = modal.load("rope")
    with pytest.raises(SceneError, match="no pendulum has a start"):
        initial_state(scene)
    double = Pendulum(links=(Bob(mass=1, length=1), Bob(mass=1, length=1)))
    three = Scene(gravity=9.81, pendulum=(double.model_copy(update={"count": 3}),))
    assert state_at_rest(three, [10, 20]).links == pytest.approx(np.deg2rad([10, 20] * 3))
    with pytest.raises(SceneError, match="start: has 5 angles: this scene needs 2 or 6"):
        state_at_rest(three, [1, 2, 3, 4, 5])
    with pytest.raises(SceneError, match="angles_deg: has nan: must be a finite number"):
        state_at_rest(three, [math.nan, 0])
    standing = three.model_copy(
        update={"pendulum": (double.model_copy(update={"equilibrium": ("down", "up")}), double)}
    )
    with pytest.raises(SceneError, match="no pendulum has a start"):
        initial_state(standing)
    some = Pendulum(links=double.links, start=InitialCondition(angles_deg=(5, 6), rates_deg=(7, 8)))
    mixed = three.model_copy(update={"pendulum": (standing.pendulum[0], some)})
    assert initial_state(mixed).links == pytest.approx([0, math.pi, *np.deg2rad([5, 6])])
    assert initial_state(mixed).link_rates == pytest.approx([0, 0, *np.deg2rad([7, 8])])


# ----------------------------------------------------------------------------------------------- choices


def test_the_choice_says_why() -> None:
    scene = modal.load("paper-cart-2")
    assert choose(scene, 10, 1e-6).method == "DOP853"
    asked = choose(scene, 10, 1e-9, "RK45")
    assert (asked.method, asked.reason.partition(",")[0]) == ("RK45", "as requested")
    sticky = Scene(
        gravity=9.81,
        pendulum=(Pendulum(links=(Bob(mass=1, length=1, damping=1e4),), start=InitialCondition(angles_deg=(60,))),),
    )
    stiff = choose(sticky, 10, 1e-6)
    assert stiff.method == "Radau"
    assert "decay" in stiff.reason
    assert simulate(sticky, 1000, tolerance=1e-6).run.calls < 2000


# ---------------------------------------------------------------------------------------------- reactions


def test_what_hangs_at_rest_weighs_on_the_rail() -> None:
    scene = modal.load("paper-cart-2")
    still = simulate(scene, 1, start=State(np.zeros(4), np.zeros(4)), output=3)
    forces = reaction_forces_of(still)
    assert forces.normal == pytest.approx(104 * 9.81, rel=1e-14)
    assert forces.pivots[0, :, 1] == pytest.approx([-2 * 9.81, -9.81] * 2, rel=1e-14)


@pytest.mark.parametrize("seed", range(8))
def test_forces_from_outside_change_the_momentum(seed: int) -> None:
    """Rail, spring and damper against the numerical derivative of the whole momentum."""
    scene = motion_scene(seed)
    times = 1 + 1e-4 * np.arange(-2, 3)
    trajectory = simulate(scene, 2, tolerance=1e-13, output=times, method="DOP853")
    m, motion, forces = trajectory.mechanics, trajectory.motion, reaction_forces_of(trajectory)
    cart = trajectory.system.cart
    down = m.speeds[1:, :, 1] @ trajectory.system.mass
    along = m.momentum[1:]
    rate = np.array([1, -8, 0, 8, -1]) / 12e-4
    weight = (trajectory.system.mass.sum() + (cart.mass if cart else 0.0)) * scene.gravity
    scale = weight + abs(forces.pivots).max()
    assert abs(rate @ down - (weight - forces.normal[3])) < 1e-7 * scale
    if cart:
        held = -cart.stiffness * motion.cart[3] - cart.damping * motion.cart_rate[3]
        assert abs(rate @ along - held) < 1e-7 * scale


@pytest.mark.parametrize("count", [1, 2, 3])
def test_newtons_law_and_the_papers_own_equations_give_the_same_forces(count: int) -> None:
    scene = modal.load(f"paper-cart-{count}")
    run = simulate(scene, 2, tolerance=1e-10, output=21)
    newton, papers = reaction_forces_of(run), Maximal(run.system).reactions(run.motion)
    for name in ("normal", "pivots", "R_B", "R_P"):
        assert abs(getattr(newton, name) - getattr(papers, name)).max() < 1e-9 * papers.normal.max()


# ------------------------------------------------------------------------------------------------- crowds


def test_a_chain_of_a_thousand_links_simulates() -> None:
    scene = Scene(gravity=9.81, pendulum=(Pendulum(links=(Rod(mass=0.01, length=0.01, count=1000),)),))
    run = simulate(scene, 0.05, start=state_at_rest(scene, [30.0] * 1000), tolerance=1e-6, output=3, method="DOP853")
    assert run.complete
    assert run.energy_drift() < 1e-5
    assert run.final.links[0] < math.radians(29)
    assert run.final.links[-1] == pytest.approx(math.radians(30), abs=1e-3)


def test_thousands_of_double_pendula_on_one_cart_simulate() -> None:
    double = Pendulum(links=(Rod(mass=1.0, length=1.0, count=2),), count=3_000)
    scene = Scene(gravity=9.81, support=Cart(mass=3e3), pendulum=(double,))
    links = np.random.default_rng(0).normal(scale=0.5, size=6_000)
    start = State(links, np.zeros(6_000))
    run = simulate(scene, 0.3, start=start, tolerance=1e-7, output=3, method="DOP853")
    assert run.energy_drift() < 1e-6
    assert run.momentum_drift() < 1e-6
    assert abs(run.final.cart) > 1e-6


@pytest.mark.parametrize(
    ("links", "copies", "body"), [(2, 3, Recursion), (2, 5000, Recursion), (100, 2, Banded), (100, 200, Recursion)]
)
def test_each_scene_gets_the_body_that_suits_it(links: int, copies: int, body: type) -> None:
    pendulum = Pendulum(links=(Bob(mass=1.0, length=1.0, count=links),), count=copies)
    (group,) = system_of(Scene(gravity=1.0, pendulum=(pendulum,))).groups
    assert type(body_of(group, system_of(Scene(gravity=1.0, pendulum=(pendulum,))))) is body
    light = system_of(Scene(gravity=1.0, support=Cart(mass=1e-6), pendulum=(pendulum,)))
    assert type(body_of(light.groups[0], light)) is Recursion


@pytest.mark.parametrize(("damping", "joint", "angle"), [(0.27, 0.0, 0.5), (0.27, 0.0, 20.0), (0.0, 0.01, 0.5)])
def test_a_massless_cart_with_dampers_is_stopped_where_it_feels_nothing(
    damping: float, joint: float, angle: float
) -> None:
    """sin²θ of one bob is the share of the mass that its cart feels: 1.5e-8 where the run stops."""
    bob = Bob(mass=1.9, length=0.33, damping=joint)
    hung = Pendulum(links=[bob], start=InitialCondition(angles_deg=[angle]))
    scene = Scene(gravity=9.81, support=Cart(mass=0.0, damping=damping), pendulum=[hung])
    with pytest.raises(SimulationError, match="hangs straight down: give it a mass") as caught:
        simulate(scene, 1.0)
    run = caught.value.trajectory
    assert run.run.steps < 6000
    assert math.sin(run.final.links[0]) ** 2 < 1.6e-8


def test_a_massless_cart_whose_damper_lets_it_pass_goes_on() -> None:
    links = [(Bob(mass=1.9, length=length), angle) for length, angle in ((0.33, 20.0), (0.5, -5.0))]
    hung = [Pendulum(links=[bob], start=InitialCondition(angles_deg=[angle])) for bob, angle in links]
    run = simulate(Scene(gravity=9.81, support=Cart(mass=0.0, damping=0.27), pendulum=hung), 2.0)
    assert run.complete
    assert run.energy_drift() < 1e-8


@pytest.mark.parametrize("speed", [0.0, 3.0])
def test_a_push_takes_the_momentum_law_and_not_the_energy_law(speed: float) -> None:
    """Newton's law for all masses along the rail is what remains: M (v − v₀) = ∫F dt, the force as the scene has it."""
    push = {"on": "cart", "direction": "horizontal", "kind": "sine", "amplitude": 2.0, "frequency_hz": 0.3}
    bob = {"links": [{"kind": "bob", "mass": 1.0, "length": 1.0}]}
    described = {"gravity": 9.81, "support": {"kind": "cart", "mass": 5.0}, "pendulum": [bob]}
    pushed, free = (scene_from({**described, **more}) for more in ({"force": [push]}, {}))
    start = State(np.array([0.4]), np.zeros(1), cart=0.0, cart_rate=speed)
    run = simulate(pushed, 8.0, start=start)
    assert not run.keeps_momentum
    assert math.isnan(run.momentum_drift())
    assert run.energy_drift() < 1e-7
    omega = 2 * math.pi * 0.3
    momentum = 6.0 * speed + 2.0 / omega * (1 - np.cos(omega * run.times))
    np.testing.assert_allclose(run.mechanics.momentum, momentum, rtol=0, atol=1e-7)
    assert simulate(free, 2.0, start=start, tolerance=1e-11).momentum_drift() < 1e-9
    members = ensemble(pushed, 8.0, starts=[start], engine="numpy", workers=1, check=0)
    assert members.energy_drift.max() < 1e-6


def test_masses_that_leave_a_singular_matrix_move() -> None:
    support = modal.ModalSupport(
        M=[[0.1, 0.0], [0.0, 2.0]], K=[[16.0, 0.0], [0.0, 20.0]], points=[[[1.0, 0.5], [0.0, 0.0]]]
    )
    hung = Pendulum(on="modal[0]", links=[Bob(mass=1e17, length=1.0)], start=InitialCondition(angles_deg=[5.0]))
    scene = Scene(gravity=9.81, support=support, pendulum=[hung])
    scales = estimate_timescales(scene)
    assert 0 < scales.swing < math.inf
    assert simulate(scene, 0.01).energy_drift() < 1e-7
