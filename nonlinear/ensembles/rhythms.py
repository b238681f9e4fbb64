"""Map of rhythms along a parameter: outcomes of a driven scene, their shares, and where each is born and dies.

At every value the same starts are run until they have settled (`endings`).  The orbit of a periodic motion is
followed along the number, to both sides of the value where it was found, while it is stable.  Where that ends, at a
fold, a branch point, a Neimark–Sacker point, a doubling or where a clock starts (`nonlinear.orbits.stable`), it is born
or dies.  Any other motion, a beat above all, is itself continued from value to value (`rhythm_borders`), and its end
enclosed between two values.  The share of starts that end in a rhythm has Wilson's interval [Wilson1927]:

    (p + z²/2n ± z sqrt(p(1 − p)/n + z²/4n²)) / (1 + z²/n),     z = 1.96
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import degrees, nan, sqrt
from typing import Any, NamedTuple

import numpy as np
import scipy

from modal.errors import MultipendulaError
from modal.report import Displayed, Drawable, Form, ReportTable, Result, finite
from modal.scene import Scene, describe, number_label, number_words
from modal.scene.parameters import Variation
from modal.types import Floats
from nonlinear.ensembles.endings import UNDECIDED
from nonlinear.orbits.orbit import Orbit
from nonlinear.synchronization.attractors import orbit_amplitudes
from nonlinear.synchronization.branch_report import AveragedThreshold, averaged_thresholds
from nonlinear.system import State


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
    """Where a rhythm is born or dies along the number, as that grows: at an orbit's end of a `kind` (`stable`).

    The kind is "enclosed" where a motion without an orbit was continued: it ends within the two values `between`, and
    goes over into the `successor` beyond; "undecided" where runs beyond the first of them were.
    """

    what, shows = "RhythmEvent", "name: rhythm; kind: kind; value: value"

    name: str
    is_birth: bool
    kind: str
    value: float
    between: tuple[float, float] | None = None
    successor: str = ""

    def record(self) -> dict[str, Any]:
        """For JSON."""
        what = "birth" if self.is_birth else "death"
        more = {"between": list(self.between), "successor": self.successor} if self.between else {}
        return {"name": self.name, "event": what, "kind": self.kind, "value": self.value, **more}


@dataclass(frozen=True, eq=False, repr=False)
class Rhythm(Displayed):
    """The outcome of `count` of the `total` starts at a value; `branch` is the number of its orbit's branch, from 0.

    With a count of 0 it was found by continuation.  Motions without an orbit have a `state` on it.
    """

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
    state: State | None = None

    @property
    def phases(self) -> Floats:
        """By how much pendula are ahead of the widest of them (rad), (N,), on a periodic orbit, else (0,)."""
        if self.orbit is None:
            return np.empty(0)
        eta = orbit_amplitudes(self.orbit)
        return np.asarray(np.angle(eta / eta[np.abs(eta).argmax()]))

    @property
    def share(self) -> float:
        """Its share of the starts."""
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
            "phases_deg": np.degrees(self.phases).tolist(),
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
            "by_continuation": not self.count,
            "copies": self.copies,
            "orbit": orbit,
            "period_s": finite(self.period),
            "slow_period_s": self.slow_period,
            **({"exponent_interval_per_s": exponent} if exponent else {}),
        }


def pattern_of(name: str) -> str:
    """The name of a rhythm without the number of its branch.

    >>> pattern_of("in phase, branch 2"), pattern_of("antiphase, 2 against 1")
    ('in phase', 'antiphase, 2 against 1')
    """
    return name.partition(", branch ")[0]


class ValueRhythms(NamedTuple):
    """The rhythms at a value, the most frequent first, and the group in which each start ends, -1 for undecided."""

    value: float
    rhythms: tuple[Rhythm, ...]
    undecided: int
    of_start: tuple[int, ...] = ()

    def counts(self) -> Counter[str]:
        """The numbers of starts that end in rhythms of each name, and of those that are undecided."""
        counts = Counter({UNDECIDED: self.undecided})
        for rhythm in self.rhythms:
            counts[rhythm.name] += rhythm.count
        return counts


@dataclass(frozen=True, eq=False, repr=False)
class RhythmMap(Drawable, Result):
    """The outcomes of starts along a number; `values` in its order, `births` the events, births and deaths, in order.

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
    figure = "nonlinear.plotting.ensembles:rhythm_figure"

    @property
    def averaged(self) -> tuple[AveragedThreshold, ...]:
        """Where averaged equations let steady motions begin, end or change stability; () where they have none."""
        return self._averaging[0]

    @cached_property
    def _averaging(self) -> tuple[tuple[AveragedThreshold, ...], str]:
        """These thresholds, and why averaged equations have none, "" where they take the scene."""
        few = self.variation.values[:: max(1, len(self.variation.values) // 8)]
        values = (*few[:-1], self.variation.values[-1])
        try:
            return averaged_thresholds(self.scene, replace(self.variation, values=values)), ""
        except MultipendulaError as error:
            return (), str(error)

    def distance(self, threshold: AveragedThreshold) -> float | None:
        """From a threshold of averaged equations to the nearest exact one of such a motion; None if there is none."""
        exact = []
        for event in self.births:
            change = self.change_words(event.name, event.kind, is_birth=event.is_birth)
            if threshold.words == f"{event.name.partition(',')[0]} {change}" and event.kind != UNDECIDED:
                exact.append(event.value)
        return min((value - threshold.value for value in exact), key=abs, default=None)

    @property
    def names(self) -> tuple[str, ...]:
        """The names of all rhythms, in the order of their births along the number."""
        return tuple(dict.fromkeys(rhythm.name for value in self.values for rhythm in value.rhythms))

    def shares(self, name: str) -> list[float]:
        """The share of starts that end in rhythms of a name, at every value."""
        return [sum(rhythm.share for rhythm in value.rhythms if rhythm.name == name) for value in self.values]

    def intervals(self, name: str) -> list[tuple[float, float]]:
        """The 95 % intervals of these shares."""
        return [wilson(round(share * self.members), self.members) for share in self.shares(name)]

    def by_pattern(self) -> RhythmMap:
        """The same map with branches named by their patterns alone, without numbers."""
        values = [
            value._replace(rhythms=tuple(replace(rhythm, name=pattern_of(rhythm.name)) for rhythm in value.rhythms))
            for value in self.values
        ]
        births = tuple(replace(event, name=pattern_of(event.name)) for event in self.births)
        return replace(self, values=tuple(values), births=births)

    def records(self) -> Iterator[dict[str, Any]]:
        """A row for each rhythm at each value, and for undecided starts."""
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
                    "smallest_angle_deg": degrees(orbit.amplitudes.min()) if orbit else None,
                    "largest_phase_deg": degrees(np.abs(rhythm.phases).max()) if orbit else None,
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
        columns = [number_label(self.scene, self.variation.path), *self.names, *undecided]
        rows = []
        for number, value in enumerate(self.values):
            present = {rhythm.name for rhythm in value.rhythms}
            cells = [self._share_words(name, number) if name in present else "" for name in self.names]
            rows.append(
                [f"{value.value:g}", *cells, *(f"{100 * value.undecided / self.members:.3g}" for _ in undecided)]
            )
        yield "starts (%) that end in each rhythm, with the 95 % interval:"
        yield ReportTable(columns, rows)
        cells = [cell for row in rows for cell in row[1:]]
        meanings = {
            "blank: not found there": "" in cells,
            "0: it exists, found by continuation, and no start ended in it": any(c.startswith("0 (") for c in cells),
        }
        if any(meanings.values()):
            yield "; ".join(words for words, is_present in meanings.items() if is_present)
        if words := [*map(self.event_words, self.births), *map(self._averaged_words, self.averaged)]:
            yield "\n".join(words)
        yield "\n".join(self._footnotes())

    def _share_words(self, name: str, number: int) -> str:
        """The share (%) at the value of this number, with its interval."""
        low, high = self.intervals(name)[number]
        return f"{100 * self.shares(name)[number]:.3g} ({100 * low:.3g} to {100 * high:.3g})"

    def _averaged_words(self, threshold: AveragedThreshold) -> str:
        """A sentence about a threshold of averaged equations, and how far the exact one is."""
        distance = self.distance(threshold)
        clauses = [f"Averaged, at {self._with_unit(threshold.value, 5)}: {threshold.words}", threshold.reason]
        if distance is None:
            clauses.append("no exact one was found")
        else:
            side = "above" if distance > 0 else "below"
            clauses.append(f"the nearest exact one lies {self._with_unit(abs(distance), 2)} {side}")
        return "; ".join(filter(None, clauses)) + "."

    def event_words(self, event: RhythmEvent) -> str:
        """A sentence about one of the events."""
        if event.between:
            low, high = (self._with_unit(value, 7) for value in event.between)
            if event.kind == UNDECIDED:
                return f"{event.name} is last seen between {low} and {high}: what follows is undecided."
            what, side = ("begins", "below") if event.is_birth else ("ends", "beyond")
            return f"{event.name} {what} between {low} and {high}: {side} that the motion becomes {event.successor}."
        words = self.change_words(event.name, event.kind, is_birth=event.is_birth)
        return f"{event.name} {words} at {self._with_unit(event.value, 8)} ({event.kind})."

    def _with_unit(self, value: float, digits: int) -> str:
        """A value of the number with its unit."""
        unit = self.variation.unit
        return f"{value:.{digits}g}" + ("°" if unit in ("°", "deg") else f" {unit}".rstrip())

    def change_words(self, name: str, kind: str, *, is_birth: bool) -> str:
        """What happens to a rhythm at a located event: an orbit may live on unstable, a beat ends."""
        if kind in ("Neimark–Sacker", "doubling", "branch point") and self.has_orbit(name):
            return "becomes stable" if is_birth else "loses stability"
        return "appears" if is_birth else "disappears"

    def has_orbit(self, name: str) -> bool:
        """Whether a rhythm is periodic: its orbit goes on where it loses stability."""
        return any(rhythm.orbit for value in self.values for rhythm in value.rhythms if rhythm.name == name)

    def _footnotes(self) -> Iterator[str]:
        yield _sampling_words([self])
        if any(event.between for event in self.births):
            yield "A motion that was continued, and lost between two values, may exist further on if its basin is thin."
        if reason := self._averaging[1]:
            yield f"No averaged thresholds: {reason}."
        slow = [(r.name, r.slow_period, v.value) for v in self.values for r in v.rhythms if r.slow_period]
        for name in dict.fromkeys(entry[0] for entry in slow):
            periods = [
                f"{period:.4g} s at {self._with_unit(value, 6)}" for entry, period, value in slow if entry == name
            ]
            yield f"{name}: all pendula are back in their roles after its slow period, {', '.join(periods)}."
        chaotic = [(r.name, *r.exponent, v.value) for v in self.values for r in v.rhythms if r.exponent]
        for name, exponent, half_width, value in chaotic:
            yield f"{name}: its exponent is {exponent:.3g} ± {half_width:.2g} 1/s at {self._with_unit(value, 6)}."
        for name in self.names:
            if not any(self.shares(name)):
                yield f"{name}: no start ended in it at any value; found by continuation."
            yield from self._shapes(name)

    def _shapes(self, name: str) -> Iterator[str]:
        """The phases and amplitudes at both ends of a rhythm whose name implies neither."""
        if not name.startswith(("unequal", "out of phase")):
            return
        ends = [(value.value, r) for value in self.values for r in value.rhythms if r.name == name and r.orbit]
        for value, rhythm in dict([ends[0], ends[-1]]).items() if ends else ():
            assert rhythm.orbit
            sizes = " and ".join(f"{angle:.3g}°" for angle in np.degrees(rhythm.orbit.amplitudes))
            phase = degrees(np.abs(rhythm.phases).max())
            yield f"{name}: {sizes}, up to {phase:.3g}° apart, at {self._with_unit(value, 6)}."


def _sampling_words(maps: Sequence[RhythmMap]) -> str:
    """A sentence on the starts, how long they ran, and how certain their shares are."""
    first, limit = maps[0], max(row.limit for row in maps)
    shares = {rhythm.share for row in maps for value in row.values for rhythm in value.rhythms} | {0.0}
    ends = [(share, *wilson(round(share * first.members), first.members)) for share in shares]
    error = max(max(share - low, high - share) for share, low, high in ends)
    return (
        f"{first.members} starts, the same at every value, with angles up to {first.largest_deg:g}° and random phases, "
        f"run for at most {limit:.4g} s; the 95 % intervals reach at most {100 * error:.2g} percentage points from the "
        "share."
    )


@dataclass(frozen=True, eq=False, repr=False)
class RhythmGrid(Drawable, Result):
    """Maps of rhythms along a first number, a row for each value of a second one."""

    scene: Scene
    axes: tuple[Variation, Variation]
    maps: tuple[RhythmMap, ...]

    what, key = "map of rhythms", "rows"
    figure = "nonlinear.plotting.ensembles:grid_figure"

    @property
    def names(self) -> tuple[str, ...]:
        """The names of all rhythms."""
        return tuple(dict.fromkeys(name for row in self.maps for name in row.names))

    def borders(self) -> dict[tuple[str, str, bool], list[list[tuple[float, float]]]]:
        """Births and deaths that were computed, by rhythm, kind and which of them: lines through adjacent rows.

        Each is a list of (first number, second number); of several in a row each goes on at one of the next, so that
        the lines are shortest together.
        """
        lines: dict[tuple[str, str, bool], list[list[tuple[float, float]]]] = {}
        for number, (value, row) in enumerate(zip(self.axes[1].values, self.maps, strict=True)):
            previous = self.axes[1].values[number - 1]
            for key in dict.fromkeys((event.name, event.kind, event.is_birth) for event in row.births):
                places = [event.value for event in row.births if (event.name, event.kind, event.is_birth) == key]
                chains = lines.setdefault(key, [])
                open_chains = [chain for chain in chains if chain[-1][1] == previous]
                gaps = [[abs(chain[-1][0] - place) for place in places] for chain in open_chains]
                pairs = zip(*scipy.optimize.linear_sum_assignment(gaps), strict=True) if gaps else ()
                nearest = {at: open_chains[chain] for chain, at in pairs}
                for at, place in enumerate(places):
                    chain = nearest.get(at, [])
                    chain.append((place, value))
                    chains += [chain] if len(chain) == 1 else []
        return {key: chains for key, chains in lines.items() if key[1] != UNDECIDED}

    def records(self) -> Iterator[dict[str, Any]]:
        """The records of all rows, with the second number."""
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
        across = number_label(self.scene, first.path)
        yield f"The rhythm in which most starts end, with its share (%); across: {across}."
        columns = [number_label(self.scene, second.path), *(f"{value:g}" for value in first.values)]
        cells = [
            [f"{value:g}", *(_most_words(at, row.members) for at in row.values)]
            for value, row in zip(second.values, self.maps, strict=True)
        ]
        yield ReportTable(columns, cells)
        yield _sampling_words(self.maps)
        for value, row in zip(second.values, self.maps, strict=True):
            if row.births:
                words = " ".join(map(row.event_words, row.births))
                yield f"{number_words(self.scene, second.path)} = {value:g}{f' {second.unit}'.rstrip()}: {words}"


def _most_words(at: ValueRhythms, members: int) -> str:
    """The most frequent outcomes at a value, with their share (%), and how many are undecided."""
    frequent = [(name, count) for name, count in at.counts().most_common() if count]
    largest = max((count for name, count in frequent if name != UNDECIDED), default=0)
    words = [f"{name} {100 * count / members:.3g}" for name, count in frequent if name == UNDECIDED or count == largest]
    return f"{words[0]} ({', '.join(words[1:])})" if len(words) > 1 else words[0]
