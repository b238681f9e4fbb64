"""Numbers of a scene by their places, and the values over which they are varied: `support.mass=1:1000:50log`.

Before the sign is a place, `pendulum[2].links[0].mass` as in messages.  `[*]` means every entry of a list; all numbers
at such a place get the same value.  Values are `a:b:n` (n evenly spaced from a to b), `a:b:nlog` (logarithmically
spaced) or a list `a,b,c`, in ascending order.  Nothing is evaluated as code.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from dataclasses import field as dataclass_field
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from modal.errors import SIMILARITY_MIN, SceneError, gathered, refuse_any, spelling_hint
from modal.report import Displayed, Summary
from modal.scene.doors import shorten
from modal.scene.links import Escapement
from modal.scene.model import Scene, describe, plain_data, scene_from
from modal.scene.validation import NUMBER_SIZE_MAX, NUMBER_SIZE_MIN, Part
from modal.types import Floats

if TYPE_CHECKING:
    from modal.extend import Parameter

STEP = r"[a-z_]+(\[([0-9]{1,9}|\*)\])*"
WRITTEN = re.compile(rf"(support\.[A-Za-z0-9_]+\.)?{STEP}(\.{STEP})*", re.ASCII)
WORD = re.compile(r"[A-Za-z0-9_]+|\*", re.ASCII)
VALUES_LISTED_MAX = 5
"""Format: values and places that are written one by one."""
ABBREVIATED = {"L": "length", "M": "mass", "c": "damping", "g": "gravity", "k": "stiffness", "l": "length", "m": "mass"}
Step = str | int
Place = tuple[Step, ...]
VARIED_VALUES_MAX = 100_000
"""Limit: values of one number that is varied; more are refused."""
RANGE = re.compile(r"([^:]*):([^:]*):\s*([0-9]{1,99})\s*(log)?\s*", re.ASCII)
NUMBER = re.compile(r"\s*[+-]?(([0-9]+\.?[0-9]*|\.[0-9]+)(e[+-]?[0-9]+)?|nan|inf)\s*", re.ASCII | re.IGNORECASE)
UNITS = {
    "gravity": "m/s²",
    "mass": "kg",
    "length": "m",
    "centre": "m",
    "inertia": "kg m²",
    "rotor_inertia": "kg m²",
    "damping": "N m s/rad",
    "stiffness": "N m/rad",
    "friction": "N m",
    "drag": "N s/m",
    "quadratic_drag": "N s²/m²",
    "impulse": "N m s",
    **dict.fromkeys(("angle_deg", "angles_deg", "azimuths_deg", "phase_deg"), "°"),
    "rates_deg": "°/s",
    "energy": "J",
    "position": "m",
    "to": "m",
    "begin": "s",
    "duration": "s",
    "amplitude": "m",
    "frequency_hz": "Hz",
    "from_hz": "Hz",
    "to_hz": "Hz",
}
CART_UNITS = {"damping": "N s/m", "stiffness": "N/m", "friction": "N"}
ALONG_UNITS = {**CART_UNITS, "displacement": "m", "rate": "m/s", "sway": "m", "heave": "m"}
SUPPORT_UNITS: dict[str, Mapping[str, str]] = {
    **dict.fromkeys(("cart", "swing", "heave"), ALONG_UNITS),
    "tilt": {"angle_deg": "°", "rate_deg": "°/s"},
    "platform": {
        **{f"stiffness.{way}": "N/m" for way in ("sway", "heave")},
        **{f"damping.{way}": "N s/m" for way in ("sway", "heave")},
        **{"stiffness.roll": "N m/rad", "damping.roll": "N m s/rad"},
        **{f"start.{way}": "m" for way in ("sway", "heave")},
        **{f"start.{way}_rate": "m/s" for way in ("sway", "heave")},
    },
}
"""The units of numbers of supports that differ from those of links, by the kind of the support."""
MATRICES = {"M", "K", "D", "points"}
"""Keys of a modal support that are not varied."""
SPELT = {"m/s²": "m_per_s2", "kg m²": "kg_m2", "N s²/m²": "N_s2_per_m2"}


def find_places(scene: Scene, path: str) -> list[Place]:
    """Return every number of a scene that a path denotes; raise SceneError if there is none or it is not a number."""
    if not WRITTEN.fullmatch(path):
        raise SceneError([f"{path}: is not a place such as support.mass or pendulum[0].links[1].length"])
    places: list[tuple[Place, Any]] = [((), scene)]
    for word in _by_index(scene, WORD.findall(path)):
        places = [((*place, step), value) for place, at in places for step, value in _steps(at, word)]
    missing = next((place for place, value in places if not _is_number(value)), None)
    if missing is not None or not places:
        raise SceneError([_unknown(scene, path if missing is None else with_numbers(missing), path)])
    return [place for place, _ in places]


def _by_index(scene: Scene, words: list[str]) -> list[str]:
    """The words of a place in which a support has its index for its name, and one support alone neither."""
    if words[0] != "support" or len(words) < 3:
        return words
    names, word = scene.support_names, words[1]
    if isinstance(scene.support, tuple):
        return [words[0], str(names.index(word)), *words[2:]] if word in names else words
    return [words[0], *words[2:]] if word in {*names, "0", "*"} and word not in scene.support.fields else words


def unit_at(scene: Scene, place: Place) -> str:
    """Return the unit of the number at one of the scene's places, "" for a count and for the size of a force or torque.

    >>> from modal import load
    >>> unit_at(load("beam"), ("support", "stiffness")), unit_at(load("two-swings"), ("spring", 0, "stiffness"))
    ('N m/rad', 'N/m')
    """
    name = str(next(step for step in reversed(place) if isinstance(step, str)))
    if place[0] == "force" and name == "amplitude":  # N, or N m of a torque
        return ""
    if parameter := law_parameter(scene, place):
        return parameter.unit
    units: Mapping[str, str] = {}
    if place[0] == "support" and "motion" not in place:
        support = _at(scene, place[: 1 + isinstance(place[1], int)])
        units = SUPPORT_UNITS.get(getattr(support, "kind", "")) or _units_of(support)
    elif place[0] == "spring" and _at(scene, place[:2]).kind == "linear":
        units = CART_UNITS
    return units.get(name) or units.get(".".join(map(str, place[-2:]))) or UNITS.get(name, "")


def _units_of(part: Any) -> dict[str, str]:
    """The units that the fields of a support state, those of its start and its laws among them."""
    units = {}
    for name, entry in part.fields.items() if isinstance(part, Part) else ():
        value = getattr(part, name)
        units[name] = entry.unit
        units |= {f"{name}.{key}": unit for key, unit in _units_of(value).items() if unit}
    return units


def number_at(scene: Scene, place: Place) -> float:
    """Return the number at one of the scene's `places`."""
    return float(_at(scene, place))


def law_parameter(scene: Scene, place: Place) -> Parameter | None:
    """Return the parameter of a joint law or point force to which a number belongs, None for any other.

    >>> from modal import load
    >>> law_parameter(load("chain-2"), ("gravity",))
    """
    if {"law", "point_force"}.isdisjoint(place):
        return None
    parameters: tuple[Parameter, ...] = _at(scene, place[:-1]).law.parameters
    return next(parameter for parameter in parameters if parameter.name == place[-1])


def with_numbers(place: Place) -> str:
    """A place as written in messages."""
    return "".join(f"[{step}]" if isinstance(step, int) else f".{step}" for step in place).removeprefix(".")


def is_of_switch(scene: Scene, place: Place) -> bool:
    """Whether a number belongs to an escapement or to dry friction."""
    if place[-1] in {"friction", "friction_coefficient"}:
        return True
    return place[-2:-1] == ("drive",) and isinstance(_at(scene, place[:-1]), Escapement)


def vary(scene: Scene, values: Mapping[str, float]) -> Scene:
    """Return the scene with other numbers at these paths, checked again; raise SceneError with every mistake.

    >>> from modal import load
    >>> vary(load("paper-cart-2"), {"support.mass": 7.0, "pendulum[*].links[*].damping": 0.1}).support.mass
    7.0
    """
    return Variable(scene, values).at(values)


class Variable:
    """A scene whose numbers at these paths are varied repeatedly; raises SceneError for an invalid place."""

    def __init__(self, scene: Scene, paths: Iterable[str]) -> None:
        self.scene = scene
        self.places = {path: find_places(scene, path) for path in paths}

    @cached_property
    def _data(self) -> Any:
        return describe(self.scene)

    def at(self, values: Mapping[str, float]) -> Scene:
        """Return the scene with these numbers at all its paths, checked again; raise SceneError with every mistake."""
        for path, places in self.places.items():
            value = float(values[path])
            for place in places:
                self._set_value(place, int(value) if place[-1] == "count" and value.is_integer() else value)
        return scene_from(self._data)

    def _set_value(self, place: Place, value: float) -> None:
        """The value at a place of the data, from which parts that are left at their defaults are missing."""
        data, part = self._data, self.scene
        for step in place[:-1]:
            part = _step_into(part, step)
            data = data.setdefault(step, plain_data(part)) if isinstance(data, dict) else data[step]
        data[place[-1]] = value


def _steps(at: Any, word: str) -> list[tuple[Step, Any]]:
    """The steps from a part or a list that a word denotes, for "*" all possible ones, and where they lead."""
    if word == "*":
        return list(enumerate(at)) if isinstance(at, tuple) else []
    step: Step = int(word) if word.isdigit() else word
    return [(step, _step_into(at, step))]


def _at(scene: Scene, place: Place) -> Any:
    """The value at a place, None if there is none."""
    at: Any = scene
    for step in place:
        at = _step_into(at, step)
    return at


def _step_into(at: Any, step: Step) -> Any:
    if isinstance(step, int):
        return at[step] if isinstance(at, tuple) and step < len(at) else None
    is_field = isinstance(at, Part) and step in at.fields and step not in MATRICES
    return getattr(at, str(step)) if is_field else None


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _unknown(scene: Scene, name: str, path: str) -> str:
    numbers = number_paths(scene)
    hint = spelling_hint(name, numbers, cutoff=SIMILARITY_MIN) or _of_that_key(name, numbers)
    if ".start." in name and not any(".start." in place for place in numbers):
        hint = ": its file gives no pendulum a `start`"
    if name.startswith("pendulum[") and any(pendulum.count > 1 for pendulum in scene.pendulum):
        hint += "; the pendula of a `count` share their numbers: write them one by one to change those of one alone"
    return f"{path}: " + ("" if name == path else f"{name} ") + "is not a number of this scene" + hint


def _of_that_key(name: str, numbers: Sequence[str]) -> str:
    """The places whose last key is this word, or what it abbreviates or misspells."""
    keys = {place: re.findall(r"[a-z_]+", place)[-1] for place in numbers}
    word = name.rpartition(".")[2].partition("[")[0]
    key = word if word in keys.values() else ABBREVIATED.get(word, word.rpartition("_")[2])
    places = [place for place in numbers if keys[place] == key]
    candidates = places or [place for place in numbers if spelling_hint(word, [keys[place]], cutoff=SIMILARITY_MIN)]
    remainder = f", … {len(candidates) - VALUES_LISTED_MAX} more" if len(candidates) > VALUES_LISTED_MAX + 1 else ""
    names = ", ".join(candidates[:VALUES_LISTED_MAX] if remainder else candidates)
    return f": there is {names}{remainder}" if candidates else ": `scene_numbers(scene)` lists them"


def number_paths(scene: Scene) -> list[str]:
    """Return the path of every number, whether it is written in the file or left at its default."""
    return sorted(map(with_numbers, _numbers(scene)))


def _numbers(part: Any, at: Place = ()) -> Iterator[Place]:
    if isinstance(part, Part):
        for name in part.fields.keys() - MATRICES:
            yield from _numbers(getattr(part, name), (*at, name))
    elif isinstance(part, tuple):
        for index, item in enumerate(part):
            yield from _numbers(item, (*at, index))
    elif _is_number(part):
        yield at


Vary = Mapping[str, ArrayLike] | str | Sequence[str] | Sequence["Variation"]
"""What is varied: numbers at places, or a grid of the texts `PLACE=VALUES`, of which one may stand alone."""
ANY_POSITIVE = {"gravity", "mass", "length", "centre", "inertia", "rotor_inertia", "stiffness"}
"""Numbers that may be anything from NUMBER_SIZE_MIN to NUMBER_SIZE_MAX."""


@dataclass(frozen=True, repr=False)
class Variation(Displayed):
    """A place and its ascending values, in the units of a scene file; `log` if in equal ratios."""

    path: str
    values: tuple[float, ...]
    log: bool = False
    scene_unit: str | None = dataclass_field(default=None, compare=False)

    def __post_init__(self) -> None:
        if not WRITTEN.fullmatch(self.path):
            raise SceneError([f"{shorten(self.path)}: is not a place such as pendulum[0].links[1].length"])
        if problem := _problem(self.values, self.log):
            raise SceneError([f"{self.path}: {problem}"])

    def _summary(self) -> Summary:
        is_short = len(self.values) <= VALUES_LISTED_MAX
        values = ", ".join(f"{value:g}" for value in (self.values if is_short else (self.values[0], self.values[-1])))
        words = values if is_short else f"{len(self.values)} values from {values.replace(', ', ' to ')}"
        return Summary(f"{self.path}: {words} {self.unit}".rstrip() + ", logarithmic" * self.log)

    @property
    def unit(self) -> str:
        """The unit of its values, "" for a count and for the size of a force or torque.

        Once it is validated for a scene it is that of the support or the spring whose number is varied.
        """
        if self.scene_unit is not None:
            return self.scene_unit
        name = re.findall(r"[a-z_]+", self.path)[-1]
        if self.path.startswith("force") and name == "amplitude":  # N, or N m of a torque
            return ""
        return (CART_UNITS if self.path.startswith("support.") else {}).get(name) or UNITS.get(name, "")

    @property
    def column(self) -> str:
        """Its name in a file: the place and the unit, `support.mass_kg`, unless the place already includes it."""
        unit = SPELT.get(self.unit) or self.unit.replace("/", "_per_").replace(" ", "_")
        has_unit = "_deg" in self.path or self.path.endswith("_hz")
        return f"{self.path}_{unit}" if unit and not has_unit else self.path


def texts_of(texts: str | Sequence[str], *, splits_commas: bool = False) -> tuple[str, ...]:
    """Return texts as a tuple, a single one as a tuple of one; with `splits_commas` it is split at commas.

    >>> texts_of("gravity=1,2,3"), texts_of("gravity, support.mass", splits_commas=True)
    (('gravity=1,2,3',), ('gravity', 'support.mass'))
    """
    if isinstance(texts, str):
        return tuple(text.strip() for text in texts.split(",")) if splits_commas else (texts,)
    return tuple(texts)


def variation_of(vary: str | Variation) -> Variation:
    """Return the single variation that a text describes, or that is given."""
    return vary if isinstance(vary, Variation) else parse_variations(vary)[0]


def parse_variations(texts: str | Sequence[str]) -> tuple[Variation, ...]:
    """Return the variations that texts describe; raise SceneError with every mistake.

    >>> parse_variations(["support.mass=1:100:3log"])
    (support.mass: 1, 10, 100 kg, logarithmic,)
    """
    variations: list[Variation] = []
    problems: list[str] = []
    for text in texts_of(texts):
        with gathered(problems):
            variations.append(_parse(text))
    refuse_any(problems)
    return tuple(variations)


def _parse(text: str) -> Variation:
    path, sign, words = text.partition("=")
    if not sign:
        raise SceneError([f"{shorten(text)}: must be PLACE=VALUES, such as support.mass=1:1000:50log"])
    try:
        values, log = _values(words)
    except ValueError as error:
        raise SceneError([f"{shorten(text)}: {error}"]) from None
    return Variation(path.strip(), values, log)


def _values(words: str) -> tuple[tuple[float, ...], bool]:
    if ":" not in words:
        return tuple(_number(word) for word in words.split(",")), False
    match = RANGE.fullmatch(words)
    if not match:
        raise ValueError("a range is FROM:TO:COUNT or FROM:TO:COUNTlog")
    low, high, count, log = _number(match[1]), _number(match[2]), int(match[3]), bool(match[4])
    if not 2 <= count <= VARIED_VALUES_MAX:
        raise ValueError(f"a range has from 2 to {VARIED_VALUES_MAX} values, not {count}")
    if not -NUMBER_SIZE_MAX <= low < high <= NUMBER_SIZE_MAX:
        raise ValueError("a range runs from a smaller to a larger finite number")
    if log and low <= 0:
        raise ValueError("a logarithmic range begins above 0")
    return tuple((np.geomspace if log else np.linspace)(low, high, count).tolist()), log


def _number(word: str) -> float:
    if not NUMBER.fullmatch(word):
        raise ValueError(f'"{shorten(word)}" is not a number')
    return float(word)


def _problem(values: Sequence[float], log: bool) -> str:
    if not 1 <= len(values) <= VARIED_VALUES_MAX:
        return f"takes from 1 to {VARIED_VALUES_MAX} values, not {len(values)}"
    if not all(abs(value) <= NUMBER_SIZE_MAX for value in values):
        return f"values must be finite and at most {NUMBER_SIZE_MAX:g}"
    if any(later <= earlier for earlier, later in pairwise(values)):
        return "values must be strictly ascending"
    return "logarithmically spaced values must be positive" if log and values[0] <= 0 else ""


def validate_variations(scene: Scene, variations: Sequence[Variation]) -> None:
    """Raise SceneError with every place and every value that the scene cannot have.

    Values that fail only in combination with those of another variation are reported at that point.  Each variation
    then knows the unit that its number has in this scene.
    """
    problems: list[str] = []
    occupied_places: set[Place] = set()
    for variation in variations:
        with gathered(problems):
            places = find_places(scene, variation.path)
            problems += _occupy(places, occupied_places)
            values = variation.values
            telling = values if places[0][-1] == "count" else (values[0], values[-1])
            problems += _refusals(scene, variation.path, telling, places)
            object.__setattr__(variation, "scene_unit", unit_at(scene, places[0]))
    refuse_any(dict.fromkeys(problems))


def _occupy(places: Sequence[Place], occupied_places: set[Place]) -> list[str]:
    """Add places to those that are varied; one message for each that is among them."""
    problems = [f"{with_numbers(place)}: is varied twice" for place in places if place in occupied_places]
    occupied_places.update(places)
    return problems


def _refusals(scene: Scene, path: str, values: Iterable[float], places: Sequence[Place]) -> Iterator[str]:
    """The scene's objections to these values themselves."""
    starts = tuple(with_numbers(place) + sign for place in places for sign in (" =", ":"))
    for value in dict.fromkeys(values):
        try:
            vary(scene, {path: value})
        except SceneError as error:
            yield from (problem for problem in error.problems if problem.startswith(starts))


def parse_vary(scene: Scene, vary: Vary) -> tuple[tuple[Variation, ...], dict[str, Floats]]:
    """Return the axes of a grid, or arrays of finite numbers by their places; raise SceneError with every mistake."""
    if isinstance(vary, Mapping):
        return (), parse_arrays(scene, vary)[1]
    if isinstance(vary, str):
        vary = [vary]
    if not isinstance(vary, list | tuple) or not all(isinstance(axis, str | Variation) for axis in vary):
        raise SceneError([f"vary {vary!r}: must be a list of PLACE=VALUES, or a mapping of places to values"])
    axes = tuple(map(variation_of, vary))
    validate_variations(scene, axes)
    return axes, {}


def parse_arrays(scene: Scene, numbers: Mapping[str, ArrayLike]) -> tuple[Variable, dict[str, Floats]]:
    """Return arrays of finite numbers by their places, and the scene they vary; raise SceneError with all mistakes."""
    variable, arrays = Variable(scene, ()), dict[str, Floats]()
    problems: list[str] = []
    occupied_places: set[Place] = set()
    for path, values in numbers.items():
        try:
            places = find_places(scene, path)
            arrays[path] = np.asarray(values, dtype=float)
        except SceneError as error:
            problems += error.problems
        except (TypeError, ValueError):
            problems.append(f"vary {path!r}: must be a place of the scene with its numbers")
        else:
            variable.places[path] = places
            problems += [f"{path}: must be finite"] * (not np.isfinite(arrays[path]).all())
            problems += _occupy(places, occupied_places)
    refuse_any(problems)
    return variable, arrays


def validate_arrays(variable: Variable, arrays: Mapping[str, Floats]) -> None:
    """Raise SceneError with every number of arrays that the scene cannot have, whatever its other numbers are."""
    problems: list[str] = []
    for path, values in arrays.items():
        places = variable.places[path]
        is_any = places[0][-1] in ANY_POSITIVE
        if values.size and not (is_any and values.min() >= NUMBER_SIZE_MIN and values.max() <= NUMBER_SIZE_MAX):
            problems += _refusals(variable.scene, path, _telling(places[0][-1], values), places)
    refuse_any(dict.fromkeys(problems))


def _telling(name: Step, values: Floats) -> list[float]:
    """Values of which one is refused if any is: all that must be whole, else both ends and the least above 0."""
    if name == "count":
        return list(np.unique(values).tolist())
    smallest = values[values > 0].min(initial=np.inf)
    return [float(values.min()), *([float(smallest)] if np.isfinite(smallest) else []), float(values.max())]
