"""Chains with joint springs or inverted links: the effective mass together with a moment felt by the link above.

With a spring the part below a joint depends on the angle φ of the link above as well as on the displacement y of the
joint.  Eliminated from the free end, with x = ω², that part is the quadratic form

    −x μ y² − 2 x h y φ + F φ²,        Δ = μ F + x h²

of an effective mass μ, first moment h and stiffness F; Δ is kept separately, as it would lose its digits as a sum.  For
a link of mass m, centre c, inertia I and length l, with r = l − c, its weight G = σ g b, and s of the spring at its
upper joint,

    H = l μ + h + m c,        N = Δ + μ (G − x (I + m r²)) − 2 x m r h + m (G + F − x I),
    B = G + F − x (I + m c² + l (l μ + 2 h)),        D = B + s,
    μ' = (N + s (μ + m)) / D,    h' = s H / D,    F' = s B / D,    Δ' = s N / D        (all 0 below the last link).

The number of D < 0 is the number of x below, negative ones included (Sylvester's law of inertia).  Without springs
this is `modal.eigen.recursion`; with them the four are the minors of a 2 × 2 form, so that a stiff spring subtracts
nothing (compound matrices: Ng & Reid, J. Comput. Phys. 30, 125 (1979)).  Angles are σ θ, those of the hanging chain:
in these a spring acts on σ_i θ_i − σ_i σ_{i−1} (σ_{i−1} θ_{i−1}).
Shapes come from inverse iteration in the same elimination (`modal.eigen.trees`).

Arrays as in `modal.eigen.recursion`: links first, then pendula, then trial values x: (n, P, R).
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from modal.assembly import Block
from modal.types import Floats, Ints

NUDGE = 2.0**-60
"""An exact zero of D becomes minus this fraction of a link's weight and spring."""


class EliminatedChain(NamedTuple):
    """The results of eliminating one link, arrays (P, R), or all of them, (n, P, R).

    `pivot` is D and `moment` H; `first_moment` h and `stiffness` F are those below the link, `mass` is μ' above it.
    """

    pivot: Floats
    moment: Floats
    first_moment: Floats
    stiffness: Floats
    mass: Floats


def eliminate(block: Block, x: Floats) -> Iterator[EliminatedChain]:
    """Every link at x (R,), from the last to the first."""
    mu, h, F, delta = (np.zeros((block.size, x.shape[-1])) for _ in range(4))
    turned = turns(block)
    for i in reversed(range(block.n)):
        m, l, c, inertia, s = _link(block, i)
        r, G = l - c, (block.sigma[i] * block.b[i])[:, None]
        lm, held = l * mu, G + F
        H = lm + h + m * c
        N = delta + mu * (G - x * (inertia + m * r * r)) - x * (2 * m * r * h) + m * (held - x * inertia)
        B = held - x * (inertia + m * c * c + l * (lm + 2 * h))
        D = B + s
        D = np.where(D == 0, -NUDGE * (np.abs(G) + s), D)
        above = (N + s * (mu + m)) / D
        yield EliminatedChain(D, H, h, F, above)
        passed = s / D
        mu, h, F, delta = above, turned[i][:, None] * passed * H, passed * B, passed * N


def eliminated(block: Block, x: Floats) -> EliminatedChain:
    """All links, top first."""
    links = list(eliminate(block, x))[::-1]
    return EliminatedChain(*(np.array(values) for values in zip(*links, strict=True)))


def count_and_mass(block: Block, x: Floats) -> tuple[Ints, Floats]:
    """Number of ω² of each chain on a fixed support below each x (R,), and the mass felt at its pivot, (P, R)."""
    below = np.zeros((block.size, x.shape[-1]), dtype=np.int64)
    for link in eliminate(block, x):
        below += link.pivot < 0
    return below, link.mass


def _link(block: Block, i: int) -> list[Floats]:
    """Mass, length, centre, inertia and spring of the links in row i, (P, 1) each."""
    arrays = (block.mass, block.length, block.centre, block.inertia, block.stiffness)
    return [values[i][:, None] for values in arrays]


def turns(block: Block) -> Floats:
    """σ_i σ_{i−1} (n, P), 1 at the support."""
    return np.concatenate([np.ones((1, block.size)), block.sigma[1:] * block.sigma[:-1]])


def gathered(block: Block, pivots: EliminatedChain, x: Floats, force: Floats, moment: Floats) -> tuple[Floats, Floats]:
    """The load on each link (n, P, R) once everything below is eliminated, and the force on the pivot (P, R)."""
    felt, pivot = np.empty_like(moment), np.zeros(moment.shape[1:])
    passed, turned = pivot, turns(block)
    for i in reversed(range(block.n)):
        _, l, c, _, s = _link(block, i)
        felt[i] = l * pivot + passed + c * force[i] + moment[i]
        pivot = pivot + force[i] + x * pivots.moment[i] * felt[i] / pivots.pivot[i]
        passed = turned[i][:, None] * s * felt[i] / pivots.pivot[i]
    return felt, pivot


def descended(block: Block, pivots: EliminatedChain, x: Floats, felt: Floats, pivot: Floats) -> tuple[Floats, Floats]:
    """Angles and displacements of the centres (n, P, R) under the load on each link, pivots displaced (R,) or (P, R).

    The lower joint moves by y + l θ = (y (D + x l H) + l (s φ + …)) / D, in which D + x l H needs no μ.
    """
    angles, centres = np.empty_like(felt), np.empty_like(felt)
    above, y, turned = np.zeros(felt.shape[1:]), np.broadcast_to(pivot, felt.shape[1:]), turns(block)
    for i in range(block.n):
        m, l, c, inertia, s = _link(block, i)
        pushed = s * turned[i][:, None] * above + felt[i]
        angles[i] = above = (pushed + x * pivots.moment[i] * y) / pivots.pivot[i]
        held = (block.sigma[i] * block.b[i])[:, None] + pivots.stiffness[i] + s
        gain = held + x * (m * c * (l - c) - inertia - l * pivots.first_moment[i])
        lower = (y * gain + l * pushed) / pivots.pivot[i]
        centres[i] = y * ((l - c) / l) + lower * (c / l)
        y = lower
    return angles, centres
