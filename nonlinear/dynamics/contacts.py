"""Dry friction and escapements: places and laws.

At each of J contacts the velocity of sliding is γ' = (J v)_j, a difference of two neighbouring rates or the cart's
velocity.  The torque or force τ_j of friction opposes it and is at most the limit M_j,

    γ' ≠ 0:  τ = −M sign γ',        γ' = 0:  |τ| ≤ M,  and τ = −M sign γ'' where sliding begins

(Coulomb; [Glocker2001, §2]).  It adds Jᵀτ to the generalized forces, so that γ'' = a + Gτ with
the accelerations a without friction and G = J M⁻¹ Jᵀ, symmetric and positive definite.  Which contacts at rest begin to
slide is a linear complementarity problem with bounds, which has one solution (`complementarity`).  The friction of
those that stick leaves them at rest, Ja + Gτ = 0 (`Sticking`).

An escapement's kick P at a joint is an impulse +P on the link below and −P on the one above.

Accelerations under the friction of joints that stick are found in the plane by one pass up and one down, O(links).
To the accelerations a without that friction it adds α with M α = Jᵀτ, so that at a joint that sticks, s = 1, both links
turn alike, and at one that slides, s = 0, τ is 0.  As in `nonlinear.dynamics.recursion` all from a joint down responds
to the acceleration ã of the joint, here also to α of the link above where its first joint sticks, with the force f and
the moment N

    f = M ã + k α + p      N = k·ã + K α + e

With M', k', K', p', e' of all that hangs below a link, n = (cos θ, −sin θ) across it, J = I + m c² and r = a_above − a,

    D = J + l² n·M'n + 2 l n·k' + K'     h = m c n + l M'n + k'     g = l n·p' + e'     w = (1 − s)/D
    M = m + M' − w h hᵀ    k = s h    K = s D    p = p' + (s r − w g) h    e = s (g + D r)

and on the way down α = s (α_above + r) − w (h·ã + g), τ = s (h·ã + D α + g) ([Featherstone2008, §7.2], with joints of
no freedom).  With a rotor J at the joint, D being as before, w is (1 − s)/(D + J); k, K and the g in e have s + J w in
place of s, and on the way down h·ã + g − J α_above stands for h·ã + g, D + J for D.  One text serves every set of
joints that stick.

On a rail with a coefficient μ the limit is μ|N|.  Where N₀ and the response c₀ to a unit of friction on the rail are
those with the others held,

    τ₀ = k N,   N = N₀ + n₀ τ₀,   k = −s μ sign N        so that   τ₀ = k N₀/(1 − k n₀),  n₀ = ∂N/∂a · c₀.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from modal.types import Floats, Ints
from nonlinear.dynamics.recursion import RecursiveLink, links_of
from nonlinear.system import Group, System

JAM_RATIO = 1e4
"""Limit: push on the rail over all weights and centrifugal forces, beyond which it has no bound: JAMMED says so."""
JAMMED = "the rail's friction has no consistent value: its coefficient is too large for these links"


@dataclass(frozen=True, eq=False)
class Contacts:
    """The J contacts of a system from the cart down each pendulum, all arrays (J,).

    `below` and `above` are the coordinates of v whose difference is γ', −1 standing for the support; `limit` is in N m,
    or N on the rail, which comes first where `rail` is true; its limit is 0 if there is a `coefficient` μ.
    """

    below: Ints
    above: Ints
    limit: Floats
    rail: bool
    coefficient: float

    @property
    def pairs(self) -> tuple[tuple[int, int], ...]:
        """The coordinates below and above every contact."""
        return tuple(zip(self.below.tolist(), self.above.tolist(), strict=True))

    def relative(self, values: Floats) -> Floats:
        """The value at every contact (..., J) from those of the coordinates (..., half)."""
        with_zero = np.concatenate((values, np.zeros_like(values[..., :1])), axis=-1)
        return np.asarray(with_zero[..., self.below] - with_zero[..., self.above])


def contacts_of(system: System) -> Contacts:
    """The contacts of a system with dry friction."""
    first = system.first
    below, above, limit = np.zeros((3, 0))
    for group in system.groups:
        if group.friction is not None:
            over = np.vstack((np.full_like(group.index[:1], -1), group.index[:-1] + first))
            rubbing = group.friction > 0
            below = np.append(below, group.index[rubbing] + first)
            above, limit = np.append(above, over[rubbing]), np.append(limit, group.friction[rubbing])
    if system.rail:
        below, above, limit = np.append(below, 0), np.append(above, -1), np.append(limit, system.rail.friction)
    order = np.argsort(below, kind="stable")
    coefficient = system.rail.coefficient if system.rail else 0.0
    places = below[order].astype(np.int64), above[order].astype(np.int64)
    return Contacts(*places, limit[order], system.rail is not None, coefficient)


def links_of_contacts(system: System) -> Ints:
    """The link below each contact (J,), −1 for the rail."""
    return np.asarray(contacts_of(system).below - system.first)


def jams(system: System, rates: Sequence[float], normal: float) -> bool:
    """Whether N of a rail with a coefficient exceeds all weights and inertial forces (N), at `rates` of links (L,).

    Before its friction has no value it grows as 1/(1 + s μ e n₀), and no integrator's steps, however short, reach
    that end.
    """
    if abs(normal) <= JAM_RATIO * system.gravity * system.total_mass:
        return False
    w = np.asarray(rates)
    thrown = sum(float(group.block.b.ravel() @ w[group.index].ravel() ** 2) for group in system.groups)
    return abs(normal) > JAM_RATIO * (system.gravity * system.total_mass + thrown)


@dataclass(frozen=True, eq=False)
class Escaping:
    """The J joints with escapements of a system, all arrays (J,): the links below and above (−1: support).

    `joint_rest` is the equilibrium angle (rad); `impulse` (N m s) and `angle` (rad) are those of the kicks.
    """

    system: System
    below: Ints
    above: Ints
    joint_rest: Floats
    impulse: Floats
    angle: Floats

    def gamma(self, values: Floats, rest: Floats | float = 0.0) -> Floats:
        """The value at every joint (..., J) from the values of all coordinates (..., half)."""
        with_zero = np.concatenate((values, np.zeros_like(values[..., :1])), axis=-1)
        below, above = np.array(self.pairs, dtype=np.int64).reshape(-1, 2).T
        return np.asarray(with_zero[..., below] - with_zero[..., above] - rest)

    @cached_property
    def pairs(self) -> tuple[tuple[int, int], ...]:
        """The coordinates of v below and above every joint, −1 standing for a support that does not turn."""
        system, first = self.system, self.system.first
        above = np.where(self.above < 0, -1, self.above + first)
        for joint in np.flatnonzero(self.above < 0):
            pivot = system.suspension.pivots[system.pendulum[self.below[joint]]]
            angle = system.suspension.angle_of(pivot.carrier)
            above[joint] = -1 if angle is None else angle
        return tuple(zip((self.below + first).tolist(), above.tolist(), strict=True))


def escaping(system: System) -> Escaping:
    """The joints with escapements, in the order of the groups."""
    parts: list[Floats] = []
    for group in system.groups:
        if group.has_escapements and group.excitation:
            above = np.vstack((np.full_like(group.index[:1], -1), group.index[:-1]))
            drive = group.excitation
            columns = (group.index, above, group.joint_rest, drive.impulse, drive.angle)
            parts.append(np.stack([part[drive.impulse > 0] for part in columns]))
    below, above, *rest = np.hstack(parts) if parts else np.empty((5, 0))
    return Escaping(system, below.astype(np.int64), above.astype(np.int64), *rest)


class Rubbed(NamedTuple):
    """Accelerations (half,) under friction, the friction τ (J,) found, and N of a rail with a coefficient.

    τ is that of contacts that stick and of one that slides on such a rail, 0 elsewhere.
    """

    accelerations: Any
    tau: Sequence[Any]
    normal: Any = None


class Gripping(NamedTuple):
    """Contacts with the coordinates `pairs` (below, above), of which those whose `sticks` (J,) is 1, not 0, stick.

    Where friction on the rail, contact 0, has a coefficient μ, it is `pressed` N = −s μ |N| as it slides to the side s.
    """

    pairs: Sequence[tuple[int, int]]
    sticks: Sequence[Any]
    rail_coefficient: Any = None

    def on_rail(self, accelerations: Any, response: Any, reaction: Callable[[Any, bool], Any]) -> tuple[Any, Any]:
        """τ₀ and N of a rail with a coefficient, from accelerations without it and the response to a unit of it.

        `reaction` is N at accelerations, or, if False comes with them, its part that is linear in them.
        """
        normal = reaction(accelerations, True) / (1.0 - self.rail_coefficient * reaction(response, False))
        return self.rail_coefficient * normal, normal

    def forces(self, half: int) -> Any:
        """Jᵀ, the generalized forces (half, J) of a unit of friction at every contact."""
        columns = np.zeros((half, len(self.pairs)))
        for column, (below, above) in zip(columns.T, self.pairs, strict=True):
            column[below] = 1.0
            if above >= 0:
                column[above] = -1.0
        return columns


class Articulated(NamedTuple):
    """M (kg), k (kg m), K (kg m²), p (N) and e (N m) of everything below a joint, along the rail (x) and down (z)."""

    xx: Any = 0.0
    xz: Any = 0.0
    zz: Any = 0.0
    kx: Any = 0.0
    kz: Any = 0.0
    K: Any = 0.0
    px: Any = 0.0
    pz: Any = 0.0
    e: Any = 0.0


class Joint(NamedTuple):
    """One link and the joint above it, on the way down: l n, h, D, g, s, w and J."""

    x: Any
    z: Any
    hx: Any
    hz: Any
    D: Any
    g: Any
    s: Any
    w: Any
    rotor: Any


def sticking_response(
    link: RecursiveLink, below: Articulated, s: Any, c: Any, sticks: Any, r: Any, rotor: Any
) -> tuple[Articulated, Joint]:
    """The response at the upper joint of a link whose sine and cosine are s and c."""
    l, M = link.l, below
    mx, mz = c * M.xx - s * M.xz, c * M.xz - s * M.zz
    D = link.J + (l * l * (c * mx - s * mz) + 2 * l * (c * M.kx - s * M.kz) + M.K)
    hx, hz = c * link.mc + l * mx + M.kx, l * mz + M.kz - s * link.mc
    g = l * (c * M.px - s * M.pz) + M.e
    w = (1.0 - sticks) / (D + rotor)
    push, wx, share = sticks * r - w * g, w * hx, sticks + rotor * w
    answer = Articulated(
        xx=link.m + M.xx - wx * hx,
        xz=M.xz - wx * hz,
        zz=link.m + M.zz - w * hz * hz,
        kx=share * hx,
        kz=share * hz,
        K=share * D,
        px=M.px + push * hx,
        pz=M.pz + push * hz,
        e=share * g + sticks * (D * r),
    )
    return answer, Joint(l * c, -l * s, hx, hz, D, g, sticks, w, rotor)


def chain_accelerations(joints: Sequence[Joint], a: Any, push: Any) -> tuple[list[Any], list[Any]]:
    """The accelerations a + α of links, top first, whose first joints have `push` (m/s²) added, and τ."""
    accelerations, torques = list[Any](), list[Any]()
    ax, az, above, alpha = push, 0.0, 0.0, 0.0
    for (x, z, hx, hz, D, g, s, w, rotor), free in zip(joints, a, strict=True):
        load = hx * ax + hz * az + g - rotor * alpha
        alpha = s * (above - free) - w * load
        torques.append(s * (load + (D + rotor) * alpha))
        above = s * above + ((1.0 - s) * free - w * load)
        accelerations.append(above)
        ax, az = ax + x * alpha, az + z * alpha
    return accelerations, torques


class Sticking:
    """The groups of a system, with the lengths of the moment, at coordinates q (half,) where joints are `gripping`."""

    def __init__(self, system: System, groups: Sequence[Group], gripping: Gripping, q: Any, a: Any) -> None:
        self.gripping, self.a = gripping, a
        self.sticks = np.zeros_like(q)
        for (below, _), sticks in zip(gripping.pairs, gripping.sticks, strict=True):
            self.sticks[below] = sticks
        self.has_cart, self.force = system.cart is not None, 0.0
        self.mass = system.cart.mass if system.cart else 0.0
        self.hung: list[tuple[Any, list[Joint]]] = []
        for group in groups:
            index, answer, joints = group.index + system.first, Articulated(), []
            free, sin, cos = a[index], np.sin(q[index]), np.cos(q[index])
            r = -free
            r[1:] = free[:-1] - free[1:]
            links = zip(links_of(group), sin, cos, self.sticks[index], r, group.block.rotor, strict=True)
            for link, *rest in reversed([*links]):
                answer, joint = sticking_response(link, answer, *rest)
                joints.append(joint)
            self.mass, self.force = self.mass + answer.xx.sum(0), self.force + answer.px.sum(0)
            self.hung.append((index, joints[::-1]))

    def apply_friction(self, reaction: Callable[[Any, bool], Any]) -> Rubbed:
        """Apply friction to accelerations a (half,) without it; `reaction` is that of `Gripping.on_rail`."""
        slides, push = 1.0 - self.sticks[0], 0.0
        if self.has_cart:
            push = self.sticks[0] * -self.a[0] - slides * (self.force / self.mass)
        accelerations, tau = self._under(push, self.a, self.hung)
        if self.gripping.rail_coefficient is None:
            return Rubbed(accelerations, tau)
        free_joints = [(index, [joint._replace(g=0.0) for joint in joints]) for index, joints in self.hung]
        response, others = self._under(slides / self.mass, np.zeros_like(self.a), free_joints)
        rail, normal = self.gripping.on_rail(accelerations, response, reaction)
        others[0] = 1.0
        friction = [t + o * rail for t, o in zip(tau, others, strict=True)]
        return Rubbed(accelerations + response * rail, friction, normal)

    def _under(self, push: Any, a: Any, chains: Sequence[tuple[Any, list[Joint]]]) -> tuple[Any, list[Any]]:
        """The accelerations under friction as the cart has `push` added to that in a, and τ (J,)."""
        accelerations, torques = np.zeros_like(a), np.zeros_like(a)
        if self.has_cart:
            accelerations[0] = a[0] + push
            torques[0] = self.sticks[0] * (self.mass * push + self.force)
        for index, joints in chains:
            accelerations[index], torques[index] = chain_accelerations(joints, a[index], push)
        return accelerations, [torques[below] for below, _ in self.gripping.pairs]
