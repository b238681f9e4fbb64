"""Members with escapements and dry friction, all at once, against individual runs."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from support.amounts import usually
from support.loops import interpreted
from support.pieces import Pieces

from modal import load
from modal.scene import Scene, scene_from
from modal.scene.parameters import vary
from modal.types import Floats
from nonlinear import ensemble, simulate
from nonlinear.dynamics.compiling import available
from nonlinear.integration.run import SimulationError
from nonlinear.simulation import resume
from nonlinear.system import AppliedForces, Event, initial_state

CLOCKS = {
    "pendulum[0].start.angles_deg[0]": (4.0, 12.0),
    "pendulum[0].links[0].drive.impulse": (2e-5, 4e-5),
    "pendulum[1].links[0].drive.angle_deg": (2.0, 3.5),
}
STARTS = {"pendulum[0].start.angles_deg[0]": (-80.0, 80.0), "pendulum[0].start.angles_deg[1]": (-60.0, 60.0)}
LIMIT = {"pendulum[0].links[0].friction": (0.01, 0.6)}
RUBBING = [{"kind": "bob", "mass": m, "length": 1.0, "friction": f} for m, f in ((1.0, 0.3), (0.7, 0.2))]
ESCAPEMENT = {"kind": "escapement", "impulse": 0.2, "angle_deg": 3.0}
CART = {"kind": "cart", "mass": 1.0}
SHAKEN = {"kind": "moved", "motion": {"kind": "sine", "amplitude": 0.2, "frequency_hz": 1.0}}


def hung(*links: dict[str, Any], **more: Any) -> Scene:
    start = {"angles_deg": [10.0] * len(links)}
    return scene_from({"gravity": 9.81, "pendulum": [{"links": list(links), "start": start}]} | more)


SCENES: dict[str, tuple[Scene, dict[str, tuple[float, float]]]] = {
    "clocks": (load("huygens"), CLOCKS),
    "joints": (hung(*RUBBING), STARTS | LIMIT),
    "rail": (hung(*RUBBING, support={**CART, "friction": 0.5}), STARTS | {"support.friction": (0.05, 3.0)}),
    "coefficient": (
        hung(*RUBBING, support={**CART, "friction_coefficient": 0.1}),
        STARTS | {"support.friction_coefficient": (0.02, 0.2)},
    ),
    "clock that rubs": (hung({**RUBBING[0], "drive": ESCAPEMENT}, RUBBING[1]), STARTS | LIMIT),
    "drag": (hung({**RUBBING[0], "drag": 0.1, "quadratic_drag": 0.1}, RUBBING[1]), STARTS | LIMIT),
    "shaken": (hung({**RUBBING[0], "drive": ESCAPEMENT}, RUBBING[1], support=SHAKEN), STARTS | LIMIT),
    "hoist": (hung({**RUBBING[0], "hoist": {"to": 0.5, "duration": 3.0}}, RUBBING[1], support=CART), STARTS),
}


@pytest.mark.parametrize("name", SCENES)
def test_members_side_by_side_are_the_runs_of_their_scenes(name: str) -> None:
    """Each by itself in floats."""
    scene, ranges = SCENES[name]
    rng, size, seconds = np.random.default_rng(8), 3, 1.5
    values = {path: rng.uniform(*between, size) for path, between in ranges.items()}
    runs = ensemble(scene, seconds, vary=values, engine="numpy", workers=1, check=0, tolerance=1e-11)
    assert not runs.failures
    assert runs.energy_drift.max() < 1e-9
    for k in range(size):
        varied = vary(scene, {path: float(each[k]) for path, each in values.items()})
        run = simulate(varied, seconds, tolerance=1e-11, output=2)
        assert np.abs(run.motion.links[-1] - runs.final.links[k]).max() < 1e-8, k


def test_a_clock_at_its_angle_on_the_way_out_is_kicked_at_once() -> None:
    link = {"kind": "bob", "mass": 1.0, "length": 1.0, "drive": ESCAPEMENT}
    scene = scene_from(
        {"gravity": 9.81, "pendulum": [{"links": [link], "start": {"angles_deg": [3.0], "rates_deg": [10.0]}}]}
    )
    runs = ensemble(scene, 2.0, vary={"pendulum[0].start.rates_deg[0]": [10.0, 20.0]}, engine="numpy", workers=1)
    run = simulate(scene, 2.0, output=2)
    assert run.kicks.time[0] == 0.0
    assert runs.final.links[0] == pytest.approx(run.motion.links[-1], abs=1e-8)
    assert runs.largest_difference < 1e-8


JUMPS = [0, 1, 3]
ENGINES = ["floats", "numpy", "numba"]


def ended(engine: str, scene: Scene, seconds: float) -> Floats:
    """The angles and rates of a scene at the end, (2, L), by one engine; the compiled loop is run by Python."""
    if engine == "floats":
        run = simulate(scene, seconds, output=2, tolerance=1e-12)
        return np.array([run.final.links, run.final.link_rates])
    with interpreted():
        starts = [initial_state(scene)]
        options: dict[str, Any] = {"starts": starts, "engine": engine, "workers": 1, "check": 0, "tolerance": 1e-12}
        final = ensemble(scene, seconds, **options).final
    return np.array([final.links[0], final.link_rates[0]])


@pytest.mark.parametrize("engine", ENGINES)
def test_switches_at_once_are_those_of_each_alone(engine: str) -> None:
    """Mirror images on a cart, which stands still: both are kicked, stop and stick at the same times as one alone."""
    link = {"kind": "bob", "mass": 1.0, "length": 1.0, "friction": 0.03, "drive": ESCAPEMENT}
    right, other = ({"links": [link], "start": {"angles_deg": [angle]}} for angle in (20.0, -20.0))
    both = ended(engine, scene_from({"gravity": 9.81, "support": CART, "pendulum": [right, other]}), 4.0)
    alone = ended("floats", scene_from({"gravity": 9.81, "pendulum": [right]}), 4.0)
    assert both == pytest.approx(np.hstack((alone, -alone)), abs=1e-9)


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("beyond", [1e-8, -1e-8])
def test_a_swing_that_passes_its_angle_and_returns_within_a_step_is_kicked(engine: str, beyond: float) -> None:
    """From −10° it comes to 10° without losses; a kick there adds P²/(2 m l²), of a link that hardly moves."""
    link = {"kind": "bob", "mass": 1.0, "length": 1.0}
    link["drive"] = {"kind": "escapement", "impulse": 0.2, "angle_deg": 10.0 - beyond}
    theta, rate = ended(engine, hung(link, pendulum=[{"links": [link], "start": {"angles_deg": [-10.0]}}]), 1.6)[:, 0]
    gain = rate**2 / 2 - 9.81 * (np.cos(theta) - np.cos(np.radians(10.0)))
    assert gain == pytest.approx(0.02 if beyond > 0 else 0.0, abs=1e-4 if beyond > 0 else 1e-10)


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("beyond", [1e-6, -1e-6])
def test_a_torque_that_passes_its_limit_and_returns_within_a_step_breaks_a_joint_loose(
    engine: str, beyond: float
) -> None:
    """The torque m l A ω² sin ωt of a shaken support, whose peak is the limit but for this part of it."""
    peak = 0.2 * (2 * np.pi) ** 2
    link = {"kind": "bob", "mass": 1.0, "length": 1.0, "friction": peak * (1 - beyond)}
    pendulum = [{"links": [link], "start": {"angles_deg": [0.0]}}]
    theta = ended(engine, hung(link, support=SHAKEN, pendulum=pendulum), 0.4)[0, 0]
    assert (theta != 0.0) == (beyond > 0)


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("rate", [10.0, 0.0, -10.0])
def test_a_start_at_the_angle_of_a_kick_counts_if_it_passes(engine: str, rate: float) -> None:
    link = {"kind": "bob", "mass": 1.0, "length": 1.0, "drive": ESCAPEMENT}
    start = {"angles_deg": [3.0], "rates_deg": [rate]}
    theta, speed = ended(engine, hung(link, pendulum=[{"links": [link], "start": start}]), 0.05)[:, 0]
    kicked = np.radians(rate) + 0.2 * (rate > 0)
    energy = speed**2 / 2 - 9.81 * (np.cos(theta) - np.cos(np.radians(3.0)))
    assert energy == pytest.approx(kicked**2 / 2, abs=1e-10)


def jumping(seed: int) -> tuple[Scene, Pieces]:
    """Two torques, or a torque and a force on a cart, that begin and end with a jump and change evenly in between."""
    rng = np.random.default_rng(seed)
    links = [
        {"kind": "bob", "mass": rng.uniform(0.3, 2), "length": rng.uniform(0.4, 1.2), "friction": rng.uniform(0.1, 1)}
        for _ in range(2)
    ]
    rubs = {"friction": rng.uniform(0.3, 3)} if seed % 4 == 1 else {"friction_coefficient": rng.uniform(0.03, 0.1)}
    more: dict[str, Any] = {"support": {**CART, **rubs}} if seed % 2 else {}
    ends = [np.sort(rng.choice(np.arange(13), 2, replace=False)) / 10 for _ in range(2)]
    values = [rng.uniform(-3, 3) * np.array([1.0, rng.uniform(-1, 1)]) for _ in range(2)]

    def load(time: float, state: Any) -> AppliedForces:
        upper, other = (
            float(np.interp(time, *each)) if each[0][0] <= time <= each[0][1] else 0.0
            for each in zip(ends, values, strict=True)
        )
        moments = np.array([upper, 0.0]) if seed % 2 else np.array([upper - other, other])
        return AppliedForces(other if seed % 2 else 0.0, moments)

    on: list[dict[str, Any]] = [{"on": f"pendulum[0].links[{k}]", "direction": "torque"} for k in range(2)]
    names = ["moment_nm", "moment_nm"]
    if seed % 2:
        on[1], names[1] = {"on": "cart"}, "force_n"
    times = [np.linspace(*each, 6) for each in ends]
    forces = [
        {**place, "kind": "record", "time_s": t.tolist(), name: np.interp(t, *line).tolist()}
        for place, name, t, line in zip(on, names, times, zip(ends, values, strict=True), strict=True)
    ]
    breaks = sorted({time for each in ends for time in each.tolist()})
    return hung(*links, force=forces, **more), Pieces(hung(*links, **more), load, breaks)


@cache
def by_pieces(seed: int) -> tuple[Scene, Floats]:
    """Such a scene, and its angles after 1.3 s by the maximal form; what begins to slide at the start may go on."""
    scene, pieces = jumping(seed)
    links = pieces.end(initial_state(scene), 1.3, 1e-11).links
    assert pieces.events or pieces.sign.any()
    return scene, links


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("seed", usually(JUMPS, [*range(100)]))
def test_contacts_slip_and_stick_where_forces_jump(seed: int, engine: str) -> None:
    scene, links = by_pieces(seed)
    assert ended(engine, scene, 1.3)[0] == pytest.approx(links, abs=1e-8)


@pytest.mark.parametrize("engine", ENGINES)
def test_a_joint_at_rest_slips_under_a_torque_that_jumps_beyond_its_limit(engine: str) -> None:
    """From rest under half a newton metre a bob of 1 kg and 1 m turns 1 − cos θ = θ/2g away, and stays there."""
    torque = {"on": "pendulum[0].links[0]", "direction": "torque", "kind": "record"}
    torque |= {"time_s": np.linspace(0.5, 2.5, 6).tolist(), "moment_nm": [1.0] * 6}
    pendulum = [{"links": [{"kind": "bob", "mass": 1.0, "length": 1.0, "friction": 0.5}]}]
    theta, rate = ended(engine, hung(pendulum=pendulum, force=[torque]), 2.4)[:, 0]
    assert 9.81 * (1 - np.cos(theta)) == pytest.approx(0.5 * theta, rel=1e-9)
    assert theta > 0.1
    assert rate == 0.0


@pytest.mark.parametrize("engine", ENGINES)
def test_a_torque_that_grows_from_its_limit_turns_a_joint_from_the_first_moment_on(engine: str) -> None:
    """From 0.5 to 2 N m in 1.5 s against friction of 0.5 N m, while it turns forwards; before the start it is none."""
    torque = {"on": "pendulum[0].links[0]", "direction": "torque", "kind": "record"}
    torque |= {"time_s": np.linspace(0.0, 1.5, 8).tolist(), "moment_nm": np.linspace(0.5, 2.0, 8).tolist()}
    pendulum = [{"links": [{"kind": "bob", "mass": 1.0, "length": 1.0, "friction": 0.5}]}]
    free = solve_ivp(lambda t, y: [y[1], t - 9.81 * np.sin(y[0])], (0.0, 1.5), [0.0, 0.0], rtol=1e-11, atol=1e-13)
    assert ended(engine, hung(pendulum=pendulum, force=[torque]), 1.5)[:, 0] == pytest.approx(free.y[:, -1], abs=1e-8)


@pytest.mark.parametrize("engine", ENGINES)
def test_equal_pendula_slip_at_once(engine: str) -> None:
    link = {"kind": "bob", "mass": 1.0, "length": 1.0, "friction": 0.5}
    support = {"kind": "moved", "motion": {"kind": "sine", "amplitude": 0.1, "frequency_hz": 0.3}}
    start = {"angles_deg": [10.0]}
    three, single = (hung(support=support, pendulum=[{"count": n, "links": [link], "start": start}]) for n in (3, 1))
    links = ended(engine, three, 6.0)[0]
    assert np.ptp(links) == 0.0
    assert links[:1] == pytest.approx(ended(engine, single, 6.0)[0], abs=1e-10)


def test_a_run_that_goes_on_from_where_equal_pendula_begin_to_slip_is_the_whole() -> None:
    link = {"kind": "bob", "mass": 1.0, "length": 1.0, "friction": 0.5}
    support = {"kind": "moved", "motion": {"kind": "sine", "amplitude": 0.1, "frequency_hz": 0.3}}
    scene = hung(support=support, pendulum=[{"count": 3, "links": [link], "start": {"angles_deg": [10.0]}}])
    whole = simulate(scene, 6.0, output=2, tolerance=1e-11)
    slips = float(whole.friction.end[0])
    rest = resume(simulate(scene, slips, output=2, tolerance=1e-11), 6.0 - slips, output=2)
    assert rest.final.links == pytest.approx(whole.final.links, abs=1e-9)


@pytest.mark.parametrize("kick", range(4))
def test_a_kick_at_the_end_of_a_run_is_that_of_the_run_that_goes_on(kick: int) -> None:
    link = {"kind": "bob", "mass": 1.0, "length": 1.0, "drive": ESCAPEMENT}
    scene = hung(link, pendulum=[{"links": [link], "start": {"angles_deg": [8.0]}}])
    whole = simulate(scene, 4.5, output=2)
    until = float(whole.kicks.time[kick])
    never = Event("never", lambda state: float(state.links[0]) - 10.0)
    by_step, ahead = (simulate(scene, until, output=2, events=events) for events in ((never,), ()))
    assert len(by_step.kicks.time) == len(ahead.kicks.time) == kick
    members = ensemble(scene, until, starts=[initial_state(scene)], engine="numpy", workers=1, check=0)
    assert members.final.link_rates[0] == pytest.approx(ahead.final.link_rates, abs=1e-9)
    rest = resume(ahead, 4.5 - until, output=2)
    assert rest.final.links == pytest.approx(whole.final.links, abs=1e-8)
    assert kick + len(rest.kicks.time) == len(whole.kicks.time)


def assert_same(name: str, seconds: float, size: int) -> None:
    """Engine numba against engine numpy: samples, what is measured within steps, exponents, ends, work."""
    scene, ranges = SCENES[name]
    measures = ("largest_angle", "first_turn", *(("lyapunov",) if name in {"clocks", "rail", "coefficient"} else ()))
    rng = np.random.default_rng(3)
    values = {path: rng.uniform(*between, size) for path, between in ranges.items()}
    options: dict[str, Any] = {"vary": values, "workers": 1, "check": 0, "tolerance": 1e-9, "measures": measures}
    times = [0.4 * seconds, seconds]
    runs, others = (ensemble(scene, seconds, output=times, engine=engine, **options) for engine in ("numba", "numpy"))
    assert not runs.failures
    assert runs.columns == others.columns
    for column in runs.columns:
        np.testing.assert_allclose(
            runs.column(column),
            others.column(column),
            atol=1e-8 if column == "lyapunov_per_s" else 1e-9,
            rtol=1e-9,
            err_msg=column,
        )


@pytest.mark.parametrize("name", SCENES)
def test_the_loop_that_numba_compiles_takes_the_steps_of_lanes(name: str) -> None:
    with interpreted():
        assert_same(name, 1.5, 3)


@pytest.mark.skipif(not available(), reason="numba is not installed")
@pytest.mark.parametrize("name", usually(["clock that rubs"], [*SCENES]))
def test_compiled_members_are_those_of_lanes(name: str) -> None:
    assert_same(name, 6.0, 40)


@pytest.mark.parametrize("engine", ["numpy", "numba"])
def test_a_member_whose_friction_has_no_value_fails_alone(engine: str) -> None:
    """Links above one another that turn fast press the cart into its rail the harder, the more the rail rubs."""
    links = [{"kind": "bob", "mass": 1.0, "length": 0.761}, {"kind": "rod", "mass": 1.0, "length": 0.753}]
    start = {"angles_deg": [30.0, 30.0], "rates_deg": [1292.0, 1292.0]}
    support = {"kind": "cart", "mass": 0.032, "friction_coefficient": 0.752}
    scene = scene_from({"gravity": 9.81, "support": support, "pendulum": [{"links": links, "start": start}]})
    values = {"support.friction_coefficient": [0.1, 0.752]}
    with interpreted():
        runs = ensemble(scene, 1.0, vary=values, engine=engine, workers=1, check=0, tolerance=1e-6)
    assert list(runs.failures) == [1]
    assert "stopped at" in runs.failures[1]
    with pytest.raises(SimulationError):
        simulate(scene, 1.0)


@pytest.mark.skipif(not available(), reason="numba is not installed")
def test_what_decides_is_compiled_with_the_arithmetic_of_python() -> None:
    """Sums in any order in the loop itself send these two members to ends 1e-4 rad away."""
    scene, _ = SCENES["clock that rubs"]
    starts = np.array([[0.13677261027023757, -0.6017537803252314], [0.7077425473418895, 0.03755550426557863]])
    ends = [
        ensemble(scene, 10.0, starts=starts, engine=engine, workers=1, check=0).final.links
        for engine in ("numpy", "numba")
    ]
    assert ends[0] == pytest.approx(ends[1], abs=1e-10)


def test_the_largest_angle_of_links_that_turn_over_is_that_at_the_end_of_a_step() -> None:
    """No turning point lies further out; members that come in later begin with no work of friction."""
    link = {"kind": "bob", "mass": 1.0, "length": 1.0, "friction": 0.1}
    cart = {"kind": "cart", "mass": 2.0, "friction_coefficient": 0.05}
    start = {"angles_deg": [0.0], "rates_deg": [500.0]}
    scene = scene_from({"gravity": 9.81, "support": cart, "pendulum": [{"links": [link], "start": start}]})
    options: dict[str, Any] = {"vary": {"pendulum[0].start.rates_deg[0]": np.linspace(400.0, 700.0, 40)}, "workers": 1}
    options |= {"check": 0, "measures": ("largest_angle",)}
    with interpreted():
        runs = ensemble(scene, 0.8, engine="numba", **options)
    others = ensemble(scene, 0.8, engine="numpy", **options)
    assert others.column("largest_angle_deg").max() > 360.0
    assert runs.column("largest_angle_deg") == pytest.approx(others.column("largest_angle_deg"), rel=1e-9)
    assert runs.energy_drift == pytest.approx(others.energy_drift, abs=1e-11)
