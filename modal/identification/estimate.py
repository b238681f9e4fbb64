"""The parameters of a fitted scene with their covariance, as stored in the JSON report of `fit`.

It has `{"parameters": [{"place": …, "value": …, "std": …}, …], "covariance": [[…], …]}`.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from math import isfinite
from typing import Any

import numpy as np

from modal.errors import SceneError
from modal.identification.parameters import natural_unit
from modal.report import Displayed
from modal.scene import Scene
from modal.scene.contents import text_of
from modal.scene.doors import checked
from modal.scene.parameters import Place, with_numbers
from modal.scene.unknowns import Unknown, find_unknowns
from modal.scene.validation import NUMBER_SIZE_MAX
from modal.types import Floats

REPORT_ROUNDING = 1e-6
"""Tolerance: relative, of numbers and correlations that somebody copied with six or seven digits."""


@dataclass(frozen=True, eq=False, repr=False)
class Estimate(Displayed):
    """The `unknowns` of a `scene` with their `covariance` (p, p) in the scene's units.

    A shift is counted from the numbers of this scene, in which that of a fit is already.
    """

    what = "Estimate of numbers with their covariance"
    shows = "paths: numbers; stds: standard deviations"

    scene: Scene
    unknowns: tuple[Unknown, ...]
    covariance: Floats

    @property
    def paths(self) -> tuple[str, ...]:
        """The unknowns as they are written."""
        return tuple(unknown.path for unknown in self.unknowns)

    @property
    def shared(self) -> list[tuple[Place, ...]]:
        """The places of each unknown."""
        return [unknown.places for unknown in self.unknowns]

    @cached_property
    def values(self) -> Floats:
        """The scene's numbers (p,), of shifts 0."""
        return np.array([unknown.value for unknown in self.unknowns])

    @cached_property
    def stds(self) -> Floats:
        """Standard deviations (p,)."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def units(self) -> list[float]:
        """The natural unit of each number."""
        return [natural_unit(self.scene, unknown.place) for unknown in self.unknowns]

    def drawn(self, count: int, rng: np.random.Generator) -> dict[str, Floats]:
        """Draw values (count,) by path from the joint normal distribution."""
        size = np.where(self.stds > 0, self.stds, 1.0)
        strength, axes = np.linalg.eigh(self.covariance / size / size[:, None])
        steps = rng.standard_normal((count, len(size))) * np.sqrt(np.maximum(strength, 0.0)) @ axes.T
        return dict(zip(self.paths, (self.values + size * steps).T, strict=True))

    def std(self, slopes: Floats) -> Floats:
        """Standard deviations (…) of results with derivatives (…, p), to first order."""
        variance = np.einsum("...p,pq,...q->...", slopes, self.covariance, slopes)
        return np.sqrt(np.where(variance > 0, variance, np.where(np.isnan(variance), np.nan, 0.0)))


@checked
def read_estimate(scene: Scene, path: str | os.PathLike[str]) -> Estimate:
    """The estimate in a report of `fit`, of this scene; raise SceneError with every mistake."""
    name = os.fspath(path)
    try:
        return estimate_of(scene, json.loads(text_of(name, "report")))
    except SceneError as error:
        raise SceneError([f"{name}: {problem}" for problem in error.problems]) from None
    except RecursionError:
        raise SceneError([f"{name}: is not JSON: nested too deeply"]) from None
    except ValueError as error:
        raise SceneError([f"{name}: is not JSON: {error}"]) from None


def estimate_of(scene: Scene, record: Any) -> Estimate:
    """The estimate in a record such as that of a fit; raise SceneError with every mistake."""
    parameters = record.get("parameters") if isinstance(record, dict) else None
    rows = record.get("covariance") if isinstance(record, dict) else None
    if isinstance(record, dict) and record.get("fits") is False:
        raise SceneError(["is the report of a fit that does not fit its record: its numbers have no covariance"])
    if not (isinstance(parameters, list) and isinstance(rows, list)):
        raise SceneError(['has no "parameters" and "covariance": it must be the report of a fit, in JSON'])
    if not parameters:
        raise SceneError(["has no fitted numbers: nothing is uncertain"])
    problems: list[str] = []
    unknowns: list[Unknown] = []
    for k, parameter in enumerate(parameters):
        try:
            unknowns.append(_unknown(scene, k, parameter))
        except SceneError as error:
            problems += error.problems
    places = [place for unknown in unknowns for place in unknown.places]
    problems += [f"parameters: {with_numbers(place)} appears twice" for place in places if places.count(place) > 1]
    count = len(parameters)
    matrix = _matrix(rows, count)
    if matrix is None:
        problems.append(f"covariance: must be {count} rows of {count} finite numbers, as there are parameters")
    else:
        problems += _faults(matrix)
    if problems:
        raise SceneError(list(dict.fromkeys(problems)))
    assert matrix is not None
    return Estimate(scene, tuple(unknowns), (matrix + matrix.T) / 2)


def _unknown(scene: Scene, k: int, parameter: Any) -> Unknown:
    path = parameter.get("place") if isinstance(parameter, dict) else None
    value = parameter.get("value") if isinstance(parameter, dict) else None
    if not isinstance(path, str) or not isinstance(value, int | float) or not _is_number(value):
        raise SceneError([f'parameters[{k}]: must have a "place" and a "value" that is a finite number'])
    unknown, *others = find_unknowns(scene, path)
    if others:
        raise SceneError([f"parameters[{k}]: {path} means several numbers: each has its own entry"])
    if any(place[-1] == "count" for place in unknown.places):
        raise SceneError([f"parameters[{k}]: {path} is a count and has no standard deviation"])
    for present in () if unknown.is_shift else unknown.given:
        if abs(present - value) > REPORT_ROUNDING * max(abs(present), abs(value)):
            words = f"the scene has {present:.9g}: give the scene that was fitted with it"
            raise SceneError([f"{path} = {value:.9g}: {words}"])
    return unknown


def _is_number(value: Any) -> bool:
    """Whether it is a finite number in double precision; integers in JSON have any size."""
    try:
        return isinstance(value, int | float) and not isinstance(value, bool) and isfinite(value)
    except OverflowError:
        return False


def _matrix(rows: list[Any], count: int) -> Floats | None:
    if len(rows) != count or not all(isinstance(row, list) and len(row) == count for row in rows):
        return None
    if not all(_is_number(value) for row in rows for value in row):
        return None
    return np.array(rows, dtype=np.float64)


def _faults(matrix: Floats) -> Iterator[str]:
    variance = np.diag(matrix)
    if np.any(variance < 0):
        k = int(np.argmin(variance))
        yield f"covariance[{k}][{k}] = {variance[k]:.6g}: a variance must not be negative"
        return
    if np.any(variance > NUMBER_SIZE_MAX**2):
        k = int(np.argmax(variance))
        yield f"covariance[{k}][{k}] = {variance[k]:.6g}: a variance must be at most {NUMBER_SIZE_MAX**2:g}"
        return
    size = np.where(variance > 0, np.sqrt(variance), 1.0)
    with np.errstate(over="ignore"):
        correlation = matrix / size / size[:, None]
    largest = np.abs(correlation).max()
    if largest > 1 + REPORT_ROUNDING:
        j, k = divmod(int(np.argmax(np.abs(correlation))), len(matrix))
        words = f"gives the correlation {largest:.3g}: must be positive semidefinite"
        yield f"covariance[{j}][{k}] = {matrix[j, k]:.6g}: {words}"
        return
    asymmetry = np.abs(correlation - correlation.T)
    if asymmetry.max() > REPORT_ROUNDING:
        j, k = sorted(divmod(int(np.argmax(asymmetry)), len(asymmetry)))
        yield f"covariance[{j}][{k}] = {matrix[j, k]:.6g}, [{k}][{j}] = {matrix[k, j]:.6g}: must be symmetric"
        return
    smallest = float(np.linalg.eigvalsh(correlation)[0])
    if smallest < -REPORT_ROUNDING * len(matrix):
        yield f"covariance: must be positive semidefinite, and its correlations have the eigenvalue {smallest:.3g}"
