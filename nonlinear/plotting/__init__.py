"""Figures of runs and studies, and animations.

In: trajectories, studies, sweeps.  Out: a `Figure`, an image, or a GIF, MP4 or HTML film.  Start with `run` for one run
and with `animation` for films.
"""

from nonlinear.plotting.animation import SECONDS, animate, strobe
from nonlinear.plotting.branches import branches_figure, draw_branches
from nonlinear.plotting.chaos import draw_finding, draw_running
from nonlinear.plotting.ensembles import (
    basins_figure,
    draw_basins,
    draw_section,
    draw_spread,
    section_figure,
    spread_figure,
)
from nonlinear.plotting.identification import draw_fit, fit_figure
from nonlinear.plotting.notebooks import show_film
from nonlinear.plotting.orbit_films import film_orbit
from nonlinear.plotting.orbits import draw_orbits, orbits_figure
from nonlinear.plotting.populations import draw_populations, populations_figure
from nonlinear.plotting.rhythms import draw_rhythms, grid_figure, rhythm_figure
from nonlinear.plotting.run import draw_run
from nonlinear.plotting.strobes import bifurcation_figure, draw_bifurcations, draw_strobes, strobes_figure
from nonlinear.plotting.sweeps import draw_sweep, validate_axes
from nonlinear.plotting.synchronization import draw_sync, sync_figure
from nonlinear.plotting.verification import check_figure, draw_check, draw_spectrum
from nonlinear.plotting.work_precision import draw_frequencies, draw_tradeoff, frequencies_figure, tradeoff_figure

__all__ = [
    "SECONDS",
    "animate",
    "basins_figure",
    "bifurcation_figure",
    "branches_figure",
    "check_figure",
    "draw_basins",
    "draw_bifurcations",
    "draw_branches",
    "draw_check",
    "draw_finding",
    "draw_fit",
    "draw_frequencies",
    "draw_orbits",
    "draw_populations",
    "draw_rhythms",
    "draw_run",
    "draw_running",
    "draw_section",
    "draw_spectrum",
    "draw_spread",
    "draw_strobes",
    "draw_sweep",
    "draw_sync",
    "draw_tradeoff",
    "film_orbit",
    "fit_figure",
    "frequencies_figure",
    "grid_figure",
    "orbits_figure",
    "populations_figure",
    "rhythm_figure",
    "section_figure",
    "show_film",
    "spread_figure",
    "strobe",
    "strobes_figure",
    "sync_figure",
    "tradeoff_figure",
    "validate_axes",
]
__dir__ = __all__.copy
