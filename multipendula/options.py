"""Arguments shared by several commands, with their shell completion, and converters that check values."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable, Sequence
from typing import Any

from multipendula import completion
from multipendula.completion import Completer
from multipendula.parser import Page

PICTURES = ("png", "svg", "pdf")
MOVING = ("gif", "mp4")
FILMS = (*MOVING, "html")
RUNS = ("npz", "csv")
REPORTS = ("text", "markdown", "csv", "json")
TEXTS = {"text": "txt", "markdown": "md", "latex": "tex", "csv": "csv", "html": "html", "json": "json"}
"""The ending of a file for each format of text."""

# ----------------------------------------------------------------------------------------------- arguments


def add_scene(page: Page, more: str = "", kinds: Sequence[str] = ("toml",), names: Sequence[str] = ()) -> None:
    """The scene; `more` describes what else is accepted, with these endings or names."""
    words = "a scene file, the name of a shipped scene (see `multipendula scenes`), or - for standard input"
    offer(
        page.asked.add_argument("scene", metavar="SCENE", help=words + more), completion.scenes(endings(kinds), names)
    )


def add_run(page: Page) -> None:
    """A scene or a saved run."""
    add_scene(page, f"; or a saved run ({' or '.join(endings(RUNS))})", ("toml", *RUNS))


def add_modes(page: Page, flag: str = "--modes", example: str = "1:10") -> None:
    """A choice of rows of the table of modes."""
    action = page.asked.add_argument(flag, metavar=example, help="only these modes, counted from 1")
    offer(action, completion.mode_numbers)
    page.rephrase(r"choose (fewer|at most \d+)( modes)?$", rf"choose \1 modes with {flag}")


class Joined(argparse.Action):
    """A list separated by commas, to which an option that is given again adds: no value is lost."""

    def __call__(
        self, parser: argparse.ArgumentParser, namespace: argparse.Namespace, values: Any, option_string: Any = None
    ) -> None:
        """Add to what was given before."""
        before = getattr(namespace, self.dest)
        if before != self.default:
            values = f"{before},{values.removeprefix('+')}" if isinstance(values, str) else before + values
        setattr(namespace, self.dest, values)


def add_words(
    group: argparse._ArgumentGroup, flag: str, words: Sequence[str], *, comma: str = ",", **more: Any
) -> None:
    """An option with these values, several separated by commas unless `comma` is empty."""
    if comma:
        more.setdefault("action", Joined)
    offer(group.add_argument(flag, **more), completion.words(words, comma))


def add_start(page: Page, words: str = "as in simulate") -> None:
    """The initial condition of a motion."""
    instead = "give --start mode:1:5 (mode 1, largest angle 5 deg) or --start angles:10,20,..."
    page.rephrase(r"give another start: .*", instead)
    page.rephrase(r"^(start|angles_deg): has (?=.*(angle|finite))", "--start: has ")
    add_words(
        page.motion, "--start", ("scene", "mode:", "orbit:", "orbit", "angles:"), comma="", metavar="WORDS", help=words
    )


def add_duration(page: Page, words: str, usual: float | None = None) -> None:
    """The duration of a motion."""
    seconds = number("seconds above 0")
    page.motion.add_argument("--duration", metavar="SECONDS", type=seconds, default=usual, help=words)


def add_strobes(page: Page, transient: str) -> None:
    """When a driven scene is looked at, and which of its links are drawn; `transient` says how long by default."""
    degrees = number("degrees", least=-sys.float_info.max)
    words = "when in the period of its drives a scene is looked at (default 0)"
    page.asked.add_argument("--phase-deg", metavar="DEG", type=degrees, help=words)
    words = f"how long a motion goes on before strobes are kept (default {transient})"
    page.motion.add_argument("--settle", metavar="SECONDS", type=number("seconds from 0", least=0.0), help=words)
    words = "links whose strobes are drawn, such as theta_1_2 (default: the first)"
    page.asked.add_argument("--of", metavar="NAMES", action=Joined, help=words)
    page.rephrase(r"^(\S+): must be one of (?=theta_)", r"--of \1: must be one of ")


def add_samples(page: Page) -> None:
    """The number of samples of a motion."""
    page.motion.add_argument("--samples", metavar="N", type=whole(100_000_000), help="number of samples to store")
    page.rephrase(r", (\d+) samples$", r", --samples \1")


def add_accuracy(page: Page, words: str, **more: Any) -> None:
    """The largest error of an angle."""
    radians = number("radians from 1e-14 to 0.3", 0.3, 1e-14)
    page.computed.add_argument("--accuracy", metavar="RAD", type=radians, help=words, **more)


class Asked(argparse.Action):
    """A format, and that it was asked for: then the ending of a file does not choose it."""

    def __call__(
        self, parser: argparse.ArgumentParser, namespace: argparse.Namespace, values: Any, option_string: Any = None
    ) -> None:
        """Keep both."""
        namespace.format, namespace.format_asked = values, True


def add_format(page: Page, formats: Sequence[str], **more: Any) -> None:
    """The format of the output."""
    page.written.add_argument("--format", action=Asked, choices=formats, default=formats[0], **more)
    page.formats = tuple(formats)


def add_covariance(page: Page, words: str) -> None:
    """The covariance of a fitted scene's numbers; `words` say what is done with it."""
    told = f"the report of the fit that gave the scene, as JSON: {words}"
    action = page.asked.add_argument("--covariance", metavar="FIT.json", help=told)
    offer(action, completion.files((".json",)))


def add_explain(page: Page) -> None:
    """A report of how the result was computed."""
    words = "report what was computed, and what the scene did not require"
    page.written.add_argument("--explain", action="store_true", help=words)


def add_file(page: Page, *flags: str, words: str = "{}", kinds: Sequence[str] = (), **more: Any) -> None:
    """A file to write; `words` say what for, with {} for these kinds of file; the name - is standard output."""
    *most, last = endings(kinds) or ("",)
    told = words.format(f"a {', '.join(most)} or {last} file" if most else f"a {last} file")
    action = page.written.add_argument(*flags, metavar="FILE", help=f"{told}, or - for standard output", **more)
    offer(action, completion.files(endings(kinds)))


def add_text(page: Page, *, pictures: bool = False) -> None:
    """A file for the text output, in the format that its name ends in where --format does not choose; or a picture."""
    page.texts = {f".{TEXTS[form]}": form for form in page.formats}
    words = "write to this file instead of standard output (-)"
    told = f", by its ending ({', '.join(page.texts)}) in the format" if page.texts else ""
    action = page.written.add_argument(
        "--output", "-o", metavar="FILE", help=words + told, type=str if pictures else file_of_text
    )
    offer(action, completion.files((*page.texts, *(endings(PICTURES) if pictures else ()))))


def add_quiet(page: Page) -> None:
    """No words beside the result."""
    words = "print nothing but the result and errors: no summary beside a file, no notes, no progress"
    page.written.add_argument("-q", "--quiet", action="store_true", help=words)


class Former(argparse.Action):
    """An option with a former name, the last of its own, that still works and says what it is called now."""

    def __call__(
        self, parser: argparse.ArgumentParser, namespace: argparse.Namespace, values: Any, option_string: Any = None
    ) -> None:
        """Keep the value, and a note on the former name."""
        setattr(namespace, self.dest, values)
        if option_string == self.option_strings[-1]:
            now = self.option_strings[0]
            namespace.former = [*getattr(namespace, "former", ()), f"{option_string} is deprecated: it is now {now}"]


def add_motion(page: Page, *flags: str, **more: Any) -> None:
    """A file for a simulated motion."""
    add_file(page, *(flags or ("--output", "-o")), words="save the motion in {}", kinds=RUNS, **more)


def add_picture(page: Page, *flags: str, **more: Any) -> None:
    """A file for a figure, and its colours."""
    add_file(page, *flags, kinds=PICTURES, **more)
    add_theme(page)


def add_report(page: Page, formats: Sequence[str] = ("text",), *flags: str, **more: Any) -> None:
    """A file for a figure, or for the text instead, in the one of these formats that its name ends in."""
    page.reports = {f".{TEXTS[form]}": form for form in formats}
    kinds = [*PICTURES, *(TEXTS[form] for form in formats)]
    *most, last = endings(kinds)
    add_file(page, *(flags or ("--output", "-o")), words="the figure or the text as {}", kinds=kinds, **more)
    add_theme(page)
    page.rephrase(r"\.png, \.svg or \.pdf$", f"{', '.join(most)} or {last}")


def add_theme(page: Page) -> None:
    """The colours of a figure."""
    words = "colours of the figure (default light)"
    page.written.add_argument("--theme", choices=("light", "dark"), default="light", help=words)


def offer(action: argparse.Action, completer: Completer) -> None:
    """Set the shell completion of an argument."""
    action.completer = completer  # type: ignore[attr-defined]


def endings(kinds: Sequence[str]) -> tuple[str, ...]:
    """The file name endings of these kinds of files."""
    return tuple(f".{kind}" for kind in kinds)


# ---------------------------------------------------------------------------------------------- converters


def file_of_text(name: str) -> str:
    """The name of a file of text; no picture's or film's, which would not show what its name says."""
    if os.path.splitext(name)[1].lower() in endings((*PICTURES, *MOVING)):
        raise argparse.ArgumentTypeError(f"{name}: this command writes text")
    return name


def number(words: str, most: float = sys.float_info.max, least: float = 5e-324) -> Callable[[str], float]:
    """A converter for numbers in a range, by default all above 0, which `words` describe."""

    def converted(text: str) -> float:
        try:
            value = float(text)
        except ValueError:
            value = float("nan")
        if not least <= value <= most:
            raise argparse.ArgumentTypeError(f"{text}: must be a number of {words}")
        return value

    return converted


def whole(most: int) -> Callable[[str], int]:
    """A converter for whole numbers from 1."""

    def converted(text: str) -> int:
        digits = text.isascii() and text.isdigit() and len(text) <= len(str(most))
        if not digits or not 1 <= int(text) <= most:
            raise argparse.ArgumentTypeError(f"{text}: must be a whole number from 1 to {most}")
        return int(text)

    return converted


def angles(text: str) -> list[float]:
    """A converter for a comma-separated list of angles in degrees."""
    return [number("degrees above 0 and at most 170", most=170)(word) for word in text.split(",")]
