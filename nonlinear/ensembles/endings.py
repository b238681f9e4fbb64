"""Outcomes of many starts: each is run until its returns are conclusive, up to a limit, then they are grouped.

Runs go in rounds, each as long as all before it together: after a round the last of it is judged by
`nonlinear.synchronization.attractors`, and unsettled starts run on, as do those that repeat near no orbit or near
an unstable one.  A motion that has not settled by the limit is chaotic where its exponent is above that of
regular motion, a chimera where some of equal pendula also move as one, else undecided.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from math import ceil, nan, pi
from typing import Any

import numpy as np

from modal.report import Displayed, finite, silent
from modal.scene import Scene
from modal.scene.parameters import Variation
from modal.types import Floats, Ints
from nonlinear.chaos.lyapunov import BLOCKS, TRANSIENT, Exponent
from nonlinear.ensembles.return_maps import OrbitSearch, SectionMap, StroboscopicMap, return_map, within_a_turn
from nonlinear.ensembles.running import Ensemble, Report, ensemble
from nonlinear.orbits.cycles import Beginning, beginnings, is_same_orbit
from nonlinear.orbits.flow import ORBIT_TOLERANCE
from nonlinear.postprocessing.returns import clustered, natural_rate, natural_units
from nonlinear.synchronization.attractors import AT_REST, OPEN, PERIODIC, TORUS, Ending
from nonlinear.synchronization.phases import own_shapes
from nonlinear.system import Motion, State, motion_of, system_of

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

    def record(self) -> dict[str, Any]:
        """The motion, for JSON, with a return of one of its members."""
        ending, state = self.ending, within_a_turn(self.ending.state)
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


def groups_of(
    scene: Scene,
    starts: Motion,
    limit: float,
    orbit_of: OrbitSearch,
    *,
    may_be_chaotic: bool = True,
    **options: Any,
) -> tuple[EndingGroup, ...]:
    """The outcomes of these starts within `limit` (s), the most frequent first, as `find_endings` finds them."""
    members = {"starts": starts, "check": 0}
    return find_endings(scene, members, limit, orbit_of, may_be_chaotic=may_be_chaotic, **options)[1]


def find_endings(
    scene: Scene,
    members: dict[str, Any],
    limit: float,
    orbit_of: OrbitSearch | None = None,
    *,
    may_be_chaotic: bool = True,
    folder: str | None = None,
    report: Report = silent,
    **options: Any,
) -> tuple[Ensemble, tuple[EndingGroup, ...]]:
    """The first round of runs of `members`, and their outcomes within a `limit` (s).

    `members` and `options` are those of `ensemble`, the former with starts or what varies.  `orbit_of` finds the orbit
    of a periodic ending; without `may_be_chaotic` no exponent is computed of what has not settled.  The first round is
    stored in the `folder`, others below it.  A share has no outcomes before all others have completed a round.
    """
    returns, search = return_map(scene), orbit_of or partial(orbit_near, scene)
    lengths, rounds = round_lengths(returns.first_round, limit), list[Ensemble]()
    endings, groups, left = dict[int, Ending](), list[EndingGroup](), list[int]()
    for length in lengths:
        number = len(rounds)
        place = f"{folder}/round-{number + 1}" if folder and number else folder
        progress = _progress_of(report, number, len(lengths), rounds[0].size if rounds else 1, len(left) or 1)
        run = returns.run(length, folder=place, report=progress, **members, **options).require()
        rounds.append(run)
        if options.get("share") and not run.is_complete:
            return rounds[0], ()
        left = left or [*range(run.size)]
        endings |= zip(left, returns.endings(run), strict=True)
        _add_periodic_groups(groups, {k: endings[k] for k in left}, returns, search)
        ended = {k for group in groups for k in group.members}
        left = [k for k in left if k not in ended and _runs_on(endings[k])]
        if not left:
            break
        members = {"starts": motion_of([endings[k].state for k in left]), "check": 0}
    others = {k: ending for k, ending in endings.items() if not any(k in group.members for group in groups)}
    groups += _settled_groups(others)
    if may_be_chaotic and not scene.is_forced:
        groups += _chaotic_groups(scene, others, limit / 2, options)
    groups = [_with_copies(group, endings) if group.beginning else group for group in _in_order(groups, scene)]
    if rest := tuple(k for k in endings if not any(k in group.members for group in groups)):
        groups.append(EndingGroup(UNDECIDED, rest, endings[rest[0]]))
    return rounds[0], tuple(groups)


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
    begun = size * (1 - 0.5**number)
    each = (size - begun) / left * (1.0 if number + 1 == rounds else 0.5)
    return lambda done: report(begun + each * done)


def _runs_on(ending: Ending) -> bool:
    """Whether a motion has to run on: neither at rest nor a torus, nor seen to be a chimera."""
    return ending.kind in (OPEN, PERIODIC) and not ending.chimera and _is_finite(ending)


def _add_periodic_groups(
    groups: list[EndingGroup], endings: dict[int, Ending], returns: SectionMap | StroboscopicMap, orbit_of: OrbitSearch
) -> None:
    """Add periodic motions to the groups whose returns or whose orbit they have, and to new ones."""
    left = [k for k in endings if endings[k].kind == PERIODIC]
    while left:
        labels = _labels([endings[k] for k in left], returns)
        for label in range(1, labels.max() + 1):
            members = tuple(left[k] for k in np.flatnonzero(labels == label))
            first = endings[members[0]]
            alike = (k for k, group in enumerate(groups) if _labels([group.ending, first], returns)[1] == 1)
            if (place := next(alike, None)) is None:
                if (facts := returns.facts(first, orbit_of)) is None:
                    continue
                group = EndingGroup(members=(), ending=first, **facts)
                place = next((k for k, other in enumerate(groups) if _have_one_orbit(group, other)), len(groups))
                groups += [group] * (place == len(groups))
            groups[place] = replace(groups[place], members=(*groups[place].members, *members))
        left = [left[k] for k in np.flatnonzero(labels == 0)]  # of more motions than are distinguished at once


def _labels(endings: list[Ending], returns: SectionMap | StroboscopicMap) -> Ints:
    """The number of the motion, from 1, to which each of these periodic motions belongs."""
    still = (0,) * returns.scene.n_links
    records, repeats = np.array([ending.record for ending in endings]), [ending.returns for ending in endings]
    turns = np.array([ending.turns or still for ending in endings])
    return clustered(records, np.array(repeats), turns, returns.gap)[0]


def _have_one_orbit(group: EndingGroup, other: EndingGroup) -> bool:
    """Whether orbits near two groups were computed, and are the same."""
    orbits = [each.beginning.orbit for each in (group, other) if each.beginning]
    return len(orbits) == 2 and is_same_orbit(*orbits)


def _with_copies(group: EndingGroup, endings: dict[int, Ending]) -> EndingGroup:
    """A group with the number of copies that equal pendula exchange."""
    return replace(group, copies=-(-distinct_states([endings[k].state for k in group.members]) // group.ending.returns))


def orbit_near(
    scene: Scene, ending: Ending, variation: Variation | None = None, value: float | None = None
) -> Beginning | None:
    """The orbit near a periodic ending, at a value of a number where that is varied, None if there is none."""
    start = ending.state, ending.period
    return next(beginnings(scene, variation, value, start, ORBIT_TOLERANCE), None)


def _in_order(groups: list[EndingGroup], scene: Scene) -> list[EndingGroup]:
    """The most frequent first; of a scene that is driven in time by period, turns and largest angle.

    Equal ones of the latter are in the order of the angles of their return.
    """
    if not scene.is_forced:
        return sorted(groups, key=lambda group: -len(group.members))
    sizes = np.nan_to_num([group.largest_angle_deg for group in groups])
    rising = np.argsort(sizes, kind="stable")
    of_size = np.zeros(len(groups), dtype=int)
    of_size[rising] = np.cumsum(np.diff(sizes[rising], prepend=sizes[rising[:1]]) > EQUAL_ANGLES_GAP)
    keys = [
        (end.returns, any(end.turns), of_size[k], end.turns, within_a_turn(end.state).links.tolist())
        for k, end in enumerate(group.ending for group in groups)
    ]
    return [groups[k] for k in sorted(range(len(groups)), key=keys.__getitem__)]


def _settled_groups(endings: dict[int, Ending]) -> Iterator[EndingGroup]:
    """Motions at rest, and tori by name and slow period."""
    resting = [k for k in endings if endings[k].kind == AT_REST]
    if resting:
        yield EndingGroup(AT_REST, tuple(resting), endings[resting[0]])
    tori = [k for k in endings if endings[k].kind == TORUS]
    while tori:
        first = endings[tori[0]]
        members = [
            k for k in tori if endings[k].name == first.name and _near(endings[k].slow_period, first.slow_period)
        ]
        tori = [k for k in tori if k not in members]
        yield EndingGroup(first.name, tuple(members), first)


def _near(period: float | None, other: float | None) -> bool:
    """Whether two slow periods differ by no more than a hundredth."""
    return bool(np.isclose(period or 0.0, other or 0.0, rtol=1e-2))


def distinct_states(states: Iterable[State]) -> int:
    """Return how many of these states on the section differ by more than 0.01 rad in an angle."""
    seen: list[Floats] = []
    for state in states:
        turned = np.concatenate((np.sin(state.links), np.cos(state.links)))
        if not any(np.abs(turned - other).max() < 1e-2 for other in seen):
            seen.append(turned)
    return len(seen)


def _chaotic_groups(
    scene: Scene, endings: dict[int, Ending], duration: float, options: dict[str, Any]
) -> Iterator[EndingGroup]:
    """Among unsettled motions, chimeras and other motions whose exponents over a duration (s) show chaos."""
    measured = [k for k, ending in endings.items() if ending.kind == OPEN and _is_finite(ending)]
    if not measured:
        return
    exponent = exponent_of(scene, motion_of([endings[k].state for k in measured]), duration, **options)
    is_chaotic = exponent.members > exponent.floor
    for is_chimera, name in ((True, "chimera"), (False, CHAOTIC)):
        rows = [j for j, k in enumerate(measured) if endings[k].chimera is is_chimera and is_chaotic[j]]
        part = replace(exponent, growth=exponent.growth[:, rows])
        if rows and part.is_positive:
            members = tuple(measured[j] for j in rows)
            yield EndingGroup(name, members, endings[members[0]], 1, (part.value, part.half_width))


def _is_finite(ending: Ending) -> bool:
    return bool(len(ending.state.links) and np.all(np.isfinite(ending.state.links)))


def exponent_of(scene: Scene, starts: Motion, duration: float, **options: Any) -> Exponent:
    """The largest exponents λ of motions over a duration (s) after half of it, by second motions [Benettin1980a].

    Each begins 1e-6 in natural units from the first, and is brought back to that again and again, every 50 units of
    time or more often, while ln |v| gains what the distance has grown.  It is then in the direction that grows fastest;
    `options` are those of `ensemble`, by which both run, many times faster than with tangent equations.
    """
    system, count = system_of(scene), len(starts.links)
    thirds = max(ceil(duration * natural_rate(system) / 100), BLOCKS // 2 + 1)  # each block has a part
    times = np.linspace(0.0, (1 + TRANSIENT) * duration, 3 * thirds + 1)
    first = [starts.links, starts.link_rates, starts.cart, starts.cart_rate, starts.supports, starts.support_rates]
    asides = np.random.default_rng(0).normal(size=starts.links.shape)
    second = [starts.links + 1e-6 * asides, *first[1:]]
    growth = np.empty((len(times) - 1, count))
    for row, length in enumerate(np.diff(times).tolist()):
        links, rates, cart, speed, *carried = (np.concatenate(pair) for pair in zip(first, second, strict=True))
        both = Motion(links, rates, cart, speed, np.zeros(2 * count), *carried)
        ends = ensemble(scene, length, starts=both, output="end", check=0, **options).require().states()
        record = natural_units(system, [part[None] for part in ends])[0]
        distance = np.linalg.norm(record[count:] - record[:count], axis=1) + np.finfo(float).eps
        growth[row] = np.log(distance / 1e-6)
        ends += [np.zeros((2 * count, 0))] * (len(first) - len(ends))
        first = [part[:count] for part in ends]
        second = [
            near + ((part[count:] - near).T * (1e-6 / distance)).T for part, near in zip(ends, first, strict=True)
        ]
    return Exponent(scene, times, growth, TRANSIENT * duration, np.nan)
