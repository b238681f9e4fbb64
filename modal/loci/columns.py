"""The columns of what is followed along one number: the same for loci, orbits and steady oscillations."""

from __future__ import annotations

from typing import Any

from modal.scene.parameters import Variation


def followed_columns(
    variation: Variation | None,
    value: float,
    omega: float,
    *,
    stable: bool,
    angle_deg: float,
    growth: float | None = None,
) -> dict[str, Any]:
    """The varied number under its place and unit, then frequency, stability (1 or 0), largest angle and growth rate.

    Without a variation there is no number; without a growth rate (1/s) no column for it.

    >>> from modal.scene.parameters import parse_variations
    >>> (axis,) = parse_variations(["support.mass=1:2:2"])
    >>> list(followed_columns(axis, 1.0, 3.0, stable=True, angle_deg=5.0))
    ['support.mass_kg', 'omega_rad_per_s', 'stable', 'largest_angle_deg']
    """
    along = {} if variation is None else {variation.column: value}
    columns = {**along, "omega_rad_per_s": omega, "stable": int(stable), "largest_angle_deg": angle_deg}
    return columns if growth is None else {**columns, "growth_per_s": growth}
