"""Figures of a lesson in two themes: a page or a notebook shows the light or the dark one, as its reader reads.

`show_both_themes()` at the head of a notebook is all that is needed: from then on every figure is shown so.  `slide`
puts figures for several values behind a slider, which pages and notebooks show without a running program.

This module is a backend of matplotlib that draws a figure of the light style in the dark one: same lines, other
colours.  Every colour passes here when it is drawn, so nothing of the figure is changed or copied.  A colour of the
light style becomes its twin in the dark style; a grey, such as a mixture of ink and paper, keeps its place between the
two; any other colour and every image stay as they are.
"""

from __future__ import annotations

import sys
from base64 import b64encode
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from io import BytesIO
from typing import Any

import numpy as np
from matplotlib import rcParams, style
from matplotlib.backend_bases import GraphicsContextBase
from matplotlib.backends.backend_agg import FigureCanvasAgg, RendererAgg
from matplotlib.colors import to_hex, to_rgb, to_rgba
from matplotlib.figure import Figure
from PIL import Image

from modal.plotting.style import any_letters, theme
from modal.report import html
from modal.types import Floats

GREY = 0.12
"""Format: largest difference of red, green and blue in what counts as grey; every hue of the styles has more."""
LUMA = np.array([0.299, 0.587, 0.114])


def dark_twin(colour: Any) -> tuple[float, float, float, float]:
    """The colour (r, g, b, alpha) that stands in a dark figure where `colour` stands in a light one.

    >>> from matplotlib.colors import to_hex
    >>> to_hex(dark_twin("#005f9e")), to_hex(dark_twin("white")), to_hex(dark_twin("red"))
    ('#2f8fd6', '#12181d', '#ff0000')
    """
    red, green, blue, alpha = to_rgba(colour)
    twin = _twins().get(to_hex((red, green, blue)))
    if twin is not None:
        return (*twin, alpha)
    if np.ptp((red, green, blue)) > GREY:
        return red, green, blue, alpha
    (light_paper, light_ink), (dark_paper, dark_ink) = map(_ends, ("light", "dark"))
    share_of_ink = (LUMA @ light_paper - LUMA @ (red, green, blue)) / (LUMA @ light_paper - LUMA @ light_ink)
    red, green, blue = (dark_paper + np.clip(share_of_ink, 0, 1) * (dark_ink - dark_paper)).tolist()
    return red, green, blue, alpha


@cache
def _settings(name: str) -> dict[str, Any]:
    with theme(name):
        return dict(rcParams.items())


@cache
def _twins() -> dict[str, tuple[float, float, float]]:
    """The dark style's colour for each of the light one."""
    light, dark = map(_settings, ("light", "dark"))
    pairs = list(zip(*(twin["axes.prop_cycle"].by_key()["color"] for twin in (light, dark)), strict=True))
    names = ("figure.facecolor", "text.color", "axes.edgecolor", "grid.color", "hatch.color")
    pairs += [(light[name], dark[name]) for name in names]
    return {to_hex(twin): to_rgb(dark_colour) for twin, dark_colour in pairs}


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

        def draw_path_collection(gc: Any, *arguments: Any, **options: Any) -> None:
            five, (faces, edges), rest = arguments[:5], arguments[5:7], arguments[7:]
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


CHOICE = """<style>
body img.in-dark { display: none; }
@media not print {
  body:is([data-theme="dark"], [data-jp-theme-light="false"], .vscode-dark) .in-light { display: none; }
  body:is([data-theme="dark"], [data-jp-theme-light="false"], .vscode-dark) .in-dark { display: block; }
  @media (prefers-color-scheme: dark) {
    body[data-theme="auto"] .in-light { display: none; }
    body[data-theme="auto"] .in-dark { display: block; }
  }
}
</style>"""
"""Which of two pictures is seen: as the page says (the manual, JupyterLab, VS Code), else the light one.

JupyterLab, and pages made from its notebooks, have the rule `.jp-RenderedHTMLCommon > img { display: block; }`, which a
class alone does not override.
"""
SHOWN = '<img class="{where}" src="data:image/{form};base64,{data}" alt="{words}" style="max-width:100%">'


@dataclass(frozen=True)
class ThemedPicture:
    """The same picture on light and on dark paper, as a notebook or a page shows it.

    `words` say what it shows where it cannot be seen; `form` is "png" or "gif".

    >>> ThemedPicture(b"light", b"dark", "an angle over time", "gif")
    ThemedPicture('an angle over time', gif)
    """

    light: bytes
    dark: bytes
    words: str
    form: str = "png"

    def html(self) -> str:
        """A self-contained fragment of a page."""
        return f"{CHOICE}\n{self.images()}"

    def images(self) -> str:
        """The two images, for a page that has CHOICE."""
        images = (("in-light", self.light), ("in-dark", self.dark))
        return "\n".join(
            SHOWN.format(where=where, form=self.form, data=b64encode(data).decode(), words=html(self.words))
            for where, data in images
        )

    def _repr_mimebundle_(self, **_: object) -> dict[str, object]:
        picture = {"image/png": self.light} if self.form == "png" else {}
        return {"text/html": self.html(), **picture, "text/plain": repr(self)}

    def __repr__(self) -> str:
        return f"ThemedPicture({self.words!r}, {self.form})"


def pair_of(figure: Figure, words: str = "") -> ThemedPicture:
    """A figure of the light style as it is and as `modal.plotting.themes` draws it.

    `words` describe it; without them its labels do.

    >>> from modal.plotting import theme
    >>> from matplotlib.figure import Figure
    >>> with theme("light"):
    ...     axis = (figure := Figure()).subplots()
    ...     _ = axis.set(xlabel="time (s)", ylabel="angle (rad)")
    ...     pair_of(figure)
    ThemedPicture('angle (rad) over time (s)', png)
    """
    with any_letters():
        figure.draw_without_rendering()
    layout = figure.get_layout_engine()
    figure.set_layout_engine("none")  # both pictures have the layout of this drawing
    pictures = []
    for backend in ("agg", "module://modal.plotting.themes"):
        buffer = BytesIO()
        with any_letters():
            figure.savefig(buffer, format="png", dpi=figure.dpi, backend=backend)
        pictures.append(_reduce_palette(buffer))
    figure.set_layout_engine(layout)
    return ThemedPicture(pictures[0], pictures[1], words or _describe(figure))


def _reduce_palette(picture: BytesIO) -> bytes:
    """A PNG of 256 colours, a third as long; of its background not a bit is changed."""
    image = Image.open(picture).convert("RGB")
    small = BytesIO()
    small_image = image.quantize(256, method=Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE)
    palette = np.array(small_image.getpalette(), dtype=np.uint8).reshape(-1, 3)
    palette[np.asarray(small_image)[0, 0]] = np.asarray(image)[0, 0]
    small_image.putpalette(palette.tobytes())
    small_image.save(small, "PNG")
    return small.getvalue()


def _describe(figure: Figure) -> str:
    """The title of a figure and what its axes show."""
    phrases = [figure.get_suptitle()]
    for axis in figure.axes:
        y_label, x_label = (" ".join(words.split()) for words in (axis.get_ylabel(), axis.get_xlabel()))
        phrases += [axis.get_title(), f"{y_label} over {x_label}" if y_label and x_label else y_label or x_label]
    return "; ".join(dict.fromkeys(words for words in phrases if words)) or "a figure"


def show_both_themes() -> None:
    """Draw in the light style, and show every figure of this notebook in both themes.

    Outside a notebook only the style is set.

    >>> from matplotlib import rcParams
    >>> from modal.plotting import theme
    >>> with theme("dark"):
    ...     show_both_themes()
    ...     rcParams["figure.facecolor"]
    '#ffffff'
    """
    style.use("modal.plotting.light")
    notebook = getattr(sys.modules.get("IPython"), "get_ipython", lambda: None)()
    if notebook is None:
        return
    with suppress(ModuleNotFoundError):  # not every kernel has it; it would draw each figure once more
        inline = import_module("matplotlib_inline.config").InlineBackend
        inline.instance(parent=notebook).figure_formats = set()
    bundles = notebook.display_formatter.mimebundle_formatter
    bundles.for_type(Figure, lambda figure, **_: pair_of(figure)._repr_mimebundle_())


PAGE = """{choice}
<figure style="margin:0">
<label>{label} <output>{first}</output>
<input type="range" min="0" max="{last}" value="{at}"
 style="width:60%;vertical-align:middle;color:inherit;accent-color:currentcolor"
 oninput="const all = this.closest('figure').querySelectorAll('div');
 all.forEach((one, k) => one.style.display = k == this.value ? 'block' : 'none');
 this.closest('label').querySelector('output').value = all[this.value].dataset.value"></label>
{pictures}
</figure>"""
PICTURE = '<div data-value="{value}" style="display:{display}">{images}</div>'


@dataclass(frozen=True)
class Slider:
    """Pictures on light and dark paper, their values, and which is shown first.

    Notebooks and pages show the slider; where only a picture can be shown (print, a preview) it is the first.
    """

    label: str
    values: tuple[str, ...]
    pictures: tuple[ThemedPicture, ...]
    at: int

    def html(self) -> str:
        """A self-contained fragment of a page."""
        pictures = (
            PICTURE.format(value=html(value), images=picture.images(), display="block" if k == self.at else "none")
            for k, (value, picture) in enumerate(zip(self.values, self.pictures, strict=True))
        )
        return PAGE.format(
            choice=CHOICE,
            label=html(self.label),
            first=html(self.values[self.at]),
            last=len(self.values) - 1,
            at=self.at,
            pictures="\n".join(pictures),
        )

    def _repr_mimebundle_(self, **_: object) -> dict[str, object]:
        return {"text/html": self.html(), "image/png": self.pictures[self.at].light, "text/plain": repr(self)}

    def __repr__(self) -> str:
        return f"Slider({self.label!r}, {len(self.values)} pictures)"


def slide(draw: Callable[[float], Figure], values: Sequence[float], label: str, *, at: int | None = None) -> Slider:
    """Draw a figure for each value and put them behind a slider.

    `label` names the quantity with its unit, such as "cart (kg)"; `at` is the index of the value shown first, by
    default the middle one. Raise ValueError if there are no values.
    """
    if len(values) == 0:
        raise ValueError("a slider needs at least one value")
    first = len(values) // 2 if at is None else range(len(values))[at]
    names = tuple(f"{value:.4g}" for value in values)
    pictures = tuple(_picture(draw(value), f"{label} {name}") for value, name in zip(values, names, strict=True))
    return Slider(label, names, pictures, first)


def _picture(figure: Figure, words: str) -> ThemedPicture:
    from matplotlib import pyplot

    pair = pair_of(figure, words)
    pyplot.close(figure)
    return pair
