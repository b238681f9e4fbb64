"""What is measured on the way, against individual runs and against formulas."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest
from support.amounts import usually
from support.scenes import complex_step

from modal import load
from modal.scene import InitialCondition
from modal.types import Floats
from nonlinear import Event, State, simulate
from nonlinear.ensembles import Ensemble, compilation_table, compile_engines, ensemble, members_of
from nonlinear.ensembles.costs import code_of, first_numbers
from nonlinear.integration.steppers import SciPyStepper
from nonlinear.postprocessing import extremes
from nonlinear.sweeps import parse_measures
from nonlinear.system import system_of

ANGLES = np.random.default_rng(3).uniform(-2.8, 2.8, (6, 2))
DURATION = 4.0


MEASURES = ("first_turn", "largest_angle", "lyapunov", "pendulum_energy", "section:theta[1,1]>10")


@cache
def computed(engine: str = "numpy", measures: tuple[str, ...] = MEASURES) -> Ensemble:
    return ensemble(load("chain-2"), DURATION, starts=ANGLES, measures=measures, engine=engine, workers=1, output=9)


def test_samples_are_those_of_runs() -> None:
    for k, angles in enumerate(ANGLES):
        run = simulate(load("chain-2"), DURATION, start=State(angles, 0 * angles), output=9)
        np.testing.assert_allclose(computed().column("links_rad")[k], run.motion.links, atol=2e-8)
        np.testing.assert_allclose(computed().column("link_rates_rad_per_s")[k], run.motion.link_rates, atol=2e-7)


def test_first_turns_are_those_of_events() -> None:
    for k, angles in enumerate(ANGLES):
        events = [
            Event(f"{link}", lambda state, link=link: float(np.cos(state.links[link] / 2)), looks=8)
            for link in range(2)
        ]
        run = simulate(load("chain-2"), DURATION, start=State(angles, 0 * angles), events=events)
        for link in range(2):
            times = [event.time for event in run.happenings if event.name == f"{link}"]
            measured = computed().column(f"first_turn_1_{link + 1}_s")[k]
            assert measured == pytest.approx(min(times, default=np.inf), abs=1e-7)
    assert np.isfinite(computed().column("first_turn_1_2_s")).any()
    assert np.isinf(computed().column("first_turn_1_1_s")).any()


def test_largest_angles_are_those_of_dense_runs() -> None:
    for k, angles in enumerate(ANGLES):
        run = simulate(load("chain-2"), DURATION, start=State(angles, 0 * angles), output=4001)
        most = np.degrees(np.abs(extremes(run.times, run.motion.links, run.motion.link_rates)).max())
        assert computed().column("largest_angle_deg")[k] == pytest.approx(most, abs=1e-5)


def test_crossings_are_those_of_dense_runs() -> None:
    """Counted and placed by where the whole turns beyond 10° rise between samples."""
    members, times = (computed().column(f"crossing_{name}") for name in ("member", "time_s"))
    links = computed().column("crossing_links_rad")
    aside = np.degrees(links[:, 0]) - 10
    np.testing.assert_allclose(aside - 360 * np.round(aside / 360), 0.0, atol=1e-6)
    assert np.all(computed().column("crossing_link_rates_rad_per_s")[:, 0] > 0)
    for k, angles in enumerate(ANGLES):
        run = simulate(load("chain-2"), DURATION, start=State(angles, 0 * angles), output=8001)
        turns = np.floor((run.motion.links[:, 0] - np.radians(10)) / (2 * np.pi))
        expected = run.times[1:][np.diff(turns) > 0]
        np.testing.assert_allclose(times[members == k], expected, atol=DURATION / 8000)


def test_the_exponent_is_that_of_tangent_vectors_of_the_complex_step() -> None:
    """Another derivative, another integrator (SciPy's own), no renormalisation, and the same direction."""
    scene = load("chain-2")
    system = system_of(scene)
    scale = np.sqrt([1.0, 1.0, *[system.gravity / system.by_link("length").min()] * 2])[:, None]
    y = np.concatenate((ANGLES.T, 0 * ANGLES.T))
    v = np.random.default_rng(0).standard_normal((4, 1)) * scale
    v = np.broadcast_to(v / np.linalg.norm(v / scale), y.shape)
    both = np.concatenate((y, v), axis=None)

    def derivative(time: float, packed: Floats) -> Floats:
        return np.concatenate(complex_step(system, *packed.reshape(2, 4, -1)), axis=None)

    gains = []
    for end in (DURATION / 2, 3 * DURATION / 2):
        stepper = SciPyStepper("DOP853", derivative, 0.0, both, end, 1e-10, 1e-10 * np.ones(both.size))
        while stepper.time < end:
            stepper.step()
        gains.append(np.log(np.linalg.norm(stepper.y.reshape(2, 4, -1)[1] / scale, axis=0)))
    np.testing.assert_allclose(computed().column("lyapunov_per_s"), (gains[1] - gains[0]) / DURATION, atol=1e-6)


def test_energies_are_conserved_and_stated() -> None:
    system = system_of(load("chain-2"))
    b = np.concatenate([group.block.b[:, 0] for group in system.groups])
    expected = system.gravity * (1 - np.cos(ANGLES)) @ b
    np.testing.assert_allclose(computed().column("pendulum_1_energy_J"), expected, rtol=1e-6)
    assert computed().energy_drift.max() < 1e-7


def test_the_order_parameter_is_that_of_a_run() -> None:
    scene = load("huygens")
    runs = ensemble(scene, 20.0, vary={"pendulum[0].start.angles_deg[0]": [5.0, 20.0]}, measures=["order"], workers=1)
    for k, angle in enumerate((5.0, 20.0)):
        first, *others = scene.pendulum
        start = first.start.replace(angles_deg=(angle, *first.start.angles_deg[1:]))
        other = scene.replace(pendulum=[first.replace(start=start), *others])
        expected = parse_measures(["order:20"])[0].of(other)["order"]
        assert runs.column("order")[k] == pytest.approx(expected, abs=1e-6)


def test_estimated_errors_are_above_the_true_ones() -> None:
    """In 60 chaotic members, for all but a few, and by how much is bounded."""
    starts = np.random.default_rng(8).uniform(-3, 3, (60, 2))
    loose, tight = (
        ensemble(load("chain-2"), 6.0, starts=starts, tolerance=tolerance, workers=1, check=0, engine="numpy")
        for tolerance in (1e-7, 1e-12)
    )
    true = np.abs(loose.final.links - tight.final.links).max(1)
    estimated = loose.column("error_rad")
    assert np.mean(estimated > true) > 0.95
    assert np.median(estimated / true) < 1e3
    beyond = true > 0.1
    assert np.all(loose.beyond[beyond])


def test_compiled_members_are_those_of_lanes() -> None:
    """Tangent equations are a form of their own, which takes as long again to compile."""
    pytest.importorskip("numba")
    runs = computed("numba", usually(tuple(name for name in MEASURES if name != "lyapunov"), MEASURES))
    for name in runs.columns:
        lanes, other = computed().column(name), runs.column(name)
        kwargs = {"rtol": 0.1} if name in {"error_rad", "energy_drift"} else {"atol": 1e-8, "rtol": 1e-8}
        if name != "energy_drift":
            np.testing.assert_allclose(other, lanes, **kwargs, err_msg=name)


def test_what_no_engine_takes_goes_one_by_one() -> None:
    scene = load("chain-2").replace(space="space")
    start = InitialCondition(angles_deg=(10.0, 5.0), azimuths_deg=(0.0, 40.0))
    scene = scene.replace(pendulum=[scene.pendulum[0].replace(start=start)])
    result = ensemble(scene, 0.5, vary={"pendulum[0].start.azimuths_deg[1]": [0.0, 90.0]}, workers=1)
    assert result.engine == "simulate"
    assert "in space" in result.reason
    assert result.column("links_rad").shape == (2, 2, 3)
    run = simulate(scene, 0.5, output=2)
    assert result.energy_drift.max() < 1e-6
    assert run.complete


def test_starts_after_many_turns_are_as_accurate_as_is_said() -> None:
    """Against the same starts within one turn, finer: what is wrong lies beyond its horizon."""
    turned = ANGLES[:, :] + 2 * np.pi * np.array([159_155, -159_155])
    within = np.arctan2(np.sin(turned), np.cos(turned))
    options = {"workers": 1, "check": 0, "engine": "numpy"}
    far = ensemble(load("chain-2"), 8.0, starts=turned, **options)
    near = ensemble(load("chain-2"), 8.0, starts=within, tolerance=1e-13, **options)
    wrong = np.abs((far.final.links - turned) - (near.final.links - within)).max(axis=1)
    assert np.all(wrong <= np.maximum(10 * far.column("error_rad"), 1e-7))
    assert np.median(wrong) < 1e-5


def test_horizons_that_nobody_estimates_are_not_counted() -> None:
    runs = ensemble(load("chain-2"), 0.2, starts=ANGLES[:1], engine="simulate", measures=["largest_angle"])
    assert np.all(np.isnan(runs.column("horizon_s")))
    assert "horizons not estimated" in runs.words()


def test_an_engine_that_has_run_is_ready() -> None:
    pytest.importorskip("numba")
    ensemble(load("chain-2"), 0.2, starts=ANGLES, engine="numba", workers=1, check=0)
    code = code_of("numba", first_numbers(members_of(load("chain-2"), ANGLES, None)))
    assert code
    assert code.is_ready


def test_what_is_compiled_is_ready_afterwards() -> None:
    pytest.importorskip("numba")
    pytest.importorskip("heyoka")
    first, second = (compile_engines(load("chain-2")) for _ in range(2))
    assert [code.action for code in second.codes] == ["was ready"] * 3
    for report in (first, second):
        assert all(Path(code.kept_in).is_dir() for code in report.codes)
    assert "many motions  numba   was ready" in compilation_table(second, "text")
