"""Rough computing times (s) of the ways to run one motion, as measured by benchmarks/simulation.py."""

from __future__ import annotations

import sys
from math import pi
from pathlib import Path
from typing import Any

from modal.scene import Scene
from nonlinear.dynamics import form_of
from nonlinear.dynamics.inputs import Inputs
from nonlinear.integration import taylor
from nonlinear.integration.readiness import Code, Offer, cached
from nonlinear.integration.timescales import estimate_timescales
from nonlinear.system import System, system_of

WRITTEN = 32  # links of a scene up to which compiled code of its own text pays
FLOATS = 100
"""Links of a scene up to which its equations are written out in floats: a run with a chain of 50 takes 0.5 s so and
0.84 s by a band, of 100 1.25 s and 1.32 s, of 200 2.3 s and 1.36 s; with 50 pairs on a cart 0.9 s and, by the
recursion, 1.3 s, with 100 2.1 s and 1.4 s."""
LONGEST = 32  # links of a chain from which those of a text take no more time each
PER_PERIOD = 14.0  # steps of DOP853 per period at tolerance 1e-6 and large angles
SERIES_PER_PERIOD = 40.0  # steps of Taylor series per period, at any tolerance
PER_KICK = 2.0  # steps: one cut short, one that lands on the kick
COMPILING = 8.0  # s to compile the integrator


def offers(scene: Scene, system: System, duration: float, tolerance: float, size: float = 1.0) -> dict[str, Offer]:
    """Plain DOP853 and, where nothing switches, compiled DOP853 and heyoka's series if they take the `system`."""
    links, longest = system.n_links, max(group.n for group in system.groups)
    periods = duration * estimate_timescales(scene).swing / (2 * pi)
    kicks = periods * PER_KICK * system.kicks_a_period
    steps = periods * PER_PERIOD * (1e-6 / tolerance) ** (1 / 8) + kicks
    written = links <= FLOATS or system.rubs or system.kicked
    each = 1.5e-5 + links * (1e-5 + 6e-7 * min(longest, LONGEST)) if written else 2e-3 + 6e-6 * links
    if system.rubs or system.kicked:
        return {"DOP853": Offer(steps * each)}
    compiled = integrator(structured=system.structure is not None)
    ways = {"DOP853": Offer(steps * each), "compiled": Offer(steps * (5e-6 + 8e-7 * links), compiled)}
    if taylor.takes(system):
        each = 3e-6 + links * (1e-6 if links <= taylor.UNROLLED else 1.5e-6 + 2e-7 * longest)
        code = taylor.code_of(form_of(system), Inputs(system).pieces or (), taylor.uneven(tolerance * size))
        ways["taylor"] = Offer(periods * SERIES_PER_PERIOD * each, code)
    return ways


def least_seconds(scene: Scene, duration: float, tolerance: float, members: int = 1) -> float:
    """Roughly what so many motions of a scene take by the fastest way once it is ready, on one core (s)."""
    ways = offers(scene, system_of(scene), duration, tolerance)
    return float(members * min(way.running for way in ways.values()))


def integrator(*, structured: bool = False) -> Code:
    """The compiled integrator, or that of structures, and how far it is."""
    function = "_steps_on_carriers" if structured else "_steps"

    def steps() -> Any:
        return getattr(sys.modules.get("nonlinear.integration.compiled"), function, None)

    module = sys.modules.get("nonlinear.integration.compiled")
    loaded = bool(module and module.loaded(structured=structured))
    kept = loaded or cached(Path(__file__).parent / "compiled.py", function)
    return Code("numba", "DOP853 on structures" if structured else "DOP853", COMPILING, loaded, kept, steps)
