"""The modes of a scene with closed feedback loops: poles and shapes of dense matrices that are not symmetric.

    z' = A z,    A = [[0, 1], [−M⁻¹K, −M⁻¹D]],

in natural units. A coordinate with a column of zeros in K has the pole 0 exactly, and its rate has another if its
column in D is zero; both are omitted from the matrix.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple, Self

import numpy as np

from modal.assembly import Matrices, Rig, Units, matrices
from modal.eigen import Details, is_singular
from modal.eigen.component_matrices import StructureShapes
from modal.eigen.components import PartedRig
from modal.eigen.dense import LARGEST_DAMPED, SINGULAR, refuse_beyond
from modal.eigen.free_motions import details_of
from modal.eigen.sources import UNCERTAIN, ProblemSize
from modal.eigen.spectrum import Batch, ModalSpectrum
from modal.errors import ComputationError
from modal.modes.modes import Modes
from modal.report import deferred
from modal.scene import Scene, require
from modal.structure import coordinate_units
from modal.types import EPS, Booleans, Complexes, Floats, Ints


class ClosedSolution(NamedTuple):
    """Eigenvalues `value` (R,), shapes (q, R), error bounds (R,) and how well they satisfy the equations, (R,)."""

    value: Complexes
    shape: Complexes
    error: Floats
    residual: Floats


@dataclass(frozen=True, eq=False)
class ClosedLoops:
    """The source of all modes: M, K and D of a scene in natural units, over the coordinates of its `rig`.

    `unit` (q,) are those of the coordinates in SI units, `rate` (1/s) that of eigenvalues.
    """

    rig: Rig
    M: Floats
    K: Floats
    D: Floats
    unit: Floats
    rate: float
    route = "dense, with loops of feedback closed"
    is_damped, is_singular = True, False

    @classmethod
    def of(cls, rig: Rig, units: Units, linear: Matrices, **more: Any) -> Self:
        """Those of a natural rig, from matrices in SI units."""
        unit = np.concatenate((coordinate_units(rig.support, units.length), np.ones(len(linear.M) - rig.leading)))
        moment = units.mass * units.length**2
        factors = moment, moment * units.rate**2, moment * units.rate
        parts = zip((linear.M, linear.K, linear.D), factors, strict=True)
        M, K, D = (part * unit * unit[:, None] / factor for part, factor in parts)
        return cls(rig, M, K, D, unit, units.rate, **more)

    @property
    def note(self) -> str:
        """Notes on these modes."""
        return ""

    @property
    def problem_size(self) -> ProblemSize:
        """One state matrix."""
        n = len(self.M)
        return ProblemSize("the whole scene", 1, n, (("M", n, 1), ("state", int(self.feels.sum()), 1)), True)

    @cached_property
    def feels(self) -> Booleans:
        """The states (2 q,) on which anything depends."""
        place = self.K.any(axis=0)
        return np.concatenate((place, place | self.D.any(axis=0)))

    @cached_property
    def solution(self) -> ClosedSolution:
        """One eigenvalue of each pair, with its shape and its error bound."""
        n, feels = len(self.M), self.feels
        if is_singular(self.M):
            raise ComputationError(SINGULAR)
        A = np.vstack((np.eye(2 * n)[n:], -np.linalg.solve(self.M, np.hstack((self.K, self.D)))))
        value, right = np.linalg.eig(A[np.ix_(feels, feels)])
        whole = np.zeros((2 * n, len(value)), dtype=complex)
        whole[feels] = right
        with np.errstate(all="ignore"):
            whole[~feels] = A[np.ix_(~feels, feels)] @ right / value
            whole[:n] = np.where(feels[:n, None], whole[:n], whole[n:] / value)
            condition = np.linalg.norm(np.linalg.pinv(right), axis=1) * np.linalg.norm(right, axis=0)
            error = 4 * len(value) * EPS * condition * np.linalg.norm(A[np.ix_(feels, feels)], 2) / np.abs(value)
            terms = [S @ whole[:n] * value**power for power, S in enumerate((self.K, self.D, self.M))]
            size = sum(
                np.abs(S) @ np.abs(whole[:n]) * np.abs(value) ** p for p, S in enumerate((self.K, self.D, self.M))
            )
            residual = np.linalg.norm(sum(terms), axis=0) / np.linalg.norm(size, axis=0)
        chosen = value.imag >= 0
        return self.whole(value[chosen], whole[:n, chosen], error[chosen], residual[chosen])

    def whole(self, value: Complexes, shape: Complexes, error: Floats, residual: Floats) -> ClosedSolution:
        """The solution with motions without effect first, and without growth or decay that is rounding.

        A value without a certain digit stays as it is: its bound tells nothing of it.
        """
        is_level = (value.imag != 0) & (error < UNCERTAIN)
        is_level[is_level] = np.abs(value.real[is_level]) <= error[is_level] * np.abs(value[is_level])
        free = np.eye(len(self.M))[:, ~self.feels[: len(self.M)]]
        zero = np.zeros(free.shape[1])
        values = np.append(zero, np.where(is_level, 1j * value.imag, value))
        return ClosedSolution(values, np.hstack((free, shape)), np.append(zero, error), np.append(zero, residual))

    @property
    def eigenvalue(self) -> Complexes:
        """−ζω + iω√(1−ζ²), and real ones."""
        return self.solution.value

    @property
    def error(self) -> Floats:
        """Relative error bounds of first order."""
        return self.solution.error

    def details(self, rows: Ints) -> Details:
        """Shapes, and how well they satisfy the equations."""
        shape, residual, rig = self.solution.shape[:, rows], self.solution.residual[rows], self.rig
        modal_mass = np.einsum("ir,ij,jr->r", shape.conj(), self.M, shape).real
        angles = tuple(np.zeros((*block.mass.shape, len(rows)), dtype=complex) for block in rig.blocks)
        first = rig.leading
        for block, column, _ in rig.members:
            angles[block][:, column] = shape[first : first + rig.blocks[block].n]
            first += rig.blocks[block].n
        shapes = StructureShapes(PartedRig(rig), shape[: rig.leading], angles)
        return details_of(shapes, modal_mass, np.full(len(rows), np.nan), residual, shapes.energies)


class ClosedModes(Modes):
    """The modes of a scene with its loops closed."""

    @cached_property
    def source(self) -> ClosedLoops:
        """All modes, from sample to sample where a loop has samples."""
        if "sampled_feedback" not in self.scene.features:
            return ClosedLoops.of(self.natural, self.units, self.matrices)
        loops: ClosedLoops = deferred("modal.statespace.sampled:sampled_loops")(self)
        return loops

    @cached_property
    def notes(self) -> tuple[str, ...]:
        """Omissions and approximations, with reasons."""
        return (*filter(None, [self.source.note]), *super().notes)

    @cached_property
    def _full_spectrum(self) -> ModalSpectrum:
        source = self.source
        value, error = source.eigenvalue, np.where(source.error < UNCERTAIN, source.error, np.inf)
        rows = np.arange(len(value))
        batch = Batch(source, rows, np.ones_like(rows), np.zeros_like(rows))
        order = np.lexsort((value.real, np.abs(value)))
        return ModalSpectrum(value[order], error[order], (batch,), order, np.arange(len(value) + 1))

    @cached_property
    def matrices(self) -> Matrices:
        """M, K and D with the loops closed."""
        return matrices(self.scene)


def closed_modes(scene: Scene, modes: slice | None) -> Modes:
    """Return the modes of a scene with feedback; raise SceneError or ComputationError if they cannot be computed."""
    require(scene, "the table of modes")
    refuse_beyond(LARGEST_DAMPED, scene.n_links, "loops of feedback")
    closed = ClosedModes(scene, which=modes)
    _ = closed.spectrum
    return closed
