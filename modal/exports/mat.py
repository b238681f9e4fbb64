"""MATLAB and Octave data files: names and units as cell arrays of strings."""

from __future__ import annotations

from collections.abc import Iterable
from io import BytesIO
from typing import Any
from unicodedata import normalize

import numpy as np
from scipy.io import savemat

from modal.exports.text import matrices
from modal.statespace import StateSpace

LABEL = b"MATLAB 5.0 MAT-file, a linear state-space model in SI units".ljust(116)


def write_mat(model: StateSpace) -> bytes:
    """A version 5 file of A, B, C, D, dt, title, state_names, state_units, state_meanings, input_…, output_….

    `operating_point` is a structure of `names` and `values` in rad.
    """
    content: dict[str, Any] = {**dict(matrices(model)), "dt": model.dt, **_titles(model.title)}
    for kind, signals in (("state", model.states), ("input", model.inputs), ("output", model.outputs)):
        for field in ("name", "unit", "meaning"):
            content[f"{kind}_{field}s"] = _cells(getattr(signal, field) for signal in signals)
    content["operating_point"] = {
        "names": _cells(name for name, _ in model.operating_point),
        "values": np.array([[value] for _, value in model.operating_point]).reshape(-1, 1),
    }
    stream = BytesIO()
    savemat(stream, content, do_compression=True)
    return LABEL + stream.getvalue()[len(LABEL) :]


def _titles(title: str) -> dict[str, Any]:
    """Octave counts a text's length in bytes, so `title` is plain ASCII; the bytes of UTF-8 have every letter."""
    plain = normalize("NFKD", title).encode("ascii", "ignore").decode()
    return {"title": plain, "title_utf8": np.frombuffer(title.encode(), dtype=np.uint8)}


def _cells(words: Iterable[str]) -> Any:
    """A column of cells."""
    listed = list(words)
    cells = np.empty((len(listed), 1), dtype=object)
    cells[:, 0] = listed
    return cells
