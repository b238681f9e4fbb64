"""What the commands that move a cart take: the limits of its travel."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from multipendula.command import refuse

if TYPE_CHECKING:
    from modal.statespace.hoisting import TravelLimits

LIMITS = (
    "--max-acceleration: the travel takes the shortest time",
    "--max-speed, beside --max-acceleration: the speed is a trapezoid",
    "--max-jerk, beside --max-acceleration: the speed is an S-curve",
)
"""The options that limit a travel."""


def limits_of(options: argparse.Namespace) -> TravelLimits | None:
    """The limits within which the cart travels, None where there are none; SceneError for options that do not fit."""
    from math import inf

    from modal.statespace.hoisting import TravelLimits

    limits = "--max-speed", "--max-acceleration", "--max-jerk"
    if options.travel is None:
        refuse(options, "needs --travel METRES", "--over", *limits)
    if isinstance(options.travel, str):
        refuse(options, f"cannot be combined with --travel {options.travel}, a travel over time", "--over", *limits)
    if options.max_acceleration is None:
        refuse(options, "needs --max-acceleration", "--max-speed", "--max-jerk")
        return None
    refuse(options, "cannot be combined with --max-acceleration, at which a travel takes the shortest time", "--over")
    step = getattr(options, "discrete", None) or 0.0
    return TravelLimits(options.max_acceleration, options.max_speed or inf, options.max_jerk or inf, step)
