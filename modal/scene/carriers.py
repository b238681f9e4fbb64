"""The built-in kinds of supports, defined in the same way as extensions (`modal.extend.Support`).

cart (η, 0);  swing (L sin η/L, L cos η/L − L);  tilt (0, 0);  heave (0, −η);  platform (sway, −heave)
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from modal.extend import Parameter, Support, SupportCoordinate, cos, register, sin


def swing_path(S: Any, C: Any, length: Any, rate: Any) -> tuple[tuple[Any, Any], tuple[Any, Any]]:
    """Return slope and bias of a swing whose rods have an angle with this sine and cosine."""
    ww = rate * rate / length
    return (C, -S), (-S * ww, -C * ww)


def along_arc(length: Any, sine: Any, versine: Any) -> tuple[Any, Any]:
    """Return the displacement (m) of the end of a rod of this length from its hanging position."""
    return length * sine, -(length * versine)


@register
class CartMotion(Support):
    """Along the rail."""

    name = "cart"
    coordinates = (
        SupportCoordinate("m", letter="x", words=("displacement of the cart", "force along the rail on the cart")),
    )
    nouns = ("cart", "carts")
    bends, keeps_speeds = False, True

    def place(self, eta: Sequence[Any], parameters: Mapping[str, Any]) -> tuple[Any, Any]:
        """Return the position given by its coordinate."""
        return eta[0], 0.0


@register
class SwingMotion(Support):
    """Motion on an arc, on parallel rods; its coordinate is the arc length."""

    name = "swing"
    coordinates = (
        SupportCoordinate(
            "m",
            letter="s",
            words=("displacement along its arc of the swing", "force along its arc on the swing"),
        ),
    )
    parameters = (Parameter("length", "m", low=0.0, meaning="of its rods"),)
    nouns = ("swing", "swings")
    keeps_speeds = True

    def place(self, eta: Sequence[Any], parameters: Mapping[str, Any]) -> tuple[Any, Any]:
        """Return the position from the angle η/L of its rods; 1 − cos with full precision."""
        angle = eta[0] / parameters["length"]
        half = sin(angle / 2)
        return along_arc(parameters["length"], sin(angle), 2 * (half * half))

    def motion(self, eta: Sequence[Any], rates: Sequence[Any], parameters: Mapping[str, Any]) -> Any:
        """Return the result of jets in fewer operations."""
        angle = eta[0] / parameters["length"]
        slope, bias = swing_path(sin(angle), cos(angle), parameters["length"], rates[0])
        return self.place(eta, parameters), (slope,), bias


@register
class TiltMotion(Support):
    """About its origin."""

    name = "tilt"
    coordinates = (
        SupportCoordinate("rad", letter="phi", verb="tilts", words=("angle of the board", "torque on the board")),
    )
    turning = 0
    nouns = ("board", "boards")
    bends, keeps_speeds = False, True

    def place(self, eta: Sequence[Any], parameters: Mapping[str, Any]) -> tuple[Any, Any]:
        """Its origin is the axis."""
        return 0.0, 0.0


@register
class HeaveMotion(Support):
    """Up and down."""

    name = "heave"
    coordinates = (
        SupportCoordinate(
            "m",
            letter="y",
            verb="heaves",
            words=("displacement upwards of the support", "force upwards on the support"),
            is_mirrored=False,
        ),
    )
    nouns = ("heaving support", "heaving supports")
    bends, keeps_speeds = False, True

    def place(self, eta: Sequence[Any], parameters: Mapping[str, Any]) -> tuple[Any, Any]:
        """Its coordinate is positive upwards."""
        return 0.0, -eta[0]


@register
class PlatformMotion(Support):
    """Along the rail, up and down, and about its origin."""

    name = "platform"
    coordinates = (
        SupportCoordinate(
            "m",
            "sway",
            "x",
            "sways",
            ("displacement along the rail of the platform", "force along the rail on the platform"),
        ),
        SupportCoordinate(
            "m",
            "heave",
            "y",
            "heaves",
            ("displacement upwards of the platform", "force upwards on the platform"),
            is_mirrored=False,
        ),
        SupportCoordinate("rad", "roll", "phi", "rolls", ("angle of the platform", "torque on the platform")),
    )
    turning = 2
    nouns = ("platform", "platforms")
    bends, keeps_speeds = False, True

    def place(self, eta: Sequence[Any], parameters: Mapping[str, Any]) -> tuple[Any, Any]:
        """As its first two coordinates say."""
        return eta[0], -eta[1]
