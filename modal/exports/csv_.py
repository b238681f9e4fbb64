"""One table in long form: one number per row, with the names and units of its row and column."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from modal.exports.text import matrices, unit_of
from modal.report import csv_rows
from modal.statespace import StateSpace

HEADER = ("matrix", "row", "row_name", "row_unit", "column", "column_name", "column_unit", "value")


def write_csv(model: StateSpace) -> bytes:
    """HEADER, then title, dt, the operating point, and A, B, C, D by rows; rows and columns count from 1.

    A row of A and B is named after its state.
    """
    return csv_rows(_rows(model)).encode()


def _rows(model: StateSpace) -> Iterator[tuple[Any, ...]]:
    yield HEADER
    yield "title", "", "", "", "", "", "", model.title
    yield "dt", "", "", "s", "", "", "", repr(model.dt)
    for number, (name, value) in enumerate(model.operating_point, 1):
        yield "operating_point", number, name, unit_of(name), "", "", "", repr(value)
    sides = {
        "A": (model.states, model.states),
        "B": (model.states, model.inputs),
        "C": (model.outputs, model.states),
        "D": (model.outputs, model.inputs),
    }
    for name, values in matrices(model):
        rows, columns = ([(k, s.name, s.unit) for k, s in enumerate(side, 1)] for side in sides[name])
        for row, line in zip(rows, values.tolist(), strict=True):
            for column, value in zip(columns, line, strict=True):
                yield name, *row, *column, repr(value)
