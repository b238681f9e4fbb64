"""Fits: synthetic records whose truth is known, and a measured arm with dry friction."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from amounts import usually

from modal.errors import SceneError
from modal.identification import find_parameters, numbers_at, scene_with
from modal.scene import Scene, load, scene_from
from modal.scene.parameters import number_at
from modal.types import Floats
from nonlinear import State, simulate
from nonlinear.identification import (
    Fit,
    Recording,
    Segment,
    Sensor,
    compare,
    fit,
    fit_record,
    read_recording,
    turning_points,
)
from nonlinear.identification import problem as problem_module
from nonlinear.identification.flow import Readings, Segments, integrate_segments
from nonlinear.identification.problem import FitProblem
from nonlinear.identification.starting import spectral_lines

DATA = Path(__file__).parents[2] / "notebooks" / "data"
SWING = DATA / "single_pendulum_free_swing.csv"
KINDS = Path(__file__).parents[1] / "combinations" / "scenes"
STEP = 2 * np.pi / 2**12
ARM = {"kind": "body", "mass": 0.1478, "length": 0.3, "centre": 0.1476, "inertia": 1.0912e-4, "damping": 1e-4}
TWO: list[dict[str, Any]] = [
    {"kind": "rod", "mass": 1.0, "length": 0.5, "damping": 0.01, "friction": 0.02},
    {"kind": "bob", "mass": 0.6, "length": 0.4, "damping": 0.005, "friction": 0.01},
]


def made(scene: Scene, seed: int, *, noise: float = 1e-3, segments: int = 2, seconds: float = 3.0) -> Recording:
    """A recording with offsets, delays and the steps of a 12-bit encoder."""
    rng = np.random.default_rng(seed)
    links, times = scene.n_links, np.arange(0, seconds, 0.01)
    sensors = tuple(Sensor(1, k + 1) for k in range(links))
    blank = tuple(Segment("made", str(s), times + 10 * s, np.zeros((len(times), links))) for s in range(segments))
    problem = FitProblem(scene, (), Recording(sensors, blank), np.ones(links), tolerance=1e-10)
    u, half = np.zeros(problem.layout.size), problem.coordinates
    for s in range(segments):
        state = np.zeros(problem.layout.width)
        state[half - links : half] = rng.normal(0, 0.4, links)
        u[problem.layout.state(s)] = state
    u[problem.layout.offsets] = rng.normal(0, 0.01, links)
    u[problem.layout.delays] = [0.0, *rng.uniform(0.0, 0.5, links - 1) * problem.late]
    read = [np.round((v + rng.normal(0, noise, v.shape)) / STEP) * STEP for v in problem.readings(u)]
    return Recording(sensors, tuple(replace(segment, values=v) for segment, v in zip(blank, read, strict=True)))


def wrong(scene: Scene, free: list[str], seed: int, size: float = 0.08) -> Scene:
    """The scene with other numbers at these places."""
    rng = np.random.default_rng(seed)
    parameters = find_parameters(scene, free)
    z = np.array(
        [
            parameter.start + size * rng.normal() * (1.0 if parameter.log else parameter.start)
            for parameter in parameters
        ]
    )
    return scene_with(scene, numbers_at(parameters, z))


def pulls(scene: Scene, fitted: Fit) -> Floats:
    """Errors over standard deviations, the held ones making up for nothing: they are true."""
    true = np.array([number_at(scene, parameter.place) for parameter in fitted.parameters])
    return np.array([(fitted.values[k] - true[k]) / fitted.stds[k] for k in fitted.fitted])


@pytest.mark.parametrize(
    ("seed", "support"),
    [(1, {"kind": "fixed"}), *usually([], [(2, {"kind": "cart", "mass": 4.0, "stiffness": 60.0})])],
)
def test_the_truth_is_within_the_error_bars(seed: int, support: dict[str, Any]) -> None:
    """Lengths, dampers and friction; the masses are known."""
    scene = scene_from({"gravity": 9.81, "support": support, "pendulum": [{"links": TWO}]})
    free = [f"pendulum[0].links[*].{name}" for name in ("length", "damping", "friction")]
    fitted = fit(wrong(scene, free, seed), made(scene, seed, seconds=2.0), free)
    assert len(fitted.held) == 0
    assert np.abs(pulls(scene, fitted)).max() < 4
    assert np.mean(np.square(pulls(scene, fitted))) < 4
    assert fitted.bootstrap(300)[fitted.fitted] == pytest.approx(fitted.stds[fitted.fitted], rel=0.35)
    assert fitted.rms_all == pytest.approx(np.hypot(1e-3, STEP / np.sqrt(12)), rel=0.1)
    assert fitted.problem.noise == pytest.approx([fitted.rms_all] * 2, rel=0.2)


def test_free_swings_never_give_the_absolute_mass() -> None:
    scene = scene_from({"gravity": 9.81, "pendulum": [{"links": [{**link, "friction": 0.0} for link in TWO]}]})
    free = ["pendulum[0].links[*].mass", "pendulum[0].links[*].damping"]
    record = made(scene, 3, segments=1, seconds=1.0)
    fitted = fit(scene, record, free)
    (direction,) = fitted.undetermined
    assert {direction.held, *direction.changes} == {parameter.path for parameter in fitted.parameters}
    assert [*direction.changes.values()] == pytest.approx([1.0] * 3, abs=1e-6)
    assert fitted.values[fitted.held] == [number_at(scene, fitted.parameters[fitted.held[0]].place)]
    report = fit_record(fitted)
    assert [number["place"] for number in report["fixed"]] == [direction.held]
    assert len(report["combinations"]) == len(report["parameters"]) == len(report["covariance"]) == 3
    known = fit(scene, record, free, priors=["pendulum[0].links[0].mass=1.0±0.01"])
    assert not len(known.held)
    assert known.stds[0] == pytest.approx(0.01, rel=0.05)


def test_no_motion_is_integrated_twice(monkeypatch: pytest.MonkeyPatch) -> None:
    """A search asks for motions where it ends as well: for noise, covariance and residuals."""
    asked: list[tuple[Any, ...]] = []

    def count(segments: Segments, channels: Any, tolerance: float, max_steps: int) -> Readings:
        numbers = tuple(np.ravel(entry)[0] for entry in segments.real.entries)
        times = tuple(channel.times.tobytes() for channel in channels)
        asked.append((numbers, segments.y[..., 0].real.tobytes(), times, tolerance))
        return integrate_segments(segments, channels, tolerance, max_steps)

    links = [{**TWO[0], "friction": 0.0}]
    scene = scene_from({"gravity": 9.81, "pendulum": [{"links": links}]})
    recording = made(scene, 4, segments=1, seconds=1.5)
    monkeypatch.setattr(problem_module, "integrate_segments", count)
    free = ["pendulum[0].links[0].length", "pendulum[0].links[0].damping"]
    fitted = fit(wrong(scene, free, 5), recording, free)
    assert np.abs(pulls(scene, fitted)).max() < 4
    assert len(set(asked)) == len(asked)
    fitted.problem.residuals(fitted.unknowns)
    assert len(set(asked)) == len(asked)


def test_a_sensors_scale_and_outliers_are_found() -> None:
    scene = scene_from({"gravity": 9.81, "pendulum": [{"links": [{**TWO[1], "friction": 0.0}]}]})
    record = made(scene, 4, noise=5e-4)
    rng = np.random.default_rng(7)
    bent = []
    for segment in record.segments:
        values = segment.values.copy()
        values[rng.choice(len(values), 12, replace=False)] += 1.0
        values[40:45] = np.nan
        bent.append(replace(segment, values=values))
    bad = replace(record, segments=tuple(bent))
    fitted = fit(scene, bad, ["pendulum[0].links[0].length"], loss="soft_l1")
    assert fitted.values == pytest.approx([0.4], abs=1e-3)
    plain = fit(scene, bad, ["pendulum[0].links[0].length"])
    assert plain.rms_all > 0.1
    assert plain.stds[0] > 10 * fitted.stds[0]
    bent = [replace(segment, values=1.05 * segment.values) for segment in record.segments]
    scaled = fit(scene, replace(record, segments=tuple(bent)), scale=True)
    (at,) = range(scaled.problem.layout.size)[scaled.problem.layout.scales]
    assert abs(scaled.unknowns[at] - 0.05) < 4 * np.sqrt(scaled.cov[at, at]) < 0.04


def test_a_chaotic_segment_is_fitted_in_windows_that_join() -> None:
    """A double pendulum that turns over, from lengths that are off by 3 %."""
    links = [{**link, "friction": 0.0, "damping": 0.0} for link in TWO]
    scene = scene_from({"gravity": 9.81, "pendulum": [{"links": links}]})
    times = np.arange(0, 2, 0.02)
    run = simulate(scene, 2.0, start=State(np.array([2.2, 2.6]), np.zeros(2)), output=times, tolerance=1e-12)
    values = run.motion.links + np.random.default_rng(8).normal(0, 2e-3, (len(times), 2))
    record = Recording((Sensor(1, 1), Sensor(1, 2)), (Segment("", "", times, values),))
    off = scene_with(scene, {"pendulum[0].links[0].length": 0.515, "pendulum[0].links[1].length": 0.388})
    fitted = fit(off, record, ["pendulum[0].links[*].length"], window=1.0)
    assert [segment.continued for segment in fitted.recording.segments] == [True, False]
    assert fitted.rms_all == pytest.approx(2e-3, rel=0.1)
    assert np.abs(pulls(scene, fitted)).max() < 4
    problem = fitted.problem
    gaps = problem.residuals(fitted.unknowns)[problem.recording.n_values :]
    assert gaps.size == problem.layout.width
    assert np.abs(gaps).max() < 4


def test_the_measured_arm_is_stopped_by_dry_friction() -> None:
    """0.0051 rad per half swing; rms of 1e-3 rad over 14 s, and a stop when the arm stopped (within 0.15 s)."""
    viscous = scene_from({"gravity": 9.81, "pendulum": [{"links": [ARM]}]})
    record = read_recording(viscous, [SWING]).until(14.0)
    free = [f"pendulum[0].links[0].{name}" for name in ("inertia", "damping")]
    told = fit(viscous, record, free)
    assert any(
        "turning points fall on a straight line, 0.0051 rad per half swing: try friction" in sentence
        for sentence in told.verdict
    )
    fitted = fit(viscous, record, [*free, "pendulum[0].links[0].friction"])
    (segment,) = record.segments
    begin = segment.times < segment.times[0] + 14
    off = (fitted.readings[0] - segment.values)[begin]
    assert np.sqrt(np.mean(off**2)) < 1e-3 < told.rms_all
    still = [
        times[np.flatnonzero(np.abs(v - v[-1]) > 5e-4)[-1]]
        for times, v in ((segment.times, fitted.readings[0][:, 0]), (segment.times, segment.values[:, 0]))
    ]
    assert still[0] == pytest.approx(still[1], abs=0.15)
    candidates = compare(viscous, record, free[:1], ["viscous", "coulomb"])
    assert [candidate.name for candidate in candidates][-1] == "viscous"
    assert candidates[-1].held_out_rms > 3 * candidates[0].held_out_rms


def test_dry_friction_is_told_of_turning_points() -> None:
    """The measured arm, whose half swings lose 0.0051 rad each."""
    viscous = scene_from({"gravity": 9.81, "pendulum": [{"links": [ARM]}]})
    free = [f"pendulum[0].links[0].{name}" for name in ("inertia", "damping")]
    told = fit(viscous, read_recording(viscous, [SWING]).until(8.0), free)
    words = "turning points fall on a straight line, 0.0051 rad per half swing: try friction"
    assert any(words in sentence for sentence in told.verdict)


def test_dry_friction_is_found_among_laws() -> None:
    scene = scene_from({"gravity": 9.81, "pendulum": [{"links": [{**TWO[1], "friction": 0.04}]}]})
    smooth, record = scene.frictionless, made(scene, 5, segments=1, seconds=3.0)
    free = ["pendulum[0].links[0].damping"]
    candidates = compare(smooth, record, free, ["viscous", "coulomb"])
    assert [candidate.name for candidate in candidates] == ["coulomb", "viscous"]
    assert candidates[-1].held_out_rms > 3 * candidates[0].held_out_rms


def test_spectral_lines_are_the_frequencies() -> None:
    times = np.arange(0, 20, 0.01)
    values = (np.sin(4 * times) + 0.5 * np.cos(9 * times))[:, None]
    lines = spectral_lines(Recording((Sensor(1, 1),), (Segment("", "", times, values),)))
    assert lines == pytest.approx([4, 9], abs=0.02)


def test_turning_points_of_an_exponential_are_not_a_straight_line() -> None:
    times = np.arange(0, 20, 0.01)
    assert turning_points(times, 0.1 * np.exp(-0.15 * times) * np.cos(5 * times), 5.0) is None
    line = 0.1 * np.maximum(1 - times / 15, 0) * np.cos(5 * times)
    assert turning_points(times, line, 5.0) == pytest.approx(0.1 / 15 * np.pi / 5, rel=0.03)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"space": "space"}, "a fit of motions is computed in the plane"),
        ({"damping_ratio": 0.01}, "damping_ratio"),
    ],
)
def test_scenes_that_cannot_be_fitted(change: dict[str, Any], words: str) -> None:
    scene = scene_from({"gravity": 9.81, "pendulum": [{"links": [TWO[1] | {"friction": 0.0}]}], **change})
    times = np.arange(0.0, 1.0, 0.1)
    record = Recording((Sensor(1, 1),), (Segment("", "", times, np.sin(times)[:, None]),))
    with pytest.raises(SceneError, match=words):
        fit(scene, record, ["gravity"])


SWITCHED = {
    "escapement": {"pendulum[0].links[0].drive.impulse": 0.07, "pendulum[0].links[0].drive.angle_deg": 2.3},
    "van_der_Pol": {"pendulum[0].links[0].drive.strength": 1.5, "pendulum[0].links[0].drive.angle_deg": 6.5},
    "moved_horizontal": {"pendulum[0].links[0].length": 1.03, "gravity": 9.7},
    "hoist_and_drag": {"pendulum[0].links[0].drag": 0.08, "pendulum[0].links[0].mass": 1.3},
    "rail_coefficient": {"support.friction_coefficient": 0.04},
}


@pytest.mark.parametrize("name", usually(["escapement", "hoist_and_drag"], [*SWITCHED]))
def test_numbers_of_clocks_cranes_and_shaken_scenes_are_found(name: str) -> None:
    """Within their error bars, from a run by the simulator with noise."""
    scene, true = load(KINDS / f"{name}.toml"), SWITCHED[name]
    run = simulate(scene_with(scene, true), 3.0, output=81)
    pendula = [(p + 1, k + 1) for p in range(scene.pendulum[0].count) for k in range(2)]
    sensors, values = tuple(Sensor(*place) for place in pendula), run.motion.links
    if scene.support.kind == "cart":
        sensors, values = (Sensor(), *sensors), np.column_stack((run.motion.cart, values))
    values = values + 1e-3 * np.random.default_rng(2).standard_normal(values.shape)
    fitted = fit(scene, Recording(sensors, (Segment("run", "", run.times, values),)), list(true))
    off = (fitted.values - np.array([*true.values()])) / fitted.stds
    assert len(fitted.fitted) == len(true)
    assert np.all(np.abs(off) < 4)
    assert np.all(fitted.stds < 0.05 * np.array([*true.values()]))


def test_a_hoisted_length_is_not_free() -> None:
    scene = load(KINDS / "hoist.toml")
    record = Recording((Sensor(1, 1),), (Segment("", "", np.arange(9) * 0.1, np.zeros((9, 1))),))
    with pytest.raises(SceneError, match=r"links\[0\].length: follows its hoist"):
        fit(scene, record, ["pendulum[0].links[*].length"])


def test_unknown_laws_and_losses_are_refused() -> None:
    scene = scene_from({"gravity": 9.81, "pendulum": [{"links": [ARM]}]})
    record = read_recording(scene, [SWING])
    with pytest.raises(SceneError, match="did you mean viscous"):
        compare(scene, record, [], ["viscos"])
    with pytest.raises(SceneError, match="loss square"):
        fit(scene, record, [], loss="square")
