"""Records of motions, forces and lengths, and power spectral densities (PSDs), in CSV files by column names.

    time_s, and one of displacement_m, velocity_m_per_s, acceleration_m_per_s2    (also displacement, velocity, …)
    time_s, acceleration_m_per_s2, and one or both of the others: straight lines join it, and the others are checked
    time_s, and one of force_n, moment_nm    of a force
    time_s, length_m    of a hoist
    frequency_hz, and one of psd (of the acceleration), acceleration_psd, velocity_psd, displacement_psd
    frequency_hz, and one of psd, force_psd, moment_psd    of a force

Any unit after the name of a PSD is taken as SI per hertz. Other units are converted where `tables` knows them, and
further columns are ignored.

Messages about a file named in a scene, which may come from others, do not quote its contents.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from itertools import pairwise
from math import isfinite
from os import PathLike, fspath
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from modal.errors import SceneError, refuse_any, spelling_hint
from modal.scene.contents import MEASURED_MAX, MEASURED_MIN, SIZES_READ
from modal.scene.hoist import RECORD
from modal.scene.length_laws import integrated_law
from modal.scene.motion import FORCES, RECORDED, Quantity
from modal.scene.supports import ARRAYS, read_matrices
from modal.scene.tables import DataTable, in_si, read_table, time_unit
from modal.scene.validation import curve_problems
from modal.types import Floats

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
    """The numbers under each name of the first line of a file, and whether a message may quote its contents."""

    name: str
    columns: Mapping[str, tuple[float, ...]]
    has_quotes: bool

    def lacks(self, column_words: str, hint: str = "") -> SceneError:
        """Return the error of a file without the required columns."""
        listing = f"; it has {', '.join(list(self.columns)[:8]) or 'none'}{hint}" if self.has_quotes else ""
        return SceneError([f"{self.name}: needs the columns {column_words}{listing}"])


def read_record(
    path: str | PathLike[str],
    acts: bool = False,
    *,
    has_quotes: bool = True,
    columns: Mapping[str, str] | None = None,
) -> dict[str, Any]:
    """Return `time_s` and one quantity of a `RecordMotion`, or of a `RecordForce` if it `acts`.

    Of a motion that is recorded several times over it is the acceleration, joined by straight lines; its velocity and
    its displacement must be what these give from rest, up to what the acceleration may do between two samples.

    `columns` says what columns with other headings hold, such as {"t": "time_ms", "left": "moment_nm"}.  SceneError,
    with its name, for any other file; what stands there is quoted in it where it `has_quotes`.
    """
    table = _table(path, has_quotes, columns)
    numbers = table.columns
    time = next((name for name in TIMES if name in numbers), None)
    words = {key: (key,) for key in FORCES} if acts else {key: (key, word) for key, word in RECORDED.items()}
    quantities = {key: name for key, names in words.items() for name in names if name in numbers}
    highest = list(RECORDED)[-1]
    if time is None or not quantities or (len(quantities) > 1 and highest not in quantities):
        raise table.lacks("time_s and one of " + ", ".join(words))
    if len(quantities) == 1:
        key, name = next(iter(quantities.items()))
        return {"time_s": numbers[time], key: numbers[name]}
    times, acceleration = numbers[time], numbers[quantities.pop(highest)]
    if all(earlier < later for earlier, later in pairwise(times)):
        recorded = {key: np.array(numbers[name]) for key, name in quantities.items()}
        _refuse_contradictions(table, np.array(times), np.array(acceleration), recorded)
    return {"time_s": times, highest: acceleration, "interpolation": "linear"}


def _refuse_contradictions(table: Table, times: Floats, acceleration: Floats, recorded: Mapping[str, Floats]) -> None:
    """SceneError for a displacement or a velocity that this acceleration, joined by straight lines, has not from rest.

    Between two samples it may be anywhere between them, and numbers are written to three digits at least.
    """
    h, change = np.diff(times), np.abs(np.diff(acceleration))
    way = integrated_law(np.append(times, times[-1] + 1.0), acceleration, np.append(np.diff(acceleration) / h, 0.0))
    speed_error = np.concatenate(([0.0], np.cumsum(change * h / 2)))
    way_error = np.concatenate(([0.0], np.cumsum(speed_error[:-1] * h + change * h**2 / 2)))
    integrals = dict(zip(RECORDED, zip(way(times), (way_error, speed_error), strict=False), strict=False))
    problems = []
    for key, values in recorded.items():
        expected, error = integrals[key]
        excess = np.abs(values - expected) - error - 1e-3 * np.abs(values).max()
        worst = int(excess.argmax())
        if excess[worst] > 0:
            at = f": {values[worst]:.6g} at {times[worst]:.6g} s, not {expected[worst]:.6g}" * table.has_quotes
            problems.append(f"{table.name}: {key} is not what acceleration_m_per_s2 gives from rest{at}")
    refuse_any(problems)


def read_lengths(
    path: str | PathLike[str], *, has_quotes: bool = True, columns: Mapping[str, str] | None = None
) -> dict[str, Any]:
    """Return `time_s` and `length_m` of a recorded `Hoist`; raise SceneError as `read_record` does.

    Of the file that `hoist -o` writes, the one `length_P_I_m`.
    """
    table = _table(path, has_quotes, columns)
    lengths = [name for name in table.columns if name.startswith("length_") and name.endswith("_m")]
    if "time_s" in table.columns and lengths and RECORD[1] not in lengths:
        if len(lengths) == 1:
            return read_lengths(path, has_quotes=has_quotes, columns={**(columns or {}), lengths[0]: RECORD[1]})
        choice = f'{{ {lengths[0]} = "{RECORD[1]}" }}'
        raise table.lacks(f"{' and '.join(RECORD)}: of {', '.join(lengths)} choose one, such as columns = {choice}")
    if not set(RECORD) <= set(table.columns):
        is_travel = not set(RECORDED).isdisjoint(table.columns)
        of_travel = ", that of a rope: this is the travel of a cart, as a moved support takes it"
        raise table.lacks(" and ".join(RECORD) + of_travel * is_travel)
    return {name: table.columns[name] for name in RECORD}


def read_spectrum(
    path: str | PathLike[str],
    acts: bool = False,
    *,
    has_quotes: bool = True,
    columns: Mapping[str, str] | None = None,
) -> Spectrum:
    """The PSD in a file, of a force if it `acts`; raise SceneError, with the file's name, without a valid one."""
    table = _table(path, has_quotes, columns)
    numbers = table.columns
    densities = [(name, of) for name in numbers if (of := _of_force(name) if acts else _quantity(name))]
    if "frequency_hz" not in numbers or len(densities) != 1:
        column_words = f"frequency_hz and one of {', '.join(FORCE_PSDS if acts else (*MOTION_PSDS,))}"
        hint = "" if "frequency_hz" in numbers else spelling_hint("frequency_hz", numbers)
        raise table.lacks(column_words, hint)
    name, of = densities[0]
    frequencies, psd = numbers["frequency_hz"], numbers[name]
    problems = list(curve_problems("frequency_hz", "psd", frequencies, psd, least=2))
    problems += [f".{name} = {value!r}: must not be negative" for value in psd if value < 0][:1]
    problems += [f".frequency_hz = {value!r}: must not be negative" for value in frequencies if value < 0][:1]
    problems += [f".frequency_hz = {value!r}: {SIZES_READ}" for value in frequencies if 0 < value < MEASURED_MIN][:1]
    if problems:
        raise SceneError([f"{fspath(path)}: {problem.removeprefix('.')}" for problem in problems])
    return Spectrum(frequencies, psd, of)


def read_gains(
    path: str | PathLike[str], *, has_quotes: bool = True, columns: Mapping[str, str] | None = None
) -> dict[str, Any]:
    """Return `gains` of a `Feedback`, with a column for each state and a row for each input.

    SceneError as of `read_record`.
    """
    table = read_table(path, has_quotes=has_quotes).renamed(columns or {})
    numbers = np.array([table.numbers(column) for column in table.columns]).T
    if not numbers.size:
        raise SceneError([f"{table.name}: needs a line with the names of states, and a row of numbers for each input"])
    refuse_any([words for column in table.columns for words in _sizes(table, column, table.numbers(column))][:1])
    return {"gains": {"states": list(table.columns), "rows": numbers.tolist()}}


def _of_force(name: str) -> Quantity | None:
    return "acceleration" if any(name == psd or name.startswith(f"{psd}_") for psd in FORCE_PSDS) else None


def _quantity(name: str) -> Quantity | None:
    if name == "psd" or name.startswith("psd_"):
        return "acceleration"
    return next((of for of in QUANTITIES if name == f"{of}_psd" or name.startswith(f"{of}_psd_")), None)


def _table(path: str | PathLike[str], has_quotes: bool, meanings: Mapping[str, str] | None) -> Table:
    """The known columns of a file in SI units, and the names of all others without numbers."""
    table = read_table(path, has_quotes=has_quotes).renamed(meanings or {})
    if not table.columns:
        raise SceneError([f"{table.name}: is empty"])
    known_columns = {*TIMES, *RECORDED, *QUANTITIES, *FORCES, *RECORD, "frequency_hz"}
    numbers, others, problems = dict[str, tuple[float, ...]](), list[str](), list[str]()
    for column in table.columns:
        name, factor = in_si(column)
        seconds = time_unit(column)
        if seconds is not None:
            name, factor = "time_s", seconds
        if name not in known_columns and not _quantity(name) and not _of_force(name):
            others.append(column)
        elif name in numbers:
            problems.append(f"{table.name}: has a column twice")
        else:
            values = factor * table.numbers(column)
            problems += [*_sizes(table, column, values)][:1]
            numbers[name] = tuple(values.tolist())
    refuse_any(problems)
    return Table(table.name, numbers | dict.fromkeys(others, ()), has_quotes)


def _sizes(table: DataTable, column: str, values: Floats) -> Iterator[str]:
    """Numbers that are missing, or too large to be squared."""
    for row in np.flatnonzero(~(np.abs(values) <= MEASURED_MAX)):
        cell = table.words(column)[row] if table.has_quotes else ""
        quotation = f' = "{cell[:40]}"' if table.has_quotes else ""
        limit = f" of at most {MEASURED_MAX:g}" * isfinite(values[row])
        yield f"{table.name}: line {table.lines[row]}, {column}{quotation}: must be a finite number{limit}"


def with_files_read(data: object, folder: Path) -> object:
    """Return a scene's nested mappings with the numbers of the files that it names, relative to `folder`.

    Raise SceneError with every file that cannot be used and its place in the scene.
    """
    if not isinstance(data, dict):
        return data
    files, new_data = _Files(folder, []), dict(data)
    for name, change in (
        ("support", files.support),
        ("ground", files.with_motion),
        ("force", files.force),
        ("feedback", files.feedback),
    ):
        if name in data:
            new_data[name] = _change_tables(change, data[name], name)
    if "pendulum" in data:
        hoists = partial(_within, "links", partial(_within, "hoist", files.hoist))
        new_data["pendulum"] = _change_tables(hoists, data["pendulum"], "pendulum")
    if files.problems:
        raise SceneError(files.problems)
    return new_data


Change = Callable[[dict[str, Any], str], Any]
"""The replacement of a table at a place of the scene."""


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
        new_part = self._read_file(part, place, "file", ARRAYS, lambda path, **options: read_matrices(path))
        return new_part if new_part is not part else self.with_motion(part, place)

    def with_motion(self, part: dict[str, Any], place: str) -> dict[str, Any]:
        """A support or the ground with the numbers of the files of its motions."""
        return _within("motion", self.motion, part, place)

    def motion(self, part: dict[str, Any], place: str) -> dict[str, Any]:
        """A motion of a support with the numbers of its file."""
        if part.get("kind") == "random":
            return self._read_file(part, place, "psd", ("frequency_hz", "of"), _psd)
        if part.get("kind") == "record":
            return self._read_file(part, place, "file", ("time_s", *RECORDED), read_record)
        return part

    def force(self, part: dict[str, Any], place: str) -> dict[str, Any]:
        """A force with the numbers of its file."""
        if part.get("kind") == "random":
            return self._read_file(part, place, "psd", ("frequency_hz",), partial(_psd, acts=True))
        if part.get("kind") == "record":
            return self._read_file(part, place, "file", ("time_s", *FORCES), partial(read_record, acts=True))
        return part

    def hoist(self, part: dict[str, Any], place: str) -> dict[str, Any]:
        """A hoist with the numbers of its file."""
        return self._read_file(part, place, "file", RECORD, read_lengths)

    def feedback(self, part: dict[str, Any], place: str) -> dict[str, Any]:
        """A loop with the gains of its file."""
        return self._read_file(part, place, "gains", ("output", "gain"), read_gains)

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
        meanings = part.get("columns", {})
        if not isinstance(meanings, dict) or not all(isinstance(word, str) for word in meanings.values()):
            self.problems.append(
                f'{place.partition(" = ")[0].rpartition(".")[0]}.columns: must be a table, such as {{ t = "time_s" }}'
            )
            return part
        try:
            numbers = reader(self.folder / path, has_quotes=False, columns=meanings)
        except SceneError as error:
            prefix = f"{self.folder / path}: "
            self.problems.extend(f"{place}: {problem.removeprefix(prefix)}" for problem in error.problems)
            return part
        return numbers | {key: value for key, value in part.items() if key not in (name, "columns")}


def _psd(path: Path, *, has_quotes: bool, columns: Mapping[str, str], acts: bool = False) -> dict[str, Any]:
    record = read_spectrum(path, acts, has_quotes=has_quotes, columns=columns)._asdict()
    return {key: record[key] for key in ("frequency_hz", "psd", *["of"] * (not acts))}
