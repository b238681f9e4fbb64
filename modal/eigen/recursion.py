"""The effective (apparent, dynamic) mass of a chain: frequencies and shapes that keep every digit.

Elimination from the free end.  With t = ω²/k and μ the effective mass felt at a link's lower joint,

    D = 1 − t (r + μ),    μ' = ((1 − t p) μ + m (1 − t J)) / D        (μ = 0 below the last link),

the number of D < 0 is the number of frequencies below ω (Sylvester's law of inertia: Parlett, The Symmetric
Eigenvalue Problem, §3.3), and a link whose upper joint moves by y turns by a = t (m s + μ) y / D and moves its lower
joint to y (1 + t q) / D.  From above the same equations hold with s → 1 − s, p ↔ r and ν, the effective mass of
everything above, in place of μ.

Arrays: links first, then pendula, then trial values x = ω² (natural units, g = 1): (n, P, R).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from modal.assembly import Block
from modal.pair import Constants
from modal.types import Floats

NUDGE = 2.0**-60
"""Subtracted from each D: far below its rounding, but turns an exact zero into a tiny negative number."""


def at_infinity(block: Block) -> tuple[Floats, Floats, Floats]:
    """(α, β, γ), each (P,), of the effective mass α − β/ω² − γ/ω⁴ − … at the pivot for high frequencies.

    α is the residual mass, which the pivot feels from inertia alone.  With R = r + α and u = m s + α below the link,

        α' = (p α + m J)/R,   β' = (k u² + β q²)/R²,   γ' = (k u + β q)²/R³ + γ q²/R²,

    sums of positive terms, from the recursion by expansion in 1/ω².
    """
    alpha = beta = gamma = np.zeros(block.size)
    for link in reversed(_rows(block.constants)):
        R, u = link.r + alpha, link.upper + alpha
        gamma = (link.k * u + beta * link.q) ** 2 / R**3 + gamma * link.q**2 / R**2
        beta = (link.k * u**2 + beta * link.q**2) / R**2
        alpha = (link.p * alpha + link.mJ) / R
    return alpha, beta, gamma


class Swept(NamedTuple):
    """Results of elimination in one direction: mass, energy at joints (n + 1, P, R), the rest at links (n, P, R).

    `mass` is the effective mass of that side, `gain` the ratio of the far joint's displacement to the near one's,
    `turn` that of a to the near one's; for a joint displaced by 1, `energy` is twice the kinetic energy over ω² of that
    whole side and `nearest` that of its nearest link.
    """

    mass: Floats
    energy: Floats
    nearest: Floats
    gain: Floats
    turn: Floats


def from_below(block: Block, x: Floats) -> Swept:
    """Everything below each joint, seen from above: joint n is free."""
    swept = _empty(block, x)
    swept.mass[-1] = swept.energy[-1] = swept.nearest[-1] = 0.0
    for i, link in reversed(list(enumerate(_columns(block)))):
        mu, t = swept.mass[i + 1], x / link.k
        D = 1.0 - t * (link.r + mu) - NUDGE
        swept.gain[i] = (1.0 + t * link.q) / D
        swept.turn[i] = t * (link.upper + mu) / D
        swept.mass[i] = _passed_on(link, x, link.p, mu) / D
        swept.nearest[i] = _kinetic(link, 1.0, swept.turn[i])
        swept.energy[i] = swept.nearest[i] + swept.energy[i + 1] * swept.gain[i] ** 2
    return swept


def from_above(block: Block, x: Floats, nu: Floats | None, energy: Floats | float = 0.0) -> Swept:
    """Everything above each joint, seen from below; mass `nu` and `energy` (P, R) at the pivot, None if it is fixed."""
    swept = _empty(block, x)
    swept.mass[0] = np.inf if nu is None else nu
    swept.energy[0], swept.nearest[0] = energy, 0.0
    for i, link in enumerate(_columns(block)):
        t = x / link.k
        if nu is None:
            swept.gain[i], swept.turn[i] = 0.0, 1.0
            swept.mass[i + 1] = link.r - 1.0 / t
        else:
            D = 1.0 - t * (link.p + nu) - NUDGE
            swept.gain[i] = (1.0 + t * link.q) / D
            swept.turn[i] = -t * (link.lower + nu) / D
            swept.mass[i + 1] = _passed_on(link, x, link.r, nu) / D
        swept.nearest[i + 1] = _kinetic(link, swept.gain[i], swept.turn[i])
        swept.energy[i + 1] = swept.nearest[i + 1] + swept.energy[i] * swept.gain[i] ** 2
        nu = swept.mass[i + 1]
    return swept


def kinetic(block: Block, y: Floats, a: Floats) -> Floats:
    """Twice each link's kinetic energy over ω², (n, P, R), from joints y (n + 1, P, R) and turns a (n, P, R)."""
    return np.array([_kinetic(link, y[i], a[i]) for i, link in enumerate(_columns(block))])


def joints(pivot: Floats, a: Floats) -> Floats:
    """Displacements (n + 1, P, R) of all joints from those of the pivots (R,) and the turns a (n, P, R)."""
    places: Floats = pivot + np.concatenate([np.zeros((1, *a.shape[1:])), np.cumsum(a, 0)])
    return places


def joint_masses(p: Floats, r: Floats) -> Floats:
    """Mass felt at each joint with every other joint held, (n + 1, …), from the links' p and r (n, …)."""
    masses = np.zeros((len(p) + 1, *p.shape[1:]))
    masses[:-1] += p
    masses[1:] += r
    return masses


def _columns(block: Block) -> list[Constants]:
    return _rows(Constants(*(values[:, :, None] for values in block.constants)))


def _rows(links: Constants) -> list[Constants]:
    """The constants link by link."""
    return [Constants(*row) for row in zip(*links, strict=True)]


def _passed_on(link: Constants, x: Floats, other: Floats, mass: Floats) -> Floats:
    passed: Floats = (1.0 - x * (other / link.k)) * mass + (link.m - x * (link.mJ / link.k))
    return passed


def _kinetic(link: Constants, y: Floats | float, a: Floats) -> Floats:
    twice: Floats = link.m * (y + link.upper / link.m * a) ** 2 + link.mJ / link.m * a**2
    return twice


def _empty(block: Block, x: Floats) -> Swept:
    shape = (block.size, x.shape[-1])
    return Swept(
        mass=np.empty((block.n + 1, *shape)),
        energy=np.empty((block.n + 1, *shape)),
        nearest=np.empty((block.n + 1, *shape)),
        gain=np.empty((block.n, *shape)),
        turn=np.empty((block.n, *shape)),
    )
