"""The numbers of a scene as a list, of which many members may each have their own.

The list is gravity, then of every link in the order of the file its mass, length, centre, inertia, the reflected
inertia of its rotor, damper, spring and drag, field by field; then those of the supports of the pendula: of every
support its place, mass, inertia, rods, centre, springs and dampers (of a modal one M, K, D and its points), of every
entry of pendula where it hangs, of every spring its two numbers and its ends; last the parameters of joint laws, term
by term. Next to it are the entries of D_modal and the constants of sines that move the support, and of sines and
constants that act as forces. Where members differ an entry is an array (S,), elsewhere one number.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from modal.extend import Parameter
from modal.report import Displayed
from modal.scene import AnyLink, Body, Scene, validate_scene, validate_scenes
from modal.scene.doors import checked
from modal.scene.laws import JointPart
from modal.scene.parameters import Place
from modal.structure import CarrierEnd, CarrierNumbers, End, GroundEnd, LinkEnd, Structure, structure_of
from modal.types import Floats
from nonlinear.system.system import Group, JointTerm, System, system_of

BEFORE = 1
"""Format: entries before those of links: gravity."""
FIELDS = ("mass", "length", "centre", "inertia", "rotor", "damping", "stiffness", "drag", "quadratic_drag")
DRAG = ("drag", "quadratic_drag")
WORKING = ("damping", *DRAG)
Values = Mapping[Place, Floats]


@dataclass(frozen=True, eq=False, repr=False)
class Numbers(Displayed):
    """The numbers of S members with the form of a `system`: `entries` are numbers or arrays (S,).

    So are `constants`, the entries of D_modal, row by row, if there is one, and constants of motions and forces; and
    `switching`, those of escapements and dry friction (`nonlinear.integration.switches`), empty without them.
    """

    what = "Numbers of members with the form of one system"
    shows = "system: system; entries: numbers that differ"

    system: System
    entries: tuple[Any, ...]
    constants: tuple[Any, ...] = ()
    switching: tuple[Any, ...] = ()

    @cached_property
    def works(self) -> bool:
        """Whether energy goes in or out of any member, or could where these entries differ."""
        system = self.system
        outside = any(part is not None for part in (system.modal_damping, system.hoisting))
        first = BEFORE + len(FIELDS) * system.n_links
        outside = outside or any(self._is_set(first + k) for k in dampers_of(system.suspension))
        outside = outside or any(not term.law.is_conservative for group in system.groups for term in group.laws)
        outside = outside or any(group.point_forces for group in system.groups)
        outside = outside or bool(system.loops)
        return outside or bool(system.prescribed_motions) or system.has_escapements or self._any_of(WORKING)

    @cached_property
    def has_drag(self) -> bool:
        """Whether any member has drag, or could."""
        return self._any_of(DRAG) or any(group.point_forces for group in self.system.groups)

    def _any_of(self, names: Sequence[str]) -> bool:
        links = self.system.n_links
        return any(self._is_set(BEFORE + FIELDS.index(name) * links + k) for name in names for k in range(links))

    def _is_set(self, k: int) -> bool:
        return isinstance(self.entries[k], np.ndarray) or bool(self.entries[k])

    def at(self, members: Any) -> Numbers:
        """Those of some members: a slice or indices."""
        parts = (
            tuple(entry[members] if isinstance(entry, np.ndarray) else entry for entry in entries)
            for entries in (self.entries, self.constants, self.switching)
        )
        return Numbers(self.system, *parts)

    @cached_property
    def arrays(self) -> System:
        """The system with these in its arrays: (n, P, 1), or (n, P, S) where members differ."""
        entries = [entry if isinstance(entry, np.ndarray) else np.array([entry]) for entry in self._uniform_entries]
        system = system_with(self.system, entries, tail=True)
        return system_with_constants(system, self.constants)

    @property
    def _uniform_entries(self) -> list[Any]:
        """The entries, of each field either all arrays or none."""
        links, entries = self.system.n_links, list(self.entries)
        count = max((len(entry) for entry in entries if isinstance(entry, np.ndarray)), default=1)
        for at in range(BEFORE, BEFORE + len(FIELDS) * links, links):
            field = entries[at : at + links]
            if any(isinstance(entry, np.ndarray) for entry in field):
                entries[at : at + links] = [np.broadcast_to(entry, count) for entry in field]
        return entries


def numbers_of(
    scene: Scene, values: Values | None = None, system: System | None = None, modal: Floats | None = None
) -> Numbers:
    """The numbers of a scene, with arrays (S,) of `values` at some of its places and D_modal (S, n, n)."""
    validate_scene(scene)
    replacements: Values = values or {}
    links, rows_of = _placed_links(scene), dict[Place, list[Any]]()
    for place, link in links:
        if place not in rows_of:
            changes = {key[4:]: value for key, value in replacements.items() if key[:4] == place}
            rows_of[place] = _row(link, changes)
    rows = [rows_of[place] for place, _ in links]
    fields = [entry for field in zip(*rows, strict=True) for entry in field]
    base = system or system_of(scene)
    if modal is not None:
        base = replace(base, modal_damping=modal[0])
    constants = _motion_constants(base, _motion_places(scene), replacements, modal)
    rest = numbers_of_structure(base.suspension)
    for k, names in enumerate(_places_of_structure(scene, base.suspension)):
        rest[k] = next((replacements[name] for name in names if name in replacements), rest[k])
    laws = [
        replacements.get((*place, parameter.name), getattr(part, parameter.name))
        for place, part, parameter in _law_entries(scene, base)
    ]
    return Numbers(base, (replacements.get(("gravity",), scene.gravity), *fields, *rest, *laws), constants)


def _placed_links(scene: Scene) -> list[tuple[Place, AnyLink]]:
    """Every link with all copies, and its place in the scene."""
    links: list[tuple[Place, AnyLink]] = []
    for p, pendulum in enumerate(scene.pendulum):
        places = [(("pendulum", p, "links", i), link) for i, link in enumerate(pendulum.links)]
        chain = [pair for pair in places for _ in range(pair[1].count)]
        links += chain * pendulum.count
    return links


@checked
def law_places(scene: Scene, system: System) -> list[tuple[int, Place]]:
    """Which entries are parameters of laws, the last of a system's own, and their places in the scene."""
    places = [(*place, parameter.name) for place, _, parameter in _law_entries(scene, system)]
    return [*enumerate(places, len(entries_of(system)) - len(places))]


def _law_entries(scene: Scene, system: System) -> Iterator[tuple[Place, JointPart, Parameter]]:
    if not (scene.has_laws or scene.has_drag):
        return
    links = _placed_links(scene)
    for group in system.groups:
        for term in (*group.laws, *group.point_forces):
            for parameter in term.law.parameters:
                for number in group.index[term.rows, term.columns].tolist():
                    place, link = links[number]
                    steps, part = (link.placed_laws if term in group.laws else link.placed_forces)[term.order]
                    yield (*place, *steps), part, parameter


@checked
def prescribed_places(scene: Scene, system: System) -> list[tuple[Place, float]]:
    """Where a scene has the constants of its motions and forces, one after the other, and the unit of each there."""
    if not system.is_analytic:
        return []
    return [
        ((*place, name), unit)
        for place, motion in zip(_motion_places(scene), system.prescribed_motions, strict=True)
        for name, unit in motion.units.items()
    ]


def _motion_places(scene: Scene) -> list[Place]:
    """Where a scene has its motions and forces, in the order of `System.prescribed_motions`."""
    return [*scene.motion_places, *(("force", k) for k in range(len(scene.force)))]


def _motion_constants(
    system: System, places: Sequence[Place], replacements: Values, modal: Floats | None
) -> tuple[Any, ...]:
    D = _modal_of(system)
    if modal is not None:
        D = [column if np.any(column != column[0]) else float(column[0]) for column in modal.reshape(len(modal), -1).T]
    loops = [
        replacements.get(("feedback", loop.entry, key), number)
        for loop in system.loops
        for key, number in zip(loop.keys, loop.numbers, strict=True)
    ]
    if not system.is_analytic:
        return (*D, *loops)
    constants = [
        replacements[(*place, name)] * unit if (*place, name) in replacements else constant
        for place, motion in zip(places, system.prescribed_motions, strict=True)
        for (name, unit), constant in zip(motion.units.items(), motion.constants, strict=True)
    ]
    return (*D, *constants, *loops)


def constants_of(system: System) -> list[float]:
    """The entries of D_modal, the constants of prescribed motions and the numbers of loops, of a system's own."""
    motions = system.prescribed_motions if system.is_analytic else ()
    constants = (constant for motion in motions for constant in motion.constants)
    return [*_modal_of(system), *constants, *(number for loop in system.loops for number in loop.numbers)]


def _modal_of(system: System) -> list[Any]:
    return [] if system.modal_damping is None else np.ravel(system.modal_damping).tolist()


def entries_of(system: System) -> list[float]:
    """The list of a system's own numbers."""
    fields = np.zeros((len(FIELDS), system.n_links))
    for group in system.groups:
        quadratic = group.quadratic_drag
        law = {name: getattr(group.block, name) for name in FIELDS if hasattr(group.block, name)}
        law |= {} if quadratic is None else {"quadratic_drag": quadratic}
        for name, values in law.items():
            fields[FIELDS.index(name), group.index] = values
    laws = [value for term in _terms(system) for number in term.numbers for value in number.tolist()]
    return [system.gravity, *fields.ravel().tolist(), *numbers_of_structure(system.suspension), *laws]


def _terms(system: System) -> Iterator[JointTerm]:
    return (term for group in system.groups for term in (*group.laws, *group.point_forces))


def numbers_of_all(scenes: Sequence[Scene]) -> Numbers:
    """The numbers of scenes that differ in numbers alone."""
    validate_scenes(scenes)
    system = system_of(scenes[0])
    members = [numbers_of(scene) for scene in scenes]
    return Numbers(
        system, _join([numbers.entries for numbers in members]), _join([numbers.constants for numbers in members])
    )


def _join(rows: Sequence[Sequence[Any]]) -> tuple[Any, ...]:
    """Column by column one number, or an array where they differ."""
    return tuple(
        column[0] if all(entry == column[0] for entry in column) else np.array(column)
        for column in zip(*rows, strict=True)
    )


def _row(link: AnyLink, replacements: Mapping[tuple[Any, ...], Floats]) -> list[Any]:
    """The entries of one link, with other values at some of its places."""
    names = ("mass", "length", "rotor_inertia", "gear_ratio", "damping", "stiffness")
    mass, length, rotor, gear, damping, stiffness = (replacements.get((name,), getattr(link, name)) for name in names)
    if isinstance(link, Body):
        centre, inertia = (replacements.get((name,), getattr(link, name)) for name in ("centre", "inertia"))
    else:
        centre, inertia = link.proportions(mass, length)
    drag = (replacements.get((name,), getattr(link, name)) for name in DRAG)
    return [mass, length, centre, inertia, rotor * gear**2, damping, stiffness, *drag]


def system_with(system: System, entries: Sequence[Any], tail: bool = False) -> System:
    """The same system with other entries: numbers, symbols, or with a `tail` arrays of one length or 1 a field."""
    links = system.n_links
    fields = [_stack(entries[at : at + links], tail) for at in range(BEFORE, BEFORE + len(FIELDS) * links, links)]
    law_count = sum(len(term.numbers) * len(term.rows) for term in _terms(system))
    law_numbers = iter(entries[len(entries) - law_count :])
    groups = tuple(_group(group, dict(zip(FIELDS, fields, strict=True)), law_numbers, tail) for group in system.groups)
    suspension = structure_with(system.suspension, entries[BEFORE + len(FIELDS) * links :])
    return replace(system, gravity=entries[0], suspension=suspension, groups=groups)


def system_with_constants(system: System, numbers: Sequence[Any]) -> System:
    """The same system with other entries of D_modal, (n, n) or (n, n, S), constants of motions and forces, loops."""
    rest, result = [*numbers], system
    if system.modal_damping is not None and rest:
        count = np.size(system.modal_damping)
        entries, rest = rest[:count], rest[count:]
        has_arrays = any(isinstance(entry, np.ndarray) for entry in entries)
        D = np.array(np.broadcast_arrays(*entries)) if has_arrays else _stack(entries)
        result = replace(result, modal_damping=D.reshape(*np.shape(system.modal_damping), *D.shape[1:]))
    if not rest:
        return result
    constants = iter(rest)
    if not system.is_analytic:
        return replace(result, loops=tuple(loop.with_numbers(constants) for loop in system.loops))
    motions = [
        motion.with_constants([next(constants) for _ in motion.constants]) for motion in system.prescribed_motions
    ]
    support, forces = system.support, system.forces
    if support:
        support_motions = zip(support.directions, motions[: len(motions) - len(forces)], strict=True)
        support = replace(support, motions=tuple(support_motions))
    acting = zip(forces, motions[len(motions) - len(forces) :], strict=True)
    loops = tuple(loop.with_numbers(constants) for loop in system.loops)
    new_forces = tuple(replace(force, motion=motion) for force, motion in acting)
    return replace(result, support=support, forces=new_forces, loops=loops)


# ------------------------------------------------------------------------------------------------------ structures


def numbers_of_structure(structure: Structure) -> list[Any]:
    """The numbers of a structure, in order."""
    return [number for _, number in _entries_of_structure(structure)]


def dampers_of(structure: Structure) -> list[int]:
    """Which of its numbers are those of dampers."""
    return [k for k, (name, _) in enumerate(_entries_of_structure(structure)) if name in {"damping", "D"}]


def _entries_of_structure(structure: Structure) -> list[tuple[str, Any]]:
    """The numbers of a structure, in order, each with a name."""
    entries: list[tuple[str, Any]] = []
    for carrier in structure.carriers:
        body = [*carrier.position, carrier.mass, carrier.inertia, *carrier.centre, *carrier.parameters]
        parts: dict[str, Any] = {"body": body, "stiffness": carrier.stiffness, "damping": carrier.damping}
        parts |= {name: np.ravel(part).tolist() for name, part in _modal(carrier).items()}
        entries += [(name, number) for name, part in parts.items() for number in part]
    for pivot in _pivots(structure):
        entries += [] if isinstance(pivot.where, int) else [("pivot", number) for number in pivot.where]
    for spring in structure.springs:
        entries += [("stiffness", spring.stiffness), ("damping", spring.damping)]
        entries += [("end", number) for end in spring.ends for number in _of_end(end)]
    return entries


def structure_with(structure: Structure, numbers: Sequence[Any]) -> Structure:
    """The same structure with other numbers: of pendula that hang from one point these stay one."""
    entries = iter(numbers)

    def take(count: int) -> tuple[Any, ...]:
        return tuple(next(entries) for _ in range(count))

    carriers = []
    for carrier in structure.carriers:
        position, (mass, inertia), centre = take(2), take(2), take(2)
        parameters = take(len(carrier.parameters))
        stiffness, damping = take(len(carrier.stiffness)), take(len(carrier.damping))
        modal = {
            name: _stack([_single(entry) for entry in take(part.size)]).reshape(part.shape)
            for name, part in _modal(carrier).items()
        }
        law = {"stiffness": stiffness, "damping": damping, "centre": centre, "position": position, **modal}
        carriers.append(replace(carrier, mass=mass, inertia=inertia, parameters=parameters, **law))
    pivots = {
        id(pivot): pivot if isinstance(pivot.where, int) else CarrierEnd(pivot.carrier, take(2))
        for pivot in _pivots(structure)
    }
    springs = []
    for spring in structure.springs:
        stiffness, damping = take(2)
        first, second = (_end_with(end, take(len(_of_end(end)))) for end in spring.ends)
        springs.append(spring._replace(stiffness=stiffness, damping=damping, ends=(first, second)))
    return Structure(tuple(carriers), tuple(pivots[id(pivot)] for pivot in structure.pivots), tuple(springs))


def _single(entry: Any) -> Any:
    """A number that no two members have different, by itself."""
    return float(entry[0]) if isinstance(entry, np.ndarray) else entry


def _modal(carrier: CarrierNumbers) -> dict[str, Floats]:
    parts = {"M": carrier.M, "K": carrier.K, "D": carrier.D, "points": carrier.points}
    return {name: part for name, part in parts.items() if part is not None}


def _pivots(structure: Structure) -> list[CarrierEnd]:
    """Each once, as copies of a pendulum have one."""
    return list({id(pivot): pivot for pivot in structure.pivots}.values())


def _of_end(end: End) -> tuple[Any, ...]:
    if isinstance(end, LinkEnd):
        return () if end.below is None else (end.below,)
    where = end.place if isinstance(end, GroundEnd) else end.where
    return where if isinstance(where, tuple) else ()


def _end_with(end: End, numbers: tuple[Any, ...]) -> End:
    if not numbers:
        return end
    if isinstance(end, LinkEnd):
        return end._replace(below=numbers[0])
    return end._replace(where=numbers) if isinstance(end, CarrierEnd) else GroundEnd(numbers)


def structure_places(scene: Scene) -> list[tuple[int, Place]]:
    """Which entries are numbers of a structure that have a place in the scene, and that place."""
    structure, links = structure_of(scene), sum(pendulum.n_links * pendulum.count for pendulum in scene.pendulum)
    first = BEFORE + len(FIELDS) * links
    several = isinstance(scene.support, tuple)
    return [
        (first + k, names[0 if several or names[0][0] != "support" else -1])
        for k, names in enumerate(_places_of_structure(scene, structure))
        if names
    ]


def _places_of_structure(scene: Scene, structure: Structure) -> list[list[Place]]:
    """Where the scene has each number of its structure: every name that it may go by."""
    places: list[list[Place]] = []
    for k, carrier in enumerate(structure.carriers):
        heads: list[Place] = [("support", k), ("support",)] if len(structure.carriers) == 1 else [("support", k)]
        # a single support moves from wherever it is drawn
        names: list[Place] = [("position", 0), ("position", 1)] if scene.is_structured else [(), ()]
        names += [("mass",), ("inertia",), ("centre", 0), ("centre", 1), *((name,) for name in carrier.values)]
        ways = [coordinate.way for coordinate in carrier.path.coordinates] if carrier.path else []
        names += [(law, way) if way else (law,) for law in ("stiffness", "damping") for way in ways]
        places += [[(*head, *name) for head in heads if name] for name in names]
        places += [[] for part in _modal(carrier).values() for _ in range(part.size)]
    first = 0
    for p, pendulum in enumerate(scene.pendulum):
        if scene.is_structured and not isinstance(structure.pivots[first].where, int):
            places += [[("pendulum", p, "position", k)] for k in (0, 1)]
        first += pendulum.count
    for spring in structure.springs:
        places += [[("spring", spring.entry, name)] for name in ("stiffness", "damping")]
        places += [[] for end in spring.ends for _ in _of_end(end)]
    return places


def _stack(entries: Sequence[Any], tail: bool = False) -> Any:
    if tail:
        return np.stack(entries)
    plain = all(isinstance(entry, float) for entry in entries)
    stack = np.empty(len(entries), dtype=float if plain else object)
    stack[:] = entries
    return stack


def _group(group: Group, fields: Mapping[str, Any], law_numbers: Iterator[Any], tail: bool) -> Group:
    values_of = {name: values[group.index] for name, values in fields.items()}
    quadratic = values_of.pop("quadratic_drag")
    laws = tuple(_term(term, law_numbers, tail) for term in group.laws)
    forces = tuple(_term(term, law_numbers, tail) for term in group.point_forces)
    sigma = group.block.sigma[..., None] if tail else group.block.sigma
    block = replace(group.block, sigma=sigma, **values_of)
    drag = quadratic if np.any(quadratic) else None
    return replace(group, block=block, laws=laws, point_forces=forces, quadratic_drag=drag)


def _term(term: JointTerm, numbers: Iterator[Any], tail: bool) -> JointTerm:
    columns = [[next(numbers) for _ in term.rows] for _ in term.numbers]
    if tail:
        columns = [[*np.broadcast_arrays(*column)] for column in columns]
    return replace(term, numbers=tuple(_stack(column, tail) for column in columns))
