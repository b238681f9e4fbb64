"""`nonlinear.dynamics.recursion` compiled by numba (extra `fast`): one kernel for the whole derivative.

Links are ordered as in y: pendulum by pendulum, top to bottom, so that joints, recursion and work are loops over flat
arrays; its operations at each link are those of `nonlinear.dynamics.recursion`, unchanged.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, partial
from threading import local
from typing import Any

import numpy as np

from modal.errors import MissingExtraError
from modal.types import Floats, Ints
from nonlinear.dynamics.compiled_structure import (
    FlatStructure,
    flat_of,
    joint_moment,
    link_at,
    rate_on_carriers,
    with_own_room,
)
from nonlinear.dynamics.compiling import available, compiled, in_place
from nonlinear.dynamics.forces import joint_law
from nonlinear.dynamics.minimal import Minimal
from nonlinear.dynamics.programs import programs_of
from nonlinear.dynamics.recursion import (
    NOTHING_BELOW,
    Answer,
    Turn,
    geared_response,
    link_acceleration,
    link_response,
    links_of,
    tip_response,
)
from nonlinear.dynamics.text import sincos
from nonlinear.system import System

LINK_NUMBERS = 12
"""Format: constants of a link in a row of a compiled scene."""
TURN_ROWS = 6
"""Format: rows of the quantities of turning links at an instant."""
Arguments = tuple[Floats, Floats, Ints, Floats, float, bool, bool, FlatStructure | None, Floats | None]
SINCOS_ANGLE_MAX = 1e6
"""Tolerance: rad, up to which `sincos` reduces angles exactly; beyond the library does."""


_sincos, _joint_law, _geared_response = map(in_place, (sincos, joint_law, geared_response))
_tip_response, _link_response, _link_acceleration = map(in_place, (tip_response, link_response, link_acceleration))


@in_place
def _sines(angles, sin, cos):  # type: ignore[no-untyped-def]
    """Sines and cosines, several at once where no angle is so large that its reduction would lose digits."""
    within = True
    for i in range(angles.size):
        within &= abs(angles[i]) < SINCOS_ANGLE_MAX
    if within:
        for i in range(angles.size):
            sin[i], cos[i] = _sincos(angles[i])
    else:
        for i in range(angles.size):
            sin[i], cos[i] = np.sin(angles[i]), np.cos(angles[i])


@in_place
def _joint(links, laws, angles, rates, i, top):  # type: ignore[no-untyped-def]
    """`joint_moment` of the joint above link i."""
    if top:
        return joint_moment(laws, links[i], angles[i], rates[i])
    return joint_moment(laws, links[i], angles[i] - angles[i - 1], rates[i] - rates[i - 1])


@in_place
def _bare_response(links, i, is_tip, answer, s, c, w, Q):  # type: ignore[no-untyped-def]
    """`link_response`, or `tip_response` of the last link."""
    if is_tip:
        return _tip_response(link_at(links, i), s, c, w, Q)
    return _link_response(link_at(links, i), answer, s, c, w, Q)


@partial(in_place, forceinline=True)
def rate(  # type: ignore[no-untyped-def]
    y, links, laws, first, cart, gravity, has_joint_torques, works, structure, rotors, turns, derivative
):
    """The whole of `Minimal.derivative`, into `derivative`.

    `laws` are the programs of the joints, `first` the first links of the pendula, `cart` holds mass, damper and spring,
    or is empty; where not `has_joint_torques`, no joint has a spring, damper or law; `rotors` (L,) are those of all
    joints, or None.  `turns` (6, L) is space for sin, cos, and hx, hz, e, J over D, whose divisions overlap on the way
    up.
    """
    if structure is not None:
        d, half = len(structure.kind), len(structure.kind) + len(links)
        _sines(y[d:half], turns[0], turns[1])
        rate_on_carriers(y, links, laws, first, gravity, has_joint_torques, works, structure, turns, derivative)
        return
    on_cart = int(cart.size > 0)
    half = on_cart + len(links)
    angles, rates, accelerations = y[on_cart:half], y[half + on_cart : 2 * half], derivative[half + on_cart : 2 * half]
    sin, cos, hx, hz, e, geared = turns[0], turns[1], turns[2], turns[3], turns[4], turns[5]
    _sines(angles, sin, cos)
    slopes = y[half : 2 * half]
    for i in range(half):
        derivative[i] = slopes[i]
    mass, force, power, x2 = 0.0, 0.0, 0.0, 0.0
    for p in range(len(first) - 1):
        answer, below, hinge_below = Answer(0.0, 0.0, 0.0, 0.0, 0.0), NOTHING_BELOW, 0.0
        for i in range(first[p + 1] - 1, first[p] - 1, -1):
            Q = 0.0
            if has_joint_torques:
                hinge, joint_power = _joint(links, laws, angles, rates, i, i == first[p])
                Q, hinge_below, power = hinge - hinge_below, hinge, power + joint_power
            if rotors is not None:
                below, turn = _geared_response(link_at(links, i), rotors[i], below, sin[i], cos[i], rates[i], Q)
                answer = Answer(below.xx, below.xz, below.zz, below.px, below.pz)
                geared[i] = rotors[i] / turn.D
            else:
                answer, turn = _bare_response(links, i, i == first[p + 1] - 1, answer, sin[i], cos[i], rates[i], Q)
            share = 1.0 / turn.D
            hx[i], hz[i], e[i] = share * turn.hx, share * turn.hz, share * turn.e
        mass, force = mass + answer.xx, force + (answer.px - gravity * answer.xz)
    if on_cart:
        elastic, working = _joint_law(y[0], y[half], cart[2], cart[1])
        x2 = (working + elastic - force) / (cart[0] + mass)
        derivative[half] = x2
        power += y[half] * working
    for p in range(len(first) - 1):
        ax, az = x2, -gravity
        for i in range(first[p], first[p + 1]):
            if rotors is not None and i > first[p]:
                e[i] -= geared[i] * accelerations[i - 1]
            turn = Turn(hx[i], hz[i], e[i], 1.0, sin[i], cos[i], rates[i])
            accelerations[i], ax, az = _link_acceleration(link_at(links, i), turn, ax, az)
    if works:
        derivative[2 * half] = power


@compiled
def one_rate(y, scene, turns, derivative):  # type: ignore[no-untyped-def]
    """Return the same for Python, for the `scene` of `Compiled`."""
    rate(y, *scene, turns, derivative)


@dataclass(frozen=True, eq=False)
class Compiled(Minimal):
    """The equations of `Minimal` in one compiled pass, without bodies or load; MissingExtraError without numba."""

    bodies: tuple[()] = ()

    def __post_init__(self) -> None:
        if not available():
            raise MissingExtraError("numba", "fast")
        assert self.load is None

    @property
    def scene(self) -> Arguments:
        """Arguments of `rate`: constants, laws, first links, cart, gravity, whether joints act, y has work, and more.

        The caller provides the storage of a structure and the rows of laws.
        """
        links, laws, *numbers, structure, rotors = self._constants
        own_structure = None if structure is None else with_own_room(structure)
        return links, laws.copy(), *numbers, own_structure, rotors  # type: ignore[return-value]

    @cached_property
    def _constants(self) -> Arguments:
        cart = self.system.cart
        laws, places = programs_of(self.system)
        return (
            _rows(self.system, places),
            laws,
            np.append(np.flatnonzero(np.diff(self.system.pendulum, prepend=-1)), self.system.n_links),
            np.array(cart or (), dtype=float),
            self.system.gravity,
            any(group.has_joint_torques for group in self.system.groups),
            self.layout.works,
            None if self.system.structure is None else flat_of(self.system),
            self.system.by_link("rotor") if self.system.has_rotors else None,
        )

    @cached_property
    def _of_thread(self) -> local:
        return local()

    def derivative(self, time: float, y: Any) -> Any:
        """The derivative y' of one y (size,)."""
        slopes, turns = np.empty(self.layout.size), np.empty((TURN_ROWS, self.system.n_links))
        try:
            scene = self._of_thread.scene
        except AttributeError:
            scene = self._of_thread.scene = self.scene
        one_rate(np.ascontiguousarray(y, dtype=float), scene, turns, slopes)
        return slopes


def _rows(system: System, places: Floats) -> Floats:
    """The constants of every link in the order of the file, (L, 12)."""
    rows = np.empty((system.n_links, LINK_NUMBERS))
    for group in system.groups:
        joints = group.block.stiffness, group.block.damping, group.joint_rest, *np.moveaxis(places[group.index], -1, 0)
        rows[group.index] = np.stack((*np.swapaxes(links_of(group), 0, 1), *joints), axis=-1)
    return rows
