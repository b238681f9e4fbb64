"""Time against accuracy of natural frequencies: dense matrices, a permitted relative error, and every digit.

Errors of ω are those to the roots of the characteristic polynomial in integers, proved to PROVED_DIGITS
(`modal.exact`); times are those of the processor, from a scene to all its frequencies, but for dense matrices, which
are at hand.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from functools import partial
from math import inf, nan
from time import process_time
from timeit import Timer
from typing import Any

import numpy as np
import scipy

from modal.assembly import matrices
from modal.errors import SceneError
from modal.exact import isolate, of_scene
from modal.modes import natural_modes
from modal.report import Displayed, Form, ReportColumn, Result
from modal.scene import Scene, require, validate_scene
from modal.scene.doors import checked
from modal.statespace.model import without_carrier
from modal.types import Floats

PROVED_DIGITS = 20
"""Format: digits to which roots are proved, four beyond a double's."""
FREQUENCIES_MAX = 60
"""Limit: different frequencies of a scene, whose roots are proved within seconds."""
COMPARED_LINKS_MAX = 1500
"""Limit: links of a scene, whose dense matrices are solved within seconds."""
NOTES = (
    "*: on the Pareto front: no other is both faster and more accurate. time: of the processor, for all frequencies; "
    f"for dense, without making the matrices. error: the largest, to roots proved to {PROVED_DIGITS} digits."
)


@dataclass(frozen=True, repr=False)
class FrequencyRow(Displayed):
    """One method for all frequencies: its name, seconds, the bound that it states (NaN: none), the true error."""

    what = "One way to all frequencies"
    shows = "way: way; route: route; seconds: time, s; bound: stated bound; error: error"

    way: str
    route: str
    seconds: float
    bound: float
    error: float


@dataclass(frozen=True, eq=False, repr=False)
class FrequencyTradeoff(Result):
    """Dense matrices, the relative errors allowed, and every digit, in this order."""

    scene: Scene
    rows: tuple[FrequencyRow, ...]

    @property
    def pareto(self) -> tuple[FrequencyRow, ...]:
        """The methods that no other beats in both time and error."""
        return tuple(
            row
            for row in self.rows
            if not any(rival.seconds < row.seconds and rival.error <= row.error for rival in self.rows)
        )

    what = "time against accuracy of frequencies"
    key = "rungs"

    def columns(self) -> tuple[ReportColumn, ...]:
        """The quantities of a way."""
        best, dense = self.pareto, self.rows[0].seconds
        return (
            ReportColumn(lambda row: "*" if row in best else "", heading="Pareto"),
            ReportColumn("way", "way", "way"),
            ReportColumn("route", "route", "route"),
            ReportColumn("seconds", "seconds", "time (ms)", lambda seconds: f"{1e3 * seconds:.3g}"),
            ReportColumn(lambda row: row.seconds / dense, None, "/ dense", ".2g"),
            ReportColumn("bound", "bound", "bound", ".1e"),
            ReportColumn("error", "error", "error of ω", ".1e"),
            ReportColumn(lambda row: row in best, "pareto"),
        )

    def footnotes(self) -> tuple[str, ...]:
        """The meanings of the columns."""
        return (NOTES,)

    def facts(self) -> dict[str, Any]:
        """The digits with which errors are computed."""
        return {"digits": PROVED_DIGITS}


@checked
def measure_frequencies(scene: Scene, accuracies: tuple[float, ...] = (1e-8,)) -> FrequencyTradeoff:
    """Measure times and true errors of all natural frequencies of a scene, by every method.

    Raise SceneError for scenes with losses or structures, and for too large ones.

    >>> from modal import load
    >>> [row.way for row in measure_frequencies(load("chain-2")).rows]
    ['dense', 'to 1e-8', 'every digit']
    """
    require(validate_scene(scene), "a polynomial in ω²")
    if (size := len(natural_modes(scene))) > FREQUENCIES_MAX or scene.n_links > COMPARED_LINKS_MAX:
        limits = f"at most {FREQUENCIES_MAX}, and {COMPARED_LINKS_MAX} links, can be compared"
        raise SceneError([f"the scene has {size} different frequencies and {scene.n_links} links: {limits}"])
    squares = _squares(scene)
    planes = [matrices(plane) for plane in ((scene, without_carrier(scene)) if scene.space == "space" else (scene,))]
    dense = partial(_dense, [(plane.K, plane.M) for plane in planes], len(squares))
    limits_by_way = {
        **{f"to {accuracy:g}".replace("e-0", "e-"): accuracy for accuracy in accuracies},
        "every digit": None,
    }
    ours = {way: partial(natural_modes, scene, accuracy=limit) for way, limit in limits_by_way.items()}
    ways: dict[str, Callable[[], object]] = {"dense": dense, **ours}
    seconds = {}
    for way, solve in ways.items():
        number, total = Timer(solve, timer=process_time).autorange()
        seconds[way] = total / number
    rows = [FrequencyRow("dense", "eigh of K and M", seconds["dense"], nan, _error(dense(), squares))]
    for way, solve in ours.items():
        modes = solve()
        omega = np.repeat(modes.omega, modes.multiplicity)
        rows.append(FrequencyRow(way, modes.route, seconds[way], float(modes.error.max()), _error(omega, squares)))
    return FrequencyTradeoff(scene, tuple(rows))


def _squares(scene: Scene) -> list[Fraction]:
    """Every ω², in the order of the frequencies."""
    squares: list[Fraction] = []
    for polynomial, copies, _ in of_scene(scene):
        coefficients = list(polynomial.coefficients)
        while not coefficients[-1]:
            coefficients.pop()
            squares += [Fraction(0)] * copies
        for low, high, times in isolate(coefficients, Fraction(1, 10**PROVED_DIGITS), relative=True):
            squares += [(low + high) / 2] * (times * copies)
    return sorted(squares, key=abs)


def _dense(planes: list[tuple[Floats, Floats]], size: int) -> Floats:
    """ω (R,) by LAPACK, NaN if that gives up; a massless cart has one row more than modes."""
    try:
        values = np.concatenate([scipy.linalg.eigh(K, M, eigvals_only=True) for K, M in planes])
    except np.linalg.LinAlgError:
        return np.full(size, nan)
    return np.asarray(np.sort(np.sqrt(np.abs(values)))[:size])


def _error(omega: Floats, squares: list[Fraction]) -> float:
    """The largest relative error of ω, to first order, of all but rigid motions; infinite without a number."""
    if not np.isfinite(omega).all():
        return inf
    pairs = zip(map(Fraction, omega.tolist()), squares, strict=True)
    return max(
        (float(abs(computed_omega**2 / abs(square) - 1) / 2) for computed_omega, square in pairs if square), default=0.0
    )


@checked
def frequencies_table(result: FrequencyTradeoff, form: Form) -> str:
    """Every way as text, markdown, csv (one line per way) or json, as `form` says."""
    return result.report(form)
