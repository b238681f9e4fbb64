"""Many scenes at once for callers that measure scenes one by one: their runs, or measures by an ensemble.

Scenes of one form, the same pendula and links in number and the same joints, go together; each has the samples that
`simulate` would keep.  Runs with kicks of escapements or dry friction go alone, since these belong to a trajectory.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np

from modal.errors import ComputationError, MultipendulaError
from modal.scene import ModalSupport, Scene, one_by_one, refusals, validate_scenes
from modal.types import Floats
from nonlinear import chaos
from nonlinear.dynamics import Lanes
from nonlinear.ensembles.lanes import run as run_in_lanes
from nonlinear.ensembles.lanes import task_of
from nonlinear.ensembles.measures import Context, columns_of_members, ending_times, validate_measures
from nonlinear.ensembles.question import CHUNK_BYTES_MAX, ENSEMBLE_TOLERANCE
from nonlinear.ensembles.results import Wanted
from nonlinear.ensembles.running import ensemble
from nonlinear.integration import SolverInfo, Trajectory, choose, sample_times
from nonlinear.integration.lanes import integrate
from nonlinear.integration.switches import numbers_of as switching_of
from nonlinear.integration.watches import Samples
from nonlinear.reduction import usual_start
from nonlinear.system import numbers_of_all, system_of

TIMED = ("sine", "constant")
"""Kinds of forces whose numbers may differ between members that go together."""

REASON = "side by side with others of its form"


def form_of(scene: Scene) -> Hashable:
    """Return a key equal for scenes that can be simulated together, None for one that cannot."""
    if one_by_one(scene) or refusals(scene, "an ensemble"):
        return None
    pendula = tuple(
        (
            part.count,
            part.ways,
            tuple(
                (link.count, link.drive is not None, (link.hoist, link.length) if link.hoist else None)
                for link in part.links
            ),
        )
        for part in scene.pendulum
    )
    return tuple(part.kind for part in scene.supports), _moved(scene), scene.has_modal_damping, pendula, _carried(scene)


def _carried(scene: Scene) -> Hashable:
    """Differences between structures: where pendula hang, what springs join, which have no length, modal supports."""
    if not scene.is_structured:
        return None
    modal = tuple((part.M, part.K, part.D, part.points) for part in scene.supports if isinstance(part, ModalSupport))
    springs = tuple((part.between, part.kind) for part in scene.spring)
    return tuple(part.on for part in scene.pendulum), springs, modal, system_of(scene).slack


def _moved(scene: Scene) -> Hashable:
    """The differences between motions of a support and forces, the numbers of sines and of constant forces omitted."""
    moved = tuple((part.direction, "sine") if part.kind == "sine" else part for part in scene.motions)
    acting = tuple((part.on, part.direction, part.kind) if part.kind in TIMED else part for part in scene.force)
    return moved, acting, scene.feedback


def run_together(scenes: Iterable[Scene], duration: float) -> dict[Scene, Trajectory]:
    """The runs of those scenes that can go together, from their usual starts; the others are omitted."""
    scenes = validate_scenes(scenes if isinstance(scenes, Sequence) else [*scenes])
    runs: dict[Scene, Trajectory] = {}
    for group in _by_form([scene for scene in scenes if not _switches(scene)]).values():
        if len(group) >= 4:  # fewer do not pay for equations that are written out
            runs |= _together(group, duration)
    return runs


def _by_form(scenes: Iterable[Scene]) -> dict[Hashable, list[Scene]]:
    """Those scenes that can go together, each once."""
    groups: dict[Hashable, list[Scene]] = {}
    for scene in dict.fromkeys(scenes):
        if (form := form_of(scene)) is not None:
            groups.setdefault(form, []).append(scene)
    return groups


def together(scene: Scene) -> bool:
    """Whether a scene runs together with others of its form."""
    return form_of(scene) is not None and not _switches(scene)


def _switches(scene: Scene) -> bool:
    """Whether its motion has kicks or dry friction."""
    system = system_of(scene)
    return system.has_escapements or system.rubs


def measured_together(scenes: Sequence[Scene], seconds: float, name: str) -> dict[Scene, dict[str, float]]:
    """A measure of an ensemble, "first_turn" or "lyapunov", of every scene from its usual start, all at once.

    Scenes that fail are omitted; of one scene alone its error is raised.
    """
    columns: dict[Scene, dict[str, float]] = {}
    groups = _by_form(scenes)
    apart = [[scene] for scene in dict.fromkeys(scenes) if form_of(scene) is None]
    for group in (*groups.values(), *apart):
        each = [[scene] for scene in group] if _switches(group[0]) else [group]
        for part in each:
            try:
                columns |= _measured(part, seconds, name)
            except MultipendulaError:
                if len(scenes) == 1:
                    raise
                for scene in part if len(part) > 1 else ():
                    with suppress(MultipendulaError):
                        columns |= _measured([scene], seconds, name)
    return columns


def _measured(scenes: Sequence[Scene], seconds: float, name: str) -> dict[Scene, dict[str, float]]:
    """The measure of scenes of one form, or of one scene."""
    for scene in scenes:
        validate_measures((name,), scene, seconds)
    tolerance = chaos.TOLERANCE if name == "lyapunov" else ENSEMBLE_TOLERANCE
    if form_of(scenes[0]) is None:
        member = ensemble(scenes[0], seconds, starts=[usual_start(scenes[0])], measures=[name], engine="simulate")
        if member.failures:
            raise ComputationError(member.failures[0])
        return {scenes[0]: {column: float(values[0]) for column, values in member.to_dict().items()}}
    numbers = numbers_of_all(scenes)
    if _switches(scenes[0]):
        numbers = replace(numbers, switching=switching_of(system_of(scenes[0])))
    lanes = Lanes(numbers)
    y = np.stack([lanes.layout.begin(usual_start(scene)) for scene in scenes], axis=1)
    wanted = Wanted(seconds, tolerance, first_turns=name == "first_turn", stretching=name == "lyapunov")
    outcome = run_in_lanes(numbers, y, wanted)
    if outcome.reasons and len(scenes) == 1:
        raise ComputationError(outcome.reasons[0])
    context = Context(scenes[0], system_of(scenes[0]), numbers, lanes.layout, y, wanted)
    columns = columns_of_members((name,), context, outcome, np.empty((len(scenes), 0, len(y))))
    return {
        scene: {column: float(values[k]) for column, values in columns.items()}
        for k, scene in enumerate(scenes)
        if k not in outcome.reasons
    }


def times_of(scene: Scene, duration: float) -> Floats:
    """Samples (s) of a run that is measured: those of `simulate`, and those by which ensembles judge its end."""
    return np.union1d(sample_times(scene, duration, 0.0, None), ending_times(scene, duration))


def _together(scenes: Sequence[Scene], duration: float) -> dict[Scene, Trajectory]:
    """Runs of scenes of one form."""
    kept, times = [], []
    for scene in scenes:
        try:
            if scene.has_damping and choose(scene, duration, ENSEMBLE_TOLERANCE).method == "Radau":
                continue
            usual_start(scene)
            times.append(times_of(scene, duration))
        except MultipendulaError:
            continue
        kept.append(scene)
    runs: dict[Scene, Trajectory] = {}
    longest = max(map(len, times), default=1)
    at_once = max(1, CHUNK_BYTES_MAX // (8 * longest * (4 * scenes[0].n_links + 4)))
    for first in range(0, len(kept), at_once):
        part = slice(first, first + at_once)
        if len(kept[part]) >= 4:
            runs |= _integrated(kept[part], times[part], duration)
    return runs


def _integrated(scenes: Sequence[Scene], times: Sequence[Floats], duration: float) -> dict[Scene, Trajectory]:
    numbers = numbers_of_all(scenes)
    lanes = Lanes(numbers)
    y = np.stack([lanes.layout.begin(usual_start(scene)) for scene in scenes], axis=1)
    task, _, _ = task_of(lanes, numbers, y, Wanted(duration, ENSEMBLE_TOLERANCE))
    padded = np.full((len(scenes), max(map(len, times))), np.inf)
    for row, moments in zip(padded, times, strict=True):
        row[: len(moments)] = moments
    samples = Samples(padded, y)
    outcome = integrate(task, [samples])
    runs = {}
    for k, (scene, moments) in enumerate(zip(scenes, times, strict=True)):
        if k in outcome.reasons:
            continue
        run = SolverInfo("minimal", "DOP853", REASON, ENSEMBLE_TOLERANCE, steps=int(outcome.steps[k]))
        rows = samples.rows[k, : len(moments)]
        rows[-1] = outcome.y[:, k]
        runs[scene] = Trajectory(scene, system_of(scene), moments, lanes.layout.read(rows), run)
    return runs
