"""The outcome of a motion of a driven scene, recognized by its returns to a section and by the orbit near them.

Its first pendulum passes its angle at rest to the right once a swing.  A motion whose returns repeat to 1e-6, in
natural units, is periodic, and its orbit is what Newton's method finds there (`ending_orbit`); one whose returns are a
function of one more phase is a torus, a beat where the phases between pendula stay bounded, else drifting.  What is
neither has not settled, or is chaos, which an exponent decides (`nonlinear.chaos`).

To judge a run, `ending_of(returns_of(trajectory), trajectory.scene)`, with `nonlinear.postprocessing.returns`; of
periodic ones `ending_orbit(scene, ending)` and `rhythm_of(orbit)` give orbit and name.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from modal.errors import ComputationError
from modal.report import Displayed, Summary
from modal.scene import Scene
from modal.scene.doors import checked
from modal.types import Complexes, Floats, Ints
from nonlinear.orbits import Orbit, periodic_orbit
from nonlinear.postprocessing.returns import (
    JUDGED_STROBES,
    Returns,
    locked_rotation,
    natural_rate,
    natural_units,
    repetition,
    slow_rotation,
)
from nonlinear.synchronization.patterns import STILL_AMPLITUDE_RATIO, amplitudes_of, rhythm_name
from nonlinear.synchronization.phases import from_rest
from nonlinear.system import State, populations_of, system_of

CLOSING_GAP = 1e-6
"""Tolerance: in natural units, within which returns of a settled motion repeat, and equal pendula move as one."""
AT_REST, PERIODIC, TORUS, OPEN = "at rest", "periodic", "torus", "open"


@dataclass(frozen=True, eq=False, repr=False)
class Ending(Displayed):
    """The verdict from returns: `kind` "at rest", "periodic", "torus" or "open", which has not settled or is chaos.

    `period` (s) is that of a periodic motion, else the mean time of a return; `slow_period` (s) that of a torus, on
    which pendula may be `drifting` apart.  `chimera`: some equal pendula move as one, others of them do not.
    `record` (K, D) are the last returns in natural units, with equal pendula in an order of their own; `state` is the
    last return.  A periodic motion repeats after so many `returns`, its links by whole `turns` further.
    """

    kind: str
    period: float
    record: Floats
    state: State
    returns: int = 0
    slow_period: float | None = None
    drifting: bool = False
    chimera: bool = False
    turns: tuple[int, ...] = ()

    def _summary(self) -> Summary:
        return Summary(f"Ending: {self.name}", [("period", f"{self.period:.6g} s")])

    @property
    def name(self) -> str:
        """Of motions that are not periodic; the names of others come from their orbits."""
        if self.chimera:
            return "chimera"
        if self.kind == TORUS:
            return "drifting" if self.drifting else "beat"
        return self.kind


def ending_of(returns: Returns, scene: Scene) -> Ending:
    """Return the outcome of a motion; "open" also for fewer than 50 returns."""
    system = system_of(scene)
    links, rates, *others = returns.states
    record = natural_units(system, [part[None] for part in (from_rest(system, links), rates, *others)])[0]
    count = len(record)
    last = record[-JUDGED_STROBES:]
    if count < JUDGED_STROBES:
        return Ending(OPEN, np.nan, record, returns.state(-1) if count else State(np.zeros(0), np.zeros(0)))
    state, mean = returns.state(-1), returns.mean_time
    ordered = _ordered(last, scene)
    (repeats,), (turns,) = (part.tolist() for part in repetition(last[None], system.n_links, CLOSING_GAP))
    if repeats:
        size = np.linalg.norm(last, axis=1)
        kind = AT_REST if size[-1] < 0.9 * size[0] or size[-1] < CLOSING_GAP else PERIODIC
        period = float(returns.times[-1] - returns.times[-1 - repeats])
        return Ending(kind, period, ordered, state, repeats, turns=tuple(turns))
    late = record[-1024:]
    nu = slow_rotation(late) or locked_rotation(late, CLOSING_GAP)
    if nu is None:
        return Ending(OPEN, mean, ordered, state, chimera=_is_chimera(last, scene))
    drifting = _largest_drift(late, system.n_links, natural_rate(system) * mean / (2 * np.pi)) >= 2
    return Ending(TORUS, mean, ordered, state, 0, mean / nu, drifting, _is_chimera(last, scene))


def _largest_drift(record: Floats, links: int, rate: float) -> float:
    """By how many turns the phase of any link that swings runs away from that of the first over a record (K, D).

    `rate` is the unit of its rates over the angular frequency of the returns.
    """
    z = record[:, :links] - 1j * record[:, links : 2 * links] * rate
    size = np.abs(z).mean(axis=0)
    turns = np.angle(z[1:] * z[:-1].conj()).sum(axis=0) / (2 * np.pi)
    return float(np.abs(turns[size >= STILL_AMPLITUDE_RATIO * size.max()]).max())


@lru_cache(maxsize=8)
def _equal_pendula(scene: Scene) -> tuple[Ints, ...]:
    """The links (P, n), from 0, of equal pendula that move alike, without the first, by which motions return."""
    columns = _links_of(scene)
    populations = [population.pendula for population in populations_of(scene) if population.are_alike]
    return tuple(np.array([columns[p] for p in pendula if p]) for pendula in populations)


def _links_of(scene: Scene) -> list[Ints]:
    """The links (n,), from 0, of every pendulum."""
    sizes = [pendulum.n_links for pendulum in scene.pendulum for _ in range(pendulum.count)]
    return np.split(np.arange(sum(sizes)), np.cumsum(sizes)[:-1])


def _ordered(record: Floats, scene: Scene) -> Floats:
    """The record with equal pendula in the order of their last angles and rates."""
    links, columns = sum(map(len, _links_of(scene))), record.copy()
    for places in _equal_pendula(scene):
        if len(places) > 1:
            keys = record[-1, places[:, 0]] + np.sqrt(2) * record[-1, links + places[:, 0]]
            order = places[np.argsort(keys)]
            for shift in (0, links):
                columns[:, (shift + places).ravel()] = record[:, (shift + order).ravel()]
    return columns


def _is_chimera(last: Floats, scene: Scene) -> bool:
    """Whether of equal pendula, on whichever support, two or more move as one and two or more do not."""
    columns, kinds = _links_of(scene), dict[object, list[int]]()
    links = sum(map(len, columns))
    for population in populations_of(scene):
        kinds.setdefault(population.pendulum, []).extend(population.pendula.tolist())
    for pendula in kinds.values():
        motions = np.array([last[:, np.concatenate((columns[p], links + columns[p]))] for p in pendula])
        motions = motions.reshape(len(pendula), -1)
        motions = motions[np.argsort(motions @ np.cos(np.arange(motions.shape[1])))]
        alike = np.abs(np.diff(motions, axis=0)).max(axis=1) < CLOSING_GAP
        alike = np.append(alike, False) | np.append(False, alike)
        if alike.sum() >= 2 and (~alike).sum() >= 2:
            return True
    return False


@checked
def ending_orbit(scene: Scene, ending: Ending) -> Orbit | None:
    """The orbit of a periodic ending, None where Newton's method finds none."""
    if ending.kind != PERIODIC:
        return None
    try:
        orbit = periodic_orbit(scene, ending.state, ending.period)
    except ComputationError:
        return None
    return orbit if orbit.residual < orbit.amplitude else None


def orbit_amplitudes(orbit: Orbit) -> Complexes:
    """η (N,) in rad of every pendulum over an orbit, in the fixed-base mode with most energy, of its strongest line."""
    system = orbit.flow.system
    angles = orbit.coordinates[:, orbit.flow.equations.layout.first :] - system.rest
    lines = np.fft.fft(angles, axis=0)[1 : len(angles) // 2] / (len(angles) / 2)
    return amplitudes_of(lines[np.linalg.norm(lines, axis=1).argmax()], system)


def rhythm_of(orbit: Orbit) -> str:
    """The name of the pattern of an orbit."""
    populations = populations_of(orbit.scene)
    return rhythm_name(orbit_amplitudes(orbit), are_equal=len(populations) == 1 and populations[0].are_alike)
