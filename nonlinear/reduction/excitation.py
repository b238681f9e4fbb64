"""Mode shapes excited by a motion in a few other shapes.

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

import numpy as np

from modal.types import Floats, Ints
from nonlinear.reduction.residual import residual_forces
from nonlinear.system import Layout, Motion, System

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
