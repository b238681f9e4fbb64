"""Guaranteed enclosures of every natural frequency: negative pivots counted in ball arithmetic (python-flint).

The floats of the scene are taken exactly as they are stored.  By Sylvester's law of inertia [Sylvester1852] as many
pivots of K − x M are negative as there are ω² < x, with the matrices of `modal.exact.assembly`, so that a count whose
signs are all decided is a proof: the enclosure of frequency number k is a pair of trial values with at most k
frequencies below one and more than k below the other.  The starting values are double-precision frequencies, Newton's
iteration on log det supplies the digits, and where Newton fails (clusters closer than double precision) the proof falls
back on bisection.  If a sign remains undecided, the precision is doubled.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from decimal import Decimal
from fractions import Fraction
from itertools import pairwise
from math import floor, log

from modal.errors import ComputationError
from modal.exact.assembly import Assembly, Ball, BlockInBalls, flint
from modal.report import deferred, silent
from modal.scene import Scene, require
from modal.scene.doors import checked, checked_index
from modal.types import EPS, NEWTON_ROUNDS

MOST_BITS = 1 << 17
"""Limit: bits with which a sign is decided, refused beyond: four times those of the most digits."""
GUARD_BITS = 64
"""Cost: bits beyond those of the digits, with fewer of which more signs are decided at twice as many."""
MOST_DIGITS = 10_000
"""Limit: the most that `digits` may ask for."""
natural_modes = deferred("modal.modes:natural_modes")
"""Imported by a proof alone: a derivation needs polynomials of this subpackage and no eigenvalue routine."""


class _UndecidedError(ArithmeticError):
    """A ball contains zero if a sign is needed."""


class SceneInBalls:
    """The blocks of an undamped scene, at any precision that a count needs."""

    def __init__(self, scene: Scene) -> None:
        self.scene, self._blocks_by_bits = scene, dict[int, list[BlockInBalls]]()

    def blocks(self, bits: int = GUARD_BITS) -> list[BlockInBalls]:
        """All blocks as balls of this precision."""
        if bits not in self._blocks_by_bits:
            with flint().ctx.workprec(bits):
                self._blocks_by_bits[bits] = list(Assembly(self.scene).blocks())
        return self._blocks_by_bits[bits]

    def count(self, x: Fraction) -> int:
        """Number of ω² < x of the scene, including those of equal pendula and free motions: proved."""
        exact = flint().fmpq(x.numerator, x.denominator)
        return sum(block.multiplicity * self.count_in(k, exact, GUARD_BITS) for k, block in enumerate(self.blocks()))

    def count_in(self, block: int, x: Ball, bits: int) -> int:
        """Number of ω² < x of one block; x is exact."""
        while bits <= MOST_BITS:
            try:
                with flint().ctx.workprec(bits):
                    return sum(map(_is_negative, self.blocks(bits)[block].pivots(flint().arb(x))))
            except _UndecidedError:
                bits *= 2
        raise ComputationError(
            f"{MOST_BITS} bits do not suffice to count the squares of frequencies below {flint().arb(x).str(20)}"
        )

    def newton(self, block: int, x: Ball, width: Ball, bits: int) -> Ball:
        """An approximate zero of the determinant near x, to be verified by the count."""
        with flint().ctx.workprec(bits):
            for _ in range(NEWTON_ROUNDS):
                try:
                    pivots = self.blocks(bits)[block].pivots(flint().arb_series([x, 1], 2))
                    step = 1 / sum(D[1] / D[0] for D in pivots)  # of log |det|, whose slope is Σ D'/D
                except ValueError:  # a pivot that may be 0 has no inverse
                    break
                if not step.is_finite():
                    break
                x = (x - step).mid()
                if abs(step) < width * abs(x):
                    break
        return x

    def bracket(self, block: int, index: int, guess: float, digits: int) -> tuple[Ball, Ball]:
        """Exact trial values that provably enclose ω² number `index`, by Newton's iteration or else by bisection."""
        bits = int(3.33 * digits) + GUARD_BITS
        with flint().ctx.workprec(bits):
            arb = flint().arb
            width, start = arb(10) ** -digits / 4, arb(guess)
            for precision in (bits, 4 * bits):
                root = self.newton(block, start, width, precision)
                low, high = _shift(root, 1 / (1 + width)), _shift(root, 1 + width)
                if root * start > 0 and self.count_in(block, low, bits) <= index < self.count_in(block, high, bits):
                    return low, high
            return self.bisect(block, index, start, width, bits)

    def bisect(self, block: int, index: int, start: Ball, width: Ball, bits: int) -> tuple[Ball, Ball]:
        """Bisect a bracket that is expanded until proved, by near-halving (so that no trial value is special)."""
        growth = flint().arb(1 + 4 * EPS)
        low, high = _shift(start, 1 / growth), _shift(start, growth)
        while self.count_in(block, low, bits) > index:
            growth *= growth
            low = _shift(low, 1 / growth)
        while self.count_in(block, high, bits) <= index:
            growth *= growth
            high = _shift(high, growth)
        while not high - low < 2 * width * min(abs(low), abs(high)):
            middle = (low + (high - low) * 0.49951171875).mid()
            low, high = (low, middle) if self.count_in(block, middle, bits) > index else (middle, high)
        return low, high

    def guesses(self) -> tuple[int, list[tuple[int, int, float]]]:
        """The number of free motions; block, number and ω² in double precision of the others, block by block."""
        modes = natural_modes(self.scene)
        squares = -(modes.eigenvalue**2).real
        values, n_free = sorted({*squares.tolist(), 0.0}), int(modes.multiplicity[squares == 0].sum())
        edges = [low / 2 + high / 2 for low, high in pairwise(values)]
        edges.append(2.0**64 * max(map(abs, values)))  # where all have been counted
        guesses, total = list[tuple[int, int, float]](), n_free
        for k, block in enumerate(self.blocks()):
            index = 0
            for value, edge in zip(values, edges, strict=True):
                upto = max(index, self.count_in(k, edge, GUARD_BITS)) if edge else index
                free = n_free if k == 0 and value == 0 else 0  # the first block has the free motions
                numbers = range(index + free, upto)
                n_below = self.count_in(k, 0, GUARD_BITS) if value == 0 and not free and numbers else 0
                for number in numbers:
                    # Doubles took for another sign, or for 0, what a count proves to be on one side of it.
                    guesses.append((k, number, value or (-edge if number < n_below else edge)))
                total += block.multiplicity * len(numbers)
                index = max(upto, index + free)
        if total != modes.multiplicity.sum():
            raise ComputationError(
                "the ratios in this scene are beyond double precision: there is no approximation to refine"
            )
        return n_free, guesses


def _is_negative(ball: Ball) -> bool:
    if ball < 0:
        return True
    if ball > 0:
        return False
    raise _UndecidedError


def _shift(x: Ball, factor: Ball) -> Ball:
    """An exact number above x by a factor, below it for a factor below 1; on its side of 0."""
    return (x * factor if x > 0 else x / factor).mid()


@dataclass(frozen=True)
class Enclosure:
    """low ≤ ω ≤ high (rad/s), exact decimals; the number of modes that share it by symmetry, and a description.

    If the mode `is_growth`, as for inverted links, they enclose its growth rate (1/s).
    """

    low: str
    high: str
    multiplicity: int
    label: str
    is_growth: bool = False

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
    """Every natural frequency, in an interval of relative width at most 10^−digits, ascending in ω².

    Rows of different labels may overlap: no interval proves two frequencies equal. A free motion, such as the
    translation of a free cart, is exact. Under constant forces the equilibrium is enclosed first. `report` is called
    with the fraction done. Raise SceneError for dampers and joint laws, ComputationError if no precision decides a
    sign, MissingExtraError without python-flint.
    """
    checked_index("digits", digits, 1, MOST_DIGITS)
    flint()
    require(scene, "an enclosure")
    return sorted(_enclosures(SceneInBalls(scene), digits, report), key=_order)


def _enclosures(balls: SceneInBalls, digits: int, report: Callable[[float], object]) -> Iterator[Enclosure]:
    blocks, free, guesses = balls.blocks(), *balls.guesses()
    if free:
        yield Enclosure("0", "0", free, "rigid translation" if balls.scene.cart else "free motion")
    for done, (k, index, guess) in enumerate(guesses, start=1):
        ends = balls.bracket(k, index, guess, digits)
        low, high = ends if guess > 0 else ends[::-1]
        decimals = _decimal(low, digits, up=False), _decimal(high, digits, up=True)
        yield Enclosure(*decimals, blocks[k].multiplicity, blocks[k].label, guess < 0)
        report(done / len(guesses))


def _order(row: Enclosure) -> Decimal:
    return -Decimal(row.low) if row.is_growth else Decimal(row.low)


def _decimal(x: Ball, digits: int, *, up: bool) -> str:
    """The square root of |x|, rounded outward to two digits more than requested; x is exact."""
    with flint().ctx.workprec(int(3.33 * digits) + GUARD_BITS):
        root = abs(x).sqrt()
        places = digits + 1 - floor(float(root.log()) / log(10))
        scaled_root = root * flint().arb(10) ** places
        integer = int((scaled_root.upper().ceil() if up else scaled_root.lower().floor()).unique_fmpz())
    return str(Decimal((0, tuple(map(int, str(integer))), -places)))
