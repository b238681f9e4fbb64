"""Sources of modes: each holds modes of one structure and describes any of its rows.

    Alone pendula on a support at rest in these modes: a fixed one, across the rail, or because equal pendula in
    antiphase leave the cart at rest StillPendula combinations of equal pendula that leave a structure still

`modal.eigen.coupled` is for plain chains on one cart, `modal.eigen.structured` for all else. All are in natural units.
Each reports the sizes of the problems that it solved.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from math import log2
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from modal.assembly import Block
from modal.eigen.amplitude import coefficient, quartic
from modal.eigen.chains import ChainShapes, fixed_shapes, fixed_squares
from modal.eigen.components import PartedRig, StillGroup
from modal.eigen.seeds import seed_matrices
from modal.eigen.squares import EVERYTHING, Limits, Squares
from modal.types import EPS, Complexes, Floats, Ints

MOST_COORDINATES = 1200
"""Limit: coordinates of a structure up to which shapes are computed, refused beyond as `dense.refuse_beyond` says."""
UNCERTAIN = 0.1
"""Tolerance: relative error from which on no digit is certain: bounds are of first order, and larger ones none."""


@dataclass(frozen=True, eq=False)
class Details:
    """Properties of R modes φ for a table; NaN where undefined.  All (R,) except the last two.

    `momentum` is φᵀMe for the unit translation e along the rail, `participation` the mode's share in the cart's
    response to a sudden push.  `angles` and `shares` are, for every block of kinds (n, P), the angles and kinetic
    energy shares (n, P, R) of one copy; `eta` has the displacement (R,) of a cart or of every coordinate of a
    structure, nothing of pendula alone.
    """

    modal_mass: Floats
    momentum: Floats
    participation: Floats
    kappa: Floats
    residual: Floats
    angles: tuple[NDArray[np.inexact], ...]
    shares: tuple[Floats, ...]
    eta: tuple[NDArray[np.inexact], ...] = ()

    @property
    def cart(self) -> NDArray[np.inexact]:
        """The displacement of a cart, 0 without one, (R,)."""
        return self.eta[0] if self.eta else np.zeros(len(self.modal_mass))

    @property
    def effective_mass(self) -> Floats:
        """Modal effective mass (φᵀMe)²/(φᵀMφ) along the rail."""
        return self.momentum**2 / self.modal_mass


class Source(Protocol):
    """Modes of one structure: complex eigenvalues (iω when undamped) and relative error bounds, both (R,)."""

    @property
    def route(self) -> str:
        """The route in words."""

    @property
    def eigenvalue(self) -> NDArray[np.complex128]:
        """Eigenvalues."""

    @property
    def error(self) -> Floats:
        """Relative error bounds."""

    @property
    def problem_size(self) -> ProblemSize:
        """The sizes of the problems solved."""

    @property
    def is_damped(self) -> bool:
        """Whether dampers other than those of a damping ratio act on these modes."""

    @property
    def is_singular(self) -> bool:
        """Whether M is known to be singular, by a massless cart over bobs."""

    def details(self, rows: Ints) -> Details:
        """Properties of these rows."""


def oscillating(squares: Floats) -> NDArray[np.complex128]:
    """iω, or the growth rate where ω² < 0."""
    return np.sqrt(np.abs(squares)) * np.where(squares < 0, 1.0, 1j)


def structured_error(links: int, chains: int) -> float:
    """Return a bound on the relative error of ω: each step of a count perturbs the scene's data by a few roundings."""
    return (12 + 6 * links + log2(chains + 1)) * EPS / 2


@dataclass(frozen=True, eq=False)
class Alone:
    """Every mode of the chains of one block on a support at rest: row r of column p is row r P + p."""

    block: Block
    limits: Limits = EVERYTHING
    is_damped = is_singular = False

    @property
    def route(self) -> str:
        """Dense if that is accurate enough, else the effective mass."""
        return self.fixed_squares.route

    @property
    def problem_size(self) -> ProblemSize:
        """One problem for each chain."""
        n, chains = self.block.n, self.block.size
        return ProblemSize(f"chain of {noun_count(n, 'link')}, support still", chains, n, seed_matrices(n, chains))

    @cached_property
    def fixed_squares(self) -> Squares:
        """ω² (n, P), or of the lowest of the n modes."""
        return fixed_squares(self.block, self.limits)

    @property
    def squares(self) -> Floats:
        """ω² without their errors."""
        return self.fixed_squares.x

    @cached_property
    def eigenvalue(self) -> NDArray[np.complex128]:
        """iω."""
        return oscillating(self.squares.ravel())

    @property
    def error(self) -> Floats:
        """Relative error bounds."""
        return self.fixed_squares.error.ravel() / 2 + structured_error(self.block.n, 1)

    def details(self, rows: Ints) -> Details:
        """One copy's shape and momentum."""
        several, x = self.block.size > 1, self.squares.ravel()[rows]
        chains = self.block.take(rows % self.block.size) if several else self.block
        motion = fixed_shapes(chains, x)
        angle = motion.turns[0] / chains.length[:, None, :]
        square, turn = (x[:, None], angle.swapaxes(1, 2)) if several else (x, angle)
        gamma = quartic(chains, square, np.zeros(1), turn).ravel()
        return chain_details(motion, x, (angle,), gamma, motion.energies, np.inf)


@dataclass(frozen=True, eq=False)
class StillPendula:
    """Combinations of equal pendula in different columns that leave the structure at rest: row i K + k of mode i."""

    parted_rig: PartedRig
    still_group: StillGroup
    source: Source
    rows: Ints
    is_singular = False

    @property
    def route(self) -> str:
        """The route of one of the pendula."""
        return self.source.route

    @property
    def problem_size(self) -> ProblemSize:
        """None: the modes of one pendulum are known already."""
        return ProblemSize("equal pendula that leave the structure still", 1, 0)

    @cached_property
    def eigenvalue(self) -> Complexes:
        """The eigenvalues of one pendulum on a fixed support, for each combination."""
        return np.repeat(self.source.eigenvalue[self.rows], self.still_group.number)

    @property
    def error(self) -> Floats:
        """Relative error bounds."""
        return np.repeat(self.source.error[self.rows], self.still_group.number)

    @property
    def is_damped(self) -> bool:
        """Whether the modes are complex."""
        return self.source.is_damped

    def details(self, rows: Ints) -> Details:
        """The angles of the pendulum, by the amplitudes of the combination."""
        group, blocks = self.still_group, self.parted_rig.rig.blocks
        pendulum_details = self.source.details(self.rows[rows // group.number])
        amplitude = group.vectors(rows % group.number) / np.sqrt(group.counts)
        angles, shares = (
            tuple(np.zeros((*b.mass.shape, len(rows)), part.dtype) for b in blocks)
            for part in (pendulum_details.angles[0], pendulum_details.shares[0])
        )
        angles[group.block][:, group.columns] = pendulum_details.angles[0][:, 0][:, None] * amplitude.T
        shares[group.block][:, group.columns] = pendulum_details.shares[0][:, 0][:, None] * amplitude.T**2
        pushes = np.where(rows % group.number < group.pushes, amplitude @ group.counts, 0.0)
        return replace(
            pendulum_details,
            momentum=pendulum_details.momentum * pushes,
            angles=angles,
            shares=shares,
            kappa=np.full(len(rows), np.nan),
            eta=tuple(np.zeros((self.parted_rig.size, len(rows)))),
        )


def chain_details(
    motion: ChainShapes,
    x: Floats,
    angles: tuple[Floats, ...],
    gamma: Floats,
    energies: tuple[Floats, ...],
    accelerance: float,
) -> Details:
    """Properties of plain chains at x (R,), whose support gets the acceleration `accelerance` from a unit force."""
    return Details(
        modal_mass=motion.modal_mass,
        momentum=motion.momentum,
        participation=motion.cart**2 / motion.modal_mass / accelerance,
        kappa=np.where(x > 0, coefficient(gamma, motion.modal_mass, x, largest_angle(angles)), np.nan),
        residual=motion.residual,
        angles=angles,
        shares=tuple(part / motion.modal_mass for part in energies),
        eta=(motion.cart,) if accelerance < np.inf else (),
    )


def largest_angle(angles: tuple[NDArray[np.inexact], ...]) -> Floats:
    """Max |θ| (R,) over all links."""
    largest: Floats = np.max([np.abs(angle).max((0, 1)) for angle in angles], axis=0)
    return largest


class ProblemSize(NamedTuple):
    """A number of `problems` of one form, each with `unknowns`; square `matrices` as (name, order, count).

    `is_complex` says whether eigenvalues were sought in the complex plane.
    """

    what: str
    problems: int
    unknowns: int
    matrices: tuple[tuple[str, int, int], ...] = ()
    is_complex: bool = False


def noun_count(number: int, noun: str, several: str = "") -> str:
    """Return a number with its noun: 1 link, 3 links."""
    return f"{number} {noun if number == 1 else several or noun + 's'}"
