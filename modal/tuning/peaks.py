"""All peaks of a response: where |H| has its maxima, to the last digits, and its ends.

A grid that is close near every pole shows where the maxima are; there d|H|²/dω = 2 Re(H̄ ∂H/∂ω) is brought to 0.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from modal.tuning.model import Model
from modal.types import Booleans, Floats

BEYOND = 30.0
"""How far the grid goes below the slowest pole and above the fastest, where nothing bounds it."""
WITHIN = np.concatenate(([0.0], np.geomspace(0.08, 40.0, 9)))
POINTS = 80
ROUNDS, BETWEEN = 2, 9
STEPS, SETTLED = 40, 4e-16
NEAR, NEARER = 1e-4, 1e-6
"""Relative distances from an undamped pole at which an infinite peak shows: it grows as their inverse."""
FAR = 1e-4
"""A frequency, over that of the slowest pole, that stands for 0; its inverse for infinity."""
UNDAMPED, FAINT = 1e-11, 1e-6
NEARLY, MOST_BESIDE = 0.8, 24
"""Part of the largest |H| from which on a frequency of the grid is beside a peak, and the most of these."""


@dataclass(frozen=True, eq=False)
class Peaks:
    """Frequencies `omega` (P,) in rad/s of maxima of |H| and of the ends of the band; `inside` (P,) are maxima.

    `beside` (Q,) are frequencies of the grid where |H| is nearly as large: as numbers change, two peaks may merge and
    one wander fast, while |H| at a frequency changes slowly.  `endless` says where |H| has no bound, if it has none.
    """

    omega: Floats
    inside: Booleans
    beside: Floats
    endless: str = ""
    static: float = 0.0
    """The frequency that stands for 0 where no band bounds the response."""

    @classmethod
    def none(cls, words: str) -> Peaks:
        """Those of a response without bound."""
        return cls(np.zeros(0), np.zeros(0, bool), np.zeros(0), words)


def find_peaks(model: Model, channel: int, band: tuple[float, float] | None) -> Peaks:
    """The peaks of a channel over a band (rad/s), by default over all frequencies."""
    poles = model.poles_for(channel)
    poles = poles[(poles.imag >= 0) & (np.abs(poles) > 0)]
    rates = np.abs(poles)
    rates = rates[rates > 1e-7 * rates.max(initial=0.0)] if len(rates) else np.ones(1)
    low, high = band or (float(rates.min()) * FAR, float(rates.max()) / FAR)
    inner = (max(low, rates.min() / BEYOND), min(high, rates.max() * BEYOND)) if band is None else band
    for pole in poles[np.abs(poles.real) <= UNDAMPED * np.abs(poles)].tolist():
        at = abs(pole.imag)
        if low <= at <= high and _is_infinite(model, channel, at):
            return Peaks.none(f"at {at / (2 * np.pi):.6g} Hz, where nothing damps a mode")
    omega = _grid(poles, *inner)
    if band is None:
        omega = np.concatenate(([low], omega, [high]))
    with np.errstate(all="ignore"):
        size = np.abs(model.response(channel, omega))
    size = np.where(np.isfinite(size), size, 0.0)
    if band is None and (words := _unbounded(size)):
        return Peaks.none(words)
    at = np.flatnonzero((size[1:-1] > size[:-2]) & (size[1:-1] >= size[2:])) + 1
    turning = _refined(model, channel, omega[at - 1], omega[at], omega[at + 1]) if len(at) else np.zeros(0)
    ends = [k for k, beside in ((0, 1), (-1, -2)) if size[k] >= size[beside] and size[k] > 0]
    every = np.concatenate((turning, omega[ends]))
    near = np.flatnonzero(size >= NEARLY * size.max())
    near = near[np.linspace(0, len(near) - 1, min(len(near), MOST_BESIDE)).astype(int)]
    return Peaks(every, np.arange(len(every)) < len(turning), omega[near], static=0.0 if band else low)


def _grid(poles: np.ndarray, low: float, high: float) -> Floats:
    width = np.maximum(np.abs(poles.real), 1e-9 * np.abs(poles))[:, None]
    near = (np.abs(poles.imag)[:, None] + width * np.concatenate((-WITHIN[::-1], WITHIN))).ravel()
    near = np.concatenate((near, np.abs(poles)))
    every = np.concatenate((np.geomspace(low, high, POINTS), near[(near > low) & (near < high)]))
    return np.unique(every)


def _is_infinite(model: Model, channel: int, omega: float) -> bool:
    sizes = np.abs(model.response(channel, omega * np.array([1 + NEAR, 1 + NEARER, 1 - NEAR, 1 - NEARER])))
    return bool(max(sizes[1] / sizes[0], sizes[3] / sizes[2]) > 0.3 * NEAR / NEARER)


def _unbounded(size: Floats) -> str:
    """Whether |H| grows towards 0 or infinity, from a point at FAR and the next."""
    if size[0] > 5 * size[1] > 0:
        return "towards 0 Hz: give a band of frequencies"
    if size[-1] > 5 * size[-2] > 0 and size[-1] > FAINT * size.max():
        return "towards high frequencies: give a band of frequencies"
    return ""


def _refined(model: Model, channel: int, low: Floats, middle: Floats, high: Floats) -> Floats:
    """Maxima of |H| between the ends of intervals in whose middle it is larger than at both, (P,)."""
    part = np.linspace(0.0, 1.0, BETWEEN)
    for _ in range(ROUNDS):
        at = np.concatenate(
            (low[:, None] + (middle - low)[:, None] * part, middle[:, None] + (high - middle)[:, None] * part[1:]), 1
        )
        size = np.abs(model.response(channel, at.ravel())).reshape(at.shape)
        best = np.clip(size.argmax(1), 1, at.shape[1] - 2)
        rows = np.arange(len(at))
        low, middle, high = at[rows, best - 1], at[rows, best], at[rows, best + 1]
    return _level(model, channel, low, high)


def _level(model: Model, channel: int, low: Floats, high: Floats) -> Floats:
    """Zeros of the slope of |H| between ends where it rises and falls, by the Illinois method."""

    def rise(omega: Floats) -> Floats:
        H, slope = model.slope(channel, omega)
        return np.asarray((np.conj(H) * slope).real / np.abs(H) ** 2)

    a, b, fa, fb = low, high, rise(low), rise(high)
    for _ in range(STEPS):
        with np.errstate(all="ignore"):
            c = np.where(fa - fb == 0, (a + b) / 2, (a * fb - b * fa) / (fb - fa))
        c = np.where((c > np.minimum(a, b)) & (c < np.maximum(a, b)), c, (a + b) / 2)
        moved, fc = np.abs(c - b), rise(c)
        crossed = fc * fb <= 0
        a, fa = np.where(crossed, b, a), np.where(crossed, fb, fa / 2)
        b, fb = c, fc
        if np.all((moved <= SETTLED * np.abs(b)) | (fc == 0)):
            break
    return b
