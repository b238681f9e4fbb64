"""A scene as arrays: pendula with bitwise equal links are stored once, as one column with a count.

Pendula are sorted into blocks by their number of links n; a block of P different chains has (n, P) arrays.
The natural units of a rig are powers of two near its largest mass and length, with g = 1, so that rescaling
a scene (grams, tonnes) changes nothing but the last rounding.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import groupby
from math import frexp, nan, sqrt
from typing import Any, NamedTuple

import numpy as np

from modal import pair
from modal.assembly.equilibrium import Rest, equilibrium_of
from modal.report import Displayed
from modal.scene import AnyLink, Cart, Pendulum, Scene, validate_scene
from modal.structure import CarrierEnd, CarrierNumbers, Structure, is_damped, phi, scale_structure, structure_of, tied
from modal.types import Booleans, Floats, Ints

ARRAYS = ("mass", "length", "centre", "inertia", "rotor", "damping", "stiffness", "drag", "sigma")
ONE = np.zeros(1, dtype=np.int64)


@dataclass(frozen=True, eq=False)
class Block:
    """P different chains of n links: arrays of shape (n, P), top link first; `count` (P,) copies of each.

    `sigma` is 1 where a link points down at equilibrium and −1 where it points up. Under constant forces `rest` is the
    displaced equilibrium, arrays of the same shape; None if all links are vertical.
    """

    mass: Floats
    length: Floats
    centre: Floats
    inertia: Floats
    rotor: Floats
    damping: Floats
    stiffness: Floats
    drag: Floats
    sigma: Floats
    count: Ints
    rest: Rest | None = None

    @property
    def n(self) -> int:
        """Number of links in each chain."""
        return int(self.mass.shape[0])

    @property
    def size(self) -> int:
        """Number of different chains."""
        return int(self.mass.shape[1])

    @cached_property
    def is_plain(self) -> Booleans:
        """Which chains (P,) hang straight, without rotors, springs and dampers at joints, drag and inverted links."""
        if self.rest is not None:
            return np.zeros(self.size, dtype=np.bool_)
        broken = (self.rotor != 0) | (self.damping != 0) | (self.stiffness != 0) | (self.drag > 0) | (self.sigma < 0)
        return np.asarray(~broken.any(0), dtype=np.bool_)

    @cached_property
    def is_damped(self) -> bool:
        """Whether there are dampers, drag or feedback loops."""
        return bool(self.damping.any() or self.drag.any())

    @cached_property
    def mass_below(self) -> Floats:
        """The mass below every link, shape (n, P)."""
        return masses_below(self.mass)

    @cached_property
    def b(self) -> Floats:
        """First moments b, shape (n, P)."""
        return np.asarray(pair.first_moment(self.mass, self.length, self.centre, self.mass_below))

    @cached_property
    def diagonal(self) -> Floats:
        """The diagonal of A, shape (n, P)."""
        return np.asarray(pair.second_moment(self.mass, self.length, self.centre, self.inertia, self.mass_below))

    @cached_property
    def constants(self) -> pair.Constants:
        """The recursion's constants at g = 1, each an array of shape (n, P)."""
        return pair.link_constants(self.mass, self.length, self.centre, self.inertia, self.mass_below)

    @cached_property
    def across(self) -> Floats:
        """Cos θ (n, P): displacement of a link's end along the rail, per length and angle."""
        return self.sigma if self.rest is None else np.cos(self.rest.angle)

    @cached_property
    def sinking(self) -> Floats | None:
        """−sin θ (n, P): its downward displacement; None if all links are vertical."""
        return None if self.rest is None else -np.sin(self.rest.angle)

    def take(self, columns: Ints) -> Block:
        """Return the chains in these columns, once each."""
        arrays = {name: getattr(self, name)[:, columns] for name in ARRAYS}
        rest = self.rest and Rest(*(part[:, columns] for part in self.rest))
        return Block(**arrays, count=np.ones(len(columns), dtype=np.int64), rest=rest)

    def heavier(self, factor: Floats | Ints) -> Block:
        """Return chain p with factor[p] times the mass, dampers, springs and drag: equal copies that move as one."""
        if (factor == 1).all():
            return self
        extensive = ("mass", "inertia", "rotor", "damping", "stiffness", "drag")
        heavier = replace(self, **{name: getattr(self, name) * factor for name in extensive})
        return replace(heavier, rest=self.rest.scale(factor)) if self.rest else heavier


@dataclass(frozen=True, eq=False)
class Units:
    """The size of each natural unit in kg, m and m/s²."""

    mass: float
    length: float
    gravity: float

    @classmethod
    def of(cls, heaviest: float, longest: float, gravity: float) -> Units:
        """Return the units for a scene with this largest mass and length."""
        return cls(2.0 ** frexp(heaviest)[1], 2.0 ** frexp(longest)[1], gravity)

    @property
    def stiffness(self) -> float:
        """The natural unit of a cart's spring (N/m)."""
        return self.mass * self.gravity / self.length

    @property
    def rate(self) -> float:
        """The natural unit of angular frequency, sqrt(g/L), in rad/s."""
        return sqrt(self.gravity / self.length)


class CartNumbers(NamedTuple):
    """A cart's mass (kg), damper (N s/m) and spring (N/m) to the ground; arrays (S,) for several carts."""

    mass: Any
    damping: Any
    stiffness: Any


@dataclass(frozen=True, eq=False, repr=False)
class Rig(Displayed):
    """Blocks of different chains ("kinds" of pendula), the cart (None: fixed support), and the pendula's positions.

    `members` follows the file: (block, column, copies) for every pendulum entry, under constant forces for every copy.
    `damping_ratio` applies to all modes, or to each by its number (`modal.assembly.modal_damping`).  `cart_rest` (m) is
    the displacement of the cart at equilibrium. Pendula on a `structure` (`modal.structure`) are of one kind if their
    pivots move alike and no spring is attached to them; there is no cart then. With feedback (`has_loops`), which the
    arrays do not contain, every copy is a kind of its own.
    """

    what = "Rig of pendula"
    shows = "blocks: different pendula; members: pendula; cart: cart; structure: structure; gravity: gravity, m/s²"

    gravity: float
    blocks: tuple[Block, ...]
    members: tuple[tuple[int, int, int], ...]
    cart: CartNumbers | None
    spatial: bool
    damping_ratio: float | tuple[float, ...] = 0.0
    cart_rest: float = 0.0
    structure: Structure | None = None
    has_loops: bool = False

    @cached_property
    def total_mass(self) -> float:
        """Total mass of all links and supports (kg); NaN with a modal support, whose mass is unknown."""
        hanging = sum(float(np.sum(block.mass.sum(0) * block.count)) for block in self.blocks)
        return hanging + sum(nan if carrier.M is not None else float(carrier.mass) for carrier in self.carriers)

    @cached_property
    def carriers(self) -> tuple[CarrierNumbers, ...]:
        """The supports of the pendula: a fixed support has no coordinate, a cart one."""
        if self.structure:
            return self.structure.carriers
        if not self.cart:
            return (CarrierNumbers("fixed", "fixed", (0.0, 0.0)),)
        mass, damping, stiffness = self.cart
        return (
            CarrierNumbers(
                "cart", "cart", (0.0, 0.0), mass, stiffness=(stiffness,), damping=(damping,), path=Cart.path
            ),
        )

    @cached_property
    def support(self) -> Structure:
        """The supports with the pivot of every pendulum."""
        pivots = (CarrierEnd(0, (0.0, 0.0)),) * sum(copies for *_, copies in self.members)
        return self.structure or Structure(self.carriers, pivots, ())

    @property
    def on_structure(self) -> Rig:
        """Return the same rig with its support as a structure."""
        return self if self.structure else replace(self, cart=None, structure=self.support)

    @property
    def leading(self) -> int:
        """Number of coordinates before the angles of the links: none, the cart's, or those of the structure."""
        return sum(carrier.size for carrier in self.carriers)

    @property
    def is_damped(self) -> bool:
        """Whether there are dampers or drag."""
        support_damps = is_damped(self.structure or Structure(self.carriers, (), ()))
        return self.has_loops or support_damps or any(block.is_damped for block in self.blocks)

    @property
    def rest_angles(self) -> Floats:
        """Equilibrium angle (L,) of every link in the order of the file: 0 hanging, π inverted, or displaced."""
        angles = [block.rest.angle if block.rest else np.where(block.sigma > 0, 0.0, np.pi) for block in self.blocks]
        return np.concatenate([np.tile(angles[block][:, column], copies) for block, column, copies in self.members])

    @property
    def leans(self) -> bool:
        """Whether constant forces displace the equilibrium of the links."""
        return any(block.rest is not None for block in self.blocks)

    @cached_property
    def n_kinds(self) -> int:
        """Number of different chains."""
        return sum(block.size for block in self.blocks)

    @cached_property
    def names(self) -> dict[tuple[int, int], str]:
        """Every kind (block, column), block by block, named by its first pendulum, copies numbered from 1."""
        first_and_copies: dict[tuple[int, int], tuple[int, int]] = {}
        number = 0
        for block, column, count in self.members:
            first, copies = first_and_copies.get((block, column), (number + 1, 0))
            first_and_copies[block, column] = first, copies + count
            number += count
        return {
            kind: f"pendulum {first}" if copies == 1 else f"the {copies} equal to pendulum {first}"
            for kind, (first, copies) in sorted(first_and_copies.items())
        }

    def natural(self) -> tuple[Rig, Units]:
        """The same rig in its natural units, and these units in SI."""
        heaviest = max(float(block.mass.max()) for block in self.blocks)
        longest = max(float(block.length.max()) for block in self.blocks)
        units = Units.of(heaviest, longest, self.gravity)
        moment = units.mass * units.length**2
        blocks = tuple(
            replace(
                block,
                mass=block.mass / units.mass,
                length=block.length / units.length,
                centre=block.centre / units.length,
                inertia=block.inertia / moment,
                rotor=block.rotor / moment,
                damping=block.damping / (moment * units.rate),
                stiffness=block.stiffness / (units.mass * units.gravity * units.length),
                drag=block.drag / (units.mass * units.rate),
                rest=block.rest and block.rest.scale(1 / (units.mass * units.gravity * units.length)),
            )
            for block in self.blocks
        )
        cart = self.cart and CartNumbers(
            mass=self.cart.mass / units.mass,
            damping=self.cart.damping / (units.mass * units.rate),
            stiffness=self.cart.stiffness / units.stiffness,
        )
        structure = self.structure and scale_structure(self.structure, units.mass, units.length, units.gravity)
        return replace(self, gravity=1.0, blocks=blocks, cart=cart, structure=structure), units


def masses_below(mass: Floats) -> Floats:
    """Σ_{k>i} m_k for every link i, as in `modal.pair`, for arrays with links first."""
    sums = 0 * mass
    np.add.accumulate(mass[:0:-1], axis=0, out=sums[-2::-1])
    return sums


def rig_of(scene: Scene, distinctions: Sequence[tuple[float, ...]] | None = None) -> Rig:
    """Return the arrays of a scene in SI units; raise SceneError if it is invalid or has no equilibrium.

    Equal pendula are of one kind, unless the numbers `distinctions` of each entry of the file, as many as it has links
    or a multiple of that, differ.
    """
    validate_scene(scene)
    equilibrium = equilibrium_of(scene)
    marks_of_entries = distinctions or [()] * len(scene.pendulum)
    entries = [
        _Entry(pendulum, pendulum.count, distinctions=marks)
        for pendulum, marks in zip(scene.pendulum, marks_of_entries, strict=True)
    ]
    if equilibrium:
        entries = list(_each_at(scene, equilibrium.rest))
    structure = structure_of(scene) if scene.is_structured else None
    if structure:
        entries = list(_each_on(scene, structure))
    if scene.feedback:
        copies = [entry._replace(copies=1) for entry in entries for _ in range(entry.copies)]
        entries = [entry._replace(distinctions=(*entry.distinctions, float(k))) for k, entry in enumerate(copies)]
    deep = sorted(range(len(entries)), key=lambda index: entries[index].pendulum.n_links)
    members: list[tuple[int, int, int]] = [(0, 0, 0)] * len(deep)
    blocks: list[Block] = []
    for _, group in groupby(deep, key=lambda index: entries[index].pendulum.n_links):
        indices = list(group)
        block, columns = _block([entries[index] for index in indices])
        for index, column in zip(indices, columns, strict=True):
            members[index] = (len(blocks), int(column), entries[index].copies)
        blocks.append(block)
    cart = CartNumbers(scene.cart.mass, scene.cart.damping, scene.cart.stiffness) if scene.cart else None
    cart_rest = equilibrium.cart if equilibrium else 0.0
    spatial = scene.space == "space"
    held = scene.damping_ratio, cart_rest, structure, bool(scene.feedback)
    return Rig(scene.gravity, tuple(blocks), tuple(members), cart, spatial, *held)


class _Entry(NamedTuple):
    """Equal pendula, with their equilibrium (links, 3) under constant forces, or other distinctions."""

    pendulum: Pendulum
    copies: int
    rest: Floats | None = None
    distinctions: tuple[float, ...] = ()


def _each_on(scene: Scene, structure: Structure) -> Iterator[_Entry]:
    """All copies of each pendulum, or each by itself where springs join them to something.

    Equal ones are distinguished by how their pivots move along the rail, and turn where the first joint moves with it.
    """
    tied_pendula = tied(structure, [pendulum.n_links for pendulum in scene.pendulum for _ in range(pendulum.count)])
    rows, first = phi(structure), 0
    for pendulum in scene.pendulum:
        top, last = pendulum.links[0], first + pendulum.count
        turning_row = rows.turning[first] * any((*top.linear_coefficients, top.rotor_inertia))
        distinctions = *rows.rail[first].tolist(), *turning_row.tolist()
        single = range(first, last) if not tied_pendula.isdisjoint(range(first, last)) else ()
        for free, group in groupby(single, key=lambda k: k if k in tied_pendula else -1):
            yield _Entry(pendulum, len(list(group)), distinctions=(*distinctions, 1.0 + free))
        if not single:
            yield _Entry(pendulum, pendulum.count, distinctions=(*distinctions, 0.0))
        first = last


def _each_at(scene: Scene, rest: Rest) -> Iterator[_Entry]:
    """Every copy of every pendulum by itself."""
    numbers, first = np.column_stack(rest), 0
    for pendulum in scene.pendulum:
        for _ in range(pendulum.count):
            yield _Entry(pendulum, 1, numbers[first : first + pendulum.n_links])
            first += pendulum.n_links


def _block(entries: list[_Entry]) -> tuple[Block, Iterable[int]]:
    table = np.array([_parameters(entry.pendulum) for entry in entries]) + 0.0
    width, rests = len(ARRAYS), [entry.rest for entry in entries if entry.rest is not None]
    if rests:
        numbers = table.reshape(len(entries), -1, width)
        table, width = np.concatenate((numbers, np.array(rests) + 0.0), axis=2).reshape(len(entries), -1), width + 3
    table = np.column_stack((table, [entry.distinctions for entry in entries])) if entries[0].distinctions else table
    first, columns = different(table)
    count = np.bincount(columns, weights=[entry.copies for entry in entries]).astype(np.int64)
    kinds = table[first, : table.shape[1] - len(entries[0].distinctions)]
    arrays = np.ascontiguousarray(kinds.reshape(len(kinds), -1, width).transpose(2, 1, 0))
    rest = Rest(*arrays[len(ARRAYS) :]) if rests else None
    return Block(**dict(zip(ARRAYS, arrays, strict=False)), count=count, rest=rest), columns


def different(table: Floats) -> tuple[Ints, Ints]:
    """Return the first row of each kind, in order, and the kind of every row."""
    if len(table) == 1:
        return ONE, ONE
    kinds: dict[bytes, int] = {}
    columns = [kinds.setdefault(row.tobytes(), len(kinds)) for row in table]
    first = dict(zip(reversed(columns), reversed(range(len(columns))), strict=True))
    return np.array([first[kind] for kind in range(len(kinds))]), np.array(columns)


def _parameters(pendulum: Pendulum) -> list[float]:
    numbers = [value for link in pendulum.links for value in _numbers(link) * link.count]
    if pendulum.equilibrium:
        numbers[len(ARRAYS) - 1 :: len(ARRAYS)] = [1.0 if way == "down" else -1.0 for way in pendulum.equilibrium]
    return numbers


def _numbers(link: AnyLink) -> list[float]:
    """The ARRAYS of a link: its laws, linearized about equilibrium, add to the spring and the damper of its joint."""
    stiffness, damping = link.linear_coefficients
    numbers = link.mass, link.length, link.centre, link.inertia, link.reflected_inertia
    return [*numbers, damping, stiffness, link.linear_drag, 1.0]
