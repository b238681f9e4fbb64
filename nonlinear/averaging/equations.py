"""The slow motion of amplitudes and phases: averaged equations of a scene, from its modes.

In the conservative small-angle scene nothing but phases moves.  Modes φ_r, φᵀMφ = 1, of nearly equal frequencies ω_r
form a band b.  They exchange energy, may lock, and turn with one fast phase χ_b at one rate χ_b' = Ω_b.  With complex
amplitudes z_r, w_r = z_r e^{iχ_b} = η_r − iη_r'/Ω_b of η_r = φ_rᵀMq, the motion

    q = Re Σ φ_r z_r e^{iχ_b},     q' = Re Σ iΩ_b φ_r z_r e^{iχ_b},     q'' = −Re Σ Ω_b² φ_r z_r e^{iχ_b}

is substituted into the full nonlinear equations (`nonlinear.reduction.residual`), with drives and dampers.  The
residual forces ρ drive the z_r slowly (averaging: Krylov and Bogoliubov; [Sanders2007, ch. 2]):

    z_r' = (i/Ω_b) ⟨φ_rᵀρ e^{−iχ_b}⟩.

Where z' = 0 this is harmonic balance.  A rate of its own for each mode, ω_r in place of Ω_b, would drop the
counter-rotating part (1 − Ω_b/ω_r)/2 of a locked mode, and get signs of stability wrong.  The third harmonic of every
band is slaved to the first,

    A_r = −2 ⟨φ_rᵀρ e^{−3iχ_b}⟩/(ω_r² − 9Ω_b²);

Re Σ φ_r A_r e^{3iχ_b} is added to q, and ρ evaluated once more.  The phases of different bands are taken as unrelated,
and the mean ⟨ ⟩ runs over all of them: over K points of a lattice on which no product of up to ORDER factors e^{±iχ_b}
but those that truly are constant has a mean.

A free cart has no frequency of its own, so a damper c may well stop it within a swing: in the h-th harmonic its motion
in φ_r and the force on it are divided by 1 − i c/(h Ω_b M), M all masses together, as M x'' + c x' = −(b·q)'' has it.

Escapements act by harmonics of their kicks, and joints with dry friction by those of its torque
(`nonlinear.averaging.describing`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache, cached_property
from itertools import count as whole_numbers
from itertools import product

import numpy as np

from modal.errors import ComputationError
from modal.modes import Modes, natural_modes
from modal.report import Displayed, Summary, brief, counted
from modal.scene import Scene, name_of, require
from modal.scene.doors import checked
from modal.types import Booleans, Complexes, Floats, Ints
from nonlinear.averaging.describing import AMPLITUDE_FLOOR, mixing_ratio, pulls, rubbing_torques
from nonlinear.dynamics import Contacts, Escaping, contacts_of, escaping
from nonlinear.reduction import residual_forces
from nonlinear.system import Layout, State, System, system_of

BAND_RATIO = 1.5
"""Physics: of neighbouring frequencies, above which they belong to different bands: a cubic force joins ω and 3ω."""
ORDER = 6
"""Tolerance: factors e^{±iχ_b} whose products are averaged exactly: a cubic force, its slaved third harmonic too."""
LINKS_MAX = 400
"""Limit: "averaged equations are limited to 400 links"."""
BANDS_MAX = 4
"""Limit: "averaged equations are limited to 4 bands of frequencies": their lattice grows like a power of it."""
ARRAY_ENTRIES = 2_000_000
"""Cost: entries of the arrays that are computed at once; benchmarks/simulation.py."""
DIFFERENCE_STEP = np.cbrt(np.finfo(float).eps)
"""Tolerance: relative, of central differences: rounding and curvature take equal parts there."""
RESONANCE_DETUNING = 0.05
"""Physics: detuning over 9Ω² below which a resonance of the third harmonic is smoothed."""
THIRD_HARMONIC_MAX = 0.2
"""Physics: largest third harmonic over the first; a larger one is not slaved, and is limited to this."""


@dataclass(frozen=True, eq=False, repr=False)
class AveragedEquations(Displayed):
    """The averaged equations of a scene with C swinging shapes.

    `shapes` (half, C) with φᵀMφ = 1, `dual` = M φ, `omega` (C,) in rad/s, `row` (C,) of each in the table of the
    conservative scene, from 0, `band` (C,).
    """

    scene: Scene
    system: System
    modes: Modes
    shapes: Floats
    dual: Floats
    omega: Floats
    row: Ints
    band: Ints

    def _summary(self) -> Summary:
        shapes, bands = len(self.omega), len(self.centre)
        several = f"{counted(shapes, 'shape', 'shapes')} in {counted(bands, 'band', 'bands')} of frequencies"
        facts = [("ω (rad/s)", brief(self.omega)), ("band", brief(self.band + 1))]
        return Summary(f"Averaged equations of {name_of(self.scene)}: {several}", facts)

    @property
    def link_shapes(self) -> Floats:
        """The shapes without the cart or the structure, (L, C)."""
        return self.shapes[self.system.first :]

    @cached_property
    def centre(self) -> Floats:
        """Mean frequency (rad/s) of every band, (B,)."""
        return np.asarray(np.bincount(self.band, weights=self.omega) / np.bincount(self.band))

    def amplitudes(self, state: State) -> Complexes:
        """The amplitudes z (C,) of a state."""
        q, v = np.split(Layout.of(self.system, works=False).begin(state), 2)
        q[self.system.first :] -= self.system.rest
        return np.asarray(q @ self.dual - 1j * (v @ self.dual) / self.omega)

    def energies(self, z: Complexes) -> Floats:
        """Modal energy (J) by rows of the mode table, (R, ...)."""
        energy: Floats = np.zeros((len(self.modes), *z.shape[1:]))
        np.add.at(energy, self.row, (self.omega**2 * np.abs(z.T) ** 2).T / 2)
        return energy

    def largest(self, z: Complexes) -> float:
        """The largest angle (rad) that a link may reach, whatever the phases of different bands."""
        links = self.link_shapes
        bands = (self.band == band for band in range(len(self.centre)))
        return float(np.sum([np.abs(links[:, members] @ z[members]) for members in bands], axis=0).max())

    def turning(self, z: Complexes) -> Floats:
        """The rates Ω_b (B, ...) at which bands with amplitudes (C, ...) rotate freely, weighted by |z|²."""
        rates = self.centre.reshape(-1, *[1] * (z.ndim - 1)) * np.ones((1, *z.shape[1:]))
        for _ in range(3):
            rates = self.rotation_rates(rates, z, self.flow(z, rates))
        return np.asarray(rates)

    def rotation_rates(self, turning: Floats, z: Complexes, flow: Complexes) -> Floats:
        """An improved Ω_b (B, ...) from the rates z' (C, ...) found with another one."""
        largest = np.maximum(np.abs(z).max(axis=0), AMPLITUDE_FLOOR)
        unit = z / largest
        spin, sizes = self._by_band(np.imag(flow / largest * unit.conj())), self._by_band(np.abs(unit) ** 2)
        middle = self.centre.reshape(-1, *[1] * (z.ndim - 1))
        improved_rates = turning + np.divide(spin, sizes, out=0 * spin, where=sizes > 0)
        return np.clip(improved_rates, middle / 4, middle * 4)

    def _by_band(self, values: Floats) -> Floats:
        """Sums (B, ...) over the modes of each band of values (C, ...)."""
        return np.asarray((self.member @ values.reshape(len(values), -1)).reshape(-1, *values.shape[1:]))

    def detuning(self, turning: Floats) -> Floats:
        """(ω_r² − Ω_b²)/2Ω_b (C, ...): the rate (rad/s) at which a free amplitude rotates in its band."""
        rotation = turning[self.band]
        return np.asarray((self.omega.reshape(-1, *[1] * (turning.ndim - 1)) ** 2 - rotation**2) / (2 * rotation))

    def flow(self, z: Complexes, turning: Floats) -> Complexes:
        """The rates z' (C, ...) of amplitudes (C, ...) in bands that rotate at Ω (B, ...)."""
        return self.forcing(z, turning) + 1j * self.detuning(turning) * z

    def forcing(
        self,
        z: Complexes,
        turning: Floats,
        active: Booleans | None = None,
        *,
        kicking: bool = True,
        sliding: bool = True,
    ) -> Complexes:
        """The same rates without the detuning, as if each motion had `restricted_to` the modes kept (C, ...)."""
        columns = z.reshape(len(z), -1)
        pace = np.broadcast_to(turning.reshape(len(turning), -1), (len(turning), columns.shape[1]))
        active_columns = np.ones(columns.shape, dtype=bool) if active is None else active.reshape(columns.shape)
        step = max(1, ARRAY_ENTRIES // (self._phases.shape[1] * len(self.shapes)))
        if step >= columns.shape[1]:
            return self._rates(columns, pace, active_columns, kicking, sliding).reshape(z.shape)
        chunks = [slice(start, start + step) for start in range(0, columns.shape[1], step)]
        parts = [
            self._rates(columns[:, part], pace[:, part], active_columns[:, part], kicking, sliding) for part in chunks
        ]
        return np.asarray(np.hstack(parts).reshape(z.shape))

    def smooth(self, z: Complexes, turning: Floats) -> Complexes:
        """The rates of `forcing` without the kicks of escapements."""
        return self.forcing(z, turning, kicking=False)

    def linear(self, z: Complexes, turning: Floats) -> Complexes:
        """Those without dry friction too, which alone stops small oscillations within a swing."""
        return self.forcing(z, turning, kicking=False, sliding=False)

    def restricted_to(self, active: Booleans) -> AveragedEquations:
        """The same as if there were no other modes than these (C,)."""
        return replace(self, shapes=self.shapes * active, dual=self.dual * active)

    def _rates(self, z: Complexes, turning: Floats, active: Booleans, kicking: bool, sliding: bool) -> Complexes:
        """The effect on z (C, S) of all forces but the detuning."""
        first = self._split(z)
        waves = self._waves(first, turning, 1)
        pull, third = self._kicks(first, turning, active) if kicking and self._joints else (0.0, 0.0)
        if sliding and self._contacts:
            rubbing = rubbing_torques(self._contacts.limit, self._slides.T @ first, turning, self._phases)
            pull, third = (part + self._slides @ torque for part, torque in zip((pull, third), rubbing, strict=True))
        fast = 9 * turning[:, None] ** 2
        gap = (self.omega[:, None] ** 2 - fast) / fast
        soft = gap / (gap**2 + RESONANCE_DETUNING**2) / fast
        slaved_waves = active * soft * (third - self._projections(waves, turning, 3))
        share = np.abs(slaved_waves).max(axis=(0, 1)) / np.maximum(np.abs(z).max(axis=0), AMPLITUDE_FLOOR)
        waves = waves + self._waves(slaved_waves / np.hypot(1, share / THIRD_HARMONIC_MAX), turning, 3)
        force = active * (pull - self._projections(waves, turning, 1))[self.band, np.arange(len(z))]
        return np.asarray(-0.5j / turning[self.band] * force - 1j * self.detuning(turning) * z)

    def _split(self, z: Complexes) -> Complexes:
        """Amplitudes (C, S) by bands, (B, C, S)."""
        return np.where(self.member[..., None], z, 0j)

    def _waves(self, amplitudes: Complexes, turning: Floats, harmonic: int) -> Floats:
        """q, q' and q'' (3, half, S K) of amplitudes (B, C, S) in this harmonic of every band."""
        rate = 1j * harmonic * turning.T
        moving = _product(self.shapes, amplitudes).transpose(1, 2, 0)
        if self._brake:
            moving[0] /= 1 + self._brake / rate
        speed = rate * moving
        parts = np.array([moving, speed, rate * speed]).view(float)
        return (parts @ self._harmonics[harmonic]).reshape(3, len(moving), -1)

    def _projections(self, waves: Floats, turning: Floats, harmonic: int) -> Complexes:
        """2⟨φ_rᵀρ e^{−ihχ_b}⟩ (B, C, S) of a motion (3, half, S K)."""
        forces, parts = residual_forces(self.system, [waves])[0], self._harmonics[harmonic]
        points = parts.shape[1]
        means = (forces.reshape(len(forces), -1, points) @ parts.T).view(complex)
        harmonics = 2 / points * means.transpose(2, 0, 1)
        if self._brake:
            harmonics[:, 0] /= 1 + self._brake / (1j * harmonic * turning)
        return _product(self.shapes.T, harmonics)

    def _kicks(self, first: Complexes, turning: Floats, active: Booleans) -> tuple[Complexes, Complexes]:
        """The first and third harmonics of the escapements' torques in every band (B, C, S)."""
        joints = self._joints
        assert joints is not None
        weights = self._turns.T**2 @ active
        corner = joints.impulse[:, None] * weights / (2 * np.pi)
        torques = pulls(joints.impulse, joints.angle, corner, self._turns.T @ first, turning, self._phases)
        lead, three = (self._turns @ torque for torque in torques)
        return lead, three

    @cached_property
    def _contacts(self) -> Contacts | None:
        return contacts_of(self.system) if self.system.rubs else None

    @cached_property
    def _slides(self) -> Floats:
        """Relative rotation in every shape at the joints with dry friction, (C, J)."""
        assert self._contacts is not None
        return self._contacts.relative(self.shapes.T)

    def mixing(self, z: Complexes, turning: Floats) -> float:
        """How strongly several bands drive one escapement in z (C, S), as in `describing`; 0 without any."""
        return mixing_ratio(self._joints.angle, self._turns.T @ self._split(z), turning) if self._joints else 0.0

    def reach(self, z: Complexes) -> Floats:
        """The largest angle of the escapement that swings least in amplitudes z (C, S), over its own: below 1 no kicks.

        Of several bands the weaker ones are subtracted, as their phases pass through every value.  (S,), ∞ without any.
        """
        if self._joints is None:
            return np.full(z.shape[1:], np.inf)
        swing = np.abs(self._turns.T @ self._split(z))
        return np.asarray(((2 * swing.max(axis=0) - swing.sum(axis=0)) / self._joints.angle[:, None]).min(axis=0))

    @cached_property
    def _brake(self) -> float:
        """c/M (1/s) of a free cart."""
        cart = self.system.cart
        return cart.damping / self.system.total_mass if cart and not cart.stiffness else 0.0

    @cached_property
    def _phases(self) -> Complexes:
        """e^{iχ_b} (B, K) of every band at the points of the lattice."""
        points, steps = lattice(len(self.centre))
        return np.asarray(np.exp(2j * np.pi * np.outer(steps, np.arange(points)) / points))

    @cached_property
    def _harmonics(self) -> dict[int, Floats]:
        """The parts cos hχ_b and −sin hχ_b (2B, K) there, those of a band one after the other, by h."""
        turns = {harmonic: self._phases.conj() ** harmonic for harmonic in (1, 3)}
        return {
            harmonic: np.hstack((turn.real, turn.imag)).reshape(-1, turn.shape[1]) for harmonic, turn in turns.items()
        }

    @cached_property
    def member(self) -> Booleans:
        """Which modes belong to each band, (B, C)."""
        return np.asarray(self.band == np.arange(len(self.centre))[:, None])

    @cached_property
    def _joints(self) -> Escaping | None:
        return escaping(self.system) if self.system.has_escapements else None

    @cached_property
    def _turns(self) -> Floats:
        """Relative rotation in every shape at the joints with escapements, (C, J)."""
        assert self._joints is not None
        return self._joints.gamma(self.shapes.T)


def _product(matrix: Floats, columns: Complexes) -> Complexes:
    """The product of a real matrix and complex columns, by half of the operations that a complex matrix would take."""
    return np.asarray((matrix @ np.ascontiguousarray(columns).view(float)).view(complex))


def derivative(rate: Callable[[Complexes, Floats], Complexes], z: Complexes, turning: Floats) -> Floats:
    """The derivative of a rate by the real and imaginary parts of z (C,), (2C, 2C), by central differences.

    Of amplitudes (C, S) and turning rates (B, S) one for each, (S, 2C, 2C).
    """
    count, unit = len(z), np.eye(len(z))
    size = np.abs(z).max(axis=0)
    width = DIFFERENCE_STEP * np.where(size > 0, size, 1.0)[..., None]
    ways = width * np.hstack((unit, 1j * unit)).reshape(count, *[1] * (z.ndim - 1), 2 * count)
    places = z[..., None] + np.concatenate((ways, -ways), axis=-1)
    pace = np.broadcast_to(turning[..., None], (*turning.shape, 4 * count))
    values_up, values_down = np.split(rate(places, pace), 2, axis=-1)
    slope = (values_up - values_down) / (2 * width)
    return np.moveaxis(np.concatenate((slope.real, slope.imag)), 0, -2)


@cache
def lattice(count: int) -> tuple[int, tuple[int, ...]]:
    """The fewest points K, and the steps s (count,) of the phases 2π s k/K, that average products of ORDER factors.

    Products of an odd number of factors have no mean to be found: the forces are odd in the motion.
    """
    words = [word for word in product(range(-ORDER, ORDER + 1), repeat=count) if 0 < sum(map(abs, word)) <= ORDER]
    even_words = np.array([word for word in words if sum(word) % 2 == 0])
    for points in whole_numbers(2):
        for base in range(1, points):
            steps = tuple(pow(base, power, points) for power in range(count))
            if np.all(even_words @ steps % points):
                return points, steps
    raise AssertionError("unreachable")


@checked
def average(scene: Scene, system: System | None = None) -> AveragedEquations:
    """The averaged equations of a scene in the plane whose links all hang; `system` may be given.

    Raise ComputationError for other scenes, for dry friction on the rail, for quadratic drag, for more than 400 links
    or four bands, and for coordinates without a mode, such as those of some massless carts.
    """
    require(scene, "averaging")
    if scene.n_links > LINKS_MAX:
        raise ComputationError(f"averaged equations are limited to {LINKS_MAX} links, not {scene.n_links}")
    system, modes = system or system_of(scene), natural_modes(scene.conservative)
    phi = modes.matrix.real.take(modes.omega[modes.matrix.row] > 0)
    swinging = system.first if system.structure else bool(system.cart and system.cart.stiffness)
    if len(phi.row) < scene.n_links + swinging:
        why = "and something here moves freely" if system.structure else "a massless cart removes one"
        raise ComputationError(f"averaged equations need one mode for each coordinate; {why}")
    omega = modes.omega[phi.row]
    band = np.concatenate(([0], np.cumsum(omega[1:] > BAND_RATIO * omega[:-1])))
    if (count := int(band[-1]) + 1) > BANDS_MAX:
        raise ComputationError(f"averaged equations are limited to {BANDS_MAX} bands of frequencies, not {count}")
    return AveragedEquations(scene, system, modes, phi.shapes, phi.dual, omega, phi.row, band)
