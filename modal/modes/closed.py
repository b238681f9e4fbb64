"""The modes of a scene with closed feedback loops: poles and shapes of dense matrices that are not symmetric.

    z' = A z,    A = [[0, 1], [−M⁻¹K, −M⁻¹D]],

in natural units. A coordinate with a column of zeros in K has the pole 0 exactly, and its rate has another if its
column in D is zero; both are omitted from the matrix.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

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
from modal.scene import Scene, require
from modal.structure import coordinate_units
from modal.types import EPS, Booleans, Complexes, Floats, Ints


@dataclass(frozen=True, eq=False)
class ClosedLoops:
    """The source of all modes: M, K and D of a scene in natural units, over the coordinates of its `rig`."""

    rig: Rig
    M: Floats
    K: Floats
    D: Floats
    route = "dense, with loops of feedback closed"
    is_damped, is_singular = True, False

    @classmethod
    def of(cls, rig: Rig, units: Units, linear: Matrices) -> ClosedLoops:
        """Those of a natural rig, from matrices in SI units."""
        unit = np.concatenate((coordinate_units(rig.support, units.length), np.ones(len(linear.M) - rig.leading)))
        moment = units.mass * units.length**2
        factors = moment, moment * units.rate**2, moment * units.rate
        parts = zip((linear.M, linear.K, linear.D), factors, strict=True)
        return cls(rig, *(part * unit * unit[:, None] / factor for part, factor in parts))

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
    def _solution(self) -> tuple[Complexes, Complexes, Floats]:
        """Eigenvalues (R,), one of each pair, shapes (q, R) and error bounds (R,): first motions that nothing feels."""
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
            is_level = (value.imag != 0) & (np.abs(value.real) <= error * np.abs(value))
            value = np.where(is_level, 1j * value.imag, value)
        chosen, free = np.flatnonzero(value.imag >= 0), np.eye(n)[:, ~feels[:n]]
        values = np.append(np.zeros(free.shape[1]), value[chosen])
        shapes = np.hstack((free.astype(complex), whole[:n, chosen]))
        return values, shapes, np.append(np.zeros(free.shape[1]), error[chosen])

    @property
    def eigenvalue(self) -> Complexes:
        """−ζω + iω√(1−ζ²), and real ones."""
        return self._solution[0]

    @property
    def error(self) -> Floats:
        """Relative error bounds of first order."""
        return self._solution[2]

    def details(self, rows: Ints) -> Details:
        """Shapes, and how well they satisfy the equations."""
        value, shape, rig = self.eigenvalue[rows], self._solution[1][:, rows], self.rig
        terms = [S @ shape * value**power for power, S in enumerate((self.K, self.D, self.M))]
        size = sum(np.abs(S) @ np.abs(shape) * np.abs(value) ** p for p, S in enumerate((self.K, self.D, self.M)))
        residual = np.linalg.norm(sum(terms), axis=0) / np.linalg.norm(size, axis=0)
        modal_mass = np.einsum("ir,ij,jr->r", shape.conj(), self.M, shape).real
        angles = tuple(np.zeros((*block.mass.shape, len(rows)), dtype=complex) for block in rig.blocks)
        first = rig.leading
        for block, column, _ in rig.members:
            angles[block][:, column] = shape[first : first + rig.blocks[block].n]
            first += rig.blocks[block].n
        shapes = StructureShapes(PartedRig(rig), shape[: rig.leading], angles)
        details = details_of(shapes, modal_mass, np.full(len(rows), np.nan), residual, shapes.energies)
        return details if rig.structure or not rig.leading else _on_cart(details, shape[0])


def _on_cart(details: Details, cart: Complexes) -> Details:
    """The same with the displacements of a cart."""
    values = {**vars(details), "cart": cart, "eta": ()}
    return Details(**values)


class ClosedModes(Modes):
    """The modes of a scene with its loops closed."""

    @cached_property
    def _full_spectrum(self) -> ModalSpectrum:
        source = ClosedLoops.of(self.natural, self.units, self.matrices)
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
