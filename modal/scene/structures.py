"""Checks of the supports, the springs and the ground of a scene; each mistake has its place."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

from modal.errors import spelling_hint
from modal.scene.features import Described
from modal.scene.motion import Ground, Moved
from modal.scene.points import (
    CarrierPoint,
    GroundPoint,
    PendulumPoint,
    parse_point,
    places_of,
    point_problems,
    points_at,
)
from modal.scene.supports import Cart, ModalSupport

TURNING = "tilt and platform"
"""The kinds of supports that turn, of those that come with the toolkit."""
WAYS = {"cart": ("horizontal",), "heave": ("vertical",)}
"""The only direction in which a force on a support does anything, by its kind."""
RESERVED = re.compile(r"ground|pendulum|cart|support|theta(_.*)?|time|work|x", re.ASCII)
"""Names that mean something else in places, in points or in columns."""
SUPPORTS_MAX = 1000
"""Limit: supports of a scene; more are refused."""
SPRINGS_MAX = 100_000
"""Limit: springs of a scene, counting those of every copy; more are refused."""


def structure_problems(scene: Described) -> Iterator[str]:
    """Return every mistake in supports and springs, except imbalances."""
    if len(scene.supports) > SUPPORTS_MAX:
        yield f".support: has {len(scene.supports)} supports: at most {SUPPORTS_MAX}"
        return
    yield from _name_problems(scene)
    yield from _ground_problems(scene)
    for index, pendulum in enumerate(scene.pendulum):
        yield from _hanging_problems(scene, pendulum, f".pendulum[{index}]")
    if len(scene.spring) > SPRINGS_MAX:
        yield f".spring: has {len(scene.spring)} springs: at most {SPRINGS_MAX}"
        return
    for index, spring in enumerate(scene.spring):
        yield from _spring_problems(scene, spring, f".spring[{index}]")
    if scene.is_structured:
        yield from _limits(scene)


def place_of(scene: Described, index: int) -> str:
    """Return the place of a support: `.support`, or `.support[1]` of several."""
    return f".support[{index}]" if isinstance(scene.support, tuple) else ".support"


# ------------------------------------------------------------------------------------------------------- names


def _name_problems(scene: Described) -> Iterator[str]:
    several, first = isinstance(scene.support, tuple), dict[str, int]()
    for index, support in enumerate(scene.supports):
        name, at = getattr(support, "name", ""), f"{place_of(scene, index)}.name"
        if not name:
            if several and not isinstance(support, Moved):
                yield f"{at}: is required among several supports"
            continue
        if RESERVED.fullmatch(name) or name in support.fields:
            yield f'{at} = "{name}": is reserved'
        elif not re.search("[A-Za-z]", name):
            yield f'{at} = "{name}": must have a letter'
        elif name in first:
            yield f'{at} = "{name}": is the name of support[{first[name]}] too'
        first.setdefault(name, index)
    yield from _clashes(scene)


def _clashes(scene: Described) -> Iterator[str]:
    """Names of different supports whose coordinates, or the forces on them, would have one name."""
    first_indices: dict[str, int] = {}
    for index, support in enumerate(scene.supports):
        name = getattr(support, "name", "")
        numbers = range(1, len(support.M or ()) + 1) if isinstance(support, ModalSupport) else ()
        coordinates = support.path.coordinates if hasattr(support, "path") else ()
        suffixes = [*(part for each in coordinates for part in (each.suffix, each.force_suffix))]
        suffixes += [*map(str, numbers), *(f"{k}_force" for k in numbers)]
        for suffix in suffixes if name else ():
            first = first_indices.setdefault(f"{name}_{suffix}", index)
            if scene.supports[first].name != name:
                yield f'.support[{index}].name = "{name}": gives {name}_{suffix} to support[{first}] too'


def _ground_problems(scene: Described) -> Iterator[str]:
    several = isinstance(scene.support, tuple)
    for index, support in enumerate(scene.supports):
        if not isinstance(support, Moved):
            continue
        at = f'{place_of(scene, index)}.kind = "moved"'
        if several:
            yield f"{at}: cannot stand among several supports: write [ground] with its motion"
        elif isinstance(scene.ground, Ground):
            yield f"{at}: cannot be combined with [ground], which moves it: give the motion once"
    for index, support in enumerate(scene.supports if scene.ground else ()):
        if isinstance(support, ModalSupport):
            at = f'{place_of(scene, index)}.kind = "modal"'
            yield f"{at}: does not define how ground motion acts on its own mass: omit [ground]"


# ------------------------------------------------------------------------------------------------------- pendula


def _hanging_problems(scene: Described, pendulum: Any, at: str) -> Iterator[str]:
    """What is wrong with where a pendulum hangs."""
    names = scene.support_names
    if pendulum.on is None:
        if isinstance(scene.support, tuple):
            known = [f'"{support.name}"' for support in scene.supports if getattr(support, "name", "")]
            yield f"{at}.on: is required among several supports" + ": " * bool(known) + ", ".join(known)
        elif isinstance(scene.support, ModalSupport):
            yield f'{at}.on: is required on a modal support: write on = "{names[0]}[0]"'
        return
    where = f'{at}.on = "{pendulum.on}"'
    try:
        point = parse_point(pendulum.on)
    except ValueError:
        yield f"{where}: is not the name of a support{spelling_hint(pendulum.on, names)}"
        return
    if point is None:
        yield from (f"{where}: {words}" for words in point_problems(scene, pendulum.on))
        return
    if not isinstance(point, CarrierPoint):
        yield f"{where}: is not the name of a support" + (
            ": hang it from one of kind fixed" if isinstance(point, GroundPoint) else ""
        )
        return
    if problems := list(point_problems(scene, pendulum.on)):
        yield from (f"{where}: {words}" for words in problems)
    elif point.place != (0.0, 0.0):
        place = list(point.place)
        yield f'{where}: omit the place here: write on = "{point.name}" and position = {place}'
    elif point.point is not None and pendulum.position != (0.0, 0.0):
        yield f"{at}.position: cannot be combined with a numbered point: leave it out"


def _spring_problems(scene: Described, spring: Any, at: str) -> Iterator[str]:
    problems: list[str] = []
    for end, text in enumerate(spring.between):
        words = [*point_problems(scene, text), *_end_problems(scene, spring, text)]
        problems += [f'{at}.between[{end}] = "{text}": {why}' for why in dict.fromkeys(words)]
    yield from problems
    if problems:
        return
    first, second = (points_at(scene, text) for text in spring.between)
    if max(first, second) > SPRINGS_MAX:
        yield f"{at}.between: joins {max(first, second)} points: at most {SPRINGS_MAX}"
        return
    if first != second and 1 not in {first, second}:
        yield f"{at}.between: joins {first} points to {second}: as many of both, or one"
        return
    bodies = [_bodies(scene, text, spring.kind) for text in spring.between]
    pairs = zip(*(body * (max(first, second) // len(body)) for body in bodies), strict=True)
    if any(first_body == second_body for first_body, second_body in pairs):
        at_rest = bodies[0][0] == ("ground", 0)
        yield f"{at}.between: both ends are " + ("at rest" if at_rest else "on one body") + ": it would do nothing"


def _end_problems(scene: Described, spring: Any, text: str) -> Iterator[str]:
    """Where a spring cannot end although the point is there."""
    point = parse_point(text)
    torsion = spring.kind == "torsion"
    if isinstance(point, GroundPoint):
        if torsion and point.place is not None:
            yield 'an angle has no place: write "ground"'
        return
    if isinstance(point, PendulumPoint):
        if point.pendulum < len(scene.pendulum) and point.link < len(scene.pendulum[point.pendulum].links):
            if torsion and point.below is not None:
                yield "an angle has no place: omit @"
            if scene.pendulum[point.pendulum].links[point.link].hoist:
                yield "the length of this rope changes, and no spring can end on it"
        return
    support = _support(scene, point)
    if torsion and support is not None and not _turns(support):
        yield f"a support of kind {support.kind} does not turn: torsion acts on links, {TURNING}, ground"
    elif torsion and isinstance(point, CarrierPoint) and point.place != (0.0, 0.0):
        yield "an angle has no place: omit @"


def _support(scene: Described, point: CarrierPoint | None) -> Any:
    """The support of a point, None if there is none."""
    if point is None:
        return None if isinstance(scene.support, tuple) else scene.support
    names = scene.support_names
    return scene.supports[names.index(point.name)] if point.name in names else None


def _turns(support: Any) -> bool:
    """Whether a support turns by one of its coordinates."""
    return hasattr(support, "path") and support.path.turning is not None


def _bodies(scene: Described, text: str, kind: str) -> list[tuple[str, int]]:
    """The body of every point or angle that an end of a spring of this kind means; what is fixed belongs to the ground.

    So does the axis of a support that tilts; points of a modal support are bodies of their own.
    """
    point = parse_point(text)
    if isinstance(point, GroundPoint):
        return [("ground", 0)]
    if isinstance(point, PendulumPoint):
        return [("link", place.link) for place in places_of(scene, text)]
    support = _support(scene, point)
    if support is None or support.kind in {"fixed", "moved"}:
        return [("ground", 0)]
    is_pivoted = _turns(support) and len(support.path.coordinates) == 1 and not support.path.bends
    if kind == "linear" and is_pivoted and point is not None and point.place == (0.0, 0.0):
        return [("ground", 0)]
    number = 0 if point is None or point.point is None else point.point
    return [(f"support {scene.supports.index(support)}", number)]


# ------------------------------------------------------------------------------------------------------- forces


def force_problems(scene: Described, force: Any) -> Iterator[str]:
    """Return what is wrong with a force on a support of a structure, or on the ground."""
    point = parse_point(force.on)
    if isinstance(point, GroundPoint):
        yield "the ground cannot be moved by a force: name a support or a link"
        return
    if isinstance(point, PendulumPoint) or any(True for _ in point_problems(scene, force.on)):
        return
    support = _support(scene, point)
    if support is None:
        return
    if support.kind in {"fixed", "moved"}:
        yield f"a support of kind {support.kind} cannot be moved by a force: name a link"
    elif not scene.is_structured and point is not None:
        yield 'the cart does not turn, and all its points move alike: write on = "cart"'
    elif force.direction == "torque" and not _turns(support):
        yield f"a support of kind {support.kind} does not turn: a torque acts on tilt, platform and links"
    elif force.direction != "torque" and force.direction not in WAYS.get(support.kind, (force.direction,)):
        yield f"a support of kind {support.kind} moves only along a {WAYS[support.kind][0]} force"


# ------------------------------------------------------------------------------------------------------- limits


def _limits(scene: Described) -> Iterator[str]:
    """The features that structures do not support yet."""
    if scene.space == "space":
        yield '.space = "space": a structure moves in the plane: write space = "plane"'
    for index, support in enumerate(scene.supports):
        if not isinstance(support, Cart):
            continue
        at = place_of(scene, index)
        if support.mass == 0:
            yield f"{at}.mass = 0.0: must be positive in a structure"
        for name in ("friction", "friction_coefficient"):
            if value := getattr(support, name):
                yield f"{at}.{name} = {value!r}: dry friction is not supported in a structure: give damping"
    for k, force in enumerate(scene.force):
        if force.kind == "constant":
            why = "constant forces are not supported in a structure, whose equilibrium they would move"
            yield f'.force[{k}].kind = "constant": {why}'
    for p, pendulum in enumerate(scene.pendulum):
        for i, link in enumerate(pendulum.links):
            if link.friction:
                at = f".pendulum[{p}].links[{i}].friction = {link.friction!r}"
                yield f"{at}: dry friction is not supported in a structure: give damping"
        if scene.spring and "up" in pendulum.ways:
            yield f".pendulum[{p}].equilibrium: inverted links cannot be combined with springs between points"
