"""A result of tuning as text and as JSON."""

from __future__ import annotations

from collections.abc import Iterator
from math import tau
from typing import Any

import numpy as np

from modal.report import as_json, finite, grid, percent, titled
from modal.scene import title_of
from modal.scene.parameters import with_numbers
from modal.tuning.loads import Load
from modal.tuning.objective import extreme
from modal.tuning.result import Rule, Tuned
from modal.tuning.worth import SHARE

EQUAL, ALIKE = 1e-6, 1e-3
SHOWN = 6
"""Valleys of which the depth is told."""


def tuned_record(found: Tuned, curves: bool = True) -> dict[str, Any]:
    """Everything about a result for JSON."""
    objective = found.objective
    record: dict[str, Any] = {
        "title": found.given.title,
        "objective": [_aim_record(found, k) for k in range(len(objective.aims))],
        "before": finite(found.before),
        "after": finite(found.after),
        "robust": found.robust,
        "limits": [_limit_record(found, k) for k in range(len(objective.limits))],
        "numbers": [_number_record(found, k) for k in range(len(objective.free))],
        "starts": found.starts,
        "valleys": [
            {
                "numbers": one.numbers.tolist(),
                "objective": finite(one.value),
                "limits_kept": one.kept,
                "settled": one.certain,
            }
            for one in found.valleys
        ],
        "exact": found.certain,
        "rules": [_rule_record(one) for one in found.rules],
        "worst_case": {
            "masses": SHARE,
            "before": finite(found.worst_before),
            "after": finite(found.worst.value),
            "factors": {with_numbers(place): factor for place, factor in found.worst.factors.items()},
        },
        "dampers": [_load_record(one) for one in found.loads],
    }
    if curves:
        record["curves"] = [
            {
                "response": one.name,
                "unit": one.unit,
                "frequency_hz": one.frequency_hz.tolist(),
                "before": list(map(finite, one.before.tolist())),
                "after": list(map(finite, one.after.tolist())),
            }
            for one in found.curves()
        ]
    return record


def tuned_json(found: Tuned, more: dict[str, Any] | None = None) -> str:
    """The same as text, with what else is known of the result."""
    return as_json({**tuned_record(found), **(more or {})})


def _aim_record(found: Tuned, k: int) -> dict[str, Any]:
    aim, own = found.objective.aims[k], found.pieces_after[k]
    quantity = aim.quantity
    record: dict[str, Any] = {
        "quantity": quantity.name,
        "maximized": aim.maximized,
        "weight": quantity.weight,
        "unit": found.unit(quantity),
        "before": finite(extreme(quantity, found.pieces_before[k])),
        "after": finite(extreme(quantity, own)),
    }
    if quantity.kind == "peak":
        order = np.argsort(own.at, kind="stable")
        record["peaks"] = [
            {"frequency_hz": float(own.at[j]) / tau, "magnitude": float(own.values[j])} for j in order if own.inside[j]
        ]
    return record


def _limit_record(found: Tuned, k: int) -> dict[str, Any]:
    limit = found.objective.limits[k]
    at = len(found.objective.aims) + k
    return {
        "quantity": limit.quantity.name,
        "most": limit.most,
        "before": finite(extreme(limit.quantity, found.pieces_before[at])),
        "after": finite(extreme(limit.quantity, found.pieces_after[at])),
    }


def _number_record(found: Tuned, k: int) -> dict[str, Any]:
    one, worth = found.objective.free[k], found.worths[k]
    return {
        "place": one.path,
        "unit": one.unit_name,
        "before": one.value,
        "after": float(np.exp(found.z[k])),
        "bounds": [one.low, one.high] if one.bounded else None,
        "one_percent_larger": finite(worth.larger),
        "one_percent_smaller": finite(worth.smaller),
        "within_one_percent": [finite(worth.low), finite(worth.high)],
    }


def _rule_record(one: Rule) -> dict[str, Any]:
    own = one.absorber
    f, zeta = own.den_hartog
    exact = dict(zip(("f", "zeta"), own.exact, strict=True))
    return {
        "pendulum": own.pendulum,
        "mass_ratio": own.mu,
        "mode_omega_rad_per_s": own.omega,
        "mode_damping_ratio": own.damping_ratio,
        "alone": own.alone,
        "found": {"f": own.f, "zeta": own.zeta},
        "den_hartog": {"f": f, "zeta": zeta, "values": one.values, "objective": finite(one.value)},
        "exact_without_a_damper_of_the_carrier": exact if own.alone else None,
    }


def _load_record(one: Load) -> dict[str, Any]:
    return {
        "damper": one.path,
        "per": one.per,
        "stroke": one.stroke,
        "stroke_unit": one.unit,
        "stroke_at_hz": one.at_hz,
        "effort": one.effort,
        "effort_unit": one.effort_unit,
        "effort_at_hz": one.effort_at_hz,
    }


def tuned_text(found: Tuned, more: str = "") -> str:
    """What was found, as text."""
    parts = [_objective_table(found), _numbers_table(found)]
    parts += ["\n".join(_sentences(found))]
    rules = _rules_table(found)
    parts += [rules] if rules else []
    parts += [more] if more else []
    return titled(title_of(found.given), "tuned", parts, "text")


def _objective_table(found: Tuned) -> str:
    headings = ["", "quantity", "unit", "before", "after", "peaks (Hz)"]
    rows = []
    for k, aim in enumerate(found.objective.aims):
        one, quantity = found.pieces_after[k], aim.quantity
        peaks = ""
        if quantity.kind == "peak":
            largest = one.values.max()
            equal = sorted(one.at[one.inside & (one.values >= largest * (1 - EQUAL))].tolist())
            peaks = ", ".join(f"{at / tau:.5g}" for at in equal)
        values = [f"{extreme(quantity, own[k]):.8g}" for own in (found.pieces_before, found.pieces_after)]
        way = "largest" if aim.maximized else "least"
        rows.append(
            [
                f"{way}{f' ×{quantity.weight:g}' * (quantity.weight != 1)}",
                quantity.name,
                found.unit(quantity),
                *values,
                peaks,
            ]
        )
    for k, limit in enumerate(found.objective.limits):
        at = len(found.objective.aims) + k
        values = [f"{extreme(limit.quantity, own[at]):.8g}" for own in (found.pieces_before, found.pieces_after)]
        rows.append([f"at most {limit.most:g}", limit.quantity.name, found.unit(limit.quantity), *values, ""])
    if not any(row[-1] for row in rows):
        rows, headings = [row[:-1] for row in rows], headings[:-1]
    return grid(rows, headings)


def _numbers_table(found: Tuned) -> str:
    headings = ("number", "unit", "before", "after", "+1 %", "−1 %", "from", "to")
    rows = []
    for one, worth, value in zip(found.objective.free, found.worths, np.exp(found.z).tolist(), strict=True):
        changes = [f"{100 * change:+.3g} %" if np.isfinite(change) else "–" for change in (worth.larger, worth.smaller)]
        ends = [f"{worth.low:.5g}" if worth.low else "any", f"{worth.high:.5g}" if np.isfinite(worth.high) else "any"]
        rows.append([one.path, one.unit_name, f"{one.value:.6g}", f"{value:.9g}", *changes, *ends])
    words = (
        "+1 % and −1 %: by how much the objective is worse where a number is so much larger or smaller. "
        "From … to: where it is at most 1 % worse."
    )
    return grid(rows, headings) + "\n\n" + words


def _sentences(found: Tuned) -> Iterator[str]:
    own = found.objective
    ends, first = found.valleys, found.valleys[0].value
    values = ", ".join(f"{one.value:.6g}" for one in ends[:SHOWN]) + ", …" * (len(ends) > SHOWN)
    alike = [one for one in ends if abs(one.value - first) <= ALIKE * abs(first)]
    if found.starts == 1:
        yield "One start had a finite value."
    elif len(ends) == 1:
        yield f"{found.starts} starts led into one valley."
    elif all(one.certain for one in ends):
        equal = f"; {len(alike)} of them are equally deep" * (len(alike) > 1)
        yield f"{found.starts} starts led into {len(ends)} valleys: {values}{equal}."
    else:
        yield f"{found.starts} starts ended at {values}; the best is kept."
    if not found.certain:
        yield "Newton's method did not settle the last digits: the objective has no second derivatives there."
    at_bounds = [
        one.path
        for one, z, low, high in zip(own.free, found.z, own.low, own.high, strict=True)
        if min(z - low, high - z) < 1e-9
    ]
    if at_bounds:
        yield f"At its bound: {', '.join(at_bounds)}."
    worst = found.worst
    if worst.factors:
        words = "Tuned for the worst case" if found.robust else "Worst case"
        values = f"{worst.value:.6g}, before {found.worst_before:.6g}"
        yield f"{words} of all masses ±{percent(SHARE)}: {values} ({worst.words})."
    for one in found.loads:
        per, where = (f" per {one.per}", f" at {one.at_hz:.4g} Hz") if one.per else (" RMS", "")
        what = "torque" if one.unit == "rad" else "force"
        effort = f"{what} {one.effort:.5g} {one.effort_unit}{per}"
        yield f"{one.path}: stroke {one.stroke:.5g} {one.unit}{per}{where}, {effort}."


def _rules_table(found: Tuned) -> str:
    if not found.rules:
        return ""
    headings = ("pendulum", "μ", "beside", "", "f", "ζ", "objective")
    rows, notes = [], []
    for one in found.rules:
        own = one.absorber
        words = f"{own.omega / tau:.5g} Hz, ζ {own.damping_ratio:.4g}"
        name = f"pendulum[{own.pendulum}]"
        rows.append([name, f"{own.mu:.6g}", words, "found", f"{own.f:.8f}", f"{own.zeta:.8f}", f"{found.after:.8g}"])
        f, zeta = own.den_hartog
        value = f"{one.value:.8g}" if np.isfinite(one.value) else ""
        rows.append(["", "", "", "Den Hartog", f"{f:.8f}", f"{zeta:.8f}", value])
        if own.alone:
            f, zeta = own.exact
            rows.append(
                [
                    "",
                    "",
                    "",
                    "exact if ζ were 0" if own.damping_ratio > EQUAL else "exact",
                    f"{f:.8f}",
                    f"{zeta:.8f}",
                    "",
                ]
            )
        else:
            notes = ["Den Hartog's rule beside several carriers is for the mode nearest to the pendulum alone."]
    return "\n\n".join([grid(rows, headings), *notes])
