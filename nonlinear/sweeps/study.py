"""The definition of a sweep: a scene, its variations, and the measures computed at every point."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from hashlib import sha256
from math import prod
from typing import Any

import numpy as np

from modal.errors import MultipendulaError, SceneError
from modal.report import Displayed
from modal.scene import Scene, describe, scene_from
from modal.scene.parameters import Variable, Variation, validate_variations
from nonlinear.sweeps.measures import RequestedMeasure, find_together, parse_measures, run_all_together

MOST_AXES, MOST_POINTS = 3, 1_000_000
VERSION = 1


@dataclass(frozen=True, repr=False)
class Study(Displayed):
    """A grid over one to MOST_AXES variations, the last one varying fastest; SceneError for an invalid one."""

    scene: Scene
    variations: tuple[Variation, ...]
    measures: tuple[RequestedMeasure, ...]

    def __post_init__(self) -> None:
        problems = []
        if not 1 <= len(self.variations) <= MOST_AXES:
            problems.append(f"a sweep needs 1 to {MOST_AXES} variations, not {len(self.variations)}")
        if self.size > MOST_POINTS:
            problems.append(f"the sweep has {' × '.join(map(str, self.shape))} points: at most {MOST_POINTS}")
        if not self.measures:
            problems.append("a sweep needs a measure: frequencies, for example")
        checks: list[Callable[[], object]] = [partial(validate_variations, self.scene, self.variations)]
        doors = (request.computation.door for request in self.measures)
        checks += [partial(door, self.scene) for door in doors if door]
        for check in checks:
            try:
                check()
            except SceneError as error:
                problems += error.problems
        if problems:
            raise SceneError(problems)

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
        return {own.path: own.values[int(k)] for own, k in zip(self.variations, at, strict=True)}

    def header(self) -> dict[str, Any]:
        """The complete definition, for a file."""
        axes = [{"path": own.path, "values": own.values, "log": own.log} for own in self.variations]
        measures = [one.text for one in self.measures]
        return {"version": VERSION, "scene": describe(self.scene), "axes": axes, "measures": measures}

    @property
    def fingerprint(self) -> str:
        """A checksum that identifies the study."""
        functions = [request.computation.function.__qualname__ for request in self.measures]
        return sha256(json.dumps([self.header(), functions]).encode()).hexdigest()


def study_from(header: dict[str, Any]) -> Study:
    """The study that a header describes; ValueError, KeyError or TypeError for anything else."""
    if header["version"] != VERSION:
        raise ValueError
    axes = tuple(Variation(axis["path"], tuple(axis["values"]), bool(axis["log"])) for axis in header["axes"])
    return Study(scene_from(header["scene"]), axes, parse_measures(header["measures"]))


@dataclass(frozen=True)
class Task:
    """The data a worker needs in addition to its points."""

    scene: Scene
    measures: tuple[RequestedMeasure, ...]

    @property
    def durations(self) -> tuple[float, ...]:
        """Of the runs (s) that measures are read off."""
        return tuple(dict.fromkeys(request.number for request in self.measures if request.computation.runs))


@dataclass(frozen=True, repr=False)
class Row(Displayed):
    """The result at a point: named numbers, or the reason why there are none."""

    index: int
    numbers: dict[str, float]
    reason: str = ""


Point = tuple[int, dict[str, float]]
Points = Sequence[Point]


def measure_points(task: Task, points: Points) -> list[Row]:
    """The rows of some points."""
    return list(measure_each(task, points))


def measure_each(task: Task, points: Points) -> Iterator[Row]:
    """The rows of some points, one by one; an error at one becomes its reason and does not affect the others."""
    variable = Variable(task.scene, points[0][1])
    scenes = [_scene(variable, values) for _, values in points]
    valid = [scene for scene in scenes if isinstance(scene, Scene)]
    if any(request.computation.numbered for request in task.measures):
        find_together(valid)
    for request in task.measures:
        if request.computation.together:
            request.computation.together(valid, request.number)
    if seconds := task.durations:
        run_all_together(valid, seconds)
    for (index, _), scene in zip(points, scenes, strict=True):
        yield _row(task, index, scene)


def _scene(variable: Variable, values: dict[str, float]) -> Scene | Exception:
    try:
        return variable.at(values)
    except Exception as error:  # the row says why
        return error


def _row(task: Task, index: int, scene: Scene | Exception) -> Row:
    numbers: dict[str, float] = {}
    try:
        if isinstance(scene, Exception):
            raise scene
        for one in task.measures:
            numbers |= {name: float(number) for name, number in one.of(scene, task.scene).items()}
    except MultipendulaError as error:
        return Row(index, {}, " ".join(str(error).split()))
    except Exception as error:
        return Row(index, {}, " ".join(f"{type(error).__name__}: {error}".split()))
    return Row(index, numbers)
