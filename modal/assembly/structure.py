"""The linear model of a structure: motion of its pivots, and inertia, springs and dampers as elements that add up.

About the drawn equilibrium, with the coordinates η of the supports and the angles θ of all links, q = (η, θ),

    M = Σ m b bᵀ,      K = Σ k a aᵀ,      D = Σ d c cᵀ.

A pivot moves along the rail by Φ η, and down by Ψ η; a first joint with a spring or damper on a support that turns acts
on θ − φ, φ = Ω η. Gravity restores every link by g b, and a coordinate η_i by −g Σ m ∂²z/∂η_i² of all pivots and own
masses: of a swing (M_s + Σ m) g/L, of a board g (M d + Σ m h), which is negative where masses are above the axis.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import accumulate
from math import fsum
from typing import Any, NamedTuple

import numpy as np

from modal.assembly.arrays import Block, CartNumbers, Rig
from modal.assembly.squares import (
    DOWN,
    DRAG_DOWN,
    SPRING,
    Columns,
    Element,
    Number,
    Parts,
    SceneSquares,
    bend_squares,
    carrier_squares,
    chain_squares,
    floats,
    row_squares,
)
from modal.structure import (
    CarrierEnd,
    End,
    GroundEnd,
    LinkEnd,
    Phi,
    Row,
    SpringNumbers,
    Structure,
    Where,
    bends,
    drawn_together,
    phi,
    slopes,
    tied,
    turning,
)
from modal.types import NOISE_OF_TERMS, Floats, Ints


class Elements(NamedTuple):
    """The elements of M, K and D other than those of hanging chains along the rail.

    `terms` (d,) are the sums of the absolute terms of which each coordinate's own stiffness is the sum.
    """

    inertia: tuple[Element, ...]
    stiffness: tuple[Element, ...]
    damping: tuple[Element, ...]
    terms: Floats


class SpringRow(NamedTuple):
    """One way in which a spring acts: its extension is `row` q, its force N or N m per unit of stiffness and damping.

    `rail_part` is the part along the rail of the direction from its first end to its second; 0 for torsion.
    `on_pendula` are the pendula, from 0, that it ends on, with the sign of its pull on each. `label` numbers springs
    from 1, in the order of the file and counting copies, and distinguishes two directions of one spring. `entry` is its
    entry in the file.
    """

    label: str
    words: str
    row: Row
    stiffness: float
    damping: float
    rail_part: float
    torsion: bool
    on_pendula: tuple[tuple[int, float], ...]
    entry: int


@dataclass(frozen=True, eq=False)
class Hanging:
    """The pendula of a structure: for each pendulum, counting copies, its kind and its first link."""

    rig: Rig

    @property
    def structure(self) -> Structure:
        """The structure."""
        return self.rig.support

    @cached_property
    def phi(self) -> Phi:
        """Motion of all pivots at the drawn equilibrium."""
        return phi(self.structure)

    @property
    def bends(self) -> Floats:
        """−∂²z/∂η² (P, d) of all pivots."""
        curvatures = np.zeros(self.phi.down.shape)
        for row, (carrier, where) in zip(curvatures, self.structure.pivots, strict=True):
            for k, bend in bends(self.structure.carriers[carrier], where):
                row[self.structure.offsets[carrier] + k] = bend
        return curvatures

    @cached_property
    def kinds(self) -> Ints:
        """The (block, column) of every pendulum, (P, 2)."""
        members = np.array(self.rig.members)
        return np.repeat(members[:, :2], members[:, 2], axis=0)

    @cached_property
    def first(self) -> Ints:
        """The first link of every pendulum, in the order of the file, and the number of links, (P + 1,)."""
        sizes = [block.n for block in self.rig.blocks]
        return np.array([0, *accumulate(sizes[block] for block in self.kinds[:, 0].tolist())])

    @cached_property
    def starts(self) -> Ints:
        """The first pendulum of every entry of `Rig.members`."""
        copies = np.array([copies for *_, copies in self.rig.members])
        return np.asarray(np.cumsum(copies) - copies)

    def owner(self, link: int) -> int:
        """The pendulum of a link."""
        return int(np.searchsorted(self.first, link, side="right")) - 1

    @cached_property
    def tied(self) -> frozenset[int]:
        """The pendula to which springs are attached."""
        return tied(self.structure, np.diff(self.first).tolist())

    # ------------------------------------------------------------------------------------------------- elements

    @cached_property
    def elements(self) -> Elements:
        """All elements except those of the chains along the rail; modal supports have their own matrices."""
        structure = self.structure
        inertia, stiffness, damping = self._supporting(floats)
        for carrier, where in self._pendula_at_points:
            down = slopes(structure, carrier, where)[1]
            mass, drag = (self._on_point((carrier, where), name, floats) for name in ("mass", "drag"))
            inertia += row_squares(DOWN, carrier, down, mass)
            damping += row_squares(DRAG_DOWN, carrier, down, drag)
        rows = ([square for square in part if square.row_source is not None] for part in (inertia, stiffness, damping))
        masses, stiffnesses, losses = (
            [(square.kind, element) for square in part for _, element in square.elements] for part in rows
        )
        parts: list[list[float]] = [[] for _ in range(structure.size)]
        for _, element in (group for group in stiffnesses if group[0] != SPRING):
            parts[element.at[0]].append(element.size)
        sums, terms = map(fsum, parts), np.array([fsum(map(abs, group)) for group in parts])
        own_held = [Element((k,), (1.0,), value) for k, value in enumerate(sums) if value]
        springs = [element for kind, element in stiffnesses if kind == SPRING]
        return Elements(
            tuple(group for _, group in masses), (*own_held, *springs), tuple(group for _, group in losses), terms
        )

    def _supporting(self, number: Number) -> Parts:
        """The squares of supports, with what hangs from them as they sink, and of springs between points."""
        structure, gravity = self.structure, self.rig.gravity
        parts = carrier_squares(structure, gravity, number)
        for carrier, where in self._pendula_at_points if any(body.bends for body in structure.carriers) else ():
            weight = number(gravity) * self._on_point((carrier, where), "mass", number)
            parts[1].extend(bend_squares(structure, carrier, where, weight, number))
        for k, row in enumerate(self.spring_rows):
            parts[1].extend(row_squares(SPRING, k, row.row, number(row.stiffness), number))
            parts[2].extend(row_squares(SPRING, k, row.row, number(row.damping), number))
        return parts

    def _on_point(self, point: tuple[int, Where], name: str, number: Number) -> Any:
        """The mass or drag of all that hangs from a point, of floats to the last digit."""
        numbers = [
            number(getattr(block, name)[:, column]).sum() * copies
            for block, column, copies in self._pendula_at_points[point]
        ]
        return fsum(numbers) if number is floats else sum(numbers)

    def squares(self, arithmetic: Number | None = None) -> SceneSquares:
        """Return the squares of the scene without modal dampers over η and all link angles; floats by default."""
        number = arithmetic or floats
        structure, d, gravity = self.structure, self.structure.size, self.rig.gravity
        parts = self._supporting(number)
        on = np.array([pivot.carrier for pivot in structure.pivots])
        for place, block in enumerate(self.rig.blocks):
            local = chain_squares(block, gravity, number)
            mine = np.flatnonzero(self.kinds[:, 0] == place)
            for carrier in sorted(set(on[mine].tolist())):
                pendula = mine[on[mine] == carrier]
                which: Any = self.kinds[pendula, 1]
                which = slice(None) if which.tolist() == list(range(block.size)) else which
                start, stop = structure.offsets[carrier : carrier + 2]
                ways = (way[pendula, start:stop] for way in self.phi)
                moves = [number(way) if np.count_nonzero(way) else None for way in ways]
                columns, first = np.arange(start, stop), self.first[pendula, None]
                for part, squares in zip(parts, local, strict=True):
                    for square in squares:
                        part.extend(square.hang(which, first, d, columns, moves))
        return SceneSquares(*parts, d + int(self.first[-1]), number)

    @cached_property
    def supporting(self) -> tuple[Floats, Floats, Floats]:
        """M, K and D (d, d) of the supports with all links locked, including the weight of the links."""
        d = self.structure.size
        matrices = modal_supports(self.structure)
        for S, elements in zip(matrices, self.elements[:3], strict=True):
            for element in elements:
                S[:] += element.size * np.multiply.outer(element.over(d), element.over(d))
        return matrices

    @property
    def inertia(self) -> Floats:
        """M_s + Σ m (ΦᵀΦ + ΨᵀΨ), (d, d): the structure with all pendula locked."""
        M = self.supporting[0].copy()
        for (block, column, copies), pendulum in zip(self.rig.members, self.starts.tolist(), strict=True):
            row = self.phi.rail[pendulum]
            M += copies * self.rig.blocks[block].mass[:, column].sum() * np.multiply.outer(row, row)
            turn = self.phi.turning[pendulum]
            M += copies * self.rig.blocks[block].rotor[0, column] * np.multiply.outer(turn, turn)
        return M

    @cached_property
    def free(self) -> Floats:
        """The motions (d, f) that no spring restrains; no link swings in them."""
        d, blocks = self.structure.size, self.rig.blocks
        rows = [element.over(d) for element in self.elements.stiffness]
        for (block, column, _), first in zip(self.rig.members, self.starts.tolist(), strict=True):
            rows.append(self.phi.turning[first] * (blocks[block].stiffness[0, column] != 0))
        return null_space(np.array([*rows, *modal_supports(self.structure)[1]]))

    @cached_property
    def _pendula_at_points(self) -> dict[tuple[int, Where], list[tuple[Block, int, int]]]:
        """The block, the column and the number of copies of all pendula that hang from one point."""
        pendula: dict[tuple[int, Where], list[tuple[Block, int, int]]] = {}
        for (block, column, copies), pendulum in zip(self.rig.members, self.starts.tolist(), strict=True):
            pivot = self.structure.pivots[pendulum]
            pendula.setdefault((pivot.carrier, pivot.where), []).append((self.rig.blocks[block], column, copies))
        return pendula

    @cached_property
    def spring_rows(self) -> tuple[SpringRow, ...]:
        """The rows of all springs between points and angles, one or two for each."""
        return tuple(self._spring_rows())

    def _spring_rows(self) -> Iterator[SpringRow]:
        for number, spring in enumerate(self.structure.springs, start=1):
            ways = list(self._ways(spring))
            moving = [way for way in ways if any(way[0].values())] or ways[:1]
            pulls = tuple(
                (self.owner(end.link), sign)
                for end, sign in zip(spring.ends, (1.0, -1.0), strict=True)
                if isinstance(end, LinkEnd) and not spring.torsion
            )
            words = " and ".join(map(self._words, spring.ends))
            for row, rail_part, way in moving:
                label = f"{number}" + way * (len(moving) > 1)
                numbers = float(spring.stiffness), float(spring.damping)
                yield SpringRow(label, words, row, *numbers, rail_part, spring.torsion, pulls, spring.entry)

    def _ways(self, spring: SpringNumbers) -> Iterator[tuple[Row, float, str]]:
        """The extension of a spring in each of the ways in which it acts, the part of that along the rail, its name."""
        if spring.torsion:
            yield _difference(*map(self._angle, spring.ends[::-1])), 0.0, ""
            return
        places = [self._place(end) for end in spring.ends]
        first, second = (place if place is not None else places[1 - k] for k, place in enumerate(places))
        assert first is not None, "one end at least has a place"
        assert second is not None
        ways = [_difference(*rows) for rows in zip(*map(self._point, spring.ends[::-1]), strict=True)]
        if np.all(drawn_together(first, second)):
            yield ways[0], 1.0, "_along"
            yield ways[1], 0.0, "_down"
            return
        distance = second[0] - first[0], second[1] - first[1]
        reach = np.hypot(*distance)
        line: Row = {}
        for row, part in zip(ways, distance, strict=True):
            for column, value in row.items():
                line[column] = line.get(column, 0.0) + value * float(part / reach)
        yield line, float(distance[0] / reach), ""

    def _words(self, end: End) -> str:
        """The body or point on which a spring ends."""
        if isinstance(end, GroundEnd):
            return "the ground"
        if isinstance(end, CarrierEnd):
            return self.structure.carriers[end.carrier].name
        pendulum = self.owner(end.link)
        return f"link {pendulum + 1}_{end.link - int(self.first[pendulum]) + 1}"

    def _angle(self, end: End) -> Row:
        if isinstance(end, LinkEnd):
            return {self.structure.size + end.link: 1.0}
        return turning(self.structure, end.carrier) if isinstance(end, CarrierEnd) else {}

    def _point(self, end: End) -> tuple[Row, Row]:
        """The displacement of an end along the rail and down."""
        if isinstance(end, GroundEnd):
            return {}, {}
        if isinstance(end, CarrierEnd):
            return slopes(self.structure, end.carrier, end.where)
        pendulum = self.owner(end.link)
        rail_row, down_row = slopes(self.structure, *self.structure.pivots[pendulum])
        return rail_row | dict(self._arms(pendulum, end)), down_row

    def _arms(self, pendulum: int, end: LinkEnd) -> Iterator[tuple[int, float]]:
        """How far a point of a link moves by each angle of its chain."""
        number, column = self.kinds[pendulum]
        block, first = self.rig.blocks[number], int(self.first[pendulum])
        for i in range(end.link - first + 1):
            arm = end.below if i == end.link - first else block.length[i, column]
            arm = block.centre[i, column] if arm is None else arm
            yield self.structure.size + first + i, float(block.sigma[i, column] * arm)

    def _place(self, end: End) -> tuple[float, float] | None:
        """Where an end is as drawn, links hanging straight; None for the ground at the other end."""
        if isinstance(end, GroundEnd):
            return end.place
        carrier, where = (
            self.structure.pivots[self.owner(end.link)] if isinstance(end, LinkEnd) else (end.carrier, end.where)
        )
        body = self.structure.carriers[carrier]
        zeros = (0.0,) * body.size
        x, z = body.moving(where, zeros, zeros).place
        depth = sum(arm for _, arm in self._arms(self.owner(end.link), end)) if isinstance(end, LinkEnd) else 0.0
        return float(x), float(z) + depth


def _difference(first: Row, second: Row) -> Row:
    row = dict(first)
    for column, value in second.items():
        row[column] = row.get(column, 0.0) - value
    return row


def modal_supports(structure: Structure) -> tuple[Floats, Floats, Floats]:
    """Return M, K and D (d, d) over η of modal supports."""
    M, K, D = np.zeros((3, structure.size, structure.size))
    for carrier, first in zip(structure.carriers, structure.offsets, strict=False):
        if matrices := carrier.matrices:
            at = slice(first, first + carrier.size)
            M[at, at], K[at, at], D[at, at] = matrices
    return M, K, D


def scene_squares(rig: Rig, arithmetic: Number | None = None) -> SceneSquares:
    """Return the squares of M, K and D of a whole scene, without modal dampers, over the coordinates of `Matrices`."""
    return Hanging(rig).squares(arithmetic)


def assemble_pendula(columns: Columns, cart: CartNumbers | None, gravity: float) -> tuple[Floats, Floats]:
    """Return (M, K) of a cart or (None) a fixed support with one pendulum for each (block, column)."""
    blocks, members = tuple(block for block, _ in columns), enumerate(column for _, column in columns)
    rig = Rig(gravity, blocks, tuple((k, column, 1) for k, column in members), cart, spatial=False)
    return scene_squares(rig).matrices[:2]


def null_space(rows: Floats) -> Floats:
    """Return the null space (d, f) of all rows (E, d), by elimination: entries that cancel to rounding are 0."""
    A, terms, pivots = rows.copy(), np.abs(rows), dict[int, int]()
    for i in range(len(A)):
        if not A[i].any():
            continue
        c = int(np.abs(A[i]).argmax())
        pivots[c] = i
        A[i], terms[i] = A[i] / A[i, c], terms[i] / abs(A[i, c])
        factor = A[:, c].copy()
        factor[i] = 0.0
        terms = terms + np.abs(factor)[:, None] * terms[i]
        A = A - factor[:, None] * A[i]
        A[np.abs(A) <= NOISE_OF_TERMS * terms] = 0.0  # residue of terms that cancel
    loose = [c for c in range(rows.shape[1]) if c not in pivots]
    basis = np.zeros((rows.shape[1], len(loose)))
    basis[loose, range(len(loose))] = 1.0
    for c, i in pivots.items():
        basis[c] = -A[i, loose]
    return basis
