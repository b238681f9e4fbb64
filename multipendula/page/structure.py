"""The drawing of the supports of a scene, and the equations of a structure, written from Python for its page.

Two modules of the page are made here.  `drawing` has the functions of `modal.structure.outlines`, recorded, and the
coordinates of the supports.  `structure` says null of a scene that is no structure; else it has the functions of
`nonlinear.dynamics.steps` and the numbers that they take: the entries of `nonlinear.system.entries_of` that are `kept`,
with their `places` in the scene, then what is `prescribed`, with the places and units of its `constants`.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from modal.modes.rows import ALIKE, COUNTED, UNNAMED
from modal.scene import Scene
from modal.structure import STILL, Piece, Scaffold, Structure
from multipendula.page.prescribed import leading

if TYPE_CHECKING:
    from nonlinear.dynamics import Module
    from nonlinear.system import System

NONE = "export const structure = null;"
FUNCTIONS = (
    "const { sin, cos, sqrt, exp, log, tanh, atan: arctan } = Math;\nconst where = (x, a, b) => (x > 0 ? a : b);"
)
UNITS = {"m": "m", "rad": "rad"}


def is_structural(scene: Scene) -> bool:
    """Whether the page has the equations of a scene as those of one structure: also with joint laws and rotors."""
    return (
        scene.is_structured
        or not scene.features.isdisjoint({"law", "rotor"})
        or any(link.point_force for link in scene.links())
    )


def structure_module(scene: Scene) -> str:
    """The text of the module of a scene."""
    if not is_structural(scene):
        return NONE
    from nonlinear.dynamics import structure_steps
    from nonlinear.system import constants_of, entries_of, law_places, prescribed_places, structure_places, system_of

    system = replace(system_of(scene), is_structured=True)
    structure = system.structure
    assert structure is not None
    steps = structure_steps(system)
    data = {
        "entries": entries_of(system),
        "kept": steps.entry_numbers,
        "prescribed": constants_of(system),
        "places": [[k, list(place)] for k, place in (*structure_places(scene), *law_places(scene, system))],
        "constants": [[list(place), unit] for place, unit in prescribed_places(scene, system)],
        "motions": [list(place) for place in scene.motion_places],
        "leading": leading(system),
        "bases": _bases(structure),
        "start": _start(scene, system),
    }
    return _written("structure", data, steps=steps.module)


def drawing_module(scene: Scene) -> str:
    """The text of the module that draws the supports of a scene."""
    from nonlinear.system import system_of

    system = replace(system_of(scene), is_structured=True)
    assert system.structure is not None
    drawing, pieces = _drawing(system, system.structure)
    data = {
        "coordinates": list(_coordinates(system.structure)),
        "pendula": len(system.structure.pivots),
        "pieces": pieces,
        "pushed": bool(system.forces) or any(motion.direction == "horizontal" for motion in scene.motions),
    }
    return _written("drawing", data, functions=drawing)


def _written(name: str, data: dict[str, Any], **modules: Module) -> str:
    """A module of the page with these data and functions."""
    text = json.dumps(data, allow_nan=False).replace("<", "\\u003c")  # ends no element of the page
    return "\n".join(
        (
            "// Written by `multipendula.page.structure`.",
            FUNCTIONS,
            *(f"const {key} = {module.javascript()};" for key, module in modules.items()),
            f"export const {name} = {{ ...{text}, {', '.join(modules)} }};",
        )
    )


def _coordinates(structure: Structure) -> Iterator[dict[str, Any]]:
    """Of every coordinate its support, kind, unit and name, and words for its motion in a mode."""
    for carrier, numbers in enumerate(structure.carriers):
        named = UNNAMED.get(numbers.kind, numbers.name) if numbers.name == numbers.kind else numbers.name
        for k, suffix in enumerate(numbers.suffixes):
            way, _, last = suffix.rpartition("_")
            unit = UNITS.get(last, "")
            name = " ".join(filter(None, (numbers.name, way or ("" if unit else suffix))))
            words = {"named": named, "verb": numbers.verb(k), "alike": ALIKE.get(numbers.kind), "counted": COUNTED}
            yield {"carrier": carrier, "kind": numbers.kind, "unit": unit, "name": name, **words}


def _bases(structure: Structure) -> list[int]:
    """Of every pendulum the coordinate by which its support turns, -1 where it does not."""
    angles = (structure.angle_of(pivot.carrier) for pivot in structure.pivots)
    return [-1 if angle is None else angle for angle in angles]


def _start(scene: Scene, system: System) -> list[float] | None:
    """The y at which the scene starts; None at rest."""
    from nonlinear.system import Layout, has_start, initial_state

    if not has_start(scene):
        return None
    y = Layout(system.n_links, 1, system.first, True, scene.is_structured).begin(initial_state(scene))
    return None if _rests(y, system) else [float(value) for value in y]


def _rests(y: Any, system: System) -> bool:
    rest = np.concatenate((np.zeros(system.first), system.rest, np.zeros(len(y) - system.first - system.n_links)))
    return bool(np.allclose(y, rest, rtol=0, atol=1e-15))


# ------------------------------------------------------------------------------------------------------- drawing


def _drawing(system: System, structure: Structure) -> tuple[Module, list[dict[str, Any]]]:
    """The functions "pivots", of y = η, and "pieces", also of u, the joints of all pendula, and the fixed parts.

    Lengths are in m, along the rail and down.
    """
    from nonlinear.dynamics import Module, Tape

    tape = Tape()
    scaffold = scaffold_of(system)
    eta = tape.inputs("y", structure.size)[None, :]
    joints = tape.inputs("u", 2 * (system.n_links + len(structure.pivots)))
    chains, at = {}, 0
    for pendulum, count in enumerate(_sizes(system)):
        chain = joints[at : at + 2 * (count + 1)].reshape(1, -1, 2).copy()
        chain[..., 1] = -chain[..., 1]
        chains[pendulum], at = chain, at + chain.size
    carriers = [(k, piece) for k in range(len(structure.carriers)) for piece in scaffold.of_carrier(k, eta)]
    springs = scaffold.pieces(eta, chains)[len(carriers) :]
    told, moving = [], list[Any]()
    for carrier, piece in (*carriers, *((-1, piece) for piece in springs)):
        points = [value for x, z in piece.points[0].tolist() for value in (x, -z)]
        own_piece: dict[str, Any] = {"role": piece.role, "carrier": carrier}
        if piece.is_outline:
            own_piece["closed"] = True
        if _is_still(piece, points):
            own_piece["points"] = [round(float(value), 9) for value in points]
        else:
            own_piece["count"] = len(points) // 2
            moving += points
        told.append(own_piece)
    pivots = [value for x, z in scaffold.pivots(eta)[0].tolist() for value in (x, -z)]
    return Module(tape, {"pivots": pivots, "pieces": moving}), told


def _is_still(piece: Piece, points: list[Any]) -> bool:
    return piece.role in STILL and all(isinstance(value, float | int) for value in points)


def scaffold_of(system: System) -> Scaffold:
    """The structure of a system with all pendula."""
    structure = system.structure
    assert structure is not None
    lengths, centres = system.by_link("length"), system.by_link("centre")
    first = np.concatenate(([0], np.cumsum(_sizes(system))))
    chains = [slice(*ends) for ends in pairwise(first)]
    unit = max(float(np.maximum(lengths[chain], centres[chain]).sum()) for chain in chains)
    drawn = np.arange(len(chains))
    scaffold = Scaffold(structure, drawn, first, unit)
    pivots = scaffold.pivots(np.zeros((1, structure.size)))[0]
    signs = system.by_link("sigma")
    hanging = {
        k: pivots[k] - np.array([(0.0, depth) for depth in (0.0, *np.cumsum(lengths[chain] * signs[chain]))])
        for k, chain in enumerate(chains)
    }
    return Scaffold(structure, drawn, first, unit, hanging=hanging)


def _sizes(system: System) -> list[int]:
    """Links of every pendulum."""
    sizes: list[int] = np.bincount(system.pendulum).tolist()
    return sizes
