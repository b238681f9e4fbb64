"""Accelerations in space by one pass from the tips up and one back down, O(links), on unit vectors.

A link is the unit vector u with rate w = u', u·w = 0, and does not spin: u'' = α − |w|² u with α across the link. With
ã = a − g e_z the acceleration of its upper joint as it feels it, everything from that joint down answers with the force
f = M ã + p, M symmetric.  Given M' and p' of all that hangs below (zero below the last link), Q across the link the
generalized force on u, J = I + m c², P = 1 − u uᵀ,

    J α + P (m c ã + l f') = Q      f' = M'(ã + l u'') + p'      f = m (ã + c u'') + f'.

The reflection 1 − β v vᵀ, v = u ± e_z, β = 1/(1 + |u_z|), maps the link onto the vertical without a singular direction
(its sign is that of u_z; where |u| = 1 no result depends on it).  In the reflected basis M' has the blocks N (2×2,
across), r and μ,

    D = J + l² N     δ = det N     τ = tr N     det D = J (J + l² τ) + l⁴ δ     y = p'_T − l |w|² r
    M_TT = (m I + far N) D⁻¹ = [(m I (J + l² τ) + far l² δ) 1 + cross² N] / det D     far J − m I l² = cross²
    M_Tu = cross D⁻¹ r          M_uu = m + μ − l² r·D⁻¹ r
    p_T = D⁻¹ (cross y + (m c + l N) Q)     p_u = p'_u − |w|² (m c + l μ) − l r·D⁻¹ (l y − Q)

with far = I + m (l − c)², cross = I − m c (l − c).  It is `nonlinear.dynamics.recursion` with a 2×2 block for each
number across (Featherstone, Rigid Body Dynamics Algorithms, 2008, §7.2; Householder reflections: Golub and Van Loan,
Matrix Computations, §5.1).  The reflection maps the plane of the rail onto itself, so motion there is as exact as in
the plane case; outside it a bob right above a heavier one loses the digits of their mass ratio, as in dense equations.

The first axis of a vector holds its components; any further axes may follow.  Arrays of SymPy or heyoka expressions are
accepted too, with `sign` given: any choice of ±1 that keeps 1 + sign u_z away from zero.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from nonlinear.dynamics.recursion import RecursiveLink
from nonlinear.dynamics.tape import where

NEXT, LAST = [1, 2, 0], [2, 0, 1]
DOWN = np.array([0.0, 0.0, 1.0])
ONE = np.eye(2)
ADJOINT = np.array([[1.0, -1.0], [-1.0, 1.0]])


class SpatialAnswer(NamedTuple):
    """The force f = M ã + p of everything below a joint: M (3, 3, ...) in kg, p (3, ...) in N."""

    M: Any
    p: Any


class SpatialTurn(NamedTuple):
    """The reflection of a link, and the terms of α = −D⁻¹ ((m c + l N) ã_T + l r ã_u + e) in its basis."""

    v: Any
    beta: Any
    inverse: Any  # D⁻¹ (2, 2, ...)
    rows: Any  # (N, r) transposed (3, 2, ...)
    e: Any  # l y − Q (2, ...)
    inward: Any  # ∓|w|², of −|w|² u along the reflected vertical


def dot(a: Any, b: Any) -> Any:
    """The product a·b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Any, b: Any) -> Any:
    """The product a × b."""
    return a[NEXT] * b[LAST] - a[LAST] * b[NEXT]


def facing(u: Any) -> Any:
    """The sign of u_z, chosen so that the reflection is never singular: 1 or −1, never 0."""
    return where(u[2], 1.0, -1.0)


def upward(
    links: Sequence[RecursiveLink], u: Any, w: Any, torque: Any, sign: Any
) -> tuple[SpatialAnswer, list[SpatialTurn]]:
    """The upward pass: the response at the first joint, and the `SpatialTurn` of every link, top first.

    u, w and `torque` (N m; the generalized force on u, across it, gravity excepted) are (3, n, ...), `sign` (n, ...).
    """
    below = SpatialAnswer(0 * u[:, None, -1] * u[None, :, -1], 0 * u[:, -1])
    turns: list[SpatialTurn] = []
    for i in reversed(range(len(links))):
        below, turn = _passed(links[i], below, u[:, i], w[:, i], torque[:, i], sign[i])
        turns.append(turn)
    return below, turns[::-1]


def _passed(
    link: RecursiveLink, below: SpatialAnswer, u: Any, w: Any, Q: Any, sign: Any
) -> tuple[SpatialAnswer, SpatialTurn]:
    l, ll, mc, J = link.l, link.l * link.l, link.mc, link.J
    v = u + sign * _like(DOWN, u)
    beta = sign / v[2]
    M, p, Q = _mirrored_form(v, beta, below.M), _mirrored(v, beta, below.p), _mirrored(v, beta, Q)[:2]
    N, r, mu, inward = M[:2, :2], M[:2, 2], M[2, 2], sign * dot(w, w)
    tau, delta = N[0, 0] + N[1, 1], N[0, 0] * N[1, 1] - N[0, 1] * N[1, 0]
    wide = J + ll * tau
    det = J * wide + ll * ll * delta
    unit = _like(ONE, N)
    inverse = (J * unit + ll * _like(ADJOINT, N) * N[::-1, ::-1]) / det
    y, rho = p[:2] + l * inward * r, _pair(inverse, r)
    e = l * y - Q
    answered, force = np.empty_like(M), np.empty_like(p)
    answered[:2, :2] = ((link.m * link.I * wide + link.far * ll * delta) * unit + link.cross * link.cross * N) / det
    answered[:2, 2] = answered[2, :2] = link.cross * rho
    answered[2, 2] = link.m + (mu - ll * (r[0] * rho[0] + r[1] * rho[1]))
    force[:2] = _pair(inverse, link.cross * y + mc * Q + l * _pair(N, Q))
    force[2] = p[2] + inward * (mc + l * mu) - l * (rho[0] * e[0] + rho[1] * e[1])
    answer = SpatialAnswer(_mirrored_form(v, beta, answered), _mirrored(v, beta, force))
    return answer, SpatialTurn(v, beta, inverse, M[:, :2], e, inward)


def downward(links: Sequence[RecursiveLink], turns: Sequence[SpatialTurn], a: Any) -> list[Any]:
    """The acceleration u'' (3, ...) of every link, top first, under the acceleration ã = a of the first joint."""
    turned = []
    for link, turn in zip(links, turns, strict=True):
        seen = _mirrored(turn.v, turn.beta, a)
        felt = link.mc * seen[:2] + link.l * _times(turn.rows, seen) + turn.e
        bent = np.empty_like(seen)
        bent[:2] = -_pair(turn.inverse, felt)
        bent[2] = turn.inward
        turned.append(_mirrored(turn.v, turn.beta, bent))
        a = a + link.l * turned[-1]
    return turned


def _like(constant: Any, array: Any) -> Any:
    return constant.reshape(constant.shape + (1,) * (array.ndim - constant.ndim))


def _times(M: Any, x: Any) -> Any:
    return M[0] * x[0] + M[1] * x[1] + M[2] * x[2]


def _pair(M: Any, x: Any) -> Any:
    return M[0] * x[0] + M[1] * x[1]


def _mirrored(v: Any, beta: Any, x: Any) -> Any:
    return x - (beta * dot(v, x)) * v


def _mirrored_form(v: Any, beta: Any, M: Any) -> Any:
    y = beta * _times(M, v)
    half = v[:, None] * (y - (beta * dot(v, y) / 2) * v)
    return M - (half + half.swapaxes(0, 1))
