"""Periodic orbits of the full equations: nonlinear normal modes, their stability, and their continuation.

In: a scene and one of its modes.  Out: a `Branch` of orbits with frequencies, amplitudes, energies and Floquet
multipliers, and the special points between them.

    φ_T(y) = y,     multipliers: the eigenvalues of ∂φ_T/∂y

Start with `modes`; `symmetric` has the equations of symmetric orbits, `flow` integrates them with their variational
equations (`compiled` by numba), `continuation` follows their solutions, `floquet` tells stability and `special` where
it changes.
"""

from nonlinear.orbits.floquet import Floquet
from nonlinear.orbits.flow import Flow
from nonlinear.orbits.modes import Branch, nonlinear_mode
from nonlinear.orbits.orbit import Orbit
from nonlinear.orbits.special import Special

__all__ = ["Branch", "Floquet", "Flow", "Orbit", "Special", "nonlinear_mode"]
