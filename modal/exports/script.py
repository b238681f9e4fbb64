"""A Python script that builds the model and needs only python-control; comments give the units."""

from __future__ import annotations

from collections.abc import Iterator

from modal.exports.identifiers import identifier
from modal.exports.text import digits, heading, joined, matrices, meaning, rest
from modal.report import python_text
from modal.statespace import Signal, StateSpace
from modal.types import Floats

FIRST = (
    "# -*- coding: utf-8 -*-",
    "# A linear state-space model for python-control, in SI units, deviations from the equilibrium.",
)
"""Python looks for an encoding in the first two lines of a file: they contain no text of a scene."""


def write_script(model: StateSpace) -> bytes:
    """The script; run it or import `system` from it."""
    return joined(_lines(model))


def _lines(model: StateSpace) -> Iterator[str]:
    yield from FIRST
    yield from (f"# {line}" for line in rest(model))
    yield from ("", "import control", "import numpy as np", "", f"title = {python_text(heading(model))}")
    for name, signals in (("states", model.states), ("inputs", model.inputs), ("outputs", model.outputs)):
        yield from _names(name, signals)
    for name, values in matrices(model):
        yield from _matrix(name, values)
    yield from ("", "system = control.StateSpace(", f"    A, B, C, D, {model.dt!r},")
    yield f"    name={python_text(identifier(heading(model)))}, states=states, inputs=inputs, outputs=outputs,"
    yield ")"


def _names(name: str, signals: tuple[Signal, ...]) -> Iterator[str]:
    yield f"{name} = ["
    yield from (f"    {python_text(signal.name)},  # {meaning(signal)}" for signal in signals)
    yield "]"


def _matrix(name: str, values: Floats) -> Iterator[str]:
    yield f"{name} = np.array(["
    yield from (f"    [{', '.join(row)}]," for row in digits(values))
    yield f"]).reshape({values.shape[0]}, {values.shape[1]})"
