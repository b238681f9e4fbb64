"""The count of `modal.eigen.recursion` in ball arithmetic (python-flint): every sign it reports is proved.

With x = ω² an exact number, t = x/k and every constant a ball, each μ occurs once in

    D = 1 − t (r + μ),    μ' = p − 1/t + (1 + t q)²/(t D),

so the balls grow no faster than the rounding does.  Where a sign remains undecided the precision is doubled.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from importlib import import_module
from typing import Any

from modal import pair
from modal.errors import ComputationError, MissingExtraError
from modal.scene import AnyLink, Cart, Fixed

Ball = Any
Links = tuple[AnyLink, ...]

MOST_BITS = 1 << 17
NEWTON_STEPS = 8


class _UndecidedError(ArithmeticError):
    """A ball contains zero where a sign is needed."""


@dataclass(frozen=True, eq=False)
class HungInBalls:
    """Chains on one support, each representing a number of equal ones that move alike; floats are taken exactly."""

    gravity: float
    support: Fixed | Cart
    chains: dict[Links, int]
    _prepared: dict[int, list[tuple[list[pair.Constants], int]]] = field(default_factory=dict, repr=False)

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
        below, felt = 0, flint().arb(0)
        for links, count in self._constants(bits):
            mu = 0
            for c in reversed(links):
                D = 1 - x * (c.r + mu) / c.k
                below += _is_negative(D)
                mu = c.p - c.k / x + (c.k + c.q * x) ** 2 / (c.k * x * D)
            felt += count * mu
        if isinstance(self.support, Cart):
            spring = self.support.stiffness
            below += (not _is_negative(felt + self.support.mass - spring / x)) - (spring == 0)
        return below

    def newton(self, x: Ball, width: Ball, bits: int) -> Ball:
        """An approximate zero of the determinant near x, to be verified by the count."""
        with flint().ctx.workprec(bits):
            for _ in range(NEWTON_STEPS):
                step = 1 / self._logarithmic_derivative(x, bits)
                if not step.is_finite():
                    break
                x = (x - step).mid()
                if abs(step) < width * x:
                    break
        return x

    def _logarithmic_derivative(self, x: Ball, bits: int) -> Ball:
        """d/dx log |det(K − x M)|: Σ D_x/D, and of the mass felt by the cart."""
        total = felt = slope = flint().arb(0)
        for links, count in self._constants(bits):
            mu = mu_x = 0
            for c in reversed(links):
                D, D_x = 1 - x * (c.r + mu) / c.k, -(c.r + mu + x * mu_x) / c.k
                total += D_x / D
                w, w_x = (c.k + c.q * x) ** 2 / (c.k * x), ((c.q * x) ** 2 - c.k**2) / (c.k * x**2)
                mu_x = c.k / x**2 + (w_x - w * D_x / D) / D
                mu = c.p - c.k / x + w / D
            felt, slope = felt + count * mu, slope + count * mu_x
        if isinstance(self.support, Cart):
            spring = self.support.stiffness
            total += (slope + spring / x**2) / (felt + self.support.mass - spring / x)
        return total

    def _constants(self, bits: int) -> list[tuple[list[pair.Constants], int]]:
        """Every chain's constants as balls of this precision, and its count."""
        if bits not in self._prepared:
            self._prepared[bits] = [(constants(chain, self.gravity), count) for chain, count in self.chains.items()]
        return self._prepared[bits]


def constants(chain: Links, gravity: float) -> list[pair.Constants]:
    """The recursion's constants as balls, centre and inertia included."""
    arb = flint().arb
    mass, length = [arb(link.mass) for link in chain], [arb(link.length) for link in chain]
    parts = [link.proportions(m, l, arb) for link, m, l in zip(chain, mass, length, strict=True)]
    centre, inertia = zip(*parts, strict=True)
    return pair.constants(mass, length, centre, inertia, arb(gravity))


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
