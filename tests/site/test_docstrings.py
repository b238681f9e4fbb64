"""Pages of functions: Parameters, Returns, Raises and Examples, from the docstrings' headings or prose."""

from __future__ import annotations

import inspect
from importlib.util import find_spec
from typing import Any

import pytest

import modal
import nonlinear

if find_spec("sphinx") is None:
    pytest.skip("the extra docs is not installed", allow_module_level=True)

from docstrings import documentation, sections

FUNCTIONS = [
    pytest.param(getattr(package, name), id=f"{package.__name__}.{name}")
    for package in (modal, nonlinear)
    for name in package.__all__
    if inspect.isroutine(getattr(package, name))
]
PROSE = """The shaper of one mode, on the grid of a `step` (s).

`kind` is "zv" or "zvd".  `first` and `last` are modes.  Raises ValueError for another kind, ComputationError where a
mode does not oscillate.

>>> 1 + 1
2
"""


def shaper(kind: str, step: float = 0.0, first: int = 0, last: int = 1) -> modal.Shape:
    raise NotImplementedError


shaper.__doc__ = PROSE


def lines(thing: Any) -> list[str]:
    return (inspect.getdoc(thing) or "").split("\n")


@pytest.mark.parametrize("function", FUNCTIONS)
def test_every_public_function_has_its_sections(function: Any) -> None:
    signature = inspect.signature(function)
    told = sections(lines(function), signature.parameters)
    described = [name.lstrip("*") for names in told.parameters for name in names.split(", ")]
    assert described == list(signature.parameters)
    assert min((len(words) for words in told.parameters.values()), default=99) > 10
    assert bool(told.returns) == (signature.return_annotation != "None")
    assert "Raises" not in " ".join(told.prose)
    assert any(line.startswith(">>>") for line in told.examples)
    page = "\n".join(documentation(lines(function), function))
    assert all(f":raises {error}: {words[:8]}" in page for error, words in told.raises.items())


def test_sections_are_found_in_prose() -> None:
    told = sections(lines(shaper), inspect.signature(shaper).parameters)
    assert told.prose[0] == "The shaper of one mode, on the grid of a `step` (s)."
    assert "`first` and `last` are modes." in told.prose
    assert told.parameters == {"kind": '"zv" or "zvd".'}
    assert told.raises == {"ValueError": "for another kind", "ComputationError": "where a mode does not oscillate"}
    assert told.examples[:2] == [">>> 1 + 1", "2"]


def test_fields_have_types_and_links() -> None:
    page = documentation(lines(shaper), shaper)
    assert ":type step: float, default ``0.0``" in page
    assert ":rtype: modal.Shape" in page
    assert page.index(".. rubric:: Examples") > page.index(':param kind: "zv" or "zvd".')


def test_parts_of_scenes_have_the_meanings_of_their_keys() -> None:
    page = documentation(lines(modal.Rod), modal.Rod)
    assert ":param mass: positive (kg)" in page
    assert [line for line in page if line.startswith(":param")] == [
        next(line for line in page if line.startswith(f":param {name}:")) for name in modal.Rod.fields
    ]
