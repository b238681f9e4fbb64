"""Plain chains on one cart: different ones coupled by the secular equation, equal frequencies separated.

With the cart displaced by X, the fixed-base mode r of a pendulum follows with amplitude
x P_r X / (E_r (λ_r − x)), where P_r = φ_rᵀ b is its momentum, E_r = φ_rᵀ A φ_r and μ_r = P_r²/E_r its modal
effective mass.  Equal λ_r are one pole.  With α the residual mass of a pendulum, its momentum and twice its energy over
ω² are sums over its modes, X (α + Σ μ_r λ_r/(λ_r − x)) and X² (α + Σ μ_r λ_r²/(λ_r − x)²): nothing cancels if a light
cart moves under pendula that stay in place.

Of d fixed-base modes of one frequency, with momenta P_i and modal masses E_i, all but one leave the cart at rest.
Moving with amplitudes a_i/√E_i they push it with Σ a_i p_i, p_i = P_i/√E_i; the combinations orthogonal to p,

    a^(k) = (p_1 p_{k+1}, …, p_k p_{k+1}, −s_k, 0, …)/√(s_k s_{k+1}),    s_k = p_1² + … + p_k²,    k = 1 … d − 1,

leave it at rest, are orthonormal, and for equal pendula become (1, −1, 0, …)/√2, (1, 1, −2, 0, …)/√6, … The mode that
moves the cart corresponds to a single pole of weight Σ p_i².
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from modal.assembly import Block, CartNumbers, Rig
from modal.eigen.amplitude import quartic
from modal.eigen.chains import ChainShapes, cart_shapes, fixed_shapes
from modal.eigen.recursion import Suspension, at_infinity, joints, kinetic
from modal.eigen.seeds import seed_matrices
from modal.eigen.sources import Details, ProblemSize, chain_details, noun_count, oscillating, structured_error
from modal.eigen.squares import CLOSE, EVERYTHING, Limits, Squares, squares_of
from modal.report import deferred
from modal.types import NOISE_OF_TERMS, NUMBERS_IN_CHUNK, Complexes, Floats, Ints

if TYPE_CHECKING:
    from modal.eigen.secular import Poles, Roots

LIGHTEST = 1e-290
"""Tolerance: least weight of a pole: a lighter one changes no digit of any root, and its products underflow."""
MOST_LINKS_TOGETHER = 600
"""Cost: links on a cart up to which counts find modes, the secular equation those of more (benchmarks/modes.py)."""


@dataclass(frozen=True, eq=False)
class DegenerateModes:
    """The fixed-base modes of all kinds, clustered by equal frequencies.

    `order` (K,) sorts the modes, counted block by block, mode by mode, column by column; cluster c consists of
    `size[c]` of them from `first[c]` on and has the square `square[c]`, that of its lowest member; all (C,). `rounded`
    says whether the members of any cluster differ in their last digits.
    """

    order: Ints
    first: Ints
    size: Ints
    square: Floats
    has_rounding: bool

    @property
    def inside(self) -> Ints:
        """Gaps inside clusters, as indices into the gaps between all K modes; each has a mode of that square."""
        inner = np.ones(len(self.order), dtype=np.bool_)
        inner[self.first] = False
        return np.flatnonzero(inner) - 1

    @property
    def closest(self) -> float:
        """The smallest relative gap between two different squares."""
        return float((np.diff(self.square) / self.square[1:]).min(initial=1.0))

    @property
    def shared_clusters(self) -> Ints:
        """Clusters with more than one member."""
        return np.flatnonzero(self.size > 1)


def degenerate_modes(squares: tuple[Floats, ...]) -> DegenerateModes:
    """Clusters of the squares (n, P) of every block."""
    flat = np.concatenate([square.ravel() for square in squares])
    order = np.argsort(flat, kind="stable")
    ascending = flat[order]
    is_first = np.diff(ascending, prepend=-1.0) > NOISE_OF_TERMS * ascending
    starts = np.append(np.flatnonzero(is_first), len(flat))
    for cluster in np.flatnonzero(np.diff(starts) > 2):
        first, last = (int(end) for end in starts[cluster : cluster + 2])
        while (
            first := int(np.searchsorted(ascending[:last], ascending[first] * (1 + NOISE_OF_TERMS), "right"))
        ) < last:
            is_first[first] = True
    starts = np.flatnonzero(is_first)
    sizes = np.diff(starts, append=len(flat))
    has_rounding = bool(np.any(ascending[starts] != ascending[starts + sizes - 1]))
    return DegenerateModes(order, starts, sizes, ascending[starts], has_rounding)


@dataclass(frozen=True, eq=False)
class CartPendula:
    """The modes of one heavy pendulum of each kind, all of them plain, and the cart.

    `fixed_squares` are the squares (n, P) of every block on a fixed support if there are different kinds. Few links use
    eigenvalue counts; many different kinds, and the shapes of close modes, the secular equation.
    """

    rig: Rig
    fixed_squares: tuple[Floats, ...] = ()
    limits: Limits = EVERYTHING
    is_damped = False

    @property
    def cart(self) -> CartNumbers:
        """The cart."""
        assert self.rig.cart is not None
        return self.rig.cart

    @cached_property
    def blocks(self) -> tuple[Block, ...]:
        """The chains, their counts folded into their masses."""
        return tuple(block.heavier(block.count) for block in self.rig.blocks)

    @cached_property
    def clusters(self) -> DegenerateModes:
        """The fixed-base modes of different kinds."""
        return degenerate_modes(self.fixed_squares)

    @cached_property
    def secular_equation(self) -> CoupledPendula:
        """The secular equation."""
        return CoupledPendula(self.blocks, self.cart, self.fixed_squares, self.clusters)

    @property
    def _links(self) -> int:
        return sum(block.mass.size for block in self.blocks)

    @property
    def _spring_count(self) -> int:
        """1 if a spring holds the cart."""
        return int(self.cart.stiffness > 0)

    @property
    def n_modes(self) -> int:
        """Number of oscillatory modes: a free cart's rigid translation is a coordinate, but not one of these."""
        return self._links + self._spring_count - self.is_singular

    @property
    def _are_few(self) -> bool:
        return not self.fixed_squares or self._links <= MOST_LINKS_TOGETHER

    @cached_property
    def _are_apart(self) -> bool:
        if not self.fixed_squares:
            return True
        return self._are_few and self.clusters.closest > CLOSE and not self.clusters.shared_clusters.size

    @cached_property
    def bare_mass(self) -> float:
        """The dynamic mass of the cart at infinite frequency; 0 if M is singular."""
        return bare_mass(self.blocks, self.cart)

    @property
    def is_singular(self) -> bool:
        """Whether M is singular: a massless cart over bobs has no inertia."""
        return not self.cart.mass and self.bare_mass == 0

    @property
    def accelerance(self) -> float:
        """Σ φ_x² over all finite modes (1/kg): (M⁻¹)_xx = 1/α, or γ/β² where M is singular (see `at_infinity`)."""
        if not self.is_singular:
            return 1.0 / self.bare_mass
        _, beta, gamma = (float(sum(map(np.sum, parts))) for parts in zip(*map(at_infinity, self.blocks), strict=True))
        stiffness = float(self.cart.stiffness) + beta
        return gamma / stiffness / stiffness

    @property
    def route(self) -> str:
        """The secular equation for many different kinds, dense where that is accurate enough, or the effective mass."""
        return self.oscillating.route if self._are_few else "secular equation"

    @property
    def problem_size(self) -> ProblemSize:
        """All chains and the cart, or the distinct fixed-base modes of the pendula."""
        seeds = seed_matrices(self._links, 1) if self._are_few else ()
        if self._are_apart:
            return ProblemSize(f"cart and {noun_count(self._links, 'link')}", 1, self._links + 1, seeds)
        poles, shapes = len(self.clusters.first), vars(self.secular_equation).get("modes", ())
        shape_sizes = tuple(("own shapes", b.n, b.size) for b, _ in zip(self.blocks, shapes, strict=False) if b.n > 1)
        return ProblemSize(f"cart and {noun_count(poles, 'pole')}", 1, poles + 1, (*seeds, *shape_sizes))

    @cached_property
    def oscillating(self) -> Squares:
        """ω² (R,) of the oscillatory modes that move the cart, ascending, within the limits."""
        if self.limits.squares is not None:
            return Squares.exact(self.limits.squares)
        if not self._are_few:
            return Squares.exact(self.secular_equation.squares)
        limits, indices = self.limits, np.arange(self.n_modes)
        if not self._are_apart:
            limits, indices = EVERYTHING, np.delete(indices, self.clusters.inside + self._spring_count)
        suspension = Suspension.on_cart(self.blocks, self.cart)
        x, error = squares_of(suspension, indices[: limits.lowest], self.n_modes, limits.accuracy)
        return Squares(x[:, 0], error[:, 0])

    @property
    def squares(self) -> Floats:
        """ω² (R,)."""
        return self.oscillating.x

    @cached_property
    def eigenvalue(self) -> Complexes:
        """iω."""
        return oscillating(self.squares)

    @property
    def error(self) -> Floats:
        """Relative error bounds."""
        rounding = self.rounding if self._are_few else 4 * self.rounding  # a zero of a sum has those of all its terms
        return self.oscillating.error / 2 + rounding

    @property
    def rounding(self) -> float:
        """The bound of one recursion."""
        deepest, chains = max(block.n for block in self.blocks), sum(block.size for block in self.blocks)
        return structured_error(deepest, chains)

    def details(self, rows: Ints) -> Details:
        """Return shapes in which all copies of a kind move alike."""
        x = self.squares[rows]
        if self._are_apart:
            return self.describe(x, cart_shapes(self.blocks, self.cart, x))
        return self.describe(x, self.secular_equation.shapes(rows, x))

    def describe(self, x: Floats, motion: ChainShapes) -> Details:
        """Return the properties of shapes at x (R,)."""
        angles = tuple(a * (b.sigma / b.length)[:, :, None] for a, b in zip(motion.turns, self.blocks, strict=True))
        parts = [quartic(b, x, motion.cart, angle).sum(0) for b, angle in zip(self.blocks, angles, strict=True)]
        copies = (part / block.count[:, None] for part, block in zip(motion.energies, self.rig.blocks, strict=True))
        return chain_details(motion, x, angles, np.sum(parts, axis=0), tuple(copies), self.accelerance)


@dataclass(frozen=True, eq=False)
class StillModes:
    """The modes of different pendula that together leave the cart at rest; a row is a cluster and a vector in it."""

    pendula: CartPendula
    route = "effective mass"
    is_damped = is_singular = False
    problem_size = ProblemSize("equal frequencies of different pendula", 1, 0)

    @property
    def clusters(self) -> DegenerateModes:
        """The fixed-base modes."""
        return self.pendula.clusters

    @cached_property
    def folds(self) -> Ints:
        """The number of vectors of each shared cluster."""
        return self.clusters.size[self.clusters.shared_clusters] - 1

    @property
    def squares(self) -> Floats:
        """ω² of every row."""
        return np.repeat(self.clusters.square[self.clusters.shared_clusters], self.folds)

    @cached_property
    def eigenvalue(self) -> Complexes:
        """iω."""
        return oscillating(self.squares)

    @property
    def error(self) -> Floats:
        """Relative error bounds."""
        return np.full(len(self.squares), self.pendula.rounding)

    def details(self, rows: Ints) -> Details:
        """Shapes of these rows."""
        blocks = self.pendula.blocks
        turns, energies = ([np.zeros((*b.mass.shape, len(rows))) for b in blocks] for _ in range(2))
        residual = np.zeros(len(rows))
        ends = np.cumsum(self.folds)
        for at, row in enumerate(rows):
            group = int(np.searchsorted(ends, row, side="right"))
            members = self._members(int(self.clusters.shared_clusters[group]))
            number = int(row - ends[group] + self.folds[group])
            for member, amplitude in zip(members, _combination(members, number), strict=False):
                turns[member.block][:, member.column, at] = amplitude * member.turn
                energies[member.block][:, member.column, at] = amplitude**2 * member.energy
                residual[at] = max(residual[at], member.residual)
        zero = np.zeros(len(rows))
        motion = ChainShapes(zero, tuple(turns), tuple(energies), zero + 1.0, zero, residual)
        return self.pendula.describe(self.squares[rows], motion)

    def _members(self, cluster: int) -> list[_Member]:
        """The modes in a cluster, each of modal mass 1, the one with the largest momentum first."""
        first, size = int(self.clusters.first[cluster]), int(self.clusters.size[cluster])
        places = np.sort(self.clusters.order[first : first + size])
        members, offset = [], 0
        for index, block in enumerate(self.pendula.blocks):
            local_places = places[(places >= offset) & (places < offset + block.mass.size)] - offset
            columns = local_places % block.size
            motion = fixed_shapes(block.take(columns), np.full(len(local_places), self.clusters.square[cluster]))
            scale = 1 / np.sqrt(motion.modal_mass)
            members += [
                _Member(
                    block=index,
                    column=int(column),
                    momentum=float(motion.momentum[k] * scale[k]),
                    turn=motion.turns[0][:, 0, k] * scale[k],
                    energy=motion.energies[0][:, 0, k] * scale[k] ** 2,
                    residual=float(motion.residual[k]),
                )
                for k, column in enumerate(columns)
            ]
            offset += block.mass.size
        return sorted(members, key=lambda member: -abs(member.momentum))


class _Member(NamedTuple):
    """A pendulum's fixed-base mode of modal mass 1: its momentum p, turns and energies (n,)."""

    block: int
    column: int
    momentum: float
    turn: Floats
    energy: Floats
    residual: float


def _combination(members: list[_Member], number: int) -> Floats:
    """The amplitudes a^(number + 1) of the first number + 2 members."""
    p = np.array([member.momentum for member in members[: number + 2]])
    p = p / abs(p[0]) if p[0] else np.ones_like(p)
    s = np.cumsum(p * p)
    amplitudes: Floats = np.append(p[:-1] * p[-1], -s[-2]) / np.sqrt(s[-2]) / np.sqrt(s[-1])
    return amplitudes


class _Own(NamedTuple):
    """A block's fixed-base modes: momenta and modal masses (n modes, P), turns (n links, n modes, P)."""

    momentum: Floats
    modal_mass: Floats
    turn: Floats


@dataclass(frozen=True, eq=False)
class CoupledPendula:
    """Chains that share a cart, counts folded into their masses, with their squares `fixed_squares` (n, P)."""

    blocks: tuple[Block, ...]
    cart: CartNumbers
    fixed_squares: tuple[Floats, ...]
    clusters: DegenerateModes

    @cached_property
    def modes(self) -> tuple[_Own, ...]:
        """Fixed-base modes of every block."""
        return tuple(_own_modes(block, square) for block, square in zip(self.blocks, self.fixed_squares, strict=True))

    @cached_property
    def poles(self) -> Poles:
        """One pole for each cluster, after that of the spring."""
        pairs = zip(self.modes, self.fixed_squares, strict=True)
        weight = np.concatenate([(modes.momentum**2 / modes.modal_mass * x).ravel() for modes, x in pairs])
        weight = np.maximum(np.add.reduceat(weight[self.clusters.order], self.clusters.first), LIGHTEST)
        square, spring = self.clusters.square, self.cart.stiffness
        if spring > 0:
            square, weight = np.append(0.0, square), np.append(spring, weight)
        poles: Poles = deferred("modal.eigen.secular:Poles")(square, weight, bare_mass(self.blocks, self.cart))
        return poles

    @cached_property
    def roots(self) -> Roots:
        """The modes that move the cart, as offsets from the nearest pole."""
        roots: Roots = deferred("modal.eigen.secular:solve")(self.poles)
        return roots

    @cached_property
    def squares(self) -> Floats:
        """ω² of every mode that moves the cart, ascending."""
        return self.poles.square[self.roots.anchor] + self.roots.offset

    def shapes(self, rows: Ints, x: Floats) -> ChainShapes:
        """Shapes of these modes, whose squares are known to be x (R,)."""
        amplitudes = [
            (modes.momentum / modes.modal_mass)[..., None] * x / distance
            for modes, distance in zip(self.modes, self._distances(rows), strict=True)
        ]
        cart = 1.0 / np.maximum(1.0, np.max([np.abs(part).max((0, 1)) for part in amplitudes], axis=0))
        turns = tuple(
            np.einsum("imp,mpr->ipr", modes.turn, part * cart)
            for modes, part in zip(self.modes, amplitudes, strict=True)
        )
        momenta, twice = (self._sums(rows, cart, power) for power in (1, 2))
        energies = tuple(
            _rescale(kinetic(block, joints(cart, a), a), known_sum)
            for block, a, known_sum in zip(self.blocks, turns, twice, strict=True)
        )
        modal_mass = self.cart.mass * cart**2 + sum(part.sum((0, 1)) for part in energies)
        momentum = self.cart.stiffness / x * cart
        push = self.cart.mass * cart + sum(part.sum(0) for part in momenta) - momentum
        return ChainShapes(cart, turns, energies, modal_mass, momentum, np.abs(push * cart) / modal_mass)

    def _sums(self, rows: Ints, cart: Floats, power: int) -> list[Floats]:
        """Xᵖ (α + Σ μ_r (λ_r/(λ_r − x))ᵖ) of every pendulum for a power p, for each block (P, R); X is `cart` (R,)."""
        sums = []
        for block, modes, squares, distance in zip(
            self.blocks, self.modes, self.fixed_squares, self._distances(rows), strict=True
        ):
            weight = (modes.momentum**2 / modes.modal_mass)[..., None]
            residual_mass, amplitude = at_infinity(block)[0][:, None], squares[..., None] * (cart / distance)
            sums.append(residual_mass * cart**power + (weight * amplitude**power).sum(0))
        return sums

    def _distances(self, rows: Ints) -> list[Floats]:
        """λ_r − x of every fixed-base mode, for each block (n modes, P, R), with full relative accuracy."""
        anchor, offset = self.roots.anchor[rows], self.roots.offset[rows]
        square = self.poles.square[len(self.poles.square) - len(self.clusters.first) :]
        gaps = square[:, None] - self.poles.square[anchor] - offset
        distance = np.empty((len(self.clusters.order), len(rows)))
        distance[self.clusters.order] = np.repeat(gaps, self.clusters.size, axis=0)
        ends = np.cumsum([squares.size for squares in self.fixed_squares])[:-1]
        parts = zip(np.split(distance, ends), self.fixed_squares, strict=True)
        return [part.reshape(*squares.shape, len(rows)) for part, squares in parts]


def bare_mass(blocks: tuple[Block, ...], cart: CartNumbers) -> float:
    """m_c + Σ residual masses."""
    return float(cart.mass) + float(sum(at_infinity(block)[0].sum() for block in blocks))


def _own_modes(block: Block, square: Floats) -> _Own:
    """The fixed-base modes, computed with a bounded amount of memory in addition to the results."""
    column, x = np.broadcast_to(np.arange(block.size), square.shape).ravel(), square.ravel()
    step = max(1, NUMBERS_IN_CHUNK // block.n)

    def solve_part(part: slice) -> tuple[Floats, Floats, Floats]:
        motion = fixed_shapes(block.take(column[part]), x[part])
        return motion.momentum, motion.modal_mass, motion.turns[0][:, 0]

    pieces = [solve_part(slice(start, start + step)) for start in range(0, x.size, step)]
    momentum, modal_mass, turn = (np.concatenate(parts, axis=-1) for parts in zip(*pieces, strict=True))
    shape = square.shape
    return _Own(momentum.reshape(shape), modal_mass.reshape(shape), turn.reshape(block.n, *shape))


def _rescale(energies: Floats, known_sum: Floats) -> Floats:
    """A chain's energies link by link (n, P, R), rescaled to their known sum (P, R)."""
    total = energies.sum(0)
    return energies * np.where(total > 0, known_sum / np.where(total > 0, total, 1.0), 0.0)
