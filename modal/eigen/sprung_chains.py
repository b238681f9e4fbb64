"""Chains with joint springs or inverted links: the effective mass together with a moment felt by the link above.

With a spring the part below a joint depends on the angle φ of the link above as well as on the displacement y of the
joint.  Eliminated from the free end, with x = ω², that part is the quadratic form

    −x μ y² − 2 x h y φ + F φ²,        Δ = μ F + x h²

of an effective mass μ, first moment h and stiffness F; Δ is kept separately, as it would lose its digits as a sum.  For
a link of mass m, centre c, inertia I and length l, with r = l − c, its weight G = σ g b, and s of the spring at its
upper joint,

    H = l μ + h + m c,        N = Δ + μ (G − x (I + m r²)) − 2 x m r h + m (G + F − x I),
    B = G + F − x (I + m c² + l (l μ + 2 h)),        D = B + s,
    μ' = (N + s (μ + m)) / D,    h' = s H / D,    F' = s B / D,    Δ' = s N / D        (all 0 below the last link).

The number of D < 0 is the number of x below, negative ones included (Sylvester's law of inertia).  Without springs
this is `modal.eigen.recursion`; with them the four are the minors of a 2 × 2 form, so that a stiff spring subtracts
nothing (compound matrices: Ng & Reid, J. Comput. Phys. 30, 125 (1979)).  Angles are σ θ, those of the hanging chain:
in these a spring acts on σ_i θ_i − σ_i σ_{i−1} (σ_{i−1} θ_{i−1}).
Shapes come from inverse iteration in the same elimination.

Arrays as in `modal.eigen.recursion`: links first, then pendula, then trial values x: (n, P, R).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from modal.assembly import Block, CartNumbers
from modal.eigen.bisection import above_all, smallest_where
from modal.eigen.chains import ChainShapes
from modal.eigen.counts import Built, counted
from modal.eigen.sturm import Suspension
from modal.types import Booleans, Floats, Ints

NUDGE = 2.0**-60
"""An exact zero of D becomes minus this fraction of a link's weight and spring."""
ROUNDINGS = 4
"""Roundings per link over those of `modal.eigen.recursion`."""
ITERATIONS = 3
CLOSE = 1e-8
"""Relative gap of ω² within which shapes are orthogonalized one after another."""
CANCELLED = 2.0**-50
"""Displacement of a cart over the largest angle, per mode, that counts as zero."""
CHUNK = 400_000
SMALLEST = 2.0**-900
"""Lower bound of |x| with inverted links."""


class EliminatedChain(NamedTuple):
    """The results of eliminating one link, arrays (P, R), or all of them, (n, P, R).

    `pivot` is D and `moment` H; `first_moment` h and `stiffness` F are those below the link, `mass` is μ' above it.
    """

    pivot: Floats
    moment: Floats
    first_moment: Floats
    stiffness: Floats
    mass: Floats


def eliminate(block: Block, x: Floats) -> Iterator[EliminatedChain]:
    """Every link at x (R,), from the last to the first."""
    mu, h, F, delta = (np.zeros((block.size, x.shape[-1])) for _ in range(4))
    turned = _turned(block)
    for i in reversed(range(block.n)):
        m, l, c, inertia, s = _link(block, i)
        r, G = l - c, (block.sigma[i] * block.b[i])[:, None]
        lm, held = l * mu, G + F
        H = lm + h + m * c
        N = delta + mu * (G - x * (inertia + m * r * r)) - x * (2 * m * r * h) + m * (held - x * inertia)
        B = held - x * (inertia + m * c * c + l * (lm + 2 * h))
        D = B + s
        D = np.where(D == 0, -NUDGE * (np.abs(G) + s), D)
        above = (N + s * (mu + m)) / D
        yield EliminatedChain(D, H, h, F, above)
        passed = s / D
        mu, h, F, delta = above, turned[i][:, None] * passed * H, passed * B, passed * N


def eliminated(block: Block, x: Floats) -> EliminatedChain:
    """All links, top first."""
    links = list(eliminate(block, x))[::-1]
    return EliminatedChain(*(np.array(values) for values in zip(*links, strict=True)))


def count_and_mass(block: Block, x: Floats) -> tuple[Ints, Floats]:
    """Number of ω² of each chain on a fixed support below each x (R,), and the mass felt at its pivot, (P, R)."""
    below = np.zeros((block.size, x.shape[-1]), dtype=np.int64)
    for link in eliminate(block, x):
        below += link.pivot < 0
    return below, link.mass


def _link(block: Block, i: int) -> list[Floats]:
    """Mass, length, centre, inertia and spring of the links in row i, (P, 1) each."""
    arrays = (block.mass, block.length, block.centre, block.inertia, block.stiffness)
    return [values[i][:, None] for values in arrays]


def _turned(block: Block) -> Floats:
    """σ_i σ_{i−1} (n, P), 1 at the support."""
    return np.concatenate([np.ones((1, block.size)), block.sigma[1:] * block.sigma[:-1]])


class _Loads(NamedTuple):
    """Forces on the centres and moments on the links (n, P, R) of every block, and a force on the cart (R,)."""

    force: tuple[Floats, ...]
    moment: tuple[Floats, ...]
    cart: Floats


class _Shape(NamedTuple):
    """Angles σ θ and displacements of the centres (n, P, R) of every block, and that of the cart (R,)."""

    angles: tuple[Floats, ...]
    centres: tuple[Floats, ...]
    cart: Floats

    def scaled(self, factor: Floats) -> _Shape:
        return _Shape(
            tuple(part * factor for part in self.angles),
            tuple(part * factor for part in self.centres),
            self.cart * factor,
        )

    def take(self, columns: Ints) -> _Shape:
        return _Shape(
            tuple(part[:, :, columns] for part in self.angles),
            tuple(part[:, :, columns] for part in self.centres),
            self.cart[columns],
        )

    def subtract(self, column: int, other: _Shape, share: Floats) -> None:
        """Subtract this multiple of another shape from one column, in place."""
        parts = [*zip(self.angles, other.angles, strict=True), *zip(self.centres, other.centres, strict=True)]
        for mine, its in [*parts, (self.cart, other.cart)]:
            mine[..., column] -= (its * share)[..., 0]


def gathered(block: Block, pivots: EliminatedChain, x: Floats, force: Floats, moment: Floats) -> tuple[Floats, Floats]:
    """The load on each link (n, P, R) once everything below is eliminated, and the force on the pivot (P, R)."""
    felt, pivot = np.empty_like(moment), np.zeros(moment.shape[1:])
    passed, turned = pivot, _turned(block)
    for i in reversed(range(block.n)):
        _, l, c, _, s = _link(block, i)
        felt[i] = l * pivot + passed + c * force[i] + moment[i]
        pivot = pivot + force[i] + x * pivots.moment[i] * felt[i] / pivots.pivot[i]
        passed = turned[i][:, None] * s * felt[i] / pivots.pivot[i]
    return felt, pivot


def descended(block: Block, pivots: EliminatedChain, x: Floats, felt: Floats, pivot: Floats) -> tuple[Floats, Floats]:
    """Angles and displacements of the centres (n, P, R) under the load on each link, pivots displaced (R,) or (P, R).

    The lower joint moves by y + l θ = (y (D + x l H) + l (s φ + …)) / D, in which D + x l H needs no μ.
    """
    angles, centres = np.empty_like(felt), np.empty_like(felt)
    above, y, turned = np.zeros(felt.shape[1:]), np.broadcast_to(pivot, felt.shape[1:]), _turned(block)
    for i in range(block.n):
        m, l, c, inertia, s = _link(block, i)
        pushed = s * turned[i][:, None] * above + felt[i]
        angles[i] = above = (pushed + x * pivots.moment[i] * y) / pivots.pivot[i]
        held = (block.sigma[i] * block.b[i])[:, None] + pivots.stiffness[i] + s
        gain = held + x * (m * c * (l - c) - inertia - l * pivots.first_moment[i])
        lower = (y * gain + l * pushed) / pivots.pivot[i]
        centres[i] = y * ((l - c) / l) + lower * (c / l)
        y = lower
    return angles, centres


@dataclass(frozen=True, eq=False)
class SprungProblem:
    """Chains that share a cart, or (`cart` None) one chain on a support at rest; M is not singular."""

    blocks: tuple[Block, ...]
    cart: CartNumbers | None
    route = "mass and moment"
    dense_error = 0.0

    @property
    def built(self) -> Built:
        """All chains and the cart."""
        links = counted(self._links, "link")
        what = f"cart and {links}" if self.cart else f"chain of {links}, support still"
        return Built(what, 1, self._links + (self.cart is not None))

    @property
    def stands(self) -> bool:
        """Whether any link is inverted."""
        return any((block.sigma < 0).any() for block in self.blocks)

    @property
    def n_modes(self) -> int:
        """Number of modes except a free cart's rigid translation."""
        return self._links + (self.cart is not None and self.cart.stiffness > 0)

    def count(self, x: Floats) -> Ints:
        """Number of modes below each trial x (R,), of one sign."""
        below, masses = zip(*(count_and_mass(block, x) for block in self.blocks), strict=True)
        total: Ints = np.sum([values.sum(0) for values in below], axis=0)
        if self.cart is None:
            return total
        felt = self.cart.mass + sum(values.sum(0) for values in masses)
        free = self.cart.stiffness == 0
        return np.asarray(total + (x * felt > self.cart.stiffness) - (free & (x > 0)))

    @cached_property
    def squares(self) -> Floats:
        """ω² of every mode (R,), ascending; negative for growing modes."""
        if self.stands:
            low = np.array([SMALLEST])
        else:
            fixed = Suspension.fixed(self.blocks[0])
            low = (Suspension.on_cart(self.blocks, self.cart) if self.cart else fixed).low
        growing = int(self.count(low)[0]) if self.stands else 0
        order = np.arange(self.n_modes)
        high = above_all(self.count, low, np.array([self.n_modes]))
        squares = np.empty(self.n_modes)
        if growing:
            first = order[:growing]
            top = above_all(lambda u: growing - self.count(-u), low, np.array([growing]))
            squares[:growing] = -self._located(lambda u: self.count(-u) <= first, low, top, growing)
        last = order[growing:]
        squares[growing:] = self._located(lambda u: self.count(u) > last, low, high, len(last))
        return squares

    @staticmethod
    def _located(reached: Callable[[Floats], Booleans], low: Floats, high: Floats, number: int) -> Floats:
        return smallest_where(reached, np.broadcast_to(low, number), np.broadcast_to(high, number))

    @property
    def _links(self) -> int:
        return sum(block.mass.size for block in self.blocks)

    @property
    def _hanging(self) -> float:
        return sum(float(block.mass.sum()) for block in self.blocks)

    @cached_property
    def slack(self) -> Floats:
        """Factor of the error of ω over that of one recursion (R,).

        With inverted links gravity and springs may cancel: a rounding of each counts in proportion to its energy.
        """
        if not self.stands:
            return np.full(self.n_modes, float(ROUNDINGS))
        pieces = np.array_split(np.arange(self.n_modes), self.n_modes * self._links // CHUNK + 1)
        return np.concatenate([self._cancelling(rows) for rows in pieces])

    def _cancelling(self, rows: Ints) -> Floats:
        x = self.squares[rows]
        shape, _ = self._solved(rows)
        held = self.cart.stiffness * shape.cart**2 if self.cart else np.zeros(len(x))
        for block, angles in zip(self.blocks, shape.angles, strict=True):
            held = held + self._held(block, angles)
        lost: Floats = ROUNDINGS * (held / (np.abs(x) * _product(self._inertial(shape), shape)) + 1) / 2
        return lost

    @staticmethod
    def _held(block: Block, angles: Floats) -> Floats:
        """Σ |k| e² (R,) of gravity and springs."""
        above = np.concatenate([np.zeros_like(angles[:1]), angles[:-1]]) * _turned(block)[:, :, None]
        spring = block.stiffness[:, :, None] * (angles - above) ** 2
        energy: Floats = (block.b[:, :, None] * angles**2 + spring).sum((0, 1))
        return energy

    def shapes(self, rows: Ints) -> ChainShapes:
        """Shapes of these modes, all chains and the cart together."""
        x = self.squares[rows]
        shape, missed = self._solved(rows)
        loads = self._inertial(shape)
        parts = zip(loads.force, shape.centres, loads.moment, shape.angles, strict=True)
        modal_mass = _product(loads, shape)
        return ChainShapes(
            cart=shape.cart,
            turns=tuple(a * block.length[:, :, None] for block, a in zip(self.blocks, shape.angles, strict=True)),
            energies=tuple(force * centres + moment * angles for force, centres, moment, angles in parts),
            modal_mass=modal_mass,
            momentum=self.cart.stiffness * shape.cart / x if self.cart else self._momentum(x, shape),
            residual=np.abs(missed / modal_mass / x),
        )

    def _momentum(self, x: Floats, shape: _Shape) -> Floats:
        """Total momentum, from the first moment about the pivot, where nothing cancels."""
        momentum: Floats = (eliminated(self.blocks[0], x).moment[0] * shape.angles[0][0]).sum(0)
        return momentum

    def _solved(self, rows: Ints) -> tuple[_Shape, Floats]:
        """Shapes of these modes, largest angle 1, and φᵀMφ times the error of their Rayleigh quotients, (R,)."""
        near = self._clusters
        members = np.flatnonzero(np.isin(near, near[rows]))
        x, places = self.squares[members], members - np.searchsorted(near, near[members])
        pivots = [eliminated(block, x) for block in self.blocks]
        loads = self._first(places)
        for _ in range(ITERATIONS):
            shape = self._answer(pivots, x, loads)
            largest = np.max([np.abs(angles).max((0, 1)) for angles in shape.angles], axis=0)
            shape = shape.scaled(1 / largest)
            missed = _product(loads, shape) / largest
            for k in np.flatnonzero(places).tolist():
                self._make_orthogonal(shape, k, int(places[k]))
            loads = self._inertial(shape)
        shape.cart[:] = np.where(self._still(shape, near[members]), 0.0, shape.cart)
        at = np.searchsorted(members, rows)
        return shape.take(at), missed[at]

    def _still(self, shape: _Shape, near: Ints) -> Booleans:
        """Whether the cart moves no more than rounding in the orthogonalization of a cluster (R,)."""
        several = np.bincount(near)[near] > 1
        return several & (np.abs(shape.cart) <= CANCELLED * self.n_modes)

    @cached_property
    def _clusters(self) -> Ints:
        """Cluster numbers of the modes (R,), equal where inverse iteration alone cannot separate their shapes."""
        x = self.squares
        apart = np.diff(x) > CLOSE * np.minimum(np.abs(x[1:]), np.abs(x[:-1]))
        numbers: Ints = np.concatenate([[0], np.cumsum(apart)])
        return numbers

    def _make_orthogonal(self, shape: _Shape, k: int, place: int) -> None:
        """Make column k orthogonal in M to the `place` columns before it, in place."""
        for before in range(k - place, k):
            other = shape.take(np.array([before]))
            loads = self._inertial(other)
            shape.subtract(k, other, _product(loads, shape.take(np.array([k]))) / _product(loads, other))

    def _first(self, places: Ints) -> _Loads:
        """Starting loads for each place in a cluster, scaled to every link's own size and reproducible."""
        random = np.random.default_rng(0)
        sizes = [np.sqrt(block.diagonal)[:, :, None] for block in self.blocks]
        every = range(int(places.max(initial=0)) + 1)
        drawn = [[size[:, :, 0] * random.uniform(0.5, 1.0, size.shape[:2]) for size in sizes] for _ in every]
        moment = tuple(np.stack(parts, axis=-1)[:, :, places] for parts in zip(*drawn, strict=True))
        cart = np.full(len(places), np.sqrt(self.cart.mass + self._hanging) if self.cart else 0.0)
        return _Loads(tuple(map(np.zeros_like, moment)), moment, cart)

    def _answer(self, chains: list[EliminatedChain], x: Floats, loads: _Loads) -> _Shape:
        """(K − x M)⁻¹ of these loads."""
        parts = zip(self.blocks, chains, loads.force, loads.moment, strict=True)
        felt, pivots = zip(*(gathered(block, chain, x, *load) for block, chain, *load in parts), strict=True)
        cart = np.zeros(len(x))
        if self.cart:
            mass = self.cart.mass + sum(chain.mass[0].sum(0) for chain in chains)
            stiffness = self.cart.stiffness - x * mass
            stiffness = np.where(stiffness == 0, -NUDGE * (self.cart.stiffness + np.abs(x) * self._hanging), stiffness)
            cart = (loads.cart + sum(pivot.sum(0) for pivot in pivots)) / stiffness
        moved = zip(self.blocks, chains, felt, strict=True)
        angles, centres = zip(
            *(descended(block, chain, x, felt_by, cart) for block, chain, felt_by in moved), strict=True
        )
        return _Shape(angles, centres, cart)

    def _inertial(self, shape: _Shape) -> _Loads:
        """M φ."""
        return _Loads(
            tuple(b.mass[:, :, None] * centres for b, centres in zip(self.blocks, shape.centres, strict=True)),
            tuple(b.inertia[:, :, None] * angles for b, angles in zip(self.blocks, shape.angles, strict=True)),
            (self.cart.mass if self.cart else 0.0) * shape.cart,
        )


def _product(loads: _Loads, shape: _Shape) -> Floats:
    """The work (R,) of the loads on a shape."""
    work: Floats = loads.cart * shape.cart
    for force, centres, moment, angles in zip(loads.force, shape.centres, loads.moment, shape.angles, strict=True):
        work = work + (force * centres + moment * angles).sum((0, 1))
    return work
