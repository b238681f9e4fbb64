"""Measures: named quantities that a sweep computes at every point.

The name of a quantity ends in its unit, `omega_1_rad_per_s`, unless it is dimensionless, `damping_ratio_1`.  Some are
computed from the oscillating modes, Im λ ≠ 0, others from a run of some seconds from the scene's own start, or else,
at every point, that of `nonlinear.reduction.usual_start`.

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
from math import inf, isfinite, nan, pi
from threading import local

import numpy as np
from numpy.typing import NDArray

from modal.assembly import can_stack
from modal.errors import ComputationError, SceneError, meant
from modal.modes import UNCERTAIN, labelled, natural_frequencies, natural_modes
from modal.report import counted
from modal.scene import Scene
from modal.types import Floats
from modal.vibration import KINDS, ParametricStability, parametric_stability, stabilities, vertical_sine
from nonlinear.chaos import lyapunov_exponent
from nonlinear.ensembles import run_together
from nonlinear.integration import Trajectory
from nonlinear.postprocessing import extremes, largest_angle, last
from nonlinear.reduction import usual_start
from nonlinear.simulation import simulate
from nonlinear.synchronization import ENDING, Phases, Survival, find_survival, phases_of

Values = NDArray[np.complex128]
FEW = 4  # pendula up to which each energy is reported
USUAL, LONGEST = 100.0, 1e6  # seconds


@dataclass(frozen=True)
class Measure:
    """A function of a scene and one number, `usual` by default (0: it chooses one itself).

    `words` describe the result. The function is at module level, so that other processes can import it.  `whole` marks
    a number that counts something, `numbered` a function whose third argument is the scene in whose table the modes are
    numbered, `runs` one that reads a run of so many seconds.  With `most` 0 it takes no number.
    `door` refuses a scene before anything is computed; `together` computes what the function needs of several scenes.
    """

    name: str
    function: Callable[..., dict[str, float]]
    usual: float
    words: str
    whole: bool = True
    most: float = 1000
    numbered: bool = False
    runs: bool = False
    door: Callable[[Scene], object] | None = None
    together: Callable[[Sequence[Scene]], object] | None = None


@dataclass(frozen=True)
class RequestedMeasure:
    """A measure with its number."""

    measure: Measure
    number: float

    def __post_init__(self) -> None:
        if self.number != self.measure.usual:
            self.validate()

    def validate(self) -> RequestedMeasure:
        """The measure itself; SceneError where its number is out of range."""
        if not self.measure.most:
            raise SceneError([f"{self.measure.name}:{self.number:g}: {self.measure.name} takes no number"])
        kind = f"a {'whole ' * self.measure.whole}number above 0 and at most {self.measure.most:g}"
        fits = isfinite(self.number) and 0 < self.number <= self.measure.most
        if not fits or (self.measure.whole and self.number != int(self.number)):
            raise SceneError([f"{self.measure.name}:{self.number:g}: must have {kind}"])
        return self

    @property
    def text(self) -> str:
        """The text of the request: `frequencies:4`."""
        return f"{self.measure.name}:{self.number:g}" if self.number else self.measure.name

    def of(self, scene: Scene, table: Scene | None = None) -> dict[str, float]:
        """Its values for a scene; modes are numbered as in the table of `table`, by default of the scene itself."""
        return self.measure.function(scene, self.number, *([table or scene] if self.measure.numbered else []))


Swinging = tuple[Values, tuple[int, ...]]


class Known(local):
    """What was computed of several scenes together, for the measures of each; every thread has its own points."""

    def __init__(self) -> None:
        self.runs: dict[tuple[Scene, float], Trajectory] = {}
        self.modes: dict[Scene, Swinging] = {}
        self.stability: dict[Scene, ParametricStability] = {}


_KNOWN = Known()


def run_all_together(scenes: Sequence[Scene], durations: Iterable[float]) -> None:
    """Have the runs of these scenes at hand for measures, side by side where they are of one form."""
    _KNOWN.runs = {
        (scene, seconds): run for seconds in durations for scene, run in run_together(scenes, seconds).items()
    }


def find_together(scenes: Sequence[Scene]) -> None:
    """Compute and cache the modes of these scenes for measures, together where they have the same form."""
    _KNOWN.modes = {}
    if len(scenes) < 2 or not can_stack(scenes):
        return
    try:
        omega = natural_frequencies(scenes)
    except ComputationError:
        return
    numbers = np.cumsum(np.diff(omega, axis=1, prepend=np.nan) != 0, axis=1)
    for scene, row, own in zip(scenes, omega, numbers, strict=True):
        _KNOWN.modes[scene] = 1j * row[row > 0], tuple(own[row > 0].tolist())


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
    own, given = swinging(scene)[1], swinging(table)[1]
    return given if len(own) == len(given) else own


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
    """The beat period 2π/Δω of a mode and the next."""
    name, gap = _gap(scene, int(number), table)
    return {f"beat_{name}_s": 2 * pi / gap if gap else inf}


def _gap(scene: Scene, number: int, table: Scene) -> tuple[int, float]:
    """A mode's number (0: the first oscillating one), and the gap in Im λ (rad/s) from its last copy to the next."""
    values, listed = swinging(scene)[0].imag, numbers_in(scene, table)
    order = np.argsort(values, kind="stable")
    omega, numbers = values[order], [listed[place] for place in order]
    number = number or next(iter(numbers), 0)
    last = max((place for place, own in enumerate(numbers) if own == number), default=-1)
    if last < 0:
        raise ComputationError(f"mode {number} of the table does not oscillate: {_those(numbers)}")
    if last + 1 == len(numbers):
        raise ComputationError(f"no mode oscillates after mode {number} of the table: {_those(numbers)}")
    return number, float(omega[last + 1] - omega[last])


def _those(numbers: list[int]) -> str:
    range_of = f", from {min(numbers)} to {max(numbers)}" if numbers else ""
    return counted(len(numbers), "mode oscillates", "modes oscillate") + range_of


NEXT = "mode N (default: the first oscillating mode) and the next"
MODAL = (
    Measure("frequencies", frequencies, 4, "the frequencies of the N slowest oscillating modes", numbered=True),
    Measure("damping", damping, 4, "the damping ratios of the N slowest oscillating modes", numbered=True),
    Measure("splitting", splitting, 0, f"the gap between the frequencies of {NEXT}", numbered=True),
    Measure("beat", beat, 0, f"the beat period of {NEXT}", numbered=True),
)


def run_of(scene: Scene, seconds: float) -> Trajectory:
    """The run, cached for the next measure of the same scene; KeyboardInterrupt where Ctrl-C cut it short."""
    return _KNOWN.runs.get((scene, seconds)) or _run_of(scene, seconds)


@lru_cache(maxsize=1)
def _run_of(scene: Scene, seconds: float) -> Trajectory:
    trajectory = simulate(scene, seconds, start=usual_start(scene))
    if trajectory.run.interrupted:
        raise KeyboardInterrupt
    return trajectory


def energy_drift(scene: Scene, seconds: float) -> dict[str, float]:
    """The energy drift of the run, relative."""
    return {"energy_drift": run_of(scene, seconds).energy_drift()}


def amplitude(scene: Scene, seconds: float) -> dict[str, float]:
    """The largest angle of any link from the downward vertical and the peak-to-peak travel of the cart.

    Both are evaluated at the turning points between the samples.
    """
    run = run_of(scene, seconds)
    left, right = extremes(run.times, run.motion.cart, run.motion.cart_rate)
    return {"largest_angle_deg": float(np.degrees(largest_angle(run))), "cart_travel_m": float(right - left)}


def lyapunov(scene: Scene, seconds: float) -> dict[str, float]:
    """The largest Lyapunov exponent of the usual start, measured for so long after a transient of half that time."""
    return {"lyapunov_per_s": lyapunov_exponent(scene, seconds or None, start=usual_start(scene), ensemble=1).value}


RUNS = (
    Measure("energy_drift", energy_drift, 10.0, "the relative drift of energy in N seconds", False, 1e6, runs=True),
    Measure(
        "amplitude", amplitude, 10.0, "the largest angle and the cart's travel in N seconds", False, 1e6, runs=True
    ),
    Measure("lyapunov", lyapunov, 0, "the largest Lyapunov exponent, from N seconds of the motion", False, 1e6),
)


@lru_cache(maxsize=1)
def _phases(scene: Scene, seconds: float) -> Phases:
    return phases_of(run_of(scene, seconds))


@lru_cache(maxsize=1)
def _survival(scene: Scene, seconds: float) -> Survival:
    return find_survival(run_of(scene, seconds))


def order(scene: Scene, seconds: float) -> dict[str, float]:
    """The order parameter of the leading fixed-base mode, its mean over the last tenth."""
    phases = _phases(scene, seconds)
    return {"order": float(_ending(phases, phases.order)[phases.leading])}


def survivor(scene: Scene, seconds: float, table: Scene) -> dict[str, float]:
    """The number in the table of the mode with most energy at the end, and its share."""
    found = _survival(scene, seconds)
    number, own = found.number, swinging(scene)[1]
    if number in own:
        number = numbers_in(scene, table)[own.index(number)]
    return {"survivor": float(number), "survivor_share": found.survivor_share}


def locking(scene: Scene, seconds: float) -> dict[str, float]:
    """The time from which all other rows hold less than 1 % together; NaN if never."""
    time = _survival(scene, seconds).locking_time()
    return {"locking_time_s": nan if time is None else time}


def pendulum_energy(scene: Scene, seconds: float) -> dict[str, float]:
    """Mean energies over the last tenth: of all pendula, of each where they are few, and of the cart."""
    phases = _phases(scene, seconds)
    mechanics = phases.trajectory.mechanics
    each = _ending(phases, phases.energy)
    found = {"pendula_energy_J": float(each.sum())}
    if len(each) <= FEW:
        found |= {f"pendulum_{number}_energy_J": float(value) for number, value in enumerate(each, 1)}
    if scene.cart is not None:
        found["cart_energy_J"] = float(_ending(phases, mechanics.cart_kinetic + mechanics.cart_potential))
    return found


def _ending(phases: Phases, values: Floats) -> Floats:
    return np.asarray(values[last(phases.times, ENDING)].mean(axis=0))


SYNC = tuple(
    Measure(function.__name__, function, USUAL, words, False, LONGEST, function is survivor, runs=True)
    for function, words in (
        (order, "the order parameter of the phases after N seconds, from 0 to 1"),
        (survivor, "the mode with most energy after N seconds, and its share"),
        (locking, "the time from which it has 99 %, within N seconds"),
        (pendulum_energy, "the mean energies of pendula and cart after N seconds"),
    )
)


def multiply_together(scenes: Sequence[Scene]) -> None:
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


FLOQUET = Measure(
    "floquet",
    floquet,
    0,
    "the largest Floquet multiplier of a vertical sine, its growth rate, and what small motion does: "
    + ", ".join(f"{number} {words}" for number, words in KINDS.items()),
    most=0,
    door=vertical_sine,
    together=multiply_together,
)
MEASURES: dict[str, Measure] = {measure.name: measure for measure in (*MODAL, *RUNS, *SYNC, FLOQUET)}


def parse_measures(texts: Sequence[str]) -> tuple[RequestedMeasure, ...]:
    """The measures in texts such as "frequencies" or "frequencies:6"; SceneError names every mistake.

    >>> [one.text for one in parse_measures(["frequencies:6", "beat"])]
    ['frequencies:6', 'beat']
    """
    found: dict[str, RequestedMeasure] = {}
    problems: list[str] = []
    for text in texts:
        try:
            one = _asked(text)
            name = one.text if one.measure.whole else one.measure.name
            if name in found:
                raise SceneError([f"{text}: {name} is requested twice"])
            found[name] = one
        except SceneError as error:
            problems += error.problems
    if problems:
        raise SceneError(problems)
    return tuple(found.values())


def _asked(text: str) -> RequestedMeasure:
    name, colon, number = text.partition(":")
    if name not in MEASURES:
        hint = meant(name, MEASURES) or f" (must be one of {', '.join(MEASURES)})"
        raise SceneError([f"{text}: no such measure{hint}"])
    measure = MEASURES[name]
    try:
        return (
            RequestedMeasure(measure, float(number)).validate() if colon else RequestedMeasure(measure, measure.usual)
        )
    except ValueError as error:
        if isinstance(error, SceneError):
            raise
        raise SceneError([f'{text}: "{number}" is not a number']) from None
