"""The commands: one module for each group, with what they do, their arguments and their help.

A command is a `Command` in the `COMMANDS` of its module.  `NAMES` has them in the order of `multipendula --help`: of
all, the one that is called has its group loaded and its page made.
`shared` has helpers for output, `runs` the arguments of the commands that simulate.
"""

from __future__ import annotations

from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from multipendula.command import Command

    COMMANDS: tuple[Command, ...]
    GROUPS: tuple[ModuleType, ...]

__all__ = ["ABOUT", "COMMANDS", "FIRST", "NAMES", "command_named"]

NAMES = {
    "scenes": ("scenes", "completion"),
    "modes": ("table", "shapes", "matrices"),
    "motion": ("simulate", "plot", "animate"),
    "live": ("play",),
    "orbits": ("orbits",),
    "verification": ("check", "tradeoff", "chaos"),
    "coupling": ("explain",),
    "sweeps": ("sweep",),
    "synchronization": ("sync",),
    "ensembles": ("basins", "section", "spread"),
    "identification": ("fit", "poles"),
    "statespace": ("export", "response", "shaper"),
    "hoisting": ("hoist",),
    "vibration": ("vibration",),
    "tuning": ("tune",),
    "derivation": ("derive", "enclose"),
}
"""The names of the commands of every group, a module of this subpackage."""
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


def command_named(name: str) -> Command | None:
    """The command of this name, for which its group alone is loaded."""
    group = next((group for group, names in NAMES.items() if name in names), None)
    return next(command for command in _group(group).COMMANDS if command.name == name) if group else None


def _group(name: str) -> ModuleType:
    return import_module(f"{__name__}.{name}")


def __getattr__(name: str) -> Any:
    """GROUPS, all modules, and COMMANDS, all commands, where they are requested."""
    if name == "GROUPS":
        return tuple(map(_group, NAMES))
    if name == "COMMANDS":
        return tuple(command for group in __getattr__("GROUPS") for command in group.COMMANDS)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
