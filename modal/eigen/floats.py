"""The recursion of few links at few trial values, in Python floats; numba compiles the same two steps.

The arithmetic is that of `modal.eigen.sturm` and `modal.eigen.rayleigh`, operation by operation.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import nan
from typing import Any

import numpy as np

from modal.types import Floats, Ints


def passed(k: Any, r: Any, p: Any, m: Any, mJ: Any, y: Any, mu: Any, nudge: Any) -> Any:
    """(D, μ') of one link."""
    t = y * k
    D = 1.0 - (mu + r) * t - nudge
    return D, (mu * (1.0 - p * t) + (m - mJ * t)) / D


def passed_with_energy(k: Any, r: Any, p: Any, m: Any, mJ: Any, q: Any, y: Any, mu: Any, energy: Any) -> Any:
    """(μ', energy') of one link."""
    t = y * k
    D = 1.0 - r * t - t * mu
    carried = (1.0 + q * t) / D
    return (mu * (1.0 - p * t) + (m - mJ * t)) / D, ((energy + r) * carried + 2 * q) * carried + p


def count_and_mass(constants: tuple[Floats, ...], x: Floats, nudge: float) -> tuple[Ints, Floats]:
    """Pivots D < 0 and the mass at the pivot, (P, R, 1), of chains (1/k, r, p, m, m J) at trial values (R, 1)."""
    counts = [[_count(links, y, nudge) for y in x.ravel().tolist()] for links in _chains(constants)]
    below, mass = np.array(counts).transpose(2, 0, 1)[..., None]
    return below.astype(np.int64), mass


def mass_and_energy(constants: tuple[Floats, ...], x: Floats) -> tuple[Floats, Floats]:
    """Mass and energy at the pivot, (P, R, 1), of chains (1/k, r, p, m, m J, q) at trial values (R, 1)."""
    sums = [[_accumulate(links, y) for y in x.ravel().tolist()] for links in _chains(constants)]
    mass, energy = np.array(sums).transpose(2, 0, 1)[..., None]
    return mass, energy


def _chains(constants: tuple[Floats, ...]) -> Iterator[list[Any]]:
    """The constants of the links of each chain, tip first."""
    for p in range(constants[0].shape[1]):
        yield list(zip(*(values[::-1, p, 0, 0].tolist() for values in constants), strict=True))


def _count(links: list[Any], y: float, nudge: float) -> tuple[float, float]:
    try:
        return nudged(links, y, nudge) if nudge else swept(links, y)
    except ZeroDivisionError:
        return 0, nan


def _accumulate(links: list[Any], y: float) -> tuple[float, float]:
    try:
        return swept_with_energy(links, y)
    except ZeroDivisionError:
        return nan, nan


def swept(links: list[Any], y: float) -> tuple[int, float]:
    """Pivots D < 0 and the mass at the pivot of links (1/k, r, p, m, m J), tip first: `passed`, without its calls."""
    mu, below = 0.0, 0
    for k, r, p, m, mJ in links:
        t = y * k
        D = 1.0 - (mu + r) * t
        if D < 0.0:
            below += 1
        mu = (mu * (1.0 - p * t) + (m - mJ * t)) / D
    return below, mu


def nudged(links: list[Any], y: float, nudge: float) -> tuple[int, float]:
    """The same with D less the nudge."""
    mu, below = 0.0, 0
    for k, r, p, m, mJ in links:
        D, mu = passed(k, r, p, m, mJ, y, mu, nudge)
        below += D < 0
    return below, mu


def swept_with_energy(links: list[Any], y: float) -> tuple[float, float]:
    """Mass and energy at the pivot of links (1/k, r, p, m, m J, q), tip first: `passed_with_energy`, the same way."""
    mu = energy = 0.0
    for k, r, p, m, mJ, q in links:
        t = y * k
        D = 1.0 - r * t - t * mu
        carried = (1.0 + q * t) / D
        mu = (mu * (1.0 - p * t) + (m - mJ * t)) / D
        energy = ((energy + r) * carried + 2.0 * q) * carried + p
    return mu, energy
