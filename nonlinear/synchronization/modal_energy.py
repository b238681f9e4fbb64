"""The mode that contains the energy of a run, and from what time on.

With the shapes φ_r of the scene without dampers and drives, φᵀMφ = 1, and q the motion about equilibrium,

    η_r = φ_rᵀ M q,     E_r = ½ Σ (η_r'² + ω_r² η_r²)    over all shapes of one row of the table,

averaged over one period of the strongest row: at large angles E_r ripples.  The rigid translation of a free cart
and modes that do not oscillate are excluded.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from math import pi
from typing import NamedTuple

import numpy as np

from modal.errors import ComputationError
from modal.modes import Mode, Modes, natural_modes, table_numbers
from modal.report import Displayed
from modal.scene import Scene
from modal.scene.doors import checked
from modal.types import Floats, Ints
from nonlinear.averaging import LOCKED, below_for_good
from nonlinear.integration import Trajectory
from nonlinear.postprocessing import smooth
from nonlinear.reduction import deflection, rest_angles
from nonlinear.synchronization.phases import ENDING, from_rest

SHARE_DIFFERENCE_MAX = 0.05
"""Limit: of the energy: a share that changes less lasts, one that is less does not count, and a predicted share that
differs more contradicts the run."""
FREQUENCY_DIFFERENCE_MIN = 0.01
"""Tolerance: relative, from which on frequencies are not one, nor one a multiple of the other: measured ones err by
1e-3."""
BEAT_DIFFERENCE_MAX = 0.1
"""Tolerance: relative, of the slow periods of a lasting beat, each of them measured by some samples."""
MODAL_COORDINATES_MAX = 2000
"""Limit: "energies by modes: this scene has … coordinates, more than 2000"."""


class Beat(NamedTuple):
    """A share of the energy that oscillates forever between `low` and `high` with a `period` (s)."""

    period: float
    low: float
    high: float


@dataclass(frozen=True, eq=False, repr=False)
class Survival(Displayed):
    """Energies of the R oscillating rows: `row` (R,) their numbers from 1 in the table `modes`, `energy` (T, R) in J.

    `modes` are those of the `scene` without dampers and drives, `omega` (R,) the measured frequencies (rad/s)
    √(mean η'²/mean η²) in the last quarter of the run.
    """

    what = "Energies of modes over time"
    shows = "scene: scene; times: times, s; row: modes; energy: energies, J"

    scene: Scene
    times: Floats
    modes: Modes
    row: Ints
    energy: Floats
    omega: Floats

    @cached_property
    def share(self) -> Floats:
        """Fraction of each row in the total energy, (T, R); NaN at rest."""
        total = self.energy.sum(axis=1, keepdims=True)
        shares = np.divide(self.energy, total, out=np.full_like(self.energy, np.nan), where=total > 0)
        return np.asarray(shares)

    @property
    def is_at_rest(self) -> bool:
        """Whether nothing moves at the end."""
        return not np.all(np.isfinite(self.share[-1]))

    @cached_property
    def _place(self) -> int:
        if self.is_at_rest:
            raise ComputationError("nothing moves at the end of the run: no mode survives")
        return int(np.argmax(self.share[-1]))

    @property
    def survivor(self) -> int:
        """The row, from 1, with most energy at the end; raise ComputationError if nothing is left."""
        return int(self.row[self._place])

    @property
    def number(self) -> int:
        """The number of that mode in the table of the scene, dampers included."""
        return int(table_numbers(self.scene, self.modes)[self.survivor - 1])

    @property
    def mode(self) -> Mode:
        """The `Mode` of that row."""
        return self.modes[self.survivor - 1]

    @property
    def survivor_share(self) -> float:
        """Its fraction of the energy at the end."""
        return float(self.share[-1, self._place])

    @cached_property
    def _others(self) -> Floats:
        """The share of all rows but the survivor, (T,)."""
        return np.asarray(np.delete(self.share, self._place, axis=1).sum(axis=1))

    @cached_property
    def _rises(self) -> Floats:
        """When the share of the others, in the late part of the run, rises from its lowest quarter to its highest (s).

        It ripples in between: each mode whose frequency differs a little adds a faster beat to a slow one.
        """
        start = int(np.searchsorted(self.times, self.times[-1] / 2))
        late = self._others[start:]
        if not np.all(np.isfinite(late)) or np.ptp(late) < LOCKED:
            return self.times[:0]
        place = (late - late.min()) / np.ptp(late)
        outer = np.flatnonzero((place < 1 / 4) | (place > 3 / 4))
        is_above = place[outer] > 3 / 4
        return np.asarray(self.times[start:][outer[1:][is_above[1:] & ~is_above[:-1]]])

    @cached_property
    def beat(self) -> Beat | None:
        """The beat of the late part of the run: three slow periods alike; None if there is none."""
        if self.is_at_rest:
            return None
        periods = np.diff(self._rises)
        if len(periods) < 3 or np.ptp(periods) > BEAT_DIFFERENCE_MAX * periods.mean():
            return None
        spans = [self._others[(self.times >= a) & (self.times < b)] for a, b in pairwise(self._rises)]
        ends = np.array([(span.min(), span.max()) for span in spans])
        if np.ptp(ends, axis=0).max() > BEAT_DIFFERENCE_MAX * np.ptp(ends, axis=1).mean():
            return None
        low, high = 1 - ends[:, 1].mean(), 1 - ends[:, 0].mean()
        return Beat(float(periods.mean()), float(low), float(high))

    @cached_property
    def waiting(self) -> float:
        """How long (s) an end must have lasted: a tenth of the run, and three of the longest slow period in it."""
        return max(ENDING * float(self.times[-1]), 3 * float(np.diff(self._rises).max(initial=0.0)))

    @cached_property
    def is_steady(self) -> bool:
        """Whether something moves, and the share of the survivor has changed by less than 1 % for that long."""
        if self.is_at_rest:
            return False
        late = self._others[self.times >= self.times[-1] - self.waiting]
        return bool(np.ptp(late) < LOCKED)

    @property
    def is_settled(self) -> bool:
        """Whether the end of the run lasts: rest, a constant share, or a beat."""
        return self.is_at_rest or self.is_steady or self.beat is not None

    @cached_property
    def beating(self) -> tuple[int, ...]:
        """Places of the rows, strongest first, that share the energy steadily with frequencies of their own; else ().

        A motion of several frequencies, as of pendula that beat forever: no mode survives, and none is lost.
        """
        quarters = np.array_split(self.share, 4)
        earlier, late = (quarter.mean(axis=0) for quarter in quarters[2:])
        if len(self.times) < 8 or not np.abs(late - earlier).max() <= SHARE_DIFFERENCE_MAX:
            return ()
        holding = [int(place) for place in np.argsort(-late) if late[place] >= SHARE_DIFFERENCE_MAX]
        incommensurate = []
        for k, place in enumerate(holding):
            stronger = self.omega[holding[:k]]
            ratios = np.maximum(self.omega[place], stronger) / np.minimum(self.omega[place], stronger)
            # neither is a multiple of the other
            if np.all(np.abs(ratios - np.round(ratios)) > FREQUENCY_DIFFERENCE_MIN * ratios):
                incommensurate.append(place)
        return tuple(incommensurate) if len(incommensurate) > 1 else ()

    @cached_property
    def late_share(self) -> Floats:
        """The mean share of each row in the last quarter of the run, (R,)."""
        return np.asarray(np.array_split(self.share, 4)[-1].mean(axis=0))

    def locking_time(self, threshold: float = LOCKED) -> float | None:
        """The time (s) from which all other rows together hold less than `threshold`.

        None if they never do, or not for as long as an end must have lasted (`waiting`).
        """
        time = below_for_good(self.times, self._others, threshold)
        return None if time is None or self.times[-1] - time < self.waiting else time


@checked
def find_survival(trajectory: Trajectory, modes: Modes | None = None) -> Survival:
    """The energies of a run in the plane in the modes of its scene without dampers, which may be given.

    Raise ComputationError for a motion in space, for more than 2,000 coordinates, and where no mode oscillates.
    """
    scene = trajectory.scene.conservative
    size = scene.n_links + (scene.cart is not None)
    if trajectory.system.spatial:
        raise ComputationError("energies by modes: only for motion in the plane")
    if size > MODAL_COORDINATES_MAX:
        raise ComputationError(
            f"energies by modes: this scene has {size} coordinates, more than {MODAL_COORDINATES_MAX}"
        )
    links = rest_angles(scene) + from_rest(trajectory.system, trajectory.motion.links)
    q, v = deflection(scene, replace(trajectory.motion, links=links))
    modes = modes or natural_modes(scene)
    swinging = np.flatnonzero(modes.eigenvalue.imag)
    if not swinging.size:
        raise ComputationError("no mode of this scene oscillates")
    omega = modes.omega[swinging]
    energy, rates = _energies(modes, swinging, q, v)
    period = 2 * pi / float(omega[np.argmax(energy.sum(0))])
    return Survival(
        trajectory.scene, trajectory.times, modes, swinging + 1, smooth(trajectory.times, energy, period), rates
    )


def _energies(modes: Modes, rows: Ints, q: Floats, v: Floats) -> tuple[Floats, Floats]:
    """E_r (J) of these rows (from 0), (T, R), and their frequencies (rad/s) in the last quarter, (R,)."""
    phi = modes.matrix.real.take(np.isin(modes.matrix.row, rows))
    begins, omega = np.flatnonzero(np.diff(phi.row, prepend=-1)), modes.omega[phi.row]
    kinetic, potential = (
        np.add.reduceat(energy**2 / 2, begins, axis=1) for energy in (v @ phi.dual, omega * (q @ phi.dual))
    )
    late = slice(3 * len(q) // 4, None)
    mean, means = kinetic[late].mean(axis=0), potential[late].mean(axis=0)
    rates = omega[begins] * np.sqrt(np.divide(mean, means, out=np.ones_like(mean), where=means > 0))
    return np.asarray(kinetic + potential), np.asarray(rates)
