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
    """A function of a scene and one number, `usual` where nobody says which; `words` say what it finds and what of.

    The function stands in a module, not in another function, so that other processes find it.  `whole` says that its
    number counts something.
    """

    name: str
    function: Callable[[Scene, float], dict[str, float]]
    usual: float
    words: str
    whole: bool = True
    most: float = 1000


@dataclass(frozen=True)
class Asked:
    """A measure with its number."""

    measure: Measure
    number: float

    def __post_init__(self) -> None:
        kind = f"a {'whole ' * self.measure.whole}number above 0 and at most {self.measure.most:g}"
        fits = isfinite(self.number) and 0 < self.number <= self.measure.most
        if not fits or (self.measure.whole and self.number != int(self.number)):
            raise SceneError([f"{self.measure.name}:{self.number:g}: must have {kind}"])

    @property
    def text(self) -> str:
        """As it is asked for: `frequencies:4`."""
        return f"{self.measure.name}:{self.number:g}"

    def of(self, scene: Scene) -> dict[str, float]:
        """Its numbers of a scene."""
        return self.measure.function(scene, self.number)
