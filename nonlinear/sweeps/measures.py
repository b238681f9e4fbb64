"""How a sweep computes the measures of `nonlinear.measures` at a point: of a scene, or of a run from its start.

The name of a quantity ends in its unit, `omega_1_rad_per_s`, unless it is dimensionless, `damping_ratio_1`.  Some are
computed from the oscillating modes, Im λ ≠ 0, others from a run of some seconds from the scene's own start, or else,
at every point, that of `nonlinear.reduction.usual_start`.  What an ensemble measures too is its function, here too.

All points of a sweep number their modes as in the table of the original scene, so that curves continue smoothly where
dampers appear and where frequencies become equal: the k-th oscillating mode, counting copies, is the k-th there, and
copies of mode 2 are 2, 2b, 2c, …  A point with more or fewer oscillating modes uses the numbers of its own table.  A
quantity beyond double precision is NaN.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import lru_cache
from itertools import islice
from math import inf, nan, pi
from threading import local

import numpy as np
from numpy.typing import NDArray

from modal.assembly import can_stack
from modal.coupling import passes_energy
from modal.errors import ComputationError, SceneError
from modal.modes import UNCERTAIN, labelled, natural_frequencies, natural_modes
from modal.report import counted
from modal.scene import Scene, require
from modal.vibration import ParametricStability, parametric_stability, stabilities, vertical_sine
from nonlinear.chaos import usual_duration
from nonlinear.ensembles import measured_run, measured_together, run_together, times_of, validate_measures
from nonlinear.integration import Trajectory
from nonlinear.measures import MEASURES, Measure, requested
from nonlinear.postprocessing import extremes
from nonlinear.postprocessing import largest_angle as widest
from nonlinear.reduction import usual_start
from nonlinear.simulation import simulate
from nonlinear.synchronization import Survival, find_survival

Values = NDArray[np.complex128]


@dataclass(frozen=True)
class Computation:
    """How a measure is computed: a function of a scene and N, 0 where it chooses one itself.

    The function is at module level, so that other processes can import it.  `numbered` marks one whose third argument
    is the scene in whose table the modes are numbered, `runs` one that reads a run of so many seconds.  `door` refuses
    a scene before anything is computed; `together` computes what the function needs of several scenes, for N.
    """

    measure: Measure
    function: Callable[..., dict[str, float]]
    numbered: bool = False
    runs: bool = False
    door: Callable[[Scene], object] | None = None
    together: Callable[[Sequence[Scene], float], object] | None = None

    @property
    def name(self) -> str:
        """Of the measure."""
        return self.measure.name


@dataclass(frozen=True)
class RequestedMeasure:
    """A measure's computation with its number."""

    computation: Computation
    number: float

    def __post_init__(self) -> None:
        if self.number != self.computation.measure.usual:
            self.computation.measure.validate(self.number)

    @property
    def name(self) -> str:
        """Of the measure."""
        return self.computation.name

    @property
    def text(self) -> str:
        """The text of the request: `frequencies:4`."""
        return f"{self.name}:{self.number:g}" if self.number else self.name

    def of(self, scene: Scene, table: Scene | None = None) -> dict[str, float]:
        """Its values for a scene; modes are numbered as in the table of `table`, by default of the scene itself."""
        more = [table or scene] if self.computation.numbered else []
        return self.computation.function(scene, self.number, *more)


Swinging = tuple[Values, tuple[int, ...]]


class Known(local):
    """What was computed of several scenes together, for the measures of each; every thread has its own points."""

    def __init__(self) -> None:
        self.runs: dict[tuple[Scene, float], Trajectory] = {}
        self.modes: dict[Scene, Swinging] = {}
        self.stability: dict[Scene, ParametricStability] = {}
        self.members: dict[tuple[str, float], dict[Scene, dict[str, float]]] = {}


_KNOWN = Known()


def run_all_together(scenes: Sequence[Scene], durations: Iterable[float]) -> None:
    """Have the runs of these scenes at hand for measures, side by side where they are of one form."""
    _KNOWN.runs = {
        (scene, seconds): run for seconds in durations for scene, run in run_together(scenes, seconds).items()
    }


def find_together(scenes: Sequence[Scene]) -> None:
    """Compute and cache the modes of these scenes for measures, together where they have one form, as one alone has."""
    _KNOWN.modes = {}
    if not scenes or not can_stack(scenes):
        return
    try:
        omega = natural_frequencies(scenes)
    except ComputationError:
        return
    numbers = np.cumsum(np.diff(omega, axis=1, prepend=np.nan) != 0, axis=1)
    for scene, row, labels in zip(scenes, omega, numbers, strict=True):
        _KNOWN.modes[scene] = 1j * row[row > 0], tuple(labels[row > 0].tolist())


def swinging(scene: Scene) -> Swinging:
    """λ of all oscillating modes, repeated by multiplicity, |λ| ascending, and the number of each."""
    return _KNOWN.modes.get(scene) or _swinging(scene)


@lru_cache(maxsize=2)
def _swinging(scene: Scene) -> Swinging:
    modes = natural_modes(scene)
    certain = np.where(modes.error < UNCERTAIN, modes.eigenvalue, np.nan)
    rows = np.repeat(np.arange(len(modes)), np.where(modes.eigenvalue.imag != 0, modes.multiplicity, 0))
    return certain[rows], tuple((rows + 1).tolist())


def numbers_in(scene: Scene, table: Scene) -> tuple[int, ...]:
    """The numbers of a scene's oscillating modes in the table of another, or in its own if their counts differ."""
    numbers, wanted = swinging(scene)[1], swinging(table)[1]
    return wanted if len(numbers) == len(wanted) else numbers


def frequencies(scene: Scene, count: float, table: Scene) -> dict[str, float]:
    """The lowest natural frequencies |λ|."""
    return {f"omega_{name}_rad_per_s": float(abs(value)) for name, value in _first(scene, count, table)}


def damping(scene: Scene, count: float, table: Scene) -> dict[str, float]:
    """The damping ratios −Re λ/|λ| of these modes."""
    return {f"damping_ratio_{name}": float(-v.real / abs(v) + 0.0) for name, v in _first(scene, count, table)}


def _first(scene: Scene, count: float, table: Scene) -> Iterator[tuple[str, np.complex128]]:
    return islice(zip(labelled(numbers_in(scene, table)), swinging(scene)[0], strict=True), int(count))


def splitting(scene: Scene, number: float, table: Scene) -> dict[str, float]:
    """The frequency gap from one mode to the next."""
    name, gap = _gap(scene, int(number), table)
    return {f"splitting_{name}_rad_per_s": gap}


def beat(scene: Scene, number: float, table: Scene) -> dict[str, float]:
    """The beat period 2π/Δω of a mode and the next; infinite where they pass no energy between pendula."""
    name, gap = _gap(scene, int(number), table)
    return {f"beat_{name}_s": 2 * pi / gap if gap and _passes(scene, name, table) else inf}


def _passes(scene: Scene, number: int, table: Scene) -> bool:
    """Whether a mode and the next pass energy of some pendulum there and back: 4 w_1 w_2 of it, by their shares w."""
    order = np.argsort(swinging(scene)[0].imag, kind="stable").tolist()
    numbers, rows = numbers_in(scene, table), swinging(scene)[1]
    last = max(place for place, at in enumerate(order) if numbers[at] == number)
    modes = natural_modes(scene)
    sizes = [pendulum.n_links for pendulum in scene.pendulum for _ in range(pendulum.count)]
    first = np.cumsum([0, *sizes[:-1]])
    shares = [
        np.add.reduceat(sum(modes.shape(n, copy).kinetic_energy_share for copy in range(modes.multiplicity[n])), first)
        for n in (rows[order[last]] - 1, rows[order[last + 1]] - 1)
    ]
    return passes_energy(*shares)


def _gap(scene: Scene, number: int, table: Scene) -> tuple[int, float]:
    """A mode's number (0: the first oscillating one), and the gap in Im λ (rad/s) from its last copy to the next."""
    values, listed = swinging(scene)[0].imag, numbers_in(scene, table)
    order = np.argsort(values, kind="stable")
    omega, numbers = values[order], [listed[place] for place in order]
    number = number or next(iter(numbers), 0)
    last = max((place for place, listed_number in enumerate(numbers) if listed_number == number), default=-1)
    if last < 0:
        raise ComputationError(f"mode {number} of the table does not oscillate: {_those(numbers)}")
    if last + 1 == len(numbers):
        raise ComputationError(f"no mode oscillates after mode {number} of the table: {_those(numbers)}")
    return number, float(omega[last + 1] - omega[last])


def _those(numbers: list[int]) -> str:
    range_of = f", from {min(numbers)} to {max(numbers)}" if numbers else ""
    return counted(len(numbers), "mode oscillates", "modes oscillate") + range_of


def run_of(scene: Scene, seconds: float) -> Trajectory:
    """The run, cached for the next measure of the same scene; KeyboardInterrupt where Ctrl-C cut it short."""
    return _KNOWN.runs.get((scene, seconds)) or _run_of(scene, seconds)


@lru_cache(maxsize=1)
def _run_of(scene: Scene, seconds: float) -> Trajectory:
    trajectory = simulate(scene, seconds, start=usual_start(scene), output=times_of(scene, seconds))
    if trajectory.run.interrupted:
        raise KeyboardInterrupt
    return trajectory


def energy_drift(scene: Scene, seconds: float) -> dict[str, float]:
    """The energy drift of the run, relative."""
    return {"energy_drift": run_of(scene, seconds).energy_drift()}


def largest_angle(scene: Scene, seconds: float) -> dict[str, float]:
    """The largest angle of any link from the downward vertical, also at turning points between the samples."""
    return {"largest_angle_deg": float(np.degrees(widest(run_of(scene, seconds))))}


def cart_travel(scene: Scene, seconds: float) -> dict[str, float]:
    """The peak-to-peak travel of the cart, also at turning points between the samples."""
    run = run_of(scene, seconds)
    left, right = extremes(run.times, run.motion.cart, run.motion.cart_rate)
    return {"cart_travel_m": float(right - left)}


def side_by_side(name: str, scenes: Sequence[Scene], seconds: float) -> None:
    """Have a measure of ensembles at hand for these scenes from their usual starts."""
    _KNOWN.members[name, seconds] = measured_together(scenes, seconds, name)


def turn_together(scenes: Sequence[Scene], seconds: float) -> None:
    """The first turns of these scenes."""
    side_by_side("first_turn", scenes, seconds)


def first_turn(scene: Scene, seconds: float) -> dict[str, float]:
    """When each link first goes over the top."""
    known = _KNOWN.members.get(("first_turn", seconds), {})
    return known.get(scene) or measured_together([scene], seconds, "first_turn")[scene]


def diverge_together(scenes: Sequence[Scene], seconds: float) -> None:
    """The exponents of these scenes, each over its usual duration where that is 0."""
    for duration in dict.fromkeys(seconds or usual_duration(scene) for scene in scenes):
        alike = [scene for scene in scenes if seconds or usual_duration(scene) == duration]
        side_by_side("lyapunov", alike, duration)


def lyapunov(scene: Scene, seconds: float) -> dict[str, float]:
    """The largest Lyapunov exponent of the usual start, measured for so long after a transient of half that time."""
    duration = seconds or usual_duration(scene)
    known = _KNOWN.members.get(("lyapunov", duration), {})
    return known.get(scene) or measured_together([scene], duration, "lyapunov")[scene]


@lru_cache(maxsize=1)
def _survival(scene: Scene, seconds: float) -> Survival:
    return find_survival(run_of(scene, seconds))


def order(scene: Scene, seconds: float) -> dict[str, float]:
    """The order parameter of the leading fixed-base mode, its mean over the last tenth."""
    return measured_run(run_of(scene, seconds), "order")


def survivor(scene: Scene, seconds: float, table: Scene) -> dict[str, float]:
    """The number in the table of the mode with most energy at the end, and its share."""
    survival = _survival(scene, seconds)
    number, numbers = survival.number, swinging(scene)[1]
    if number in numbers:
        number = numbers_in(scene, table)[numbers.index(number)]
    return {"survivor": float(number), "survivor_share": survival.survivor_share}


def locking(scene: Scene, seconds: float) -> dict[str, float]:
    """The time from which all other rows hold less than 1 % together; NaN if never."""
    time = _survival(scene, seconds).locking_time()
    return {"locking_time_s": nan if time is None else time}


def pendulum_energy(scene: Scene, seconds: float) -> dict[str, float]:
    """Mean energies over the last tenth: of all pendula, of each where they are few, and of the cart."""
    return measured_run(run_of(scene, seconds), "pendulum_energy")


def configuration(scene: Scene, seconds: float) -> dict[str, float]:
    """The number of the relative equilibrium of `sync` at the end, 0 for none."""
    return measured_run(run_of(scene, seconds), "configuration")


def multiply_together(scenes: Sequence[Scene], number: float) -> None:
    """Compute and cache the Floquet multipliers of these scenes, together where they differ in their motion alone."""
    _KNOWN.stability = {}
    with suppress(SceneError, ComputationError):  # each tells its own reason
        _KNOWN.stability = dict(zip(scenes, stabilities(scenes), strict=True))


def floquet(scene: Scene, number: float) -> dict[str, float]:
    """The largest Floquet multiplier of small angles on a support that moves up and down, and what it means."""
    stability = _KNOWN.stability.get(scene) or parametric_stability(scene)
    return {
        "largest_multiplier": stability.largest,
        "growth_rate_per_s": stability.growth_rate,
        "kind": float(stability.number),
    }


def in_plane(scene: Scene) -> None:
    """SceneError where no link of a scene goes over the top."""
    validate_measures(("first_turn",), scene)


def of_growth(scene: Scene) -> None:
    """SceneError where a scene has no Lyapunov exponent."""
    require(scene, "a Lyapunov exponent")


def of_phases(scene: Scene) -> None:
    """SceneError where the pendula of a scene have no order parameter."""
    validate_measures(("order",), scene)


def of_drives(scene: Scene) -> None:
    """SceneError where a scene has no steady oscillations."""
    validate_measures(("configuration",), scene)


FLOQUET = "floquet"
COMPUTATIONS: dict[str, Computation] = {
    computation.name: computation
    for computation in (
        *(
            Computation(MEASURES[function.__name__], function, numbered=True)
            for function in (frequencies, damping, splitting, beat)
        ),
        Computation(MEASURES[FLOQUET], floquet, door=vertical_sine, together=multiply_together),
        *(
            Computation(MEASURES[function.__name__], function, runs=True)
            for function in (largest_angle, cart_travel, energy_drift, pendulum_energy, locking)
        ),
        Computation(MEASURES["first_turn"], first_turn, door=in_plane, together=turn_together),
        Computation(MEASURES["lyapunov"], lyapunov, door=of_growth, together=diverge_together),
        Computation(MEASURES["order"], order, runs=True, door=of_phases),
        Computation(MEASURES["survivor"], survivor, runs=True, numbered=True),
        Computation(MEASURES["configuration"], configuration, runs=True, door=of_drives),
    )
}
"""How each measure that a sweep takes is computed."""


def parse_measures(texts: Sequence[str], verb: str = "sweep") -> tuple[RequestedMeasure, ...]:
    """The measures in texts such as "frequencies" or "frequencies:6"; SceneError names every mistake.

    >>> [request.text for request in parse_measures(["frequencies:6", "beat"])]
    ['frequencies:6', 'beat']
    """
    requests: dict[str, RequestedMeasure] = {}
    problems: list[str] = []
    for text in texts:
        try:
            measure, number = requested(verb, text)
            request = RequestedMeasure(COMPUTATIONS[measure.name], number)
            name = request.text if measure.whole else measure.name
            if name in requests:
                raise SceneError([f"{text}: {name} is requested twice"])
            requests[name] = request
        except SceneError as error:
            problems += error.problems
    if problems:
        raise SceneError(problems)
    return tuple(requests.values())
