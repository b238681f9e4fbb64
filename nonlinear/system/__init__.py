"""A scene as arrays with an entry for every copy of a pendulum, and its state.

In: a `Scene` and a start.  Out: a `System`, a `State` (positions and velocities), initial conditions and events.  Start
with `system`.
"""

from modal.assembly import Hoists
from nonlinear.system.events import (
    NO_FRICTION,
    NO_KICKS,
    CoordinateReading,
    Event,
    EventRecord,
    Friction,
    Kicks,
    level_crossing,
    turning_point,
)
from nonlinear.system.initial import has_start, initial_state, state_at_rest, validate_state
from nonlinear.system.numbers import (
    Numbers,
    constants_of,
    entries_of,
    law_places,
    numbers_of,
    numbers_of_all,
    prescribed_places,
    structure_places,
    system_with,
    system_with_constants,
)
from nonlinear.system.populations import (
    Population,
    burdens,
    populations_of,
    representation_obstacles,
    representatives,
    translations,
)
from nonlinear.system.prescribed import UP, ActingForce
from nonlinear.system.state import (
    AppliedForces,
    Equations,
    Layout,
    Load,
    Motion,
    State,
    apart,
    motion_of,
    of_plane,
    unwound,
)
from nonlinear.system.system import Group, JointTerm, System, drawn_place, ends_may_meet, place_of, slack_of, system_of

__all__ = [
    "NO_FRICTION",
    "NO_KICKS",
    "UP",
    "ActingForce",
    "AppliedForces",
    "CoordinateReading",
    "Equations",
    "Event",
    "EventRecord",
    "Friction",
    "Group",
    "Hoists",
    "JointTerm",
    "Kicks",
    "Layout",
    "Load",
    "Motion",
    "Numbers",
    "Population",
    "State",
    "System",
    "apart",
    "burdens",
    "constants_of",
    "drawn_place",
    "ends_may_meet",
    "entries_of",
    "has_start",
    "initial_state",
    "law_places",
    "level_crossing",
    "motion_of",
    "numbers_of",
    "numbers_of_all",
    "of_plane",
    "place_of",
    "populations_of",
    "prescribed_places",
    "representation_obstacles",
    "representatives",
    "slack_of",
    "state_at_rest",
    "structure_places",
    "system_of",
    "system_with",
    "system_with_constants",
    "translations",
    "turning_point",
    "unwound",
    "validate_state",
]
__dir__ = __all__.copy
