"""Eight panels of `modes.py`: worst relative errors over the number that each family sweeps."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from modes_families import FAMILIES, SHOWN

from modal.plotting import in_both_themes, sheet
from modal.plotting.style import colour, secondary_colour

SOLVERS = {
    "ours": ("multipendula", 0, "o"),
    "eigh": ("scipy.linalg.eigh(K, M)", 1, "s"),
    "eig": ("scipy.linalg.eig", 3, "^"),
}
FLOOR, CEILING = 2e-17, 6.0


def figure(cases: Sequence[Any], path: Path) -> None:
    in_both_themes(lambda: _figure(cases), path)


def _figure(cases: Sequence[Any]) -> Figure:
    made = sheet(13, 6.6)
    axes = made.subplots(2, 4, sharey=True)
    for axis, name in zip(axes.flat, SHOWN, strict=True):
        _panel(axis, name, [case for case in cases if case.family == name])
    for axis in axes[:, 0]:
        axis.set_ylabel("worst relative error (–)")
    handles = {
        label: handle for axis in axes.flat for handle, label in zip(*axis.get_legend_handles_labels(), strict=True)
    }
    made.legend(handles.values(), handles.keys(), loc="outside lower center", ncols=len(handles))
    made.suptitle("Natural frequencies at the extremes (1: no digit is right)")
    return made


def _panel(axis: Any, name: str, cases: Sequence[Any]) -> None:
    cases = [case for case in cases if case.parameter > 0]
    across = np.array([case.parameter for case in cases])
    said = np.array([bool(np.isnan(case.ours)) or "! on" in case.outcome for case in cases])
    errors = {key: np.array([getattr(case, key) for case in cases]) for key in (*SOLVERS, "bound")}
    for order, (key, (label, k, mark)) in enumerate(SOLVERS.items()):
        shown = np.clip(errors[key], FLOOR * 2, 1.0)
        if np.isfinite(shown).any():
            axis.loglog(across, shown, mark + "-", color=colour(k), ms=4.5, lw=1.5, label=label, zorder=4 - order)
    axis.loglog(across, errors["bound"], "--", color=secondary_colour(), lw=1.2, label="bound multipendula states")
    at = np.where(np.isnan(errors["ours"]), 1.0, np.clip(errors["ours"], FLOOR * 2, 1.0))
    if said.any():
        ring = {"ms": 10, "mfc": "none", "mec": colour(4), "mew": 1.5, "zorder": 5}
        axis.loglog(across[said], at[said], "o", label="it marks rows (dot: the others) or refuses", **ring)
    family = next(family for family in FAMILIES if family.name == name)
    axis.set(xlabel=family.axis, title=_title(name), ylim=(FLOOR, CEILING))


def _title(name: str) -> str:
    return name + (" (error of ω₂−ω₁, ω₃−ω₂)" if name == "detuning" else "")
