"""Scenes: the description of a system of pendula, its file, and its numbers by their paths.

In: TOML, or the same objects from Python.  Out: an immutable `Scene`, checked completely when it is made.

    pendulum[2].links[0].mass = -1.0: must be positive

Start with `model`; `files` reads and writes, `sealed` detects damaged files, `validation` checks every part and words
the messages, `parameters` finds and varies numbers by path.
"""

from typing import TYPE_CHECKING

from modal._compatibility import renamed
from modal.scene.files import STANDARD, dump, dumps, example_names, kind_of, load, parse, whole_file
from modal.scene.model import (
    AnyLink,
    Bob,
    Body,
    Cart,
    Escapement,
    Fixed,
    InitialCondition,
    Pendulum,
    Rod,
    Scene,
    VanDerPol,
    describe,
    scene_from,
    unsupported,
    validate_scene,
)

__all__ = [
    "STANDARD",
    "AnyLink",
    "Bob",
    "Body",
    "Cart",
    "Escapement",
    "Fixed",
    "InitialCondition",
    "Pendulum",
    "Rod",
    "Scene",
    "VanDerPol",
    "describe",
    "dump",
    "dumps",
    "example_names",
    "kind_of",
    "load",
    "parse",
    "scene_from",
    "unsupported",
    "validate_scene",
    "whole_file",
]

if not TYPE_CHECKING:
    __getattr__ = renamed(__name__, "modal.scene.model")
