"""Source text without any library: a C99 and C++ header for controllers, and a block of Modelica 3.

The header has the discrete matrices and a step function, without includes or allocation; the block has named inputs,
outputs and start values.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

from modal.errors import SceneError
from modal.exports.text import (
    datum,
    digits,
    heading,
    identifier,
    identifiers,
    matrices,
    meaning,
    preamble,
    rest,
    text_file,
)
from modal.report import c_comment, modelica_text
from modal.statespace import Signal, StateSpace
from modal.types import Floats

NUMBERS_A_LINE = 5
"""Format: numbers of a line of C."""
STEP = """\
/* y from the present z and u, then z after one step; y must not overlap z or u */
static inline void {name}_step(double z[], const double u[], double y[])
{{
    double next[{room}];
    int i, k;
    for (i = 0; i < {p}; i++) {{
        y[i] = 0.0;
        for (k = 0; k < {n}; k++) y[i] += {name}_C[i][k] * z[k];
        for (k = 0; k < {m}; k++) y[i] += {name}_D[i][k] * u[k];
    }}
    for (i = 0; i < {n}; i++) {{
        next[i] = 0.0;
        for (k = 0; k < {n}; k++) next[i] += {name}_A[i][k] * z[k];
        for (k = 0; k < {m}; k++) next[i] += {name}_B[i][k] * u[k];
    }}
    for (i = 0; i < {n}; i++) z[i] = next[i];
}}"""
KEYWORDS = """
    algorithm and annotation assert block break class connect connector constant constrainedby der discrete each else
    elseif elsewhen encapsulated end enumeration equation expandable extends external false final flow for function if
    import impure in initial inner input loop model not operator or outer output package parameter partial protected
    public pure record redeclare replaceable return stream then true type when while within
    Real Integer Boolean String time abs max min sum product fill zeros ones pre sample terminal reinit
"""
TAKEN = (*KEYWORDS.split(), *"ABCDuzy", "rate", "z_next", "state", "States")
DISCRETE = """\
  when sample(0.0, {dt!r}) then
    {held}
    y = C * z + D * u;
    z_next = A * z + B * u;
  end when;"""


def write_c(model: StateSpace) -> bytes:
    """The header; every name in it begins with the title's identifier.  Raise SceneError for a continuous model."""
    if not model.dt:
        raise SceneError(["`format=c` needs `sample(model, seconds)`, since a controller steps in time"])
    return text_file(_c_lines(model, identifier(heading(model)).lower()))


def _c_lines(model: StateSpace, name: str) -> Iterator[str]:
    capitals = name.upper()
    yield from map(c_comment, preamble(model))
    yield from (f"#ifndef {capitals}_H", f"#define {capitals}_H", "")
    yield f"#define {capitals}_DT {model.dt!r}"
    for kind, signals in (("STATE", model.states), ("INPUT", model.inputs), ("OUTPUT", model.outputs)):
        yield from _c_names(capitals, kind, signals)
    for letter, values in matrices(model):
        yield from ("", *c_matrix(f"{name}_{letter}", values))
    (n, m), p = model.B.shape, len(model.C)
    yield from ("", STEP.format(name=name, n=n, m=m, p=p, room=max(1, n)))
    yield from ("", f"#endif {c_comment(f'{capitals}_H')}")


def _c_names(capitals: str, kind: str, signals: tuple[Signal, ...]) -> Iterator[str]:
    yield from ("", "enum {")
    for word, signal in zip(identifiers(s.name for s in signals), signals, strict=True):
        yield f"    {capitals}_{kind}_{word}, {c_comment(meaning(signal))}"
    yield f"    {capitals}_{kind}S"
    yield "};"


def hexadecimal(number: float) -> str:
    """A number in a form that compilers read in half the time."""
    return number.hex() if number else "0.0"


def c_matrix(
    name: str, values: Floats, number: Callable[[float], str] = repr, *, by_place: bool = False
) -> Iterator[str]:
    """A constant; C has no arrays without elements, so an empty side has length one and contains a zero.

    `by_place` omits most zeros by designated initializers, which exist in C but not in C++.
    """
    rows, columns = (max(1, size) for size in values.shape)
    yield f"static const double {name}[{rows}][{columns}] = {{"
    yield from (_c_row(row, by_place=by_place) for row in digits(values, number) if row)
    if not values.size:
        yield "    {0.0}"
    yield "};"


def _c_row(row: list[str], *, by_place: bool) -> str:
    """A row; with `by_place`, a long one that is mostly zeros as its other entries by index."""
    if by_place and len(row) > 2 * NUMBERS_A_LINE and 4 * row.count("0.0") > 3 * len(row):
        entries = [f"[{place}] = {number}" for place, number in enumerate(row) if number != "0.0"]
        row = entries or ["0.0"]
    lines = [", ".join(row[k : k + NUMBERS_A_LINE]) for k in range(0, len(row), NUMBERS_A_LINE)]
    return "    {" + ",\n     ".join(lines) + "},"


# ----------------------------------------------------------------------------------------------------------- Modelica


class PublicNames(NamedTuple):
    """The names in Modelica, and in an FMU the same: states are `state.NAME` there, and start at the `starts`."""

    block: str
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    states: tuple[str, ...]
    starts: tuple[str, ...]


def public_names(model: StateSpace) -> PublicNames:
    """The public names of a model, all different; state NAME starts at the parameter `NAME_start`."""
    (block,) = identifiers([heading(model)], TAKEN)
    starts = [f"{identifier(s.name, 'signal')}_start" for s in model.states]
    names = identifiers([*(s.name for s in (*model.inputs, *model.outputs)), *starts], [*TAKEN, block])
    m, p = len(model.inputs), len(model.outputs)
    states = identifiers((s.name for s in model.states), TAKEN)
    return PublicNames(block, names[:m], names[m : m + p], states, names[m + p :])


def write_modelica(model: StateSpace) -> bytes:
    """The block, with the names of `public_names`; starts are 0 unless they are set."""
    return text_file(_modelica_lines(model))


def unit(signal: Signal) -> str:
    """The unit in the syntax of Modelica and FMI, empty where their grammar has none.

    >>> unit(Signal("a", "m/s^2", "")), unit(Signal("b", "N m", ""))
    ('m/s2', 'N.m')
    """
    return "" if "(" in signal.unit else signal.unit.replace(" ", ".").replace("^", "")


def _modelica_lines(model: StateSpace) -> Iterator[str]:
    names, n, p = public_names(model), len(model.states), len(model.outputs)
    kind = "discrete Real" if model.dt else "Real"
    yield f"block {names.block} {modelica_text(heading(model))}"
    yield from (f"  // {line}" for line in rest(model))
    yield from _declarations("input Real", names.inputs, model.inputs)
    yield from _declarations("output Real", names.outputs, model.outputs)
    yield from _declarations("parameter Real", names.starts, model.states, " = 0.0")
    yield "  record States"
    yield from _declarations(f"  {kind}", names.states, model.states)
    yield "  end States;"
    begin = (f"{word}(start = {start}, fixed = true)" for word, start in zip(names.states, names.starts, strict=True))
    modifiers = ",\n      ".join(begin)
    yield f'  States state{f"({modifiers})" if n else ""} "deviations from {datum(model)}";'
    yield "protected"
    for letter, values in matrices(model):
        yield from _modelica_matrix(letter, values)
    states = [f"state.{word}" for word in names.states]
    yield f"  Real u[{len(names.inputs)}] = {_array(names.inputs)};"
    yield f"  Real z[{n}] = {_array(states)};"
    if model.dt:
        yield f"  discrete Real z_next[{n}](start = {_array(names.starts)}, each fixed = true);"
        yield f"  discrete Real y[{p}];"
    else:
        yield f"  Real rate[{n}] = A * z + B * u;"
        yield f"  Real y[{p}] = C * z + D * u;"
    yield "equation"
    if model.dt:
        held = "\n    ".join(f"{word} = pre(z_next[{k}]);" for k, word in enumerate(states, 1))
        yield DISCRETE.format(dt=model.dt, held=held)
    else:
        yield from (f"  der({word}) = rate[{k}];" for k, word in enumerate(states, 1))
    yield from (f"  {word} = y[{row}];" for row, word in enumerate(names.outputs, 1))
    yield f"end {names.block};"


def _declarations(what: str, words: Sequence[str], signals: Sequence[Signal], value: str = "") -> Iterator[str]:
    for word, signal in zip(words, signals, strict=True):
        modifier = f"(unit = {modelica_text(unit(signal))})" if unit(signal) else ""
        yield f"  {what} {word}{modifier}{value} {modelica_text(signal.meaning)};"


def _modelica_matrix(name: str, values: Floats) -> Iterator[str]:
    head = f"  final parameter Real {name}[{values.shape[0]}, {values.shape[1]}] ="
    if not values.size:
        yield f"{head} zeros({values.shape[0]}, {values.shape[1]});"
        return
    yield f"{head} ["
    yield ";\n".join(f"    {', '.join(row)}" for row in digits(values)) + "];"


def _array(words: Sequence[str]) -> str:
    return "{" + ", ".join(words) + "}" if words else "zeros(0)"
