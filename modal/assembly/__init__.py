"""A scene as arrays, and the matrices M, K and D about its equilibrium.

In: a `Scene`.  Out: `Rig`, arrays of pendula with equal ones counted once, and `Matrices`, written out in full.

    M q'' + D q' + K q = 0,    q = (x, θ_1, …, θ_n)

Every other room works on these arrays and never asks what kind a link is.  Start with `arrays`; `stacks` are many
scenes of one form, `linearization` is the dense form for printing, for small problems and for tests.
"""

from modal.assembly.arrays import ARRAYS, Block, CartNumbers, Rig, Units, masses_below, rig_of
from modal.assembly.linearization import (
    Columns,
    Matrices,
    assembled,
    centres,
    coordinate_labels,
    dampers,
    drag_of,
    matrices,
    matrices_of,
)
from modal.assembly.stacks import Group, Stack, can_stack, stacked

__all__ = [
    "ARRAYS",
    "Block",
    "CartNumbers",
    "Columns",
    "Group",
    "Matrices",
    "Rig",
    "Stack",
    "Units",
    "assembled",
    "can_stack",
    "centres",
    "coordinate_labels",
    "dampers",
    "drag_of",
    "masses_below",
    "matrices",
    "matrices_of",
    "rig_of",
    "stacked",
]
