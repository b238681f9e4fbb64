"""The request to an ensemble, and the division of its members into chunks.

A chunk depends on the question alone, so that it is the same regardless of who computes it and when.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from functools import cached_property
from hashlib import sha256
from math import pi
from typing import Any

import numpy as np

from modal.report import Displayed
from modal.scene import Scene, one_by_one
from modal.scene.features import FRICTION
from modal.scene.parameters import Place, find_places, is_of_switch
from nonlinear.ensembles.measures import RequestedMeasures, ending_times
from nonlinear.ensembles.members import MemberPart, Members
from nonlinear.ensembles.results import Wanted
from nonlinear.integration import choose, estimate_timescales
from nonlinear.integration.methods import step_count
from nonlinear.system import System, slack_of, system_of

ENSEMBLE_VERSION = 1
"""Format: of the files of an ensemble."""
PLAIN, LANES, COMPILED = "simulate", "numpy", "numba"
RETIRED = "heyoka"
"""The engine of older folders, which are still read."""
WITHOUT_SERIES = (
    "engine heyoka: is no longer there, for Taylor series take single motions (simulate's method taylor): take auto, "
    "in another folder than one that heyoka began"
)
ENSEMBLE_TOLERANCE = 1e-9
"""Limit: default of `tolerance` of many motions, from ensembles to sweeps."""
CHUNK_SECONDS = 4.0
"""Cost: of work in a chunk, of ensembles and of sweeps; benchmarks/ensembles.py."""
CHUNK_MEMBERS_MIN = 16
"""Cost: members of a chunk, of ensembles and of sweeps; benchmarks/ensembles.py."""
CHUNK_MEMBERS_MAX = 16_384
"""Cost: members of a chunk; benchmarks/ensembles.py."""
CHUNK_BYTES_MAX = 64_000_000
"""Cost: samples of a chunk in memory; benchmarks/ensembles.py."""
RUN_SECONDS_MIN = 0.15
"""Cost: the overhead of a single run; benchmarks/ensembles.py."""
CHECKED_SEED = 19
"""Format: of the draw of members that are run by themselves, which a folder's files depend on."""


@dataclass(frozen=True, eq=False, repr=False)
class EnsembleRequest(Displayed):
    """Members, duration (s), tolerance, quantities to store and to measure, and the engine.

    `times` (s) are stored samples, `keeps_end` says whether the last state is; `checked` are the numbers of the
    members that are run by themselves, too.
    """

    members: Members
    duration: float
    tolerance: float
    engine: str
    measures: RequestedMeasures
    times: tuple[float, ...] = ()
    keeps_end: bool = False
    checked: tuple[int, ...] = ()
    chunk: int = field(default=0)

    @property
    def scene(self) -> Scene:
        """The scene whose members these are."""
        return self.members.scene

    @cached_property
    def system(self) -> System:
        """The scene as arrays."""
        return system_of(self.scene)

    @cached_property
    def ending(self) -> tuple[float, ...]:
        """Samples (s) of the last tenth that measures need."""
        return ending_times(self.scene, self.duration) if self.measures.ends else ()

    @cached_property
    def wanted(self) -> Wanted:
        """The quantities that an engine must compute."""
        names = self.measures.names
        return Wanted(
            self.duration,
            self.tolerance,
            tuple(sorted({*self.times, *self.ending})),
            first_turns="first_turn" in names,
            largest="largest_angle" in names,
            stretching="lyapunov" in names,
            section=self.measures.section,
        )

    @property
    def chunks(self) -> int:
        """How many chunks there are."""
        return -(-self.members.size // self.chunk)

    def part(self, number: int) -> MemberPart:
        """The members of a chunk."""
        return self.members.part(number * self.chunk, (number + 1) * self.chunk)

    def header(self) -> dict[str, Any]:
        """Everything in it, for a file."""
        section = self.measures.section
        return {
            "version": ENSEMBLE_VERSION,
            "members": self.members.header(),
            "duration_s": self.duration,
            "tolerance": self.tolerance,
            "engine": self.engine,
            "measures": self.measures.names,
            "section": section and vars(section),
            "times_s": self.times,
            "keeps_end": self.keeps_end,
            "checked": self.checked,
            "chunk": self.chunk,
        }

    @cached_property
    def fingerprint(self) -> str:
        """A checksum that identifies the request."""
        return sha256(json.dumps(self.header()).encode()).hexdigest()


def seconds_each(scene: Scene, duration: float, tolerance: float) -> float:
    """Roughly how long one of many members takes by lanes in NumPy (s), as benchmarks/ensembles.py finds it."""
    return float(steps_of(scene, duration, tolerance) * system_of(scene).n_links * 5e-7)


def steps_of(scene: Scene, duration: float, tolerance: float) -> float:
    """Roughly how many steps a member takes."""
    periods = duration * estimate_timescales(scene).swing / (2 * pi)
    return float(10 + step_count(periods, tolerance))


def chunk_of(scene: Scene, duration: float, tolerance: float, samples: int, engine: str) -> int:
    """How many members a chunk has."""
    if engine == PLAIN:
        return CHUNK_MEMBERS_MIN
    width = 2 * (scene.n_links + 1) + 1
    fitting = CHUNK_BYTES_MAX // (8 * width * max(samples, 1))
    wished = CHUNK_SECONDS / seconds_each(scene, duration, tolerance)
    return int(max(min(wished, fitting, CHUNK_MEMBERS_MAX), CHUNK_MEMBERS_MIN))


def refused(members: Members, duration: float, tolerance: float) -> str:
    """Return why these members are simulated one at a time; "" if at once."""
    scene = members.scene
    if why := one_by_one(scene, *members.varied):
        return why
    places = [place for path in members.paths for place in find_places(scene, path)]
    if why := _switching(scene, members, places):
        return why
    if system_of(scene).may_turn_singular and all(link.kind == "bob" for link in scene.links()):
        return "a massless cart with dampers over bobs may lose all inertia, which stops only an individual run"
    if any(place[-1] == "count" for place in places):
        return "members differ in their number of links or pendula"
    prescribed = any("motion" in place or place[0] == "force" for place in places)
    if prescribed and not system_of(scene).is_analytic:
        return "members differ in motions of the support or forces, of which not all are sines or constant"
    if any(place[0] == "feedback" and place[-1] not in {"gain", "reference", "limit"} for place in places):
        return "members differ in gains of a matrix, or in when loops act"
    if any(_of_hoist(scene, place) for place in places):
        return "members differ in the law of a hoist"
    if why := _drawn(members, places):
        return why
    if choose(scene, duration, tolerance).method == "Radau":
        return "the fastest decay is far faster than the fastest swing"
    return ""


def switching_features(members: Members) -> frozenset[str]:
    """Which kinds of switches members have."""
    return (FRICTION | {"escapement"}) & (members.scene.features | set(members.varied))


def _switching(scene: Scene, members: Members, places: list[Place]) -> str:
    """Why members with escapements or dry friction go one by one."""
    switching = switching_features(members)
    if not switching:
        return ""
    if switching - scene.features or any(
        is_of_switch(scene, place) and np.any(values == 0)
        for path, values in members.values.items()
        for place in find_places(scene, path)
    ):
        return "some members have no such kicks or friction"
    return ""


def _drawn(members: Members, places: list[Place]) -> str:
    """Why members with springs between points go one by one."""
    if not members.scene.spring or all("start" in place for place in places):
        return ""
    system = system_of(members.scene)
    for first in range(0, members.size, CHUNK_MEMBERS_MAX):
        for k, those in enumerate(slack_of(members.part(first, first + CHUNK_MEMBERS_MAX).system)):
            if np.any(np.not_equal(those, system.slack[k])):
                return f"spring[{system.suspension.springs[k].entry}] has a length as drawn in some members alone"
    return ""


def _of_hoist(scene: Scene, place: Place) -> bool:
    """Whether a number is one of a law of length, which begins at the length of its link."""
    if place[0] != "pendulum" or place[2] != "links":
        return False
    hoist = scene.pendulum[int(place[1])].links[int(place[3])].hoist
    return hoist is not None and place[4] in {"hoist", "length"}


def sample_of(size: int, count: int) -> tuple[int, ...]:
    """Members, a given number, drawn at random."""
    drawn = np.random.default_rng(CHECKED_SEED).choice(size, size=min(count, size), replace=False)
    return tuple(sorted(drawn.tolist()))
