"""NumPy archives without pickles."""

from __future__ import annotations

from io import BytesIO

import numpy as np

from modal.exports.text import matrices
from modal.signals import Signal
from modal.statespace import StateSpace

KINDS = ("states", "inputs", "outputs")


def write_npz(model: StateSpace) -> bytes:
    """An archive of A, B, C, D, dt, title; states, inputs, outputs as (n, 3) names, units and meanings; the rest."""
    stream = BytesIO()
    np.savez_compressed(
        stream,
        allow_pickle=False,
        dt=np.float64(model.dt),
        title=np.str_(model.title),
        operating_names=np.array([name for name, _ in model.operating_point], dtype=np.str_),
        operating_values=np.array([value for _, value in model.operating_point], dtype=np.float64),
        **dict(matrices(model)),
        **{kind: np.array(getattr(model, kind), dtype=np.str_).reshape(-1, 3) for kind in KINDS},
    )
    return stream.getvalue()


def read_npz(content: bytes) -> StateSpace:
    """The model that was written."""
    with np.load(BytesIO(content), allow_pickle=False) as data:
        signals = {kind: tuple(Signal(*map(str, row)) for row in data[kind]) for kind in KINDS}
        resting = zip(data["operating_names"].tolist(), data["operating_values"].tolist(), strict=True)
        A, B, C, D = (data[name] for name in "ABCD")
        return StateSpace(
            A, B, C, D, **signals, dt=float(data["dt"]), title=str(data["title"]), operating_point=tuple(resting)
        )
