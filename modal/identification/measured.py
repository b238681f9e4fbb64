"""Measured modes, and how they compare with computed ones.

Measured modes are rows of a CSV file with the number of a mode, its frequency and standard deviation:

    mode, frequency_hz, std_hz [, damping_ratio [, damping_ratio_std]] [, cart, theta_1_1, theta_1_2, …] [, shape_std]

`mode` is the number in the table of modes, `frequency_hz` the natural frequency |λ|/2π, as there. Columns `theta_P_L`
and `cart` are a shape of any scale, angles from the vertical in rad next to metres, the real part of a complex one
after `turned`; on a structure its coordinates stand in columns of their own names, as `floor1_m`. Empty cells are
missing values.

They are compared by

    MAC_rs = |φ_rᴴψ_s|²/((φ_rᴴφ_r)(ψ_sᴴψ_s))

over the components that were measured, as they stand: angles in rad, the cart in m [Allemang1982], [Ewins2000, §7.4].
Where all measured modes have shapes, pairs are those of the largest MAC; else those of the nearest frequencies, by the
least sum of |ln f/f'|.
"""

from __future__ import annotations

import csv
import io
import os
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from math import isfinite, log, nan, pi
from typing import Any

import numpy as np
import scipy

from modal.errors import ComputationError, SceneError, gathered, refuse_any, spelling_hint
from modal.modes import Mode, Modes
from modal.report import NOTHING, Displayed, Form, ReportColumn, ReportTable, Result, counted, finite, records_of
from modal.scene import Scene
from modal.scene.contents import MEASURED_MAX, MEASURED_MIN, SIZES_READ, first_line, text_of
from modal.scene.doors import checked
from modal.structure import structure_of
from modal.types import Complexes, Floats, Ints

MODE, FREQUENCY, STD = "mode", "frequency_hz", "std_hz"
RATIO, RATIO_STD, SHAPE_STD = "damping_ratio", "damping_ratio_std", "shape_std"
NEEDED = (MODE, FREQUENCY, STD)
OPTIONAL = (RATIO, RATIO_STD, SHAPE_STD)
CART = "cart"
COMPONENT = re.compile(r"theta_([1-9][0-9]{0,6})_([1-9][0-9]{0,6})|cart", re.ASCII)
NEAR = re.compile(r"theta|cart|freq|std|damp|shape", re.ASCII)


@dataclass(frozen=True, eq=False, repr=False)
class MeasuredMode(Displayed):
    """A mode: its `number` in the table, frequency and standard deviation (Hz), damping ratio and shape where measured.

    `shape` (C,) has NaN for components without a value; `shape_std` is the standard deviation of a component where the
    largest is 1.
    """

    what = "Measured mode"
    shows = (
        "number: number in the table; frequency: frequency, Hz; std: ±, Hz; damping_ratio: damping ratio; "
        "damping_ratio_std: ±; shape: shape"
    )

    number: int
    frequency: float
    std: float
    damping_ratio: float | None = None
    damping_ratio_std: float | None = None
    shape: Floats | None = None
    shape_std: float | None = None


@dataclass(frozen=True, eq=False, repr=False)
class MeasuredModes(Displayed):
    """Modes of a file; `components` are the columns of shapes, (pendulum, link) from 1 and (0, 0) for the cart.

    On a structure (0, k) is that of its `coordinates` with the index k.
    """

    what = "Measured modes"
    shows = "file: file; modes: modes; components: components of shapes; unused: columns not used"

    file: str
    modes: tuple[MeasuredMode, ...]
    components: tuple[tuple[int, int], ...] = ()
    unused: tuple[str, ...] = ()
    coordinates: tuple[str, ...] = (CART,)

    @property
    def labels(self) -> list[str]:
        """The components as in columns."""
        return [f"theta_{p}_{l}" if p else self.coordinates[l] for p, l in self.components]


def coordinates_of(scene: Scene) -> tuple[str, ...]:
    """The columns of the coordinates before the angles: `cart`, or those of a structure."""
    if not scene.is_structured:
        return (CART,) * (scene.cart is not None)
    names = structure_of(scene).names
    return (CART,) if names == ("x",) else names


def has_modes(path: str | os.PathLike[str]) -> bool:
    """Whether a file is a table of measured modes, by the column `mode` in its first line."""
    return MODE in [word.strip() for word in first_line(path).split(",")]


@checked
def read_modes(scene: Scene, path: str | os.PathLike[str]) -> MeasuredModes:
    """The measured modes in a file, of a scene that has the components of their shapes; SceneError lists mistakes."""
    name = os.fspath(path)
    with _mistakes_of(name):
        text = text_of(path, "table")
    return parse_modes(scene, name, text)


@checked
def parse_modes(scene: Scene, name: str, text: str) -> MeasuredModes:
    """The measured modes in the text of such a file, called `name`; SceneError lists mistakes."""
    with _mistakes_of(name):
        return _parse_table(scene, name, text)


@contextmanager
def _mistakes_of(name: str) -> Iterator[None]:
    """Mistakes are those of the file of this name."""
    try:
        yield
    except SceneError as error:
        raise SceneError([f"{name}: {problem}" for problem in error.problems]) from None


def _parse_table(scene: Scene, name: str, text: str) -> MeasuredModes:
    try:
        reader = csv.reader(line for line in io.StringIO(text, newline="") if not line.startswith("#"))
        rows = [(reader.line_num, [cell.strip() for cell in row]) for row in reader if any(map(str.strip, row))]
    except csv.Error as error:
        raise SceneError([f"{error}"]) from None
    header = rows[0][1] if rows else []
    problems = [*_header_problems(scene, header)]
    problems += [
        f"line {line}: must have {len(header)} cells like the first" for line, row in rows if len(row) != len(header)
    ]
    if not rows[1:]:
        problems.append("has no modes")
    refuse_any(problems)
    coordinates = coordinates_of(scene)
    components = [column for column in header if column in coordinates or COMPONENT.fullmatch(column)]
    modes = []
    for line, row in rows[1:]:
        with gathered(problems):
            modes.append(_mode(line, dict(zip(header, row, strict=True)), components))
    numbers = [mode.number for mode in modes]
    problems += [f"mode {number}: appears twice" for number in dict.fromkeys(numbers) if numbers.count(number) > 1]
    refuse_any(problems)
    unused = tuple(column for column in header if column not in (*NEEDED, *OPTIONAL, *components))
    places = tuple(_component(column, coordinates) for column in components)
    return MeasuredModes(name, tuple(modes), places, unused, coordinates)


def _component(column: str, coordinates: Sequence[str]) -> tuple[int, int]:
    match = COMPONENT.fullmatch(column)
    if match and match[1]:
        return int(match[1]), int(match[2])
    return 0, coordinates.index(column) if column in coordinates else 0


def _header_problems(scene: Scene, header: Sequence[str]) -> Iterator[str]:
    for column in NEEDED:
        if column not in header:
            yield f"has no column {column}{spelling_hint(column, header)}"
    yield from (
        f"column {heading}: appears twice" for heading in dict.fromkeys(header) if heading and header.count(heading) > 1
    )
    for column in (RATIO_STD,):
        if column in header and RATIO not in header:
            yield f"column {column}: needs {RATIO}"
    sizes = [heading.n_links for heading in scene.pendulum for _ in range(heading.count)]
    coordinates = coordinates_of(scene)
    for column in header:
        if COMPONENT.fullmatch(column):
            pendulum, link = _component(column, coordinates)
            if not pendulum and column not in coordinates:
                words = f": its coordinates are {', '.join(coordinates)}" if coordinates else ""
                yield f"column {column}: the scene has no cart{words}"
            elif pendulum > len(sizes):
                yield f"column {column}: the scene has {counted(len(sizes), 'pendulum', 'pendula')}"
            elif pendulum and link > sizes[pendulum - 1]:
                yield f"column {column}: the pendulum has {counted(sizes[pendulum - 1], 'link', 'links')}"
        elif column not in (*NEEDED, *OPTIONAL, *coordinates) and NEAR.match(column):
            known_columns = (*NEEDED, *OPTIONAL, *(name for name in coordinates if name != CART))
            hint = spelling_hint(column, known_columns)
            yield f"column {column}: must be one of {', '.join(known_columns)}, theta_P_L or cart{hint}"


def _mode(line: int, row: dict[str, str], components: Sequence[str]) -> MeasuredMode:
    problems: list[str] = []

    def number(column: str, least: float, strict: bool, needed: bool) -> float | None:
        word = row.get(column, "")
        if not word or word.lower() == "nan":
            if needed:
                problems.append(f"line {line}, {column}: is missing")
            return None
        try:
            value = float(word)
        except ValueError:
            value = nan
        if isfinite(value) and abs(value) != 0 and not MEASURED_MIN <= abs(value) <= MEASURED_MAX:
            problems.append(f"line {line}, {column} = {word:.40}: {SIZES_READ}")
            return None
        if not isfinite(value) or value < least or (strict and value == least):
            limit = f"above {least:g}" if strict else f"of at least {least:g}" if isfinite(least) else "that is finite"
            problems.append(f"line {line}, {column} = {word:.40}: must be a number {limit}")
            return None
        return value

    number_cell = row[MODE]
    if not (number_cell.isascii() and number_cell.isdigit() and int(number_cell[:9]) >= 1 and len(number_cell) < 9):
        problems.append(f"line {line}, {MODE} = {number_cell:.40}: must be a whole number from 1")
    frequency, std = number(FREQUENCY, 0.0, True, True), number(STD, 0.0, True, True)
    ratio, ratio_std = number(RATIO, -1.0, True, False), number(RATIO_STD, 0.0, True, False)
    if ratio is not None and not ratio < 1:
        problems.append(f"line {line}, {RATIO} = {row[RATIO]:.40}: must be below 1")
    if ratio is None and ratio_std is not None:
        problems.append(f"line {line}, {RATIO_STD}: has no {RATIO} beside it")
    shape_std = number(SHAPE_STD, 0.0, True, False)
    cells = [number(column, -np.inf, False, False) for column in components]
    shape = np.array([nan if cell is None else cell for cell in cells]) if components else np.zeros(0)
    is_present = np.isfinite(shape)
    if is_present.any() and not np.any(shape[is_present]):
        problems.append(f"line {line}: its shape is zero")
    refuse_any(problems)
    assert frequency is not None
    assert std is not None
    shape_read = shape if np.count_nonzero(is_present) > 1 else None
    return MeasuredMode(int(number_cell), frequency, std, ratio, ratio_std, shape_read, shape_std)


# ------------------------------------------------------------------------------------------- computed components


def component_rows(scene: Scene, components: Sequence[tuple[int, int]]) -> Ints:
    """The place of every component in a column of modes."""
    sizes = [pendulum.n_links for pendulum in scene.pendulum for _ in range(pendulum.count)]
    first = np.cumsum([len(coordinates_of(scene)), *sizes])
    return np.array([l if not p else first[p - 1] + l - 1 for p, l in components], dtype=np.int64)


def turned(phi: Complexes) -> Complexes:
    """A shape (C,) multiplied by e^{−iα}, 2α = arg Σφ², so that its real part is as large as it can be."""
    return np.asarray(phi * np.exp(-0.5j * np.angle(np.sum(phi**2))))


@dataclass(frozen=True, repr=False)
class ModePair(Displayed):
    """A measured mode and the computed one nearest to it; `mac` is None without shapes."""

    measured: MeasuredMode
    computed: Mode
    mac: float | None

    @property
    def frequency(self) -> float:
        """The computed one, in Hz."""
        return self.computed.omega / (2 * pi)

    @property
    def error(self) -> float:
        """The error of the computed frequency, relative to the measured one."""
        return self.frequency / self.measured.frequency - 1

    @property
    def deviation(self) -> float:
        """The deviation of the computed frequency, in standard deviations of the measured one."""
        return (self.frequency - self.measured.frequency) / self.measured.std


PAIR = (
    ReportColumn("measured.number", "measured", "measured"),
    ReportColumn("computed.number", "computed", "table"),
    ReportColumn("mac", "mac", "MAC", ".4f"),
    ReportColumn("measured.frequency", "measured_frequency_hz", "f (Hz)", ".6g"),
    ReportColumn("measured.std", "std_hz", "±", ".2g"),
    ReportColumn("frequency", "computed_frequency_hz", "computed (Hz)", ".6g"),
    ReportColumn("error", "relative_error", "error (%)", lambda error: f"{100 * error:+.3g}"),
    ReportColumn("deviation", "deviation_in_stds", "error (±)", "+.2g"),
    ReportColumn("measured.damping_ratio", "measured_damping_ratio", "ζ", ".4g"),
    ReportColumn("computed.damping_ratio", "computed_damping_ratio", "computed ζ", ".4g"),
)
"""The quantities of a pair."""


@dataclass(frozen=True, eq=False, repr=False)
class Assurance(Result):
    """MAC (R, S) of measured modes with the oscillating ones computed, `rows`; NaN if there is no shape."""

    modes: Modes
    measured: MeasuredModes
    rows: tuple[Mode, ...]
    mac: Floats
    pairs: tuple[ModePair, ...]

    what = "measured and computed modes"

    @property
    def scene(self) -> Scene:
        """The scene of the computed modes."""
        return self.modes.scene

    @property
    def notes(self) -> list[str]:
        """Notes on the pairs."""
        notes = []
        for pair in self.pairs:
            if pair.mac is not None and pair.mac < 0.5:  # less than half of one shape is in the other
                notes.append(f"mode {pair.measured.number}: no computed shape is like it (MAC {pair.mac:.2f})")
            elif pair.computed.number != pair.measured.number:
                notes.append(
                    f"mode {pair.measured.number} of the file is like mode {pair.computed.number} of the table"
                )
        if np.isfinite(self.mac).any() and len(self.measured.components) < len(self.rows):
            notes.append("fewer components than modes: shapes of different modes may look alike")
        return notes

    def parts(self, form: Form = "text") -> Iterator[ReportTable | str]:
        """The pairs, the matrix if there are shapes, and the notes."""
        yield ReportTable.of(PAIR, self.pairs)
        if np.isfinite(self.mac).any():
            yield ReportTable(
                ["MAC", *(str(mode.number) for mode in self.rows)],
                [
                    [str(mode.number), *(NOTHING if np.isnan(value) else f"{value:.3f}" for value in values)]
                    for mode, values in zip(self.measured.modes, self.mac, strict=True)
                ],
            )
        yield "\n".join(f"{note[0].upper()}{note[1:]}." for note in self.notes)

    def records(self) -> list[dict[str, Any]]:
        """The matrix, a measured mode each."""
        names = [f"mode_{mode.number}" for mode in self.rows]
        return [
            {"measured": mode.number} | dict(zip(names, values, strict=True))
            for mode, values in zip(self.measured.modes, self.mac.tolist(), strict=True)
        ]

    def whole(self) -> dict[str, Any]:
        """The matrix, the pairs and the notes."""
        return {
            "measured": [mode.number for mode in self.measured.modes],
            "computed": [mode.number for mode in self.rows],
            "components": self.measured.labels,
            "mac": [list(map(finite, values)) for values in self.mac.tolist()],
            "pairs": records_of(PAIR, self.pairs),
            "notes": self.notes,
        }


@checked
def compare_modes(modes: Modes, measured: MeasuredModes) -> Assurance:
    """Compare measured modes with those of a scene that oscillate; a repeated frequency has its nearest shape's MAC.

    Raise ComputationError if nothing oscillates.
    """
    rows = tuple(mode for mode in modes if mode.oscillates and mode.omega > 0)
    if not rows:
        raise ComputationError("no mode of this scene oscillates")
    places = component_rows(modes.scene, measured.components)
    mac = np.full((len(measured.modes), len(rows)), np.nan)
    for r, measured_mode in enumerate(measured.modes):
        if measured_mode.shape is None:
            continue
        is_measured = np.isfinite(measured_mode.shape)
        for s, mode in enumerate(rows):
            members = (modes.matrix.row == modes.index_of(mode)) & ~modes.matrix.across
            basis = modes.matrix.shapes[:, members][places[is_measured]]
            mac[r, s] = mac_with(measured_mode.shape[is_measured], basis)
    return Assurance(modes, measured, rows, mac, tuple(_pairs(measured, rows, mac)))


def mac_with(shape: Floats, basis: Any) -> float:
    """MAC with the nearest combination of the columns of a basis (C, k); 0 if none has these components."""
    if not basis.shape[1]:
        return 0.0
    if basis.shape[1] == 1:
        phi = turned(basis[:, 0]).real
        sizes = float((shape @ shape) * (phi @ phi))
        return float((shape @ phi) ** 2) / sizes if sizes else 0.0
    Q, R, *_ = np.linalg.svd(basis, full_matrices=False)
    Q = Q[:, 1e-10 * R[0] < R]
    return float(np.linalg.norm(Q.conj().T @ shape) ** 2 / (shape @ shape)) if Q.size else 0.0


def _pairs(measured: MeasuredModes, rows: tuple[Mode, ...], mac: Floats) -> list[ModePair]:
    has_shapes = bool(np.isfinite(mac).all())
    cost = np.array(
        [
            [abs(log(measured_mode.frequency / (mode.omega / (2 * pi)))) for mode in rows]
            for measured_mode in measured.modes
        ]
    )
    measured_rows, computed_rows = scipy.optimize.linear_sum_assignment(-mac if has_shapes else cost)
    return [
        ModePair(measured.modes[r], rows[s], None if np.isnan(mac[r, s]) else float(mac[r, s]))
        for r, s in zip(measured_rows.tolist(), computed_rows.tolist(), strict=True)
    ]


@checked
def assurance_table(assurance: Assurance, form: Form) -> str:
    """The pairs and the matrix as text or json, the matrix alone as csv, by `form`."""
    return assurance.report(form)
