"""Figures of linear results.  matplotlib is imported here and in `nonlinear.plotting`, nowhere else.

In: the results of other subpackages. Out: a `Figure` from a `…_figure` function, or an image written to a stream. Every
figure has a light and a dark version, axes with units, and colours that colour-blind readers can distinguish. Start
with `style` and `layout`; each of the other modules makes one kind of figure.

Sizes and colours come from `light.mplstyle` and `dark.mplstyle` alone.  Curves of one panel go through `draw_curves`,
legends through `legend` and `key`, so that every curve is seen and no legend leaves its place.  A line style has one
meaning (solid: computed or measured; dashed: a simpler theory's; dotted: a mark; dash-dotted: unstable), and numbers of
a scene are called by `number_label`.
"""

from modal.plotting.coupling import coupling_figure
from modal.plotting.curves import draw_curves, envelope, is_blob, pick
from modal.plotting.films import LOOP, MovingFigure, film_modes, form_problems, frame_rate, require_writer, write_film
from modal.plotting.free_body import free_body_tikz, plot_free_body
from modal.plotting.identification import (
    assurance_figure,
    mode_fit_figure,
    poles_figure,
)
from modal.plotting.layout import (
    NUMBER,
    SMALL,
    caption,
    even_choice,
    headline,
    key,
    legend,
    log_ticks,
    mark_modes,
    set_frame,
)
from modal.plotting.loci import loci_figure, scale
from modal.plotting.response import bode_figure, impulse_figure, tuning_figure
from modal.plotting.shapes import MOST_PANELS, USUAL_PANELS, shapes_figure
from modal.plotting.sketches import sketch_figure
from modal.plotting.style import (
    COMPUTED,
    HUES,
    MARKED,
    MOST_CURVES,
    PREDICTED,
    QUIET,
    UNSTABLE,
    WIDE,
    WIDTH,
    Picture,
    any_letters,
    colour,
    dashes_of_prediction,
    in_both_themes,
    ink,
    mixture,
    narrowing,
    paper,
    rest,
    save,
    secondary_colour,
    shade,
    sheet,
    spots,
    theme,
    thickness,
)
from modal.plotting.themes import ThemedPicture, pair_of, show_both_themes, slide
from modal.plotting.travels import hoist_figure, travel_figure

__all__ = [
    "COMPUTED",
    "HUES",
    "LOOP",
    "MARKED",
    "MOST_CURVES",
    "MOST_PANELS",
    "NUMBER",
    "PREDICTED",
    "QUIET",
    "SMALL",
    "UNSTABLE",
    "USUAL_PANELS",
    "WIDE",
    "WIDTH",
    "MovingFigure",
    "Picture",
    "ThemedPicture",
    "any_letters",
    "assurance_figure",
    "bode_figure",
    "caption",
    "colour",
    "coupling_figure",
    "dashes_of_prediction",
    "draw_curves",
    "envelope",
    "even_choice",
    "film_modes",
    "form_problems",
    "frame_rate",
    "free_body_tikz",
    "headline",
    "hoist_figure",
    "impulse_figure",
    "in_both_themes",
    "ink",
    "is_blob",
    "key",
    "legend",
    "loci_figure",
    "log_ticks",
    "mark_modes",
    "mixture",
    "mode_fit_figure",
    "narrowing",
    "pair_of",
    "paper",
    "pick",
    "plot_free_body",
    "poles_figure",
    "require_writer",
    "rest",
    "save",
    "scale",
    "secondary_colour",
    "set_frame",
    "shade",
    "shapes_figure",
    "sheet",
    "show_both_themes",
    "sketch_figure",
    "slide",
    "spots",
    "theme",
    "thickness",
    "travel_figure",
    "tuning_figure",
    "write_film",
]
__dir__ = __all__.copy
