"""Figures of linear results.  matplotlib is imported here and in `nonlinear.plotting`, nowhere else.

In: the results of other rooms.  Out: a `Figure` from a `…_figure` function, or an image written to a stream.  Every
figure has a light and a dark version, axes with units, and colours that colour-blind readers can distinguish.  Start
with `style` and `layout`; each of the other modules makes one kind of figure.
"""

from modal.plotting.coupling import coupling_figure, draw_coupling
from modal.plotting.curves import draw_curves, envelope, is_blob, pick
from modal.plotting.films import MovingFigure, form_problems, frame_rate, require_writer, write_film
from modal.plotting.free_body import free_body_tikz, plot_free_body
from modal.plotting.hoisting import draw_hoist
from modal.plotting.identification import (
    assurance_figure,
    draw_assurance,
    draw_mode_fit,
    draw_poles,
    mode_fit_figure,
    poles_figure,
)
from modal.plotting.layout import (
    NUMBER,
    SMALL,
    caption,
    evenly,
    framed,
    headline,
    key,
    legend,
    log_ticks,
    mark_modes,
    side_by_side,
)
from modal.plotting.loci import draw_loci, scale
from modal.plotting.modal_films import LOOP, film_modes
from modal.plotting.response import bode_figure, draw_bode, draw_impulse
from modal.plotting.shapes import MOST_PANELS, USUAL_PANELS, draw_shapes, shapes_figure
from modal.plotting.sketches import sketch_figure
from modal.plotting.sliders import slide
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
    in_both_themes,
    ink,
    mixed,
    muted,
    narrowing,
    paper,
    predicted,
    rest,
    save,
    shade,
    sheet,
    spots,
    theme,
    thickness,
)
from modal.plotting.themes import ThemedPicture, pair_of, show_both_themes
from modal.plotting.travels import draw_travel, travel_figure
from modal.plotting.tuning import draw_tuning, tuning_figure

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
    "draw_assurance",
    "draw_bode",
    "draw_coupling",
    "draw_curves",
    "draw_hoist",
    "draw_impulse",
    "draw_loci",
    "draw_mode_fit",
    "draw_poles",
    "draw_shapes",
    "draw_travel",
    "draw_tuning",
    "envelope",
    "evenly",
    "film_modes",
    "form_problems",
    "frame_rate",
    "framed",
    "free_body_tikz",
    "headline",
    "in_both_themes",
    "ink",
    "is_blob",
    "key",
    "legend",
    "log_ticks",
    "mark_modes",
    "mixed",
    "mode_fit_figure",
    "muted",
    "narrowing",
    "pair_of",
    "paper",
    "pick",
    "plot_free_body",
    "poles_figure",
    "predicted",
    "require_writer",
    "rest",
    "save",
    "scale",
    "shade",
    "shapes_figure",
    "sheet",
    "show_both_themes",
    "side_by_side",
    "sketch_figure",
    "slide",
    "spots",
    "theme",
    "thickness",
    "travel_figure",
    "tuning_figure",
    "write_film",
]
