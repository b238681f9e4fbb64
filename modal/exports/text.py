"""Helpers of all text formats: numbers that read back bit for bit, and the descriptive header of a file."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator

from modal.report import one_line
from modal.statespace import Signal, StateSpace
from modal.types import Floats

UNTITLED = "Pendula"


def heading(model: StateSpace) -> str:
    """The title on one line."""
    return one_line(model.title) or UNTITLED


def meaning(signal: Signal) -> str:
    """Unit and meaning of a signal for a comment."""
    return one_line(f"{signal.unit}, {signal.meaning}")


def law(model: StateSpace) -> str:
    """The equations of a model on one line."""
    if model.dt:
        return f"z[k+1] = A z[k] + B u[k], y[k] = C z[k] + D u[k], one step every {model.dt!r} s"
    return "z' = A z + B u, y = C z + D u"


def rest(model: StateSpace) -> list[str]:
    """The operating point, one line per angle."""
    return [one_line(f"{name} = {value!r} {unit_of(name)} at equilibrium") for name, value in model.operating_point]


def unit_of(name: str) -> str:
    """The unit of a coordinate of the operating point."""
    return "m" if name == "x" else "rad"


def preamble(model: StateSpace) -> list[str]:
    """The header of a file: title, equations, operating point."""
    return [heading(model), f"{law(model)}, in SI units, deviations from the equilibrium", *rest(model)]


def matrices(model: StateSpace) -> tuple[tuple[str, Floats], ...]:
    """The four matrices by name."""
    return ("A", model.A), ("B", model.B), ("C", model.C), ("D", model.D)


def digits(values: Floats, number: Callable[[float], str] = repr) -> Iterator[list[str]]:
    """Row by row, the shortest decimals that read back as equal doubles; −0 is written as 0."""
    return (list(map(number, row)) for row in (values + 0.0).tolist())


def joined(lines: Iterable[str]) -> bytes:
    """Lines as a UTF-8 file."""
    return ("\n".join(lines) + "\n").encode()
