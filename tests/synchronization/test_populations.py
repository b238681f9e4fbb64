"""Populations of equal pendula on structures: thresholds by equations of their own, sectors against whole scenes."""

from __future__ import annotations

import csv
import json
from functools import cache
from io import StringIO

import numpy as np
import pytest
import swings
from amounts import usually
from structured_scenes import STRUCTURED
from structures import Oracle

from modal import Bob, Pendulum, Scene, load
from modal.errors import ComputationError, SceneError
from modal.scene import Spring
from modal.scene.parameters import Variation, vary
from modal.scene.supports import Swing, Tilt
from modal.types import Floats
from nonlinear.averaging import OWN, averaged_pattern, patterns_of
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
from nonlinear.synchronization.population_report import diagram_json
from nonlinear.synchronization.study import study_synchronization
from nonlinear.system import State, initial_state, populations_of, representation_obstacles, representatives, system_of

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


def orbit_at(diagram: PopulationDiagram, motion: str, sector: str) -> tuple[float, PatternOrbit]:
    """The value of a threshold and the orbit there."""
    threshold = next(
        threshold for threshold in diagram.thresholds if (threshold.pattern, threshold.sector) == (motion, sector)
    )
    branch = next(branch for branch in diagram.branches if branch.name == motion)
    orbit = branch.motions[branch.values.tolist().index(threshold.value)].orbit
    assert orbit is not None
    return threshold.value, orbit


@pytest.mark.parametrize("kind", usually(["swings"], list(swings.TOLD)))
def test_thresholds_are_those_of_other_equations(kind: str) -> None:
    populations = diagram(kind)
    for (motion, sector), told in swings.TOLD[kind].items():
        value, orbit = orbit_at(populations, motion, sector)
        assert value / swings.UNIT == pytest.approx(told, abs=6e-10)
        rates = swings.own_growth(value / swings.UNIT, kind, motion, orbit)
        assert [rates[name] for name in NAMES] == pytest.approx(orbit.growth, abs=1e-9)
        assert rates[sector] == pytest.approx(0.0, abs=1e-10)


def test_the_averaged_equations_find_the_same_thresholds_to_their_accuracy() -> None:
    for threshold in diagram("swings").thresholds:
        assert threshold.averaged is not None
        assert threshold.averaged == pytest.approx(threshold.value, rel=3e-3)
    in_phase = next(threshold for threshold in diagram("swings").thresholds if threshold.pattern == "in phase")
    assert in_phase.averaged == pytest.approx(in_phase.value, rel=1e-5)


def test_a_population_breaks_up_where_half_of_its_energy_is_drained() -> None:
    populations = diagram("swings")
    threshold = next(threshold for threshold in populations.thresholds if threshold.sector == NAMES[2])
    assert threshold.becomes == "loses stability"
    assert threshold.beat == pytest.approx(0.201, abs=1e-3)
    assert "the trace of the within-block vanishes" in threshold.reason
    orbit = orbit_at(populations, "antiphase", NAMES[2])[1]
    scene = orbit.pattern.scene
    free = free_amplitude(scene, orbit.pattern.populations[0].pendulum)
    assert free == pytest.approx(2 * swings.LIMIT, rel=3e-3)
    assert orbit.amplitudes[0] / free == pytest.approx(0.5**0.5, rel=5e-3)
    assert abs(np.linalg.det(orbit.maps[2])) == pytest.approx(1.0, abs=1e-10)
    averaged = averaged_pattern(patterns_of(vary(scene, {swings.STIFFNESS: threshold.averaged}))[1])
    assert np.trace(averaged.blocks[2]) == pytest.approx(0.0, abs=1e-8)
    assert averaged.amplitude / (2 * swings.LIMIT) == pytest.approx(0.5**0.5, rel=5e-3)


def test_beyond_resonance_the_determinant_breaks_a_population_up() -> None:
    (_, motion) = symmetric_motions(swings.two_swings(0.5, count=2))
    assert motion.orbit is not None
    assert motion.averaged is not None
    assert motion.reason(2) == "the determinant of its within-block is negative"
    assert np.linalg.det(motion.averaged.blocks[2]) < 0
    first, second = motion.orbit.multipliers[2].real
    assert first > 1 > second > 0


def test_antiphase_emerges_from_rest_a_second_time_beyond_resonance() -> None:
    """There the swings follow their spring, not their weight."""
    populations = swings.diagram("swings", (0.22, 0.3, 0.5))
    (_, antiphase) = populations.branches
    (_, dies), (emerges, end) = populations.windows(antiphase)
    assert dies / swings.UNIT == pytest.approx(0.25004, abs=1e-4)
    assert 0.3 * swings.UNIT < emerges < end == populations.variation.values[-1]
    assert populations.intervals(antiphase) == ()


def whole_map(scene: Scene, orbit: PatternOrbit) -> Floats:
    """The monodromy matrix of all pendula on the motion of their representatives, in natural units."""
    flow, few = Flow(system_of(scene), 1e-12), orbit.orbit.y.reshape(2, -1)
    first = flow.system.first
    rows, p = [few[:, :first]], 0
    for population in orbit.pattern.populations:
        rows.append(np.repeat(few[:, first + p : first + p + 1], population.size, axis=1))
        p += population.halves
    y = np.hstack(rows).ravel()
    end = flow(y, np.diag(flow.scale), orbit.orbit.period)
    assert end.y == pytest.approx(y, abs=1e-9)
    return end.V / flow.scale[:, None]


def times_of(orbit: PatternOrbit) -> list[int]:
    """How often the multipliers of every sector are among those of the whole scene."""
    if orbit.pattern.sectors[0].name == OWN:
        return [1, 1, sum(population.size - 1 for population in orbit.pattern.populations)]
    return [1, *(population.size - 1 for population in orbit.pattern.populations if population.size > 1)]


@pytest.mark.parametrize(("scene", "number"), [(swings.two_swings(0.19, count=3), 1), (unequal(), 0)])
def test_sectors_have_all_the_multipliers_of_the_whole_scene(scene: Scene, number: int) -> None:
    orbit = pattern_orbit(patterns_of(scene)[number])
    several = [np.tile(multiplier, n) for multiplier, n in zip(orbit.multipliers, times_of(orbit), strict=True)]
    expected, every = np.concatenate([*several, [1.0]]), np.linalg.eigvals(whole_map(scene, orbit))
    assert len(expected) == len(every)
    for multiplier in expected:
        at = np.abs(every - multiplier).argmin()
        assert every[at] == pytest.approx(multiplier, abs=1e-7)
        every = np.delete(every, at)


def test_unequal_populations_have_one_common_sector() -> None:
    (motion, _) = patterns_of(unequal())
    assert [sector.name for sector in motion.sectors] == ["common", "within population 1", "within population 2"]
    exact, averaged = pattern_orbit(motion), averaged_pattern(motion)
    assert averaged.growth == pytest.approx(exact.growth, rel=0.05, abs=2e-3)
    assert averaged.omega == pytest.approx(exact.orbit.omega, rel=1e-4)


@pytest.mark.parametrize("number", [0, 1])
def test_limit_cycles_of_two_clocks_on_swings_are_the_patterns(number: int) -> None:
    """By multiple shooting on the scene itself, all disturbances together."""
    scene = swings.two_swings(0.19, count=1)
    orbit = pattern_orbit(patterns_of(scene)[number])
    cycle = periodic_orbit(scene, orbit.orbit.state, 1.0001 * orbit.orbit.period)
    assert cycle.omega == pytest.approx(orbit.orbit.omega, rel=1e-10)
    assert len(orbit.multipliers) == 2
    assert np.abs(cycle.floquet.others).max() == pytest.approx(
        np.abs(np.concatenate(orbit.multipliers)).max(), abs=1e-8
    )


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
    phases = population_phases(phases_of(run))
    assert phases is not None
    return phases


@pytest.mark.parametrize(("ahead", "kind"), [(0.0, "in phase"), (180.0, "antiphase"), (-40.0, "locked")])
def test_verdicts_of_locked_populations(ahead: float, kind: str) -> None:
    phases = told(started(0.02, ahead))
    assert phases.kind == kind
    assert phases.late_order == pytest.approx([1.0, 1.0])
    assert phases.rate == pytest.approx([phases.rate[0]] * 2, rel=1e-3)
    assert np.cos(phases.phase[1]) == pytest.approx(np.cos(np.radians(ahead)), abs=0.15)
    assert phases.verdict == kind or phases.verdict.startswith("locked at -")


def test_chimera_and_neither() -> None:
    scene = swings.two_swings(0.22, count=4)
    phases = told(simulate(scene, 20.0, tolerance=1e-7))
    assert (phases.kind, phases.verdict) == ("a chimera", "population 1 locked, 2 not: a chimera")
    assert phases.late_order[0] == pytest.approx(1.0)
    assert phases.spread[0] < 1e-9 < phases.spread[1]
    loose = scene.replace(
        pendulum=tuple(pendulum.replace(start=scene.pendulum[1].start) for pendulum in scene.pendulum)
    )
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
    phases = told(simulate(scene, 8.0, tolerance=1e-7))
    assert [population.size for population in phases.populations] == [2]
    assert (phases.kind, phases.verdict) == ("antiphase", "antiphase")
    assert list(representation_obstacles(scene)) == ["the pendula of tilt hang from points that move differently"]
    with pytest.raises(ComputationError, match="points that move differently"):
        patterns_of(scene)


def test_reports_have_the_verdict_first() -> None:
    scene = swings.two_swings(0.22, count=5)
    study = study_synchronization(scene, 8.0)
    text, record = sync_text(study), sync_record(study)
    assert "\n\nPopulation 1 locked, 2 not: a chimera.\n" in text
    assert "the trace of its within-block is positive, drained to 0.598" in text
    assert "10 pendula on a structure" in text
    assert record["verdict"] == "a chimera"
    assert [population["support"] for population in record["populations"]] == ["left", "right"]
    assert record["populations"][0]["order_parameter"] == pytest.approx(1.0)
    exact = {motion.pattern.name: motion.orbit for motion in study.motions}
    for entry in record["symmetric_motions"]:
        motion = exact[entry["motion"]]
        assert motion is not None
        assert list(entry["growth_per_s"]) == list(NAMES)
        assert list(entry["growth_per_s"].values()) == pytest.approx(motion.growth)
        assert entry["stable"] is False


# ---------------------------------------------------------------------------------------------------- the diagram


def test_the_diagram_tells_intervals_thresholds_and_reasons() -> None:
    populations = diagram("swings")
    in_phase, antiphase = populations.branches
    assert populations.intervals(in_phase) == (
        (pytest.approx(0.268870566 * swings.UNIT), populations.variation.values[-1]),
    )
    assert populations.intervals(antiphase)[0][1] == pytest.approx(0.203742614 * swings.UNIT)
    dies = next(threshold for threshold in populations.thresholds if not threshold.sector)
    assert (dies.pattern, dies.becomes) == ("antiphase", "dies out")
    assert populations.windows(antiphase) == ((populations.variation.values[0], dies.value),)
    beside = [
        patterns_of(vary(populations.scene, {swings.STIFFNESS: share * dies.value}))[1] for share in (0.99, 1.001)
    ]
    assert averaged_pattern(beside[0]).amplitude < 0.15
    with pytest.raises(ComputationError, match="dies out"):
        averaged_pattern(beside[1])
    text = diagram_text(populations)
    assert "perturbations begin to grow" in text
    assert all(f"{threshold.value:.9g}" in text for threshold in populations.thresholds)
    rows = list(csv.DictReader(StringIO(diagram_csv(populations))))
    record = json.loads(diagram_json(populations))
    assert [row["sector"] for row in record["rows"]] == [row["sector"] for row in rows]
    assert [each["exact"] for each in record["thresholds"]] == [each.value for each in populations.thresholds]
    assert {row["sector"] for row in rows} == set(NAMES)
    head = ["spring[0].stiffness_N_per_m", "omega_rad_per_s", "stable", "largest_angle_deg", "growth_per_s"]
    assert list(rows[0])[:5] == head
    assert {float(row["spring[0].stiffness_N_per_m"]) for row in rows} == {*in_phase.values, *antiphase.values}
    assert {row["stable"] for row in rows} == {"0", "1"}
    assert len(rows) == 3 * sum(len(branch.values) for branch in populations.branches)
    assert all(abs(float(row["growth_per_s"]) - float(row["averaged_growth_per_s"])) < 0.02 for row in rows)


def test_the_figure_has_the_thresholds() -> None:
    populations = diagram("swings")
    figure = populations_figure(populations)
    marks = [x for axis in figure.axes for line in axis.lines if line.get_marker() in "os" for x in line.get_xdata()]
    assert sorted(marks) == pytest.approx([threshold.value for threshold in populations.thresholds])
    assert [axis.get_title(loc="left") for axis in figure.axes] == ["In phase", "Antiphase"]


# ------------------------------------------------------------------------------------------------------ what is refused


def test_what_has_no_symmetric_motions_says_why() -> None:
    scene = swings.two_swings(0.2, count=2)
    tied = scene.replace(
        spring=(*scene.spring, Spring(between=("pendulum[0].copies[0].links[0]", "ground"), stiffness=1.0))
    )
    assert list(representation_obstacles(tied)) == ["springs end at pendula"]
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
    with pytest.raises(SceneError, match="nothing drives"):
        follow_populations(still, Variation(swings.STIFFNESS, (1.0, 2.0)))


def test_representatives_weigh_as_much_as_their_populations() -> None:
    scene = load("two-swings")
    few = representatives(scene)
    assert system_of(few).total_mass == pytest.approx(system_of(scene).total_mass)
    link, original = few.pendulum[0].links[0], scene.pendulum[0].links[0]
    assert link.drive is not None
    assert original.drive is not None
    assert link.drive.strength / link.mass == pytest.approx(original.drive.strength / original.mass)
    assert [pendulum.count for pendulum in representatives(swings.two_swings(0.2, count=1)).pendulum] == [1, 1]


def on_two_carts(springs: tuple[Spring, ...]) -> Scene:
    """Two and two equal van der Pol pendula on two carts, the second two a little longer."""

    def pair(on: str, length: float, angle: float) -> Pendulum:
        drive = {"kind": "van-der-pol", "strength": 2e-4, "angle_deg": 15.0}
        link = {"kind": "bob", "mass": 0.1, "length": length, "damping": 2e-5, "drive": drive}
        return Pendulum(links=[link], count=2, on=on, start={"angles_deg": [angle]})

    carts = [{"kind": "cart", "name": name, "mass": 1.0, "damping": 0.02} for name in "ab"]
    return Scene(gravity=9.81, support=carts, spring=springs, pendulum=[pair("a", 0.1, 15.0), pair("b", 0.1001, -9.0)])


def test_populations_lock_only_where_something_joins_them_and_a_phase_is_told_only_then() -> None:
    apart = population_phases(phases_of(simulate(on_two_carts(()), 60.0, tolerance=1e-6)))
    sprung = on_two_carts((Spring(between=["a", "b"], stiffness=5.0),))
    joined = population_phases(phases_of(simulate(sprung, 2.0, tolerance=1e-6)))
    assert apart
    assert joined
    assert apart.locked.all()
    assert apart.is_even
    assert (apart.is_coupled, apart.kind, apart.is_held) == (False, "neither", False)
    assert joined.is_coupled


@pytest.mark.parametrize("seed", range(3))
def test_equal_pendula_bear_equal_springs(seed: int) -> None:
    """The sizes of populations against what the springs say: none, one of two, both alike, between the two."""
    stiffness = float(np.random.default_rng(seed).uniform(0.1, 5.0))

    def sizes(*ends: tuple[str, str]) -> list[int]:
        springs = tuple(Spring(between=list(pair), stiffness=stiffness) for pair in (("a", "b"), *ends))
        return [population.size for population in populations_of(on_two_carts(springs))]

    assert sizes() == [2, 2]
    assert sizes(("ground", "pendulum[0].copies[0].links[0]")) == [1, 1, 2]
    assert sizes(("ground", "pendulum[0].links[0]")) == [2, 2]
    assert sizes(("pendulum[0].copies[0].links[0]", "pendulum[0].copies[1].links[0]")) == [2, 2]
    assert sizes(("pendulum[0].copies[0].links[0]", "pendulum[1].copies[1].links[0]")) == [1, 1, 1, 1]


def test_two_values_show_what_many_do() -> None:
    """Antiphase dies out between 55 and 85 N/m, after two thresholds: ends of the range alone would miss these."""
    few, many = (follow_populations(load("two-swings"), f"spring[0].stiffness=55:85:{count}") for count in (2, 13))
    assert len(few.thresholds) == 4
    for threshold, other in zip(few.thresholds, many.thresholds, strict=True):
        assert (threshold.pattern, threshold.sector) == (other.pattern, other.sector)
        assert threshold.value == pytest.approx(other.value, rel=1e-8)
