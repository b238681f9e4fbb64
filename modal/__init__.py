"""Linearized modal analysis of pendulum chains, alone or coupled by a cart.

>>> from modal import load, natural_modes
>>> modes = natural_modes(load("paper-cart-2"))
>>> modes[2].omega
2.7175491179815823
"""

from modal._namesake import warn_about_namesake
from modal.assembly.matrices import Matrices, matrices
from modal.errors import ComputationError, MultipendulaError, SceneError
from modal.modes.mode import Mode
from modal.modes.modes import Modes, natural_modes
from modal.modes.shapes import Shape
from modal.scene.files import dump, dumps, load, shipped
from modal.scene.model import Bob, Body, Cart, Fixed, Pendulum, Rod, Scene, Start

__all__ = [
    "Bob",
    "Body",
    "Cart",
    "ComputationError",
    "Fixed",
    "Matrices",
    "Mode",
    "Modes",
    "MultipendulaError",
    "Pendulum",
    "Rod",
    "Scene",
    "SceneError",
    "Shape",
    "Start",
    "dump",
    "dumps",
    "load",
    "matrices",
    "natural_modes",
    "shipped",
]

warn_about_namesake()
