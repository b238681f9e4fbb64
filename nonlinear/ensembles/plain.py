"""One member by `simulate`, for scenes that no engine supports."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from modal.errors import SceneError
from modal.extend.measures import LAST_TENTH, measure_for
from modal.scene import Scene
from modal.scene.doors import require_type
from modal.types import Floats
from nonlinear.ensembles.lanes import Watches, watches_of
from nonlinear.ensembles.measures import (
    Columns,
    Context,
    columns_of_members,
    ending_times,
    energy_columns,
    validate_measures,
    why_one_by_one,
)
from nonlinear.ensembles.question import EnsembleRequest
from nonlinear.ensembles.results import MemberResults, Wanted
from nonlinear.integration import Trajectory, sample_times
from nonlinear.integration.readiness import reproducible
from nonlinear.integration.within import Watch
from nonlinear.postprocessing import largest_angle
from nonlinear.simulation import request_of, simulate
from nonlinear.system import Layout, Motion, State, System, numbers_of

STATES = {
    "links": "links_rad",
    "link_rates": "link_rates_rad_per_s",
    "cart": "cart_m",
    "cart_rate": "cart_rate_m_per_s",
}
"""The parts of a state as columns."""
CARRIED = {"supports": "supports", "support_rates": "support_rates_per_s"}
"""And those of a structure, (…, d) in m or rad, named as `System.labels` begins."""


def validate_plain(measures: tuple[str, ...]) -> None:
    """Raise SceneError for measures that runs one by one cannot have."""
    if "lyapunov" in measures:
        raise SceneError(["lyapunov: needs members side by side in the plane"])


def state_columns(is_structured: bool) -> dict[str, str]:
    """The parts of the states of a scene as columns."""
    return STATES | CARRIED if is_structured else STATES


@reproducible()
def columns(question: EnsembleRequest, scene: Scene, start: State) -> Columns:
    """The requested results of one member, each of shape (...); raise SimulationError if it cannot reach its end."""
    wanted, spatial = replace(question.wanted, times=()), scene.space == "space"
    needed = sorted({0.0, *question.wanted.times, question.duration})
    if why_one_by_one(question.measures.names):  # a whole motion, as in a sweep
        usual = sample_times(scene, question.duration, 0.0, None)
        needed = sorted({*needed, *usual.tolist(), *ending_times(scene, question.duration)})
    output: Any = None if spatial and wanted.largest else needed
    watches = Watches()

    def watching(layout: Layout, y: Floats, slope: Floats) -> list[Watch]:
        nonlocal watches
        watches = watches_of(layout, y, slope, wanted)
        return watches.all

    seen = None if spatial or not (wanted.first_turns or wanted.largest or wanted.section) else watching
    request = request_of(scene, question.duration, question.tolerance, None, output, start, 0.0, {"watching": seen})
    run = request.run(request.choice(question.tolerance))
    if run.run.interrupted:
        raise KeyboardInterrupt
    sampled = run
    if output is None and question.wanted.times:
        sampled = simulate(scene, question.duration, start=start, tolerance=question.tolerance, output=needed)
    columns: Columns = {
        "energy_drift": np.array(run.energy_drift()),
        "error_rad": np.array(np.nan),
        "horizon_s": np.array(np.nan),
    }
    columns |= _measured(question, scene, run, sampled, watches)
    rows = np.searchsorted(sampled.times, question.times)
    if question.keeps_end:
        columns |= _states(run.system, run.motion.at(slice(-1, None)), single=True)
    if question.times:
        columns |= _states(run.system, sampled.motion.at(rows), single=False)
    return columns


def _states(system: System, motion: Motion, single: bool) -> Columns:
    parts = {column: getattr(motion, part) for part, column in state_columns(system.structure is not None).items()}
    return {name: values[0] if single else values for name, values in parts.items()}


def _measured(
    question: EnsembleRequest, scene: Scene, run: Trajectory, sampled: Trajectory, watches: Watches
) -> Columns:
    if run.system.spatial:
        return _in_space(question, run, sampled)
    layout = Layout.of(run.system, works=run.system.works)
    rows = layout.rows(sampled.motion)
    ending = rows[np.searchsorted(sampled.times, question.ending)][None] if question.ending else rows[None, :0]
    whole = watches.added_to(MemberResults(rows[-1:].T, np.full(1, np.nan), np.full(1, np.nan)))
    context = Context(scene, run.system, numbers_of(scene), layout, rows[:1].T, question.wanted)
    members = columns_of_members(question.measures.names, context, whole, ending, run)
    measured: Columns = {name: values[0] for name, values in members.items()}
    if whole.crossed is not None:
        _, times, crossings = whole.crossed
        measured["crossing_time_s"] = times
        measured |= {
            f"crossing_{name}": values
            for name, values in _states(run.system, layout.read(crossings), single=False).items()
        }
    return measured


def _in_space(question: EnsembleRequest, run: Trajectory, sampled: Trajectory) -> Columns:
    measured: Columns = {}
    if "largest_angle" in question.measures.names:
        measured["largest_angle_deg"] = np.array(np.degrees(largest_angle(run)))
    if "pendulum_energy" in question.measures.names:
        measured |= _energies(sampled.at(np.searchsorted(sampled.times, question.ending)))
    for measure in (measure_for("ensemble", name) for name in question.measures.names):
        if not measure.has("of_members"):
            numbers = measure.values_of("of_motion", run, question.duration)
            measured |= {column: np.array(number) for column, number in numbers.items()}
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
    if measure_for("ensemble", name).reads != LAST_TENTH:
        raise SceneError([f"measure {name}: must be read off {LAST_TENTH}"])
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
    columns = columns_of_members((name,), context, MemberResults(ending[0, -1:].T, none, none.copy()), ending)
    return {column: float(values[0]) for column, values in columns.items()}
