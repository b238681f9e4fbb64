"""The residual of the equations of motion for any motion: the forces that would make it exact.

With the direction u of every link and its tangents t = ∂u/∂q, a the acceleration of its upper joint less gravity,

    ρ_i = t_i·(A_ii u_i'' + b_i a_i + l_i Σ_{j>i} b_j u_j'') − Q_i,     a_i = x'' e_x − g e_z + Σ_{j<i} l_j u_j'',
    ρ_x = M x'' + c_c x' + k_c x + e_x·Σ b_j u_j'',

Q_i of springs, dampers and drives at the joints; sums run down and up each chain, so O(links) operations per instant.
On a structure ρ = M (q'' − a), a being the accelerations of the equations of motion.
The coordinates are those of `nonlinear.reduction.modal_coordinates`: θ in the plane, in space p = θ (cos φ, sin φ)
from the rest with

    u = σ (s p, cos θ),    ∂u/∂p_k = σ (s e_k + r p_k p, −s p_k),    h = p·p',    k = −(s + 3 r)/θ²,
    u'' = σ (s p'' + 2 r h p' + [r (|p'|² + p·p'') + k h²] p,  −s (|p'|² + p·p'') − r h²).

All arrays have times on their last axis; vectors have their components on the first.

Mode shapes excited by a motion in a few other shapes.

Every shape s outside a motion in the span of some shapes gets the residual ρ of that motion in the full equations
(`nonlinear.reduction.residual`), which is cubic in the amplitudes, and to first order obeys, with φᵀMφ = 1,

    η_s'' + ω_s² η_s = −φ_sᵀ ρ(t),     η_s(0), η_s'(0) of the start.

One pass along the motion therefore finds every resonance ω_s = ±ω_i ± ω_j ± ω_k of moving shapes, by whatever link they
are coupled, and every shape that no force reaches, as those of other pendula on a fixed support.  With
z = η' + iωη and f linear between samples h apart, E = exp(iωh),

    z_k = E z_{k−1} − (E − 1)/(iω) f_{k−1} − (E − 1 − iωh)/((iω)² h) (f_k − f_{k−1}),

which is exact for a constant f however fast the shape.  Dampers are omitted of it: they make the response smaller.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from modal.scene.doors import require_type
from modal.types import Floats, Ints
from nonlinear.dynamics.forces import cart_force, drag, link_torques, modal_drag, plane_drag, relative
from nonlinear.dynamics.spatial import generalized_forces, joint_moments
from nonlinear.dynamics.variational import Variational
from nonlinear.reduction.modal_coordinates import SERIES_ANGLE, factors
from nonlinear.system import Group, Layout, Motion, System


def residual_forces(system: System, planes: list[Floats]) -> list[Floats]:
    """The forces ρ (n, T) in each vertical plane, from its q, q' and q'' (3, n, T), deflections from the rest.

    One plane, or of a system in space the ones along the rail (with the cart, N; the links' in N m) and across it.
    """
    require_type("system", system, "System")
    if system.structure is not None:
        return [_on_structure(system, planes[0])]
    on = system.first
    starts = [on, 0][: len(planes)]
    residual = [np.zeros(plane.shape[1:]) for plane in planes]
    pull = np.zeros(planes[0].shape[-1])
    start = np.zeros((2 + system.spatial, len(pull)))
    start[0], start[-1] = (planes[0][2, 0] if on else 0.0), -system.gravity
    for group in system.groups:
        deflections = [plane.take(first + group.index, axis=1) for plane, first in zip(planes, starts, strict=True)]
        second, forces, braking = (_spatial if system.spatial else _planar)(
            group, deflections, start, planes[0][1, 0] * on
        )
        pull += group.block.b.ravel() @ second[0].reshape(group.block.b.size, -1)
        for plane_residual, first, force in zip(residual, starts, forces, strict=True):
            plane_residual[first:][group.index] = force
        if group.has_drag and on:
            residual[0][0] -= braking
    if system.cart:
        x, speed, acceleration = planes[0][:, 0]
        residual[0][0] += system.total_mass * acceleration + pull - sum(cart_force(system, x, speed))
    if system.modal_damping is not None:
        residual[0] -= modal_drag(system, planes[0][1])
    return residual


def _on_structure(system: System, plane: Floats) -> Floats:
    """ρ = M(q) (q'' − a) (half, T), a being the accelerations of the equations of motion."""
    equations, (q, rate, turn) = _equations_of(system), plane
    q = q + system.coordinates_at_rest[:, None]
    return equations.momenta(q, turn - equations.derivative(0.0, np.concatenate((q, rate)))[len(q) :])


_equations_of = lru_cache(maxsize=16)(Variational)
"""The equations of a system, written once for all evaluations."""


def _planar(group: Group, deflections: list[Floats], start: Floats, cart_rate: Floats) -> tuple[Floats, Any, Any]:
    """U'' (2, n, P, T), ρ (1, n, P, T), and the force of drag on the cart (T,)."""
    q, rate, turn = deflections[0]
    theta = q + group.rest[..., None]
    tangent = np.empty((2, *theta.shape))
    np.cos(theta, out=tangent[0])
    np.negative(np.sin(theta), out=tangent[1])
    inward, second = rate**2, turn * tangent
    second[0] += inward * tangent[1]
    second[1] -= inward * tangent[0]
    sideways, up = tangent * _inertial(group, second, start)
    forces = sideways + up
    if group.has_rotors:
        torques = group.block.rotor[..., None] * relative(turn)
        forces += torques
        forces[:-1] -= torques[1:]
    if group.has_joint_torques:
        forces -= link_torques(group, theta, rate)
    braking: Any = 0.0
    if group.has_drag:
        external = plane_drag(group, theta, rate, (cart_rate, 0.0))
        braking = external.along_rail
        forces -= external.generalized_forces
    return second, forces[None], braking


def _spatial(group: Group, deflections: list[Floats], start: Floats, cart_rate: Floats) -> tuple[Floats, Any, Any]:
    """U'' (3, n, P, T), ρ (2, n, P, T), and the force of drag on the cart (T,)."""
    p, rate, turn = np.stack(deflections, axis=1)
    theta, sigma = np.hypot(*p), group.block.sigma[..., None]
    s, r = factors(theta)
    k = np.where(theta < SERIES_ANGLE, 1 / 15 - theta**2 / 210, -(s + 3 * r) / np.maximum(theta, SERIES_ANGLE) ** 2)
    h, twice = _dot(p, rate), _dot(rate, rate) + _dot(p, turn)
    flat = s * turn + 2 * r * h * rate + (r * twice + k * h**2) * p
    second = sigma * np.array([*flat, -s * twice - r * h**2])
    forces = _inertial(group, second, start)
    u, w = (sigma * np.array(part) for part in ([*(s * p), np.cos(theta)], [*(s * rate + r * h * p), -s * h]))
    braking: Any = 0.0
    if group.sprung or group.has_dampers:
        forces -= generalized_forces(joint_moments(group, u, w), u)
    if group.has_drag:
        external = drag(group, w, (cart_rate, 0.0))
        braking = external.along_rail
        forces -= external.generalized_forces
    return second, sigma * (s * forces[:2] + (r * _dot(p, forces[:2]) - s * forces[2]) * p), braking


def _inertial(group: Group, second: Any, start: Floats) -> Any:
    """A_ii u_i'' + b_i a_i + l_i Σ_{j>i} b_j u_j'', (d, n, P, T), in one pass down and one up."""
    l, b, A = (values[..., None] for values in (group.block.length, group.block.b, group.block.diagonal))
    forces, a, pull = A * second, start[:, None], 0.0
    for i in range(group.n):
        forces[:, i] += b[i] * a
        a = a + l[i] * second[:, i]
    for i in reversed(range(group.n)):
        forces[:, i] += l[i] * pull
        pull = pull + b[i] * second[:, i]
    return forces


def _dot(a: Any, b: Any) -> Any:
    return np.sum(a * b, axis=0)


BLOCK = 64
"""Cost: samples between two values of the largest response so far, the least of any (benchmarks/few_modes.py)."""
SAMPLES_PER_PERIOD = 16
"""Tolerance: of the fastest oscillation, between which forces and angles are followed to 1e-4 of them."""


@dataclass(frozen=True, eq=False)
class ExcitedShapes:
    """How far the shapes outside a motion move: `peaks` (B, S), the largest |η| of each within the first `ends` (B,) s.

    `shapes` (L, S) are the angles of every link in each shape (rad).
    """

    ends: Floats
    peaks: Floats
    shapes: Floats

    @property
    def angles(self) -> Floats:
        """The largest angle (rad) of any link in each shape over the whole time, (S,)."""
        return np.asarray(self.peaks[-1] * np.abs(self.shapes).max(axis=0, initial=0.0))

    def sum(self, times: Floats) -> Floats:
        """The largest angle (rad) to which all can add up so far, (T,); beyond the end it grows as a resonance does."""
        totals = (self.peaks @ np.abs(self.shapes).T).max(axis=1)
        within = np.minimum(np.searchsorted(self.ends, times), len(self.ends) - 1)
        return np.asarray(totals[within] * np.maximum(1.0, times / self.ends[-1]))


def excite(
    system: System, times: Floats, motion: Motion, shapes: Floats, omega: Floats, start: Floats
) -> ExcitedShapes:
    """The response of shapes (n, S) of natural frequencies `omega` (S,) in rad/s to a plane motion at even times (T,).

    `start` (2, S) are their η and η' at the start.  They oscillate: no ω is zero.
    """
    on = system.first
    q, v = np.split(Layout.of(system, works=False).rows(motion), 2, axis=1)
    q = q - system.coordinates_at_rest
    deflections = np.stack((q, v, np.gradient(v, times, axis=0, edge_order=2))).transpose(0, 2, 1)
    step = float(times[1] - times[0])
    turn = 1j * omega
    E = np.exp(turn * step)
    hold = (E - 1) / turn
    ramp = (hold - step) / (turn * step)
    z = start[1] + turn * start[0]
    largest, peaks, ends, previous = np.abs(start[0]), [], [], None
    for first in range(0, len(times), BLOCK):
        rows = slice(first, first + BLOCK)
        forces = residual_forces(system, [deflections[:, :, rows]])[0].T @ shapes
        for force in forces:
            if previous is not None:
                z = E * z - hold * previous - ramp * (force - previous)
            previous = force
            np.maximum(largest, np.abs(z.imag) / omega, out=largest)
        peaks.append(largest.copy())
        ends.append(times[rows][-1] - times[0])
    return ExcitedShapes(np.array(ends), np.array(peaks), shapes[on:])


def dominant_shapes(angles: Floats, share: float) -> Ints:
    """The fewest whose angles (S,) leave no more than a share of the sum of all."""
    falling = np.argsort(-angles, kind="stable")
    remainders = np.cumsum(angles[falling][::-1])[::-1]
    return np.sort(falling[remainders > share * angles.sum()])
