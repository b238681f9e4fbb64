"""Populations: equal pendula on one support, and the scene in which a few of them stand for all.

Where N equal pendula hang from points that move alike and do the same, their pulls on the support add up: two pendula
of N/2 times the masses, dampers, springs and drives pull as much and swing alike.  Of their small disturbances the mean
moves the support, and the difference does not, which is what any of N − 1 differences within the population does.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from modal.errors import ComputationError
from modal.report import Displayed, Summary, counted
from modal.scene import Pendulum, Scene
from modal.scene.doors import require_type
from modal.scene.points import PendulumPoint, parse_point
from modal.structure import Pivot, Structure, structure_of
from modal.types import Ints

HALVES = 2  # pendula that stand for a population


@dataclass(frozen=True, eq=False, repr=False)
class Population(Displayed):
    """Equal pendula on one support: its index and its name, and their numbers `pendula` in the order of the file.

    `are_alike` tells whether all their first joints move alike.

    >>> from modal import load
    >>> from nonlinear.system import populations_of
    >>> [(one.name, one.size) for one in populations_of(load("two-swings"))]
    [('left', 15), ('right', 15)]
    """

    support: int
    name: str
    pendulum: Pendulum
    pendula: Ints
    are_alike: bool

    def _summary(self) -> Summary:
        return Summary(f"Population of {counted(self.size, 'pendulum', 'pendula')}", [("on", self.name)])

    @property
    def size(self) -> int:
        """The number N of its pendula."""
        return len(self.pendula)

    @property
    def halves(self) -> int:
        """How many pendula stand for it in the scene of `representatives`."""
        return min(self.size, HALVES)


def populations_of(scene: Scene) -> tuple[Population, ...]:
    """The populations of a structured scene, in the order of its pendula: equal but for start, place and count."""
    require_type("scene", scene, "Scene")
    structure, members = structure_of(scene), dict[tuple[int, Pendulum], list[int]]()
    number = 0
    for pendulum in scene.pendulum:
        kind = pendulum.replace(start=None, count=1, position=(0.0, 0.0), on=None)
        numbers = members.setdefault((structure.pivots[number].carrier, kind), [])
        numbers += range(number, number + pendulum.count)
        number += pendulum.count
    names = scene.support_names
    return tuple(
        Population(
            carrier,
            names[carrier],
            kind,
            np.array(numbers),
            _move_alike(structure, [structure.pivots[p] for p in numbers]),
        )
        for (carrier, kind), numbers in members.items()
    )


def _move_alike(structure: Structure, pivots: Sequence[Pivot]) -> bool:
    """Whether these points of one carrier move alike: one point, or points of one that moves without turning."""
    carrier = structure.carriers[pivots[0].carrier]
    shifts = carrier.turning is None and carrier.points is None
    return shifts or all(pivot.where == pivots[0].where for pivot in pivots)


def unrepresented(scene: Scene) -> Iterator[str]:
    """Why no few pendula can stand for the populations of a structured scene; nothing where they can."""
    require_type("scene", scene, "Scene")
    for population in populations_of(scene):
        if not population.are_alike:
            yield f"the pendula of {population.name} hang from points that move differently"
    if any(isinstance(parse_point(end), PendulumPoint) for spring in scene.spring for end in spring.between):
        yield "springs end at pendula"
    if scene.has_modal_damping:
        yield "damping ratios belong to all modes together"


def representatives(scene: Scene) -> Scene:
    """The scene in which two pendula stand for every population, or one for one: the order is that of populations.

    Raises ComputationError where none can.

    >>> from modal import load
    >>> from nonlinear.system import representatives
    >>> few = representatives(load("two-swings"))
    >>> few.n_pendula, few.pendulum[0].links[0].mass
    (4, 0.0075)
    """
    require_type("scene", scene, "Scene")
    if reasons := list(unrepresented(scene)):
        raise ComputationError(f"no small set of pendula represents the others: {'; '.join(reasons)}")
    first = np.cumsum([0, *(pendulum.count for pendulum in scene.pendulum)])
    pendula = []
    for population in populations_of(scene):
        drawn = scene.pendulum[int(np.searchsorted(first, population.pendula[0], "right")) - 1]
        links = tuple(link.heavier(population.size / population.halves) for link in drawn.links)
        pendula.append(drawn.replace(count=population.halves, links=links, start=None))
    return scene.replace(pendulum=tuple(pendula))
