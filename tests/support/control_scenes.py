"""Scenes and models that the tests of gains, reduction, shapers and responses share."""

from __future__ import annotations

import warnings

import control
import numpy as np

from modal import Bob, Body, Cart, Fixed, Pendulum, Rod, Scene
from modal.assembly import instants
from modal.statespace import StateSpace
from modal.statespace.model import assemble


def model_at(scene: Scene, time: float, inputs: tuple[str, ...] = (), outputs: tuple[str, ...] = ()) -> StateSpace:
    """The model along a hoist at one time (s), in which the speeds of the lengths are damping and stiffness."""
    return assemble(scene.at(time), instants(scene)(time), inputs, outputs)


def crane(l1: float = 20.0, l2: float = 10.0, *, damping: float = 0.0) -> Scene:
    """Two loads on one trolley: M = 1000 kg, m = 100 kg each."""
    pendula = [Pendulum(links=[Bob(mass=100.0, length=l, damping=damping)]) for l in (l1, l2)]
    return Scene(gravity=9.81, support=Cart(mass=1000.0), pendulum=pendula)


def mixed(*, joint: float = 0.0, cart: float = 0.0, spring: float = 0.0, copies: int = 3) -> Scene:
    """Two kinds of pendula, one of them several times, on a cart."""
    pendulum = Pendulum(links=[Rod(mass=2.0, length=1.1, damping=joint), Bob(mass=1.0, length=0.7, damping=joint)])
    other = Pendulum(links=[Body(mass=1.5, length=1.0, centre=0.4, inertia=0.2, damping=2 * joint)], count=copies)
    support = Cart(mass=5.0, damping=cart, stiffness=spring)
    return Scene(gravity=9.81, support=support, pendulum=[other, pendulum])


def hanging(damping: float = 0.2) -> Scene:
    """A damped triple pendulum on a fixed support."""
    links = [Rod(mass=1.0, length=l, damping=damping) for l in (1.0, 0.6, 0.8)]
    return Scene(gravity=9.81, support=Fixed(), pendulum=[Pendulum(links=links)])


SCENES = {
    "crane": crane(),
    "equal loads": crane(20.0, 20.0),
    "undamped copies": mixed(),
    "damped copies": mixed(joint=0.3),
    "overdamped copies": mixed(joint=40.0),
    "dragged cart": mixed(cart=2.0),
    "held cart": mixed(joint=0.1, cart=1.0, spring=30.0),
}
DRIVES = ("cart_force", "cart_acceleration", "cart_velocity")


def of_control(model: StateSpace) -> control.StateSpace:
    """The same model as python-control's."""
    return control.ss(model.A, model.B, model.C, model.D)


def at(model: StateSpace, omega: np.ndarray) -> np.ndarray:
    """G(iω) (p, m, W) by python-control."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        return np.asarray(control.frequency_response(of_control(model), omega, squeeze=False).frdata)


def rank(model: StateSpace) -> int:
    """Rank of the controllability matrix, scaled by the fastest rate."""
    A, column = model.A / np.abs(np.linalg.eigvals(model.A)).max(), model.B
    columns = [column]
    for _ in range(len(A) - 1):
        columns.append(A @ columns[-1])
    whole = np.hstack(columns)
    return int(np.linalg.matrix_rank(whole / np.linalg.norm(whole, axis=1, keepdims=True), tol=1e-10))
