"""Diagnosis of model errors from the residuals of a fit, and of mistakes in the interpretation of a record.

A mistake in the interpretation of a record may explain why no motion of the scene fits it.  Each is the record read in
another way: in other units, with a sensor that has the opposite sign, with two sensors exchanged.  The scene is fitted
to the beginning of each; a mistake is named where that fits and the record as it was given does not.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import combinations
from math import exp

import numpy as np
import scipy

from modal.errors import ComputationError, SceneError
from modal.identification import autocorrelation, means_of
from modal.identification.decays import CHANCE_MAX, TURNING_POINTS_MIN
from modal.identification.parameters import BOUND_DISTANCE
from modal.modes import natural_modes
from modal.report import counted, listed, percent, short
from modal.scene import Scene
from modal.scene.signal_names import signal_words
from modal.types import Floats
from nonlinear.identification.records import SEGMENT_ROWS_MIN, TIMES, Recording, is_wrapped
from nonlinear.identification.result import MISFIT_MAX, SIGNIFICANCE, UNIT_WORDS, Fit, root_mean_square
from nonlinear.identification.starting import PERIOD_PART, spectral_lines

OUTLIER_STDS = 7.0
"""Tolerance: robust standard deviations of an outlier: of a million readings of noise none is."""
OUTLIER_NEIGHBOURS = 5
"""Tolerance: residuals by whose median each is judged: two adjacent outliers hardly change it."""
WINDOWS_MIN = 8
"""Tolerance: windows whose residuals are ranked by their amplitude: fewer are in order by chance."""
DEGREES_MIN = 0.3
"""Tolerance: rad: smaller angles are not in degrees, which would be too small to measure."""
RADIANS_MAX = 0.05
"""Tolerance: rad: smaller angles may be radians in a column of degrees, 3° at most."""
CHANGED_SENSORS_MAX = 6
"""Cost: sensors that are exchanged or turned, one after the other."""


def diagnose(result: Fit, mistake: str = "") -> list[str]:
    """Return sentences on the record, the misfit, parameters and residuals, each with a remedy if there is one.

    A `mistake` in how the record is read is said first.  From a motion that does not fit no number is judged.
    """
    first = [mistake] if mistake else []
    sentences = [*first, *_turns(result), *_outliers(result), *means_of(result.parameters)]
    motion = (
        [*_bounds(result), *_prior_values(result), *_whiteness(result)]
        if result.fits
        else [*_misfit(result, bool(mistake))]
    )
    return [*sentences, *motion, *_scales(result), *_lines(result), *_growth(result), *_turning(result)]


def _turns(result: Fit) -> Iterator[str]:
    """Angles that jump by a turn."""
    for name in result.recording.continued:
        yield f"{signal_words(name)} jumps by a turn, as angles from atan2 do: it was continued"
    for c, sensor in enumerate(result.recording.sensors):
        if sensor.is_angle and any(is_wrapped(segment.values[:, c]) for segment in result.recording.segments):
            yield f"{sensor.words} jumps by a turn, as angles from atan2 do: take recording.unwrap_angles()"


def _outliers(result: Fit) -> Iterator[str]:
    """Single readings far from those next to them."""
    for c, sensor in enumerate(result.recording.sensors):
        if result.misfit[c] > MISFIT_MAX:
            continue
        count = sum(outliers(miss) for _, miss in _misses(result, c))
        if count:
            words = f"{sensor.words}: {counted(count, 'reading is an outlier', 'readings are outliers')}, beyond "
            words += f"{OUTLIER_STDS:g} standard deviations of the others"
            yield words + (": `loss=soft_l1` gives them less weight" if result.loss == "linear" else "")


def outliers(miss: Floats) -> int:
    """How many residuals (K,) are far from the median of their neighbours.

    >>> outliers(np.array([0.0, 0.1, -0.1, 0.1, 9.0, -0.1, 0.0, 0.1, -0.1, 0.0]))
    1
    """
    off = miss - scipy.ndimage.median_filter(miss, OUTLIER_NEIGHBOURS, mode="nearest")
    spread = float(np.median(np.abs(off[off != 0]))) if np.any(off) else 0.0
    return int(np.count_nonzero(np.abs(off) > OUTLIER_STDS * 1.4826 * spread))


def _prior_values(result: Fit) -> Iterator[str]:
    """Standard deviations that hold for one value of a number that the record does not determine."""
    for direction in result.undetermined:
        if direction.changes:
            value = short(result.given_at(direction.held))
            names = listed([*direction.changes], len(direction.changes))
            yield (
                f"the standard deviations of {names} are those for {direction.held} = {value} exactly: a prior, "
                f"`priors={direction.held}={value}±…`, adds its uncertainty"
            )


def _scales(result: Fit) -> Iterator[str]:
    """The sensor whose scale, or all angles whose common one, if it were free would make up for the most."""
    problem, layout = result.problem, result.problem.layout
    if problem.scaled or result.misfit.max() > 4 * MISFIT_MAX:
        return
    J, residuals = problem.sort_by_sensor(problem.jacobian(result.unknowns)), problem.sort_by_sensor(result.residuals)
    free, best = np.flatnonzero(np.diag(result.cov) > 0), (SIGNIFICANCE, "")
    values = [part for *_, part in problem.series()]

    def lasting(r: Floats) -> float:
        return abs(float(sum(r[part][1:] @ r[part][:-1] for part in values)))

    sensors = [(sensor.words, [layout.scales.start + c]) for c, sensor in enumerate(result.recording.sensors)]
    angles = [c for c, sensor in enumerate(result.recording.sensors) if sensor.is_angle]
    if len(angles) > 1:
        sensors.append(("all angles", [layout.scales.start + c for c in angles]))
    for name, columns in sensors:
        part = np.column_stack((J[:, free], J[:, columns].sum(axis=1)))
        size = np.linalg.norm(part, axis=0)
        if not size.all():
            continue
        back = np.linalg.pinv(part / size, rcond=1e-9) / size[:, None]
        step = -(back @ residuals)
        remainder = residuals + part @ step
        inflation = 1 + 2 * max(0.0, float(autocorrelation([remainder[rows] for rows in values])[1:].sum()))
        std = float(np.linalg.norm(back[-1])) * np.sqrt(inflation) * root_mean_square(remainder)
        white = all(len(rho) == 1 for rho in result.rho)
        # a scale that leaves strongly correlated residuals compensates for some other error
        is_explained = white or lasting(remainder) < lasting(residuals) / 4
        if std and is_explained and abs(step[-1]) / std > best[0]:
            words = f"{name}: a scale of {1 + step[-1]:.4g} ± {std:.1g} fits better: `scale=True`"
            best = (abs(step[-1]) / std, words)
    if best[1]:
        yield best[1]


def _misfit(result: Fit, is_explained: bool) -> Iterator[str]:
    """That the motion does not fit, and where least; a way out where no mistake explains it."""
    worst = int(np.argmax(result.misfit))
    words = "the motion does not fit the record, so its numbers have no standard deviations"
    if result.misfit[worst] >= MISFIT_MAX:
        words += (
            f": {percent(result.misfit[worst])} of the readings of {result.recording.sensors[worst].words} are left"
        )
    if result.gap >= 2 * SIGNIFICANCE:
        words += ": the windows do not join"
    unit = UNIT_WORDS.get(result.rms_unit, result.rms_unit)
    if len(result.rms) > 2 and result.rms.max() > 3 * np.median(result.rms):
        segment = result.recording.segments[int(np.argmax(result.rms))]
        words += f", most in {segment.name or segment.file} (rms {result.rms.max():.2g} {unit}, "
        words += f"half have {np.median(result.rms):.2g})"
    yield words
    longest = max(segment.times[-1] - segment.times[0] for segment in result.recording.segments)
    period = 2 * np.pi / result.problem.system.rate
    if not is_explained and result.misfit.max() > 4 * MISFIT_MAX and longest > PERIOD_PART * period:
        yield (
            "the search may have ended in a wrong minimum: begin with other numbers, or fit in windows with "
            f"`window={PERIOD_PART * period:.2g}`"
        )


def _bounds(result: Fit) -> Iterator[str]:
    for k in result.fitted:
        number = result.parameters[k]
        if number.z_min == 0.0 and result.unknowns[k] < BOUND_DISTANCE:
            white = all(len(rho) == 1 for rho in result.rho)
            yield f"{number.words} is at its bound, 0" + (": the record gives no sign of it" if white else "")


def _whiteness(result: Fit) -> Iterator[str]:
    step = np.median(np.concatenate([np.diff(segment.times) for segment in result.recording.segments]))
    for c, (sensor, rho) in enumerate(zip(result.recording.sensors, result.rho, strict=True)):
        if len(rho) == 1:
            count = sum(outliers(miss) for _, miss in _misses(result, c))
            yield f"{sensor.words}: the residuals are white" + (", but for the outliers" if count else "")
        else:
            yield (
                f"{sensor.words}: the residuals are correlated over {short(float(len(rho) * step))} s, "
                "so the model lacks something or the sensor drifts; standard deviations allow for the correlation, "
                "but not for what is lacking"
            )


def _misses(result: Fit, sensor: int) -> list[tuple[Floats, Floats]]:
    """Times and residuals of every series of a sensor."""
    series = []
    for misses, segment in zip(result.misses, result.recording.segments, strict=True):
        is_present = np.isfinite(segment.values[:, sensor])
        if np.count_nonzero(is_present) > SEGMENT_ROWS_MIN:
            series.append((segment.times[is_present], -misses[is_present, sensor]))
    return series


def _lines(result: Fit) -> Iterator[str]:
    """A frequency at which much of the residuals' power is."""
    modes = natural_modes(result.scene)
    for c, sensor in enumerate(result.recording.sensors):
        if len(result.rho[c]) == 1:
            continue
        misses = _misses(result, c)
        step = float(np.median(np.diff(misses[0][0])))
        longest = max(times[-1] - times[0] for times, _ in misses)
        count = 2 ** int(np.ceil(np.log2(4 * longest / step)))
        power = np.zeros(count // 2 + 1)
        for times, miss in misses:
            evenly = np.interp(np.arange(times[0], times[-1], step), times, miss)
            power += np.abs(np.fft.rfft((evenly - evenly.mean()) * np.hanning(len(evenly)), count)) ** 2
        frequency = np.fft.rfftfreq(count, step)
        power[frequency < 1 / longest] = 0.0
        peak = int(np.argmax(power))
        half_width = 3 * 4  # three bins of the record, four of the padded one each: the main lobe of Hann's window
        line = power[max(0, peak - half_width) : peak + half_width + 1]
        share = float(line.sum() / power.sum()) if power.sum() else 0.0
        if share > 1 / 4:
            hertz = modes.omega / (2 * np.pi)
            mode = int(np.argmin(np.abs(hertz - frequency[peak])))
            yield (
                f"{sensor.words}: {100 * share:.0f} % of the residuals' power is near {frequency[peak]:.3g} Hz "
                f"(mode {mode + 1} has {hertz[mode]:.3g} Hz)"
            )


def _growth(result: Fit) -> Iterator[str]:
    """Whether residuals are larger where the swing is."""
    for c, sensor in enumerate(result.recording.sensors):
        sizes, misses, rates, parts = [], [], [], []
        for times, miss in _misses(result, c):
            segment = next(
                part for part in result.recording.segments if times[0] >= part.times[0] and times[-1] <= part.times[-1]
            )
            values = segment.values[np.isfinite(segment.values[:, c]), c]
            rates.append(np.gradient(values - miss, times))
            parts.append(miss)
            window = max(4, int(2 * np.pi / result.problem.system.rate / max(np.median(np.diff(times)), 1e-12)))
            for at in range(0, len(miss) - window + 1, window):
                sizes.append(np.std(values[at : at + window]))
                misses.append(np.sqrt(np.mean(miss[at : at + window] ** 2)))
        if len(sizes) >= WINDOWS_MIN:
            rank = scipy.stats.spearmanr(sizes, misses)
            if rank.statistic > 0.5 and rank.pvalue < CHANCE_MAX:
                grow = f"{sensor.words}: the residuals grow with the amplitude"
                if len(result.rho[c]) > 1:
                    yield f"{grow}: a loss or a length of the model is wrong"
                else:
                    yield f"{grow} and are white: {_white_growth(np.concatenate(rates), np.concatenate(parts))}"


def _white_growth(rates: Floats, misses: Floats) -> str:
    """Why white residuals grow with the amplitude: a clock that jitters, whose residuals follow the rate."""
    rank = scipy.stats.spearmanr(np.abs(rates), np.abs(misses))
    if rank.statistic > 0 and rank.pvalue < CHANCE_MAX:
        jitter = np.sqrt(np.mean(misses**2) / np.mean(rates**2))
        return f"they follow the rate, as if the clock jittered by {1e3 * jitter:.2g} ms"
    return "the noise grows with the swing, and the model is not at fault"


def _turning(result: Fit) -> Iterator[str]:
    """Turning points on a straight line, the mark of dry friction."""
    has_friction = any(link.friction for link in result.scene.links())
    for c, sensor in enumerate(result.recording.sensors):
        if not sensor.is_angle:
            continue
        for segment in result.recording.segments:
            is_present = np.isfinite(segment.values[:, c])
            loss = turning_points(segment.times[is_present], segment.values[is_present, c], result.problem.system.rate)
            if loss:
                words = f"{sensor.words}: turning points fall on a straight line, {loss:.2g} rad per half swing"
                yield words + ("" if has_friction else ": try friction")
                break


def turning_points(times: Floats, values: Floats, rate: float) -> float | None:
    """The loss of amplitude (rad) a half swing where turning points fall on a straight line, None if they do not.

    `rate` (rad/s) is about that of the swing.
    """
    if len(times) < 4 * TURNING_POINTS_MIN:
        return None
    step = float(np.median(np.diff(times)))
    window = min(len(values) - 1, max(5, int(0.4 / rate / step))) | 1
    smooth = scipy.signal.savgol_filter(values, window, 2) if window < len(values) else values
    smooth = smooth - np.median(smooth[-max(5, len(smooth) // 20) :])
    distance = max(1, int(1.2 / rate / step))
    high = 0.04 * np.abs(smooth).max()
    peaks = np.sort(
        np.concatenate([scipy.signal.find_peaks(sign * smooth, height=high, distance=distance)[0] for sign in (1, -1)])
    )
    size = np.abs(smooth[peaks])
    if len(size) < TURNING_POINTS_MIN or np.any(np.diff(size) > 0.05 * size[:-1]) or size[-1] > 0.6 * size[0]:
        return None
    number = np.arange(len(size))
    line = np.polynomial.Polynomial.fit(number, size, 1)
    curve = np.polynomial.Polynomial.fit(number, np.log(size), 1)
    straight = float(np.sqrt(np.mean((line(number) - size) ** 2)))
    misfit_of_curve = float(np.sqrt(np.mean((np.array([exp(v) for v in curve(number)]) - size) ** 2)))
    slope = float(line.deriv()(0.0))
    return -slope if slope < 0 and straight < misfit_of_curve / 2 else None


@dataclass(frozen=True)
class Mistake:
    """Another interpretation of the record, the mistake in words, and the remedy."""

    recording: Recording
    words: str
    way: str


def find_mistake(scene: Scene, recording: Recording, misfit: Callable[[Recording], float]) -> str:
    """Return the mistake whose correction fits best, with the remedy; "" if none helps.

    `misfit` is that of a fit to the beginning of a recording, infinite if there is none.
    """
    present = misfit(recording)
    attempts = [(misfit(mistake.recording), mistake) for mistake in possible(scene, recording)]
    if not attempts:
        return ""
    smallest, best = min(attempts, key=lambda pair: pair[0])
    return _describe(best, smallest) if smallest < 2 * MISFIT_MAX and 3 * smallest < present else ""


def possible(scene: Scene, recording: Recording) -> Iterator[Mistake]:
    """The mistakes that the record may have."""
    sensors = recording.sensors
    is_angle = [sensor.is_angle and not sensor.quantity for sensor in sensors]
    angles = list(np.flatnonzero(is_angle)[:CHANGED_SENSORS_MAX])

    for chosen in [angles] + [[c] for c in angles if len(angles) > 1]:
        if chosen and _largest(recording, chosen) > DEGREES_MIN:
            yield in_degrees(recording, chosen)
    if angles and _largest(recording, angles) < RADIANS_MAX:
        names = [sensors[c].name for c in angles]
        way = "` and `columns=".join(f"{name}_deg={name}_rad" for name in names)
        words = f"{listed(names, len(names))} look like radians"
        yield Mistake(_multiply(recording, angles, 180 / np.pi), words, f"`columns={way}`")
    upright = scene.cart is not None and any(not sensor.pendulum for sensor in sensors)
    for c in angles if len(angles) > 1 or upright else []:
        name = sensors[c].name
        yield Mistake(
            _multiply(recording, [c], -1.0), f"{name} has the opposite sign", f"`columns={name}_rad=-{name}_rad`"
        )
    for a, b in combinations(angles, 2):
        order = [*range(len(sensors))]
        order[a], order[b] = b, a
        exchanges = tuple(replace(s, values=s.values[:, order]) for s in recording.segments)
        sensor, two = sensors[a].name, sensors[b].name
        way = f"`columns={sensor}_rad={two}_rad` and `columns={two}_rad={sensor}_rad`"
        yield Mistake(replace(recording, segments=exchanges), f"{sensor} and {two} are exchanged", way)
    if not recording.relative and any(sensor.link > 1 for sensor in sensors):
        changed_angles = replace(recording, relative=True)
        try:
            changed_angles.absolute()
        except SceneError:
            return
        yield Mistake(changed_angles, "angles look relative, from the link above", "`angles=relative`")


def _multiply(recording: Recording, chosen: list[int], factor: float) -> Recording:
    """The recording with a factor on the readings of these sensors."""
    scales = np.ones(len(recording.sensors))
    scales[chosen] = factor
    return replace(recording, segments=tuple(replace(s, values=s.values * scales) for s in recording.segments))


def in_degrees(recording: Recording, chosen: list[int]) -> Mistake:
    """These sensors read in degrees."""
    names = [recording.sensors[c].name for c in chosen]
    way = "` and `columns=".join(f"{name}_rad={name}_deg" for name in names)
    words = f"{listed(names, len(names))} {'look' if len(names) > 1 else 'looks'} like degrees"
    return Mistake(_multiply(recording, chosen, np.pi / 180), words, f"`columns={way}`")


def _largest(recording: Recording, angles: list[int]) -> float:
    return max(float(np.nanmax(np.abs(segment.values[:, angles]))) for segment in recording.segments)


def require_radians(recording: Recording, rate: float, misfit: Callable[[Recording], float]) -> None:
    """Raise SceneError for angles that turn far faster than `rate` (rad/s) and in degrees fit from the beginning."""
    angles = [c for c, sensor in enumerate(recording.sensors) if sensor.is_angle and not sensor.quantity]
    fast = [c for c in angles if _speed(recording, c) > 4 * rate]  # a pendulum from the top reaches 2 sqrt(g/l)
    if fast:
        mistake = in_degrees(recording, fast)
        remainder = misfit(mistake.recording)
        if remainder < MISFIT_MAX:
            raise SceneError([_describe(mistake, remainder)])


def _speed(recording: Recording, sensor: int) -> float:
    """How fast (rad/s) a sensor's angle turns at most, but for a twentieth of the samples and for outliers."""
    rates = []
    for segment in recording.segments:
        smooth = scipy.ndimage.median_filter(segment.values[:, sensor], 3, mode="nearest")
        rates.append(np.abs(np.diff(smooth) / np.diff(segment.times)))
    speeds = np.concatenate(rates)
    speeds = speeds[np.isfinite(speeds)]
    return float(np.quantile(speeds, 0.95)) if len(speeds) else 0.0


def _describe(mistake: Mistake, remainder: float) -> str:
    return f"{mistake.words}: read in this way, the beginning fits to {100 * remainder:.2g} % ({mistake.way})"


def require_seconds(scene: Scene, recording: Recording) -> None:
    """Raise SceneError for times a thousand times too long or too short: lines so far from the scene's frequencies."""
    try:
        omega = natural_modes(scene).omega
    except ComputationError:
        return
    omega, lines = omega[omega > 0], spectral_lines(recording)
    if not len(omega) or not len(lines):
        return
    low, high = omega.min() / 3, omega.max() * 3
    if np.any((lines > low) & (lines < high)):
        return
    millisecond = TIMES["time_ms"]
    for factor, words, way in (
        (1 / millisecond, "milliseconds", "time_s=time_ms"),
        (millisecond, "seconds", "time_ms=time_s"),
    ):
        if np.all((factor * lines > low) & (factor * lines < high)):
            comparison = f"{lines[0] / (2 * np.pi):.3g} Hz where the scene swings at {omega.min() / (2 * np.pi):.3g} Hz"
            raise SceneError([f"the times look like {words}: the record swings at {comparison} (`columns={way}`)"])
