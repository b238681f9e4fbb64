"""The second order of supports: modes that leave a structure still to first order shake it at twice their frequency.

A pivot that a coordinate η moves down by Ψ η gives the Lagrangian −η' Ψᵀ σb θθ', so that q = a φ cos ωt pushes η with
a² f cos 2ωt, f = −ω² Σ Ψ σ b φ². With D(2ω) = K + 2iωD − 4ω²M of the whole scene the averaged Lagrangian changes by
a⁴ fᵀ D(2ω)⁻¹ f/4, and κ by

    κ₂(ω) = −fᵀ D(2ω)⁻¹ f/(φᵀMφ ω²).

Near 2:1 this depends on the frequency itself, ω(a)²/ω² − 1 = 2a² (κ₀ + κ₂(ω(a))), κ₀ that of a support held still.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import degrees, sqrt
from typing import NamedTuple

import numpy as np

from modal.assembly import Hanging, Rig, scene_squares
from modal.modes.shapes import Shape
from modal.types import Floats

ONE_PERCENT = 0.01
MOST_COORDINATES = 1200
"""Of a dense matrix that is solved once a mode, as in `modal.eigen.structured`."""


class Amplitude(NamedTuple):
    """κ (1/rad²), and the largest angle (deg) at which ω is 1 % off; both NaN where they are unknown."""

    kappa: float
    one_percent_deg: float


UNKNOWN = Amplitude(np.nan, np.nan)


@dataclass(frozen=True, eq=False)
class SupportResponse:
    """The response of the structure of a rig to modes that leave it still to first order."""

    hanging: Hanging
    M: Floats
    K: Floats
    D: Floats

    @classmethod
    def of(cls, rig: Rig) -> SupportResponse:
        """That of a rig in SI units."""
        return cls(Hanging(rig), *scene_squares(rig).matrices)

    def pushes(self, shape: Shape) -> Floats:
        """Σ Ψ σ b φ² (d,) of a shape over all links, 0 where only rounding is left."""
        hanging, squares = self.hanging, np.real(shape.angles) ** 2
        moments = np.concatenate([self._moments(*kind) for kind in hanging.kinds.tolist()])
        each = hanging.phi.down * np.add.reduceat(moments * squares, hanging.first[:-1])[:, None]
        pushes, terms = each.sum(0), np.abs(each).sum(0)
        return np.where(np.abs(pushes) <= len(each) * 2.0**-48 * terms, 0.0, pushes)

    def _moments(self, number: int, column: int) -> Floats:
        block = self.hanging.rig.blocks[number]
        return np.asarray(block.sigma[:, column] * block.b[:, column])

    def amplitude(self, shape: Shape, omega: float, held: float) -> Amplitude:
        """Those of a shape with a largest angle of 1 that pushes the structure; κ is `held` on a support held still."""
        pushes = self.pushes(shape)

        def second(r: float) -> float:
            """κ₂ (1/rad²) at r ω."""
            driven = 2 * r * omega
            stiffness = self.K + 1j * driven * self.D - driven**2 * self.M
            force = np.zeros(len(stiffness))
            force[: len(pushes)] = -((r * omega) ** 2) * pushes
            return float(-(force @ np.linalg.solve(stiffness, force)).real) / (shape.modal_mass * omega**2)

        try:
            kappa = held + second(1.0)
            r = 1 + np.copysign(ONE_PERCENT, kappa)
            square = (r**2 - 1) / 2 / (held + second(r))
        except np.linalg.LinAlgError:
            return UNKNOWN
        return Amplitude(kappa, degrees(sqrt(square)) if 0 < square < np.inf else np.nan)
