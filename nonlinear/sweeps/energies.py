"""Measures against energy: at every energy starts are drawn at random, each is measured, and quantiles are kept.

The energy (J, above the scene's rest) is varied as `start.energy`, alone or beside numbers of the scene.  Starts are
those of `nonlinear.ensembles.starts_at`, which draws them for sections, too; every point has its own random numbers, by
the seed and its place in the sweep, whoever computes it.  After Jones et al. (2011), who ask how the chaos of pendula
changes with their energy.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from functools import partial

import numpy as np

from modal.errors import SceneError
from modal.scene import Scene, require
from modal.types import Floats
from nonlinear import chaos
from nonlinear.ensembles import ensemble, starts_at, validate_measures
from nonlinear.integration import validate, validate_whole
from nonlinear.measures import MEASURES, columns_of
from nonlinear.sweeps.measures import RequestedMeasure

ENERGY = "start.energy"
CAPABILITY = "a start by its energy"
QUANTILES = {"q05": 0.05, "median": 0.5, "q95": 0.95}
UNIT = re.compile(r"(_(rad|deg|m)_per_s|_per_s|_rad|_deg|_s|_m|_J)$")
LYAPUNOV, CHAOTIC = "lyapunov", "chaotic_share"
MOST_MEMBERS = 100_000
TOLERANCE = 1e-9
Point = tuple[int, float]
Measured = dict[str, float] | str
"""Columns of numbers, or why there are none."""


def validate_energies(scene: Scene, requests: Sequence[RequestedMeasure], members: int, seed: int) -> None:
    """SceneError where a scene does not keep its energy, or what is measured does not depend on the start."""
    names = [request.name for request in requests]
    validate(
        lambda: require(scene, CAPABILITY),
        lambda: validate_whole(1, members=members),
        lambda: validate_whole(0, seed=seed),
        *(partial(_of_starts, name) for name in names),
    )
    if members > MOST_MEMBERS:
        raise SceneError([f"members {members}: must be at most {MOST_MEMBERS}"])
    validate_measures(names, scene)
    for request in requests:
        if request.name == LYAPUNOV and request.number:
            validate_measures((LYAPUNOV,), scene, request.number)


def _of_starts(name: str) -> None:
    """SceneError for a measure that an ensemble does not take."""
    if why := MEASURES[name].refused.get("ensemble"):
        raise SceneError([f"{name}: cannot be measured of starts drawn at an energy: {why}"])


def measured_at(
    scene: Scene, points: Sequence[Point], requests: Sequence[RequestedMeasure], members: int, seed: int
) -> dict[int, Measured]:
    """What is measured of so many starts at each energy (J), all side by side, by the indices of the points."""
    results: dict[int, Measured] = {}
    starts, known = [], []
    for index, energy in points:
        try:
            starts += starts_at(scene, energy, members, seed=(seed, index))
            known.append(index)
        except SceneError as error:
            results[index] = " ".join(str(error).split())
    if not known:
        return results
    columns: dict[int, dict[str, float]] = {index: {} for index in known}
    for request in requests:
        seconds = request.number or chaos.usual_duration(scene)
        tolerance = chaos.TOLERANCE if request.name == LYAPUNOV else TOLERANCE
        runs = ensemble(scene, seconds, starts=starts, measures=[request.name], tolerance=tolerance, check=0, workers=1)
        if runs.interrupted:
            raise KeyboardInterrupt
        for column in columns_of(request.name, runs.columns):
            for index, numbers in zip(known, runs.column(column).reshape(len(known), members), strict=True):
                columns[index] |= dict(_statistics(column, numbers))
                if request.name == LYAPUNOV:
                    columns[index][CHAOTIC] = _chaotic(scene, seconds, numbers)
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


def _chaotic(scene: Scene, seconds: float, exponents: Floats) -> float:
    """The share of starts whose exponent is too large for regular motion, of those that did not fail."""
    known = exponents[~np.isnan(exponents)]
    return float(np.mean(known > chaos.regular_exponent(scene, seconds))) if known.size else np.nan
