"""Free motions of pendula on structures, as the rigid translation of a cart without a spring; in natural units."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from modal.eigen.component_matrices import ComponentMatrices, Numbers, StructureShapes
from modal.eigen.sources import Built, Details
from modal.types import Booleans, Complexes, Floats, Ints

EPS = float(np.finfo(float).eps)


class CartModes(Protocol):
    """The source of the modes that move with the structure."""

    @property
    def accelerance(self) -> float:
        """Σ φ_x² over all finite modes of a cart (1/kg)."""


def details_of(
    moved: StructureShapes, modal_mass: Floats, momentum: Floats, residual: Floats, energies: tuple[Floats, ...]
) -> Details:
    """The properties that any mode has: no κ, and no share of a cart's."""
    unknown = np.full(len(modal_mass), np.nan)
    return Details(
        modal_mass=modal_mass,
        momentum=momentum,
        cart=np.zeros(len(modal_mass)),
        participation=unknown,
        kappa=unknown,
        residual=residual,
        angles=moved.angles,
        shares=tuple(part / modal_mass for part in energies),
        eta=tuple(moved.eta),
    )


@dataclass(frozen=True, eq=False)
class FreeMotions:
    """The motions of one component that nothing holds, ω = 0; where a damper drags it no dynamics are left of them."""

    reduced: ComponentMatrices
    moving: CartModes
    route = "exact"
    is_damped = is_singular = False

    @property
    def built(self) -> Built:
        """One problem that is not solved."""
        if self.reduced.carried.is_plain:
            return Built("free cart with everything at rest on it", 1, 0)
        return Built("free motion of the structure with everything at rest on it", self._number, 0)

    @property
    def _number(self) -> int:
        return int(self.reduced.free.shape[1])

    @property
    def dragged(self) -> Booleans:
        """Which of them a damper drags, (f,)."""
        return np.asarray(np.arange(self._number) >= self.reduced.coasting.shape[1])

    @property
    def eigenvalue(self) -> Complexes:
        """0."""
        return np.zeros(self._number, dtype=complex)

    @property
    def error(self) -> Floats:
        """They are exact."""
        return np.zeros(self._number)

    def details(self, rows: Ints) -> Details:
        """The structure alone is displaced, every angle is zero."""
        carried, at = self.reduced.carried, self.reduced.component.eta
        eta, unit = np.zeros((carried.size, len(rows))), np.ones(len(rows))
        eta[at] = self.reduced.free[: len(at), rows]
        moved = StructureShapes(carried, eta, tuple(np.zeros((*b.mass.shape, len(rows))) for b in carried.rig.blocks))
        momentum = cancelled(carried.momenta[at], eta[at])
        if not carried.is_plain:
            momentum = momentum + (np.nan if self.reduced.is_damped else 0.0)
            return details_of(moved, unit, momentum, 0 * unit, moved.energies)
        dragged, cart = self.dragged[rows], eta[0]
        return replace(
            details_of(moved, unit, np.where(dragged, np.nan, momentum), 0 * unit, moved.energies),
            cart=cart,
            participation=np.where(dragged, 0.0, cart**2 / self.moving.accelerance),
            kappa=0 * unit,
            eta=(),
        )


def cancelled(row: Floats, shape: Numbers) -> Floats:
    """A row times shapes (n, R), 0 where no more than rounding is left of its terms."""
    products: Floats = row @ shape
    return np.where(np.abs(products) <= 4 * len(row) * EPS * (np.abs(row) @ np.abs(shape)), 0.0, products)
