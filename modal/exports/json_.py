"""JSON that reads back bit for bit, with a checksum."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from math import prod
from typing import Any

import numpy as np

from modal.exports.text import digits, matrices
from modal.report import json_text
from modal.scene.sealed import Source, content, finite_array, reading, require_keys, sealed_text, verify_sealed_text
from modal.statespace import Signal, StateSpace
from modal.types import Floats

KINDS = ("states", "inputs", "outputs")
SHAPES = {"A": ("states", "states"), "B": ("states", "inputs"), "C": ("outputs", "states"), "D": ("outputs", "inputs")}

OPENING = "{\n  "
Rests = Sequence[tuple[str, float]]


def write_json(model: StateSpace) -> bytes:
    """An object of title, dt, operating_point, states, inputs, outputs and the matrices, one line per row."""
    fields = list(_fields(model))
    return sealed_text(OPENING, "\n" + ",\n".join(fields) + "\n}\n")


def read_json(source: Source) -> StateSpace:
    """The model that was written, from the bytes of the file or its path; SceneError for any other content."""
    with reading(source, "model"):
        text = content(source)
        verify_sealed_text(text, OPENING)
        data: dict[str, Any] = json.loads(text)
        require_keys(data, "sha256", "title", "dt", "operating_point", *KINDS, *SHAPES)
        signals = {kind: [(s["name"], s["unit"], s["meaning"]) for s in data[kind]] for kind in KINDS}
        resting = [(angle["name"], angle["value"]) for angle in data["operating_point"]]
        return assembled(data, signals, resting)


def assembled(arrays: Mapping[str, Any], signals: Mapping[str, Sequence[Sequence[str]]], resting: Rests) -> StateSpace:
    """The model of A, B, C, D, dt and title; ValueError where they do not fit together or are not finite."""
    named = {kind: tuple(Signal(*map(str, row)) for row in rows) for kind, rows in signals.items()}
    sizes = {name: tuple(len(named[kind]) for kind in kinds) for name, kinds in SHAPES.items()}
    A, B, C, D = (finite_array(arrays[name] if prod(size) else np.zeros(size), *size) for name, size in sizes.items())
    angles = finite_array([value for _, value in resting], len(resting)) if resting else np.zeros(0)
    states, inputs, outputs = (named[kind] for kind in KINDS)
    return StateSpace(
        *(A, B, C, D),
        states,
        inputs,
        outputs,
        dt=float(finite_array(arrays["dt"])),
        title=str(arrays["title"]),
        operating_point=tuple(zip((str(name) for name, _ in resting), angles.tolist(), strict=True)),
    )


def _fields(model: StateSpace) -> Iterator[str]:
    yield f'  "title": {json_text(model.title, None)}'
    yield f'  "dt": {model.dt!r}'
    yield _listed("operating_point", [json_text({"name": n, "value": v}, None) for n, v in model.operating_point])
    for kind in KINDS:
        yield _listed(kind, [json_text(signal._asdict(), None) for signal in getattr(model, kind)])
    for name, values in matrices(model):
        yield _matrix(name, values)


def _matrix(name: str, values: Floats) -> str:
    return _listed(name, [f"[{', '.join(row)}]" for row in digits(values)])


def _listed(name: str, items: list[str]) -> str:
    return f'  "{name}": [\n    ' + ",\n    ".join(items) + "\n  ]" if items else f'  "{name}": []'
