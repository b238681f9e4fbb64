"""Scenes of one form as one set of arrays: the same pendula, links and support with different parameters.

The natural units of every scene are powers of two as in `modal.assembly.arrays`, with g = 1. A single short chain is
stored as plain floats, bit for bit those of `Rig.natural`, without the arrays of a rig: a table of two rows needs no
more.
"""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain
from operator import attrgetter
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from modal.assembly.arrays import Block, CartNumbers, Units, different
from modal.scene import Cart, Pendulum, Scene, validate_scene
from modal.types import Booleans, Floats

if TYPE_CHECKING:
    from modal.scene.parameters import Place

NUMBERS = ("mass", "length", "centre", "inertia")
SUPPORT = {("gravity",), ("support", "mass"), ("support", "stiffness")}
CHANGING = {"centre", "inertia"}
"""Numbers of a link at which zero is another form, as it is for both of a support."""
OTHERS = frozenset(
    {
        *("inverted", "joint_springs", "rotor", "dampers", "law", "linear_drag", "massless_cart"),
        *("constant_force", "structure", "springs", "feedback"),
    }
)
"""The features of scenes whose equations stacks do not have."""
SEVERAL = OTHERS | {"space", "copies", "damping_ratio"}
"""Those whose modes are not those of one plain chain."""
FLOAT_LINKS_MAX = 20
"""Cost: links up to which floats are quicker than arrays."""
KIND, SIZE = attrgetter("__class__", "count", "damping", "stiffness", "drag", "law"), attrgetter("mass", "length")


@dataclass(frozen=True, eq=False)
class Stack:
    """S scenes in their natural units: blocks of arrays (n, P, 1, S), a cart of S masses and springs.

    The `cart` is None if the supports are fixed; `rate` (S,) is the unit of angular frequency in rad/s.
    """

    blocks: tuple[Block, ...]
    cart: CartNumbers | None
    rate: Floats
    spatial: bool


def can_stack(scenes: Sequence[Scene]) -> bool:
    """Whether all scenes have the same form and equations that stacks support.

    Those are without dampers, drag, joint springs, massless carts, inverted links, structures, constant forces
    and feedback.
    """
    form = _form(scenes[0])
    return _is_plain(scenes[0]) and all(_form(scene) == form for scene in scenes)


def _form(scene: Scene) -> Hashable:
    """A key equal for scenes of the same form."""
    cart = scene.cart
    cart_form = cart and (cart.mass > 0, cart.damping, cart.stiffness > 0)
    pendula = [(pendulum.count, pendulum.equilibrium, *map(KIND, pendulum.links)) for pendulum in scene.pendulum]
    return cart_form, scene.space, tuple(pendula), "constant_force" in scene.features


def _is_plain(scene: Scene) -> bool:
    return OTHERS.isdisjoint(scene.features) and not (scene.cart and not scene.cart.mass)


def stack_scenes(scenes: Sequence[Scene]) -> Stack:
    """The arrays of scenes of one form."""
    carts = [(scene.cart.mass, scene.cart.stiffness) for scene in scenes if scene.cart]
    cart = np.array(carts).T if carts else None
    return _stack(scenes[0], _links(scenes), np.array([scene.gravity for scene in scenes]), cart)


def vary_scene(scene: Scene, numbers: Mapping[Place, Floats]) -> Stack | None:
    """Return the arrays of one scene with other parameters (S,) at some places; None if these change its form.

    They must `keep_form`.
    """
    validate_scene(scene)
    if not can_stack([scene]) or not all(place in SUPPORT or _is_of_link(place) for place in numbers):
        return None
    size = len(next(iter(numbers.values())))
    where = [(i, j, link) for i, pendulum in enumerate(scene.pendulum) for j, link in enumerate(pendulum.links)]
    links = [np.empty((len(where), size)) for _ in NUMBERS]
    for row, (i, j, link) in enumerate(where):
        at = ("pendulum", i, "links", j)
        mass, length = (numbers.get((*at, name), getattr(link, name)) for name in NUMBERS[:2])
        values_by_name = dict(zip(NUMBERS, (mass, length, *link.proportions(mass, length)), strict=True))
        for values, name in zip(links, NUMBERS, strict=True):
            values[row] = values_by_name[name] if link.is_uniform else numbers.get((*at, name), values_by_name[name])
    gravity = np.broadcast_to(numbers.get(("gravity",), scene.gravity), size)
    cart = None
    if scene.cart is not None:
        cart = np.empty((2, size))
        cart[0] = numbers.get(("support", "mass"), scene.cart.mass)
        cart[1] = numbers.get(("support", "stiffness"), scene.cart.stiffness)
    return _stack(scene, links, gravity, cart)


def keep_form(numbers: Mapping[Place, Floats]) -> Booleans:
    """Return which members (S,) share one form: a parameter that is zero may change the form."""
    keeps = np.ones(len(next(iter(numbers.values()))), dtype=np.bool_)
    for place, values in numbers.items():
        if place in SUPPORT or place[-1] in CHANGING:
            keeps &= values > 0
    return keeps


def _is_of_link(place: Place) -> bool:
    return len(place) == 5 and place[2] == "links" and place[-1] in NUMBERS


def _stack(scene: Scene, links: Sequence[Floats], gravity: Floats, cart: Floats | None) -> Stack:
    """The arrays of scenes of the form of one, with these numbers (L, S) of all links and (2, S) of the cart."""
    mass, length, centre, inertia = links
    heaviest, longest = (np.ldexp(1.0, np.frexp(values.max(0))[1]) for values in (mass, length))
    natural = mass / heaviest, length / longest, centre / longest, inertia / (heaviest * longest**2)
    blocks = tuple(_pendula_of(chosen, natural) for chosen in _by_length(scene))
    rail = None if cart is None else CartNumbers(cart[0] / heaviest, 0.0, cart[1] / (heaviest * gravity / longest))
    return Stack(blocks, rail, np.sqrt(gravity / longest), scene.space == "space")


def _links(scenes: Sequence[Scene]) -> list[Floats]:
    """Mass, length, centre and inertia (L, S) of all links as specified."""
    rows = [[link for pendulum in scene.pendulum for link in pendulum.links] for scene in scenes]
    sizes = np.fromiter(chain.from_iterable(map(SIZE, chain.from_iterable(rows))), float).reshape(len(rows), -1, 2)
    numbers = [np.empty((len(rows[0]), len(rows))) for _ in NUMBERS]
    mass, length, centre, inertia = numbers
    mass[:], length[:] = sizes[..., 0].T, sizes[..., 1].T
    for k, link in enumerate(rows[0]):
        if link.is_uniform:
            centre[k], inertia[k] = link.proportions(mass[k], length[k])
        else:
            centre[k], inertia[k] = np.array([(row[k].centre, row[k].inertia) for row in rows]).T
    return numbers


def _by_length(scene: Scene) -> list[list[tuple[Pendulum, int]]]:
    """The pendula with the column of their first link, grouped by their number of links."""
    groups: dict[int, list[tuple[Pendulum, int]]] = {}
    column = 0
    for pendulum in scene.pendulum:
        groups.setdefault(pendulum.n_links, []).append((pendulum, column))
        column += len(pendulum.links)
    return [groups[n] for n in sorted(groups)]


def _pendula_of(chosen: list[tuple[Pendulum, int]], numbers: Sequence[Floats]) -> Block:
    """Pendula of equal numbers in every scene are one column."""
    columns = [
        np.repeat(np.arange(len(pendulum.links)), [link.count for link in pendulum.links]) + column
        for pendulum, column in chosen
    ]
    at = np.array(columns).T
    if len(chosen) == 1 and at[-1] - at[0] == len(at) - 1:
        rows = slice(at[0, 0], at[-1, 0] + 1)
        arrays = [values[rows, None, None] for values in numbers]
    else:
        arrays = [values[at][:, :, None] for values in numbers]
    first, kinds = different(np.concatenate(arrays).swapaxes(0, 1).reshape(len(chosen), -1))
    count = np.bincount(kinds, weights=[pendulum.count for pendulum, _ in chosen]).astype(np.int64)
    mass, length, centre, inertia = arrays if len(first) == len(chosen) else [values[:, first] for values in arrays]
    none, down = np.broadcast_to(0.0, mass.shape), np.broadcast_to(1.0, mass.shape)
    return Block(mass, length, centre, inertia, none, none, none, none, down, count)


class Single(NamedTuple):
    """Mass, length, centre and inertia of each link, top first, and the cart (None: fixed), in natural units."""

    links: list[tuple[float, float, float, float]]
    cart: CartNumbers | None
    units: Units


def single(scene: Scene) -> Single | None:
    """Return the numbers of a scene that is one short plain chain; None for any other."""
    validate_scene(scene)
    pendula = scene.pendulum
    if len(pendula) > 1 or not SEVERAL.isdisjoint(scene.features) or pendula[0].n_links > FLOAT_LINKS_MAX:
        return None
    links, support = pendula[0].links, scene.support
    units = Units.of(max([link.mass for link in links]), max([link.length for link in links]), scene.gravity)
    kg, metre = units.mass, units.length
    moment = kg * metre**2
    rows = []
    for link in links:
        mass, length = link.mass, link.length
        centre, inertia = link.proportions(mass, length)
        rows += [(mass / kg, length / metre, centre / metre, inertia / moment)] * link.count
    if not isinstance(support, Cart):
        return Single(rows, None, units)
    if not support.mass:
        return None
    return Single(rows, CartNumbers(support.mass / kg, 0.0, support.stiffness / units.stiffness), units)
