"""The numbers of a scene as a list, of which many members may each have their own.

The list is gravity, the cart's mass, damper and spring, then of every link in the order of the file its mass, length,
centre, inertia, damper, spring, the two constants of its drive, and its drag, field by field.  Beside it stand the
entries of D_modal and the constants of sines that move the support, and of sines and constants that act as forces.
Where members differ an entry is an array (S,), elsewhere one number.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import radians
from typing import Any

import numpy as np

from modal.assembly import CartNumbers
from modal.report import Displayed
from modal.scene import AnyLink, Body, Cart, Escapement, Moved, Scene, validate_scene, validate_scenes
from modal.scene.parameters import Place
from modal.types import Floats
from nonlinear.system.system import Group, System, system_of

BEFORE = 4  # entries before those of links
FIELDS = ("mass", "length", "centre", "inertia", "damping", "stiffness", "strength", "curb", "drag", "quadratic_drag")
DRAG = ("drag", "quadratic_drag")
WORKING = ("damping", "strength", *DRAG)
Values = Mapping[Place, Floats]


@dataclass(frozen=True, eq=False, repr=False)
class Numbers(Displayed):
    """The numbers of S members with the form of a `system`: `entries` are numbers or arrays (S,).

    So are `prescribed`, the entries of D_modal, row by row, where there is one, and constants of motions and forces;
    and `switching`, those of escapements and dry friction (`nonlinear.integration.switches`), empty without them.
    """

    system: System
    entries: tuple[Any, ...]
    prescribed: tuple[Any, ...] = ()
    switching: tuple[Any, ...] = ()

    @cached_property
    def varied(self) -> tuple[int, ...]:
        """Which entries are arrays."""
        return tuple(k for k, entry in enumerate(self.entries) if isinstance(entry, np.ndarray))

    @cached_property
    def works(self) -> bool:
        """Whether energy goes in or out of any member, or could where these entries differ."""
        system = self.system
        outside = any(part is not None for part in (system.modal_damping, system.hoisting))
        return outside or bool(system.prescribed) or system.kicked or self._any_of(WORKING) or self._is_set(2)

    @cached_property
    def dragged(self) -> bool:
        """Whether any member has drag, or could."""
        return self._any_of(DRAG)

    def _any_of(self, names: Sequence[str]) -> bool:
        links = self.system.n_links
        return any(self._is_set(BEFORE + FIELDS.index(name) * links + k) for name in names for k in range(links))

    def _is_set(self, k: int) -> bool:
        return isinstance(self.entries[k], np.ndarray) or bool(self.entries[k])

    def at(self, members: Any) -> Numbers:
        """Those of some members: a slice or indices."""
        taken = (
            tuple(entry[members] if isinstance(entry, np.ndarray) else entry for entry in own)
            for own in (self.entries, self.prescribed, self.switching)
        )
        return Numbers(self.system, *taken)

    @cached_property
    def arrays(self) -> System:
        """The system with these in its arrays: (n, P, 1), or (n, P, S) where members differ."""
        found = system_with(self.system, [_spread(entry) for entry in self._even], tail=True)
        return with_prescribed(found, self.prescribed)

    @property
    def _even(self) -> list[Any]:
        """The entries, of each field either all arrays or none."""
        links, found = self.system.n_links, list(self.entries)
        count = max((len(found[k]) for k in self.varied), default=1)
        for at in range(BEFORE, BEFORE + len(FIELDS) * links, links):
            own = found[at : at + links]
            if any(isinstance(entry, np.ndarray) for entry in own):
                found[at : at + links] = [np.broadcast_to(entry, count) for entry in own]
        return found


def _spread(entry: Any) -> Any:
    return entry if isinstance(entry, np.ndarray) else np.array([entry])


def numbers_of(
    scene: Scene, values: Values | None = None, system: System | None = None, modal: Floats | None = None
) -> Numbers:
    """The numbers of a scene, with arrays (S,) of `values` at some of its places and D_modal (S, n, n)."""
    validate_scene(scene)
    given: Values = values or {}
    support, cart = scene.support, [0.0, 0.0, 0.0]
    if isinstance(support, Cart):
        cart = [given.get(("support", name), getattr(support, name)) for name in ("mass", "damping", "stiffness")]
    rows = [
        row
        for p, pendulum in enumerate(scene.pendulum)
        for row in [
            _row(link, {place[4:]: own for place, own in given.items() if place[:4] == ("pendulum", p, "links", i)})
            for i, link in enumerate(pendulum.links)
            for _ in range(link.count)
        ]
        * pendulum.count
    ]
    fields = [entry for field in zip(*rows, strict=True) for entry in field]
    own = system or system_of(scene)
    if modal is not None:
        own = replace(own, modal_damping=modal[0])
    prescribed = _prescribed(own, _places_of_prescribed(scene), given, modal)
    return Numbers(own, (given.get(("gravity",), scene.gravity), *cart, *fields), prescribed)


def _places_of_prescribed(scene: Scene) -> list[Place]:
    """Where a scene has its motions and forces, in the order of `System.prescribed`."""
    motions: list[Place] = []
    if isinstance(scene.support, Moved):
        single = not isinstance(scene.support.motion, tuple)
        places: list[Place] = [(k,) for k in range(len(scene.support.motions))]
        motions = [("support", "motion", *(() if single else place)) for place in places]
    return [*motions, *(("force", k) for k in range(len(scene.force)))]


def _prescribed(system: System, places: Sequence[Place], given: Values, modal: Floats | None) -> tuple[Any, ...]:
    D = _modal_of(system)
    if modal is not None:
        D = [own if np.any(own != own[0]) else float(own[0]) for own in modal.reshape(len(modal), -1).T]
    if not system.is_analytic:
        return (*D,)
    constants = [
        given[(*place, name)] * unit if (*place, name) in given else constant
        for place, motion in zip(places, system.prescribed, strict=True)
        for (name, unit), constant in zip(motion.units.items(), motion.constants, strict=True)
    ]
    return (*D, *constants)


def prescribed_of(system: System) -> list[float]:
    """The entries of D_modal and the constants of what is prescribed, of a system's own."""
    return [*_modal_of(system), *_constants_of(system)]


def _modal_of(system: System) -> list[Any]:
    return [] if system.modal_damping is None else np.ravel(system.modal_damping).tolist()


def _constants_of(system: System) -> list[Any]:
    return [constant for motion in system.prescribed for constant in motion.constants] if system.is_analytic else []


def entries_of(system: System) -> list[float]:
    """The list of a system's own numbers."""
    fields = np.zeros((len(FIELDS), system.n_links))
    for group in system.groups:
        drive, quadratic = group.excitation, group.quadratic_drag
        own = {name: getattr(group.block, name) for name in FIELDS if hasattr(group.block, name)}
        own |= {"strength": drive.strength, "curb": drive.curb} if drive else {}
        own |= {} if quadratic is None else {"quadratic_drag": quadratic}
        for name, values in own.items():
            fields[FIELDS.index(name), group.index] = values
    return [system.gravity, *(map(float, system.cart or (0.0, 0.0, 0.0))), *fields.ravel().tolist()]


def numbers_of_all(scenes: Sequence[Scene]) -> Numbers:
    """Of scenes that differ in numbers alone."""
    validate_scenes(scenes)
    system = system_of(scenes[0])
    each = [numbers_of(scene) for scene in scenes]
    return Numbers(system, _joined([own.entries for own in each]), _joined([own.prescribed for own in each]))


def _joined(rows: Sequence[Sequence[Any]]) -> tuple[Any, ...]:
    """Column by column one number, or an array where they differ."""
    return tuple(
        column[0] if all(own == column[0] for own in column) else np.array(column) for column in zip(*rows, strict=True)
    )


def _row(link: AnyLink, given: Mapping[tuple[Any, ...], Floats]) -> list[Any]:
    """The entries of one link, with other values at some of its places."""
    mass, length, damping, stiffness = (
        given.get((name,), getattr(link, name)) for name in ("mass", "length", "damping", "stiffness")
    )
    if isinstance(link, Body):
        centre, inertia = (given.get((name,), getattr(link, name)) for name in ("centre", "inertia"))
    else:
        centre, inertia = link.proportions(mass, length)
    strength: Any = 0.0
    curb: Any = 0.0
    if link.drive is not None and not isinstance(link.drive, Escapement):
        strength = given.get(("drive", "strength"), link.drive.strength)
        angle = given.get(("drive", "angle_deg"))
        curb = strength / (radians(link.drive.angle_deg) if angle is None else np.radians(angle)) ** 2
    drag = (given.get((name,), getattr(link, name)) for name in DRAG)
    return [mass, length, centre, inertia, damping, stiffness, strength, curb, *drag]


def system_with(system: System, entries: Sequence[Any], tail: bool = False) -> System:
    """The same system with other entries: numbers, symbols, or with a `tail` arrays of one length or 1 a field."""
    links = system.n_links
    gravity, *cart = entries[:BEFORE]
    fields = [_stacked(entries[at : at + links], tail) for at in range(BEFORE, BEFORE + len(FIELDS) * links, links)]
    groups = tuple(_group(group, dict(zip(FIELDS, fields, strict=True)), tail) for group in system.groups)
    return replace(system, gravity=gravity, cart=system.cart and CartNumbers(*cart), groups=groups)


def with_prescribed(system: System, prescribed: Sequence[Any]) -> System:
    """The same system with other entries of D_modal, (n, n) or (n, n, S), and other constants of what is prescribed."""
    rest, found = [*prescribed], system
    if system.modal_damping is not None and rest:
        count = np.size(system.modal_damping)
        own, rest = rest[:count], rest[count:]
        D = np.array(np.broadcast_arrays(*own)) if any(isinstance(one, np.ndarray) for one in own) else _stacked(own)
        found = replace(found, modal_damping=D.reshape(*np.shape(system.modal_damping), *D.shape[1:]))
    if not rest:
        return found
    constants = iter(rest)
    motions = [one.with_constants([next(constants) for _ in one.constants]) for one in system.prescribed]
    support, forces = system.support, system.forces
    if support:
        moved = zip(support.directions, motions[: len(motions) - len(forces)], strict=True)
        support = replace(support, motions=tuple(moved))
    acting = zip(forces, motions[len(motions) - len(forces) :], strict=True)
    return replace(found, support=support, forces=tuple(replace(one, motion=motion) for one, motion in acting))


def _stacked(own: Sequence[Any], tail: bool = False) -> Any:
    if tail:
        return np.stack(own)
    plain = all(isinstance(entry, float) for entry in own)
    found = np.empty(len(own), dtype=float if plain else object)
    found[:] = own
    return found


def _group(group: Group, fields: Mapping[str, Any], tail: bool) -> Group:
    own = {name: values[group.index] for name, values in fields.items()}
    strength, curb, quadratic = (own.pop(name) for name in ("strength", "curb", "quadratic_drag"))
    sigma = group.block.sigma[..., None] if tail else group.block.sigma
    drive = group.excitation and replace(group.excitation, strength=strength, curb=curb)
    block = replace(group.block, sigma=sigma, **own)
    return replace(group, block=block, excitation=drive, quadratic_drag=quadratic if np.any(quadratic) else None)
