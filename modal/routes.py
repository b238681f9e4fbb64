"""The routes to the modes of a scene, chosen by what hangs there.

A fixed support leaves every pendulum alone.  On a cart, N equal pendula (equal links, bit for bit, wherever they
stand in the file) split exactly: one pendulum N times as heavy moves together with the cart, and N − 1 antiphase
copies of the pendulum's own modes hold it still.  In space the motion across the rail is that on a fixed support.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import repeat

import numpy as np

from modal.crowd import Crowd
from modal.effective import CartProblem
from modal.matrix_source import Dense
from modal.rig import Block, Booleans, Ints, Rig
from modal.sources import Alone, Rigid, Source, Together, bare_mobility

MOST_LINKS_TOGETHER = 600


@dataclass(frozen=True)
class Part:
    """`along` + `across` modes of equal frequency: row `row` of source `source`.

    `kind` is the (block, column) whose copies move while all else stands still; None where everything moves.
    """

    source: int
    row: int
    along: int
    across: int
    kind: tuple[int, int] | None


@dataclass(frozen=True, eq=False)
class Family:
    """Rows of a source with their multiplicities, all (R,); `block` and `columns` where single kinds move alone."""

    source: Source
    rows: Ints
    along: Ints
    across: Ints
    block: int = -1
    columns: Ints | None = None

    def parts(self, index: int) -> Iterator[Part]:
        """The rows one by one, this being source number `index`."""
        kinds = repeat(None) if self.columns is None else ((self.block, column) for column in self.columns.tolist())
        numbers = zip(self.rows.tolist(), self.along.tolist(), self.across.tolist(), kinds, strict=False)
        return (Part(index, *number) for number in numbers)


def families(rig: Rig) -> Iterator[Family]:
    """All modes of a rig in natural units; a dense source only for what has joint springs or dampers."""
    for index, block in enumerate(rig.blocks):
        along = block.count - (1 if rig.cart else 0)
        across = block.count if rig.spatial else np.zeros_like(block.count)
        needed = along + across > 0
        for chosen, source in _alone(block, needed):
            rows = np.arange(len(source.eigenvalue))
            columns = chosen[rows % chosen.size]
            yield Family(source, rows, along[columns], across[columns], index, columns)
    if rig.cart:
        yield from (_moving(source) for source in _with_cart(rig, rig.cart))


def _alone(block: Block, needed: Booleans) -> Iterator[tuple[Ints, Source]]:
    """The needed columns and their sources: all structured chains in one, the others one by one."""
    structured = np.flatnonzero(needed & ~_is_dense(block))
    if structured.size:
        yield structured, Alone(block.take(structured))
    for column in np.flatnonzero(needed & _is_dense(block)):
        chain = block.take(np.array([column]))
        yield np.array([column]), Dense((chain,), (chain.count,), None, 1.0)


def _is_dense(block: Block) -> Booleans:
    """Which chains (P,) have joint springs or dampers."""
    return np.asarray(((block.damping > 0) | (block.stiffness > 0)).any(0), dtype=np.bool_)


def _with_cart(rig: Rig, cart: tuple[float, float, float]) -> Iterator[Source]:
    mass, damping, stiffness = cart
    heavy = tuple(block.heavier(block.count) for block in rig.blocks)
    counts = tuple(block.count for block in rig.blocks)
    mobility = bare_mobility(heavy, cart)
    if stiffness == 0:
        yield Rigid(rig.blocks, rig.total_mass, mobility)
    if damping > 0 or any(_is_dense(block).any() for block in rig.blocks):
        yield Dense(heavy, counts, cart, mobility)
    else:
        few = rig.n_kinds == 1 or sum(block.mass.size for block in heavy) <= MOST_LINKS_TOGETHER
        yield Together(heavy, counts, (CartProblem if few else Crowd)(heavy, mass, stiffness), mobility)


def _moving(source: Source) -> Family:
    rows = np.arange(len(source.eigenvalue))
    return Family(source, rows, np.ones_like(rows), np.zeros_like(rows))


def notes(rig: Rig) -> tuple[str, ...]:
    """What was left out, and why."""
    if rig.cart and CartProblem(rig.blocks, rig.cart[0], rig.cart[2]).bare_mass == 0:
        return (
            "The mass matrix is singular: a massless cart over bobs has no inertia of its own, "
            "so one mode has no finite frequency and is left out.",
        )
    return ()
