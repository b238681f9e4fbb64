"""A state-space model as a file for another tool: one module per family of formats, loaded on use.

In: a `StateSpace`.  Out: bytes that python-control, SciPy, MATLAB and Octave, C, Modelica, an FMI tool or a spreadsheet
reads.  A format is a `Format` in `FORMATS` and the function that writes it; the command, its help, shell completion and
the manual read `FORMATS`.  `text` has what all formats need: numbers that read back bit for bit.  `read_json` and
`read_npz` read files back, `to_control` and `to_scipy` make objects of these packages.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import TYPE_CHECKING, Any, NamedTuple

from modal.lazy import lazy_attributes

if TYPE_CHECKING:
    from modal.exports.data import read_json as read_json
    from modal.exports.data import read_npz as read_npz
    from modal.exports.scripts import to_control as to_control
    from modal.exports.scripts import to_scipy as to_scipy
    from modal.statespace import StateSpace
    from modal.statespace.sampling import VaryingModel


class Format(NamedTuple):
    """A file extension, a description, and the functions, by module, that write the file and give a note about it.

    `varying` writes a model that varies in time.
    """

    extension: str
    what: str
    writer: str
    remarks: str = ""
    varying: str = ""

    def write(self, model: StateSpace) -> bytes:
        """The bytes of the file."""
        return bytes(_function(self.writer)(model))

    def write_varying(self, model: VaryingModel) -> bytes:
        """The bytes of a model along a hoist; SceneError for a format without any."""
        if not self.varying:
            from modal.errors import SceneError

            name = next(name for name, form in FORMATS.items() if form == self)
            able = " and ".join(name for name, form in FORMATS.items() if form.varying)
            raise SceneError(
                [
                    f"format {name}: holds a constant model, and a hoist makes it vary in time: {able} take it, and "
                    "every format that of one time, `Scene.at(seconds)`"
                ]
            )
        return bytes(_function(self.varying)(model))

    def note(self, content: bytes) -> str:
        """A note for the user about these bytes, usually empty."""
        return str(_function(self.remarks)(content)) if self.remarks else ""


def _function(place: str) -> Callable[..., Any]:
    module, _, name = place.partition(".")
    function: Callable[..., Any] = getattr(import_module(f"modal.exports.{module}"), name)
    return function


def find_format(name: str) -> Format:
    """The format of this name; SceneError lists all formats if it is unknown."""
    if name not in FORMATS:
        from modal.errors import SceneError, spelling_hint

        synonym = OTHER_NAMES.get(name.lower())
        hint = f" (did you mean {synonym}?)" if synonym else spelling_hint(name, FORMATS)
        raise SceneError([f"format {name}: must be one of {', '.join(FORMATS)}{hint}"])
    return FORMATS[name]


def format_of_file(name: str) -> str:
    """The name of the format of which a file's name has the ending, "" where none has.

    >>> format_of_file("crane.tf.json"), format_of_file("crane.json"), format_of_file("crane")
    ('tf', 'json', '')
    """
    fitting = [form for form in FORMATS if name.lower().endswith(FORMATS[form].extension)]
    return max(fitting, key=lambda form: len(FORMATS[form].extension), default="")


FORMATS = {
    "control": Format(
        ".py", "a Python script that builds a labelled `control.StateSpace`, `system`", "scripts.write_script"
    ),
    "mat": Format(
        ".mat",
        "a MATLAB and Octave file with names as cell arrays",
        "scripts.write_mat",
        varying="scripts.write_varying_mat",
    ),
    "m": Format(".m", "a script for MATLAB and Octave that builds `sys`", "scripts.write_m"),
    "json": Format(".json", "everything, exactly; `modal.exports.read_json` reads it back", "data.write_json"),
    "npz": Format(
        ".npz",
        "everything, exactly; `modal.exports.read_npz` reads it back",
        "data.write_npz",
        varying="data.write_varying_npz",
    ),
    "tf": Format(
        ".tf.json",
        "transfer functions: zeros, poles, gain, numerator and denominator for every input and output",
        "data.write_transfer",
    ),
    "csv": Format(".csv", "everything, exactly, one number per row", "data.write_csv"),
    "c": Format(
        ".h",
        "a header for C99 and C++ with the discrete matrices and a step function, no allocation, no includes",
        "source.write_c",
    ),
    "fmu": Format(
        ".fmu",
        "an FMI 2.0 co-simulation unit: source, and a Linux binary if a C compiler is found; inputs are held "
        "constant over each communication step",
        "fmu.write_fmu",
        "fmu.note",
    ),
    "modelica": Format(".mo", "a Modelica block", "source.write_modelica"),
}
OTHER_NAMES = {
    **dict.fromkeys(("matlab", "octave", "scipy"), "mat"),
    **dict.fromkeys(("simulink", "fmi", "dymola"), "fmu"),
    **dict.fromkeys(("python", "py", "python-control"), "control"),
    **dict.fromkeys(("openmodelica", "mo"), "modelica"),
    **dict.fromkeys(("h", "c99", "c++", "cpp"), "c"),
    **dict.fromkeys(("transfer", "zpk", "transfer-function"), "tf"),
    **dict.fromkeys(("numpy",), "npz"),
    **dict.fromkeys(("excel", "xlsx"), "csv"),
}
"""Formats by the tools that read them."""
__getattr__ = lazy_attributes(__name__)
__all__ = ["FORMATS", "Format", "find_format", "format_of_file"]
