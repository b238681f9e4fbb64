"""M, K and D of a scene as sums of squares, in any arithmetic; the matrices are their sums.

    M = Σ m h hᵀ,      K = Σ k a aᵀ,      D = Σ d c cᵀ

The row h of a centre of mass is its displacement along the rail or down, that of a moment of inertia an angle, that of
a rotor the turn of a joint; a is the angle of a link with the stiffness g σ b, or as changed by constant forces, the
turn of a joint, or the extension of a spring; c is the turn of a joint, the displacement of a dragged centre, or the
extension of a damper. A modal support has matrices: these are sums already, without rows.

Rows and sizes are made from the numbers of the scene by products and sums alone, so that floats, decimals, fractions
and symbols run the same lines.  `chain_squares` are those of a block of chains over their pivots and angles,
`carrier_squares` those of the supports; `modal.assembly.structure` puts them together.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from modal import pair
from modal.assembly.arrays import Block, masses_below
from modal.structure import Row, Structure, Where, bends, slopes, turning
from modal.types import Floats, Ints

ALONG, DOWN, INERTIA, WIRE, WEIGHT, SUPPORT = "along", "down", "inertia", "wire", "weight", "support"
JOINT, SPRING, DRAG, DRAG_DOWN = "joint", "spring", "drag", "drag down"
"""What a square is of: a centre's displacement, an angle, what gravity holds, a support, a joint, a spring, drag."""
WAYS = {ALONG: 0, DRAG: 0, DOWN: 1, DRAG_DOWN: 1, JOINT: 2}
"""Which motion of its pivot a chain's square feels, by `modal.structure.Phi`; angles from the vertical feel none."""
Number = Callable[[Any], Any]
"""Floats as numbers of an arithmetic."""
ROWS_AT_ONCE = 64
"""Cost: rows of A that are written together, so that they stay in the cache of a processor."""
NOWHERE: Ints = np.zeros(0, dtype=np.int64)


def floats(values: Any) -> Floats:
    """Return the floats themselves."""
    return np.asarray(values, dtype=np.float64)


Columns = list[tuple[Block, int]]


class Element(NamedTuple):
    """`size` times the square of a row with these entries `row` at the coordinates `at`."""

    at: tuple[int, ...]
    row: tuple[float, ...]
    size: float

    def over(self, d: int) -> Floats:
        """Return its row over the first d coordinates, (d,)."""
        row = np.zeros(d)
        for place, value in zip(self.at, self.row, strict=True):
            row[place : place + 1] = value
        return row


class SquareRows(NamedTuple):
    """`size` (P, R) times the squares of `rows` (P, R, c) over the coordinates `at` (P, c): P parts of one `kind`.

    `row_source` is the rows, or a function that writes them on request; None is 1 at each coordinate. `numbers` (P, R)
    say to what they belong: links in the order of the file, coordinates of a support, ways of springs. `total` (P, c,
    c) is their sum if it is known without a product of rows: for the centres of chains (A and b) and for a modal
    support, which has no rows. If pivots `moves` (P, k) with the coordinates `columns` (k,), rows and sums begin with
    an entry for the pivot.
    """

    kind: str
    numbers: Ints
    at: Ints
    row_source: Any
    size: Any
    total: Any = None
    columns: Ints = NOWHERE
    moves: Any = None

    @property
    def rows(self) -> Any:
        """The rows themselves, (P, R, c), or None."""
        return self.row_source() if callable(self.row_source) else self.row_source

    @property
    def elements(self) -> Iterator[tuple[int, Element]]:
        """Yield number and element of every nonzero square of floats."""
        rows = self.rows
        for p, k in np.argwhere(self.size).tolist():
            places, row = self.at[p], np.ones(1) if rows is None else rows[p, k]
            if rows is None:
                places = places[k : k + 1]
            elif self.moves is not None:
                places, row = np.append(self.columns, places), np.append(row[0] * self.moves[p], row[1:])
            nonzero = np.flatnonzero(row)
            if len(nonzero):
                at, entries = tuple(places[nonzero].tolist()), tuple(row[nonzero].tolist())
                yield int(self.numbers[p, k]), Element(at, entries, float(self.size[p, k]))

    def add_to(self, S: Any) -> None:
        """Add it to a matrix in place."""
        if self.row_source is None and self.total is None:
            S[self.at, self.at] += self.size
            return
        T, at = sum_of_squares(self.rows, self.size) if self.total is None else self.total, self.at
        if self.moves is not None:
            corner, edge = (self.columns[:, None], self.columns), (at[:, :, None], self.columns)
            S[corner] += sum_of_squares(self.moves, T[:, 0, 0])
            edge_sum = S[edge] + T[:, 1:, :1] * self.moves[:, None, :]
            S[edge], S[edge[::-1]] = edge_sum, edge_sum
            T = T[:, 1:, 1:]
        if len(at) == 1 and len(T[0]) and at[0, -1] - at[0, 0] == len(T[0]) - 1:
            span = slice(at[0, 0], at[0, -1] + 1)
            S[span, span] += T[0]
        else:
            S[at[:, :, None], at[:, None, :]] += T

    def hang(self, which: Any, first: Ints, d: int, columns: Ints, ways: Sequence[Any]) -> Iterator[SquareRows]:
        """Return those of chains `which` (P,) of a block with links numbered from `first` (P, 1), after d coordinates.

        Their pivots move by each of the `ways` (P, k) with the coordinates `columns` (k,); None if they are at rest.
        """
        moves = ways[WAYS[self.kind]] if self.kind in WAYS else None
        if moves is None and not self.at.size:
            return
        numbers, top = first + self.numbers[0], slice(int(self.kind in WAYS and moves is None), None)
        at = d + numbers if self.at.size else self.at[which]
        total = None if self.total is None else self.total[which, top, top]
        rows = None if self.row_source is None else lambda: self.rows[which, :, top]
        yield SquareRows(self.kind, numbers, at, rows, self.size[which], total, columns, moves)


class SceneSquares(NamedTuple):
    """The squares of M, K and D over `n` coordinates."""

    inertia: list[SquareRows]
    stiffness: list[SquareRows]
    damping: list[SquareRows]
    n: int
    number: Number

    @property
    def matrices(self) -> tuple[Any, Any, Any]:
        """M, K and D (n, n), symmetric to the last digit."""
        M, K, D = (matrix(part, self.n, self.number) for part in self[:3])
        return M, K, D

    @property
    def momentum(self) -> Any:
        """The momentum at unit velocity along the rail, in the directions of q, (n,); without modal supports."""
        return self._sum_along(self.inertia, ALONG)

    @property
    def windage(self) -> Any:
        """The linear drag at unit velocity along the rail, (n,)."""
        return self._sum_along(self.damping, DRAG)

    def _sum_along(self, parts: Iterable[SquareRows], kind: str) -> Any:
        total = self.number(np.zeros(self.n))
        for part in (part for part in parts if part.kind == kind):
            pull = (part.rows * part.size[:, :, None]).sum(1)
            if part.moves is not None:
                total[part.columns] += (part.moves * pull[:, :1]).sum(0)
                pull = pull[:, 1:]
            total[part.at] += pull
        return total


def sum_of_squares(rows: Any, size: Any) -> Any:
    """Return the sum of `size` (…, R) times the squares of `rows` (…, R, c), symmetric to the last digit."""
    S, order = (rows * size[..., None]).swapaxes(-1, -2) @ rows, np.arange(rows.shape[-1])
    return np.where(order[:, None] >= order, S, S.swapaxes(-1, -2)) if len(order) > 1 else S


def matrix(squares: Iterable[SquareRows], n: int, number: Number = floats) -> Any:
    """Return the sum of all squares over n coordinates, (n, n)."""
    S = number(np.zeros((n, n)))
    for part in squares:
        part.add_to(S)
    return S


Parts = tuple[list[SquareRows], list[SquareRows], list[SquareRows]]
"""Squares of M, of K and of D."""


def chain_squares(block: Block, gravity: float, number: Number | None = None) -> Parts:
    """Return the squares of M, K and D of the chains of a block over their n angles, preceded by a moving pivot."""
    number = number or floats
    n, P = block.mass.shape
    names = ("mass", "length", "centre", "across", "inertia", "rotor", "stiffness", "damping", "drag")
    m, l, c, way, inertia, rotor, spring, damper, drag = (number(getattr(block, name)) for name in names)
    links = angles = np.arange(n)[None].repeat(P, 0)
    order = np.arange(n)

    def centres(kind: str, way: Any, size: Any) -> SquareRows:
        arms, reach, mass_below = way * l, way * c, masses_below(size)
        b = pair.first_moment(size, arms, reach, mass_below)
        total = np.empty((P, n + 1, n + 1), dtype=size.dtype)
        total[:, 0, 0], total[:, 0, 1:], total[:, 1:, 0] = size[0] + mass_below[0], b.T, b.T
        moment, arm = b.T[:, :, None], arms.T[:, :, None]
        for i in range(0, n, ROWS_AT_ONCE):
            rows = slice(i, i + ROWS_AT_ONCE)
            lower = order[rows, None] > order
            lower_entries, upper_entries = moment[:, rows] * arm.swapaxes(1, 2), arm[:, rows] * moment.swapaxes(1, 2)
            total[:, 1:, 1:][:, rows] = np.where(lower, lower_entries, upper_entries)
        total[:, order + 1, order + 1] = pair.second_moment(size, arms, reach, 0, mass_below).T

        def write_rows() -> Any:
            return np.concatenate((number(np.ones((P, n, 1))), displacement_rows(arms, reach)), axis=2)

        return SquareRows(kind, links, angles, write_rows, size.T, total)

    def both_directions(rail_kind: str, down_kind: str, size: Any) -> list[SquareRows]:
        if block.sinking is not None:
            return [centres(rail_kind, way, size), centres(down_kind, number(block.sinking), size)]
        rail_square = centres(rail_kind, way, size)
        unit, total = lambda: number(np.ones((P, n, 1))), rail_square.total[:, :1, :1]
        return [rail_square, SquareRows(down_kind, links, angles[:, :0], unit, size.T, total)]

    def joints(size: Any) -> SquareRows:
        turns, total = number(np.eye(n, n + 1, k=1) - np.eye(n, n + 1)), number(np.zeros((P, n + 1, n + 1)))
        total[:, order, order] = size.T
        total[:, order + 1, order + 1] = total[:, order + 1, order + 1] + size.T
        total[:, order, order + 1] = total[:, order + 1, order] = -size.T
        return SquareRows(JOINT, links, angles, lambda: turns[None].repeat(P, 0), size.T, total)

    inertias = both_directions(ALONG, DOWN, m)
    weights = number(gravity) * inertias[0].total[:, 0, 1:] if block.rest is None else number(block.rest.stiffness).T
    stiffness = [SquareRows(WIRE, links, angles, None, weights)]
    if np.count_nonzero(block.inertia):
        inertias.append(SquareRows(INERTIA, links, angles, None, inertia.T))
    if np.count_nonzero(block.rotor):
        inertias.append(joints(rotor))
    if np.count_nonzero(block.stiffness):
        stiffness.append(joints(spring))
    damping = [joints(damper)] if np.count_nonzero(block.damping) else []
    return (
        inertias,
        stiffness,
        damping + (both_directions(DRAG, DRAG_DOWN, drag) if np.count_nonzero(block.drag) else []),
    )


def displacement_rows(arms: Any, reach: Any) -> Any:
    """Return the displacement (P, n, n) of a point of every link by the angles of its chain.

    It is `arms` (n, P) for each link above, and `reach` (n, P) for the link itself.
    """
    order = np.arange(len(arms))
    rows = np.where(order[:, None] > order, arms.T[:, None, :], 0 * arms.T[:, None, :])
    rows[:, order, order] = reach.T
    return rows


def row_squares(kind: str, whose: int, row: Row, size: Any, number: Number = floats) -> list[SquareRows]:
    """Return the square of a row of floats; none for a row without entries or of size 0."""
    at = [column for column, value in sorted(row.items()) if value]
    if not at or size == 0:
        return []
    entries = number([[[row[column] for column in at]]])
    return [SquareRows(kind, np.array([[whose]]), np.array([at]), entries, np.array([[size]]))]


def carrier_squares(structure: Structure, gravity: float, number: Number = floats) -> Parts:
    """Return the squares of M, K and D of the supports alone, without pendula and springs between points."""
    inertia, stiffness, damping = list[SquareRows](), list[SquareRows](), list[SquareRows]()
    for carrier, (body, start) in enumerate(zip(structure.carriers, structure.offsets, strict=False)):
        if body.M is not None:
            at = np.arange(start, start + body.size)[None]
            for part, S in zip((inertia, stiffness, damping), (body.M, body.K, body.D), strict=True):
                part.append(SquareRows(SUPPORT, at, at, None, np.zeros(at.shape), number(S)[None]))
            continue
        mass = number(float(body.mass))
        if body.size:
            rail_row, down_row = slopes(structure, carrier, body.centre)
            inertia += row_squares(ALONG, carrier, rail_row, mass, number) + row_squares(
                DOWN, carrier, down_row, mass, number
            )
            turn = number(float(body.inertia))
            inertia += row_squares(INERTIA, carrier, turning(structure, carrier), turn, number)
        for k, jet in enumerate((body.path.forces([0.0] * body.size, body.values) if body.path else None) or (), start):
            stiffness += row_squares(SUPPORT, k, {k: 1.0}, number(float(jet.second)), number)
        for k in range(start, start + body.size):
            spring, damper = number(float(body.stiffness[k - start])), number(float(body.damping[k - start]))
            stiffness += row_squares(SUPPORT, k, {k: 1.0}, spring, number)
            damping += row_squares(SUPPORT, k, {k: 1.0}, damper, number)
        stiffness += bend_squares(structure, carrier, body.centre, number(gravity) * mass, number)
    return inertia, stiffness, damping


def bend_squares(
    structure: Structure, carrier: int, where: Where, weight: Any, number: Number = floats
) -> list[SquareRows]:
    """Return the stiffness due to a weight on a point of a support, as that point rises on its curved path."""
    first = structure.offsets[carrier]
    weights = [(first + k, weight * number(bend)) for k, bend in bends(structure.carriers[carrier], where)]
    return [square for at, size in weights for square in row_squares(WEIGHT, at, {at: 1.0}, size, number)]
