"""Coupling of pendula through the cart or the structure from which they hang.

In: a `Scene`.  Out: its `Coupling`: families of modes, their splitting and beats, the limits of a light and a heavy
cart, which pendula exchange energy, and the effect of dampers and drives on each mode; as text, as numbers, as JSON.

    m_dyn(ω) = m + Σ_r μ_r ω_r²/(ω_r² − ω²)

is the dynamic mass for a force on the cart: its poles are the fixed-base modes, its zeros the modes that move the
cart.  Start with `analysis`.
"""

from modal.coupling.analysis import Coupling, StructureMode, explain
from modal.coupling.damping import damped_modes, negative_damping
from modal.coupling.families import Family, FamilyBranch, FamilyRow, family_name, passes_energy
from modal.coupling.report import coupling_report

__all__ = [
    "Coupling",
    "Family",
    "FamilyBranch",
    "FamilyRow",
    "StructureMode",
    "coupling_report",
    "damped_modes",
    "explain",
    "family_name",
    "negative_damping",
    "passes_energy",
]
__dir__ = __all__.copy
