"""Records of motions and forces, and power spectral densities (PSDs), in CSV files by the names of their columns.

    time_s, and one of displacement_m, velocity_m_per_s, acceleration_m_per_s2    (also displacement, velocity, …)
    time_s, and one of force_n, moment_nm    of a force
    frequency_hz, and one of psd (of the acceleration), acceleration_psd, velocity_psd, displacement_psd
    frequency_hz, and one of psd, force_psd, moment_psd    of a force

Any unit after the name of a PSD is taken as SI per hertz.  Lines that begin with # and further columns are passed over.
"""

from __future__ import annotations

import csv
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from math import isfinite
from os import PathLike, fspath
from pathlib import Path
from typing import Any, NamedTuple

from modal.errors import SceneError, meant
from modal.scene.motion import FORCES, RECORDED, Quantity, spectrum_problems
from modal.scene.support_arrays import ARRAYS, read_matrices

LARGEST_FILE = 256_000_000
MOST_ROWS = 2_000_000
TIMES = ("time_s", "time", "t_s")
QUANTITIES: tuple[Quantity, ...] = ("displacement", "velocity", "acceleration")
MOTION_PSDS = ("psd", *(f"{of}_psd" for of in reversed(QUANTITIES)))
FORCE_PSDS = ("psd", "force_psd", "moment_psd")


class Spectrum(NamedTuple):
    """A one-sided PSD `psd` of the support's acceleration, velocity or displacement (`of`) at `frequency_hz`."""

    frequency_hz: tuple[float, ...]
    psd: tuple[float, ...]
    of: Quantity


def read_record(path: str | PathLike[str], acts: bool = False) -> dict[str, Any]:
    """The fields `time_s` and one quantity of a `RecordMotion`, of a `RecordForce` where it `acts`.

    SceneError, with its name, for any other file.
    """
    columns = _columns(path)
    time = next((name for name in TIMES if name in columns), None)
    words = {key: (key,) for key in FORCES} if acts else {key: (key, word) for key, word in RECORDED.items()}
    quantities = {key: name for key, names in words.items() for name in names if name in columns}
    if time is None or len(quantities) != 1:
        asked = "time_s and one of " + ", ".join(words)
        raise SceneError([f"{fspath(path)}: needs the columns {asked}; it has {_listed(columns)}"])
    key, name = next(iter(quantities.items()))
    return {"time_s": columns[time], key: columns[name]}


def read_spectrum(path: str | PathLike[str], acts: bool = False) -> Spectrum:
    """The PSD in a file, of a force where it `acts`; SceneError, with the file's name, where it has no possible one."""
    columns = _columns(path)
    found = [(name, of) for name in columns if (of := _of_force(name) if acts else _quantity(name))]
    if "frequency_hz" not in columns or len(found) != 1:
        asked = f"frequency_hz and one of {', '.join(FORCE_PSDS if acts else (*MOTION_PSDS,))}"
        hint = "" if "frequency_hz" in columns else meant("frequency_hz", columns)
        raise SceneError([f"{fspath(path)}: needs the columns {asked}; it has {_listed(columns)}{hint}"])
    name, of = found[0]
    frequencies, psd = columns["frequency_hz"], columns[name]
    problems = list(spectrum_problems(frequencies, psd))
    problems += [f".{name} = {value!r}: must not be negative" for value in psd if value < 0][:1]
    problems += [f".frequency_hz = {value!r}: must not be negative" for value in frequencies if value < 0][:1]
    if problems:
        raise SceneError([f"{fspath(path)}: {problem.removeprefix('.')}" for problem in problems])
    return Spectrum(frequencies, psd, of)


def _of_force(name: str) -> Quantity | None:
    return "acceleration" if any(name == psd or name.startswith(f"{psd}_") for psd in FORCE_PSDS) else None


def _quantity(name: str) -> Quantity | None:
    if name == "psd" or name.startswith("psd_"):
        return "acceleration"
    return next((of for of in QUANTITIES if name == f"{of}_psd" or name.startswith(f"{of}_psd_")), None)


def _listed(columns: Mapping[str, Any]) -> str:
    return ", ".join(list(columns)[:8]) or "none"


def _columns(path: str | PathLike[str]) -> dict[str, tuple[float, ...]]:
    """The numbers under each name of the first line."""
    name = fspath(path)
    try:
        if Path(name).exists() and not Path(name).is_file():
            raise SceneError([f"{name}: not a file"])
        if Path(name).stat().st_size > LARGEST_FILE:
            raise SceneError([f"{name}: is larger than {LARGEST_FILE} bytes"])
        text = Path(name).read_text(encoding="utf-8-sig")
    except SceneError:
        raise
    except UnicodeDecodeError as error:
        raise SceneError([f"{name}: byte {error.start} is not UTF-8 text"]) from None
    except (OSError, ValueError) as error:
        raise SceneError([f"{name}: cannot be read: {getattr(error, 'strerror', None) or error}"]) from None
    lines = [(at, line) for at, line in enumerate(text.splitlines(), 1) if line.strip() and line.lstrip()[0] != "#"]
    if len(lines) > MOST_ROWS:
        raise SceneError([f"{name}: has over {MOST_ROWS} lines"])
    try:
        rows = list(csv.reader(line for _, line in lines))
    except csv.Error as error:
        raise SceneError([f"{name}: {error}"]) from None
    if not rows:
        raise SceneError([f"{name}: is empty"])
    heads = [head.strip() for head in rows[0]]
    wanted = [at for at, head in enumerate(heads) if head in {*TIMES, *RECORDED, *QUANTITIES, *FORCES, "frequency_hz"}]
    wanted += [at for at, head in enumerate(heads) if (_quantity(head) or _of_force(head)) and at not in wanted]
    if len({heads[at] for at in wanted}) < len(wanted):
        raise SceneError([f"{name}: has a column twice"])
    if not wanted:
        return dict.fromkeys(heads, ())
    values = [_row(name, row, number, heads, wanted) for row, (number, _) in zip(rows[1:], lines[1:], strict=True)]
    columns = zip(*values, strict=True) if values else [()] * len(wanted)
    return dict.fromkeys(heads, ()) | {heads[at]: tuple(own) for at, own in zip(wanted, columns, strict=True)}


def _row(name: str, row: Sequence[str], line: int, heads: Sequence[str], wanted: Sequence[int]) -> list[float]:
    found = []
    for at in wanted:
        text = row[at].strip() if at < len(row) else ""
        try:
            value = float(text)
        except ValueError:
            value = float("nan")
        if not isfinite(value):
            raise SceneError([f'{name}: line {line}: {heads[at]} = "{text[:40]}": must be a finite number'])
        found.append(value)
    return found


def with_files_read(data: object, folder: Path) -> object:
    """A scene's nested mappings with the numbers of the files of its supports, motions and forces in `folder`."""
    if not isinstance(data, dict):
        return data
    support, ground, forces = (data.get(name) for name in ("support", "ground", "force"))
    read = dict(data)
    if support is not None:
        read["support"] = _each(support, "support", lambda one, at: _with_support_read(one, folder, at))
    if isinstance(ground, dict):
        read["ground"] = _with_motion_read(ground, folder, "ground")
    if isinstance(forces, list):
        read["force"] = [_with_file_read(one, folder, f"force[{k}]", True) for k, one in enumerate(forces)]
    return read


def _each(given: Any, place: str, read: Callable[[Any, str], Any]) -> Any:
    """A value or every one of a list as read, each with its place."""
    if isinstance(given, list):
        return [read(one, f"{place}[{k}]") for k, one in enumerate(given)]
    return read(given, place)


def _with_support_read(support: Any, folder: Path, place: str) -> Any:
    """A support with the numbers of its file, or of those of its motions."""
    if not isinstance(support, dict):
        return support
    if support.get("kind") != "modal" or not isinstance(path := support.get("file"), str):
        return _with_motion_read(support, folder, place)
    place = f'{place}.file = "{path}"'
    if others := [key for key in ARRAYS if key in support]:
        raise SceneError([f"{place}: leaves no place for {', '.join(others)}"])
    with _told_at(place, folder / path):
        read = read_matrices(folder / path)
    return {key: value for key, value in support.items() if key != "file"} | read


def _with_motion_read(given: dict[str, Any], folder: Path, place: str) -> dict[str, Any]:
    """A support or the ground with the numbers of the files of its motions."""
    if not (motion := given.get("motion")):
        return given
    return given | {"motion": _each(motion, f"{place}.motion", lambda one, at: _with_file_read(one, folder, at, False))}


@contextmanager
def _told_at(place: str, path: Path) -> Iterator[None]:
    """What is wrong with a file is told where the scene names it."""
    try:
        yield
    except SceneError as error:
        raise SceneError([f"{place}: {problem.removeprefix(f'{path}: ')}" for problem in error.problems]) from None


def _with_file_read(given: Any, folder: Path, place: str, acts: bool) -> Any:
    """One motion, or a force that `acts`, with the numbers of its file."""
    if not isinstance(given, dict):
        return given
    name = {"record": "file", "random": "psd"}.get(str(given.get("kind")), "")
    path = given.get(name)
    if not isinstance(path, str):
        return given
    keys = ("time_s", "frequency_hz", *(FORCES if acts else ("of", *RECORDED)))
    place = f'{place}.{name} = "{path}"'
    if others := [key for key in keys if key in given]:
        raise SceneError([f"{place}: leaves no place for {', '.join(others)}"])
    with _told_at(place, folder / path):
        read = read_record(folder / path, acts) if name == "file" else read_spectrum(folder / path, acts)._asdict()
    if acts:
        read.pop("of", None)
    return {key: value for key, value in given.items() if key != name} | read
