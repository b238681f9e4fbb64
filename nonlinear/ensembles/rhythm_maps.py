"""Computation of maps of rhythms: the same starts at every value, their outcomes, and continuation of the orbits."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from hashlib import sha256
from itertools import pairwise
from math import degrees, nan
from typing import Any

import numpy as np

from modal.errors import SceneError
from modal.report import finite, silent
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
from nonlinear.ensembles.rhythms import Rhythm, RhythmEvent, RhythmGrid, RhythmMap, ValueRhythms
from nonlinear.ensembles.sections import MEMBERS_MAX
from nonlinear.ensembles.store import ChunkFolder
from nonlinear.orbits.cycles import Beginning, beginnings, is_same_orbit, require_cycles
from nonlinear.orbits.flow import ORBIT_TOLERANCE
from nonlinear.orbits.stable import KINDS, StableOrbits, stable_branches
from nonlinear.synchronization.attractors import PERIODIC, Ending, orbit_amplitudes
from nonlinear.synchronization.patterns import rhythm_name
from nonlinear.system import Motion, State


@dataclass(frozen=True, eq=False)
class MapTask:
    """What a worker runs: the starts of a scene, the longest run (s), and the options of its ensembles."""

    scene: Scene
    variation: Variation
    starts: Motion
    limit: float
    engine: str

    def __call__(self, value: float) -> tuple[tuple[EndingGroup, ...], tuple[Beginning | None, ...]]:
        """The groups at a value, and for each periodic one the orbit."""
        here = vary(self.scene, {self.variation.path: value})
        groups = groups_of(here, self.starts, self.limit, engine=self.engine, workers=1)
        return groups, tuple(self.beginning(value, group) for group in groups)

    def beginning(self, value: float, group: EndingGroup) -> Beginning | None:
        """The stable orbit that a group ends in, None if there is none."""
        if group.name != PERIODIC:
            return None
        start = group.ending.state, group.ending.period
        return next(beginnings(self.scene, self.variation, value, start, ORBIT_TOLERANCE), None)


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
    drives' angle, run until they have settled, at most for `limit` (s), by default 2,048 periods of the slowest
    pendulum. Values that are done are kept in a `folder`, where a call that was killed goes on; a `crew` computes them
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
    store = folder and _store(folder, task, seed)
    parts = []
    solved = map_by_crew(partial(_at_value, task, store or None), range(len(variation.values)), crew)
    for done, part in enumerate(solved, 1):
        parts.append(part)
        report(done)
    branches = stable_branches(variation, [orbits for _, orbits in parts], crew)
    values = tuple(
        _value_of(value, groups, orbits, branches, members)
        for value, (groups, orbits) in zip(variation.values, parts, strict=True)
    )
    events = (*_orbit_events(branches), *_sampled_events(values, branches))
    births = tuple(sorted(events, key=lambda event: event.value))
    return RhythmMap(scene, variation, values, births, members, box, longest, seed)


def _at_value(
    task: MapTask, store: ChunkFolder | None, number: int
) -> tuple[tuple[EndingGroup, ...], tuple[Beginning | None, ...]]:
    """The groups at a value from the folder where it is kept there, else computed and kept."""
    value = task.variation.values[number]
    if store is None:
        return task(value)
    if store.path(number).exists():
        groups = store.content(number, _groups_from)
        return groups, tuple(task.beginning(value, group) for group in groups)
    groups, orbits = task(value)
    header, columns = _header_and_arrays(groups)
    store.write(number, header, columns)
    return groups, orbits


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
                "kind": group.ending.kind,
                "period_s": finite(group.ending.period),
                "returns": group.ending.returns,
                "slow_period_s": group.ending.slow_period,
                "drifting": group.ending.drifting,
                "chimera": group.ending.chimera,
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
    """The same groups again; their records are not kept."""
    groups = []
    for number, entry in enumerate(header["groups"]):
        links, rates, supports, support_rates = (
            columns[f"{name}_{number}"] for name in ("links", "link_rates", "supports", "support_rates")
        )
        state = State(links, rates, float(entry["cart"][0]), float(entry["cart"][1]), supports, support_rates)
        period = nan if entry["period_s"] is None else float(entry["period_s"])
        shape = entry["returns"], entry["slow_period_s"], entry["drifting"], entry["chimera"]
        ending = Ending(entry["kind"], period, np.zeros((0, 0)), state, *shape)
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
    orbits: Sequence[Beginning | None],
    branches: Sequence[StableOrbits],
    members: int,
) -> ValueRhythms:
    """The rhythms at a value: groups of one orbit together, and stable orbits in which no start ends."""
    ends = np.full(members, -1)
    rhythms: list[Rhythm] = []
    here = [(number, orbit) for number, branch in enumerate(branches) if (orbit := branch.at(value))]
    endings: dict[int, list[EndingGroup]] = {number: [] for number, _ in here}
    for group, beginning in zip(groups, orbits, strict=True):
        if group.name == UNDECIDED:
            continue
        matches = [number for number, orbit in here if beginning and is_same_orbit(beginning.orbit, orbit)]
        if matches:
            endings[matches[0]].append(group)
            ends[list(group.members)] = matches[0]
            continue
        ends[list(group.members)] = len(branches) + len(rhythms)
        name = group.name if group.name != PERIODIC else _name_of_state(group)
        ending = group.ending
        periods = ending.period, ending.slow_period, group.exponent
        rhythms.append(Rhythm(name, len(group.members), members, group.copies, None, None, *periods))
    for number, orbit in here:
        starts = sum(len(group.members) for group in endings[number])
        states = [group.ending.state for group in endings[number]]
        copies = max([1, *(group.copies for group in endings[number])])
        if states:
            copies = max(copies, distinct_states(states) // endings[number][0].ending.returns)
        name = rhythm_name(orbit_amplitudes(orbit))
        rhythms.append(Rhythm(name, starts, members, copies, orbit, number, orbit.period))
    rhythms.sort(key=lambda rhythm: -rhythm.count)
    undecided = sum(len(group.members) for group in groups if group.name == UNDECIDED)
    return ValueRhythms(value, tuple(_with_angles(rhythms)), undecided, tuple(ends.tolist()))


def _name_of_state(group: EndingGroup) -> str:
    """The pattern of a periodic motion without an orbit, from its angles and rates at one moment."""
    state, omega = group.ending.state, 2 * np.pi * group.ending.returns / group.ending.period
    return rhythm_name(np.asarray(state.links - 1j * state.link_rates / omega))


def _with_angles(rhythms: Sequence[Rhythm]) -> Iterator[Rhythm]:
    """Rhythms of one name with their largest angles."""
    names = [rhythm.name for rhythm in rhythms]
    for rhythm in rhythms:
        if names.count(rhythm.name) > 1 and rhythm.orbit:
            yield replace(rhythm, name=f"{rhythm.name}, {degrees(rhythm.orbit.amplitude):.3g}°")
        else:
            yield rhythm


def _orbit_events(branches: Sequence[StableOrbits]) -> Iterator[RhythmEvent]:
    """Births and deaths of orbits."""
    for branch in branches:
        for is_birth, event in ((True, branch.birth), (False, branch.death)):
            if event:
                kind, value = event
                orbit = branch.orbits[0 if is_birth else -1]
                yield RhythmEvent(rhythm_name(orbit_amplitudes(orbit)), is_birth, kind, value)


def _sampled_events(values: Sequence[ValueRhythms], branches: Sequence[StableOrbits]) -> Iterator[RhythmEvent]:
    """Where rhythms without orbits appear and disappear: at a Neimark–Sacker point between two values, or sampled."""
    points = [end for branch in branches for end in (branch.birth, branch.death) if end and end[0] == KINDS["torus"]]
    for first, second in pairwise(values):
        before, after = ({r.name for r in value.rhythms if r.orbit is None} for value in (first, second))
        for name in sorted(before ^ after):
            near = [value for _, value in points if first.value <= value <= second.value]
            kind = KINDS["torus"] if near and name == "beat" else "sampled"
            value = near[0] if kind != "sampled" else (first.value + second.value) / 2
            between = (first.value, second.value) if kind == "sampled" else None
            yield RhythmEvent(name, name in after, kind, value, between)
