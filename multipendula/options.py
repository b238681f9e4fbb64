"""Arguments shared by several commands, with their shell completion, and converters that check values."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from typing import Any

from multipendula import completion
from multipendula.completion import Completer
from multipendula.flags import FLAGS
from multipendula.parser import Page

PICTURES = ("png", "svg", "pdf")
MOVING = ("gif", "mp4")
FILMS = (*MOVING, "html")
RUNS = ("npz", "csv")
REPORTS = ("text", "markdown", "csv", "json")
SHAPERS = ("zv", "zvd", "ei", "um")
TEXTS = {"text": "txt", "markdown": "md", "latex": "tex", "csv": "csv", "html": "html", "json": "json"}
"""The ending of a file for each format of text."""

# ----------------------------------------------------------------------------------------------- arguments


def add_option(
    group: argparse._ActionsContainer, flag: str, more: str = "", *short: str, **how: Any
) -> argparse.Action:
    """An option of the table: its metavar, and its meaning, after which the page says `more`."""
    metavar, meaning = FLAGS[flag]
    return group.add_argument(flag, *short, metavar=metavar or None, help=f"{meaning}{more}", **how)


def add_switch(group: argparse._ActionsContainer, flag: str, more: str = "", *short: str) -> None:
    """An option of the table without a value."""
    group.add_argument(flag, *short, action="store_true", help=f"{FLAGS[flag][1]}{more}")


def add_scene(
    page: Page, more: str = "", kinds: Sequence[str] = ("toml",), names: Sequence[str] = (), **how: Any
) -> None:
    """The scene; `more` describes what else is accepted, with these endings or names."""
    words = "a scene file, the name of a shipped scene (see `multipendula scenes`), or - for standard input"
    scene = page.asked.add_argument("scene", metavar="SCENE", help=words + more, **how)
    offer(scene, completion.scenes(endings(kinds), names))


def add_run(page: Page) -> None:
    """A scene or a saved run."""
    add_scene(page, f"; or a saved run ({' or '.join(endings(RUNS))})", ("toml", *RUNS))


def add_modes(page: Page, usual: str = "all") -> None:
    """A choice of rows of the table of modes."""
    action = add_option(page.asked, "--modes", f", counted from 1 (default {usual})")
    offer(action, completion.mode_numbers)
    page.rephrase(r"choose (fewer|at most \d+)( modes)?$", r"choose \1 modes with --modes")


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
    group: argparse._ActionsContainer, flag: str, words: Sequence[str], more: str = "", *, comma: str = ",", **how: Any
) -> None:
    """An option with these values, several separated by commas unless `comma` is empty."""
    if comma:
        how.setdefault("action", Joined)
    offer(add_option(group, flag, more, **how), completion.words(words, comma))


def add_start(page: Page, more: str = ", as in simulate") -> None:
    """The initial condition of a motion."""
    instead = "give --start mode:1:5 (mode 1, largest angle 5 deg) or --start angles:10,20,..."
    page.rephrase(r"give another start: .*", instead)
    page.rephrase(r"^(start|angles_deg): has (?=.*(angle|finite))", "--start: has ")
    add_words(page.motion, "--start", ("scene", "mode:", "orbit:", "orbit", "angles:"), more, comma="")


def add_duration(page: Page, more: str, usual: float | None = None) -> None:
    """The duration of a motion."""
    add_option(page.motion, "--duration", more, type=number("seconds above 0"), default=usual)


def add_relative_error(page: Page, more: str) -> None:
    """The relative error of frequencies that is allowed."""
    share = number("at least 1e-16 and at most 0.1", 0.1, 1e-16)
    add_option(page.computed, "--relative-error", more, type=share)


def add_strobes(page: Page, transient: str) -> None:
    """When a driven scene is looked at, and which of its links are drawn; `transient` says how long by default."""
    degrees = number("degrees", least=-sys.float_info.max)
    add_option(page.asked, "--phase-deg", " (default 0)", type=degrees)
    add_option(page.motion, "--settle", f" (default {transient})", type=number("seconds from 0", least=0.0))
    add_outputs(page, ": links, such as theta_1_2 (default the first)")
    page.rephrase(r"^(\S+): must be one of (?=theta_)", r"--of \1: must be one of ")


def add_outputs(page: Page, more: str) -> None:
    """Names of the outputs that are shown."""
    add_option(page.asked, "--of", more, action=Joined)


def add_samples(page: Page) -> None:
    """The number of samples of a motion."""
    add_option(page.motion, "--samples", "", type=whole(100_000_000))
    page.rephrase(r", (\d+) samples$", r", --samples \1")


def add_count(group: argparse._ActionsContainer, flag: str, most: int, more: str = "") -> None:
    """An option with a whole number."""
    add_option(group, flag, more, type=whole(most))


def add_members(page: Page, more: str, most: int) -> None:
    """The size of an ensemble."""
    add_option(page.asked, "--members", more, type=whole(most))


def add_seed(page: Page, more: str = "") -> None:
    """The seed of the random numbers."""
    add_option(page.asked, "--seed", more, type=whole(2**31))


def add_crew(page: Page) -> None:
    """The processes, or the cluster, that compute."""
    add_option(page.computed, "--workers", " (default one per core)", type=whole(1000))
    add_option(page.computed, "--scheduler", ", such as tcp://192.168.0.2:8786")


def add_accuracy(page: Page, more: str = "", **how: Any) -> None:
    """The largest error of an angle."""
    add_option(page.computed, "--accuracy", more, type=number("radians from 1e-14 to 0.3", 0.3, 1e-14), **how)


def add_tolerance(page: Page, least: float = 1e-15, most: float = 0.01) -> None:
    """The tolerance of the integrator."""
    add_option(
        page.computed,
        "--tolerance",
        " (default 1e-9)",
        type=number(f"at least {least:g} and at most {most:g}", most, least),
    )


def add_largest_angle(group: argparse._ActionsContainer, more: str) -> None:
    """How far periodic orbits are followed."""
    add_option(group, "--largest-angle", more, type=number("degrees above 0 and below 180", 179.999))


def add_frequencies(page: Page, more: str) -> None:
    """Frequencies at which numbers are printed."""
    add_option(page.asked, "--at", more, action=Joined, type=frequencies)


def add_input(page: Page, known: Sequence[str], more: str, **how: Any) -> None:
    """Inputs of a linear model."""
    page.rephrase(r"^input(?=[ :])", "--input")
    add_words(page.asked, "--input", known, more, **how)


def add_sample_time(page: Page, more: str) -> None:
    """The sample time of a controller."""
    add_option(page.asked, "--discrete", more, type=number("seconds above 0"))


def add_travel(page: Page, more: str) -> None:
    """A travel of the cart, and how long it takes."""
    add_option(page.asked, "--travel", more, type=number("metres above 0"))
    add_option(page.asked, "--over", " (default that of the hoist)", type=number("seconds above 0"))


def add_shaper(page: Page, more: str, usual: str | None = None) -> None:
    """The kind of input shaper."""
    add_option(page.asked, "--kind", more, choices=SHAPERS, default=usual)


def add_shaped(page: Page, usual: int | None = None) -> None:
    """How many modes a shaper is for."""
    add_option(page.asked, "--count", " (default 1)", type=whole(99999), default=usual)


def add_records(page: Page, more: str = "") -> None:
    """Files of measured motions, which of their rows are used, and what their angles are."""
    words = f"CSV files with time_s and theta_1_1_rad (or _deg), cart_m and the like{more}"
    offer(page.asked.add_argument("data", metavar="DATA.csv", nargs="+", help=words), completion.files((".csv",)))
    add_option(
        page.asked,
        "--where",
        ": those with this value in a column, such as use=identify; repeat for several",
        action=Repeated,
    )
    add_option(page.asked, "--angles", " (default absolute)", choices=("absolute", "relative"), default="absolute")


def add_free(page: Page, more: str) -> None:
    """The numbers of a scene that may change."""
    offer(add_option(page.asked, "--free", more, action=Joined, required=True), completion.places)


def add_spectrum(page: Page, more: str) -> None:
    """A power spectral density."""
    offer(add_option(page.asked, "--psd", more), completion.files((".csv",)))


def add_mode(page: Page, more: str, most: int | None = None) -> None:
    """A row of the table of modes, or several rows."""
    action = add_option(page.asked, "--mode", more, type=whole(100_000), action=Repeated, most=most)
    offer(action, completion.mode_numbers)


def add_vary(page: Page, more: str, most: int | None = None, **how: Any) -> None:
    """Numbers of the scene that take several values."""
    offer(add_option(page.asked, "--vary", more, action=Repeated, most=most, **how), completion.places)


class Repeated(argparse.Action):
    """An option that is given once for each of several values: their list, or the one value where one is the most."""

    def __init__(self, *names: Any, most: int | None = None, **how: Any) -> None:
        super().__init__(*names, **how)
        self.most = most

    def __call__(
        self, parser: argparse.ArgumentParser, namespace: argparse.Namespace, values: Any, option_string: Any = None
    ) -> None:
        """Add to what was given before; ArgumentError where one value is too many."""
        before = getattr(namespace, self.dest)
        if self.most == 1:
            if before is not None:
                raise argparse.ArgumentError(self, "is given twice, and this command takes one")
            setattr(namespace, self.dest, values)
        else:
            setattr(namespace, self.dest, [*(before or ()), values])


class Asked(argparse.Action):
    """A format, and that it was asked for: then the ending of a file does not choose it."""

    def __call__(
        self, parser: argparse.ArgumentParser, namespace: argparse.Namespace, values: Any, option_string: Any = None
    ) -> None:
        """Keep both."""
        namespace.format, namespace.format_asked = values, True


def add_format(page: Page, formats: Sequence[str], more: str = "") -> None:
    """The format of the output."""
    add_option(
        page.written, "--format", more or f" (default {formats[0]})", action=Asked, choices=formats, default=formats[0]
    )
    page.formats = tuple(formats)


def add_covariance(page: Page, words: str) -> None:
    """The covariance of a fitted scene's numbers; `words` say what is done with it."""
    offer(add_option(page.asked, "--covariance", f": {words}"), completion.files((".json",)))


def add_explain(page: Page) -> None:
    """A report of how the result was computed."""
    add_switch(page.written, "--explain")


def add_file(page: Page, flag: str, what: str = "", kinds: Sequence[str] = (), *short: str, **how: Any) -> None:
    """A file to write, of these kinds, of any if there are none; `what` is in it.  The name - is standard output."""
    ends = endings(kinds)
    told = f"{', '.join(ends[:-1])} or {ends[-1]}" if ends[1:] else "".join(ends)
    more = f"{what}, as {told}" if what and told else what or told
    offer(add_option(page.written, flag, f": {more}" if more else "", *short, **how), completion.files(ends))


def add_output(page: Page, what: str, kinds: Sequence[str], **how: Any) -> None:
    """The file of the main result, and what that is."""
    add_file(page, "--output", what, kinds, "-o", **how)


def add_text(page: Page, *, drawn: bool = False, more: Sequence[str] = ()) -> None:
    """A file for the text output, in the format that its name ends in where --format does not choose.

    A figure may be `drawn` there instead (`shared.picture_in_place`), also in `more` formats.
    """
    page.texts = {f".{TEXTS[form]}": form for form in page.formats}
    kinds = [TEXTS[form] for form in page.formats]
    kinds += [*PICTURES, *more] if drawn else []
    add_output(page, "the text or the figure" if drawn else "the text", kinds)
    if drawn:
        page.refused = dict.fromkeys(endings(MOVING), "this command writes text or a figure")
    else:
        page.refused = dict.fromkeys(endings((*PICTURES, *MOVING)), "this command writes text")


def add_quiet(page: Page) -> None:
    """No words beside the result."""
    add_switch(page.written, "--quiet", "", "-q")


def add_motion(page: Page) -> None:
    """A file for a simulated motion."""
    add_output(page, "the motion", RUNS)


def add_picture(page: Page, what: str = "") -> None:
    """A file for a figure beside the main result, and its colours."""
    add_file(page, "--picture", what, PICTURES)
    add_theme(page)


def add_report(page: Page, formats: Sequence[str] = ("text",)) -> None:
    """A file for a figure, or for the text instead, in the one of these formats that its name ends in."""
    page.reports = {f".{TEXTS[form]}": form for form in formats}
    kinds = [*PICTURES, *(TEXTS[form] for form in formats)]
    *most, last = endings(kinds)
    add_output(page, "the figure or the text", kinds)
    add_theme(page)
    page.rephrase(r"\.png, \.svg or \.pdf$", f"{', '.join(most)} or {last}")


def add_theme(page: Page) -> None:
    """The colours of a figure."""
    add_option(page.written, "--theme", " (default light)", choices=("light", "dark"), default="light")


def offer(action: argparse.Action, completer: Completer) -> None:
    """Set the shell completion of an argument."""
    action.completer = completer  # type: ignore[attr-defined]


def endings(kinds: Sequence[str]) -> tuple[str, ...]:
    """The file name endings of these kinds of files."""
    return tuple(f".{kind}" for kind in kinds)


# ---------------------------------------------------------------------------------------------- converters


def number(words: str, most: float = sys.float_info.max, least: float = 5e-324) -> Callable[[str], float]:
    """A converter for numbers in a range, by default all above 0, which `words` describe, their unit first."""

    def converted(text: str) -> float:
        try:
            value = float(text)
        except ValueError:
            value = float("nan")
        if not least <= value <= most:
            raise argparse.ArgumentTypeError(f"{text}: must be a number of {words}")
        return value

    converted.of = words.split(maxsplit=1)[0]  # type: ignore[attr-defined]
    return converted


def whole(most: int) -> Callable[[str], int]:
    """A converter for whole numbers from 1."""

    def converted(text: str) -> int:
        digits = text.isascii() and text.isdigit() and len(text) <= len(str(most))
        if not digits or not 1 <= int(text) <= most:
            raise argparse.ArgumentTypeError(f"{text}: must be a whole number from 1 to {most}")
        return int(text)

    converted.of = "whole number"  # type: ignore[attr-defined]
    return converted


def angles(text: str) -> list[float]:
    """A converter for a comma-separated list of angles in degrees."""
    return [number("degrees above 0 and at most 170", most=170)(word) for word in text.split(",")]


def frequencies(text: str) -> list[float]:
    """A converter for a comma-separated list of frequencies in hertz."""
    return [number("hertz above 0")(word) for word in text.split(",")]
