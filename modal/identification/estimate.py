"""The parameters of a fitted scene with their covariance, as stored in the JSON report of `fit`.

It has `{"parameters": [{"place": …, "value": …, "std": …}, …], "covariance": [[…], …]}`.

Modes, responses and shaped commands have standard deviations from it: to first order, with exact derivatives, for a
result r(p)

    std(r)² = (∂r/∂p)ᵀ cov (∂r/∂p)

[Ljung1999, §9.2].
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import isfinite, nan, pi
from typing import Any

import numpy as np

from modal.assembly import shared_differences
from modal.errors import SceneError, gathered, refuse_any
from modal.identification.identifiability import ModeDerivatives, matrix_derivatives, polar, require_polynomial
from modal.identification.parameters import natural_unit
from modal.modes import Modes
from modal.report import Displayed, percent
from modal.scene import Scene
from modal.scene.contents import text_of
from modal.scene.doors import checked
from modal.scene.parameters import Place, with_numbers
from modal.scene.unknowns import Unknown, find_unknowns
from modal.scene.validation import NUMBER_SIZE_MAX
from modal.statespace.channels import Arrays, Channel, Model, channel_model
from modal.statespace.model import StateSpace
from modal.statespace.shapers import Drive, Shaper, residual_vibration, swing_rows
from modal.types import Complexes, Floats

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
        with gathered(problems):
            unknowns.append(_unknown(scene, k, parameter))
    places = [place for unknown in unknowns for place in unknown.places]
    problems += [f"parameters: {with_numbers(place)} appears twice" for place in places if places.count(place) > 1]
    count = len(parameters)
    matrix = _matrix(rows, count)
    if matrix is None:
        problems.append(f"covariance: must be {count} rows of {count} finite numbers, as there are parameters")
    else:
        problems += _faults(matrix)
    refuse_any(dict.fromkeys(problems))
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


NODES = 21
"""Cost: nodes of a quadrature along either direction, and points of a band."""


@dataclass(frozen=True)
class ModeStds:
    """Standard deviations of a mode's ω (rad/s) and ζ; NaN if fitted parameters split a repeated frequency."""

    omega: float
    zeta: float

    @property
    def frequency(self) -> float:
        """The natural frequency, in Hz."""
        return self.omega / (2 * pi)


def mode_slopes(modes: Modes, estimate: Estimate, rows: Sequence[int]) -> tuple[Floats, Floats]:
    """∂ω/∂p and ∂ζ/∂p, (rows, p), of the modes with these indices."""
    dM, dK, dD = matrix_derivatives(estimate.scene, estimate.shared, estimate.units)
    first = int(modes.scene.cart is None and estimate.scene.cart is not None)  # of modes on a fixed cart
    derivatives = ModeDerivatives(modes, dM[:, first:, first:], dK[:, first:, first:], dD[:, first:, first:])
    pairs = [polar(complex(modes.eigenvalue[row]), derivatives.eigenvalue(row)) for row in rows]
    omega, zeta = (np.array(part).reshape(len(rows), len(estimate.unknowns)) for part in zip(*pairs, strict=True))
    return omega, zeta


@checked
def mode_stds(modes: Modes, estimate: Estimate, rows: Sequence[int]) -> list[ModeStds]:
    """Standard deviations of the modes with these indices, from 0; `modes` are those of the estimate's scene.

    Raise ComputationError for scenes too large for dense matrices.
    """
    if not rows:
        return []
    omega, zeta = mode_slopes(modes, estimate, rows)
    return [ModeStds(float(a), float(b)) for a, b in zip(estimate.std(omega), estimate.std(zeta), strict=True)]


# ----------------------------------------------------------------------------------------------------- response


def response_slopes(model: StateSpace, estimate: Estimate, omega: Floats) -> tuple[Complexes, Complexes]:
    """G(iω) (p, m, W) and its derivatives (p, m, W, numbers) by the estimate's numbers; NaN at a pole without a damper.

    Those of every input and output separately (`modal.statespace.channels`); a cart whose motion is an input is fixed
    under all others.
    """
    scene, at = estimate.scene, np.atleast_1d(omega)
    require_polynomial(scene)
    form = channel_model(scene, [Channel(read.name, push.name) for read in model.outputs for push in model.inputs])
    if any(kind.moves == "cart" for kind in form.kinds):
        form = replace(form, kinds=tuple(kind._replace(moves=kind.moves or "held") for kind in form.kinds))
    parts = [
        shared_differences(scene, places, unit, form.arrays)
        for places, unit in zip(estimate.shared, estimate.units, strict=True)
    ]
    slopes = Arrays(*(np.array(part) for part in zip(*parts, strict=True)))
    responses = Model(form.kinds, form.arrays(scene))
    with np.errstate(all="ignore"):
        pairs = [responses.gradient(channel, at, slopes) for channel in range(len(form.channels))]
        at_pole = ~(responses.condition(at) < 1 / np.finfo(float).eps)
    shape = len(model.outputs), len(model.inputs), len(at)
    G, changes = (np.array(part).reshape(*shape, *part[0].shape[1:]) for part in zip(*pairs, strict=True))
    G[:, :, at_pole] = changes[:, :, at_pole] = np.nan
    return G, changes


def magnitude_std(model: StateSpace, estimate: Estimate, omega: Floats) -> Floats:
    """Standard deviations of |G(iω)|, (p, m, W); NaN where G is infinite."""
    G, slopes = response_slopes(model, estimate, omega)
    size = np.abs(G)
    unit = np.divide(np.conj(G), size, out=np.zeros_like(G), where=size > 0)
    stds = estimate.std((unit[..., None] * slopes).real)
    exact = estimate.std(slopes.real) + estimate.std(slopes.imag)
    return np.where(size > 0, stds, exact)


# ------------------------------------------------------------------------------------------------------- shaper


@dataclass(frozen=True)
class ShapedMode:
    """Residual vibration of a mode after a shaped command with uncertain parameters.

    `omega` and `zeta` with their standard deviations; `rms` is the root mean square of the residual vibration over the
    normal distribution of ω and ζ, `worst` its largest within ±2 standard deviations of ω and ζ; both as
    fractions of the swing that an unshaped command leaves.
    """

    omega: float
    omega_std: float
    zeta: float
    zeta_std: float
    rms: float
    worst: float

    def words(self, number: int) -> str:
        """Return the residual of mode `number`, from 1 among those that the drive excites."""
        if np.isnan(self.rms):
            return f"shaped mode {number}: the fitted numbers split it, so it has no standard deviation of its own"
        return (
            f"shaped mode {number}: {self.omega:.6g} ± {self.omega_std:.2g} rad/s, damping ratio {self.zeta:.3g} ± "
            f"{self.zeta_std:.2g}: residual vibration {percent(self.rms)} rms, at most {percent(self.worst)} within "
            "2 standard deviations"
        )


def shaped_modes(shaper: Shaper, estimate: Estimate, drive: Drive, count: int) -> list[ShapedMode]:
    """Return the residuals of the `count` slowest modes over the band of the fitted parameters."""
    modes, rows = swing_rows(estimate.scene, drive)
    omega_p, zeta_p = mode_slopes(modes, estimate, rows[:count])
    modes_of_shaper = []
    for mode, by_omega, by_zeta in zip(modes.rows(rows[:count]), omega_p, zeta_p, strict=True):
        omega, zeta = mode.omega, mode.damping_ratio
        spread, wider = float(estimate.std(by_omega)), float(estimate.std(by_zeta))
        if np.isnan(spread + wider):
            modes_of_shaper.append(ShapedMode(omega, nan, zeta, nan, nan, nan))
            continue
        rms = _rms(shaper, omega, zeta, np.stack((by_omega, by_zeta)), estimate)
        grid = np.linspace(-2, 2, NODES)
        band = np.maximum(omega + spread * grid, 0.0)[:, None], np.clip(zeta + wider * grid, 0.0, 1 - 1e-9)
        worst = float(residual_vibration(shaper, *band).max())
        modes_of_shaper.append(ShapedMode(omega, spread, zeta, wider, rms, worst))
    return modes_of_shaper


def _rms(shaper: Shaper, omega: float, zeta: float, slopes: Floats, estimate: Estimate) -> float:
    """The RMS of the residual vibration over ω and ζ with derivatives (2, p), by Gauss-Hermite quadrature."""
    strength, axes = np.linalg.eigh(slopes @ estimate.covariance @ slopes.T / np.outer([omega, 1.0], [omega, 1.0]))
    nodes, weights = np.polynomial.hermite_e.hermegauss(NODES)
    steps = np.stack(np.meshgrid(nodes, nodes)).reshape(2, -1) * np.sqrt(np.maximum(strength, 0.0))[:, None]
    changes = axes @ steps
    weight = np.outer(weights, weights).ravel() / weights.sum() ** 2
    square = residual_vibration(shaper, omega * (1 + changes[0]), np.clip(zeta + changes[1], 0.0, 1 - 1e-9)) ** 2
    return float(np.sqrt(weight @ square))
