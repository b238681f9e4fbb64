"""Diagnosis of model errors from the residuals of a fit."""

from __future__ import annotations

from collections.abc import Iterator
from math import exp

import numpy as np
import scipy

from modal.identification import autocorrelation, means_of
from modal.identification.decays import CHANCE_MAX, TURNING_POINTS_MIN
from modal.identification.parameters import BOUND_DISTANCE
from modal.modes import natural_modes
from modal.report import counted, listed, percent, short
from modal.scene.signal_names import signal_words
from modal.types import Floats
from nonlinear.identification.records import SEGMENT_ROWS_MIN, is_wrapped
from nonlinear.identification.result import MISFIT_MAX, SIGNIFICANCE, UNIT_WORDS, Fit, root_mean_square
from nonlinear.identification.starting import PERIOD_PART

OUTLIER_STDS = 7.0
"""Tolerance: robust standard deviations of an outlier: of a million readings of noise none is."""
OUTLIER_NEIGHBOURS = 5
"""Tolerance: residuals by whose median each is judged: two adjacent outliers hardly change it."""
WINDOWS_MIN = 8
"""Tolerance: windows whose residuals are ranked by their amplitude: fewer are in order by chance."""


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
        count = sum(outliers(miss) for k, _, miss in _misses(result) if k == c)
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
    for sensor, rho in zip(result.recording.sensors, result.rho, strict=True):
        if len(rho) == 1:
            count = sum(outliers(miss) for k, _, miss in _misses(result) if result.recording.sensors[k] == sensor)
            yield f"{sensor.words}: the residuals are white" + (", but for the outliers" if count else "")
        else:
            yield (
                f"{sensor.words}: the residuals are correlated over {short(float(len(rho) * step))} s, "
                "so the model lacks something or the sensor drifts; standard deviations allow for the correlation, "
                "but not for what is lacking"
            )


def _misses(result: Fit) -> list[tuple[int, Floats, Floats]]:
    """Sensor, times and residuals of every series."""
    series = []
    for misses, segment in zip(result.misses, result.recording.segments, strict=True):
        for c in range(len(result.recording.sensors)):
            is_present = np.isfinite(segment.values[:, c])
            if np.count_nonzero(is_present) > SEGMENT_ROWS_MIN:
                series.append((c, segment.times[is_present], -misses[is_present, c]))
    return series


def _lines(result: Fit) -> Iterator[str]:
    """A frequency at which much of the residuals' power is."""
    modes = natural_modes(result.scene)
    for c, sensor in enumerate(result.recording.sensors):
        if len(result.rho[c]) == 1:
            continue
        misses = [(times, miss) for k, times, miss in _misses(result) if k == c]
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
        for k, times, miss in _misses(result):
            if k != c:
                continue
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
