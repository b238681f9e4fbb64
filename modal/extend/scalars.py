"""Functions of plain arithmetic over any scalar, so that an extension writes its physics once.

Floats, complex numbers, arrays, recorded symbols, SymPy expressions and multiprecision numbers bring their own
functions, as methods or in their packages; all others are passed to NumPy as floats.

Derivatives of extensions are those of jets, Taylor polynomials of second order in one direction.  A jet is f(t) with
f' and f'' at t = 0.  Its parts may be floats, arrays, complex numbers, recorded symbols or SymPy's expressions.
Parts that are the float 0.0 stay so without an operation, so that records of it are short:

    (f g)'' = f'' g + 2 f' g' + f g'',      h(f)'' = h''(f) f'² + h'(f) f''
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np


def _apply(name: str, x: Any) -> Any:
    if isinstance(x, np.ndarray) and x.dtype.hasobject:
        return np.frompyfunc(partial(_apply, name), 1, 1)(x)
    if not isinstance(x, np.ndarray) and callable(method := getattr(x, name, None)):
        return method()
    package = sys.modules.get(type(x).__module__.partition(".")[0])
    return getattr(package, name, getattr(np, name))(x)


def sin(x: Any) -> Any:
    """The sine of any scalar.

    >>> from modal.extend import sin
    >>> float(sin(0.0)), complex(sin(0j))
    (0.0, 0j)
    """
    return _apply("sin", x)


def cos(x: Any) -> Any:
    """The cosine of any scalar.

    >>> from sympy import Symbol
    >>> from modal.extend import cos
    >>> cos(Symbol("theta"))
    cos(theta)
    """
    return _apply("cos", x)


def exp(x: Any) -> Any:
    """The exponential of any scalar.

    >>> from modal.extend import exp
    >>> float(exp(0))
    1.0
    """
    return _apply("exp", x)


def log(x: Any) -> Any:
    """The natural logarithm of any scalar.

    >>> from modal.extend import log
    >>> float(log(1.0))
    0.0
    """
    return _apply("log", x)


def sqrt(x: Any) -> Any:
    """The square root of any scalar.

    >>> from modal.extend import sqrt
    >>> float(sqrt(4.0))
    2.0
    """
    return _apply("sqrt", x)


def tanh(x: Any) -> Any:
    """The hyperbolic tangent of any scalar.

    >>> from modal.extend import tanh
    >>> float(tanh(0.0))
    0.0
    """
    return _apply("tanh", x)


def plus(total: Any, factor: Any, value: Any) -> Any:
    """Return total + factor · value, without array operations that would only add 0 or multiply by 1.

    Constants are plain floats; a computed value may be a NumPy float that happens to be 0.
    """
    if (type(factor) is float and factor == 0.0) or (type(value) is float and value == 0.0):
        return total
    is_sign = type(factor) is float and abs(factor) == 1.0
    product = (value if factor > 0 else -value) if is_sign else factor * value
    return product if type(total) is float and total == 0.0 else total + product


class Jet:
    """A scalar with its first two derivatives in a direction.

    >>> from modal.extend import sin
    >>> from modal.extend.scalars import Jet
    >>> x = Jet(0.0, 2.0)
    >>> float(sin(x).first), float((x * x).second)
    (2.0, 8.0)
    """

    __slots__ = ("first", "second", "value")
    __array_ufunc__ = None

    def __init__(self, value: Any, first: Any = 0.0, second: Any = 0.0) -> None:
        self.value, self.first, self.second = value, first, second

    def _after(self, value: Any, slope: Any, bend: Any) -> Jet:
        """A function of it with this value, slope and second derivative."""
        square = plus(0.0, self.first, self.first)
        return Jet(value, plus(0.0, slope, self.first), plus(plus(0.0, slope, self.second), bend, square))

    def __add__(self, other: Any) -> Jet:
        other = _jet(other)
        first, second = plus(self.first, 1.0, other.first), plus(self.second, 1.0, other.second)
        return Jet(self.value + other.value, first, second)

    def __neg__(self) -> Jet:
        return Jet(-self.value, *(0.0 if _is_zero(part) else -part for part in (self.first, self.second)))

    def __sub__(self, other: Any) -> Jet:
        return self + -_jet(other)

    def __rsub__(self, other: Any) -> Jet:
        return _jet(other) + -self

    def __mul__(self, other: Any) -> Jet:
        other = _jet(other)
        first = plus(plus(0.0, self.first, other.value), self.value, other.first)
        middle = plus(plus(0.0, self.second, other.value), self.value, other.second)
        return Jet(self.value * other.value, first, plus(middle, 2.0, plus(0.0, self.first, other.first)))

    def __truediv__(self, other: Any) -> Jet:
        other = _jet(other)
        if _is_zero(other.first) and _is_zero(other.second):
            parts = (0.0 if _is_zero(part) else part / other.value for part in (self.first, self.second))
            return Jet(self.value / other.value, *parts)
        inverse = 1.0 / other.value
        return self.__mul__(other._after(inverse, -(inverse * inverse), 2.0 * (inverse * inverse * inverse)))

    def __rtruediv__(self, other: Any) -> Jet:
        return _jet(other).__truediv__(self)

    def __pow__(self, power: float) -> Jet:
        if power in (0, 1, 2):
            return Jet(1.0) if power == 0 else self if power == 1 else self * self
        lower = self.value ** (power - 2)
        slope = lower * self.value
        return self._after(slope * self.value, power * slope, power * (power - 1) * lower)

    def sin(self) -> Jet:
        """The sine."""
        S = sin(self.value)
        return self._after(S, cos(self.value), -S)

    def cos(self) -> Jet:
        """The cosine."""
        C = cos(self.value)
        return self._after(C, -sin(self.value), -C)

    def exp(self) -> Jet:
        """The exponential."""
        power = exp(self.value)
        return self._after(power, power, power)

    def log(self) -> Jet:
        """The natural logarithm."""
        inverse = 1.0 / self.value
        return self._after(log(self.value), inverse, -(inverse * inverse))

    def sqrt(self) -> Jet:
        """The square root."""
        root = sqrt(self.value)
        slope = 0.5 / root
        return self._after(root, slope, -0.5 * slope / self.value)

    def tanh(self) -> Jet:
        """The hyperbolic tangent."""
        share = tanh(self.value)
        slope = 1.0 - share * share
        return self._after(share, slope, -2.0 * share * slope)

    __radd__, __rmul__ = __add__, __mul__


def _jet(value: Any) -> Jet:
    return value if isinstance(value, Jet) else Jet(value)


def _is_zero(part: Any) -> bool:
    return type(part) is float and part == 0.0


def along(function: Callable[[list[Any]], Any], values: Sequence[Any], direction: Sequence[Any]) -> tuple[Jet, ...]:
    """Return the value of a function of several scalars as jets in a direction."""
    results = function([Jet(value, way) for value, way in zip(values, direction, strict=True)])
    return tuple(map(_jet, results))
