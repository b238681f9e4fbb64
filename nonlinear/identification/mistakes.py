"""Mistakes in how a record is read that explain why no motion of the scene fits it.

Each mistake is the record read in another way: in other units, with a sensor that counts the other way, with two
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
from nonlinear.identification.records import Recording
from nonlinear.identification.starting import spectral_lines

GAIN = 3.0  # times smaller: the misfit without the mistake
ENOUGH = 0.1  # misfit of a record that is read rightly, at its beginning
THOUSAND = 1000.0  # milliseconds in a second
APART = 3.0  # at most, between a frequency of the record and the scene's
FAST = 4.0  # times sqrt(g/l): angles that turn faster whirl, or are in degrees
LARGE = 0.3  # rad: smaller angles are not in degrees, which would be too small to measure
SMALL = 0.05  # rad: smaller angles may be radians in a column of degrees
MOST_SENSORS = 6  # that are exchanged or turned, one after the other


@dataclass(frozen=True)
class Mistake:
    """The record read in another way, what is wrong in words, and the way out."""

    recording: Recording
    words: str
    way: str


def find_mistake(scene: Scene, recording: Recording, misfit: Callable[[Recording], float]) -> str:
    """The mistake without which the motion fits best, with the way out; "" where none helps.

    `misfit` is that of a fit to the beginning of a recording, infinite where there is none.
    """
    present = misfit(recording)
    attempts = [(misfit(mistake.recording), mistake) for mistake in possible(scene, recording)]
    if not attempts:
        return ""
    smallest, best = min(attempts, key=lambda pair: pair[0])
    if not (smallest < ENOUGH and GAIN * smallest < present):
        return ""
    return _describe(best, smallest)


def possible(scene: Scene, recording: Recording) -> Iterator[Mistake]:
    """The mistakes that the record may have."""
    sensors = recording.sensors
    angles = [c for c, sensor in enumerate(sensors) if sensor.is_angle and not sensor.quantity][:MOST_SENSORS]

    def times(factor: float, chosen: list[int]) -> Recording:
        scales = np.ones(len(sensors))
        scales[chosen] = factor
        return replace(recording, segments=tuple(replace(s, values=s.values * scales) for s in recording.segments))

    for chosen in [angles] + [[c] for c in angles if len(angles) > 1]:
        if chosen and _largest(recording, chosen) > LARGE:
            yield in_degrees(recording, chosen)
    if angles and _largest(recording, angles) < SMALL:
        names = [sensors[c].name for c in angles]
        way = "` and `columns=".join(f"{name}_deg={name}_rad" for name in names)
        yield Mistake(times(180 / np.pi, angles), f"{listed(names, len(names))} look like radians", f"`columns={way}`")
    upright = scene.cart is not None and any(not sensor.pendulum for sensor in sensors)
    for c in angles if len(angles) > 1 or upright else []:
        name = sensors[c].name
        yield Mistake(times(-1.0, [c]), f"{name} counts the other way", f"`columns={name}_rad=-{name}_rad`")
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


def in_degrees(recording: Recording, chosen: list[int]) -> Mistake:
    """These sensors read in degrees."""
    names = [recording.sensors[c].name for c in chosen]
    scales = np.ones(len(recording.sensors))
    scales[chosen] = np.pi / 180
    converted_recording = replace(
        recording, segments=tuple(replace(s, values=s.values * scales) for s in recording.segments)
    )
    way = "` and `columns=".join(f"{name}_rad={name}_deg" for name in names)
    return Mistake(
        converted_recording,
        f"{listed(names, len(names))} {'look' if len(names) > 1 else 'looks'} like degrees",
        f"`columns={way}`",
    )


def _largest(recording: Recording, angles: list[int]) -> float:
    return max(float(np.nanmax(np.abs(segment.values[:, angles]))) for segment in recording.segments)


def require_radians(recording: Recording, rate: float, misfit: Callable[[Recording], float]) -> None:
    """SceneError for angles that turn far faster than `rate` (rad/s) and in degrees fit from the beginning."""
    fast = [
        c
        for c, sensor in enumerate(recording.sensors)
        if sensor.is_angle and not sensor.quantity and _speed(recording, c) > FAST * rate
    ]
    if fast:
        mistake = in_degrees(recording, fast)
        remainder = misfit(mistake.recording)
        if remainder < ENOUGH / 2:
            raise SceneError([_describe(mistake, remainder)])


def _speed(recording: Recording, sensor: int) -> float:
    """How fast (rad/s) a sensor's angle turns at most, but for a twentieth of the samples and for outliers."""
    rates = [
        np.abs(
            np.diff(scipy.ndimage.median_filter(segment.values[:, sensor], 3, mode="nearest")) / np.diff(segment.times)
        )
        for segment in recording.segments
    ]
    speeds = np.concatenate(rates)
    speeds = speeds[np.isfinite(speeds)]
    return float(np.quantile(speeds, 0.95)) if len(speeds) else 0.0


def _describe(mistake: Mistake, remainder: float) -> str:
    return f"{mistake.words}: read in this way, the beginning fits to {100 * remainder:.2g} % ({mistake.way})"


def require_seconds(scene: Scene, recording: Recording) -> None:
    """SceneError for times a thousand times too long or too short: lines so far from the scene's frequencies."""
    try:
        omega = natural_modes(scene).omega
    except ComputationError:
        return
    omega, lines = omega[omega > 0], spectral_lines(recording)
    if not len(omega) or not len(lines):
        return
    low, high = omega.min() / APART, omega.max() * APART
    if np.any((lines > low) & (lines < high)):
        return
    for factor, words, way in (
        (THOUSAND, "milliseconds", "time_s=time_ms"),
        (1 / THOUSAND, "seconds", "time_ms=time_s"),
    ):
        if np.all((factor * lines > low) & (factor * lines < high)):
            comparison = f"{lines[0] / (2 * np.pi):.3g} Hz where the scene swings at {omega.min() / (2 * np.pi):.3g} Hz"
            raise SceneError([f"the times look like {words}: the record swings at {comparison} (`columns={way}`)"])
