"""Thermal noise as text, CSV or JSON, alone or beside what a PSD of the support or of a force does."""

from __future__ import annotations

import json
from collections.abc import Sequence
from math import ceil, floor, log10, tau
from typing import Any

import numpy as np

from modal.errors import SceneError
from modal.report import as_csv, as_json, finite, grid, titled
from modal.scene import title_of
from modal.types import Floats
from modal.vibration.random import RandomResponse, poles_of
from modal.vibration.report import PER_RESONANCE, POINTS, random_report, response_frequencies
from modal.vibration.thermal import ThermalNoise

BELOW, ABOVE = 0.1, 100.0
"""Ends of the band of a thermal noise alone, over the frequencies of the slowest and of the fastest mode."""
MOST_SHOWN = 6
"""Most frequencies in a text."""
STEPS = (1.0, 2.0, 5.0)


def thermal_frequencies(noise: ThermalNoise, beside: RandomResponse | None = None, at: Sequence[float] = ()) -> Floats:
    """Frequencies (Hz) that show every resonance: those of a PSD beside it, or around the modes, and `at`."""
    if beside is not None:
        return np.unique(np.concatenate([response_frequencies(beside), at]))
    poles = [pole for pole in poles_of(noise.form) if pole.imag > 0]
    rates = [pole.imag / tau for pole in poles] or [1.0]
    low, high = min([BELOW * min(rates), *at]), max([ABOVE * max(rates), *at])
    near = [pole.imag + step * max(abs(pole.real), 1e-4 * pole.imag) for pole in poles for step in PER_RESONANCE]
    every = np.concatenate([np.geomspace(low, high, POINTS), np.array(near) / tau, at])
    return np.unique(every[(every >= low) & (every <= high)])


def thermal_report(
    noise: ThermalNoise, form: str = "text", beside: RandomResponse | None = None, at: Sequence[float] = ()
) -> str:
    """Amplitude spectral densities by output and by place, as "text", "csv" or "json".

    `at` are the frequencies (Hz) of a text, and in the other forms further ones.  Of a response to a PSD `beside` it,
    which has the same outputs, the amplitude spectral densities stand beside those of the thermal noise.
    """
    if beside is not None and [output.name for output in beside.outputs] != [output.name for output in noise.outputs]:
        raise SceneError(["outputs: those of the thermal noise and of the response beside it must be the same"])
    if form == "text":
        return _text(noise, beside, at)
    f = thermal_frequencies(noise, beside, at)
    parts = np.sqrt(noise.budget(f))
    whole = np.sqrt((parts**2).sum(0))
    driven = None if beside is None else np.sqrt(beside.psd(f))
    if form == "csv":
        return as_csv(_records(noise, f, parts, whole, driven))
    outputs = []
    for k, signal in enumerate(noise.outputs):
        output: dict[str, Any] = {
            "name": signal.name,
            "unit": signal.unit,
            "asd_unit": f"({signal.unit})/sqrt(Hz)",
            "thermal_asd": list(map(finite, whole[k].tolist())),
            "thermal_asd_by_place": {
                place: list(map(finite, parts[j, k].tolist())) for j, place in enumerate(noise.places)
            },
        }
        if driven is not None:
            output["driven_asd"] = list(map(finite, driven[k].tolist()))
        outputs.append(output)
    record: dict[str, Any] = {
        "title": noise.scene.title,
        "temperature_k": noise.temperature,
        "frequency_hz": f.tolist(),
        "outputs": outputs,
    }
    if beside is not None:
        record["driven"] = json.loads(random_report(beside, "json"))
    return as_json(record)


def _records(
    noise: ThermalNoise, f: Floats, parts: Floats, whole: Floats, driven: Floats | None
) -> list[dict[str, Any]]:
    """A row for each frequency: of every output the whole, what a PSD does, and every place."""
    columns: dict[str, list[float]] = {"frequency_hz": f.tolist()}
    for k, signal in enumerate(noise.outputs):
        unit = signal.unit.replace("/", "_per_").replace("^", "") + "_per_sqrt_Hz"
        columns[f"{signal.name}_thermal_{unit}"] = whole[k].tolist()
        if driven is not None:
            columns[f"{signal.name}_driven_{unit}"] = driven[k].tolist()
        for j, place in enumerate(noise.places):
            columns[f"{signal.name}_thermal_{unit} {place}"] = parts[j, k].tolist()
    return [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]


def _text(noise: ThermalNoise, beside: RandomResponse | None, at: Sequence[float]) -> str:
    every = thermal_frequencies(noise, beside, at)
    shown = np.array(sorted(set(at)) or _round(every[0], every[-1]))
    parts = np.sqrt(noise.budget(shown))
    whole = np.sqrt((parts**2).sum(0))
    driven = None if beside is None else np.sqrt(beside.psd(shown))
    rms = noise.rms(every[0], every[-1])
    tables = []
    for k, signal in enumerate(noise.outputs):
        unit = f"{signal.unit}/√Hz"
        rows = [["thermal noise", *map(_number, whole[k].tolist())]]
        rows += [[f"  {place}", *map(_number, parts[j, k].tolist())] for j, place in enumerate(noise.places)]
        if driven is not None and beside is not None:
            name = beside.source.name.replace("_", " ")
            rows.append([f"from the PSD of {name}", *map(_number, driven[k].tolist())])
            rows.append(["both", *map(_number, np.hypot(whole[k], driven[k]).tolist())])
        tables.append(grid(rows, [f"{signal.name} ({unit}) at", *(f"{f:g} Hz" for f in shown.tolist())]))
        band = f"from {every[0]:.4g} to {every[-1]:.4g} Hz"
        tables.append(f"thermal RMS of {signal.name} {band}: {rms[k]:.5g} {signal.unit}")
    text = titled(title_of(noise.scene), f"thermal noise at {noise.temperature:g} K", tables, "text")
    return text if beside is None else f"{random_report(beside)}\n{text}"


def _round(low: float, high: float) -> list[float]:
    """A few round frequencies between two."""
    decades = range(floor(log10(low)), ceil(log10(high)) + 1)
    for steps in (STEPS, (1.0,)):
        every = [step * 10.0**k for k in decades for step in steps if low <= step * 10.0**k <= high]
        if len(every) <= MOST_SHOWN:
            break
    return every[:: -(-len(every) // MOST_SHOWN)] or [low, high]


def _number(value: float) -> str:
    return f"{value:.5g}" if np.isfinite(value) else "∞"
