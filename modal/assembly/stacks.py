"""Scenes of one form as one set of arrays: the same pendula, links and support, with different numbers in each.

The natural units of every scene are powers of two as in `modal.assembly.arrays`, with g = 1.
"""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from itertools import chain
from operator import attrgetter

import numpy as np

from modal.scene import Cart, Pendulum, Scene
from modal.types import Floats, Ints

KIND, SIZE = attrgetter("__class__", "count", "damping", "stiffness", "drag"), attrgetter("mass", "length")


@dataclass(frozen=True, eq=False)
class Group:
    """P pendula of n links in each of S scenes: arrays (n, P, 1, S), top link first; `count` (P,) copies of each."""

    mass: Floats
    length: Floats
    centre: Floats
    inertia: Floats
    count: Ints

    @property
    def numbers(self) -> tuple[Floats, Floats, Floats, Floats]:
        """All arrays except the counts."""
        return self.mass, self.length, self.centre, self.inertia


@dataclass(frozen=True, eq=False)
class Stack:
    """S scenes in their natural units; `rate` (S,) is the unit of angular frequency in rad/s.

    `mass` and `stiffness` (S,) are those of the carts, None where the supports are fixed.
    """

    groups: tuple[Group, ...]
    mass: Floats | None
    stiffness: Floats | None
    rate: Floats
    spatial: bool


def can_stack(scenes: Sequence[Scene]) -> bool:
    """Whether all scenes have the same form, and equations that stacks have.

    Those are without dampers, drag, joint springs, massless carts, inverted links and constant forces.
    """
    form = _form(scenes[0])
    return _is_plain(scenes[0]) and all(_form(scene) == form for scene in scenes)


def _form(scene: Scene) -> Hashable:
    """A key equal for scenes of the same form."""
    cart = scene.support if isinstance(scene.support, Cart) else None
    held = cart and (cart.mass > 0, cart.damping, cart.stiffness > 0)
    pendula = [(pendulum.count, pendulum.equilibrium, *map(KIND, pendulum.links)) for pendulum in scene.pendulum]
    return held, scene.space, tuple(pendula)


def _is_plain(scene: Scene) -> bool:
    cart = scene.support if isinstance(scene.support, Cart) else None
    still = not any(link.damping or link.stiffness or link.drag for link in scene.links())
    straight = not scene.stands and "constant_force" not in scene.features
    return still and straight and not (cart and (cart.damping or not cart.mass))


def stacked(scenes: Sequence[Scene]) -> Stack:
    """The arrays of scenes of one form."""
    first = scenes[0]
    mass, length, centre, inertia = _links(scenes)
    gravity = np.array([scene.gravity for scene in scenes])
    heaviest, longest = (2.0 ** np.frexp(values.max(1))[1] for values in (mass, length))
    scaled = [
        values / unit[:, None]
        for values, unit in ((mass, heaviest), (length, longest), (centre, longest), (inertia, heaviest * longest**2))
    ]
    groups = tuple(_pendula_of(chosen, scaled) for chosen in _by_length(first))
    cart = None, None
    if isinstance(first.support, Cart):
        numbers = np.array([(scene.support.mass, scene.support.stiffness) for scene in scenes])  # type: ignore[union-attr]
        cart = numbers[:, 0] / heaviest, numbers[:, 1] / (heaviest * gravity / longest)
    return Stack(groups, *cart, np.sqrt(gravity / longest), first.space == "space")


def _links(scenes: Sequence[Scene]) -> list[Floats]:
    """Mass, length, centre and inertia (S, L) of all links as specified."""
    rows = [[link for pendulum in scene.pendulum for link in pendulum.links] for scene in scenes]
    sizes = np.fromiter(chain.from_iterable(map(SIZE, chain.from_iterable(rows))), float).reshape(len(rows), -1, 2)
    mass, length = (np.ascontiguousarray(sizes[..., column]) for column in (0, 1))
    centre, inertia = np.empty_like(mass), np.empty_like(mass)
    kinds = [type(link) for link in rows[0]]
    for kind in set(kinds):
        own = [column for column, other in enumerate(kinds) if other is kind]
        if kind.is_uniform:
            centre[:, own], inertia[:, own] = rows[0][own[0]].proportions(mass[:, own], length[:, own])
        else:
            centre[:, own] = [[row[column].centre for column in own] for row in rows]
            inertia[:, own] = [[row[column].inertia for column in own] for row in rows]
    return [mass, length, centre, inertia]


def _by_length(scene: Scene) -> list[list[tuple[Pendulum, int]]]:
    """The pendula with the column of their first link, grouped by their number of links."""
    found: dict[int, list[tuple[Pendulum, int]]] = {}
    column = 0
    for pendulum in scene.pendulum:
        found.setdefault(pendulum.n_links, []).append((pendulum, column))
        column += len(pendulum.links)
    return [found[n] for n in sorted(found)]


def _pendula_of(chosen: list[tuple[Pendulum, int]], scaled: Sequence[Floats]) -> Group:
    columns = [
        np.repeat(np.arange(len(pendulum.links)), [link.count for link in pendulum.links]) + column
        for pendulum, column in chosen
    ]
    at = np.array(columns).T
    mass, length, centre, inertia = (np.ascontiguousarray(values.T[at])[:, :, None] for values in scaled)
    return Group(mass, length, centre, inertia, np.array([pendulum.count for pendulum, _ in chosen]))
