"""The start of a scene that has none of its own: the first mode that swings, at a small angle."""

from __future__ import annotations

from math import radians

import numpy as np

from modal.errors import SceneError
from modal.modes import UNCERTAIN, Modes, table_numbers
from modal.scene import Scene, validate_scene
from modal.scene.doors import checked, checked_index
from nonlinear.integration import modes_of
from nonlinear.reduction.modal_coordinates import start_in_mode
from nonlinear.system import State, has_start, initial_state, of_plane

USUAL_DEG = 5.0
"""Limit: the usual start, which `start` replaces: the largest angle of any link."""


@checked
def first_that_swings(scene: Scene, *, undamped: bool = False) -> int:
    """The number in the table of the first mode that swings along the rail; SceneError if there is none.

    `undamped` asks for one that swings without the dampers.
    """
    modes = modes_of(scene.conservative if undamped else scene)
    is_along = np.array([any(part.along_count for part in parts) for parts in modes.spectrum.groups])
    swings = (modes.eigenvalue.imag > 0) & (modes.error < UNCERTAIN) & is_along
    numbers = table_numbers(scene)[swings] if undamped else 1 + np.flatnonzero(swings)
    if not numbers.size:
        raise SceneError(["no pendulum has a start, and no mode swings"])
    return int(numbers.min())


@checked
def copy_along(modes: Modes, row: int) -> int:
    """The index of the first shape along the rail, of those that share a frequency; 0 if all are across.

    >>> from modal import load, natural_modes
    >>> copy_along(natural_modes(load("chain-spatial")), 0)
    0
    """
    checked_index("row", row, 0, len(modes) - 1)
    copies = range(int(modes.multiplicity[row]))
    return next((copy for copy in copies if not modes.shape(row, copy).across), 0)


def usual_start(scene: Scene) -> State:
    """The start in the scene file, or else the first mode that swings along the rail, its largest angle USUAL_DEG.

    >>> from math import degrees
    >>> from modal import load
    >>> from nonlinear.reduction import usual_start
    >>> float(round(degrees(abs(usual_start(load("rope")).links).max()), 9))
    5.0
    """
    validate_scene(scene)
    if has_start(scene):
        return initial_state(scene)
    modes, row = modes_of(scene), first_that_swings(scene) - 1
    state = start_in_mode(scene, modes, row, copy_along(modes, row), radians(USUAL_DEG))
    return state if scene.space == "plane" else of_plane(state)
