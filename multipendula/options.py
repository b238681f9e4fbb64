"""How values of options are read: kinds of files, words, converters that check, and actions that collect."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from typing import Any

PICTURES = ("png", "svg", "pdf")
MOVING = ("gif", "mp4")
FILMS = (*MOVING, "html")
RUNS = ("npz", "csv")
REPORTS = ("text", "markdown", "csv", "json")
TEXTS = {"text": "txt", "markdown": "md", "latex": "tex", "csv": "csv", "html": "html", "json": "json"}
"""The ending of a file for each format of text."""
SHAPERS = ("zv", "zvd", "zvdd", "zvddd", "mzv", "ei", "ei2", "ei3", "um")
STARTS = ("scene", "mode:", "orbit:", "orbit", "angles:")
METHODS = ("auto", "DOP853", "RK45", "RK23", "Radau", "BDF", "LSODA", "taylor")
FORMS = ("auto", "minimal", "maximal", "hamiltonian", "spatial")
ENGINES = ("auto", "numpy", "numba", "simulate")
LOSSES = ("linear", "soft_l1", "huber", "cauchy")
QUANTITIES = ("peak:", "rms:", "residual", "damping", "settling")
Reader = Callable[[str], Any]


def endings(kinds: Sequence[str]) -> tuple[str, ...]:
    """The file name endings of these kinds of files."""
    return tuple(f".{kind}" for kind in kinds)


# ------------------------------------------------------------------------------------------------- actions


class Joined(argparse.Action):
    """A list separated by commas, to which an option that is given again adds: no value is lost."""

    def __call__(
        self, parser: argparse.ArgumentParser, namespace: argparse.Namespace, values: Any, option_string: Any = None
    ) -> None:
        """Add to the former values."""
        before = getattr(namespace, self.dest)
        if before != self.default:
            values = f"{before},{values.removeprefix('+')}" if isinstance(values, str) else before + values
        setattr(namespace, self.dest, values)


class Repeated(argparse.Action):
    """An option that is given once for each of several values: their list, or the one value where one is the most."""

    def __init__(self, *names: Any, most: int | None = None, **how: Any) -> None:
        super().__init__(*names, **how)
        self.most = most

    def __call__(
        self, parser: argparse.ArgumentParser, namespace: argparse.Namespace, values: Any, option_string: Any = None
    ) -> None:
        """Add to the former values; ArgumentError where one value is too many."""
        before = getattr(namespace, self.dest)
        if self.most == 1:
            if before is not None:
                raise argparse.ArgumentError(self, "is given twice, and this command takes one")
            setattr(namespace, self.dest, values)
        else:
            setattr(namespace, self.dest, [*(before or ()), values])


class Asked(argparse.Action):
    """A format, and that it was requested: then the ending of a file does not choose it."""

    def __call__(
        self, parser: argparse.ArgumentParser, namespace: argparse.Namespace, values: Any, option_string: Any = None
    ) -> None:
        """Keep both."""
        namespace.format, namespace.format_asked = values, True


# ---------------------------------------------------------------------------------------------- converters


def number(words: str, most: float = sys.float_info.max, least: float = 5e-324) -> Callable[[str], float]:
    """A converter for numbers in a range, by default all above 0, which `words` describe, their unit first."""

    def converted(text: str) -> float:
        try:
            value = float(text)
        except ValueError:
            value = float("nan")
        if not least <= value <= most:
            unit = "" if words.startswith("at least") else "a number " if words.startswith("from ") else "a number of "
            raise argparse.ArgumentTypeError(f"{text}: must be {unit}{words}")
        return value

    converted.of = words.split(maxsplit=1)[0]  # type: ignore[attr-defined]
    return converted


def integer(most: int, least: int = 1) -> Callable[[str], int]:
    """A converter for integers."""

    def converted(text: str) -> int:
        digits = text.isascii() and text.isdigit() and len(text) <= len(str(most))
        if not digits or not least <= int(text) <= most:
            raise argparse.ArgumentTypeError(f"{text}: must be a whole number from {least} to {most}")
        return int(text)

    converted.of = "whole number"  # type: ignore[attr-defined]
    return converted


def angles(text: str) -> list[float]:
    """A converter for a comma-separated list of angles in degrees."""
    return [number("degrees above 0 and at most 170", most=170)(word) for word in text.split(",")]


def frequencies(text: str) -> list[float]:
    """A converter for a comma-separated list of frequencies in hertz."""
    return [number("hertz above 0")(word) for word in text.split(",")]


def share(text: str) -> tuple[int, int]:
    """A converter for a share, K/N: which, from 0, of how many."""
    first, _, of = text.partition("/")
    if not (first.isdecimal() and of.isdecimal() and 1 <= int(first) <= int(of)):
        raise argparse.ArgumentTypeError(f"{text}: must be K/N with whole numbers, K from 1 to N")
    return int(first) - 1, int(of)


def band(text: str) -> tuple[float, float]:
    """A converter for a band of frequencies, FROM:TO in hertz."""
    first, colon, last = text.partition(":")
    ends = number("hertz from 0", least=0.0)(first), number("hertz above 0")(last if colon else "")
    if not ends[0] < ends[1]:
        raise argparse.ArgumentTypeError(f"{text}: must run from a frequency to a larger one")
    return ends


def way(text: str) -> float | str:
    """A converter for a distance in metres, or the name of a CSV file of a travel."""
    return text if text.lower().endswith(".csv") else number("metres above 0, or a CSV file")(text)


way.of = "metres"  # type: ignore[attr-defined]


def engine(text: str) -> str:
    """The name of an engine; ArgumentTypeError for one that older versions had."""
    from nonlinear.ensembles.question import RETIRED, WITHOUT_SERIES

    if text == RETIRED:
        raise argparse.ArgumentTypeError(WITHOUT_SERIES.removeprefix("engine "))
    return text
