"""Recording of plain arithmetic, operation by operation, and its derivatives.

The equations of motion are plain arithmetic: run with symbols in place of numbers they leave their operations on a
tape, each once, without those that involve only a 0.  The inputs have a kind: "p" (the numbers of a scene), "u" (what
time brings), "y" (the state), "v" (a direction).  `nonlinear.dynamics.text` writes the tape as code.

Derivatives are found on the same tape by the chain rule, forwards: `partials` are the entries of a Jacobian that are
not zero, `directional_derivatives` is its product with a vector; `gradient` goes backwards
[Griewank2008, §§3.1 and 3.2].
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import wraps
from typing import Any

import numpy as np


class Tape:
    """Recorded operations in order; `known` maps each to its symbol, so that none is recorded twice."""

    def __init__(self) -> None:
        self.known: dict[tuple[Any, ...], Symbol] = {}
        self.sizes: dict[str, int] = {}

    def symbol(self, *operation: Any) -> Symbol:
        """The result of an operation on symbols and floats; a + b is b + a, and a b is b a."""
        if operation[0] in {"+", "*"} and (swap := (operation[0], operation[2], operation[1])) in self.known:
            return self.known[swap]
        if operation not in self.known:
            self.known[operation] = Symbol(self, operation)
        return self.known[operation]

    def inputs(self, kind: str, count: int) -> Any:
        """Add inputs of a kind and return them as an array (count,)."""
        at = self.sizes.get(kind, 0)
        self.sizes[kind] = at + count
        symbols = np.empty(count, dtype=object)
        symbols[:] = [self.symbol("in", kind, k) for k in range(at, at + count)]
        return symbols


def _scalar(operation: Any) -> Any:
    """An operator that leaves arrays to apply it to their elements."""

    @wraps(operation)
    def apply(self: Symbol, other: Any) -> Any:
        return NotImplemented if isinstance(other, np.ndarray) else operation(self, other)

    return apply


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
        if other is self:
            return 0.0
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

    def __pow__(self, power: Any) -> Any:
        if isinstance(power, Symbol) or power != int(power):
            raise TypeError("a recorded number has whole powers: write others with exp, log and sqrt")
        if power < 0:
            return 1.0 / self**-power
        half = 1.0 if power < 2 else self ** (power // 2)
        return half * half * (self if power % 2 else 1.0)

    def __neg__(self) -> Any:
        return self.operation[1] if self.operation[0] == "neg" else self.tape.symbol("neg", self)

    def sin(self) -> Any:
        """The sine, which NumPy asks of the elements of an array."""
        return self.tape.symbol("sin", self)

    def cos(self) -> Any:
        """The cosine."""
        return self.tape.symbol("cos", self)

    def sqrt(self) -> Any:
        """The square root."""
        return self.tape.symbol("sqrt", self)

    def arctan(self) -> Any:
        """The inverse tangent."""
        return self.tape.symbol("arctan", self)

    def exp(self) -> Any:
        """The exponential function."""
        return self.tape.symbol("exp", self)

    def log(self) -> Any:
        """The natural logarithm."""
        return self.tape.symbol("log", self)

    def tanh(self) -> Any:
        """The hyperbolic tangent."""
        return self.tape.symbol("tanh", self)

    def where(self, a: Any, b: Any) -> Any:
        """The a where this is positive, elsewhere b."""
        if a is b or (not isinstance(a, Symbol) and _is(b, a)):
            return a
        return self.tape.symbol("where", self, *(v if isinstance(v, Symbol) else float(v) for v in (a, b)))

    __radd__, __rmul__ = __add__, __mul__


def _is(value: Any, number: float) -> bool:
    return not isinstance(value, Symbol) and bool(value == number)


def where(x: Any, a: Any, b: Any) -> Any:
    """The a where the real part of x is positive, elsewhere b: arrays of numbers or of symbols, or one number."""
    is_symbolic = isinstance(x, np.ndarray) and x.dtype.hasobject
    return _of_each(x, a, b) if is_symbolic else np.where(np.real(x) > 0, a, b)


_of_each = np.frompyfunc(Symbol.where, 3, 1)


def uses(outputs: Sequence[Any]) -> dict[int, int]:
    """How often each symbol is used, by its identity; the symbols of these are `order`."""
    counts: dict[int, int] = {}
    pending = list(outputs)
    while pending:
        value = pending.pop()
        if isinstance(value, Symbol):
            counts[id(value)] = counts.get(id(value), 0) + 1
            if counts[id(value)] == 1:
                pending += value.operation[1:]
    return counts


def order(tape: Tape, used: dict[int, int]) -> list[Symbol]:
    """The symbols that are used, in the order of the tape."""
    return [symbol for symbol in tape.known.values() if id(symbol) in used]


# ---------------------------------------------------------------------------------------------------- derivatives


def partials(tape: Tape, outputs: Sequence[Any], by: Sequence[Symbol]) -> list[dict[int, Any]]:
    """Of every output its derivatives by these inputs that are not zero, {number of the input: derivative}."""
    slopes: dict[int, dict[int, Any]] = {id(symbol): {k: 1.0} for k, symbol in enumerate(by)}
    for symbol in order(tape, uses(outputs)):
        if id(symbol) not in slopes:
            slopes[id(symbol)] = _chain_rule(symbol, slopes)
    return [slopes[id(output)] if isinstance(output, Symbol) else {} for output in outputs]


def directional_derivatives(tape: Tape, outputs: Sequence[Any], by: Sequence[Symbol], v: Sequence[Any]) -> list[Any]:
    """J v, the derivatives of the outputs as these inputs change by v."""
    slopes: dict[int, dict[int, Any]] = {id(symbol): {0: change} for symbol, change in zip(by, v, strict=True)}
    for symbol in order(tape, uses(outputs)):
        if id(symbol) not in slopes:
            slopes[id(symbol)] = _chain_rule(symbol, slopes)
    return [slopes[id(output)].get(0, 0.0) if isinstance(output, Symbol) else 0.0 for output in outputs]


def gradient(tape: Tape, output: Any, by: Sequence[Any]) -> list[Any]:
    """The derivatives of one output by these inputs, backwards: of a whole chain in a few times its operations."""
    slopes: dict[int, Any] = {id(output): 1.0}
    for symbol in reversed(order(tape, uses([output]))):
        operator, *operands = symbol.operation
        for k, operand in enumerate(operands if operator != "in" else ()):
            if isinstance(operand, Symbol):
                unit = [float(k == j) for j in range(len(operands))]
                share = RULES[operator](symbol, *operands, *unit) * slopes[id(symbol)]
                slopes[id(operand)] = slopes.get(id(operand), 0.0) + share
    return [slopes.get(id(symbol), 0.0) for symbol in by]


DIVISOR_MIN = 1e-300
"""Format: in place of a divisor that is 0 together with its dividend: the speed of a body at rest."""

RULES: dict[str, Callable[..., Any]] = {
    "+": lambda f, a, b, da, db: da + db,
    "-": lambda f, a, b, da, db: da - db,
    "*": lambda f, a, b, da, db: da * b + a * db,
    "/": lambda f, a, b, da, db: (da - f * db) / b,
    "neg": lambda f, a, da: -da,
    "sin": lambda f, a, da: a.cos() * da,
    "cos": lambda f, a, da: -(a.sin() * da),
    "sqrt": lambda f, a, da: 0.5 * da / (f + DIVISOR_MIN),
    "arctan": lambda f, a, da: da / (1.0 + a * a),
    "exp": lambda f, a, da: f * da,
    "log": lambda f, a, da: da / a,
    "tanh": lambda f, a, da: (1.0 - f * f) * da,
    "where": lambda f, a, b, c, da, db, dc: a.where(db, dc),
}
"""The derivative of f = operator(a, b) from the changes da and db of a and b."""


def _chain_rule(symbol: Symbol, slopes: dict[int, dict[int, Any]]) -> dict[int, Any]:
    operator, *operands = symbol.operation
    if operator == "in":
        return {}
    operand_slopes = [slopes[id(operand)] if isinstance(operand, Symbol) else {} for operand in operands]
    changes = {}
    for k in sorted(set().union(*operand_slopes)):
        change = RULES[operator](symbol, *operands, *(slope.get(k, 0.0) for slope in operand_slopes))
        if isinstance(change, Symbol) or change:
            changes[k] = change
    return changes
