"""Every option of every command with every value that a user may try."""

from __future__ import annotations

import argparse
import random
from collections.abc import Iterator
from math import cos, exp
from pathlib import Path

from hostility.judge import Ended, run
from multipendula.cli import _parser

SMALL = """gravity = 9.81
[support]
kind = "cart"
mass = 2.0
[[pendulum]]
links = [{ kind = "bob", mass = 1.0, length = 1.0 }, { kind = "rod", mass = 1.0, length = 0.5 }]
start = { angles_deg = [5, 0] }
"""
CLOCK = """gravity = 9.81
[support]
kind = "cart"
mass = 3.0
damping = 0.1
[[pendulum]]
links = [{ kind = "bob", mass = 0.1, length = 0.1, drive = { kind = "van-der-pol", strength = 1e-4, angle_deg = 5 } }]
start = { angles_deg = [5] }
"""
PSD = "frequency_hz,psd\n1,1\n5,1\n"
RECORD = "time_s,acceleration\n0,0\n0.1,1\n0.2,-1\n0.3,0\n"
BASES = {
    "scenes": "",
    "completion": "bash",
    "table": "small.toml",
    "shapes": "small.toml -o a.png",
    "matrices": "small.toml",
    "hoist": "hoisting-crane --samples 3",
    "explain": "small.toml",
    "simulate": "small.toml --duration 0.1",
    "plot": "small.toml --duration 0.1 -o a.png",
    "animate": "small.toml --duration 0.1 --seconds 0.1 -o a.html",
    "play": "small.toml -o a.html",
    "orbits": "small.toml --mode 1 --largest-angle 3",
    "check": "small.toml --modes 1 --amplitudes 1",
    "tradeoff": "small.toml --duration 0.05",
    "chaos": "small.toml --duration 0.5 --members 4",
    "sweep": "small.toml --vary gravity=1:10:2 --workers 1",
    "sync": "clock.toml --duration 1",
    "basins": "small.toml --vary gravity=1:10:2 --vary pendulum[0].links[0].length=1:2:2 --duration 0.1 --workers 1",
    "section": "small.toml --energy 1 --members 2 --duration 1 --workers 1",
    "spread": "small.toml --uncertain gravity=0.1 --members 5",
    "fit": "small.toml modes.csv --free none",
    "poles": "decay.csv",
    "export": "small.toml --to json -o a.json",
    "response": "small.toml -o a.png",
    "shaper": "small.toml",
    "tune": "tower --free pendulum[0].links[0].damping --minimize settling",
    "vibration": "small.toml --psd psd.csv",
    "derive": "small.toml --show matrices",
    "enclose": "small.toml",
}
"""A quick call of each command, to which one word is added."""

NUMBERS = (
    *("0", "1", "2", "-1", "nan", "inf", "-inf", "1e400", "1e-400", "1e9", "99999999999999999999", "1_0", "１"),
    *("1:0", "0:1", "1:2", "2:", ":", "1:1e9", "True", "None"),
)
LETTERS = (
    *("", " ", "-", "--", "---", "=", ",", "a b c", "{0}", "%s", "%(prog)s", "$(touch PWNED)", "`id`", "*", "x" * 5000),
    *("\x1b[31mred", "line\nbreak", "\u202ertl", "\x00", "ü", "\U0001f600"),
)
FILES = (
    *(".", "/", "..", "/dev/full", "/dev/null", "/nowhere/at/all.png", "small.toml", "missing.toml", "broken.npz"),
    *("a.png", "a.svg", "a.csv", "a.npz", "a.exe", "a.png/", "b.mp4", "b.gif", "b.html", ".png", "noending"),
)
WORDS = (
    *("mode:1:5", "mode:0:5", "mode:99:5", "mode:1:nan", "mode:1:1e9", "angles:1,2", "angles:nan,1", "angles:"),
    *("support.mass=1:2:2", "support.mass=nan", "support.mass=0:1:2log", "gravity=1:10:100000000000", "nothing=1:2:2"),
    *("pendulum[99].count=1", "pendulum[*].links[*].mass=1,2", "gravity=", "=1", "cart_force", "angles,angles"),
)
VALUES = (*NUMBERS, *LETTERS, *FILES, *WORDS)


def commands() -> dict[str, argparse.ArgumentParser]:
    """The parser of each command by its name."""
    chosen = next(action for action in _parser()._actions if isinstance(action, argparse._SubParsersAction))
    return dict(chosen.choices)


def calls() -> list[tuple[str, ...]]:
    """Every command with each of its options once for every value, in an order that is the same on each machine."""
    return [call for name, parser in commands().items() for call in _calls(name, parser)]


def _calls(name: str, parser: argparse.ArgumentParser) -> Iterator[tuple[str, ...]]:
    base = BASES[name].split()
    yield (name, *base)
    for action in parser._actions:
        if isinstance(action, argparse._HelpAction):
            continue
        values = (*VALUES, *(action.choices or ()))
        if not action.option_strings:
            yield from ((name, value, *base[1:]) for value in values)
        elif action.nargs == 0:
            yield (name, *base, action.option_strings[-1])
            yield (name, *base, f"{action.option_strings[-1]}=1")
        else:
            option = action.option_strings[0]
            yield from ((name, *base, *_given(option, value)) for value in values)
            yield (name, *base, option)


def _given(option: str, value: str) -> tuple[str, ...]:
    return (f"{option}={value}",) if option.startswith("--") else (option, value)


def case(call: tuple[str, ...], folder: Path, *, patience: float = 10.0) -> Ended:
    """Run one call in a folder that has what the calls of BASES name."""
    prepare(folder)
    binary = any(word == "-" or word.endswith("=-") for word in call)
    return run(call, folder, patience=patience, text=not binary)


def prepare(folder: Path) -> None:
    """Write a small scene, a driven one, a PSD, records, modes and a broken file."""
    (folder / "small.toml").write_text(SMALL, encoding="utf-8")
    (folder / "clock.toml").write_text(CLOCK, encoding="utf-8")
    (folder / "psd.csv").write_text(PSD, encoding="utf-8")
    (folder / "record.csv").write_text(RECORD, encoding="utf-8")
    (folder / "modes.csv").write_text("mode,frequency_hz,std_hz\n1,0.5,0.1\n", encoding="utf-8")
    decay = [f"{t / 50},{exp(-t / 500) * cos(t / 10)}" for t in range(200)]
    (folder / "decay.csv").write_text("\n".join(["time_s,theta_1_1_rad", *decay]), encoding="utf-8")
    (folder / "broken.npz").write_bytes(random.Random(0).randbytes(300))
