"""Populations of equal pendula on structures: thresholds by equations of their own, sectors against whole scenes."""

from __future__ import annotations

import csv
from functools import cache
from io import StringIO

import numpy as np
import pytest
import swings
from structured_scenes import STRUCTURED
from structures import Oracle

from modal import Bob, Pendulum, Scene, load
from modal.errors import ComputationError, SceneError
from modal.scene import Spring
from modal.scene.parameters import Variation, vary
from modal.scene.supports import Swing, Tilt
from modal.types import Floats
from nonlinear.averaging import averaged_pattern, patterns_of
from nonlinear.integration import Trajectory
from nonlinear.orbits import Flow, PatternOrbit, free_amplitude, pattern_orbit, periodic_orbit
from nonlinear.plotting import populations_figure
from nonlinear.reduction import residual_forces
from nonlinear.simulation import simulate
from nonlinear.synchronization import (
    PopulationDiagram,
    PopulationPhases,
    diagram_csv,
    diagram_text,
    follow_populations,
    phases_of,
    population_phases,
    symmetric_motions,
    sync_record,
    sync_text,
)
from nonlinear.synchronization.study import study_synchronization
from nonlinear.system import State, initial_state, populations_of, representatives, system_of, unrepresented

NAMES = ("own", "other", "within a population")


@cache
def diagram(kind: str) -> PopulationDiagram:
    return swings.diagram(kind)


@cache
def unequal() -> Scene:
    """Three metronomes on one swing and two on another, heavier one."""
    scene = swings.two_swings(0.15, count=3)
    left, right = scene.supports
    pendula = scene.pendulum[0], scene.pendulum[1].replace(count=2)
    return scene.replace(support=(left, right.replace(mass=3.3)), pendulum=pendula)


def orbit_at(found: PopulationDiagram, motion: str, sector: str) -> tuple[float, PatternOrbit]:
    """The value of a threshold and the orbit there."""
    one = next(one for one in found.thresholds if (one.pattern, one.sector) == (motion, sector))
    branch = next(branch for branch in found.branches if branch.name == motion)
    orbit = branch.motions[branch.values.tolist().index(one.value)].orbit
    assert orbit is not None
    return one.value, orbit


@pytest.mark.slow
@pytest.mark.parametrize("kind", swings.TOLD)
def test_thresholds_are_those_of_other_equations(kind: str) -> None:
    found = diagram(kind)
    for (motion, sector), told in swings.TOLD[kind].items():
        value, orbit = orbit_at(found, motion, sector)
        assert value / swings.UNIT == pytest.approx(told, abs=6e-10)
        rates = swings.own_growth(value / swings.UNIT, kind, motion, orbit)
        assert [rates[name] for name in NAMES] == pytest.approx(orbit.growth, abs=1e-9)
        assert rates[sector] == pytest.approx(0.0, abs=1e-10)


@pytest.mark.slow
def test_the_averaged_equations_find_the_same_thresholds_to_their_accuracy() -> None:
    for one in diagram("swings").thresholds:
        assert one.averaged is not None
        assert one.averaged == pytest.approx(one.value, rel=3e-3)
    in_phase = next(one for one in diagram("swings").thresholds if one.pattern == "in phase")
    assert in_phase.averaged == pytest.approx(in_phase.value, rel=1e-5)


@pytest.mark.slow
def test_a_population_breaks_up_where_half_of_its_energy_is_drained() -> None:
    found = diagram("swings")
    one = next(one for one in found.thresholds if one.sector == NAMES[2])
    assert one.becomes == "loses stability"
    assert one.beat == pytest.approx(0.201, abs=1e-3)
    assert "the trace of the within-block vanishes" in one.reason
    orbit = orbit_at(found, "antiphase", NAMES[2])[1]
    scene = orbit.pattern.scene
    free = free_amplitude(scene, orbit.pattern.populations[0].pendulum)
    assert free == pytest.approx(2 * swings.LIMIT, rel=3e-3)
    assert orbit.amplitudes[0] / free == pytest.approx(0.5**0.5, rel=5e-3)
    assert abs(np.linalg.det(orbit.maps[2])) == pytest.approx(1.0, abs=1e-10)
    averaged = averaged_pattern(patterns_of(vary(scene, {swings.STIFFNESS: one.averaged}))[1])
    assert np.trace(averaged.blocks[2]) == pytest.approx(0.0, abs=1e-8)
    assert averaged.amplitude / (2 * swings.LIMIT) == pytest.approx(0.5**0.5, rel=5e-3)


@pytest.mark.slow
def test_beyond_resonance_the_determinant_breaks_a_population_up() -> None:
    """There the swings follow their spring, not their weight, and the motion emerges from rest a second time."""
    (_, motion) = symmetric_motions(swings.two_swings(0.5, count=2))
    assert motion.orbit is not None
    assert motion.averaged is not None
    assert motion.reason(2) == "the determinant of its within-block is negative"
    assert np.linalg.det(motion.averaged.blocks[2]) < 0
    first, second = motion.orbit.multipliers[2].real
    assert first > 1 > second > 0
    found = swings.diagram("swings", (0.22, 0.3, 0.5))
    (_, antiphase) = found.branches
    (_, dies), (emerges, end) = found.windows(antiphase)
    assert dies / swings.UNIT == pytest.approx(0.25004, abs=1e-4)
    assert 0.3 * swings.UNIT < emerges < end == found.variation.values[-1]
    assert found.intervals(antiphase) == ()


def whole_map(scene: Scene, found: PatternOrbit) -> Floats:
    """The monodromy matrix of all pendula on the motion of their representatives, in natural units."""
    flow, few = Flow(system_of(scene), 1e-12), found.orbit.y.reshape(2, -1)
    first = flow.system.first
    rows, p = [few[:, :first]], 0
    for one in found.pattern.populations:
        rows.append(np.repeat(few[:, first + p : first + p + 1], one.size, axis=1))
        p += one.halves
    y = np.hstack(rows).ravel()
    end = flow(y, np.diag(flow.scale), found.orbit.period)
    assert end.y == pytest.approx(y, abs=1e-9)
    return end.V / flow.scale[:, None]


def times_of(found: PatternOrbit) -> list[int]:
    """How often the multipliers of every sector are among those of the whole scene."""
    if found.pattern.is_split:
        return [1, 1, sum(one.size - 1 for one in found.pattern.populations)]
    return [1, *(one.size - 1 for one in found.pattern.populations if one.size > 1)]


@pytest.mark.parametrize(("scene", "number"), [(swings.two_swings(0.19, count=3), 1), (unequal(), 0)])
def test_sectors_have_all_the_multipliers_of_the_whole_scene(scene: Scene, number: int) -> None:
    found = pattern_orbit(patterns_of(scene)[number])
    several = [np.tile(own, n) for own, n in zip(found.multipliers, times_of(found), strict=True)]
    expected, every = np.concatenate([*several, [1.0]]), np.linalg.eigvals(whole_map(scene, found))
    assert len(expected) == len(every)
    for one in expected:
        at = np.abs(every - one).argmin()
        assert every[at] == pytest.approx(one, abs=1e-7)
        every = np.delete(every, at)


def test_unequal_populations_have_one_common_sector() -> None:
    (motion, _) = patterns_of(unequal())
    assert [one.name for one in motion.sectors] == ["common", "within population 1", "within population 2"]
    exact, averaged = pattern_orbit(motion), averaged_pattern(motion)
    assert averaged.growth == pytest.approx(exact.growth, rel=0.05, abs=2e-3)
    assert averaged.omega == pytest.approx(exact.orbit.omega, rel=1e-4)


@pytest.mark.slow
@pytest.mark.parametrize("number", [0, 1])
def test_limit_cycles_of_two_clocks_on_swings_are_the_patterns(number: int) -> None:
    """By multiple shooting on the scene itself, all disturbances together."""
    scene = swings.two_swings(0.19, count=1)
    one = pattern_orbit(patterns_of(scene)[number])
    cycle = periodic_orbit(scene, one.orbit.state, 1.0001 * one.orbit.period)
    assert cycle.omega == pytest.approx(one.orbit.omega, rel=1e-10)
    assert len(one.multipliers) == 2
    assert np.abs(cycle.floquet.others).max() == pytest.approx(np.abs(np.concatenate(one.multipliers)).max(), abs=1e-8)


@pytest.mark.parametrize("name", ["swings", "board"])
def test_residuals_on_structures_are_those_of_the_oracle(name: str) -> None:
    """With eᵀM w = (E(q, e + w) − E(q, e − w))/2 of the oracle's energy, w = q'' less its accelerations."""
    scene, random = STRUCTURED[name], np.random.default_rng(3)
    system, oracle = system_of(scene), Oracle(scene)
    q, v, turn = random.uniform(-0.5, 0.5, (3, system.first + system.n_links))
    plane = np.array([q, v, turn])[..., None]
    w = turn - np.array(list(map(float, oracle.accelerations(q.tolist(), v.tolist()))))
    both = ([float(oracle.energy(q.tolist(), (e + way * w).tolist())) for e in np.eye(len(q))] for way in (1, -1))
    expected = np.subtract(*both) / 2
    assert residual_forces(system, [plane])[0][:, 0] == pytest.approx(expected, rel=1e-9, abs=1e-9)


# ------------------------------------------------------------------------------------------------ runs and verdicts


def started(kappa: float, ahead_deg: float, count: int = 3) -> Trajectory:
    """A short run from both populations alike, the second ahead by an angle."""
    scene = swings.two_swings(kappa, count=count, spread=False)
    start = initial_state(scene)
    angles, rates = start.links.copy(), start.link_rates.copy()
    turn = np.radians(ahead_deg)
    angles[count:], rates[count:] = angles[count:] * np.cos(turn), -swings.RATE * angles[count:] * np.sin(turn)
    state = State(angles, rates, supports=start.supports, support_rates=start.support_rates)
    return simulate(scene, 8.0, start=state, tolerance=1e-7)


def told(run: Trajectory) -> PopulationPhases:
    found = population_phases(phases_of(run))
    assert found is not None
    return found


@pytest.mark.parametrize(("ahead", "kind"), [(0.0, "in phase"), (180.0, "antiphase"), (-40.0, "locked")])
def test_verdicts_of_locked_populations(ahead: float, kind: str) -> None:
    found = told(started(0.02, ahead))
    assert found.kind == kind
    assert found.late_order == pytest.approx([1.0, 1.0])
    assert found.rate == pytest.approx([found.rate[0]] * 2, rel=1e-3)
    assert np.cos(found.phase[1]) == pytest.approx(np.cos(np.radians(ahead)), abs=0.15)
    assert found.verdict == kind or found.verdict.startswith("locked at -")


def test_chimera_and_neither() -> None:
    scene = swings.two_swings(0.22, count=4)
    found = told(simulate(scene, 20.0, tolerance=1e-7))
    assert (found.kind, found.verdict) == ("a chimera", "population 1 locked, 2 not: a chimera")
    assert found.late_order[0] == pytest.approx(1.0)
    assert found.spread[0] < 1e-9 < found.spread[1]
    loose = scene.replace(pendulum=tuple(one.replace(start=scene.pendulum[1].start) for one in scene.pendulum))
    assert told(simulate(loose, 8.0, tolerance=1e-7)).kind == "neither"


def test_a_pair_on_one_board_is_compared_pendulum_by_pendulum() -> None:
    drive = swings.two_swings(0.2, count=1).pendulum[0].links[0].drive
    link = Bob(mass=0.0001, length=0.1, drive=drive)
    board = Tilt(mass=1.0, inertia=0.1, centre=(0.0, 0.1), stiffness=30.0, damping=0.1)
    pendula = [
        Pendulum(position=(place, 0.0), links=(link,), start={"angles_deg": (angle,)})
        for place, angle in ((-0.2, 15.0), (0.2, -15.0))
    ]
    scene = Scene(gravity=9.81, support=board, pendulum=pendula)
    found = told(simulate(scene, 8.0, tolerance=1e-7))
    assert [one.size for one in found.populations] == [2]
    assert (found.kind, found.verdict) == ("antiphase", "antiphase")
    assert list(unrepresented(scene)) == ["the pendula of tilt hang from points that move differently"]
    with pytest.raises(ComputationError, match="points that move differently"):
        patterns_of(scene)


def test_reports_have_the_verdict_first() -> None:
    scene = swings.two_swings(0.22, count=5)
    found = study_synchronization(scene, 8.0)
    text, record = sync_text(found), sync_record(found)
    assert "\n\nPopulation 1 locked, 2 not: a chimera.\n" in text
    assert "the trace of its within-block is positive, drained to 0.598" in text
    assert "10 pendula on a structure" in text
    assert record["verdict"] == "a chimera"
    assert [one["support"] for one in record["populations"]] == ["left", "right"]
    assert record["populations"][0]["order_parameter"] == pytest.approx(1.0)
    exact = {one.pattern.name: one.orbit for one in found.motions}
    for one in record["symmetric_motions"]:
        own = exact[one["motion"]]
        assert own is not None
        assert list(one["growth_per_s"]) == list(NAMES)
        assert list(one["growth_per_s"].values()) == pytest.approx(own.growth)
        assert one["stable"] is False


# ---------------------------------------------------------------------------------------------------- the diagram


@pytest.mark.slow
def test_the_diagram_tells_intervals_thresholds_and_reasons() -> None:
    found = diagram("swings")
    in_phase, antiphase = found.branches
    assert found.intervals(in_phase) == ((pytest.approx(0.268870566 * swings.UNIT), found.variation.values[-1]),)
    assert found.intervals(antiphase)[0][1] == pytest.approx(0.203742614 * swings.UNIT)
    dies = next(one for one in found.thresholds if not one.sector)
    assert (dies.pattern, dies.becomes) == ("antiphase", "dies out")
    assert found.windows(antiphase) == ((found.variation.values[0], dies.value),)
    beside = [patterns_of(vary(found.scene, {swings.STIFFNESS: share * dies.value}))[1] for share in (0.99, 1.001)]
    assert averaged_pattern(beside[0]).amplitude < 0.15
    with pytest.raises(ComputationError, match="dies out"):
        averaged_pattern(beside[1])
    text = diagram_text(found)
    assert "disturbances begin to grow" in text
    assert all(f"{one.value:.9g}" in text for one in found.thresholds)
    rows = list(csv.DictReader(StringIO(diagram_csv(found))))
    assert {row["sector"] for row in rows} == set(NAMES)
    head = ["spring[0].stiffness_N_per_m", "omega_rad_per_s", "stable", "largest_angle_deg", "growth_per_s"]
    assert list(rows[0])[:5] == head
    assert {float(row["spring[0].stiffness_N_per_m"]) for row in rows} == {*in_phase.values, *antiphase.values}
    assert {row["stable"] for row in rows} == {"0", "1"}
    assert len(rows) == 3 * sum(len(one.values) for one in found.branches)
    assert all(abs(float(row["growth_per_s"]) - float(row["averaged_growth_per_s"])) < 0.02 for row in rows)


@pytest.mark.slow
def test_the_figure_has_the_thresholds() -> None:
    found = diagram("carts")
    figure = populations_figure(found)
    marks = [x for axis in figure.axes for line in axis.lines if line.get_marker() in "os" for x in line.get_xdata()]
    assert sorted(marks) == pytest.approx([one.value for one in found.thresholds])
    assert [axis.get_title(loc="left") for axis in figure.axes] == ["In phase", "Antiphase"]


# ------------------------------------------------------------------------------------------------------ what is refused


def test_what_has_no_symmetric_motions_says_why() -> None:
    scene = swings.two_swings(0.2, count=2)
    tied = scene.replace(
        spring=(*scene.spring, Spring(between=("pendulum[0].copies[0].links[0]", "ground"), stiffness=1.0))
    )
    assert list(unrepresented(tied)) == ["springs end at pendula"]
    third = Swing(name="third", mass=3.0, length=0.2, position=(4.0, 0.0))
    many = scene.replace(
        support=(*scene.supports, third), pendulum=(*scene.pendulum, scene.pendulum[0].replace(on="third"))
    )
    assert len(populations_of(many)) == 3
    with pytest.raises(ComputationError, match="one or two populations"):
        patterns_of(many)
    with pytest.raises(SceneError, match="two or more values"):
        follow_populations(scene, Variation(swings.STIFFNESS, (1.0,)))
    still = scene.undriven
    with pytest.raises(SceneError, match="nothing excites"):
        follow_populations(still, Variation(swings.STIFFNESS, (1.0, 2.0)))


def test_representatives_weigh_as_much_as_their_populations() -> None:
    scene = load("two-swings")
    few = representatives(scene)
    assert system_of(few).total_mass == pytest.approx(system_of(scene).total_mass)
    link, own = few.pendulum[0].links[0], scene.pendulum[0].links[0]
    assert link.drive is not None
    assert own.drive is not None
    assert link.drive.strength / link.mass == pytest.approx(own.drive.strength / own.mass)
    assert [one.count for one in representatives(swings.two_swings(0.2, count=1)).pendulum] == [1, 1]
