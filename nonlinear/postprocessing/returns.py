"""Returns of a motion to a section: whether and after how many it closes, or whether it has a second, slow frequency.

With y_n the states in which a motion passes the section, n = 0 … K − 1, it is periodic where y_{n+p} = y_n.  On a torus

    y_n = Σ_k a_k e^{2πikνn},     0 < ν < 1,

a function of one phase that gains ν of a turn from return to return; in chaos no such function is near the record.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import sqrt
from typing import NamedTuple

import numpy as np
import scipy

from modal.types import Floats, Ints
from nonlinear.integration import Trajectory
from nonlinear.integration.within import quintic
from nonlinear.postprocessing.reaction_forces import states_and_slopes
from nonlinear.system import State, System, translations

JUDGED_STROBES = 50
"""Limit: stroboscopic samples by which a settled motion is judged: "an attractor takes 50 periods"."""
REPEAT_PERIODS_MAX = 16
"""Limit: the longest period of a motion in those of the drives, beyond which it does "not repeat within 16"."""
REPEAT_GAP_MAX = 1e-4
"""Tolerance: in natural units, within which a motion repeats: a decay of ten e-folds leaves 5e-5."""
APPROACH_RATIO_MAX = 0.9
"""Tolerance: of its distance from a shorter period, which a motion keeps: one that still approaches it loses more in
50 periods."""
ATTRACTOR_GAP_MIN = 3e-3
"""Tolerance: in natural units, from which on samples belong to two attractors: a settled motion is within 1e-4."""


class Returns(NamedTuple):
    """Passages of a section at `times` (K,) in s: angles of links and rates (K, L), place and speed of the cart (K,).

    On a structure its coordinates and their rates, (K, d) each, follow in `states`.
    """

    times: Floats
    states: tuple[Floats, ...]

    def state(self, number: int) -> State:
        """One of them."""
        links, rates, cart, speed, *carried = (part[number] for part in self.states)
        return State(links, rates, float(cart), float(speed), *carried)

    @property
    def mean_time(self) -> float:
        """From one to the next (s)."""
        return float(self.times[-1] - self.times[0]) / (len(self.times) - 1)


def returns_of(trajectory: Trajectory, link: int = 0) -> Returns:
    """Where a link, counted from 0, passes its angle at rest to the right, at any turn.

    Between samples coordinates are quintic, from y and y' at both: with 12 samples a period they err by 1e-6.  The run
    is in the plane and free of dry friction, hoists and forces that `trajectory.equations` add.
    """
    layout, rows, slopes = states_and_slopes(trajectory)
    half, row = layout.half, layout.first + link
    from_rest = rows[:, row] - trajectory.system.rest[link]
    turns = np.floor((from_rest + np.pi) / (2 * np.pi))
    aside = from_rest - 2 * np.pi * turns
    at = np.flatnonzero((aside[:-1] < 0) & (aside[1:] >= 0) & (turns[:-1] == turns[1:]))
    h = np.diff(trajectory.times)[at, None]
    q, v, a = rows[:, :half], rows[:, half : 2 * half], slopes[:, half : 2 * half]
    powers = quintic(h, q[at], q[at + 1], v[at], v[at + 1], a[at], a[at + 1])
    x = powers[:, :, row].copy()
    x[0] = aside[at]
    order = np.arange(6)[:, None]
    part = aside[at] / (aside[at] - aside[at + 1])
    for _ in range(4):  # Newton's method, from the chord on
        slope = np.sum(order[1:] * x[1:] * part ** (order[1:] - 1), axis=0)
        part = np.clip(part - np.sum(x * part**order, axis=0) / slope, 0.0, 1.0)
    steps = part**order
    places = np.einsum("kcj,kc->cj", powers, steps)
    rates = np.einsum("kcj,kc->cj", powers[1:], order[1:] * steps[:-1]) / h
    motion = layout.read(np.hstack((places, rates, np.zeros((len(at), layout.size - 2 * half)))))
    carried = (motion.supports, motion.support_rates) if layout.is_structured else ()
    states = (motion.links, motion.link_rates, motion.cart, motion.cart_rate, *carried)
    return Returns(trajectory.times[at] + part * h[:, 0], states)


def natural_rate(system: System) -> float:
    """The natural unit of angular rates of records (rad/s), of the shortest link."""
    return sqrt(system.gravity / float(system.by_link("length").min()))


def natural_units(system: System, states: Sequence[Floats]) -> Floats:
    """States (links, their rates, cart, its rate), (S, K, ...), in natural units, (S, K, D), angles (rad) first.

    The place of a free cart or of free supports is omitted: wherever they are, they move on in the same way.
    """
    links, rates, cart, speed, *carried = states
    length, rate = float(system.by_link("length").min()), natural_rate(system)
    columns = [links, rates / rate]
    if system.cart is not None:
        columns += [(cart / length)[..., None]] * bool(system.cart.stiffness)
        columns.append((speed / (length * rate))[..., None])
    if carried:
        places = carried[0]
        for along in translations(system):
            places = places - (places @ along)[..., None] * along / (along @ along)
        columns += [places / system.first_units, carried[1] / (system.first_units * rate)]
    return np.concatenate(columns, axis=-1)


def repetition(strobes: Floats, links: int, gap: float = REPEAT_GAP_MAX) -> tuple[Ints, Ints]:
    """Return after how many samples motions (S, K, D) repeat, (S,), 0 for none, and the turns of each link, (S, links).

    They repeat where no component differs by more than a `gap`.  One that still approaches a shorter period, as it does
    near a doubling, repeats after none.

    >>> turning = np.array([[[0.1 + np.pi * k, 2.0] for k in range(50)]])  # half a turn a period
    >>> period, turns = repetition(turning, 1)
    >>> period.tolist(), turns.tolist()
    ([2], [[1]])
    """
    period, turns = np.zeros(len(strobes), dtype=np.int64), np.zeros((len(strobes), links), dtype=np.int64)
    far: dict[int, Floats] = {}
    for p in range(1, min(REPEAT_PERIODS_MAX, strobes.shape[1] // 3) + 1):
        change = strobes[:, p:] - strobes[:, :-p]
        whole = np.round(np.nan_to_num(change[:, -1, :links]) / (2 * np.pi))
        change[..., :links] -= 2 * np.pi * whole[:, None]
        far[p] = np.abs(change).max(2)
        new = (period == 0) & (far[p].max(1) < gap)
        for q in (q for q in far if q < p and p % q == 0):
            new &= far[q][:, -p:].max(1) > APPROACH_RATIO_MAX * far[q][:, :p].max(1)
        period[new], turns[new] = p, whole[new]
    return period, turns


def clustered(strobes: Floats, period: Ints, turns: Ints, gap: float = ATTRACTOR_GAP_MIN) -> tuple[Ints, list[int]]:
    """To which cluster each of the motions (S, K, D) belongs, from 1, 0 for none, (S,), and a member of each.

    `period` (S,) and `turns` (S, L) are those of `repetition`, `gap` is that from which on motions differ.

    >>> still, swinging = np.zeros((50, 2)), np.array([[0.3 * (-1) ** k, 0.0] for k in range(50)])
    >>> motions = np.array([still, swinging, still, swinging[::-1]])
    >>> clustered(motions, *repetition(motions, 1))[0].tolist()
    [1, 2, 1, 2]
    """
    labels, members = np.zeros(len(strobes), dtype=np.int64), list[int]()
    while len(left := np.flatnonzero((period > 0) & (labels == 0))):
        first, p = left[0], period[left[0]]
        alike = left[(period[left] == p) & (turns[left] == turns[first]).all(1)]
        orbit = strobes[first, -p:]
        apart = [_apart(strobes[alike, -p:], np.roll(orbit, k, 0), turns.shape[1]) for k in range(p)]
        members.append(int(first))
        labels[alike[np.min(apart, axis=0) < gap]] = len(members)
    return labels, members


def _apart(strobes: Floats, other: Floats, links: int) -> Floats:
    """The largest difference between stroboscopic samples (S, p, D) and (p, D), angles modulo full turns, (S,)."""
    change = strobes - other
    change[..., :links] -= 2 * np.pi * np.round(change[..., :links] / (2 * np.pi))
    return np.asarray(np.abs(change).max((1, 2)))


def slow_rotation(record: Floats, residual: float = 1e-2) -> float | None:
    """The ν of a record (K, D) of returns that is a function of one phase, None if none is seen.

    The strongest line, or one of which it is the second or third multiple, with its multiples leaves at most `residual`
    of the record's standard deviation: so much is left by an amplitude that changes by some 3 % over the record.  A
    record of less than 8 turns of this phase says nothing.

    >>> n = np.arange(400)
    >>> beat = np.exp(np.sin(2 * np.pi * 0.0618 * n))[:, None]
    >>> f"{slow_rotation(beat):.6f}", slow_rotation(np.random.default_rng(1).normal(size=(400, 1)))
    ('0.061800', None)
    """
    x = record - record.mean(axis=0)
    count, size = len(x), float(np.linalg.norm(x))
    if count < 64 or not size:
        return None
    spectrum = np.sum(np.abs(np.fft.rfft(np.hanning(count)[:, None] * x, 4 * count, axis=0)) ** 2, axis=1)
    strongest = float(spectrum.argmax()) / (4 * count)
    halves = [float(np.linalg.norm(part - part.mean(axis=0))) for part in np.array_split(x, 2)]
    if strongest * count < 8 or not 0.9 * halves[0] < halves[1] < 1.1 * halves[0]:  # slow, or not bounded
        return None
    times, harmonics = np.arange(count), min(count // 12, 24)
    for multiple in range(1, 4):
        for turn in range(multiple):
            nu = (strongest + turn) / multiple
            if min(nu, 1 - nu) * count < 8:
                continue
            for most in (1, 4, harmonics):  # a fit of few multiples finds the way for those of more
                width = 1 / (2 * most * count)
                bounds = (nu - width, nu + width)
                fit = scipy.optimize.minimize_scalar(
                    lambda trial, most=most: _left_of(x, times, trial, most),
                    bounds=bounds,
                    method="bounded",
                    options={"xatol": 1e-10, "maxiter": 25},
                )
                nu = float(fit.x)
            if fit.fun < residual * size:
                return min(nu, 1 - nu)
    return None


def locked_rotation(record: Floats, gap: float) -> float | None:
    """The ν of a record (K, D) of returns on a torus that has locked: it repeats, but only after many returns.

    It is the multiple of 1/p, with p returns in which it repeats within a `gap`, that is nearest to the strongest line.

    >>> n = np.arange(600)
    >>> f"{locked_rotation((n * 3 % 100 < 40)[:, None] * 1.0, 1e-6):.3f}"  # no smooth function of a phase
    '0.030'
    """
    x = record - record.mean(axis=0)
    p = next((p for p in range(2, len(x) // 3) if np.abs(x[p:] - x[:-p]).max() < gap), None)
    if p is None:
        return None
    lines = np.sum(np.abs(np.fft.rfft(x[-p:], axis=0)) ** 2, axis=1)
    return max(int(lines.argmax()), 1) / p


def _left_of(x: Floats, times: Ints, nu: float, harmonics: int) -> float:
    """The norm of the residual of a record (K, D) without the multiples of a frequency, to 1e-8 of the record's."""
    turns = np.vander(np.exp(2j * np.pi * nu * times), harmonics + 1, increasing=True)
    waves = np.hstack((turns.real, turns.imag[:, 1:]))
    gram = waves.T @ waves + np.finfo(float).eps * len(x) * np.eye(waves.shape[1])  # multiples may nearly coincide
    products = waves.T @ x
    left = float(np.vdot(x, x) - np.vdot(products, np.linalg.solve(gram, products)))
    return sqrt(max(left, 0.0))
