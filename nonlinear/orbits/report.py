"""Branches of periodic orbits as text, CSV and JSON."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from math import ceil, degrees, isfinite, log10
from textwrap import fill
from typing import Any

import numpy as np

from modal.loci import state_columns
from modal.report import ReportColumn, ReportTable, as_csv, counted, finite, line_width, listed, titled
from modal.scene import Scene, number_label, number_words, title_of, validate_scene
from nonlinear.orbits.branch import Branch
from nonlinear.orbits.cycles import growth
from nonlinear.orbits.flow import ORBIT_TOLERANCE
from nonlinear.orbits.orbit import Orbit
from nonlinear.orbits.special import Special
from nonlinear.system import ends_may_meet, system_of

TABLE_ROWS_MAX = 16
"""Format: rows of a table in the text: orbits of a branch, spread over it."""
STABLE = "stable: no perturbation grows; largest |μ|: of the non-trivial Floquet multipliers."
PHASES = (
    "phase: lead of the fundamental of the link with the largest angle over the first drive; fed: energy that the "
    "drives supply per period."
)
WORDS = {"energy": "of the energy", "omega": "of the frequency", "symmetry": "that breaks the symmetry"}


def orbits_record(branches: Sequence[Branch]) -> dict[str, Any]:
    """Branches and their special points as numbers for JSON."""
    special = [(number, point) for number, branch in enumerate(branches) for point in branch.special]
    return {
        "branches": [
            {"from": branch.origin, "points": [_point(branch, orbit) for orbit in branch.orbits]} for branch in branches
        ],
        "special": [
            {
                "kind": point.kind,
                "of": point.of or None,
                "branch": number,
                "after": point.after,
                **_point(branches[number], point.orbit),
            }
            for number, point in special
        ],
    }


def _driven(orbit: Orbit) -> dict[str, Any]:
    """Quantities of forced motions alone."""
    if not orbit.cycles:
        return {}
    turns = [*orbit.turns] or [0] * len(orbit.flow.system.rest)
    columns = {"phase_deg": finite(degrees(orbit.phase)), "fed_J": orbit.fed, "period_s": orbit.period}
    return {**columns, "cycles": orbit.cycles, "whole_turns": turns, "neutral": orbit.floquet.neutral}


def _point(branch: Branch, orbit: Orbit) -> dict[str, Any]:
    return {
        "parameter": _parameter(branch, orbit),
        "amplitude_deg": degrees(orbit.amplitude),
        **_driven(orbit),
        "energy_J": orbit.energy,
        "omega_rad_per_s": orbit.omega,
        "stable": orbit.is_stable,
        "floquet": [
            [finite(float(multiplier.real)), finite(float(multiplier.imag))] for multiplier in orbit.floquet.all
        ],
        "residual": orbit.residual,
    }


def _parameter(branch: Branch, orbit: Orbit) -> float:
    """The number along which the branch goes; the amplitude (deg) of a mode."""
    return degrees(orbit.amplitude) if orbit.value is None or branch.variation is None else orbit.value


def orbits_csv(branches: Sequence[Branch]) -> str:
    """Return one line for every orbit, with its largest non-trivial multiplier."""
    return as_csv([row for number, branch in enumerate(branches, 1) for row in orbit_rows(branch, number)])


def orbit_rows(branch: Branch, number: int = 1) -> Iterator[dict[str, Any]]:
    """Return the CSV rows of every orbit of a branch with this number."""
    for orbit in branch.orbits:
        driven = _driven(orbit)
        if driven:
            driven["whole_turns"] = " ".join(map(str, driven["whole_turns"]))
        yield {
            **state_columns(
                branch.variation,
                _parameter(branch, orbit),
                orbit.omega,
                stable=orbit.is_stable,
                angle_deg=degrees(orbit.amplitude),
                # the drives of a forced motion set its rates, as its multipliers show
                growth=growth(orbit) if branch.variation and not branch.is_forced else None,
            ),
            "branch": number,
            "from": branch.origin,
            **driven,
            "energy_J": orbit.energy,
            "largest_multiplier": _largest(orbit),
            "residual": orbit.residual,
        }


def orbits_text(scene: Scene, branches: Sequence[Branch], linear: float | None = None) -> str:
    """The branches as text, at most 16 orbits of each; `linear` is the frequency (rad/s) of the mode."""
    validate_scene(scene)
    return titled(title_of(scene), "periodic orbits", list(_parts(branches, linear)), "text")


def _parts(branches: Sequence[Branch], linear: float | None) -> Iterator[str]:
    for number, branch in enumerate(branches):
        direction = f" along the {_number(branch)}" if branch.variation else ""
        count, worst = counted(len(branch.orbits), "orbit", "orbits"), max(orbit.residual for orbit in branch.orbits)
        closure = 10.0 ** ceil(log10(max(worst, ORBIT_TOLERANCE)))
        cycles = branch.orbits[0].cycles
        span = f", of {cycles} periods of the drives" if cycles > 1 else ""
        yield f"branch {number + 1}, from {branch.origin}{direction}: {count} that close to {closure:.0e}{span}"
        indices = np.unique(np.linspace(0, len(branch.orbits) - 1, TABLE_ROWS_MAX).astype(int))
        table = ReportTable.of(_quantities(branch, linear), [branch.orbits[at] for at in indices])
        if len(indices) < len(branch.orbits):
            yield f"Of these {len(indices)}, evenly spread:"
        yield table.written()
        yield "\n".join(_notes(branch))
    if branches[0].is_forced:
        yield from _missing_ends(branches)
        yield fill(PHASES, line_width())
    yield fill(STABLE, line_width())


def _quantities(branch: Branch, linear: float | None) -> Iterator[ReportColumn]:
    """Return the text on an orbit."""
    if branch.variation:
        place = number_label(branch.orbits[0].scene, branch.variation.path)
        yield ReportColumn(partial(_parameter, branch), None, place, ".6g")
    yield ReportColumn(lambda orbit: degrees(orbit.amplitude), None, "largest angle (°)", ".3f")
    if branch.is_forced:
        yield ReportColumn(lambda orbit: degrees(orbit.phase), None, "phase (°)", ".2f")
        yield ReportColumn("fed", None, "fed (J)", ".5g")
    else:
        yield ReportColumn("omega", None, "ω (rad/s)", ".9g")
        if linear:
            yield ReportColumn(
                lambda orbit: orbit.omega / linear - 1, None, "ω/ω₀ − 1", lambda off: f"{100 * off:+.4f} %"
            )
        yield ReportColumn("energy", None, "energy (J)", ".6g")
    yield ReportColumn("is_stable", None, "stable", lambda stable: "yes" if stable else "no")
    yield ReportColumn(_largest, None, "largest |μ|", ".6g")
    if branch.variation and not branch.is_forced:
        yield ReportColumn(growth, None, "growth (1/s)", ".5f")


def _largest(orbit: Orbit) -> float:
    return float(np.abs(orbit.floquet.others).max(initial=0.0))


def _notes(branch: Branch) -> Iterator[str]:
    for special in branch.special:
        yield special_words(branch, special)
    last = branch.orbits[-1]
    if branch.is_forced and branch.orbits[0].floquet.neutral:
        yield "nothing holds the cart: one multiplier is 1, for a shift of its position."
    if branch.is_forced and any(last.turns):
        yield f"whole turns of the links in a period: {', '.join(map(str, last.turns))}."
    if branch.is_forced and branch.returns:
        yield f"the branch leaves the range where it began, at {_place(branch, last)}: another fold may lie beyond."
    if not branch.complete:
        meets = ends_may_meet(system_of(last.scene))
        why = ": a spring between points may pass through zero length there, where its force reverses" * meets
        yield fill(f"the branch was followed no further than {_place(branch, last)}{why}.", line_width())


def _missing_ends(branches: Sequence[Branch]) -> Iterator[str]:
    """The ends of the range at which no branch of forced motions begins or ends, unless a run was the beginning."""
    variation = branches[0].variation
    if variation is None or branches[0].origin == "start":
        return
    reached_values = np.concatenate([branch.value[[0, -1]] for branch in branches])
    for value in (variation.values[0], variation.values[-1]):
        if not np.any(np.isclose(reached_values, value, rtol=1e-9)):
            place = f"{_number(branches[0])} = {value:g} {variation.unit}".rstrip()
            yield fill(f"at {place} no motion was found: start from a run that settles there.", line_width())


def special_words(branch: Branch, special: Special) -> str:
    """A special point in one line."""
    has_turn = special.of and not (branch.is_forced and special.kind == "fold")
    turns = f" {WORDS.get(special.of, 'of ' + special.of)}" if has_turn else ""
    before, after = (branch.orbits[at].is_stable for at in (special.after, special.after + 1))
    fate = "" if before is after else ", where it becomes stable" if after else ", where it loses its stability"
    return f"{special.kind}{turns} at {_place(branch, special.orbit)}{fate}."


def _number(branch: Branch) -> str:
    """The quantity varied along a branch."""
    return number_words(branch.orbits[0].scene, branch.variation.path) if branch.variation else ""


def _place(branch: Branch, orbit: Orbit) -> str:
    digits = 10 if orbit.cycles else 8
    words = [f"{degrees(orbit.amplitude):.5g}°", f"{orbit.omega:.6g} rad/s"][: 1 if orbit.cycles else 2]
    if branch.variation and orbit.value is not None and isfinite(orbit.value):
        words = [f"{_number(branch)} = {orbit.value:.{digits}g} {branch.variation.unit}".rstrip(), *words]
    return listed(words, len(words))
