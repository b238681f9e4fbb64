"""A script for MATLAB and Octave: A, B, C, D, dt, their names and, where `ss` is installed, the system `sys`."""

from __future__ import annotations

from collections.abc import Iterator

from modal.exports.text import digits, joined, matrices, meaning, preamble
from modal.report import matlab_text
from modal.statespace import Signal, StateSpace
from modal.types import Floats

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


def write_m(model: StateSpace) -> bytes:
    """The script."""
    return joined(_lines(model))


def _lines(model: StateSpace) -> Iterator[str]:
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
