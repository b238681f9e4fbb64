"""Supports that move: against equations written by hand, between all forms, and in the books of energy."""

from __future__ import annotations

from itertools import pairwise
from math import cos, pi, sin, sqrt, tau
from pathlib import Path

import numpy as np
import pytest
from amounts import usually
from scipy.integrate import solve_ivp

from modal import Bob, InitialCondition, Pendulum, Rod, Scene, SceneError, load
from modal.scene import Moved, RandomMotion, RecordMotion, SineMotion, SupportMotion, SweepMotion
from nonlinear import files, simulate
from nonlinear.dynamics import Maximal
from nonlinear.postprocessing import reaction_forces_of
from nonlinear.postprocessing.summary import text
from nonlinear.reduction import superpose
from nonlinear.simulation import resume
from nonlinear.system import AppliedForces, State, initial_state, system_of

G = 9.81
M1, M2, L1, L2 = 1.3, 0.7, 1.1, 0.6
TIMES = np.arange(40) * 0.1
RECORD = tuple((2.0 * np.sin(4 * TIMES) * np.exp(-0.5 * TIMES) + 1.0).tolist())


def motions(direction: str) -> list[SupportMotion]:
    return [
        SineMotion(direction=direction, amplitude=0.3, frequency_hz=0.9, phase_deg=20.0),
        SweepMotion(direction=direction, amplitude=0.05, from_hz=0.2, to_hz=3.0, duration=2.5),
        RecordMotion(direction=direction, time_s=tuple((TIMES + 0.3).tolist()), acceleration_m_per_s2=RECORD),
        RandomMotion(direction=direction, psd=(1.0, 1.0), frequency_hz=(0.1, 5.0), seed=3, duration=20.0),
    ]


EVERY = [motion for direction in ("horizontal", "vertical") for motion in motions(direction)]


def double(motion: SupportMotion, space: str = "plane", **more: float) -> Scene:
    links = (Bob(mass=M1, length=L1, **more), Bob(mass=M2, length=L2, **more))
    start = InitialCondition(angles_deg=(30.0, -50.0), rates_deg=(10.0, 5.0))
    return Scene(gravity=G, space=space, support=Moved(motion=motion), pendulum=(Pendulum(links=links, start=start),))


def by_hand(scene: Scene, times: np.ndarray) -> np.ndarray:
    """Two bobs in Cartesian coordinates of the laboratory: Lagrange's equations with the pivot's motion in them.

    r_1 = r_0(t) + L1 u_1, r_2 = r_1 + L2 u_2, each equation the projection of forces and accelerations on ∂r/∂θ_i.
    """
    support = system_of(scene).support
    assert support is not None
    ((direction, moving),) = support.motions

    def rate(t: float, y: np.ndarray) -> list[float]:
        a, b, p, q = y
        along, down = (part * moving.acceleration_at(t) for part in direction)
        left = np.array([[(M1 + M2) * L1, M2 * L2 * cos(a - b)], [L1 * cos(a - b), L2]])
        first = -M2 * L2 * q * q * sin(a - b) - (M1 + M2) * (along * cos(a) + (G - down) * sin(a))
        second = L1 * p * p * sin(a - b) - along * cos(b) - (G - down) * sin(b)
        return [p, q, *np.linalg.solve(left, [first, second])]

    state = initial_state(scene)
    breaks = [t for t in moving.breaks if 0 < t < times[-1]]
    edges, y, rows = [0.0, *breaks, float(times[-1])], np.concatenate((state.links, state.link_rates)), []
    for low, high in pairwise(edges):
        inside = times[(times >= low) & ((times < high) | (high == times[-1]))]
        run = solve_ivp(rate, (low, high), y, "DOP853", rtol=1e-12, atol=1e-12, dense_output=True, max_step=0.05)
        rows.append(run.sol(inside).T)
        y = run.y[:, -1]
    return np.concatenate(rows)


@pytest.mark.parametrize("motion", EVERY, ids=lambda motion: f"{motion.kind}-{motion.direction}")
def test_the_motion_is_that_of_equations_written_by_hand(motion: SupportMotion) -> None:
    run = simulate(double(motion), 2.8, tolerance=1e-12, output=57)
    exact = by_hand(double(motion), run.times)
    assert run.motion.links == pytest.approx(exact[:, :2], abs=2e-8)
    assert run.motion.link_rates == pytest.approx(exact[:, 2:], abs=2e-7)
    assert run.energy_drift() < 1e-9


@pytest.mark.parametrize("motion", EVERY[:: usually(5, 3)], ids=lambda motion: f"{motion.kind}-{motion.direction}")
def test_all_forms_agree_and_their_books_close(motion: SupportMotion) -> None:
    scene = double(motion, damping=0.05)
    first = simulate(scene, 1.2, tolerance=1e-11, output=13)
    for form in ("maximal", "hamiltonian"):
        other = simulate(scene, 1.2, tolerance=1e-11, form=form, output=13)
        assert other.motion.links == pytest.approx(first.motion.links, abs=1e-7)
        assert other.motion.work == pytest.approx(first.motion.work, abs=1e-7)
        assert other.energy_drift() < 1e-9
    spatial = simulate(scene.replace(space="space"), 1.2, tolerance=1e-11, output=13)
    u = np.stack((np.sin(first.motion.links), 0 * first.motion.links, np.cos(first.motion.links)), axis=-1)
    assert spatial.motion.links == pytest.approx(u, abs=1e-7)
    assert spatial.energy_drift() < 1e-9


def test_many_pendula_and_long_chains() -> None:
    """Recursion, bands and dense matrices: each pendulum moves as it does alone."""
    motion = SineMotion(amplitude=0.1, frequency_hz=1.1)
    start = InitialCondition(angles_deg=(20.0, -5.0))
    pendulum = double(motion).pendulum[0].replace(start=start)
    chain = Pendulum(links=(Rod(mass=0.1, length=0.05, count=30),))
    alone = simulate(double(motion).replace(pendulum=(pendulum,)), 0.5, tolerance=1e-11, output=5)
    many = simulate(
        double(motion).replace(pendulum=(pendulum.replace(count=20), chain)), 0.5, tolerance=1e-11, output=5
    )
    assert many.run.reduced == ""
    assert many.motion.links[:, :2] == pytest.approx(alone.motion.links, abs=1e-7)
    assert many.motion.links[:, 38:40] == pytest.approx(alone.motion.links, abs=1e-7)
    assert many.energy_drift() < 1e-9


def test_in_space_the_shaking_is_along_the_rail_alone() -> None:
    """Across the rail, a pendulum at small angles swings as on a fixed support."""
    motion = SineMotion(amplitude=1e-4, frequency_hz=0.7)
    start = InitialCondition(angles_deg=(0.01,), azimuths_deg=(90.0,))
    pendulum = Pendulum(links=(Bob(mass=1.0, length=1.0),), start=start)
    scene = Scene(gravity=G, space="space", support=Moved(motion=motion), pendulum=(pendulum,))
    run = simulate(scene, 5.0, tolerance=1e-10, output=51)
    across = np.deg2rad(0.01) * np.cos(sqrt(G) * run.times)
    assert run.motion.links[:, 0, 1] == pytest.approx(across, abs=1e-9)
    assert np.abs(run.motion.links[:, 0, 0]).max() > 1e-4


def test_a_falling_support_leaves_no_gravity() -> None:
    fall = RecordMotion(direction="vertical", time_s=(0.0, 1.0, 2.0, 3.0), acceleration_m_per_s2=(-G,) * 4)
    link = Bob(mass=2.0, length=0.5)
    pendulum = Pendulum(links=(link,), start=InitialCondition(angles_deg=(40.0,), rates_deg=(90.0,)))
    scene = Scene(gravity=G, support=Moved(motion=fall), pendulum=(pendulum,))
    run = simulate(scene, 2.0, tolerance=1e-12, output=11)
    assert run.motion.link_rates[:, 0] == pytest.approx(np.full(11, pi / 2), rel=1e-10)
    forces = reaction_forces_of(run)
    assert np.linalg.norm(forces.pivots[:, 0], axis=-1) == pytest.approx(
        np.full(11, 2.0 * 0.5 * (pi / 2) ** 2), rel=1e-8
    )
    assert run.mechanics.joints[-1, 0, 1] == pytest.approx(0.5 * np.cos(run.motion.links[-1, 0]) + G * 2.0, rel=1e-9)


def test_uniform_motion_changes_nothing_but_the_place() -> None:
    steady = RecordMotion(time_s=(0.0, 1.0, 2.0, 3.0), displacement_m=(0.0, 2.0, 4.0, 6.0))
    scene = double(steady)
    run, still = (simulate(each, 5.0, tolerance=1e-11, output=21) for each in (scene, scene.still))
    assert run.motion.links == pytest.approx(still.motion.links, abs=1e-8)
    shift = run.mechanics.joints - still.mechanics.joints
    assert shift[..., 0] == pytest.approx(np.repeat(2.0 * run.times[:, None], 2, axis=1), abs=1e-7)
    assert run.mechanics.energy == pytest.approx(still.mechanics.energy, abs=1e-7)


def test_reaction_forces_are_the_constraint_forces_and_newtons_law() -> None:
    scene = double(EVERY[0], damping=0.1)
    run = simulate(scene, 2.0, tolerance=1e-12, output=2001)
    forces = reaction_forces_of(run)
    maximal = Maximal(run.system, run.equations.load if run.equations else None).reactions(run.motion, run.times)
    assert maximal.pivots == pytest.approx(forces.pivots, abs=1e-8)
    places = run.mechanics.centres
    step = run.times[1] - run.times[0]
    acceleration = (places[2:] - 2 * places[1:-1] + places[:-2]) / step**2
    total = np.sum(np.array([M1, M2])[:, None] * acceleration, axis=1) - (M1 + M2) * np.array([0.0, G])
    assert forces.pivots[1:-1, 0] == pytest.approx(total, abs=5e-3)


def test_a_load_acts_besides() -> None:
    scene = double(EVERY[0])

    def wind(time: float, state: State) -> AppliedForces:
        return AppliedForces(0.0, 0.3 * np.cos(state.links))

    pushed = [simulate(scene, 2.0, load=wind, form=form, tolerance=1e-11, output=9) for form in ("minimal", "maximal")]
    assert pushed[0].driven
    assert pushed[1].motion.links == pytest.approx(pushed[0].motion.links, abs=1e-8)
    assert np.abs(pushed[0].motion.links - simulate(scene, 2.0, output=9).motion.links).max() > 0.01
    assert pushed[0].energy_drift() < 1e-9


@pytest.mark.parametrize("kind", ["npz", "csv"])
def test_a_saved_run_has_its_record_and_goes_on(tmp_path: Path, kind: str) -> None:
    scene = double(EVERY[2])
    run = simulate(scene, 2.0, tolerance=1e-11, output=21)
    files.save(run, tmp_path / f"run.{kind}")
    read = files.load(tmp_path / f"run.{kind}")
    assert read.scene == scene
    assert not read.driven
    assert np.array_equal(read.motion.links, run.motion.links)
    assert np.array_equal(read.mechanics.joints, run.mechanics.joints)
    assert reaction_forces_of(read).pivots == pytest.approx(reaction_forces_of(run).pivots, rel=1e-12)
    rest = resume(read, 2.0, output=21)
    assert rest.motion.links == pytest.approx(
        simulate(scene, 4.0, tolerance=1e-11, output=41).motion.links[20:], abs=1e-7
    )
    if kind == "csv":
        heads, first = (tmp_path / "run.csv").read_text().splitlines()[:2]
        assert heads.split(",")[-3:] == ["support_m", "support_dot_m_per_s", "support_ddot_m_per_s2"]
        assert first.endswith("0.0,0.0,0.0")


def test_small_shaking_is_the_linear_response() -> None:
    """After long, a damped pendulum swings by |H(iω)| times the amplitude of its support."""
    frequency = 0.9
    motion = SineMotion(amplitude=1e-5, frequency_hz=frequency)
    link = Bob(mass=1.0, length=0.5, damping=1.0)
    scene = Scene(gravity=G, support=Moved(motion=motion), pendulum=(Pendulum(links=(link,)),))
    run = simulate(scene, 30.0, tolerance=1e-10, output=30_001)
    omega = tau * frequency
    H = omega**2 / 0.5 / complex(G / 0.5 - omega**2, omega * 1.0 / 0.25)
    assert np.abs(run.motion.links[-5000:]).max() == pytest.approx(abs(H) * 1e-5, rel=1e-5)


def test_kapitzas_pendulum_stands_and_swings_at_its_averaged_frequency() -> None:
    amplitude, frequency, length = 0.01, 60.0, 0.2
    motion = SineMotion(direction="vertical", amplitude=amplitude, frequency_hz=frequency, phase_deg=90.0)
    link = Bob(mass=1.0, length=length)
    start = InitialCondition(angles_deg=(177.0,))
    pendulum = Pendulum(links=(link,), equilibrium=("up",), start=start)
    scene = Scene(gravity=G, support=Moved(motion=motion), pendulum=(pendulum,))
    run = simulate(scene, 1.5, output=3001)
    away = np.abs(run.motion.links[:, 0] - pi)
    assert away.max() < np.deg2rad(6.0)
    averaged = sqrt((amplitude * tau * frequency) ** 2 / (2 * length**2) - G / length)
    smooth = np.convolve(run.motion.links[:, 0] - pi, np.ones(33) / 33, "valid")
    crossings = np.flatnonzero(np.diff(np.sign(smooth)) != 0)
    period = 2 * (run.times[crossings[-1]] - run.times[crossings[0]]) / (len(crossings) - 1)
    assert tau / period == pytest.approx(averaged, rel=0.02)
    fallen = simulate(scene.still, 3.0, output=301)
    assert np.abs(fallen.motion.links[:, 0] - pi).max() > 1.0


def test_the_summary_tells_of_the_support() -> None:
    told = text(simulate(double(EVERY[2]), 6.0, output=61))
    assert "along the rail; angles and energies are in its frame" in told
    assert "the support moves on at that velocity" in told
    shaken = text(simulate(double(EVERY[4]), 1.0, output=11))
    assert "m upwards" in shaken
    assert "the largest Floquet multiplier of a period is" in shaken
    still = text(simulate(double(EVERY[0]).still, 1.0, output=11))
    assert "in its frame" not in still


def test_an_accuracy_is_met() -> None:
    scene = double(EVERY[0])
    run = simulate(scene, 2.0, accuracy=1e-6, output=11)
    assert run.run.error <= 1e-6
    assert run.motion.links == pytest.approx(by_hand(scene, run.times)[:, :2], abs=1e-6)


def test_steps_end_at_the_kinks_of_a_motion() -> None:
    """A short pulse late in a long rest is not stepped over."""
    t = (20.0, 20.01, 20.02, 20.03, 20.04, 20.05)
    pulse = RecordMotion(time_s=t, acceleration_m_per_s2=(0.0, 50.0, 90.0, 90.0, 50.0, 0.0))
    link = Bob(mass=1.0, length=1.0)
    scene = Scene(gravity=G, support=Moved(motion=pulse), pendulum=(Pendulum(links=(link,)),))
    run = simulate(scene, 21.0, output=22)
    assert not run.motion.links[:21].any()
    assert np.abs(run.motion.link_rates[-1]).max() > 1.0


def test_what_needs_a_support_at_rest_says_so() -> None:
    scene = double(EVERY[0])
    with pytest.raises(SceneError, match="method taylor"):
        simulate(double(EVERY[1]), 1.0, method="taylor")
    with pytest.raises(SceneError, match=r'support\.kind = "moved": motion in closed form'):
        superpose(scene, initial_state(scene), corrected=False)


def test_a_scene_without_motion_is_as_before() -> None:
    still = load("chain-2").replace(
        pendulum=(load("chain-2").pendulum[0].replace(start=InitialCondition(angles_deg=(9.0, 0.0))),)
    )
    assert system_of(still).support is None
    assert double(EVERY[0]).still.support.kind == "fixed"
    assert simulate(still, 1.0).run.calls == simulate(still, 1.0).run.calls > 0
