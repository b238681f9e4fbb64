"""Populations as text and as numbers: verdict, order and rates, stability of the symmetric motions, thresholds."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from itertools import count
from math import degrees
from operator import itemgetter
from textwrap import fill
from typing import Any

import numpy as np

from modal.loci import span_of, state_columns
from modal.report import (
    NOTHING,
    ReportColumn,
    ReportTable,
    as_csv,
    as_json,
    capital,
    counted,
    grid,
    line_width,
    records_of,
    with_unit,
)
from modal.scene import describe
from modal.types import Floats
from nonlinear.synchronization.populations import PopulationPhases
from nonlinear.synchronization.sectors import SymmetricMotion
from nonlinear.synchronization.thresholds import MotionBranch, PopulationDiagram, Threshold

QUARTERS = "R, rates and the phase from population 1's are means over the last quarter of the run."
RATES = (
    "Growth rates by Floquet multipliers of the full equations, and below them by the averaged ones. In these motions "
    "every population moves as one pendulum. Perturbations keep their symmetry (own), lead towards the other motion "
    "(other), or act between pendula of one population without moving its support (within a population)."
)
EXACT = (
    "exact: where a growth rate by Floquet multipliers of the full equations vanishes; averaged: where one of the "
    "averaged equations does."
)


def population_sections(phases: PopulationPhases, motions: tuple[SymmetricMotion, ...], why: str) -> Iterator[str]:
    """The populations, then their symmetric motions."""
    table = ReportTable.of(POPULATION, _rows(phases))
    yield table.written() + "\n\n" + fill(QUARTERS, line_width())
    if motions:
        yield _motions(motions)
    elif why:
        yield fill(f"No growth rates of symmetric motions: {why}.", line_width())


def _rows(phases: PopulationPhases) -> list[tuple[Any, ...]]:
    """Of every population its number, itself, R, rate, spread and phase (deg), NaN without a locked phase."""
    angles = np.degrees(phases.phase) if phases.is_held else np.full(len(phases.populations), np.nan)
    columns = (phases.late_order, phases.rate, phases.spread, angles)
    return list(zip(count(1), phases.populations, *(np.asarray(column).tolist() for column in columns), strict=False))


POPULATION = (
    ReportColumn(itemgetter(0), None, "population"),
    ReportColumn(lambda row: row[1].name, "support", "on"),
    ReportColumn(lambda row: row[1].size, "pendula", "pendula"),
    ReportColumn(itemgetter(2), "order_parameter", "R", "{:.4f}".format),
    ReportColumn(itemgetter(3), "rate_rad_per_s", "mean rate (rad/s)", ".6g"),
    ReportColumn(itemgetter(4), "spread_rad_per_s", "spread (rad/s)", ".2g"),
    ReportColumn(itemgetter(5), "phase_deg"),
    ReportColumn(lambda row: row[5] if row[0] > 1 else None, None, "phase (deg)", ".2f"),
)
"""The quantities of a population."""


def _motions(motions: tuple[SymmetricMotion, ...]) -> str:
    names = list(dict.fromkeys(name for motion in motions if motion.orbit for name in motion.names))
    head = ("motion", "ω (rad/s)", "largest angle (deg)", *(f"{name} (1/s)" for name in names), "stability")
    rows = [row for motion in motions for row in _motion_rows(motion, names)]
    parts = [grid(rows, head, "text"), *map(_fill, _reasons(motions)), _fill(RATES)]
    return "\n\n".join(parts)


def _fill(words: str) -> str:
    return fill(words, line_width())


def _motion_rows(motion: SymmetricMotion, names: list[str]) -> Iterator[list[str]]:
    name = motion.pattern.name
    if motion.orbit is None or motion.averaged is None:
        yield [name, *[NOTHING] * (2 + len(names)), "none"]
        return
    orbit = motion.orbit.orbit
    fate = "stable" if motion.is_stable else "unstable"
    yield [
        name,
        f"{orbit.omega:.6g}",
        f"{degrees(orbit.amplitude):.4g}",
        *_rates(motion, motion.orbit.growth, names),
        fate,
    ]
    averaged_pattern = motion.averaged
    angle = f"{degrees(averaged_pattern.amplitude):.4g}"
    yield ["  averaged", f"{averaged_pattern.omega:.6g}", angle, *_rates(motion, averaged_pattern.growth, names), ""]


def _rates(motion: SymmetricMotion, growth: tuple[float, ...], names: list[str]) -> list[str]:
    by_name = dict(zip(motion.names, growth, strict=True))
    return [f"{by_name[name]:.5g}" if name in by_name else NOTHING for name in names]


def _reasons(motions: tuple[SymmetricMotion, ...]) -> Iterator[str]:
    for motion in motions:
        if motion.orbit is None:
            yield f"{capital(motion.pattern.name)}: {motion.silent}."
            continue
        growing = [k for k, rate in enumerate(motion.orbit.growth) if rate > 0]
        for k in growing:
            why = motion.reason(k)
            yield f"{capital(motion.pattern.name)} {leaves(motion.names[k])}{': ' + why if why else ''}."
        if not growing and (why := next(filter(None, map(motion.reason, range(len(motion.names)))), "")):
            yield f"{capital(motion.pattern.name)} is stable: {why}."


def leaves(sector: str) -> str:
    """The effect of growing perturbations in a sector."""
    if sector.startswith("within"):
        return f"breaks up {sector}"
    return {"own": "changes into another motion of its symmetry", "other": "gives way to the other motion"}.get(
        sector, "gives way to another motion of the populations"
    )


def population_record(phases: PopulationPhases, motions: tuple[SymmetricMotion, ...], why: str) -> dict[str, Any]:
    """The JSON record of populations and of their symmetric motions."""
    return {
        "verdict": phases.kind,
        "verdict_words": phases.verdict,
        "populations": records_of(POPULATION, _rows(phases)),
        "symmetric_motions": list(map(_motion_record, motions)),
        "no_symmetric_motions": why or None,
    }


def _motion_record(motion: SymmetricMotion) -> dict[str, Any]:
    if motion.orbit is None or motion.averaged is None:
        return {"motion": motion.pattern.name, "none": motion.silent}
    orbit = motion.orbit.orbit
    return {
        "motion": motion.pattern.name,
        "omega_rad_per_s": orbit.omega,
        "amplitude_deg": degrees(orbit.amplitude),
        "stable": motion.is_stable,
        "growth_per_s": dict(zip(motion.names, motion.orbit.growth, strict=True)),
        "averaged_growth_per_s": dict(zip(motion.names, motion.averaged.growth, strict=True)),
        "drained": motion.drained,
        "residual": orbit.residual,
    }


def diagram_text(diagram: PopulationDiagram) -> str:
    """One line for every symmetric motion, then one for every threshold, then their reasons."""
    unit, where = diagram.variation.unit, span_of(diagram.variation, diagram.scene)
    head = f"{counted(len(diagram.branches), 'symmetric motion', 'symmetric motions')} for {where}"
    table = ReportTable.of(
        (
            ReportColumn("name", None, "motion"),
            ReportColumn(lambda branch: ends_of(branch.omega), None, "ω (rad/s)"),
            ReportColumn(lambda branch: ends_of(np.rad2deg(branch.angle)), None, "largest angle (°)"),
            ReportColumn(lambda branch: _where(diagram.windows, branch), None, with_unit("exists", unit)),
            ReportColumn(lambda branch: _where(diagram.intervals, branch), None, with_unit("stable", unit)),
        ),
        diagram.branches,
    )
    parts = [head, table.written()]
    if diagram.thresholds:
        table = ReportTable.of(
            (
                ReportColumn("averaged", None, with_unit("averaged", unit), ".5g"),
                ReportColumn("value", None, with_unit("exact", unit), ".9g"),
                ReportColumn("pattern", None, "motion"),
                ReportColumn(lambda threshold: threshold.sector or NOTHING, None, "sector"),
                ReportColumn(threshold_words, None, "event"),
            ),
            diagram.thresholds,
        )
        parts += ["", table.written()]
        for threshold in diagram.thresholds:
            if threshold.reason:
                words = f"{capital(threshold.pattern)} at {threshold.value:.6g}: {threshold.reason}."
                parts += ["", _fill(words)]
        parts += ["", _fill(EXACT)]
    return "\n".join(parts) + "\n"


def _where(intervals: Callable[[MotionBranch], Iterable[tuple[float, float]]], branch: MotionBranch) -> str:
    ranges = intervals(branch) if len(branch.values) else ()
    return ", ".join(f"{low:.7g} to {high:.7g}" for low, high in ranges) or "nowhere"


def ends_of(values: Floats) -> str:
    """From the first value to the last."""
    ends = (f"{value:#.4g}".rstrip(".") for value in values[[0, -1]].tolist()) if len(values) else (NOTHING,)
    return " → ".join(dict.fromkeys(ends))


def threshold_words(threshold: Threshold) -> str:
    """The event there: loses stability (neighbours beat at 0.2 rad/s)."""
    beats = f" (neighbours beat at {threshold.beat:.3g} rad/s)" if threshold.beat else ""
    return (threshold.becomes or f"perturbations begin to {'grow' if threshold.rises else 'decay'}") + beats


def diagram_csv(diagram: PopulationDiagram) -> str:
    """One row per motion, value and sector: frequency, stability, largest angle and growth rates."""
    return as_csv(_diagram_rows(diagram))


def diagram_json(diagram: PopulationDiagram) -> str:
    """The same rows, and the thresholds, averaged and exact, null where none was found."""
    thresholds = [
        {
            "motion": threshold.pattern,
            "sector": threshold.sector,
            "event": threshold_words(threshold),
            "averaged": threshold.averaged,
            "exact": threshold.value,
        }
        for threshold in diagram.thresholds
    ]
    variation = {"vary": diagram.variation.path, "unit": diagram.variation.unit}
    shared = {"scene": describe(diagram.scene), **variation}
    return as_json(shared | {"rows": _diagram_rows(diagram), "thresholds": thresholds})


def _diagram_rows(diagram: PopulationDiagram) -> list[dict[str, Any]]:
    rows = []
    for branch in diagram.branches:
        numbers = branch.values.tolist(), branch.is_stable, branch.omega.tolist(), branch.angle.tolist()
        for value, stable, omega, angle, motion in zip(*numbers, branch.motions, strict=True):
            if motion.orbit is None or motion.averaged is None:
                continue
            for name, exact, averaged_rate in zip(
                motion.names, motion.orbit.growth, motion.averaged.growth, strict=True
            ):
                columns = state_columns(
                    diagram.variation, value, omega, stable=bool(stable), angle_deg=degrees(angle), growth=exact
                )
                rows.append({**columns, "averaged_growth_per_s": averaged_rate, "motion": branch.name, "sector": name})
    return rows
