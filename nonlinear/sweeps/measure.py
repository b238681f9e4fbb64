"""A measure: what is asked of every scene of a sweep, by name, as a few named numbers.

A name of a number ends in its unit, `omega_1_rad_per_s`; what is a pure number has none, `damping_ratio_1`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import isfinite

from modal.errors import SceneError
from modal.scene import Scene


@dataclass(frozen=True)
class Measure:
    """A function of a scene and one number, `usual` where nobody says which (0: it finds one by itself).

    `words` say what it finds and what of.

    The function stands in a module, not in another function, so that other processes find it.  `whole` says that its
    number counts something, `numbered` that it is told, third, in the table of which scene modes have their numbers.
    """

    name: str
    function: Callable[..., dict[str, float]]
    usual: float
    words: str
    whole: bool = True
    most: float = 1000
    numbered: bool = False


@dataclass(frozen=True)
class RequestedMeasure:
    """A measure with its number."""

    measure: Measure
    number: float

    def __post_init__(self) -> None:
        if self.number != self.measure.usual:
            self.insist()

    def insist(self) -> RequestedMeasure:
        """Itself; SceneError where its number is out of range."""
        kind = f"a {'whole ' * self.measure.whole}number above 0 and at most {self.measure.most:g}"
        fits = isfinite(self.number) and 0 < self.number <= self.measure.most
        if not fits or (self.measure.whole and self.number != int(self.number)):
            raise SceneError([f"{self.measure.name}:{self.number:g}: must have {kind}"])
        return self

    @property
    def text(self) -> str:
        """As it is asked for: `frequencies:4`."""
        return f"{self.measure.name}:{self.number:g}" if self.number else self.measure.name

    def of(self, scene: Scene, table: Scene | None = None) -> dict[str, float]:
        """Its numbers of a scene; modes have their numbers in the table of `table`, left out of the scene itself."""
        return self.measure.function(scene, self.number, *([table or scene] if self.measure.numbered else []))
