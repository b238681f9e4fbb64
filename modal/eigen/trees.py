"""Counts of modes of coordinates whose springs form a tree, with chains on each: every digit.

A coordinate η with its own spring k and mass m, on which chains hang that move by h η, has the dynamic stiffness

    s = k − x (m + Σ h² μ(x)) + Σ α² κ s'/(β² κ + s')

of x = ω² and the effective masses μ of `modal.eigen.recursion`, with joint springs or inverted links those
below; the last sum is over the springs κ (α η + β η')² to coordinates η' further from the root.
Chains on a support at rest are a tree without coordinates.  The number of modes below x is that of chains' D < 0, of
β²κ + s' < 0 and of s < 0 at the root (Sylvester's law of inertia). Every rounding error is equivalent to one of a
number of the scene; with inverted links gravity and springs may cancel (`Tree.slack`).

With joint springs or inverted links the part of a chain below a joint depends on the angle φ of the link above as well
as on the displacement y of the joint.  Eliminated from the free end, with x = ω², that part is the quadratic form

    −x μ y² − 2 x h y φ + F φ²,        Δ = μ F + x h²

of an effective mass μ, first moment h and stiffness F; Δ is stored apart, as it would lose its digits as a sum.  For
a link of mass m, centre c, inertia I and length l, with r = l − c, its weight G = σ g b, and the stiffness s of the
spring at its upper joint,

    H = l μ + h + m c,        N = Δ + μ (G − x (I + m r²)) − 2 x m r h + m (G + F − x I),
    B = G + F − x (I + m c² + l (l μ + 2 h)),        D = B + s,
    μ' = (N + s (μ + m)) / D,    h' = s H / D,    F' = s B / D,    Δ' = s N / D        (all 0 below the last link).

The number of D < 0 is the number of x below, negative ones included (Sylvester's law of inertia).  Without springs
this is `modal.eigen.recursion`; with them the four are the minors of a 2 × 2 form, so that a stiff spring causes no
cancellation (compound matrices: [Ng1979]). Angles are σ θ, those of the hanging chain: in these a spring acts on σ_i
θ_i − σ_i σ_{i−1} (σ_{i−1} θ_{i−1}). Shapes come from inverse iteration in the same elimination.

Arrays as in `modal.eigen.recursion`: links first, then pendula, then trial values x: (n, P, R).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from modal.assembly import Block, CartNumbers
from modal.eigen.recursion import NUDGE, Chains, Suspension, at_infinity, count_and_mass
from modal.eigen.squares import CLOSE, locate, smallest_where, upper_bounds
from modal.types import EPS, Booleans, Floats, Ints

NO_CART = CartNumbers(0.0, 0.0, 0.0)


class TreeShapes(NamedTuple):
    """R shapes (n, R) with φᵀMφ = 1, and the errors of their Rayleigh quotients over ω² (R,).

    `works` (n, P, R) are twice the kinetic energies over ω² of every group of chains, `push` (R,) their momentum along
    the rail where the coordinates are at rest.
    """

    shape: Floats
    works: tuple[Floats, ...]
    push: Floats
    residual: Floats


class HungChains(NamedTuple):
    """Chains of one length with h² copies of each folded into their masses, and the coordinate of each.

    Their angles, h times those of these chains, begin at `first` among all coordinates; all (P,).
    """

    block: Block
    places: Ints
    h: Floats
    first: Ints


@dataclass(frozen=True, eq=False)
class Tree:
    """Coordinates in an `order` (N,), the root first and each after its `parent` (N,), −1 of the root.

    `stiffness` and `mass` (N,) are their own, `spring`, `alpha` and `beta` (N,) are κ, α at the parent and β.
    """

    order: Ints
    parent: Ints
    stiffness: Floats
    mass: Floats
    spring: Floats
    alpha: Floats
    beta: Floats
    hanging_chains: tuple[HungChains, ...]

    @cached_property
    def chains(self) -> tuple[tuple[Chains | Block, Ints], ...]:
        """The constants of plain chains, or all numbers of the others, with the coordinate of each."""
        return tuple(
            (Suspension.on_cart([block], NO_CART).chains[0] if block.is_plain.all() else block, places)
            for block, places, *_ in self.hanging_chains
        )

    @property
    def is_plain(self) -> bool:
        """Whether all chains are."""
        return all(hanging.block.is_plain.all() for hanging in self.hanging_chains)

    @property
    def stands(self) -> bool:
        """Whether any link is inverted."""
        return any((hanging.block.sigma < 0).any() for hanging in self.hanging_chains)

    @property
    def free(self) -> int:
        """1 if it is free."""
        return int(len(self.mass) > 0 and not self.stiffness.any())

    @property
    def size(self) -> int:
        """Number of coordinates with those of the chains."""
        return len(self.parent) + sum(hanging.block.mass.size for hanging in self.hanging_chains)

    @cached_property
    def bare(self) -> Floats:
        """The residual mass (N,) of each coordinate."""
        bare = self.mass.copy()
        for hanging in self.hanging_chains if len(bare) else ():
            np.add.at(bare, hanging.places, at_infinity(hanging.block)[0])
        return bare

    def count(self, x: Floats) -> Ints:
        """The number of modes with 0 < ω² < x, or with ω² < x where x < 0, (R, 1) as x."""
        trial = x[:, 0]
        s, total = np.zeros((len(self.parent), len(trial))), np.where(trial > 0, -self.free, 0)
        for chains, places in self.chains:
            if isinstance(chains, Block):
                number, mass = sprung_count_and_mass(chains, trial)
            else:
                counts, masses = count_and_mass(chains, x)
                number, mass = counts[:, :, 0], masses[:, :, 0]
            total += number.sum(0)
            if len(s):
                np.add.at(s, places, mass)
        child_stiffness = np.zeros_like(s)
        for i in reversed(range(len(s))):
            stiffness, pivot, alpha_stiffness = self._pivot(i, trial, s[i], child_stiffness[i])
            total += pivot < 0
            if self.parent[i] >= 0:
                child_stiffness[self.parent[i]] += alpha_stiffness * (stiffness / pivot)
        return total[:, None]

    def _pivot(self, i: int, x: Floats, chain_mass: Floats, child_stiffness: Floats) -> tuple[Floats, Floats, float]:
        """S of a coordinate on which chains have the effective mass `chain_mass`, β²κ + s, and α²κ."""
        inertia = x * (self.mass[i] + chain_mass)
        stiffness = self.stiffness[i] - inertia + child_stiffness
        alpha_stiffness, beta_stiffness = self.spring[i] * self.alpha[i] ** 2, self.spring[i] * self.beta[i] ** 2
        pivot = beta_stiffness + stiffness
        size = self.stiffness[i] + np.abs(x) * (self.mass[i] + np.abs(chain_mass))
        size = size + np.abs(child_stiffness) + beta_stiffness
        return stiffness, np.where(pivot == 0, -NUDGE * size, pivot), float(alpha_stiffness)

    def take(self, supports: Ints | slice) -> Tree:
        """Return the tree itself: it is one problem."""
        return self

    @cached_property
    def low(self) -> Floats:
        """A trial value (1,) below all modes."""
        if self.stands:
            return np.array([np.finfo(float).tiny ** 0.5])
        stiffnesses = np.concatenate(
            [self.stiffness, self.spring, *(h.block.constants.k.ravel() for h in self.hanging_chains)]
        )
        heavy = np.concatenate([self.mass, *(hanging.block.mass.ravel() for hanging in self.hanging_chains)])
        trial = np.array([[stiffnesses[stiffnesses > 0].min() / heavy.sum()]])
        while self.count(trial)[0, 0] > 0 and trial[0, 0] > 0:
            trial = trial * EPS
        return np.asarray(trial[0])

    def squares(self, lowest: int | None) -> Floats:
        """All ω² except 0, ascending, or the lowest of them; with inverted links all, negative for growing modes."""
        modes = self.size - self.free
        indices = np.arange(modes)
        if not self.stands:
            return locate(self, indices[:lowest], modes)[:, 0] if modes else np.zeros(0)

        def count_below(x: Floats) -> Ints:
            return self.count(x[:, None])[:, 0]

        def crossings(condition: Callable[[Floats], Booleans], highest: Floats, number: int) -> Floats:
            return smallest_where(condition, *(np.broadcast_to(end, number) for end in (self.low, highest)))

        growing = int(count_below(-self.low)[0])
        top = upper_bounds(lambda u: growing - count_below(-u), self.low, np.array([growing])) if growing else self.low
        high = upper_bounds(count_below, self.low, np.array([modes]))
        negative = -crossings(lambda u: count_below(-u) <= indices[:growing], top, growing)
        return np.append(negative, crossings(lambda u: count_below(u) > indices[growing:], high, modes - growing))

    def slack(self, squares: Floats) -> Floats:
        """Factor of the error of ω over that of one recursion (R,).

        With inverted links a rounding of gravity and of each spring counts in proportion to its energy, and near the
        buckling of a link, where the elimination cancels, ω² may be off by as much as from its Rayleigh quotient.
        """
        if not self.stands:
            # the sums of a spring round as often as those of three links
            return np.full(len(squares), 1.0 if self.is_plain else 4.0)
        (eta, angles, _), _ = self._shapes(squares, np.arange(len(squares)))
        potential = self.stiffness @ eta**2
        quotient = potential
        for (block, *_), angle in zip(self.hanging_chains, angles, strict=True):
            upper_angle = np.concatenate([np.zeros_like(angle[:1]), angle[:-1]]) * turns(block)[:, :, None]
            spring = block.stiffness[:, :, None] * (angle - upper_angle) ** 2
            weight = block.b[:, :, None] * angle**2
            potential = potential + (weight + spring).sum((0, 1))
            quotient = quotient + (block.sigma[:, :, None] * weight + spring).sum((0, 1))
        return np.asarray(2 * (potential / np.abs(squares) + 1 + np.abs(quotient / squares - 1) / EPS))

    # ----------------------------------------------------------------------------------------------------- shapes

    def shapes(self, squares: Floats, rows: Ints) -> TreeShapes:
        """The shapes of these rows of all `squares`."""
        shape, residual = self._shapes(squares, rows)
        angles, (_, forces, moments) = shape[1], self._inertial(shape)
        parts = zip(forces, shape[2], moments, angles, strict=True)
        works = tuple(force * centres + moment * angle for force, centres, moment, angle in parts)
        pushes = [
            (eliminated_chain(h.block, squares[rows]).moment[0] * a[0]).sum(0)
            for h, a in zip(self.hanging_chains, angles, strict=True)
        ]
        return TreeShapes(self._component_columns(shape), works, np.sum(pushes, axis=0), residual)

    def _shapes(self, squares: Floats, rows: Ints) -> tuple[_Shape, Floats]:
        """Shapes φᵀMφ = 1 of these rows, and errors of their Rayleigh quotients over ω², (R,).

        By inverse iteration in the elimination of the counts, from loads of every link's own size.  Rows of close
        squares are computed together.
        """
        size = np.abs(squares)
        cluster = np.concatenate([[0], np.cumsum(np.diff(squares) > CLOSE * np.minimum(size[1:], size[:-1]))])
        members = np.flatnonzero(np.isin(cluster, cluster[rows]))
        x, place = squares[members], members - np.searchsorted(cluster, cluster[members])
        pivots = [eliminated_chain(hanging.block, x) for hanging in self.hanging_chains]
        random = np.random.default_rng(0)
        numbers = range(int(place.max(initial=0)) + 1)
        sizes = [np.sqrt(hanging.block.diagonal) for hanging in self.hanging_chains]
        draws = [[size * random.uniform(0.5, 1.0, size.shape) for size in sizes] for _ in numbers]
        moments = [np.stack([draw[k] for draw in draws], axis=-1)[..., place] for k in range(len(sizes))]
        random_forces = np.stack(
            [np.sqrt(self.mass) * random.uniform(0.5, 1.0, len(self.mass)) for _ in numbers], axis=1
        )
        loads = random_forces[:, place], [np.zeros_like(moment) for moment in moments], moments
        for _ in range(3):
            shape = self._answer(pivots, x, loads)
            size = np.sqrt(_work(self._inertial(shape), shape))
            shape = _scale(shape, 1 / size)
            imbalance = _work(loads, shape) / size
            for k in np.flatnonzero(place).tolist():
                for earlier in range(k - int(place[k]), k):
                    late, early = _column(shape, k), _column(shape, earlier)
                    share = _work(self._inertial(early), late)
                    for array, its in zip(_arrays(shape), _arrays(early), strict=True):
                        array[..., k] -= (its * share)[..., 0]
                last = _column(shape, k)
                size = np.sqrt(_work(self._inertial(last), last))
                for part in _arrays(shape):
                    part[..., k] /= size
            loads = self._inertial(shape)
        eta, angles, centres = shape
        swings = np.max([np.abs(part).max((0, 1)) for part in angles], axis=0, initial=0.0)
        several = np.bincount(cluster)[cluster[members]] > 1
        eta[:] = np.where(several & (np.abs(eta) <= 4 * EPS * self.size * swings), 0.0, eta)
        at = np.searchsorted(members, rows)
        selection = eta[:, at], [part[:, :, at] for part in angles], [part[:, :, at] for part in centres]
        return selection, np.abs(imbalance / x)[at]

    def _answer(self, pivots: list[EliminatedChain], x: Floats, loads: _Loads) -> _Shape:
        """(K − x M)⁻¹ of these loads."""
        parts = zip(self.hanging_chains, pivots, *loads[1:], strict=True)
        link_loads = [gather_loads(hanging.block, chain, x, *load) for hanging, chain, *load in parts]
        mass, force = np.zeros((len(self.mass), len(x))), loads[0].copy()
        for hanging, chain, (_, pivot_force) in zip(self.hanging_chains, pivots, link_loads, strict=True):
            if len(mass):
                np.add.at(mass, hanging.places, chain.mass[0])
                np.add.at(force, hanging.places, pivot_force)
        eta, child_stiffness, pivot = np.zeros_like(force), np.zeros_like(force), np.zeros_like(force)
        cross_stiffness = -self.spring * self.alpha * self.beta
        for i in reversed(range(len(eta))):
            stiffness, pivot[i], alpha_stiffness = self._pivot(i, x, mass[i], child_stiffness[i])
            if self.parent[i] >= 0:
                child_stiffness[self.parent[i]] += alpha_stiffness * (stiffness / pivot[i])
                force[self.parent[i]] += cross_stiffness[i] * force[i] / pivot[i]
        for i in range(len(eta)):
            parent_eta = eta[self.parent[i]] if self.parent[i] >= 0 else 0.0
            eta[i] = (force[i] + cross_stiffness[i] * parent_eta) / pivot[i]
        chains = zip(self.hanging_chains, pivots, link_loads, strict=True)
        rest = np.zeros(len(x))
        answers = [
            descend(hanging.block, chain, x, load, eta[hanging.places] if len(eta) else rest)
            for hanging, chain, (load, _) in chains
        ]
        return eta, [angles for angles, _ in answers], [centres for _, centres in answers]

    def _inertial(self, shape: _Shape) -> _Loads:
        """M φ: forces on coordinates, on centres, and moments."""
        eta, angles, centres = shape
        blocks = [hanging.block for hanging in self.hanging_chains]
        forces = [block.mass[:, :, None] * part for block, part in zip(blocks, centres, strict=True)]
        moments = [block.inertia[:, :, None] * part for block, part in zip(blocks, angles, strict=True)]
        return self.mass[:, None] * eta, forces, moments

    def _component_columns(self, shape: _Shape) -> Floats:
        """One column for each shape, coordinates in the order of the component."""
        eta, angles, _ = shape
        shapes = np.zeros((self.size, eta.shape[1]))
        shapes[self.order] = eta
        for hanging, part in zip(self.hanging_chains, angles, strict=True):
            for p, (first, h) in enumerate(zip(hanging.first.tolist(), hanging.h.tolist(), strict=True)):
                shapes[first : first + hanging.block.n] = h * hanging.block.sigma[:, p, None] * part[:, p]
        return shapes


_Shape = tuple[Floats, list[Floats], list[Floats]]
"""Coordinates (N, R), angles and displacements of centres (n, P, R) of every group."""
_Loads = tuple[Floats, list[Floats], list[Floats]]
"""Forces on coordinates, forces on centres and moments."""


def _arrays(shape: _Shape) -> list[Floats]:
    return [shape[0], *shape[1], *shape[2]]


def _column(shape: _Shape, k: int) -> _Shape:
    return shape[0][:, [k]], [part[:, :, [k]] for part in shape[1]], [part[:, :, [k]] for part in shape[2]]


def _scale(shape: _Shape, factor: Floats) -> _Shape:
    return shape[0] * factor, [part * factor for part in shape[1]], [part * factor for part in shape[2]]


def _work(loads: _Loads, shape: _Shape) -> Floats:
    """The work (R,) of loads on shapes."""
    work: Floats = (loads[0] * shape[0]).sum(0)
    for force, moment, angles, centres in zip(*loads[1:], *shape[1:], strict=True):
        work = work + (force * centres + moment * angles).sum((0, 1))
    return work


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
    turn_signs = turns(block)
    for i in reversed(range(block.n)):
        m, l, c, inertia, s = _link(block, i)
        r, G = l - c, (block.sigma[i] * block.b[i])[:, None]
        lm, stiffness = l * mu, G + F
        H = lm + h + m * c
        N = delta + mu * (G - x * (inertia + m * r * r)) - x * (2 * m * r * h) + m * (stiffness - x * inertia)
        B = stiffness - x * (inertia + m * c * c + l * (lm + 2 * h))
        D = B + s
        D = np.where(D == 0, -NUDGE * (np.abs(G) + s), D)
        mass_above = (N + s * (mu + m)) / D
        yield EliminatedChain(D, H, h, F, mass_above)
        ratio = s / D
        mu, h, F, delta = mass_above, turn_signs[i][:, None] * ratio * H, ratio * B, ratio * N


def eliminated_chain(block: Block, x: Floats) -> EliminatedChain:
    """All links, top first."""
    links = list(eliminate(block, x))[::-1]
    return EliminatedChain(*(np.array(values) for values in zip(*links, strict=True)))


def sprung_count_and_mass(block: Block, x: Floats) -> tuple[Ints, Floats]:
    """Number of ω² of each chain on a fixed support below each x (R,), and the mass at its pivot, (P, R)."""
    count = np.zeros((block.size, x.shape[-1]), dtype=np.int64)
    for link in eliminate(block, x):
        count += link.pivot < 0
    return count, link.mass


def inertial_mass(block: Block) -> Floats:
    """Return the residual mass (P,) at the pivots: μ of `eliminate` as x grows, with s = −x J of rotors."""
    mu, h, f, delta = np.zeros((4, block.size))
    turn_signs = turns(block)
    arrays = block.mass, block.length, block.centre, block.inertia, block.rotor, turn_signs
    for m, l, c, inertia, J, sign in zip(*(values[::-1] for values in arrays), strict=True):
        r, H = l - c, l * mu + h + m * c
        N = delta + mu * (inertia + m * r * r) + 2 * m * r * h + m * (f + inertia)
        B = f + inertia + m * c * c + l * (l * mu + 2 * h)
        D = B + J
        mu, h, f, delta = (N + J * (mu + m)) / D, sign * (J / D) * H, J / D * B, J / D * N
    return mu


def _link(block: Block, i: int) -> list[Floats]:
    """Mass, length, centre, inertia and spring of the links in row i, (P, 1) each."""
    arrays = (block.mass, block.length, block.centre, block.inertia, block.stiffness)
    return [values[i][:, None] for values in arrays]


def turns(block: Block) -> Floats:
    """σ_i σ_{i−1} (n, P), 1 at the support."""
    return np.concatenate([np.ones((1, block.size)), block.sigma[1:] * block.sigma[:-1]])


def gather_loads(
    block: Block, pivots: EliminatedChain, x: Floats, force: Floats, moment: Floats
) -> tuple[Floats, Floats]:
    """The load on each link (n, P, R) once everything below is eliminated, and the force on the pivot (P, R)."""
    link_loads, pivot = np.empty_like(moment), np.zeros(moment.shape[1:])
    joint_moment, turn_signs = pivot, turns(block)
    for i in reversed(range(block.n)):
        _, l, c, _, s = _link(block, i)
        link_loads[i] = l * pivot + joint_moment + c * force[i] + moment[i]
        pivot = pivot + force[i] + x * pivots.moment[i] * link_loads[i] / pivots.pivot[i]
        joint_moment = turn_signs[i][:, None] * s * link_loads[i] / pivots.pivot[i]
    return link_loads, pivot


def descend(
    block: Block, pivots: EliminatedChain, x: Floats, link_loads: Floats, pivot: Floats
) -> tuple[Floats, Floats]:
    """Angles and displacements of the centres (n, P, R) under the load on each link, pivots displaced (R,) or (P, R).

    The lower joint moves by y + l θ = (y (D + x l H) + l (s φ + …)) / D, in which D + x l H needs no μ.
    """
    angles, centres = np.empty_like(link_loads), np.empty_like(link_loads)
    upper_angle, turn_signs = np.zeros(link_loads.shape[1:]), turns(block)
    y = np.broadcast_to(pivot, upper_angle.shape)
    for i in range(block.n):
        m, l, c, inertia, s = _link(block, i)
        load = s * turn_signs[i][:, None] * upper_angle + link_loads[i]
        angles[i] = upper_angle = (load + x * pivots.moment[i] * y) / pivots.pivot[i]
        stiffness = (block.sigma[i] * block.b[i])[:, None] + pivots.stiffness[i] + s
        gain = stiffness + x * (m * c * (l - c) - inertia - l * pivots.first_moment[i])
        lower = (y * gain + l * load) / pivots.pivot[i]
        centres[i] = y * ((l - c) / l) + lower * (c / l)
        y = lower
    return angles, centres
