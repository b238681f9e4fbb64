"""The joint laws as programs for compiled loops: operations in order, each a row of numbers that holds its result.

A row is (operation, three rows that it takes, result).  The first two rows of a joint hold its bend and the rate of
that, the last two what its laws give: the part that a potential accounts for, and what does work.  They are what the
laws leave on a tape with the numbers of the scene; nothing of a law is compiled, so any law runs in the same loop.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from modal.types import Floats
from nonlinear.dynamics.compiling import in_place
from nonlinear.dynamics.tape import Symbol, Tape, order, uses
from nonlinear.system import Group, System

OPERATIONS = ("=", "+", "-", "*", "/", "neg", "sin", "cos", "sqrt", "arctan", "exp", "log", "tanh", "where")


def programs_of(system: System) -> tuple[Floats, Floats]:
    """All rows (R, 5), and where those of every link begin and end, (L, 2): nowhere without laws."""
    rows: list[list[float]] = []
    places = np.zeros((system.n_links, 2))
    for group in system.groups:
        joints = {place for term in group.laws for place in zip(term.rows.tolist(), term.columns.tolist(), strict=True)}
        for row, column in sorted(joints):
            start = len(rows)
            rows += _program(group, row, column, start)
            places[group.index[row, column]] = start, len(rows)
    return np.array(rows, dtype=float).reshape(-1, 5), places


def _program(group: Group, row: int, column: int, start: int) -> list[list[float]]:
    """The rows of one joint, numbered from `start`."""
    tape = Tape()
    bend, rate = inputs = tape.inputs("y", 2)[:, None]
    torques: list[Any] = [0.0, 0.0]
    for term in group.laws:
        for at in np.flatnonzero((term.rows == row) & (term.columns == column)).tolist():
            parts = term.at(at).torques(bend, rate)
            torques = [total + np.ravel(part)[0] for total, part in zip(torques, parts, strict=True)]
    rows: list[list[float]] = [[0.0, 0.0, 0.0, 0.0, 0.0] for _ in inputs]
    places = {id(symbol): start + k for k, symbol in enumerate(inputs.ravel())}

    def place(value: Any) -> int:
        if isinstance(value, Symbol):
            return places[id(value)]
        rows.append([0.0, 0.0, 0.0, 0.0, float(value)])
        return start + len(rows) - 1

    for symbol in order(tape, uses(torques)):
        operator, *operands = symbol.operation
        if operator != "in":
            taken = [*map(place, operands), start, start][:3]
            places[id(symbol)] = start + len(rows)
            rows.append([float(OPERATIONS.index(operator)), *map(float, taken), 0.0])
    zero = place(0.0)
    ends = [place(torque) if isinstance(torque, Symbol) or torque else zero for torque in torques]
    return [*rows, *([1.0, float(end), float(zero), 0.0, 0.0] for end in ends)]


@in_place
def run_program(rows, start, end, bend, rate):  # type: ignore[no-untyped-def]  # noqa: PLR0912 - one for each operation
    """The two torques (N m) of the laws of a joint, whose rows hold intermediate results."""
    rows[start, 4], rows[start + 1, 4] = bend, rate
    for k in range(start + 2, end):
        operation = int(rows[k, 0])
        if operation == 0:
            continue
        a, b = rows[int(rows[k, 1]), 4], rows[int(rows[k, 2]), 4]
        if operation == 1:
            value = a + b
        elif operation == 2:
            value = a - b
        elif operation == 3:
            value = a * b
        elif operation == 4:
            value = a / b
        elif operation == 5:
            value = -a
        elif operation == 6:
            value = math.sin(a)
        elif operation == 7:
            value = math.cos(a)
        elif operation == 8:
            value = math.sqrt(a)
        elif operation == 9:
            value = math.atan(a)
        elif operation == 10:
            value = math.exp(a)
        elif operation == 11:
            value = math.log(a)
        elif operation == 12:
            value = math.tanh(a)
        else:
            value = b if a > 0 else rows[int(rows[k, 3]), 4]
        rows[k, 4] = value
    return rows[end - 2, 4], rows[end - 1, 4]
