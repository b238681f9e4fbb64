"""Frequency loci in print: where they meet, and all of them as CSV."""

from __future__ import annotations

from tabulate import tabulate

from modal.loci.following import Loci
from modal.report import csv_rows


def loci_text(found: Loci) -> str:
    """One line a meeting of two loci: the gap of a crossing is what rounding leaves."""
    values = found.variation.values
    where = f"{found.variation.path} = {values[0]:.6g} to {values[-1]:.6g} {found.variation.unit}".rstrip()
    added = len(found.values) - len(values)
    between = f" and {added} between" if added else ""
    at = f"{found.numbered_at:.6g} {found.variation.unit}".rstrip()
    head = f"{found.omega.shape[1]} loci over {where}, {len(values)} values{between}, numbered as in the table at {at}"
    rows = [
        (
            meeting.kind,
            " · ".join(found.names[number] for number in meeting.loci),
            f"{meeting.value:.10g}",
            f"{meeting.omega:.8g}",
            f"{meeting.gap:.6g}",
            f"{meeting.exchange:.2f}",
        )
        for meeting in found.encounters
    ]
    headers = ("meeting", "loci", f"at {found.variation.unit}".strip(), "ω (rad/s)", "gap (rad/s)", "exchange (MAC)")
    return f"{head}\n{tabulate(rows, headers=headers, disable_numparse=True) if rows else 'none meet'}\n"


def loci_csv(found: Loci) -> str:
    """One row a value: the parameter, then ω of every locus."""
    head = [found.variation.column, *(f"locus_{name}_rad_per_s" for name in found.names)]
    rows = zip(found.values.tolist(), found.omega.tolist(), strict=True)
    return csv_rows([head, *((value, *omega) for value, omega in rows)])
