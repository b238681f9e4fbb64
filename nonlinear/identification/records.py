"""Measured motions: segments of CSV files with the column `time_s` and one column for each sensor.

A sensor is `theta_P_L_rad` or `theta_P_L_deg`, the angle of link L of pendulum P (both from 1) from the downward
vertical, or with relative angles from the link above, or `cart_m` (`x_m` in files of `nonlinear.save`), or on a
structure a coordinate of a support, such as `left_m`, `board_rad` or `board_deg` (`Structure.names`).  Others read of a
link its rate `theta_dot_P_L_rad_per_s`, the angle from the link above `theta_P_L_relative_rad`, the place of its end
`x_P_L_m` and `y_P_L_m`, or the acceleration at a point of it with gravity in it, `acceleration_along_P_L_m_per_s2@R`
and `acceleration_across_P_L_m_per_s2@R` (`nonlinear.identification.points`), in these units or others.  A column
`segment` separates motions that were recorded apart; other columns select rows.  An empty cell or "nan" is a
missing value.  The time may be `time_ms`, and `-theta_P_L_rad` is a sensor of opposite sign.  Angles that jump
by a turn, as those of atan2 do, are continued.

Files are read by `modal.scene.tables`, whatever divides their cells; columns of angles with other names are the links
of one pendulum where that leaves no doubt: a single one, or as many as there are links, numbered from 1.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from math import inf, nan, tau
from typing import Any

import numpy as np

from modal.errors import SceneError, gathered, refuse_any, spelling_hint
from modal.report import Displayed, counted, listed
from modal.scene import Scene
from modal.scene.contents import MEASURED_MAX, MEASURED_MIN, SIZES_READ
from modal.scene.signal_names import signal_words
from modal.scene.tables import DataTable, in_si, read_table, time_unit
from modal.structure import structure_of
from modal.types import Floats
from nonlinear.identification.points import ACCELERATIONS, AXES, unreadable
from nonlinear.system import system_of

TIME, SEGMENT = "time_s", "segment"
TIMES = {TIME: 1.0, "time_ms": 1e-3}
CARTS = ("cart_m", "x_m")
RUNS = CARTS[1]  # the cart in files of simulated runs, also of those without one
LINK = r"(?P<pendulum>[1-9][0-9]{0,6})_(?P<link>[1-9][0-9]{0,6})"
QUANTITIES = {
    "": ("theta_{}", "rad"),
    "rate": ("theta_dot_{}", "rad_per_s"),
    "relative": ("theta_{}_relative", "rad"),
    "along": ("acceleration_along_{}", "m_per_s2"),
    "across": ("acceleration_across_{}", "m_per_s2"),
    "x": ("x_{}", "m"),
    "y": ("y_{}", "m"),
}
"""The quantities of sensors of links: the names of their columns, and the units after these."""
SENSORS = {
    quantity: re.compile(f"{name.format(LINK)}_{unit}", re.ASCII) for quantity, (name, unit) in QUANTITIES.items()
}
PIXELS = "px"
DISTANCE = re.compile(r"[0-9]+(\.[0-9]+)?", re.ASCII)
COLUMNS = (
    "theta_P_L_rad, theta_P_L_deg, theta_P_L_relative_rad, theta_dot_P_L_rad_per_s, x_P_L_m, y_P_L_m, "
    "acceleration_along_P_L_m_per_s2@R, acceleration_across_P_L_m_per_s2@R or cart_m"
)
ANGLE = re.compile(r"(?:\w*?[^\W\d_])_*(?P<number>\d*)(?:_\w*?)??_(?P<unit>rad|deg)")
"""A column of an angle that is called otherwise, perhaps with a number."""
LIKE_ONE = re.compile(r"theta_(?!dot_)|cart|time|acceleration_(along|across)_", re.ASCII)
RECORD_ANGLE_MAX = 60.0
"""Limit: rad, some ten turns: "if these are degrees, name it …"."""
SEGMENT_ROWS_MIN = 4
"""Limit: rows of a segment: "at least 4 are needed"."""
SEGMENT_STEPS_MAX = 10_000_000
"""Limit: steps of a segment, its gaps included: "lasts …, over 10 000 000 of its steps"."""
TURN_SHARE = 0.75
"""Tolerance: of a turn, a jump between samples that is no motion, if all readings lie within one turn."""
GAP_STEPS = 1.5
"""Format: a step longer than this many usual ones is reported as a gap."""
ANGLES = ("absolute", "relative")


@dataclass(frozen=True, order=True)
class Sensor:
    """The angle of a link, `pendulum` and `link` from 1, or with both 0 the position of the cart.

    With a `carrier` it is that coordinate of a structure, as NAME_m or NAME_rad.  A `quantity` of a link is its
    "rate", its angle "relative" to the link above, "x" or "y" of its end, or the acceleration "along" or "across" it at
    the distance `radius` (m) from its joint (`QUANTITIES`).
    """

    pendulum: int = 0
    link: int = 0
    carrier: str = ""
    quantity: str = ""
    radius: float = 0.0

    @property
    def name(self) -> str:
        """As in the columns of a file, without the unit."""
        if self.carrier:
            return self.carrier.removesuffix(f"_{self.unit}")
        if not self.pendulum:
            return "cart"
        name = QUANTITIES[self.quantity][0].format(f"{self.pendulum}_{self.link}")
        return f"{name}@{self.radius:g}" if self.quantity in ACCELERATIONS else name

    @property
    def words(self) -> str:
        """Its name in reports."""
        return signal_words(self.name)

    @property
    def unit(self) -> str:
        """The unit of its readings; 1 for coordinates of modal supports."""
        if self.carrier:
            last = self.carrier.rpartition("_")[2]
            return last if last in {"m", "rad"} else "1"
        return QUANTITIES[self.quantity][1] if self.pendulum else "m"

    @property
    def is_angle(self) -> bool:
        """Whether it reads the angle of a link."""
        return bool(self.pendulum) and self.unit == "rad"

    @property
    def is_of_point(self) -> bool:
        """Whether it reads a point of a link."""
        return self.quantity in (*AXES, *ACCELERATIONS)

    @property
    def is_even(self) -> bool:
        """Whether it reads the same of a swing to either side, at twice its frequency."""
        return self.quantity in ("y", "along")


@dataclass(frozen=True, eq=False, repr=False)
class Segment(Displayed):
    """A motion recorded without interruption.

    `times` (K,) in s, ascending; `values` (K, C) in rad and m, NaN if a sensor has no value. The next segment may be
    its continuation.
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

    `continued` are the names of sensors whose jumps by a turn were taken out; `readings` say how files were read.
    """

    what = "Recorded motions"
    shows = "segments: segments; sensors: sensors; unused: columns not used; readings: read as"

    sensors: tuple[Sensor, ...]
    segments: tuple[Segment, ...]
    relative: bool = False
    unused: tuple[str, ...] = ()
    continued: tuple[str, ...] = ()
    readings: tuple[str, ...] = ()

    @property
    def n_values(self) -> int:
        """Number of values that are there."""
        return sum(int(np.count_nonzero(np.isfinite(segment.values))) for segment in self.segments)

    def take(self, which: Sequence[int]) -> Recording:
        """Some of its segments."""
        return replace(self, segments=tuple(self.segments[k] for k in which))

    def unwrap_angles(self) -> Recording:
        """Return the recording with unwrapped angles (`unwrap`)."""
        segments, names = [], dict.fromkeys(self.continued)
        for segment in self.segments:
            values = segment.values.copy()
            for c, sensor in enumerate(self.sensors):
                if sensor.is_angle and is_wrapped(values[:, c]):
                    values[:, c] = unwrap(values[:, c])
                    names[sensor.name] = None
            segments.append(replace(segment, values=values))
        return replace(self, segments=tuple(segments), continued=tuple(names)) if names else self

    def absolute(self) -> Recording:
        """With angles from the vertical; raise SceneError if relative ones of links above are not recorded."""
        if not self.relative:
            return self
        at = {
            (sensor.pendulum, sensor.link): k
            for k, sensor in enumerate(self.sensors)
            if sensor.pendulum and not sensor.quantity
        }
        missing = {f"theta_{p}_{i}" for p, link in at for i in range(1, link) if (p, i) not in at}
        if missing:
            raise SceneError([f"relative angles need {listed(sorted(missing), len(missing))} too"])
        sums = np.eye(len(self.sensors))
        for (pendulum, link), k in at.items():
            sums[k, [at[pendulum, i] for i in range(1, link + 1)]] = 1.0
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
    """Angles (K,) that change by less than half a turn from each sample to the next that is there."""
    angles, is_present = values.copy(), np.isfinite(values)
    angles[is_present] = np.unwrap(values[is_present])
    return angles


Source = str | os.PathLike[str] | Mapping[str, Any] | DataTable
"""A file, or columns in Python: a mapping of arrays or a data frame."""


def read_recording(
    scene: Scene | None,
    paths: Sequence[Source],
    *,
    where: Mapping[str, str] | None = None,
    angles: str = "absolute",
    columns: Mapping[str, str] | None = None,
    every: int = 1,
    pixel: float | None = None,
) -> Recording:
    """The recording in these files or arrays, of a scene whose links and cart the sensors read, or of any with None.

    `where` gives columns with the value, or the range such as "6.2:19", that used rows have there, and of these
    `every` N-th row is used; `columns` says what columns with other headings hold, such as {"t": "time_ms",
    "theta_1_2_rad": "-theta_1_2_rad"}.  A `pixel` (m) is the scale of marks in pixels, x_1_1_px.  SceneError lists
    every mistake.
    """
    problems: list[str] = []
    if angles not in ANGLES:
        problems.append(f"angles {angles}: must be {' or '.join(ANGLES)}")
    if every < 1:
        problems.append(f"every {every}: must be at least 1")
    if pixel is not None and not 0 < pixel < inf:
        problems.append(f"pixel {pixel:g}: must be above 0, the metres of one")
    if not paths:
        problems.append("no file of measured motions is given")
    refuse_any(problems)
    carriers = carrier_columns(scene)
    tables: list[DataTable] = []
    derived: set[str] = set()
    for path in paths:
        with gathered(problems):
            table = _recorded_table(path, scene, where or {}, columns or {}, carriers)
            is_still = RUNS in table.columns and len(set(table.words(RUNS))) == 1
            if _has_no_cart(scene) if scene else is_still:
                table = table.renamed({RUNS: f"({RUNS})"} if RUNS in table.columns else {})
            rates = _derived_rates(table, columns or {}, carriers)
            derived |= rates
            table = table.without(rates)
            problems += _unscaled(table, carriers) if pixel is None else []
            tables.append(table.take(range(0, len(table), every)) if every > 1 else table)
    refuse_any(problems)
    sensors = sorted({sensor for table in tables for column in table.columns if (sensor := _sensor(column, carriers))})
    problems += [problem for sensor in sensors if scene for problem in _absent(scene, sensor)]
    segments: list[Segment] = []
    for table in tables:
        with gathered(problems):
            segments += _segments(table, sensors, carriers, pixel or 1.0)
    problems += _empty(sensors, segments) if not problems else []
    refuse_any(problems)
    unknown = {column for table in tables for column in table.columns if not _is_known(column, carriers)}
    other_columns = (unknown | derived) - {*(where or {}), f"({RUNS})"}
    recording = Recording(tuple(sensors), tuple(segments), angles == "relative", tuple(sorted(other_columns)))
    return replace(recording.unwrap_angles(), readings=tuple(map(_reading, tables)))


def _reading(table: DataTable) -> str:
    """The interpretation of a file: its delimiter, its columns, its rate and its gaps."""
    clock, factor = table.seconds() or (TIME, 1.0)
    steps = np.diff(factor * table.numbers(clock))
    step = float(np.median(steps)) if len(steps) else 0.0
    gaps = int(np.count_nonzero(steps > GAP_STEPS * step))
    rate = f"{len(table)} rows" + (f" at {1 / step:.6g} Hz" if step > 0 else "")
    words = [table.described(), rate, counted(gaps, "gap", "gaps") if gaps else ""]
    return f"{table.name}: {'; '.join(filter(None, words))}"


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


def _derived_rates(table: DataTable, meanings: Mapping[str, str], carriers: Carriers) -> set[str]:
    """The columns of rates that stand next to the angle of their link, from which they are mostly computed.

    Those that `meanings` name are sensors.
    """
    sensors = {column: sensor for column in table.columns if (sensor := _sensor(column, carriers))}
    angles = {(sensor.pendulum, sensor.link) for sensor in sensors.values() if sensor.pendulum and not sensor.quantity}
    return {
        column
        for column, sensor in sensors.items()
        if sensor.quantity == "rate" and (sensor.pendulum, sensor.link) in angles and column not in meanings.values()
    }


def _unscaled(table: DataTable, carriers: Carriers) -> Iterator[str]:
    """The message on marks in pixels without their scale."""
    for column in table.columns:
        if column.endswith(f"_{PIXELS}") and _is_sensor(column, carriers):
            yield f"{table.name}: column {column}: needs `pixel`, the metres of one"


def _is_sensor(column: str, carriers: Carriers) -> bool:
    return _sensor(column, carriers) is not None


def _sensor(column: str, carriers: Carriers) -> Sensor | None:
    """The sensor of a column, None if there is none.

    >>> _sensor("acceleration_along_1_2_m_per_s2@0.25", {})
    Sensor(pendulum=1, link=2, carrier='', quantity='along', radius=0.25)
    """
    bare = column.removeprefix("-")
    if bare in carriers:
        return carriers[bare]
    name, sign, distance = _si_name(bare)[0].partition("@")
    if not sign and name in CARTS:
        return Sensor()
    for quantity, pattern in SENSORS.items():
        match = pattern.fullmatch(name)
        if match and bool(sign) == (quantity in ACCELERATIONS) and (not sign or DISTANCE.fullmatch(distance)):
            return Sensor(int(match["pendulum"]), int(match["link"]), "", quantity, float(distance or 0.0))
    return None


def _si_name(column: str, pixel: float = 1.0) -> tuple[str, float]:
    """A column's name in SI units, and the factor of its numbers, of which pixels are this many metres."""
    name, sign, distance = column.removeprefix("-").partition("@")
    if name.endswith(f"_{PIXELS}"):
        name, factor = f"{name.removesuffix(PIXELS)}m", pixel
    else:
        name, factor = in_si(name)
    return f"{name}{sign}{distance}", -factor if column.startswith("-") else factor


def _is_known(column: str, carriers: Carriers) -> bool:
    return column in {*TIMES, SEGMENT} or _is_sensor(column, carriers)


def _absent(scene: Scene, sensor: Sensor) -> Iterator[str]:
    """The part that the sensor needs and the scene lacks."""
    if not sensor.pendulum:
        if not sensor.carrier and _has_no_cart(scene):
            yield "column cart_m: the scene has no cart"
        return
    sizes = [pendulum.n_links for pendulum in scene.pendulum for _ in range(pendulum.count)]
    if sensor.pendulum > len(sizes):
        yield f"column {sensor.name}: the scene has {counted(len(sizes), 'pendulum', 'pendula')}"
    elif sensor.link > sizes[sensor.pendulum - 1]:
        yield f"column {sensor.name}: the pendulum has {counted(sizes[sensor.pendulum - 1], 'link', 'links')}"
    elif sensor.is_of_point and (reason := unreadable(system_of(scene))):
        yield f"column {sensor.name}: {reason}, where only angles and rates of links are read"


def _recorded_table(
    source: Source, scene: Scene | None, where: Mapping[str, str], meanings: Mapping[str, str], carriers: Carriers
) -> DataTable:
    """The rows of a file that are used, under the columns that it has or that its headings were found to mean."""
    table = source if isinstance(source, DataTable) else read_table(source)
    wrong = [
        f"column {old}: {new}: must be time_s, time_ms, {COLUMNS}, or - and one of these"
        for old, new in meanings.items()
        if not _is_known(new, carriers)
    ]
    try:
        table = table.renamed(meanings)
    except SceneError as error:
        raise SceneError([*error.problems, *(f"{table.name}: {problem}" for problem in wrong)]) from None
    table = _with_angles(table, scene, carriers)
    if problems := [*wrong, *_header_problems(table, where, carriers)]:
        raise SceneError([f"{table.name}: {problem}" for problem in problems])
    used = table.where(where)
    if not len(used):
        asked_for = " with the requested values" if len(table) and where else ""
        raise SceneError([f"{table.name}: has no rows{asked_for}"])
    return used


def _with_angles(table: DataTable, scene: Scene | None, carriers: Carriers) -> DataTable:
    """With the time by its name, and angles of other names as those of links where that is beyond doubt."""
    clock = table.seconds()
    names = {} if clock is None or clock[0] in TIMES else {clock[0]: TIME if clock[1] == 1 else clock[0]}
    if any(_is_sensor(column, carriers) for column in table.columns):
        return table.renamed(names)
    units = {column: match for column in table.columns if (match := ANGLE.fullmatch(column))}
    numbers = [match["number"] for match in units.values()]
    counts = [pendulum.n_links for pendulum in scene.pendulum for _ in range(pendulum.count)] if scene else [len(units)]
    is_clear = len(units) == 1 == sum(counts) or (
        len(counts) == 1 and numbers == [str(k) for k in range(1, counts[0] + 1)]
    )
    if is_clear:
        for k, (column, match) in enumerate(units.items(), 1):
            names[column] = f"theta_1_{k}_{match['unit']}"
    return table.renamed(names)


def _header_problems(table: DataTable, where: Mapping[str, str], carriers: Carriers) -> Iterator[str]:
    columns = table.columns
    times = [heading for heading in columns if heading in TIMES]
    if not times:
        yield f"has no column {TIME}{spelling_hint(TIME, columns)}{_likely_causes(table, 't=time_s')}"
    if len(set(times)) > 1:
        yield f"columns {listed(times, len(times))}: are the time in two units"
    yield from (f"column {heading}: appears twice" for heading in dict.fromkeys(columns) if columns.count(heading) > 1)
    yield from (
        f"column {heading}: is missing{spelling_hint(heading, columns)}" for heading in where if heading not in columns
    )
    for column in columns:
        if column not in where and not _is_known(column, carriers) and not time_unit(column) and LIKE_ONE.match(column):
            yield f"column {column}: must be {COLUMNS}, with P and L from 1"
    sensors = [column for column in columns if _is_sensor(column, carriers)]
    if not sensors:
        causes = _likely_causes(table, "angle=theta_1_1_deg")
        yield f"has no column of a sensor, such as theta_1_1_rad or cart_m{causes if times else ''}"
    sensor_of = {heading: _sensor(heading, carriers) for heading in sensors}
    twice = [
        heading for heading in sensors if len({twin for twin in sensors if sensor_of[twin] == sensor_of[heading]}) > 1
    ]
    if twice:
        yield f"columns {listed(twice, len(twice))}: are one sensor in two units"


def _likely_causes(table: DataTable, example: str) -> str:
    """The heading as read, and why it may not suffice."""
    if not table.headings:
        return ""
    heading = " | ".join(table.headings)
    return (
        f": the heading reads “{heading:.200}” ({table.described() or 'cells between commas'}). Perhaps the column has "
        f"another name (`columns={example}`), has no unit that is known, or the heading is on another line"
    )


def _segments(table: DataTable, sensors: Sequence[Sensor], carriers: Carriers, pixel: float) -> list[Segment]:
    name, problems, number = table.name, list[str](), dict[str, Floats]()
    for column in table.columns:
        if column in TIMES or _is_sensor(column, carriers):
            with gathered(problems):
                number[column] = table.numbers(column)
    refuse_any(problems)
    clock = next(column for column in table.columns if column in TIMES)
    times = TIMES[clock] * number[clock]
    values = np.full((len(times), len(sensors)), nan)
    for column, readings in number.items():
        if column != clock and (sensor := _sensor(column, carriers)):
            values[:, sensors.index(sensor)] = _si_name(column, pixel)[1] * readings
    names = table.words(SEGMENT) if SEGMENT in table.columns else [""] * len(table)
    segments: list[Segment] = []
    at = 0
    for segment, group in groupby(names):
        count = len([*group])
        within = slice(at, at + count)
        at += count
        segments.append(Segment(name, segment, times[within], values[within]))
        problems += _segment_problems(segments[-1], sensors, table.lines[within])
    titles = [segment.name for segment in segments]
    duplicates = [title for title in dict.fromkeys(titles) if titles.count(title) > 1]
    problems += [f"{name}: segment {title}: its rows are not contiguous" for title in duplicates]
    refuse_any(problems)
    return segments


def _segment_problems(segment: Segment, sensors: Sequence[Sensor], lines: Sequence[int]) -> Iterator[str]:
    missing = np.flatnonzero(~np.isfinite(segment.times))
    if len(missing):
        yield f"{segment.where}: a time is missing in line {lines[missing[0]]}"
        return
    back = np.flatnonzero(np.diff(segment.times) <= 0)
    if len(back):
        at = segment.times[back[0]]
        way = f"`where={TIME}=…:…` removes such rows"
        yield f"{segment.where}: the time does not increase after {at:.9g} s, in line {lines[back[0] + 1]}: {way}"
    if len(segment.times) > 1:
        yield from _clock_problems(segment)
    if len(segment.times) < SEGMENT_ROWS_MIN:
        rows = counted(len(segment.times), "row", "rows")
        yield f"{segment.where}: has {rows}, at least {SEGMENT_ROWS_MIN} are needed"
    for sensor, values in zip(sensors, segment.values.T, strict=True):
        numbers = values[np.isfinite(values)]
        if sensor.is_angle and len(numbers) and np.abs(numbers).max() > RECORD_ANGLE_MAX:
            largest = float(np.abs(numbers).max())
            hint = f"if these are degrees, name it {sensor.name}_deg"
            yield f"{segment.where}: {sensor.name} reaches {largest:.4g} rad: {hint}"


def _clock_problems(segment: Segment) -> Iterator[str]:
    """Times that double precision cannot square, and gaps of more samples than can be filled."""
    step, span = float(np.median(np.diff(segment.times))), float(segment.times[-1]) - float(segment.times[0])
    largest = float(np.abs(segment.times).max())
    if largest > MEASURED_MAX or 0 < step < MEASURED_MIN:
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
        if largest and not MEASURED_MIN <= largest <= MEASURED_MAX:
            yield f"column {sensor.name}: reaches {largest:.3g} {sensor.unit}: {SIZES_READ}"
        elif np.ptp(values) == 0:
            yield f"column {sensor.name}: is constant, {values[0]:.6g} {sensor.unit}: nothing can be fitted to it"
    for segment in segments:
        if int(np.count_nonzero(np.isfinite(segment.values))) < SEGMENT_ROWS_MIN:
            yield f"{segment.where}: has no values"
