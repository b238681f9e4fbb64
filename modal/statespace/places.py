"""Where named signals act and what they read: names of `modal.statespace.signals` taken apart."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import NamedTuple

from modal.assembly import CART, DRAG, JOINT, WIRE, Dissipator
from modal.eigen import FORCE, TORQUE, TURN
from modal.statespace.signals import Signal

GROUND, BASE, PUSH = "ground", "base", "push"


class SignalPlace(NamedTuple):
    """What a signal is, how often it is differentiated, and the pendulum and link, from 0, it belongs to."""

    what: str
    order: int
    pendulum: int = -1
    link: int = -1


GIVEN = {
    "cart_force": (PUSH, 0),
    "torque": (TORQUE, 0),
    "force": (FORCE, 0),
    "cart_velocity": (BASE, 1),
    "cart_acceleration": (BASE, 2),
    "support_displacement": (GROUND, 0),
    "support_velocity": (GROUND, 1),
    "support_acceleration": (GROUND, 2),
}
READ = {
    "x": ("x", 0),
    "x_dot": ("x", 1),
    "theta": ("theta", 0),
    "theta_dot": ("theta", 1),
    "rel": ("rel", 0),
    "rel_dot": ("rel", 1),
    "joint": ("joint", 0),
    "tip": ("joint", 0),
    "tip_ddot": ("joint", 2),
    "pivot_force": ("pivot_force", 0),
}
NAME = re.compile(r"(\w+?)(?:_(\d+))?(?:_(\d+))?")


def place_of(kinds: dict[str, tuple[str, int]], name: str, tips: Sequence[int]) -> SignalPlace:
    """Where a signal of this name is; `tips` are the last links of all pendula.  KeyError for an unknown name."""
    match = NAME.fullmatch(name)
    if not match:
        raise KeyError(name)
    prefix, pendulum, link = match.groups()
    number = int(pendulum) - 1 if pendulum else -1
    return SignalPlace(*kinds[prefix], number, int(link) - 1 if link else tips[number] if pendulum else -1)


PAIRS = {JOINT: TORQUE, WIRE: TURN, DRAG: FORCE, CART: PUSH}
"""What the pair of forces of a dissipator is, by its kind."""


def place_of_input(driven: Signal | Dissipator, tips: Sequence[int]) -> SignalPlace:
    """Where an input acts, perhaps as a pair of forces.  KeyError for an unknown name."""
    if isinstance(driven, Dissipator):
        pendulum, link = -1, driven.number
        while link >= 0 and pendulum + 1 < len(tips):
            pendulum += 1
            if link <= tips[pendulum]:
                break
            link -= tips[pendulum] + 1
        return SignalPlace(PAIRS[driven.kind], 0, pendulum, link)
    return place_of(GIVEN, driven.name, tips)
