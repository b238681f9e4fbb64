"""Sweeps on disk: NPZ holds every number over the grid, CSV one row a point to read and plot elsewhere.

Both begin with a header in JSON: the scene, what was varied, what was measured and which points failed.  A column of
an axis is named by its place and unit.
"""

from __future__ import annotations

import csv
import io
import json
import os
from pathlib import Path
from typing import Any

import numpy as np

from modal.files import whole_file
from modal.rig import Floats
from nonlinear.saved_files import checked_kind, reading
from nonlinear.studies import Row, Study, study_from
from nonlinear.sweeps import Sweep

HEADER, REASON = "header", "reason"


def save(sweep: Sweep, path: str | os.PathLike[str]) -> None:
    """Write a .npz or .csv file, whole or not at all; SceneError for another name."""
    content = _npz(sweep) if checked_kind(path) == ".npz" else _csv(sweep)
    with whole_file(path) as stream:
        stream.write(content)


def load(path: str | os.PathLike[str]) -> Sweep:
    """The sweep in a file that `save` wrote; SceneError says what is wrong with any other."""
    name, kind = os.fspath(path), checked_kind(path)
    with reading(name, "a sweep"):
        return _read_npz(name) if kind == ".npz" else _read_csv(name)


def _header(sweep: Sweep) -> str:
    failed = {str(index): reason for index, reason in sweep.failures.items()}
    done = None if sweep.complete else [row.index for row in sweep.rows]
    found = {"multipendula_sweep": sweep.study.header(), "columns": sweep.columns, "failed": failed, "done": done}
    return json.dumps(found)


def _sweep(header: dict[str, Any], study: Study, columns: dict[str, Floats]) -> Sweep:
    """Rows again from columns (size,) over the whole grid."""
    failed, done = header["failed"], header["done"]
    indices = range(study.size) if done is None else done
    names = list(header["columns"])
    if any(columns[name].shape != (study.size,) for name in names):
        raise ValueError
    table = np.array([columns[name] for name in names]).reshape(len(names), study.size).T.tolist()
    rows = (
        Row(index, {}, failed[str(index)])
        if str(index) in failed
        else Row(index, dict(zip(names, table[index], strict=True)))
        for index in indices
    )
    return Sweep(study, tuple(rows), interrupted=done is not None)


# ---------------------------------------------------------------------------------------------------------- NPZ


def _npz(sweep: Sweep) -> bytes:
    stream = io.BytesIO()
    axes = {own.column: np.array(own.values) for own in sweep.study.variations}
    numbers = {name: sweep.values(name) for name in sweep.columns}
    arrays: dict[str, Any] = {HEADER: np.array(_header(sweep))} | axes | numbers
    np.savez_compressed(stream, **arrays)
    return stream.getvalue()


def _read_npz(name: str) -> Sweep:
    with np.load(io.BytesIO(Path(name).read_bytes()), allow_pickle=False) as data:
        header = json.loads(str(data[HEADER]))
        study = study_from(header["multipendula_sweep"])
        if any(data[column].shape != study.shape for column in header["columns"]):
            raise ValueError
        return _sweep(header, study, {name: np.asarray(data[name], float).ravel() for name in header["columns"]})


# ---------------------------------------------------------------------------------------------------------- CSV


def _csv(sweep: Sweep) -> bytes:
    stream = io.StringIO()
    stream.write(f"# {_header(sweep)}\n")
    written = csv.writer(stream, lineterminator="\n")
    written.writerow([*(own.column for own in sweep.study.variations), *sweep.columns, REASON])
    for row in sweep.rows:
        numbers = [repr(row.numbers.get(name, np.nan)) for name in sweep.columns]
        written.writerow([*map(repr, sweep.study.point(row.index).values()), *numbers, row.reason])
    return stream.getvalue().encode()


def _read_csv(name: str) -> Sweep:
    with open(name, encoding="utf-8", newline="") as stream:
        header = json.loads(stream.readline().removeprefix("# "))
        study = study_from(header["multipendula_sweep"])
        names, *rows = csv.reader(stream)
    axes, columns = [own.column for own in study.variations], list(header["columns"])
    indices = list(range(study.size)) if header["done"] is None else header["done"]
    if names != [*axes, *columns, REASON] or len(rows) != len(indices):
        raise ValueError
    table = np.full((study.size, len(columns)), np.nan)
    for index, row in zip(indices, rows, strict=True):
        table[index] = list(map(float, row[len(axes) : -1]))
    return _sweep(header, study, dict(zip(columns, table.T, strict=True)))
