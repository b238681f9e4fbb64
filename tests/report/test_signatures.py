"""What a prompt shows of the packages: signatures, and the names that completion offers."""

from __future__ import annotations

import inspect
import pkgutil
import re
from collections.abc import Callable, Iterator
from importlib import import_module
from types import ModuleType
from typing import Any, get_origin

import numpy as np
import pytest

import modal
import nonlinear
from modal import Bob, Pendulum, Scene, load, natural_modes
from modal.report import Displayed, silent
from nonlinear import simulate

OBJECT = re.compile(r" at 0x|<factory>|<lambda>|<object|\n|\*\*data")
"""What no signature shows: a default without words, or several lines of one."""


def rooms() -> list[ModuleType]:
    """Both packages with what is in them."""
    names = [f"{p.__name__}.{room.name}" for p in (modal, nonlinear) for room in pkgutil.iter_modules(p.__path__)]
    return [modal, nonlinear, *(import_module(name) for name in names if "._" not in name)]


def callables() -> Iterator[tuple[str, Callable[..., Any]]]:
    """Every public function and class, with the public functions of each class; no alias of a type."""
    for room in rooms():
        for name in getattr(room, "__all__", ()):
            thing = getattr(room, name)
            if not callable(thing) or get_origin(thing) is not None:
                continue
            yield f"{room.__name__}.{name}", thing
            for member in vars(thing) if isinstance(thing, type) else ():
                if not member.startswith("_") and callable(function := getattr(thing, member, None)):
                    yield f"{room.__name__}.{name}.{member}", function


def shown(function: Callable[..., Any]) -> str:
    try:
        return str(inspect.signature(function))
    except ValueError:  # of exceptions and other classes without Python code
        return ""


def test_signatures_show_no_representation_of_an_object() -> None:
    signatures = {name: shown(function) for name, function in callables()}
    assert len(signatures) > 900
    assert {name: words for name, words in signatures.items() if OBJECT.search(words)} == {}
    assert OBJECT.search(shown(lambda report=lambda done: None: None))


def test_a_part_shows_its_fields_with_types_and_defaults() -> None:
    parameters = inspect.signature(Bob).parameters
    assert list(parameters)[:3] == ["mass", "length", "damping"]
    assert parameters["mass"].default is inspect.Parameter.empty
    assert (parameters["damping"].annotation, parameters["damping"].default) == ("float", 0.0)
    assert inspect.signature(Pendulum).parameters["links"].annotation == "Sequence[AnyLink]"
    assert inspect.signature(Scene).parameters["support"].annotation == "Support | Moved | Sequence[Support | Moved]"
    for part in (Bob, Pendulum, Scene):
        assert list(inspect.signature(part).parameters) == list(part.fields)


def test_a_default_that_is_made_is_shown_as_it_is_made() -> None:
    assert "supports: 'Floats' = array([], dtype=float64)" in shown(nonlinear.State)
    assert "before: 'Kicks' = no kicks, report: 'Report' = silent" in shown(simulate)
    assert silent(0.5, 1.0) is None


def test_completion_offers_what_is_public() -> None:
    assert {*modal.__all__, "tune"} == set(dir(modal))
    assert set(nonlinear.__all__) == set(dir(nonlinear))
    packages = [room for room in rooms() if hasattr(room, "__path__")]
    later = {"modal": {"tune"}, "modal.exports": {"read_json", "read_npz", "to_control", "to_scipy"}}
    assert len(packages) > 30
    assert all({*dir(room)} == {*room.__all__} | later.get(room.__name__, set()) for room in packages)
    modes = natural_modes(load("paper-cart-2"))
    assert {"omega", "frequency", "shape", "plot", "table", "to_dict"} <= set(dir(modes))
    assert not {"rig", "short", "limits", "which", "internal"} & set(dir(modes))
    assert {"mass", "length", "count", "replace", "centre"} <= set(dir(modes.scene.pendulum[0].links[0]))
    results: list[object] = [
        modes.scene.support,
        modes,
        modes[1],
        modes.shape(1),
        modes.scene,
        simulate(modes.scene, 0.1),
    ]
    for result in results:
        assert not [name for name in dir(result) if name.startswith("_")]


def test_an_index_of_no_mode_is_one_error_in_all_places() -> None:
    modes = natural_modes(load("paper-cart-2"))
    for ask in (lambda: modes[9], lambda: modes.shape(9), lambda: modes.plot([9]), lambda: list(modes.rows([9]))):
        with pytest.raises(IndexError, match="there is no mode of index 9: 5 modes have indices 0 to 4"):
            ask()
    with pytest.raises(TypeError, match="modes have indices from 0"):
        modes.shape("omega")  # type: ignore[arg-type]
    np.testing.assert_array_equal(modes.shape(-1).angles, modes.shape(4).angles)


def test_no_public_result_shows_a_bare_listing_of_its_fields() -> None:
    """Each says what it is, and of what it has by names in words, with units."""
    classes = {thing for name, thing in callables() if isinstance(thing, type) and issubclass(thing, Displayed)}
    bare = {each.__name__ for each in classes if each._summary is Displayed._summary and not each.shows}
    shown = {each for each in classes if each.__repr__ is Displayed.__repr__}
    assert len(classes) > 100
    assert bare & {each.__name__ for each in shown} == {"Displayed"}
    for each in shown - {Displayed}:
        names = [words.partition(": ")[0] for words in each.shows.split("; ") if each.shows]
        assert all(name in each.__dataclass_fields__ or hasattr(each, name) for name in names), each
