"""Base class of supports: the motion of the origin, the rotation coordinate, and the stored energy.

A support is a rigid body with coordinates η, whose mass, inertia about the centre of mass, `centre`, springs and
dampers a scene gives. Its origin is displaced by (x, z)(η) from the drawn position, x along the rail and z down; its
angle φ, if it turns, is one of η. A point s along it and h below its origin as drawn moves as

    r = (x, z)(η) + (s cos φ + h sin φ, h cos φ − s sin φ),      r'' = J η'' + J' η'

J and J' η' follow from `place` by jets, exactly; all results for a scene follow from them.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, ClassVar, NamedTuple

from modal.extend.registry import Extension, Parameter
from modal.extend.scalars import Jet, along, plus

Slope = tuple[Any, Any]


class SupportCoordinate(NamedTuple):
    """A coordinate of a support in "m" or "rad", with its `way` if there are several: ("m", "sway").

    `letter` is its symbol, `verb` describes a mode that moves it; `words` describe it and a force on it in full.
    `is_mirrored` says that a mirror image reverses it.

    >>> from modal.extend import SupportCoordinate
    >>> SupportCoordinate("rad", "roll").suffix, SupportCoordinate("m").suffix
    ('roll_rad', 'm')
    """

    unit: str
    way: str = ""
    letter: str = "q"
    verb: str = "moves"
    words: tuple[str, str] = ("", "")
    is_mirrored: bool = True

    @property
    def suffix(self) -> str:
        """The suffix of the coordinate's name after the name of its support."""
        return f"{self.way}_{self.unit}" if self.way else self.unit

    def described(self, noun: str) -> tuple[str, str]:
        """Return its `words`, or those implied by its unit, with the name of its support."""
        motion, force = ("angle", "torque") if self.unit == "rad" else ("displacement", "force")
        way = f" in {self.way}" if self.way else ""
        return self.words if self.words[0] else (f"{motion}{way} of the {noun}", f"{force}{way} on the {noun}")

    @property
    def force_suffix(self) -> str:
        """The suffix of the name of the force or torque on the coordinate."""
        force = "torque" if self.unit == "rad" else "force"
        return f"{self.way}_{force}" if self.way else force


class Support(Extension):
    """A kind of support: `place` gives the displacement (along, down) of its origin in m, 0 if all η are 0.

    `parameters` are those of its kind in addition to those of all supports. `turning` is which of its `coordinates` is
    its rotation angle (rad, with the sign of link angles); None if it does not turn. `potential` (J), with zero slope
    at η = 0, is energy in addition to springs and weight.

    >>> from modal.extend import SupportCoordinate, Parameter, Support
    >>> class Disc(Support):  # it rolls along a rail
    ...     name = "disc"
    ...     coordinates = (SupportCoordinate("rad"),)
    ...     turning = 0
    ...     parameters = (Parameter("radius", "m", low=0.0),)
    ...
    ...     def place(self, eta, parameters):
    ...         return parameters["radius"] * eta[0], 0.0
    >>> Disc().motion([0.1], [2.0], {"radius": 0.3})[1:]
    (((0.3, 0.0),), (0.0, 0.0))
    """

    kind = "support"
    coordinates: ClassVar[tuple[SupportCoordinate, ...]] = ()
    parameters: ClassVar[tuple[Parameter, ...]] = ()
    turning: ClassVar[int | None] = None
    nouns: ClassVar[tuple[str, str]] = ("", "")
    """Its singular and plural names; by default its name."""

    bends: ClassVar[bool] = True
    """Whether its origin may move on a curved path."""
    keeps_speeds: ClassVar[bool] = False
    """Whether each coordinate except its angle is a length along the path of the origin, unaffected by the angle."""

    def __init_subclass__(cls) -> None:
        """Call one by its name, and several by that with an s, where it says nothing else."""
        if "nouns" not in vars(cls):
            cls.nouns = cls.name, f"{cls.name}s"

    def place(self, eta: Sequence[Any], parameters: Mapping[str, Any]) -> tuple[Any, Any]:
        """Return the displacement (m) of its origin from the drawn position, along the rail and down."""
        raise NotImplementedError

    def potential(self, eta: Sequence[Any], parameters: Mapping[str, Any]) -> Any:
        """Energy (J) in addition to that of springs and weight; its derivatives vanish where all η are 0."""
        return 0.0

    def motion(
        self, eta: Sequence[Any], rates: Sequence[Any], parameters: Mapping[str, Any]
    ) -> tuple[Slope, tuple[Slope, ...], Slope]:
        """The displacement of the origin, ∂(x, z)/∂η for each coordinate, and J' η' (m/s²)."""
        constants = {name: Jet(value) for name, value in parameters.items()}

        def place(values: Sequence[Any]) -> Any:
            return self.place(values, constants)

        d = len(eta)
        rows = [along(place, eta, [float(j == k) for j in range(d)]) for k in range(d)]
        displacement = (rows[0][0].value, rows[0][1].value) if rows else (0.0, 0.0)
        slopes = tuple((x.first, z.first) for x, z in rows)
        if d == 1:  # J' η' is r'' η'² there
            square = plus(0.0, rates[0], rates[0])
            return displacement, slopes, (plus(0.0, rows[0][0].second, square), plus(0.0, rows[0][1].second, square))
        if not self.bends:
            return displacement, slopes, (0.0, 0.0)
        x, z = along(place, eta, rates)
        return displacement, slopes, (x.second, z.second)

    def forces(self, eta: Sequence[Any], parameters: Mapping[str, Any]) -> list[Jet] | None:
        """Return for each coordinate the `potential` as a jet along it; None without one."""
        if type(self).potential is Support.potential:
            return None
        constants = {name: Jet(value) for name, value in parameters.items()}

        def energy(values: Sequence[Any]) -> Any:
            return [self.potential(values, constants)]

        return [along(energy, eta, [float(j == k) for j in range(len(eta))])[0] for k in range(len(eta))]

    @classmethod
    def mistakes(cls) -> Iterator[str]:
        """Names already taken, no coordinate, an unknown unit, repeated names, no angle to turn by."""
        suffixes = [coordinate.suffix for coordinate in cls.coordinates]
        if cls.name in {"fixed", "moved", "modal"}:
            yield f'a support of kind "{cls.name}" exists'
        if not suffixes:
            yield "it has no coordinates"
        if unknown := sorted({coordinate.unit for coordinate in cls.coordinates} - {"m", "rad"}):
            yield f"units of coordinates are m and rad, not {', '.join(unknown)}"
        if len(set(suffixes)) < len(suffixes) or (len(suffixes) > 1 and not all(each.way for each in cls.coordinates)):
            yield "each of several coordinates needs a way of its own"
        if cls.turning is not None and (cls.turning >= len(suffixes) or cls.coordinates[cls.turning].unit != "rad"):
            yield f"turning = {cls.turning}: is no coordinate in rad"
