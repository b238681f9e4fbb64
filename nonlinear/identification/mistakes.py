"""Mistakes in the interpretation of a record that explain why no motion of the scene fits it.

Each mistake is the record read in another way: in other units, with a sensor that has the opposite sign, with two
sensors exchanged.  The scene is fitted to the beginning of each; a mistake is named where that fits and the record as
it was given does not.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
import scipy

from modal.errors import ComputationError, SceneError
from modal.modes import natural_modes
from modal.report import listed
from modal.scene import Scene
from nonlinear.identification.records import TIMES, Recording
from nonlinear.identification.result import MISFIT_MAX
from nonlinear.identification.starting import spectral_lines

DEGREES_MIN = 0.3
"""Tolerance: rad: smaller angles are not in degrees, which would be too small to measure."""
RADIANS_MAX = 0.05
"""Tolerance: rad: smaller angles may be radians in a column of degrees, 3° at most."""
CHANGED_SENSORS_MAX = 6
"""Cost: sensors that are exchanged or turned, one after the other."""


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
