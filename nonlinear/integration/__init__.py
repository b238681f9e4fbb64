"""From equations of motion to a trajectory.

In: a scene and the arguments of a run (`arguments`).  Out: a `Trajectory`: states at sampled times, events, and
the drifts of energy, momentum and constraints.  `methods` chooses equations and integrator, with a reason; `driver`
advances the steppers of `steppers`, of `floats` for generated equations, of `compiled` (extra `fast`) or of `taylor`;
steps end at `switches`, and what happens within them is seen by `watches` and, of one run, by `driver`; twins in `run`
measure how fast a small difference grows; `tubes` contain a motion provably (extra `certified`).  Start with `run`.
"""

from nonlinear.integration.arguments import (
    COARSEST,
    LOOSEST,
    TIGHTEST,
    estimate_timescales,
    extent,
    modes_of,
    pace_of,
    sample_count,
    sample_times,
    validate,
    validate_accuracy,
    validate_events,
    validate_forces,
    validate_load,
    validate_numbers,
    validate_observable,
    validate_whole,
)
from nonlinear.integration.changes import names_in, switching_source
from nonlinear.integration.meeting import MEETING, meeting_source
from nonlinear.integration.methods import ASKED, FORMS, Choice, choose, equations_of, validate_method
from nonlinear.integration.run import Request, SimulationError, aside, departure, perturb_last_digits, prepare, slightly
from nonlinear.integration.steppers import EXPLICIT, SCIPY, SMALLEST
from nonlinear.integration.switches import switches_of
from nonlinear.integration.trajectory import CLOSED, TRUNCATED, SolverInfo, Trajectory
from nonlinear.integration.tubes import PROVED, Tube, enclose_motion

__all__ = [
    "ASKED",
    "CLOSED",
    "COARSEST",
    "EXPLICIT",
    "FORMS",
    "LOOSEST",
    "MEETING",
    "PROVED",
    "SCIPY",
    "SMALLEST",
    "TIGHTEST",
    "TRUNCATED",
    "Choice",
    "Request",
    "SimulationError",
    "SolverInfo",
    "Trajectory",
    "Tube",
    "aside",
    "choose",
    "departure",
    "enclose_motion",
    "equations_of",
    "estimate_timescales",
    "extent",
    "meeting_source",
    "modes_of",
    "names_in",
    "pace_of",
    "perturb_last_digits",
    "prepare",
    "sample_count",
    "sample_times",
    "slightly",
    "switches_of",
    "switching_source",
    "validate",
    "validate_accuracy",
    "validate_events",
    "validate_forces",
    "validate_load",
    "validate_method",
    "validate_numbers",
    "validate_observable",
    "validate_whole",
]
__dir__ = __all__.copy
