"""Words that a shell completes: scenes, files of the right kind, places of a scene, and the lists that options take.

argcomplete asks the parser itself.  The lists are written out here, so that completing loads no package that computes;
a test holds them against the packages.
"""

from __future__ import annotations

import argparse
import os
import re
from collections.abc import Callable, Iterable, Iterator
from typing import Any

SHELLS = ("bash", "zsh", "fish", "powershell")
MOST_SHOWN = 30
"""Modes, and entries of a list in a scene, that are offered one by one."""

LISTS = {
    "input": ("cart_force", "cart_acceleration", "cart_velocity", "joint_torques", "link_forces"),
    "output": (
        *("cart_position", "cart_velocity", "angles", "rates", "relative_angles", "relative_rates"),
        *("joint_positions", "tip_positions", "pivot_forces"),
    ),
    "symbolic": ("masses", "lengths", "gravity", "cart"),
    "show": ("lagrangian", "equations", "matrices", "polynomial", "modes"),
    "equilibrium": ("down", "up"),
}
"""Words that are joined by commas."""

WORDS = {
    "to": ("control", "mat", "m", "json", "npz", "csv", "c", "fmu", "modelica"),
    "method": ("auto", "DOP853", "RK45", "RK23", "Radau", "BDF", "LSODA", "taylor"),
    "form": ("auto", "minimal", "maximal", "hamiltonian", "spatial"),
    "start": ("scene", "mode:", "angles:"),
    "measure": (
        *("frequencies", "damping", "splitting", "beat", "amplitude", "energy_drift"),
        *("order", "survivor", "locking", "pendulum_energy"),
    ),
}
"""Words of which one is meant."""

TARGETS = ("chain:", "cart:", "paper:000", "paper:001", "paper:002")
SCENES = (".toml",)
RUNS = (".toml", ".npz", ".csv")

Completer = Callable[..., Iterable[str]]


def completion(options: argparse.Namespace) -> None:
    """Print what a shell needs to complete this command."""
    from argcomplete.shell_integration import shellcode

    print(shellcode(["multipendula"], shell=options.shell))


def complete(parser: argparse.ArgumentParser) -> None:
    """Answer a shell that asks what may follow, and leave."""
    from argcomplete.completers import SuppressCompleter
    from argcomplete.finders import CompletionFinder

    class Finder(CompletionFinder):
        def filter_completions(self, completions: list[str]) -> list[str]:
            """Options only where nothing else may stand."""
            words = [word for word in completions if not word.startswith("-")]
            return super().filter_completions(words or completions)

    _equip(parser)
    Finder()(parser, always_complete_options="long", default_completer=SuppressCompleter())


def _equip(parser: argparse.ArgumentParser) -> None:
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for page in action.choices.values():
                _equip(page)
        elif not action.choices and (found := completer(action)):
            action.completer = found  # type: ignore[attr-defined]


def completer(action: argparse.Action) -> Completer | None:
    """What completes an argument, by what it is called and what its help says of files; None for numbers."""
    if action.metavar == "FILE":
        return _files(tuple(re.findall(r"\.\w+", action.help or "")))
    if action.dest in ("modes", "mode"):
        return _modes if action.metavar != "K" else None
    if action.dest == "vary":
        return _places
    if action.metavar in ("SCENE", "TARGET") or action.dest == "name":
        return _scene(action)
    if action.dest in LISTS:
        return _list(LISTS[action.dest])
    return _list(WORDS[action.dest], comma="") if action.dest in WORDS else None


def shipped() -> list[str]:
    """Names of the shipped scenes, found without loading the package they come with."""
    from importlib.util import find_spec

    found = find_spec("modal")
    folders = (found and found.submodule_search_locations) or ()
    names = [name for folder in folders for name in os.listdir(os.path.join(folder, "scene", "shipped"))]
    return sorted(name.removesuffix(".toml") for name in names if name.endswith(".toml"))


def _scene(action: argparse.Action) -> Completer:
    """Names of shipped scenes, and where a file may stand those of files: of runs too, where its help says so."""
    more = TARGETS if action.metavar == "TARGET" else ()
    files = _files(RUNS if ".npz" in (action.help or "") else SCENES)

    def offered(prefix: str, **_: Any) -> Iterator[str]:
        yield from (*shipped(), *more)
        if action.dest != "name":
            yield from files(prefix)

    return offered


def _list(words: tuple[str, ...], comma: str = ",") -> Completer:
    def offered(prefix: str, **_: Any) -> list[str]:
        before, found, _last = prefix.rpartition(comma) if comma else ("", "", prefix)
        return [f"{before}{found}{word}" for word in words if word not in before.split(",")]

    return offered


def _files(suffixes: tuple[str, ...]) -> Completer:
    """Folders, and files with these suffixes; all files where there is none."""

    def offered(prefix: str, **_: Any) -> Iterator[str]:
        folder, begun = os.path.split(prefix)
        with os.scandir(os.path.expanduser(folder) or ".") as entries:
            for entry in sorted(entries, key=lambda entry: entry.name):
                hidden = entry.name.startswith(".") and not begun.startswith(".")
                if entry.is_dir() and not hidden:
                    yield os.path.join(folder, entry.name) + "/"
                elif not hidden and entry.name.lower().endswith(suffixes or ("",)):
                    yield os.path.join(folder, entry.name)

    return offered


def _modes(prefix: str, parsed_args: argparse.Namespace, **_: Any) -> list[str]:
    """Numbers of a scene's modes, and ranges that begin with the one before a colon."""
    from modal import load, natural_modes

    scene = load(parsed_args.scene)
    count = len(natural_modes(scene)) if scene.n_links <= 10 * MOST_SHOWN else 0
    before, colon, _last = prefix.rpartition(":")
    return [f"{before}{colon}{number}" for number in range(int(before or 1), min(count, MOST_SHOWN) + 1)]


def _places(prefix: str, parsed_args: argparse.Namespace, **_: Any) -> list[str]:
    """The places of a scene's numbers, ready for values."""
    from modal import load
    from modal.scene import describe

    return [f"{place}=" for place in _numbers(describe(load(parsed_args.scene)))]


def _numbers(data: Any, place: str = "") -> Iterator[str]:
    if isinstance(data, dict):
        for key, value in data.items():
            yield from _numbers(value, f"{place}.{key}".removeprefix("."))
    elif isinstance(data, list):
        for index, value in enumerate(data[:MOST_SHOWN]):
            yield from _numbers(value, f"{place}[{index}]")
    elif isinstance(data, int | float) and not isinstance(data, bool):
        yield place
