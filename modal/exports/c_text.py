"""Matrices in C99 and, but for those `by_place`, in C++."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from modal.exports.text import digits
from modal.types import Floats

NUMBERS_A_LINE = 5
LONG_ROW, MOSTLY = 8, 0.75


def hexadecimal(number: float) -> str:
    """A number that compilers read in half the time."""
    return number.hex() if number else "0.0"


def c_matrix(
    name: str, values: Floats, number: Callable[[float], str] = repr, *, by_place: bool = False
) -> Iterator[str]:
    """A constant; C has no arrays of no elements, so an empty side has length one and holds a zero.

    `by_place` leaves most zeros out, which C can say and C++ cannot.
    """
    rows, columns = (max(1, size) for size in values.shape)
    yield f"static const double {name}[{rows}][{columns}] = {{"
    yield from (_row(row, by_place=by_place) for row in digits(values, number) if row)
    if not values.size:
        yield "    {0.0}"
    yield "};"


def _row(row: list[str], *, by_place: bool) -> str:
    """A row; `by_place`, of a long one that is mostly zeros only the rest, by their places."""
    if by_place and len(row) > LONG_ROW and row.count("0.0") > MOSTLY * len(row):
        kept = [f"[{place}] = {number}" for place, number in enumerate(row) if number != "0.0"]
        row = kept or ["0.0"]
    lines = [", ".join(row[k : k + NUMBERS_A_LINE]) for k in range(0, len(row), NUMBERS_A_LINE)]
    return "    {" + ",\n     ".join(lines) + "},"
