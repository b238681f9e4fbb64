"""Fits as text and as records for JSON."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from modal.report import NOTHING, as_json, finite, grid, short, titled
from modal.scene import title_of
from nonlinear.identification.comparison import ComparedLaw
from nonlinear.identification.result import Fit


def fit_record(result: Fit, candidates: Sequence[ComparedLaw] = (), draws: int = 0) -> dict[str, Any]:
    """The report of a fit for JSON; `covariance` is that of `parameters` in their order.

    With `draws` every parameter has its `bootstrap_std` of so many resampled records.
    """
    numbers = result.fitted
    record: dict[str, Any] = {
        "parameters": [
            {"place": result.parameters[k].path, "value": float(result.values[k]), "std": finite(float(result.stds[k]))}
            for k in numbers
        ],
        "fixed": [{"place": result.parameters[k].path, "value": float(result.values[k])} for k in result.held.tolist()],
        "combinations": [{"words": c.words, "value": c.value, "std": finite(c.std)} for c in result.combinations],
        "unidentifiable": [{"place": direction.held, "words": direction.words} for direction in result.undetermined],
        "sensors": [_sensor(result, c) for c in range(len(result.recording.sensors))],
        "segments": [
            {
                "file": segment.file,
                "segment": segment.name,
                "rms_residual_rad": float(result.rms[s]),
                "initial": _initial(result, s),
            }
            for s, segment in enumerate(result.recording.segments)
        ],
        "rms_residual_rad": result.rms_all,
        "condition": result.condition,
        "fits": result.fits,
        "misfit": dict(zip((sensor.name for sensor in result.recording.sensors), result.misfit.tolist(), strict=True)),
        "covariance": result.covariance[np.ix_(numbers, numbers)].tolist() if result.fits else None,
        "verdict": list(result.verdict),
    }
    if draws:
        stds = result.bootstrap(draws)
        for number, k in zip(record["parameters"], numbers, strict=True):
            number["bootstrap_std"] = finite(float(stds[k]))
    if candidates:
        record["comparison"] = [
            {
                "model": law.name,
                "rms_residual_rad": law.fit.rms_all,
                "held_out_rms_residual_rad": law.held_out_rms,
                "aic": law.aic,
                "bic": law.bic,
            }
            for law in candidates
        ]
    return record


def fit_json(result: Fit, candidates: Sequence[ComparedLaw] = (), draws: int = 0) -> str:
    """The report as JSON."""
    return as_json(fit_record(result, candidates, draws))


def _sensor(result: Fit, c: int) -> dict[str, Any]:
    layout, sensor = result.problem.layout, result.recording.sensors[c]
    offset, delay, scale = (block.start + c for block in (layout.offsets, layout.delays, layout.scales))
    std = np.sqrt(np.maximum(np.diag(result.cov), 0.0))
    if not result.fits:
        std = np.where(std > 0, np.nan, 0.0)
    return {
        "sensor": sensor.name,
        f"noise_{sensor.unit}": float(result.problem.noise[c]),
        f"offset_{sensor.unit}": float(result.unknowns[offset]),
        f"offset_std_{sensor.unit}": finite(float(std[offset])),
        "delay_s": float(result.unknowns[delay]),
        "delay_std_s": finite(float(std[delay])),
        "scale": 1 + float(result.unknowns[scale]),
        "scale_std": finite(float(std[scale])),
    }


def _initial(result: Fit, s: int) -> dict[str, float]:
    """The state at the segment's first time less the longest delay."""
    problem = result.problem
    state = result.unknowns[problem.layout.state(s)]
    structure, first = problem.system.structure, problem.system.first
    half = problem.coordinates
    names = [f"theta_{label}" for label in _labels(result)]
    initial = {"time_s": float(result.recording.segments[s].times[0] - problem.late)}
    for k, name in enumerate(structure.names if structure and structure.names != ("x",) else ()):
        initial |= {name: float(state[k]), f"{name}_per_s": float(state[half + k])}
    if first and not (structure and structure.names != ("x",)):
        initial |= {"cart_m": float(state[0]), "cart_velocity_m_per_s": float(state[half])}
    initial |= {f"{name}_rad": float(state[first + k]) for k, name in enumerate(names)}
    initial |= {
        f"{name.replace('theta', 'theta_dot')}_rad_per_s": float(state[half + first + k])
        for k, name in enumerate(names)
    }
    return initial


def _labels(result: Fit) -> list[str]:
    seen: dict[int, int] = {}
    labels = []
    for pendulum in result.problem.system.pendulum.tolist():
        seen[pendulum] = seen.get(pendulum, 0) + 1
        labels.append(f"{pendulum + 1}_{seen[pendulum]}")
    return labels


def fit_text(result: Fit, candidates: Sequence[ComparedLaw] = (), draws: int = 0) -> str:
    """The report as text; with `draws` a column has the standard deviations of a bootstrap."""
    rows, again = [], result.bootstrap(draws) if draws else None
    for k, parameter in enumerate(result.parameters):
        unit = parameter.unit_name
        held = k in set(result.held.tolist())
        spread = "held" if held else _spread(result.stds[k])
        more = [] if again is None else ["held" if held else _spread(again[k])]
        rows.append(
            [parameter.path, short(parameter.value), _number(result.values[k], result.stds[k]), spread, *more, unit]
        )
    sensors = [_sensor(result, c) for c in range(len(result.recording.sensors))]
    segments = [
        [segment.file, segment.name or NOTHING, str(len(segment.times)), f"{result.rms[s]:.3g}"]
        for s, segment in enumerate(result.recording.segments)
    ]
    parts = [
        grid(rows, ["number", "given", "fitted", "std", *(["bootstrap"] if draws else []), "unit"]),
        "\n".join(
            f"Determined: {c.words} = {_number(c.value, c.std)} ± {c.std:.2g}"
            for c in result.combinations
            if result.fits
        ),
        "\n".join(f"Not determined: {direction.words}." for direction in result.undetermined),
        grid(
            [[s["sensor"], *[_figure(s, key) for key in ("noise", "offset", "delay", "scale")]] for s in sensors],
            ["sensor", "noise", "offset", "delay (s)", "scale"],
        ),
        grid(segments, ["file", "segment", "rows", "rms residual (rad)"]),
        f"rms residual of all: {result.rms_all:.3g} rad",
        grid(
            [
                [law.name, f"{law.fit.rms_all:.3g}", f"{law.held_out_rms:.3g}", f"{law.aic:.1f}", f"{law.bic:.1f}"]
                for law in candidates
            ],
            ["law", "rms (rad)", "rms held out (rad)", "AIC", "BIC"],
        ),
        "\n".join(
            line[0].upper() + line[1:] + "." if not line.startswith("theta") else line + "." for line in result.verdict
        ),
    ]
    return titled(title_of(result.given), "fit to measured motions", parts, "text")


def _figure(sensor: dict[str, Any], name: str) -> str:
    key = next(key for key in sensor if key == name or (key.startswith(f"{name}_") and "std" not in key))
    spread = next((sensor[key] for key in sensor if key.startswith(f"{name}_std")), 0.0)
    return f"{sensor[key]:.3g}" + (f" ± {spread:.2g}" if spread else "")


def _spread(std: float) -> str:
    """A standard deviation, where there is one."""
    return f"{std:.2g}" if np.isfinite(std) else NOTHING


def _number(value: float, std: float) -> str:
    """As many digits as the standard deviation leaves, and one."""
    if not std > 0 or not value:
        return short(value)
    digits = int(np.clip(np.ceil(np.log10(abs(value) / std)) + 2, 2, 12))
    return f"{value:.{digits}g}"
