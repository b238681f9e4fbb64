"""Measured motions: segments of CSV files with the column `time_s` and one column for each sensor.

A sensor is `theta_P_L_rad` or `theta_P_L_deg`, the angle of link L of pendulum P (both from 1) from the downward
vertical, or with relative angles from the link above, or `cart_m` (`x_m` in files of `nonlinear.save`), or on a
structure a coordinate of a support, such as `left_m`, `board_rad` or `board_deg` (`Structure.names`).  A column
`segment` separates motions that were recorded apart; other columns select rows.  An empty cell or "nan" is a
missing value.  The time may be `time_ms`, and `-theta_P_L_rad` is a sensor that counts the other way.  Angles that jump
by a turn, as those of atan2 do, are continued.
"""

from __future__ import annotations

import csv
import io
import os
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from math import isinf, nan, radians, tau

import numpy as np

from modal.errors import SceneError, spelling_hint
from modal.report import Displayed, counted, listed
from modal.scene import Scene
from modal.scene.contents import LARGEST_READ, SIZES_READ, SMALLEST_READ, text_of
from modal.structure import structure_of
from modal.types import Floats

TIME, SEGMENT = "time_s", "segment"
TIMES = {TIME: 1.0, "time_ms": 1e-3}
RUNS = "x_m"  # the cart in files of simulated runs, also of those without one
SENSOR = re.compile(r"theta_([1-9][0-9]{0,6})_([1-9][0-9]{0,6})_(rad|deg)|cart_m|x_m", re.ASCII)
LIKE_ONE = re.compile(r"theta_(?!dot_)|cart|time", re.ASCII)
ANGLE_MAX = 60.0
"""Limit: rad, some ten turns: "if these are degrees, name it …"."""
SEGMENT_ROWS_MIN = 4
"""Limit: rows of a segment: "at least 4 are needed"."""
SEGMENT_STEPS_MAX = 10_000_000
"""Limit: steps of a segment, its gaps included: "lasts …, over 10 000 000 of its steps"."""
TURN_SHARE = 0.75
"""Tolerance: of a turn, a jump between samples that is no motion, if all readings lie within one turn."""
ANGLES = ("absolute", "relative")


@dataclass(frozen=True, order=True)
class Sensor:
    """The angle of a link, `pendulum` and `link` from 1, or with both 0 the position of the cart.

    With a `carrier` it is that coordinate of a structure, as NAME_m or NAME_rad.
    """

    pendulum: int = 0
    link: int = 0
    carrier: str = ""

    @property
    def name(self) -> str:
        """As in the columns of a file, without the unit."""
        if self.carrier:
            return self.carrier.removesuffix(f"_{self.unit}")
        return f"theta_{self.pendulum}_{self.link}" if self.pendulum else "cart"

    @property
    def unit(self) -> str:
        """Of its readings: of coordinates of modal supports 1."""
        if self.carrier:
            last = self.carrier.rpartition("_")[2]
            return last if last in {"m", "rad"} else "1"
        return "rad" if self.pendulum else "m"


@dataclass(frozen=True, eq=False, repr=False)
class Segment(Displayed):
    """A motion that was recorded in one go.

    `times` (K,) in s, ascending; `values` (K, C) in rad and m, NaN where a sensor has no value.  The next segment may
    be its continuation.
    """

    what = "Motion recorded in one go"
    shows = "file: file; name: name; times: times, s; values: readings"

    file: str
    name: str
    times: Floats
    values: Floats
    continued: bool = False

    @property
    def where(self) -> str:
        """The segment in messages."""
        return f"{self.file}, segment {self.name}" if self.name else self.file


@dataclass(frozen=True, eq=False, repr=False)
class Recording(Displayed):
    """Segments with the same C sensors; `relative` where angles are those to the link above.

    `continued` are the names of sensors whose jumps by a turn were taken out.
    """

    what = "Recorded motions"
    shows = "segments: segments; sensors: sensors; unused: columns not used"

    sensors: tuple[Sensor, ...]
    segments: tuple[Segment, ...]
    relative: bool = False
    unused: tuple[str, ...] = ()
    continued: tuple[str, ...] = ()

    @property
    def n_values(self) -> int:
        """Number of values that are there."""
        return sum(int(np.count_nonzero(np.isfinite(segment.values))) for segment in self.segments)

    def take(self, which: Sequence[int]) -> Recording:
        """Some of its segments."""
        return replace(self, segments=tuple(self.segments[k] for k in which))

    def unwrap_angles(self) -> Recording:
        """With angles that go on where those of a sensor jump by a turn (`unwrap`)."""
        segments, names = [], dict.fromkeys(self.continued)
        for segment in self.segments:
            values = segment.values.copy()
            for c, sensor in enumerate(self.sensors):
                if sensor.pendulum and is_wrapped(values[:, c]):
                    values[:, c] = unwrap(values[:, c])
                    names[sensor.name] = None
            segments.append(replace(segment, values=values))
        return replace(self, segments=tuple(segments), continued=tuple(names)) if names else self

    def absolute(self) -> Recording:
        """With angles from the vertical; SceneError where relative ones of links above are not recorded."""
        if not self.relative:
            return self
        at = {(sensor.pendulum, sensor.link): k for k, sensor in enumerate(self.sensors)}
        missing = {f"theta_{p}_{i}" for p, link in at for i in range(1, link) if (p, i) not in at}
        if missing:
            raise SceneError([f"relative angles need {listed(sorted(missing), len(missing))} too"])
        sums = np.zeros((len(self.sensors), len(self.sensors)))
        for (pendulum, link), k in at.items():
            sums[k, [at[pendulum, i] for i in range(1, link + 1)] if pendulum else [k]] = 1.0
        segments = [
            replace(segment, values=np.array([segment.values[:, row > 0].sum(axis=1) for row in sums]).T)
            for segment in self.segments
        ]
        return replace(self, segments=tuple(segments), relative=False)

    def windows(self, duration: float) -> Recording:
        """The same with every segment in windows of about this duration (s), each continuing the one before."""
        segments = []
        for segment in self.segments:
            count = max(1, round((segment.times[-1] - segment.times[0]) / duration))
            count = min(count, len(segment.times) // (2 * SEGMENT_ROWS_MIN)) or 1
            parts = np.array_split(np.arange(len(segment.times)), count)
            for k, rows in enumerate(parts):
                name = f"{segment.name} window {k + 1}".strip() if count > 1 else segment.name
                on = segment.continued or k + 1 < count
                segments.append(
                    replace(segment, name=name, times=segment.times[rows], values=segment.values[rows], continued=on)
                )
        return replace(self, segments=tuple(segments))

    def until(self, duration: float) -> Recording:
        """The beginning of every segment (s)."""
        beginnings = []
        for segment in self.segments:
            count = max(
                SEGMENT_ROWS_MIN, int(np.searchsorted(segment.times, segment.times[0] + duration, side="right"))
            )
            goes_on = count >= len(segment.times) and segment.continued
            beginnings.append(
                replace(segment, times=segment.times[:count], values=segment.values[:count], continued=goes_on)
            )
        return replace(self, segments=tuple(beginnings))


def is_wrapped(values: Floats) -> bool:
    """Whether angles (K,) in rad stay within one turn and jump by nearly one between samples that follow each other."""
    numbers = values[np.isfinite(values)]
    if not len(numbers) or np.ptp(numbers) > 1.001 * tau:  # angles are rounded where they are written
        return False
    return bool(np.any(np.abs(np.diff(values)) > TURN_SHARE * tau))


def unwrap(values: Floats) -> Floats:
    """Angles (K,) that go on by less than half a turn from each sample to the next that is there."""
    angles, is_present = values.copy(), np.isfinite(values)
    angles[is_present] = np.unwrap(values[is_present])
    return angles


def read_recording(
    scene: Scene | None,
    paths: Sequence[str | os.PathLike[str]],
    *,
    where: Mapping[str, str] | None = None,
    angles: str = "absolute",
    columns: Mapping[str, str] | None = None,
) -> Recording:
    """The recording in these files, of a scene whose links and cart the sensors read, or of any with None.

    `where` gives columns with the value that used rows have there; `columns` says what columns with other headings
    hold, such as {"t": "time_ms", "theta_1_2_rad": "-theta_1_2_rad"}.  SceneError lists every mistake.
    """
    if angles not in ANGLES:
        raise SceneError([f"angles {angles}: must be {' or '.join(ANGLES)}"])
    carriers = carrier_columns(scene)
    tables: list[tuple[str, list[str], list[tuple[int, list[str]]]]] = []
    problems: list[str] = []
    for path in paths:
        name = os.fspath(path)
        try:
            header, rows = _table(name, where or {}, columns or {}, carriers)
            if _has_no_cart(scene) if scene else _is_still(header, rows):
                header = [f"({column})" if column == RUNS else column for column in header]
            tables.append((name, header, rows))
        except SceneError as error:
            problems += error.problems
    if not paths:
        problems.append("no file of measured motions is given")
    if problems:
        raise SceneError(problems)
    sensors = sorted(
        {_sensor(column, carriers) for _, header, _ in tables for column in header if _is_sensor(column, carriers)}
    )
    problems += [problem for sensor in sensors if scene for problem in _absent(scene, sensor)]
    segments: list[Segment] = []
    for name, header, rows in tables:
        try:
            segments += _segments(name, header, rows, sensors, carriers)
        except SceneError as error:
            problems += error.problems
    problems += _empty(sensors, segments) if not problems else []
    if problems:
        raise SceneError(problems)
    other_columns = {column for _, header, _ in tables for column in header if not _is_known(column, carriers)} - {
        *(where or {}),
        f"({RUNS})",
    }
    return Recording(
        tuple(sensors), tuple(segments), angles == "relative", tuple(sorted(other_columns))
    ).unwrap_angles()


def _is_still(header: Sequence[str], rows: Sequence[tuple[int, list[str]]]) -> bool:
    """Whether the cart of a simulated run never moves."""
    return RUNS in header and len({row[header.index(RUNS)] for _, row in rows}) == 1


Carriers = Mapping[str, Sensor]
"""The columns of coordinates of a structure."""


def carrier_columns(scene: Scene | None) -> dict[str, Sensor]:
    """The columns that may read coordinates of a scene's supports, in m, rad and degrees.

    >>> from modal import load
    >>> list(carrier_columns(load("ship-crane")))
    ['ship_sway_m', 'ship_heave_m', 'ship_roll_rad', 'ship_roll_deg']
    """
    if scene is None or not scene.is_structured:
        return {}
    columns = {}
    for name in structure_of(scene).names:
        if name != "x":
            columns[name] = Sensor(carrier=name)
            if name.endswith("_rad"):
                columns[f"{name.removesuffix('_rad')}_deg"] = Sensor(carrier=name)
    return columns


def _has_no_cart(scene: Scene) -> bool:
    return scene.cart is None and not (scene.is_structured and structure_of(scene).names == ("x",))


def _is_sensor(column: str, carriers: Carriers) -> bool:
    bare = column.removeprefix("-")
    return bare in carriers or bool(SENSOR.fullmatch(bare))


def _sensor(column: str, carriers: Carriers) -> Sensor:
    bare = column.removeprefix("-")
    match = SENSOR.fullmatch(bare)
    return carriers.get(bare) or (Sensor(int(match[1]), int(match[2])) if match and match[1] else Sensor())


def _is_known(column: str, carriers: Carriers) -> bool:
    return column in {*TIMES, SEGMENT} or _is_sensor(column, carriers)


def _absent(scene: Scene, sensor: Sensor) -> Iterator[str]:
    """What the sensor reads and the scene has not."""
    if not sensor.pendulum:
        if not sensor.carrier and _has_no_cart(scene):
            yield "column cart_m: the scene has no cart"
        return
    sizes = [pendulum.n_links for pendulum in scene.pendulum for _ in range(pendulum.count)]
    if sensor.pendulum > len(sizes):
        yield f"column {sensor.name}: the scene has {counted(len(sizes), 'pendulum', 'pendula')}"
    elif sensor.link > sizes[sensor.pendulum - 1]:
        yield f"column {sensor.name}: the pendulum has {counted(sizes[sensor.pendulum - 1], 'link', 'links')}"


def _table(
    name: str, where: Mapping[str, str], meanings: Mapping[str, str], carriers: Carriers
) -> tuple[list[str], list[tuple[int, list[str]]]]:
    """The header of a file, and its rows with their line numbers."""
    try:
        text = text_of(name, "table")
        reader = csv.reader(line for line in io.StringIO(text, newline="") if not line.startswith("#"))
        header, *rows = [*enumerate(reader, 1)] or [(1, [])]
    except SceneError as error:
        raise SceneError([f"{name}: {problem}" for problem in error.problems]) from None
    except csv.Error as error:
        raise SceneError([f"{name}: {error}"]) from None
    headings = [word.strip() for word in header[1]]
    columns = [meanings.get(word, word) for word in headings]
    problems = [
        f"column {heading}: is missing{spelling_hint(heading, headings)}"
        for heading in meanings
        if heading not in headings
    ]
    problems += [
        f"column {old}: {new}: must be time_s, time_ms, theta_P_L_rad, theta_P_L_deg or cart_m, or - and one of these"
        for old, new in meanings.items()
        if not _is_known(new, carriers)
    ]
    if problems := [*problems, *_header_problems(columns, where, carriers)]:
        raise SceneError([f"{name}: {problem}" for problem in problems])
    full = [(line, row) for line, row in rows if any(word.strip() for word in row)]
    if uneven_lines := [line for line, row in full if len(row) != len(columns)]:
        raise SceneError([f"{name}: line {uneven_lines[0]}: must have {len(columns)} cells like the first"])
    used = [
        (line, row)
        for line, row in full
        if all(row[columns.index(column)].strip() == value for column, value in where.items())
    ]
    if not used:
        raise SceneError([f"{name}: has no rows" + (" with the values that were asked for" if full and where else "")])
    return columns, used


def _header_problems(columns: Sequence[str], where: Mapping[str, str], carriers: Carriers) -> Iterator[str]:
    times = [heading for heading in columns if heading in TIMES]
    if not times:
        yield f"has no column {TIME}{spelling_hint(TIME, columns)}"
    if len(set(times)) > 1:
        yield f"columns {listed(times, len(times))}: are the time in two units"
    yield from (
        f"column {heading}: stands there twice" for heading in dict.fromkeys(columns) if columns.count(heading) > 1
    )
    yield from (
        f"column {heading}: is missing{spelling_hint(heading, columns)}" for heading in where if heading not in columns
    )
    for column in columns:
        if column not in where and not _is_known(column, carriers) and LIKE_ONE.match(column):
            yield f"column {column}: must be theta_P_L_rad, theta_P_L_deg or cart_m, with P and L from 1"
    sensors = [column for column in columns if _is_sensor(column, carriers)]
    if not sensors:
        yield "has no column of a sensor, such as theta_1_1_rad or cart_m"
    sensor_of = {heading: _sensor(heading, carriers) for heading in sensors}
    twice = [
        heading for heading in sensors if len({twin for twin in sensors if sensor_of[twin] == sensor_of[heading]}) > 1
    ]
    if twice:
        yield f"columns {listed(twice, len(twice))}: are one sensor in two units"


def _segments(
    name: str,
    header: Sequence[str],
    rows: Sequence[tuple[int, list[str]]],
    sensors: Sequence[Sensor],
    carriers: Carriers,
) -> list[Segment]:
    is_number = [column in TIMES or _is_sensor(column, carriers) for column in header]
    number = {column: [_number(row[k]) for _, row in rows] for k, column in enumerate(header) if is_number[k]}
    problems = []
    for column, values in number.items():
        bad = next((k for k, value in enumerate(values) if value is None or isinf(value)), None)
        if bad is not None:
            line, row = rows[bad]
            problems.append(
                f"{name}: line {line}, {column} = {row[header.index(column)]!r:.60}: must be a finite number"
            )
    if problems:
        raise SceneError(problems)
    clock = next(column for column in header if column in TIMES)
    times = TIMES[clock] * np.array(number[clock], dtype=float)
    table = np.full((len(times), len(sensors)), nan)
    for column, cells in number.items():
        if column != clock:
            factor = (radians(1.0) if column.endswith("_deg") else 1.0) * (-1 if column.startswith("-") else 1)
            table[:, sensors.index(_sensor(column, carriers))] = factor * np.array(cells, dtype=float)
    names = [row[header.index(SEGMENT)].strip() for _, row in rows] if SEGMENT in header else [""] * len(rows)
    segments: list[Segment] = []
    at = 0
    for segment, group in groupby(names):
        count = len([*group])
        within = slice(at, at + count)
        at += count
        segments.append(Segment(name, segment, times[within], table[within]))
        problems += _segment_problems(segments[-1], sensors)
    titles = [segment.name for segment in segments]
    duplicates = [title for title in dict.fromkeys(titles) if titles.count(title) > 1]
    problems += [f"{name}: segment {title}: its rows do not follow one another" for title in duplicates]
    if problems:
        raise SceneError(problems)
    return segments


def _number(word: str) -> float | None:
    if not word.strip():
        return nan
    try:
        return float(word)
    except ValueError:
        return None


def _segment_problems(segment: Segment, sensors: Sequence[Sensor]) -> Iterator[str]:
    if not np.all(np.isfinite(segment.times)):
        yield f"{segment.where}: a time is missing"
        return
    back = np.flatnonzero(np.diff(segment.times) <= 0)
    if len(back):
        at = segment.times[back[0]]
        yield f"{segment.where}: the time does not increase after {at:.9g} s"
    if len(segment.times) > 1:
        yield from _clock_problems(segment)
    if len(segment.times) < SEGMENT_ROWS_MIN:
        rows = counted(len(segment.times), "row", "rows")
        yield f"{segment.where}: has {rows}, at least {SEGMENT_ROWS_MIN} are needed"
    for sensor, values in zip(sensors, segment.values.T, strict=True):
        numbers = values[np.isfinite(values)]
        if sensor.pendulum and len(numbers) and np.abs(numbers).max() > ANGLE_MAX:
            largest = float(np.abs(numbers).max())
            hint = f"if these are degrees, name it {sensor.name}_deg"
            yield f"{segment.where}: {sensor.name} reaches {largest:.4g} rad: {hint}"


def _clock_problems(segment: Segment) -> Iterator[str]:
    """Times that double precision cannot square, and gaps of more samples than can be filled."""
    step, span = float(np.median(np.diff(segment.times))), float(segment.times[-1]) - float(segment.times[0])
    largest = float(np.abs(segment.times).max())
    if largest > LARGEST_READ or 0 < step < SMALLEST_READ:
        yield f"{segment.where}: its times reach {largest:.3g} s in steps of {step:.3g} s: {SIZES_READ}"
    elif step > 0 and span > SEGMENT_STEPS_MAX * step:
        count = f"{SEGMENT_STEPS_MAX:,}".replace(",", " ")
        yield f"{segment.where}: lasts {span:.3g} s, over {count} of its steps of {step:.3g} s"


def _empty(sensors: Sequence[Sensor], segments: Sequence[Segment]) -> Iterator[str]:
    """Sensors and segments that say nothing."""
    for k, sensor in enumerate(sensors):
        values = np.concatenate([segment.values[:, k] for segment in segments])
        values = values[np.isfinite(values)]
        if not len(values):
            yield f"column {sensor.name}: has no values"
            continue
        largest = float(np.abs(values).max())
        if largest and not SMALLEST_READ <= largest <= LARGEST_READ:
            yield f"column {sensor.name}: reaches {largest:.3g} {sensor.unit}: {SIZES_READ}"
        elif np.ptp(values) == 0:
            yield f"column {sensor.name}: is constant, {values[0]:.6g} {sensor.unit}: nothing can be fitted to it"
    for segment in segments:
        if int(np.count_nonzero(np.isfinite(segment.values))) < SEGMENT_ROWS_MIN:
            yield f"{segment.where}: has no values"


def parse_where(texts: Sequence[str], example: str = "COLUMN=VALUE, such as use=identify") -> dict[str, str]:
    """The columns and values of texts such as "use=identify"; SceneError for any other."""
    cells, problems = {}, []
    for text in texts:
        column, sign, value = text.partition("=")
        if not sign or not column.strip():
            problems.append(f"{text:.60}: must be {example}")
        cells[column.strip()] = value.strip()
    if problems:
        raise SceneError(problems)
    return cells
