"""The linear-quadratic regulator of a scene: the gains K of u = −K z that make ∫ (zᵀQz + uᵀRu) dt least.

    AᵀP + PA − PBR⁻¹BᵀP + Q = 0,    K = R⁻¹BᵀP    [Kwakernaak1972, §3.4]

Without weights Q and R are diagonal by Bryson's rule, 1/(largest value)² [Bryson1975, §5.2]. With the length l of the
longest link and the total mass m these count as equal: an angle of 1 rad, a position of l, their rates times √(g/l), a
force m g, a torque m g l and a prescribed acceleration g. Their common scale does not affect K.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from modal.assembly import rig_of
from modal.errors import ComputationError, SceneError, refuse_any
from modal.report import Displayed, brief, csv_rows
from modal.scene import Scene
from modal.scene.doors import checked
from modal.scene.records import read_gains
from modal.scene.signal_names import signal_label
from modal.statespace.geometry import coordinates_of
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
    is_default: bool = False

    def csv(self) -> str:
        """K as `[[feedback]] gains` reads it: a column for each state, a row for each input."""
        return csv_rows([[signal.name for signal in self.states], *self.K.tolist()])

    def words(self) -> str:
        """Inputs and poles in words."""
        names = ", ".join(map(signal_label, self.inputs))
        poles = ", ".join(brief(pole) for pole in self.poles.tolist() if pole.imag >= 0)
        signals, weights = (*self.states, *self.inputs), (*np.diag(self.Q).tolist(), *np.diag(self.R).tolist())
        words = f"gains of {names} on {len(self.states)} states; poles of the loop {poles} 1/s"
        if not self.is_default:
            return words
        largest = {_kind(signal): brief(weight**-0.5) for signal, weight in zip(signals, weights, strict=True)}
        scales = ", ".join(f"{value} {kind}" for kind, value in largest.items())
        return f"{words}; by default weights that count as equal {scales} (Bryson's rule)"


@checked
def regulator(scene: Scene, inputs: tuple[str, ...] = (), weights: tuple[str, str] | None = None) -> Regulator:
    """Return the regulator of a scene with its loops open, for these inputs (by default those of `state_space`).

    `weights` are CSV files of Q and R with the names of states and of inputs as headings: matrices, or the one row of a
    diagonal.  Raise SceneError for weights that do not fit, ComputationError if no gains make the motion decay.
    """
    plant = scene.replace(feedback=())
    model = state_space(plant, inputs)
    if weights is None:
        scales = bryson_scales(plant)
        Q, R = (np.diag([scales[_kind(x)] ** -2.0 for x in signals]) for signals in (model.states, model.inputs))
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
    return Regulator(K, Q, R, model.states, model.inputs, poles[order].astype(complex), weights is None)


def bryson_scales(scene: Scene) -> dict[str, float]:
    """The value of each unit that counts as much as 1 rad, and of each coordinate of a modal support by its signals.

    A modal coordinate counts as l √(m/M_ii), where its rate has the kinetic energy of m (without the supports whose
    masses are unknown) at √(g l): its scale does not affect the motion.

    >>> from modal import Bob, Pendulum, Scene
    >>> bryson_scales(Scene(gravity=9.0, pendulum=[Pendulum(links=[Bob(mass=2.0, length=1.0)])]))["N m"]
    18.0
    """
    rig, length = rig_of(scene), max(link.length for link in scene.links())
    hanging = sum(float(np.sum(block.mass.sum(0) * block.count)) for block in rig.blocks)
    mass = hanging + sum(float(carrier.mass) for carrier in rig.carriers if carrier.M is None)
    rate, weight = (scene.gravity / length) ** 0.5, mass * scene.gravity
    places = {"m": length, "m/s": length * rate, "m/s^2": scene.gravity}
    scales = {**places, "rad": 1.0, "rad/s": rate, "N": weight, "N m": weight * length}
    coordinates = coordinates_of(rig.structure) if rig.structure else ()
    inertias = [M for carrier in rig.carriers if carrier.M is not None for M in np.diag(carrier.M)]
    for modal, inertia in zip((each for each in coordinates if not each.unit), inertias, strict=True):
        largest = length * float(mass / inertia) ** 0.5
        scales |= {modal.name: largest, modal.derivative(1): largest * rate, modal.force: weight * length / largest}
    return scales


def _kind(signal: Signal) -> str:
    """What a signal shares its scale with: its unit, or its name on a modal support, whose coordinates differ."""
    return signal.name if signal.unit.startswith("1") else signal.unit


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
    refuse_any(problems)
