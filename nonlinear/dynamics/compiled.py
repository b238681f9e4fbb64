"""`nonlinear.dynamics.recursion` compiled by numba (extra `fast`): one kernel for the whole derivative.

Links are ordered as in y: pendulum by pendulum, top to bottom, so that joints, recursion and work are loops over flat
arrays; what it does at each link is `nonlinear.dynamics.recursion`, as it stands there.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from modal.eigen.compiling import available, compiled
from modal.errors import MissingExtraError
from modal.types import Floats, Ints
from nonlinear.dynamics.inputs import NOTHING
from nonlinear.dynamics.joints import joint_law
from nonlinear.dynamics.minimal import Minimal
from nonlinear.dynamics.recursion import Answer, Link, Turn, hung, links_of, passed
from nonlinear.system import System

CONSTANTS = 12
LOOSE = np.empty(0)


_joint_law, _passed, _hung = compiled(joint_law), compiled(passed), compiled(hung)


@compiled
def _joint(links, angles, rates, i, top):  # type: ignore[no-untyped-def]
    """Moment (N m) on link i of the spring, damper and drive above it, and the power (W) of the latter two."""
    stiffness, damping, bent, strength, curb = links[i, 7], links[i, 8], links[i, 9], links[i, 10], links[i, 11]
    turned, speed = angles[i], rates[i]
    if not top:
        turned, speed = turned - angles[i - 1], speed - rates[i - 1]
    kept, working = _joint_law(turned - bent, speed, stiffness, damping, strength, curb)
    return kept + working, working * speed


@compiled
def _link(links, i):  # type: ignore[no-untyped-def]
    return Link(links[i, 0], links[i, 1], links[i, 2], links[i, 3], links[i, 4], links[i, 5], links[i, 6])


@compiled
def _upward(links, start, stop, angles, rates, moments, turns):  # type: ignore[no-untyped-def]
    """One pendulum: fills `turns` (hx, hz, e, D, sin, cos); the load on its first joint, and the joints' power."""
    below, hung, power = Answer(0.0, 0.0, 0.0, 0.0, 0.0), 0.0, 0.0
    for i in range(stop - 1, start - 1, -1):
        s, c = np.sin(angles[i]), np.cos(angles[i])
        hinge, lost = _joint(links, angles, rates, i, i == start)
        Q, hung, power = hinge - hung, hinge, power + lost
        if moments.size:
            Q = moments[i] + Q
        below, turn = _passed(_link(links, i), below, s, c, rates[i], Q)
        turns[i, 0], turns[i, 1], turns[i, 2], turns[i, 3] = turn.hx, turn.hz, turn.e, turn.D
        turns[i, 4], turns[i, 5] = s, c
    return below, power


@compiled
def _downward(links, start, stop, rates, turns, ax, az, turned):  # type: ignore[no-untyped-def]
    """One pendulum: fills θ'' under the acceleration (ax, az) of its first joint less gravity."""
    for i in range(start, stop):
        turn = Turn(turns[i, 0], turns[i, 1], turns[i, 2], turns[i, 3], turns[i, 4], turns[i, 5], rates[i])
        turned[i], ax, az = _hung(_link(links, i), turn, ax, az)


@compiled
def rate(y, links, first, cart, gravity, works, push, moments, turns, found):  # type: ignore[no-untyped-def]
    """The whole of `Minimal.derivative`, into `found`; `cart` holds mass, damper and spring, or is empty."""
    on_cart = int(cart.size > 0)
    half = on_cart + len(links)
    angles, rates, turned = y[on_cart:half], y[half + on_cart : 2 * half], found[half + on_cart : 2 * half]
    found[:half] = y[half : 2 * half]
    mass, force, power, x2 = 0.0, 0.0, 0.0, 0.0
    for p in range(len(first) - 1):
        answer, lost = _upward(links, first[p], first[p + 1], angles, rates, moments, turns)
        mass, force, power = mass + answer[0], force + (answer[3] - gravity * answer[1]), power + lost
    if on_cart:
        kept, working = _joint_law(y[0], y[half], cart[2], cart[1])
        x2 = (push + working + kept - force) / (cart[0] + mass)
        found[half] = x2
        power += y[half] * (push + working)
    for p in range(len(first) - 1):
        _downward(links, first[p], first[p + 1], rates, turns, x2, -gravity, turned)
    if works:
        for i in range(moments.size):
            power += moments[i] * rates[i]
        found[-1] = power


@dataclass(frozen=True, eq=False)
class Compiled(Minimal):
    """The equations of `Minimal` in one compiled pass, without bodies; MissingExtraError without numba."""

    bodies: tuple[()] = ()

    def __post_init__(self) -> None:
        if not available():
            raise MissingExtraError("numba", "fast")

    @cached_property
    def scene(self) -> tuple[Floats, Ints, Floats, float, bool]:
        """Arguments of the kernels: link constants, first links of pendula, cart, gravity, whether y has work."""
        cart = self.system.cart
        return (
            _rows(self.system),
            np.append(np.flatnonzero(np.diff(self.system.pendulum, prepend=-1)), self.system.n_links),
            np.array(cart or (), dtype=float),
            self.system.gravity,
            self.layout.works,
        )

    def derivative(self, time: float, y: Any) -> Any:
        """The derivative y' of one y (size,)."""
        push, moments = self.load(time, self.layout.state(y)) if self.load else NOTHING
        loose = LOOSE if moments is None else np.ascontiguousarray(moments, dtype=float)
        found, turns = np.empty(self.layout.size), np.empty((self.system.n_links, 6))
        rate(np.ascontiguousarray(y, dtype=float), *self.scene, float(push), loose, turns, found)
        return found


def _rows(system: System) -> Floats:
    """The constants of every link in the order of the file, (L, 12)."""
    found = np.empty((system.n_links, CONSTANTS))
    for group in system.groups:
        none = np.zeros_like(group.bent)
        drive = (group.excitation.strength, group.excitation.curb) if group.excitation else (none, none)
        joints = group.block.stiffness, group.block.damping, group.bent, *drive
        found[group.index] = np.stack((*np.swapaxes(links_of(group), 0, 1), *joints), axis=-1)
    return found
