"""The inputs and outputs of a scene: groups of named signals as rows over q = (η, θ_1, …) of its `geometry`.

The force of pendulum p on its pivot is −Σ m h q'' plus the external forces on its links, with the rows h of centres.
If the support moves (the fixed support, or the ground to which rail, spring and damper are attached), q is in its
frame; positions, the velocity of a single cart and forces on pivots are those in the laboratory frame. The coordinates
of a structure and their rates are relative to the ground, accelerations are those in the laboratory. A spring has the
extension e, positive where it is longer, and the force k e + d e', positive where it pulls its ends together.

Inputs may also be at points: a force, a lift or a torque anywhere on a link, and the forces of the scene itself,

    force:pendulum[0].links[1]@0.5      a force along the rail on that point, in N
    lift:pendulum[0].links[1]           a force upwards, here on the centre of mass
    torque:pendulum[0].links[1]         a torque, in N m: of the joint above the link; with @ on the link alone
    force:left@0.2,0.1                  a force along the rail on that point of a support; lift: upwards
    torque:beam                         a torque on a support that turns
    force[0]                            the first [[force]] of the scene: its point and direction

written as in a scene file (`modal.scene.points`): without `copies` the input acts on every copy alike.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple, TypeVar, get_args

import numpy as np

from modal.errors import SceneError, gathered, refuse_any, spelling_hint
from modal.scene import Scene, places_of
from modal.scene.motion import Acting
from modal.scene.points import CarrierPoint, GroundPoint, Place, parse_point, point_problems
from modal.statespace.geometry import Geometry, StructureCoordinate, carrier_row, row_of
from modal.types import Floats


class Signal(NamedTuple):
    """The ASCII name of a state, an input or an output, its unit, and its meaning."""

    name: str
    unit: str
    meaning: str


# ------------------------------------------------------------------------------------------------------- inputs


class InputGroup(NamedTuple):
    """Inputs as generalized forces F (q, m), and the external force of each on each pendulum (p, m)."""

    signals: list[Signal]
    F: Floats
    thrust: Floats


def _link_forces(geometry: Geometry) -> InputGroup:
    signals = _signals("force", "N", "horizontal force at a link's centre of mass", geometry.labels)
    thrust = (geometry.pendulum == np.unique(geometry.pendulum)[:, None]).astype(float)
    return InputGroup(signals, geometry.centres.T, thrust)


def _coordinate_forces(geometry: Geometry) -> InputGroup:
    signals = [
        Signal(coordinate.force, coordinate.force_unit, coordinate.pushed) for coordinate in geometry.coordinates
    ]
    return InputGroup(signals, np.eye(geometry.size)[:, : len(signals)], _nothing(geometry, len(signals)))


def _nothing(geometry: Geometry, m: int) -> Floats:
    return np.zeros((len(geometry.tips), m))


PUSHES: dict[str, Callable[[Geometry], InputGroup]] = {
    "cart_force": _coordinate_forces,
    "joint_torques": lambda g: InputGroup(
        _signals("torque", "N m", "torque of a joint on the link below it", g.labels),
        g.relative.T,
        _nothing(g, len(g.labels)),
    ),
    "link_forces": _link_forces,
    "coordinate_forces": _coordinate_forces,
}
DRIVES = {
    "cart_acceleration": Signal("cart_acceleration", "m/s^2", "prescribed acceleration of the cart"),
    "cart_velocity": Signal("cart_velocity", "m/s", "prescribed velocity of the cart"),
}
SUPPORT = {
    "support_displacement": Signal("support_displacement", "m", "displacement of the support along the rail"),
    "support_velocity": Signal("support_velocity", "m/s", "velocity of the support along the rail"),
    "support_acceleration": Signal("support_acceleration", "m/s^2", "acceleration of the support along the rail"),
}
"""Motions of the fixed support, or of the ground under a cart and under a structure."""
PRESCRIBED = {
    **{name: (False, order) for order, name in enumerate(SUPPORT)},
    "cart_velocity": (True, 1),
    "cart_acceleration": (True, 2),
}
"""Whether each prescribes the cart, or else the support, and how often its displacement is differentiated."""
INPUTS = (*(name for name in PUSHES if name != "coordinate_forces"), *DRIVES, *SUPPORT)
"""Those of scenes on a fixed support or a cart; a structure has also `coordinate_forces`."""


# ------------------------------------------------------------------------------------------------------ outputs


class OutputGroup(NamedTuple):
    """Outputs as Y0 q + Y1 q' + Y2 q'' + thrust u; a part that is None is zero.

    `translation` (p,) is the contribution of a rigid translation along the rail: per metre, per m/s with Y1, per m/s²
    with Y2; `order` says which, and `drag_part` (p,) the additional part of drag per m/s. `pulls` (p, springs) are the
    contributions of springs between points, which loss angles make complex.
    """

    signals: list[Signal]
    position: Floats | None = None
    rate: Floats | None = None
    acceleration: Floats | None = None
    pushed: bool = False
    translation: Floats | None = None
    pulls: Floats | None = None
    drag_part: Floats | None = None

    @property
    def carried(self) -> tuple[Floats | None, Floats | None, Floats | None]:
        """The contributions of the ground's displacement, velocity and acceleration, each (p,)."""
        every = [None, self.drag_part, None]
        every[self.order] = self.translation
        return every[0], every[1], every[2]

    @property
    def order(self) -> int:
        """The order of the highest derivative that it contains."""
        return 2 if self.acceleration is not None else 1 if self.rate is not None else 0


def _signals(prefix: str, unit: str, meaning: str, labels: Iterable[object]) -> list[Signal]:
    return [Signal(f"{prefix}_{label}", unit, meaning) for label in labels]


def _tip_accelerations(geometry: Geometry) -> OutputGroup:
    signals = _signals("tip_ddot", "m/s^2", "acceleration of a pendulum's end", _pendula(geometry))
    if geometry.end_rate is not None:
        geometry = replace(geometry, rate=geometry.end_rate, bend=geometry.end_bend)
    parts = _accelerations(geometry, geometry.joints, lambda rows: rows[geometry.tips])
    return OutputGroup(signals, *parts, translation=np.ones(len(signals)))


def _accelerations(
    geometry: Geometry, rows: Floats, of: Callable[[Floats], Floats]
) -> tuple[Floats | None, Floats | None, Floats]:
    """What multiplies q, q' and q'' in linear combinations of accelerations of the links' points with these rows."""
    if geometry.rate is None or geometry.bend is None:
        return None, None, of(rows)
    return of(geometry.bend), of(2 * geometry.rate), of(rows)


def _pivot_forces(geometry: Geometry) -> OutputGroup:
    signals = _signals("pivot_force", "N", "horizontal force of a pendulum on its pivot", _pendula(geometry))
    belongs = geometry.pendulum == np.unique(geometry.pendulum)[:, None]
    weights, drag_weights = belongs * -geometry.mass, belongs * -geometry.drag
    position, rate, inertia = _accelerations(geometry, geometry.centres, lambda rows: weights @ rows)
    if geometry.drag.any():
        rate = drag_weights @ geometry.centres + (0.0 if rate is None else rate)
        position = None if geometry.rate is None else position + drag_weights @ geometry.rate
    if geometry.pulls.any():
        stiffness, damping = _springs_by(geometry, geometry.pulls)
        position = stiffness if position is None else position + stiffness
        rate = damping if rate is None else rate + damping
    drag_part = drag_weights.sum(1) if geometry.drag.any() else None
    return OutputGroup(signals, position, rate, inertia, True, weights.sum(1), geometry.pulls, drag_part)


def _springs_by(geometry: Geometry, weights: Floats) -> tuple[Floats, Floats]:
    """Sums of the forces of springs with these weights (rows, springs): what multiplies q and q', (rows, q)."""
    k, d = (np.array([getattr(spring, name) for spring in geometry.springs]) for name in ("stiffness", "damping"))
    return (weights * k) @ geometry.extension, (weights * d) @ geometry.extension


def _spring_signals(geometry: Geometry, prefix: str, units: tuple[str, str], meaning: str) -> list[Signal]:
    return [
        Signal(f"{prefix}_{spring.label}", units[int(spring.torsion)], f"{meaning} of a spring between {spring.words}")
        for spring in geometry.springs
    ]


def _spring_forces(geometry: Geometry) -> OutputGroup:
    signals = _spring_signals(geometry, "spring_force", ("N", "N m"), "pull, with that of its damper,")
    unit = np.eye(len(signals))
    return OutputGroup(signals, *_springs_by(geometry, unit), pulls=unit)


def _coordinates(geometry: Geometry) -> OutputGroup:
    signals = [
        Signal(coordinate.name, coordinate.unit or "1", coordinate.meaning) for coordinate in geometry.coordinates
    ]
    return OutputGroup(signals, np.eye(geometry.size)[: len(signals)], translation=_in_laboratory(geometry))


def _coordinate_rates(geometry: Geometry) -> OutputGroup:
    signals = [
        Signal(
            coordinate.derivative(1),
            f"{coordinate.unit or '1'}/s",
            "velocity of the cart" if coordinate.is_cart else f"rate of the {coordinate.meaning}",
        )
        for coordinate in geometry.coordinates
    ]
    return OutputGroup(signals, rate=np.eye(geometry.size)[: len(signals)], translation=_in_laboratory(geometry))


def _in_laboratory(geometry: Geometry) -> Floats:
    """The contribution of the ground's motion to the position of one cart alone, which is that in the laboratory."""
    return np.array([float(coordinate.is_cart) for coordinate in geometry.coordinates])


def _coordinate_accelerations(geometry: Geometry) -> OutputGroup:
    signals = [
        Signal(
            coordinate.derivative(2), f"{coordinate.unit or '1'}/s^2", f"second derivative of the {coordinate.meaning}"
        )
        for coordinate in geometry.coordinates
    ]
    rail_parts = np.array([coordinate.along for coordinate in geometry.coordinates])
    return OutputGroup(signals, acceleration=np.eye(geometry.size)[: len(signals)], translation=rail_parts)


def _pendula(geometry: Geometry) -> range:
    return range(1, len(geometry.tips) + 1)


Group = TypeVar("Group", InputGroup, OutputGroup)
READINGS: dict[str, Callable[[Geometry], OutputGroup]] = {
    "cart_position": _coordinates,
    "cart_velocity": _coordinate_rates,
    "angles": lambda g: OutputGroup(_signals("theta", "rad", "angle from equilibrium", g.labels), g.angles),
    "rates": lambda g: OutputGroup(_signals("theta_dot", "rad/s", "rate of the angle", g.labels), rate=g.angles),
    "relative_angles": lambda g: OutputGroup(_signals("rel", "rad", "angle to the link above", g.labels), g.relative),
    "relative_rates": lambda g: OutputGroup(
        _signals("rel_dot", "rad/s", "rate of that angle", g.labels), rate=g.relative
    ),
    "joint_positions": lambda g: OutputGroup(
        _signals("joint", "m", "horizontal position of a lower joint", g.labels),
        g.joints,
        translation=np.ones(len(g.labels)),
    ),
    "tip_positions": lambda g: OutputGroup(
        _signals("tip", "m", "horizontal position of a pendulum's end", _pendula(g)),
        g.joints[g.tips],
        translation=np.ones(len(g.tips)),
    ),
    "tip_accelerations": _tip_accelerations,
    "pivot_forces": _pivot_forces,
    "coordinates": _coordinates,
    "coordinate_rates": _coordinate_rates,
    "coordinate_accelerations": _coordinate_accelerations,
    "spring_forces": _spring_forces,
    "spring_extensions": lambda g: OutputGroup(
        _spring_signals(g, "spring_extension", ("m", "rad"), "extension"), g.extension
    ),
}
OF_A_CART = {"cart_force", "cart_position", "cart_velocity", "cart_acceleration"}
OF_STRUCTURES = {"coordinate_forces", "coordinates", "coordinate_rates", "coordinate_accelerations"}
OF_SPRINGS = {"spring_forces", "spring_extensions"}
OUTPUTS = tuple(name for name in READINGS if name not in OF_STRUCTURES | OF_SPRINGS)
"""Those of scenes on a fixed support or a cart."""


def by_name(groups: Mapping[str, Callable[[Geometry], Group]], geometry: Geometry) -> dict[str, tuple[Group, int]]:
    """Every signal of these groups by its name: its group, and where it is there."""
    all_groups = (make(geometry) for make in groups.values())
    return {signal.name: (group, k) for group in all_groups for k, signal in enumerate(group.signals)}


def pushes_in(geometry: Geometry, name: str) -> InputGroup:
    """A group of inputs, or the one on a coordinate of a structure by its name."""
    if name in PUSHES:
        return PUSHES[name](geometry)
    group, k = by_name(PUSHES, geometry)[name]
    return InputGroup([group.signals[k]], group.F[:, [k]], group.thrust[:, [k]])


def reading_in(geometry: Geometry, name: str) -> OutputGroup:
    """A group of outputs, or one of the signals of a structure by its name."""
    if name in READINGS:
        return READINGS[name](geometry)
    group, k = by_name(READINGS, geometry)[name]
    position, rate, second, translation = (
        None if part is None else part[[k]]
        for part in (group.position, group.rate, group.acceleration, group.translation)
    )
    return OutputGroup([group.signals[k]], position, rate, second, translation=translation)


def own_inputs(geometry: Geometry) -> tuple[str, ...]:
    """The names of the inputs on single coordinates of a structure."""
    return tuple(coordinate.force for coordinate in _named_coordinates(geometry))


def _named_coordinates(geometry: Geometry) -> tuple[StructureCoordinate, ...]:
    """The coordinates with signals of their own names."""
    return geometry.coordinates if geometry.is_structured else ()


def inputs_of(geometry: Geometry) -> tuple[str, ...]:
    """Return the names of all inputs of a scene except those at points."""
    of_structure = own_inputs(geometry)
    return (*INPUTS, *["coordinate_forces"] * bool(of_structure), *of_structure)


def outputs_of(geometry: Geometry) -> tuple[str, ...]:
    """The names of all groups of outputs of a scene, and of those that a structure has by themselves."""
    of_structure = [name for name in READINGS if name in OF_STRUCTURES | OF_SPRINGS and not _lacks(name, geometry)]
    return (*OUTPUTS, *of_structure, *own_outputs(geometry))


def own_signals(geometry: Geometry) -> frozenset[str]:
    """The names of all signals that a structure has by itself, those of states among them."""
    states = [coordinate.derivative(1).replace("_dot", "_dot_free") for coordinate in _named_coordinates(geometry)]
    states += [f"{coordinate.name}_free" for coordinate in _named_coordinates(geometry)]
    return frozenset((*own_inputs(geometry), *own_outputs(geometry), *states))


def own_outputs(geometry: Geometry) -> tuple[str, ...]:
    """The names of all outputs that a structure has by themselves."""
    names = (*sorted(OF_STRUCTURES - {"coordinate_forces"}), *sorted(OF_SPRINGS)) if geometry.is_structured else ()
    return tuple(signal.name for name in names for signal in READINGS[name](geometry).signals)


def validate_signals(
    words: tuple[str, ...],
    known_names: tuple[str, ...],
    what: str,
    geometry: Geometry,
    *,
    is_further: Callable[[str], bool] = lambda word: False,
    examples: str = "",
) -> tuple[str, ...]:
    """Return the words; raise SceneError with every one that is unknown, repeated, or not available.

    `is_further` recognizes further valid words, of which `examples` gives some.
    """
    if isinstance(words, str):
        raise SceneError([f'{what} {words}: must be a tuple of names: ("{words}",)'])
    choices = ", ".join(known_names) + (f"; or {examples}" if examples else "")
    unknown = [
        word for word in words if word not in known_names and not is_further(word) and not _lacks(word, geometry)
    ]
    problems = [f"{what} {word}: must be one of {choices}{spelling_hint(word, known_names)}" for word in unknown]
    problems += [f"{what} {word}: named twice" for word in dict.fromkeys(words) if words.count(word) > 1]
    problems += [f"{what} {word}: {why}" for word in words if (why := _lacks(word, geometry))]
    refuse_any(problems)
    return words


def _lacks(word: str, geometry: Geometry) -> str:
    """The part that a word needs and the scene lacks; "" if it has it."""
    if word in OF_A_CART and not geometry.on_cart:
        names = [coordinate.force for coordinate in geometry.coordinates]
        return f"there is no cart alone: name one of {', '.join(names)}" if names else "the support is fixed"
    if word in OF_STRUCTURES and not _named_coordinates(geometry):
        return "the scene has no structure with coordinates of its own"
    if word in OF_SPRINGS and not geometry.springs:
        return "the scene has no springs between points"
    return ""


WAYS: dict[str, Acting] = {"force": "horizontal", "lift": "vertical", "torque": "torque"}
MEANING = {"horizontal": "force along the rail on", "vertical": "force upwards on", "torque": "torque on"}
OF_SCENE = re.compile(r"force\[([0-9]{1,9})\]", re.ASCII)
EXAMPLES = "force:POINT, lift:POINT or torque:POINT, as force:pendulum[0].links[1]@0.5, or force[0] of the scene"
assert set(WAYS.values()) == set(get_args(Acting))


class PointInput(NamedTuple):
    """An input by its name: the point in words, how it acts there, and every link that it is on.

    Without links it acts on the cart, or on the point `carrier` of a support.
    """

    name: str
    on: str
    direction: Acting
    places: tuple[Place, ...]
    carrier: CarrierPoint | None = None


def is_point(name: str) -> bool:
    """Whether a name is one of an input at a point.

    >>> is_point("lift:pendulum[0].links[1]"), is_point("force[0]"), is_point("cart_force")
    (True, True, False)
    """
    return (name.partition(":")[0] in WAYS and ":" in name) or bool(OF_SCENE.fullmatch(name))


def point_input(scene: Scene, name: str) -> PointInput:
    """Return the input of this name; raise SceneError if the scene has no such point or force.

    >>> from modal import load
    >>> [place.link for place in point_input(load("chain-2"), "force:pendulum[0].links[0]@0.5").places]
    [0, 1]
    """
    match = OF_SCENE.fullmatch(name)
    if match:
        if int(match[1]) >= len(scene.force):
            raise SceneError([f"input {name}: the scene has {len(scene.force)} entries of force, numbered from 0"])
        force = scene.force[int(match[1])]
        return _input_on(scene, name, force.on, force.direction)
    kind, _, on = name.partition(":")
    try:
        point = parse_point(on)
    except ValueError as error:
        raise SceneError([f"input {name}: {error}"]) from None
    problems = list(point_problems(scene, on))
    if point is None and kind != "force":
        problems.append("the cart runs on a horizontal rail: only force:cart acts on it")
    if isinstance(point, GroundPoint):
        problems.append("the ground cannot be moved by a force: name a support or a link")
    if isinstance(point, CarrierPoint) and not problems and not scene.is_structured:
        problems.append('all points of the support move alike: write "cart"' if scene.cart else "the support is fixed")
    refuse_any([f"input {name}: {words}" for words in problems])
    return _input_on(scene, name, on, WAYS[kind])


def _input_on(scene: Scene, name: str, on: str, direction: Acting) -> PointInput:
    point = parse_point(on)
    carrier = point if isinstance(point, CarrierPoint) else None
    return PointInput(name, on, direction, tuple(places_of(scene, on)), carrier)


def validate_points(scene: Scene, names: Sequence[str]) -> None:
    """Raise SceneError with everything that is wrong with the names of points among these."""
    problems: list[str] = []
    for name in filter(is_point, names):
        with gathered(problems):
            point_input(scene, name)
    refuse_any(dict.fromkeys(problems))


def push_of(scene: Scene, geometry: Geometry, name: str) -> InputGroup:
    """The generalized forces of a group of inputs, or of an input at a point."""
    return input_at_point(geometry, point_input(scene, name)) if is_point(name) else pushes_in(geometry, name)


def input_at_point(geometry: Geometry, point: PointInput) -> InputGroup:
    """The generalized force of an input at a point, and its external force on every pendulum.

    With the way n of a link's end per length and angle, cos θ along the rail and sin θ upwards, a force on link i has
    l_k n_k on the links k above it and s n_i on its own, at the distance s from the upper joint.
    """
    F, thrust = np.zeros((geometry.size, 1)), np.zeros((len(geometry.tips), 1))
    if point.carrier is not None:
        for column, value in carrier_row(geometry.structure, point.carrier, point.direction).items():
            F[column] = value
    elif not point.places:
        F[0] = 1.0
    for place in point.places:
        F[:, 0] += row_of(geometry, place, point.direction)
        if point.direction == "horizontal":
            thrust[int(geometry.pendulum[place.link])] += 1.0
    unit = "N m" if point.direction == "torque" else "N"
    return InputGroup([Signal(point.name, unit, f"{MEANING[point.direction]} {point.on}")], F, thrust)
