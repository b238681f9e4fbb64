"""The plain route: one member by `simulate`, for scenes that no engine takes side by side."""

from __future__ import annotations

from typing import Any

import numpy as np

from modal.errors import SceneError
from modal.scene import Scene
from modal.scene.doors import require_type
from modal.types import Floats
from nonlinear.ensembles.measures import (
    COLUMNS,
    ENDS,
    Columns,
    Context,
    ending_times,
    energy_columns,
    places,
    validate_measures,
)
from nonlinear.ensembles.question import EnsembleRequest
from nonlinear.ensembles.results import MemberResults, Passing, Wanted
from nonlinear.integration import Trajectory
from nonlinear.integration.passages import Level, Passages, counted, level_of, starts_of
from nonlinear.integration.readiness import reproducible
from nonlinear.postprocessing import largest_angle
from nonlinear.simulation import simulate
from nonlinear.system import Event, Layout, Motion, State, numbers_of

STATES = {
    "links": "links_rad",
    "link_rates": "link_rates_rad_per_s",
    "cart": "cart_m",
    "cart_rate": "cart_rate_m_per_s",
}
"""The parts of a state as columns."""
CARRIED = {"supports": "supports", "support_rates": "support_rates_per_s"}
"""And those of a structure, (…, d) in m or rad, named as `System.labels` begins."""
TURNS, SECTION = "over the top", "section"


def validate_plain(measures: tuple[str, ...]) -> None:
    """SceneError for measures that runs one by one cannot have."""
    if "lyapunov" in measures:
        raise SceneError(["lyapunov: needs members side by side in the plane"])


def state_columns(is_structured: bool) -> dict[str, str]:
    """The parts of the states of a scene as columns."""
    return STATES | CARRIED if is_structured else STATES


@reproducible()
def columns(question: EnsembleRequest, scene: Scene, start: State) -> Columns:
    """What is asked for of one member, each of shape (...); SimulationError where it cannot reach its end."""
    times = question.wanted.times
    needed = sorted({0.0, *times, question.duration})
    output: Any = None if question.wanted.largest else needed
    events = _events(question, scene)
    run = simulate(scene, question.duration, start=start, tolerance=question.tolerance, output=output, events=events)
    if run.run.interrupted:
        raise KeyboardInterrupt
    sampled = run
    if output is None and times:
        sampled = simulate(scene, question.duration, start=start, tolerance=question.tolerance, output=needed)
    kept: Columns = {
        "energy_drift": np.array(run.energy_drift()),
        "error_rad": np.array(np.nan),
        "horizon_s": np.array(np.nan),
    }
    kept |= _measured(question, scene, run, sampled)
    rows = np.searchsorted(sampled.times, question.times)
    if question.keeps_end:
        kept |= _states(run.motion.at(slice(-1, None)), single=True)
    if question.times:
        kept |= _states(sampled.motion.at(rows), single=False)
    return kept


def _states(motion: Motion, single: bool) -> Columns:
    parts = {column: getattr(motion, part) for part, column in state_columns(motion.supports.size > 0).items()}
    return {name: values[0] if single else values for name, values in parts.items()}


def _measured(question: EnsembleRequest, scene: Scene, run: Trajectory, sampled: Trajectory) -> Columns:
    measured: Columns = {}
    names = question.measures.names
    if run.system.spatial:
        return _in_space(question, run, sampled)
    layout = Layout.of(run.system, works=run.system.works)
    rows = _rows(layout, sampled)
    ending = rows[np.searchsorted(sampled.times, question.ending)][None] if question.ending else rows[None, :0]
    whole = MemberResults(rows[-1:].T, np.full(1, np.nan), np.full(1, np.nan))
    if "first_turn" in names:
        whole.first_turns = np.array([[passages.time.min(initial=np.inf)] for passages in _turns(run, layout)])
    if "largest_angle" in names:
        whole.largest = np.array([largest_angle(run)])
    context = Context(scene, run.system, numbers_of(scene), layout, rows[:1].T, question.wanted)
    for measure in names:
        measured |= {name: values[0] for name, values in COLUMNS[measure](context, whole, ending).items()}
    if question.measures.section:
        measured |= _crossings(run, question.measures.section, layout)
    return measured


def _turns(run: Trajectory, layout: Layout) -> list[Passages]:
    """What goes over the top, of each link."""
    first = layout.first
    tops = [Level(first + link, np.pi, turns=True) for link in range(layout.links)]
    return [_counted(run, f"{TURNS} {place}", top, layout) for place, top in zip(places(run.system), tops, strict=True)]


def _counted(run: Trajectory, name: str, level: Level, layout: Layout, direction: int = 0) -> Passages:
    """The events of this name that count as passages of a level."""
    events = [event for event in run.happenings if event.name == name]
    rows = np.array([layout.begin(event.state) for event in events]).reshape(len(events), layout.size)
    time, way = np.array([event.time for event in events]), np.sign(rows[:, layout.half + level.row])
    none, begun = np.zeros(len(events), dtype=np.int64), layout.begin(run.motion[0])[:, None]
    passages = Passages(none, time, rows, level.number(rows[:, level.row]), way)
    return counted(passages, starts_of(level, layout, begun, 0.0 * begun), begun, direction)


def _in_space(question: EnsembleRequest, run: Trajectory, sampled: Trajectory) -> Columns:
    measured: Columns = {}
    if "largest_angle" in question.measures.names:
        measured["largest_angle_deg"] = np.array(np.degrees(largest_angle(run)))
    if "pendulum_energy" in question.measures.names:
        measured |= _energies(sampled.at(np.searchsorted(sampled.times, question.ending)))
    return measured


def _energies(run: Trajectory) -> Columns:
    """Mean energies over the samples of a run."""
    mechanics = run.mechanics
    pendula = mechanics.of_pendula(mechanics.kinetic + mechanics.potential).mean(0)
    carried = np.mean(mechanics.cart_kinetic + mechanics.cart_potential)
    return energy_columns(run.system, pendula, np.asarray(carried))


def measured_run(run: Trajectory, name: str) -> dict[str, float]:
    """A measure that is read off the last tenth of a run from t = 0 at `times_of` it, as an ensemble reads it."""
    require_type("run", run, "Trajectory")
    if name not in ENDS:
        raise SceneError([f"{name}: must be one of {', '.join(sorted(ENDS))}"])
    scene, duration = run.scene, float(run.times[-1])
    validate_measures((name,), scene)
    late = run.at(np.searchsorted(run.times, ending_times(scene, duration)))
    if run.system.spatial:
        return {column: float(value) for column, value in _energies(late).items()}
    layout = Layout.of(run.system, works=run.system.works)
    ending = layout.rows(late.motion)[None]
    none = np.full(1, np.nan)
    context = Context(
        scene, run.system, numbers_of(scene), layout, ending[0, :1].T, Wanted(duration, run.run.tolerance)
    )
    columns = COLUMNS[name](context, MemberResults(ending[0, -1:].T, none, none.copy()), ending)
    return {column: float(values[0]) for column, values in columns.items()}


def _rows(layout: Layout, run: Trajectory) -> Floats:
    """The y of a run, (T, size)."""
    return layout.rows(run.motion)


def _events(question: EnsembleRequest, scene: Scene) -> list[Event]:
    events, first = [], question.system.first
    if question.wanted.first_turns:
        for link, place in enumerate(places(question.system)):
            events.append(Event(f"{TURNS} {place}", _passing(Passing(first + link, np.pi, 0), first)))
    if section := question.measures.section:
        events.append(Event(SECTION, _passing(section, first)))
    return events


def _passing(section: Passing, first: int) -> Any:
    if section.row < first:
        return lambda state: float([*state.supports, state.cart][section.row]) - section.level
    return lambda state: float(np.sin((state.links[section.row - first] - section.level) / 2))


def _crossings(run: Trajectory, section: Passing, layout: Layout) -> Columns:
    level = level_of(layout, section.row, section.level)
    passages = _counted(run, SECTION, level, layout, section.direction)
    motion = layout.read(passages.rows)
    parts = {column: getattr(motion, part) for part, column in state_columns(layout.is_structured).items()}
    return {"crossing_time_s": passages.time, **{f"crossing_{name}": values for name, values in parts.items()}}
