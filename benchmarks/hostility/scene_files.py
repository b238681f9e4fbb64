"""Scene files from wild but valid to random bytes, and the commands that read them."""

from __future__ import annotations

import math
import random
from datetime import date
from pathlib import Path
from typing import Any

import tomli_w

from hostility.judge import Ended, run

BIDI, CLEAR, BELL, CSI = "\u202etxt.toml", "\x1b[2J", "\x07", "\u009b31m"
WORDS = ("", "text", "bob", "cart", "up", "nan", CLEAR, BELL, CSI, BIDI, "<script>alert(1)</script>", "=1+1", "\ufffe")
KEYS = (
    *("mass ", "lenght", "kind", "mass", "title", "", "__class__", "model_config", "a.b", "a" * 3000),
    *(f"{CLEAR}x", f"bell{BELL}", CSI, BIDI, "<script>alert(1)</script>", "@SUM(A1)", "line\nbreak", "ü", "\U0001f600"),
)
NUMBERS = (
    *(math.nan, math.inf, -math.inf, 0, 0.0, -0.0, -1, 1, 2, 1e308, -1e308, 5e-324, 1e-310, 1e16, 1e-16),
    *(10**7, 10**8, 2**63, 10**400, -(10**400), 0.1),
)
OTHERS: tuple[Any, ...] = (True, False, [], {}, [[]], [{}], [1, "a"], {"kind": "bob"}, date(2000, 1, 1), "y" * 100_000)
TITLES = (
    'coding: unicode_escape \\u000aimport os;os.system("touch PWNED") # x',
    *("=HYPERLINK(1)", "]]>&<b>", "'; exit; %", "\\input{x} $%_^~", "*/ int x; /*", "𝔘nicode ünd 漢字", "//"),
)

LIGHT = (
    *(f"table FILE --format {name}" for name in ("text", "markdown", "latex", "csv", "html", "json", "json --shapes")),
    *(
        "table FILE",
        "table - ",
        "table FILE --explain",
        "matrices FILE",
        "matrices FILE --format json",
        "response FILE --gains",
    ),
    *(f"explain FILE --format {name}" for name in ("text", "markdown", "json")),
    *("shaper FILE", "shaper FILE --kind zvd --count 2", "shaper FILE --drive cart_force"),
    *(f"export FILE --to {name} -o out.{name}" for name in ("control", "mat", "m", "json", "npz", "csv", "modelica")),
    *("export FILE --to c --discrete 0.01 -o out.h", "export FILE --to json --minimal -o out.json"),
    *("export FILE --to fmu -o out.fmu", "export FILE --to csv --dominant 1 -o out.csv"),
)
HEAVY = (
    *("simulate FILE --duration 0.05 --samples 5", "simulate FILE --duration 0.05 -o run.npz"),
    "sync FILE --duration 1",
    *("shapes FILE --modes 1:2 -o s.png", "response FILE -o b.svg", "derive FILE --show matrices", "enclose FILE"),
    *("explain FILE -o e.svg", "check FILE --modes 1 --amplitudes 1", "simulate FILE --accuracy 1e-3 --duration 0.1"),
    "sweep FILE --vary gravity=1:10:3 --workers 1 -o sweep.csv",
)
MOST_LETTERS_OF_HEAVY = 3000  # larger files are given to fast commands only


def case(number: int, folder: Path, *, patience: float = 20.0) -> Ended:
    """Make scene file `number`, give it to a command, and judge the result."""
    rng = random.Random(number)
    text = scene_file(rng)
    few = len(text) < MOST_LETTERS_OF_HEAVY
    words = rng.choice(HEAVY if few and rng.random() < 0.04 else LIGHT).split()
    (folder / "scene.toml").write_bytes(text)
    called = [word.replace("FILE", "scene.toml") for word in words]
    return run(called, folder, stdin=text, patience=patience)


def scene_file(rng: random.Random) -> bytes:
    """A scene in TOML: as it is, with a few values replaced, or with its text damaged."""
    scene = wild_scene(rng)
    sort = rng.random()
    for _ in range(0 if sort < 0.3 else rng.choice([1, 1, 1, 2, 3, 8])):
        mutate(scene, rng)
    try:
        text = tomli_w.dumps(scene).encode()
    except (UnicodeEncodeError, ValueError, TypeError):
        text = b"gravity = 1\n"
    return damaged(text, rng) if sort > 0.85 else text


def wild_scene(rng: random.Random) -> dict[str, Any]:
    """The mapping of a scene, nearly always a valid one, with ratios up to 1e±12."""
    spread = rng.choice([0.0, 0.5, 3.0, 12.0, 150.0 if rng.random() < 0.1 else 1.0])

    def size() -> float:
        return float(10.0 ** rng.uniform(-spread, spread))

    plane = rng.random() < 0.85

    def link() -> dict[str, Any]:
        made: dict[str, Any] = {"kind": rng.choice(["bob", "rod", "body"]), "mass": size(), "length": size()}
        if made["kind"] == "body":
            made |= {"centre": size(), "inertia": rng.choice([0.0, size()])}
        for name in ("damping", "stiffness"):
            if rng.random() < 0.15:
                made[name] = rng.choice([0.0, size()])
        if plane and rng.random() < 0.08:
            made["drive"] = {"kind": "van-der-pol", "strength": size(), "angle_deg": rng.uniform(1, 90)}
        elif plane and rng.random() < 0.05:
            made["drive"] = {"kind": "escapement", "impulse": size(), "angle_deg": rng.uniform(0, 90)}
        if rng.random() < 0.1:
            made["count"] = rng.choice([1, 2, 3, 30])
        return made

    def pendulum() -> dict[str, Any]:
        links = [link() for _ in range(rng.choice([1, 1, 2, 2, 3, 6]))]
        number = sum(entry.get("count", 1) for entry in links)
        made: dict[str, Any] = {"links": links}
        if rng.random() < 0.2:
            made["count"] = rng.choice([1, 2, 5, 40, 1000 if rng.random() < 0.1 else 3])
        if rng.random() < 0.15:
            made["equilibrium"] = [rng.choice(["down", "up"]) for _ in range(number)]
        if rng.random() < 0.4:
            made["start"] = {"angles_deg": [rng.choice([0, 90, 180, rng.uniform(-400, 400)]) for _ in range(number)]}
        return made

    made: dict[str, Any] = {"gravity": size(), "pendulum": [pendulum() for _ in range(rng.choice([1, 1, 2, 3]))]}
    if rng.random() < 0.3:
        made["title"] = rng.choice(TITLES)
    if not plane:
        made["space"] = "space"
    if rng.random() < 0.6:
        made["support"] = {"kind": "cart", "mass": rng.choice([0.0, size()])}
        for name in ("damping", "stiffness"):
            if rng.random() < 0.3:
                made["support"][name] = rng.choice([0.0, size()])
    return made


def mutate(scene: dict[str, Any], rng: random.Random) -> None:
    """Replace, remove, add or copy one value somewhere in a nested mapping."""
    part: Any = scene
    while True:
        inner = [value for value in (part.values() if isinstance(part, dict) else part) if value and _nested(value)]
        if not inner or rng.random() < 0.25:
            break
        part = rng.choice(inner)
    if not part:
        return
    value = rng.choice([rng.choice(NUMBERS), rng.choice(WORDS), rng.choice(OTHERS), rng.choice(TITLES)])
    if isinstance(part, list):
        part[rng.randrange(len(part))] = value
    elif (deed := rng.random()) < 0.6:
        part[rng.choice(list(part))] = value
    elif deed < 0.75:
        part.pop(rng.choice(list(part)))
    else:
        part[rng.choice(KEYS)] = value


def _nested(value: object) -> bool:
    return isinstance(value, dict | list)


def damaged(text: bytes, rng: random.Random) -> bytes:
    """A text with bytes changed, cut, doubled or inserted."""
    at = rng.randrange(len(text) + 1)
    end = min(len(text), at + rng.randint(1, 40))
    kinds = (
        text[:at],
        text[:at] + rng.randbytes(rng.randint(1, 8)) + text[end:],
        text[:at] + text[at:end] * rng.randint(2, 50) + text[end:],
        text[:at]
        + rng.choice([b"\0", b"\xff\xfe", b"\r", b"\xe2\x80\xae", b"[" * 3000, b"a." * 3000, b'"""'])
        + text[at:],
        b"\xef\xbb\xbf" + text,
        text.replace(b"\n", b"\r\n"),
        rng.randbytes(200),
        b"",
    )
    return rng.choice(kinds)
