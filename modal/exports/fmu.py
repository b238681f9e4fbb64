"""FMI 2.0: a zip of description, C source and, where compilers are found, binaries for Linux and Windows.

For model exchange it has z' = A z + B u, and derivatives of it.  In co-simulation inputs are held constant over every
communication step, without input derivatives: the response to a ramp lags by half a step.  The default step is exact;
`linear_fmu.c` handles any other one to rounding.  A sampled model is for co-simulation alone.  Names are those of the
Modelica block (`modal.exports.source`), as a tool writes the FMU of it.
"""

from __future__ import annotations

import platform
import subprocess
import sys
from collections.abc import Iterator, Sequence
from importlib.resources import files
from io import BytesIO
from pathlib import Path
from shutil import which
from tempfile import TemporaryDirectory
from typing import NamedTuple
from uuid import NAMESPACE_URL, uuid5
from xml.etree import ElementTree as ET
from zipfile import ZIP_DEFLATED, ZipFile, ZipInfo

import numpy as np

from modal.exports.source import c_matrix, hexadecimal, public_names, unit
from modal.exports.text import datum, heading, identifier, law, rest, text_file
from modal.report import c_comment, one_line
from modal.statespace import Signal, StateSpace
from modal.statespace.sampling import reach, sample

COMPILERS = ("cc", "gcc", "clang")
CROSS_COMPILER = "x86_64-w64-mingw32-gcc"
FLAGS = ("-std=c99", "-O2", "-shared", "-s")
OF_LINUX = ("-fPIC", "-fvisibility=hidden")
OF_WINDOWS = ("-static-libgcc", "-Wl,-no-insert-timestamp")
SOURCE = "linear_fmu.c"
LINUX, WINDOWS = "binaries/linux64", "binaries/win64"
LACKING = {
    LINUX: f"64-bit Linux (which takes {', '.join(COMPILERS)} there)",
    WINDOWS: f"64-bit Windows (which takes {CROSS_COMPILER})",
}
"""The note on an FMU without the binaries of a folder."""
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
    "state": {"causality": "local", "variability": "continuous", "initial": "calculated"},
    "output": {"causality": "output", "variability": "continuous", "initial": "calculated"},
    "start": {"causality": "parameter", "variability": "fixed", "initial": "exact"},
    "derivative": {"causality": "local", "variability": "continuous", "initial": "calculated"},
}


def write_fmu(model: StateSpace, step: float = 0.01) -> bytes:
    """The FMU; `step` in seconds is the default communication step, for a discrete model its own.

    The same model gives the same source and GUID.  Raise SceneError for a step that is not positive.
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
    sources = {SOURCE: source, "model.h": header}
    for file, command, flags in (
        (f"{LINUX}/{name}.so", compiler(), OF_LINUX),
        (f"{WINDOWS}/{name}.dll", which(CROSS_COMPILER), OF_WINDOWS),
    ):
        if command and (binary := _compile(sources, [command, *FLAGS, *flags])):
            content[file] = binary
    return _zip(content)


def note(content: bytes) -> str:
    """A note on the systems for which an FMU has no binary, or nothing."""
    with ZipFile(BytesIO(content)) as archive:
        names = " ".join(archive.namelist())
    lacking = [what for folder, what in LACKING.items() if folder not in names]
    return f"the FMU has C source, and no binary for {' or '.join(lacking)}" if lacking else ""


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


def _compile(sources: dict[str, bytes], command: list[str]) -> bytes:
    """The shared library, or nothing."""
    with TemporaryDirectory() as folder:
        for name, content in sources.items():
            (Path(folder) / name).write_bytes(content)
        try:
            subprocess.run(
                [*command, SOURCE, "-o", "model.lib"],
                cwd=folder,
                capture_output=True,
                check=True,
                timeout=COMPILATION_SECONDS,
            )
        except (OSError, subprocess.SubprocessError):
            return b""
        return (Path(folder) / "model.lib").read_bytes()


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
    """Inputs, states, outputs, where states start, and their derivatives: the index of each is its value reference."""
    names = public_names(model)
    states = [f"state.{word}" for word in names.states]
    groups: list[tuple[str, Sequence[str], tuple[Signal, ...]]] = [
        ("input", names.inputs, model.inputs),
        ("state", states, model.states),
        ("output", names.outputs, model.outputs),
        ("start", names.starts, model.states),
    ]
    if not model.dt:
        rates = (s._replace(unit="", meaning=f"derivative: {s.meaning}") for s in model.states)
        groups.append(("derivative", [f"der({word})" for word in states], tuple(rates)))
    return [
        FmuVariable(word, role, signal)
        for role, words, signals in groups
        for word, signal in zip(words, signals, strict=True)
    ]


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
    places = {role: [k for k, variable in enumerate(fmu_variables, 1) if variable.role == role] for role in ROLES}
    derived = dict(zip(places["derivative"], places["state"], strict=not model.dt))
    for place, variable in enumerate(fmu_variables, 1):
        element.append(_variable(variable, place - 1, derived.get(place)))
    _structure(root, model, places)
    ET.indent(root)
    return bytes(ET.tostring(root, encoding="UTF-8", xml_declaration=True))


def _about(model: StateSpace, guid: str) -> dict[str, str]:
    return {
        "fmiVersion": "2.0",
        "modelName": heading(model),
        "guid": guid,
        "description": "; ".join(
            [law(model), f"in co-simulation {HELD}", f"deviations from {datum(model)}", *rest(model)[:8]]
        ),
        "generationTool": "multipendula",
        "variableNamingConvention": "structured",
        "numberOfEventIndicators": "0",
    }


def _interface(root: ET.Element, model: StateSpace, source: str) -> None:
    alike = {"modelIdentifier": identifier(heading(model)), "canNotUseMemoryManagementFunctions": "true"}
    alike |= dict.fromkeys(("canGetAndSetFMUstate", "canSerializeFMUstate", "providesDirectionalDerivative"), "true")
    steps = "false" if model.dt else "true"
    kinds = {
        "ModelExchange": {"completedIntegratorStepNotNeeded": "true"},
        "CoSimulation": {"canInterpolateInputs": "false", "canHandleVariableCommunicationStepSize": steps},
    }
    for kind in list(kinds)[bool(model.dt) :]:
        interface = ET.SubElement(root, kind, alike | kinds[kind])
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


def _variable(variable: FmuVariable, reference: int, state: int | None) -> ET.Element:
    """A variable, perhaps the derivative of a `state`, an index from 1."""
    what = {"name": variable.name, "valueReference": str(reference), "description": one_line(variable.signal.meaning)}
    element = ET.Element("ScalarVariable", {**what, **ROLES[variable.role]})
    attributes = {"unit": name} if (name := unit(variable.signal)) else {}
    if variable.role in {"input", "start"}:
        attributes["start"] = "0"
    if state is not None:
        attributes["derivative"] = str(state)
    ET.SubElement(element, "Real", attributes)
    return element


def _structure(root: ET.Element, model: StateSpace, places: dict[str, list[int]]) -> None:
    """Outputs and derivatives by the inputs and states on which they depend; initial values depend on everything."""
    structure, known = ET.SubElement(root, "ModelStructure"), np.array(places["input"] + places["state"])
    parts = {"Outputs": (places["output"], model.D)}
    if not model.dt:
        parts["Outputs"] = places["output"], np.hstack((model.D, model.C))
        parts["Derivatives"] = places["derivative"], np.hstack((model.B, model.A))
    for part, (unknown, gains) in parts.items():
        parent = ET.SubElement(structure, part) if unknown else structure
        for place, row in zip(unknown, gains, strict=True):
            depends = " ".join(map(str, known[np.flatnonzero(row)].tolist()))
            ET.SubElement(parent, "Unknown", index=str(place), dependencies=depends)
    first = [*([] if model.dt else places["state"]), *places["output"], *places["derivative"]]
    parent = ET.SubElement(structure, "InitialUnknowns") if first else structure
    for place in first:
        ET.SubElement(parent, "Unknown", index=str(place))
