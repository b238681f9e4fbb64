"""M, K and D of pendula side by side on one support, as dense matrices."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from modal.assembly.arrays import Block, CartNumbers, Rig
from modal.assembly.squares import SceneSquares, matrix
from modal.assembly.structure import scene_squares
from modal.types import Floats

Columns = list[tuple[Block, int]]


def on_rail(columns: Columns, cart: CartNumbers | None, gravity: float = 0.0) -> SceneSquares:
    """The squares of a cart or (None) a fixed support with one pendulum for each (block, column)."""
    blocks, members = tuple(block for block, _ in columns), enumerate(column for _, column in columns)
    return scene_squares(Rig(gravity, blocks, tuple((k, column, 1) for k, column in members), cart, spatial=False))


def assembled(columns: Columns, cart: CartNumbers | None, gravity: float) -> tuple[Floats, Floats]:
    """(M, K) of the same."""
    squares = on_rail(columns, cart, gravity)
    M, K = (matrix(part, squares.n) for part in (squares.inertia, squares.stiffness))
    return M, K


def centres(block: Block, column: int, way: Floats | None = None) -> Floats:
    """The displacement of the centre of every link along the rail by every angle of its chain, (n, n).

    A `way` is another direction: what the end of every link (n, P) moves there, per length and angle.
    """
    moves, length = (block.across if way is None else way)[:, column], block.length[:, column]
    return np.tril(np.tile(moves * length, (block.n, 1)), -1) + np.diag(moves * block.centre[:, column])


def joints(block: Block, column: int) -> Floats:
    """The same of the lower joint of every link."""
    return np.tril(np.tile(block.across[:, column] * block.length[:, column], (block.n, 1)))


def displacements(columns: Columns, first: int, of: Callable[[Block, int], Floats] | None = None) -> Floats:
    """The displacement along the rail of what `of` tells of every link, rows (links, first + links).

    That is of its centre where nothing is given.  The `first` coordinates move everything alike.
    """
    n = sum(block.n for block, _ in columns)
    rows, at = np.zeros((n, first + n)), 0
    rows[:, :first] = 1.0
    for block, column in columns:
        rows[at : at + block.n, first + at : first + at + block.n] = (of or centres)(block, column)
        at += block.n
    return rows
