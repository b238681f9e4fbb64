"""The highest peak of a response at finite swing, by forced orbits over frequencies.

A sine of one size pushes the scene at every frequency of a band; the size is that at which the largest angle of any
link over the band is the one requested. Each orbit is the one next to the linear response, or where the motion from
there settles; where several motions coexist, others are not seen here, and `follow_forced_orbits` follows them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from modal.errors import ComputationError, SceneError
from modal.report import Displayed, Summary
from modal.scene import Scene, SineForce
from modal.scene.doors import checked
from modal.scene.motion import Acting
from modal.types import Floats
from nonlinear.orbits.forced import forced_orbit, linear_response
from nonlinear.orbits.orbit import Orbit

BAND_FREQUENCIES = 33
"""Format: `frequencies` over the band; near the highest they are five times as close."""
SWING_ANGLE_ERROR = 2e-3
"""Limit: relative error of the largest angle, above which "no force was found"."""


@dataclass(frozen=True, eq=False, repr=False)
class FiniteSwing(Displayed):
    """A force of `size` (N or N m), with which links turn by `angle` (rad) at most; per unit of it the highest `peak`.

    `peak` is half the way between the extremes of the output, in its unit per that of the force, at `frequency` (Hz);
    `responses` (W,) are those at `frequencies` (W,), and `stable` whether the orbit of the peak is.
    """

    size: float
    angle: float
    peak: float
    frequency: float
    stable: bool
    frequencies: Floats
    responses: Floats

    def _summary(self) -> Summary:
        facts = [("force", f"{self.size:.5g}"), ("largest angle", f"{np.degrees(self.angle):.4g}°")]
        return Summary(f"Peak at finite swing: {self.peak:.6g} at {self.frequency:.5g} Hz", facts)


@checked
def finite_swing(
    scene: Scene, on: str, direction: Acting, column: int, angle: float, band: tuple[float, float]
) -> FiniteSwing:
    """The highest peak of a coordinate under a sine at a point, where the largest angle of any link is `angle` (rad).

    `column` is the coordinate's, a cart's 0 and links after it; `band` in Hz. Raise SceneError for scenes without
    forced orbits, ComputationError if an orbit is not found.

    >>> from modal import Bob, Pendulum, Scene
    >>> scene = Scene(gravity=9.81, pendulum=[Pendulum(links=[Bob(mass=1.0, length=1.0, damping=0.3)])])
    >>> found = finite_swing(scene, "pendulum[0].links[0]", "horizontal", 0, 0.3, (0.4, 0.6))
    >>> round(found.angle, 3), found.stable
    (0.3, True)
    """
    if not 0 < angle < np.pi:
        raise SceneError([f"angle {np.degrees(angle):g}: is above 0 and below 180 degrees"])
    plain = scene.replace(force=())
    grid = np.geomspace(*band, BAND_FREQUENCIES)

    def forced_scene(size: float, frequency: float) -> Scene:
        return plain.replace(force=(SineForce(on=on, direction=direction, amplitude=size, frequency_hz=frequency),))

    size = angle / max(linear_response(forced_scene(1.0, f)).amplitude for f in grid.tolist())
    for _ in range(4):
        orbits = {f: forced_orbit(forced_scene(size, f)) for f in grid.tolist()}
        widest = max(orbits, key=lambda f: orbits[f].amplitude)
        orbits |= {f: forced_orbit(forced_scene(size, f)) for f in _between(sorted(orbits), widest)}
        largest = max(orbit.amplitude for orbit in orbits.values())
        if abs(largest / angle - 1) < SWING_ANGLE_ERROR:
            break
        size *= angle / largest
    else:
        raise ComputationError(f"no force was found at which the largest angle is {np.degrees(angle):g}°")
    highest = max(orbits, key=lambda f: _half(orbits[f], column))
    orbits |= {f: forced_orbit(forced_scene(size, f)) for f in _between(sorted(orbits), highest)}
    frequencies = sorted(orbits)
    responses = np.array([_half(orbits[f], column) for f in frequencies]) / size
    best = int(responses.argmax())
    orbit = orbits[frequencies[best]]
    peak = float(responses[best])
    return FiniteSwing(size, largest, peak, frequencies[best], orbit.is_stable, np.array(frequencies), responses)


def _between(frequencies: list[float], middle: float) -> list[float]:
    """More frequencies on both sides of one."""
    at = frequencies.index(middle)
    ends = frequencies[max(at - 1, 0)], frequencies[min(at + 1, len(frequencies) - 1)]
    return [f for f in np.linspace(*ends, BAND_FREQUENCIES // 3).tolist() if f not in frequencies]


def _half(orbit: Orbit, column: int) -> float:
    """Half the way between the extremes of a coordinate over an orbit."""
    values = orbit.coordinates[:, column]
    return float(values.max() - values.min()) / 2
