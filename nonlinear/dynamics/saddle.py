"""The matrix of constrained motion, regular although bobs have no inertia and a cart may have no mass.

    [[M, Gᵀ], [G, 0]] (q'', λ) = (f, γ)

λ is the ground's push up on the cart, then the force from above on every link.  Coordinates are scaled by the roots of
masses and of moments about the upper joints, constraints by what these make of them, so that all entries are near 1.
Few unknowns are solved dense, many by a sparse factorisation whose pattern is made once.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_array, csc_array
from scipy.sparse.linalg import splu

from modal.errors import ComputationError
from modal.types import Floats, Ints
from nonlinear.dynamics.constraints import Pivots

DENSE = 120
SINGULAR = "an acceleration stays open, as of a cart without mass over hanging bobs: give the cart some mass"


class Saddle:
    """The scaled entries of one scene's matrix: masses, G and Gᵀ, of which only sines and cosines change."""

    def __init__(self, pivots: Pivots) -> None:
        self.coordinates = pivots.size
        masses, roots = _masses(pivots)
        rows, columns, self.still, self.arm, self.turner = _entries(pivots)
        bound = np.concatenate((self.still, self.arm)) / roots[columns]
        self.scale = np.concatenate((1 / roots, 1 / np.sqrt(np.bincount(rows, bound**2))))
        diagonal, self.size = np.arange(pivots.size), len(self.scale)
        self.rows = np.concatenate((diagonal, pivots.size + rows, columns))
        self.columns = np.concatenate((diagonal, columns, pivots.size + rows))
        self.weight = self.scale[self.rows] * self.scale[self.columns]
        self.masses = masses
        order = np.arange(1, len(self.rows) + 1)
        self.pattern = coo_array((order, (self.rows, self.columns)), shape=(self.size, self.size)).tocsc()

    @property
    def is_dense(self) -> bool:
        """Whether it is solved as a dense matrix."""
        return self.size <= DENSE

    def solve(self, angles: Floats, upper: Floats | float, lower: Floats | float) -> Floats:
        """(q'', λ), or the like, with forces `upper` and accelerations `lower` on the right.

        ComputationError where the motion is not determined.
        """
        right = np.empty(self.size)
        right[: self.coordinates], right[self.coordinates :] = upper, lower
        try:
            return np.asarray(self.scale * self._solved(self._values(angles), self.scale * right))
        except (np.linalg.LinAlgError, RuntimeError):
            raise ComputationError(SINGULAR) from None

    def _values(self, angles: Floats) -> Floats:
        trig = np.concatenate((np.cos(angles), -np.sin(angles)))
        G = np.concatenate((self.still, self.arm * trig[self.turner]))
        return np.asarray(self.weight * np.concatenate((self.masses, G, G)))

    def _solved(self, values: Floats, right: Floats) -> Floats:
        if not self.is_dense:
            pattern = self.pattern
            matrix = csc_array((values[pattern.data - 1], pattern.indices, pattern.indptr), shape=pattern.shape)
            return np.asarray(splu(matrix).solve(right))
        dense = np.zeros((self.size, self.size))
        dense[self.rows, self.columns] = values
        return np.asarray(np.linalg.solve(dense, right), dtype=np.float64)


def _masses(pivots: Pivots) -> tuple[Floats, Floats]:
    """The diagonal of M, and the root of each coordinate's inertia, never zero."""
    system, mass, inertia = pivots.system, pivots.system.mass, pivots.system.by_link("inertia")
    cart = [system.cart.mass] * 2 if system.cart else []
    links = np.column_stack((mass, mass, inertia))
    turning = np.column_stack((mass, mass, inertia + mass * pivots.centre**2))
    loaded = [one + float(mass.sum()) for one in cart]
    return np.concatenate((cart, links.ravel())), np.sqrt(np.concatenate((loaded, turning.ravel())))


def _entries(pivots: Pivots) -> tuple[Ints, Ints, Floats, Floats, Ints]:
    """(rows, columns) of G; the entries that stay; the arms of those that turn, and the (cos, −sin) of which link.

    Row r is a pivot along the rail, r + 1 the same one down.
    """
    first, links = pivots.first, np.arange(pivots.system.n_links)
    r, x = first // 2 + 2 * links, first + 3 * links
    inner = pivots.above >= 0
    upper = pivots.above[inner]
    on_cart = r[~inner] if first else r[:0]
    cart = np.zeros_like(on_cart)
    still = [(r, x, -1.0), (r + 1, x + 1, -1.0), (r[inner], x[upper], 1.0), (r[inner] + 1, x[upper] + 1, 1.0)]
    still += [(on_cart, cart, 1.0), (on_cart + 1, cart + 1, 1.0), (cart[:1], cart[:1] + 1, 1.0)]
    c, e, count = pivots.centre, pivots.rest[upper], len(links)
    turning = [(r, x + 2, c, links), (r + 1, x + 2, c, links + count)]
    turning += [(r[inner], x[upper] + 2, e, upper), (r[inner] + 1, x[upper] + 2, e, upper + count)]
    rows, columns = (np.concatenate([entry[part] for entry in (*still, *turning)]) for part in (0, 1))
    values = np.concatenate([np.full(len(where), value) for where, _, value in still])
    arms, turners = (np.concatenate([entry[part] for entry in turning]) for part in (2, 3))
    return rows, columns, values, arms, turners
