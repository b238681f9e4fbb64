"""Monte Carlo over tolerances: distributions of frequencies and motion for uncertain parameters.

A number is drawn from a normal distribution with a standard deviation, or evenly from an interval, all independent; the
numbers of a fit are drawn from their joint normal distribution.  Values that several places share
(`modal.scene.unknowns`) are drawn once.  How much of the variance of a result one number x
explains by a straight line is the square of their correlation,

    share = cov(x, r)²/(var x · var r),

which for small tolerances is (∂r/∂x σ_x)²/σ_r², so that the shares of independent numbers add up to 1.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property, partial
from operator import itemgetter
from typing import TYPE_CHECKING, Any

import numpy as np

from modal.errors import ComputationError, SceneError, gathered, refuse_any
from modal.modes import natural_frequencies
from modal.report import (
    NOTHING,
    Drawable,
    Form,
    ReportColumn,
    ReportTable,
    Result,
    counted,
    deferred,
    finite,
    grid,
    silent,
)
from modal.scene import Scene, describe, left_out
from modal.scene.doors import checked, formerly
from modal.scene.parameters import Place, Variable, texts_of, with_numbers
from modal.scene.signal_names import symbols_in
from modal.scene.unknowns import find_unknowns
from modal.types import Floats
from nonlinear.ensembles import Ensemble, ensemble
from nonlinear.ensembles.measures import places
from nonlinear.integration import validate, validate_whole
from nonlinear.sweeps.measures import parse_measures, validate_requests
from nonlinear.sweeps.study import MODES_TOGETHER_MAX, PointChunk, SweepTask, measure_chunk
from nonlinear.system import State, system_of

if TYPE_CHECKING:
    from modal.identification import Estimate

MOTION_SAMPLES = 201
"""Format: samples of the motion of members."""
QUANTILES, QUANTILE_NAMES = (0.05, 0.5, 0.95), ("q05", "q50", "q95")
WRITTEN = re.compile(r"\s*([^=]+?)\s*=\s*(?:([^:%]+)(%?)|([^:]+):([^:]+))\s*")


@dataclass(frozen=True)
class Tolerance:
    """A number of a scene, with a standard deviation `sigma` about its value, or evenly from `low` to `high`."""

    path: str
    sigma: float = 0.0
    low: float = 0.0
    high: float = 0.0

    @property
    def text(self) -> str:
        """As it is written."""
        return f"{self.path}={self.sigma:g}" if self.sigma else f"{self.path}={self.low:g}:{self.high:g}"

    def around(self, scene: Scene) -> str:
        """In words, with the scene's own number and its unit."""
        unknown = find_unknowns(scene, self.path)[0]
        unit = unknown.unit_name
        if self.sigma:
            value = _value(scene, self.path)
            return f"{unknown.words} = {value:g} ± {self.sigma:g} {unit}".rstrip()
        return f"{unknown.words} from {self.low:g} to {self.high:g} {unit}".rstrip()

    def drawn(self, value: float, count: int, rng: np.random.Generator) -> Floats:
        """Values, `count` of them."""
        if self.sigma:
            return np.asarray(value + self.sigma * rng.standard_normal(count))
        return rng.uniform(self.low, self.high, count)


def parse_tolerances(scene: Scene, texts: str | Sequence[str]) -> tuple[Tolerance, ...]:
    """The tolerances in texts such as "gravity=9.8:9.83", "support.mass=0.5" or "support.mass=2%".

    SceneError names every mistake.
    """
    parsed: list[Tolerance] = []
    problems: list[str] = []
    for text in texts_of(texts):
        with gathered(problems):
            parsed.append(_parsed(scene, text))
    paths = [tolerance.path for tolerance in parsed]
    problems += [f"uncertain {path}: has two tolerances" for path in dict.fromkeys(paths) if paths.count(path) > 1]
    names = [with_numbers(place) for path in dict.fromkeys(paths) for place in _places(scene, path)]
    problems += [f"uncertain {name}: has two tolerances" for name in dict.fromkeys(names) if names.count(name) > 1]
    if not texts:
        problems.append("uncertain: spread needs a tolerance: gravity=0.01, for example")
    refuse_any(problems)
    return tuple(parsed)


def _parsed(scene: Scene, text: str) -> Tolerance:
    match = WRITTEN.fullmatch(text)
    if not match:
        words = "must be PLACE=SIGMA, PLACE=PERCENT% or PLACE=LOW:HIGH"
        raise SceneError([f"uncertain {text[:60]}: {words}"])
    path, sigma, percent, low, high = match.groups()
    value = _value(scene, path)
    if sigma is None:
        ends = _number(text, low), _number(text, high)
        if not ends[0] < ends[1]:
            raise SceneError([f"uncertain {text}: an interval runs from a smaller to a larger number"])
        return Tolerance(path, low=ends[0], high=ends[1])
    unknown, *_ = find_unknowns(scene, path)
    if percent and unknown.is_shift:
        raise SceneError([f"uncertain {text}: a shift has no size to take a percentage of: give {unknown.unit_name}"])
    deviation = _number(text, sigma) * (abs(value) / 100 if percent else 1.0)
    if not deviation > 0:
        raise SceneError([f"uncertain {text}: a standard deviation must be above 0"])
    return Tolerance(path, sigma=deviation)


def _places(scene: Scene, path: str) -> list[Place]:
    """The numbers that a path is of."""
    return [place for unknown in find_unknowns(scene, path) for place in unknown.places]


def _value(scene: Scene, path: str) -> float:
    """The one value of a path in the scene, 0 of a shift."""
    unknowns = find_unknowns(scene, path)
    if any(place[-1] == "count" for place in _places(scene, path)):
        raise SceneError([f"uncertain {path}: a count has no tolerance"])
    values = {value for unknown in unknowns for value in ([0.0] if unknown.is_shift else unknown.given)}
    if len(values) > 1:
        words = "means several numbers of different value: give each its own tolerance, or all one shift:PLACE"
        raise SceneError([f"uncertain {path}: {words}"])
    return values.pop()


def _numbers(scene: Scene, values: dict[str, Floats]) -> dict[str, Floats]:
    """The numbers of the scene that values (S,) of its unknowns make, by their places."""
    numbers: dict[str, Floats] = {}
    for path, drawn in values.items():
        unknown, *_ = find_unknowns(scene, path)
        shared = unknown.numbers(0.0) if unknown.way else {}
        numbers |= {with_numbers(place): number + drawn for place, number in shared.items()} or {path: drawn}
    return numbers


def _number(text: str, word: str) -> float:
    try:
        value = float(word)
    except ValueError:
        value = np.nan
    if not np.isfinite(value):
        raise SceneError([f'uncertain {text}: "{word.strip()}" is not a number'])
    return value


@dataclass(frozen=True, eq=False, repr=False)
class Spread(Drawable, Result):
    """Members with drawn numbers: `values` (S,) by path, `omega` (S, R) in rad/s, and their motion where requested.

    `measured` has the columns of measures that were requested: the scene's own number, and those of members (S,).
    """

    scene: Scene
    tolerances: tuple[Tolerance, ...]
    values: dict[str, Floats]
    omega: Floats
    nominal: Floats
    failures: dict[int, str]
    ensemble: Ensemble | None = None
    estimate: Estimate | None = None
    measured: dict[str, tuple[float, Floats]] = field(default_factory=dict)

    what = "spread"
    figure = "nonlinear.plotting.ensembles:spread_figure"

    def to_dict(self) -> dict[str, Floats]:
        """Return the drawn values, every frequency in rad/s and the measures, (S,)."""
        columns = {f"omega_{number}_rad_per_s": omega for number, omega in enumerate(self.omega.T, 1)}
        return {**self.values, **columns, **{name: numbers for name, (_, numbers) in self.measured.items()}}

    def parts(self, form: Form = "text") -> Iterator[ReportTable | str]:
        """The distributions of members, the results, the most influential number, and the motion."""
        yield f"{self.size} members with {self.words}"
        yield ReportTable.of(self.columns(), self.quantities if self.measured else self.frequencies)
        yield from self.notes
        yield motion_words(self)
        if self.failures:
            yield f"{len(self.failures)} members failed: {next(iter(self.failures.values()))}"

    def columns(self) -> tuple[ReportColumn, ...]:
        """The statistics of a frequency or of a measured quantity in the table."""
        unit = "" if self.measured else "_rad_per_s"
        first = ("quantity", "nominal") if self.measured else ("mode", "omega_rad_per_s")
        headings = ("quantity", "of the scene", "σ") if self.measured else ("mode", "ω (rad/s)", "σ (rad/s)")
        keys = (*first, *(f"{name}{unit}" for name in ("standard_deviation", "q05", "q95")))
        shown = ("", ".6g", ".6g" if self.measured else ".3g", ".6g", ".6g")
        return (
            *(
                ReportColumn(itemgetter(key), None, heading, f"{{:{digits}}}".format)
                for key, heading, digits in zip(keys, (*headings, "5 %", "95 %"), shown, strict=True)
            ),
            ReportColumn(partial(_most, self.scene), None, "matters most"),
        )

    def records(self) -> Iterator[dict[str, Any]]:
        """A row for each member: numbers drawn, measures, and its angles at every sample of a motion."""
        modes = [k for k, row in enumerate(self.nominal) if row > 0]
        links = places(system_of(self.scene))
        at = [f"theta_{place}_at_{time:.10g}_s_deg" for time in self.times.tolist() for place in links]
        measured = {name: row for name, (_, row) in self.measured.items() if not name.startswith("omega_")}
        names = [*self.values, *(f"omega_{mode + 1}_rad_per_s" for mode in modes), *measured, *at]
        angles = self.angles.reshape(self.size, len(at))
        every = np.column_stack([*self.values.values(), self.omega[:, modes], *measured.values(), angles])
        return (dict(zip(names, row, strict=True)) for row in every.tolist())

    def whole(self) -> dict[str, Any]:
        """The numbers drawn, the frequencies, the measures and the bands of the motion."""
        measured = [{key: finite(value) for key, value in record.items()} for record in self.quantities]
        whole: dict[str, Any] = {
            "scene": describe(self.scene),
            "tolerances": [tolerance.text for tolerance in self.tolerances],
            **({} if self.estimate is None else {"fitted": list(self.estimate.paths)}),
            "members": self.size,
            "failed": len(self.failures),
            "frequencies": self.frequencies,
            "notes": list(self.notes),
            **({"measures": measured} if self.measured else {}),
        }
        if self.ensemble is not None:
            bands = {
                f"{name}_deg": [[finite(value) for value in row] for row in band]
                for name, band in zip(QUANTILE_NAMES, self.bands.tolist(), strict=True)
            }
            motion = {
                "engine": self.ensemble.engine,
                "time_s": self.times.tolist(),
                "coordinates": list(_coordinates(self)),
            }
            whole["motion"] = motion | bands
        return whole

    @property
    def words(self) -> str:
        """The distributions of the members, with standard deviations."""
        texts = [tolerance.around(self.scene) for tolerance in self.tolerances]
        if self.estimate is not None:
            texts.append(f"{counted(len(self.estimate.paths), 'fitted number', 'fitted numbers')} by their covariance")
        return ", ".join(texts)

    @property
    def size(self) -> int:
        """How many members there are."""
        return len(next(iter(self.values.values())))

    @cached_property
    def times(self) -> Floats:
        """The times of the samples of the motion (s)."""
        return np.array(self.ensemble.question.times if self.ensemble else ())

    @cached_property
    def angles(self) -> Floats:
        """Angles (S, T, L) of all members over time in deg, in space those from the downward vertical."""
        if self.ensemble is None:
            return np.empty((self.size, 0, self.scene.n_links))
        links = self.ensemble.column("links_rad")
        if self.scene.space == "space":
            links = np.arctan2(np.hypot(links[..., 0], links[..., 1]), links[..., 2])
        return np.degrees(links)

    @cached_property
    def bands(self) -> Floats:
        """Quantiles (Q, T, L) of the angles (deg) over time."""
        return np.asarray(np.nanquantile(self.angles, QUANTILES, axis=0))

    @property
    def notes(self) -> tuple[str, ...]:
        """A sentence for each effect that the frequencies ignore."""
        return left_out(self.scene)

    @cached_property
    def stds(self) -> Floats:
        """Standard deviations (T, L) of the angles (deg) over time."""
        if self.ensemble is None:
            return np.empty((0, self.scene.n_links))
        return np.asarray(np.degrees(np.nanstd(self.ensemble.column("links_rad"), axis=0, ddof=1)))

    def shares(self, result: Floats) -> dict[str, float]:
        """How much of the variance of a result (S,) each number explains."""
        known = np.isfinite(result)
        return {path: _share(drawn[known], result[known]) for path, drawn in self.values.items()}

    @cached_property
    def frequencies(self) -> list[dict[str, Any]]:
        """A record for every frequency that is not zero."""
        return [
            {
                "mode": number,
                "omega_rad_per_s": float(nominal),
                "mean_rad_per_s": float(np.nanmean(omega)),
                **_distribution(omega, "_rad_per_s"),
                **self._ranking(omega),
            }
            for number, (nominal, omega) in enumerate(zip(self.nominal, self.omega.T, strict=True), 1)
            if nominal > 0
        ]

    @cached_property
    def quantities(self) -> list[dict[str, Any]]:
        """A record for every column that was measured: the scene's own number, quantiles, which number matters most."""
        return [
            {
                "quantity": name,
                "nominal": nominal,
                **_distribution(numbers),
                "known": int(np.count_nonzero(np.isfinite(numbers))),
                **self._ranking(numbers),
            }
            for name, (nominal, numbers) in self.measured.items()
        ]

    def _ranking(self, numbers: Floats) -> dict[str, Any]:
        """How much of the variance each number explains, and which the most."""
        shares = self.shares(numbers)
        return {"shares": shares, "matters_most": max(shares, key=shares.__getitem__) if any(shares.values()) else ""}


def _distribution(numbers: Floats, unit: str = "") -> dict[str, float]:
    """The standard deviation and the quantiles of those that are known."""
    known = numbers[np.isfinite(numbers)]
    quantiles = np.quantile(known, QUANTILES).tolist() if known.size else [np.nan] * len(QUANTILES)
    values = (float(known.std(ddof=1)) if known.size > 1 else np.nan, *quantiles)
    return {f"{name}{unit}": value for name, value in zip(("standard_deviation", *QUANTILE_NAMES), values, strict=True)}


def _share(x: Floats, r: Floats) -> float:
    if len(x) < 3 or x.std() == 0 or not r.std() > len(r) * np.finfo(float).eps * abs(r.mean()):
        return 0.0
    return float(np.corrcoef(x, r)[0, 1] ** 2)


@formerly(tolerances="uncertain", estimate="covariance")
@checked
def find_spread(
    scene: Scene,
    uncertain: str | Sequence[str],
    duration: float | None = None,
    *,
    members: int = 1000,
    seed: int = 5,
    covariance: Estimate | str | os.PathLike[str] | None = None,
    start: State | None = None,
    measures: str | Sequence[str] = (),
    report: Callable[[float], object] = silent,
    **options: Any,
) -> Spread:
    """Compute frequencies, and optionally motions, of members with parameters `uncertain` as these texts say.

    Fitted numbers are drawn by their `covariance`, an `Estimate` or the file of a report of `fit`. The motion over a
    `duration` (s) is from `start`, if not from the scene's own; `measures`, NAME or NAME:N of those that `spread` takes
    in `nonlinear.measures`, are computed of every member in this process, as a sweep computes them. `options` are those
    of `ensemble`. SceneError names every mistake; raise ComputationError if no member can be.
    """
    read: Callable[..., Estimate] = deferred("modal.identification:read_estimate")
    estimate = read(scene, covariance) if isinstance(covariance, str | os.PathLike) else covariance
    parsed = parse_tolerances(scene, uncertain) if uncertain or estimate is None else ()
    if estimate is not None:
        fitted = {place for places in estimate.shared for place in places}
        twice = [tolerance.path for tolerance in parsed if fitted.intersection(_places(scene, tolerance.path))]
        if twice:
            raise SceneError([f"uncertain {path}: has a tolerance and is among the fitted numbers" for path in twice])
    *_, requests = validate(
        lambda: validate_whole(3, members=members),
        lambda: validate_whole(0, seed=seed),
        lambda: parse_measures(texts_of(measures), "spread"),
    )
    validate_requests(requests, scene)
    rng = np.random.default_rng(seed)
    values = {tolerance.path: tolerance.drawn(_value(scene, tolerance.path), members, rng) for tolerance in parsed}
    values |= estimate.drawn(members, rng) if estimate is not None else {}
    numbers = _numbers(scene, values)
    points = [dict(zip(numbers, row, strict=True)) for row in np.column_stack([*numbers.values()]).tolist()]
    variable, scenes, failures = Variable(scene, points[0]), dict[int, Scene](), dict[int, str]()
    for k, point in enumerate(points):
        try:
            scenes[k] = variable.at(point)
        except SceneError as error:
            failures[k] = " ".join(str(error).split())
    if not scenes:
        raise ComputationError(f"no member can be: {next(iter(failures.values()))}")
    frequencies = natural_frequencies([scene, *scenes.values()])
    omega = np.full((members, frequencies.shape[1]), np.nan)
    omega[[*scenes]] = frequencies[1:]
    motion = None
    if duration is not None:
        starts = None if start is None else [start] * members
        motion = ensemble(scene, duration, starts=starts, vary=numbers, output=MOTION_SAMPLES, report=report, **options)
        motion.require("member")
        failures = failures | motion.failures
    measured, reasons = _measured(SweepTask(scene, requests, members), points) if requests else ({}, {})
    return Spread(scene, parsed, values, omega, frequencies[0], failures | reasons, motion, estimate, measured)


def _measured(
    task: SweepTask, points: Sequence[dict[str, float]]
) -> tuple[dict[str, tuple[float, Floats]], dict[int, str]]:
    """The scene's own number and those of members (S,) in every column that is measured, and why members have none."""
    own = {path: _value(task.scene, path) for path in points[0]}
    (nominal,) = measure_chunk(task, PointChunk([(0, own)], frozenset([0])))
    if nominal.reason:
        raise ComputationError(nominal.reason)
    columns = {name: (number, np.full(task.size, np.nan)) for name, number in nominal.numbers.items()}
    reasons: dict[int, str] = {}
    for first in range(0, task.size, MODES_TOGETHER_MAX):
        some = range(first, min(first + MODES_TOGETHER_MAX, task.size))
        for row in measure_chunk(task, PointChunk([(k, points[k]) for k in some], frozenset(some))):
            for name in columns.keys() & row.numbers.keys():
                columns[name][1][row.index] = row.numbers[name]
            if row.reason:
                reasons[row.index] = row.reason
    return columns, reasons


@checked
def spread_table(spread: Spread, form: Form) -> str:
    """As text, csv (one line a member, with its angles at every sample of a motion) or json, the `form`."""
    return spread.report(form)


def _most(scene: Scene, record: dict[str, Any]) -> str:
    """Which number matters most, and how much of the variance it explains."""
    most = record["matters_most"]
    return f"{find_unknowns(scene, most)[0].words} ({100 * record['shares'][most]:.0f} %)" if most else NOTHING


def motion_words(spread: Spread) -> str:
    """How wide the band of every angle becomes, and by which engine; nothing without a motion."""
    if spread.ensemble is None:
        return ""
    widths = spread.bands[-1] - spread.bands[0]
    labels = map(symbols_in, _coordinates(spread))
    rows = [
        (label, f"{width[-1]:.3g}", f"{width.max():.3g}", f"{spread.times[width.argmax()]:.3g}")
        for label, width in zip(labels, widths.T, strict=True)
    ]
    headings = ("number", "band at the end (°)", "widest (°)", "at (s)")
    return f"{grid(rows, headings)}\n\n{spread.ensemble.words()}"


def _coordinates(spread: Spread) -> list[str]:
    """The labels of the links."""
    system = system_of(spread.scene)
    return list(system.labels[system.first :])
