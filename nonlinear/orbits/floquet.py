"""Floquet multipliers of a periodic orbit; the trivial ones are deflated exactly.

A shift of time and, with nothing that holds the cart, a translation are carried into themselves: M v = v with v = f(y)
and v = e_x.  Energy and momentum are conserved: wᵀM = wᵀ with their gradients w.  M acts on ker w / span v, where only
the other multipliers are left: nothing is compared with 1, which Jordan pairs would leave far behind the accuracy of M.

From release at rest to rest on the other side, half a period, symmetric orbits of conservative scenes have the map

    H = P Q⁻¹ P Q,   P = diag(−1, 1),

with Q the flow over the first quarter.  It is reversible and symplectic, so that (H + H⁻¹)/2 = diag(C, Cᵀ) in canonical
coordinates, C its upper left block: every eigenvalue c of C is (σ + 1/σ)/2 for a pair of eigenvalues of H, and the
multipliers are σ².  All pairs on the unit circle: c real with |c| ≤ 1.  Time and energy are c = −1, once, and the
translation is c = 1.  Where left and right differ, an orbit still comes to rest at both ends: the same with Q the flow
over half a period is the map of the whole period, the multipliers are σ, time and energy are c = 1.

Stability is lost where a margin passes 0.  With half-traces t = (μ + 1/μ)/2 of the pairs, or the c of half a period, in
ascending order these are

    1 + t_1,   1 − t_k,   (t_{i+1} − t_i)²,

the last being the factors of the discriminant: analytic through a collision of two pairs, and negative behind it.
Where energy is lost there is one, 1 − max |μ|.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import NDArray

from modal.report import Displayed, Summary, brief
from modal.types import Complexes, Floats

CIRCLE_EXCESS_MAX = 1e-7
"""Tolerance: how far beyond 1 the accuracy of an orbit may carry |c|, and a multiplier of a conservative scene."""
PAIR_SPLIT_MIN = 1e-6
"""Tolerance: how far rounding may part two equal multipliers, or c: by the root of that of the map."""


@dataclass(frozen=True, eq=False)
class Map:
    """A map M (d, d) of perturbations with its known eigenvectors, `right` (r, d) and `left` (l, d), of `deflate`.

    It is C, above, where `half`, else the monodromy matrix.  All three change smoothly along a branch.
    """

    M: Floats
    right: Floats
    left: Floats
    half: bool
    conservative: bool

    @cached_property
    def quotient_map(self) -> Floats:
        """The map without the known eigenvectors."""
        return deflate(self.M, list(self.right), list(self.left))

    @cached_property
    def margins(self) -> Floats:
        """The margins above, (k + 1,), or one where energy is lost: all are positive while the orbit is stable."""
        if not len(self.quotient_map):
            return np.empty(0)
        if not self.conservative:
            return np.array([1 - np.abs(np.linalg.eigvals(self.quotient_map)).max()])
        t = np.sort_complex(np.linalg.eigvals(self.quotient_map) if self.half else half_traces(self.quotient_map))
        is_pair = (t.imag[1:] != 0) & (t[1:] == t[:-1].conj())
        gaps = np.where(is_pair, -((t.imag[1:] - t.imag[:-1]) ** 2), (t.real[1:] - t.real[:-1]) ** 2)
        return np.array([1 + t.real[0], 1 - t.real[-1], *gaps])

    @property
    def doubt(self) -> Floats:
        """How far below 0 the accuracy of an orbit may carry each of the margins."""
        if not self.conservative:
            return np.zeros(len(self.margins))
        return np.array([CIRCLE_EXCESS_MAX, CIRCLE_EXCESS_MAX, *[4 * PAIR_SPLIT_MIN**2] * len(self.margins)])[
            : len(self.margins)
        ]

    @cached_property
    def is_within(self) -> NDArray[np.bool_]:
        """Which of the margins hold."""
        return np.asarray(self.margins >= -self.doubt)


def half_traces(M: Floats) -> Complexes:
    """The t (k,) of the pairs of a map (2k, 2k) whose multipliers come in pairs μ, 1/μ.

    Its characteristic polynomial a_0 μ^{2k} + … + a_{2k} is the same backwards, μ^k (a_k + 2 Σ_j a_{k−j} T_j(t)) with
    Chebyshev's polynomials T_j.
    """
    a = np.real(np.poly(M))
    a = (a + a[::-1]) / 2
    k = len(a) // 2
    return np.asarray(chebyshev.chebroots(np.concatenate(([a[k]], 2 * a[:k][::-1]))).astype(complex))


@dataclass(frozen=True, eq=False, repr=False)
class Floquet(Displayed):
    """The multipliers of an orbit: the trivial (`neutral`) ones, which are 1, and the `others`, those of the `map`."""

    neutral: int
    others: Complexes
    map: Map

    @property
    def quotient_map(self) -> Floats:
        """The map without the neutral multipliers."""
        return self.map.quotient_map

    @property
    def half(self) -> bool:
        """Whether the map is that of half a period."""
        return self.map.half

    @property
    def conservative(self) -> bool:
        """Whether energy is conserved."""
        return self.map.conservative

    def _summary(self) -> Summary:
        kind = "stable" if self.is_stable else "unstable"
        largest = float(np.abs(self.others).max(initial=0.0))
        title = f"{len(self.all)} multipliers, {self.neutral} of them neutral: {kind}"
        return Summary(title, [("largest of the others", brief(largest))])

    @property
    def all(self) -> Complexes:
        """All of them, the neutral ones first, then by size."""
        return np.concatenate((np.ones(self.neutral), self.others))

    @property
    def is_stable(self) -> bool:
        """Whether no perturbation grows and, where energy is lost, all others decay."""
        if not len(self.others):
            return True
        if self.half:
            c = np.linalg.eigvals(self.quotient_map)
            return bool(np.all(np.abs(c.imag) < PAIR_SPLIT_MIN) and np.all(np.abs(c.real) <= 1 + CIRCLE_EXCESS_MAX))
        if self.conservative:
            t = (self.others + 1 / self.others) / 2
            return bool(np.all(np.abs(t.imag) < PAIR_SPLIT_MIN) and np.all(np.abs(t.real) <= 1 + CIRCLE_EXCESS_MAX))
        return bool(np.all(np.abs(self.others) < 1))

    @property
    def is_of_family(self) -> bool:
        """Whether others than the neutral ones are 1 where energy is lost, as along a continuous family of orbits."""
        return not self.conservative and bool(np.any(np.abs(self.others - 1) < CIRCLE_EXCESS_MAX))

    @property
    def meeting(self) -> tuple[float, float]:
        """Test functions det(R − 1) and det(R + 1) of the reduced map R: each changes sign where one meets 1 or −1."""
        size = np.eye(len(self.quotient_map))
        return float(np.linalg.det(self.quotient_map - size)), float(np.linalg.det(self.quotient_map + size))

    @property
    def n_split_pairs(self) -> int:
        """Pairs off the real axis and off the unit circle: of c where `half`; else growing ones."""
        if self.half:
            return int(np.sum(np.linalg.eigvals(self.quotient_map).imag > PAIR_SPLIT_MIN))
        if self.conservative:
            return int(np.sum(((self.others + 1 / self.others).imag > 2 * PAIR_SPLIT_MIN) & (np.abs(self.others) > 1)))
        return int(np.sum((self.others.imag > 0) & (np.abs(self.others) > 1)))

    @property
    def closest_pair(self) -> float:
        """|μ| − 1 of the complex pair closest to the unit circle; NaN without any."""
        pairs = np.abs(self.others[self.others.imag > 0]) - 1
        return float(pairs[np.abs(pairs).argmin()]) if len(pairs) else float("nan")


def deflate(M: Floats, right: list[Floats], left: list[Floats]) -> Floats:
    """M on ker w / span v, where M v = v for all v of `right` and wᵀM = wᵀ for all w of `left`; wᵀv = 0."""
    if not right and not left:
        return M
    eigenvectors = np.array([*right, *left])
    eigenvectors /= np.linalg.norm(eigenvectors, axis=1, keepdims=True)
    _, _, rows = np.linalg.svd(eigenvectors)
    W = rows[len(eigenvectors) :].T
    return np.asarray(W.T @ M @ W)


def scaled_translations(translations: Floats, scale: Floats) -> Floats:
    """The effect of translations (k, first) in m on coordinates with these units, by at most 1, (k, len(scale))."""
    shifts = np.pad(translations, ((0, 0), (0, len(scale) - translations.shape[1]))) / scale
    return np.asarray(shifts / np.abs(shifts).max(axis=1, keepdims=True)) if len(shifts) else shifts


def of_monodromy(M: Floats, right: list[Floats], left: list[Floats], *, conservative: bool) -> Floquet:
    """The multipliers of a monodromy matrix (d, d) with its known eigenvectors."""
    size = len(M)
    monodromy = Map(
        M, np.reshape(right, (-1, size)), np.reshape(left, (-1, size)), half=False, conservative=conservative
    )
    values = np.linalg.eigvals(monodromy.quotient_map).astype(complex)
    return Floquet(size - len(monodromy.quotient_map), _sorted_multipliers(values), monodromy)


def of_symmetric(H: Floats, force: Floats, translates: Floats, *, halves: int = 2) -> Floquet:
    """The multipliers from the map H, with the gradient of the potential at rest (n,) and translations (k, n).

    H is that of half a period of orbits that are the same to the left and to the right; with `halves` = 1 that of the
    whole period of orbits that only come to rest at both ends: P Q⁻¹ P Q as well, Q being the flow over half of it.
    """
    size = len(force)
    monodromy = Map(H[:size, :size], translates, force[None], half=True, conservative=True)
    c = np.linalg.eigvals(monodromy.quotient_map).astype(complex)
    root = np.sqrt(c * c - 1)
    sigma = np.concatenate((c + root, 1 / (c + root)))
    return Floquet(2 + 2 * len(translates), _sorted_multipliers(sigma**halves), monodromy)


def _sorted_multipliers(values: Complexes) -> Complexes:
    return np.asarray(values[np.lexsort((-values.imag, -np.round(np.abs(values), 9)))])
