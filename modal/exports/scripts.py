"""Objects, scripts and files of python-control, SciPy, MATLAB and Octave.

A script for Python needs only python-control.  A MAT-file has names and units as cell arrays of strings; a script for
MATLAB and Octave has A, B, C, D, dt, their names and, where `ss` is installed, the system `sys`.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Iterable, Iterator, Mapping
from io import BytesIO
from typing import TYPE_CHECKING, Any
from unicodedata import normalize

import numpy as np

from modal.exports.text import datum, digits, heading, identifier, matrices, meaning, preamble, rest, text_file, unit_of
from modal.report import matlab_text, python_text
from modal.statespace import StateSpace
from modal.statespace.sampling import VaryingModel
from modal.types import Floats

if TYPE_CHECKING:
    import control  # type: ignore[import-untyped]

FIRST = (
    "# -*- coding: utf-8 -*-",
    "# A linear state-space model for python-control, in SI units, deviations from {datum}.",
)
"""Python looks for an encoding in the first two lines of a file: they contain no text of a scene."""
MODEL, COLUMNS = "a linear state-space model in SI units", "columns by their names"
MATLAB_NAME_LETTERS = 63
"""Format: letters of a name in MATLAB, its namelengthmax."""
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


def to_control(model: StateSpace) -> control.StateSpace:
    """The `control.StateSpace` with labels, sample time and name."""
    from control import StateSpace as Labelled

    names = {side: [signal.name for signal in getattr(model, side)] for side in ("states", "inputs", "outputs")}
    matrices_and_step = model.A, model.B, model.C, model.D, model.dt
    return Labelled(*matrices_and_step, name=identifier(heading(model)), **names)


def to_scipy(model: StateSpace) -> Any:
    """The `scipy.signal.StateSpace`, or a `dlti` for a discrete model; neither has names."""
    from scipy.signal import StateSpace as Continuous
    from scipy.signal import dlti

    parts = model.A, model.B, model.C, model.D
    return dlti(*parts, dt=model.dt) if model.dt else Continuous(*parts)


# ------------------------------------------------------------------------------------------------------------- Python


def write_script(model: StateSpace) -> bytes:
    """The script; run it or import `system` from it."""
    return text_file(_python_lines(model))


def write_varying_script(model: VaryingModel) -> bytes:
    """The script of a table: `times` (s), arrays A, B, C, D with an entry a time, and `systems`, a list."""
    return text_file(_varying_lines(model))


def _python_lines(model: StateSpace) -> Iterator[str]:
    yield from _opening(model)
    yield from (f"# {line}" for line in rest(model))
    yield from _signals_and_title(model)
    for name, values in matrices(model):
        yield from _python_matrix(name, values)
    yield from ("", "system = control.StateSpace(", f"    A, B, C, D, {model.dt!r},")
    yield f"    name={python_text(identifier(heading(model)))}, states=states, inputs=inputs, outputs=outputs,"
    yield ")"


def _varying_lines(model: VaryingModel) -> Iterator[str]:
    count = len(model.times)
    yield from _opening(model)
    yield from ("# A model a time: systems[k] at times[k], with the arrays A[k], B[k], C[k], D[k].",)
    yield from _signals_and_title(model)
    yield f"times = np.array([{', '.join(map(repr, model.times.tolist()))}])"
    for name in "ABCD":
        values = getattr(model, name)
        whole = np.broadcast_to(values, (count, *values.shape[-2:]))
        yield from _python_matrix(name, whole.reshape(-1, whole.shape[-1]), whole.shape)
    yield "operating_point = {"
    for name, numbers in model.operating_point:
        yield f"    {python_text(name)}: np.array({np.broadcast_to(numbers, count).tolist()!r}),  # {unit_of(name)}"
    yield from (
        "}",
        "",
        "systems = [",
        "    control.StateSpace(*matrices, states=states, inputs=inputs, outputs=outputs)",
    )
    yield from ("    for matrices in zip(A, B, C, D)", "]")


def _opening(model: StateSpace | VaryingModel) -> Iterator[str]:
    return (line.format(datum=datum(model)) for line in FIRST)


def _signals_and_title(model: StateSpace | VaryingModel) -> Iterator[str]:
    yield from ("", "import control", "import numpy as np", "", f"title = {python_text(heading(model))}")
    for name, signals in (("states", model.states), ("inputs", model.inputs), ("outputs", model.outputs)):
        yield f"{name} = ["
        yield from (f"    {python_text(signal.name)},  # {meaning(signal)}" for signal in signals)
        yield "]"


def _python_matrix(name: str, values: Floats, shape: tuple[int, ...] = ()) -> Iterator[str]:
    yield f"{name} = np.array(["
    yield from (f"    [{', '.join(row)}]," for row in digits(values))
    yield f"]).reshape({', '.join(map(str, shape or values.shape))})"


# -------------------------------------------------------------------------------------------------- MATLAB and Octave


def write_mat(model: StateSpace) -> bytes:
    """A version 5 file of A, B, C, D, dt, title, state_names, state_units, state_meanings, input_…, output_….

    `operating_point` is a structure of `names` and `values` in SI units.
    """
    return _model_file(model, {**dict(matrices(model)), "dt": model.dt})


def write_varying_mat(model: VaryingModel) -> bytes:
    """A version 5 file of time_s (T, 1), A (T, n, n), B (T, n, m), C and D, and the names of `write_mat`."""
    arrays = {"A": model.A, "B": model.B, "C": model.C, "D": model.D}
    return _model_file(model, {"time_s": model.times[:, None], **arrays})


def _model_file(model: StateSpace | VaryingModel, numbers: dict[str, Any]) -> bytes:
    content = {**numbers, **_titles(model.title)}
    for kind, signals in (("state", model.states), ("input", model.inputs), ("output", model.outputs)):
        for field in ("name", "unit", "meaning"):
            content[f"{kind}_{field}s"] = _cells(getattr(signal, field) for signal in signals)
    names = [name for name, _ in model.operating_point]
    content["operating_point"] = {
        "names": _cells(names),
        "values": np.array([np.atleast_1d(value) for _, value in model.operating_point]).reshape(
            len(names), -1 if names else 1
        ),
    }
    return _mat_file(content, MODEL)


def _mat_file(content: Mapping[str, Any], what: str) -> bytes:
    from scipy.io import savemat

    stream = BytesIO()
    savemat(stream, dict(content), do_compression=True)
    label = f"MATLAB 5.0 MAT-file, {what}".ljust(116).encode()
    return label + stream.getvalue()[len(label) :]


def write_columns(columns: Mapping[str, Iterable[Any]]) -> bytes:
    """A MAT file of columns by their names: arrays of numbers, and cells of words; no name has brackets or points."""
    content = {}
    for name, column in columns.items():
        values = list(column)
        try:
            numbers = np.array([[float("nan" if value == "" else value)] for value in values])
        except ValueError:
            content[_variable(name)] = _cells(map(str, values))
        else:
            content[_variable(name)] = numbers.reshape(-1, 1)
    return _mat_file(content, COLUMNS)


def columns_of_csv(text: str) -> dict[str, tuple[str, ...]]:
    """The columns of a CSV table below its comments."""
    names, *rows = csv.reader(line for line in text.splitlines() if line and not line.startswith("#"))
    return {name: tuple(row[k] for row in rows) for k, name in enumerate(names)}


def _variable(name: str) -> str:
    """A name as MATLAB takes it: letters, digits and underscores, a letter first, 63 of them at most."""
    plain = re.sub(r"\W+", "_", normalize("NFKD", name).encode("ascii", "ignore").decode()).strip("_")[
        :MATLAB_NAME_LETTERS
    ]
    return plain if plain[:1].isalpha() else f"n_{plain}"


def _titles(title: str) -> dict[str, Any]:
    """Octave measures a text's length in bytes, so `title` is plain ASCII; the UTF-8 bytes keep every letter."""
    plain = normalize("NFKD", title).encode("ascii", "ignore").decode()
    return {"title": plain, "title_utf8": np.frombuffer(title.encode(), dtype=np.uint8)}


def _cells(words: Iterable[str]) -> Any:
    """A column of cells."""
    entries = list(words)
    cells = np.empty((len(entries), 1), dtype=object)
    cells[:, 0] = entries
    return cells


def write_m(model: StateSpace) -> bytes:
    """The script."""
    return text_file(_matlab_lines(model))


def _matlab_lines(model: StateSpace) -> Iterator[str]:
    yield from (f"% {line}" for line in preamble(model))
    yield f"dt = {model.dt!r};"
    for kind, signals in (("state", model.states), ("input", model.inputs), ("output", model.outputs)):
        yield f"{kind}_names = {{"
        yield from (f"  {matlab_text(signal.name)}  % {meaning(signal)}" for signal in signals)
        yield "};"
        yield f"{kind}_units = {{{'; '.join(matlab_text(signal.unit) for signal in signals)}}};"
    for name, values in matrices(model):
        yield from _matlab_matrix(name, values)
    yield BUILD.format(arguments="A, B, C, D, dt" if model.dt else "A, B, C, D")


def _matlab_matrix(name: str, values: Floats) -> Iterator[str]:
    if not values.size:
        yield f"{name} = zeros({values.shape[0]}, {values.shape[1]});"
        return
    yield f"{name} = ["
    yield from (f"  {' '.join(row)}" for row in digits(values))
    yield "];"
