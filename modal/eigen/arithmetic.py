"""Two kinds of arithmetic for one elimination: floats whose rounding is felt, and as many decimal digits as it takes.

`Rounded` computes every frequency REPLICAS + 1 times in floats; in all but the first, `felt` changes each result by a
random part in 2⁵², as rounding does, and the frequency by a last digit, as the rounding of ω² does beside a sharp
resonance, so that the spread of the results is their rounding error (Monte Carlo arithmetic:
Parker, UCLA CSD-970002 (1997); Vignes, Numer. Algorithms 37, 377 (2004)).  `Digits` computes in decimals of any
precision, starting from the exact value of every float.  Arrays of both take the same operators, frequencies last.
"""

from __future__ import annotations

from collections.abc import Callable
from decimal import Context, Decimal, localcontext
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike

from modal.types import Booleans, Complexes, Floats

REPLICAS, SAFETY = 3, 4.0
"""Perturbed results of each frequency, and the factor on their spread."""
ULP = 2.0**-52
PRECISIONS = (40, 80, 160, 320, 640)
"""Decimal digits, until two in a row agree to AGREED; half of the most reach below the smallest float."""
AGREED = 1e-15
BESIDE = 8 / 7
"""A frequency beside those asked for, over the largest: none at which a response vanishes by its numbers' roundness."""


class Arithmetic(Protocol):
    """What an elimination asks of its numbers."""

    omega: Any
    rates: Floats
    """The angular frequencies (rad/s) as real floats."""

    def number(self, values: ArrayLike) -> Any:
        """Floats as numbers."""

    def exact(self, values: Any) -> Any:
        """Decimals as numbers."""

    def imaginary(self, values: Any) -> Any:
        """I times these numbers."""

    def felt(self, values: Any) -> Any:
        """The numbers with their rounding."""

    def pivot(self, values: Any, beside: Any) -> Any:
        """The numbers, with zeros replaced by a last digit of those beside them."""


class Rounded:
    """Floats, real or complex, at the angular frequencies (W,) and again for every replica: (W (REPLICAS + 1),)."""

    def __init__(self, omega: Floats | Complexes) -> None:
        ways = np.concatenate(([0.0], (-1.0) ** np.arange(REPLICAS)))
        self.omega = np.tile(omega, REPLICAS + 1) * np.repeat(1 + ULP * ways, len(omega))
        self.rates = np.real(np.tile(omega, REPLICAS + 1))
        self._first = len(omega)
        self._random = np.random.default_rng(0)

    def number(self, values: ArrayLike) -> Floats:
        """The floats themselves."""
        return np.asarray(values, dtype=np.float64)

    def exact(self, values: Any) -> Floats:
        """The floats next to decimals."""
        return np.asarray(values, dtype=np.float64)

    def imaginary(self, values: Any) -> Any:
        """Complex floats."""
        return 1j * values

    def felt(self, values: Any) -> Any:
        """Each replica changed by up to one part in 2⁵²."""
        values = np.array(np.broadcast_to(values, np.broadcast_shapes(np.shape(values), self.omega.shape)))
        later = values[..., self._first :]
        later *= 1 + ULP * (2 * self._random.random(later.shape) - 1)
        if np.iscomplexobj(values):
            later *= 1 + 1j * ULP * (2 * self._random.random(later.shape) - 1)
        return values

    def pivot(self, values: Any, beside: Any) -> Any:
        """Zeros replaced by a last bit of those beside them."""
        return np.where(values == 0, -ULP * beside, values)

    def results(self, values: Any) -> tuple[Complexes, Floats]:
        """The values (…, W) and their rounding errors (…, W)."""
        every = np.asarray(values, dtype=np.complex128)
        parts = every.reshape(*every.shape[:-1], REPLICAS + 1, self._first)
        spread = np.abs(parts[..., 1:, :] - parts[..., :1, :]).max(-2)
        return parts[..., 0, :], SAFETY * spread


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

    def felt(self, values: Any) -> Any:
        """The numbers: their rounding is seen by those of more digits."""
        return values

    def pivot(self, values: Any, beside: Any) -> Any:
        """Zeros replaced by a last digit of those beside them."""
        digit: Any = Decimal(-1).scaleb(-self.precision)
        last = digit if self.is_real else Complex(digit, Decimal(0))
        return np.frompyfunc(lambda value, other: other * last if value == 0 else value, 2, 1)(values, beside)


class Complex:
    """A complex number of two decimals: just what an elimination needs."""

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
        above, c, d = self, other.real, other.imag
        if d:
            above, c = self * Complex(c, -d), c * c + d * d
        return Complex(above.real / c, above.imag / c)

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


def evaluated(
    evaluate: Callable[[Any], Any],
    omega: Floats | Complexes,
    *,
    is_real: bool,
    tolerance: float,
    remainder: Floats | None = None,
) -> Complexes:
    """What `evaluate` makes of an arithmetic, (…, W), to a relative error of `tolerance` in every entry.

    In floats first, then in digits where they have lost too many, as beside a sharp resonance: there the frequencies
    are omega + remainder (W,), and not their floats.
    """
    with np.errstate(all="ignore"):
        values, errors = (numbers := Rounded(omega)).results(evaluate(numbers))
    lost = ~(errors <= tolerance * np.abs(values))
    entries = tuple(range(lost.ndim - 1))
    if len(left := np.flatnonzero(lost.any(entries))):
        beyond = np.zeros(len(omega)) if remainder is None else remainder
        terms = np.nan_to_num(errors[..., left], posinf=0.0) / ULP
        values[..., left] = _in_digits(evaluate, omega[left], beyond[left], terms, is_real=is_real)
    return values


def _in_digits(
    evaluate: Callable[[Any], Any], omega: Floats | Complexes, remainder: Floats, terms: Floats, *, is_real: bool
) -> Complexes:
    """The values (…, W) in as many digits as they need; `terms` (…, W) is the size of what adds up to each.

    A value below 10^−half of the digits of its terms is 0 where that of BESIDE is in the most digits: it vanishes
    at all frequencies.  Any other is sought in more digits.
    """

    def computed(
        points: Floats | Complexes, beyond: Floats, precision: int, sizes: Floats
    ) -> tuple[Complexes, Booleans]:
        with localcontext(Context(prec=precision)):
            digits = evaluate(Digits(points, precision, is_real=is_real, remainder=beyond))
            values = np.frompyfunc(complex if is_real else Complex.__complex__, 1, 1)(digits).astype(np.complex128)
        return values, np.abs(values) <= 10.0 ** (-precision // 2) * sizes

    results = np.zeros(terms.shape, dtype=np.complex128)
    left, last, vanish = np.arange(len(omega)), None, np.zeros(0, dtype=np.bool_)
    for precision in PRECISIONS:
        values, small = computed(omega[left], remainder[left], precision, terms[..., left])
        if small.any() and not vanish.size:
            beside = omega[[np.abs(omega).argmax()]] * BESIDE
            vanish = computed(beside, np.zeros(1), PRECISIONS[-1], terms.max(-1, keepdims=True))[1]
        zero = small & vanish if vanish.size and precision < PRECISIONS[-1] else small
        values[zero] = 0
        results[..., left] = values
        if last is not None:
            apart = ~(np.abs(values - last) <= AGREED * np.abs(values)) | (small & ~zero)
            again = apart.any(tuple(range(apart.ndim - 1)))
            left, values = left[again], values[..., again]
            if not len(left):
                break
        last = values
    return results
