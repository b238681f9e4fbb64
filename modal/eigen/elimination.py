"""Frequency responses by elimination of K + iωD − ω²M from the tips: no digit is lost however far ω is from the modes.

A link whose upper joint is displaced by y and lower one by y + a (a = σ l θ), with r, p, q, u and J of
`modal.pair.Constants`, is loaded from below by the effective mass μ at its lower joint and, through a joint with a
spring and a damper, κ = stiffness + iω damping, the coupling ν and the stiffness S on its turn.  With loads F on its
centre of mass (s = c/l along it), T on its turn, e + ω²ε on its lower joint, and c = κ/(l l′) to the link above it,

    k̃ = k + S + κ/l²,   P = k̃ − ω²(r + μ + 2ν),   N = k̃ + ω²(q − ν),   β = u + μ + ν,   E = T + s F + e + ω²ε
    a = (c a′ + E + ω²β y)/P                            y + a = (c a′ + E + N y)/P
    μ′ = ((m + μ) k̃ − ω²(m J + p μ + 2 m(1 − s) ν − ν²))/P      ν′ = c β/P      S′ = κ (P − κ/l²)/(P l′²)
    e′ = (N e + (k̃ − ω²(J + (1 − s) μ + (2 − s) ν)) F)/P,     ε′ = (N ε + β T)/P,     T′ = c E/P

where primes are for the link above. There are no subtractions except those in the data: μ of bobs becomes k/ω² above
their modes, where m_dyn as a sum over modes cancels, and torques alone push the cart with ω²ε, whose ω² is that of the
cart's inertia. A linear drag d on a centre of mass adds −i d/ω to its mass, loss angles φ make k and κ's stiffness k (1
+ iφ). (The recursion of `modal.eigen.recursion`, at a complex frequency; [Parlett1998, §3.3].)

There are two kinds of arithmetic: floats with measured rounding errors, and as many decimal digits as needed.
`Rounded` computes every frequency REPLICAS + 1 times in floats; in all but the first, `round_off` changes each result
by a random part in 2⁵², as rounding does, and the frequency by a last digit, as the rounding of ω² does near a sharp
resonance, so that the spread of the results is their rounding error (Monte Carlo arithmetic: [Parker1997];
[Vignes2004]). `Digits` computes in decimals of any precision, starting from the exact value of every float. Arrays of
both support the same operators, frequencies last.
"""

from __future__ import annotations

from collections.abc import Callable
from decimal import Context, Decimal, localcontext
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from modal import pair
from modal.assembly import Block, CartNumbers
from modal.types import EPS, Booleans, Complexes, Floats

TORQUE, FORCE, TURN = "torque", "force", "turn"
Load = tuple[str, int]
"""A torque at the upper joint of a link, a force on its centre or a torque on it alone, and the link, from 0."""


class ChainResponse(NamedTuple):
    """P chains on a pivot: dynamic `mass` (P, W), and the loads' e and ε there, `direct` and `inertial` (P, L, W).

    Joints (n + 1, P, 1 + L, W) and angles (n, P, 1 + L, W) for a pivot displaced by 1, then for each load on a pivot at
    rest.
    """

    mass: Any
    direct: Any
    inertial: Any
    joints: Any
    angles: Any


def chain_response(
    block: Block, loads: list[Load], gravity: float, numbers: Arithmetic, losses: tuple[Floats, Floats] | None = None
) -> ChainResponse:
    """Chains with unit loads at the frequencies of `numbers`; `losses` are the loss angles of joints and wires.

    Each is (n, P, W), at the frequencies `numbers.rates`.
    """
    square, round_off = numbers.omega * numbers.omega, numbers.round_off
    parts = (block.mass, block.length, block.centre, block.inertia, block.sigma)
    m, length, c, I, sigma = (numbers.number(part[..., None]) for part in parts)
    mass_below = np.array(pair.masses_below(m))
    links = pair.link_constants(m, length, c, I, mass_below, numbers.number(gravity))
    k = sigma * links.k
    if block.drag.any():
        heavy = m - numbers.imaginary(numbers.number(block.drag[..., None]) / numbers.omega)
        links = pair.link_constants(heavy, length, c, I, mass_below)
    joint = numbers.number(block.stiffness[..., None])
    if block.damping.any():
        joint = joint + numbers.imaginary(numbers.number(block.damping[..., None]) * numbers.omega)
    if losses is not None:
        of_joints, of_wires = (numbers.number(angle) for angle in losses)
        joint = joint + numbers.imaginary(numbers.number(block.stiffness[..., None]) * of_joints)
        k = k + numbers.imaginary(k * of_wires)
    if block.rotor.any():
        joint = joint - numbers.number(block.rotor[..., None]) * square
    is_sprung = bool(block.stiffness.any() or block.damping.any() or block.rotor.any())
    torque, force = _unit_loads(block, loads)
    torques, forces = numbers.number(torque) * sigma[:, :, None] / length[:, :, None], numbers.number(force)
    mu: Any = numbers.number(np.zeros((block.size, 1)))
    nu: Any = 0
    stiff: Any = 0
    passed_torque: Any = 0
    e: Any = numbers.number(np.zeros((block.size, len(loads), 1)))
    epsilon, coefficients = e, []
    for i in range(block.n - 1, -1, -1):
        m, mJ, r, p, q, upper, lower = (part[i] for part in links[:-1])
        s, rest, J = upper / m, lower / m, mJ / m
        spring = joint[i] / length[i] / length[i]
        total = k[i] + stiff + spring
        P = round_off(numbers.pivot(total - square * (r + mu + nu + nu), total))
        N = round_off(total + square * (q - nu))
        beta = round_off(upper + mu + nu)
        T = passed_torque + torques[i]
        E = round_off(T + _widen(s) * forces[i] + e + square * epsilon)
        coupling = joint[i] * sigma[i] * sigma[i - 1] / length[i] / length[i - 1] if i and is_sprung else None
        coefficients.append((P, N, beta, E, coupling))
        force_coefficient = round_off(total - square * (J + rest * mu + (1 + rest) * nu))
        e = round_off((_widen(N) * e + _widen(force_coefficient) * forces[i]) / _widen(P))
        epsilon = round_off((_widen(N) * epsilon + _widen(beta) * T) / _widen(P))
        mu = round_off(((m + mu) * total - square * (mJ + p * mu + (lower + lower) * nu - nu * nu)) / P)
        if coupling is not None:
            nu = round_off(coupling * beta / P)
            stiff = round_off(joint[i] * (P - spring) / P / length[i - 1] / length[i - 1])
            passed_torque = round_off(_widen(coupling) * E / _widen(P))
    joints, angles = _descend(
        coefficients[::-1], numbers.number(np.eye(1, 1 + len(loads))[..., None]), square, round_off
    )
    return ChainResponse(mu, e, epsilon, joints, np.array(angles) * sigma[:, :, None] / length[:, :, None])


def _descend(coefficients: list[Any], pivot: Any, square: Any, round_off: Any) -> tuple[Any, list[Any]]:
    """Joints and turns, from the pivot down."""
    y, turn = pivot, None
    joints, turns = [], []
    for P, N, beta, E, coupling in coefficients:
        push = np.concatenate([0 * E[:, :1], E], axis=1) if E.shape[1] else 0 * _widen(P)
        if coupling is not None:
            push = push + _widen(coupling) * turn
        joints.append(y)
        turn, y = (
            round_off((push + square * _widen(beta) * y) / _widen(P)),
            round_off((push + _widen(N) * y) / _widen(P)),
        )
        turns.append(turn)
    joints.append(y)
    shape = np.broadcast_shapes(*(np.shape(values) for values in joints))
    return np.array([np.broadcast_to(values, shape) for values in joints]), turns


def _widen(values: Any) -> Any:
    """Numbers of chains (P, W) next to those of chains and loads (P, L, W)."""
    return values[:, None]


def _unit_loads(block: Block, loads: list[Load]) -> tuple[Any, Any]:
    """Torques on links and forces on their centres, (n, 1, L, 1), of unit loads."""
    torque, force = np.zeros((2, block.n, 1, len(loads), 1))
    for column, (what, link) in enumerate(loads):
        if what == FORCE:
            force[link, 0, column] = 1.0
        else:
            torque[link, 0, column] = 1.0
            torque[link - 1 : link, 0, column] = -1.0 if what == TORQUE else 0.0
    return torque, force


def cart_of(cart: CartNumbers, mass: Any, numbers: Arithmetic) -> tuple[Any, Any, Any]:
    """The cart's displacement (W,) for a unit force, for a unit of ω²ε, and for the ground's.

    `mass` (W,) is the dynamic mass of the pendula; without a spring and a damper its equation is divided by ω².
    """
    omega, round_off = numbers.omega, numbers.round_off
    total_mass = round_off(numbers.number(cart.mass) + mass)
    if not (cart.stiffness or cart.damping):
        inertial = numbers.number(-1.0) / numbers.pivot(total_mass, numbers.number(cart.mass) + abs(total_mass))
        return inertial / (omega * omega), inertial, 0 * total_mass
    stiffness = numbers.number(cart.stiffness)
    if cart.damping:
        stiffness = stiffness + numbers.imaginary(numbers.number(cart.damping) * omega)
    direct = numbers.number(1.0) / round_off(numbers.pivot(stiffness - omega * omega * total_mass, stiffness))
    return direct, direct * omega * omega, direct * stiffness


REPLICAS = 3
"""Tolerance: perturbed results of each frequency; their largest deviation, times 4, bounds the rounding error."""
PRECISIONS = (40, 80, 160, 320, 640)
"""Decimal digits, until two in a row agree to a rounding; half of the most reach below the smallest float."""


REFINED_DIGITS = 80
"""Cost: decimal digits in which a mode is refined: half of them may cancel."""


class Rounded:
    """Floats, real or complex, at the angular frequencies (W,) and again for every replica: (W (REPLICAS + 1),)."""

    def __init__(self, omega: Floats | Complexes) -> None:
        ways = np.concatenate(([0.0], (-1.0) ** np.arange(REPLICAS)))
        self.omega: Any = np.tile(omega, REPLICAS + 1) * np.repeat(1 + EPS * ways, len(omega))
        self.rates = np.real(np.tile(omega, REPLICAS + 1))
        self._first = len(omega)
        self._random = np.random.default_rng(0)

    def number(self, values: ArrayLike) -> Any:
        """The floats themselves."""
        return np.asarray(values, dtype=np.float64)

    def exact(self, values: Any) -> Any:
        """The floats next to decimals."""
        return np.asarray(values, dtype=np.float64)

    def imaginary(self, values: Any) -> Any:
        """Complex floats."""
        return 1j * values

    def round_off(self, values: Any) -> Any:
        """Each replica changed by up to one part in 2⁵²."""
        values = np.array(np.broadcast_to(values, np.broadcast_shapes(np.shape(values), self.omega.shape)))
        later = values[..., self._first :]
        later *= 1 + EPS * (2 * self._random.random(later.shape) - 1)
        if np.iscomplexobj(values):
            later *= 1 + 1j * EPS * (2 * self._random.random(later.shape) - 1)
        return values

    def pivot(self, values: Any, neighbours: Any) -> Any:
        """Replace zeros by a last bit of the terms next to them."""
        return np.where(values == 0, -EPS * neighbours, values)

    def results(self, values: Any) -> tuple[Complexes, Floats]:
        """The values (…, W) and their rounding errors (…, W)."""
        all_values = np.asarray(values, dtype=np.complex128)
        parts = all_values.reshape(*all_values.shape[:-1], REPLICAS + 1, self._first)
        spread = np.abs(parts[..., 1:, :] - parts[..., :1, :]).max(-2)
        return parts[..., 0, :], 4 * spread


class Digits:
    """Decimals, real or in pairs for complex numbers, in arrays of objects.

    The angular frequencies are omega + remainder (W,).
    """

    omega: Any

    def __init__(
        self, omega: Floats | Complexes, precision: int, *, is_real: bool, remainder: Floats | None = None
    ) -> None:
        self.precision, self.is_real = precision, is_real
        self.rates = np.real(omega)
        self.omega = self.number(np.real(omega))
        if np.iscomplexobj(omega):
            self.omega = self.omega + self.imaginary(self.number(np.imag(omega)))
        if remainder is not None:
            self.omega = self.omega + self.number(remainder)

    def number(self, values: ArrayLike) -> Any:
        """Every float in all its digits."""
        return self.exact(np.frompyfunc(Decimal, 1, 1)(np.asarray(values, dtype=np.float64)))

    def exact(self, values: Any) -> Any:
        """Decimals, or pairs of them."""
        return values if self.is_real else np.frompyfunc(lambda value: Complex(value, Decimal(0)), 1, 1)(values)

    def imaginary(self, values: Any) -> Any:
        """I times complex numbers."""
        return np.frompyfunc(lambda value: Complex(-value.imag, value.real), 1, 1)(values)

    def round_off(self, values: Any) -> Any:
        """The numbers: their rounding is seen by those of more digits."""
        return values

    def pivot(self, values: Any, neighbours: Any) -> Any:
        """Replace zeros by a last digit of the terms next to them."""
        digit: Any = Decimal(-1).scaleb(-self.precision)
        last = digit if self.is_real else Complex(digit, Decimal(0))
        return np.frompyfunc(lambda value, neighbour: neighbour * last if value == 0 else value, 2, 1)(
            values, neighbours
        )


Arithmetic = Rounded | Digits
"""The arithmetic of an elimination: floats with their rounding, or decimals."""


class Complex:
    """A complex number of two decimals: with the operations that an elimination needs."""

    __slots__ = ("imag", "real")

    def __init__(self, real: Decimal, imag: Decimal) -> None:
        self.real, self.imag = real, imag

    def __add__(self, other: Any) -> Complex:
        if other.__class__ is Complex:
            return Complex(self.real + other.real, self.imag + other.imag)
        return Complex(self.real + other, self.imag) if isinstance(other, int) else NotImplemented

    def __sub__(self, other: Any) -> Complex:
        if other.__class__ is Complex:
            return Complex(self.real - other.real, self.imag - other.imag)
        return Complex(self.real - other, self.imag) if isinstance(other, int) else NotImplemented

    def __rsub__(self, other: int) -> Complex:
        return Complex(other - self.real, -self.imag)

    def __mul__(self, other: Any) -> Complex:
        if other.__class__ is not Complex:
            return Complex(self.real * other, self.imag * other) if isinstance(other, int) else NotImplemented
        a, b, c, d = self.real, self.imag, other.real, other.imag
        return Complex(a * c - b * d, a * d + b * c) if b or d else Complex(a * c, b)

    def __truediv__(self, other: Any) -> Complex:
        if other.__class__ is not Complex:
            return NotImplemented
        numerator, c, d = self, other.real, other.imag
        if d:
            numerator, c = self * Complex(c, -d), c * c + d * d
        return Complex(numerator.real / c, numerator.imag / c)

    def __neg__(self) -> Complex:
        return Complex(-self.real, -self.imag)

    def __abs__(self) -> Complex:
        return Complex(max(abs(self.real), abs(self.imag)), Decimal(0))

    def __complex__(self) -> complex:
        return complex(float(self.real), float(self.imag))

    def __eq__(self, other: object) -> bool:
        return isinstance(other, int) and other == self.real and not self.imag

    __hash__ = None  # type: ignore[assignment]
    __radd__, __rmul__ = __add__, __mul__


def precise_values(
    evaluate: Callable[[Any], Any],
    omega: Floats | Complexes,
    *,
    is_real: bool,
    tolerance: float,
    remainder: Floats | None = None,
) -> Complexes:
    """Return the result of `evaluate` in an arithmetic, (…, W), to a relative error of `tolerance` in every entry.

    Floats are tried first, then decimals where they have lost too many digits, as near a sharp resonance: there the
    frequencies are omega + remainder (W,), and not their floats.
    """
    with np.errstate(all="ignore"):
        values, errors = (numbers := Rounded(omega)).results(evaluate(numbers))
    is_imprecise = ~(errors <= tolerance * np.abs(values))
    entries = tuple(range(is_imprecise.ndim - 1))
    if len(open_places := np.flatnonzero(is_imprecise.any(entries))):
        full_remainder = np.zeros(len(omega)) if remainder is None else remainder
        terms = np.nan_to_num(errors[..., open_places], posinf=0.0) / EPS
        values[..., open_places] = _in_digits(
            evaluate, omega[open_places], full_remainder[open_places], terms, is_real=is_real
        )
    return values


def _in_digits(
    evaluate: Callable[[Any], Any], omega: Floats | Complexes, remainder: Floats, terms: Floats, *, is_real: bool
) -> Complexes:
    """The values (…, W) in as many digits as they need; `terms` (…, W) is the size of what adds up to each.

    A value below 10^−half of the digits of its terms is 0 if it is in the most digits at a frequency next to all of
    these, at an irrational ratio, where no response vanishes by the roundness of its numbers: it vanishes at all
    frequencies. Any other is sought in more digits.
    """

    def compute(
        points: Floats | Complexes, offset: Floats, precision: int, sizes: Floats
    ) -> tuple[Complexes, Booleans]:
        with localcontext(Context(prec=precision)):
            digits = evaluate(Digits(points, precision, is_real=is_real, remainder=offset))
            values = np.frompyfunc(complex if is_real else Complex.__complex__, 1, 1)(digits).astype(np.complex128)
        return values, np.abs(values) <= 10.0 ** (-precision // 2) * sizes

    results = np.zeros(terms.shape, dtype=np.complex128)
    open_places, last, vanish = np.arange(len(omega)), None, np.zeros(0, dtype=np.bool_)
    for precision in PRECISIONS:
        values, small = compute(omega[open_places], remainder[open_places], precision, terms[..., open_places])
        if small.any() and not vanish.size:
            nearby_frequency = omega[[np.abs(omega).argmax()]] * (np.pi / 3)
            vanish = compute(nearby_frequency, np.zeros(1), PRECISIONS[-1], terms.max(-1, keepdims=True))[1]
        zero = small & vanish if vanish.size and precision < PRECISIONS[-1] else small
        values[zero] = 0
        results[..., open_places] = values
        if last is not None:
            disagrees = ~(np.abs(values - last) <= 4 * EPS * np.abs(values)) | (small & ~zero)
            is_open = disagrees.any(tuple(range(disagrees.ndim - 1)))
            open_places, values = open_places[is_open], values[..., is_open]
            if not len(open_places):
                break
        last = values
    return results
