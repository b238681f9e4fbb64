"""Figures of runs and studies, and animations.

In: trajectories, studies, sweeps.  Out: a `Figure`, an image, or a GIF, MP4 or HTML film.  Start with `run` for one run
and with `animation` for films.
"""
