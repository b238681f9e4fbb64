"""Periodic orbits of the full equations: nonlinear normal modes and limit cycles, their stability, by continuation.

In: a scene and one of its modes, or a number of it.  Out: a `Branch` of orbits with frequencies, amplitudes, energies
and Floquet multipliers, and the special points between them.

    φ_T(y) = y,     multipliers: the eigenvalues of ∂φ_T/∂y

Start with `modes` for conservative scenes, with `cycles` for self-excited ones and with `forced` under drives of a
period.  `symmetric` and `shooting` have the equations of orbits, `flow` integrates them with their variational
equations, `continuation` follows their solutions, `floquet` the stability, `special` where it changes; `cycles` also
follows what leaves there.  `populations` has the orbits on which every population of equal pendula moves as one.
"""

from nonlinear.orbits.branch import Branch
from nonlinear.orbits.cycles import (
    LEAVES,
    cycle_of,
    first_special_point,
    follow_cycles,
    growth,
    last_swing,
    leaving_branch,
    limit_cycles,
    periodic_orbit,
    require_cycles,
)
from nonlinear.orbits.floquet import Floquet
from nonlinear.orbits.flow import Flow
from nonlinear.orbits.forced import (
    FiniteSwing,
    LinearResponse,
    finite_swing,
    follow_forced_orbits,
    forced_orbit,
    linear_response,
    require_forced_orbits,
)
from nonlinear.orbits.modes import at_amplitude, mode_along, mode_orbit, nonlinear_mode, orbit_where_off, oscillating
from nonlinear.orbits.orbit import Orbit
from nonlinear.orbits.populations import PatternOrbit, free_amplitude, pattern_orbit
from nonlinear.orbits.report import orbits_csv, orbits_record, orbits_text
from nonlinear.orbits.special import Special

__all__ = [
    "LEAVES",
    "Branch",
    "FiniteSwing",
    "Floquet",
    "Flow",
    "LinearResponse",
    "Orbit",
    "PatternOrbit",
    "Special",
    "at_amplitude",
    "cycle_of",
    "finite_swing",
    "first_special_point",
    "follow_cycles",
    "follow_forced_orbits",
    "forced_orbit",
    "free_amplitude",
    "growth",
    "last_swing",
    "leaving_branch",
    "limit_cycles",
    "linear_response",
    "mode_along",
    "mode_orbit",
    "nonlinear_mode",
    "orbit_where_off",
    "orbits_csv",
    "orbits_record",
    "orbits_text",
    "oscillating",
    "pattern_orbit",
    "periodic_orbit",
    "require_cycles",
    "require_forced_orbits",
]
__dir__ = __all__.copy
