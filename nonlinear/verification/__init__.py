"""The linear table of modes against the full motion.

In: a scene, amplitudes or any run.  Out: measured frequencies beside those of the table and those corrected for
amplitude,

    ω(a) = ω (1 + κ a²),

and how much of each mode a motion has.  Start with `modes`.
"""
