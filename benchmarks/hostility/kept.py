"""What is kept between commands and processes: records next to scenes, chunks of ensembles, compiled code."""

from __future__ import annotations

import os
import random
from collections.abc import Callable
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from hostility.damage import changed
from hostility.measurements import scene_naming
from modal import load
from modal.errors import MultipendulaError
from nonlinear import ensemble, simulate, state_at_rest
from nonlinear.files import load as load_run
from nonlinear.files import save
from nonlinear.integration import kernels

TEXT = "from nonlinear.dynamics.compiling import compiled\n\n\n@compiled\ndef run(x):\n    return 2.0 * x + 1.0\n"


def case(number: int) -> tuple[str, list[str]]:
    """One kind of what is kept, changed behind the back of who keeps it: what became of it, and its faults."""
    rng = random.Random(f"kept {number}")
    kind = rng.choice([_record, _chunk, *([_kernel] if find_spec("numba") else [])])
    with TemporaryDirectory() as folder:
        became, fault = kind(rng, Path(folder))
    return became, [f"kept {number}, {kind.__name__}: {fault}"] if fault else []


def _record(rng: random.Random, folder: Path) -> tuple[str, str]:
    """A scene with the record of a hoist, saved with a run; then the record is changed, moved or gone."""
    path, scene = folder / "record.csv", folder / "scene.toml"
    scene.write_text(scene_naming("hoist", str(path)), encoding="utf-8")
    lengths = rng.uniform(0.5, 2.0), rng.uniform(0.5, 2.0)
    seen = []
    for length in lengths:
        path.write_text(f"time_s,length_m\n0,1\n1,{length!r}\n", encoding="utf-8")
        scene_read = load(scene)
        run = simulate(scene_read, 0.2, start=state_at_rest(scene_read, [5.0]), output=3)
        save(run, folder / f"{len(seen)}.npz")
        seen.append(scene_read)
    rng.choice([path.unlink, lambda: path.rename(folder / "elsewhere.csv"), lambda: path.write_bytes(b"\xff")])()
    for k, (scene_read, length) in enumerate(zip(seen, lengths, strict=True)):
        ends = [
            seen_scene.at(1.0).pendulum[0].links[0].length
            for seen_scene in (scene_read, load_run(folder / f"{k}.npz").scene)
        ]
        if not np.allclose(ends, length, rtol=1e-12, atol=0):
            return "stale", f"{ends} m in place of {length} m"
    return "kept apart", ""


@cache
def _whole() -> dict[str, bytes]:
    with TemporaryDirectory() as folder:
        _members(Path(folder), 9.8)
        return {path.name: path.read_bytes() for path in Path(folder).iterdir()}


def _members(folder: Path, last: float) -> Any:
    numbers = {"gravity": np.linspace(1.0, last, 12)}
    members = ensemble(load("chain-1"), 0.2, vary=numbers, engine="numpy", workers=1, folder=folder, chunk=4, check=0)
    return members.final.links


@cache
def _right() -> Any:
    return _members(None, 9.8)  # type: ignore[arg-type]


def _chunk(rng: random.Random, folder: Path) -> tuple[str, str]:
    """A file of an ensemble altered, exchanged with another, of another ensemble, a folder or a pipe."""
    for name, content in _whole().items():
        (folder / name).write_bytes(content)
    name = rng.choice([*_whole()])
    path = folder / name
    deed = rng.randrange(5)
    if deed < 3:
        path.write_bytes(changed(_whole()[name], rng))
    else:
        path.unlink()
        (os.mkfifo, os.mkdir)[deed - 3](path)
    return _answer(lambda: bool(np.array_equal(_members(folder, 9.8), _right())))


def _kernel(rng: random.Random, folder: Path) -> tuple[str, str]:
    """The files of a compiled kernel cut, emptied, altered or without rights."""
    before = os.environ.get("XDG_CACHE_HOME")
    os.environ["XDG_CACHE_HOME"] = str(folder)
    try:
        for _ in range(2):
            kernels._module_of.cache_clear()
            if kernels.module_of(TEXT).run(3.0) != 7.0:
                return "wrong", "another number"
            files = [path for path in folder.rglob("*") if path.is_file()]
            for path in rng.sample(files, rng.randint(1, len(files))):
                content = path.read_bytes()
                path.write_bytes(
                    rng.choice([b"", content[: rng.randrange(len(content) + 1)], changed(content or b"x", rng)])
                )
                path.chmod(rng.choice([0o600, 0o666, 0o000]))
        kernels._module_of.cache_clear()
        return _answer(lambda: bool(kernels.module_of(TEXT).run(3.0) == 7.0))
    finally:
        os.environ.pop("XDG_CACHE_HOME")
        if before is not None:
            os.environ["XDG_CACHE_HOME"] = before


def _answer(right: Callable[[], bool]) -> tuple[str, str]:
    try:
        return ("the same", "") if right() else ("other numbers", "other numbers without a word")
    except MultipendulaError as error:
        return "refused", "a refusal of many lines" if "\n" in str(error) else ""
    except Exception as error:
        return "failed", f"{type(error).__name__}: {str(error)[:120]}"
