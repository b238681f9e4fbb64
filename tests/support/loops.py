"""The loop that numba compiles, run by Python as it stands."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from types import ModuleType

import numpy as np
import pytest

from nonlinear.ensembles import compiled
from nonlinear.integration import loops, readiness

LANES = 4
"""Side by side: enough for members that come while others are under way, and no time for lanes that stand still."""
PLAIN = "def compiled(function):\n return function\n\npart = vectorized_part = compiled"


def module_of(text: str) -> ModuleType:
    """A module for numba, of plain functions."""
    module = ModuleType("loop")
    text = text.replace("from math import floor,", "from math import pi, tau\nfrom numpy import floor,").replace(
        ", pi, sqrt, tau", ", sqrt"
    )
    exec(text.replace("from nonlinear.dynamics.compiling import compiled, part, vectorized_part", PLAIN), vars(module))
    return module


@contextmanager
def interpreted() -> Iterator[None]:
    """Engine numba without numba."""
    with pytest.MonkeyPatch.context() as patch, np.errstate(all="ignore"):
        for place in (compiled, loops):
            patch.setattr(place, "WIDTH", LANES)
        patch.setattr(compiled, "module_of", module_of)
        patch.setattr(readiness, "_ready", set(readiness._ready))
        patch.setattr(compiled, "available", lambda: True)
        yield
