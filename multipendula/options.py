"""What the arguments of commands share: converters that check them, and common words."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from typing import Any

Add = Callable[[Callable[[argparse.Namespace], None], str], argparse.ArgumentParser]

EXPLAIN = "say what was built for this, and what the scene did not require"
SCENE_HELP = "a scene file, the name of a shipped scene (see `multipendula scenes`), or - for standard input"
FORMATS = ("text", "markdown", "latex", "csv", "html", "json")
RADIANS = ("radians from 1e-14 to 0.3", 0.3, 1e-14)


def pictured(add: argparse.ArgumentParser, *flags: str, **words: Any) -> None:
    """A picture's file under these flags, `words` going to argparse, and its colours."""
    add.add_argument(*flags, metavar="FILE", help="a .png, .svg or .pdf file", **words)
    themed(add)


def themed(add: argparse.ArgumentParser) -> None:
    """The colours of what is drawn."""
    add.add_argument("--theme", choices=("light", "dark"), default="light", help="colours of the picture (light)")


def number(words: str, most: float = sys.float_info.max, least: float = 0.0) -> Callable[[str], float]:
    """A converter of numbers above 0, `words` saying which."""

    def converted(text: str) -> float:
        try:
            value = float(text)
        except ValueError:
            value = float("nan")
        if not (0 < value <= most and value >= least):
            raise argparse.ArgumentTypeError(f"{text}: must be a number of {words}")
        return value

    return converted


def whole(most: int) -> Callable[[str], int]:
    """A converter of whole numbers from 1."""

    def converted(text: str) -> int:
        digits = text.isascii() and text.isdigit() and len(text) <= len(str(most))
        if not digits or not 1 <= int(text) <= most:
            raise argparse.ArgumentTypeError(f"{text}: must be a whole number from 1 to {most}")
        return int(text)

    return converted


def angles(text: str) -> list[float]:
    """A converter of angles in degrees, with commas."""
    return [number("degrees above 0 and at most 170", most=170)(word) for word in text.split(",")]
