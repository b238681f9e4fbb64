"""A figure for each value of one quantity, with a slider: pages and notebooks show it without a running program."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from matplotlib.figure import Figure

from modal.plotting.themes import CHOICE, ThemedPicture, pair_of
from modal.report import html

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
    default the middle one.  Raises ValueError where there are no values.
    """
    if len(values) == 0:
        raise ValueError("a slider needs at least one value")
    first = len(values) // 2 if at is None else range(len(values))[at]
    names = tuple(f"{value:.4g}" for value in values)
    made = tuple(_pictured(draw(value), f"{label} {name}") for value, name in zip(values, names, strict=True))
    return Slider(label, names, made, first)


def _pictured(figure: Figure, words: str) -> ThemedPicture:
    from matplotlib import pyplot

    pair = pair_of(figure, words)
    pyplot.close(figure)
    return pair
