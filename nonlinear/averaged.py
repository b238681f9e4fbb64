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

A free cart has no frequency of its own, so a damper c may well stop it within a swing: its motion in φ_r is divided by
1 − i c/(M ω_r), M all masses together, as M x'' + c x' = −(b·q)'' has it.

Escapements act by the first harmonics of their kicks (`nonlinear.describing`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, cached_property
from itertools import count as counted
from itertools import product

import numpy as np

from modal.all_shapes import all_shapes
from modal.errors import ComputationError
from modal.linear import matrices
from modal.modes import Modes, natural_modes
from modal.rig import Complexes, Floats, Ints
from modal.scene import Scene
from nonlinear.describing import mixed, pulls
from nonlinear.escapements import Escaping, escaping
from nonlinear.modal_coordinates import rest_angles
from nonlinear.plant import Plant, plant_of
from nonlinear.residual import residual
from nonlinear.state import State

BAND = 1.5  # ratio of neighbouring frequencies above which they belong to different bands
ORDER = 6
MOST, MOST_BANDS = 400, 4
CHUNK = 2_000_000
STEP = 1e-6


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

    @property
    def link_shapes(self) -> Floats:
        """The shapes without the cart, (L, C)."""
        return self.shapes[int(self.plant.cart is not None) :]

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
        """The largest angle (rad) that a link may reach, whatever the phases of different bands."""
        links = self.link_shapes
        bands = (self.band == band for band in range(len(self.centre)))
        return float(np.sum([np.abs(links[:, own] @ z[own]) for own in bands], axis=0).max())

    @cached_property
    def detuning(self) -> Floats:
        """ω_r − ω_b (rad/s) of every shape, (C,)."""
        return np.asarray(self.omega - self.centre[self.band])

    def flow(self, z: Complexes) -> Complexes:
        """The rates z' (C, ...) of amplitudes (C, ...)."""
        return np.asarray((self.forced(z).T + 1j * self.detuning * z.T).T)

    def forced(self, z: Complexes) -> Complexes:
        """The same without the detuning."""
        found = self.smooth(z)
        if self._joints:
            found += self._kicks(z.reshape(len(z), -1)).reshape(z.shape)
        return found

    def smooth(self, z: Complexes) -> Complexes:
        """And without escapements."""
        wide = z.reshape(len(z), -1)
        step = max(1, CHUNK // (self._phases.shape[1] * len(self.shapes)))
        parts = [self._left(wide[:, start : start + step]) for start in range(0, wide.shape[1], step)]
        return np.asarray(np.hstack(parts).reshape(z.shape))

    def _left(self, z: Complexes) -> Complexes:
        """What the forces that are left do to z (C, S)."""
        turn = self._phases[self.band]
        moving = z[:, :, None] * turn[:, None, :]
        first = 1j * self.omega[:, None, None]
        shape = (len(self.shapes), -1)
        q, v, a = (
            np.tensordot(self._braked, part, axes=1).real.reshape(shape)
            for part in (moving, first * moving, first**2 * moving)
        )
        left = residual(self.plant, [np.array([q, v, a])])[0]
        along = (self.shapes.T @ left).reshape(len(self.omega), z.shape[1], -1)
        return np.asarray(1j / self.omega[:, None] * np.mean(along * turn.conj()[:, None, :], axis=2))

    def _kicks(self, z: Complexes) -> Complexes:
        """What escapements do to z (C, S)."""
        joints = self._joints
        assert joints is not None
        torque = pulls(joints.impulse, joints.angle, *self._swings(z), self._phases)[self.band]
        return np.asarray(np.einsum("cj,cjs->cs", self._turns, torque) / (2j * self.omega[:, None]))

    def _swings(self, z: Complexes) -> tuple[Complexes, Complexes]:
        """Of z (C, S): Σ γ_r z_r and Σ ω_r γ_r z_r over every band at the joints with escapements, (B, J, S)."""
        parts = np.where((self.band == np.arange(len(self.centre))[:, None])[..., None], z, 0.0).astype(complex)
        return np.asarray(self._turns.T @ parts), np.asarray(self._turns.T @ (self.omega[:, None] * parts))

    def mixed(self, z: Complexes) -> float:
        """How much several bands swing an escapement at once in z (C, S), see `nonlinear.describing`; 0 without."""
        return mixed(self._joints.angle, *self._swings(z)) if self._joints else 0.0

    @cached_property
    def _braked(self) -> Complexes:
        """The shapes as the damper of a free cart bends them, (half, C)."""
        found, cart = self.shapes.astype(complex), self.plant.cart
        if cart and not cart.stiffness:
            found[0] /= 1 - 1j * cart.damping / (self.plant.total_mass * self.omega)
        return found

    @cached_property
    def _phases(self) -> Complexes:
        """e^{iχ_b} (B, K) of every band at the points of the lattice."""
        points, steps = lattice(len(self.centre))
        return np.asarray(np.exp(2j * np.pi * np.outer(steps, np.arange(points)) / points))

    @cached_property
    def _joints(self) -> Escaping | None:
        return escaping(self.plant) if self.plant.kicked else None

    @cached_property
    def _turns(self) -> Floats:
        """How far the joints with escapements turn in every shape, (C, J)."""
        assert self._joints is not None
        return self._joints.gamma(self.link_shapes.T)


def derivative(rate: Callable[[Complexes], Complexes], z: Complexes) -> Floats:
    """Of a rate by the real and the imaginary parts of z (C,), (2C, 2C), by central differences."""
    width = STEP * (float(np.abs(z).max()) or 1.0)
    ways = width * np.hstack((np.eye(len(z)), 1j * np.eye(len(z))))
    slope = (rate(z[:, None] + ways) - rate(z[:, None] - ways)) / (2 * width)
    return np.vstack((slope.real, slope.imag))


@cache
def lattice(count: int) -> tuple[int, tuple[int, ...]]:
    """The fewest points K, and the steps s (count,) of the phases 2π s k/K, that average products of ORDER factors.

    Products of an odd number of factors have no mean to be found: the forces are odd in the motion.
    """
    words = [word for word in product(range(-ORDER, ORDER + 1), repeat=count) if 0 < sum(map(abs, word)) <= ORDER]
    even = np.array([word for word in words if sum(word) % 2 == 0])
    for points in counted(2):
        for base in range(1, points):
            steps = tuple(pow(base, power, points) for power in range(count))
            if np.all(even @ steps % points):
                return points, steps
    raise AssertionError("unreachable")


def averaged(scene: Scene) -> Averaged:
    """The averaged equations of a scene in the plane whose links all hang.

    Raises ComputationError for other scenes, for more than MOST links or MOST_BANDS bands, and for coordinates without
    a mode, such as those of some massless carts.
    """
    if scene.space == "space" or scene.stands:
        raise ComputationError("averaged equations are of hanging links in the plane")
    if scene.n_links > MOST:
        raise ComputationError(f"averaged equations are of at most {MOST} links, not {scene.n_links}")
    still, plant = scene.conservative, plant_of(scene)
    modes = natural_modes(still)
    each = [(row, shape) for row, copies in enumerate(all_shapes(modes)) if modes.omega[row] for shape in copies]
    if len(each) < scene.n_links + bool(plant.cart and plant.cart.stiffness):
        raise ComputationError("averaged equations need one mode for each coordinate; a massless cart leaves one out")
    head = [[shape.cart.real] if modes.on_cart else [] for _, shape in each]
    shapes = np.array([np.concatenate((x, shape.angles.real)) for x, (_, shape) in zip(head, each, strict=True)]).T
    row = np.array([number for number, _ in each])
    omega = modes.omega[row]
    band = np.concatenate(([0], np.cumsum(omega[1:] > BAND * omega[:-1])))
    if (count := int(band[-1]) + 1) > MOST_BANDS:
        raise ComputationError(f"averaged equations are of at most {MOST_BANDS} bands of frequencies, not {count}")
    return Averaged(scene, plant, modes, shapes, matrices(still).M @ shapes, omega, row, band)
