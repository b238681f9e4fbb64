"""The definition of a sweep: a scene, its variations, and the measures computed at every point.

Measures against energy: the energy (J, above equilibrium) is varied as `start.energy`, alone or next to numbers of the
scene. At every energy starts are drawn at random, each is measured, and quantiles are kept. Starts are those of
`nonlinear.ensembles.starts_at`, which draws them for sections, too; every point has its own random numbers, by the seed
and its place in the sweep, on any worker. How chaos changes with energy is the question with which paper 001
begins.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from hashlib import sha256
from math import prod
from typing import Any, NamedTuple

import numpy as np

from modal.errors import MultipendulaError, SceneError, gathered, refuse_any
from modal.extend.measures import SCENE_ITSELF, columns_of
from modal.report import Displayed
from modal.scene import Scene, describe, require, scene_from
from modal.scene.parameters import Variable, Variation, validate_variations
from modal.types import Floats
from nonlinear import chaos
from nonlinear.chaos.lyapunov import STARTS_TOGETHER
from nonlinear.ensembles import ensemble, starts_at, validate_measures
from nonlinear.ensembles.costs import engine_of_many
from nonlinear.ensembles.question import CHUNK_MEMBERS_MIN, CHUNK_SECONDS, ENSEMBLE_TOLERANCE, seconds_each
from nonlinear.ensembles.runs import together
from nonlinear.ensembles.sections import MEMBERS_MAX
from nonlinear.integration import validate, validate_whole
from nonlinear.integration.readiness import reproducible
from nonlinear.sweeps.measures import Portion, RequestedMeasure, parse_measures, validate_requests

POINTS_MAX = 1_000_000
"""Limit: "the sweep has … points: at most 1000000"."""
SWEEP_VERSION = 1
"""Format: of the definition of a sweep in its files."""
MODES_TOGETHER_MAX = 256
"""Cost: points whose modes are measured together; benchmarks/modes.py."""
MODES_CHUNKS_MIN = 16
"""Cost: chunks into which a sweep of modes is divided, for as many processes; benchmarks/modes.py."""
MODES_SQUARES_MAX = 1e5
"""Cost: squares of links of all points whose modes are measured together; benchmarks/modes.py."""
ENERGY = "start.energy"
CAPABILITY = "a start by its energy"
QUANTILES = {"q05": 0.05, "median": 0.5, "q95": 0.95}
UNIT = re.compile(r"(_(rad|deg|m)_per_s|_per_s|_rad|_deg|_s|_m|_J)$")
LYAPUNOV, CHAOTIC = "lyapunov", "chaotic_share"
Measured = dict[str, float] | str
"""Columns of numbers, or why there are none."""


@dataclass(frozen=True, repr=False)
class Study(Displayed):
    """A grid over one to three variations, the last one varying fastest; raise SceneError for an invalid one.

    Where `start.energy` is among them, `members` starts are drawn at every energy, by the `seed`
    (`measured_at`).
    """

    what = "Sweep over numbers of a scene"
    shows = "scene: scene; variations: along; shape: points"

    scene: Scene
    variations: tuple[Variation, ...]
    measures: tuple[RequestedMeasure, ...]
    members: int = 0
    seed: int = 0

    def __post_init__(self) -> None:
        problems = []
        if not 1 <= len(self.variations) <= 3:
            problems.append(f"a sweep needs 1 to 3 variations, not {len(self.variations)}")
        if self.size > POINTS_MAX:
            problems.append(f"the sweep has {' × '.join(map(str, self.shape))} points: at most {POINTS_MAX}")
        if not self.measures:
            problems.append("a sweep needs a measure: frequencies, for example")
        places = [variation for variation in self.variations if variation.path != ENERGY]
        checks: list[Callable[[], object]] = [partial(validate_variations, self.scene, places)]
        if self.by_energy:
            checks += [partial(validate_energies, self.scene, self.measures, self.members, self.seed)]
            if not self.members:
                problems.append(f"{ENERGY}: needs `members`, the number of starts drawn at every energy")
        else:
            checks += [partial(validate_requests, self.measures, self.scene)]
            if self.members:
                problems.append(f"members {self.members}: starts are drawn where {ENERGY} is varied")
        for check in checks:
            with gathered(problems):
                check()
        refuse_any(problems)

    @property
    def by_energy(self) -> bool:
        """Whether energy is varied."""
        return any(variation.path == ENERGY for variation in self.variations)

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of values along every axis."""
        return tuple(len(variation.values) for variation in self.variations)

    @property
    def size(self) -> int:
        """Number of points."""
        return prod(self.shape)

    def point(self, index: int) -> dict[str, float]:
        """The values of point `index`, counted from 0 with the last axis fastest, by their paths."""
        at = np.unravel_index(index, self.shape)
        return {variation.path: variation.values[int(k)] for variation, k in zip(self.variations, at, strict=True)}

    def header(self) -> dict[str, Any]:
        """The complete definition, for a file."""
        axes = [{"path": axis.path, "values": axis.values, "log": axis.log} for axis in self.variations]
        measures = [request.text for request in self.measures]
        drawn = {"members": self.members, "seed": self.seed} if self.by_energy else {}
        return {"version": SWEEP_VERSION, "scene": describe(self.scene), "axes": axes, "measures": measures, **drawn}

    @property
    def task(self) -> SweepTask:
        """The task for a worker."""
        return SweepTask(self.scene, self.measures, self.size, self.members, self.seed)

    @cached_property
    def chunk(self) -> int:
        """How many points are measured together: by the study alone, as their last digits depend on it."""
        if self.by_energy:
            return max(1, 2 * STARTS_TOGETHER // self.members)
        if all(request.measure.reads == SCENE_ITSELF for request in self.measures):
            fitting = MODES_SQUARES_MAX / self.scene.n_links**2
            return int(max(min(self.size // MODES_CHUNKS_MIN, fitting, MODES_TOGETHER_MAX), 1))
        if not together(self.scene):
            return 1
        longest = max(request.number or chaos.usual_duration(self.scene) for request in self.measures)
        fitting = CHUNK_SECONDS / seconds_each(self.scene, longest, ENSEMBLE_TOLERANCE)
        wanted = max(self.size // 4, 4 * CHUNK_MEMBERS_MIN)  # four chunks, unless they are small
        return int(max(min(wanted, fitting, 4 * STARTS_TOGETHER), CHUNK_MEMBERS_MIN))

    def points_of(self, number: int) -> range:
        """The points of a chunk, counted from 0."""
        return range(number * self.chunk, min((number + 1) * self.chunk, self.size))

    @property
    def fingerprint(self) -> str:
        """A checksum that identifies the study."""
        functions = [request.name for request in self.measures]
        return sha256(json.dumps([self.header(), functions]).encode()).hexdigest()


def study_from(header: dict[str, Any]) -> Study:
    """The study that a header describes; ValueError, KeyError or TypeError for anything else."""
    if header["version"] != SWEEP_VERSION:
        raise ValueError
    axes = tuple(Variation(axis["path"], tuple(axis["values"]), bool(axis["log"])) for axis in header["axes"])
    drawn = [header.get(key, 0) for key in ("members", "seed")]
    if any(type(number) is not int for number in drawn):
        raise TypeError
    return Study(scene_from(header["scene"]), axes, parse_measures(header["measures"]), *drawn)


@dataclass(frozen=True)
class SweepTask:
    """The data a worker needs in addition to its points, of which there are `size` in all."""

    scene: Scene
    measures: tuple[RequestedMeasure, ...]
    size: int
    members: int = 0
    seed: int = 0


@dataclass(frozen=True, repr=False)
class Row(Displayed):
    """The result at a point: named numbers, or the reason why there are none."""

    index: int
    numbers: dict[str, float]
    reason: str = ""


Point = tuple[int, dict[str, float]]


class PointChunk(NamedTuple):
    """Points that are measured together, and the numbers of those whose rows are requested."""

    points: Sequence[Point]
    wanted: frozenset[int]


def measure_chunk(task: SweepTask, chunk: PointChunk) -> list[Row]:
    """The requested rows of a chunk."""
    return list(measure_each(task, chunk))


def measure_each(task: SweepTask, chunk: PointChunk) -> Iterator[Row]:
    """The requested rows, one by one; an error at one becomes its reason and does not affect the others."""
    points, wanted = chunk
    variable = Variable(task.scene, [path for path in points[0][1] if path != ENERGY])
    scenes = [_scene(variable, values) for _, values in points]
    if task.members:
        yield from (row for row in _of_members(task, points, scenes) if row.index in wanted)
        return
    portion = Portion([scene for scene in scenes if isinstance(scene, Scene)], task.scene)
    for (index, _), scene in zip(points, scenes, strict=True):
        if index in wanted:
            yield _row(task, index, scene, portion)


def _of_members(task: SweepTask, points: Sequence[Point], scenes: Sequence[Scene | Exception]) -> Iterator[Row]:
    """The rows of points at which starts are drawn, grouped by scene."""
    alike: dict[Scene, list[tuple[int, float]]] = {}
    measured: dict[int, dict[str, float] | str] = {}
    for (index, values), scene in zip(points, scenes, strict=True):
        if isinstance(scene, Scene):
            alike.setdefault(scene, []).append((index, values[ENERGY]))
        else:
            measured[index] = " ".join(str(scene).split())
    for scene, energies in alike.items():
        try:
            measured |= measured_at(scene, energies, task)
        except MultipendulaError as error:
            measured |= dict.fromkeys([index for index, _ in energies], " ".join(str(error).split()))
    for index, _ in points:
        numbers = measured[index]
        yield Row(index, {}, numbers) if isinstance(numbers, str) else Row(index, numbers)


def _scene(variable: Variable, values: dict[str, float]) -> Scene | Exception:
    try:
        return variable.at(values)
    except Exception as error:  # the row says why
        return error


def _row(task: SweepTask, index: int, scene: Scene | Exception, portion: Portion) -> Row:
    numbers: dict[str, float] = {}
    try:
        if isinstance(scene, Exception):
            raise scene
        with reproducible(task.size):
            for request in task.measures:
                measured = request.measure.of_scene(scene, request.number, portion)
                numbers |= {name: float(number) for name, number in measured.items()}
    except MultipendulaError as error:
        return Row(index, {}, " ".join(str(error).split()))
    except Exception as error:
        return Row(index, {}, " ".join(f"{type(error).__name__}: {error}".split()))
    return Row(index, numbers)


# ----------------------------------------------------------------------------------------------- at energies


def validate_energies(scene: Scene, requests: Sequence[RequestedMeasure], members: int, seed: int) -> None:
    """Raise SceneError if a scene does not keep its energy, or if the measures do not depend on the start."""
    names = [request.name for request in requests]
    validate(
        lambda: require(scene, CAPABILITY),
        lambda: validate_whole(1, members=members),
        lambda: validate_whole(0, seed=seed),
        *(partial(_of_starts, request) for request in requests),
    )
    if members > MEMBERS_MAX:
        raise SceneError([f"members {members}: must be at most {MEMBERS_MAX}"])
    validate_measures(names, scene)
    for request in requests:
        if request.name == LYAPUNOV and request.number:
            validate_measures((LYAPUNOV,), scene, request.number)


def _of_starts(request: RequestedMeasure) -> None:
    """Raise SceneError for a measure that an ensemble does not take."""
    if why := request.measure.refused.get("ensemble"):
        raise SceneError([f"measure {request.name}: cannot be measured of starts drawn at an energy: {why}"])


def measured_at(scene: Scene, points: Sequence[tuple[int, float]], task: SweepTask) -> dict[int, Measured]:
    """The measures of this many starts at each energy (J), all computed at once, by the indices of the points."""
    results: dict[int, Measured] = {}
    starts, known = [], []
    for index, energy in points:
        try:
            starts += starts_at(scene, energy, task.members, seed=(task.seed, index))
            known.append(index)
        except SceneError as error:
            results[index] = " ".join(str(error).split())
    if not known:
        return results
    columns: dict[int, dict[str, float]] = {index: {} for index in known}
    for request in task.measures:
        seconds, named = request.number or chaos.usual_duration(scene), [request.name]
        tolerance = chaos.TOLERANCE if request.name == LYAPUNOV else ENSEMBLE_TOLERANCE
        engine = engine_of_many(scene, starts[0], task.size * task.members, seconds, tolerance, named)
        kept: dict[str, Any] = {"measures": named, "tolerance": tolerance, "engine": engine}
        runs = ensemble(scene, seconds, starts=starts, check=0, workers=1, **kept)
        for column in columns_of(request.name, runs.require().columns):
            for index, numbers in zip(known, runs.column(column).reshape(len(known), task.members), strict=True):
                columns[index] |= dict(_statistics(column, numbers))
                if request.name == LYAPUNOV:
                    # of those that did not fail, whose exponent is too large for regular motion
                    known_numbers = numbers[~np.isnan(numbers)]
                    is_chaotic = known_numbers > chaos.regular_exponent(scene, seconds)
                    columns[index][CHAOTIC] = float(np.mean(is_chaotic)) if known_numbers.size else np.nan
    return results | columns


def _statistics(column: str, numbers: Floats) -> Iterator[tuple[str, float]]:
    """Quantiles under names such as lyapunov_median_per_s; of the members that did not fail."""
    unit = UNIT.search(column)
    stem, ending = (column[: unit.start()], unit[0]) if unit else (column, "")
    known = numbers[~np.isnan(numbers)]
    method = "linear" if np.isfinite(known).all() else "inverted_cdf"
    for name, part in QUANTILES.items():
        value = float(np.quantile(known, part, method=method)) if known.size else np.nan  # type: ignore[call-overload]
        yield f"{stem}_{name}{ending}", value
