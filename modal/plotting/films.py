"""Films: frames written as an animated GIF, an MP4 or an HTML page.

A film is a figure that is mostly static: moving parts are redrawn over the pixels of the rest.

A film of modes shows all of them together, each swinging once per loop, so that the loop is seamless: a mode
moves by q(s) = a Re(φ e^{−2πis}), s from 0 to 1 over the loop, its damping or growth omitted. One that does not
oscillate decays from its shape, or grows to it, and is brought back in the last part of the loop.
"""

from __future__ import annotations

import base64
import shutil
from abc import ABC, abstractmethod
from collections.abc import Callable, Hashable, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import reduce
from io import BytesIO
from os import PathLike
from pathlib import Path
from subprocess import DEVNULL, PIPE, Popen
from tempfile import TemporaryDirectory
from typing import IO, Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from PIL import Image

from modal.errors import ComputationError, SceneError, installing
from modal.modes import Mode, Modes, Shape
from modal.plotting.layout import caption, even_choice
from modal.plotting.shapes import (
    AMPLITUDE_DEG,
    MOST_PANELS,
    USUAL_PANELS,
    ShapeLayout,
    draw_rest,
    draw_swing,
    draw_translation,
    fitting_amplitude,
    is_crowded,
    layout_of,
    levels_of,
    number_pendula,
    panels_of,
    set_apart,
    some_words,
)
from modal.plotting.style import HUES, any_letters, colour, ink, paper
from modal.report import html, silent
from modal.scene import kind_of, title_of, whole_file

FORMS = ("gif", "mp4", "html")
COLOURS = 64
"""Format: colours of a GIF: hues, greys and their mixtures at the edges of lines."""
PAPER_LEVELS = 8
"""Format: largest distance of a colour from the background, of 255, at which it is drawn as background."""
FRAMES_MAX = 20_000
"""Limit: frames of a film: "must be at most 20000; use fewer seconds or fps"."""
NO_FFMPEG = f"mp4 needs ffmpeg: install it, or the extra `video` ({installing('video')}); gif and html do not"
Report = Callable[[float], object]


class MovingFigure(ABC):
    """A figure that shows `count` frames at a `rate` (1/s) one after the other, with a title for its page."""

    def __init__(self, figure: Figure, title: str, count: int, rate: float) -> None:
        self.figure, self.title, self.count, self.rate = figure, title, count, rate
        self.canvas = FigureCanvasAgg(figure)
        self.still: tuple[Hashable, Any] | None = None

    @property
    @abstractmethod
    def moving(self) -> Sequence[Artist]:
        """The artists redrawn in each frame, in this order."""

    @abstractmethod
    def show(self, frame: int) -> None:
        """Update everything to a frame."""

    def view(self, frame: int) -> Hashable:
        """A key equal for frames with the same static content."""
        return None

    def image(self, frame: int) -> Image.Image:
        """One frame: the moving parts, drawn over the static ones while the view stays the same."""
        self.show(frame)
        view = self.view(frame)
        if not self.still or self.still[0] != view:
            self.still = view, self._background()
        self.canvas.restore_region(self.still[1])  # type: ignore[no-untyped-call]
        for artist in self.moving:
            self.figure.draw_artist(artist)
        pixels = np.asarray(self.canvas.buffer_rgba())  # type: ignore[no-untyped-call]
        return Image.fromarray(pixels[..., :3].copy())

    def _background(self) -> Any:
        """The pixels of all that does not move."""
        for artist in self.moving:
            artist.set_animated(True)
        self.canvas.draw()  # type: ignore[no-untyped-call]
        for artist in self.moving:
            artist.set_animated(False)
        return self.canvas.copy_from_bbox(self.figure.bbox)  # type: ignore[no-untyped-call]


def frame_rate(form: str, fps: float | None) -> float:
    """The frames a second: 25 in a GIF, else 30, if none are given; a GIF counts hundredths of a second."""
    if form == "gif":
        return 100.0 / max(2, round(100.0 / (fps or 25.0)))
    return fps or 30.0


def form_problems(form: str, fps: float | None = None) -> list[str]:
    """Return what is wrong with a form and a frame rate."""
    problems = [] if form in FORMS else [f"{form!r}: a film is one of {', '.join(FORMS)}"]
    if fps is not None and not 1 <= fps <= 60:
        problems.append(f"fps {fps!r}: must be from 1 to 60")
    return problems


def require_writer(form: str, frames: int) -> None:
    """Raise SceneError for too many frames, ComputationError for an MP4 without ffmpeg, before anything is drawn."""
    if frames > FRAMES_MAX:
        raise SceneError([f"{frames} frames: must be at most {FRAMES_MAX}; use fewer seconds or fps"])
    if form == "mp4":
        find_ffmpeg()


def write_film(film: MovingFigure, stream: IO[bytes], form: str, report: Report = silent) -> None:
    """Write a film as "gif", "mp4" or "html"; `report` is called with the seconds of film done."""

    def shot(frame: int) -> Image.Image:
        image = film.image(frame)
        report((frame + 1) / film.rate)
        return image

    with any_letters():
        WRITERS[form](film, shot, stream)


def _write_gif(film: MovingFigure, shot: Callable[[int], Image.Image], stream: IO[bytes]) -> None:
    """One palette for all frames, so that only what moves is stored."""
    count = film.count
    samples = [np.asarray(film.image(k)) for k in even_choice(count, 4).tolist()]
    palette = _on_paper(Image.fromarray(np.concatenate(samples)).quantize(COLOURS))

    def with_palette(frame: int) -> Image.Image:
        return shot(frame).quantize(palette=palette, dither=Image.Dither.NONE)

    rest = map(with_palette, range(1, count))
    duration = round(1000 / film.rate)
    with_palette(0).save(stream, "GIF", save_all=True, append_images=rest, duration=duration, loop=0, optimize=True)


def _on_paper(image: Image.Image) -> Image.Image:
    """The same palette with colours close to the background replaced by it."""
    colours = np.array(image.getpalette(), dtype=np.uint8).reshape(-1, 3)
    plain = np.round(255 * np.array(to_rgb(paper()))).astype(np.uint8)
    blank = Image.new("RGB", (1, 1), tuple(plain.tolist())).quantize(palette=image, dither=Image.Dither.NONE)
    colours[np.abs(colours.astype(int) - plain).max(1) <= PAPER_LEVELS] = plain
    colours[np.asarray(blank)] = plain
    image.putpalette(colours.tobytes())
    return image


def _write_mp4(film: MovingFigure, shot: Callable[[int], Image.Image], stream: IO[bytes]) -> None:
    """Frames go to ffmpeg through a pipe; it never receives Ctrl-C, which this process handles."""
    executable = find_ffmpeg()
    width, height = film.canvas.get_width_height()
    raw = ["-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{width}x{height}", "-framerate", repr(film.rate)]
    even_size = ["-vf", "crop=trunc(iw/2)*2:trunc(ih/2)*2"]
    encoding = [*even_size, "-vcodec", "h264", "-pix_fmt", "yuv420p", "-crf", "18", "-movflags", "+faststart"]
    with TemporaryDirectory() as folder:
        path = Path(folder) / "film.mp4"
        try:
            command = [executable, "-loglevel", "error", *raw, "-i", "pipe:", *encoding, str(path)]
            encoder = Popen(command, stdin=PIPE, stdout=DEVNULL, stderr=PIPE, start_new_session=True)
        except OSError as error:
            raise _encoder_error(executable, str(error.strerror)) from None
        with encoder:
            try:
                message = _feed(encoder, (shot(frame).tobytes() for frame in range(film.count)))
            except BaseException:
                encoder.kill()
                raise
        if encoder.returncode:
            raise _encoder_error(executable, message or f"it ended with {encoder.returncode}")
        stream.write(path.read_bytes())


def _feed(encoder: Popen[bytes], frames: Iterable[bytes]) -> str:
    """The last message of a program fed with frames; one that has ended is fed no more."""
    assert encoder.stdin
    with suppress(BrokenPipeError):
        for frame in frames:
            encoder.stdin.write(frame)
    messages = encoder.communicate()[1].decode(errors="replace").split("\n")
    return next((line.strip() for line in reversed(messages) if line.strip()), "")


def _encoder_error(executable: str, words: str) -> ComputationError:
    return ComputationError(f"ffmpeg ({executable}) could not write the film: {words}")


def find_ffmpeg() -> str:
    """The program on the path, or the one provided by the extra; ComputationError without either."""
    program = shutil.which("ffmpeg")
    if program:
        return program
    try:
        from imageio_ffmpeg import get_ffmpeg_exe

        return str(get_ffmpeg_exe())
    except (ImportError, RuntimeError):
        raise ComputationError(NO_FFMPEG) from None


def _write_html(film: MovingFigure, shot: Callable[[int], Image.Image], stream: IO[bytes]) -> None:
    """A self-contained page: frames as PNG, a button, a slider."""
    words = {"RATE": f"{film.rate:g}", "INK": ink(), "PAPER": paper(), "HUE": colour(0)}
    words |= {"WIDTH": str(film.canvas.get_width_height()[0]), "TITLE": html(film.title)}
    head, tail = (reduce(lambda text, pair: text.replace(*pair), words.items(), part) for part in PAGE.split("FRAMES"))
    stream.write(head.encode())
    for k in range(film.count):
        buffer = BytesIO()
        _on_paper(shot(k).quantize(COLOURS, dither=Image.Dither.NONE)).save(buffer, "PNG")
        stream.write(b'"' + base64.b64encode(buffer.getvalue()) + b'",\n')
    stream.write(tail.encode())


WRITERS = {"gif": _write_gif, "html": _write_html, "mp4": _write_mp4}

PAGE = """<!doctype html>
<html lang="en">
<meta charset="utf-8">
<title>TITLE</title>
<style>
body { margin: 2em auto; max-width: WIDTHpx; font-family: sans-serif; color: INK; background: PAPER; }
img { width: 100%; display: block; }
div { display: flex; gap: 1em; align-items: center; }
input { flex: 1; accent-color: HUE; }
</style>
<img id="picture" alt="TITLE">
<div><button id="button">pause</button><input id="slider" type="range" min="0" value="0" aria-label="frame"></div>
<script>
const rate = RATE, frames = [
FRAMES];
const picture = document.getElementById("picture"), button = document.getElementById("button");
const slider = document.getElementById("slider");
let playing = true, since = performance.now();
slider.max = frames.length - 1;
function show(k) { picture.src = "data:image/png;base64," + frames[k]; slider.value = k; }
function play(playOn) { playing = playOn; button.textContent = playOn ? "pause" : "play"; }
function restart() { since = performance.now() - 1000 * slider.value / rate; }
button.onclick = () => { play(!playing); restart(); };
slider.oninput = () => { play(false); show(+slider.value); };
function tick(now) {
  const k = Math.floor((now - since) / 1000 * rate) % frames.length;
  if (playing && k >= 0 && k != +slider.value) show(k);
  requestAnimationFrame(tick);
}
show(0);
requestAnimationFrame(tick);
</script>
</html>
"""


LOOP = 2.4
"""Format: seconds of film in which every mode swings once."""
DPI = 100
"""Format: pixels of a film over an inch of its figure."""
DECAYING = 0.8
"""Format: the part of a loop in which a mode decays or grows; the rest brings it back."""


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
        rows, has_profiles = list(modes.rows(numbers)), is_crowded(modes.scene)
        layout = None if has_profiles else layout_of(modes, rows, np.radians(amplitude_deg))
        figure, axes, width = panels_of(modes, rows, 1.5 if layout is None else layout.ratio, "modes")
        layout = layout and layout.within(width)
        figure.set(dpi=DPI)
        super().__init__(figure, title_of(modes.scene), max(2, round(LOOP * rate)), rate)
        self.panels = [
            _panel(axis, modes, row, layout, np.radians(amplitude_deg)) for axis, row in zip(axes, rows, strict=True)
        ]
        words = [first + _caption(modes, rows)]
        if layout is not None:
            words += set_apart(layout.scaffold, modes.scene.n_pendula)
        caption(figure, "; ".join(words))
        self.show(0)
        figure.draw_without_rendering()
        figure.set_layout_engine("none")

    @property
    def moving(self) -> list[Artist]:
        """The pendula and their carts."""
        return sorted((artist for panel in self.panels for artist in panel.artists), key=Artist.get_zorder)

    def show(self, frame: int) -> None:
        """Update every panel to a frame."""
        for panel in self.panels:
            panel.show(frame / self.count)


@dataclass(eq=False)
class _Panel:
    """A panel: its axis, how its shape moves over the loop, what draws a shape, and what is drawn now."""

    axis: Axes
    shape_at: Callable[[float], Shape]
    draw: Callable[[Axes, Shape], None]
    artists: list[Artist]
    stands: bool

    def show(self, s: float) -> None:
        """Draw the shape at a part of the loop."""
        if self.stands:
            return
        for artist in self.artists:
            artist.remove()
        earlier_artists = set(self.axis.get_children())
        self.draw(self.axis, self.shape_at(s))
        self.artists = [artist for artist in self.axis.get_children() if artist not in earlier_artists]


def _panel(axis: Axes, modes: Modes, row: Mode, layout: ShapeLayout | None, amplitude: float) -> _Panel:
    """The panel of a mode, with its static parts; layout is None where angles are drawn over pendula."""
    shape = modes.shape(modes.index_of(row))
    real = shape.at()

    def shape_at(s: float) -> Shape:
        return shape.at(motion(row, s))

    if layout is None:
        draw = _profile(axis, modes, amplitude)
        return _Panel(axis, shape_at, draw, [], stands=row.omega == 0 or row.is_uncertain)
    draw_rest(axis, layout, real)
    axis.set_axis_off()
    if row.omega == 0:
        draw_translation(axis, layout)
    largest = fitting_amplitude(layout, replace(real, cart=abs(shape.cart), supports=np.abs(shape.supports)), amplitude)

    def hang(axis: Axes, now: Shape) -> None:
        draw_swing(axis, layout, now, largest, {"color": colour(0)})

    return _Panel(axis, shape_at, hang, [], stands=row.omega == 0 or row.is_uncertain)


def motion(row: Mode, s: float) -> complex:
    """The factor of the shape at part `s` of the loop."""
    if row.oscillates:
        return complex(np.exp(-2j * np.pi * s))
    part, low = 1 - s if row.growth_rate else s, float(np.exp(-4))
    if part <= DECAYING:
        return float(low ** (part / DECAYING))
    return float(low + (1 - low) * (0.5 - 0.5 * np.cos(np.pi * (part - DECAYING) / (1 - DECAYING))))


def _profile(axis: Axes, modes: Modes, amplitude: float) -> Callable[[Axes, Shape], None]:
    """An axis of angle over the number of the pendulum, and what draws a line on it for each link of the pendula."""
    levels = levels_of(modes.scene).T
    levels = levels[even_choice(len(levels), HUES)]
    number_pendula(axis, 1, levels.shape[1], float(np.degrees(amplitude)))

    def draw(axis: Axes, now: Shape) -> None:
        for k, level in enumerate(levels):
            angles = np.degrees(amplitude * now.angles[level[level >= 0]])
            axis.plot(np.flatnonzero(level >= 0) + 1, angles, color=colour(k), lw=1.2, zorder=3)

    return draw


def _caption(modes: Modes, rows: Sequence[Mode]) -> str:
    words = ["each mode swings once a loop, whatever its period"]
    if any(row.oscillates and row.damping_ratio for row in rows):
        words += ["the damping of swings is omitted"]
    if any(not row.oscillates and row.omega > 0 for row in rows):
        words += ["modes that do not swing decay or grow, and are brought back at the end of the loop"]
    if any(row.multiplicity > 1 for row in rows):
        words += ["one shape of each repeated mode"]
    if is_crowded(modes.scene):
        words += ["angle over the number of the pendulum"]
        deepest = max(pendulum.n_links for pendulum in modes.scene.pendulum)
        words += [f"{HUES} of {deepest} links of each"] if deepest > HUES else []
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
    the seconds of film done. Raise SceneError for invalid arguments, ComputationError for more modes than one film
    holds and for an MP4 without ffmpeg.
    """
    if problems := form_problems(form, fps):
        raise SceneError(problems)
    chosen = range(min(len(modes), USUAL_PANELS)) if numbers is None else numbers
    if len(chosen) > MOST_PANELS:
        raise ComputationError(
            f"{len(chosen)} modes do not fit in one film: choose at most {MOST_PANELS} modes with `modes`"
        )
    rate = frame_rate(form, fps)
    require_writer(form, round(LOOP * rate))
    with any_letters():
        film = ModalFilm(modes, chosen, rate, amplitude_deg, some_words(modes, numbers))
        write_film(film, stream, form, report)
    return film


def save_film(modes: Modes, path: str | PathLike[str], numbers: Sequence[int] | None = None, **options: Any) -> None:
    """Write the film of `film_modes` to a file, as its name says; the file is complete or absent."""
    form = kind_of(path, FORMS)
    with whole_file(path) as stream:
        film_modes(modes, stream, form, numbers, **options)
