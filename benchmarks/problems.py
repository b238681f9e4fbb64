"""The scenes and starts on which the simulator is measured."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from modal import Bob, Cart, Pendulum, Rod, Scene
from nonlinear.system import State

CART_A_PENDULUM = 50.0


class Problem(NamedTuple):
    """A plane scene of unsprung links, the angles (L,) in rad at release, and the duration (s)."""

    name: str
    scene: Scene
    angles: np.ndarray
    duration: float

    @property
    def start(self) -> State:
        """The initial state, at rest."""
        return State(self.angles, np.zeros(len(self.angles)))


def carts(number: int) -> Scene:
    pendulum = Pendulum(links=[Rod(mass=1.0, length=1.0, count=2)], count=number)
    return Scene(gravity=9.81, support=Cart(mass=CART_A_PENDULUM * number), pendulum=[pendulum])


def bobs(links: int) -> Scene:
    return Scene(gravity=9.81, pendulum=[Pendulum(links=[Bob(mass=1.0, length=1.0, count=links)])])


def on_cart(number: int, duration: float) -> Problem:
    """Straight pendula from 90° to 45°, alternately left and right; two of them from ±90°, as in the paper."""
    degrees = np.linspace(90, 45 if number > 2 else 90, number) * (-1.0) ** np.arange(number)
    return Problem(f"{number} on a cart", carts(number), np.deg2rad(np.repeat(degrees, 2)), duration)


def chain(links: int, duration: float, scene: Scene | None = None) -> Problem:
    """Bobs on an arc, 90° at the pivot and 45° at the tip."""
    return Problem(f"chain of {links}", scene or bobs(links), np.deg2rad(np.linspace(90, 45, links)), duration)
