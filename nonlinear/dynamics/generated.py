"""Equations of motion as straight-line Python: no arrays, matrices or loops, for scenes of a few links.

The plain code of `nonlinear.dynamics.minimal` is run once with symbols in place of numbers.  Its operations are
recorded one by one, each once, without those that involve only a 0 or that no acceleration needs.  For few links
Python's floats are several times faster than NumPy, which would spend most of its time on calls.
The constants of a scene are arguments of the generated code: scenes that differ only in these share it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache, wraps
from math import cos, sin
from typing import Any

import numpy as np

from nonlinear.dynamics.dense import Elimination, loses_digits
from nonlinear.dynamics.minimal import Body, Minimal, Recursion
from nonlinear.system import Group, System

SHORT = 6  # links of a chain up to which its matrix takes fewer operations than the recursion
FEW = 2  # pendula up to which many states side by side pass one by one through the generated code
DEEPEST = 40  # nesting of parentheses
UNDEFINED = (ZeroDivisionError, OverflowError, ValueError)
"""Raised by Python's floats where NumPy's give inf or nan."""

Rate = Callable[[Sequence[float]], list[float]]


class Tape:
    """Recorded operations in order; `known` maps each to its symbol, so that none is recorded twice."""

    def __init__(self) -> None:
        self.known: dict[tuple[Any, ...], Symbol] = {}

    def symbol(self, *operation: Any) -> Symbol:
        """The result of an operation on symbols and floats."""
        if operation not in self.known:
            self.known[operation] = Symbol(self, operation)
        return self.known[operation]


def _scalar(operation: Any) -> Any:
    """An operator that leaves arrays to apply it to their elements."""

    @wraps(operation)
    def done(self: Symbol, other: Any) -> Any:
        return NotImplemented if isinstance(other, np.ndarray) else operation(self, other)

    return done


class Symbol:
    """An unknown number, as its operation: an operator or a function followed by its operands."""

    __slots__ = ("operation", "tape")

    def __init__(self, tape: Tape, operation: tuple[Any, ...]) -> None:
        self.tape, self.operation = tape, operation

    def _with(self, operator: str, left: Any, right: Any) -> Any:
        return self.tape.symbol(operator, *(v if isinstance(v, Symbol) else float(v) for v in (left, right)))

    @_scalar
    def __add__(self, other: Any) -> Any:
        return self if _is(other, 0) else self._with("+", self, other)

    @_scalar
    def __sub__(self, other: Any) -> Any:
        return self if _is(other, 0) else self._with("-", self, other)

    @_scalar
    def __rsub__(self, other: Any) -> Any:
        return -self if _is(other, 0) else self._with("-", other, self)

    @_scalar
    def __mul__(self, other: Any) -> Any:
        return 0.0 if _is(other, 0) else self if _is(other, 1) else self._with("*", self, other)

    @_scalar
    def __truediv__(self, other: Any) -> Any:
        return self if _is(other, 1) else self._with("/", self, other)

    @_scalar
    def __rtruediv__(self, other: Any) -> Any:
        return 0.0 if _is(other, 0) else self._with("/", other, self)

    def __pow__(self, power: int) -> Any:
        if power != 2:
            raise NotImplementedError
        return self * self

    def __neg__(self) -> Any:
        return self.tape.symbol("-", self)

    def sin(self) -> Any:
        """The sine, which NumPy asks of the elements of an array."""
        return self.tape.symbol("sin", self)

    def cos(self) -> Any:
        """The cosine."""
        return self.tape.symbol("cos", self)

    def sqrt(self) -> Any:
        """The square root."""
        return self.tape.symbol("sqrt", self)

    __radd__, __rmul__ = __add__, __mul__


def _is(value: Any, number: int) -> bool:
    return not isinstance(value, Symbol) and bool(value == number)


def called(name: str) -> Any:
    """A function of one symbol, applied to arrays elementwise."""
    return np.frompyfunc(lambda value: value.tape.symbol(name, value), 1, 1)


# ---------------------------------------------------------------------------------------------------------- writing


class Text:
    """The source of a function of y that returns `components`; `numbers` are the constants it needs."""

    def __init__(self, tape: Tape, components: Sequence[Any], size: int) -> None:
        self.named: dict[float, str] = {}
        self.written: dict[int, str] = {}
        lines = list(self._lines(tape, uses(components)))
        found = ", ".join(map(self._word, components))
        self.text = "\n".join(
            (
                f"def made({', '.join(('sin', 'cos', *self.named.values()))}):",
                " def rate(y):",
                f"  {', '.join(f'y{i}' for i in range(size))}, = y",
                *lines,
                f"  return [{found}]",
                " return rate",
            )
        )

    @property
    def numbers(self) -> list[float]:
        """The constants of the scene, in the order of the arguments after sine and cosine."""
        return list(self.named)

    def _lines(self, tape: Tape, uses: dict[int, int]) -> Iterator[str]:
        """Assignments of subexpressions used more than once or nested too deeply."""
        deep: dict[int, int] = {}
        for symbol in tape.known.values():
            if not (wanted := uses.get(id(symbol), 0)):
                continue
            name, (operator, *operands) = f"v{len(self.written)}", symbol.operation
            text = f"y{operands[0]}" if operator == "y" else joined(operator, [*map(self._word, operands)])
            deep[id(symbol)] = 0 if operator == "y" else 1 + max(deep.get(id(operand), 0) for operand in operands)
            if operator != "y" and (wanted > 1 or deep[id(symbol)] >= DEEPEST):
                yield f"  {name} = {text}"
                text, deep[id(symbol)] = name, 0
            self.written[id(symbol)] = text

    def _word(self, value: Any) -> str:
        if isinstance(value, Symbol):
            return self.written[id(value)]
        return self.named.setdefault(float(value), f"c{len(self.named)}")


def joined(operator: str, parts: Sequence[str]) -> str:
    """The text of an operation on what these words name."""
    if operator in {"sin", "cos"}:
        return f"{operator}({parts[0]})"
    if operator == "sqrt":
        return f"({parts[0]} ** 0.5)"
    return f"(-{parts[0]})" if len(parts) == 1 else f"({parts[0]} {operator} {parts[1]})"


def uses(components: Sequence[Any]) -> dict[int, int]:
    """How often each symbol is used."""
    uses: dict[int, int] = {}
    wanted = list(components)
    while wanted:
        value = wanted.pop()
        if isinstance(value, Symbol):
            uses[id(value)] = uses.get(id(value), 0) + 1
            if uses[id(value)] == 1:
                wanted += value.operation[1:]
    return uses


@lru_cache(maxsize=64)
def function_in(text: str, name: str) -> Callable[..., Any]:
    """The function of this name that a source text defines."""
    found: dict[str, Any] = {}
    exec(compile(text, f"<{name}>", "exec"), found)
    return found[name]  # type: ignore[no-any-return]


def written_body(group: Group, system: System, **how: Any) -> Body:
    """The solver of one group: elimination for short chains whose dense matrix keeps its digits, else the recursion."""
    written_out = group.n <= SHORT and not loses_digits(group, system)
    return Elimination(group, **how) if written_out else Recursion(group, **how)


@dataclass(frozen=True, eq=False)
class Generated(Minimal):
    """The equations of `Minimal` written out, without bodies and loads."""

    bodies: tuple[()] = ()

    @cached_property
    def text(self) -> Text:
        """The generated source of the time derivative of y."""
        tape, size = Tape(), self.layout.size
        plain = self._with_bodies(sine=called("sin"), cosine=called("cos"))
        y = np.array([tape.symbol("y", i) for i in range(size)], dtype=object)
        return Text(tape, plain.derivative(0.0, y).tolist(), size)

    def _function(self, sine: Any, cosine: Any) -> Callable[..., list[Any]]:
        made: Callable[..., Any] = function_in(self.text.text, "made")
        return made(sine, cosine, *self.text.numbers)  # type: ignore[no-any-return]

    @cached_property
    def rate(self) -> Rate:
        """The time derivative of one y in floats, a list."""
        return self._function(sin, cos)

    @cached_property
    def _rates(self) -> Callable[..., list[Any]]:
        return self._function(np.sin, np.cos)

    @cached_property
    def many(self) -> Minimal:
        """The same equations in NumPy for many states side by side, and all pendula of a group at once."""
        return self._with_bodies(tail=1)

    def _with_bodies(self, **how: Any) -> Minimal:
        bodies = tuple(written_body(group, self.system, **how) for group in self.system.groups)
        return Minimal(self.system, bodies, counts_work=self.counts_work)

    def derivative(self, time: float, y: Any) -> Any:
        """The time derivative of one y, (size,), or of many side by side, (size, S), real or complex."""
        if y.ndim > 1 and self.system.n_pendula > FEW:
            return self.many.derivative(time, y)
        found = np.empty_like(y)
        if y.ndim > 1:
            for row, rate in zip(found, self._rates(y), strict=True):
                row[...] = rate
            return found
        try:
            found[...] = self.rate(y.tolist())
        except UNDEFINED:
            found[...] = np.nan
        return found
