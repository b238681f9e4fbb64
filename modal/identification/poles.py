"""Experimental modal analysis: frequencies, damping ratios and shapes from records alone, without a scene.

Free decays are realized and their poles fitted to the records themselves (`decays`).  Of responses to
random excitation the correlations are realized, and standard deviations are those of a jackknife over parts of the
records [Efron1981].
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from math import degrees, pi, sqrt
from typing import Any, Literal

import numpy as np

from modal.errors import ComputationError, SceneError
from modal.identification.backbone import Backbone, Harmonic, backbone
from modal.identification.decays import (
    DECAY_MAC_MIN,
    FREQUENCY_STD_MAX,
    HANKEL_ROWS,
    Decays,
    Decrement,
    LargeSwings,
    Realization,
    Series,
    bent,
    fit_decays,
    large_swings,
    log_decrement,
    modal_assurance,
    one_mode,
    realize,
    shape_of,
    suspects,
)
from modal.identification.identifiability import polar
from modal.identification.measured import turned
from modal.identification.parameters import with_error
from modal.report import (
    Displayed,
    Drawable,
    Form,
    ReportColumn,
    ReportTable,
    Result,
    Summary,
    brief,
    by_column,
    capital,
    counted,
    percent,
    records_of,
    short,
)
from modal.scene.doors import checked, checked_index
from modal.scene.signal_names import signal_words
from modal.types import Booleans, Complexes, Floats

ORDINALS = {2: "second", 3: "third"}
SMALL_SWINGS, LARGE_SWINGS = "small swings", "large swings"
METHODS = ("era", "decrement")
EXCITATIONS = ("free", "random")
DECAY_SAMPLES_MIN = 10
"""Limit: samples of a segment: "a segment has … samples"."""
STEP_UNEVENNESS = 0.01
"""Tolerance: of a step, by which samples may be off an even grid without interpolation: clocks round to so much."""
LINE_POWER_MIN = 1e-3
"""Tolerance: of the highest peak's power, a line: Hann's window leaks less than that from a peak."""
PERIOD_SAMPLES_MIN = 6.0
"""Tolerance: samples per period of the fastest line in a row of a Hankel matrix: three times those of Nyquist."""
LAG_PERIODS = 6.0
"""Tolerance: periods of the slowest line over which correlations are used: of longer lags noise is left."""
RECORD_PARTS = 16
"""Tolerance: parts of a record of random responses for their jackknife, whose errors are good to 1/√(2·16)."""
ORDER_MAX = 30
"""Limit: the largest `order`, named where it is exceeded."""
Method = Literal["era", "decrement"]
Excitation = Literal["free", "random"]
AMPLITUDE_MIN = 0.01
"""Tolerance: of the strongest amplitude: weaker poles are harmonics of swings that are not small."""
FREQUENCY_TOLERANCE = 0.01
"""Tolerance: relative, of frequencies of one mode at successive orders, usual in stabilization diagrams."""


@dataclass(frozen=True, eq=False, repr=False)
class IdentifiedMode(Displayed):
    """A pole λ (1/s) with the standard deviations of |λ|/2π (Hz) and of the damping ratio, and its shape (C,).

    The largest component of the shape is 1; `shape_std` is the standard deviation of a component. `frequency_shift` is
    by how much the frequency (Hz) of the record's largest swing differs from that of small ones, which is the pole's;
    None if one frequency fits the record. `frequency_of` says whether the frequency is that of "small swings", or of
    the "large swings" of the record, whose change with amplitude exceeds its interval; None of what is no angle.
    `amplitude_dependence` is the change with amplitude over that of one link, where it is one mode's alone, with its
    standard deviation; `harmonics` are the multiples of the frequency that the record has.
    """

    pole: complex
    frequency_std: float
    damping_ratio_std: float
    shape: Complexes
    shape_std: float | None
    frequency_shift: float | None = None
    frequency_of: str | None = None
    amplitude_dependence: tuple[float, float] | None = None
    harmonics: tuple[Harmonic, ...] = ()

    def _summary(self) -> Summary:
        title = f"Identified mode: {self.frequency:.6g} Hz ± {self.frequency_std:.2g}, ζ = {self.damping_ratio:.4g}"
        title += f" ± {self.damping_ratio_std:.2g}"
        return Summary(title, [("shape", brief(self.shape))])

    @property
    def frequency(self) -> float:
        """The natural frequency |λ|/2π in Hz, as in the table of modes."""
        return abs(self.pole) / (2 * pi)

    @property
    def damping_ratio(self) -> float:
        """−Re λ/|λ|."""
        return -self.pole.real / abs(self.pole)

    @property
    def collinearity(self) -> float:
        """Modal phase collinearity: 1 for a real shape, 0 for a travelling wave.

        [Pappa1993]
        """
        x, y = self.shape.real, self.shape.imag
        total = (x @ x + y @ y) ** 2
        return float(((x @ x - y @ y) ** 2 + 4 * (x @ y) ** 2) / total) if total else 1.0


MODE = (
    ReportColumn("frequency", "frequency_hz"),
    ReportColumn(lambda mode: with_error(mode.frequency, mode.frequency_std), None, "f (Hz)"),
    ReportColumn("frequency_std", "frequency_std_hz", "± (Hz)", ".2g"),
    ReportColumn("damping_ratio", "damping_ratio"),
    ReportColumn(lambda mode: with_error(mode.damping_ratio, mode.damping_ratio_std), None, "ζ"),
    ReportColumn("damping_ratio_std", "damping_ratio_std", "± ζ", ".2g"),
    ReportColumn("collinearity", "collinearity", "collinearity", ".3f"),
)
HARMONIC = (
    ReportColumn("order", "order"),
    ReportColumn("frequency", "frequency_hz"),
    ReportColumn("share", "share"),
    ReportColumn("share_std", "share_std"),
)
MODE_RECORD = (
    *MODE[:-1],
    ReportColumn(lambda mode: [mode.pole.real, mode.pole.imag], "eigenvalue_per_s"),
    ReportColumn(lambda mode: [[value.real, value.imag] for value in mode.shape.tolist()], "shape"),
    ReportColumn("shape_std", "shape_std"),
    MODE[-1],
    ReportColumn("frequency_shift", "frequency_shift_hz"),
    ReportColumn("frequency_of", "frequency_of"),
    ReportColumn("amplitude_dependence", "amplitude_dependence"),
    ReportColumn(lambda mode: records_of(HARMONIC, mode.harmonics), "harmonics"),
)
ORDER_POLE = (
    ReportColumn("order", "order"),
    ReportColumn("frequency", "frequency_hz"),
    ReportColumn("damping_ratio", "damping_ratio"),
    ReportColumn("stable", "stable"),
)
"""The quantities of a mode in columns and in JSON, and of a pole."""
METHOD_NAMES = {"era": "eigensystem realization", "decrement": "logarithmic decrement"}


@dataclass(frozen=True)
class OrderPole:
    """A pole found at an order of the model (Hz), and whether it was there at the order before."""

    order: int
    frequency: float
    damping_ratio: float
    stable: bool


@dataclass(frozen=True, eq=False, repr=False)
class Identified(Drawable, Result):
    """Modes of records with sensors of these `names`, the poles of all orders tried, and notes."""

    modes: tuple[IdentifiedMode, ...]
    names: tuple[str, ...]
    method: str
    excitation: str
    order: int
    stabilization: tuple[OrderPole, ...]
    notes: tuple[str, ...]

    figure = "modal.plotting.identification:poles_figure"

    def titles(self) -> tuple[str, str]:
        """A heading in place of a scene's title: modes, and of which records."""
        of = "free decays" if self.excitation == "free" else "responses to random excitation"
        return "Modes", f"poles of {of}"

    def parts(self, form: Form = "text") -> Iterator[ReportTable | str]:
        """Every mode, the method by which it was found, and notes."""
        shapes = [
            ReportColumn(partial(_component, k), None, signal_words(name), "+.3f") for k, name in enumerate(self.names)
        ]
        number = ReportColumn(lambda mode: self.modes.index(mode) + 1, None, "mode")
        yield ReportTable.of((number, *MODE, *shapes, ReportColumn("shape_std", None, "± shape", ".2g")), self.modes)
        order = f", order {self.order}" if self.method == "era" else ""
        yield f"By {METHOD_NAMES[self.method]}{order}."
        yield "\n".join(capital(note) + "." for note in self.notes)

    def to_dict(self) -> dict[str, Any]:
        """A row for each mode, (R,): frequency and damping ratio with their standard deviations, collinearity."""
        return by_column(records_of(MODE, self.modes))

    def records(self) -> Iterator[dict[str, Any]]:
        """The modes as a file of measured modes has them."""
        for k, mode in enumerate(self.modes, 1):
            shape = dict(zip(self.names, mode.shape.real.tolist(), strict=True)) if len(self.names) > 1 else {}
            noise = {"shape_std": mode.shape_std} if shape and self.method == "era" else {}
            yield {
                "mode": k,
                "frequency_hz": mode.frequency,
                "std_hz": mode.frequency_std,
                "damping_ratio": mode.damping_ratio,
                "damping_ratio_std": mode.damping_ratio_std,
                **shape,
                **noise,
            }

    def whole(self) -> dict[str, Any]:
        """Every mode, and the poles of all orders."""
        return {
            "components": list(self.names),
            "method": self.method,
            "excitation": self.excitation,
            "order": self.order,
            "modes": [{"mode": k, **record} for k, record in enumerate(records_of(MODE_RECORD, self.modes), 1)],
            "stabilization": records_of(ORDER_POLE, self.stabilization),
            "notes": list(self.notes),
        }


def _component(k: int, mode: IdentifiedMode) -> float:
    return float(mode.shape.real[k])


@checked
def poles_table(identified: Identified, form: Form, title: str = "") -> str:
    """The modes as text, csv or json, the `form`; `title` names the record in text."""
    return identified.report(form, title=title)


@checked
def identify(
    segments: Sequence[tuple[Floats, Floats]],
    names: Sequence[str],
    *,
    method: Method = "era",
    excitation: Excitation = "free",
    order: int | None = None,
) -> Identified:
    """The modes of segments of times (K,) in s and values (K, C), NaN if a sensor has none, of sensors `names`.

    `method` is "era" or "decrement", for a single mode; `excitation` is "free" or "random"; `order` is that of the
    model (twice the number of modes, and one for offsets), by default found from the singular values. Raise SceneError
    for records that cannot be used, ComputationError if no mode stands out.
    """
    if order is not None:
        checked_index("order", order, 1, ORDER_MAX)
    if excitation == "random" and method == "decrement":
        raise SceneError(["method decrement: takes free decays, not a random excitation"])
    notes: list[str] = []
    even_values, step = _interpolate_evenly(segments, notes)
    if method == "decrement":
        return _by_decrement(segments, even_values, step, names, notes)
    lines = _lines(even_values, step)
    if excitation == "random":
        return _random(even_values, step, names, order, lines, notes)
    if len(names) == 1 and order is None and _is_dry(even_values, step):
        return _by_decrement(segments, even_values, step, names, notes)
    stride = _stride(lines, step, even_values)
    realization = realize([values - values.mean(axis=0) for values in even_values], step, stride)
    chosen = min(order or min(realization.rank, ORDER_MAX), len(realization.singular))
    diagram = stabilization(realization, max(ORDER_MAX // 2, min(chosen + 10, ORDER_MAX)))
    curve = _curve(segments, names, 0) if len(names) == 1 and order is None else None
    if curve is not None and curve.of_one_link:
        notes += _curve_words(curve)
        mode = _of_curve(curve, np.ones(1, dtype=np.complex128))
        return Identified((mode,), tuple(names), "era", "free", chosen, diagram, tuple(notes))
    poles, _ = realization.poles(chosen)
    modes = _fit_free(segments, names, poles, order, notes)
    return Identified(modes, tuple(names), "era", "free", chosen, diagram, tuple(notes))


def _fit_free(
    segments: Sequence[tuple[Floats, Floats]],
    names: Sequence[str],
    poles: Complexes,
    order: int | None,
    notes: list[str],
) -> tuple[IdentifiedMode, ...]:
    """The modes of free decays, from these poles on; remarks go into the notes."""
    poles = poles[-poles.real / np.abs(poles) > -0.2]  # faster growth is none of a free decay: noise
    series = []
    for s, (times, values) in enumerate(segments):
        for c, column in enumerate(values.T):
            is_present = np.isfinite(column)
            series.append(Series(c, s, times[is_present] - times[0], column[is_present]))
    faint = 0.0 if order else AMPLITUDE_MIN
    decays = fit_decays(series, poles, faint)
    angle = _largest_angle(segments, names, float(abs(decays.poles[np.argmax(np.abs(decays.amplitudes).max(axis=0))])))
    if len(decays.poles) < len(poles):
        notes.append(f"{counted(len(poles) - len(decays.poles), 'pole', 'poles')} omitted: faint or not significant")
    while better := one_mode(series, decays, faint, resolved=order is not None):
        decays = better
    while better := bent(series, decays, faint):
        decays = better
    modes = [_of_decays(decays, r, segments, len(names)) for r in range(len(decays.poles))]
    modes = [replace(mode, frequency_of=_swings_of(mode, angle)) for mode in modes]
    if order is None and not decays.white:
        modes = _without_repetitions(modes, large_swings(series, decays, angle), notes)
    notes += [_bent_words(mode, r) for r, mode in enumerate(modes, 1) if mode.frequency_shift is not None]
    if len(modes) == len(decays.poles):
        notes += [
            f"modes {r + 1} and {s + 1} have the same shape and never beat: perhaps one mode, whose frequency and "
            f"damping depend on amplitude, as with dry friction"
            for r, s in suspects(series, decays)
        ]
    if not decays.white:
        notes.append("the residuals are correlated: standard deviations allow for it; large swings are not linear")
    if any(mode.frequency_of == LARGE_SWINGS for mode in modes):
        notes.append(_large_words(angle))
    return tuple(modes)


def _without_repetitions(modes: list[IdentifiedMode], swings: LargeSwings, notes: list[str]) -> list[IdentifiedMode]:
    """The modes without artefacts of large swings: their poles at other amplitudes, and combination tones.

    Intervals take in the poles at other amplitudes; omissions are noted.
    """
    listed_modes = [r for r in range(len(modes)) if r not in swings.repetitions and r not in swings.tones]
    numbers = {r: number for number, r in enumerate(listed_modes, 1)}
    frequencies = [mode.frequency for mode in modes]
    for r, leader in swings.repetitions.items():
        mode, distance = modes[leader], abs(frequencies[r] - frequencies[leader])
        modes[leader] = replace(mode, frequency_std=max(mode.frequency_std, distance), frequency_of=LARGE_SWINGS)
        name = f"mode {numbers[leader]}" if leader in numbers else f"{frequencies[leader]:.4g} Hz"
        notes.append(f"{frequencies[r]:.4g} Hz is {name} at other amplitudes, and in its interval")
    for r, turns in swings.tones.items():
        names = {i: f"f{numbers[i]}" if i in numbers else f"{frequencies[i]:.4g} Hz" for i in turns}
        words = " ".join(f"{n:+d} {names[i]}" for i, n in turns.items())
        notes.append(f"{frequencies[r]:.4g} Hz is perhaps not a mode, but due to large swings, as {words}")
    return [modes[r] for r in listed_modes]


# ------------------------------------------------------------------------------------------------------- records


def _interpolate_evenly(segments: Sequence[tuple[Floats, Floats]], notes: list[str]) -> tuple[list[Floats], float]:
    """Values on even times with one step for all segments."""
    counts = [len(times) for times, _ in segments if len(times) < DECAY_SAMPLES_MIN]
    if counts:
        raise SceneError([f"a segment has {counts[0]} samples: at least {DECAY_SAMPLES_MIN} are needed"])
    step = float(np.median(np.concatenate([np.diff(times) for times, _ in segments])))
    even_values, is_interpolated = [], False
    for times, values in segments:
        grid = times[0] + step * np.arange(round((times[-1] - times[0]) / step) + 1)
        is_even = len(grid) == len(times) and float(np.abs(times - grid).max()) < STEP_UNEVENNESS * step
        if is_even and np.all(np.isfinite(values)):
            even_values.append(values)
            continue
        is_interpolated = True
        columns = []
        for column in values.T:
            is_present = np.isfinite(column)
            count = int(np.count_nonzero(is_present))
            if count < DECAY_SAMPLES_MIN:
                raise SceneError([f"a sensor has {count} values in a segment: {DECAY_SAMPLES_MIN} are needed"])
            columns.append(np.interp(grid, times[is_present], column[is_present]))
        even_values.append(np.array(columns).T)
    if is_interpolated:
        notes.append("samples are uneven or missing: interpolated for starting values")
    return even_values, step


def _lines(even_values: Sequence[Floats], step: float) -> tuple[float, float]:
    """The slowest and fastest line in Hz."""
    count = int(2 ** np.ceil(np.log2(4 * max(map(len, even_values)))))
    power = np.zeros(count // 2 + 1)
    for values in even_values:
        deviations = (values - values.mean(axis=0)) / np.maximum(values.std(axis=0), 1e-300)
        spectrum = np.fft.rfft(deviations * np.hanning(len(values))[:, None], count, axis=0)
        power += np.sum(np.abs(spectrum) ** 2, axis=1)
    frequency = np.fft.rfftfreq(count, step)
    power[frequency < 1.5 / (max(map(len, even_values)) * step)] = 0.0  # drifts, which last longer than the record
    if not power.max() > 0:
        raise ComputationError("the records contain no oscillation")
    slow = np.flatnonzero(power > 0.05 * power.max())
    fast = np.flatnonzero(power > LINE_POWER_MIN * power.max())
    return float(frequency[slow[0]]), float(frequency[fast[-1]])


def _stride(lines: tuple[float, float], step: float, even_values: Sequence[Floats]) -> int:
    """So many samples apart that the rows span the slowest line, and the fastest one is still sampled well."""
    slow, fast = lines
    rows = max(2, HANKEL_ROWS // even_values[0].shape[1])
    spanning = int(np.ceil(1.5 / slow / (rows * step)))
    return max(1, min(spanning, int(1 / (PERIOD_SAMPLES_MIN * fast * step)), min(map(len, even_values)) // 8))


# ------------------------------------------------------------------------------------------------ stabilization


def stabilization(realization: Realization, order_max: int) -> tuple[OrderPole, ...]:
    """The poles of the orders 2, 4, … up to `order_max`, each compared with those of the order before."""
    diagram: list[OrderPole] = []
    earlier = np.zeros(0, dtype=np.complex128), np.zeros((realization.sensors, 0), dtype=np.complex128)
    usable = int(np.count_nonzero(realization.singular > 1e-12 * realization.singular[0]))
    for order in range(2, max(2, min(order_max, usable)) + 1, 2):
        poles, shapes = realization.poles(order)
        stable = _stable(poles, shapes, *earlier)
        diagram += [
            OrderPole(order, abs(pole) / (2 * pi), -pole.real / abs(pole), bool(is_stable))
            for pole, is_stable in zip(poles.tolist(), stable, strict=True)
        ]
        earlier = poles, shapes
    return tuple(diagram)


def _stable(poles: Complexes, shapes: Complexes, others: Complexes, other_shapes: Complexes) -> Booleans:
    """Which poles (R,) are among others, with their frequency, damping ratio and shape."""
    is_same = np.abs(np.abs(poles)[:, None] / np.abs(others) - 1) < FREQUENCY_TOLERANCE
    damping, dampings = -poles.real / np.abs(poles), -others.real / np.abs(others)
    is_same &= np.abs(damping[:, None] - dampings) < 2 * FREQUENCY_TOLERANCE
    is_same &= modal_assurance(shapes, other_shapes) > DECAY_MAC_MIN
    return np.asarray(is_same.any(axis=1))


# --------------------------------------------------------------------------------------------------- free decays


def _of_decays(decays: Decays, r: int, segments: Sequence[tuple[Floats, Floats]], sensors: int) -> IdentifiedMode:
    count, R = len(segments), len(decays.poles)
    amplitudes, shape = decays.amplitudes[:, r].reshape(count, sensors), shape_of(decays, r, sensors)
    noise = decays.amplitude_stds[:, r].reshape(count, sensors)
    size = np.abs(amplitudes @ shape.conj())
    std = np.sqrt(1 / np.sum(size[:, None] ** 2 / np.maximum(noise, 1e-300) ** 2, axis=0))
    shape, largest = _scale_to_largest(shape)
    pole = complex(decays.poles[r])
    cov = decays.cov[np.ix_([r, R + r], [r, R + r])]
    noise_of_shape = float(np.sqrt(np.mean(std**2))) / largest if sensors > 1 else None
    return replace(_mode_of_pole(pole, cov, shape, noise_of_shape), frequency_shift=decays.shift(r))


def _largest_angle(segments: Sequence[tuple[Floats, Floats]], names: Sequence[str], rate: float) -> float:
    """The largest swing (rad) of the angles and, at a `rate` (1/s), their rates among the sensors, 0 if none is."""
    sizes = {name: 1.0 if _is_angle(name) else rate for name in names if name.startswith("theta")}
    swings = [
        float(np.nanmax(values[:, k]) - np.nanmin(values[:, k])) / (2 * sizes[name])
        for _, values in segments
        for k, name in enumerate(names)
        if name in sizes
    ]
    return max(swings, default=0.0)


def _is_angle(name: str) -> bool:
    return name.startswith("theta") and "dot" not in name


def _swings_of(mode: IdentifiedMode, angle: float) -> str | None:
    """Of which swings the frequency is, where the largest is `angle` (rad): one link's would be off by a²/16."""
    if not angle:
        return None
    is_within = mode.frequency * angle**2 / 16 < 2 * mode.frequency_std
    return SMALL_SWINGS if mode.frequency_shift is not None or is_within else LARGE_SWINGS


def _large_words(angle: float) -> str:
    """The note on a frequency whose change with amplitude the record does not show."""
    return (
        "where the record does not show how a frequency depends on amplitude, the frequency and its interval are those "
        f"of the recorded swings, of up to {degrees(angle):.2g}°: small swings of one link are faster by up to "
        f"{percent(angle**2 / 16)}"
    )


def _curve(segments: Sequence[tuple[Floats, Floats]], names: Sequence[str], sensor: int) -> Backbone | None:
    """How the frequency of a single mode changes with amplitude, by a sensor; None of what is no angle."""
    if not _is_angle(names[sensor]):
        return None
    parts = []
    for times, values in segments:
        is_present = np.isfinite(values[:, sensor])
        parts.append((times[is_present] - times[0], values[is_present, sensor]))
    return backbone(parts)


def _of_curve(curve: Backbone, shape: Complexes) -> IdentifiedMode:
    mode, ratio = _mode_of_pole(curve.pole, curve.cov, shape, None), (curve.ratio, curve.ratio_std)
    mode = replace(mode, frequency_shift=curve.shift / (2 * pi), frequency_of=SMALL_SWINGS)
    return replace(mode, amplitude_dependence=ratio, harmonics=curve.harmonics)


def _curve_words(curve: Backbone) -> list[str]:
    """The note on one link whose frequency changes with amplitude, and of its harmonics."""
    small, large = abs(curve.pole) / (2 * pi), (abs(curve.pole) + curve.shift) / (2 * pi)
    notes = [
        "one mode, whose frequency changes with amplitude as that of one link does, "
        f"{curve.ratio:.3f} ± {curve.ratio_std:.2g} times its 1 − a²/16: from {large:.6g} Hz at "
        f"{degrees(curve.amplitude):.3g}° to {small:.6g} Hz of small swings, which is given"
    ]
    notes += [
        f"{harmonic.frequency:.4g} Hz is the {ORDINALS[harmonic.order]} harmonic of mode 1, {percent(harmonic.share)} "
        "of its largest swing, and no mode"
        for harmonic in curve.harmonics
    ]
    return notes


def _bent_words(mode: IdentifiedMode, number: int) -> str:
    """The note on a mode that linear poles represent by several."""
    assert mode.frequency_shift is not None
    return (
        f"mode {number} is one mode whose frequency changes with amplitude, from "
        f"{mode.frequency + mode.frequency_shift:.6g} Hz at the largest swing to that of small ones, which is given; "
        "two modes of one shape that do not beat within the record would look the same"
    )


def _scale_to_largest(shape: Complexes) -> tuple[Complexes, float]:
    """Turned to its largest real part, with 1 as the largest component; and the divisor."""
    real_shape = turned(shape)
    at = int(np.argmax(np.abs(real_shape.real)))
    return real_shape / real_shape[at].real, abs(float(real_shape[at].real))


def _mode_of_pole(pole: complex, cov: Floats, shape: Complexes, shape_std: float | None) -> IdentifiedMode:
    """With the covariance (2, 2) of the real and imaginary parts of the pole."""
    omega, zeta = polar(pole, np.array([1.0, 1.0j]))
    rounding = np.finfo(float).eps * abs(pole)
    frequency_std = sqrt(max(rounding**2, float(omega @ cov @ omega))) / (2 * pi)
    return IdentifiedMode(pole, frequency_std, sqrt(max(0.0, float(zeta @ cov @ zeta))), shape, shape_std)


def _decrements(even_values: Sequence[Floats], step: float) -> list[Decrement]:
    """The decrements of the sensor with the largest swing, of each segment."""
    columns = [values[:, int(np.argmax(values.std(axis=0)))] for values in even_values]
    return [log_decrement(step * np.arange(len(column), dtype=np.float64), column) for column in columns]


def _is_dry(even_values: Sequence[Floats], step: float) -> bool:
    """Whether turning points lose the same each time, in every segment: no sum of poles does."""
    try:
        return all(decrement.loss is not None for decrement in _decrements(even_values, step))
    except ComputationError:
        return False


def _by_decrement(
    segments: Sequence[tuple[Floats, Floats]],
    even_values: Sequence[Floats],
    step: float,
    names: Sequence[str],
    notes: list[str],
) -> Identified:
    """By the sensor with the largest swing; segments are averaged by their weights."""
    swings = [values - values.mean(axis=0) for values in even_values]
    decrements = _decrements(even_values, step)
    stds = np.array([[decrement.real_std, decrement.imag_std] for decrement in decrements])
    weights = 1 / np.maximum(stds, 1e-300) ** 2
    parts = np.array([[decrement.pole.real, decrement.pole.imag] for decrement in decrements])
    mean = (weights * parts).sum(axis=0) / weights.sum(axis=0)
    _, _, directions = np.linalg.svd(np.vstack(swings), full_matrices=False)
    shape, _ = _scale_to_largest(directions[0].astype(np.complex128))
    notes.append(f"{sum(decrement.peaks for decrement in decrements)} turning points of one mode")
    losses = [decrement.loss for decrement in decrements if decrement.loss is not None]
    if losses:
        notes.append(
            f"each is smaller than the last by {short(float(np.median(losses)))}, whatever its size, as with dry "
            f"friction: the damping ratio is that of the recorded swings, and grows as they decay"
        )
    mode = _mode_of_pole(complex(*mean), np.diag(1 / weights.sum(axis=0)), shape, None)
    curve = _curve(segments, names, int(np.argmax(np.max([swing.std(axis=0) for swing in swings], axis=0))))
    if curve is not None and curve.of_one_link:
        mode = _of_curve(curve, shape)
        notes += _curve_words(curve)
    else:
        angle = _largest_angle(segments, names, abs(mode.pole))
        mode = replace(mode, frequency_of=_swings_of(mode, angle))
        notes += [_large_words(angle)] if mode.frequency_of == LARGE_SWINGS else []
    return Identified((mode,), tuple(names), "decrement", "free", 2, (), tuple(notes))


# ---------------------------------------------------------------------------------------------- random responses


def _random(
    even_values: Sequence[Floats],
    step: float,
    names: Sequence[str],
    order: int | None,
    lines: tuple[float, float],
    notes: list[str],
) -> Identified:
    lags = int(min(LAG_PERIODS / lines[0] / step, min(map(len, even_values)) / 4))
    length = max(sum(map(len, even_values)) // RECORD_PARTS, 3 * lags)
    parts = [values[at : at + length] for values in even_values for at in range(0, len(values) - length + 1, length)]
    if len(parts) < 4:
        raise ComputationError(
            f"the records are too short for random excitation: {short(4 * 4 * lags * step)} s at least, or free decays"
        )
    correlations = [_correlation(part, lags) for part in parts]
    sizes = np.array([len(part) for part in parts], dtype=float)

    def realization_without(left_out: int | None) -> Realization:
        weights = sizes.copy()
        if left_out is not None:
            weights[left_out] = 0.0
        mean = np.tensordot(weights / weights.sum(), np.array(correlations), axes=1)
        columns = [mean[1:, :, k] for k in range(mean.shape[2])]
        return realize(columns, step, _stride(lines, step, columns))

    realization = realization_without(None)
    diagram = stabilization(realization, ORDER_MAX)
    chosen = order or _settled_order(diagram)
    poles, shapes = realization.poles(chosen)
    if order is None:
        is_mode = [_is_often_stable(diagram, pole) for pole in poles.tolist()]
        poles, shapes = poles[is_mode], shapes[:, is_mode]
    modes = _jackknife(poles, shapes, lambda k: realization_without(k).poles(chosen), len(parts))
    if not modes:
        raise ComputationError("no oscillation is stable over the orders of the model")
    notes.append(f"correlations of {len(parts)} parts of {short(len(parts[0]) * step)} s, up to {short(lags * step)} s")
    return Identified(tuple(modes), tuple(names), "era", "random", chosen, diagram, tuple(notes))


def _correlation(values: Floats, lags: int) -> Floats:
    """R(τ) (lags, C, C) of the sensors with each other, unbiased."""
    deviations = values - values.mean(axis=0)
    size = 2 ** int(np.ceil(np.log2(2 * len(deviations))))
    spectrum = np.fft.rfft(deviations, size, axis=0)
    cross = np.fft.irfft(spectrum[:, :, None] * spectrum[:, None, :].conj(), size, axis=0)[:lags]
    return np.asarray(cross / (len(deviations) - np.arange(lags))[:, None, None])


def _settled_order(diagram: Sequence[OrderPole]) -> int:
    """The least order that has as many different stable poles as any."""
    counts: dict[int, int] = {}
    for order in sorted({pole.order for pole in diagram}):
        stable = [pole.frequency for pole in diagram if pole.order == order and pole.stable]
        frequencies = sorted(f for f in stable if _is_often_stable(diagram, 2j * pi * f))
        gap = 1 + 3 * FREQUENCY_TOLERANCE  # nearer ones are one mode, with a double that noise makes
        counts[order] = sum(k == 0 or f > gap * frequencies[k - 1] for k, f in enumerate(frequencies))
    return max(counts, key=lambda order: (counts[order], -order)) if counts else 2


def _is_often_stable(diagram: Sequence[OrderPole], pole: complex) -> bool:
    """Whether a pole is stable at four orders: those of noise come and go."""
    orders = {
        stable_pole.order
        for stable_pole in diagram
        if stable_pole.stable and abs(stable_pole.frequency / (abs(pole) / (2 * pi)) - 1) < 2 * FREQUENCY_TOLERANCE
    }
    return len(orders) >= 4


def _jackknife(
    poles: Complexes, shapes: Complexes, without: Callable[[int], tuple[Complexes, Complexes]], count: int
) -> list[IdentifiedMode]:
    """The modes of these poles and shapes with the spread of those `without` each part of the record."""
    replicas = np.full((count, len(poles)), np.nan + 0j)
    replica_shapes = np.full((count, *shapes.shape), np.nan + 0j)
    for k in range(count):
        others, other_shapes = without(k)
        mac = modal_assurance(shapes, other_shapes)
        for r, pole in enumerate(poles.tolist()):
            distance = np.abs(others - pole) / abs(pole)
            if len(distance) and distance.min() < 0.2:
                at = int(np.argmin(distance + (1 - mac[r])))
                replicas[k, r], replica_shapes[k, :, r] = others[at], other_shapes[:, at]
    modes = []
    for r, pole in enumerate(poles.tolist()):
        rows = np.flatnonzero(np.isfinite(replicas[:, r]))
        m = len(rows)
        if m < 0.75 * count:
            continue
        deviations = replicas[rows, r] - replicas[rows, r].mean()
        parts = np.stack((deviations.real, deviations.imag))
        cov = (m - 1) / m * parts @ parts.T
        shape, _ = _scale_to_largest(shapes[:, r])
        reference = int(np.argmax(np.abs(shape)))
        ratios = replica_shapes[rows, :, r] / replica_shapes[rows, reference, r][:, None] * shape[reference]
        spread = np.sqrt((m - 1) / m * np.sum((ratios.real - ratios.real.mean(axis=0)) ** 2, axis=0))
        std = float(np.sqrt(np.mean(spread**2))) if len(shape) > 1 else None
        mode = _mode_of_pole(pole, cov, shape, std)
        if mode.frequency_std < FREQUENCY_STD_MAX * mode.frequency and mode.damping_ratio > -0.05:
            modes.append(mode)
    return _without_doubles(modes)


def _without_doubles(modes: Sequence[IdentifiedMode]) -> list[IdentifiedMode]:
    """The modes without those that are another, better known one, within their standard deviations."""
    different: list[IdentifiedMode] = []
    for mode in sorted(modes, key=lambda identified: identified.frequency_std):
        for better_mode in different:
            is_near = abs(mode.frequency - better_mode.frequency) < 3 * (mode.frequency_std + better_mode.frequency_std)
            if is_near and modal_assurance(mode.shape[:, None], better_mode.shape[:, None])[0, 0] > DECAY_MAC_MIN:
                break
        else:
            different.append(mode)
    return sorted(different, key=lambda identified: identified.frequency)
