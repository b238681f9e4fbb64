"""Roughly how long an ensemble takes by each engine, as benchmarks/ensembles.py finds it, and which to take."""

from __future__ import annotations

from collections.abc import Sequence
from importlib.util import find_spec
from math import inf

from modal.errors import SceneError
from modal.scene import CAPABILITIES, Scene, refusals
from nonlinear.dynamics.inputs import Inputs
from nonlinear.ensembles.members import Members
from nonlinear.ensembles.question import (
    COMPILED,
    LANES,
    ONE_BY_ONE,
    PLAIN,
    SERIES,
    Question,
    seconds_each,
    switching_features,
)
from nonlinear.integration import taylor_takes
from nonlinear.system import system_of

ENGINES = (LANES, COMPILED, SERIES, PLAIN)
SOONER = {LANES: 1.0, COMPILED: 5.0, SERIES: 7.0}
SOONER_WITHIN = {LANES: 1.0, COMPILED: 7.0, SERIES: 4.0}
"""How many times as fast as lanes in NumPy an engine is once it runs, also where much is looked for within steps."""
WITHIN = {"largest_angle", "section"}
BEFORE = {LANES: 0.05, COMPILED: 7.0, SERIES: 3.0}
"""Seconds to load and compile."""
CHANGING = 20.0
"""And to compile what happens at switches."""
RECORDED = {name: CAPABILITIES[f"engine {name}"].unless["moved_support"] for name in (COMPILED, SERIES)}
"""What of the functions of time an engine takes."""
NEEDS = {LANES: "numpy", COMPILED: "numba", SERIES: "heyoka"}


def choose_engine(
    asked: str, why_not: str, members: Members, duration: float, tolerance: float, measures: Sequence[str] = ()
) -> tuple[str, str]:
    """The engine for these members, and why; SceneError for one that cannot take them."""
    if asked not in ("auto", *ENGINES):
        raise SceneError([f"engine {asked}: must be one of auto, {', '.join(ENGINES)}"])
    if asked == PLAIN:
        return PLAIN, "as asked for, one by one"
    if asked != "auto" and (found := refusals(members.scene, f"engine {asked}", *members.varied)):
        raise SceneError(found)
    if why_not:
        if asked != "auto":
            raise SceneError([f"engine {asked}: {why_not}; simulate takes its members one by one"])
        return PLAIN, f"one by one, for {why_not}"
    if not _recorded(asked, members.scene):
        where = "hoist" if members.scene.is_hoisted else "support.motion" if members.scene.is_moved else "force"
        raise SceneError([f"{where}: engine {asked} {RECORDED[asked]}: take engine numpy"])
    if asked == SERIES and find_spec("heyoka") and not taylor_takes(members.scene):
        raise SceneError([f"engine {asked}: takes shorter chains and fewer links"])
    if asked != "auto":
        return asked, "as asked for"
    sooner = SOONER_WITHIN if WITHIN & set(measures) else SOONER
    seconds = {name: _seconds(name, members, duration, tolerance, sooner[name]) for name in SOONER}
    best = min(seconds, key=seconds.__getitem__)
    return best, f"the fastest for so many, about {seconds[best]:.2g} s on one core"


def _recorded(name: str, scene: Scene) -> bool:
    """Whether what time brings is a function of it that an engine can compile."""
    inputs = Inputs(system_of(scene))
    needed = {COMPILED: "polynomials", SERIES: "pieces"}.get(name)
    return needed is None or getattr(inputs, needed) is not None


def _seconds(name: str, members: Members, duration: float, tolerance: float, sooner: float) -> float:
    absent = not find_spec(NEEDS[name]) or (name == SERIES and not taylor_takes(members.scene))
    if not _recorded(name, members.scene):
        return inf
    if absent or refusals(members.scene, f"engine {name}", *members.varied):
        return inf
    before = BEFORE[name] + (CHANGING if name == COMPILED and switching_features(members) else 0.0)
    return before + members.size * seconds_each(members.scene, duration, tolerance) / sooner


def seconds_of(question: Question, chunks: int) -> float:
    """Seconds of work in so many chunks, on one core."""
    count = min(chunks * question.chunk, question.members.size)
    if question.engine == PLAIN:
        return count * ONE_BY_ONE
    each = seconds_each(question.scene, question.duration, question.tolerance)
    return count * each / SOONER[question.engine]
