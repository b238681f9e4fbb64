"""FMI 2.0 co-simulation: a zip of description, C source and, where a compiler is found, a Linux binary.

Inputs are held constant over every communication step, as in co-simulation without input derivatives: the response to
a ramp lags by half a step.  The default step is exact; `linear_fmu.c` handles any other one to rounding.
"""

from __future__ import annotations

import platform
import subprocess
import sys
from collections.abc import Iterator
from importlib.resources import files
from io import BytesIO
from pathlib import Path
from shutil import which
from tempfile import TemporaryDirectory
from typing import NamedTuple
from uuid import NAMESPACE_URL, uuid5
from xml.etree import ElementTree as ET
from zipfile import ZIP_DEFLATED, ZipFile, ZipInfo

from modal.exports.source import c_matrix, hexadecimal, unit
from modal.exports.text import heading, identifier, identifiers, law, rest, text_file
from modal.report import c_comment, one_line
from modal.statespace import Signal, StateSpace
from modal.statespace.sampling import reach, sample

COMPILERS = ("cc", "gcc", "clang")
FLAGS = ("-std=c99", "-O2", "-shared", "-fPIC", "-fvisibility=hidden")
SOURCE = "linear_fmu.c"
SOURCE_ONLY = (
    "no C compiler for 64-bit Linux found: the FMU has C source and no binary; compile it on the target system"
)
COMPILATION_SECONDS = 120.0
"""Limit: of a C compiler; the FMU of one that takes longer has source and no binary."""
UNITS = {
    "m": {"m": 1},
    "m/s": {"m": 1, "s": -1},
    "m/s2": {"m": 1, "s": -2},
    "rad": {"rad": 1},
    "rad/s": {"rad": 1, "s": -1},
    "N": {"kg": 1, "m": 1, "s": -2},
    "N.m": {"kg": 1, "m": 2, "s": -2},
}
HELD = "inputs are held constant over each communication step"
ROLES = {
    "input": {"causality": "input", "variability": "continuous"},
    "state": {"causality": "local", "variability": "continuous", "initial": "exact"},
    "output": {"causality": "output", "variability": "continuous", "initial": "calculated"},
}


def write_fmu(model: StateSpace, step: float = 0.01) -> bytes:
    """The FMU; `step` in seconds is the default communication step, for a discrete model its own.

    The same model gives the same source and GUID.  Raises SceneError for a step that is not positive.
    """
    name = identifier(heading(model))
    discrete, step = (model, model.dt) if model.dt else (sample(model, step), step)
    source, code = files("modal.exports").joinpath(SOURCE).read_bytes(), list(_matrices(model, discrete))
    guid = f"{{{uuid5(NAMESPACE_URL, repr((name, step, model.states, model.inputs, model.outputs, code)))}}}"
    header = text_file([*_sizes(model, step, guid), *code])
    content = {
        "modelDescription.xml": description(model, step, guid, SOURCE),
        f"sources/{SOURCE}": source,
        "sources/model.h": header,
    }
    if binary := _compile({SOURCE: source, "model.h": header}):
        content[f"binaries/linux64/{name}.so"] = binary
    return _zip(content)


def note(content: bytes) -> str:
    """A note that an FMU contains no binary, or nothing."""
    with ZipFile(BytesIO(content)) as archive:
        return "" if any(name.startswith("binaries/") for name in archive.namelist()) else SOURCE_ONLY


def compiler() -> str | None:
    """A C compiler for 64-bit Linux binaries, if there is one."""
    if not sys.platform.startswith("linux") or platform.machine() not in {"x86_64", "AMD64"}:
        return None
    return next(filter(None, map(which, COMPILERS)), None)


def _sizes(model: StateSpace, step: float, guid: str) -> Iterator[str]:
    yield c_comment(heading(model))
    yield f'#define MODEL_GUID "{guid}"'
    yield f"#define CONTINUOUS {int(not model.dt)}"
    yield f"#define STEP {step!r}"
    for name, signals in (("INPUTS", model.inputs), ("STATES", model.states), ("OUTPUTS", model.outputs)):
        yield f"#define {name} {len(signals)}"


def _matrices(model: StateSpace, discrete: StateSpace) -> Iterator[str]:
    arrays = {"PHI": discrete.A, "GAMMA": discrete.B, "C": model.C, "D": model.D}
    if not model.dt:
        arrays |= {"A": model.A, "B": model.B}
        yield f"#define REACH {reach(model.A)!r}"
    for name, values in arrays.items():
        yield from c_matrix(name, values, hexadecimal, by_place=True)


def _compile(sources: dict[str, bytes]) -> bytes:
    """The shared library, or nothing."""
    command = compiler()
    if command is None:
        return b""
    with TemporaryDirectory() as folder:
        for name, content in sources.items():
            (Path(folder) / name).write_bytes(content)
        try:
            subprocess.run(
                [command, *FLAGS, SOURCE, "-o", "model.so"],
                cwd=folder,
                capture_output=True,
                check=True,
                timeout=COMPILATION_SECONDS,
            )
        except (OSError, subprocess.SubprocessError):
            return b""
        return (Path(folder) / "model.so").read_bytes()


def _zip(content: dict[str, bytes]) -> bytes:
    stream = BytesIO()
    with ZipFile(stream, "w", ZIP_DEFLATED) as archive:
        for name, data in content.items():
            archive.writestr(ZipInfo(name), data, ZIP_DEFLATED, compresslevel=1)
    return stream.getvalue()


# ------------------------------------------------------------------------------ description


class FmuVariable(NamedTuple):
    """A signal in its role, under its name in the FMU."""

    name: str
    role: str
    signal: Signal


def variables(model: StateSpace) -> list[FmuVariable]:
    """Inputs, then states as `state.NAME`, then outputs: the index of each is its value reference."""
    outside = [("input", s) for s in model.inputs], [("output", s) for s in model.outputs]
    words = identifiers((s.name for _, s in (*outside[0], *outside[1])), keywords=["state"])
    signals = [FmuVariable(word, *pair) for word, pair in zip(words, (*outside[0], *outside[1]), strict=True)]
    inner = identifiers(s.name for s in model.states)
    states = [FmuVariable(f"state.{word}", "state", s) for word, s in zip(inner, model.states, strict=True)]
    return [*signals[: len(outside[0])], *states, *signals[len(outside[0]) :]]


def description(model: StateSpace, step: float, guid: str, source: str) -> bytes:
    """modelDescription.xml; `step` in seconds is the default step, `source` the file under sources/."""
    fmu_variables = variables(model)
    root = ET.Element("fmiModelDescription", _about(model, guid))
    _interface(root, model, source)
    _units(root, fmu_variables)
    log = ET.SubElement(root, "LogCategories")
    ET.SubElement(log, "Category", name="logStatusError")
    ET.SubElement(root, "DefaultExperiment", startTime="0", stopTime="10", stepSize=repr(step))
    element = ET.SubElement(root, "ModelVariables")
    for reference, variable in enumerate(fmu_variables):
        element.append(_variable(variable, reference))
    _structure(root, model)
    ET.indent(root)
    return bytes(ET.tostring(root, encoding="UTF-8", xml_declaration=True))


def _about(model: StateSpace, guid: str) -> dict[str, str]:
    return {
        "fmiVersion": "2.0",
        "modelName": heading(model),
        "guid": guid,
        "description": "; ".join([law(model), HELD, "deviations from the equilibrium", *rest(model)[:8]]),
        "generationTool": "multipendula",
        "variableNamingConvention": "structured",
        "numberOfEventIndicators": "0",
    }


def _interface(root: ET.Element, model: StateSpace, source: str) -> None:
    interface = ET.SubElement(
        root,
        "CoSimulation",
        modelIdentifier=identifier(heading(model)),
        canInterpolateInputs="false",
        canHandleVariableCommunicationStepSize="false" if model.dt else "true",
        canNotUseMemoryManagementFunctions="true",
        canGetAndSetFMUstate="true",
        canSerializeFMUstate="true",
    )
    ET.SubElement(ET.SubElement(interface, "SourceFiles"), "File", name=source)


def _units(root: ET.Element, fmu_variables: list[FmuVariable]) -> None:
    used = dict.fromkeys(name for variable in fmu_variables if (name := unit(variable.signal)))
    if not used:
        return
    definitions = ET.SubElement(root, "UnitDefinitions")
    for name in used:
        definition = ET.SubElement(definitions, "Unit", name=name)
        if name in UNITS:
            ET.SubElement(definition, "BaseUnit", {base: str(power) for base, power in UNITS[name].items()})


def _variable(variable: FmuVariable, reference: int) -> ET.Element:
    what = {"name": variable.name, "valueReference": str(reference), "description": one_line(variable.signal.meaning)}
    element = ET.Element("ScalarVariable", {**what, **ROLES[variable.role]})
    start = {} if variable.role == "output" else {"start": "0"}
    attributes = {"unit": name} if (name := unit(variable.signal)) else {}
    ET.SubElement(element, "Real", {**attributes, **start})
    return element


def _structure(root: ET.Element, model: StateSpace) -> None:
    """Outputs depend directly on the inputs with feedthrough in D; their initial values on everything."""
    structure = ET.SubElement(root, "ModelStructure")
    for part, unknowns in (("Outputs", _through(model)), ("InitialUnknowns", _first(model))):
        if model.outputs:
            parent = ET.SubElement(structure, part)
            for attributes in unknowns:
                ET.SubElement(parent, "Unknown", attributes)


def _through(model: StateSpace) -> Iterator[dict[str, str]]:
    for attributes, row in zip(_first(model), model.D, strict=True):
        yield {**attributes, "dependencies": " ".join(str(k) for k, gain in enumerate(row, 1) if gain)}


def _first(model: StateSpace) -> Iterator[dict[str, str]]:
    n_others = len(model.inputs) + len(model.states)
    yield from ({"index": str(n_others + row)} for row in range(1, len(model.outputs) + 1))
