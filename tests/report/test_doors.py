"""The public functions of the packages: each reports all that is wrong with its arguments in one error."""

from __future__ import annotations

import inspect
import pkgutil
from collections.abc import Callable, Iterator
from importlib import import_module
from math import inf, nan
from typing import Any, Literal

import numpy as np
import pytest

import modal
import nonlinear
from modal import SceneError, load, natural_modes
from modal.errors import MultipendulaError
from modal.identification import identify
from modal.scene.doors import checked, checked_index, checked_number, require_type
from nonlinear import initial_state, simulate
from nonlinear.chaos import lyapunov_exponent
from nonlinear.ensembles import find_section
from nonlinear.orbits import mode_orbit, nonlinear_mode, periodic_orbit
from nonlinear.reduction import start_in_mode

SCENE = load("chain-2")
MODES = natural_modes(SCENE)
OF = ("Scene", "Modes", "Trajectory")
INNER = ("dynamics", "types")
"""Subpackages whose functions are called by other subpackages only."""
OTHERS: dict[str, Any] = {"float": 1.0, "int": 1, "str": "gravity", "Scene": SCENE, "Modes": MODES}


def doors() -> Iterator[tuple[str, Callable[..., Any], dict[str, Any]]]:
    """Every public function whose first argument is a scene, modes or a trajectory, and its other arguments."""
    rooms = [
        import_module(f"{package.__name__}.{room.name}")
        for package in (modal, nonlinear)
        for room in pkgutil.iter_modules(package.__path__)
        if not room.name.startswith("_") and room.name not in INNER
    ]
    seen = set()
    for room in (modal, nonlinear, *rooms):
        for name in getattr(room, "__all__", ()):
            function = getattr(room, name)
            if not inspect.isfunction(function) or function in seen:
                continue
            seen.add(function)
            first, *rest = [*inspect.signature(function).parameters.values(), None]
            if first is None or first.annotation not in OF:
                continue
            needed = [
                parameter
                for parameter in rest
                if parameter
                and parameter.default is parameter.empty
                and parameter.kind is parameter.POSITIONAL_OR_KEYWORD
            ]
            named = {
                parameter.name: next(
                    (stand_in for kind, stand_in in OTHERS.items() if kind in str(parameter.annotation)), []
                )
                for parameter in needed
            }
            yield f"{function.__module__}.{name}", function, named


def test_a_wrong_first_argument_is_one_error_at_every_door() -> None:
    wrong: list[str] = []
    count = 0
    for name, function, others in doors():
        for value in ("chain-2", None, {}, 3):
            count += 1
            try:
                returned = function(value, **others)
                if inspect.isgenerator(returned):
                    next(returned)
                wrong.append(f"{name}({value!r}): answers")
            except MultipendulaError:
                pass
            except Exception as error:
                wrong.append(f"{name}({value!r}): {type(error).__name__}: {error}")
    assert count > 400
    assert not wrong


Word = Literal["one", "two"]


@checked
def asked(
    scene: modal.Scene,
    size: float,
    count: int = 1,
    *,
    longest: float = inf,
    word: Word = "one",
    names: tuple[str, ...] = (),
    deep: bool = False,
    other: Any = None,
    last: float | None = None,
) -> str:
    """The argument that is looked at."""
    return f"{size}{count}{longest}{word}{names}{deep}{other}{last}"


def test_arguments_of_the_right_types_go_through() -> None:
    assert asked(SCENE, np.float32(1.5), np.int64(2), longest=inf, word="two", names=["a"]).startswith("1.52inftwo")
    assert asked(SCENE, 1, last=None).startswith("11inf")
    assert str(inspect.signature(asked)).startswith("(scene: 'modal.Scene', size: 'float'")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"size": nan}, "size nan: must be a finite number"),
        ({"size": inf}, "size inf: must be a finite number"),
        ({"size": True}, "size True: must be a finite number"),
        ({"size": "1"}, "size '1': must be a finite number"),
        ({"count": 1.5}, "count 1.5: must be a whole number"),
        ({"longest": nan}, "longest nan: must be a number"),
        ({"word": "tow"}, r"word 'tow': must be one of one, two \(did you mean two\?\)"),
        ({"word": ["one"]}, r"word \['one'\]: must be one of one, two$"),
        ({"names": "a"}, r"names 'a': must be a list: \['a'\]"),
        ({"names": [1]}, "names: has 1: must be text"),
        ({"deep": 1}, "deep 1: must be True or False"),
        ({"last": nan}, "last nan: must be a finite number"),
        ({"size": 10**5000}, r"size \(an enormous integer\): must be a finite number"),
        ({"count": 1.5, "size": nan}, "size nan: must be a finite number\ncount 1.5: must be a whole number"),
    ],
)
def test_what_is_wrong_is_named_with_its_value(arguments: dict[str, Any], words: str) -> None:
    with pytest.raises(SceneError, match=f"^{words}"):
        asked(SCENE, **{"size": 1.0} | arguments)


def test_numbers_and_places_have_bounds() -> None:
    assert checked_number("x", np.float64(2.0), 0, 3) == 2.0
    assert checked_index("k", np.int64(2), 0, 2) == 2
    for value in (nan, -1.0, 4, None, True):
        with pytest.raises(SceneError, match=r"^x .*: must be a finite number from 0 to 3$"):
            checked_number("x", value, 0, 3)
    for value in (-1, 3, 1.0, None, True):
        with pytest.raises(SceneError, match=r"^k .*: must be a whole number from 0 to 2$"):
            checked_index("k", value, 0, 2)
    require_type("modes", MODES, "Scene", "Modes")


@pytest.mark.parametrize(
    "call",
    [
        lambda: identify([], [], method="decrment"),
        lambda: identify([], [], excitation="rnadom"),
        lambda: mode_orbit(SCENE, 1, nan),
        lambda: nonlinear_mode(SCENE, 1, 1.0, tolerance=inf),
        lambda: find_section(SCENE, energy=1e300),
        lambda: start_in_mode(SCENE, MODES, 0, copy=1),
        lambda: start_in_mode(SCENE, MODES, 2),
        lambda: start_in_mode(SCENE, MODES, 0, amplitude=nan),
        lambda: periodic_orbit(SCENE, initial_state(SCENE), 1.0, segments=0),
        lambda: lyapunov_exponent(SCENE, 1e300),
        lambda: simulate(SCENE, 1.0, load=3),
        lambda: simulate(SCENE, 1.0, events="turns"),
        lambda: MODES.table("markdwn"),
        lambda: natural_modes(SCENE, modes=3),
    ],
)
def test_nonsense_has_a_sentence(call: Callable[[], Any]) -> None:
    with pytest.raises(SceneError) as told:
        call()
    assert "\n" not in str(told.value)
