"""State-space models as files for other tools, one module a format, none loaded before it is asked for."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from modal.errors import SceneError
from modal.statespace import StateSpace


class Format(NamedTuple):
    """How a model is written: bytes of a file, its usual extension, and what to tell the user about those bytes."""

    extension: str
    what: str
    write: Callable[[StateSpace], bytes]
    note: Callable[[bytes], str] = lambda content: ""


def format_named(name: str) -> Format:
    """The format of a name; SceneError lists all of them for an unknown one."""
    if name not in FORMATS:
        raise SceneError([f"--to {name}: must be one of {', '.join(FORMATS)}"])
    return FORMATS[name]


def _control(model: StateSpace) -> bytes:
    from modal.exports.script import write_script

    return write_script(model)


def _mat(model: StateSpace) -> bytes:
    from modal.exports.mat import write_mat

    return write_mat(model)


def _m(model: StateSpace) -> bytes:
    from modal.exports.m import write_m

    return write_m(model)


def _json(model: StateSpace) -> bytes:
    from modal.exports.json_ import write_json

    return write_json(model)


def _npz(model: StateSpace) -> bytes:
    from modal.exports.npz import write_npz

    return write_npz(model)


def _csv(model: StateSpace) -> bytes:
    from modal.exports.csv_ import write_csv

    return write_csv(model)


def _c(model: StateSpace) -> bytes:
    from modal.exports.c import write_c

    return write_c(model)


def _fmu(model: StateSpace) -> bytes:
    from modal.exports.fmu import write_fmu

    return write_fmu(model)


def _fmu_note(content: bytes) -> str:
    from modal.exports.fmu import note

    return note(content)


def _modelica(model: StateSpace) -> bytes:
    from modal.exports.modelica import write_modelica

    return write_modelica(model)


FORMATS = {
    "control": Format(".py", "a Python script for python-control", _control),
    "mat": Format(".mat", "MATLAB and Octave data", _mat),
    "m": Format(".m", "a MATLAB and Octave script", _m),
    "json": Format(".json", "JSON", _json),
    "npz": Format(".npz", "a NumPy archive", _npz),
    "csv": Format(".csv", "a table in long form", _csv),
    "c": Format(".h", "a C99 header with a step function", _c),
    "fmu": Format(".fmu", "an FMI 2.0 co-simulation unit", _fmu, _fmu_note),
    "modelica": Format(".mo", "a Modelica block", _modelica),
}
