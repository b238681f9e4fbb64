"""Figures of a lesson in two themes: a page or a notebook shows the light or the dark one, as its reader reads.

`show_both_themes()` at the head of a notebook is all that is needed: from then on every figure is shown so.
"""

from __future__ import annotations

import sys
from base64 import b64encode
from contextlib import suppress
from dataclasses import dataclass
from importlib import import_module
from io import BytesIO

import numpy as np
from matplotlib import style
from matplotlib.figure import Figure
from PIL import Image

from modal.plotting.style import any_letters
from modal.report import html

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
        shown = (("in-light", self.light), ("in-dark", self.dark))
        return "\n".join(
            SHOWN.format(where=where, form=self.form, data=b64encode(data).decode(), words=html(self.words))
            for where, data in shown
        )

    def _repr_mimebundle_(self, **_: object) -> dict[str, object]:
        picture = {"image/png": self.light} if self.form == "png" else {}
        return {"text/html": self.html(), **picture, "text/plain": repr(self)}

    def __repr__(self) -> str:
        return f"ThemedPicture({self.words!r}, {self.form})"


def pair_of(figure: Figure, words: str = "") -> ThemedPicture:
    """A figure of the light style as it is and as `modal.plotting.dark` draws it.

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
    made = []
    for backend in ("agg", "module://modal.plotting.dark"):
        buffer = BytesIO()
        with any_letters():
            figure.savefig(buffer, format="png", dpi=figure.dpi, backend=backend)
        made.append(_reduced(buffer))
    figure.set_layout_engine(layout)
    return ThemedPicture(made[0], made[1], words or _described(figure))


def _reduced(picture: BytesIO) -> bytes:
    """A PNG of 256 colours, a third as long; of its background not a bit is changed."""
    image = Image.open(picture).convert("RGB")
    small = BytesIO()
    reduced = image.quantize(256, method=Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE)
    palette = np.array(reduced.getpalette(), dtype=np.uint8).reshape(-1, 3)
    palette[np.asarray(reduced)[0, 0]] = np.asarray(image)[0, 0]
    reduced.putpalette(palette.tobytes())
    reduced.save(small, "PNG")
    return small.getvalue()


def _described(figure: Figure) -> str:
    """The title of a figure and what its axes show."""
    phrases = [figure.get_suptitle()]
    for axis in figure.axes:
        up, across = (" ".join(words.split()) for words in (axis.get_ylabel(), axis.get_xlabel()))
        phrases += [axis.get_title(), f"{up} over {across}" if up and across else up or across]
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
