"""The drawing of the supports of a scene, and its equations and prescribed motions, written from Python for its page.

Four modules of the page are made here.  `drawing` has the functions of `modal.structure.outlines`, recorded, and the
coordinates of the supports.  `structure` says null of a scene that is no structure; else it has the functions of
`nonlinear.dynamics.steps` and the numbers that they take: the entries of `nonlinear.system.entries_of` that are `kept`,
with their `places` in the scene, then what is `prescribed`, with the places and units of its `constants`.

`whole` has the equations of scenes with dry friction, or with forces, on a cart or a support, as one text, and is null
for other scenes: the functions of `switching_of` in `nonlinear.dynamics.forms`, the changes at a switch and where a
step ends at one, all the same text as Python runs (`multipendula.page.scalars`), and where the numbers are that they
take.

`prescribed` has the motions of a support and loads in time other than sines, null where these are all: the functions of
a sweep, as Python runs them, the polynomials of a record, the lines of a random process, and which of them, in which
derivative, are the inputs u of the equations (`nonlinear.dynamics.inputs`).
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import replace
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from modal.modes.rows import ALIKE, COUNTED, UNNAMED
from modal.scene import Scene
from modal.structure import STILL, Scaffold, Structure
from multipendula.page.scalars import HELPERS, functions_of, method_source

if TYPE_CHECKING:
    from modal.vibration import Polynomials, PrescribedMotion, Record
    from nonlinear.dynamics import Module
    from nonlinear.system import System

FUNCTIONS = (
    "const { sin, cos, sqrt, exp, log, tanh, atan: arctan } = Math;\nconst where = (x, a, b) => (x > 0 ? a : b);"
)
UNITS = {"m": "m", "rad": "rad"}
PIECES_MAX = 2000
"""Limit: samples of a record or lines of a random process: "cannot show more than 2000 samples or sines of it"."""
SWEEP = ("_turning", "velocity_at", "acceleration_at")
SWITCHED_LINKS_MAX = 12
"""Limit: links of a scene with dry friction or forces, whose text grows with the square of their number."""
TEXTS = ("rates", "sticking", "friction", "responses", "values", "clear", "kick")
CHANGED = ("damping", "drag", "quadratic_drag")
"""The numbers of links that have a slider also where they are 0."""
CALLED = ("sticking", "friction", "responses", "kick", "kicked")
"""The texts that are called at a switch."""
LISTS = frozenset({"inputs"})


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
        return "export const structure = null;"
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
            "// Written by `multipendula.page.equations`.",
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
        if piece.role in STILL and all(isinstance(value, float | int) for value in points):
            own_piece["points"] = [round(float(value), 9) for value in points]
        else:
            own_piece["count"] = len(points) // 2
            moving += points
        told.append(own_piece)
    pivots = [value for x, z in scaffold.pivots(eta)[0].tolist() for value in (x, -z)]
    return Module(tape, {"pivots": pivots, "pieces": moving}), told


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


def prescribed_module(scene: Scene) -> str:
    """The text of the module of a scene."""
    from nonlinear.system import system_of

    system = system_of(scene)
    if not system.prescribed_motions or system.is_analytic:
        return "export const prescribed = null;"
    from modal.vibration import SweptSine

    data = {
        "sources": [_source(motion) for motion in system.prescribed_motions],
        "courses": [[system.prescribed_motions.index(course.motion), course.order] for course in system.courses()],
        "forces": len(system.forces),
        "breaks": sorted({float(time) for motion in system.prescribed_motions for time in motion.breaks}),
        "shortest": system.shortest,
    }
    return "\n".join(
        (
            "// Written by `multipendula.page.equations`.",
            HELPERS,
            "const { sin, cos } = Math;",
            method_source([getattr(SweptSine, name) for name in SWEEP]),
            f"const sweep = {{ turning: {SWEEP[0]}, velocity: {SWEEP[1]}, acceleration: {SWEEP[2]} }};",
            f"export const prescribed = {{ ...{json.dumps(data, allow_nan=False)}, sweep }};",
        )
    )


def leading(system: System) -> int:
    """How many inputs u of the equations come first: the time, or the prescribed values."""
    if not system.prescribed_motions:
        return 0
    return 1 if system.is_analytic else len(system.courses())


def long_ones(scene: Scene) -> Iterator[str]:
    """The kinds of motions and forces that are too long for a page."""
    from modal.vibration import RandomProcess, Record, prescribed_motion

    for part in (*scene.motions, *scene.force):
        if part.kind in {"record", "random"}:
            motion = prescribed_motion(part)
            size = len(motion.pieces[0]) if isinstance(motion, Record) else 0
            size = len(motion.omega) if isinstance(motion, RandomProcess) else size
            if size > PIECES_MAX:
                yield part.kind


def _source(motion: PrescribedMotion) -> dict[str, Any]:
    from modal.vibration import RandomProcess, Record, SweptSine

    if isinstance(motion, Record):
        return {"kind": "record", "orders": [_listed(pieces) for pieces in _polynomials(motion)]}
    if isinstance(motion, RandomProcess):
        return {
            "kind": "random",
            "omega": motion.omega.tolist(),
            "real": motion.lines.real.tolist(),
            "imaginary": motion.lines.imag.tolist(),
        }
    return {"kind": "sweep" if isinstance(motion, SweptSine) else "sine" if len(motion.constants) > 1 else "constant"}


def _polynomials(motion: Record) -> tuple[Polynomials, Polynomials, Polynomials]:
    """The polynomials of the displacement, the velocity and the acceleration."""
    velocity, acceleration = (motion.polynomials(order) for order in (1, 2))
    powers = np.arange(1, velocity.coefficients.shape[1] + 1)
    begun = np.asarray(motion.derivative(velocity.origins, 0))
    place = velocity._replace(coefficients=np.column_stack((begun, velocity.coefficients / powers)))
    return place, velocity, acceleration


def _listed(polynomials: Polynomials) -> dict[str, Any]:
    return {name: getattr(polynomials, name).tolist() for name in ("knots", "origins", "coefficients")}


def is_whole(scene: Scene) -> bool:
    """Whether the page has the equations of a scene as one text."""
    return not is_structural(scene) and (scene.has_friction or bool(scene.force))


def whole_module(scene: Scene) -> str:
    """The text of the module of a scene."""
    if not is_whole(scene):
        return "export const whole = null;"
    from nonlinear.integration import method, switches_of
    from nonlinear.system import constants_of, prescribed_places, system_of
    from nonlinear.system.numbers import BEFORE, FIELDS

    system = system_of(scene)
    switches = switches_of(system, has_load=True, works=True)
    firsts = [BEFORE + system.n_links * FIELDS.index(name) for name in CHANGED]
    changed = {k for first in firsts for k in range(first, first + system.n_links)}
    present = tuple(has or k in changed for k, has in enumerate(switches.form.present))
    switches = replace(switches, form=replace(switches.form, present=present))
    at, module = switches.places, switches.module
    names = [name for name in TEXTS if name in module.functions]
    data = {
        "first": switches.form.first,
        "kept": [k for k, has in enumerate(present) if has],
        "prescribed": constants_of(system),
        "places": [[list(place), unit] for place, unit in prescribed_places(scene, system)],
        "leading": leading(system),
        "told": at.state_count,
        "length": at.length,
        "presses": at.presses,
        "contacts": at.contacts,
        "kicks": at.kicks,
        "seen_": method.SEEN,
        "looks": method.LOOKS,
        "nodes": method.NODES,
    }
    sizes = {name: len(module.functions[name]) for name in names}
    lines = (
        "// Written by `multipendula.page.equations`.",
        FUNCTIONS,
        f"const steps = {module.javascript(*names)};",
        *(_called(name, sizes.get(name)) for name in dict.fromkeys((*names, *CALLED))),
        _switches(switches),
        f"const data = {json.dumps(data, allow_nan=False)};",
        "const constants = (p) => Float64Array.from(steps.constants(p));",
        f"const called = {{ {', '.join(names)} }};",
        "const switching = { inputs, begin, due, change, may_pass, meet, PASSING_SHARE, STANDS, AGAIN };",
        "export const whole = { ...data, ...called, ...switching, constants };",
    )
    return "\n".join(lines)


def _called(name: str, size: int | None) -> str:
    """A text as a function that returns its results; one that the scene does not have returns nothing."""
    if size is None:
        return f"const {name} = () => [];"
    return f"const {name} = (c, y, u, v) => {{ const o = new Array({size}); steps.{name}(c, y, u, v, o); return o; }};"


def _switches(switches: Any) -> str:
    """The changes at a switch, and where steps end at one."""
    from nonlinear.integration import MEETING, meeting_source, names_in, switching_source

    constants = [*_constants(names_in(switches.places)), *_constants(MEETING)]
    named = ["const [NOTHING, NAN, INF] = [[], NaN, Infinity];", *constants]
    return "\n".join((HELPERS, *named, functions_of(switching_source(), LISTS), functions_of(meeting_source())))


def _constants(names: Mapping[str, Any]) -> list[str]:
    return [f"const {name} = {json.dumps(value)};" for name, value in names.items()]
