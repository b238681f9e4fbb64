"""Any motion compared with the table of modes: the contribution of each mode, and the lines of each modal coordinate.

In linear motion a coordinate has one line, at the mode's own frequency.  Large angles add lines of other modes that
drive it, odd multiples and combinations of frequencies, and shift its own line.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from modal.errors import ComputationError
from modal.modes import Mode, Modes, natural_modes
from modal.report import Displayed, TextResult
from modal.scene import require
from modal.scene.doors import checked
from modal.types import Floats
from nonlinear.integration import Trajectory
from nonlinear.postprocessing import PushingLink, SpectralLine, lines
from nonlinear.reduction import ModalMotion, modal_motion
from nonlinear.verification.modes import pushing_in

LINE_ERROR_MAX = 1e-2
"""Tolerance: relative error of a line above which it is not steady."""


@dataclass(frozen=True, repr=False)
class ModeInMotion(Displayed):
    """One modal coordinate: its mode and copy (from 0), its largest value (rad), its mean share of the energy, lines.

    `note` says why there are no lines.
    """

    what = "Mode in a motion"
    shows = "mode: mode; largest: largest, rad; share: share of the energy; lines: lines; note: note"

    mode: Mode
    copy: int
    largest: float
    share: float
    lines: tuple[SpectralLine, ...]
    note: str


@dataclass(frozen=True, eq=False, repr=False)
class Comparison(TextResult):
    """A motion and the results for each modal coordinate; `pushing` are the links of bobs that push."""

    modes: Modes
    times: Floats
    motion: ModalMotion
    rows: tuple[ModeInMotion, ...]
    pushing: tuple[PushingLink, ...] = ()
    writer = "nonlinear.verification.tables:comparison_table"

    @cached_property
    def swinging(self) -> Floats:
        """Frequencies |Im λ| (rad/s) of the modes that oscillate."""
        omega = np.abs(self.modes.eigenvalue.imag)
        return np.asarray(omega[omega > 0])

    def nearest(self, line: SpectralLine) -> tuple[int, float]:
        """The mode (from 1) with the frequency nearest to a line, and the line's relative distance from it."""
        omega = np.abs(self.modes.eigenvalue.imag)
        number = int(np.argmin(np.where(omega > 0, np.abs(line.omega - omega), np.inf)))
        return number + 1, line.omega / float(omega[number]) - 1


@checked
def compare(trajectory: Trajectory, numbers: Sequence[int] | None = None, *, count: int = 3) -> Comparison:
    """Project a motion in the plane, sampled evenly, on the modes with these indices (from 0; by default all).

    At most `count` lines are sought in every coordinate. A decaying mode's lines are those of η exp(−Re λ t). Raise
    ComputationError for a motion out of the plane.
    """
    require(trajectory.scene, "a comparison with modes")
    modes = natural_modes(trajectory.scene)
    chosen = list(range(len(modes))) if numbers is None else list(numbers)
    motion = modal_motion(trajectory.motion, modes, chosen)
    modes_by_number = dict(zip(chosen, modes.rows(chosen), strict=True))
    share = motion.energy.sum(0) / motion.total_energy.sum()
    rows = []
    for at, number in enumerate(motion.number.tolist()):
        eta = motion.coordinate[:, at]
        spectrum, note = _lines(trajectory.times, eta, complex(modes.eigenvalue[number]), count)
        largest = float(np.abs(eta).max())
        rows.append(
            ModeInMotion(modes_by_number[number], int(motion.copy[at]), largest, float(share[at]), spectrum, note)
        )
    return Comparison(modes, trajectory.times, motion, tuple(rows), pushing_in(trajectory))


def _lines(times: Floats, eta: Floats, value: complex, count: int) -> tuple[tuple[SpectralLine, ...], str]:
    if not value.imag:
        return (), "does not oscillate"
    try:
        spectrum = lines(times, eta * np.exp(-min(value.real, 0.0) * (times - times[0])), count)
    except ComputationError as error:
        return (), str(error)
    steady = tuple(peak for peak in spectrum if peak.relative_error < LINE_ERROR_MAX)
    return steady, "" if steady else "irregular"
