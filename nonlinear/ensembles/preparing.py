"""Compile ahead of time the code that a scene can use, and cache it for later processes."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from math import pi
from time import perf_counter
from typing import Any

import numpy as np

from modal.errors import MultipendulaError, refuse_any
from modal.report import Displayed, Form, ReportTable, Result
from modal.scene import Scene, load, refusals, title_of, validate_scene
from modal.scene.doors import checked
from nonlinear.ensembles.costs import code_of, first_numbers
from nonlinear.ensembles.measures import requested_measures, validate_measures
from nonlinear.ensembles.members import members_of
from nonlinear.ensembles.question import COMPILED, ENSEMBLE_TOLERANCE
from nonlinear.ensembles.running import ensemble
from nonlinear.integration import ASKED, Choice, Request, choose, estimate_timescales, validate, validate_numbers
from nonlinear.integration.kernels import LANE_LINKS_MAX, integrator
from nonlinear.integration.methods import offers
from nonlinear.integration.readiness import Code, compiled_in, kept_in
from nonlinear.system import state_at_rest, system_of

ONE, MANY, ANY = "one motion", "many motions", "Any scene in the plane"


@dataclass(frozen=True, repr=False)
class CompiledCode(Displayed):
    """The code that an engine needs for "one motion" or "many motions" of a scene.

    The `action` was "compiled", "loaded from disk", or none as it "was ready" in this process; `seconds` is how long it
    took, `kept_in` the folder from which later processes load it, "" where there is none.  Where an engine cannot run
    the scene, `why_not` says so, and the action is "".
    """

    what = "Code for an engine"
    shows = "runs: runs; engine: engine; action: action; seconds: time, s; kept_in: kept in; why_not: why not"

    runs: str
    engine: str
    action: str = ""
    seconds: float = 0.0
    kept_in: str = ""
    why_not: str = ""


@dataclass(frozen=True, repr=False)
class Compilation(Result):
    """The code compiled for a scene, engine by engine; for any plane scene where it is None.

    >>> from modal import load
    >>> from nonlinear.ensembles import Compilation
    >>> Compilation(load("chain-2"), ()).to_dict()
    {}
    """

    scene: Scene | None
    codes: tuple[CompiledCode, ...]

    key = "codes"

    def titles(self) -> tuple[str, str]:
        """The scene that it was compiled for."""
        return title_of(self.scene) if self.scene else ANY, "compiled code"

    def parts(self, form: Form = "text") -> Iterator[ReportTable | str]:
        """The compiled engines, the others with reasons, and where the code is cached."""
        ready = [code for code in self.codes if code.action]
        rows = [(code.runs, code.engine, code.action, f"{code.seconds:.2g}") for code in ready]
        yield ReportTable(("runs", "engine", "action", "seconds"), rows)
        yield "\n".join(f"{code.runs} by {code.engine}: {code.why_not}" for code in self.codes if code.why_not)
        if homes := dict.fromkeys(code.kept_in for code in ready if code.kept_in):
            yield "\n".join(["kept in", *(f"  {home}" for home in homes)])
        if any(not code.kept_in for code in ready):
            yield "not kept for later processes: no folder of the cache can be written by this user"
        if not self.scene:
            yield "many motions, and Taylor series, are compiled for each form of scene: give one"

    def records(self) -> list[dict[str, Any]]:
        """The state of each engine for each use."""
        return [vars(code) for code in self.codes]

    def whole(self) -> dict[str, Any]:
        """The title of the scene, and the codes."""
        return {"scene": self.scene and (self.scene.title or None), self.key: self.records()}


def compile_engines(
    scene: Scene | None = None, tolerance: float = ENSEMBLE_TOLERANCE, measures: Sequence[str] = ()
) -> Compilation:
    """Compile the code that this scene can use, by running it briefly, and cache it for later processes.

    Without a scene it is code that serves every scene: single motions in the plane by numba.

    `simulate` and `ensemble` would do the same where it pays, at the price of seconds while someone waits.

    Parameters
    ----------
    scene
        numba's code for many motions, and heyoka's, depend on the form of the scene and not on its numbers.
    tolerance
        That of the later runs: heyoka's code depends on it.
    measures
        Those of `ensemble` that later runs ask for.  Exponents need equations of their own.

    Returns
    -------
    Compilation
        The code compiled for each engine, or the reason why there is none.

    Raises
    ------
    SceneError
        The scene, the tolerance or a measure cannot be.

    Examples
    --------
    >>> from modal import load
    >>> from nonlinear import compile_engines
    >>> [code.runs for code in compile_engines(load("chain-spatial")).codes if code.why_not]
    ['one motion', 'one motion', 'many motions']
    """
    if scene is None:
        validate(lambda: validate_numbers(1.0, tolerance, 0.0))
        return Compilation(None, tuple(_general()))
    validate_scene(scene)
    system = system_of(scene)
    wanted, _ = validate(lambda: requested_measures(measures, system), lambda: validate_numbers(1.0, tolerance, 0.0))
    validate_measures(wanted.names, scene)
    return Compilation(scene, tuple(_codes(scene, float(tolerance), measures)))


def _general() -> Iterator[CompiledCode]:
    """The integrator, and that of structures, as single bobs need them."""
    for runs, scene in ((ONE, load("chain-1")), (f"{ONE} on a structure", load("tower"))):
        yield replace(next(_codes(scene, ENSEMBLE_TOLERANCE, ())), runs=runs)


def _codes(scene: Scene, tolerance: float, measures: Sequence[str]) -> Iterator[CompiledCode]:
    system, duration = system_of(scene), 2 * pi / estimate_timescales(scene).swing
    begun = state_at_rest(scene, [np.degrees(0.5)] * scene.n_links)
    request = Request(scene, system, begun, np.array([0.0, duration]))

    def series() -> Code | None:
        return getattr(offers(scene, system, duration, tolerance, request.size).get("taylor"), "code", None)

    def compiled() -> object:
        return request.run(Choice("minimal", "DOP853", True, ASKED, tolerance))

    def expanded() -> object:
        return request.run(choose(scene, duration, tolerance, "taylor"))

    problems = refusals(scene, "compiled equations")
    carriers = system.structure.carriers if system.structure else ()
    problems += [
        f"support.{each.name}: supports of kind {each.kind} are not compiled"
        for each in carriers
        if not each.is_compiled
    ]
    kernel = partial(integrator, system)
    yield _ready(ONE, COMPILED, problems, kernel, compiled)
    yield _ready(ONE, "heyoka", refusals(scene, "method taylor"), series, expanded)
    starts = [[0.5] * scene.n_links] * 2

    def code() -> Code | None:
        return code_of(COMPILED, first_numbers(members_of(scene, starts, None)), measures)

    def together() -> object:
        more: dict[str, Any] = {"tolerance": tolerance, "measures": measures, "workers": 1, "check": 0}
        return ensemble(scene, duration, starts=starts, engine=COMPILED, **more)

    problems = refusals(scene, "engine numba")
    if scene.n_links > LANE_LINKS_MAX:
        problems += [f"engine numba: takes minutes to compile for more than {LANE_LINKS_MAX} links"]
    yield _ready(MANY, COMPILED, problems, code, together)


def _ready(
    runs: str, engine: str, problems: Sequence[str], code: Callable[[], Code | None], run: Callable[[], object]
) -> CompiledCode:
    """The state of an engine after it has run, and before; why it cannot run where there are problems."""
    try:
        refuse_any(problems)
        before, begun = code(), perf_counter()
        run()
        seconds = perf_counter() - begun
        assert before
    except MultipendulaError as error:
        return CompiledCode(runs, engine, why_not="; ".join(str(error).splitlines()))
    action = "was ready" if before.is_ready else "compiled" if compiled_in(before) else "loaded from disk"
    return CompiledCode(runs, engine, action, seconds, kept_in(before))


@checked
def compilation_table(compilation: Compilation, form: Form) -> str:
    """As text or json, the `form`.

    >>> from modal import load
    >>> from nonlinear.ensembles import Compilation, compilation_table
    >>> print(compilation_table(Compilation(load("chain-2"), ()), "text"), end="")
    Chain of 2 equal bobs: compiled code
    """
    return compilation.report(form)
