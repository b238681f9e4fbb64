"""Free motions of pendula on structures, such as the rigid translation of a free cart; in natural units."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from modal.eigen.component_matrices import ComponentMatrices, Numbers, StructureShapes
from modal.eigen.sources import Details, ProblemSize
from modal.types import EPS, Booleans, Complexes, Floats, Ints


def details_of(
    shapes: StructureShapes, modal_mass: Floats, momentum: Floats, residual: Floats, energies: tuple[Floats, ...]
) -> Details:
    """The properties that any mode has: no κ, and no share of a cart's."""
    unknown = np.full(len(modal_mass), np.nan)
    return Details(
        modal_mass=modal_mass,
        momentum=momentum,
        participation=unknown,
        kappa=unknown,
        residual=residual,
        angles=shapes.angles,
        shares=tuple(part / modal_mass for part in energies),
        eta=tuple(shapes.eta),
    )


@dataclass(frozen=True, eq=False)
class FreeMotions:
    """The unrestrained motions of one component, ω = 0; with dampers they are omitted as oscillations."""

    matrices: ComponentMatrices
    moving: Any
    route = "exact"
    is_damped = is_singular = False

    @property
    def problem_size(self) -> ProblemSize:
        """One problem, which is not solved."""
        if self.matrices.parted_rig.is_plain:
            return ProblemSize("free cart with everything at rest on it", 1, 0)
        return ProblemSize("free motion of the structure with everything at rest on it", self._number, 0)

    @property
    def _number(self) -> int:
        return int(self.matrices.free.shape[1])

    @property
    def has_drag(self) -> Booleans:
        """Which of them are damped, (f,)."""
        return np.asarray(np.arange(self._number) >= self.matrices.coasting.shape[1])

    @property
    def eigenvalue(self) -> Complexes:
        """0."""
        return np.zeros(self._number, dtype=complex)

    @property
    def error(self) -> Floats:
        """Zero: they are exact."""
        return np.zeros(self._number)

    def details(self, rows: Ints) -> Details:
        """Return details in which only the structure is displaced and every angle is zero."""
        parted_rig, at = self.matrices.parted_rig, self.matrices.component.eta
        eta, unit = np.zeros((parted_rig.size, len(rows))), np.ones(len(rows))
        eta[at] = self.matrices.free[: len(at), rows]
        shapes = StructureShapes(
            parted_rig, eta, tuple(np.zeros((*b.mass.shape, len(rows))) for b in parted_rig.rig.blocks)
        )
        momentum = significant_product(parted_rig.momenta[at], eta[at])
        if not parted_rig.is_plain:
            momentum = momentum + (np.nan if self.matrices.is_damped else 0.0)
            return details_of(shapes, unit, momentum, 0 * unit, shapes.energies)
        has_drag = self.has_drag[rows]
        details = details_of(shapes, unit, np.where(has_drag, np.nan, momentum), 0 * unit, shapes.energies)
        participation = np.where(has_drag, 0.0, eta[0] ** 2 / self.moving.accelerance)
        return replace(details, participation=participation, kappa=0 * unit)


def significant_product(row: Floats, shape: Numbers) -> Floats:
    """Return a row times shapes (n, R), 0 if its terms cancel to rounding."""
    products: Floats = row @ shape
    return np.where(np.abs(products) <= 4 * len(row) * EPS * (np.abs(row) @ np.abs(shape)), 0.0, products)
