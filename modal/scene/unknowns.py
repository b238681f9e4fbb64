"""Unknown parameters of a scene: the number at one place, or one that several places share.

    same:pendulum[*].links[0].inertia     p_k = u        one number for all these places
    shift:pendulum[*].links[0].length     p_k = p_k⁰ + u    added to the number that each place has

Either way ∂p_k/∂u = 1, so that a derivative by an unknown is the sum of those by the numbers at its places.  Several
places are a place with `[*]`, or places joined by `+`.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from modal.errors import SceneError, refuse_any, spelling_hint
from modal.report import Displayed
from modal.scene.model import Scene
from modal.scene.number_names import number_words
from modal.scene.parameters import Place, find_places, number_at, unit_at, with_numbers

WAYS = ("same", "shift")
"""How numbers share an unknown."""


@dataclass(frozen=True, repr=False)
class Unknown(Displayed):
    """The numbers at `places`, `given` in the scene: each equals the unknown or, for a "shift", is shifted by it."""

    what = "Unknown of a scene"
    shows = "path: place; value: value; unit_name: unit"

    path: str
    places: tuple[Place, ...]
    given: tuple[float, ...]
    unit_name: str = ""
    way: str = ""
    words: str = ""

    @property
    def place(self) -> Place:
        """The first of its places."""
        return self.places[0]

    @property
    def is_shift(self) -> bool:
        """Whether it is added to the numbers of the scene."""
        return self.way == "shift"

    @property
    def is_even(self) -> bool:
        """Whether the scene has one number at all its places."""
        return len({*self.given}) == 1

    @property
    def size(self) -> float:
        """The mean of the scene's numbers."""
        return self.given[0] if self.is_even else sum(self.given) / len(self.given)

    @property
    def value(self) -> float:
        """Its value in the scene: 0 for a shift, the mean for unequal numbers that are to be the same."""
        return 0.0 if self.is_shift else self.size

    def numbers(self, value: float) -> dict[Place, float]:
        """Return the numbers at its places for this value."""
        return {
            place: number + value if self.is_shift else value
            for place, number in zip(self.places, self.given, strict=True)
        }


class OfUnknown:
    """Properties of an `unknown`: its places."""

    unknown: Unknown

    @property
    def path(self) -> str:
        """Its place as written in messages."""
        return self.unknown.path

    @property
    def words(self) -> str:
        """Its name in reports."""
        return self.unknown.words

    @property
    def place(self) -> Place:
        """The first of its places."""
        return self.unknown.place

    @property
    def places(self) -> tuple[Place, ...]:
        """Its places in the scene."""
        return self.unknown.places


def find_unknowns(scene: Scene, text: str) -> tuple[Unknown, ...]:
    """Return the unknowns that a text names: each number of a place, or the shared one of `same:` and `shift:`.

    Raise SceneError if there is no such number, or the places cannot share one.

    >>> from modal import load
    >>> [unknown.path for unknown in find_unknowns(load("crane-hook"), "pendulum[0].links[*].length")]
    ['pendulum[0].links[0].length', 'pendulum[0].links[1].length']
    >>> find_unknowns(load("crane-hook"), "shift:pendulum[0].links[*].length")[0].value
    0.0
    """
    way, colon, words = (part.strip() for part in text.partition(":"))
    if not colon:
        return tuple(_unknown(scene, with_numbers(place), (place,), "") for place in find_places(scene, way))
    if way not in WAYS:
        hint = spelling_hint(way, WAYS)
        raise SceneError([f"{text:.80}: {way:.20}: is not same:PLACE or shift:PLACE, by which places share one{hint}"])
    paths = [path.strip() for path in words.split("+")]
    path = f"{way}:{'+'.join(paths)}"
    places = tuple(place for part in paths for place in find_places(scene, part))
    refuse_any(dict.fromkeys(_problems(scene, path, places)))
    return (_unknown(scene, path, places, way),)


def unknowns_of(scene: Scene, text: str, places: dict[Place, str]) -> Iterator[Unknown | str]:
    """Return the unknowns of a text, and a mistake for each number already among the `places`, which it extends."""
    for unknown in find_unknowns(scene, text):
        for place in unknown.places:
            if place in places:
                yield f"{with_numbers(place)}: is freed twice" + _sharing(unknown.path, places[place])
        places |= dict.fromkeys(unknown.places, unknown.path)
        yield unknown


def _sharing(*paths: str) -> str:
    shared = [path for path in dict.fromkeys(paths) if ":" in path]
    return f", in {' and '.join(shared)}" if shared else ""


def _unknown(scene: Scene, path: str, places: tuple[Place, ...], way: str) -> Unknown:
    given = tuple(number_at(scene, place) for place in places)
    words = " and ".join(number_words(scene, part) for part in path.removeprefix(f"{way}:").split("+"))
    words = f"shift of the {words}" if way == "shift" else words
    return Unknown(path, places, given, unit_at(scene, places[0]), way, words)


def _problems(scene: Scene, path: str, places: tuple[Place, ...]) -> Iterator[str]:
    """Why numbers at these places cannot share an unknown."""
    names = [with_numbers(place) for place in places]
    yield from (f"{path}: names {name} twice" for name in names if names.count(name) > 1)
    if len(names) == 1:
        yield f"{path}: means the one number {names[0]}: several share an unknown, so write {names[0]} alone"
    units = [unit_at(scene, place) for place in places]
    for name, unit in zip(names, units, strict=True):
        if unit != units[0]:
            yield (
                f"{path}: {names[0]} is in {units[0] or '1'} and {name} in {unit or '1'}: what they share has one unit"
            )
