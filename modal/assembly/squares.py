"""M, K and D of a scene as sums of squares, in any arithmetic: whoever wants matrices asks for their sum.

    M = Σ m h hᵀ,      K = Σ k a aᵀ,      D = Σ d c cᵀ

The row h of a centre of mass is its displacement along the rail or down, that of a moment of inertia an angle; a is the
angle of a link, which gravity holds by g σ b or what constant forces make of it, the turn of a joint, or the extension
of a spring; c is the turn of a joint, the displacement of a dragged centre, or the extension of a damper.  A modal
support brings matrices: those are sums already, without rows.

Rows and sizes are made from the numbers of the scene by products and sums alone, so that floats, decimals, fractions
and symbols run the same lines.  `chain_squares` are those of one pendulum over its pivot and its angles,
`carrier_squares` those of what pendula hang from; `modal.assembly.structure` puts them together.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from modal import pair
from modal.assembly.arrays import Block
from modal.structure import Row, Structure, Where, bends, slopes, turning
from modal.types import Floats

ALONG, DOWN, INERTIA, WIRE, WEIGHT, SUPPORT = "along", "down", "inertia", "wire", "weight", "support"
JOINT, SPRING, DRAG, DRAG_DOWN = "joint", "spring", "drag", "drag down"
"""What a square is of: a centre's displacement, an angle, what gravity holds, a support, a joint, a spring, drag."""
ALONG_PIVOT, DOWN_PIVOT, TURN_PIVOT, ANGLES = range(4)
"""The coordinates of a chain: its pivot along the rail and down, the turn of its carrier; its angles from ANGLES on."""
Number = Callable[[Any], Any]
"""Floats as numbers of an arithmetic."""


def floats(values: Any) -> Floats:
    """The floats themselves."""
    return np.asarray(values, dtype=np.float64)


class SquareRows(NamedTuple):
    """`size` (R,) times the squares of `rows` (R, c) over the coordinates `at` (c,), those of one `kind` of one part.

    `written` are the rows, or what writes them once they are asked for; None is 1 at each coordinate.  `numbers` (R,)
    tell whose they are: links in the order of the file, coordinates of a support, ways of springs.  `total` (c, c) is
    their sum where it is known without a product of rows, up to the diagonal: of the centres of a chain, which are A
    and b, and of a modal support, which has no rows.
    """

    kind: str
    numbers: Sequence[int]
    at: Sequence[int]
    written: Any
    size: Any
    total: Any = None

    @property
    def rows(self) -> Any:
        """The rows themselves, (R, c), or None."""
        return self.written() if callable(self.written) else self.written

    @property
    def each(self) -> Iterator[tuple[int, Row, float]]:
        """Number, row and size of every square of floats that is not 0."""
        rows = self.rows
        for k in np.flatnonzero(self.size).tolist():
            moved = [] if rows is None else np.flatnonzero(rows[k]).tolist()
            entries = {k: 1.0} if rows is None else {j: rows[k, j] for j in moved}
            if entries:
                yield self.numbers[k], {self.at[j]: float(value) for j, value in entries.items()}, float(self.size[k])

    def add_to(self, S: Any) -> None:
        """Add it to a matrix in place, up to the diagonal."""
        if self.written is None and self.total is None:
            S[self.at, self.at] = S[self.at, self.at] + self.size
        else:
            first, end = self.at[0], self.at[-1] + 1
            together = (slice(first, end),) * 2 if end - first == len(self.at) else np.ix_(self.at, self.at)
            rows = self.rows if self.total is None else None
            S[together] = S[together] + (self.total if rows is None else (rows.T * self.size) @ rows)

    def on(self, moves: Floats, first: int, link: int, number: Number) -> SquareRows:
        """Squares of a chain whose pivot moves by these rows (3, d) with coordinates of a structure.

        Its angles begin at `first`, its links are numbered from `link` on.
        """
        angles = [first - ANGLES + at for at in self.at if at >= ANGLES]
        placed = self._replace(numbers=[link + k for k in self.numbers], at=angles)
        if self.written is None:
            return placed
        carried = np.flatnonzero(moves[self.at[0]])
        if not len(carried) and not angles:
            return placed
        pivot = number(moves[self.at[0], carried])

        def lifted(S: Any) -> Any:
            return np.hstack((S[:, :1] * pivot, S[:, 1:])) if len(carried) else S[:, 1:]

        total = None if self.total is None else lifted(lifted(self.total).T).T
        return placed._replace(at=carried.tolist() + angles, written=lambda: lifted(self.rows), total=total)


class SceneSquares(NamedTuple):
    """Those of M, K and D over `n` coordinates."""

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
        """That of everything at unit velocity along the rail, in the directions of q, (n,); no modal supports."""
        return self._along(self.inertia, ALONG)

    @property
    def windage(self) -> Any:
        """The linear drag of everything at unit velocity along the rail, (n,)."""
        return self._along(self.damping, DRAG)

    def _along(self, parts: Iterable[SquareRows], kind: str) -> Any:
        whole = np.array(self.number(np.zeros(self.n)))
        for part in parts:
            if part.kind == kind:
                whole[part.at] = whole[part.at] + part.rows.T @ part.size
        return whole


def matrix(squares: Iterable[SquareRows], n: int, number: Number = floats) -> Any:
    """The sum of all squares over n coordinates, (n, n)."""
    S = np.array(number(np.zeros((n, n))))
    for part in squares:
        part.add_to(S)
    for i in range(n):
        S[i, i + 1 :] = S[i + 1 :, i]
    return S


def chain_squares(
    block: Block, column: int, gravity: float, number: Number = floats
) -> tuple[list[SquareRows], list[SquareRows], list[SquareRows]]:
    """Those of M, K and D of a chain, over one of ALONG_PIVOT, … and its angles, from ANGLES on."""
    n = block.n
    names = ("mass", "length", "centre", "across", "inertia", "stiffness", "damping", "drag")
    m, l, c, way, inertia, spring, damper, drag = (number(getattr(block, name)[:, column]) for name in names)
    links, angles = range(n), list(range(ANGLES, ANGLES + n))
    unit = number(np.ones((n, 1)))

    def centres(kind: str, pivot: int, way: Any, size: Any) -> SquareRows:
        arms, reach = way * l, way * c

        def rows() -> Any:
            return np.hstack((unit, np.tril(np.tile(arms, (n, 1)), -1) + np.diag(reach)))

        b = np.array(pair.first_moments(size, arms, reach))
        total = np.tile(np.append(size.sum(), b)[:, None], n + 1)
        total[1:, 1:] = total[1:, 1:] * arms
        total[range(1, n + 1), range(1, n + 1)] = pair.second_moments(size, arms, reach, 0 * size)
        return SquareRows(kind, links, [pivot, *angles], rows, size, total)

    sinking, held = None, number(gravity) * way * np.array(pair.first_moments(m, l, c))
    if block.sinking is not None and block.rest is not None:
        sinking, held = number(block.sinking[:, column]), number(block.rest.held[:, column])

    def both(along: str, down: str, size: Any) -> list[SquareRows]:
        sunk = None if sinking is None else centres(down, DOWN_PIVOT, sinking, size)
        return [centres(along, ALONG_PIVOT, way, size), sunk or SquareRows(down, links, [DOWN_PIVOT], unit, size)]

    def joints(size: Any) -> SquareRows:
        turns = np.hstack((-np.eye(n, 1), np.eye(n) - np.eye(n, k=-1)))
        return SquareRows(JOINT, links, [TURN_PIVOT, *angles], number(turns), size)

    inertias, stiffness = both(ALONG, DOWN, m), [SquareRows(WIRE, links, angles, None, held)]
    if block.inertia[:, column].any():
        inertias.append(SquareRows(INERTIA, links, angles, None, inertia))
    if block.stiffness[:, column].any():
        stiffness.append(joints(spring))
    damping = [joints(damper)] if block.damping[:, column].any() else []
    return inertias, stiffness, damping + (both(DRAG, DRAG_DOWN, drag) if block.drag[:, column].any() else [])


def row_squares(kind: str, whose: int, row: Row, size: Any, number: Number = floats) -> list[SquareRows]:
    """The square of a row of floats; none of a row without entries, and of size 0."""
    at = [column for column, value in sorted(row.items()) if value]
    if not at or size == 0:
        return []
    return [SquareRows(kind, [whose], at, number([[row[column] for column in at]]), np.array([size]))]


def carrier_squares(
    structure: Structure, gravity: float, number: Number = floats
) -> tuple[list[SquareRows], list[SquareRows], list[SquareRows]]:
    """Those of M, K and D of the carriers themselves, without what hangs from them and springs between points."""
    inertia, stiffness, damping = list[SquareRows](), list[SquareRows](), list[SquareRows]()
    for carrier, (body, start) in enumerate(zip(structure.carriers, structure.offsets, strict=False)):
        if body.M is not None:
            at = list(range(start, start + body.size))
            for part, S in zip((inertia, stiffness, damping), (body.M, body.K, body.D), strict=True):
                part.append(SquareRows(SUPPORT, at, at, None, np.zeros(body.size), number(S)))
            continue
        mass = number(float(body.mass))
        if body.size:
            along, down = slopes(structure, carrier, body.centre)
            inertia += row_squares(ALONG, carrier, along, mass, number) + row_squares(DOWN, carrier, down, mass, number)
            turn = number(float(body.inertia))
            inertia += row_squares(INERTIA, carrier, turning(structure, carrier), turn, number)
        for k in range(start, start + body.size):
            held, damped = number(float(body.stiffness[k - start])), number(float(body.damping[k - start]))
            stiffness += row_squares(SUPPORT, k, {k: 1.0}, held, number)
            damping += row_squares(SUPPORT, k, {k: 1.0}, damped, number)
        stiffness += bend_squares(structure, carrier, body.centre, number(gravity) * mass, number)
    return inertia, stiffness, damping


def bend_squares(
    structure: Structure, carrier: int, where: Where, weight: Any, number: Number = floats
) -> list[SquareRows]:
    """What a weight on a point of a carrier holds coordinates with, as that point sinks and rises on its path."""
    first = structure.offsets[carrier]
    every = [(first + k, weight * number(bend)) for k, bend in bends(structure.carriers[carrier], where)]
    return [square for at, size in every for square in row_squares(WEIGHT, at, {at: 1.0}, size, number)]
