"""The mode that holds the energy of a run, and the time from which it does.

With the shapes φ_r of the scene without dampers and drives, φᵀMφ = 1, and q the motion about equilibrium,

    η_r = φ_rᵀ M q,     E_r = ½ Σ (η_r'² + ω_r² η_r²)    over all shapes of one row of the table,

averaged over one period of the strongest row: at large angles E_r ripples.  The rigid translation of a free cart
and modes that do not oscillate are excluded.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from math import pi

import numpy as np

from modal.errors import ComputationError
from modal.modes import Mode, Modes, natural_modes, table_numbers
from modal.report import Displayed
from modal.scene import Scene
from modal.types import Floats, Ints
from nonlinear.averaging import LOCKED, below_for_good
from nonlinear.integration import Trajectory
from nonlinear.postprocessing import smooth
from nonlinear.reduction import deflection, rest_angles
from nonlinear.synchronization.phases import from_rest

MOST = 2000  # coordinates of a scene up to which its energy is divided among modes


@dataclass(frozen=True, eq=False, repr=False)
class Survival(Displayed):
    """Energies of the R oscillating rows: `row` (R,) their numbers from 1 in the table `modes`, `energy` (T, R) in J.

    `modes` are those of the `scene` without dampers and drives.
    """

    scene: Scene
    times: Floats
    modes: Modes
    row: Ints
    energy: Floats

    @cached_property
    def share(self) -> Floats:
        """Fraction of each row in the total energy, (T, R); NaN at rest."""
        total = self.energy.sum(axis=1, keepdims=True)
        shares = np.divide(self.energy, total, out=np.full_like(self.energy, np.nan), where=total > 0)
        return np.asarray(shares)

    @cached_property
    def _place(self) -> int:
        if not np.all(np.isfinite(self.share[-1])):
            raise ComputationError("nothing moves at the end of the run: no mode survives")
        return int(np.argmax(self.share[-1]))

    @property
    def survivor(self) -> int:
        """The row, from 1, with most energy at the end; ComputationError where nothing is left."""
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
        """The fraction of the energy that it holds at the end."""
        return float(self.share[-1, self._place])

    def locking_time(self, threshold: float = LOCKED) -> float | None:
        """The time (s) from which all other rows together hold less than `threshold`; None if never."""
        return below_for_good(self.times, np.delete(self.share, self._place, axis=1).sum(axis=1), threshold)


def find_survival(trajectory: Trajectory, modes: Modes | None = None) -> Survival:
    """The energies of a run in the plane in the modes of its scene without dampers, which may be given.

    Raises ComputationError for a motion in space, for more coordinates than MOST, and where no mode oscillates.
    """
    scene = trajectory.scene.conservative
    size = scene.n_links + (scene.support.kind == "cart")
    if trajectory.system.spatial:
        raise ComputationError("energies by modes: only for motion in the plane")
    if size > MOST:
        raise ComputationError(f"energies by modes: this scene has {size} coordinates, more than {MOST}")
    links = rest_angles(scene) + from_rest(trajectory.system, trajectory.motion.links)
    q, v = deflection(scene, replace(trajectory.motion, links=links))
    modes = modes or natural_modes(scene)
    swinging = np.flatnonzero(modes.eigenvalue.imag)
    if not swinging.size:
        raise ComputationError("no mode of this scene oscillates")
    omega = modes.omega[swinging]
    energy = _energies(modes, swinging, q, v)
    period = 2 * pi / float(omega[np.argmax(energy.sum(0))])
    return Survival(trajectory.scene, trajectory.times, modes, swinging + 1, smooth(trajectory.times, energy, period))


def _energies(modes: Modes, rows: Ints, q: Floats, v: Floats) -> Floats:
    """E_r (J) of these rows (from 0), (T, R)."""
    phi = modes.matrix.real.take(np.isin(modes.matrix.row, rows))
    each = ((v @ phi.dual) ** 2 + (modes.omega[phi.row] * (q @ phi.dual)) ** 2) / 2
    return np.asarray(np.add.reduceat(each, np.flatnonzero(np.diff(phi.row, prepend=-1)), axis=1))
