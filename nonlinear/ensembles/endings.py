"""Outcomes of many starts: each is run until its returns are conclusive, up to a limit, then they are grouped.

Runs go in rounds, each as long as all before it together: after a round the last of it is judged by
`nonlinear.synchronization.attractors`, and unsettled starts run on, as do those that repeat near no orbit or near
an unstable one.  A motion that has not settled by the limit is chaotic where its exponent is above that of
regular motion, a chimera where some of equal pendula also move as one, else undecided.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import ceil, degrees, pi
from typing import Any

import numpy as np

from modal.report import Displayed
from modal.scene import Scene
from modal.types import Floats, Ints
from nonlinear.chaos.lyapunov import BLOCKS, TRANSIENT, Exponent
from nonlinear.ensembles.running import ensemble
from nonlinear.orbits.cycles import Beginning
from nonlinear.orbits.floquet import CIRCLE_EXCESS_MAX
from nonlinear.orbits.orbit import Orbit
from nonlinear.postprocessing.returns import REPEAT_GAP_MAX, Returns, clustered, natural_rate, natural_units
from nonlinear.synchronization.attractors import AT_REST, CLOSING_GAP, OPEN, PERIODIC, TORUS, Ending, ending_of
from nonlinear.synchronization.phases import own_shapes
from nonlinear.system import Motion, State, motion_of, system_of

ROUND_PERIODS, LIMIT_PERIODS = 128, 4096
"""Limit: of the slowest pendulum, the first round of runs, and by default the longest run of a start."""
UNDECIDED, CHAOTIC = "undecided", "chaotic"


@dataclass(frozen=True, eq=False, repr=False)
class EndingGroup(Displayed):
    """Starts of `size` that end in one motion, or in one of `copies` that equal pendula exchange; an `ending` of them.

    `members` are their numbers; a periodic one has the `beginning` of a branch of orbits, chaos an `exponent` with half
    its 95 % interval (1/s).
    """

    what, shows = "EndingGroup", "name: name; members: numbers of starts; copies: copies"

    name: str
    members: tuple[int, ...]
    ending: Ending
    copies: int = 1
    exponent: tuple[float, float] | None = None
    beginning: Beginning | None = None


def drive_angle(scene: Scene) -> float:
    """The largest angle (deg) of the drives at joints."""
    return max((link.drive.angle_deg for link in scene.links() if link.drive), default=0.0)


def slowest_period(scene: Scene) -> float:
    """The slowest period of the pendula on a fixed support (s)."""
    system = system_of(scene)
    return 2 * pi / min(float(own_shapes(group, system.gravity, 1).omega.min()) for group in system.groups)


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
    orbit_of: Callable[[Ending], Beginning | None]
    endings: dict[int, Ending] = field(default_factory=dict)
    groups: list[EndingGroup] = field(default_factory=list)

    @property
    def others(self) -> dict[int, Ending]:
        """The endings of starts that are in no group."""
        ended = {k for group in self.groups for k in group.members}
        return {k: ending for k, ending in self.endings.items() if k not in ended}

    def add_round(self, judged: dict[int, Ending]) -> list[int]:
        """Take the endings that a round showed, and return the starts that run on."""
        self.endings |= judged
        self.groups += _periodic_groups(self.scene, judged, self.orbit_of)
        return [k for k, ending in self.others.items() if k in judged and _runs_on(ending)]

    def whole(self) -> tuple[EndingGroup, ...]:
        """All groups, the most frequent first."""
        if rest := tuple(self.others):
            self.groups.append(EndingGroup(UNDECIDED, rest, self.endings[rest[0]]))
        return tuple(sorted(self.groups, key=lambda group: -len(group.members)))


def groups_of(
    scene: Scene, starts: Motion, limit: float, orbit_of: Callable[[Ending], Beginning | None], **options: Any
) -> tuple[EndingGroup, ...]:
    """The outcomes of these starts, the most frequent first, within `limit` (s); `options` are those of `settle`.

    `orbit_of` finds the orbit of a periodic ending.
    """
    outcomes = Outcomes(scene, orbit_of)
    settle([outcomes], np.zeros(len(starts.links), dtype=int), starts, limit, **options)
    return outcomes.whole()


def settle(
    outcomes: Sequence[Outcomes],
    place: Ints,
    starts: Motion,
    limit: float,
    *,
    may_be_chaotic: bool = True,
    vary: Mapping[str, Floats] | None = None,
    **options: Any,
) -> None:
    """Run all starts together within `limit` (s), each of the scene of the outcomes at its `place` (S,), and sort them.

    The scenes differ in numbers that `vary` lists, (S,) each.  Without `may_be_chaotic` no exponent is computed of what
    has not settled.  `options` are those of `ensemble`.
    """
    left, motion, elapsed = np.arange(len(starts.links)), starts, 0.0
    first = ROUND_PERIODS * slowest_period(outcomes[0].scene)
    length = first if limit >= 2 * first else limit
    while len(left) and elapsed < limit * (1 - 1e-9):
        scenes = [outcomes[k].scene for k in place[left]]
        motion, judged = _round(scenes, motion, length, options | _numbers_at(vary, left))
        running: list[int] = []
        for number, each in enumerate(outcomes):
            here = {k: ending for k, ending in zip(left.tolist(), judged, strict=True) if place[k] == number}
            running += each.add_round(here)
        is_open = np.isin(left, running)
        left, motion = left[is_open], motion.at(np.flatnonzero(is_open))
        elapsed += length
        length = elapsed if limit - elapsed >= 2 * elapsed else limit - elapsed  # the last is no shorter than others
    for each in outcomes:
        each.groups += _settled_groups(each.others)
    if may_be_chaotic:
        states = {k: ending.state for each in outcomes for k, ending in each.endings.items()}

        def measured(members: list[int]) -> Exponent:
            begin, numbers = motion_of([states[k] for k in members]), _numbers_at(vary, np.array(members))
            return exponent_of(outcomes[0].scene, begin, limit / 2, **numbers, **options)

        _add_chaotic_groups(outcomes, measured)


def _numbers_at(vary: Mapping[str, Floats] | None, members: Ints) -> dict[str, Any]:
    """The option of `ensemble` for these members' numbers."""
    return {"vary": {path: numbers[members] for path, numbers in vary.items()}} if vary else {}


def _runs_on(ending: Ending) -> bool:
    """Whether a motion has to run on: neither at rest nor a torus."""
    return ending.kind in (OPEN, PERIODIC) and _is_finite(ending)


def _round(
    scenes: Sequence[Scene], motion: Motion, length: float, options: dict[str, Any]
) -> tuple[Motion, list[Ending]]:
    """The last states of members of these scenes, and what follows from their returns in this many seconds (s)."""
    system = system_of(scenes[0])
    label, rest = system.labels[system.first], degrees(float(system.rest[0]))
    found = ensemble(
        scenes[0], length, starts=motion, output="end", measures=[f"section:{label}>{rest:.17g}"], check=0, **options
    ).require()
    links, *others = found.states()
    final, owner = Returns(np.empty(0), (links, *others)), np.array([], dtype=int)
    turned = np.remainder(links - system.rest + pi, 2 * pi) - pi
    is_still = np.abs(natural_units(system, [turned, *others])).max(axis=-1) < CLOSING_GAP
    if "crossing_member" in found.columns:
        owner = found.column("crossing_member").astype(int)
        times, crossed = found.column("crossing_time_s"), found.states("crossing_")
    states, endings = [final.state(member) for member in range(found.size)], list[Ending]()
    for member, state in enumerate(states):
        rows = np.flatnonzero(owner == member)
        if not len(rows):
            endings.append(Ending(AT_REST if is_still[member] else OPEN, np.nan, np.zeros((0, 0)), state))
            continue
        ending = ending_of(Returns(times[rows], tuple(part[rows] for part in crossed)), scenes[member])
        endings.append(replace(ending, state=state) if ending.kind == OPEN else ending)
    return motion_of(states), endings


def _periodic_groups(
    scene: Scene, endings: dict[int, Ending], orbit_of: Callable[[Ending], Beginning | None]
) -> Iterator[EndingGroup]:
    """Periodic motions by their returns, where these are near an orbit that is not unstable."""
    left = [k for k in endings if endings[k].kind == PERIODIC]
    while left:
        records = np.array([endings[k].record for k in left])
        repeats = np.array([endings[k].returns for k in left])
        labels, _ = clustered(records, repeats, np.zeros((len(left), scene.n_links), dtype=np.int64), 1e-3)
        for label in range(1, labels.max() + 1):
            members = tuple(left[k] for k in np.flatnonzero(labels == label))
            first = endings[members[0]]
            beginning = orbit_of(first)
            if beginning and is_orbit_of(first, beginning.orbit):
                copies = -(-distinct_states([endings[k].state for k in members]) // first.returns)
                yield EndingGroup(PERIODIC, members, first, copies, None, beginning)
        left = [left[k] for k in np.flatnonzero(labels == 0)]  # of more motions than one round distinguishes


def is_orbit_of(ending: Ending, orbit: Orbit) -> bool:
    """Whether a motion may end in an orbit: they have one period, and no multiplier is beyond the unit circle."""
    largest = np.abs(orbit.floquet.others).max(initial=0.0)
    return bool(largest < 1 + CIRCLE_EXCESS_MAX and abs(orbit.period / ending.period - 1) < REPEAT_GAP_MAX)


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


def _add_chaotic_groups(outcomes: Sequence[Outcomes], measured: Callable[[list[int]], Exponent], few: int = 8) -> None:
    """Add, of unsettled motions, chimeras and others whose exponents show chaos, as `measured` of starts.

    Of more than a `few` of a kind only so many are measured, and the others where these differ.
    """
    kinds = [
        (each, name, [k for k, ending in each.others.items() if _is_open(ending) and ending.chimera is is_chimera])
        for each in outcomes
        for is_chimera, name in ((True, "chimera"), (False, CHAOTIC))
    ]
    representatives = [k for *_, members in kinds for k in members[:few]]
    if not representatives:
        return
    common = measured(representatives)
    for each, name, members in kinds:
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
            each.groups.append(EndingGroup(name, numbers, each.endings[numbers[0]], 1, interval))


def _is_open(ending: Ending) -> bool:
    return ending.kind == OPEN and _is_finite(ending)


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
