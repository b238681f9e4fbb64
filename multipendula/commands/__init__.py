"""One module a group of commands: what they do, what they take, and what their pages of help say.

A command is a `Command` in the `COMMANDS` of its module.  Here they stand in the order of `multipendula --help`.
`shared` has what all of them need to write an answer, `runs` what a motion may be told.
"""

from multipendula.commands import (
    coupling,
    derivation,
    modes,
    motion,
    scenes,
    statespace,
    sweeps,
    synchronization,
    verification,
)

__all__ = ["ABOUT", "COMMANDS", "FIRST"]

GROUPS = (scenes, modes, motion, verification, coupling, sweeps, synchronization, statespace, derivation)
COMMANDS = tuple(command for group in GROUPS for command in group.COMMANDS)
ABOUT = (
    "Frequencies, mode shapes and motion of multi-pendulum systems: chains of bobs, rods and rigid bodies in the plane "
    "or in space, alone or hung from one cart that couples them."
)
FIRST = (
    ("scenes", "what is shipped"),
    ("table paper-cart-2", "every mode of two double pendula on a cart"),
    ("shapes paper-cart-2 -o shapes.png", "the same, drawn"),
    ("explain paper-cart-2", "why the two exchange energy, and how slowly"),
    ("animate paper-cart-3 --duration 2 -o run.gif", "three of them let go from level"),
    ("scenes crane-hook > mine.toml", "a scene to edit; then `multipendula table mine.toml`"),
)
"""Examples for whoever begins."""
