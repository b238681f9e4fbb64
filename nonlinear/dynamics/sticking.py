"""Accelerations in the plane under the friction of joints that stick, by one pass up and one down, O(links).

To the accelerations a without that friction it adds α with M α = Jᵀτ, so that at a joint that sticks, s = 1, both links
turn alike, and at one that slides, s = 0, τ is 0.  As in `nonlinear.dynamics.recursion` all from a joint down responds
to the acceleration ã of the joint, here also to α of the link above where its first joint sticks, with the force f and
the moment N

    f = M ã + k α + p      N = k·ã + K α + e

With M', k', K', p', e' of all that hangs below a link, n = (cos θ, −sin θ) across it, J = I + m c² and r = a_above − a,

    D = J + l² n·M'n + 2 l n·k' + K'     h = m c n + l M'n + k'     g = l n·p' + e'     w = (1 − s)/D
    M = m + M' − w h hᵀ    k = s h    K = s D    p = p' + (s r − w g) h    e = s (g + D r)

and on the way down α = s (α_above + r) − w (h·ã + g), τ = s (h·ã + D α + g) (Featherstone, Rigid Body Dynamics
Algorithms, 2008, §7.2, with joints of no freedom).  One text serves every set of joints that stick.

On a rail with a coefficient μ the limit is μ|N|.  Where N₀ and the response c₀ to a unit of friction on the rail are
those with the others held,

    τ₀ = k N,   N = N₀ + n₀ τ₀,   k = −s μ sign N        so that   τ₀ = k N₀/(1 − k n₀),  n₀ = ∂N/∂a · c₀.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from nonlinear.dynamics.contacts import Gripping, Rubbed
from nonlinear.dynamics.recursion import RecursiveLink, links_of
from nonlinear.system import Group, System


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
    """One link and the joint above it, on the way down: l n, h, D, g, s and w."""

    x: Any
    z: Any
    hx: Any
    hz: Any
    D: Any
    g: Any
    s: Any
    w: Any


def passed(link: RecursiveLink, below: Articulated, s: Any, c: Any, sticks: Any, r: Any) -> tuple[Articulated, Joint]:
    """The response at the upper joint of a link whose sine and cosine are s and c."""
    l, M = link.l, below
    mx, mz = c * M.xx - s * M.xz, c * M.xz - s * M.zz
    D = link.J + (l * l * (c * mx - s * mz) + 2 * l * (c * M.kx - s * M.kz) + M.K)
    hx, hz = c * link.mc + l * mx + M.kx, l * mz + M.kz - s * link.mc
    g = l * (c * M.px - s * M.pz) + M.e
    w = (1.0 - sticks) / D
    push, wx = sticks * r - w * g, w * hx
    answer = Articulated(
        xx=link.m + M.xx - wx * hx,
        xz=M.xz - wx * hz,
        zz=link.m + M.zz - w * hz * hz,
        kx=sticks * hx,
        kz=sticks * hz,
        K=sticks * D,
        px=M.px + push * hx,
        pz=M.pz + push * hz,
        e=sticks * (g + D * r),
    )
    return answer, Joint(l * c, -l * s, hx, hz, D, g, sticks, w)


def turned(joints: Sequence[Joint], a: Any, push: Any) -> tuple[list[Any], list[Any]]:
    """The accelerations a + α of links, top first, whose first joints have `push` (m/s²) added, and τ."""
    accelerations, torques = list[Any](), list[Any]()
    ax, az, above = push, 0.0, 0.0
    for (x, z, hx, hz, D, g, s, w), free in zip(joints, a, strict=True):
        felt = hx * ax + hz * az + g
        alpha = s * (above - free) - w * felt
        torques.append(s * (felt + D * alpha))
        above = s * above + ((1.0 - s) * free - w * felt)
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
            for link, *rest in reversed([*zip(links_of(group), sin, cos, self.sticks[index], r, strict=True)]):
                answer, joint = passed(link, answer, *rest)
                joints.append(joint)
            self.mass, self.force = self.mass + answer.xx.sum(0), self.force + answer.px.sum(0)
            self.hung.append((index, joints[::-1]))

    def rubbed(self, reaction: Callable[[Any, bool], Any]) -> Rubbed:
        """What friction makes of accelerations a (half,) without it.

        `reaction` is N at accelerations, or, if False comes with them, its part that is linear in them.
        """
        slides, push = 1.0 - self.sticks[0], 0.0
        if self.has_cart:
            push = self.sticks[0] * -self.a[0] - slides * (self.force / self.mass)
        accelerations, tau = self._under(push, self.a, self.hung)
        if self.gripping.pressed is None:
            return Rubbed(accelerations, tau)
        alone = [(index, [joint._replace(g=0.0) for joint in joints]) for index, joints in self.hung]
        response, others = self._under(slides / self.mass, np.zeros_like(self.a), alone)
        base, slope = reaction(accelerations, True), reaction(response, False)
        rail = self.gripping.pressed * base / (1.0 - self.gripping.pressed * slope)
        others[0] = 1.0
        return Rubbed(
            accelerations + response * rail,
            [t + o * rail for t, o in zip(tau, others, strict=True)],
            base + slope * rail,
        )

    def _under(self, push: Any, a: Any, hung: Sequence[tuple[Any, list[Joint]]]) -> tuple[Any, list[Any]]:
        """The accelerations under friction as the cart has `push` added to that in a, and τ (J,)."""
        accelerations, torques = np.zeros_like(a), np.zeros_like(a)
        if self.has_cart:
            accelerations[0] = a[0] + push
            torques[0] = self.sticks[0] * (self.mass * push + self.force)
        for index, joints in hung:
            accelerations[index], torques[index] = turned(joints, a[index], push)
        return accelerations, [torques[below] for below, _ in self.gripping.pairs]
