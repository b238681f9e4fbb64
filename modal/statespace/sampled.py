"""The modes of loops of feedback in samples: multipliers z of the motion over the period T of all samples, s = ln(z)/T.

Between samples the inputs u are held, and with those that wait for their delay as further states y,

    exp([[A, B], [0, 0]] τ) = [[Φ, Γ], [0, 1]],    y[k+1] = Φ y[k] + Γ u[k],    u[k] = −gains y[k − delay],

exactly [VanLoan1978]; samples of several periods follow each other up to the least common multiple of these.  Of the
branches of the logarithm that is taken in which places and rates at the samples turn, Im s ≈ Im(qᴴM q')/(qᴴM q).
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from itertools import pairwise
from math import lcm

import numpy as np
import scipy

from modal.assembly import Matrices, matrices
from modal.eigen import is_singular
from modal.eigen.dense import LARGEST_DAMPED, SINGULAR, refuse_beyond
from modal.errors import ComputationError
from modal.modes import Modes
from modal.modes.closed import ClosedLoops, ClosedSolution
from modal.scene import Scene
from modal.statespace.loops import Loop, loops_of
from modal.types import EPS, NOISE_OF_SUM, Booleans, Floats


@dataclass(frozen=True, eq=False)
class SampledLoops(ClosedLoops):
    """The source of all modes of a scene with loops in samples, whose other loops are closed in time."""

    scene: Scene
    route = "dense, from sample to sample"

    @cached_property
    def linear(self) -> Matrices:
        """M, K and D in SI units with the loops closed that have no samples."""
        return matrices(
            self.scene.replace(feedback=tuple(loop for loop in self.scene.feedback if not loop.sample_time))
        )

    @cached_property
    def loops(self) -> list[Loop]:
        """The loops in samples, input by input."""
        return [loop for loop in loops_of(self.scene) if loop.entry.sample_time]

    @cached_property
    def clock(self) -> tuple[float, list[int]]:
        """A time (s), and of how many of it each loop's sample time consists."""
        return common_clock([loop.entry.sample_time or 0.0 for loop in self.loops])

    @property
    def period(self) -> float:
        """The common period (s) of all samples."""
        return self.clock[0] * lcm(*self.clock[1])

    @cached_property
    def feels(self) -> Booleans:
        """Which states (2 q,) anything depends on."""
        n = len(self.M)
        rows = np.vstack((np.hstack((self.linear.K, self.linear.D)), *(loop.gains @ loop.rows for loop in self.loops)))
        place, rate = np.split(rows.any(axis=0), [n])
        return np.concatenate((place, place | rate))

    @cached_property
    def rates(self) -> Floats:
        """[[A, B], [0, 0]] of (q, q', held inputs)."""
        n, forces = len(self.M), np.array([loop.push for loop in self.loops]).T
        rates = np.zeros((2 * n + len(self.loops), 2 * n + len(self.loops)))
        rates[:n, n : 2 * n] = np.eye(n)
        rates[n : 2 * n] = np.linalg.solve(self.linear.M, np.hstack((-self.linear.K, -self.linear.D, forces)))
        return rates

    @cached_property
    @np.errstate(all="ignore")
    def monodromy(self) -> Floats:
        """The transition (S, S) over a period of (q, q', inputs), those of each loop the last first."""
        if is_singular(self.M):
            raise ComputationError(SINGULAR)
        states, (tick, counts) = 2 * len(self.M), self.clock
        ends = states + np.cumsum([loop.entry.delayed_samples + 1 for loop in self.loops])
        refuse_beyond(LARGEST_DAMPED, int(ends[-1]), "samples and delays of feedback")
        moving = np.append(np.arange(states), ends - 1)
        end = lcm(*counts)
        instants = sorted({time for count in counts for time in range(0, end, count)})
        flows = {span: scipy.linalg.expm(self.rates * tick * span) for span in set(np.diff([*instants, end]).tolist())}
        P = np.eye(int(ends[-1]))
        for time, following in pairwise([*instants, end]):
            for loop, count, first, last in zip(self.loops, counts, [states, *ends], ends, strict=False):
                if time % count == 0:
                    P[first:last] = np.vstack((-(loop.gains @ loop.rows) @ P[:states], P[first : last - 1]))
            P[moving] = flows[following - time] @ P[moving]
        if not np.isfinite(P).all():
            raise ComputationError("sampled feedback: a fast instability overflows from sample to sample")
        return P

    @cached_property
    def solution(self) -> ClosedSolution:
        """The poles from the largest multipliers, as many as there are poles of loops that never wait."""
        P, n, T = self.monodromy, len(self.M), self.period
        feels = np.append(self.feels, np.ones(len(P) - 2 * n, dtype=bool))
        inner, (scale, _) = scipy.linalg.matrix_balance(P[np.ix_(feels, feels)], permute=False, separate=True)
        z, right = np.linalg.eig(inner)
        condition = np.linalg.norm(np.linalg.pinv(right), axis=1) * np.linalg.norm(right, axis=0)
        residual = np.linalg.norm(inner @ right - z * right, axis=0) / np.linalg.norm(inner, 2)
        largest = np.argsort(-np.abs(z), kind="stable")[: max(self.feels.sum(), np.sum(np.abs(z) >= 1))]
        chosen = largest[z[largest].imag >= 0]
        z, right = z[chosen], scale[:, None] * right[:, chosen]
        motion = np.zeros((len(P), len(z)), dtype=complex)
        motion[feels] = right
        outer, pulls = P[np.ix_(~feels, ~feels)], P[np.ix_(~feels, feels)] @ right
        for k, value in enumerate(z):
            motion[~feels, k] = np.linalg.solve(value * np.eye(len(outer)) - outer, pulls[:, k])
        momenta = self.linear.M @ motion[:n]
        with np.errstate(all="ignore"):
            turning = ((momenta.conj() * motion[n : 2 * n]).sum(0) / (momenta.conj() * motion[:n]).sum(0)).imag
            turns = np.round((turning * T - np.angle(z)) / (2 * np.pi)) * (z.imag > 0)
            value = (np.log(np.abs(z)) + 1j * (np.angle(z) + 2 * np.pi * np.nan_to_num(turns))) / T
            rounding = 4 * len(inner) * EPS * condition[chosen] * np.linalg.norm(inner, 2)
            turned = 1 + T * np.abs(np.linalg.eigvals(self.rates)).max()  # the exponential errs as the plant turns
            error = EPS + rounding * turned / np.abs(z * T * value)
        shapes = np.where(value.imag < 0, motion[:n].conj(), motion[:n]) / self.unit[:, None]
        upper = np.asarray(np.where(value.imag < 0, value.conj(), value) / self.rate, dtype=complex)
        return self.whole(upper, np.asarray(shapes), error, residual[chosen])

    @property
    def note(self) -> str:
        """The heading of these poles."""
        return (
            f"Feedback in samples: s = ln(z)/T of the multipliers z from sample to sample, T = {self.period:.4g} s; "
            "those of samples and delays that decay fastest are omitted."
        )


def sampled_loops(modes: Modes) -> SampledLoops:
    """The source of the modes of a scene."""
    return SampledLoops.of(modes.natural, modes.units, modes.matrices, scene=modes.scene)


def common_clock(periods: list[float], most: int = 1000) -> tuple[float, list[int]]:
    """The longest time of which all periods (s) are multiples, and the multiples.

    ComputationError where a loop had more than this many samples before all meet again.

    >>> common_clock([0.02, 0.05])[1]
    [2, 5]
    """
    shortest = min(periods)
    ratios = [Fraction(period / shortest).limit_denominator(most) for period in periods]
    parts = lcm(*(ratio.denominator for ratio in ratios))
    counts = [int(ratio * parts) for ratio in ratios]
    error = max(abs(ratio * shortest / period - 1) for ratio, period in zip(ratios, periods, strict=True))
    if error > NOISE_OF_SUM or lcm(*counts) > most * min(counts):
        times = ", ".join(f"{period:g}" for period in sorted(set(periods)))
        raise ComputationError(f"sampled feedback: the sample times {times} s do not meet within {most} samples")
    return shortest / parts, counts
