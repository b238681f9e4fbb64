"""What acts on a plane scene besides gravity and the pivots: joints and loads, in the order of the file.

A load is a force on the cart and a moment on every link; dampers, drives and loads do work, springs keep it.
"""

from __future__ import annotations

from modal.types import Floats
from nonlinear.dynamics import joints
from nonlinear.system import AppliedForces, State, System


def on_links(system: System, state: State, push: AppliedForces) -> Floats:
    """Generalized forces (N m) on the absolute angles, (L,)."""
    found = state.links * 0.0
    for group in system.groups:
        if group.hinged:
            found[group.index] = joints.moments(group, state.links[group.index], state.link_rates[group.index])
    return found if push.moments is None else found + push.moments


def on_cart(system: System, state: State, push: AppliedForces) -> float:
    """Force (N) along the rail, that of the pivots left out; 0 on a fixed support."""
    cart = system.cart
    return push.cart - cart.damping * state.cart_rate - cart.stiffness * state.cart if cart else 0.0


def power(system: System, state: State, push: AppliedForces) -> float:
    """Power (W) of dampers, drives and the load."""
    found = 0.0
    for group in system.groups:
        found += float(joints.power(group, state.links[group.index], state.link_rates[group.index]))
    if system.cart:
        found += state.cart_rate * (push.cart - system.cart.damping * state.cart_rate)
    return found if push.moments is None else found + float(push.moments @ state.link_rates)
