"""From equations of motion to a trajectory.

In: a scene and what is asked of a run (`arguments`).  Out: a `Trajectory`: states at sampled times, events, and
certificates of energy, momentum and constraints.  `methods` chooses equations and integrator and says why, `driver`
takes the steps of `steppers`, `escapements` kick in between, `twins` tell how fast a small difference grows.  Start
with `run`.
"""
