"""The numbers of one short chain as plain floats, without the arrays of a rig: a table of two rows needs no more.

They are, bit for bit, what `Rig.natural` makes of the scene.
"""

from __future__ import annotations

from typing import NamedTuple

from modal.assembly.arrays import CartNumbers, Units
from modal.scene import Cart, Scene, validate_scene

MOST = 20
"""Links up to which floats are quicker than arrays."""
OTHERS = frozenset(
    {
        *("space", "copies", "inverted", "joint_springs", "dampers", "linear_drag", "damping_ratio", "massless_cart"),
        *("constant_force", "structure", "springs"),
    }
)
"""The features of scenes whose modes are not those of one plain chain."""


class Single(NamedTuple):
    """Mass, length, centre and inertia of each link, top first, and the cart (None: fixed), in natural units."""

    links: list[tuple[float, float, float, float]]
    cart: CartNumbers | None
    units: Units


def single(scene: Scene) -> Single | None:
    """The numbers of a scene that is one short plain chain; None for any other."""
    validate_scene(scene)
    pendula = scene.pendulum
    if len(pendula) > 1 or not OTHERS.isdisjoint(scene.features) or pendula[0].n_links > MOST:
        return None
    links, support = pendula[0].links, scene.support
    units = Units.of(max([link.mass for link in links]), max([link.length for link in links]), scene.gravity)
    kg, metre = units.mass, units.length
    moment = kg * metre**2
    rows = []
    for link in links:
        mass, length = link.mass, link.length
        centre, inertia = link.proportions(mass, length)
        rows += [(mass / kg, length / metre, centre / metre, inertia / moment)] * link.count
    if not isinstance(support, Cart):
        return Single(rows, None, units)
    if not support.mass:
        return None
    return Single(rows, CartNumbers(support.mass / kg, 0.0, support.stiffness / units.stiffness), units)
