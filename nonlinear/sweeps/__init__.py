"""A grid of scenes measured on all cores.

In: a `Study`: a scene, what varies in it, what is measured.  Out: a `Sweep`, kept row by row in a checkpoint, so that
an interrupted one goes on where it was.  Start with `measures` and `study`; `executors` do the work, `files` keep the
result.
"""
