"""Roughly how many seconds each way to a motion takes, as benchmarks/simulation.py finds them.

What is paid once a process, loading and compiling, counts where it is still to be paid.
"""

from __future__ import annotations

import os
import sys
from importlib.util import find_spec
from math import inf, pi
from pathlib import Path

from modal.scene import Scene
from nonlinear.integration import taylor
from nonlinear.integration.timescales import estimate_timescales
from nonlinear.system import System

WRITTEN = 32  # links of a scene whose equations are written out in floats
PER_PERIOD = 14.0  # steps of DOP853 a period at tolerance 1e-6 and large angles
SERIES_PER_PERIOD = 40.0  # those of Taylor series, at any tolerance
PER_KICK = 2.0  # steps: one that is cut short, one to land on it
NUMBA, LINKED, COMPILED = 0.2, 0.3, 10.0  # s to load numba, to link what is on disk, to compile what is not
HEYOKA = 2.0  # s to load it


def costs(scene: Scene, system: System, duration: float, tolerance: float, size: float = 1.0) -> dict[str, float]:
    """Seconds of DOP853 as it is, of DOP853 compiled, and of Taylor series, for `system`, which is integrated."""
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
    """Seconds until the compiled integrator can go in this process; inf where numba is not installed."""
    integrator = sys.modules.get("nonlinear.integration.compiled")
    if integrator and integrator.loaded():
        return 0.0
    if not find_spec("numba"):
        return inf
    return (0.0 if "numba" in sys.modules else NUMBA) + LINKED + (0.0 if kept() else COMPILED)


def owed_to_heyoka(system: System, tolerance: float) -> float:
    """Seconds until series of this order for such a scene can go in this process; inf where heyoka is not installed."""
    if not taylor.available():
        return inf
    if taylor.ready(system, tolerance):
        return 0.0
    longest = max(group.n for group in system.groups)
    compiling = 0.3 + 0.02 * longest**2 + 0.025 * system.n_links
    return (0.0 if "heyoka" in sys.modules else HEYOKA) + compiling


def kept() -> bool:
    """Whether the compiled integrator is on disk where numba keeps it, as it is now."""
    here = Path(__file__).parent
    folder = os.environ.get("NUMBA_CACHE_DIR")
    folders = [Path(folder)] if folder else [here / "__pycache__", Path.home() / ".cache" / "numba"]
    written = (here / "compiled.py").stat().st_mtime
    files = (file for each in folders for file in each.rglob("compiled._steps-*.nbi"))
    return any(file.stat().st_mtime > written for file in files)
