"""Verification of the linear modes against the nonlinear motion.

In: a scene, amplitudes or any run.  Out: measured frequencies, compared with those of the table and those corrected for
amplitude,

    ω(a) = ω (1 + κ a²),

the modal content of a motion, and the swing that a travel leaves.  Start with `modes`.
"""

from nonlinear.verification.modes import (
    AMPLITUDES_DEG,
    ONE_PERCENT,
    Check,
    Comparison,
    ModeCheck,
    ModeInMotion,
    check,
    compare,
)
from nonlinear.verification.tables import check_table, comparison_table
from nonlinear.verification.travels import swing_after

__all__ = [
    "AMPLITUDES_DEG",
    "ONE_PERCENT",
    "Check",
    "Comparison",
    "ModeCheck",
    "ModeInMotion",
    "check",
    "check_table",
    "compare",
    "comparison_table",
    "swing_after",
]
__dir__ = __all__.copy
