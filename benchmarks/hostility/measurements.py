"""Files of data with extreme numbers, with names that control a terminal, and what is no file at all.

Every command that reads a file of data gets them: `fit`, `poles`, `spread --covariance`, `vibration`,
and scenes whose hoists, motions and forces name one.
"""

from __future__ import annotations

import json
import os
import random
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from math import cos, exp
from pathlib import Path

from hostility.judge import Ended, run
from hostility.options import SMALL

SIZES = ("1e308", "-1e308", "1e300", "1e200", "1e154", "1e100", "1e60", "1e-60", "1e-160", "1e-200", "1e-300", "5e-324")
ODD = ("", "nan", "inf", "-inf", "0", "-0.0", "1e999", "0x10", "1_0", "1,5", "１", "a", "10" * 200)
NAMES = (
    "\x1b[31mred\x1b[0m",
    "\x9b2J",
    "\x07bell",
    "\u202ertl",
    "line\nbreak",
    "\u2028",
    "=1+1",
    "<b>",
    "ü",
    "a" * 500,
)
HEAD = 'gravity = 9.81\n{}\n[[pendulum]]\nlinks = [{{ kind = "bob", mass = 1.0, length = 1.0{} }}]\n'
MOVED = '[support]\nkind = "moved"\nmotion = {{ kind = {} }}'
NAMING = {
    "hoist": HEAD.format("", ", hoist = { file = PATH }"),
    "motion": HEAD.format(MOVED.format('"record", file = PATH'), ""),
    "psd": HEAD.format(MOVED.format('"random", psd = PATH, seed = 1, duration = 9.0'), ""),
    "force": HEAD.format('[[force]]\non = "pendulum[0].links[0]"\nkind = "record"\nfile = PATH', ""),
}
"""Scenes that name a file."""
READERS = (
    *(
        "fit small.toml PATH --free gravity",
        "poles PATH --scene small.toml",
        "poles PATH",
        "vibration small.toml --record PATH",
    ),
    *("spread small.toml --covariance PATH --members 5", "vibration small.toml --psd PATH"),
    *("table PATH", "simulate PATH --duration 0.1", *(f"table {name}.toml" for name in NAMING)),
)
ENDLESS = (
    "/dev/zero",
    "/dev/urandom",
    "/dev/full",
    "pipe",
    "pipe.npz",
    "pipe.csv",
    "folder",
    "folder.npz",
    "/dev/null",
)
NUMBER = re.compile(r"(?<![\w.])(nan|inf|-inf|Infinity|NaN)(?![\w.])")


def endless(number: int, folder: Path) -> Ended:
    """A device, a pipe without a writer or a folder in place of a file."""
    rng = random.Random(f"endless {number}")
    for name in ENDLESS:
        if name.startswith("pipe"):
            os.mkfifo(folder / name)
        elif name.startswith("folder"):
            (folder / name).mkdir()
    path = rng.choice([name for name in ENDLESS if Path(name).is_absolute() <= Path(name).exists()])
    words = rng.choice(READERS).split()
    if words[:2] == ["table", "PATH"] and path.startswith("pipe"):  # a scene may come through a pipe
        path = "folder"
    return _run(words, path, folder)


def numbers(number: int, folder: Path) -> Ended:
    """Numbers at the ends of double precision, and what is none, in a record, a table of modes or a report."""
    rng = random.Random(f"numbers {number}")
    name, write = rng.choice([*WRITERS.items()])
    (folder / "data.csv").write_text(write(rng), encoding="utf-8")
    return _run(rng.choice(ASKING[name]).split(), "data.csv", folder)


def names(number: int, folder: Path) -> Ended:
    """Names of columns, segments and files that control a terminal."""
    rng = random.Random(f"names {number}")
    name = rng.choice(["modes", "motion"])
    odd = [rng.choice(NAMES) for _ in range(3)]
    rows = [line.split(",") for line in WRITERS[name](random.Random(0)).splitlines()]
    rows = [[*row, odd[1] if k else rng.choice([odd[0], "segment", "theta_1_" + odd[0]])] for k, row in enumerate(rows)]
    path = f"{rng.choice(['data', odd[2].replace('/', '')])[:100]}.csv"
    quoted = "\n".join(",".join('"' + cell.replace('"', '""') + '"' for cell in row) for row in rows)
    (folder / path).write_text(quoted, encoding="utf-8")
    more = rng.choice([[], ["--where", f"{odd[0]}={odd[1]}"]]) if name == "motion" else []
    return _run([*rng.choice(ASKING[name]).split(), *more], path, folder)


def scene_naming(kind: str, path: str) -> str:
    """A scene that names a file in one of the ways of NAMING."""
    return NAMING[kind].replace("PATH", json.dumps(path))


def _run(words: Sequence[str], path: str, folder: Path) -> Ended:
    (folder / "small.toml").write_text(SMALL, encoding="utf-8")
    for name in NAMING:
        (folder / f"{name}.toml").write_text(scene_naming(name, path), encoding="utf-8")
    ended = run([word.replace("PATH", path) for word in words], folder, patience=10.0)
    told = sorted(set(NUMBER.findall(ended.out))) if {"--scene", "spread"} & {*words} else []
    return replace(ended, faults=(*ended.faults, *(f"prints {number}" for number in told)))


# ------------------------------------------------------------------------------------------------ what is written


def _odd(rng: random.Random, usual: float, share: float = 0.15) -> str:
    return rng.choice(rng.choice([SIZES, SIZES, ODD])) if rng.random() < share else repr(usual)


def _motion(rng: random.Random) -> str:
    step, size = (float(rng.choice(["1", "1", "1", *SIZES[1:]])) for _ in range(2))
    share = rng.choice([0.0, 0.01])
    rows = [
        ",".join(
            [
                _odd(rng, 0.02 * k * min(abs(step), 1e306), share),
                *(_odd(rng, swing, share) for swing in _swings(k, size)),
            ]
        )
        for k in range(60)
    ]
    return "\n".join([f"time_s,theta_1_1_rad,{rng.choice(['cart_m', 'theta_1_2_rad'])}", *rows])


def _swings(k: int, size: float) -> Iterator[float]:
    yield 0.05 * exp(-k / 200) * cos(0.06 * k)
    yield max(min(size, 1e306), -1e306) * 0.02 * exp(-k / 200) * cos(0.13 * k + 1)


def _modes(rng: random.Random) -> str:
    head = "mode,frequency_hz,std_hz,damping_ratio,damping_ratio_std,cart,theta_1_1,theta_1_2,shape_std"
    rows = [
        ",".join([str(mode), *(_odd(rng, usual) for usual in (0.6 * mode, 0.01, 0.01, 0.005, 0.1, 1.0, 0.7, 0.02))])
        for mode in (2, 3)
    ]
    return "\n".join([head, *rows])


def _report(rng: random.Random) -> str:
    covariance = [[rng.choice([*SIZES, "1" + "0" * 400, "true", '"a"', "0.01"]) for _ in range(2)] for _ in range(2)]
    places = [("gravity", "9.81"), ("support.mass", "2.0")]
    parameters = [
        f'{{"place": "{place}", "value": {rng.choice([value, value, "1" + "0" * 400, "1e308"])}, "std": 0.1}}'
        for place, value in places
    ]
    rows = ", ".join(f"[{a}, {b}]" for a, b in covariance)
    return f'{{"parameters": [{", ".join(parameters)}], "covariance": [{rows}]}}'


def _columns(first: str, second: str) -> Callable[[random.Random], str]:
    def write(rng: random.Random) -> str:
        step, share = float(rng.choice(["1", "1", *SIZES[2:]])), rng.choice([0.0, 0.1])
        rows = [
            f"{_odd(rng, (k + 1) * min(step, 1e306) / 10, share)},{_odd(rng, 1.0 + k % 3, share)}" for k in range(9)
        ]
        return "\n".join([f"{first},{second}", *rows])

    return write


WRITERS = {
    "motion": _motion,
    "modes": _modes,
    "report": _report,
    "record": _columns("time_s", "acceleration"),
    "psd": _columns("frequency_hz", "psd"),
    "length": _columns("time_s", "length_m"),
}
ASKING = {
    "motion": ("fit small.toml PATH --free gravity", "poles PATH", "poles PATH --format json"),
    "modes": (
        "fit small.toml PATH --free gravity",
        "poles PATH --scene small.toml",
        "poles PATH --scene small.toml --format json",
    ),
    "report": ("spread small.toml --covariance PATH --members 5",),
    "record": ("vibration small.toml --record PATH", "table motion.toml", "simulate motion.toml --duration 0.1"),
    "psd": ("vibration small.toml --psd PATH", "table psd.toml"),
    "length": ("hoist hoist.toml --samples 3", "simulate hoist.toml --duration 0.1"),
}
"""The commands to which a file of each kind is given."""
