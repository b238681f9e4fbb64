"""Sets that provably contain a motion, step by step: Taylor series in ball arithmetic (python-flint).

At a time t the set is m + C r with m in many digits, C orthogonal and r a vector of balls [Lohner1988].  Within a step

    y(t + τ) = Σ c_k τᵏ + (Σ V_k τᵏ) C r + remainder,

c_k and V_k the Taylor coefficients of the motion from m and of its derivatives by m.  The remainder follows from one
disc |τ| ≤ ρ of the complex plane: if the motions from all starts within σ_i of m_i are analytic on it and differ
from m_i by at most R_i, then by Cauchy's inequality, in τ and in the start, with q = |τ|/ρ and s the largest
|(C r)_i|/σ_i, the remainder of component i is at most

    R_i (q^{N+1}/(1 − q) + s q^{K+1}/(1 − q) + s²/(1 − s))

after N terms c_k and K terms V_k.  The disc is found ring by ring: with p a polynomial of some c_k and |e_i| ≤ E_i
at the inner edge of a ring of width w, e' = f(p + e) − p' gives E_i + w sup |f_i(p + e) − p_i'| at the outer edge, if
the supremum over sectors of the ring, for |e| within this bound, shows it [Tucker2011].
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cache, cached_property
from math import ceil, exp, log, log2
from typing import Any

import numpy as np

from modal.errors import ComputationError
from modal.exact import flint as import_flint
from nonlinear.dynamics import Generated, jacobian_of, module_of
from nonlinear.dynamics.text import FUNCTIONS

Ball = Any
"""A ball `arb` of python-flint; in functions of the equations also an `acb`, or a power series of balls."""


flint = cache(import_flint)


class UndecidedError(ArithmeticError):
    """A function that is not analytic on all of a set."""


def _root(x: Ball) -> Ball:
    return x.sqrt(analytic=True) if isinstance(x, flint().acb) else x.sqrt()


def _logarithm(x: Ball) -> Ball:
    return x.log(analytic=True) if isinstance(x, flint().acb) else x.log()


def _arctangent(x: Ball) -> Ball:
    if isinstance(x, flint().acb) and not abs(x.imag) < 1:
        raise UndecidedError
    return x.atan()


def _where(x: Ball, a: Ball, b: Ball) -> Ball:
    """The branch by the sign of the real part, which all of the set must have."""
    ball = x.real if isinstance(x, flint().acb) else x[0] if isinstance(x, flint().arb_series) else flint().arb(x)
    if ball > 0:
        return a
    if ball < 0:
        return b
    raise UndecidedError


FUNCTIONS["balls"] = {
    "sin": lambda x: x.sin(),
    "cos": lambda x: x.cos(),
    "exp": lambda x: x.exp(),
    "tanh": lambda x: 1 - 2 / ((2 * x).exp() + 1),
    "sqrt": _root,
    "log": _logarithm,
    "arctan": _arctangent,
    "where": _where,
}


class BallEquations:
    """The written equations of motion with functions and constants in balls of this many bits."""

    def __init__(self, equations: Generated, bits: int) -> None:
        form, system = equations.form, equations.system
        rates, (slopes, self._rows, self._columns) = module_of(form), jacobian_of(form)
        with flint().ctx.workprec(bits):
            balls = [flint().arb(number) for number in equations.numbers]
            self._rates = rates.function("rates", rates.constants(balls, "balls"), "balls")
            self._slopes = slopes.function("jacobian", slopes.constants(balls, "balls"), "balls")
        self.size, self.mechanical = equations.layout.size, 2 * equations.layout.half
        self.is_timed = bool(rates.sizes.get("u"))
        self.units = equations.layout.natural(system).tolist()

    def rates(self, y: Sequence[Ball], time: Ball) -> list[Ball]:
        """The rates y' of a state."""
        return list(self._rates(y, [time] * self.is_timed))

    def motion_series(self, m: Sequence[Ball], time: Ball, order: int) -> list[list[Ball]]:
        """The Taylor coefficients c_0 … c_order of every component of the motion from m."""
        arb_series, ctx = flint().arb_series, flint().ctx
        c = [[value] for value in m]
        for k in range(order):
            ctx.cap = k + 1
            for row, rate in zip(c, self.rates(_series_of(c), arb_series([time, 1])), strict=True):
                row.append(_coefficient(rate, k) / (k + 1))
        return c

    def derivative_series(self, c: Sequence[Sequence[Ball]], time: Ball, order: int) -> list[Ball]:
        """The Taylor coefficients V_0 … V_order, matrices, of the derivatives of the motion by its start."""
        arb, arb_mat, n = flint().arb, flint().arb_mat, self.size
        flint().ctx.cap = order
        series = _series_of([row[:order] for row in c])
        entries = self._slopes(series, [flint().arb_series([time, 1])] * self.is_timed)[n:]
        jacobians = []
        for k in range(order):
            matrix = [[arb(0)] * n for _ in range(n)]
            for i, j, entry in zip(self._rows.tolist(), self._columns.tolist(), entries, strict=True):
                matrix[i][j] = _coefficient(entry, k)
            jacobians.append(arb_mat(matrix))
        V = [arb_mat(n, n, [int(i == j) for i in range(n) for j in range(n)])]
        for k in range(order):
            total = jacobians[0] * V[k]
            for j in range(1, k + 1):
                total = total + jacobians[j] * V[k - j]
            V.append(total * (arb(1) / (k + 1)))
        return V


def _series_of(c: Sequence[Sequence[Ball]]) -> list[Ball]:
    return [flint().arb_series(row) for row in c]


def _coefficient(series: Ball, k: int) -> Ball:
    if isinstance(series, flint().arb_series):
        return series[k]
    return flint().arb(series if k == 0 else 0)


@dataclass(frozen=True)
class Disc:
    """A disc |τ| ≤ ρ (s) on which all motions from starts within σ of m are analytic and differ from m by at most R."""

    rho: Ball
    R: list[Ball]
    sigma: list[Ball]


@dataclass(frozen=True)
class DiscSearch:
    """How a disc is sought: rings of an expected radius in this many sectors of the upper half-plane.

    The lower one has the conjugate values.  The polynomial p has so many `terms`.
    """

    equations: BallEquations
    sectors: int = 8
    rings: int = 8
    terms: int = 14
    rings_max: int = 40

    @cached_property
    def directions(self) -> list[Ball]:
        """A ball around the directions of every sector."""
        arb, acb = flint().arb, flint().acb
        half = arb.pi() / (2 * self.sectors)
        angles = [half * (2 * k + 1) + arb(0, 1) * half.upper() for k in range(self.sectors)]
        return [acb(angle.cos(), angle.sin()) for angle in angles]

    def largest(self, c: Sequence[Sequence[Ball]], time: Ball, radius: float, deviations: Sequence[float]) -> Disc:
        """The largest disc that is found where about this radius (s) is expected; raise UndecidedError if none is."""
        with flint().ctx.workprec(53):
            return self._grown(c, time, radius, deviations)

    def _grown(self, c: Sequence[Sequence[Ball]], time: Ball, radius: float, deviations: Sequence[float]) -> Disc:
        arb, acb = flint().arb, flint().acb
        p = [[acb(value) for value in row[: self.terms]] for row in c]
        rates = [[k * value for k, value in enumerate(row)][1:] for row in p]
        sigma = []
        for row, unit, deviation in zip(p, self.equations.units, deviations, strict=True):
            size = sum(float(value.abs_upper()) * radius**k for k, value in enumerate(row) if k)
            sigma.append(arb(max(size / 32, unit / 512, 1024 * deviation)))
        width, disc, bounds = arb(radius) / self.rings, Disc(arb(0), sigma, sigma), sigma
        for _ in range(self.rings_max):
            try:
                bounds, R = self._ring(p, rates, time, disc, width, bounds)
            except (ArithmeticError, ValueError):
                break
            disc = Disc(disc.rho + width, R, sigma)
        if not disc.rho > 0:
            raise UndecidedError
        return disc

    def _ring(
        self,
        p: Sequence[Sequence[Ball]],
        rates: Sequence[Sequence[Ball]],
        time: Ball,
        disc: Disc,
        width: Ball,
        inner: Sequence[Ball],
    ) -> tuple[list[Ball], list[Ball]]:
        """The bounds E at the outer edge of the next ring and R on the disc with it; UndecidedError without."""
        span, outer, R = disc.rho.union(disc.rho + width), list(inner), disc.R
        for direction in self.directions:
            tau = span * direction
            places, changes = [_value(row, tau) for row in p], [_value(row, tau) for row in rates]
            bounds = self._sector(places, changes, time + tau, width, inner)
            outer = [_larger(*pair) for pair in zip(outer, bounds, strict=True)]
            distances = [abs(place - row[0]) + bound for place, row, bound in zip(places, p, bounds, strict=True)]
            R = [_larger(*pair) for pair in zip(R, distances, strict=True)]
        return outer, R

    def _sector(
        self, places: Sequence[Ball], changes: Sequence[Ball], time: Ball, width: Ball, inner: Sequence[Ball]
    ) -> list[Ball]:
        """E at the outer edge of a ring, by one sector of it."""
        guess = [bound * 1.25 for bound in inner]
        for _ in range(6):
            set_ = [place + _square(bound) for place, bound in zip(places, guess, strict=True)]
            slopes = [abs(f - change) for f, change in zip(self.equations.rates(set_, time), changes, strict=True)]
            bounds = [(bound + width * slope).upper() for bound, slope in zip(inner, slopes, strict=True)]
            if not all(bound.is_finite() for bound in bounds):
                break
            if all(bound <= assumed for bound, assumed in zip(bounds, guess, strict=True)):
                return bounds
            guess = [bound * 1.25 for bound in bounds]
        raise UndecidedError


def _square(bound: Ball) -> Ball:
    """The square of the complex plane around 0 that holds all numbers up to a bound."""
    return flint().acb(_around(bound), _around(bound))


def _larger(a: Ball, b: Ball) -> Ball:
    return a.max(b).upper()


def _value(coefficients: Sequence[Ball], at: Ball) -> Ball:
    """A polynomial by Horner's rule."""
    value = coefficients[-1]
    for coefficient in reversed(coefficients[:-1]):
        value = value * at + coefficient
    return value


@dataclass(frozen=True)
class LohnerStep:
    """The enclosure of the motion from the set m + C r at an exact time up to `length` (s) later."""

    time: Fraction
    length: Fraction
    c: list[list[Ball]]
    V: list[Ball]
    disc: Disc
    spread: Ball
    bits: int

    def image(self, tau: Ball) -> tuple[list[Ball], Ball]:
        """Balls around the image of m, with all remainders of the set, and the matrix of derivatives, after τ (s)."""
        arb, disc = flint().arb, self.disc
        q, s = tau.abs_upper() / disc.rho, arb(0)
        for k, sigma in enumerate(disc.sigma):
            s = _larger(s, self.spread[k, 0].abs_upper() / sigma)
        share = q ** len(self.c[0]) + s * q ** len(self.V)
        remainder = share / (1 - q) + s * s / (1 - s)
        with flint().ctx.workprec(self.bits):
            centres = [_value(row, tau) + _around(R * remainder) for row, R in zip(self.c, disc.R, strict=True)]
        return centres, _value(self.V, tau)

    def at(self, time: Fraction) -> list[Ball]:
        """The balls around y at an exact time (s) within the step."""
        with flint().ctx.workprec(self.bits):
            tau = _ball_of(time - self.time)
        centres, V = self.image(tau)
        spread = V * self.spread
        with flint().ctx.workprec(self.bits):
            return [centre + spread[k, 0] for k, centre in enumerate(centres)]


class LohnerSet:
    """The set m + C r at an exact time (s), and the steps that carry it on.

    It begins as a box of balls.  Terms of series are carried to `digits` digits, relative to R, in steps of e^−`decay`
    of a disc's radius; matrices have `matrix_bits`.
    """

    def __init__(
        self,
        equations: Generated,
        start: Sequence[Ball],
        time: Fraction,
        digits: int,
        *,
        decay: float = 1.6,
        matrix_bits: int = 64,
    ) -> None:
        arb_mat, n = flint().arb_mat, len(start)
        self.time, self.decay, self.matrix_bits, self.steps = time, decay, matrix_bits, 0
        self.bits = ceil((digits + 8) * log2(10))
        self.order = ceil(digits * log(10) / decay)
        self.balls = BallEquations(equations, self.bits)
        self.search = DiscSearch(self.balls)
        with flint().ctx.workprec(self.bits):
            self.m = [ball.mid() for ball in start]
            self.r = arb_mat([[ball - ball.mid()] for ball in start])
        self.C = arb_mat(np.eye(n).tolist())
        self._rho = 0.1 / equations.system.rate

    def advance(self) -> LohnerStep:
        """Carry the set on by a step; raise ComputationError if nothing encloses the motion any more."""
        cap = flint().ctx.cap
        try:
            with flint().ctx.workprec(self.matrix_bits):
                step = self._step()
                self._carry(step)
        except (ArithmeticError, ValueError):
            raise ComputationError(f"the motion cannot be enclosed beyond {float(self.time):.9g} s") from None
        finally:
            flint().ctx.cap = cap
        return step

    def _step(self) -> LohnerStep:
        with flint().ctx.workprec(self.bits):
            time = _ball_of(self.time)
            c = self.balls.motion_series(self.m, time, self.order)
        spread = self.C * self.r
        disc = self._disc(c, time, [float(spread[k, 0].abs_upper()) for k in range(len(c))])
        self._rho = float(disc.rho.mid())
        # of V the remainder is relative to the set's own size, where nine digits are plenty
        terms = ceil(9 * log(10) / self.decay) + 3
        V = self.balls.derivative_series(c, time, min(terms, self.order))
        length = Fraction(self._rho * exp(-self.decay))
        return LohnerStep(self.time, length, c, V, disc, spread, self.bits)

    def _disc(self, c: Sequence[Sequence[Ball]], time: Ball, deviations: Sequence[float]) -> Disc:
        for attempt in range(8):
            try:
                return self.search.largest(c, time, self._rho / 4**attempt, deviations)
            except UndecidedError:
                continue
        raise UndecidedError

    def _carry(self, step: LohnerStep) -> None:
        """The image of the set as another of the form m + C r, with the orthogonal factor of V C [Lohner1988]."""
        arb_mat = flint().arb_mat
        centres, V = step.image(_ball_of(step.length))
        B = V * self.C
        columns = np.array([[float(B[i, j].mid()) for j in range(len(centres))] for i in range(len(centres))])
        lengths = np.linalg.norm(columns, axis=0) * [float(self.r[k, 0].abs_upper()) for k in range(len(centres))]
        Q, _ = np.linalg.qr(columns[:, np.argsort(-lengths)])
        self.C = arb_mat(Q.tolist())
        inverse = self.C.inv()
        self.m = [centre.mid() for centre in centres]
        errors = arb_mat([[centre - centre.mid()] for centre in centres])
        self.r = (inverse * B) * self.r + inverse * errors
        self.time, self.steps = step.time + step.length, self.steps + 1

    @property
    def radius(self) -> float:
        """The largest radius of a coordinate or a rate, in SI units."""
        return float(max(float((self.C * self.r)[k, 0].abs_upper()) for k in range(self.balls.mechanical)))


def _ball_of(number: Fraction) -> Ball:
    return flint().arb(flint().fmpq(number.numerator, number.denominator))


def _around(bound: Ball) -> Ball:
    """The ball of this radius around 0."""
    return flint().arb(0, 1) * bound.upper()
