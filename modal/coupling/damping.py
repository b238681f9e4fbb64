"""Damping and excitation of each mode by dampers and drives, and which modes survive.

To first order in the dampers a mode φ of the conservative scene, φᵀMφ = E, decays as exp(−σt) with

    σ = φᵀDφ/2E = ηᵀD_s η/2E + Σ d_i (θ_i − θ_{i−1})²/2E + Σ drag_k (h_kᵀφ)²/2E

with D_s of the supports, c_c of a cart, the angle θ − Ωη of a first joint and the displacement h_kᵀφ of a
link's centre (Rayleigh, Theory of Sound, §102); modes of equal frequency are rotated until D is diagonal among them.
A drive that applies the torque e θ_1' to every pendulum's top link contributes a growth rate e F, F = Σ θ_1²/2E: in the
linear scene a mode grows once e exceeds σ/F. The van der Pol torques of the scene itself contribute
Σ e_i (θ_i − θ_{i−1})²/2E at equilibrium. σ is listed with the eigenvalue −ζω ± iω√(1 − ζ²) of the damped scene itself.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import groupby, pairwise
from math import inf
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from modal.assembly import Hanging, Rig, centres, modal_supports, ratio_at
from modal.coupling.reduced import Kind, without_damping
from modal.eigen import ModalSpectrum, SpectrumPart, find_spectrum
from modal.errors import ComputationError
from modal.modes.shapes import by_kind, displacements
from modal.report import Displayed
from modal.scene import Pendulum, Scene, VanDerPol, validate_scene
from modal.types import NUMBERS_IN_CHUNK, Floats

STILL_SHARE_MAX = 1e-20
"""Tolerance: share of a mode's kinetic energy in a structure that is said to stand still: 1e-10 of its motion."""


@dataclass(frozen=True, repr=False)
class Damped(Displayed):
    """Modes of frequency `omega` (rad/s), `fold` of them, in the conservative scene; `still` if the cart is at rest.

    `kind` is the pendula's name if only these move. Rates in 1/s: `from_cart`, or from the dampers of a structure and
    its springs, `from_joints`, `from_drag` and `from_ratio` (ζω of the scene's damping ratio) add up to σ,
    `from_drives` is the growth rate by the scene's own drives. `excitation` is F in 1/(kg m²), `exact` the damped
    eigenvalue (rad/s), None if it is not available.
    """

    omega: float
    fold: int
    still: bool
    kind: str | None
    from_cart: float
    from_joints: float
    from_drives: float
    excitation: float
    exact: complex | None
    from_drag: float = 0.0
    from_ratio: float = 0.0

    @property
    def rate(self) -> float:
        """σ (1/s) to first order."""
        return self.from_cart + self.from_joints + self.from_drag + self.from_ratio

    @property
    def decay(self) -> float:
        """The decay rate (1/s) of the damped scene itself, −Re λ, or σ if that is not available."""
        return self.rate if self.exact is None else -self.exact.real + 0.0

    @property
    def ratio(self) -> float:
        """Damping ratio σ/ω to first order."""
        return self.rate / self.omega

    @property
    def threshold(self) -> float:
        """The drive e (N m s/rad) above which the mode grows, σ/F; infinite if the drive does not excite it."""
        return self.rate / self.excitation if self.excitation else inf


def damped_modes(
    rig: Rig,
    strengths: tuple[Floats, ...],
    undamped_spectrum: ModalSpectrum | None = None,
    damped_spectrum: ModalSpectrum | None = None,
) -> tuple[Damped, ...]:
    """Return all modes of a rig in SI units that oscillate along the rail, ascending; all links must hang.

    `strengths` are those of `negative_damping`; its spectra without dampers and with them may be known already.
    """
    natural, units = replace(rig, spatial=False).natural()
    names, moment = rig.names, units.mass * units.length**2
    driven = tuple(strength / (moment * units.rate) for strength in strengths)
    with np.errstate(all="ignore"):
        modes = _modes(_Losses(natural, driven), undamped_spectrum or find_spectrum(without_damping(natural)))
        values = _exact(natural, modes, damped_spectrum)
    rates = ("omega", "from_cart", "from_joints", "from_drives", "from_drag", "from_ratio")
    return tuple(
        replace(
            mode,
            kind=names[kind] if kind else None,
            excitation=mode.excitation / moment,
            exact=None if value is None else complex(value * units.rate),
            **{rate: getattr(mode, rate) * units.rate for rate in rates},
        )
        for (kind, mode), value in zip(modes, values, strict=True)
    )


def negative_damping(scene: Scene, rig: Rig) -> tuple[Floats, ...]:
    """Strengths e (N m s/rad) of one copy, (n, P) of each block; for equal pendula with unequal drives, their mean."""
    validate_scene(scene)
    strengths = tuple(np.zeros_like(block.damping) for block in rig.blocks)
    entries, remainder = iter(scene.pendulum), 0
    for block, column, copies in rig.members:  # several of one entry, where springs tell its copies apart
        if not remainder:
            pendulum = next(entries)
            remainder = pendulum.count
        remainder -= copies
        strengths[block][:, column] += np.array(_strengths(pendulum)) * copies / rig.blocks[block].count[column]
    return strengths


def _strengths(pendulum: Pendulum) -> list[float]:
    drives = (link.drive for link in pendulum.chain)
    return [drive.strength if isinstance(drive, VanDerPol) else 0.0 for drive in drives]


class _Shapes(NamedTuple):
    """Some rows of a source: η and φᵀMφ (d,), angles (n, P, d) of each block."""

    eta: Floats
    modal_mass: Floats
    angles: tuple[Floats, ...]


def _modes(losses: _Losses, spectrum: ModalSpectrum) -> list[tuple[Kind | None, Damped]]:
    """Every oscillating mode, ascending, and the kind of pendula where only these move."""
    swinging = [number for number, value in enumerate(spectrum.eigenvalue) if value]
    parts = [(number, part) for number in swinging for part in spectrum.groups[number]]
    parts.sort(key=lambda entry: (entry[1].source, entry[1].row))
    modes, omega = [], np.abs(spectrum.eigenvalue)
    ratio = ratio_at(losses.rig)(omega)
    for source, members in groupby(parts, key=lambda entry: entry[1].source):
        members_and_parts = list(members)
        shapes = _shapes(losses.rig, spectrum, source, [part for _, part in members_and_parts])
        for (number, part), part_shapes in zip(members_and_parts, shapes, strict=True):
            equal = losses.modes(part, float(omega[number]), float(ratio[number]), part_shapes)
            modes.append((number, part.kind, equal))
    ascending = sorted(modes, key=lambda entry: entry[0])
    return [(kind, mode) for _, kind, equal in ascending for mode in equal]


def _shapes(rig: Rig, spectrum: ModalSpectrum, source: int, parts: list[SpectrumPart]) -> Iterator[_Shapes]:
    """The rows of each of the parts of one source, computed a bounded amount of memory at a time.

    Of equal pendula in antiphase all swing alike, all else at rest: their rates are those of one.
    """
    size = max(1, NUMBERS_IN_CHUNK // sum(block.mass.size for block in rig.blocks))
    for start in range(0, len(parts), size):
        chosen = parts[start : start + size]
        rows = [list(range(part.row, part.row + (1 if part.kind else part.along_count))) for part in chosen]
        details = spectrum.details(source, [row for part_rows in rows for row in part_rows])
        ends = np.cumsum([len(part_rows) for part_rows in rows]).tolist()
        eta = np.array(displacements(rig, details)).reshape(rig.leading, ends[-1]).real
        for part, (first, last) in zip(chosen, pairwise([0, *ends]), strict=True):
            mass = details.modal_mass[first:last]
            angles = tuple(angle[..., first:last].real for angle in details.angles)
            if part.kind:
                block, column = part.kind
                single_angles, mass = angles[0][:, 0], mass * rig.blocks[block].count[column]
                angles = tuple(np.zeros((*block.mass.shape, 1)) for block in rig.blocks)
                angles[block][:, column] = single_angles
            yield _Shapes(eta[:, first:last] * (not part.kind), mass, angles)


@dataclass(frozen=True, eq=False)
class _Losses:
    """Losses and drives of the modes of a rig in natural units, `driven` the strengths of drives (n, P) of blocks."""

    rig: Rig
    driven: tuple[Floats, ...]

    @cached_property
    def hanging(self) -> Hanging:
        """The supports of the pendula as a structure."""
        return Hanging(self.rig)

    @cached_property
    def carrier(self) -> tuple[Floats, Floats]:
        """M and D (d, d) of all that carries pendula, these as if they were stiff; D of modal supports alone."""
        return self.hanging.inertia, modal_supports(self.hanging.structure)[2]

    @cached_property
    def pivots(self) -> tuple[tuple[Floats, Floats], ...]:
        """Of every block, how its kinds move along the rail and turn, (P, d) each."""
        sway, turning = (by_kind(self.hanging, rows) for rows in (self.hanging.phi.rail, self.hanging.phi.turning))
        return tuple(zip(sway, turning, strict=True))

    @cached_property
    def joints(self) -> tuple[Floats, Floats, Floats]:
        """Dampers and drives (J,) of all joints of blocks, and 1 for top joints, times the copies."""
        blocks = self.rig.blocks
        tops = [np.arange(block.n)[:, None] == np.zeros(block.size) for block in blocks]
        terms = [block.damping for block in blocks], self.driven, tops
        damping, drive, top = (
            np.concatenate([(part * block.count).ravel() for part, block in zip(parts, blocks, strict=True)])
            for parts in terms
        )
        return damping, drive, top

    @cached_property
    def kinds_with_drag(self) -> list[Kind]:
        """The kinds of pendula with drag."""
        return [kind for kind in self.rig.names if self.rig.blocks[kind[0]].drag[:, kind[1]].any()]

    def modes(self, part: SpectrumPart, omega: float, ratio: float, shapes: _Shapes) -> list[Damped]:
        """φᵀDφ/2E by its sources, φᵀeφ/2E and φᵀFφ/2E, in the vectors that make D diagonal."""
        scale = 1 / np.sqrt(2 * shapes.modal_mass)
        eta, angles = shapes.eta * scale, [angle * scale for angle in shapes.angles]
        turns = [np.diff(angle, axis=0, prepend=0.0) for angle in angles]
        for turn, (_, turning) in zip(turns, self.pivots, strict=True):
            turn[0] -= turning @ eta
        rows = np.concatenate([turn.reshape(-1, len(scale)) for turn in turns])
        damping, drive, top = ((rows.T * strength) @ rows for strength in self.joints)
        parts = self._carrier_losses(eta, angles), damping, drive, top, self._drag_losses(eta, angles)
        vectors = np.linalg.eigh(parts[0] + parts[1] + parts[-1])[1]
        losses = np.array([np.einsum("ik,ij,jk->k", vectors, matrix, vectors) for matrix in parts]).T
        share = 2 * np.einsum("ik,ij,jk->k", eta, self.carrier[0], eta)
        is_still = part.is_still or bool(np.all(share <= STILL_SHARE_MAX * bool(self.rig.structure)))
        fold = part.along_count if len(scale) == 1 else 1
        return [
            Damped(omega, fold, is_still, None, cart, joints, drives, excitation, None, drag, ratio * omega)
            for cart, joints, drives, excitation, drag in losses.tolist()
        ]

    def _carrier_losses(self, eta: Floats, angles: list[Floats]) -> Floats:
        """The losses of the supports, of springs between points, and of masses that move down, (R, R)."""
        losses = np.asarray(eta.T @ self.carrier[1] @ eta)
        for element in self.hanging.elements.damping:
            rates = np.zeros(eta.shape[1])
            for at, value in zip(element.at, element.row, strict=True):
                rates += value * (eta[at] if at < len(eta) else self._angle(at - len(eta), angles))
            losses += element.size * np.outer(rates, rates)
        return losses

    def _angle(self, link: int, angles: list[Floats]) -> Floats:
        pendulum = self.hanging.owner(link)
        block, column = self.hanging.kinds[pendulum]
        return np.asarray(angles[block][link - int(self.hanging.first[pendulum]), column])

    def _drag_losses(self, eta: Floats, angles: list[Floats]) -> Floats:
        """The losses by drag of links along the rail, (R, R)."""
        losses = np.zeros((eta.shape[1],) * 2)
        for number, column in self.kinds_with_drag:
            block = self.rig.blocks[number]
            sway = self.pivots[number][0][column] @ eta + centres(block, column) @ angles[number][:, column]
            losses += (sway.T * block.drag[:, column] * block.count[column]) @ sway
        return losses


def _exact(rig: Rig, modes: list[tuple[Kind | None, Damped]], spectrum: ModalSpectrum | None) -> list[complex | None]:
    """The damped eigenvalue of every mode: of the same pendula's, the one that best satisfies λ² + 2σλ + ω² = 0."""
    if not (rig.is_damped or rig.damping_ratio):
        return [complex(0.0, mode.omega) for _, mode in modes]
    exact: list[complex | None] = [None] * len(modes)
    try:
        spectrum = spectrum or find_spectrum(rig)
    except ComputationError:
        return exact
    values: dict[Kind | None, list[complex]] = {}
    for value, group in zip(spectrum.eigenvalue.tolist(), spectrum.groups, strict=True):
        for part in group if value else ():
            values.setdefault(part.kind, []).extend([value] * (1 if part.kind else part.along_count))
    modes_of_kind: dict[Kind | None, list[int]] = {}
    for m, (kind, _) in enumerate(modes):
        modes_of_kind.setdefault(kind, []).append(m)
    for kind, places in modes_of_kind.items():
        first = np.array([(modes[m][1].rate, modes[m][1].omega) for m in places])
        slow = slowest(np.array(values.get(kind, [])), len(places))
        for m, value in zip(places, nearest_values(first, slow), strict=True):
            exact[m] = value
    return exact


def slowest(values: NDArray[np.complex128], count: int) -> NDArray[np.complex128]:
    """The oscillating eigenvalues and the slowest of the overdamped ones, `count` in all, since slow roots dominate."""
    order = np.argsort(np.where(values.imag != 0, -np.inf, -values.real), kind="stable")
    return values[order[:count]]


def nearest_values(first: Floats, values: NDArray[np.complex128]) -> list[complex | None]:
    """A value λ for each (σ, ω) of `first` (d, 2), none twice, those of smallest |λ + 2σ + ω²/λ| first."""
    chosen: list[complex | None] = [None] * len(first)
    distance = np.abs(values + 2 * first[:, :1] + (first[:, 1:] / values) * first[:, 1:])
    free = np.ones(len(values), dtype=np.bool_)
    for flat in np.argsort(distance, axis=None).tolist():
        row, column = divmod(flat, len(values))
        if chosen[row] is None and free[column]:
            chosen[row], free[column] = complex(values[column]), False
    return chosen
