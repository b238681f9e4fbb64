"""The slow motion of amplitudes and phases: averaged equations of a scene, from its modes.

In the conservative small-angle scene nothing but phases moves.  With mass-normalised shapes φ_r and complex amplitudes
z_r, the motion

    q(t) = Re Σ_r φ_r z_r exp(i ω_r t),     modal energy ½ ω_r² |z_r|²,

is put into the full nonlinear equations (`nonlinear.residual`), drives and dampers included.  What it leaves of them,
the forces ρ, moves the z_r slowly (first-order averaging: Krylov and Bogoliubov; Sanders, Verhulst & Murdock, Averaging
Methods in Nonlinear Dynamical Systems, 2007, ch. 2):

    z_r' = (i/ω_r) ⟨φ_rᵀρ e^{−iχ_b}⟩ + i (ω_r − ω_b) z_r.

Modes of nearly equal frequencies form a band b with one fast phase χ_b and mean frequency ω_b; they exchange energy.
The phases of different bands are taken as unrelated, and the mean ⟨ ⟩ runs over all of them: over K points of a lattice
on which no product of up to ORDER factors e^{±iχ_b} but those that truly are constant has a mean.

A kick P of an escapement at the angle a of a joint that swings with the complex amplitude Γ, |Γ| > a, has the mean

    (2 P ω_b/π) e^{iα} Γ/|Γ|,     cos α = a/|Γ|,

the first harmonic of two kicks a period; of several bands the one that swings the joint most is taken.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from modal.all_shapes import all_shapes
from modal.errors import ComputationError
from modal.linear import matrices
from modal.modes import Modes, natural_modes
from modal.rig import Floats, Ints
from modal.scene import Scene
from nonlinear.escapements import Escaping, escaping
from nonlinear.modal_coordinates import rest_angles
from nonlinear.plant import Plant, plant_of
from nonlinear.residual import residual
from nonlinear.state import State
from nonlinear.truncation import undamped

Complexes = NDArray[np.complex128]
BAND = 1.2  # ratio of neighbouring frequencies above which they belong to different bands
ORDER = 6
MOST, MOST_BANDS = 400, 4
CHUNK = 2_000_000


@dataclass(frozen=True, eq=False)
class Averaged:
    """The averaged equations of a scene with C swinging shapes.

    `shapes` (half, C) with φᵀMφ = 1, `dual` = M φ, `omega` (C,) in rad/s, `row` (C,) of each in the table of the
    conservative scene, from 0, `band` (C,).
    """

    scene: Scene
    plant: Plant
    modes: Modes
    shapes: Floats
    dual: Floats
    omega: Floats
    row: Ints
    band: Ints

    @cached_property
    def centre(self) -> Floats:
        """Mean frequency (rad/s) of every band, (B,)."""
        return np.asarray(np.bincount(self.band, weights=self.omega) / np.bincount(self.band))

    def amplitudes(self, state: State) -> Complexes:
        """The z (C,) of an instant."""
        q, v = state.links - rest_angles(self.scene), state.link_rates
        if self.plant.cart:
            q, v = np.append(state.cart, q), np.append(state.cart_rate, v)
        return np.asarray(q @ self.dual - 1j * (v @ self.dual) / self.omega)

    def energies(self, z: Complexes) -> Floats:
        """Modal energy (J) by rows of the table, (R, ...)."""
        found: Floats = np.zeros((len(self.modes), *z.shape[1:]))
        np.add.at(found, self.row, (self.omega**2 * np.abs(z.T) ** 2).T / 2)
        return found

    def largest(self, z: Complexes) -> float:
        """The largest angle (rad) that a link may reach."""
        first = int(self.plant.cart is not None)
        return float((np.abs(self.shapes[first:]) @ np.abs(z)).max())

    def flow(self, z: Complexes) -> Complexes:
        """The rates z' (C, ...) of amplitudes (C, ...)."""
        found = self.smooth(z)
        if not self._joints:
            return found
        return np.asarray(found + self._kicks(z.reshape(len(z), -1)).reshape(z.shape))

    def smooth(self, z: Complexes) -> Complexes:
        """The same without escapements."""
        wide = z.reshape(len(z), -1)
        step = max(1, CHUNK // (self._phases.shape[1] * len(self.shapes)))
        parts = [self._forced(wide[:, start : start + step]) for start in range(0, wide.shape[1], step)]
        detuned = 1j * (self.omega - self.centre[self.band])[:, None] * wide
        return np.asarray((np.hstack(parts) + detuned).reshape(z.shape))

    def _forced(self, z: Complexes) -> Complexes:
        """What the forces that are left do to z (C, S)."""
        turn = self._phases[self.band]
        moving = z[:, :, None] * turn[:, None, :]
        first = 1j * self.omega[:, None, None]
        shape = (len(self.shapes), -1)
        q, v, a = (
            np.tensordot(self.shapes, part.real, axes=1).reshape(shape)
            for part in (moving, first * moving, first**2 * moving)
        )
        left = residual(self.plant, [np.array([q, v, a])])[0]
        along = (self.shapes.T @ left).reshape(len(self.omega), z.shape[1], -1)
        return np.asarray(1j / self.omega[:, None] * np.mean(along * turn.conj()[:, None, :], axis=2))

    def _kicks(self, z: Complexes) -> Complexes:
        joints = self._joints
        assert joints is not None
        bands = np.arange(len(self.centre))
        swing = np.array([self._turns.T @ np.where((self.band == band)[:, None], z, 0.0) for band in bands])
        leading = np.abs(swing).argmax(axis=0)
        own = np.take_along_axis(swing, leading[None], axis=0)[0]
        size = np.abs(own)
        reach = np.divide(joints.angle[:, None], size, out=np.full_like(size, np.inf), where=size > 0)
        lead = np.where(reach < 1, np.exp(1j * np.arccos(np.minimum(reach, 1.0))), 0.0)
        torque = 2 / np.pi * joints.impulse[:, None] * self.centre[leading] * lead * own / np.maximum(size, 1e-300)
        acting = np.where(leading[None] == self.band[:, None, None], torque[None], 0.0)
        return np.asarray(np.einsum("cj,cjs->cs", self._turns, acting) / (2j * self.omega[:, None]))

    @cached_property
    def _phases(self) -> Complexes:
        """e^{iχ_b} (B, K) of every band at the points of the lattice."""
        count = len(self.centre)
        steps = (ORDER + 1) ** np.arange(count)
        points = 1 + ORDER * int(steps[-1]) + (count > 1)
        return np.asarray(np.exp(2j * np.pi * np.outer(steps, np.arange(points)) / points))

    @cached_property
    def _joints(self) -> Escaping | None:
        return escaping(self.plant) if self.plant.kicked else None

    @cached_property
    def _turns(self) -> Floats:
        """How far the joints with escapements turn in every shape, (C, J)."""
        assert self._joints is not None
        return self._joints.gamma(self.shapes[int(self.plant.cart is not None) :].T)


def averaged(scene: Scene) -> Averaged:
    """The averaged equations of a scene in the plane whose links all hang.

    Raises ComputationError for other scenes, for more than MOST coordinates or MOST_BANDS bands.
    """
    if scene.space == "space" or scene.stands:
        raise ComputationError("averaged equations are of hanging links in the plane")
    if scene.n_links > MOST:
        raise ComputationError(f"averaged equations are of at most {MOST} links, not {scene.n_links}")
    still = undamped(scene.undriven)
    modes = natural_modes(still)
    each = [(row, shape) for row, copies in enumerate(all_shapes(modes)) if modes.omega[row] for shape in copies]
    head = [[shape.cart.real] if modes.on_cart else [] for _, shape in each]
    shapes = np.array([np.concatenate((x, shape.angles.real)) for x, (_, shape) in zip(head, each, strict=True)]).T
    row = np.array([number for number, _ in each])
    omega = modes.omega[row]
    band = np.concatenate(([0], np.cumsum(omega[1:] > BAND * omega[:-1])))
    if (count := int(band[-1]) + 1) > MOST_BANDS:
        raise ComputationError(f"averaged equations are of at most {MOST_BANDS} bands of frequencies, not {count}")
    return Averaged(scene, plant_of(scene), modes, shapes, matrices(still).M @ shapes, omega, row, band)
