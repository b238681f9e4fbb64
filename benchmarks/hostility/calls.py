"""Public functions of Python with arguments of wrong types, wrong words, nan and inf."""

from __future__ import annotations

import inspect
import math
import random
import signal
import warnings
from collections.abc import Callable
from functools import cache
from importlib import import_module
from types import FrameType
from typing import Any

from modal import load, natural_modes
from modal.errors import MultipendulaError
from nonlinear import initial_state, simulate, state_at_rest, system_of

ROOMS = (
    *("modal", "modal.coupling", "modal.exact", "modal.exports", "modal.identification", "modal.loci", "modal.modes"),
    *(
        "modal.statespace",
        "modal.vibration",
        "nonlinear",
        "nonlinear.averaging",
        "nonlinear.chaos",
        "nonlinear.ensembles",
    ),
    *("nonlinear.files", "nonlinear.orbits", "nonlinear.postprocessing", "nonlinear.reduction", "nonlinear.simulation"),
    *("nonlinear.synchronization", "nonlinear.verification"),
)
NONSENSE = (
    None,
    True,
    "chain-2",
    "",
    {},
    [],
    1.5,
    -1,
    99,
    10**400,
    math.nan,
    math.inf,
    object(),
    [math.nan],
    ["x"],
    b"x",
)
SENSE = {"float": 1.0, "int": 1, "str": "gravity=1:2:2"}
PATIENCE = 5.0  # s
UNJUDGED = (ValueError, TypeError, IndexError, KeyError)
"""What Python itself raises for nonsense in places that say more than a type; counted, and no fault with a sentence."""


class GivenUpError(BaseException):
    """A call that runs for ever; nothing in the packages may catch it."""


@cache
def doors() -> list[tuple[str, Callable[..., Any]]]:
    """Every public function whose first argument is one of the things that are known here."""
    functions: dict[Callable[..., Any], str] = {}
    for room in map(import_module, ROOMS):
        for name in getattr(room, "__all__", ["load", "save", "simulate", "resume", "advise"]):
            function = getattr(room, name, None)
            if inspect.isfunction(function) and len(inspect.signature(function).parameters):
                functions.setdefault(function, f"{room.__name__}.{name}")
    known = things()
    return [(name, function) for function, name in functions.items() if _annotations(function)[0] in known]


@cache
def things() -> dict[str, Any]:
    """What functions are about, by its type."""
    scene = load("chain-2")
    run = simulate(scene, 0.5, start=state_at_rest(scene, [10.0, 5.0]), output=5)
    system, start = system_of(scene), initial_state(scene)
    return {"Scene": scene, "Modes": natural_modes(scene), "Trajectory": run, "System": system, "State": start}


def _annotations(function: Callable[..., Any]) -> list[str]:
    return [str(parameter.annotation) for parameter in inspect.signature(function).parameters.values()]


def case(number: int) -> tuple[str, list[str]]:
    """One function with nonsense in one place: what became of it, and its faults."""
    rng = random.Random(f"call {number}")
    name, function = rng.choice(doors())
    parameters = [
        parameter
        for parameter in inspect.signature(function).parameters.values()
        if parameter.kind not in (parameter.VAR_POSITIONAL, parameter.VAR_KEYWORD) and "report" not in parameter.name
    ]
    arguments = {other.name: _sense(str(other.annotation)) for other in parameters if other.default is other.empty}
    chosen, value = rng.choice(parameters), rng.choice(NONSENSE)
    what = f"{name}({chosen.name}={repr(value) if value != 10**400 else '10**400'})"
    became, fault = _called(
        function, {**arguments, chosen.name: value}, simple=chosen.annotation in {*things(), *SENSE}
    )
    return became, [f"{what}: {fault}"] if fault else []


def _sense(annotation: str) -> Any:
    return next((value for kind, value in {**things(), **SENSE}.items() if annotation.startswith(kind)), [])


def _called(function: Callable[..., Any], arguments: dict[str, Any], simple: bool) -> tuple[str, str]:
    """`simple` says that the annotation is a type by itself, so that anything else has to be a SceneError."""
    before = signal.signal(signal.SIGALRM, _ring)
    signal.setitimer(signal.ITIMER_REAL, PATIENCE)
    try:
        with warnings.catch_warnings(action="error"):
            answer = function(**arguments)
            if inspect.isgenerator(answer):
                next(answer, None)
    except MultipendulaError as error:
        return "refused", "a refusal of many lines" if str(error).count("\n") > 5 else ""
    except GivenUpError:
        return "given up", ""
    except UNJUDGED as error:
        told = "there is no mode" in str(error)
        return "Python's", f"{type(error).__name__}: {error}" if simple and not told else ""
    except BaseException as error:
        return "failed", f"{type(error).__name__}: {str(error)[:120]}" if simple else ""
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)
    return "answered", ""


def _ring(_: int, __: FrameType | None) -> None:
    raise GivenUpError
