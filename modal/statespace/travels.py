"""A travel of a crane in the linear model, unshaped and with an input shaper: the command and the swing over time.

A prescribed motion of the cart is x = d (10 s³ − 15 s⁴ + 6 s⁵), s from 0 to 1.  A force, on a cart or on a coordinate j
of a structure, is what moves the coordinate so far along the shape φ in which the scene follows it slowly, φ_j = 1:

    F = m x'' + c x' + k x,     m = φᵀMφ,  c = φᵀDφ,  k = φᵀKφ,

so that the force on a free cart is that on all masses, and on a ship at its moorings ends in their pull at d.  A shaped
command is Σ A_i u(t − t_i).  Between its corners a command is a polynomial (`modal.statespace.hoisting`).

Within limits of speed, acceleration and jerk the travel takes the shortest time; a shaped one keeps to the limits of an
unshaped one where no impulse is negative.  As a record it is sampled so that straight lines between the accelerations
are the travel itself: where the acceleration jumps they take two samples more, 2δ apart, and all of it is δ late.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import degrees

import numpy as np
import scipy

from modal.assembly import hoisting_of, matrices_along, rig_of
from modal.errors import SceneError
from modal.report import Displayed, Drawable, Summary, tabulated
from modal.scene import Scene, refusals
from modal.scene.doors import checked, checked_number
from modal.scene.length_laws import LengthLaw
from modal.scene.motion import FORCES, RECORDED
from modal.statespace.hoisting import SAMPLES_OF_HISTORY, Travel, TravelLimits, is_held, largest_swing, motion_history
from modal.statespace.shapers import UNSHAPED, Drive, Shaper, drives_of, swings_of
from modal.structure import structure_of
from modal.types import EPS, NOISE_OF_SUM, NOISE_OF_TERMS, Floats

ACCELERATION_OF_TRAVEL = 0.1
"""Limit: acceleration of a travel whose `duration` is not given, over that of gravity."""
SQUARE_OF_SLOW_PUSH = 1e-10
"""Tolerance: ω² of a slow push over that of the fastest mode: what follows it, follows to ten digits."""
LARGEST_TRAVEL = 1e6
"""Limit: metres of a travel and seconds of its duration, refused beyond, as is less than one over it."""


@dataclass(frozen=True, eq=False, repr=False)
class ShapedTravel(Drawable, Displayed):
    """A travel of `distance` (m) under a `drive`, unshaped (row 0) and shaped (row 1), at `times` (T,) in s.

    `command` (2, T) is the place of a cart whose motion is prescribed (m) or a force in `unit`; `moved` (2, T) the
    coordinate that it moves, in m or rad; `angles` (2, T, L) those of the links (rad); `residual` (2,) the largest
    angle (rad) to which the swings of all frequencies add up when command and hoist are over, from `over` (2,) in s on.
    `ways` are the two as laws of time (m); a force on the `coordinate` is `push` @ (x, x', x'').
    """

    scene: Scene
    drive: Drive
    distance: float
    times: Floats
    command: Floats
    moved: Floats
    angles: Floats
    residual: Floats
    over: Floats
    unit: str
    ways: tuple[LengthLaw, LengthLaw]
    push: Floats
    coordinate: int
    figure = "modal.plotting.response:travel_figure"

    @property
    def peaks(self) -> Floats:
        """The largest speed (m/s) and acceleration (m/s²) of both ways, (2, 2)."""
        return np.array([np.abs(way(np.union1d(self.times, way.knots))[1:]).max(1) for way in self.ways])

    def words(self, nonlinear: Sequence[float] = ()) -> Iterator[str]:
        """Return duration and residual swing, unshaped and shaped, a line each, with those of the full equations.

        `nonlinear` (2,) are these angles (rad).
        """
        of_equations = [f", {degrees(angle):.4g}° in the full equations" for angle in nonlinear] or ["", ""]
        for row, name in enumerate(("unshaped", "shaped")):
            angle, (speed, acceleration) = degrees(self.residual[row]), self.peaks[row].tolist()
            span = self.ways[row].knots[-1] - self.ways[row].knots[0]
            yield (
                f"a travel of {self.distance:g} m {name}: residual swing {angle:.4g}°{of_equations[row]}; "
                f"it takes {span:.4g} s, at most {speed:.4g} m/s and {acceleration:.4g} m/s²"
            )

    def columns(self, row: int = 1, step: float = 0.0) -> dict[str, Floats]:
        """The travel (`row` 0 as it is, 1 shaped) as columns of a record, at multiples of a `step` (s) if not 0.

        Time and motion of a cart that is prescribed, time and force else.
        """
        times, *motion = _sampled(self.ways[row], step)
        if self.unit == "m":
            return dict(zip(("time_s", *RECORDED), (times, *motion), strict=True))
        return {"time_s": times, FORCES[self.unit == "N m"]: self.push @ np.array(motion)}

    def _summary(self) -> Summary:
        largest = np.degrees(np.abs(self.angles).max((1, 2)))
        columns = {
            "command": ["unshaped", "shaped"],
            "over at (s)": [f"{time:.4g}" for time in self.over],
            "largest speed (m/s)": [f"{speed:.4g}" for speed in self.peaks[:, 0]],
            "acceleration (m/s²)": [f"{acceleration:.4g}" for acceleration in self.peaks[:, 1]],
            "largest angle (°)": [f"{angle:.4g}" for angle in largest],
            "residual swing (°)": [f"{angle:.4g}" for angle in np.degrees(self.residual)],
        }
        return tabulated(f"Travel of {self.distance:g} m", [], columns)


@checked
def shaped_travel(
    scene: Scene,
    shaper: Shaper,
    distance: float | str,
    duration: float | None = None,
    drive: Drive = "cart_acceleration",
    limits: TravelLimits | None = None,
) -> ShapedTravel:
    """The travel by `distance` (m) over `duration` (s), unshaped and shaped, from the beginning of the hoist or 0 s on.

    By default it lasts as long as the hoist; without one a period of the slowest swing, or so long that its
    acceleration is at most ACCELERATION_OF_TRAVEL of gravity's.  Within `limits` it takes the shortest time, and with a
    file for the distance it is the one recorded there (`modal.statespace.hoisting.Travel`).  Raises what `shaper_for`
    does, and SceneError for a distance that is not a positive number and a file that is no record of a travel.

    >>> from modal import load
    >>> from modal.statespace import shaper_for
    >>> crane = load("crane-hook")
    >>> travel = shaped_travel(crane, shaper_for(crane, 2), 20.0)
    >>> bool(travel.residual[0] > 0.1), bool(travel.residual[1] < 1e-9)
    (True, True)
    """
    if not isinstance(distance, str):
        checked_number("distance", distance, 1 / LARGEST_TRAVEL, LARGEST_TRAVEL)
    if duration is not None:
        checked_number("duration", duration, 1 / LARGEST_TRAVEL, LARGEST_TRAVEL)
    if problems := refusals(scene, "a shaper"):
        raise SceneError(problems)
    if drive.endswith("torque"):
        raise SceneError([f"drive {drive}: turns its support; a travel is along the rail"])
    hoisting = hoisting_of(scene)
    breaks = hoisting.breaks if hoisting else (0.0, 0.0)
    slowest = swings_of(scene.at(breaks[0]), drive)[0].omega
    length = duration or (breaks[-1] - breaks[0])
    if not (length or isinstance(distance, str)):
        brisk = np.sqrt(10 / np.sqrt(3) * distance / (ACCELERATION_OF_TRAVEL * scene.gravity))
        length = max(2 * np.pi / slowest, float(brisk))
    travel = Travel.planned(distance, breaks[0], length, limits)
    if not 1 / LARGEST_TRAVEL <= travel.duration <= LARGEST_TRAVEL:
        raise SceneError(
            [
                f"distance {distance}: takes {travel.duration:.4g} s: must be from {1 / LARGEST_TRAVEL:g} to "
                f"{LARGEST_TRAVEL:g} s"
            ]
        )
    ways = travel.shaped(UNSHAPED), travel.shaped(shaper.train)
    ends = np.array([way.knots[-1] for way in ways])
    over = np.maximum(ends, breaks[-1])
    times = np.linspace(travel.begin, over[1] + 5 * np.pi / slowest, SAMPLES_OF_HISTORY)
    is_prescribed = is_held(scene, drive)
    coordinate = 0 if is_prescribed else drives_of(scene).index(drive)
    parts = np.array([0.0, 0.0, 1.0]) if is_prescribed else _slow_push(scene, travel.begin, coordinate)
    commands, histories, residual = [], [], []
    for way, end in zip(ways, over.tolist(), strict=True):

        def command(at: Floats, way: LengthLaw = way) -> Floats:
            return np.asarray(parts @ np.array(way(at)))

        instants = np.union1d(times, [*way.breaks, *breaks, end])
        size = float(np.abs(command(instants)).max()) or 1.0
        states = motion_history(
            scene, command, instants, way.breaks, coordinate=None if is_prescribed else coordinate, size=size
        )
        commands.append(way(times)[0] if is_prescribed else command(times))
        histories.append(states[np.searchsorted(instants, times)])
        final_state = states[np.searchsorted(instants, end)]
        if not is_prescribed:
            final_state[: len(final_state) // 2] -= _leaning(scene, end, coordinate) * command(np.array([end]))
        residual.append(largest_swing(scene.at(end), final_state, is_prescribed=is_prescribed))
    lead = rig_of(scene).leading
    angles = np.array([states[:, lead : states.shape[1] // 2] for states in histories])
    displacement = np.array([states[:, coordinate] for states in histories])
    unit = "m" if is_prescribed else "N m" if coordinate in structure_of(scene).turning else "N"
    histories_and_ends = np.array(commands), displacement, angles, np.array(residual), over
    return ShapedTravel(scene, drive, travel.distance, times, *histories_and_ends, unit, ways, parts, coordinate)


def _sampled(way: LengthLaw, step: float, ramp: float = 5e-7) -> tuple[Floats, ...]:
    """Times (s), places (m), speeds and accelerations (T,) of a way, among them those of all kinks.

    δ is a `ramp` of the shortest time between two kinks.  With a `step` (s) times are multiples of it after the first,
    the accelerations means of both sides, and δ = `step`.
    """
    knots, pieces = way.knots, way.coefficients
    powers = np.arange(2, pieces.shape[1])
    ends = (pieces[:, 2:] * powers * (powers - 1) * np.diff(knots)[:, None] ** (powers - 2)).sum(1)
    jumps = np.append(2 * pieces[:, 2], 0.0) - np.append(0.0, ends)
    is_jump = np.abs(jumps) > NOISE_OF_SUM * np.abs(ends).max(initial=np.abs(pieces[:, 2]).max())
    shortest = max(ramp * float(np.diff(knots).min()), NOISE_OF_SUM * float(np.abs(knots).max()))
    delay = (step or shortest) * bool(is_jump.any())
    if step:
        count = round((knots[-1] - knots[0] + 2 * delay) / step)
        places, side = knots[0] - delay + step * np.arange(count + 1), EPS**0.5 * step
        bend = (way(places - side)[2] + way(places + side)[2]) / 2
        return np.round(places + delay, 12), *way(places)[:2], bend
    decimals = 2 - int(np.floor(np.log10(knots[-1] - knots[0])))
    even = np.round(10.0**-decimals * np.arange(*np.ceil(knots[[0, -1]] * 10.0**decimals)), decimals)
    times = np.union1d(np.concatenate((knots, knots[is_jump] + 2 * delay)), even)
    times = times[np.append(True, np.diff(times) > NOISE_OF_TERMS * np.abs(times).max())]
    return times, *way(times - delay)


def _leaning(scene: Scene, time: float, coordinate: int) -> Floats:
    """Where everything is at rest under a constant force of 1 on a coordinate, (n,)."""
    stiffness = matrices_along(scene)(time).K
    return np.asarray(np.linalg.pinv(stiffness, hermitian=True)[:, coordinate])


def _slow_push(scene: Scene, begin: float, coordinate: int) -> Floats:
    """(k, c, m) of the coordinate along the shape in which everything follows it slowly."""
    constant = matrices_along(scene)(begin)
    fastest = float(np.abs(scipy.linalg.eigvalsh(constant.K, constant.M)).max())
    shape = np.linalg.solve(
        constant.K + SQUARE_OF_SLOW_PUSH * fastest * constant.M, np.eye(len(constant.M))[coordinate]
    )
    shape /= shape[coordinate]
    slow = np.array([shape @ matrix @ shape for matrix in (constant.K, constant.D, constant.M)])
    return np.where(np.abs(slow) > SQUARE_OF_SLOW_PUSH * fastest * slow[2] * 10, slow, 0.0)
