"""When the compiled recursion is used: once loading it pays off in this process."""

from __future__ import annotations

import sys
from types import ModuleType

from modal.eigen.compiling import available

LINKING, LOADING = 0.5, 1.5
"""Seconds to load the compiled recursion, with numba already loaded and without."""


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
