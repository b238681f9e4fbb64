"""M, K and D of a scene as sums of squares, in any arithmetic: whoever wants matrices asks for their sum.

    M = Σ m h hᵀ,      K = Σ k a aᵀ,      D = Σ d c cᵀ

The row h of a centre of mass is its displacement along the rail or down, that of a moment of inertia an angle; a is the
angle of a link, which gravity holds by g σ b or what constant forces make of it, the turn of a joint, or the extension
of a spring; c is the turn of a joint, the displacement of a dragged centre, or the extension of a damper.  A modal
support brings matrices: those are one square of rows 1, its `size` being the matrix.

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

ALONG, DOWN, INERTIA, WIRE, WEIGHT, JOINT, SPRING, DRAG, SUPPORT = (
    *("along", "down", "inertia", "wire", "weight", "joint", "spring", "drag", "support"),
)
"""What a square is of: a centre's displacement, an angle, what gravity holds, a joint, a spring, drag, a support."""
ALONG_PIVOT, DOWN_PIVOT, TURN_PIVOT, ANGLES = range(4)
"""The coordinates of a chain: its pivot along the rail and down, the turn of its carrier; its angles from ANGLES on."""
Number = Callable[[Any], Any]
"""Floats as numbers of an arithmetic."""


def floats(values: Any) -> Floats:
    """The floats themselves."""
    return np.asarray(values, dtype=np.float64)


class Centres(NamedTuple):
    """The rows of all centres of a chain: `pivot` (c,), `arms` (n,) of the links above, and `reach` (n,) on their link.

    `b` (n,) and `A` (n, n), below the diagonal, are the sums over the angles of size times rows and of size times
    squares: for 300 links in a tenth of the time of their product.
    """

    pivot: Any
    arms: Any
    reach: Any
    b: Any
    A: Any

    @classmethod
    def of(cls, arms: Any, reach: Any, size: Any) -> Centres:
        """Those of a chain with this size of each centre, whose pivot is at rest."""
        b = np.array(pair.first_moments(size, arms, reach))
        A = np.multiply.outer(b, arms)
        np.fill_diagonal(A, pair.second_moments(size, arms, reach, 0 * size))
        return cls(arms[:0], arms, reach, b, A)

    @property
    def rows(self) -> Any:
        """All rows (n, c + n)."""
        n = len(self.reach)
        carried = np.tile(self.pivot, (n, 1))
        return np.hstack((carried, np.tril(np.tile(self.arms, (n, 1)), -1) + np.diag(self.reach)))

    def sum(self, total: Any) -> Any:
        """The sum of size times squares (c + n, c + n) for a total size."""
        carried, pivot = len(self.pivot), self.pivot
        whole = np.empty((carried + len(self.b),) * 2, self.A.dtype)
        whole[carried:, carried:] = self.A
        whole[carried:, :carried] = np.multiply.outer(self.b, pivot)
        whole[:carried, carried:] = whole[carried:, :carried].T
        whole[:carried, :carried] = total * np.multiply.outer(pivot, pivot)
        return whole


class SquareRows(NamedTuple):
    """`size` (R,) times the squares of `rows` (R, c) over the coordinates `at` (c,), those of one `kind` of one part.

    Rows of None are 1 at each coordinate; of a modal support the size is then a matrix (c, c).  `numbers` (R,) tell
    whose they are: links in the order of the file, coordinates of a support, ways of springs.
    """

    kind: str
    numbers: Sequence[int]
    at: Sequence[int]
    rows: Any
    size: Any

    @property
    def is_matrix(self) -> bool:
        """Whether its size is a matrix."""
        return np.ndim(self.size) > 1

    @property
    def each(self) -> Iterator[tuple[int, Row, float]]:
        """Number, row and size of every square of floats that is not 0."""
        rows = self.rows.rows if isinstance(self.rows, Centres) else self.rows
        for k in np.flatnonzero(self.size).tolist():
            if rows is None:
                row = {self.at[k]: 1.0}
            else:
                row = {self.at[j]: float(rows[k, j]) for j in np.flatnonzero(rows[k]).tolist()}
            if row:
                yield self.numbers[k], row, float(self.size[k])

    @property
    def moment(self) -> Any:
        """The sum of size times rows, over `at`."""
        if isinstance(self.rows, Centres):
            return np.hstack((self.size.sum() * self.rows.pivot, self.rows.b))
        return self.rows.T @ self.size

    def add_to(self, S: Any) -> None:
        """Add it to a matrix in place, below the diagonal."""
        if self.rows is None and not self.is_matrix:
            S[self.at, self.at] = S[self.at, self.at] + self.size
            return
        part = self.size
        if isinstance(self.rows, Centres):
            part = self.rows.sum(self.size.sum())
        elif self.rows is not None:
            part = (self.rows.T * self.size) @ self.rows
        at = np.ix_(self.at, self.at)
        S[at] = S[at] + part

    def on(self, moves: Floats, first: int, link: int, number: Number) -> SquareRows:
        """Squares of a chain whose pivot moves by these rows (3, d) with coordinates of a structure.

        Its angles begin at `first`, its links are numbered from `link` on.
        """
        angles = [first - ANGLES + at for at in self.at if at >= ANGLES]
        placed = self._replace(numbers=[link + k for k in self.numbers], at=angles)
        if self.rows is None:
            return placed
        carried = np.flatnonzero(moves[self.at[0]])
        if not len(carried) and not angles:
            return placed
        pivot = number(moves[self.at[0], carried])
        if isinstance(self.rows, Centres):
            rows: Any = self.rows._replace(pivot=pivot)
        else:
            rows = np.hstack((self.rows[:, :1] * pivot, self.rows[:, 1:]))
        return placed._replace(at=carried.tolist() + angles, rows=rows)


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
        momentum = np.array(self.number(np.zeros(self.n)))
        for part in self.inertia:
            if part.kind == ALONG:
                at = list(part.at)
                momentum[at] = momentum[at] + part.moment
        return momentum


def matrix(squares: Iterable[SquareRows], n: int, number: Number = floats) -> Any:
    """The sum of all squares over n coordinates, (n, n)."""
    S = np.array(number(np.zeros((n, n))))
    for part in squares:
        part.add_to(S)
    return np.where(np.tri(n, dtype=np.bool_), S, S.T)


def chain_squares(
    block: Block, column: int, gravity: float, number: Number = floats
) -> tuple[list[SquareRows], list[SquareRows], list[SquareRows]]:
    """Those of M, K and D of a chain, over one of ALONG_PIVOT, … and its angles, from ANGLES on."""
    n = block.n
    names = ("mass", "length", "centre", "across", "inertia", "stiffness", "damping", "drag")
    m, l, c, way, inertia, spring, damper, drag = (number(getattr(block, name)[:, column]) for name in names)
    angles = range(ANGLES, ANGLES + n)
    sinking, held = None, number(gravity) * way * np.array(pair.first_moments(m, l, c))
    if block.sinking is not None and block.rest is not None:
        sinking, held = number(block.sinking[:, column]), number(block.rest.held[:, column])

    def centres(kind: tuple[str, str], size: Any) -> list[SquareRows]:
        """The squares of all centres along the rail and down."""
        along = SquareRows(kind[0], range(n), [ALONG_PIVOT, *angles], Centres.of(way * l, way * c, size), size)
        if sinking is None:
            return [along, SquareRows(kind[1], range(n), [DOWN_PIVOT], number(np.ones((n, 1))), size)]
        down = Centres.of(sinking * l, sinking * c, size)
        return [along, SquareRows(kind[1], range(n), [DOWN_PIVOT, *angles], down, size)]

    turn = [TURN_PIVOT, *angles], number(np.hstack((-np.eye(n, 1), np.eye(n) - np.eye(n, k=-1))))
    inertias, damped = centres((ALONG, DOWN), m), list[SquareRows]()
    holds = [SquareRows(WIRE, range(n), angles, None, held)]
    if block.inertia[:, column].any():
        inertias.append(SquareRows(INERTIA, range(n), angles, None, inertia))
    if block.stiffness[:, column].any():
        holds.append(SquareRows(JOINT, range(n), *turn, spring))
    if block.damping[:, column].any():
        damped.append(SquareRows(JOINT, range(n), *turn, damper))
    if block.drag[:, column].any():
        damped += centres((DRAG, DRAG), drag)
    return inertias, holds, damped


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
            at = range(start, start + body.size)
            for part, S in zip((inertia, stiffness, damping), (body.M, body.K, body.D), strict=True):
                part.append(SquareRows(SUPPORT, at, at, None, number(S)))
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
