"""Prescribed motions of a support.  Needs SciPy.

In: a support's motion.  Out: it as functions of time.
"""

from modal.vibration.prescribed import PrescribedMotion, prescribed_motion

__all__ = ["PrescribedMotion", "prescribed_motion"]
