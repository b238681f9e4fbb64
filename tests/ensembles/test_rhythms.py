"""The map of rhythms: against equations written here, branches of orbits, and SciPy's intervals."""

from __future__ import annotations

import json
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import scipy

from modal.errors import SceneError
from modal.scene import load
from modal.scene.parameters import parse_variations, vary
from modal.types import Floats
from multipendula.cli import main
from nonlinear import simulate
from nonlinear.chaos import lyapunov_exponent
from nonlinear.chaos.lyapunov import Exponent
from nonlinear.ensembles import RhythmMap, ensemble, find_rhythm_grid, find_rhythms
from nonlinear.ensembles.endings import EndingGroup, Outcomes, _add_chaotic_groups, exponent_of, rhythm_starts
from nonlinear.ensembles.return_maps import is_orbit_of
from nonlinear.ensembles.rhythm_borders import continued
from nonlinear.ensembles.rhythm_maps import MapTask
from nonlinear.ensembles.rhythms import Rhythm, RhythmEvent, RhythmGrid, ValueRhythms, wilson
from nonlinear.ensembles.store import ChunkFolder
from nonlinear.orbits import follow_cycles, limit_cycles
from nonlinear.orbits.cycles import beginnings
from nonlinear.orbits.stable import stable_orbits
from nonlinear.postprocessing.returns import JUDGED_STROBES, _left_of, returns_of
from nonlinear.synchronization import (
    ending_of,
    ending_orbit,
    orbit_amplitudes,
    rhythm_name,
    study_synchronization,
)
from nonlinear.synchronization.attractors import Ending, _is_chimera
from nonlinear.system import Motion, State, motion_of

METRONOMES = load("metronomes")
LIGHT, HEAVY = 0.065, 0.1


@cache
def two_values() -> RhythmMap:
    """The map of two metronomes at two masses of the base."""
    return find_rhythms(METRONOMES, f"support.mass={LIGHT}:{HEAVY}:2", members=3, limit=206.0, seed=1)


def _rates(t: float, y: Floats, base: float) -> Floats:
    """Two metronomes on a base, from Newton's laws: x, θ₁, θ₂ and their rates."""
    m, c, inertia, g, strength, gamma = 0.025, 0.02, 1e-5, 9.81, 2e-5, np.radians(26.0)
    theta, v, omega = y[1:3], y[3], y[4:]
    torque = strength * (1 - (theta / gamma) ** 2) * omega - 1e-6 * omega
    moment = inertia + m * c**2
    M = np.array(
        [
            [base + 2 * m, *(m * c * np.cos(theta))],
            [m * c * np.cos(theta[0]), moment, 0],
            [m * c * np.cos(theta[1]), 0, moment],
        ]
    )
    force = np.array([m * c * np.sum(np.sin(theta) * omega**2) - 0.01 * v, *(torque - m * g * c * np.sin(theta))])
    return np.concatenate(([v], omega, np.linalg.solve(M, force)))


def test_starts_end_where_equations_written_here_end() -> None:
    """In phase both angles agree for ever, in the beat they never do for long."""
    starts = rhythm_starts(METRONOMES, 3, 52.0, 1)
    at = two_values().values[0]
    names = {r.branch: r.name for r in at.rhythms if r.branch is not None}
    times = np.linspace(50.0, 60.0, 200)
    for member, end in enumerate(at.of_start):
        y = np.concatenate(([0.0], starts.links[member], [0.0], starts.link_rates[member]))
        run = scipy.integrate.solve_ivp(_rates, (0, 60.0), y, "DOP853", times, args=(LIGHT,), rtol=1e-7, atol=1e-8)
        apart = np.abs(run.y[1] - run.y[2]).max()
        assert (apart < 1e-3) == (names.get(end) == "in phase"), (member, apart)
    assert {rhythm.name for rhythm in at.rhythms} == {"in phase", "beat"}


def test_shares_add_up_and_hold_their_orbits() -> None:
    """Every start is counted once; the orbit's period is that of the frequency that `orbits` finds."""
    branch = follow_cycles(METRONOMES, f"support.mass={LIGHT}:{HEAVY}:2")
    for value in two_values().values:
        assert sum(rhythm.count for rhythm in value.rhythms) + value.undecided == 3
        orbit = next(rhythm.orbit for rhythm in value.rhythms if rhythm.name == "in phase")
        assert orbit
        assert orbit.is_stable
        assert orbit.residual < 1e-9
        periods = [each.period for way in branch for each in way.orbits if np.isclose(each.value or 0, value.value)]
        assert np.abs(np.array(periods) / orbit.period - 1).min() < 1e-9


def test_births_are_those_of_the_branches_of_orbits() -> None:
    """Huygens' clocks in phase: born at a Neimark–Sacker point, dead at a branch point of the followed limit cycles."""
    scene, variation = load("huygens"), parse_variations(["support.mass=4:30:2log"])[0]
    branches = follow_cycles(scene, variation)
    values = {special.kind: special.orbit.value for branch in branches for special in branch.special}
    bounded = next(branch for branch in branches if "torus" in {special.kind for special in branch.special})
    point = next(orbit for orbit in bounded.orbits if orbit.is_stable)
    begun = next(beginnings(scene, variation, point.value or 0.0, (point.state, point.period), 1e-11))
    segment = stable_orbits(begun)
    assert segment.birth
    assert segment.death
    assert (segment.birth[0], segment.death[0]) == ("Neimark–Sacker", "branch point")
    assert segment.birth[1] == pytest.approx(values["torus"], rel=1e-6)
    higher = max(s.orbit.value or 0 for branch in branches for s in branch.special if s.kind == "branch point")
    assert segment.death[1] == pytest.approx(higher, rel=1e-6)


def _kicked(base: float, state: State, limits: Floats, duration: float) -> tuple[int, float]:
    """Huygens' clocks from a state of theirs, by Newton's laws: kicks of the second, its largest angle in the last 2 s.

    The first is kicked once on each side in turn; the run starts where it turns back on the right, the second between.
    """
    m, length, damping, impulse = 0.082, 0.14, 1.35e-4, 2.9e-5

    def accelerations(theta: Floats, torque: Floats, force: float) -> Floats:
        matrix = np.diag([base + 2 * m, *[m * length**2] * 2])
        matrix[0, 1:] = matrix[1:, 0] = m * length * np.cos(theta)
        return np.linalg.solve(matrix, [force, *torque])

    def rates(t: float, y: Floats) -> Floats:
        theta, rate = y[1:3], y[4:]
        torque = -m * 9.81 * length * np.sin(theta) - damping * rate
        force = m * length * np.sum(np.sin(theta) * rate**2) - 4.0 * y[3]
        return np.concatenate((y[3:], accelerations(theta, torque, force)))

    y = np.concatenate(([state.cart], state.links, [state.cart_rate], state.link_rates))
    sides, time, kicks, largest = np.array([-1.0, 1.0]), 0.0, 0, 0.0
    while time < duration:
        passes = [lambda t, y, k=k: sides[k] * y[1 + k] - limits[k] for k in (0, 1)]
        for event in passes:
            event.terminal, event.direction = True, 1.0
        run = scipy.integrate.solve_ivp(
            rates, (time, duration), y, "DOP853", None, True, passes, rtol=1e-10, atol=1e-12, max_step=0.02
        )
        if run.t[-1] > duration - 2.0:
            fine = np.linspace(max(time, duration - 2.0), run.t[-1], 2000)
            largest = max(largest, float(np.abs(run.sol(fine)[2]).max()))
        time, y = float(run.t[-1]), run.y[:, -1].copy()
        for k in (0, 1):
            if len(run.t_events[k]):
                y[3:] += accelerations(y[1:3], sides[k] * impulse * np.eye(2)[k], 0.0)
                sides[k], kicks = -sides[k], kicks + k
    return kicks, largest


def test_an_orbit_ends_where_a_clock_starts() -> None:
    """Of Huygens' clocks the second swings too little for kicks, to where it would reach its escapement's angle."""
    scene, limits = vary(load("huygens"), {"pendulum[1].links[0].drive.angle_deg": 2.2}), np.radians([3.0, 2.2])
    variation = parse_variations(["support.mass=14:18:2"])[0]
    start = State(np.array([0.115, 0.0]), np.array([0.0, 0.28]))
    (beginning,) = beginnings(scene, variation, 18.0, (start, 0.7524), 1e-12)
    branch = stable_orbits(beginning)
    assert branch.death is None
    assert branch.birth
    kind, value = branch.birth
    assert kind == "a clock stops"
    state = branch.orbits[0].state
    assert _kicked(value, state, np.array([limits[0], 1.0]), 20.0)[1] == pytest.approx(limits[1], rel=1e-6)
    assert _kicked(1.02 * value, state, limits, 20.0)[0] == 0
    assert _kicked(0.98 * value, state, limits, 20.0)[0] > 0


def test_a_stronger_neighbour_starts_a_clock() -> None:
    """As the impulse of the first grows, so that the second reaches its angle."""
    scene = vary(load("huygens"), {"pendulum[1].links[0].drive.angle_deg": 2.2, "support.mass": 16.0})
    variation = parse_variations(["pendulum[0].links[0].drive.impulse=2.9e-5:3.5e-5:2"])[0]
    start = State(np.array([0.103, -0.026]), np.array([0.0, -0.225]))
    (beginning,) = beginnings(scene, variation, 2.9e-5, (start, 0.7523), 1e-12)
    branch = stable_orbits(beginning)
    assert branch.death
    assert branch.death[0] == "a clock starts"
    assert branch.orbits[-1].amplitudes[1] == pytest.approx(np.radians(2.2), abs=1e-6)
    assert branch.orbits[-1].value == branch.death[1]


def test_the_death_of_a_beat_is_enclosed() -> None:
    """From its own last state the beat continues below that by the equations written here, and not above it."""
    (death,) = (event for event in two_values().births if event.name == "beat")
    assert death.between
    assert not death.is_birth
    assert death.between[1] - death.between[0] <= 1e-3 * (HEAVY - LIGHT) * (1 + 1e-9)
    beat = next(rhythm.state for rhythm in two_values().values[0].rhythms if rhythm.name == "beat")
    assert beat
    for base, lasts in ((death.between[0] - 1e-3, True), (death.between[1] + 1e-3, False)):
        y = np.concatenate(([0.0], beat.links, [beat.cart_rate], beat.link_rates))
        run = scipy.integrate.solve_ivp(
            _rates, (0, 80.0), y, "DOP853", np.linspace(70.0, 80.0, 200), args=(base,), rtol=1e-7, atol=1e-8
        )
        assert (np.abs(run.y[1] - run.y[2]).max() > 0.1) == lasts, base


BEATS = (("beat", 0.1), ("drifting", -0.1))
"""Names of two beats, and the angle (rad) at which each returns in fakes of runs."""


class FakeRuns:
    """A beat that lasts up to 0.3, if it begins from no further than a `reach` away; else runs are called otherwise."""

    def __init__(self, reach: float, otherwise: str) -> None:
        self.reach, self.otherwise, self.calls = reach, otherwise, 0

    def outcomes(self, values: list[float], rhythm: Rhythm, near: float) -> list[EndingGroup]:
        """The state holds the value at which it was."""
        self.calls += 1
        assert rhythm.state
        assert rhythm.state.cart == near
        names = ["beat" if v <= 0.3 and v - near <= self.reach else self.otherwise for v in values]
        states = [State(np.zeros(2), np.zeros(2), value) for value in values]
        endings = [Ending("torus", 1.0, np.zeros((0, 0)), state) for state in states]
        return [EndingGroup(name, (0,), ending) for name, ending in zip(names, endings, strict=True)]


@pytest.mark.parametrize("reach", [1.0, 0.04])
def test_a_rhythm_is_followed_to_where_it_ends(reach: float) -> None:
    """Also where only short steps keep it; a Neimark–Sacker point there is its end."""
    begun = Rhythm("beat", 3, 10, state=State(np.zeros(2), np.zeros(2), 0.0))
    values = [ValueRhythms(0.0, (begun,), 0), ValueRhythms(0.2, (), 0), ValueRhythms(1.0, (), 0)]
    runs = FakeRuns(reach, "in phase")
    complete, (death,) = continued(runs.outcomes, values, [])
    assert [[r.count for r in value.rhythms] for value in complete] == [[3], [0], []]
    assert death.between
    assert death.between[0] <= 0.3 < death.between[1] < death.between[0] + 1e-3
    assert runs.calls < 20
    _, (marked,) = continued(runs.outcomes, values, [("Neimark–Sacker", 0.3)])
    assert (marked.kind, marked.value, marked.between) == ("Neimark–Sacker", 0.3, None)
    _, (unknown,) = continued(FakeRuns(reach, "undecided").outcomes, values, [])
    assert unknown.kind == "undecided"


def test_a_rhythm_that_only_shortest_steps_keep_is_given_up() -> None:
    """Each round may last thousands of periods, so their number is limited, and the end is then undecided."""
    begun = Rhythm("beat", 3, 10, state=State(np.zeros(2), np.zeros(2), 0.0))
    runs = FakeRuns(0.002, "in phase")
    _, (death,) = continued(runs.outcomes, [ValueRhythms(0.0, (begun,), 0), ValueRhythms(1.0, (), 0)], [])
    assert (death.kind, runs.calls) == ("undecided", 20)


def test_what_is_beside_an_unstable_orbit_is_not_counted() -> None:
    """A start on Huygens' clocks in phase, at 30 kg, repeats to 1e-6 for long before it leaves."""
    scene, variation = load("huygens"), parse_variations(["support.mass=20:30:2"])[0]
    (orbit,) = (cycle for cycle in limit_cycles(vary(scene, {variation.path: 30.0})) if not cycle.is_stable)
    task = MapTask(scene, variation, motion_of([orbit.state]), 100.0, "auto")
    groups = task(30.0)
    assert groups[0].ending.kind == "periodic"
    assert [group.name for group in groups] == ["undecided"]
    assert not is_orbit_of(groups[0].ending, orbit)


def test_a_branch_has_one_name_and_small_basins_are_found() -> None:
    """Of two unequal swings phases and amplitudes change, the name does not; no start of six ends in phase."""
    rhythms = find_rhythms(load("huygens"), "support.mass=20:30:2", members=6, limit=800.0)
    assert {rhythm.name for value in rhythms.values for rhythm in value.rhythms} == {
        "at rest", "antiphase", "unequal amplitudes", "in phase"
    }  # fmt: skip
    apart = [np.abs(r.phases).max() for at in rhythms.values for r in at.rhythms if r.name == "unequal amplitudes"]
    assert abs(apart[0] - apart[1]) > 0.01
    (in_phase,) = (rhythm for rhythm in rhythms.values[0].rhythms if rhythm.name == "in phase")
    assert in_phase.record()["by_continuation"]
    assert in_phase.interval[1] == pytest.approx(scipy.stats.binomtest(0, 6).proportion_ci(method="wilson").high)
    death = next(event for event in rhythms.births if event.name == "in phase")
    assert death.value == pytest.approx(26.6813, abs=1e-3)
    assert "in phase: no start ended in it" in rhythms.report()


def test_more_motions_than_are_told_apart_at_once_stay_apart() -> None:
    """Of 45 periodic motions none is taken for another."""
    floquet = SimpleNamespace(others=np.array([0.5]))

    def orbit_of(ending: Ending) -> Any:
        size = float(ending.record[0, 0])
        return SimpleNamespace(orbit=SimpleNamespace(period=1.0, omega=2 * np.pi, amplitude=size, floquet=floquet))

    endings = {
        k: Ending("periodic", 1.0, np.full((50, 5), 0.01 * k), State(np.full(2, 0.01 * k), np.zeros(2)), 1)
        for k in range(45)
    }
    outcomes = Outcomes(METRONOMES, orbit_of)
    outcomes.add_round(endings)
    groups = outcomes.groups
    assert [group.members for group in groups] == [(k,) for k in range(45)]


def test_values_that_run_together_end_as_each_alone() -> None:
    """The beat on the light base from two of its states, half a slow period apart, in phase on the heavy one."""
    beat = next(rhythm for rhythm in two_values().values[0].rhythms if rhythm.name == "beat")
    variation = parse_variations([f"support.mass={LIGHT}:{HEAVY}:2"])[0]
    task = MapTask(METRONOMES, variation, rhythm_starts(METRONOMES, 1, 52.0), 206.0, "auto")
    together = task.outcomes([LIGHT, HEAVY], beat, LIGHT)
    assert beat.slow_period
    run = simulate(vary(METRONOMES, {"support.mass": LIGHT}), beat.slow_period, start=beat.state, output=3)
    alone = [replace(task, starts=run.motion.at(slice(k, k + 1)))(value)[0] for k, value in ((1, LIGHT), (2, HEAVY))]
    assert [group.name for group in together] == ["beat", "periodic"]
    for group, other in zip(together, alone, strict=True):
        assert (group.name, group.ending.returns) == (other.name, other.ending.returns)
        assert group.ending.period == pytest.approx(other.ending.period, rel=1e-6)


@pytest.mark.parametrize(("regular", "measurements"), [((), [8]), ((3,), [8, 20])])
def test_exponents_of_eight_stand_for_those_that_agree(regular: tuple[int, ...], measurements: list[int]) -> None:
    """If one of eight is regular, all twenty are measured."""
    state = State(np.zeros(2), np.zeros(2))
    state.links[0] = 1.0
    open_endings = {k: Ending("open", 1.0, np.zeros((JUDGED_STROBES, 4)), state, chimera=True) for k in range(20)}
    outcomes, sizes = Outcomes(METRONOMES, lambda ending: None, open_endings), list[int]()

    def measured(members: list[int]) -> Exponent:
        sizes.append(len(members))
        rates = np.array([0.0 if k in regular else 1.0 + 0.01 * k for k in members])
        return Exponent(METRONOMES, np.linspace(0.0, 150.0, 31), np.tile(5.0 * rates, (30, 1)), 50.0, np.nan)

    _add_chaotic_groups([outcomes], measured)
    (group,) = outcomes.groups
    assert sizes == measurements
    assert group.name == "chimera"
    assert group.members == tuple(k for k in range(20) if k not in regular)
    assert group.exponent
    mean = 1.0 + 0.01 * np.mean(group.members if regular else range(8))
    assert group.exponent[0] == pytest.approx(mean, rel=1e-12)


def test_a_chimera_runs_on_to_the_limit() -> None:
    """Equal pendula that move as one may meet the others later."""
    scene = METRONOMES.replace(pendulum=(METRONOMES.pendulum[0].replace(count=4),))
    ending = Ending("open", 1.0, np.zeros((0, 0)), State(np.ones(4), np.zeros(4)), chimera=True)
    assert Outcomes(scene, lambda ending: None).add_round({0: ending}) == [0]


def test_what_lines_leave_is_what_least_squares_leave() -> None:
    """Of noise, of lines, and of both."""
    times, random = np.arange(300), np.random.default_rng(3)
    phases = 2 * np.pi * 0.0837 * np.outer(times, np.arange(5))
    waves = np.hstack((np.cos(phases), np.sin(phases[:, 1:])))
    lines, noise = waves @ random.normal(size=(9, 6)), random.normal(size=(300, 6))
    for x in (noise, lines, lines + 0.01 * noise):
        residual = np.linalg.norm(x - waves @ np.linalg.lstsq(waves, x)[0])
        assert _left_of(x, times, 0.0837, 4) == pytest.approx(residual, rel=1e-9, abs=1e-6 * np.linalg.norm(x))


def test_exponents_by_second_motions_are_those_of_tangent_equations() -> None:
    """Of chaos within the intervals of both; of settled metronomes none."""
    scene = load("two-bobs")
    starts = [State(np.array([2.5, 2.0 + 0.1 * k]), np.zeros(2)) for k in range(6)]
    pairs = exponent_of(scene, motion_of(starts), 200.0, workers=1)
    tangent = lyapunov_exponent(scene, 200.0, starts=starts)
    assert abs(pairs.value - tangent.value) < pairs.half_width + tangent.half_width
    assert pairs.members[-1] == pytest.approx(tangent.members[-1], rel=0.2)
    settled = vary(METRONOMES, {"support.mass": HEAVY})
    assert np.abs(exponent_of(settled, rhythm_starts(settled, 2, 52.0), 100.0, workers=1).members).max() < 0.02


def test_exponents_of_short_runs_have_an_uncertainty() -> None:
    """Of 5 and of 100 natural units of time."""
    scene = load("two-bobs")
    starts = motion_of([State(np.array([2.5, 2.0 + 0.1 * k]), np.zeros(2)) for k in range(2)])
    for duration in (1.5, 7.0, 30.0):
        short = exponent_of(scene, starts, duration, workers=1)
        assert short.duration == pytest.approx(duration, rel=1e-9)
        assert np.isfinite(short.half_width)


def test_wilson_is_that_of_scipy() -> None:
    """At the ends and between them."""
    for count, total in ((0, 7), (3, 7), (300, 300), (17, 300)):
        interval = scipy.stats.binomtest(count, total).proportion_ci(0.95, "wilson")
        assert wilson(count, total) == pytest.approx((interval.low, interval.high), abs=1e-12)


def test_returns_of_a_run_are_the_crossings_of_an_ensemble() -> None:
    """Between samples as the integrator finds them."""
    start = State(np.array([0.6, 0.2]), np.zeros(2))
    returns = returns_of(simulate(METRONOMES, 10.0, start=start))
    crossed = ensemble(METRONOMES, 10.0, starts=[start], measures=["section:theta[1,1]>0"], check=0, workers=1)
    assert returns.times == pytest.approx(crossed.column("crossing_time_s"), abs=1e-6)
    assert np.abs(returns.states[1] - crossed.states("crossing_")[1]).max() < 1e-4


def test_a_settled_run_has_its_orbit_and_a_short_one_is_open() -> None:
    """The verdict of one run."""
    scene = vary(METRONOMES, {"support.mass": 0.1})
    run = simulate(scene, 150.0)
    ending = ending_of(returns_of(run), scene)
    orbit = ending_orbit(scene, ending)
    assert ending.kind == "periodic"
    assert orbit
    assert rhythm_name(orbit_amplitudes(orbit)) == "in phase"
    assert ending_of(returns_of(simulate(scene, 10.0)), scene).name == "open"


def test_some_equal_pendula_as_one_and_others_not_are_a_chimera() -> None:
    """Of four, two and two; not of two pairs."""
    pendulum = METRONOMES.pendulum[0]
    scene = METRONOMES.replace(pendulum=(pendulum.replace(count=4),))
    record = np.random.default_rng(2).normal(size=(50, 9))
    record[:, [1, 5]] = record[:, [0, 4]]
    assert _is_chimera(record, scene)
    record[:, [3, 7]] = record[:, [2, 6]]
    assert not _is_chimera(record, scene)
    assert Ending("open", 1.0, record, State(np.zeros(4), np.zeros(4)), chimera=True).name == "chimera"


def test_a_folder_goes_on_where_a_call_was_killed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """No run and no branch is computed again; another question or format is refused."""
    folder, number = tmp_path / "kept", "support.mass=0.1:0.12:2"
    question = {"members": 2, "limit": 120.0, "folder": str(folder)}
    first = find_rhythms(METRONOMES, number, **question)
    assert {path.name.split("-")[1] for path in folder.glob("part-*")} == {"run", "averaged", "branch"}
    for name in ("settle", "stable_orbits", "beginnings"):
        monkeypatch.setattr(f"nonlinear.ensembles.rhythm_maps.{name}", lambda *_, **__: pytest.fail("computed again"))
    assert find_rhythms(METRONOMES, number, **question).report("json") == first.report("json")
    with pytest.raises(ValueError, match="holds another map"):
        find_rhythms(METRONOMES, number, **question | {"members": 3})
    header = json.loads((folder / "map.json").read_text())
    (folder / "map.json").write_text(json.dumps({name: header[name] for name in header if name != "format"}))
    with pytest.raises(ValueError, match="holds a map of another version"):
        find_rhythms(METRONOMES, number, **question)


def test_continuations_are_stored_and_shared_among_a_crew(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Two beats that last up to 0.32 and down to 0.15: no run of theirs is repeated, and a crew ends at the same."""
    calls = []

    def settle(outcomes: list[Outcomes], place: object, limit: float, members: dict[str, Motion], **_: object) -> None:
        for each, state in zip(outcomes, members["starts"], strict=True):
            mass = each.scene.support.mass
            calls.append(mass)
            name = "beat" if state.links[0] > 0 else "drifting"
            lasts = mass <= 0.32 if name == "beat" else mass >= 0.15
            ending = Ending("torus", 1.0, np.zeros((0, 0)), state, drifting=name != "beat")
            each.groups.append(EndingGroup(name if lasts else "in phase", (0,), ending))

    def simulate(scene: object, span: float, *, start: State, output: int) -> SimpleNamespace:
        return SimpleNamespace(motion=motion_of([start] * output))

    monkeypatch.setattr("nonlinear.ensembles.rhythm_maps.settle", settle)
    monkeypatch.setattr("nonlinear.ensembles.rhythm_maps.simulate", simulate)
    variation = parse_variations(["support.mass=0.1:0.4:4"])[0]
    beat, drift = (Rhythm(name, 3, 10, state=State(np.full(2, side), np.zeros(2))) for name, side in BEATS)
    values = [ValueRhythms(value, (), 0) for value in variation.values]
    values[0], values[3] = values[0]._replace(rhythms=(beat,)), values[3]._replace(rhythms=(drift,))
    chunks = ChunkFolder(tmp_path, "map", "a question", {})
    task = MapTask(METRONOMES, variation, motion_of([beat.state]), 100.0, "auto", chunks)
    complete, events = continued(task.outcomes, values, [])
    assert [[rhythm.name for rhythm in value.rhythms] for value in complete] == [
        ["beat"], ["beat", "drifting"], ["beat", "drifting"], ["drifting"]
    ]  # fmt: skip
    assert sorted(event.value for event in events) == pytest.approx([0.15, 0.32], abs=1e-4)
    count, anew = len(calls), replace(task, folder=None)
    again, ends = continued(task.outcomes, values, [])
    assert len(calls) == count
    with ThreadPoolExecutor(2) as crew:
        together, ends_together = continued(anew.outcomes, values, [], crew)
    assert len(calls) >= 2 * count
    for others, events_of_others in ((again, ends), (together, ends_together)):
        assert [event.record() for event in events_of_others] == [event.record() for event in events]
        assert [value.counts() for value in others] == [value.counts() for value in complete]


def test_the_command_maps_and_refuses(capsys: pytest.CaptureFixture[str]) -> None:
    """JSON has the keys that its readers know; what does not fit is named."""
    call = ["sync", "metronomes", "--vary", "support.mass=0.1:0.12:2", "--map", "--members", "2", "--duration", "120"]
    assert main([*call, "--format", "json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert {"values", "births", "members"} <= told.keys()
    assert {"name", "share", "interval", "orbit"} <= told["values"][0]["rhythms"][0].keys()
    assert told["values"][0]["undecided"] == 0
    assert main(["sync", "metronomes", "--map"]) == 2
    assert "--map: needs --vary" in capsys.readouterr().err
    assert main(["sync", "metronomes", "--members", "3"]) == 2
    assert "--members: needs --map" in capsys.readouterr().err


def test_two_numbers_are_a_grid_of_verdicts() -> None:
    """A row for each value of the second number."""
    axes = parse_variations(["support.mass=0.1:0.12:2", "support.damping=0.01:0.02:2"])
    grid = find_rhythm_grid(METRONOMES, axes, members=2, limit=120.0)
    whole = grid.whole()
    assert [row["value"] for row in whole["rows"]] == [0.01, 0.02]
    assert {at.rhythms[0].name for row in grid.maps for at in row.values} == {"in phase"}
    assert "in phase 100" in grid.report()
    assert "2 starts, the same at every value" in grid.report()
    assert grid.plot().axes
    with pytest.raises(SceneError, match="the starts of a map are drawn at random"):
        find_rhythms(METRONOMES, "pendulum[0].start.angles_deg[0]=3:4:2")
    with pytest.raises(SceneError, match="mass: is varied twice"):
        find_rhythm_grid(METRONOMES, (axes[0], axes[0]))


def test_a_minority_is_not_the_most_frequent() -> None:
    """Undecided starts are named where they are most, and every cell is divided; the interval of 3 of 10 is uneven."""
    variation, second = parse_variations(["support.mass=0.1:0.12:2", "support.damping=0.01:0.02:2"])
    value = ValueRhythms(0.1, (Rhythm("in phase", 3, 10),), 7)
    row = RhythmMap(METRONOMES, variation, (value, value), (), 10, 52.0, 100.0, 7)
    grid = RhythmGrid(METRONOMES, (variation, second), (row, row))
    text, bars = grid.report(), grid.plot().axes[0].patches
    assert "undecided 70 (in phase 30)" in text
    tie = value._replace(rhythms=(Rhythm("in phase", 3, 10), Rhythm("antiphase", 3, 10)), undecided=4)
    evenly = replace(row, values=(tie, tie))
    text_of_ties = RhythmGrid(METRONOMES, (variation, second), (evenly, evenly)).report()
    assert "undecided 40 (in phase 30, antiphase 30)" in text_of_ties
    beat = RhythmEvent("beat", False, "enclosed", 0.11, (0.109, 0.111), "in phase")
    assert row.event_words(beat) == "beat ends between 0.109 kg and 0.111 kg: beyond that the motion becomes in phase."
    heights = sorted(bar.get_height() for bar in bars)
    assert heights == pytest.approx([0.3 * 0.005] * 4 + [0.7 * 0.005] * 4)
    _, high = scipy.stats.binomtest(3, 10).proportion_ci(method="wilson")
    assert f"at most {100 * (high - 0.3):.2g} percentage points" in text


def test_borders_are_joined_by_pattern_and_nearness() -> None:
    """A fold that begins below two others takes the first number in its row, and neither of their lines."""
    variation, second = parse_variations(["support.mass=0.05:0.2:2", "support.damping=0.01:0.02:2"])
    rows = []
    for places in ([0.08, 0.11], [0.05, 0.082, 0.112]):
        births = [RhythmEvent(f"in phase, branch {k}", True, "fold", at) for k, at in enumerate(places, start=1)]
        row = RhythmMap(METRONOMES, variation, (), tuple(births), 10, 52.0, 100.0, 7)
        rows.append(row.by_pattern())
    lines = RhythmGrid(METRONOMES, (variation, second), tuple(rows)).borders()
    assert lines == {
        ("in phase", "fold", True): [[(0.08, 0.01), (0.082, 0.02)], [(0.11, 0.01), (0.112, 0.02)], [(0.05, 0.02)]]
    }


def test_a_map_without_averaged_thresholds_says_why() -> None:
    """Dry friction under the cart, as `sync` says of one run."""
    variation, rubbing = parse_variations(["support.mass=0.05:0.2:2"])[0], vary(METRONOMES, {"support.friction": 0.001})
    words = RhythmMap(rubbing, variation, (), (), 1, 52.0, 1.0, 7).report("text")
    reason = "support.friction = 0.001: {} cannot tell when a cart sticks"
    assert f"No averaged thresholds: {reason.format('a branch of configurations')}" in " ".join(words.split())
    assert study_synchronization(rubbing, 1.0).silent.startswith(reason.format("a prediction of synchronization"))


def test_explain_points_to_the_map_where_drives_act(capsys: pytest.CaptureFixture[str]) -> None:
    """Not of a scene that nothing excites."""
    for scene, is_driven in (("metronomes", True), ("paper-cart-2", False)):
        main(["explain", scene])
        pointer = f"sync {scene} --vary NUMBER=FIRST:LAST:COUNT --map"
        assert (pointer in " ".join(capsys.readouterr().out.split())) == is_driven
