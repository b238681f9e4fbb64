"""A travel of a crane in the full equations: residual swing at large angles, unshaped and shaped."""

from __future__ import annotations

import numpy as np

from modal.assembly import rig_of
from modal.scene import Moved, RecordMotion, Scene
from modal.scene.length_laws import LengthLaw
from modal.statespace.model import without_carrier
from modal.statespace.travels import ShapedTravel
from modal.types import Floats
from nonlinear.simulation import simulate
from nonlinear.system import AppliedForces, Load, State, state_at_rest


def swing_after(travel: ShapedTravel) -> Floats:
    """The largest angle (rad) of any link after a travel as it is, and after it shaped, (2,), in the full equations.

    From the time on at which command and hoist are over, for 2.5 periods of the slowest swing: half of what there is
    between the extremes of a link. Raise SceneError for what simulations do not take.

    >>> from modal import load
    >>> from modal.statespace import shaper_for
    >>> from modal.statespace.travels import shaped_travel
    >>> crane = load("crane-hook")
    >>> angles = swing_after(shaped_travel(crane, shaper_for(crane, 2), 20.0))
    >>> bool(angles[0] > 0.1), bool(angles[1] < 0.01)
    (True, True)
    """
    last = travel.times[-1] - travel.over[1]
    return np.array([_swing(travel, row, float(over), last) for row, over in enumerate(travel.over)])


def _swing(travel: ShapedTravel, row: int, over: float, last: float) -> float:
    scene, way, begin = travel.scene.in_plane.still.unforced, travel.ways[row], float(travel.times[0])
    load = None
    if travel.unit == "m":
        columns = travel.columns(row)
        times, bends = (columns[key].tolist() for key in ("time_s", "acceleration_m_per_s2"))
        motion = RecordMotion(time_s=times, acceleration_m_per_s2=bends, interpolation="linear")
        scene = without_carrier(scene).replace(support=Moved(motion=motion))
    else:
        load = _push(travel, scene, way)
    start = state_at_rest(scene, np.degrees(rig_of(scene.at(begin)).rest_angles).tolist())
    output = np.linspace(over, over + last, len(travel.times)) - begin
    duration = over + last - begin
    run = simulate(scene, duration, start=start, start_time=begin, load=load, breaks=way.breaks, output=output)
    return float(np.ptp(run.motion.links, axis=0).max() / 2)


def _push(travel: ShapedTravel, scene: Scene, way: LengthLaw) -> Load:
    axis = np.eye(rig_of(scene).leading)[travel.coordinate]

    def load(time: float, state: State) -> AppliedForces:
        force = float(travel.push @ np.array(way(time)))
        if not scene.is_structured:
            return AppliedForces(cart=force)
        return AppliedForces(supports=force * axis)

    return load
