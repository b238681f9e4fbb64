"""JSON, bit for bit there and back."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

import numpy as np

from modal.exports.text import digits, joined, matrices
from modal.rig import Floats
from modal.signals import Signal
from modal.statespace import StateSpace

KINDS = ("states", "inputs", "outputs")
SHAPES = {"A": ("states", "states"), "B": ("states", "inputs"), "C": ("outputs", "states"), "D": ("outputs", "inputs")}


def write_json(model: StateSpace) -> bytes:
    """An object of title, dt, operating_point, states, inputs, outputs and the matrices, a row a line."""
    fields = list(_fields(model))
    return joined(["{", *(f"{line}," for line in fields[:-1]), fields[-1], "}"])


def read_json(content: bytes) -> StateSpace:
    """The model that was written."""
    data: dict[str, Any] = json.loads(content)
    signals = {kind: tuple(Signal(s["name"], s["unit"], s["meaning"]) for s in data[kind]) for kind in KINDS}
    sizes = {name: tuple(len(signals[kind]) for kind in kinds) for name, kinds in SHAPES.items()}
    A, B, C, D = (np.array(data[name], dtype=np.float64).reshape(sizes[name]) for name in SHAPES)
    resting = tuple((angle["name"], float(angle["value"])) for angle in data["operating_point"])
    return StateSpace(A, B, C, D, **signals, dt=float(data["dt"]), title=data["title"], operating_point=resting)


def _fields(model: StateSpace) -> Iterator[str]:
    yield f'  "title": {json.dumps(model.title)}'
    yield f'  "dt": {model.dt!r}'
    yield _listed("operating_point", [json.dumps({"name": n, "value": v}) for n, v in model.operating_point])
    for kind in KINDS:
        yield _listed(kind, [json.dumps(signal._asdict()) for signal in getattr(model, kind)])
    for name, values in matrices(model):
        yield _matrix(name, values)


def _matrix(name: str, values: Floats) -> str:
    return _listed(name, [f"[{', '.join(row)}]" for row in digits(values)])


def _listed(name: str, items: list[str]) -> str:
    return f'  "{name}": [\n    ' + ",\n    ".join(items) + "\n  ]" if items else f'  "{name}": []'
