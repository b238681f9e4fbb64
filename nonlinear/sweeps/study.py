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
from nonlinear.sweeps.energies import ENERGY, measured_at, validate_energies
from nonlinear.sweeps.measures import RequestedMeasure, find_together, parse_measures, run_all_together

MOST_AXES, MOST_POINTS = 3, 1_000_000
VERSION = 1


@dataclass(frozen=True, repr=False)
class Study(Displayed):
    """A grid over one to MOST_AXES variations, the last one varying fastest; SceneError for an invalid one.

    Where `start.energy` is among them, `members` starts are drawn at every energy, by the `seed`
    (`nonlinear.sweeps.energies`).
    """

    scene: Scene
    variations: tuple[Variation, ...]
    measures: tuple[RequestedMeasure, ...]
    members: int = 0
    seed: int = 0

    def __post_init__(self) -> None:
        problems = []
        if not 1 <= len(self.variations) <= MOST_AXES:
            problems.append(f"a sweep needs 1 to {MOST_AXES} variations, not {len(self.variations)}")
        if self.size > MOST_POINTS:
            problems.append(f"the sweep has {' × '.join(map(str, self.shape))} points: at most {MOST_POINTS}")
        if not self.measures:
            problems.append("a sweep needs a measure: frequencies, for example")
        places = [variation for variation in self.variations if variation.path != ENERGY]
        checks: list[Callable[[], object]] = [partial(validate_variations, self.scene, places)]
        if self.by_energy:
            checks += [partial(validate_energies, self.scene, self.measures, self.members, self.seed)]
            if not self.members:
                problems.append(f"{ENERGY}: needs `members`, the number of starts drawn at every energy")
        elif self.members:
            problems.append(f"members {self.members}: starts are drawn where {ENERGY} is varied")
        doors = () if self.by_energy else (request.computation.door for request in self.measures)
        checks += [partial(door, self.scene) for door in doors if door]
        for check in checks:
            try:
                check()
            except SceneError as error:
                problems += error.problems
        if problems:
            raise SceneError(problems)

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
        return {"version": VERSION, "scene": describe(self.scene), "axes": axes, "measures": measures, **drawn}

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
    drawn = [header.get(key, 0) for key in ("members", "seed")]
    if any(type(number) is not int for number in drawn):
        raise TypeError
    return Study(scene_from(header["scene"]), axes, parse_measures(header["measures"]), *drawn)


@dataclass(frozen=True)
class SweepTask:
    """The data a worker needs in addition to its points."""

    scene: Scene
    measures: tuple[RequestedMeasure, ...]
    members: int = 0
    seed: int = 0

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


def measure_points(task: SweepTask, points: Points) -> list[Row]:
    """The rows of some points."""
    return list(measure_each(task, points))


def measure_each(task: SweepTask, points: Points) -> Iterator[Row]:
    """The rows of some points, one by one; an error at one becomes its reason and does not affect the others."""
    variable = Variable(task.scene, [path for path in points[0][1] if path != ENERGY])
    scenes = [_scene(variable, values) for _, values in points]
    if task.members:
        yield from _of_members(task, points, scenes)
        return
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


def _of_members(task: SweepTask, points: Points, scenes: Sequence[Scene | Exception]) -> Iterator[Row]:
    """The rows of points at which starts are drawn, those of one scene side by side."""
    alike: dict[Scene, list[tuple[int, float]]] = {}
    measured: dict[int, dict[str, float] | str] = {}
    for (index, values), scene in zip(points, scenes, strict=True):
        if isinstance(scene, Scene):
            alike.setdefault(scene, []).append((index, values[ENERGY]))
        else:
            measured[index] = " ".join(str(scene).split())
    for scene, energies in alike.items():
        try:
            measured |= measured_at(scene, energies, task.measures, task.members, task.seed)
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


def _row(task: SweepTask, index: int, scene: Scene | Exception) -> Row:
    numbers: dict[str, float] = {}
    try:
        if isinstance(scene, Exception):
            raise scene
        for request in task.measures:
            numbers |= {name: float(number) for name, number in request.of(scene, task.scene).items()}
    except MultipendulaError as error:
        return Row(index, {}, " ".join(str(error).split()))
    except Exception as error:
        return Row(index, {}, " ".join(f"{type(error).__name__}: {error}".split()))
    return Row(index, numbers)
