"""Files that are read back, with bytes changed: each is refused whole, or gives exactly the numbers written."""

from __future__ import annotations

import random
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

from modal import load as load_scene
from modal.errors import MultipendulaError
from modal.exports.data import read_json, read_npz, write_json, write_npz
from modal.scene.parameters import parse_variations
from modal.statespace import state_space
from nonlinear import files as recordings
from nonlinear import simulate
from nonlinear.sweeps import Study, Sweep, open_checkpoint, parse_measures, sweep
from nonlinear.sweeps import files as sweep_files

DURATION, SAMPLES = 0.5, 20
REFUSED, SAME = "refused", "same"


@dataclass(frozen=True)
class Kind:
    """A kind of file: the bytes of a good one, and the result of reading others in its place, as text to compare."""

    content: bytes
    read: Callable[[bytes], bytes]


@cache
def kinds() -> dict[str, Kind]:
    """One good file of every kind that this project reads back."""
    scene = load_scene("paper-cart-2")
    run, model = simulate(scene, DURATION, output=SAMPLES), state_space(scene)
    study = Study(scene, parse_variations(["support.mass=1:5:6"]), parse_measures(["frequencies"]))
    swept = sweep(study, workers=1)
    good = {}
    for kind in (".npz", ".csv"):
        good[f"run{kind}"] = _saved(recordings.save, recordings.load, run, kind)
        good[f"sweep{kind}"] = _saved(sweep_files.save, sweep_files.load, swept, kind)
    good["model.json"] = Kind(write_json(model), lambda content: write_json(read_json(content)))
    good["model.npz"] = Kind(write_npz(model), lambda content: write_json(read_npz(content)))
    good["sweep.journal"] = Kind(_journal_of(swept), lambda content: _resumed(study, content))
    return good


def case(name: str, number: int) -> tuple[str, str]:
    """Damage a file of a kind in way `number`: the outcome, and the fault, "" where there is none."""
    kind = kinds()[name]
    content = changed(kind.content, random.Random(f"{name}:{number}"))
    try:
        with warnings.catch_warnings(action="error"):
            content_read = kind.read(content)
    except MultipendulaError as error:
        return REFUSED, "" if "\n" not in str(error) else f"a refusal of many lines: {error}"
    except BaseException as error:
        return "failed", f"{name} {number}: {type(error).__name__}: {str(error)[:120]}"
    return SAME, "" if content_read == kind.read(kind.content) else f"{name} {number}: read with other numbers"


def changed(content: bytes, rng: random.Random) -> bytes:
    """Bytes with one to a few bits flipped, a part cut off or omitted, a digit changed, or something inserted."""
    at = rng.randrange(len(content))
    sort = rng.random()
    if sort < 0.5:
        flipped = bytearray(content)
        for place in [at, *(rng.randrange(len(content)) for _ in range(rng.choice([0, 0, 2])))]:
            flipped[place] ^= 1 << rng.randrange(8)
        return bytes(flipped)
    lines = content.splitlines(keepends=True)
    which = rng.randrange(len(lines))
    digits = [place for place, byte in enumerate(content) if 48 <= byte <= 57]
    ways = (
        lambda: content[:at],
        lambda: b"".join(lines[:which]),
        lambda: b"".join(lines[:which] + lines[which + 1 :]),
        lambda: b"".join(lines[: which + 1] + lines[which:]),
        lambda: content[:at] + rng.randbytes(rng.randint(1, 5)) + content[at:],
        lambda: content + rng.choice([b"\n", b"x", content]),
        lambda: _digit(content, rng.choice(digits), rng),
    )
    return rng.choice(ways)()


def _digit(content: bytes, place: int, rng: random.Random) -> bytes:
    return content[:place] + str(rng.randrange(10)).encode() + content[place + 1 :]


def _bytes(save: Callable[..., None], result: object, kind: str) -> bytes:
    with TemporaryDirectory() as folder:
        path = Path(folder) / f"file{kind}"
        save(result, path)
        return path.read_bytes()


def _saved(save: Callable[..., None], load: Callable[[Path], object], result: object, kind: str) -> Kind:
    def read(content: bytes) -> bytes:
        with TemporaryDirectory() as folder:
            path = Path(folder) / f"file{kind}"
            path.write_bytes(content)
            return _bytes(save, load(path), ".csv")

    return Kind(_bytes(save, result, kind), read)


def _journal_of(swept: Sweep) -> bytes:
    with TemporaryDirectory() as folder:
        path = Path(folder) / "file.journal"
        with open_checkpoint(path, swept.study) as kept:
            kept.add(swept.rows[:4])
        return path.read_bytes()


def _resumed(study: Study, content: bytes) -> bytes:
    """The result of a sweep resumed from a journal."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "file.journal"
        path.write_bytes(content)
        with open_checkpoint(path, study) as kept:
            return _bytes(sweep_files.save, sweep(study, journal=kept, workers=1), ".csv")
