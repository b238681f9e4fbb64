"""Specification of tuning: quantities of a scene by their names, free parameters with bounds, and limits.

    peak:x/cart_force          the largest magnitude of the response of an output to an input over all frequencies
    rms:tip_1                  the RMS of an output under a PSD of the support's acceleration
    rms:x/cart_force           the same under a PSD of another input
    residual                   the largest angle that a travel of the cart leaves
    damping                    the least damping ratio of the modes
    settling                   the time after which every mode is within 2 %, ln 50 over the least decay rate
    splitting:1                a measure of one column of modes or of an orbit, also of an extension

Among several a quantity has a weight, as in 2*peak:x/cart_force.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from math import inf, isfinite

from modal.errors import SceneError, gathered, refuse_any, spelling_hint
from modal.extend import find_extension
from modal.extend.measures import MODES, SCENE_ITSELF, Measure, parse_request
from modal.report import Displayed
from modal.scene import Scene
from modal.scene.parameters import Place, find_places, law_parameter, number_at, vary, with_numbers
from modal.scene.signal_names import signal_words
from modal.scene.unknowns import OfUnknown, Unknown, unknowns_of

KINDS = {
    "peak": "peak",
    "rms": "RMS",
    "residual": "residual swing",
    "damping": "damping ratio",
    "settling": "settling time",
}
"""The names of quantities."""
POSITIVE = ("mass", "length", "centre", "inertia", "gear_ratio", "gravity")
CAN_VANISH = ("damping", "stiffness", "drag", "rotor_inertia")
DIRECTIONS = ("sway", "heave", "roll")
WORDS = re.compile(r"\s*(?:(?P<weight>[^*:]+)\*)?\s*(?P<kind>[a-z][a-z0-9_-]*)\s*(?::(?P<of>.+))?\s*", re.ASCII)
FACTOR_MAX = 100.0
"""Limit: factor by which a number without bounds may change, its square of one that may vanish: "without end"."""
MASS_NUDGE = 1e-3
"""Tolerance: relative change of a mass or length by which it is seen whether the equilibrium moves."""
SOURCE = "support_acceleration"
"""The input of an RMS that names none."""


@dataclass(frozen=True, repr=False)
class Quantity(Displayed):
    """A quantity of a scene, of `output` for `input` where it is a peak or an RMS; `weight` among several."""

    what = "Quantity of a scene"
    shows = "name: name; weight: weight"

    kind: str
    output: str = ""
    input: str = ""
    weight: float = 1.0

    @property
    def name(self) -> str:
        """Its name without the weight.

        >>> parse_quantity("2*peak:x/cart_force").name
        'peak:x/cart_force'
        """
        source = f"/{self.input}" if self.kind == "peak" or self.input not in {"", SOURCE} else ""
        return f"{self.kind}:{self.output}{source}" if self.output else self.kind

    @property
    def words(self) -> str:
        """Its name in reports.

        >>> parse_quantity("peak:theta_1_1/cart_force").words, parse_quantity("settling").words
        ('peak of θ₁₁ over force on the cart', 'settling time')
        """
        if self.kind not in KINDS:
            return self.name
        signals = " over ".join(map(signal_words, self.name.partition(":")[2].split("/")))
        return f"{KINDS[self.kind]} of {signals}" if signals else KINDS[self.kind]

    @property
    def is_largest(self) -> bool:
        """Whether it is the largest of several numbers; the damping is the least."""
        return self.kind != "damping"

    @property
    def is_positive(self) -> bool:
        """Whether it is above 0 by nature, so that its logarithm counts."""
        return self.kind in KINDS and self.is_largest

    @property
    def request(self) -> tuple[Measure, float]:
        """The measure that it is, with its N."""
        return parse_request("sweep", self.name)


def parse_quantity(text: str) -> Quantity:
    """The quantity that a text such as "2*peak:x/cart_force" names; raise SceneError if it names none.

    >>> parse_quantity("rms:tip_1").input
    'support_acceleration'
    """
    match = WORDS.fullmatch(text)
    kind = match["kind"] if match else ""
    measure = find_extension("measure", kind) if kind and kind not in KINDS else None
    is_number = measure and len(measure.columns) == 1 and measure.reads == SCENE_ITSELF and measure.counts != MODES
    if not match or not (kind in KINDS or is_number):
        raise SceneError(
            [
                f"{text:.60}: must be peak:OUTPUT/INPUT, rms:OUTPUT, residual, damping or settling"
                f"{spelling_hint(kind, KINDS)}"
            ]
        )
    weight = 1.0
    if match["weight"] is not None:
        try:
            weight = float(match["weight"])
        except ValueError:
            weight = -1.0
        if not (isfinite(weight) and weight > 0):
            raise SceneError([f"{text:.60}: a weight is a number above 0"])
    of = (match["of"] or "").strip()
    if kind in {"peak", "rms"}:
        output, _, source = (part.strip() for part in of.partition("/"))
        if not output or (kind == "peak" and not source):
            example = "peak:OUTPUT/INPUT, such as peak:x/cart_force" if kind == "peak" else "rms:OUTPUT"
            raise SceneError([f"{text:.60}: must be {example}"])
        return Quantity(kind, output, source or SOURCE, weight)
    if measure:
        quantity = Quantity(kind, of, weight=weight)
        _ = quantity.request
        return quantity
    if of:
        raise SceneError([f"{text:.60}: {kind} is of the whole scene, and names nothing else"])
    return Quantity(kind, weight=weight)


@dataclass(frozen=True, repr=False)
class Limit(Displayed):
    """The upper limit of a quantity."""

    what = "Limit of a quantity"
    shows = "quantity: quantity; most: at most"

    quantity: Quantity
    most: float

    @property
    def name(self) -> str:
        """As it is written."""
        return f"{self.quantity.name}={self.most:g}"


def parse_limit(text: str, aims: Sequence[Quantity]) -> Limit:
    """A limit such as "rel_1_1=0.2" or "peak:rel_1_1/cart_force=0.2"; raise SceneError if it is none.

    An output alone is limited in the way of the first of the `aims` that is a peak or an RMS.
    """
    words, sign, number = text.rpartition("=")
    try:
        bound = float(number) if sign else inf
    except ValueError:
        bound = inf
    if not (sign and isfinite(bound) and bound > 0):
        raise SceneError([f"{text:.60}: must be OUTPUT=VALUE, such as rel_1_1=0.2, with a value above 0"])
    words = words.strip()
    kind = words.partition(":")[0]
    if kind in KINDS or find_extension("measure", kind):
        quantity = parse_quantity(words)
    else:
        first = next((aim for aim in aims if aim.input), None)
        if first is None:
            raise SceneError([f"{text:.60}: write of what: peak:{words}/INPUT={number} or rms:{words}={number}"])
        quantity = Quantity(first.kind, words, first.input)
    if not quantity.is_largest:
        raise SceneError([f"{text:.60}: a damping ratio has a least value, not a largest: maximize it"])
    return Limit(quantity, bound)


@dataclass(frozen=True, repr=False)
class FreeNumber(OfUnknown, Displayed):
    """An unknown of the scene, `value` there, that may change from `low` to `high`; `has_bounds` where requested.

    A search has levels above 0: of a shift the least of the numbers that it shifts, which the scene has at `base`.
    `low`, `high` and `start` are levels; `start` is that of the scene, or where that is 0 one from which a search can
    begin.
    """

    what = "Free number"
    shows = "path: place; start: start; low: from; high: to; unit_name: unit"

    unknown: Unknown
    value: float
    start: float
    low: float
    high: float
    has_bounds: bool
    base: float = 0.0

    @property
    def unit_name(self) -> str:
        """Its unit."""
        return self.unknown.unit_name

    @property
    def given_level(self) -> float:
        """The level in the scene, 0 if there is none."""
        return self.value + self.base

    @property
    def bounds(self) -> tuple[float, float]:
        """The least and the largest number."""
        return self.at(self.low), self.at(self.high)

    def at(self, level: float) -> float:
        """The number itself."""
        return level - self.base

    def numbers(self, level: float) -> dict[Place, float]:
        """The numbers of the scene, by their places."""
        return self.unknown.numbers(self.at(level))

    @property
    def key(self) -> str:
        """Which number of its part it is; of the stiffness of a platform in one direction that of the whole."""
        return key_of(self.place)


def key_of(place: Place) -> str:
    """The key of a number; of an entry of a list, or in one direction of a platform, that of the whole."""
    steps = [step for step in place if isinstance(step, str) and step not in DIRECTIONS]
    return str(steps[-1])


def find_free(scene: Scene, texts: Iterable[str], begin: Callable[[Place], float]) -> tuple[FreeNumber, ...]:
    """The free numbers that texts such as "pendulum[0].links[0].length=0.5:2" name; SceneError lists every mistake.

    Each is free for itself where a place has `[*]`.  `begin` gives where the search for a number that is 0 begins.
    """
    problems: list[str] = []
    numbers: dict[str, FreeNumber] = {}
    places: dict[Place, str] = {}
    for text in texts:
        path, sign, words = text.partition("=")
        with gathered(problems):
            bounds = _bounds(text, words, is_shift=path.strip().startswith("shift:")) if sign else None
            for entry in unknowns_of(scene, path.strip(), places):
                if isinstance(entry, str):
                    problems.append(entry)
                else:
                    numbers[entry.path] = _free_number(scene, entry, bounds, begin)
    if not (numbers or problems):
        problems = ["free: name a number that may change, such as pendulum[0].links[0].length"]
    refuse_any(dict.fromkeys(problems))
    return tuple(numbers.values())


def _free_number(
    scene: Scene, unknown: Unknown, bounds: tuple[float, float] | None, begin: Callable[[Place], float]
) -> FreeNumber:
    for place in unknown.places:
        _refuse(scene, place)
    _require_rest(scene, unknown)
    value, base = unknown.value, min(unknown.given) if unknown.is_shift else 0.0
    if bounds:
        ends = zip(*(unknown.numbers(bound).items() for bound in bounds), strict=True)
        for (place, first), (_, last) in ends:
            _fits(scene, with_numbers(place), (first, last))
        low, high = (bound + base for bound in bounds)
        start = min(max(value + base, low), high) or begin(unknown.place)
        low = low or 1e-9 * min(start, high)
        return FreeNumber(unknown, value, min(max(start, low), high), low, high, True, base)
    start = value + base or begin(unknown.place)
    ratio = FACTOR_MAX**2 if key_of(unknown.place) in CAN_VANISH else FACTOR_MAX
    return FreeNumber(unknown, value, start, start / ratio, start * ratio, False, base)


def _bounds(text: str, words: str, *, is_shift: bool) -> tuple[float, float]:
    first, colon, last = words.partition(":")
    try:
        low, high = float(first), float(last)
    except ValueError:
        low, high = inf, -inf
    if not colon or not (isfinite(low) and isfinite(high)):
        raise SceneError([f"{text:.80}: bounds are FROM:TO, such as 0.5:2"])
    if not low < high or (low < 0 and not is_shift):
        least = "" if is_shift else " of at least 0"
        raise SceneError([f"{text:.80}: cannot be met: bounds go from a number{least} to a larger one"])
    return low, high


def _fits(scene: Scene, path: str, bounds: tuple[float, float]) -> None:
    """Raise SceneError if a scene cannot have a number within these bounds."""
    for value in bounds:
        try:
            vary(scene, {path: value})
        except SceneError as error:
            if value == 0 and key_of(find_places(scene, path)[0]) in POSITIVE:
                raise SceneError([f"{path}={value:g}:…: cannot be met: it is above 0"]) from None
            words = error.problems[0]
            if not words.startswith(path):
                raise SceneError([f"{path} = {value:g}: {MOVES_REST}: {words}"]) from None
            raise SceneError([f"{words.rstrip('.')}: its bound cannot be met"]) from None


MOVES_REST = "changes the equilibrium, about which everything is tuned"


def _refuse(scene: Scene, place: Place) -> None:
    """Raise SceneError for a number that cannot be tuned."""
    key, path = key_of(place), with_numbers(place)
    if key == "count":
        raise SceneError([f"{path}: is a count, and only continuous numbers are tuned: tune a scene for each value"])
    is_of_law = law_parameter(scene, place) is not None
    if "start" in place or (key not in (*POSITIVE, *CAN_VANISH) and not is_of_law):
        keys = (*POSITIVE, *CAN_VANISH)
        raise SceneError([f"{path}: is not a number that can be tuned: {', '.join(keys)}{spelling_hint(key, keys)}"])
    value = number_at(scene, place)
    if value < 0:
        raise SceneError([f"{path} = {value:g}: is below 0, and what is tuned stays positive"])


def _require_rest(scene: Scene, unknown: Unknown) -> None:
    """Raise SceneError for a number whose change moves the equilibrium."""
    size = unknown.size
    if not size or key_of(unknown.place) not in {"mass", "length", "centre"}:
        return
    for change in (-MASS_NUDGE * size, MASS_NUDGE * size):
        numbers = unknown.numbers(unknown.value + change)
        try:
            vary(scene, {with_numbers(place): number for place, number in numbers.items()})
        except SceneError as error:
            words = error.problems[0]
            if not words.startswith(tuple(map(with_numbers, numbers))):
                raise SceneError([f"{unknown.path}: {MOVES_REST}: {words}"]) from None
