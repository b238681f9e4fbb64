"""Fits to measured modes as text and JSON, in the form of fits to motions."""

from __future__ import annotations

from typing import Any

import numpy as np

from modal.identification.mode_fit import ModeFit
from modal.report import NOTHING, as_json, capital, grid, short, titled
from modal.scene import title_of


def mode_fit_record(found: ModeFit) -> dict[str, Any]:
    """The report for JSON; `covariance` is that of `parameters` in their order."""
    numbers = found.fitted
    return {
        "parameters": [
            {"place": found.parameters[k].path, "value": float(found.values[k]), "std": float(found.stds[k])}
            for k in numbers
        ],
        "fixed": [{"place": found.parameters[k].path, "value": float(found.values[k])} for k in found.held.tolist()],
        "combinations": [{"words": c.words, "value": c.value, "std": c.std} for c in found.combinations],
        "unidentifiable": [{"place": one.held, "words": one.words} for one in found.undetermined],
        "segments": [],
        "modes": [
            {
                "mode": one.measured.number,
                "measured_frequency_hz": one.measured.frequency,
                "std_hz": one.measured.std,
                "fitted_frequency_hz": one.frequency,
                "deviation_in_stds": one.deviation,
                "measured_damping_ratio": one.measured.damping_ratio,
                "damping_ratio_std": one.damping_ratio_std,
                "fitted_damping_ratio": one.damping_ratio,
                "mac": one.mac,
            }
            for one in found.modes
        ],
        "chi_square": found.chi_square,
        "degrees_of_freedom": found.freedom,
        "shape_std": found.shape_std,
        "condition": found.determined.condition,
        "covariance": found.covariance[np.ix_(numbers, numbers)].tolist(),
        "other_solutions": [
            {
                "parameters": [
                    {"place": found.parameters[k].path, "value": float(one.values[k]), "std": float(one.stds[k])}
                    for k in numbers
                ],
                "chi_square": one.chi_square,
                "covariance": one.covariance[np.ix_(numbers, numbers)].tolist(),
            }
            for one in found.others
        ],
        "verdict": list(found.verdict),
    }


def mode_fit_json(found: ModeFit) -> str:
    """The report as JSON."""
    return as_json(mode_fit_record(found))


def mode_fit_text(found: ModeFit) -> str:
    """The report as text."""
    held = set(found.held.tolist())
    rows = [
        [
            one.path,
            short(one.value),
            with_error(found.values[k], found.stds[k]),
            "held" if k in held else f"{found.stds[k]:.2g}",
            one.unit_name,
        ]
        for k, one in enumerate(found.parameters)
    ]
    modes = [
        [
            str(one.measured.number),
            with_error(one.measured.frequency, one.measured.std),
            f"{one.measured.std:.2g}",
            with_error(one.frequency, one.measured.std),
            f"{one.deviation:+.2f}",
            NOTHING if one.measured.damping_ratio is None else short(one.measured.damping_ratio),
            short(one.damping_ratio),
            NOTHING if one.mac is None else f"{one.mac:.4f}",
        ]
        for one in found.modes
    ]
    parts = [
        grid(rows, ["number", "given", "fitted", "std", "unit"]),
        "\n".join(f"Determined: {c.words} = {with_error(c.value, c.std)} ± {c.std:.2g}" for c in found.combinations),
        "\n".join(f"Not determined: {one.words}." for one in found.undetermined),
        grid(modes, ["mode", "f (Hz)", "±", "fitted (Hz)", "off by (±)", "ζ", "fitted ζ", "MAC"]),
        "\n".join(capital(line) + "." for line in found.verdict),
    ]
    return titled(title_of(found.given), "fit to measured modes", parts, "text")


def with_error(value: float, std: float) -> str:
    """As many digits as the standard deviation leaves, and one."""
    if not std or not value:
        return short(value)
    digits = int(np.clip(np.ceil(np.log10(abs(value) / std)) + 2, 2, 12))
    return f"{value:.{digits}g}"
