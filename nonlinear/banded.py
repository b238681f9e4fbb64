"""Long chains in the plane: joint forces and accelerations as one banded system, solved by LAPACK.

With a the acceleration of a link's upper joint (less gravity) and f the force that the joint above gives it,

    f − f' = m a + m c n θ'' − m c ω² u        a' = a + l n θ'' − l ω² u        J θ'' = Q − m c n·a − l n·f'

θ'' is put in (J = I + m c² > 0), which leaves four unknowns a link, f and a', within five places of each other.
"""

from __future__ import annotations

REACH = 5
