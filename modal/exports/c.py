"""A C99 and C++ header for controllers: the discrete matrices and a step function, without includes or allocation."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from modal.errors import SceneError
from modal.exports.identifiers import identifier, identifiers
from modal.exports.text import digits, heading, joined, matrices, meaning, preamble
from modal.report import c_comment
from modal.statespace import Signal, StateSpace
from modal.types import Floats

NUMBERS_A_LINE = 5
LONG_ROW, MOSTLY = 8, 0.75
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


def write_c(model: StateSpace) -> bytes:
    """The header; every name in it begins with the title's identifier.  Raises SceneError for a continuous model."""
    if not model.dt:
        raise SceneError(["a C header needs a sampled model, since a controller steps in time"])
    return joined(_lines(model, identifier(heading(model)).lower()))


def _lines(model: StateSpace, name: str) -> Iterator[str]:
    capitals = name.upper()
    yield from map(c_comment, preamble(model))
    yield from (f"#ifndef {capitals}_H", f"#define {capitals}_H", "")
    yield f"#define {capitals}_DT {model.dt!r}"
    for kind, signals in (("STATE", model.states), ("INPUT", model.inputs), ("OUTPUT", model.outputs)):
        yield from _names(capitals, kind, signals)
    for letter, values in matrices(model):
        yield from ("", *c_matrix(f"{name}_{letter}", values))
    (n, m), p = model.B.shape, len(model.C)
    yield from ("", STEP.format(name=name, n=n, m=m, p=p, room=max(1, n)))
    yield from ("", f"#endif {c_comment(f'{capitals}_H')}")


def _names(capitals: str, kind: str, signals: tuple[Signal, ...]) -> Iterator[str]:
    yield from ("", "enum {")
    for word, signal in zip(identifiers(s.name for s in signals), signals, strict=True):
        yield f"    {capitals}_{kind}_{word}, {c_comment(meaning(signal))}"
    yield f"    {capitals}_{kind}S"
    yield "};"


# --------------------------------------------------------------------------------- matrices


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
    yield from (_row(row, by_place=by_place) for row in digits(values, number) if row)
    if not values.size:
        yield "    {0.0}"
    yield "};"


def _row(row: list[str], *, by_place: bool) -> str:
    """A row; with `by_place`, a long one that is mostly zeros as its other entries by index."""
    if by_place and len(row) > LONG_ROW and row.count("0.0") > MOSTLY * len(row):
        kept = [f"[{place}] = {number}" for place, number in enumerate(row) if number != "0.0"]
        row = kept or ["0.0"]
    lines = [", ".join(row[k : k + NUMBERS_A_LINE]) for k in range(0, len(row), NUMBERS_A_LINE)]
    return "    {" + ",\n     ".join(lines) + "},"
