"""Fits to measured modes as text and JSON, in the form of fits to motions."""

from __future__ import annotations

from typing import Any

import numpy as np

from modal.identification.mode_fit import ModeFit
from modal.report import NOTHING, as_json, capital, grid, short, titled
from modal.scene import title_of


def mode_fit_record(result: ModeFit) -> dict[str, Any]:
    """The report for JSON; `covariance` is that of `parameters` in their order."""
    numbers = result.fitted
    return {
        "parameters": [
            {"place": result.parameters[k].path, "value": float(result.values[k]), "std": float(result.stds[k])}
            for k in numbers
        ],
        "fixed": [{"place": result.parameters[k].path, "value": float(result.values[k])} for k in result.held.tolist()],
        "combinations": [{"words": c.words, "value": c.value, "std": c.std} for c in result.combinations],
        "unidentifiable": [{"place": direction.held, "words": direction.words} for direction in result.undetermined],
        "segments": [],
        "modes": [
            {
                "mode": mode.measured.number,
                "measured_frequency_hz": mode.measured.frequency,
                "std_hz": mode.measured.std,
                "fitted_frequency_hz": mode.frequency,
                "deviation_in_stds": mode.deviation,
                "measured_damping_ratio": mode.measured.damping_ratio,
                "damping_ratio_std": mode.damping_ratio_std,
                "fitted_damping_ratio": mode.damping_ratio,
                "mac": mode.mac,
            }
            for mode in result.modes
        ],
        "chi_square": result.chi_square,
        "degrees_of_freedom": result.freedom,
        "shape_std": result.shape_std,
        "condition": result.determined.condition,
        "covariance": result.covariance[np.ix_(numbers, numbers)].tolist(),
        "other_solutions": [
            {
                "parameters": [
                    {"place": result.parameters[k].path, "value": float(other.values[k]), "std": float(other.stds[k])}
                    for k in numbers
                ],
                "chi_square": other.chi_square,
                "covariance": other.covariance[np.ix_(numbers, numbers)].tolist(),
            }
            for other in result.others
        ],
        "verdict": list(result.verdict),
    }


def mode_fit_json(result: ModeFit) -> str:
    """The report as JSON."""
    return as_json(mode_fit_record(result))


def mode_fit_text(result: ModeFit) -> str:
    """The report as text."""
    held = set(result.held.tolist())
    rows = [
        [
            parameter.path,
            short(parameter.value),
            with_error(result.values[k], result.stds[k]),
            "held" if k in held else f"{result.stds[k]:.2g}",
            parameter.unit_name,
        ]
        for k, parameter in enumerate(result.parameters)
    ]
    modes = [
        [
            str(mode.measured.number),
            with_error(mode.measured.frequency, mode.measured.std),
            f"{mode.measured.std:.2g}",
            with_error(mode.frequency, mode.measured.std),
            f"{mode.deviation:+.2f}",
            NOTHING if mode.measured.damping_ratio is None else short(mode.measured.damping_ratio),
            short(mode.damping_ratio + 0.0),
            NOTHING if mode.mac is None else f"{mode.mac:.4f}",
        ]
        for mode in result.modes
    ]
    parts = [
        grid(rows, ["number", "given", "fitted", "std", "unit"]),
        "\n".join(f"Determined: {c.words} = {with_error(c.value, c.std)} ± {c.std:.2g}" for c in result.combinations),
        "\n".join(f"Not determined: {direction.words}." for direction in result.undetermined),
        grid(modes, ["mode", "f (Hz)", "±", "fitted (Hz)", "off by (±)", "ζ", "fitted ζ", "MAC"]),
        "\n".join(capital(line) + "." for line in result.verdict),
    ]
    return titled(title_of(result.given), "fit to measured modes", parts, "text")


def with_error(value: float, std: float) -> str:
    """As many digits as the standard deviation leaves, and one."""
    if not std or not value:
        return short(value)
    digits = int(np.clip(np.ceil(np.log10(abs(value) / std)) + 2, 2, 12))
    return f"{value:.{digits}g}"
