"""One row of the table of modes."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi, sqrt

UNCERTAIN = 0.1


@dataclass(frozen=True)
class Mode:
    """One distinct natural frequency.

    `omega` (rad/s) is |λ| of the eigenvalue λ, `damping_ratio` −Re λ/|λ| (1: overdamped, below 0: unstable);
    `cart_participation` is this mode's share of the cart's response to a sudden push (undamped modes sum to 1);
    `effective_mass` (kg) that of the support's motion along the rail; `kappa` and `linear_to_1_percent_deg` are for
    the largest angle of the mode.  NaN stands where a quantity has no meaning (effective mass of a damped mode, κ above
    a damping ratio of 0.1).
    """

    number: int
    omega: float
    damping_ratio: float
    multiplicity: int
    family: str
    cart_participation: float
    effective_mass: float
    effective_mass_share: float
    effective_mass_across: float
    kappa: float
    linear_to_1_percent_deg: float
    resonances: tuple[str, ...]
    residual: float
    relative_error_bound: float
    indistinct: bool

    @property
    def is_uncertain(self) -> bool:
        """Whether no digit of `omega` is certain: the scene is beyond double precision on its route."""
        return self.relative_error_bound >= UNCERTAIN

    @property
    def frequency(self) -> float:
        """Hz."""
        return self.omega / (2 * pi)

    @property
    def period(self) -> float | None:
        """Seconds, 2π/|Im λ|; None for ω = 0 and for a mode that does not oscillate."""
        ratio = self.damping_ratio
        return 2 * pi / (self.omega * sqrt((1 - ratio) * (1 + ratio))) if self.omega > 0 and abs(ratio) < 1 else None
