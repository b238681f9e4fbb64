"""Inputs of the measures at a point of a sweep: the modes of a scene, a run from its start, results of members.

The name of a quantity ends in its unit, `omega_1_rad_per_s`, unless it is dimensionless, `damping_ratio_1`.  Some are
computed from the oscillating modes, Im λ ≠ 0, others from a run of some seconds from the scene's own start, or else,
at every point, that of `nonlinear.reduction.usual_start`.  What an ensemble measures is
measured of members here, too.

All points of a sweep number their modes as in the table of the original scene, so that curves continue smoothly where
dampers appear and where frequencies become equal: the k-th oscillating mode, counting copies, is the k-th there, and
copies of mode 2 are 2, 2b, 2c, …  A point with more or fewer oscillating modes uses the numbers of its own table.  A
quantity beyond double precision is NaN.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property, lru_cache, partial
from itertools import islice
from math import radians

import numpy as np
from numpy.typing import NDArray

from modal.assembly import can_stack
from modal.coupling import passes_energy
from modal.errors import ComputationError, MultipendulaError, SceneError, gathered, refuse_any
from modal.extend.measures import LAST_TENTH, WHOLE_MOTION, Measure, parse_request
from modal.modes import UNCERTAIN, Modes, natural_frequencies, natural_modes, number_labels
from modal.report import counted
from modal.scene import Scene
from modal.vibration import ParametricStability, parametric_stability, stabilities
from nonlinear.chaos import usual_duration
from nonlinear.ensembles import measured_run, measured_together, run_together, times_of
from nonlinear.integration import Trajectory, validate
from nonlinear.orbits import Orbit, mode_orbit
from nonlinear.reduction import usual_start
from nonlinear.simulation import simulate

Values = NDArray[np.complex128]


Swinging = tuple[Values, tuple[int, ...]]
"""λ of all oscillating modes, repeated by multiplicity, |λ| ascending, and the number of each."""


class Portion:
    """Scenes that are measured together; inputs of measures are computed for all on first use.

    Modes are numbered as in the `table` of a scene.
    """

    def __init__(self, scenes: Sequence[Scene], table: Scene) -> None:
        self.scenes, self.table = scenes, table
        self._runs: dict[float, dict[Scene, Trajectory]] = {}
        self._latest: dict[tuple[Scene, float], Trajectory] = {}
        self._members: dict[tuple[str, float], dict[Scene, dict[str, float]]] = {}

    def run(self, scene: Scene, seconds: float) -> Trajectory:
        """The runs of scenes, together where they are of one form; KeyboardInterrupt where Ctrl-C cut it short."""
        if seconds not in self._runs:
            self._runs[seconds] = run_together(self.scenes, seconds)
        if together := self._runs[seconds].get(scene):
            return together
        if (scene, seconds) not in self._latest:
            self._latest = {(scene, seconds): _run_of(scene, seconds)}
        return self._latest[scene, seconds]

    def member(self, scene: Scene, seconds: float, name: str) -> dict[str, float]:
        """A measure of ensembles for a scene from its usual start, an exponent over its usual time where that is 0."""
        if (name, seconds) not in self._members:
            durations: dict[float, list[Scene]] = {}
            for each in self.scenes:
                durations.setdefault(seconds or usual_duration(each), []).append(each)
            self._members[name, seconds] = {}
            for duration, alike in durations.items():
                with suppress(MultipendulaError):  # a scene that is measured alone reports its own reason
                    self._members[name, seconds] |= measured_together(alike, duration, name)
        known = self._members[name, seconds].get(scene)
        return known or measured_together([scene], seconds or usual_duration(scene), name)[scene]

    def ending(self, scene: Scene, seconds: float, name: str) -> dict[str, float]:
        """A measure that ensembles read off the last tenth, of the run."""
        return measured_run(self.run(scene, seconds), name)

    def modes(self, scene: Scene) -> Modes:
        """The modes of a scene."""
        return natural_modes(scene)

    def orbit(self, scene: Scene, number: int, angle_deg: float) -> Orbit:
        """The orbit of a mode with this largest angle of any link."""
        return mode_orbit(scene, number, radians(angle_deg))

    @cached_property
    def _modes(self) -> dict[Scene, Swinging]:
        if not self.scenes or not can_stack(self.scenes):
            return {}
        try:
            omega = natural_frequencies(self.scenes)
        except ComputationError:
            return {}
        numbers = np.cumsum(np.diff(omega, axis=1, prepend=np.nan) != 0, axis=1)
        rows = zip(self.scenes, omega, numbers, strict=True)
        return {scene: (1j * row[row > 0], tuple(labels[row > 0].tolist())) for scene, row, labels in rows}

    def swinging(self, scene: Scene) -> Swinging:
        """The modes of a scene; of several of one form they are computed together, as those of one alone are."""
        return self._modes.get(scene) or _swinging(scene)

    def numbers(self, scene: Scene) -> tuple[int, ...]:
        """The numbers of a scene's oscillating modes in the table, or in its own where their counts differ."""
        numbers, wanted = self.swinging(scene)[1], self.swinging(self.table)[1]
        return wanted if len(numbers) == len(wanted) else numbers

    def number_in_table(self, scene: Scene, number: int) -> int:
        """The number in the table of a mode that oscillates, by that of the scene itself; itself for another."""
        numbers = self.swinging(scene)[1]
        return self.numbers(scene)[numbers.index(number)] if number in numbers else number

    def slowest(self, scene: Scene, count: int) -> Iterator[tuple[str, np.complex128]]:
        """The first oscillating modes, |λ| ascending: the label of each, and λ."""
        return islice(zip(number_labels(self.numbers(scene)), self.swinging(scene)[0], strict=True), count)

    def passes(self, scene: Scene, number: int) -> bool:
        """Whether a mode and the next pass energy of some pendulum there and back: 4 w_1 w_2 of it, by its shares w."""
        order = np.argsort(self.swinging(scene)[0].imag, kind="stable").tolist()
        numbers, rows = self.numbers(scene), self.swinging(scene)[1]
        last = max(place for place, at in enumerate(order) if numbers[at] == number)
        modes = natural_modes(scene)
        sizes = [pendulum.n_links for pendulum in scene.pendulum for _ in range(pendulum.count)]
        first = np.cumsum([0, *sizes[:-1]])
        shares = [
            np.add.reduceat(
                sum(modes.shape(n, copy).kinetic_energy_share for copy in range(modes.multiplicity[n])), first
            )
            for n in (rows[order[last]] - 1, rows[order[last + 1]] - 1)
        ]
        return passes_energy(*shares)

    def gap(self, scene: Scene, number: int) -> tuple[int, float]:
        """A mode's number (0: the first that oscillates), and the gap in Im λ (rad/s) from its last copy onwards."""
        values, listed = self.swinging(scene)[0].imag, self.numbers(scene)
        order = np.argsort(values, kind="stable")
        omega, numbers = values[order], [listed[place] for place in order]
        number = number or next(iter(numbers), 0)
        last = max((place for place, listed_number in enumerate(numbers) if listed_number == number), default=-1)
        if last < 0:
            raise ComputationError(f"mode {number} of the table does not oscillate: {_those(numbers)}")
        if last + 1 == len(numbers):
            raise ComputationError(f"no mode oscillates after mode {number} of the table: {_those(numbers)}")
        return number, float(omega[last + 1] - omega[last])

    @cached_property
    def _stability(self) -> dict[Scene, ParametricStability]:
        with suppress(SceneError, ComputationError):  # each reports its own reason
            return dict(zip(self.scenes, stabilities(self.scenes), strict=True))
        return {}

    def stability(self, scene: Scene) -> ParametricStability:
        """The Floquet multipliers of a scene, together with those of others that differ in their motion alone."""
        return self._stability.get(scene) or parametric_stability(scene)


@dataclass(frozen=True)
class RequestedMeasure:
    """A measure with its N, 0 if it chooses one itself; its class is at module level, for other processes."""

    measure: Measure
    number: float

    def __post_init__(self) -> None:
        if self.number != self.measure.usual:
            self.measure.validate(self.number)

    @property
    def name(self) -> str:
        """The name of the measure."""
        return self.measure.name

    @property
    def runs(self) -> bool:
        """Whether it reads a run of N seconds."""
        return self.measure.reads in (WHOLE_MOTION, LAST_TENTH)

    @property
    def text(self) -> str:
        """The text of the request: `frequencies:4`."""
        return f"{self.name}:{self.number:g}" if self.number else self.name

    def of(self, scene: Scene, table: Scene | None = None) -> dict[str, float]:
        """Its values for a scene; modes are numbered as in the table of `table`, by default of the scene itself."""
        return self.measure.of_scene(scene, self.number, Portion([scene], table or scene))


@lru_cache(maxsize=2)
def _swinging(scene: Scene) -> Swinging:
    modes = natural_modes(scene)
    certain = np.where(modes.error < UNCERTAIN, modes.eigenvalue, np.nan)
    rows = np.repeat(np.arange(len(modes)), np.where(modes.eigenvalue.imag != 0, modes.multiplicity, 0))
    return certain[rows], tuple((rows + 1).tolist())


def _run_of(scene: Scene, seconds: float) -> Trajectory:
    trajectory = simulate(scene, seconds, start=usual_start(scene), output=times_of(scene, seconds))
    if trajectory.run.interrupted:
        raise KeyboardInterrupt
    return trajectory


def _those(numbers: list[int]) -> str:
    range_of = f", from {min(numbers)} to {max(numbers)}" if numbers else ""
    return counted(len(numbers), "mode oscillates", "modes oscillate") + range_of


def validate_requests(requests: Sequence[RequestedMeasure], scene: Scene) -> None:
    """Raise SceneError if a scene lacks the measured quantity, before anything is computed."""
    validate(*(partial(request.measure.require, scene, 0.0) for request in requests))


def parse_measures(texts: Sequence[str], verb: str = "sweep") -> tuple[RequestedMeasure, ...]:
    """The measures in texts such as "frequencies" or "frequencies:6"; raise SceneError with every mistake.

    >>> [request.text for request in parse_measures(["frequencies:6", "beat"])]
    ['frequencies:6', 'beat']
    """
    requests: dict[str, RequestedMeasure] = {}
    problems: list[str] = []
    for text in texts:
        with gathered(problems):
            measure, number = parse_request(verb, text)
            request = RequestedMeasure(measure, number)
            name = request.text if measure.whole else measure.name
            if name in requests:
                raise SceneError([f"measure {text}: {name} is requested twice"])
            requests[name] = request
    refuse_any(problems)
    return tuple(requests.values())
