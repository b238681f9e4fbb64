"""Figures of linear results.  matplotlib is imported here and in `nonlinear.plotting`, nowhere else.

In: the results of other subpackages. Out: a `Figure` from a `…_figure` function, or an image written to a stream. Every
figure has a light and a dark version, axes with units, and colours that colour-blind readers can distinguish. Only the
figures are exported; `style`, `layout` and `curves` draw them, from which the other modules, each of one kind of
figure, and `nonlinear.plotting` import.

Sizes and colours come from `light.mplstyle` and `dark.mplstyle` alone.  Curves of one panel go through `draw_curves`,
legends through `legend` and `key`, so that every curve is seen and no legend leaves its place.  A line style has one
meaning (solid: computed or measured; dashed: a simpler theory's; dotted: a mark; dash-dotted: unstable), and numbers of
a scene are called by `number_label`.
"""

from modal.plotting.coupling import coupling_figure
from modal.plotting.films import LOOP, film_modes
from modal.plotting.free_body import free_body_tikz, plot_free_body
from modal.plotting.identification import assurance_figure, mode_fit_figure, poles_figure
from modal.plotting.loci import loci_figure
from modal.plotting.response import bode_figure, hoist_figure, impulse_figure, travel_figure, tuning_figure
from modal.plotting.shapes import USUAL_PANELS, shapes_figure
from modal.plotting.sketches import sketch_figure
from modal.plotting.style import Picture, in_both_themes, save, sheet, theme
from modal.plotting.themes import ThemedPicture, pair_of, show_both_themes, slide

__all__ = [
    "LOOP",
    "USUAL_PANELS",
    "Picture",
    "ThemedPicture",
    "assurance_figure",
    "bode_figure",
    "coupling_figure",
    "film_modes",
    "free_body_tikz",
    "hoist_figure",
    "impulse_figure",
    "in_both_themes",
    "loci_figure",
    "mode_fit_figure",
    "pair_of",
    "plot_free_body",
    "poles_figure",
    "save",
    "shapes_figure",
    "sheet",
    "show_both_themes",
    "sketch_figure",
    "slide",
    "theme",
    "travel_figure",
    "tuning_figure",
]
__dir__ = __all__.copy
