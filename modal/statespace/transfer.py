"""Transfer functions of a scene: poles from its modes, zeros of every pair of an input and an output.

    G(s) = D + Σ_k (s N1_k + N0_k)/(s² + 2ζ_kω_k s + ω_k²) = g Π (s − z_i)/Π (s − p_k)

Modes of one frequency are one term, and those that the input does not reach or the output does not see are none.  The
zeros are the finite eigenvalues λ of the pencil

    [ A  b ]       [ 1  0 ]
    [ c  d ]  − λ  [ 0  0 ]

of the terms that are left (Emami-Naeini & Van Dooren, Automatica 18, 415 (1982)).  There are as many as there are
poles, less the relative degree: the number of leading Markov parameters d, cb, cAb, … that vanish; the first that does
not is g.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import eigvals

from modal.errors import ComputationError
from modal.report import Displayed, Summary, brief, counted
from modal.statespace.modal_form import ModalForm, block_diagonal
from modal.statespace.response import terms
from modal.statespace.signals import Signal
from modal.types import Complexes, Floats

MOST_POLES = 100
ROUNDING = 1e-14
NOTHING, CANCELLED = 1e-12, 1e-9
"""Below this share of the largest a term is none; below this share of its terms a Markov parameter is none."""


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
        zeros, poles = (counted(len(own), one, one + "s") for own, one in ((self.zeros, "zero"), (self.poles, "pole")))
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
    """G of every output (rows) for every input (columns).

    Raises ComputationError for more than MOST_POLES poles: polynomials of such a degree say nothing.
    """
    every = _terms(form)
    if (poles := sum(2 if c[0] else 1 for c in every)) > MOST_POLES:
        raise ComputationError(f"transfer functions of {poles} poles: at most {MOST_POLES}")
    return [
        [_one(form, every, row, column) for column in range(len(form.model.inputs))]
        for row in range(len(form.model.outputs))
    ]


Numerators = tuple[Floats, Floats]


def _terms(form: ModalForm) -> dict[tuple[float, float, float], Numerators]:
    """N1 and N0 (p, m) of all modes of one denominator c2 s² + c1 s + c0."""
    found: dict[tuple[float, float, float], Numerators] = {}
    for term in terms(form):
        N1, N0 = found.get(term.c, (0.0, 0.0))
        found[term.c] = N1 + term.N1, N0 + term.N0
    return found


def _one(
    form: ModalForm, every: dict[tuple[float, float, float], Numerators], row: int, column: int
) -> TransferFunction:
    own_rates = {c: max(np.sqrt(abs(c[2])), abs(c[1])) for c in every}
    slowest = min(filter(None, own_rates.values()), default=1.0)
    rates = {c: rate or slowest for c, rate in own_rates.items()}
    own = {c: _clean(float(N1[row, column]), float(N0[row, column]), rates[c]) for c, (N1, N0) in every.items()}
    sizes = {c: max(abs(n1), abs(n0) / rates[c]) for c, (n1, n0) in own.items()}
    largest = max(sizes.values(), default=0.0)
    kept = {c: own[c] for c in own if sizes[c] > NOTHING * largest}
    d, static = float(form.model.D[row, column]), sum(size / rates[c] for c, size in sizes.items())
    d = d if abs(d) > NOTHING * static else 0.0
    poles = [pole for c in kept for pole in np.roots(np.trim_zeros(c, "f"))]
    zeros, gain = _zeros(kept, d)
    given, read = form.model.inputs[column], form.model.outputs[row]
    return TransferFunction(given, read, _ascending(zeros), _ascending(poles), gain)


def _clean(n1: float, n0: float, rate: float) -> tuple[float, float]:
    """The same without what rounding has left of a 0."""
    return n1 if abs(n1) * rate > ROUNDING * abs(n0) else 0.0, n0 if abs(n0) > ROUNDING * abs(n1) * rate else 0.0


def _zeros(kept: dict[tuple[float, float, float], tuple[float, float]], d: float) -> tuple[Complexes, float]:
    """The finite zeros of Σ (n1 s + n0)/(c2 s² + c1 s + c0) + d, and the leading coefficient."""
    pieces = [
        (np.array([[0.0, 1.0], [-c[2], -c[1]]]), np.array([0.0, 1.0]), np.array([n0, n1]))
        if c[0]
        else (np.array([[-c[2]]]), np.ones(1), np.array([n0]))
        for c, (n1, n0) in kept.items()
    ]
    if not pieces:
        return np.zeros(0, dtype=np.complex128), d
    A = block_diagonal([piece[0] for piece in pieces])
    b, c = (np.concatenate([piece[k] for piece in pieces]) for k in (1, 2))
    degree, gain = _leading(A, b, c, d)
    if not gain:
        return np.zeros(0, dtype=np.complex128), 0.0
    pencil = np.block([[A, b[:, None]], [c[None], np.array([[d]])]])
    unit = np.diag(np.append(np.ones(len(A)), 0.0))
    above, below = eigvals(pencil, unit, homogeneous_eigvals=True)
    finite = np.argsort(np.abs(below) / np.hypot(np.abs(above), np.abs(below)))[degree + 1 :]
    return above[finite] / below[finite], gain


def _leading(A: Floats, b: Floats, c: Floats, d: float) -> tuple[int, float]:
    """The relative degree, and the first Markov parameter that does not vanish."""
    if d:
        return 0, d
    vector = b
    for degree in range(1, len(A) + 1):
        products = c * vector
        if abs(products.sum()) > CANCELLED * np.abs(products).sum():
            return degree, float(products.sum())
        vector = A @ vector
    return len(A), 0.0


def _ascending(values: ArrayLike) -> Complexes:
    found = np.asarray(values, dtype=np.complex128).reshape(-1)
    return np.asarray(found[np.lexsort((found.imag, np.abs(found).round(12)))])
