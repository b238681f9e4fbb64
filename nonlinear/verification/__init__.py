"""The linear table of modes against the full motion.

In: a scene, amplitudes or any run.  Out: measured frequencies beside those of the table and those corrected for
amplitude,

    ω(a) = ω (1 + κ a²),

and how much of each mode a motion has.  Start with `modes`.
"""

from nonlinear.verification.modes import AMPLITUDES_DEG, ONE_PERCENT, Check, ModeCheck, check
from nonlinear.verification.motion import Comparison, ModeInMotion, compare
from nonlinear.verification.tables import check_table, comparison_table

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
]
