"""Populations: equal pendula on one support, and the scene in which a few represent all.

Where N equal pendula hang from points that move alike and do the same, their pulls on the support add up: two pendula
of N/2 times the masses, dampers, springs and drives pull as much and swing alike. Of their small perturbations the mean
moves the support, and the difference does not, as for each of the N − 1 differences within the population.

Displacements of supports under which a scene is invariant: those of free carts.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from modal.errors import ComputationError
from modal.report import Displayed, Summary, counted
from modal.scene import Pendulum, Scene
from modal.scene.doors import require_type
from modal.scene.points import PendulumPoint, parse_point, places_of
from modal.structure import CarrierEnd, End, LinkEnd, Structure, structure_of
from modal.types import Floats, Ints
from nonlinear.system.system import System


@dataclass(frozen=True, eq=False, repr=False)
class Population(Displayed):
    """Equal pendula on one support: its index and its name, and their numbers `pendula` in the order of the file.

    `are_alike` says whether all their first joints move alike.

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
        """The number of pendula that represent it in the scene of `representatives`."""
        return min(self.size, 2)


@lru_cache(maxsize=16)
def burdens(scene: Scene) -> tuple[int, ...]:
    """The number of the first pendulum that bears the same springs and forces as each, from 0, (N,).

    Two bear the same where their exchange leaves all springs and forces between points unchanged.
    """
    sizes = [pendulum.n_links for pendulum in scene.pendulum for _ in range(pendulum.count)]
    first = np.concatenate(([0], np.cumsum(sizes)))
    parts: list[tuple[tuple[str, ...], Any]] = [
        (spring.between, spring.replace(between=("ground", "ground"))) for spring in scene.spring
    ]
    parts += [((force.on,), force.replace(on="cart")) for force in scene.force]
    borne = dict[int, Counter[Any]]()
    for texts, numbers in parts:
        ends = [_ends(scene, text, first) for text in texts]
        for k in range(max(map(len, ends))):
            tie = frozenset(Counter(points[k % len(points)] for points in ends).items()), numbers
            for pendulum in {point[0] for point, _ in tie[0] if point[0] >= 0}:
                borne.setdefault(pendulum, Counter())[tie] += 1
    leaders: list[int] = []
    numbers_of_leaders = []
    for p in range(len(sizes)):
        ties = borne.get(p, Counter())
        leader = next((q for q in leaders if _exchange(ties, p, q) == borne.get(q, Counter())), p)
        leaders += [p] * (leader == p)
        numbers_of_leaders.append(leader)
    return tuple(numbers_of_leaders)


def _ends(scene: Scene, text: str, first: Ints) -> list[tuple[int, Any, Any]]:
    """Every point that a name means: its pendulum, its link and the distance below; −1 and the name of others."""
    owners = [(int(np.searchsorted(first, place.link, "right")) - 1, place) for place in places_of(scene, text)]
    return [(p, place.link - int(first[p]), place.below) for p, place in owners] or [(-1, text, None)]


def _exchange(ties: Counter[Any], p: int, q: int) -> Counter[Any]:
    """Springs and forces after two pendula have exchanged their places."""
    swap = {p: q, q: p}
    return Counter(
        {
            (frozenset(((swap.get(point[0], point[0]), *point[1:]), n) for point, n in points), numbers): count
            for (points, numbers), count in ties.items()
        }
    )


def populations_of(scene: Scene) -> tuple[Population, ...]:
    """The populations of a structured scene, in the order of its pendula: equal but for start, place and count."""
    require_type("scene", scene, "Scene")
    structure, members = structure_of(scene), dict[tuple[int, Pendulum, int], list[int]]()
    kinds = [pendulum.replace(start=None, count=1, position=(0.0, 0.0), on=None) for pendulum in scene.pendulum]
    pendulum_kinds = [kind for kind, pendulum in zip(kinds, scene.pendulum, strict=True) for _ in range(pendulum.count)]
    for number, (kind, burden) in enumerate(zip(pendulum_kinds, burdens(scene), strict=True)):
        members.setdefault((structure.pivots[number].carrier, kind, burden), []).append(number)
    populations = []
    for (carrier, kind, _), numbers in members.items():
        are_alike = _move_alike(structure, [structure.pivots[p] for p in numbers])
        populations.append(Population(carrier, scene.support_names[carrier], kind, np.array(numbers), are_alike))
    return tuple(populations)


def _move_alike(structure: Structure, pivots: Sequence[CarrierEnd]) -> bool:
    """Whether these points of one support move alike: one point, or points of one that moves without turning."""
    carrier = structure.carriers[pivots[0].carrier]
    shifts = carrier.turning is None and carrier.points is None
    return shifts or all(pivot.where == pivots[0].where for pivot in pivots)


def representation_obstacles(scene: Scene) -> Iterator[str]:
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

    Raise ComputationError if none can.

    >>> from modal import load
    >>> from nonlinear.system import representatives
    >>> few = representatives(load("two-swings"))
    >>> few.n_pendula, few.pendulum[0].links[0].mass
    (4, 0.0075)
    """
    require_type("scene", scene, "Scene")
    if reasons := list(representation_obstacles(scene)):
        raise ComputationError(f"no small set of pendula represents the others: {'; '.join(reasons)}")
    first = np.cumsum([0, *(pendulum.count for pendulum in scene.pendulum)])
    pendula = []
    for population in populations_of(scene):
        entry = scene.pendulum[int(np.searchsorted(first, population.pendula[0], "right")) - 1]
        links = tuple(link.heavier(population.size / population.halves) for link in entry.links)
        pendula.append(entry.replace(count=population.halves, links=links, start=None))
    return scene.replace(pendulum=tuple(pendula))


def translations(system: System) -> Floats:
    """Displacements (m) of the coordinates before those of links that leave every force as it is, (k, first).

    One of a cart that no spring holds; on a structure one of each set of carts and platforms that springs join to each
    other and to nothing else.  Dampers may resist them.

    >>> from modal import load
    >>> from nonlinear.system import system_of
    >>> translations(system_of(load("paper-cart-2"))).tolist()
    [[1.0]]
    """
    structure, sets = system.suspension, _sets(system, system.suspension)
    moves = np.zeros((len(structure.carriers), system.first))
    for owner, carrier, offset in zip(sets[1:], structure.carriers, structure.offsets, strict=False):
        if owner != -1 and carrier.sliding is not None:
            moves[owner, offset + carrier.sliding] = 1.0
    return moves[moves.any(1)]


def _sets(system: System, structure: Structure) -> list[int]:
    """The set to which the ground and each support belong; those that something holds are in the ground's, −1."""
    sets = [-1, *range(len(structure.carriers))]

    def join(member: int, other: int) -> None:
        first, second = sorted((sets[member], sets[other]))
        sets[:] = [first if number == second else number for number in sets]

    for number, carrier in enumerate(structure.carriers, 1):
        if carrier.sliding is None or carrier.stiffness[carrier.sliding]:
            join(0, number)
    for spring, is_slack in zip(structure.springs, system.slack, strict=True):
        first_set, right = (_carrier(system, structure, end) for end in spring.ends)
        turns_damper = not is_slack and not (first_set and right)  # its direction depends on where the free end is
        if not spring.torsion and (spring.stiffness or (spring.damping and turns_damper)):
            join(first_set, right)
    return sets


def _carrier(system: System, structure: Structure, end: End) -> int:
    """The number from 1 of the support on which an end is, or below which it hangs; 0 of the ground."""
    if isinstance(end, LinkEnd):
        return structure.pivots[int(system.pendulum[end.link])].carrier + 1
    return end.carrier + 1 if isinstance(end, CarrierEnd) else 0
