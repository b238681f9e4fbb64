"""Numbers of a scene by their places, `pendulum[2].links[0].mass` as in messages, and scenes with other numbers there.

`[*]` stands for every entry of a list.  Nothing is evaluated as code.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from typing import Any

from pydantic import BaseModel

from modal.errors import SceneError, meant
from modal.scene.model import Scene, describe, scene_from

STEP = r"[a-z_]+(\[([0-9]{1,9}|\*)\])*"
WRITTEN = re.compile(rf"{STEP}(\.{STEP})*", re.ASCII)
NEAR = 0.8  # how much of a misspelt place must be right to be guessed

Step = str | int
Place = tuple[Step, ...]


def find_places(scene: Scene, path: str) -> list[Place]:
    """Every number of a scene that a path means; SceneError where it means none or something else."""
    if not WRITTEN.fullmatch(path):
        raise SceneError([f"{path}: is not a place such as support.mass or pendulum[0].links[1].length"])
    found: list[Place] = [()]
    for word in re.findall(r"[a-z_]+|[0-9]+|\*", path):
        found = [(*place, step) for place in found for step in _steps(scene, place, word)]
    missing = next((place for place in found if not _is_number(_at(scene, place))), None)
    if missing is not None or not found:
        raise SceneError([_unknown(scene, path if missing is None else with_numbers(missing), path)])
    return found


def number_at(scene: Scene, place: Place) -> float:
    """The number at one of the scene's `places`."""
    return float(_at(scene, place))


def with_numbers(place: Place) -> str:
    """A place as messages write it."""
    return "".join(f"[{step}]" if isinstance(step, int) else f".{step}" for step in place).removeprefix(".")


def vary(scene: Scene, values: Mapping[str, float]) -> Scene:
    """The scene with other numbers at these paths, checked anew; SceneError names every mistake.

    >>> from modal import load
    >>> vary(load("paper-cart-2"), {"support.mass": 7.0, "pendulum[*].links[*].damping": 0.1}).support.mass
    7.0
    """
    data = describe(scene)
    for path, value in values.items():
        for place in find_places(scene, path):
            whole = place[-1] == "count" and float(value).is_integer()
            _put(data, place, int(value) if whole else float(value))
    return scene_from(data)


def _put(data: Any, place: Place, value: float) -> None:
    for step in place[:-1]:
        data = data[step]
    data[place[-1]] = value


def _steps(scene: Scene, place: Place, word: str) -> list[Step]:
    """The step that a word means there, or for "*" all that can be taken."""
    if word != "*":
        return [int(word) if word.isdigit() else word]
    entries = _at(scene, place)
    return list(range(len(entries))) if isinstance(entries, tuple) else []


def _at(scene: Scene, place: Place) -> Any:
    """What stands at a place, None where there is none."""
    at: Any = scene
    for step in place:
        if isinstance(at, tuple) and isinstance(step, int):
            at = at[step] if step < len(at) else None
        else:
            at = getattr(at, str(step)) if isinstance(at, BaseModel) and step in type(at).model_fields else None
    return at


def _is_number(found: object) -> bool:
    return isinstance(found, int | float)


def _unknown(scene: Scene, name: str, path: str) -> str:
    hint = meant(name, sorted(map(with_numbers, _numbers(scene))), near=NEAR)
    return f"{path}: " + ("" if name == path else f"{name} ") + "is not a number of this scene" + hint


def _numbers(part: Any, at: Place = ()) -> Iterator[Place]:
    """Every place that holds a number, whether the file writes it or leaves it to its default."""
    if isinstance(part, BaseModel):
        for name in type(part).model_fields:
            yield from _numbers(getattr(part, name), (*at, name))
    elif isinstance(part, tuple):
        for index, item in enumerate(part):
            yield from _numbers(item, (*at, index))
    elif _is_number(part):
        yield at
