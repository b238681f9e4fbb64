"""Floquet multipliers of a periodic orbit, those that are 1 for a known reason taken out exactly.

A shift of time and, with nothing that holds the cart, a translation are carried into themselves: M v = v with v = f(y)
and v = e_x.  Energy and momentum are conserved: wᵀM = wᵀ with their gradients w.  M acts on ker w / span v, where only
the other multipliers are left: nothing is compared with 1, which Jordan pairs would leave far behind the accuracy of M.

From release at rest to rest on the other side, half a period, symmetric orbits of conservative scenes have the map

    H = P Q⁻¹ P Q,   P = diag(−1, 1),

with Q the flow over the first quarter.  It is reversible and symplectic, so that (H + H⁻¹)/2 = diag(C, Cᵀ) in canonical
coordinates, C its upper left block: every eigenvalue c of C is (σ + 1/σ)/2 for a pair of eigenvalues of H, and the
multipliers are σ².  All pairs on the unit circle: c real with |c| ≤ 1.  Time and energy are c = −1, once, and the
translation is c = 1.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from modal.report import Displayed, Summary, brief
from modal.types import Complexes, Floats

ON_CIRCLE = 1e-7  # how far beyond 1 the accuracy of an orbit may carry |c|, and a multiplier of a conservative scene
REAL = 1e-6  # imaginary part of c below which two equal ones are taken for real


@dataclass(frozen=True, eq=False, repr=False)
class Floquet(Displayed):
    """The multipliers of an orbit: the `neutral` ones, which are 1, and the `others`.

    `reduced` is the map without the neutral ones: of half a period, C above, where `half`, else of the whole one.
    """

    neutral: int
    others: Complexes
    reduced: Floats
    half: bool
    conservative: bool

    def _summary(self) -> Summary:
        kind = "stable" if self.is_stable else "unstable"
        largest = float(np.abs(self.others).max(initial=0.0))
        title = f"{len(self.all)} multipliers, {self.neutral} of them neutral: {kind}"
        return Summary(title, [("largest besides", brief(largest))])

    @property
    def all(self) -> Complexes:
        """All of them, the neutral ones first, then by size."""
        return np.concatenate((np.ones(self.neutral), self.others))

    @property
    def is_stable(self) -> bool:
        """Whether no disturbance grows and, where energy is lost, all others decay."""
        if not len(self.others):
            return True
        if self.half:
            c = np.linalg.eigvals(self.reduced)
            return bool(np.all(np.abs(c.imag) < REAL) and np.all(np.abs(c.real) <= 1 + ON_CIRCLE))
        if self.conservative:
            t = (self.others + 1 / self.others) / 2
            return bool(np.all(np.abs(t.imag) < REAL) and np.all(np.abs(t.real) <= 1 + ON_CIRCLE))
        return bool(np.all(np.abs(self.others) < 1))

    @property
    def meeting(self) -> tuple[float, float]:
        """Test functions det(R − 1) and det(R + 1) of the reduced map R: each changes sign where one meets 1 or −1."""
        size = np.eye(len(self.reduced))
        return float(np.linalg.det(self.reduced - size)), float(np.linalg.det(self.reduced + size))

    @property
    def apart(self) -> int:
        """Pairs off the real axis and off the unit circle: of c where `half`; else growing ones."""
        if self.half:
            return int(np.sum(np.linalg.eigvals(self.reduced).imag > REAL))
        if self.conservative:
            return int(np.sum(((self.others + 1 / self.others).imag > 2 * REAL) & (np.abs(self.others) > 1)))
        return int(np.sum((self.others.imag > 0) & (np.abs(self.others) > 1)))

    @property
    def closest_pair(self) -> float:
        """|μ| − 1 of the complex pair closest to the unit circle; NaN without any."""
        pairs = np.abs(self.others[self.others.imag > 0]) - 1
        return float(pairs[np.abs(pairs).argmin()]) if len(pairs) else float("nan")


def deflated(M: Floats, right: list[Floats], left: list[Floats]) -> Floats:
    """M on ker w / span v, where M v = v for all v of `right` and wᵀM = wᵀ for all w of `left`; wᵀv = 0."""
    if not right and not left:
        return M
    known = np.array([*right, *left])
    known /= np.linalg.norm(known, axis=1, keepdims=True)
    _, _, rows = np.linalg.svd(known)
    W = rows[len(known) :].T
    return np.asarray(W.T @ M @ W)


def whole(M: Floats, right: list[Floats], left: list[Floats], *, conservative: bool) -> Floquet:
    """The multipliers of a monodromy matrix (d, d) with its known eigenvectors."""
    reduced = deflated(M, right, left)
    values = np.linalg.eigvals(reduced).astype(complex)
    return Floquet(len(M) - len(reduced), _ordered(values), reduced, half=False, conservative=conservative)


def of_symmetric(H: Floats, force: Floats, translates: Floats | None) -> Floquet:
    """The multipliers from the map H of half a period, with the gradient of the potential at rest and e_x, (n,)."""
    C = H[: len(force), : len(force)]
    reduced = deflated(C, [] if translates is None else [translates], [force])
    c = np.linalg.eigvals(reduced).astype(complex)
    root = np.sqrt(c * c - 1)
    sigma = np.concatenate((c + root, 1 / (c + root)))
    neutral = 2 if translates is None else 4
    return Floquet(neutral, _ordered(sigma**2), reduced, half=True, conservative=True)


def _ordered(values: Complexes) -> Complexes:
    return np.asarray(values[np.lexsort((-values.imag, -np.round(np.abs(values), 9)))])
