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
from modal.scene.parameters import Variation, parse_variations, validate_variations, vary
from modal.types import Crew, map_by_crew
from nonlinear.ensembles.costs import engine_of_many
from nonlinear.ensembles.endings import (
    UNDECIDED,
    EndingGroup,
    Outcomes,
    drive_angle,
    orbit_near,
    rhythm_starts,
    settle,
)
from nonlinear.ensembles.question import COMPILED, ENSEMBLE_TOLERANCE
from nonlinear.ensembles.return_maps import SectionMap, slowest_period
from nonlinear.ensembles.rhythm_borders import continued, rhythm_without_orbit
from nonlinear.ensembles.rhythm_store import RhythmStore
from nonlinear.ensembles.rhythms import Rhythm, RhythmEvent, RhythmGrid, RhythmMap, ValueRhythms
from nonlinear.ensembles.sections import MEMBERS_MAX
from nonlinear.ensembles.store import ChunkFolder
from nonlinear.orbits.cycles import Beginning, beginnings, is_same_orbit, require_cycles
from nonlinear.orbits.flow import ORBIT_TOLERANCE
from nonlinear.orbits.stable import StableOrbits, stable_branches, stable_orbits
from nonlinear.simulation import simulate
from nonlinear.synchronization.attractors import Ending, rhythm_of
from nonlinear.system import Motion, State


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

        def compute() -> tuple[EndingGroup, ...]:
            outcomes = Outcomes(vary(self.scene, {self.variation.path: value}), partial(self.orbit_of, value))
            place, members = np.zeros(len(self.starts.links), dtype=int), {"starts": self.starts, "check": 0}
            settle([outcomes], place, self.limit, members, engine=self.engine, workers=1)
            return outcomes.whole()

        return self.store.groups([value, self.starts], compute)

    def outcomes(self, values: Sequence[float], rhythm: Rhythm, near: float) -> tuple[EndingGroup, ...]:
        """What a rhythm that is known `near` ends in at each of these values, run together.

        The starts are spread over its slow period: what is lost from one of them may last from another.
        """
        path, is_chaotic = self.variation.path, rhythm.exponent is not None

        def compute() -> tuple[EndingGroup, ...]:
            outcomes = [Outcomes(vary(self.scene, {path: value}), partial(self.orbit_of, value)) for value in values]
            span = rhythm.slow_period or self.limit / 64
            motion = simulate(vary(self.scene, {path: near}), span, start=rhythm.state, output=len(values) + 1).motion
            members = {"starts": motion.at(slice(1, None)), "vary": {path: np.array(values)}, "check": 0}
            options: dict[str, Any] = {"engine": self.engine, "workers": 1, "may_be_chaotic": is_chaotic}
            settle(outcomes, np.arange(len(values)), self.limit, members, **options)
            return tuple(each.whole()[0] for each in outcomes)

        return self.store.groups([values, near, is_chaotic, rhythm.state], compute)

    def branch(self, beginning: Beginning) -> StableOrbits:
        """The branch of stable orbits from a beginning."""
        return self.store.branch(beginning, partial(stable_orbits, beginning))

    def orbit_of(self, value: float, ending: Ending) -> Beginning | None:
        """The orbit near a periodic ending at a value, None if there is none."""
        return orbit_near(self.scene, ending, self.variation, value)

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
    if ".start." in variation.path:
        words = "the starts of a map are drawn at random, the same at every value: map those of the scene by `basins`"
        raise SceneError([f"vary {variation.path}: {words}"])
    checked_index("members", members, 1, MEMBERS_MAX)
    returns = SectionMap(scene)
    box = (
        checked_number("largest_deg", largest_deg, 0.0)
        if largest_deg is not None
        else min(2 * drive_angle(scene), 180.0)
    )
    checked_index("seed", seed, 0, 2**63)
    period = slowest_period(scene)
    longest = returns.rounds * returns.first_round
    if limit is not None:
        longest = checked_number("limit", limit, period)
    starts = rhythm_starts(scene, members, box, seed)
    if engine == "auto":
        engine = _engine_for(scene, starts[0], members * len(variation.values), min(longest, 4 * returns.first_round))
    task = MapTask(scene, variation, starts, longest, engine)
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
    values, ends = continued(task.outcomes, values, known_ends, crew)
    events = (*_orbit_events(branches, names), *ends)
    births = tuple(sorted(events, key=lambda event: event.value))
    return RhythmMap(scene, variation, tuple(values), births, members, box, longest, seed)


def _engine_for(scene: Scene, start: State, count: int, duration: float) -> str:
    """The compiled engine where it pays for so many runs (s) in all, else "auto": each round by itself may not pay."""
    engine = engine_of_many(scene, start, count, duration, ENSEMBLE_TOLERANCE, ())
    return engine if engine == COMPILED else "auto"


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
    validate_variations(scene, axes)
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
    """The rhythms at a value, and stable orbits in which no start ends."""
    ends = np.full(members, -1)
    rhythms: list[Rhythm] = []
    here = [(number, orbit) for number, branch in enumerate(branches) if (orbit := branch.at(value))]
    ended: dict[int, EndingGroup] = {}
    for group in groups:
        if group.name == UNDECIDED:
            continue
        orbit = group.beginning and group.beginning.orbit
        matches = [number for number, branch_orbit in here if orbit and is_same_orbit(orbit, branch_orbit)]
        if matches:
            ended[matches[0]] = group
            ends[list(group.members)] = matches[0]
            continue
        ends[list(group.members)] = len(branches) + len(rhythms)
        rhythms.append(rhythm_without_orbit(group, members))
    for number, orbit in here:
        starts, copies = int(np.count_nonzero(ends == number)), ended[number].copies if number in ended else 1
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
