"""Supports of extensions as parts of scenes: `kind = "…"` is the name of a class of `modal.extend.Support`."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

from modal.extend import Support, find_extension
from modal.extend.registry import call, mistake_of
from modal.scene.supports import PAIR, Placed, start_keys
from modal.scene.validation import NON_NEGATIVE, NUMBER_SIZE_MAX, POSITIVE, REAL, Part, field, number, one_of, optional

LAWS = {"stiffness": {"m": "N/m", "rad": "N m/rad"}, "damping": {"m": "N s/m", "rad": "N m s/rad"}}


PARTS: dict[type[Support], type[Placed]] = {}


def support_part(kind: str) -> type[Part] | None:
    """Return the class of scene parts of an extension kind; None if there is none of this name."""
    path = find_extension("support", kind)
    return None if path is None else part_of(path)


def part_of(path: type[Support]) -> type[Placed]:
    """Return the class of scene parts for this class of supports, created once."""
    if path not in PARTS:
        PARTS[path] = _made_part(path)
    return PARTS[path]


def _made_part(path: type[Support]) -> type[Placed]:
    name, body = "".join(word.capitalize() for word in re.split("[-_]", path.name)), dict[str, Any]()
    body["kind"] = field(one_of(path.name), default=path.name)
    body["mass"] = field(POSITIVE, "positive", "kg")
    if path.turning is not None:
        body["inertia"] = field(NON_NEGATIVE, "moment of inertia about the centre of mass", "kg m²", default=0.0)
        body["centre"] = field(PAIR, "of mass: along and below the origin, as drawn", "m", default=(0.0, 0.0))
    for parameter in path.parameters:
        bounds = {"ge": max(parameter.low, -NUMBER_SIZE_MAX), "le": min(parameter.high, NUMBER_SIZE_MAX)}
        default = {} if parameter.default is None else {"default": parameter.default}
        body[parameter.name] = field(number(**bounds), parameter.meaning, parameter.unit, **default)
    for law, units in LAWS.items():
        entries = {
            each.way: field(NON_NEGATIVE, "to the ground", units[each.unit], default=0.0) for each in path.coordinates
        }
        if "" in entries:
            body[law] = entries[""]
        else:
            by_way = _part(f"{name}{law.capitalize()}", (Part,), entries)
            body[law] = field(by_way.schema(), "by coordinate", default=by_way())
    starts = {}
    for each in path.coordinates:
        for key, per in zip(start_keys(each), ("", "/s"), strict=True):
            unit = ("°" if each.unit == "rad" else "m") + per
            starts[key] = field(REAL, "at the start", unit, default=0.0)
    start = _part(f"{name}Start", (Part,), starts)
    body["start"] = field(optional(start.schema()), "of a simulation", default=None)
    more = {
        "path": path(),
        "__doc__": path.__doc__,
        "__reduce__": lambda part: (_restored, (type(part.path), part.model_dump())),
        "problems": _problems,
    }
    part: type[Placed] = _part(name, (Placed,), body, more)
    return part


def _part(name: str, bases: tuple[type, ...], fields: Mapping[str, Any], more: Mapping[str, Any] = {}) -> Any:
    return type(name, bases, {**fields, **more, "__annotations__": dict.fromkeys(fields, "float")})


def _restored(path: type[Support], data: dict[str, Any]) -> Part:
    return part_of(path).model_validate(data)


def _problems(part: Any) -> Any:
    """A body without inertia; raise ExtensionError if its place or potential is not what it must be as drawn."""
    path, d = part.path, len(part.path.coordinates)
    values = {parameter.name: getattr(part, parameter.name) for parameter in path.parameters}
    rest = [0.0] * d
    call(path, "place", rest, values, shape=(2,))
    displacement, slopes, _ = call(path, "motion", rest, rest, values)
    if any(displacement):
        raise mistake_of(
            path, f"place is {tuple(map(float, displacement))} where all coordinates are 0: must be (0, 0)"
        )
    for k in range(d):
        for j in range(k):
            bends = [
                call(path, "motion", rest, [float(i in each) for i in range(d)], values)[2]
                for each in ((k, j), (k,), (j,))
            ]
            if any(abs(both - first - second) > 1e-9 for both, first, second in zip(*bends, strict=True)):
                raise mistake_of(
                    path, f"place mixes coordinates {j} and {k} to second order at rest, which is not supported"
                )
    forces = call(path, "forces", rest, values) or []
    if any(abs(jet.first) > 0.0 for jet in forces):
        raise mistake_of(path, "potential has a slope where all coordinates are 0: must be flat there")
    inertia, centre = getattr(part, "inertia", 0.0), getattr(part, "centre", (0.0, 0.0))
    for k, (coordinate, (x, z)) in enumerate(zip(path.coordinates, slopes, strict=True)):
        s, h = centre if k == path.turning else (0.0, 0.0)
        if not (x + h or z - s or (k == path.turning and inertia)):
            yield f".mass: coordinate {coordinate.suffix} has no inertia" + ": give an inertia" * (k == path.turning)
