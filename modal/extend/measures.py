"""Measures of a scene or of its motion: the base class, and how commands request a measure.

A measure states its name, words, columns and needs, and has the function that computes it: `of_modes` of the modes of a
scene, `of_orbit` of a periodic motion along one of them, `of_motion` of a whole motion, `of_members` of many motions
together. This determines the commands that accept it: motions can be measured in all, scenes in `sweep` and
`spread`.

>>> from modal.extend.measures import measure_for, taken_by
>>> measure_for("sweep", "lyapunov").columns, "beat" in taken_by("basins")
(('lyapunov_per_s',), False)
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import isfinite
from typing import Any, ClassVar

from modal.errors import SceneError, spelling_hint
from modal.extend.registry import Extension, call, find_extension, mistake_of, registered
from modal.report import Displayed, Summary

VERBS = ("sweep", "basins", "spread", "ensemble")
"""Who takes measures: three commands, and the function `ensemble`."""
LONGEST = 1e6
"""Limit: the longest motion that is measured (s)."""
MODES, MODE, SECONDS = "modes", "mode", "seconds"
SCENE_ITSELF, WHOLE_MOTION, MEMBERS_AT_ONCE = "the scene", "a whole motion", "members side by side"
LAST_TENTH = "the last tenth of a motion"
"""The sources of measures."""
MOTION = "a motion"
OF_SCENE = dict.fromkeys(
    ("basins", "ensemble"), "it belongs to a scene whatever its start, and sweep takes it over numbers"
)
FORMER = {"amplitude": "largest_angle, with cart_travel beside it", "configuration": "attractor, of basins"}
"""Former names, with the present ones."""


class Measure(Extension, Displayed):
    """A measure: described in `words`, with these `columns`, whose names end in the unit if there is one.

    In columns R stands for the number of a mode, P for that of a pendulum, L for that of a link. `counts` says what the
    N of NAME:N is, "" if there is none; `usual` is the default of N, 0 if that depends on the scene, `most` its largest
    value. `needs` says what a scene must have, `is_planar` whether motion must be planar, `is_numbered` whether its
    columns or values number modes, `refused` which commands refuse it and why. What it `reads` follows from its
    functions.

    >>> from modal.extend import Measure
    >>> class Swings(Measure):
    ...     name, words, columns = "swings", "how often the first link passes the vertical", ("swings",)
    ...
    ...     def of_motion(self, run, seconds):
    ...         return float((run.motion.links[1:, 0] * run.motion.links[:-1, 0] < 0).sum())
    >>> Swings.reads
    'a whole motion'
    """

    kind = "measure"
    words: ClassVar[str] = ""
    columns: ClassVar[tuple[str, ...]] = ()
    needs: ClassVar[str] = MOTION
    counts: ClassVar[str] = SECONDS
    usual: ClassVar[float] = 10.0
    most: ClassVar[float] = LONGEST
    reads: ClassVar[str] = ""
    is_planar: ClassVar[bool] = False
    is_numbered: ClassVar[bool] = False
    refused: ClassVar[Mapping[str, str]] = {}
    amplitude_deg: ClassVar[float] = 10.0
    """The largest angle of any link in an orbit that is measured."""

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        if not cls.reads:
            cls.reads = WHOLE_MOTION if cls.has("of_motion") else MEMBERS_AT_ONCE
            cls.reads = cls.reads if cls.has("of_motion") or cls.has("of_members") else SCENE_ITSELF
        if cls.reads == SCENE_ITSELF:
            stated = {name for base in cls.__mro__[: cls.__mro__.index(Measure)] for name in vars(base)}
            cls.counts = cls.counts if "counts" in stated else MODE * cls.has("of_orbit")
            cls.usual = cls.usual if "usual" in stated or cls.counts == SECONDS else float(cls.has("of_orbit"))
            cls.refused = OF_SCENE | {**cls.refused}

    @classmethod
    def has(cls, function: str) -> bool:
        """Whether it defines a function of this name."""
        return getattr(cls, function) is not getattr(Measure, function)

    @classmethod
    def mistakes(cls) -> Any:
        """Missing attributes and functions."""
        yield from (f"has no {name}" for name in ("words", "columns", "needs") if not getattr(cls, name))
        if not any(map(cls.has, ("of_modes", "of_orbit", "of_motion", "of_members", "of_scene"))):
            yield "has none of of_modes, of_orbit, of_motion and of_members"

    def __eq__(self, other: object) -> bool:
        return type(other) is type(self)

    def __hash__(self) -> int:
        return hash(type(self))

    def _summary(self) -> Summary:
        facts = [("columns", ", ".join(self.columns)), ("needs", self.needs)]
        return Summary(f"Measure {self.name}: {self.words}", facts)

    @property
    def whole(self) -> bool:
        """Whether N is an integer."""
        return self.counts != SECONDS

    def validate(self, number: float) -> float:
        """Return N itself; raise SceneError if it is invalid for this measure."""
        if not self.counts:
            raise SceneError([f"measure {self.name}:{number:g}: {self.name} takes no number"])
        kind = f"a {'whole ' * self.whole}number above 0 and at most {self.most:g}"
        if not (isfinite(number) and 0 < number <= self.most) or (self.whole and number != int(number)):
            raise SceneError([f"measure {self.name}:{number:g}: must have {kind}"])
        return number

    def require(self, scene: Any, seconds: float | None) -> None:
        """Raise SceneError before anything is computed if a scene does not have it, or a run is too short for it."""
        if self.is_planar and scene.space == "space":
            raise SceneError([f"measure {self.name}: only for motion in the plane"])

    # ------------------------------------------------------------------------------------------- how it is computed

    def of_modes(self, modes: Any, number: float) -> Any:
        """Measure the `Modes` of a scene with N: a number for each column, a sequence, or a mapping by columns."""
        raise NotImplementedError

    def of_orbit(self, orbit: Any, number: float) -> Any:
        """Measure the `Orbit` of mode N whose largest angle is `amplitude_deg`."""
        raise NotImplementedError

    def of_motion(self, run: Any, seconds: float) -> Any:
        """Measure a `Trajectory` of this duration (s)."""
        raise NotImplementedError

    def of_members(self, context: Any, results: Any, ending: Any) -> Any:
        """Measure S motions at once, arrays (S,); `ending` (S, K, size) are samples of their last tenth."""
        raise NotImplementedError

    def of_scene(self, scene: Any, number: float, portion: Any) -> dict[str, float]:
        """Return its values by columns for a scene, from the modes, runs or members of `portion`."""
        if self.reads == SCENE_ITSELF and self.has("of_orbit"):
            return self.values_of("of_orbit", portion.orbit(scene, int(number), self.amplitude_deg), number)
        if self.reads == SCENE_ITSELF:
            return self.values_of("of_modes", portion.modes(scene), number)
        if self.reads == WHOLE_MOTION:
            return self.values_of("of_motion", portion.run(scene, number), number)
        if self.reads == LAST_TENTH:
            return dict(portion.ending(scene, number, self.name))
        return dict(portion.member(scene, number, self.name))

    def values_of(self, function: str, *arguments: Any) -> dict[str, Any]:
        """The result of one of its functions by columns; raise ExtensionError if it fails or returns something else."""
        returned = call(self, function, *arguments)
        if isinstance(returned, Mapping):
            return {**returned}
        values = returned if isinstance(returned, list | tuple) else [returned]
        if len(values) != len(self.columns):
            words = f"{len(values)} values: must be {len(self.columns)}, of {', '.join(self.columns)}"
            raise mistake_of(self, f"{function} returned {words}")
        try:
            return dict(zip(self.columns, map(float, values), strict=True))
        except (TypeError, ValueError) as error:
            raise mistake_of(self, f"{function} returned what is no number: {error}") from error


def taken_by(verb: str, *, discover: bool = True) -> tuple[str, ...]:
    """Return the names of the measures that one of the VERBS accepts; without `discover` only loaded ones."""
    known = registered("measure", discover=discover)
    return tuple(name for name, measure in known.items() if verb not in measure.refused)


def measure_for(verb: str, text: str) -> Measure:
    """The measure named by a text such as "beat:3"; raise SceneError if there is none or the command refuses it."""
    name = text.partition(":")[0]
    measure = find_extension("measure", name)
    if measure is None:
        now = f" (is now {FORMER[name]})" if name in FORMER else ""
        hint = now or spelling_hint(name, taken_by(verb)) or f" (must be one of {', '.join(taken_by(verb))})"
        raise SceneError([f"measure {text}: no such measure{hint}"])
    if why := measure.refused.get(verb):
        raise SceneError([f"measure {text}: {verb} does not take {name}: {why}"])
    return measure()  # type: ignore[no-any-return]


def parse_request(verb: str, text: str) -> tuple[Measure, float]:
    """The measure in a text such as "frequencies:6" and its N, by default `usual`; raise SceneError for a mistake.

    >>> from modal.extend.measures import parse_request
    >>> parse_request("sweep", "frequencies:6")[1], parse_request("sweep", "largest_angle")[1]
    (6.0, 10.0)
    """
    measure, (_, colon, number) = measure_for(verb, text), text.partition(":")
    if not colon:
        return measure, measure.usual
    try:
        value = float(number)
    except ValueError:
        raise SceneError([f'measure {text}: "{number}" is not a number']) from None
    return measure, measure.validate(value)


def columns_of(name: str, columns: Sequence[str]) -> tuple[str, ...]:
    """Return those of some columns that belong to a measure, by their prefixes.

    >>> from modal.extend.measures import columns_of
    >>> columns_of("first_turn", ["energy_drift", "first_turn_1_1_s"])
    ('first_turn_1_1_s',)
    """
    measure = find_extension("measure", name)
    prefixes = tuple(column.partition("_R")[0].partition("_P")[0] for column in (measure.columns if measure else ()))
    return tuple(column for column in columns if column.startswith(prefixes))
