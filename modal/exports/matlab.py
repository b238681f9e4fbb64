"""Data files and scripts for MATLAB and Octave.

A data file has names and units as cell arrays of strings; a script has A, B, C, D, dt, their names and, where `ss` is
installed, the system `sys`.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from io import BytesIO
from typing import Any
from unicodedata import normalize

import numpy as np

from modal.exports.text import digits, joined, matrices, meaning, preamble
from modal.report import matlab_text
from modal.statespace import Signal, StateSpace
from modal.statespace.varying import VaryingModel
from modal.types import Floats

LABEL = b"MATLAB 5.0 MAT-file, a linear state-space model in SI units".ljust(116)
BUILD = """\
if exist('OCTAVE_VERSION', 'builtin')
  try
    pkg load control
  catch
  end
end
if exist('ss')
  sys = ss({arguments});
  sys = set(sys, 'StateName', state_names, 'InputName', input_names, 'OutputName', output_names);
  if ~exist('OCTAVE_VERSION', 'builtin')
    sys = set(sys, 'StateUnit', state_units, 'InputUnit', input_units, 'OutputUnit', output_units);
  end
else
  disp('ss is not installed (MATLAB: Control System Toolbox; Octave: pkg install -forge control):');
  disp('the model is in A, B, C, D and dt.');
end"""


# -------------------------------------------------------------------------------- data file


def write_mat(model: StateSpace) -> bytes:
    """A version 5 file of A, B, C, D, dt, title, state_names, state_units, state_meanings, input_…, output_….

    `operating_point` is a structure of `names` and `values` in rad.
    """
    return _saved(model, {**dict(matrices(model)), "dt": model.dt})


def write_varying(model: VaryingModel) -> bytes:
    """A version 5 file of time_s (T, 1), A (T, n, n), B (T, n, m), C and D, and the names of `write_mat`."""
    arrays = {"A": model.A, "B": model.B, "C": model.C, "D": model.D}
    return _saved(model, {"time_s": model.times[:, None], **arrays})


def _saved(model: StateSpace | VaryingModel, numbers: dict[str, Any]) -> bytes:
    from scipy.io import savemat

    content = {**numbers, **_titles(model.title)}
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
    """Octave measures a text's length in bytes, so `title` is plain ASCII; the UTF-8 bytes keep every letter."""
    plain = normalize("NFKD", title).encode("ascii", "ignore").decode()
    return {"title": plain, "title_utf8": np.frombuffer(title.encode(), dtype=np.uint8)}


def _cells(words: Iterable[str]) -> Any:
    """A column of cells."""
    listed = list(words)
    cells = np.empty((len(listed), 1), dtype=object)
    cells[:, 0] = listed
    return cells


# ----------------------------------------------------------------------------------- script


def write_m(model: StateSpace) -> bytes:
    """The script."""
    return joined(_script(model))


def _script(model: StateSpace) -> Iterator[str]:
    yield from (f"% {line}" for line in preamble(model))
    yield f"dt = {model.dt!r};"
    for kind, signals in (("state", model.states), ("input", model.inputs), ("output", model.outputs)):
        yield from _names(kind, signals)
    for name, values in matrices(model):
        yield from _matrix(name, values)
    yield BUILD.format(arguments="A, B, C, D, dt" if model.dt else "A, B, C, D")


def _names(kind: str, signals: tuple[Signal, ...]) -> Iterator[str]:
    yield f"{kind}_names = {{"
    yield from (f"  {matlab_text(signal.name)}  % {meaning(signal)}" for signal in signals)
    yield "};"
    yield f"{kind}_units = {{{'; '.join(matlab_text(signal.unit) for signal in signals)}}};"


def _matrix(name: str, values: Floats) -> Iterator[str]:
    if not values.size:
        yield f"{name} = zeros({values.shape[0]}, {values.shape[1]});"
        return
    yield f"{name} = ["
    yield from (f"  {' '.join(row)}" for row in digits(values))
    yield "];"
