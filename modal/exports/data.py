"""Data that reads back bit for bit: JSON and NumPy archives with a checksum, one table, and transfer functions.

The table is CSV in long form: one number per row, with the names and units of its row and column.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from math import prod
from typing import Any

import numpy as np

from modal.errors import ComputationError
from modal.exports.text import digits, matrices, unit_of
from modal.modes import natural_modes
from modal.report import as_json, csv_rows, json_text
from modal.scene.sealed import (
    Source,
    archive,
    content,
    finite_array,
    reading,
    require_keys,
    sealed_text,
    unpack,
    verify_sealed_text,
)
from modal.statespace import Signal, StateSpace, to_modal_form
from modal.statespace.sampling import VaryingModel
from modal.statespace.transfer import transfer_functions
from modal.types import Complexes

KINDS = ("states", "inputs", "outputs")
SHAPES = {"A": ("states", "states"), "B": ("states", "inputs"), "C": ("outputs", "states"), "D": ("outputs", "inputs")}

OPENING = "{\n  "
Rests = Sequence[tuple[str, float]]
NAMES = ("dt", "title", "operating_names", "operating_values", *KINDS, *SHAPES)
HEADER = ("matrix", "row", "row_name", "row_unit", "column", "column_name", "column_unit", "value")


def write_json(model: StateSpace) -> bytes:
    """An object of title, dt, operating_point, states, inputs, outputs and the matrices, one line per row."""
    fields = list(_json_fields(model))
    return sealed_text(OPENING, "\n" + ",\n".join(fields) + "\n}\n")


def read_json(source: Source) -> StateSpace:
    """The model that was written, from the bytes of the file or its path; raise SceneError for any other content."""
    with reading(source, "model"):
        text = content(source)
        verify_sealed_text(text, OPENING)
        data: dict[str, Any] = json.loads(text)
        require_keys(data, "sha256", "title", "dt", "operating_point", *KINDS, *SHAPES)
        signals = {kind: [(s["name"], s["unit"], s["meaning"]) for s in data[kind]] for kind in KINDS}
        resting = [(angle["name"], angle["value"]) for angle in data["operating_point"]]
        return assemble(data, signals, resting)


def assemble(arrays: Mapping[str, Any], signals: Mapping[str, Sequence[Sequence[str]]], resting: Rests) -> StateSpace:
    """The model of A, B, C, D, dt and title; raise ValueError if they do not fit together or are not finite."""
    signals_by_kind = {kind: tuple(Signal(*map(str, row)) for row in rows) for kind, rows in signals.items()}
    sizes = {name: tuple(len(signals_by_kind[kind]) for kind in kinds) for name, kinds in SHAPES.items()}
    A, B, C, D = (finite_array(arrays[name] if prod(size) else np.zeros(size), *size) for name, size in sizes.items())
    angles = finite_array([value for _, value in resting], len(resting)) if resting else np.zeros(0)
    states, inputs, outputs = (signals_by_kind[kind] for kind in KINDS)
    dt, title = float(finite_array(arrays["dt"])), str(arrays["title"])
    point = tuple(zip((str(name) for name, _ in resting), angles.tolist(), strict=True))
    return StateSpace(A, B, C, D, states, inputs, outputs, dt=dt, title=title, operating_point=point)


def _json_fields(model: StateSpace) -> Iterator[str]:
    yield f'  "title": {json_text(model.title, None)}'
    yield f'  "dt": {model.dt!r}'
    yield _json_list("operating_point", [json_text({"name": n, "value": v}, None) for n, v in model.operating_point])
    for kind in KINDS:
        yield _json_list(kind, [json_text(signal._asdict(), None) for signal in getattr(model, kind)])
    for name, values in matrices(model):
        yield _json_list(name, [f"[{', '.join(row)}]" for row in digits(values)])


def _json_list(name: str, items: list[str]) -> str:
    return f'  "{name}": [\n    ' + ",\n    ".join(items) + "\n  ]" if items else f'  "{name}": []'


# ----------------------------------------------------------------------------------------------------------- archives


def write_npz(model: StateSpace) -> bytes:
    """An archive of A, B, C, D, dt, title; states, inputs, outputs as (n, 3) names, units and meanings; the rest."""
    resting, signals = _labels(model)
    return archive(
        {"dt": np.float64(model.dt), "title": np.str_(model.title)} | resting | dict(matrices(model)) | signals
    )


def write_varying_npz(model: VaryingModel) -> bytes:
    """An archive of time_s (T,), A (T, n, n), B (T, n, m), C, D, and title, signals and operating point as above."""
    resting, signals = _labels(model)
    arrays = {"A": model.A, "B": model.B, "C": model.C, "D": model.D, "title": np.str_(model.title)}
    return archive({"time_s": model.times} | arrays | resting | signals)


def _labels(model: StateSpace | VaryingModel) -> tuple[dict[str, Any], dict[str, Any]]:
    """The operating point, and the signals of every kind."""
    resting = {
        "operating_names": np.array([name for name, _ in model.operating_point], dtype=np.str_),
        "operating_values": np.array([value for _, value in model.operating_point], dtype=np.float64),
    }
    return resting, {kind: np.array(getattr(model, kind), dtype=np.str_).reshape(-1, 3) for kind in KINDS}


def read_npz(source: Source) -> StateSpace:
    """The model that was written, from the bytes of the file or its path; raise SceneError for any other content."""
    with reading(source, "model"):
        data = unpack(content(source), NAMES)
        resting = zip(data["operating_names"].tolist(), data["operating_values"].tolist(), strict=True)
        return assemble(data, {kind: data[kind].tolist() for kind in KINDS}, list(resting))


# ---------------------------------------------------------------------------------------------------------- one table


def write_csv(model: StateSpace) -> bytes:
    """HEADER, then title, dt, the operating point, and A, B, C, D by rows; rows and columns count from 1.

    A row of A and B is named after its state.
    """
    return csv_rows(_csv_rows(model)).encode()


def _csv_rows(model: StateSpace) -> Iterator[tuple[Any, ...]]:
    yield HEADER
    yield "title", "", "", "", "", "", "", model.title
    yield "dt", "", "", "s", "", "", "", repr(model.dt)
    for number, (name, value) in enumerate(model.operating_point, 1):
        yield "operating_point", number, name, unit_of(name), "", "", "", repr(value)
    sides = {
        "A": (model.states, model.states),
        "B": (model.states, model.inputs),
        "C": (model.outputs, model.states),
        "D": (model.outputs, model.inputs),
    }
    for name, values in matrices(model):
        rows, columns = ([(k, s.name, s.unit) for k, s in enumerate(side, 1)] for side in sides[name])
        for row, line in zip(rows, values.tolist(), strict=True):
            for column, value in zip(columns, line, strict=True):
                yield name, *row, *column, repr(value)


# ------------------------------------------------------------------------------------------------- transfer functions


def write_transfer(model: StateSpace) -> bytes:
    """One object for every pair; raise ComputationError for a sampled or reduced model."""
    if model.scene is None or model.dt:
        raise ComputationError("transfer functions need a whole model in continuous time")
    form = to_modal_form(natural_modes(model.scene), model)
    records = [
        {
            "input": function.input.name,
            "output": function.output.name,
            "unit": f"{function.output.unit} per {function.input.unit}",
            "gain": function.gain,
            "zeros": _pairs(function.zeros),
            "poles": _pairs(function.poles),
            "numerator": function.numerator.tolist(),
            "denominator": function.denominator.tolist(),
        }
        for row in transfer_functions(form)
        for function in row
    ]
    return as_json({"title": model.title, "transfer_functions": records}).encode()


def _pairs(values: Complexes) -> list[list[float]]:
    return [[value.real, value.imag] for value in values.tolist()]
