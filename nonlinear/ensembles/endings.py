"""Outcomes of many starts: each is run until its returns are conclusive, up to a limit, then they are grouped.

Runs go in rounds, each as long as all before it together: after a round the last of it is judged by
`nonlinear.synchronization.attractors`, and unsettled starts run on, as do those that repeat near no orbit or near
an unstable one.  A motion that has not settled by the limit is chaotic where its exponent is above that of
regular motion, a chimera where some of equal pendula also move as one, else undecided.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import ceil, inf, nan, pi
from typing import Any

import numpy as np

from modal.report import Displayed, finite, silent
from modal.scene import Scene
from modal.scene.parameters import Variation
from modal.types import Floats, Ints
from nonlinear.chaos.lyapunov import BLOCKS, TRANSIENT, Exponent
from nonlinear.ensembles.return_maps import OrbitSearch, ReturnMap, SectionMap, StroboscopicMap
from nonlinear.ensembles.running import Ensemble, Report, ensemble
from nonlinear.orbits.cycles import Beginning, beginnings, is_same_orbit
from nonlinear.orbits.flow import ORBIT_TOLERANCE
from nonlinear.postprocessing.returns import JUDGED_STROBES, clustered, natural_rate, natural_units
from nonlinear.synchronization.attractors import AT_REST, OPEN, PERIODIC, TORUS, Ending
from nonlinear.synchronization.phases import own_shapes
from nonlinear.system import Motion, State, motion_of, system_of, unwound

UNDECIDED, CHAOTIC = "undecided", "chaotic"
EQUAL_ANGLES_GAP = 1e-2
"""Tolerance: between largest angles (deg) that count as equal: mirror images go by their strobes."""


@dataclass(frozen=True, eq=False, repr=False)
class EndingGroup(Displayed):
    """Starts that end in one motion, or in one of `copies` that equal pendula exchange; an `ending` of them.

    `members` are their numbers; a periodic one has the `beginning` of a branch of orbits, chaos an `exponent` with half
    its 95 % interval (1/s).  The largest angle is that of any link on a motion that is driven in time, NaN if links
    turn over forever.
    """

    what, shows = "EndingGroup", "name: name; members: numbers of starts; copies: copies"

    name: str
    members: tuple[int, ...]
    ending: Ending
    copies: int = 1
    exponent: tuple[float, float] | None = None
    beginning: Beginning | None = None
    largest_angle_deg: float = nan

    def has_orbit_of(self, other: EndingGroup) -> bool:
        """Whether the orbits near both were computed, and are the same."""
        orbits = [group.beginning.orbit for group in (self, other) if group.beginning]
        return len(orbits) == 2 and is_same_orbit(*orbits)

    def record(self) -> dict[str, Any]:
        """The motion, for JSON, with a return of one of its members."""
        ending, state = self.ending, unwound(self.ending.state)
        carried = {"supports": state.supports.tolist(), "support_rates_per_s": state.support_rates.tolist()}
        return {
            "name": self.name,
            "period": ending.returns,
            "turns": list(ending.turns),
            "period_s": finite(ending.period),
            "slow_period_s": ending.slow_period,
            "copies": self.copies,
            "largest_angle_deg": finite(self.largest_angle_deg),
            "angles_deg": np.degrees(state.links).tolist(),
            "rates_deg_per_s": np.degrees(state.link_rates).tolist(),
            "cart_m": state.cart,
            "cart_rate_m_per_s": state.cart_rate,
            **(carried if len(state.supports) else {}),
        }


def drive_angle(scene: Scene) -> float:
    """The largest angle (deg) of the drives at joints."""
    return max((link.drive.angle_deg for link in scene.links() if link.drive), default=0.0)


def rhythm_starts(scene: Scene, count: int, largest_deg: float, seed: int = 7) -> Motion:
    """Starts with all pendula straight, at angles up to `largest_deg`, phases drawn evenly; the same for one `seed`.

    A pendulum with amplitude a and phase φ begins at a cos φ from rest with the rate −a ω sin φ, ω that of its slowest
    mode on a fixed support.

    >>> from modal import load
    >>> starts = rhythm_starts(load("metronomes"), 100, 52.0)
    >>> starts.links.shape, bool(np.abs(starts.links).max() < np.radians(52))
    ((100, 2), True)
    """
    system, rng = system_of(scene), np.random.default_rng(seed)
    amplitude = np.radians(largest_deg) * rng.random((count, system.n_pendula))
    phase = 2 * pi * rng.random((count, system.n_pendula))
    omega = np.empty(system.n_pendula)
    for group in system.groups:
        omega[group.pendula] = own_shapes(group, system.gravity, 1).omega[:, 0]
    pendula = system.pendulum
    links = system.rest + (amplitude * np.cos(phase))[:, pendula]
    rates = (-amplitude * omega * np.sin(phase))[:, pendula]
    still = np.zeros((count, system.first if system.structure else 0))
    return Motion(links, rates, np.zeros(count), np.zeros(count), np.zeros(count), still, still)


@dataclass
class Outcomes:
    """What starts of a scene end in, as far as rounds have shown it: `groups` of those that have settled.

    `orbit_of` finds the orbit of a periodic ending.
    """

    scene: Scene
    orbit_of: OrbitSearch
    endings: dict[int, Ending] = field(default_factory=dict)
    groups: list[EndingGroup] = field(default_factory=list)

    @cached_property
    def returns(self) -> ReturnMap:
        """By what motions are recognized."""
        return StroboscopicMap(self.scene) if self.scene.is_forced else SectionMap(self.scene)

    @property
    def others(self) -> dict[int, Ending]:
        """The endings of starts that are in no group."""
        ended = {k for group in self.groups for k in group.members}
        return {k: ending for k, ending in self.endings.items() if k not in ended}

    def add_round(self, judged: dict[int, Ending]) -> list[int]:
        """Take the endings that a round showed, and return the starts that run on."""
        previous = dict(self.endings)
        self.endings |= judged
        self._add_periodic(judged)
        return [k for k, ending in self.others.items() if k in judged and _runs_on(ending, previous.get(k))]

    def _add_periodic(self, endings: dict[int, Ending]) -> None:
        """Add periodic motions to the groups whose returns or whose orbit they have, and to new ones."""
        periodic = [k for k in endings if endings[k].kind == PERIODIC]
        labels = self._labels([endings[k] for k in periodic])
        for label in range(1, labels.max(initial=0) + 1):
            members = tuple(periodic[k] for k in np.flatnonzero(labels == label))
            first = endings[members[0]]
            labels_of_both = (self._labels([group.ending, first]) for group in self.groups)
            place = next((k for k, both in enumerate(labels_of_both) if both[0] == both[1]), None)
            if place is None:
                if (facts := self.returns.facts(first, self.orbit_of)) is None:
                    continue
                group = EndingGroup(members=(), ending=first, **facts)
                place = next((k for k, other in enumerate(self.groups) if group.has_orbit_of(other)), None)
            if place is None:
                place = len(self.groups)
                self.groups.append(group)
            self.groups[place] = replace(self.groups[place], members=(*self.groups[place].members, *members))

    def _labels(self, endings: Sequence[Ending]) -> Ints:
        """The number of the motion, from 1, to which each of these periodic motions belongs."""
        if not endings:
            return np.zeros(0, dtype=np.int64)
        still = (0,) * self.scene.n_links
        rows = zip(*((ending.record, ending.returns, ending.turns or still) for ending in endings), strict=True)
        records, repeats, turns = map(np.array, rows)
        return clustered(records, repeats, turns, self.returns.gap)[0]

    def whole(self) -> tuple[EndingGroup, ...]:
        """All groups, the most frequent first; of a scene that is driven in time by period, turns and largest angle."""
        groups = [self._with_copies(group) if group.beginning else group for group in self.groups]
        frequent = sorted(groups, key=lambda group: -len(group.members))
        groups = _in_order(groups) if self.scene.is_forced else frequent
        if rest := tuple(self.others):
            groups.append(EndingGroup(UNDECIDED, rest, self.endings[rest[0]]))
        return tuple(groups)

    def _with_copies(self, group: EndingGroup) -> EndingGroup:
        """A group with the number of copies that equal pendula exchange."""
        states = [self.endings[k].state for k in group.members]
        return replace(group, copies=-(-distinct_states(states) // group.ending.returns))


def settle(
    outcomes: Sequence[Outcomes],
    place: Ints,
    limit: float,
    members: dict[str, Any],
    *,
    may_be_chaotic: bool = True,
    folder: str | None = None,
    share: tuple[int, int] | None = None,
    report: Report = silent,
    **options: Any,
) -> Ensemble:
    """Run all starts together within `limit` (s), each of the scene of the outcomes at its `place` (S,), and sort them.

    `members` and `options` are those of `ensemble`, the former the starts, or axes over these; the scenes differ in
    numbers that `vary` lists, (S,) each.  Without `may_be_chaotic` no exponent is computed of what has not settled.
    Return the first round, which is stored in the `folder`, others below it.  A share has no outcomes before all others
    have completed a round.
    """
    returns, rounds, left = outcomes[0].returns, list[Ensemble](), np.arange(len(place))
    lists = members.get("vary") if "starts" in members else None
    lengths = round_lengths(returns.first_round, limit)
    for length in lengths:
        number = len(rounds)
        where = f"{folder}/round-{number + 1}" if folder and number else folder
        progress = _progress_of(report, number, len(lengths), len(place), len(left))
        run = returns.run(length, folder=where, report=progress, share=share, **(options | members)).require()
        rounds.append(run)
        if share and sum(chunk.size for chunk in run.chunks) < run.size:
            return rounds[0]
        running: list[int] = []
        for at, case in enumerate(outcomes):
            rows = np.flatnonzero(place[left] == at)
            judged = case.returns.endings(run, rows)
            running += case.add_round(dict(zip(left[rows].tolist(), judged, strict=True)))
        if not running:
            break
        left = np.array(sorted(running))
        states = [outcomes[place[k]].endings[k].state for k in left]
        members = {"starts": motion_of(states), "check": 0, **_numbers_at(lists, left)}
    for case in outcomes:
        case.groups += _settled_groups(case.others)
    if may_be_chaotic and isinstance(returns, SectionMap) and not share:
        states_of = {k: ending.state for case in outcomes for k, ending in case.endings.items()}

        def measured(some: list[int]) -> Exponent:
            begin, numbers = motion_of([states_of[k] for k in some]), _numbers_at(lists, np.array(some))
            return exponent_of(outcomes[0].scene, begin, limit / 2, **(options | numbers | {"check": 0}))

        _add_chaotic_groups(outcomes, measured)
    return rounds[0]


def round_lengths(first: float, limit: float) -> list[float]:
    """How long rounds of runs are (s): each as long as all before it, the last no shorter than others."""
    lengths = [first if limit >= 2 * first else limit]
    while (rest := limit - sum(lengths)) > 1e-9 * limit:
        lengths.append(sum(lengths) if rest >= 2 * sum(lengths) else rest)
    return lengths


def _progress_of(report: Report, number: int, rounds: int, size: int, left: int) -> Report:
    """The report of a round, in which half of the rest of all members is done, in the last one all of it."""
    if rounds == 1:
        return report
    start = size * (1 - 0.5**number)
    step = (size - start) / left * (1.0 if number + 1 == rounds else 0.5)
    return lambda count: report(start + step * count)


def _numbers_at(vary: Mapping[str, Floats] | None, members: Ints) -> dict[str, Any]:
    """The option of `ensemble` for these members' numbers."""
    return {"vary": {path: numbers[members] for path, numbers in vary.items()}} if vary else {}


def _runs_on(ending: Ending, previous: Ending | None) -> bool:
    """Whether a motion has to run on: neither at rest nor a torus of one slow period in this and the `previous` round.

    A motion that leaves a torus slowly looks like one, but its slow period changes from round to round.
    """
    if ending.kind == TORUS:
        periods = [each.slow_period or inf for each in (ending, previous or ending)]
        return previous is None or previous.kind != TORUS or abs(periods[0] - periods[1]) > 1e-3 * periods[0]
    return ending.kind in (OPEN, PERIODIC) and _is_finite(ending)


def orbit_near(
    scene: Scene, ending: Ending, variation: Variation | None = None, value: float | None = None
) -> Beginning | None:
    """The orbit near a periodic ending, at a value of a number where that is varied, None if there is none."""
    start = ending.state, ending.period
    return next(beginnings(scene, variation, value, start, ORBIT_TOLERANCE), None)


def _in_order(groups: list[EndingGroup]) -> list[EndingGroup]:
    """By period, turns and largest angle; equal ones by the angles of their return."""
    sizes = np.nan_to_num([group.largest_angle_deg for group in groups])
    rising = np.argsort(sizes, kind="stable")
    of_size = np.zeros(len(groups), dtype=int)
    of_size[rising] = np.cumsum(np.diff(sizes[rising], prepend=sizes[rising[:1]]) > EQUAL_ANGLES_GAP)
    keys = [
        (end.returns, any(end.turns), of_size[k], end.turns, unwound(end.state).links.tolist())
        for k, end in enumerate(group.ending for group in groups)
    ]
    return [groups[k] for k in sorted(range(len(groups)), key=keys.__getitem__)]


def _settled_groups(endings: dict[int, Ending]) -> Iterator[EndingGroup]:
    """Motions at rest, and tori by name and slow period, to a hundredth of it."""
    resting = [k for k in endings if endings[k].kind == AT_REST]
    if resting:
        yield EndingGroup(AT_REST, tuple(resting), endings[resting[0]])
    tori = [k for k in endings if endings[k].kind == TORUS]
    while tori:
        first = endings[tori[0]]
        alike = [k for k in tori if endings[k].name == first.name]
        periods = [endings[k].slow_period or 0.0 for k in alike]
        members = np.array(alike)[np.isclose(periods, first.slow_period or 0.0, rtol=1e-2, equal_nan=True)].tolist()
        tori = [k for k in tori if k not in members]
        yield EndingGroup(first.name, tuple(members), first)


def distinct_states(states: Iterable[State]) -> int:
    """Return how many of these states on the section differ by more than 0.01 rad in an angle."""
    distinct: list[Floats] = []
    for state in states:
        turned = np.concatenate((np.sin(state.links), np.cos(state.links)))
        if not any(np.abs(turned - other).max() < 1e-2 for other in distinct):
            distinct.append(turned)
    return len(distinct)


def _add_chaotic_groups(outcomes: Sequence[Outcomes], measured: Callable[[list[int]], Exponent], few: int = 8) -> None:
    """Add, of unsettled motions, chimeras and others whose exponents show chaos, as `measured` of starts.

    Of more than a `few` of a kind only so many are measured, and the others where these differ.
    """
    kinds = [
        (case, name, [k for k, ending in case.others.items() if _is_open(ending) and ending.chimera is is_chimera])
        for case in outcomes
        for is_chimera, name in ((True, "chimera"), (False, CHAOTIC))
    ]
    representatives = [k for *_, members in kinds for k in members[:few]]
    if not representatives:
        return
    common = measured(representatives)
    for case, name, members in kinds:
        exponent = common.of([representatives.index(k) for k in members[:few]])
        chaotic = exponent.members > exponent.floor
        if len(members) > few and chaotic.any() and not chaotic.all():
            exponent = measured(members)
            chaotic = exponent.members > exponent.floor
        if not chaotic.any():
            continue
        exponent = exponent.of(chaotic)
        if exponent.is_positive:
            numbers = tuple(members if chaotic.all() else np.array(members)[chaotic].tolist())
            interval = exponent.value, exponent.half_width
            case.groups.append(EndingGroup(name, numbers, case.endings[numbers[0]], 1, interval))


def _is_open(ending: Ending) -> bool:
    return ending.kind == OPEN and _is_finite(ending) and len(ending.record) >= JUDGED_STROBES


def _is_finite(ending: Ending) -> bool:
    return bool(len(ending.state.links) and np.all(np.isfinite(ending.state.links)))


def exponent_of(
    scene: Scene, starts: Motion, duration: float, *, vary: Mapping[str, Floats] | None = None, **options: Any
) -> Exponent:
    """The largest exponents λ of motions over a duration (s) after half of it, by second motions [Benettin1980a].

    Each begins 1e-6 in natural units from the first, and is brought back to that again and again, every 50 units of
    time or more often, while ln |v| gains what the distance has grown.  It is then in the direction that grows fastest;
    `vary` and `options` are those of `ensemble`, by which both run, many times faster than with tangent equations.
    """
    system, count = system_of(scene), len(starts.links)
    thirds = max(ceil(duration * natural_rate(system) / 100), BLOCKS // 2 + 1)  # each block has a part
    times = np.linspace(0.0, (1 + TRANSIENT) * duration, 3 * thirds + 1)
    first = [starts.links, starts.link_rates, starts.cart, starts.cart_rate, starts.supports, starts.support_rates]
    asides = np.random.default_rng(0).normal(size=starts.links.shape)
    second = [starts.links + 1e-6 * asides, *first[1:]]
    growth = np.empty((len(times) - 1, count))
    if vary:
        options["vary"] = {path: np.tile(numbers, 2) for path, numbers in vary.items()}
    for row, length in enumerate(np.diff(times).tolist()):
        links, rates, cart, speed, *carried = (np.concatenate(pair) for pair in zip(first, second, strict=True))
        both = Motion(links, rates, cart, speed, np.zeros(2 * count), *carried)
        ends = ensemble(scene, length, starts=both, output="end", **({"check": 0} | options)).require().states()
        record = natural_units(system, [part[None] for part in ends])[0]
        distance = np.linalg.norm(record[count:] - record[:count], axis=1) + np.finfo(float).eps
        growth[row] = np.log(distance / 1e-6)
        ends += [np.zeros((2 * count, 0))] * (len(first) - len(ends))
        first = [part[:count] for part in ends]
        second = [
            near + ((part[count:] - near).T * (1e-6 / distance)).T for part, near in zip(ends, first, strict=True)
        ]
    return Exponent(scene, times, growth, TRANSIENT * duration, np.nan)
