"""Films of modes: all of them side by side, each swinging once a loop, so that the film goes round without a seam.

A mode moves by q(s) = a Re(φ e^{−2πis}), s from 0 to 1 over the loop, its damping or growth left out.  One that does
not oscillate decays from its shape, or grows to it, and is brought back in the last part of the loop.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from os import PathLike
from typing import IO, Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes

from modal.errors import ComputationError, SceneError
from modal.modes import Mode, Modes, Shape
from modal.plotting.films import FORMS, MovingFigure, Report, form_problems, frame_rate, require_writer, write_film
from modal.plotting.layout import caption, headline
from modal.plotting.profiles import levels_of, number_pendula
from modal.plotting.shapes import (
    AMPLITUDE_DEG,
    MOST_PANELS,
    USUAL_PANELS,
    ShapeLayout,
    arranged,
    draw_rest,
    draw_swing,
    draw_translation,
    fitting_amplitude,
    is_crowded,
    layout_of,
    panel_words,
    set_apart,
    some_words,
)
from modal.plotting.style import any_letters, colour, sheet
from modal.report import silent
from modal.scene import kind_of, title_of, whole_file

LOOP = 2.4
"""Seconds of film in which every mode swings once."""
DPI = 100
LINE, LETTER = 0.22, 0.09
"""Height of a line and width of a letter (inches)."""
HIGHEST, LARGEST = 3.0, 11.0
"""Most height of a panel and most width of a film (inches)."""
DECAYING, FOLDS = 0.8, 4.0
"""The part of a loop in which a mode decays or grows, and by how many factors of e."""
MOST_LEVELS = 3
"""Links of every pendulum, from the top, whose angles are drawn over the number of the pendulum."""


class ModalFilm(MovingFigure):
    """A panel for each of the modes with these indices (from 0), over one loop of `count` frames; `first` is a note."""

    def __init__(
        self,
        modes: Modes,
        numbers: Sequence[int],
        rate: float,
        amplitude_deg: float = AMPLITUDE_DEG,
        first: str = "",
    ) -> None:
        rows, many = list(modes.rows(numbers)), is_crowded(modes.scene)
        layout = None if many else layout_of(modes)
        (columns, lines), width, height = _sizes(len(rows), layout)
        layout = layout and layout.within(width)
        words = [panel_words(row, max(18, int(width / LETTER))) for row in rows]
        high = height + LINE * max(text.count("\n") + 1 for text in words) + 0.15
        figure = sheet(max(columns * width, 4.6), lines * high + 0.8)
        figure.set(dpi=DPI)
        title = title_of(modes.scene)
        super().__init__(figure, title, max(2, round(LOOP * rate)), rate)
        headline(figure, title, "modes")
        axes = figure.subplots(lines, columns, squeeze=False)
        self.panels = [
            _panel(axis, modes, row, layout, np.radians(amplitude_deg))
            for axis, row in zip(axes.flat, rows, strict=False)
        ]
        for axis, text in zip(axes.flat, words, strict=False):
            axis.set_title(text, linespacing=1.3)
        for axis in axes.flat[len(rows) :]:
            axis.remove()
        words = [first + _caption(modes, rows)]
        if layout is not None and layout.scaffold is not None:
            words += set_apart(layout.scaffold, modes.scene.n_pendula)
        caption(figure, "; ".join(words))
        self.show(0)
        figure.draw_without_rendering()
        figure.set_layout_engine("none")

    @property
    def moving(self) -> list[Artist]:
        """The pendula and their carts."""
        return sorted((artist for panel in self.panels for artist in panel.drawn), key=Artist.get_zorder)

    def show(self, frame: int) -> None:
        """Update every panel to a frame."""
        for panel in self.panels:
            panel.show(frame / self.count)


@dataclass(eq=False)
class _Panel:
    """A panel: its axis, how its shape moves over the loop, what draws a shape, and what is drawn now."""

    axis: Axes
    moved: Callable[[float], Shape]
    draw: Callable[[Axes, Shape], None]
    drawn: list[Artist]
    stands: bool

    def show(self, s: float) -> None:
        """Draw the shape at a part of the loop."""
        if self.stands:
            return
        for artist in self.drawn:
            artist.remove()
        before = set(self.axis.get_children())
        self.draw(self.axis, self.moved(s))
        self.drawn = [artist for artist in self.axis.get_children() if artist not in before]


def _panel(axis: Axes, modes: Modes, row: Mode, layout: ShapeLayout | None, amplitude: float) -> _Panel:
    """The panel of a mode, with what stands still in it; layout is None where angles are drawn over pendula."""
    shape = modes.shape(modes.index_of(row))
    real = shape.at()

    def moved(s: float) -> Shape:
        return shape.at(motion(row, s))

    if layout is None:
        draw = _profile(axis, modes, amplitude)
        return _Panel(axis, moved, draw, [], stands=row.omega == 0 or row.is_uncertain)
    draw_rest(axis, modes, layout, real)
    axis.set_axis_off()
    if row.omega == 0:
        draw_translation(axis, layout)
    largest = fitting_amplitude(layout, replace(real, cart=abs(shape.cart), supports=np.abs(shape.supports)), amplitude)

    def hang(axis: Axes, now: Shape) -> None:
        draw_swing(axis, modes, layout, now, largest, {"color": colour(0)})

    return _Panel(axis, moved, hang, [], stands=row.omega == 0 or row.is_uncertain)


def motion(row: Mode, s: float) -> complex:
    """The factor of the shape at part `s` of the loop."""
    if row.oscillates:
        return complex(np.exp(-2j * np.pi * s))
    return _decay(1 - s if row.growth_rate else s)


def _decay(s: float) -> float:
    """Decay from 1 by FOLDS factors of e, and the way back."""
    low = float(np.exp(-FOLDS))
    if s <= DECAYING:
        return float(low ** (s / DECAYING))
    return float(low + (1 - low) * (0.5 - 0.5 * np.cos(np.pi * (s - DECAYING) / (1 - DECAYING))))


def _profile(axis: Axes, modes: Modes, amplitude: float) -> Callable[[Axes, Shape], None]:
    """An axis of angle over the number of the pendulum, and what draws a line on it for each link of the pendula."""
    levels = levels_of(modes.scene)[:, :MOST_LEVELS].T
    number_pendula(axis, 1, levels.shape[1], float(np.degrees(amplitude)))

    def draw(axis: Axes, now: Shape) -> None:
        for k, level in enumerate(levels):
            angles = np.degrees(amplitude * now.angles[level[level >= 0]])
            axis.plot(np.flatnonzero(level >= 0) + 1, angles, color=colour(k), lw=1.2, zorder=3)

    return draw


def _sizes(count: int, layout: ShapeLayout | None) -> tuple[tuple[int, int], float, float]:
    """The columns and lines of panels, and the width and height of one (inches)."""
    ratio = 1.5 if layout is None else 2 * layout.half_width / (layout.top - layout.bottom)
    columns, lines = arranged(count, ratio)
    width = float(np.clip(HIGHEST * ratio, 2.4, LARGEST / columns))
    return (columns, lines), width, width / ratio


def _caption(modes: Modes, rows: Sequence[Mode]) -> str:
    words = ["each mode swings once a loop, whatever its period"]
    if any(row.oscillates and row.damping_ratio for row in rows):
        words += ["the damping of swings is left out"]
    if any(not row.oscillates and row.omega > 0 for row in rows):
        words += ["modes that do not swing decay or grow, and are brought back at the end of the loop"]
    if any(row.multiplicity > 1 for row in rows):
        words += ["one shape of each repeated mode"]
    if is_crowded(modes.scene):
        words += ["angle over the number of the pendulum"]
        deepest = max(pendulum.n_links for pendulum in modes.scene.pendulum)
        words += [f"the upper {MOST_LEVELS} of {deepest} links"] if deepest > MOST_LEVELS else []
    return "; ".join(words)


def film_modes(
    modes: Modes,
    stream: IO[bytes],
    form: str,
    numbers: Sequence[int] | None = None,
    *,
    amplitude_deg: float = AMPLITUDE_DEG,
    fps: float | None = None,
    report: Report = silent,
) -> ModalFilm:
    """Write a film of the modes with these indices (from 0), by default the first ones, as "gif", "mp4" or "html".

    `amplitude_deg` is the largest angle of each, `fps` the frame rate (25 in a GIF, else 30); `report` is called with
    the seconds of film done.  Raises SceneError for invalid arguments, ComputationError for more modes than one film
    holds and for an MP4 without ffmpeg.
    """
    if problems := form_problems(form, fps):
        raise SceneError(problems)
    chosen = range(min(len(modes), USUAL_PANELS)) if numbers is None else numbers
    if len(chosen) > MOST_PANELS:
        raise ComputationError(f"{len(chosen)} modes do not fit in one film: choose at most {MOST_PANELS} modes")
    rate = frame_rate(form, fps)
    require_writer(form, round(LOOP * rate))
    with any_letters():
        film = ModalFilm(modes, chosen, rate, amplitude_deg, some_words(modes, numbers))
        write_film(film, stream, form, report)
    return film


def save_film(modes: Modes, path: str | PathLike[str], numbers: Sequence[int] | None = None, **options: Any) -> None:
    """Write the film of `film_modes` to a file, as its name says; the file is whole or not there."""
    form = kind_of(path, FORMS)
    with whole_file(path) as stream:
        film_modes(modes, stream, form, numbers, **options)
