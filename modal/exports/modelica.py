"""Modelica 3 without any library: a block with named inputs, outputs and start values."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from modal.exports.identifiers import identifier, identifiers
from modal.exports.text import digits, heading, joined, matrices, rest
from modal.report import modelica_text
from modal.statespace import Signal, StateSpace
from modal.types import Floats

KEYWORDS = """
    algorithm and annotation assert block break class connect connector constant constrainedby der discrete each else
    elseif elsewhen encapsulated end enumeration equation expandable extends external false final flow for function if
    import impure in initial inner input loop model not operator or outer output package parameter partial protected
    public pure record redeclare replaceable return stream then true type when while within
    Real Integer Boolean String time abs max min sum product fill zeros ones pre sample terminal reinit
"""
TAKEN = (*KEYWORDS.split(), *"ABCDuyz", "z_next")
CONTINUOUS = """\
  der(z) = A * z + B * u;
  y = C * z + D * u;"""
DISCRETE = """\
  when sample(0.0, {dt!r}) then
    z = pre(z_next);
    y = C * z + D * u;
    z_next = A * z + B * u;
  end when;"""


def write_modelica(model: StateSpace) -> bytes:
    """The block; state NAME starts at the parameter `NAME_start`, 0 unless it is set."""
    return joined(_lines(model))


def unit(signal: Signal) -> str:
    """The unit in the syntax of Modelica and FMI, empty where their grammar has none.

    >>> unit(Signal("a", "m/s^2", "")), unit(Signal("b", "N m", ""))
    ('m/s2', 'N.m')
    """
    return "" if "(" in signal.unit else signal.unit.replace(" ", ".").replace("^", "")


def _lines(model: StateSpace) -> Iterator[str]:
    (name,) = identifiers([heading(model)], TAKEN)
    words = (f"{identifier(s.name, 'signal')}_start" for s in model.states)
    inner = identifiers([*(s.name for s in (*model.inputs, *model.outputs)), *words], [*TAKEN, name])
    m, p = len(model.inputs), len(model.outputs)
    inputs, outputs, starts = inner[:m], inner[m : m + p], inner[m + p :]
    yield f"block {name} {modelica_text(heading(model))}"
    yield from (f"  // {line}" for line in rest(model))
    yield from _declared("input Real", inputs, model.inputs)
    yield from _declared("output Real", outputs, model.outputs)
    yield from _declared("parameter Real", starts, model.states, " = 0.0")
    for letter, values in matrices(model):
        yield from _matrix(letter, values)
    yield from _vectors(model, inputs, starts)
    yield "equation"
    yield DISCRETE.format(dt=model.dt) if model.dt else CONTINUOUS
    yield from (f"  {word} = y[{row}];" for row, word in enumerate(outputs, 1))
    yield f"end {name};"


def _declared(what: str, words: Sequence[str], signals: Sequence[Signal], value: str = "") -> Iterator[str]:
    for word, signal in zip(words, signals, strict=True):
        modifier = f"(unit = {modelica_text(unit(signal))})" if unit(signal) else ""
        yield f"  {what} {word}{modifier}{value} {modelica_text(signal.meaning)};"


def _vectors(model: StateSpace, inputs: Sequence[str], starts: Sequence[str]) -> Iterator[str]:
    n, p = len(starts), len(model.outputs)
    names = ", ".join(f"{s.name} ({s.unit})" for s in model.states)
    kind, held = ("discrete Real", "z_next") if model.dt else ("Real", "z")
    begin = f"(start = {_array(starts)}, each fixed = true)"
    yield f"  Real u[{len(inputs)}] = {_array(inputs)};"
    yield f"  {kind} z[{n}]{begin if held == 'z' else ''} {modelica_text(names)};"
    if model.dt:
        yield f"  {kind} z_next[{n}]{begin} {modelica_text('the states one step on')};"
    yield f"  {kind} y[{p}];"


def _matrix(name: str, values: Floats) -> Iterator[str]:
    declared = f"  parameter Real {name}[{values.shape[0]}, {values.shape[1]}] ="
    if not values.size:
        yield f"{declared} zeros({values.shape[0]}, {values.shape[1]});"
        return
    yield f"{declared} ["
    yield ";\n".join(f"    {', '.join(row)}" for row in digits(values)) + "];"


def _array(words: Sequence[str]) -> str:
    return "{" + ", ".join(words) + "}" if words else "zeros(0)"
