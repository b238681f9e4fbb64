"""NumPy archives without pickles, with a checksum."""

from __future__ import annotations

import numpy as np

from modal.exports.json_ import KINDS, SHAPES, assembled
from modal.exports.text import matrices
from modal.scene.sealed import Source, archive, content, reading, unpacked
from modal.statespace import StateSpace
from modal.statespace.varying import VaryingModel

NAMES = ("dt", "title", "operating_names", "operating_values", *KINDS, *SHAPES)


def write_npz(model: StateSpace) -> bytes:
    """An archive of A, B, C, D, dt, title; states, inputs, outputs as (n, 3) names, units and meanings; the rest."""
    resting = {
        "operating_names": np.array([name for name, _ in model.operating_point], dtype=np.str_),
        "operating_values": np.array([value for _, value in model.operating_point], dtype=np.float64),
    }
    signals = {kind: np.array(getattr(model, kind), dtype=np.str_).reshape(-1, 3) for kind in KINDS}
    return archive(
        {"dt": np.float64(model.dt), "title": np.str_(model.title)} | resting | dict(matrices(model)) | signals
    )


def write_varying(model: VaryingModel) -> bytes:
    """An archive of time_s (T,), A (T, n, n), B (T, n, m), C, D, and title, signals and operating point as above."""
    signals = {kind: np.array(getattr(model, kind), dtype=np.str_).reshape(-1, 3) for kind in KINDS}
    resting = {
        "operating_names": np.array([name for name, _ in model.operating_point], dtype=np.str_),
        "operating_values": np.array([value for _, value in model.operating_point], dtype=np.float64),
    }
    arrays = {"A": model.A, "B": model.B, "C": model.C, "D": model.D, "title": np.str_(model.title)}
    return archive({"time_s": model.times} | arrays | resting | signals)


def read_npz(source: Source) -> StateSpace:
    """The model that was written, from the bytes of the file or its path; SceneError for any other content."""
    with reading(source, "model"):
        data = unpacked(content(source), NAMES)
        resting = zip(data["operating_names"].tolist(), data["operating_values"].tolist(), strict=True)
        return assembled(data, {kind: data[kind].tolist() for kind in KINDS}, list(resting))
