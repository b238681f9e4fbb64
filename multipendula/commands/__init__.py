"""The commands: one module for each group, with what they do, their arguments and their help.

A command is a `Command` in the `COMMANDS` of its module.  `GROUPS` has them in the order of `multipendula --help`.
`shared` has helpers for output, `runs` the arguments of the commands that simulate, `models` those of the commands
about state-space models.
"""

from multipendula.commands import (
    coupling,
    derivation,
    ensembles,
    hoisting,
    identification,
    live,
    modes,
    motion,
    orbits,
    scenes,
    statespace,
    sweeps,
    synchronization,
    tuning,
    verification,
    vibration,
)

__all__ = ["ABOUT", "COMMANDS", "FIRST"]

GROUPS = (
    scenes,
    modes,
    motion,
    live,
    orbits,
    verification,
    coupling,
    sweeps,
    synchronization,
    ensembles,
    identification,
    statespace,
    hoisting,
    vibration,
    tuning,
    derivation,
)
COMMANDS = tuple(command for group in GROUPS for command in group.COMMANDS)
ABOUT = (
    "Frequencies, mode shapes and motion of multi-pendulum systems: chains of bobs, rods and rigid bodies, in the "
    "plane or in space, on a fixed support, coupled by a common cart, or hung from structures with springs."
)
FIRST = (
    ("scenes", "list the shipped scenes"),
    ("table paper-cart-2", "every mode of two double pendula on a cart"),
    ("shapes paper-cart-2 -o shapes.png", "draw their mode shapes"),
    ("explain paper-cart-2", "why the two exchange energy, and how slowly"),
    ("animate paper-cart-3 --duration 2 -o run.gif", "film three of them, released with level links"),
    ("play paper-cart-2 -o page.html", "a page to play with them"),
    ("scenes crane-hook -o mine.toml", "copy a scene to edit; then `multipendula table mine.toml`"),
)
"""Examples for beginners."""
