"""Computation of maps of rhythms: the same starts at every value, their outcomes, and continuation of the orbits."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from hashlib import sha256
from typing import Any

import numpy as np

from modal.errors import MultipendulaError, SceneError
from modal.report import silent
from modal.scene import Scene, describe
from modal.scene.doors import checked, checked_index, checked_number
from modal.scene.parameters import Variation, parse_variations, vary
from modal.types import Crew, map_by_crew
from nonlinear.ensembles.endings import (
    LIMIT_PERIODS,
    UNDECIDED,
    EndingGroup,
    distinct_states,
    drive_angle,
    groups_of,
    rhythm_starts,
    slowest_period,
)
from nonlinear.ensembles.rhythm_borders import continued, rhythm_without_orbit
from nonlinear.ensembles.rhythm_store import RhythmStore
from nonlinear.ensembles.rhythms import Rhythm, RhythmEvent, RhythmGrid, RhythmMap, ValueRhythms
from nonlinear.ensembles.sections import MEMBERS_MAX
from nonlinear.ensembles.store import ChunkFolder
from nonlinear.orbits.cycles import Beginning, beginnings, is_same_orbit, require_cycles
from nonlinear.orbits.flow import ORBIT_TOLERANCE
from nonlinear.orbits.stable import StableOrbits, stable_branches, stable_orbits
from nonlinear.synchronization.attractors import Ending, rhythm_of
from nonlinear.system import Motion


@dataclass(frozen=True, eq=False)
class MapTask:
    """The task of a worker: the starts of a scene, the longest run (s), and the options of its ensembles."""

    scene: Scene
    variation: Variation
    starts: Motion
    limit: float
    engine: str
    folder: ChunkFolder | None = None

    @property
    def store(self) -> RhythmStore:
        """Where outcomes are remembered."""
        return RhythmStore(self.scene, self.variation, self.folder)

    def __call__(self, value: float) -> tuple[EndingGroup, ...]:
        """The outcomes of the starts at a value."""
        return self.groups(value, self.starts)

    def groups(self, value: float, starts: Motion, **options: Any) -> tuple[EndingGroup, ...]:
        """The outcomes of these starts at a value; `options` are those of `groups_of`."""

        def compute() -> tuple[EndingGroup, ...]:
            here, orbit_of = vary(self.scene, {self.variation.path: value}), partial(self.orbit_of, value)
            return groups_of(here, starts, self.limit, orbit_of, engine=self.engine, workers=1, **options)

        return self.store.groups([value, options, starts], compute)

    def branch(self, beginning: Beginning) -> StableOrbits:
        """The branch of stable orbits from a beginning."""
        return self.store.branch(beginning, partial(stable_orbits, beginning))

    def orbit_of(self, value: float, ending: Ending) -> Beginning | None:
        """The orbit near a periodic ending at a value, None if there is none."""
        start = ending.state, ending.period
        return next(beginnings(self.scene, self.variation, value, start, ORBIT_TOLERANCE), None)

    def averaged_orbits(self, value: float) -> tuple[Beginning, ...]:
        """The orbits near the averaged configurations at a value, whose basins may be small; of few pendula."""
        if sum(pendulum.count for pendulum in self.scene.pendulum) > 4:
            return ()

        def compute() -> tuple[Beginning, ...]:
            try:
                return tuple(beginnings(self.scene, self.variation, value, None, ORBIT_TOLERANCE))
            except MultipendulaError:
                return ()

        return self.store.beginnings(value, compute)


@checked
def find_rhythms(
    scene: Scene,
    vary: str | Variation,
    *,
    members: int = 300,
    largest_deg: float | None = None,
    limit: float | None = None,
    seed: int = 7,
    engine: str = "auto",
    folder: str | None = None,
    crew: Crew | None = None,
    report: Callable[[float], object] = silent,
) -> RhythmMap:
    """Map the rhythms of a scene with drives along a parameter: shares, orbits, births and deaths.

    At each value the same `members` starts, drawn by `seed` with angles up to `largest_deg`, by default twice the
    drives' angle, run until they have settled, at most for `limit` (s), by default 4,096 periods of the slowest
    pendulum. Finished values are stored in a `folder`, from which an interrupted call resumes; a `crew` computes them
    together. `report` is called with the number of values done. Raise SceneError for a scene without limit cycles.
    """
    variation = parse_variations([vary])[0] if isinstance(vary, str) else vary
    require_cycles(scene, variation)
    checked_index("members", members, 1, MEMBERS_MAX)
    period = slowest_period(scene)
    box = (
        checked_number("largest_deg", largest_deg, 0.0)
        if largest_deg is not None
        else min(2 * drive_angle(scene), 180.0)
    )
    checked_index("seed", seed, 0, 2**63)
    longest = checked_number("limit", limit, period) if limit is not None else LIMIT_PERIODS * period
    task = MapTask(scene, variation, rhythm_starts(scene, members, box, seed), longest, engine)
    task = replace(task, folder=_folder(folder, task, seed)) if folder else task
    parts = []
    solved = map_by_crew(task, variation.values, crew)
    for done, part in enumerate(solved, 1):
        parts.append(part)
        report(done)
    few = np.unique(np.linspace(0, len(parts) - 1, 4).round().astype(int)).tolist()
    averaged = map_by_crew(task.averaged_orbits, [variation.values[k] for k in few], crew)
    orbits = [[group.beginning for group in groups] for groups in parts]
    for number, more in zip(few, averaged, strict=True):
        orbits[number] += more
    branches = stable_branches(variation, orbits, task.branch, crew)
    names = _branch_names(branches)
    values = [
        _value_of(value, groups, branches, names, members)
        for value, groups in zip(variation.values, parts, strict=True)
    ]
    known_ends = [end for branch in branches for end in (branch.birth, branch.death) if end]
    values, ends = continued(task.groups, values, known_ends, crew)
    events = (*_orbit_events(branches, names), *ends)
    births = tuple(sorted(events, key=lambda event: event.value))
    return RhythmMap(scene, variation, tuple(values), births, members, box, longest, seed)


def _folder(path: str, task: MapTask, seed: int) -> ChunkFolder:
    header = {
        "format": 2,
        "scene": describe(task.scene),
        "vary": {"path": task.variation.path, "values": task.variation.values},
        "members": len(task.starts.links),
        "starts": sha256(np.ascontiguousarray(task.starts.links).tobytes()).hexdigest(),
        "limit_s": task.limit,
        "seed": seed,
    }
    return ChunkFolder(path, "map", sha256(repr(header).encode()).hexdigest(), header)


@checked
def find_rhythm_grid(
    scene: Scene,
    axes: Sequence[Variation],
    *,
    members: int = 20,
    folder: str | None = None,
    report: Callable[[float], object] = silent,
    **options: Any,
) -> RhythmGrid:
    """The rhythms over two numbers, borders along the first; `options` are those of `find_rhythms`.

    Branches are named by their patterns alone: their numbers would depend on the row.
    """
    if len(axes) != 2:
        raise SceneError([f"axes: a grid has two numbers, not {len(axes)}"])
    first, second = axes
    count = len(first.values)
    maps = []
    for number, value in enumerate(second.values):
        place = f"{folder}/row-{number:03d}" if folder else None
        row = vary(scene, {second.path: value})

        def progress(done: float, before: int = number * count) -> None:
            report(before + done)

        row_map = find_rhythms(row, first, members=members, folder=place, report=progress, **options)
        maps.append(row_map.by_pattern())
    return RhythmGrid(scene, (first, second), tuple(maps))


def _value_of(
    value: float,
    groups: Sequence[EndingGroup],
    branches: Sequence[StableOrbits],
    names: Sequence[str],
    members: int,
) -> ValueRhythms:
    """The rhythms at a value: groups of one orbit together, and stable orbits in which no start ends."""
    ends = np.full(members, -1)
    rhythms: list[Rhythm] = []
    here = [(number, orbit) for number, branch in enumerate(branches) if (orbit := branch.at(value))]
    endings: dict[int, list[EndingGroup]] = {number: [] for number, _ in here}
    for group in groups:
        if group.name == UNDECIDED:
            continue
        beginning = group.beginning
        matches = [number for number, orbit in here if beginning and is_same_orbit(beginning.orbit, orbit)]
        if matches:
            endings[matches[0]].append(group)
            ends[list(group.members)] = matches[0]
            continue
        ends[list(group.members)] = len(branches) + len(rhythms)
        rhythms.append(rhythm_without_orbit(group, members))
    for number, orbit in here:
        starts = sum(len(group.members) for group in endings[number])
        states = [group.ending.state for group in endings[number]]
        copies = max([1, *(group.copies for group in endings[number])])
        if states:
            copies = max(copies, distinct_states(states) // endings[number][0].ending.returns)
        rhythms.append(Rhythm(names[number], starts, members, copies, orbit, number, orbit.period))
    rhythms.sort(key=lambda rhythm: -rhythm.count)
    undecided = sum(len(group.members) for group in groups if group.name == UNDECIDED)
    return ValueRhythms(value, tuple(rhythms), undecided, tuple(ends.tolist()))


def _branch_names(branches: Sequence[StableOrbits]) -> list[str]:
    """The most frequent name of each branch's orbits, with its number where others of this name exist at a value."""
    names = [Counter(map(rhythm_of, branch.orbits)).most_common(1)[0][0] for branch in branches]
    spans = [(float(branch.orbits[0].value or 0.0), float(branch.orbits[-1].value or 0.0)) for branch in branches]
    numbered = list(names)
    for name in set(names):
        alike = sorted((min(spans[k]), k) for k in range(len(names)) if names[k] == name)
        ends = [max(spans[k]) for _, k in alike]
        if any(begin < max(ends[:place]) for place, (begin, _) in enumerate(alike) if place):
            for place, (_, k) in enumerate(alike, 1):
                numbered[k] = f"{name}, branch {place}"
    return numbered


def _orbit_events(branches: Sequence[StableOrbits], names: Sequence[str]) -> Iterator[RhythmEvent]:
    """Births and deaths of orbits."""
    for branch, name in zip(branches, names, strict=True):
        for is_birth, event in ((True, branch.birth), (False, branch.death)):
            if event:
                yield RhythmEvent(name, is_birth, *event)
