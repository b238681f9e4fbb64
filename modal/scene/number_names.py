"""Names of a scene's parameters in words: "length of link 1 of pendulum 1 (m)", not a path from 0.

Pendula and links are counted from 1 as they hang, with all copies, as the table and the films count them.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import accumulate
from typing import NamedTuple

from modal.report import as_csv, as_json, deferred, grid, titled
from modal.scene.doors import checked
from modal.scene.model import Scene
from modal.scene.parameters import Place, Step, find_places, number_at, number_paths, unit_at
from modal.scene.titles import title_of

QUANTITIES = {
    "angle_deg": "angle",
    "angles_deg": "angle",
    "azimuths_deg": "azimuth",
    "begin": "begin",
    "centre": "distance of the centre of mass",
    "count": "number of copies",
    "damping_ratio": "damping ratio",
    "drag": "linear drag",
    "duration": "duration",
    "frequency_hz": "frequency",
    "friction": "dry friction",
    "friction_coefficient": "coefficient of friction",
    "from_hz": "first frequency",
    "inertia": "moment of inertia",
    "length_m": "length",
    "loss": "loss angle",
    "phase_deg": "phase",
    "quadratic_drag": "quadratic drag",
    "ramp": "share of the ramps",
    "rate_deg": "rate",
    "rates_deg": "rate",
    "roll_deg": "roll",
    "roll_rate_deg": "rate of roll",
    "time_s": "time",
    "to": "length at the end",
    "to_hz": "last frequency",
    "wire_loss": "loss angle of the wire",
}
"""Of keys whose names do not say it."""
CARRIERS = {
    "cart": "cart",
    "fixed": "support",
    "heave": "heaving support",
    "modal": "linear structure",
    "moved": "support",
    "platform": "platform",
    "swing": "swing",
    "tilt": "tilting board",
}
"""A support in a word."""
WAYS = {"position": ("position to the right", "position downwards"), "centre": ("centre to the right", "centre below")}
"""The two numbers of a pair."""
ANGLES = {"loss", "wire_loss"}
"""Keys of angles in rad."""
ENDINGS = {"_rate_deg": "°/s", "_deg": "°", "_hz": "Hz"}
"""Units that the endings of keys imply."""
DIMENSIONLESS = "–"
PHYSICAL = {
    *("gravity", "mass", "length", "centre", "inertia", "stiffness", "damping"),
    *("friction", "drag", "quadratic_drag", "rotor_inertia"),
}
COURSES = {"start", "hoist", "motion"}
"""Keys of the parts of a scene, and of those that prescribe its motion."""


@checked
def number_label(scene: Scene, path: str) -> str:
    """Return the name of the number at a path with its unit, a dash if dimensionless; raise SceneError if none.

    >>> from modal import load
    >>> number_label(load("crane-hook"), "pendulum[0].links[0].length")
    'length of link 1 of pendulum 1 (m)'
    >>> number_label(load("crane-hook"), "support.mass")
    'mass of the cart (kg)'
    """
    return f"{number_words(scene, path)} ({number_unit(scene, path)})"


@checked
def number_words(scene: Scene, path: str) -> str:
    """Return the same without its unit.

    >>> from modal import load
    >>> number_words(load("two-swings"), "spring[0].stiffness")
    'stiffness of spring 1'
    >>> number_words(load("chain-3"), "pendulum[0].links[*].damping")
    'damping of links 1–3 of pendulum 1'
    """
    places = find_places(scene, path)
    first = places[0]
    what, *owners = _parts(scene, first, places)
    return " ".join([what, *(f"of {owner}" for owner in owners)]) + " at the start" * ("start" in first)


@checked
def number_unit(scene: Scene, path: str) -> str:
    """Return its unit, N for a force and N m for a torque; a dash for a dimensionless number.

    >>> from modal import load
    >>> number_unit(load("crane-hook"), "gravity"), number_unit(load("crane-hook"), "damping_ratio")
    ('m/s²', '–')
    """
    place = find_places(scene, path)[0]
    if place[0] == "force" and place[-1] == "amplitude":
        return "N m" if scene.force[int(place[1])].direction == "torque" else "N"
    if place[0] == "feedback":
        unit: str = deferred("modal.statespace.loops:unit_of")(scene, *place[1:3])
        return unit
    if ANGLES & {step for step in place if isinstance(step, str)}:
        return "rad"
    name = str(place[-1])
    return unit_at(scene, place) or next((unit for end, unit in ENDINGS.items() if name.endswith(end)), DIMENSIONLESS)


class NamedNumber(NamedTuple):
    """A number of a scene: its place, its value with its unit, and its meaning."""

    place: str
    value: float
    unit: str
    words: str
    is_physical: bool
    """Whether it is a mass, a length, a stiffness or the like, neither 0 nor a start or a course in time."""


@checked
def scene_numbers(scene: Scene) -> list[NamedNumber]:
    """Return every number of a scene, whether it is written in the file or left at its default.

    >>> from modal import load
    >>> [number.place for number in scene_numbers(load("chain-1")) if number.is_physical]
    ['gravity', 'pendulum[0].links[0].length', 'pendulum[0].links[0].mass']
    """
    numbers = []
    for path in number_paths(scene):
        (place,) = find_places(scene, path)
        value = number_at(scene, place)
        is_physical = value != 0 and bool(PHYSICAL & set(place)) and not COURSES & set(place)
        numbers.append(NamedNumber(path, value, number_unit(scene, path), number_words(scene, path), is_physical))
    return numbers


@checked
def numbers_table(scene: Scene, form: str = "text") -> str:
    """Return every number of a scene as text, "markdown", "csv" or "json": place, value, unit and meaning."""
    numbers = scene_numbers(scene)
    records = [{"place": at.place, "value": at.value, "unit": at.unit, "number": at.words} for at in numbers]
    if form == "csv":
        return as_csv(records)
    if form == "json":
        return as_json({"numbers": records})
    cells = [[at.place, f"{at.value:.9g}", at.unit, at.words] for at in numbers]
    return titled(title_of(scene), "numbers", [grid(cells, ("place", "value", "unit", "number"), form)], form)


def _parts(scene: Scene, place: Place, places: Sequence[Place]) -> list[str]:
    """The name of a number, and the parts that it belongs to, from the inside out."""
    match place:
        case ("pendulum", entry, *inner):
            counts = [pendulum.count for pendulum in scene.pendulum]
            pendula = _ranges(_numbers_of(counts, {at[1] for at in places}), "pendulum", "pendula")
            return [*_of_pendulum(scene, int(entry), inner, places), pendula]
        case ("support", *inner):
            return _of_support(scene, inner)
        case ("feedback", entry, *inner):
            return [_quantity(inner), f"loop {int(entry) + 1} of feedback"]
        case ("spring" | "force" as kind, _, *inner):
            word = "torque" if kind == "force" and scene.force[int(place[1])].direction == "torque" else str(kind)
            return [_quantity(inner), _ranges(sorted({int(at[1]) + 1 for at in places}), word, f"{word}s")]
        case ("ground", "motion", *inner):
            return [*_of_motion(inner), "the ground"]
        case (name, int(row)):
            return [_quantity([name]), f"mode {row + 1}"]
    return [_quantity(place)]


def _of_pendulum(scene: Scene, entry: int, inner: Sequence[Step], places: Sequence[Place]) -> list[str]:
    match inner:
        case ("links", _, *rest):
            links = {int(at[3]) for at in places if at[1] == entry}
            counts = [link.count for link in scene.pendulum[entry].links]
            link = _ranges(_numbers_of(counts, links), "link", "links")
            owners = {"hoist": "the hoist", "drive": "the drive"}
            return [_quantity(rest), *(owners[str(step)] for step in rest[:1] if step in owners), link]
        case ("start", name, int(_)):
            links = {int(at[4]) + 1 for at in places if at[1] == entry}
            return [_quantity([name]), _ranges(sorted(links), "link", "links")]
    return [_quantity(inner)]


def _of_support(scene: Scene, inner: Sequence[Step]) -> list[str]:
    several = isinstance(scene.support, tuple)
    support = scene.supports[int(inner[0])] if several else scene.supports[0]
    inner = inner[1:] if several else inner
    name = getattr(support, "name", "")
    owner = f"the {CARRIERS.get(support.kind, support.kind)}" + f" {name}" * bool(name)
    if inner[0] == "motion":
        return [*_of_motion(inner[1:]), owner]
    return [_quantity(inner), owner]


def _of_motion(inner: Sequence[Step]) -> list[str]:
    """A number of a motion; of several ones the first is counted 1."""
    if isinstance(inner[0], int):
        return [_quantity(inner[1:]), f"motion {inner[0] + 1}"]
    return [_quantity(inner), "the motion"]


def _quantity(steps: Sequence[Step]) -> str:
    """What the last key names: of a number of a platform its way, too, and which of a list."""
    names = [str(step) for step in steps if isinstance(step, str)]
    number = steps[-1] if isinstance(steps[-1], int) else None
    if names[-1] in WAYS and number is not None:
        return WAYS[names[-1]][number]
    if names[-2:-1] in (["stiffness"], ["damping"]):
        return f"{names[-2]} in {names[-1]}"
    words = QUANTITIES.get(names[-1], names[-1].replace("_", " "))
    if names[-1].endswith("_rate"):
        words = f"rate of {names[-1].removesuffix('_rate')}"
    has_number = number is not None and names[-1] not in {"angles_deg", "rates_deg", "azimuths_deg"}
    return f"{words} {number + 1}" if has_number and number is not None else words


def _numbers_of(counts: Iterable[int], entries: Iterable[Step]) -> list[int]:
    """The numbers, from 1, of what these entries describe if each of them describes so many."""
    ends = [0, *accumulate(counts)]
    return [number for entry in sorted(map(int, entries)) for number in range(ends[entry] + 1, ends[entry + 1] + 1)]


def _ranges(numbers: Sequence[int], single: str, several: str) -> str:
    """Ascending numbers with their noun, consecutive ones as a range: links 1–3, 7."""
    runs: list[list[int]] = []
    for number in numbers:
        if runs and number == runs[-1][-1] + 1:
            runs[-1].append(number)
        else:
            runs.append([number])
    text = ", ".join(f"{run[0]}" if len(run) == 1 else f"{run[0]}–{run[-1]}" for run in runs)
    return f"{single if len(numbers) == 1 else several} {text}"
