"""Nonlinear simulation of the scenes of `modal` at any angle, with certificates.

>>> import modal
>>> from nonlinear import simulate
>>> run = simulate(modal.load("paper-cart-3"), 10.0)
>>> run.complete, run.energy_drift() < 1e-7
(True, True)
"""

from nonlinear.files import load, save
from nonlinear.integration.run import SimulationError
from nonlinear.integration.trajectory import Run, Trajectory
from nonlinear.simulation import resumed, simulate
from nonlinear.system.events import Event, Happening, crossing, turning
from nonlinear.system.initial import released, start_of
from nonlinear.system.plant import Plant, plant_of
from nonlinear.system.state import Motion, Push, State

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
