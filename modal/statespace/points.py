"""Inputs at points of a scene: a force, a lift or a torque anywhere on a link, and the forces of the scene itself.

    force:pendulum[0].links[1]@0.5      a force along the rail on that point, in N
    lift:pendulum[0].links[1]           a force upwards, here on the centre of mass
    torque:pendulum[0].links[1]         a torque, in N m: of the joint above the link; with @ on the link alone
    force:left@0.2,0.1                  a force along the rail on that point of a support; lift: upwards
    torque:beam                         a torque on a support that turns
    force[0]                            the first [[force]] of the scene: its point and direction

Points are written as in a scene file (`modal.scene.points`): without `copies` the input acts on every copy alike.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import NamedTuple, get_args

import numpy as np

from modal.errors import SceneError
from modal.scene import Scene, places_of
from modal.scene.motion import Acting
from modal.scene.points import CarrierPoint, GroundPoint, Place, parse_point, point_problems
from modal.statespace.geometry import Geometry
from modal.statespace.signals import InputGroup, Signal, pushes_in
from modal.structure import Row, Structure, slopes, turning
from modal.types import Floats

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
    """The input of this name; SceneError where the scene has no such point or force.

    >>> from modal import load
    >>> [place.link for place in point_input(load("chain-2"), "force:pendulum[0].links[0]@0.5").places]
    [0, 1]
    """
    listed = OF_SCENE.fullmatch(name)
    if listed:
        if int(listed[1]) >= len(scene.force):
            raise SceneError([f"input {name}: the scene has {len(scene.force)} entries of force, numbered from 0"])
        force = scene.force[int(listed[1])]
        point = parse_point(force.on)
        carrier = point if isinstance(point, CarrierPoint) else None
        return PointInput(name, force.on, force.direction, tuple(places_of(scene, force.on)), carrier)
    kind, _, on = name.partition(":")
    try:
        point = parse_point(on)
    except ValueError as error:
        raise SceneError([f"input {name}: {error}"]) from None
    problems = list(point_problems(scene, on))
    if point is None and kind != "force":
        problems.append("the cart runs on a horizontal rail: only force:cart acts on it")
    if isinstance(point, GroundPoint):
        problems.append("the ground does not yield to a force: name a support or a link")
    if isinstance(point, CarrierPoint) and not problems and not scene.is_structured:
        problems.append('all points of the support move alike: write "cart"' if scene.cart else "the support is fixed")
    if problems:
        raise SceneError([f"input {name}: {words}" for words in problems])
    carrier = point if isinstance(point, CarrierPoint) else None
    return PointInput(name, on, WAYS[kind], tuple(places_of(scene, on)), carrier)


def validate_points(scene: Scene, names: Sequence[str]) -> None:
    """SceneError naming everything that is wrong with the names of points among these."""
    problems: list[str] = []
    for name in filter(is_point, names):
        try:
            point_input(scene, name)
        except SceneError as error:
            problems += error.problems
    if problems:
        raise SceneError(list(dict.fromkeys(problems)))


def push_of(scene: Scene, geometry: Geometry, name: str) -> InputGroup:
    """The generalized forces of a group of inputs, or of an input at a point."""
    return pushed(geometry, point_input(scene, name)) if is_point(name) else pushes_in(geometry, name)


def pushed(geometry: Geometry, point: PointInput) -> InputGroup:
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


def carrier_row(structure: Structure, point: CarrierPoint, direction: Acting) -> Row:
    """The generalized force of a force of 1 N, or a torque of 1 N m, on a point of a support, by coordinates."""
    carrier = [body.name for body in structure.carriers].index(point.name)
    if direction == "torque":
        return turning(structure, carrier)
    along, down = slopes(structure, carrier, point.place if point.point is None else point.point)
    return along if direction == "horizontal" else {column: 0.0 - value for column, value in down.items()}


def row_of(geometry: Geometry, place: Place, direction: Acting) -> Floats:
    """The generalized force (q,) of a force of 1 N or a torque of 1 N m at one link."""
    first, row = geometry.leading, np.zeros(geometry.size)
    if direction == "torque":
        row[first + place.link] = 1.0
        if place.below is None and place.above >= 0:
            row[first + place.above] = -1.0
        if place.below is None and place.above < 0:
            row[:first] = 0.0 - geometry.turning[place.link]
        return row
    way = geometry.across if direction == "horizontal" else -geometry.sinking
    top = int(np.flatnonzero(geometry.pendulum == geometry.pendulum[place.link])[0])
    above = slice(top, place.link)
    row[first + top : first + place.link] = (way * geometry.length)[above]
    below = geometry.centre[place.link] if place.below is None else place.below
    row[first + place.link] = way[place.link] * below
    if direction == "horizontal":
        row[:first] = geometry.centres[place.link, :first]
    else:
        row[:first] = 0.0 - geometry.down[place.link]
    return row
