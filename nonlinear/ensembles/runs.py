"""Runs of many scenes side by side, as trajectories, for whoever measures runs one by one.

Scenes of one form, the same pendula and links in number and the same joints, go together; each has the samples that
`simulate` would keep.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Sequence

import numpy as np

from modal.errors import MultipendulaError
from modal.scene import AnyLink, ModalSupport, Scene, one_by_one, refusals, validate_scenes
from modal.types import Floats
from nonlinear.dynamics import Lanes
from nonlinear.ensembles.found import Wanted
from nonlinear.ensembles.lanes import task_of
from nonlinear.ensembles.question import ROOM
from nonlinear.integration import SolverInfo, Trajectory, choose, sample_times
from nonlinear.integration.lanes import integrate
from nonlinear.integration.watches import Samples
from nonlinear.reduction import usual_start
from nonlinear.system import numbers_of_all, system_of

TIMED = ("sine", "constant")
"""Kinds of forces whose numbers may differ between members that go together."""

TOLERANCE = 1e-9
FEWEST = 4  # scenes for which the equations are written out
REASON = "side by side with others of its form"


def form_of(scene: Scene) -> Hashable:
    """Equal for scenes that go together, None for one that goes alone."""
    if one_by_one(scene) or refusals(scene, "an ensemble"):
        return None
    pendula = tuple(
        (one.count, one.ways, tuple((link.count, link.drive is not None, _law(link)) for link in one.links))
        for one in scene.pendulum
    )
    return tuple(one.kind for one in scene.supports), _moved(scene), scene.has_modal_damping, pendula, _carried(scene)


def _carried(scene: Scene) -> Hashable:
    """What differs between structures: where pendula hang, what springs join, which have no length, modal supports."""
    if not scene.is_structured:
        return None
    modal = tuple((one.M, one.K, one.D, one.points) for one in scene.supports if isinstance(one, ModalSupport))
    springs = tuple((one.between, one.kind) for one in scene.spring)
    return tuple(one.on for one in scene.pendulum), springs, modal, system_of(scene).slack


def _law(link: AnyLink) -> Hashable:
    """What differs between laws of length."""
    return (link.hoist, link.length) if link.hoist else None


def _moved(scene: Scene) -> Hashable:
    """What differs between motions of a support and forces, the numbers of sines and of constant forces left out."""
    moved = tuple((one.direction, "sine") if one.kind == "sine" else one for one in scene.motions)
    acting = tuple((one.on, one.direction, one.kind) if one.kind in TIMED else one for one in scene.force)
    return moved, acting


def run_together(scenes: Iterable[Scene], duration: float) -> dict[Scene, Trajectory]:
    """The runs of those scenes that can go together, from their usual starts; the others are left out."""
    scenes = validate_scenes(scenes if isinstance(scenes, Sequence) else [*scenes])
    forms: dict[Hashable, list[Scene]] = {}
    for scene in dict.fromkeys(scenes):
        if (form := form_of(scene)) is not None:
            forms.setdefault(form, []).append(scene)
    found: dict[Scene, Trajectory] = {}
    for own in forms.values():
        if len(own) >= FEWEST:
            found |= _together(own, duration)
    return found


def _together(scenes: Sequence[Scene], duration: float) -> dict[Scene, Trajectory]:
    """Runs of scenes of one form."""
    kept, times = [], []
    for scene in scenes:
        try:
            if scene.has_damping and choose(scene, duration, TOLERANCE).method == "Radau":
                continue
            usual_start(scene)
            times.append(sample_times(scene, duration, 0.0, None))
        except MultipendulaError:
            continue
        kept.append(scene)
    found: dict[Scene, Trajectory] = {}
    longest = max(map(len, times), default=1)
    at_once = max(1, ROOM // (8 * longest * (4 * scenes[0].n_links + 4)))
    for first in range(0, len(kept), at_once):
        part = slice(first, first + at_once)
        if len(kept[part]) >= FEWEST:
            found |= _integrated(kept[part], times[part], duration)
    return found


def _integrated(scenes: Sequence[Scene], times: Sequence[Floats], duration: float) -> dict[Scene, Trajectory]:
    numbers = numbers_of_all(scenes)
    lanes = Lanes(numbers)
    y = np.stack([lanes.layout.begin(usual_start(scene)) for scene in scenes], axis=1)
    task, _, _ = task_of(lanes, numbers, y, Wanted(duration, TOLERANCE))
    padded = np.full((len(scenes), max(map(len, times))), np.inf)
    for row, own in zip(padded, times, strict=True):
        row[: len(own)] = own
    samples = Samples(padded, y)
    outcome = integrate(task, [samples])
    found = {}
    for k, (scene, own) in enumerate(zip(scenes, times, strict=True)):
        if k in outcome.reasons:
            continue
        run = SolverInfo("minimal", "DOP853", REASON, TOLERANCE, steps=int(outcome.steps[k]))
        rows = samples.rows[k, : len(own)]
        rows[-1] = outcome.y[:, k]
        found[scene] = Trajectory(scene, system_of(scene), own, lanes.layout.read(rows), run)
    return found
