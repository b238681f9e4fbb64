"""Events during a motion: a quantity crosses a level, a link turns back, an escapement kicks, friction sticks."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from modal.errors import SceneError
from modal.report import summary_of
from modal.scene.doors import checked_number, require_type
from modal.types import Floats, Ints
from nonlinear.system.state import State
from nonlinear.system.system import System


@dataclass(frozen=True)
class CoordinateReading:
    """The value of an event: a coordinate less a `level`, which runs read in y itself, or its `rate`.

    It is at `index` in a `part` of states, and `row` is its number among all coordinates.
    """

    part: str
    index: int | tuple[()]
    row: int
    rate: bool
    level: float = 0.0

    def __call__(self, state: State) -> float:
        """Its value in a state."""
        return float(np.asarray(getattr(state, self.part))[self.index]) - self.level


@dataclass(frozen=True)
class Event:
    """A zero crossing of `value` of the state: upwards (`direction` 1), downwards (−1) or either way (0).

    `stop` ends the run there.  Every step is searched for sign changes at `looks` points: a value that varies faster
    than the motion needs more of them.

    >>> from modal import load
    >>> from nonlinear import Event, simulate
    >>> passing = Event("vertical", lambda state: state.links[0], direction=-1, stop=True)
    >>> run = simulate(load("chain-1"), 5.0, events=[passing])
    >>> [happening.name for happening in run.happenings]
    ['vertical']
    """

    name: str
    value: Callable[[State], float]
    direction: int = 0
    stop: bool = False
    looks: int = 4

    def __post_init__(self) -> None:
        if self.looks < 1:
            raise SceneError([f"event {self.name}: looks = {self.looks}: must be at least 1"])


class EventRecord(NamedTuple):
    """An event that occurred, with its time (s) and the state at that time.

    >>> from modal import load
    >>> from nonlinear import level_crossing, simulate, system_of
    >>> scene = load("chain-1")
    >>> crossing = level_crossing(system_of(scene), system_of(scene).labels[0], stop=True)
    >>> run = simulate(scene, 5.0, events=[crossing])
    >>> bool(run.happenings[0].time == run.times[-1])
    True
    """

    name: str
    time: float
    state: State

    def __repr__(self) -> str:
        return summary_of(self).text()


class Kicks(NamedTuple):
    """K kicks of escapements in order: `time` (s), `link` below the joint (from 0), `energy` (J) supplied.

    `impulse` (N m s) is positive where the joint was swinging to the right.
    """

    time: Floats
    link: Ints
    impulse: Floats
    energy: Floats

    def __repr__(self) -> str:
        return summary_of(self).text() if len(self.time) else "no kicks"


class Friction(NamedTuple):
    """Record of dry friction in a run: K phases of sticking in order of their beginning, and the work.

    `link` (K,) is the one below the joint (from 0), −1 for the rail; `begin` and `end` (K,) are times (s), a phase that
    lasts ending with the run. `work` (J,) is the work (J) at each of the J contacts, those of links `places` (J,).
    `rest` (s) is when everything had come to rest for good, NaN if it has not.
    """

    link: Ints
    begin: Floats
    end: Floats
    places: Ints
    work: Floats
    rest: float

    def __repr__(self) -> str:
        return summary_of(self).text() if len(self.places) else "no friction"


NO_FRICTION = Friction(
    np.zeros(0, dtype=np.int64), np.zeros(0), np.zeros(0), np.zeros(0, dtype=np.int64), np.zeros(0), float("nan")
)
NO_KICKS = Kicks(np.zeros(0), np.zeros(0, dtype=np.int64), np.zeros(0), np.zeros(0))


def level_crossing(
    system: System, coordinate: str, level: float = 0.0, direction: int = 0, *, stop: bool = False
) -> Event:
    """The event that a coordinate passes a level.

    Parameters
    ----------
    system
        That of the scene, by `system_of`.
    coordinate
        An angle, "theta[1,2]", the cart's "x", or a coordinate of a structure: the names of
        `modal.assembly.coordinate_labels`.
    level
        The value that is passed (rad, m).
    direction
        1 for upwards, −1 for downwards, 0 for either way.
    stop
        Whether the run ends there.

    Returns
    -------
    Event
        One for the `events` of `simulate`, named after coordinate and level.

    Examples
    --------
    >>> from modal import load
    >>> from nonlinear import level_crossing, system_of
    >>> level_crossing(system_of(load("chain-1")), "theta[1,1]", 0.1, direction=1).name
    'theta[1,1] = 0.1'
    """
    require_type("system", system, "System")
    checked_number("level", level)
    return Event(f"{coordinate} = {level:g}", reading_of(system, coordinate, level), direction, stop)


def turning_point(system: System, coordinate: str, *, stop: bool = False) -> Event:
    """The event that an angle, the cart or a coordinate of a structure reverses its direction.

    Parameters
    ----------
    system
        That of the scene, by `system_of`.
    coordinate
        Its name, as for `level_crossing`.
    stop
        Whether the run ends there.

    Returns
    -------
    Event
        One for the `events` of `simulate`.

    Examples
    --------
    >>> from modal import load
    >>> from nonlinear import simulate, system_of, turning_point
    >>> scene = load("chain-1")
    >>> run = simulate(scene, 5.0, events=[turning_point(system_of(scene), "theta[1,1]")])
    >>> len(run.happenings)
    4
    """
    require_type("system", system, "System")
    return Event(f"{coordinate} turns", reading_of(system, coordinate, rate=True), 0, stop)


def reading_of(system: System, coordinate: str, level: float = 0.0, *, rate: bool = False) -> CoordinateReading:
    """A coordinate of a system by its name, or its rate, less a level; raise SceneError if there is none."""
    if coordinate not in system.labels:
        raise SceneError([f"event {coordinate}: must be one of {', '.join(system.labels[:12])}"])
    if system.spatial and coordinate != "x":
        raise SceneError(
            [f"event {coordinate}: links have no single angle in space; define an Event with its own function"]
        )
    place = system.labels.index(coordinate)
    if place >= system.first:
        return CoordinateReading("link_rates" if rate else "links", place - system.first, place, rate, level)
    if system.structure is not None:
        return CoordinateReading("support_rates" if rate else "supports", place, place, rate, level)
    return CoordinateReading("cart_rate" if rate else "cart", (), place, rate, level)
