"""Estimated time of an ensemble for each engine, from benchmarks/ensembles.py, and the choice of the engine."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from modal.errors import SceneError
from modal.scene import CAPABILITIES, Scene, refusals
from nonlinear.dynamics import Lanes
from nonlinear.dynamics.generated import WRITTEN_LINKS_MAX
from nonlinear.dynamics.inputs import Inputs
from nonlinear.ensembles.measures import why_one_by_one
from nonlinear.ensembles.members import Members
from nonlinear.ensembles.question import (
    COMPILED,
    LANES,
    PLAIN,
    RETIRED,
    RUN_SECONDS_MIN,
    WITHOUT_SERIES,
    EnsembleRequest,
    refused,
    seconds_each,
    steps_of,
)
from nonlinear.integration import kernels
from nonlinear.integration.crowds import Crowd
from nonlinear.integration.methods import least_seconds
from nonlinear.integration.readiness import Code, Forgone, Offer, best_of, forgone_by
from nonlinear.system import Motion, Numbers, State, motion_of, numbers_of, system_of

ENGINES = (LANES, COMPILED, PLAIN)
SOONER = {LANES: 1.0, COMPILED: 5.0}
"""How many times as fast as lanes in NumPy an engine is once it runs."""
FOLDERS = "by which this folder was begun"
TANGENT = "lyapunov"
"""The measure that needs tangent equations in addition."""
NUMBA_SECONDS = 0.02
"""Cost: that numba's loop takes for a few members as well; benchmarks/ensembles.py."""
CALLING = 1.5e-4, 6e-5
"""Cost: seconds that a step of lanes in NumPy takes for a few members as well: for each link, and for its square;
benchmarks/ensembles.py."""
RECORDED = CAPABILITIES["engine numba"].unless["moved_support"]
"""The functions of time that numba supports."""


class Decision(NamedTuple):
    """An engine, the reason for it, and the saving by engines that are not ready."""

    engine: str
    reason: str
    forgone: Forgone = ()


def choose_engine(
    asked: str,
    why_not: str,
    members: Members,
    duration: float,
    tolerance: float,
    measures: Sequence[str] = (),
    *,
    begun: str = "",
    anew: bool = False,
) -> Decision:
    """The engine for these members; raise SceneError for one that cannot take them.

    Where the choice is free it is that of the engine by which a folder was `begun`; `anew` it does not depend on what
    is ready, so that processes that know nothing of each other choose alike.
    """
    if RETIRED in (asked, begun) and asked in ("auto", RETIRED):
        if begun != RETIRED:
            raise SceneError([WITHOUT_SERIES])
        return Decision(RETIRED, FOLDERS)
    if asked not in ("auto", *ENGINES):
        raise SceneError([f"engine {asked}: must be one of auto, {', '.join(ENGINES)}"])
    why_not = why_not or why_one_by_one(measures)
    if asked == PLAIN:
        return Decision(PLAIN, "as requested, one by one")
    if asked != "auto" and (reasons := refusals(members.scene, f"engine {asked}", *members.varied)):
        raise SceneError(reasons)
    if why_not:
        if asked != "auto":
            raise SceneError([f"engine {asked}: {why_not}; simulate takes its members one by one"])
        return Decision(PLAIN, f"one by one, for {why_not}")
    if not _recorded(asked, members.scene):
        where = "hoist" if members.scene.is_hoisted else "support.motion" if members.scene.is_moved else "force"
        raise SceneError([f"{where}: engine {asked} {RECORDED}: take engine numpy"])
    if asked != "auto":
        return Decision(asked, "as requested")
    if begun in SOONER and _takes(begun, members):
        return Decision(begun, FOLDERS)
    offers = _offers(members, duration, tolerance, measures)
    best = best_of(offers, anew=anew)
    seconds = offers[best].price(anew=True) if anew else offers[best].seconds
    return Decision(best, f"the fastest for this many, about {seconds:.2g} s on one core", forgone_by(offers, best))


def engine_of_many(
    scene: Scene, start: State, count: int, duration: float, tolerance: float, measures: Sequence[str]
) -> str:
    """The engine for this many starts like this one, whatever is ready: all who take some of them choose alike."""
    parts = vars(motion_of([start])).values()
    members = Members(scene, states=Motion(*(np.broadcast_to(part, (count, *part.shape[1:])) for part in parts)))
    why_not = refused(members, duration, tolerance)
    return choose_engine("auto", why_not, members, duration, tolerance, measures, anew=True).engine


def _recorded(name: str, scene: Scene) -> bool:
    """Whether the inputs are functions of time that an engine can compile."""
    return name != COMPILED or Inputs(system_of(scene)).polynomials is not None


def _offers(members: Members, duration: float, tolerance: float, measures: Sequence[str]) -> dict[str, Offer]:
    """The costs of these members by every engine that supports them."""
    scene, whole = members.scene, members.size * seconds_each(members.scene, duration, tolerance)
    links, steps = scene.n_links, steps_of(scene, duration, tolerance)
    beside = {COMPILED: NUMBA_SECONDS, LANES: steps * (CALLING[0] * links + CALLING[1] * links**2)}
    numbers = first_numbers(members)
    return {
        name: Offer(beside[name] + whole / SOONER[name], code_of(name, numbers, measures))
        for name in SOONER
        if _takes(name, members)
    }


def _takes(name: str, members: Members) -> bool:
    """Whether it is a choice: equations that are not written out in a few lines numba compiles for minutes."""
    if not _recorded(name, members.scene) or refusals(members.scene, f"engine {name}", *members.varied):
        return False
    return name == LANES or members.scene.n_links <= WRITTEN_LINKS_MAX


def first_numbers(members: Members) -> Numbers:
    """The numbers of the first member, as an engine is given those of many; of the scene where that cannot be."""
    part = members.part(0, 1)
    try:
        return part.numbers(np.arange(1))
    except SceneError:
        return numbers_of(members.scene)


def code_of(name: str, numbers: Numbers, measures: Sequence[str] = ()) -> Code | None:
    """The code that an engine compiles for members with such numbers, and its state; None if it compiles nothing.

    Where exponents are measured it is the tangent equations, which come after the others.
    """
    if name == LANES:
        return None
    lanes = Lanes(numbers, tangent=TANGENT in measures)
    return kernels.code_of(lanes, Crowd(lanes) if numbers.switching else None)


def seconds_of(question: EnsembleRequest, chunks: int) -> float:
    """Seconds of work in this many chunks, on one core."""
    count = min(chunks * question.chunk, question.members.size)
    if question.engine == PLAIN:
        return count * max(RUN_SECONDS_MIN, least_seconds(question.scene, question.duration, question.tolerance))
    each = seconds_each(question.scene, question.duration, question.tolerance)
    return count * each / SOONER.get(question.engine, 1.0)
