"""Records of motions, forces and lengths, and power spectral densities (PSDs), in CSV files by names of columns.

    time_s, and one of displacement_m, velocity_m_per_s, acceleration_m_per_s2    (also displacement, velocity, …)
    time_s, and one of force_n, moment_nm    of a force
    time_s, length_m    of a hoist
    frequency_hz, and one of psd (of the acceleration), acceleration_psd, velocity_psd, displacement_psd
    frequency_hz, and one of psd, force_psd, moment_psd    of a force

Any unit after the name of a PSD is taken as SI per hertz.  Lines that begin with # and further columns are passed over.

A file that a scene names is somebody else's choice: what is wrong with it is told without a word of what stands in it.
"""

from __future__ import annotations

import csv
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from math import isfinite
from os import PathLike, fspath
from pathlib import Path
from typing import Any, NamedTuple

from modal.errors import SceneError, spelling_hint
from modal.scene.contents import LARGEST_READ, SIZES_READ, SMALLEST_READ, text_of
from modal.scene.hoist import RECORD
from modal.scene.motion import FORCES, RECORDED, Quantity, spectrum_problems
from modal.scene.supports import ARRAYS, read_matrices

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


class Table(NamedTuple):
    """The numbers under each name of the first line of a file, and whether a message may quote what stands there."""

    name: str
    columns: Mapping[str, tuple[float, ...]]
    has_quotes: bool

    def lacks(self, column_words: str, hint: str = "") -> SceneError:
        """The error of a file without the columns asked for."""
        listing = f"; it has {', '.join(list(self.columns)[:8]) or 'none'}{hint}" if self.has_quotes else ""
        return SceneError([f"{self.name}: needs the columns {column_words}{listing}"])


def read_record(path: str | PathLike[str], acts: bool = False, *, has_quotes: bool = True) -> dict[str, Any]:
    """The fields `time_s` and one quantity of a `RecordMotion`, of a `RecordForce` where it `acts`.

    SceneError, with its name, for any other file; what stands there is quoted in it where it `has_quotes`.
    """
    table = _table(path, has_quotes)
    columns = table.columns
    time = next((name for name in TIMES if name in columns), None)
    words = {key: (key,) for key in FORCES} if acts else {key: (key, word) for key, word in RECORDED.items()}
    quantities = {key: name for key, names in words.items() for name in names if name in columns}
    if time is None or len(quantities) != 1:
        raise table.lacks("time_s and one of " + ", ".join(words))
    key, name = next(iter(quantities.items()))
    return {"time_s": columns[time], key: columns[name]}


def read_lengths(path: str | PathLike[str], *, has_quotes: bool = True) -> dict[str, Any]:
    """The fields `time_s` and `length_m` of a recorded `Hoist`; SceneError as of `read_record`."""
    table = _table(path, has_quotes)
    if not set(RECORD) <= set(table.columns):
        raise table.lacks(" and ".join(RECORD))
    return {name: table.columns[name] for name in RECORD}


def read_spectrum(path: str | PathLike[str], acts: bool = False, *, has_quotes: bool = True) -> Spectrum:
    """The PSD in a file, of a force where it `acts`; SceneError, with the file's name, where it has no possible one."""
    table = _table(path, has_quotes)
    columns = table.columns
    densities = [(name, of) for name in columns if (of := _of_force(name) if acts else _quantity(name))]
    if "frequency_hz" not in columns or len(densities) != 1:
        column_words = f"frequency_hz and one of {', '.join(FORCE_PSDS if acts else (*MOTION_PSDS,))}"
        hint = "" if "frequency_hz" in columns else spelling_hint("frequency_hz", columns)
        raise table.lacks(column_words, hint)
    name, of = densities[0]
    frequencies, psd = columns["frequency_hz"], columns[name]
    problems = list(spectrum_problems(frequencies, psd))
    problems += [f".{name} = {value!r}: must not be negative" for value in psd if value < 0][:1]
    problems += [f".frequency_hz = {value!r}: must not be negative" for value in frequencies if value < 0][:1]
    problems += [f".frequency_hz = {value!r}: {SIZES_READ}" for value in frequencies if 0 < value < SMALLEST_READ][:1]
    if problems:
        raise SceneError([f"{fspath(path)}: {problem.removeprefix('.')}" for problem in problems])
    return Spectrum(frequencies, psd, of)


def _of_force(name: str) -> Quantity | None:
    return "acceleration" if any(name == psd or name.startswith(f"{psd}_") for psd in FORCE_PSDS) else None


def _quantity(name: str) -> Quantity | None:
    if name == "psd" or name.startswith("psd_"):
        return "acceleration"
    return next((of for of in QUANTITIES if name == f"{of}_psd" or name.startswith(f"{of}_psd_")), None)


def _table(path: str | PathLike[str], has_quotes: bool) -> Table:
    name = fspath(path)
    try:
        text = text_of(path, "table")
    except SceneError as error:
        raise SceneError([f"{name}: {problem}" for problem in error.problems]) from None
    lines = [(at, line) for at, line in enumerate(text.splitlines(), 1) if line.strip() and line.lstrip()[0] != "#"]
    if len(lines) > MOST_ROWS:
        raise SceneError([f"{name}: has over {MOST_ROWS} lines"])
    try:
        reader = csv.reader(line for _, line in lines)
        rows = [(lines[reader.line_num - 1][0], row) for row in reader]
    except csv.Error as error:
        raise SceneError([f"{name}: {error}"]) from None
    if not rows:
        raise SceneError([f"{name}: is empty"])
    heads = [head.strip() for head in rows[0][1]]
    known_heads = {*TIMES, *RECORDED, *QUANTITIES, *FORCES, *RECORD, "frequency_hz"}
    positions = [at for at, head in enumerate(heads) if head in known_heads]
    positions += [at for at, head in enumerate(heads) if (_quantity(head) or _of_force(head)) and at not in positions]
    if len({heads[at] for at in positions}) < len(positions):
        raise SceneError([f"{name}: has a column twice"])
    if not positions:
        return Table(name, dict.fromkeys(heads, ()), has_quotes)
    values = [_row(row, f"{name}: line {at}: ", heads, positions, has_quotes) for at, row in rows[1:]]
    columns = zip(*values, strict=True) if values else [()] * len(positions)
    numbers = {heads[at]: tuple(column) for at, column in zip(positions, columns, strict=True)}
    return Table(name, dict.fromkeys(heads, ()) | numbers, has_quotes)


def _row(
    row: Sequence[str], place: str, heads: Sequence[str], positions: Sequence[int], has_quotes: bool
) -> list[float]:
    values = []
    for at in positions:
        text = row[at].strip() if at < len(row) else ""
        try:
            value = float(text)
        except ValueError:
            value = float("nan")
        if not isfinite(value) or abs(value) > LARGEST_READ:
            quotation = f' = "{text[:40]}"' if has_quotes else ""
            limit_words = f" of at most {LARGEST_READ:g}" * isfinite(value)
            raise SceneError([f"{place}{heads[at]}{quotation}: must be a finite number{limit_words}"])
        values.append(value)
    return values


def with_files_read(data: object, folder: Path) -> object:
    """A scene's nested mappings with the numbers of the files that it names, relative to `folder`.

    SceneError names every file that cannot be used, with its place in the scene.
    """
    if not isinstance(data, dict):
        return data
    files, new_data = _Files(folder, []), dict(data)
    for name, change in (("support", files.support), ("ground", files.with_motion), ("force", files.force)):
        if name in data:
            new_data[name] = _change_tables(change, data[name], name)
    if "pendulum" in data:
        hoists = partial(_within, "links", partial(_within, "hoist", files.hoist))
        new_data["pendulum"] = _change_tables(hoists, data["pendulum"], "pendulum")
    if files.problems:
        raise SceneError(files.problems)
    return new_data


Change = Callable[[dict[str, Any], str], Any]
"""What becomes of a table at a place of the scene."""


def _change_tables(change: Change, part: Any, place: str) -> Any:
    """A table changed, or every table of a list, and anything else as it is."""
    if isinstance(part, list):
        return [_change_tables(change, item, f"{place}[{k}]") for k, item in enumerate(part)]
    return change(part, place) if isinstance(part, dict) else part


def _within(key: str, change: Change, part: dict[str, Any], place: str) -> dict[str, Any]:
    """A table with what it has under a key changed."""
    return part | {key: _change_tables(change, part[key], f"{place}.{key}")} if key in part else part


class _Files(NamedTuple):
    """The files that a scene names, relative to a folder; `problems` are those of all so far."""

    folder: Path
    problems: list[str]

    def support(self, part: dict[str, Any], place: str) -> dict[str, Any]:
        """A support with the arrays of its file, or with the numbers of those of its motions."""
        if part.get("kind") != "modal":
            return self.with_motion(part, place)
        new_part = self._read_file(part, place, "file", ARRAYS, _matrices)
        return new_part if new_part is not part else self.with_motion(part, place)

    def with_motion(self, part: dict[str, Any], place: str) -> dict[str, Any]:
        """A support or the ground with the numbers of the files of its motions."""
        return _within("motion", self.motion, part, place)

    def motion(self, part: dict[str, Any], place: str) -> dict[str, Any]:
        """A motion of a support with the numbers of its file."""
        if part.get("kind") == "random":
            return self._read_file(part, place, "psd", ("frequency_hz", "of"), _motion_psd)
        return self._read_file(part, place, "file", ("time_s", *RECORDED), read_record) if _is_record(part) else part

    def force(self, part: dict[str, Any], place: str) -> dict[str, Any]:
        """A force with the numbers of its file."""
        if part.get("kind") == "random":
            return self._read_file(part, place, "psd", ("frequency_hz",), _force_psd)
        return self._read_file(part, place, "file", ("time_s", *FORCES), _force_record) if _is_record(part) else part

    def hoist(self, part: dict[str, Any], place: str) -> dict[str, Any]:
        """A hoist with the numbers of its file."""
        return self._read_file(part, place, "file", RECORD, read_lengths)

    def _read_file(
        self, part: dict[str, Any], place: str, name: str, keys: Sequence[str], reader: Callable[..., dict[str, Any]]
    ) -> dict[str, Any]:
        path = part.get(name)
        if not isinstance(path, str):
            return part
        place = f'{place}.{name} = "{path}"'
        if others := [key for key in keys if key in part]:
            self.problems.append(f"{place}: cannot be combined with {', '.join(others)}")
            return part
        try:
            numbers = reader(self.folder / path, has_quotes=False)
        except SceneError as error:
            prefix = f"{self.folder / path}: "
            self.problems.extend(f"{place}: {problem.removeprefix(prefix)}" for problem in error.problems)
            return part
        return {key: value for key, value in part.items() if key != name} | numbers


def _matrices(path: Path, *, has_quotes: bool) -> dict[str, Any]:
    return read_matrices(path)


def _is_record(part: Mapping[str, Any]) -> bool:
    return part.get("kind") == "record"


def _force_record(path: Path, *, has_quotes: bool) -> dict[str, Any]:
    return read_record(path, True, has_quotes=has_quotes)


def _motion_psd(path: Path, *, has_quotes: bool) -> dict[str, Any]:
    return read_spectrum(path, has_quotes=has_quotes)._asdict()


def _force_psd(path: Path, *, has_quotes: bool) -> dict[str, Any]:
    spectrum = read_spectrum(path, True, has_quotes=has_quotes)
    return {"frequency_hz": spectrum.frequency_hz, "psd": spectrum.psd}
