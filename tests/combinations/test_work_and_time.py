"""Pairs that are taken by what a feature is, conservative, dissipative or in time: each against another route."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import scipy

from modal import Scene, natural_modes
from modal.assembly import matrices
from modal.coupling import explain
from modal.exact import enclose
from modal.exact.characteristic import of_scene
from modal.scene import scene_from
from modal.scene.parameters import vary
from modal.statespace.shapers import swings_of
from modal.symbolic.derivation import symbolic_structure
from modal.tuning import tune
from modal.types import Floats
from nonlinear import simulate
from nonlinear.averaging import average, relative_equilibria
from nonlinear.chaos import lyapunov
from nonlinear.ensembles.sections import starts_at
from nonlinear.ensembles.strobes import find_strobes
from nonlinear.integration.watches import tangent_direction
from nonlinear.orbits import follow_cycles
from nonlinear.orbits.forced import forced_orbit
from nonlinear.orbits.modes import mode_orbit
from nonlinear.synchronization.study import study_synchronization
from nonlinear.system import State, system_of
from nonlinear.verification import check
from nonlinear.verification.modes import compare

PUSH = {"on": "pendulum[0].links[0]", "kind": "sine", "amplitude": 1.5, "frequency_hz": 0.47}
PULL = {"on": "pendulum[0].links[0]", "kind": "constant", "amplitude": 1.5}
DRIVE = {"kind": "van-der-pol", "strength": 0.3, "angle_deg": 15.0}
KICK = {"kind": "escapement", "impulse": 0.05, "angle_deg": 3.0}
SHAKE = {"kind": "sine", "direction": "horizontal", "amplitude": 0.02, "frequency_hz": 0.8}
HOIST = {"to": 0.5, "begin": 0.2, "duration": 2.0}
CART = {"kind": "cart", "mass": 2.0, "stiffness": 20.0, "damping": 0.3}


def single(*force: Any, support: Any = None, ratio: float = 0.0, **numbers: Any) -> Scene:
    """A bob on 1 m."""
    link = {"kind": "bob", "mass": 1.0, "length": 1.0, **numbers}
    return scene_from(
        {
            "gravity": 9.81,
            "damping_ratio": ratio,
            "support": support or {"kind": "fixed"},
            "pendulum": [{"links": [link], "start": {"angles_deg": [20.0]}}],
            "force": list(force),
        }
    )


def double(*force: Any, support: Any = None, **numbers: Any) -> Scene:
    """Two bobs, the upper with further numbers."""
    links = [
        {"kind": "bob", "mass": 1.0, "length": 1.0, **numbers},
        {"kind": "bob", "mass": 0.7, "length": 0.8},
    ]
    pendulum = {"links": links, "start": {"angles_deg": [20.0, -10.0]}}
    return scene_from(
        {"gravity": 9.81, "support": support or {"kind": "fixed"}, "pendulum": [pendulum], "force": list(force)}
    )


TIMED = (
    double(hoist=HOIST),
    double(PUSH),
    double(support={"kind": "moved", "motion": [SHAKE]}),
    double(friction=0.1),
    double(quadratic_drag=0.2),
    double(drive=DRIVE),
)


@pytest.mark.parametrize("scene", TIMED)
def test_what_is_left_out_leaves_the_linear_answers_as_they_are(scene: Scene) -> None:
    """As those of the scene with this taken away by hand."""
    bare = double()
    M, K, D = (np.array(part.evalf(), dtype=float) for part in symbolic_structure(scene).matrices())
    expected = matrices(bare)
    assert pytest.approx(expected.M, abs=1e-14) == M
    assert pytest.approx(expected.K, abs=1e-14) == K
    assert not D.any()
    assert enclose(scene, digits=10) == enclose(bare, digits=10)
    assert explain(scene).fixed_base.omega == pytest.approx(explain(bare).fixed_base.omega, rel=1e-14)
    orbits = [mode_orbit(each, 1, 0.4) for each in (scene, bare)]
    assert orbits[0].period == pytest.approx(orbits[1].period, rel=1e-10)
    rows = [check(each, [0], [5.0]).rows[0] for each in (scene, bare)]
    assert repr(rows[0]) == repr(rows[1])


@pytest.mark.parametrize("name", ["loss", "friction", "quadratic_drag", "drive", "damping", "drag"])
def test_a_start_has_its_energy_whatever_it_loses(name: str) -> None:
    value: Any = DRIVE if name == "drive" else 0.1
    scene = double(PUSH, **({} if name == "loss" else {name: value}))
    masses, lengths = np.array([1.0, 0.7]), np.array([1.0, 0.8])
    for state in starts_at(scene, 3.0, 4):
        vx, vz = (np.cumsum(lengths * way(state.links) * state.link_rates) for way in (np.cos, np.sin))
        height = np.cumsum(lengths * (1 - np.cos(state.links)))
        energy = float(masses @ ((vx**2 + vz**2) / 2 + 9.81 * height))
        assert energy == pytest.approx(3.0, rel=1e-9)


def period_of(times: Floats, values: Floats) -> tuple[float, float, float]:
    """Of a settled motion its period and its extremes, by a spline through many samples."""
    spline = scipy.interpolate.CubicSpline(times, values)
    ups = [t for t in spline.solve(values.mean(), extrapolate=False) if spline(t, 1) > 0]
    extremes = spline(spline.derivative().roots(extrapolate=False))
    return ups[-1] - ups[-2], float(extremes.max()), float(extremes.min())


@pytest.mark.parametrize(
    "scene",
    [single(drive=DRIVE, quadratic_drag=0.05), single(drive=DRIVE, ratio=0.002), single(PULL, drive=DRIVE)],
    ids=["quadratic drag", "damping ratio", "constant force"],
)
def test_limit_cycles_are_where_motions_settle(scene: Scene) -> None:
    run = simulate(scene, 150.0, output=30001, tolerance=1e-11)
    angles = run.motion.links[-4000:, 0]
    period, highest, lowest = period_of(run.times[-4000:], angles)
    (branch, *_) = follow_cycles(scene, "gravity=9.81:9.9:2", start=(run.final, period))
    orbit = branch.orbits[0]
    assert orbit.period == pytest.approx(period, rel=1e-8)
    assert orbit.amplitude == pytest.approx(max(highest, -lowest), rel=1e-8)


@pytest.mark.parametrize(
    "scene",
    [
        single(PUSH, drive=DRIVE),
        single(PUSH, drive=KICK, damping=0.3),
        single(PUSH, friction=0.02, damping=0.3),
        single(PUSH, friction=1.2, damping=0.05),
        single(PUSH, support={**CART, "friction": 1.0}, damping=0.1),
        single(PUSH, support={**CART, "friction_coefficient": 0.05}, damping=0.1),
    ],
    ids=["drive", "kicks", "slips", "sticks", "rail", "coefficient"],
)
def test_forced_orbits_are_where_motions_settle(scene: Scene) -> None:
    run = simulate(scene, 150 / 0.47, output=4, tolerance=1e-11)
    orbit = forced_orbit(scene, start=run.final)
    assert orbit.is_stable
    assert orbit.residual < 1e-12
    assert orbit.state.links == pytest.approx(run.final.links, abs=3e-5)
    assert orbit.state.link_rates == pytest.approx(run.final.link_rates, abs=3e-5)


def test_a_forced_orbit_with_friction_begins_beside_the_linear_response() -> None:
    scene = single(PUSH, friction=0.1, damping=0.3)
    run = simulate(scene, 60 / 0.47, output=4, tolerance=1e-11)
    assert forced_orbit(scene).state.links == pytest.approx(run.final.links, abs=1e-4)


def test_averages_have_the_damper_that_a_ratio_is() -> None:
    """On one pendulum ζ is a damper 2 ζ ω m l²."""
    damper = 2 * 0.002 * np.sqrt(9.81)
    (first,), (second,) = (
        relative_equilibria(average(each))
        for each in (single(ratio=0.002, drive=DRIVE), single(damping=damper, drive=DRIVE))
    )
    assert np.abs(first.z) == pytest.approx(np.abs(second.z), rel=1e-10)
    assert np.abs(first.z) < np.abs(relative_equilibria(average(single(drive=DRIVE)))[0].z) * 0.999


def test_growth_along_a_hoist_is_that_of_two_neighbours() -> None:
    scene = double(hoist=HOIST)
    system = system_of(scene)
    scale = np.sqrt([1.0, 1.0, *[system.gravity / system.by_link("length").min()] * 2])
    y = np.radians([[100.0], [80.0], [0.0], [0.0]])
    _, gains, last = lyapunov._grow(scene, 3.0, 1e-11, 0.0, y)
    v = scale * tangent_direction(4)[:, 0]

    def end(begin: Floats) -> Floats:
        final = simulate(scene, 3.0, start=State(begin[:2], begin[2:]), tolerance=1e-13, output=3).final
        return np.concatenate((final.links, final.link_rates))

    assert last[:4, 0] == pytest.approx(end(y[:, 0]), abs=1e-7)
    apart = (end(y[:, 0] + 1e-6 * v) - end(y[:, 0] - 1e-6 * v)) / 2e-6
    expected = np.log(np.linalg.norm(apart / scale) / np.linalg.norm(v / scale))
    assert float(gains.sum()) == pytest.approx(expected, abs=1e-5)


def test_strobes_after_a_hoist_are_those_of_its_last_length() -> None:
    scene = single(PUSH, damping=0.4, hoist={"to": 0.8, "begin": 0.2, "duration": 5.0})
    lengths = scene, scene.at(9.0), scene.at(0.0)
    last, end, begin = (
        np.asarray(find_strobes(each, 90.0, members=2).to_dict()["theta_1_1_rad"])[-1] for each in lengths
    )
    assert last == pytest.approx(end, abs=1e-7)
    assert last != pytest.approx(begin, abs=1e-2)


def test_shapers_and_tuned_numbers_are_about_the_lean() -> None:
    """A constant force tilts gravity: ω² is that of √(g² + (F/m)²)."""
    scene = single(PULL, support={"kind": "cart", "mass": 5.0, "stiffness": 30.0}, damping=0.05)
    (swing,) = swings_of(scene, "cart_acceleration")
    gravity = np.hypot(9.81, 1.5)
    assert swing.omega == pytest.approx(np.sqrt(gravity), rel=1e-10)
    assert swing.zeta == pytest.approx(0.05 / 2 / np.sqrt(gravity), rel=1e-10)
    fixed = single(PULL, damping=0.05)
    best = tune(fixed, "pendulum[0].links[0].damping=0.01:3", maximize="damping", modes=[1])
    ((place, number),) = best.numbers.items()
    assert number == pytest.approx(3.0, rel=1e-6)  # the more the better, below the critical one
    expected = number / 2 / np.sqrt(gravity)
    assert best.after == pytest.approx(expected, rel=1e-9)
    assert natural_modes(vary(fixed, {place: number}))[0].damping_ratio == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("scene", TIMED[1:3])
def test_shares_of_modes_are_projections(scene: Scene) -> None:
    run = simulate(scene, 4.0, output=401, tolerance=1e-10)
    M, K = matrices(double()).M, matrices(double()).K
    omega2, phi = scipy.linalg.eigh(K, M)
    q, v = run.motion.links, run.motion.link_rates
    energies = ((v @ M @ phi) ** 2 + omega2 * (q @ M @ phi) ** 2) / 2
    comparison = compare(run)
    assert comparison.motion.energy == pytest.approx(energies, rel=1e-7)


def test_modal_coordinates_are_about_the_lean() -> None:
    """Against the angles at which both tensions balance a constant force below."""
    scene = double({**PULL, "on": "pendulum[0].links[1]", "amplitude": 0.7})
    lean = np.arctan([0.7 / (1.7 * 9.81), 0.7 / (0.7 * 9.81)])
    start = State(lean + np.array([1e-4, -2e-4]), np.zeros(2))
    run = simulate(scene, 2.0, start=start, output=201, tolerance=1e-12)
    assert compare(run).motion.displacement == pytest.approx(run.motion.links - lean, abs=1e-11)


@pytest.mark.parametrize("ratio", [0.02, [0.01, 0.3]])
def test_natural_frequencies_are_those_without_a_damping_ratio(ratio: Any) -> None:
    """|λ| of the table is enclosed, and a root of the polynomial."""
    scene = double().replace(damping_ratio=ratio)
    omega = np.abs([complex(value) for value in natural_modes(scene).eigenvalue])
    for row, value in zip(enclose(scene, digits=12), omega, strict=True):
        assert float(row.low) * (1 - 1e-12) <= value <= float(row.high) * (1 + 1e-12)
    M, K, D = (np.array(part.evalf(), dtype=float) for part in symbolic_structure(scene).matrices())
    assert np.sqrt(scipy.linalg.eigh(K, M, eigvals_only=True)) == pytest.approx(omega, rel=1e-12)
    assert not D.any()
    assert repr(of_scene(scene)) == repr(of_scene(double()))


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("force", [True, False])
def test_two_that_time_moves_alike_stay_in_phase_and_mirror_images_opposed(force: bool, sign: float) -> None:
    link = {"kind": "bob", "mass": 1.0, "length": 1.0, "damping": 0.05}
    pendula = [{"links": [link], "start": {"angles_deg": [angle]}} for angle in (10.0, 10.0 * sign)]
    other = {**PUSH, "on": "pendulum[1].links[0]", "phase_deg": 0.0 if sign > 0 else 180.0}
    shake = {**SHAKE, "direction": "horizontal" if sign > 0 else "vertical"}
    acting: dict[str, Any] = {"force": [PUSH, other]} if force else {"support": {"kind": "moved", "motion": [shake]}}
    study = study_synchronization(scene_from({"gravity": 9.81, "pendulum": pendula, **acting}), duration=20.0)
    difference = np.exp(1j * (study.phases.phase[:, 0] - study.phases.phase[:, 1]))
    assert np.abs(difference - sign).max() < 1e-6
