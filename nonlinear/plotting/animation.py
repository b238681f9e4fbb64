"""Animations of a motion: the pendula next to their energies, as an animated GIF, an MP4 or an HTML page.

A long run becomes a short, stroboscopic film, in which fast oscillations appear slow and slow changes become visible.
"""

from __future__ import annotations

import base64
import shutil
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from functools import reduce
from io import BytesIO
from itertools import chain
from math import ceil, pi
from pathlib import Path
from subprocess import DEVNULL, PIPE, Popen
from tempfile import TemporaryDirectory
from textwrap import fill
from typing import IO, Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_rgb
from matplotlib.text import Text
from PIL import Image

from modal.errors import ComputationError, SceneError
from modal.plotting import SMALL, any_letters, colour, ink, muted, paper, sheet
from modal.report import html, visible
from modal.scene import title_of
from modal.types import Floats
from nonlinear.dynamics import children_without_interrupts
from nonlinear.integration import Trajectory
from nonlinear.plotting.artists import Gauges, Scenery
from nonlinear.plotting.scene import energies_of, stage_of
from nonlinear.synchronization import Phases

TRAIL = 0.8
"""Length of a tip's trail in seconds of film."""
SIZE, DPI = (8.0, 4.5), 100
PANEL = (0.02, 0.16, 0.585, 0.72)
"""Left, bottom, width and height of the pendula's panel, as fractions of the figure."""
HALVES = ((0.02, 0.16, 0.47, 0.72), (0.51, 0.16, 0.47, 0.72))
"""The same of the two motions of a film that shows one beside another."""
FPS = {"gif": 20.0, "mp4": 30.0, "html": 20.0}
SECONDS = 20.0
APART = 24  # apparent period of an oscillation in frames
FORMS = ("gif", "mp4", "html")
LONGEST = 20.0
"""Default length of the film in seconds."""
COLOURS, SAMPLED = 64, 6
"""Colours of a GIF, chosen from this many of its frames."""
NEARLY = 8
"""Largest distance of a colour from the background, of 255, at which it is drawn as background."""
MOST_FRAMES = 20_000
NO_FFMPEG = (
    "mp4 needs ffmpeg: install it, or the extra `video` (pip install 'multipendula[video]'); gif and html do not"
)
Report = Callable[[float], object]


class Film:
    """The figure of a trajectory at `times` (F,) in s, updated frame by frame."""

    def __init__(
        self, trajectory: Trajectory, times: Floats, rate: float, speed: float, beside: Trajectory | None = None
    ) -> None:
        self.times, self.rate = times, rate
        self.title = visible(title_of(trajectory.scene))
        self.figure = sheet(*SIZE)
        self.figure.set(dpi=DPI, layout_engine="none")
        self.canvas = FigureCanvasAgg(self.figure)
        stage, panel = stage_of(trajectory, times), PANEL if beside is None else HALVES[0]
        ratio, trail = panel[2] * SIZE[0] / (panel[3] * SIZE[1]), max(1, round(TRAIL * rate))
        self.scenery = Scenery(self.figure.add_axes(panel), stage, ratio, trail)
        self.right: Gauges | Scenery
        if beside is None:
            bars, line = (self.figure.add_axes((0.69, bottom, 0.29, 0.27)) for bottom in (0.58, 0.18))
            self.right = Gauges(bars, line, energies_of(trajectory, times), times)
        else:
            self.right = Scenery(self.figure.add_axes(HALVES[1]), stage_of(beside, times), ratio, trail)
        self._words(_caption(trajectory, len(stage.actors), stage.follows, speed, beside))
        self.moving = sorted([*self.scenery.moving, *self.right.moving, self.clock], key=Artist.get_zorder)
        self.still: tuple[float, Any] | None = None
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
        """Update everything to a frame."""
        self.scenery.show(frame)
        self.right.show(frame)
        self.clock.set_text(f"t = {self.times[frame]:.2f} s")

    def image(self, frame: int) -> Image.Image:
        """One frame: what moves, over what stands still for as long as the camera does."""
        self.show(frame)
        camera = float(self.scenery.stage.camera[frame])
        if not self.still or self.still[0] != camera:
            self.still = camera, self._still()
        self.canvas.restore_region(self.still[1])  # type: ignore[no-untyped-call]
        for artist in self.moving:
            self.figure.draw_artist(artist)
        pixels = np.asarray(self.canvas.buffer_rgba())  # type: ignore[no-untyped-call]
        return Image.fromarray(pixels[..., :3].copy())

    def _still(self) -> Any:
        """The pixels of all that does not move."""
        for artist in self.moving:
            artist.set_animated(True)
        self.canvas.draw()  # type: ignore[no-untyped-call]
        for artist in self.moving:
            artist.set_animated(False)
        return self.canvas.copy_from_bbox(self.figure.bbox)  # type: ignore[no-untyped-call]


def _fit(text: Text, width: float) -> None:
    """Wrap or shrink text until it is no wider than a fraction of the figure."""
    figure = text.get_figure()
    assert figure is not None
    room = width * figure.bbox.width
    if text.get_window_extent().width > 1.6 * room:
        words = text.get_text()
        text.set_text(fill(words, max(20, len(words) * 11 // 20)))
    text.set_fontsize(float(text.get_fontsize()) * min(1.0, room / max(text.get_window_extent().width, 1.0)))


def _caption(trajectory: Trajectory, drawn: int, follows: bool, speed: float, beside: Trajectory | None) -> str:
    system = trajectory.system
    words = ["real time" if speed == 1 else f"{speed:.3g} seconds a second"]
    words += [f"{drawn} of {system.n_pendula} pendula drawn"] if drawn < system.n_pendula else []
    words += ["pivots set apart"] if drawn > 1 else []
    words += ["oblique view, with the shadow on a floor"] if system.spatial else []
    words += ["the camera follows the cart"] if follows else []
    last = "energy above equilibrium" if beside is None else f"left: {trajectory.run.form}; right: {beside.run.form}"
    return "; ".join([*words, last])


def strobe(phases: Phases, form: str) -> dict[str, Any]:
    """The arguments of `animate` for a film of at most SECONDS, whole periods plus 1/APART between frames.

    Runs that are no longer than the film are shown in real time.
    """
    period = float(2 * pi / np.median(phases.omega[:, phases.leading]))
    fps, run = FPS[form], float(phases.times[-1] - phases.times[0])
    swings = ceil(run / (SECONDS * fps * period) - 1 / APART)
    speed = (swings + 1 / APART) * period * fps if run > SECONDS else 1.0
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
    beside: Trajectory | None = None,
    report: Report = lambda done: None,
) -> Shown:
    """Write a film of a trajectory as "gif", "mp4" or "html".

    `fps` is the frame rate (25 in a GIF, else 30; a GIF counts hundredths of a second and takes the nearest possible
    rate), `speed` the seconds of motion per second of film, `seconds` the maximum length of the film (20).  Another
    trajectory of the same duration may be shown `beside` this one, instead of the energies.  `report` is called
    with the seconds of film done.  Raises SceneError for invalid arguments, ComputationError where samples are too far
    apart and for an MP4 without ffmpeg.
    """
    _check(form, fps, speed, seconds)
    executable = _ffmpeg() if form == "mp4" else ""
    rate = _rate(form, fps)
    length = float(trajectory.times[-1] - trajectory.times[0]) / speed
    frames = max(1, int(min(length, seconds or LONGEST) * rate + 1e-9))
    if frames > MOST_FRAMES:
        raise SceneError([f"{frames} frames: must be at most {MOST_FRAMES}; use fewer seconds or fps"])

    def shot(frame: int) -> Image.Image:
        image = film.image(frame)
        report((frame + 1) / rate)
        return image

    with any_letters():
        film = Film(trajectory, trajectory.times[0] + speed / rate * np.arange(frames), rate, speed, beside)
        if form == "gif":
            _write_gif(film, shot, stream)
        elif form == "html":
            _write_html(film, shot, stream)
        else:
            _write_mp4(film, shot, executable, stream)
    motion = min(frames * speed / rate, length * speed)
    return Shown(frames, rate, motion, max(0.0, (length * speed) - motion))


def _check(form: str, fps: float | None, speed: float, seconds: float | None) -> None:
    problems = [] if form in FORMS else [f"{form!r}: a film is one of {', '.join(FORMS)}"]
    if fps is not None and not 1 <= fps <= 60:
        problems.append(f"fps {fps!r}: must be from 1 to 60")
    for name, value in (("speed", speed), ("seconds", seconds)):
        if value is not None and not 0 < value < float("inf"):
            problems.append(f"{name} {value!r}: must be positive")
    if problems:
        raise SceneError(problems)


def _rate(form: str, fps: float | None) -> float:
    if form == "gif":
        return 100.0 / max(2, round(100.0 / (fps or 25.0)))
    return fps or 30.0


def _write_gif(film: Film, shot: Callable[[int], Image.Image], stream: IO[bytes]) -> None:
    """One palette for all frames, so that only what moves is stored."""
    count = len(film.times)
    samples = [np.asarray(film.image(int(k))) for k in np.unique(np.linspace(0, count - 1, SAMPLED).astype(int))]
    palette = _on_paper(Image.fromarray(np.concatenate(samples)).quantize(COLOURS))

    def reduced(frame: int) -> Image.Image:
        return shot(frame).quantize(palette=palette, dither=Image.Dither.NONE)

    rest = map(reduced, range(1, count))
    duration = round(1000 / film.rate)
    reduced(0).save(stream, "GIF", save_all=True, append_images=rest, duration=duration, loop=0, optimize=True)


def _on_paper(image: Image.Image) -> Image.Image:
    """The same palette with colours close to the background replaced by it."""
    colours = np.array(image.getpalette(), dtype=np.uint8).reshape(-1, 3)
    plain = np.round(255 * np.array(to_rgb(paper()))).astype(np.uint8)
    blank = Image.new("RGB", (1, 1), tuple(plain.tolist())).quantize(palette=image, dither=Image.Dither.NONE)
    colours[np.abs(colours.astype(int) - plain).max(1) <= NEARLY] = plain
    colours[np.asarray(blank)] = plain
    image.putpalette(colours.tobytes())
    return image


def _write_mp4(film: Film, shot: Callable[[int], Image.Image], executable: str, stream: IO[bytes]) -> None:
    """Frames go to ffmpeg through a pipe; it never receives Ctrl-C, which this process handles."""
    width, height = film.canvas.get_width_height()
    raw = ["-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{width}x{height}", "-framerate", repr(film.rate)]
    coded = ["-vcodec", "h264", "-pix_fmt", "yuv420p", "-crf", "18", "-movflags", "+faststart"]
    with TemporaryDirectory() as folder:
        path = Path(folder) / "film.mp4"
        try:
            with children_without_interrupts():
                command = [executable, "-loglevel", "error", *raw, "-i", "pipe:", *coded, str(path)]
                encoder = Popen(command, stdin=PIPE, stdout=DEVNULL, stderr=PIPE)
        except OSError as error:
            raise _failed(executable, str(error.strerror)) from None
        with encoder:
            try:
                said = _fed(encoder, (shot(frame).tobytes() for frame in range(len(film.times))))
            except BaseException:
                encoder.kill()
                raise
        if encoder.returncode:
            raise _failed(executable, said or f"it ended with {encoder.returncode}")
        stream.write(path.read_bytes())


def _fed(encoder: Popen[bytes], frames: Iterable[bytes]) -> str:
    """The last message of a program fed with frames; one that has ended is fed no more."""
    assert encoder.stdin
    with suppress(BrokenPipeError):
        for frame in frames:
            encoder.stdin.write(frame)
    said = encoder.communicate()[1].decode(errors="replace").split("\n")
    return next((line.strip() for line in reversed(said) if line.strip()), "")


def _failed(executable: str, words: str) -> ComputationError:
    return ComputationError(f"ffmpeg ({executable}) could not write the film: {words}")


def _ffmpeg() -> str:
    """The program on the path, or the one provided by the extra."""
    found = shutil.which("ffmpeg")
    if found:
        return found
    try:
        from imageio_ffmpeg import get_ffmpeg_exe

        return str(get_ffmpeg_exe())
    except (ImportError, RuntimeError):
        raise ComputationError(NO_FFMPEG) from None


def _write_html(film: Film, shot: Callable[[int], Image.Image], stream: IO[bytes]) -> None:
    """A self-contained page: frames as PNG, a button, a slider."""
    words = {"RATE": f"{film.rate:g}", "INK": ink(), "PAPER": paper(), "HUE": colour(0), "TITLE": html(film.title)}
    head, tail = (reduce(lambda text, pair: text.replace(*pair), words.items(), part) for part in PAGE.split("FRAMES"))
    stream.write(head.encode())
    for part in chain.from_iterable(_embedded(shot(k)) for k in range(len(film.times))):
        stream.write(part)
    stream.write(tail.encode())


def _embedded(image: Image.Image) -> Iterator[bytes]:
    buffer = BytesIO()
    _on_paper(image.quantize(COLOURS, dither=Image.Dither.NONE)).save(buffer, "PNG")
    yield b'"' + base64.b64encode(buffer.getvalue()) + b'",\n'


PAGE = """<!doctype html>
<html lang="en">
<meta charset="utf-8">
<title>TITLE</title>
<style>
body { margin: 2em auto; max-width: 800px; font-family: sans-serif; color: INK; background: PAPER; }
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
