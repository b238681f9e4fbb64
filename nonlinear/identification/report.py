"""Fits as text and as records for JSON."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from modal.report import NOTHING, as_json, finite, grid, short, titled
from modal.scene import title_of
from nonlinear.identification.comparison import Candidate
from nonlinear.identification.result import Fit

DIGITS = 6


def fit_record(found: Fit, candidates: Sequence[Candidate] = (), draws: int = 0) -> dict[str, Any]:
    """The report of a fit for JSON; `covariance` is that of `parameters` in their order.

    With `draws` every parameter has its `bootstrap_std` of so many resampled records.
    """
    numbers = found.fitted
    record: dict[str, Any] = {
        "parameters": [
            {"place": found.parameters[k].path, "value": float(found.values[k]), "std": finite(float(found.stds[k]))}
            for k in numbers
        ],
        "fixed": [{"place": found.parameters[k].path, "value": float(found.values[k])} for k in found.held.tolist()],
        "combinations": [{"words": c.words, "value": c.value, "std": finite(c.std)} for c in found.combinations],
        "unidentifiable": [{"place": one.held, "words": one.words} for one in found.undetermined],
        "sensors": [_sensor(found, c) for c in range(len(found.recording.sensors))],
        "segments": [
            {
                "file": one.file,
                "segment": one.name,
                "rms_residual_rad": float(found.rms[s]),
                "initial": _initial(found, s),
            }
            for s, one in enumerate(found.recording.segments)
        ],
        "rms_residual_rad": found.rms_all,
        "condition": found.condition,
        "fits": found.fits,
        "misfit": dict(zip((one.name for one in found.recording.sensors), found.misfit.tolist(), strict=True)),
        "covariance": found.covariance[np.ix_(numbers, numbers)].tolist() if found.fits else None,
        "verdict": list(found.verdict),
    }
    if draws:
        stds = found.bootstrap(draws)
        for one, k in zip(record["parameters"], numbers, strict=True):
            one["bootstrap_std"] = finite(float(stds[k]))
    if candidates:
        record["comparison"] = [
            {
                "model": one.name,
                "rms_residual_rad": one.fit.rms_all,
                "held_out_rms_residual_rad": one.held_out_rms,
                "aic": one.aic,
                "bic": one.bic,
            }
            for one in candidates
        ]
    return record


def fit_json(found: Fit, candidates: Sequence[Candidate] = (), draws: int = 0) -> str:
    """The report as JSON."""
    return as_json(fit_record(found, candidates, draws))


def _sensor(found: Fit, c: int) -> dict[str, Any]:
    layout, sensor = found.problem.layout, found.recording.sensors[c]
    offset, delay, scale = (own.start + c for own in (layout.offsets, layout.delays, layout.scales))
    std = np.sqrt(np.maximum(np.diag(found.cov), 0.0))
    if not found.fits:
        std = np.where(std > 0, np.nan, 0.0)
    return {
        "sensor": sensor.name,
        f"noise_{sensor.unit}": float(found.problem.noise[c]),
        f"offset_{sensor.unit}": float(found.unknowns[offset]),
        f"offset_std_{sensor.unit}": finite(float(std[offset])),
        "delay_s": float(found.unknowns[delay]),
        "delay_std_s": finite(float(std[delay])),
        "scale": 1 + float(found.unknowns[scale]),
        "scale_std": finite(float(std[scale])),
    }


def _initial(found: Fit, s: int) -> dict[str, float]:
    """The state at the segment's first time less the longest delay."""
    problem = found.problem
    state = found.unknowns[problem.layout.state(s)]
    structure, first = problem.system.structure, problem.system.first
    half = problem.coordinates
    names = [f"theta_{label}" for label in _labels(found)]
    initial = {"time_s": float(found.recording.segments[s].times[0] - problem.late)}
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


def _labels(found: Fit) -> list[str]:
    seen: dict[int, int] = {}
    labels = []
    for pendulum in found.problem.system.pendulum.tolist():
        seen[pendulum] = seen.get(pendulum, 0) + 1
        labels.append(f"{pendulum + 1}_{seen[pendulum]}")
    return labels


def fit_text(found: Fit, candidates: Sequence[Candidate] = (), draws: int = 0) -> str:
    """The report as text; with `draws` a column has the standard deviations of a bootstrap."""
    rows, again = [], found.bootstrap(draws) if draws else None
    for k, one in enumerate(found.parameters):
        unit = one.unit_name
        held = k in set(found.held.tolist())
        spread = "held" if held else _spread(found.stds[k])
        more = [] if again is None else ["held" if held else _spread(again[k])]
        rows.append([one.path, short(one.value), _number(found.values[k], found.stds[k]), spread, *more, unit])
    sensors = [_sensor(found, c) for c in range(len(found.recording.sensors))]
    segments = [
        [one.file, one.name or NOTHING, str(len(one.times)), f"{found.rms[s]:.3g}"]
        for s, one in enumerate(found.recording.segments)
    ]
    parts = [
        grid(rows, ["number", "given", "fitted", "std", *(["bootstrap"] if draws else []), "unit"]),
        "\n".join(
            f"Determined: {c.words} = {_number(c.value, c.std)} ± {c.std:.2g}" for c in found.combinations if found.fits
        ),
        "\n".join(f"Not determined: {one.words}." for one in found.undetermined),
        grid(
            [[s["sensor"], *[_figure(s, key) for key in ("noise", "offset", "delay", "scale")]] for s in sensors],
            ["sensor", "noise", "offset", "delay (s)", "scale"],
        ),
        grid(segments, ["file", "segment", "rows", "rms residual (rad)"]),
        f"rms residual of all: {found.rms_all:.3g} rad",
        grid(
            [
                [one.name, f"{one.fit.rms_all:.3g}", f"{one.held_out_rms:.3g}", f"{one.aic:.1f}", f"{one.bic:.1f}"]
                for one in candidates
            ],
            ["law", "rms (rad)", "rms held out (rad)", "AIC", "BIC"],
        ),
        "\n".join(
            line[0].upper() + line[1:] + "." if not line.startswith("theta") else line + "." for line in found.verdict
        ),
    ]
    return titled(title_of(found.given), "fit to measured motions", parts, "text")


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
