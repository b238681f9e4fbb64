"""A backend of matplotlib that draws a figure of the light style in the dark one: same lines, other colours.

Every colour passes here when it is drawn, so nothing of the figure is changed or copied.  A colour of the light style
becomes its twin in the dark style; a grey, such as a mixture of ink and paper, keeps its place between the two; any
other colour and every image stay as they are.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
from matplotlib import rcParams
from matplotlib.backend_bases import GraphicsContextBase
from matplotlib.backends.backend_agg import FigureCanvasAgg, RendererAgg
from matplotlib.colors import to_hex, to_rgb, to_rgba

from modal.plotting.style import theme
from modal.types import Floats

GREY = 0.12
"""Largest difference of red, green and blue in what counts as grey."""
LUMA = np.array([0.299, 0.587, 0.114])


def dark_twin(colour: Any) -> tuple[float, float, float, float]:
    """The colour (r, g, b, alpha) that stands in a dark figure where `colour` stands in a light one.

    >>> from matplotlib.colors import to_hex
    >>> to_hex(dark_twin("#005f9e")), to_hex(dark_twin("white")), to_hex(dark_twin("red"))
    ('#2f8fd6', '#12181d', '#ff0000')
    """
    red, green, blue, alpha = to_rgba(colour)
    named = _twins().get(to_hex((red, green, blue)))
    if named is not None:
        return (*named, alpha)
    if np.ptp((red, green, blue)) > GREY:
        return red, green, blue, alpha
    (light_paper, light_ink), (dark_paper, dark_ink) = map(_ends, ("light", "dark"))
    inked = (LUMA @ light_paper - LUMA @ (red, green, blue)) / (LUMA @ light_paper - LUMA @ light_ink)
    red, green, blue = (dark_paper + np.clip(inked, 0, 1) * (dark_ink - dark_paper)).tolist()
    return red, green, blue, alpha


@cache
def _settings(name: str) -> dict[str, Any]:
    with theme(name):
        return dict(rcParams.items())


@cache
def _twins() -> dict[str, tuple[float, float, float]]:
    """What each colour of the light style is in the dark one."""
    light, dark = map(_settings, ("light", "dark"))
    pairs = list(zip(*(twin["axes.prop_cycle"].by_key()["color"] for twin in (light, dark)), strict=True))
    names = ("figure.facecolor", "text.color", "axes.edgecolor", "grid.color", "hatch.color")
    pairs += [(light[name], dark[name]) for name in names]
    return {to_hex(twin): to_rgb(other) for twin, other in pairs}


@cache
def _ends(name: str) -> tuple[Floats, Floats]:
    """Paper and ink of a style."""
    settings = _settings(name)
    return np.array(to_rgb(settings["figure.facecolor"])), np.array(to_rgb(settings["text.color"]))


class DarkContext(GraphicsContextBase):
    """The pen, in the twin of each colour."""

    _rgb: Any

    def set_foreground(self, fg: Any, isRGBA: bool = False) -> None:
        """Choose the colour of lines and letters; `set_alpha` chooses the one that the pen already has."""
        super().set_foreground(fg if fg is self._rgb else dark_twin(fg), isRGBA=True)

    def set_hatch_color(self, hatch_color: Any) -> None:
        """Choose the colour of hatching."""
        super().set_hatch_color(dark_twin(hatch_color))


class DarkRenderer(RendererAgg):
    """Agg, with the twins of the colours of areas."""

    def new_gc(self) -> DarkContext:
        """A pen."""
        return DarkContext()

    def _update_methods(self) -> None:
        """Agg puts compiled functions in place of its methods; two of them get colours of areas."""
        super()._update_methods()  # type: ignore[no-untyped-call]
        markers: Any = self.draw_markers
        collection: Any = self.draw_path_collection

        def draw_markers(gc: Any, path: Any, place: Any, line: Any, at: Any, rgbFace: Any = None) -> None:
            markers(gc, path, place, line, at, _twin(rgbFace))

        def draw_path_collection(gc: Any, *given: Any, **options: Any) -> None:
            five, (faces, edges), rest = given[:5], given[5:7], given[7:]
            twins = {name: _twins_of(colours) for name, colours in options.items()}  # hatching, since matplotlib 3.11
            collection(gc, *five, _twins_of(faces), _twins_of(edges), *rest, **twins)

        vars(self).update(draw_markers=draw_markers, draw_path_collection=draw_path_collection)

    def draw_path(self, gc: Any, path: Any, transform: Any, rgbFace: Any = None) -> None:
        """Draw a line or an area."""
        super().draw_path(gc, path, transform, _twin(rgbFace))  # type: ignore[no-untyped-call]


def _twin(face: Any) -> Any:
    return None if face is None else dark_twin(face)[: len(face)]


def _twins_of(colours: Any) -> Floats | None:
    return None if colours is None else np.array([dark_twin(single) for single in colours]).reshape(-1, 4)


class FigureCanvas(FigureCanvasAgg):
    """What `savefig(backend=...)` takes from this module."""

    def get_renderer(self) -> DarkRenderer:
        """A renderer of the figure's size."""
        width, height = self.get_width_height(physical=True)
        return DarkRenderer(width, height, self.figure.dpi)  # type: ignore[no-untyped-call]
