"""Which code runs the recursion: Python floats for small problems, numba once loading it pays off in this process."""

from __future__ import annotations

import sys
from types import ModuleType

from modal.eigen import floats
from modal.eigen.compiling import available

LINKING, LOADING = 0.5, 1.5
"""Seconds to load the compiled recursion, with numba already loaded and without."""


FEW, SIDE_BY_SIDE = 60, 16
"""Links times trial values up to which Python floats are fastest; trial values up to which they surpass arrays."""


class Saved:
    """Seconds that this process would have saved so far, had it loaded the compiled recursion at once."""

    seconds = 0.0


def kernels(seconds: float = 0.0) -> ModuleType | None:
    """`modal.eigen.compiled` once its savings, including the next `seconds`, reach the time to load it; else None."""
    if "modal.eigen.compiled" not in sys.modules:
        Saved.seconds += seconds
        if Saved.seconds < (LINKING if "numba" in sys.modules else LOADING) or not available():
            return None
    from modal.eigen import compiled

    return compiled


def scalar_kernels(links: int, trials: int, supports: int) -> ModuleType | None:
    """The module that runs the recursion one number at a time, None where arrays do it sooner."""
    if supports == 1 and links * trials <= FEW:
        return floats
    return kernels() or (floats if supports == 1 and trials <= SIDE_BY_SIDE else None)
