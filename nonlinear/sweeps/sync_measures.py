"""Measures of who keeps time with whom, over so many seconds from the scene's own start."""

from __future__ import annotations

from functools import lru_cache
from math import nan

import numpy as np

from modal.scene import Scene
from modal.types import Floats
from nonlinear.postprocessing import last
from nonlinear.sweeps.measure import Measure
from nonlinear.sweeps.modal_measures import numbers_in, swinging
from nonlinear.sweeps.run_measures import run_of
from nonlinear.synchronization import ENDING, Phases, Survival, find_survival, phases_of

FEW = 4  # pendula whose energies are told one by one
USUAL, MOST = 100.0, 1e6  # seconds


@lru_cache(maxsize=1)
def _phases(scene: Scene, seconds: float) -> Phases:
    return phases_of(run_of(scene, seconds))


@lru_cache(maxsize=1)
def _survival(scene: Scene, seconds: float) -> Survival:
    return find_survival(run_of(scene, seconds))


def order(scene: Scene, seconds: float) -> dict[str, float]:
    """The order parameter of the leading own mode, its mean over the last tenth."""
    phases = _phases(scene, seconds)
    return {"order": float(_ending(phases, phases.order)[phases.leading])}


def survivor(scene: Scene, seconds: float, table: Scene) -> dict[str, float]:
    """The number in the table of the mode that holds most energy at the end, and its share."""
    found = _survival(scene, seconds)
    number, own = found.number, swinging(scene)[1]
    if number in own:
        number = numbers_in(scene, table)[own.index(number)]
    return {"survivor": float(number), "survivor_share": found.survivor_share}


def locking(scene: Scene, seconds: float) -> dict[str, float]:
    """From when on all other rows hold less than a hundredth together; NaN where never."""
    time = _survival(scene, seconds).locking_time()
    return {"locking_time_s": nan if time is None else time}


def pendulum_energy(scene: Scene, seconds: float) -> dict[str, float]:
    """Mean energies over the last tenth: of all pendula, of each where they are few, and of the cart."""
    phases = _phases(scene, seconds)
    mechanics = phases.trajectory.mechanics
    each = _ending(phases, phases.energy)
    found = {"pendula_energy_J": float(each.sum())}
    if len(each) <= FEW:
        found |= {f"pendulum_{number}_energy_J": float(value) for number, value in enumerate(each, 1)}
    if scene.support.kind == "cart":
        found["cart_energy_J"] = float(_ending(phases, mechanics.cart_kinetic + mechanics.cart_potential))
    return found


def _ending(phases: Phases, values: Floats) -> Floats:
    return np.asarray(values[last(phases.times, ENDING)].mean(axis=0))


SYNC = tuple(
    Measure(function.__name__, function, USUAL, words, whole=False, most=MOST, numbered=function is survivor)
    for function, words in (
        (order, "how far the phases agree after N seconds, from 0 to 1"),
        (survivor, "the mode that holds most energy after N seconds, and its share"),
        (locking, "from when on it holds 99 %, within N seconds"),
        (pendulum_energy, "mean energies of pendula and cart after N seconds"),
    )
)
