"""Nonlinear simulation of the scenes of `modal` at any angle, with checks of its accuracy.

The names below are loaded on first use, so that a simulation does not wait for ensembles.

>>> import modal
>>> from nonlinear import simulate
>>> run = simulate(modal.load("paper-cart-3"), 10.0)
>>> run.complete, run.energy_drift() < 1e-7
(True, True)
"""

from typing import TYPE_CHECKING

from modal.lazy import lazy_attributes
from modal.namesake import require_own_package

if TYPE_CHECKING:
    from nonlinear.ensembles import Compilation, Ensemble, compile_engines, ensemble
    from nonlinear.files import load, save
    from nonlinear.integration import SimulationError, SolverInfo, Trajectory
    from nonlinear.simulation import resume, simulate
    from nonlinear.system import (
        AppliedForces,
        Event,
        EventRecord,
        Motion,
        State,
        System,
        initial_state,
        level_crossing,
        state_at_rest,
        system_of,
        turning_point,
    )

__all__ = [
    "AppliedForces",
    "Compilation",
    "Ensemble",
    "Event",
    "EventRecord",
    "Motion",
    "SimulationError",
    "SolverInfo",
    "State",
    "System",
    "Trajectory",
    "compile_engines",
    "ensemble",
    "initial_state",
    "level_crossing",
    "load",
    "resume",
    "save",
    "simulate",
    "state_at_rest",
    "system_of",
    "turning_point",
]

require_own_package()

if not TYPE_CHECKING:
    __getattr__ = lazy_attributes(__name__)
