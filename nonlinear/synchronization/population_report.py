"""Populations as text and as numbers: the verdict, order and rates, who leaves the symmetric motions, thresholds."""

from __future__ import annotations

from collections.abc import Iterator
from math import degrees
from textwrap import fill
from typing import Any

import numpy as np

from modal.loci import followed_columns
from modal.report import NOTHING, as_csv, capital, counted, finite, grid, line_width, with_unit
from nonlinear.synchronization.populations import PopulationPhases
from nonlinear.synchronization.sectors import SymmetricMotion
from nonlinear.synchronization.thresholds import MotionBranch, PopulationDiagram, Threshold

POPULATIONS = ("population", "on", "pendula", "R", "mean rate (rad/s)", "spread (rad/s)", "phase (deg)")
QUARTERS = "R, rates and the phase from population 1's are means over the last quarter of the run."
RATES = (
    "Growth rates by Floquet multipliers of the full equations, and below them by the averaged ones. In these motions "
    "every population moves as one pendulum. Disturbances keep their symmetry (own), lead towards the other motion "
    "(other), or are of pendula against each other, which their support does not feel (within a population)."
)
EXACT = (
    "exact: where a growth rate by Floquet multipliers of the full equations vanishes; averaged: where one of the "
    "averaged equations does."
)


def population_sections(phases: PopulationPhases, motions: tuple[SymmetricMotion, ...], why: str) -> Iterator[str]:
    """The populations, then their symmetric motions."""
    yield grid(list(map(list, _population_rows(phases))), POPULATIONS, "text") + "\n\n" + fill(QUARTERS, line_width())
    if motions:
        yield _motions(motions)
    elif why:
        yield fill(f"No growth rates of symmetric motions: {why}.", line_width())


def _population_rows(phases: PopulationPhases) -> Iterator[tuple[str, ...]]:
    rows = zip(phases.populations, phases.late_order, phases.rate, phases.spread, phases.phase, strict=True)
    for number, (population, order, rate, spread, phase) in enumerate(rows):
        relative = number and phases.is_held
        yield (
            str(number + 1),
            population.name,
            str(population.size),
            f"{order:.4f}",
            _number(rate, ".6g"),
            _number(spread, ".2g"),
            f"{degrees(phase):.2f}" if relative else NOTHING,
        )


def _number(value: float, form: str) -> str:
    return NOTHING if np.isnan(value) else f"{value:{form}}"


def _motions(motions: tuple[SymmetricMotion, ...]) -> str:
    names = list(dict.fromkeys(name for motion in motions if motion.orbit for name in motion.names))
    head = ("motion", "ω (rad/s)", "largest angle (deg)", *(f"{name} (1/s)" for name in names), "stability")
    rows = [row for motion in motions for row in _motion_rows(motion, names)]
    parts = [grid(rows, head, "text"), *map(_filled, _reasons(motions)), _filled(RATES)]
    return "\n\n".join(parts)


def _filled(words: str) -> str:
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
    averaged = motion.averaged
    angle = f"{degrees(averaged.amplitude):.4g}"
    yield ["  averaged", f"{averaged.omega:.6g}", angle, *_rates(motion, averaged.growth, names), ""]


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
            yield f"{capital(motion.pattern.name)} lasts: {why}."


def leaves(sector: str) -> str:
    """What happens where disturbances in a sector grow."""
    if sector.startswith("within"):
        return f"breaks up {sector}"
    return {"own": "changes into another motion of its symmetry", "other": "gives way to the other motion"}.get(
        sector, "gives way to another motion of the populations"
    )


def population_record(phases: PopulationPhases, motions: tuple[SymmetricMotion, ...], why: str) -> dict[str, Any]:
    """The JSON record of populations and of their symmetric motions."""
    rows = zip(phases.populations, phases.late_order, phases.rate, phases.spread, phases.phase, strict=True)
    return {
        "verdict": phases.kind,
        "verdict_words": phases.verdict,
        "populations": [
            {
                "support": population.name,
                "pendula": population.size,
                "order_parameter": float(order),
                "rate_rad_per_s": finite(rate),
                "spread_rad_per_s": finite(spread),
                "phase_deg": degrees(phase) if phases.is_held else None,
            }
            for population, order, rate, spread, phase in rows
        ],
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
    variation = diagram.variation
    values, unit = variation.values, variation.unit
    where = f"{variation.path} = {values[0]:.6g} to {values[-1]:.6g} {unit}".rstrip()
    head = f"{counted(len(diagram.branches), 'symmetric motion', 'symmetric motions')} over {where}"
    rows = [_branch_cells(diagram, threshold) for threshold in diagram.branches]
    headers = ("motion", "ω (rad/s)", "largest angle (°)", with_unit("exists", unit), with_unit("stable", unit))
    parts = [head, grid(rows, headers)]
    if diagram.thresholds:
        columns = (with_unit("averaged", unit), with_unit("exact", unit), "motion", "sector", "event")
        parts += ["", grid([_threshold_cells(threshold) for threshold in diagram.thresholds], columns)]
        for threshold in diagram.thresholds:
            if threshold.reason:
                words = f"{capital(threshold.pattern)} at {threshold.value:.6g}: {threshold.reason}."
                parts += ["", _filled(words)]
        parts += ["", _filled(EXACT)]
    return "\n".join(parts) + "\n"


def _branch_cells(diagram: PopulationDiagram, branch: MotionBranch) -> tuple[str, ...]:
    if not len(branch.values):
        return branch.name, NOTHING, NOTHING, "nowhere", "nowhere"
    stable = ", ".join(f"{low:.7g} to {high:.7g}" for low, high in diagram.intervals(branch)) or "nowhere"
    exists = ", ".join(f"{low:.7g} to {high:.7g}" for low, high in diagram.windows(branch))
    return branch.name, _ends(branch.omega), _ends(np.rad2deg(branch.angle)), exists, stable


def _ends(values: Any) -> str:
    return " → ".join(dict.fromkeys(f"{value:#.4g}".rstrip(".") for value in (values[0], values[-1])))


def _threshold_cells(threshold: Threshold) -> tuple[str, ...]:
    averaged = NOTHING if threshold.averaged is None else f"{threshold.averaged:.7g}"
    return (
        averaged,
        f"{threshold.value:.9g}",
        threshold.pattern,
        threshold.sector or NOTHING,
        threshold_words(threshold),
    )


def threshold_words(threshold: Threshold) -> str:
    """What happens there: loses stability (neighbours beat at 0.2 rad/s)."""
    beats = f" (neighbours beat at {threshold.beat:.3g} rad/s)" if threshold.beat else ""
    return (threshold.becomes or f"disturbances begin to {'grow' if threshold.rises else 'decay'}") + beats


def diagram_csv(diagram: PopulationDiagram) -> str:
    """One row per motion, value and sector: frequency, stability, largest angle and growth rates."""
    return as_csv(list(_diagram_rows(diagram)))


def _diagram_rows(diagram: PopulationDiagram) -> Iterator[dict[str, Any]]:
    for branch in diagram.branches:
        numbers = branch.values.tolist(), branch.is_stable, branch.omega.tolist(), branch.angle.tolist()
        for value, stable, omega, angle, motion in zip(*numbers, branch.motions, strict=True):
            if motion.orbit is None or motion.averaged is None:
                continue
            for name, exact, averaged in zip(motion.names, motion.orbit.growth, motion.averaged.growth, strict=True):
                columns = followed_columns(
                    diagram.variation, value, omega, stable=bool(stable), angle_deg=degrees(angle), growth=exact
                )
                yield {**columns, "averaged_growth_per_s": averaged, "motion": branch.name, "sector": name}
