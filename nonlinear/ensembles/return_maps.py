"""Return maps of many starts at once, by which the motions in which they end are recognized.

A scene without periodic driving returns to a section, that of its first pendulum, which passes its angle at rest once a
swing; a scene that is driven in time returns once in every period of its drives.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property
from math import degrees, nan, pi
from typing import Any

import numpy as np

from modal.errors import SceneError
from modal.scene import Scene, drive_period
from modal.types import Ints
from nonlinear.ensembles.running import Ensemble, ensemble
from nonlinear.ensembles.strobes import settling_time, strobe_times
from nonlinear.orbits.cycles import Beginning
from nonlinear.orbits.floquet import CIRCLE_EXCESS_MAX
from nonlinear.orbits.orbit import Orbit
from nonlinear.postprocessing import largest_angle
from nonlinear.postprocessing.returns import (
    ATTRACTOR_GAP_MIN,
    JUDGED_STROBES,
    REPEAT_GAP_MAX,
    Returns,
    natural_units,
    repetition,
)
from nonlinear.simulation import simulate
from nonlinear.synchronization.attractors import AT_REST, CLOSING_GAP, OPEN, PERIODIC, Ending, ending_of
from nonlinear.synchronization.phases import own_shapes
from nonlinear.system import State, system_of, unwound

OrbitSearch = Callable[[Ending], Beginning | None]
"""Finds the orbit of a periodic ending."""


def slowest_period(scene: Scene) -> float:
    """The slowest period of the pendula on a fixed support (s)."""
    system = system_of(scene)
    return 2 * pi / min(float(own_shapes(group, system.gravity, 1).omega.min()) for group in system.groups)


@dataclass(frozen=True)
class SectionMap:
    """Passages of the first pendulum through its angle at rest, to the right; motions within a `gap` are one.

    The longest run of a start is by default so many `rounds` as long as the first.
    """

    scene: Scene
    gap: float = 1e-3
    rounds: int = 32

    @property
    def first_round(self) -> float:
        """The first round of runs (s): 128 periods of the slowest pendulum."""
        return 128 * slowest_period(self.scene)

    def run(self, length: float, **options: Any) -> Ensemble:
        """Members with their passages in this many seconds; `options` are those of `ensemble`."""
        system = system_of(self.scene)
        section = f"section:{system.labels[system.first]}>{degrees(float(system.rest[0])):.17g}"
        return ensemble(self.scene, length, output="end", measures=[section], **options)

    def endings(self, run: Ensemble, members: Ints) -> list[Ending]:
        """What follows from the passages of some members, with the last state of those that run on."""
        system, (links, *others) = system_of(self.scene), (part[members] for part in run.states())
        turned = np.remainder(links - system.rest + pi, 2 * pi) - pi
        is_still = np.abs(natural_units(system, [turned, *others])).max(axis=-1) < CLOSING_GAP
        final, passages = run.final, _passages_of(run)
        endings = []
        for still, member in zip(is_still, members.tolist(), strict=True):
            ending = Ending(AT_REST if still else OPEN, nan, np.zeros((0, 0)), final[member])
            if member in passages:
                ending = ending_of(passages[member], self.scene)
            endings.append(replace(ending, state=final[member]) if ending.kind == OPEN else ending)
        return endings

    def facts(self, ending: Ending, orbit_of: OrbitSearch) -> dict[str, Any] | None:
        """The orbit of a periodic motion with its name; None where it is near none, or near an unstable one."""
        beginning = orbit_of(ending)
        is_there = beginning is not None and is_orbit_of(ending, beginning.orbit)
        return {"name": PERIODIC, "beginning": beginning} if is_there else None


@dataclass(frozen=True)
class StroboscopicMap:
    """States at t = 0 of every period of the drives, of which the last 50 are judged."""

    scene: Scene
    gap: float = ATTRACTOR_GAP_MIN
    rounds: int = 4

    @cached_property
    def period(self) -> float:
        """That of the drives (s)."""
        return drive_period(self.scene).seconds

    @property
    def first_round(self) -> float:
        """The first round of runs (s): a transient of ten times the slowest decay, then 50 periods."""
        return settling_time(self.scene, self.period) + JUDGED_STROBES * self.period

    def run(self, length: float, **options: Any) -> Ensemble:
        """Members with their last strobes in this many seconds; raise SceneError for too few of these."""
        last = int(length / self.period * (1 + 1e-12))
        if last < JUDGED_STROBES:
            words = f"an attractor takes {JUDGED_STROBES} periods of {self.period:.4g} s"
            raise SceneError([f"duration {length:g} s: {words}"])
        times = strobe_times(self.period, settle=(last - JUDGED_STROBES + 1) * self.period)
        return ensemble(self.scene, max(length, times[-1]), output=times.tolist(), **options)

    def endings(self, run: Ensemble, members: Ints) -> list[Ending]:
        """What follows from the strobes of some members, with the last one."""
        states = [part[members, -JUDGED_STROBES:] for part in run.states()]
        strobes = natural_units(run.question.system, states)
        repeats, turns = repetition(strobes, run.question.system.n_links)
        endings = []
        for member, (p, whole) in enumerate(zip(repeats.tolist(), turns.tolist(), strict=True)):
            links, rates, cart, cart_rate, *carried = (rows[member, -1] for rows in states)
            state = State(links, rates, float(cart), float(cart_rate), *carried)
            kind = PERIODIC if p else OPEN
            endings.append(Ending(kind, (p or nan) * self.period, strobes[member], state, p, turns=tuple(whole)))
        return endings

    def facts(self, ending: Ending, _: OrbitSearch) -> dict[str, Any]:
        """The name of a periodic motion with its largest angle (deg), NaN if links turn over forever."""
        largest = nan
        if not any(ending.turns):
            run = simulate(self.scene, ending.period, start=unwound(ending.state))
            largest = degrees(largest_angle(run))
        return {"name": name_of_driven(ending, largest), "largest_angle_deg": largest}


def _passages_of(run: Ensemble) -> dict[int, Returns]:
    """The passages of every member that has some."""
    if "crossing_member" not in run.columns:
        return {}
    owner = run.column("crossing_member").astype(int)
    order = np.argsort(owner, kind="stable")
    members, begins = np.unique(owner[order], return_index=True)
    columns = [run.column("crossing_time_s"), *run.states("crossing_")]
    parts = (np.split(column[order], begins[1:]) for column in columns)
    return {
        k: Returns(times, tuple(states)) for k, times, *states in zip(members.tolist(), *parts, strict=False)
    }  # none for none


def is_orbit_of(ending: Ending, orbit: Orbit) -> bool:
    """Whether a motion may end in an orbit: they have one period, and no multiplier is beyond the unit circle."""
    largest = np.abs(orbit.floquet.others).max(initial=0.0)
    return bool(largest < 1 + CIRCLE_EXCESS_MAX and abs(orbit.period / ending.period - 1) < REPEAT_GAP_MAX)


ReturnMap = SectionMap | StroboscopicMap


def name_of_driven(ending: Ending, largest_deg: float) -> str:
    """Its period in those of the drives, with its largest angle or with the turns of its links a period."""
    if not any(ending.turns):
        return f"period {ending.returns}, largest angle {round(largest_deg, 3):.4g}°"
    rates = ", ".join(str(Fraction(turns, ending.returns)).replace("-", "−") for turns in ending.turns)
    return f"period {ending.returns}, turns {rates} a period"
