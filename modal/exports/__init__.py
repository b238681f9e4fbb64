"""State-space models as files for other tools: one module per family of formats, loaded on use.

In: a `StateSpace`.  Out: bytes that python-control, SciPy, MATLAB and Octave, C, Modelica, an FMI tool or a spreadsheet
reads.  A format is a class of `modal.extend`, our own or external, in `FORMATS` by its name; the command, its help,
shell completion and the manual read them.  `text` is shared by all formats: numbers that read back bit for bit.
`read_json` and `read_npz` read files back, `to_control` and `to_scipy` make objects of these packages.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from modal.extend.formats import Format
from modal.extend.registry import find_extension, register, registered
from modal.lazy import lazy_attributes
from modal.report import deferred

if TYPE_CHECKING:
    from modal.exports.data import read_json as read_json
    from modal.exports.data import read_npz as read_npz
    from modal.exports.scripts import to_control as to_control
    from modal.exports.scripts import to_scipy as to_scipy


@register
class ControlScript(Format):
    """A Python script that builds a labelled `control.StateSpace`."""

    name, extension = "control", ".py"
    what = "a Python script that builds a labelled `control.StateSpace`, `system`"
    tools = ("python", "py", "python-control")
    write = staticmethod(deferred("modal.exports.scripts:write_script"))
    write_varying = staticmethod(deferred("modal.exports.scripts:write_varying_script"))


@register
class MatFile(Format):
    """A MATLAB and Octave file with names as cell arrays."""

    name, extension = "mat", ".mat"
    what = "a MATLAB and Octave file with names as cell arrays"
    tools = ("matlab", "octave", "scipy")
    write = staticmethod(deferred("modal.exports.scripts:write_mat"))
    write_varying = staticmethod(deferred("modal.exports.scripts:write_varying_mat"))


@register
class MatlabScript(Format):
    """A script for MATLAB and Octave that builds `sys`."""

    name, extension = "m", ".m"
    what = "a script for MATLAB and Octave that builds `sys`"
    write = staticmethod(deferred("modal.exports.scripts:write_m"))


@register
class JsonFile(Format):
    """All numbers, names and units, with a checksum."""

    name, extension = "json", ".json"
    what = "everything, exactly; `modal.exports.read_json` reads it back"
    write = staticmethod(deferred("modal.exports.data:write_json"))


@register
class NumpyArchive(Format):
    """Arrays of all numbers, names and units, with a checksum."""

    name, extension = "npz", ".npz"
    what = "everything, exactly; `modal.exports.read_npz` reads it back"
    tools = ("numpy",)
    write = staticmethod(deferred("modal.exports.data:write_npz"))
    write_varying = staticmethod(deferred("modal.exports.data:write_varying_npz"))


@register
class TransferFunctions(Format):
    """Transfer functions."""

    name, extension = "tf", ".tf.json"
    what = "transfer functions: zeros, poles, gain, numerator and denominator for every input and output"
    tools = ("transfer", "zpk", "transfer-function")
    write = staticmethod(deferred("modal.exports.data:write_transfer"))


@register
class CsvTable(Format):
    """One number per row, with the names and units of its row and column."""

    name, extension = "csv", ".csv"
    what = "everything, exactly, one number per row"
    tools = ("excel", "xlsx")
    write = staticmethod(deferred("modal.exports.data:write_csv"))


@register
class CHeader(Format):
    """A header for C99 and C++ with the discrete matrices and a step function."""

    name, extension = "c", ".h"
    what = "a header for C99 and C++ with the discrete matrices and a step function, no allocation, no includes"
    tools = ("h", "c99", "c++", "cpp")
    write = staticmethod(deferred("modal.exports.source:write_c"))


@register
class FunctionalMockupUnit(Format):
    """An FMI 2.0 unit for model exchange and co-simulation."""

    name, extension = "fmu", ".fmu"
    what = (
        "an FMI 2.0 unit for model exchange and co-simulation: source, and binaries for Linux and Windows if C "
        "compilers are found; in co-simulation inputs are held constant over each communication step"
    )
    tools = ("simulink", "fmi", "dymola")
    write = staticmethod(deferred("modal.exports.fmu:write_fmu"))
    note = staticmethod(deferred("modal.exports.fmu:note"))


@register
class ModelicaBlock(Format):
    """A Modelica block."""

    name, extension = "modelica", ".mo"
    what = "a Modelica block"
    tools = ("openmodelica", "mo")
    write = staticmethod(deferred("modal.exports.source:write_modelica"))


FORMATS: dict[str, Format] = {name: form() for name, form in registered("format", discover=False).items()}
"""Our formats by name; `find_format` finds those of other packages, too."""


def find_format(name: str) -> Format:
    """The format of this name; SceneError lists all formats if it is unknown."""
    if form := find_extension("format", name):
        return form()  # type: ignore[no-any-return]
    from modal.errors import SceneError, spelling_hint

    forms = registered("format")
    synonym = next((known for known, form in forms.items() if name.lower() in form.tools), "")
    hint = f" (did you mean {synonym}?)" if synonym else spelling_hint(name, forms)
    raise SceneError([f"format {name}: must be one of {', '.join(forms)}{hint}"])


def format_of_file(name: str) -> str:
    """The name of the format of which a file's name has the ending, "" where none has.

    >>> format_of_file("crane.tf.json"), format_of_file("crane.json"), format_of_file("crane")
    ('tf', 'json', '')
    """
    for discover in (False, True):
        forms = registered("format", discover=discover)
        fitting = [form for form in forms if name.lower().endswith(forms[form].extension)]
        if fitting:
            return max(fitting, key=lambda form: len(forms[form].extension))
    return ""


__getattr__ = lazy_attributes(__name__)
__all__ = ["FORMATS", "Format", "find_format", "format_of_file"]
