"""Closed-form optimum of one pendulum as an absorber of one mode: Den Hartog's values, and the exact ones.

A pendulum of one link with the inertia A about its joint and the first moment b is, next to a support that it pulls by
b, a mass b²/A on a spring, leaving the support M + m − b²/A. With μ their ratio, ω_1² = k/(M + m − b²/A), f
= ω_d/ω_1 and ζ = c/(2 A ω_d), the peak of k|x/F| is least, to first order about its two fixed points, for

    f = 1/(1 + μ),    ζ = √(3μ/(8(1 + μ)))                      [DenHartog1956, §3.3]

and exactly, of a support without a damper, for [Nishihara2002]

    f = 2/(1+μ) √(2(16+23μ+9μ²+2(2+μ)√(4+3μ))/(3(64+80μ+27μ²))),    ζ = ¼√((8+9μ−4√(4+3μ))/(1+μ))

On several supports the mode nearest to the pendulum stands for the support: with φᵀMφ = 1 and the row M_j of the
pendulum, μ = (M_j φ)²/A.  There both are a rule, not the best.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import sqrt

import numpy as np
import scipy

from modal.assembly import matrices
from modal.report import Displayed
from modal.scene import Scene
from modal.scene.doors import checked
from modal.scene.parameters import Place, with_numbers
from modal.tuning.quantities import FreeNumber
from modal.types import Floats


def den_hartog(mu: float) -> tuple[float, float]:
    """The f and ζ of Den Hartog.

    >>> [round(value, 6) for value in den_hartog(0.05)]
    [0.952381, 0.133631]
    """
    return 1 / (1 + mu), sqrt(3 * mu / (8 * (1 + mu)))


def exact_optimum(mu: float) -> tuple[float, float]:
    """The f and ζ of the least peak of a support without a damper.

    >>> [round(value, 8) for value in exact_optimum(0.05)]
    [0.95237204, 0.13393773]
    """
    root = sqrt(4 + 3 * mu)
    inner = 2 * (16 + 23 * mu + 9 * mu**2 + 2 * (2 + mu) * root) / (3 * (64 + 80 * mu + 27 * mu**2))
    return 2 / (1 + mu) * sqrt(inner), sqrt((8 + 9 * mu - 4 * root) / (1 + mu)) / 4


@dataclass(frozen=True, repr=False)
class Absorber(Displayed):
    """A pendulum of one link, at `pendulum` of the scene, next to a mode of the rest.

    `mu` is the ratio of masses, `omega` (rad/s) and `damping_ratio` are those of the mode, `f` and `zeta` the
    pendulum's own frequency over it and its own damping ratio; `alone` where the rest has one coordinate.
    """

    what = "Pendulum as an absorber"
    shows = (
        "pendulum: pendulum; mu: mass ratio μ; omega: ω of the mode, rad/s; damping_ratio: damping ratio of the mode;"
        " f: tuning; zeta: damping ratio of the absorber"
    )

    pendulum: int
    mu: float
    omega: float
    damping_ratio: float
    f: float
    zeta: float
    alone: bool

    @property
    def den_hartog(self) -> tuple[float, float]:
        """The f and ζ of Den Hartog."""
        return den_hartog(self.mu)

    @property
    def exact(self) -> tuple[float, float]:
        """The f and ζ of the least peak of a support without a damper."""
        return exact_optimum(self.mu)


@dataclass(frozen=True, eq=False)
class Beside:
    """The modes of the supports without the pendula: `omega` (R,) and ratios (R,), and of pendula μ by mode."""

    omega: Floats
    damping_ratio: Floats
    pendula: tuple[int, ...]
    mu: Floats
    own_omega: Floats
    zeta: Floats


def rest_of_scene(scene: Scene, pendula: Sequence[int]) -> Beside | None:
    """The rest of a scene without these pendula of one link; None if it has no modes, or springs couple them."""
    linear = matrices(scene)
    counts = [pendulum.count * sum(link.count for link in pendulum.links) for pendulum in scene.pendulum]
    first = len(linear.M) - sum(counts)
    starts = first + np.concatenate(([0], np.cumsum(counts)))
    columns = np.array([int(starts[p]) + k for p in pendula for k in range(counts[p])])
    rest = np.setdiff1d(np.arange(len(linear.M)), columns)
    if not len(rest):
        return None
    K, D, M = linear.K, linear.D, linear.M
    if np.abs(K[np.ix_(columns, rest)]).max(initial=0.0) > 1e-9 * np.abs(np.diag(K)[columns]).max():
        return None
    A = np.diag(M)[columns]
    rows = M[np.ix_(columns, rest)]
    base = M[np.ix_(rest, rest)] - rows.T @ (rows / A[:, None])
    try:
        squares, phi = scipy.linalg.eigh(K[np.ix_(rest, rest)], base)
    except np.linalg.LinAlgError:
        return None
    oscillates = squares > 1e-12 * squares.max(initial=0.0)
    if not oscillates.any():
        return None
    omega, phi = np.sqrt(squares[oscillates]), phi[:, oscillates]
    ratio = np.einsum("ir,ij,jr->r", phi, D[np.ix_(rest, rest)], phi) / (2 * omega)
    mu = np.zeros((len(pendula), len(omega)))
    own_omega, zeta = np.zeros(len(pendula)), np.zeros(len(pendula))
    at = 0
    for k, p in enumerate(pendula):
        rows_of_pendulum = slice(at, at + counts[p])
        mu[k] = ((rows[rows_of_pendulum] @ phi) ** 2 / A[rows_of_pendulum, None]).sum(0)
        own_omega[k] = np.sqrt(K[columns[at], columns[at]] / A[at])
        zeta[k] = D[columns[at], columns[at]] / (2 * A[at] * own_omega[k])
        at += counts[p]
    return Beside(omega, ratio, tuple(pendula), mu, own_omega, zeta)


def single_links(scene: Scene, free: Sequence[FreeNumber]) -> list[int]:
    """The pendula of one hanging link that has a free number."""
    free_pendula = {number.place[1] for number in free if number.place[0] == "pendulum" and "links" in number.place}
    return [
        p
        for p, number in enumerate(scene.pendulum)
        if p in free_pendula
        and len(number.links) == 1
        and number.links[0].count == 1
        and "up" not in (number.equilibrium or ())
    ]


@checked
def absorbers(scene: Scene, free: Sequence[FreeNumber]) -> tuple[Absorber, ...]:
    """Return the tuned pendula of one link, each with the mode of the rest nearest to its own frequency."""
    pendula = single_links(scene, free)
    rest = rest_of_scene(scene, pendula) if pendula else None
    if rest is None:
        return ()
    all_absorbers = []
    for k, p in enumerate(rest.pendula):
        mode = int(np.abs(np.log(rest.omega / rest.own_omega[k])).argmin())
        omega, mu = float(rest.omega[mode]), float(rest.mu[k, mode])
        if mu <= 0:
            continue
        ratio, f = float(rest.damping_ratio[mode]), float(rest.own_omega[k]) / omega
        all_absorbers.append(Absorber(p, mu, omega, ratio, f, float(rest.zeta[k]), len(rest.omega) == 1))
    return tuple(all_absorbers)


def values_for(scene: Scene, p: int, omega: float, zeta: float) -> dict[str, float] | None:
    """The length and the damper of a pendulum of one bob or rod with this frequency and damping ratio of its own."""
    link = scene.pendulum[p].links[0]
    if link.kind == "body" or link.linear_coefficients[0] or link.rotor_inertia:
        return None
    share = 1.0 if link.kind == "bob" else 2.0 / 3.0
    length = scene.gravity / omega**2 / share
    inertia = link.mass * length**2 * (1.0 if link.kind == "bob" else 1.0 / 3.0)
    place: Place = ("pendulum", p, "links", 0)
    return {
        with_numbers((*place, "length")): length,
        with_numbers((*place, "damping")): 2 * zeta * inertia * omega,
    }
