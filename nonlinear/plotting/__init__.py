"""Figures of runs and studies, and animations.

In: trajectories, studies, sweeps.  Out: a `Figure`, an image, or a GIF, MP4 or HTML film.  Start with `run` for one run
and with `animation` for films.
"""

from nonlinear.plotting.animation import SECONDS, animate, film_orbit, show_film, strobe
from nonlinear.plotting.branches import branches_figure, populations_figure
from nonlinear.plotting.chaos import exponent_figure, finding_figure
from nonlinear.plotting.ensembles import (
    basins_figure,
    bifurcation_figure,
    grid_figure,
    rhythm_figure,
    section_figure,
    spread_figure,
    strobes_figure,
)
from nonlinear.plotting.identification import fit_figure
from nonlinear.plotting.orbits import orbits_figure
from nonlinear.plotting.run import run_figure
from nonlinear.plotting.sweeps import sweep_figure, validate_axes
from nonlinear.plotting.synchronization import sync_figure
from nonlinear.plotting.verification import check_figure, frequencies_figure, spectrum_figure, tradeoff_figure

__all__ = [
    "SECONDS",
    "animate",
    "basins_figure",
    "bifurcation_figure",
    "branches_figure",
    "check_figure",
    "exponent_figure",
    "film_orbit",
    "finding_figure",
    "fit_figure",
    "frequencies_figure",
    "grid_figure",
    "orbits_figure",
    "populations_figure",
    "rhythm_figure",
    "run_figure",
    "section_figure",
    "show_film",
    "spectrum_figure",
    "spread_figure",
    "strobe",
    "strobes_figure",
    "sweep_figure",
    "sync_figure",
    "tradeoff_figure",
    "validate_axes",
]
__dir__ = __all__.copy
