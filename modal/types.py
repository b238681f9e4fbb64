"""Type aliases of arrays of any shape, their rounding unit, and executors of parallel work."""

from collections.abc import Callable, Iterable, Iterator
from typing import Any, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Booleans = NDArray[np.bool_]
Complexes = NDArray[np.complex128]

EPS = float(np.finfo(float).eps)
"""Format: a last place of a double-precision float near 1, 2⁻⁵²; a rounding is half of it."""
NOISE_OF_SUM = 2.0**-40
"""Tolerance: share of its terms below which a sum is rounding error: 4096 last places."""
NOISE_OF_TERMS = 16 * EPS
"""Tolerance: share of its few terms below which a difference is rounding."""
NEWTON_ROUNDS = 30
"""Limit: rounds of an iteration that doubles its digits in each; callers say what follows without convergence."""
IMAGINARY_STEP = 1e-100
"""Tolerance: of derivatives by complex numbers: its square is negligible next to any float."""
NUMBERS_IN_CHUNK = 400_000
"""Cost: numbers of one temporary array, 3 MB, where an answer is computed piece by piece (benchmarks/modes.py)."""

T = TypeVar("T")
R = TypeVar("R")


class Crew(Protocol):
    """An executor of independent tasks: any `concurrent.futures.Executor`."""

    def map(self, function: Callable[..., R], /, *things: Iterable[Any]) -> Iterator[R]:
        """Return the function's results in the order of the arguments."""
        ...


def map_by_crew(function: Callable[[T], R], things: Iterable[T], crew: Crew | None) -> Iterator[R]:
    """Return the function's results in order, computed by an executor or one after the other in this process."""
    return map(function, things) if crew is None else crew.map(function, things)
