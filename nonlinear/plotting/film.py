"""The figure of a film: the pendula, their energies, a title, a clock and a caption, moved from frame to frame."""

from __future__ import annotations

from textwrap import fill

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.text import Text
from PIL import Image

from modal.plotting import SMALL, muted, sheet
from modal.report import visible
from modal.types import Floats
from nonlinear.integration import Trajectory
from nonlinear.plotting.artists import Scenery
from nonlinear.plotting.gauges import Gauges
from nonlinear.plotting.scene import energies_of, stage_of

TRAIL = 0.8
"""Seconds of film that a tip's trail lasts."""
SIZE, DPI = (8.0, 4.5), 100
PANEL = (0.02, 0.16, 0.585, 0.72)
"""Left, bottom, width and height of the pendula's panel, as parts of the figure."""


class Film:
    """The figure of a trajectory at `times` (F,) in s, to be moved from frame to frame."""

    def __init__(self, trajectory: Trajectory, times: Floats, rate: float, speed: float) -> None:
        self.times, self.rate = times, rate
        self.title = visible(trajectory.scene.title) or "Pendula"
        self.figure = sheet(*SIZE)
        self.figure.set(dpi=DPI, layout_engine="none")
        self.canvas = FigureCanvasAgg(self.figure)
        stage = stage_of(trajectory, times)
        ratio = PANEL[2] * SIZE[0] / (PANEL[3] * SIZE[1])
        self.scenery = Scenery(self.figure.add_axes(PANEL), stage, ratio, max(1, round(TRAIL * rate)))
        bars, line = (self.figure.add_axes((0.69, bottom, 0.29, 0.27)) for bottom in (0.58, 0.18))
        self.gauges = Gauges(bars, line, energies_of(trajectory, times), times)
        self._words(_caption(trajectory, len(stage.actors), stage.follows, speed))
        self.show(0)

    def _words(self, caption: str) -> None:
        title = self.figure.text(0.02, 0.975, self.title, fontsize="large", weight="bold", va="top", parse_math=False)
        self.clock = self.figure.text(0.98, 0.975, "", ha="right", va="top")
        low = self.figure.text(0.02, 0.02, caption, fontsize=SMALL, color=muted(), va="bottom")
        self.clock.set_text(f"t = {self.times[-1]:.2f} s")
        taken = self.clock.get_window_extent().width / self.figure.bbox.width
        _fit(title, 0.92 - taken)
        _fit(low, 0.96)

    def show(self, frame: int) -> None:
        """Move everything to where it is in a frame."""
        self.scenery.show(frame)
        self.gauges.show(frame)
        self.clock.set_text(f"t = {self.times[frame]:.2f} s")

    def image(self, frame: int) -> Image.Image:
        """One frame."""
        self.show(frame)
        self.canvas.draw()  # type: ignore[no-untyped-call]
        pixels = np.asarray(self.canvas.buffer_rgba())  # type: ignore[no-untyped-call]
        return Image.fromarray(pixels[..., :3].copy())


def _fit(text: Text, width: float) -> None:
    """Break or shrink words until they are no wider than a part of the figure."""
    figure = text.get_figure()
    assert figure is not None
    room = width * figure.bbox.width
    if text.get_window_extent().width > 1.6 * room:
        words = text.get_text()
        text.set_text(fill(words, max(20, len(words) * 11 // 20)))
    text.set_fontsize(float(text.get_fontsize()) * min(1.0, room / max(text.get_window_extent().width, 1.0)))


def _caption(trajectory: Trajectory, drawn: int, follows: bool, speed: float) -> str:
    system = trajectory.system
    words = ["real time" if speed == 1 else f"{speed:.3g} seconds a second"]
    words += [f"{drawn} of {system.n_pendula} pendula drawn"] if drawn < system.n_pendula else []
    words += ["pivots set apart"] if drawn > 1 else []
    words += ["seen obliquely, with the shadow on a floor"] if system.spatial else []
    words += ["the camera follows the cart"] if follows else []
    return "; ".join([*words, "energy above rest"])
