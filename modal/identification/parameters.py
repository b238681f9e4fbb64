"""The parameters of a scene that a fit may change, scaled so that a step of one is a large change of each.

A number that is positive by nature is p = p₀ eᶻ, so that it stays positive; one that may vanish (a damper, a spring,
friction) is p = u z with z ≥ 0, u being its natural unit in this scene: that of critical damping, of the weight's
moment m g l, and so on.  One that several places share (`modal.scene.unknowns`) is one number; a shift is u z of
either sign.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import exp, inf, isfinite, log, sqrt
from typing import Any

import numpy as np

from modal.errors import SceneError, gathered, refuse_any, spelling_hint
from modal.report import NOTHING, Displayed, Drawable, ReportTable, Result, Summary, capital, finite, short
from modal.scene import Scene, title_of
from modal.scene.doors import checked
from modal.scene.parameters import Place, Variable, law_parameter, number_at, unit_at, with_numbers
from modal.scene.unknowns import OfUnknown, Unknown, find_unknowns, unknowns_of
from modal.types import Floats

POSITIVE = ("mass", "length", "centre", "inertia", "gear_ratio", "gravity", "angle_deg")
CAN_VANISH = (
    *("damping", "stiffness", "friction", "friction_coefficient", "drag", "quadratic_drag", "strength", "impulse"),
    "rotor_inertia",
)
PLACED = ("position", "centre")
"""Keys of places in a scene, along and below, whose numbers may have either sign."""
LOG_CHANGE_MAX = 12.0
"""Limit: |z| of a positive number: a fit does not multiply or divide it by more than e¹² = 163,000."""
BOUND_DISTANCE = 1e-6
"""Tolerance: z of a number that is at its bound, 0: no record distinguishes it from 0."""
NONE = "none"
DIRECTIONS = ("sway", "heave", "roll")
PRIOR = re.compile(r"\s*([^±]+?)\s*(?:±|\+/?-)\s*([^±]+?)\s*", re.ASCII)


@dataclass(frozen=True, repr=False)
class FreeParameter(OfUnknown, Displayed):
    """An unknown of a scene, `value` there; `unit` is its natural unit, `log` whether p = p₀ eᶻ.

    `prior` is a mean with its standard deviation, in the number's own unit, whose name is `unit_name`; the number is at
    least `low`.
    """

    unknown: Unknown
    value: float
    unit: float
    log: bool
    prior: tuple[float, float] | None = None
    unit_name: str = ""
    low: float = 0.0

    def _summary(self) -> Summary:
        prior = [] if self.prior is None else [("believed", f"{self.prior[0]:g} ± {self.prior[1]:g}")]
        return Summary(f"{self.path} = {self.value:g} {self.unit_name}".rstrip(), prior)

    @property
    def start(self) -> float:
        """The z of the scene's own number."""
        return 0.0 if self.log else self.value / self.unit

    @property
    def z_min(self) -> float:
        """The smallest z."""
        return -LOG_CHANGE_MAX if self.log else self.low / self.unit

    @property
    def step(self) -> float:
        """A step of z that changes the number by a tenth, one near 0 by a part of its unit."""
        return 0.1 if self.log else 0.1 * max(self.start, 0.05)

    def at(self, z: float) -> float:
        """The number."""
        return self.value * exp(z) if self.log else self.unit * z

    def slope(self, z: float) -> float:
        """dp/dz."""
        return self.at(z) if self.log else self.unit

    def z_of(self, value: float) -> float:
        """The z of a number."""
        return log(value / self.value) if self.log else value / self.unit

    def relative_slope(self, z: float) -> float:
        """dp/dz over the number, of a shift over the mean of those that it shifts; infinite for one at 0."""
        size = self.at(z) + (self.unknown.size if self.unknown.is_shift else 0.0)
        return self.slope(z) / size if abs(size) > BOUND_DISTANCE * self.unit else inf

    @property
    def prior_of_z(self) -> tuple[float, float] | None:
        """Mean and standard deviation of z by the prior."""
        if self.prior is None:
            return None
        mean, std = self.prior
        return self.z_of(mean), std / abs(self.slope(self.z_of(mean)))


Parameter = FreeParameter
"""Its public name."""


@checked
def find_parameters(scene: Scene, paths: Iterable[str], priors: Sequence[str] = ()) -> tuple[FreeParameter, ...]:
    """The numbers at these paths, each for itself where a path has `[*]`; none for "none".

    `priors` are texts such as "pendulum[0].links[0].mass=0.15±0.002".  SceneError lists every mistake.
    """
    problems: list[str] = []
    unknowns: dict[str, Unknown] = {}
    places: dict[Place, str] = {}
    for path in paths:
        with gathered(problems):
            for entry in unknowns_of(scene, path, places) if path != NONE else ():
                if isinstance(entry, str):
                    problems.append(entry)
                else:
                    unknowns[entry.path] = entry
    beliefs: dict[str, tuple[float, float]] = {}
    for text in priors:
        with gathered(problems):
            beliefs |= _prior(scene, text)
    problems += [f"{path}: has a prior but is not free" for path in beliefs if path not in unknowns]
    parameters = []
    for path, unknown in unknowns.items():
        with gathered(problems):
            parameters.append(_parameter(scene, unknown, beliefs.get(path)))
    refuse_any(dict.fromkeys(problems))
    return tuple(parameters)


def _prior(scene: Scene, text: str) -> dict[str, tuple[float, float]]:
    path, sign, words = text.partition("=")
    match = PRIOR.fullmatch(words) if sign else None
    if not match:
        raise SceneError([f"{text:.60}: must be PLACE=VALUE±STD, such as gravity=9.81±0.01"])
    try:
        mean, std = float(match[1]), float(match[2])
    except ValueError:
        raise SceneError([f"{text:.60}: {match[1]:.20} and {match[2]:.20} must be numbers"]) from None
    unknowns = find_unknowns(scene, path.strip())
    is_possible = mean >= 0 or all(
        unknown.is_shift or _least(scene, place) < 0 for unknown in unknowns for place in unknown.places
    )
    if not (isfinite(mean) and isfinite(std) and std > 0 and is_possible):
        raise SceneError([f"{text:.60}: needs a finite value of at least 0 and a positive standard deviation"])
    return {unknown.path: (mean, std) for unknown in unknowns}


def _least(scene: Scene, place: Place) -> float:
    """The least that a number may be."""
    of_law = law_parameter(scene, place)
    return of_law.low if of_law else -inf if is_placed(place) else 0.0


def _is_positive(scene: Scene, place: Place) -> bool:
    """Whether a number is above 0 by nature."""
    if law_parameter(scene, place):
        return _least(scene, place) > 0
    return _key(place) in POSITIVE and not is_placed(place)


def _parameter(scene: Scene, unknown: Unknown, prior: tuple[float, float] | None) -> FreeParameter:
    for place in unknown.places:
        name, names = _key(place), (*POSITIVE, *CAN_VANISH)
        if "start" in place or not (name in names or is_placed(place) or law_parameter(scene, place)):
            hint = " (the start is always fitted)" if "start" in place else spelling_hint(name, names)
            raise SceneError([f"{with_numbers(place)}: is not a number that a fit can change{hint}"])
    is_log = unknown.value > 0 and all(_is_positive(scene, place) for place in unknown.places)
    if is_log and prior and prior[0] <= 0:
        raise SceneError([f"{unknown.path}: a prior of a positive number is positive"])
    unit = natural_unit(scene, unknown.place)
    low = _least_shift(scene, unknown) if unknown.is_shift else max(_least(scene, place) for place in unknown.places)
    return FreeParameter(unknown, unknown.value, unit, is_log, prior, unknown.unit_name, low)


def _least_shift(scene: Scene, unknown: Unknown) -> float:
    """The least shift that keeps each number valid; a positive number is not divided by more than others are."""
    lows = []
    for place, number in zip(unknown.places, unknown.given, strict=True):
        least = number * exp(-LOG_CHANGE_MAX) if _is_positive(scene, place) else _least(scene, place)
        lows.append(least - number)
    return max(lows)


def _key(place: Place) -> str:
    """The key of a number; of one of several, as of the stiffness of a platform in one direction, that of the whole."""
    return str(place[-2] if place[-1] in DIRECTIONS or is_placed(place) else place[-1])


def is_placed(place: Place) -> bool:
    """Whether a number is one of a pair of coordinates, as `pendulum[0].position[1]`."""
    return isinstance(place[-1], int) and place[-2] in PLACED


def natural_unit(scene: Scene, place: Place) -> float:
    """The size of a number that would change the motion greatly."""
    links = [*scene.links()]
    mass, length = sum(link.mass * link.count for link in links), max(link.length for link in links)
    rate, turns = sqrt(scene.gravity / length), "rad" in unit_at(scene, place)
    if place[0] in {"support", "spring"}:
        mass += sum(getattr(support, "mass", 0.0) for support in scene.supports)
    gear = number_at(scene, (*place[:-1], "gear_ratio")) if place[-1] == "rotor_inertia" else 1.0
    joint = length if turns or place[0] not in {"support", "spring"} else 1.0
    units = {
        "mass": mass,
        "length": length,
        "centre": length,
        "position": length,
        "inertia": mass * length**2,
        "rotor_inertia": mass * length**2 / gear**2,
        "gear_ratio": 1.0,
        "gravity": scene.gravity,
        "angle_deg": 1.0,
        "damping": mass * rate * joint**2,
        "strength": mass * rate * joint**2,
        "stiffness": mass * scene.gravity / length * joint**2,
        "friction": mass * scene.gravity * joint,
        "friction_coefficient": 1.0,
        "impulse": mass * rate * joint**2,
        "drag": mass * rate,
        "quadratic_drag": mass / length,
    }
    if law_parameter(scene, place):
        return abs(number_at(scene, place)) or {"N m s/rad": units["damping"]}.get(
            unit_at(scene, place), units["stiffness"]
        )
    return units[_key(place)]


def numbers_at(parameters: Sequence[FreeParameter], z: Floats) -> dict[str, float]:
    """The numbers by the paths of all their places."""
    return {
        with_numbers(place): number
        for parameter, value in zip(parameters, z, strict=True)
        for place, number in parameter.unknown.numbers(parameter.at(float(value))).items()
    }


@checked
def scene_with(scene: Scene, values: Mapping[str, float]) -> Scene:
    """The scene with these numbers, checked again."""
    return Variable(scene, values).at(values) if values else scene


def starts_of(parameters: Sequence[FreeParameter]) -> Floats:
    """The z of the scene's own numbers, (p,)."""
    return np.array([parameter.start for parameter in parameters])


def means_of(parameters: Sequence[FreeParameter]) -> list[str]:
    """The message on numbers that are to be equal but are not in the scene."""
    return [
        f"{parameter.words} began at {short(parameter.value)}, the mean of the scene's numbers from "
        f"{short(min(parameter.unknown.given))} to {short(max(parameter.unknown.given))}"
        for parameter in parameters
        if not (parameter.unknown.is_shift or parameter.unknown.is_even)
    ]


class FittedNumbers(Drawable, Result):
    """The results of a fit for its free numbers, with those `held` fixed, whatever was measured."""

    @property
    def fits(self) -> bool:
        """Whether standard deviations mean anything."""
        return True

    def titles(self: Any) -> tuple[str, str]:
        """The title of the scene as it was given, and the data that it was fitted to."""
        return title_of(self.given), self.what

    def to_dict(self: Any) -> dict[str, Any]:
        """A row for each number, (p,): its place, unit, value in the scene, fitted value, its standard deviation.

        Fixed ones have none, NaN.
        """
        spreads = np.array(self.stds, dtype=float)
        spreads[self.held] = np.nan
        return {
            "number": np.array([parameter.path for parameter in self.parameters]),
            "unit": np.array([parameter.unit_name for parameter in self.parameters]),
            "given": np.array([parameter.value for parameter in self.parameters]),
            "fitted": np.array(self.values),
            "std": spreads,
        }

    def table_of_numbers(self: Any, more: Mapping[str, Floats]) -> ReportTable:
        """Every number next to the scene's, with its standard deviation and `more` of them, (p,) by their headings."""
        held_rows = set(self.held.tolist())

        def spread(stds: Floats, k: int) -> str:
            return "held" if k in held_rows else f"{stds[k]:.2g}" if np.isfinite(stds[k]) else NOTHING

        spreads = {"std": self.stds, **more}
        rows = [
            [
                parameter.words,
                short(parameter.value),
                with_error(self.values[k], self.stds[k]),
                *(spread(stds, k) for stds in spreads.values()),
                parameter.unit_name,
            ]
            for k, parameter in enumerate(self.parameters)
        ]
        return ReportTable(["number", "given", "fitted", *spreads, "unit"], rows)

    def determination(self: Any) -> Iterator[str]:
        """The determined combinations of undetermined numbers, and the undetermined ones."""
        combinations = self.combinations if self.fits else ()
        yield "\n".join(f"Determined: {c.words} = {with_error(c.value, c.std)} ± {c.std:.2g}" for c in combinations)
        words = "\n".join(f"Not determined: {direction.words}." for direction in self.undetermined)
        for parameter in self.parameters:
            words = words.replace(parameter.path, parameter.words)
        yield words

    def footnotes(self: Any) -> Iterator[str]:
        """The verdict."""
        names = ("theta", "θ", "acceleration_", "x_", "y_")  # names of columns stay as they are
        return ((line if line.startswith(names) else capital(line)) + "." for line in self.verdict)

    def facts(self: Any) -> dict[str, Any]:
        """Every number, and which of them are determined."""
        return {
            "parameters": numbers_of(self, self.fitted),
            "fixed": [{"place": self.parameters[k].path, "value": float(self.values[k])} for k in self.held.tolist()],
            "combinations": [{"words": c.words, "value": c.value, "std": finite(c.std)} for c in self.combinations],
            "unidentifiable": [{"place": direction.held, "words": direction.words} for direction in self.undetermined],
        }


def numbers_of(result: Any, which: Iterable[int]) -> list[dict[str, Any]]:
    """These numbers of a fit or of a solution, with their places and standard deviations."""
    values, stds = result.values.tolist(), result.stds.tolist()
    return [{"place": result.parameters[k].path, "value": values[k], "std": finite(stds[k])} for k in which]


def with_error(value: float, std: float) -> str:
    """As many digits as the standard deviation leaves, and one."""
    if not std > 0 or not value:
        return short(value)
    digits = int(np.clip(np.ceil(np.log10(abs(value) / std)) + 2, 2, 12))
    return f"{value:.{digits}g}"
