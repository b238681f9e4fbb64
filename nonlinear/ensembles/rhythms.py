"""The map of rhythms: along a number, what a scene with drives can end in, how often, and where each is born and dies.

At every value the same starts are run until they tell what they end in (`endings`).  The orbit of a periodic motion is
followed along the number, to both sides of the value where it was found, while it is stable.  Where that ends, at a
fold, a branch point, a Neimark–Sacker point or a doubling, it is born or dies.  The share of starts that end in a
rhythm has Wilson's interval [Wilson1927]:

    (p + z²/2n ± z sqrt(p(1 − p)/n + z²/4n²)) / (1 + z²/n),     z = 1.96
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from hashlib import sha256
from itertools import pairwise
from math import degrees, nan, sqrt
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from modal.errors import MultipendulaError, SceneError
from modal.report import Displayed, Drawable, Form, ReportTable, Result, finite, silent
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
from nonlinear.ensembles.sections import MEMBERS_MAX
from nonlinear.ensembles.store import ChunkFolder
from nonlinear.orbits.continuation import STEP_MAX, OrbitPoint, at_edge, follow, tangent_of, with_values
from nonlinear.orbits.cycles import Beginning, beginnings, is_same_orbit, require_cycles
from nonlinear.orbits.flow import ORBIT_TOLERANCE
from nonlinear.orbits.orbit import Orbit
from nonlinear.orbits.special import along_cycles, bisect
from nonlinear.synchronization.attractors import PERIODIC, Ending, orbit_amplitudes
from nonlinear.synchronization.patterns import rhythm_name
from nonlinear.synchronization.report import AveragedThreshold, averaged_thresholds
from nonlinear.system import Motion, State

if TYPE_CHECKING:
    from collections.abc import Mapping

KINDS = {"torus": "Neimark–Sacker", "period doubling": "doubling"}
"""What events of orbits are called here."""


def wilson(count: int, total: int) -> tuple[float, float]:
    """The 95 % interval of a share of which `count` of `total` were counted.

    >>> tuple(round(end, 4) for end in wilson(0, 300)), tuple(round(end, 4) for end in wilson(150, 300))
    ((0.0, 0.0126), (0.4438, 0.5562))
    """
    z, p = 1.959963984540054, count / total
    middle, width = p + z * z / (2 * total), z * sqrt(p * (1 - p) / total + z * z / (4 * total**2))
    low, high = (middle - width) / (1 + z * z / total), (middle + width) / (1 + z * z / total)
    return max(low, 0.0) if count else 0.0, min(high, 1.0) if count < total else 1.0


@dataclass(frozen=True, eq=False, repr=False)
class RhythmEvent(Displayed):
    """Where a rhythm is born or dies along the number, as that grows: at an orbit's special point of a `kind`.

    The kind is "sampled" where nothing was computed: the `value` lies within the two values `between`.
    """

    what, shows = "RhythmEvent", "name: rhythm; kind: kind; value: value"

    name: str
    is_birth: bool
    kind: str
    value: float
    between: tuple[float, float] | None = None

    def record(self) -> dict[str, Any]:
        """For JSON."""
        what = "birth" if self.is_birth else "death"
        more = {"between": list(self.between)} if self.between else {}
        return {"name": self.name, "event": what, "kind": self.kind, "value": self.value, **more}


@dataclass(frozen=True, eq=False, repr=False)
class StableOrbits(Displayed):
    """A stable orbit at the values of the number between its birth and its death, None where the range ends before."""

    what, shows = "StableOrbits", "birth: birth; death: death"

    orbits: tuple[Orbit, ...]
    birth: tuple[str, float] | None
    death: tuple[str, float] | None

    def at(self, value: float) -> Orbit | None:
        """The orbit at one of the values of the map."""
        near = [orbit for orbit in self.orbits if np.isclose(orbit.value or 0.0, value, rtol=1e-9, atol=0)]
        return near[0] if near else None


@dataclass(frozen=True, eq=False, repr=False)
class Rhythm(Displayed):
    """What `count` of the `total` starts end in at a value; `branch` is the number of its orbit's branch, from 0."""

    what, shows = "Rhythm", "name: name; share: share of starts"

    name: str
    count: int
    total: int
    copies: int = 1
    orbit: Orbit | None = None
    branch: int | None = None
    period: float = nan
    slow_period: float | None = None
    exponent: tuple[float, float] | None = None

    @property
    def share(self) -> float:
        """Of the starts."""
        return self.count / self.total

    @property
    def interval(self) -> tuple[float, float]:
        """The 95 % interval of the share."""
        return wilson(self.count, self.total)

    def record(self) -> dict[str, Any]:
        """For JSON."""
        orbit = self.orbit and {
            "period_s": self.orbit.period,
            "amplitudes_deg": np.degrees(self.orbit.amplitudes).tolist(),
            "stable": self.orbit.is_stable,
            "largest_multiplier": float(np.abs(self.orbit.floquet.others).max(initial=0.0)),
            "branch": self.branch,
        }
        exponent = self.exponent and [self.exponent[0] - self.exponent[1], self.exponent[0] + self.exponent[1]]
        return {
            "name": self.name,
            "share": self.share,
            "interval": list(self.interval),
            "starts": self.count,
            "copies": self.copies,
            "orbit": orbit,
            "period_s": finite(self.period),
            "slow_period_s": self.slow_period,
            **({"exponent_interval_per_s": exponent} if exponent else {}),
        }


class ValueRhythms(NamedTuple):
    """The rhythms at a value, the most frequent first, and which rhythm each start ends in, -1 for undecided."""

    value: float
    rhythms: tuple[Rhythm, ...]
    undecided: int
    of_start: tuple[int, ...]


@dataclass(frozen=True, eq=False, repr=False)
class RhythmMap(Drawable, Result):
    """What starts end in along a number; `values` in its order, `births` the events, births and deaths, in order.

    `members` starts have angles up to `largest_deg`; none ran longer than `limit` (s).
    """

    scene: Scene
    variation: Variation
    values: tuple[ValueRhythms, ...]
    births: tuple[RhythmEvent, ...]
    members: int
    largest_deg: float
    limit: float
    seed: int

    what, key = "map of rhythms", "values"
    figure = "nonlinear.plotting.rhythms:rhythm_figure"

    @cached_property
    def averaged(self) -> tuple[AveragedThreshold, ...]:
        """Where averaged equations let steady motions begin, end or change stability; () where they have none."""
        few = self.variation.values[:: max(1, len(self.variation.values) // 8)]
        values = (*few[:-1], self.variation.values[-1])
        try:
            return averaged_thresholds(self.scene, replace(self.variation, values=values))
        except MultipendulaError:
            return ()

    def distance(self, threshold: AveragedThreshold) -> float | None:
        """From a threshold of averaged equations to the nearest computed birth or death; None where there is none."""
        exact = [event.value for event in self.births if not event.between]
        return min((value - threshold.value for value in exact), key=abs, default=None)

    @property
    def names(self) -> tuple[str, ...]:
        """Of all rhythms, in the order of their births along the number."""
        return tuple(dict.fromkeys(rhythm.name for value in self.values for rhythm in value.rhythms))

    def shares(self, name: str) -> list[float]:
        """The share of starts that end in rhythms of a name, at every value."""
        return [sum(rhythm.share for rhythm in value.rhythms if rhythm.name == name) for value in self.values]

    def intervals(self, name: str) -> list[tuple[float, float]]:
        """The 95 % intervals of these shares."""
        return [wilson(round(share * self.members), self.members) for share in self.shares(name)]

    def records(self) -> Iterator[dict[str, Any]]:
        """A row for each rhythm at each value, and for what is undecided."""
        for value in self.values:
            at = {self.variation.column: value.value}
            for rhythm in value.rhythms:
                low, high = rhythm.interval
                orbit = rhythm.orbit
                yield at | {
                    "name": rhythm.name,
                    "share": rhythm.share,
                    "share_low": low,
                    "share_high": high,
                    "copies": rhythm.copies,
                    "period_s": finite(rhythm.period),
                    "slow_period_s": rhythm.slow_period,
                    "largest_angle_deg": degrees(orbit.amplitude) if orbit else None,
                    "stable": orbit.is_stable if orbit else None,
                }

    def whole(self) -> dict[str, Any]:
        """The contents of JSON."""
        return {
            "scene": describe(self.scene),
            "vary": self.variation.path,
            "unit": self.variation.unit,
            "members": self.members,
            "largest_start_deg": self.largest_deg,
            "limit_s": self.limit,
            "seed": self.seed,
            "values": [
                {
                    "value": value.value,
                    "rhythms": [rhythm.record() for rhythm in value.rhythms],
                    "undecided": value.undecided / self.members,
                }
                for value in self.values
            ],
            "births": [event.record() for event in self.births],
            "averaged": [{**each._asdict(), "distance": self.distance(each)} for each in self.averaged],
        }

    def parts(self, form: Form = "text") -> Iterator[ReportTable | str]:
        """The shares at every value, then births and deaths."""
        undecided = [UNDECIDED] * any(value.undecided for value in self.values)
        columns = [f"{self.variation.path} ({self.variation.unit or '–'})", *self.names, *undecided]
        rows = []
        for number, value in enumerate(self.values):
            present = {rhythm.name for rhythm in value.rhythms}
            cells = [f"{100 * self.shares(name)[number]:.3g}" if name in present else "" for name in self.names]
            rows.append(
                [f"{value.value:g}", *cells, *(f"{100 * value.undecided / self.members:.3g}" for _ in undecided)]
            )
        yield "starts (%) that end in each rhythm:\n"
        yield ReportTable(columns, rows)
        if any("" in row or "0" in row for row in rows):
            yield "blank: not found there; 0: it exists, and no start ended in it"
        yield "\n".join([*map(self.event_words, self.births), *map(self._averaged_words, self.averaged)])
        yield "\n".join(self._footnotes())

    def _averaged_words(self, threshold: AveragedThreshold) -> str:
        """A sentence about a threshold of averaged equations, and how far the exact one is."""
        distance, unit = self.distance(threshold), f" {self.variation.unit}" * bool(self.variation.unit)
        clauses = [f"Averaged, at {threshold.value:.6g}{unit}: {threshold.words}", threshold.reason]
        if distance is not None:
            clauses.append(f"the nearest birth or death is {distance:+.2g}{unit} from there")
        return "; ".join(filter(None, clauses)) + "."

    def event_words(self, event: RhythmEvent) -> str:
        """A sentence about one of the events."""
        what, unit = "is born" if event.is_birth else "dies", f" {self.variation.unit}".rstrip()
        if event.between:
            return f"{event.name} {what} between {event.between[0]:g} and {event.between[1]:g}{unit}, not computed."
        return f"{event.name} {what} at {event.value:.8g}{unit}: {event.kind}."

    def _footnotes(self) -> Iterator[str]:
        yield _sampling_words([self])
        slow = [(r.name, r.slow_period, v.value) for v in self.values for r in v.rhythms if r.slow_period]
        for name in dict.fromkeys(entry[0] for entry in slow):
            periods = [f"{period:.4g} s at {value:g}" for entry, period, value in slow if entry == name]
            yield f"{name}: its slow period is {', '.join(periods)}{f' {self.variation.unit}'.rstrip()}."


def _sampling_words(maps: Sequence[RhythmMap]) -> str:
    """A sentence on the starts, how long they ran, and how certain their shares are."""
    first, limit = maps[0], max(row.limit for row in maps)
    shares = {rhythm.share for row in maps for value in row.values for rhythm in value.rhythms} | {0.0}
    ends = [(share, *wilson(round(share * first.members), first.members)) for share in shares]
    error = max(max(share - low, high - share) for share, low, high in ends)
    return (
        f"{first.members} starts at each value, the same at all, with angles up to {first.largest_deg:g}° and random "
        f"phases, run for at most {limit:.4g} s; shares are certain to {100 * error:.2g} % at worst (95 %)."
    )


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
        """The stable orbit that a group ends in, None where there is none."""
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
    """The rhythms of a scene with drives along a number: shares, orbits, births and deaths.

    At each value the same `members` starts, drawn by `seed` with angles up to `largest_deg`, by default twice the
    drives' angle, run until they have settled, at most for `limit` (s), by default 2,048 periods of the slowest
    pendulum.  Values that are done are kept in a `folder`, where a call that was killed goes on; a `crew` computes them
    together.  `report` is called with the number of values done.  SceneError for a scene without limit cycles.
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
    branches = _branches(variation, [orbits for _, orbits in parts], crew)
    values = tuple(
        _value_of(value, groups, orbits, branches, members)
        for value, (groups, orbits) in zip(variation.values, parts, strict=True)
    )
    events = (*_orbit_events(variation, values, branches), *_sampled_events(variation, values, branches))
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
    header, columns = _kept(groups)
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


def _kept(groups: Sequence[EndingGroup]) -> tuple[dict[str, Any], dict[str, Any]]:
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


# ------------------------------------------------------------------------------------------------------- two numbers


@dataclass(frozen=True, eq=False, repr=False)
class RhythmGrid(Drawable, Result):
    """Maps of rhythms along a first number, a row for each value of a second one."""

    scene: Scene
    axes: tuple[Variation, Variation]
    maps: tuple[RhythmMap, ...]

    what, key = "map of rhythms", "rows"
    figure = "nonlinear.plotting.rhythms:grid_figure"

    @property
    def names(self) -> tuple[str, ...]:
        """Of all rhythms."""
        return tuple(dict.fromkeys(name for row in self.maps for name in row.names))

    def borders(self) -> dict[tuple[str, str, bool], list[list[tuple[float, float]]]]:
        """Births and deaths that were computed, by rhythm, kind and which of them: lines through adjacent rows.

        Each is a list of (first number, second number); of several in a row those nearest to each other are joined.
        """
        lines: dict[tuple[str, str, bool], list[list[tuple[float, float]]]] = {}
        low, high = self.axes[0].values[0], self.axes[0].values[-1]
        previous = None
        for value, row in zip(self.axes[1].values, self.maps, strict=True):
            for event in row.births:
                if event.between:
                    continue
                chains = lines.setdefault((event.name, event.kind, event.is_birth), [])
                open_chains = [chain for chain in chains if chain[-1][1] == previous]
                near = min(open_chains, key=partial(_distance, event.value), default=None)
                if near and abs(near[-1][0] - event.value) < (high - low) / 4:
                    near.append((event.value, value))
                else:
                    chains.append([(event.value, value)])
            previous = value
        return lines

    def records(self) -> Iterator[dict[str, Any]]:
        """Those of all rows, with the second number."""
        for value, row in zip(self.axes[1].values, self.maps, strict=True):
            for record in row.records():
                yield {self.axes[1].column: value} | record

    def whole(self) -> dict[str, Any]:
        """The contents of JSON."""
        rows = [row.whole() for row in self.maps]
        own = ("values", "births", "averaged", "limit_s", "largest_start_deg")
        shared = {name: entry for name, entry in rows[0].items() if name not in own}
        second = {"path": self.axes[1].path, "unit": self.axes[1].unit}
        rows = [
            {"value": value, **{name: row[name] for name in own}}
            for value, row in zip(self.axes[1].values, rows, strict=True)
        ]
        return shared | {"scene": describe(self.scene), "and": second, "rows": rows}

    def parts(self, form: Form = "text") -> Iterator[ReportTable | str]:
        """The rhythm in which most starts end at every pair of values, or that most are undecided."""
        first, second = self.axes
        yield f"the rhythm in which most starts end, with its share (%), {first.path} ({first.unit or '–'}) across:\n"
        columns = [f"{second.path} ({second.unit or '–'})", *(f"{value:g}" for value in first.values)]
        cells = [
            [f"{value:g}", *(_most_words(at, row.members) for at in row.values)]
            for value, row in zip(second.values, self.maps, strict=True)
        ]
        yield ReportTable(columns, cells)
        yield _sampling_words(self.maps)
        for value, row in zip(second.values, self.maps, strict=True):
            if row.births:
                words = " ".join(map(row.event_words, row.births))
                yield f"{second.path} = {value:g}{f' {second.unit}'.rstrip()}: {words}"


def _most_words(at: ValueRhythms, members: int) -> str:
    """What most starts end in at a value, with its share (%), and how many are undecided."""
    shares = [(rhythm.count, rhythm.name) for rhythm in at.rhythms[:1] if rhythm.count] + [(at.undecided, UNDECIDED)]
    most, *others = sorted((share for share in shares if share[0]), key=lambda share: -share[0])
    words = [f"{name} {100 * count / members:.3g}" for count, name in (most, *others)]
    return f"{words[0]} ({words[1]})" if others else words[0]


def _distance(value: float, chain: list[tuple[float, float]]) -> float:
    """Of the last point of a border from a value."""
    return abs(chain[-1][0] - value)


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


# ------------------------------------------------------------------------------------------------------- orbits


def _branches(
    variation: Variation, orbits: Sequence[Sequence[Beginning | None]], crew: Crew | None
) -> list[StableOrbits]:
    """The stable orbits of all values, each followed once."""
    branches: list[StableOrbits] = []
    for value, here in zip(variation.values, orbits, strict=True):
        new: list[Beginning] = []
        for beginning in here:
            if beginning is None or not beginning.orbit.is_stable:
                continue
            known = [branch.at(value) for branch in branches] + [other.orbit for other in new]
            if not any(orbit and is_same_orbit(beginning.orbit, orbit) for orbit in known):
                new.append(beginning)
        branches += map_by_crew(stable_orbits, new, crew)
    return branches


def stable_orbits(beginning: Beginning) -> StableOrbits:
    """The orbit of a beginning, followed to both sides along its number while it is stable and found."""
    problem = beginning.problem
    down, birth = _followed(beginning, -1.0)
    up, death = _followed(beginning, 1.0)
    assert problem.variation
    points = with_values(problem, [*down[:0:-1], *up], problem.variation)
    return StableOrbits(tuple(point.orbit for point in points), birth, death)


def _followed(beginning: Beginning, direction: float) -> tuple[list[OrbitPoint], tuple[str, float] | None]:
    """The points of stable orbits to one side, and the kind and value of the event that ends them."""
    problem, u = beginning.problem, beginning.u
    towards = np.append(np.zeros(len(u) - 1), direction)
    points = [OrbitPoint(u, tangent_of(problem.equations(u)[1], towards), beginning.orbit)]
    if not 0 < u[-1] + 1e-9 * direction < 1:
        return points, None
    for current in follow(problem, points[0], step=STEP_MAX / 5, longest=STEP_MAX):
        if current is points[0]:
            continue
        is_inside = 0 < current.u[-1] < 1
        following = current if is_inside else at_edge(problem, points[-1], current)
        if not following.orbit.is_stable:
            return _ended(beginning, points, following)
        points.append(following)
        if not is_inside:
            return points, None
    return points, None  # Newton's method lost it: no event is known


def _ended(
    beginning: Beginning, points: list[OrbitPoint], unstable: OrbitPoint
) -> tuple[list[OrbitPoint], tuple[str, float]]:
    """The points to the event between a stable orbit and an unstable one, its kind and its value."""
    problem = beginning.problem
    specials = [special for special in along_cycles(problem, [points[-1], unstable]) if special.kind != "collision"]
    if specials:
        point, kind = specials[0].point, specials[0].kind
    else:  # equal multipliers that pass together
        point = bisect(problem, points[-1], unstable, lambda place: place.orbit.is_stable)
        others = point.orbit.floquet.others
        largest = others[np.abs(others).argmax()]
        kind = "torus" if abs(largest.imag) > abs(largest.real) * 1e-6 else "branch point"
        kind = "period doubling" if kind == "branch point" and largest.real < 0 else kind
    return [*points, point], (KINDS.get(kind, kind), nan if point.orbit.value is None else float(point.orbit.value))


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
    return ValueRhythms(value, tuple(_distinguished(rhythms)), undecided, tuple(ends.tolist()))


def _name_of_state(group: EndingGroup) -> str:
    """The pattern of a periodic motion without an orbit, from its angles and rates at one moment."""
    state, omega = group.ending.state, 2 * np.pi * group.ending.returns / group.ending.period
    return rhythm_name(np.asarray(state.links - 1j * state.link_rates / omega))


def _distinguished(rhythms: Sequence[Rhythm]) -> Iterator[Rhythm]:
    """Rhythms of one name with their largest angles."""
    names = [rhythm.name for rhythm in rhythms]
    for rhythm in rhythms:
        if names.count(rhythm.name) > 1 and rhythm.orbit:
            yield replace(rhythm, name=f"{rhythm.name}, {degrees(rhythm.orbit.amplitude):.3g}°")
        else:
            yield rhythm


# ------------------------------------------------------------------------------------------------------- births


def _orbit_events(
    variation: Variation, values: Sequence[ValueRhythms], branches: Sequence[StableOrbits]
) -> Iterator[RhythmEvent]:
    """Births and deaths of orbits."""
    for branch in branches:
        for is_birth, event in ((True, branch.birth), (False, branch.death)):
            if event:
                kind, value = event
                orbit = branch.orbits[0 if is_birth else -1]
                yield RhythmEvent(rhythm_name(orbit_amplitudes(orbit)), is_birth, kind, value)


def _sampled_events(
    variation: Variation, values: Sequence[ValueRhythms], branches: Sequence[StableOrbits]
) -> Iterator[RhythmEvent]:
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
