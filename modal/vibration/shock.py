"""The response of a scene to a record of its support's motion along the rail, at small angles, mode by mode.

The history of each mode is exact (`modal.vibration.oscillators`), and so is their sum; peaks of modes are combined by
SRSS and CQC beside it.  The effective masses add up to the whole mass; the modes needed for 90 % of it are those that
building codes ask for (Chopra, Dynamics of Structures, §13.2; Eurocode 8, §4.3.3.3.1).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import pi

import numpy as np

from modal.errors import ComputationError
from modal.modes import natural_modes
from modal.scene import RecordMotion, Scene, require
from modal.scene.doors import checked
from modal.statespace import ModalForm, state_space, to_modal_form
from modal.statespace.response import Term
from modal.types import Booleans, Complexes, Floats
from modal.vibration.combination import cqc, srss
from modal.vibration.oscillators import Grid, driven, fine_times, peak
from modal.vibration.prescribed import Record, prescribed_motion
from modal.vibration.random import INPUT, USUAL, exact_terms
from modal.vibration.response import ModalResponse

ENOUGH = 0.9
"""Share of the mass that the modes considered must have."""
AFTER = 2.0  # slowest periods by which a history exceeds the record
DECAYS = 100
DIRECT = 1e-9
MOST = 5e7  # numbers of all histories


@dataclass(frozen=True, eq=False, repr=False)
class ShockResponse(ModalResponse):
    """The response of p outputs to a record: `history` (p, T) and that of each mode (R, p, T) at the times of `grid`.

    The acceleration drops to zero at the record's end, and what contains it jumps: the last sample of the record is
    followed by another at the next number.
    """

    record: Record
    grid: Grid
    history: Floats
    by_mode: Floats

    @property
    def times(self) -> Floats:
        """The times (T,) in s, ascending."""
        return self.grid.times

    @cached_property
    def peaks(self) -> Floats:
        """The largest |value| of every output, (p,), and its time (s): (p, 2)."""
        return np.array([peak(self.grid, values) for values in self.history])

    @cached_property
    def mode_peaks(self) -> Floats:
        """The largest |value| of every mode alone, (R, p), with the sign of the mode in that output."""
        signs = np.ones(self.by_mode.shape[:2])
        for term in exact_terms(self.form):
            if term.mode is not None:
                leading = term.N0[:, 0] if np.any(term.N0) else term.N1[:, 0]
                signs[term.mode] = np.where(leading < 0, -1.0, 1.0)
        sizes = [[peak(self.grid, values)[0] for values in histories] for histories in self.by_mode]
        return np.asarray(signs * np.array(sizes) + 0.0)

    @cached_property
    def follows_support(self) -> Booleans:
        """Which outputs contain the support's own motion besides that of the modes, (p,)."""
        whole = self.by_mode.sum(0)
        rest = np.abs(self.history - whole).max(1)
        return np.asarray(rest > DIRECT * np.abs(self.history).max(1))

    @cached_property
    def srss(self) -> Floats:
        """The peaks of the modes combined by SRSS, (p,): NaN where the support's own motion adds to theirs."""
        return np.where(self.follows_support, np.nan, srss(self.mode_peaks))

    @cached_property
    def cqc(self) -> Floats:
        """The same by CQC."""
        omega, zeta = self.modes.omega, np.array([mode.damping_ratio for mode in self.modes])
        swing = omega > 0
        with np.errstate(all="ignore"):
            combined = cqc(self.mode_peaks[swing], omega[swing], np.clip(np.nan_to_num(zeta[swing]), 0.0, 1.0))
            combined = np.sqrt(combined**2 + np.sum(self.mode_peaks[~swing] ** 2, axis=0))
        return np.where(self.follows_support, np.nan, combined)

    @cached_property
    def mass_shares(self) -> Floats:
        """The effective mass of every mode along the rail over the whole mass, (R,), on a support at rest."""
        undamped = natural_modes(self.modes.scene.conservative)
        shares = np.array([mode.effective_mass_share for mode in undamped])
        return shares if len(shares) == len(self.modes) else np.full(len(self.modes), np.nan)

    @property
    def enough(self) -> int | None:
        """The number of lowest modes that hold 90 % of the mass; None where that is unknown."""
        reached = np.flatnonzero(np.cumsum(self.mass_shares) >= ENOUGH)
        return int(reached[0]) + 1 if len(reached) else None


@checked
def shock_response(scene: Scene, motion: RecordMotion, outputs: tuple[str, ...] = USUAL) -> ShockResponse:
    """The response of a scene at rest on its support to a record of the support's motion along the rail.

    `outputs` are groups of `modal.statespace.signals.OUTPUTS`.  The history begins with the record and goes on for two
    of the slowest periods beyond it.  Raises ComputationError where it would take too many steps, and the errors of
    `state_space` and `to_modal_form`.
    """
    require(scene, "a shock")
    record, modes = prescribed_motion(motion), natural_modes(scene)
    assert isinstance(record, Record)
    form = to_modal_form(modes, state_space(scene, (INPUT,), tuple(outputs)))
    grid = fine_times(record, *_steps(modes.eigenvalue, record))
    size = len(modes) * len(form.model.outputs) * len(grid.times)
    if size > MOST:
        raise ComputationError(
            f"{len(modes)} modes, {len(form.model.outputs)} outputs and {len(grid.times)} times: their product may be "
            f"at most {MOST:g}; choose fewer outputs"
        )
    by_mode = np.zeros((len(modes), len(form.model.outputs), len(grid.times)))
    history = form.model.D[:, :1] * grid.derivatives[0] + _carried_along(form, record, grid.times)
    for term in exact_terms(form):
        values = _history(term, record, grid)
        history = history + values
        if term.mode is not None:
            by_mode[term.mode] += values
    if not np.all(np.isfinite(history)):
        raise ComputationError("the response to this record overflows")
    return ShockResponse(form, record, grid, history, by_mode)


def _carried_along(form: ModalForm, record: Record, times: Floats) -> Floats:
    """The outputs (p, T) of a support that goes on as it begins: what is at rest on it moves with it."""
    begun, speed = float(record.displacement(record.first)), float(record.velocity(record.first))
    return np.asarray(form.outputs[0] @ np.stack([begun + speed * (times - record.first), np.full(len(times), speed)]))


def _steps(eigenvalues: Complexes, record: Record) -> tuple[float, float]:
    """The period (s) to be resolved, and until when (s).

    That of the fastest oscillation; of faster decays, too, as far as they cost no more than DECAYS periods.
    """
    rates = eigenvalues.imag[eigenvalues.imag > 0]
    if not len(rates):
        rates = np.array([2 * pi / (record.last - record.first)])
    until = record.last + AFTER * 2 * pi / float(rates.min())
    decay = min(float(np.abs(eigenvalues).max()), DECAYS * 2 * pi / (until - record.first))
    return 2 * pi / max(float(rates.max()), decay), until


def _history(term: Term, record: Record, grid: Grid) -> Floats:
    """What one term adds to each output, (p, T), for the support's acceleration."""
    N1, N0, times = term.N1[:, :1], term.N0[:, :1], grid.times
    c2, c1, c0 = term.c
    if not c2:
        return np.asarray(N0 * driven(np.array([complex(-c0)]), grid)[0].real)
    a = -c1 / 2
    nu = np.sqrt(complex(c0 - a * a))
    if not nu:
        passed = times - record.first
        velocity = record.velocity(times) - float(record.velocity(record.first))
        place = record.displacement(times) - float(record.displacement(record.first))
        place = place - float(record.velocity(record.first)) * passed
        return np.asarray(N1 * velocity + N0 * place)
    poles = np.array([a + 1j * nu, a - 1j * nu])
    if nu.imag:
        alpha = driven(poles, grid)
        sizes = [(N1 * pole + N0) / (pole - other) for pole, other in zip(poles, poles[::-1], strict=True)]
        return np.asarray((sizes[0] * alpha[0] + sizes[1] * alpha[1]).real)
    alpha = driven(poles[:1], grid)[0]
    return np.asarray(2 * (((N1 * poles[0] + N0) / (2j * nu)) * alpha).real)
