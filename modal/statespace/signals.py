"""The inputs and outputs of a scene: groups of named signals as rows over q = (x, θ_1, …).

A horizontal displacement, to first order, is a row h over q: of a centre h = e_x + Σ_{above} l cos θ + c cos θ, of a
lower joint e_x + Σ l cos θ, with the equilibrium's angles θ, 0 or π without constant forces.  A horizontal force at
that point acts on q with hᵀ; the force of pendulum p on its pivot is −Σ m h q'' plus the external forces on its links.

Where the support moves (the fixed support, or the ground to which a cart's rail, spring and damper are attached), q is
in its frame; positions, the cart's velocity and forces on pivots are those in the laboratory.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from modal.assembly import displacements, joints, rig_of
from modal.errors import SceneError, meant
from modal.scene import Scene
from modal.types import Floats


class Signal(NamedTuple):
    """The ASCII name of a state, an input or an output, its unit, and its meaning."""

    name: str
    unit: str
    meaning: str


@dataclass(frozen=True, eq=False)
class Geometry:
    """Rows over q of every link's centre, lower joint and angle relative to the link above, each (links, q).

    `labels` (links,) are "p_i", both from 1, every copy numbered; `mass` (links,), linear `drag` (links,), `pendulum`
    (links,) from 0; `rest` (links,) the equilibrium's angles θ and `place` (m) the cart's; `length` and `centre`
    (links,) those of the links, and `across` and `sinking` (links,) their cos θ and −sin θ; `on_cart` tells whether q
    begins with x.  Where lengths change, `rate` and `bend` (links, q) are the first two derivatives in time of the rows
    of centres and lower joints.
    """

    centres: Floats
    joints: Floats
    relative: Floats
    mass: Floats
    drag: Floats
    rest: Floats
    place: float
    length: Floats
    centre: Floats
    across: Floats
    sinking: Floats
    pendulum: Floats
    labels: tuple[str, ...]
    on_cart: bool
    rate: Floats | None = None
    bend: Floats | None = None

    @property
    def size(self) -> int:
        """Number of coordinates."""
        return int(self.centres.shape[1])

    @property
    def angles(self) -> Floats:
        """The rows of the absolute angles."""
        return np.eye(self.size)[int(self.on_cart) :]

    @property
    def tips(self) -> list[int]:
        """The last link of every pendulum."""
        return [int(np.flatnonzero(self.pendulum == p)[-1]) for p in np.unique(self.pendulum)]


def geometry_of(scene: Scene) -> Geometry:
    """The rows of a scene, one for each copy."""
    rig = rig_of(scene)
    on_cart = rig.cart is not None
    hung = [(rig.blocks[block], column) for block, column, count in rig.members for _ in range(count)]
    total = sum(block.n for block, _ in hung)
    relative = np.zeros((total, total + on_cart))
    numbers, pendulum = [], []
    labels: list[str] = []
    for p, (block, column) in enumerate(hung):
        at = len(labels)
        own = slice(at + on_cart, at + on_cart + block.n)
        relative[at : at + block.n, own] = np.eye(block.n) - np.eye(block.n, k=-1)
        sinking = np.zeros_like(block.sigma) if block.sinking is None else block.sinking
        each = (block.mass, block.drag, block.length, block.centre, block.across, sinking)
        numbers.append([part[:, column] for part in each])
        pendulum.append(np.full(block.n, float(p)))
        labels += [f"{p + 1}_{i}" for i in range(1, block.n + 1)]
    rows, below = displacements(hung, rig.cart), displacements(hung, rig.cart, joints)
    mass, drag, length, centre, across, sunk = (np.concatenate(parts) for parts in zip(*numbers, strict=True))
    owners, rest, place = np.concatenate(pendulum), rig.rest_angles, rig.cart_rest
    return Geometry(
        rows, below, relative, mass, drag, rest, place, length, centre, across, sunk, owners, tuple(labels), on_cart
    )


# ------------------------------------------------------------------------------------------------------- inputs


class InputGroup(NamedTuple):
    """Inputs as generalized forces F (q, m), and the external force of each on each pendulum (p, m)."""

    signals: list[Signal]
    F: Floats
    thrust: Floats


def _cart_force(geometry: Geometry) -> InputGroup:
    F = np.zeros((geometry.size, 1))
    F[0] = 1.0
    return InputGroup([Signal("cart_force", "N", "force on the cart along the rail")], F, _nothing(geometry, 1))


def _joint_torques(geometry: Geometry) -> InputGroup:
    signals = [Signal(f"torque_{label}", "N m", "torque of a joint on the link below it") for label in geometry.labels]
    return InputGroup(signals, geometry.relative.T, _nothing(geometry, len(signals)))


def _link_forces(geometry: Geometry) -> InputGroup:
    signals = [
        Signal(f"force_{label}", "N", "horizontal force at a link's centre of mass") for label in geometry.labels
    ]
    thrust = (geometry.pendulum == np.unique(geometry.pendulum)[:, None]).astype(float)
    return InputGroup(signals, geometry.centres.T, thrust)


def _nothing(geometry: Geometry, m: int) -> Floats:
    return np.zeros((len(geometry.tips), m))


PUSHES: dict[str, Callable[[Geometry], InputGroup]] = {
    "cart_force": _cart_force,
    "joint_torques": _joint_torques,
    "link_forces": _link_forces,
}
DRIVES = {
    "cart_acceleration": Signal("cart_acceleration", "m/s^2", "prescribed acceleration of the cart"),
    "cart_velocity": Signal("cart_velocity", "m/s", "prescribed velocity of the cart"),
}
SUPPORT = {
    "support_displacement": Signal("support_displacement", "m", "displacement of the support along the rail"),
    "support_velocity": Signal("support_velocity", "m/s", "velocity of the support along the rail"),
    "support_acceleration": Signal("support_acceleration", "m/s^2", "acceleration of the support along the rail"),
}
"""Motions of the fixed support, or of the ground under a cart."""
INPUTS = (*PUSHES, *DRIVES, *SUPPORT)


# ------------------------------------------------------------------------------------------------------ outputs


class OutputGroup(NamedTuple):
    """Outputs as Y0 q + Y1 q' + Y2 q'' + thrust u; a part that is None is zero.

    `translation` (p,) is what a translation of everything along the rail adds: per metre, per m/s where there is a Y1,
    per m/s² where there is a Y2; `order` says which.
    """

    signals: list[Signal]
    position: Floats | None = None
    rate: Floats | None = None
    acceleration: Floats | None = None
    pushed: bool = False
    translation: Floats | None = None

    @property
    def order(self) -> int:
        """Of the highest derivative that it contains."""
        return 2 if self.acceleration is not None else 1 if self.rate is not None else 0


def _named(prefix: str, unit: str, meaning: str, labels: tuple[str, ...]) -> list[Signal]:
    return [Signal(f"{prefix}_{label}", unit, meaning) for label in labels]


def _tips(geometry: Geometry) -> OutputGroup:
    signals = [Signal(f"tip_{p}", "m", "horizontal position of a pendulum's end") for p in _pendula(geometry)]
    return OutputGroup(signals, geometry.joints[geometry.tips], translation=np.ones(len(signals)))


def _tip_accelerations(geometry: Geometry) -> OutputGroup:
    signals = [Signal(f"tip_ddot_{p}", "m/s^2", "acceleration of a pendulum's end") for p in _pendula(geometry)]
    parts = _accelerations(geometry, geometry.joints, lambda rows: rows[geometry.tips])
    return OutputGroup(signals, *parts, translation=np.ones(len(signals)))


def _accelerations(
    geometry: Geometry, rows: Floats, of: Callable[[Floats], Floats]
) -> tuple[Floats | None, Floats | None, Floats]:
    """What multiplies q, q' and q'' in linear combinations of accelerations of the links' points with these rows."""
    if geometry.rate is None or geometry.bend is None:
        return None, None, of(rows)
    return of(geometry.bend), of(2 * geometry.rate), of(rows)


def _pivot_forces(geometry: Geometry) -> OutputGroup:
    signals = [
        Signal(f"pivot_force_{p}", "N", "horizontal force of a pendulum on its pivot") for p in _pendula(geometry)
    ]
    belongs = geometry.pendulum == np.unique(geometry.pendulum)[:, None]
    weights, dragged = belongs * -geometry.mass, belongs * -geometry.drag
    position, rate, inertia = _accelerations(geometry, geometry.centres, lambda rows: weights @ rows)
    if geometry.drag.any():
        rate = dragged @ geometry.centres + (0.0 if rate is None else rate)
        position = None if geometry.rate is None else position + dragged @ geometry.rate
    return OutputGroup(signals, position, rate, inertia, pushed=True, translation=weights.sum(1))


def _pendula(geometry: Geometry) -> range:
    return range(1, len(geometry.tips) + 1)


READINGS: dict[str, Callable[[Geometry], OutputGroup]] = {
    "cart_position": lambda g: OutputGroup(
        [Signal("x", "m", "position of the cart")], np.eye(g.size)[:1], translation=np.ones(1)
    ),
    "cart_velocity": lambda g: OutputGroup(
        [Signal("x_dot", "m/s", "velocity of the cart")], rate=np.eye(g.size)[:1], translation=np.ones(1)
    ),
    "angles": lambda g: OutputGroup(_named("theta", "rad", "angle from equilibrium", g.labels), g.angles),
    "rates": lambda g: OutputGroup(_named("theta_dot", "rad/s", "rate of the angle", g.labels), rate=g.angles),
    "relative_angles": lambda g: OutputGroup(_named("rel", "rad", "angle to the link above", g.labels), g.relative),
    "relative_rates": lambda g: OutputGroup(
        _named("rel_dot", "rad/s", "rate of that angle", g.labels), rate=g.relative
    ),
    "joint_positions": lambda g: OutputGroup(
        _named("joint", "m", "horizontal position of a lower joint", g.labels),
        g.joints,
        translation=np.ones(len(g.labels)),
    ),
    "tip_positions": _tips,
    "tip_accelerations": _tip_accelerations,
    "pivot_forces": _pivot_forces,
}
OUTPUTS = tuple(READINGS)
OF_A_CART = {"cart_force", "cart_position", "cart_velocity", "cart_acceleration"}


def validate_signals(
    words: tuple[str, ...],
    known: tuple[str, ...],
    what: str,
    *,
    on_cart: bool,
    more: Callable[[str], bool] = lambda word: False,
    written: str = "",
) -> tuple[str, ...]:
    """The words themselves; SceneError names every one that is unknown, repeated or needs a cart.

    `more` tells of further ones that are known, and `written` how these are.
    """
    if isinstance(words, str):
        raise SceneError([f'{what} {words}: must be a tuple of names: ("{words}",)'])
    there = ", ".join(known) + (f"; or {written}" if written else "")
    unknown = [word for word in words if word not in known and not more(word)]
    problems = [f"{what} {word}: must be one of {there}{meant(word, known)}" for word in unknown]
    problems += [f"{what} {word}: named twice" for word in dict.fromkeys(words) if words.count(word) > 1]
    problems += [f"{what} {word}: the support is fixed" for word in words if word in OF_A_CART and not on_cart]
    if problems:
        raise SceneError(problems)
    return words
