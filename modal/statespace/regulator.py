"""The linear-quadratic regulator of a scene: the gains K of u = −K z that make ∫ (zᵀQz + uᵀRu) dt least.

    AᵀP + PA − PBR⁻¹BᵀP + Q = 0,    K = R⁻¹BᵀP    [Kwakernaak1972, §3.4]

Without weights zᵀQz is the energy of the small motion and R one of each input's unit.  Of modes that fall the size of
their potential energy counts, and one that nothing holds, such as a free cart's place, is held as gravity holds its
longest link, ω² = g/l.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from modal.assembly import matrices
from modal.errors import ComputationError, SceneError
from modal.report import Displayed, brief, csv_rows
from modal.scene import Scene
from modal.scene.doors import checked
from modal.scene.records import read_gains
from modal.scene.signal_names import signal_label
from modal.statespace.model import state_space
from modal.statespace.signals import Signal
from modal.types import NOISE_OF_SUM, Complexes, Floats


@dataclass(frozen=True, eq=False, repr=False)
class Regulator(Displayed):
    """Gains K (m, n) with the names of inputs and states, weights Q (n, n) and R (m, m), the `poles` (n,) of the loop.

    >>> from modal import load
    >>> design = regulator(load("crane-hook"))
    >>> design.K.shape, bool((design.poles.real < 0).all())
    ((1, 6), True)
    """

    what = "Gains of a linear-quadratic regulator"
    shows = "K: gains; poles: poles of the loop, 1/s"

    K: Floats
    Q: Floats
    R: Floats
    states: tuple[Signal, ...]
    inputs: tuple[Signal, ...]
    poles: Complexes

    def csv(self) -> str:
        """K as `[[feedback]] gains` reads it: a column for each state, a row for each input."""
        return csv_rows([[signal.name for signal in self.states], *self.K.tolist()])

    def words(self) -> str:
        """Inputs and poles in words."""
        names = ", ".join(map(signal_label, self.inputs))
        poles = ", ".join(brief(pole) for pole in self.poles.tolist() if pole.imag >= 0)
        return f"gains of {names} on {len(self.states)} states; poles of the loop {poles} 1/s"


@checked
def regulator(scene: Scene, inputs: tuple[str, ...] = (), weights: tuple[str, str] | None = None) -> Regulator:
    """The regulator of a scene with its loops open, of these inputs (by default those of `state_space`).

    `weights` are CSV files of Q and R with the names of states and of inputs as headings: matrices, or the one row of a
    diagonal.  SceneError for weights that do not fit, ComputationError where no gains make the motion decay.
    """
    plant = scene.replace(feedback=())
    model = state_space(plant, inputs)
    if weights is None:
        Q, R = energy_weights(plant), np.eye(len(model.inputs))
    else:
        sides = zip(weights, (model.states, model.inputs), strict=True)
        Q, R = (_read_weights(path, [signal.name for signal in signals]) for path, signals in sides)
        _refuse_indefinite(weights, Q, R)
    try:
        P = scipy.linalg.solve_continuous_are(model.A, model.B, Q, R)
        K = np.linalg.solve(R, model.B.T @ P)
        poles = np.linalg.eigvals(model.A - model.B @ K)
    except (np.linalg.LinAlgError, ValueError):
        poles = np.zeros(1)
    if not poles.real.max() < 0:
        raise ComputationError(
            "no gains make this motion decay: it must be controllable by the inputs and observable through the weights "
            "(`modal_gains` shows which modes are controllable)"
        )
    order = np.lexsort((poles.imag, np.abs(poles)))
    return Regulator(K, Q, R, model.states, model.inputs, poles[order].astype(complex))


def energy_weights(scene: Scene) -> Floats:
    """The Q (n, n) by which zᵀQz is the energy (J) of a small motion, with what nothing holds at ω² = g/l.

    >>> from modal import Bob, Pendulum, Scene
    >>> energy_weights(Scene(gravity=9.0, pendulum=[Pendulum(links=[Bob(mass=2.0, length=1.0)])])).round(9).tolist()
    [[9.0, 0.0], [0.0, 1.0]]
    """
    linear = matrices(scene)
    square, shapes = scipy.linalg.eigh(linear.K, linear.M)
    size = np.abs(square)
    gravity = scene.gravity / max(link.length for link in scene.links())
    square = np.where(size > NOISE_OF_SUM * max(float(size.max()), gravity), size, gravity)
    root = linear.M @ shapes * np.sqrt(square)
    weights: Floats = scipy.linalg.block_diag(root @ root.T, linear.M) / 2
    return weights


def _read_weights(path: str, names: Sequence[str]) -> Floats:
    """A matrix (n, n) of weights in the order of these names."""
    table = read_gains(path)["gains"]
    columns, rows = list(table["states"]), np.array(table["rows"])
    if sorted(columns) != sorted(names):
        raise SceneError([f"{path}: needs the columns {', '.join(names)}"])
    if len(rows) == 1:
        rows = np.diag(rows[0])
    if rows.shape != (len(names), len(names)):
        raise SceneError([f"{path}: has {len(rows)} rows: 1 of a diagonal, or {len(names)}"])
    order = [columns.index(name) for name in names]
    return np.asarray(rows[np.ix_(order, order)])


def _refuse_indefinite(paths: Sequence[str], Q: Floats, R: Floats) -> None:
    """SceneError for a Q that is not symmetric and positive semidefinite, or an R that is not positive definite."""
    problems = []
    for path, weights, least, words in zip(paths, (Q, R), (-NOISE_OF_SUM, NOISE_OF_SUM), ("semi", ""), strict=True):
        scale = np.abs(weights).max() or 1.0
        if not np.allclose(weights, weights.T, rtol=0.0, atol=NOISE_OF_SUM * scale):
            problems.append(f"{path}: must be symmetric")
        elif np.linalg.eigvalsh(weights)[0] < least * scale:
            problems.append(f"{path}: must be positive {words}definite")
    if problems:
        raise SceneError(problems)
