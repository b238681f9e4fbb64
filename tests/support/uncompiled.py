"""The kernels of single runs that numba compiles, run by Python as they stand."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from importlib import import_module
from importlib.util import module_from_spec
from types import ModuleType

import numpy as np
import pytest

from nonlinear.integration import readiness

KERNELS = {
    "nonlinear.dynamics.programs": (),
    "nonlinear.dynamics.compiled_structure": (),
    "nonlinear.dynamics.compiled": ("one_rate",),
    "nonlinear.integration.compiled": ("steps",),
}
"""What Python calls of each module; one imports the other in this order."""


@cache
def plain_modules() -> dict[str, ModuleType]:
    """The modules once more, read where numba is not installed."""
    for name in KERNELS:
        import_module(name)
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(sys.modules, "numba", None)
        for name in KERNELS:
            spec = sys.modules[name].__spec__
            assert spec
            assert spec.loader
            patch.setitem(sys.modules, name, module_from_spec(spec))
            spec.loader.exec_module(sys.modules[name])
        return {name: sys.modules[name] for name in KERNELS}


@contextmanager
def uncompiled() -> Iterator[None]:
    """Compiled equations and steps without a compilation."""
    with pytest.MonkeyPatch.context() as patch, np.errstate(all="ignore"):
        patch.setattr(readiness, "_ready", set(readiness._ready))
        for name, module in plain_modules().items():
            for kernel in KERNELS[name]:
                patch.setattr(sys.modules[name], kernel, getattr(module, kernel))
        yield
