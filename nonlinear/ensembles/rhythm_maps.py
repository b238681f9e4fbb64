"""Computation of maps of rhythms: the same starts at every value, their outcomes, and continuation of the orbits."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from hashlib import sha256
from math import nan
from typing import Any

import numpy as np

from modal.errors import MultipendulaError, SceneError
from modal.report import finite, silent
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
from nonlinear.ensembles.rhythms import Rhythm, RhythmEvent, RhythmGrid, RhythmMap, ValueRhythms
from nonlinear.ensembles.sections import MEMBERS_MAX
from nonlinear.ensembles.store import ChunkFolder
from nonlinear.orbits.cycles import Beginning, beginnings, is_same_orbit, require_cycles
from nonlinear.orbits.flow import ORBIT_TOLERANCE
from nonlinear.orbits.stable import StableOrbits, stable_branches
from nonlinear.synchronization.attractors import PERIODIC, Ending, rhythm_of
from nonlinear.system import Motion, State, motion_of

SHAPE = ("kind", "returns", "slow_period", "drifting", "chimera")


@dataclass(frozen=True, eq=False)
class MapTask:
    """The task of a worker: the starts of a scene, the longest run (s), and the options of its ensembles."""

    scene: Scene
    variation: Variation
    starts: Motion
    limit: float
    engine: str

    def __call__(self, value: float) -> tuple[EndingGroup, ...]:
        """The outcomes of the starts at a value."""
        outcomes = Outcomes(vary(self.scene, {self.variation.path: value}), partial(self.orbit_of, value))
        place, members = np.zeros(len(self.starts.links), dtype=int), {"starts": self.starts, "check": 0}
        settle([outcomes], place, self.limit, members, engine=self.engine, workers=1)
        return outcomes.whole()

    def outcomes(self, values: Sequence[float], state: State, *, may_be_chaotic: bool) -> list[EndingGroup]:
        """What the motion from a state ends in at each of these values, run together."""
        path = self.variation.path
        outcomes = [Outcomes(vary(self.scene, {path: value}), partial(self.orbit_of, value)) for value in values]
        members = {"starts": motion_of([state] * len(values)), "vary": {path: np.array(values)}, "check": 0}
        options: dict[str, Any] = {"engine": self.engine, "workers": 1, "may_be_chaotic": may_be_chaotic}
        settle(outcomes, np.arange(len(values)), self.limit, members, **options)
        return [each.whole()[0] for each in outcomes]

    def orbit_of(self, value: float, ending: Ending) -> Beginning | None:
        """The orbit near a periodic ending at a value, None if there is none."""
        return orbit_near(self.scene, ending, self.variation, value)

    def averaged_orbits(self, value: float) -> tuple[Beginning, ...]:
        """The orbits near the averaged configurations at a value, whose basins may be small; of few pendula."""
        if sum(pendulum.count for pendulum in self.scene.pendulum) > 4:
            return ()
        try:
            return tuple(beginnings(self.scene, self.variation, value, None, ORBIT_TOLERANCE))
        except MultipendulaError:
            return ()


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
        engine = _engine_for(scene, starts[0], members * len(variation.values), min(longest, 512 * period))
    task = MapTask(scene, variation, starts, longest, engine)
    store = folder and _store(folder, task, seed)
    parts = []
    solved = map_by_crew(partial(_at_value, task, store or None), range(len(variation.values)), crew)
    for done, part in enumerate(solved, 1):
        parts.append(part)
        report(done)
    few = np.unique(np.linspace(0, len(parts) - 1, 4).round().astype(int)).tolist()
    averaged = map_by_crew(task.averaged_orbits, [variation.values[k] for k in few], crew)
    orbits = [[group.beginning for group in groups] for groups in parts]
    for number, more in zip(few, averaged, strict=True):
        orbits[number] += more
    branches = stable_branches(variation, orbits, crew)
    names = _branch_names(branches)
    values = [
        _value_of(value, groups, branches, names, members)
        for value, groups in zip(variation.values, parts, strict=True)
    ]
    values, ends = continued(
        task.outcomes, values, [end for branch in branches for end in (branch.birth, branch.death) if end]
    )
    events = (*_orbit_events(branches, names), *ends)
    births = tuple(sorted(events, key=lambda event: event.value))
    return RhythmMap(scene, variation, tuple(values), births, members, box, longest, seed)


def _engine_for(scene: Scene, start: State, count: int, duration: float) -> str:
    """The compiled engine where it pays for so many runs (s) in all, else "auto": each round by itself may not pay."""
    engine = engine_of_many(scene, start, count, duration, ENSEMBLE_TOLERANCE, ())
    return engine if engine == COMPILED else "auto"


def _at_value(task: MapTask, store: ChunkFolder | None, number: int) -> tuple[EndingGroup, ...]:
    """The groups at a value from the folder if they are stored there, else computed and stored."""
    value = task.variation.values[number]
    if store is None:
        return task(value)
    if store.path(number).exists():
        groups = store.content(number, _groups_from)
        return tuple(
            replace(group, beginning=task.orbit_of(value, group.ending)) if group.name == PERIODIC else group
            for group in groups
        )
    groups = task(value)
    header, columns = _header_and_arrays(groups)
    store.write(number, header, columns)
    return groups


def _store(folder: str, task: MapTask, seed: int) -> ChunkFolder:
    header = {
        "scene": describe(task.scene),
        "vary": {"path": task.variation.path, "values": task.variation.values},
        "members": len(task.starts.links),
        "starts": sha256(np.ascontiguousarray(task.starts.links).tobytes()).hexdigest(),
        "limit_s": task.limit,
        "seed": seed,
    }
    return ChunkFolder(folder, "map", sha256(repr(header).encode()).hexdigest(), header)


def _header_and_arrays(groups: Sequence[EndingGroup]) -> tuple[dict[str, Any], dict[str, Any]]:
    """Groups as a header and arrays."""
    header = {
        "groups": [
            {
                "name": group.name,
                "copies": group.copies,
                "exponent": group.exponent,
                "period_s": finite(group.ending.period),
                "shape": [getattr(group.ending, name) for name in SHAPE],
                "cart": [group.ending.state.cart, group.ending.state.cart_rate],
            }
            for group in groups
        ]
    }
    columns: dict[str, Any] = {}
    for number, group in enumerate(groups):
        state = group.ending.state
        columns[f"members_{number}"] = np.array(group.members)
        for name in ("links", "link_rates", "supports", "support_rates"):
            columns[f"{name}_{number}"] = getattr(state, name)
    return header, columns


def _groups_from(header: Mapping[str, Any], columns: Mapping[str, Any]) -> tuple[EndingGroup, ...]:
    """The same groups again; their records are not stored."""
    groups = []
    for number, entry in enumerate(header["groups"]):
        links, rates, supports, support_rates = (
            columns[f"{name}_{number}"] for name in ("links", "link_rates", "supports", "support_rates")
        )
        state = State(links, rates, float(entry["cart"][0]), float(entry["cart"][1]), supports, support_rates)
        period = nan if entry["period_s"] is None else float(entry["period_s"])
        ending = Ending(
            period=period, record=np.zeros((0, 0)), state=state, **dict(zip(SHAPE, entry["shape"], strict=True))
        )
        exponent = entry["exponent"] and (float(entry["exponent"][0]), float(entry["exponent"][1]))
        members = tuple(columns[f"members_{number}"].astype(int).tolist())
        groups.append(EndingGroup(entry["name"], members, ending, entry["copies"], exponent))
    return tuple(groups)


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
    """The rhythms over two numbers, borders along the first; `options` are those of `find_rhythms`."""
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

        maps.append(find_rhythms(row, first, members=members, folder=place, report=progress, **options))
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
