"""M, K and D of pendula side by side on one support, as dense matrices."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from modal.assembly.arrays import Block, CartNumbers
from modal.types import Floats

Columns = list[tuple[Block, int]]


def assembled(columns: Columns, cart: CartNumbers | None, gravity: float) -> tuple[Floats, Floats]:
    """(M, K) of a cart or (None) a fixed support with one pendulum for each (block, column)."""
    M, K = _zeros(columns, cart), _zeros(columns, cart)
    for block, column, span in _placed(columns, cart):
        across, b = block.across[:, column], block.across[:, column] * block.b[:, column]
        own_M = M[span, span]
        np.multiply.outer(b, across * block.length[:, column], out=own_M)
        if block.sinking is not None:
            sinking = block.sinking[:, column]
            own_M += np.multiply.outer(sinking * block.b[:, column], sinking * block.length[:, column])
        for i in range(block.n):
            own_M[i, i + 1 :] = own_M[i + 1 :, i]
        np.fill_diagonal(own_M, block.diagonal[:, column])
        _add_joints(K[span, span], block.stiffness[:, column])
        _diagonal(K[span, span])[:] += gravity * b if block.rest is None else block.rest.held[:, column]
        if cart:
            M[0, span] = M[span, 0] = b
            M[0, 0] += block.mass[:, column].sum()
    if cart:
        M[0, 0] += cart.mass
        K[0, 0] = cart.stiffness
    return M, K


def dampers(columns: Columns, cart: CartNumbers | None) -> Floats:
    """D of the same coordinates."""
    D = _zeros(columns, cart)
    for block, column, span in _placed(columns, cart):
        _add_joints(D[span, span], block.damping[:, column])
    if cart:
        D[0, 0] = cart.damping
    if any(block.drag[:, column].any() for block, column in columns):
        strength, rows = drag_of(columns, cart)
        D += (rows.T * strength) @ rows
    return D


def drag_of(columns: Columns, cart: CartNumbers | None) -> tuple[Floats, Floats]:
    """The linear drag (N s/m) of every link with any, (R,), and the displacement of its centre, rows (R, size).

    Of links that neither hang nor stand straight there is a second row for each, the displacement downwards.
    """
    strength, rows = [], []
    for block, column, span in _placed(columns, cart):
        dragged = np.flatnonzero(block.drag[:, column])
        ways = (block.across,) if block.sinking is None else (block.across, block.sinking)
        for way in ways:
            moved = np.zeros((len(dragged), len(_zeros(columns, cart))))
            moved[:, span] = centres(block, column, way)[dragged]
            if cart and way is block.across:
                moved[:, 0] = 1.0
            strength.append(block.drag[dragged, column])
            rows.append(moved)
    return np.concatenate(strength), np.vstack(rows)


def centres(block: Block, column: int, way: Floats | None = None) -> Floats:
    """The displacement of the centre of every link along the rail by every angle of its chain, (n, n).

    A `way` is another direction: what the end of every link (n, P) moves there, per length and angle.
    """
    moves, length = (block.across if way is None else way)[:, column], block.length[:, column]
    return np.tril(np.tile(moves * length, (block.n, 1)), -1) + np.diag(moves * block.centre[:, column])


def joints(block: Block, column: int) -> Floats:
    """The same of the lower joint of every link."""
    return np.tril(np.tile(block.across[:, column] * block.length[:, column], (block.n, 1)))


def displacements(
    columns: Columns, cart: CartNumbers | None, of: Callable[[Block, int], Floats] | None = None
) -> Floats:
    """The displacement along the rail of the centre of every link, or of what `of` tells, rows (links, size)."""
    part = of or centres
    rows = np.zeros((sum(block.n for block, _ in columns), len(_zeros(columns, cart))))
    first = int(cart is not None)
    rows[:, :first] = 1.0
    for block, column, span in _placed(columns, cart):
        rows[span.start - first : span.stop - first, span] = part(block, column)
    return rows


def _zeros(columns: Columns, cart: CartNumbers | None) -> Floats:
    size = (1 if cart else 0) + sum(block.n for block, _ in columns)
    return np.zeros((size, size))


def _placed(columns: Columns, cart: CartNumbers | None) -> Iterator[tuple[Block, int, slice]]:
    """Every pendulum with the slice of its angles."""
    at = 1 if cart else 0
    for block, column in columns:
        yield block, column, slice(at, at + block.n)
        at += block.n


def _add_joints(S: Floats, strength: Floats) -> None:
    """Add Σ s_i (θ_i − θ_{i−1})²/2, with θ_0 = 0 at the support, to a matrix in place."""
    _diagonal(S)[:] += strength
    _diagonal(S)[:-1] += strength[1:]
    for beside in (S[1:], S[:, 1:]):
        _diagonal(beside)[:] -= strength[1:]


def _diagonal(S: Floats) -> Floats:
    """A writable view of the diagonal."""
    diagonal: Floats = np.einsum("ii->i", S[: min(S.shape), : min(S.shape)])
    return diagonal
