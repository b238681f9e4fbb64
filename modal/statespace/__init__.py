"""State-space models of a scene, and what control engineers do with them.

In: a `Scene`, and which inputs and outputs are meant.  Out: a `StateSpace` with named signals, its modal form, gains,
frequency and impulse responses, smaller models, sampled models, input shapers.

    z' = A z + B u,    y = C z + D u,    z = (q, q')

Start with `model` and `signals`.  `sampling` needs SciPy and is imported by its own path.
"""
