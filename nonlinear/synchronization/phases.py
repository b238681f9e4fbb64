"""Phases and amplitudes of every pendulum in its fixed-base modes, whatever drives, damps or couples them.

With the angles q of one pendulum from equilibrium and its modes A φ ω² = K φ on a fixed support, without dampers
and drives,

    η_b = φ_bᵀ A q / φ_bᵀ A φ_b,     z_b = η_b − i η_b'/ω_b.

In free motion z_b rotates as exp(iω_b t), and |z_b| is the largest angle of the mode.  The phase coherence of N pendula
is Kuramoto's order parameter (Kuramoto, Chemical Oscillations, Waves, and Turbulence, §5.4), ψ their mean phase:

    R_b e^{iψ_b} = (1/N) Σ_p e^{i arg z_pb}:     1 in phase, 0 for two in antiphase.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import ceil, pi
from typing import NamedTuple

import numpy as np

from modal import pair
from modal.errors import ComputationError
from modal.report import Displayed, Summary, counted, first_line
from modal.scene.doors import require_type
from modal.types import Complexes, Floats
from nonlinear.averaging.equations import ARRAY_ENTRIES
from nonlinear.integration import Trajectory
from nonlinear.postprocessing import last
from nonlinear.system import Group, System

ENDING = 0.1
"""Format: final fraction of a run that "at the end" and "the last tenth" mean."""


class OwnShapes(NamedTuple):
    """B fixed-base modes of P pendula of n links: `omega` (rad/s) and `mass` φᵀAφ (kg m²) are (P, B).

    `shape` φ and `dual` Aφ/φᵀAφ are (P, n, B); the largest angle of φ is 1, that of the top link not negative.
    """

    omega: Floats
    mass: Floats
    shape: Floats
    dual: Floats


@dataclass(frozen=True, eq=False, repr=False)
class Phases(Displayed):
    """A run as N pendula in their fixed-base modes 1 to B, B being the links of the shortest; higher ones are omitted.

    `z` (T, N, B) in rad, `omega` (rad/s) and `mass` φᵀAφ (kg m²) of these modes, (N, B).
    """

    trajectory: Trajectory
    z: Complexes
    omega: Floats
    mass: Floats

    def _summary(self) -> Summary:
        count, modes = self.omega.shape
        pendula, modes_of_each = counted(count, "pendulum", "pendula"), counted(modes, "mode", "modes")
        title = f"Phases of {pendula} in {modes_of_each} at {counted(len(self.times), 'time', 'times')}"
        return Summary(title, [("of", first_line(self.trajectory))])

    @property
    def times(self) -> Floats:
        """Times of the samples (s), (T,)."""
        return self.trajectory.times

    @cached_property
    def phase(self) -> Floats:
        """Phase arg z (rad) in (−π, π], (T, N, B); 0 where z is."""
        return np.angle(self.z)

    @cached_property
    def amplitude(self) -> Floats:
        """|z| (rad), the largest angle of each mode alone, (T, N, B)."""
        return np.abs(self.z)

    @cached_property
    def _mean(self) -> Complexes:
        size = self.amplitude
        return np.asarray(np.divide(self.z, size, out=np.zeros_like(self.z), where=size > 0).mean(1))

    @property
    def order(self) -> Floats:
        """The order parameter R_b, (T, B); a pendulum at rest has no phase and contributes nothing."""
        return np.abs(self._mean)

    @property
    def mean_phase(self) -> Floats:
        """ψ_b (rad), (T, B)."""
        return np.angle(self._mean)

    @cached_property
    def energy(self) -> Floats:
        """Energy of each pendulum (J), (T, N): kinetic in the ground frame, and potential with its joint springs."""
        mechanics = self.trajectory.mechanics
        return mechanics.of_pendula(mechanics.kinetic + mechanics.potential)

    @cached_property
    def leading(self) -> int:
        """The fixed-base mode, from 0, with most energy ½ Σ_p φᵀAφ ω² |z|² in the last tenth of the run."""
        squares = np.mean(self.amplitude[last(self.times, ENDING)] ** 2, axis=0)
        return int(np.argmax(np.sum(self.mass * self.omega**2 * squares, axis=0)))

    @cached_property
    def frequency(self) -> Floats:
        """Mean frequency (rad/s) of each pendulum in the leading mode over the second half of the run, (N,).

        The slope of a straight line fitted to the phase with the weight 1 + cos πs, s from −1 to 1, which suppresses
        ripples; NaN for a pendulum that is at rest at any time. Raise ComputationError if the samples are too far apart
        to follow phases.
        """
        return self.mean_rates(0.5)

    def mean_rates(self, part: float) -> Floats:
        """The same over the last `part` of the run."""
        late = last(self.times, part)
        times, z = self.times[late], self.z[late, :, self.leading]
        self._validate(times, z)
        half = (times[-1] - times[0]) / 2
        weight = 1 + np.cos(pi * ((times - times[0]) / half - 1))
        from_middle = times - np.average(times, weights=weight)
        pull = weight * from_middle
        slope = pull @ np.unwrap(np.angle(z), axis=0) / (pull @ from_middle)
        return np.where(np.all(z != 0, axis=0), slope, np.nan)

    def _validate(self, times: Floats, z: Complexes) -> None:
        """Check sampling against the fixed-base frequencies, and √(mean η'²/mean η²), which needs no fine sampling."""
        if len(times) < 3:
            raise ComputationError("the run has too few samples to measure frequencies")
        shapes = self.omega[:, self.leading]
        eta, rate = (np.sqrt(np.mean(part**2, axis=0)) for part in (z.real, z.imag * shapes))
        fastest = float(np.max(np.maximum(shapes, np.divide(rate, eta, out=np.zeros_like(eta), where=eta > 0))))
        widest, enough = float(np.max(np.diff(times))), 2 * pi / (3 * fastest)  # three samples a period
        if widest > enough:
            count = ceil((self.times[-1] - self.times[0]) / enough) + 2
            raise ComputationError(
                f"samples every {widest:.3g} s are too few to follow phases that rotate at "
                f"{fastest:.4g} rad/s: simulate with one every {enough:.2g} s, `output={count}`"
            )

    @property
    def resolution(self) -> float:
        """Difference of frequencies (rad/s) that separates phases by a quarter turn in the second half of the run."""
        late = self.times[last(self.times, 0.5)]
        return float(pi / 2 / (late[-1] - late[0]))

    @property
    def locked(self) -> bool:
        """Whether all frequencies agree within `resolution` and no pendulum is at rest."""
        return bool(np.ptp(self.frequency) <= self.resolution)


def phases_of(trajectory: Trajectory) -> Phases:
    """The phases of a run in the plane, driven or not.

    Raise ComputationError for a motion in space, for pendula that do not oscillate about equilibrium on a fixed
    support, and for chains too long for dense matrices.
    """
    require_type("trajectory", trajectory, "Trajectory")
    system, motion = trajectory.system, trajectory.motion
    if system.spatial:
        raise ComputationError("phases: only for motion in the plane")
    if system.hoisting is not None:
        raise ComputationError("phases: only for constant lengths, and this run has a hoist")
    return Phases(trajectory, *fixed_base_amplitudes(system, motion.links, motion.link_rates))


def fixed_base_amplitudes(system: System, links: Floats, link_rates: Floats) -> tuple[Complexes, Floats, Floats]:
    """Z (T, N, B) of every pendulum in its own modes from angles and rates (T, L), their ω (rad/s) and φᵀAφ, (N, B)."""
    count = min(group.n for group in system.groups)
    z = np.empty((len(links), system.n_pendula, count), dtype=np.complex128)
    omega, mass = np.empty((2, system.n_pendula, count))
    angles = from_rest(system, links)
    for group in system.groups:
        shapes = own_shapes(group, system.gravity, count)
        eta, rate = (np.einsum("tnp,pnb->tpb", part[:, group.index], shapes.dual) for part in (angles, link_rates))
        z[:, group.pendula] = eta - 1j * rate / shapes.omega
        omega[group.pendula], mass[group.pendula] = shapes.omega, shapes.mass
    return z, omega, mass


def from_rest(system: System, links: Floats) -> Floats:
    """Angles (T, L) from equilibrium (rad), modulo full turns."""
    aside = links - np.where(system.by_link("sigma") > 0, 0.0, pi)
    return np.asarray(aside - 2 * pi * np.round(aside / (2 * pi)))


def own_shapes(group: Group, gravity: float, count: int) -> OwnShapes:
    """The `count` slowest fixed-base modes of every pendulum of a group.

    With K = LLᵀ the largest eigenvalues of L⁻¹AL⁻ᵀ are the smallest ω⁻². Raise ComputationError if K is not positive
    definite, or the matrices do not fit.
    """
    if group.n * group.index.size > 2 * ARRAY_ENTRIES:
        raise ComputationError(
            f"{group.index.shape[1]} pendula of {group.n} links are too many for their fixed-base modes"
        )
    # about equilibrium, (P, n, n) in kg m² and N m
    block, n = group.block, group.n
    A = np.array(pair.inertia_matrix(block.mass, block.length, block.centre, block.inertia)).transpose(2, 0, 1)
    sigma = block.sigma.T
    joint = np.eye(n) - np.eye(n, k=-1)
    springs = joint.T @ (block.stiffness.T[:, :, None] * joint)
    A = A * sigma[:, :, None] * sigma[:, None] + joint.T @ (block.rotor.T[:, :, None] * joint)
    K = springs + np.eye(n) * (gravity * sigma * block.b.T)[:, None]
    try:
        L = np.linalg.cholesky(K)
    except np.linalg.LinAlgError:
        raise ComputationError(
            "phases: a pendulum of this scene does not oscillate about its equilibrium on a fixed support"
        ) from None
    half = np.linalg.solve(L, A)
    value, w = np.linalg.eigh(np.linalg.solve(L, half.transpose(0, 2, 1)))
    phi = np.linalg.solve(L.transpose(0, 2, 1), w[..., : -count - 1 : -1])
    phi *= np.where(phi[:, :1] < 0, -1.0, 1.0) / np.abs(phi).max(axis=1, keepdims=True)
    momenta = A @ phi
    mass = np.sum(phi * momenta, axis=1)
    return OwnShapes(value[:, : -count - 1 : -1] ** -0.5, mass, phi, momenta / mass[:, None])
