"""Comparison of damping laws for a record: the same fit with each, by information criteria and on held-out data."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from math import log
from typing import Any

import numpy as np

from modal.errors import SceneError, refuse_any, spelling_hint
from modal.identification import scene_with
from modal.identification.parameters import natural_unit
from modal.report import Displayed, silent
from modal.scene import Scene
from modal.scene.doors import checked, formerly
from modal.scene.parameters import find_places, texts_of
from modal.scene.unknowns import find_unknowns
from modal.types import Crew, map_by_crew
from nonlinear.identification.fitting import fit
from nonlinear.identification.records import SEGMENT_ROWS_MIN, Recording
from nonlinear.identification.result import Fit

LAWS = {"viscous": "damping", "coulomb": "friction", "drag": "quadratic_drag"}
"""Names of laws, and the number of a joint or link that each one frees."""
LAW_START = 1e-3
"""Cost: of the natural unit, initial guess of the number of a law in the fit."""


@dataclass(frozen=True, eq=False, repr=False)
class ComparedLaw(Displayed):
    """A fit with one law, or several joined by +; `held_out_rms` (rad) of the part that was not fitted.

    Information criteria count as many values as the residuals' autocorrelation leaves independent.
    """

    what = "Law of damping, fitted"
    shows = "name: law; aic: AIC; bic: BIC; held_out_rms: RMS of what was not fitted, rad"

    name: str
    fit: Fit
    aic: float
    bic: float
    held_out_rms: float


@formerly(names="laws")
@checked
def compare(
    scene: Scene,
    recording: Recording,
    free: str | Sequence[str],
    laws: str | Sequence[str],
    *,
    crew: Crew | None = None,
    report: Callable[[float], object] = silent,
    **options: object,
) -> list[ComparedLaw]:
    """The candidates, the best by BIC first; `options` are those of `fit`.  Raise SceneError for an unknown law.

    A `crew` fits several laws at once; `report` is called with the part that is done.
    """
    laws, free = (texts_of(texts, splits_commas=True) for texts in (laws, free))
    problems = [
        f"compare {name}: must be laws such as {', '.join(LAWS)} or viscous+coulomb{spelling_hint(name, LAWS)}"
        for name in laws
        if not name or any(law not in LAWS for law in name.split("+"))
    ]
    refuse_any(problems)
    names = [*dict.fromkeys(laws)]
    fits: list[tuple[str, Fit, float]] = []
    for entry in map_by_crew(partial(_fit_with, scene, recording, [*_without(scene, free)], options), names, crew):
        fits.append(entry)
        report(len(fits) / len(names))
    count = min((independent(result) for _, result, _ in fits), default=2.0)
    return sorted((_candidate(*entry, count) for entry in fits), key=lambda candidate: candidate.bic)


def _fit_with(
    scene: Scene, recording: Recording, free: Sequence[str], options: Mapping[str, Any], name: str
) -> tuple[str, Fit, float]:
    """The fit with one of the laws, and its residuals on the held-out part."""
    candidate_scene, places = with_laws(scene, name.split("+"))
    places_free = [*dict.fromkeys([*free, *places])]
    result = fit(candidate_scene, recording, places_free, **options)
    part_fit = fit(result.scene, _used(recording), places_free, **options)
    return name, result, _held_out(part_fit, recording)


def _candidate(name: str, result: Fit, held_out: float, count: float) -> ComparedLaw:
    """The criteria, for this many independent values: −2 ln L of Gaussian residuals, and a penalty."""
    counts = np.sum([np.isfinite(segment.values).sum(axis=0) for segment in result.recording.segments], axis=0)
    mean = float(np.mean(np.square(result.residuals))), float(np.log(result.problem.noise) @ counts / counts.sum())
    spread, unknowns = count * (log(mean[0]) + 2 * mean[1]), int(np.count_nonzero(np.diag(result.cov)))
    return ComparedLaw(name, result, spread + 2 * unknowns, spread + unknowns * log(count), held_out)


def _held_out(part_fit: Fit, recording: Recording) -> float:
    """The rms (rad) of held-out data: of other segments with fitted states, or of the continuation of a single one."""
    if len(recording.segments) > 1:
        return fit(
            part_fit.scene, recording.take(range(len(part_fit.recording.segments), len(recording.segments)))
        ).rms_all
    continuation = replace(part_fit, problem=replace(part_fit.problem, recording=recording))
    at = len(part_fit.recording.segments[0].times)
    chosen = [k for k, sensor in enumerate(recording.sensors) if sensor.unit == continuation.rms_unit]
    misses = (continuation.readings[0] - recording.segments[0].values)[at:, chosen]
    return float(np.sqrt(np.nanmean(misses**2)))


def independent(result: Fit) -> float:
    """Return the effective number of independent values, from the residuals' autocorrelation."""
    total = 0.0
    for c, rho in enumerate(result.rho):
        count = sum(int(np.isfinite(segment.values[:, c]).sum()) for segment in result.recording.segments)
        total += count / (1 + 2 * float(rho[1:].sum()))
    return max(total, 2.0)


def _without(scene: Scene, free: Sequence[str]) -> Iterator[str]:
    """The free places that are not numbers of a law."""
    for path in free:
        unknowns = [] if path == "none" else find_unknowns(scene, path)
        yield from (unknown.path for unknown in unknowns if unknown.place[-1] not in {*LAWS.values(), "drag"})


def with_laws(scene: Scene, laws: Sequence[str]) -> tuple[Scene, list[str]]:
    """Return the scene damped by these laws alone, and the places of their parameters."""
    names = [LAWS[law] for law in laws]
    values, places = {}, []
    spots = [
        f"pendulum[{p}].links[{i}]" for p, pendulum in enumerate(scene.pendulum) for i in range(len(pendulum.links))
    ]
    for spot in spots:
        for name in ("damping", "friction", "drag", "quadratic_drag"):
            values[f"{spot}.{name}"] = 0.0
    if scene.cart is not None:
        spots.append("support")
        values |= {"support.damping": 0.0, "support.friction": 0.0}
    for spot in spots:
        for name in names:
            path = f"{spot}.{name}"
            if path in values:
                (place,) = find_places(scene, path)
                values[path] = LAW_START * natural_unit(scene, place) if name != "friction" else 0.0
                places.append(path)
    return scene_with(scene, values), places


def _used(recording: Recording) -> Recording:
    """The data fitted when the rest is held out: the first segments, or the first part of a single one."""
    count = len(recording.segments)
    if count > 1:
        return recording.take(range(max(1, 3 * count // 4)))
    (segment,) = recording.segments
    at = len(segment.times) // 2
    if at < 2 * SEGMENT_ROWS_MIN:
        raise SceneError([f"{segment.where}: is too short to hold a part of it back"])
    return replace(recording, segments=(replace(segment, times=segment.times[:at], values=segment.values[:at]),))
