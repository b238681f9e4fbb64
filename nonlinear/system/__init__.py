"""A scene as arrays in which every copy of a pendulum stands for itself, and its state.

In: a `Scene` and a start.  Out: a `Plant`, a `State` (where everything is and how fast it moves), initial conditions
and events.  Start with `system`.
"""
