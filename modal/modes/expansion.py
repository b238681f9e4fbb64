"""The motion of a mode at finite amplitude, by expansion in the amplitude: any planar scene, about any equilibrium.

With τ = Ω t and q = q₀ + a φ cos τ + a² q₂(τ) + a³ q₃(τ) + …, the equations of motion at each order in a are (the
method of Lindstedt and Poincaré [Nayfeh1979, §2.3], at the frequency Ω of the motion itself)

    K q_m + Ω D q_m' + Ω² M q_m'' = −N_m,      (Ω² − ω²) φᵀMφ = a² φᵀN₃ + a⁴ φᵀN₅ + …   in the first harmonic, cos τ,

N_m being the nonlinear terms of order m in the lower orders: the mean over aᵐ of the forces at complex amplitudes on a
circle. Supports that turn or move down, springs between points, constant forces and joint laws enter exactly. At Ω = ω
the first term is 2κω² a² φᵀMφ; at Ω = ω (1 ± 0.01) both give the amplitude there. A mode near 1, 2 or 3 times the
frequency makes the response and the second term large.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from math import copysign, degrees, dist, inf, nan, radians, sqrt
from typing import Any, NamedTuple

import numpy as np

from modal.assembly import Hanging, Rig, scene_squares
from modal.eigen import ONE_PERCENT, one_percent_amplitude
from modal.modes.mode import PROMISED_ERROR
from modal.scene import Scene, places_of
from modal.structure import CarrierEnd, End, GroundEnd, LinkEnd, drawn_together
from modal.types import EPS, IMAGINARY_STEP, Complexes, Floats, Ints

Numbers = Floats | Complexes

SAMPLES = 12
"""Cost: instants of a period, exact for five harmonics, and amplitudes on the circle; more would find nothing else."""


class Expansion(NamedTuple):
    """κ (1/rad², of the largest angle of the linear shape), and the largest angle (deg) at which ω is 1 % off.

    This is the angle of the actual motion; `last` is the contribution of the fifth order, and `harmonic` the one in
    which the other modes respond most, 1, 2 or 3. NaN if there is no such angle.
    """

    kappa: float
    one_percent_deg: float
    last: float = 0.0
    harmonic: int = 1

    @property
    def converges(self) -> bool:
        """Whether higher orders, about the square of the last one, change the angle by less than PROMISED_ERROR."""
        return self.last**2 <= PROMISED_ERROR * (1 - radians(self.one_percent_deg) ** 2)


class PointSpring(NamedTuple):
    """A spring (N/m) between two ends, with its length (m) as drawn."""

    first: End
    second: End
    stiffness: float
    length: float


@dataclass(frozen=True, eq=False)
class FiniteMotion:
    """The nonlinear equations of a planar scene, for its modes at finite amplitude; `rig` in SI units."""

    scene: Scene
    rig: Rig

    @cached_property
    def hanging(self) -> Hanging:
        """The pendula, each copy by itself, and their supports."""
        return Hanging(self.rig.on_structure)

    @cached_property
    def matrices(self) -> tuple[Floats, Floats, Floats]:
        """M, K and D over the coordinates of the supports of the pendula and all links."""
        M, K, D = scene_squares(self.hanging.rig).matrices
        return M, K, D

    @cached_property
    def rest(self) -> Floats:
        """The equilibrium of all coordinates."""
        return np.concatenate([np.zeros(self.hanging.structure.size), self.rig.rest_angles])

    @cached_property
    def links(self) -> tuple[Floats, ...]:
        """Mass, length, distance of the centre and moment of inertia about it of all links, (L, 1, 1) each."""
        kinds = [(self.rig.blocks[block], column) for block, column in self.hanging.kinds.tolist()]
        return tuple(
            np.concatenate([getattr(block, name)[:, column] for block, column in kinds])[:, None, None]
            for name in ("mass", "length", "centre", "inertia")
        )

    @cached_property
    def chains(self) -> list[tuple[CarrierEnd, Ints]]:
        """The links (n, P) of the pendula of n links at each pivot."""
        groups: dict[tuple[CarrierEnd, int], list[int]] = {}
        for pivot, (top, end) in zip(self.hanging.structure.pivots, pairwise(self.hanging.first.tolist()), strict=True):
            groups.setdefault((pivot, end - top), []).append(top)
        return [(pivot, np.arange(n)[:, None] + np.array(tops)) for (pivot, n), tops in groups.items()]

    @cached_property
    def springs(self) -> list[PointSpring]:
        """The springs between points."""
        kinds = self.hanging.kinds.tolist()
        turned = np.concatenate([np.where(self.rig.blocks[block].sigma[:, k] > 0, 0.0, np.pi) for block, k in kinds])
        places = _Balance(self, np.concatenate([np.zeros(self.hanging.structure.size), turned])[:, None, None])
        springs = []
        for spring in self.hanging.structure.springs:
            if not spring.torsion:
                first, second = (places.of_end(end) for end in spring.ends)
                first, second = second if first is None else first, first if second is None else second
                drawn = [(float(place[0].item()), float(place[1].item())) for place in (first, second)]
                length = 0.0 if drawn_together(*drawn) else dist(*drawn)
                pairs = zip(spring.ends, drawn, strict=True)
                ends = [GroundEnd(place) if end == GroundEnd(None) else end for end, place in pairs]
                springs.append(PointSpring(ends[0], ends[1], spring.stiffness, length))
        return springs

    @cached_property
    def loads(self) -> list[tuple[LinkEnd, tuple[float, float]]]:
        """The constant forces (N along, N down) on points of links."""
        return [
            (
                LinkEnd(place.link, place.below),
                (force.amplitude, 0.0) if force.direction == "horizontal" else (0.0, -force.amplitude),
            )
            for force in self.scene.force
            if force.kind == "constant" and force.direction != "torque"
            for place in places_of(self.scene, force.on)
        ]

    @cached_property
    def joint_laws(self) -> list[tuple[int, int | None, Any]]:
        """Joint laws with a potential, with the coordinates of the link and of the link above (None: fixed)."""
        structure, laws, number = self.hanging.structure, list[tuple[int, int | None, Any]](), 0
        for pendulum, pivot in zip(self._pendula, structure.pivots, strict=True):
            upper = structure.angle_of(pivot.carrier)
            for link in pendulum:
                at = structure.size + number
                laws += [(at, upper, part) for part in link.laws if part.law.has_potential]
                upper, number = at, number + 1
        return laws

    @property
    def is_known(self) -> bool:
        """Whether joint laws without a potential only damp or drive."""
        laws = [part.law for pendulum in self.scene.pendulum for link in pendulum.links for part in link.laws]
        return all(law.has_potential or law.is_dissipative or law.is_drive for law in laws)

    @property
    def _pendula(self) -> list[list[Any]]:
        """The links of every pendulum, counting copies."""
        return [list(pendulum.chain) for pendulum in self.scene.hanging]

    def reach(self, phi: Floats) -> float:
        """Return the largest motion of a shape, in radians or relative to a spring's length."""
        moved = _Balance(self, (self.rest + IMAGINARY_STEP * 1j * phi)[:, None, None])
        shares = [float(np.abs(phi[self.hanging.structure.size :]).max())]
        for first, second, _, length in self.springs:
            if length:
                change = moved.of_end(second).imag - moved.of_end(first).imag
                shares.append(float(np.abs(change).max()) / IMAGINARY_STEP / length)
        return max(shares)

    def expand(self, phi: Floats, omega: float, *, is_single: bool = True) -> Expansion:
        """The expansion of the motion in a shape φ (n,) with a largest angle of 1 and its ω (rad/s).

        For shapes that share a frequency only κ is computed, and whether they share a support.
        """
        try:
            shifts, _, pushes = self._orders(phi, omega, omega, 3)
        except np.linalg.LinAlgError:  # exactly at 1:2
            return Expansion(nan, nan, nan, 2)
        kappa = shifts[0] / 2
        if not is_single or not kappa:
            on_carriers = np.stack(pushes)[:, : self.hanging.structure.size]
            is_shared = not is_single and bool((np.abs(on_carriers) > sqrt(EPS)).any())
            return Expansion(kappa, one_percent_amplitude(kappa), inf if is_shared else 0.0)
        ratio = 1 + copysign(ONE_PERCENT, kappa)
        (third, fifth), parts, _ = self._orders(phi, omega, ratio * omega, 5)
        square = (ratio**2 - 1) / third
        last = fifth * square / third
        sizes = [sqrt(abs(square / (1 + last))) ** m for m in (1, 2, 3)]
        waves = np.fft.rfft(sizes[1] * parts[1] + sizes[2] * parts[2])[:, 1:4]
        harmonic = 1 + int(np.einsum("ik,ij,jk->k", waves.conj(), self.matrices[0], waves).real.argmax())
        if not (square > 0 and abs(last) < 1):
            return Expansion(kappa, nan, nan, harmonic)
        motion = sum(size * part[self.hanging.structure.size :] for size, part in zip(sizes, parts, strict=False))
        return Expansion(kappa, degrees(float(np.abs(motion).max())), last, harmonic)

    def _orders(
        self, phi: Floats, omega: float, driven: float, highest: int
    ) -> tuple[list[float], list[Floats], list[Floats]]:
        """At Ω = `driven` the shifts of Ω²/ω² per a², a⁴, …; q₁, q₂, … (n, T); N₂, N₃, … over ω² φᵀMφ."""
        M, K, D = self.matrices
        inertia = float(phi @ M @ phi) * omega**2
        tau = 2 * np.pi * np.arange(SAMPLES) / SAMPLES
        radius = EPS ** (1 / (highest + SAMPLES)) / self.reach(phi)  # where rounding equals the truncation error
        a = radius * np.exp(2j * np.pi * np.arange(SAMPLES) / SAMPLES)[:, None]
        parts, pushes = [phi[:, None] * np.cos(tau)], list[Floats]()
        for order in range(2, highest + 1):
            q = self.rest[:, None, None] + sum(a**m * part[:, None] for m, part in enumerate(parts, start=1))
            pushes.append((_Balance(self, q).forces(driven) / a**order).mean(1).real / inertia)
            if order == highest:
                break
            harmonics: Numbers = np.fft.rfft(pushes[-1], axis=1) * inertia
            if not D.any():
                harmonics = harmonics.real  # all in phase
            motion = np.zeros_like(harmonics)
            for k in range(order % 2, order + 1, 2):
                stiffness = K - max(k**2, sqrt(EPS)) * driven**2 * M
                if D.any():
                    stiffness = stiffness + 1j * k * driven * D
                if k == 1:
                    stiffness = stiffness + np.outer(M @ phi, M @ phi) * omega**4 / inertia
                    harmonics[:, k] -= M @ phi * (phi @ harmonics[:, k]) * omega**2 / inertia
                motion[:, k] = np.linalg.solve(stiffness, -harmonics[:, k])
            parts.append(np.fft.irfft(motion, SAMPLES, axis=1))
        shifts = [float(2 * (phi @ push @ np.cos(tau)) / SAMPLES) for push in pushes]
        return shifts[1::2], parts, pushes


_DERIVATIVE: Floats = np.fft.irfft(-np.fft.rfft(np.eye(SAMPLES)) * np.arange(SAMPLES // 2 + 1) ** 2, SAMPLES)
"""The second derivative with respect to τ of values (…, T), as a matrix at right."""


class _Balance:
    """Where everything is at coordinates (n, A, T), and the forces there, added up to those on the coordinates."""

    def __init__(self, motion: FiniteMotion, q: Numbers) -> None:
        self.motion, self.q, self.structure = motion, q, motion.hanging.structure
        self.eta, self.theta = q[: self.structure.size], q[self.structure.size :]
        self.u = np.stack([np.sin(self.theta), np.cos(self.theta)])
        self.on_coordinates = np.zeros_like(q)
        self.force, self.moment = np.zeros_like(self.u), np.zeros_like(self.u)
        self.joints = np.zeros_like(self.u)
        steps = motion.links[1] * self.u
        for pivot, links in motion.chains:
            above = np.cumsum(steps[:, links], axis=1) - steps[:, links]
            self.joints[:, links] = above + self._point(pivot)[0][:, None, None]

    def _point(self, end: CarrierEnd) -> tuple[Any, list[tuple[int, Any]]]:
        """The place (2, A, T) of a point of a support, and its slope by every coordinate."""
        body, offset = self.structure.carriers[end.carrier], self.structure.offsets[end.carrier]
        eta = self.eta[offset : offset + body.size]
        moving = body.moving(end.where, list(eta), [0.0] * body.size)
        place = np.stack([part + np.zeros(self.q.shape[1:]) for part in moving.place])
        return place, list(enumerate(moving.slopes, start=offset))

    def of_end(self, end: End) -> Any:
        """The place (2, A, T) of an end of a spring; None for the ground at the other end."""
        if isinstance(end, GroundEnd):
            return None if end.place is None else np.array(end.place)[:, None, None] + np.zeros(self.q.shape[1:])
        if isinstance(end, CarrierEnd):
            return self._point(end)[0]
        return self.joints[:, end.link] + self._below(end) * self.u[:, end.link]

    def _below(self, end: LinkEnd) -> float:
        return float(self.motion.links[2][end.link].item() if end.below is None else end.below)

    def forces(self, driven: float) -> Any:
        """All of them over a period of Ω = `driven`, (n, A, T)."""
        self._masses(driven)
        self._springs()
        self._laws()
        return self._handed_up()

    def _masses(self, driven: float) -> None:
        """The power of accelerations and weights, and the energy that supports store."""
        mass, _, centre, inertia = self.motion.links
        acceleration, gravity = driven**2 * _DERIVATIVE, np.array([0.0, self.motion.rig.gravity])
        self.force += mass * ((self.joints + centre * self.u) @ acceleration - gravity[:, None, None, None])
        self.moment += centre * self.force
        self.on_coordinates[self.structure.size :] += inertia * (self.theta @ acceleration)
        for carrier, body in enumerate(self.structure.carriers):
            if body.M is None and body.path is not None:
                end, offset = CarrierEnd(carrier, body.centre), self.structure.offsets[carrier]
                self._push(end, body.mass * (self._point(end)[0] @ acceleration - gravity[:, None, None]))
                stored = body.path.forces(list(self.eta[offset : offset + body.size]), body.values)
                for k, force in enumerate(stored or ()):
                    self.on_coordinates[offset + k] += force.first

    def _springs(self) -> None:
        """Springs between points and constant forces."""
        for first, second, stiffness, length in self.motion.springs:
            reach = self.of_end(second) - self.of_end(first)
            pull = stiffness * reach
            if length:
                pull = pull * (1 - length / np.sqrt((reach * reach).sum(0)))
            self._push(first, -pull)
            self._push(second, pull)
        for end, (along, down) in self.motion.loads:
            self._push(end, -np.array([along, down])[:, None, None])

    def _laws(self) -> None:
        """Laws of joints."""
        for at, upper, part in self.motion.joint_laws:
            above = 0.0 if upper is None else self.q[upper] - self.motion.rest[upper]
            angle = self.q[at] - self.motion.rest[at] - above
            torque = part.law.torques(angle, 0.0 * angle, part.numbers)[0]
            self.on_coordinates[at] -= torque
            if upper is not None:
                self.on_coordinates[upper] += torque

    def _push(self, end: End, force: Any) -> None:
        """A force (2, A, T) on a point."""
        if isinstance(end, CarrierEnd):
            for at, (along, down) in self._point(end)[1]:
                self.on_coordinates[at] += along * force[0] + down * force[1]
        elif isinstance(end, LinkEnd):
            self.force[:, end.link] += force
            self.moment[:, end.link] += self._below(end) * force

    def _handed_up(self) -> Any:
        """Return the forces on all coordinates: every link passes the force from below on to the one above."""
        length, normal = self.motion.links[1], np.stack([self.u[1], -self.u[0]])
        for pivot, links in self.motion.chains:
            force = self.force[:, links]
            carried = np.cumsum(force[:, ::-1], axis=1)[:, ::-1]
            moment = self.moment[:, links] + length[links] * (carried - force)
            self.on_coordinates[self.structure.size + links] += (normal[:, links] * moment).sum(0)
            self._push(pivot, carried[:, 0].sum(1))
        return self.on_coordinates
