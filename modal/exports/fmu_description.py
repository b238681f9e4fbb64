"""The description of a linear model for FMI 2.0 co-simulation, in ET."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple
from xml.etree import ElementTree as ET

from modal.exports.identifiers import identifier, identifiers
from modal.exports.modelica import unit
from modal.exports.text import heading, law, rest
from modal.report import one_line
from modal.statespace import Signal, StateSpace

UNITS = {
    "m": {"m": 1},
    "m/s": {"m": 1, "s": -1},
    "m/s2": {"m": 1, "s": -2},
    "rad": {"rad": 1},
    "rad/s": {"rad": 1, "s": -1},
    "N": {"kg": 1, "m": 1, "s": -2},
    "N.m": {"kg": 1, "m": 2, "s": -2},
}
HELD = "inputs are held over every communication step"
ROLES = {
    "input": {"causality": "input", "variability": "continuous"},
    "state": {"causality": "local", "variability": "continuous", "initial": "exact"},
    "output": {"causality": "output", "variability": "continuous", "initial": "calculated"},
}


class Variable(NamedTuple):
    """A signal in its role, under the name that it has in the FMU."""

    name: str
    role: str
    signal: Signal


def variables(model: StateSpace) -> list[Variable]:
    """Inputs, then states as `state.NAME`, then outputs: the place of each is its value reference."""
    outside = [("input", s) for s in model.inputs], [("output", s) for s in model.outputs]
    words = identifiers((s.name for _, s in (*outside[0], *outside[1])), taken=["state"])
    named = [Variable(word, *pair) for word, pair in zip(words, (*outside[0], *outside[1]), strict=True)]
    inner = identifiers(s.name for s in model.states)
    states = [Variable(f"state.{word}", "state", s) for word, s in zip(inner, model.states, strict=True)]
    return [*named[: len(outside[0])], *states, *named[len(outside[0]) :]]


def description(model: StateSpace, step: float, guid: str, source: str) -> bytes:
    """modelDescription.xml; `step` in seconds is the default step, `source` the file under sources/."""
    named = variables(model)
    root = ET.Element("fmiModelDescription", _about(model, guid))
    _interface(root, model, source)
    _units(root, named)
    log = ET.SubElement(root, "LogCategories")
    ET.SubElement(log, "Category", name="logStatusError")
    ET.SubElement(root, "DefaultExperiment", startTime="0", stopTime="10", stepSize=repr(step))
    listed = ET.SubElement(root, "ModelVariables")
    for reference, variable in enumerate(named):
        listed.append(_variable(variable, reference))
    _structure(root, model)
    ET.indent(root)
    return bytes(ET.tostring(root, encoding="UTF-8", xml_declaration=True))


def _about(model: StateSpace, guid: str) -> dict[str, str]:
    return {
        "fmiVersion": "2.0",
        "modelName": heading(model),
        "guid": guid,
        "description": "; ".join([law(model), HELD, "deviations from the rest", *rest(model)[:8]]),
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


def _units(root: ET.Element, named: list[Variable]) -> None:
    used = dict.fromkeys(name for variable in named if (name := unit(variable.signal)))
    if not used:
        return
    definitions = ET.SubElement(root, "UnitDefinitions")
    for name in used:
        definition = ET.SubElement(definitions, "Unit", name=name)
        if name in UNITS:
            ET.SubElement(definition, "BaseUnit", {base: str(power) for base, power in UNITS[name].items()})


def _variable(variable: Variable, reference: int) -> ET.Element:
    what = {"name": variable.name, "valueReference": str(reference), "description": one_line(variable.signal.meaning)}
    element = ET.Element("ScalarVariable", {**what, **ROLES[variable.role]})
    start = {} if variable.role == "output" else {"start": "0"}
    given = {"unit": name} if (name := unit(variable.signal)) else {}
    ET.SubElement(element, "Real", {**given, **start})
    return element


def _structure(root: ET.Element, model: StateSpace) -> None:
    """Outputs depend at once on the inputs that D lets through; their first values on everything."""
    structure = ET.SubElement(root, "ModelStructure")
    for part, listed in (("Outputs", _through(model)), ("InitialUnknowns", _first(model))):
        if model.outputs:
            parent = ET.SubElement(structure, part)
            for attributes in listed:
                ET.SubElement(parent, "Unknown", attributes)


def _through(model: StateSpace) -> Iterator[dict[str, str]]:
    for attributes, row in zip(_first(model), model.D, strict=True):
        yield {**attributes, "dependencies": " ".join(str(k) for k, gain in enumerate(row, 1) if gain)}


def _first(model: StateSpace) -> Iterator[dict[str, str]]:
    before = len(model.inputs) + len(model.states)
    yield from ({"index": str(before + row)} for row in range(1, len(model.outputs) + 1))
