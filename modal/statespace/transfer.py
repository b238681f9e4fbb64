"""Transfer functions of a scene: poles from its modes, zeros of every pair of an input and an output.

    G(s) = D + Σ_k (s N1_k + N0_k)/(s² + 2ζ_kω_k s + ω_k²) = g Π (s − z_i)/Π (s − p_k)

Modes of one frequency are one term; uncontrollable or unobservable modes have none. The zeros are the finite
eigenvalues λ of the eigenvalue problem

    [ A  b ]       [ 1  0 ]
    [ c  d ]  − λ  [ 0  0 ]

of the remaining terms [EmamiNaeini1982], made exact by Newton's method on G(s)
by elimination (`modal.statespace.response`).  There are as many as there are poles, less the relative degree; that and
the number of zeros at s = 0 are the powers of s that G follows far above and far below all poles, and g is the value of
G Π (s − p_k)/Π (s − z_i) between them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import ArrayLike

from modal.errors import ComputationError
from modal.report import Displayed, Summary, brief, counted
from modal.statespace.modal_form import ModalForm, block_diagonal
from modal.statespace.response import ExactResponse, terms
from modal.statespace.signals import Signal
from modal.types import EPS, NOISE_OF_SUM, Complexes, Floats

TRANSFER_POLES_MAX = 100
"""Limit: poles of a transfer function, refused beyond: polynomials of such a degree say nothing."""
STEP_TO_ZERO_MAX = 1e-3
"""Tolerance: how far Newton's method may lead from a zero, relative to it; further away is another, or a double one."""
ERROR_OF_ZERO = 1e-13
"""Tolerance: relative error of a zero beyond which its last step is taken in digits."""


@dataclass(frozen=True, eq=False, repr=False)
class TransferFunction(Displayed):
    """G(s) of one output for one input: `zeros` and `poles` in 1/s, ascending in magnitude, and the leading `gain`.

    `gain` has the output's unit over the input's, times 1/s to the power of the relative degree.
    """

    input: Signal
    output: Signal
    zeros: Complexes
    poles: Complexes
    gain: float

    def _summary(self) -> Summary:
        zeros, poles = (
            counted(len(roots), word, word + "s") for roots, word in ((self.zeros, "zero"), (self.poles, "pole"))
        )
        title = f"Transfer function from {self.input.name} to {self.output.name}: {zeros}, {poles}"
        facts = [("gain", brief(self.gain)), ("zeros (1/s)", brief(self.zeros)), ("poles (1/s)", brief(self.poles))]
        return Summary(title, facts)

    @property
    def numerator(self) -> Floats:
        """Coefficients of powers of s, the highest first."""
        return np.asarray(self.gain * np.real(np.poly(self.zeros)), dtype=np.float64).reshape(-1)

    @property
    def denominator(self) -> Floats:
        """The same of the poles, the first 1."""
        return np.asarray(np.real(np.poly(self.poles)), dtype=np.float64).reshape(-1)

    def at(self, s: ArrayLike) -> Complexes:
        """G (W,) at these s (W,) in 1/s."""
        points = np.atleast_1d(np.asarray(s, dtype=np.complex128))[:, None]
        with np.errstate(divide="ignore"):
            return np.asarray(self.gain * np.prod(points - self.zeros, axis=1) / np.prod(points - self.poles, axis=1))


def transfer_functions(form: ModalForm) -> list[list[TransferFunction]]:
    """Return G of every output (rows) for every input (columns).

    Raise ComputationError for more than TRANSFER_POLES_MAX poles: polynomials of such a degree are useless.
    """
    terms = _terms(form)
    if (poles := sum(2 if c[0] else 1 for c in terms)) > TRANSFER_POLES_MAX:
        raise ComputationError(f"transfer functions of {poles} poles: at most {TRANSFER_POLES_MAX}")
    return [
        [_one(form, terms, row, column) for column in range(len(form.model.inputs))]
        for row in range(len(form.model.outputs))
    ]


Numerators = tuple[Floats, Floats]


def _terms(form: ModalForm) -> dict[tuple[float, float, float], Numerators]:
    """N1 and N0 (p, m) of all modes of one denominator c2 s² + c1 s + c0."""
    numerators: dict[tuple[float, float, float], Numerators] = {}
    for term in terms(form):
        N1, N0 = numerators.get(term.c, (0.0, 0.0))
        numerators[term.c] = N1 + term.N1, N0 + term.N0
    return numerators


def _one(
    form: ModalForm, terms: dict[tuple[float, float, float], Numerators], row: int, column: int
) -> TransferFunction:
    known_rates = {c: max(np.sqrt(abs(c[2])), abs(c[1])) for c in terms}
    slowest = min(filter(None, known_rates.values()), default=1.0)
    rates = {c: rate or slowest for c, rate in known_rates.items()}
    clean_terms = {c: _clean(float(N1[row, column]), float(N0[row, column]), rates[c]) for c, (N1, N0) in terms.items()}
    sizes = {c: max(abs(n1), abs(n0) / rates[c]) for c, (n1, n0) in clean_terms.items()}
    largest = max(sizes.values(), default=0.0)
    significant_terms = {c: clean_terms[c] for c in clean_terms if sizes[c] > NOISE_OF_SUM * largest}
    d, static = float(form.model.D[row, column]), sum(size / rates[c] for c, size in sizes.items())
    d = d if abs(d) > NOISE_OF_SUM * static else 0.0
    driven, output = form.model.inputs[column], form.model.outputs[row]
    if not significant_terms:
        return TransferFunction(driven, output, _ascending([]), _ascending([]), d)
    poles = np.array([pole for c in significant_terms for pole in np.roots(np.trim_zeros(c, "f"))], dtype=np.complex128)
    G = ExactResponse((form.model.scene or form.modes.scene).lossless, [driven], [output])
    moving = np.abs(poles[poles != 0])
    fast, slow = (float(end(moving)) if len(moving) else G.unit for end in (np.max, np.min))
    middle = np.sqrt(fast) * np.sqrt(slow) * np.exp(0.5j)
    far = EPS**-2  # above or below all poles by so much, only the degree matters
    *ends, gain = G.at(np.array([fast * far, 2 * fast * far, slow / far, 2 * slow / far, middle]))[0, 0]
    if not all(ends):
        return TransferFunction(driven, output, _ascending([]), _ascending([]), 0.0)
    fall, rise = (round(float(np.log2(abs(second / first)))) for first, second in (ends[:2], ends[2:]))
    zeros = _exact(_zeros(significant_terms, d, -fall), rise + int(np.sum(poles == 0)), G)
    for factor in _interleave(middle - poles, middle - zeros):
        gain *= factor
    return TransferFunction(driven, output, _ascending(zeros), _ascending(poles), float(gain.real))


def _interleave(numerators: Complexes, denominators: Complexes) -> list[complex]:
    """Factors of a quotient in an order in which their product neither overflows nor underflows."""
    size = max(len(numerators), len(denominators))
    factors = (np.append(np.sort_complex(part), np.ones(size - len(part))) for part in (numerators, denominators))
    return [complex(upper / lower) for upper, lower in zip(*factors, strict=True)]


def _exact(zeros: Complexes, n_static: int, G: ExactResponse) -> Complexes:
    """The zeros made exact; as many of the smallest as `n_static` are 0."""
    exact = zeros[np.argsort(np.abs(zeros), kind="stable")]
    exact[: max(n_static, 0)] = 0
    upper = np.flatnonzero((exact != 0) & (exact.imag >= 0))
    exact[upper] = _newton(exact[upper], G)
    for k in np.flatnonzero(exact.imag < 0).tolist():
        distances = np.abs(exact[upper].conj() - exact[k])
        if len(upper) and distances.min() <= STEP_TO_ZERO_MAX * abs(exact[k]):
            exact[k] = exact[upper][distances.argmin()].conj()
    return exact


def _newton(start: Complexes, G: ExactResponse) -> Complexes:
    """The zeros of G near these (Z,); those themselves from which Newton's method leads away, as from double ones."""
    z, real, aside = start, start.imag == 0, np.cbrt(EPS)
    for step in range(3 if len(start) else 0):
        pairs = np.concatenate([z, z * (1 + aside)])
        values, errors = (part[0, 0] for part in G.roughly_at(pairs))
        if step == 2:
            rough = np.tile(errors[: len(z)] > ERROR_OF_ZERO * np.abs(values[len(z) :] - values[: len(z)]) / aside, 2)
            if rough.any():
                values[rough] = G.at(pairs[rough], ERROR_OF_ZERO)[0, 0]
        value, neighbour_value = np.split(values, 2)
        with np.errstate(all="ignore"):
            new_z = z - value * (z * aside) / (neighbour_value - value)
        z = np.where(np.isfinite(new_z), np.where(real, new_z.real, new_z), z)
    return np.where(np.abs(z - start) <= STEP_TO_ZERO_MAX * np.abs(start), z, start)


def _clean(n1: float, n0: float, rate: float) -> tuple[float, float]:
    """The same with rounding errors set to 0."""
    first, last = abs(n1) * rate, abs(n0)
    return n1 if first > NOISE_OF_SUM * last else 0.0, n0 if last > NOISE_OF_SUM * first else 0.0


def _zeros(terms: dict[tuple[float, float, float], tuple[float, float]], d: float, degree: int) -> Complexes:
    """The finite zeros of Σ (n1 s + n0)/(c2 s² + c1 s + c0) + d, of this relative degree."""
    pieces = [
        (np.array([[0.0, 1.0], [-c[2], -c[1]]]), np.array([0.0, 1.0]), np.array([n0, n1]))
        if c[0]
        else (np.array([[-c[2]]]), np.ones(1), np.array([n0]))
        for c, (n1, n0) in terms.items()
    ]
    A = block_diagonal([piece[0] for piece in pieces])
    b, c = (np.concatenate([piece[k] for piece in pieces]) for k in (1, 2))
    pencil = np.block([[A, b[:, None]], [c[None], np.array([[d]])]])
    unit = np.diag(np.append(np.ones(len(A)), 0.0))
    alpha, beta = scipy.linalg.eigvals(pencil, unit, homogeneous_eigvals=True)
    finite = np.argsort(np.abs(beta) / np.hypot(np.abs(alpha), np.abs(beta)))[degree + 1 :]
    return np.asarray(alpha[finite] / beta[finite], dtype=np.complex128)


def _ascending(values: ArrayLike) -> Complexes:
    array = np.asarray(values, dtype=np.complex128).reshape(-1)
    return np.asarray(array[np.lexsort((array.imag, np.abs(array).round(12)))])
