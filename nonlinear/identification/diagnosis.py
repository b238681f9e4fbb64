"""What the residuals of a fit say that the model lacks."""

from __future__ import annotations

from collections.abc import Iterator
from math import exp

import numpy as np
import scipy

from modal.identification import autocorrelation
from modal.modes import natural_modes
from modal.report import counted, listed, percent, short
from modal.types import Floats
from nonlinear.identification.records import is_wrapped
from nonlinear.identification.result import APART, POOR, Fit, root_mean_square

STRONG = 0.25  # part of the residuals' power in one line that is named
WIDTH = 3  # bins of a line
CERTAIN = 1e-3  # probability by chance of a growth with the amplitude
GROWS = 0.5  # rank correlation that counts
STRETCHES = 8  # least number of windows for it
TURNS = 6  # least number of turning points
STRAIGHTER = 0.6  # residual of a straight line over that of an exponential
FAR = 7.0  # robust standard deviations of an outlier
NEIGHBOURS = 5  # residuals, by whose median each is judged
SURE = 4.5  # standard deviations of a scale that is named
TINY = 1e-3  # a scale nearer to 1
LEFT = 0.25  # of what goes on from residual to residual, at most, once a scale is free
UNEVEN = 3.0  # times the median, of the rms residual of one segment
LOST = 0.2  # misfit beyond which another minimum is likely
PERIODS = 0.8  # in a window, beyond which shorter ones may help
BOUND = 1e-6  # of a natural unit: a number at its bound


def diagnose(found: Fit, mistake: str = "") -> list[str]:
    """Sentences on the record, the motion's misfit, numbers and residuals, each with a way out if there is one.

    A `mistake` in how the record is read is said first.  From a motion that does not fit no number is judged.
    """
    read = [*([mistake] if mistake else []), *_turns(found), *_outliers(found)]
    own = [*_bounds(found), *_held(found), *_whiteness(found)] if found.fits else [*_misfit(found, bool(mistake))]
    return [*read, *own, *_scales(found), *_lines(found), *_growth(found), *_turning(found)]


def _turns(found: Fit) -> Iterator[str]:
    """Angles that jump by a turn."""
    for name in found.recording.continued:
        yield f"{name} jumps by a turn, as angles from atan2 do: it was continued"
    for c, sensor in enumerate(found.recording.sensors):
        if sensor.pendulum and any(is_wrapped(one.values[:, c]) for one in found.recording.segments):
            yield f"{sensor.name} jumps by a turn, as angles from atan2 do: take recording.unwrapped()"


def _outliers(found: Fit) -> Iterator[str]:
    """Single readings far from those beside them."""
    for c, sensor in enumerate(found.recording.sensors):
        if found.misfit[c] > POOR:
            continue
        far = sum(outliers(miss) for k, _, miss in _misses(found) if k == c)
        if far:
            words = f"{sensor.name}: {counted(far, 'reading is an outlier', 'readings are outliers')}, beyond "
            words += f"{FAR:g} standard deviations of the others"
            yield words + (": loss soft_l1 gives them less weight" if found.loss == "linear" else "")


def outliers(miss: Floats) -> int:
    """How many residuals (K,) are far from the median of their neighbours.

    >>> outliers(np.array([0.0, 0.1, -0.1, 0.1, 9.0, -0.1, 0.0, 0.1, -0.1, 0.0]))
    1
    """
    off = miss - scipy.ndimage.median_filter(miss, NEIGHBOURS, mode="nearest")
    spread = float(np.median(np.abs(off[off != 0]))) if np.any(off) else 0.0
    return int(np.count_nonzero(np.abs(off) > FAR * 1.4826 * spread))


def _held(found: Fit) -> Iterator[str]:
    """Standard deviations that hold for one value of a number that the record does not determine."""
    for one in found.undetermined:
        if one.changes:
            value = short(found.given_at(one.held))
            yield (
                f"the standard deviations of {listed([*one.changes], len(one.changes))} are those for {one.held} = "
                f"{value} exactly: a prior, {one.held}={value}±…, adds its doubt"
            )


def _scales(found: Fit) -> Iterator[str]:
    """The sensor whose scale, or all angles whose common one, if it were free would make up for the most."""
    problem, layout = found.problem, found.problem.layout
    if problem.scaled or found.misfit.max() > LOST:
        return
    J, residuals = problem.ordered(problem.jacobian(found.unknowns)), problem.ordered(found.residuals)
    free, best = np.flatnonzero(np.diag(found.cov) > 0), (SURE, "")
    values = [own for *_, own in problem.series()]

    def lasting(r: Floats) -> float:
        return abs(float(sum(r[own][1:] @ r[own][:-1] for own in values)))

    sensors = [(one.name, [layout.scales.start + c]) for c, one in enumerate(found.recording.sensors)]
    angles = [c for c, one in enumerate(found.recording.sensors) if one.pendulum]
    if len(angles) > 1:
        sensors.append(("all angles", [layout.scales.start + c for c in angles]))
    for name, columns in sensors:
        own = np.column_stack((J[:, free], J[:, columns].sum(axis=1)))
        size = np.linalg.norm(own, axis=0)
        if not size.all():
            continue
        back = np.linalg.pinv(own / size, rcond=1e-9) / size[:, None]
        step = -(back @ residuals)
        after = residuals + own @ step
        again = 1 + 2 * max(0.0, float(autocorrelation([after[rows] for rows in values])[1:].sum()))
        std = float(np.linalg.norm(back[-1])) * np.sqrt(again) * root_mean_square(after)
        white = all(len(rho) == 1 for rho in found.rho)
        explained = white or lasting(after) < LEFT * lasting(residuals)
        if std and explained and abs(step[-1]) > TINY and abs(step[-1]) / std > best[0]:
            words = f"{name}: a scale of {1 + step[-1]:.4g} ± {std:.1g} fits better: free the scales"
            best = (abs(step[-1]) / std, words)
    if best[1]:
        yield best[1]


def _misfit(found: Fit, explained: bool) -> Iterator[str]:
    """That the motion does not fit, and where least; a way out where no mistake explains it."""
    worst = int(np.argmax(found.misfit))
    words = "the motion does not fit the record, so its numbers have no standard deviations"
    if found.misfit[worst] >= POOR:
        words += f": {percent(found.misfit[worst])} of the readings of {found.recording.sensors[worst].name} are left"
    if found.gap >= APART:
        words += ": the windows do not join"
    if len(found.rms) > 2 and found.rms.max() > UNEVEN * np.median(found.rms):
        one = found.recording.segments[int(np.argmax(found.rms))]
        words += (
            f", most in {one.name or one.file} (rms {found.rms.max():.2g} rad, half have {np.median(found.rms):.2g})"
        )
    yield words
    longest = max(one.times[-1] - one.times[0] for one in found.recording.segments)
    period = 2 * np.pi / found.problem.system.rate
    if not explained and found.misfit.max() > LOST and longest > PERIODS * period:
        yield (
            "the search may have ended in a wrong minimum: begin with other numbers, or fit in windows with "
            f"window={0.7 * period:.2g}"
        )


def _bounds(found: Fit) -> Iterator[str]:
    for k in found.fitted:
        one = found.parameters[k]
        if one.least == 0.0 and found.unknowns[k] < BOUND:
            white = all(len(rho) == 1 for rho in found.rho)
            yield f"{one.path} is at its bound, 0" + (": the record gives no sign of it" if white else "")


def _whiteness(found: Fit) -> Iterator[str]:
    step = np.median(np.concatenate([np.diff(one.times) for one in found.recording.segments]))
    for sensor, rho in zip(found.recording.sensors, found.rho, strict=True):
        if len(rho) == 1:
            far = sum(outliers(miss) for k, _, miss in _misses(found) if found.recording.sensors[k] == sensor)
            yield f"{sensor.name}: the residuals are white" + (", but for the outliers" if far else "")
        else:
            yield (
                f"{sensor.name}: the residuals are correlated over {short(float(len(rho) * step))} s, "
                "so the model lacks something or the sensor drifts; standard deviations allow for the correlation, not "
                "for what is lacking"
            )


def _misses(found: Fit) -> list[tuple[int, Floats, Floats]]:
    """Sensor, times and residuals of every series."""
    series = []
    for read, one in zip(found.readings, found.recording.segments, strict=True):
        for c in range(len(found.recording.sensors)):
            there = np.isfinite(one.values[:, c])
            if np.count_nonzero(there) > 2 * WIDTH:
                series.append((c, one.times[there], (one.values - read)[there, c]))
    return series


def _lines(found: Fit) -> Iterator[str]:
    """A frequency at which much of the residuals' power is."""
    modes = natural_modes(found.scene)
    for c, sensor in enumerate(found.recording.sensors):
        if len(found.rho[c]) == 1:
            continue
        own = [(times, miss) for k, times, miss in _misses(found) if k == c]
        step = float(np.median(np.diff(own[0][0])))
        longest = max(times[-1] - times[0] for times, _ in own)
        count = 2 ** int(np.ceil(np.log2(4 * longest / step)))
        power = np.zeros(count // 2 + 1)
        for times, miss in own:
            even = np.interp(np.arange(times[0], times[-1], step), times, miss)
            power += np.abs(np.fft.rfft((even - even.mean()) * np.hanning(len(even)), count)) ** 2
        frequency = np.fft.rfftfreq(count, step)
        power[frequency < 1 / longest] = 0.0
        peak = int(np.argmax(power))
        wide = WIDTH * 4
        share = float(power[max(0, peak - wide) : peak + wide + 1].sum() / power.sum()) if power.sum() else 0.0
        if share > STRONG:
            hertz = modes.omega / (2 * np.pi)
            near = int(np.argmin(np.abs(hertz - frequency[peak])))
            yield (
                f"{sensor.name}: {100 * share:.0f} % of the residuals' power is near {frequency[peak]:.3g} Hz "
                f"(mode {near + 1} has {hertz[near]:.3g} Hz)"
            )


def _growth(found: Fit) -> Iterator[str]:
    """Whether residuals are larger where the swing is."""
    for c, sensor in enumerate(found.recording.sensors):
        sizes, misses = [], []
        for k, times, miss in _misses(found):
            if k != c:
                continue
            own = next(
                one for one in found.recording.segments if times[0] >= one.times[0] and times[-1] <= one.times[-1]
            )
            values = own.values[np.isfinite(own.values[:, c]), c]
            window = max(4, int(2 * np.pi / found.problem.system.rate / max(np.median(np.diff(times)), 1e-12)))
            for at in range(0, len(miss) - window + 1, window):
                sizes.append(np.std(values[at : at + window]))
                misses.append(np.sqrt(np.mean(miss[at : at + window] ** 2)))
        if len(sizes) >= STRETCHES:
            rank = scipy.stats.spearmanr(sizes, misses)
            if rank.statistic > GROWS and rank.pvalue < CERTAIN:
                yield f"{sensor.name}: the residuals grow with the amplitude: a loss or a length of the model is wrong"


def _turning(found: Fit) -> Iterator[str]:
    """Turning points on a straight line, the mark of dry friction."""
    has_friction = any(link.friction for link in found.scene.links())
    for c, sensor in enumerate(found.recording.sensors):
        if not sensor.pendulum:
            continue
        for one in found.recording.segments:
            there = np.isfinite(one.values[:, c])
            loss = turning_points(one.times[there], one.values[there, c], found.problem.system.rate)
            if loss:
                words = f"{sensor.name}: turning points fall on a straight line, {loss:.2g} rad a half swing"
                yield words + ("" if has_friction else ": try friction")
                break


def turning_points(times: Floats, values: Floats, rate: float) -> float | None:
    """The loss of amplitude (rad) a half swing where turning points fall on a straight line, None where they do not.

    `rate` (rad/s) is about that of the swing.
    """
    if len(times) < 4 * TURNS:
        return None
    step = float(np.median(np.diff(times)))
    window = min(len(values) - 1, max(5, int(0.4 / rate / step))) | 1
    smooth = scipy.signal.savgol_filter(values, window, 2) if window < len(values) else values
    smooth = smooth - np.median(smooth[-max(5, len(smooth) // 20) :])
    apart = max(1, int(1.2 / rate / step))
    high = 0.04 * np.abs(smooth).max()
    peaks = np.sort(
        np.concatenate([scipy.signal.find_peaks(sign * smooth, height=high, distance=apart)[0] for sign in (1, -1)])
    )
    size = np.abs(smooth[peaks])
    if len(size) < TURNS or np.any(np.diff(size) > 0.05 * size[:-1]) or size[-1] > 0.6 * size[0]:
        return None
    number = np.arange(len(size))
    line = np.polynomial.Polynomial.fit(number, size, 1)
    curve = np.polynomial.Polynomial.fit(number, np.log(size), 1)
    straight = float(np.sqrt(np.mean((line(number) - size) ** 2)))
    bent = float(np.sqrt(np.mean((np.array([exp(v) for v in curve(number)]) - size) ** 2)))
    slope = float(line.deriv()(0.0))
    return -slope if slope < 0 and straight < STRAIGHTER * bent else None
