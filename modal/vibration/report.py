"""Random vibration, thermal noise and shock as text, CSV or JSON."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from math import ceil, floor, log10, tau
from typing import Any

import numpy as np

from modal.errors import SceneError
from modal.modes import Modes
from modal.report import NOTHING, Form, as_csv, as_json, csv_rows, finite, grid, titled
from modal.scene import number_words, title_of
from modal.scene.doors import checked
from modal.scene.signal_names import signal_label, signal_words, unit_words
from modal.statespace.response import MOST_TIMES
from modal.types import Floats
from modal.vibration.random import INPUT, RandomResponse, ThermalNoise, poles_of
from modal.vibration.shock import ShockResponse

POINTS_OF_BAND = 400
"""Format: frequencies of a PSD in a file or a figure, in addition to those around resonances."""
PER_RESONANCE = (-10.0, -3.0, -1.0, -0.3, 0.0, 0.3, 1.0, 3.0, 10.0)
"""Distances from a resonance, in half-widths, at which a PSD is printed in addition to its grid."""
INFINITE = "∞"


WIDTH_OF_BAND = 100.0
"""Format: end of the band of a thermal noise alone over the frequency of the fastest mode, above 0.1 of the slowest."""
MOST_COLUMNS = 6
"""Format: most frequencies in a text, as many columns as fit a line."""
STEPS = (1.0, 2.0, 5.0)


def response_frequencies(response: RandomResponse) -> Floats:
    """Frequencies (Hz) that show every resonance of a PSD: those of the given PSD, a grid, and more at the modes."""
    table = np.array(response.spectrum.frequency_hz)
    low, high = max(table[0], 1e-4 * table[-1]), table[-1]
    values = response.modes.eigenvalue
    close_frequencies = [
        abs(v.imag) + step * max(abs(v.real), 1e-4 * abs(v.imag)) for v in values.tolist() for step in PER_RESONANCE
    ]
    frequencies = np.concatenate([table, np.geomspace(low, high, POINTS_OF_BAND), np.array(close_frequencies) / tau])
    return np.unique(frequencies[(frequencies >= low) & (frequencies <= high)])


@checked
def random_report(response: RandomResponse, form: Form = "text") -> str:
    """RMS by output and by mode, and in CSV and JSON the PSDs: "text", "csv" or "json"."""
    if form == "text":
        return _random_text(response)
    f = response_frequencies(response)
    psd = response.psd(f)
    if form == "csv":
        return csv_rows(list(_random_rows(response, f, psd)))
    return as_json(
        {
            "title": response.modes.scene.title,
            "input": {"quantity": response.source.name.replace("_", " "), "unit": f"({response.source.unit})^2/Hz"},
            "outputs": [
                {
                    "name": signal.name,
                    "unit": signal.unit,
                    "rms": finite(float(response.rms[k])),
                    "by_mode": [
                        {"mode": number, "rms": finite(rms), "miles": finite(white)}
                        for number, (rms, white) in enumerate(
                            zip(response.by_mode[:, k].tolist(), response.white[:, k].tolist(), strict=True), 1
                        )
                    ],
                    "psd": [finite(value) for value in psd[k].tolist()],
                    "psd_unit": f"({signal.unit})^2/Hz",
                }
                for k, signal in enumerate(response.outputs)
            ],
            "frequency_hz": f.tolist(),
            "input_psd": response.input_psd(f).tolist(),
            "infinite": list(response.words),
        }
    )


def _random_rows(response: RandomResponse, f: Floats, psd: Floats) -> Iterator[tuple[Any, ...]]:
    yield "quantity", "output", "unit", "mode", "frequency_hz", "value"
    rates = (response.modes.omega / tau).tolist()
    for k, signal in enumerate(response.outputs):
        yield "rms", signal.name, signal.unit, "all", "", float(response.rms[k])
        for number, rate in enumerate(rates):
            for what, values in (("rms", response.by_mode), ("miles", response.white)):
                yield what, signal.name, signal.unit, number + 1, rate, float(values[number, k])
    signals = (response.source, *response.outputs)
    for signal, each in zip(signals, (response.input_psd(f), *psd), strict=True):
        for frequency, value in zip(f.tolist(), each.tolist(), strict=True):
            yield "psd", signal.name, f"({signal.unit})^2/Hz", "all", frequency, value


UNFELT = "The ground moves a cart or carrier only through its spring and damper, and this scene has none."


def _random_text(response: RandomResponse) -> str:
    f, of = response.spectrum.frequency_hz, response.spectrum.of
    rates = response.modes.omega / tau

    def by_mode(values: Floats) -> list[list[str]]:
        return [
            [f"{k}", *map(_number, (rate, *row))] for k, (rate, row) in enumerate(zip(rates, values, strict=True), 1)
        ]

    rows = [["all", "", *map(_number, response.rms.tolist())], *by_mode(response.by_mode)]
    headings = ["mode", "f (Hz)", *map(signal_label, response.outputs)]
    parts = [
        f"RMS from {f[0]:g} to {f[-1]:g} Hz",
        grid(rows, headings),
        "RMS by Miles' equation, for white noise of the PSD at each mode",
        grid(by_mode(response.white), headings),
        *response.words,
        *([UNFELT] if response.source.name == INPUT and not response.rms.any() else []),
    ]
    source = f"the support's {of}" if response.source.name == INPUT else f"the {signal_label(response.source)}"
    return titled(title_of(response.modes.scene), f"random vibration, from the PSD of {source}", parts, "text")


@checked
def shock_report(response: ShockResponse, form: Form = "text") -> str:
    """Peaks by output and by mode with their combinations, and in CSV and JSON the histories."""
    if form == "text":
        return _shock_text(response)
    rows = _rows(response)
    if form == "csv":
        return csv_rows(list(_shock_rows(response, rows)))
    return as_json(
        {
            "title": response.modes.scene.title,
            "record": {
                "first_s": response.record.first,
                "last_s": response.record.last,
                "band_hz": finite(response.record.band_hz),
            },
            "notes": [response.record.words],
            "modes": [
                {
                    "mode": number,
                    "frequency_hz": omega / tau,
                    "effective_mass_share": finite(share),
                    "cumulative_share": finite(total),
                }
                for number, omega, share, total in _masses(response)
            ],
            "modes_for_90_percent": response.enough,
            "outputs": [
                {
                    "name": signal.name,
                    "unit": signal.unit,
                    "peak": finite(response.peaks[k, 0].item()),
                    "time_s": finite(response.peaks[k, 1].item()),
                    "srss": finite(response.srss[k].item()),
                    "cqc": finite(response.cqc[k].item()),
                    "by_mode": response.mode_peaks[:, k].tolist(),
                    "history": response.history[k, rows].tolist(),
                }
                for k, signal in enumerate(response.outputs)
            ],
            "time_s": response.times[rows].tolist(),
        }
    )


def _rows(response: ShockResponse) -> Any:
    """At most MOST_TIMES samples of a history, evenly spread."""
    return slice(None, None, -(-len(response.times) // MOST_TIMES))


def _masses(response: ShockResponse) -> list[tuple[int, float, float, float]]:
    shares = response.mass_shares
    columns = (response.modes.omega.tolist(), shares.tolist(), np.cumsum(shares).tolist())
    return [(number, *values) for number, values in enumerate(zip(*columns, strict=True), 1)]


def _shock_rows(response: ShockResponse, rows: Any) -> Iterator[tuple[Any, ...]]:
    yield "quantity", "output", "unit", "mode", "time_s", "value"
    for k, signal in enumerate(response.outputs):
        size, time = response.peaks[k].tolist()
        yield "peak", signal.name, signal.unit, "all", time, size
        yield "srss", signal.name, signal.unit, "all", "", float(response.srss[k])
        yield "cqc", signal.name, signal.unit, "all", "", float(response.cqc[k])
        for number, value in enumerate(response.mode_peaks[:, k].tolist(), 1):
            yield "peak", signal.name, signal.unit, number, "", value
    for number, _, share, total in _masses(response):
        yield "effective_mass_share", "", "1", number, "", share
        yield "cumulative_share", "", "1", number, "", total
    for k, signal in enumerate(response.outputs):
        for time, value in zip(response.times[rows].tolist(), response.history[k, rows].tolist(), strict=True):
            yield "history", signal.name, signal.unit, "all", time, value


def _shock_text(response: ShockResponse) -> str:
    headings = ["output", "peak", "at (s)", "SRSS", "CQC", "unit"]
    cells = [
        [
            signal_words(signal.name),
            *map(_number, (*response.peaks[k].tolist(), response.srss[k], response.cqc[k])),
            unit_words(signal.unit),
        ]
        for k, signal in enumerate(response.outputs)
    ]
    modes = ["mode", "f (Hz)", "mass share", "cumulative", *(signal_words(signal.name) for signal in response.outputs)]
    rows = [
        [f"{number}", *map(_number, (omega / tau, share, total, *response.mode_peaks[number - 1]))]
        for number, omega, share, total in _masses(response)
    ]
    parts = [
        grid(cells, headings),
        "peaks of each mode alone, with the sign of the mode",
        grid(rows, modes),
        *_notes(response),
    ]
    return titled(title_of(response.modes.scene), "response to the record", parts, "text")


def _notes(response: ShockResponse) -> Sequence[str]:
    notes = []
    if response.enough:
        notes.append(
            f"The lowest {response.enough} of {len(response.modes)} modes account for 90 % of the mass along the rail."
        )
    elif np.all(np.isfinite(response.mass_shares)):
        share = 100 * float(response.mass_shares.sum())
        notes.append(f"All modes together account for {share:.3g} % of the mass along the rail.")
    else:
        notes.append("The effective masses of these modes are unknown.")
    if np.any(response.follows_support):
        names = ", ".join(signal_words(response.outputs[k].name) for k in np.flatnonzero(response.follows_support))
        notes.append(f"No combination of modes for {names}: the support's own motion adds to theirs.")
    cart = response.modes.rig.cart
    if cart and not cart.stiffness and not cart.damping and not np.any(response.history):
        notes.append("The ground's motion does not reach a free cart: give it a spring or a damper.")
    words = response.record.words
    return [*notes, f"{words[:1].upper()}{words[1:]}."]


def _number(value: float) -> str:
    return INFINITE if np.isinf(value) else NOTHING if np.isnan(value) else f"{value:.5g}"


def named_modes(modes: Modes) -> list[tuple[int, float]]:
    """The number and the frequency (Hz) of every mode that oscillates."""
    return [(number, value.imag / tau) for number, value in enumerate(modes.eigenvalue.tolist(), 1) if value.imag > 0]


def thermal_frequencies(noise: ThermalNoise, beside: RandomResponse | None = None, at: Sequence[float] = ()) -> Floats:
    """Frequencies (Hz) that show every resonance: those of a given PSD, or around the modes, and `at`."""
    if beside is not None:
        return np.unique(np.concatenate([response_frequencies(beside), at]))
    poles = [pole for pole in poles_of(noise.form) if pole.imag > 0]
    rates = [pole.imag / tau for pole in poles] or [1.0]
    low, high = min([min(rates) / WIDTH_OF_BAND**0.5, *at]), max([WIDTH_OF_BAND * max(rates), *at])
    close_frequencies = [
        pole.imag + step * max(abs(pole.real), 1e-4 * pole.imag) for pole in poles for step in PER_RESONANCE
    ]
    frequencies = np.concatenate([np.geomspace(low, high, POINTS_OF_BAND), np.array(close_frequencies) / tau, at])
    return np.unique(frequencies[(frequencies >= low) & (frequencies <= high)])


def thermal_report(
    noise: ThermalNoise, form: str = "text", beside: RandomResponse | None = None, at: Sequence[float] = ()
) -> str:
    """Amplitude spectral densities by output and by place, as "text", "csv" or "json".

    `at` are the frequencies (Hz) of a text, and in the other forms further ones. Of a response to a PSD `beside` it,
    which has the same outputs, the amplitude spectral densities stand next to those of the thermal noise.
    """
    if beside is not None and [output.name for output in beside.outputs] != [output.name for output in noise.outputs]:
        raise SceneError(["outputs: those of the thermal noise and of the response must be the same"])
    if form == "text":
        return _thermal_text(noise, beside, at)
    f = thermal_frequencies(noise, beside, at)
    parts = np.sqrt(noise.budget(f))
    total = np.sqrt((parts**2).sum(0))
    driven = None if beside is None else np.sqrt(beside.psd(f))
    if form == "csv":
        return as_csv(_thermal_records(noise, f, parts, total, driven))
    outputs = []
    for k, signal in enumerate(noise.outputs):
        output: dict[str, Any] = {
            "name": signal.name,
            "unit": signal.unit,
            "asd_unit": f"({signal.unit})/sqrt(Hz)",
            "thermal_asd": list(map(finite, total[k].tolist())),
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


def _thermal_records(
    noise: ThermalNoise, f: Floats, parts: Floats, total: Floats, driven: Floats | None
) -> list[dict[str, Any]]:
    """A row for each frequency: of every output the whole, what a PSD does, and every place."""
    columns: dict[str, list[float]] = {"frequency_hz": f.tolist()}
    for k, signal in enumerate(noise.outputs):
        unit = signal.unit.replace("/", "_per_").replace("^", "") + "_per_sqrt_Hz"
        columns[f"{signal.name}_thermal_{unit}"] = total[k].tolist()
        if driven is not None:
            columns[f"{signal.name}_driven_{unit}"] = driven[k].tolist()
        for j, place in enumerate(noise.places):
            columns[f"{signal.name}_thermal_{unit} {place}"] = parts[j, k].tolist()
    return [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]


def _thermal_text(noise: ThermalNoise, beside: RandomResponse | None, at: Sequence[float]) -> str:
    frequencies = thermal_frequencies(noise, beside, at)
    columns = np.array(sorted(set(at)) or _round(frequencies[0], frequencies[-1]))
    parts = np.sqrt(noise.budget(columns))
    total = np.sqrt((parts**2).sum(0))
    driven = None if beside is None else np.sqrt(beside.psd(columns))
    rms = noise.rms(frequencies[0], frequencies[-1])
    places, tables = [number_words(noise.scene, place) for place in noise.places], []
    for k, signal in enumerate(noise.outputs):
        unit = unit_words(signal.unit)
        rows = [["thermal noise", *map(_number, total[k].tolist())]]
        rows += [[f"  {words}", *map(_number, parts[j, k].tolist())] for j, words in enumerate(places)]
        if driven is not None and beside is not None:
            rows.append([f"from the PSD of the {signal_words(beside.source.name)}", *map(_number, driven[k].tolist())])
            rows.append(["both", *map(_number, np.hypot(total[k], driven[k]).tolist())])
        heading = f"{signal_words(signal.name)} ({unit}/√Hz) at"
        tables.append(grid(rows, [heading, *(f"{f:g} Hz" for f in columns.tolist())]))
        band = f"from {frequencies[0]:.4g} to {frequencies[-1]:.4g} Hz"
        tables.append(f"thermal RMS of {signal_words(signal.name)} {band}: {rms[k]:.5g} {unit}")
    text = titled(title_of(noise.scene), f"thermal noise at {noise.temperature:g} K", tables, "text")
    return text if beside is None else f"{random_report(beside)}\n{text}"


def _round(low: float, high: float) -> list[float]:
    """A few round frequencies between two."""
    decades = range(floor(log10(low)), ceil(log10(high)) + 1)
    for steps in (STEPS, (1.0,)):
        steps_in_band = [step * 10.0**k for k in decades for step in steps if low <= step * 10.0**k <= high]
        if len(steps_in_band) <= MOST_COLUMNS:
            break
    return steps_in_band[:: -(-len(steps_in_band) // MOST_COLUMNS)] or [low, high]
