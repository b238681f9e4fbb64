"""Rough computing times (s) of each method, as measured by benchmarks/simulation.py.

Costs paid once per process, for loading and compiling, are included while they are still to be paid.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from importlib.util import find_spec
from math import inf, pi
from pathlib import Path

from modal.scene import Scene
from nonlinear.integration import taylor
from nonlinear.integration.timescales import estimate_timescales
from nonlinear.system import System

WRITTEN = 32  # links of a scene up to which equations are generated in floats
PER_PERIOD = 14.0  # steps of DOP853 per period at tolerance 1e-6 and large angles
SERIES_PER_PERIOD = 40.0  # steps of Taylor series per period, at any tolerance
PER_KICK = 2.0  # steps: one cut short, one that lands on the kick
NUMBA, LINKED, COMPILED = 0.2, 0.3, 10.0  # s to load numba, to link a cached kernel, to compile a new one
HEYOKA = 2.0  # s to load it
_same = ContextVar("_same", default=False)


@contextmanager
def reproducible() -> Iterator[None]:
    """A block in which choices do not depend on what this process has loaded, and so results are equal to the bit."""
    token = _same.set(True)
    try:
        yield
    finally:
        _same.reset(token)


def costs(scene: Scene, system: System, duration: float, tolerance: float, size: float = 1.0) -> dict[str, float]:
    """Seconds of plain DOP853, of compiled DOP853 and of Taylor series, for the integrated `system`."""
    links, longest = system.n_links, max(group.n for group in system.groups)
    periods = duration * estimate_timescales(scene).swing / (2 * pi)
    kicks = periods * PER_KICK * system.kicks_a_period
    steps = periods * PER_PERIOD * (1e-6 / tolerance) ** (1 / 8) + kicks
    plain = 2e-5 + links * (2e-5 + 7e-7 * longest) if links <= WRITTEN else 2e-3 + 6e-6 * links
    series = links * (3e-6 if links <= taylor.UNROLLED else 1.5e-6 + 1e-6 * longest)
    return {
        "DOP853": steps * plain,
        "compiled": owed_to_numba() + steps * (1e-5 + 2.5e-6 * links),
        "taylor": owed_to_heyoka(system, tolerance * size) + (periods * SERIES_PER_PERIOD + kicks) * series,
    }


def owed_to_numba() -> float:
    """Seconds until the compiled integrator is ready in this process; inf where numba is not installed."""
    if _same.get():
        return inf
    integrator = sys.modules.get("nonlinear.integration.compiled")
    if integrator and integrator.loaded():
        return 0.0
    if not find_spec("numba"):
        return inf
    return (0.0 if "numba" in sys.modules else NUMBA) + LINKED + (0.0 if kept() else COMPILED)


def owed_to_heyoka(system: System, tolerance: float) -> float:
    """Seconds until such series are ready in this process; inf where heyoka is not installed."""
    if _same.get() or not taylor.available():
        return inf
    if taylor.ready(system, tolerance):
        return 0.0
    longest = max(group.n for group in system.groups)
    compiling = 0.3 + 0.02 * longest**2 + 0.025 * system.n_links
    return (0.0 if "heyoka" in sys.modules else HEYOKA) + compiling


def kept() -> bool:
    """Whether the present version of the compiled integrator is in numba's cache on disk."""
    return cached(Path(__file__).parent / "compiled.py", "_steps")


def cached(module: Path, kernel: str) -> bool:
    """Whether the present version of a compiled function of a module is in numba's cache on disk."""
    folder = os.environ.get("NUMBA_CACHE_DIR")
    folders = [Path(folder)] if folder else [module.parent / "__pycache__", Path.home() / ".cache" / "numba"]
    written = module.stat().st_mtime
    files = (file for each in folders for file in each.rglob(f"{module.stem}.{kernel}-*.nbi"))
    return any(file.stat().st_mtime > written for file in files)
