"""Guaranteed enclosures of every natural frequency: the effective-mass count in ball arithmetic (python-flint).

The floats of the scene are taken exactly as they are stored.  A count whose signs are all decided is a proof: the
enclosure of frequency number k is a pair of trial values with at most k frequencies below one and more than k
below the other.  The starting values are double-precision frequencies, Newton's iteration on log det supplies the
digits, and where Newton fails (clusters closer than double precision) the proof falls back on bisection.

The count is that of `modal.eigen.recursion`: with x = ω² an exact number, t = x/k and every constant a ball, each μ
occurs once in

    D = 1 − t (r + μ),    μ' = p − 1/t + (1 + t q)²/(t D),

so the balls grow no faster than the rounding does; with springs or rotors at joints it is that of `modal.eigen.trees`.
Where a sign remains undecided the precision is doubled.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from decimal import Decimal
from importlib import import_module
from math import floor, log
from typing import Any

import numpy as np

from modal import pair
from modal.errors import ComputationError, MissingExtraError
from modal.report import deferred, silent
from modal.scene import AnyLink, Cart, Fixed, Pendulum, Scene, require
from modal.scene.doors import checked, checked_index
from modal.scene.features import holds_still
from modal.types import EPS, NEWTON_ROUNDS

Ball = Any
Links = tuple[AnyLink, ...]
Elimination = Callable[[list[Any], Ball], tuple[list[Ball], Ball]]
"""From the constants of a chain and x to the pivots of its links and the mass felt at the pivot."""

MOST_BITS = 1 << 17
"""Limit: bits with which a sign is decided, refused beyond: four times those of the most digits."""


class _UndecidedError(ArithmeticError):
    """A ball contains zero where a sign is needed."""


@dataclass(frozen=True, eq=False)
class ChainsInBalls:
    """Chains on one support, each representing a number of equal ones that move alike; floats are taken exactly."""

    gravity: float
    support: Fixed | Cart
    chains: dict[Links, int]
    _constants_by_bits: dict[int, list[tuple[Elimination, list[Any], int]]] = field(default_factory=dict, repr=False)

    def count(self, x: Ball, bits: int) -> int:
        """Number of oscillatory modes with ω² < x: proved, at whatever precision it takes."""
        while bits <= MOST_BITS:
            try:
                with flint().ctx.workprec(bits):
                    return self._count(x, bits)
            except _UndecidedError:
                bits *= 2
        raise ComputationError(
            f"{MOST_BITS} bits do not suffice to count the frequencies below sqrt({x.str(20)}) rad/s"
        )

    def _count(self, x: Ball, bits: int) -> int:
        pivots, cart_mass = self._eliminate(x, bits)
        total = sum(map(_is_negative, pivots))
        if cart_mass is not None and isinstance(self.support, Cart):
            total += (not _is_negative(cart_mass)) - (self.support.stiffness == 0)
        return total

    def _eliminate(self, x: Ball, bits: int) -> tuple[list[Ball], Ball | None]:
        """The pivots of all links at x, a ball or a series, and the mass felt by a cart with its own and its spring."""
        pivots, mass = list[Ball](), flint().arb(0)
        for eliminate, links, count in self._constants(bits):
            of_chain, felt = eliminate(links, x)
            pivots, mass = pivots + of_chain, mass + count * felt
        if isinstance(self.support, Cart):
            return pivots, mass + self.support.mass - self.support.stiffness / x
        return pivots, None

    def newton(self, x: Ball, width: Ball, bits: int) -> Ball:
        """An approximate zero of the determinant near x, to be verified by the count."""
        with flint().ctx.workprec(bits):
            for _ in range(NEWTON_ROUNDS):
                try:
                    step = 1 / self._logarithmic_derivative(x, bits)
                except ValueError:  # a pivot that may be 0 has no inverse
                    break
                if not step.is_finite():
                    break
                x = (x - step).mid()
                if abs(step) < width * x:
                    break
        return x

    def _logarithmic_derivative(self, x: Ball, bits: int) -> Ball:
        """d/dx log |det(K − x M)|: Σ D_x/D, and of the mass felt by the cart."""
        pivots, cart_mass = self._eliminate(flint().arb_series([x, 1], 2), bits)
        factors = pivots if cart_mass is None else [*pivots, cart_mass]
        return sum(D[1] / D[0] for D in factors)

    def _constants(self, bits: int) -> list[tuple[Elimination, list[Any], int]]:
        """How every chain is eliminated, its constants as balls of this precision, and its count."""
        if bits not in self._constants_by_bits:
            self._constants_by_bits[bits] = [
                (*constants(chain, self.gravity), count) for chain, count in self.chains.items()
            ]
        return self._constants_by_bits[bits]


def constants(chain: Links, gravity: float) -> tuple[Elimination, list[Any]]:
    """How a chain is eliminated, and the constants as balls, centre and inertia included."""
    arb = flint().arb
    mass, length = [arb(link.mass) for link in chain], [arb(link.length) for link in chain]
    parts = [link.proportions(m, l, arb) for link, m, l in zip(chain, mass, length, strict=True)]
    centre, inertia = zip(*parts, strict=True)
    if not any(link.stiffness or link.rotor_inertia for link in chain):
        return _free_links, pair.constants(mass, length, centre, inertia, arb(gravity))
    weight = [arb(gravity) * b for b in pair.first_moments(mass, length, centre)]
    joints = [(arb(link.stiffness), arb(link.rotor_inertia) * arb(link.gear_ratio) ** 2) for link in chain]
    return _joined_links, list(zip(mass, length, centre, inertia, weight, joints, strict=True))


def _free_links(links: list[Any], x: Ball) -> tuple[list[Ball], Ball]:
    """The pivots D of a chain, and its effective mass μ."""
    pivots, mu = list[Ball](), 0
    for c in reversed(links):
        D = 1 - x * (c.r + mu) / c.k
        gain = c.k + c.q * x
        mu = c.p - c.k / x + gain * gain / (c.k * x * D)
        pivots.append(D)
    return pivots, mu


def _joined_links(links: list[Any], x: Ball) -> tuple[list[Ball], Ball]:
    """The same with springs κ and rotors J at joints: `modal.eigen.trees` with s = κ − x J."""
    pivots = list[Ball]()
    mu = h = F = delta = 0
    for m, l, c, inertia, weight, (spring, J) in reversed(links):
        s, r = spring - x * J, l - c
        H = l * mu + h + m * c
        N = delta + mu * (weight - x * (inertia + m * r * r)) - x * (2 * m * r * h) + m * (weight + F - x * inertia)
        B = weight + F - x * (inertia + m * c * c + l * (l * mu + 2 * h))
        D = B + s
        mu, h, F, delta = (N + s * (mu + m)) / D, s * H / D, s * B / D, s * N / D
        pivots.append(D)
    return pivots, mu


def _is_negative(ball: Ball) -> bool:
    if ball < 0:
        return True
    if ball > 0:
        return False
    raise _UndecidedError


def flint() -> Any:
    """The python-flint module; MissingExtraError where it is not installed."""
    try:
        return import_module("flint")
    except ImportError:
        raise MissingExtraError("python-flint", "certified") from None


GUARD_BITS = 64
"""Cost: bits beyond those of the digits, with fewer of which more signs are decided at twice as many."""
MOST_DIGITS = 10_000
"""Limit: the most that `digits` may ask for."""
natural_modes = deferred("modal.modes:natural_modes")
"""Imported by a proof alone: a derivation needs polynomials of this room and no eigenvalue routine."""


@dataclass(frozen=True)
class Enclosure:
    """low ≤ ω ≤ high (rad/s), exact decimals; the number of modes that share it by symmetry, and a description."""

    low: str
    high: str
    multiplicity: int
    label: str

    def text(self) -> str:
        """The digits common to both ends, then the rest of each: 2.7175[49, 51]."""
        n_common = next((i for i, (a, b) in enumerate(zip(self.low, self.high, strict=False)) if a != b), len(self.low))
        return (
            self.low
            if self.low == self.high
            else f"{self.low[:n_common]}[{self.low[n_common:]}, {self.high[n_common:]}]"
        )


@checked
def enclose(scene: Scene, digits: int = 30, report: Callable[[float], object] = silent) -> list[Enclosure]:
    """Every natural frequency, ascending, in an interval of relative width at most 10^−digits.

    Rows of different labels may overlap: no interval proves two frequencies equal.  The rigid translation of a free
    cart is exact.  `report` is called with the fraction done.  Raises SceneError for dampers, laws of joints
    and inverted links, ComputationError where no precision decides a sign, MissingExtraError without python-flint.
    """
    checked_index("digits", digits, 1, MOST_DIGITS)
    flint()
    require(scene, "an enclosure")
    rigid = scene.cart is not None and scene.cart.stiffness == 0
    enclosures = [Enclosure("0", "0", 1, "rigid translation")] * rigid
    problems = list(_problems(scene))
    total = sum(problem.n_modes for problem in problems)
    for count, enclosure in enumerate((row for problem in problems for row in problem.enclosures(digits)), 1):
        enclosures.append(enclosure)
        report(count / total)
    return sorted(enclosures, key=lambda enclosure: Decimal(enclosure.low))


@dataclass(frozen=True, eq=False)
class _ProblemInBalls:
    """Modes of chains on one support, `multiplicity` of each by symmetry."""

    system: ChainsInBalls
    multiplicity: int
    label: str

    def enclosures(self, digits: int) -> Iterator[Enclosure]:
        """One enclosure for each mode, ascending."""
        guesses = self.guesses()
        if len(guesses) != self.n_modes:
            raise ComputationError(
                "the ratios in this scene are beyond double precision: there is no approximation to refine"
            )
        for index, guess in enumerate(guesses):
            low, high = self.bracket(index, guess, digits)
            yield Enclosure(
                _decimal(low, digits, up=False), _decimal(high, digits, up=True), self.multiplicity, self.label
            )

    @property
    def n_modes(self) -> int:
        """Number of oscillatory modes: one fewer on a free cart whose effective mass vanishes at infinite frequency."""
        links = sum(map(len, self.system.chains))
        if not isinstance(self.system.support, Cart):
            return links
        inert = self.system.support.mass > 0 or not all(map(holds_still, self.system.chains))
        return links + (self.system.support.stiffness > 0) - (not inert)

    def guesses(self) -> list[float]:
        """ω (rad/s) in double precision, from the same chains with their copies folded into their masses."""
        if self.n_modes == 0:
            return []
        pendula = tuple(
            Pendulum(links=tuple(link.heavier(n) for link in chain)) for chain, n in self.system.chains.items()
        )
        modes = natural_modes(Scene(gravity=self.system.gravity, support=self.system.support, pendulum=pendula))
        return [float(omega) for omega in np.repeat(modes.omega, modes.multiplicity) if omega > 0]

    def bracket(self, index: int, guess: float, digits: int) -> tuple[Ball, Ball]:
        """Exact trial values of ω² that provably enclose mode `index`, by Newton's iteration or else by bisection."""
        bits = int(3.33 * digits) + GUARD_BITS
        with flint().ctx.workprec(bits):
            arb = flint().arb
            width, start = arb(10) ** -digits / 4, arb(guess) ** 2
            for precision in (bits, 4 * bits):
                root = self.system.newton(start, width, precision)
                low, high = (root * (1 - width)).mid(), (root * (1 + width)).mid()
                if root > 0 and self.system.count(low, bits) <= index < self.system.count(high, bits):
                    return low, high
            return self.bisect(index, start, width, bits)

    def bisect(self, index: int, start: Ball, width: Ball, bits: int) -> tuple[Ball, Ball]:
        """From a bracket expanded until proved, by near-halving (so that no trial value is special)."""
        growth = 1 + 4 * EPS
        low, high = (start / growth).mid(), (start * growth).mid()
        while self.system.count(low, bits) > index:
            growth *= growth
            low = (low / growth).mid()
        while self.system.count(high, bits) <= index:
            growth *= growth
            high = (high * growth).mid()
        while not high - low < 2 * width * low:
            middle = (low + (high - low) * 0.49951171875).mid()
            low, high = (low, middle) if self.system.count(middle, bits) > index else (middle, high)
        return low, high


def _problems(scene: Scene) -> Iterator[_ProblemInBalls]:
    """The modes that move the cart, and those of every different pendulum with the support at rest."""
    counts: dict[Links, int] = {}
    names: dict[Links, int] = {}
    position = 0
    for pendulum in scene.pendulum:
        chain = tuple(link.replace(count=1) for link in pendulum.links for _ in range(link.count))
        counts[chain] = counts.get(chain, 0) + pendulum.count
        names.setdefault(chain, position + 1)
        position += pendulum.count
    support = scene.cart or Fixed()
    on_cart = scene.cart is not None
    if on_cart:
        yield _ProblemInBalls(ChainsInBalls(scene.gravity, support, counts), 1, "cart moves")
    for chain, count in counts.items():
        multiplicity = count * (1 + (scene.space == "space")) - on_cart
        label = f"{'cart still' if on_cart else 'fixed support'}: pendulum {names[chain]}"
        if multiplicity:
            yield _ProblemInBalls(ChainsInBalls(scene.gravity, Fixed(), {chain: 1}), multiplicity, label)


def _decimal(x: Ball, digits: int, *, up: bool) -> str:
    """The square root of an exact x, rounded outward to two digits more than requested."""
    with flint().ctx.workprec(int(3.33 * digits) + GUARD_BITS):
        root = x.sqrt()
        places = digits + 1 - floor(float(root.log()) / log(10))
        scaled_root = root * flint().arb(10) ** places
        integer = int((scaled_root.upper().ceil() if up else scaled_root.lower().floor()).unique_fmpz())
    return str(Decimal((0, tuple(map(int, str(integer))), -places)))
