"""Frequencies of small and long scenes in many digits, by methods that share no line with the package.

    small    M, K and D from the velocities of every centre of mass and the heights of all; the symmetric pencil by
             Cholesky factors and the state matrix with dampers, both by mpmath with as many digits as the spread needs
    long     the count of frequencies below ω from the elimination of K − ω²M over the *displacements of the joints*,
             in which both matrices are tridiagonal along a chain and the cart borders them (Sylvester's law of inertia)

The floats of a scene are taken exactly as they are stored.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import mpmath as mp
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from modal import Bob, Body, Cart, Rod, Scene

Turning = dict[int, mp.mpf]
Terms = list[tuple[mp.mpf, Turning]]
SPREAD_DIGITS = 600
STATE_DIGITS = 160
COUNT_DIGITS = 60
ROUNDED = 40
FLOOR, FAR = 1e-30, 1e30


@dataclass(frozen=True)
class Pencil:
    """M, K and D (size, size) in many digits; `free` says that coordinate 0 is a free cart."""

    M: mp.matrix
    K: mp.matrix
    D: mp.matrix
    free: bool


# ------------------------------------------------------------------------------------------------------- small


def pencil(scene: Scene) -> Pencil:
    """Over the cart (if any) and the angles of all links from equilibrium, copies expanded, along the rail.

    M = Σ w v vᵀ over everything that moves with v; likewise K and D over springs and dampers, and gravity g Σ m h.
    """
    cart = scene.support if isinstance(scene.support, Cart) else None
    at = int(cart is not None)
    base: Turning = {0: mp.mpf(1)} if cart else {}
    weighed: list[Terms] = [[], [], []]
    if cart:
        for terms, weight in zip(weighed, (cart.mass, cart.stiffness, cart.damping), strict=True):
            terms.append((mp.mpf(weight), base))
    for links, ways in _chains(scene):
        _hang(links, ways, mp.mpf(scene.gravity), at, base, weighed)
        at += len(links)
    M, K, D = (_summed(at, terms) for terms in weighed)
    return Pencil(M, K, D, cart is not None and cart.stiffness == 0)


def squares(scene: Scene, digits: int = SPREAD_DIGITS) -> list[mp.mpf]:
    """Every finite ω² without the zero of a free cart, ascending; negative for unstable modes."""
    with mp.workdps(digits):
        whole = pencil(scene)
        M, K = _without_cart(whole.M, whole.K) if whole.free else (whole.M, whole.K)
        if scene.stands:
            return sorted(mp.eigsy(_in_factors(M, K), eigvals_only=True))
        inverse = mp.eigsy(_in_factors(K, M), eigvals_only=True)
        largest = max(inverse)
        return sorted(1 / x for x in inverse if x > largest * mp.mpf(10) ** (-digits // 2))


def eigenvalues(scene: Scene, digits: int = STATE_DIGITS) -> list[mp.mpc]:
    """λ of M q'' + D q' + K q = 0, one of each conjugate pair, by |λ|; without the zero of a free cart's position."""
    with mp.workdps(digits):
        whole = pencil(scene)
        n, held = whole.M.rows, whole.M.rows - whole.free
        force = mp.inverse(whole.M) * _beside(whole.K, whole.D)
        state = mp.zeros(held + n)
        for i in range(held):
            state[i, held + whole.free + i] = 1
        for i in range(n):
            for j in range(held + n):
                state[held + i, j] = -force[i, j + whole.free]
        values = mp.eig(state, left=False, right=False)
        coasts = whole.free and not any(whole.D[0, j] for j in range(n))
        still = min(values, key=abs) if coasts else None
        return sorted((_settled(v) for v in values if v is not still and _settled(v).imag >= 0), key=abs)


def _settled(value: mp.mpc) -> mp.mpc:
    """The real part where the imaginary part is rounding."""
    return mp.mpc(value.real) if abs(value.imag) < abs(value) * mp.mpf(10) ** -ROUNDED else mp.mpc(value)


def _hang(
    links: list[Bob | Rod | Body], ways: list[int], g: mp.mpf, at: int, base: Turning, weighed: list[Terms]
) -> None:
    """Add one chain, its angles numbered from `at`, to the terms of M, K and D."""
    inertia, springs, dampers = weighed
    pivot = dict(base)
    for i, (link, way) in enumerate(zip(links, ways, strict=True)):
        m, l, c, turn = *(mp.mpf(v) for v in (link.mass, link.length)), *_centre_and_inertia(link)
        turning, joint = {at + i: mp.mpf(1)}, {at + i: mp.mpf(1)} | ({at + i - 1: mp.mpf(-1)} if i else {})
        inertia += [(m, {**pivot, at + i: way * c}), (turn, turning)]
        springs += [(g * m * arm, {angle: mp.mpf(1)}) for angle, arm in pivot.items() if angle >= at]
        springs += [(g * m * c * way, turning), (mp.mpf(link.stiffness), joint)]
        dampers.append((mp.mpf(link.damping), joint))
        pivot[at + i] = way * l


def _centre_and_inertia(link: Bob | Rod | Body) -> tuple[mp.mpf, mp.mpf]:
    m, l = mp.mpf(link.mass), mp.mpf(link.length)
    if isinstance(link, Body):
        return mp.mpf(link.centre), mp.mpf(link.inertia)
    return (l, mp.mpf(0)) if isinstance(link, Bob) else (l / 2, m * l**2 / 12)


def _chains(scene: Scene) -> Iterator[tuple[list[Bob | Rod | Body], list[int]]]:
    for pendulum in scene.pendulum:
        links = [link for link in pendulum.links for _ in range(link.count)]
        yield from [(links, [1 if way == "down" else -1 for way in pendulum.ways])] * pendulum.count


def _summed(size: int, terms: Terms) -> mp.matrix:
    whole = mp.zeros(size)
    for weight, v in terms:
        for i, a in v.items():
            for j, b in v.items():
                whole[i, j] += weight * a * b
    return whole


def _without_cart(M: mp.matrix, K: mp.matrix) -> tuple[mp.matrix, mp.matrix]:
    """The momentum of a free cart is zero in every other mode: A − b bᵀ/M."""
    n = M.rows
    reduced = mp.matrix(n - 1)
    for i in range(1, n):
        for j in range(1, n):
            reduced[i - 1, j - 1] = M[i, j] - M[i, 0] * M[0, j] / M[0, 0]
    return reduced, K[1:n, 1:n]


def _in_factors(S: mp.matrix, T: mp.matrix) -> mp.matrix:
    """L⁻¹ T L⁻ᵀ with S = L Lᵀ."""
    L = mp.cholesky(S)
    n, half = S.rows, T.copy()
    for _ in range(2):
        for j in range(n):
            for i in range(n):
                half[i, j] = (half[i, j] - mp.fdot((L[i, k], half[k, j]) for k in range(i))) / L[i, i]
        half = half.T
    return (half + half.T) / 2


def _beside(K: mp.matrix, D: mp.matrix) -> mp.matrix:
    n = K.rows
    whole = mp.matrix(n, 2 * n)
    whole[:, :n], whole[:, n:] = K, D
    return whole


# -------------------------------------------------------------------------------------------------------- long


class Counter:
    """Counts of the frequencies below ω of a hanging scene, without joint springs or dampers."""

    def __init__(self, scene: Scene, digits: int = COUNT_DIGITS) -> None:
        self.digits, self.support = digits, scene.support
        with mp.workdps(digits):
            g = mp.mpf(scene.gravity)
            tallied: dict[tuple[Bob | Rod | Body, ...], int] = {}
            for pendulum in scene.pendulum:
                tallied[pendulum.links] = tallied.get(pendulum.links, 0) + pendulum.count
            self.chains = [(_elements(links, g), count) for links, count in tallied.items()]

    def below(self, omega: float, tilt: float = 0.0) -> int:
        """Number of frequencies below ω (1 + tilt), without the zero of a free cart."""
        with mp.workdps(self.digits):
            x = (mp.mpf(omega) * (1 + mp.mpf(tilt))) ** 2
            negative, pivot = 0, mp.mpf(0)
            for elements, count in self.chains:
                below, left = _eliminated(elements, x)
                negative, pivot = negative + count * below, pivot + count * left
            if not isinstance(self.support, Cart):
                return negative
            cart = mp.mpf(self.support.stiffness) - x * mp.mpf(self.support.mass) + pivot
            return negative + int(cart < 0) - (self.support.stiffness == 0)

    def error(self, omega: float, number: int) -> float:
        """Smallest τ = 2^−54 · 2^k for which frequency `number`, from 0, lies between ω(1 − τ) and ω(1 + τ)."""
        tau = 2.0**-54
        while tau < 1 and omega > 0:
            if self.below(omega, -tau) <= number < self.below(omega, tau):
                return tau
            tau *= 2
        return 1.0


def _elements(links: tuple[Bob | Rod | Body, ...], g: mp.mpf) -> list[tuple[mp.mpf, ...]]:
    """p, q, r of the kinetic energy ½p y² + q y z + ½r z² and tension k of each link, last link first."""
    elements, hanging = [], mp.mpf(0)
    for link in reversed([entry for entry in links for _ in range(entry.count)]):
        m, l, (c, turn) = mp.mpf(link.mass), mp.mpf(link.length), _centre_and_inertia(link)
        s, j = c / l, turn / l**2
        elements.append((m * (1 - s) ** 2 + j, m * s * (1 - s) - j, m * s**2 + j, g * (m * s + hanging) / l))
        hanging += m
    return elements


def _eliminated(elements: list[tuple[mp.mpf, ...]], x: mp.mpf) -> tuple[int, mp.mpf]:
    """Negative pivots of K − x M from the free end up, and the remainder at the pivot of the chain."""
    negative, left = 0, mp.mpf(0)
    for p, q, r, k in elements:
        left += k - x * r
        negative += left < 0
        left = k - x * p - (k + x * q) ** 2 / left
    return negative, left


# ------------------------------------------------------------------------------------------------------ errors


def relative_errors(omega: NDArray[np.float64], exact: Sequence[mp.mpf]) -> NDArray[np.float64]:
    """|ω/√ω²exact − 1| one by one, both ascending, the sign of ω being that of ω²; [∞] if their counts differ."""
    if len(omega) != len(exact):
        return np.array([np.inf])
    with mp.workdps(COUNT_DIGITS):
        return np.array([_apart(value, mp.sign(x) * mp.sqrt(abs(x))) for value, x in zip(omega, exact, strict=True)])


def unlike(values: NDArray[np.complex128], exact: Sequence[mp.mpc]) -> NDArray[np.float64]:
    """Relative distances of eigenvalues from exact ones, each exact one matched at most once; ∞ for unmatched ones."""
    with mp.workdps(COUNT_DIGITS):
        distance = np.array([[_apart(value, x) for x in exact] for value in values]).reshape(len(values), len(exact))
    rows, columns = linear_sum_assignment(np.log(distance + FLOOR))
    errors = np.full(len(values), np.inf)
    errors[rows] = distance[rows, columns]
    return errors


def _apart(value: complex, exact: mp.mpc) -> float:
    return float(abs(mp.mpmathify(complex(value)) / exact - 1)) if np.isfinite(value) else FAR
