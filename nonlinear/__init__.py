"""Nonlinear simulation of the scenes of `modal` at any angle, with certificates.

>>> import modal
>>> from nonlinear import simulate
>>> run = simulate(modal.load("paper-cart-3"), 10.0)
>>> run.complete, run.energy_drift() < 1e-7
(True, True)
"""

from nonlinear.events import Event, Happening, crossing, turning
from nonlinear.plant import Plant, plant_of
from nonlinear.preparation import SimulationError
from nonlinear.recordings import load, save
from nonlinear.simulation import resumed, simulate
from nonlinear.starts import released, start_of
from nonlinear.state import Motion, Push, State
from nonlinear.trajectory import Run, Trajectory

__all__ = [
    "Event",
    "Happening",
    "Motion",
    "Plant",
    "Push",
    "Run",
    "SimulationError",
    "State",
    "Trajectory",
    "crossing",
    "load",
    "plant_of",
    "released",
    "resumed",
    "save",
    "simulate",
    "start_of",
    "turning",
]
