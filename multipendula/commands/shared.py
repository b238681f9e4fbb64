"""Helpers of the commands: output files, progress bars, and lists in arguments."""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager
from contextvars import ContextVar
from io import BytesIO, StringIO
from itertools import takewhile
from typing import IO, TYPE_CHECKING, Any, TextIO

import modal
import nonlinear
from multipendula.options import FILMS, PICTURES, endings

if TYPE_CHECKING:
    from modal.identification import Estimate
    from modal.scene import Scene
    from nonlinear.ensembles import Workers

HOUR = 3600.0
"""Physics: seconds of an hour."""
DAYS_MAX = 1e5
"""Limit: days of computing beyond which nothing is begun: "… are begun at most"."""
DURATION_MAX = 1e7
"""Limit: seconds of motion that are begun whatever they take."""
COORDINATE_SECONDS = 9e-5
"""Cost: of the modes of a structure, over the square of its coordinates; `benchmarks/modes.py` measures it."""
PROGRESS_SECONDS = 1.0
"""Format: seconds until progress is shown, and between two updates."""
MEASURED = "{desc}{percentage:3.0f} % |{bar:24}| {remaining} left, {elapsed} passed"
COUNTED = "{desc}{unit}: {n_fmt}, {elapsed} passed"
NUMBERS_SHOWN_MAX = 20
"""Format: numbers of a scene that are named where one has to be chosen."""
MANY_LINKS = 60
"""Cost: links from which a command that integrates disturbances says beforehand that it takes minutes."""

FLAG = re.compile(r"(?<![\w-])(?:--([a-z][a-z-]*)|-(o)\b)")
TEXT: ContextVar[TextIO | None] = ContextVar("TEXT", default=None)
OF_FUNCTION: ContextVar[bool] = ContextVar("OF_FUNCTION", default=False)


def text_stream() -> TextIO:
    """Where text goes: standard output, or its replacement by `text_into`."""
    return TEXT.get() or sys.stdout


def with_keywords(words: str, quote: str = "`") -> str:
    """Words in which every option is called by the keyword that it is of a function.

    >>> with_keywords("--over-hz: needs -o FILE", quote="")
    'over_hz: needs output FILE'
    """
    named = FLAG.sub(lambda flag: f"{quote}{'output' if flag[2] else flag[1].replace('-', '_')}{quote}", words)
    return named.replace("``", "`")


@contextmanager
def text_into(text: StringIO, *, of_function: bool = False) -> Iterator[StringIO]:
    """Collect in it the output of a command, in this thread alone; notes `of_function` name keywords, not options."""
    before, kind = TEXT.set(text), OF_FUNCTION.set(of_function or OF_FUNCTION.get())
    try:
        yield text
    finally:
        TEXT.reset(before)
        OF_FUNCTION.reset(kind)


@contextmanager
def output(path: str | None) -> Iterator[Callable[[str], object]]:
    """A function that writes text to a file, as wide as it is, or to standard output if there is none or for "-"."""
    from modal.report import fitted

    if path is None or path == modal.scene.STANDARD:
        yield getattr(text_stream(), "output", text_stream()).write
        return
    with fitted(None), modal.scene.whole_file(path) as stream:
        texts: list[str] = []
        yield texts.append
        stream.write(encoded(path, "".join(texts)))


def encoded(name: str, text: str) -> bytes:
    """Text as the bytes of a file of this name.

    CSV in a MAT file are its columns; comments at the beginning of a CSV go to a record next to it, FILE.csv.json.
    """
    if name.lower().endswith(".mat"):
        from modal.exports.scripts import columns_of_csv, write_columns

        return write_columns(columns_of_csv(text))
    lines = text.splitlines(keepends=True)
    notes = list(takewhile(lambda line: line.startswith("#"), lines))
    if not notes or not name.lower().endswith(".csv"):
        return text.encode()
    from modal.report import as_json

    with modal.scene.whole_file(f"{name}.json") as stream:
        stream.write(as_json({"notes": [note.removeprefix("# ").rstrip("\n") for note in notes]}).encode())
    return "".join(lines[len(notes) :]).encode()


def write_together(contents: Mapping[str | None, bytes]) -> None:
    """Write the files that have a name: none takes its place before all of them could be written."""
    with ExitStack() as files:
        for path, content in contents.items():
            if path:
                stream = files.enter_context(modal.scene.whole_file(path))
                stream.write(content)
                stream.flush()


def pictured(options: argparse.Namespace, room: str, figure: str, result: object) -> dict[str | None, bytes]:
    """The picture of --picture as the bytes of its file, if it was requested (`draw_in`)."""
    from importlib import import_module

    from modal.plotting import style as pictures

    if not options.picture:
        return {}
    stream = BytesIO()
    with pictures.theme(options.theme):
        pictures.save(getattr(import_module(room), figure)(result), stream, picture(options.picture, "--picture"))
    return {options.picture: stream.getvalue()}


def say(text: str, form: str = "text") -> None:
    """Print lines of text folded to fit the terminal, with nothing in them that controls it."""
    from modal.report import folded, visible

    text_stream().write(folded("\n".join(map(visible, text.split("\n")))) if form == "text" else text)


def made(name: str, words: str) -> None:
    """Name the contents of a written file, unless it was standard output."""
    from modal.report import visible

    if name != modal.scene.STANDARD:
        say(f"{visible(name)}: {words}\n")


def remark(words: object) -> None:
    """Print words next to the result on standard error, with nothing in them that controls a terminal."""
    from modal.report import visible

    told = with_keywords(str(words), quote="") if OF_FUNCTION.get() else str(words)
    text = "multipendula: " + "\n".join(map(visible, told.split("\n")))
    if "tqdm" in sys.modules:
        from tqdm import tqdm

        tqdm.write(text, file=sys.stderr)
    else:
        print(text, file=sys.stderr)


@contextmanager
def drawn(name: str, theme: str) -> Iterator[IO[bytes]]:
    """A file for a figure or a film, with the theme in force."""
    from modal.plotting import style as pictures

    with pictures.theme(theme), modal.scene.files.whole_file(name) as stream:
        yield stream


def draw_in(
    options: argparse.Namespace, name: str | None, room: str, figure: str, *results: object, **how: object
) -> None:
    """Save the figure of results in a file, if there is one, made by the function `figure` of a plotting subpackage."""
    if name:
        from importlib import import_module

        from modal.plotting import save

        with drawn(name, options.theme) as stream:
            save(getattr(import_module(room), figure)(*results, **how), stream, picture(name))


def show(
    options: argparse.Namespace, text: str, figure: str, *results: object, room: str = "nonlinear.plotting"
) -> None:
    """Print the text of results and save their figure; KeyboardInterrupt where Ctrl-C has cut the first one short."""
    say(text, getattr(options, "format", "text"))
    if getattr(results[0], "interrupted", False):
        raise KeyboardInterrupt
    draw_in(options, options.output, room, figure, *results)


def picture(name: str | None, option: str = "-o", kinds: Sequence[str] = PICTURES) -> str:
    """The format of a figure, by its file name; empty if there is none."""
    return modal.scene.kind_of(name, kinds, f"{option} ") if name else ""


def picture_in_place(options: argparse.Namespace) -> None:
    """Take -o for the picture next to the main result where its name ends in a picture's format.

    Raise SceneError for two of them, for a name that is no picture's, and where no folder is.
    """
    if options.output and options.output.lower().endswith(endings(PICTURES)):
        if options.picture:
            raise modal.SceneError([f"-o {options.output}: cannot be a picture as well as --picture {options.picture}"])
        options.picture, options.output = options.output, None
    picture(options.picture, "--picture")
    in_a_folder(options.picture, options.output)


def film_form(name: str, option: str = "-o") -> str:
    """The format of a film, by its file name."""
    return modal.scene.kind_of(name, FILMS, f"{option} ")


def is_new(name: str | None) -> bool:
    """Whether this is the name of a file, or of one to be, and not that of a device."""
    from os.path import exists, isfile

    return bool(name) and "\0" not in str(name) and (isfile(str(name)) or not exists(str(name)))


def scene_bytes(options: argparse.Namespace, scene: Scene) -> bytes:
    """The content of the main file: the scene in the layout of that which was given, with its comments."""
    from pathlib import Path

    from modal.scene.files import dumps_like

    return dumps_like(scene, options.scene, Path(options.output or "").parent).encode() if options.output else b""


def in_a_folder(*paths: str | None, option: str = "-o") -> None:
    """SceneError if the folder of an output file does not exist or it is one, before anything is computed."""
    from pathlib import Path

    for path in filter(None, paths):
        if not Path(path).absolute().parent.is_dir():
            raise modal.SceneError([f"{option} {path}: there is no folder {Path(path).parent}"])
        if Path(path).is_dir():
            raise modal.SceneError([f"{option} {path}: is a folder"])


def validated(options: argparse.Namespace, image: str | None, misfits: Iterable[str]) -> Scene:
    """The scene of a command with --vary, a picture and a film; SceneError names the mistakes in all, and misfits."""
    from modal.scene.parameters import parse_variations

    def refuse_misfits() -> None:
        if problems := list(misfits):
            raise modal.SceneError(problems)

    scene, *_ = nonlinear.integration.validate(
        lambda: modal.load(options.scene),
        lambda: options.vary and parse_variations(options.vary if isinstance(options.vary, list) else [options.vary]),
        refuse_misfits,
        lambda: picture(image),
        lambda: options.film and film_form(options.film, "--film"),
        lambda: in_a_folder(image),
        lambda: in_a_folder(options.film),
    )
    checked: Scene = scene
    return checked


class Progress:
    """The progress of a computation, and an expected time until there is some."""

    def __init__(self, shown: Any = None) -> None:
        self.shown, self.usual = shown, getattr(shown, "bar_format", "")
        self.expected_seconds, self.first = 0.0, 0.0

    def __call__(self, now: float) -> None:
        """So much is done."""
        if self.shown is not None:
            self.look(now)
            self.shown.update(now - self.shown.n)

    def expect(self, seconds: float, done: float = 0.0) -> None:
        """The rest takes about so long, reported at once if over an hour; this share is already done."""
        self.expected_seconds, self.first = seconds, done
        _forewarn(seconds, HOUR)

    def look(self, now: float) -> None:
        """Report the expected time left while there is no progress."""
        left = self.expected_seconds - self.shown.format_dict["elapsed"]
        about = f"about {self.shown.format_interval(left)}"
        self.shown.bar_format = (
            self.usual.replace("{remaining}", about) if now <= self.first and left > 0 else self.usual
        )


@contextmanager
def bar(total: float, unit: str = "s", title: str = "") -> Iterator[Progress]:
    """A progress bar in per cent with the time left, or how many units are done where the total is not known (0).

    It is shown on a terminal only, from one second on, also while nothing is reported.
    """
    if not sys.stderr.isatty():
        yield Progress()
        return
    from threading import Event, Thread

    from tqdm import tqdm

    form = MEASURED if total else COUNTED
    ended = Event()
    with tqdm(
        total=total or None, unit=unit, delay=PROGRESS_SECONDS, leave=False, desc=title or None, bar_format=form
    ) as shown:
        progress = Progress(shown)

        def tick() -> None:
            while not ended.wait(PROGRESS_SECONDS):
                progress.look(shown.n)
                shown.refresh()

        clock = Thread(target=tick, daemon=True)
        clock.start()
        try:
            yield progress
        finally:
            ended.set()
            clock.join()


def crew_of(options: argparse.Namespace) -> AbstractContextManager[Workers]:
    """The executor of independent tasks: the --workers, or those of a --scheduler."""
    return nonlinear.ensembles.workers_at(options.scheduler, options.workers)


@contextmanager
def stages(*titles: str) -> Iterator[list[Callable[[float], object]]]:
    """For each stage of a computation a function that takes the part of it that is done, with a bar for one at a time.

    The bar of the first is there at once, every other at its first report, which ends the one before.
    """
    with ExitStack() as shown:
        reports: dict[str, Callable[[float], object]] = {}

        def opened(title: str) -> Callable[[float], object]:
            if title not in reports:
                shown.close()
                reports[title] = shown.enter_context(bar(1.0, title=title))
            return reports[title]

        opened(titles[0])
        yield [lambda part, title=title: opened(title)(part) for title in titles]  # type: ignore[misc]


def estimate_of(scene: Scene, path: str | None) -> Estimate | None:
    """The covariance of a scene's fitted numbers in a report of `fit`, None if no file is given."""
    if path is None:
        return None
    from modal.identification import read_estimate

    return read_estimate(scene, path)


def noted(scene: Scene, capability: str = "the table of modes") -> Scene:
    """The scene itself; omissions of a capability are reported on standard error."""
    for words in modal.scene.left_out(scene, capability):
        remark(words)
    return scene


def about(scene: Scene) -> Scene:
    """The scene itself; where constant forces move its equilibrium, standard error says so."""
    if "constant_force" in scene.features:
        for words in modal.modes.equilibrium_words(modal.assembly.rig_of(scene)):
            remark(words)
    return scene


def large(scene: Scene) -> Scene:
    """The scene itself; if it has so many support coordinates that its modes take long, that is said first."""
    if scene.is_structured:
        from modal.structure import structure_of

        seconds = COORDINATE_SECONDS * structure_of(scene).size ** 2
        if seconds > 4:
            remark(f"the modes of {structure_of(scene).size} coordinates of supports take some {seconds:.0f} s")
    return scene


def warned(scene: Scene, what: str) -> Scene:
    """The scene itself; where it has so many links that `what` takes long, standard error says so first."""
    if scene.n_links > MANY_LINKS:
        remark(f"{what} of {scene.n_links} links takes minutes: try a smaller scene first")
    return scene


def forewarning(
    report: Callable[[float], object], scene: Scene, duration: float, members: int = 1, least: float = 24 * HOUR
) -> Callable[[float], object]:
    """The report, which at its first call says on standard error how long this many motions take, if over `least` s.

    Raise SceneError for motions that take longer than anyone can wait.
    """
    from functools import cache, partial

    from nonlinear.integration.methods import least_seconds

    seconds = cache(partial(least_seconds, scene, duration, members=members))
    # Shorter ones are begun without an estimate, which takes time, and by which no scene is judged.
    days = seconds() / (24 * HOUR) if duration > DURATION_MAX else 0.0
    if days > DAYS_MAX:
        most = f"{0.9 * duration * DAYS_MAX / days:.0e} s"
        raise modal.SceneError(
            [f"duration: takes an estimated {days:.2g} days on one core, and {most} are begun at most"]
        )
    tell = cache(lambda: _forewarn(seconds(), least))

    def reported(now: float) -> None:
        tell()
        report(now)

    return reported


def _forewarn(seconds: float, least: float) -> None:
    """Say how long a computation is estimated to take, if over `least` s."""
    if seconds > least:
        days = seconds / (24 * HOUR)
        told = f"{days:.2g} days on one core" if days < DAYS_MAX else "time longer than anyone can wait"
        if days <= 1:
            told = f"{seconds / 60:.0f} minutes" if seconds < 2 * HOUR else f"{seconds / HOUR:.0f} hours"
        remark(f"this takes an estimated {told}; Ctrl-C ends it")


def missing(scene: Scene, flag: str, values: str, more: str = "") -> modal.SceneError:
    """The error of a command that needs numbers of a scene and got none: those that there are, with an example.

    In the `values` of the example {half} and {double} stand for those of a number; `more` follows it.
    """
    from shlex import quote

    numbers = [number for number in modal.scene.scene_numbers(scene) if number.is_physical]
    first = next((number for number in numbers if number.place != "gravity"), numbers[0])
    given = first.place + values.format(half=f"{first.value / 2:g}", double=f"{first.value * 2:g}")
    lines = [f"  {number.place} = {number.value:g} {number.unit}" for number in numbers[:NUMBERS_SHOWN_MAX]]
    others = f"{len(numbers) - NUMBERS_SHOWN_MAX} more and " if len(numbers) > NUMBERS_SHOWN_MAX else ""
    return modal.SceneError(
        [
            f"{flag}: is required, such as {flag} {quote(given)}{more}; the scene has",
            *lines,
            f"  and {others}numbers that are 0: `scene_numbers(scene)` lists all",
        ]
    )


def listed(text: str | None) -> tuple[str, ...]:
    """The words of a comma-separated list."""
    return tuple(word.strip() for word in text.split(",")) if text else ()


def chosen(text: str | None, total: int, option: str = "--modes") -> range:
    """Indices from 0 for `first:last`, inclusive and counted from 1; either end, or all of it, may be omitted."""
    if text is None:
        return range(total)
    first, colon, last = text.partition(":")
    try:
        low = int(first) if first or not colon else 1
        high = (int(last) if last else total) if colon else low
    except ValueError:
        raise modal.SceneError([f"{option} {text}: must be a number or a range such as 1:10"]) from None
    if colon and low > high and (last or low <= total):
        raise modal.SceneError([f"{option} {text}: begins after its end"])
    if low < 1:
        raise modal.SceneError([f"{option} {text}: modes are counted from 1"])
    if low > total:
        raise modal.SceneError([f"{option} {text}: the scene has modes 1 to {total}"])
    return range(low - 1, min(high, total))
