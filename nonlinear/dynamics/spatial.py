"""Motion in space, the cart along its rail and one unit vector per link, y = (x, u, x', w, work), by O(links) passes.

A link is the unit vector u with rate w = u', u·w = 0, and does not spin: u'' = α − |w|² u with α across the link. With
ã = a − g e_z the acceleration of its upper joint less gravity, everything from that joint down answers with the force
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
number across ([Featherstone2008, §7.2]; Householder reflections: [Golub2013, §5.1]).  The reflection maps the plane of
the rail onto itself, so motion there is as exact as in the plane case; outside it a bob right above a heavier one loses
the digits of their mass ratio, as in dense equations.

The first axis of a vector holds its components; any further axes may follow.  Arrays of SymPy or heyoka expressions are
accepted too, with `sign` given: any choice of ±1 that keeps 1 + sign u_z away from zero.

At its joint a link rotates at Ω = u × w without spin about its axis.  A damper acts
on the rotation of a link relative to the one above (the support's being zero), a spring on the angle γ between the two
directions that coincide at equilibrium, σ_i u_i and σ_{i−1} u_{i−1} (e_z above the first link):

    V = ½ Σ k γ²        moment on the link below = −k (γ / sin γ) a × b − d (Ω_i − Ω_{i−1}),  a above, b below,

and the opposite on the link above; τ on a link is the generalized force Q = τ × u on u.  With 4 z = |a − b|² and 4 z̄ =
|a + b|², γ = 2 arctan √(z/z̄) and γ / sin γ = arctan √(z/z̄) / √(z z̄): analytic except where the spring is bent right
back (γ = π), where the moment has no direction and is taken as zero.  γ never exceeds π: a joint in space does not wind
up, as one in the plane does.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from modal.types import Floats, Ints
from nonlinear.dynamics.forces import Base, External, drag
from nonlinear.dynamics.minimal import Projection, Suspended
from nonlinear.dynamics.recursion import Answer, RecursiveLink, driven, links_of
from nonlinear.dynamics.tape import DIVISOR_MIN, where
from nonlinear.system import Group
from nonlinear.system.system import spread

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
    answer = SpatialAnswer(0 * u[:, None, -1] * u[None, :, -1], 0 * u[:, -1])
    turns: list[SpatialTurn] = []
    for i in reversed(range(len(links))):
        answer, turn = _link_response(links[i], answer, u[:, i], w[:, i], torque[:, i], sign[i])
        turns.append(turn)
    return answer, turns[::-1]


def _link_response(
    link: RecursiveLink, below: SpatialAnswer, u: Any, w: Any, Q: Any, sign: Any
) -> tuple[SpatialAnswer, SpatialTurn]:
    l, ll, mc, J = link.l, link.l * link.l, link.mc, link.J
    v = u + sign * spread(DOWN, u)
    beta = sign / v[2]
    M, p, Q = _mirrored_form(v, beta, below.M), _reflect(v, beta, below.p), _reflect(v, beta, Q)[:2]
    N, r, mu, inward = M[:2, :2], M[:2, 2], M[2, 2], sign * dot(w, w)
    tau, delta = N[0, 0] + N[1, 1], N[0, 0] * N[1, 1] - N[0, 1] * N[1, 0]
    inertia_sum = J + ll * tau
    det = J * inertia_sum + ll * ll * delta
    unit = spread(ONE, N)
    inverse = (J * unit + ll * spread(ADJOINT, N) * N[::-1, ::-1]) / det
    y, rho = p[:2] + l * inward * r, _pair(inverse, r)
    e = l * y - Q
    matrix, force = np.empty_like(M), np.empty_like(p)
    matrix[:2, :2] = (
        (link.m * link.I * inertia_sum + link.far * ll * delta) * unit + link.cross * link.cross * N
    ) / det
    matrix[:2, 2] = matrix[2, :2] = link.cross * rho
    matrix[2, 2] = link.m + (mu - ll * (r[0] * rho[0] + r[1] * rho[1]))
    force[:2] = _pair(inverse, link.cross * y + mc * Q + l * _pair(N, Q))
    force[2] = p[2] + inward * (mc + l * mu) - l * (rho[0] * e[0] + rho[1] * e[1])
    answer = SpatialAnswer(_mirrored_form(v, beta, matrix), _reflect(v, beta, force))
    return answer, SpatialTurn(v, beta, inverse, M[:, :2], e, inward)


def downward(links: Sequence[RecursiveLink], turns: Sequence[SpatialTurn], a: Any) -> list[Any]:
    """The acceleration u'' (3, ...) of every link, top first, under the acceleration ã = a of the first joint."""
    accelerations = []
    for link, turn in zip(links, turns, strict=True):
        base = _reflect(turn.v, turn.beta, a)
        moment = link.mc * base[:2] + link.l * _times(turn.rows, base) + turn.e
        image = np.empty_like(base)
        image[:2] = -_pair(turn.inverse, moment)
        image[2] = turn.inward
        accelerations.append(_reflect(turn.v, turn.beta, image))
        a = a + link.l * accelerations[-1]
    return accelerations


def _times(M: Any, x: Any) -> Any:
    return M[0] * x[0] + M[1] * x[1] + M[2] * x[2]


def _pair(M: Any, x: Any) -> Any:
    return M[0] * x[0] + M[1] * x[1]


def _reflect(v: Any, beta: Any, x: Any) -> Any:
    return x - (beta * dot(v, x)) * v


def _mirrored_form(v: Any, beta: Any, M: Any) -> Any:
    y = beta * _times(M, v)
    half = v[:, None] * (y - (beta * dot(v, y) / 2) * v)
    return M - (half + half.swapaxes(0, 1))


def generalized_forces(moments: Any, u: Any) -> Any:
    """The generalized forces (N m) of moments on links."""
    return cross(moments, u)


def joint_moments(group: Group, u: Any, w: Any) -> Any:
    """The moments (N m) of springs and dampers on the links."""
    hinge = np.zeros_like(u)
    if group.sprung:
        above, below, z, rest = _bend(group, u)
        hinge -= spread(group.block.stiffness, u[0]) * _per_sine(z, rest) * cross(above, below)
    if group.has_dampers:
        hinge -= spread(group.block.damping, u[0]) * _relative(cross(u, w))
    hinge[:, :-1] -= hinge[:, 1:].copy()
    return hinge


def damper_power(group: Group, u: Any, w: Any) -> Any:
    """Power (W) of the joint dampers, never positive, (...)."""
    bend_rates = _relative(cross(u, w))
    return -np.sum(spread(group.block.damping, u[0]) * dot(bend_rates, bend_rates), axis=(0, 1))


def joint_energy(group: Group, u: Floats) -> Floats:
    """Energy (J) of every joint spring, (n, P, ...)."""
    _, _, z, rest = _bend(group, u)
    half_angle = np.arctan(np.sqrt(z) / np.sqrt(where(rest, rest, DIVISOR_MIN)))
    return np.asarray(2 * spread(group.block.stiffness, u[0]) * half_angle**2)


def _bend(group: Group, u: Any) -> tuple[Any, Any, Any, Any]:
    below = spread(group.block.sigma, u[0]) * u
    above = np.empty_like(below)
    above[:, 0] = DOWN.reshape(3, *[1] * (u.ndim - 2))
    above[:, 1:] = below[:, :-1]
    difference, total = above - below, above + below
    return above, below, dot(difference, difference) / 4, dot(total, total) / 4


def _per_sine(z: Any, rest: Any) -> Any:
    product = z * rest
    root, rest_root = np.sqrt(where(product, z, DIVISOR_MIN)), np.sqrt(where(product, rest, 1.0))
    return np.arctan(root / rest_root) / (root * rest_root)


def _relative(values: Any) -> Any:
    return np.diff(values, axis=1, prepend=0.0)


class SpatialRecursion:
    """One pass up and one down in NumPy; u, u' and the torques on u are (3, n, P, ...)."""

    def __init__(self, group: Group, tail: int = 0) -> None:
        self.links = [type(link)(*(value.reshape(-1, *[1] * tail) for value in link)) for link in links_of(group)]

    def response(self, u: Any, w: Any, torque: Any) -> Projection:
        """The reactions of the pendula to motions of their first joints.

        The stages of an integrator's step leave the sphere, where the two reflections of `upward` and `downward` would
        give different results and y' would jump as a link passes the horizontal: so directions are normalized first.
        """
        u = u / np.sqrt(dot(u, u))
        return SpatialRecursed(self, *upward(self.links, u, w, torque, facing(u)))


class SpatialRecursed:
    """Pendula in space, by their answer f = M ã + p at the first joint."""

    def __init__(self, body: SpatialRecursion, answer: SpatialAnswer, turns: Any) -> None:
        self.body, self.answer, self.turns = body, answer, turns

    def project_on_carrier(self, columns: Any, slopes: Sequence[Any], bias: tuple[Any, Any], move_alike: bool) -> Any:
        """The inertia (lower half) and the force on each coordinate of the supports of the pendula in these columns."""
        M, p = self.answer.M[:, :, columns], self.answer.p[:, columns]
        answer = Answer(*(part.sum(0) for part in (M[0, 0], M[0, 2], M[2, 2], p[0], p[2])))
        (fx, fz), pulls = answer.to(*bias), [driven(*answer[:3], *slope) for slope in slopes]
        block = [[v * mx + w * mz for v, w in slopes[: k + 1]] for k, (mx, mz) in enumerate(pulls)]
        return block, [x * fx + z * fz for x, z in slopes]

    def fall(self, pushes: Sequence[Sequence[Any]], accelerations: Any) -> Any:
        """Second derivatives u'' (3, n, P, ...)."""
        base_acceleration = np.zeros_like(self.answer.p)
        base_acceleration[0], base_acceleration[2] = accelerations
        return np.stack(downward(self.body.links, self.turns, base_acceleration), axis=1)


class Spatial(Suspended):
    """The equations of motion of a scene in space, y = (x, u, x', w, work)."""

    @cached_property
    def places(self) -> tuple[Ints, ...]:
        """Positions of the components (3, n, P) of every group among those of all links."""
        return tuple(3 * group.index + np.arange(3)[:, None, None] for group in self.system.groups)

    def acting(
        self, group: Group, links: Any, rates: Any, moments: Any | None, support: Any, base: Base | None = None
    ) -> tuple[Any, Any, Any]:
        """Generalized forces (3, n, P, ...) on u, and the power of dampers, moments and inertial forces."""
        power = 0.0
        if moments is not None:
            power = np.sum(dot(moments, cross(links, rates)))
        if support is not None:
            along, down = support
            b = spread(group.block.b, links[0])
            power = power - (b * (along * rates[0] + down * rates[2])).sum((0, 1))
        if group.sprung or group.has_dampers:
            hinges = joint_moments(group, links, rates)
            moments = hinges if moments is None else moments + hinges
        if group.has_dampers:
            power = power + damper_power(group, links, rates)
        return np.zeros_like(links) if moments is None else generalized_forces(moments, links), power, 0.0

    def drag_of(self, group: Group, links: Any, rates: Any, pivot: Any, support: Any, speed: Any) -> External:
        """The drag of a group, with generalized forces (3, n, P, ...) on u."""
        external = drag(group, rates, pivot, support)
        return external._replace(
            generalized_forces=generalized_forces(cross(links, external.generalized_forces), links)
        )
