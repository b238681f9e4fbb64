"""Tables of numbers as instruments, phones, Tracker and spreadsheets write them, and as arrays in Python.

Text has its cells between commas, semicolons, tabs or spaces, with decimal points or commas, in UTF-8, UTF-16, UTF-32
or the code page of Windows; the heading may come after other lines and have its units next to or below the words. Lines
that begin with #, % or // are comments, but the last of them is the heading if there is no other. Empty cells and
"nan", "NA" or "-" are missing values. `facts` say how the table was understood, to be shown with a result.

    Zeit (s);Winkel/°        becomes the columns    zeit_s, winkel_deg
    0,00;12,5                                       0.0     12.5

In addition to text: NPZ, MAT (version 7.3 with h5py), Parquet (with pyarrow), mappings of arrays and data frames.
"""

from __future__ import annotations

import csv
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from io import BytesIO
from math import pi
from os import PathLike, fspath
from statistics import median
from typing import Any

import numpy as np

from modal.errors import SceneError, refuse_any, spelling_hint
from modal.report import Displayed, listed
from modal.scene.contents import as_text, content_of, decode_text
from modal.types import Floats

ROWS_MAX = 10_000_000
"""Limit: rows of a table; a file with more is refused."""
ROWS_OF_SAMPLE = 200
"""Cost: rows at the end from which separators and the kinds of columns are found; a quarter of a millisecond."""
SEPARATORS = {"\t": "tabs", ";": "semicolons", ",": "commas", " ": "spaces"}
MISSING = frozenset({"", "nan", "na", "n/a", "#n/a", "<na>", "null", "none", "-", "--"})
COMMENTS = ("#", "%", "//")
NUMBER = re.compile(r"[+-]?(\d+([.,]\d*)?|[.,]\d+)(e[+-]?\d+)?", re.IGNORECASE | re.ASCII)
COMMA = re.compile(r"[+-]?\d*,\d+(e[+-]?\d+)?", re.IGNORECASE | re.ASCII)
UNITS = {
    **dict.fromkeys(("s", "sec", "secs", "second", "seconds", "sekunde", "sekunden", "seg"), "s"),
    **dict.fromkeys(("ms", "msec", "milliseconds"), "ms"),
    **dict.fromkeys(("µs", "μs", "us", "microseconds"), "us"),
    **dict.fromkeys(("min", "minutes"), "min"),
    **dict.fromkeys(("rad", "radian", "radians"), "rad"),
    "mrad": "mrad",
    **dict.fromkeys(("°", "º", "deg", "degree", "degrees", "grad"), "deg"),
    **dict.fromkeys(("m", "meter", "meters", "metre", "metres"), "m"),
    **{unit: unit for unit in ("cm", "mm", "g")},
    **dict.fromkeys(("px", "pixel", "pixels"), "px"),
    **dict.fromkeys(("n", "newton"), "n"),
    **dict.fromkeys(("nm", "n m", "n·m", "n*m", "newton meter"), "nm"),
    **dict.fromkeys(("hz", "1/s", "s^-1"), "hz"),
    **dict.fromkeys(("rad/s", "rad s^-1", "rad·s⁻¹", "rad s⁻¹"), "rad_per_s"),
    **dict.fromkeys(("°/s", "º/s", "deg/s", "dps", "degrees/s"), "deg_per_s"),
    **dict.fromkeys(("m/s", "m s^-1", "m·s⁻¹", "m s⁻¹"), "m_per_s"),
    **dict.fromkeys(("m/s²", "m/s^2", "m/s2", "m/s/s", "m s^-2", "m·s⁻²", "m s⁻²"), "m_per_s2"),
}
"""Units as they are written in headings, in small letters, and how names of columns end in them."""
UNIT = re.compile(
    r"(?P<word>.*?)\s*(?:\((?P<round>[^()]*)\)|\[(?P<square>[^][]*)\]|/\s*(?P<slash>[^/\s]\S*)|\bin (?P<in>\S+))"
)
"""A heading that ends in a unit."""
TIME_WORDS = {
    *("t", "time", "times", "timestamp", "elapsed", "seconds_elapsed", "time_elapsed"),
    *("zeit", "temps", "tiempo", "tempo"),
}
SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "min": 60.0}
"""Seconds of the units of time."""
IN_SI = {
    "mm": ("m", 1e-3),
    "cm": ("m", 1e-2),
    "mrad": ("rad", 1e-3),
    "deg": ("rad", pi / 180),
    "deg_per_s": ("rad_per_s", pi / 180),
    "g": ("m_per_s2", 9.80665),
}
"""Units other than SI: how names of columns end in the latter, and how many of these they are."""


@dataclass(frozen=True, eq=False, repr=False)
class DataTable(Displayed):
    """A table of a file or of arrays: `cells[c]` are those of a column, words or an array of K numbers.

    `headings` are the original headings, `columns` their interpretations, with the unit at the end; `lines` number the
    rows in the file, from 1.  `facts` say how the file was read.
    """

    what = "Table of a file"
    shows = "name: file; columns: columns; facts: read with"

    name: str
    headings: tuple[str, ...]
    columns: tuple[str, ...]
    lines: tuple[int, ...]
    cells: tuple[Sequence[str] | Floats, ...]
    facts: tuple[str, ...] = ()
    has_decimal_comma: bool = False
    has_quotes: bool = True

    def __len__(self) -> int:
        return len(self.lines)

    def numbers(self, column: str) -> Floats:
        """Return the K numbers of a column, NaN if one is missing; raise SceneError with the first invalid cell."""
        cells = self.cells[self.columns.index(column)]
        if isinstance(cells, np.ndarray) and cells.dtype.kind == "f":
            values = cells
        else:
            try:
                values = np.array([self._number(str(cell)) for cell in cells], dtype=float)
            except ValueError:
                clock = _seconds_of_clock(cells) if time_unit(column) == 1.0 else None
                if clock is not None:
                    return clock
                row = next(k for k, cell in enumerate(cells) if not self._is_number(str(cell)))
                raise SceneError([self._bad_cell(row, column)]) from None
        if len(infinite := np.flatnonzero(np.isinf(values))):
            raise SceneError([self._bad_cell(int(infinite[0]), column)])
        return values

    def words(self, column: str) -> list[str]:
        """Return the K cells of a column as text."""
        cells = self.cells[self.columns.index(column)]
        if isinstance(cells, np.ndarray):
            return [f"{cell:g}" if cells.dtype.kind == "f" else str(cell) for cell in cells]
        return [cell.strip() for cell in cells]

    def renamed(self, meanings: Mapping[str, str]) -> DataTable:
        """Return the table with renamed columns; raise SceneError for headings that do not exist."""
        unknown = [heading for heading in meanings if heading not in self.headings and heading not in self.columns]
        if unknown:
            raise SceneError(
                [f"{self.name}: column {word}: is missing{spelling_hint(word, self.headings)}" for word in unknown]
            )
        pairs = zip(self.headings, self.columns, strict=True)
        columns = (meanings.get(heading, meanings.get(column, column)) for heading, column in pairs)
        return replace(self, columns=tuple(columns))

    def without(self, columns: Iterable[str]) -> DataTable:
        """Return the table without these columns."""
        places = [k for k, column in enumerate(self.columns) if column not in {*columns}]
        headings, names = (tuple(words[k] for k in places) for words in (self.headings, self.columns))
        return replace(self, headings=headings, columns=names, cells=tuple(self.cells[k] for k in places))

    def take(self, rows: Sequence[int] | Floats) -> DataTable:
        """Return the table with some of its rows."""
        lines = tuple(self.lines[k] for k in rows)
        cells = tuple(
            values[np.asarray(rows, dtype=int)] if isinstance(values, np.ndarray) else [values[k] for k in rows]
            for values in self.cells
        )
        return replace(self, lines=lines, cells=cells)

    def where(self, conditions: Mapping[str, str]) -> DataTable:
        """Return the rows in which columns have these values, or are within ranges such as "6.2:19"."""
        rows: Iterable[int] = range(len(self))
        for column, value in conditions.items():
            if column not in self.columns:
                raise SceneError([f"{self.name}: column {column}: is missing{spelling_hint(column, self.columns)}"])
            span = _span(value)
            if span:
                values = self.numbers(column)
                rows = [k for k in rows if span[0] <= values[k] <= span[1]]
            else:
                words = self.words(column)
                rows = [k for k in rows if words[k] == value]
        return self.take(list(rows)) if conditions else self

    def seconds(self) -> tuple[str, float] | None:
        """The column of the elapsed time and its unit in s; None if there is none or several."""
        units = {column: factor for column in self.columns if (factor := time_unit(column))}
        units = {column: factor for column, factor in units.items() if "elapsed" in column} or units
        return next(iter(units.items())) if len(units) == 1 else None

    def described(self) -> str:
        """A line on how the file was read."""
        renamed = [
            f"{column} from “{heading}”"
            for heading, column in zip(self.headings, self.columns, strict=True)
            if heading != column and self.has_quotes
        ]
        return "; ".join([", ".join(self.facts), *([", ".join(renamed)] if renamed else [])]).strip("; ")

    def _number(self, text: str) -> float:
        text = text.strip()
        if text.lower() in MISSING:
            return float("nan")
        return float(text.replace(",", ".") if self.has_decimal_comma else text)

    def _is_number(self, text: str) -> bool:
        try:
            self._number(text)
        except ValueError:
            return False
        return True

    def _bad_cell(self, row: int, column: str) -> str:
        cells = self.cells[self.columns.index(column)]
        quotation = f" = {str(cells[row])!r:.60}" if self.has_quotes else ""
        return f"{self.name}: line {self.lines[row]}, {column}{quotation}: must be a finite number"


def _seconds_of_clock(cells: Sequence[str] | Floats) -> Floats | None:
    """Seconds from the first of times such as 22:13:20.5 or 2023-11-14T22:13:20.5Z; None of any other form."""
    texts = [str(cell).strip().removesuffix("Z").replace(" ", "T").replace(",", ".") for cell in cells]
    if not all(re.fullmatch(r"(\d{4}-\d\d-\d\dT)?\d\d:\d\d:\d\d(\.\d+)?", text) for text in texts):
        return None
    times = np.array([text if "T" in text else f"1970-01-01T{text}" for text in texts], dtype="datetime64[us]")
    return np.asarray((times - times[0]) / np.timedelta64(1, "s"))


def time_unit(column: str) -> float | None:
    """Return the unit (s) of a column of times, None for any other column."""
    word, _, unit = column.rpartition("_")
    if word in TIME_WORDS and unit in SECONDS:
        return SECONDS[unit]
    return 1.0 if column in TIME_WORDS else None


def in_si(column: str) -> tuple[str, float]:
    """Return the name of a column in SI units, and the factor for its numbers.

    >>> from modal.scene.tables import in_si
    >>> in_si("displacement_mm"), in_si("force_n")
    (('displacement_m', 0.001), ('force_n', 1.0))
    """
    word, _, unit = column.rpartition("_")
    if column.endswith("_deg_per_s"):
        word, unit = column.removesuffix("_deg_per_s"), "deg_per_s"
    if not word or unit not in IN_SI:
        return column, 1.0
    name, factor = IN_SI[unit]
    return f"{word}_{name}", factor


def read_table(
    source: str | PathLike[str] | Mapping[str, Any] | Any, *, name: str = "data", has_quotes: bool = True
) -> DataTable:
    """The table in a file, or of a mapping of columns, a data frame or a structured array, which messages call `name`.

    SceneError says what is wrong; it quotes the file only where it `has_quotes`.

    >>> from modal.scene.tables import read_table
    >>> table = read_table({"time (s)": [0.0, 0.1], "Winkel/°": [3.0, 2.0]})
    >>> table.columns, table.numbers("winkel_deg").tolist()
    (('time_s', 'winkel_deg'), [3.0, 2.0])
    """
    if not isinstance(source, str | PathLike):
        return _of_columns(_columns_of(source), name, has_quotes)
    name = fspath(source)
    try:
        content = content_of(source)
        binary = _binary_columns(content)
        if binary is not None:
            return _of_columns(binary, name, has_quotes)
        return _of_text(_text(content), name, has_quotes)
    except SceneError as error:
        problems = (problem.removeprefix(f"{name}: ") for problem in error.problems)
        raise SceneError([f"{name}: {problem}" for problem in problems]) from None


# ------------------------------------------------------------------------------------------------- arrays


def _columns_of(data: Any) -> dict[str, Any]:
    """The columns of a mapping, a data frame or a structured array."""
    if isinstance(data, np.ndarray) and data.dtype.names:
        return {str(field): data[field] for field in data.dtype.names}
    if isinstance(data, np.ndarray) and data.ndim == 2:
        return {str(k): column for k, column in enumerate(data.T, 1)}
    if isinstance(data, Mapping) or hasattr(data, "columns"):
        index = getattr(data, "index", None)
        label = getattr(index, "name", None)
        keys = data.columns if hasattr(data, "columns") else data
        return ({str(label): index} if label else {}) | {str(key): data[key] for key in keys}
    raise SceneError(
        [f"data: must be a file, a mapping of columns, a data frame or a structured array, not {type(data).__name__}"]
    )


def _arrays_of(columns: Mapping[str, Any]) -> Iterator[tuple[str, np.ndarray]]:
    """The columns by their headings, of structures and of matrices, too; times of day are in s from the first."""
    for heading, values in columns.items():
        if isinstance(values, Mapping):
            yield from _arrays_of(values)
            continue
        array = np.asarray(values)
        if array.dtype.kind in "mM" and array.ndim == 1 and len(array):
            array = (array - (array[0] if array.dtype.kind == "M" else 0)) / np.timedelta64(1, "s")
        array = array.astype(float if array.dtype.kind in "iufb" else str)
        # MATLAB has no arrays with one axis: a row and a column are columns, and single numbers are none.
        if array.ndim and array.size == max(array.shape):
            yield heading, array.reshape(-1)
        elif array.ndim == 2:
            rows = array.T if len(array) >= array.shape[1] else array
            yield from ((f"{heading}_{k}", row) for k, row in enumerate(rows, 1))


def _of_columns(columns: Mapping[str, Any], name: str, has_quotes: bool) -> DataTable:
    arrays = dict[str, np.ndarray]()
    for heading, array in _arrays_of(columns):
        if heading in arrays:
            raise SceneError(
                [f"{name}: has two arrays {heading}" if has_quotes else f"{name}: has two arrays of one name"]
            )
        arrays[heading] = array
    if not arrays:
        raise SceneError([f"{name}: has no columns, which are arrays with one axis"])
    lengths = Counter(len(values) for values in arrays.values())
    (count, _), *others = lengths.most_common()
    if others and not has_quotes:
        raise SceneError([f"{name}: its columns differ in length"])
    if others:
        shapes = listed([f"{heading} {len(values)}" for heading, values in arrays.items()], 8)
        raise SceneError([f"{name}: its columns differ in length: {shapes}"])
    headings = tuple(arrays)
    return DataTable(
        name,
        headings,
        _column_names(headings),
        tuple(range(1, count + 1)),
        tuple(arrays.values()),
        (),
        False,
        has_quotes,
    )


def _binary_columns(content: bytes) -> dict[str, Any] | None:
    """The columns of a binary file, None of a text."""
    if content.startswith((b"MATLAB 5.0", b"MATLAB 7.3", b"\x89HDF")):
        return _matlab_columns(content)
    if content.startswith(b"PAR1"):
        try:
            import pyarrow.parquet
        except ImportError:
            raise SceneError(["is a Parquet file, which needs pyarrow: pip install pyarrow"]) from None
        try:
            table = pyarrow.parquet.read_table(BytesIO(content))
        except (ValueError, OSError) as error:
            raise SceneError([f"is no Parquet file that can be read: {error}"]) from None
        return {heading: column.to_numpy() for heading, column in zip(table.column_names, table.columns, strict=True)}
    if content.startswith(b"PK\x03\x04") and b".npy" in content[:200] and b"header.npy" not in content[:200]:
        return _archived_columns(content)
    return None


def _archived_columns(content: bytes) -> dict[str, Any] | None:
    """The arrays of an NPZ archive, None of a model or of a result of ours."""
    from zipfile import BadZipFile

    try:
        with np.load(BytesIO(content), allow_pickle=False) as archive:
            names = set(archive.files)
            if {"A", "B", "C", "D"} <= names or "header" in names:
                return None
            return {array: archive[array] for array in archive.files}
    except (ValueError, OSError, EOFError, BadZipFile) as error:
        raise SceneError([f"is no archive of arrays that can be read: {error}"]) from None


def _matlab_columns(content: bytes) -> dict[str, Any]:
    if not content.startswith(b"MATLAB 5.0"):
        try:
            import h5py
        except ImportError:
            raise SceneError(
                ["is a MATLAB 7.3 file, which needs h5py: pip install h5py, or save -v7 in MATLAB"]
            ) from None
        try:
            with h5py.File(BytesIO(content)) as file:
                return _columns_of_group(file)
        except OSError as error:
            raise SceneError([f"is no MATLAB 7.3 file that can be read: {error}"]) from None
    import scipy

    try:
        variables = scipy.io.loadmat(BytesIO(content), simplify_cells=True)
    except (ValueError, TypeError, NotImplementedError, EOFError, OSError) as error:
        raise SceneError([f"is no MATLAB file that can be read: {error}"]) from None
    return {key: values for key, values in variables.items() if not key.startswith("__")}


def _columns_of_group(group: Any) -> dict[str, Any]:
    """The numbers of a group of HDF5, and of structures in it; MATLAB writes columns as rows, and text as numbers."""
    is_group = {key: hasattr(group[key], "keys") for key in group if not key.startswith("#")}
    datasets = [key for key in is_group if not is_group[key] and group[key].dtype.kind in "iufb"]
    numbers = [key for key in datasets if group[key].attrs.get("MATLAB_class") != b"char"]
    columns = {key: np.squeeze(group[key][()]).T for key in numbers}
    return columns | {key: _columns_of_group(group[key]) for key in is_group if is_group[key]}


# --------------------------------------------------------------------------------------------------- text


def _text(content: bytes) -> str:
    try:
        return decode_text(content, "table")
    except SceneError:
        # The code page of Windows, in which spreadsheets of western Europe write °, has no bytes of this range.
        if any(byte in content for byte in (b"\0", b"\x81", b"\x8d", b"\x8f", b"\x90", b"\x9d")) or _is_utf8(content):
            raise
        return content.decode("cp1252")


def _is_utf8(content: bytes) -> bool:
    try:
        as_text(content)
    except UnicodeDecodeError:
        return False
    return True


def _of_text(text: str, name: str, has_quotes: bool) -> DataTable:
    lines, comments, separator = list[tuple[int, str]](), list[str](), ""
    for at, line in enumerate(text.splitlines(), 1):
        if at == 1 and re.fullmatch(r'"?sep=.', line.strip().strip('"')):
            separator = line.strip().strip('"')[-1]
        elif line.lstrip().startswith(COMMENTS):
            comments.append(line.lstrip().lstrip("#%/").strip())
        elif line.strip():
            lines.append((at, line))
    if len(lines) > ROWS_MAX:
        raise SceneError([f"has over {ROWS_MAX:,} lines".replace(",", " ")])
    if not lines:
        return DataTable(name, (), (), (), (), (), False, has_quotes)
    separator = separator or _separator([line for _, line in lines])
    try:
        rows = list(_rows(lines, separator))
    except csv.Error as error:
        raise SceneError([str(error)]) from None
    sample = rows[-ROWS_OF_SAMPLE:]
    has_comma = separator != "," and any(COMMA.fullmatch(cell) for _, row in sample for cell in row)
    at, headings, units = _heading(rows, sample)
    facts = [f"cells between {SEPARATORS.get(separator, separator)}"] * (separator != ",")
    facts += ["decimal commas"] * has_comma
    if not headings:
        width = len(rows[0][1])
        commented = next(_rows([(0, comments[-1])], separator), (0, []))[1] if comments else []
        spaced = comments[-1].split() if comments else []
        headings = next((words for words in (commented, spaced) if len(words) == width), [])
        facts.append("heading in a comment" if headings else "no heading: columns are called 1, 2, …")
        headings = headings or [str(k) for k in range(1, width + 1)]
    elif at:
        facts.append(f"heading in line {rows[at][0]}")
    data = rows[at + 1 + bool(units) :] if at >= 0 else rows
    if len(headings) > 1 and not headings[-1] and all(not row[-1] for _, row in data if len(row) == len(headings)):
        headings, data = headings[:-1], [(line, row[: len(headings) - 1]) for line, row in data]
    data = [(line, row) for line, row in data if any(row)]
    uneven = next((line for line, row in data if len(row) != len(headings)), None)
    if uneven is not None:
        raise SceneError([f"line {uneven}: must have {len(headings)} cells like the first"])
    cells = tuple([row[k] for _, row in data] for k in range(len(headings)))
    columns = _column_names(headings, units)
    return DataTable(
        name, tuple(headings), columns, tuple(line for line, _ in data), cells, tuple(facts), has_comma, has_quotes
    )


def _rows(lines: Sequence[tuple[int, str]], separator: str) -> Iterator[tuple[int, list[str]]]:
    if separator == " ":
        # A unit in brackets belongs to the word before it.
        joined = ((at, re.sub(r"\s+(?=[(\[])", "", line)) for at, line in lines)
        yield from ((at, [word.strip('"') for word in line.split()]) for at, line in joined)
        return
    reader = csv.reader((line for _, line in lines), delimiter=separator, skipinitialspace=True)
    yield from ((lines[reader.line_num - 1][0], [cell.strip() for cell in row]) for row in reader)


def _separator(lines: Sequence[str]) -> str:
    """That which divides most of the last lines into the same number of cells of which most are numbers."""
    sample, shares = lines[-ROWS_OF_SAMPLE:], dict[str, float]()
    for separator in SEPARATORS:
        rows = [row for _, row in _rows(list(enumerate(sample)), separator)]
        width = int(median(map(len, rows)))
        fitting = [row for row in rows if len(row) == width > 1]
        is_decimal = COMMA if separator != "," else None
        numeric = sum(_is_numeric(cell, is_decimal) for row in fitting for cell in row)
        shares[separator] = numeric / (width * len(rows))
    largest = max(shares.values())
    if largest:
        return next(separator for separator, share in shares.items() if share == largest)
    return next((separator for separator in (",", ";", "\t") if separator in lines[0]), ",")


def _is_numeric(cell: str, decimal_comma: re.Pattern[str] | None = COMMA) -> bool:
    if "," in cell and decimal_comma is None:
        return False
    return cell.lower() in MISSING or bool(NUMBER.fullmatch(cell)) or cell.lower() in ("inf", "-inf", "+inf")


def _heading(
    rows: Sequence[tuple[int, list[str]]], sample: Sequence[tuple[int, list[str]]]
) -> tuple[int, list[str], list[str]]:
    """The place of the heading among rows, -1 where there is none, its words and the units that stand below them."""
    first = rows[0][1]
    width = int(median(len(row) for _, row in sample))
    same = [row for _, row in sample if len(row) == width]
    is_number = [sum(map(_is_numeric, column)) > len(column) / 2 for column in zip(*same, strict=True)]

    def numeric_share(row: list[str]) -> float:
        words = [cell for cell, numeric in zip(row, is_number, strict=False) if numeric and cell]
        return sum(map(_is_numeric, words)) / len(words) if len(row) == width and words else -1.0

    shares = [numeric_share(row) for _, row in rows]
    start = next((k for k, share in enumerate(shares) if share >= 0.5), len(rows))
    candidates = [k for k in range(start) if shares[k] == 0]
    if not candidates:
        has_words = not any(cell and _is_numeric(cell) for cell in first)
        return (0, first, []) if has_words else (-1, [], [])
    at = candidates[-1]
    has_units = len(candidates) > 1 and all(not cell or _bare_unit(cell) for cell in rows[at][1])
    return (candidates[-2], rows[candidates[-2]][1], rows[at][1]) if has_units else (at, rows[at][1], [])


def _bare_unit(cell: str) -> str:
    return UNITS.get(cell.strip("()[] ").lower(), "")


def _column_names(headings: Sequence[str], units: Sequence[str] = ()) -> tuple[str, ...]:
    """Headings with their units as our columns have them, and as they are where there is no unit of ours."""
    names = []
    for k, heading in enumerate(headings):
        match = UNIT.fullmatch(heading)
        written = (
            next((match[group] for group in ("round", "square", "slash", "in") if match[group]), "") if match else ""
        )
        word, unit = (match["word"], UNITS.get(written.strip().lower(), "")) if match else (heading, "")
        if not unit and k < len(units):
            word, unit = heading, _bare_unit(units[k])
        slug = re.sub(r"\W+", "_", word.strip().lower()).strip("_")
        slug = "time" if slug in TIME_WORDS else slug
        names.append(f"{slug}_{unit}" if unit and slug else heading)
    return tuple(names)


def _span(value: str) -> tuple[float, float] | None:
    """The ends of a range such as "6.2:19", ":3" or "4:"."""
    low, sign, high = value.partition(":")
    if not sign:
        return None
    try:
        return float(low or "-inf"), float(high or "inf")
    except ValueError:
        return None


def parse_where(texts: Sequence[str], example: str = "COLUMN=VALUE, such as use=identify") -> dict[str, str]:
    """Return the columns and values of texts such as "use=identify"; raise SceneError for any other."""
    cells, problems = {}, []
    for text in texts:
        column, sign, value = text.partition("=")
        if not sign or not column.strip():
            problems.append(f"{text:.60}: must be {example}")
        cells[column.strip()] = value.strip()
    refuse_any(problems)
    return cells
