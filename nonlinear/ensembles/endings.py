"""Outcomes of many starts: each is run until its returns are conclusive, up to a limit, then they are grouped.

Runs go in rounds, each as long as all before it together: after a round the last of it is judged by
`nonlinear.synchronization.attractors`, and what has not settled runs on.  What is left at the limit is chaotic where
its exponent is above that of regular motion, else undecided.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from math import degrees, pi
from typing import Any

import numpy as np

from modal.errors import ComputationError, SceneError
from modal.report import Displayed
from modal.scene import Scene
from modal.types import Floats, Ints
from nonlinear.chaos import lyapunov_exponent
from nonlinear.ensembles.running import ensemble
from nonlinear.postprocessing.returns import Returns, clustered, natural_units
from nonlinear.synchronization.attractors import AT_REST, CLOSING_GAP, OPEN, PERIODIC, TORUS, Ending, ending_of
from nonlinear.synchronization.phases import own_shapes
from nonlinear.system import Motion, State, motion_of, system_of

ROUND_PERIODS, LIMIT_PERIODS = 128, 2048
"""Limit: of the slowest pendulum, the first round of runs, and by default the longest run of a start."""
UNDECIDED, CHAOTIC = "undecided", "chaotic"


@dataclass(frozen=True, eq=False, repr=False)
class EndingGroup(Displayed):
    """Starts of `size` that end in one motion, or in one of `copies` that equal pendula exchange; an `ending` of them.

    `members` are their numbers; the `exponent` is that of chaos, with half its 95 % interval (1/s).
    """

    what, shows = "EndingGroup", "name: name; members: numbers of starts; copies: copies"

    name: str
    members: tuple[int, ...]
    ending: Ending
    copies: int = 1
    exponent: tuple[float, float] | None = None


def drive_angle(scene: Scene) -> float:
    """The largest angle (deg) of the drives at joints."""
    return max((link.drive.angle_deg for link in scene.links() if link.drive), default=0.0)


def slowest_period(scene: Scene) -> float:
    """Of the pendula on a fixed support (s)."""
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


def groups_of(scene: Scene, starts: Motion, limit: float, **options: Any) -> tuple[EndingGroup, ...]:
    """Group these starts by their outcomes, the most frequent first, within `limit` (s); `options` as in `ensemble`."""
    count = len(starts.links)
    endings: dict[int, Ending] = {}
    left, motion, elapsed = np.arange(count), starts, 0.0
    length = min(ROUND_PERIODS * slowest_period(scene), limit)
    while len(left) and elapsed < limit * (1 - 1e-9):
        motion, judged = _round(scene, motion, length, options)
        endings |= dict(zip(left.tolist(), judged, strict=True))
        is_open = np.array([ending.kind == OPEN and np.all(np.isfinite(ending.state.links)) for ending in judged])
        left, motion = left[is_open], motion.at(np.flatnonzero(is_open))
        elapsed += length
        length = min(elapsed, limit - elapsed)
    groups = [*_groups(scene, endings), *_unsettled(scene, {k: endings[k] for k in endings if endings[k].kind == OPEN})]
    return tuple(sorted(groups, key=lambda group: -len(group.members)))


def _round(scene: Scene, motion: Motion, length: float, options: dict[str, Any]) -> tuple[Motion, list[Ending]]:
    """The last states of these members, and what their returns in so many seconds (s) tell."""
    system = system_of(scene)
    label, rest = system.labels[system.first], degrees(float(system.rest[0]))
    found = ensemble(
        scene, length, starts=motion, output="end", measures=[f"section:{label}>{rest:.17g}"], check=0, **options
    ).require()
    final, owner = found.states(), np.array([], dtype=int)
    if "crossing_member" in found.columns:
        owner = found.column("crossing_member").astype(int)
        times, crossed = found.column("crossing_time_s"), found.states("crossing_")
    endings = []
    for member in range(found.size):
        rows = np.flatnonzero(owner == member)
        state = _state_of(final, member)
        if not len(rows):
            is_still = _distance_from_rest(scene, state) < CLOSING_GAP
            endings.append(Ending(AT_REST if is_still else OPEN, np.nan, np.zeros((0, 0)), state))
            continue
        ending = ending_of(Returns(times[rows], tuple(part[rows] for part in crossed)), scene)
        endings.append(replace(ending, state=state) if ending.kind == OPEN else ending)
    return motion_of([_state_of(final, member) for member in range(found.size)]), endings


def _state_of(parts: list[Floats], member: int) -> State:
    links, rates, cart, speed, *carried = (part[member] for part in parts)
    return State(links, rates, float(cart), float(speed), *carried)


def _distance_from_rest(scene: Scene, state: State) -> float:
    """The largest part of a state in natural units."""
    system = system_of(scene)
    turned = np.remainder(state.links - system.rest + pi, 2 * pi) - pi
    cart = np.full((1, 1), state.cart), np.full((1, 1), state.cart_rate)
    carried = (state.supports[None, None], state.support_rates[None, None]) if len(state.supports) else ()
    parts = (turned[None, None], state.link_rates[None, None], *cart, *carried)
    return float(np.abs(natural_units(system, parts)).max())


def _groups(scene: Scene, endings: dict[int, Ending]) -> Iterator[EndingGroup]:
    """Those at rest, periodic ones by their returns, tori by name and slow period."""
    named = [k for k in endings if endings[k].kind == AT_REST]
    if named:
        yield EndingGroup(AT_REST, tuple(named), endings[named[0]])
    periodic = [k for k in endings if endings[k].kind == PERIODIC]
    if periodic:
        records = np.array([endings[k].record for k in periodic])
        repeats = np.array([endings[k].returns for k in periodic])
        labels, _ = clustered(records, repeats, np.zeros((len(periodic), scene.n_links), dtype=np.int64), 1e-3)
        for label in range(labels.max() + 1):
            members = [periodic[k] for k in np.flatnonzero(labels == label)]
            if members:
                first = endings[members[0]]
                copies = -(-distinct_states([endings[k].state for k in members]) // first.returns)
                yield EndingGroup(PERIODIC, tuple(members), first, copies)
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


def _unsettled(scene: Scene, endings: dict[int, Ending]) -> Iterator[EndingGroup]:
    """The starts that have not settled: chaotic ones, and undecided ones."""
    chaotic: Ints = np.zeros(0, dtype=int)
    numbers, exponent = np.array(sorted(endings), dtype=int), None
    finite = [
        k for k in numbers.tolist() if len(endings[k].state.links) and np.all(np.isfinite(endings[k].state.links))
    ]
    if finite:
        try:
            exponent = lyapunov_exponent(scene, starts=[endings[k].state for k in finite])
            if np.any(exponent.members > exponent.floor) and exponent.of_the_chaotic.is_positive:
                chaotic, exponent = np.array(finite)[exponent.members > exponent.floor], exponent.of_the_chaotic
        except (ComputationError, SceneError):
            exponent = None
    for name in ("chimera", CHAOTIC):
        members = [k for k in chaotic.tolist() if endings[k].chimera is (name == "chimera")]
        if members and exponent:
            yield EndingGroup(name, tuple(members), endings[members[0]], 1, (exponent.value, exponent.half_width))
    rest = [k for k in numbers.tolist() if k not in chaotic]
    if rest:
        yield EndingGroup(UNDECIDED, tuple(rest), endings[rest[0]])
