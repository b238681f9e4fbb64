"""Sweeps on disk: NPZ has every number over the grid, CSV one row per point for other programs, JSON both and more.

Both have a header in JSON, that of a CSV in a file next to it: the scene, the variations, the measures and the points
that failed. A column of an axis is named by its path and unit. Both carry a checksum, and a file that has been altered
is refused.
"""

from __future__ import annotations

import csv
import io
import os
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from modal.report import as_json, csv_cell, finite
from modal.scene import kind_of, whole_file
from modal.scene.sealed import index, reading, require_keys
from modal.types import Floats
from modal.vibration import KINDS as STABILITY
from nonlinear.files import as_npz, checked_kind, from_csv, from_npz, write_csv
from nonlinear.sweeps.running import Sweep
from nonlinear.sweeps.study import Row, Study, study_from

REASON = "reason"
KINDS = ("npz", "csv", "json")


def save(sweep: Sweep, path: str | os.PathLike[str]) -> None:
    """Write a .npz, .csv or .json file atomically; raise SceneError for any other file name."""
    if (kind := kind_of(path, KINDS)) == "csv":
        write_csv(path, _header(sweep), _rows(sweep))
        return
    if kind == "npz":
        axes = {variation.column: np.array(variation.values) for variation in sweep.study.variations}
        content = as_npz(_header(sweep), axes | {name: sweep.values(name) for name in sweep.columns})
    else:
        content = _json(sweep)
    with whole_file(path) as stream:
        stream.write(content)


def load(path: str | os.PathLike[str]) -> Sweep:
    """Read a sweep from a .npz or .csv file written by `save`; SceneError says what is wrong with any other file."""
    name, kind = os.fspath(path), checked_kind(path)
    with reading(name, "sweep"):
        return _read_npz(name) if kind == "npz" else _read_csv(name)


def _header(sweep: Sweep) -> dict[str, Any]:
    failed = {str(index): reason for index, reason in sweep.failures.items()}
    done = None if sweep.complete else [row.index for row in sweep.rows]
    return {"multipendula_sweep": sweep.study.header(), "columns": sweep.columns, "failed": failed, "done": done}


class _SweepFile(NamedTuple):
    """The contents of a header: the study, the column names, the points tried and why some failed."""

    study: Study
    columns: tuple[str, ...]
    indices: tuple[int, ...]
    failed: dict[int, str]
    complete: bool

    @property
    def axes(self) -> list[str]:
        return [variation.column for variation in self.study.variations]

    def sweep(self, table: Floats) -> Sweep:
        """The sweep with these numbers (size, columns) over the whole grid."""
        rows = (
            Row(index, {}, self.failed[index])
            if index in self.failed
            else Row(index, dict(zip(self.columns, table[index].tolist(), strict=True)))
            for index in self.indices
        )
        return Sweep(self.study, tuple(rows), interrupted=not self.complete)


def _file_of(header: dict[str, Any]) -> _SweepFile:
    require_keys(header, "multipendula_sweep", "columns", "failed", "done")
    study, columns, done = study_from(header["multipendula_sweep"]), tuple(header["columns"]), header["done"]
    indices = tuple(range(study.size) if done is None else (index(number, study.size) for number in done))
    failed = {int(number): reason for number, reason in header["failed"].items()}
    file = _SweepFile(study, columns, indices, failed, done is None)
    names, reasons = [*file.axes, *columns], list(failed.values())
    in_order = all(earlier < later for earlier, later in pairwise(indices)) and failed.keys() <= set(indices)
    if not in_order or len(set(names)) < len(names) or any(type(text) is not str for text in (*names, *reasons)):
        raise ValueError
    return file


# ---------------------------------------------------------------------------------------------------------- NPZ


def _read_npz(name: str) -> Sweep:
    header, arrays = from_npz(name)
    file = _file_of(header)
    require_keys(arrays, *file.axes, *file.columns)
    axes = zip(file.axes, file.study.variations, strict=True)
    if not all(np.array_equal(arrays[axis], each.values) for axis, each in axes):
        raise ValueError
    numbers = [arrays[column] for column in file.columns]
    if any(each.dtype != float or each.shape != file.study.shape for each in numbers):
        raise ValueError
    return file.sweep(np.reshape(numbers, (len(numbers), file.study.size)).T)


# ---------------------------------------------------------------------------------------------------------- CSV


def _rows(sweep: Sweep) -> list[list[Any]]:
    rows: list[list[Any]] = [[*(variation.column for variation in sweep.study.variations), *sweep.columns, REASON]]
    for row in sweep.rows:
        numbers = [row.numbers.get(name, np.nan) for name in sweep.columns]
        rows.append([*sweep.study.point(row.index).values(), *numbers, row.reason])
    return rows


def _read_csv(name: str) -> Sweep:
    header, text = from_csv(name)
    file = _file_of(header)
    names, *rows = csv.reader(io.StringIO(text, newline=""))
    axes, columns, table = (
        len(file.axes),
        len(file.columns),
        np.full((file.study.size, len(file.columns)), np.nan),
    )
    if names != [*map(csv_cell, (*file.axes, *file.columns, REASON))]:
        raise ValueError
    for at, row in zip(file.indices, rows, strict=True):
        point, numbers, (reason,) = row[:axes], row[axes : axes + columns], row[axes + columns :]
        values, why = file.study.point(at).values(), file.failed.get(at, "")
        if list(map(float, point)) != list(values) or reason != csv_cell(why):
            raise ValueError
        table[at] = list(map(float, numbers))
    return file.sweep(table)


# --------------------------------------------------------------------------------------------------------- JSON


def _json(sweep: Sweep) -> bytes:
    """The header, every column over the grid, and the boundaries of `floquet`."""
    columns = {name: [finite(float(value)) for value in values] for name, values in sweep.to_dict().items()}
    boundaries = [boundary.to_dict() for boundary in sweep.boundaries]
    more = {"kinds": {str(number): words for number, words in STABILITY.items()}} if "kind" in columns else {}
    return as_json(_header(sweep) | {"data": columns, **more, "boundaries": boundaries}).encode()
