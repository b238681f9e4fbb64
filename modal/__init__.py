"""Linearized modal analysis of pendulum chains, on a fixed support or coupled by a cart.

The names below are loaded on first use, so that shell completion and help work without NumPy.

>>> from modal import load, natural_modes
>>> modes = natural_modes(load("paper-cart-2"))
>>> modes[2].omega
2.7175491179815823
"""

from typing import TYPE_CHECKING

from modal.lazy import lazy_attributes
from modal.namesake import warn_about_namesake

if TYPE_CHECKING:
    from modal.assembly import Matrices, matrices
    from modal.errors import ComputationError, MultipendulaError, SceneError
    from modal.modes import Mode, Modes, Shape, natural_frequencies, natural_modes
    from modal.scene import (
        Bob,
        Body,
        Cart,
        Fixed,
        Ground,
        Heave,
        InitialCondition,
        ModalSupport,
        Pendulum,
        Platform,
        Rod,
        Scene,
        Spring,
        Swing,
        Tilt,
        dump,
        dumps,
        example_names,
        load,
    )
    from modal.tuning import tune as tune

__all__ = [
    "Bob",
    "Body",
    "Cart",
    "ComputationError",
    "Fixed",
    "Ground",
    "Heave",
    "InitialCondition",
    "Matrices",
    "ModalSupport",
    "Mode",
    "Modes",
    "MultipendulaError",
    "Pendulum",
    "Platform",
    "Rod",
    "Scene",
    "SceneError",
    "Shape",
    "Spring",
    "Swing",
    "Tilt",
    "dump",
    "dumps",
    "example_names",
    "load",
    "matrices",
    "natural_frequencies",
    "natural_modes",
]

warn_about_namesake()

if not TYPE_CHECKING:
    __getattr__ = lazy_attributes(__name__)
