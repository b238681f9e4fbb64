"""Functions of plain arithmetic over any scalar, so that an extension writes its physics once.

Floats, complex numbers, arrays, recorded symbols, SymPy expressions and multiprecision numbers bring their own
functions, as methods or in their packages; all others are passed to NumPy as floats.
"""

from __future__ import annotations

import sys
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
