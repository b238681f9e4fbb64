"""Animations of a motion: the pendula next to their energies, as an animated GIF, an MP4 or an HTML page.

A long run becomes a short, stroboscopic film, in which fast oscillations appear slow and slow changes become visible.

A film shows a run, or an orbit next to its linear mode; in a notebook it is small, in both themes, and plays by itself.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from io import BytesIO
from math import ceil, pi
from textwrap import fill
from typing import IO, TYPE_CHECKING, Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.text import Text

from modal.errors import SceneError
from modal.modes import Modes
from modal.plotting.films import DPI, MovingFigure, Report, form_problems, frame_rate, require_writer, write_film
from modal.plotting.layout import SMALL
from modal.plotting.style import SOLVED_POINTS, WIDTH, any_letters, secondary_colour, sheet, theme
from modal.plotting.themes import ThemedPicture
from modal.report import silent, visible
from modal.scene import title_of
from modal.scene.doors import require_type
from modal.types import Floats
from nonlinear.integration import CLOSED, SolverInfo, Trajectory
from nonlinear.plotting.artists import Gauges, Scenery
from nonlinear.plotting.scene import Stage, energies_of, stage_of
from nonlinear.reduction import start_in_mode, superpose
from nonlinear.system import Motion

if TYPE_CHECKING:
    from nonlinear.orbits import Orbit
    from nonlinear.synchronization import Phases

SIZE = (WIDTH, 9 / 16 * WIDTH)
"""Width and height of a film's figure in inches, as those of a screen."""
PANEL = (0.02, 0.16, 0.585, 0.72)
"""Left, bottom, width and height of the pendula's panel, as fractions of the figure."""
HALVES = ((0.02, 0.16, 0.47, 0.72), (0.51, 0.16, 0.47, 0.72))
"""The same of the two motions of a film that shows one next to the other."""
FPS = {"gif": 20.0, "mp4": 30.0, "html": 20.0}
SECONDS = 20.0
"""Format: most seconds of a film where none are requested."""
STROBE_FRAMES = 24
"""Format: frames in which a stroboscopic film shows one swing."""


class Film(MovingFigure):
    """The figure of a trajectory at `times` (F,) in s, updated frame by frame."""

    def __init__(
        self, trajectory: Trajectory, times: Floats, rate: float, speed: float, second: Trajectory | None = None
    ) -> None:
        self.times = times
        figure = sheet(*SIZE)
        figure.set(dpi=DPI, layout_engine="none")
        super().__init__(figure, visible(title_of(trajectory.scene)), len(times), rate)
        stage, panel = stage_of(trajectory, times), PANEL if second is None else HALVES[0]
        ratio, trail = panel[2] * SIZE[0] / (panel[3] * SIZE[1]), max(1, round(rate))
        self.scenery = Scenery(self.figure.add_axes(panel), stage, ratio, trail)
        self.right: Gauges | Scenery
        if second is None:
            bars, line = (self.figure.add_axes((0.69, bottom, 0.29, 0.27)) for bottom in (0.58, 0.18))
            self.right = Gauges(bars, line, energies_of(trajectory, times), times)
        else:
            self.right = Scenery(self.figure.add_axes(HALVES[1]), stage_of(second, times), ratio, trail)
        self._words(_caption(trajectory, stage, speed, second))
        self._moving = sorted([*self.scenery.moving, *self.right.moving, self.clock], key=Artist.get_zorder)
        self.show(0)

    @property
    def moving(self) -> list[Artist]:
        """Pendula, their cart, the energies and the clock."""
        return self._moving

    def view(self, frame: int) -> float:
        """The place of the camera (m)."""
        return float(self.scenery.stage.camera[frame])

    def _words(self, caption: str) -> None:
        title = self.figure.text(0.02, 0.975, self.title, fontsize="large", weight="bold", va="top", parse_math=False)
        self.clock = self.figure.text(0.98, 0.975, "", ha="right", va="top")
        low = self.figure.text(0.02, 0.02, caption, fontsize=SMALL, color=secondary_colour(), va="bottom")
        self.clock.set_text(f"t = {self.times[-1]:.2f} s")
        clock_width = self.clock.get_window_extent().width / self.figure.bbox.width
        _fit(title, 0.92 - clock_width)
        _fit(low, 0.96)

    def show(self, frame: int) -> None:
        """Update all artists to a frame."""
        self.scenery.show(frame)
        self.right.show(frame)
        self.clock.set_text(f"t = {self.times[frame]:.2f} s")


def _fit(text: Text, width: float) -> None:
    """Wrap or shrink text until it is no wider than a fraction of the figure."""
    figure = text.get_figure()
    assert figure is not None
    room = width * figure.bbox.width
    if text.get_window_extent().width > 1.6 * room:
        words = text.get_text()
        text.set_text(fill(words, max(20, len(words) * 11 // 20)))
    text.set_fontsize(float(text.get_fontsize()) * min(1.0, room / max(text.get_window_extent().width, 1.0)))


def _caption(trajectory: Trajectory, stage: Stage, speed: float, second: Trajectory | None) -> str:
    system, n_drawn = trajectory.system, len(stage.actors)
    words = ["real time" if speed == 1 else f"{speed:.3g} seconds a second"]
    words += [f"{n_drawn} of {system.n_pendula} pendula drawn"] if n_drawn < system.n_pendula else []
    words += stage.notes
    words += ["oblique view, with the shadow on a floor"] if system.spatial else []
    words += ["the camera follows the cart"] if stage.follows else []
    last = (
        "energy above equilibrium, potential faint"
        if second is None
        else f"left: {trajectory.run.form}; right: {second.run.form}"
    )
    return "; ".join([*words, last])


def strobe(phases: Phases, form: str) -> dict[str, Any]:
    """The arguments of `animate` for a film of at most SECONDS, whole periods plus 1/STROBE_FRAMES between frames.

    Runs that are no longer than the film are shown in real time.
    """
    period = float(2 * pi / np.median(phases.omega[:, phases.leading]))
    fps, duration = FPS[form], float(phases.times[-1] - phases.times[0])
    swings = ceil(duration / (SECONDS * fps * period) - 1 / STROBE_FRAMES)
    speed = (swings + 1 / STROBE_FRAMES) * period * fps if duration > SECONDS else 1.0
    return {"fps": fps, "speed": speed, "seconds": SECONDS}


@dataclass(frozen=True)
class Shown:
    """The content of a film: frames, frame rate, seconds of motion; `left_out` is the rest of the run (s)."""

    frames: int
    fps: float
    motion: float
    left_out: float

    @property
    def seconds(self) -> float:
        """Duration of the film (s)."""
        return self.frames / self.fps


def animate(
    trajectory: Trajectory,
    stream: IO[bytes],
    form: str,
    *,
    fps: float | None = None,
    speed: float = 1.0,
    seconds: float | None = None,
    second: Trajectory | None = None,
    report: Report = silent,
) -> Shown:
    """Write a film of a trajectory as "gif", "mp4" or "html".

    `fps` is the frame rate (25 in a GIF, else 30; a GIF counts hundredths of a second and takes the nearest possible
    rate), `speed` the seconds of motion per second of film, `seconds` the maximum length of the film (20). Another
    trajectory of the same duration may be shown `second` this one, instead of the energies. `report` is called with the
    seconds of film done. Raise SceneError for invalid arguments, ComputationError if samples are too far apart and for
    an MP4 without ffmpeg.
    """
    _check(form, fps, speed, seconds)
    rate = frame_rate(form, fps)
    length = float(trajectory.times[-1] - trajectory.times[0]) / speed
    frames = max(1, int(min(length, seconds or SECONDS) * rate + 1e-9))
    require_writer(form, frames)
    with any_letters():
        film = Film(trajectory, trajectory.times[0] + speed / rate * np.arange(frames), rate, speed, second)
        write_film(film, stream, form, report)
    motion = min(frames * speed / rate, length * speed)
    return Shown(frames, rate, motion, max(0.0, (length * speed) - motion))


def _check(form: str, fps: float | None, speed: float, seconds: float | None) -> None:
    problems = form_problems(form, fps)
    for name, value in (("speed", speed), ("seconds", seconds)):
        if value is not None and not 0 < value < float("inf"):
            problems.append(f"{name} {value!r}: must be positive")
    if problems:
        raise SceneError(problems)


def show_film(trajectory: Trajectory, words: str = "", **options: Any) -> ThemedPicture:
    """A film of a motion as a GIF on light and on dark paper, to be the last line of a cell.

    `words` say what is seen, by default the scene's title; the options are those of `animate`, such as `speed`,
    `seconds` and `fps`.  Raises what `animate` raises.

    >>> from modal import load
    >>> from nonlinear import simulate
    >>> show_film(simulate(load("chain-1"), 1.0), "a pendulum swings", seconds=0.2)
    ThemedPicture('a pendulum swings', gif)
    """
    require_type("trajectory", trajectory, "Trajectory")
    films = []
    for name in ("light", "dark"):
        buffer = BytesIO()
        with theme(name):
            animate(trajectory, buffer, "gif", **options)
        films.append(buffer.getvalue())
    return ThemedPicture(films[0], films[1], words or visible(title_of(trajectory.scene)), "gif")


def film_orbit(
    orbit: Orbit,
    stream: IO[bytes],
    form: str,
    *,
    modes: Modes | None = None,
    row: int = 0,
    report: Callable[[float], object] = silent,
) -> Shown:
    """Write a film of four periods of an orbit, next to the mode of index `row` at the same largest angle."""
    phase = np.linspace(0, 1, SOLVED_POINTS, endpoint=False)
    rows = np.tile(orbit.states_at(phase * orbit.period), (4, 1))
    times = (np.arange(4)[:, None] + phase).ravel() * orbit.period
    trajectory = _trajectory(orbit, times, orbit.motion(rows), "the periodic orbit")
    linear_motion = _linear(orbit, times, modes, row) if modes else None
    return animate(trajectory, stream, form, second=linear_motion, report=report)


def _linear(orbit: Orbit, times: Floats, modes: Modes, row: int) -> Trajectory:
    """The linear mode with the same largest angle, its leading link on the same side."""
    start = start_in_mode(orbit.scene, modes, row, 0, orbit.amplitude)
    deflections, angles = orbit.state.links - orbit.flow.system.rest, start.links - orbit.flow.system.rest
    if angles @ deflections < 0:
        start = start_in_mode(orbit.scene, modes, row, 0, -orbit.amplitude)
    motion = superpose(orbit.scene, start, corrected=False)(times)
    return _trajectory(orbit, times, motion, "the linear mode")


def _trajectory(orbit: Orbit, times: Floats, motion: Motion, words: str) -> Trajectory:
    return Trajectory(orbit.scene, orbit.flow.system, times, motion, SolverInfo(words, CLOSED, "", 0.0))
