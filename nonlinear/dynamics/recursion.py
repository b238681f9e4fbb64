"""Accelerations in the plane by one pass from the tips up and one back down, O(links), without a matrix.

With u = (sin θ, cos θ) along a link, n = (cos θ, −sin θ) across it and ã = a − g e_z the acceleration of its upper
joint less gravity, everything from that joint down responds with the force f = M ã + p, M symmetric.  Given M'
and p' of all that hangs below (zero below the last link), with J = I + m c²,

    D = J + l² n·M'n     h = m c n + l M'n     e = l n·(p' − l ω² M'u) − Q     θ'' = −(h·ã + e)/D
    M = m + M' − h hᵀ/D         p = p' − ω² (m c u + l M'u) − h e/D

In the basis (n, u) two of M's three numbers need no subtraction (as in `modal.eigen.recursion`):

    M_nn = (m I + (I + m (l−c)²) M'_nn)/D,   M_nu = (I − m c (l−c)) M'_nu / D,   M_uu = m + M'_uu − l² M'_nu²/D

With rotors at joints all that hangs below has the angular acceleration α of the link above: f = M ã + r α + p, and
r·ã + s α + q is the moment on that link (`geared_response`).
This is the articulated-body recursion [Featherstone2008, §7.2] of a planar chain.
A bob whose rope changes its length has the accelerations β_u = l'' along it and β_n = 2 l' ω across it, too, as has all
that hangs below: they add M'β to p' and m β to the force on the bob.

Every line is plain arithmetic: it accepts floats, arrays of any one shape, complex numbers, SymPy and heyoka
expressions.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from modal.structure.carriers import inner
from nonlinear.system import Group


class RecursiveLink(NamedTuple):
    """The constants of one link, or of one link of many pendula."""

    m: Any  # mass (kg)
    l: Any  # length (m)
    mc: Any  # m c (kg m)
    J: Any  # I + m c² (kg m²)
    I: Any  # moment of inertia about the centre (kg m²)
    far: Any  # I + m (l − c)² (kg m²)
    cross: Any  # I − m c (l − c) (kg m²)


class Answer(NamedTuple):
    """The force f = M ã + p of everything below a joint, along the rail (x) and down (z): M in kg, p in N."""

    xx: Any
    xz: Any
    zz: Any
    px: Any
    pz: Any

    def to(self, x: Any, z: Any) -> tuple[Any, Any]:
        """The force under an acceleration ã = (x, z)."""
        return self.px + inner((x, z), self.xx, self.xz), self.pz + inner((x, z), self.xz, self.zz)


class Geared(NamedTuple):
    """The force f = M ã + r α + p and the moment r·ã + s α + q of everything below a joint.

    The link above has the angular acceleration α.
    """

    xx: Any
    xz: Any
    zz: Any
    px: Any
    pz: Any
    rx: Any = 0.0
    rz: Any = 0.0
    s: Any = 0.0
    q: Any = 0.0

    def to(self, x: Any, z: Any) -> tuple[Any, Any, Any]:
        """The force, and the moment on the link above, under an acceleration ã = (x, z) of the joint alone."""
        fx, fz = Answer(*self[:5]).to(x, z)
        return fx, fz, self.q + inner((x, z), self.rx, self.rz)


NOTHING_BELOW = Geared(0.0, 0.0, 0.0, 0.0, 0.0)


def driven(xx: Any, xz: Any, zz: Any, x: Any, z: Any) -> tuple[Any, Any]:
    """M (x, z), along the rail and down."""
    return xx * x + xz * z, xz * x + zz * z


class Bias(NamedTuple):
    """Accelerations (m/s²) of a link's bob and lower joint across and along it that its rotation does not explain."""

    across: Any
    along: Any


class Turn(NamedTuple):
    """The terms of θ'' = −(hx ã_x + hz ã_z + e)/D of one link, and those that transmit ã to its lower joint."""

    hx: Any
    hz: Any
    e: Any
    D: Any
    sin: Any
    cos: Any
    rate: Any


def links_of(group: Group) -> list[RecursiveLink]:
    """The constants of every link of a group, top first, each (P,)."""
    block = group.block
    rest = block.length - block.centre
    far = block.inertia + block.mass * rest**2
    cross = block.inertia - group.static * rest
    rows = zip(block.mass, block.length, group.static, group.moment, block.inertia, far, cross, strict=True)
    return [RecursiveLink(*row) for row in rows]


def upward(
    links: Sequence[RecursiveLink],
    sin: Sequence[Any],
    cos: Sequence[Any],
    rate: Sequence[Any],
    torque: Sequence[Any],
    bias: Sequence[Bias] | None = None,
) -> tuple[Answer, list[Turn]]:
    """Run the upward pass: return the response at the first joint, and the `Turn` of every link, top first.

    `torque` (N m) is the generalized force on each absolute angle, gravity excepted; `bias` is that of changing
    lengths, 0 for all links but bobs.
    """
    extra = [None] * len(links) if bias is None else bias
    *above, last = zip(links, sin, cos, rate, torque, extra, strict=True)
    answer, turn = tip_response(*last)
    turns = [turn]
    for link, s, c, w, Q, link_bias in reversed(above):
        answer, turn = link_response(link, answer, s, c, w, Q, link_bias)
        turns.append(turn)
    return answer, turns[::-1]


def tip_response(link: RecursiveLink, s: Any, c: Any, w: Any, Q: Any, bias: Bias | None = None) -> tuple[Answer, Turn]:
    """The same as `link_response` of the last link, below which there is nothing."""
    if bias is not None:
        Q = Q - link.mc * bias.across
    pn, pu = link.mc / link.J * Q, -link.mc * (w * w)
    if bias is not None:
        pn, pu = pn + link.m * bias.across, pu + link.m * bias.along
    nn, uu, cc, ss = link.m * link.I / link.J, link.m, c * c, s * s
    answer = Answer(
        xx=cc * nn + ss * uu,
        xz=s * c * (uu - nn),
        zz=ss * nn + cc * uu,
        px=c * pn + s * pu,
        pz=c * pu - s * pn,
    )
    return answer, Turn(c * link.mc, -s * link.mc, -Q, link.J, s, c, w)


def link_response(
    link: RecursiveLink, below: Answer, s: Any, c: Any, w: Any, Q: Any, bias: Bias | None = None
) -> tuple[Answer, Turn]:
    """The response at the upper joint of one link from that at its lower one, and its `Turn`."""
    l, mc, cc, ss, sc = link.l, link.mc, c * c, s * s, s * c
    double, twice = cc - ss, 2 * sc
    cross_term = twice * below.xz
    nn = cc * below.xx - cross_term + ss * below.zz
    uu = ss * below.xx + cross_term + cc * below.zz
    nu = sc * (below.xx - below.zz) + double * below.xz
    pn, pu, ww = c * below.px - s * below.pz, s * below.px + c * below.pz, w * w
    if bias is not None:
        Q = Q - mc * bias.across
        pn, pu = pn + nn * bias.across + nu * bias.along, pu + nu * bias.across + uu * bias.along
    D = link.J + l * l * nn
    hn, hu = mc + l * nn, l * nu
    pn = pn - l * ww * nu
    e = l * pn - Q
    pull = e / D
    nn_, nu_ = (link.m * link.I + link.far * nn) / D, link.cross * nu / D
    uu_ = link.m + (uu - hu * hu / D)
    pn, pu = pn - hn * pull, pu - ww * (mc + l * uu) - hu * pull
    if bias is not None:
        pn, pu = pn + link.m * bias.across, pu + link.m * bias.along
    cross_term = twice * nu_
    answer = Answer(
        xx=cc * nn_ + cross_term + ss * uu_,
        xz=sc * (uu_ - nn_) + double * nu_,
        zz=ss * nn_ - cross_term + cc * uu_,
        px=c * pn + s * pu,
        pz=c * pu - s * pn,
    )
    return answer, Turn(c * hn + s * hu, c * hu - s * hn, e, D, s, c, w)


def geared_upward(
    links: Sequence[RecursiveLink],
    rotors: Sequence[Any],
    sin: Sequence[Any],
    cos: Sequence[Any],
    rate: Sequence[Any],
    torque: Sequence[Any],
    bias: Sequence[Bias] | None = None,
) -> tuple[Geared, list[Turn]]:
    """The same as `upward` with rotors at joints, of the reflected inertia `rotors` (kg m²)."""
    answer, turns = NOTHING_BELOW, []
    extra = [None] * len(links) if bias is None else bias
    for link, rotor, *at in reversed([*zip(links, rotors, sin, cos, rate, torque, extra, strict=True)]):
        answer, turn = geared_response(link, rotor, answer, *at)
        turns.append(turn)
    return answer, turns[::-1]


def geared_response(
    link: RecursiveLink, rotor: Any, below: Geared, s: Any, c: Any, w: Any, Q: Any, bias: Bias | None = None
) -> tuple[Geared, Turn]:
    """`link_response` with the inertia J of a `rotor` at the upper joint, and rotors below.

    With α of the link above, σ = s' + J and primes for the parts below,

        D = I + m c² + l² M'_nn + 2 l r'_n + σ     h = m c n + l M'n + r'     θ'' = −(h·ã + e − J α)/D
        e = l n·(p' − l ω² M'u) − l ω² r'_u + q' − Q     r = J h/D     s = J (D − J)/D     q = J e/D
    """
    l, mc = link.l, link.mc
    cc, ss, sc = c * c, s * s, s * c
    nn = cc * below.xx - 2 * sc * below.xz + ss * below.zz
    uu = ss * below.xx + 2 * sc * below.xz + cc * below.zz
    nu = sc * (below.xx - below.zz) + (cc - ss) * below.xz
    pn, pu, ww = c * below.px - s * below.pz, s * below.px + c * below.pz, w * w
    rn, ru, q = c * below.rx - s * below.rz, s * below.rx + c * below.rz, below.q
    if bias is not None:
        Q, q = Q - mc * bias.across, q + rn * bias.across + ru * bias.along
        pn, pu = pn + nn * bias.across + nu * bias.along, pu + nu * bias.across + uu * bias.along
    own, sigma = link.J + l * l * nn + 2 * l * rn + below.s, below.s + rotor
    D = own + rotor
    hn, hu = mc + l * nn + rn, l * nu + ru
    pn = pn - l * ww * nu
    e = l * pn - l * ww * ru + q - Q
    nn_ = (link.m * link.I + link.far * nn + (link.m + nn) * sigma + 2 * (link.m * l - mc) * rn - rn * rn) / D
    nu_ = (nu * (link.cross + l * rn + sigma) - ru * hn) / D
    uu_ = link.m + (uu - hu * hu / D)
    pn, pu = pn - hn * e / D, pu - ww * (mc + l * uu) - hu * e / D
    if bias is not None:
        pn, pu = pn + link.m * bias.across, pu + link.m * bias.along
    hx, hz, share = c * hn + s * hu, c * hu - s * hn, rotor / D
    answer = Geared(
        xx=cc * nn_ + 2 * sc * nu_ + ss * uu_,
        xz=sc * (uu_ - nn_) + (cc - ss) * nu_,
        zz=ss * nn_ - 2 * sc * nu_ + cc * uu_,
        px=c * pn + s * pu,
        pz=c * pu - s * pn,
        rx=share * hx,
        rz=share * hz,
        s=share * own,
        q=share * e,
    )
    return answer, Turn(hx, hz, e, D, s, c, w)


def geared_downward(
    links: Sequence[RecursiveLink],
    rotors: Sequence[Any],
    turns: Sequence[Turn],
    base: tuple[Any, Any, Any],
    bias: Sequence[Bias] | None = None,
) -> list[Any]:
    """θ'' (rad/s²) of every link from ã of the first joint and α of its support, `base` = (ã_x, ã_z, α)."""
    ax, az, alpha = base
    accelerations = []
    extra = [None] * len(links) if bias is None else bias
    for link, rotor, turn, link_bias in zip(links, rotors, turns, extra, strict=True):
        driven_turn = turn._replace(e=turn.e - rotor * alpha)
        alpha, ax, az = link_acceleration(link, driven_turn, ax, az, link_bias)
        accelerations.append(alpha)
    return accelerations


def downward(
    links: Sequence[RecursiveLink], turns: Sequence[Turn], ax: Any, az: Any, bias: Sequence[Bias] | None = None
) -> list[Any]:
    """θ'' (rad/s²) of every link, top first, under the acceleration ã = (ax, az) of the first joint."""
    accelerations = []
    extra = [None] * len(links) if bias is None else bias
    *above, (_, last, _) = zip(links, turns, extra, strict=True)
    for link, turn, link_bias in above:
        alpha, ax, az = link_acceleration(link, turn, ax, az, link_bias)
        accelerations.append(alpha)
    return [*accelerations, -(last.hx * ax + last.hz * az + last.e) / last.D]


def link_acceleration(
    link: RecursiveLink, turn: Turn, ax: Any, az: Any, bias: Bias | None = None
) -> tuple[Any, Any, Any]:
    """θ'' of one link under the acceleration ã of its upper joint, and that of its lower one."""
    alpha = -(turn.hx * ax + turn.hz * az + turn.e) / turn.D
    ww = turn.rate * turn.rate
    ax = ax + link.l * (alpha * turn.cos - ww * turn.sin)
    az = az - link.l * (alpha * turn.sin + ww * turn.cos)
    if bias is not None:
        ax = ax + bias.across * turn.cos + bias.along * turn.sin
        az = az - bias.across * turn.sin + bias.along * turn.cos
    return alpha, ax, az


def lift_force(group: Group, angles: Any, rates: Any, turns: Any, winding: Any = None) -> Any:
    """Return Σ b (sin θ α + cos θ w), the upward force (N) for the rotation of links, with α and w as in `tensions`."""
    w = rates * rates
    if winding is not None:
        turns, w = turns + 2.0 * winding[0] * rates / group.block.length, w - winding[1] / group.block.length
    return (group.block.b * (np.sin(angles) * turns + np.cos(angles) * w)).sum((0, 1))


def tensions(group: Group, winding: Any, angles: Any, rates: Any, turns: Any, start: Any, external: Any) -> Any:
    """The pulls u·f (n, P) in ropes whose lengths change, 0 in all others: f = Σ m (a − g) − F of all below a joint.

    `winding` are the speeds and accelerations of the lengths, `start` is the acceleration a of the first joint less
    gravity, F the `external` forces.  With α = θ'' + 2 l' θ'/l, w = θ'² − l''/l and the mass S_i from a link i down

        u_i·f_i = S_i (u_i·a − Σ_{j≤i} l_j (cos(θ_i − θ_j) w_j − sin(θ_i − θ_j) α_j))
                  − Σ_{j>i} b_j (cos(θ_j − θ_i) w_j + sin(θ_j − θ_i) α_j) − u_i·ΣF
    """
    (speed, acceleration), l, b = winding, group.block.length, group.block.b
    s, c, down = np.sin(angles), np.cos(angles), np.cumsum(group.block.mass[::-1], axis=0)[::-1]
    alpha, w = turns + 2.0 * speed * rates / l, rates * rates - acceleration / l
    pulls = np.zeros_like(alpha)
    for i in range(len(pulls)):
        if not np.any(speed[i] != 0):
            continue
        pull = s[i] * start[0] + c[i] * start[1] - l[i] * w[i]
        for j in range(i):
            pull = pull - l[j] * ((c[i] * c[j] + s[i] * s[j]) * w[j] - (s[i] * c[j] - c[i] * s[j]) * alpha[j])
        pull = down[i] * pull
        for j in range(i + 1, len(pulls)):
            pull = pull - b[j] * ((c[j] * c[i] + s[j] * s[i]) * w[j] + (s[j] * c[i] - c[j] * s[i]) * alpha[j])
        if external is not None:
            force_x, force_z = external.forces[:, i:].sum(1)
            pull = pull - (s[i] * force_x + c[i] * force_z)
        pulls[i] = pull
    return pulls
