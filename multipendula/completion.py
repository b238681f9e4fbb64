"""Shell completion: scenes, files of the right kind, numbers of modes, places in a scene, and lists.

argcomplete calls the completers of the parser's arguments.  No numerical code is loaded unless a scene has to be read.
"""

from __future__ import annotations

import argparse
import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any

OFFERS_MAX = 30
"""Format: modes, and entries of a list in a scene, that are offered one by one."""

Completer = Callable[..., Iterable[str]]


def complete(parser: argparse.ArgumentParser) -> None:
    """Answer a shell's request for completions, and exit."""
    from argcomplete.completers import SuppressCompleter
    from argcomplete.finders import CompletionFinder

    class Finder(CompletionFinder):
        def filter_completions(self, completions: list[str]) -> list[str]:
            """Options only where nothing else is possible."""
            words = [word for word in completions if not word.startswith("-")]
            return super().filter_completions(words or completions)

    Finder()(parser, always_complete_options="long", default_completer=SuppressCompleter())


def begun() -> str:
    """The command that the line to be completed has, empty while it is still being written."""
    line = os.environ.get("COMP_LINE", "")[: int(os.environ.get("COMP_POINT", "0"))]
    words = line.split()
    return words[1] if len(words) > 2 or (len(words) == 2 and line[-1:].isspace()) else ""


def shipped() -> list[str]:
    """Names of the shipped scenes, found without loading their package."""
    from importlib.util import find_spec

    spec = find_spec("modal")
    folders = (spec and spec.submodule_search_locations) or ()
    names = [name for folder in folders for name in os.listdir(os.path.join(folder, "scene", "shipped"))]
    return sorted(name.removesuffix(".toml") for name in names if name.endswith(".toml"))


def names(prefix: str = "", **_: Any) -> list[str]:
    """Names of the shipped scenes."""
    return shipped()


def scenes(suffixes: Sequence[str], more: Sequence[str] = ()) -> Completer:
    """Names of shipped scenes, these words, and files with these suffixes."""

    def offered(prefix: str, **_: Any) -> Iterator[str]:
        yield from (*shipped(), *more, *files(suffixes)(prefix))

    return offered


def words(known: Sequence[str], comma: str = ",") -> Completer:
    """One of these words, or several separated by commas, each once."""

    def offered(prefix: str, **_: Any) -> list[str]:
        before, separator, _last = prefix.rpartition(comma) if comma else ("", "", prefix)
        return [f"{before}{separator}{word}" for word in known if word not in before.split(",")]

    return offered


def extensions(kind: str, fits: Callable[[Any], bool] = lambda _: True) -> Completer:
    """The names of one kind of extensions that fit, those of installed packages among them."""

    def offered(prefix: str, **_: Any) -> list[str]:
        from modal.extend.registry import registered

        return [name for name, known in registered(kind).items() if fits(known)]

    return offered


def files(suffixes: Sequence[str]) -> Completer:
    """Folders, and files with these suffixes; all files if there are none."""

    def offered(prefix: str, **_: Any) -> Iterator[str]:
        folder, begun = os.path.split(prefix)
        with os.scandir(os.path.expanduser(folder) or ".") as entries:
            for entry in sorted(entries, key=lambda entry: entry.name):
                hidden = entry.name.startswith(".") and not begun.startswith(".")
                if entry.is_dir() and not hidden:
                    yield os.path.join(folder, entry.name) + "/"
                elif not hidden and entry.name.lower().endswith(tuple(suffixes) or ("",)):
                    yield os.path.join(folder, entry.name)

    return offered


def mode_numbers(prefix: str, parsed_args: argparse.Namespace, **_: Any) -> list[str]:
    """Numbers of a scene's modes, and ranges that begin with the number before a colon."""
    from modal import load, natural_modes

    scene = load(parsed_args.scene)
    count = len(natural_modes(scene)) if scene.n_links <= 10 * OFFERS_MAX else 0
    before, colon, _last = prefix.rpartition(":")
    return [f"{before}{colon}{number}" for number in range(int(before or 1), min(count, OFFERS_MAX) + 1)]


def places(prefix: str, parsed_args: argparse.Namespace, **_: Any) -> list[str]:
    """The places of a scene's numbers, with an equals sign."""
    from modal import load
    from modal.scene import describe

    return [f"{place}=" for place in _numbers(describe(load(parsed_args.scene)))]


def _numbers(data: Any, place: str = "") -> Iterator[str]:
    if isinstance(data, dict):
        for key, value in data.items():
            yield from _numbers(value, f"{place}.{key}".removeprefix("."))
    elif isinstance(data, list):
        for index, value in enumerate(data[:OFFERS_MAX]):
            yield from _numbers(value, f"{place}[{index}]")
    elif isinstance(data, int | float) and not isinstance(data, bool):
        yield place
