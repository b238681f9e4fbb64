"""A travel of a crane in the linear model, as it is and with an input shaper: the command and the swing over time.

A prescribed motion of the cart is x = d (10 s³ − 15 s⁴ + 6 s⁵), s from 0 to 1.  A force, on a cart or on a coordinate j
of a structure, is what moves the coordinate so far along the shape φ in which the scene follows it slowly, φ_j = 1:

    F = m x'' + c x' + k x,     m = φᵀMφ,  c = φᵀDφ,  k = φᵀKφ,

so that the force on a free cart is that on all masses, and on a ship at its moorings ends in their pull at d.  A shaped
command is Σ A_i u(t − t_i).  Between its corners a command is a quintic polynomial (`modal.statespace.hoisting`).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import scipy

from modal.assembly import hoisting_of, matrices_along, rig_of
from modal.errors import SceneError
from modal.report import Displayed, Drawable, Summary, tabulated
from modal.scene import Scene, refusals
from modal.scene.doors import checked, checked_number
from modal.statespace.hoisting import SAMPLES_OF_HISTORY, Travel, is_held, largest_swing, motion_history
from modal.statespace.shapers import UNSHAPED, Drive, Shaper, Train, drives_of, swings_of
from modal.structure import structure_of
from modal.types import Floats

ACCELERATION_OF_TRAVEL = 0.1
"""Limit: acceleration of a travel whose `duration` is not given, over that of gravity."""
SQUARE_OF_SLOW_PUSH = 1e-10
"""Tolerance: ω² of a slow push over that of the fastest mode: what follows it, follows to ten digits."""
LARGEST_TRAVEL = 1e6
"""Limit: metres of a travel and seconds of its duration, refused beyond, as is less than one over it."""


@dataclass(frozen=True, eq=False, repr=False)
class ShapedTravel(Drawable, Displayed):
    """A travel of `distance` (m) under a `drive`, as it is (row 0) and shaped (row 1), at `times` (T,) in s.

    `command` (2, T) is the place of a cart whose motion is prescribed (m) or a force in `unit`; `moved` (2, T) the
    coordinate that it moves, in m or rad; `angles` (2, T, L) those of the links (rad); `residual` (2,) the largest
    angle (rad) to which the swings of all frequencies add up when command and hoist are over, from `over` (2,) in s on.
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
    figure = "modal.plotting.travels:travel_figure"

    def words(self) -> Iterator[str]:
        """What the travel leaves as it is and shaped, a line each."""
        for name, angle in zip(("as it is", "shaped"), np.degrees(self.residual).tolist(), strict=True):
            yield f"a travel of {self.distance:g} m {name}: residual swing {angle:.4g}°"

    def _summary(self) -> Summary:
        largest = np.degrees(np.abs(self.angles).max((1, 2)))
        columns = {
            "command": ["as it is", "shaped"],
            "over at (s)": [f"{time:.4g}" for time in self.over],
            "largest angle (°)": [f"{angle:.4g}" for angle in largest],
            "residual swing (°)": [f"{angle:.4g}" for angle in np.degrees(self.residual)],
        }
        return tabulated(f"Travel of {self.distance:g} m", [], columns)


@checked
def shaped_travel(
    scene: Scene,
    shaper: Shaper,
    distance: float,
    duration: float | None = None,
    drive: Drive = "cart_acceleration",
) -> ShapedTravel:
    """The travel by `distance` (m) over `duration` (s), as it is and shaped, from the begin of the hoist or 0 s on.

    By default it lasts as long as the hoist; without one a period of the slowest swing, or so long that its
    acceleration is at most ACCELERATION_OF_TRAVEL of gravity's.  Raises what `shaper_for` does, and SceneError for a
    distance that is not a positive number.

    >>> from modal import load
    >>> from modal.statespace import shaper_for
    >>> crane = load("crane-hook")
    >>> travel = shaped_travel(crane, shaper_for(crane, 2), 20.0)
    >>> bool(travel.residual[0] > 0.1), bool(travel.residual[1] < 1e-9)
    (True, True)
    """
    checked_number("distance", distance, 1 / LARGEST_TRAVEL, LARGEST_TRAVEL)
    if duration is not None:
        checked_number("duration", duration, 1 / LARGEST_TRAVEL, LARGEST_TRAVEL)
    if problems := refusals(scene, "a shaper"):
        raise SceneError(problems)
    hoisting = hoisting_of(scene)
    breaks = hoisting.breaks if hoisting else (0.0, 0.0)
    slowest = swings_of(scene.at(breaks[0]), drive)[0].omega
    brisk = np.sqrt(10 / np.sqrt(3) * distance / (ACCELERATION_OF_TRAVEL * scene.gravity))
    length = float(duration or (breaks[-1] - breaks[0]) or max(2 * np.pi / slowest, brisk))
    travel = Travel(distance, breaks[0], length)
    ends = travel.begin + length + np.array([0.0, shaper.duration])
    over = np.maximum(ends, breaks[-1])
    times = np.linspace(travel.begin, over[1] + 5 * np.pi / slowest, SAMPLES_OF_HISTORY)
    is_prescribed = is_held(scene, drive)
    coordinate = 0 if is_prescribed else drives_of(scene).index(drive)
    parts = np.array([0.0, 0.0, 1.0]) if is_prescribed else _slow_push(scene, travel.begin, coordinate)
    commands, histories, residual = [], [], []
    for train, end in zip((UNSHAPED, shaper.train), over.tolist(), strict=True):

        def command(at: Floats, train: Train = train) -> Floats:
            return np.asarray(parts @ travel.shaped(train, at))

        instants = np.union1d(times, [*travel.stops(train), *breaks, end])
        size = float(np.abs(command(instants)).max()) or 1.0
        states = motion_history(
            scene, command, instants, travel.stops(train), coordinate=None if is_prescribed else coordinate, size=size
        )
        commands.append(travel.shaped(train, times)[0] if is_prescribed else command(times))
        histories.append(states[np.searchsorted(instants, times)])
        final_state = states[np.searchsorted(instants, end)]
        if not is_prescribed:
            final_state[: len(final_state) // 2] -= _leaning(scene, end, coordinate) * command(np.array([end]))
        residual.append(largest_swing(scene.at(end), final_state, is_prescribed=is_prescribed))
    lead = rig_of(scene).leading
    angles = np.array([states[:, lead : states.shape[1] // 2] for states in histories])
    displacement = np.array([states[:, coordinate] for states in histories])
    unit = "m" if is_prescribed else "N m" if coordinate in structure_of(scene).turning else "N"
    return ShapedTravel(
        scene, drive, distance, times, np.array(commands), displacement, angles, np.array(residual), over, unit
    )


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
