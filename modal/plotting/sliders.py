"""A figure for each value of one quantity, with a slider: pages and notebooks show it without a running program."""

from __future__ import annotations

import base64
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from io import BytesIO

from matplotlib import pyplot
from matplotlib.figure import Figure

from modal.plotting.style import save
from modal.report import html

PAGE = """<figure style="margin:0">
<label>{label} <output>{first}</output>
<input type="range" min="0" max="{last}" value="{at}"
 style="width:60%;vertical-align:middle;color:inherit;accent-color:currentcolor"
 oninput="const all = this.closest('figure').querySelectorAll('img');
 all.forEach((one, k) => one.style.display = k == this.value ? 'block' : 'none');
 this.closest('label').querySelector('output').value = all[this.value].dataset.value"></label>
{pictures}
</figure>"""
PICTURE = '<img src="data:image/png;base64,{data}" data-value="{value}" alt="{label} {value}" style="{style}">'


@dataclass(frozen=True)
class Slider:
    """Pictures as PNG, their values, and which is shown first.

    Notebooks and pages show the slider; where only a picture can be shown (print, a preview) it is the first.
    """

    label: str
    values: tuple[str, ...]
    pictures: tuple[bytes, ...]
    at: int

    def html(self) -> str:
        """A self-contained fragment of a page."""
        label = html(self.label)
        pictures = (
            PICTURE.format(
                data=base64.b64encode(picture).decode(),
                value=html(value),
                label=label,
                style=f"max-width:100%;display:{'block' if k == self.at else 'none'}",
            )
            for k, (value, picture) in enumerate(zip(self.values, self.pictures, strict=True))
        )
        last = len(self.values) - 1
        return PAGE.format(
            label=label, first=html(self.values[self.at]), last=last, at=self.at, pictures="\n".join(pictures)
        )

    def _repr_mimebundle_(self, **_: object) -> dict[str, object]:
        return {"text/html": self.html(), "image/png": self.pictures[self.at], "text/plain": repr(self)}

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
    return Slider(label, tuple(f"{value:.4g}" for value in values), tuple(_picture(draw(v)) for v in values), first)


def _picture(figure: Figure) -> bytes:
    buffer = BytesIO()
    save(figure, buffer, "png")
    pyplot.close(figure)
    return buffer.getvalue()
