"""One basis vector of a mode, written out over every pendulum of the scene."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any, Literal, TypeVar, get_args

import numpy as np
from numpy.typing import NDArray

from modal.assembly import Hanging, Rig, Units
from modal.eigen import Details, SpectrumPart
from modal.errors import ComputationError
from modal.report import Displayed, Summary, brief, counted
from modal.structure import coordinate_units
from modal.types import Floats

A = TypeVar("A", bound=np.inexact)
Normalisation = Literal["angle", "mass"]
NONE: NDArray[np.inexact] = np.zeros(0)
NONE.flags.writeable = False


@dataclass(frozen=True, eq=False, repr=False)
class Shape(Displayed):
    """One basis vector φ of a mode: a mode shape over every copy of every pendulum, top link first.

    `cart` is the cart's displacement (m) and `angles` (n_links,) every link's angle from the vertical (rad), or both
    per √kg m where φᵀMφ = 1; complex for damped modes.  `kinetic_energy_share` (n_links,) is each link's part of the
    kinetic energy, `modal_mass` φᵀMφ (kg m²), `participation_factor` φᵀMe/φᵀMφ (1/m) for the unit translation e of
    everything along the rail, or across it if `across` says so (scenes in space); their product Γ²φᵀMφ is the modal
    effective mass (Clough & Penzien, Dynamics of Structures, §26-4). NaN for damped modes. `supports` (d,) are the
    displacements of a structure's coordinates, with a unit each, as named by `Matrices.labels`. `uncertain` says that
    no digit of the mode's frequency is certain; the shape may then contain any other mode.

    >>> from modal import Bob, Pendulum, Scene, natural_modes
    >>> scene = Scene(gravity=9.0, pendulum=[Pendulum(links=[Bob(mass=1.0, length=1.0, count=2)])])
    >>> shape = natural_modes(scene).shape(0)
    >>> [round(float(angle), 6) for angle in shape.angles]  # 1 : √2, the lower angle being the larger
    [0.707107, 1.0]
    """

    cart: complex
    angles: NDArray[np.inexact]
    kinetic_energy_share: Floats
    modal_mass: float
    participation_factor: float
    across: bool
    uncertain: bool
    supports: NDArray[np.inexact] = field(default_factory=lambda: NONE)

    @property
    def direction(self) -> str:
        """The direction of the motion."""
        return "across the rail" if self.across else "along the rail"

    @property
    def leading(self) -> NDArray[np.inexact]:
        """The displacements of the support: a structure's coordinates, or those of a cart."""
        return self.supports if self.supports.size else np.array([self.cart])

    def at(self, turn: complex = 1.0) -> Shape:
        """Return the real part of this shape times a factor: the motion at one instant."""
        cart = complex(self.cart * turn).real
        return replace(self, cart=cart, angles=(self.angles * turn).real, supports=(self.supports * turn).real)

    def to_dict(self) -> dict[str, NDArray[Any]]:
        """Columns with a row for each link (n_links,): its number from 1, its angle (rad), its share of kinetic energy.

        Where φᵀMφ = 1 the angles are those at a modal coordinate of 1 √kg m.

        >>> from modal import load, natural_modes
        >>> {key: value.round(3).tolist() for key, value in natural_modes(load("chain-2")).shape(0).to_dict().items()}
        {'link': [1, 2], 'angle_rad': [0.707, 1.0], 'kinetic_energy_share': [0.146, 0.854]}
        """
        links = np.arange(1, len(self.angles) + 1)
        return {"link": links, "angle_rad": self.angles, "kinetic_energy_share": self.kinetic_energy_share}

    def _summary(self) -> Summary:
        facts = [
            ("cart (m)", brief(self.cart)),
            ("modal mass (kg m²)", brief(self.modal_mass)),
            ("participation factor (1/m)", brief(self.participation_factor)),
        ]
        rows = (
            (str(link), brief(angle), brief(share))
            for link, (angle, share) in enumerate(zip(self.angles, self.kinetic_energy_share, strict=True), start=1)
        )
        title = f"Shape of {counted(len(self.angles), 'link', 'links')} {self.direction}"
        title += ", complex" if np.iscomplexobj(self.angles) else ""
        title += "; no digit of its frequency is certain" if self.uncertain else ""
        headings = ("link", "angle (rad)", "kinetic energy share")
        return Summary(title, facts, headings, rows, len(self.angles))


def validate_normalisation(name: str) -> Normalisation:
    """Return the name itself; raise ValueError for any other."""
    if name not in get_args(Normalisation):
        raise ValueError(f'normalise = {name!r}: must be "angle" or "mass"')
    return name  # type: ignore[return-value]


def expand(
    rig: Rig,
    units: Units,
    part: SpectrumPart,
    copy: int,
    details: Details,
    normalise: Normalisation,
    *,
    uncertain: bool,
) -> Shape:
    """The copy-th vector of a part, with `details` of its one row.

    The first of the largest angles becomes real and positive. A rigid translation has no angles: there the largest
    coordinate, such as that of a cart, is 1 in its unit.
    """
    is_single = copy >= part.along_count or not is_balanced(rig, part)
    if part.kind:
        eta = np.zeros(rig.leading)
        angles, shares = _of_copies(rig, part.kind, _weights(rig, part, part.kind, copy), details)
    else:
        eta = np.array([row[0] for row in displacements(rig, details)])
        angles, shares = _of_all(rig, details)
    if not np.all(np.isfinite(angles)):
        raise ComputationError("a mode shape of this scene is beyond double precision")
    eta = eta * np.array(coordinate_units(rig.support, units.length))
    leading = first_of_largest(angles) if angles.any() else eta[np.abs(eta).argmax()]
    moment = details.modal_mass[0] * units.mass * units.length**2
    length = abs(leading) if normalise == "angle" else np.sqrt(details.modal_mass[0] * units.mass) * units.length
    scale = np.conj(leading) / abs(leading) / length
    scale = scale if np.iscomplexobj(angles) else scale.real
    momentum = details.momentum[0] if is_single or not part.kind or np.isnan(details.momentum[0]) else 0.0
    modal_mass = moment * abs(scale) ** 2
    factor = momentum * scale.real * units.mass * units.length / modal_mass if np.isfinite(momentum) else np.nan
    return Shape(
        cart=eta[0] * scale if rig.cart else 0.0 * scale * units.length,
        angles=angles * scale,
        kinetic_energy_share=shares,
        modal_mass=float(modal_mass),
        participation_factor=float(factor),
        across=copy >= part.along_count,
        uncertain=uncertain,
        supports=NONE if rig.cart else eta * scale,
    )


def displacements(rig: Rig, details: Details) -> tuple[NDArray[np.inexact], ...]:
    """Return the motion of each support coordinate in all rows, d arrays (R,); 0 in modes of single pendula."""
    return details.eta or (np.zeros(len(details.modal_mass)),) * rig.leading


def by_kind(hanging: Hanging, values: NDArray[A]) -> tuple[NDArray[A], ...]:
    """Values (pendula, …), the same for all of a kind, by the kinds (P, …) of every block."""
    kinds = tuple(np.zeros((block.size, *values.shape[1:]), values.dtype) for block in hanging.rig.blocks)
    for (block, column), value in zip(hanging.kinds.tolist(), values, strict=True):
        kinds[block][column] = value
    return kinds


def is_balanced(rig: Rig, part: SpectrumPart) -> bool:
    """Whether a part consists of equal pendula that together leave their support at rest."""
    if part.kind is None:
        return part.is_still
    block, column = part.kind
    return bool(rig.blocks[block].count[column] > part.along_count)


def _of_all(rig: Rig, details: Details) -> tuple[NDArray[np.inexact], Floats]:
    """The angles and shares of energy of all links."""
    kinds = [(block, column) for block, column, copies in rig.members for _ in range(copies)]
    angles, shares = (
        np.concatenate([values[block][:, column, 0] for block, column in kinds])
        for values in (details.angles, details.shares)
    )
    return angles, shares.real


def _of_copies(
    rig: Rig, kind: tuple[int, int], weights: Floats, details: Details
) -> tuple[NDArray[np.inexact], Floats]:
    """The same where the copies of one kind move alone, by these weights."""
    copy_shape, share = details.angles[0][:, 0, 0], details.shares[0][:, 0, 0]
    angles, shares, used = [], [], 0
    for block, column, count in rig.members:
        amplitudes = np.zeros(count)
        if (block, column) == kind:
            amplitudes = weights[used : used + count]
            used += count
        n = rig.blocks[block].n
        moves = amplitudes.any()
        angles.append(np.outer(amplitudes, copy_shape).ravel() if moves else np.zeros(count * n, copy_shape.dtype))
        shares.append(np.outer(amplitudes**2, share).ravel() if moves else np.zeros(count * n))
    return np.concatenate(angles), np.concatenate(shares)


def _weights(rig: Rig, part: SpectrumPart, kind: tuple[int, int], copy: int) -> Floats:
    """The amplitude of each copy of a kind, of Euclidean length 1: one of them alone, or in antiphase on a cart."""
    weights = np.zeros(sum(count for block, column, count in rig.members if (block, column) == kind))
    if copy >= part.along_count or not is_balanced(rig, part):
        weights[copy - part.along_count if copy >= part.along_count else copy] = 1.0
    else:
        weights[: copy + 1], weights[copy + 1] = 1.0, -(copy + 1.0)
        weights /= np.sqrt((copy + 1.0) * (copy + 2.0))
    return weights


def first_of_largest(angles: NDArray[np.inexact]) -> Any:
    """Return the first of the largest angles, which agree to 1e-9."""
    size = np.abs(angles)
    return angles[np.argmax(size >= size.max() * (1 - 1e-9))]
